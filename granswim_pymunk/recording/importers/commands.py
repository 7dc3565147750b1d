"""Commands given to the apparatus: what a motor was told, from a log of its own or the table of the tracks."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...scene import Scene, use
from .base import Options
from .headings import is_clock
from .long import clock
from .source import Source
from .table import Table
from .units import TIMES, factor

LONG = {"t", "name", "value"}  # the form of input.csv
AT_ONCE = 1e-6  # of the time between two rows, in which a command that is held becomes the next one


Commands = Mapping[str, tuple[np.ndarray, np.ndarray]]  # by body: (k,) times [s], rising, and values


def with_commands(scene: Scene, commands: Commands, hold: bool | None) -> Scene:
    """The scene with commands, those that are held with a row just before each change, and drives that follow them.

    A drive is added where no law of the scene makes a body follow. Raises InputError naming the body.
    hold : whether a command stays until the next row; None: where each change stands alone between rows that repeat
    """
    if unknown := sorted(commands.keys() - set(scene.ids)):
        listed = ", ".join(scene.ids[:8])
        raise InputError(f"the scene has no such body; it has: {listed}", where=f"commands of {unknown[0]}")
    steps = {name: _steps(*rows) if _is_held(rows[1], hold) else rows for name, rows in commands.items()}
    inputs = {name: (tuple(t.tolist()), tuple(values.tolist())) for name, (t, values) in steps.items()}
    drives = [use("drive", bodies=[name]) for name in commands if name not in driven_in(scene)]
    return replace(scene, inputs={**scene.inputs, **inputs}).with_laws(*drives)


def driven_in(scene: Scene) -> list[str]:
    """The bodies that a law of the scene makes follow their commands."""
    return [name for item in scene.laws_as("command") for name in item.bodies or ()]


def commanded(
    scene: Scene, options: Options, bodies: Sequence[str], placed: Collection[str], notes: list[str]
) -> Scene:
    """The scene with the commands of ``options.inputs``, and what was taken for granted in ``notes``.

    bodies : those that are seen;  placed : those whose place is seen. Raises InputError naming file, column or row
    """
    driven, series = driven_in(scene), dict[str, tuple[np.ndarray, np.ndarray]]()
    for text in options.inputs:
        found = read_commands(text, options, driven or list(bodies))
        if twice := sorted(found.keys() & series.keys()):
            raise InputError(f"body {twice[0]} has commands twice", where="input")
        series |= found
    for name, (_, values) in series.items():
        if name not in bodies:
            raise InputError(f"{name!r} is no body that is seen; these are: {', '.join(bodies[:8])}", where="input")
        if name not in placed:
            raise InputError(
                f"only the angle of {name} is seen, and commands are of a velocity along a line: give the angle as a "
                "place, 1 rad as 1 m (--columns x=ANGLE --scene cart), and the rate of the commanded angle [rad/s] as "
                "commands",
                where="input",
            )
        if options.hold is None and _is_held(values, None):
            notes.append(f"commands of {name} change at once and are held until the next row (--hold no: they do not)")
        if values[0]:
            notes.append(
                f"the first command of {name} is {values[0]:g}, as if it had stood there for long: where the motor "
                "began then, a row with 0 before it says so"
            )
        if name not in driven:
            notes.append(
                f"{name} follows its commands as they stand, in m/s: a drive (--law 'drive:{name},gain=0.05' where one "
                "unit of them is 0.05 m/s)"
            )
    return with_commands(scene, series, options.hold)


def read_commands(text: str, options: Options, bodies: Sequence[str]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """(k,) times [s], rising, and commands of each body, from ``[BODY=]FILE[:COLUMN]``.

    A table as input.csv (t,name,value), or one with a clock and a column for each body, by its name; where a body is
    said, or there is one, any column. Rows without a command are left out. Raises InputError.
    """
    body, path, column = _parts(text)
    if not path.exists():
        raise InputError("no such file", file=path, where="input")
    table = Source(path, replace(options, columns=None)).table
    if table is None:
        raise InputError("is no table of commands: t,name,value, or a time and a column for each body", file=path)
    if set(table.header) == LONG and column is None:
        names = table.texts("name")
        rows = {name: np.array([k for k, n in enumerate(names) if n == name]) for name in dict.fromkeys(names)}
        columns = dict.fromkeys(rows, "value")
    else:
        columns = _columns(table, body, column, bodies)
        rows = dict.fromkeys(columns, np.arange(len(table)))
    times = _times(table, options, table.named(options.column_map().get("t", "")))
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


def _times(table: Table, options: Options, said: str) -> np.ndarray:
    """(k,) [s], NaN nowhere: seconds, or ``--time-unit``; a column that counts frames needs the frame rate.

    said : the column that is the clock of the recording, which is that of a table without another one, too
    """
    kinds = {is_clock(name): name for name in reversed(table.header)}
    found = {kind: name for kind, name in kinds.items() if kind is not None}
    if not found and said in table.columns:
        found = {"t": said}
    if "t" in found:  # a frame rate is that of the film
        found, options = {"t": found["t"]}, replace(options, fps=None)
    values, counts, unit = clock(table, found, options)
    if counts != "frame":
        per = options.time_unit if options.time_unit is not None else (unit or "s")
        return values * factor(per, TIMES, "time unit")
    if options.fps is None:
        raise InputError("its clock counts frames and needs the frame rate (--fps)", file=table.source)
    return values / options.fps


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


def _is_held(values: np.ndarray, hold: bool | None) -> bool:
    """Whether commands stay until the next row; where that is not said, as a log of what a motor was told does.

    There each change stands alone between rows that repeat; on a ramp it does not.
    """
    if hold is not None:
        return hold
    changes = np.flatnonzero(np.diff(values))
    return bool(len(changes)) and len(values) > 3 * len(changes) and not (np.diff(changes) == 1).any()


def _steps(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Commands that are held, with a row just before each change: between rows a scene takes them for linear."""
    k = np.flatnonzero(np.diff(values))
    before = times[k + 1] - AT_ONCE * (times[k + 1] - times[k])
    return np.insert(times, k + 1, before), np.insert(values, k + 1, values[k])
