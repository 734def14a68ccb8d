#!/usr/bin/env python3
"""TCP, CAN and Modbus clients of one axis: they have the same rights, and their commands give the same bits."""
import pathlib
import struct
import sys
import threading

import can

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
import dbc_drive  # noqa: E402
from dbc_drive import open_loop_voltages  # noqa: E402
from drive_test import DriveTest, in_own_network, run_all, with_bus  # noqa: E402
from wire_client import PATIENCE_S, pb  # noqa: E402

GROUP = "239.74.163.2"
UDP = 'backend = "udp_multicast"'
TURNS = 12  # for each transport
MODBUS = '\n[modbus]\nport = 0\nallow_writes = true\nrequests_per_s = 0\n'
VOLTS = {"tcp": 1.0, "can": 2.0, "modbus": 3.0}


class TcpRival:
    def __init__(self, test, server):
        self.client = server.client()
        test.addCleanup(self.client.close)

    def acquire(self):
        return self.client.lease().WhichOneof("kind") == "done"

    def drive(self, volts):
        tick = self.client.newest().tick
        for _ in range(3):
            tick = self.step(tick, volts, 0.0)

    def step(self, tick, u_a, u_b):
        return self.client.step(tick, u_a, u_b).tick

    def release(self):
        self.client.lease(pb.LeaseRequest.ACTION_RELEASE)


class CanRival:
    def __init__(self, test, dbc):
        self.refused = dbc_drive.Refused
        self.bus = can.Bus(interface="udp_multicast", channel=GROUP, fd=True)
        test.addCleanup(self.bus.shutdown)
        self.drive_ = dbc_drive.Drive(self.bus, dbc)

    def acquire(self):
        try:
            self.tick = self.drive_.acquire()[0]
            return True
        except self.refused as refused:
            assert refused.code == 2, refused  # owned by another client
            return False

    def drive(self, volts):
        for _ in range(3):
            self.tick = self.step(self.tick, volts, 0.0)

    def step(self, tick, u_a, u_b):
        return self.drive_.step(tick, u_a, u_b)[0]

    def release(self):
        self.drive_.request("release")


class ModbusRival:
    KEY = 4242

    def __init__(self, test, address):
        from pymodbus.client import ModbusTcpClient

        host, port = address.rsplit(":", 1)
        self.client = ModbusTcpClient(host, port=int(port))
        assert self.client.connect()
        test.addCleanup(self.client.close)

    def acquire(self):
        answer = self.client.write_register(400, self.KEY, slave=1)
        if answer.isError():
            assert answer.exception_code == 6, answer
        return not answer.isError()

    def tick(self):
        words = self.client.read_holding_registers(200, 4, slave=1).registers
        return struct.unpack(">Q", struct.pack(">4H", *words))[0]

    def drive(self, volts):
        tick = self.tick()
        for _ in range(3):
            tick = self.step(tick, volts, 0.0)

    def step(self, tick, u_a, u_b):
        words = struct.unpack(">9H", struct.pack(">HHHIff", self.KEY, 0, 1, tick & 0xFFFFFFFF, u_a, u_b))
        answer = self.client.readwrite_registers(read_address=200, read_count=4, write_address=400,
                                                 write_registers=list(words), slave=1)
        assert not answer.isError(), answer
        return struct.unpack(">Q", struct.pack(">4H", *answer.registers))[0]

    def release(self):
        assert not self.client.write_register(400, 0, slave=1).isError()


class TcpStranger:
    """A session without the lease that asks for all that changes a run. Every request is refused."""

    def __init__(self, test, server):
        self.client = server.client()
        test.addCleanup(self.client.close)
        self.asked = 0

    def disturb(self, tick, is_free):
        lease, axis = pb.LeaseRequest, {"axis": 0}
        wanted = [{"exchange": pb.Exchange(commands=[pb.Command(tick=at, gates=1, u_a_v=volts)])}
                  for at, volts in ((tick, 9.0), (tick, float("nan")), (0, 9.0)) for _ in range(100)]
        wanted += [{"lease": lease(action=action)} for action in
                   [lease.ACTION_RENEW, lease.ACTION_RELEASE] + [lease.ACTION_ACQUIRE] * (not is_free)]
        wanted += [{"clear_faults": pb.ClearFaults(**axis)}, {"set_load": pb.SetLoad(load_nm=1.0)},
                   {"set_load": pb.SetLoad(load_nm=1.0, at_tick=tick + 5)}, {"shaft_bump": pb.ShaftBump(impulse_nms=1.0)},
                   {"inject_fault": pb.InjectFault(name="bus_sag", value=0.5)},
                   {"write_parameter": pb.WriteParameter(name="machine.rotor_resistance_ohm", value=9.0)}]
        for number in [self.client.send(**each) for each in wanted]:
            refusal = self.client.answer_to(number).refusal
            assert refusal.code in (pb.REFUSAL_NOT_OWNER, pb.REFUSAL_OWNED), refusal
        self.asked += len(wanted)


class CanStranger:
    """A controller without the lease number that sends each of its frames."""

    def __init__(self, test, dbc):
        bus = can.Bus(interface="udp_multicast", channel=GROUP, fd=True)
        test.addCleanup(bus.shutdown)
        self.drive = dbc_drive.Drive(bus, dbc)
        self.asked = 0

    def disturb(self, tick, is_free):
        command = self.drive.message("command")
        short = can.Message(arbitration_id=command.arbitration_id, is_extended_id=False, is_fd=True, data=command.data[:12])
        self.drive.bus.send(short)
        while self.drive.bus.recv(PATIENCE_S).data != short.data:  # comes back, and the DBC file cannot decode it
            pass
        for lease, mode in ((0, 1), (255, 1), (255, 9)):
            self.drive.lease = lease
            self.drive.command(tick, 9.0, 9.0, mode=mode)
            reply = self.drive.await_message("reply")
            assert (reply["request"], reply["result"]) == (0, 7 if mode == 9 else 1), reply
            self.asked += 1 if mode == 1 else 0
        for what in ["renew", "release", "clear_faults"] + ["acquire"] * (not is_free):
            try:
                self.drive.request(what, controller=99, lease=255)
                raise AssertionError(f"{what} was granted")
            except dbc_drive.Refused as refused:
                assert refused.code in (1, 2), refused
            self.asked += 1


class ModbusStranger:
    """A connection without the key that writes to every block."""

    def __init__(self, test, address):
        from pymodbus.client import ModbusTcpClient

        host, port = address.rsplit(":", 1)
        self.client = ModbusTcpClient(host, port=int(port))
        assert self.client.connect()
        test.addCleanup(self.client.close)
        self.asked = 0

    def disturb(self, tick, is_free):
        command = list(struct.unpack(">7H", struct.pack(">HIff", 1, tick & 0xFFFFFFFF, 9.0, 9.0)))
        malformed = list(struct.unpack(">7H", struct.pack(">HIff", 1, tick & 0xFFFFFFFF, float("nan"), 9.0)))
        wanted = [(402, command), (101, [6]), (401, [1]), (401, [2]), (1002, [0x40A0, 0])]
        if not is_free:
            wanted += [(400, [8]), (400, [8, 0] + command)]
        for address, words in wanted + [(402, malformed), (400, [8, 0] + malformed), (122, [9])]:
            answer = self.client.write_registers(address, words, slave=1)
            assert answer.isError() and answer.exception_code in (3, 6), (address, answer)
        assert self.client.write_coil(0, True, slave=1).isError()
        self.asked += len(wanted) + 1


class Transports(DriveTest):
    # OWN-01, OWN-02. Catches: two transports that hold an axis at once, or a refusal that is not counted.
    def test_three_transports_take_turns_on_one_axis(self):
        text = with_bus([UDP]) + MODBUS
        dbc = self.text_of("dbc", text)
        recording = self.folder / "run.mcap"
        server = self.server("--record", str(recording), text=text)
        rivals = {"tcp": TcpRival(self, server), "can": CanRival(self, dbc),
                  "modbus": ModbusRival(self, server.ready["modbus"])}
        holder, problems = [], []
        turns = dict.fromkeys(rivals, 0)
        refusals = dict.fromkeys(rivals, 0)

        def fight(name):
            try:
                while min(turns.values()) < TURNS and not problems:
                    if not rivals[name].acquire():
                        refusals[name] += 1
                        continue
                    holder.append(name)
                    rivals[name].drive(VOLTS[name])
                    if holder != [name]:
                        problems.append(f"{name} held the axis together with {holder}")
                    holder.remove(name)
                    rivals[name].release()
                    turns[name] += 1
            except Exception as error:  # pylint: disable=broad-except
                problems.append(f"{name}: {error!r}")

        threads = [threading.Thread(target=fight, args=(name,)) for name in rivals]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(problems, [])
        self.assertTrue(all(refusals.values()), refusals)

        counts = self.counts_of(server)
        self.assertGreaterEqual(counts["can"]["refused"], refusals["can"])
        self.assertGreaterEqual(counts["modbus"]["refused_writes"], refusals["modbus"])
        self.assertIn("refused", server.errors())
        self.assertEqual(server.stop(), 0, server.errors())

        volts_of_owner = {}
        for row in self.recorded(recording).values():
            if float(row["u_a_v"]) != 0.0:
                volts_of_owner.setdefault(row["owner"], set()).add(float(row["u_a_v"]))
        self.assertTrue(all(len(volts) == 1 for volts in volts_of_owner.values()), volts_of_owner)
        self.assertEqual(set().union(*volts_of_owner.values()), set(VOLTS.values()))


    def counts_of(self, server):
        """The counts of the transports, by the kind of transport."""
        with server.client() as viewer:
            return {report.name.split(" ")[0]: {count.name: count.value for count in report.counts}
                    for report in viewer.status().transports}

    # Catches: a request without the lease that is recorded, that changes the state or its hash, or that uses up an owner
    # number; a transport that does not count its own; refusals without a line in the log, or with a line for each.
    def test_own_09_a_run_is_the_same_whatever_clients_without_the_lease_send(self):
        text = with_bus([UDP]) + MODBUS
        dbc = self.text_of("dbc", text)
        contents, verdicts = {}, {}
        for crowded in (False, True):
            recording = self.folder / f"{crowded}.mcap"
            server = self.server("--record", str(recording), text=text)
            strangers = {"tcp": TcpStranger(self, server), "can": CanStranger(self, dbc),
                         "modbus": ModbusStranger(self, server.ready["modbus"])} if crowded else {}
            tick = 0
            for owner in (TcpRival(self, server), ModbusRival(self, server.ready["modbus"]), TcpRival(self, server)):
                for stranger in strangers.values():
                    stranger.disturb(tick, is_free=True)
                self.assertTrue(owner.acquire())
                for _ in range(10):
                    for stranger in strangers.values():
                        stranger.disturb(tick, is_free=False)
                    tick = owner.step(tick, 5.0, -1.0)
                owner.release()
            counts = self.counts_of(server)
            for name, stranger in strangers.items():
                self.assertEqual(counts[name]["not_owner"], stranger.asked, name)
            for name, start in zip(strangers, ("] tcp", "] udp_multicast", "] modbus")):
                lines = server.errors().count(start)
                self.assertTrue(0 < lines < strangers[name].asked / 10, server.errors())
            self.assertEqual(server.stop(), 0, server.errors())
            verdicts[crowded] = (server.verdict["ticks"], server.verdict["state_hash"])
            contents[crowded] = recording.read_bytes()
        self.assertEqual(verdicts[True], verdicts[False])
        self.assertEqual(len(contents[True]), len(contents[False]))
        self.assertEqual(contents[True], contents[False])

    # OWN-04. Catches: an owner on a bus that cannot be removed, or one that keeps the axis because its bus does not
    # tell it.
    def test_own_04_an_administrator_takes_an_axis_from_any_transport(self):
        text = with_bus([UDP]) + MODBUS
        dbc = self.text_of("dbc", text)
        server = self.server(text=text)
        admin = server.client()
        self.addCleanup(admin.close)
        for rival in (CanRival(self, dbc), ModbusRival(self, server.ready["modbus"]), TcpRival(self, server)):
            self.assertTrue(rival.acquire())
            rival.drive(5.0)
            taken = admin.ask(lease=pb.LeaseRequest(action=pb.LeaseRequest.ACTION_TAKE, reason="test"))
            self.assertEqual(taken.WhichOneof("kind"), "done", taken)
            newest = admin.newest()
            self.assertEqual(admin.exchange(newest.tick, 5.0).refusal.code, pb.REFUSAL_LATCHED)
            self.assertEqual(admin.step(newest.tick, gates=pb.GATES_OFF).owner, taken.done.owner)
            self.assertFalse(rival.acquire())
            admin.ask(clear_faults=pb.ClearFaults())
            admin.step(admin.newest().tick, 1.0)
            admin.lease(pb.LeaseRequest.ACTION_RELEASE)

    # Catches: a transport that rounds, delays or reorders commands, or leaves traces of its own.
    def test_the_same_commands_give_the_same_recording_over_each_transport(self):
        text = with_bus([UDP]) + MODBUS
        dbc = self.text_of("dbc", text)
        recordings = {}
        for name in VOLTS:
            recordings[name] = self.folder / f"{name}.mcap"
            server = self.server("--record", str(recordings[name]), text=text)
            rival = (TcpRival(self, server) if name == "tcp" else
                     CanRival(self, dbc) if name == "can" else ModbusRival(self, server.ready["modbus"]))
            self.assertTrue(rival.acquire())
            for tick in range(400):
                rival.step(tick, *(struct.unpack("f", struct.pack("f", u))[0] for u in open_loop_voltages(tick)))
            rival.release()
            self.assertEqual(server.stop(), 0, server.errors())
            self.assertEqual(server.verdict["ticks"], 400)
        contents = {name: file.read_bytes() for name, file in recordings.items()}
        self.assertEqual(contents["can"], contents["tcp"])
        self.assertEqual(contents["modbus"], contents["tcp"])


if __name__ == "__main__":
    in_own_network()
    run_all()
