#!/usr/bin/python3
"""Every command in a README works, every link exists, and every bench file loads."""
import json
import os
import pathlib
import re
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
from help_text import help_of, verbs
from own_network import in_own_network
from typed_commands import Bench
from wire_client import BENCHES, PATIENCE_S, REPOSITORY, SERVER

READMES = ("README.md", "server/README.md", "clients/README.md", "clients/control/README.md", "clients/python/README.md",
           "clients/regression/README.md", "clients/fmu/README.md", "protocols/can/README.md", "protocols/modbus/README.md")
PROGRAMS = ("drivebench", "drivebench-server")

# Lines that are not run, and why.
NOT_RUN = {
    "drivebench web                                      # the same in a browser, with a scope, triggers and knobs: http://127.0.0.1:7380/":
        "needs the page, which npm builds; test_gateway.py and test_page.py try it",
    "drivebench-server configs/benches/servo.toml [--mode realtime|lockstep|free] [--port N] [--unix PATH] [--spin-us N]":
        "a synopsis; test_commands.py tries each option",
    "drivebench-server --replay FILE.mcap [--json]": "a synopsis; test_commands.py replays recordings",
    "drivebench-server --write-pages FOLDER": "a synopsis; test_pages.py writes them",
    "drivebench can check can0       # the problems of bit timing, state and queue, each with the line that cures it":
        "needs an adapter; can_check_test and test_socketcan.py try it",
    "drivebench doctor                                   # whether this machine is fit for real time and CAN, and what mends it":
        "its exit code is this machine's; test_doctor_command.py tries it",
}


def documents():
    """All Markdown files of the project."""
    for folder, folders, files in os.walk(REPOSITORY):
        folders[:] = [name for name in folders if name not in ("build", "node_modules") and not name.startswith(".")]
        yield from (pathlib.Path(folder) / name for name in files if name.endswith(".md"))


def code_lines(text):
    """The lines of fenced and of indented blocks."""
    fenced = False
    for line in text.splitlines():
        if line.startswith("```"):
            fenced = not fenced
        elif fenced or line.startswith("    "):
            yield line.strip()


def commands(text):
    for line in code_lines(text):
        line = line.removeprefix("$ ")
        if line.split(" ")[0] in PROGRAMS:
            yield line


class Readmes(unittest.TestCase):
    def test_every_command_works(self):
        """Catches: an option, a file name or a preset that was renamed everywhere but in the READMEs."""
        unused = set(NOT_RUN)
        for name in READMES:
            lines = list(commands((REPOSITORY / name).read_text(encoding="utf-8")))
            self.assertTrue(lines, f"{name} has commands")
            with tempfile.TemporaryDirectory(prefix="drivebench-readme-") as folder:
                bench = Bench(pathlib.Path(folder))
                self.addCleanup(bench.kill)
                for line in lines:
                    if line in NOT_RUN:
                        unused.discard(line)
                        continue
                    with self.subTest(f"{name}: {line}"):
                        bench.do(line)
                bench.stop()
        self.assertEqual(unused, set(), "NOT_RUN names lines that no README has")

    def test_the_state_hash_of_the_tour_is_true(self):
        """Catches: a change of the physics without the README's hash, which is the same on every machine."""
        shown = re.search(r"^\s*state hash\s+([0-9a-f]{16})\s+[0-9a-f]{16}$",
                          (REPOSITORY / "README.md").read_text(encoding="utf-8"), re.M)
        self.assertIsNotNone(shown)
        with tempfile.TemporaryDirectory(prefix="drivebench-readme-") as folder:
            bench = Bench(pathlib.Path(folder))
            self.addCleanup(bench.kill)
            bench.start(["drivebench", "serve"])
            bench.move()
            self.assertIn(f"state hash {shown[1]}\n", bench.run(["drivebench", "status"]))
            bench.stop()

    def test_the_controller_in_twelve_lines_turns_the_motor(self):
        """Catches: twelve lines that do not compile, or that are no longer those of the program that is built and run here."""
        shown = re.search(r"^```cpp\n(.*?)^```", (REPOSITORY / "README.md").read_text(encoding="utf-8"), re.M | re.S)[1]
        lines = [line.strip() for line in shown.splitlines() if line.strip() != "}"]
        self.assertEqual(len(lines), 12)
        built = [line.strip() for line in (REPOSITORY / "clients/examples/half_turn.cpp").read_text(encoding="utf-8").splitlines()]
        self.assertEqual([line for line in lines[1:] if line not in built], [])
        with tempfile.TemporaryDirectory(prefix="drivebench-readme-") as folder:
            bench = Bench(pathlib.Path(folder))
            self.addCleanup(bench.kill)
            bench.start(["drivebench", "serve", "dc-a-servo"])
            done = subprocess.run([SERVER.parent / "half_turn", bench.environment["DRIVEBENCH_LINK"]], capture_output=True,
                                  text=True, timeout=4 * PATIENCE_S, check=False)
            bench.stop()
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "turned by 3.142 rad of 3.142\n", ""))

    def test_an_own_controller_turns_an_own_motor(self):
        """Catches: a way from a data sheet to a controller that breaks off, or takes other steps than those that are shown; a
        motor file with other numbers than the program has."""
        section = (REPOSITORY / "README.md").read_text(encoding="utf-8").split("## Your motor, your controller")[1].split("\n## ")[0]
        said = []
        with tempfile.TemporaryDirectory(prefix="drivebench-readme-") as folder:
            bench = Bench(pathlib.Path(folder))
            self.addCleanup(bench.kill)
            (pathlib.Path(folder) / "clients").symlink_to(REPOSITORY / "clients")
            for line in code_lines(section):
                if line.startswith("drivebench"):
                    bench.do(line)
                    continue
                line = line.replace("tcp:127.0.0.1:7300", bench.environment.get("DRIVEBENCH_LINK", ""))
                environment = {**bench.environment, "PATH": f"{SERVER.parent}:{os.environ['PATH']}",
                               "DRIVEBENCH_LIBRARY": str(SERVER.parent.parent / "lib/libdrivebench.so.1")}
                done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=4 * PATIENCE_S, check=False,
                                      cwd=folder, env=environment)
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                said.append(done.stdout)
            bench.moved = True
            bench.do("drivebench plot my-run.mcap --out my-run.svg")
            program = ["/usr/bin/python3", REPOSITORY / "clients/python/examples/own_motor.py"]
            environment = {**environment, "PYTHONPATH": str(REPOSITORY / "clients/python/src")}
            environment.pop("DRIVEBENCH_LINK", None)
            for words in ([], ["my-bench.toml"]):
                done = subprocess.run([*program, *words], capture_output=True, text=True, timeout=PATIENCE_S, check=False, cwd=folder,
                                      env=environment)
                self.assertEqual(done.returncode, 1)
                self.assertIn("inproc:", done.stderr)
        self.assertEqual(said[0], said[1], "in process and over TCP")
        self.assertRegex(said[2], r"(?m)^pass +my-case +1 s +3 checks$")
        tools = (REPOSITORY / "bench").read_text(encoding="utf-8").split("  tools)")[1].split(";;")[0]
        self.assertIn("drivebench_shared drivebench_inproc", tools, "the README says that ./bench tools builds what this needs")
        self.assertIn(re.search(r"prints `(300.0 rad/s of 300.0)`", section)[1], said[0])

    def test_every_option_of_a_command_is_documented(self):
        """Catches: an option that only its --help names."""
        told = (REPOSITORY / "clients/README.md").read_text(encoding="utf-8")
        commands_there = ("demo", "describe", "status", "watch", "inject", "set", "bump", "clear", "take", "save", "restore", "reset", "branch", "control", "plot", "replay",
                          "export", "identify", "track", "filter", "experiment run", "experiment list", "experiment fetch", "experiment cancel",
                          "fmu", "dbc", "can-table", "modbus-map", "can-log", "can check", "steady-state", "convert circuit",
                          "convert winding", "convert frame", "test", "rerun", "new motor dc", "new motor pm", "new motor bldc", "new motor im", "new bench", "new case", "doctor", "web")
        names = [path[0] for path, _ in verbs() if len(path) == 1]
        self.assertEqual({command.split()[0] for command in commands_there} | {"serve"}, set(names))
        for command in commands_there:
            text = help_of("drivebench", *command.split())
            for option in re.findall(r"^  (--[a-z-]+)", text, re.M):
                with self.subTest(f"{command} {option}"):
                    self.assertRegex(told, re.escape(option) + "(?![a-z-])")
        for variable in ("DRIVEBENCH_LINK", "DRIVEBENCH_TOKEN", "DRIVEBENCH_OWNER", "DRIVEBENCH_CONFIGS"):
            self.assertIn(variable, told)

    def test_every_preset_and_folder_of_tests_is_documented(self):
        """Catches: a preset or a folder of tests that no README names."""
        presets = json.loads((REPOSITORY / "CMakePresets.json").read_text(encoding="utf-8"))["buildPresets"]
        told = re.search(r"`./bench build \[([a-z|]+)\]`", (REPOSITORY / "README.md").read_text(encoding="utf-8"))
        self.assertEqual(set(told[1].split("|")), {preset["name"] for preset in presets})
        told = (REPOSITORY / "tests/README.md").read_text(encoding="utf-8")
        mirrored = {"plant", "protocols", "server", "clients", "control", "identification", "can", "modbus"}
        for folder in (REPOSITORY / "tests").iterdir():
            if folder.is_dir() and folder.name not in mirrored | {"__pycache__"}:
                self.assertIn(f"`{folder.name}/`", told)

    def test_every_relative_link_points_at_a_file(self):
        """Catches: a file that was moved or renamed."""
        checked = 0
        for document in documents():
            text = document.read_text(encoding="utf-8")
            text = re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)
            text = re.sub(r"^    .*$", "", text, flags=re.M)
            # Code in a line is no link, but the text of a link may be code.
            text = re.sub(r"(?<!\[)`[^`\n]*`", "", text)
            for target in re.findall(r"\]\(([^)\s]+)\)", text):
                if re.match(r"[a-z]+:|#", target):
                    continue
                with self.subTest(f"{document.relative_to(REPOSITORY)}: {target}"):
                    self.assertTrue((document.parent / target.split("#")[0]).exists())
                checked += 1
        self.assertGreater(checked, 5)


class Configs(unittest.TestCase):
    def test_every_bench_file_loads(self):
        """Catches: a key that was renamed in the server only."""
        files = sorted(BENCHES.iterdir())
        self.assertTrue(files)
        for file in files:
            with self.subTest(file.name):
                done = subprocess.run([SERVER, file, "--check-config"], capture_output=True, text=True,
                                      timeout=PATIENCE_S, check=False)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("no problems", done.stdout)


if __name__ == "__main__":
    in_own_network()  # some commands use ports and a bus that other programs would share
    unittest.main(verbosity=2)
