#!/usr/bin/env python3
"""The buses without kernel CAN against clients that we did not write: python-can over udp_multicast, slcan and
socketcand, and clients by hand. The other end is bus_echo, which answers every frame under the next identifier."""
import contextlib
import os
import pathlib
import socket
import struct
import sys
import tempfile
import termios
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from bus_client import BURST_REQUEST, GROUP, PATIENCE_S, Echo, Line, can_kinds, run_all


class VirtualBusTest(unittest.TestCase):
    def same(self, got, sent, step=1):
        self.assertIsNotNone(got, f"no answer to {sent}")
        for field in ("is_extended_id", "is_remote_frame", "is_fd", "dlc", "data", "bitrate_switch",
                      "error_state_indicator"):
            self.assertEqual(getattr(got, field), getattr(sent, field), f"{field} of {got}")
        self.assertEqual(got.arbitration_id, sent.arbitration_id + step)

    def answered(self, bus, message):
        """Sends a frame and checks its echo; our own frame may come back as well."""
        bus.send(message)
        got = bus.recv(PATIENCE_S)
        if got is not None and got.arbitration_id == message.arbitration_id:
            got = bus.recv(PATIENCE_S)
        self.same(got, message)


class UdpMulticast(VirtualBusTest):
    def setUp(self):
        import can
        self.can = can
        self.bus = can.Bus(interface="udp_multicast", channel=GROUP, hop_limit=0)
        self.addCleanup(self.bus.shutdown)

    # Catches: a key, a flag or an identifier that gets lost between us and python-can, and an echo of our own frames
    # (which would count up for ever).
    def test_python_can_exchanges_every_kind_of_frame(self):
        with Echo("udp_multicast", GROUP, 43113) as echo:
            for message in can_kinds(self.can, fd=True):
                with self.subTest(message):
                    self.answered(self.bus, message)
            self.assertIsNone(self.bus.recv(0.2))
            counters = echo.counters()
        self.assertEqual((counters["received"], counters["sent"], counters["malformed"]), (7, 7, 0))

    # Catches: frames sent without pacing, which silently overrun a receiver's buffer of 160 datagrams. A busy machine
    # may keep the receiver from its buffer long enough, hence three attempts.
    def test_a_burst_arrives_complete(self):
        attempts = []
        for _ in range(3):
            with Echo("udp_multicast", GROUP, 43113):
                self.bus.send(self.can.Message(arbitration_id=BURST_REQUEST, data=struct.pack("<H", 2000)))
                ids = []
                while (message := self.bus.recv(0.5)) is not None:
                    if message.arbitration_id != BURST_REQUEST:
                        ids.append(message.arbitration_id)
            attempts.append(len(ids))
            if ids == list(range(2000)):
                return
        self.fail(f"of 2000 frames arrived {attempts}")

    # Catches: a foreign datagram that ends the bus, or is not counted.
    def test_datagrams_that_are_no_frames_are_counted(self):
        with Echo("udp_multicast", GROUP, 43113) as echo, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            for bad in (b"", b"\x80", b"hello", b"\x81\xa1x", bytes(65000)):
                sender.sendto(bad, (GROUP, 43113))
            self.bus.shutdown()  # python-can stops at such datagrams
            self.setUp()
            self.answered(self.bus, can_kinds(self.can, fd=False)[0])
            self.assertEqual(echo.counters()["malformed"], 5)

    # Catches: commands from other computers of the local network.
    def test_frames_of_other_computers_are_ignored(self):
        from can.interfaces.udp_multicast.utils import pack_message
        message = can_kinds(self.can, fd=False)[0]
        packed = pack_message(message)
        udp = struct.pack(">HHHH", 43113, 43113, 8 + len(packed), 0) + packed
        ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 0, 0, 1, socket.IPPROTO_UDP, 0,
                         socket.inet_aton("10.9.9.9"), socket.inet_aton(GROUP))
        with Echo("udp_multicast", GROUP, 43113) as echo, \
                socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_RAW) as foreign:
            foreign.sendto(ip + udp, (GROUP, 0))
            self.same(self.bus.recv(PATIENCE_S), message, 0)  # python-can takes it
            self.answered(self.bus, message)
            self.assertEqual(echo.counters()["received"], 1)

    # Catches: two benches on one port that do not share it, or do not hear each other.
    def test_several_programs_share_the_bus(self):
        with Echo("udp_multicast", GROUP, 43113):
            other = self.can.Bus(interface="udp_multicast", channel=GROUP, hop_limit=0)
            self.addCleanup(other.shutdown)
            message = can_kinds(self.can, fd=False)[0]
            self.bus.send(message)
            self.same(other.recv(PATIENCE_S), message, 0)
            self.same(other.recv(PATIENCE_S), message)


class Slcan(VirtualBusTest):
    # Catches: lines or answers that python-can does not understand; a terminal that is not raw.
    def test_python_can_exchanges_frames_over_a_terminal(self):
        import can
        with tempfile.TemporaryDirectory() as folder:
            path = f"{folder}/can0"
            with Echo("slcan", f"pty:{path}") as echo:
                for _ in range(2):  # the second client opens the terminal as the first left it
                    with can.Bus(interface="slcan", channel=path, bitrate=1000000, sleep_after_open=0) as bus:
                        self.exchange(can, bus)
                self.assertEqual(echo.counters()["malformed"], 0)
            self.assertFalse(os.path.lexists(path), "the link stays")

    # Catches: a terminal that keeps the open channel or the settings of one program for the next one; one that
    # changes the bytes of programs that leave its settings alone.
    def test_each_program_finds_the_terminal_reset(self):
        with tempfile.TemporaryDirectory() as folder, Echo("slcan", f"pty:{folder}/can0") as echo:
            for count in (1, 2, 3):
                terminal = os.open(f"{folder}/can0", os.O_RDWR | os.O_NOCTTY)
                os.write(terminal, b"V\r")
                self.assertEqual(self.read(terminal), b"V0101\r")
                os.write(terminal, b"O\r")
                self.assertEqual(self.read(terminal), b"\r")
                os.write(terminal, b"t1231AA\r")
                while echo.counters()["sent"] < count:
                    time.sleep(0.01)
                settings = termios.tcgetattr(terminal)
                settings[0] |= termios.ICRNL
                settings[3] |= termios.ECHO | termios.ICANON
                termios.tcsetattr(terminal, termios.TCSANOW, settings)
                os.close(terminal)
                while self.terminals_open(echo) > 1:  # the bus itself holds one
                    time.sleep(0.01)
                self.assertEqual(echo.counters()["malformed"], 0)

    def terminals_open(self, echo):
        names = []
        for link in pathlib.Path(f"/proc/{echo.process.pid}/fd").iterdir():
            with contextlib.suppress(FileNotFoundError):  # closed since the folder was read
                names.append(os.readlink(link))
        return sum("ptmx" in name for name in names)

    def read(self, terminal):
        text = b""
        while not text.endswith((b"\r", b"\n", b"\a")):
            text += os.read(terminal, 1)
        return text

    # Catches: a server that offers a terminal only.
    def test_python_can_exchanges_frames_over_tcp(self):
        import can
        with Echo("slcan", "tcp:127.0.0.1:0") as echo:
            with can.Bus(interface="slcan", channel=f"socket://127.0.0.1:{echo.port}", sleep_after_open=0) as bus:
                self.exchange(can, bus)

    def exchange(self, can, bus):
        for message in can_kinds(can, fd=False):
            bus.send(message)
            got = None
            while got is None:  # answers to commands are None
                got = bus.recv(PATIENCE_S)
            self.same(got, message)

    # Catches: a command whose answer differs from an adapter's.
    def test_commands_are_answered_as_by_an_adapter(self):
        talk = [("\r", "\r"), ("C\r", "\a"), ("S8\r", "\r"), ("S\r", "\a"), ("Y5\r", "\r"), ("V\r", "V0101\r"),
                ("N\r", "NDB01\r"), ("F\r", "\a"), ("t1230\r", "\a"), ("Q\r", "\a"), ("O\r", "\r"), ("O\r", "\a"),
                ("S8\r", "\a"), ("F\r", "F00\r"), ("t12", ""), ("31AA\r", "\rt1241AA\r"), ("t1231\r", "\a"),
                ("d1239" + "AB" * 12 + "\r", "\rd1249" + "AB" * 12 + "\r"), ("C\r", "\r"), ("L\r", "\r"),
                ("t1230\r", "\a"), ("C\r", "\r"), ("x" * 1000 + "\r", "\a"), ("O\r", "\r"), ("r1232\r", "\rr1242\r")]
        with Echo("slcan", "tcp:127.0.0.1:0") as echo:
            line = Line(echo.port)
            for question, answer in talk:
                line.send(question)
                got = ""
                while len(got) < len(answer):
                    got += line.until(b"\r", b"\a")
                self.assertEqual(got, answer, f"after {question!r}")
            line.close()

    # Catches: frames that only one of several clients receives, or that come back to their sender.
    def test_clients_receive_frames_of_each_other(self):
        with Echo("slcan", "tcp:127.0.0.1:0") as echo:
            one, other = Line(echo.port), Line(echo.port)
            for line in (one, other):
                line.send("O\r")
                self.assertEqual(line.until(b"\r"), "\r")
            one.send("t1230\r")
            self.assertEqual([one.until(b"\r"), one.until(b"\r")], ["\r", "t1240\r"])
            self.assertEqual([other.until(b"\r"), other.until(b"\r")], ["t1230\r", "t1240\r"])
            one.close()
            other.close()

    # Catches: a bus that waits for a client that does not read, or keeps all frames for it.
    def test_a_stalled_client_loses_frames(self):
        with Echo("slcan", "tcp:127.0.0.1:0") as echo:
            stalled, other = Line(echo.port, buffer_bytes=4096), Line(echo.port)
            for line in (stalled, other):
                line.send("O\r")
                self.assertEqual(line.until(b"\r"), "\r")
            for _ in range(200):
                other.send(("t1238" + "11" * 8 + "\r") * 200)
                for _ in range(400):
                    other.until(b"\r")
                if echo.counters()["send_dropped"] > 0:
                    break
            else:
                self.fail("no frame was dropped")
            other.send("V\r")
            self.assertEqual(other.until(b"\r"), "V0101\r")
            stalled.close()
            other.close()


class SlcanDevice(VirtualBusTest):
    # Catches: an adapter that is not opened, or opened without its bit rate, or whose answers are taken for frames.
    def test_a_serial_adapter_is_opened_and_driven(self):
        controller, device = os.openpty()
        with os.fdopen(controller, "r+b", buffering=0) as adapter:
            path = os.ttyname(device)
            with Echo("slcan", f"{path}@115200") as echo:
                self.assertEqual(self.read(adapter, b"O\r"), b"\r\r\rC\rS8\rY5\rO\r")
                adapter.write(b"\a\r\r\r")
                adapter.write(b"t1232AABB\r")
                self.assertEqual(self.read(adapter, b"BB\r"), b"t1242AABB\r")
                adapter.write(b"z\rb1239" + b"CD" * 12 + b"1234\r")
                self.assertEqual(self.read(adapter, b"CD\r"), b"b1249" + b"CD" * 12 + b"\r")
                self.assertEqual(echo.counters()["malformed"], 0)
                adapter.write(b"t12\r")
                while echo.counters()["malformed"] == 0:
                    time.sleep(0.01)
                self.assertEqual(echo.counters()["received"], 2)
            os.close(device)

    def read(self, adapter, end):
        text = b""
        while not text.endswith(end):
            text += adapter.read(1)
        return text

    # Catches: a start that goes on without its adapter, or a reason that explains nothing.
    def test_a_device_that_is_no_adapter_is_refused(self):
        for channel, reason in (("/dev/nowhere", "No such file"), ("/dev/null", "not a serial device"),
                                ("/dev/null@123", "baud rate"), ("tcp:0.0.0.0:0", "other computers"),
                                ("tcp:127.1:0", "not ADDRESS:PORT"), ("tcp:127.0.0.1:x", "not ADDRESS:PORT"),
                                ("pty:/", "exists")):
            with self.subTest(channel), self.assertRaisesRegex(RuntimeError, reason):
                Echo("slcan", channel)


class Socketcand(VirtualBusTest):
    # Catches: a greeting or an element that python-can refuses; frames that its version in Debian loses.
    def test_python_can_exchanges_frames(self):
        import can
        with Echo("socketcand", "127.0.0.1") as echo:
            bus = can.Bus(interface="socketcand", channel="can0", host="127.0.0.1", port=echo.port)
            for message in (can.Message(arbitration_id=0x123, is_extended_id=False, data=[1, 2, 0xF3]),
                            can.Message(arbitration_id=0x18DAF110, data=bytes(range(8))),
                            can.Message(arbitration_id=0x7F0, is_extended_id=False)):
                bus.send(message)
                got = bus.recv(PATIENCE_S)
                self.assertEqual((got.arbitration_id, got.data), (message.arbitration_id + 1, message.data))
            bus.send(can.Message(arbitration_id=BURST_REQUEST, data=struct.pack("<H", 1000)))
            ids = []
            while len(ids) < 1000:
                message = bus.recv(PATIENCE_S)
                self.assertIsNotNone(message, f"{len(ids)} frames")
                ids.append(message.arbitration_id)
            self.assertEqual(ids, list(range(1000)))
            bus.shutdown()

    def client(self, echo, *elements, buffer_bytes=None):
        line = Line(echo.port, buffer_bytes)
        self.assertEqual(line.until(b">"), "< hi >")
        for element in elements:
            line.send(element)
            self.assertEqual(line.until(b">"), "< ok >", element)
        return line

    # Catches: a promise of the protocol's document that python-can does not use and the server does not keep.
    def test_a_session_by_hand_follows_the_protocol(self):
        with Echo("socketcand", "127.0.0.1") as echo:
            line = self.client(echo, "< open can0 >")
            line.send("< echo >")
            self.assertEqual(line.until(b">"), "< echo >")
            line.send("< rawmode >< sendrtr 00000123 2 >")
            self.assertEqual(line.until(b">"), "< ok >")
            self.assertRegex(line.until(b">"), r"^ < rtr 00000124 \d{10}\.\d{6} 2 >$")
            line.send("< fdsend 7 01 12 0 1 2 3 4 5 6 7 8 9 A B >")
            self.assertRegex(line.until(b">"), r"^ < fdframe 008 01 \d{10}\.\d{6} 000102030405060708090A0B >$")
            line.send("< send 12345 2 A BC >")
            self.assertRegex(line.until(b">"), r"^ < frame 00012346 \d{10}\.\d{6} 0ABC >$")
            for bad in ("< send 12345 2 A >", "< subscribe 0 0 123 >", "<>", "<" + "x" * 5000 + ">"):
                line.send(bad)
                self.assertRegex(line.until(b">"), "^< error ")
            line.send("< controlmode >< statistics 10 >")
            self.assertEqual(line.until(b">"), "< ok >")
            for _ in range(2):
                self.assertEqual(line.until(b">"), "< stat 14 3 14 3 >")
            line.send("< statistics 0 >< echo >")
            while (text := line.until(b">")) != "< echo >":
                self.assertEqual(text, "< stat 14 3 14 3 >")
            line.close()

    # Catches: frames for clients that have not asked for them; commands before a bus is open.
    def test_clients_receive_frames_of_each_other_in_raw_mode(self):
        with Echo("socketcand", "127.0.0.1") as echo:
            one = self.client(echo, "< open can0 >", "< rawmode >")
            other = self.client(echo, "< open can0 >", "< rawmode >")
            quiet = self.client(echo, "< open can0 >")
            quiet.send("< send 123 0 >< echo >")
            self.assertEqual(quiet.until(b">"), "< echo >")
            for line in (one, other):
                self.assertIn(" frame 123 ", line.until(b">"))
                self.assertIn(" frame 124 ", line.until(b">"))
            early = self.client(echo)
            early.send("< rawmode >")
            self.assertRegex(early.until(b">"), "^< error ")
            self.assertTrue(early.at_end())
            for line in (one, other, quiet, early):
                line.close()

    # Catches: a client that reads nothing and is kept, with all frames that wait for it.
    def test_a_stalled_client_is_cut_off(self):
        with Echo("socketcand", "127.0.0.1") as echo:
            stalled = self.client(echo, "< open can0 >", "< rawmode >", buffer_bytes=4096)
            other = self.client(echo, "< open can0 >")
            deadline = time.monotonic() + PATIENCE_S
            while time.monotonic() < deadline:
                other.send("< send 123 8 1 2 3 4 5 6 7 8 >" * 100 + "< echo >")
                other.until(b"< echo >")
                if not self.is_connected(stalled):
                    break
            else:
                self.fail("the stalled client is still there")
            self.assertTrue(stalled.at_end())
            stalled.close()
            other.close()

    def is_connected(self, line):
        """True while the kernel knows no end or error of the connection behind its received bytes."""
        state = line.socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0]
        return state == 1  # established

    # Catches: a bus that is open to the network.
    def test_only_loopback_is_served(self):
        for address, reason in (("0.0.0.0", "other computers"), ("127.1", "must be an address")):
            with self.subTest(address), self.assertRaisesRegex(RuntimeError, reason):
                Echo("socketcand", address)


if __name__ == "__main__":
    sys.exit(run_all())
