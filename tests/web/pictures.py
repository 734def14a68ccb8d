#!/usr/bin/python3
"""Makes the pictures of clients/web/README.md: the page on a motor on the line at 2 kHz, in a light and a dark theme.

Usage: /usr/bin/python3 tests/web/pictures.py. Needs the release build, npm, chromium."""
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from test_page import PageTest, missing
from wire_client import BENCHES, REPOSITORY

PICTURES = REPOSITORY / "clients/web/pictures"


class Pictures(PageTest):
    def test_pictures(self):
        text = (BENCHES / "im-b.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        text = text.replace("period_us = 100\n", "period_us = 500\n") + '\n[realtime]\npacer = "sleep"\nmax_lateness_ms = 60000\n'
        server = self.serve("--mode", "realtime", text=text)
        gateway = self.gateway(server)
        PICTURES.mkdir(exist_ok=True)
        for theme in ("light", "dark"):
            self.play("picture", gateway.url, theme, PICTURES / f"{theme}.png")


if __name__ == "__main__":
    if reason := missing():
        sys.exit(f"pictures: {reason}")
    unittest.main()
