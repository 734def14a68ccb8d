#!/usr/bin/env python3
"""The kernel's CAN as users meet it: `drivebench can check`, and can-utils on the bus of a bench. Run by with_can."""
import json
import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from drive_test import DriveTest, PATIENCE_S, run_all, with_bus


def shell(line):
    return subprocess.run(["sh", "-c", line], capture_output=True, text=True, timeout=PATIENCE_S, check=False)


class CanCheck(DriveTest):
    interface = "dbcheck0"

    def setUp(self):
        super().setUp()
        self.addCleanup(shell, f"ip link del {self.interface}")

    def must(self, line):
        done = shell(line)
        self.assertEqual(done.returncode, 0, f"{line}: {done.stderr}")

    def check(self, code):
        done = self.drivebench("can", "check", self.interface, "--json", code=code)
        return json.loads(done.stdout)

    # Catches: a cure that does not work, or is not a line for a shell.
    def test_each_printed_cure_works(self):
        found = self.check(code=2)["findings"]
        self.assertEqual(len(found), 1)
        self.must(found[0]["cure"].split("a virtual one: ")[1].removeprefix("modprobe vcan; "))
        self.assertEqual(self.check(code=0)["findings"], [])
        for broken in ("down", "mtu 16"):
            with self.subTest(broken):
                self.must(f"ip link set {self.interface} down; ip link set {self.interface} {broken}")
                self.must("true" if broken == "down" else f"ip link set {self.interface} up")
                found = self.check(code=1)["findings"]
                self.assertEqual(len(found), 1, found)
                self.must(found[0]["cure"])
                self.assertEqual(self.check(code=0)["findings"], [])

    # Catches: a text that differs from the JSON, or that sends its reader to a line that is not ip's.
    def test_a_sound_interface_has_no_problems_and_ip_has_its_numbers(self):
        self.must(f"ip link add dev {self.interface} mtu 72 type vcan && ip link set {self.interface} up")
        text = self.drivebench("can", "check", self.interface).stdout
        self.assertIn("no problems", text)
        self.must(text.split("its numbers: ")[1])


class CanUtils(DriveTest):
    # Catches: frames that can-utils show differently, or that the bench does not receive from them.
    def test_candump_and_cansend_work_on_the_bus_of_a_bench(self):
        self.server(text=with_bus(['backend = "socketcan"', 'channel = "vcan0"', "fd = false", "heartbeat_ms = 20"]))
        listener = self.start("candump", "-L", "vcan0")
        self.addCleanup(listener.communicate)
        self.addCleanup(listener.kill)
        seen = {}
        while "791" not in seen:  # the heartbeat of node 1: candump and the bench are connected
            self.next_frame(listener, seen)
        self.assertEqual(len(seen["791"]), 16)
        shell("cansend vcan0 071#0100050000000000")  # controller 5 asks for the axis
        while "681" not in seen:
            self.next_frame(listener, seen)
        self.assertEqual(seen["071"], "0100050000000000")
        self.assertEqual(seen["681"][:4], "0100")  # the request is done

    def next_frame(self, listener, seen):
        line = listener.stdout.readline()
        self.assertTrue(line, "candump ended")
        _, interface, frame = line.split()
        self.assertEqual(interface, "vcan0")
        identifier, data = frame.split("#")
        seen[identifier] = data


if __name__ == "__main__":
    run_all()
