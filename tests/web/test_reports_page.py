#!/usr/bin/python3
"""Reports of `drivebench test` and `drivebench identify` in the page of `drivebench web`: browser/report_scenarios.mjs in Debian's chromium."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

from test_page import PATIENCE_S, PageTest, missing
from command_test import DRIVEBENCH, environment
from regression_case import SERVO

MARKUP = "<img src=x onerror=\"document.title='taken'\">"
HOSTILE = f"<!doctype html><title>hostile</title><script>document.title = 'taken'</script><p id=there>{MARKUP}<a href='/' target=_top>out</a>"


class ReportsPage(PageTest):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="drivebench-reports-")
        self.addCleanup(folder.cleanup)
        self.reports = pathlib.Path(folder.name)

    def drivebench(self, *arguments):
        return subprocess.run([DRIVEBENCH, *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE_S, env=environment(),
                              cwd=self.reports, check=True).stdout

    def test_reports_of_tests_and_identifications_are_listed_and_shown(self):
        """Catches: a report that the page's policy spoils, a table with the numbers of other parameters, an interval that is left out,
        a plot of another report, a control that axe finds at fault."""
        suite = self.reports / "suite"
        suite.mkdir()
        (suite / "servo.toml").write_text(SERVO, encoding="utf-8")
        self.drivebench("test", "suite", "--html", "suite.html")
        report = self.drivebench("identify", "--motor", "dc", "--json", "--plot", "motor.svg")
        (self.reports / "motor.json").write_text(report, encoding="utf-8")
        shown = self.play("reports", self.gateway(self.serve("--mode", "lockstep"), "--reports", self.reports).url)
        self.assertEqual(sorted(shown["names"]), ["motor.json", "motor.svg", "suite.html"])
        expected = json.loads(report)["parameters"]
        self.assert_identified(shown, expected)
        self.assertEqual((shown["title"], shown["cells"] >= 4, shown["font"]), ("suite", True, shown["font"]))

    def test_web_07_a_hostile_report_stays_in_its_box(self):
        """Catches: a script of a report that runs, markup of a report that becomes a part of the page, a file of another shape that breaks
        the page, a report that reads what the page has stored."""
        (self.reports / "hostile.html").write_text(HOSTILE, encoding="utf-8")
        (self.reports / "hostile.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg' onload=\"document.title='taken'\"><script>alert(1)</script></svg>",
                                                  encoding="utf-8")
        (self.reports / "shape.json").write_text(json.dumps([{"motor": 7}]), encoding="utf-8")
        (self.reports / "broken.json").write_text("{\"motor\": ", encoding="utf-8")
        (self.reports / "hostile.json").write_text(json.dumps({"motor": MARKUP, "method": MARKUP, "verdict": MARKUP, "notes": [MARKUP], "parameters": {
            MARKUP: {"estimate": 1e308, "unit": MARKUP, "interval": MARKUP, "truth": None, "inside": 7}}}), encoding="utf-8")
        shown = self.play("hostileReports", self.gateway(self.serve("--mode", "lockstep"), "--reports", self.reports).url)
        self.assertEqual((shown["title"], shown["origin"], shown["svg"]), ("hostile", "null", ""))
        self.assertIn("it is no report of", shown["shape"])
        self.assertIn("broken.json:", shown["broken"])
        self.assertEqual((shown["images"], shown["pageTitle"]), (["Measured and re-simulated signals of hostile.json"], "servo – drivebench"))
        self.assertEqual(shown["row"], [MARKUP, "1.000e+308", "–", MARKUP, "–", "–"])


if __name__ == "__main__":
    if reason := missing():
        print(f"SKIPPED: {reason}")
        sys.exit(77)
    unittest.main(verbosity=2)
