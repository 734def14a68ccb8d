"""Recordings of a server, read through the program `drivebench`."""
import array
import csv
import os
import pathlib
import subprocess
import tempfile
from collections.abc import Iterable
from typing import Any

from drivebench import arguments
from drivebench.columns import Columns
from drivebench.errors import BadArgument
from drivebench.programs import program

_WHOLE, _CUT_SHORT = 0, 3  # exit codes of `drivebench export`


class Recording(Columns):
    """The samples of one axis: `tick` as int, all else as float.

    whole: False if the recording has no end or has lost entries, as after a kill; it then has what there is.
    """

    def __init__(self, rows: Iterable[list[str]]) -> None:
        """`rows`: those of the CSV file: tick, time, signals with their units in brackets."""
        lines = iter(rows)
        heads = [head.split(" [")[0] for head in next(lines, ["tick", "time_s"])]
        super().__init__({heads[0]: "Q", **{name: "d" for name in heads[2:]}})
        self._time = array.array("d")
        self.whole = True
        for tick, time_s, *values in lines:
            self._columns[0].append(int(tick))
            self._time.append(float(time_s))
            for column, value in zip(self._columns[1:], values):
                column.append(float(value))

    def _times(self) -> Any:
        import numpy
        return numpy.array(self._time)


def read_recording(file: str | os.PathLike[str], signals: Iterable[str] = (), axis: str | None = None) -> Recording:
    """Reads an MCAP recording of a drivebench-server.

    signals: their names; all without it. axis: its name; the first in the file without it.
    """
    command = [program(), "export", str(pathlib.Path(file).absolute())]
    names = [arguments.string("signals", name).decode() for name in signals]
    command += [f"--signals={','.join(names)}"] if names else []
    command += [f"--axis={arguments.string('axis', axis).decode()}"] if axis is not None else []
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as log:
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, encoding="utf-8") as export:
            assert export.stdout is not None
            recording = Recording(csv.reader(export.stdout))
        if export.returncode not in (_WHOLE, _CUT_SHORT):
            log.seek(0)
            raise BadArgument(f"{file} cannot be read: {log.read().strip()}", "file")
    recording.whole = export.returncode == _WHOLE
    return recording
