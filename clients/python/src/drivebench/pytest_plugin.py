"""The pytest plugin: fixtures for a bench and a device under test, and suites of TOML cases as tests.

pytest loads it by the entry point of the package; nothing else imports it.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator

import pytest

from drivebench.bench import Bench
from drivebench.programs import program
from drivebench.server import Server, serve

_END_S = 5.0  # from SIGTERM to SIGKILL
_VERB = "test"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addini("drivebench_suites", "folders whose *.toml files are cases of drivebench test", "paths", [])
    parser.addini("drivebench_bundles", "the folder for bundles of failed cases", default="drivebench-bundles")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "drivebench(bench, *options, server=False): the bench file or name of the fixtures bench "
                                       "and dut; options of drivebench-server, which server=True starts")


def pytest_collect_file(file_path: pathlib.Path, parent: pytest.Collector) -> "CaseFile | None":
    suites = parent.config.getini("drivebench_suites")
    if file_path.suffix != ".toml" or not any(suite in file_path.parents for suite in suites):
        return None
    file: CaseFile = CaseFile.from_parent(parent, path=file_path)
    return file


class CaseFile(pytest.File):
    """A file of cases: one item for each combination of its matrix and draws."""

    def collect(self) -> "Iterator[CaseItem]":
        done = subprocess.run([program(), _VERB, self.path, "--list"], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise self.CollectError(done.stderr.strip())
        for line in done.stdout.splitlines():
            yield CaseItem.from_parent(self, name=line.split("  ")[0])


class CaseFailed(Exception):
    """What drivebench test says of a case that has not passed."""


class CaseItem(pytest.Item):
    """A case, run by drivebench test."""

    def runtest(self) -> None:
        bundles = self.config.rootpath / self.config.getini("drivebench_bundles")
        with tempfile.TemporaryDirectory(prefix="drivebench-pytest-") as folder:
            report = pathlib.Path(folder) / "report.json"
            done = subprocess.run([program(), _VERB, self.path, "--filter", self.name, "--json", report, "--keep", bundles],
                                  capture_output=True, text=True, check=False)
            if not report.exists():
                raise CaseFailed(done.stderr.strip())
            cases = json.loads(report.read_text(encoding="utf-8"))["cases"]
        case = next(each for each in cases if each["name"] == self.name)
        if case["verdict"] == "skipped":
            pytest.skip(case["reason"])
        if case["verdict"] != "pass":
            raise CaseFailed(done.stdout.strip())

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: object = None) -> str:
        if isinstance(excinfo.value, CaseFailed):
            return str(excinfo.value)
        return str(super().repr_failure(excinfo))

    def reportinfo(self) -> tuple[pathlib.Path, None, str]:
        return self.path, None, self.name


def _marker(request: pytest.FixtureRequest) -> pytest.Mark:
    marker: pytest.Mark | None = request.node.get_closest_marker("drivebench")
    if marker is None or not marker.args:
        raise pytest.UsageError(f'{request.node.nodeid} uses {request.fixturename} and needs @pytest.mark.drivebench("BENCH")')
    return marker


@pytest.fixture
def drivebench_server(request: pytest.FixtureRequest) -> Iterator[Server]:
    """A drivebench-server of the test's own, on the bench and with the options of its marker."""
    with serve(*_marker(request).args) as server:
        yield server


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """The bench of the marker, new for each test: in this process, or on a server if the marker or dut asks for one."""
    marker = _marker(request)
    if marker.kwargs.get("server", False) or "dut" in request.fixturenames:
        address = request.getfixturevalue("drivebench_server").address
    else:
        address = f"inproc:{marker.args[0]}"
    with Bench(address) as opened:
        yield opened


@pytest.fixture
def dut(drivebench_server: Server, tmp_path: pathlib.Path) -> Iterator[Callable[..., "subprocess.Popen[bytes]"]]:
    """Starts a device under test: dut("./firmware", ...) is a process with the address of the bench in DRIVEBENCH_LINK. It
    ends with the test, and pytest shows what it printed if the test fails."""
    output = tmp_path / "dut.txt"
    running: list[subprocess.Popen[bytes]] = []

    def start(*command: str) -> "subprocess.Popen[bytes]":
        with output.open("ab") as stream:
            running.append(subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=stream, stderr=subprocess.STDOUT,
                                            env={**os.environ, "DRIVEBENCH_LINK": drivebench_server.address}))
        return running[-1]

    yield start
    for process in running:
        process.terminate()
        try:
            process.wait(_END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    if output.exists():
        sys.stdout.write(output.read_text(encoding="utf-8", errors="replace"))
