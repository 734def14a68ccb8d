#!/usr/bin/python3
"""Wire tests: the server program as its clients meet it. Each test names the mistake that it would catch."""
import math
import os
import pathlib
import resource
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

from wire_client import BENCHES, PATIENCE_S, REPOSITORY, SERVER, Closed, Client, Server, frame, pb

TWO_AXES = (BENCHES / "servo.toml").read_text(encoding="utf-8").replace(
    "../motors/", f"{REPOSITORY}/configs/motors/")
TWO_AXES += TWO_AXES[TWO_AXES.index("[[axis]]"):].replace('name = "servo"', 'name = "second"', 1)


def until(condition, what):
    """Waits for something that another process does."""
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

    def assertDone(self, answer):
        self.assertEqual(answer.WhichOneof("kind"), "done", answer)


class Hello(WireTest):
    @classmethod
    def setUpClass(cls):
        cls.shared = Server()

    @classmethod
    def tearDownClass(cls):
        cls.shared.__exit__()

    def still_serves(self):
        self.assertEqual(self.client(self.shared).welcome.protocol, 1)

    def test_welcome_describes_the_bench(self):
        """A description that lacks an axis, a signal or the schema of the wire."""
        welcome = self.client(self.shared).welcome
        self.assertEqual([axis.name for axis in welcome.bench.axes], ["servo"])
        self.assertEqual(welcome.bench.mode, pb.MODE_LOCKSTEP)
        self.assertAlmostEqual(welcome.bench.period_s, 125e-6)
        self.assertEqual([s.name for s in welcome.bench.signals], [f.name for f in pb.Sample.DESCRIPTOR.fields])
        self.assertIn(b"drivebench.v1", welcome.descriptor_set)
        self.assertNotEqual(welcome.build_id, "")

    def test_first_message_must_be_hello(self):
        """A request that is carried out for somebody who has not introduced himself."""
        for kind in ({"lease": pb.LeaseRequest(action=1)}, {"status_request": pb.StatusRequest()},
                     {"exchange": pb.Exchange()}):
            client = self.client(self.shared, hello=False)
            self.assertRefused(client.ask(**kind), pb.REFUSAL_UNAUTHENTICATED)
            self.assertTrue(client.is_closed())

    def test_protocol_version_must_meet_ours(self):
        """A version check with one bound only."""
        for low, high in ((0, 0), (2, 9)):
            client = self.client(self.shared, hello=False)
            answer = client.ask(hello=pb.Hello(protocol_min=low, protocol_max=high))
            self.assertRefused(answer, pb.REFUSAL_VERSION, "protocol_max")
            self.assertTrue(client.is_closed())
        client = self.client(self.shared, hello=False)
        self.assertEqual(client.ask(hello=pb.Hello(protocol_min=0, protocol_max=7)).welcome.protocol, 1)

    def test_tcp_01_lengths_that_cannot_be_end_the_session(self):
        """A length that is believed before it is checked: an allocation of 4 GiB, or an endless wait."""
        for length in (0, 4097, 2**31 - 1, 2**31, 2**32 - 1):
            client = self.client(self.shared, hello=False)
            client.send_bytes(struct.pack(">I", length))
            self.assertRefused(client.receive(), pb.REFUSAL_MALFORMED, "frame")
            self.assertTrue(client.is_closed(), length)
        self.still_serves()

    def test_tcp_01_the_cap_grows_with_hello_and_holds(self):
        """An off-by-one in a cap, or a cap that hello does not raise."""
        before = self.client(self.shared, hello=False)
        hello = pb.Envelope(id=9, hello=pb.Hello(protocol_min=1, protocol_max=1)).SerializeToString()
        padding = b"\xf2\x7f"  # an unknown field of bytes, number 2046
        size = 4096 - len(hello) - len(padding) - 2
        before.send_bytes(frame(hello + padding + bytes([size & 0x7F | 0x80, size >> 7]) + bytes(size)))
        self.assertEqual(before.answer_to(9).welcome.protocol, 1)
        request = pb.Envelope(id=10, status_request=pb.StatusRequest()).SerializeToString()
        size = 65536 - len(request) - len(padding) - 3
        filler = padding + bytes([size & 0x7F | 0x80, size >> 7 & 0x7F | 0x80, size >> 14]) + bytes(size)
        self.assertEqual(len(request + filler), 65536)
        before.send_bytes(frame(request + filler))
        self.assertEqual(before.answer_to(10).WhichOneof("kind"), "status")
        before.send_bytes(struct.pack(">I", 65537))
        self.assertRefused(before.receive(), pb.REFUSAL_MALFORMED, "frame")
        self.assertTrue(before.is_closed())

    def test_tcp_02_a_truncated_frame_ends_with_its_connection(self):
        """A session that waits for ever for the rest of a frame of a peer that is gone."""
        watcher = self.client(self.shared)
        before = watcher.status().sessions
        client = self.client(self.shared)
        client.send_bytes(struct.pack(">I", 100) + b"half")
        self.assertEqual(watcher.status().sessions, before + 1)
        client.close()
        until(lambda: watcher.status().sessions == before, "the session ended")

    def test_tcp_03_one_byte_at_a_time(self):
        """A reader that takes a read for a frame."""
        client = self.client(self.shared, hello=False)
        for byte in frame(pb.Envelope(id=5, hello=pb.Hello(protocol_min=1, protocol_max=1)).SerializeToString()):
            client.send_bytes(bytes([byte]))
        self.assertEqual(client.answer_to(5).welcome.protocol, 1)

    def test_tcp_03_many_requests_in_one_segment_are_answered_in_order(self):
        """Frames behind the first one of a read that are lost or answered out of order."""
        client = self.client(self.shared)
        ids = range(1000, 1200)
        client.send_bytes(b"".join(
            frame(pb.Envelope(id=i, read_parameters=pb.ReadParameters(names=["amplifier.gain"])).SerializeToString())
            for i in ids))
        for i in ids:
            self.assertEqual(client.answer_to(i).parameter_values.parameters[0].name, "amplifier.gain")

    def test_tcp_04_strangers_are_closed(self):
        """Foreign protocols that keep a session open or take the server down."""
        for greeting in (b"GET / HTTP/1.1\r\nHost: bench\r\n\r\n", b"SSH-2.0-OpenSSH_9.2p1\r\n",
                         bytes.fromhex("16030100c8010000c40303") + os.urandom(192),  # TLS client hello
                         b"\x00\x00\x00\x06\xff\xff\xff\xff\xff\xff", b"\x00\x00\x00\x02\x08"):
            client = self.client(self.shared, hello=False)
            client.send_bytes(greeting)
            client.socket.shutdown(socket.SHUT_WR)
            self.assertTrue(client.is_closed(), greeting)
        self.still_serves()

    def test_tcp_07_unknown_fields_are_ignored_and_the_last_scalar_counts(self):
        """A server that refuses what a newer client adds, or takes the first of two values."""
        client = self.client(self.shared)
        twice = b"\x08\x63" + b"\x82\x01\x00" + b"\x08\x07" + b"\xa0\x7f\x01"  # id 99, status_request, id 7, unknown
        client.send_bytes(frame(twice))
        self.assertEqual(client.answer_to(7).WhichOneof("kind"), "status")

    def test_tcp_07_answers_are_no_requests(self):
        """A server that obeys a message which only servers send."""
        client = self.client(self.shared)
        for kind in ({"done": pb.Done()}, {"welcome": pb.Welcome()}, {"samples": pb.Samples()}, {}):
            self.assertRefused(client.ask(**kind) if kind else self.empty(client), pb.REFUSAL_MALFORMED, "kind")

    @staticmethod
    def empty(client):
        client.last_id += 1
        client.send_bytes(frame(pb.Envelope(id=client.last_id).SerializeToString()))
        return client.answer_to(client.last_id)

    def test_tcp_08_text_that_is_not_utf_8_ends_the_session(self):
        """A name that breaks the terminal or the JSON of somebody else."""
        client = self.client(self.shared)
        client.send_bytes(frame(b"\x08\x01\x6a\x04\x12\x02\xff\xfe"))  # write_parameter { name = FF FE }
        self.assertRefused(client.receive(), pb.REFUSAL_MALFORMED)
        self.assertTrue(client.is_closed())

    def test_silent_connection_is_closed(self):
        """Connections that never say hello and stay for ever."""
        client = self.client(self.shared, hello=False)
        self.assertTrue(client.is_closed())

    def test_long_client_name_is_refused(self):
        """A log that a client fills."""
        client = self.client(self.shared, hello=False)
        answer = client.ask(hello=pb.Hello(protocol_min=1, protocol_max=1, client="x" * 101))
        self.assertRefused(answer, pb.REFUSAL_OUT_OF_RANGE, "client")


class Lease(WireTest):
    def test_one_owner_at_a_time(self):
        """Two controllers on one axis; a lease that outlives its holder."""
        server = self.server()
        first, second = self.client(server), self.client(server)
        self.assertDone(first.lease())
        self.assertNotEqual(first.owner, 0)
        self.assertRefused(second.lease(), pb.REFUSAL_OWNED, "axis")
        self.assertRefused(second.lease(pb.LeaseRequest.ACTION_RENEW), pb.REFUSAL_NOT_OWNER)
        self.assertRefused(second.lease(pb.LeaseRequest.ACTION_RELEASE), pb.REFUSAL_NOT_OWNER)
        self.assertRefused(second.exchange(0), pb.REFUSAL_NOT_OWNER)
        self.assertEqual(first.step(0).owner, first.owner)
        self.assertDone(first.lease(pb.LeaseRequest.ACTION_RENEW))
        self.assertDone(first.lease(pb.LeaseRequest.ACTION_RELEASE))
        self.assertDone(second.lease())
        self.assertNotEqual(first.owner, second.owner)

    def test_a_lease_ends_with_its_connection(self):
        """An axis that nobody can take because its owner is dead: after close, half-close and reset."""
        server = self.server()
        for end in ("close", "half", "reset"):
            owner = self.client(server)
            self.assertDone(owner.lease())
            tick = owner.newest().tick
            owner.step(tick)
            if end == "half":
                owner.socket.shutdown(socket.SHUT_WR)
            elif end == "reset":
                owner.send_bytes(struct.pack(">I", 50) + b"mid-frame")
                owner.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            if end != "half":
                owner.close()
            heir = self.client(server)
            until(lambda: heir.lease().WhichOneof("kind") == "done", f"a lease after {end}")
            sample = heir.newest()
            self.assertDone(heir.ask(clear_faults=pb.ClearFaults()))
            heir.step(sample.tick)
            heir.lease(pb.LeaseRequest.ACTION_RELEASE)
            heir.close()

    def test_a_controller_that_vanishes_leaves_a_latched_fault(self):
        """Taking over a moving axis as if nothing had happened."""
        server = self.server()
        owner = self.client(server)
        owner.lease()
        for tick in range(5):
            owner.step(tick, 20.0)
        owner.close()
        heir = self.client(server)
        until(lambda: heir.lease().WhichOneof("kind") == "done", "the lease is free")
        self.assertRefused(heir.exchange(5), pb.REFUSAL_LATCHED)
        self.assertDone(heir.ask(clear_faults=pb.ClearFaults()))
        self.assertEqual(heir.step(5).state, 1)

    def test_actions_that_are_none_are_refused(self):
        """Clients that write what only recordings may hold (ACTION_LOST), or an unknown number."""
        client = self.client(self.server())
        for action in (0, 4, 77):
            self.assertRefused(client.lease(action), pb.REFUSAL_OUT_OF_RANGE, "action")

    def test_free_mode_takes_no_controller(self):
        """A controller that believes it controls a run which does not wait for it."""
        client = self.client(self.server("--mode", "free"))
        self.assertRefused(client.lease(), pb.REFUSAL_WRONG_MODE)

    def test_a_lease_that_is_asked_for_and_left_at_once_is_free_again(self):
        """An answer that comes after the session has ended and leaves the axis to a ghost."""
        server = self.server("--mode", "realtime")
        for _ in range(30):
            ghost = self.client(server)
            ghost.send(lease=pb.LeaseRequest(action=pb.LeaseRequest.ACTION_ACQUIRE))
            ghost.close()
        heir = self.client(server)
        ticks = heir.newest().tick
        until(lambda: heir.lease().WhichOneof("kind") == "done", "the lease is free")
        self.assertLess(heir.newest().tick - ticks, 8000, "free only because the lease had run out")


class Exchange(WireTest):
    def delay_test(self, delay, shown_after):
        client = self.client(self.server("--command-delay-ticks", str(delay)))
        client.lease()
        self.assertEqual(client.newest().tick, 0)
        seen = []
        for tick in range(6):
            sample = client.step(tick, 10.0 + tick, -5.0 - tick)
            self.assertEqual(sample.tick, tick + 1)
            seen.append((sample.u_a_v, sample.u_b_v, sample.command_tick, sample.command_age_ticks))
        for tick, (u_a, u_b, answered, age) in enumerate(seen):
            if tick < shown_after:
                self.assertEqual((u_a, u_b), (0.0, 0.0))
                continue
            self.assertEqual((u_a, u_b), (10.0 + tick - shown_after, -5.0 - tick + shown_after))
            self.assertEqual(age, shown_after)
            self.assertEqual(answered, tick - shown_after)

    def test_without_delay_a_command_holds_in_its_own_tick(self):
        """command(k) that takes effect at k+1 although the delay is 0."""
        self.delay_test(0, 0)

    def test_with_delay_a_command_holds_one_tick_later(self):
        """The delay of a digital controller that is left out or doubled."""
        self.delay_test(1, 1)

    def test_stale_duplicate_and_future_commands_are_refused_and_counted(self):
        """A command that is applied twice, or moves time."""
        client = self.client(self.server())
        client.lease()
        for tick in range(3):
            client.step(tick, 1.0)
        for tick in (2, 1, 0, 4, 1000, 2**53, 2**63, 2**64 - 1):
            self.assertRefused(client.exchange(tick, 9.0), pb.REFUSAL_STALE, "commands")
        self.assertEqual(client.newest().tick, 3)
        sample = client.step(3, 2.0)
        self.assertEqual(sample.refused_commands, 8)
        self.assertEqual(sample.u_a_v, 2.0)

    def test_cmd_11_values_that_are_not_finite_never_arrive(self):
        """NaN through a limiter is full voltage."""
        client = self.client(self.server())
        client.lease()
        client.step(0, 3.0, 4.0)
        for bad in (math.nan, math.inf, -math.inf):
            self.assertRefused(client.exchange(1, bad, 0.0), pb.REFUSAL_NOT_FINITE)
            self.assertRefused(client.exchange(1, 0.0, bad), pb.REFUSAL_NOT_FINITE)
        self.assertEqual(client.newest().tick, 1)
        sample = client.step(1, -0.0, 5e-324)
        self.assertEqual((sample.u_a_v, sample.u_b_v), (0.0, 5e-324))
        sample = client.step(2, 1e308, -1e308)
        self.assertEqual((sample.u_a_v, sample.u_b_v), (80.0, -80.0))
        self.assertTrue(sample.faults & 1, "saturation is said")

    def test_unknown_axes_and_gates_are_refused(self):
        """An index that is used before it is checked."""
        client = self.client(self.server())
        client.lease()
        for axis in (1, 64, 2**32 - 1):
            self.assertRefused(client.exchange(0, axis=axis), pb.REFUSAL_UNKNOWN_AXIS, "axis")
            self.assertRefused(client.lease(axis=axis), pb.REFUSAL_UNKNOWN_AXIS, "axis")
            for kind in ({"subscribe": pb.Subscribe(axis=axis, decimation=1)}, {"set_load": pb.SetLoad(axis=axis)},
                         {"read_parameters": pb.ReadParameters(axis=axis)},
                         {"write_parameter": pb.WriteParameter(axis=axis)}, {"clear_faults": pb.ClearFaults(axis=axis)}):
                self.assertRefused(client.ask(**kind), pb.REFUSAL_UNKNOWN_AXIS, "axis")
        self.assertRefused(client.exchange(0, gates=3), pb.REFUSAL_OUT_OF_RANGE, "commands.gates")
        both = pb.Exchange(commands=[pb.Command(tick=0), pb.Command(tick=0)])
        self.assertRefused(client.ask(exchange=both), pb.REFUSAL_OUT_OF_RANGE, "commands.axis")

    def test_the_tick_waits_for_all_controllers(self):
        """Lockstep that runs with a command missing, or an exchange that is answered before its tick."""
        server = self.server(text=TWO_AXES)
        one, two = self.client(server), self.client(server)
        one.lease(axis=0)
        two.lease(axis=1)
        waiting = one.send(exchange=pb.Exchange(commands=[pb.Command(axis=0, tick=0, gates=1, u_a_v=1.0)]))
        self.assertEqual(two.newest(axis=1).tick, 0)
        self.assertRefused(two.exchange(0, axis=0), pb.REFUSAL_NOT_OWNER)
        self.assertEqual(two.step(0, axis=1).tick, 1)
        self.assertEqual(one.answer_to(waiting).exchange_reply.samples[0].sample.tick, 1)

    def test_the_tick_goes_on_when_a_controller_leaves(self):
        """A controller that waits for ever for a second one that is gone."""
        server = self.server(text=TWO_AXES)
        one, two = self.client(server), self.client(server)
        one.lease(axis=0)
        two.lease(axis=1)
        waiting = one.send(exchange=pb.Exchange(commands=[pb.Command(axis=0, tick=0, gates=1)]))
        two.newest()
        two.close()
        self.assertEqual(one.answer_to(waiting).exchange_reply.samples[0].sample.tick, 1)

    def test_cmd_11_an_exchange_is_refused_as_a_whole(self):
        """The command of one axis that is kept although its exchange was refused, and bars the next try."""
        client = self.client(self.server(text=TWO_AXES))
        client.lease(axis=0)
        client.lease(axis=1)
        bad = pb.Exchange(commands=[pb.Command(axis=0, tick=0, gates=1, u_a_v=5.0),
                                    pb.Command(axis=1, tick=0, gates=1, u_a_v=math.nan)])
        self.assertRefused(client.ask(exchange=bad), pb.REFUSAL_NOT_FINITE)
        good = pb.Exchange(commands=[pb.Command(axis=axis, tick=0, gates=1, u_a_v=7.0) for axis in (0, 1)])
        answer = client.ask(exchange=good)
        self.assertEqual(answer.WhichOneof("kind"), "exchange_reply", answer)
        self.assertEqual([s.sample.u_a_v for s in answer.exchange_reply.samples], [7.0, 7.0])

    def test_a_second_exchange_while_one_waits_is_refused(self):
        """A pipeline of commands that grows without bound."""
        server = self.server(text=TWO_AXES)
        one, two = self.client(server), self.client(server)
        one.lease(axis=0)
        two.lease(axis=1)
        first = one.send(exchange=pb.Exchange(commands=[pb.Command(axis=0, tick=0)]))
        second = one.send(exchange=pb.Exchange(commands=[pb.Command(axis=0, tick=0)]))
        self.assertRefused(one.answer_to(second), pb.REFUSAL_BUSY)
        two.step(0, axis=1)
        self.assertEqual(one.answer_to(first).WhichOneof("kind"), "exchange_reply")


class Parameters(WireTest):
    def test_limits_and_read_back(self):
        """A write that is said to be done and is not, or one past its limits that is."""
        server = self.server()
        client = self.client(server)
        client.lease()
        client.step(0)

        def write(name, value):
            return client.ask(write_parameter=pb.WriteParameter(name=name, value=value))

        def read(*names):
            return client.ask(read_parameters=pb.ReadParameters(names=names)).parameter_values.parameters

        name = "machine.rotor_resistance_ohm"
        self.assertEqual(read(name)[0].value, 3.9)
        self.assertDone(write(name, 5.85))
        self.assertEqual(read(name)[0].value, 5.85)
        self.assertEqual(read("amplifier.gain", name)[1].value, 5.85)
        self.assertRefused(write(name, 0.0), pb.REFUSAL_OUT_OF_RANGE, "value")
        self.assertRefused(write(name, -1.0), pb.REFUSAL_OUT_OF_RANGE, "value")
        self.assertRefused(write(name, math.nan), pb.REFUSAL_NOT_FINITE, "value")
        self.assertRefused(write(name, math.inf), pb.REFUSAL_NOT_FINITE, "value")
        self.assertRefused(write("machine.rotor_resistance", 4.0), pb.REFUSAL_UNKNOWN_PARAMETER, "name")
        self.assertRefused(write("machine.pole_pairs", 4.0), pb.REFUSAL_READ_ONLY, "name")
        self.assertRefused(write("amplifier.over_current_trip", 0.5), pb.REFUSAL_OUT_OF_RANGE, "value")
        # Coulomb friction above the static one breaks a rule between two parameters.
        self.assertRefused(write("mechanics.coulomb_friction_nm", 0.1), pb.REFUSAL_OUT_OF_RANGE, "value")
        self.assertDone(write("mechanics.static_friction_nm", 0.2))
        self.assertDone(write("mechanics.coulomb_friction_nm", 0.1))
        self.assertRefused(client.ask(read_parameters=pb.ReadParameters(names=["nonsense"])),
                           pb.REFUSAL_UNKNOWN_PARAMETER, "names")
        everything = read()
        self.assertEqual(len(everything), len({p.name for p in everything}))
        self.assertEqual(next(p.value for p in everything if p.name == name), 5.85)
        for p in everything:
            self.assertTrue(p.minimum <= p.value <= p.maximum, p.name)
        # Every live parameter accepts its own value and both limits' outside is refused.
        for p in everything:
            if p.live:
                self.assertDone(write(p.name, p.value))
                self.assertRefused(write(p.name, math.nextafter(p.maximum, math.inf)), pb.REFUSAL_OUT_OF_RANGE)

    def test_only_the_owner_writes(self):
        """A viewer that changes the plant under a controller."""
        server = self.server()
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        owner.step(0)
        for kind in ({"write_parameter": pb.WriteParameter(name="amplifier.gain", value=1.1)},
                     {"set_load": pb.SetLoad(load_nm=0.1)}, {"clear_faults": pb.ClearFaults()}):
            self.assertRefused(viewer.ask(**kind), pb.REFUSAL_NOT_OWNER)
            self.assertDone(owner.ask(**kind))

    def test_the_owner_may_write_before_the_first_tick(self):
        """Ownership that is looked up in a sample taken before the lease."""
        client = self.client(self.server())
        client.lease()
        self.assertDone(client.ask(write_parameter=pb.WriteParameter(name="amplifier.gain", value=1.1)))
        self.assertDone(client.ask(set_load=pb.SetLoad(load_nm=0.1)))
        client.lease(pb.LeaseRequest.ACTION_RELEASE)
        self.assertRefused(client.ask(set_load=pb.SetLoad(load_nm=0.1)), pb.REFUSAL_NOT_OWNER)

    def test_a_load_comes_at_its_tick(self):
        """A load that starts a tick early or late, or a ramp that is a step."""
        client = self.client(self.server())
        client.lease()
        client.step(0)
        self.assertDone(client.ask(set_load=pb.SetLoad(load_nm=0.1, at_tick=5)))
        self.assertDone(client.ask(set_load=pb.SetLoad(load_nm=0.3, at_tick=8, ramp_ticks=4)))
        loads = {tick + 1: client.step(tick).load_nm for tick in range(1, 15)}
        for tick in range(2, 6):
            self.assertEqual(loads[tick], 0.0, tick)
        for tick in range(6, 9):
            self.assertEqual(loads[tick], 0.1, tick)
        for tick in range(9, 16):
            self.assertAlmostEqual(loads[tick], min(0.1 + 0.05 * (tick - 8), 0.3), places=12, msg=tick)
        self.assertRefused(client.ask(set_load=pb.SetLoad(load_nm=math.nan)), pb.REFUSAL_NOT_FINITE, "load_nm")
        self.assertRefused(client.ask(set_load=pb.SetLoad(load_nm=2e6)), pb.REFUSAL_OUT_OF_RANGE, "load_nm")
        self.assertRefused(client.ask(set_load=pb.SetLoad(at_tick=2**60)), pb.REFUSAL_OUT_OF_RANGE)


class Subscriptions(WireTest):
    def test_decimation_and_signals(self):
        """Samples of the wrong ticks, signals that nobody asked for, a subscription that cannot be ended."""
        server = self.server()
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        self.assertDone(viewer.ask(subscribe=pb.Subscribe(decimation=3, signals=["tick", "u_a_v"])))
        for tick in range(30):
            owner.step(tick, 5.0, 6.0)
        self.assertEqual(viewer.newest().tick, 30)
        samples = [s for message in viewer.samples for s in message.samples]
        self.assertEqual([s.tick for s in samples], list(range(3, 31, 3)))
        for s in samples:
            self.assertEqual({f.name for f, _ in s.ListFields()}, {"tick", "u_a_v"})
        self.assertEqual(sum(message.dropped for message in viewer.samples), 0)
        # A second request replaces the first, and 0 ends it.
        self.assertDone(viewer.ask(subscribe=pb.Subscribe(decimation=1)))
        owner.step(30, 5.0, 6.0)
        viewer.newest()
        self.assertEqual(viewer.samples[-1].samples[-1].tick, 31)
        self.assertEqual(viewer.samples[-1].samples[-1].u_b_v, 6.0)
        self.assertDone(viewer.ask(subscribe=pb.Subscribe(decimation=0)))
        count = len(viewer.samples)
        owner.step(31)
        viewer.newest()
        self.assertEqual(len(viewer.samples), count)

    def test_unknown_signal_changes_nothing(self):
        """A misspelt name that is left out in silence, or a refusal that ends what was running."""
        server = self.server()
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        viewer.ask(subscribe=pb.Subscribe(decimation=1, signals=["tick"]))
        self.assertRefused(viewer.ask(subscribe=pb.Subscribe(decimation=1, signals=["tick", "speed"])),
                           pb.REFUSAL_UNKNOWN_SIGNAL, "signals")
        owner.step(0)
        viewer.newest()
        self.assertEqual(len(viewer.samples), 1)

    def test_tcp_10_a_slow_reader_loses_samples_and_is_told_how_many(self):
        """A queue that grows for a slow client, or a loss that nobody tells of."""
        server = self.server()
        owner = self.client(server)
        slow = self.client(server, receive_buffer=4096)
        owner.lease()
        slow.ask(subscribe=pb.Subscribe(decimation=1))
        ticks = 0
        # Nothing is read for as long as it takes to fill both socket buffers and the ring of 256 samples; the
        # server cuts after two seconds without progress, these exchanges take a fraction of that.
        for ticks in range(1, 4001):
            owner.step(ticks - 1, 1.0)
        slow.send(status_request=pb.StatusRequest())
        seen, dropped, newest = 0, 0, 0
        while newest < ticks:
            envelope = slow.receive()
            if envelope.WhichOneof("kind") != "samples":
                continue
            dropped += envelope.samples.dropped
            for sample in envelope.samples.samples:
                self.assertEqual(sample.tick, seen + dropped + 1, "gaps add up")
                seen += 1
                newest = sample.tick
        self.assertEqual(seen + dropped, ticks)
        self.assertGreater(dropped, 0)

    def test_tcp_10_a_reader_that_stops_is_cut_and_the_others_go_on(self):
        """A dead viewer that is fed for ever, or one that stops the bench."""
        server = self.server(unix=True)
        owner, viewer = self.client(server), self.client(server)
        stopped = [self.client(server, receive_buffer=4096) for _ in range(4)]
        stopped += [self.client(server, unix=True) for _ in range(4)]  # where no timeout of TCP helps
        owner.lease()
        for client in stopped:
            client.ask(subscribe=pb.Subscribe(decimation=1))
        viewer.ask(subscribe=pb.Subscribe(decimation=1, signals=["tick"]))
        tick, end = 0, time.monotonic() + PATIENCE_S
        while owner.status().sessions > 2:
            self.assertLess(time.monotonic(), end, "nobody was cut")
            for _ in range(200):
                owner.step(tick, 1.0)
                tick += 1
            viewer.newest()
        ticks = [s.tick for message in viewer.samples for s in message.samples]
        self.assertEqual(ticks, list(range(1, tick + 1)))
        for client in stopped:
            self.assertTrue(client.is_closed())

    def test_a_reader_that_never_reads_its_answers_is_cut(self):
        """Answers queued without bound for a client that only asks."""
        server = self.server()
        greedy, other = self.client(server, receive_buffer=4096), self.client(server)
        request = frame(pb.Envelope(id=1, read_parameters=pb.ReadParameters()).SerializeToString())
        greedy.socket.settimeout(PATIENCE_S)
        before = self.peak_memory_kib(server)
        with self.assertRaises(OSError):
            for _ in range(100_000):
                greedy.send_bytes(request * 100)
        until(lambda: other.status().sessions == 1, "the greedy one is gone")
        self.assertLess(self.peak_memory_kib(server) - before, 16 * 1024)

    @staticmethod
    def peak_memory_kib(server):
        status = pathlib.Path(f"/proc/{server.process.pid}/status").read_text(encoding="utf-8")
        return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1])


class Determinism(WireTest):
    @staticmethod
    def script(tick):
        return 30.0 * math.cos(0.02 * tick), 30.0 * math.sin(0.02 * tick)

    def run_script(self, viewers=0, unix=False, ticks=2000, options=()):
        server = self.server(*options, unix=True)
        owner = self.client(server, unix=unix)
        watching = [self.client(server) for _ in range(viewers)]
        for n, viewer in enumerate(watching):
            viewer.ask(subscribe=pb.Subscribe(decimation=n + 1))
        stop = threading.Event()

        def read(viewer):
            while not stop.is_set():
                try:
                    viewer.status()
                except Closed:
                    return

        readers = [threading.Thread(target=read, args=(viewer,)) for viewer in watching]
        for reader in readers:
            reader.start()
        owner.lease()
        owner.step(0)
        owner.ask(set_load=pb.SetLoad(load_nm=0.05, at_tick=500, ramp_ticks=100))
        for tick in range(1, ticks):
            if tick == 1000:
                owner.ask(write_parameter=pb.WriteParameter(name="machine.rotor_resistance_ohm", value=5.0))
            owner.step(tick, *self.script(tick))
        status = owner.status()
        self.assertEqual(status.tick, ticks)
        stop.set()
        for reader in readers:
            reader.join()
        self.assertEqual(server.stop(), 0)
        return status.state_hash, server.verdict

    def test_det_01_the_same_commands_give_the_same_state(self):
        """Viewers, their number, or the kind of socket that change the plant by a bit."""
        alone, verdict = self.run_script()
        again, _ = self.run_script()
        watched, _ = self.run_script(viewers=8)
        local, _ = self.run_script(unix=True)
        self.assertEqual(f"{alone:016x}", f"{again:016x}")
        self.assertEqual(f"{alone:016x}", f"{watched:016x}")
        self.assertEqual(f"{alone:016x}", f"{local:016x}")
        self.assertTrue(verdict["exact"])
        other, _ = self.run_script(ticks=1999)
        self.assertNotEqual(other, alone)


class Realtime(WireTest):
    def owner_at_work(self, server, ticks=20):
        """A controller that has sent commands and stopped; real time goes on without it."""
        owner = self.client(server)
        self.assertDone(owner.lease())
        for _ in range(ticks):
            answer = owner.exchange(owner.newest().tick, 5.0)
            self.assertIn(answer.WhichOneof("kind"), ("exchange_reply", "refusal"))
        return owner

    def test_cmd_02_silence_is_a_latched_timeout(self):
        """A plant that goes on with the last command of a controller that hangs."""
        server = self.server("--mode", "realtime")
        owner = self.owner_at_work(server)
        until(lambda: owner.newest().state == 3, "timeout")
        sample = owner.newest()
        self.assertTrue(sample.faults & (1 << 9), hex(sample.faults))
        self.assertGreaterEqual(sample.missed_commands, 20)
        self.assertRefused(owner.exchange(sample.tick, 5.0), pb.REFUSAL_LATCHED)
        self.assertEqual(owner.newest().state, 3, "a command does not clear it")
        self.assertRefused(self.client(server).ask(clear_faults=pb.ClearFaults()), pb.REFUSAL_NOT_OWNER)
        self.assertDone(owner.ask(clear_faults=pb.ClearFaults()))
        sample = owner.newest()
        self.assertEqual((sample.state, sample.faults & (1 << 9)), (0, 0))
        until(lambda: owner.exchange(owner.newest().tick).WhichOneof("kind") == "exchange_reply", "a command")

    def test_own_03_the_lease_of_a_silent_owner_ends(self):
        """An axis that is lost to a client which keeps its socket open and does nothing."""
        server = self.server("--mode", "realtime")
        owner = self.owner_at_work(server)
        heir = self.client(server)
        self.assertRefused(heir.lease(), pb.REFUSAL_OWNED)
        until(lambda: heir.lease().WhichOneof("kind") == "done", "the lease ran out")
        self.assertRefused(owner.exchange(owner.newest().tick), pb.REFUSAL_NOT_OWNER)
        self.assertRefused(owner.lease(), pb.REFUSAL_OWNED)

    def test_realtime_never_waits_for_commands(self):
        """A paced bench that stands still without a controller."""
        client = self.client(self.server("--mode", "realtime"))
        first = client.newest().tick
        until(lambda: client.newest().tick > first + 100, "time goes on")

    def test_duration_ends_the_run_with_a_verdict(self):
        """A run of given length that is a tick short, or does not end."""
        for mode in ("realtime", "free"):
            server = self.server("--mode", mode, "--duration", "0.25")
            out = server.process.stdout.read()  # not communicate(): the verdict may have come with the first line
            self.assertEqual(server.process.wait(timeout=PATIENCE_S), 0)
            self.assertIn('"ticks":2000', out)


class Ending(WireTest):
    def replayed(self, file):
        done = subprocess.run([str(SERVER), "--replay", str(file), "--json"], capture_output=True, text=True,
                              timeout=PATIENCE_S, check=False)
        return done.returncode, done.stdout

    def test_rec_10_a_signal_ends_it_and_the_recording_replays(self):
        """A recording without its end; a server that outlives its signal."""
        for mode in ("lockstep", "realtime", "free"):
            for number in (signal.SIGTERM, signal.SIGINT):
                with self.subTest(mode=mode, signal=number):
                    folder = self.server().folder
                    file = folder / f"{mode}-{number}.mcap"
                    server = self.server("--mode", mode, "--record", str(file))
                    client = self.client(server)
                    viewer = self.client(server)
                    viewer.ask(subscribe=pb.Subscribe(decimation=1))
                    if mode != "free":
                        client.lease()
                        for _ in range(200):
                            client.exchange(client.newest().tick, 12.0, -3.0)
                        client.ask(write_parameter=pb.WriteParameter(name="amplifier.gain", value=1.05))
                        client.exchange(client.newest().tick, math.nan)
                    started = time.monotonic()
                    self.assertEqual(server.stop(number), 0)
                    self.assertLess(time.monotonic() - started, 2.0 + 10.0)
                    code, out = self.replayed(file)
                    self.assertEqual(code, 0, out)
                    self.assertIn(f'"state_hash":"{server.verdict["state_hash"]}"', out)

    def test_rec_04_a_full_disk_costs_the_recording_and_nothing_else(self):
        """A bench that dies with its disk, or a recording that is called whole although it is not."""
        folder = self.server().folder
        file = folder / "cut.mcap"
        server = self.server("--record", str(file), before=lambda: resource.setrlimit(
            resource.RLIMIT_FSIZE, (100_000, 100_000)))
        client = self.client(server)
        client.lease()
        for tick in range(3000):
            client.step(tick, 12.0, -3.0)
        self.assertEqual(server.stop(), 1)
        self.assertGreater(server.verdict["gaps"], 0)
        self.assertFalse(server.verdict["exact"])
        self.assertEqual(self.replayed(file)[0], 2)

    def test_rec_07_a_recording_is_never_overwritten(self):
        """The measurement of yesterday that today's overwrites."""
        folder = self.server().folder
        (folder / "there.mcap").write_text("precious", encoding="utf-8")
        done = subprocess.run([str(SERVER), str(BENCHES / "servo.toml"), "--port", "0", "--record",
                               str(folder / "there.mcap")], capture_output=True, text=True, timeout=PATIENCE_S,
                              check=False)
        self.assertEqual(done.returncode, 2)
        self.assertIn("there.mcap", done.stderr)
        self.assertEqual((folder / "there.mcap").read_text(encoding="utf-8"), "precious")

    def test_cfg_01_a_bad_bench_file_ends_it_before_a_socket_opens(self):
        """A bench that serves what its file did not say."""
        folder = self.server().folder
        bad = folder / "bad.toml"
        bad.write_text(TWO_AXES.replace("watchdog_ticks", "watchdog_tick"), encoding="utf-8")
        socket_path = folder / "never.sock"
        trace = folder / "trace"
        command = [str(SERVER), str(bad), "--port", "0", "--unix", str(socket_path), "--record",
                   str(folder / "never.mcap")]
        strace = pathlib.Path("/usr/bin/strace")
        if strace.exists():
            command = [str(strace), "-f", "-e", "trace=network", "-o", str(trace), *command]
        without_leak_check = {**os.environ, "ASAN_OPTIONS": "detect_leaks=0"}  # which fails under strace
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
                              env=without_leak_check)
        self.assertEqual(done.returncode, 2)
        self.assertIn("bad.toml:", done.stderr)
        self.assertIn("watchdog_ticks", done.stderr, "the nearest valid key")
        self.assertEqual(done.stdout, "")
        self.assertFalse(socket_path.exists() or (folder / "never.mcap").exists())
        if trace.exists():
            self.assertNotIn("socket(", trace.read_text(encoding="utf-8"))

    def test_a_port_that_is_taken_is_said(self):
        """A second server that seems to run and serves nobody."""
        server = self.server()
        done = subprocess.run([str(SERVER), str(BENCHES / "servo.toml"), "--port", str(server.address[1])],
                              capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, 2)
        self.assertIn(str(server.address[1]), done.stderr)

    def test_tcp_16_sessions_beyond_the_cap_are_turned_away_with_a_reason(self):
        """One client that takes all descriptors from the others."""
        text = TWO_AXES.replace("[tcp]", "[tcp]\nmax_sessions = 3")
        server = self.server(text=text)
        inside = [self.client(server) for _ in range(3)]
        outside = self.client(server, hello=False)
        self.assertRefused(outside.receive(), pb.REFUSAL_BUSY)
        self.assertTrue(outside.is_closed())
        self.assertEqual(inside[0].status().sessions, 3)
        inside[2].close()

        def one_more():
            try:
                return self.client(server).welcome is not None
            except (Closed, AssertionError, ConnectionError):
                return False
        until(one_more, "room for another")

    def test_tcp_15_sigpipe_does_not_end_it(self):
        """A client that closes while samples are on their way."""
        server = self.server()
        owner = self.client(server)
        owner.lease()
        tick = 0
        for _ in range(20):
            gone = self.client(server)
            gone.ask(subscribe=pb.Subscribe(decimation=1))
            gone.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            gone.close()
            for _ in range(20):
                owner.step(tick)
                tick += 1
        until(lambda: owner.status().sessions == 1, "all are gone")

    def test_sec_01_it_listens_on_loopback_only(self):
        """A bench that the whole network can drive."""
        self.assertEqual(self.server().address[0], "127.0.0.1")


if __name__ == "__main__":
    unittest.main(verbosity=2)
