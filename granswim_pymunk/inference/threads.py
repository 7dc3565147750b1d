"""Threads in which the criteria of the diagnosis under way decide."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from typing import Any, ParamSpec, TypeVar, cast

P = ParamSpec("P")
Asked = TypeVar("Asked")
Found = TypeVar("Found")


class ContextPool(ThreadPoolExecutor):
    """A pool whose work runs in the context of whoever asks for it, as if it were done there."""

    def submit(self, fn: Callable[P, Found], /, *args: P.args, **kwargs: P.kwargs) -> Future[Found]:
        run = cast(Callable[..., Found], copy_context().run)
        return super().submit(run, fn, *args, **kwargs)

    def spread(self, fn: Callable[[Asked], Found], items: Iterable[Asked], alone: bool = False) -> list[Found]:
        """What ``fn`` makes of each, in their order: for jobs so short that handing one over takes as long.

        Each thread gets every k-th, the caller the first of them. k is how many cores there are for each piece of work
        that is ``at_work``: where that keeps all of them busy, or ``alone`` says so, nothing is handed over.
        """
        every = list(items)
        among = min(self._max_workers // max(_WORK.count, 1), len(every))
        if alone or among < 2:
            return [fn(item) for item in every]

        def those(first: int) -> list[Found]:
            return [fn(item) for item in every[first::among]]

        others = [self.submit(those, first) for first in range(1, among)]
        found: list[Any] = [None] * len(every)
        found[::among] = those(0)
        for first, other in enumerate(others, 1):
            found[first::among] = other.result()
        return found


class _Work:
    """How many long pieces of work go on side by side."""

    def __init__(self) -> None:
        self.count = 0
        self._lock = threading.Lock()

    def add(self, more: int) -> None:
        with self._lock:
            self.count += more


_WORK = _Work()


@contextmanager
def at_work() -> Iterator[None]:
    """Counts what is done in it as one piece of work that goes on beside others, see ``ContextPool.spread``."""
    _WORK.add(1)
    try:
        yield
    finally:
        _WORK.add(-1)
