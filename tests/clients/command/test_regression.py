#!/usr/bin/python3
"""`drivebench test`: suites over presets and programs, verdicts, exit codes and reports."""
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time
import unittest
import xml.etree.ElementTree
import zipfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from regression_case import COMMAND, DRIVES, FAILED, INVALID, OK, PROGRAM, SERVO, USAGE, RegressionTest
    from wire_client import PATIENCE_S, REPOSITORY, SERVER
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

SUITES = REPOSITORY / "configs/suites"


def with_fault(name, value):
    """A fault between the controller and its motor from the first tick on."""
    step = f'\n[[step]]\nat_s = 0.0\nfault = "{name}"\nvalue = {value}\n\n[[check]]\n'
    return lambda case: case.replace("\n[[check]]\n", step, 1)


def with_gain(name, value):
    return lambda case: case.replace("\n\n[[", f'\n\n[dut.gains]\n"{name}" = {value}\n\n[[', 1)


def with_text(old, new):
    return lambda case: case.replace(old, new)


# Drives in real time, and once stops its bench, which it finds by the folder of its socket, for 30 ms.
STOPS_ITS_BENCH = """import os, pathlib, signal, time
import drivebench
folder = os.path.dirname(os.environ["DRIVEBENCH_LINK"].split(":", 1)[1])
def works_there(process):
    try:
        return os.readlink(process / "cwd") == folder
    except OSError:
        return False
server = next(int(p.name) for p in pathlib.Path("/proc").iterdir() if p.name.isdigit() and works_there(p))
with drivebench.Bench(os.environ["DRIVEBENCH_LINK"]) as bench:
    bench.acquire()
    sample = bench.newest()
    while sample.tick < 100:
        try:
            sample = bench.step(voltages=1.0)
        except drivebench.Refused:
            sample = bench.newest()
        if server and sample.tick > 50:
            os.kill(server, signal.SIGSTOP)
            time.sleep(0.03)
            os.kill(server, signal.SIGCONT)
            server = 0
"""

# Defects of a controller: the case of the suite `reference`, what is wrong, and the check that tells it.
DEFECTS = (
    ("induction/move", "counts backwards", with_fault("encoder_swapped", 1), "arrives"),
    ("induction/move", "the other sign of each current", with_fault("current_sensor_gain", -1.0), "moves as planned"),
    ("induction/move", "half of each current is missing", with_fault("current_sensor_gain", 0.5), "moves as planned"),
    ("induction/move", "a weak position loop", with_gain("position.proportional_per_s2", 20000.0), "arrives"),
    ("induction/move", "differences in the place of an observer", with_text("book/8.2.2", "book/8.2.2-clipped-backward-difference"),
     "does not run past it"),
    ("induction/move", "a rotor resistance of a quarter", with_gain("machine.rotor_resistance_ohm", 1.0), "keeps to its current"),
    ("induction/high_speed", "no field weakening", with_text("8.2.5-soft-flux", "8.2.5-constant-flux"), "gets up to speed"),
    ("dc/load", "no integral", with_text('"book/2.21"', '"book/2.21-no-integral"'), "comes back"),
    ("dc/position", "hardly any damping", with_gain("position.derivative_per_s", 10.0), "moves as planned"),
    ("dc/loop_margins", "a current loop with too much gain", with_text('proportional_v_per_a" = 10.0', 'proportional_v_per_a" = 13.0'),
     "the current loop has its margins"),
    ("dc/loop_margins", "one sample late", with_fault("command_delay", 1), "the current loop has its margins"),
    ("synchronous/two_phase_move", "one sample late", with_fault("command_delay", 1), "arrives"),
    ("synchronous/high_speed", "no lead against the delay of a tick", with_text("9.7-3000rpm", "9.7-3000rpm-no-lead"), "arrives"),
    ("synchronous/brushless", "a Hall line without a signal", with_fault("hall_stuck_low", 1), "arrives"),
    ("synchronous/wound_rotor_weakened", "the field of rest at full speed", with_text("wound-rotor/field-weakening",
                                                                                      "wound-rotor/constant-field"), "moves as planned"),
    ("stepper/train", "steps faster than the rotor", with_text("train-200", "train-400"), "makes its steps"),
)


class Presets(RegressionTest):
    def test_a_failed_check_names_its_value_its_limit_and_its_time(self):
        """Catches: exit code 0 after a failure, a report that does not say where it was worst."""
        self.write("servo.toml", SERVO.replace("6.0", "5.0"))
        done = self.run_test(self.folder / "suite", "--github", code=FAILED)
        self.assertRegex(done.stdout, r"(?m)^fail +servo +0\.128 s +1 check$")
        self.assertRegex(done.stdout, r"current: at least -5\.46\d* A, min -5 A, at 0\.\d+ s \(line 4\)")
        self.assertIn("1 failed;", done.stdout)
        self.assertRegex(done.stdout, r"(?m)^::error file=.*servo\.toml,line=4,title=fail servo::current: ")

    def test_a_matrix_runs_every_combination_and_its_values_matter(self):
        """Catches: a matrix whose values do not reach the bench."""
        self.write("servo.toml", SERVO + """[[step]]
at_s = 0.06
load_nm = 0.1
[matrix]
step.0.load_nm = [0.0, 0.1]
override.axis.servo.machine.rotor_resistance_ohm = [3.9, 5.85]
""")
        cases = self.suite()["cases"]
        self.assertEqual([case["name"] for case in cases],
                         [f"servo[load_nm={load}, rotor_resistance_ohm={ohm}]" for load in ("0.0", "0.1") for ohm in (3.9, 5.85)])
        self.assertEqual(len({case["hash"] for case in cases}), 4)

    def test_reports_are_the_same_bytes_for_any_number_of_jobs(self):
        """Catches: an order or a number in a report that depends on threads or on the clock."""
        self.write("servo.toml", SERVO + "[matrix]\nseed = {from = 1, to = 6}\n")
        reports = []
        for jobs in (1, 3):
            names = [self.folder / f"{jobs}.{kind}" for kind in ("json", "xml")]
            out = self.run_test(self.folder / "suite", "--jobs", jobs, "--tap", "--json", names[0], "--junit", names[1]).stdout
            reports.append((out, *(name.read_bytes() for name in names)))
        self.assertEqual(reports[0], reports[1])
        self.assertEqual(len(xml.etree.ElementTree.fromstring(reports[0][2]).findall("./testsuite/testcase")), 6)

    def test_a_loaded_machine_gives_the_same_bytes(self):
        """Catches: a result in lockstep that depends on how fast the machine is: a time limit that counts its time, a sample that is left out."""
        self.write("device.py", DRIVES.format(until=10 ** 9))
        self.write("program.toml", PROGRAM.format(limit_s=120) + "[matrix]\nseed = [1, 2]\n")
        self.write("servo.toml", SERVO)
        quiet = self.reports("--jobs", 2)
        burners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4)]
        try:
            loaded = self.reports("--jobs", 2)
        finally:
            for burner in burners:
                burner.kill()
                burner.wait()
        self.assertEqual(quiet, loaded)

    def reports(self, *arguments, code=OK):
        """The bytes of all reports."""
        names = [self.folder / f"report.{kind}" for kind in ("json", "xml", "html")]
        out = self.run_test(self.folder / "suite", *arguments, "--tap", "--json", names[0], "--junit", names[1], "--html", names[2],
                            code=code).stdout
        return out, *(name.read_bytes() for name in names)

    def test_shards_in_any_number_and_order_merge_to_the_same_bytes(self):
        """Catches: a case that no shard runs, a result that a killed or repeated task leaves wrong, a report that depends on who
        ran what."""
        self.write("servo.toml", SERVO + "[matrix]\nseed = {from = 1, to = 6}\ncheck.0.abs = [5.4, 6.0]\n")
        whole = self.reports(code=FAILED)
        self.assertIn(b"<svg", whole[3])
        for count in (1, 4, 15):
            folders = [self.folder / f"{count}-{index}" for index in range(count)]
            for index, folder in enumerate(folders):
                shard = ("--shard", f"{index + 1}/{count}", "--results", folder)
                subprocess.run(["timeout", "-s", "KILL", "0.05", COMMAND, "test", self.folder / "suite", *map(str, shard)], check=False,
                               env=self.environment, capture_output=True)
                for _ in range(2):
                    has_failed = any(place % 2 == 0 for place in range(index, 12, count))
                    self.run_test(self.folder / "suite", *shard, code=FAILED if has_failed else OK)
            merged = [word for folder in reversed(folders) for word in ("--merge", folder)]
            self.assertEqual(self.reports(*merged, code=FAILED), whole, count)
        done = self.run_test(self.folder / "suite", "--merge", self.folder / "4-0", code=FAILED)
        self.assertIn("no folder has a result of this case as it is now", done.stdout)
        self.assertIn("9 errors", done.stdout)
        self.run_test(self.folder / "suite", "--merge", self.folder / "none", code=USAGE)
        self.run_test(self.folder / "suite", "--shard", "5/4", code=USAGE)

    def test_a_page_of_many_cases_stays_small_and_shows_their_spread(self):
        """Catches: a page that no browser can show; statistics without the extremes, or with the wrong case beside them."""
        self.write("servo.toml", SERVO + '[matrix]\n"check.0.abs" = {from = 5.0, to = 7.0, count = 1100}\n')
        page = self.folder / "page.html"
        self.run_test(self.folder / "suite", "--jobs", 2, "--html", page, code=FAILED)
        html = page.read_text(encoding="utf-8")
        self.assertLess(len(html), 3_000_000)
        self.assertIn("<td>current<td class=n>1100<td class=n>", html)
        self.assertIn("servo[abs=5.0]</tr>", html)
        failed = int(re.search(r"(\d+) failed", html)[1])
        self.assertIn(f"<p>{failed - 100} more have not passed", html)
        self.assertEqual(html.count("<h2>"), 100)

    def test_a_run_goes_on_where_an_earlier_one_ended(self):
        """Catches: cases that run again for nothing, and results of a case as it was before it changed."""
        self.write("servo.toml", SERVO + "[matrix]\nseed = {from = 1, to = 6}\n")
        suite, kept = self.folder / "suite", ("--results", self.folder / "results")
        self.run_test(suite, "--filter", "seed=3", *kept)
        self.assertIn("1 of the results are from before", self.run_test(suite, *kept).stdout)
        again = self.run_test(suite, *kept).stdout
        self.assertIn("6 passed", again)
        self.assertIn("6 of the results are from before", again)
        self.write("servo.toml", SERVO + "[matrix]\nseed = {from = 1, to = 7}\n")
        self.assertNotIn("from before", self.run_test(suite, *kept).stdout)

    def test_a_failed_case_is_kept_and_can_be_replayed(self):
        """Catches: a recording of another run than the one that failed, a bench that nobody can serve."""
        self.write("servo.toml", SERVO.replace("6.0", "5.0") + "[matrix]\ncheck.0.abs = [5.0, 6.0]\n")
        kept, page = self.folder / "kept", self.folder / "page.html"
        self.run_test(self.folder / "suite", "--keep", kept, "--html", page, code=FAILED)
        self.assertEqual([path.name for path in kept.iterdir()], ["servo[abs=5.0].zip"])
        case = self.folder / "unpacked"
        with zipfile.ZipFile(kept / "servo[abs=5.0].zip") as bundle:
            bundle.extractall(case)
        subprocess.run([SERVER, "--check-config", case / "bench.toml"], check=True, capture_output=True)
        subprocess.run([SERVER, "--replay", case / "run.mcap"], check=True, capture_output=True)
        exported = subprocess.run([COMMAND, "export", case / "run.mcap", "--signals", "i_a_a"], check=True, capture_output=True,
                                  text=True).stdout.splitlines()[1:]
        self.assertAlmostEqual(min(float(line.split(",")[2]) for line in exported[:1025]), -5.4648, places=4)
        html = page.read_text(encoding="utf-8")
        self.assertEqual(html.count("<svg"), 1)
        self.assertIn('<a href="kept/servo%5Babs%3D5.0%5D.zip">', html)
        self.assertIn("current: at least -5.4648 A, min -5 A", html)
        self.assertNotIn("http://", html.replace("http://www.w3.org/2000/svg", ""))

    def test_equal_runs_leave_equal_bundles(self):
        """Catches: a date or the name of a temporary folder in a bundle, ticks after the end of a case."""
        self.write("servo.toml", SERVO.replace("6.0", "5.0"))
        self.write("case.toml", PROGRAM.format(limit_s=60).replace("i_a_a < 30", "i_a_a < 0.1"))
        # How the link ends, closed or reset, depends on the machine: the device keeps it to itself.
        self.write("device.py", "try:\n    " + DRIVES.format(until=10 ** 9).strip().replace("\n", "\n    ") +
                   "\nexcept drivebench.LinkLost:\n    print('the bench has ended')\n")
        bundles = []
        for kept in (self.folder / "one", self.folder / "two"):
            self.run_test(self.folder / "suite", "--keep", kept, code=FAILED)
            bundles.append([(kept / name).read_bytes() for name in ("servo.zip", "case.zip")])
        self.assertEqual(bundles[0], bundles[1])

    def test_nothing_runs_when_a_case_has_a_mistake(self):
        """Catches: a mistake that is told only after an hour of other cases, or without its line."""
        self.write("a.toml", SERVO)
        for wrong, sentence in (
                (SERVO.replace("book/8.2.2", "book/8.2.9"), "no preset 'book/8.2.9'; did you mean"),
                (SERVO.replace('"servo"', '"sevro"'), "no bench file 'sevro'; did you mean \"servo\"?"),
                (SERVO.replace('"servo"', '"dc-a"'), "does not fit the bench: machine.kind is pm_dc on the bench"),
                (SERVO + "from_s = 1.0\n", "b.toml:4: check from_s is 1 but the case ends at 0.128 s"),
                (SERVO + "axis = \"motor\"\n", "check.axis is \"motor\", no axis of the bench; known here: servo"),
                (SERVO + "[override.axis.0.machine]\nrotor_resistance_ohm = -1\n", "rotor_resistance_ohm"),
                (SERVO + "[dut.gains]\n", "b.toml"),
                (SERVO.replace("[[check]]", "[dut.gains]\ncurrent.prop = 1\n[[check]]"), "no gain 'current.prop'"),
                (SERVO + "[[step]]\nat_s = 0.1\nfault = \"open_phas\"\nvalue = 1\n", "open_phas")):
            with self.subTest(sentence):
                self.write("b.toml", wrong)
                if sentence == "b.toml":
                    self.run_test(self.folder / "suite")  # an empty table of gains is none
                    continue
                done = self.run_test(self.folder / "suite", code=USAGE)
                self.assertIn(sentence, done.stderr)
                self.assertEqual(done.stdout, "")

    def test_many_mistakes_are_told_the_same_for_any_number_of_jobs(self):
        """Catches: cases that threads look at and leave out, an end that depends on which thread came first."""
        for n in range(60):
            steps = "".join(f'[[step]]\nat_s = 0.1\nfault = "open_{n}_{k}"\nvalue = 1\n' for k in range(1 + n % 3))
            self.write(f"{n:02}.toml", SERVO + steps)
        told = [self.run_test(self.folder / "suite", "--jobs", jobs, code=USAGE).stderr for jobs in (1, 2, 8, 8, 8)]
        self.assertEqual(told, told[:1] * 5)
        self.assertIn("open_0_0", told[0])
        self.assertIn("and 2 more problems", told[0])

    def test_filters_tags_and_lists_choose_cases(self):
        """Catches: a filter that runs everything, a suite without cases that passes."""
        self.write("a/one.toml", 'tags = ["quick", "dc"]\n' + SERVO)
        self.write("b/two.toml", 'tags = ["quick"]\nskip = "no board"\n' + SERVO)
        listed = self.run_test(self.folder / "suite", "--list").stdout
        self.assertEqual(listed, "a/one  #quick #dc\nb/two  #quick  skipped: no board\n")
        self.assertEqual([case["name"] for case in self.suite("--tag", "quick", "--tag", "dc")["cases"]], ["a/one"])
        only = self.suite("--filter", "two")["cases"]
        self.assertEqual([(case["name"], case["verdict"], case["reason"]) for case in only], [("b/two", "skipped", "no board")])
        self.assertIn("none of the 2 cases", self.run_test(self.folder / "suite", "--tag", "slow", code=USAGE).stderr)
        self.assertIn("no suite 'referense'; did you mean \"reference\"?", self.run_test("referense", code=USAGE).stderr)

    def test_what_the_bench_refuses_is_told_at_its_line_of_the_case(self):
        """Catches: a sentence about a composed file that is gone when it is read, and a second one without its file."""
        self.write("servo.toml", SERVO + '[override.bench]\nsubsteps = 0\n[[step]]\nat_s = 0.1\nfault = "open_faze"\nvalue = 1\n')
        said = self.run_test(self.folder / "suite", code=USAGE).stderr
        self.assertRegex(said, r"servo.toml:10: bench.substeps is 0 but must lie between 1 and 64\n")
        self.assertRegex(said, r"\n.*servo.toml:11: axis.fault.name is \"open_faze\"")
        self.assertNotIn("the composed bench", said)

    def test_a_folder_that_cannot_be_written_costs_no_run(self):
        """Catches: a night of cases whose results, or bundles, cannot be kept."""
        self.write("servo.toml", SERVO)
        file = self.write("notes", "no folder")
        for option in ("--results", "--keep"):
            for folder in (file, file / "below"):
                done = self.run_test(self.folder / "suite", option, folder, code=USAGE)
                self.assertEqual((done.stdout, done.stderr), ("", f"drivebench: {option}: {file} is no folder\n"))

    def test_a_step_on_a_condition_acts_in_the_bench_and_must_act(self):
        """Catches: a stimulus that never came and a case that passes all the same."""
        step = '[[step]]\nwhen = "speed_rad_s > {}"\nfor_s = 0.002\nfault = "open_phase"\nvalue = 2\n'
        injected = '[[check]]\nkind = "{}"\ncondition = "injected != 0"\n'
        wide = SERVO.replace("6.0", "99.0")
        self.write("servo.toml", wide + step.format(50) + injected.format("eventually"))
        self.assertEqual(self.suite()["passed"], 1)
        self.write("servo.toml", wide + step.format(500) + injected.format("never"))
        case = self.suite(code=FAILED)["cases"][0]
        self.assertEqual(case["reason"], 'the step of line 9 never acted: "speed_rad_s > 500" never held')

    def test_a_bench_that_latches_a_fault_goes_on_to_the_end(self):
        """Catches: a run that ends with the first fault, so that no check sees what comes after."""
        self.write("servo.toml", SERVO.replace("6.0", "99.0") + """[[step]]
at_s = 0.05
fault = "command_loss"
value = 1
[[check]]
name = "safe in time"
kind = "reaction"
after = "injected != 0"
condition = "state == 3"
within_ticks = 21
""")
        case = self.suite()["cases"][0]
        self.assertEqual((case["verdict"], case["bench_s"]), ("pass", 0.128))

    def test_the_composed_case_is_the_same_over_a_server(self):
        """Catches: a case in process that differs from the same case of a program by a bit."""
        self.write("preset.toml", 'bench = "dc-a-voltage"\nduration_s = 0.02\n[[check]]\nkind = "always"\ncondition = "i_a_a < 30"\n')
        self.write("program.toml", PROGRAM.format(limit_s=30))
        self.write("device.py", DRIVES.format(until=10 ** 9).replace("voltages=5.0", "off=True"))
        cases = self.suite("--jobs", "2")["cases"]
        self.assertEqual([case["verdict"] for case in cases], ["pass", "pass"], cases)
        self.assertEqual(cases[0]["hash"], cases[1]["hash"])


class Programs(RegressionTest):
    def verdict_of(self, device, limit_s=30.0, code=FAILED):
        self.write("device.py", device)
        self.write("case.toml", PROGRAM.format(limit_s=limit_s))
        return self.suite(code=code)["cases"][0]

    def test_a_program_that_drives_passes(self):
        """Catches: a link that does not reach the program, samples that are lost on their way through the recording."""
        case = self.verdict_of(DRIVES.format(until=10 ** 9), code=OK)
        self.assertEqual((case["verdict"], case["samples"], case["bench_s"]), ("pass", 201, 0.02))

    def test_a_bench_that_was_late_makes_the_run_invalid(self):
        """Catches: a device that is blamed for its bench, and an invalid run that ends with 0 or is kept as a result."""
        self.write("device.py", STOPS_ITS_BENCH)
        self.write("case.toml", PROGRAM.format(limit_s=60).replace("duration_s = 0.02", 'mode = "realtime"')
                   + "[override.bench]\nperiod_us = 10000\ncommand_delay_ticks = 1\narming_commands = 1\n")
        results = self.folder / "results"
        for _ in range(2):
            done = self.run_test(self.folder / "suite", "--results", results, code=INVALID)
            self.assertRegex(done.stdout, r"(?m)^invalid +case ")
            self.assertRegex(done.stdout, r"\d+ ticks of the bench were late")
            self.assertNotIn("from before", done.stdout)

    def test_a_program_gets_the_link_that_it_asks_for(self):
        """Catches: a word of the case that is passed over, and a run that depends on the link."""
        self.write("device.py", DRIVES.format(until=10 ** 9).replace(
            "import drivebench", "import drivebench\nprint(os.environ['DRIVEBENCH_LINK'].partition(':')[0], flush=True)"))
        cases = {}
        for link in ("unix", "tcp", "shm", "can", "modbus"):
            self.write("case.toml", PROGRAM.format(limit_s=30).replace("[dut]", f'[dut]\nlink = "{link}"'))
            for _ in range(5):  # a CAN link sends a command again after 20 ms, and the hash counts it
                cases[link] = self.suite()["cases"][0]
                if cases[link]["hash"] == cases["unix"]["hash"]:
                    break
            self.assertTrue(cases[link].pop("output").startswith(link), link)
            self.assertEqual(cases[link]["verdict"], "pass")
        for link, case in cases.items():
            self.assertEqual(case, cases["unix"], link)  # also over links of float32: 5 V are a float32
        for case, why in ((PROGRAM.format(limit_s=30).replace("[dut]", '[dut]\nlink = "udp"'), 'is "udp" but must be'),
                          (SERVO.replace("[dut]", '[dut]\nlink = "shm"'), "belongs to a command")):
            self.write("case.toml", case)
            refused = subprocess.run([COMMAND, "test", str(self.folder / "suite")], capture_output=True, text=True,
                                     env=self.environment, timeout=PATIENCE_S, check=False)
            self.assertEqual(refused.returncode, USAGE)
            self.assertIn(why, refused.stderr)

    def test_a_case_may_be_named_from_its_own_folder(self):
        """Catches: a case file without a folder in its name, whose program then starts nowhere."""
        self.verdict_of(DRIVES.format(until=10 ** 9), code=OK)
        done = subprocess.run([COMMAND, "test", "case.toml"], capture_output=True, text=True, env=self.environment, cwd=self.folder / "suite",
                              timeout=4 * PATIENCE_S, check=False)
        self.assertEqual(done.returncode, OK, done.stdout + done.stderr)

    def test_a_program_that_dies_or_never_drives_is_an_error(self):
        """Catches: a device under test that died, and a case that passes or blames its checks."""
        for device, limit_s, sentence in (
                (DRIVES.format(until=50) + "raise SystemExit(3)\n", 30, r"ended with code 3 at 0\.005 s of 0\.02 s"),
                (DRIVES.format(until=50), 30, r"ended with code 0 at 0\.005 s of 0\.02 s"),
                ("import time\ntime.sleep(600)\n", 0.5, r"the time limit of 0\.5 s passed at 0 s of the bench"),
                ("import os\nos.kill(os.getpid(), 9)\n", 30, r"ended with code 137 at 0 s")):
            with self.subTest(sentence):
                case = self.verdict_of(device, limit_s)
                self.assertEqual(case["verdict"], "error")
                self.assertRegex(case["reason"], sentence)

    def test_what_a_program_prints_is_in_the_report(self):
        """Catches: output that is lost, or that fills a pipe until the program stands still."""
        case = self.verdict_of("print('x' * 200000)\nprint('the end', flush=True)\nraise ValueError('why')\n")
        self.assertIn("the end\n", case["output"])
        self.assertIn("ValueError: why\n", case["output"])
        self.assertLess(len(case["output"]), 70000)

    def test_no_process_and_no_file_stays_behind(self):
        """Catches: a program's own children, a server or a folder that outlives the case, also after an interrupt."""
        self.write("device.py", "import subprocess, sys\nprint(subprocess.Popen(['sleep', '600']).pid, flush=True)\n"
                                "import time\ntime.sleep(600)\n")
        self.write("case.toml", PROGRAM.format(limit_s=600))
        running = subprocess.Popen([COMMAND, "test", str(self.folder / "suite")], stdout=subprocess.PIPE, text=True,
                                   env=self.environment)
        output, until = None, time.monotonic() + PATIENCE_S
        while output is None and time.monotonic() < until:
            printed = [file.read_text() for file in self.folder.glob("drivebench-work-*/0/output.txt")]
            output = next((text for text in printed if text.strip()), None)
        self.assertIsNotNone(output)
        running.send_signal(signal.SIGINT)
        out, _ = running.communicate(timeout=PATIENCE_S)
        self.assertEqual(running.returncode, FAILED)
        self.assertIn("interrupted", out)
        self.assertEqual(list(self.folder.glob("drivebench-work-*")), [])
        child = pathlib.Path(f"/proc/{output.strip()}/stat")
        until = time.monotonic() + PATIENCE_S
        while child.exists() and child.read_text().split()[2] != "Z" and time.monotonic() < until:
            time.sleep(0.01)
        self.assertTrue(not child.exists() or child.read_text().split()[2] == "Z")


class ShippedSuites(RegressionTest):
    def test_the_reference_controllers_pass_their_suite(self):
        """Catches: a controller, a machine or a bench that does not do what the suite says it does."""
        report = self.report("reference", "--jobs", "2")
        self.assertGreaterEqual(report["passed"], 50)
        self.assertEqual(report["skipped"], 0)

    def test_each_seeded_defect_is_caught_by_a_named_check(self):
        """Catches: a suite that passes whatever its controllers do."""
        for number, (name, _, change, _) in enumerate(DEFECTS):
            case = (SUITES / "reference" / f"{name}.toml").read_text(encoding="utf-8")
            self.assertNotEqual(change(case), case)
            self.write(f"{number}.toml", change(case))
        failed = {}
        for case in self.suite("--jobs", "2", code=FAILED)["cases"]:
            number = int(case["name"].split("[")[0])
            failed.setdefault(number, set()).update(check["name"] for check in case["checks"] if not check["passed"])
        for number, (name, defect, _, check) in enumerate(DEFECTS):
            with self.subTest(f"{name}: {defect}"):
                self.assertIn(check, failed[number])

    def test_defects_of_a_program_are_caught_too(self):
        """Catches: a program whose mistakes do not reach the checks."""
        suite = self.folder / "suite"
        shutil.copytree(SUITES / "ten-minutes", suite)
        loop = (suite / "speed_loop.py").read_text(encoding="utf-8")
        case = (suite / "speed.toml").read_text(encoding="utf-8")
        self.write("speed.toml", case[:case.index("[matrix]")])
        for old, new, check in (("WANTED_RAD_S - sample", "sample", "reaches its speed"),
                                ("5.0, 40.0", "0.0, 40.0", "reaches its speed"),
                                ("= 50.0,", "= 51.2,", "forgets the load")):
            with self.subTest(f"{new}: {check}"):
                self.assertIn(old, loop)
                self.write("speed_loop.py", loop.replace(old, new))
                failed = self.suite(code=FAILED)["cases"][0]
                self.assertIn(check, [each["name"] for each in failed["checks"] if not each["passed"]])

    def test_the_first_suite_passes_in_python_and_in_c(self):
        """Catches: a README that shows a device under test which does not work."""
        suite = self.folder / "ten-minutes"
        shutil.copytree(SUITES / "ten-minutes", suite)
        self.assertEqual(self.report(suite, "--jobs", "2")["passed"], 4)
        program = suite / "speed_loop"
        subprocess.run(["cc", "-std=c99", "-Wall", "-Werror", suite / "speed_loop.c", f"-I{REPOSITORY}/protocols/abi",
                        f"-L{SERVER.parents[1]}/lib", "-ldrivebench", "-lm", f"-Wl,-rpath,{SERVER.parents[1]}/lib", "-o", program],
                       check=True)
        case = suite / "speed.toml"
        case.write_text(case.read_text().replace('["python3", "speed_loop.py"]', '["./speed_loop"]'))
        in_c = self.report(suite)
        self.assertEqual(in_c["passed"], 4)
        self.assertTrue(all(case["output"].startswith("the bench ended at 0.4") for case in in_c["cases"]))


if __name__ == "__main__":
    unittest.main(verbosity=2)
