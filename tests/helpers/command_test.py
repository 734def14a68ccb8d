"""Shared by the tests of the programs: a folder of their own, the programs run in it, and short ways to ask."""
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

from wire_client import BENCHES, PATIENCE_S, SERVER, Server, guarded
from wire_test import until  # noqa: F401

DRIVEBENCH = SERVER.parent / "drivebench"
SERVO = BENCHES / "servo.toml"
NO_BENCH = "tcp:127.0.0.1:1"  # a port without a listener

OK, FAILED, USAGE, NO_CONNECT, CUT_SHORT, TOO_LATE = 0, 1, 2, 3, 3, 3


def environment(link=NO_BENCH):
    """Without the variables of this machine's user."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("DRIVEBENCH_")}
    return {**guarded(clean), "DRIVEBENCH_LINK": link}


def link_of(server):
    return "tcp:%s:%d" % server.address


class CommandTest(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="drivebench-commands-")
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def server(self, *options, **more):
        server = Server(*options, **more)
        self.addCleanup(server.__exit__)
        return server

    def run_program(self, program, *arguments, link=NO_BENCH):
        return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, cwd=self.folder,
                              env=environment(link), timeout=4 * PATIENCE_S, check=False)

    def drivebench(self, *arguments, link=NO_BENCH, code=OK):
        done = self.run_program(DRIVEBENCH, *arguments, link=link)
        self.assertEqual(done.returncode, code, f"drivebench {arguments}: {done.stdout}{done.stderr}")
        return done

    def drivebench_server(self, *arguments, code=OK):
        done = self.run_program(SERVER, *arguments)
        self.assertEqual(done.returncode, code, f"drivebench-server {arguments}: {done.stdout}{done.stderr}")
        return done

    def json_of(self, *arguments, **more):
        return json.loads(self.drivebench(*arguments, "--json", **more).stdout)

    def start(self, *command, link=NO_BENCH):
        """A program that runs until a signal ends it."""
        process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True, cwd=self.folder, env=environment(link))

        def end():
            if process.poll() is None:
                process.kill()
            process.communicate()

        self.addCleanup(end)
        return process

    def assertSays(self, text, *facts):
        for fact in facts:
            self.assertIn(fact, text)

    def assertKeys(self, found, *keys):
        self.assertLessEqual(set(keys), set(found))
