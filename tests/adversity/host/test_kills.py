#!/usr/bin/python3
"""REC-01: a recording server is killed at random times, and its file read.

    tests/adversity/host/test_kills.py                 the series of every test run
    tests/adversity/host/test_kills.py --kills 1000    any other number; --seed N for other times

A *written record* is one in a chunk that a call of write() has taken whole: the recorder hands a chunk over in one call,
and a reader takes a chunk or leaves it. A kill may tear the call that runs; then the file ends in the middle of a
chunk, whose records had not been written yet. The script counts, for each kill: bytes that write() took and that the file
lacks, files that cannot be read, records in whole chunks that the product does not read or that differ in a bit from
the simulation."""
import argparse
import json
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time

from misfortune import Misfortune
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from recording import Recording
from wire_client import BENCHES, PATIENCE_S, SERVER, guarded


def kill_one(local, number):
    """The cost of one kill: (unreadable files, lost records, records, whether a write was torn)."""
    mode = ("realtime", "free")[number % 2]
    with tempfile.TemporaryDirectory(prefix="drivebench-kills-") as folder:
        file = pathlib.Path(folder) / "run.mcap"
        misfortune = Misfortune()
        command = [SERVER, BENCHES / "servo.toml", "--port", "0", "--mode", mode, "--record", file]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                                   env=guarded(misfortune.environment()))
        if not process.stdout.readline():
            raise AssertionError("the server did not start")
        time.sleep(local.uniform(0.0, 0.4) if mode == "realtime" else local.uniform(0.0, 0.06))
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=PATIENCE_S)
        process.stdout.close()
        data = file.read_bytes()
        if misfortune.taken == 0:
            raise AssertionError("the library counted no written byte")
        found = Recording(data)
        written = found.messages.get("/servo/sample", 0)
        done = subprocess.run([SERVER, "--replay", file, "--json"], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        report = json.loads(done.stdout) if done.stdout else {"samples": 0, "problem": done.stderr}
        # The written part is the run up to there, bit for bit; without a sample there is no run.
        replays = done.returncode == (3 if written else 2) and (not written or report["ticks"] == written - 1)
        readable = found.has_start and found.damaged == 0 and replays and "ends" in report["problem"]
        in_time = misfortune.taken <= len(data) <= misfortune.handed
        lost = abs(written - report["samples"]) + (0 if in_time else 1)
        if not readable or lost:
            print(f"kill {number}: {report}, {written} samples written, {len(data)} bytes of {misfortune.taken} taken", flush=True)
        return 0 if readable else 1, lost, sum(found.messages.values()), len(data) > misfortune.taken


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--kills", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    local = random.Random(options.seed)
    started = time.monotonic()
    unreadable = lost = records = torn = 0
    for number in range(options.kills):
        one = kill_one(local, number)
        unreadable, lost, records, torn = unreadable + one[0], lost + one[1], records + one[2], torn + one[3]
    print(f"{options.kills} kills in {time.monotonic() - started:.0f} s: {records} records written, {lost} lost, "
          f"{unreadable} files unreadable, {torn} writes torn", flush=True)
    return 0 if unreadable == 0 and lost == 0 and records > 0 else 1


if __name__ == "__main__":
    sys.exit(main())
