#!/usr/bin/python3
"""`drivebench track` against the real server."""
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import BENCHES, PATIENCE_S, REPOSITORY, SERVER, guarded
from wire_test import WireTest

PROGRAM = str(SERVER.parent / "drivebench")


class Track(WireTest):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="drivebench-track-test-")
        self.addCleanup(folder.cleanup)
        self.path = pathlib.Path(folder.name)
        self.environment = guarded({name: value for name, value in os.environ.items() if not name.startswith("DRIVEBENCH_")})
        self.environment.update(XDG_CONFIG_HOME=str(self.path))

    def bench_text(self, name="im-warming"):
        return (BENCHES / f"{name}.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")

    def drivebench(self, *words, code=0):
        ran = subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, timeout=PATIENCE_S * 2,
                             env=self.environment, cwd=REPOSITORY, check=False)
        if code is not None:
            self.assertEqual(ran.returncode, code, ran.stdout + ran.stderr)
        return ran

    def rows(self, *words, code=0):
        return [json.loads(line) for line in self.drivebench("track", "--json", *words, code=code).stdout.splitlines()]

    def recording(self, text, duration_s):
        """The run of a bench as fast as possible."""
        bench = self.path / "bench.toml"
        bench.write_text(text.replace('mode = "realtime"', 'mode = "free"'), encoding="utf-8")
        run = self.path / "run.mcap"
        subprocess.run([str(SERVER), str(bench), "--duration", str(duration_s), "--record", str(run), "--port", "0"], check=True,
                       capture_output=True, timeout=PATIENCE_S * 2, env=self.environment)
        return run

    def test_a_warming_rotor_is_followed_from_a_recording_and_from_its_csv(self):
        """Catches: a window at another time, a stator resistance that follows the rotor's, a picture or CSV that cannot be
        read. 1 %: the intervals are 0.5 % of T_R, and the rotor warms by 0.8 % in a window."""
        run = self.recording(self.bench_text(), 9)
        picture = self.path / "track.svg"
        rows = self.rows("--from", run, "--plot", picture)
        self.assertGreater(len(rows), 80)
        for row in rows:
            if row["time_s"] < 1.0:
                continue
            warm = min(max((row["time_s"] - 2.0) / 6.0, 0.0), 1.0)
            self.assertAlmostEqual(row["T_R"]["estimate"] * (8.6 + 4.3 * warm) / 0.67, 1.0, delta=0.01, msg=row)
            self.assertAlmostEqual(row["R_S"]["estimate"] / 9.7, 1.0, delta=0.05, msg=row)
            self.assertLess(row["T_R"]["interval"] / row["T_R"]["estimate"], 0.02)
        self.assertIsNone(rows[0]["R_S"]["estimate"])
        self.assertIn("speed changes", rows[0]["verdict"])
        svg = picture.read_text(encoding="utf-8")
        self.assertIn("T_R [s]", svg)
        self.assertNotIn("nan", svg)

        table = self.path / "run.csv"
        self.drivebench("export", run, "--out", table)
        words = ("--from", table, "--pole-pairs", 2, "--counts", 4096)
        known = ("--motor-file", "im-8-5-5")
        again = self.rows(*words, *known, "--duration", 3)
        self.assertAlmostEqual(again[20]["T_R"]["estimate"], rows[20]["T_R"]["estimate"], places=9)
        # sigma by hand is the motor's.
        again = self.rows(*words, "--stator-inductance", 0.67, "--leakage", 1 - 0.64 ** 2 / 0.67 ** 2, "--duration", 3)
        self.assertAlmostEqual(again[20]["T_R"]["estimate"], rows[20]["T_R"]["estimate"], places=9)
        for wrong, text in ((words, "--motor-file, or --stator-inductance and --leakage"),
                            (("--from", table, "--counts", 4096, *known), "--pole-pairs is missing"),
                            (("--from", table, *words[2:], *known, "--window", 0.005), "window of 50 samples"),
                            ((*words, "--motor-file", "dc-a"), "pm_dc")):
            with self.subTest(wrong):
                self.assertIn(text, self.drivebench("track", *wrong, code=2).stderr)

    def test_without_load_the_rotor_is_not_told(self):
        """Catches: a time constant of a rotor without current, and an exit code of 0 for nothing."""
        run = self.recording(self.bench_text().replace("load_nm = 3.7", "load_nm = 0.0"), 2)
        rows = self.rows("--from", run)  # the end of the run-up shows a rotor
        self.assertTrue(all(row["T_R"]["estimate"] is None for row in rows[3:]))
        self.assertIn("load the motor", rows[-1]["verdict"])
        self.assertEqual(len(self.rows("--from", run, "--duration", 0.25, code=1)), 1)

    def test_a_running_bench_is_followed_with_its_truth(self):
        """Catches: a truth of the beginning beside an estimate of now, a parameter written while the motor runs that tracking
        does not see, a command that does not end."""
        server = self.server(text=self.bench_text().partition("[[axis.set]]")[0])
        link = ("--link", f"tcp:{server.ready['tcp']}")
        self.drivebench("set", "0", "machine.rotor_resistance_ohm", "12.9", "--ramp-s", 12, *link)
        rows = self.rows(*link, "--duration", 3)
        estimates = [row for row in rows if "missing" not in row and row["T_R"]["estimate"]]
        self.assertGreater(len(estimates), 3, rows)
        self.assertLess(estimates[-1]["T_R"]["truth"], 0.95 * estimates[0]["T_R"]["truth"])
        for row in estimates:
            self.assertAlmostEqual(row["T_R"]["estimate"] / row["T_R"]["truth"], 1.0, delta=0.02, msg=row)
            self.assertAlmostEqual(row["R_S"]["truth"], 9.7)

        running = subprocess.Popen([PROGRAM, "track", *link], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                   env=self.environment)
        self.addCleanup(running.kill)
        lines = [running.stdout.readline() for _ in range(2)]
        self.assertIn("T_R", lines[0])
        running.send_signal(signal.SIGINT)
        running.communicate(timeout=PATIENCE_S)
        self.assertEqual(running.returncode, 0)
        self.assertIn("of kind pm_dc", self.drivebench(
            "track", "--link", f"tcp:{self.server(text=self.bench_text('dc-a-voltage')).ready['tcp']}", code=2).stderr)

    def test_missing_samples_are_told_and_the_window_begins_anew(self):
        """Catches: an estimate over a hole in the samples, told by nobody. The bench runs as fast as it can, so that the
        client loses samples."""
        server = self.server(text=self.bench_text().replace('mode = "realtime"', 'mode = "free"'))
        ran = self.drivebench("track", "--json", "--link", f"tcp:{server.ready['tcp']}", "--duration", 400, code=None)
        rows = [json.loads(line) for line in ran.stdout.splitlines()]
        gaps = [row for row in rows if "missing" in row]
        self.assertTrue(gaps)
        self.assertTrue(all(row["missing"] > 0 for row in gaps))
        begin = None
        for row in rows:
            if "missing" in row:
                begin = row["time_s"]
            elif begin is not None:
                self.assertGreaterEqual(row["time_s"] - 0.1, begin)


if __name__ == "__main__":
    unittest.main(verbosity=2)
