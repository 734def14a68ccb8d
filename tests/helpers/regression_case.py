"""Suites of cases for `drivebench test`, in a folder of their own."""
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

from wire_client import PATIENCE_S, REPOSITORY, SERVER

COMMAND = SERVER.with_name("drivebench")
OK, FAILED, USAGE, INVALID = 0, 1, 2, 4

SERVO = """bench = "servo"
[dut]
preset = "book/8.2.2"
[[check]]
name = "current"
kind = "bounds"
signal = "i_a_a"
abs = 6.0
"""

# Programs that stand in for a device under test. The bench is the one of the loops in configs/suites/ten-minutes.
PROGRAM = """bench = "dc-a-voltage"
duration_s = 0.02
[dut]
command = ["/usr/bin/python3", "device.py"]
time_limit_s = {limit_s}
[[check]]
kind = "always"
condition = "i_a_a < 30"
"""
DRIVES = """import os
import drivebench
with drivebench.Bench(os.environ["DRIVEBENCH_LINK"]) as bench:
    bench.acquire()
    sample = bench.newest()
    while sample.tick < {until}:
        sample = bench.step(voltages=5.0)
"""


class RegressionTest(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="drivebench-regression-")
        self.folder = pathlib.Path(temporary.name)
        self.addCleanup(temporary.cleanup)
        self.environment = {**os.environ, "PYTHONPATH": str(REPOSITORY / "clients/python/src"),
                            "DRIVEBENCH_LIBRARY": str(SERVER.parents[1] / "lib/libdrivebench.so.1"), "TMPDIR": str(self.folder)}

    def write(self, name, text):
        path = self.folder / "suite" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    def run_test(self, *arguments, code=OK):
        done = subprocess.run([COMMAND, "test", *map(str, arguments)], capture_output=True, text=True, env=self.environment,
                              timeout=4 * PATIENCE_S, check=False)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def report(self, *arguments, code=OK):
        file = self.folder / "report.json"
        self.run_test(*arguments, "--json", file, code=code)
        return json.loads(file.read_text(encoding="utf-8"))

    def suite(self, *arguments, code=OK):
        return self.report(self.folder / "suite", *arguments, code=code)
