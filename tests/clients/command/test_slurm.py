#!/usr/bin/python3
"""`drivebench test --slurm` on a cluster of Slurm with four nodes on this computer."""
import pathlib
import re
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from regression_case import FAILED, OK, USAGE, RegressionTest
    from slurm_cluster import SlurmCluster, missing_daemons
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

# 1000 short cases, of which every tenth fails: the current stands at 0.5 A behind a blocked rotor.
SUITE = """bench = "dc-a-servo"
duration_s = 0.02
[dut]
preset = "book/2.21"
[[step]]
at_s = 0.0
load_nm = 0.0
[[check]]
name = "stays"
kind = "bounds"
signal = "angle_rad"
abs = 0.0035
[matrix]
seed = {from = 1, to = 100}
step.0.load_nm = [0.0, 0.001, 0.002, 0.003, 0.004, 0.005, 0.006, 0.007, 0.008, 0.05]
"""
TASKS = 32


class Slurm(RegressionTest):
    def reports(self, *arguments):
        names = [self.folder / f"report.{kind}" for kind in ("json", "xml", "html")]
        self.run_test(self.folder / "suite", *arguments, "--json", names[0], "--junit", names[1], "--html", names[2], code=FAILED)
        return [name.read_bytes() for name in names]

    def submitted(self, results):
        done = self.run_test(self.folder / "suite", "--results", results, "--slurm", TASKS)
        self.assertIn(f"{TASKS} tasks; then\n", done.stdout)
        return re.match(r"Slurm job (\d+): ", done.stdout)[1]

    def test_an_array_survives_lost_tasks_and_a_lost_node(self):
        """Catches: a script that no Slurm takes, shards that do not fit the array, a result that a killed task leaves behind, work that
        is done again or never, a report that depends on who ran what."""
        self.write("stays.toml", SUITE)
        results = self.folder / "the results"
        results.mkdir()
        cluster_folder = self.folder / "cluster"
        cluster_folder.mkdir()
        with SlurmCluster(cluster_folder) as cluster:
            self.environment = {**self.environment, **cluster.environment}
            job = self.submitted(results)
            state = self.run_test(self.folder / "suite", "--results", results, "--status", code=FAILED).stdout
            self.assertRegex(state, rf"\A\d+ of 1000 cases have a result: .*\nSlurm job {job}: .*\d+ pending")
            cluster.wait_for(lambda: any(results.glob("*.json")), "the first result")
            running, pending = cluster.tasks(job, "RUNNING"), cluster.tasks(job, "PENDING")
            killed = running[:3] + pending[-2:]  # those that wait have no result yet
            self.assertGreaterEqual(len(pending), 2)
            for task in killed:
                if task in running:
                    cluster.ask("scancel", "--signal=KILL", "--full", f"{job}_{task}")
                cluster.ask("scancel", f"{job}_{task}")
            cluster.lose_node("n3")
            cluster.wait_for_end(job)
            state = self.run_test(self.folder / "suite", "--results", results, "--status", code=FAILED).stdout
            self.assertRegex(state, rf"Slurm job {job}( has ended|: \d+ completing)\n")
            before = {file: file.stat().st_mtime_ns for file in results.glob("*.json")}
            self.assertLess(len(before), 1000)
            again = self.submitted(results)
            cluster.wait_for_end(again)
            state = self.run_test(self.folder / "suite", "--results", results, "--status", code=OK).stdout
            self.assertIn("1000 of 1000 cases have a result: 900 passed, 100 failed", state)
        self.assertEqual({file: file.stat().st_mtime_ns for file in before}, before)
        outputs = [file.read_text(encoding="utf-8") for file in results.glob("slurm-*.out")]
        self.assertEqual(len(outputs), TASKS)
        self.assertEqual(self.reports("--merge", results), self.reports("--jobs", 2))

    def test_what_slurm_does_not_take_is_told(self):
        """Catches: an exit code of 0 for a job that was never submitted."""
        self.write("stays.toml", SUITE)
        refusing = self.folder / "refusing/sbatch"
        refusing.parent.mkdir()
        refusing.write_text("#!/bin/sh\necho 'sbatch: error: invalid partition' >&2\nexit 1\n", encoding="utf-8")
        refusing.chmod(0o755)
        self.environment = {**self.environment, "PATH": f"{refusing.parent}:/usr/bin:/bin"}
        done = self.run_test(self.folder / "suite", "--results", self.folder / "results", "--slurm", 4, code=USAGE)
        self.assertIn("sbatch has not taken", done.stderr)
        self.environment = {**self.environment, "PATH": "/nowhere"}
        done = self.run_test(self.folder / "suite", "--results", self.folder / "results", "--slurm", 4, code=USAGE)
        self.assertIn("this machine has no sbatch", done.stderr)
        self.run_test(self.folder / "suite", "--slurm", 4, code=USAGE)
        self.run_test(self.folder / "suite", "--results", self.folder / 'a"b', "--slurm", 4, code=USAGE)


if __name__ == "__main__":
    if missing_daemons():
        print(f"skipped: there is no {missing_daemons()[0]}")
        sys.exit(77)
    unittest.main()
