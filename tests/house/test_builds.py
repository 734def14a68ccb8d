"""The build from a clean clone: without a preset, and inside a project of their own."""

import json
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent


def run(*command, **options):
    """Runs a command; its output if it succeeds, else a failure that shows it."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)
    if done.returncode != 0:
        raise AssertionError(f"{shlex.join(map(str, command))} ended with {done.returncode}:\n{done.stdout}")
    return done.stdout


class Builds(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.build = pathlib.Path(folder.name) / "build"

    def test_without_a_preset_warnings_are_no_errors_and_g_plus_plus_finds_none_at_o3(self):
        """Catches: -Werror among the options of every target, and the overlap that g++ 12 reports in dbc.cpp at -O3."""
        run("cmake", "-S", ROOT, "-B", self.build, "-DDRIVEBENCH_TESTS=OFF", "-DDRIVEBENCH_BATCHES=OFF", "-DCMAKE_CXX_COMPILER=g++")
        entries = json.loads((self.build / "compile_commands.json").read_text())
        ours = [entry for entry in entries if pathlib.Path(entry["file"]).is_relative_to(ROOT)]
        self.assertGreater(len(ours), 200)
        for entry in ours:
            self.assertNotIn("-Werror", entry["command"])
            self.assertIn("-O3 -DNDEBUG", entry["command"])
        entry = next(entry for entry in ours if entry["file"].endswith("protocols/can/dbc.cpp"))
        words = shlex.split(entry["command"])
        words[words.index("-o") + 1] = os.devnull
        run(*words, "-Werror", cwd=entry["directory"])

    def test_another_project_adds_the_plant_with_one_line(self):
        """Catches: a path that is right at the top level alone, warnings and a build type that reach the other project, our
        tests among its own."""
        run("cmake", "-S", HERE / "consumer", "-B", self.build, f"-DDRIVEBENCH={ROOT}")
        self.assertIn("CMAKE_BUILD_TYPE:STRING=\n", (self.build / "CMakeCache.txt").read_text())
        self.assertFalse((self.build / "compile_commands.json").exists())
        run("cmake", "--build", self.build, "--target", "consumer", "-j", "2")
        tests = run("ctest", "--test-dir", self.build)
        self.assertIn("100% tests passed, 0 tests failed out of 1", tests)


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=2))
