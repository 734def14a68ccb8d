#!/usr/bin/python3
"""The gate level through memory that a session shares with a server: the same bits, refusals, hostile content, ends."""
import array
import ctypes
import mmap
import os
import pathlib
import platform
import random
import shutil
import socket
import struct
import sys
import tempfile
import threading
import time
import unittest
import unittest.mock

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
import python_package  # noqa: E402, F401
from wire_client import BENCHES, PATIENCE_S, REPOSITORY, Client, pb  # noqa: E402
from wire_test import PATIENT_TEXT, WireTest, until  # noqa: E402

import drivebench  # noqa: E402
from drivebench import Code, LegMode  # noqa: E402
from drivebench.bridge import BridgeEdgeStruct, BridgeMeansStruct, BridgeStateStruct  # noqa: E402

MICRO, SECOND = 10**6, 10**12
ESC = (BENCHES / "esc.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
USERS = "".join(f'[[token]]\nname = "{name}"\nrole = "{role}"\ntoken = "{name}-secret"\n'
                for name, role in (("vera", "viewer"), ("otto", "operator")))

# protocols/shm/bridge_segment.hpp
REQUEST, ARGUMENTS = 64, struct.Struct("=QQQdIIQQQQ128s")
REPLY = (REQUEST + 16 + ARGUMENTS.size + 63) // 64 * 64
SENTENCE = REPLY + 48 + ctypes.sizeof(BridgeStateStruct) + ctypes.sizeof(BridgeMeansStruct) + 512 * ctypes.sizeof(BridgeEdgeStruct)
LIBC, FUTEX = ctypes.CDLL(None), {"x86_64": 202, "aarch64": 98}[platform.machine()]
RUN, READ, NEXT_EDGE, SAVE, RESTORE, INJECT = 2, 4, 3, 12, 13, 10


class Raw(Client):
    """A session with a bridge, whose memory the test writes by itself."""
    memory = None

    def share(self, **asked):
        number = self.send(share_bridge=pb.ShareBridge(**asked))
        data, rights, _, _ = self.socket.recvmsg(1 << 16, socket.CMSG_SPACE(8 * 4))
        self.buffer += data
        answer = self.answer_to(number)
        descriptors = array.array("i")
        for level, kind, content in rights:
            if (level, kind) == (socket.SOL_SOCKET, socket.SCM_RIGHTS):
                descriptors.frombytes(content)
        if answer.WhichOneof("kind") == "shared_memory":
            self.memory = mmap.mmap(descriptors[0], answer.shared_memory.bytes)
            self.asked = ctypes.c_uint32.from_buffer(self.memory, REQUEST)
            self.replied = ctypes.c_uint32.from_buffer(self.memory, REPLY)
            self.number = 0
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
        return code, count, self.memory[SENTENCE:SENTENCE + 1024].split(b"\0")[0].decode()

    def call(self, *call, **options):
        self.post(*call, **options)
        return self.outcome()


class SharedBridge(WireTest):
    def gates(self, mode="lockstep", text=ESC):
        return self.server("--mode", mode, text=text, unix=True)

    def raw(self, server, token="", **asked):
        client = Raw(server.raw(unix=True), True, token)
        self.addCleanup(client.close)
        client.share(**asked)
        return client

    def bridge(self, address):
        bridge = drivebench.Bridge(address)
        self.addCleanup(bridge.close)
        return bridge

    # Catches: a result that goes to another place or is cut, edges lost where a run takes more than one call or part, a state that
    # is not the whole, time that the client does not follow.
    def test_a_random_program_gives_the_same_bits_as_in_process(self):
        server = self.gates()
        here, there = self.bridge("inproc:esc"), self.bridge(f"shm:{server.unix_path}?spin_us=20")
        draw = random.Random(20)
        now, saved = 0, None
        edges = 0
        for _ in range(300):
            what = draw.choice(("set", "set", "run", "run", "run", "all", "next", "mark", "parameter", "inject", "save", "restore"))
            if what == "set":
                period = draw.randrange(10, 50) * MICRO
                call = ("set", draw.randrange(3), LegMode(draw.randrange(6))), {
                    "period_ps": period, "compare_ps": draw.randrange(period), "dead_ps": draw.choice((0, 200_000)), "period_start_ps": now}
            elif what in ("run", "all", "next"):
                until_ps = now + draw.choice((1, 137_000, 5 * MICRO, 3000 * MICRO))
                call = (("next_edge", until_ps), {}) if what == "next" else (("run", until_ps), {"room": 1 if what == "run" else 5000})
            elif what == "parameter":
                call = ("set_parameter", "machine.stator_resistance_ohm", draw.uniform(0.02, 0.2)), {}
            elif what == "inject":
                call = ("inject", "bus_sag", draw.choice((0.0, 0.2))), {}
            elif what == "restore":
                call = (("restore", saved) if saved else ("clear",)), {}
            else:
                call = (what,), {}
            (name, *arguments), options = call
            results = [getattr(each, name)(*arguments, **options) for each in (here, there)]
            self.assertEqual(*results, call)
            if name == "save":
                saved = results[0]
            edges += len(results[0]) if name == "run" else 0
            self.assertEqual(bytes(here.read()), bytes(there.read()), call)
            self.assertEqual(bytes(here.mean()), bytes(there.mean()), call)
            self.assertEqual(here.get_parameter("machine.stator_resistance_ohm"), there.get_parameter("machine.stator_resistance_ohm"))
            now = here.read().now_ps
        self.assertGreater(edges, 1000)
        self.assertEqual(here.save(), there.save())

    # Catches: more edges than one call holds that stop there.
    def test_a_run_with_more_edges_than_a_call_holds(self):
        server = self.gates()
        found = []
        for address in ("inproc:esc", f"shm:{server.unix_path}"):
            bridge = self.bridge(address)
            for leg, mode in enumerate((LegMode.LOW, LegMode.PWM, LegMode.OPEN)):
                bridge.set(leg, mode, period_ps=20 * MICRO, compare_ps=4 * MICRO)
            found.append(bridge.run(20_000 * MICRO, room=1200))
        self.assertEqual(len(found[0]), 1200)
        self.assertEqual(*found)

    # Catches: a gate level for a viewer, over TCP, in real time, of an axis without gates, or as often as somebody asks; a sentence that
    # does not say why.
    def test_what_has_no_gate_level_is_refused(self):
        server = self.gates()
        self.assertRefused(self.client(server).ask(share_bridge=pb.ShareBridge()), pb.REFUSAL_NOT_AVAILABLE, "kind")
        client = Raw(server.raw(unix=True), True)
        self.addCleanup(client.close)
        self.assertRefused(client.share(axis=1), pb.REFUSAL_UNKNOWN_AXIS, "axis")
        self.assertRefused(client.share(spin_us=101), pb.REFUSAL_OUT_OF_RANGE, "spin_us")
        self.assertEqual(client.share().WhichOneof("kind"), "shared_memory")
        self.assertRefused(client.share(), pb.REFUSAL_BUSY, "kind")
        for mode, text, code in (("realtime", ESC, Code.WRONG_MODE), ("lockstep", PATIENT_TEXT, Code.WRONG_DRIVE)):
            with self.assertRaises(drivebench.DrivebenchError) as refused:
                drivebench.Bridge(f"shm:{self.gates(mode, text).unix_path}")
            self.assertEqual(refused.exception.code, code)
        with self.assertRaisesRegex(drivebench.DrivebenchError, "inproc:BENCH or shm:PATH, not unix:"):
            drivebench.Bridge(f"unix:{server.unix_path}")
        with self.assertRaises(drivebench.DrivebenchError) as refused:
            drivebench.Bridge(f"shm:{server.unix_path}.none")
        self.assertEqual(refused.exception.code, Code.NO_BENCH)

    # Catches: a role that is not asked for; a token that a program has no way to show.
    def test_a_bench_with_users_asks_for_the_role_and_takes_the_token_of_the_environment(self):
        folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-bridge-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        (folder / "tokens").write_text(USERS, encoding="utf-8")
        (folder / "tokens").chmod(0o600)
        server = self.gates(text=f'{ESC}\n[tcp]\ntokens_file = "{folder}/tokens"\n')
        for token, code in (("vera-secret", Code.FORBIDDEN), ("otto-secret", None), ("wrong", Code.UNAUTHENTICATED)):
            with self.subTest(token), unittest.mock.patch.dict(os.environ, {"DRIVEBENCH_TOKEN": token}):
                if code is None:
                    self.bridge(f"shm:{server.unix_path}").run(MICRO)
                    continue
                with self.assertRaises(drivebench.DrivebenchError) as refused:
                    drivebench.Bridge(f"shm:{server.unix_path}")
                self.assertEqual(refused.exception.code, code)

    # Catches: a number, a size, a name or a call out of the memory that the server follows; one that ends the session or the server.
    def test_hostile_calls_are_refused_one_by_one(self):
        server = self.gates()
        client = self.raw(server)
        for call, options, code, said in (
                (0, {}, Code.MALFORMED, "call is 0 but must be 1 to 13"),
                (14, {}, Code.MALFORMED, "call is 14"),
                ((1 << 64) - 1, {}, Code.MALFORMED, "call is 18446744073709551615"),
                (1, {"number": 1 << 32}, Code.OUT_OF_RANGE, "leg is 65535"),
                (1, {"leg": (6, 0, 0, 0, 0, 0)}, Code.OUT_OF_RANGE, "mode is 6"),
                (RUN, {"number": (1 << 64) - 1, "room": 1 << 63}, Code.OUT_OF_RANGE, "until_ps"),
                (NEXT_EDGE, {"number": SECOND + 1}, Code.OUT_OF_RANGE, "looks 1 s ahead at most, to 1000000000000"),
                (RESTORE, {"number": (1 << 64) - 1}, Code.MALFORMED, "size is 18446744073709551615 but must be at most 65536"),
                (RESTORE, {"number": 65536}, Code.MALFORMED, "state"),
                (INJECT, {"name": b"x" * 128}, Code.UNKNOWN_FAULT, "x" * 127),
                (READ, {"counted": 77}, Code.MALFORMED, "the number of a call")):
            with self.subTest(call=call, **options):
                got = client.call(call, **options)
                self.assertEqual(got[0], code, got)
                self.assertIn(said, got[2])
        self.assertEqual(client.call(RUN, number=MICRO, room=1 << 63)[0], 0)

    # Catches: bytes that break the server: a call that reads or writes beyond its memory, a sentence without an end.
    def test_random_bytes_break_nothing(self):
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

    # Catches: a run that stalls the bench's own sessions, a bridge that outlives its session, one place fewer for each that was left.
    def test_a_run_without_end_keeps_nobody_waiting_and_ends_with_its_session(self):
        server = self.gates()
        for _ in range(3):
            clients = [self.raw(server) for _ in range(4)]
            for client in clients:
                client.post(RUN, number=8_000_000 * SECOND)
            over = Raw(server.raw(unix=True), True)
            self.addCleanup(over.close)
            self.assertRefused(over.share(), pb.REFUSAL_BUSY, "kind")
            stepper = self.client(server)
            for _ in range(20):
                stepper.status()
            for client in clients:
                self.assertNotEqual(client.replied.value, client.number, "the run is still under way")
                client.close()
            over.close()

            def has_room():
                client = Raw(server.raw(unix=True), True)
                try:
                    return client.share().WhichOneof("kind") == "shared_memory"
                finally:
                    client.close()

            until(has_room, "the place of a bridge whose session has ended")
        self.assertEqual(server.stop(), 0)

    # Catches: a client that waits for ever for a server that has gone, a server that stays for a run.
    def test_the_end_of_the_server_is_told_within_a_run(self):
        server = self.gates()
        bridge = self.bridge(f"shm:{server.unix_path}")
        bridge.set(0, LegMode.LOW)
        told = []

        def run():
            try:
                bridge.run(8_000_000 * SECOND)
            except drivebench.DrivebenchError as error:
                told.append(error)

        thread = threading.Thread(target=run)
        thread.start()
        time.sleep(0.3)
        server.stop()
        thread.join(PATIENCE_S)
        self.assertFalse(thread.is_alive())
        self.assertEqual([error.code for error in told], [Code.LINK_LOST])


if __name__ == "__main__":
    unittest.main(verbosity=2)
