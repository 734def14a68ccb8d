#!/usr/bin/python3
"""Suites and identifications that a user starts in the page of `drivebench web`: browser/run_scenarios.mjs in Debian's chromium."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

from test_page import BENCHES, PATIENCE_S, PageTest, missing
from command_test import DRIVEBENCH, environment, link_of
from regression_case import PROGRAM, SERVO
from web_client import TEXT
from wire_client import REPOSITORY

OWNER = "the secret of a test"


class RunsPage(PageTest):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="drivebench-runs-")
        self.addCleanup(folder.cleanup)
        self.path = pathlib.Path(folder.name)
        self.reports = self.path / "reports"
        self.reports.mkdir()
        self.suite("servo", SERVO)
        self.options = ("--reports", self.reports, "--suites", self.path / "suites", "--identify")

    def suite(self, name, case):
        folder = self.path / "suites" / name
        folder.mkdir(parents=True)
        (folder / "case.toml").write_text(case, encoding="utf-8")
        return folder

    def drivebench(self, *arguments, server):
        return subprocess.run([DRIVEBENCH, *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE_S, cwd=self.path,
                              env=environment(link_of(server)), check=True).stdout

    def measured(self):
        """A bench with an experiment from which its motor is identified."""
        bench = self.serve("--mode", "lockstep", "--experiments", str(self.path / "kept"), config=BENCHES / "dc-a-voltage.toml")
        self.drivebench("experiment", "run", REPOSITORY / "configs/experiments/dc-a-steps.toml", "--out", "steps.mcap", "--owner", OWNER,
                        server=bench)
        return bench

    def test_a_suite_and_an_identification_run_from_the_page(self):
        """Catches: a button that orders another suite, experiment or motor, a run without its progress, a result that is not shown, a
        cancel that does not arrive, a control out of the reach of keys or one that axe finds at fault."""
        lasting = self.suite("lasting", PROGRAM.format(limit_s=500))
        (lasting / "device.py").write_text("import time\ntime.sleep(600)\n", encoding="utf-8")
        bench = self.measured()
        shown = self.play("runs", self.gateway(bench, *self.options).url, OWNER)
        self.assertEqual(shown["suites"], ["lasting", "servo"])
        self.assertEqual(shown["suite"][:4], ["1", "suite servo", "passed", "1 of 1"])
        self.assertRegex(shown["suite"][4], r"^1 passed; ")
        self.assertEqual((shown["running"], shown["cancelled"]), ("0 of 1", "cancelled"))
        self.assertEqual(shown["identification"][:5], ["3", "dc of experiment 1", "passed", "", "the data see every parameter"])
        expected = json.loads(self.drivebench("identify", "--motor", "dc", "--from", "steps.mcap", "--json", server=bench))["parameters"]
        self.assert_identified(shown, expected)
        self.assertEqual(sorted(shown["names"]), sorted(each.name for each in self.reports.iterdir()))
        self.assertEqual(shown["answer"], "run 3: passed: the data see every parameter")
        self.assertEqual(shown["reached"], ["suite to run", "Run the suite", "List of runs"])

    def test_a_viewer_sees_runs_and_starts_none(self):
        """Catches: a control that only the gateway's refusal stops, a viewer to whom results are not shown."""
        server = self.for_users("--experiments", str(self.path / "kept"))
        gateway = self.gateway(server, *self.options)
        with gateway.browser(token="otto-secret") as operator:
            operator.send_frame(TEXT, json.dumps({"op": "run_suite", "suite": "servo"}).encode())
            operator.read_frame()
        shown = self.play("runsSeen", gateway.url, "vera-secret")
        self.assertEqual(shown["row"][:3], ["1", "suite servo", "passed"])
        self.assertEqual(shown["controls"], [])


if __name__ == "__main__":
    if reason := missing():
        print(f"SKIPPED: {reason}")
        sys.exit(77)
    unittest.main(verbosity=2)
