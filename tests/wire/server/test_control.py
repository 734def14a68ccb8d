#!/usr/bin/python3
"""Control over the wire: exchanges, parameters, loads, real time."""
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from recording import Recording
from wire_client import PATIENCE_S, SERVER, pb
from wire_test import PATIENT_TEXT, SERVO_TEXT, TWO_AXES, TWO_DRIVES, WireTest, until


class Exchange(WireTest):
    def delay_test(self, delay, shown_after):
        client = self.client(self.server("--command-delay-ticks", str(delay)))
        client.lease()
        self.assertEqual(client.newest().tick, 0)
        seen = []
        for tick in range(6):
            sample = client.step(tick, 10.0 + tick, -5.0 - tick)
            self.assertEqual(sample.tick, tick + 1)
            seen.append((sample.u_a_v, sample.u_b_v, sample.command_tick, sample.command_age_ticks))
        for tick, (u_a, u_b, answered, age) in enumerate(seen):
            if tick < shown_after:
                self.assertEqual((u_a, u_b), (0.0, 0.0))
                continue
            self.assertEqual((u_a, u_b), (10.0 + tick - shown_after, -5.0 - tick + shown_after))
            self.assertEqual(age, shown_after)
            self.assertEqual(answered, tick - shown_after)

    def test_without_delay_a_command_holds_in_its_own_tick(self):
        """Catches: command(k) that acts at k+1 although the delay is 0."""
        self.delay_test(0, 0)

    def test_with_delay_a_command_holds_one_tick_later(self):
        """Catches: the delay of a digital controller that is left out or doubled."""
        self.delay_test(1, 1)

    def test_cmd_06_cmd_07_stale_duplicate_and_future_commands_are_refused_and_counted(self):
        """Catches: a command that is applied twice, or advances time."""
        client = self.client(self.server())
        client.lease()
        for tick in range(3):
            client.step(tick, 1.0)
        for tick in (2, 1, 0, 4, 1000, 2**53, 2**63, 2**64 - 1):
            self.assertRefused(client.exchange(tick, 9.0), pb.REFUSAL_STALE, "commands")
        self.assertEqual(client.newest().tick, 3)
        sample = client.step(3, 2.0)
        self.assertEqual(sample.refused_commands, 8)
        self.assertEqual(sample.u_a_v, 2.0)

    def test_cmd_11_tcp_09_values_that_are_not_finite_never_arrive(self):
        """Catches: NaN that passes a limiter, which is full voltage."""
        client = self.client(self.server())
        client.lease()
        client.step(0, 3.0, 4.0)
        for bad in (math.nan, math.inf, -math.inf):
            self.assertRefused(client.exchange(1, bad, 0.0), pb.REFUSAL_NOT_FINITE)
            self.assertRefused(client.exchange(1, 0.0, bad), pb.REFUSAL_NOT_FINITE)
        self.assertEqual(client.newest().tick, 1)
        sample = client.step(1, -0.0, 5e-324)
        self.assertEqual((sample.u_a_v, sample.u_b_v), (0.0, 5e-324))
        self.assertRefused(client.exchange(2, 1e308, 0.0), pb.REFUSAL_OUT_OF_RANGE)
        sample = client.step(2, 1e6, -1e6)
        self.assertEqual((sample.u_a_v, sample.u_b_v), (80.0, -80.0))
        self.assertTrue(sample.faults & 1, "saturation is flagged")

    def test_cmd_11_currents_that_are_not_finite_never_arrive(self):
        """Catches: NaN that passes as a current, though as a voltage it does not."""
        client = self.client(self.server(text=TWO_DRIVES))
        client.lease(axis=0)

        def exchange(tick, **currents):
            return client.ask(exchange=pb.Exchange(commands=[pb.Command(tick=tick, gates=pb.GATES_CURRENT, **currents)]))

        for tick in range(40):
            exchange(tick, i_a_a=2.0, i_b_a=-1.0)
        before = client.newest()
        self.assertAlmostEqual(before.true_i_a_a, 2.0, places=1)
        for current in ("i_a_a", "i_b_a", "i_c_a", "i_f_a"):
            for bad in (math.nan, math.inf, -math.inf):
                self.assertRefused(exchange(40, **{current: bad}), pb.REFUSAL_NOT_FINITE, "commands")
            for bad in (1e308, -1e308):
                self.assertRefused(exchange(40, **{current: bad}), pb.REFUSAL_OUT_OF_RANGE, "commands")
        self.assertEqual(client.newest(), before)
        after = exchange(40, i_a_a=2.0, i_b_a=-1.0).exchange_reply.samples[0].sample
        self.assertEqual(after.refused_commands, before.refused_commands + 20)
        self.assertAlmostEqual(after.true_i_a_a, 2.0, places=1)

    def test_cmd_11_legal_values_are_kept_to_the_bit(self):
        """Catches: -0.0 that becomes 0.0 on its way, or a denormal that becomes 0."""
        with tempfile.TemporaryDirectory(prefix="drivebench-control-") as folder:
            file = pathlib.Path(folder) / "run.mcap"
            server = self.server("--record", str(file))
            client = self.client(server)
            client.lease()
            given = ((-0.0, 5e-324), (-1e-310, -0.0), (3.0, 0.1))
            for tick, (u_a_v, u_b_v) in enumerate(given):
                client.step(tick, u_a_v, u_b_v)
            self.assertEqual(server.stop(), 0)
            inputs = [pb.Input.FromString(content) for content in Recording(file.read_bytes()).contents["/inputs"]]
        taken = [each.command for each in inputs if each.WhichOneof("action") == "command"]
        self.assertEqual([struct.pack("<2d", each.u_a_v, each.u_b_v) for each in taken], [struct.pack("<2d", *each) for each in given])

    def test_duties_reach_the_terminals_and_legs_are_off(self):
        """Catches: duties without their common part, a leg that stays on, a recording that loses either or replays as
        another run."""
        star = "\n".join((SERVO_TEXT, "[axis.machine]", "star = true", "[axis.drive]", 'kind = "switched_inverter"',
                          "[axis.voltage_sensor]", "against_rail = true", ""))
        with tempfile.TemporaryDirectory(prefix="drivebench-duties-") as folder:
            file = pathlib.Path(folder) / "run.mcap"
            server = self.server("--record", str(file), text=star)
            client = self.client(server)
            client.lease()
            for tick, duty in enumerate((0.0, 0.5, 1.0)):
                sample = client.step(tick, gates=pb.GATES_DUTY, d_a=duty, d_b=duty, d_c=duty)
                for mean in (sample.terminal_a_mean_v, sample.terminal_b_mean_v, sample.terminal_c_mean_v):
                    self.assertAlmostEqual(mean, duty * sample.bus_voltage_v, places=6)
            for tick in range(3, 60):
                sample = client.step(tick, gates=pb.GATES_DUTY, d_a=0.6, d_b=0.5, d_c=0.4, legs_off=1)
            self.assertEqual((sample.true_i_a_a, sample.faults), (0.0, 0))
            self.assertNotEqual(sample.true_i_b_a, 0.0)
            self.assertEqual(server.stop(), 0)
            inputs = [pb.Input.FromString(content) for content in Recording(file.read_bytes()).contents["/inputs"]]
            last = [each.command for each in inputs if each.WhichOneof("action") == "command"][-1]
            self.assertEqual((last.gates, last.d_a, last.d_b, last.d_c, last.legs_off, last.u_a_v),
                             (pb.GATES_DUTY, 0.6, 0.5, 0.4, 1, 0.0))
            replayed = subprocess.run([SERVER, "--replay", file], capture_output=True, text=True, timeout=PATIENCE_S)
            self.assertEqual(replayed.returncode, 0, replayed.stderr)
            self.assertIn("equal, bit for bit", replayed.stdout)

    def test_an_upper_switch_opens_without_its_supply_until_the_lower_one_has_filled_it(self):
        """Catches: a bench file whose bootstrap_s is not in force, a fault bit that is another one, stays away or stays for ever, a
        supply that a lower switch of half the time fills."""
        strong = SERVO_TEXT.replace("over_current_a = 6.0", "over_current_a = 60.0")
        board = "\n".join((strong, "[axis.machine]", "star = true", "[axis.drive]", 'kind = "switched_inverter"',
                           "[axis.inverter]", "bootstrap_s = 312.5e-6", "bootstrap_recharge_s = 100e-6",
                           "[axis.voltage_sensor]", "against_rail = true", ""))
        client = self.client(self.server(text=board))
        [empty] = [fault.bit for fault in client.welcome.bench.faults if fault.name == "bootstrap_empty"]
        client.lease()

        def step(d_a):
            sample = client.step(client.newest().tick, gates=pb.GATES_DUTY, d_a=d_a)
            self.assertIn(sample.faults, (0, empty))
            return round(sample.terminal_a_mean_v / sample.bus_voltage_v, 6), int(sample.faults == empty)

        # The current of a leg that opens goes on through its lower diode: the terminal is at the negative rail.
        self.assertEqual([step(1.0) for _ in range(4)], [(1.0, 0), (1.0, 0), (0.5, 1), (0.0, 1)])
        # The lower switch is closed for half of the 125 us of a tick, which fills five eighths: the leg stays off.
        self.assertEqual([step(0.5), step(1.0), step(0.0), step(1.0)], [(0.0, 1), (0.0, 1), (0.0, 1), (1.0, 0)])

    def test_unknown_axes_and_gates_are_refused(self):
        """Catches: an index that is used before it is checked."""
        client = self.client(self.server())
        client.lease()
        for axis in (1, 64, 2**32 - 1):
            self.assertRefused(client.exchange(0, axis=axis), pb.REFUSAL_UNKNOWN_AXIS, "axis")
            self.assertRefused(client.lease(axis=axis), pb.REFUSAL_UNKNOWN_AXIS, "axis")
            for kind in ({"subscribe": pb.Subscribe(axis=axis, decimation=1)}, {"set_load": pb.SetLoad(axis=axis)},
                         {"read_parameters": pb.ReadParameters(axis=axis)},
                         {"write_parameter": pb.WriteParameter(axis=axis)}, {"clear_faults": pb.ClearFaults(axis=axis)},
                         {"inject_fault": pb.InjectFault(axis=axis)}, {"shaft_bump": pb.ShaftBump(axis=axis)}):
                self.assertRefused(client.ask(**kind), pb.REFUSAL_UNKNOWN_AXIS, "axis")
        self.assertRefused(client.exchange(0, gates=6), pb.REFUSAL_OUT_OF_RANGE, "commands.gates")
        self.assertRefused(client.exchange(0, legs_off=8), pb.REFUSAL_OUT_OF_RANGE, "commands.legs_off")
        self.assertRefused(client.exchange(0, gates=3), pb.REFUSAL_WRONG_DRIVE, "commands.gates")
        self.assertRefused(client.exchange(0, gates=pb.GATES_EDGES), pb.REFUSAL_WRONG_DRIVE, "commands.gates")
        nine = [pb.LegEdge(offset_ns=n, level=pb.LEG_LEVEL_LOW) for n in range(9)]
        self.assertRefused(client.exchange(0, gates=pb.GATES_EDGES, edges_b=nine), pb.REFUSAL_OUT_OF_RANGE, "commands.edges_b")
        both = pb.Exchange(commands=[pb.Command(tick=0), pb.Command(tick=0)])
        self.assertRefused(client.ask(exchange=both), pb.REFUSAL_OUT_OF_RANGE, "commands.axis")

    def test_the_tick_waits_for_all_controllers(self):
        """Catches: lockstep that runs with a command missing, or an exchange that is answered before its tick."""
        server = self.server(text=TWO_AXES)
        one, two = self.client(server), self.client(server)
        one.lease(axis=0)
        two.lease(axis=1)
        waiting = one.send(exchange=pb.Exchange(commands=[pb.Command(axis=0, tick=0, gates=1, u_a_v=1.0)]))
        self.assertEqual(two.newest(axis=1).tick, 0)
        self.assertRefused(two.exchange(0, axis=0), pb.REFUSAL_NOT_OWNER)
        self.assertEqual(two.step(0, axis=1).tick, 1)
        self.assertEqual(one.answer_to(waiting).exchange_reply.samples[0].sample.tick, 1)

    def test_the_tick_goes_on_when_a_controller_leaves(self):
        """Catches: a controller that waits forever for a second one that is gone."""
        server = self.server(text=TWO_AXES)
        one, two = self.client(server), self.client(server)
        one.lease(axis=0)
        two.lease(axis=1)
        waiting = one.send(exchange=pb.Exchange(commands=[pb.Command(axis=0, tick=0, gates=1)]))
        two.newest()
        two.close()
        self.assertEqual(one.answer_to(waiting).exchange_reply.samples[0].sample.tick, 1)

    def test_cmd_11_an_exchange_is_refused_as_a_whole(self):
        """Catches: the command of one axis that is kept although its exchange was refused, and bars the next try."""
        client = self.client(self.server(text=TWO_AXES))
        client.lease(axis=0)
        client.lease(axis=1)
        bad = pb.Exchange(commands=[pb.Command(axis=0, tick=0, gates=1, u_a_v=5.0),
                                    pb.Command(axis=1, tick=0, gates=1, u_a_v=math.nan)])
        self.assertRefused(client.ask(exchange=bad), pb.REFUSAL_NOT_FINITE)
        good = pb.Exchange(commands=[pb.Command(axis=axis, tick=0, gates=1, u_a_v=7.0) for axis in (0, 1)])
        answer = client.ask(exchange=good)
        self.assertEqual(answer.WhichOneof("kind"), "exchange_reply", answer)
        self.assertEqual([s.sample.u_a_v for s in answer.exchange_reply.samples], [7.0, 7.0])

    def test_a_second_exchange_while_one_waits_is_refused(self):
        """Catches: a pipeline of commands that grows without bound."""
        server = self.server(text=TWO_AXES)
        one, two = self.client(server), self.client(server)
        one.lease(axis=0)
        two.lease(axis=1)
        first = one.send(exchange=pb.Exchange(commands=[pb.Command(axis=0, tick=0)]))
        second = one.send(exchange=pb.Exchange(commands=[pb.Command(axis=0, tick=0)]))
        self.assertRefused(one.answer_to(second), pb.REFUSAL_BUSY)
        two.step(0, axis=1)
        self.assertEqual(one.answer_to(first).WhichOneof("kind"), "exchange_reply")


class Parameters(WireTest):
    def test_writes_keep_their_limits_and_read_back(self):
        """Catches: a write that is confirmed and not done, or one past its limits that is done."""
        server = self.server()
        client = self.client(server)
        client.lease()
        client.step(0)

        def write(name, value):
            return client.ask(write_parameter=pb.WriteParameter(name=name, value=value))

        def read(*names):
            return client.ask(read_parameters=pb.ReadParameters(names=names)).parameter_values.parameters

        name = "machine.rotor_resistance_ohm"
        self.assertEqual(read(name)[0].value, 3.9)
        self.assertDone(write(name, 5.85))
        self.assertEqual(read(name)[0].value, 5.85)
        self.assertEqual(read("amplifier.gain", name)[1].value, 5.85)
        self.assertRefused(write(name, 0.0), pb.REFUSAL_OUT_OF_RANGE, "value")
        self.assertRefused(write(name, -1.0), pb.REFUSAL_OUT_OF_RANGE, "value")
        self.assertRefused(write(name, math.nan), pb.REFUSAL_NOT_FINITE, "value")
        self.assertRefused(write(name, math.inf), pb.REFUSAL_NOT_FINITE, "value")
        self.assertRefused(write("machine.rotor_resistance", 4.0), pb.REFUSAL_UNKNOWN_PARAMETER, "name")
        self.assertRefused(write("machine.pole_pairs", 4.0), pb.REFUSAL_READ_ONLY, "name")
        self.assertRefused(write("amplifier.over_current_trip", 0.5), pb.REFUSAL_OUT_OF_RANGE, "value")
        # Coulomb friction above the static one breaks a rule between two parameters.
        self.assertRefused(write("mechanics.coulomb_friction_nm", 0.1), pb.REFUSAL_OUT_OF_RANGE, "value")
        self.assertDone(write("mechanics.static_friction_nm", 0.2))
        self.assertDone(write("mechanics.coulomb_friction_nm", 0.1))
        self.assertRefused(client.ask(read_parameters=pb.ReadParameters(names=["nonsense"])),
                           pb.REFUSAL_UNKNOWN_PARAMETER, "names")
        everything = read()
        self.assertEqual(len(everything), len({p.name for p in everything}))
        self.assertEqual(next(p.value for p in everything if p.name == name), 5.85)
        for p in everything:
            self.assertTrue(p.minimum <= p.value <= p.maximum, p.name)
        # Every live parameter accepts its own value and both limits' outside is refused.
        for p in everything:
            if p.live:
                self.assertDone(write(p.name, p.value))
                self.assertRefused(write(p.name, math.nextafter(p.maximum, math.inf)), pb.REFUSAL_OUT_OF_RANGE)

    def test_only_the_owner_writes(self):
        """Catches: a viewer that changes the plant under a controller."""
        server = self.server()
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        owner.step(0)
        for kind in ({"write_parameter": pb.WriteParameter(name="amplifier.gain", value=1.1)},
                     {"set_load": pb.SetLoad(load_nm=0.1)}, {"clear_faults": pb.ClearFaults()}):
            self.assertRefused(viewer.ask(**kind), pb.REFUSAL_NOT_OWNER)
            self.assertDone(owner.ask(**kind))

    def test_the_owner_may_write_before_the_first_tick(self):
        """Catches: ownership that is looked up in a sample taken before the lease."""
        client = self.client(self.server())
        client.lease()
        self.assertDone(client.ask(write_parameter=pb.WriteParameter(name="amplifier.gain", value=1.1)))
        self.assertDone(client.ask(set_load=pb.SetLoad(load_nm=0.1)))
        client.lease(pb.LeaseRequest.ACTION_RELEASE)
        self.assertRefused(client.ask(set_load=pb.SetLoad(load_nm=0.1)), pb.REFUSAL_NOT_OWNER)

    def test_a_load_acts_at_its_tick(self):
        """Catches: a load that starts a tick early or late, or a ramp that is a step."""
        client = self.client(self.server())
        client.lease()
        client.step(0)
        self.assertDone(client.ask(set_load=pb.SetLoad(load_nm=0.1, at_tick=5)))
        self.assertDone(client.ask(set_load=pb.SetLoad(load_nm=0.3, at_tick=8, ramp_ticks=4)))
        loads = {tick + 1: client.step(tick).load_nm for tick in range(1, 15)}
        for tick in range(2, 6):
            self.assertEqual(loads[tick], 0.0, tick)
        for tick in range(6, 9):
            self.assertEqual(loads[tick], 0.1, tick)
        for tick in range(9, 16):
            self.assertAlmostEqual(loads[tick], min(0.1 + 0.05 * (tick - 8), 0.3), places=12, msg=tick)
        self.assertRefused(client.ask(set_load=pb.SetLoad(load_nm=math.nan)), pb.REFUSAL_NOT_FINITE, "load_nm")
        self.assertRefused(client.ask(set_load=pb.SetLoad(load_nm=2e6)), pb.REFUSAL_OUT_OF_RANGE, "load_nm")
        self.assertRefused(client.ask(set_load=pb.SetLoad(at_tick=2**60)), pb.REFUSAL_OUT_OF_RANGE)


class Realtime(WireTest):
    def owner_at_work(self, server):
        """A controller that has sent commands and stopped; real time goes on without it."""
        owner = self.client(server)
        self.assertDone(owner.lease())
        self.drive(owner, 5.0)
        return owner

    def test_state_01_the_first_commands_do_not_drive_the_axis(self):
        """Catches: an axis that moves with the first frame of a controller that is only starting."""
        slow = PATIENT_TEXT.replace("period_us = 125", "period_us = 1000").replace("watchdog_ticks = 400000", "watchdog_ticks = 40000")
        server = self.server("--mode", "realtime", text=slow)
        owner, viewer = self.client(server), self.client(server)
        self.assertEqual(owner.welcome.bench.arming_commands, 10)
        self.assertDone(viewer.ask(subscribe=pb.Subscribe(decimation=1, signals=["tick", "state", "u_a_v", "command_tick"])))
        self.assertDone(owner.lease())
        self.drive(owner, 5.0)

        def seen():
            viewer.newest()
            return [s for message in viewer.samples for s in message.samples]
        until(lambda: any(s.u_a_v == 5.0 for s in seen()), "the command is in force")
        before = [s for s in seen() if s.state in (0, 5)]
        self.assertTrue(any(s.state == 5 for s in before), "the axis was ready first")
        self.assertEqual({(s.u_a_v, s.command_tick) for s in before}, {(0.0, -1)})

    def test_cmd_02_silence_is_a_latched_timeout(self):
        """Catches: a plant that goes on with the last command of a controller that hangs."""
        server = self.server("--mode", "realtime", text=PATIENT_TEXT.replace("watchdog_ticks = 400000", "watchdog_ticks = 4000"))
        owner = self.owner_at_work(server)
        until(lambda: owner.newest().state == 3, "timeout")
        sample = owner.newest()
        self.assertTrue(sample.faults & (1 << 9), hex(sample.faults))
        self.assertGreaterEqual(sample.missed_commands, 4000)
        self.assertRefused(owner.exchange(sample.tick, 5.0), pb.REFUSAL_LATCHED)
        self.assertEqual(owner.newest().state, 3, "a command does not clear it")
        self.assertRefused(self.client(server).ask(clear_faults=pb.ClearFaults()), pb.REFUSAL_NOT_OWNER)
        self.assertDone(owner.ask(clear_faults=pb.ClearFaults()))
        sample = owner.newest()
        self.assertEqual((sample.state, sample.faults & (1 << 9)), (0, 0))
        until(lambda: owner.exchange(owner.newest().tick).WhichOneof("kind") == "exchange_reply", "a command")

    def test_cmd_13_a_step_beyond_the_slope_is_refused(self):
        """Catches: a command that is answered as taken and that the bench refuses."""
        text = SERVO_TEXT.replace('motor = "', 'on_excess = "refuse"\nslew_per_s = 1.0\nmotor = "', 1)
        owner = self.client(self.server("--mode", "realtime", text=text))
        self.assertDone(owner.lease())
        until(lambda: owner.exchange(owner.newest().tick).WhichOneof("kind") == "exchange_reply", "a first command")
        before = owner.newest()
        self.assertRefused(owner.exchange(before.tick, 60.0), pb.REFUSAL_OUT_OF_RANGE, "commands")
        until(lambda: owner.newest().refused_commands == before.refused_commands + 1, "the bench has counted it")

    def test_own_03_the_lease_of_a_silent_owner_ends(self):
        """Catches: an axis that is lost to a client which keeps its socket open and sends nothing."""
        server = self.server("--mode", "realtime", text=SERVO_TEXT.replace("watchdog_ticks = 20", "watchdog_ticks = 4000"))
        heir = self.client(server)
        owner = self.owner_at_work(server)
        self.assertRefused(heir.lease(), pb.REFUSAL_OWNED)
        until(lambda: heir.lease().WhichOneof("kind") == "done", "the lease ran out")
        self.assertRefused(owner.exchange(owner.newest().tick), pb.REFUSAL_NOT_OWNER)
        self.assertRefused(owner.lease(), pb.REFUSAL_OWNED)

    def test_realtime_never_waits_for_commands(self):
        """Catches: a paced bench that stands still without a controller."""
        client = self.client(self.server("--mode", "realtime"))
        first = client.newest().tick
        until(lambda: client.newest().tick > first + 100, "ticks go on")

    def test_duration_ends_the_run_with_a_verdict(self):
        """Catches: a run of given length that is a tick short, or does not end."""
        for mode in ("realtime", "free"):
            server = self.server("--mode", mode, "--duration", "0.25")
            out = server.process.stdout.read()  # not communicate(): the verdict may have come with the first line
            self.assertEqual(server.process.wait(timeout=PATIENCE_S), 0)
            self.assertIn('"ticks":2000', out)


if __name__ == "__main__":
    unittest.main(verbosity=2)
