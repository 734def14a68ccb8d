"""Shared by the tests of the server program."""
import json
import os
import pathlib
import resource
import shutil
import tempfile
import time
import unittest

from wire_client import BENCHES, PATIENCE_S, REPOSITORY, Server, pb

SERVO_TEXT = (BENCHES / "servo.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
SANITIZED = "DRIVEBENCH_SANITIZED" in os.environ  # as the CMake files set it
# A busy machine is no silent controller.
PATIENT_TEXT = SERVO_TEXT.replace("watchdog_ticks = 20", "watchdog_ticks = 400000").replace("lease_s = 2.0", "lease_s = 60.0")
ESC_TEXT = (BENCHES / "esc.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
TWO_AXES = SERVO_TEXT + SERVO_TEXT[SERVO_TEXT.index("[[axis]]"):].replace('name = "servo"', 'name = "second"', 1)

# A servo on a current amplifier, and a machine with three phases beside it.
TWO_DRIVES = SERVO_TEXT.replace("substeps = 5", "substeps = 8") + """
[axis.drive]
kind = "current_amplifier"
[axis.current_loop]
proportional_v_per_a = 50.0
integral_v_per_as = 50000.0
limit_a = 6.0

[[axis]]
name = "bldc"
[axis.machine]
kind = "bldc"
pole_pairs = 4
stator_resistance_ohm = 0.5
self_inductance_h = 1e-3
mutual_inductance_h = 2e-4
torque_constant_nm_per_a = 0.05
[axis.mechanics]
inertia_kgm2 = 1e-4
[axis.amplifier]
voltage_limit_v = 24.0
over_current_a = 20.0
[axis.encoder]
counts_per_revolution = 4096
"""


def repetitions(of_an_ordinary_build):
    """So many in an ordinary build, a tenth of them under a sanitizer, which finds a mistake in memory in these, too."""
    return of_an_ordinary_build // 10 if SANITIZED else of_an_ordinary_build


def until(condition, what):
    """Waits for the effect of another process."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("never: " + what)


class WireTest(unittest.TestCase):
    def server(self, *options, **more):
        server = Server(*options, **more)
        self.addCleanup(server.__exit__)
        return server

    def recording_server(self, resource_kind, limit):
        """A server that records to run.mcap in a folder of its own, with a limit set on it; returns both."""
        folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-wire-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        server = self.server("--record", str(folder / "run.mcap"),
                             before=lambda: resource.setrlimit(resource_kind, (limit, limit)))
        return server, folder

    def gates(self, mode="lockstep", text=ESC_TEXT):
        """A server whose drive has gates, with a unix socket."""
        return self.server("--mode", mode, text=text, unix=True)

    def client(self, server, **options):
        client = server.client(**options)
        self.addCleanup(client.close)
        return client

    def assertRefused(self, answer, code, field=None):
        self.assertEqual(answer.WhichOneof("kind"), "refusal", answer)
        self.assertEqual(pb.RefusalCode.Name(answer.refusal.code), pb.RefusalCode.Name(code))
        self.assertTrue(answer.refusal.message, "a refusal is a sentence")
        if field is not None:
            self.assertEqual(answer.refusal.field, field)

    def drive(self, owner, *setpoints):
        """Sends commands in real time, without a pause, until they drive the axis."""
        end = time.monotonic() + PATIENCE_S
        while owner.newest().state in (0, 5):  # idle, ready
            self.assertLess(time.monotonic(), end, "never armed")
            owner.exchange(owner.newest().tick, *setpoints)

    def step_beside(self, owner, program, tick=0):
        """Sends commands in lockstep until the program has ended; returns the next tick."""
        while program.poll() is None:
            owner.step(tick, 1.0)
            tick += 1
            time.sleep(0.001)
        return tick

    def audited(self, file, event):
        """All events of this name in the audit log."""
        lines = (json.loads(line) for line in file.read_text(encoding="utf-8").splitlines())
        return [line for line in lines if line["event"] == event]

    def assertAudited(self, file, event, count):
        """The audit log holds so many, each with its peer and a reason; returns the reasons."""
        lines = self.audited(file, event)
        self.assertEqual(len(lines), count)
        for line in lines:
            self.assertRegex(line["peer"], r"^127\.0\.0\.1:\d+$")
            self.assertNotIn(line["result"], ("", "done"))
        return [line["result"] for line in lines]

    def assertMemoryBelow(self, server, limit_kib, which="VmHWM"):
        if server.memory_kib("VmSize") < 1 << 30:  # a sanitizer maps terabytes, and keeps freed memory
            self.assertLess(server.memory_kib(which), limit_kib)

    def assertLimitOf2s(self, *since):
        """For an event 2 s after some moment between the first and the last of these: not earlier, and not much later. A
        busy machine may add seconds; a missing limit, or one ten times as long, adds more."""
        now = time.monotonic()
        self.assertGreater(now - since[0], 1.8)
        self.assertLess(now - since[-1], 10.0)

    def assertDone(self, answer):
        self.assertEqual(answer.WhichOneof("kind"), "done", answer)
