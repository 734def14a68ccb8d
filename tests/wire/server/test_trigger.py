#!/usr/bin/python3
"""The trigger of a session: the server sees every sample and keeps those around an event until they are read."""
import pathlib
import struct
import sys
import time
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import PATIENCE_S, pb
from wire_test import PATIENT_TEXT, TWO_AXES, WireTest, until

MOST = 32  # triggers of a server


def kept(*signals, axis=0):
    return pb.CapturedSignals(axis=axis, signals=signals)


def edge(**more):
    """A trigger on the load of axis 0."""
    return pb.Trigger(**{"condition": pb.TRIGGER_RISING, "signal": "load_nm", "level": 0.5, "ticks_before": 3, "ticks_after": 4,
                         "captured": [kept("load_nm")], **more})


class TriggerTest(WireTest):
    def rows_of(self, client, capture):
        """All rows of a capture, piece for piece: lists of the tick and the values."""
        width = 8 * (1 + self.channels)
        rows = []
        while True:
            answer = client.ask(read_capture=pb.ReadCapture(capture=capture, first_row=len(rows)))
            self.assertEqual(answer.WhichOneof("kind"), "capture_rows", answer)
            piece = answer.capture_rows
            self.assertEqual((piece.capture, piece.first_row, len(piece.data) % width), (capture, len(rows), 0))
            self.assertLessEqual(len(piece.data), 1 << 16)
            rows += [list(row) for row in struct.iter_unpack(f"<{1 + self.channels}d", piece.data)]
            if piece.last:
                return rows

    def arm(self, client, trigger):
        self.channels = sum(len(each.signals) for each in trigger.captured)
        self.assertDone(client.ask(trigger=trigger))

    def steps(self, owner, first, last):
        for tick in range(first, last + 1):
            owner.step(tick)

    def load(self, owner, load_nm, at_tick):
        self.assertDone(owner.ask(set_load=pb.SetLoad(load_nm=load_nm, at_tick=at_tick)))


class Captures(TriggerTest):
    def test_a_viewer_catches_the_tick_of_an_event_and_its_neighbours(self):
        """Catches: a window at another tick, values of another tick, a trigger that needs a lease, an answer that comes before
        the rows are there."""
        server = self.server(text=TWO_AXES)
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        self.load(owner, 1.0, 20)
        self.load(owner, 0.0, 21)
        self.arm(viewer, edge(captured=[kept("load_nm", "u_a_v"), kept("tick", axis=1)]))
        for tick in range(22):
            owner.step(tick, float(tick))
        viewer.status()
        self.assertEqual([(each.capture, each.complete, each.rows) for each in viewer.triggered], [(1, False, 0)])
        fired = viewer.triggered[0].tick
        self.assertRefused(viewer.ask(read_capture=pb.ReadCapture(capture=1)), pb.REFUSAL_NOT_AVAILABLE, "capture")
        for tick in range(22, 25):
            owner.step(tick, float(tick))
        viewer.status()
        self.assertEqual([(each.capture, each.complete, each.rows, each.tick) for each in viewer.triggered[1:]], [(1, True, 7, fired)])
        rows = self.rows_of(viewer, 1)
        self.assertEqual([row[0] for row in rows], [fired + n for n in range(-3, 4)])
        self.assertEqual([row[1] for row in rows], [0, 0, 0, 1, 0, 0, 0])
        self.assertEqual([row[2] for row in rows], [row[0] - 1 for row in rows], "the voltage of the tick before the sample")
        self.assertEqual([row[3] for row in rows], [row[0] for row in rows], "the other axis at the same tick")

    def test_no_event_is_missed_however_slowly_the_client_reads(self):
        """Catches: an event of one tick that is lost while the session reads nothing, a capture that later events overwrite, a
        missed event that is not counted, a trigger that is not armed again by the last piece, one that is armed before."""
        server = self.server(text=PATIENT_TEXT)
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        self.arm(viewer, edge(ticks_before=1500, ticks_after=1000, captured=[kept("load_nm", "speed_rad_s", "tick", "u_a_v")]))
        for at_tick in (2000, 4000, 4500, 5000):  # the first is caught; nothing of the next three
            self.load(owner, 1.0, at_tick)
            self.load(owner, 0.0, at_tick + 1)
        self.steps(owner, 0, 5100)  # the viewer reads nothing meanwhile
        viewer.status()
        first, complete = viewer.triggered
        self.assertEqual((first.tick, complete.complete, complete.rows, complete.missed_events), (complete.tick, True, 2500, 0))
        self.assertEqual((viewer.ask(read_capture=pb.ReadCapture(capture=1)).capture_rows.last), False)
        self.load(owner, 1.0, 5110)
        self.load(owner, 0.0, 5111)
        self.steps(owner, 5101, 5120)
        rows = self.rows_of(viewer, 1)
        self.assertEqual([row[0] for row in rows], [first.tick + n for n in range(-1500, 1000)])
        self.assertEqual([row[0] for row in rows if row[1] > 0.5], [first.tick])
        self.assertEqual([row[3] for row in rows], [row[0] for row in rows])
        self.load(owner, 1.0, 5130)
        self.steps(owner, 5121, 5131)
        viewer.status()
        self.assertEqual([(each.capture, each.missed_events) for each in viewer.triggered[2:]], [(2, 4)])
        self.assertEqual(viewer.triggered[2].tick - first.tick, 3130)

    def test_a_single_trigger_fires_once_and_ends_with_its_request(self):
        """Catches: a single trigger that goes on, one that cannot be ended, a number of a capture that comes twice."""
        server = self.server()
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        for at_tick in (10, 30, 50, 70):
            self.load(owner, 1.0, at_tick)
            self.load(owner, 0.0, at_tick + 2)
        self.arm(viewer, edge(single=True))
        self.steps(owner, 0, 20)
        viewer.status()
        self.assertEqual(len(self.rows_of(viewer, 1)), 7)
        self.steps(owner, 21, 40)
        viewer.status()
        self.assertEqual(len(viewer.triggered), 2)
        self.assertEqual(len(self.rows_of(viewer, 1)), 7, "it stays until another trigger takes its place")
        self.arm(viewer, edge())
        self.assertRefused(viewer.ask(read_capture=pb.ReadCapture(capture=1)), pb.REFUSAL_NOT_AVAILABLE, "capture")
        self.steps(owner, 41, 60)
        viewer.status()
        self.assertEqual([each.capture for each in viewer.triggered], [1, 1, 2, 2])
        self.assertDone(viewer.ask(trigger=pb.Trigger()))
        self.steps(owner, 61, 80)
        viewer.status()
        self.assertEqual(len(viewer.triggered), 4)
        self.assertRefused(viewer.ask(read_capture=pb.ReadCapture(capture=2)), pb.REFUSAL_NOT_AVAILABLE, "capture")

    def test_a_reset_begins_anew(self):
        """Catches: a bench that goes back to tick 0 and a trigger that waits for a tick that is over, or takes it for a loss."""
        server = self.server()
        owner, viewer = self.client(server), self.client(server)
        owner.lease()
        self.arm(viewer, edge(hold_off_ticks=1 << 63))
        self.load(owner, 1.0, 20)
        self.steps(owner, 0, 22)
        self.assertDone(owner.ask(reset_bench=pb.ResetBench()))
        self.load(owner, 1.0, 10)
        self.steps(owner, 0, 15)
        viewer.status()
        self.assertEqual([(each.complete, each.lost_ticks) for each in viewer.triggered], [(False, 0), (False, 0), (True, 0)])
        self.assertLess(viewer.triggered[1].tick, viewer.triggered[0].tick)

    def test_in_real_time_a_fault_of_one_tick_is_caught(self):
        """Catches: a trigger that sees only the newest sample when the server's thread for clients was busy; a loss that is not told."""
        server = self.server("--mode", "realtime")
        viewer, other = self.client(server), self.client(server, conducts=True)
        self.arm(viewer, pb.Trigger(condition=pb.TRIGGER_BITS_APPEAR, signal="injected", bits=(1 << 64) - 1, ticks_before=50,
                                    ticks_after=50, captured=[kept("injected")]))
        begins = other.newest().tick + 16_000
        for value, at_tick in ((1.0, begins), (0.0, begins + 1)):
            self.assertDone(other.ask(inject_fault=pb.InjectFault(name="open_phase", value=value, at_tick=at_tick)))
        end = time.monotonic() + PATIENCE_S
        while not any(each.complete for each in viewer.triggered) and time.monotonic() < end:
            viewer.status()
        rows = self.rows_of(viewer, 1)
        if not viewer.triggered[-1].lost_ticks:
            self.assertEqual(len(rows), 100)
        self.assertEqual([row[0] for row in rows if row[1] != 0], [viewer.triggered[0].tick])


class Refusals(TriggerTest):
    def test_what_cannot_be_is_refused_in_words(self):
        """Catches: a field that is not checked, a refusal of another field, one that ends the trigger that is armed."""
        server = self.server()
        owner, viewer = self.client(server), self.client(server)
        self.arm(viewer, edge())
        nan, inf = float("nan"), float("inf")
        band = {"condition": pb.TRIGGER_LEAVES, "level": 2.0}
        names = [each.name for each in viewer.welcome.bench.signals]
        for code, field, words, trigger in (
                (pb.REFUSAL_OUT_OF_RANGE, "condition", "condition is 9 but must be 0 to 8", edge(condition=9)),
                (pb.REFUSAL_OUT_OF_RANGE, "condition", "condition is -1", edge(condition=-1)),
                (pb.REFUSAL_UNKNOWN_AXIS, "axis", "axis 7 does not exist", edge(axis=7)),
                (pb.REFUSAL_UNKNOWN_SIGNAL, "signal", "'load'", edge(signal="load")),
                (pb.REFUSAL_NOT_FINITE, "level", "level", edge(level=nan)),
                (pb.REFUSAL_NOT_FINITE, "upper", "upper", edge(upper=inf, **band)),
                (pb.REFUSAL_OUT_OF_RANGE, "upper", "upper is 1 but must not be below level, 2", edge(upper=1.0, **band)),
                (pb.REFUSAL_OUT_OF_RANGE, "signal", "'load_nm' is a number", edge(condition=pb.TRIGGER_BITS_APPEAR, bits=1)),
                (pb.REFUSAL_OUT_OF_RANGE, "bits", "bits is 0", edge(condition=pb.TRIGGER_BITS_APPEAR, signal="faults")),
                (pb.REFUSAL_OUT_OF_RANGE, "ticks_after", "at least 1", edge(ticks_after=0)),
                (pb.REFUSAL_OUT_OF_RANGE, "ticks_before", "65537 ticks together but may be 65536", edge(ticks_before=65533)),
                (pb.REFUSAL_OUT_OF_RANGE, "ticks_before", "may be 65536", edge(ticks_before=0xFFFFFFFF, ticks_after=0xFFFFFFFF)),
                (pb.REFUSAL_OUT_OF_RANGE, "captured", "1310720 but may be 1048576",
                 edge(ticks_before=65532, captured=[kept(*names[:19])])),
                (pb.REFUSAL_OUT_OF_RANGE, "captured", "captured names no signal", edge(captured=[])),
                (pb.REFUSAL_OUT_OF_RANGE, "captured", "captured names no signal", edge(captured=[kept()])),
                (pb.REFUSAL_OUT_OF_RANGE, "captured.signals", "65 captured.signals", edge(captured=[kept(*["tick"] * 65)])),
                (pb.REFUSAL_OUT_OF_RANGE, "captured.signals", "'tick' of axis 0 is captured twice",
                 edge(captured=[kept("tick"), kept("load_nm", "tick")])),
                (pb.REFUSAL_UNKNOWN_SIGNAL, "captured.signals", "'nothing'", edge(captured=[kept("nothing")])),
                (pb.REFUSAL_UNKNOWN_AXIS, "axis", "axis 3", edge(captured=[kept("tick", axis=3)]))):
            with self.subTest(words):
                answer = viewer.ask(trigger=trigger)
                self.assertRefused(answer, code, field)
                self.assertIn(words, answer.refusal.message)
        for number, row, field in ((2, 0, "capture"), (1, 7, "first_row")):
            if field == "first_row":
                owner.lease()
                self.load(owner, 1.0, 5)
                self.steps(owner, 0, 20)
                viewer.status()  # the trigger of the beginning has fired
            code = pb.REFUSAL_OUT_OF_RANGE if field == "first_row" else pb.REFUSAL_NOT_AVAILABLE
            self.assertRefused(viewer.ask(read_capture=pb.ReadCapture(capture=number, first_row=row)), code, field)
        self.assertEqual(viewer.triggered[-1].rows, 7)

    def test_web_08_triggers_have_bounds_and_give_their_room_back(self):
        """Catches: one trigger too many, memory beyond the bound, room that a session keeps when it goes, ends its trigger or
        replaces it."""
        server = self.server()
        clients = [self.client(server) for _ in range(MOST + 1)]
        for client in clients[:-1]:
            self.arm(client, edge())
        answer = clients[-1].ask(trigger=edge())
        self.assertRefused(answer, pb.REFUSAL_BUSY, "condition")
        self.assertIn("32 triggers", answer.refusal.message)
        self.arm(clients[0], edge(level=1.0))  # in the place of its own
        clients[0].close()
        until(lambda: clients[-1].ask(trigger=edge()).WhichOneof("kind") == "done", "room after a session")
        for client in clients[2:]:
            self.assertDone(client.ask(trigger=pb.Trigger()))
        names = [each.name for each in clients[1].welcome.bench.signals]
        largest = edge(ticks_before=65532, captured=[kept(*names[:15])])  # the most that one capture may take
        for client in clients[1:9]:
            self.arm(client, largest)
        answer = clients[9].ask(trigger=edge())
        self.assertRefused(answer, pb.REFUSAL_BUSY, "captured")
        self.assertIn("are free", answer.refusal.message)
        self.arm(clients[8], largest)
        self.arm(clients[8], edge())
        self.arm(clients[9], edge())


if __name__ == "__main__":
    unittest.main(verbosity=2)
