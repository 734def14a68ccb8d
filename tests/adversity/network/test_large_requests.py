#!/usr/bin/python3
"""Requests as large as a frame may be, from many sessions at once."""
import contextlib
import os
import pathlib
import resource
import sys
import tempfile
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from experiment_test import request
from wire_client import frame, pb
from wire_test import PATIENT_TEXT, WireTest, until

MIB_IN_KIB = 1024
FRAME = 65536


def filled(kind, **more):
    """An envelope with a message that is so often in it as a frame has room for."""
    (name, message), = kind.items()
    once = pb.Envelope(**{name: message}).SerializeToString()
    head = pb.Envelope(id=7, **more).SerializeToString()
    return head + once * ((FRAME - len(head)) // len(once))


def repeated(name, field, count):
    """A kind with so many empty elements of a repeated field."""
    inner = bytes([field << 3 | 2, 0]) * count
    kind = pb.Envelope.DESCRIPTOR.fields_by_name[name].number
    tag = [kind << 3 | 2] if kind < 16 else [kind << 3 & 0x7F | 0x82, kind >> 4]
    length = [len(inner) & 0x7F | 0x80, len(inner) >> 7 & 0x7F | 0x80, len(inner) >> 14]
    return b"\x08\x07" + bytes(tag + length) + inner


class LargeRequests(WireTest):
    # By protobuf alone these come to 3 to 14 MB each.
    FRAMES = {
        "empty samples": repeated("samples", 3, 32_000),
        "empty commands": repeated("exchange", 1, 30_000),
        "empty signals": repeated("subscribe", 3, 30_000),
        "empty shapes": filled({"run_experiment": pb.RunExperiment(input=pb.ExperimentInput(shapes=[pb.Shape(
            multisine=pb.Shape.Multisine())]))}),
        "kinds in turn": (b"\x32\x00\x4a\x00" * 16_000)[:FRAME - 2] + b"\x08\x07",
        "unknown fields": b"\x08\x07\x82\x01\x00" + b"\x80\x7d\x01" * 21_000,
        "rows of a table": pb.Envelope(id=7, upload_table=pb.UploadTable(
            times_s=[float(n) for n in range(4090)], values=[1.0] * 4090)).SerializeToString(),
    }

    def test_os_11_tcp_05_tcp_11_the_largest_requests_of_255_sessions_stay_below_64_mib(self):
        """Catches: what is made of a request and stays with its session, or is made before the request is refused: 3.4 GB
        for 255 sessions; ticks or another client that wait for it."""
        server = self.server("--mode", "realtime", text=PATIENT_TEXT)
        owner, guests = self.client(server), [self.client(server) for _ in range(255)]
        self.assertDone(owner.lease())
        self.drive(owner, 1.0)
        for name, content in self.FRAMES.items():
            self.assertLessEqual(len(content), FRAME, name)
            before = owner.newest().tick
            for guest in guests:
                guest.send_bytes(frame(content))
            self.assertEqual(owner.exchange(owner.newest().tick, 1.0).WhichOneof("kind"), "exchange_reply", name)
            for guest in guests:
                self.assertEqual(guest.answer_to(7).WhichOneof("kind"), "refusal", name)
            until(lambda: owner.newest().tick > before, "the ticks go on")
        self.assertEqual(owner.status().sessions, 256)
        self.assertMemoryBelow(server, 64 * MIB_IN_KIB)

    def test_tcp_05_tcp_11_the_worst_of_all_together_stays_below_128_mib(self):
        """Catches: bounds that hold one by one, but not together: a decimation for each viewer, half a frame for each session,
        answers that nobody reads, a queue full of the largest experiments, tables, a crowd at the door, a recording."""
        with tempfile.TemporaryDirectory(prefix="drivebench-worst-") as folder:
            server = self.server("--mode", "realtime", "--experiments", f"{folder}/experiments", "--record", f"{folder}/run.mcap",
                                 text=PATIENT_TEXT)
            owner, guests = self.client(server), [self.client(server, receive_buffer=4096) for _ in range(255)]
            self.assertDone(owner.lease())
            self.drive(owner, 1.0)
            shapes = pb.ExperimentInput(kind=pb.INPUT_KIND_PHASE_VOLTAGES, shapes=[pb.Shape(channel=pb.CHANNEL_A,
                multisine=pb.Shape.Multisine(amplitude=0.01, base_hz=1.0, harmonics=range(1, 1001)))])
            queued = 0
            for n, guest in enumerate(guests):
                for _ in range(4):
                    answer = guest.ask(upload_table=pb.UploadTable(times_s=[float(t) for t in range(4000)], values=[1.0] * 4000))
                    self.assertIn(answer.WhichOneof("kind"), ("table_info", "refusal"))
                answer = guest.ask(run_experiment=request(ticks=400_000, mode=pb.MODE_REALTIME, owner=f"guest number {n}", input=shapes))
                queued += answer.WhichOneof("kind") == "experiment_info"
            self.assertGreater(queued, 30)
            crowd = [server.raw(source="127.0.0.2") for _ in range(100)]
            for n, guest in enumerate(guests):
                guest.send(subscribe=pb.Subscribe(decimation=n + 1))
            for guest in guests:
                guest.socket.setblocking(False)
                unread = frame(pb.Envelope(id=8, list_experiments=pb.ListExperiments()).SerializeToString()) * 64
                with contextlib.suppress(OSError):  # the server takes no more, or has cut it
                    guest.send_bytes(unread + frame(self.FRAMES["rows of a table"])[:-1])
            before = owner.newest().tick
            until(lambda: owner.newest().tick > before + 20_000, "the ticks go on")
            for each in crowd:
                each.close()
            self.assertMemoryBelow(server, 128 * MIB_IN_KIB)

    def test_tcp_18_limit_11_uploaded_tables_hold_no_descriptors(self):
        """Catches: 16 sessions with 64 tables each, after which nobody can connect; tables that outlive a server that was
        killed."""
        with tempfile.TemporaryDirectory(prefix="drivebench-tables-") as folder:
            def start():
                return self.server("--experiments", folder, before=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64)))
            server = start()
            clients = [self.client(server) for _ in range(17)]
            held = os.listdir(f"/proc/{server.process.pid}/fd")
            for client in clients[:16]:
                for _ in range(64):
                    answer = client.ask(upload_table=pb.UploadTable(times_s=[0.0], values=[1.0]))
                    self.assertEqual(answer.WhichOneof("kind"), "table_info", answer)
            self.assertEqual(len(os.listdir(f"/proc/{server.process.pid}/fd")), len(held))
            one_more = pb.UploadTable(times_s=[0.0], values=[1.0])
            self.assertRefused(clients[0].ask(upload_table=one_more), pb.REFUSAL_BUSY, "table")
            refused = clients[16].ask(upload_table=one_more)
            self.assertRefused(refused, pb.REFUSAL_BUSY, "table")
            self.assertIn("1024", refused.refusal.message)
            clients[0].close()
            until(lambda: clients[16].ask(upload_table=one_more).WhichOneof("kind") == "table_info", "its tables are free again")
            shape = pb.Shape(channel=pb.CHANNEL_A, table=pb.Shape.Table(id=64))
            wanted = request(input=pb.ExperimentInput(kind=pb.INPUT_KIND_PHASE_VOLTAGES, shapes=[shape]))
            self.assertEqual(clients[1].ask(run_experiment=wanted).WhichOneof("kind"), "experiment_info")
            self.assertTrue(list(pathlib.Path(folder).glob("*.table")))
            server.process.kill()
            server.process.wait()
            start()
            self.assertEqual(list(pathlib.Path(folder).glob("*.table")), [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
