#!/usr/bin/python3
"""`drivebench identify` against the real server."""
import json
import os
import pathlib
import re
import signal
import socket
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

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import BENCHES, PATIENCE_S, REPOSITORY, SERVER, guarded
from wire_test import WireTest, until

PROGRAM = str(SERVER.parent / "drivebench")


class Identify(WireTest):
    """The program drivebench."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="drivebench-identify-test-")
        self.addCleanup(folder.cleanup)
        self.path = pathlib.Path(folder.name)
        self.environment = guarded({name: value for name, value in os.environ.items() if not name.startswith("DRIVEBENCH_")})
        # No server listens there, so that none is found by chance.
        self.environment.update(DRIVEBENCH_LINK=f"unix:{self.path}/nothing", XDG_CONFIG_HOME=str(self.path),
                                TMPDIR=str(self.path))

    def drivebench(self, *words):
        return subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, timeout=PATIENCE_S * 2,
                              env=self.environment, cwd=REPOSITORY, check=False)

    def identify(self, *words, code=0):
        ran = self.drivebench("identify", *words)
        self.assertEqual(ran.returncode, code, ran.stdout + ran.stderr)
        return ran

    def parameters(self, *words, code=0):
        return json.loads(self.identify(*words, "--json", code=code).stdout)

    def assertPercent(self, found, name, percent):
        row = found["parameters"][name]
        self.assertLess(abs(row["estimate"] / row["truth"] - 1.0), 0.01 * percent, f"{name}: {row}")

    def test_one_command_runs_the_experiment_and_writes_the_motor(self):
        """Catches: the example of the README with the truth of another motor, a fit that is none, unreadable files, a
        server or a folder that stays behind."""
        files = {name: self.path / f"im.{name}" for name in ("md", "svg", "toml", "csv")}
        found = self.parameters("--motor", "im", "--experiment", "dol-start", "--markdown", files["md"], "--plot",
                                files["svg"], "--motor-file", files["toml"], "--data", files["csv"])
        for name, percent in (("R_S", 1), ("T_R", 1), ("L_S", 1), ("sigma", 1), ("M", 1), ("J", 3), ("tau_L", 5)):
            self.assertPercent(found, name, percent)
        self.assertAlmostEqual(found["parameters"]["T_R"]["truth"], 0.67 / 8.6)
        self.assertEqual(found["parameters"]["tau_L"]["truth"], 3.7)
        self.assertTrue(found["identifiable"])
        self.assertTrue(all(row["inside"] for row in found["parameters"].values()))
        self.assertEqual(found["settings"]["voltage_shift"], 0.0)
        self.assertEqual(found["experiment"]["state"], "completed")
        self.assertTrue(found["validation"]["from_rest"])
        self.assertEqual(set(found["validation"]["signals"]), {"i_a_a", "i_b_a", "i_c_a", "speed_rad_s"})
        for name, fit in found["validation"]["signals"].items():
            self.assertLess(fit["normalised"], 0.02, name)
        self.assertIn("| R_S | ohm |", files["md"].read_text(encoding="utf-8"))
        self.assertIn("](im.svg)", files["md"].read_text(encoding="utf-8"))
        self.assertIn("re-simulated", files["svg"].read_text(encoding="utf-8"))
        self.assertEqual(len(files["csv"].read_text(encoding="utf-8").splitlines()), 802)
        self.assertEqual({path.name for path in self.path.iterdir()}, {f"im.{name}" for name in files})

        # The motor file is a motor: a bench with it loads and shows the identified parameters.
        bench = (BENCHES / "im-8-5-5.toml").read_text(encoding="utf-8").replace("../motors/im-8-5-5.toml", str(files["toml"]))
        with self.server(text=bench) as server:
            described = json.loads(self.drivebench("describe", "--json", "--link", f"tcp:{server.ready['tcp']}").stdout)
            values = {p["name"]: p["value"] for p in described["axes"][0]["parameters"]}
            self.assertEqual(values["machine.stator_resistance_ohm"], found["parameters"]["R_S"]["estimate"])
            self.assertEqual(values["mechanics.inertia_kgm2"], found["parameters"]["J"]["estimate"])

        # The written CSV gives the same motor.
        again = self.parameters("--motor", "im", "--from", files["csv"], "--pole-pairs", 2, "--counts", 2048, "--voltages",
                                "instant", "--window", "0.005:0", "--load", "constant")
        self.assertEqual(again["parameters"]["R_S"]["estimate"], found["parameters"]["R_S"]["estimate"])
        self.assertIsNone(again["parameters"]["R_S"]["truth"])
        words = ("--motor", "im", "--from", files["csv"], "--counts", 2048, "--window", "0.005:0", "--load", "constant")
        found_alone = self.parameters(*words)
        self.assertEqual(found_alone["parameters"]["R_S"]["estimate"], found["parameters"]["R_S"]["estimate"])
        self.assertEqual(found_alone["settings"]["pole_pairs"], 2)
        self.assertEqual(found_alone["settings"]["voltage_shift"], 0.0)
        self.assertEqual(found_alone["wiring"]["direction"]["found"], 1)
        told = self.parameters(*words, "--pole-pairs", 3, code=1)
        self.assertTrue(told["wiring"]["pole_pairs"]["contradicts"])
        self.assertEqual(told["wiring"]["pole_pairs"]["found"], 2)
        self.assertIn("BUT THE DATA SAY 2", self.identify(*words, "--pole-pairs", 3, code=1).stdout)
        self.assertIn("voltages advanced by 0.5 samples",
                      self.identify("--motor", "im", "--from", files["csv"], "--pole-pairs", 2, "--counts", 2048,
                                    "--voltages", "mean", "--load", "constant", code=1).stdout)  # which they are not

    def test_a_bench_whose_motor_saturates_shows_its_curve(self):
        """The motor found goes back into the bench and starts like the one that was measured. Catches: a machine of
        another kind that is refused by its name, a curve that the bench does not take, one of another motor."""
        motor = self.path / "saturated.toml"
        words = ("--motor", "im", "--experiment", "dol-start", "--bench")
        found = self.parameters(*words, "im-8-5-5-saturated", "--motor-file", motor)
        self.assertEqual(found["kind"], "saturated_induction")
        for name, percent in (("R_S", 0.3), ("R_R", 1), ("l_s", 3), ("l_r", 3), ("J", 1)):
            self.assertPercent(found, name, percent)
        for point in found["magnetising_curve"]:
            flux, current = point["flux_wb"], point["current_a"]
            self.assertAlmostEqual(current, flux / 0.64 * (1 + (flux / 1.6) ** 6), delta=0.03 * current)
        for output, fit in found["validation"]["signals"].items():
            self.assertLess(fit["normalised"], 0.005, output)  # a start from a filtered sample, not from rest, leaves 0.02
        bench = self.path / "again.toml"
        text = (BENCHES / "im-8-5-5-saturated.toml").read_text(encoding="utf-8")
        bench.write_text(re.sub(r"motor = .*", f'motor = "{motor}"', text), encoding="utf-8")
        again = self.parameters(*words, bench)
        self.assertPercent(again, "R_R", 1)
        self.assertEqual(len(again["magnetising_curve"]), 5)

    def test_every_named_experiment_identifies_its_motor(self):
        """Catches: an experiment that its bench refuses, or that does not identify its parameters."""
        listed = json.loads(self.identify("--list", "--json").stdout)["experiments"]
        self.assertEqual({e["motor"] for e in listed}, {"im", "dc", "pm", "bldc"})
        promised = {"im/no-load-start": {"R_S": 1, "T_R": 1, "L_S": 1, "sigma": 1, "J": 3, "f": 10},
                    "dc/voltage-steps": {"R": 0.5, "L": 1, "K_T": 0.5, "J": 2, "f": 10},
                    "dc/two-sines": {"R": 0.5, "L": 1, "K_T": 0.5, "J": 2, "f": 10},
                    "pm/swing": {"R_S": 1, "L_S": 1, "K_m": 0.5, "J": 1},
                    "pm/salient-swing": {"R_S": 0.1, "L_d": 0.1, "L_q": 0.1, "L_g": 0.1, "K_m": 0.1, "J": 0.1, "f": 1},
                    "pm/ramp": {"R_S": 5, "L_S": 5, "K_m": 2, "J": 10},
                    "bldc/swing": {"R_S": 2, "L+M": 3, "tau_p": 0.5, "J": 5, "f": 5}}
        for experiment in listed:
            name = f"{experiment['motor']}/{experiment['name']}"
            if name == "im/dol-start" or experiment["test"]:
                continue  # see the test above, and test_classical_command.py
            with self.subTest(name):
                found = self.parameters("--motor", experiment["motor"], "--experiment", experiment["name"])
                for parameter, percent in promised.pop(name).items():
                    self.assertPercent(found, parameter, percent)
                for output, fit in found["validation"]["signals"].items():
                    self.assertLess(fit["normalised"], 0.08, output)
        self.assertEqual(promised, {})

    def test_a_running_server_is_used_and_a_wrong_one_refused(self):
        """Catches: a bench other than the requested one, or the truth of another."""
        text = (BENCHES / "dc-a-voltage.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        text += "\n[axis.machine]\narmature_resistance_ohm = 3.0\n"
        server = self.server("--experiments", str(self.path / "kept"), text=text)
        self.environment["DRIVEBENCH_LINK"] = f"tcp:{server.ready['tcp']}"
        found = self.parameters("--motor", "dc")
        self.assertEqual(found["parameters"]["R"]["truth"], 3.0)
        self.assertPercent(found, "R", 0.5)
        kept = list((self.path / "kept").glob("*.mcap"))
        self.assertEqual(len(kept), 1)

        # Its recording gives the same motor, with the truth and the rest from its configuration.
        from_file = self.parameters("--motor", "dc", "--from", kept[0])
        self.assertEqual(from_file["parameters"]["R"]["truth"], 3.0)
        self.assertPercent(from_file, "R", 0.5)
        self.assertEqual(from_file["settings"]["voltage_shift"], 0.5)

        # A setting of the experiment is part of the truth.
        toml = self.path / "own.toml"
        steps = (REPOSITORY / "configs/experiments/dc-a-steps.toml").read_text(encoding="utf-8")
        toml.write_text('settings = [{ name = "machine.armature_resistance_ohm", value = 4.0 }]\n' + steps, encoding="utf-8")
        found = self.parameters("--motor", "dc", "--experiment", toml)
        self.assertEqual(found["parameters"]["R"]["truth"], 4.0)
        self.assertPercent(found, "R", 0.5)

        # A server that the command line names must be the right one; beside one at the default link, another is
        # started.
        wrong = self.identify("--motor", "im", "--link", self.environment["DRIVEBENCH_LINK"], code=2)
        self.assertIn("has no axis im-8-5-5, but dc-a", wrong.stderr)
        other = self.identify("--motor", "im")
        self.assertIn("starting a server on im-8-5-5", other.stderr)
        self.environment["DRIVEBENCH_LINK"] = "tcp:127.0.0.1:1"
        self.identify("--motor", "dc", "--link", "tcp:127.0.0.1:1", code=3)

    def test_an_unsuitable_server_at_the_default_link_is_passed_over(self):
        """Catches: a user who must first stop an unsuitable server: one that keeps no experiments, one that asks for a
        token, one that speaks another protocol, a link that only `control` understands."""
        text = (BENCHES / "dc-a-voltage.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        (self.path / "tokens").write_text('[[token]]\nname = "a"\nrole = "viewer"\ntoken = "secret"\n', encoding="utf-8")
        (self.path / "tokens").chmod(0o600)
        bare = f"tcp:{self.server(text=text).ready['tcp']}"
        asking = text + f'\n[tcp]\ntokens_file = "{self.path}/tokens"\n'
        closed = f"tcp:{self.server(text=asking).ready['tcp']}"
        stranger = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(stranger.close)
        threading.Thread(target=answer_in_http, args=(stranger,), daemon=True).start()
        for link, why, code in ((bare, "keeps no experiments", 1), (closed, "turns this client away", 3),
                                ("tcp:%s:%d" % stranger.getsockname(), "does not speak", 1), ("can:socketcan:can0", "over CAN", 2),
                                ("modbus:127.0.0.1:1", "over CAN and Modbus", 2)):
            with self.subTest(link):
                self.environment["DRIVEBENCH_LINK"] = link
                passed = self.identify("--motor", "dc")
                self.assertIn(why, passed.stderr)
                self.assertIn("starting a server on dc-a-voltage", passed.stderr)
                self.assertIn(why, self.identify("--motor", "dc", "--link", link, code=code).stderr)

    def test_a_wrong_bench_file_is_2(self):
        """Catches: a mistake in a configuration that a script takes for a failed experiment."""
        broken = self.path / "broken.toml"
        broken.write_text("[bench]\nperiod_us = 0\n", encoding="utf-8")
        ran = self.identify("--motor", "dc", "--bench", broken, code=2)
        self.assertIn("broken.toml:2: bench.period_us", ran.stderr)
        self.assertIn("does not take the bench", ran.stderr)

    def test_parameters_that_the_data_do_not_determine_are_a_failure(self):
        """Catches: an exit code of 0, a number or a motor file although the data do not determine the motor."""
        toml = self.path / "constant.toml"
        toml.write_text('axis = "dc-a"\nduration_s = 0.2\ninitial = { speed_rad_s = 65.9 }\nsignals = ["i_a_a"]\n[input]\n'
                        'kind = "none"\n', encoding="utf-8")
        motor = self.path / "motor.toml"
        ran = self.identify("--motor", "dc", "--experiment", toml, "--bench", "dc-a-voltage", "--motor-file", motor, code=1)
        self.assertIn("not seen", ran.stdout)
        self.assertIn("no motor file", ran.stderr)
        self.assertFalse(motor.exists() and motor.stat().st_size > 0)

    def test_a_motor_at_constant_speed_is_refused_with_the_experiment_that_helps(self):
        """Catches: a PM motor whose R_S is five times too large, stated because the encoder's noise passes for excitation."""
        toml = self.path / "constant.toml"
        toml.write_text('axis = "pm-9-3"\nduration_s = 0.3\nsignals = ["i_a_a"]\n'
                        'settings = [{ name = "amplifier.delay_ticks", value = 0 }, { name = "amplifier.filter_hz", value = 0 }]\n'
                        '[input]\nkind = "dq_voltages"\nangle = "true"\n[[input.shapes]]\nchannel = "q"\n'
                        'constant = { value = 10.0 }\n', encoding="utf-8")
        motor = self.path / "motor.toml"
        words = ("--motor", "pm", "--experiment", toml, "--bench", "pm-9-3", "--window", "0.15:0.3", "--shaft-hz", "30")
        ran = self.identify(*words, "--motor-file", motor, code=1)
        self.assertIn("swings several times a second", ran.stdout)
        self.assertFalse(motor.exists() and motor.stat().st_size > 0)
        found = self.parameters(*words, code=1)
        self.assertFalse(found["identifiable"])
        for name in ("R_S", "K_m", "J"):
            self.assertIsNone(found["parameters"][name]["estimate"], name)
            self.assertIsNone(found["parameters"][name]["by_equations"], name)

    def test_the_csv_of_a_controller_is_read_as_it_is(self):
        """Catches: headers of a dialect that only their own command reads, an angle that begins anew with the run."""
        server = self.server(text=(BENCHES / "dc-a-voltage.toml").read_text(encoding="utf-8").replace(
            "../motors/", f"{REPOSITORY}/configs/motors/"))
        moved = self.path / "move.csv"
        ran = self.drivebench("control", "--preset", "book/2.23", "--csv", moved, "--link", f"tcp:{server.ready['tcp']}")
        self.assertEqual(ran.returncode, 0, ran.stdout + ran.stderr)
        ran = self.drivebench("identify", "--motor", "dc", "--from", moved, "--counts", 2000, "--json")
        found = json.loads(ran.stdout)
        self.assertEqual(found["settings"]["voltage_shift"], 0.5)
        self.assertEqual(found["wiring"]["direction"]["found"], 1)
        for name, truth in (("R", 2.0), ("K_T", 0.07)):
            self.assertAlmostEqual(found["parameters"][name]["estimate"] / truth, 1.0, delta=0.01)

    def test_a_foreign_file_is_read_by_its_column_map(self):
        """Catches: a column map that takes the wrong column or scale."""
        own = self.path / "own.csv"
        self.identify("--motor", "dc", "--data", own)
        rows = [line.split(",") for line in own.read_text(encoding="utf-8").splitlines()]
        place = {name.split(" ")[0]: k for k, name in enumerate(rows[0])}
        foreign = self.path / "foreign.csv"
        lines = ["t_ms;Ia_mA;U;pos"]
        for row in rows[1:]:
            lines.append(";".join((repr(1e3 * float(row[0])), repr(1e3 * float(row[place["i_a_a"]])), row[place["u_a_v"]],
                                   row[place["encoder_count"]])))
        foreign.write_text("\n".join(lines) + "\n", encoding="utf-8")
        column_map = self.path / "map.toml"
        column_map.write_text('time = "t_ms"\ntime_factor = 1e-3\n[columns]\nu_a_v = "U"\nencoder_count = "pos"\n'
                              'i_a_a = { header = "Ia_mA", factor = 1e-3 }\n', encoding="utf-8")
        by_file = self.parameters("--motor", "dc", "--from", foreign, "--map", column_map, "--counts", 2000)
        self.assertAlmostEqual(by_file["parameters"]["R"]["estimate"], 2.0, delta=0.01)
        by_words = self.parameters("--motor", "dc", "--from", foreign, "--map", "Ia_mA=i_a_a*1e-3", "--map", "U=u_a_v",
                                   "--map", "pos=encoder_count", "--period", "1e-4", "--counts", 2000)
        self.assertAlmostEqual(by_words["parameters"]["R"]["estimate"], by_file["parameters"]["R"]["estimate"], places=6)

        def refused(text, *words):
            self.assertIn(text, self.identify("--motor", "dc", "--from", foreign, *words, code=2).stderr)

        refused("foreign.csv:1: Strom: no such column; there are t_ms, Ia_mA, U, pos", "--map", "Strom=i_a_a", "--period", "1e-4")
        refused("--counts is missing", "--map", column_map)
        foreign.write_text("\n".join(lines[:100]) + "\n9.9;12;oops;5\n", encoding="utf-8")
        refused("foreign.csv:101: U: 'oops' is not a number", "--map", column_map, "--counts", "2000")
        foreign.write_bytes(os.urandom(5000))
        refused("foreign.csv:1:", "--counts", "2000")
        foreign.unlink()
        refused("cannot be read", "--counts", "2000")

    def noisy_bench(self, seed):
        """dc-a-voltage with currents of 12 bits and their noise."""
        text = (BENCHES / "dc-a-voltage.toml").read_text(encoding="utf-8")
        text = text.replace("[bench]", f"[bench]\nseed = {seed}").replace('"../motors/', f'"{BENCHES.parent}/motors/')
        bench = self.path / f"noisy-{seed}.toml"
        bench.write_text(text + "\n[axis.current_sensor]\nbits = 12\nfull_scale_a = 10.0\nnoise_rms_a = 0.01\n",
                         encoding="utf-8")
        return bench

    def test_a_suggested_experiment_keeps_its_limits_and_its_promise(self):
        """Catches: a suggestion beyond a limit, one worse than what there is, a forecast that the experiment from the
        file does not keep, an experiment that suits one seed of the noise only."""
        suggested = self.path / "suggested.toml"
        limits = ("--max-current", 4, "--max-voltage", 10, "--max-speed", 60)
        told = json.loads(self.identify("--motor", "dc", "--bench", self.noisy_bench(1), "--suggest", *limits, "--trials",
                                        30, "--suggest-file", suggested, "--json").stdout)
        best = told["suggested"]
        existing = {row["name"]: row for row in told["existing"]}
        self.assertGreater(existing["voltage-steps"]["limit_used"], 1.0)  # 6.3 A
        self.assertIn("no current loop", existing["two-sines"]["problem"])
        self.assertLessEqual(best["limit_used"], 1.0)
        self.assertGreater(best["limit_used"], 0.8)  # an experiment that hardly moves the motor is none
        # Beside noise an interval is inverse to the amplitude: the steps within the limits would tell so much.
        self.assertLess(best["worst"], existing["voltage-steps"]["worst"] * existing["voltage-steps"]["limit_used"])
        self.assertLessEqual(told["trials"], 30)
        self.assertEqual(told["experiment"], suggested.read_text(encoding="utf-8"))

        for seed, likeness in ((1, 1e-9), (2, 0.5)):
            data = self.path / f"{seed}.csv"
            found = self.parameters("--motor", "dc", "--bench", self.noisy_bench(seed), "--experiment", suggested,
                                    "--data", data)
            self.assertTrue(found["identifiable"])
            self.assertEqual(found["experiment"]["state"], "completed")  # not stopped by a limit
            for name, width in best["relative_intervals"].items():
                row = found["parameters"][name]
                self.assertAlmostEqual(row["interval"] / row["estimate"] / width, 1.0, delta=likeness, msg=name)
                self.assertLess(abs(row["estimate"] - row["truth"]), 2.0 * row["interval"], name)
            header, *rows = data.read_text(encoding="utf-8").splitlines()
            columns = dict(zip((name.split()[0] for name in header.split(",")), zip(*(map(float, row.split(",")) for row in rows))))
            self.assertLess(max(map(abs, columns["i_a_a"])), 4.05)
            self.assertLessEqual(max(map(abs, columns["u_a_v"])), 10.0)

    def test_a_suggestion_is_refused_where_it_cannot_be_made(self):
        """Catches: trials on somebody's server, limits without a search, a motor of another kind, endless frequencies, forty
        trials in search of what the gentlest experiment already exceeds."""
        for words, reason in ((("--suggest", "--from", "a.csv"), "--from reads what was measured"),
                              (("--suggest", "--link", "unix:/nothing"), "server of its own"),
                              (("--suggest", "--experiment", "two-sines"), "--experiment runs one that there is"),
                              (("--suggest", "--data", "a.csv"), "--suggest-file"),
                              (("--suggest", "--seconds", "0.001"), "100 samples"),
                              (("--suggest", "--trials", "0"), "--trials"),
                              (("--suggest", "--max-current", "-1"), "--max-current"),
                              (("--suggest", "--max-current", "0.001"), "--max-current 0.001 cannot be kept: the gentlest"),
                              (("--suggest", "--max-speed", "1e-6"), "--max-speed 1e-06 cannot be kept"),
                              (("--suggest", "--bench", "im-a"), "of kind induction"),
                              (("--suggest", "--bench", "no-such-bench"), "no-such-bench"),
                              (("--max-current", "3"), "--suggest")):
            with self.subTest(words=words):
                refused = self.identify("--motor", "dc", *words, code=2)
                self.assertIn(reason, refused.stderr)
                self.assertEqual(refused.stdout, "")

    def test_wrong_words_are_refused_with_the_choices(self):
        """Catches: a refusal without the possible words."""
        for words, text in (
                (("--experiment", "dol-start"), "--motor is missing; there are im, dc, pm, bldc"),
                (("--motor", "ac"), "--motor 'ac' is not known; did you mean \"dc\"?; there are im, dc, pm, bldc"),
                (("--motor", "im", "--experiment", "no-lod"), "did you mean \"no-load\"?; there are"),
                (("--motor", "im", "--experiment", "x"), "there are dol-start, no-load-start, dc-resistance, no-load, blocked-rotor, classical, and files"),
                (("--motor", "im", "--experiment", "x.toml"), "no experiment file 'x.toml'"),
                (("--motor", "im", "--map", "a=i_a_a"), "belong to --from"),
                (("--motor", "im", "--from", "a.csv", "--experiment", "dol-start"), "--from reads data that are there"),
                (("--motor", "dc", "--window", "2:1"), "ends before it begins"),
                (("--motor", "dc", "--window", "a"), "should be FROM:TO"),
                (("--motor", "dc", "--current-hz", "5001"), "Hz"),
                (("--motor", "dc", "--plot", "/nowhere/x.svg"), "cannot write /nowhere/x.svg"),
                (("--motor", "dc", "--bench", "im-8-5-5"), "no axis 'dc-a'")):
            with self.subTest(words):
                self.assertIn(text, self.identify(*words, code=2).stderr)

    def test_an_interrupt_cancels_the_experiment(self):
        """Catches: ctrl-C that leaves an experiment running on the bench for its whole two minutes, or loses its data so
        far."""
        server = self.server("--experiments", str(self.path / "kept"), "--mode", "lockstep")
        link = f"tcp:{server.ready['tcp']}"
        toml = self.path / "long.toml"
        toml.write_text('mode = "realtime"\nduration_s = 110.0\nsignals = ["u_a_v"]\n[input]\nkind = "none"\n', encoding="utf-8")
        out = self.path / "out.csv"
        running = subprocess.Popen([PROGRAM, "experiment", "run", str(toml), "--json", "--link", link, "--owner",
                                    "the secret of a test", "--out", str(out)], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True, env=self.environment)
        self.addCleanup(running.kill)

        def state():
            listed = self.drivebench("experiment", "list", "--json", "--link", link, "--owner", "the secret of a test")
            return [e["state"] for e in json.loads(listed.stdout)["experiments"]]

        until(lambda: state() == ["running"], "an experiment runs")
        running.send_signal(signal.SIGINT)
        printed, _ = running.communicate(timeout=PATIENCE_S)
        self.assertEqual(running.returncode, 1)
        told = json.loads(printed)
        self.assertEqual(told["state"], "cancelled")
        self.assertEqual(state(), ["cancelled"])
        lines = out.read_text(encoding="utf-8").splitlines()
        self.assertEqual(len(lines), told["rows"] + 1)
        self.assertTrue(all(re.fullmatch(r"\d+,[\d.]+,[-\d.e]+", line) for line in lines[1:]))


def answer_in_http(listener):
    while True:
        try:
            client, _ = listener.accept()
        except OSError:
            return
        with client:
            client.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")


if __name__ == "__main__":
    unittest.main(verbosity=2)
