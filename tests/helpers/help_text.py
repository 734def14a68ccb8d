"""The texts of --help, taken apart."""
import re
import subprocess

from wire_client import PATIENCE_S, REPOSITORY, SERVER


def help_of(program, *path):
    return subprocess.run([SERVER.parent / program, *path, "--help"], capture_output=True, text=True, check=True, timeout=PATIENCE_S,
                          cwd=REPOSITORY, env={}).stdout


def verbs(*path):
    """Every verb of drivebench with its help, and first the program's own."""
    text = help_of("drivebench", *path)
    yield path, text
    for name in re.findall(r"^  ([a-z][a-z-]*) ", above_examples(text), re.M):
        yield from verbs(*path, name)


def above_examples(text):
    return re.split(r"^Examples?:$", text, flags=re.M)[0]


def examples(text):
    return re.findall(r"^  (.*)$", re.search(r"^Examples?:\n((?:  .*\n)+)", text, re.M)[1], re.M)


def headings(text):
    return re.findall(r"^(\S.*):$", above_examples(text), re.M)


def rows(text):
    """Name and text of each argument, verb and option."""
    for line in re.sub(r"\n {26}", "  ", above_examples(text)).splitlines():
        if line.startswith("  "):
            name, _, said = line.strip().partition("  ")
            yield name, " ".join(said.split())
