#!/usr/bin/python3
"""The verbs save, restore, reset and branch."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import BENCHES, PATIENCE_S, SERVER
from wire_test import PATIENT_TEXT, WireTest

DRIVEBENCH = SERVER.with_name("drivebench")


class Verbs(WireTest):
    def run_verb(self, *arguments, code=0):
        done = subprocess.run([DRIVEBENCH, *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout if code == 0 else done.stderr

    def link(self, server):
        return "tcp:%s:%d" % server.address

    def test_save_restore_and_reset_tell_what_they_did(self):
        """Catches: a file that is overwritten, a verb that is silent about the tick or that takes any file."""
        server = self.server(text=PATIENT_TEXT)
        link = self.link(server)
        with tempfile.TemporaryDirectory() as folder:
            state = pathlib.Path(folder) / "here.state"
            with server.client() as owner:
                owner.lease()
                for tick in range(800):
                    owner.step(tick, 5.0)
                self.assertIn("another session holds the lease", self.run_verb("save", "--link", link, state, code=1))
            self.assertFalse(state.exists())
            self.assertIn("saved tick 800 (0.1 s)", self.run_verb("save", "--link", link, state))
            self.assertIn("exists already", self.run_verb("save", "--link", link, state, code=2))
            self.assertIn("reset to tick 0", self.run_verb("reset", "--link", link))
            self.assertEqual(json.loads(self.run_verb("restore", "--link", link, state, "--json")),
                             {"done": "restored", "tick": 800, "file": str(state)})
            self.assertIn("cannot be read", self.run_verb("restore", "--link", link, folder + "/none", code=2))
            state.write_bytes(b"nothing of the kind")
            self.assertIn("no state of this bench", self.run_verb("restore", "--link", link, state, code=1))

    def test_branch_serves_a_second_bench_from_here(self):
        """Catches: a branch that begins at tick 0, that disturbs the first bench, or that takes another bench's state."""
        server = self.server()
        with server.client() as owner:
            owner.lease()
            for tick in range(160):
                owner.step(tick, 5.0)
        branch = subprocess.Popen([DRIVEBENCH, "branch", "--link", self.link(server), BENCHES / "servo.toml", "--port", "0",
                                   "--json"], stdout=subprocess.PIPE, text=True)
        self.addCleanup(branch.stdout.close)
        self.addCleanup(branch.wait)
        self.addCleanup(branch.kill)
        ready = json.loads(branch.stdout.readline())
        self.assertIn("tick 160 (", self.run_verb("status", "--link", f"tcp:{ready['tcp']}"))
        self.run_verb("reset", "--link", f"tcp:{ready['tcp']}")
        self.assertIn("tick 160 (", self.run_verb("status", "--link", self.link(server)))
        self.assertIn("no state of the bench bm500",
                      self.run_verb("branch", "--link", self.link(server), "bm500", "--port", "0", code=2))


if __name__ == "__main__":
    unittest.main(verbosity=2)
