#!/usr/bin/python3
"""`drivebench test --shrink`: a failing case becomes smaller and fails in the same check."""
import pathlib
import re
import shutil
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from regression_case import DRIVES, FAILED, OK, PROGRAM, SERVO, USAGE, RegressionTest
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

LONG = SERVO.replace("6.0", "6.2") + """[[check]]
name = "speed"
kind = "bounds"
signal = "speed_rad_s"
abs = 500
[override.axis.0.machine]
rotor_resistance_ohm = 3.917
[[step]]
at_s = 0.011
load_nm = 0.02
[[step]]
when = "i_a_a > 2"
for_s = 0.00025
load_nm = 0.0513
ramp_s = 0.003
[[step]]
at_s = 0.05317
load_nm = 0.9123
[[step]]
at_s = 0.09
load_nm = 0.0
[matrix]
step.0.load_nm = [0.013, 0.02]
"""

# A device under test that counts its runs in its folder.
COUNTS = """import os
import pathlib
import signal
import time
count = pathlib.Path("count")
run = int(count.read_text()) + 1 if count.exists() else 1
count.write_text(str(run))
"""
A_STEP = "[[step]]\nat_s = 0.0\nload_nm = 0.01\n"


class Shrink(RegressionTest):
    def shrink(self, *arguments, name="small.toml", code=OK):
        small = self.folder / "suite" / name
        done = self.run_test(*arguments, "--shrink", small, code=code)
        for left, of in re.findall(r"(\S+) of (\S+) values", done.stdout):
            self.assertLessEqual(int(left), int(of))
        return done.stdout + done.stderr, small

    def test_a_case_of_a_preset_becomes_small_and_fails_the_same(self):
        """Catches: a case that fails in another check, one that cannot be run, one that differs from run to run."""
        self.write("long.toml", LONG)
        suite = self.folder / "suite"
        said, small = self.shrink(suite, "--filter", "=0.02")
        self.assertRegex(said, r"small\.toml: 1 of 4 steps, 1 of 2 checks, 0 of 1 overrides, 0\.0\d+ s of 0\.128 s, \d+ of \d+ values; \d+ runs\n")
        text = small.read_text(encoding="utf-8")
        self.assertIn("load_nm = 0.9\n", text)
        self.assertNotIn("speed", text)
        self.assertRegex(self.run_test(small, code=FAILED).stdout, r"(?s)^fail +small .*current: at least -6\.\d+ A, min -6\.2 A")
        again, same = self.shrink(suite / "long.toml", "--filter", "=0.02", name="again.toml")
        self.assertEqual(same.read_text(encoding="utf-8"), text)
        few, _ = self.shrink(suite / "long.toml", "--filter", "=0.02", "--shrink-runs", "3", name="few.toml")
        self.assertRegex(few, r"; 3 runs; it may become smaller with more")

    def test_a_bundle_brings_its_program(self):
        """Catches: a smaller case without its device under test, a length that is lost."""
        self.write("case.toml", PROGRAM.format(limit_s=30).replace("i_a_a < 30", "i_a_a < 0.5") + "[[step]]\nat_s = 0.01\nload_nm = 0.01\n")
        self.write("device.py", DRIVES.format(until=10 ** 9))
        self.run_test(self.folder / "suite", "--keep", self.folder / "kept", code=FAILED)
        shutil.rmtree(self.folder / "suite")
        (self.folder / "suite").mkdir()
        (bundle,) = (self.folder / "kept").iterdir()
        said, small = self.shrink(bundle)
        self.assertIn("0 of 1 steps", said)
        self.assertTrue((small.parent / "device.py").exists())
        seconds = float(re.search(r"duration_s = (\S+)", small.read_text(encoding="utf-8")).group(1))
        self.assertLess(seconds, 0.002)
        self.assertIn("fail", self.run_test(small.parent, code=FAILED).stdout)
        said, _ = self.shrink(bundle, name="other.toml", code=USAGE)
        self.assertIn("device.py, which exists already", said)

    def test_a_program_that_ends_with_another_code_fails_in_another_way(self):
        """Catches: a usage error that counts as the crash, a length that is compared with the time of the crash."""
        self.write("case.toml", PROGRAM.format(limit_s=30) + A_STEP)
        self.write("device.py", DRIVES.format(until=8) + "import sys\nos.abort() if sample.load_nm > 0 else sys.exit(2)\n")
        said, small = self.shrink(self.folder / "suite")
        self.assertRegex(said, r"1 of 1 steps, .*, 0\.00\d+ s of 0\.02 s, ")
        self.assertIn("ended with code 134", self.run_test(small, code=FAILED).stdout)
        self.assertIn("made smaller: it fails in the same way.", small.read_text(encoding="utf-8"))

    def test_a_case_that_does_not_fail_each_time_is_told(self):
        """Catches: a last run that passes under the claim that the case fails."""
        self.write("case.toml", PROGRAM.format(limit_s=30) + A_STEP)
        self.write("device.py", COUNTS + "if run <= 2:\n    raise SystemExit(3)\n" + DRIVES.format(until=10 ** 9))
        said, small = self.shrink(self.folder / "suite", "--shrink-runs", "1", code=FAILED)
        self.assertIn("the case does not fail each time", said)
        self.assertIn("does not fail each time", small.read_text(encoding="utf-8").splitlines()[0])

    def test_an_interrupted_search_writes_what_it_has(self):
        """Catches: an interrupted search that loses everything, or that takes the interrupted run for the failure."""
        self.write("case.toml", PROGRAM.format(limit_s=30) + A_STEP)
        self.write("device.py", COUNTS + "if run == 3:\n    os.kill(os.getppid(), signal.SIGTERM)\n    time.sleep(60)\nraise SystemExit(3)\n")
        said, small = self.shrink(self.folder / "suite")
        self.assertIn("0 of 1 steps left", said)
        self.assertIn("is the smallest case so far, and was not run again", said)
        text = small.read_text(encoding="utf-8")
        self.assertIn("it failed in the same way.", text)
        self.assertNotIn("step", text)
        self.assertIn("ended with code 3", self.run_test(small, code=FAILED).stdout)

    def test_the_place_of_a_smaller_bundle_is_made_before_the_search(self):
        """Catches: a search whose result cannot be written, a choice among the one case of a bundle that is ignored."""
        suite = self.write("servo.toml", SERVO.replace("6.0", "5.0")).parent
        self.run_test(suite, "--keep", self.folder / "kept", code=FAILED)
        (bundle,) = (self.folder / "kept").iterdir()
        said, small = self.shrink(bundle, name="new/folder/small.toml")
        self.assertIn("0 of 0 steps", said)
        self.assertTrue(small.exists())
        said, _ = self.shrink(bundle, name="servo.toml/small.toml", code=USAGE)
        self.assertRegex(said, r"--shrink: cannot write \S+/servo\.toml/small\.toml: Not a directory")
        self.assertNotIn("fail ", said)
        for choice in (("--filter", "other"), ("--tag", "slow")):
            said, small = self.shrink(bundle, *choice, name="chosen.toml", code=USAGE)
            self.assertIn("a bundle has one case", said)
            self.assertFalse(small.exists())

    def test_what_cannot_shrink_is_refused_with_its_reason(self):
        """Catches: a passing case that runs for ever, a file that is overwritten or that lacks the files of its case."""
        self.write("long.toml", LONG)
        self.write("good.toml", SERVO)
        suite = self.folder / "suite"
        for arguments, name, rule in (((suite / "good.toml",), "x.toml", "good passes"), ((suite,), "x.toml", "there are 3 cases"),
                                      ((suite / "good.toml",), "good.toml", "exists already"), ((suite / "good.toml",), "x.txt", "must end with .toml"),
                                      ((suite / "good.toml",), "../x.toml", "must be in")):
            with self.subTest(rule):
                said, file = self.shrink(*arguments, name=name, code=USAGE)
                self.assertIn(rule, said)
                self.assertTrue(name == "good.toml" or not file.exists())


if __name__ == "__main__":
    unittest.main(verbosity=2)
