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


class Shrink(RegressionTest):
    def shrink(self, *arguments, name="small.toml", code=OK):
        small = self.folder / "suite" / name
        done = self.run_test(*arguments, "--shrink", small, code=code)
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
