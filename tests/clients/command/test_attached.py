#!/usr/bin/python3
"""Cases of `drivebench test` whose device under test is attached: it runs already, and the runner serves the bench to it."""
import contextlib
import pathlib
import subprocess
import sys
import unittest
import zipfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from free_port import free_ports, free_udp_port
    from regression_case import COMMAND, FAILED, INVALID, OK, USAGE, RegressionTest
    from wire_client import PATIENCE_S
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

# 1 kHz, and a watchdog that a loaded machine does not wake. The load acts 50 ms after the drive has armed.
CASE = """bench = "dc-a-voltage"
mode = "realtime"
duration_s = 0.3
{extra}
[override.bench]
period_us = 1000
substeps = 20
command_delay_ticks = 1
arming_commands = 3
watchdog_ticks = {watchdog}
[override.realtime]
pacer = "sleep"
[dut]
attached = "{way}"
time_limit_s = {limit_s}
[dut.{way}]
{place}
[[step]]
at_s = 0.05
load_nm = 0.004
[[check]]
name = "no load before"
kind = "bounds"
signal = "load_nm"
abs = 0.0
to_s = 0.05
[[check]]
name = "the load from then on"
kind = "bounds"
signal = "load_nm"
min = 0.004
from_s = 0.051
[[check]]
name = "turns"
kind = "eventually"
condition = "speed_rad_s > 5"
"""

# A drive on the bus: waits for its bench, drives until it goes, and waits for the next. One that leaves comes back when that run
# has ended: a late tick makes the runner try again.
DRIVE = """import sys, time
import drivebench
link, behaviour = sys.argv[1:]
while True:
    try:
        with drivebench.Bench(link) as bench:
            bench.acquire()
            commands = 0
            while True:
                if behaviour == "leaves" and commands > 20:
                    break
                if behaviour == "falls silent" and commands > 20:
                    time.sleep(0.05)
                    bench.newest()
                    continue
                try:
                    bench.step(voltages=5.0 if behaviour != "sends nothing" else None)
                    commands += 1
                except drivebench.Refused:
                    bench.newest()
        time.sleep(1)
    except drivebench.DrivebenchError:
        time.sleep(0.01)
"""


class Attached(RegressionTest):
    @contextlib.contextmanager
    def drive(self, link, behaviour=""):
        """Starts the stand-in for a drive, and ends it by its pid only afterwards."""
        script = self.folder / "drive.py"
        script.write_text(DRIVE, encoding="utf-8")
        with subprocess.Popen([sys.executable, str(script), link, behaviour], env=self.environment) as process:
            try:
                yield process
            finally:
                process.kill()

    def case(self, way, place, limit_s=30.0, watchdog=2000, extra=""):
        return self.write("case.toml", CASE.format(way=way, place=place, limit_s=limit_s, watchdog=watchdog, extra=extra))

    def rerun(self, bundle):
        """What `rerun` says of a failing bundle, once no tick of the bench was late: a loaded machine makes a run invalid."""
        for _ in range(20):
            done = subprocess.run([COMMAND, "rerun", str(bundle)], capture_output=True, text=True, env=self.environment,
                                  timeout=PATIENCE_S, check=False)
            if done.returncode != INVALID:
                break
        self.assertEqual(done.returncode, FAILED, done.stdout + done.stderr)
        return done.stdout

    def test_a_drive_on_each_bus_is_judged_from_its_arming_on(self):
        """Catches: a bench without the bus at which the drive waits, steps and windows that count from the start of the bench, a drive
        that is told to end."""
        tcp, modbus = free_ports(2)
        udp = free_udp_port()
        ways = {"tcp": (f"port = {tcp}", f"tcp:127.0.0.1:{tcp}"),
                "modbus": (f"port = {modbus}", f"modbus:127.0.0.1:{modbus}?unit=1"),
                "can": (f'backend = "udp_multicast"\nchannel = "239.74.163.77"\nport = {udp}\nfd = true',
                        f"can:udp_multicast:239.74.163.77:{udp}?fd=1&node=1")}
        for way, (place, link) in ways.items():
            with self.subTest(way), self.drive(link) as drive:
                self.case(way, place)
                case = self.suite("--retries", 20)["cases"][0]
                self.assertEqual((case["verdict"], case["bench_s"], case["samples"]), ("pass", 0.3, 301), case)
                self.assertRegex(case["output"], r"^armed at tick \d+ of the recording, where the case begins\n$")
                self.assertIsNone(drive.poll())

    def test_cases_on_one_bus_follow_each_other(self):
        """Catches: cases that fight for the bus of the one drive."""
        port = free_ports(1)[0]
        with self.drive(f"tcp:127.0.0.1:{port}"):
            self.case("tcp", f"port = {port}", extra="").write_text(
                CASE.format(way="tcp", place=f"port = {port}", limit_s=30, watchdog=2000, extra="") +
                "[matrix]\nseed = [1, 2]\n", encoding="utf-8")
            cases = self.suite("--retries", 20, "--jobs", 2)["cases"]
        self.assertEqual([case["verdict"] for case in cases], ["pass", "pass"])

    def test_a_drive_that_never_arms_or_goes_is_an_error(self):
        """Catches: a case that waits without end, or blames its checks or nothing when the drive has gone."""
        port = free_ports(1)[0]
        self.case("tcp", f"port = {port}", limit_s=0.5)
        case = self.suite(code=FAILED)["cases"][0]
        self.assertEqual((case["verdict"], case["reason"]),
                         ("error", "never armed within 0.5 s: no device under test took the lease of the axis"))
        for behaviour, watchdog, why in (("leaves", 2000, r"^the device under test left the bench at 0\.\d+ s of 0\.3 s$"),
                                         ("falls silent", 60, r"^the device under test fell silent at 0\.\d+ s of 0\.3 s$"),
                                         ("sends nothing", 2000, r"^never armed within 3 s: the device under test took the lease, but")):
            with self.subTest(behaviour), self.drive(f"tcp:127.0.0.1:{port}", behaviour):
                self.case("tcp", f"port = {port}", limit_s=3.0, watchdog=watchdog)
                case = self.suite("--retries", 20, code=FAILED)["cases"][0]
                self.assertEqual(case["verdict"], "error")
                self.assertRegex(case["reason"], why)

    def test_a_bundle_is_run_again_with_the_drive(self):
        """Catches: a bundle that opens a bus for whoever replays it, and one that no longer finds its drive."""
        port = free_ports(1)[0]
        path = self.case("tcp", f"port = {port}")
        path.write_text(path.read_text().replace("speed_rad_s > 5", "speed_rad_s > 5000"), encoding="utf-8")
        with self.drive(f"tcp:127.0.0.1:{port}"):
            self.suite("--retries", 20, "--keep", self.folder / "kept", code=FAILED)
            bundle = self.folder / "kept/case.zip"
            with zipfile.ZipFile(bundle) as parts:
                self.assertNotIn("[tcp]", parts.read("bench.toml").decode())
            again = self.rerun(bundle)
        self.assertIn("the device under test was not started anew: no samples are compared", again)
        replayed = subprocess.run([COMMAND, "rerun", str(bundle), "--plant-only"], capture_output=True, text=True,
                                  env=self.environment, timeout=PATIENCE_S, check=False)
        self.assertEqual(replayed.returncode, OK, replayed.stdout + replayed.stderr)

    def test_a_bench_may_ask_for_tokens(self):
        """Catches: tokens that are looked for elsewhere than beside the case, a runner that its own bench turns away, a bundle with secrets
        or without its way to them, a drive of which a wrong token is no reason."""
        port = free_ports(1)[0]
        place = f'port = {port}\ntokens_file = "tokens"'
        path = self.case("tcp", place, limit_s=30)
        tokens = self.write("tokens", '[[token]]\nname = "drive"\nrole = "operator"\ntoken = "of-the-drive"\n'
                                      '[[token]]\nname = "runner"\nrole = "viewer"\ntoken = "of-the-runner"\n')
        suite = self.folder / "suite"
        self.assertRegex(self.run_test(suite, code=USAGE).stderr, r"case.toml:\d+: dut.tcp.tokens_file needs DRIVEBENCH_TOKEN")
        self.environment["DRIVEBENCH_TOKEN"] = "of-the-drive"
        tokens.chmod(0o644)
        self.assertIn("chmod 600 it", self.run_test(suite, code=USAGE).stderr)
        tokens.chmod(0o600)
        with self.drive(f"tcp:127.0.0.1:{port}"):
            self.environment["DRIVEBENCH_TOKEN"] = "of-the-runner"
            self.assertEqual(self.suite("--retries", 20)["cases"][0]["verdict"], "pass")
            path.write_text(path.read_text().replace("speed_rad_s > 5", "speed_rad_s > 5000"), encoding="utf-8")
            self.suite("--retries", 20, "--keep", self.folder / "kept", code=FAILED)
            bundle = self.folder / "kept/case.zip"
            with zipfile.ZipFile(bundle) as parts:
                self.assertFalse([name for name in parts.namelist() if b"of-the-" in parts.read(name)])
            again = self.rerun(bundle)
        self.assertIn("turns", again)
        self.case("tcp", place, limit_s=1)
        with self.drive(f"tcp:127.0.0.1:{port}"):  # with the token of a viewer
            self.assertIn("never armed within 1 s: no device under test took the lease", self.suite(code=FAILED)["cases"][0]["reason"])
        self.environment["DRIVEBENCH_TOKEN"] = "guessed"
        self.assertIn("wrong token", self.suite(code=FAILED)["cases"][0]["reason"])

    def test_what_cannot_be_attached_is_refused(self):
        """Catches: an attached drive in lockstep, at a port that it cannot know, or beside a program."""
        whole = CASE.format(way="tcp", place="port = 7300", limit_s=30, watchdog=250, extra="")
        for text, why in (
                (whole.replace("realtime\"\nduration", "lockstep\"\nduration"), 'mode must be "realtime": an attached drive waits'),
                (whole.replace("duration_s = 0.3\n", ""), "duration_s is missing"),
                (whole.replace("port = 7300", "port = 0"), "dut.tcp leaves its port to the system"),
                (whole.replace("dut.tcp", "dut.can"), 'dut.can belongs to attached = "can"'),
                (whole.replace('attached = "tcp"', 'attached = "shm"'), 'dut.attached is "shm" but must be "can", "modbus" or "tcp"'),
                (whole.replace("[dut]", '[dut]\ncommand = ["true"]'), "dut.attached cannot stand beside preset or command"),
                (whole.replace("port = 7300", "prt = 7300"), "tcp.prt")):
            with self.subTest(why):
                self.write("case.toml", text)
                done = subprocess.run([COMMAND, "test", str(self.folder / "suite")], capture_output=True, text=True,
                                      env=self.environment, timeout=PATIENCE_S, check=False)
                self.assertEqual(done.returncode, USAGE, done.stdout + done.stderr)
                self.assertIn(why, done.stderr)


if __name__ == "__main__":
    unittest.main()
