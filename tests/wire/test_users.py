#!/usr/bin/python3
"""Several users: tokens, roles, taking by force, slots, the audit log. Each test names the mistake that it would catch."""
import datetime
import json
import os
import pathlib
import re
import resource
import shutil
import signal
import socket
import stat
import sys
import tempfile
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

from wire_client import PATIENCE_S, Closed, pb
from wire_test import SERVO_TEXT, WireTest, until

TAKE = pb.LeaseRequest.ACTION_TAKE
PATIENT = SERVO_TEXT.replace("watchdog_ticks = 20", "watchdog_ticks = 8000")  # a loaded host is no silent controller
LEASE_LOST = 1 << 10  # in the fault word


def entry(name, role, more=""):
    return f'[[token]]\nname = "{name}"\nrole = "{role}"\ntoken = "{name}-secret"\n{more}'


USERS = entry("vera", "viewer") + entry("otto", "operator") + entry("olga", "operator") + entry("adam", "admin")


def in_seconds(seconds):
    time_of_end = datetime.datetime.now(datetime.timezone.utc) + datetime.timedelta(seconds=seconds)
    return time_of_end.replace(microsecond=0).isoformat()


def at_end(host, port, said=b""):
    """What a connection gives until its other end closes it."""
    with socket.create_connection((host, int(port)), timeout=PATIENCE_S) as line:
        line.sendall(said)
        try:
            return line.recv(100)
        except ConnectionResetError:
            return b""


class UsersTest(WireTest):
    def server_for(self, users=USERS, *options, text=SERVO_TEXT, **more):
        """A server with these tokens."""
        folder = self.folder_with(users)
        text = text.replace("[tcp]", f'[tcp]\ntokens_file = "{folder}/tokens"')
        server = self.server(*options, text=text, **more)
        server.tokens = folder / "tokens"
        return server

    def folder_with(self, users):
        """A folder with a tokens file."""
        folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-users-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        self.write_tokens(folder / "tokens", users)
        return folder

    @staticmethod
    def write_tokens(file, users):
        file.write_text(users, encoding="utf-8")
        file.chmod(0o600)

    def user(self, server, name, **options):
        return self.client(server, token=f"{name}-secret", **options)

    def guess(self, server, token):
        client = self.client(server, hello=False)
        return client.hello(token, "guess")


class Roles(UsersTest):
    def test_own_06_a_viewer_looks_and_changes_nothing(self):
        """A request that forgets to ask for the role; a role that forbids looking."""
        server = self.server_for()
        viewer = self.user(server, "vera")
        self.assertEqual((viewer.welcome.role, viewer.welcome.subject), (pb.ROLE_VIEWER, "vera"))
        allowed = {"subscribe": pb.Subscribe(decimation=1), "read_parameters": pb.ReadParameters(),
                   "status_request": pb.StatusRequest(), "exchange": pb.Exchange(),
                   "list_experiments": pb.ListExperiments(), "fetch_experiment": pb.FetchExperiment(id=1)}
        forbidden = {"lease": pb.LeaseRequest(action=1), "exchange": pb.Exchange(commands=[pb.Command()]),
                     "write_parameter": pb.WriteParameter(name="machine.rotor_resistance_ohm", value=5.0),
                     "set_load": pb.SetLoad(load_nm=1.0), "inject_fault": pb.InjectFault(name="bus_sag", value=1.0),
                     "shaft_bump": pb.ShaftBump(impulse_nms=1.0), "clear_faults": pb.ClearFaults(),
                     "run_experiment": pb.RunExperiment(), "upload_table": pb.UploadTable(),
                     "cancel_experiment": pb.CancelExperiment(id=1)}
        asked = {field.name for field in pb.Envelope.DESCRIPTOR.oneofs_by_name["kind"].fields} & {*allowed, *forbidden}
        answers = {"id", "hello", "welcome", "refusal", "done", "exchange_reply", "samples", "parameter_values", "status",
                   "experiment_info", "table_info", "experiment_list", "experiment_data", "notice"}
        every = {field.name for field in pb.Envelope.DESCRIPTOR.fields}
        self.assertEqual(every, asked | answers, "a new request: who may ask it?")
        for kind, request in allowed.items():
            answer = viewer.ask(**{kind: request})
            if answer.WhichOneof("kind") == "refusal":  # this bench keeps no experiments
                self.assertRefused(answer, pb.REFUSAL_NOT_AVAILABLE)
        for kind, request in forbidden.items():
            answer = viewer.ask(**{kind: request})
            self.assertRefused(answer, pb.REFUSAL_FORBIDDEN, kind)
            self.assertIn("vera, a viewer", answer.refusal.message)
            self.assertIn("operator", answer.refusal.message)
        operator = self.user(server, "otto")
        self.assertEqual(operator.welcome.role, pb.ROLE_OPERATOR)
        self.assertDone(operator.lease())
        answer = operator.ask(lease=pb.LeaseRequest(action=TAKE, reason="mine"))
        self.assertRefused(answer, pb.REFUSAL_FORBIDDEN, "lease")
        self.assertIn("admin", answer.refusal.message)
        operator.step(0)

    def test_without_tokens_everybody_is_an_administrator(self):
        """A bench on one desk that asks for a token all of a sudden."""
        client = self.client(self.server())
        self.assertEqual((client.welcome.role, client.welcome.subject), (pb.ROLE_ADMIN, ""))
        self.assertDone(client.ask(lease=pb.LeaseRequest(action=TAKE, reason="nobody is here")))

    def test_hello_is_said_once(self):
        """A viewer who becomes an administrator in the middle of a session, or an operator who keeps an axis as a viewer."""
        viewer = self.user(self.server_for(), "vera")
        self.assertRefused(viewer.hello("adam-secret"), pb.REFUSAL_MALFORMED, "kind")
        self.assertRefused(viewer.lease(), pb.REFUSAL_FORBIDDEN)

    def test_own_01_the_loser_is_told_who_and_until_when(self):
        """"Busy", and nobody knows whom to call."""
        server = self.server_for(unix=True)
        otto = self.user(server, "otto")
        self.assertDone(otto.lease())
        otto.step(0)
        answer = self.user(server, "olga", unix=True).lease()
        self.assertRefused(answer, pb.REFUSAL_OWNED, "axis")
        self.assertRegex(answer.refusal.holder, r"^otto \(tcp 127\.0\.0\.1:\d+\)$")
        self.assertIn(answer.refusal.holder, answer.refusal.message)
        self.assertEqual(answer.refusal.lease_end_tick, 1 + 16000)  # lease_s = 2
        self.assertIn("16001", answer.refusal.message)


class Force(UsersTest):
    def test_own_04_own_05_an_administrator_takes_a_driven_axis(self):
        """An owner who is not told, an axis that changes hands while it is driven, an old owner who goes on."""
        for mode in ("lockstep", "realtime"):
            with self.subTest(mode=mode):
                server = self.server_for(USERS, "--mode", mode, text=PATIENT)
                otto, adam = self.user(server, "otto"), self.user(server, "adam")
                otto.lease()
                tick = otto.newest().tick
                for _ in range(15):  # in real time the first ten arm the axis
                    tick = otto.step(tick, 20.0).tick
                for reason in ("", "x" * 201):
                    self.assertRefused(adam.ask(lease=pb.LeaseRequest(action=TAKE, reason=reason)), pb.REFUSAL_OUT_OF_RANGE,
                                       "reason")
                self.assertRefused(adam.lease(), pb.REFUSAL_OWNED)
                answer = adam.ask(lease=pb.LeaseRequest(action=TAKE, reason="smoke in the lab"))
                self.assertDone(answer)
                self.assertGreater(answer.done.owner, otto.owner)
                refusal = otto.exchange(otto.newest().tick, 20.0)
                self.assertRefused(refusal, pb.REFUSAL_NOT_OWNER, "commands")
                self.assertRegex(refusal.refusal.message, r"taken by adam \(tcp .*\): smoke in the lab")
                self.assertEqual([(n.kind, n.axis) for n in otto.notices], [(pb.Notice.KIND_LEASE_TAKEN, 0)])
                self.assertIn("smoke in the lab", otto.notices[0].message)
                self.assertRefused(otto.lease(pb.LeaseRequest.ACTION_RENEW), pb.REFUSAL_NOT_OWNER)
                self.assertRefused(otto.ask(clear_faults=pb.ClearFaults()), pb.REFUSAL_NOT_OWNER)
                newest = adam.newest().tick
                self.assertRefused(adam.exchange(newest, 20.0), pb.REFUSAL_LATCHED)
                self.assertTrue(adam.step(adam.newest().tick, gates=pb.GATES_OFF).faults & LEASE_LOST)
                self.assertDone(adam.ask(clear_faults=pb.ClearFaults()))
                adam.step(adam.newest().tick, 1.0)

    def test_own_04_an_exchange_that_waits_is_answered(self):
        """A controller that waits for ever for the tick of an axis that is not its own any more."""
        server = self.server_for(text=SERVO_TEXT + SERVO_TEXT[SERVO_TEXT.index("[[axis]]"):].replace('"servo"', '"second"', 1))
        otto, olga, adam = (self.user(server, name) for name in ("otto", "olga", "adam"))
        otto.lease()
        olga.lease(axis=1)
        waiting = otto.send(exchange=pb.Exchange(commands=[pb.Command(axis=0, tick=0, gates=pb.GATES_VOLTAGE)]))
        self.assertDone(adam.ask(lease=pb.LeaseRequest(action=TAKE, reason="enough")))
        answer = otto.answer_to(waiting)
        self.assertRefused(answer, pb.REFUSAL_NOT_OWNER, "commands")
        self.assertIn("enough", answer.refusal.message)


class Tokens(UsersTest):
    def test_sec_04_no_token_but_the_right_one_and_it_stands_nowhere(self):
        """Guesses that cost nothing; a guess that ends the bench for those inside; a token that the log keeps."""
        folder = self.folder_with(USERS)
        text = SERVO_TEXT.replace("[tcp]", f'[tcp]\ntokens_file = "{folder}/tokens"')
        server = self.server("--record", str(folder / "run.mcap"), "--audit", str(folder / "audit"), text=text)
        inside = self.user(server, "otto")
        self.assertRefused(self.guess(server, "otto-secre"), pb.REFUSAL_UNAUTHENTICATED, "token")
        refused = 0
        end = time.monotonic() + 1.2
        guesses = 0
        while time.monotonic() < end:
            answer = self.guess(server, f"guess {guesses}")
            self.assertRefused(answer, pb.REFUSAL_UNAUTHENTICATED, "token")
            refused += "has to wait" not in answer.refusal.message
            guesses += 1
        self.assertGreater(guesses, 20)
        self.assertLessEqual(refused, 2, "looked at after 0.5 and 1.5 s")
        inside.newest()

        def right():
            return self.guess(server, "adam-secret").WhichOneof("kind") == "welcome"
        until(right, "whoever has waited is let in")
        self.assertTrue(right(), "and nobody waits any more")
        counts = {c.name: c.value for t in inside.status().transports if t.name.startswith("tcp") for c in t.counts}
        self.assertGreaterEqual(counts["wrong_tokens"], guesses)
        self.assertEqual(server.stop(), 0)
        command_line = " ".join(server.process.args)
        for place in (server.errors(), command_line, (folder / "audit").read_text(encoding="utf-8"),
                      (folder / "run.mcap").read_bytes().decode("latin-1")):
            self.assertNotIn("-secret", place)
        self.assertLessEqual(server.errors().count("token"), 2, "a line in 10 s")

    def test_sec_04_os_01_a_hangup_reads_the_tokens_again(self):
        """A user who was put out and stays inside, or one who had to go with him; a broken file that lets everybody in or out."""
        server = self.server_for()
        otto, olga, vera = (self.user(server, name) for name in ("otto", "olga", "vera"))
        otto.lease()
        otto.step(0)
        otto.step(1, 5.0)
        self.write_tokens(server.tokens, "no tokens")
        server.process.send_signal(signal.SIGHUP)
        until(lambda: "everything stays as it is" in server.errors(), "the file is refused")
        otto.step(2, 5.0)
        users = (entry("otto", "operator", "revoked = true\n") + entry("olga", "operator") + entry("vera", "operator"))
        self.write_tokens(server.tokens, users)
        server.process.send_signal(signal.SIGHUP)
        for gone in (otto, vera):
            self.assertTrue(gone.is_closed())
            self.assertEqual([n.kind for n in gone.notices], [pb.Notice.KIND_SESSION_ENDED])
        self.assertIn("otto", otto.notices[0].message)
        until(lambda: olga.lease().WhichOneof("kind") == "done", "his axis is free")
        self.assertRefused(olga.exchange(3, 5.0), pb.REFUSAL_LATCHED)
        self.assertEqual(self.user(server, "vera").welcome.role, pb.ROLE_OPERATOR)
        self.assertRefused(self.guess(server, "otto-secret"), pb.REFUSAL_UNAUTHENTICATED, "token")

    def test_own_07_the_lease_ends_with_the_slot(self):
        """A script that drives on in the time of the next user; a token that still opens after its time."""
        users = entry("otto", "operator", f'until = "{in_seconds(3)}"\n') + entry("olga", "operator")
        server = self.server_for(users)
        otto, olga = self.user(server, "otto"), self.user(server, "olga")
        otto.lease()
        self.assertRefused(olga.lease(), pb.REFUSAL_OWNED)
        with self.assertRaises((Closed, BrokenPipeError, ConnectionResetError)):
            end = time.monotonic() + PATIENCE_S
            while time.monotonic() < end:
                otto.step(otto.newest().tick, 5.0)
        until(lambda: olga.lease().WhichOneof("kind") == "done", "the next one gets it")
        self.assertTrue(olga.step(olga.newest().tick, gates=pb.GATES_OFF).faults & LEASE_LOST)
        answer = self.guess(server, "otto-secret")
        self.assertRefused(answer, pb.REFUSAL_UNAUTHENTICATED, "token")
        self.assertIn("over", answer.refusal.message)


class AuditLog(UsersTest):
    def lines(self, file):
        return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]

    def test_sec_07_own_04_everything_that_counts_stands_in_the_log(self):
        """An event without a line; a line without a name; a log that others read."""
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
        adam.ask(lease=pb.LeaseRequest(action=TAKE, reason="test \x1b[31m\n"))
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
        self.assertTrue(all(byte == 10 or 32 <= byte < 127 for byte in raw), "nothing that moves a terminal")
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
        self.assertEqual(by_name["take"]["details"]["reason"], "test \x1b[31m\n")
        self.assertRegex(by_name["take"]["details"]["from"], r"^otto \(tcp 127")
        self.assertEqual(by_name["armed"]["details"]["state"], "run")
        self.assertEqual(by_name["parameter"]["details"]["name"], "machine.rotor_resistance_ohm")
        self.assertEqual(said[3]["details"]["client"], "otto\n\x1b[2J{}")
        self.assertEqual(by_name["load"]["transport"], "tcp")
        ticks = [line["monotonic_ns"] for line in said]
        self.assertEqual(ticks, sorted(ticks))
        for line in said:
            self.assertRegex(line["time"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z$")

    def test_sec_07_modbus_writes_stand_there_too(self):
        """A way in that nobody looks at."""
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
        self.assertNotEqual(modbus.read_holding_registers(400, 1, slave=1).registers, [4242], "its key holds no more")
        self.assertEqual(server.stop(), 0)
        said = [(line["event"], line["transport"]) for line in self.lines(folder / "audit")]
        self.assertEqual([line for line in said if line[1] == "modbus"], [("acquire", "modbus"), ("lease_lost", "modbus")])

    def test_sec_07_who_is_turned_away_by_modbus_stands_there(self):
        """A stranger at the door, or at an axis of another, of whom only a counter knows."""
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
        self.assertTrue(stranger.write_register(400, 4243, slave=1).isError(), "another has the key")
        self.assertTrue(stranger.write_registers(402, [1, 0, 0], slave=1).isError(), "and no command is taken")
        self.assertEqual(at_end(host, port), b"", "the house is full")
        stranger.close()
        until(lambda: at_end(host, port, b"\0\0\0\0\0\1\1") == b"", "a frame that cannot be ends its connection")
        self.assertFalse(owner.read_holding_registers(400, 1, slave=1).isError(), "the owner has noticed nothing")
        self.assertEqual(server.stop(), 0)
        said = [line for line in self.lines(folder / "audit") if line["transport"] == "modbus" and line["result"] != "done"]
        self.assertEqual([(line["event"], line["axis"]) for line in said[:3]],
                         [("forbidden", "servo"), ("forbidden", "servo"), ("limit", None)])
        self.assertEqual(said[-1]["event"], "limit")
        self.assertEqual(len({line["result"] for line in said}), 4, "each with its reason")
        for line in said:
            self.assertRegex(line["peer"], r"^127\.0\.0\.1:\d+$")

    def test_sec_07_who_is_turned_away_by_a_can_bus_stands_there(self):
        """A program that is one too many on the bus, of which nobody hears."""
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
        self.assertEqual(clients[0].recv(100), b"V0101\r", "the others have noticed nothing")
        self.assertEqual(server.stop(), 0)
        said = [line for line in self.lines(folder / "audit") if line["transport"] == "can"]
        self.assertEqual([line["event"] for line in said], ["limit"])
        self.assertIn("as many clients as this bus serves", said[0]["result"])
        self.assertRegex(said[0]["peer"], "^" + re.escape(bus) + r" 127\.0\.0\.1:\d+$")

    def test_sec_07_a_log_that_cannot_be_written(self):
        """A bench that drives on unwatched although that was ruled out, or stops although it was not."""
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

    def test_sec_07_a_log_that_cannot_be_had_is_an_error_at_once(self):
        """A bench that believes it is watched."""
        with self.assertRaisesRegex(RuntimeError, "not a regular file"):
            self.server("--audit", "/dev/null")


if __name__ == "__main__":
    unittest.main(verbosity=2)
