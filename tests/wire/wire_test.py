"""What the tests of the server program share."""
import time
import unittest

from wire_client import BENCHES, PATIENCE_S, REPOSITORY, Server, pb

TWO_AXES = (BENCHES / "servo.toml").read_text(encoding="utf-8").replace(
    "../motors/", f"{REPOSITORY}/configs/motors/")
TWO_AXES += TWO_AXES[TWO_AXES.index("[[axis]]"):].replace('name = "servo"', 'name = "second"', 1)


def until(condition, what):
    """Waits for something that another process does."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("never: " + what)


class WireTest(unittest.TestCase):
    def server(self, *options, **more):
        server = Server(*options, **more)
        self.addCleanup(server.__exit__)
        return server

    def client(self, server, **options):
        client = server.client(**options)
        self.addCleanup(client.close)
        return client

    def assertRefused(self, answer, code, field=None):
        self.assertEqual(answer.WhichOneof("kind"), "refusal", answer)
        self.assertEqual(pb.RefusalCode.Name(answer.refusal.code), pb.RefusalCode.Name(code))
        self.assertTrue(answer.refusal.message, "a refusal is a sentence")
        if field is not None:
            self.assertEqual(answer.refusal.field, field)

    def assertDone(self, answer):
        self.assertEqual(answer.WhichOneof("kind"), "done", answer)
