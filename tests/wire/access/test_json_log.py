"""--log-format json: each line of the log is one JSON object, whatever names stand in it."""
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import PATIENCE_S, SERVER
from wire_test import SERVO_TEXT

EVIL = b'a"b\\\n{"level": "forged"}\xff\x1b[2J.toml'


class JsonLog(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory(prefix="drivebench-json-log-")
        self.addCleanup(self.folder.cleanup)
        self.bench = os.path.join(self.folder.name.encode(), EVIL)

    def lines(self, text):
        """The objects of the log; each has these keys and no other."""
        objects = [json.loads(line) for line in text.decode("utf-8").splitlines()]
        for each in objects:
            self.assertEqual(list(each), ["time", "level", "message"])
            self.assertRegex(each["time"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z$")
        return objects

    # Catches: a name that ends a line or an object of the log, or is no UTF-8 and ends the server.
    def test_a_hostile_name_stays_inside_its_message(self):
        with open(self.bench, "w", encoding="utf-8") as file:
            file.write(SERVO_TEXT)
        server = subprocess.Popen([SERVER, self.bench, "--port", "0", "--log-format", "json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.addCleanup(server.kill)
        self.assertTrue(server.stdout.readline().startswith(b"ready"))
        server.send_signal(signal.SIGHUP)
        said = server.stderr.readline()
        while b"SIGHUP" not in said:
            line = server.stderr.readline()
            self.assertNotEqual(line, b"", said)
            said += line
        server.send_signal(signal.SIGTERM)
        _, rest = server.communicate(timeout=PATIENCE_S)
        self.assertEqual(server.returncode, 0)
        [reloaded] = [line for line in self.lines(said + rest) if "SIGHUP" in line["message"]]
        self.assertEqual(reloaded["level"], "info")
        self.assertIn('a"b\\\n{"level": "forged"}\ufffd\x1b[2J.toml now', reloaded["message"])

    # Catches: a start that fails and tells why in another form.
    def test_why_the_server_does_not_start_is_a_line_of_the_log(self):
        with open(self.bench, "wb") as file:
            file.write(b"nonsense")
        done = subprocess.run([SERVER, self.bench, "--log-format", "json"], capture_output=True, timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, 2)
        [line] = self.lines(done.stderr)
        self.assertEqual(line["level"], "critical")
        self.assertIn("Error while parsing", line["message"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
