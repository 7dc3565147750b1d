"""Commands given to the apparatus: what a motor was told, from a log of its own or the table of the tracks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from .base import Options
from .headings import is_clock
from .long import clock
from .source import Source
from .table import Table
from .units import TIMES, factor

LONG = {"t", "name", "value"}  # the form of input.csv
AT_ONCE = 1e-6  # of the time between two rows, in which a command that is held becomes the next one


def add_commands(data: dict[str, Any], options: Options, bodies: Sequence[str], notes: list[str]) -> None:
    """Put the commands of ``options.inputs`` into a scene's data, with a drive where no law makes a body follow them.

    bodies : those that are seen. Raises InputError naming file, column or row
    """
    laws = [item for item in data.get("law", []) if isinstance(item, Mapping)]
    drives = [item for item in laws if item.get("name") == "drive"]
    driven = [name for item in drives for name in item.get("bodies", [item["body"]] if "body" in item else [])]
    series: dict[str, Any] = {}
    for text in options.inputs:
        found = read_commands(text, options, driven or list(bodies))
        if twice := sorted(found.keys() & series.keys()):
            raise InputError(f"body {twice[0]} has commands twice", where="input")
        series |= found
    for name, (times, values) in series.items():
        rows = len(times)
        times, values = with_steps(times, values, options.hold)
        if options.hold is None and len(times) > rows:
            notes.append(f"commands of {name} change at once and are held until the next row (--hold no: they do not)")
        if values[0]:
            notes.append(
                f"the first command of {name} is {values[0]:g}, as if it had stood there for long: where the motor "
                "began then, a row with 0 before it says so"
            )
        if name not in bodies:
            raise InputError(f"{name!r} is no body that is seen; these are: {', '.join(bodies[:8])}", where="input")
        data["input"] = {**data.get("input", {}), name: {"t": times.tolist(), "value": values.tolist()}}
        if name not in driven:
            data["law"] = [*data.get("law", []), {"name": "drive", "bodies": [name]}]
            notes.append(
                f"{name} follows its commands as they stand, in m/s: a drive (--law 'drive:{name},gain=0.05' where one "
                "unit of them is 0.05 m/s)"
            )


def read_commands(text: str, options: Options, bodies: Sequence[str]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """(k,) times [s], rising, and commands of each body, from ``[BODY=]FILE[:COLUMN]``.

    A table as input.csv (t,name,value), or one with a clock and a column for each body, by its name; where a body is
    said, or there is one, any column. Rows without a command are left out. Raises InputError.
    """
    body, path, column = _parts(text)
    if not path.exists():
        raise InputError("no such file", file=path, where="input")
    table = Source(path, replace(options, columns=None, missing=options.missing)).table
    if table is None:
        raise InputError("is no table of commands: t,name,value, or a time and a column for each body", file=path)
    if set(table.header) == LONG and column is None:
        names = table.texts("name")
        rows = {name: np.array([k for k, n in enumerate(names) if n == name]) for name in dict.fromkeys(names)}
        columns = dict.fromkeys(rows, "value")
    else:
        columns = _columns(table, body, column, bodies)
        rows = dict.fromkeys(columns, np.arange(len(table)))
    times = _times(table, options)
    return {name: _series(table, where, times, rows[name]) for name, where in columns.items()}


def _parts(text: str) -> tuple[str | None, Path, str | None]:
    """Body, file and column; a file may have signs of equality and colons in its name."""
    body: str | None = None
    if not Path(text).is_file() and "=" in text:
        body, _, text = text.partition("=")
    if Path(text).is_file() or ":" not in text:
        return body, Path(text), None
    path, _, column = text.rpartition(":")
    return body, Path(path), column


def _columns(table: Table, body: str | None, column: str | None, bodies: Sequence[str]) -> dict[str, str]:
    """Body to its column. Raises InputError where it is not said."""
    asked = f"say which, as --input BODY={table.source.name}:COLUMN"
    others = [name for name in table.header if is_clock(name) is None]
    if column is not None:
        table.cells(column)  # raises where there is no such one
    elif body is None and (named := {name: name for name in others if name in bodies}):
        return named
    elif len(others) == 1:
        column = others[0]
    else:
        raise InputError(f"its columns are {', '.join(table.header[:20])}: {asked}", file=table.source)
    if body is None and len(bodies) != 1:
        raise InputError(f"whose commands are these? There are {', '.join(bodies[:8])}: {asked}", file=table.source)
    return {body or bodies[0]: column}


def _times(table: Table, options: Options) -> np.ndarray:
    """(k,) [s], NaN nowhere: seconds, or ``--time-unit``; a column that counts frames needs the frame rate."""
    kinds = {is_clock(name): name for name in reversed(table.header)}
    found = {kind: name for kind, name in kinds.items() if kind is not None}
    if "t" in found or options.fps is None:  # a frame rate is that of the film
        found = {"t": found["t"]} if "t" in found else found
        values, counts, unit = clock(table, found, replace(options, fps=None))
        if counts == "frame":
            raise InputError("its clock counts frames and needs the frame rate (--fps)", file=table.source)
        said = options.time_unit if options.time_unit is not None else (unit or "s")
        return values * factor(said, TIMES, "time unit")
    return clock(table, found, options)[0] / options.fps


def _series(table: Table, column: str, times: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    values = table.numbers(column)[rows]
    known = np.isfinite(values)
    rows, t, values = rows[known], times[rows][known], values[known]
    if not len(t):
        raise InputError(f"has no command in column {column}", file=table.source)
    order = np.argsort(t, kind="stable")
    same = np.flatnonzero(np.diff(t[order]) == 0)
    if len(same):
        row = table.lines[rows[order[same[0] + 1]]]
        raise InputError(f"has two commands at t = {t[order[same[0]]]:g} s", file=table.source, where=f"row {row}")
    return t[order], values[order]


def with_steps(times: np.ndarray, values: np.ndarray, hold: bool | None) -> tuple[np.ndarray, np.ndarray]:
    """(k,) times [s] and commands, linear between rows; those that are held get a row just before each change.

    hold : whether they stay until the next row; None: where each change stands alone between rows that repeat
    """
    if hold is None:
        hold = _changes_at_once(values)
    if not hold:
        return times, values
    k = np.flatnonzero(np.diff(values))
    before = times[k + 1] - AT_ONCE * (times[k + 1] - times[k])
    return np.insert(times, k + 1, before), np.insert(values, k + 1, values[k])


def _changes_at_once(values: np.ndarray) -> bool:
    """Whether each change stands alone between rows that repeat: a log of what a motor was told, not of a ramp."""
    changes = np.flatnonzero(np.diff(values))
    return bool(len(changes)) and len(values) > 3 * len(changes) and not (np.diff(changes) == 1).any()
