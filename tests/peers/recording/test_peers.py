"""Programs that this project did not write read its recordings and speak its protocol."""
import csv
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

TESTS = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    import can
    import h5py
    import npm_package
    from mdf_file import MdfFile
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
        npm_package.install(TESTS / "peers/recording/mcap_core", package)
        return package / "read_recording.mjs"

    def test_mcap_core_reads_our_recordings(self):
        """Catches: a file that only our own reader understands; wrong counts, times, schemas or units; a sample that protobuf
        or the CSV export reads differently from the recorder."""
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
        units = channels["/servo/sample"]["metadata"]
        self.assertEqual(set(units), {f"unit.{field.name}" for field in pb.Sample.DESCRIPTOR.fields})
        self.assertEqual((units["unit.speed_rad_s"], units["unit.tick"]), ("rad/s", "1"))
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

    def test_mcap_core_and_our_programs_read_the_view_of_a_scope(self):
        """Catches: an index or a length that only the page's own reader takes, a schema that does not fit its samples, other topics, times or
        units than those of a recording, a view that passes for a whole run."""
        page = SERVER.parents[1] / "clients/web/page"
        if not (page / "src/bench_messages.js").exists():
            self.skipTest("the page is not built")
        view = self.folder / "view.mcap"
        made = run("node", TESTS / "web/page/view_file.mjs", view,
                   env={**os.environ, "PAGE_SOURCES": str(page / "src"), "PAGE_PACKAGES": str(page / "node_modules")})
        self.assertEqual(made.returncode, 0, made.stderr[-500:])
        read = run("node", self.install_mcap_core(), view)
        self.assertEqual(read.returncode, 0, read.stderr)
        found = json.loads(read.stdout)
        self.assertEqual([(each["topic"], each["messages"], each["first_log_time"], each["last_log_time"]) for each in found["channels"]],
                         [(f"/{axis}/sample", 40_000, "125000000", "5124875000") for axis in ("one", "two")])
        self.assertEqual(found["channels"][0]["metadata"], {"unit.tick": "1", "unit.speed_rad_s": "rad/s", "unit.faults": "bits"})
        last = pb.Sample.FromString(bytes.fromhex(found["last"]["/one/sample"]))
        self.assertEqual((last.tick, last.speed_rad_s, last.faults), (40_999, 40_999 / 8, 1))
        exported = run(DRIVEBENCH, "export", view, "--axis", "two", "--signals", "encoder_count", "--out", self.folder / "two.csv")
        self.assertEqual((exported.returncode, "it holds no verdict" in exported.stderr), (3, True), exported.stderr)
        with open(self.folder / "two.csv", newline="", encoding="utf-8") as file:
            self.assertEqual(list(csv.reader(file))[-1], ["40999", "5.124875000", "-40999"])
        replayed = run(DRIVEBENCH, "replay", view)
        self.assertNotEqual(replayed.returncode, 0)
        self.assertIn("it has no configuration inside", replayed.stdout + replayed.stderr)

    def test_foreign_readers_find_the_wall_time(self):
        """Catches: metadata that @mcap/core does not find or reads otherwise, a start of the MDF file in other units, a column
        `unix_ns` that a double has rounded, a trace whose lines python-can does not take."""
        recording = self.folder / "run.mcap"
        with Server("--mode", "realtime", "--duration", "0.2", "--record", str(recording)) as server:
            server.process.wait(timeout=60)
        for name in ("run.mat", "run.mf4"):
            kind = {"mat": "mat", "mf4": "mdf"}[name[4:]]
            done = run(DRIVEBENCH, "export", recording, "--format", kind, "--out", self.folder / name, "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
        epoch = json.loads(done.stdout)["epoch_unix_ns"]
        times = [epoch + tick * 125_000 for tick in range(1601)]
        mdf = MdfFile(self.folder / "run.mf4")
        self.assertEqual((mdf.start_ns, mdf.columns["unix_ns"], mdf.units["unix_ns"]), (epoch, times, "ns"))
        with h5py.File(self.folder / "run.mat", "r") as file:
            self.assertEqual(file["unix_ns"].attrs["MATLAB_class"], b"int64")
            self.assertEqual([int(value) for value in file["unix_ns"][0]], times)
            self.assertEqual([float(value) for value in file["time_s"][0]], mdf.columns["time_s"])
        done = run(DRIVEBENCH, "export", recording, "--format", "candump", "--out", self.folder / "run.log")
        self.assertEqual(done.returncode, 0, done.stderr)
        frames = list(can.CanutilsLogReader(str(self.folder / "run.log")))
        self.assertGreater(len(frames), 1600)
        self.assertAlmostEqual(frames[0].timestamp, epoch / 1e9, delta=2e-6)
        self.assertAlmostEqual(frames[-1].timestamp, times[-1] / 1e9, delta=2e-6)
        read = run("node", self.install_mcap_core(), recording)
        self.assertEqual(read.returncode, 0, read.stderr)
        base = json.loads(read.stdout)["metadata"]["drivebench.time_base"]
        self.assertEqual((base["epoch_unix_ns"], base["since_tick"]), (str(epoch), "0"))


class Tables(unittest.TestCase):
    """Exports of a run, against its CSV."""

    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = pathlib.Path(temporary.name)
        cls.recording = cls.folder / "run.mcap"
        text = (BENCHES / "servo.toml").read_text(encoding="utf-8") + LOAD
        text = text.replace("../motors/", f"{BENCHES.parent / 'motors'}/")
        with Server("--mode", "free", "--duration", "1.2", "--record", str(cls.recording), text=text) as server:
            server.process.wait(timeout=60)
        cls.export("csv", "run.csv")
        with open(cls.folder / "run.csv", newline="", encoding="utf-8") as file:
            header, *rows = list(csv.reader(file))
        cls.units = {column.split(" ")[0]: column.partition("[")[2].rstrip("]") for column in header}
        cls.rows = [[float(value) for value in row] for row in rows]
        cls.names = list(cls.units)

    @classmethod
    def export(cls, kind, name, *arguments):
        done = run(DRIVEBENCH, "export", cls.recording, "--format", kind, "--out", cls.folder / name, *arguments)
        if done.returncode != 0:
            raise AssertionError(done.stderr)
        return cls.folder / name

    def column(self, name):
        place = self.names.index(name)
        return [row[place] for row in self.rows]

    def test_hdf5_reads_the_matlab_file(self):
        """Catches: a column that lost rows where its pieces meet, a transposed vector, a rounded value, a lost sign or
        unit."""
        with h5py.File(self.export("mat", "run.mat"), "r") as file:
            self.assertEqual(set(file) - {"#refs#", "units"}, set(self.names))
            for name in self.names:
                self.assertEqual(file[name].shape, (1, 9601), name)
                self.assertEqual([float(value) for value in file[name][0]], self.column(name), name)
                unit = "".join(map(chr, file["units"][name][:, 0]))
                self.assertEqual(unit, self.units[name] or {"tick": "1", "time_s": "s"}[name], name)
            self.assertEqual(file["encoder_count"].attrs["MATLAB_class"], b"int64")
            self.assertEqual(file["speed_rad_s"].attrs["MATLAB_class"], b"double")
        self.assertEqual((self.folder / "run.mat").read_bytes()[:10], b"MATLAB 7.3")

    def test_a_strict_reader_reads_the_mdf_file(self):
        """Catches: a block that the standard forbids, a record that is shifted, a count that was not written at the end."""
        mdf = MdfFile(self.export("mdf", "run.mf4"))
        self.assertEqual((mdf.name, mdf.master, mdf.cycles), ("servo", "time_s", 9601))
        self.assertEqual(set(mdf.columns), set(self.names))
        for name in self.names:
            self.assertEqual([float(value) for value in mdf.columns[name]], self.column(name), name)
        self.assertEqual((mdf.units["speed_rad_s"], mdf.units["time_s"]), ("rad/s", "s"))
        self.assertEqual(mdf.start_ns, 0, "a free run has no time of day")

    def test_tables_of_chosen_signals_and_ticks(self):
        """Catches: --signals, --from and --to that only CSV obeys, a column that stands there twice."""
        chosen = ("--signals", "tick,i_a_a", "--from", "10", "--to", "12")
        mdf = MdfFile(self.export("mdf", "few.mf4", *chosen))
        self.assertEqual((list(mdf.columns), mdf.columns["tick"]), (["time_s", "tick", "i_a_a"], [10, 11, 12]))
        with h5py.File(self.export("mat", "few.h5", *chosen), "r") as file:
            self.assertEqual(list(file["tick"][0]), [10, 11, 12])
            self.assertEqual(set(file) - {"#refs#", "units"}, {"tick", "time_s", "i_a_a"})

    def test_wrong_lines_are_refused_in_words(self):
        """Catches: binary data on a terminal, and a file whose name promises another format."""
        for arguments, sentence in ((("--format", "mat"), "--format mat needs --out FILE"),
                                    (("--format", "mdf", "--out", "a.mat"), "must end with .mf4"),
                                    (("--format", "mat", "--out", "a.csv"), "must end with .mat, .h5"),
                                    (("--format", "mat", "--out", "none/a.mat"), "cannot write none/a.mat"),
                                    (("--format", "mdf", "--out", "none/a.mf4"), "cannot write none/a.mf4")):
            done = run(DRIVEBENCH, "export", self.recording, *arguments, cwd=self.folder)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(sentence, done.stderr)


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
