#!/usr/bin/python3
"""The parts of the page that calculate, by node's own tests: page/*.test.mjs."""
import os
import pathlib
import shutil
import subprocess
import sys
import unittest

HERE = pathlib.Path(__file__).resolve().parent
BUILD = pathlib.Path(os.environ["DRIVEBENCH_SERVER"]).parents[1]
PAGE = BUILD / "clients/web/page"  # the sources as they were built, with the messages of bench.proto
PACKAGES = PAGE / "node_modules"


class Parts(unittest.TestCase):
    def test_the_parts_calculate_rightly(self):
        """Catches: what each test in page/*.test.mjs names."""
        environment = {**os.environ, "PAGE_SOURCES": str(PAGE / "src"), "PAGE_PACKAGES": str(PACKAGES)}
        done = subprocess.run(["node", "--test", *sorted((HERE / "page").glob("*.test.mjs"))], capture_output=True, text=True, env=environment,
                              timeout=300, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)


if __name__ == "__main__":
    if shutil.which("node") is None or not (PAGE / "src/bench_messages.js").exists():
        print(f"SKIPPED: needs node, and the page built in {PAGE}")
        sys.exit(77)
    unittest.main(verbosity=2)
