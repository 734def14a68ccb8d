"""The pointer to an open bench: one thread at a time, closed once, and never used by a forked child."""
import ctypes
import os
import threading
import weakref
from typing import NoReturn

from drivebench.errors import BenchClosed, Code
from drivebench.library import Library

_open_handles: "weakref.WeakSet[Handle]" = weakref.WeakSet()


class Handle:
    """Every call on the pointer holds the lock; the same thread may enter again, as from a signal handler."""

    def __init__(self, library: Library, pointer: ctypes.c_void_p) -> None:
        self.library = library
        self.pointer: ctypes.c_void_p | None = pointer
        self.lock = threading.RLock()
        self._why_closed = "the bench is closed"
        _open_handles.add(self)

    def close(self) -> None:
        """Releases the axes and closes the bench; after the first time it does nothing."""
        with self.lock:
            pointer, self.pointer = self.pointer, None
            if pointer is not None:
                self.library.close(pointer)

    def fail(self, code: int) -> NoReturn:
        """Raises what the last call gave. The library refuses the null pointer of a closed bench."""
        if self.pointer is None:
            raise BenchClosed(self._why_closed, code=Code.BAD_ARGUMENT)
        raise self.library.error_for(code, self.pointer)

    def abandon(self) -> None:
        """For a forked child: the connection, and perhaps a lock, are its parent's."""
        self.lock = threading.RLock()
        self.pointer = None
        self._why_closed = "the bench was opened before the fork and belongs to the parent; open another one here"


def _abandon_all() -> None:
    for handle in list(_open_handles):
        handle.abandon()


os.register_at_fork(after_in_child=_abandon_all)
