"""The pointer to an open bench or bridge: one thread at a time, closed once, and never used by a forked child."""
import ctypes
import os
import threading
import types
import weakref
from collections.abc import Callable
from typing import Any, NoReturn, Self

from drivebench.errors import BenchClosed, Code, DrivebenchError

_open_handles: "weakref.WeakSet[Handle]" = weakref.WeakSet()


class Handle:
    """Every call on the pointer holds the lock; the same thread may enter again, as from a signal handler."""

    def __init__(self, pointer: ctypes.c_void_p, close: Callable[[Any], None],
                 error_for: Callable[[int, Any], DrivebenchError], what: str) -> None:
        self._close = close
        self._error_for = error_for
        self._what = what
        self.pointer: ctypes.c_void_p | None = pointer
        self.lock = threading.RLock()
        self._why_closed = f"the {what} is closed"
        _open_handles.add(self)

    def close(self) -> None:
        """Closes what is open; after the first time it does nothing."""
        with self.lock:
            pointer, self.pointer = self.pointer, None
            if pointer is not None:
                self._close(pointer)

    def fail(self, code: int) -> NoReturn:
        """Raises what the last call gave. The library refuses the null pointer of a closed one."""
        if self.pointer is None:
            raise BenchClosed(self._why_closed, code=Code.BAD_ARGUMENT)
        raise self._error_for(code, self.pointer)

    def abandon(self) -> None:
        """For a forked child: the connection, and perhaps a lock, are its parent's."""
        self.lock = threading.RLock()
        self.pointer = None
        self._why_closed = f"the {self._what} was opened before the fork and belongs to the parent; open another one here"


class Opened:
    """What an address has opened: a context manager, which closes it."""

    def __init__(self, address: str, handle: Handle) -> None:
        self.address = address
        self._handle = handle
        self._finalizer = weakref.finalize(self, handle.close)  # also at exit

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: types.TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Closes it, which releases all axes; again does nothing."""
        self._handle.close()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.address!r}{', closed' if self._handle.pointer is None else ''})"


def _abandon_all() -> None:
    for handle in list(_open_handles):
        handle.abandon()


os.register_at_fork(after_in_child=_abandon_all)
