#!/usr/bin/python3
"""The check `tube` around the run of a reference controller."""
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from regression_case import FAILED, SERVO, USAGE, RegressionTest
    from wire_client import REPOSITORY
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

TUBE = '[[check]]\nname = "as {0}"\nkind = "tube"\nsignal = "i_a_a"\nreference = "{0}"\nabs = {1}\n'


class ReferenceTubes(RegressionTest):
    def failed(self):
        """The names of the checks that fail."""
        return [check["name"] for check in self.suite(code=FAILED)["cases"][0]["checks"] if not check["passed"]]

    def test_a_tube_lies_around_the_run_of_a_reference_controller(self):
        """Catches: a reference that runs on another bench or without the steps, a preset that is told only when the case runs."""
        step = "[[step]]\nat_s = 0.05\nload_nm = 0.05\n"
        self.write("servo.toml", SERVO + step + TUBE.format("book/8.2.2", 0.0))
        self.suite()
        gains = '[dut.gains]\n"position.proportional_per_s2" = 20000.0\n[[check]]'
        self.write("servo.toml", SERVO.replace("[[check]]", gains, 1) + step + TUBE.format("book/8.2.2", 0.05))
        self.assertEqual(self.failed(), ["as book/8.2.2"])
        for reference, why in (("book/none", "book/none"), ("exercise/9.9", "which does not fit the bench")):
            self.write("servo.toml", SERVO + TUBE.format(reference, 0.1))
            done = self.run_test(self.folder / "suite", code=USAGE)
            self.assertRegex(done.stderr, f"check.reference.*{why}")

    def test_each_tube_lies_around_its_own_reference(self):
        """Catches: two tubes of a case around the run of one preset."""
        self.write("servo.toml", SERVO + TUBE.format("book/8.2.2", 0.0) + TUBE.format("book/8.2.2-backward-difference", 0.0))
        self.assertEqual(self.failed(), ["as book/8.2.2-backward-difference"])

    def test_a_tube_lies_around_the_axis_of_its_check(self):
        """Catches: a reference that drives or shows the first axis in the place of the one that the case names."""
        motors = REPOSITORY / "configs/motors"
        bench = (REPOSITORY / "configs/benches/servo.toml").read_text(encoding="utf-8")
        bench = bench.replace('motor = "..', f'motor = "{motors.parent}').replace("[[axis]]", f"""[[axis]]
name = "fan"
motor = "{motors}/dc-a.toml"
[axis.amplifier]
voltage_limit_v = 40.0
over_current_a = 6.0
[axis.encoder]
counts_per_revolution = 2000

[[axis]]""", 1)
        self.write("../benches/two.toml", bench)
        of_axis = SERVO.replace('"servo"', '"../benches/two.toml"', 1).replace('"book/8.2.2"', '"book/8.2.2"\naxis = "servo"', 1)
        self.write("servo.toml", of_axis.replace("[[check]]", '[[check]]\naxis = "servo"', 1)
                   + TUBE.format("book/8.2.2", 0.0) + 'axis = "servo"\n')
        self.suite()


if __name__ == "__main__":
    unittest.main()
