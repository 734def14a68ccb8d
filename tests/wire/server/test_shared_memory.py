#!/usr/bin/python3
"""Exchanges in memory that a session shares with the bench: hostile content, ends and limits."""
import ctypes
import mmap
import os
import pathlib
import random
import shutil
import signal
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
from wire_client import PATIENCE_S, SERVER, Client, pb
from wire_test import PATIENT_TEXT, TWO_AXES, WireTest, until

EXERCISE = SERVER.with_name("sdk_exercise")
PATIENT_AXES = TWO_AXES.replace("watchdog_ticks = 20", "watchdog_ticks = 400000").replace("lease_s = 2.0", "lease_s = 60.0")
USERS = "".join(f'[[token]]\nname = "{name}"\nrole = "{role}"\ntoken = "{name}-secret"\n'
                for name, role in (("vera", "viewer"), ("otto", "operator"), ("ada", "admin")))

# protocols/shm/segment.hpp
HEAD = struct.Struct("=8sIIQ")
REQUEST, COMMANDS, COMMAND = 64, 64 + 24, struct.Struct("=QQqQdddd192x")  # no edges
REPLY = (COMMANDS + 64 * COMMAND.size + 63) // 64 * 64
SAMPLES = (REPLY + 32 + 1024 + 64 + 63) // 64 * 64


class Sharer(Client):
    """A session that shares memory, without spinning; `memory` is null until share() has been carried out."""
    memory = None

    def share(self, spin_us=0):
        answer, self.descriptors = self.ask_for_descriptors(share_memory=pb.ShareMemory(spin_us=spin_us))
        if answer.WhichOneof("kind") == "shared_memory":
            self.memory = mmap.mmap(self.descriptors[0], answer.shared_memory.bytes)
            # struct writes byte by byte; the bench may look between two of them.
            self.asked = ctypes.c_uint32.from_buffer(self.memory, REQUEST)
            self.replied = ctypes.c_uint32.from_buffer(self.memory, REPLY)
            self.number = 0
        return answer

    def close(self):
        super().close()
        if self.memory is not None:
            del self.asked, self.replied
            self.memory.close()
            self.memory = None
            for descriptor in self.descriptors:
                os.close(descriptor)

    def ring(self):
        try:
            os.write(self.descriptors[1], b"\0")
        except BlockingIOError:
            pass  # the rings before wake it as well

    def post(self, *commands, count=None, number=None):
        """An exchange without waiting for its answer."""
        for index, command in enumerate(commands):
            self.memory[COMMANDS + index * COMMAND.size:COMMANDS + (index + 1) * COMMAND.size] = COMMAND.pack(*command)
        struct.pack_into("=Q", self.memory, REQUEST + 16, len(commands) if count is None else count)
        self.number = self.number + 1 if number is None else number
        self.asked.value = self.number
        self.ring()

    def post_and_settle(self, *commands):
        """The same; returns when the bench has read it: after two answers it has served all that came before them."""
        self.post(*commands)
        for _ in range(2):
            self.status()

    def answered(self):
        return self.replied.value == self.number

    def answer(self):
        """The tick of each sample, or the code, the sentence and the field of a refusal."""
        end = time.monotonic() + PATIENCE_S
        while not self.answered():
            if time.monotonic() > end:
                raise AssertionError("never: an answer in the memory")
        code, count = struct.unpack_from("=QQ", self.memory, REPLY + 16)
        if code == 0:
            size = (len(self.memory) - SAMPLES) // max(HEAD.unpack_from(self.memory)[3], 1)
            return [struct.unpack_from("=Q", self.memory, SAMPLES + n * size + 8)[0] for n in range(count)]
        sentence, field = (self.memory[at:at + size].split(b"\0")[0].decode() for at, size in
                           ((REPLY + 32, 1024), (REPLY + 32 + 1024, 64)))
        return code, sentence, field

    def swap(self, *commands, **options):
        self.post(*commands, **options)
        return self.answer()


def command(tick, axis=0, gates=1, legs_off=0, a=1.0, b=0.0):
    return axis, tick, gates, legs_off, a, b, 0.0, 0.0


class SharedMemory(WireTest):
    def cpu_s(self, server):
        fields = pathlib.Path(f"/proc/{server.process.pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def server_with_users(self, text):
        folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-shm-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        (folder / "tokens").write_text(USERS, encoding="utf-8")
        (folder / "tokens").chmod(0o600)
        return self.server(text=text.replace("[tcp]", f'[tcp]\ntokens_file = "{folder}/tokens"'), unix=True)

    def sharer(self, server, token="", shares=True):
        client = Sharer(server.raw(unix=True), True, token)
        self.addCleanup(client.close)
        if shares:
            self.assertEqual(client.share().WhichOneof("kind"), "shared_memory")
        return client

    def test_exchanges_run_ticks_as_over_the_socket(self):
        """Catches: a layout that differs from its description, a tick too few or too many, a way that shuts the other one."""
        client = self.sharer(self.server(text=PATIENT_TEXT, unix=True))
        self.assertEqual(HEAD.unpack_from(client.memory)[:2], (b"drvbench", 1))
        self.assertEqual(HEAD.unpack_from(client.memory)[3], 1)
        self.assertEqual(client.swap(), [0])
        self.assertDone(client.lease())
        for tick in range(50):
            self.assertEqual(client.swap(command(tick)), [tick + 1])
        self.assertEqual(client.step(50, 1.0).tick, 51)
        self.assertEqual(client.swap(command(51)), [52])

    def test_who_may_not_share_is_told_why(self):
        """Catches: memory for a session over TCP, which can take no descriptors, for a viewer, or twice."""
        server = self.server_with_users(PATIENT_TEXT)
        over_tcp = self.client(server, token="otto-secret")
        self.assertRefused(over_tcp.ask(share_memory=pb.ShareMemory()), pb.REFUSAL_NOT_AVAILABLE, "kind")
        viewer = self.sharer(server, "vera-secret", shares=False)
        self.assertRefused(viewer.share(), pb.REFUSAL_FORBIDDEN)
        client = self.sharer(server, "otto-secret", shares=False)
        self.assertRefused(client.share(spin_us=101), pb.REFUSAL_OUT_OF_RANGE, "spin_us")
        self.assertEqual(client.share(spin_us=100).WhichOneof("kind"), "shared_memory")
        self.assertEqual(len(client.descriptors), 2)
        first = client.descriptors
        self.assertRefused(client.share(), pb.REFUSAL_BUSY, "kind")
        client.descriptors = first

    def test_every_wrong_field_is_refused_by_name(self):
        """Catches: a count, an axis, gates or legs beyond their range that the bench follows out of the memory."""
        server = self.server(text=PATIENT_TEXT, unix=True)
        client = self.sharer(server)
        client.lease()
        for wrong, code, field in (
                (dict(count=2), pb.REFUSAL_OUT_OF_RANGE, "commands.axis"),
                (dict(count=65), pb.REFUSAL_OUT_OF_RANGE, "commands"),
                (dict(count=(1 << 64) - 1), pb.REFUSAL_OUT_OF_RANGE, "commands"),
                (dict(axis=1), pb.REFUSAL_UNKNOWN_AXIS, "axis"),
                (dict(axis=1 << 32), pb.REFUSAL_UNKNOWN_AXIS, "axis"),
                (dict(gates=6), pb.REFUSAL_OUT_OF_RANGE, "commands.gates"),
                (dict(gates=-1), pb.REFUSAL_OUT_OF_RANGE, "commands.gates"),
                (dict(gates=1 << 32), pb.REFUSAL_OUT_OF_RANGE, "commands.gates"),
                (dict(legs_off=8), pb.REFUSAL_OUT_OF_RANGE, "commands.legs_off"),
                (dict(legs_off=1 << 32), pb.REFUSAL_OUT_OF_RANGE, "commands.legs_off"),
                (dict(a=float("nan")), pb.REFUSAL_NOT_FINITE, "commands"),
                (dict(a=float("inf")), pb.REFUSAL_NOT_FINITE, "commands"),
                (dict(tick=7), pb.REFUSAL_STALE, "commands"),
                (dict(tick=(1 << 64) - 1), pb.REFUSAL_STALE, "commands")):
            with self.subTest(wrong):
                options = {"tick": 0, **wrong}
                count = options.pop("count", None)
                got = client.swap(command(**options), count=count)
                self.assertIsInstance(got, tuple, got)
                self.assertEqual((pb.RefusalCode.Name(got[0]), got[2]), (pb.RefusalCode.Name(code), field))
                self.assertTrue(got[1])
        got = client.swap(command(0), number=client.number + 2)
        self.assertEqual((got[0], got[2]), (pb.REFUSAL_MALFORMED, "number"))
        self.assertEqual(client.newest().tick, 0)
        self.assertEqual(client.swap(command(0)), [1])

    def test_a_stranger_is_told_what_it_is_told_over_the_socket(self):
        """Catches: a lease that memory does not ask for, and sentences that differ between the two ways."""
        server = self.server(text=PATIENT_TEXT, unix=True)
        owner = self.sharer(server)
        stranger = self.sharer(server)
        owner.lease()
        code, sentence, field = stranger.swap(command(0))
        over_socket = stranger.exchange(0, 1.0).refusal
        self.assertEqual((code, sentence, field), (over_socket.code, over_socket.message, over_socket.field))
        self.assertEqual(code, pb.REFUSAL_NOT_OWNER)
        self.assertEqual(owner.swap(command(0)), [1])

    def test_random_content_harms_nobody(self):
        """Catches: a server that follows a wrong number, hangs in the memory of a hostile client, or serves nobody else."""
        server = self.server(text=PATIENT_AXES, unix=True)
        good, hostile = self.sharer(server), self.sharer(server)
        good.lease()
        draw = random.Random(1)
        ticks = 0
        for _ in range(400):
            size = draw.choice((4, 64, 1000, SAMPLES - REQUEST))
            at = draw.randrange(REQUEST, len(hostile.memory) - size + 1) if draw.random() < 0.5 else REQUEST
            hostile.memory[at:at + size] = draw.randbytes(size)
            if draw.random() < 0.3:
                struct.pack_into("=Q", hostile.memory, REQUEST + 16, draw.randrange(3))
            hostile.ring()
            ticks += 1
            self.assertEqual(good.swap(command(ticks - 1)), [ticks])
        self.assertEqual(hostile.newest().tick, ticks)

    def test_the_memory_cannot_be_taken_from_under_the_bench(self):
        """Catches: a bench that a client kills by making the memory shorter."""
        client = self.sharer(self.server(text=PATIENT_TEXT, unix=True))
        for size in (0, len(client.memory) + 4096):
            with self.assertRaises(PermissionError):
                os.ftruncate(client.descriptors[0], size)
        self.assertEqual(client.swap(), [0])

    def test_an_exchange_that_waits_ends_with_the_lease(self):
        """Catches: a client that sleeps for ever on a tick that cannot come any more."""
        server = self.server_with_users(PATIENT_AXES)
        owner = self.sharer(server, "otto-secret")
        other = self.client(server, token="otto-secret")
        owner.lease()
        other.lease(axis=1)
        owner.post(command(0))
        admin = self.client(server, token="ada-secret")
        self.assertFalse(owner.answered())
        take = pb.LeaseRequest(axis=0, action=pb.LeaseRequest.ACTION_TAKE, reason="maintenance")
        self.assertDone(admin.ask(lease=take))
        code, sentence, _ = owner.answer()
        self.assertEqual(code, pb.REFUSAL_NOT_OWNER)
        self.assertIn("maintenance", sentence)

    def test_two_controllers_wait_for_each_other(self):
        """Catches: a tick without the second command, and a session that is not woken by the tick of another one."""
        server = self.server(text=PATIENT_AXES, unix=True)
        first, second = self.sharer(server), self.sharer(server)
        first.lease()
        second.lease(axis=1)
        for tick in range(20):
            first.post(command(tick))
            second.post(command(tick, axis=1))
            self.assertEqual((first.answer(), second.answer()), ([tick + 1], [tick + 1]))

    def test_a_session_that_asks_nothing_takes_no_time(self):
        """Catches: a bench that spins while its client sleeps, or that one ring wakes for ever."""
        server = self.server(text=PATIENT_TEXT, unix=True)
        clients = [self.sharer(server) for _ in range(4)]
        for client in clients:
            self.assertEqual(client.swap(), [0])
            client.ring()

        clients[0].status()
        before = self.cpu_s(server)
        time.sleep(1.0)
        self.assertLess(self.cpu_s(server) - before, 0.2)

    def test_a_bell_without_an_exchange_wakes_the_bench_once(self):
        """Catches: a client that keeps the bench spinning by ringing now and then."""
        server = self.server(text=PATIENT_TEXT, unix=True)
        client = self.sharer(server, shares=False)
        client.share(spin_us=100)
        struct.pack_into("=q", client.memory, REQUEST + 8, 1000)  # a processor that the bench does not run on
        self.assertEqual(client.swap(), [0])
        before, end = self.cpu_s(server), time.monotonic() + 1.0
        while time.monotonic() < end:
            client.ring()
            time.sleep(0.0001)
        self.assertLess(self.cpu_s(server) - before, 0.25)

    def test_a_bell_that_blocks_or_is_cut_holds_nobody_up(self):
        """Catches: a descriptor whose flags or whose content the client can change under the bench."""
        server = self.server(text=PATIENT_TEXT, unix=True)
        other = self.client(server)
        blocking, cut = self.sharer(server), self.sharer(server)
        os.set_blocking(blocking.descriptors[1], True)
        blocking.ring()
        self.assertEqual(other.newest().tick, 0)
        with socket.socket(fileno=os.dup(cut.descriptors[1])) as bell:
            bell.shutdown(socket.SHUT_RDWR)
        for _ in range(3):
            self.assertEqual(other.newest().tick, 0)

    def test_memory_and_socket_take_turns(self):
        """Catches: two exchanges of a session under way at once, and an answer that goes the other way."""
        server = self.server(text=PATIENT_AXES, unix=True)
        client, other = self.sharer(server), self.client(server)
        client.lease()
        other.lease(axis=1)
        client.post_and_settle(command(0))
        self.assertRefused(client.exchange(0, 1.0), pb.REFUSAL_BUSY, "commands")
        other.step(0, axis=1)
        self.assertEqual(client.answer(), [1])
        waiting = client.send(exchange=pb.Exchange(commands=[pb.Command(axis=0, tick=1, gates=pb.GATES_VOLTAGE)]))
        client.status()  # behind it
        self.assertEqual(client.swap(command(1))[0], pb.REFUSAL_BUSY)
        other.step(1, axis=1)
        self.assertEqual(client.answer_to(waiting).exchange_reply.samples[0].sample.tick, 2)
        client.post_and_settle(command(2))
        self.assertDone(self.client(server, conducts=True).ask(reset_bench=pb.ResetBench()))
        self.assertEqual(client.answer(), [0], "the sample of the bench that was set back")

    def test_numbers_go_on_after_the_last_one(self):
        """Catches: a session that ends after 2^32 exchanges, some hours."""
        client = self.sharer(self.server(text=PATIENT_TEXT, unix=True))
        self.assertEqual(client.swap(number=0xFFFFFFFD)[2], "number")
        for number in (0xFFFFFFFE, 0xFFFFFFFF, 0, 1):
            self.assertEqual(client.swap(number=number), [0])

    def test_a_flood_in_real_time_is_throttled(self):
        """Catches: a client that makes the bench answer as often as it likes."""
        server = self.server("--mode", "realtime", text=PATIENT_TEXT, unix=True)
        flood = self.sharer(server)
        watcher = self.client(server)
        end = time.monotonic() + PATIENCE_S
        while watcher.tcp_counts()["throttled"] == 0:
            self.assertLess(time.monotonic(), end, "never throttled")
            for _ in range(1000):
                self.assertEqual(flood.swap(command(0))[0], pb.REFUSAL_NOT_OWNER)

    def test_clients_that_are_killed_leave_nothing(self):
        """Catches: descriptors, memory or leases that stay after a client has gone in the middle of an exchange."""
        server = self.server(text=PATIENT_TEXT, unix=True)
        process = pathlib.Path(f"/proc/{server.process.pid}")

        def held():
            mappings = (process / "maps").read_text(encoding="utf-8").count("memfd:drivebench")
            return len(list((process / "fd").iterdir())), mappings

        watcher = self.client(server)
        before = held()
        draw = random.Random(2)
        for _ in range(20):
            victim = subprocess.Popen([EXERCISE, f"shm:{server.unix_path}", "die"], stdin=subprocess.PIPE,
                                      stdout=subprocess.PIPE, text=True)
            self.assertEqual(victim.stdout.readline(), "ready\n")
            victim.stdin.write("\n")
            victim.stdin.flush()
            time.sleep(draw.random() * 0.005)
            victim.send_signal(signal.SIGKILL)
            victim.communicate(timeout=PATIENCE_S)
            until(lambda: watcher.lease().WhichOneof("kind") == "done", "the lease is free")
            self.assertDone(watcher.lease(pb.LeaseRequest.ACTION_RELEASE))
        until(lambda: held() == before, "nothing is left")


if __name__ == "__main__":
    unittest.main(verbosity=2)
