#!/usr/bin/python3
"""Recordings in several files, and files that other programs remove or move."""
import csv
import json
import os
import pathlib
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
from recording import Recording
from wire_client import BENCHES, PATIENCE_S, SERVER, guarded
from wire_test import WireTest, until

DRIVEBENCH = SERVER.with_name("drivebench")


class Series(WireTest):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="drivebench-series-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def run_of(self, *command):
        return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, cwd=self.folder, env=guarded(os.environ),
                              check=False)

    def recorded(self, *options, duration_s=1.5):
        """A free run; the names of its files."""
        done = self.run_of(SERVER, BENCHES / "servo.toml", "--port", "0", "--mode", "free", "--duration", str(duration_s),
                           "--record", "run.mcap", *options)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return sorted(file.name for file in self.folder.glob("*.mcap"))

    def replayed(self, name, code=0):
        done = self.run_of(SERVER, "--replay", name, "--json")
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return json.loads(done.stdout)

    def test_rec_11_a_run_in_four_files_is_one_run(self):
        """Catches: files that replay, export or compare only one by one, or the first file taken for all."""
        self.assertEqual(self.recorded("--record-file-s", "0.5"), ["run.2.mcap", "run.3.mcap", "run.4.mcap", "run.mcap"])
        report = self.replayed("run.mcap")
        self.assertEqual((report["equal"], report["ticks"], report["samples"], report["same_build"]), (True, 12_000, 12_001, True))
        self.assertIn("file 2 of a recording", self.replayed("run.2.mcap", code=2)["problem"])
        done = self.run_of(DRIVEBENCH, "export", "run.mcap", "--signals", "speed_rad_s", "--out", "run.csv")
        self.assertEqual(done.returncode, 0, done.stderr)
        with open(self.folder / "run.csv", encoding="utf-8") as file:
            ticks = [int(row[0]) for row in list(csv.reader(file))[1:]]
        self.assertEqual(ticks, list(range(12_001)))
        (self.folder / "run.4.mcap").unlink()
        self.assertIn("verdict", self.replayed("run.mcap", code=3)["problem"])
        (self.folder / "run.2.mcap").write_bytes((self.folder / "run.2.mcap").read_bytes()[:-200])
        self.assertEqual(self.run_of(DRIVEBENCH, "export", "run.mcap", "--out", "cut.csv").returncode, 3)

    def test_rec_11_a_file_ends_at_its_mebibyte(self):
        """Catches: a limit in MiB that is taken for bytes, or ignored."""
        names = self.recorded("--record-file-mib", "1", duration_s=20.0)
        self.assertGreaterEqual(len(names), 3)
        for name in names:
            self.assertLess((self.folder / name).stat().st_size, 3 << 20, "with the chunk that reaches the limit")
        self.assertTrue(self.replayed("run.mcap")["equal"])

    def test_rec_12_another_build_is_reported(self):
        """Catches: a replay that differs because the build does, and blames the recording."""
        self.recorded()
        done = self.run_of(SERVER, "--replay", "run.mcap")
        self.assertNotIn("not by this build", done.stdout)
        data = bytearray((self.folder / "run.mcap").read_bytes())
        at = data.index(b"drivebench ", data.index(b"drivebench") + 1)  # in the header, behind the profile
        data[at + 11] = ord("z")
        for opcode_at in (data.rindex(b"\x0f\x04\0\0\0\0\0\0\0"),):  # the checksum of the data section: not given
            data[opcode_at + 9:opcode_at + 13] = bytes(4)
        (self.folder / "other.mcap").write_bytes(data)
        done = self.run_of(SERVER, "--replay", "other.mcap")
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIn("not by this build", done.stdout)

    def test_os_13_a_refusal_names_the_process_that_holds_the_place(self):
        """Catches: a refusal that does not name the process in the way; a second server that waits, or serves."""
        file, kept = self.folder / "run.mcap", self.folder / "kept"
        server = self.server("--record", str(file), "--experiments", str(kept), unix=True)
        for taken in (("--port", str(server.address[1])), ("--port", "0", "--record", file), ("--port", "0", "--experiments", kept),
                      ("--port", "0", "--unix", server.unix_path)):
            with self.subTest(taken=taken):
                done = self.run_of(SERVER, BENCHES / "servo.toml", *taken)
                self.assertEqual(done.returncode, 2)
                self.assertRegex(done.stderr, rf"process {server.process.pid}\b")
                self.assertEqual(done.stdout, "")
        self.assertEqual(self.client(server, unix=True).status().sessions, 1, "the first server goes on")
        self.assertEqual(server.stop(), 0)


class Watched(WireTest):
    """Other programs change a recording while a server writes it."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="drivebench-watched-")
        self.addCleanup(folder.cleanup)
        self.file = pathlib.Path(folder.name) / "run.mcap"

    def recording(self, mode):
        """A server in this mode that has written a chunk, and a client of it."""
        server = self.server("--mode", mode, "--record", str(self.file))
        client = self.client(server)
        if mode == "lockstep":
            client.lease()
            for tick in range(900):
                client.step(tick, 1.0)
        until(lambda: Recording(self.file.read_bytes()).messages.get("/servo/sample", 0) >= 800, "the recorder writes")
        return server, client

    def assertNoted(self, client, *facts):
        def found():
            notes = " ".join(client.status().notes)
            return all(fact in notes for fact in facts)
        until(found, f"the status says {facts}")

    def test_rec_13_a_removed_or_emptied_recording_is_no_success(self):
        """Catches: "recorded in", 0 gaps and exit code 0 for a recording that is gone."""
        for mode in ("realtime", "lockstep"):
            for act, said in ((self.remove, "another program removed it"),
                              (self.empty, "another program emptied or changed it")):
                with self.subTest(mode=mode, said=said):
                    server, client = self.recording(mode)
                    act()
                    self.assertNoted(client, "run.mcap", said)
                    status = client.status()
                    self.assertGreaterEqual(status.recording_gaps, 800)
                    self.assertEqual(status.recording, str(self.file.with_name("run.2.mcap")))
                    self.assertEqual(server.stop(), 1)
                    self.assertIn(said, server.verdict["sentence"])
                    self.assertFalse(server.verdict["exact"])
                    self.assertEqual(server.verdict["recording"], str(self.file.with_name("run.2.mcap")))
                for file in self.file.parent.iterdir():
                    file.unlink()

    def test_rec_13_a_recording_that_is_removed_at_the_end_is_no_success(self):
        """Catches: a last look before the last write."""
        server, _ = self.recording("lockstep")
        self.remove()
        self.assertEqual(server.stop(), 1)
        self.assertEqual(server.verdict["recording"], "")
        self.assertIn("another program removed it", server.verdict["sentence"])

    def test_rec_13_a_moved_recording_is_reported_under_its_new_name(self):
        """Catches: a moved file that counts as lost, or is reported where it is no more."""
        server, client = self.recording("realtime")
        moved = self.file.with_name("kept.mcap")
        self.file.rename(moved)
        self.assertNoted(client, f"another program moved it to {moved}")
        self.assertEqual(client.status().recording, str(moved))
        self.assertEqual(server.stop(), 0)
        self.assertEqual(server.verdict["recording"], str(moved))
        done = subprocess.run([SERVER, "--replay", moved], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, 0, done.stdout)

    def remove(self):
        self.file.unlink()

    def empty(self):
        os.truncate(self.file, 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
