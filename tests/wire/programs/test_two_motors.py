#!/usr/bin/python3
"""The example of two motors on one amplifier (the book, chapter 9, exercise 9; ST-05)."""
import pathlib
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
from wire_client import BENCHES, PATIENCE_S, REPOSITORY, SERVER, Server

EXAMPLE = REPOSITORY / "clients/python/examples/two_motors.py"
STEPPERS = BENCHES / "two-steppers.toml"


def example(server, *options):
    return subprocess.run([sys.executable, EXAMPLE, "%s:%d" % server.address, *options], capture_output=True, text=True,
                          timeout=2 * PATIENCE_S)


def moved(*options):
    """The printed lines, and the rows by name: errors [deg], voltage, current, determinant."""
    with Server(config=STEPPERS) as server:
        done = example(server, *options)
    if done.returncode != 0:
        raise AssertionError(done.stderr)
    lines = done.stdout.splitlines()
    return lines, {line[:14].strip(): [float(word) for word in line[14:].split()] for line in lines[1:]}


class TwoMotors(unittest.TestCase):
    def test_both_motors_make_their_own_moves_through_the_singularity(self):
        """Catches: voltages of another rotor's frame, a determinant of the wrong angles, a way through zero that loses a motor:
        that would leave a whole electrical turn, 7.2 degrees. Away from zero the errors are those of the encoder, 0.0072 degrees
        a count, and of the run-up."""
        lines, rows = moved()
        for name in ("run-up", "together", "behind"):
            self.assertLess(max(rows[name][:2]), 0.03, lines)
            self.assertGreater(rows[name][4], 0.99, lines)
        self.assertLess(max(rows["through zero"][:2]), 1.0, lines)
        self.assertLess(rows["through zero"][4], 0.05, lines)

    def test_the_readme_shows_what_is_printed(self):
        """Catches: a table that is no longer the example's. Another C library rounds the cosines otherwise, and the steps of the
        encoder make that up to a tenth on the way through zero."""
        lines, rows = moved()
        told = (REPOSITORY / "clients/README.md").read_text(encoding="utf-8").splitlines()
        self.assertIn("    " + lines[0], told)
        for name, values in rows.items():
            shown = [line for line in told if line.startswith(f"    {name:14} ")]
            self.assertEqual(len(shown), 1, name)
            for value, expected in zip(values, shown[0][18:].split(), strict=True):
                self.assertAlmostEqual(value, float(expected), delta=0.01 + 0.1 * abs(value), msg=lines)

    def test_without_damping_the_inverse_runs_into_the_limit(self):
        """Catches: a damping that does nothing, a voltage beyond the limit."""
        _, rows = moved("--damping", "0")
        self.assertEqual(rows["through zero"][2], 3.0)
        self.assertGreater(rows["through zero"][0], 1.5)

    def test_with_too_much_damping_the_rotors_stay_at_zero(self):
        """Catches: a determinant that only looks as if it passed zero."""
        _, rows = moved("--damping", "1")
        self.assertLess(rows["behind"][4], 0.05)
        self.assertAlmostEqual(rows["behind"][0], 1.8, delta=0.1)

    def test_a_recorded_run_replays_bit_for_bit(self):
        """Catches: commands of two axes in one exchange that a recording has in another order."""
        with tempfile.TemporaryDirectory(prefix="drivebench-two-") as folder:
            recording = pathlib.Path(folder) / "run.mcap"
            with Server("--record", str(recording), config=STEPPERS) as server:
                self.assertEqual(example(server).returncode, 0)
                server.process.terminate()
                server.process.wait(PATIENCE_S)
            done = subprocess.run([SERVER, "--replay", recording], capture_output=True, text=True, timeout=PATIENCE_S)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_another_bench_is_refused(self):
        """Catches: numbers of the steppers used on another motor."""
        with Server() as server:
            done = example(server)
        self.assertEqual(done.returncode, 1)
        self.assertIn("the bench is servo", done.stderr)

    def test_without_a_bench_it_says_so(self):
        """Catches: a traceback in the place of a sentence."""
        done = subprocess.run([sys.executable, EXAMPLE, "127.0.0.1:1"], capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(done.returncode, 1)
        self.assertTrue(done.stderr.startswith("no bench at 127.0.0.1:1: "), done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
