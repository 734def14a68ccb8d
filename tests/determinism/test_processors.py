#!/usr/bin/python3
"""Presets, checks and draws give the same bits with every variant of the C library's functions.

The C library chooses variants of sin, exp, log and others by the CPU when a program starts; GLIBC_TUNABLES takes FMA and
AVX2 away from that choice, as an older CPU does.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "helpers"))
try:
    from wire_client import PATIENCE_S, REPOSITORY, SERVER
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

COMMAND = SERVER.with_name("drivebench")
OLD_CPU = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2_Usable,-FMA_Usable,-FMA4_Usable,-AVX2,-FMA,-FMA4"}

CASE = """bench = "{bench}"
[dut]
preset = "{preset}"
[[check]]
kind = "always"
condition = "state >= 0"
[[check]]
kind = "rms"
signal = "i_a_a"
max = 1e6
[[check]]
kind = "thd"
signal = "i_a_a"
max_percent = 1e6
"""


def command(*arguments, environment=None):
    return subprocess.run([COMMAND, *map(str, arguments)], env={**os.environ, **(environment or {})}, capture_output=True,
                          text=True, timeout=4 * PATIENCE_S, check=False)


class Processors(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="drivebench-processors-")
        self.folder = pathlib.Path(temporary.name)
        self.addCleanup(temporary.cleanup)

    def report(self, suite, environment):
        file = self.folder / "report.json"
        done = command("test", suite, "--json", file, environment=environment)
        self.assertIn(done.returncode, (0, 1), done.stdout + done.stderr)
        return json.loads(file.read_text(encoding="utf-8"))["cases"]

    def assert_same(self, suite):
        newest, oldest = self.report(suite, {}), self.report(suite, OLD_CPU)
        different = [new["name"] for new, old in zip(newest, oldest, strict=True) if new != old]
        self.assertEqual(different, [], "cases that depend on the CPU")
        return newest

    def test_each_preset_gives_the_same_hash(self):
        """Catches: a sine, exponential or arc tangent of the C library in a controller, an observer or a move."""
        suite = self.folder / "presets"
        suite.mkdir()
        presets = json.loads(command("control", "--list", "--json").stdout)
        for k, preset in enumerate(presets):
            (suite / f"{k:03}.toml").write_text(CASE.format(bench=preset["bench"], preset=preset["name"]), encoding="utf-8")
        cases = self.assert_same(suite)
        self.assertGreater(len({case["hash"] for case in cases}), 40, "too few presets ran")

    def test_reports_of_responses_harmonics_and_draws_are_the_same(self):
        """Catches: the C library's functions in a check, in the phases of a multisine or in a drawn value."""
        for name in ("dc/loop_margins", "dc/tolerances"):
            self.assertGreater(len(self.assert_same(REPOSITORY / f"configs/suites/reference/{name}.toml")), 0)


if __name__ == "__main__":
    unittest.main()
