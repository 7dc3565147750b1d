"""``njit`` and ``cfunc`` whose machine code is kept in the user's cache, whole or not at all.

numba itself would leave it beside the installed modules, and reads back whatever it finds there. Here each
compiled function is one file in a folder that only this user can write to, with a sum over its content: a file
that was cut or changed is noticed, said once, and compiled again.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import linecache
import logging
import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import parent_process
from pathlib import Path
from typing import Any

import numba
from numba.core import cgutils, config, sigutils, types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache
from numba.core.ccallback import CFunc
from numba.extending import intrinsic
from tqdm import tqdm

from .files import written_whole
from .storage import code_folder

log = logging.getLogger("granswim")

MAGIC = b"granswim machine code 1\n"
_SUM = 32


@functools.cache
def _said(text: str) -> None:
    log.warning("%s", text)


_WATCHES: list[Callable[[], None]] = []  # called whenever a function has been compiled


@contextmanager
def shown(total: int) -> Iterator[None]:
    """A progress bar over about ``total`` functions, from the first one that is not in the cache.

    Shown on a terminal only, and by the process that a person has started, not by its workers.
    """
    bar: Any = None

    def watch() -> None:
        nonlocal bar
        if bar is None:
            bar = tqdm(total=total, desc="compiling the laws, once", disable=None, leave=False, dynamic_ncols=True)
        bar.update(1)

    if parent_process() is None:
        _WATCHES.append(watch)
    try:
        yield
    finally:
        if watch in _WATCHES:
            _WATCHES.remove(watch)
        if bar is not None:
            bar.close()


@functools.cache
def _shared() -> bytes:
    """A sum over the modules whose functions are compiled into those of others."""
    total = hashlib.sha256()
    for name in ("compiled.py", "engine/native.py", "engine/neighbours.py"):
        total.update((Path(__file__).parent / name).read_bytes())
    return total.digest()


class _Locator:
    """Where the code of a function is kept, and what it was compiled from."""

    def __init__(self, function: Any, file: str, folder: Path) -> None:
        self._py_file = file
        self._function = function
        self._folder = folder

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Locator | None:
        folder = code_folder()
        return None if folder is None else cls(function, file, folder)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def ensure_cache_path(self) -> None:
        os.makedirs(self._folder, mode=0o700, exist_ok=True)

    def get_source_stamp(self) -> str:
        # the whole file: functions call each other
        text = "".join(linecache.getlines(self._py_file)) or inspect.getsource(self._function)
        return hashlib.sha256(text.encode() + _shared()).hexdigest()

    def get_disambiguator(self) -> str:
        place = hashlib.sha256(os.path.dirname(self._py_file).encode()).hexdigest()[:8]
        return f"{self._function.__code__.co_firstlineno}-{place}"


class _Implementation(CompileResultCacheImpl):
    _locator_classes = (_Locator,)  # type: ignore[assignment]


class _Files:
    """One file for each signature: magic, sum, and a pickle of (numba's version, stamp of the source, code)."""

    def __init__(self, folder: str, base: str, stamp: str) -> None:
        self._folder, self._base = Path(folder), base
        self._head = (numba.__version__, stamp)

    def file(self, key: Any) -> Path:
        return self._folder / f"{self._base[:100]}-{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.code"

    def load(self, key: Any) -> Any:
        file = self.file(key)
        try:
            data = file.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            _said(f"machine code cannot be read, compiling anew: {file}: {error.strerror}")
            return None
        body = memoryview(data)[len(MAGIC) + _SUM :]
        if data[: len(MAGIC)] != MAGIC or hashlib.sha256(body).digest() != data[len(MAGIC) : len(MAGIC) + _SUM]:
            _said(f"machine code in {file.parent} is damaged, compiling anew: {file.name}")
            return None
        head, code = pickle.loads(body)
        return code if head == self._head else None

    def save(self, key: Any, code: Any) -> None:
        for watch in _WATCHES:
            watch()
        body = numba.core.serialize.dumps((self._head, code))
        try:
            with written_whole(self.file(key), mode=0o600, sure=True) as stream:
                stream.write(MAGIC + hashlib.sha256(body).digest() + body)
        except OSError as error:
            _said(f"machine code is not kept in {self._folder}: {error.strerror or error}")

    def flush(self) -> None:
        for file in self._folder.glob(f"{self._base}-*.code"):
            file.unlink(missing_ok=True)


class _Cache(FunctionCache):  # type: ignore[misc]
    _impl_class = _Implementation

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file: Any = _Files(self._cache_path, self._impl.filename_base, stamp)

    def _load_overload(self, signature: Any, target: Any) -> Any:
        try:
            return super()._load_overload(signature, target)
        except Exception as error:  # whole, and yet this numba cannot make anything of it
            _said(f"machine code in {self._cache_path} cannot be used ({type(error).__name__}), compiling anew")
            return None


def _cache(function: Any) -> Any:
    if code_folder() is None:
        return NullCache()
    return _Cache(function)


def njit(*, cache: bool = True, **options: Any) -> Callable[[Any], Any]:
    """``numba.njit`` with the code kept in the user's cache."""

    def wrap(function: Any) -> Any:
        dispatcher = numba.njit(**options)(function)
        if cache and not getattr(config, "DISABLE_JIT", False):
            dispatcher._cache = _cache(function)
        return dispatcher

    return wrap


def cfunc(signature: Any, *, cache: bool = True, **options: Any) -> Callable[[Any], Any]:
    """``numba.cfunc`` with the code kept in the user's cache."""

    def wrap(function: Any) -> Any:
        callback: Any = CFunc(function, sigutils.normalize_signature(signature), locals={}, options=options)
        if cache:
            callback._cache = _cache(function)
        callback.compile()
        return callback

    return wrap


def fetch(builder: Any, pointer: Any) -> None:
    """Ask for the cache line at a pointer, which may lie beyond what is allocated."""
    ir = cgutils.ir
    flag = ir.IntType(32)
    kind = ir.FunctionType(ir.VoidType(), [pointer.type, flag, flag, flag])
    prefetch = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
    # to read, into all levels, data
    builder.call(prefetch, [pointer, *(ir.Constant(flag, k) for k in (0, 3, 1))])


@intrinsic
def ask_for(typingctx, rows, at):
    """Ask for row ``at`` of an array (n, 2) of floats, so that it is in the caches when it is read."""

    def generate(context, builder, signature, args):
        number = cgutils.ir.IntType(64)
        first = context.make_array(signature.args[0])(context, builder, args[0]).data
        place = builder.mul(builder.zext(args[1], number), cgutils.ir.Constant(number, 2))
        fetch(builder, builder.bitcast(builder.gep(first, [place]), cgutils.voidptr_t))
        return context.get_dummy_value()

    return types.void(rows, types.uint32), generate
