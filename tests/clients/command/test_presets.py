"""Every preset of the reference controllers on the real server: over TCP, and one of each kind over CAN FD, Modbus and in real time."""
import json
import pathlib
import re
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from free_port import free_udp_port
    from wire_client import BENCHES, PATIENCE_S, SERVER, Server
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

COMMAND = SERVER.with_name("drivebench")
PORT = free_udp_port()  # of the multicast bus: one bus for each port
CAN = f"can:udp_multicast:239.74.163.2:{PORT}?fd=1"
LONG = 30_000  # samples, two seconds over TCP
WAYS_IN = f"""
[[can]]
backend = "udp_multicast"
channel = "239.74.163.2"
port = {PORT}
fd = true

[modbus]
port = 0
allow_writes = true
"""


def presets():
    done = subprocess.run([COMMAND, "control", "--list", "--json"], capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    return json.loads(done.stdout)


def bench_text(preset, ways_in):
    """The bench of a preset with more ways in, and with a watchdog that a busy machine does not set off."""
    text = (BENCHES / (preset["bench"] + ".toml")).read_text(encoding="utf-8").replace("../motors", str(BENCHES.parent / "motors"))
    lines = [line for line in text.splitlines() if line.split("=")[0].strip() not in ("watchdog_ticks", "lease_s", "lease_ticks")]
    return "\n".join(lines).replace("[bench]\n", "[bench]\nwatchdog_ticks = 50000\n") + ways_in


def without_trip(text):
    """A busy machine that loses many samples must not end the run."""
    lines = [line for line in text.splitlines() if line.split("=")[0].strip() != "over_current_trip"]
    return re.sub(r"(?m)^over_current_a *=.*$", r"\g<0>\nover_current_trip = false", "\n".join(lines))


def short_ones(all_presets):
    """The shortest preset for each kind of machine and of commands."""
    chosen = {}
    for preset in sorted(all_presets, key=lambda each: each["samples"]):
        chosen.setdefault((preset["machine_kind"], preset["commands"]), preset)
    return list(chosen.values())


class Presets(unittest.TestCase):
    def run_on(self, preset, link_of, mode="lockstep"):
        """The report of the controller, and the last sample and the state hash of the bench."""
        ways_in = WAYS_IN if mode == "lockstep" else ""  # in real time a bus must carry what it promises
        text = bench_text(preset, ways_in)
        with Server("--mode", mode, text=text if mode == "lockstep" else without_trip(text)) as server:
            done = subprocess.run([COMMAND, "control", "--json", "--preset", preset["name"], "--link", link_of(server)],
                                  capture_output=True, text=True, timeout=4 * PATIENCE_S, check=False)
            self.assertEqual(done.returncode, 0, f"{preset['name']}: {done.stdout}{done.stderr}")
            with server.client() as client:
                last = client.newest()
            self.assertEqual(server.stop(), 0, server.errors())
        return json.loads(done.stdout), last, server.verdict["state_hash"]

    @staticmethod
    def over_tcp(server):
        return "tcp:%s:%d" % server.address

    def test_every_preset_runs_on_the_bench_it_names(self):
        """Catches: a preset that fits its own bench no more, a terminal that never gets its command."""
        for preset in presets():
            if preset["samples"] > LONG:
                continue  # the benches of these run others as well
            with self.subTest(preset["name"]):
                report, *_ = self.run_on(preset, self.over_tcp)
                self.assertEqual((report["failure"], report["missed_ticks"], report["late_ticks"]), ("", 0, 0))
                if preset["commands"] == "currents":
                    self.assertIsNone(report["peak_command_voltage_v"])
                else:
                    self.assertLessEqual(report["peak_command_voltage_v"], preset["voltage_limit_v"] * 1.001)

    def test_each_kind_of_machine_runs_the_same_over_can_and_modbus(self):
        """Catches: a terminal, a current or a sensor that a link leaves out or changes. Both carry float32, so both runs
        are one, bit for bit; TCP carries doubles."""
        for preset in short_ones(presets()):
            with self.subTest(f"{preset['name']}, {preset['machine_kind']}, {preset['commands']}"):
                _, can_last, can_hash = self.run_on(preset, lambda server: CAN)
                modbus, modbus_last, modbus_hash = self.run_on(preset, lambda server: f"modbus:{server.ready['modbus']}")
                tcp, *_ = self.run_on(preset, self.over_tcp)
                self.assertEqual(modbus["samples"], tcp["samples"])
                if can_last.refused_commands == modbus_last.refused_commands:
                    self.assertEqual(can_hash, modbus_hash)
                # A command that has no answer after 20 ms goes over CAN again; the bench refuses the second one, and counts it.
                for last in (can_last, modbus_last):
                    last.refused_commands = 0
                self.assertEqual(can_last, modbus_last)
                self.assertAlmostEqual(modbus["peak_speed_rad_s"], tcp["peak_speed_rad_s"], delta=0.05 * tcp["peak_speed_rad_s"])

    def test_each_kind_of_machine_runs_in_real_time(self):
        """Catches: a trajectory on the client's clock, a lost sample that is not counted. How well it
        tracks is not asked: this machine may be busy, and the client lose as many samples as it likes."""
        for preset in short_ones(presets()):
            with self.subTest(preset["name"]):
                report, *_ = self.run_on(preset, self.over_tcp, mode="realtime")
                self.assertEqual(report["mode"], "realtime")
                self.assertEqual(report["samples"] + report["missed_ticks"], preset["samples"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
