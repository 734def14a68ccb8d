#!/usr/bin/python3
"""The subcommands of `drivebench experiment` against the real server. Each test names the mistake that it would catch."""
import json
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import threading
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

from wire_client import BENCHES, PATIENCE_S, REPOSITORY, SERVER
from wire_test import WireTest

OWNER = "the secret of a test"


class Commands(WireTest):
    """The program drivebench."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory(prefix="drivebench-experiments-")
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)

    def start(self, bench):
        server = self.server("--experiments", str(self.path / "kept"), "--mode", "lockstep", config=BENCHES / f"{bench}.toml")
        self.link = f"tcp:{server.ready['tcp']}"
        return server

    def drivebench(self, *words, owner=OWNER):
        environment = dict(os.environ, DRIVEBENCH_LINK=self.link, XDG_CONFIG_HOME=self.folder.name)
        environment.pop("DRIVEBENCH_OWNER", None)
        more = ["--owner", owner] if owner else []
        return subprocess.run([str(SERVER.parent / "drivebench"), "experiment", *words, *more], capture_output=True,
                              text=True, timeout=PATIENCE_S * 2, env=environment)

    def test_the_examples_run(self):
        """An example that its bench refuses, or whose numbers are not those that it is about."""
        for bench, name, rows, column, at_least in (
                ("im-8-5-5", "im-8-5-5-start", 801, "speed_rad_s [rad/s]", 140.0),
                ("dc-a-servo", "dc-a-two-sines", 1001, "i_a_a [A]", 2.45),
                ("pm-9-3", "pm-ramp", 1501, "speed_rad_s [rad/s]", 24.3)):
            server = self.start(bench)
            out = self.path / f"{name}.csv"
            ran = self.drivebench("run", str(REPOSITORY / f"configs/experiments/{name}.toml"), "--json", "--out", str(out))
            self.assertEqual(ran.returncode, 0, ran.stderr)
            self.assertEqual(json.loads(ran.stdout)["rows"], rows)
            lines = out.read_text(encoding="utf-8").splitlines()
            self.assertEqual(len(lines), rows + 1)
            place = lines[0].split(",").index(column)
            self.assertGreater(max(float(line.split(",")[place]) for line in lines[1:]), at_least)
            server.stop()

    def test_run_list_fetch_and_cancel(self):
        """A subcommand that does something else than it says, or ends well after a failure."""
        self.start("servo")
        table = self.path / "steps.csv"
        table.write_text("time_s,u_v\n0,1\n0.01,2\n", encoding="utf-8")
        toml = self.path / "e.toml"
        toml.write_text('label = "steps"\nticks = 160\nsignals = ["u_a_v"]\n[input]\nkind = "phase_voltages"\n'
                        '[[input.shapes]]\nchannel = "a"\ntable = { file = "steps.csv" }\n', encoding="utf-8")
        ran = self.drivebench("run", str(toml), "--json")
        self.assertEqual(ran.returncode, 0, ran.stderr)
        number = json.loads(ran.stdout)["id"]
        fetched = self.drivebench("fetch", str(number))
        self.assertEqual(fetched.returncode, 0, fetched.stderr)
        self.assertEqual([line.split(",")[2] for line in fetched.stdout.splitlines()[1:]], ["0"] + ["1"] * 80 + ["2"] * 80)
        copy = self.path / "copy.mcap"
        self.assertEqual(self.drivebench("fetch", str(number), "--out", str(copy)).returncode, 0)
        self.assertEqual(copy.read_bytes(), (self.path / "kept" / f"{number}.mcap").read_bytes())
        listed = json.loads(self.drivebench("list", "--json").stdout)["experiments"]
        self.assertEqual([(e["id"], e["label"], e["state"]) for e in listed], [(number, "steps", "completed")])
        self.assertIn("(not yours)", self.drivebench("list", owner=None).stdout)
        self.assertEqual(self.drivebench("fetch", str(number), owner=None).returncode, 1)
        toml.write_text(toml.read_text(encoding="utf-8").replace("ticks = 160", 'mode = "realtime"\nticks = 800000'))
        detached = json.loads(self.drivebench("run", str(toml), "--json", "--detach").stdout)
        self.assertEqual(self.drivebench("cancel", str(detached["id"])).returncode, 0)
        self.assertEqual(self.drivebench("fetch", str(detached["id"])).returncode, 1)

    def test_wrong_files_are_told_with_their_lines(self):
        """A wrong file that is sent all the same."""
        self.start("servo")
        toml = self.path / "e.toml"
        toml.write_text('ticks = 160\nsignals = ["u_a_v"]\n[input]\nkind = "volts"\n', encoding="utf-8")
        ran = self.drivebench("run", str(toml))
        self.assertEqual(ran.returncode, 2)
        self.assertIn("e.toml:4: input.kind must be one of none, source, phase_voltages", ran.stderr)
        toml.write_text('ticks = 160\nsignals = ["u_a_v"]\n[input]\nkind = "source"\n', encoding="utf-8")
        ran = self.drivebench("run", str(toml), "--json")
        self.assertEqual(ran.returncode, 1)
        self.assertEqual(json.loads(ran.stdout)["error"]["field"], "input.kind")

    def test_run_goes_on_when_the_connection_breaks(self):
        """A client that gives up or begins anew when the network does."""
        server = self.start("servo")
        proxy = Proxy(server.address)
        self.addCleanup(proxy.close)
        self.link = f"tcp:127.0.0.1:{proxy.port}"
        toml = self.path / "e.toml"
        toml.write_text('ticks = 20000\nsignals = ["u_a_v", "speed_rad_s", "i_a_a"]\n[input]\nkind = "phase_voltages"\n'
                        '[[input.shapes]]\nthree_phase = { amplitude = 80, frequency_hz = 60 }\n', encoding="utf-8")
        out = self.path / "out.csv"
        ran = self.drivebench("run", str(toml), "--json", "--out", str(out))
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertGreater(json.loads(ran.stdout)["resumed"], 1)
        lines = out.read_text(encoding="utf-8").splitlines()[1:]
        self.assertEqual([int(line.split(",")[0]) for line in lines], list(range(20001)))


class Proxy:
    """Passes bytes on and breaks each of its first connections after so many of them."""

    BREAKS = (100, 60_000, 150_000, 250_000)

    def __init__(self, target):
        self.target = target
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.count = 0
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                client, _ = self.listener.accept()
            except OSError:
                return
            limit = self.BREAKS[self.count] if self.count < len(self.BREAKS) else None
            self.count += 1
            server = socket.create_connection(self.target)
            threads = [threading.Thread(target=self.copy, args=way, daemon=True)
                       for way in ((client, server, None), (server, client, limit))]
            threading.Thread(target=self.watch, args=(client, server, threads), daemon=True).start()

    def watch(self, client, server, threads):
        with client, server:
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()

    def copy(self, source, sink, most):
        passed = 0
        try:
            while data := source.recv(4096):
                sink.sendall(data)
                passed += len(data)
                if most is not None and passed > most:
                    break
        except OSError:
            pass
        for end in (source, sink):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def close(self):
        self.listener.close()


if __name__ == "__main__":
    unittest.main()
