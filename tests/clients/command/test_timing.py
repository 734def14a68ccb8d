#!/usr/bin/python3
"""`drivebench test --timing`: how fast devices under test answered."""
import json
import pathlib
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from regression_case import COMMAND, DRIVES, INVALID, OK, PROGRAM, SERVO, USAGE, RegressionTest
    from wire_client import PATIENCE_S
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)


class Timing(RegressionTest):
    """Only limits that hold on every machine: nothing answers faster than it sleeps."""

    def timing_of(self, *arguments, code=OK):
        file = self.folder / "timing.json"
        done = self.run_test(self.folder / "suite", "--timing", file, *arguments, code=code)
        return json.loads(file.read_text(encoding="utf-8")), done.stdout

    def program(self, case, device):
        self.write("case.toml", case)
        self.write("device.py", device)

    def test_a_program_in_lockstep_has_its_computing_time(self):
        """Catches: times of the bench in the place of those of the device, a unit that is wrong by a thousand."""
        slow = DRIVES.format(until=200).replace("sample = bench.step(", "time.sleep(0.001)\n        sample = bench.step(")
        self.program(PROGRAM.format(limit_s=60), "import time\n" + slow)
        timing, out = self.timing_of()
        case = timing["cases"][0]
        self.assertEqual((case["name"], case["way"], case["period_us"], case["phase"]), ("case", "lockstep", 100.0, None))
        self.assertIsNone(case["effect"])
        answers = case["answers"]
        self.assertGreaterEqual(answers["count"], 190)
        self.assertGreaterEqual(answers["p50_us"], 990.0)
        self.assertLess(answers["p50_us"], 1e6)
        self.assertLessEqual(answers["p50_us"], answers["p99_us"])
        self.assertLessEqual(answers["p99_us"], answers["worst_us"])
        self.assertEqual(sum(count for _, _, count in answers["histogram"]), answers["count"])
        self.assertEqual(timing["groups"][0]["answers"], answers)
        self.assertRegex(out, r"(?m)^answers lockstep: \d+, p50 [\d.e+]+ us")

    def test_in_real_time_missed_and_late_answers_count(self):
        """Catches: a device that answers every third sample and is taken for one that keeps up, a phase of another tick."""
        lazy = """import os
import time
import drivebench
with drivebench.Bench(os.environ["DRIVEBENCH_LINK"]) as bench:
    bench.acquire()
    for _ in range(20):
        bench.newest()
        bench.step(voltages=5.0)
        time.sleep(0.025)
"""
        case = PROGRAM.format(limit_s=60).replace("duration_s = 0.02", 'mode = "realtime"') + (
            "[override.bench]\nperiod_us = 10000.0\ncommand_delay_ticks = 1\nwatchdog_ticks = 1000\narming_commands = 1\nsubsteps = 64\n"
            "[override.realtime]\nmax_lateness_ms = 60000\n")
        self.program(case, lazy)
        file = self.folder / "timing.json"
        done = subprocess.run([COMMAND, "test", self.folder / "suite", "--timing", file], capture_output=True, text=True,
                              env=self.environment, timeout=4 * PATIENCE_S, check=False)
        self.assertIn(done.returncode, (OK, INVALID), done.stdout + done.stderr)
        case = json.loads(file.read_text(encoding="utf-8"))["cases"][0]
        self.assertEqual(case["way"], "real time")
        self.assertGreaterEqual(case["phase"]["count"], 15)
        self.assertGreaterEqual(case["missed"], 1.5 * case["phase"]["count"])
        self.assertGreaterEqual(case["longest_burst"], 2)
        self.assertGreaterEqual(case["phase"]["p50_us"], case["answers"]["p50_us"])
        # The same device in lockstep, from the tick on in which it took its lease.
        effect = case["effect"]
        self.assertIsNone(effect["problem"])
        self.assertGreater(effect["from_s"], 0.0)
        self.assertEqual([(each["axis"], each["signal"], each["unit"]) for each in effect["signals"]], [("dc-a", "i_a_a", "A")])
        self.assertLess(effect["signals"][0]["rms_difference"], 5.0)

    def test_reports_are_the_same_bytes_with_timing(self):
        """Catches: a time of the wall clock in a report that is compared."""
        self.write("servo.toml", SERVO + "[matrix]\nseed = {from = 1, to = 3}\n")
        reports = []
        for timing in ((), ("--timing", self.folder / "timing.html"), ("--timing", self.folder / "timing.json")):
            names = [self.folder / f"report.{kind}" for kind in ("json", "xml", "html")]
            self.run_test(self.folder / "suite", "--json", names[0], "--junit", names[1], "--html", names[2], *timing)
            reports.append([name.read_bytes() for name in names])
        self.assertEqual(reports[0], reports[1])
        self.assertEqual(reports[0], reports[2])
        page = (self.folder / "timing.html").read_text(encoding="utf-8")
        self.assertEqual(page.count("<svg"), 4)
        self.assertIn("from sample to command", page)
        timing = json.loads((self.folder / "timing.json").read_text(encoding="utf-8"))
        self.assertEqual([(group["way"], group["cases"]) for group in timing["groups"]], [("in process", 3)])
        self.assertGreaterEqual(timing["groups"][0]["answers"]["count"], 3 * 1000)

    def test_a_timing_that_cannot_be_is_refused(self):
        """Catches: a file without a format, and times of results that nobody has measured."""
        self.write("servo.toml", SERVO)
        for file in ("timing", "timing.svg"):
            done = self.run_test(self.folder / "suite", "--timing", self.folder / file, code=USAGE)
            self.assertIn("the name must end with .json", done.stderr)
            self.assertFalse((self.folder / file).exists())
        self.run_test(self.folder / "suite", "--timing", "t.json", "--merge", self.folder, code=USAGE)


if __name__ == "__main__":
    unittest.main(verbosity=2)
