"""`drivebench control`: gains by name, refusals before anything moves, and recordings against the reference."""
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from wire_client import BENCHES, PATIENCE_S, SERVER, Server, pb
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

COMMAND = SERVER.with_name("drivebench")
OK, FAILED, USAGE = 0, 1, 2
CLOSED_PORT = "tcp:127.0.0.1:1"


class ControlTest(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(temporary.name)
        self.addCleanup(temporary.cleanup)

    def control(self, *arguments, code=OK):
        done = subprocess.run([COMMAND, "control", *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE_S,
                              check=False)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def json_of(self, *arguments, code=OK):
        return json.loads(self.control("--json", *arguments, code=code).stdout)

    def move(self, server, *arguments):
        return self.json_of("--link", "tcp:%s:%d" % server.address, *arguments)

    def recording(self, name, *arguments, moves=1, bench="servo"):
        """The reference controller's own run, recorded by the server."""
        file = self.folder / f"{name}.mcap"
        with Server("--record", str(file), config=BENCHES / f"{bench}.toml") as server:
            reports = [self.move(server, *arguments) for _ in range(moves)]
            self.assertEqual(server.stop(), 0, server.errors())
        return file, reports[-1]


class Gains(ControlTest):
    def refusal(self, *arguments):
        return self.control("--link", CLOSED_PORT, *arguments, code=USAGE).stderr

    def test_a_wrong_gain_is_refused_before_anything_is_connected(self):
        """Catches: a misspelt gain that is ignored, a refusal that does not say which number breaks which rule."""
        self.assertIn("no gain 'current.prop'; did you mean \"current.proportional_v_per_a\"?",
                      self.refusal("--gain", "current.prop=7"))
        self.assertIn("position.derivative_per_s = -3 must not be negative", self.refusal("--gain", "position.derivative_per_s=-3"))
        both = self.refusal("--gain", "move.ramp_up_s=0", "--gain", "machine.inertia_kgm2=-1")
        self.assertIn("move.ramp_up_s = 0 must be positive", both)
        self.assertIn("machine.inertia_kgm2 = -1 must be positive", both)
        self.assertIn("NAME=VALUE", self.refusal("--gain", "move.ramp_up_s"))
        self.assertIn("not a number", self.refusal("--gain", "move.ramp_up_s=nan"))

    def test_a_move_beyond_the_limits_is_refused_before_anything_is_connected(self):
        """Catches: a limit that is met amid the move, a refusal that does not say which and when."""
        said = self.refusal("--preset", "book/2.18", "--gain", "move.ramp_up_s=0.02", "--gain", "move.ramp_down_s=0.02")
        self.assertRegex(said, r"armature current of \d\.\d+ A at 0\.0\d+ s is above the limit of 5 A")

    def test_gains_are_shown_as_they_would_be_used(self):
        """Catches: a list of gains that is not that of the preset, or that leaves an override out."""
        gains = self.json_of("--gains", "--gain", "run.hold_s=0.25")
        self.assertEqual(gains["run.hold_s"], 0.25)
        self.assertEqual(gains["current.proportional_v_per_a"], 6.4)
        listed = {preset["name"]: preset for preset in self.json_of("--list")}["book/8.2.2"]
        self.assertEqual(listed["gains"] | {"run.hold_s": 0.25}, gains)
        self.assertEqual(listed["machine_kind"], "induction")
        said = self.control("--gains").stdout
        for name in gains:
            self.assertRegex(said, rf"(?m)^  {name} +\S+$")

    def test_a_gain_changes_the_run(self):
        """Catches: an override that stops at the list. The rate as a gain makes one preset the other, bit for bit."""
        hashes = []
        for arguments in (["--preset", "book/8.2.2-4khz"], ["--gain", "sample_rate_hz=4000"],
                          ["--gain", "sample_rate_hz=4000", "--gain", "position.proportional_per_s2=6e5"]):
            with Server(config=BENCHES / "servo-4khz.toml") as server:
                self.assertEqual(self.move(server, *arguments)["samples"], 512)
                self.assertEqual(server.stop(), 0, server.errors())
            hashes.append(server.verdict["state_hash"])
        self.assertEqual(hashes[0], hashes[1])
        self.assertNotEqual(hashes[0], hashes[2])

    def test_a_gain_that_describes_the_axis_is_checked_against_it(self):
        """Catches: a controller told of 4000 counts that runs on an encoder of 2000."""
        with Server() as server:
            done = self.control("--link", "tcp:%s:%d" % server.address, "--gain", "counts_per_revolution=4000", code=USAGE)
        self.assertIn("encoder.counts_per_revolution is 2000 on the bench, 4000 in the preset", done.stderr)


class Compare(ControlTest):
    def test_the_references_own_recording_has_no_difference(self):
        """Catches: samples and commands joined a tick apart, and a second move that is taken for the first."""
        file, report = self.recording("own", moves=2)
        seen = self.json_of("--compare", file, "--threshold", 0)
        self.assertEqual((seen["first_tick"], seen["samples"], seen["whole"]), (0, 1024, True))
        self.assertEqual(seen["commands"], {"largest": 0.0, "largest_tick": 0, "rms": 0.0, "first_tick_beyond": None})
        seen = self.json_of("--compare", file, "--threshold", 0, "--from", report["first_tick"])
        self.assertEqual((seen["first_tick"], seen["samples"]), (report["first_tick"], 1024))
        self.assertAlmostEqual(seen["tracking"]["peak_error_counts"], report["peak_error_counts"], delta=1e-9)
        self.assertIsNone(seen["with"])

    def test_other_gains_are_noticed(self):
        """Catches: a comparison that is always content. At the first tick the reference asks for K_P times 5.88 A."""
        file, _ = self.recording("stiff", "--gain", "current.proportional_v_per_a=7")
        seen = self.json_of("--compare", file, "--threshold", 0.5, code=FAILED)
        self.assertEqual(seen["commands"]["first_tick_beyond"], 0)
        self.assertGreaterEqual(seen["commands"]["largest"], 0.6 * 5.88 - 1e-9)
        self.assertGreater(seen["commands"]["rms"], 0.1)
        self.assertEqual(seen["terminals"]["c"]["largest"], 0.0)
        self.json_of("--compare", file, "--threshold", 0, "--gain", "current.proportional_v_per_a=7")

    def test_a_controller_of_the_user_is_compared(self):
        """Catches: a comparison that needs a recording of the reference. 10 V on phase a, nothing else, for 40 ms."""
        file = self.folder / "mine.mcap"
        with Server("--record", str(file)) as server, server.client() as client:
            client.lease()
            for tick in range(320):
                client.step(tick, 10.0)
            client.lease(pb.LeaseRequest.ACTION_RELEASE)
            self.assertEqual(server.stop(), 0, server.errors())
        seen = self.json_of("--compare", file)
        self.assertEqual((seen["samples"], seen["whole"]), (320, False))
        self.assertEqual(seen["commands"]["first_tick_beyond"], 0)
        # 10 V drive the 5.88 A over 1.7 ohm; the reference, whose integrators have seen 4 A too much, would brake with all it has.
        self.assertEqual(seen["terminals"]["a"]["largest"], 90.0)
        # Standing still: what is left of the trajectory is all of it, 15 ms after its start.
        self.assertGreater(seen["tracking"]["peak_error_rad"], 0.1)
        self.assertIn("the recording does not hold the whole run", self.control("--compare", file).stdout)
        self.json_of("--compare", file, "--threshold", 1000, code=FAILED)

    def test_a_recording_without_its_end_fails(self):
        """Catches: a regression run that passes because the bench died in it: its samples until then do not differ."""
        held = ("--gain", "run.hold_s=0.5")
        file, _ = self.recording("own", *held)
        cut = self.folder / "cut.mcap"
        whole = file.read_bytes()
        cut.write_bytes(whole[:len(whole) * 6 // 10])
        done = self.control("--json", "--compare", cut, "--threshold", 0, *held, code=FAILED)
        seen = json.loads(done.stdout)
        self.assertEqual((seen["whole"], seen["commands"]["largest"]), (False, 0.0))
        self.assertRegex(done.stderr, "cut.mcap is not whole: .*the file ends")
        self.assertIn("not whole", self.control("--compare", file, "--with", cut, "--threshold", 0, *held).stderr)
        drawn = subprocess.run([COMMAND, "plot", cut], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        self.assertEqual((drawn.returncode, "<path" in drawn.stdout), (OK, True))
        self.assertIn("not whole", drawn.stderr)
        # Every sample of the run is there: what the file lost came after it.
        cut.write_bytes(whole[:-100])
        done = self.control("--json", "--compare", cut, "--threshold", 0, *held)
        self.assertEqual((json.loads(done.stdout)["whole"], "not whole" in done.stderr), (True, True))

    def test_two_recordings_are_compared_tick_by_tick(self):
        """Catches: runs that are laid beside each other at the wrong tick; the load comes 25 + 36.5 ms after the start."""
        plain, _ = self.recording("plain")
        loaded, _ = self.recording("loaded", "--load", "0.1@0.0365")
        seen = self.json_of("--compare", loaded, "--with", plain)["with"]
        self.assertGreater(seen["angle_rad"]["largest"], 1e-4)
        self.assertEqual(seen["angle_rad"]["first_tick_beyond"], 200 + 292 + 1)
        self.assertGreaterEqual(seen["commands"]["first_tick_beyond"], 200 + 292 + 1)
        same = self.json_of("--compare", plain, "--with", plain)["with"]
        self.assertEqual((same["commands"]["largest"], same["angle_rad"]["largest"]), (0.0, 0.0))

    def test_incomparable_recordings_are_refused(self):
        """Catches: a recording of another rate, axis or kind that gives numbers which mean nothing."""
        file, _ = self.recording("own")
        for arguments, fact in ((["--compare", file, "--preset", "book/8.2.2-4khz"], "is sampled at 8000 Hz, the preset at 4000 Hz"),
                                (["--compare", file, "--axis", "b"], "no samples of axis 'b'; the recording has servo"),
                                (["--compare", file, "--from", 100000], "has no commands"),
                                (["--compare", self.folder / "none.mcap"], "none.mcap"),
                                (["--compare", __file__], "is not a recording"),
                                (["--threshold", 1], "belong to --compare")):
            self.assertIn(fact, self.control(*arguments, code=USAGE).stderr)


class Plot(ControlTest):
    def plot(self, *arguments, code=OK):
        done = subprocess.run([COMMAND, "plot", *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, code, done.stderr)
        return done

    def test_a_recording_becomes_a_picture(self):
        """Catches: a panel that is not drawn, a picture that is no XML, lines of terminals that the machine does not have."""
        file, _ = self.recording("own")
        out = self.folder / "own.svg"
        self.plot(file, "--preset", "book/8.2.2", "--title", "a & b", "--out", out)
        picture = xml.etree.ElementTree.parse(out).getroot()
        texts = [each.text for each in picture.iter() if each.tag.endswith("text")]
        for text in ("a & b", "speed [rad/s]", "reference", "error [counts]", "i_a", "i_b", "u_b", "time [ms]"):
            self.assertIn(text, texts)
        self.assertNotIn("i_c", texts)
        self.assertEqual(sum(each.tag.endswith("path") for each in picture.iter()), 2 + 1 + 2 + 2)
        self.assertEqual(self.plot(file, "--panels", "angle").stdout.count("<path"), 1)

    def test_estimates_are_drawn_beside_the_truth(self):
        """Catches: an estimate that is not the controller's, a panel without one that looks as if it had one."""
        file, _ = self.recording("own")
        drawn = self.plot(file, "--preset", "book/8.2.2", "--panels", "flux,speed-estimate").stdout
        self.assertEqual((drawn.count("<path"), drawn.count(">estimate<")), (4, 2))
        drawn = self.plot(file, "--preset", "book/8.2.2", "--panels", "load").stdout
        self.assertEqual((drawn.count("<path"), drawn.count(">estimate<")), (1, 0))
        self.assertIn("the preset at 4000 Hz", self.plot(file, "--preset", "book/8.2.2-4khz", "--panels", "flux", code=USAGE).stderr)

    def test_a_run_without_commands_becomes_a_picture(self):
        """Catches: the line start of the README without a picture, signals that are left out or share a panel with another
        unit, a curve without a name, a picture that begins before --from."""
        file = self.folder / "start.mcap"
        subprocess.run([SERVER, BENCHES / "im-b.toml", "--port", "0", "--duration", "0.1", "--record", file],
                       capture_output=True, timeout=PATIENCE_S, check=True)
        drawn = self.plot(file).stdout
        for text in ("speed [rad/s]", "i_a", "i_b", "i_c", "u_c", str(file)):
            self.assertIn(f">{text}<", drawn)
        drawn = self.plot(file, "--signals", "torque_nm,speed_rad_s,load_nm").stdout
        texts = re.findall(r"<text[^>]*>([^<]*)</text>", drawn)
        self.assertEqual([text for text in texts if text.endswith(("[N*m]", "[rad/s]"))], ["[N*m]", "speed [rad/s]"])
        self.assertEqual(drawn.count("<path"), 3)
        self.assertIn("no samples of axis im-b from tick 5000 on", self.plot(file, "--from", 5000, code=USAGE).stderr)
        self.assertIn('did you mean "torque_nm"', self.plot(file, "--signals", "torqe_nm", code=USAGE).stderr)
        self.assertIn("--panels", self.plot(file, "--signals", "torque_nm", "--panels", "speed", code=USAGE).stderr)
        self.assertIn("has no commands", self.plot(file, "--preset", "book/8.2.2", code=USAGE).stderr)

    def test_names_stand_above_the_curves(self):
        """Catches: a legend that lies over the curves, or that many signals push out of the picture."""
        file, _ = self.recording("own")
        many = ("terminal_a_v,terminal_b_v,terminal_c_v,terminal_a_mean_v,terminal_b_mean_v,terminal_c_mean_v,bus_voltage_v,resolver_sin_v,"
                "resolver_cos_v,tachometer_v")
        drawn = self.plot(file, "--signals", "speed_rad_s,load_speed_rad_s," + many).stdout
        names = [(float(x), float(y)) for x, y in re.findall(r"<text x='([\d.]+)' y='([\d.]+)' style", drawn)]
        self.assertEqual(len(names), 2 + 10)
        panels = sorted({(float(top), float(bottom)) for top, bottom in re.findall(r"<line x1='[\d.]+' y1='([\d.]+)' x2='[\d.]+' y2='([\d.]+)'", drawn)
                         if top != bottom})
        self.assertEqual(len(panels), 2)
        for x, y in names:
            self.assertTrue(all(y < top or y > bottom for top, bottom in panels), (y, panels))
            self.assertLess(x + 80, 720)
        self.assertEqual(len({y for _, y in names}), 1 + 2, "ten names take two rows")

    def test_an_impossible_picture_is_refused(self):
        """Catches: an empty picture with an exit code of 0."""
        file, _ = self.recording("own")
        for arguments, fact in (([file, "--panels", "error"], "needs --preset"), ([file, "--panels", "flux"], "flux needs --preset"), ([file, "--panels", "heat"], "no panel 'heat'"),
                                ([__file__], "is not a recording"), ([file, "--preset", "book/8"], 'did you mean "book/8.2.2"'),
                                ([file, "--preset", "book/8.2.2", "--gain", "run.hold_s=1e300"], "at most 3600 s")):
            self.assertIn(fact, self.plot(*arguments, code=USAGE).stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
