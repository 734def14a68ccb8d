"""Packages of npm for the peers of a test."""
import shutil
import subprocess
import unittest

PATIENCE_S = 300.0


def install(source, folder, *options):
    """Copies the package `source` to `folder` and installs what it needs there, with options of `npm ci`; skips the test if npm cannot: the
    registry is not ours."""
    shutil.copytree(source, folder, ignore=shutil.ignore_patterns("node_modules"))
    try:
        done = subprocess.run(["npm", "ci", "--no-audit", "--no-fund", "--ignore-scripts", *options], cwd=folder, capture_output=True, text=True,
                              timeout=PATIENCE_S, check=False)
    except subprocess.TimeoutExpired as slow:
        raise unittest.SkipTest(f"npm cannot install {source.name}: {slow}") from slow
    if done.returncode != 0:
        raise unittest.SkipTest(f"npm cannot install {source.name}: {done.stderr.strip().splitlines()[-1:]}")
