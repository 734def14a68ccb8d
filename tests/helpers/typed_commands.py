"""Command lines, run as a user types them."""
import os
import select
import shlex
import signal
import subprocess

from wire_client import PATIENCE_S, REPOSITORY, SERVER, guarded


class Bench:
    """Runs lines in order, in a folder that keeps their files. The newest server that was started is the bench of the
    commands that follow it; ports are chosen by the system instead of 7300."""

    def __init__(self, folder):
        self.folder = folder
        (folder / "configs").symlink_to(REPOSITORY / "configs")
        self.environment = guarded({name: value for name, value in os.environ.items() if not name.startswith("DRIVEBENCH_")})
        self.server = None
        self.moved = False
        self.ends_by_itself = False

    def program(self, *words):
        return [str(SERVER.parent / words[0]), *words[1:]]

    def start(self, words):
        self.stop()
        self.ends_by_itself = "--duration" in words
        self.server = subprocess.Popen(self.program(*words, "--port", "0"), stdout=subprocess.PIPE, text=True,
                                       cwd=self.folder, env=self.environment)
        ready = self.server.stdout.readline()
        if not ready.startswith("ready tcp="):
            raise AssertionError(f"{words}: no server, exit {self.server.wait()}")
        self.environment["DRIVEBENCH_LINK"] = "tcp:" + ready.split("tcp=")[1].split()[0]
        self.moved = False

    def stop(self):
        if self.server is None:
            return
        if not self.ends_by_itself:
            self.server.send_signal(signal.SIGTERM)
        self.server.communicate(timeout=PATIENCE_S)
        code, self.server = self.server.returncode, None
        if code != 0:
            raise AssertionError(f"the server ended with {code}")

    def kill(self):
        if self.server is not None:
            self.server.kill()
            self.server.communicate()

    def run(self, words):
        if ">" in words:
            words = words[:words.index(">")]
        done = subprocess.run(self.program(*words), capture_output=True, text=True, cwd=self.folder,
                              env=self.environment, timeout=4 * PATIENCE_S, check=False)
        if done.returncode != 0:
            raise AssertionError(f"{shlex.join(words)}: exit {done.returncode}: {done.stdout}{done.stderr}")
        return done.stdout

    def move(self):
        self.run(["drivebench", "control"])
        self.moved = True

    def watch(self, words):
        """Live values: waits for the first, without a controller, then sends ctrl-C."""
        watching = subprocess.Popen(self.program(*words), stdout=subprocess.PIPE, cwd=self.folder, env=self.environment)
        try:
            if not select.select([watching.stdout], [], [], PATIENCE_S)[0]:
                raise AssertionError(f"{shlex.join(words)}: no values")
            watching.send_signal(signal.SIGINT)
            out, _ = watching.communicate(timeout=PATIENCE_S)
            if watching.returncode != 0 or not out:
                raise AssertionError(f"{shlex.join(words)}: exit {watching.returncode}")
        finally:
            if watching.poll() is None:
                watching.kill()
                watching.communicate()

    def do(self, line):
        words = shlex.split(line, comments=True)
        if words[:2] == ["drivebench", "serve"] or words[0] == "drivebench-server" and "--replay" not in words:
            self.start(words)
        elif words[1] in ("replay", "--replay", "export", "plot") or "--compare" in words:
            if self.server is not None and not self.moved and not self.ends_by_itself:
                self.move()  # something to read
            self.stop()  # a recording is whole when its server has ended
            self.run(words)
        elif words[1] == "watch":
            self.watch(words)
        else:
            if self.server is None:
                self.start(["drivebench", "serve"])
            self.run(words)
            self.moved = self.moved or words[1] == "control"
