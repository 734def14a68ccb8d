"""Signals over the ticks of a run."""
import array
import importlib.util
from typing import Any

from drivebench.errors import BadArgument


class Columns:
    """A column for each signal, `tick` first, and a row for each sample."""

    def __init__(self, codes: dict[str, str]) -> None:
        """`codes`: the array code of each name."""
        self.names = list(codes)
        self._columns: list[array.array[Any]] = [array.array(code) for code in codes.values()]

    def __len__(self) -> int:
        return len(self._columns[0])

    def __getitem__(self, name: str) -> Any:
        """One signal, as in arrays()."""
        if name not in self.names:
            raise BadArgument(f"{name!r:.80} is no column here", "signals")
        return self.arrays()[name]

    def arrays(self) -> dict[str, Any]:
        """The signals by name: NumPy arrays if NumPy is installed, else lists."""
        if importlib.util.find_spec("numpy") is None:
            return {name: column.tolist() for name, column in zip(self.names, self._columns)}
        import numpy
        return {name: numpy.array(column) for name, column in zip(self.names, self._columns)}

    def dataframe(self) -> Any:
        """A pandas DataFrame over the time [s]."""
        import pandas  # type: ignore[import]
        return pandas.DataFrame(self.arrays(), index=pandas.Index(self._times(), name="time_s"))

    def _times(self) -> Any:
        """[s] as a NumPy array."""
        raise NotImplementedError
