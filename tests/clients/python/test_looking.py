"""`?spin_us=` of an address and `--spin-us` of the server: they look for the other side's word before they sleep."""
import pathlib
import resource
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
import python_package  # noqa: E402, F401
from wire_client import PATIENCE_S, Server  # noqa: E402

import drivebench  # noqa: E402

EXCHANGES = 50


def sleeps_here():
    return resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw


def sleeps_of(process):
    """How often its first thread, which serves the sockets, has given up its CPU by itself."""
    status = pathlib.Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8")
    return int(status.split("voluntary_ctxt_switches:")[1].split()[0])


class Looking(unittest.TestCase):
    def test_both_sides_look_before_they_sleep(self):
        """Catches: an option that is taken and does nothing, so that every exchange wakes both sides."""
        with Server("--spin-us", "1000", unix=True) as server:
            for address in ("tcp:%s:%d" % server.address, f"unix:{server.unix_path}"):
                with self.subTest(address), drivebench.Bench(address + "?spin_us=1000") as bench:
                    bench.acquire()
                    bench.newest()
                    end = time.monotonic() + PATIENCE_S
                    # A busy machine takes the CPU from either side for a while: one undisturbed stretch is enough.
                    while True:
                        before = sleeps_here(), sleeps_of(server.process)
                        for _ in range(EXCHANGES):
                            bench.step(voltages=(0.0, 0.0))
                        slept = sleeps_here() - before[0], sleeps_of(server.process) - before[1]
                        if max(slept) < EXCHANGES / 10:
                            break
                        if time.monotonic() > end:
                            self.fail(f"slept {slept} times in {EXCHANGES} exchanges")
                    bench.release()

    def test_an_end_is_told_while_looking(self):
        """Catches: a program that looks for ever, or reads the end of the bench as no answer yet."""
        with Server() as server, drivebench.Bench("tcp:%s:%d?spin_us=1000" % server.address) as bench:
            bench.acquire()
            bench.newest()
            server.process.kill()
            with self.assertRaisesRegex(drivebench.LinkLost, "closed the connection"):
                while True:
                    bench.step(voltages=(0.0, 0.0))


if __name__ == "__main__":
    unittest.main()
