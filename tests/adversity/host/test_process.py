#!/usr/bin/python3
"""The process of the server: signals, pauses, crashes, its environment."""
import os
import pathlib
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import PATIENCE_S, SERVER, pb
from wire_test import SERVO_TEXT, TWO_AXES, WireTest, until

OVERRUN = 1 << 11  # in the fault word


class Process(WireTest):
    def test_os_01_a_hangup_reads_the_log_level_again_and_the_run_goes_on(self):
        """Catches: a run that a closing terminal ends, and a file that is taken in part although it has become wrong."""
        server = self.server(text=SERVO_TEXT + '[log]\nlevel = "off"\n')
        client = self.client(server)
        client.lease()
        client.step(0)
        bench = server.folder / "bench.toml"
        bench.write_text(SERVO_TEXT + '[log]\nlevel = "loud"\n', encoding="utf-8")
        server.process.send_signal(signal.SIGHUP)
        client.step(1)
        bench.write_text(SERVO_TEXT.replace("port = 7300", "port = 7301") + '[log]\nlevel = "info"\n', encoding="utf-8")
        server.process.send_signal(signal.SIGHUP)
        until(lambda: "SIGHUP: tokens" in server.errors(), "the level holds")
        self.assertNotIn("stays as it is", server.errors(), "the level was off")
        client.step(2)
        tokens = server.folder / "tokens"
        tokens.write_text('[[token]]\nname = "adam"\nrole = "admin"\ntoken = "adam-secret"\n', encoding="utf-8")
        tokens.chmod(0o600)
        with_tokens = SERVO_TEXT.replace("[tcp]", f'[tcp]\ntokens_file = "{tokens}"') + '[log]\nlevel = "off"\n'
        for count, text in enumerate((with_tokens, "no bench"), 1):
            bench.write_text(text, encoding="utf-8")
            server.process.send_signal(signal.SIGHUP)
            until(lambda count=count: server.errors().count("everything stays as it is") == count, "the reason is logged")
        client.step(3)
        self.assertEqual(server.stop(), 0)

    def test_os_01_a_hangup_right_after_ready_does_not_end_the_server(self):
        """Catches: a handler that is installed after clients have been told that the server is ready."""
        for _ in range(10):
            server = self.server()
            server.process.send_signal(signal.SIGHUP)
            self.assertEqual(self.client(server).status().sessions, 1)
            self.assertEqual(server.stop(), 0)

    def test_os_02_foreign_signals_are_ignored(self):
        """Catches: a server that ends at a signal which is not meant for it."""
        server = self.server()
        client = self.client(server)
        for number in (signal.SIGPIPE, signal.SIGXFSZ, signal.SIGCHLD, signal.SIGWINCH, signal.SIGURG):
            server.process.send_signal(number)
            self.assertEqual(client.status().sessions, 1)

    def test_os_03_a_pause_longer_than_the_limit_is_a_latched_fault(self):
        """Catches: a bench that was stopped with its host and goes on as if its controller had been connected all the
        time."""
        server = self.server("--mode", "realtime", text=SERVO_TEXT, strict=True)
        owner = self.client(server)
        owner.lease()
        owner.exchange(owner.newest().tick, 5.0)
        before = owner.newest()
        server.process.send_signal(signal.SIGSTOP)
        time.sleep(0.3)
        server.process.send_signal(signal.SIGCONT)
        until(lambda: owner.newest().faults & OVERRUN, "the overrun is flagged")
        self.assertGreater(owner.newest().late_ticks, before.late_ticks)
        self.assertRefused(owner.exchange(owner.newest().tick, 5.0), pb.REFUSAL_LATCHED)

        def clear():
            self.assertDone(owner.ask(clear_faults=pb.ClearFaults()))
            return not owner.newest().faults & OVERRUN
        until(clear, "the overrun is cleared")  # a busy machine may bring the next one
        self.assertEqual(server.stop(), 0)
        self.assertFalse(server.verdict["realtime_valid"])

    def test_os_08_ticks_leave_time_to_others(self):
        """Catches: a thread that never sleeps, which the kernel then stops for 50 ms of each second, or which starves all
        others."""
        server = self.server("--mode", "realtime")
        client = self.client(server)

        def used():
            tasks = pathlib.Path(f"/proc/{server.process.pid}/task")
            return max(int((task / "schedstat").read_text(encoding="utf-8").split()[0]) for task in tasks.iterdir()) * 1e-9
        first, started = client.newest().tick, used()
        until(lambda: client.newest().tick > first + 4000, "half a second of ticks")
        ticks, busy = client.newest().tick - first, used() - started
        self.assertGreater(busy, 0.0)
        self.assertLess(busy, 0.8 * ticks * 125e-6)

    def test_os_14_a_crash_leaves_no_whole_recording_and_the_next_start_is_idle(self):
        """Catches: half a recording that replays as equal; a bench that starts in operation."""
        server, folder = self.recording_server(resource.RLIMIT_CORE, 0)
        owner = self.client(server)
        owner.lease()
        for tick in range(200):
            owner.step(tick, 5.0)
        server.process.send_signal(signal.SIGSEGV)
        server.process.wait(timeout=PATIENCE_S)
        done = subprocess.run([SERVER, "--replay", folder / "run.mcap"], capture_output=True, timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, 2)
        again = self.client(self.server("--mode", "realtime")).newest()
        self.assertEqual((again.state, again.faults, again.owner), (0, 0, 0))

    def hash_of_a_run(self, prefix=(), **environment):
        old = {name: os.environ.get(name) for name in environment}
        os.environ.update(environment)
        try:
            server = self.server(text=TWO_AXES)
        finally:
            for name, value in old.items():
                os.environ.pop(name) if value is None else os.environ.update({name: value})
        owner = self.client(server)
        owner.lease()
        owner.ask(write_parameter=pb.WriteParameter(name="machine.rotor_resistance_ohm", value=5.85))
        for tick in range(200):
            owner.step(tick, 12.5, -0.25)
        return f"{owner.status().state_hash:016x}"

    def test_det_04_locale_and_time_zone_have_no_effect(self):
        """Catches: 0,25 that is read as 0 where the comma is the point."""
        reference = self.hash_of_a_run(LC_ALL="C", TZ="UTC")
        self.assertEqual(self.hash_of_a_run(LC_ALL="C", TZ="Pacific/Kiritimati"), reference)
        folder = tempfile.mkdtemp(prefix="drivebench-abuse-")
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        made = shutil.which("localedef") and subprocess.run(
            ["localedef", "-i", "de_DE", "-f", "UTF-8", f"{folder}/de_DE.UTF-8"], capture_output=True, check=False)
        if not made or not pathlib.Path(f"{folder}/de_DE.UTF-8").exists():
            self.skipTest("no localedef, or no sources of locales, to make one with a decimal comma")
        self.assertEqual(self.hash_of_a_run(LC_ALL="de_DE.UTF-8", LOCPATH=folder), reference)

    def test_sec_08_the_binary_is_hardened(self):
        """Catches: a build without the flags that make a memory error hard to use."""
        if shutil.which("readelf") is None:
            self.skipTest("readelf is not installed")

        def readelf(option):
            return subprocess.run(["readelf", "-W", option, SERVER], capture_output=True, text=True, check=True).stdout
        symbols = readelf("--dyn-syms")
        if re.search(r"__[at]san_init", symbols):
            self.skipTest("sanitizers take the place of this hardening")
        header, segments, dynamic = readelf("-h"), readelf("-l"), readelf("-d")
        self.assertIn("DYN (Position-Independent Executable", header)
        self.assertIn("GNU_RELRO", segments)
        self.assertNotRegex(segments, r"GNU_STACK.*E")
        self.assertRegex(dynamic, r"BIND_NOW|Flags:.*NOW")
        self.assertIn("__stack_chk_fail", symbols)
        self.assertRegex(symbols, r"__\w+_chk@")  # fortified
        self.assertGreater(pathlib.Path(SERVER).read_bytes().count(b"\xf3\x0f\x1e\xfa"), 1000, "endbr64, where calls may land")


if __name__ == "__main__":
    unittest.main(verbosity=2)
