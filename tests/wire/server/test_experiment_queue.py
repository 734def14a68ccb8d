#!/usr/bin/python3
"""Experiments of several owners: their turns, their data, and the folder that keeps them."""
import os
import pathlib
import sys
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from experiment_test import OWNER, ExperimentTest, endless, request
from wire_client import pb
from wire_test import until


class Queue(ExperimentTest):
    def test_three_clients_queue_fairly_and_get_their_own_data(self):
        """Catches: a queue in which a client with many experiments goes before all others, or mixed-up data."""
        server = self.start()
        blocker = self.client(server)
        first = self.run_it(blocker, endless())
        self.wait_for(blocker, first.id, pb.EXPERIMENT_STATE_RUNNING)
        owners = [f"secret number {n}" for n in range(3)]
        clients = [self.client(server) for _ in owners]
        expected = {}  # id: amplitude
        for n, owner in enumerate(owners):  # one client after the other, three experiments each
            for k in range(3):
                amplitude = 10.0 * n + k + 1.0
                info = self.run_it(clients[n], request(300, amplitude, ["u_a_v"], owner))
                expected[info.id] = (owner, amplitude)
        waiting = blocker.ask(list_experiments=pb.ListExperiments()).experiment_list.experiments
        order = [e.id for e in sorted((e for e in waiting if e.position), key=lambda e: e.position)]
        self.assertEqual([expected[number][0] for number in order], owners * 3)
        answer = blocker.ask(cancel_experiment=pb.CancelExperiment(id=first.id, owner=OWNER))
        self.assertEqual(answer.WhichOneof("kind"), "experiment_info")
        for number, (owner, amplitude) in expected.items():
            rows = self.fetch(clients[owners.index(owner)], number, owner).rows(1)
            self.assertEqual(len(rows), 301)
            self.assertEqual(rows[1][0], amplitude)  # the cosine at its start
        # The recordings were closed in the order of the queue.
        closed = sorted(order, key=lambda number: os.stat(f"{self.kept.name}/{number}.mcap").st_mtime_ns)
        self.assertEqual(closed, order)

    def test_a_full_queue_refuses_and_a_cancel_frees_a_place(self):
        """Catches: a queue without a bound, or a place in it that is not given back."""
        server = self.server(text=self.configuration(queue_length=2))
        client = self.client(server)
        running = self.run_it(client, endless())
        self.wait_for(client, running.id, pb.EXPERIMENT_STATE_RUNNING)
        second = self.run_it(client, request())
        third = self.run_it(client, request())
        self.assertEqual((second.position, third.position), (1, 2))
        self.assertRefused(client.ask(run_experiment=request()), pb.REFUSAL_BUSY, "queue")
        gone = client.ask(cancel_experiment=pb.CancelExperiment(id=second.id, owner=OWNER)).experiment_info
        self.assertEqual(gone.state, pb.EXPERIMENT_STATE_CANCELLED)
        self.assertEqual(self.run_it(client, request()).position, 2)
        client.ask(cancel_experiment=pb.CancelExperiment(id=running.id, owner=OWNER))
        stopped = self.fetch(client, running.id)
        self.assertEqual(stopped.info.state, pb.EXPERIMENT_STATE_CANCELLED)
        self.assertEqual(len(stopped.rows(3)), stopped.info.tick + 1)
        self.assertGreater(stopped.info.recording_bytes, 0)
        self.wait_for(client, third.id, pb.EXPERIMENT_STATE_COMPLETED)

    def test_the_same_request_again_is_the_same_experiment(self):
        """Catches: a request that was sent again because its answer was lost, and runs twice."""
        server = self.start()
        one = self.run_it(self.client(server), request(request_key="k1"))
        two = self.run_it(self.client(server), request(request_key="k1"))
        self.assertEqual(one.id, two.id)
        self.assertNotEqual(self.run_it(self.client(server), request(request_key="k1", owner="another owner")).id, one.id)
        self.assertRefused(self.client(server).ask(run_experiment=request(401, request_key="k1")),
                           pb.REFUSAL_OUT_OF_RANGE, "request_key")


class Folder(ExperimentTest):
    def test_the_data_of_another_owner_are_refused_unless_shared(self):
        """Catches: data, labels or a right to cancel for a client that does not know the secret."""
        server = self.start()
        client = self.client(server)
        private = self.whole(client, request(label="private")).info.id
        shared = self.whole(client, request(label="for all", shared=True)).info.id
        stranger = self.client(server)
        for wrong in ("", "the secret of a tesT", OWNER + "x"):
            for kind in (dict(fetch_experiment=pb.FetchExperiment(id=private, owner=wrong)),
                         dict(cancel_experiment=pb.CancelExperiment(id=private, owner=wrong)),
                         dict(cancel_experiment=pb.CancelExperiment(id=shared, owner=wrong))):
                self.assertRefused(stranger.ask(**kind), pb.REFUSAL_NOT_OWNER, "owner")
        self.assertRefused(stranger.ask(fetch_experiment=pb.FetchExperiment(id=99)), pb.REFUSAL_UNKNOWN_EXPERIMENT, "id")
        listed = {e.id: e for e in stranger.ask(list_experiments=pb.ListExperiments()).experiment_list.experiments}
        self.assertEqual((listed[private].label, listed[private].rows, list(listed[private].signals)), ("", 0, []))
        self.assertEqual((listed[private].user, listed[shared].label), ("wire test", "for all"))
        self.assertEqual(len(self.fetch(stranger, shared, owner="").data), 401 * 3 * 8)

    def test_experiments_outlive_the_server_and_the_oldest_go(self):
        """Catches: data that are lost with the server, numbers that are given twice, a folder that grows forever."""
        text = self.configuration(kept=3)
        server = self.server(text=text)
        client = self.client(server)
        ids = [self.whole(client, request(100, amplitude=1.0 + k)).info.id for k in range(4)]
        self.assertEqual(ids, [1, 2, 3, 4])
        last = self.fetch(client, 4)
        self.run_it(client, endless())
        self.wait_for(client, 5, pb.EXPERIMENT_STATE_RUNNING)
        with self.assertRaisesRegex(RuntimeError, "another server does"):
            self.server(text=text)
        self.assertEqual(server.stop(), 0)
        client = self.client(self.server(text=text))
        listed = client.ask(list_experiments=pb.ListExperiments(owner=OWNER)).experiment_list.experiments
        self.assertEqual([e.id for e in listed], [3, 4, 5])
        self.assertEqual(listed[-1].state, pb.EXPERIMENT_STATE_CANCELLED)
        self.assertEqual(self.fetch(client, 4).data, last.data)
        self.assertEqual({int(f.split(".")[0]) for f in os.listdir(self.kept.name) if f[0].isdigit()}, {3, 4, 5})
        self.assertEqual(self.run_it(client, request()).id, 6)

    def test_the_first_experiment_to_end_is_removed_first(self):
        """Catches: removal of the lowest number instead of the first end: of two owners in turn, the data of the one that
        waited longest would go at once, or with the next start of the server."""
        text = self.configuration(kept=2)

        def there(client):
            listed = client.ask(list_experiments=pb.ListExperiments(owner=OWNER)).experiment_list.experiments
            there = [e.id for e in listed]
            until(lambda: sorted(int(f[:-5]) for f in os.listdir(self.kept.name) if f.endswith(".mcap")) == there,
                  f"the folder has {there}")
            return there
        server = self.server(text=text)
        client = self.client(server)
        first = self.run_it(client, endless()).id
        self.wait_for(client, first, pb.EXPERIMENT_STATE_RUNNING)
        waits = self.run_it(client, request(400, mode=pb.MODE_REALTIME)).id
        turns = [self.run_it(client, request(100, owner=f"another owner {k}")).id for k in range(2)]
        client.ask(cancel_experiment=pb.CancelExperiment(id=first, owner=OWNER))
        fetched = self.fetch(client, waits)
        self.assertEqual((fetched.info.state, len(fetched.rows(3))), (pb.EXPERIMENT_STATE_COMPLETED, 401))
        self.assertEqual(self.whole(client, request(100)).info.id, 5)
        self.assertEqual(there(client), [waits, 5])
        self.assertEqual(server.stop(), 0)
        # 5 and then 2 were written last.
        os.utime(f"{self.kept.name}/2.experiment")
        server = self.server(text=text)
        client = self.client(server)
        self.assertEqual(self.whole(client, request(100)).info.id, 6)
        self.assertEqual(there(client), [waits, 6])
        self.assertLess(waits, min(turns))

    def test_a_cancel_is_answered_although_the_experiment_goes(self):
        """Catches: an experiment that is forgotten by the request that cancels it, which then is refused."""
        text = self.configuration(kept=1)
        client = self.client(self.server(text=text))
        running = self.run_it(client, endless())
        self.wait_for(client, running.id, pb.EXPERIMENT_STATE_RUNNING)
        queued = [self.run_it(client, request()).id for _ in range(3)]
        for number in reversed(queued):
            answer = client.ask(cancel_experiment=pb.CancelExperiment(id=number, owner=OWNER))
            self.assertEqual(answer.experiment_info.state, pb.EXPERIMENT_STATE_CANCELLED, answer)
            self.wait_for(client, number, pb.EXPERIMENT_STATE_CANCELLED)

    def test_a_file_that_is_no_experiment_is_reported_and_left_alone(self):
        """Catches: a file that a power cut left empty: the server divides by its decimation of 0 and ends, or gives its
        data to a client that names no owner."""
        folder = pathlib.Path(self.kept.name)
        server = self.start()
        self.whole(self.client(server), request(100))
        self.assertEqual(server.stop(), 0)
        whole = (folder / "1.experiment").read_bytes()

        def broken(number, change):
            stored = pb.StoredExperiment.FromString(whole)
            stored.info.id = number
            change(stored)
            return stored.SerializeToString()
        files = {7: (b"", "its id"), 8: (b"\xff" * 20, "a StoredExperiment"), 9: (whole, "its id"),
                 10: (broken(10, lambda s: s.request.ClearField("owner")), "an owner"),
                 11: (broken(11, lambda s: s.info.ClearField("decimation")), "its decimation"),
                 12: (broken(12, lambda s: s.info.ClearField("signals")), "a signal"),
                 13: (broken(13, lambda s: s.info.signals.extend(["i_a_a"] * 9999)), "a signal")}
        for number, (data, _) in files.items():
            (folder / f"{number}.experiment").write_bytes(data)
        (folder / "14.experiment.new").write_bytes(whole)  # the power failed before the file was renamed
        server = self.start()
        client = self.client(server)
        listed = client.ask(list_experiments=pb.ListExperiments(owner=OWNER)).experiment_list.experiments
        for number, (data, rule) in files.items():
            for owner in ("", OWNER):
                for recording in (False, True):
                    asked = pb.FetchExperiment(id=number, owner=owner, recording=recording)
                    self.assertRefused(client.ask(fetch_experiment=asked), pb.REFUSAL_UNKNOWN_EXPERIMENT, "id")
            self.assertRegex(server.errors(), f"/{number}.experiment is not an experiment: .*{rule}")
            self.assertEqual((folder / f"{number}.experiment").read_bytes(), data)
        self.assertEqual([e.id for e in listed], [1])
        self.assertFalse((folder / "14.experiment.new").exists())
        self.assertEqual(self.whole(client, request(100)).info.id, 15)

    def test_rec_16_a_number_beyond_every_experiment_is_refused_by_name(self):
        """Catches: a stray file after whose number the next one wraps to 0, and whose data the server deletes."""
        folder = pathlib.Path(self.kept.name)
        strays = ("18446744073709551615.rows", "99999999999999999999999.mcap", "1000000000001.experiment", "0.rows")
        for name in strays:
            (folder / name).write_bytes(b"precious")
        server = self.start()
        self.assertEqual(self.whole(self.client(server), request(100)).info.id, 1)
        for name in strays:
            self.assertIn(f"/{name} is not an experiment: its number must lie between 1 and 1000000000000", server.errors())
            self.assertEqual((folder / name).read_bytes(), b"precious")
        self.assertEqual(server.stop(), 0)
        (folder / "1000000000000.experiment").write_bytes(b"")
        client = self.client(self.start())
        self.assertRefused(client.ask(run_experiment=request(100)), pb.REFUSAL_BUSY, "id")
        self.assertEqual([e.id for e in client.ask(list_experiments=pb.ListExperiments(owner=OWNER)).experiment_list.experiments], [1])

    def test_sec_10_a_folder_that_every_user_may_write_is_refused(self):
        """Catches: experiments that any user of the computer can read or replace."""
        folder = pathlib.Path(self.kept.name)
        for mode in (0o777, 0o1777, 0o702):
            folder.chmod(mode)
            with self.assertRaisesRegex(RuntimeError, "every user may write into it: chmod 700 it"):
                self.start()
            self.assertEqual(list(folder.iterdir()), [])
        folder.chmod(0o770)
        server = self.start()
        self.assertIn("may write into it", server.errors())
        self.assertEqual(server.stop(), 0)
        server = self.server("--experiments", str(folder / "made" / "kept") + "/", before=lambda: os.umask(0))
        self.assertEqual((folder / "made" / "kept").stat().st_mode & 0o777, 0o700)

    def test_sec_10_only_its_user_can_read_the_files(self):
        """Catches: a file that is readable by other users, or opened by one, before its rights are set."""
        folder = pathlib.Path(self.kept.name)
        server = self.start(before=lambda: os.umask(0))
        draft = folder / "1.experiment.new"
        draft.touch()
        draft.chmod(0o666)
        with open(draft, "rb") as eavesdropper:
            self.whole(self.client(server), request(100))
            self.assertEqual(eavesdropper.read(), b"")
        self.assertIn(OWNER.encode(), (folder / "1.experiment").read_bytes())
        for name in ("1.experiment", "1.rows", "1.mcap", "lock"):
            self.assertEqual((folder / name).stat().st_mode & 0o777, 0o600, name)


if __name__ == "__main__":
    unittest.main(verbosity=2)
