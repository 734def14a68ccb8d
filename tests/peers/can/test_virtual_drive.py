#!/usr/bin/env python3
"""A motor started over CAN without kernel CAN: python-can and the DBC file against the real server."""
import pathlib
import re
import socket
import sys
import time

import can

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
import dbc_drive
from drive_test import DriveTest, PATIENCE_S, STAR, in_own_network, run_all, with_bus
from wire_client import REPOSITORY

GROUP = "239.74.163.2"
UDP = 'backend = "udp_multicast"'
TICKS = 1600
INJECTABLE = re.findall(r'^    \{"([a-z_]+)", "', (REPOSITORY / "plant/injected_faults.hpp").read_text(), re.MULTILINE)


class VirtualDrive(DriveTest):
    runs = 0

    def open_loop(self, lines, connect, fd):
        text = with_bus([*lines, f"fd = {str(fd).lower()}"])
        dbc = self.text_of("dbc", text)
        self.runs += 1
        recording = self.folder / f"run{self.runs}.mcap"
        server = self.server("--record", str(recording), text=text)
        with connect(server) as bus:
            drive = dbc_drive.Drive(bus, dbc, fd=fd)
            counts = dbc_drive.open_loop_start(drive, TICKS)
        self.assertEqual(server.stop(), 0, server.errors())
        self.assertTrue(server.verdict["exact"])
        self.assertEqual([tick for tick, _ in counts], list(range(TICKS + 1)))
        self.assertCountsRecorded(counts, recording)
        replay = self.drivebench("replay", recording)
        self.assertIn("equal, bit for bit", replay.stdout)
        return server.verdict["state_hash"], drive

    # Catches: frames that python-can reads differently from how we write them, or a DBC file that does not describe
    # them.
    def test_the_motor_starts_over_udp_multicast(self):
        for fd in (True, False):
            with self.subTest(fd=fd):
                self.open_loop([UDP],
                               lambda _: can.Bus(interface="udp_multicast", channel=GROUP, fd=True), fd)

    # Catches: a phase c, Hall lines, a tachometer or injected faults that a program with the DBC file alone commands
    # or reads differently from the bench.
    def test_a_motor_in_a_star_starts_over_udp_multicast(self):
        for fd in (True, False):
            with self.subTest(fd=fd):
                self.start_in_a_star(fd)

    def start_in_a_star(self, fd):
        fault = f'\n[[axis.fault]]\nat_tick = {TICKS}\nname = "hall_stuck_high"\nvalue = 2\n'
        text = with_bus([UDP, f"fd = {str(fd).lower()}", "state_every_ticks = 4"], STAR + fault)
        dbc = self.text_of("dbc", text)
        recording = self.folder / f"star{fd}.mcap"
        server = self.server("--record", str(recording), text=text)
        samples = {}
        with can.Bus(interface="udp_multicast", channel=GROUP, fd=True) as bus:
            drive = dbc_drive.Drive(bus, dbc, fd=fd)
            tick, count, *_ = drive.acquire()
            while tick < TICKS:
                u_a, u_b, u_c = dbc_drive.three_phases(*dbc_drive.open_loop_voltages(tick))
                tick, count, *_ = drive.step(tick, u_a, u_b, u_c=u_c)
                sensors = drive.seen["sensors" if fd else "phases"]
                speed = drive.seen["sensors" if fd else "details"]["tachometer"]
                samples[tick] = (count, sensors["i_c"], int(sensors["hall_lines"]), speed)
                self.assertEqual(int(sensors["tick"]) % 65536, tick % 65536)
            self.assertEqual(int(drive.seen["details"]["injected"]), 0)
            drive.step(tick, u_a, u_b, u_c=u_c)
            self.assertEqual(round(drive.seen["details"]["u_c"], 2), u_c)
            self.assertEqual(int(drive.seen["details"]["injected"]), 1 << INJECTABLE.index("hall_stuck_high"))
        self.assertEqual(server.stop(), 0, server.errors())
        rows = self.recorded(recording)
        for tick, (count, i_c, hall, speed) in samples.items():
            row = rows[tick]
            self.assertEqual((int(row["encoder_count"]), int(row["hall_lines"])), (count, hall), f"tick {tick}")
            self.assertAlmostEqual(float(row["i_c_a"]), i_c, delta=1e-5 if fd else 0.5001e-3)
            self.assertAlmostEqual(float(row["tachometer_v"]), speed, delta=1e-5 if fd else 0.5001e-2)
        self.assertGreater(abs(count), 100, "the motor turns")
        self.assertIn("equal, bit for bit", self.drivebench("replay", recording).stdout)

    # Catches: a command that lost its phase c and is executed.
    def test_a_command_without_phase_c_is_refused(self):
        text = with_bus([UDP, "fd = false"], STAR)
        server = self.server(text=text)
        with can.Bus(interface="udp_multicast", channel=GROUP, fd=True) as bus:
            drive = dbc_drive.Drive(bus, self.text_of("dbc", text), fd=False)
            tick, *_ = drive.acquire()
            drive.send("command", tick=tick, u_a=100, mode=1, lease=drive.lease)
            while (name := drive.receive()) not in ("reply", "sync"):
                pass
            self.assertEqual(name, "reply", "no tick ran")
            self.assertEqual(drive.seen["reply"]["result"], 8, "incomplete")
            self.assertEqual(drive.step(tick, 1.0, 0.0)[0], tick + 1)
        self.assertEqual(server.stop(), 0)

    def place_of(self, server):
        """Address and port that the system gave the first bus of the bench."""
        return re.search(r"[^:]+:\d+$", server.ready["can"][0])[0]

    # Catches: a terminal that python-can's slcan driver cannot talk to.
    def test_the_motor_starts_over_slcan(self):
        pty = self.folder / "can.pty"
        self.open_loop(['backend = "slcan"', f'channel = "pty:{pty}"'],
                       lambda _: can.Bus(interface="slcan", channel=str(pty), bitrate=1_000_000, sleep_after_open=0),
                       False)
        self.open_loop(['backend = "slcan"', 'channel = "tcp:127.0.0.1:0"'],
                       lambda server: can.Bus(interface="slcan", channel="socket://" + self.place_of(server),
                                              bitrate=1_000_000, sleep_after_open=0), False)

    # Catches: a socketcand server that does not suit a client written from the protocol's description.
    def test_the_motor_starts_over_socketcand_by_hand(self):
        text = with_bus(['backend = "socketcand"', 'channel = "127.0.0.1"', "port = 0", "fd = false"])
        dbc = self.text_of("dbc", text)
        recording = self.folder / "run.mcap"
        server = self.server("--record", str(recording), text=text)
        with SocketcandBus(self.place_of(server).split(":")) as bus:
            counts = dbc_drive.open_loop_start(dbc_drive.Drive(bus, dbc, fd=False), TICKS)
        self.assertEqual(server.stop(), 0, server.errors())
        self.assertCountsRecorded(counts, recording)

    # Catches: identifiers that can be configured but are not used, or 29 bits that become 11 somewhere.
    def test_identifiers_are_as_configured(self):
        connect = lambda _: can.Bus(interface="udp_multicast", channel=GROUP, fd=True)  # noqa: E731
        lines = [UDP, "extended = true"]
        _, drive = self.open_loop([*lines], connect, True)
        self.assertTrue(all(message.is_extended_id for _, _, message in drive.received))
        text = with_bus([UDP]) + "[can.ids]\ncommand = 0x120\nsensors = 0x600\n"
        dbc = self.text_of("dbc", text)
        server = self.server(text=text)
        with connect(server) as bus:
            drive = dbc_drive.Drive(bus, dbc)
            tick, *_ = drive.acquire()
            self.assertEqual(drive.message("command").arbitration_id, 0x121)
            drive.step(tick, 5.0, 0.0)
            ids = {message.arbitration_id for name, _, message in drive.received if name == "sensors"}
            self.assertEqual(ids, {0x601})
        self.assertEqual(server.stop(), 0)

    # CMD-02. Catches: a bus on which real time waits for the controller, a watchdog that does not act there, or a
    # bench that hides missed commands.
    def test_in_real_time_the_watchdog_acts_when_the_controller_is_silent(self):
        text = with_bus([UDP, "sample_every_ticks = 20"]).replace('mode = "lockstep"', 'mode = "realtime"')
        text = text.replace("command_delay_ticks = 0", "command_delay_ticks = 1").replace(
            "period_us = 125", "period_us = 1000").replace("watchdog_ticks = 20", "watchdog_ticks = 4000").replace("lease_s = 2.0", "lease_s = 60.0")
        dbc = self.text_of("dbc", text)
        server = self.server(text=text)
        with can.Bus(interface="udp_multicast", channel=GROUP, fd=True) as bus:
            drive = dbc_drive.Drive(bus, dbc)
            drive.acquire()
            for _ in range(30):
                tick, *_ = drive.sample()
                self.assertEqual(tick % 20, 0, "a sample every twentieth tick")
                drive.command(tick, 5.0, 0.0)
            self.assertIn("sensors", drive.seen)
            self.assertGreater(drive.seen["sensors"]["command_tick"], 0, "which command was in force")
            while drive.await_message("fault")["faults"] != 1 << 9:  # command_timeout
                pass
            self.assertGreaterEqual(drive.await_message("sensors")["missed"], 4000)
            tick, *_ = drive.sample()
            drive.command(tick, 5.0, 0.0)
            self.assertEqual(drive.await_message("reply")["result"], 4, "latched")
        server.stop()

    # Catches: a bus with more frames than it can carry that is taken silently.
    def test_a_bus_that_cannot_carry_its_frames_is_refused(self):
        text = with_bus([UDP, "fd = false"]).replace('mode = "lockstep"', 'mode = "realtime"').replace(
            "command_delay_ticks = 0", "command_delay_ticks = 1")
        bench = self.folder / "bench.toml"
        bench.write_text(text, encoding="utf-8")
        refused = self.drivebench_server(bench, "--port", "0", code=2)
        self.assertRegex(refused.stderr, r"bus 1 must carry 4\d\d % .* sample_every_ticks from 1 to \d")
        enough = int(re.search(r"from 1 to (\d+)", refused.stderr)[1])
        bench.write_text(text.replace("fd = false", f"fd = false\nsample_every_ticks = {enough - 1}"), encoding="utf-8")
        self.drivebench_server(bench, "--port", "0", code=2)
        fits = text.replace("fd = false", f"fd = false\nsample_every_ticks = {enough}")
        self.assertEqual(self.server(text=fits).stop(), 0)
        bench.write_text(text.replace("fd = false", "edges = true"), encoding="utf-8")
        self.assertIn("or leave edges out", self.drivebench_server(bench, "--port", "0", code=2).stderr)
        server = self.server("--allow-overload", text=text)
        self.assertIn("bus 1 must carry", server.errors())
        self.assertEqual(server.stop(), 0)

    # CAN-11. Catches: two benches on one bus that both go on sending, or notice each other once and forget it.
    def test_two_benches_with_the_same_node_both_notice(self):
        text = with_bus([UDP])
        first, second = self.server(text=text), self.server(text=text)
        for server in (first, second):
            self.await_state(server, lambda bus: bus["state"] == "ID_CONFLICT" and bus["conflicts"] >= 2)

    # CAN-15. Catches: a node scan of CANopen that a running drive notices, or that silences a bench which was given the
    # identifiers of CANopen.
    def test_can_15_a_drive_goes_on_after_a_node_scan(self):
        for lines, conflicts in (([], 0), (['identifiers = "canopen"'], 1)):
            with self.subTest(lines=lines):
                text = with_bus([UDP, "fd = false", *lines], STAR)
                server = self.server(text=text)
                with can.Bus(interface="udp_multicast", channel=GROUP, fd=True) as bus:
                    drive = dbc_drive.Drive(bus, self.text_of("dbc", text), fd=False)
                    tick, *_ = drive.acquire()
                    for node in range(1, 128):
                        bus.send(can.Message(arbitration_id=0x700 + node, is_remote_frame=True, dlc=1,
                                             is_extended_id=False))
                        bus.send(can.Message(arbitration_id=0x600 + node, data=bytes.fromhex("4000100000000000"),
                                             is_extended_id=False))
                        tick, *_ = drive.step(tick, 10.0, 0.0)
                    self.assertEqual(tick, 127)
                    self.await_state(server, lambda bus: bus["conflicts"] == conflicts)
                    self.assertEqual(drive.request("renew")["result"], 0, "the controller has its lease")
                self.assertEqual(server.stop(), 0, server.errors())
                self.assertTrue(server.verdict["exact"])

    def await_state(self, server, is_reached):
        """Waits until the state and the counts of the bus are as asked for."""
        client = server.client()
        self.addCleanup(client.close)
        end = time.monotonic() + PATIENCE_S
        while True:
            bus = client.status().transports[0]
            seen = {"state": bus.state, **{count.name: count.value for count in bus.counts}}
            if is_reached(seen):
                return
            self.assertLess(time.monotonic(), end, seen)
            time.sleep(0.02)


class SocketcandBus:
    """Just enough of the socketcand protocol, by hand."""

    def __init__(self, address):
        self.socket = socket.create_connection(address, PATIENCE_S)
        self.buffer = ""
        assert self.receive_text() == "hi"
        self.send_text("open can0")
        assert self.receive_text() == "ok"
        self.send_text("rawmode")
        assert self.receive_text() == "ok"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send_text(self, text):
        self.socket.sendall(f"< {text} >".encode())

    def receive_text(self):
        while ">" not in self.buffer:
            got = self.socket.recv(4096)
            assert got, "the server closed the connection"
            self.buffer += got.decode("ascii")
        element, self.buffer = self.buffer.split(">", 1)
        return element.strip().removeprefix("<").strip()

    def send(self, message):
        data = " ".join(f"{byte:02x}" for byte in message.data)
        self.send_text(f"send {message.arbitration_id:03x} {message.dlc} {data}")

    def recv(self, timeout):
        self.socket.settimeout(timeout)
        try:
            words = self.receive_text().split()
        except TimeoutError:
            return None
        if words[0] != "frame":
            return None
        data = bytes.fromhex("".join(words[3:]))
        return can.Message(arbitration_id=int(words[1], 16), is_extended_id=len(words[1]) > 3, data=data)


if __name__ == "__main__":
    in_own_network()
    run_all()
