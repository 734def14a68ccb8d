#!/usr/bin/python3
"""`drivebench rerun`: bundles of failed cases run again, and hostile bundles are refused."""
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time
import unittest
import zipfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from regression_case import COMMAND, DRIVES, FAILED, OK, PROGRAM, SERVO, USAGE, RegressionTest
    from wire_client import PATIENCE_S, REPOSITORY, SERVER
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)


DRIVES_A_TICK = """import sys
import drivebench
with drivebench.Bench(sys.argv[1]) as bench:
    bench.acquire()
    print(bench.newest().tick, bench.step(off=True).tick)
"""
LOOP = """bench = "dc-a-servo"
[override.axis.0.encoder]
counts_per_revolution = 100000
[dut]
preset = "book/2.21"
[dut.gains]
"counts_per_revolution" = 100000
[[step]]
when = "tick >= 500"
delay_s = 0.01
multisine = {load_nm = 2e-3, from_hz = 10.0, to_hz = 300.0, period_s = 0.1, periods = 4}
[[check]]
name = "speed loop"
kind = "frequency_response"
min_phase_margin_deg = 40.0
[matrix]
check.0.min_phase_margin_deg = [40.0, 170.0]
"""
TRIPS = """[override.axis.0.amplifier]
over_current_a = 0.3
over_current_trip = true
"""


class Rerun(RegressionTest):
    def failed_bundle(self, name, case, **files):
        """Runs a case that fails. Returns its bundle; the suite is gone then."""
        self.write(f"{name}.toml", case)
        for file, text in files.items():
            self.write(file.replace("_", "."), text)
        self.run_test(self.folder / "suite", "--keep", self.folder / "kept", code=FAILED)
        shutil.rmtree(self.folder / "suite")
        (bundle,) = (self.folder / "kept").iterdir()
        return bundle

    def rerun(self, bundle, *arguments, code):
        before = sorted(self.folder.iterdir())
        done = subprocess.run([COMMAND, "rerun", bundle, *arguments], capture_output=True, text=True, env=self.environment,
                              timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        self.assertEqual(sorted(self.folder.iterdir()), before)
        return done.stdout + done.stderr

    def changed(self, bundle, changes):
        """A copy of the bundle in which entries have other bytes; None: they are missing."""
        copy = self.folder / "changed.zip"
        with zipfile.ZipFile(bundle) as old, zipfile.ZipFile(copy, "w") as new:
            parts = {name: old.read(name) for name in old.namelist()}
            for name, change in changes.items():
                parts[name] = change(parts.get(name, b""))
            for name, data in parts.items():
                if data is not None:
                    new.writestr(name, data)
        return copy

    def test_a_preset_runs_again_to_the_bit_and_a_change_shows_where(self):
        """Catches: a bundle that lacks a curve or a value of the matrix, a comparison that finds no difference."""
        bundle = self.failed_bundle("servo", SERVO.replace("6.0", "5.0") + """[matrix]
override.axis.servo.machine.rotor_resistance_ohm = [4.0]
[override.axis.servo.mechanics]
load_profile = "load.csv"
""", load_csv="0,0\n0.1,0.02\n")
        said = self.rerun(bundle, code=FAILED)
        self.assertRegex(said, r"(?m)^fail +servo\[rotor_resistance_ohm=4")
        self.assertIn("the same to the bit: 1025 samples", said)
        # One more: at its end the bench dismisses the controller and takes the safe action.
        self.assertIn("the plant is the same to the bit: 1026 samples", self.rerun(bundle, "--plant-only", code=OK))
        other = self.changed(bundle, {"bench.toml": lambda text: text.replace(b"rotor_resistance_ohm = 4.0", b"rotor_resistance_ohm = 4.01")})
        self.assertRegex(self.rerun(other, code=FAILED), r"differs first at tick \d+: servo\.\w+ was \S+ and is \S+")

    def test_a_case_that_never_began_is_told_as_one_sample(self):
        """Catches: a comparison of runs without a tick that fails, or that counts in bad English."""
        bundle = self.failed_bundle("case", PROGRAM.format(limit_s=30), device_py="raise SystemExit(3)\n")
        self.assertRegex(self.rerun(bundle, code=FAILED), r"(?m)^the same to the bit: 1 sample$")

    def test_a_program_runs_again_from_the_bundle_alone(self):
        """Catches: a device under test that is not in the bundle, a verdict of the recording in the place of the new run."""
        bundle = self.failed_bundle("case", PROGRAM.format(limit_s=30).replace("i_a_a < 30", "i_a_a < 0.5"),
                                    device_py=DRIVES.format(until=10 ** 9))
        self.assertIn("the same to the bit: 201 samples", self.rerun(bundle, code=FAILED))
        self.assertIn("the plant is the same to the bit", self.rerun(bundle, "--plant-only", code=OK))
        tamed = self.changed(bundle, {"case/device.py": lambda text: text.replace(b"voltages=5.0", b"voltages=0.1")})
        said = self.rerun(tamed, code=OK)
        self.assertRegex(said, r"(?m)^pass +case")
        self.assertRegex(said, r"differs first at tick \d+: ")

    def test_a_bundle_brings_the_bus_of_its_program(self):
        """Catches: a bundle that the next program refuses because its bench has a bus."""
        for link in ("can", "modbus"):
            case = PROGRAM.format(limit_s=30).replace("[dut]", f'[dut]\nlink = "{link}"').replace("i_a_a < 30", "i_a_a < 0")
            for _ in range(5):  # a CAN link sends a command again after 20 ms, and the samples count it
                bundle = self.failed_bundle(link, case, device_py=DRIVES.format(until=10 ** 9))
                said = self.rerun(bundle, code=FAILED)
                bundle.unlink()
                if "refused_commands was" not in said:
                    break
            self.assertIn("the same to the bit: 201 samples", said, link)

    def test_a_program_begins_in_the_middle_of_the_recorded_run(self):
        """Catches: a bench that is not where the recorded one was, a condition that is forgotten, a lease that is still held."""
        bundle = self.failed_bundle("case", PROGRAM.format(limit_s=30).replace("i_a_a < 30", "i_a_a < 0.5") + """[[step]]
when = "i_a_a > 1"
for_s = 0.001
load_nm = 0.01
""", device_py=DRIVES.format(until=10 ** 9).replace("sample = bench.newest()", "sample = bench.newest(); print(sample.tick, sample.load_nm)"))
        said = self.rerun(bundle, "--from", "0.01s", code=FAILED)
        self.assertIn("up to tick 100 (0.01 s) is the recorded one, to the bit; the device under test was started there", said)
        self.assertNotIn("differs", said)
        # The rest of the run is that of the new device, which is asked for another voltage from there on.
        still = self.changed(bundle, {"case/device.py": lambda text: text.replace(b"voltages=5.0", b"voltages=0.0"),
                                      "case/case.toml": lambda text: text.replace(b"i_a_a < 0.5", b"i_a_a < 30")})
        self.assertRegex(self.rerun(still, "--from", "100", code=OK), r"(?m)^pass +case")
        never = self.changed(bundle, {"case/case.toml": lambda text: text.replace(b"i_a_a < 0.5", b"load_nm == 0")})
        self.assertRegex(self.rerun(never, "--from", "100", code=FAILED), r"load_nm == 0")
        other = self.changed(bundle, {"bench.toml": lambda text: text.replace(b"armature_resistance_ohm = 2.0", b"armature_resistance_ohm = 2.5")})
        self.assertIn("the bench is not the one of the recording", self.rerun(other, "--from", "100", code=FAILED))
        for wrong, rule in (("201", "is tick 201, but the recorded run ends at tick 200"), ("0.5", 'is "0.5" but must be a tick'),
                            ("-1", "must be a tick"), ("nans", "must be a tick"), ("1e99", "must be a tick")):
            with self.subTest(wrong):
                self.assertIn(rule, self.rerun(bundle, f"--from={wrong}", code=USAGE))

    def test_a_preset_goes_on_from_the_recorded_commands(self):
        """Catches: a preset that begins its plan anew, or whose own answers act before the tick."""
        bundle = self.failed_bundle("servo", SERVO.replace("6.0", "5.0"))
        for tick in ("0", "200", "1024"):
            self.assertIn("the same to the bit: 1025 samples", self.rerun(bundle, "--from", tick, code=FAILED))
        softer = self.changed(bundle, {"case/case.toml": lambda text: text.replace(
            b"[dut]\n", b"[dut]\ngains.position.proportional_per_s2 = 300000.0\n")})
        first = r"differs first at tick (\d+): "
        self.assertLess(int(re.search(first, self.rerun(softer, code=FAILED)).group(1)), 400)
        self.assertGreater(int(re.search(first, self.rerun(softer, "--from", "400", code=FAILED)).group(1)), 400)

    def test_an_interactive_bench_stands_at_the_failure(self):
        """Catches: a bench at another tick, one that nobody may drive, a server that outlives its verb."""
        bundle = self.failed_bundle("servo", SERVO.replace("6.0", "5.0"))
        recording = self.folder / "run.mcap"
        recording.write_bytes(zipfile.ZipFile(bundle).read("run.mcap"))
        table = subprocess.run([COMMAND, "export", recording, "--signals", "i_a_a"], capture_output=True, text=True, timeout=PATIENCE_S, check=True).stdout
        currents = [float(line.split(",")[-1]) for line in table.splitlines()[1:]]
        first = next(tick for tick, current in enumerate(currents) if abs(current) > 5.0)
        for more, at in (((), first), (("--from", "100"), 100)):
            bench = subprocess.Popen([COMMAND, "rerun", bundle, "--interactive", *more], stdout=subprocess.PIPE, text=True,
                                     env=self.environment)
            self.addCleanup(bench.wait)
            self.addCleanup(bench.kill)
            self.addCleanup(bench.stdout.close)
            link = re.search(rf"at tick {at} \(\S+ s\) on (tcp:\S+)", bench.stdout.readline()).group(1)
            status = subprocess.run([COMMAND, "status", "--link", link], capture_output=True, text=True, timeout=PATIENCE_S, check=True).stdout
            self.assertIn(f"tick {at} (", status)
            self.assertIn("owner none", status)
            drives = subprocess.run([sys.executable, "-c", DRIVES_A_TICK, link], capture_output=True, text=True, env=self.environment,
                                    timeout=PATIENCE_S, check=True).stdout
            self.assertEqual(drives.split(), [str(at), str(at + 1)])
            bench.send_signal(signal.SIGINT)
            self.assertEqual(bench.wait(timeout=PATIENCE_S), OK)

    def test_an_interactive_bench_tells_what_it_has_latched(self):
        """Catches: a bench that refuses every command of the one who drives on, without a word on why."""
        bundle = self.failed_bundle("case", PROGRAM.format(limit_s=30) + TRIPS, device_py=DRIVES.format(until=10 ** 9))
        bench = subprocess.Popen([COMMAND, "rerun", bundle, "--interactive"], stdout=subprocess.PIPE, text=True, env=self.environment)
        self.addCleanup(bench.wait)
        self.addCleanup(bench.kill)
        self.addCleanup(bench.stdout.close)
        link = re.search(r"at tick \d+ \(\S+ s\) on (tcp:\S+)", bench.stdout.readline()).group(1)
        said = re.search(r"has latched \S.*; first: drivebench (clear \S+ --link \S+)\n", bench.stdout.readline())
        subprocess.run([COMMAND, *said.group(1).split()], capture_output=True, timeout=PATIENCE_S, check=True)
        subprocess.run([sys.executable, "-c", DRIVES_A_TICK, link], capture_output=True, env=self.environment, timeout=PATIENCE_S, check=True)
        status = subprocess.run([COMMAND, "status", "--link", link], capture_output=True, text=True, timeout=PATIENCE_S, check=True).stdout
        self.assertNotIn("latched:", status)

    def test_an_interrupt_leaves_nothing_behind(self):
        """Catches: an unpacked bundle, or a server, that outlives the interrupt of a verb that reads or repeats."""
        bundle = self.failed_bundle("servo", SERVO.replace("6.0", "5.0"))
        before = sorted(self.folder.iterdir())
        for delay_s in (0.005, 0.01, 0.02, 0.03, 0.05, 0.1):
            with self.subTest(delay_s):
                verb = subprocess.Popen([COMMAND, "rerun", bundle, "--interactive"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                        env=self.environment)
                time.sleep(delay_s)
                verb.terminate()
                verb.wait(timeout=PATIENCE_S)
                self.assertEqual(sorted(self.folder.iterdir()), before)

    def test_a_repetition_up_to_its_beginning_reads_its_file(self):
        """Catches: --until 0 with any file or bench, a run that ends before its repetition does."""
        bundle = self.failed_bundle("case", PROGRAM.format(limit_s=30).replace("i_a_a < 30", "i_a_a < 0.5"),
                                    device_py=DRIVES.format(until=10 ** 9))
        self.assertIn("the run up to tick 0 (0 s) is the recorded one", self.rerun(bundle, "--from", "0", code=FAILED))
        other = self.changed(bundle, {"bench.toml": lambda text: text.replace(b"armature_resistance_ohm = 2.0", b"armature_resistance_ohm = 2.5")})
        self.assertIn("the bench is not the one of the recording", self.rerun(other, "--from", "0", code=FAILED))
        bench, recording = self.folder / "bench.toml", self.folder / "run.mcap"
        with zipfile.ZipFile(bundle) as parts:
            bench.write_bytes(parts.read("bench.toml"))
            recording.write_bytes(parts.read("run.mcap"))
        for arguments, rule in ((("--repeat", self.folder / "none.mcap", "--until", "0"), "none.mcap"),
                                (("--repeat", bench, "--until", "0"), "--repeat: "),
                                (("--repeat", recording, "--until", "100", "--duration", "0.005"), "--duration: ends at tick 50, but --until is 100")):
            with self.subTest(rule):
                done = subprocess.run([SERVER, bench, "--port", "0", *arguments], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
                self.assertEqual(done.returncode, USAGE)
                self.assertIn(rule, done.stderr)

    def test_the_margins_of_a_loop_are_drawn_and_measured_again(self):
        """Catches: a multisine that a recording loses or replays elsewhere, a Bode plot of failed checks only."""
        self.write("loop.toml", LOOP)
        page, kept = self.folder / "page.html", self.folder / "kept"
        cases = self.suite("--html", page, "--keep", kept, code=FAILED)["cases"]
        self.assertEqual([case["verdict"] for case in cases], ["pass", "fail"])
        rows = [case["checks"][0]["response"] for case in cases]
        self.assertEqual(rows[0], rows[1])
        self.assertEqual(rows[0], sorted(rows[0]))
        html = page.read_text(encoding="utf-8")
        self.assertEqual(html.count("speed loop: loop gain"), 2)
        self.assertRegex(html, r">\d+\.\d\u00b0 at [\d.]+ Hz</text>")
        (bundle,) = kept.glob("*.zip")
        again = self.rerun(bundle, code=FAILED)
        self.assertIn("the same to the bit", again)
        self.assertRegex(again, r"phase margin [\d.]+ deg, crossover [\d.]+ Hz, .*, min 170 deg")

    def test_a_signal_ends_a_server_that_repeats_a_run(self):
        """Catches: a server that repeats its run to the end first, however long that is. Substeps make it long."""
        bench, recording = self.folder / "bench.toml", self.folder / "run.mcap"
        text = (REPOSITORY / "configs/benches/dc-a.toml").read_text(encoding="utf-8")
        bench.write_text(text.replace("../motors", str(REPOSITORY / "configs/motors")).replace("period_us = 500", "period_us = 500\nsubsteps = 64"),
                         encoding="utf-8")
        server = (SERVER, bench, "--port", "0")
        subprocess.run([*server, "--duration", "50", "--record", recording], capture_output=True, timeout=PATIENCE_S, check=True)
        with subprocess.Popen([*server, "--mode", "lockstep", "--repeat", recording, "--until", "100000"], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, text=True) as running:
            caught = 0
            while not caught >> (signal.SIGTERM - 1) & 1:  # the handler is there before the repetition begins
                status = pathlib.Path(f"/proc/{running.pid}/status").read_text(encoding="utf-8")
                caught = int(re.search(r"SigCgt:\s*([0-9a-f]+)", status)[1], 16)
            running.terminate()
            out, errors = running.communicate(timeout=PATIENCE_S)
        self.assertEqual(running.returncode, FAILED, errors)
        self.assertIn("before the recorded run was repeated", errors)
        self.assertNotIn("ready", out)

    def test_a_hostile_bundle_is_refused_with_entry_and_rule(self):
        """Catches: a file outside the folder, a bomb that is unpacked, a foreign or damaged file that runs."""
        bundle = self.failed_bundle("servo", SERVO.replace("6.0", "5.0"))
        outside = self.folder.parent / "escaped-from-a-bundle"
        for changes, sentence in (
                ({"../../../escaped-from-a-bundle": lambda _: b"x"}, 'entry "../../../escaped-from-a-bundle": a name is the relative path'),
                ({str(outside): lambda _: b"x"}, "a name is the relative path"),
                ({"run.sh": lambda _: b"x"}, 'entry "run.sh": is no part of a bundle'),
                ({"case/case.toml": lambda _: None}, 'entry "case/case.toml": is missing'),
                ({"case/case.toml/x": lambda _: b"x"}, "is a file and a folder at once"),
                ({"bundle.toml": lambda text: text.replace(b"format = 1", b"format = 2")}, "bundle.toml:1: format is 2"),
                ({"bench.toml": lambda text: text + b'\n[audit]\nfile = "/tmp/x"\n'}, 'entry "bench.toml": has audit'),
                ({"case/case.toml": lambda text: text + b"\n[matrix]\nseed = [1, 2]\n"}, "makes 2 cases but a bundle has one"),
                ({"case/case.toml": lambda _: b"bench = "}, "case/case.toml:1"),
                ({"run.mcap": lambda data: data[:1000]}, "recording is not whole")):
            with self.subTest(sentence):
                code = FAILED if "whole" in sentence else USAGE
                self.assertIn(sentence, self.rerun(self.changed(bundle, changes), code=code))
                self.assertFalse(outside.exists())
        bomb = self.folder / "bomb.zip"
        with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr("run.mcap", bytes(1000))
        data = bytearray(bomb.read_bytes())
        for at in (22, data.index(b"PK\x01\x02") + 24):  # the size that the two headers promise
            data[at:at + 4] = (1 << 31).to_bytes(4, "little")
        bomb.write_bytes(data)
        self.assertIn('entry "run.mcap": makes more than 1073741824 bytes', self.rerun(bomb, code=USAGE))
        whole = bundle.read_bytes()
        for damaged in (whole[:-1], whole[:len(whole) // 2], b"", b"no ZIP file"):
            bomb.write_bytes(damaged)
            self.assertIn(os.fspath(bomb), self.rerun(bomb, code=USAGE))
        self.assertIn("none.zip", self.rerun(self.folder / "none.zip", code=USAGE))


if __name__ == "__main__":
    unittest.main(verbosity=2)
