#!/usr/bin/python3
"""The server as a service: its messages to the service manager, its unit, its privileges."""
import ctypes
import os
import pathlib
import platform
import re
import shutil
import signal
import socket
import struct
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
from wire_client import PATIENCE_S, REPOSITORY, SERVER, guarded, pb
from wire_test import SERVO_TEXT, WireTest

UNIT = REPOSITORY / "configs/systemd/drivebench-server.service"


class Notification(WireTest):
    def manager(self, name):
        """A socket like systemd's; the server's environment names it."""
        manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.addCleanup(manager.close)
        manager.settimeout(PATIENCE_S)
        manager.bind(name.replace("@", "\0", 1) if name.startswith("@") else name)
        return manager

    def started(self, notify_socket, *options):
        os.environ["NOTIFY_SOCKET"] = notify_socket
        self.addCleanup(os.environ.pop, "NOTIFY_SOCKET", None)
        return self.server(*options)

    def folder(self):
        folder = tempfile.mkdtemp(prefix="drivebench-service-")
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        return folder

    def test_ready_when_it_listens_and_stopping_at_a_signal(self):
        """Catches: a service that is never called ready, or too early; abstract names taken for files."""
        for name in (self.folder() + "/notify", f"@drivebench-test-{os.getpid()}"):
            for mode in ("lockstep", "realtime"):
                with self.subTest(name=name, mode=mode):
                    manager = self.manager(name)
                    server = self.started(name, "--mode", mode)
                    self.assertEqual(manager.recv(1000), b"READY=1")
                    with server.client() as client:
                        self.assertEqual(client.status().sessions, 1)
                    self.assertEqual(server.stop(signal.SIGTERM), 0)
                    self.assertEqual(manager.recv(1000), b"STOPPING=1")
                    manager.close()
                    pathlib.Path(name).unlink(missing_ok=True)

    def test_a_missing_manager_costs_a_line_and_nothing_else(self):
        """Catches: a bench that ends because no manager listens, or a name longer than an address that overruns it."""
        for name in (self.folder() + "/missing", "@" + "x" * 300, "/" + "x" * 107, "relative", "vsock:2:1"):
            with self.subTest(name=name):
                server = self.started(name)
                with server.client() as client:
                    self.assertEqual(client.status().sessions, 1)
                self.assertEqual(server.stop(), 0)
                self.assertEqual(server.errors().count("service manager"), 1)
        server = self.started("")
        self.assertEqual(server.stop(), 0)
        self.assertNotIn("service manager", server.errors())

    def test_programs_that_do_not_serve_notify_nothing(self):
        """Catches: a check of a file that tells the manager that the running service is ready, or stopping."""
        name = self.folder() + "/notify"
        manager = self.manager(name)
        manager.settimeout(0)
        done = subprocess.run([SERVER, REPOSITORY / "configs/benches/servo.toml", "--check-config"], check=False,
                              capture_output=True, env={**os.environ, "NOTIFY_SOCKET": name}, timeout=PATIENCE_S)
        self.assertEqual(done.returncode, 0)
        with self.assertRaises(BlockingIOError):
            manager.recv(1000)


class Unit(WireTest):
    def keys(self):
        lines = [line.partition("=")[::2] for line in UNIT.read_text(encoding="utf-8").splitlines() if re.match(r"\w+=", line)]
        return {key: [value for other, value in lines if other == key] for key, _ in lines}

    @staticmethod
    def largest_queue_mib():
        recorder = (REPOSITORY / "server/recording/recorder.cpp").read_text(encoding="utf-8")
        return int(re.search(r"kMaxQueueBytes = std::size_t\{(\d+)\} << 20;", recorder)[1])

    def test_sec_06_the_unit_gives_the_rights_of_real_time_and_no_others(self):
        """Catches: a service with more rights than it needs, one that is started again and again with a wrong bench file, or
        one that takes the memory of other programs."""
        keys = self.keys()
        for key in ("CapabilityBoundingSet", "AmbientCapabilities"):
            self.assertEqual(set(keys[key][0].split()), {"CAP_SYS_NICE", "CAP_IPC_LOCK"}, key)
        for key, value in {"Type": "notify", "NoNewPrivileges": "yes", "ProtectSystem": "strict", "PrivateTmp": "yes",
                           "LimitMEMLOCK": "infinity", "MemoryMax": f"{128 + 2 * self.largest_queue_mib()}M", "Restart": "on-failure", "RestartPreventExitStatus": "2"}.items():
            self.assertEqual(keys[key], [value], key)
        self.assertNotIn(keys["User"][0], ("", "root"))
        self.assertNotIn("RestrictRealtime", keys)
        self.assertGreaterEqual(int(keys["LimitRTPRIO"][0]), 80)

    def test_sec_06_systemd_accepts_the_unit(self):
        """Catches: a key that systemd does not know and silently leaves out."""
        tool = shutil.which("systemd-analyze")
        if tool is None:
            self.skipTest("systemd-analyze is not installed")
        with tempfile.TemporaryDirectory() as folder:
            unit = pathlib.Path(folder) / UNIT.name
            text = UNIT.read_text(encoding="utf-8")
            unit.write_text(re.sub(r"(?m)^ExecStart=\S+", f"ExecStart={SERVER.resolve()}", text), encoding="utf-8")
            done = subprocess.run([tool, "verify", "--man=no", unit], capture_output=True, text=True, timeout=PATIENCE_S,
                                  check=False)
            self.assertEqual((done.returncode, done.stdout + done.stderr), (0, ""))
            # In tenths of systemd's points, of which a service without any protection has 96.
            done = subprocess.run([tool, "security", "--offline=true", "--no-pager", "--threshold=25", unit],
                                  capture_output=True, text=True, timeout=PATIENCE_S, check=False)
            self.assertEqual(done.returncode, 0, done.stdout[-2000:] + done.stderr)

    def run_without(self, rights, memory, *options, code=0):
        """A short run in real time as an ordinary user with these rights; returns its output, and whether memory could be
        limited."""
        if os.geteuid() != 0 or shutil.which("setpriv") is None:
            self.skipTest("needs root and setpriv, to give rights away")
        drop = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", f"--inh-caps={rights}",
                f"--ambient-caps={rights}", f"--bounding-set={rights}", "--no-new-privs"]
        if subprocess.run([*drop, "true"], capture_output=True, check=False).returncode != 0:
            self.skipTest("this root has not even these rights")
        motor = REPOSITORY / "configs/motors/servo-im.toml"
        if subprocess.run([*drop, "sh", "-c", f"test -r {motor} && test -x {SERVER}"], check=False).returncode != 0:
            self.skipTest("the tree is not readable for other users")
        limit = ["prlimit", f"--memlock={memory}"]
        limited = subprocess.run([*limit, "true"], capture_output=True, check=False).returncode == 0
        with tempfile.TemporaryDirectory() as folder:
            os.chmod(folder, 0o755)
            bench = pathlib.Path(folder) / "bench.toml"
            bench.write_text(SERVO_TEXT, encoding="utf-8")
            bench.chmod(0o644)
            done = subprocess.run([*(limit if limited else []), *drop, SERVER, bench, "--port", "0", "--mode", "realtime",
                                   "--duration", "0.05", *options], capture_output=True, text=True, env=guarded(os.environ),
                                  timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        self.assertEqual("ready" in done.stdout, code == 0)
        return done.stderr, limited

    def test_sec_06_two_capabilities_are_enough_for_real_time(self):
        """Catches: a server that needs root after all."""
        said, limited = self.run_without("-all,+sys_nice,+ipc_lock", "unlimited")
        if limited:
            self.assertNotIn("memory not locked", said)
        if subprocess.run(["chrt", "-f", "1", "true"], check=False, stderr=subprocess.DEVNULL).returncode == 0:
            self.assertNotIn("no real-time scheduling", said)

    def test_os_07_require_rt_does_not_start_without_it(self):
        """Catches: a measurement that needs real time and runs without."""
        said, _ = self.run_without("-all", "65536:65536", "--require-rt", code=2)
        self.assertRegex(said, "--require-rt: (no real-time scheduling|memory not locked)")

    def test_os_09_memory_above_the_limit_is_not_locked(self):
        """Catches: MCL_FUTURE under a limit: each allocation beyond it fails, in the middle of a run."""
        for limit in ("8388608:8388608", "1073741824:1073741824", "unlimited"):
            said, limited = self.run_without("-all", limit)
            if limited:
                self.assertEqual("memory not locked" in said, limit != "unlimited", said)

    def test_os_07_os_09_missing_rights_are_logged_once(self):
        """Catches: a bench that calls itself real time without being it, or that does not start for lack of a right."""
        said, limited = self.run_without("-all", "65536:65536")
        self.assertEqual(said.count("no real-time scheduling"), 1, said)
        if limited:
            self.assertEqual(said.count("memory not locked: RLIMIT_MEMLOCK is 64 KiB"), 1, said)


class Filter(WireTest):
    """The unit's SystemCallFilter, installed by hand, without systemd."""
    ALLOW, ERRNO_EPERM = 0x7FFF0000, 0x00050001
    LOAD, EQUAL, RETURN = 0x20, 0x15, 0x06  # of a classic BPF program: a word, a jump, the end

    def members(self, group):
        """The names of a group of systemd's, with those of the groups in it."""
        said = subprocess.run(["systemd-analyze", "syscall-filter", "--no-pager", group], capture_output=True, text=True, check=True)
        names = set()
        for word in (line.strip() for line in said.stdout.splitlines()[1:]):
            if word.startswith("@"):
                names |= self.members(word)
            elif word and not word.startswith("#"):
                names.add(word)
        return names

    def allowed(self):
        """As systemd reads the lines: each adds its names, or takes them away."""
        names = set()
        for line in UNIT.read_text(encoding="utf-8").splitlines():
            key, _, value = line.partition("=")
            if key != "SystemCallFilter":
                continue
            groups = set().union(*(self.members(group) for group in value.lstrip("~").split()))
            names = names - groups if value.startswith("~") else names | groups
        return names | self.members("@default")

    def program(self):
        numbers = {}
        for header in pathlib.Path("/usr/include").glob("*/asm/unistd_64.h"):
            numbers = dict(re.findall(r"#define __NR_(\w+) (\d+)", header.read_text(encoding="utf-8")))
        if not numbers:
            self.skipTest("no table of system calls: linux-libc-dev is not installed")
        rows = [(self.LOAD, 0, 0, 0)]
        for name in sorted(self.allowed() & set(numbers)):
            rows += [(self.EQUAL, 0, 1, int(numbers[name])), (self.RETURN, 0, 0, self.ALLOW)]
        rows.append((self.RETURN, 0, 0, self.ERRNO_EPERM))
        return b"".join(struct.pack("<HBBI", *row) for row in rows), len(rows)

    def test_sec_06_the_server_works_under_the_filter_of_its_unit(self):
        """Catches: a filter that forbids a call of the server, or that forbids nothing."""
        if shutil.which("systemd-analyze") is None or platform.machine() != "x86_64":
            self.skipTest("needs systemd-analyze, and an x86-64")
        rows, count = self.program()
        code = ctypes.create_string_buffer(rows, len(rows))
        program = ctypes.create_string_buffer(struct.pack("<HxxxxxxQ", count, ctypes.addressof(code)))
        prctl = ctypes.CDLL(None, use_errno=True).prctl

        def confine():
            no_new_privileges, seccomp, mode_filter = 38, 22, 2
            if prctl(no_new_privileges, 1, 0, 0, 0) != 0 or prctl(seccomp, mode_filter, program, 0, 0) != 0:
                os._exit(99)
        forbidden = subprocess.run(["mount", "-t", "tmpfs", "none", "/mnt"], preexec_fn=confine, capture_output=True, check=False)
        self.assertNotEqual(forbidden.returncode, 0, "the filter forbids a call")
        self.assertNotEqual(forbidden.returncode, 99, "the filter is in force")
        folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-service-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        server = self.server("--mode", "realtime", "--record", str(folder / "run.mcap"), "--experiments", str(folder / "kept"),
                             unix=True, before=confine)
        for unix in (False, True):
            client = self.client(server, unix=unix)
            self.assertDone(client.lease())
            client.exchange(client.newest().tick, 1.0)
            self.assertDone(client.lease(pb.LeaseRequest.ACTION_RELEASE))
        self.assertEqual(server.stop(), 0)
        self.assertEqual(server.verdict["gaps"], 0)
        self.assertNotIn("Operation not permitted", server.errors())


if __name__ == "__main__":
    unittest.main(verbosity=2)
