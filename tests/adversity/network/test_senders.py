#!/usr/bin/python3
"""Senders that send too much, too little or in pieces."""
import pathlib
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
from wire_client import frame, pb
from wire_test import PATIENT_TEXT, TWO_AXES, WireTest, until


class Senders(WireTest):
    def test_cmd_10_commands_that_no_tick_can_use_are_counted_and_throttled(self):
        """Catches: a flood that takes the time of all others, drives the axis with its last command, or is not
        counted."""
        server = self.server("--mode", "realtime", text=PATIENT_TEXT)
        owner, watcher = self.client(server), self.client(server)
        owner.lease()

        def burst(count):
            """Sends so many commands at once, of which a tick can use one; returns the number of refusals."""
            tick = watcher.newest().tick
            ids = [owner.last_id + 1 + n for n in range(count)]
            owner.last_id = ids[-1]
            owner.send_bytes(b"".join(
                frame(pb.Envelope(id=i, exchange=pb.Exchange(commands=[pb.Command(tick=tick, gates=pb.GATES_VOLTAGE,
                                                                                   u_a_v=1.0)])).SerializeToString())
                for i in ids))
            refused = 0
            answered = set()
            while len(answered) < count:
                answer = owner.receive()
                answered.add(answer.id)
                if answer.WhichOneof("kind") == "refusal":
                    refused += answer.refusal.code in (pb.REFUSAL_BUSY, pb.REFUSAL_STALE)
            return refused

        refused = burst(10)
        self.assertGreaterEqual(refused, 1)
        self.assertEqual(watcher.tcp_counts()["excess_commands"], refused)
        self.assertEqual(watcher.tcp_counts()["throttled"], 0, "ten at once are allowed")
        for _ in range(30):  # a busy machine reads some bursts slowly enough to be no flood
            refused += burst(1500)
            if watcher.tcp_counts()["throttled"] > 0:
                break
        self.assertGreater(watcher.tcp_counts()["throttled"], 0, "the flood is throttled")
        counts = watcher.tcp_counts()
        self.assertEqual(counts["excess_commands"], refused)
        started = watcher.newest().tick
        until(lambda: watcher.newest().tick > started + 100, "the other sessions and the ticks go on")

    def test_cmd_10_an_exchange_for_each_tick_is_no_flood_with_any_number_of_axes(self):
        """Catches: a controller of several axes that is throttled because one of them takes no commands."""
        server = self.server("--mode", "realtime", text=TWO_AXES.replace("period_us = 125", "period_us = 1000"))
        client = self.client(server)
        sent = 0
        tick = -1
        while sent < 1500:
            newest = client.newest().tick
            if newest == tick:
                continue
            tick = newest
            commands = [pb.Command(axis=axis, tick=tick, gates=pb.GATES_VOLTAGE) for axis in range(2)]
            self.assertRefused(client.ask(exchange=pb.Exchange(commands=commands)), pb.REFUSAL_NOT_OWNER)
            sent += 1
        counts = client.tcp_counts()
        self.assertEqual((counts["throttled"], counts["excess_commands"]), (0, sent))

    def test_tcp_02_silence_within_a_frame_ends_the_session(self):
        """Catches: a peer that sends half a request and keeps its session, and the axis, forever."""
        server = self.server()
        watcher, slow, quiet = self.client(server), self.client(server), self.client(server)
        request = frame(pb.Envelope(id=9, status_request=pb.StatusRequest()).SerializeToString())
        self.assertDone(quiet.lease())
        for piece in (request[:2], request[2:-1]):
            slow.send_bytes(piece)
            time.sleep(0.3)
        slow.send_bytes(request[-1:])
        self.assertEqual(slow.answer_to(9).WhichOneof("kind"), "status")
        silent_since = time.monotonic()
        quiet.send_bytes(struct.pack(">I", 100) + b"half")
        self.assertTrue(quiet.is_closed())
        self.assertLimitOf2s(silent_since)
        until(lambda: watcher.status().sessions == 2, "the silent session is gone, and the slow one is not")
        self.assertDone(watcher.lease())
        self.assertEqual(watcher.tcp_counts()["cut"], 1)
        self.assertEqual(slow.status().sessions, 2)


if __name__ == "__main__":
    unittest.main(verbosity=2)
