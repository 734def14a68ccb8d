"""The transcripts of SENTENCES.md, run as a user would."""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import PATIENCE_S, REPOSITORY, SERVER, Server  # noqa: E402
from wire_test import PATIENT_TEXT  # noqa: E402

DOCUMENT = pathlib.Path(__file__).with_name("SENTENCES.md")
CRASH = "(a controller crashes)"


def sections():
    """The title of each section, and its commands with their expected lines."""
    for part in DOCUMENT.read_text(encoding="utf-8").split("\n## ")[1:]:
        title = part.splitlines()[0]
        steps = []
        for block in re.findall(r"```console\n(.*?)```", part, re.S):
            for line in block.splitlines():
                if line.startswith("$ "):
                    steps.append((line[2:], []))
                else:
                    steps[-1][1].append(line)
        yield title, steps


def pattern(lines):
    """`...` in a line stands for any text, alone in a line for any lines."""
    parts = []
    for line in lines:
        if line == "...":
            parts.append(r"(?:.*\n)*?")
        else:
            parts.append(re.escape(line).replace(re.escape("..."), ".*") + r"\n")
    return re.compile("".join(parts))


def crash(server):
    """A controller that has armed the axis loses its connection without a word."""
    client = server.client()
    client.lease()
    for tick in range(40):
        client.exchange(tick, 1.0)
    client.socket.close()


class Sentences(unittest.TestCase):
    maxDiff = None

    # Catches: a sentence that has gone back to what stopped people, and a document that tells another one.
    def test_every_transcript_comes_as_it_is_written(self):
        found = list(sections())
        self.assertEqual([title.split(".")[0] for title, _ in found], [str(n) for n in range(1, 10)])
        for title, steps in found:
            with self.subTest(title), tempfile.TemporaryDirectory() as folder, Server(text=PATIENT_TEXT) as server:
                for name in ("configs", "README.md"):
                    os.symlink(REPOSITORY / name, f"{folder}/{name}")
                environment = {**os.environ, "PATH": f"{SERVER.parent}:{os.environ['PATH']}",
                               "DRIVEBENCH_LINK": "tcp:%s:%d" % server.address,
                               "DRIVEBENCH_LIBRARY": str(SERVER.parent.parent / "lib/libdrivebench.so.1"),
                               "PYTHONPATH": str(REPOSITORY / "clients/python/src")}
                self.assertTrue(steps)
                for command, expected in steps:
                    if command == CRASH:
                        crash(server)
                        continue
                    done = subprocess.run(["bash", "-c", command], cwd=folder, env=environment, stdout=subprocess.PIPE,
                                          stderr=subprocess.STDOUT, text=True, timeout=PATIENCE_S, check=False)
                    if not pattern(expected).fullmatch(done.stdout):
                        self.fail(f"$ {command}\n{done.stdout}\nwhere SENTENCES.md has\n" + "\n".join(expected))


if __name__ == "__main__":
    unittest.main()
