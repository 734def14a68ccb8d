#!/usr/bin/python3
"""Clients that come and go in a rush, 5,000 a second.

    test_rush.py                 for 3 seconds
    test_rush.py --seconds 60    for a minute"""
import os
import pathlib
import socket
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
from wire_test import WireTest, until

RATE_PER_S = 5000
SECONDS = int(sys.argv[2]) if sys.argv[1:2] == ["--seconds"] else 3
AT_ONCE = struct.pack("ii", 1, 0)  # SO_LINGER: an end without a goodbye


class Rush(WireTest):
    def descriptors(self, server):
        return len(os.listdir(f"/proc/{server.process.pid}/fd"))

    def come_and_go(self, server, number):
        guest = socket.socket()
        # From many addresses: one has not enough ports for those that linger after their end.
        guest.bind((f"127.1.{number // 2000 % 250}.1", 0))
        guest.connect(server.address)
        if number % 3 == 0:
            guest.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, AT_ONCE)
        elif number % 3 == 1:
            guest.send(b"\0\0")
        guest.close()

    def rush(self, server, owner, count, tick):
        """The duration. The owner of the axis drives on meanwhile."""
        began = time.monotonic()
        for number in range(count):
            self.come_and_go(server, number)
            if number % 100 == 0:
                owner.step(tick + number // 100, 1.0)
            ahead_s = number / RATE_PER_S - (time.monotonic() - began)
            if ahead_s > 0.005:
                time.sleep(ahead_s)
        took_s = time.monotonic() - began
        until(lambda: owner.status().sessions == 1, "all connections are gone")
        return took_s

    def test_tcp_17_clients_in_a_rush_leave_nothing_behind(self):
        """Catches: a descriptor or memory that is lost with each client; a rush that keeps open sessions waiting."""
        server = self.server()
        owner = self.client(server)
        self.assertDone(owner.lease())
        self.rush(server, owner, RATE_PER_S, 0)
        before, resident = self.descriptors(server), server.memory_kib("VmRSS")
        took_s = self.rush(server, owner, RATE_PER_S * SECONDS, RATE_PER_S // 100)
        resident_after = server.memory_kib("VmRSS")
        print(f"{RATE_PER_S * SECONDS} clients in {took_s:.1f} s, {RATE_PER_S * SECONDS / took_s:.0f} a second; "
              f"memory {resident} KiB before, {resident_after} KiB after", flush=True)
        self.assertEqual(self.descriptors(server), before)
        self.assertLessEqual(resident_after, resident + 1024)
        self.assertEqual(owner.newest().tick, RATE_PER_S // 100 * (SECONDS + 1))
        self.assertNotIn("cannot accept", server.errors())
        self.assertEqual(server.stop(), 0)


if __name__ == "__main__":
    unittest.main(verbosity=2, argv=sys.argv[:1])
