#!/usr/bin/python3
"""Prometheus' own tool reads the metrics of `drivebench web`."""
import pathlib
import shutil
import subprocess
import sys
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "helpers"))
from web_client import PAGE, Gateway
from wire_client import PATIENCE_S, Server


class Promtool(unittest.TestCase):
    def test_promtool_accepts_the_metrics(self):
        """Catches: what our own reader takes for the format, or for a good name, and Prometheus does not."""
        with Server("--mode", "lockstep") as server, Gateway(server) as gateway:
            checked = subprocess.run(["promtool", "check", "metrics"], input=gateway.get("/metrics")[2], capture_output=True,
                                     text=True, timeout=PATIENCE_S, check=False)
        self.assertEqual((checked.returncode, checked.stdout + checked.stderr), (0, ""))


if __name__ == "__main__":
    if not PAGE.exists() or shutil.which("promtool") is None:
        print(f"SKIPPED: needs promtool (Debian: apt install prometheus; ./bench test unpacks it) and the page {PAGE}")
        sys.exit(77)
    unittest.main(verbosity=2)
