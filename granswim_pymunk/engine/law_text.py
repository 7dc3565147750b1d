"""The function of a law as a text that stands alone: what generated code is made of."""

from __future__ import annotations

import ast
import dis
import functools
import inspect
import math
import textwrap
from collections.abc import Callable
from types import CodeType
from typing import Any

from ..laws import Law

_PLAIN_GLOBALS = {"math", "np", "numpy"}


def raises(function: Callable[..., Any]) -> bool:
    """Whether a function, or one that it calls by name, can raise an error of its own."""
    left, seen = [function], []
    while left:
        one = left.pop()
        one = inspect.unwrap(getattr(one, "py_func", one))
        code = getattr(one, "__code__", None)
        if code is None or code in seen:
            continue
        seen.append(code)
        if _has_raise(code):
            return True
        closed = [cell.cell_contents for cell in one.__closure__ or ()]
        named = [one.__globals__[name] for name in code.co_names if name in one.__globals__]
        left += [value for value in (*closed, *named) if inspect.isfunction(getattr(value, "py_func", value))]
    return False


@functools.cache  # asked for each law of each simulation, and reading bytecode takes as long as building the rest
def _has_raise(code: CodeType) -> bool:
    return any(step.opname == "RAISE_VARARGS" for step in dis.get_instructions(code))


def definition_of(law: Law, name: str) -> ast.FunctionDef | None:
    """The law's function under another name, without annotations and docstring; None where it cannot stand alone.

    Numbers that it looks up in its module are written into it. A function stands alone where its source can be had, it
    closes over nothing, and looks up nothing but numbers, ``math`` and ``numpy``.
    """
    function = inspect.unwrap(law.function)
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError):
        return None
    definition = next((node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)), None)
    if definition is None or function.__closure__:
        return None
    constants: list[ast.stmt] = []
    for known in function.__code__.co_names:
        if known in function.__globals__ and known not in _PLAIN_GLOBALS:
            value = function.__globals__[known]
            if not isinstance(value, int | float) or not math.isfinite(value):
                return None
            number = int(value) if isinstance(value, int) else float(value)
            constants.append(ast.parse(f"{known} = {number!r}").body[0])
    definition.decorator_list = []
    definition.name = name
    definition.returns = None
    for argument in definition.args.args:
        argument.annotation = None
    if ast.get_docstring(definition) is not None:
        definition.body = definition.body[1:]
    # inside the function: two laws may give one name to different numbers
    definition.body = constants + definition.body
    return definition


def source_of(law: Law) -> str | None:
    """The law as the text of a compiled function ``law_NAME``, or None where it cannot stand alone."""
    definition = definition_of(law, f"law_{law.name}")
    if definition is None:
        return None
    return "@njit(**INLINE)\n" + ast.unparse(ast.fix_missing_locations(definition)) + "\n"
