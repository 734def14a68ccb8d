#!/usr/bin/python3
"""More connections than the server has places for: which of them it serves."""
import pathlib
import sys
import threading
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import Closed, pb
from wire_test import SERVO_TEXT, WireTest, until


class Places(WireTest):
    def renew(self, server, source, over):
        """A crowd of silent connections from an address: a new one for each that the server closes."""
        crowd = [server.raw(source=source) for _ in range(40)]
        while not over.is_set():
            for n, each in enumerate(crowd):
                each.setblocking(False)
                try:
                    ended = each.recv(4096) is not None
                except BlockingIOError:
                    ended = False
                except OSError:
                    ended = True
                if ended:
                    each.close()
                    crowd[n] = server.raw(source=source)
        for each in crowd:
            each.close()

    def gets_in(self, server, **options):
        """Whether a client gets a welcome at this attempt. Among the silent ones of its own address it may lose its place before
        the server reads its hello."""
        try:
            with server.client(hello=False, **options) as client:
                client.send(hello=pb.Hello(protocol_min=1, protocol_max=1, client="among the crowd"))
                return client.receive().WhichOneof("kind") == "welcome"
        except (Closed, OSError):
            return False

    def test_tcp_13_limit_02_a_crowd_without_hello_keeps_no_client_out(self):
        """Catches: silent connections, renewed as soon as the server closes one, that leave no room for another address, for
        another client of their address, or for the unix socket."""
        server = self.server(unix=True)
        inside = self.client(server)
        over = threading.Event()
        crowds = [threading.Thread(target=self.renew, args=(server, source, over)) for source in ("127.0.0.1", "127.0.0.2")]
        for crowd in crowds:
            crowd.start()
        self.addCleanup(over.set)
        until(lambda: inside.tcp_counts()["turned_away"] > 100, "the crowd is renewed")
        for options in ({"source": "127.0.0.3"}, {"unix": True}):
            for _ in range(20):
                with server.client(**options) as client:
                    self.assertEqual(client.welcome.protocol, 1, options)
        for source in (None, "127.0.0.2"):
            until(lambda: self.gets_in(server, source=source), "a client of the crowd's address gets in")
        over.set()
        for crowd in crowds:
            crowd.join()
        self.assertMemoryBelow(server, 128 * 1024)

    def test_limit_02_an_address_has_a_share_of_the_sessions(self):
        """Catches: one computer that takes the places of all the others; a share that counts the sessions of the unix
        socket or those that have ended."""
        text = SERVO_TEXT.replace("[tcp]", "[tcp]\nmax_sessions = 5\nmax_sessions_of_address = 2")
        server = self.server(text=text, unix=True)
        crowd = [self.client(server, source="127.0.0.2") for _ in range(2)]
        outside = self.client(server, hello=False, source="127.0.0.2")
        refusal = outside.receive()
        self.assertRefused(refusal, pb.REFUSAL_BUSY, "session")
        self.assertIn("127.0.0.2", refusal.refusal.message)
        for options in [{}] * 2 + [{"source": "127.0.0.3"}] + [{"unix": True}] * 3:
            self.client(server, **options)
        self.assertRefused(self.client(server, hello=False, source="127.0.0.3").receive(), pb.REFUSAL_BUSY, "session")
        crowd[0].close()
        until(lambda: crowd[1].status().sessions == 7, "the session has ended")
        self.assertRefused(self.client(server, hello=False, source="127.0.0.3").receive(), pb.REFUSAL_BUSY, "session")


if __name__ == "__main__":
    unittest.main(verbosity=2)
