#!/usr/bin/python3
"""An operator drives an axis from the page of `drivebench web`: browser/drive_scenarios.mjs in Debian's chromium."""
import re
import subprocess
import sys
import unittest

from test_page import BENCHES, PATIENCE_S, REPOSITORY, PageTest, missing, pb, until
from command_test import DRIVEBENCH, environment, link_of

IDLE, RUN, HOLD = 0, 1, 2
LATCHED = 512 + 1024  # the faults of a controller that is late or lost


def control(server, preset):
    """`drivebench control` on the bench of a server."""
    command = [DRIVEBENCH, "control", "--link", link_of(server), "--preset", preset]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, env=environment(), check=False)


class DrivePage(PageTest):
    def in_real_time(self):
        """The servo at 1 kHz, with a watchdog that the pauses of a busy machine do not reach."""
        text = (BENCHES / "servo.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        for before, after in (("period_us = 125 ", "period_us = 1000"), ("substeps = 5", "substeps = 40"),
                              ("watchdog_ticks = 20 ", "watchdog_ticks = 5000"), ("lease_s = 2.0", "lease_s = 10.0")):
            self.assertIn(before, text)
            text = text.replace(before, after)
        return self.serve("--mode", "realtime", text=text + '\n[realtime]\npacer = "sleep"\nmax_lateness_ms = 60000\n')

    def test_an_operator_drives_in_lockstep_by_keys(self):
        """Catches: a drive that needs more than the role operator, knobs that its own lease locks out, a time that does not
        stand still or makes other steps than it is told, Escape that leaves the gates on, a lease that the page keeps."""
        server = self.for_users()
        client = server.client(token="vera-secret")
        self.addCleanup(client.close)
        samples = []
        shown = self.play("drive", self.gateway(server).url, "otto-secret", outside=lambda _: samples.append(client.newest()))
        self.assertIn("lockstep: time stands still", shown["before"])
        self.assertEqual((shown["owner"], shown["free"]), ("this page", "none"))
        self.assertEqual(shown["arrived"], "20.00 Hz, 30.00 V")
        self.assertAlmostEqual(float(shown["speed"].split()[0]), 41.9, delta=1.0)  # 2 pi 20 Hz / 3 pole pairs
        self.assertIn("done at tick", shown["bump"])
        self.assertIn("give it back", shown["kept"])
        self.assertEqual(shown["steps"], 7)
        self.assertIn("gates are off", shown["stopped"])
        self.assertEqual((samples[0].faults & LATCHED, samples[0].state), (0, RUN))
        self.assertLess(abs(samples[0].true_i_a_a), 1e-9)

    def test_a_page_that_goes_ends_its_drive_in_order(self):
        """Catches: a motor that turns on without its operator, a session that ends with the gates on, which the bench latches as
        a loss of its controller, a lease that stays."""
        server = self.in_real_time()
        client = server.client()
        self.addCleanup(client.close)
        samples = {}

        def outside(what):
            if what == "gone":
                until(lambda: client.newest().owner == 0, "the lease of the page")
            samples[what] = client.newest()

        self.play("gone", self.gateway(server).url, outside=outside)
        self.assertIn(samples["turning"].state, (RUN, HOLD))
        self.assertEqual((samples["gone"].state, samples["gone"].faults & LATCHED), (IDLE, 0))
        self.assertLess(samples["gone"].speed_rad_s, 20.0)
        self.assertLess(abs(samples["gone"].true_i_a_a), 1e-9)

    def test_refusals_are_told_in_the_words_of_the_bench(self):
        """Catches: a refusal that the page swallows or rewords, and a number that it sends although it is none."""
        server = self.in_real_time()
        client = server.client()
        self.addCleanup(client.close)

        def outside(what):
            client.lease(pb.LeaseRequest.ACTION_ACQUIRE if what == "take" else pb.LeaseRequest.ACTION_RELEASE)

        shown = self.play("refused", self.gateway(server).url, outside=outside)
        self.assertIn("ramp, s: '-1' is no number from 0 to 3600", shown["ramp"])
        self.assertIn("target, V: '1e9' is no number from -1000000 to 1000000", shown["beyond"])
        self.assertRegex(shown["owned"], "^lease: .*holds the lease of the axis")

    def test_a_reference_controller_runs_as_drivebench_control_runs_it(self):
        """Catches: a preset that does not fit and is offered, a run that begins elsewhere or whose commands come for other ticks, numbers
        that are not those of `drivebench control`, a table that axe finds at fault, a lease that stays."""
        server = self.serve("--mode", "lockstep")
        shown = self.play("preset", self.gateway(server).url, "servo", "book/8.2.2")
        self.assertIn("book/8.2.2-backward-difference", shown["offered"])
        self.assertNotIn("book/9.1.4", shown["offered"])
        self.assertIn("8.2.2", shown["source"])
        self.assertEqual(shown["words"], "book/8.2.2: done, the gates are off")
        self.assertEqual((shown["owner"], shown["free"]), ("this page", "none"))
        self.assertEqual([each for each in shown["found"] if each["impact"] in ("serious", "critical")], [])
        alone = control(self.serve("--mode", "lockstep"), "book/8.2.2").stdout
        rows = [re.split(r"  +", line.strip(), maxsplit=1) for line in alone.splitlines()[1:]]
        expected = [row for row in rows if not row[0].startswith(("exchange", "wall"))]
        self.assertEqual([[name, " ".join(value.split())] for name, value in expected], shown["numbers"])
        self.assertEqual(len(expected), len(rows) - 4)

    def test_a_run_is_stopped_refused_and_ended_in_order(self):
        """Catches: Escape that leaves the gates on, a preset that does not fit and yet runs or is refused in other words than those
        of `drivebench control`, a page that goes and leaves its controller or its lease behind."""
        text = (BENCHES / "dc-unit.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        text = text.replace("period_us = 1000\n", "period_us = 1000\nwatchdog_ticks = 5000\nlease_s = 10.0\n")
        server = self.serve("--mode", "realtime", text=text + '\n[realtime]\npacer = "sleep"\nmax_lateness_ms = 60000\n')
        client = server.client()
        self.addCleanup(client.close)
        samples = {}

        def outside(what):
            if what != "running":
                until(lambda: abs(client.newest().true_i_a_a) < 1e-6, "the end of the current")
            if what == "gone":
                until(lambda: client.newest().owner == 0, "the lease of the page")
            samples[what] = client.newest()

        shown = self.play("presetStopped", self.gateway(server).url, "dc-unit", "book/2-sine", "book/8.2.2", outside=outside)
        self.assertEqual(shown["stopped"], ["stopped: the gates are off"] * 2)
        self.assertEqual("drivebench: " + shown["refused"] + "\n", control(server, "book/8.2.2").stderr)
        self.assertIn(samples["running"].state, (RUN, HOLD))
        self.assertGreater(abs(samples["running"].true_i_a_a), 1e-3)
        for what in ("stopped", "gone"):
            self.assertEqual(samples[what].faults & LATCHED, 0)
        self.assertEqual(samples["gone"].state, IDLE)

    def test_two_motors_on_one_amplifier_have_one_lease(self):
        """Catches: knobs of the second motor that want a lease which the bench gives to no session, a page that does not know that it
        holds both."""
        shown = self.play("shared", self.gateway(self.for_users(bench="two-steppers")).url, "otto-secret")
        for answer in shown["answers"].values():
            self.assertIn("load: done at tick", answer)
        self.assertEqual((shown["driven"], shown["taken"]), ("this page,this page",) * 2)
        self.assertEqual(shown["held"], ["Release the lease"] * 2)

    def test_axe_finds_no_serious_fault_while_the_page_drives(self):
        """Catches: a control of the drive without a name or out of the reach of keys, a Stop that one cannot read, fields in
        another unit than that of their set-points."""
        shown = self.play("driveAxe", self.gateway(self.serve("--mode", "lockstep")).url)
        self.assertEqual([each for each in shown["found"] if each["impact"] in ("serious", "critical")], [])
        self.assertEqual(shown["tabbed"], [])
        self.assertIn("amplitude at the target, V (servo)=0", shown["fields"]["rotating voltage"])


if __name__ == "__main__":
    if reason := missing():
        print(f"SKIPPED: {reason}")
        sys.exit(77)
    unittest.main(verbosity=2)
