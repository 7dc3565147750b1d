"""Threads in which the criteria of the diagnosis under way decide."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import copy_context
from typing import ParamSpec, TypeVar, cast

P = ParamSpec("P")
Found = TypeVar("Found")


class ContextPool(ThreadPoolExecutor):
    """A pool whose work runs in the context of whoever asks for it, as if it were done there."""

    def submit(self, fn: Callable[P, Found], /, *args: P.args, **kwargs: P.kwargs) -> Future[Found]:
        run = cast(Callable[..., Found], copy_context().run)
        return super().submit(run, fn, *args, **kwargs)
