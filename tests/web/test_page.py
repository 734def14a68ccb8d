#!/usr/bin/python3
"""The page of `drivebench web` in Debian's chromium, driven by puppeteer-core: browser/scenarios.mjs does what a user would."""
import csv
import io
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "helpers"))
import npm_package
from web_client import PAGE, Gateway
from wire_client import BENCHES, REPOSITORY, Server, pb
from wire_test import until

PATIENCE_S = 180
USERS = "".join(f'[[token]]\nname = "{name}"\nrole = "{role}"\ntoken = "{name}-secret"\n'
                for name, role in (("vera", "viewer"), ("otto", "operator"), ("cora", "conductor")))


class Controller(threading.Thread):
    """Drives an axis in lockstep until it is stopped, slowly enough that a browser follows. What it did stands in `samples`."""

    def __init__(self, client):
        super().__init__()
        self.client = client
        self.samples = []
        self.over = threading.Event()
        client.lease()
        self.start()

    def run(self):
        while not self.over.wait(0.001):
            self.samples.append(self.client.step(len(self.samples)))

    def stop(self):
        self.over.set()
        self.join()


def missing():
    """What this machine lacks for the page or the browser; empty: nothing."""
    if not PAGE.exists():
        return f"the page was not built (node and npm): no {PAGE}"
    for program, package in (("node", "nodejs"), ("npm", "npm"), ("chromium", "chromium")):
        if shutil.which(program) is None:
            return f"no {program} (Debian: apt install {package})"
    return ""


def text_for_users(folder, bench="servo"):
    """A bench file that knows a viewer, an operator and a conductor."""
    tokens = folder / "tokens"
    tokens.write_text(USERS, encoding="utf-8")
    tokens.chmod(0o600)
    text = (BENCHES / f"{bench}.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
    access = f'[tcp]\ntokens_file = "{tokens}"'
    return text.replace("[tcp]", access) if "[tcp]" in text else f"{text}\n{access}\n"


class PageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="drivebench-page-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.package = cls.folder / "browser"
        npm_package.install(HERE / "browser", cls.package)

    def serve(self, *options, **more):
        server = Server(*options, **more)
        self.addCleanup(server.__exit__)
        return server

    def gateway(self, server, *options, **more):
        gateway = Gateway(server, *options, **more)
        self.addCleanup(gateway.__exit__)
        return gateway

    def play(self, scenario, url, *arguments, outside=None):
        """What the page showed. `outside` is called with each request of the scenario."""
        command = ["node", "scenarios.mjs", scenario, url, *map(str, arguments)]
        process = subprocess.Popen(command, cwd=self.package, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True)
        self.addCleanup(lambda: process.poll() is None and process.kill())
        last = ""
        for line in process.stdout:
            last = line
            if line.startswith("ask "):
                outside(line.split()[1])
                process.stdin.write("done\n")
                process.stdin.flush()
        _, problems = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, 0, problems)
        shown = json.loads(last)
        self.assertEqual(shown.pop("complaints"), [], "the browser complains: scripts, or what the policy forbids")
        return shown

    def assert_identified(self, shown, expected):
        """The page shows the table of an identification with its intervals, its verdict and its plot, and axe finds no serious fault."""
        self.assertEqual([row[0] for row in shown["rows"]], sorted(expected))
        for name, estimate, interval, unit, truth, inside in shown["rows"]:
            self.assertEqual((unit, inside), (expected[name]["unit"], "yes"))
            for text, value in ((estimate, "estimate"), (interval, "interval"), (truth, "truth")):
                self.assertAlmostEqual(float(text), expected[name][value], delta=1e-3 * expected[name][value])
        self.assertIn("the data see every parameter", shown["text"])
        self.assertEqual(shown["plot"], 720)  # wide, and so it was loaded
        self.assertEqual([each for each in shown["found"] if each["impact"] in ("serious", "critical")], [])

    def for_users(self, *options, bench="servo"):
        """A bench in lockstep that knows a viewer, an operator and a conductor."""
        return self.serve("--mode", "lockstep", *options, text=text_for_users(self.folder, bench))


class Page(PageTest):
    def on_the_line(self):
        """A motor on the line turns by itself. At 1 kHz, which the browser of a busy machine can follow."""
        text = (BENCHES / "im-b.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        text = text.replace("period_us = 100\n", "period_us = 1000\nsubsteps = 20\n")
        return self.serve("--mode", "realtime", text=text + '\n[realtime]\npacer = "sleep"\nmax_lateness_ms = 60000\n')

    def test_the_page_finds_the_bench_and_shows_its_speed(self):
        """Catches: a page that stays empty, decodes wrongly, or exports another thing than it shows; a verdict in other words than the
        server's, a transport that is left out."""
        shown = self.play("look", self.gateway(self.on_the_line()).url)
        self.assertEqual((shown["name"], shown["link"]), ("im-b", "connected"))
        self.assertRegex(shown["facts"], r"^real time, 1000 Hz, role admin")
        self.assertEqual((shown["plots"], shown["knobs"]), (3, True))
        self.assertRegex(shown["verdict"], r"^(real-time valid so far: \d+ ticks, none late|not real-time valid: \d+ of \d+ ticks late), worst lateness")
        self.assertEqual(shown["transports"], "Transports: 1, all up")
        self.assertRegex(shown["counts"], r"^sessions \d+, turned_away 0, ")
        self.assertGreater(float(shown["speed"]["maximum"].split()[0]), 1.0)
        self.assertEqual(shown["csv"][0], "im-b.csv")
        self.assertTrue(shown["csv"][1].startswith("tick,time_s,speed_rad_s [rad/s],i_a_a [A]"))
        row = shown["csv"][2].split(",")
        self.assertAlmostEqual(int(row[0]) * 1e-3, float(row[1]))
        self.assertIn("<svg", shown["svg"])

    def test_the_drive_train_is_drawn_and_its_rotor_turns(self):
        """Catches: a rotor that stands while the motor turns, values of another axis or in other units, an amplitude that is
        that of one phase at one moment."""
        shown = self.play("train", self.gateway(self.on_the_line()).url)
        self.assertEqual(shown["titles"], ["source", "induction", "load"])
        self.assertGreater(shown["angles"], 5)
        self.assertRegex(shown["note"], r"^drawn (\d\.\d|\d\d+) times slower$")
        self.assertEqual(shown["values"]["voltage"], "u 169.8 V")  # the line has 169.83 V
        for name, unit in (("current", "A"), ("torque", "N\\*m"), ("load", "N\\*m"), ("speed", "rad/s")):
            self.assertRegex(shown["values"][name], rf"^(i )?-?[\d.]+ [nmµk]?{unit}$")

    def test_a_pane_shows_a_locus_and_a_spectrum(self):
        """Catches: axes without units, x and y exchanged, a locus without the dot of a cursor, a spectrum of other samples than
        those of the window or with another amplitude than the motor's supply gives it, a logarithmic axis with linear numbers, a cursor
        that keys do not move."""
        server = self.on_the_line()
        shown = self.play("kinds", self.gateway(server).url)
        self.assertEqual((shown["size"], shown["chips"][0]), (320, "X: i_a_a×"))
        for words in ("i_a_a [A]", "[A]", "i_b_a", "i_c_a", "time [s]"):
            self.assertIn(f">{words}</text>", shown["svg"])
        self.assertEqual(shown["ends"][:3], ["to 500 Hz", "to 200 Hz", "to 100 Hz"])
        self.assertIn(">amplitude [V]</text>", shown["spectrum"])
        for phase in "abc":  # the line has 169.83 V and 60 Hz
            self.assertRegex(shown["peaks"], rf"u_{phase}_v: 169\.8 V at (59\.99|60\.0[01]) Hz")
        at_cursor = re.match(r"at 60\.00 Hz: u_a_v ([\d.]+) V, u_b_v", shown["cursor"])
        self.assertAlmostEqual(float(at_cursor[1]), 169.8, delta=7.0)  # between two steps up to 4 % lower
        self.assertLess(shown["steps"], 2.0)
        self.assertNotEqual(shown["above"][:12], shown["cursor"][:12])
        self.assertIn(">1000</text>", shown["logarithmic"])  # the decade above 169.8 V

    def test_a_trigger_catches_a_fault_of_one_tick(self):
        """Catches: a trigger on what is drawn instead of every sample, a window at the wrong tick, a spike that decimation
        loses."""
        shown = self.play("trigger", self.gateway(self.on_the_line()).url)
        tick = int(re.search(r"triggered at tick (\d+)", shown["state"])[1])
        self.assertIn("done at tick", shown["answer"])
        self.assertEqual(shown["row"]["maximum"], "1")
        rows = list(csv.DictReader(io.StringIO(shown["csv"].partition("\n")[2])))
        injected = {int(row["tick"]): row["injected [bits]"] for row in rows}
        # On a busy machine the end of the fault may come some ticks late.
        self.assertEqual(min(each for each, word in injected.items() if word not in ("0", "")), tick)
        self.assertLess(min(injected), tick - 50)
        self.assertGreater(max(injected), tick + 20)
        self.assertEqual(shown["mcap"], "im-b.mcap")

    def test_web_08_a_trigger_misses_nothing_while_the_page_hears_nothing(self):
        """Catches: a trigger that looks at what the browser got, a window with the gaps that the page has."""
        server = self.serve("--mode", "realtime", config=BENCHES / "im-b.toml")  # at 10 kHz: more than the sockets hold
        shown = self.play("slowTrigger", self.gateway(server).url)
        self.assertRegex(shown["lost"], r"^\d+ samples lost")
        tick = int(re.search(r"triggered at tick (\d+)", shown["state"])[1])
        injected = {int(row["tick"]): row["injected [bits]"] for row in csv.DictReader(io.StringIO(shown["csv"].partition("\n")[2]))}
        # On a busy machine the end of the fault may come some ticks late.
        self.assertEqual(min(each for each, word in injected.items() if word != "0"), tick)
        self.assertEqual(sorted(injected), list(range(min(injected), max(injected) + 1)), "every tick of the window")
        self.assertGreater(len(injected), 1000)

    def test_a_band_of_one_tick_triggers_and_the_hold_off_keeps_the_next_away(self):
        """Catches: a band that is seen at the rate of drawing, a hold-off that does not hold or does not end, a band whose upper end
        lies below the lower and is taken."""
        shown = self.play("band", self.gateway(self.on_the_line()).url)
        self.assertEqual(shown["invalid"], "true")
        triggered = [[each for each in shown[part] if each.startswith("triggered")] for part in ("held", "after")]
        self.assertEqual((len(triggered[0]), len(triggered[1])), (1, 2), shown)

    def test_a_state_that_is_entered_triggers(self):
        """Catches: a trigger on a state that lasts, on another state, or on the tick after."""
        text = (BENCHES / "servo.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        self.assertIn("over_current_trip = false", text)
        server = self.serve("--mode", "lockstep", text=text.replace("over_current_trip = false", "over_current_trip = true"))
        shown = self.play("stateEntered", self.gateway(server).url)
        tick = int(re.search(r"triggered at tick (\d+)", shown["state"])[1])
        rows = {int(row["tick"]): row["state [enum]"] for row in csv.DictReader(io.StringIO(shown["csv"].partition("\n")[2]))}
        self.assertEqual((rows[tick], rows[tick - 1]), ("4", "1"))  # fault after run
        self.assertEqual({state for each, state in rows.items() if each >= tick}, {"4"})

    def test_a_knob_out_of_range_is_refused_in_words(self):
        """Catches: a refusal that the page swallows or rewords, and a value that it sends although it is no number."""
        shown = self.play("knobs", self.gateway(self.on_the_line()).url, "machine.rotor_resistance_ohm", "-1", "2.5")
        self.assertRegex(shown["refused"], r"machine\.rotor_resistance_ohm: .*-1.*")
        self.assertIn("'much' is not a number", shown["word"])
        self.assertIn("done at tick", shown["done"])
        self.assertEqual((shown["inForce"], shown["owner"], shown["released"]), ("2.5", "this page", "none"))

    def test_a_viewer_sees_no_knobs(self):
        """Catches: knobs that only the server's refusal stops, a token that the page does not ask for or keeps after a
        refusal."""
        shown = self.play("viewer", self.gateway(self.for_users()).url, "vera-secret")
        self.assertIn("token", shown["asked"])
        self.assertIn("role viewer, user vera", shown["facts"])
        self.assertEqual((shown["knobs"], shown["buttons"]), (False, 0))

    def test_a_conductor_changes_what_another_client_drives(self):
        """Catches: knobs that want the lease of a driven axis, faults that end with another lease, a page that conducts
        whatever its role, so that an operator is turned away."""
        server = self.for_users()
        url = self.gateway(server).url
        client = server.client(token="otto-secret")
        self.addCleanup(client.close)
        controller = Controller(client)
        self.addCleanup(controller.stop)
        shown = self.play("beside", url, "otto-secret")
        self.assertIn("role operator, user otto", shown["facts"])
        for answer in shown["answers"].values():
            self.assertIn("holds the lease of the axis: otto", answer)
        shown = self.play("beside", url, "cora-secret")
        self.assertIn("role conductor, user cora", shown["facts"])
        self.assertIn("holds the lease of the axis: otto", shown["answers"].pop("Clear faults"))
        for answer in shown["answers"].values():
            self.assertIn("done at tick", answer)
        samples = controller.samples
        until(lambda: any(a.injected and not b.injected for a, b in zip(samples, samples[1:])), "the end of the fault")
        controller.stop()
        parameters = client.ask(read_parameters=pb.ReadParameters()).parameter_values.parameters
        self.assertEqual({each.value for each in parameters if each.name == "machine.rotor_resistance_ohm"}, {2.5})
        self.assertEqual({each.owner for each in samples}, {client.owner})
        self.assertEqual((samples[0].load_nm, samples[-1].load_nm), (0.0, 0.25))
        faulty = [each.tick for each in samples if each.injected]
        self.assertEqual(faulty, list(range(faulty[0], faulty[0] + 7)))
        self.assertGreater(max(abs(each.speed_rad_s) for each in samples), 1.0)

    def test_an_operator_changes_an_axis_that_nobody_drives(self):
        """Catches: a page that needs the right to conduct, a fault that is told as done though it was dropped with the lease of a
        moment, because the bench stands."""
        shown = self.play("beside", self.gateway(self.for_users()).url, "otto-secret")
        self.assertRegex(shown["answers"].pop("Inject"), r"the bench stands at tick 0: what was to act at tick \d+ has ended with the lease")
        for answer in shown["answers"].values():
            self.assertIn("done at tick", answer)

    def test_a_lost_server_is_shown_and_found_again(self):
        """Catches: a page that shows old values as if they were new, or must be loaded again."""
        path = self.folder / "lost.sock"
        servers = [self.serve("--mode", "free", "--unix", str(path))]

        def outside(what):
            if what == "stop":
                servers[-1].stop()
            else:
                servers.append(self.serve("--mode", "free", "--unix", str(path)))

        shown = self.play("lost", self.gateway(None, link=f"unix:{path}").url, outside=outside)
        self.assertIn("lost", shown["link"])
        self.assertRegex(shown["alert"], "ended|nothing answers")
        self.assertEqual((shown["again"], shown["alertShown"]), ("connected", False))

    def test_keys_alone_suffice(self):
        """Catches: a control that only a mouse reaches, and plots without keys."""
        shown = self.play("keyboard", self.gateway(self.on_the_line()).url)
        for control in ("Pause", "window", "trigger condition", "Take the lease", "Clear faults", "Set load", "Bump", "Inject",
                        "set machine.rotor_resistance_ohm", "add a signal to this pane", "kind of this pane", "theme: system"):
            self.assertIn(control, shown["reached"])
        self.assertTrue(shown["paused"])
        self.assertIn("Between the cursors", shown["caption"])
        self.assertEqual(shown["missing"], [])

    def test_axe_finds_no_serious_fault(self):
        """Catches: a control without a name, too little contrast in one of the themes."""
        shown = self.play("axe", self.gateway(self.on_the_line()).url)
        self.assertEqual([each for each in shown["found"] if each["impact"] in ("serious", "critical")], [])

    def test_the_first_page_is_small(self):
        """Catches: a dependency that makes the page slow to load."""
        self.assertLess(sum(each.stat().st_size for each in PAGE.parent.iterdir()), 400_000)


if __name__ == "__main__":
    if reason := missing():
        print(f"SKIPPED: {reason}")
        sys.exit(77)
    unittest.main(verbosity=2)
