#!/usr/bin/python3
"""`drivebench watch`: rows, JSON, the block in a terminal and its keys, and how it ends."""
import fcntl
import json
import os
import pathlib
import re
import select
import signal
import subprocess
import sys
import termios
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from command_test import DRIVEBENCH, OK, CommandTest, environment, link_of, until
from wire_client import PATIENCE_S


class Watching(CommandTest):
    STILL = "in lockstep time stands still until a controller drives the bench"

    def setUp(self):
        super().setUp()
        self.bench = self.server()
        self.link = link_of(self.bench)

    def watch_a_move(self, *options):
        """The values that come before and in a move."""
        watching = self.start(DRIVEBENCH, "watch", *options, link=self.link)
        if "--json" not in options:
            self.assertSays(watching.stderr.readline(), "watch: axis 0 (servo) of bench servo, lockstep")
        self.assertSays(watching.stderr.readline(), self.STILL)
        self.drivebench("control", link=self.link)
        out, _ = watching.communicate(timeout=PATIENCE_S)
        self.assertEqual(watching.returncode, OK)
        return out.splitlines()

    def test_watch_shows_the_present_values_of_a_lockstep_without_a_controller(self):
        """Catches: a viewer that waits for ever beside a bench whose time stands still, without a word, or keeps a core busy with it."""
        present, = self.drivebench("watch", "--json", "--count", "1", link=self.link).stdout.splitlines()
        present = json.loads(present)
        self.assertEqual((present["bench"], present["tick"], present["time_s"], present["state"]), ("servo", 0, 0.0, 0))
        watching = self.start(DRIVEBENCH, "watch", link=self.link)
        self.assertEqual(watching.stdout.readline().split()[:3], ["tick", "time_s", "state"])
        self.assertEqual(watching.stdout.readline().split()[:3], ["0", "0.000000", "idle"])
        watching.stderr.readline()
        self.assertSays(watching.stderr.readline(), self.STILL, "drivebench control", "the values go on then")
        until(lambda: pathlib.Path(f"/proc/{watching.pid}/stat").read_text(encoding="utf-8").split()[2] == "S", "watch sleeps")
        self.drivebench("control", link=self.link)
        self.assertEqual(watching.stdout.readline().split()[2], "run")

    def test_watch_draws_a_block_in_a_terminal(self):
        """Catches: a block that creeps down the terminal, or that covers the note about the time."""
        ours, theirs = os.openpty()
        self.addCleanup(os.close, ours)
        watching = subprocess.Popen([DRIVEBENCH, "watch", "--signals", "state,i_a_a", "--count", "2", "--rate", "8"], stdout=theirs,
                                    stderr=subprocess.PIPE, text=True, cwd=self.folder, env=environment(self.link))
        os.close(theirs)
        self.addCleanup(watching.communicate)
        self.addCleanup(watching.kill)
        drawn = b""
        while self.STILL.encode() not in drawn:
            self.assertTrue(select.select([ours], [], [], PATIENCE_S)[0], drawn)
            drawn += os.read(ours, 4096)
        self.drivebench("control", link=self.link)
        self.assertEqual(watching.wait(PATIENCE_S), OK)
        while True:
            try:
                drawn += os.read(ours, 4096)
            except OSError:  # the other end is closed
                break
        lines = drawn.decode().replace("\r", "").split("\n")
        self.assertSays(lines[0], "axis 0 (servo) of bench servo, lockstep: tick 0, 0.000000 s")
        self.assertEqual([lines[1].split()[:2], lines[2].split()[:3]], [["state", "idle\x1b[K"], ["i_a_a", "0", "A\x1b[K"]])
        self.assertSays(lines[4], "\x1b[4A", "tick 0, 0.000000 s")  # again, with the note below, which needs two lines
        self.assertSays(lines[7], self.STILL)
        self.assertSays(lines[9], "\x1b[5A", "tick 1000, 0.125000 s")
        self.assertEqual(lines[-1], "\x1b[J")  # the second line of the note is gone
        self.assertEqual(watching.stderr.read(), "")

    def test_keys_choose_the_signals_that_watch_shows(self):
        """Catches: keys that the terminal echoes or that act at the end of a line alone, a signal that is chosen and gets no samples, a
        terminal that stays without echo, curves that do not come."""
        ours, theirs = os.openpty()
        self.addCleanup(os.close, ours)
        termios.tcsetwinsize(theirs, (20, 100))
        before = termios.tcgetattr(theirs)
        with self.server("--mode", "free") as server:
            watching = subprocess.Popen([DRIVEBENCH, "watch", "--signals", "state,i_a_a", "--rate", "50"], stdin=theirs, stdout=theirs,
                                        stderr=subprocess.PIPE, cwd=self.folder, env={**environment(link_of(server)), "LC_ALL": "C.UTF-8"})
            self.addCleanup(watching.communicate)
            self.addCleanup(watching.kill)
            drawn = [b""]

            def shows(pattern, keys=b""):
                drawn[0] = b""
                os.write(ours, keys)
                end = time.monotonic() + PATIENCE_S
                while not re.search(pattern, drawn[0].decode(errors="replace")):
                    left = max(end - time.monotonic(), 0.0)
                    self.assertTrue(select.select([ours], [], [], left)[0] and left, f"no {pattern} in {drawn[0]}")
                    drawn[0] = (drawn[0] + os.read(ours, 4096))[-20_000:]

            shows(r"> state .*\x1b\[K\r?\n  i_a_a +0 A  ▁▁▁▁")
            self.assertEqual(termios.tcgetattr(theirs)[3] & (termios.ECHO | termios.ICANON), 0)
            shows(r"> \[ \] tick ", b"\t")  # the list of all signals
            shows(r"> \[ \] command_tick ", b"\x1b[B")
            shows(r"> \[x\] command_tick ", b" ")
            shows(r"  i_a_a .*\n  command_tick +-1  ▁", b"\t")
            shows(r"  i_a_a .*\n> command_tick ", b"\x1b[B\x1b[B")
            shows(r"> i_a_a .*\n[^>]*up, down", b" ")  # it is left out
            os.write(ours, b"q")
            self.assertEqual(watching.wait(PATIENCE_S), OK)
        self.assertEqual(termios.tcgetattr(theirs), before)
        os.close(theirs)

    def in_a_terminal(self, *command):
        """A program whose terminal controls it, and the other end of that terminal."""
        ours, theirs = os.openpty()
        self.addCleanup(os.close, ours)
        self.addCleanup(os.close, theirs)

        def take():
            os.setsid()
            fcntl.ioctl(0, termios.TIOCSCTTY, 0)

        process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=subprocess.PIPE, cwd=self.folder,
                                   env=environment(self.link), preexec_fn=take)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        return process, theirs

    def test_a_signal_that_ends_watch_gives_the_terminal_back(self):
        """Catches: a shell without echo after ctrl-\\ or a terminal that hangs up."""
        for number in (signal.SIGQUIT, signal.SIGHUP, signal.SIGTERM):
            watching, terminal = self.in_a_terminal(DRIVEBENCH, "watch")
            before = termios.tcgetattr(terminal)
            end = time.monotonic() + PATIENCE_S
            while termios.tcgetattr(terminal)[3] & termios.ECHO:
                self.assertLess(time.monotonic(), end)
                time.sleep(0.01)
            watching.send_signal(number)
            self.assertEqual(watching.wait(PATIENCE_S), OK if number == signal.SIGTERM else -number)
            self.assertEqual(termios.tcgetattr(terminal), before)

    def test_watch_runs_in_the_background(self):
        """Catches: a program in the background that the terminal stops because it asks for keys."""
        shell, terminal = self.in_a_terminal("/bin/sh", "-mc", f"({DRIVEBENCH} watch --count 1 && touch ended) & wait; test -e ended")
        before = termios.tcgetattr(terminal)
        self.assertEqual(shell.wait(PATIENCE_S), OK)
        self.assertEqual(termios.tcgetattr(terminal), before)

    def test_watch_waits_for_the_second_sample_before_it_says_that_none_comes(self):
        """Catches: a bench that is called silent because it was asked for few samples."""
        with self.server("--mode", "realtime") as server:
            said = self.drivebench("watch", "--rate", "0.5", "--count", "2", link=link_of(server)).stderr
        self.assertNotIn("sends no samples", said)

    def test_watch_prints_the_requested_number_of_samples_at_the_rate_of_the_bench(self):
        """Catches: a rate in wall time, which in lockstep means nothing; a --count that is one off."""
        head, *rows = self.watch_a_move("--count", "5", "--rate", "1000", "--signals", "tick,i_a_a,state")
        self.assertEqual(head.split(), ["tick", "time_s", "i_a_a", "[A]", "state"])
        ticks = [int(row.split()[0]) for row in rows]
        self.assertEqual(ticks, list(range(ticks[0], ticks[0] + 40, 8)))
        self.assertEqual([float(row.split()[1]) for row in rows], [tick / 8000 for tick in ticks])
        self.assertEqual(rows[-1].split()[3], "run")

    def test_watch_shows_a_short_move_in_lockstep(self):
        """Catches: a rate of ten samples in a second of the bench's time, in which a move of 0.128 s is over; a time that is
        no choice among the signals."""
        head, *rows = self.watch_a_move("--count", "100", "--signals", "time_s,speed_rad_s")
        self.assertEqual(head.split(), ["tick", "time_s", "speed_rad_s", "[rad/s]"])
        self.assertGreater(max(float(row.split()[2]) for row in rows), 10.0)
        self.assertEqual(len(rows), 100)

    def test_watch_prints_a_json_object_a_line(self):
        """Catches: a stream that cannot be read line by line."""
        rows = [json.loads(row) for row in self.watch_a_move("--json", "--count", "3", "--rate", "8000", "--axis", "servo")]
        self.assertEqual([row["tick"] for row in rows], list(range(rows[0]["tick"], rows[0]["tick"] + 3)))
        self.assertKeys(rows[0], "axis", "dropped", "state", "faults", "encoder_count", "angle_rad", "speed_rad_s")

    def test_watch_ends_well_when_interrupted(self):
        """Catches: ctrl-C that looks like a failure."""
        for number in (signal.SIGINT, signal.SIGTERM):
            watching = self.start(DRIVEBENCH, "watch", link=self.link)
            watching.stderr.readline()
            watching.send_signal(number)
            self.assertEqual(watching.wait(PATIENCE_S), OK)


if __name__ == "__main__":
    unittest.main(verbosity=2)
