#!/usr/bin/python3
"""Measures how soon the page of `drivebench web` shows a bench, how often it draws 8 signals of a motor at 8 kHz that roll over 10 s,
in headless chromium, and what the gateway costs for that.

Usage: /usr/bin/python3 tests/web/frames.py [SECONDS]. Needs the release build, npm, chromium. The floor is the frames that an empty
page of the same browser gets; the canary is the longest that a sleep of 1 ms took while the measurement ran."""
import os
import pathlib
import sys
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from test_page import PageTest, missing
from wire_client import BENCHES, REPOSITORY

WINDOW_S = 10
SECONDS = 20


def cpu_s(pid):
    """What a process has used."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def processes_below(parent):
    """The numbers of all processes that this one has started, directly or not."""
    parents = {}
    for stat in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(stat.parent.name)] = int(stat.read_text(encoding="utf-8").rpartition(")")[2].split()[1])
        except OSError:
            continue  # it has ended
    below = {parent}
    while more := {pid for pid, of in parents.items() if of in below} - below:
        below |= more
    return below - {parent}


class Canary(threading.Thread):
    """Sleeps for a millisecond again and again."""

    def __init__(self):
        super().__init__(daemon=True)
        self.longest_s = 0.0
        self.over = threading.Event()

    def run(self):
        before = time.monotonic()
        while not self.over.wait(0.001):
            now = time.monotonic()
            self.longest_s = max(self.longest_s, now - before)
            before = now


class Frames(PageTest):
    def test_frames(self):
        text = (BENCHES / "im-b.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        text = text.replace("period_us = 100\n", "period_us = 125\n") + '\n[realtime]\npacer = "sleep"\nmax_lateness_ms = 60000\n'
        server = self.serve("--mode", "realtime", text=text)
        gateway = self.gateway(server)
        own = {gateway.process.pid, server.process.pid}
        marks, canary = [], Canary()

        def outside(what):
            if what == "begin":
                canary.start()
            else:
                canary.over.set()
            browser = processes_below(os.getpid()) - own
            marks.append((time.monotonic(), {"gateway": cpu_s(gateway.process.pid), "server": cpu_s(server.process.pid),
                                             "browser": sum(map(cpu_s, browser))}))

        shown = self.play("frames", gateway.url, WINDOW_S, SECONDS, outside=outside)
        (start, before), (end, after) = marks
        print(f"{shown['openS']:.2f} s from an empty cache to the values of the bench")
        print(f"{shown['perSecond']:.1f} redraws per second of {shown['signals']} signals at 8 kHz over {WINDOW_S} s; "
              f"{shown['lost']} samples lost; empty page {shown['floor']:.1f} frames per second")
        for name in after:
            print(f"{name}: {100 * (after[name] - before[name]) / (end - start):.1f} % of a core")
        print(f"canary: {1000 * canary.longest_s:.1f} ms; load {os.getloadavg()[0]:.2f}; {os.cpu_count()} cores")


if __name__ == "__main__":
    if reason := missing():
        sys.exit(f"frames: {reason}")
    if len(sys.argv) > 1:
        SECONDS = int(sys.argv.pop())
    unittest.main()
