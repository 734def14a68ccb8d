"""A drivebench-server of one's own, for tests and CI."""
import json
import os
import selectors
import subprocess
import tempfile
import types
import weakref
from typing import IO, Any, Self

from drivebench import arguments
from drivebench.errors import ServerFailed
from drivebench.programs import program

_END_S = 10.0  # from SIGTERM to SIGKILL


def _end(process: "subprocess.Popen[str]", owner: int) -> None:
    """Ends the server so that it makes its recording whole and tells its verdict. A forked child leaves it alone."""
    if os.getpid() != owner:
        return
    process.terminate()
    try:
        process.wait(_END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


class Server:
    """A running drivebench-server; see serve().

    address: for Bench(), for example "tcp:127.0.0.1:41235".
    ready: what the server said when it was ready: "tcp", "unix", "can", "modbus", "mode", "bench".
    """

    def __init__(self, command: list[str], timeout_s: float) -> None:
        self._log: IO[str] = tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace")
        try:
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=self._log,
                                            text=True, encoding="utf-8")
        except OSError as error:
            raise ServerFailed(f"{command[0]} cannot be started: {error}") from error
        self._owner = os.getpid()
        self._finalizer = weakref.finalize(self, _end, self.process, self._owner)  # also at exit
        self.ready: dict[str, Any] = self._wait(timeout_s)
        self.address: str = "tcp:" + self.ready["tcp"]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: types.TracebackType | None) -> None:
        self.stop()

    def stop(self) -> dict[str, Any] | None:
        """Ends the server, which makes its recording whole, and returns its verdict on the run: "ticks", "exact",
        "state_hash", ... None if it had been killed. Again, and in a forked child, it does nothing."""
        if os.getpid() != self._owner or self._finalizer.detach() is None:
            return None
        _end(self.process, self._owner)
        verdict = None
        for line in self._output():
            event = json.loads(line)
            verdict = event if event["event"] == "verdict" else verdict
        self._log.close()
        return verdict

    def errors(self) -> str:
        """What the server has written to its standard error."""
        if self._log.closed:
            return ""
        self._log.seek(0)
        return self._log.read().strip()

    def _output(self) -> list[str]:
        assert self.process.stdout is not None
        with self.process.stdout:
            return self.process.stdout.readlines()

    def _wait(self, timeout_s: float) -> dict[str, Any]:
        """The line with which the server says where it listens."""
        assert self.process.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(self.process.stdout, selectors.EVENT_READ)
            in_time = bool(selector.select(timeout_s))
        line = self.process.stdout.readline() if in_time else ""
        if line:
            ready: dict[str, Any] = json.loads(line)
            return ready
        self._finalizer()
        self._output()
        words = self.errors()
        self._log.close()
        why = f"ended with exit code {self.process.returncode}" if in_time else f"was not ready within {timeout_s} s"
        raise ServerFailed(f"drivebench-server {why}: {words}")


def serve(bench: str = "servo", *options: str, timeout_s: float = 30.0) -> Server:
    """Starts a drivebench-server on a port that the system chooses, and waits until it is ready; a context manager, which
    ends it. It also ends with this program.

    bench: a bench file, or the name of one that came with drivebench.
    options: of drivebench-server, for example "--mode", "realtime" or "--record", "run.mcap".
    timeout_s: [s] for the start.
    """
    words = [arguments.string("bench", bench), *(arguments.string("options", each) for each in options)]
    command = [program(), "serve", *(word.decode() for word in words), "--port", "0", "--json"]
    return Server(command, arguments.milliseconds("timeout_s", timeout_s) / 1000)
