"""The package `drivebench` with arguments, threads, forks and servers that fail: an exception each time, never a crash."""
import asyncio
import math
import os
import pathlib
import signal
import sys
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
import python_package  # noqa: E402, F401
from wire_client import PATIENCE_S  # noqa: E402

import drivebench  # noqa: E402
from drivebench import BadArgument, BenchClosed, Code, LinkLost, NoBench, Refused, ServerFailed  # noqa: E402

NAN = math.nan
HUGE = 10**400


class Arguments(unittest.TestCase):
    def setUp(self):
        self.bench = drivebench.Bench("inproc:dc-a-voltage")
        self.addCleanup(self.bench.close)
        self.bench.acquire()
        self.bench.step(off=True)

    # Catches: a number that ctypes wraps around, a text that ends at its first zero, a wrong type that becomes a pointer.
    def test_what_is_no_number_name_or_axis_is_an_exception_that_names_it(self):
        b = self.bench
        for call, field in ((lambda: b.step(voltages="12"), "voltages"), (lambda: b.step(voltages=(1, 2)), "voltages"),
                            (lambda: b.step(voltages=[None]), "voltages"), (lambda: b.step(voltages={}), "voltages"),
                            (lambda: b.step(voltages=HUGE), "voltages"), (lambda: b.step(voltages=1j), "voltages"),
                            (lambda: b.step(voltages=1, field="x"), "field"), (lambda: b.step(off=True, tick=-1), "tick"),
                            (lambda: b.step(off=True, tick=1 << 64), "tick"), (lambda: b.step(off=True, tick=0.5), "tick"),
                            (lambda: b.step(-1, off=True), "axis"), (lambda: b.step([], off=True), "axis"),
                            (lambda: b.step(1 << 32, off=True), "axis"), (lambda: b.newest("dc-b"), "axis"),
                            (lambda: b.set("a\0b", 1), "name"), (lambda: b.set("\ud800", 1), "name"),
                            (lambda: b.get(b"name"), "name"), (lambda: b.set("name", "1"), "value"),
                            (lambda: b.set_load(HUGE), "load_nm"), (lambda: b.set_load(1, ramp_ticks=-1), "ramp_ticks"),
                            (lambda: b.bump(None), "impulse_nms"), (lambda: b.inject("open_phase", []), "value"),
                            (lambda: b.restore("text"), "state"), (lambda: b.record(["sped_rad_s"]), "signals"),
                            (lambda: b.record([3]), "signals"), (lambda: b.run(lambda sample: 12.0, 1), "command"),
                            (lambda: b.run(lambda sample: drivebench.OFF, -1), "ticks"),
                            (lambda: b.step_all({0: "off"}), "command"), (lambda: b.step_all({}), "count"),
                            (lambda: drivebench.Bench(None), "address"), (lambda: drivebench.Bench("a\0b"), "address"),
                            (lambda: drivebench.Bench("inproc:servo", token=1), "token"),
                            (lambda: drivebench.Bench("inproc:servo", deadline_s=NAN), "deadline_s"),
                            (lambda: drivebench.Bench("inproc:servo", deadline_s=-1), "deadline_s"),
                            (lambda: drivebench.Bench("inproc:servo", deadline_s=1e300), "deadline_s")):
            with self.assertRaises(BadArgument) as wrong:
                call()
            self.assertEqual(wrong.exception.field, field)
            self.assertIn(field.removesuffix("s"), str(wrong.exception))
            self.assertIsInstance(wrong.exception, ValueError)
        self.assertEqual(b.newest().tick, 1)

    # Catches: a command that is taken as another one because two were given, or none.
    def test_a_command_has_exactly_one_kind(self):
        for words in ({}, {"voltages": 1.0, "off": True}, {"short": True, "off": True}, {"voltages": 1.0, "currents": 1.0}):
            with self.assertRaisesRegex(BadArgument, "exactly one of voltages, currents, duties, edges, short and off"):
                self.bench.step(**words)
        for edges, why in (({"d": []}, "must be a mapping from the letters of legs"), ([], "must be a mapping"),
                           ({"a": [(0, "up")]}, "is 'up' but must be \"off\", \"low\" or \"high\""),
                           ({"b": [(n, "low") for n in range(9)]}, "leg b has 9 edges but may have 8"),
                           ({"c": [(-1, "low")]}, "offset_ns is -1"), ({"c": [(1 << 32, "low")]}, "offset_ns is 4294967296")):
            with self.assertRaisesRegex(BadArgument, why):
                self.bench.step(edges=edges)
        with self.assertRaisesRegex(BadArgument, "legs_off is 'd' but must name legs"):
            self.bench.step(duties=0.1, legs_off="d")

    # Catches: a refusal without its code, or one that was carried out in part.
    def test_what_the_bench_refuses_has_its_code(self):
        b = self.bench
        for call, code in ((lambda: b.step(voltages=NAN), Code.NOT_FINITE), (lambda: b.step(currents=1), Code.WRONG_DRIVE),
                           (lambda: b.step(edges={"a": [(0, "low")]}), Code.WRONG_DRIVE),
                           (lambda: b.step(off=True, tick=0), Code.STALE), (lambda: b.set("nope", 1), Code.UNKNOWN_PARAMETER),
                           (lambda: b.set_load(NAN), Code.NOT_FINITE), (lambda: b.bump(math.inf), Code.NOT_FINITE),
                           (lambda: b.inject("nope", 1), Code.UNKNOWN_FAULT), (lambda: b.restore(b"x"), Code.MALFORMED),
                           (lambda: b.step_all({0: drivebench.OFF, "dc-a": drivebench.OFF}), Code.OUT_OF_RANGE)):
            with self.assertRaises(Refused) as refused:
                call()
            self.assertIs(refused.exception.code, code)
            self.assertGreater(len(refused.exception.sentence), 10)
        self.assertEqual(b.newest().tick, 1)

    # Catches: a bench file or an address that is not there and yet opens, or says nothing.
    def test_an_address_that_leads_nowhere_is_no_bench(self):
        with self.assertRaisesRegex(NoBench, 'did you mean "dc-a-voltage"'):
            drivebench.Bench("inproc:dc-a-votlage")
        with self.assertRaisesRegex(NoBench, "nothing answers"):
            drivebench.Bench("tcp:127.0.0.1:1")
        with self.assertRaisesRegex(BadArgument, "not an address"):
            drivebench.Bench("")

    # Catches: a pointer that is used after the bench was closed.
    def test_a_closed_bench_says_so(self):
        with self.bench as b:
            b.close()
        for call in (lambda: b.step(off=True), lambda: b.step_all({0: drivebench.OFF}), b.newest, b.acquire, b.save, b.reset,
                     b.state_hash, lambda: b.restore(b"x"), lambda: b.set_load(0.1)):
            with self.assertRaisesRegex(BenchClosed, "the bench is closed"):
                call()
        self.assertEqual(b.describe().name, "dc-a-voltage")


class Threads(unittest.TestCase):
    # Catches: two calls at once in a library that has one thread at a time: lost ticks, torn samples, a crash.
    def test_threads_take_turns(self):
        with drivebench.Bench("inproc:dc-a-voltage") as bench:
            bench.acquire()
            stepped = []

            def drive():
                stepped.append([bench.step(voltages=1.0).tick for _ in range(500)])

            drivers = [threading.Thread(target=drive) for _ in range(4)]
            for driver in drivers:
                driver.start()
            while any(driver.is_alive() for driver in drivers):
                bench.get("mechanics.inertia_kgm2")
                bench.state_hash()
            self.assertEqual(sorted(sum(stepped, [])), list(range(1, 2001)))

    # Catches: a bench that is closed under the feet of a thread that steps it.
    def test_a_bench_may_be_closed_while_a_thread_steps_it(self):
        bench = drivebench.Bench("inproc:dc-a-voltage")
        bench.acquire()
        begun, ended = threading.Event(), []

        def drive():
            try:
                while True:
                    bench.step(voltages=1.0)
                    begun.set()
            except BenchClosed as closed:
                ended.append(closed)

        driver = threading.Thread(target=drive)
        driver.start()
        self.assertTrue(begun.wait(PATIENCE_S))
        bench.close()
        driver.join(PATIENCE_S)
        self.assertEqual(len(ended), 1)

    # Catches: a child that speaks on its parent's connection, or ends the connection or the server when it exits.
    def test_a_forked_child_must_open_its_own_bench(self):
        with drivebench.serve("dc-a-voltage") as server, drivebench.Bench(server.address) as bench:
            bench.acquire()
            child = os.fork()
            if child == 0:
                os._exit(self.in_the_child(server, bench))
            _, status = os.waitpid(child, 0)
            self.assertEqual(os.waitstatus_to_exitcode(status), 0)
            self.assertEqual(bench.step(voltages=1.0).tick, 1)

    def in_the_child(self, server, bench):
        """0 if all is as it must be."""
        try:
            bench.step(voltages=1.0)
        except BenchClosed as refused:
            bench.close()
            server.stop()
            with drivebench.Bench("inproc:dc-a-voltage") as own:
                return 0 if "before the fork" in str(refused) and own.newest().tick == 0 else 1
        return 2


class Servers(unittest.TestCase):
    # Catches: a client that waits for ever for a server that is gone, and one that goes on afterwards.
    def test_a_killed_server_is_a_lost_link_within_the_deadline(self):
        with drivebench.serve("dc-a-voltage") as server, drivebench.Bench(server.address, deadline_s=2.0) as bench:
            bench.acquire()
            bench.step(voltages=1.0)
            server.process.kill()
            self.lost(lambda: bench.step(voltages=1.0), 2.0)
            self.lost(bench.newest, 2.0)
            self.assertIsNone(server.stop())

    # Catches: a deadline that holds for connecting only.
    def test_a_silent_server_is_a_lost_link_after_the_deadline(self):
        with drivebench.serve("dc-a-voltage") as server, drivebench.Bench(server.address, deadline_s=1.0) as bench:
            server.process.send_signal(signal.SIGSTOP)
            try:
                self.assertIn("no answer within 1 s", self.lost(bench.newest, 1.0))
            finally:
                server.process.send_signal(signal.SIGCONT)

    def lost(self, call, deadline_s):
        """The sentence."""
        start = time.monotonic()
        with self.assertRaises(LinkLost) as lost:
            call()
        self.assertLess(time.monotonic() - start, deadline_s + PATIENCE_S / 2)
        self.assertIs(lost.exception.code, Code.LINK_LOST)
        self.assertGreater(len(str(lost.exception)), 10)
        return str(lost.exception)

    # Catches: a server that does not start, and no word of why.
    def test_a_server_that_does_not_start_says_why(self):
        for words, why in ((["nope"], "no bench file 'nope'"), (["servo", "--mode", "soon"], "--mode"),
                           (["servo", "--duration", "0"], "--duration")):
            with self.assertRaisesRegex(ServerFailed, why):
                drivebench.serve(*words)
        with self.assertRaisesRegex(BadArgument, "options"):
            drivebench.serve("servo", 3)

    # Catches: a server that outlives its block, or that is killed where it could end in order.
    def test_a_server_ends_with_its_block(self):
        with drivebench.serve("servo") as server:
            self.assertEqual(server.ready["bench"], "servo")
        self.assertEqual(server.process.returncode, 0)
        self.assertIsNone(server.stop())
        self.assertEqual(server.errors(), "")


class Asyncio(unittest.TestCase):
    # Catches: calls that block the loop, come out of order, or of two threads at once.
    def test_awaited_calls_give_the_same_samples(self):
        async def drive(address):
            async with drivebench.AsyncBench(address) as bench:
                await bench.acquire()
                calls = [bench.step(voltages=0.1 * k) for k in range(30)]
                samples = await asyncio.gather(*calls)
                return [bytes(each) for each in samples], await bench.state_hash()

        with drivebench.serve("dc-a-voltage") as server:
            self.assertEqual(asyncio.run(drive(server.address)), asyncio.run(drive("inproc:dc-a-voltage")))

    # Catches: a cancelled call that leaves the bench half asked, so that the next answer belongs to another request; a lease
    # that is kept because the closing was cancelled while it waited.
    def test_a_cancelled_call_leaves_the_bench_whole(self):
        async def drive(address):
            async with drivebench.AsyncBench(address) as bench:
                await bench.acquire()
                cancelled = 0
                for delay_s in (0.0, 0.0001, 0.001, 0.01) * 5:
                    task = asyncio.create_task(bench.run(lambda sample: drivebench.OFF, 20))
                    await asyncio.sleep(delay_s)
                    task.cancel()
                    try:
                        await task  # it may have come to its end before
                    except asyncio.CancelledError:
                        cancelled += 1
                    sample = await bench.newest()
                    self.assertEqual(sample.tick % 20, 0)
                    self.assertEqual((await bench.step(off=True)).tick, sample.tick + 1)
                    await bench.run(lambda sample: drivebench.OFF, 19)
                self.assertGreaterEqual(cancelled, 5)
                long = asyncio.create_task(bench.run(lambda sample: drivebench.OFF, 100))
                await asyncio.sleep(0)
                closing = asyncio.create_task(bench.close())
                await asyncio.sleep(0)
                closing.cancel()
                self.assertEqual((await long).tick % 20, 0)
            bench._worker.shutdown()  # waits for its last call
            self.assertIn("closed", repr(bench._bench))
            with self.assertRaises(BenchClosed):
                await bench.newest()

        with drivebench.serve("dc-a-voltage") as server:
            asyncio.run(drive(server.address))
            with drivebench.Bench(server.address) as after:
                after.acquire()  # it was released

    # Catches: a new call of Bench that asyncio does not have.
    def test_every_call_can_be_awaited(self):
        self.assertEqual({name for name in dir(drivebench.Bench) if not name.startswith("_")},
                         {name for name in vars(drivebench.AsyncBench) if not name.startswith("_")})

    # Catches: an exception that stays in the worker.
    def test_failures_are_raised_where_they_are_awaited(self):
        async def drive():
            with self.assertRaises(BenchClosed):
                await drivebench.AsyncBench("inproc:servo").newest()
            with self.assertRaises(NoBench):
                async with drivebench.AsyncBench("inproc:nope"):
                    pass
            async with drivebench.AsyncBench("inproc:servo") as bench:
                with self.assertRaises(Refused):
                    await bench.step(off=True)

        asyncio.run(drive())


if __name__ == "__main__":
    unittest.main(verbosity=2)
