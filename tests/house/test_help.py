"""What --help says: plain words under headings, and examples that run as they are written."""
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "helpers"))
from help_text import above_examples, examples, headings, help_of, rows, verbs  # noqa: E402
from own_network import in_own_network  # noqa: E402
from typed_commands import Bench  # noqa: E402
from wire_client import PATIENCE_S  # noqa: E402

# CLI11's names for types and rules, and its headings.
FOREIGN = re.compile(r"\b(TEXT|INT|UINT|FLOAT|BOOLEAN|REQUIRED|Excludes|Needs|Env|OPTIONS|SUBCOMMANDS?|Subcommands|Positionals|Options)\b| in \[|:\[|:\{|\.\.\.\]? x ")

# Examples that are parsed, and do not come to a good end in a test.
ONLY_PARSED = {
    "drivebench demo": "its run in real time may come too late on a busy machine",
    "drivebench web --listen 127.0.0.1:7380": "needs the page, which npm builds",
    "drivebench branch servo --port 0": "serves until it is ended",
    "drivebench can check can0": "needs an adapter",
    "drivebench doctor --period-us 125": "its exit code is this machine's",
    **{f"drivebench rerun kept/servo-position.zip{more}": "needs a case that has failed" for more in ("", " --from 0.03s", " --interactive")},
    "drivebench test hil --filter servo --shrink hil/small.toml": "needs a case that fails",
    "drivebench test hil --results /shared/results --slurm 32": "needs a cluster; test_slurm.py has one",
}
SERVING = ("drivebench web --listen 127.0.0.1:7380", "drivebench branch servo --port 0")
# The bench that the examples of a verb need, where it is not a servo; and what comes before them.
BENCHES_OF = {"describe": "drivebench serve", "experiment": "drivebench serve im-8-5-5 --mode lockstep --experiments stored", "track": "drivebench serve im-warming"}
PREPARED = {"replay": "drivebench serve --record run.mcap"}


def all_help():
    for path, text in verbs():
        yield ("drivebench", *path), text
    yield ("drivebench-server",), help_of("drivebench-server")


class Help(unittest.TestCase):
    def test_it_speaks_in_the_words_of_the_field(self):
        """Catches: an option without a name for its value, without a text, or outside a group, and a rule that CLI11 words."""
        for path, text in all_help():
            with self.subTest(" ".join(path)):
                self.assertNotRegex(text, FOREIGN)
                for name, said in rows(text):
                    self.assertTrue(said, name)
                for line in above_examples(text).splitlines():
                    self.assertLessEqual(len(line), 80, line)

    def test_the_verbs_stand_under_what_a_user_wants(self):
        """Catches: a verb that the table of groups has not, and a group that has no verb."""
        self.assertEqual(headings(help_of("drivebench")), ["The first minute", "Serve a bench", "Drive and watch", "Change it while it runs", "Keep its state", "Recordings and plots",
                                    "Experiments and identification", "Regression tests", "CAN and Modbus", "Motors and models", "Help"])

    def test_every_verb_has_an_example_of_its_own(self):
        """Catches: a verb without an example, or with that of another verb."""
        for path, text in all_help():
            with self.subTest(" ".join(path)):
                for example in examples(text):
                    self.assertTrue(f"{example} ".startswith(" ".join(path) + " "), example)

    def test_every_example_runs(self):
        """Catches: an option or an argument of an example that is gone, or that does not do what its verb needs."""
        unused = set(ONLY_PARSED)
        with tempfile.TemporaryDirectory(prefix="drivebench-help-") as folder:
            bench = Bench(pathlib.Path(folder))
            self.addCleanup(bench.kill)
            done = set()
            for path, text in all_help():
                if path[-1] in PREPARED:
                    bench.do(PREPARED[path[-1]])
                if path[-1] in BENCHES_OF:
                    bench.do(BENCHES_OF[path[-1]])
                for example in [example.partition("  #")[0].strip() for example in examples(text)]:
                    if example in done:
                        continue
                    done.add(example)
                    with self.subTest(example):
                        if example in ONLY_PARSED:
                            unused.discard(example)
                            self.parse(bench, example)
                        else:
                            bench.do(example)
            bench.stop()
        self.assertEqual(unused, set(), "ONLY_PARSED names examples that no help has")

    def parse(self, bench, example):
        started = subprocess.Popen(bench.program(*shlex.split(example)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                   cwd=bench.folder, env=bench.environment)
        try:
            said, _ = started.communicate(timeout=2 if example in SERVING else 4 * PATIENCE_S)
            self.assertNotIn("Run with --help", said)
        except subprocess.TimeoutExpired:  # it was parsed and serves
            started.terminate()
            started.communicate(timeout=PATIENCE_S)


if __name__ == "__main__":
    in_own_network()  # a recorder of a CAN bus would hear other programs
    unittest.main(verbosity=2)
