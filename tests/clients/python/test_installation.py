"""The package `drivebench` as a user gets it: installed with pip, its types, the code in its README and its examples."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from python_package import LIBRARY, PACKAGE  # noqa: E402
from wire_client import PATIENCE_S  # noqa: E402

NEEDED = {"pip": "python3-pip", "setuptools": "python3-pip", "wheel": "python3-pip", "mypy": "mypy"}
INSTALLATION_S = 300.0  # the longest that pip may take on a busy machine
FIRST_LINE = r"^50\.000 rad/s of 50\.000, hash [0-9a-f]{16}$"


def environment(**more):
    """Without the package of the checkout, and without this machine's variables."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("DRIVEBENCH_", "PYTHON", "LD_"))}
    return {**clean, "PYTHONDONTWRITEBYTECODE": "1", **more}


def run(*command, patience_s=PATIENCE_S, folder="/", **more):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=patience_s, check=False, cwd=folder,
                          env=environment(**more))
    if done.returncode != 0:
        raise AssertionError(f"{command} ended with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout.strip()


class Installation(unittest.TestCase):
    # Catches: a package that lacks a module or its types once it is installed, or that needs a network, NumPy or the checkout.
    def test_pip_installs_it_without_a_network_and_the_example_runs(self):
        with tempfile.TemporaryDirectory() as folder:
            source, venv = pathlib.Path(folder) / "source", pathlib.Path(folder) / "venv"
            shutil.copytree(PACKAGE, source, ignore=shutil.ignore_patterns("build", "*.egg-info", "__pycache__"))
            run("/usr/bin/python3", "-m", "venv", "--without-pip", "--system-site-packages", venv)
            python = venv / "bin/python"
            run(python, "-m", "pip", "install", "--no-index", "--no-build-isolation", source, patience_s=INSTALLATION_S)
            place = run(python, "-c", "import drivebench; print(drivebench.__path__[0])")
            self.assertTrue(place.startswith(str(venv)), place)
            self.assertEqual(sorted(each.name for each in pathlib.Path(place).iterdir() if each.name != "__pycache__"),
                             sorted(each.name for each in (PACKAGE / "src/drivebench").iterdir() if each.name != "__pycache__"))
            shutil.rmtree(source / "src")
            line = run(python, source / "examples/speed_loop.py", DRIVEBENCH_LIBRARY=str(LIBRARY))
            self.assertRegex(line, FIRST_LINE)

    # Catches: an annotation that is wrong or missing, which a user's type checker would report.
    def test_the_types_are_strict(self):
        with tempfile.TemporaryDirectory() as cache:
            said = run("/usr/bin/mypy", "--config-file", PACKAGE / "pyproject.toml", "--cache-dir", cache, PACKAGE / "src",
                       PACKAGE / "examples/speed_loop.py", MYPYPATH=str(PACKAGE / "src"), patience_s=INSTALLATION_S)
        self.assertIn("no issues found", said)

    # Catches: NumPy or pandas that are needed by the import, and a slow start for those that only ask the version.
    def test_the_import_needs_the_standard_library_only(self):
        loaded = run("/usr/bin/python3", "-c", "import drivebench, sys; print('numpy' in sys.modules, 'pandas' in sys.modules)",
                     PYTHONPATH=str(PACKAGE / "src"), DRIVEBENCH_LIBRARY="/nowhere")
        self.assertEqual(loaded, "False False")

    # Catches: lists that are promised where NumPy is not installed, and not made.
    def test_without_numpy_a_record_is_lists(self):
        code = ("import sys; sys.path = [each for each in sys.path if 'dist-packages' not in each]; import drivebench\n"
                "with drivebench.Bench('inproc:servo') as bench, bench.record(['faults']) as run:\n"
                "    bench.newest()\n"
                "print(run.arrays())")
        said = run("/usr/bin/python3", "-c", code, PYTHONPATH=str(PACKAGE / "src"), DRIVEBENCH_LIBRARY=str(LIBRARY))
        self.assertEqual(said, "{'tick': [0], 'faults': [0]}")

    # Catches: a README whose code does not run, or prints something else than it says.
    def test_the_code_of_the_readme_runs(self):
        text = (PACKAGE / "README.md").read_text(encoding="utf-8")
        blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
        said = run("/usr/bin/python3", "-c", "\n".join(blocks), PYTHONPATH=str(PACKAGE / "src"),
                   DRIVEBENCH_LIBRARY=str(LIBRARY)).splitlines()
        self.assertIn(f"prints `{said[0]}`", text)
        self.assertRegex(said[1], r"^201 -?\d+\.\d+ lockstep exact: 200 ticks$")
        example = (PACKAGE / "examples/speed_loop.py").read_text(encoding="utf-8")
        self.assertIn(blocks[0].split("as bench:", 1)[1].rstrip(), example)

    # Catches: a notebook that stops at one of its cells.
    def test_the_notebook_runs(self):
        said = run("/usr/bin/python3", PACKAGE / "examples/step_response.py", PYTHONPATH=str(PACKAGE / "src"),
                   DRIVEBENCH_LIBRARY=str(LIBRARY))
        self.assertIn("147.37 rad/s without a load, 140.35 rad/s with it", said)


if __name__ == "__main__":
    for module, package in NEEDED.items():
        if subprocess.run(["/usr/bin/python3", "-c", f"import {module}"], capture_output=True, check=False).returncode != 0:
            print(f"SKIPPED: {package} is not installed")
            sys.exit(77)
    unittest.main(verbosity=2)
