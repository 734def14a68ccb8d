#!/usr/bin/python3
"""Sessions of the server: hello, frames, foreign protocols, leases."""
import os
import pathlib
import re
import socket
import struct
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
from wire_client import Server, frame, pb
from wire_test import SERVO_TEXT, WireTest, until


class Hello(WireTest):
    @classmethod
    def setUpClass(cls):
        cls.shared = Server()

    @classmethod
    def tearDownClass(cls):
        cls.shared.__exit__()

    def audited_server(self):
        folder = tempfile.TemporaryDirectory(prefix="drivebench-sessions-")
        self.addCleanup(folder.cleanup)
        audit = pathlib.Path(folder.name) / "audit"
        server = self.server("--audit", str(audit))
        server.audit = audit
        return server

    def still_serves(self):
        self.assertEqual(self.client(self.shared).welcome.protocol, 1)

    def test_welcome_describes_the_bench(self):
        """Catches: a description that lacks an axis, a signal or the schema of the wire."""
        welcome = self.client(self.shared).welcome
        self.assertEqual([axis.name for axis in welcome.bench.axes], ["servo"])
        self.assertEqual(welcome.bench.mode, pb.MODE_LOCKSTEP)
        self.assertAlmostEqual(welcome.bench.period_s, 125e-6)
        self.assertEqual([s.name for s in welcome.bench.signals], [f.name for f in pb.Sample.DESCRIPTOR.fields])
        self.assertIn(b"drivebench.v1", welcome.descriptor_set)
        self.assertNotEqual(welcome.build_id, "")

    def test_first_message_must_be_hello(self):
        """Catches: a request that is executed before hello."""
        for kind in ({"lease": pb.LeaseRequest(action=1)}, {"status_request": pb.StatusRequest()},
                     {"exchange": pb.Exchange()}):
            client = self.client(self.shared, hello=False)
            self.assertRefused(client.ask(**kind), pb.REFUSAL_UNAUTHENTICATED)
            self.assertTrue(client.is_closed())

    def test_the_protocol_versions_must_overlap(self):
        """Catches: a version check with one bound only."""
        for low, high in ((0, 0), (2, 9)):
            client = self.client(self.shared, hello=False)
            answer = client.ask(hello=pb.Hello(protocol_min=low, protocol_max=high))
            self.assertRefused(answer, pb.REFUSAL_VERSION, "protocol_max")
            self.assertTrue(client.is_closed())
        client = self.client(self.shared, hello=False)
        self.assertEqual(client.ask(hello=pb.Hello(protocol_min=0, protocol_max=7)).welcome.protocol, 1)

    def test_tcp_01_impossible_lengths_end_the_session(self):
        """Catches: a length that is used before it is checked: an allocation of 4 GiB, or an endless wait."""
        for length in (0, 4097, 2**31 - 1, 2**31, 2**32 - 1):
            client = self.client(self.shared, hello=False)
            client.send_bytes(struct.pack(">I", length))
            self.assertRefused(client.receive(), pb.REFUSAL_MALFORMED, "frame")
            self.assertTrue(client.is_closed(), length)
        self.still_serves()

    def test_tcp_01_limit_01_the_cap_grows_with_hello_and_holds(self):
        """Catches: an off-by-one in a cap, or a cap that hello does not raise."""
        before = self.client(self.shared, hello=False)
        hello = pb.Envelope(id=9, hello=pb.Hello(protocol_min=1, protocol_max=1)).SerializeToString()
        padding = b"\xf2\x7f"  # an unknown field of bytes, number 2046
        size = 4096 - len(hello) - len(padding) - 2
        before.send_bytes(frame(hello + padding + bytes([size & 0x7F | 0x80, size >> 7]) + bytes(size)))
        self.assertEqual(before.answer_to(9).welcome.protocol, 1)
        request = pb.Envelope(id=10, status_request=pb.StatusRequest()).SerializeToString()
        size = 65536 - len(request) - len(padding) - 3
        filler = padding + bytes([size & 0x7F | 0x80, size >> 7 & 0x7F | 0x80, size >> 14]) + bytes(size)
        self.assertEqual(len(request + filler), 65536)
        before.send_bytes(frame(request + filler))
        self.assertEqual(before.answer_to(10).WhichOneof("kind"), "status")
        before.send_bytes(struct.pack(">I", 65537))
        self.assertRefused(before.receive(), pb.REFUSAL_MALFORMED, "frame")
        self.assertTrue(before.is_closed())

    def test_tcp_02_a_truncated_frame_ends_with_its_connection(self):
        """Catches: a session that waits forever for the rest of a frame of a dead peer."""
        watcher = self.client(self.shared)
        before = watcher.status().sessions
        client = self.client(self.shared)
        client.send_bytes(struct.pack(">I", 100) + b"half")
        self.assertEqual(watcher.status().sessions, before + 1)
        client.close()
        until(lambda: watcher.status().sessions == before, "the session ended")

    def test_tcp_03_one_byte_at_a_time_is_answered(self):
        """Catches: a reader that takes a read for a frame."""
        client = self.client(self.shared, hello=False)
        for byte in frame(pb.Envelope(id=5, hello=pb.Hello(protocol_min=1, protocol_max=1)).SerializeToString()):
            client.send_bytes(bytes([byte]))
        self.assertEqual(client.answer_to(5).welcome.protocol, 1)

    def test_tcp_03_many_requests_in_one_segment_are_answered_in_order(self):
        """Catches: frames behind the first one of a read that are lost or answered out of order."""
        client = self.client(self.shared)
        ids = range(1000, 1200)
        client.send_bytes(b"".join(
            frame(pb.Envelope(id=i, read_parameters=pb.ReadParameters(names=["amplifier.gain"])).SerializeToString())
            for i in ids))
        for i in ids:
            self.assertEqual(client.answer_to(i).parameter_values.parameters[0].name, "amplifier.gain")

    def test_tcp_04_foreign_protocols_are_closed(self):
        """Catches: foreign protocols that keep a session open or take the server down, or whose peers fill its log."""
        server = self.audited_server()
        began = time.monotonic()
        for _ in range(20):
            for greeting in (b"GET / HTTP/1.1\r\nHost: bench\r\n\r\n", b"SSH-2.0-OpenSSH_9.2p1\r\n",
                             bytes.fromhex("16030100c8010000c40303") + os.urandom(192),  # TLS client hello
                             b"\x00\x00\x00\x06\xff\xff\xff\xff\xff\xff"):
                client = self.client(server, hello=False)
                client.send_bytes(greeting)
                self.assertRefused(client.receive(), pb.REFUSAL_MALFORMED, "frame")
                self.assertTrue(client.is_closed(), greeting)
            half = self.client(server, hello=False)
            half.send_bytes(b"\x00\x00\x00\x02\x08")
            half.socket.shutdown(socket.SHUT_WR)
            self.assertTrue(half.is_closed())
        here = self.client(server)
        self.assertEqual(here.status().sessions, 1)
        counts = here.tcp_counts()
        self.assertEqual((counts["malformed"], counts["cut"]), (80, 0), "no connection was closed for its silence")
        self.assertAudited(server.audit, "malformed", 80)
        said = server.errors().splitlines()
        self.assertRegex(said[0], r"tcp 127\.0\.0\.1:\d+: malformed: a frame .* \(0 more since the last such line\)$")
        self.assertLessEqual(len(said), 1 + (time.monotonic() - began) // 10, "a line in 10 s")

    def test_tcp_04_each_transport_and_kind_of_refusal_has_its_line(self):
        """Catches: refused clients of which the log has no line, a line for each, or one flood that hides another."""
        began = time.monotonic()
        server = self.server(text=SERVO_TEXT.replace("[tcp]", "[tcp]\nmax_sessions = 1"), unix=True)
        for options in ({}, {"unix": True}):
            silent = self.client(server, hello=False, **options)
            for _ in range(20):
                client = self.client(server, hello=False, **options)
                client.send_bytes(b"GET / HTTP/1.1\r\n\r\n")
                self.assertTrue(client.is_closed())
            self.assertTrue(silent.is_closed())
        self.client(server)
        for _ in range(20):
            self.assertTrue(self.client(server, hello=False).is_closed())
        said, most = server.errors(), 1 + (time.monotonic() - began) // 10
        for line in ("tcp .*: malformed: ", "unix .*: malformed: ", "tcp .*: cut off: no hello", "unix .*: cut off: no hello",
                     "tcp .*: turned away: this bench serves 1 session"):
            count = len(re.findall(line, said))
            self.assertGreaterEqual(count, 1, line)
            self.assertLessEqual(count, most, line)

    def test_tcp_07_unknown_fields_are_ignored_and_the_last_scalar_counts(self):
        """Catches: a server that refuses the additions of newer clients, or takes the first of two values."""
        client = self.client(self.shared)
        twice = b"\x08\x63" + b"\x82\x01\x00" + b"\x08\x07" + b"\xa0\x7f\x01"  # id 99, status_request, id 7, unknown
        client.send_bytes(frame(twice))
        self.assertEqual(client.answer_to(7).WhichOneof("kind"), "status")

    def test_tcp_07_of_two_kinds_the_last_holds(self):
        """Catches: a request that is executed although another has taken its place, or two answers to one."""
        client, other = self.client(self.shared), self.client(self.shared)
        lease = b"\x32\x02\x10\x01"  # lease { action = ACQUIRE }
        status = b"\x82\x01\x00"  # status_request {}
        for kinds, answer, free in ((lease + status, "status", True), (status + lease, "done", False)):
            client.send_bytes(frame(b"\x08\x63" + kinds))  # id 99
            self.assertEqual(client.answer_to(99).WhichOneof("kind"), answer)
            self.assertEqual(client.status().axes[0].sample.owner == 0, free)
        self.assertRefused(other.lease(), pb.REFUSAL_OWNED)
        self.assertDone(client.lease(pb.LeaseRequest.ACTION_RELEASE))

    def test_tcp_07_answers_are_no_requests(self):
        """Catches: a server that executes a message which only servers send."""
        client = self.client(self.shared)
        for kind in ({"done": pb.Done()}, {"welcome": pb.Welcome()}, {"samples": pb.Samples()}, {}):
            self.assertRefused(client.ask(**kind) if kind else self.empty(client), pb.REFUSAL_MALFORMED, "kind")

    @staticmethod
    def empty(client):
        client.last_id += 1
        client.send_bytes(frame(pb.Envelope(id=client.last_id).SerializeToString()))
        return client.answer_to(client.last_id)

    def test_tcp_08_text_that_is_not_utf_8_ends_the_session(self):
        """Catches: a name that breaks a terminal or a client's JSON."""
        client = self.client(self.shared)
        client.send_bytes(frame(b"\x08\x01\x6a\x04\x12\x02\xff\xfe"))  # write_parameter { name = FF FE }
        self.assertRefused(client.receive(), pb.REFUSAL_MALFORMED)
        self.assertTrue(client.is_closed())

    def test_limit_05_silent_connection_is_closed(self):
        """Catches: connections that never say hello and stay forever, or long enough to take the places of others."""
        server, since = self.audited_server(), time.monotonic()
        client = self.client(server, hello=False)
        patient = self.client(server, hello=False)
        time.sleep(0.5)  # a quarter of the limit
        self.assertEqual(patient.ask(hello=pb.Hello(protocol_min=1, protocol_max=1, client="slow")).WhichOneof("kind"), "welcome")
        self.assertTrue(client.is_closed())
        self.assertLimitOf2s(since)
        self.assertEqual(patient.status().sessions, 1)
        self.assertEqual(patient.tcp_counts()["cut"], 1)
        self.assertEqual(self.assertAudited(server.audit, "limit", 1), ["no hello within 2 s"])

    def test_long_client_name_is_refused(self):
        """Catches: a log that a client fills."""
        client = self.client(self.shared, hello=False)
        answer = client.ask(hello=pb.Hello(protocol_min=1, protocol_max=1, client="x" * 101))
        self.assertRefused(answer, pb.REFUSAL_OUT_OF_RANGE, "client")


class Lease(WireTest):
    def test_own_01_own_02_an_axis_has_one_owner_at_a_time(self):
        """Catches: two controllers on one axis; a lease that outlives its holder."""
        server = self.server()
        first, second = self.client(server), self.client(server)
        self.assertDone(first.lease())
        self.assertNotEqual(first.owner, 0)
        self.assertRefused(second.lease(), pb.REFUSAL_OWNED, "axis")
        self.assertRefused(second.lease(pb.LeaseRequest.ACTION_RENEW), pb.REFUSAL_NOT_OWNER)
        self.assertRefused(second.lease(pb.LeaseRequest.ACTION_RELEASE), pb.REFUSAL_NOT_OWNER)
        self.assertRefused(second.exchange(0), pb.REFUSAL_NOT_OWNER)
        self.assertEqual(first.step(0).owner, first.owner)
        self.assertDone(first.lease(pb.LeaseRequest.ACTION_RENEW))
        self.assertDone(first.lease(pb.LeaseRequest.ACTION_RELEASE))
        self.assertDone(second.lease())
        self.assertNotEqual(first.owner, second.owner)

    def test_tcp_15_a_lease_ends_with_its_connection(self):
        """Catches: an axis that stays taken although its owner is dead: after close, half-close and reset."""
        server = self.server()
        for end in ("close", "half", "reset"):
            owner = self.client(server)
            self.assertDone(owner.lease())
            tick = owner.newest().tick
            owner.step(tick)
            if end == "half":
                owner.socket.shutdown(socket.SHUT_WR)
            elif end == "reset":
                owner.send_bytes(struct.pack(">I", 50) + b"mid-frame")
                owner.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            if end != "half":
                owner.close()
            heir = self.client(server)
            until(lambda: heir.lease().WhichOneof("kind") == "done", f"a lease after {end}")
            sample = heir.newest()
            self.assertDone(heir.ask(clear_faults=pb.ClearFaults()))
            heir.step(sample.tick)
            heir.lease(pb.LeaseRequest.ACTION_RELEASE)
            heir.close()

    def test_cmd_03_a_controller_that_vanishes_leaves_a_latched_fault(self):
        """Catches: a lease on a moving axis without a latched fault."""
        server = self.server()
        owner = self.client(server)
        owner.lease()
        for tick in range(5):
            owner.step(tick, 20.0)
        owner.close()
        heir = self.client(server)
        until(lambda: heir.lease().WhichOneof("kind") == "done", "the lease is free")
        self.assertRefused(heir.exchange(5), pb.REFUSAL_LATCHED)
        self.assertDone(heir.ask(clear_faults=pb.ClearFaults()))
        self.assertEqual(heir.step(5).state, 1)

    def test_unknown_actions_are_refused(self):
        """Catches: a client that writes an action for recordings only (ACTION_LOST), or an unknown number."""
        client = self.client(self.server())
        for action in (0, 4, 77):
            self.assertRefused(client.lease(action), pb.REFUSAL_OUT_OF_RANGE, "action")

    def test_free_mode_takes_no_controller(self):
        """Catches: a controller that believes it controls a run which does not wait for it."""
        client = self.client(self.server("--mode", "free"))
        self.assertRefused(client.lease(), pb.REFUSAL_WRONG_MODE)

    def test_a_lease_requested_by_a_session_that_ends_at_once_is_free_again(self):
        """Catches: an answer that comes after the session has ended and leaves the axis to no session."""
        server = self.server("--mode", "realtime", text=SERVO_TEXT.replace("lease_s = 2.0", "lease_s = 60.0"))
        for _ in range(30):
            ghost = self.client(server)
            ghost.send(lease=pb.LeaseRequest(action=pb.LeaseRequest.ACTION_ACQUIRE))
            ghost.close()
        heir = self.client(server)
        until(lambda: heir.lease().WhichOneof("kind") == "done", "the lease is free long before it runs out")


if __name__ == "__main__":
    unittest.main(verbosity=2)
