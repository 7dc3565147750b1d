"""What a function does, as a number: it keys caches of what the function computed.

Bytecode differs between versions of Python, so such a number tells one function from another on one
installation; it is no identity to be written into results.
"""

from __future__ import annotations

import functools
import hashlib
import pickle
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

# modules whose functions are told by their names: what they do changes with an installation, not with a script
_INSTALLED = {"numpy", "scipy", "numba", "xarray", "h5py", "pymunk", "granswim_pymunk"}
# ... but laws are followed down to their last helper
_FOLLOWED = "granswim_pymunk.laws"


def fingerprint(*values: Any) -> str:
    """SHA-256 over what the values say and do, as 64 hexadecimal digits.

    Of a function: its bytecode with constants and nested functions, defaults, values of its closure, and the
    globals it names, functions among them followed in the same way. Equal functions have equal fingerprints
    whatever their file, line or name; anything that changes what they return makes another one.
    """
    total = hashlib.sha256()
    seen: set[int] = set()
    for value in values:
        for part in _parts(value, seen):
            total.update(len(part).to_bytes(8, "little"))
            total.update(part)
    return total.hexdigest()


def _text(*words: Any) -> bytes:
    return " ".join(map(str, words)).encode("utf-8", "backslashreplace")


def _parts(value: Any, seen: set[int]) -> Iterator[bytes]:
    if value is None or isinstance(value, bool | int | float | complex | str | bytes):
        yield _text(type(value).__name__, repr(value))
    elif isinstance(value, np.ndarray | np.generic):
        array = np.asarray(value)
        yield _text("array", array.dtype.str, array.shape)
        yield pickle.dumps(array.tolist()) if array.dtype.hasobject else np.ascontiguousarray(array).tobytes()
    elif id(value) in seen:  # a function that calls itself, a list that holds itself
        yield b"again"
    else:
        seen.add(id(value))
        try:
            yield from _compound(value, seen)
        finally:
            seen.discard(id(value))


def _compound(value: Any, seen: set[int]) -> Iterator[bytes]:
    if isinstance(value, Mapping):
        yield _text("mapping", len(value))
        for key in sorted(value, key=repr):
            yield from _all((key, value[key]), seen)
    elif isinstance(value, list | tuple):
        yield _text(type(value).__name__, len(value))
        yield from _all(value, seen)
    elif isinstance(value, set | frozenset):
        yield _text("set", len(value))
        yield from _all(sorted(value, key=repr), seen)
    elif isinstance(value, functools.partial):
        yield from _all(("partial", value.func, value.args, dict(value.keywords)), seen)
    elif isinstance(value, CodeType):
        yield from _code(value, seen)
    elif isinstance(value, FunctionType):
        yield from _function(value, seen)
    elif isinstance(value, MethodType):
        yield from _all(("method", value.__func__, value.__self__), seen)
    elif isinstance(getattr(value, "py_func", None), FunctionType):  # compiled by numba
        yield from _all(("compiled", value.py_func), seen)
    elif isinstance(value, ModuleType):
        yield _text("module", value.__name__)
    elif isinstance(value, type | BuiltinFunctionType | np.ufunc):
        yield _text("named", getattr(value, "__module__", ""), getattr(value, "__qualname__", repr(value)))
        if isinstance(value, type) and not _installed(value.__module__):
            for name, method in sorted(vars(value).items()):
                if isinstance(method, FunctionType):
                    yield from _all((name, method), seen)
    elif isinstance(getattr(value, "fingerprint", None), str):
        yield _text("own", value.fingerprint)
    elif is_dataclass(value):
        yield from _all((type(value), *(getattr(value, f.name) for f in fields(value))), seen)
    elif type(value).__repr__ is not object.__repr__:
        yield _text(type(value).__module__, type(value).__qualname__, repr(value))
    else:
        try:  # type: ignore[unreachable]
            yield pickle.dumps(value)
        except Exception:  # whatever it is: it is taken for nothing else, and by no other process
            yield _text(type(value).__qualname__, id(value))


def _all(values: Iterable[Any], seen: set[int]) -> Iterator[bytes]:
    for value in values:
        yield from _parts(value, seen)


def _code(code: CodeType, seen: set[int]) -> Iterator[bytes]:
    yield code.co_code
    shape = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
    yield from _all((shape, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars), seen)
    yield getattr(code, "co_exceptiontable", b"")
    yield from _all(code.co_consts, seen)


def _names(code: CodeType) -> set[str]:
    """Names of globals and attributes, in nested functions too."""
    found = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            found |= _names(constant)
    return found


def _function(function: FunctionType, seen: set[int]) -> Iterator[bytes]:
    yield from _all(("function", function.__code__, function.__defaults__, function.__kwdefaults__), seen)
    for cell in function.__closure__ or ():
        try:
            yield from _parts(cell.cell_contents, seen)
        except ValueError:
            yield b"empty cell"
    names = _names(function.__code__)
    for name in sorted(names & function.__globals__.keys()):
        value = function.__globals__[name]
        yield _text("global", name)
        inner = getattr(value, "py_func", value)  # what numba compiled
        if isinstance(inner, FunctionType) and _installed(inner.__module__):
            yield _text("named", inner.__module__, inner.__qualname__)
            continue
        yield from _parts(value, seen)
        if isinstance(value, ModuleType) and not _installed(value.__name__):
            # somebody's own module of helpers: what is taken from it
            for attribute in sorted(names & vars(value).keys()):
                yield from _all((attribute, getattr(value, attribute)), seen)


def _installed(module: str | None) -> bool:
    name = module or ""
    top = name.partition(".")[0]
    return not name.startswith(_FOLLOWED) and (top in sys.stdlib_module_names or top in _INSTALLED)


__all__ = ["fingerprint"]
