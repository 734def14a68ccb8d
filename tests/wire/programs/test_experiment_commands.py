#!/usr/bin/python3
"""The subcommands of `drivebench experiment` against the real server."""
import json
import os
import pathlib
import re
import signal
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

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import BENCHES, PATIENCE_S, REPOSITORY, SERVER
from wire_test import WireTest, until

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

    def popen(self, *words, owner=OWNER, **variables):
        environment = dict(os.environ, DRIVEBENCH_LINK=self.link, XDG_CONFIG_HOME=self.folder.name) | variables
        environment.pop("DRIVEBENCH_OWNER", None)
        more = ["--owner", owner] if owner else []
        process = subprocess.Popen([str(SERVER.parent / "drivebench"), "experiment", *words, *more], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True, env=environment, cwd=self.path)
        self.addCleanup(process.kill)
        return process

    def drivebench(self, *words, **more):
        process = self.popen(*words, **more)
        out, err = process.communicate(timeout=PATIENCE_S * 2)
        return subprocess.CompletedProcess(words, process.returncode, out, err)

    def test_the_examples_run(self):
        """Catches: an example that its bench refuses, or whose results miss their purpose."""
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
        """Catches: a subcommand that does not do its work, or exits with 0 after a failure."""
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
        for words in (("fetch", str(number)), ("run", str(toml))):
            refused = self.drivebench(*words, "--out", "data.parquet")
            self.assertEqual((refused.returncode, (self.path / "data.parquet").exists()), (2, False))
            self.assertIn("data.parquet: the name must end with .csv, .txt, .mcap", refused.stderr)
        toml.write_text(toml.read_text(encoding="utf-8").replace("ticks = 160", 'mode = "realtime"\nticks = 800000'))
        detached = json.loads(self.drivebench("run", str(toml), "--json", "--detach").stdout)
        self.assertEqual(self.drivebench("cancel", str(detached["id"])).returncode, 0)
        self.assertEqual(self.drivebench("fetch", str(detached["id"])).returncode, 1)

    def test_a_fetch_that_fails_leaves_the_file_alone(self):
        """Catches: an existing file that is emptied because the server is down, or does not know the number."""
        server = self.start("servo")
        old = {self.path / name: b"precious" for name in ("old.csv", "old.mcap")}
        for path, data in old.items():
            path.write_bytes(data)
            self.assertEqual(self.drivebench("fetch", "7", "--out", str(path)).returncode, 1)
        server.stop()
        for path in old:
            self.assertEqual(self.drivebench("fetch", "1", "--out", str(path), "--patience", "0").returncode, 3)
        self.assertEqual({path: path.read_bytes() for path in old}, old)

    def test_an_interrupted_fetch_ends_and_the_experiment_goes_on(self):
        """Catches: ctrl-C of a fetch that also ends the experiment, whatever message it was reading: rows, or how far it is in the queue."""
        self.start("servo")
        toml = self.path / "e.toml"
        toml.write_text('mode = "realtime"\nduration_s = 110.0\nsignals = ["u_a_v"]\n[input]\nkind = "none"\n', encoding="utf-8")
        number = str(json.loads(self.drivebench("run", str(toml), "--json", "--detach").stdout)["id"])
        for name in ("part.csv", "part.mcap"):
            fetching = self.popen("fetch", number, "--out", name)
            until(lambda: catches(signal.SIGINT, fetching), "the program handles the signal")
            until(lambda: (self.path / "part.csv").exists(), "rows come")  # a recording comes at the end only
            fetching.send_signal(signal.SIGINT)
            _, said = fetching.communicate(timeout=PATIENCE_S)
            self.assertEqual(fetching.returncode, 1, said)
            self.assertIn(f"experiment {number} is not cancelled", said)
        behind = str(json.loads(self.drivebench("run", str(toml), "--json", "--detach").stdout)["id"])
        fetching = self.popen("fetch", behind, "--out", "behind.csv")
        until(lambda: catches(signal.SIGINT, fetching), "the program handles the signal")
        fetching.send_signal(signal.SIGINT)
        _, said = fetching.communicate(timeout=PATIENCE_S)
        self.assertIn(f"experiment {behind} is not cancelled", said)
        states = [e["state"] for e in json.loads(self.drivebench("list", "--json").stdout)["experiments"]]
        self.assertEqual(states, ["running", "queued"])
        lines = (self.path / "part.csv").read_text(encoding="utf-8").splitlines()
        self.assertEqual([int(line.split(",")[0]) for line in lines[1:]], list(range(len(lines) - 1)))
        for each in (behind, number):
            self.assertEqual(self.drivebench("cancel", each).returncode, 0)

    def test_the_secret_of_a_user_is_kept_in_the_folder_of_settings(self):
        """Catches: an empty variable that puts the secret into the current folder."""
        self.start("servo")
        for variables, place in (({"XDG_CONFIG_HOME": "", "HOME": f"{self.path}/home"}, "home/.config/drivebench/owner"),
                                 ({"XDG_CONFIG_HOME": f"{self.path}/xdg", "HOME": ""}, "xdg/drivebench/owner")):
            self.assertEqual(self.drivebench("list", owner=None, **variables).returncode, 0)
            self.assertRegex((self.path / place).read_text(encoding="utf-8"), r"^[0-9a-f]{32}\n$")
            self.assertEqual((self.path / place).stat().st_mode & 0o777, 0o600)
        refused = self.drivebench("list", owner=None, XDG_CONFIG_HOME="", HOME="")
        self.assertEqual(refused.returncode, 2)
        self.assertIn("--owner is needed", refused.stderr)
        self.assertFalse((self.path / "drivebench").exists() or (self.path / ".config").exists())

    def test_wrong_files_are_reported_with_their_lines(self):
        """Catches: a wrong file that is sent."""
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
        """Catches: a client that gives up or begins anew when its connection breaks."""
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


def catches(number, process):
    caught = re.search(r"^SigCgt:\s*([0-9a-f]+)$", pathlib.Path(f"/proc/{process.pid}/status").read_text(), re.M)
    return int(caught[1], 16) >> (number - 1) & 1 == 1


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
    unittest.main(verbosity=2)
