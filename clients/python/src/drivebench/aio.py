"""The bench for asyncio."""
import asyncio
import concurrent.futures
import functools
import os
import types
from collections.abc import Awaitable, Callable
from typing import Concatenate, ParamSpec, Self, TypeVar

from drivebench.bench import Bench
from drivebench.errors import BenchClosed

_P = ParamSpec("_P")
_R = TypeVar("_R")


def _awaited(method: Callable[Concatenate[Bench, _P], _R]) -> Callable[Concatenate["AsyncBench", _P], Awaitable[_R]]:
    """The same call, carried out in the worker thread."""
    @functools.wraps(method)
    async def call(bench: "AsyncBench", /, *args: _P.args, **keywords: _P.kwargs) -> _R:
        return await bench._in_worker(lambda: method(bench._opened(), *args, **keywords))
    return call


class AsyncBench:
    """A Bench whose calls are awaited: `async with drivebench.AsyncBench(address) as bench`.

    The arguments are those of Bench. All calls run in one thread of this bench, in the order in which they were made. A
    call whose task is cancelled before it has begun is not made; one that has begun runs to its end, its result is
    dropped, and the next call comes after it.
    """

    def __init__(self, address: str, token: str | None = None, deadline_s: float = 5.0, clear: bool = False,
                 conducts: bool = False) -> None:
        self._open = functools.partial(Bench, address, token, deadline_s, clear, conducts)
        self._bench: Bench | None = None
        self._process = os.getpid()  # a forked child has no worker
        self._worker = concurrent.futures.ThreadPoolExecutor(1, "drivebench")

    async def __aenter__(self) -> Self:
        try:
            await self._in_worker(self._open_here)
        except BaseException:
            self._end()
            raise
        return self

    async def __aexit__(self, kind: type[BaseException] | None, error: BaseException | None,
                        trace: types.TracebackType | None) -> None:
        await self.close()

    async def close(self) -> None:
        """Releases the axes and closes the bench, even if the task is cancelled meanwhile; again does nothing."""
        closing = self._end()
        if closing is not None:
            await asyncio.shield(asyncio.wrap_future(closing))

    acquire = _awaited(Bench.acquire)
    renew = _awaited(Bench.renew)
    release = _awaited(Bench.release)
    clear = _awaited(Bench.clear)
    describe = _awaited(Bench.describe)
    step = _awaited(Bench.step)
    step_all = _awaited(Bench.step_all)
    run = _awaited(Bench.run)
    newest = _awaited(Bench.newest)
    record = _awaited(Bench.record)
    get = _awaited(Bench.get)
    set = _awaited(Bench.set)
    set_load = _awaited(Bench.set_load)
    inject = _awaited(Bench.inject)
    bump = _awaited(Bench.bump)
    event_tick = _awaited(Bench.event_tick)
    state_hash = _awaited(Bench.state_hash)
    reset = _awaited(Bench.reset)
    save = _awaited(Bench.save)
    restore = _awaited(Bench.restore)

    async def _in_worker(self, call: Callable[[], _R]) -> _R:
        if os.getpid() != self._process:
            raise BenchClosed("the bench belongs to the process that opened it; open another one here")
        try:
            made = self._worker.submit(call)
        except RuntimeError:  # the worker has ended
            raise BenchClosed("the bench is closed") from None
        return await asyncio.wrap_future(made)

    def _open_here(self) -> None:
        self._bench = self._open()

    def _close_here(self) -> None:
        if self._bench is not None:
            self._bench.close()

    def _opened(self) -> Bench:
        if self._bench is None:
            raise BenchClosed("the bench is not open: use `async with`")
        return self._bench

    def _end(self) -> "concurrent.futures.Future[None] | None":
        """Lets the worker close the bench as its last call."""
        try:
            closing = self._worker.submit(self._close_here)
        except RuntimeError:
            return None
        self._worker.shutdown(wait=False)
        return closing
