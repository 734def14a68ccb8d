"""Modbus clients that this project did not write, against the server program."""
import csv
import json
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

TESTS = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    import npm_package
    from pymodbus.client import ModbusTcpClient
    from pymodbus.diag_message import ReturnQueryDataRequest
    from pymodbus.mei_message import ReadDeviceInformationRequest
    from wire_client import PATIENCE_S, SERVER, pb
    from wire_test import TWO_AXES, WireTest, until
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

DRIVEBENCH = SERVER.parent / "drivebench"
MODBUS = '\n[modbus]\naddress = "127.0.0.1"\nport = 0\nallow_writes = true\n'
ONE_AXIS = TWO_AXES[:TWO_AXES.rindex("[[axis]]")]
# The same motor, wound in an isolated star, with Hall lines.
STAR = ONE_AXIS + "\n[axis.machine]\nstar = true\n\n[axis.hall]\nenabled = true\n"
HEADER, PROCESS, SAMPLE, SAMPLE_LENGTH, LEASE, COMMAND, PARAMETERS = 0, 100, 200, 86, 400, 402, 1000
SENSORS_LENGTH, MORE_LEASE, MORE_COMMAND = 124, 420, 422
STATOR_RESISTANCE = PARAMETERS + 2
MIRROR = 10000
KEY = 4711


def run(*command, **options):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=120, **options)


def words(layout, *values):
    data = struct.pack(">" + layout, *values)
    return list(struct.unpack(f">{len(data) // 2}H", data))


def values(layout, registers):
    return struct.unpack(">" + layout, struct.pack(f">{len(registers)}H", *registers))


class ModbusTest(WireTest):
    def modbus_server(self, *options, text=ONE_AXIS, section=MODBUS):
        server = self.server(*options, text=text + section)
        host, port = server.ready["modbus"].rsplit(":", 1)
        server.modbus = (host, int(port))
        return server

    def pymodbus(self, server):
        client = ModbusTcpClient(server.modbus[0], port=server.modbus[1], timeout=PATIENCE_S, retries=0)
        self.assertTrue(client.connect())
        self.addCleanup(client.close)
        return client

    def read(self, client, address, count, unit=1):
        answer = client.read_holding_registers(address, count, slave=unit)
        self.assertFalse(answer.isError(), answer)
        return answer.registers

    def written(self, answer):
        self.assertFalse(answer.isError(), answer)
        return answer

    def exception(self, answer, code):
        self.assertTrue(answer.isError(), answer)
        self.assertEqual(answer.exception_code, code)

    def exchange(self, client, tick, u_a_v, u_b_v, mode=1):
        """One transaction: the command for a tick and the sample after it."""
        answer = client.readwrite_registers(
            read_address=SAMPLE, read_count=SAMPLE_LENGTH, write_address=COMMAND,
            write_registers=words("HIff", mode, tick & 0xFFFFFFFF, u_a_v, u_b_v), slave=1)
        return self.written(answer).registers


class Pymodbus(ModbusTest):
    def test_one_transaction_a_tick_commands_three_phases(self):
        """Catches: a phase c that is rounded, late or lost, sensors that do not come back with it."""
        def voltages(tick):
            return float(8 * (tick % 7) - 24), -0.5 * (tick % 5), 0.25 * (tick % 9)

        server = self.modbus_server(text=STAR)
        client = self.pymodbus(server)
        self.assertEqual(self.read(client, 41, 2), [1, 7], "a star with terminals a, b and c")
        self.written(client.write_register(MORE_LEASE, KEY, slave=1))
        samples = []
        for tick in range(400):
            answer = client.readwrite_registers(
                read_address=SAMPLE, read_count=SENSORS_LENGTH, write_address=MORE_COMMAND,
                write_registers=words("HIffff", 1, tick, *voltages(tick), 0.0), slave=1)
            samples.append(self.written(answer).registers)
        self.assertEqual(server.stop(), 0)
        other = self.modbus_server(text=STAR)
        with other.client() as tcp:
            tcp.lease()
            for tick, sample in enumerate(samples):
                u_a_v, u_b_v, u_c_v = voltages(tick)
                command = pb.Command(axis=0, tick=tick, gates=pb.GATES_VOLTAGE, u_a_v=u_a_v, u_b_v=u_b_v, u_c_v=u_c_v)
                theirs = tcp.ask(exchange=pb.Exchange(commands=[command])).exchange_reply.samples[0].sample
                self.assertEqual(values("Q", sample[:4]), (theirs.tick,))
                self.assertEqual(sample[86:92], words("fff", theirs.i_c_a, theirs.i_f_a, theirs.u_c_v))
                self.assertEqual(values("Q", sample[96:100]), (theirs.hall_lines,))
            self.assertEqual(other.stop(), 0)
        self.assertEqual(server.verdict["state_hash"], other.verdict["state_hash"])

    def test_pymodbus_reads_and_writes_every_block(self):
        """Catches: a block that an ordinary client cannot read or write, a value in another order."""
        client = self.pymodbus(self.modbus_server())
        header = self.read(client, HEADER, 30)
        self.assertEqual(header[:6], [0x4442, 1, 1, 0, MIRROR, 4])
        for at in range(6, 18, 3):
            self.assertEqual(len(self.read(client, header[at + 1], min(header[at + 2], 125))), min(header[at + 2], 125))
        self.assertEqual(header[13:15], [LEASE, 11])
        self.assertAlmostEqual(values("f", header[18:20])[0], 1.2345678, places=6)
        self.assertEqual(values("i", header[20:22]), (-123456789,))
        self.assertEqual(values("Q", header[22:26]), (0,))
        self.assertEqual(values("I", header[28:30]), (125_000,))
        mirror = self.read(client, MIRROR + 18, 4)
        self.assertEqual(mirror[1::-1] + mirror[:1:-1], header[18:22])
        self.assertEqual(client.read_input_registers(0, 30, slave=1).registers, header)
        self.assertEqual(client.read_discrete_inputs(0, 28, slave=1).bits[16:22], [True] + 5 * [False])

        self.exception(client.write_registers(STATOR_RESISTANCE, words("f", 2.0), slave=1), 6)
        self.written(client.write_register(LEASE, KEY, slave=1))
        self.assertEqual(client.read_coils(0, 2, slave=1).bits[:2], [False, True])
        self.written(client.write_registers(STATOR_RESISTANCE, words("f", 2.5), slave=1))
        self.assertEqual(values("f", self.read(client, STATOR_RESISTANCE, 2)), (2.5,))
        for word in (0x06, 0x07, 0x0F):
            self.written(client.write_registers(PROCESS + 1, words("Hhh", word, 1000, -500), slave=1))
        self.assertEqual(self.read(client, PROCESS + 4, 1)[0] & 0x6F, 0x27)
        sample = self.read(client, SAMPLE, SAMPLE_LENGTH)
        self.assertEqual(values("ff", sample[60:64]), (10.0, -5.0))
        self.written(client.mask_write_register(PROCESS + 1, 0xFFF7, 0))
        self.assertEqual(self.read(client, PROCESS + 4, 1)[0] & 0x6F, 0x23)
        tick = values("Q", self.read(client, SAMPLE, 4))[0]
        after = self.exchange(client, tick, 12.0, -3.0)
        self.assertEqual(values("Q", after[:4]), (tick + 1,))
        self.assertEqual(values("ff", after[60:64]), (12.0, -3.0))
        self.written(client.write_coil(1, True, slave=1))
        self.written(client.write_coils(0, [False, False], slave=1))
        self.assertEqual(self.read(client, LEASE + 9, 1), [0])

        echo = client.execute(ReturnQueryDataRequest(0x1234, unit=1))
        self.assertEqual(list(echo.message), [0x1234])
        told = client.execute(ReadDeviceInformationRequest(1, 0, unit=1))
        self.assertEqual(told.information[0], b"drivebench")
        self.exception(client.read_holding_registers(0, 1, slave=3), 11)
        self.exception(client.read_exception_status(slave=1), 1)

    def test_a_run_over_modbus_equals_the_same_run_over_tcp(self):
        """Catches: a command that is rounded, late or applied twice; a recording that differs from the run."""
        voltages = [(float(8 * (tick % 7) - 24), -0.5 * (tick % 5)) for tick in range(400)]
        folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-modbus-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        server = self.modbus_server("--record", folder / "modbus.mcap")
        client = self.pymodbus(server)
        self.written(client.write_register(LEASE, KEY, slave=1))
        samples = [self.exchange(client, tick, *volts) for tick, volts in enumerate(voltages)]
        self.assertEqual(server.stop(), 0)
        other = self.modbus_server("--record", folder / "tcp.mcap")
        with other.client() as tcp:
            tcp.lease()
            for tick, volts in enumerate(voltages):
                tcp.step(tick, *volts)
            self.assertEqual(other.stop(), 0)
        self.assertEqual(server.verdict["state_hash"], other.verdict["state_hash"])
        self.assertEqual(server.verdict["ticks"], other.verdict["ticks"])

        exported = run(DRIVEBENCH, "export", folder / "modbus.mcap", "--out", folder / "run.csv")
        self.assertEqual(exported.returncode, 0, exported.stderr)
        with open(folder / "run.csv", newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
        names = [column.split(" ")[0] for column in rows[0]]
        for sample in samples:
            tick, count = values("Q", sample[:4])[0], values("q", sample[36:40])[0]
            row = dict(zip(names, rows[1 + tick]))
            self.assertEqual(int(row["tick"]), tick)
            self.assertEqual(int(row["encoder_count"]), count)
            self.assertEqual(words("f", float(row["i_a_a"])), sample[56:58])

    def test_one_axis_has_one_owner_over_all_transports(self):
        """Catches: a lease that only its own transport respects, refusals that are not counted or not logged."""
        server = self.modbus_server()
        modbus, tcp = self.pymodbus(server), self.client(server)
        self.written(modbus.write_register(LEASE, KEY, slave=1))
        self.assertRefused(tcp.lease(), pb.REFUSAL_OWNED)
        self.assertRefused(tcp.exchange(0, 5.0), pb.REFUSAL_NOT_OWNER)
        self.exchange(modbus, 0, 5.0, 0.0)
        self.written(modbus.write_register(LEASE, 0, slave=1))
        self.assertDone(tcp.lease())
        self.exception(modbus.write_register(LEASE, KEY, slave=1), 6)
        self.exception(modbus.write_registers(COMMAND, words("HIff", 1, 1, 5.0, 0.0), slave=1), 6)
        sample = tcp.step(1, 3.0)
        self.assertEqual(sample.u_a_v, 3.0)
        self.assertEqual(sample.refused_commands, 0)
        self.assertIn("a write to axis 0 was refused: another session holds the lease", server.errors())
        counts = {c.name: c.value for t in tcp.status().transports if t.name.startswith("modbus") for c in t.counts}
        self.assertEqual(counts["connections"], 1)
        self.assertEqual((counts["refused_writes"], counts["not_owner"]), (2, 2))

    def test_each_axis_answers_to_its_own_unit(self):
        """Catches: one axis that answers for the other."""
        client = self.pymodbus(self.modbus_server(text=TWO_AXES))
        for unit in (1, 2):
            self.assertEqual(self.read(client, 2, 2, unit), [2, unit - 1])
            self.written(client.write_register(LEASE, KEY + unit, slave=unit))
        for unit in (1, 2):
            command = words("HIff", 1, 0, 10.0 * unit, 0.0)
            self.written(client.write_registers(COMMAND, command, slave=unit))
        for unit in (1, 2):
            self.assertEqual(values("f", self.read(client, 260, 2, unit)), (10.0 * unit,))


class Mbpoll(ModbusTest):
    def mbpoll(self, server, *words_, kind="4", first=0, count=None, big=False, fails=False):
        if shutil.which("mbpoll") is None:
            self.skipTest("there is no mbpoll")
        command = ["mbpoll", "-m", "tcp", "-p", server.modbus[1], "-a", 1, "-t", kind, "-0", "-r", first, "-1", "-o", 10, "-q"]
        if count is not None:
            command += ["-c", count]
        if big:
            command.append("-B")
        told = run(*command, server.modbus[0], *words_)
        if not fails:
            self.assertEqual(told.returncode, 0, told.stdout + told.stderr)
        return told.stdout + told.stderr

    def values(self, told):
        """Lines as "[200]: 	5" or "[18]: 	1.23457"."""
        pairs = [line.split(":", 1) for line in told.splitlines() if line.startswith("[")]
        return {int(address.strip("[]")): value.split()[0] for address, value in pairs}

    def test_mbpoll_reads_and_writes_every_block(self):
        """Catches: a map that needs a program of ours; a lease that ends with one call of a tool."""
        server = self.modbus_server()
        self.assertEqual(self.values(self.mbpoll(server, first=0, count=3)), {0: "17474", 1: "1", 2: "1"})
        self.assertEqual(self.values(self.mbpoll(server, kind="4:float", first=18, count=1, big=True)), {18: "1.23457"})
        self.assertEqual(self.values(self.mbpoll(server, kind="3:int", first=20, count=1, big=True)),
                         {20: "-123456789"})
        self.assertEqual(self.values(self.mbpoll(server, kind="4:float", first=MIRROR + 18, count=1)),
                         {MIRROR + 18: "1.23457"}, "its own word order, in the mirror")
        self.assertEqual(len(self.values(self.mbpoll(server, first=PROCESS, count=13))), 13)
        self.assertEqual(len(self.values(self.mbpoll(server, first=SAMPLE, count=SAMPLE_LENGTH))), SAMPLE_LENGTH)
        self.assertEqual(self.values(self.mbpoll(server, kind="1", first=16, count=2)), {16: "1", 17: "0"})

        self.mbpoll(server, KEY, first=LEASE)
        self.assertEqual(self.values(self.mbpoll(server, first=LEASE + 9, count=1)), {409: "2"}, "a new connection")
        self.assertIn("busy", self.mbpoll(server, KEY + 1, first=LEASE, fails=True))
        command = [KEY, 0] + words("HIff", 1, 0, 10.0, -5.0)
        self.mbpoll(server, *command, first=LEASE)
        self.assertEqual(self.values(self.mbpoll(server, kind="4:float", first=260, count=2, big=True)),
                         {260: "10", 262: "-5"})
        self.mbpoll(server, KEY, 2, first=LEASE)
        self.assertEqual(self.values(self.mbpoll(server, first=LEASE + 9, count=1)), {409: "0"})


    def test_mbpoll_commands_three_phases(self):
        """Catches: phase c, Hall lines or injected faults that an ordinary tool cannot reach."""
        server = self.modbus_server(text=STAR + '\n[[axis.fault]]\nat_tick = 1\nname = "open_phase"\nvalue = 3\n')
        self.assertEqual(self.values(self.mbpoll(server, first=30, count=10)),
                         dict(zip(range(30, 40), map(str, (3, 5, 120, 22, 6, 286, 50, 7, 420, 13)))))
        command = [KEY, 0] + words("HIffff", 1, 0, 10.0, -5.0, -2.5, 0.0)
        self.mbpoll(server, *command, first=MORE_LEASE)
        self.assertEqual(self.values(self.mbpoll(server, kind="4:float", first=290, count=1, big=True)), {290: "-2.5"})
        self.assertEqual(self.values(self.mbpoll(server, kind="1", first=31, count=2)), {31: "0", 32: "0"})
        command = [KEY, 0] + words("HIffff", 1, 1, 10.0, -5.0, -2.5, 0.0)
        self.mbpoll(server, *command, first=MORE_LEASE)
        self.assertEqual(self.values(self.mbpoll(server, kind="1", first=31, count=2)), {31: "1", 32: "0"})
        hall = [self.values(self.mbpoll(server, kind="1", first=28, count=3))[at] for at in (28, 29, 30)]
        self.assertEqual(self.values(self.mbpoll(server, first=136, count=1)),
                         {136: str(sum(int(line) << bit for bit, line in enumerate(hall)))})


class Npm(ModbusTest):
    def found_by(self, script, server):
        folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-npm-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        package = folder / "npm"
        npm_package.install(TESTS / "peers/modbus/npm", package, "--omit=optional")
        told = run("node", package / script, *server.modbus)
        self.assertEqual(told.returncode, 0, told.stderr)
        return json.loads(told.stdout)

    def check(self, found):
        self.assertEqual(found["header"][:6], [0x4442, 1, 1, 0, MIRROR, 4])
        self.assertEqual(found["input"], [0x4442, 1])
        self.assertAlmostEqual(found["float"], 1.2345678, places=6)
        self.assertAlmostEqual(found["mirror"], 1.2345678, places=6)
        self.assertEqual(found["blocks"], [13, SAMPLE_LENGTH, 11, min(found["header"][17], 125)])
        self.assertEqual(found["withoutLease"], 6)
        self.assertEqual(found["gap"], 2)
        self.assertEqual([bool(bit) for bit in found["coils"]], [False, True])
        self.assertEqual(found["parameter"], 2.5)
        self.assertEqual(found["status"] & 0x6F, 0x27)
        self.assertEqual(found["voltage"], 10.0)
        self.assertEqual([bool(bit) for bit in found["discrete"]], [False, True, False, False, False])
        self.assertEqual(found["released"], 0)

    def test_modbus_serial_reads_and_writes_every_block(self):
        """Catches: answers that only lenient clients take."""
        found = self.found_by("modbus_serial.mjs", self.modbus_server())
        self.check(found)
        self.assertEqual(found["tooMany"], 3)
        self.assertEqual(found["identification"]["0"], "drivebench")
        self.assertEqual(found["disabled"] & 0x6F, 0x23)
        self.assertEqual(found["exchanged"], [1, 12.0, -3.0])

    def test_jsmodbus_reads_and_writes_every_block(self):
        """Catches: answers that only lenient clients take."""
        found = self.found_by("jsmodbus.mjs", self.modbus_server())
        self.check(found)
        self.assertEqual(found["integer"], -123456789)
        self.assertEqual(found["command"], [1, 12.0, -3.0])


class Program(ModbusTest):
    def test_writes_are_off_unless_allowed(self):
        """Catches: a bench that any computer of the network can drive because its file does not forbid it."""
        server = self.modbus_server(section=MODBUS.replace("allow_writes = true\n", ""))
        client = self.pymodbus(server)
        self.assertEqual(self.read(client, 27, 1), [0])
        self.exception(client.write_register(LEASE, KEY, slave=1), 2)

    def test_an_open_address_is_logged(self):
        """Catches: a protocol without passwords on every interface, and no line in the log."""
        server = self.modbus_server(section=MODBUS.replace("127.0.0.1", "0.0.0.0") + "unprotected = true\n")
        until(lambda: "Modbus knows no passwords" in server.errors(), "a warning")

    def test_the_printed_map_is_the_served_one(self):
        """Catches: a map that was written by hand."""
        text = ONE_AXIS + MODBUS
        server = self.modbus_server()
        config = server.folder / "map.toml"
        config.write_text(text, encoding="utf-8")
        told = run(SERVER, config, "--print", "modbus-csv")
        self.assertEqual(told.returncode, 0, told.stderr)
        rows = list(csv.DictReader(told.stdout.splitlines()))
        self.assertEqual(list(rows[0])[:5], ["table", "register", "hex", "3xxxx", "4xxxx"])
        self.assertEqual({row["table"] for row in rows}, {"register", "coil", "discrete input"})
        self.assertEqual(len({(row["table"], row["register"]) for row in rows}), len(rows), "each has one address")
        client = self.pymodbus(server)
        registers = [row for row in rows if row["table"] == "register"]
        self.assertGreater(len(registers), 80)
        for row in registers:
            size = {"16": 1, "32": 2, "64": 4}[row["type"][-2:]]
            self.assertEqual(int(row["hex"], 16), int(row["register"]))
            self.assertEqual(int(row["4xxxx"]), 40001 + int(row["register"]))
            there = self.read(client, int(row["register"]), size)
            self.assertEqual(self.read(client, int(row["CDAB"]), size), there[::-1], row["name"])
        markdown = run(SERVER, config, "--print", "modbus-map")
        self.assertEqual(markdown.returncode, 0, markdown.stderr)
        for row in rows:
            self.assertIn(f"| {row['name']} |", markdown.stdout)


if __name__ == "__main__":
    unittest.main(verbosity=2)
