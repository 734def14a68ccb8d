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
from wire_client import pb  # noqa: E402

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

        with server.client() as viewer:
            counts = {report.name.split(" ")[0]: {count.name: count.value for count in report.counts}
                      for report in viewer.status().transports}
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
