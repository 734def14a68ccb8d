#!/usr/bin/python3
"""A host that fails the server: memory, disks, threads, clocks, arithmetic."""
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from itertools import pairwise
from unittest import mock

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

from misfortune import Misfortune, signal_thread, thread_of  # also adds the folders of the next imports
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from experiment_test import ExperimentTest, request
from recording import Recording
from wire_client import BENCHES, PATIENCE_S, SERVER, Closed, frame, pb
from wire_test import PATIENT_TEXT, SERVO_TEXT, WireTest, until

# A silent controller keeps its axis for so long that only the event under test takes it away.
FLUSH_DENORMALS = 0x9FC0  # -Ofast sets them, for the whole process
TIMEOUT, OVERRUN = 1 << 9, 1 << 11  # in the fault word
RUN, HOLD = 1, 2  # states in which an axis is driven
MIB = 1 << 20
FAKETIME = next(pathlib.Path("/usr/lib").glob("*/faketime/libfaketime.so.1"), None)


class HostTest(WireTest):
    def folder(self):
        folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-host-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        return folder

    def unlucky_server(self, misfortune, *options, guard=True, **more):
        """A server that the library is preloaded into, beside the guard of its ticks."""
        environment = misfortune.environment() if guard else {**misfortune.environment(), "DRIVEBENCH_GUARD": ""}
        with mock.patch.dict(os.environ, environment):
            return self.server(*options, before=lambda: resource.setrlimit(resource.RLIMIT_CORE, (0, 0)), **more)


@unittest.skipUnless(os.environ.get("DRIVEBENCH_GUARD"), "no guard is given")
class Guarded(HostTest):
    def test_rt_01_the_guard_is_in_servers_with_another_library_too(self):
        """Catches: a library that takes the guard's place, so that ticks in these servers are not guarded."""
        self.assertGuarded(lambda: self.unlucky_server(Misfortune()))
        if FAKETIME is not None:
            with mock.patch.dict(os.environ, {"LD_PRELOAD": str(FAKETIME)}):
                self.assertGuarded(self.server)

    def assertGuarded(self, start):
        with mock.patch.dict(os.environ, {"DRIVEBENCH_MISDEED": "1"}):
            server = start()
        owner = self.client(server)
        self.assertDone(owner.lease())
        with self.assertRaises((Closed, ConnectionError)):
            owner.step(0, 1.0)
        self.assertEqual(server.process.wait(timeout=PATIENCE_S), -signal.SIGABRT)
        self.assertRegex(server.errors(), "tick guard: .* in a tick")


class Memory(HostTest):
    """Without the guard: these tests fail the library's malloc(), and in a program with both malloc() is the guard's."""

    def run_of(self, misfortune):
        with tempfile.TemporaryDirectory(prefix="drivebench-host-") as folder:
            return subprocess.run(
                [SERVER, BENCHES / "servo.toml", "--port", "0", "--mode", "free", "--duration", "0.01", "--record",
                 f"{folder}/run.mcap"], capture_output=True, text=True, env=misfortune.environment(), timeout=PATIENCE_S, check=False)

    def test_os_10_no_memory_at_the_start_is_a_clean_error(self):
        """Catches: a start that crashes, hangs, or goes on without its memory."""
        good = Misfortune()
        self.assertEqual(self.run_of(good).returncode, 0)
        self.assertGreater(good.allocations, 1000)
        failed = 0
        for number in range(40):
            at = 1 + number * good.allocations // 40
            done = self.run_of(Misfortune(fail_in=at))
            self.assertIn(done.returncode, (0, 1, 2), f"allocation {at}: {done.stderr[-300:]}")
            if done.returncode != 0:
                self.assertTrue(done.stderr.strip(), f"allocation {at}: says nothing")
                failed += 1
        self.assertGreater(failed, 20)

    def test_os_10_no_memory_in_a_run_is_reported_and_the_recording_is_kept(self):
        """Catches: a crash at another place, or a program that goes on with half a message."""
        for at in (1, 2, 5, 20):
            misfortune = Misfortune()
            file = self.folder() / "run.mcap"
            server = self.unlucky_server(misfortune, "--record", str(file), guard=False)
            client = self.client(server)
            client.lease()
            for tick in range(900):  # 100 ms are written
                client.step(tick, 1.0)
            until(lambda: Recording(file.read_bytes()).messages.get("/servo/sample", 0) >= 800, "the recorder has written them")
            misfortune.fail_in = at
            try:
                for _ in range(30):
                    client.ask(read_parameters=pb.ReadParameters())
            except (Closed, ConnectionError):
                pass
            self.assertEqual(server.process.wait(timeout=PATIENCE_S), 1, server.errors())
            self.assertIn("no memory", server.errors())
            self.assertGreaterEqual(Recording(file.read_bytes()).messages["/servo/sample"], 800)


class Disks(HostTest, ExperimentTest):
    def test_rec_05_an_experiment_whose_sync_failed_has_failed(self):
        """Catches: an experiment that counts as complete although a power cut would lose its rows."""
        misfortune = Misfortune()
        client = self.client(self.unlucky_server(misfortune, "--experiments", self.kept.name))
        self.assertEqual(self.whole(client, request(100)).info.state, pb.EXPERIMENT_STATE_COMPLETED)
        misfortune.syncs_fail = 1
        ended = self.whole(client, request(100)).info
        self.assertEqual((ended.state, ended.reason), (pb.EXPERIMENT_STATE_FAILED, "the disk takes no more data"))


class Stops(HostTest):
    PERIOD_S = 128e-6  # an edge of the histogram of latenesses, which then separates late ticks from others

    def is_in_time(self, client):
        """Whether ticks between two questions were not late, by the bench's own count."""
        before, after = client.newest(), client.newest()
        return after.late_ticks - before.late_ticks < after.tick - before.tick - 2

    def test_os_03_after_a_stop_every_late_tick_is_counted_and_executed(self):
        """Catches: ticks that are skipped, not counted, or executed as if in time, after a stop of the process."""
        text = SERVO_TEXT.replace("period_us = 125", "period_us = 128")
        patient = self.server("--mode", "realtime", text=text + "\n[realtime]\nmax_lateness_ms = 60000\n")
        strict = self.server("--mode", "realtime", text=text, strict=True)  # 100 ms
        clients = [self.client(server) for server in (patient, strict)]
        until(lambda: self.is_in_time(clients[0]), "it has begun")
        first = [client.newest().tick for client in clients]
        since = time.monotonic()
        stops = (0.1, 1.0, 10.0)
        late = [[client.newest().late_ticks for client in clients]]
        for stop_s in stops:
            for server in (patient, strict):
                server.process.send_signal(signal.SIGSTOP)
            time.sleep(stop_s)
            for server in (patient, strict):
                server.process.send_signal(signal.SIGCONT)
            until(lambda: self.is_in_time(clients[0]), "it has caught up")
            late.append([client.newest().late_ticks for client in clients])
            # Of the ticks of a stop all but the last are late by a period or more; a few may pass before it begins.
            self.assertGreaterEqual(late[-1][0] - late[-2][0], int(stop_s / self.PERIOD_S) - 8)
        self.assertFalse(clients[0].newest().faults & OVERRUN, "that late was allowed")
        self.assertTrue(clients[1].newest().faults & OVERRUN)
        lost = sum(stop_s for stop_s in stops if stop_s >= 1.0)
        # The tick of `first` may have been late itself: hence a second stop.
        self.assertLess(clients[1].newest().tick, first[1] + (time.monotonic() - since - lost + 1.0) / self.PERIOD_S,
                        "the late ticks are given up")
        for server in (patient, strict):
            self.assertEqual(server.stop(), 0)
            verdict = server.verdict
            self.assertFalse(verdict["realtime_valid"])
            self.assertEqual(sum(count for _, count in verdict["lateness_histogram"]), verdict["ticks"])
            late_by_the_clock = sum(count for edge_us, count in verdict["lateness_histogram"] if edge_us > self.PERIOD_S * 1e6 * 1.5)
            self.assertEqual(late_by_the_clock, verdict["late_ticks"])


class Threads(HostTest):
    def test_os_12_a_bench_that_stands_still_ends_the_program(self):
        """Catches: a bench that answers, and shows the same sample forever."""
        misfortune = Misfortune(sleep_ms=60_000)
        # Without the guard, which ends a tick that sleeps: this tick may be stopped in the middle.
        server = self.unlucky_server(misfortune, "--mode", "realtime", guard=False)
        self.client(server).status()
        signal_thread(server.process.pid, thread_of(server.process.pid, "ticks"), signal.SIGUSR2)
        self.assertEqual(server.process.wait(timeout=PATIENCE_S), -signal.SIGABRT)
        self.assertIn("no tick for a second", server.errors())

    def test_os_12_a_server_without_its_io_thread_gives_its_axes_up(self):
        """Catches: a motor that runs on while no client can stop it."""
        misfortune = Misfortune(sleep_ms=6000)
        server = self.unlucky_server(misfortune, "--mode", "realtime", text=PATIENT_TEXT)
        owner = self.client(server)
        owner.lease()
        owner.exchange(owner.newest().tick, 5.0)
        self.assertNotEqual(owner.newest().owner, 0)
        signal_thread(server.process.pid, server.process.pid, signal.SIGUSR2)
        until(lambda: "the I/O thread stands still" in server.errors(), "it is logged")
        until(lambda: owner.newest().owner == 0, "its axis has no owner")
        sample = owner.newest()
        self.assertEqual((sample.u_a_v, sample.u_b_v), (0.0, 0.0))
        self.assertRefused(owner.exchange(sample.tick, 5.0), pb.REFUSAL_NOT_OWNER)
        until(lambda: "goes on" in server.errors(), "the end of it is logged")
        self.assertEqual(server.stop(), 0)

    def test_os_01_a_second_signal_ends_at_once(self):
        """Catches: a server that only SIGKILL ends while the thread that should end it stands still; or that the first
        signal kills."""
        for first, second in ((signal.SIGTERM, signal.SIGTERM), (signal.SIGINT, signal.SIGTERM), (signal.SIGTERM, signal.SIGINT)):
            with self.subTest(first=first, second=second):
                server = self.unlucky_server(Misfortune(sleep_ms=600_000), "--mode", "realtime")
                self.client(server).status()
                signal_thread(server.process.pid, server.process.pid, signal.SIGUSR2)
                until(lambda server=server: "the I/O thread stands still" in server.errors(), "it stands still")
                server.process.send_signal(first)
                with self.assertRaises(subprocess.TimeoutExpired):
                    server.process.wait(timeout=1.0)
                server.process.send_signal(second)
                self.assertEqual(server.process.wait(timeout=10.0), -second)

    def test_os_01_the_first_signal_ends_in_order(self):
        """Catches: a signal that is lost because no thread waits for it yet, or that costs the end of the recording; one
        order that comes as two signals, from `timeout` or a shell, and kills."""
        file = self.folder() / "run.mcap"
        server = self.unlucky_server(Misfortune(sleep_ms=6000), "--mode", "realtime", "--record", str(file))
        self.client(server).status()
        signal_thread(server.process.pid, server.process.pid, signal.SIGUSR2)
        until(lambda: "the I/O thread stands still" in server.errors(), "it stands still")
        server.process.send_signal(signal.SIGINT)
        time.sleep(0.01)  # the server has read the signal
        self.assertEqual(server.stop(), 0)
        self.assertEqual(server.verdict["gaps"], 0)
        self.assertTrue(Recording(file.read_bytes()).finished)

    def test_os_12_a_paused_host_or_a_slow_controller_is_no_standstill(self):
        """Catches: a supervisor that ends a bench because its host slept, or because lockstep waits for a command."""
        paused, waiting = self.server("--mode", "realtime"), self.server()
        owner = self.client(waiting)
        owner.lease()
        paused.process.send_signal(signal.SIGSTOP)
        time.sleep(1.5)
        paused.process.send_signal(signal.SIGCONT)
        first = self.client(paused).newest().tick
        until(lambda: self.client(paused).newest().tick > first + 2000, "the bench goes on")
        owner.step(0, 1.0)
        for server in (paused, waiting):
            self.assertNotIn("stands still", server.errors())
            self.assertEqual(server.stop(), 0)

    def test_rec_06_a_recorder_that_stands_still_for_a_second_loses_nothing(self):
        """Catches: a ring that is too small for the server's own bench, or a tick that waits for the disk."""
        misfortune = Misfortune(sleep_ms=1200)
        file = self.folder() / "run.mcap"
        server = self.unlucky_server(misfortune, "--mode", "realtime", "--record", str(file))
        client = self.client(server)
        signal_thread(server.process.pid, thread_of(server.process.pid, "recorder"), signal.SIGUSR2)
        first = client.newest().tick
        until(lambda: client.newest().tick > first + 12_000, "ticks go on meanwhile")
        self.assertEqual(server.stop(), 0)
        self.assertEqual(server.verdict["gaps"], 0)
        done = subprocess.run([SERVER, "--replay", file], capture_output=True, timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, 0, done.stdout)


class Arithmetic(HostTest):
    def hash_of_a_run(self, misfortune):
        server = self.unlucky_server(misfortune)
        owner = self.client(server)
        owner.lease()
        for tick in range(300):
            owner.step(tick, 1e-300 if tick < 200 else 3.0)
        return f"{owner.status().state_hash:016x}", server.errors()

    def test_det_03_a_library_that_changed_the_rounding_changes_no_bit(self):
        """Catches: results that depend on which libraries were loaded."""
        reference, said = self.hash_of_a_run(Misfortune())
        self.assertNotIn("rounds", said)
        changed, said = self.hash_of_a_run(Misfortune(mxcsr_at_start=FLUSH_DENORMALS))
        self.assertEqual(changed, reference)
        self.assertIn("how this program rounds", said)

    def test_det_03_a_change_in_the_run_is_undone_and_reported(self):
        """Catches: half a run with other bits and no message."""
        misfortune = Misfortune(mxcsr=FLUSH_DENORMALS)
        server = self.unlucky_server(misfortune, "--mode", "realtime")
        self.client(server).status()
        for count in (1, 2):
            signal_thread(server.process.pid, thread_of(server.process.pid, "ticks"), signal.SIGUSR1)
            until(lambda count=count: server.errors().count("the bits of this run are in doubt") == count, "it is found and said")


class Clock(HostTest):
    # With ticks of 5 ms, so that a Python program on a busy host keeps its axis for a while.
    TEXT = (SERVO_TEXT.replace("period_us = 125", "period_us = 5000").replace("substeps = 5", "substeps = 64")
            + "\n[realtime]\nmax_lateness_ms = 60000\n")
    WATCHDOG_TICKS, LEASE_TICKS = 20, 400

    def drive_on(self, owner, ticks):
        """Commands for so many ticks and until the axis is driven, through any pauses of this host."""
        first, end = owner.newest().tick, time.monotonic() + PATIENCE_S
        while (sample := owner.newest()).tick < first + ticks or sample.state not in (RUN, HOLD):
            self.assertLess(time.monotonic(), end, "never driven")
            if sample.owner == 0:
                owner.lease()
            if sample.faults & TIMEOUT:
                owner.ask(clear_faults=pb.ClearFaults())
            owner.exchange(sample.tick, 5.0)

    def test_os_04_a_wall_clock_that_jumps_moves_nothing(self):
        """Catches: a time-out, a lease, a time limit of a session, or a tick that follows the time of day."""
        if FAKETIME is None:
            self.skipTest("faketime is not installed")
        folder = self.folder()
        offset, file = folder / "offset", folder / "run.mcap"
        offset.write_text("+0", encoding="utf-8")
        fake = {"LD_PRELOAD": str(FAKETIME), "FAKETIME_DONT_FAKE_MONOTONIC": "1", "FAKETIME_NO_CACHE": "1",
                "FAKETIME_TIMESTAMP_FILE": str(offset)}
        with mock.patch.dict(os.environ, fake):
            server = self.server("--mode", "realtime", "--record", str(file), text=self.TEXT)
        owner, jumps = self.client(server), ("-1h", "+1h", "+10y", "-1s", "+1s")
        for jump in jumps:
            self.drive_on(owner, 20)
            stranger = self.client(server, hello=False)
            (folder / "next").write_text(jump, encoding="utf-8")
            (folder / "next").replace(offset)
            # From here on the owner is silent.
            until(lambda: owner.newest().faults & TIMEOUT, f"{jump}: the watchdog acts")
            until(lambda: owner.newest().owner == 0, f"{jump}: the lease ends")
            self.assertTrue(stranger.is_closed(), jump)
        self.assertEqual(server.stop(), 0)
        self.assertEqual(server.verdict["gaps"], 0)
        self.assert_every_silence_ended_in_its_tick(Recording(file.read_bytes()), len(jumps))
        done = subprocess.run([SERVER, "--replay", file], capture_output=True, timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, 0, done.stdout)

    def assert_every_silence_ended_in_its_tick(self, recording, at_least):
        """By the recording: sample k+1 shows tick k. Late ticks do not count for the watchdog."""
        samples = [pb.Sample.FromString(content) for content in recording.contents["/servo/sample"]]
        inputs = [pb.Input.FromString(content) for content in recording.contents["/inputs"]]
        commands = [each.tick for each in inputs if each.WhichOneof("action") == "command"]
        renewals = commands + [each.tick for each in inputs if each.WhichOneof("action") == "lease"]
        late = {each.tick for each in inputs if each.WhichOneof("action") == "late_tick"}
        timeouts = [now.tick - 1 for before, now in pairwise(samples) if now.faults & ~before.faults & TIMEOUT]
        ends = [now.tick - 1 for before, now in pairwise(samples) if before.owner != 0 and now.owner == 0]
        self.assertGreaterEqual(min(len(timeouts), len(ends)), at_least)
        for tick in timeouts:
            last = max(each for each in commands if each < tick)
            self.assertEqual(len(set(range(last + 1, tick + 1)) - late), self.WATCHDOG_TICKS, f"time-out in tick {tick}")
        for tick in ends:
            self.assertEqual(tick - max(each for each in renewals if each < tick), self.LEASE_TICKS, f"end of the lease in tick {tick}")


class House(HostTest):
    def test_os_11_all_sessions_together_stay_below_64_mib(self):
        """Catches: memory that grows with clients which do not read, or with the length of a recording."""
        server = self.server("--mode", "realtime", "--record", str(self.folder() / "run.mcap"))
        guests = [self.client(server, receive_buffer=4096) for _ in range(150)]
        for guest in guests[:16]:
            guest.send(subscribe=pb.Subscribe(decimation=1))
        first = guests[-1].newest().tick
        until(lambda: guests[-1].newest().tick > first + 12_000, "a second and a half of samples for readers that never read")
        self.assertMemoryBelow(server, 64 * 1024)
        self.assertEqual(server.stop(), 0)

    def test_os_11_clients_that_ask_and_never_read_stay_below_64_mib(self):
        """Catches: waiting answers of 1 MiB for each of 256 sessions, as for a single one; or other clients that suffer
        for it."""
        server = self.server()
        here, greedy = self.client(server), [self.client(server, receive_buffer=4096) for _ in range(255)]
        # So much for each that it stays below the bound of one session: it is cut for the sum of all, or for 2 s
        # without progress.
        answer = len(frame(here.ask(read_parameters=pb.ReadParameters()).SerializeToString()))
        count = (MIB - MIB // 8) // answer
        self.assertGreater(255 * (count * answer - MIB // 4), 2 * 64 * MIB, "more than their sockets take")
        request = frame(pb.Envelope(id=1, read_parameters=pb.ReadParameters()).SerializeToString())
        for each in greedy:
            each.send_bytes(request * count)
        until(lambda: here.status().sessions == 1, "the sessions that do not read are gone")
        self.assertMemoryBelow(server, 64 * 1024)
        self.assertEqual(server.stop(), 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
