#!/usr/bin/python3
"""Changes of the world around a controller, over the wire: parameters on a ramp, injected faults, bumps, current
setpoints."""
import math
import pathlib
import sys
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import BENCHES, pb
from wire_test import SERVO_TEXT, TWO_DRIVES, WireTest

NAME = "machine.rotor_resistance_ohm"


class Ramps(WireTest):
    def setUp(self):
        self.owner = self.client(self.server())
        self.owner.lease()
        self.owner.step(0)

    def write(self, value, name=NAME, **more):
        return self.owner.ask(write_parameter=pb.WriteParameter(name=name, value=value, **more))

    def read(self, name=NAME):
        return self.owner.ask(read_parameters=pb.ReadParameters(names=[name])).parameter_values.parameters[0].value

    def test_a_ramp_is_linear_and_can_be_read_on_its_way(self):
        """Catches: a read-back that shows the target while the plant has another value; a ramp that is a tick early or late."""
        self.assertDone(self.write(5.9, ramp_ticks=4, at_tick=3))
        seen = []
        for tick in range(1, 10):
            self.owner.step(tick)
            seen.append(round(self.read(), 12))
        self.assertEqual(seen, [3.9, 3.9, 3.9, 4.4, 4.9, 5.4, 5.9, 5.9, 5.9])

    def test_a_write_is_checked_again_when_it_acts(self):
        """Catches: a write that is checked on arrival only; one whose refusal leaves no trace."""
        coulomb, static = "mechanics.coulomb_friction_nm", "mechanics.static_friction_nm"
        self.assertRefused(self.write(0.1, coulomb), pb.REFUSAL_OUT_OF_RANGE, "value")
        self.assertDone(self.write(0.1, coulomb, at_tick=3))
        self.assertDone(self.write(0.1, coulomb, at_tick=6))
        self.assertDone(self.write(0.2, static, at_tick=5))
        seen = [(self.owner.step(tick).refused_commands, self.read(coulomb)) for tick in range(1, 9)]
        self.assertEqual(seen, 2 * [(0, 0.0)] + 3 * [(1, 0.0)] + 3 * [(1, 0.1)])

    def test_parameters_that_cannot_ramp_are_refused(self):
        """Catches: an integer that passes through a half; a number of ticks that overflows."""
        self.assertRefused(self.write(0.0, "amplifier.over_current_trip", ramp_ticks=3), pb.REFUSAL_OUT_OF_RANGE, "ramp_ticks")
        self.assertRefused(self.write(5.0, ramp_ticks=2**53 + 1), pb.REFUSAL_OUT_OF_RANGE, "ramp_ticks")
        self.assertRefused(self.write(5.0, at_tick=2**64 - 1), pb.REFUSAL_OUT_OF_RANGE, "at_tick")
        for bad in (math.nan, math.inf):
            self.assertRefused(self.write(bad, at_tick=9), pb.REFUSAL_NOT_FINITE, "value")
        self.assertRefused(self.write(-1.0, at_tick=9), pb.REFUSAL_OUT_OF_RANGE, "value")

    def test_at_most_sixteen_ramps_at_a_time(self):
        """Catches: a seventeenth ramp that is confirmed."""
        rows = self.owner.ask(read_parameters=pb.ReadParameters()).parameter_values.parameters
        rows = [row for row in rows if row.live and not row.integer][:17]
        self.assertEqual(len(rows), 17)
        for row in rows[:16]:
            self.assertDone(self.write(row.value, row.name, ramp_ticks=5))
        refused = self.write(rows[16].value, rows[16].name, ramp_ticks=5)
        self.assertRefused(refused, pb.REFUSAL_BUSY, "name")
        self.assertIn("16 parameters", refused.refusal.message)


class Faults(WireTest):
    def inject(self, client, name, value, **more):
        return client.ask(inject_fault=pb.InjectFault(name=name, value=value, **more))

    def bit(self, client, name):
        return next(f.bit for f in client.welcome.bench.injectable_faults if f.name == name)

    def test_a_fault_acts_at_its_tick_and_stands_in_the_sample(self):
        """Catches: a fault that the sample does not show, that acts early, or that cannot be taken back."""
        client = self.client(self.server())
        client.lease()
        bit = self.bit(client, "open_phase")
        self.assertDone(self.inject(client, "open_phase", 1, at_tick=2))
        self.assertDone(self.inject(client, "open_phase", 0, at_tick=5))
        samples = [client.step(tick, 20.0, 20.0) for tick in range(7)]
        self.assertEqual([s.injected for s in samples], [0, 0, bit, bit, bit, 0, 0])
        self.assertNotEqual(samples[1].true_i_a_a, 0.0)
        self.assertEqual(samples[4].true_i_a_a, 0.0)
        self.assertNotEqual(samples[4].true_i_b_a, 0.0)

    def test_refusals_name_the_field(self):
        """Catches: a fault that does not exist, an impossible value, a client without the right."""
        server = self.server()
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        self.assertRefused(self.inject(owner, "open_fase", 1), pb.REFUSAL_UNKNOWN_FAULT, "name")
        for value in (4, -1, 1.5):
            self.assertRefused(self.inject(owner, "open_phase", value), pb.REFUSAL_OUT_OF_RANGE, "value")
        self.assertRefused(self.inject(owner, "bus_sag", math.nan), pb.REFUSAL_NOT_FINITE, "value")
        self.assertRefused(self.inject(owner, "bus_sag", 1, at_tick=2**60), pb.REFUSAL_OUT_OF_RANGE, "at_tick")
        self.assertRefused(self.inject(owner, "bus_sag", 1, axis=1), pb.REFUSAL_UNKNOWN_AXIS, "axis")
        self.assertRefused(self.inject(viewer, "bus_sag", 1), pb.REFUSAL_NOT_OWNER, "axis")
        for bad, code in ((math.nan, pb.REFUSAL_NOT_FINITE), (-math.inf, pb.REFUSAL_NOT_FINITE), (2e6, pb.REFUSAL_OUT_OF_RANGE)):
            self.assertRefused(owner.ask(shaft_bump=pb.ShaftBump(impulse_nms=bad)), code, "impulse_nms")
        self.assertRefused(viewer.ask(shaft_bump=pb.ShaftBump(impulse_nms=1.0)), pb.REFUSAL_NOT_OWNER, "axis")
        self.assertEqual(owner.step(0).injected, 0)

    def test_every_fault_of_the_description_can_be_injected_and_taken_back(self):
        """Catches: a row that one layer knows and another does not."""
        client = self.client(self.server())
        client.lease()
        for tick, fault in enumerate(client.welcome.bench.injectable_faults):
            self.assertTrue(fault.meaning and fault.unit and fault.maximum > 0.0, fault.name)
            self.assertDone(self.inject(client, fault.name, 1 if fault.integer else fault.maximum / 2))
            self.assertEqual(client.exchange(tick, gates=pb.GATES_OFF).exchange_reply.samples[0].sample.injected, fault.bit)
            self.assertDone(self.inject(client, fault.name, 0))

    def test_command_loss_is_seen_by_the_watchdog_and_not_by_the_client(self):
        """Catches: a lockstep that stops when commands are lost; a lost command that moves the motor."""
        client = self.client(self.server())
        client.lease()
        client.step(0, 5.0)
        self.assertDone(self.inject(client, "command_loss", 1))
        for tick in range(1, 20):
            sample = client.step(tick, 9.0)
            self.assertEqual((sample.u_a_v, sample.command_tick, sample.missed_commands), (5.0, 0, tick))
        self.assertEqual(client.step(20, 9.0).state, 3)
        self.assertRefused(client.exchange(21, 9.0), pb.REFUSAL_LATCHED)

    def test_a_bump_acts_at_its_tick(self):
        """Catches: a bump at once instead of at its tick, or twice."""
        client = self.client(self.server())
        client.lease()
        self.assertDone(client.ask(shaft_bump=pb.ShaftBump(impulse_nms=1.1e-4, at_tick=2)))
        speeds = [client.step(tick, gates=pb.GATES_OFF).speed_rad_s for tick in range(4)]
        self.assertEqual(speeds[:2], [0.0, 0.0])
        self.assertAlmostEqual(speeds[2], 1.0, places=3)
        self.assertAlmostEqual(speeds[3], 1.0, places=3)


class Setpoints(WireTest):
    def test_currents_are_for_current_amplifiers(self):
        """Catches: amperes that a voltage amplifier takes for volts; a refusal that does not name the field."""
        client = self.client(self.server(text=TWO_DRIVES))
        client.lease(axis=0)
        client.lease(axis=1)

        def exchange(tick, **bldc):
            servo = pb.Command(axis=0, tick=tick, gates=pb.GATES_CURRENT, i_a_a=1.5, i_b_a=-1.0, u_a_v=60.0)
            return client.ask(exchange=pb.Exchange(commands=[servo, pb.Command(axis=1, tick=tick, **bldc)]))

        self.assertRefused(exchange(0, gates=pb.GATES_CURRENT, i_a_a=1.0), pb.REFUSAL_WRONG_DRIVE, "commands.gates")
        for field in ("u_a_v", "u_b_v", "u_c_v", "u_f_v"):
            bad = exchange(0, gates=pb.GATES_VOLTAGE, **{field: math.nan})
            self.assertRefused(bad, pb.REFUSAL_NOT_FINITE, "commands")
        for tick in range(60):
            reply = exchange(tick, gates=pb.GATES_VOLTAGE, u_a_v=1.0, u_b_v=-0.5, u_c_v=-0.25).exchange_reply
        servo, bldc = (each.sample for each in reply.samples)
        self.assertAlmostEqual(servo.true_i_a_a, 1.5, places=1)
        self.assertAlmostEqual(servo.true_i_b_a, -1.0, places=1)
        self.assertEqual((bldc.u_a_v, bldc.u_b_v, bldc.u_c_v), (1.0, -0.5, -0.25))
        self.assertNotEqual(bldc.i_c_a, 0.0)

    def test_the_description_names_kinds_and_phases(self):
        """Catches: a client that must guess the kind of its axis."""
        axes = self.client(self.server(text=TWO_DRIVES)).welcome.bench.axes
        found = [(a.machine_kind, a.phases, a.connection, a.drive_kind, a.shares_shaft_with) for a in axes]
        self.assertEqual(found, [("induction", 2, "two_phase", "current_amplifier", ""),
                                 ("bldc", 3, "star", "voltage_amplifier", "")])
        kind = next(p for p in axes[0].parameters if p.name == "drive.kind")
        self.assertEqual(kind.words[int(kind.value)], "current_amplifier")

    def test_the_description_of_the_largest_bench_fits_its_frame(self):
        """Catches: a bench of 64 axes that no client of ours can connect to: frames may have 1 MiB."""
        head, axis = SERVO_TEXT.split("[[axis]]")
        axes = "".join("[[axis]]" + axis.replace('"servo"', f'"{"x" * 60}{n}"') for n in range(64))
        welcome = self.client(self.server(text=head + axes)).welcome
        self.assertEqual(len(welcome.bench.axes), 64)
        self.assertLess(welcome.ByteSize(), 1024 * 1024)

    def test_an_axis_on_a_shared_shaft_has_no_mechanics_of_its_own(self):
        """Catches: an inertia that is written and has no effect."""
        client = self.client(self.server(config=BENCHES / "dynamometer.toml"))
        self.assertEqual(client.welcome.bench.axes[1].shares_shaft_with, client.welcome.bench.axes[0].name)
        client.lease(axis=1)
        write = pb.WriteParameter(axis=1, name="mechanics.inertia_kgm2", value=1.0)
        refused = client.ask(write_parameter=write)
        self.assertRefused(refused, pb.REFUSAL_OUT_OF_RANGE, "value")
        self.assertIn("belongs to axis", refused.refusal.message)


if __name__ == "__main__":
    unittest.main(verbosity=2)
