"""`drivebench fmu`: units in a strict importer, against the same bench in process."""
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest
import zipfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
import python_package  # noqa: E402,F401
from fmu_importer import ERROR, Fmu, Refused  # noqa: E402
from wire_client import BENCHES, PATIENCE_S, SERVER  # noqa: E402

import drivebench  # noqa: E402

DRIVEBENCH = SERVER.with_name("drivebench")


def voltages(tick):
    angle = 2 * math.pi * 25 * tick * 125e-6
    return 20 * math.cos(angle), 20 * math.sin(angle)


def command(*arguments, code=0):
    done = subprocess.run([DRIVEBENCH, "fmu", *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    if done.returncode != code:
        raise AssertionError(f"fmu {arguments} ended with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout + done.stderr


class Units(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.units = 0

    def unit(self, bench, fmi, text=None):
        """A unit of a bench, in a folder whose name needs an escape in a URI."""
        self.units += 1  # a library that is loaded must not be unpacked again
        name = f"{self.units} {pathlib.Path(bench).stem}"
        if text is not None:
            bench = self.folder / f"{bench}.toml"
            bench.write_text(text, encoding="utf-8")
        file = self.folder / f"{name}.fmu"
        command(bench, "--fmi", fmi, "--out", file)
        return Fmu(file, self.folder / name)

    def opened(self, bench, fmi, **changes):
        instance = self.unit(bench, fmi).open(**changes)
        self.addCleanup(instance.close)
        return instance

    def refused(self, request, *arguments, status=ERROR, **values):
        with self.assertRaises(Refused) as refusal:
            request(*arguments, **values)
        self.assertEqual(refusal.exception.status, status)
        self.assertTrue(refusal.exception.log, "a refusal without a sentence")
        return refusal.exception.log[0][1]

    # Catches: a description that the standard forbids, or a unit whose own bench it does not fit.
    def test_every_shipped_bench_becomes_a_unit_of_both_versions(self):
        for bench in sorted(BENCHES.glob("*.toml"))[::6] + [BENCHES / "two-steppers.toml", BENCHES / "dynamometer.toml"]:
            for fmi in (2, 3):
                with self.subTest(bench=bench.stem, fmi=fmi):
                    instance = self.opened(bench, fmi)
                    instance.start()
                    instance.step(0.0, 3 * instance.fmu.step_s)
                    ticks = [value for name, value in instance.outputs().items() if name.rpartition(".")[2] == "tick"]
                    self.assertEqual(set(ticks), {3})

    # Catches: an input that acts a tick late, a column that is shifted, a load or fault that does not reach the bench.
    def test_a_unit_has_the_samples_of_the_bench_in_process(self):
        with drivebench.Bench("inproc:servo") as bench:
            bench.acquire()
            expected = []
            for tick in range(400):
                if tick == 100:
                    bench.set_load(0.05)
                if tick == 200:
                    bench.set("machine.rotor_resistance_ohm", 5.0)
                if tick == 300:
                    bench.inject("open_phase", 2)
                expected.append(bench.step(voltages=voltages(tick)))
        for fmi in (2, 3):
            instance = self.opened("servo", fmi)
            instance.start()
            for tick, sample in enumerate(expected):
                a, b = voltages(tick)
                instance.set(setpoint_a=a, setpoint_b=b, load_torque_nm=0.05 if tick >= 100 else 0.0)
                if tick == 200:
                    instance.set_all({"machine.rotor_resistance_ohm": 5.0})
                if tick == 300:
                    instance.set_all({"fault.open_phase": 2})
                instance.step(tick * 125e-6, 125e-6)
                if tick % 50 == 49:
                    got = instance.outputs()
                    self.assertEqual({name: getattr(sample, name) for name in got}, got)
            self.assertGreater(got["speed_rad_s"], 1.0)

    # Catches: time that runs away from the importer's where its step is no multiple of the period, or begins elsewhere.
    def test_steps_of_any_length_run_the_ticks_that_they_pass(self):
        for fmi in (2, 3):
            instance = self.opened("servo", fmi)
            instance.start(start_s=7.0)
            at_s = 7.0
            for step_s, tick in ((125e-6, 1), (50e-6, 1), (50e-6, 1), (25e-6, 2), (1e-3, 10), (0.3, 2410)):
                instance.step(at_s, step_s)
                at_s += step_s
                self.assertEqual(instance.get("tick"), tick)

    # Catches: a state without the inputs or the time of the importer, or one that another instance cannot take.
    def test_a_run_goes_on_from_a_kept_state(self):
        for fmi in (2, 3):
            instance = self.opened("servo", fmi)
            instance.start()
            instance.set(setpoint_a=10.0)
            instance.step(0.0, 0.05)
            state = instance.keep()
            raw = instance.to_bytes(state)
            instance.step(0.05, 0.05)
            expected = instance.outputs()
            instance.set(setpoint_a=-10.0, load_torque_nm=0.1)
            instance.go_back(state)
            instance.forget(state)
            instance.step(0.05, 0.05)
            self.assertEqual(instance.outputs(), expected)
            other = instance.fmu.open()
            self.addCleanup(other.close)
            other.start()
            other.go_back(other.from_bytes(raw))
            other.step(0.05, 0.05)
            self.assertEqual(other.outputs(), expected)
            self.assertIn("no state of this", self.refused(other.go_back, other.from_bytes(raw[:-8])))
            self.assertIn("no state of this", self.refused(other.go_back, other.from_bytes(b"")))
            instance.reset()
            instance.start()
            self.assertEqual(instance.get("tick", "speed_rad_s", "setpoint_a"), [0, 0.0, 0.0])
            instance.step(0.0, 0.05)  # the unit is still the controller of its axes

    # Catches: a trip after which the unit refuses every step, or that cannot be cleared from a simulation.
    def test_a_latched_axis_goes_on_with_its_gates_off_until_it_is_cleared(self):
        text = (BENCHES / "servo.toml").read_text(encoding="utf-8")
        text = text.replace('"../', f'"{BENCHES.parent}/').replace("over_current_trip = false", "over_current_trip = true")
        instance = self.unit("tripping", 2, text).open()
        self.addCleanup(instance.close)
        instance.start()
        instance.set(setpoint_a=60.0)
        instance.step(0.0, 0.2)
        self.assertEqual(instance.get("state"), 4)
        self.assertNotEqual(instance.get("faults"), 0)
        instance.set(setpoint_a=0.0)
        instance.step(0.2, 0.2)
        instance.set(clear=1)
        instance.step(0.4, 0.01)
        self.assertEqual(instance.get("state"), 1)
        self.assertEqual(instance.get("faults"), 0)

    # Catches: a crash, a silent refusal, or a run on with a value that the bench does not take.
    def test_what_a_unit_cannot_do_is_refused_in_words(self):
        for fmi in (2, 3):
            instance = self.opened("servo", fmi)
            instance.start()
            variables = instance.fmu.variables
            self.assertIn("finite", self.refused(instance.set, setpoint_a=math.nan))
            self.assertIn("must be 0 to 4", self.refused(instance.set, gates=5))
            self.assertIn("must be 1e-06", self.refused(instance.set_all, {"machine.stator_resistance_ohm": 0.0}))
            self.assertIn("is an output", self.refused(instance.set_one, variables["speed_rad_s"], 1.0))
            self.assertIn("begins at 1 s", self.refused(instance.step, 1.0, 1e-3))
            self.assertIn("longer than 0", self.refused(instance.step, 0.0, 0.0))
            self.assertIn("finite", self.refused(instance.step, 0.0, math.inf))
            variables["gates"].reference = 4_000_000_000
            self.assertIn("4000000000", self.refused(instance.get, "gates"))
            variables["gates"].reference = variables["setpoint_a"].reference
            self.assertIn("there is no variable of type Int", self.refused(instance.get, "gates"))
            self.assertIn("of another bench", self.refused(instance.fmu.open, token="{other}"))
            self.assertIn("bench.toml", self.refused(instance.fmu.open, resources="/nowhere"))
        self.assertIn("file URI", self.refused(self.unit("servo", 2).open, resources="http://example.org/x"))
        self.assertIn("broken escape", self.refused(self.unit("servo", 2).open, resources="file:///a%zz"))

    # Catches: a unit that changes from one writing to the next, or a command line that guesses.
    def test_the_command_writes_the_same_bytes_and_refuses_in_words(self):
        for name in ("a.fmu", "b.fmu"):
            self.assertIn("215 variables", command("servo", "--out", self.folder / name))
        self.assertEqual((self.folder / "a.fmu").read_bytes(), (self.folder / "b.fmu").read_bytes())
        with zipfile.ZipFile(self.folder / "a.fmu") as archive:
            self.assertEqual({entry.date_time for entry in archive.infolist()}, {(1980, 1, 1, 0, 0, 0)})
        self.assertIn("must end with .fmu", command("servo", "--out", self.folder / "a.zip", code=2))
        self.assertIn("no bench file", command("nothing", code=2))
        self.assertIn("cannot write", command("servo", "--out", self.folder / "none" / "a.fmu", code=2))
        (self.folder / "bad.toml").write_text("[bench]\nname = 3\n", encoding="utf-8")
        self.assertIn("bench.name", command(self.folder / "bad.toml", code=2))


if __name__ == "__main__":
    unittest.main()
