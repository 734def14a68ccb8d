"""Programs that this project did not write read its recordings and speak its protocol."""
import csv
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

TESTS = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from wire_client import BENCHES, SERVER, Server, pb
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

DRIVEBENCH = SERVER.parent / "drivebench"
EXAMPLES = TESTS.parent / "clients/python/examples"
LOAD = "\n[[axis.load]]\nat_s = 0.1\nload_nm = -0.02\nramp_s = 0.05\n"


def run(*command, **options):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300, **options)


class Recordings(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.temporary.name)
        self.addCleanup(self.temporary.cleanup)

    def install_mcap_core(self):
        package = self.folder / "mcap_core"
        shutil.copytree(TESTS / "peers/recording/mcap_core", package, ignore=shutil.ignore_patterns("node_modules"))
        installed = run("npm", "ci", "--no-audit", "--no-fund", cwd=package)
        if installed.returncode != 0:
            self.skipTest(f"npm cannot install @mcap/core: {installed.stderr.strip().splitlines()[-1:]}")
        return package / "read_recording.mjs"

    def test_mcap_core_reads_our_recordings(self):
        """Catches: a file that only our own reader understands; wrong counts, times or schemas; a sample that protobuf or
        the CSV export reads differently from the recorder."""
        reader = self.install_mcap_core()
        recording = self.folder / "run.mcap"
        text = (BENCHES / "servo.toml").read_text(encoding="utf-8") + LOAD
        text = text.replace("../motors/", f"{BENCHES.parent / 'motors'}/")
        with Server("--mode", "free", "--duration", "1", "--record", str(recording), text=text) as server:
            server.process.wait(timeout=60)
        read = run("node", reader, recording)
        self.assertEqual(read.returncode, 0, read.stderr)
        found = json.loads(read.stdout)

        self.assertEqual([s["name"] for s in found["schemas"]],
                         ["drivebench.v1.Sample", "drivebench.v1.Input", "drivebench.v1.Verdict"])
        channels = {c["topic"]: c for c in found["channels"]}
        self.assertEqual(channels["/servo/sample"]["messages"], 8001)
        self.assertEqual(channels["/servo/sample"]["last_log_time"], str(10**9))
        self.assertEqual(channels["/inputs"]["messages"], 1)
        self.assertEqual([a["name"] for a in found["attachments"]], ["bench.toml"])

        last = pb.Sample.FromString(bytes.fromhex(found["last"]["/servo/sample"]))
        self.assertEqual(last.tick, 8000)
        self.assertAlmostEqual(last.load_nm, -0.02)
        self.assertGreater(last.speed_rad_s, 50.0)  # 0.02 N m on 1.1e-4 kg m^2 for most of a second
        verdict = pb.Verdict.FromString(bytes.fromhex(found["last"]["/verdict"]))
        self.assertTrue(verdict.exact)
        self.assertEqual(verdict.ticks, 8000)

        exported = run(DRIVEBENCH, "export", recording, "--out", self.folder / "run.csv")
        self.assertEqual(exported.returncode, 0, exported.stderr)
        with open(self.folder / "run.csv", newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
        names = [column.split(" ")[0] for column in rows[0]]
        self.assertEqual(len(rows), 1 + 8001)
        row = dict(zip(names, rows[-1]))
        for field in pb.Sample.DESCRIPTOR.fields:
            if field.name in row:
                self.assertEqual(float(row[field.name]), float(getattr(last, field.name)), field.name)
        self.assertIn("speed_rad_s", row)


class Protocol(unittest.TestCase):
    def test_the_python_example_turns_the_motor(self):
        """Catches: a wire that only our own client speaks, and an example that no longer works."""
        example = EXAMPLES / "open_loop_start.py"
        self.assertLessEqual(len(example.read_text(encoding="utf-8").splitlines()), 40)
        with Server() as server:
            ran = run("/usr/bin/python3", example, "%s:%d" % server.address)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        speed_rad_s = float(ran.stdout.splitlines()[-1].split("rad/s")[0].split()[-1])
        self.assertAlmostEqual(speed_rad_s, 2 * 3.14159 * 20 / 3, delta=1.0)  # 20 Hz, three pole pairs, little slip


if __name__ == "__main__":
    unittest.main(verbosity=2)
