#!/usr/bin/python3
"""The pytest plugin of the package: fixtures, suites of TOML cases, bundles. pytest itself runs it."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from python_package import LIBRARY, PACKAGE  # noqa: E402
from wire_client import PATIENCE_S  # noqa: E402

CASE = """bench = "dc-a-voltage"
duration_s = 0.01
[[check]]
name = "quiet"
kind = "bounds"
signal = "speed_rad_s"
max = {limit}
"""
FIXTURES = """import sys
import pytest

DEVICE = "import os, drivebench\\nwith drivebench.Bench(os.environ['DRIVEBENCH_LINK']) as b:\\n  b.acquire()\\n" \\
         "  for _ in range(20): b.step(voltages=5.0)\\nprint('the device ends')\\n"

@pytest.mark.drivebench("dc-a-voltage")
@pytest.mark.parametrize("again", [0, 1])
def test_in_process(bench, again):
    bench.acquire()
    assert bench.newest().tick == 0
    assert bench.step(voltages=5.0).tick == 1

@pytest.mark.drivebench("dc-a-voltage", server=True)
def test_server(bench, drivebench_server):
    assert drivebench_server.address.startswith("tcp:")
    assert bench.newest().tick == 0

@pytest.mark.drivebench("dc-a-voltage")
def test_device(bench, dut):
    assert dut(sys.executable, "-c", DEVICE).wait() == 0
    assert bench.newest().tick == 20
    assert {holds}

def test_without_a_marker(bench):
    pass
"""


class Pytest(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="drivebench-pytest-test-")
        self.folder = pathlib.Path(temporary.name)
        self.addCleanup(temporary.cleanup)
        self.write("pytest.ini", "[pytest]\ndrivebench_suites = hil\ndrivebench_bundles = failed\n")

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")

    def pytest(self, *arguments, code):
        environment = {**os.environ, "PYTHONPATH": str(PACKAGE / "src"), "DRIVEBENCH_LIBRARY": str(LIBRARY)}
        done = subprocess.run(["/usr/bin/python3", "-m", "pytest", "-p", "drivebench.pytest_plugin", "-p", "no:cacheprovider",
                               "--strict-markers", *arguments], capture_output=True, text=True, cwd=self.folder, env=environment,
                              timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout

    def test_a_suite_is_collected_and_a_failure_keeps_its_bundle(self):
        """Catches: a case that passes whatever its checks say, values that are not in the name, a bundle that nobody finds."""
        self.write("hil/case.toml", CASE.format(limit=1.0) + "[matrix]\ncheck.0.max = [1.0, -1.0]\n")
        self.write("hil/later.toml", 'skip = "no board"\n' + CASE.format(limit=1.0))
        self.write("other.toml", "not = \"a case\"\n")
        said = self.pytest("-v", "-rs", "-n", "2", code=1)
        self.assertIn("1 failed, 1 passed, 1 skipped", said)
        self.assertIn("hil/case.toml::case[max=-1.0]", said)
        self.assertIn("no board", said)
        self.assertRegex(said, r"quiet: .*max -1 rad/s")
        bundle = self.folder / "failed" / "case[max=-1.0].zip"
        self.assertTrue(bundle.is_file())
        self.assertIn(f"drivebench rerun '{bundle}'", said)

    def test_a_mistake_in_a_case_is_an_error_of_the_collection(self):
        """Catches: a suite with a mistake that has no tests and is green."""
        self.write("hil/case.toml", CASE.format(limit=1.0).replace("kind", "kynd"))
        self.assertIn("case.toml:3: check", self.pytest(code=2))

    def test_the_fixtures_give_benches_and_devices(self):
        """Catches: a bench that two tests share, a device without its link, output that is lost, a marker that is forgotten."""
        self.write("test_it.py", FIXTURES.replace("{holds}", "True"))
        self.assertIn("4 passed, 1 error", self.pytest(code=1))
        self.write("test_it.py", FIXTURES.replace("{holds}", "False"))
        said = self.pytest(code=1)
        self.assertIn("1 failed, 3 passed, 1 error", said)
        self.assertIn("the device ends", said)
        self.assertIn('needs @pytest.mark.drivebench("BENCH")', said)


if __name__ == "__main__":
    unittest.main(verbosity=2)
