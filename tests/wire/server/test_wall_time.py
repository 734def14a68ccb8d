#!/usr/bin/python3
"""The wall time of recordings in real time, and its absence from all others."""
import csv
import datetime
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from itertools import pairwise
from unittest import mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from recording import Recording
    from wire_client import PATIENCE_S, SERVER, guarded
    from wire_test import PATIENT_TEXT, SERVO_TEXT, WireTest, until
except ImportError as missing:
    print(f"SKIPPED: {missing}")
    sys.exit(77)

DRIVEBENCH = SERVER.with_name("drivebench")
FAKETIME = next(pathlib.Path("/usr/lib").glob("*/faketime/libfaketime.so.1"), None)
PERIOD_NS = 125_000
TIME_BASE = "drivebench.time_base"
YEAR_S = 365 * 86_400


class WallTime(WireTest):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="drivebench-wall-time-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.file = self.folder / "run.mcap"

    def recorded(self, server, seconds):
        """Records this long and ends the server."""
        client = self.client(server)
        until(lambda: client.newest().tick > seconds * 1e9 / PERIOD_NS, "the bench runs")
        self.assertIn(server.stop(), (0, 1))

    def bases(self, file=None):
        return [entries for name, entries in Recording((file or self.file).read_bytes()).metadata if name == TIME_BASE]

    def run_on_the_file(self, verb, *arguments, code=0):
        done = subprocess.run([DRIVEBENCH, verb, self.file, *arguments], capture_output=True, text=True, timeout=PATIENCE_S,
                              check=False, cwd=self.folder)
        self.assertEqual(done.returncode, code, done.stderr)
        return done

    def exported(self, *arguments, code=0):
        return self.run_on_the_file("export", *arguments, code=code)

    def rows(self):
        self.exported("--signals", "speed_rad_s", "--out", "run.csv")
        with open(self.folder / "run.csv", encoding="utf-8") as file:
            return list(csv.DictReader(file))

    def test_the_epoch_is_the_wall_time_of_tick_0(self):
        """Catches: an epoch on CLOCK_MONOTONIC, in local time, in other units, or of the end of the run; a file of a series
        without it; a column that is not log time plus epoch."""
        before = time.time_ns()
        server = self.server("--mode", "realtime", "--record", str(self.file), "--record-file-s", "0.2", text=PATIENT_TEXT)
        ready = time.time_ns()
        self.recorded(server, 0.5)
        (base,) = self.bases()
        self.assertEqual(self.bases(self.folder / "run.2.mcap"), [base])
        epoch = int(base["epoch_unix_ns"])
        self.assertTrue(before <= epoch + PERIOD_NS <= ready + 10**9, (before, epoch, ready))
        self.assertEqual(base["since_tick"], "0")
        self.assertIn("epoch_unix_ns = UTC", base["reading"])
        rows = self.rows()
        self.assertEqual(list(rows[0]), ["tick", "time_s", "unix_ns", "speed_rad_s [rad/s]"])
        for row in rows:
            self.assertEqual(int(row["unix_ns"]), epoch + int(row["tick"]) * PERIOD_NS)
        self.assertEqual(json.loads(self.exported("--json", "--out", "a.csv").stdout)["epoch_unix_ns"], epoch)
        utc = datetime.datetime.fromtimestamp(epoch // 10**9, datetime.timezone.utc)
        self.assertIn(f"tick 0 began at {utc:%Y-%m-%dT%H:%M:%S}.{epoch % 10**9 // 1000:06}Z", self.exported("--out", "b.csv").stdout)
        self.assertEqual(json.loads(self.run_on_the_file("replay", "--json").stdout)["begun_utc"][:19], f"{utc:%Y-%m-%dT%H:%M:%S}")
        self.assertIn(f", begun {utc:%Y-%m-%dT%H:%M:%S}.", self.run_on_the_file("replay").stdout)
        row = rows[len(rows) // 2]  # not tick 0: the time of the first sample that is drawn
        due = datetime.datetime.fromtimestamp(int(row["unix_ns"]) // 10**9, datetime.timezone.utc)
        self.assertIn(f">time [ms] since {due:%Y-%m-%dT%H:%M:%S}.{int(row['unix_ns']) % 10**9 // 1000:06}Z<",
                      self.run_on_the_file("plot", "--from", row["tick"]).stdout)
        frame = self.exported("--format", "candump").stdout.splitlines()[0]
        self.assertAlmostEqual(float(frame[1:frame.index(")")]), epoch / 1e9, delta=2e-6)

    def test_a_wall_clock_that_is_set_later_moves_nothing(self):
        """Catches: an epoch read at the end or again, so that samples get times that their ticks did not have."""
        if FAKETIME is None:
            self.skipTest("faketime is not installed")
        offset = self.folder / "offset"
        offset.write_text("+10y", encoding="utf-8")
        fake = {"LD_PRELOAD": str(FAKETIME), "FAKETIME_DONT_FAKE_MONOTONIC": "1", "FAKETIME_NO_CACHE": "1",
                "FAKETIME_TIMESTAMP_FILE": str(offset)}
        with mock.patch.dict(os.environ, fake):
            server = self.server("--mode", "realtime", "--record", str(self.file), "--record-file-s", "0.2", text=PATIENT_TEXT)
        client = self.client(server)
        until(lambda: client.newest().tick > 800, "the bench runs")
        (self.folder / "next").write_text("-1d", encoding="utf-8")
        (self.folder / "next").replace(offset)
        self.recorded(server, 0.5)
        (base,) = self.bases()
        self.assertEqual(self.bases(self.folder / "run.2.mcap"), [base])
        ahead_s = int(base["epoch_unix_ns"]) / 1e9 - time.time()
        self.assertAlmostEqual(ahead_s, 10 * YEAR_S, delta=5 * 86_400)
        steps = {int(after["unix_ns"]) - int(row["unix_ns"]) for row, after in pairwise(self.rows())}
        self.assertEqual(steps, {PERIOD_NS})

    def test_after_a_standstill_the_time_begins_anew(self):
        """Catches: samples behind a standstill that wear times from before it."""
        server = self.server("--mode", "realtime", "--record", str(self.file), text=SERVO_TEXT, strict=True)
        client = self.client(server)
        until(lambda: client.newest().tick > 800, "the bench runs")
        server.process.send_signal(signal.SIGSTOP)
        time.sleep(0.5)  # beyond max_lateness
        server.process.send_signal(signal.SIGCONT)
        self.recorded(server, 0.3)
        first, *later = self.bases()
        self.assertGreaterEqual(len(later), 1)
        epochs = [int(base["epoch_unix_ns"]) for base in (first, *later)]
        self.assertGreater(epochs[-1] - epochs[0], 390_000_000)
        since = [int(base["since_tick"]) for base in (first, *later)]
        self.assertEqual(since, sorted(since))
        for row in self.rows():
            tick = int(row["tick"])
            epoch = [each for each, tick0 in zip(epochs, since) if tick > tick0 or tick0 == 0][-1]
            self.assertEqual(int(row["unix_ns"]), epoch + tick * PERIOD_NS, tick)

    def test_other_recordings_have_no_wall_time(self):
        """Catches: a time of day in a run that is to be equal, byte for byte, whenever it is made."""
        contents = set()
        for name in ("run.mcap", "again.mcap"):
            done = subprocess.run([SERVER, "configs/benches/servo.toml", "--port", "0", "--mode", "free", "--duration", "0.2",
                                   "--record", self.folder / name], capture_output=True, timeout=PATIENCE_S, check=False,
                                  env=guarded(os.environ), cwd=pathlib.Path(__file__).resolve().parents[3])
            self.assertEqual(done.returncode, 0, done.stderr)
            contents.add((self.folder / name).read_bytes())
        self.assertEqual(len(contents), 1)
        self.assertEqual(self.bases(), [])
        self.assertNotIn("unix_ns", self.rows()[0])
        self.file.unlink()
        server = self.server("--mode", "lockstep", "--record", str(self.file), text=PATIENT_TEXT)
        client = self.client(server)
        client.lease()
        for tick in range(100):
            client.step(tick, 1.0)
        self.assertEqual(server.stop(), 0)
        self.assertEqual(self.bases(), [])
        self.assertNotIn("epoch_unix_ns", json.loads(self.exported("--json", "--out", "a.csv").stdout))
        self.assertNotIn("begun", self.run_on_the_file("replay").stdout)
        self.assertIn(">time [ms]<", self.run_on_the_file("plot").stdout)

    def test_a_damaged_epoch_is_named(self):
        """Catches: rows with times out of nothing."""
        self.recorded(self.server("--mode", "realtime", "--record", str(self.file), text=PATIENT_TEXT), 0.1)
        epoch = self.bases()[0]["epoch_unix_ns"].encode()
        self.file.write_bytes(self.file.read_bytes().replace(epoch, b"x" * len(epoch)))
        refused = self.exported("--out", "a.csv", code=1)
        self.assertIn(f"{TIME_BASE} of the recording: epoch_unix_ns is 'xxx", refused.stderr)
        self.assertIn("not a whole number", refused.stderr)
        self.assertIn("epoch_unix_ns is 'xxx", self.run_on_the_file("replay", code=2).stdout)


if __name__ == "__main__":
    unittest.main(verbosity=2)
