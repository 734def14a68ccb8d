#!/usr/bin/python3
"""Suites and identifications that browsers order from `drivebench web --suites --identify`: what runs, what is refused, what is left."""
import json
import os
import resource
import signal
import sys
import unittest

from test_gateway import PAGE, TEXT, USAGE, GatewayTest
from test_page import text_for_users
from command_test import link_of
from regression_case import PROGRAM, SERVO
from wire_client import BENCHES, REPOSITORY
from wire_test import until

OWNER = "the secret of a test"
FAILS = SERVO.replace("abs = 6.0", "abs = 1e-6")
# Tells who it is and what it was given, and then lasts longer than any test.
LASTS = """import json, os, time
with open("told.part", "w") as file:
    json.dump({"pid": os.getpid(), "environment": dict(os.environ)}, file)
os.rename("told.part", "told.json")
time.sleep(600)
"""


class Runs(GatewayTest):
    def setUp(self):
        super().setUp()
        self.reports, self.suites = self.folder / "reports", self.folder / "suites"
        self.reports.mkdir()
        self.suites.mkdir()
        self.suite("servo", good=SERVO)
        self.options = ("--reports", self.reports, "--suites", self.suites, "--identify")

    def suite(self, name, **cases):
        folder = self.suites / name
        folder.mkdir()
        for case, text in cases.items():
            (folder / f"{case}.toml").write_text(text, encoding="utf-8")
        return folder

    def lasting(self):
        """A suite whose device under test does not end."""
        folder = self.suite("lasting", case=PROGRAM.format(limit_s=500))
        (folder / "device.py").write_text(LASTS, encoding="utf-8")
        return folder / "told.json"

    def told(self, file):
        until(file.exists, "the device under test")
        return json.loads(file.read_text(encoding="utf-8"))

    def begin(self, server=None, **more):
        self.bench = server or self.server("--mode", "lockstep")
        return self.gateway(*self.options, server=self.bench, **more)

    def order(self, browser, **order):
        """The answer of the gateway. Reports of the drive pass by."""
        browser.send_frame(TEXT, json.dumps(order).encode())
        while True:
            opcode, data = browser.read_frame()
            if opcode == TEXT and "runs" in (answer := json.loads(data)):
                return answer["runs"]

    def said(self, browser, **order):
        answer = self.order(browser, **order)
        self.assertTrue(answer["is_refusal"], answer)
        return answer["said"]

    def started(self, browser, **order):
        answer = self.order(browser, **order)
        self.assertFalse(answer["is_refusal"], answer)
        return answer["run"]

    def listed(self, gateway, number):
        return next(each for each in json.loads(gateway.get("/runs")[2])["runs"] if each["number"] == number)

    def ended(self, gateway, number):
        until(lambda: self.listed(gateway, number)["state"] not in ("waits", "runs"), f"the end of run {number}")
        return self.listed(gateway, number)

    def left(self):
        return sorted(each.name for each in self.reports.iterdir())


class Suites(Runs):
    def test_suites_run_one_after_the_other_and_their_reports_are_kept(self):
        """Catches: a verdict of another suite, cases that are not counted, a report that lies where none is found, work that is left
        behind, a run that waits for ever, another gateway that a page cannot tell from the one before."""
        self.suite("mixed", bad=FAILS, good=SERVO, skipped=SERVO.replace("[dut]", 'skip = "not today"\n[dut]'))
        self.suite("broken", broken="bench = 7\n")
        gateway = self.begin()
        listing = json.loads(gateway.get("/runs")[2])
        begun_us = listing.pop("begun_us")
        self.assertEqual(listing, {"suites": ["broken", "mixed", "servo"], "identifies": True, "runs": []})
        with gateway.browser() as browser:
            numbers = [self.started(browser, op="run_suite", suite=name) for name in ("servo", "mixed", "broken")]
        servo, mixed, broken = (self.ended(gateway, number) for number in numbers)
        self.assertEqual((servo["state"], servo["subject"], servo["done"], servo["of"], servo["bad"]), ("passed", "suite servo", 1, 1, 0))
        self.assertRegex(servo["sentence"], r"^1 passed; ")
        self.assertEqual((mixed["state"], mixed["done"], mixed["of"], mixed["bad"]), ("failed", 3, 3, 1))
        self.assertRegex(mixed["sentence"], r"1 failed")
        self.assertEqual((broken["state"], broken["report"]), ("failed", ""))
        self.assertIn("broken.toml", broken["sentence"])
        self.assertRegex(servo["report"], r"^servo-\d{8}-\d{6}\.html$")
        self.assertEqual(self.left(), sorted([servo["report"], mixed["report"]]))
        self.assertEqual({each["name"] for each in json.loads(gateway.get("/reports")[2])}, set(self.left()))
        self.assertIn("good", gateway.get(f"/reports/{servo['report']}")[2])
        self.assertEqual(json.loads(gateway.get("/runs")[2])["begun_us"], begun_us)
        self.assertGreater(json.loads(self.begin().get("/runs")[2])["begun_us"], begun_us)

    def test_web_09_no_order_leads_beyond_what_the_gateway_offers(self):
        """Catches: a name that climbs, a link that is followed, an option or a shell in a name, a text that is taken for another, a
        thousand orders that become a thousand runs, memory that they fill."""
        told = self.lasting()
        (self.folder / "outside").mkdir()
        (self.folder / "outside/case.toml").write_text(SERVO, encoding="utf-8")
        (self.suites / "link").symlink_to(self.folder / "outside")
        (self.suites / "empty").mkdir()
        (self.suites / "file.toml").write_text(SERVO, encoding="utf-8")
        gateway = self.begin()
        self.assertEqual(json.loads(gateway.get("/runs")[2])["suites"], ["lasting", "servo"])
        with gateway.browser() as browser:
            for name in ("../outside", "..", ".", "", "/etc", "servo/", "servo/../servo", "link", "empty", "file.toml", "nowhere", "--help",
                         "servo; touch taken", "$(touch taken)", "servo\n", "s" * 5000, "ser\0vo"):
                self.assertRegex(self.said(browser, op="run_suite", suite=name), r"^suite: '.{0,170}' is no suite of this gateway$", name)
            for wrong in ({"op": "run_suite"}, {"op": "run_suite", "suite": 7}, {"op": "identify", "experiment": -1, "owner": "a", "axis": 0, "motor": "dc"},
                          {"op": "identify", "experiment": 1, "owner": "a", "axis": 1, "motor": "dc"}, {"op": "cancel_run", "run": "1"}):
                browser.send_frame(TEXT, json.dumps(wrong).encode())
                self.assertRegex(json.loads(browser.read_frame()[1])["problem"], "is missing|is no text|is no number")
            wish = {"op": "identify", "experiment": 1, "owner": "a", "axis": 0}
            self.assertEqual(self.said(browser, motor="--out=x", **wish), "motor: '--out=x' is not one of im, dc, pm, bldc")
            for owner in ("", "a\nb", "a" * 257):
                self.assertEqual(self.said(browser, motor="dc", **{**wish, "owner": owner}), "owner: the secret is not 1 to 256 bytes of plain text")
            self.assertEqual(self.said(browser, op="cancel_run", run=1), "run: 1 neither waits nor runs")
            number = self.started(browser, op="run_suite", suite="lasting")
            self.told(told)
            answers = [self.order(browser, op="run_suite", suite="servo") for _ in range(1000)]
            self.assertEqual([each["is_refusal"] for each in answers], [False] * 8 + [True] * 992)
            self.assertEqual(answers[-1]["said"], "suite servo: 8 runs wait already")
            for each in answers[:8]:
                self.order(browser, op="cancel_run", run=each["run"])
            for _ in range(100):  # what has ended is forgotten at some time
                self.order(browser, op="cancel_run", run=self.started(browser, op="run_suite", suite="servo"))
            self.order(browser, op="cancel_run", run=number)
        self.assertEqual(self.ended(gateway, number)["state"], "cancelled")
        self.assertEqual(len(json.loads(gateway.get("/runs")[2])["runs"]), 32)
        self.assertLess(gateway.memory_kib(), 64 * 1024)
        self.assertEqual((self.left(), (self.suites / "taken").exists()), ([], False))

    def test_web_09_an_order_that_nobody_hears_of_is_harmless(self):
        """Catches: answers that wait in memory for a browser that reads none."""
        gateway = self.begin()
        for order, count in (({"op": "run_suite", "suite": "x" * 60000}, 10_000), ({"op": "cancel_run", "run": 1}, 1_000_000)):
            deaf = gateway.browser(receive_buffer=4096)
            self.addCleanup(deaf.close)
            deaf.socket.settimeout(5)
            text = json.dumps(order).encode()
            with self.assertRaises(OSError, msg="no more is taken from it"):
                for _ in range(count):
                    deaf.send_frame(TEXT, text)
        with gateway.browser() as browser:
            self.assertEqual(browser.newest().tick, 0)
        self.assertLess(gateway.memory_kib(), 64 * 1024)

    def test_web_09_who_only_looks_starts_nothing(self):
        """Catches: a viewer of the bench who starts programs on this computer, or ends those of others."""
        gateway = self.begin(self.server("--mode", "lockstep", text=text_for_users(self.folder)))
        refusal = "role: the bench lets this browser only look, and so it starts nothing"
        with gateway.browser(token="vera-secret") as viewer, gateway.browser(token="otto-secret") as operator:
            wish = {"op": "identify", "experiment": 1, "owner": "a", "axis": 0, "motor": "dc"}
            for order in ({"op": "run_suite", "suite": "servo"}, wish, {"op": "cancel_run", "run": 1}):
                self.assertEqual(self.said(viewer, **order), refusal)
            number = self.started(operator, op="run_suite", suite="servo")
        self.assertEqual(self.ended(gateway, number)["state"], "passed")  # although its browser has gone

    def test_web_09_what_runs_ends_with_cancel_and_with_its_gateway(self):
        """Catches: a device under test, a bench or work in the folder of reports that outlives the run, or the gateway however it ends;
        secrets of the gateway in the hands of a program of a suite."""
        told = self.lasting()
        bench = self.server("--mode", "lockstep")
        for end in ("cancel", signal.SIGTERM, signal.SIGKILL):
            gateway = self.gateway(*self.options, "--token", "a token of the gateway", server=bench)
            with gateway.browser() as browser:
                number = self.started(browser, op="run_suite", suite="lasting")
                device = self.told(told)
                if end == "cancel":
                    self.order(browser, op="cancel_run", run=number)
            if end == "cancel":
                self.assertEqual(self.ended(gateway, number)["state"], "cancelled")
                self.assertEqual(self.left(), [])
            else:
                gateway.process.send_signal(end)
                gateway.process.wait(30)
            until(lambda pid=device["pid"]: not os.path.exists(f"/proc/{pid}"), f"the end of the device after {end}")
            self.assertNotIn("a token of the gateway", device["environment"].values())
            self.assertEqual(device["environment"].get("DRIVEBENCH_TOKEN"), "")
            told.unlink()

    def test_web_09_a_full_disk_is_said(self):
        """Catches: a report that is a part of one, a run that ends in silence, a gateway that ends with it."""
        def fills_soon():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))

        gateway = self.begin(before=fills_soon)
        with gateway.browser() as browser:
            run = self.ended(gateway, self.started(browser, op="run_suite", suite="servo"))
            self.assertEqual((run["state"], run["report"], self.left()), ("failed", "", []))
            self.assertRegex(run["sentence"], "cannot write|File too large")
            self.assertEqual(browser.newest().tick, 0)
        self.reports.rename(self.folder / "away")
        with gateway.browser() as browser:
            run = self.ended(gateway, self.started(browser, op="run_suite", suite="servo"))
        self.assertEqual(run["state"], "failed")
        self.assertIn("No such file or directory", run["sentence"])

    def test_runs_are_only_where_they_were_asked_for(self):
        """Catches: a gateway that starts programs without its option, results without a place, an option whose mistake is not named."""
        bench = self.server("--mode", "lockstep")
        gateway = self.gateway("--reports", self.reports, server=bench)
        self.assertEqual(gateway.get("/runs")[::2], (200, "null"))
        with gateway.browser() as browser:
            self.assertIn("without --suites and --identify", self.said(browser, op="run_suite", suite="servo"))
        gateway = self.gateway("--reports", self.reports, "--identify", server=bench)
        with gateway.browser() as browser:
            self.assertIn("without --suites", self.said(browser, op="run_suite", suite="servo"))
        gateway = self.gateway("--reports", self.reports, "--suites", self.suites, server=bench)
        with gateway.browser() as browser:
            self.assertIn("without --identify", self.said(browser, op="identify", experiment=1, owner="a", axis=0, motor="dc"))
        for options in (("--suites", self.suites), ("--identify",)):
            self.assertSays(self.drivebench("web", *options, code=USAGE).stderr, "need --reports")
        said = self.drivebench("web", "--reports", self.reports, "--suites", "nowhere", code=USAGE).stderr
        self.assertSays(said, "--suites nowhere", "no folder to read")


class Identification(Runs):
    def setUp(self):
        super().setUp()
        self.gateway_ = self.begin(self.server("--mode", "lockstep", "--experiments", self.folder / "kept", config=BENCHES / "dc-a-voltage.toml"))
        self.drivebench("experiment", "run", REPOSITORY / "configs/experiments/dc-a-steps.toml", "--out", "steps.mcap", "--owner", OWNER,
                        link=link_of(self.bench))

    def identified(self, **wish):
        with self.gateway_.browser() as browser:
            return self.ended(self.gateway_, self.started(browser, op="identify", **{"experiment": 1, "owner": OWNER, "axis": 0, "motor": "dc", **wish}))

    def test_a_motor_is_identified_as_in_a_terminal(self):
        """Catches: data of another experiment, a report or a picture that is left out, a report that is no JSON."""
        run = self.identified()
        self.assertEqual((run["state"], run["subject"], run["sentence"]), ("passed", "dc of experiment 1", "the data see every parameter"))
        self.assertRegex(run["report"], r"^experiment-1-dc-\d{8}-\d{6}\.json$")
        picture = run["report"].replace(".json", ".svg")
        self.assertEqual(self.left(), sorted([run["report"], picture]))
        terminal = self.json_of("identify", "--motor", "dc", "--from", "steps.mcap")
        page = json.loads(self.gateway_.get(f"/reports/{run['report']}")[2])
        self.assertEqual((page["parameters"], page["source"]), (terminal["parameters"], "recording experiment-1.mcap, axis dc-a"))
        self.assertIn("<svg", self.gateway_.get(f"/reports/{picture}")[2])

    def test_what_cannot_be_identified_is_said(self):
        """Catches: another owner's data in a report, a motor of another kind, an experiment that never was, in silence or as a success."""
        for wish, sentence in (({"owner": "another secret"}, "owner|secret"), ({"motor": "im"}, "^recording experiment-1.mcap, axis dc-a is of kind pm_dc, --motor im is for induction$"), ({"experiment": 99}, "99")):
            run = self.identified(**wish)
            self.assertEqual((run["state"], run["report"]), ("failed", ""), run)
            self.assertRegex(run["sentence"], sentence)
        self.assertEqual(self.left(), [])


if __name__ == "__main__":
    if not PAGE.exists():
        print(f"SKIPPED: the page was not built (node and npm): no {PAGE}")
        sys.exit(77)
    unittest.main(verbosity=2)
