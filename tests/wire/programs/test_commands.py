#!/usr/bin/python3
"""The subcommands of drivebench that talk to a bench: their output, as text and as JSON, and their exit codes."""
import json
import pathlib
import re
import signal
import socket
import sys
import threading
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from command_test import (
    DRIVEBENCH, FAILED, NO_BENCH, NO_CONNECT, OK, SERVO, USAGE, CommandTest, environment, link_of, until)
from wire_client import BENCHES, PATIENCE_S, REPOSITORY, Server, pb
from wire_test import SERVO_TEXT


class WithoutABench(CommandTest):
    def test_a_missing_bench_is_3(self):
        """Catches: a script that takes a missing bench for a failed run, or for a good one."""
        for command in ("describe", "status", "watch", "control"):
            self.assertSays(self.drivebench(command, code=NO_CONNECT).stderr, "nothing answers at " + NO_BENCH)
            error = self.json_of(command, code=NO_CONNECT)["error"]
            self.assertEqual(error["kind"], "connect")
            self.assertSays(error["message"], NO_BENCH)
        self.drivebench("status", "--link", f"unix:{self.folder}/none", code=NO_CONNECT)

    def test_a_wrong_command_line_is_2_and_names_the_mistake(self):
        """Catches: an option that is ignored, a number that is half read, NaN that passes every comparison, -1 that is 2^64 - 1."""
        for arguments, fact in (
                ([], "a verb is missing"), (["nope"], "nope"), (["status", "--nope"], "--nope"), (["status", "more"], "more"),
                (["control", "--preset", "book/8.2"], 'did you mean "book/8.2.2"'),
                (["control", "--load", "0.1"], "NM@SECONDS"), (["control", "--load", "0.1x@0"], "not a number"),
                (["control", "--load", "nan@0"], "not a number"), (["control", "--load", "0.1@-1"], "between 0 and"),
                (["control", "--load", "0.1@1e30"], "between 0 and"), (["control", "--load", "0.1@nan"], "not a number"),
                (["control", "--set", "machine"], "NAME=VALUE"), (["control", "--set", "a=1,5"], "not a number"),
                (["watch", "--rate", "0"], "--rate"), (["watch", "--rate", "nan"], "--rate"),
                (["watch", "--count", "-1"], "negative"), (["watch", "--signals", "volts"], "no signal 'volts'"),
                (["wacth"], "no verb 'wacth'; did you mean \"watch\"?"),
                (["watch", "--signals", "sped_rad_s"], "did you mean \"speed_rad_s\"?"),
                (["demo", "--bench", "x"], "--bench"),
                (["dbc", "srevo"], "no bench file 'srevo'; did you mean \"servo\"?"),
                (["control", "--compare", "none.mcap", "--from", "-1"], "negative"), (["plot", "none.mcap", "--from", "-1"], "negative"),
                (["experiment", "fetch", "-1"], "negative"), (["status", "--link", "can:socketcan:can0"], "tcp:, tls:, unix: or shm:"),
                (["status", "--link", "tcp:host:port"], "not an address"),
                (["status", "--link", "tcp::7300"], "tls:HOST:PORT, unix:PATH or shm:PATH"), (["replay"], "FILE"), (["export"], "FILE"),
                (["export", "none.mcap"], "none.mcap"), (["replay", "none.mcap"], "none.mcap"),
                (["serve", "none"], "no bench file 'none'"), (["serve", "servo", "--nope"], "--nope"),
                (["demo", "--keep", "/proc/none"], "/proc/none")):
            done = self.drivebench(*arguments, code=USAGE)
            self.assertSays(done.stderr, fact)
            self.assertEqual(done.stdout, "")

    def test_a_real_number_is_finite_and_has_an_end(self):
        """Catches: naN that passes a range because no comparison with it is true, seconds that overflow the clock."""
        for arguments, option, high in (
                (["watch"], "--rate", "1e15"), (["set", "servo", "a", "1"], "--ramp-s", "1e9"),
                (["control", "--compare", "none.mcap"], "--threshold", "1e15"),
                (["can-log", "can:slcan:tcp:127.0.0.1:1"], "--duration", "1e9"),
                (["experiment", "fetch", "1"], "--patience", "1e9"), (["identify", "--motor", "dc"], "--period", "1e9"),
                (["identify", "--motor", "dc"], "--counts", "1e9"), (["identify", "--motor", "dc"], "--voltage-shift", "100"),
                (["identify", "--motor", "dc"], "--current-hz", "1e9"), (["identify", "--motor", "dc"], "--voltage-hz", "1e9"),
                (["identify", "--motor", "dc"], "--shaft-hz", "1e9")):
            for value in ("nan", "inf", "1e300", "1e999", "-1e3", "1x"):
                with self.subTest(f"{option} {value}"):
                    said = self.drivebench(*arguments, f"{option}={value}", code=USAGE).stderr
                    self.assertSays(said, option, f"{value} is not a number")
                    if value in ("inf", "1e300", "1e999"):  # beyond the limit, which nothing else tells
                        self.assertSays(said, high)
        self.assertSays(self.drivebench("inject", "servo", "bus_sag", "nan", code=USAGE).stderr, "VALUE: nan is not a number")
        self.assertSays(self.drivebench("bump", "servo", "inf", code=USAGE).stderr, "IMPULSE: inf is not a number")

    def test_a_run_without_an_end_or_a_beginning_is_2(self):
        """Catches: a gain that takes all memory, or whose samples overflow, on an axis that is held for it; a picture of
        no samples."""
        for gains, fact in (("run.hold_s=1e300", "run.hold_s = 1e+300 must be at most 3600 s"),
                            ("run.prepare_s=3601", "run.prepare_s = 3601 must be at most 3600 s"),
                            ("move.ramp_up_s=1e300", "move.ramp_up_s = 1e+300 must be at most 3600 s"),
                            ("run.hold_s=3600", "must together last at most 3600 s"),
                            ("sample_rate_hz=1e300", "more than 1e9 samples"),
                            ("run.prepare_s=0 run.hold_s=0 move.ramp_up_s=1e-9 move.cruise_s=0 move.ramp_down_s=1e-9",
                             "over before its first sample")):
            options = [word for gain in gains.split() for word in ("--gain", gain)]
            self.assertSays(self.drivebench("control", *options, code=USAGE).stderr, fact)

    def test_help_names_every_subcommand_and_the_exit_codes(self):
        """Catches: a subcommand, or a way to name a bench, that the help leaves out."""
        said = self.drivebench("--help").stdout
        self.assertSays(said, "serve", "demo", "describe", "status", "watch", "control", "replay", "export", "Exit codes: 0 ok")
        for command in ("demo", "describe", "status", "watch", "control", "replay", "export"):
            self.assertSays(self.drivebench(command, "--help").stdout, "--json")
        for command in (["describe"], ["control"], ["experiment", "run"], ["identify"]):
            self.assertSays(self.drivebench(*command, "--help").stdout, "tcp:HOST:PORT", "tls:HOST:PORT", "unix:PATH")

    def test_a_line_in_front_of_a_motor_takes_its_drop(self):
        """Catches: options that are exchanged, left out, or in other units."""
        words = ["steady-state", "im-b", "--voltage", "120", "--frequency", "60"]
        stiff = self.json_of(*words)["points"]["locked"]
        self.assertEqual(stiff["terminal_rms_v"], 120.0)
        for name, value, resistance_ohm in (("--line-ohm", "0.5", 0.5), ("--line-h", "5e-3", 0.0)):
            locked = self.json_of(*words, name, value)["points"]["locked"]
            self.assertLess(locked["terminal_rms_v"], 119.0)
            # The motor at a lower voltage, and nothing else.
            part = locked["terminal_rms_v"] / 120.0
            self.assertAlmostEqual(locked["current_rms_a"], part * stiff["current_rms_a"], places=9)
            self.assertAlmostEqual(locked["torque_nm"], part**2 * stiff["torque_nm"], places=9)
            self.assertAlmostEqual(locked["line_loss_w"], 3 * resistance_ohm * locked["current_rms_a"]**2, places=9)
        shown = self.drivebench(*words, "--line-ohm", "0.5").stdout
        self.assertIn("behind 0.5 ohm and 0 H in each phase", shown)
        self.assertIn("--line-h", self.drivebench(*words, "--line-h", "-1", code=USAGE).stderr)

    def test_the_names_of_a_circle_diagram_stand_apart(self):
        """Catches: a name drawn over another, such as that of the pull-out over that of the largest power."""
        for motor in ("im-b", "im-8-5-5"):
            self.drivebench("steady-state", motor, "--voltage", "120", "--frequency", "60", "--load", "1", "--circle", "circle.svg")
            svg = (self.folder / "circle.svg").read_text(encoding="utf-8")
            names = [(float(x), float(y), 5.5 * len(text)) for x, y, text in re.findall(r"<text x='([\d.]+)' y='([\d.]+)'>([^<]+ A)</text>", svg)]
            self.assertEqual(len(names), 8)
            for i, (x, y, width) in enumerate(names):
                self.assertLess(x + width, 600)
                for other_x, other_y, other_width in names[:i]:
                    # A letter of 10 pixels is less than 11 high.
                    apart = abs(y - other_y) >= 11 or x + width <= other_x or other_x + other_width <= x
                    self.assertTrue(apart, (motor, x, y, other_x, other_y))

    def test_presets_are_listed(self):
        """Catches: a preset that is not listed, or that does not name its source."""
        presets = self.json_of("control", "--list")
        self.assertSays(self.drivebench("control", "--list").stdout, *(preset["name"] for preset in presets))
        self.assertIn("book/8.2.2", [preset["name"] for preset in presets])
        for preset in presets:
            self.assertKeys(preset, "name", "source", "expectation", "sample_rate_hz", "counts_per_revolution")


class Observing(CommandTest):
    def setUp(self):
        super().setUp()
        self.bench = self.server()
        self.link = link_of(self.bench)

    def test_describe_names_everything_with_its_unit(self):
        """Catches: a parameter without unit or limits, a signal or fault that is missing."""
        said = self.drivebench("describe", link=self.link).stdout
        self.assertSays(said, "bench servo at tcp:127.0.0.1", "lockstep", "period 125 us (8 kHz), 5 substeps",
                        "command delay 0 ticks", "axis 0 (servo)", "machine.rotor_resistance_ohm", "N*m", "over_current")
        found = self.json_of("describe", link=self.link)
        self.assertKeys(found, "bench", "mode", "build_id", "protocol", "period_s", "substeps", "command_delay_ticks",
                        "watchdog_ticks", "lease_s", "seed", "configuration_hash", "axes", "signals", "faults")
        self.assertEqual((found["bench"], found["mode"], found["period_s"]), ("servo", "lockstep", 125e-6))
        self.assertEqual([s["name"] for s in found["signals"]], [f.name for f in pb.Sample.DESCRIPTOR.fields])
        for parameter in found["axes"][0]["parameters"]:
            self.assertKeys(parameter, "name", "value", "unit", "minimum", "maximum", "integer", "live", "meaning")
            self.assertSays(said, parameter["name"], parameter["meaning"])
        for each in found["signals"] + found["faults"]:
            self.assertSays(said, each["name"], each["meaning"])

    def test_status_follows_the_bench(self):
        """Catches: a status from the start of the run, or without the state of the axis."""
        said = self.drivebench("status", link=self.link).stdout
        self.assertSays(said, "lockstep, tick 0", "1 session", "not recording", "axis 0 (servo): idle", "owner none",
                        "faults none")
        with self.bench.client() as client:
            client.lease()
            client.step(0, 10.0)
            found = self.json_of("status", link=self.link)
            self.assertSays(self.drivebench("status", link=self.link).stdout, "tick 1 ", "run, owner 1", "2 sessions")
        self.assertKeys(found, "mode", "tick", "late_ticks", "worst_lateness_s", "sessions", "recording",
                        "recording_gaps", "recording_over", "state_hash", "notes", "transports", "axes")
        self.assertEqual((found["tick"], found["sessions"], found["axes"][0]["owner"]), (1, 2, 1))
        self.assertKeys(found["axes"][0], "axis", "faults_set", *(f.name for f in pb.Sample.DESCRIPTOR.fields))
        self.assertEqual(found["axes"][0]["u_a_v"], 10.0)

    def test_status_shows_the_recording(self):
        """Catches: a status that hides that no recording is made."""
        bench = self.server("--record", str(self.folder / "r.mcap"))
        self.assertSays(self.drivebench("status", link=link_of(bench)).stdout, "recording ", "r.mcap, 0 gaps")
        self.assertSays(self.json_of("status", link=link_of(bench))["recording"], "r.mcap")

    def test_the_link_may_be_a_unix_socket_or_an_option(self):
        """Catches: an option that the environment overrides."""
        bench = self.server(unix=True)
        self.drivebench("status", "--link", f"unix:{bench.unix_path}")
        self.drivebench("status", "--link", link_of(bench))

    def test_a_token_is_asked_for_and_taken(self):
        """Catches: a token that is not sent, or a refusal that looks like a failed run."""
        (self.folder / "tokens").write_text('[[token]]\nname = "anna"\nrole = "viewer"\ntoken = "secret"\n', encoding="utf-8")
        (self.folder / "tokens").chmod(0o600)
        text = SERVO.read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        bench = self.server(text=text.replace("[tcp]", f'[tcp]\ntokens_file = "{self.folder}/tokens"'))
        self.assertSays(self.drivebench("status", link=link_of(bench), code=NO_CONNECT).stderr, "turns this client away")
        self.drivebench("status", "--token", "wrong", link=link_of(bench), code=NO_CONNECT)
        time.sleep(1.1)  # after two wrong tokens
        self.drivebench("status", "--token", "secret", link=link_of(bench))
        for command in (["experiment", "list"], ["identify", "--motor", "im", "--link", link_of(bench)]):
            said = self.drivebench(*command, "--owner", "anna", link=link_of(bench), code=NO_CONNECT).stderr
            self.assertSays(said, "turns this client away")

    def test_an_unknown_axis_is_2(self):
        """Catches: a viewer that waits forever."""
        for command in ("watch", "control"):
            self.assertSays(self.drivebench(command, "--axis", "7", link=self.link, code=USAGE).stderr,
                            "no axis '7'; this bench has 0 (servo)")
            self.assertSays(self.drivebench(command, "--axis", "sevro", link=self.link, code=USAGE).stderr,
                            "no axis 'sevro'; did you mean \"servo\"?; this bench has 0 (servo)")


class Controlling(CommandTest):
    KEYS = ("bench", "mode", "axis", "preset", "failure", "samples", "missed_ticks", "late_ticks", "first_tick",
            "duration_s", "wall_s", "peak_error_counts", "final_error_counts", "final_true_error_counts",
            "peak_speed_rad_s", "peak_current_a", "peak_command_voltage_v", "peak_voltage_v", "exchange_p50_us",
            "exchange_p99_us", "exchange_max_us")

    def setUp(self):
        super().setUp()
        self.bench = self.server()
        self.link = link_of(self.bench)

    def control(self, *options, code=OK):
        return self.json_of("control", *options, link=self.link, code=code)

    def parameter(self, name):
        parameters = self.json_of("describe", link=self.link)["axes"][0]["parameters"]
        return next(each["value"] for each in parameters if each["name"] == name)

    def test_a_second_move_equals_the_first(self):
        """Catches: a second run that starts with the flux, the load or the lease of the first."""
        said = self.drivebench("control", link=self.link).stdout
        self.assertSays(said, "book/8.2.2 on axis servo of bench servo, lockstep", "peak error (true angle)", "counts",
                        "peak phase current", "exchange p99")
        report = self.control()
        self.assertKeys(report, *self.KEYS)
        self.assertLessEqual(report["peak_error_counts"], 2.0)
        self.assertLessEqual(report["final_error_counts"], 1.0)
        self.assertGreater(report["first_tick"], 1024)
        self.assertEqual((report["failure"], report["samples"], report["missed_ticks"]), ("", 1024, 0))

    def test_a_move_that_is_followed_is_slow_and_the_same(self):
        """Catches: a bench that runs ahead of the clock, a command that changes with its pace, a promise in real time."""
        moved = [self.drivebench("control", "--json", *more, link=f"inproc:{BENCHES / 'servo.toml'}").stdout
                 for more in ((), ("--follow", "0.25"))]
        fast, slow = map(json.loads, moved)
        self.assertGreaterEqual(slow["wall_s"], 1023 * 125e-6 / 0.25)
        for report in (fast, slow):
            for name in ("wall_s", "exchange_p50_us", "exchange_p99_us", "exchange_max_us"):
                report.pop(name)
        self.assertEqual(slow, fast)
        with Server("--mode", "realtime") as server:
            refused = self.drivebench("control", "--follow", "1", link="tcp:%s:%d" % server.address, code=USAGE)
            self.assertSays(refused.stderr, "--follow", "lockstep")

    def test_set_stays_and_load_is_put_back(self):
        """Catches: a --set that ends with its session, a --load that spins the motor afterwards."""
        self.control("--set", "machine.rotor_resistance_ohm=5.85", "--load", "0.1@0.0365", "--load", "0.05@0.05")
        self.assertEqual(self.parameter("machine.rotor_resistance_ohm"), 5.85)
        with self.bench.client() as client:
            client.lease()
            tick = client.newest().tick
            self.assertEqual(client.step(tick, gates=pb.GATES_OFF).load_nm, 0.0)

    def test_set_refuses_values_that_the_bench_refuses(self):
        """Catches: a misspelt parameter that is ignored, and a move that runs with the wrong motor."""
        for setting, fact in (("machine.rotor_resistance=5", "there is no parameter 'machine.rotor_resistance'; "
                               "did you mean \"machine.rotor_resistance_ohm\"?"),
                              ("machine.rotor_resistance_ohm=-1.50", "machine.rotor_resistance_ohm is -1.50 but must lie between"),
                              ("machine.rotor_resistance_ohm=nan", "not a number")):
            self.assertSays(self.control("--set", setting, code=USAGE)["error"]["message"], fact)
        self.assertEqual(self.json_of("status", link=self.link)["tick"], 0)

    def test_csv_has_a_row_for_each_sample(self):
        """Catches: a file without its end or its units; a missing folder that is reported after the move."""
        self.control("--csv", "move.csv")
        head, *rows = (self.folder / "move.csv").read_text(encoding="utf-8").splitlines()
        self.assertSays(head, "tick,time_s,reference_rad [rad],moved_rad [rad],error_counts [counts]")
        self.assertEqual([int(row.split(",")[0]) for row in rows], list(range(1024)))
        before = self.json_of("status", link=self.link)["tick"]
        self.assertSays(self.control("--csv", "none/move.csv", code=USAGE)["error"]["message"], "cannot write")
        self.assertEqual(self.json_of("status", link=self.link)["tick"], before)

    def test_another_owner_is_not_disturbed(self):
        """Catches: two controllers that take turns on one motor."""
        with self.bench.client() as owner:
            owner.lease()
            self.assertSays(self.drivebench("control", link=self.link, code=FAILED).stderr, "another session holds the lease")
            error = self.control(code=FAILED)["error"]
            self.assertEqual((error["kind"], error["field"]), ("refused", "axis"))
            self.assertEqual(owner.step(0, 10.0).tick, 1)
            owner.lease(pb.LeaseRequest.ACTION_RELEASE)
        self.control()

    def test_latched_faults_are_reported_and_cleared_on_demand(self):
        """Catches: a fault that is cleared unasked, or a move into a latched bench."""
        with self.bench.client() as client:
            client.lease()
            client.step(0, 10.0)
        until(lambda: self.json_of("status", link=self.link)["axes"][0]["owner"] == 0, "the lease of a lost session ends")
        self.assertSays(self.drivebench("control", link=self.link, code=USAGE).stderr, "latched", "--clear")
        self.control("--clear")
        self.control()

    def test_a_preset_that_does_not_fit_names_one_that_does(self):
        """Catches: a controller of 4 kHz on a bench of 8 kHz."""
        said = self.drivebench("control", "--preset", "book/8.2.2-4khz", link=self.link, code=USAGE).stderr
        self.assertSays(said, "the sample rate [Hz] is 8000 on the bench, 4000 in the preset", "book/8.2.2 would fit")
        odd = self.server(text=SERVO_TEXT.replace("period_us = 125", "period_us = 130"))
        said = self.drivebench("control", link=link_of(odd), code=USAGE).stderr
        self.assertSays(said, "the sample rate [Hz] is 7692.31 on the bench", "no other preset fits either", "own_motor.py")

    def test_a_link_that_breaks_in_a_move_costs_no_sample(self):
        """Catches: a report and a file of samples that are lost with the bench."""
        listener = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(listener.close)

        def pass_on(source, drain, most):
            while most > 0 and (data := source.recv(4096)):
                drain.sendall(data)
                most -= len(data)
            for end in (source, drain):
                end.shutdown(socket.SHUT_RDWR)

        def carry():
            client, _ = listener.accept()
            with client, socket.create_connection(self.bench.address) as bench:
                up = threading.Thread(target=pass_on, args=(client, bench, float("inf")))
                up.start()
                pass_on(bench, client, 100_000)
                up.join()

        carrier = threading.Thread(target=carry)
        carrier.start()
        link = "tcp:%s:%d" % listener.getsockname()
        found = self.json_of("control", "--csv", "broken.csv", link=link, code=FAILED)
        carrier.join()
        self.assertIn("closed", found["failure"])
        self.assertGreater(found["samples"], 100)
        rows = (self.folder / "broken.csv").read_text(encoding="utf-8").splitlines()
        self.assertEqual(len(rows), 1 + found["samples"])

    def test_an_interrupted_move_is_a_failed_run(self):
        """Catches: an exit code of 0 after half a move."""
        moving = self.start(DRIVEBENCH, "control", "--json", "--gain", "run.hold_s=60", link=self.link)
        until(lambda: self.json_of("status", link=self.link)["axes"][0]["owner"] != 0, "the move begins")
        moving.send_signal(signal.SIGINT)
        out, _ = moving.communicate(timeout=PATIENCE_S)
        self.assertEqual(moving.returncode, FAILED)
        report = json.loads(out)
        self.assertTrue(report.get("failure") or report["error"]["message"])


if __name__ == "__main__":
    unittest.main(verbosity=2)