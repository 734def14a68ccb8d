"""Chosen signals of a run, as arrays."""
import array
import importlib.util
import operator
import types
from collections.abc import Callable
from typing import Any, Self

from drivebench.description import Description
from drivebench.errors import BadArgument
from drivebench.library import Sample

_ARRAY_CODES = "Qqd"  # by Type


class Recorder:
    """The signals that Bench.record() was asked for, sample by sample, and `tick`.

    A context manager: at the end of its block it stops, and keeps what it has.
    """

    def __init__(self, description: Description, signals: list[str], axis: int, forget: Callable[["Recorder"], None]) -> None:
        for name in signals:
            if not isinstance(name, str) or name not in description.signals:
                raise BadArgument(f"there is no signal {name!r:.80}", "signals")
        names = list(dict.fromkeys(["tick", *signals]))
        self._columns = [array.array(_ARRAY_CODES[description.signals[name].type]) for name in names]
        self._names = names
        self._get = [operator.attrgetter(name) for name in names]
        self._period_s = description.period_s
        self._axis = axis
        self._forget: Callable[["Recorder"], None] | None = forget

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: types.TracebackType | None) -> None:
        self.stop()

    def __len__(self) -> int:
        return len(self._columns[0])

    def stop(self) -> None:
        """Records no more; again does nothing."""
        if self._forget is not None:
            self._forget(self)
            self._forget = None

    def add(self, axis: int, sample: Sample) -> None:
        """Keeps a sample of the recorder's axis; the same tick again only once."""
        if axis != self._axis or (len(self) and self._columns[0][-1] == sample.tick):
            return
        for column, get in zip(self._columns, self._get):
            column.append(get(sample))

    def __getitem__(self, name: str) -> Any:
        """One signal, as in arrays()."""
        if name not in self._names:
            raise BadArgument(f"{name!r:.80} was not recorded", "signals")
        return self.arrays()[name]

    def arrays(self) -> dict[str, Any]:
        """The signals by name: NumPy arrays if NumPy is installed, else lists."""
        if importlib.util.find_spec("numpy") is None:
            return {name: column.tolist() for name, column in zip(self._names, self._columns)}
        import numpy
        return {name: numpy.array(column) for name, column in zip(self._names, self._columns)}

    def dataframe(self) -> Any:
        """A pandas DataFrame over the time [s]."""
        import pandas  # type: ignore[import]
        columns = self.arrays()
        return pandas.DataFrame(columns, index=pandas.Index(columns["tick"] * self._period_s, name="time_s"))
