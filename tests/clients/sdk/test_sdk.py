"""One C program over every way to a bench: the same lines, whichever it takes."""
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from free_port import free_udp_port  # noqa: E402
from wire_client import BENCHES, PATIENCE_S, SERVER, Server  # noqa: E402
from wire_test import PATIENT_TEXT  # noqa: E402

EXERCISE = SERVER.with_name("sdk_exercise")
SIX_STEP = SERVER.with_name("six_step")
SIX_STEP_GATES = SERVER.with_name("six_step_gates")
MOTORS = str(BENCHES.parent / "motors")


def run_of(program, *arguments, code=0):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    if done.returncode != code:
        raise AssertionError(f"{program.name} {arguments} ended with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout


def exercise(*arguments, code=0):
    return run_of(EXERCISE, *arguments, code=code)


class Sdk(unittest.TestCase):
    def bench_file(self, folder):
        file = pathlib.Path(folder) / "bench.toml"
        file.write_text(PATIENT_TEXT, encoding="utf-8")
        return file

    # Catches: a request, a refusal, a sentence or a bit that differs between the bench in process and the server.
    def test_in_process_tcp_unix_and_shared_memory_say_the_same(self):
        with tempfile.TemporaryDirectory() as folder:
            said = [exercise(f"inproc:{self.bench_file(folder)}")]
            for way in ("tcp", "unix", "shm"):
                path = f"{folder}/{way}.sock"
                with Server("--unix", path, text=PATIENT_TEXT) as server:
                    said.append(exercise("tcp:%s:%d" % server.address if way == "tcp" else f"{way}:{path}"))
        self.assertIn("hash ", said[0])
        self.assertIn("tick 900: encoder", said[0])
        for other in said[1:]:
            self.assertEqual(said[0].splitlines(), other.splitlines())
        again = re.findall(r"^hash again (\w+)$", said[0], re.MULTILINE)
        self.assertEqual(len(again), 1)
        self.assertIn(f"\nhash {again[0]}\n", said[0])

    # Catches: an edge that one of the ways rounds, leaves out or judges differently, or that a recording does not repeat.
    def test_edges_of_legs_are_the_same_over_every_way(self):
        text = (BENCHES / "esc.toml").read_text(encoding="utf-8").replace("../motors", MOTORS)
        with tempfile.TemporaryDirectory() as folder:
            said = [exercise("inproc:esc", "edges")]
            for way in ("tcp", "unix", "shm"):
                path, recording = f"{folder}/{way}.sock", f"{folder}/{way}.mcap"
                with Server("--unix", path, "--record", recording, text=text) as server:
                    said.append(exercise("tcp:%s:%d" % server.address if way == "tcp" else f"{way}:{path}", "edges"))
                    server.stop()
                replay = subprocess.run([SERVER, "--replay", recording], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
                self.assertEqual(replay.returncode, 0, replay.stdout + replay.stderr)
        self.assertIn("tick 2000: faults 0", said[0])
        for sentence in ("edge 2 of leg a is at 5000 ns but must be after the edge ahead of it, 5000 ns' field 'commands.edges_a'",
                         "edge 2 of leg a is at 20000 ns but must be before the end of the tick, 20000 ns'",
                         "the level of edge 2 of leg a is 4 but must be 1 (off), 2 (low) or 3 (high), or 0 after the last edge'",
                         "edge 3 of leg a follows the end of the list'",
                         "edge 2 of leg a is at 4000000000 ns but must be before the end of the tick, 20000 ns'"):
            self.assertIn(sentence, said[0])
        for other in said[1:]:
            self.assertEqual(said[0].splitlines(), other.splitlines())

    # The example of a firmware without a sensor of the rotor: 80 % of the no-load speed by comparators alone, a load step that
    # it answers, and the same hash over every way and in the replay of its recording. Catches: a comparator, or the time of an
    # edge, that differs between the ways; a step of commutation that is lost; a recording that leaves comparators out.
    def test_a_sensorless_run_up_is_the_same_over_every_way(self):
        text = (BENCHES / "esc.toml").read_text(encoding="utf-8").replace("../motors", MOTORS)
        with tempfile.TemporaryDirectory() as folder:
            recording = f"{folder}/run.mcap"
            said = [run_of(SIX_STEP, "inproc:esc")]
            for way in ("tcp", "unix", "shm"):
                options = ("--record", recording) if way == "shm" else ()
                path = f"{folder}/{way}.sock"
                with Server("--unix", path, *options, text=text) as server:
                    said.append(run_of(SIX_STEP, "tcp:%s:%d" % server.address if way == "tcp" else f"{way}:{path}"))
                    server.stop()
            replay = subprocess.run([SERVER, "--replay", recording], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        before, lowest, after = map(int, re.match(r"(\d+) rpm before the load step, at least (\d+) after it, (\d+) at the end", said[0]).groups())
        self.assertLess(abs(before - 0.8 * 900 * 14.8), 60, said[0])
        self.assertLess(lowest, before - 30, said[0])
        self.assertLess(abs(after - before), 30, said[0])
        self.assertIn(", 0 without a crossing, hash ", said[0])
        for other in said[1:]:
            self.assertEqual(said[0], other)
        self.assertEqual(replay.returncode, 0, replay.stdout + replay.stderr)

    # The same firmware with a scheduler of its own, at gate level. Catches: an edge that is lost or comes at another time, legs that act
    # late, a load that holds from another instant, an energy that is not that of the link.
    def test_a_sensorless_run_up_at_gate_level(self):
        said = run_of(SIX_STEP_GATES, "inproc:esc")
        before, lowest, after = map(int, re.match(r"(\d+) rpm before the load step, at least (\d+) after it, (\d+) at the end", said).groups())
        self.assertLess(abs(before - 0.8 * 900 * 14.8), 60, said)
        self.assertLess(lowest, before - 30, said)
        self.assertLess(abs(after - before), 30, said)
        self.assertIn(", 0 without a crossing", said)
        ampere, volt, watt, shaft_watt, copper_watt = map(float, re.search(
            r"after the step ([\d.]+) A at ([\d.]+) V: ([\d.]+) W, of which ([\d.]+) W turn the propeller and ([\d.]+) W heat", said).groups())
        self.assertLess(abs(watt - ampere * volt), 0.01 * watt, said)
        self.assertLess(abs(watt - shaft_watt - copper_watt), 0.01 * watt, said)
        self.assertEqual(said, run_of(SIX_STEP_GATES, "inproc:esc"))
        with tempfile.TemporaryDirectory() as folder, Server("--unix", f"{folder}/esc.sock", config=BENCHES / "esc.toml"):
            self.assertEqual(said, run_of(SIX_STEP_GATES, f"shm:{folder}/esc.sock?spin_us=50"))

    # The same firmware on the parts of a board: R_ds(on), diodes, shunts, break input. Catches: a key that the bench in process, the
    # server or a replay leaves out, diodes that take no voltage, a break input that trips in a run that is sound.
    def test_the_parts_of_a_board_are_the_same_over_every_way(self):
        text = (BENCHES / "esc-board.toml").read_text(encoding="utf-8").replace("../motors", MOTORS)
        with tempfile.TemporaryDirectory() as folder:
            path, recording = f"{folder}/bench.sock", f"{folder}/run.mcap"
            said = run_of(SIX_STEP, "inproc:esc-board")
            with Server("--unix", path, "--record", recording, text=text) as server:
                self.assertEqual(said, run_of(SIX_STEP, f"shm:{path}"))
                server.stop()
            replay = subprocess.run([SERVER, "--replay", recording], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        self.assertEqual(replay.returncode, 0, replay.stdout + replay.stderr)
        before, lowest, after = map(int, re.match(r"(\d+) rpm before the load step, at least (\d+) after it, (\d+) at the end", said).groups())
        self.assertLess(abs(before - 0.8 * 900 * 14.8), 60, said)
        self.assertLess(lowest, before - 30, said)
        self.assertLess(abs(after - before), 30, said)

    # Catches: a set-point that a bus rounds although it need not, a tick that it costs, an axis with another number.
    def test_field_buses_move_the_motor_as_the_bench_in_process_does(self):
        port = free_udp_port()
        can = (BENCHES / "servo-can.toml").read_text(encoding="utf-8").replace("../motors", MOTORS)
        can = can.replace("port = 43113", f"port = {port}").replace("fd = false", "fd = true")
        modbus = (BENCHES / "servo-modbus.toml").read_text(encoding="utf-8").replace("../motors", MOTORS)
        modbus = modbus.replace("port = 1502", "port = 0")
        here = exercise("inproc:servo-can", "bus").splitlines()
        with Server(text=can):
            over_can = exercise(f"can:udp_multicast:239.74.163.2:{port}?fd={int('fd = true' in can)}", "bus").splitlines()
        with Server(text=modbus) as server:
            over_modbus = exercise(f"modbus:{server.ready['modbus']}", "bus").splitlines()
        moved = [line for line in here if line.startswith("tick 900")]
        self.assertEqual(len(moved), 1, here)
        self.assertNotIn("encoder 0,", moved[0])
        for other in (over_can, over_modbus):
            self.assertEqual([line for line in other if line.startswith("tick 900")], moved, other)
            self.assertIn("acquire another axis: 4 'axis 3 does not exist; this address leads to one axis, number 0' "
                          "field 'axis'", other)

    # Catches: a library that hangs on, crashes with, or keeps silent about a bench that is not there.
    def test_what_cannot_be_opened_says_why(self):
        for address, why in (("inproc:servoo", 'did you mean "servo"'), ("inproc:", "no bench file ''"),
                             ("tcp:127.0.0.1:1", "Connection refused"), ("unix:/nowhere/socket", "No such file"),
                             ("shm:/nowhere/socket", "No such file"), ("shm:/tmp/x?spin_us=101", "0 to 100"),
                             ("shm:", "path of a socket"),
                             ("tcp:127.0.0.1:99999", "99999"), ("can:nothing:vcan0", "nothing"),
                             ("modbus:127.0.0.1:1", "Connection refused"), ("", "")):
            self.assertIn(why, exercise(address, code=1), address)

    # Catches: a bench file with a wrong value that is opened all the same, or refused without naming file and key.
    def test_a_wrong_bench_file_is_refused_as_the_server_does(self):
        with tempfile.TemporaryDirectory() as folder:
            file = self.bench_file(folder)
            file.write_text(PATIENT_TEXT.replace("watchdog_ticks = 400000", "watchdog_ticks = -1"), encoding="utf-8")
            said = exercise(f"inproc:{file}", code=1)
            self.assertIn("bench.toml", said)
            self.assertIn("watchdog_ticks", said)

    # Catches: a call that waits for ever when the server dies, or that goes on as if nothing were.
    def test_a_server_that_dies_is_a_lost_link(self):
        for way in ("tcp", "shm"):
            with Server(text=PATIENT_TEXT, unix=True) as server:
                address = "tcp:%s:%d" % server.address if way == "tcp" else f"shm:{server.unix_path}"
                holder = subprocess.Popen([EXERCISE, address, "die"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
                self.assertEqual(holder.stdout.readline(), "ready\n")
                server.process.kill()
                server.process.wait()
                said, _ = holder.communicate("\n", timeout=PATIENCE_S)
            self.assertRegex(said, rf"step: -3 '{way}:\S+ closed the connection.*'")
            self.assertRegex(said, r"again: -3 'the link to .* is closed'")


if __name__ == "__main__":
    unittest.main(verbosity=2)
