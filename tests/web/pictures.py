#!/usr/bin/python3
"""Makes the pictures of clients/web/README.md: the page on a motor on the line at 2 kHz, in a light and a dark theme; experiments with the
player; an axis driven open loop; a suite and an identification that the gateway ran.

Usage: /usr/bin/python3 tests/web/pictures.py. Needs the release build, npm, chromium."""
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from test_experiments_page import ExperimentsPage, missing
from test_runs_page import OWNER, RunsPage
from wire_client import BENCHES, REPOSITORY

PICTURES = REPOSITORY / "clients/web/pictures"


class Pictures(ExperimentsPage):
    def test_the_page(self):
        text = (BENCHES / "im-b.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        text = text.replace("period_us = 100\n", "period_us = 500\n") + '\n[realtime]\npacer = "sleep"\nmax_lateness_ms = 60000\n'
        server = self.serve("--mode", "realtime", text=text)
        gateway = self.gateway(server)
        PICTURES.mkdir(exist_ok=True)
        for theme in ("light", "dark"):
            self.play("picture", gateway.url, theme, PICTURES / f"{theme}.png")

    def test_the_experiments(self):
        self.play("experimentPicture", self.gateway(self.bench()).url, "light", PICTURES / "experiments.png")

    def test_the_drive(self):
        self.play("drivePicture", self.gateway(self.bench()).url, "dark", PICTURES / "drive.png")


class RunPictures(RunsPage):
    def test_the_runs(self):
        self.play("runsPicture", self.gateway(self.measured(), *self.options).url, "light", PICTURES / "runs.png", OWNER)


if __name__ == "__main__":
    if reason := missing():
        sys.exit(f"pictures: {reason}")
    unittest.main(argv=[sys.argv[0], "Pictures.test_the_page", "Pictures.test_the_experiments", "Pictures.test_the_drive", "RunPictures.test_the_runs"])
