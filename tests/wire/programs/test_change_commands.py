#!/usr/bin/python3
"""The subcommands of drivebench that inject faults, write parameters and take an axis, and the replay of their
changes."""
import pathlib
import re
import struct
import sys
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from command_test import DRIVEBENCH, FAILED, USAGE, CommandTest, link_of
from wire_client import BENCHES, pb
from wire_test import PATIENT_TEXT, TWO_DRIVES, until

RUN = 1  # a state of an axis
NAME = "machine.rotor_resistance_ohm"


class Commands(CommandTest):
    def setUp(self):
        super().setUp()
        self.bench = self.server()
        self.link = link_of(self.bench)

    def status(self):
        return self.json_of("status", link=self.link)["axes"][0]

    def test_inject_puts_a_fault_in_and_takes_it_back(self):
        """Catches: a fault that the status does not show, or that ends with its session."""
        said = self.drivebench("inject", "servo", "bus_sag", "0.25", link=self.link).stdout
        self.assertEqual(said, "axis 0 (servo): bus_sag = 0.25 from tick 0 on\n")
        for value, told in (("2", "phase 2"), ("0", "0")):
            said = self.drivebench("inject", "servo", "open_phase", value, link=self.link).stdout
            self.assertEqual(said, f"axis 0 (servo): open_phase = {told} from tick 0 on\n")
        found = self.json_of("inject", "0", "hall_offset", "-0.5", link=self.link)
        self.assertEqual(found, {"axis": 0, "name": "hall_offset", "value": -0.5, "tick": 0})
        with self.bench.client() as client:
            client.lease()
            client.step(0, gates=pb.GATES_OFF)
        self.assertEqual(self.status()["injected_set"], ["bus_sag", "hall_offset"])
        self.assertSays(self.drivebench("status", link=self.link).stdout, "injected bus_sag hall_offset")
        self.assertSays(self.drivebench("describe", link=self.link).stdout, "machine induction, 2 phases (two_phase)",
                        "drive voltage_amplifier", "injectable fault", "open_phase")

    def test_the_columns_of_describe_stand_below_each_other(self):
        """Catches: a long unit or number that pushes the columns behind it to the right, as those of N*m*s/rad do."""
        said = self.drivebench("describe", link=self.link).stdout
        widths = [len(row) for row in re.findall(r"(?m)^  \w+\.\w+ .*?\S \.\. \S+  ", said)]
        self.assertGreater(len(widths), 20)
        self.assertEqual(len(set(widths)), 1, said)

    def test_a_conductor_disturbs_an_axis_that_a_controller_drives(self):
        """Catches: --conduct that asks for the lease, and a change that a running controller cannot see."""
        changes = [("inject", "servo", "bus_sag", "0.25"), ("set", "servo", NAME, "5.9"), ("bump", "servo", "0.0001")]
        with self.bench.client() as client:
            client.lease()
            client.step(0, 1.0)
            for change in changes:
                self.assertSays(self.drivebench(*change, link=self.link, code=1).stderr, "another session holds the lease")
            for change in changes:
                self.assertSays(self.drivebench(*change, "--conduct", link=self.link).stdout, "from tick 1 on")
            client.step(1, 1.0)
            self.assertEqual(self.status()["injected_set"], ["bus_sag"])
            self.assertEqual(client.newest().owner, client.owner)

    def test_set_writes_numbers_and_words_and_ramps(self):
        """Catches: a ramp in ticks of another bench, a word that is taken for 0."""
        said = self.drivebench("set", "servo", NAME, "5.9", "--ramp-s", "0.5e-3", link=self.link).stdout
        self.assertEqual(said, f"axis 0 (servo): {NAME} = 5.9 ohm from tick 4 on\n")
        said = self.drivebench("set", "servo", "mechanics.motion", "locked", link=self.link).stdout
        self.assertSays(said, "mechanics.motion = locked from tick 0 on")
        self.drivebench("set", "servo", "amplifier.over_current_trip", "true", link=self.link)
        self.drivebench("set", "servo", "amplifier.over_current_trip", "false", link=self.link)
        self.assertSays(self.drivebench("set", "servo", "amplifier.over_current_trip", "yes", link=self.link, code=USAGE).stderr,
                        "'yes' is not true or false for amplifier.over_current_trip")
        with self.bench.client() as client:
            client.lease()
            seen = []
            for tick in range(5):
                client.step(tick, gates=pb.GATES_OFF)
                read = client.ask(read_parameters=pb.ReadParameters(names=[NAME, "mechanics.motion"]))
                seen.append([round(p.value, 12) for p in read.parameter_values.parameters])
        self.assertEqual(seen, [[3.9, 1], [4.4, 1], [4.9, 1], [5.4, 1], [5.9, 1]])
        self.drivebench("bump", "servo", "-0.0001", link=self.link)

    def test_own_04_take_ends_the_lease_and_leaves_the_axis_free(self):
        """Catches: a command that takes an axis and keeps it, or takes it without a confirmation."""
        with self.bench.client() as owner:
            owner.lease()
            for tick in range(3):
                owner.step(tick, 10.0)
            self.assertSays(self.drivebench("take", "--reason", "x", link=self.link, code=USAGE).stderr, "--force")
            self.drivebench("take", "--force", link=self.link, code=USAGE)
            said = self.drivebench("take", "--force", "--reason", "smoke", link=self.link).stdout
            self.assertSays(said, "axis 0 (servo): taken and free again since tick 3")
            self.assertSays(owner.exchange(3, 10.0).refusal.message, "smoke")
            found = self.json_of("take", "--axis", "servo", "--force", "--reason", "smoke", link=self.link)
            self.assertEqual((found["axis"], found["name"], found["tick"]), (0, "take", 3))
            self.assertEqual(self.status()["owner"], 0)

    def test_clear_ends_what_a_lost_controller_left(self):
        """Catches: an axis that nobody can use after its controller died, a status without the latch, a clear that keeps
        the axis, one that says it cleared what is not gone."""
        bench = self.server("--mode", "realtime", text=PATIENT_TEXT)
        link = link_of(bench)

        def status():
            return self.json_of("status", link=link)["axes"][0]

        self.assertSays(self.drivebench("clear", "servo", link=link).stdout, "axis 0 (servo): cleared, no latched fault showed")
        with bench.client() as client:
            client.lease()

            def is_driven():
                client.exchange(client.newest().tick)
                return client.newest().state == RUN
            until(is_driven, "the axis is driven")
        until(lambda: status()["latched_set"] == ["lease_lost"], "the session's end is noticed")
        self.assertSays(self.drivebench("status", link=link).stdout, "latched: lease_lost; no command is executed",
                        "`drivebench clear 0`")
        self.assertSays(self.drivebench("control", link=link, code=USAGE).stderr, "has latched lease_lost", "`drivebench clear`")
        found = self.json_of("clear", "0", link=link)
        self.assertEqual((found["axis"], found["name"], found["cleared"]), (0, "clear", ["lease_lost"]))
        self.assertEqual(status()["latched_set"], [])

    def test_a_fault_whose_cause_is_still_there_is_not_cleared(self):
        """Catches: a clear that exits with 0 and left the latch: a short of a turning magnet."""
        text = (BENCHES / "pm-9-3.toml").read_text(encoding="utf-8").replace("../motors/", f"{BENCHES.parent}/motors/")
        for old, new in (('"lockstep"', '"realtime"'), ("period_us = 20", "period_us = 500"),
                         ("command_delay_ticks = 0", "command_delay_ticks = 1"),
                         ("over_current_a = 8.0", "over_current_a = 0.5"), ("over_current_trip = false", "over_current_trip = true")):
            self.assertIn(old, text)
            text = text.replace(old, new)
        text += ('\n[axis.mechanics]\nmotion = "imposed"\nimposed_speed_rad_s = 10.0\n'
                 '[[axis.fault]]\nat_s = 0\nname = "phase_short"\nvalue = 1\n')
        link = link_of(self.server(text=text))
        until(lambda: self.json_of("status", link=link)["axes"][0]["latched_set"] == ["over_current_trip"], "the short trips")

        def is_refused():  # the current alternates: near its zeros a clear is right, and the short trips again
            done = self.run_program(DRIVEBENCH, "clear", "0", link=link)
            return done.returncode == FAILED and "what caused the latched fault is still there: over-current" in done.stderr
        until(is_refused, "the clear is refused")
        self.drivebench("inject", "0", "phase_short", "0", link=link)
        until(lambda: abs(self.json_of("status", link=link)["axes"][0]["i_a_a"]) < 0.1, "the current decays")
        self.assertSays(self.drivebench("clear", "0", link=link).stdout, "cleared over_current_trip")

    def test_clear_works_where_time_stands_still(self):
        """Catches: a latch that no status and no refusal names before the next tick of a lockstep bench, a clear that waits for it,
        one that the next controller does not feel."""
        with self.bench.client() as client:
            client.lease()
            for tick in range(3):
                client.step(tick, 10.0)
        until(lambda: self.status()["latched_set"] == ["lease_lost"], "the session's end is noticed")
        self.assertSays(self.drivebench("status", link=self.link).stdout, "axis 0 (servo): timeout, owner none, faults lease_lost")
        with self.bench.client() as client:
            client.lease()
            self.assertSays(client.exchange(3, 10.0).refusal.message, "a latched fault is in force", ": lease_lost")
        said = self.drivebench("clear", "servo", link=self.link).stdout
        self.assertEqual(said, "axis 0 (servo): cleared lease_lost at tick 3\n")
        self.assertSays(self.drivebench("status", link=self.link).stdout, "axis 0 (servo): idle, owner none, faults none")
        with self.bench.client() as client:
            client.lease()
            self.assertEqual(client.step(3, 10.0).faults, 0)

    def test_a_refused_change_is_reported(self):
        """Catches: a command that exits with 0 and changed nothing."""
        for arguments, code, fact in (
                (["inject", "servo", "bus_sagg", "1"], USAGE, "no fault 'bus_sagg'; did you mean \"bus_sag\"?"),
                (["clear", "brake"], USAGE, "no axis 'brake'"),
                (["inject", "brake", "bus_sag", "1"], USAGE, "no axis 'brake'"),
                (["inject", "servo", "bus_sag", "2"], FAILED, "must lie between 0 and 1"),
                (["inject", "servo", "bus_sag", "much"], USAGE, "VALUE"),
                (["inject", "servo", "bus_sag"], USAGE, "VALUE"),
                (["set", "servo", "machine.rotor_resistance", "2"], USAGE, f"did you mean \"{NAME}\""),
                (["set", "servo", "machine.rr", "2"], USAGE, "no parameter 'machine.rr'"),
                (["set", "servo", NAME, "hot"], USAGE, "'hot' is not a number for"),
                (["set", "servo", "mechanics.motion", "loked"], USAGE, "'loked' is not a value of mechanics.motion; did you mean \"locked\"?"),
                (["set", "servo", NAME, "-2"], FAILED, "must lie between"),
                (["set", "servo", "machine.pole_pairs", "2"], FAILED, "cannot be changed"),
                (["set", "servo", NAME, "5", "--ramp-s", "-1"], USAGE, "--ramp-s"),
                (["set", "servo", NAME, "5", "--ramp-s", "nan"], USAGE, "--ramp-s"),
                (["bump", "servo", "1e9"], FAILED, "must lie between")):
            self.assertSays(self.drivebench(*arguments, link=self.link, code=code).stderr, fact)
        with self.bench.client() as client:
            client.lease()
            self.assertSays(self.drivebench("inject", "servo", "bus_sag", "1", link=self.link, code=FAILED).stderr,
                            "another session holds the lease")


class Replays(CommandTest):
    def test_every_change_replays_bit_for_bit(self):
        """Catches: a change that is recorded without its ramp, its tick or its sign."""
        recording = self.folder / "run.mcap"
        events = """
[[axis.set]]
parameter = "machine.stator_resistance_ohm"
value = 0.7
at_tick = 30
ramp_ticks = 50
[[axis.fault]]
name = "current_sensor_gain"
value = -0.1
at_tick = 40
until_tick = 60
[[axis.bump]]
at_tick = 50
impulse_nms = 1e-4
"""
        server = self.server("--record", str(recording), text=TWO_DRIVES + events)
        with server.client() as client:
            for axis in (0, 1):
                client.lease(axis=axis)
            for tick in range(120):
                if tick == 10:
                    client.ask(inject_fault=pb.InjectFault(axis=1, name="open_phase", value=3, at_tick=70))
                    client.ask(shaft_bump=pb.ShaftBump(axis=1, impulse_nms=-1e-5))
                if tick == 20:
                    client.ask(write_parameter=pb.WriteParameter(axis=0, name="mechanics.viscous_friction_nms", value=1e-3,
                                                                 ramp_ticks=33, at_tick=22))
                client.ask(exchange=pb.Exchange(commands=[
                    pb.Command(axis=0, tick=tick, gates=pb.GATES_CURRENT, i_a_a=1.0 + tick / 100, i_b_a=-0.5),
                    pb.Command(axis=1, tick=tick, gates=pb.GATES_VOLTAGE, u_a_v=2.0, u_b_v=-1.0, u_c_v=-0.5, u_f_v=-0.0)]))
            for axis in (0, 1):
                client.lease(pb.LeaseRequest.ACTION_RELEASE, axis=axis)
        self.assertEqual(server.stop(), 0)
        found = self.json_of("replay", recording)
        self.assertTrue(found["equal"], found)
        self.assertEqual(found["state_hash"], server.verdict["state_hash"])
        self.drivebench("export", recording, "--out", "run.csv", "--axis", "bldc", "--signals", "injected,i_c_a,u_c_v")
        rows = [row.split(",") for row in (self.folder / "run.csv").read_text(encoding="utf-8").splitlines()]
        self.assertEqual(rows[70][2], "0")
        self.assertEqual([row[4] for row in rows[2:70]], 68 * ["-0.5"])
        self.assertNotEqual(rows[72][2], "0")
        self.assertEqual(struct.pack(">d", float(rows[75][3])), struct.pack(">d", 0.0))


if __name__ == "__main__":
    unittest.main(verbosity=2)
