"""Shared by the tests of CAN drives: bench files with a bus, network namespaces, recordings."""
import csv
import sys
import unittest

from command_test import CommandTest
from own_network import in_own_network  # noqa: F401
from wire_client import BENCHES, PATIENCE_S, REPOSITORY  # noqa: F401

SERVO = (BENCHES / "servo.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")

# The same motor, wound in an isolated star, with Hall lines and a tachometer.
STAR = SERVO + """
[axis.machine]
star = true

[axis.hall]
enabled = true

[axis.tachometer]
enabled = true
gain_vs_per_rad = 0.05
"""


def with_bus(lines, bench=SERVO):
    """The servo bench with a [[can]] section."""
    return bench + "\n[[can]]\n" + "\n".join(lines) + "\n"


class DriveTest(CommandTest):
    def text_of(self, what, text):
        """A description of an interface, by the server's --print; the file it went to."""
        bench = self.folder / "bench.toml"
        bench.write_text(text, encoding="utf-8")
        out = self.folder / f"bench.{what}"
        out.write_text(self.drivebench_server(bench, "--print", what).stdout, encoding="utf-8")
        return out

    def recorded(self, recording):
        """The rows of a recording by tick."""
        table = recording.with_suffix(".csv")
        self.drivebench("export", recording, "--out", table)
        with open(table, encoding="utf-8") as file:
            rows = list(csv.reader(file))
        names = [name.split(" ")[0] for name in rows[0]]
        return {int(row[names.index("tick")]): dict(zip(names, row)) for row in rows[1:]}

    def assertCountsRecorded(self, counts, recording):
        """Every count that came over the wire equals the recorded one, and the motor has moved."""
        rows = self.recorded(recording)
        for tick, count in counts:
            self.assertEqual(int(rows[tick]["encoder_count"]), count, f"tick {tick}")
        self.assertGreater(abs(counts[-1][1]), 100, "the motor turns")


def run_all():
    suite = unittest.defaultTestLoader.loadTestsFromModule(sys.modules["__main__"])
    result = unittest.TextTestRunner(verbosity=2).run(suite)
    sys.exit(0 if result.wasSuccessful() else 1)
