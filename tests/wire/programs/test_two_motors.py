#!/usr/bin/python3
"""Two motors on one amplifier over the wire (the book, chapter 9, exercise 9; ST-05): the preset, and what the second axis refuses."""
import csv
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from wire_client import BENCHES, PATIENCE_S, SERVER, Server, pb
except ImportError as missing:
    print(f"SKIPPED: {missing}")
    sys.exit(77)

COMMAND = SERVER.with_name("drivebench")
STEPPERS = BENCHES / "two-steppers.toml"
WINDOWS = {"run-up": (0.0, 0.4), "together": (0.4, 0.6), "through zero": (0.6, 0.75), "behind": (0.75, 1.0)}
DEGREES = 57.29577951308232
NAMED = "axis second takes the voltages of axis first, whose amplifier it shares"


def command(verb, *options, code=0):
    done = subprocess.run([COMMAND, verb, *map(str, options)], capture_output=True, text=True, timeout=2 * PATIENCE_S)
    if done.returncode != code:
        raise AssertionError(done.stdout + done.stderr)
    return done


def link(server):
    return ["--link", "tcp:%s:%d" % server.address]


def moved(*options):
    """By window the largest errors [deg] of both, voltage and current of the amplifier, and the least determinant."""
    with tempfile.TemporaryDirectory(prefix="drivebench-two-") as folder, Server(config=STEPPERS) as server:
        table = pathlib.Path(folder) / "run.csv"
        command("control", "--preset", "exercise/9.9", *link(server), "--csv", table, *options)
        with table.open(encoding="utf-8") as lines:
            rows = list(csv.DictReader(lines))

    def largest(part, *names):
        return max(abs(float(row[name])) for row in part for name in names)

    out = {}
    for name, (start, end) in WINDOWS.items():
        part = [row for row in rows if start <= float(row["time_s"]) < end]
        out[name] = (DEGREES * largest(part, "error_rad [rad]"), DEGREES * largest(part, "controller_second_error_rad"),
                     largest(part, "command_a_v [V]", "command_b_v [V]"), largest(part, "controller_amplifier_current_a"),
                     min(abs(float(row["controller_determinant"])) for row in part))
    return out


class Moves(unittest.TestCase):
    def test_both_motors_make_their_own_moves_through_the_singularity(self):
        """Catches: voltages of another rotor's frame, a determinant of the wrong angles, a way through zero that loses a motor:
        that would leave a whole electrical turn, 7.2 degrees. Away from zero the errors are those of the encoder, 0.0072 degrees
        a count, and of the run-up."""
        rows = moved()
        for name in ("run-up", "together", "behind"):
            self.assertLess(max(rows[name][:2]), 0.03, rows)
            self.assertGreater(rows[name][4], 0.99, rows)
        self.assertLess(max(rows["through zero"][:2]), 1.0, rows)
        self.assertLess(rows["through zero"][4], 0.05, rows)

    def test_without_damping_the_inverse_runs_into_the_limit(self):
        """Catches: a damping that does nothing, a voltage beyond the limit."""
        rows = moved("--gain", "damping=1e-9")
        self.assertAlmostEqual(rows["through zero"][2], 3.0, places=9)
        self.assertGreater(rows["through zero"][0], 1.5)

    def test_with_too_much_damping_the_rotors_stay_at_zero(self):
        """Catches: a determinant that only looks as if it passed zero."""
        rows = moved("--gain", "damping=1")
        self.assertLess(rows["behind"][4], 0.05)
        self.assertAlmostEqual(rows["behind"][0], 1.8, delta=0.1)

    def test_a_recorded_run_replays_and_compares_bit_for_bit(self):
        """Catches: a recording whose bench has two amplifiers, a comparison without the second axis, a run that cannot follow
        another one on the same bench."""
        with tempfile.TemporaryDirectory(prefix="drivebench-two-") as folder:
            recording = pathlib.Path(folder) / "run.mcap"
            with Server("--record", str(recording), config=STEPPERS) as server:
                for back_rad in (0.02 * math.pi, -0.02 * math.pi):  # the second run brings the second rotor ahead again
                    command("control", "--preset", "exercise/9.9", *link(server), "--gain", f"fall_back.distance_rad={back_rad}")
                self.assertEqual(server.stop(), 0, server.errors())
            done = subprocess.run([SERVER, "--replay", recording], capture_output=True, text=True, timeout=PATIENCE_S)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            compared = json.loads(command("control", "--compare", recording, "--preset", "exercise/9.9", "--threshold", 0,
                                          "--json").stdout)
            self.assertEqual(compared["commands"]["largest"], 0.0)
            self.assertTrue(compared["whole"])
            drawn = command("plot", recording, "--preset", "exercise/9.9", "--panels", "speed,second_error_rad,determinant").stdout
            self.assertIn("determinant", drawn)
            told = command("plot", recording, "--preset", "exercise/9.9", "--panels", "heat", code=2).stderr
            self.assertIn("second_error_rad", told)

    def test_another_bench_is_refused(self):
        """Catches: numbers of the steppers used on another motor, a second motor that is not there."""
        with Server() as server:
            told = command("control", "--preset", "exercise/9.9", *link(server), code=2).stderr
        self.assertIn("the preset drives two motors, but this link shows no axis that shares the amplifier of this one", told)


class SecondAxis(unittest.TestCase):
    def refusal(self, client, **request):
        answer = client.ask(**request)
        self.assertTrue(answer.HasField("refusal"), answer)
        self.assertEqual(answer.refusal.code, pb.REFUSAL_SHARED_AMPLIFIER, answer)
        self.assertIn(NAMED, answer.refusal.message)

    def test_it_refuses_commands_leases_and_the_drive_by_name(self):
        """Catches: a second axis that can be leased, that lockstep waits for, or whose refusal does not say whose it is."""
        with Server(config=STEPPERS) as server, server.client() as client:
            self.assertEqual([axis.shares_amplifier_with for axis in client.welcome.bench.axes], ["", "first"])
            for action in (pb.LeaseRequest.ACTION_ACQUIRE, pb.LeaseRequest.ACTION_RENEW, pb.LeaseRequest.ACTION_RELEASE):
                self.refusal(client, lease=pb.LeaseRequest(axis=1, action=action))
            self.refusal(client, exchange=pb.Exchange(commands=[pb.Command(axis=1, tick=0)]))
            client.ask(lease=pb.LeaseRequest(axis=0, action=pb.LeaseRequest.ACTION_ACQUIRE))
            self.refusal(client, lease=pb.LeaseRequest(axis=1, action=pb.LeaseRequest.ACTION_ACQUIRE))
            self.refusal(client, clear_faults=pb.ClearFaults(axis=1))
            self.refusal(client, inject_fault=pb.InjectFault(axis=1, name="bus_sag", value=0.5))
            written = client.ask(write_parameter=pb.WriteParameter(axis=1, name="amplifier.gain", value=2.0))
            self.assertIn("belongs to axis first, whose amplifier this axis shares", written.refusal.message)
            both = pb.Exchange(commands=[pb.Command(axis=axis, tick=0, gates=pb.GATES_VOLTAGE, u_a_v=1.0) for axis in (0, 1)])
            self.refusal(client, exchange=both)

    def test_one_exchange_drives_and_shows_both(self):
        """Catches: a tick that waits for commands of the second axis, an answer without its sample, a load on it that the
        controller of the first may not set."""
        with Server(config=STEPPERS) as server, server.client() as client:
            client.ask(lease=pb.LeaseRequest(axis=0, action=pb.LeaseRequest.ACTION_ACQUIRE))
            self.assertTrue(client.ask(set_load=pb.SetLoad(axis=1, load_nm=0.01)).HasField("done"))
            one = pb.Exchange(commands=[pb.Command(axis=0, tick=0, gates=pb.GATES_VOLTAGE, u_a_v=1.0)])
            samples = client.ask(exchange=one).exchange_reply.samples
            self.assertEqual([each.axis for each in samples], [0, 1])
            self.assertEqual([each.sample.u_a_v for each in samples], [1.0, 1.0])
            self.assertEqual([each.sample.tick for each in samples], [1, 1])
            self.assertEqual(samples[1].sample.load_nm, 0.01)
            self.assertNotEqual(samples[1].sample.owner, 0)

    def test_the_command_line_leases_the_axis_of_the_amplifier(self):
        """Catches: a load or a parameter of the second machine that no command can change; a clear that seems to work."""
        with Server(config=STEPPERS) as server:
            command("set", "second", "mechanics.viscous_friction_nms", "9e-4", *link(server))
            self.assertIn("takes the voltages of axis first", command("clear", "second", *link(server), code=1).stderr)
            self.assertIn("on the amplifier of first", command("describe", *link(server)).stdout)


if __name__ == "__main__":
    unittest.main(verbosity=2)
