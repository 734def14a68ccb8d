#!/usr/bin/python3
"""One suite, with its device under test in the process of the runner and over every link."""
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from regression_case import COMMAND, FAILED, RegressionTest
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

LINKS = ("unix", "tcp", "shm", "can", "modbus")
DOUBLES, FLOATS = LINKS[:3], LINKS[3:]
# On a busy machine a CAN link sends a command again after 20 ms without an answer. The bench refuses the second one, and the hash
# counts refused commands. So the test runs the suite again until the link has sent no command twice.
TRIES = 5
# A case of each: bench, preset, length, and a bound that it keeps, and one that it breaks.
FAMILIES = {
    "dc": ("dc-a-voltage", "book/2.18-own-current-loop", 0.1, 'signal = "angle_rad"', 3.3, 3.0),
    "induction": ("servo", "book/8.2.2", 0.12, 'signal = "i_a_a"', 6.0, 5.0),
    "synchronous": ("ipm-servo", "book/9.11", 0.1, 'signal = "i_a_a"', 50.0, 0.5),
}


class Links(RegressionTest):
    def results(self, broken):
        """Name of the case and the way to its device: verdicts of case and checks, and the hash of the run."""
        for family, (bench, preset, duration_s, signal, wide, narrow) in FAMILIES.items():
            head = f'bench = "{bench}"\nduration_s = {duration_s}\n'
            checks = (f'[[check]]\nname = "bound"\nkind = "bounds"\n{signal}\nabs = {narrow if broken else wide}\n'
                      '[[check]]\nname = "no fault"\nkind = "never"\ncondition = "state == 4"\n')
            self.write(f"{family}-inproc.toml", f'{head}[dut]\npreset = "{preset}"\n{checks}')
            line = f"exec '{COMMAND}' control --preset {preset} --link $DRIVEBENCH_LINK"
            self.write(f"{family}.toml", f'{head}[dut]\ncommand = ["/bin/sh", "-c", "{line}"]\nlink = "unix"\n{checks}'
                                         f'[matrix]\ndut.link = {list(LINKS)}\n')
        found = {}
        for case in self.suite(code=FAILED if broken else 0)["cases"]:
            family, way = case["name"].replace("[link=", "-").rstrip("]").split("-")
            verdicts = (case["verdict"], [(check["name"], check["passed"]) for check in case["checks"]])
            found[family, way] = (verdicts, case["hash"], case["samples"])
        return found

    def test_a_suite_has_one_verdict_over_every_link(self):
        """Catches: a verdict that depends on how the device is connected, a link that costs a tick or a bit, a bus of the bench that the
        device does not find."""
        for broken in (False, True):
            for _ in range(TRIES):
                found = self.results(broken)
                if all(found[family, "can"][1] == found[family, "modbus"][1] for family in FAMILIES):
                    break
            self.assertEqual(len(found), len(FAMILIES) * (1 + len(LINKS)))
            for family in FAMILIES:
                with self.subTest(family=family, broken=broken):
                    wanted = (("fail" if broken else "pass"), [("bound", not broken), ("no fault", True)])
                    for way in ("inproc", *LINKS):
                        self.assertEqual(found[family, way][0], wanted, way)
                        self.assertEqual(found[family, way][2], found[family, "inproc"][2], way)
                    for way in DOUBLES:
                        self.assertEqual(found[family, way][1], found[family, "inproc"][1], way)
                    self.assertEqual(found[family, "can"][1], found[family, "modbus"][1])


if __name__ == "__main__":
    unittest.main()
