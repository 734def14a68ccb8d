#!/usr/bin/python3
"""A network that loses everything, for a while or forever (its loopback goes down), and one that loses at random."""
import pathlib
import re
import shutil
import socket
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
from bad_link import HERE, BadLink
from own_network import in_own_network
from wire_client import PATIENCE_S, Closed, pb
from wire_test import SERVO_TEXT, WireTest, until

TIMEOUT = 1 << 9  # command_timeout, in the fault word


def network(state):
    subprocess.run(["ip", "link", "set", "lo", state], check=True)


class BadNetwork(WireTest):
    def setUp(self):
        self.addCleanup(network, "up")

    def test_tcp_14_a_peer_that_vanishes_ends_its_session_after_seconds(self):
        """Catches: a session that lives on for a quarter of an hour, an axis whose owner is dead, and an end that is told as
        if the peer had left."""
        server = self.server(unix=True)
        here = self.client(server, unix=True)
        gone = self.client(server)
        self.assertDone(gone.lease())
        gone.step(0, 1.0)
        time.sleep(0.2)  # its kernel acknowledges the answer
        network("down")  # while no packet is on its way, whose loss would be noticed
        self.assertRefused(here.lease(), pb.REFUSAL_OWNED)
        until(lambda: here.status().sessions == 1, "the session ends")
        self.assertDone(here.lease())
        tcp = next(each for each in here.status().transports if each.name.startswith("tcp"))
        self.assertEqual({count.name: count.value for count in tcp.counts}["cut"], 1)

    def test_tcp_21_an_outage_is_hidden_by_tcp_and_seen_by_the_watchdog(self):
        """Catches: a connection that ends with the first lost segment; an axis that goes on with old voltages."""
        text = SERVO_TEXT.replace("lease_s = 2.0", "lease_s = 60.0")  # TCP sends again after a second or two
        server = self.server("--mode", "realtime", text=text, unix=True)
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

    def test_tcp_14_an_idle_peer_that_vanishes_ends_its_session_after_3_seconds(self):
        """Catches: a session without traffic whose dead peer goes unnoticed; over Modbus as well."""
        text = SERVO_TEXT + "\n[modbus]\nport = 0\n"
        # A busy host may be slow: of three tries one takes less than 4 s, where the rule says 3.
        took = []
        while len(took) < 3 and (not took or min(took) >= 4.0):
            server = self.server(text=text, unix=True)
            here = self.client(server, unix=True)
            gone = [self.client(server), socket.create_connection(server.ready["modbus"].rsplit(":", 1), timeout=PATIENCE_S)]
            gone[1].sendall(bytes.fromhex("000100000006010300000001"))
            self.assertEqual(len(gone[1].recv(100)), 11, "a register was read")

            def there(here=here):
                transports = {each.name.split()[0]: {count.name: count.value for count in each.counts}
                              for each in here.status().transports}
                return here.status().sessions - 1 + transports["modbus"]["connections"]
            self.assertEqual(there(), 2)
            time.sleep(0.2)  # the kernels acknowledge the answers
            network("down")
            began = time.monotonic()
            until(lambda there=there: there() == 0, "both are dead")
            took.append(time.monotonic() - began)
            network("up")
            gone[1].close()
            self.assertEqual(server.stop(), 0)
        self.assertLess(min(took), 4.0, took)

    def test_tcp_19_raw_scans_change_nothing(self):
        """Catches: a half-open connection that is kept, or a stray segment that disturbs a session."""
        nmap = shutil.which("nmap")
        if nmap is None:
            self.skipTest("nmap is not installed")
        server = self.server()
        owner = self.client(server)
        owner.lease()
        tick = 0
        for kind, answer in (("-sS", "open"), ("-sA", "unfiltered"), ("-sF", "open|filtered"), ("-sX", "open|filtered")):
            port = str(server.address[1])
            scan = subprocess.Popen([nmap, "-n", "-Pn", "--privileged", kind, "-p", port, "127.0.0.1"], stdout=subprocess.PIPE,
                                    stderr=subprocess.STDOUT, text=True)
            tick = self.step_beside(owner, scan, tick)
            self.assertRegex(scan.stdout.read(), rf"(?m)^{port}/tcp +{re.escape(answer)} ", "it was scanned")
            scan.stdout.close()
        until(lambda: owner.status().sessions == 1, "no other session is open")
        self.assertEqual(owner.newest().tick, tick)
        self.assertEqual(server.stop(), 0)


class BadPath(WireTest):
    TOKEN = '[[token]]\nname = "anna"\nrole = "operator"\ntoken = "anna-secret"\n'

    def link(self, seed):
        link = BadLink(seed)
        self.addCleanup(link.close)
        return link

    def server_here(self, *options, text=SERVO_TEXT):
        """A server that the other network reaches, and this one over a unix socket."""
        folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-link-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        (folder / "tokens").write_text(self.TOKEN, encoding="utf-8")
        (folder / "tokens").chmod(0o600)
        text = text.replace('address = "127.0.0.1"', f'tokens_file = "{folder}/tokens"\naddress = "{HERE}"')
        return self.server(*options, text=text, unix=True)

    def run_of(self, client):
        # Packets overtake each other only when several are under way at once.
        for number in [client.send(status_request=pb.StatusRequest()) for _ in range(20)]:
            self.assertEqual(client.answer_to(number).WhichOneof("kind"), "status")
            self.answered_s = time.monotonic()
        self.assertDone(client.lease())
        for tick in range(25):
            client.step(tick, 0.1 * tick)
            self.answered_s = time.monotonic()

    def run_over(self, link, **bad):
        """The state hash of a run over this link; none if the machine kept the link from carrying packets, or TCP waited, which
        it does twice as long after each loss, for so long that the server had to take the peer for dead (3 s)."""
        server = self.server_here()
        client = link.there(server.client, token="anna-secret")
        self.addCleanup(client.close)
        if bad:
            link.get_bad(**bad)
        self.answered_s = time.monotonic()
        try:
            self.run_of(client)
        except (Closed, OSError):
            if link.longest_pause_s < 1.0 and time.monotonic() - self.answered_s < 2.5:
                raise
            return None
        finally:
            self.assertEqual(server.stop(), 0)
            link.close()
        return server.verdict["state_hash"]

    def test_tcp_21_loss_damage_and_disorder_cost_time_and_nothing_else(self):
        """Catches: a damaged bit that is taken, a session that ends at random losses, a command that acts twice."""
        good, bad = None, None
        while good is None:
            good = self.run_over(self.link(21))
        while bad is None:
            link = self.link(21)
            bad = self.run_over(link, loss=0.4, damage=0.1, jitter_s=0.03)
        self.assertGreater(link.counts["lost"], 0.1 * link.counts["passed"], link.counts)
        self.assertGreater(link.counts["damaged"], 0, link.counts)
        self.assertGreater(link.counts["overtaken"], 0, link.counts)
        self.assertEqual(bad, good)

    def test_tcp_21_the_watchdog_acts_in_an_outage_only(self):
        """Catches: an axis that is given up for a lost segment, or one that goes on without commands."""
        seed = 22
        while not self.acts_in_an_outage_only(self.link(seed)):
            seed += 1

    def acts_in_an_outage_only(self, link):
        """False: TCP, which waits twice as long after each loss, or a busy machine kept commands away for two seconds."""
        text = SERVO_TEXT.replace("watchdog_ticks = 20", "watchdog_ticks = 16000").replace("lease_s = 2.0", "lease_s = 10.0")
        server = self.server_here("--mode", "realtime", text=text)  # a watchdog of 2 s
        here = self.client(server, unix=True, token="anna-secret")
        owner = link.there(server.client, token="anna-secret")
        self.addCleanup(owner.close)
        self.assertDone(owner.lease())
        tick = here.newest().tick
        self.drive(owner, 3.0)
        link.get_bad(loss=0.5, damage=0.0, jitter_s=0.03)
        until_tick = tick + 24_000
        suffices = True
        while suffices and tick < until_tick:
            before, tick = tick, owner.newest().tick  # a command acts after the tick that was seen before it
            owner.exchange(tick, 3.0)
            now = here.newest()
            suffices = not now.faults & TIMEOUT
        if suffices:
            link.cut = True
            until(lambda: here.newest().faults & TIMEOUT, "the watchdog acts")
        self.assertEqual(server.stop(), 0)
        link.close()
        self.assertTrue(suffices or now.tick - before >= 16_000, "commands came more often than the watchdog asks for")
        return suffices


if __name__ == "__main__":
    in_own_network()
    unittest.main(verbosity=2)
