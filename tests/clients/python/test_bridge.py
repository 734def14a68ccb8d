"""The class Bridge of the package `drivebench`: a speed controller's power stage at gate level."""
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
import python_package  # noqa: E402, F401

import drivebench  # noqa: E402
from drivebench import EdgeKind, LegMode  # noqa: E402

MICRO = 10**6


def align(bridge):
    bridge.set("a", LegMode.LOW)
    bridge.set(1, LegMode.PWM, period_ps=20 * MICRO, compare_ps=2 * MICRO, dead_ps=200_000)
    bridge.set("c", LegMode.OPEN)


class GateLevel(unittest.TestCase):
    # Catches: a leg, a time or a mode that comes to another place of the struct; edges that get lost between two calls.
    def test_events_are_the_same_one_by_one_and_at_once(self):
        with drivebench.Bridge("inproc:esc") as whole, drivebench.Bridge("inproc:esc") as single:
            for bridge in (whole, single):
                align(bridge)
            expected = whole.run(3000 * MICRO, room=4096)
            found = []
            while (next_one := single.next_edge(3000 * MICRO)) is not None:
                self.assertEqual(single.run(3000 * MICRO, room=1), [next_one])
                self.assertEqual(single.read().now_ps, next_one.at_ps)
                found.append(next_one)
            single.run(3000 * MICRO)
            self.assertEqual(found, expected)
            self.assertIn(EdgeKind.COMPARATOR, {edge.kind for edge in found})
            self.assertEqual(bytes(single.read()), bytes(whole.read()))
            state = whole.read()
            self.assertGreater(state.current_a[1], 0.5)  # into b, out of a; c may have a little through its diodes
            self.assertAlmostEqual(sum(state.current_a), 0.0, places=9)

    # Catches: means that count from another instant, a parameter that is not written.
    def test_means_count_from_the_mark_and_parameters_are_live(self):
        with drivebench.Bridge("inproc:esc") as bridge:
            align(bridge)
            bridge.set_load(0.01)
            bridge.run(100 * MICRO)
            bridge.mark()
            before = bridge.save()
            bridge.run(2000 * MICRO)
            means, now = bridge.mean(), bridge.read()
            self.assertEqual(means.since_ps, 100 * MICRO)
            self.assertAlmostEqual(means.time_s, 1900e-6, places=15)
            self.assertEqual(now.load_nm, 0.01)
            bridge.restore(before)
            resistance_ohm = bridge.get_parameter("machine.stator_resistance_ohm")
            bridge.set_parameter("machine.stator_resistance_ohm", 4 * resistance_ohm)
            bridge.run(2000 * MICRO)
            self.assertLess(bridge.mean().current_a[1], 0.8 * means.current_a[1])

    # Catches: a refusal without its sentence or class, a pointer that is used after its end.
    def test_what_cannot_be_is_refused(self):
        with self.assertRaisesRegex(drivebench.DrivebenchError, "must be inproc:BENCH"):
            drivebench.Bridge("tcp:localhost:7300")
        with self.assertRaisesRegex(drivebench.Refused, "has no gates"):
            drivebench.Bridge("inproc:servo")
        with drivebench.Bridge("inproc:esc") as bridge:
            bridge.run(10 * MICRO)
            for wrong, sentence in ((lambda: bridge.run(9 * MICRO), "does not go back"),
                                    (lambda: bridge.set("d", LegMode.LOW), "leg is 'd'"),
                                    (lambda: bridge.set(3, LegMode.LOW), "has legs 0 to 2"),
                                    (lambda: bridge.set("a", LegMode.PWM), "period_ps is 0 but"),
                                    (lambda: bridge.set_parameter("bus.votage_v", 1.0), "did you mean .bus.voltage_v"),
                                    (lambda: bridge.inject("open_phse", 1.0), "open_phase"),
                                    (lambda: bridge.restore(b"none"), "shorter than a state"),
                                    (lambda: bridge.restore("none"), "must be bytes")):
                with self.assertRaisesRegex(drivebench.DrivebenchError, sentence):
                    wrong()
        with self.assertRaisesRegex(drivebench.BenchClosed, "the bridge is closed"):
            bridge.read()


if __name__ == "__main__":
    unittest.main(verbosity=2)
