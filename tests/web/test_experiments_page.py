#!/usr/bin/python3
"""Experiments and recordings in the page of `drivebench web`: browser/experiment_scenarios.mjs in Debian's chromium."""
import csv
import pathlib
import re
import sys
import tempfile
import unittest

from test_page import BENCHES, PATIENCE_S, PageTest, missing, pb, until
from experiment_test import endless, request


class ExperimentsPage(PageTest):
    def kept(self):
        """A folder for the experiments or a recording of a server."""
        folder = tempfile.TemporaryDirectory(prefix="drivebench-experiments-")
        self.addCleanup(folder.cleanup)
        return folder.name

    def bench(self, name="servo"):
        return self.serve("--mode", "lockstep", "--experiments", self.kept(), config=BENCHES / f"{name}.toml")

    def test_an_experiment_runs_and_its_data_are_shown(self):
        """Catches: a number that the page sends although it is none, a refusal that it swallows, data of other signals or ticks than
        were asked for, a limit that it does not send."""
        shown = self.play("experiment", self.gateway(self.bench()).url)
        self.assertIn("'long' is not a number", shown["wrong"])
        self.assertRegex(shown["refused"], r"duration_s comes to 8e\+12 ticks but must come to")
        self.assertEqual((shown["done"], shown["title"]), ("experiment 1: completed", "Experiment 1, data: spin"))
        self.assertEqual(shown["list"], {"number": "1", "title": "spin", "user": "browser", "state": "completed", "length": "500.0 ms",
                                         "rows": "4001"})
        self.assertEqual((shown["csv"][0], shown["rows"]), ("experiment-1.csv", 4001))
        header, first, later = (list(csv.reader([line]))[0] for line in shown["csv"][1:])
        self.assertEqual(header[:4], ["tick", "time_s", "speed_rad_s [rad/s]", "i_a_a [A]"])
        self.assertEqual((first[:3], later[:2]), (["0", "0.000000000", "0"], ["2000", "0.250000000"]))
        self.assertAlmostEqual(float(shown["row"]["newest"].split()[0]), 41.77, delta=0.05)  # 2 pi 20 Hz / 3 pole pairs, less the slip
        self.assertEqual(shown["facts"]["verdict"], "free run exact: 4001 ticks")

    def test_parameters_events_and_limits_reach_the_bench(self):
        """Catches: a form that leaves one of them out, which would let the motor run up."""
        shown = self.play("limited", self.gateway(self.bench()).url)
        self.assertEqual(shown["list"]["state"], "stopped by a limit")
        tick, speed = re.fullmatch(r"stopped by a limit: tick (\d+): the speed of ([\d.]+) rad/s is beyond the limit of 45 rad/s",
                                   shown["facts"]["state"]).groups()
        self.assertIn(int(tick), range(2400, 2410))  # the bump comes at 0.3 s
        self.assertLess(float(speed), 75)  # 0.03 N*m*s turn 0.001 kg*m^2 by 30 rad/s, and the bench's own inertia by 270

    def test_a_recording_is_played(self):
        """Catches: curves beyond the position of the slider, a play that goes on while it is paused or at another speed, a rotor
        that stands, a drawing with the values of another tick."""
        shown = self.play("played", self.gateway(self.bench()).url)
        self.assertEqual(shown["title"], "Experiment 1, recording: spin")
        self.assertRegex(shown["atEnd"], r"^41\.\d+ rad/s")
        self.assertEqual((shown["atStart"], shown["empty"]["peak to peak"]), ("0 rad/s", "0 rad/s"))
        self.assertGreater(shown["angles"], 3)
        self.assertEqual(shown["stood"], shown["stands"])
        self.assertLess(float(shown["stood"].split()[0]), 0.5)
        self.assertRegex(shown["newestSpeed"], r"^41\.\d+ rad/s")
        self.assertFalse(shown["shown"])

    def test_a_recording_of_two_axes_begins_with_that_of_the_experiment(self):
        """Catches: a recording that shows the signals of the other axis first, a command that identifies the other motor."""
        shown = self.play("second", self.gateway(self.bench("dynamometer")).url)
        self.assertEqual(shown["data"], ["speed_rad_s×", "i_a_a×", "u_a_v×"])
        self.assertEqual(shown["recording"], ["load.speed_rad_s×", "load.i_a_a×", "load.u_a_v×"])
        self.assertEqual(shown["trains"], 2)
        self.assertEqual(shown["identify"], "save it, then drivebench identify --motor dc --from experiment-1.mcap --axis load")

    def test_an_experiment_is_given_up(self):
        """Catches: a list without progress, a cancel that does not reach the bench."""
        shown = self.play("cancelled", self.gateway(self.bench()).url)
        self.assertLess(shown["progress"], 0.9)
        self.assertEqual((shown["running"]["state"], shown["list"]["state"]), ("running", "cancelled"))

    def test_a_viewer_reads_what_is_shared_and_asks_for_nothing(self):
        """Catches: a form or a button that only the server's refusal stops, details of another owner's experiment, a page that
        shows a viewer nothing."""
        server = self.for_users("--experiments", self.kept())
        client = server.client(token="otto-secret")
        self.addCleanup(client.close)
        for wanted in (request(label="shared", shared=True), request(label="private"), endless(label="long", shared=True)):
            client.ask(run_experiment=wanted)
        until(lambda: [each.state for each in client.ask(list_experiments=pb.ListExperiments()).experiment_list.experiments][2:]
              == [pb.EXPERIMENT_STATE_RUNNING], "the end of the first two")
        shown = self.play("lookers", self.gateway(server).url, "vera-secret")
        self.assertEqual((shown["titles"], shown["form"]), (["long", "(another owner's)", "shared"], 0))
        self.assertEqual(shown["buttons"], ["Show data experiment 1", "Play recording experiment 1", "Use the secret"])
        self.assertEqual(shown["title"], "Experiment 1, data: shared")

    def test_a_file_is_played_and_another_is_refused(self):
        """Catches: a reader that takes any file, or that reads a recording of the live bench wrongly: its time, its axis."""
        recording, bad = self.recording(), self.folder / "bad.mcap"
        bad.write_bytes(b"no recording at all")
        shown = self.play("files", self.gateway(self.bench()).url, recording, bad)
        self.assertEqual((shown["opened"], shown["title"]), ("live.mcap is open", "Recording live.mcap"))
        self.assertRegex(shown["time"], r"^0\.2499 s of 249\.9 ms|^0\.2500 s of 250\.0 ms")
        self.assertIn("file is no recording: it does not begin like an MCAP file", shown["refused"])
        self.assertEqual(shown["still"], "Recording live.mcap")

    def recording(self):
        """Of a quarter of a second of a motor that starts."""
        path = pathlib.Path(self.kept()) / "live.mcap"
        self.serve("--mode", "free", "--duration", "0.25", "--record", str(path), config=BENCHES / "im-b.toml").process.wait(PATIENCE_S)
        return path

    def test_a_player_that_closes_gives_its_plots_back(self):
        """Catches: plots, and with them whole recordings, that stay when the player opens another one or a pane goes; a drag in the
        player that zooms and pauses the scope of the bench."""
        shown = self.play("reopened", self.gateway(self.bench()).url, self.recording())
        self.assertEqual((shown["often"], shown["live"]), (shown["once"], "Pause"))
        self.assertLess(shown["closed"], shown["once"])
        self.assertLess(shown["removed"], shown["closed"])

    def test_the_player_stays_with_its_user(self):
        """Catches: an experiment that ends and puts its data in the place of what is played."""
        shown = self.play("undisturbed", self.gateway(self.bench()).url, self.recording())
        self.assertEqual(shown, {"told": "experiment 1: completed", "title": "Recording live.mcap", "progress": False})

    def test_a_bench_without_experiments_says_so(self):
        """Catches: an empty list where the bench refuses, a refusal in other words than the bench's, a form that leads to nothing."""
        shown = self.play("none", self.gateway(self.serve("--mode", "lockstep")).url)
        self.assertIn("this bench keeps no experiments", shown["note"])
        self.assertFalse(shown["form"])

    def test_axe_finds_no_serious_fault(self):
        """Catches: a field of the form without a name or out of the reach of keys, a focus that goes with a row, a position of the
        player that a screen reader tells with each picture."""
        shown = self.play("experimentAxe", self.gateway(self.bench()).url)
        self.assertEqual([each for each in shown["found"] if each["impact"] in ("serious", "critical")], [])
        self.assertEqual((shown["missing"], shown["focus"], shown["live"]), ([], "Add shape", "off"))


if __name__ == "__main__":
    if reason := missing():
        print(f"SKIPPED: {reason}")
        sys.exit(77)
    unittest.main(verbosity=2)
