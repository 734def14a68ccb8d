"""Chosen signals of a run, as arrays."""
import operator
import types
from collections.abc import Callable
from typing import Any, Self

from drivebench.columns import Columns
from drivebench.description import Description
from drivebench.errors import BadArgument
from drivebench.library import Sample

_ARRAY_CODES = "Qqd"  # by Type


class Recorder(Columns):
    """The signals that Bench.record() was asked for, sample by sample, and `tick`.

    A context manager: at the end of its block it stops, and keeps what it has.
    """

    def __init__(self, description: Description, signals: list[str], axis: int, forget: Callable[["Recorder"], None]) -> None:
        for name in signals:
            if not isinstance(name, str) or name not in description.signals:
                raise BadArgument(f"there is no signal {name!r:.80}", "signals")
        super().__init__({name: _ARRAY_CODES[description.signals[name].type] for name in ["tick", *signals]})
        self._get = [operator.attrgetter(name) for name in self.names]
        self._period_s = description.period_s
        self._axis = axis
        self._forget: Callable[["Recorder"], None] | None = forget

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: types.TracebackType | None) -> None:
        self.stop()

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

    def _times(self) -> Any:
        return self.arrays()["tick"] * self._period_s
