#!/usr/bin/python3
"""drivebench filter: the numbers of a low-pass and a column of a file through it; and the example that cannot observe."""
import csv
import json
import math
import pathlib
import subprocess
import sys
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from command_test import SERVO, USAGE, CommandTest, link_of
from wire_client import REPOSITORY, Server

RATE_HZ = 5000.0


class Filter(CommandTest):
    def table(self, name, columns):
        """A CSV file of functions of time."""
        path = self.folder / name
        rows = ["time_s," + ",".join(columns)]
        for k in range(5000):
            t = k / RATE_HZ
            rows.append(",".join(repr(float(x)) for x in (t, *(function(t) for function in columns.values()))))
        path.write_text("\n".join(rows) + "\n", encoding="utf-8")
        return path

    def filtered(self, path, *options):
        out = self.folder / "out.csv"
        self.drivebench("filter", path, "--out", out, *options)
        with open(out, newline="", encoding="utf-8") as file:
            return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]

    def test_the_numbers_are_those_of_the_reference(self):
        """FLT-01 to 03, AC-17. Catches: a corner in rad/s, a filter that is not warped where it says so, states of another
        order. Tolerances are the printed digits."""
        there = json.loads(self.drivebench("filter", "--json", "--order", "3", "--cutoff-hz", "100", "--rate-hz", "5000").stdout)
        for name, b0, a in (("trapezoidal", 2.1878e-4, (1.0, -2.74916512, 2.52881103, -0.7778957)),
                            ("exact_at_corner", 2.1961e-4, (1.0, -2.74883581, 2.52823122, -0.77763856))):
            for found, expected in zip(there[name]["b"], (b0, 3 * b0, 3 * b0, b0), strict=True):
                self.assertAlmostEqual(found, expected, delta=5e-5 * expected)
            for found, expected in zip(there[name]["a"], a, strict=True):
                self.assertAlmostEqual(found, expected, delta=1e-8)
            b, a = there[name]["b"], there[name]["a"]
            self.assertEqual(there[name]["c"], [b[k] - b[0] * a[k] for k in (3, 2, 1)])
        self.assertAlmostEqual(there["trapezoidal_corner_hz"], 99.869, delta=1e-3)
        for found, expected in zip(there["gains"], (0.9775, math.sqrt(0.5), 0.1240), strict=True):
            self.assertAlmostEqual(found, expected, delta=5e-5)
        self.assertAlmostEqual(there["delay_s"] * 2 * math.pi * 100, 2.0, delta=1e-9)
        gains = json.loads(self.drivebench("filter", "--json", "--order", "4", "--rate-hz", "5000").stdout)["gains"]
        self.assertAlmostEqual(gains[0], 0.9917, delta=5e-5)
        self.assertAlmostEqual(gains[2], 0.0624, delta=5e-5)

    def test_a_column_goes_there_and_back_without_a_phase(self):
        """FLT-04. Catches: one pass that is called two, a slope of the raw column, an end that jumps: a sine at the corner
        has half its size and no phase, after one pass 1/sqrt(2) of it and the delay; a ramp passes unchanged. 1e-3: the
        trapezoidal rule is exact at the corner, and what the ends left has died away in the middle."""
        turn = 2 * math.pi * 100
        path = self.table("sine.csv", {"x": lambda t: math.sin(turn * t), "ramp": lambda t: 3.0 * t})
        rows = self.filtered(path, "--column", "x", "--cutoff-hz", "100")[2000:3000]  # 20 periods

        def part(name, quarter):
            shape = math.cos if quarter else math.sin
            return 2.0 / len(rows) * sum(row[name] * shape(turn * row["time_s"]) for row in rows)
        self.assertAlmostEqual(part("x_zero_phase", False), 0.5, delta=1e-3)
        self.assertAlmostEqual(part("x_zero_phase", True), 0.0, delta=1e-3)
        self.assertAlmostEqual(math.hypot(part("x_once", False), part("x_once", True)), math.sqrt(0.5), delta=1e-3)
        self.assertAlmostEqual(part("x_once", False), -0.5, delta=1e-3)  # 135 degrees late
        self.assertAlmostEqual(part("x_slope", True), 0.5 * turn * math.sin(turn / RATE_HZ) / (turn / RATE_HZ), delta=1e-3 * turn)
        rows = self.filtered(path, "--column", "ramp", "--cutoff-hz", "100")
        self.assertEqual(len(rows), 5000)
        for row in rows:
            self.assertAlmostEqual(row["ramp_zero_phase"], 3.0 * row["time_s"], delta=1e-5)
        for row in rows[1000:4000]:
            self.assertAlmostEqual(row["ramp_slope"], 3.0, delta=1e-6)

    def test_what_cannot_be_filtered_is_refused(self):
        """Catches: a corner that cannot be sampled, options that do nothing, a column that is not there."""
        path = self.table("ramp.csv", {"x": float})
        for options, fact in (([], "--rate-hz is needed"), (["--cutoff-hz", "100", "--rate-hz", "200"], "below half of --rate-hz, 100 Hz"),
                              (["--rate-hz", "1000", "--column", "x"], "belong to a file"), (["--order", "11"], "--order"),
                              ([path], "needs --column"), ([path, "--column", "y"], "y"),
                              ([path, "--column", "x", "--rate-hz", "4000"], "come at 5000 Hz"),
                              ([path, "--column", "x", "--cutoff-hz", "2500"], "half the sampling rate"),
                              ([self.folder / "none.csv", "--column", "x"], "none.csv")):
            self.assertIn(fact, self.drivebench("filter", *options, code=USAGE).stderr)

    def test_the_readme_shows_what_is_printed(self):
        """Catches: an example that is no longer what the command prints."""
        told = (REPOSITORY / "clients/README.md").read_text(encoding="utf-8")
        for line in self.drivebench("filter", "--order", "3", "--cutoff-hz", "100", "--rate-hz", "5000").stdout.splitlines():
            self.assertIn(line, told)

    def test_the_position_stays_unknown_from_the_speed(self):
        """EST-04. Catches: an example that does not run, or that observes what cannot be observed."""
        move = self.folder / "move.csv"
        with Server(config=SERVO) as server:
            self.drivebench("control", "--csv", move, "--link", link_of(server))
        example = REPOSITORY / "clients/python/examples/position_from_speed.py"
        shown = subprocess.run([sys.executable, example, move], capture_output=True, text=True, check=True).stdout.splitlines()
        self.assertEqual([line.split(": ")[1].split(" ")[0] for line in shown], ["0.000000"] + 3 * ["0.100000"])
        told = (REPOSITORY / "clients/README.md").read_text(encoding="utf-8")
        for line in shown:
            self.assertIn(line, told)


if __name__ == "__main__":
    unittest.main(verbosity=2)
