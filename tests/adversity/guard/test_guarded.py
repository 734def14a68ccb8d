#!/usr/bin/python3
"""The guard in the programs that other tests start."""
import os
import pathlib
import signal
import subprocess
import sys
import unittest


try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import BENCHES, PATIENCE_S, SERVER, Closed, guarded  # noqa: E402
from wire_test import PATIENT_TEXT, WireTest  # noqa: E402

# The guard cannot be compiled with sanitizers; they do its work in part.
GUARD = os.environ.get("DRIVEBENCH_GUARD")


@unittest.skipIf(GUARD is None, "no guard is built here")
class Guarded(WireTest):
    def misdeed(self):
        os.environ["DRIVEBENCH_MISDEED"] = "1"
        self.addCleanup(os.environ.pop, "DRIVEBENCH_MISDEED", None)

    def assertCaught(self, process):
        self.assertEqual(process.wait(timeout=PATIENCE_S), -signal.SIGABRT)

    def test_rt_01_a_server_whose_tick_allocates_ends(self):
        """Catches: a guard that is missing or blind in the servers of all other tests."""
        self.misdeed()
        server = self.server()
        owner = self.client(server)
        self.assertDone(owner.lease())
        with self.assertRaises((Closed, ConnectionError)):
            owner.step(0, 1.0)
        self.assertCaught(server.process)
        self.assertIn("tick guard: malloc in a tick", server.errors())

    def test_rt_01_a_server_whose_tick_thread_allocates_ends(self):
        """Catches: the same in real time and in a free run, whose ticks are not those of the lockstep engine."""
        self.misdeed()
        for mode in ("realtime", "free"):
            done = subprocess.run([SERVER, BENCHES / "servo.toml", "--port", "0", "--mode", mode, "--duration", "0.1"],
                                  capture_output=True, text=True, env=guarded(os.environ), timeout=PATIENCE_S, check=False)
            self.assertEqual(done.returncode, -signal.SIGABRT)
            self.assertIn("tick guard: malloc in a tick", done.stderr)

    def test_a_server_whose_ticks_allocate_nothing_goes_on(self):
        """Catches: a guard that ends every program."""
        server = self.server("--mode", "realtime", text=PATIENT_TEXT)
        owner = self.client(server)
        self.assertDone(owner.lease())
        self.drive(owner, 3.0)
        self.assertEqual(server.stop(), 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
