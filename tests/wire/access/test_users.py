#!/usr/bin/python3
"""Several users: tokens, roles, taking by force, slots."""
import datetime
import hashlib
import pathlib
import shutil
import signal
import sys
import tempfile
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import PATIENCE_S, Closed, frame, pb
from wire_test import PATIENT_TEXT, SERVO_TEXT, TWO_AXES, WireTest, until

TAKE = pb.LeaseRequest.ACTION_TAKE
LEASE_LOST = 1 << 10  # in the fault word


def entry(name, role, more=""):
    return f'[[token]]\nname = "{name}"\nrole = "{role}"\ntoken = "{name}-secret"\n{more}'


USERS = entry("vera", "viewer") + entry("otto", "operator") + entry("olga", "operator") + entry("adam", "admin")


def in_seconds(seconds):
    time_of_end = datetime.datetime.now(datetime.timezone.utc) + datetime.timedelta(seconds=seconds)
    return time_of_end.replace(microsecond=0).isoformat()


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

    def guess(self, server, token, **options):
        with server.client(hello=False, **options) as client:
            return client.hello(token, "guess")


class Roles(UsersTest):
    def test_own_06_a_viewer_looks_and_changes_nothing(self):
        """Catches: a request that forgets to ask for the role; a role that forbids looking."""
        server = self.server_for()
        viewer = self.user(server, "vera")
        self.assertEqual((viewer.welcome.role, viewer.welcome.subject), (pb.ROLE_VIEWER, "vera"))
        allowed = {"subscribe": pb.Subscribe(decimation=1), "read_parameters": pb.ReadParameters(),
                   "status_request": pb.StatusRequest(), "exchange": pb.Exchange(),
                   "trigger": pb.Trigger(), "read_capture": pb.ReadCapture(),
                   "list_experiments": pb.ListExperiments(), "fetch_experiment": pb.FetchExperiment(id=1)}
        forbidden = {"lease": pb.LeaseRequest(action=1), "exchange": pb.Exchange(commands=[pb.Command()]),
                     "write_parameter": pb.WriteParameter(name="machine.rotor_resistance_ohm", value=5.0),
                     "set_load": pb.SetLoad(load_nm=1.0), "inject_fault": pb.InjectFault(name="bus_sag", value=1.0),
                     "shaft_bump": pb.ShaftBump(impulse_nms=1.0), "clear_faults": pb.ClearFaults(),
                     "run_experiment": pb.RunExperiment(), "upload_table": pb.UploadTable(),
                     "cancel_experiment": pb.CancelExperiment(id=1), "save_state": pb.SaveState(),
                     "restore_state": pb.RestoreState(), "reset_bench": pb.ResetBench(), "share_memory": pb.ShareMemory(),
                     "share_bridge": pb.ShareBridge()}
        asked = {field.name for field in pb.Envelope.DESCRIPTOR.oneofs_by_name["kind"].fields} & {*allowed, *forbidden}
        answers = {"id", "hello", "welcome", "refusal", "done", "exchange_reply", "samples", "parameter_values", "status",
                   "experiment_info", "table_info", "experiment_list", "experiment_data", "notice", "saved_state", "shared_memory", "triggered",
                   "capture_rows"}
        every = {field.name for field in pb.Envelope.DESCRIPTOR.fields}
        self.assertEqual(every, asked | answers, "a new request needs its roles here")
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

    def test_own_10_a_conductor_changes_what_another_session_drives(self):
        """Catches: a conductor that is refused, that needs no role, that may command, or whose changes end with a lease."""
        server = self.server_for(USERS + entry("cora", "conductor"))
        for name in ("vera", "otto"):
            with server.client(hello=False) as client:
                answer = client.hello(f"{name}-secret", conducts=True)
                self.assertRefused(answer, pb.REFUSAL_FORBIDDEN, "conducts")
                self.assertIn("needs the role conductor", answer.refusal.message)
        owner = self.user(server, "otto")
        self.assertDone(owner.lease())
        owner.step(0, 1.0)
        modest = self.user(server, "cora")
        self.assertEqual(modest.welcome.role, pb.ROLE_CONDUCTOR)
        changes = [{"write_parameter": pb.WriteParameter(name="machine.rotor_resistance_ohm", value=5.0)},
                   {"set_load": pb.SetLoad(load_nm=0.25)}, {"inject_fault": pb.InjectFault(name="bus_sag", value=0.5)},
                   {"shaft_bump": pb.ShaftBump(impulse_nms=1e-4)}]
        for change in changes:  # a session without `conducts` in its hello needs the lease, whatever its role
            self.assertRefused(modest.ask(**change), pb.REFUSAL_NOT_OWNER, "axis")
        conductor = self.user(server, "cora", conducts=True)
        for change in changes:
            self.assertDone(conductor.ask(**change))
        self.assertRefused(conductor.ask(exchange=pb.Exchange(commands=[pb.Command(tick=1)])), pb.REFUSAL_NOT_OWNER)
        self.assertRefused(conductor.ask(clear_faults=pb.ClearFaults()), pb.REFUSAL_NOT_OWNER)
        conductor.close()
        owner.step(1, 1.0)
        sample = owner.newest()
        self.assertEqual((sample.load_nm, sample.owner), (0.25, owner.owner))
        self.assertEqual(sample.injected, 1 << [f.name for f in owner.welcome.bench.injectable_faults].index("bus_sag"))
        self.assertDone(owner.lease(pb.LeaseRequest.ACTION_RELEASE))
        self.assertEqual(owner.newest().load_nm, 0.25)

    def test_without_tokens_every_client_is_an_administrator(self):
        """Catches: a bench for one user that asks for a token."""
        client = self.client(self.server())
        self.assertEqual((client.welcome.role, client.welcome.subject), (pb.ROLE_ADMIN, ""))
        self.assertDone(client.ask(lease=pb.LeaseRequest(action=TAKE, reason="no owner answers")))

    def test_own_04_taking_a_second_axis_keeps_the_first(self):
        """Catches: a lease under a number that its session has given up: it is granted and can be neither used nor given
        back."""
        server = self.server("--mode", "realtime", text=TWO_AXES.replace("watchdog_ticks = 20", "watchdog_ticks = 8000"))
        client = self.client(server)
        asked = [pb.LeaseRequest(axis=0, action=pb.LeaseRequest.ACTION_ACQUIRE), pb.LeaseRequest(axis=1, action=TAKE, reason="both")]
        client.send_bytes(b"".join(frame(pb.Envelope(id=100 + n, lease=each).SerializeToString()) for n, each in enumerate(asked)))
        answers = [client.answer_to(100 + n) for n in range(2)]
        for answer in answers:
            self.assertDone(answer)
        self.assertEqual(answers[0].done.owner, answers[1].done.owner)
        for axis in range(2):
            self.assertEqual(client.newest(axis).owner, answers[axis].done.owner)
            self.assertEqual(client.exchange(client.newest(axis).tick, axis=axis).WhichOneof("kind"), "exchange_reply")
        client.close()
        watcher = self.client(server)
        until(lambda: not any(watcher.newest(axis).owner for axis in range(2)), "both are given back")

    def test_a_second_hello_is_refused(self):
        """Catches: a viewer that becomes an administrator in mid-session, or an operator that keeps an axis as a
        viewer."""
        viewer = self.user(self.server_for(), "vera")
        self.assertRefused(viewer.hello("adam-secret"), pb.REFUSAL_MALFORMED, "kind")
        self.assertRefused(viewer.lease(), pb.REFUSAL_FORBIDDEN)

    def test_own_01_a_refusal_names_the_owner_and_the_end_of_its_lease(self):
        """Catches: a refusal that says "busy" and names neither the owner nor the end of its lease."""
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


class Reserve(UsersTest):
    def test_own_04_limit_02_viewers_keep_no_administrator_out(self):
        """Catches: a crowd of viewers, or of operators, that leaves no place for the administrator that must take an axis
        by force; a refusal that says nothing."""
        server = self.server_for(text=SERVO_TEXT.replace("[tcp]", "[tcp]\nmax_sessions = 4"), unix=True)
        otto, *_ = [self.user(server, "otto")] + [self.user(server, "vera") for _ in range(3)]
        self.assertDone(otto.lease())

        def turned_away(name, **options):
            refusal = self.client(server, hello=False, **options).hello(f"{name}-secret")
            self.assertRefused(refusal, pb.REFUSAL_BUSY, "session")
        turned_away("vera")
        for _ in range(7):
            self.user(server, "olga")
        self.user(server, "vera", unix=True)
        for name, options in (("olga", {}), ("vera", {"unix": True}), ("vera", {})):
            turned_away(name, **options)
        adam = self.user(server, "adam")
        self.assertDone(adam.ask(lease=pb.LeaseRequest(action=TAKE, reason="the bench is full")))
        self.assertEqual((adam.status().sessions, adam.tcp_counts()["turned_away"]), (13, 4))


class Force(UsersTest):
    def test_own_04_own_05_an_administrator_takes_a_driven_axis(self):
        """Catches: an owner that is not told, an axis that changes hands while it is driven, an old owner that goes
        on."""
        for mode in ("lockstep", "realtime"):
            with self.subTest(mode=mode):
                server = self.server_for(USERS, "--mode", mode, text=PATIENT_TEXT)
                otto, adam = self.user(server, "otto"), self.user(server, "adam")
                otto.lease()
                tick = otto.newest().tick
                for _ in range(15):  # in real time the first ten arm the axis
                    tick = otto.step(tick, 20.0).tick
                for reason in ("", "x" * 201, "x\x1b[2J", "\u202enimda yb"):
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
        """Catches: a controller that waits forever for the tick of an axis that it has lost."""
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
    def test_sec_04_only_the_right_token_opens_and_no_text_contains_it(self):
        """Catches: guesses that cost nothing; a guess that ends other sessions; a token in the log."""
        folder = self.folder_with(USERS)
        text = SERVO_TEXT.replace("[tcp]", f'[tcp]\ntokens_file = "{folder}/tokens"')
        server = self.server("--record", str(folder / "run.mcap"), "--audit", str(folder / "audit"), text=text)
        inside = self.user(server, "otto")
        self.assertRefused(self.guess(server, "otto-secre"), pb.REFUSAL_UNAUTHENTICATED, "token")
        looked_at = 0
        end = time.monotonic() + 1.2
        guesses = 0
        while time.monotonic() < end or not looked_at:
            answer = self.guess(server, f"adam-secreT {guesses}")
            self.assertRefused(answer, pb.REFUSAL_UNAUTHENTICATED, "token")
            looked_at += "has to wait" not in answer.refusal.message
            guesses += 1
        self.assertGreater(guesses, 20)
        self.assertIn(looked_at, (1, 2), "after 0.5 and 1.5 s")
        inside.newest()

        def right():
            return self.guess(server, "adam-secret").WhichOneof("kind") == "welcome"
        until(right, "the client that waited is admitted")
        self.assertTrue(right(), "no client waits any more")
        self.assertGreaterEqual(inside.tcp_counts()["wrong_tokens"], guesses)
        seen = f"{inside.welcome}{inside.status()}{answer}"
        self.assertEqual(server.stop(), 0)
        # Each place with what shows that this test can read it. A wrong token may be nearly the right one.
        hashes = [hashlib.sha256(f"{name}-secret".encode()).hexdigest() for name in ("otto", "adam")]
        for place, known in ((server.errors(), "not admitted: wrong token"), (" ".join(server.process.args), "--audit"),
                             ((folder / "audit").read_text(encoding="utf-8"), '"authentication"'), (seen, "otto"),
                             ((folder / "run.mcap").read_bytes().decode("latin-1"), "stator_resistance_ohm")):
            self.assertIn(known, place)
            for secret in ("-secre", *hashes):
                self.assertNotIn(secret.lower(), place.lower())
        self.assertLessEqual(server.errors().count("token"), 2, "a line in 10 s")

    def test_sec_04_os_01_a_hangup_reads_the_tokens_again(self):
        """Catches: a removed user whose session goes on, or another user who loses the session with it; a broken file
        that admits or removes every user."""
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
        until(lambda: olga.lease().WhichOneof("kind") == "done", "the axis is free")
        self.assertRefused(olga.exchange(3, 5.0), pb.REFUSAL_LATCHED)
        self.assertEqual(self.user(server, "vera").welcome.role, pb.ROLE_OPERATOR)
        self.assertRefused(self.guess(server, "otto-secret"), pb.REFUSAL_UNAUTHENTICATED, "token")

    def test_own_07_the_lease_ends_with_the_slot(self):
        """Catches: a script that drives on in the slot of the next user; a token that still opens after its time."""
        users = entry("otto", "operator", f'until = "{in_seconds(8)}"\n') + entry("olga", "operator")
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


if __name__ == "__main__":
    unittest.main(verbosity=2)
