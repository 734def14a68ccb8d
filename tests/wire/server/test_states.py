#!/usr/bin/python3
"""States over the wire: save, restore, reset."""
import pathlib
import shutil
import sys
import tempfile
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import BENCHES, pb
from wire_test import PATIENT_TEXT, SERVO_TEXT, TWO_AXES, WireTest, until

USERS = "".join(f'[[token]]\nname = "{name}"\nrole = "{role}"\ntoken = "{name}-secret"\n'
                for name, role in (("vera", "viewer"), ("otto", "operator"), ("carla", "conductor")))

SAVE = {"save_state": pb.SaveState()}
RESET = {"reset_bench": pb.ResetBench()}


class States(WireTest):
    def save(self, client):
        return client.ask(**SAVE).saved_state

    def restore(self, client, state, part=32000):
        for at in range(0, len(state), part):
            more = at + part < len(state)
            answer = client.ask(restore_state=pb.RestoreState(state=state[at:at + part], more=more))
            if answer.WhichOneof("kind") == "refusal":
                return answer
        return answer

    def hash(self, client):
        return client.ask(status_request=pb.StatusRequest()).status.state_hash

    def run_to(self, client, tick, until_tick):
        while tick < until_tick:
            sample = client.step(tick, 10.0 + tick % 7, -5.0)
            tick = sample.tick
        return sample

    def test_a_run_goes_on_from_its_state_here_and_elsewhere(self):
        """Catches: a piece of the run that the state lacks, a server that answers with the sample of the time before."""
        owner = self.client(self.server(text=PATIENT_TEXT))
        owner.lease()
        self.run_to(owner, 0, 300)
        saved = self.save(owner)
        self.assertEqual(saved.tick, 300)
        end = self.run_to(owner, 300, 700)
        expected = self.hash(owner)
        self.assertDone(self.restore(owner, saved.state))
        self.assertEqual(owner.newest().tick, 300)
        self.assertEqual(self.run_to(owner, 300, 700), end)
        self.assertEqual(self.hash(owner), expected)
        other = self.client(self.server(text=PATIENT_TEXT))
        other.lease()
        self.assertDone(self.restore(other, saved.state, part=1000))
        self.assertEqual(self.run_to(other, 300, 700), end)
        self.assertEqual(self.hash(other), expected)

    def test_reset_is_a_new_start_with_the_lease(self):
        """Catches: a reset that keeps a parameter, a fault or a scheduled change, or that takes the lease."""
        owner = self.client(self.server(text=PATIENT_TEXT))
        owner.lease()
        first = self.run_to(owner, 0, 200)
        expected = self.hash(owner)
        self.assertDone(owner.ask(inject_fault=pb.InjectFault(name="open_phase", value=1)))
        self.assertDone(owner.ask(set_load=pb.SetLoad(load_nm=0.1, at_tick=900)))
        self.run_to(owner, 200, 220)
        self.assertDone(owner.ask(**RESET))
        self.assertEqual(owner.newest().tick, 0)
        self.assertEqual(self.run_to(owner, 0, 200), first)
        self.assertEqual(self.hash(owner), expected)

    def test_only_who_has_the_bench_to_itself_or_conducts(self):
        """Catches: a stranger that throws back the run of a controller, a viewer that does anything; a conductor that may not,
        and a controller that waits for ever for the tick that has gone."""
        folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-states-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        (folder / "tokens").write_text(USERS, encoding="utf-8")
        (folder / "tokens").chmod(0o600)
        text = TWO_AXES.replace("watchdog_ticks = 20", "watchdog_ticks = 400000").replace("lease_s = 2.0", "lease_s = 60.0")
        server = self.server(text=text.replace("[tcp]", f'[tcp]\ntokens_file = "{folder}/tokens"'))
        viewer, owner, stranger, second = (self.client(server, token=f"{name}-secret") for name in ("vera", "otto", "otto", "otto"))
        conductor = self.client(server, token="carla-secret", conducts=True)
        start = self.save(stranger)
        for request in (SAVE, RESET, {"restore_state": pb.RestoreState(state=start.state[:30000], more=True)}):
            self.assertRefused(viewer.ask(**request), pb.REFUSAL_FORBIDDEN)
        owner.lease()
        for request in (SAVE, RESET, {"restore_state": pb.RestoreState(state=start.state[:30000], more=True)}):
            refused = stranger.ask(**request)
            self.assertRefused(refused, pb.REFUSAL_OWNED, "axis")
            self.assertIn("otto", refused.refusal.holder)
        second.lease(axis=1)
        waiting = owner.send(exchange=pb.Exchange(commands=[pb.Command(axis=0, tick=0, gates=pb.GATES_VOLTAGE)]))
        self.assertDone(conductor.ask(**RESET))
        answered = owner.answer_to(waiting)
        self.assertEqual(answered.exchange_reply.samples[0].sample.tick, 0, answered)

    def test_a_driven_axis_that_nobody_holds_has_lost_its_controller(self):
        """Catches: an axis that goes on under commands of a controller that is not there, or under another one's number."""
        owner = self.client(self.server(text=PATIENT_TEXT))
        owner.lease()
        self.run_to(owner, 0, 100)
        state = self.save(owner).state
        other = self.client(self.server(text=PATIENT_TEXT))
        self.assertDone(self.restore(other, state))
        axis = other.ask(status_request=pb.StatusRequest()).status.axes[0].sample
        self.assertEqual((axis.tick, axis.owner), (100, 0))
        other.lease()
        sample = other.exchange(100, gates=pb.GATES_OFF).exchange_reply.samples[0].sample
        lost = next(f.bit for f in other.welcome.bench.faults if f.name == "lease_lost")
        self.assertTrue(sample.faults & lost)

    def test_bytes_that_are_no_state_change_nothing(self):
        """Catches: a damaged, foreign or endless state that is taken, or that leaves something behind."""
        server = self.server(text=PATIENT_TEXT)
        owner = self.client(server)
        owner.lease()
        self.run_to(owner, 0, 50)
        before, state = self.hash(owner), self.save(owner).state
        foreign = self.save(self.client(self.server(config=BENCHES / "bm500.toml"))).state
        for bad in (b"", b"x", state[:-1], state[:8] + b"\0" + state[9:], foreign, bytes(len(state))):
            answer = owner.ask(restore_state=pb.RestoreState(state=bad))
            self.assertEqual(answer.WhichOneof("kind"), "refusal", len(bad))
            self.assertIn(answer.refusal.code, (pb.REFUSAL_MALFORMED, pb.REFUSAL_OUT_OF_RANGE))
        self.assertDone(owner.ask(restore_state=pb.RestoreState(state=state[:20000], more=True)))
        refused = owner.ask(restore_state=pb.RestoreState(state=state[:20000], more=True))
        self.assertRefused(refused, pb.REFUSAL_OUT_OF_RANGE, "state")
        self.assertIn(f"a state of this bench has {len(state)} bytes", refused.refusal.message)
        self.assertRefused(owner.ask(restore_state=pb.RestoreState(state=state[20000:])), pb.REFUSAL_MALFORMED, "state")
        self.assertEqual(self.hash(owner), before)
        self.assertDone(self.restore(owner, state))

    def test_a_recording_is_of_one_run(self):
        """Catches: a recording whose ticks jump, which no replay could follow."""
        with tempfile.TemporaryDirectory() as folder:
            client = self.client(self.server("--record", f"{folder}/run.mcap", text=SERVO_TEXT))
            state = self.save(client).state
            for request in (RESET, {"restore_state": pb.RestoreState(state=state)}):
                refused = client.ask(**request)
                self.assertRefused(refused, pb.REFUSAL_NOT_AVAILABLE)
                self.assertIn("records", refused.refusal.message)

    def test_a_subscriber_sees_the_time_go_back(self):
        """Catches: a jump that counts as billions of lost samples, or that ends a subscription."""
        server = self.server(text=PATIENT_TEXT)
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        for decimation in (1, 8):
            self.assertDone(viewer.ask(subscribe=pb.Subscribe(axis=0, decimation=decimation)))
        self.run_to(owner, 0, 40)
        self.assertDone(owner.ask(**RESET))
        self.run_to(owner, 0, 24)
        viewer.ask(status_request=pb.StatusRequest())
        ticks = [sample.tick for message in viewer.samples for sample in message.samples]
        self.assertEqual(ticks[:7], [8, 16, 24, 32, 40, 0, 8])
        self.assertEqual(sum(message.dropped for message in viewer.samples), 0)

    def test_a_bench_in_real_time_goes_back_between_two_ticks(self):
        """Catches: a tick thread that stands still after a save or a restore, late ticks that the restore itself counts."""
        client = self.client(self.server("--mode", "realtime"))
        first = self.save(client)
        until(lambda: client.newest().tick > first.tick + 200, "ticks in real time")
        for _ in range(20):
            later = self.save(client).tick
            self.assertDone(client.ask(**RESET))
            until(lambda tick=later: 0 < client.newest().tick, "ticks after the reset")
        self.assertDone(self.restore(client, first.state))
        until(lambda: client.newest().tick > first.tick + 200, "ticks after the restore")


if __name__ == "__main__":
    unittest.main(verbosity=2)
