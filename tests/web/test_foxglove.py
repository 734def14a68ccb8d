#!/usr/bin/python3
"""Foxglove's WebSocket of `drivebench web`: its own client reads it (foxglove/client.mjs), strangers do not break it."""
import json
import pathlib
import select
import shutil
import struct
import subprocess
import sys
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "helpers"))
import npm_package
from command_test import USAGE, CommandTest
from foxglove_client import Foxglove
from web_client import PAGE, Gateway, Refused
from wire_client import BENCHES, PATIENCE_S, REPOSITORY, Closed, pb
from wire_test import until

APP = "https://app.foxglove.dev"
PERIOD_NS = 1_000_000


class FoxgloveTest(CommandTest):
    def gateway(self, server, *options, **more):
        gateway = Gateway(server, *options, **more)
        self.addCleanup(gateway.__exit__)
        return gateway

    def client(self, gateway, **more):
        client = Foxglove(gateway, **more)
        self.addCleanup(client.close)
        return client


class Peer(FoxgloveTest):
    def setUp(self):
        super().setUp()
        for program in ("node", "npm"):
            if shutil.which(program) is None:
                self.skipTest(f"no {program}")
        self.package = self.folder / "foxglove"
        npm_package.install(HERE / "foxglove", self.package)

    def test_foxgloves_own_client_sees_the_speed_rise(self):
        """Catches: an opcode, a byte order, a schema or a time that Foxglove does not read, or a unit that is not told."""
        # A motor that starts from the line, a millisecond with each step of the controller.
        text = (BENCHES / "im-b.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        text = text.replace("period_us = 100\n", "period_us = 1000\nsubsteps = 20\n")
        for subprotocol in ("foxglove.websocket.v1", "foxglove.sdk.v1"):
            server = self.server("--mode", "lockstep", text=text)
            told, topics = self.told(server, subprotocol)
            self.assertEqual(told["subprotocol"], subprotocol)
            self.assertEqual(told["info"]["capabilities"], ["time"])
            self.assertEqual(told["info"]["metadata"]["unit.speed_rad_s"], "rad/s")
            self.assertEqual(told["topics"], topics)
            samples = told["samples"]
            self.assertEqual([sample["time"] for sample in samples], [sample["tick"] * PERIOD_NS for sample in samples])
            self.assertIn(told["times"][-1], [sample["time"] for sample in samples])
            self.assertGreater(samples[-1]["speed"], samples[0]["speed"] + 1)

    def told(self, server, subprotocol):
        """What the client was told while a controller stepped the bench, and the topics that it should have been told."""
        gateway = self.gateway(server)
        command = ["node", "client.mjs", f"ws://127.0.0.1:{gateway.port}/", subprotocol, "200"]
        peer = subprocess.Popen(command, cwd=self.package, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(lambda: peer.poll() is None and peer.kill())
        self.assertEqual(peer.stdout.readline(), "subscribed\n")
        with server.client() as controller:
            controller.lease()
            tick = 0
            # Nothing answers a subscription: slow steps until it is in force, so that the motor has not run up by then.
            while not select.select([peer.stdout], [], [], 0.1)[0]:
                self.assertLess(tick, PATIENCE_S * 10, "the client does not get its first sample")
                controller.step(tick)
                tick += 1
            self.assertEqual(peer.stdout.readline(), "reads\n")
            while peer.poll() is None:
                self.assertLess(tick, 200_000, "the client does not get its samples")
                controller.step(tick)
                tick += 1
            topics = [f"/{axis.name}/sample" for axis in controller.welcome.bench.axes]
        said, problems = peer.communicate(timeout=PATIENCE_S)
        self.assertEqual(peer.returncode, 0, said + problems)
        return json.loads(said), topics


class Strangers(FoxgloveTest):
    def setUp(self):
        super().setUp()
        self.bench = self.server("--mode", "lockstep", config=BENCHES / "dynamometer.toml")

    def test_web_06_a_message_that_breaks_a_rule_is_refused_in_words(self):
        """Catches: a wrong message that ends the client, is carried out in part or is passed over in silence."""
        client = self.client(self.gateway(self.bench))
        self.assertEqual([channel["id"] for channel in client.next_text("advertise")["channels"]], [1, 2])
        self.assertIn("lockstep", client.next_text("status")["message"])
        one = {"id": 0, "channelId": 1}
        for message, said in (
                (b"{", "the message is not JSON"), (b"[" * 60_000, "the message is not JSON"), (b"[]", "op: is missing"),
                ({"op": 7}, "op: 7 is not one of subscribe, unsubscribe"),
                ({"op": "setParameters", "parameters": []}, 'op: "setParameters" is not one of subscribe, unsubscribe'),
                ({"op": "subscribe"}, "subscriptions: is missing"),
                ({"op": "subscribe", "subscriptions": 1}, "subscriptions: 1 is no list"),
                ({"op": "subscribe", "subscriptions": [one, {"id": 1}]}, "subscriptions[1].channelId: is missing"),
                ({"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}, "subscriptions[0].id: -1 is no whole number"),
                ({"op": "subscribe", "subscriptions": [one, {"id": 1, "channelId": 3}]}, "3 is not one of the channels 1 to 2"),
                ({"op": "subscribe", "subscriptions": [one, {"id": 0, "channelId": 2}]}, "subscriptions[1].id: 0 is the subscription"),
                ({"op": "subscribe", "subscriptions": [{"id": i, "channelId": 1} for i in range(1000)]}, "a channel has one at a time"),
                ({"op": "unsubscribe", "subscriptionIds": [0]}, "subscriptionIds[0]: 0 is no subscription")):
            client.say(message)
            status = client.next_text("status")
            self.assertEqual(status["level"], 2)
            self.assertIn(said, status["message"])
        client.say_binary(b"\x01rest")
        self.assertIn("opcode: 1", client.next_text("status")["message"])
        client.subscribe(channel=2, number=9)  # nothing of the refused messages stands in its way
        with self.bench.client() as controller:
            controller.lease()
            tick = 0
            # Nothing answers a subscription: steps until it is in force.
            while not select.select([client.socket], [], [], 0.1)[0]:
                self.assertLess(tick, PATIENCE_S * 10, "the client does not get its first sample")
                controller.step(tick, 1.0, 0.0)
                tick += 1
            message = client.message()
        self.assertEqual(struct.unpack("<BI", message[:5]), (1, 9))
        sample = pb.Sample()
        sample.ParseFromString(message[13:])
        client.say(b'{"op": "unsubscribe", "subscriptionIds": [9]}')
        client.send_frame(1, b" " * 65537)
        with self.assertRaises(Closed):
            while True:
                client.message()
        self.assertEqual(client.close_code, 1009)

    def test_web_06_other_sites_read_only_if_they_are_allowed(self):
        """Catches: an allowed site that opens the page's own socket, which can drive, or a site that nobody has allowed."""
        closed = self.gateway(self.bench)
        with self.assertRaisesRegex(Refused, "403"):
            self.client(closed, Origin=APP)
        with self.assertRaisesRegex(Refused, "421"):
            self.client(closed, Host="evil.example")
        with self.assertRaisesRegex(Refused, "400"):
            self.client(closed, subprotocol="foxglove.websocket.v2, mqtt")
        self.assertEqual(self.client(closed, Origin=None).message()["op"], "serverInfo")
        gateway = self.gateway(self.bench, "--allow-origin", APP, "--allow-origin", "file://")
        for origin in (APP, "file://"):
            self.assertEqual(self.client(gateway, Origin=origin).message()["op"], "serverInfo")
        for origin in (APP + ".evil.example", "http://app.foxglove.dev", "null"):
            with self.assertRaisesRegex(Refused, "403"):
                self.client(gateway, Origin=origin)
        with self.assertRaisesRegex(Refused, "403"):
            gateway.browser(Origin=APP)
        for wrong in ("*", "app.foxglove.dev", APP + "/"):
            self.assertSays(self.drivebench("web", "--allow-origin", wrong, code=USAGE).stderr, f"--allow-origin {wrong}",
                            "SCHEME://HOST")

    def test_web_06_a_lost_bench_and_a_wrong_token_are_told(self):
        """Catches: a client that waits for ever for its server info."""
        nowhere = self.gateway(None, link=f"unix:{self.folder}/nowhere")
        client = self.client(nowhere)
        with self.assertRaises(Closed):
            client.message()
        self.assertEqual(client.close_code, 1013)
        self.assertIn("nowhere", client.close_reason)
        tokens = self.folder / "tokens"
        tokens.write_text('[[token]]\nname = "vera"\nrole = "viewer"\ntoken = "vera-secret"\n', encoding="utf-8")
        tokens.chmod(0o600)
        text = (BENCHES / "servo.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        guarded = self.server("--mode", "lockstep", text=text.replace("[tcp]", f'[tcp]\ntokens_file = "{tokens}"'))
        client = self.client(self.gateway(guarded))
        with self.assertRaises(Closed):
            client.message()
        self.assertIn("token", client.close_reason)
        self.assertEqual(self.client(self.gateway(guarded, "--token", "vera-secret")).message()["op"], "serverInfo")

    def test_web_06_a_slow_client_is_told_what_it_lost(self):
        """Catches: a queue that grows with a slow client, and samples that are lost in silence."""
        server = self.server("--mode", "free", config=BENCHES / "servo.toml")
        gateway = self.gateway(server)
        slow = self.client(gateway, receive_buffer=4096)
        slow.subscribe()
        with server.client() as reader:
            before = reader.status().tick
            until(lambda: reader.status().tick > before + 1_000_000, "a million ticks")
        self.assertLess(gateway.memory_kib(), 64 * 1024)
        self.assertRegex(slow.next_text("status")["message"], r"^/\w+/sample: [0-9]+ samples are lost")


if __name__ == "__main__":
    if not PAGE.exists():
        print(f"SKIPPED: the page was not built (node and npm): no {PAGE}")
        sys.exit(77)
    unittest.main(verbosity=2)
