#!/usr/bin/python3
"""Abuse of the network: tests/adversity/FAULTS.md."""
import concurrent.futures
import os
import pathlib
import random
import re
import resource
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from experiment_test import request
from wire_client import BENCHES, PATIENCE_S, REPOSITORY, SERVER, Closed, frame, pb
from wire_test import SERVO_TEXT, WireTest, until

PROBES = pathlib.Path("/usr/share/nmap/nmap-service-probes")


def varint(number):
    out = b""
    while number > 0x7F:
        out, number = out + bytes([number & 0x7F | 0x80]), number >> 7
    return out + bytes([number])


def field(number, content):
    return varint(number << 3 | 2) + varint(len(content)) + content


def number_of(kind):
    return pb.Envelope.DESCRIPTOR.fields_by_name[kind].number


class Messages(WireTest):
    def test_tcp_05_thousands_of_empty_parts_cost_their_session_only(self):
        """Catches: two bytes on the wire that become hundreds in memory, and stay there."""
        server = self.server()
        owner, abuser = self.client(server), self.client(server)
        owner.lease()
        owner.step(0)
        parts = 32_000
        before = server.memory_kib()
        for n in range(30):
            kind = ("exchange", "read_parameters", "subscribe")[n % 3]
            inner = {"exchange": field(1, b""), "read_parameters": field(2, b""), "subscribe": field(3, b"")}[kind] * parts
            abuser.send_bytes(frame(b"\x08\x07" + field(number_of(kind), inner)))
            self.assertEqual(abuser.answer_to(7).WhichOneof("kind"), "refusal", kind)
        owner.step(1)
        self.assertMemoryBelow(server, before + 8 * 1024)

    def test_tcp_05_long_names_are_cut_between_characters(self):
        """Catches: a character that is cut in two, so that its answer cannot be decoded. The same for a file whose name
        is not UTF-8."""
        with tempfile.TemporaryDirectory(prefix="drivebench-abuse-") as folder:
            server = self.server("--experiments", f"{folder}/kept", "--record", f"{folder}/r\udcff.mcap")
            client = self.client(server)
            client.lease()
            for name in ("x" + "ä" * 1000, "ä" * 1000):
                named = [pb.NamedValue(name=name)]
                for kind in ({"subscribe": pb.Subscribe(signals=[name])},
                             {"read_parameters": pb.ReadParameters(names=[name])},
                             {"write_parameter": pb.WriteParameter(name=name)},
                             {"inject_fault": pb.InjectFault(name=name)},
                             {"run_experiment": request(signals=[name])},
                             {"run_experiment": request(settings=named)},
                             {"run_experiment": request(events=[pb.ExperimentEvent(fault=named[0])])}):
                    self.assertRegex(client.ask(**kind).refusal.message, r"^there is no \w+ 'x?ä+\.\.\.'$")
            self.assertEqual(client.status().recording, f"{folder}/r?.mcap")

    def test_tcp_06_nesting_without_end_is_refused(self):
        """Catches: a parser that recurses as deep as a client wants."""
        server = self.server()
        opening, closing = varint(2000 << 3 | 3), varint(2000 << 3 | 4)  # an unknown group
        request = pb.Envelope(id=4, status_request=pb.StatusRequest()).SerializeToString()
        client = self.client(server)
        client.send_bytes(frame(request + opening * 16 + closing * 16))
        self.assertEqual(client.answer_to(4).WhichOneof("kind"), "status")
        for depth in (17, 99, 1000, 16_000):
            client = self.client(server)
            client.send_bytes(frame(request + opening * depth + closing * depth))
            self.assertRefused(client.receive(), pb.REFUSAL_MALFORMED)
            self.assertTrue(client.is_closed())
        self.assertEqual(self.client(server).status().sessions, 2)  # the first session lives


class Readers(WireTest):
    @staticmethod
    def read_until(client, tick, seen):
        """Takes samples up to this tick; seen and lost ones must add up."""
        while seen["newest"] < tick:
            envelope = client.receive()
            if envelope.WhichOneof("kind") != "samples":
                continue
            seen["lost"] += envelope.samples.dropped
            for sample in envelope.samples.samples:
                seen["count"] += 1
                seen["newest"] = sample.tick
                if seen["count"] + seen["lost"] != sample.tick:
                    raise AssertionError(f"gaps do not add up at tick {sample.tick}: {seen}")

    def rest_in_turns(self, owner, readers, seen, tick, seed):
        """More and more readers rest, in any order, and all catch up at the end; returns the next tick. No reader rests
        for much longer than 1 s, on a slow machine either, as the server cuts after 2 s."""
        local, resting = random.Random(seed), set()
        read_at = [time.monotonic()] * len(readers)

        def catch_up(n):
            self.read_until(readers[n], tick, seen[n])
            read_at[n] = time.monotonic()
        crowd = concurrent.futures.ThreadPoolExecutor(len(readers))
        self.addCleanup(crowd.shutdown)
        for _ in range(6):
            resting = set(local.sample(range(8), len(resting) + 2 if len(resting) < 6 else 1))
            for _ in range(600):
                owner.step(tick, 1.0)
                tick += 1
                if tick % 50 == 0:
                    now = time.monotonic()
                    list(crowd.map(catch_up, [n for n in range(8) if n not in resting or now > read_at[n] + 1.0]))
        for reader in readers:
            reader.send(status_request=pb.StatusRequest())
        list(crowd.map(catch_up, range(8)))
        self.assertEqual({each["count"] + each["lost"] for each in seen}, {tick})
        return tick

    def test_tcp_12_tcp_20_readers_that_rest_catch_up_and_learn_of_their_gaps(self):
        """Catches: a gap that is reported twice or never; a reader that stays behind forever; one that delays the others,
        or for which the server stores more and more."""
        server = self.server(unix=True)
        owner = self.client(server)
        owner.lease()
        # A unix socket buffers so little that a short rest costs samples.
        readers = [self.client(server, receive_buffer=16384) for _ in range(4)] + [self.client(server, unix=True) for _ in range(4)]
        seen = [{"count": 0, "lost": 0, "newest": 0} for _ in readers]
        for reader in readers:
            reader.ask(subscribe=pb.Subscribe(decimation=1))
        tick = self.rest_in_turns(owner, readers, seen, 0, seed=7)
        resident_kib = server.memory_kib("VmRSS")  # with queues as large as they get
        # A busy machine makes few ticks in a rest: more rests.
        for seed in range(8, 20):
            tick = self.rest_in_turns(owner, readers, seen, tick, seed)
            if sum(each["lost"] for each in seen) > 500:
                break
        self.assertEqual(owner.status().sessions, 9)
        self.assertGreater(sum(each["lost"] for each in seen), 500, "the readers rested for long enough")
        self.assertMemoryBelow(server, resident_kib + 1024, "VmRSS")


class Connections(WireTest):
    def descriptors(self, server):
        return len(os.listdir(f"/proc/{server.process.pid}/fd"))

    def test_tcp_13_limit_02_slow_connections_without_hello_are_few_and_closed(self):
        """Catches: slow connections that take the places of all others, so that no client gets in; a place too few or too
        many; a time limit that begins anew with each byte."""
        server = self.server()
        inside = self.client(server)
        since = time.monotonic()
        drops = iter(struct.pack(">I", 4000) + bytes(4000))

        def drip(strangers):
            drop = bytes([next(drops)])
            for stranger in strangers:
                try:
                    stranger.send_bytes(drop)
                except OSError:  # it is closed
                    pass
        strangers = [self.client(server, hello=False) for _ in range(32)]
        drip(strangers)
        until(lambda: inside.status().sessions == 33, "all are accepted")
        self.assertEqual(inside.tcp_counts()["turned_away"], 0)
        strangers.append(self.client(server, hello=False))
        entering = self.client(server)
        self.assertEqual(entering.status().sessions, 33)
        for displaced in (strangers[0], strangers[32]):  # the oldest, and then the one that has sent no byte
            self.assertRefused(displaced.receive(), pb.REFUSAL_BUSY, "session")
            self.assertTrue(displaced.is_closed())
        connected = time.monotonic()
        while inside.status().sessions > 2 and time.monotonic() < connected + PATIENCE_S:
            drip(strangers[1:32])
            time.sleep(0.1)
        self.assertLimitOf2s(since, connected)
        for stranger in strangers:
            self.assertTrue(stranger.is_closed())
        counts = entering.tcp_counts()
        self.assertEqual((counts["turned_away"], counts["cut"]), (2, 31))

    def test_tcp_16_limit_02_exactly_the_allowed_sessions_are_open(self):
        """Catches: a cap that is one too low or too high."""
        server = self.server()
        inside = [self.client(server) for _ in range(256)]
        self.assertEqual(inside[255].status().sessions, 256)
        self.assertRefused(self.client(server, hello=False).receive(), pb.REFUSAL_BUSY, "session")
        self.assertEqual(inside[0].status().sessions, 256)

    def test_tcp_17_coming_and_going_leaves_nothing_behind(self):
        """Catches: a descriptor that is lost with each client."""
        server = self.server()
        inside = self.client(server)
        inside.status()
        before = self.descriptors(server)
        for n in range(600):
            guest = server.raw()
            if n % 3 == 0:
                guest.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            elif n % 3 == 1:
                guest.send(b"\0\0")
            guest.close()
        until(lambda: inside.status().sessions == 1, "all connections are gone")
        self.assertEqual(self.descriptors(server), before)

    @staticmethod
    def cpu_s(server):
        fields = pathlib.Path(f"/proc/{server.process.pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def test_tcp_17_tcp_18_without_descriptors_open_sessions_go_on(self):
        """Catches: a server that ends, spins, fills its log or loses its recording when it may open no more files."""
        server, folder = self.recording_server(resource.RLIMIT_NOFILE, 64)
        owner = self.client(server)
        owner.lease()
        crowd = []
        while self.descriptors(server) < 64:
            crowd.append(self.client(server))
        waiting = [server.raw() for _ in range(20)]
        until(lambda: "cannot accept" in server.errors(), "the server has no descriptor left")
        started, used_s = time.monotonic(), self.cpu_s(server)
        time.sleep(1.0)  # without other work
        self.assertLess(self.cpu_s(server) - used_s, 0.5)
        for tick in range(500):
            owner.step(tick, 1.0)
        self.assertLessEqual(server.errors().count("cannot accept"), 1 + (time.monotonic() - started) / 10)
        for each in crowd + waiting:
            each.close()

        def served():
            try:
                return self.client(server).welcome is not None
            except (Closed, AssertionError, OSError):
                return False
        until(served, "a descriptor is free again")
        self.assertEqual(server.stop(), 0)
        self.assertEqual(server.verdict["gaps"], 0)

    def test_tcp_22_own_05_an_old_session_commands_no_more(self):
        """Catches: a controller whose connection hangs, comes back, and drives beside its successor."""
        server = self.server("--mode", "realtime", text=SERVO_TEXT.replace("lease_s = 2.0", "lease_ticks = 400"))
        old = self.client(server)
        self.assertDone(old.lease())
        old.exchange(old.newest().tick, 1.0)
        new = self.client(server)  # by the same name
        until(lambda: new.lease().WhichOneof("kind") == "done", "the lease of the silent session ends")
        self.assertNotEqual(new.owner, old.owner)
        self.assertRefused(old.exchange(old.newest().tick, 5.0), pb.REFUSAL_NOT_OWNER)
        self.assertRefused(old.lease(pb.LeaseRequest.ACTION_RENEW), pb.REFUSAL_NOT_OWNER)
        self.assertRefused(old.ask(clear_faults=pb.ClearFaults()), pb.REFUSAL_NOT_OWNER)

    def test_own_01_of_two_simultaneous_requests_one_gets_the_axis(self):
        """Catches: two owners, or none, when the requests of two clients are under way at the same time. (LeaseRace sends
        them from several threads.)"""
        for mode, races in (("lockstep", 300), ("realtime", 60)):
            server = self.server("--mode", mode)
            both = [self.client(server), self.client(server)]
            for n in range(races):
                order = both if n % 2 else both[::-1]
                ids = [each.send(lease=pb.LeaseRequest(action=pb.LeaseRequest.ACTION_ACQUIRE)) for each in order]
                kinds = [each.answer_to(i).WhichOneof("kind") for each, i in zip(order, ids)]
                self.assertEqual(sorted(kinds), ["done", "refusal"])
                self.assertDone(order[kinds.index("done")].lease(pb.LeaseRequest.ACTION_RELEASE))

    @staticmethod
    def probes():
        """The probes that nmap sends to find out the service behind a port. (nmap would wait between them for a
        minute.)"""
        names = {"0": "\0", "a": "\a", "b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t", "v": "\v"}

        def meant(escape):
            word = escape[1]
            return chr(int(word[1:], 16)) if len(word) == 3 else names.get(word, word)
        written = re.findall(r"(?m)^Probe TCP \S+ q\|([^|]*)\|", PROBES.read_text(encoding="latin-1"))
        return [re.sub(r"\\(x[0-9a-fA-F]{2}|.)", meant, each).encode("latin-1") for each in written]

    @staticmethod
    def said_to(server, probe):
        """The server's answer to a probe, up to the end of the connection."""
        said = b""
        with server.raw() as line:
            try:
                line.sendall(probe)
                while got := line.recv(4096):
                    said += got
            except (ConnectionResetError, BrokenPipeError):
                pass
        return said

    def test_tcp_19_a_search_for_services_changes_nothing(self):
        """Catches: a probe that ends the server, delays its ticks, keeps a session or is answered like a client's
        request."""
        if not PROBES.exists():
            self.skipTest("nmap is not installed")
        server = self.server()
        owner, probes, tick = self.client(server), self.probes(), 0
        self.assertGreaterEqual(len(probes), 100)
        self.assertIn(b"GET / HTTP/1.0\r\n\r\n", probes)
        self.assertDone(owner.lease())
        self.assertDone(owner.ask(subscribe=pb.Subscribe(decimation=1, signals=["tick"])))
        with concurrent.futures.ThreadPoolExecutor(8) as crowd:
            answers = [crowd.submit(self.said_to, server, probe) for probe in probes]
            while not all(each.done() for each in answers):
                owner.step(tick, 1.0)
                tick += 1
                time.sleep(0.001)
        refused = 0
        for probe, answer in zip(probes, answers):
            if said := answer.result():
                refusal = pb.Envelope.FromString(said[4:])
                self.assertEqual(said, frame(refusal.SerializeToString()), probe)
                self.assertIn(refusal.refusal.code, (pb.REFUSAL_MALFORMED, pb.REFUSAL_UNAUTHENTICATED), probe)
                refused += 1
        # The other probes began a frame and were closed after the 2 s for hello; or a reset overtook the refusal.
        self.assertGreater(refused, len(probes) // 2)
        self.assertEqual(owner.status().sessions, 1, "no probe kept a session")
        self.assertEqual([sample.tick for message in owner.samples for sample in message.samples], list(range(1, tick + 1)))
        self.assertEqual(sum(message.dropped for message in owner.samples), 0)
        self.assertEqual(server.stop(), 0)


class Secrets(WireTest):
    def listeners(self, server):
        """Local addresses of the TCP sockets on which this process listens."""
        mine = set()
        for each in os.listdir(f"/proc/{server.process.pid}/fd"):
            target = os.readlink(f"/proc/{server.process.pid}/fd/{each}")
            if target.startswith("socket:["):
                mine.add(target[8:-1])
        found = []
        for table in ("tcp", "tcp6"):
            for line in pathlib.Path(f"/proc/net/{table}").read_text(encoding="utf-8").splitlines()[1:]:
                words = line.split()
                if words[3] == "0A" and words[9] in mine:
                    found.append(words[1].split(":")[0])
        return found

    def test_sec_01_every_listening_socket_is_on_loopback(self):
        """Catches: a second socket that is open to the network."""
        for bench in ("servo.toml", "servo-modbus.toml"):
            text = (BENCHES / bench).read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
            server = self.server(text=text.replace("port = 1502", "port = 0"))
            found = self.listeners(server)
            self.assertEqual(set(found), {"0100007F"})
            self.assertEqual(len(found), 2 if "modbus" in bench else 1)

    def refused(self, address):
        with tempfile.TemporaryDirectory() as folder:
            bench = pathlib.Path(folder) / "bench.toml"
            bench.write_text(SERVO_TEXT.replace('"127.0.0.1"', f'"{address}"'), encoding="utf-8")
            done = subprocess.run([SERVER, bench, "--port", "0"], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
            self.assertEqual((done.returncode, done.stdout), (2, ""), address)
            return done.stderr

    def test_sec_02_an_open_address_without_a_token_does_not_start(self):
        """Catches: a bench that the whole network can drive because its address was opened."""
        for address in ("0.0.0.0", "::", "192.0.2.1"):
            self.assertIn("token", self.refused(address))
        for odd in ("0x7f000001", "0", "127.1", "2130706433", "local", ""):
            self.assertIn("tcp.address", self.refused(odd))


if __name__ == "__main__":
    unittest.main(verbosity=2)
