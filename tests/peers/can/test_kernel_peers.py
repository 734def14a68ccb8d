#!/usr/bin/env python3
"""Programs that this project did not write read and command a bench on the kernel's own CAN: can-utils, python-can with
canmatrix, npm's socketcan. Builds the npm package, then runs itself again where the kernel has CAN."""
import json
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    import can
    import canmatrix
    import dbc_drive
    from drive_test import DriveTest, PATIENCE_S, run_all, with_bus
    from command_test import until
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

TICKS = 1600
CANSEND_TICKS = 20
NPM_TICKS = 200
NPM_S = 240.0
# A constant voltage does not turn the motor; a load does.
LOAD = "\n[[axis.load]]\nat_s = 0.0\nload_nm = -0.5\n"
NOBODY = 65534
# Fields that hold the low bits of their number; the others stop at the end of their range.
WRAPS = {"tick", "command_tick", "missed", "refused", "late_ticks", "encoder_count"}


def float32(number):
    return struct.unpack("<f", struct.pack("<f", number))[0]


class Bus(can.ThreadSafeBus):
    def __init__(self):
        super().__init__(interface="socketcan", channel="vcan0", fd=True)


class KernelPeer(DriveTest):
    def bench(self, fd, more="", **options):
        """A bench on vcan0 that records: the server, its DBC file, its recording."""
        text = with_bus(['backend = "socketcan"', 'channel = "vcan0"', f"fd = {str(fd).lower()}"]).replace(
            "\n[[can]]", more + "\n[[can]]")
        recording = self.folder / f"run_{'fd' if fd else 'classic'}.mcap"
        dbc = self.text_of("dbc", text)
        return self.server("--record", str(recording), text=text, **options), dbc, recording

    def candump(self, name):
        """Starts candump and waits until its log shows the bench's heartbeat; returns the log."""
        log = self.folder / name
        self.start("sh", "-c", f"exec candump -L -r 4000000 vcan0 >{log}")
        until(lambda: log.exists() and log.stat().st_size > 0, "candump hears the bench")
        return log

    def await_line(self, log, pattern):
        """A frame of a log, `ID#DATA` or `ID##FLAGS DATA` without the space; its groups."""
        found = []

        def seen():
            found[:] = re.findall(pattern + r"\n", log.read_text(encoding="ascii"))
            return found

        until(seen, f"candump shows {pattern}")
        return found[-1]

    def finish(self, server, recording):
        self.assertEqual(server.stop(), 0, server.errors())
        self.assertTrue(server.verdict["exact"])
        self.assertIn("equal, bit for bit", self.drivebench("replay", recording).stdout)

    def assertLogRecorded(self, log, dbc, recording, last_tick):
        """Every frame of a log that names the tick of its sample, as canmatrix reads it, equals the recording."""
        matrix = canmatrix.formats.loadp_flat(str(dbc))
        rows = self.recorded(recording)
        ticks, encoder = set(), {}
        for message in can.LogReader(log):
            frame = matrix.frame_by_id(canmatrix.ArbitrationId(message.arbitration_id, message.is_extended_id))
            self.assertIsNotNone(frame, message)
            values = frame.decode(bytearray(message.data))
            name = frame.name.removeprefix("servo_")
            if name == "encoder":
                encoder = values
            if name not in ("sensors", "currents", "state", "fault") or "tick" not in values:
                continue
            if name == "currents":  # they complete the encoder frame before
                values |= encoder
            row = rows[values["tick"].raw_value]
            ticks.add(values["tick"].raw_value)
            for field, value in values.items():
                self.check_value(value, float(row[self.column(row, field)]), f"{name}.{field} of {row['tick']}")
        self.assertEqual(ticks, set(range(last_tick + 1)))

    def column(self, row, field):
        """The recording's signals end with their unit; raw counts of the converters are others."""
        (column,) = [name for name in row
                     if name == field or (name.startswith(field + "_") and not name.endswith("_counts"))]
        return column

    def check_value(self, value, recorded, where):
        signal = value.signal
        if signal.is_float:
            self.assertEqual(value.raw_value, float32(recorded), where)
        elif signal.name in WRAPS:
            self.assertEqual(value.raw_value % 2**signal.size, int(recorded) % 2**signal.size, where)
        else:
            inside = min(max(recorded, float(signal.min)), float(signal.max))
            self.assertLessEqual(abs(float(value.phys_value) - inside), 0.500001 * float(signal.factor), where)


class PythonCan(KernelPeer):
    # Catches: frames that python-can or candump read otherwise than we write them; a DBC file that does not describe
    # them; samples that are lost, doubled or of another tick.
    def test_python_can_starts_the_motor_beside_candump(self):
        for fd in (False, True):
            with self.subTest(fd=fd):
                server, dbc, recording = self.bench(fd)
                log = self.candump(f"fd_{fd}.log")
                with Bus() as bus:
                    counts = dbc_drive.open_loop_start(dbc_drive.Drive(bus, dbc, fd=fd), TICKS)
                self.await_line(log, r" 681#(?:#.)?0300[0-9A-F]{12}")  # the answer to release
                self.assertIn("no problems", self.drivebench("can", "check", "vcan0").stdout)
                self.finish(server, recording)
                self.assertEqual([tick for tick, _ in counts], list(range(TICKS + 1)))
                self.assertCountsRecorded(counts, recording)
                self.assertLogRecorded(log, dbc, recording, TICKS)

    # CAN-14. Catches: a server that needs a capability for CAN.
    def test_an_unprivileged_user_runs_a_bench_on_can(self):
        def drop_privileges():
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)

        text = with_bus(['backend = "socketcan"', 'channel = "vcan0"'])
        dbc = self.text_of("dbc", text)
        self.folder.chmod(0o755)
        server = self.server(config=self.folder / "bench.toml", before=drop_privileges)
        status = pathlib.Path(f"/proc/{server.process.pid}/status").read_text(encoding="ascii")
        self.assertRegex(status, rf"Uid:\t{NOBODY}\t{NOBODY}\t{NOBODY}\t{NOBODY}")
        self.assertRegex(status, r"CapEff:\t0+\n")
        with Bus() as bus:
            counts = dbc_drive.open_loop_start(dbc_drive.Drive(bus, dbc), 20)
        self.assertEqual(len(counts), 21)
        self.assertEqual(server.stop(), 0, server.errors())
        self.assertTrue(server.verdict["exact"])


class OurController(KernelPeer):
    # Catches: a kernel bus on which the reference controller behaves differently from other buses.
    def test_our_controller_makes_the_servo_move(self):
        for fd in (True, False):
            with self.subTest(fd=fd):
                server, _, recording = self.bench(fd)
                report = self.json_of("control", link=f"can:socketcan:vcan0?fd={int(fd)}")
                self.assertEqual(report["samples"], 1024)
                self.assertLessEqual(report["peak_error_counts"], 2.0)
                self.finish(server, recording)


class CanUtils(KernelPeer):
    def cansend(self, fd, identifier, data):
        frame = f"{identifier}#{'#1' if fd else ''}{data.hex()}"
        subprocess.run(["cansend", "vcan0", frame], check=True, timeout=PATIENCE_S)

    # Catches: a drive that only a program with our tables can command; a command that arrives changed.
    def test_cansend_commands_an_axis(self):
        for fd in (False, True):
            with self.subTest(fd=fd):
                server, dbc, recording = self.bench(fd)
                log = self.candump(f"fd_{fd}.log")
                begin = " {}#" + ("#." if fd else "")
                self.cansend(fd, "071", bytes([1, 0, 5, 0, 0, 0, 0, 0]))  # controller 5 asks for the axis
                (lease,) = bytes.fromhex(self.await_line(log, begin.format("681") + "010005000000(..).."))
                for tick in range(CANSEND_TICKS):
                    self.await_line(log, begin.format("008") + tick.to_bytes(4, "little").hex().upper() + "01")
                    u_a, u_b = 20.0 + tick, -10.5
                    if fd:
                        data = struct.pack("<IffBBxx", tick, u_a, u_b, 1, lease)
                    else:
                        data = struct.pack("<hhHBB", round(100 * u_a), round(100 * u_b), tick, 1, lease)
                    self.cansend(fd, "031", data)
                self.cansend(fd, "071", bytes([3, lease, 5, 0, 0, 0, 0, 0]))
                self.await_line(log, begin.format("681") + "030005000000....")
                self.finish(server, recording)
                self.assertLogRecorded(log, dbc, recording, CANSEND_TICKS)
                rows = self.recorded(recording)
                for tick in range(CANSEND_TICKS):
                    row = rows[tick + 1]  # it holds the voltages of the tick before
                    self.assertEqual((float(row["u_a_v"]), float(row["u_b_v"])), (20.0 + tick, -10.5), f"tick {tick}")
                self.assertGreater(float(rows[CANSEND_TICKS]["i_a_a"]), 0.5)


class Npm(KernelPeer):
    # Catches: frames that only programs in Python and C understand.
    def test_npm_socketcan_commands_an_axis(self):
        if reason := os.environ.get("DRIVEBENCH_NO_SOCKETCAN"):
            self.skipTest(reason)
        program = pathlib.Path(os.environ["DRIVEBENCH_SOCKETCAN"]) / "run_ticks.js"
        for fd in (False, True):
            with self.subTest(fd=fd):
                server, _, recording = self.bench(fd, LOAD)
                told = self.run_program("node", program, "vcan0", "fd" if fd else "classic", NPM_TICKS, 20.5, -10)
                self.assertEqual(told.returncode, 0, told.stderr)
                self.finish(server, recording)
                samples = json.loads(told.stdout)
                self.assertEqual([sample[0] for sample in samples], list(range(NPM_TICKS + 1)))
                self.assertCountsRecorded([sample[:2] for sample in samples], recording)
                rows = self.recorded(recording)
                for tick, _, *currents in samples:
                    row = rows[tick]
                    for current, recorded in zip(currents, (float(row["i_a_a"]), float(row["i_b_a"]))):
                        allowed = 0.0 if fd else 0.5000001e-3
                        self.assertLessEqual(abs(current - (float32(recorded) if fd else recorded)), allowed)
                    if tick > 0:
                        self.assertEqual((float(row["u_a_v"]), float(row["u_b_v"])), (20.5, -10.0), f"tick {tick}")


def build_socketcan(package):
    """Builds npm's socketcan and its native part in a folder, with no network but the registry's; returns the reason if
    that fails, else an empty text."""
    def run(*command, cwd=None):
        done = subprocess.run([str(word) for word in command], cwd=cwd, capture_output=True, text=True, timeout=NPM_S,
                              check=False)
        if done.returncode != 0:
            last = (done.stderr.strip() or done.stdout.strip()).splitlines()[-3:]
            raise RuntimeError(f"{' '.join(map(str, command[:3]))} failed: {' / '.join(last)}")
        return done.stdout

    try:
        shutil.copytree(HERE / "npm_socketcan", package, ignore=shutil.ignore_patterns("node_modules"))
        prefix = pathlib.Path(run("node", "-p", "process.execPath").strip()).resolve().parents[1]
        if not (prefix / "include/node/node.h").exists():
            return f"no headers of Node.js below {prefix}/include/node (Debian package libnode-dev)"
        run("npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", cwd=package)
        run("node", package / "node_modules/node-gyp/bin/node-gyp.js", "rebuild", f"--nodedir={prefix}",
            cwd=package / "node_modules/socketcan")
    except (OSError, RuntimeError, subprocess.TimeoutExpired) as error:
        return str(error)
    return ""


def main():
    """At first returns the exit code of this script where the kernel has CAN."""
    for tool in ("candump", "cansend"):
        if shutil.which(tool) is None:
            print(f"skipped: no {tool} (Debian package can-utils)")
            return 77
    with tempfile.TemporaryDirectory(prefix="drivebench-npm-") as folder:
        package = pathlib.Path(folder) / "npm_socketcan"
        reason = build_socketcan(package)
        found = {"DRIVEBENCH_NO_SOCKETCAN": reason} if reason else {"DRIVEBENCH_SOCKETCAN": str(package)}
        code = subprocess.run([HERE / "with_can", sys.executable, *sys.argv], env={**os.environ, **found},
                              check=False).returncode
    if code == 0 and reason:
        print(f"skipped: all passed but npm's socketcan: {reason}", flush=True)
        return 77
    return code


if __name__ == "__main__":
    if "DRIVEBENCH_CAN" not in os.environ:
        sys.exit(main())
    run_all()
