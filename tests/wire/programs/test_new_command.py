#!/usr/bin/python3
"""drivebench new: files from data sheets, what they make of the numbers, and what contradicts itself."""
import math
import os
import pathlib
import pty
import re
import select
import subprocess
import sys
import tomllib
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from command_test import DRIVEBENCH, USAGE, CommandTest, environment
from wire_client import PATIENCE_S, REPOSITORY, Server, pb

KINDS = ("dc", "pm", "bldc", "im")
RAD_PER_RPM = math.pi / 30
PM = ["--pole-pairs", "4", "--resistance-line-ohm", "1.3", "--inductance-line-mh", "3.2", "--inertia-kgcm2", "0.33"]
DC = ["--resistance-ohm", "2", "--inductance-mh", "0.6", "--inertia-gcm2", "70"]
CIRCUIT = ["--resistance-phase-ohm", "1.85", "--rotor-ohm", "2.1", "--stator-leakage-ohm", "7.16", "--rotor-leakage-ohm", "7.16",
           "--magnetizing-ohm", "84.8", "--rated-hz", "60", "--inertia-kgm2", "0.0185"]
COUNTS = 1_000_000  # a coarse encoder would turn the voltages away from the emf


def trapezoid(angle):
    """The emf of a phase over its top: 0 at 0, 1 from 30 to 150 degrees."""
    turns = (angle / (2 * math.pi) - 0.25) % 1.0
    return max(-1.0, min(1.0, 3 - 12 * min(turns, 1 - turns)))


class NewTest(CommandTest):
    def new(self, *arguments, code=0):
        return self.drivebench("new", *arguments, code=code)

    def motor(self, *arguments):
        return tomllib.loads(self.new("motor", *arguments).stdout)

    def machine(self, *arguments):
        return self.motor(*arguments)["machine"]

    def bench(self, kind, *numbers, bus_v, max_current_a, period_us=100):
        """A motor file and a bench file for it, which the server accepts."""
        self.new("motor", kind, *numbers, "--out", "motor.toml")
        done = self.new("bench", "motor.toml", "--bus-v", bus_v, "--max-current-a", max_current_a, "--lines", COUNTS // 4,
                        "--period-us", period_us, "--out", "bench.toml")
        self.assertIn("accepts it", done.stderr)
        return self.folder / "bench.toml"

    def run_motor(self, bench, ticks, voltages, last=1000):
        """Commands voltages(sample, k), a list of three, at each tick; returns the last samples and voltages."""
        kept = []
        with Server(config=bench) as server, server.client() as client:
            client.ask(lease=pb.LeaseRequest(axis=0, action=pb.LeaseRequest.ACTION_ACQUIRE))
            sample = client.ask(exchange=pb.Exchange()).exchange_reply.samples[0].sample
            for k in range(ticks):
                u = voltages(sample, k)
                command = pb.Command(axis=0, tick=sample.tick, gates=pb.GATES_VOLTAGE, u_a_v=u[0], u_b_v=u[1], u_c_v=u[2])
                sample = client.ask(exchange=pb.Exchange(commands=[command])).exchange_reply.samples[0].sample
                if k >= ticks - last:
                    kept.append((sample, u))
        return kept


class MadeMotorsRun(NewTest):
    """Made, served, and driven by a short controller to the no-load point of the data sheet."""

    def test_a_motor_file_speaks_of_its_motor(self):
        """Catches: the scaling of three phases above the numbers of a motor that has none."""
        self.assertNotIn("two-phase", self.new("motor", "dc", *DC, "--kt", "0.05").stdout)
        self.assertIn("power-invariant:\n# amplitudes times sqrt(3/2), so that power and torque need no factor.\n# Made by: ",
                      self.new("motor", "pm", *PM, "--kt-rms", "0.5").stdout)

    def test_a_dc_motor(self):
        """Catches: a torque constant in other units, friction that is not that of the no-load current. In steady state the
        file's numbers have six digits and the run-up has e^-60 left: 0.1 %."""
        ohm, kv, idle_a, supply_v = 0.611, 369.0, 0.164, 24.0
        bench = self.bench("dc", "--resistance-ohm", ohm, "--inductance-mh", "0.119", "--kv", kv, "--inertia-gcm2", "33.5",
                           "--no-load-a", idle_a, bus_v=supply_v, max_current_a=50)
        samples = self.run_motor(bench, 4000, lambda sample, k: [supply_v, 0, 0])
        sample = samples[-1][0]
        self.assertAlmostEqual(sample.speed_rad_s / RAD_PER_RPM, (supply_v - ohm * idle_a) * kv, delta=9)
        self.assertAlmostEqual(sample.i_a_a, idle_a, delta=0.001 * idle_a)

    def test_a_pm_motor(self):
        """Catches: sqrt(3/2) forgotten, 22 %; rms for peak; a line for a phase. The controller and the expectation know phases
        only: 3 (V - R I) I = K_T I w. Steps of the angle within a tick and of the encoder leave less than 0.5 %."""
        kt_rms, line_ohm, line_h, idle_a, phase_v = 0.52, 1.3, 3.2e-3, 0.3, 50.0
        bench = self.bench("pm", *PM, "--kt-rms", kt_rms, "--ke-rms", "32", "--no-load-a", idle_a, bus_v=200, max_current_a=100)
        peak = math.sqrt(2)

        def voltages(sample, k):
            speed = 4 * sample.speed_rad_s
            angle = 4 * (sample.encoder_count + 0.5) * 2 * math.pi / COUNTS + speed * 0.5e-4
            across, along = phase_v * peak, -speed * line_h / 2 * idle_a * peak  # the current in phase with the emf
            return [along * math.cos(angle - n * 2 * math.pi / 3) - across * math.sin(angle - n * 2 * math.pi / 3) for n in range(3)]

        samples = self.run_motor(bench, 6000, voltages)
        speed = sum(s.speed_rad_s for s, _ in samples) / len(samples)
        self.assertAlmostEqual(speed, 3 * (phase_v - line_ohm / 2 * idle_a) / kt_rms, delta=0.005 * speed)
        rms = math.sqrt(sum(s.i_a_a**2 + s.i_b_a**2 + s.i_c_a**2 for s, _ in samples) / 3 / len(samples))
        self.assertAlmostEqual(rms, idle_a, delta=0.02 * idle_a)

    def test_a_brushless_dc_motor(self):
        """Catches: a constant of a phase for that of two in series. The flat tops of the applied trapezoids are as far apart as
        the supply, which delivers V I_0. At 3 V the current follows its voltage (w L/R = 0.25): the lag takes 6 % of the
        torque, so that much more power, and 0.2 % of the speed."""
        kv, line_ohm, idle_a, supply_v = 259.0, 0.46, 0.234, 3.0
        bench = self.bench("bldc", "--pole-pairs", 4, "--resistance-line-ohm", line_ohm, "--inductance-line-mh", "0.35", "--kv", kv,
                           "--inertia-gcm2", 119, "--no-load-a", idle_a, bus_v=50, max_current_a=100, period_us=20)

        def voltages(sample, k):
            angle = 4 * (sample.encoder_count * 2 * math.pi / COUNTS + sample.speed_rad_s * 1e-5)
            return [-supply_v / 2 * trapezoid(angle - n * 2 * math.pi / 3) for n in range(3)]

        samples = self.run_motor(bench, 5000, voltages, last=2000)
        rpm = sum(s.speed_rad_s for s, _ in samples) / len(samples) / RAD_PER_RPM
        self.assertAlmostEqual(rpm, (supply_v - line_ohm * idle_a) * kv, delta=0.01 * rpm)
        power = sum(u[0] * s.i_a_a + u[1] * s.i_b_a + u[2] * s.i_c_a for s, u in samples) / len(samples)
        self.assertAlmostEqual(power, supply_v * idle_a, delta=0.06 * power)

    def test_an_induction_motor_repeats_its_no_load_test(self):
        """Catches: line to line for a phase, the power of one phase for that of three, friction of another pole number. The slip
        that the test neglects leaves 0.3 % of the current."""
        volt, ampere, watt = 208.0, 1.305, 30.0
        bench = self.bench("im", "--poles", 6, "--rated-hz", 60, "--resistance-line-ohm", 3.7, "--no-load-v", volt, "--no-load-a",
                           ampere, "--no-load-w", watt, "--blocked-v", 69.81, "--blocked-a", 2.823, "--blocked-w", 86.9,
                           "--inertia-kgm2", 0.002, bus_v=400, max_current_a=50)
        peak = volt * math.sqrt(2 / 3)

        def voltages(sample, k):
            angle = 2 * math.pi * 60 * (k + 0.5) * 1e-4
            return [peak * math.cos(angle - n * 2 * math.pi / 3) for n in range(3)]

        samples = self.run_motor(bench, 12000, voltages)  # its end: six periods
        speed = samples[-1][0].speed_rad_s
        self.assertTrue(0.99 < speed / (2 * math.pi * 60 / 3) < 1.0, speed)
        rms = math.sqrt(sum(s.i_a_a**2 + s.i_b_a**2 + s.i_c_a**2 for s, _ in samples) / 3 / len(samples))
        self.assertAlmostEqual(rms, ampere, delta=0.01 * ampere)
        power = speed * self.friction_nm() + 3 * 1.85 * rms**2
        self.assertAlmostEqual(power, watt, delta=0.01 * watt)
        self.assertIn("(30 - 3 * 1.305^2 * 1.85) * 3 / (2 pi * 60)   [--no-load-w, W]", (self.folder / "motor.toml").read_text(encoding="utf-8"))

    def friction_nm(self):
        return tomllib.loads((self.folder / "motor.toml").read_text(encoding="utf-8"))["mechanics"]["coulomb_friction_nm"]


class Cases(NewTest):
    def test_a_case_without_a_load_and_one_on_a_bench_by_name(self):
        """Catches: a load that nobody asked for, a path from the wrong folder, a word of the command that is lost or runs together."""
        text = self.new("case", "dc-a-voltage", "--command", "./a  'b\"", "--speed-rad-s", 0).stdout
        case = tomllib.loads(text)
        self.assertEqual((case["bench"], case["dut"]["command"]), ("dc-a-voltage", ["./a", "'b\""]))
        self.assertNotIn("step", case)
        self.assertEqual([check["kind"] for check in case["check"]], ["settles", "fault_count"])
        self.bench("dc", *DC, "--kt", 0.05, bus_v=24, max_current_a=10)
        (self.folder / "suite").mkdir()
        self.new("case", "bench.toml", "--command", "x", "--speed-rad-s", -50, "--load-nm", 0.01, "--out", "suite/case.toml")
        case = tomllib.loads((self.folder / "suite/case.toml").read_text(encoding="utf-8"))
        self.assertEqual((case["bench"], case["check"][0]["band"], case["step"][0]["load_nm"]), ("../bench.toml", 1.0, 0.01))
        for wrong, rule in ((("--command", " "), "--command is empty but must name a program"),
                            (("--command", "x\ny"), "plain text"), (("--command", "x", "--out", "suite/case.toml"), "is there already")):
            self.assertIn(rule, self.new("case", "bench.toml", "--speed-rad-s", 1, *wrong, code=USAGE).stderr)


class Conversions(NewTest):
    def test_one_pm_motor_in_every_form(self):
        """Catches: a factor in one of the forms. From the flux of a phase: its peak emf over speed is n_p lambda, the torque over
        the peak current 3/2 of that, and the power-invariant constant sqrt(3/2) of it."""
        flux_wb = 0.05
        phase = 4 * flux_wb
        line = math.sqrt(3) * phase
        forms = {"lambda-wb": flux_wb, "kt-peak": 1.5 * phase, "kt-rms": 1.5 * phase * math.sqrt(2),
                 "kv-peak": 1 / line / RAD_PER_RPM, "kv-rms": math.sqrt(2) / line / RAD_PER_RPM,
                 "ke-peak": line * 1000 * RAD_PER_RPM, "ke-rms": line / math.sqrt(2) * 1000 * RAD_PER_RPM}
        for form, value in forms.items():
            made = self.machine("pm", *PM, f"--{form}", repr(value))["torque_constant_nm_per_a"]
            self.assertAlmostEqual(made, math.sqrt(1.5) * phase, delta=1e-6, msg=form)
        every = [word for form, value in forms.items() for word in (f"--{form}", repr(value))]
        self.assertEqual(self.new("motor", "pm", *PM, *every).stdout.count("agrees:"), len(forms) - 1)

    def test_phases_lines_deltas_poles_and_inertias(self):
        """Catches: a line taken for a phase, a delta for a star, poles for pairs, g cm^2 for kg cm^2."""
        star = self.machine("pm", *PM, "--kt-rms", 0.52)
        self.assertEqual((star["stator_resistance_ohm"], star["inductance_d_h"], star["inductance_q_h"]), (0.65, 1.6e-3, 1.6e-3))
        in_uh = ["--inductance-line-uh" if word == "--inductance-line-mh" else "3200" if word == "3.2" else word for word in PM]
        self.assertEqual(self.machine("pm", *in_uh, "--kt-rms", 0.52), star)
        delta = self.machine("pm", "--poles", 8, "--resistance-phase-ohm", 1.95, "--ld-mh", 4.8, "--lq-mh", 9.6, "--delta", "--lambda-wb",
                             0.05 * math.sqrt(3), "--inertia-gcm2", 330)
        self.assertEqual((delta["pole_pairs"], delta["stator_resistance_ohm"], delta["inductance_d_h"], delta["inductance_q_h"]),
                         (4, 0.65, 1.6e-3, 3.2e-3))
        self.assertAlmostEqual(delta["torque_constant_nm_per_a"], math.sqrt(1.5) * 0.2, delta=1e-6)
        for option, value in (("kgm2", 7e-6), ("gcm2", 70), ("kgcm2", 0.07)):
            mechanics = self.motor("dc", *DC[:4], "--kt", 0.05, f"--inertia-{option}", value)["mechanics"]
            self.assertAlmostEqual(mechanics["inertia_kgm2"], 7e-6, delta=1e-12)
        for option, value in (("kt", 0.05), ("kv", 0.5 / math.pi * 60 / 0.05), ("ke", 50 * RAD_PER_RPM)):
            self.assertAlmostEqual(self.machine("dc", *DC, f"--{option}", value)["torque_constant_nm_per_a"], 0.05, delta=1e-7)
            self.assertAlmostEqual(self.machine("bldc", *PM, f"--{option}", value)["torque_constant_nm_per_a"], 0.025, delta=1e-7)

    def test_induction_motors(self):
        """Catches: reactances for inductances, a delta's phases for a star's, tests that leave the magnetising branch out. The tests
        are those that the circuit of the README's motor has."""
        circuit = self.machine("im", "--pole-pairs", 3, *CIRCUIT)
        self.assertAlmostEqual(circuit["stator_inductance_h"], 0.24393, delta=1e-5)
        self.assertAlmostEqual(circuit["mutual_inductance_h"], 0.22494, delta=1e-5)
        tripled = [str(3 * float(word)) if CIRCUIT[n - 1].endswith("-ohm") else word for n, word in enumerate(CIRCUIT)]
        self.assertEqual(self.machine("im", "--poles", 6, *tripled, "--delta"), circuit)
        self.assertEqual(self.machine("im", "--rated-rpm", 1165, *CIRCUIT)["pole_pairs"], 3)
        self.assertEqual(self.motor("im", "--poles", 6, *CIRCUIT, "--friction-nm", 0.1)["mechanics"]["coulomb_friction_nm"], 0.1)
        tested = self.machine("im", "--poles", 6, "--rated-hz", 60, "--resistance-line-ohm", 3.7, "--no-load-v", 208, "--no-load-a", 1.3052,
                              "--no-load-w", 10.263, "--blocked-v", 69.81, "--blocked-a", 2.82282, "--blocked-w", 86.897,
                              "--inertia-kgm2", 0.0185)
        for key in ("rotor_resistance_ohm", "stator_inductance_h", "mutual_inductance_h"):
            self.assertAlmostEqual(tested[key], circuit[key], delta=0.004 * circuit[key], msg=key)

    def test_the_number_of_the_data_sheet_stands_in_the_comment(self):
        """Catches: a value whose derivation is left out."""
        text = self.new("motor", "pm", *PM, "--kt-rms", 0.52).stdout
        self.assertSays(text, "0.52 / sqrt(3)   [--kt-rms, N*m/A rms]", "1.3 / 2", "3.2 * 1e-3 / 2", "0.33 * 1e-4", "power-invariant",
                        "# Made by: drivebench new motor pm --pole-pairs 4 ")
        again = re.search(r"Made by: drivebench (new .*)", text)[1]
        self.assertEqual(self.drivebench(*again.split()).stdout, text)


class WhatContradictsItself(NewTest):
    def test_is_told_with_both_numbers(self):
        """Catches: a data sheet that is read wrong and gives a motor all the same."""
        for arguments, facts in (
                (["pm", *PM, "--kt-rms", 0.52, "--kt-peak", 0.52], ["--kt-rms 0.52 makes", "0.3002", "--kt-peak 0.52", "0.4246", "sqrt(2)"]),
                (["pm", *PM, "--kt-rms", 0.52, "--lambda-wb", 0.123], ["0.6026", "nearly 2: poles"]),
                (["dc", *DC, "--kt", 0.05, "--kv", 300], ["0.05", "0.03183"]),
                (["dc", *DC, "--kt", 0.05, "--rated-a", 1, "--rated-nm", 0.07], ["makes 0.05 N*m", "--rated-nm is 0.07", "sqrt(2)"]),
                (["dc", *DC, "--kt", 0.05, "--no-load-rpm", 9000, "--no-load-v", 24], ["4583", "9000"]),
                (["dc", *DC, "--kt", 0.05, "--no-load-rpm", 9000], ["belong together"]),
                (["pm", "--poles", 7, *PM[2:], "--kt-rms", 0.5], ["3.5", "whole number"]),
                (["im", "--pole-pairs", 6, "--rated-rpm", 1165, *CIRCUIT], ["--pole-pairs 6 makes", "--rated-rpm 1165 makes it 3", "poles for pole pairs"]),
                (["im", "--rated-rpm", 1165, "--rated-v", 208, "--rated-w", 5000, *CIRCUIT], ["40.98", "pulls out at"]),
                (["im", "--rated-rpm", 1165, "--rated-v", 208, "--rated-a", 5.5, *CIRCUIT], ["A of line current", "the nameplate 5.5"]),
                (["im", *CIRCUIT[:2], "--pole-pairs", 3, "--rated-hz", 60, "--no-load-v", 208, "--no-load-a", 1.3, "--no-load-w", 900,
                  "--blocked-v", 70, "--blocked-a", 2.8, "--blocked-w", 87, "--inertia-kgm2", 0.01], ["900", "more than sqrt(3) V A"]),
                (["dc", *DC, "--kt", "nan"], ["--kt", "nan"]), (["dc", *DC, "--kt", 0.05, "--name", "a\nb"], ["--name", "plain"])):
            self.assertSays(self.new("motor", *arguments, code=USAGE).stderr, *facts)

    def test_missing_numbers_are_told_together(self):
        """Catches: one missing number told at a time; a program that waits for an answer without a terminal."""
        self.assertSays(self.new("motor", "pm", "--pole-pairs", 4, code=USAGE).stderr, "resistance", "inductance", "--kt-rms", "--lambda-wb",
                        "--inertia-gcm2")
        self.assertSays(self.new("motor", "im", "--no-load-v", 208, code=USAGE).stderr, "--blocked-w", "--rated-hz", "--poles")
        self.new("motor", "dc", *DC, "--kt", 0.05, "--out", "motor.toml")
        self.assertSays(self.new("bench", "motor.toml", code=USAGE).stderr, "--bus-v", "--max-current-rms", "--cpr")

    def test_files_of_others_stay(self):
        """Catches: a file that is written over, and a bench for a motor that it has no drive for."""
        (self.folder / "mine.toml").write_text("mine", encoding="utf-8")
        self.assertIn("there already", self.new("motor", "dc", *DC, "--kt", 0.05, "--out", "mine.toml", code=USAGE).stderr)
        self.assertEqual((self.folder / "mine.toml").read_text(encoding="utf-8"), "mine")
        self.assertIn("wound_rotor_synchronous", self.new("bench", "wound-rotor", "--bus-v", 1, "--max-current-a", 1, "--cpr", 4, code=USAGE).stderr)


class Questions(NewTest):
    def test_a_terminal_is_asked_for_what_is_missing(self):
        """Catches: a question that is not asked, an answer that cannot be corrected."""
        master, slave = pty.openpty()
        process = subprocess.Popen([str(DRIVEBENCH), "new", "motor", "dc", "--resistance-ohm", "2", "--out", "asked.toml"], stdin=slave,
                                   stdout=slave, stderr=slave, cwd=self.folder, env=environment(), close_fds=True)
        os.close(slave)
        told = ""
        for question, answer in (("[mH]: ", "0.6"), ("'kt 1.5': ", "kx 3"), ("none of these forms", ""), ("'kt 1.5': ", "kv many"),
                                 ("is not a number", ""), ("'kt 1.5': ", "kv 369"), ("'inertia-kgm2 1.5': ", "inertia-gcm2 33.5")):
            while question not in told:
                if not select.select([master], [], [], PATIENCE_S)[0]:
                    self.fail(f"no '{question}' in {told}")
                told += os.read(master, 4096).decode()
            told = told.split(question, 1)[1]
            if answer:
                os.write(master, (answer + "\n").encode())
        self.assertEqual(process.wait(PATIENCE_S), 0)
        os.close(master)
        made = tomllib.loads((self.folder / "asked.toml").read_text(encoding="utf-8"))
        self.assertAlmostEqual(made["machine"]["torque_constant_nm_per_a"], 0.0258788, delta=1e-7)
        self.assertAlmostEqual(made["mechanics"]["inertia_kgm2"], 3.35e-6)


class Help(NewTest):
    def test_the_example_of_each_help_runs(self):
        """Catches: an example with an option that is gone, and a motor that no server accepts."""
        for kind in KINDS:
            with self.subTest(kind):
                text = self.new("motor", kind, "--help").stdout
                example = re.search(rf"drivebench (new motor .*) --out my-{kind}.toml", text)[1]
                self.drivebench(*example.split(), "--out", f"{kind}.toml")
                for mode in ("lockstep", "realtime"):
                    self.new("bench", f"{kind}.toml", "--mode", mode, "--bus-v", 48, "--max-current-rms", 10, "--cpr", 4096, "--out",
                             f"{kind}-{mode}.toml")

    def test_a_bench_for_the_motors_of_this_project(self):
        """Catches: a path that is not relative to the bench file, a two-phase motor on the bridge of a star."""
        (self.folder / "benches").mkdir()
        for motor in ("servo-im", "pm-stepper", "bm500", "bldc", "dc-a"):
            out = f"benches/{motor}.toml"
            self.new("bench", REPOSITORY / f"configs/motors/{motor}.toml", "--bus-v", 100, "--max-current-a", 10, "--cpr", 4000, "--out", out)
            made = tomllib.loads((self.folder / out).read_text(encoding="utf-8"))["axis"][0]
            self.assertEqual(made["amplifier"]["voltage_limit_v"], 50.0 if motor in ("bm500", "bldc") else 100.0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
