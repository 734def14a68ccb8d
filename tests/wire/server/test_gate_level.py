#!/usr/bin/python3
"""The gate level of a server, through the library: the same bits as in process, refusals, tokens, ends."""
import os
import pathlib
import random
import shutil
import sys
import tempfile
import threading
import time
import unittest
import unittest.mock

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
import python_package  # noqa: E402, F401
from wire_client import PATIENCE_S  # noqa: E402
from wire_test import ESC_TEXT, PATIENT_TEXT, WireTest  # noqa: E402

import drivebench  # noqa: E402
from drivebench import Code, LegMode  # noqa: E402

MICRO, SECOND = 10**6, 10**12
USERS = "".join(f'[[token]]\nname = "{name}"\nrole = "{role}"\ntoken = "{name}-secret"\n'
                for name, role in (("vera", "viewer"), ("otto", "operator")))


class GateLevel(WireTest):
    def bridge(self, address):
        bridge = drivebench.Bridge(address)
        self.addCleanup(bridge.close)
        return bridge

    def test_a_random_program_gives_the_same_bits_as_in_process(self):
        """Catches: a result that goes to another place or is cut, edges lost where a run takes more than one call or part, a state that
        is not the whole, time that the client does not follow."""
        server = self.gates()
        here, there = self.bridge("inproc:esc"), self.bridge(f"shm:{server.unix_path}?spin_us=20")
        draw = random.Random(20)
        now, saved = 0, None
        edges = 0
        for _ in range(300):
            what = draw.choice(("set", "set", "run", "run", "run", "all", "next", "mark", "parameter", "inject", "save", "restore"))
            if what == "set":
                period = draw.randrange(10, 50) * MICRO
                call = ("set", draw.randrange(3), LegMode(draw.randrange(6))), {
                    "period_ps": period, "compare_ps": draw.randrange(period), "dead_ps": draw.choice((0, 200_000)), "period_start_ps": now}
            elif what in ("run", "all", "next"):
                until_ps = now + draw.choice((1, 137_000, 5 * MICRO, 3000 * MICRO))
                call = (("next_edge", until_ps), {}) if what == "next" else (("run", until_ps), {"room": 1 if what == "run" else 5000})
            elif what == "parameter":
                call = ("set_parameter", "machine.stator_resistance_ohm", draw.uniform(0.02, 0.2)), {}
            elif what == "inject":
                call = ("inject", "bus_sag", draw.choice((0.0, 0.2))), {}
            elif what == "restore":
                call = (("restore", saved) if saved else ("clear",)), {}
            else:
                call = (what,), {}
            (name, *arguments), options = call
            results = [getattr(each, name)(*arguments, **options) for each in (here, there)]
            self.assertEqual(*results, call)
            if name == "save":
                saved = results[0]
            edges += len(results[0]) if name == "run" else 0
            self.assertEqual(bytes(here.read()), bytes(there.read()), call)
            self.assertEqual(bytes(here.mean()), bytes(there.mean()), call)
            self.assertEqual(here.get_parameter("machine.stator_resistance_ohm"), there.get_parameter("machine.stator_resistance_ohm"))
            now = here.read().now_ps
        self.assertGreater(edges, 1000)
        self.assertEqual(here.save(), there.save())

    def test_a_run_with_more_edges_than_a_call_holds(self):
        """Catches: more edges than one call holds that stop there."""
        server = self.gates()
        found = []
        for address in ("inproc:esc", f"shm:{server.unix_path}"):
            bridge = self.bridge(address)
            for leg, mode in enumerate((LegMode.LOW, LegMode.PWM, LegMode.OPEN)):
                bridge.set(leg, mode, period_ps=20 * MICRO, compare_ps=4 * MICRO)
            found.append(bridge.run(20_000 * MICRO, room=1200))
        self.assertEqual(len(found[0]), 1200)
        self.assertEqual(*found)

    def test_a_bench_with_users_asks_for_the_role_and_takes_the_token_of_the_environment(self):
        """Catches: a role that is not asked for; a token that a program has no way to show."""
        folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-bridge-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        (folder / "tokens").write_text(USERS, encoding="utf-8")
        (folder / "tokens").chmod(0o600)
        server = self.gates(text=f'{ESC_TEXT}\n[tcp]\ntokens_file = "{folder}/tokens"\n')
        for token, code in (("vera-secret", Code.FORBIDDEN), ("otto-secret", None), ("wrong", Code.UNAUTHENTICATED)):
            with self.subTest(token), unittest.mock.patch.dict(os.environ, {"DRIVEBENCH_TOKEN": token}):
                if code is None:
                    self.bridge(f"shm:{server.unix_path}").run(MICRO)
                    continue
                with self.assertRaises(drivebench.DrivebenchError) as refused:
                    drivebench.Bridge(f"shm:{server.unix_path}")
                self.assertEqual(refused.exception.code, code)

    def test_what_has_no_gate_level_is_refused(self):
        """Catches: a refusal of the server that loses its code, an address that is taken for one with gates."""
        path = self.gates().unix_path
        for address, code in ((f"unix:{path}", Code.NOT_AVAILABLE), (f"shm:{path}.none", Code.NO_BENCH), (f"shm:{path}?spin_us=x", Code.BAD_ARGUMENT),
                              (f"shm:{self.gates('realtime').unix_path}", Code.WRONG_MODE),
                              (f"shm:{self.gates(text=PATIENT_TEXT).unix_path}", Code.WRONG_DRIVE)):
            with self.subTest(address), self.assertRaises(drivebench.DrivebenchError) as refused:
                drivebench.Bridge(address)
            self.assertEqual(refused.exception.code, code)
        self.assertRegex(str(refused.exception), "has no gates")

    def test_the_end_of_the_server_is_told_within_a_run(self):
        """Catches: a client that waits for ever for a server that has gone, a server that stays for a run."""
        server = self.gates()
        bridge = self.bridge(f"shm:{server.unix_path}")
        bridge.set(0, LegMode.LOW)
        told = []

        def run():
            try:
                bridge.run(8_000_000 * SECOND)
            except drivebench.DrivebenchError as error:
                told.append(error)

        thread = threading.Thread(target=run)
        thread.start()
        time.sleep(0.3)
        server.stop()
        thread.join(PATIENCE_S)
        self.assertFalse(thread.is_alive())
        self.assertEqual([error.code for error in told], [Code.LINK_LOST])
    def test_a_machine_that_diverges_ends_where_it_does_in_process(self):
        """Catches: a run whose part is taken for the whole once the machine has diverged, another code."""
        server = self.gates()
        ends = []
        for address in ("inproc:esc", f"shm:{server.unix_path}"):
            bridge = self.bridge(address)
            bridge.set_load(1e5)
            with self.assertRaisesRegex(drivebench.DrivebenchError, "diverged") as refused:
                bridge.run(3000 * MICRO, room=5000)
            ends.append((refused.exception.code, bytes(bridge.read())))
        self.assertEqual(*ends)


if __name__ == "__main__":
    unittest.main(verbosity=2)
