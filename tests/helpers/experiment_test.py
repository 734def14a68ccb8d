"""Shared by the tests of experiments: a request, and its results."""
import struct
import tempfile

from wire_client import pb
from wire_test import SERVO_TEXT, WireTest, until

OWNER = "the secret of a test"
ENDED = (pb.EXPERIMENT_STATE_COMPLETED, pb.EXPERIMENT_STATE_STOPPED, pb.EXPERIMENT_STATE_CANCELLED,
         pb.EXPERIMENT_STATE_FAILED)
SIGNALS = ("i_a_a", "i_b_a", "speed_rad_s")


def request(ticks=400, amplitude=40.0, signals=SIGNALS, owner=OWNER, **more):
    """A sine of 60 Hz on both phases of the servo."""
    shape = pb.Shape(three_phase=pb.Shape.ThreePhase(amplitude=amplitude, frequency_hz=60.0))
    wanted = dict(owner=owner, mode=pb.MODE_FREE, ticks=ticks, signals=signals, user="wire test",
                  input=pb.ExperimentInput(kind=pb.INPUT_KIND_PHASE_VOLTAGES, shapes=[shape]))
    wanted.update(more)
    return pb.RunExperiment(**wanted)


def endless(**more):
    """Paced by the clock: longer than any test."""
    return request(ticks=900_000, mode=pb.MODE_REALTIME, **more)


class Fetched:
    """The result of a fetch."""

    def __init__(self):
        self.data = b""
        self.ticks = []  # of the first row of each message
        self.info = None

    def rows(self, width):
        values = struct.unpack(f"<{len(self.data) // 8}d", self.data)
        return [values[i:i + width] for i in range(0, len(values), width)]


class ExperimentTest(WireTest):
    def setUp(self):
        self.kept = tempfile.TemporaryDirectory(prefix="drivebench-experiments-")
        self.addCleanup(self.kept.cleanup)

    def configuration(self, **settings):
        """The servo's configuration, with settings of its experiments."""
        more = "".join(f"{key} = {value}\n" for key, value in settings.items())
        return f'{SERVO_TEXT}\n[experiments]\nfolder = "{self.kept.name}"\n{more}'

    def start(self, *options, **more):
        return self.server("--experiments", self.kept.name, *options, **more)

    def run_it(self, client, wanted):
        answer = client.ask(run_experiment=wanted)
        self.assertEqual(answer.WhichOneof("kind"), "experiment_info", answer)
        return answer.experiment_info

    def fetch(self, client, number, owner=OWNER, start=0, recording=False):
        """Fetches everything up to the end."""
        fetched = Fetched()
        asked = client.send(fetch_experiment=pb.FetchExperiment(id=number, owner=owner, recording=recording,
                                                                **{"from": start}))
        first = client.answer_to(asked)
        self.assertEqual(first.WhichOneof("kind"), "experiment_info", first)
        while True:
            message = client.answer_to(asked)
            if message.WhichOneof("kind") == "experiment_data":
                fetched.ticks.append(message.experiment_data.first)
                fetched.data += message.experiment_data.data
                continue
            self.assertEqual(message.WhichOneof("kind"), "experiment_info", message)
            fetched.info = message.experiment_info
            if fetched.info.state in ENDED:
                return fetched

    def whole(self, client, wanted):
        return self.fetch(client, self.run_it(client, wanted).id, wanted.owner)

    def wait_for(self, client, number, *states, owner=OWNER):
        def reached():
            listed = client.ask(list_experiments=pb.ListExperiments(owner=owner)).experiment_list.experiments
            return next(e for e in listed if e.id == number).state in states
        until(reached, f"experiment {number} reached {states}")
