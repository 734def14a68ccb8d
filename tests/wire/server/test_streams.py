#!/usr/bin/python3
"""The server's streams: subscriptions, the same state for the same commands, recordings, the end."""
import math
import os
import pathlib
import resource
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import BENCHES, PATIENCE_S, SERVER, Closed, frame, pb
from wire_test import TWO_AXES, WireTest, until


class Subscriptions(WireTest):
    def test_a_subscription_has_its_decimation_and_signals(self):
        """Catches: samples of the wrong ticks, signals that the client did not ask for, a subscription that cannot be
        ended."""
        server = self.server()
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        self.assertDone(viewer.ask(subscribe=pb.Subscribe(decimation=3, signals=["tick", "u_a_v"])))
        for tick in range(30):
            owner.step(tick, 5.0, 6.0)
        self.assertEqual(viewer.newest().tick, 30)
        samples = [s for message in viewer.samples for s in message.samples]
        self.assertEqual([s.tick for s in samples], list(range(3, 31, 3)))
        for s in samples:
            self.assertEqual({f.name for f, _ in s.ListFields()}, {"tick", "u_a_v"})
        self.assertEqual(sum(message.dropped for message in viewer.samples), 0)
        # A second request replaces the first, and 0 ends it.
        self.assertDone(viewer.ask(subscribe=pb.Subscribe(decimation=1)))
        owner.step(30, 5.0, 6.0)
        viewer.newest()
        self.assertEqual(viewer.samples[-1].samples[-1].tick, 31)
        self.assertEqual(viewer.samples[-1].samples[-1].u_b_v, 6.0)
        self.assertDone(viewer.ask(subscribe=pb.Subscribe(decimation=0)))
        count = len(viewer.samples)
        owner.step(31)
        viewer.newest()
        self.assertEqual(len(viewer.samples), count)

    def test_many_subscribers_have_every_sample(self):
        """Catches: a turn that never comes, a subscriber that is left out, an answer that overtakes the samples of its
        tick."""
        server = self.server()
        owner = self.client(server)
        viewers = [self.client(server) for _ in range(11)]
        owner.lease()
        for viewer in [*viewers, owner]:
            self.assertDone(viewer.ask(subscribe=pb.Subscribe(decimation=1, signals=["tick"])))
        viewers.pop(5).close()
        for tick in range(200):
            owner.step(tick, 5.0, 6.0)
            self.assertEqual(owner.samples[-1].samples[-1].tick, tick + 1)
        for viewer in viewers:
            ticks = []
            while len(ticks) < 200:
                samples = viewer.receive().samples
                self.assertEqual(samples.dropped, 0)
                ticks += [s.tick for s in samples.samples]
            self.assertEqual(ticks, list(range(1, 201)))

    def test_unknown_signal_changes_nothing(self):
        """Catches: a misspelt name that is silently left out, or a refusal that ends the running subscription."""
        server = self.server()
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        viewer.ask(subscribe=pb.Subscribe(decimation=1, signals=["tick"]))
        self.assertRefused(viewer.ask(subscribe=pb.Subscribe(decimation=1, signals=["tick", "speed"])),
                           pb.REFUSAL_UNKNOWN_SIGNAL, "signals")
        owner.step(0)
        viewer.newest()
        self.assertEqual(len(viewer.samples), 1)

    def test_limit_03_the_129th_decimation_is_refused(self):
        """Catches: memory for every decimation that somebody thinks of, a refusal that ends the running subscription."""
        server = self.server()
        owner = self.client(server)
        owner.lease()
        viewers = [self.client(server) for _ in range(128)]
        for n, viewer in enumerate(viewers):
            self.assertDone(viewer.ask(subscribe=pb.Subscribe(decimation=n + 2, signals=["tick"])))
        self.assertRefused(viewers[0].ask(subscribe=pb.Subscribe(decimation=1000)), pb.REFUSAL_BUSY, "decimation")
        for viewer in viewers[1:]:
            viewer.close()
        self.assertDone(owner.ask(subscribe=pb.Subscribe(decimation=1, signals=["tick"])))
        for tick in range(4):
            owner.step(tick)
        viewers[0].newest()
        self.assertEqual([s.tick for message in viewers[0].samples for s in message.samples], [2, 4])

    def test_tcp_10_limit_03_a_slow_reader_loses_samples_and_is_told_how_many(self):
        """Catches: a queue that grows for a slow client, or a loss that the client is not told."""
        server = self.server()
        owner = self.client(server)
        slow = self.client(server, receive_buffer=4096)
        owner.lease()
        slow.ask(subscribe=pb.Subscribe(decimation=1))
        seen, dropped, newest = 0, 0, 0

        def take():
            nonlocal seen, dropped, newest
            envelope = slow.receive()
            if envelope.WhichOneof("kind") == "samples":
                dropped += envelope.samples.dropped
                for sample in envelope.samples.samples:
                    self.assertEqual(sample.tick, seen + dropped + 1, "gaps add up")
                    seen += 1
                    newest = sample.tick

        # More than both socket buffers and the ring of 256 samples hold; the little that is read shows the server, which cuts a
        # reader after two seconds without progress, that there is some on a slow machine, too.
        for ticks in range(1, 2501):
            owner.step(ticks - 1, 1.0)
            if ticks % 200 == 0:
                for _ in range(20):
                    take()
        slow.send(status_request=pb.StatusRequest())
        while newest < ticks:
            take()
        self.assertEqual(seen + dropped, ticks)
        self.assertGreater(dropped, 0)

    def test_limit_03_the_newest_256_samples_wait_for_a_reader(self):
        """Catches: a ring of another size, and a count of losses that is one off."""
        server = self.server(unix=True)
        owner, slow = self.client(server), self.client(server, unix=True)
        owner.lease()
        slow.ask(subscribe=pb.Subscribe(decimation=1))
        ticks = 1000  # more than kernel and ring hold; a unix socket that is not read stops taking data
        for tick in range(ticks):
            owner.step(tick, 1.0)
        seen, gaps = [], []
        while not seen or seen[-1] < ticks:
            samples = slow.receive().samples
            if samples.dropped:
                gaps.append((len(seen), samples.dropped))
            seen += [sample.tick for sample in samples.samples]
        (before, dropped), = gaps
        self.assertEqual(seen[:before], list(range(1, before + 1)))
        self.assertEqual(seen[before:], list(range(ticks - 255, ticks + 1)))
        self.assertEqual(dropped, ticks - 256 - before)

    def test_tcp_10_tcp_11_limit_04_a_reader_that_stops_is_cut_and_the_others_go_on(self):
        """Catches: a dead viewer that is fed forever, or one that stops the bench; memory that grows with their number
        beyond the 16 MiB that wait for all of them together."""
        server = self.server(unix=True)
        owner, viewer = self.client(server), self.client(server)
        stopped = [self.client(server, receive_buffer=4096) for _ in range(25)]
        stopped += [self.client(server, unix=True) for _ in range(25)]  # no timeout of TCP helps there
        memory_kib = server.memory_kib()
        owner.lease()
        for client in stopped:
            client.ask(subscribe=pb.Subscribe(decimation=1))
        viewer.ask(subscribe=pb.Subscribe(decimation=1, signals=["tick"]))
        began = time.monotonic()
        for tick in range(3000):  # more than their sockets and queues hold
            owner.step(tick, 1.0)
            if tick % 100 == 0:
                viewer.newest()
        ended = time.monotonic()
        until(lambda: owner.status().sessions == 2, "the stopped readers are cut")
        self.assertLimitOf2s(began, ended)
        for client in stopped:
            self.assertTrue(client.is_closed())
        self.assertEqual(viewer.newest().tick, 3000)
        ticks = [s.tick for message in viewer.samples for s in message.samples]
        self.assertEqual(ticks, list(range(1, 3001)))
        self.assertMemoryBelow(server, memory_kib + 20 * 1024)

    def test_limit_04_a_reader_that_rests_for_a_second_stays(self):
        """Catches: a viewer that is cut because it rested for a second."""
        server = self.server()
        owner = self.client(server)
        owner.lease()
        tick, rest_s = 0, 2.0
        while rest_s > 1.8:  # of 2 s without progress; a busy machine may have kept the test away for longer than it wanted
            viewer = self.client(server, receive_buffer=4096)
            viewer.ask(subscribe=pb.Subscribe(decimation=1))
            for tick in range(tick, tick + 2000):
                owner.step(tick, 1.0)
                if tick % 200 == 199:  # too little to keep up, enough to rest no longer than below
                    for _ in range(20):
                        viewer.receive()
                    since = time.monotonic()
            tick += 1
            time.sleep(1.0)
            rest_s = time.monotonic() - since
            if rest_s > 1.8:
                viewer.close()
        self.assertEqual(viewer.newest().tick, tick)

        def lost():
            viewer.newest()
            return sum(message.dropped for message in viewer.samples)
        until(lambda: lost() > 0, "more than the queues hold was sent")

    def test_limit_03_a_reader_that_never_reads_its_answers_is_cut(self):
        """Catches: answers queued without bound for a client that only asks."""
        server = self.server()
        greedy, other = self.client(server, receive_buffer=4096), self.client(server)
        request = frame(pb.Envelope(id=1, read_parameters=pb.ReadParameters()).SerializeToString())
        greedy.socket.settimeout(PATIENCE_S)
        before = server.memory_kib()
        with self.assertRaises(OSError):
            for _ in range(100_000):
                greedy.send_bytes(request * 100)
        until(lambda: other.status().sessions == 1, "the session is gone")
        self.assertMemoryBelow(server, before + 16 * 1024)


class Determinism(WireTest):
    @staticmethod
    def script(tick):
        return 30.0 * math.cos(0.02 * tick), 30.0 * math.sin(0.02 * tick)

    def run_script(self, viewers=0, unix=False, ticks=2000, options=()):
        server = self.server(*options, unix=True)
        owner = self.client(server, unix=unix)
        watching = [self.client(server) for _ in range(viewers)]
        for n, viewer in enumerate(watching):
            viewer.ask(subscribe=pb.Subscribe(decimation=n + 1))
        stop = threading.Event()

        def read(viewer):
            while not stop.is_set():
                try:
                    viewer.status()
                except Closed:
                    return

        readers = [threading.Thread(target=read, args=(viewer,)) for viewer in watching]
        for reader in readers:
            reader.start()
        owner.lease()
        owner.step(0)
        owner.ask(set_load=pb.SetLoad(load_nm=0.05, at_tick=500, ramp_ticks=100))
        for tick in range(1, ticks):
            if tick == 1000:
                owner.ask(write_parameter=pb.WriteParameter(name="machine.rotor_resistance_ohm", value=5.0))
            owner.step(tick, *self.script(tick))
        status = owner.status()
        self.assertEqual(status.tick, ticks)
        stop.set()
        for reader in readers:
            reader.join()
        self.assertEqual(server.stop(), 0)
        return status.state_hash, server.verdict

    def test_det_01_the_same_commands_give_the_same_state(self):
        """Catches: viewers, their number, or the kind of socket that change the plant by a bit."""
        alone, verdict = self.run_script()
        again, _ = self.run_script()
        watched, _ = self.run_script(viewers=8)
        local, _ = self.run_script(unix=True)
        self.assertEqual(f"{alone:016x}", f"{again:016x}")
        self.assertEqual(f"{alone:016x}", f"{watched:016x}")
        self.assertEqual(f"{alone:016x}", f"{local:016x}")
        self.assertTrue(verdict["exact"])
        other, _ = self.run_script(ticks=1999)
        self.assertNotEqual(other, alone)


class Ending(WireTest):
    def replayed(self, file):
        done = subprocess.run([str(SERVER), "--replay", str(file), "--json"], capture_output=True, text=True,
                              timeout=PATIENCE_S, check=False)
        return done.returncode, done.stdout

    def test_rec_10_os_01_a_signal_ends_the_server_and_the_recording_replays(self):
        """Catches: a recording without its end; a server that outlives its signal, or waits for clients that do not
        read."""
        for mode in ("lockstep", "realtime", "free"):
            for number in (signal.SIGTERM, signal.SIGINT):
                with self.subTest(mode=mode, signal=number):
                    # The rule says 2 s. A busy host may be slow, for instance to sync the file: of three ends one
                    # keeps to the rule, and none takes longer than PATIENCE_S.
                    took = [self.end_of_a_run(mode, number)]
                    while len(took) < 3 and min(took) >= 2.0:
                        took.append(self.end_of_a_run(mode, number))
                    self.assertLess(min(took), 2.0, took)

    def end_of_a_run(self, mode, number):
        """The time that a run took to end by this signal; its recording must be whole."""
        file = self.server().folder / "run.mcap"
        server = self.server("--mode", mode, "--record", str(file))
        client, viewer, deaf = self.client(server), self.client(server), self.client(server, receive_buffer=4096)
        for each in (viewer, deaf):
            each.ask(subscribe=pb.Subscribe(decimation=1))
        if mode != "free":
            client.lease()
            for _ in range(200):
                client.exchange(client.newest().tick, 12.0, -3.0)
            client.ask(write_parameter=pb.WriteParameter(name="amplifier.gain", value=1.05))
            client.exchange(client.newest().tick, math.nan)
        deaf.send_bytes(100 * frame(pb.Envelope(id=1, read_parameters=pb.ReadParameters()).SerializeToString()))
        client.status()
        started = time.monotonic()
        self.assertEqual(server.stop(number), 0)
        took = time.monotonic() - started
        code, out = self.replayed(file)
        self.assertEqual(code, 0, out)
        self.assertIn(f'"state_hash":"{server.verdict["state_hash"]}"', out)
        return took

    def test_rec_03_rec_04_os_02_a_full_disk_costs_the_recording_and_nothing_else(self):
        """Catches: a bench that dies with its disk, or a torn recording that is called whole."""
        folder = self.server().folder
        file = folder / "cut.mcap"
        server = self.server("--record", str(file), before=lambda: resource.setrlimit(
            resource.RLIMIT_FSIZE, (300_000, 300_000)))
        client = self.client(server)
        client.lease()
        for tick in range(3000):
            client.step(tick, 12.0, -3.0)
        self.assertEqual(server.stop(), 1)
        self.assertGreater(server.verdict["gaps"], 0)
        self.assertFalse(server.verdict["exact"])
        self.assertEqual(self.replayed(file)[0], 3)

    def test_rec_07_a_recording_is_never_overwritten(self):
        """Catches: an older measurement that a newer one overwrites."""
        folder = self.server().folder
        (folder / "there.mcap").write_text("precious", encoding="utf-8")
        done = subprocess.run([str(SERVER), str(BENCHES / "servo.toml"), "--port", "0", "--record",
                               str(folder / "there.mcap")], capture_output=True, text=True, timeout=PATIENCE_S,
                              check=False)
        self.assertEqual(done.returncode, 2)
        self.assertIn("there.mcap", done.stderr)
        self.assertEqual((folder / "there.mcap").read_text(encoding="utf-8"), "precious")

    def test_cfg_01_a_bad_bench_file_ends_the_server_before_a_socket_opens(self):
        """Catches: a bench that serves although its file is wrong."""
        folder = self.server().folder
        bad = folder / "bad.toml"
        bad.write_text(TWO_AXES.replace("watchdog_ticks", "watchdog_tick"), encoding="utf-8")
        socket_path = folder / "never.sock"
        trace = folder / "trace"
        command = [str(SERVER), str(bad), "--port", "0", "--unix", str(socket_path), "--record",
                   str(folder / "never.mcap")]
        strace = pathlib.Path("/usr/bin/strace")
        if strace.exists():
            command = [str(strace), "-f", "-e", "trace=network", "-o", str(trace), *command]
        without_leak_check = {**os.environ, "ASAN_OPTIONS": "detect_leaks=0"}  # the leak check fails under strace
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
                              env=without_leak_check)
        self.assertEqual(done.returncode, 2)
        self.assertIn("bad.toml:", done.stderr)
        self.assertIn("watchdog_ticks", done.stderr, "the nearest valid key")
        self.assertEqual(done.stdout, "")
        self.assertFalse(socket_path.exists() or (folder / "never.mcap").exists())
        if trace.exists():
            self.assertNotIn("socket(", trace.read_text(encoding="utf-8"))

    def test_os_13_a_port_in_use_ends_the_start(self):
        """Catches: a second server that seems to run and serves no client."""
        server = self.server()
        done = subprocess.run([str(SERVER), str(BENCHES / "servo.toml"), "--port", str(server.address[1])],
                              capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, 2)
        self.assertIn(str(server.address[1]), done.stderr)

    def test_tcp_16_limit_02_sessions_beyond_the_cap_are_turned_away_with_a_reason(self):
        """Catches: one client that takes all descriptors from the others."""
        text = TWO_AXES.replace("[tcp]", "[tcp]\nmax_sessions = 3")
        server = self.server(text=text)
        inside = [self.client(server) for _ in range(3)]
        outside = self.client(server, hello=False)
        self.assertRefused(outside.receive(), pb.REFUSAL_BUSY)
        self.assertTrue(outside.is_closed())
        self.assertEqual(inside[0].status().sessions, 3)
        inside[2].close()

        def one_more():
            try:
                return self.client(server).welcome is not None
            except (Closed, AssertionError, ConnectionError):
                return False
        until(one_more, "room for another")

    def test_tcp_15_os_02_sigpipe_does_not_end_the_server(self):
        """Catches: a client that closes while samples are on their way."""
        server = self.server()
        owner = self.client(server)
        owner.lease()
        tick = 0
        for _ in range(20):
            gone = self.client(server)
            gone.ask(subscribe=pb.Subscribe(decimation=1))
            gone.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            gone.close()
            for _ in range(20):
                owner.step(tick)
                tick += 1
        until(lambda: owner.status().sessions == 1, "all sessions are gone")

    def test_sec_01_the_server_listens_on_loopback_only(self):
        """Catches: a bench that the whole network can drive."""
        self.assertEqual(self.server().address[0], "127.0.0.1")


if __name__ == "__main__":
    unittest.main(verbosity=2)
