#!/usr/bin/python3
"""The audit log: every change with its user, and every refused client."""
import contextlib
import json
import os
import pathlib
import re
import resource
import signal
import socket
import stat
import sys
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

from test_users import TAKE, USERS, UsersTest
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import PATIENCE_S, frame, pb
from wire_test import SERVO_TEXT, until


def at_end(host, port, said=b""):
    """Everything that a connection sends until its other end closes it."""
    with socket.create_connection((host, int(port)), timeout=PATIENCE_S) as line:
        line.sendall(said)
        try:
            return line.recv(100)
        except ConnectionResetError:
            return b""


class AuditLog(UsersTest):
    def lines(self, file):
        return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]

    def test_sec_07_own_04_every_change_is_logged_with_its_user(self):
        """Catches: an event without a line; a line without a name; a log that other users can read."""
        folder = self.folder_with(USERS)
        text = SERVO_TEXT.replace("[tcp]", f'[tcp]\ntokens_file = "{folder}/tokens"')
        log = folder / "audit.jsonl"
        server = self.server("--record", str(folder / "run.mcap"), "--audit", str(log), "--experiments", str(folder / "kept"),
                             text=text + '\n[modbus]\nport = 0\nallow_writes = true\n')
        self.assertEqual(stat.S_IMODE(os.stat(log).st_mode), 0o600)
        self.guess(server, "wrong")
        time.sleep(0.6)
        evil = self.client(server, hello=False)
        self.assertEqual(evil.hello("otto-secret", "otto\n\x1b[2J{}").WhichOneof("kind"), "welcome")
        otto, adam, vera = evil, self.user(server, "adam"), self.user(server, "vera")
        otto.lease()
        otto.step(0, 5.0)
        otto.ask(set_load=pb.SetLoad(load_nm=0.1))
        otto.ask(write_parameter=pb.WriteParameter(name="machine.rotor_resistance_ohm", value=5.0))
        otto.ask(inject_fault=pb.InjectFault(name="open_phase", value=1))
        otto.ask(inject_fault=pb.InjectFault(name="open_phase", value=0))
        otto.ask(shaft_bump=pb.ShaftBump(impulse_nms=1e-4))
        vera.ask(clear_faults=pb.ClearFaults())
        vera.lease()
        adam.ask(lease=pb.LeaseRequest(action=TAKE, reason="test {\"ä\"}"))
        adam.ask(clear_faults=pb.ClearFaults())
        adam.lease(pb.LeaseRequest.ACTION_RELEASE)
        run = adam.ask(run_experiment=pb.RunExperiment(
            owner="adam-owner", user="adam", label="idle", mode=pb.MODE_FREE, ticks=10, signals=["i_a_a"],
            input=pb.ExperimentInput(kind=pb.INPUT_KIND_NONE)))
        self.assertEqual(run.WhichOneof("kind"), "experiment_info", run)
        otto.close()
        until(lambda: '"session_ended"' in log.read_text(encoding="utf-8"), "otto is gone")
        server.process.send_signal(signal.SIGHUP)
        until(lambda: '"reload"' in log.read_text(encoding="utf-8"), "it is reloaded")
        self.assertEqual(server.stop(), 0)
        raw = log.read_bytes()
        self.assertTrue(all(byte == 10 or 32 <= byte < 127 for byte in raw), "no byte moves a terminal")
        said = self.lines(log)
        self.assertEqual([(line["event"], line["subject"], line["result"] == "done") for line in said], [
            ("start", "", True), ("recording_started", "", True), ("authentication", "", False),
            ("session_opened", "otto", True), ("session_opened", "adam", True), ("session_opened", "vera", True),
            ("acquire", "otto", True), ("armed", "otto", True), ("load", "otto", True), ("parameter", "otto", True),
            ("inject", "otto", True), ("inject", "otto", True), ("bump", "otto", True), ("forbidden", "vera", False),
            ("forbidden", "vera", False), ("lease_lost", "otto", True), ("take", "adam", True), ("acquire", "adam", True),
            ("clear", "adam", True), ("release", "adam", True), ("experiment", "adam", True), ("session_ended", "otto", True),
            ("reload", "", True), ("recording_stopped", "", True), ("stop", "", True)])
        by_name = {line["event"]: line for line in said}
        self.assertRegex(by_name["start"]["details"]["configuration_hash"], "^[0-9a-f]{16}$")
        self.assertEqual(by_name["take"]["details"]["reason"], "test {\"ä\"}")
        self.assertRegex(by_name["take"]["details"]["from"], r"^otto \(tcp 127")
        self.assertEqual(by_name["armed"]["details"]["state"], "run")
        self.assertEqual(by_name["parameter"]["details"]["name"], "machine.rotor_resistance_ohm")
        self.assertEqual(said[3]["details"]["client"], "otto\n\x1b[2J{}")
        self.assertEqual(by_name["load"]["transport"], "tcp")
        ticks = [line["monotonic_ns"] for line in said]
        self.assertEqual(ticks, sorted(ticks))
        for line in said:
            self.assertRegex(line["time"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z$")

    def test_sec_07_modbus_writes_are_logged(self):
        """Catches: a transport whose writes the log leaves out."""
        from pymodbus.client import ModbusTcpClient
        folder = self.folder_with(USERS)
        server = self.server("--audit", str(folder / "audit"), text=SERVO_TEXT + '\n[modbus]\nport = 0\nallow_writes = true\n')
        host, port = server.ready["modbus"].rsplit(":", 1)
        modbus = ModbusTcpClient(host, port=int(port))
        self.addCleanup(modbus.close)
        self.assertTrue(modbus.connect())
        self.assertFalse(modbus.write_register(400, 4242, slave=1).isError())
        adam = self.client(server)
        answer = adam.lease()
        self.assertRegex(answer.refusal.holder, r"^modbus 127\.0\.0\.1:\d+$")
        self.assertDone(adam.ask(lease=pb.LeaseRequest(action=TAKE, reason="the PLC is mad")))
        adam.step(adam.newest().tick)
        self.assertNotEqual(modbus.read_holding_registers(400, 1, slave=1).registers, [4242], "its key is void")
        self.assertEqual(server.stop(), 0)
        said = [(line["event"], line["transport"]) for line in self.lines(folder / "audit")]
        self.assertEqual([line for line in said if line[1] == "modbus"], [("acquire", "modbus"), ("lease_lost", "modbus")])

    def test_sec_07_refused_modbus_clients_are_logged(self):
        """Catches: a refused client, on the port or at the axis of another, that only a counter shows."""
        from pymodbus.client import ModbusTcpClient
        folder = self.folder_with(USERS)
        server = self.server("--audit", str(folder / "audit"),
                             text=SERVO_TEXT + '\n[modbus]\nport = 0\nallow_writes = true\nmax_connections = 2\n')
        host, port = server.ready["modbus"].rsplit(":", 1)
        owner, stranger = (ModbusTcpClient(host, port=int(port)) for _ in range(2))
        for modbus in (owner, stranger):
            self.addCleanup(modbus.close)
            self.assertTrue(modbus.connect())
        self.assertFalse(owner.write_register(400, 4242, slave=1).isError())
        self.assertTrue(stranger.write_register(400, 4243, slave=1).isError(), "another client has the key")
        self.assertTrue(stranger.write_registers(402, [1, 0, 0], slave=1).isError(), "and no command is taken")
        self.assertEqual(at_end(host, port), b"", "no more connections")
        stranger.close()
        here = self.client(server)
        until(lambda: ("connections", 1) in [(count.name, count.value) for transport in here.status().transports
                                             for count in transport.counts], "there is room again")
        self.assertEqual(at_end(host, port, b"\0\0\0\0\0\1\1"), b"", "an impossible frame ends its connection")
        self.assertFalse(owner.read_holding_registers(400, 1, slave=1).isError(), "the owner goes on")
        self.assertEqual(server.stop(), 0)
        said = [line for line in self.lines(folder / "audit") if line["transport"] == "modbus" and line["result"] != "done"]
        self.assertEqual([(line["event"], line["axis"]) for line in said[:3]],
                         [("forbidden", "servo"), ("forbidden", "servo"), ("limit", None)])
        self.assertEqual(said[-1]["event"], "limit")
        self.assertEqual(len({line["result"] for line in said}), 4, "each with its reason")
        for line in said:
            self.assertRegex(line["peer"], r"^127\.0\.0\.1:\d+$")

    def test_sec_07_refused_can_clients_are_logged(self):
        """Catches: a client too many on the bus that no line shows."""
        folder = self.folder_with(USERS)
        server = self.server("--audit", str(folder / "audit"),
                             text=SERVO_TEXT + '\n[[can]]\nbackend = "slcan"\nchannel = "tcp:127.0.0.1:0"\n')
        bus = server.ready["can"][0]
        clients = []
        for number in range(16):
            clients.append(socket.create_connection(("127.0.0.1", bus.rsplit(":", 1)[1]), timeout=PATIENCE_S))
            self.addCleanup(clients[-1].close)
            clients[-1].sendall(b"V\r")
            self.assertEqual(clients[-1].recv(100), b"V0101\r", number)
        self.assertEqual(at_end("127.0.0.1", bus.rsplit(":", 1)[1]), b"")
        clients[0].sendall(b"V\r")
        self.assertEqual(clients[0].recv(100), b"V0101\r", "the other clients go on")
        self.assertEqual(server.stop(), 0)
        said = [line for line in self.lines(folder / "audit") if line["transport"] == "can"]
        self.assertEqual([line["event"] for line in said], ["limit"])
        self.assertIn("as many clients as this bus serves", said[0]["result"])
        self.assertRegex(said[0]["peer"], "^" + re.escape(bus) + r" 127\.0\.0\.1:\d+$")

    def test_sec_07_a_reload_is_logged_as_taken_or_refused(self):
        """Catches: a log that calls a refused reload done, or that does not name the file."""
        server = self.server_for(USERS, "--audit", str(self.folder_with("") / "audit"))
        log = pathlib.Path(server.process.args[-1])
        bench, whole = server.folder / "bench.toml", (server.folder / "bench.toml").read_text(encoding="utf-8")
        for tokens, text in ((USERS, whole), ("no tokens", whole), (USERS, "no bench"), (USERS, whole + "# again\n")):
            self.write_tokens(server.tokens, tokens)
            bench.write_text(text, encoding="utf-8")
            known = len(self.audited(log, "reload"))
            server.process.send_signal(signal.SIGHUP)
            until(lambda known=known: len(self.audited(log, "reload")) > known, "the reload is logged")
        good, bad_tokens, bad_bench, again = self.audited(log, "reload")
        self.assertEqual((good["result"], again["result"]), ("done", "done"))
        self.assertEqual({line["details"]["file"] for line in (good, bad_tokens, bad_bench, again)}, {str(bench)})
        hashes = [line["details"].get("configuration_hash") for line in (*self.audited(log, "start"), good, bad_tokens, bad_bench, again)]
        self.assertEqual(hashes, [hashes[0], hashes[0], None, None, hashes[0]])
        self.assertIn("tokens", bad_tokens["result"])
        self.assertIn("bench.toml", bad_bench["result"])
        self.assertEqual(server.errors().count("everything stays as it is"), 2)

    def test_sec_07_a_flood_of_guesses_leaves_no_line_of_a_user_out(self):
        """Catches: strangers that guess tokens from a few addresses until what a user may not do, a refused reload, or the
        guess of another address leaves no line; a log that they fill."""
        server = self.server_for(USERS, "--audit", str(self.folder_with("") / "audit"))
        log = pathlib.Path(server.process.args[-1])
        vera, began = self.user(server, "vera"), time.monotonic()
        for n in range(600):
            self.guess(server, "wrong", source=f"127.0.0.{2 + n % 3}")
        for _ in range(120):
            self.assertRefused(vera.lease(), pb.REFUSAL_FORBIDDEN, "lease")
        self.guess(server, "wrong", source="127.0.0.9")
        self.write_tokens(server.tokens, "no tokens")
        server.process.send_signal(signal.SIGHUP)
        until(lambda: self.audited(log, "reload"), "the reload is logged")
        self.assertNotEqual(self.audited(log, "reload")[0]["result"], "done")
        self.assertEqual([line["subject"] for line in self.audited(log, "forbidden")], ["vera"] * 120)
        guessed = [line["peer"].split(":")[0] for line in self.audited(log, "authentication")]
        self.assertEqual(guessed.count("127.0.0.9"), 1)
        for source in ("127.0.0.2", "127.0.0.3", "127.0.0.4"):
            self.assertLessEqual(guessed.count(source), 101 + 2 * (time.monotonic() - began), source)
        left_out = sum(line["details"].get("left_out_before", 0) for line in self.lines(log))
        self.assertEqual(left_out, 601 - len(guessed))

    def test_sec_07_a_user_that_asks_for_what_is_forbidden_has_to_wait(self):
        """Catches: a viewer that fills the disk with lines of refusals, over many sessions or new ones; a wait of those who ask
        for nothing forbidden."""
        server = self.server_for(USERS, "--audit", str(self.folder_with("") / "audit"))
        log, began = pathlib.Path(server.process.args[-1]), time.monotonic()
        request = frame(pb.Envelope(id=2, lease=pb.LeaseRequest()).SerializeToString())
        for n in range(40):
            noisy = self.user(server, "vera")
            noisy.socket.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                noisy.send_bytes(request * 2000)
            if n % 2:
                noisy.close()
        until(lambda: len(self.audited(log, "forbidden")) > 100, "the first ones have their lines")
        for user in ("vera", "otto"):
            self.assertEqual(self.user(server, user).newest().tick, 0)
        owed = 40  # each session may ask once before it waits
        self.assertLessEqual(len(self.audited(log, "forbidden")), 100 + 10 * (time.monotonic() - began) + owed)

    def test_sec_07_a_full_log_stops_the_bench_only_if_the_file_says_so(self):
        """Catches: a bench that drives on without its log although the file forbids it, or stops although the file allows
        it."""
        for policy in ("continue", "safe"):
            folder = self.folder_with(USERS)
            server = self.server(text=SERVO_TEXT + f'[audit]\nfile = "{folder}/audit"\non_failure = "{policy}"\n',
                                 before=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000)))
            owner = self.client(server)
            owner.lease()
            owner.step(0, 1.0)
            for _ in range(20):
                owner.ask(set_load=pb.SetLoad(load_nm=0.1))
            answer = owner.exchange(1, 1.0)
            if policy == "continue":
                self.assertEqual(answer.WhichOneof("kind"), "exchange_reply")
            else:
                self.assertRefused(answer, pb.REFUSAL_NOT_OWNER)
                self.assertEqual(owner.status().axes[0].sample.owner, 0)
            self.assertEqual(server.errors().count("the audit log cannot be written"), 1)
            self.assertLessEqual((folder / "audit").stat().st_size, 2000)
            self.assertEqual(server.stop(), 0)

    def test_sec_07_a_log_that_cannot_be_opened_ends_the_start(self):
        """Catches: a bench that runs without the log that its command line names."""
        with self.assertRaisesRegex(RuntimeError, "not a regular file"):
            self.server("--audit", "/dev/null")


if __name__ == "__main__":
    unittest.main(verbosity=2)
