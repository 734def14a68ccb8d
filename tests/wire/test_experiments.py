#!/usr/bin/python3
"""Experiments on the real server, over the wire. Each test names the mistake that it would catch."""
import json
import math
import os
import pathlib
import random
import re
import struct
import subprocess
import sys
import tempfile
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

from wire_client import PATIENCE_S, SERVER, Client, Closed, pb
from wire_test import SERVO_TEXT, WireTest, until

OWNER = "the secret of a test"
ENDED = (pb.EXPERIMENT_STATE_COMPLETED, pb.EXPERIMENT_STATE_STOPPED, pb.EXPERIMENT_STATE_CANCELLED,
         pb.EXPERIMENT_STATE_FAILED)
SIGNALS = ("i_a_a", "i_b_a", "speed_rad_s")


def request(ticks=400, amplitude=40.0, signals=SIGNALS, owner=OWNER, **more):
    """A sine of 60 Hz on both phases of the servo."""
    shape = pb.Shape(three_phase=pb.Shape.ThreePhase(amplitude=amplitude, frequency_hz=60.0))
    wanted = dict(owner=owner, mode=pb.MODE_FREE, ticks=ticks, signals=signals, user="wire test",
                  input=pb.ExperimentInput(kind=pb.INPUT_KIND_PHASE_VOLTAGES, shapes=[shape]))
    wanted.update(more)
    return pb.RunExperiment(**wanted)


def endless(**more):
    """Paced by the clock: long enough for whatever a test does meanwhile."""
    return request(ticks=400_000, mode=pb.MODE_REALTIME, **more)


class Fetched:
    """What came of a fetch."""

    def __init__(self):
        self.data = b""
        self.ticks = []  # of the first row of each message
        self.info = None

    def rows(self, width):
        values = struct.unpack(f"<{len(self.data) // 8}d", self.data)
        return [values[i:i + width] for i in range(0, len(values), width)]


class Experiments(WireTest):
    def setUp(self):
        self.kept = tempfile.TemporaryDirectory(prefix="drivebench-experiments-")
        self.addCleanup(self.kept.cleanup)

    def assertSameRows(self, rows, expected):
        """Without the difference in words, which takes minutes for long lists."""
        self.assertEqual(len(rows), len(expected))
        wrong = next((k for k, (row, other) in enumerate(zip(rows, expected)) if row != other), None)
        if wrong is not None:
            self.fail(f"row {wrong}: {rows[wrong]} instead of {expected[wrong]}")

    def start(self, *options, **more):
        return self.server("--experiments", self.kept.name, *options, **more)

    def run_it(self, client, wanted):
        answer = client.ask(run_experiment=wanted)
        self.assertEqual(answer.WhichOneof("kind"), "experiment_info", answer)
        return answer.experiment_info

    def fetch(self, client, number, owner=OWNER, start=0, recording=False):
        """All of it, to the end."""
        fetched = Fetched()
        asked = client.send(fetch_experiment=pb.FetchExperiment(id=number, owner=owner, recording=recording,
                                                                **{"from": start}))
        first = client.answer_to(asked)
        self.assertEqual(first.WhichOneof("kind"), "experiment_info", first)
        while True:
            message = client.answer_to(asked)
            if message.WhichOneof("kind") == "experiment_data":
                fetched.ticks.append(message.experiment_data.first)
                fetched.data += message.experiment_data.data
                continue
            self.assertEqual(message.WhichOneof("kind"), "experiment_info", message)
            fetched.info = message.experiment_info
            if fetched.info.state in ENDED:
                return fetched

    def whole(self, client, wanted):
        return self.fetch(client, self.run_it(client, wanted).id, wanted.owner)

    def wait_for(self, client, number, *states, owner=OWNER):
        def reached():
            listed = client.ask(list_experiments=pb.ListExperiments(owner=owner)).experiment_list.experiments
            return next(e for e in listed if e.id == number).state in states
        until(reached, f"experiment {number} reached {states}")

    # ---- what it is ----

    def test_the_data_are_those_of_a_lockstep_run_with_the_same_commands(self):
        """Commands that come a tick late, a sample that is kept before it is there, a bench of other numbers."""
        server = self.start("--command-delay-ticks", "1")
        client = self.client(server)
        signals = ("u_a_v", "u_b_v", "i_a_a", "speed_rad_s", "encoder_count", "command_tick", "state", "owner")
        fetched = self.whole(client, request(300, signals=signals))
        self.assertEqual(fetched.info.state, pb.EXPERIMENT_STATE_COMPLETED)
        rows = fetched.rows(len(signals))
        self.assertEqual(len(rows), 301)
        client.lease()
        sample = client.newest()
        lockstep = []
        for tick in range(301):
            lockstep.append(tuple(float(getattr(sample, name)) for name in signals))
            # What the experiment commanded in tick k is at the terminals in tick k + 1: the delay.
            later = rows[tick + 2] if tick + 2 < len(rows) else (0.0, 0.0)
            if tick < 300:
                sample = client.step(tick, later[0], later[1])
        self.assertEqual(rows[0], (0.0,) * 5 + (-1.0, 0.0, 0.0))
        # At tick 0 nobody had the lease yet when the sample was taken; the newest one was taken then too.
        self.assertSameRows(rows[:300], lockstep[:300])
        for tick in (1, 100, 298):  # the command of tick k is in force in tick k + 1, which sample k + 2 shows
            self.assertAlmostEqual(rows[tick + 2][0], 40.0 * math.cos(2.0 * math.pi * 60.0 * tick * 125e-6), 9)
        self.assertNotEqual(rows[-1][3], 0.0)

    def test_the_live_bench_does_not_notice(self):
        """An experiment that runs on the bench that controllers see."""
        server = self.start()
        client = self.client(server)
        before = client.status()
        self.whole(client, request(2000))
        after = client.status()
        self.assertEqual((after.tick, after.state_hash), (before.tick, before.state_hash))

    def test_the_recording_replays_and_carries_its_request(self):
        """A recording that lacks an input, or that gives the secret of its owner away."""
        server = self.start()
        client = self.client(server)
        wanted = request(500, label="for a replay", decimation=7,
                         events=[pb.ExperimentEvent(at_s=0.01, load_nm=0.05),
                                 pb.ExperimentEvent(at_s=0.02, fault=pb.NamedValue(name="current_sensor_gain", value=0.1))],
                         settings=[pb.NamedValue(name="machine.rotor_resistance_ohm", value=5.85)],
                         initial=pb.InitialState(speed_rad_s=20.0))
        fetched = self.whole(client, wanted)
        self.assertEqual(len(fetched.rows(3)), 500 // 7 + 1)
        recording = self.fetch(client, fetched.info.id, recording=True)
        self.assertEqual(len(recording.data), fetched.info.recording_bytes)
        path = pathlib.Path(self.kept.name) / "copy.mcap"
        path.write_bytes(recording.data)
        replay = subprocess.run([str(SERVER), "--replay", str(path), "--json"], capture_output=True, text=True,
                                timeout=PATIENCE_S)
        report = json.loads(replay.stdout)
        self.assertEqual((replay.returncode, report["equal"]), (0, True), report)
        self.assertEqual(report["state_hash"], f"{fetched.info.verdict.state_hash:016x}")
        self.assertIn(b"for a replay", recording.data)
        self.assertNotIn(OWNER.encode(), recording.data)

    def test_real_time_gives_the_same_bits_and_a_verdict(self):
        """A pacer that changes what happens, or a real-time run that was none."""
        server = self.start()
        client = self.client(server)
        free = self.whole(client, request(800))
        begin = time.monotonic()
        paced = self.whole(client, request(800, mode=pb.MODE_REALTIME))
        self.assertGreater(time.monotonic() - begin, 0.09)  # 800 ticks of 125 us
        self.assertEqual(paced.info.verdict.mode, pb.MODE_REALTIME)
        if paced.info.verdict.late_ticks == 0:  # a late tick stands in the state
            self.assertEqual(paced.data, free.data)

    def test_tables_are_what_was_uploaded(self):
        """Rows that come in several messages and are mixed up, or a table that the next session can see."""
        server = self.start()
        client = self.client(server)
        period = client.welcome.bench.period_s
        values = [float(k % 17) for k in range(3000)]
        table = 0
        for start in range(0, 3000, 1000):
            answer = client.ask(upload_table=pb.UploadTable(
                table=table, first=start, times_s=[k * period for k in range(start, start + 1000)],
                values=values[start:start + 1000]))
            table = answer.table_info.table
        self.assertEqual(answer.table_info.rows, 3000)
        shape = pb.Shape(channel=pb.CHANNEL_A, table=pb.Shape.Table(id=table))
        wanted = request(2999, signals=["u_a_v"], input=pb.ExperimentInput(kind=pb.INPUT_KIND_PHASE_VOLTAGES, shapes=[shape]))
        rows = [row[0] for row in self.whole(client, wanted).rows(1)]
        self.assertSameRows(rows[1:], values[:2999])
        other = self.client(server)
        self.assertRefused(other.ask(run_experiment=wanted), pb.REFUSAL_UNKNOWN_TABLE, "input.shapes[0].table.id")
        for wrong, field in ((dict(table=table, first=5), "first"), (dict(table=99), "table"),
                             (dict(times_s=[0.0, 0.0], values=[1.0, 1.0]), "times_s[1]"),
                             (dict(times_s=[0.0], values=[float("nan")]), "values[0]"),
                             (dict(times_s=[0.0]), "values")):
            answer = client.ask(upload_table=pb.UploadTable(**wrong))
            self.assertEqual((answer.WhichOneof("kind"), answer.refusal.field), ("refusal", field))

    # ---- what is refused ----

    def test_bad_requests_name_field_and_rule_and_start_nothing(self):
        """A request that is carried out in part."""
        server = self.start()
        client = self.client(server)
        for wrong, code, field in (
                (dict(ticks=0), pb.REFUSAL_OUT_OF_RANGE, "duration_s"),
                (dict(signals=["i_q_a"]), pb.REFUSAL_UNKNOWN_SIGNAL, "signals[0]"),
                (dict(axis=3), pb.REFUSAL_UNKNOWN_AXIS, "axis"),
                (dict(amplitude=float("inf")), pb.REFUSAL_NOT_FINITE, "input.shapes[0].three_phase.amplitude"),
                (dict(mode=pb.MODE_LOCKSTEP), pb.REFUSAL_WRONG_MODE, "mode"),
                (dict(owner="short"), pb.REFUSAL_OUT_OF_RANGE, "owner"),
                (dict(events=[pb.ExperimentEvent(fault=pb.NamedValue(name="gremlins", value=1))]),
                 pb.REFUSAL_UNKNOWN_FAULT, "events[0].fault.name")):
            self.assertRefused(client.ask(run_experiment=request(**wrong)), code, field)
        self.assertEqual(len(client.ask(list_experiments=pb.ListExperiments(owner=OWNER)).experiment_list.experiments), 0)
        self.assertEqual([f for f in os.listdir(self.kept.name) if f != "lock"], [])

    def test_without_a_folder_there_are_no_experiments(self):
        """A server that keeps data somewhere although nobody said where."""
        client = self.client(self.server())
        self.assertRefused(client.ask(run_experiment=request()), pb.REFUSAL_NOT_AVAILABLE, "experiments")

    def test_the_data_of_others_are_refused_unless_shared(self):
        """Data, labels or a right to cancel for somebody who does not know the secret."""
        server = self.start()
        client = self.client(server)
        private = self.whole(client, request(label="private")).info.id
        shared = self.whole(client, request(label="for all", shared=True)).info.id
        stranger = self.client(server)
        for wrong in ("", "the secret of a tesT", OWNER + "x"):
            for kind in (dict(fetch_experiment=pb.FetchExperiment(id=private, owner=wrong)),
                         dict(cancel_experiment=pb.CancelExperiment(id=private, owner=wrong)),
                         dict(cancel_experiment=pb.CancelExperiment(id=shared, owner=wrong))):
                self.assertRefused(stranger.ask(**kind), pb.REFUSAL_NOT_OWNER, "owner")
        self.assertRefused(stranger.ask(fetch_experiment=pb.FetchExperiment(id=99)), pb.REFUSAL_UNKNOWN_EXPERIMENT, "id")
        listed = {e.id: e for e in stranger.ask(list_experiments=pb.ListExperiments()).experiment_list.experiments}
        self.assertEqual((listed[private].label, listed[private].rows, list(listed[private].signals)), ("", 0, []))
        self.assertEqual((listed[private].user, listed[shared].label), ("wire test", "for all"))
        self.assertEqual(len(self.fetch(stranger, shared, owner="").data), 401 * 3 * 8)

    # ---- the queue ----

    def test_three_clients_queue_fairly_and_get_their_own(self):
        """A queue in which the first client with many experiments goes before all others, or data that are mixed."""
        server = self.start()
        blocker = self.client(server)
        first = self.run_it(blocker, endless())
        self.wait_for(blocker, first.id, pb.EXPERIMENT_STATE_RUNNING)
        owners = [f"secret number {n}" for n in range(3)]
        clients = [self.client(server) for _ in owners]
        expected = {}  # id: amplitude
        for n, owner in enumerate(owners):  # one client after the other, three experiments each
            for k in range(3):
                amplitude = 10.0 * n + k + 1.0
                info = self.run_it(clients[n], request(300, amplitude, ["u_a_v"], owner))
                expected[info.id] = (owner, amplitude)
        waiting = blocker.ask(list_experiments=pb.ListExperiments()).experiment_list.experiments
        order = [e.id for e in sorted((e for e in waiting if e.position), key=lambda e: e.position)]
        self.assertEqual([expected[number][0] for number in order], owners * 3)
        answer = blocker.ask(cancel_experiment=pb.CancelExperiment(id=first.id, owner=OWNER))
        self.assertEqual(answer.WhichOneof("kind"), "experiment_info")
        for number, (owner, amplitude) in expected.items():
            rows = self.fetch(clients[owners.index(owner)], number, owner).rows(1)
            self.assertEqual(len(rows), 301)
            self.assertEqual(rows[1][0], amplitude)  # the cosine at its start
        # The recordings were closed in the order of the queue.
        closed = sorted(order, key=lambda number: os.stat(f"{self.kept.name}/{number}.mcap").st_mtime_ns)
        self.assertEqual(closed, order)

    def test_a_full_queue_and_cancelling_in_it(self):
        """A queue without an end, or a place in it that is not given back."""
        text = SERVO_TEXT + '\n[experiments]\nfolder = "kept"\nqueue_length = 2\n'
        server = self.server(text=text)
        client = self.client(server)
        running = self.run_it(client, endless())
        self.wait_for(client, running.id, pb.EXPERIMENT_STATE_RUNNING)
        second = self.run_it(client, request())
        third = self.run_it(client, request())
        self.assertEqual((second.position, third.position), (1, 2))
        self.assertRefused(client.ask(run_experiment=request()), pb.REFUSAL_BUSY, "queue")
        gone = client.ask(cancel_experiment=pb.CancelExperiment(id=second.id, owner=OWNER)).experiment_info
        self.assertEqual(gone.state, pb.EXPERIMENT_STATE_CANCELLED)
        self.assertEqual(self.run_it(client, request()).position, 2)
        client.ask(cancel_experiment=pb.CancelExperiment(id=running.id, owner=OWNER))
        stopped = self.fetch(client, running.id)
        self.assertEqual(stopped.info.state, pb.EXPERIMENT_STATE_CANCELLED)
        self.assertEqual(len(stopped.rows(3)), stopped.info.tick + 1)
        self.assertGreater(stopped.info.recording_bytes, 0)
        self.wait_for(client, third.id, pb.EXPERIMENT_STATE_COMPLETED)

    def test_the_same_request_again_is_the_same_experiment(self):
        """A request that was sent again because its answer was lost, and runs twice."""
        server = self.start()
        one = self.run_it(self.client(server), request(request_key="k1"))
        two = self.run_it(self.client(server), request(request_key="k1"))
        self.assertEqual(one.id, two.id)
        self.assertNotEqual(self.run_it(self.client(server), request(request_key="k1", owner="somebody else")).id, one.id)
        self.assertRefused(self.client(server).ask(run_experiment=request(401, request_key="k1")),
                           pb.REFUSAL_OUT_OF_RANGE, "request_key")

    # ---- what stays ----

    def test_experiments_outlive_the_server_and_the_oldest_go(self):
        """Data that are lost with the server, numbers that are given twice, a folder that grows for ever."""
        text = SERVO_TEXT + '\n[experiments]\nfolder = "%s"\nkept = 3\n' % self.kept.name
        server = self.server(text=text)
        client = self.client(server)
        ids = [self.whole(client, request(100, amplitude=1.0 + k)).info.id for k in range(4)]
        self.assertEqual(ids, [1, 2, 3, 4])
        last = self.fetch(client, 4)
        self.run_it(client, endless())
        self.wait_for(client, 5, pb.EXPERIMENT_STATE_RUNNING)
        with self.assertRaisesRegex(RuntimeError, "another server does"):
            self.server(text=text)
        self.assertEqual(server.stop(), 0)
        client = self.client(self.server(text=text))
        listed = client.ask(list_experiments=pb.ListExperiments(owner=OWNER)).experiment_list.experiments
        self.assertEqual([e.id for e in listed], [3, 4, 5])
        self.assertEqual(listed[-1].state, pb.EXPERIMENT_STATE_CANCELLED)
        self.assertEqual(self.fetch(client, 4).data, last.data)
        self.assertEqual({int(f.split(".")[0]) for f in os.listdir(self.kept.name) if f[0].isdigit()}, {3, 4, 5})
        self.assertEqual(self.run_it(client, request()).id, 6)

    def test_the_first_to_end_goes_first(self):
        """The lowest number instead of the first end: of two owners who take turns, the data of who waited longest go
        the moment they are there, or with the next start of the server."""
        text = SERVO_TEXT + '\n[experiments]\nfolder = "%s"\nkept = 2\n' % self.kept.name

        def there(client):
            listed = client.ask(list_experiments=pb.ListExperiments(owner=OWNER)).experiment_list.experiments
            there = [e.id for e in listed]
            until(lambda: sorted(int(f[:-5]) for f in os.listdir(self.kept.name) if f.endswith(".mcap")) == there,
                  f"the folder has {there}")
            return there
        server = self.server(text=text)
        client = self.client(server)
        first = self.run_it(client, endless()).id
        self.wait_for(client, first, pb.EXPERIMENT_STATE_RUNNING)
        waits = self.run_it(client, request(400, mode=pb.MODE_REALTIME)).id
        turns = [self.run_it(client, request(100, owner=f"somebody else {k}")).id for k in range(2)]
        client.ask(cancel_experiment=pb.CancelExperiment(id=first, owner=OWNER))
        fetched = self.fetch(client, waits)
        self.assertEqual((fetched.info.state, len(fetched.rows(3))), (pb.EXPERIMENT_STATE_COMPLETED, 401))
        self.assertEqual(self.whole(client, request(100)).info.id, 5)
        self.assertEqual(there(client), [waits, 5])
        self.assertEqual(server.stop(), 0)
        # 5 and then 2 were written last.
        os.utime(f"{self.kept.name}/2.experiment")
        server = self.server(text=text)
        client = self.client(server)
        self.assertEqual(self.whole(client, request(100)).info.id, 6)
        self.assertEqual(there(client), [waits, 6])
        self.assertLess(waits, min(turns))

    def test_who_cancels_is_told_although_it_goes(self):
        """An experiment that is forgotten by the request that cancels it, which then is refused."""
        text = SERVO_TEXT + '\n[experiments]\nfolder = "%s"\nkept = 1\n' % self.kept.name
        client = self.client(self.server(text=text))
        running = self.run_it(client, endless())
        self.wait_for(client, running.id, pb.EXPERIMENT_STATE_RUNNING)
        queued = [self.run_it(client, request()).id for _ in range(3)]
        for number in reversed(queued):
            answer = client.ask(cancel_experiment=pb.CancelExperiment(id=number, owner=OWNER))
            self.assertEqual(answer.experiment_info.state, pb.EXPERIMENT_STATE_CANCELLED, answer)
            self.wait_for(client, number, pb.EXPERIMENT_STATE_CANCELLED)

    def test_a_file_that_is_no_experiment_is_told_of_and_left_alone(self):
        """A file that a power cut left empty: the server divides by its decimation of 0, which ends it, or gives its
        data to whoever names no owner."""
        folder = pathlib.Path(self.kept.name)
        server = self.start()
        self.whole(self.client(server), request(100))
        self.assertEqual(server.stop(), 0)
        whole = (folder / "1.experiment").read_bytes()

        def broken(number, change):
            stored = pb.StoredExperiment.FromString(whole)
            stored.info.id = number
            change(stored)
            return stored.SerializeToString()
        files = {7: (b"", "its id"), 8: (b"\xff" * 20, "a StoredExperiment"), 9: (whole, "its id"),
                 10: (broken(10, lambda s: s.request.ClearField("owner")), "an owner"),
                 11: (broken(11, lambda s: s.info.ClearField("decimation")), "its decimation"),
                 12: (broken(12, lambda s: s.info.ClearField("signals")), "a signal"),
                 13: (broken(13, lambda s: s.info.signals.extend(["i_a_a"] * 9999)), "a signal")}
        for number, (data, _) in files.items():
            (folder / f"{number}.experiment").write_bytes(data)
        (folder / "14.experiment.new").write_bytes(whole)  # the power failed before it had its name
        server = self.start()
        client = self.client(server)
        listed = client.ask(list_experiments=pb.ListExperiments(owner=OWNER)).experiment_list.experiments
        for number, (data, rule) in files.items():
            for owner in ("", OWNER):
                for recording in (False, True):
                    asked = pb.FetchExperiment(id=number, owner=owner, recording=recording)
                    self.assertRefused(client.ask(fetch_experiment=asked), pb.REFUSAL_UNKNOWN_EXPERIMENT, "id")
            self.assertRegex(server.errors(), f"/{number}.experiment is not an experiment: .*{rule}")
            self.assertEqual((folder / f"{number}.experiment").read_bytes(), data)
        self.assertEqual([e.id for e in listed], [1])
        self.assertFalse((folder / "14.experiment.new").exists())
        self.assertEqual(self.whole(client, request(100)).info.id, 15)

    def test_the_secret_is_for_nobody_else_to_read(self):
        """A file that is made for all to read, or in one that somebody has open, before its rights are set."""
        folder = pathlib.Path(self.kept.name)
        server = self.start(before=lambda: os.umask(0))
        draft = folder / "1.experiment.new"
        draft.touch()
        draft.chmod(0o666)
        with open(draft, "rb") as eavesdropper:
            self.whole(self.client(server), request(100))
            self.assertEqual(eavesdropper.read(), b"")
        self.assertIn(OWNER.encode(), (folder / "1.experiment").read_bytes())
        for name in ("1.experiment", "1.rows"):
            self.assertEqual((folder / name).stat().st_mode & 0o777, 0o600, name)

    def test_connections_that_break_lose_and_double_nothing(self):
        """A fetch that begins anew elsewhere than it ended, 100 times at random."""
        server = self.start()
        rng = random.Random(8)
        client = self.client(server)
        reference = {}
        halfway = 0
        for n in range(100):
            ticks = rng.randrange(2000, 30_000)
            decimation = rng.choice((1, 1, 3, 10))
            wanted = request(ticks, amplitude=20.0 + n % 4, decimation=decimation, request_key=f"kill {n}")
            info = None
            data = b""
            broken = 0
            while info is None or info.state not in ENDED:
                link = Client(server.raw(receive_buffer=4096))
                kill_at = rng.randrange(1, 400_000) if broken < 5 else None  # bytes; then it may end
                try:
                    self.receive_until(link, kill_at)
                    number = self.run_it(link, wanted).id
                    start = len(data) // (8 * len(SIGNALS)) * decimation
                    asked = link.send(fetch_experiment=pb.FetchExperiment(id=number, owner=OWNER, **{"from": start}))
                    while info is None or info.state not in ENDED:
                        message = link.answer_to(asked)
                        if message.WhichOneof("kind") == "experiment_data":
                            self.assertEqual(message.experiment_data.first, len(data) // (8 * len(SIGNALS)) * decimation)
                            data += message.experiment_data.data
                        elif len(data) == message.experiment_info.rows * 8 * len(SIGNALS):
                            info = message.experiment_info
                except Closed:
                    broken += 1
                    halfway += len(data) > 0
                finally:
                    link.close()
            self.assertEqual(len(data), (ticks // decimation + 1) * 8 * len(SIGNALS))
            # Prefixes of one run: the same amplitude gives the same samples.
            rows = struct.unpack(f"<{len(data) // 8}d", data)
            whole = reference.get(n % 4)
            if whole is None:
                whole = reference[n % 4] = self.whole(client, request(30_000, amplitude=20.0 + n % 4)).rows(len(SIGNALS))
            self.assertSameRows(rows, tuple(v for row in whole[:ticks + 1:decimation] for v in row))
        listed = client.ask(list_experiments=pb.ListExperiments(owner=OWNER)).experiment_list.experiments
        self.assertEqual(max(e.id for e in listed), 104)  # none ran twice
        self.assertGreater(halfway, 50)

    def receive_until(self, link, count):
        """From now on the link breaks after so many bytes have come."""
        left = [count]
        receive = link.receive_bytes

        def limited(size):
            if left[0] is not None:
                left[0] -= size
                if left[0] < 0:
                    raise Closed
            return receive(size)
        link.receive_bytes = limited

    def test_a_slow_reader_slows_nobody_and_memory_stays(self):
        """Data of 10 s at 20 kHz in the server's memory, or a reader that keeps the queue waiting."""
        text = SERVO_TEXT.replace("period_us = 125", "period_us = 50") + f'\n[experiments]\nfolder = "{self.kept.name}"\n'
        server = self.server(text=text)
        signals = [s.name for s in pb.Sample.DESCRIPTOR.fields if s.name.endswith(("_a", "_v", "_nm", "_s"))][:12]
        self.assertEqual(len(signals), 12)
        slow = self.client(server, receive_buffer=4096)
        before = self.kib(server, "VmHWM")
        number = self.run_it(slow, request(200_000, signals=signals)).id
        slow.send(fetch_experiment=pb.FetchExperiment(id=number, owner=OWNER))  # and does not read
        fast = self.client(server)
        fetched = self.fetch(fast, number)
        self.assertEqual(len(fetched.data), 200_001 * 12 * 8)
        self.assertEqual(len(self.whole(fast, request(100)).rows(3)), 101)
        # The ring of the recorder (2 s of samples, 16 MB) and its chunks: 28 MB. The data alone would be 19 MB more.
        if self.kib(server, "VmSize") < 1 << 30:  # a sanitizer maps terabytes, and keeps what is freed
            self.assertLess(self.kib(server, "VmHWM") - before, 36_000)

    def kib(self, server, which):
        status = pathlib.Path(f"/proc/{server.process.pid}/status").read_text(encoding="utf-8")
        return int(re.search(which + r":\s+(\d+)", status).group(1))


if __name__ == "__main__":
    unittest.main(verbosity=2)
