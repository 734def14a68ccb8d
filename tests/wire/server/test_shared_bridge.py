#!/usr/bin/python3
"""The memory of a bridge at gate level, which a session shares with a server: refusals, hostile content, ends."""
import ctypes
import mmap
import os
import pathlib
import platform
import random
import struct
import sys
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import PATIENCE_S, Client, pb
from wire_test import ESC_TEXT, PATIENT_TEXT, WireTest, until

MICRO, SECOND = 10**6, 10**12
# protocols/shm/bridge_segment.hpp
REQUEST, ARGUMENTS = 64, struct.Struct("=QQQdIIQQQQ128s")
REPLY = (REQUEST + 16 + ARGUMENTS.size + 63) // 64 * 64
LIBC, FUTEX = ctypes.CDLL(None), {"x86_64": 202, "aarch64": 98}[platform.machine()]
SET, RUN, READ, NEXT_EDGE, SAVE, RESTORE, INJECT = 1, 2, 4, 3, 12, 13, 10


class Raw(Client):
    """A session with a bridge, whose memory the test writes by itself."""
    memory = None

    def share(self, **asked):
        answer, descriptors = self.ask_for_descriptors(share_bridge=pb.ShareBridge(**asked))
        if answer.WhichOneof("kind") == "shared_memory":
            self.memory = mmap.mmap(descriptors[0], answer.shared_memory.bytes)
            self.asked = ctypes.c_uint32.from_buffer(self.memory, REQUEST)
            self.replied = ctypes.c_uint32.from_buffer(self.memory, REPLY)
            self.number = 0
            state, means = struct.unpack_from("=IQ", self.memory, 12)
            self.sentence = REPLY + 48 + state + means + 512 * 24  # behind the edges
        for descriptor in descriptors:
            os.close(descriptor)
        return answer

    def close(self):
        super().close()
        if self.memory is not None:
            del self.asked, self.replied
            self.memory.close()
            self.memory = None

    def post(self, call, number=0, room=0, value=0.0, name=b"", leg=(0, 0, 0, 0, 0, 0), counted=None):
        """A call without waiting for its answer."""
        struct.pack_into("=Q", self.memory, REQUEST + 8, 0)
        ARGUMENTS.pack_into(self.memory, REQUEST + 16, call, number, room, value, *leg, name)
        self.number = (self.number + 1 if counted is None else counted) % (1 << 32)
        self.asked.value = self.number
        LIBC.syscall(FUTEX, ctypes.byref(self.asked), 1, 1, None, None, 0)  # wakes the bench

    def outcome(self):
        """The code, the number of results and the sentence."""
        end = time.monotonic() + PATIENCE_S
        while self.replied.value != self.number:
            if time.monotonic() > end:
                raise AssertionError("never: an answer in the memory")
            time.sleep(0.001)
        code, _, count = struct.unpack_from("=qQQ", self.memory, REPLY + 16)
        return code, count, self.memory[self.sentence:self.sentence + 1024].split(b"\0")[0].decode()

    def call(self, *call, **options):
        self.post(*call, **options)
        return self.outcome()


class SharedBridge(WireTest):
    def raw(self, server):
        client = Raw(server.raw(unix=True), True)
        self.addCleanup(client.close)
        until(lambda: client.share().WhichOneof("kind") == "shared_memory", "a place for a bridge")
        return client

    def test_what_has_no_gate_level_is_refused(self):
        """Catches: a gate level over TCP, in real time, of an axis without gates, or twice in a session."""
        server = self.gates()
        self.assertRefused(self.client(server).ask(share_bridge=pb.ShareBridge()), pb.REFUSAL_NOT_AVAILABLE, "kind")
        client = Raw(server.raw(unix=True), True)
        self.addCleanup(client.close)
        self.assertRefused(client.share(axis=1), pb.REFUSAL_UNKNOWN_AXIS, "axis")
        self.assertRefused(client.share(spin_us=101), pb.REFUSAL_OUT_OF_RANGE, "spin_us")
        self.assertEqual(client.share().WhichOneof("kind"), "shared_memory")
        self.assertRefused(client.share(), pb.REFUSAL_BUSY, "kind")
        for mode, text, code, field in (("realtime", ESC_TEXT, pb.REFUSAL_WRONG_MODE, "kind"),
                                        ("lockstep", PATIENT_TEXT, pb.REFUSAL_WRONG_DRIVE, "axis")):
            other = Raw(self.gates(mode, text).raw(unix=True), True)
            self.addCleanup(other.close)
            self.assertRefused(other.share(), code, field)

    def test_hostile_calls_are_refused_one_by_one(self):
        """Catches: a number, a size, a name or a call out of the memory that the server follows; one that ends the session or the
        server."""
        server = self.gates()
        client = self.raw(server)
        for call, options, code, said in (
                (0, {}, pb.REFUSAL_MALFORMED, "call is 0 but must be 1 to 13"),
                (14, {}, pb.REFUSAL_MALFORMED, "call is 14"),
                ((1 << 64) - 1, {}, pb.REFUSAL_MALFORMED, "call is 18446744073709551615"),
                (1, {"number": 1 << 32}, pb.REFUSAL_OUT_OF_RANGE, "leg is 65535"),
                (1, {"leg": (6, 0, 0, 0, 0, 0)}, pb.REFUSAL_OUT_OF_RANGE, "mode is 6"),
                (RUN, {"number": (1 << 64) - 1, "room": 1 << 63}, pb.REFUSAL_OUT_OF_RANGE, "until_ps"),
                (NEXT_EDGE, {"number": SECOND + 1}, pb.REFUSAL_OUT_OF_RANGE, "looks 1 s ahead at most, to 1000000000000"),
                (RESTORE, {"number": (1 << 64) - 1}, pb.REFUSAL_MALFORMED, "size is 18446744073709551615 but must be at most 65536"),
                (RESTORE, {"number": 65536}, pb.REFUSAL_MALFORMED, "state"),
                (INJECT, {"name": b"x" * 128}, pb.REFUSAL_UNKNOWN_FAULT, "x" * 127),
                (READ, {"counted": 77}, pb.REFUSAL_MALFORMED, "the number of a call")):
            with self.subTest(call=call, **options):
                got = client.call(call, **options)
                self.assertEqual(got[0], code, got)
                self.assertIn(said, got[2])
        self.assertEqual(client.call(RUN, number=MICRO, room=1 << 63)[0], 0)

    def test_random_bytes_break_nothing(self):
        """Catches: bytes that break the server: a call that reads or writes beyond its memory, a sentence without an end."""
        server = self.gates()
        client = self.raw(server)
        draw = random.Random(7)
        for _ in range(2000):
            now = struct.unpack_from("=Q", client.memory, REPLY + 24)[0]
            number = draw.choice((draw.getrandbits(64) | 1 << 63, now + draw.randrange(2 * MICRO), draw.randrange(4)))
            leg = [draw.choice((draw.getrandbits(n), draw.randrange(6))) for n in (32, 32, 64, 64, 64, 64)]
            value = struct.unpack("=d", draw.randbytes(8))[0]
            client.call(draw.choice((draw.randrange(14), draw.getrandbits(64))), number, draw.getrandbits(draw.choice((3, 64))), value,
                       draw.randbytes(128), leg)
            client.memory[len(client.memory) - 65536:] = draw.randbytes(65536)
        self.assertEqual(self.client(server).newest().tick, 0)

    def test_a_run_without_end_keeps_nobody_waiting_and_ends_with_its_session(self):
        """Catches: a run or a look ahead that stalls the bench's own sessions, a bridge that outlives its session, one place fewer
        for each that was left."""
        server = self.gates()
        for looks in (False, True, False):
            clients = [self.raw(server) for _ in range(4)]
            for client in clients:
                for leg in range(3 if looks else 0):  # no line current: nothing is to be seen, in 40 million steps
                    self.assertEqual(client.call(SET, number=leg, leg=(3, 0, 0, MICRO // 10, MICRO // 20, 1000))[0], 0)
                client.post(*((NEXT_EDGE, SECOND) if looks else (RUN, 8_000_000 * SECOND)))
            over = Raw(server.raw(unix=True), True)
            self.addCleanup(over.close)
            self.assertRefused(over.share(), pb.REFUSAL_BUSY, "kind")
            stepper = self.client(server)
            for _ in range(20):
                stepper.status()
            for client in clients:
                self.assertNotEqual(client.replied.value, client.number, "the run or look is still under way")
                client.close()
            over.close()
        for _ in range(4):
            self.raw(server)
        self.assertEqual(server.stop(), 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
