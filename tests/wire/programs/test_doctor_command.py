#!/usr/bin/python3
"""drivebench doctor: its rules on machines made of files, and this machine as it is."""
import json
import pathlib
import shutil
import sys
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from command_test import DRIVEBENCH, FAILED, OK, USAGE, CommandTest

# A machine on which everything is fine: files below its root.
GOOD = {
    "proc/self/limits": "Limit  Soft Limit  Hard Limit  Units\nMax locked memory         unlimited            unlimited            bytes\n"
                        "Max realtime priority     98                   98\n",
    "proc/self/status": "Name:\tdrivebench\nUid:\t1000\t1000\t1000\t1000\nCapEff:\t0000000000000000\n",
    "proc/version": "Linux version 6.1.0-18-rt-amd64 #1 SMP PREEMPT_RT Debian\n",
    "proc/stat": "cpu  1000 0 1000 8000 0 0 0 0 0 0\ncpu0 1000 0 1000 8000 0 0 0 0 0 0\n",
    "proc/net/can/version": "rev 20170425 abi 9\n",
    "sys/kernel/realtime": "1\n",
    "sys/devices/system/cpu/isolated": "3\n",
    "proc/irq/9/smp_affinity_list": "0-2\n",
    "proc/irq/24/smp_affinity_list": "0-3\n",
    "proc/irq/24/effective_affinity_list": "1\n",
    "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "performance\n",
    "sys/devices/system/cpu/cpu1/cpufreq/scaling_governor": "performance\n",
    "sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc\n",
    "sys/module/can/initstate": "live\n",
    "sys/class/net/lo/type": "772\n",
    "sys/class/net/can0/type": "280\n",
    "sys/class/net/can0/device/uevent": "DRIVER=mcp251xfd\n",
    "sys/class/net/can0/flags": "0x40c1\n",
    "sys/class/net/can0/mtu": "72\n",
    "sys/class/net/can0/tx_queue_len": "1000\n",
}


class Doctor(CommandTest):
    def examined(self, changes=None, *options, code=OK):
        """The findings by name, of the good machine with these files changed; None: not there."""
        root = self.folder / "machine"
        shutil.rmtree(root, ignore_errors=True)
        for name, text in {**GOOD, **(changes or {})}.items():
            if text is not None:
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_text(text, encoding="utf-8")
        found = self.json_of("doctor", "--root", root, *options, code=code)
        return {each["name"]: each for each in found["realtime"] + found["can"]}

    def problem(self, name, changes, what, mend):
        """That one is a problem, is told with these words, and nothing else is one."""
        found = self.examined(changes, code=FAILED)
        self.assertEqual([each["name"] for each in found.values() if each["health"] == "problem"], [name])
        self.assertIn(what, found[name]["what"])
        self.assertIn(mend, found[name]["mend"])
        self.assertTrue(found[name]["why"])

    def test_a_good_machine_has_no_problems(self):
        """Catches: a rule that nothing satisfies; a measurement of this machine among the files of another."""
        found = self.examined()
        self.assertEqual({each["health"] for each in found.values()}, {"fine"})
        self.assertEqual({each["mend"] for each in found.values()}, {""})
        self.assertEqual(set(found), {"SCHED_FIFO", "memlock", "governor", "isolated CPUs", "interrupts", "PREEMPT_RT", "timer", "steal", "kernel CAN", "can0"})

    def test_each_problem_is_found_alone_with_its_mend(self):
        """Catches: a rule that is turned round, a limit read from another column, a right in another bit, a file with another name."""
        limits = GOOD["proc/self/limits"]
        self.problem("SCHED_FIFO", {"proc/self/limits": limits.replace("98  ", "0  ", 1)}, "the limit is 0", "rtprio")
        self.problem("SCHED_FIFO", {"proc/self/limits": limits.replace("98  ", "79  ", 1)}, "the limit is 79", "LimitRTPRIO")
        self.problem("memlock", {"proc/self/limits": limits.replace("unlimited", "8388608", 1)}, "8192 KiB", "LimitMEMLOCK=infinity")
        self.problem("governor", {"sys/devices/system/cpu/cpu1/cpufreq/scaling_governor": "powersave\n"}, "powersave on 1 of 2 CPUs", "cpupower")
        self.problem("timer", {"sys/devices/system/clocksource/clocksource0/current_clocksource": "hpet\n"}, "hpet", "echo tsc")
        self.problem("steal", {"proc/stat": "cpu  1000 0 1000 7900 0 0 0 100 0 0\n"}, "1 %", "vcpupin")
        self.problem("can0", {"sys/class/net/can0/tx_queue_len": "10\n"}, "a queue of 10 frames", "txqueuelen 1000")
        self.problem("can0", {"sys/class/net/can0/flags": "0x40c0\n"}, "down", "ip link set can0 up")
        self.problem("can0", {"sys/class/net/can0/mtu": "16\n"}, "classic frames only", "fd on")

    def test_rights_take_the_place_of_limits(self):
        """Catches: root in a container that is told to raise limits, and one without the rights that is not."""
        limits = {"proc/self/limits": "Max locked memory 65536 65536 bytes\nMax realtime priority 0 0\n"}
        root = GOOD["proc/self/status"].replace("1000", "0")
        self.examined({**limits, "proc/self/status": root.replace("0000000000000000", "0000000000804000")})
        found = self.examined({**limits, "proc/self/status": root}, code=FAILED)
        self.assertEqual((found["SCHED_FIFO"]["health"], found["memlock"]["health"]), ("problem", "problem"))
        found = self.examined({**limits, "proc/self/status": GOOD["proc/self/status"].replace("0000000000000000", "0000000000804000")}, code=FAILED)
        self.assertEqual((found["SCHED_FIFO"]["health"], found["memlock"]["health"]), ("fine", "problem"))

    def test_what_is_merely_better_is_a_note(self):
        """Catches: exit code 1 for a machine on which lockstep and CAN over UDP work."""
        found = self.examined({"sys/kernel/realtime": None, "proc/version": "Linux version 6.1.0\n", "sys/devices/system/cpu/isolated": "\n",
                               "proc/net/can/version": None, "sys/module/can/initstate": None, "sys/class/net/can0/type": "1\n"})
        notes = {name: each["mend"] for name, each in found.items() if each["health"] == "note"}
        self.assertEqual(set(notes), {"isolated CPUs", "PREEMPT_RT", "kernel CAN", "interfaces"})
        self.assertIn("modprobe", notes["kernel CAN"])
        self.assertIn("type vcan", notes["interfaces"])
        self.examined({"sys/class/net/can0/mtu": "16\n"}, "--classic")
        virtual = self.examined({"sys/class/net/can0/tx_queue_len": "0\n", "sys/class/net/can0/device/uevent": None})
        self.assertEqual(virtual["can0"]["health"], "fine")

    def test_interrupts_keep_away_from_the_tick(self):
        """Catches: a list of CPUs that is read as one number, an interrupt that may act on a CPU taken for one that does, a note
        where no CPU is isolated."""
        found = self.examined({"proc/irq/9/smp_affinity_list": "0,2-4\n", "proc/irq/24/effective_affinity_list": "3\n"})["interrupts"]
        self.assertEqual((found["health"], found["what"]), ("note", "2 on the isolated CPUs 3: 24, 9"))
        self.assertIn("IRQBALANCE_BANNED_CPULIST=3", found["mend"])
        self.assertIn("/proc/irq/24/smp_affinity_list", found["mend"])
        for isolated, list_ in (("3\n", "0-2,4-99999999999\n"), ("3\n", "x-\n"), ("\n", "0-3\n"), ("5-6\n", "0-4,7\n")):
            found = self.examined({"sys/devices/system/cpu/isolated": isolated, "proc/irq/9/smp_affinity_list": list_}, code=OK)
            self.assertEqual(found["interrupts"]["health"], "fine", (isolated, list_))

    def test_this_machine(self):
        """Catches: an exit code that does not follow the findings, a measurement that is left out, text and JSON that differ, lines
        that a terminal breaks."""
        found, code = self.doctor_here("--measure-s", 0.2, "--period-us", 1e6)
        every = found["realtime"] + found["can"]
        self.assertEqual(sum(each["health"] == "problem" for each in every), found["problems"])
        self.assertEqual(code, FAILED if found["problems"] else OK)
        self.assertIn("of 200 wake-ups", next(each for each in every if each["name"] == "wake-up")["why"])
        for _ in range(20):  # a machine that changes between two looks
            found, code = self.doctor_here("--measure-s", 0)
            told = self.run_program(DRIVEBENCH, "doctor", "--measure-s", 0)
            if self.doctor_here("--measure-s", 0) == (found, code):
                break
        self.assertNotIn("wake-up", {each["name"] for each in found["realtime"]})
        self.assertEqual(told.returncode, code, told.stderr)
        text = told.stdout
        for each in found["realtime"] + found["can"]:
            self.assertRegex(text, rf"(?m)^  {each['health']} +{each['name']} ")
            words = " ".join(text.split())
            self.assertIn(" ".join(f"{each['what']}; {each['why']}".split()), words)
            self.assertIn(" ".join(each["mend"].split()), words)
        # A word such as the path of a file is longer than a line.
        self.assertEqual([line for line in text.splitlines() if len(line) > 80 and " " in line[25:]], [])
        self.drivebench("doctor", "--root", self.folder, code=USAGE)

    def doctor_here(self, *options):
        done = self.run_program(DRIVEBENCH, "doctor", *options, "--json")
        return json.loads(done.stdout), done.returncode


if __name__ == "__main__":
    unittest.main(verbosity=2)
