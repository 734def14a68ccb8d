#!/usr/bin/python3
"""Experiments on the real server, over the wire: their data."""
import json
import math
import os
import pathlib
import random
import struct
import subprocess
import sys
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from experiment_test import ENDED, OWNER, SIGNALS, ExperimentTest, request
from wire_client import PATIENCE_S, SERVER, Client, Closed, pb
from wire_test import SANITIZED, SERVO_TEXT, repetitions


class Experiments(ExperimentTest):
    def assertSameRows(self, rows, expected):
        """Without the difference in words, which takes minutes for long lists."""
        self.assertEqual(len(rows), len(expected))
        wrong = next((k for k, (row, other) in enumerate(zip(rows, expected)) if row != other), None)
        if wrong is not None:
            self.fail(f"row {wrong}: {rows[wrong]} instead of {expected[wrong]}")

    def test_the_data_are_those_of_a_lockstep_run_with_the_same_commands(self):
        """Catches: commands that act a tick late, a sample that is kept too early, a bench with other numbers."""
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
            # The command of the experiment in tick k is at the terminals in tick k + 1: the delay.
            later = rows[tick + 2] if tick + 2 < len(rows) else (0.0, 0.0)
            if tick < 300:
                sample = client.step(tick, later[0], later[1])
        self.assertEqual(rows[0], (0.0,) * 5 + (-1.0, 0.0, 0.0))
        # At tick 0 the sample was taken before the lease; the newest sample was taken then too.
        self.assertSameRows(rows[:300], lockstep[:300])
        for tick in (1, 100, 298):  # the command of tick k is in force in tick k + 1, which sample k + 2 shows
            self.assertAlmostEqual(rows[tick + 2][0], 40.0 * math.cos(2.0 * math.pi * 60.0 * tick * 125e-6), 9)
        self.assertNotEqual(rows[-1][3], 0.0)

    def test_the_live_bench_is_unchanged(self):
        """Catches: an experiment that runs on the bench that controllers see."""
        server = self.start()
        client = self.client(server)
        before = client.status()
        self.whole(client, request(2000))
        after = client.status()
        self.assertEqual((after.tick, after.state_hash), (before.tick, before.state_hash))

    def test_the_recording_replays_and_carries_its_request(self):
        """Catches: a recording that lacks an input, or that contains the secret of its owner."""
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
        """Catches: a pacer that changes results, or a real-time run that was none."""
        server = self.start()
        client = self.client(server)
        free = self.whole(client, request(800))
        begin = time.monotonic()
        paced = self.whole(client, request(800, mode=pb.MODE_REALTIME))
        self.assertGreater(time.monotonic() - begin, 0.09)  # 800 ticks of 125 us
        self.assertEqual(paced.info.verdict.mode, pb.MODE_REALTIME)
        if paced.info.verdict.late_ticks == 0:  # a late tick changes the state
            self.assertEqual(paced.data, free.data)

    def test_tables_equal_the_uploaded_rows(self):
        """Catches: rows of several messages that are mixed up, or a table that the next session can see."""
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

    def test_bad_requests_name_field_and_rule_and_start_nothing(self):
        """Catches: a request that is executed in part."""
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
        """Catches: a server that keeps data in a folder that its file does not name."""
        client = self.client(self.server())
        self.assertRefused(client.ask(run_experiment=request()), pb.REFUSAL_NOT_AVAILABLE, "experiments")

    def test_connections_that_break_lose_and_double_nothing(self):
        """Catches: a fetch that resumes at another place than its end, 100 times at random."""
        server = self.start()
        rng = random.Random(8)
        client = self.client(server)
        reference = {}
        halfway = 0
        for n in range(repetitions(100)):
            ticks = rng.randrange(2000, 30_000)
            decimation = rng.choice((1, 1, 3, 10))
            wanted = request(ticks, amplitude=20.0 + n % 4, decimation=decimation, request_key=f"kill {n}")
            info = None
            data = b""
            broken = 0
            while info is None or info.state not in ENDED:
                link = Client(server.raw(receive_buffer=4096))
                kill_at = rng.randrange(1, 400_000) if broken < 5 else None  # bytes; later connections may end
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
        self.assertEqual(max(e.id for e in listed), repetitions(100) + 4)  # none ran twice
        self.assertGreater(halfway, 0 if SANITIZED else 50)

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

    def test_a_slow_reader_delays_no_other_client_and_memory_stays(self):
        """Catches: data of 200,000 ticks in the server's memory, or a reader that delays the queue."""
        text = SERVO_TEXT.replace("period_us = 125", "period_us = 500")
        server = self.start(text=text)
        signals = [s.name for s in pb.Sample.DESCRIPTOR.fields if s.name.endswith(("_a", "_v", "_nm", "_s"))][:12]
        self.assertEqual(len(signals), 12)
        slow = self.client(server, receive_buffer=4096)
        before = server.memory_kib()
        ticks = repetitions(200_000)
        number = self.run_it(slow, request(ticks, signals=signals)).id
        slow.send(fetch_experiment=pb.FetchExperiment(id=number, owner=OWNER))  # and does not read
        fast = self.client(server)
        fetched = self.fetch(fast, number)
        self.assertEqual(len(fetched.data), (ticks + 1) * 12 * 8)
        self.assertEqual(len(self.whole(fast, request(100)).rows(3)), 101)
        # The queue of the recorder (2 s of samples and commands: 9,024 entries of 648 bytes) touches 5,800 KiB at most, its
        # chunks take 2,100 KiB. The data have 18,750 KiB.
        self.assertMemoryBelow(server, before + 12_000)


if __name__ == "__main__":
    unittest.main(verbosity=2)
