#!/usr/bin/python3
"""Recordings on the command line, the server program and the demo: their output and their exit codes."""
import json
import os
import pathlib
import re
import signal
import struct
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
from command_test import (
    CUT_SHORT, DRIVEBENCH, FAILED, NO_CONNECT, OK, SERVO, TOO_LATE, USAGE, CommandTest, environment, link_of, until)
from recording import Recording
from wire_client import PATIENCE_S, REPOSITORY, SERVER, Server


def without_checksums(recording):
    """The same file without checksums (0), so that only a comparison of the samples finds a change."""
    data, at = bytearray(recording), 8
    while at < len(data) - 8:
        opcode, (size,) = data[at], struct.unpack_from("<Q", data, at + 1)
        for kind, place in ((0x06, 9 + 24), (0x0F, 9), (0x02, 9 + 16)):  # chunk, end of the data, footer
            if opcode == kind:
                data[at + place:at + place + 4] = bytes(4)
        at += 9 + size
    return data


class Recordings(CommandTest):
    @classmethod
    def setUpClass(cls):
        cls.made = tempfile.TemporaryDirectory(prefix="drivebench-recordings-")
        cls.whole = pathlib.Path(cls.made.name) / "whole.mcap"
        with Server("--record", str(cls.whole)) as bench:
            subprocess.run([DRIVEBENCH, "control"], env=environment(link_of(bench)), check=True, capture_output=True)
            assert bench.stop() == 0
            cls.hash = bench.verdict["state_hash"]

    @classmethod
    def tearDownClass(cls):
        cls.made.cleanup()

    def written(self, name, data):
        (self.folder / name).write_bytes(data)
        return name

    def test_replay_of_a_recording_is_equal(self):
        """Catches: a replay that compares nothing."""
        self.assertSays(self.drivebench("replay", self.whole).stdout, "equal, bit for bit (1024 ticks, 1025 samples", self.hash)
        found = self.json_of("replay", self.whole)
        self.assertKeys(found, "equal", "usable", "ticks", "samples", "inputs", "state_hash", "recorded_by", "same_build",
                        "problem")
        self.assertEqual((found["equal"], found["ticks"], found["state_hash"]), (True, 1024, self.hash))

    def test_replay_of_a_flipped_bit_is_1_and_names_the_tick(self):
        """Catches: a comparison with a tolerance, or one of the last sample only."""
        data = without_checksums(self.whole.read_bytes())
        self.assertEqual(self.json_of("replay", self.written("bare.mcap", data))["state_hash"], self.hash)
        wanted = next(row.split(",") for row in self.drivebench(
            "export", self.whole, "--signals", "speed_rad_s", "--from", "500", "--to", "500").stdout.splitlines()[1:])
        at = data.find(struct.pack("<d", float(wanted[2])))
        data[at] ^= 1  # the lowest bit of the speed at tick 500
        self.written("flipped.mcap", data)
        said = self.drivebench("replay", "flipped.mcap", code=FAILED).stdout
        self.assertSays(said, "DIFFERENT", "tick 500: servo.speed_rad_s was recorded as")
        difference = self.json_of("replay", "flipped.mcap", code=FAILED)["first_difference"]
        self.assertEqual((difference["tick"], difference["axis"], difference["signal"]), (500, "servo", "speed_rad_s"))

    def test_replay_of_a_damaged_file_is_2_and_of_a_cut_one_3(self):
        """Catches: a recording that lost its end or its checksum, and passes; one without its end that counts as damaged."""
        whole = bytearray(self.whole.read_bytes())
        cut = self.written("cut.mcap", whole[:-100])
        self.assertSays(self.drivebench("replay", cut, code=CUT_SHORT).stdout, "equal up to tick 1024; the recording has no end",
                        "the file ends")
        whole[len(whole) // 2] ^= 0x10
        damaged = self.written("damaged.mcap", whole)
        self.assertSays(self.drivebench("replay", damaged, code=USAGE).stdout, "CRC32")
        self.assertFalse(self.json_of("replay", damaged, code=USAGE)["usable"])
        self.drivebench("replay", self.written("text", b"tick,time\n"), code=USAGE)
        self.drivebench("replay", self.written("empty", b""), code=USAGE)

    def test_export_writes_every_sample_with_units(self):
        """Catches: a missing first or last row, a value that does not read back equal."""
        head, *rows = self.drivebench("export", self.whole).stdout.splitlines()
        self.assertSays(head, "tick,time_s,", "i_a_a [A]", "speed_rad_s [rad/s]", "torque_nm [N*m]")
        self.assertEqual([int(row.split(",")[0]) for row in rows], list(range(1025)))
        self.assertEqual(rows[-1].split(",")[1], "0.128000000")

    def test_export_chooses_signals_ticks_axis_and_file(self):
        """Catches: a range that is open at one end, a column in another order than requested."""
        done = self.json_of("export", self.whole, "--signals", "u_b_v,tick", "--from", "10", "--to", "12", "--axis", "servo",
                            "--out", "out.csv")
        self.assertEqual(done, {"out": "out.csv", "axis": "servo", "rows": 3, "problem": ""})
        head, *rows = (self.folder / "out.csv").read_text(encoding="utf-8").splitlines()
        self.assertEqual(head, "tick,time_s,u_b_v [V],tick [1]")
        self.assertEqual([row.split(",")[3] for row in rows], ["10", "11", "12"])
        self.assertSays(self.drivebench("export", self.whole, "--out", "all.csv").stdout, "1025 samples of axis servo to all.csv")

    def test_export_of_an_unknown_axis_is_2(self):
        """Catches: output of the other axes' commands, without a sample."""
        for form in ("csv", "candump"):
            self.assertSays(self.drivebench("export", self.whole, "--format", form, "--axis", "none", code=USAGE).stderr,
                            "no samples of axis 'none'; the recording has servo")

    def test_export_of_a_cut_recording_writes_its_samples_and_ends_with_3(self):
        """Catches: a crash that costs the samples before it, or that the exit code hides."""
        cut = self.written("cut.mcap", self.whole.read_bytes()[:-100])
        done = self.drivebench("export", cut, "--out", "cut.csv", code=CUT_SHORT)
        self.assertSays(done.stderr, "the recording is not whole", "the file ends")
        self.assertEqual(len((self.folder / "cut.csv").read_text(encoding="utf-8").splitlines()), 1026)
        found = self.json_of("export", cut, "--out", "cut.csv", code=CUT_SHORT)
        self.assertEqual(found["rows"], 1025)
        self.assertNotEqual(found["problem"], "")

    def test_rec_01_a_killed_server_leaves_a_recording_that_can_be_exported(self):
        """Catches: samples that wait in memory for an end that does not come."""
        bench = self.server("--record", str(self.folder / "killed.mcap"))
        self.drivebench("control", link=link_of(bench))
        until(lambda: (self.folder / "killed.mcap").stat().st_size > 150_000, "the samples reach the file")
        bench.process.kill()
        bench.process.wait()
        self.assertGreater(self.json_of("export", "killed.mcap", "--out", "k.csv", code=CUT_SHORT)["rows"], 500)
        self.assertRegex(self.drivebench("replay", "killed.mcap", code=CUT_SHORT).stdout,
                         r"equal up to tick \d+; the recording has no end")

    def test_rec_01_a_killed_server_loses_the_configured_chunk_at_most(self):
        """Catches: a chunk that the option does not change; a replay that refuses what a killed server left."""
        for chunk_ms, last in ((100, 799), (5, 999)):
            file = self.folder / f"{chunk_ms}.mcap"
            bench = self.server("--record", str(file), "--record-chunk-ms", str(chunk_ms))
            self.drivebench("control", link=link_of(bench))  # 1024 ticks
            until(lambda at=file, n=last: Recording(at.read_bytes()).messages.get("/servo/sample", 0) > n, "they are written")
            bench.process.kill()
            bench.process.wait()
            found = self.json_of("replay", file, code=CUT_SHORT)
            self.assertEqual((found["equal"], found["usable"], found["ends_early"], found["ticks"]), (False, True, True, last))

    def test_export_refuses_before_it_overwrites(self):
        """Catches: a file that a mistake on the command line empties: once, the recording itself. A range without
        samples."""
        copy = self.written("copy.mcap", self.whole.read_bytes())
        self.written("precious.csv", b"tick\n")
        self.written("text", b"tick,time\n")
        for arguments, fact in (((copy, "--out", copy), "the recording itself"),
                                ((copy, "--out", f"./{copy}"), "the recording itself"),
                                (("text", "--out", "precious.csv"), "is not a recording"),
                                ((copy, "--out", "precious.csv", "--signals", "volts"), "no signal 'volts'"),
                                ((copy, "--out", "precious.csv", "--axis", "second"), "the recording has servo"),
                                ((copy, "--out", "precious.csv", "--format", "candump", "--axis", "second"), "has servo"),
                                ((copy, "--out", "precious.csv", "--from", "10", "--to", "5"), "--from 10 is behind --to 5"),
                                ((copy, "--out", "precious.parquet"), "precious.parquet: the name must end with .csv, .txt"),
                                ((copy, "--out", "none/out.csv"), "cannot write")):
            self.assertSays(self.json_of("export", *arguments, code=USAGE)["error"]["message"], fact)
        self.assertEqual((self.folder / copy).read_bytes(), self.whole.read_bytes())
        self.assertEqual((self.folder / "precious.csv").read_bytes(), b"tick\n")


class Serving(CommandTest):
    def ready(self, process):
        line = process.stdout.readline()
        self.assertSays(line, "ready tcp=127.0.0.1:", "mode=")
        return "tcp:" + line.split("tcp=")[1].split()[0]

    def end(self, process, number=signal.SIGTERM):
        process.send_signal(number)
        out, _ = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, OK)
        return out

    def test_serve_starts_a_bench_and_ends_it_on_a_signal(self):
        """Catches: a server that is left behind as an orphan, or a signal that the shell takes for a failure."""
        for number in (signal.SIGTERM, signal.SIGINT):
            serving = self.start(DRIVEBENCH, "serve", "--port", "0")
            link = self.ready(serving)
            self.assertSays(self.drivebench("status", link=link).stdout, "bench servo", "lockstep")
            self.drivebench("control", link=link)
            self.assertSays(self.end(serving, number), "lockstep exact: 1024 ticks; state hash ")
            self.drivebench("status", link=link, code=NO_CONNECT)

    def test_serve_takes_a_name_or_a_file_and_the_options_of_the_server(self):
        """Catches: options that stop at the first one that drivebench does not know."""
        serving = self.start(DRIVEBENCH, "serve", "servo-realtime", "--port", "0", "--mode", "free")
        self.assertSays(self.drivebench("status", link=self.ready(serving)).stdout, "bench servo-realtime", "free")
        self.end(serving)
        serving = self.start(DRIVEBENCH, "serve", SERVO, "--port=0", "--unix", self.folder / "s", "--record", "r.mcap")
        self.ready(serving)
        self.drivebench("status", link=f"unix:{self.folder}/s")
        self.assertSays(self.end(serving), "recorded in r.mcap")
        self.drivebench("replay", "r.mcap")

    def test_os_13_a_second_server_on_the_same_place_is_2(self):
        """Catches: two servers that share a port or a socket file; a recording that is overwritten."""
        bench = self.server(unix=True)
        port = bench.address[1]
        self.assertSays(self.drivebench("serve", "--port", port, code=USAGE).stderr,
                        f"cannot listen on 127.0.0.1:{port}: Address already in use")
        self.assertSays(self.drivebench_server(SERVO, "--port", 0, "--unix", bench.unix_path, code=USAGE).stderr,
                        "another server listens there")
        (self.folder / "r.mcap").write_bytes(b"precious")
        self.assertSays(self.drivebench_server(SERVO, "--port", 0, "--record", "r.mcap", code=USAGE).stderr, "r.mcap", "exists")
        self.assertEqual((self.folder / "r.mcap").read_bytes(), b"precious")

    def test_check_config_opens_nothing(self):
        """Catches: a check that needs the port of the bench that runs."""
        bench = self.server()
        said = self.drivebench_server(SERVO, "--check-config", "--port", bench.address[1], "--record", "r.mcap").stdout
        self.assertSays(said, "no problems", "bench servo", "lockstep mode")
        self.assertFalse((self.folder / "r.mcap").exists())

    def test_cfg_01_a_wrong_bench_file_is_refused_with_place_and_nearest_key(self):
        """Catches: one problem at a time, or one without its line."""
        text = SERVO.read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        text = text.replace("watchdog_ticks", "watchdog_tick").replace("period_us = 125", "period_us = 0")
        lines = text.splitlines()
        (self.folder / "bad.toml").write_text(text, encoding="utf-8")
        for command in ((SERVER, "bad.toml"), (DRIVEBENCH, "serve", "bad.toml")):
            done = self.run_program(*command, "--port", 0)
            self.assertEqual((done.returncode, done.stdout), (USAGE, ""))
            for key in ("watchdog_tick ", "period_us "):
                line = next(i for i, each in enumerate(lines, 1) if each.startswith(key))
                self.assertSays(done.stderr, f"bad.toml:{line}: bench.{key}")
            self.assertSays(done.stderr, "watchdog_ticks")

    def test_cfg_02_odd_values_are_refused_or_taken_with_a_warning(self):
        """Catches: a motor of 14 H that was meant to have 14 mH; a prototype that no option allows."""
        text = SERVO.read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        text += "\n[axis.machine]\nstator_inductance_h = 14.0\n"
        (self.folder / "odd.toml").write_text(text, encoding="utf-8")
        line = len(text.splitlines())
        for program in ((SERVER, "odd.toml"), (DRIVEBENCH, "serve", "odd.toml")):
            done = self.run_program(*program, "--check-config")
            self.assertEqual((done.returncode, done.stdout), (USAGE, ""))
            self.assertSays(done.stderr, f"odd.toml:{line}: axis.machine.stator_inductance_h is 14 H, which is odd",
                            "1e-04 to 3 H; --allow-odd takes it")
            done = self.run_program(*program, "--check-config", "--allow-odd")
            self.assertEqual(done.returncode, 0)
            self.assertSays(done.stderr, "warning", f"odd.toml:{line}: axis.machine.stator_inductance_h")

    def test_a_wrong_command_line_of_the_server_is_2(self):
        """Catches: an option that is ignored, and a run other than the requested one."""
        for arguments, fact in (
                ([], "bench file"), (["none.toml"], "none.toml"), ([SERVO, "--nope"], "--nope"),
                ([SERVO, "--mode", "fast"], "--mode"), ([SERVO, "--port", "65536"], "--port"),
                ([SERVO, "--port", "-1"], "--port"), ([SERVO, "--command-delay-ticks", "2"], "--command-delay-ticks"),
                ([SERVO, "--mode", "realtime", "--command-delay-ticks", "0"], "--command-delay-ticks"),
                ([SERVO, "--mode", "free", "--duration", "0"], "--duration"),
                ([SERVO, "--mode", "free", "--duration", "nan"], "--duration"),
                ([SERVO, "--mode", "free", "--duration", "1e300"], "--duration"),
                ([SERVO, "--fail-on-late", "-1"], "--fail-on-late"), ([SERVO, "--duration", "-1"], "-1 is not a number above 0"),
                ([SERVO, "--record-file-s", "1e400"], "1e400 is not a number above 0 and at most 1e9"),
                ([SERVO, "--record-file-mib", "-1"], "-1 is not a whole number of 1 or more"),
                ([SERVO, "--bus", "-1"], "-1 is not a whole number from 1 to 8"), ([SERVO, "--replay", "r.mcap"], "--replay"),
                ([SERVO, "--spin-us", "1001"], "1001 is not a whole number from 0 to 1000"),
                (["--replay", "none.mcap"], "none.mcap"), ([SERVO, "--record", "none/r.mcap"], "none/r.mcap"),
                ([SERVO, "--unix", "none/socket"], "none/socket"),
                *(([SERVO, option, ""], f"{option}: must not be empty")
                  for option in ("--record", "--unix", "--experiments", "--audit")), (["--replay", ""], "must not be empty"),
                *(([SERVO, option, "1"], f"{option} requires --record")
                  for option in ("--record-file-s", "--record-file-mib", "--record-chunk-ms")),
                ([SERVO, "--record", "r.mcap", "--record-chunk-ms", "nan"], "--record-chunk-ms")):
            done = self.drivebench_server(*arguments, *([] if "--port" in arguments else ["--port", "0"]), code=USAGE)
            self.assertSays(done.stderr, fact)
            self.assertEqual(done.stdout, "")

    def test_mode_and_delay_options_reach_the_bench(self):
        """Catches: an option that reaches the banner and not the bench."""
        for mode, delay, expected in (("lockstep", (), 0), ("lockstep", ("--command-delay-ticks", "1"), 1),
                                      ("realtime", (), 1), ("free", (), 0)):
            bench = self.server("--mode", mode, *delay)
            found = self.json_of("describe", link=link_of(bench))
            self.assertEqual((bench.ready["mode"], found["mode"], found["command_delay_ticks"]), (mode, mode, expected))
            self.assertEqual(bench.stop(), OK)
            self.assertKeys(bench.verdict, "mode", "ticks", "late_ticks", "lateness_p50_us", "lateness_p99_us",
                            "worst_lateness_us", "exact", "realtime_valid", "gaps", "state_hash", "recording", "sentence")

    def test_a_duration_ends_the_run_by_itself(self):
        """Catches: a headless run that never ends or is a tick short."""
        said = self.drivebench_server(SERVO, "--mode", "free", "--duration", "0.25", "--port", "0").stdout
        self.assertSays(said, "ready tcp=", "free run exact: 2000 ticks; state hash ")

    def test_a_file_name_of_odd_bytes_costs_no_verdict(self):
        """Catches: a run that ends in an exception, because the name of its recording is no JSON."""
        name = os.fsdecode(b"run\xff.mcap")
        done = self.drivebench_server(SERVO, "--port", "0", "--mode", "free", "--duration", "0.01", "--json", "--record", name)
        verdict = json.loads(done.stdout.splitlines()[-1])
        self.assertEqual((verdict["ticks"], verdict["recording"]), (80, "run\ufffd.mcap"))
        self.assertTrue((self.folder / name).exists())

    def test_os_05_fail_on_late_is_3(self):
        """Catches: an exit code of 0 after a run that was not in real time."""
        for allowed, code in (("0", TOO_LATE), ("1000000", OK)):
            bench = self.server("--mode", "realtime", "--fail-on-late", allowed)
            bench.process.send_signal(signal.SIGSTOP)
            time.sleep(0.05)
            bench.process.send_signal(signal.SIGCONT)
            self.assertEqual(bench.stop(), code)
            self.assertGreater(bench.verdict["late_ticks"], 0)
            self.assertFalse(bench.verdict["realtime_valid"])

    def test_version_is_the_build_of_hello(self):
        """Catches: a bug report about another build, and a program without a version."""
        build = self.json_of("describe", link=link_of(self.server()))["build_id"]
        for program, ask in (("drivebench-server", self.drivebench_server), ("drivebench", self.drivebench)):
            self.assertRegex(ask("--version").stdout, rf"^{program} \d+\.\d+\.\d+, build {build}\n$")


class Simulating(CommandTest):
    def simulate(self, *arguments, code=OK, files=None):
        limit = () if files is None else ("prlimit", f"--nofile={files}:{files}")
        done = subprocess.run([*limit, SERVER.parent / "drivebench-simulator", *arguments], capture_output=True, text=True,
                              cwd=self.folder, timeout=4 * PATIENCE_S, check=False)
        if code is not None:
            self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def test_a_wrong_command_line_names_the_word(self):
        """Catches: an option that is ignored, a usage text that does not name the mistake."""
        for arguments, fact in (("--nope", "'--nope' is no option"), ("--seeds 5..1", "--seeds does not take '5..1'"),
                                ("--seeds", "--seeds does not take ''"), ("--seeds 1 --seconds 0", "--seconds does not take '0'"),
                                ("", "either --seeds, or"), ("--seeds 1 --week", "either --seeds, or"),
                                ("--week --seconds 5", "belong to --seeds"), ("--minutes 1 --twice", "belong to --seeds"),
                                ("--trace --minutes 1", "belong to --seeds")):
            self.assertSays(self.simulate(*arguments.split(), code=USAGE).stderr, "drivebench-simulator: ", fact, "usage: ")

    def test_a_broken_promise_is_printed_with_the_command_that_repeats_it(self):
        """Catches: a command that leaves out --twice, and passes. With so few descriptors that a seed runs out of
        them."""
        for files in range(12, 40):
            said = self.simulate("--seeds", "1..3", "--seconds", "1", "--twice", code=None, files=files).stdout
            if "again: " in said:
                break
        self.assertRegex(said, r"again: ./bench simulate --seeds [123] --seconds 1 --twice\n")


class Demo(CommandTest):
    # Real time on a busy machine may fail, which the demo then reports; only lockstep is judged here.

    def demo(self, *options):
        done = self.run_program(DRIVEBENCH, "demo", *options)
        self.assertIn(done.returncode, (OK, FAILED), done.stderr)
        return done

    def test_json_has_both_runs(self):
        """Catches: a renamed key that a script reads; a promise of two counts that is not kept."""
        done = self.demo("--json", "--keep", "kept")
        found = json.loads(done.stdout)
        for mode in ("lockstep", "realtime"):
            self.assertKeys(found[mode], "peak_error_counts", "final_error_counts", "peak_current_a", "late_ticks",
                            "exchange_p50_us", "exchange_p99_us", "state_hash", "verdict", "recording", "attempts", "failure")
        self.assertEqual(done.returncode, FAILED if found["realtime"]["failure"] else OK)
        lockstep = found["lockstep"]
        self.assertEqual((lockstep["failure"], lockstep["exact"], lockstep["late_ticks"]), ("", True, 0))
        self.assertLessEqual(lockstep["peak_error_counts"], 2.0)
        self.assertLessEqual(lockstep["final_error_counts"], 1.0)
        self.assertAlmostEqual(lockstep["peak_current_a"], 5.46, delta=0.3)
        self.assertEqual((found["replay"]["equal"], found["replay"]["state_hash"]), (True, lockstep["state_hash"]))
        for mode in ("lockstep", "realtime"):
            self.drivebench("replay", found[mode]["recording"])

    def test_the_small_program_of_bench_demo_does_the_same(self):
        """Catches: a verb that drivebench-demo does not have, another run, next commands with a program that has none of
        them."""
        done = self.run_program(DRIVEBENCH.with_name("drivebench-demo"), "demo")
        self.assertIn(done.returncode, (OK, FAILED), done.stderr)
        hashes = [re.search(r"state hash +(\w+)", said)[1] for said in (done.stdout, self.demo().stdout)]
        self.assertEqual(hashes[0], hashes[1])
        self.assertRegex(done.stdout, r"\n  ./bench tools .*\n(.*\n)+  \S*/drivebench new motor --help")
        self.assertNotIn("bench tools", self.demo().stdout)

    def test_text_has_the_table_and_the_next_commands(self):
        """Catches: a demo that ends without naming its recordings."""
        said = self.demo().stdout
        self.assertSays(said, "lockstep", "real time", "peak error [counts]", "peak phase current [A]", "late ticks",
                        "exchange p99 [us]", "state hash", "lockstep exact: 1024 ticks", "equal, bit for bit",
                        "what to try next", "new motor --help", "recorded in recordings/demo-")
        self.assertEqual(len(list((self.folder / "recordings").glob("demo-*-lockstep.mcap"))), 1)


if __name__ == "__main__":
    unittest.main(verbosity=2)