"""Every measurement of drivebench-benchmark once, as briefly as it goes: they work; their figures say nothing here."""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv.pop(1)
SECONDS = 500


def benchmark(*options, code=0):
    done = subprocess.run([PROGRAM, *options], capture_output=True, text=True, timeout=SECONDS, check=False)
    if done.returncode != code:
        raise AssertionError(f"{options} ended with {done.returncode}:\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}")
    return done


DIFFERENCES = ("beside its ticks", "free mode with recording, one CPU")


class Measurements(unittest.TestCase):
    def test_each_runs_and_two_runs_can_be_compared(self):
        """Catches: a measurement that a change of the product has broken, which a run of ten minutes would tell weeks later."""
        done = benchmark("--brief", "--json")
        rows = json.loads(done.stdout)["rows"]
        measured = [line.split(":")[0].split()[-1] for line in done.stderr.splitlines() if line.startswith("measuring ")]
        listed = [line.split()[0] for line in benchmark("--help").stdout.partition("Measurements:\n")[2].splitlines() if line]
        self.assertEqual(measured, listed)
        self.assertGreater(len(rows), 2 * len(listed))
        for row in rows:
            if row["verdict"] != "skipped":
                # Beside other work the difference of two times can be below zero.
                least = -math.inf if row["name"].endswith(DIFFERENCES) else 0.0
                self.assertGreaterEqual(row["measured"], least, row)
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "run.json"
            file.write_text(done.stdout, encoding="utf-8")
            said = benchmark("--compare", str(file), str(file), "--strict").stdout
            self.assertIn("tick, standing", said)
            self.assertNotIn("WORSE", said)
            file.write_text("{", encoding="utf-8")
            self.assertIn("is not JSON", benchmark("--compare", str(file), str(file), code=2).stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
