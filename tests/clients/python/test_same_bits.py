"""The package `drivebench`: one program over every link, its samples and hashes, and the state of a bench in process."""
import contextlib
import io
import math
import pathlib
import runpy
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
import python_package  # noqa: E402
from free_port import free_udp_port  # noqa: E402
from wire_client import BENCHES  # noqa: E402

import drivebench  # noqa: E402

EXAMPLE = python_package.PACKAGE / "examples/speed_loop.py"


def rotating(sample):
    """A controller of an induction motor: 20 V that turn with 25 Hz."""
    angle = 2 * math.pi * 25 * sample.tick * 125e-6
    return drivebench.Command(voltages=(20 * math.cos(angle), 20 * math.sin(angle)))


def run_with_changes(bench):
    """Every kind of input, on `servo`: the samples as bytes, and the hash."""
    bench.acquire()
    samples = [bench.newest()]
    bench.set_load(0.05, ramp_ticks=40, at_tick=100)
    bench.set("machine.rotor_resistance_ohm", 5.0, "servo")
    bench.inject("open_phase", 2, at_tick=300)
    bench.bump(1e-4, at_tick=200)
    for _ in range(400):
        command = rotating(samples[-1])
        samples.append(bench.step(voltages=command.voltages))
    samples.append(bench.step(short=True))
    samples.append(bench.step(off=True))
    return [bytes(each) for each in samples], bench.state_hash()


def two_axes(bench):
    for axis in (0, 1):
        bench.acquire(axis)
    names = [axis.name for axis in bench.describe().axes]
    commands = {names[0]: drivebench.Command(voltages=(1.0, 0.5)), 1: drivebench.Command(voltages=-1.0)}
    for _ in range(50):
        samples = bench.step_all(commands)
    assert list(samples) == list(commands)
    return [bytes(each) for each in samples.values()], bench.state_hash()


def edges(bench):
    """On `esc`: legs by their edges, which turn the vector."""
    bench.acquire()
    for tick in range(300):
        late = 9000 + 10 * (tick % 50)
        sample = bench.step(edges={"a": [(0, "low"), (late, "high"), (late + 400, "low")], "b": [(0, "low")], "c": [(5, "low"), (50, "off")]})
    assert sample.true_i_a_a != 0.0 and sample.faults == 0
    return [bytes(sample)], bench.state_hash()


class SameBits(unittest.TestCase):
    # Catches: edges of another leg or level than their letters and words say, or that a link changes.
    def test_edges_are_the_same_in_process_and_over_tcp(self):
        with drivebench.Bench("inproc:esc") as bench:
            expected = edges(bench)
            terminals = bench.newest()
        # a is 400 ns of 20 us high, less the dead time where its current flows on in a diode; b is low.
        self.assertAlmostEqual(terminals.terminal_a_mean_v, 14.8 * 400 / 20000, delta=14.8 * 450 / 20000)
        self.assertEqual(terminals.terminal_b_mean_v, 0.0)
        with drivebench.serve("esc") as server, drivebench.Bench(server.address) as bench:
            self.assertEqual(edges(bench), expected)

    # Catches: a command with another tick, sign or terminal over one of the links; a sample whose columns are shifted.
    def test_a_program_has_the_same_samples_and_hash_in_process_and_over_tcp(self):
        with drivebench.Bench("inproc:servo") as bench:
            expected = run_with_changes(bench)
        with drivebench.serve("servo") as server:
            with drivebench.Bench(server.address) as bench:
                self.assertEqual(run_with_changes(bench), expected)
            verdict = server.stop()
        self.assertTrue(verdict["exact"])
        self.assertEqual(len(set(expected[0])), len(expected[0]))

    # Catches: commands of several axes in another order than their samples, or a second tick for the second axis.
    def test_two_axes_have_the_same_samples_in_process_and_over_tcp(self):
        with drivebench.Bench("inproc:dynamometer") as bench:
            expected = two_axes(bench)
        self.assertNotEqual(*expected[0])
        with drivebench.serve("dynamometer") as server, drivebench.Bench(server.address) as bench:
            self.assertEqual(two_axes(bench), expected)

    # Catches: an example that no longer works, or that needs to know its link.
    def test_the_speed_loop_prints_the_same_in_process_and_over_tcp(self):
        with drivebench.serve("dc-a-voltage") as server:
            lines = [self.printed(), self.printed(server.address)]
        self.assertEqual(lines[0], lines[1])
        self.assertRegex(lines[0], r"^50\.000 rad/s of 50\.000, hash [0-9a-f]{16}$")

    def printed(self, *arguments):
        out = io.StringIO()
        known, sys.argv = sys.argv, [str(EXAMPLE), *arguments]
        try:
            with contextlib.redirect_stdout(out):
                runpy.run_path(str(EXAMPLE), run_name="__main__")
        finally:
            sys.argv = known
        return out.getvalue().strip()

    # Catches: voltages that are counted although a field bus tells no terminals, and a signal that is not there but said
    # to be known.
    def test_field_buses_step_the_same_motor(self):
        motors = str(BENCHES.parent / "motors")
        port = free_udp_port()
        can = (BENCHES / "servo-can.toml").read_text(encoding="utf-8").replace("port = 43113", f"port = {port}")
        modbus = (BENCHES / "servo-modbus.toml").read_text(encoding="utf-8").replace("port = 1502", "port = 0")
        counts = []
        for text, link_of in ((can, lambda server: f"can:udp_multicast:239.74.163.2:{port}"),
                              (modbus, lambda server: "modbus:" + server.ready["modbus"])):
            with self.bench_file(text.replace("../motors", motors)) as file, drivebench.serve(file) as server, \
                    drivebench.Bench(link_of(server)) as bench:
                bench.acquire()
                self.assertIs(bench.describe().mode, drivebench.Mode.LOCKSTEP)
                with bench.record(["encoder_count", "i_a_a"]) as run:
                    bench.run(lambda sample: drivebench.Command(voltages=(30.0, 0.0)), 50)
                counts.append([list(column) for column in run.arrays().values()])
                with self.assertRaisesRegex(drivebench.Refused, "field bus") as refused:
                    bench.get("machine.rotor_resistance_ohm")
                self.assertIs(refused.exception.code, drivebench.Code.NOT_AVAILABLE)
        self.assertEqual(counts[0], counts[1])
        self.assertGreater(max(counts[0][2]), 1.0)

    @contextlib.contextmanager
    def bench_file(self, text):
        with tempfile.NamedTemporaryFile("w", suffix=".toml", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            yield file.name


class InProcess(unittest.TestCase):
    # Catches: a state without the noise, a lease that a restore gives or takes, and a step that answers a tick of before the restore.
    def test_a_saved_state_goes_on_with_the_same_samples(self):
        with drivebench.Bench("inproc:servo") as bench, drivebench.Bench("inproc:servo") as other:
            bench.acquire()
            bench.run(rotating, 50)
            state = bench.save()
            first = bench.run(rotating, 50)
            bench.restore(state)
            self.assertEqual(bench.run(rotating, 50), first)
            other.acquire()
            other.restore(state)
            self.assertEqual(other.run(rotating, 50), first)
            bench.restore(state)
            self.assertEqual(bench.step(off=True).tick, 51)
            bench.release()
            bench.reset()
            self.assertEqual(bench.newest().tick, 0)
            with self.assertRaises(drivebench.Refused) as refused:
                bench.step(off=True)
            self.assertIs(refused.exception.code, drivebench.Code.NOT_OWNER)

    # Catches: a recorder that misses the first sample, takes one twice, or goes on after its end.
    def test_a_recorder_has_each_tick_once(self):
        with drivebench.Bench("inproc:servo") as bench:
            bench.acquire()
            with bench.record(["speed_rad_s", "faults", "tick"]) as run:
                last = bench.run(rotating, 20)
                bench.newest()
            bench.step(off=True)
            self.assertEqual(list(run.arrays()), ["tick", "speed_rad_s", "faults"])
            self.assertEqual(list(run["tick"]), list(range(21)))
            self.assertEqual(run["speed_rad_s"][-1], last.speed_rad_s)
            self.assertEqual(len(run), 21)
            run.stop()
            with self.assertRaisesRegex(drivebench.BadArgument, "i_a_a"):
                run["i_a_a"]

    # Catches: a latch that is cleared although the opening did not ask for it, or not cleared although it did.
    def test_clear_when_the_axis_is_acquired(self):
        for clear in (False, True):
            with drivebench.Bench("inproc:servo", clear=clear) as bench:
                bench.acquire()
                self.run_into_the_watchdog(bench)
                self.assertIn("command_timeout", bench.describe().fault_names(bench.newest().faults))
                bench.acquire()
                if not clear:
                    with self.assertRaises(drivebench.Refused) as refused:
                        bench.step(voltages=(1.0, 0.0))
                    self.assertIs(refused.exception.code, drivebench.Code.LATCHED)
                    bench.clear()
                self.assertNotEqual(bench.step(voltages=(1.0, 0.0)).state, drivebench.State.TIMEOUT)

    def run_into_the_watchdog(self, bench):
        bench.step(voltages=(1.0, 0.0))
        bench.inject("command_loss", 1)
        while bench.step(voltages=(1.0, 0.0)).state != drivebench.State.TIMEOUT:
            self.assertLess(bench.newest().tick, 100)
        bench.inject("command_loss", 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
