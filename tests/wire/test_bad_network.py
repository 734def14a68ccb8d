#!/usr/bin/python3
"""A network that loses everything for a while, or for ever: its loopback goes down. Each test names the mistake that it would catch."""
import subprocess
import sys
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

from own_network import in_own_network
from wire_client import pb
from wire_test import WireTest, until

TIMEOUT = 1 << 9  # command_timeout, in the fault word


def network(state):
    subprocess.run(["ip", "link", "set", "lo", state], check=True)


class BadNetwork(WireTest):
    def setUp(self):
        self.addCleanup(network, "up")

    def test_tcp_14_a_peer_that_vanishes_is_dead_after_seconds(self):
        """A session that lives for a quarter of an hour, and an axis whose owner is not there."""
        server = self.server(unix=True)
        here = self.client(server, unix=True)
        gone = self.client(server)
        self.assertDone(gone.lease())
        gone.step(0, 1.0)
        time.sleep(0.2)  # its kernel acknowledges the answer
        network("down")  # while nothing is on its way, whose loss could be noticed
        self.assertRefused(here.lease(), pb.REFUSAL_OWNED)
        until(lambda: here.status().sessions == 1, "the server gives up")
        self.assertDone(here.lease())

    def test_tcp_21_an_outage_is_hidden_by_tcp_and_seen_by_the_watchdog(self):
        """A connection that ends with the first lost segment; an axis that goes on with old voltages."""
        server = self.server("--mode", "realtime", unix=True)
        here, owner = self.client(server, unix=True), self.client(server)
        self.assertDone(owner.lease())
        self.drive(owner, 3.0)
        network("down")
        number = owner.send(exchange=pb.Exchange())
        until(lambda: here.newest().faults & TIMEOUT, "the watchdog acts")
        network("up")
        self.assertEqual(owner.answer_to(number).WhichOneof("kind"), "exchange_reply")
        self.assertRefused(owner.exchange(owner.newest().tick, 3.0), pb.REFUSAL_LATCHED)
        self.assertDone(owner.ask(clear_faults=pb.ClearFaults()))
        self.assertEqual(here.newest().owner, owner.owner)


if __name__ == "__main__":
    in_own_network()
    unittest.main(verbosity=2)
