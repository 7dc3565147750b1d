"""Plain tables with one row per body and frame: ``t,body,x,y[,angle]``, under many names."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options, only_one
from .headings import (
    NO_BODY,
    called_a_place,
    find_columns,
    is_clock,
    is_from_top,
    is_lone,
    is_rate,
    is_third,
    is_way,
    words,
)
from .source import Source
from .table import Table
from .units import ANGLES, LENGTHS, PIXELS, TIMES, split_unit

KEYS = ("t", "body", "x", "y", "angle")


def said_unit(table: Table, *columns: str | None) -> str | None:
    """The unit that a row of units or a header says about these columns."""
    for column in columns:
        if column is not None:
            unit = table.units.get(column) or split_unit(column)[1]
            if unit:
                return unit
    return None


def known(unit: str | None, units: Mapping[str, float]) -> str | None:
    if unit is None:
        return None
    if unit.lower() in PIXELS:
        return "px" if units is LENGTHS else None
    return unit if unit in units or unit.lower() in units else None


def clock(table: Table, found: Mapping[str, str], options: Options) -> tuple[np.ndarray, str, str | None]:
    """Times of the rows, what they count and their unit. Raises InputError where there are none."""
    frame, column, step = found.get("frame"), found.get("t"), found.get("step")
    if column is None and step is not None and options.fps is None:
        steps = table.numbers(step)
        steps[0] = 0.0  # there was no row before
        if not np.isfinite(steps).all():
            row = table.lines[int(np.argmin(np.isfinite(steps)))]
            raise InputError(f"{step} is missing", file=table.source, where=f"row {row}")
        return np.cumsum(steps), "time", known(said_unit(table, step), TIMES)
    if column is None or (options.fps is not None and frame is not None):
        column = frame
    if column is None:
        raise InputError("has no column t or frame; say which column it is (--columns t=NAME)", file=table.source)
    times = table.times(column)
    frames = column == frame or is_clock(column) == "frame"
    values = table.numbers(column, required=True) if times is None else times
    if options.fps is not None and not frames and _holds_times(times, values):
        # a frame rate says that the column counts frames, whatever its name
        part = table.cells(column)[0 if times is not None else int(np.argmax(values % 1 != 0))]
        raise InputError(
            f"with --fps {column} counts frames, but it holds {part}: leave --fps out where it holds times "
            "(--time-unit says their unit), say which column counts (--columns t=NAME), or name the columns of places "
            "alone (--columns x=X,y=Y) where each row is the next frame",
            file=table.source,
        )
    if times is not None:
        return times, "time", "s"
    counts = "frame" if frames or options.fps is not None else "time"
    return values, counts, known(said_unit(table, column), TIMES)


def _holds_times(times: np.ndarray | None, values: np.ndarray) -> bool:
    """Whether a column, as clock times or as numbers, holds times: frames are whole numbers."""
    return times is not None or bool((values % 1 != 0).any())


def passed_over(table: Table, found: Mapping[str, str], options: Options, named: Iterable[str]) -> str:
    """The column of times that is not to be used where a frame rate is given and columns are named, but no clock."""
    column, named = found.get("t"), set(named)
    if options.fps is None or column is None or not named or "t" in named or "frame" in found:
        return ""
    times = table.times(column)
    values = table.numbers(column, required=True) if times is None else times
    return column if _holds_times(times, values) else ""


def recognise(source: Source) -> bool:
    if not source.columns or source.table is None:
        return False
    if any("." in key for key in source.options.column_map()):
        return False  # BODY.x: a row per frame, a wide table
    header = source.table.header
    given = _given(source.options, source.table)
    found = find_columns(header, given)
    x = found.get("x")
    several = sum("x" in words(name) and not is_rate(name) for name in header) > 1
    if x is not None and "x" not in given and words(x) != ["x"] and several:
        return False  # center_x and nose_x: a wide table
    if not {"x", "y", *given} & found.keys() - {"t"} and any(_is_place_of_a_body(name) for name in header):
        return False  # a_x, a_y and an angle: it is not the angle alone
    if not {"t", "frame", "step"} & found.keys():
        # each row of a body is its next frame, where columns are called x and y and nothing else, or an angle, or said
        # to be
        said = any(key in given or words(found.get(key, "")) == [key] for key in ("x", "y")) or "angle" in found
        return source.options.fps is not None and said
    return any(key in found for key in ("x", "y", "angle"))


def _is_place_of_a_body(column: str) -> bool:
    """Whether a column is x or y of something that its heading names."""
    said = words(column)
    other = [word for word in said if word not in ("x", "y")]
    return 0 < len(other) < len(said) and not is_rate(column) and not any(map(NO_BODY.fullmatch, other))


def _given(options: Options, table: Table) -> dict[str, str]:
    """Which columns the user says; where nobody says anything, t, x, y of a table without a header."""
    names = table.mapped(options.column_map())
    if not names and options.fps is None:
        return table.unnamed()
    for key in names:
        if key not in KEYS:
            raise InputError(f"unknown name {key!r}; known: {', '.join(KEYS)}", where="columns")
    return names


def frames_by_row(body: Sequence[str] | None, size: int, notes: list[str], passed: str = "") -> np.ndarray:
    """(size,) numbers of the frames of rows without a clock: how many of the same body stand before; a note says so.

    passed : the column of times that is there and is not used
    """
    if passed:
        notes.append(
            f"with the frame rate the times in column {passed} are not used: each row is taken for the next frame, as "
            "if none were left out"
        )
    else:
        notes.append("no column is a clock by its name: each row is taken for the next frame (--columns t=NAME)")
    before: dict[str, int] = {}
    numbers = []
    for name in body or [""] * size:
        numbers.append(float(before.get(name, 0)))
        before[name] = before.get(name, 0) + 1
    return np.array(numbers)


def read(source: Source, options: Options) -> Found:
    """t (or frame), body, x, y and perhaps angle; x or y may stand alone."""
    table = source.table
    if table is None:
        raise InputError("is not a table", file=source.path)
    given = _given(options, table)
    for key in given.values():
        table.cells(key)
    found = find_columns(table.header, given)
    body = table.texts(found["body"]) if "body" in found else None
    notes: list[str] = []
    passed = passed_over(table, found, options, given)
    if not passed and ({"t", "frame"} & found.keys() or options.fps is None):
        t, counts, time = clock(table, found, options)
        if not {"t", "frame"} & found.keys():  # else it had no clock at all
            notes.append(f"{found['step']} has times from row to row: their sum is the clock")
    else:
        t, counts, time = frames_by_row(body, len(table), notes, passed), "frame", None
    if not any(key in found for key in ("x", "y", "angle")):
        raise InputError(f"has no column x, y or angle; it has: {', '.join(table.header)}", file=source.path)
    unnamed = bool(given) and not options.column_map()
    if unnamed:
        notes.append(_taken(table, given, t, options))
    nothing = np.full(len(t), math.nan)
    x = table.numbers(found["x"]) if "x" in found else nothing
    y = table.numbers(found["y"]) if "y" in found else nothing
    if "x" in found and "y" not in found:
        y = np.where(np.isfinite(x), 0.0, math.nan)
    elif "y" in found and "x" not in found:
        x = np.where(np.isfinite(y), 0.0, math.nan)
    third = [name for name in table.header if is_third(name) and name not in given.values()]
    seen = table.numbers(third[0]) if third and {"x", "y"} <= found.keys() else nothing
    least, most = np.nanmin(seen, initial=math.inf), np.nanmax(seen, initial=-math.inf)
    if most > least:
        notes.append(
            f"of three coordinates {found['x']} and {found['y']} are taken; {third[0]}, which goes from {least:.3g} to "
            f'{most:.3g}, is left out (--columns "y={third[0]}" takes it for the vertical)'
        )
    if body is not None and "body" not in given and len(t) > 1 and len(set(body)) == len(t) == len(np.unique(t)):
        # as ImageJ labels its results: film:1, film:2 ...
        notes.append(f"{found['body']} differs in every row and is not taken for a body (--columns body=... does so)")
        body = None
    unit = said_unit(table, found.get("x"), found.get("y"))
    if unit is not None and options.unit is None and known(unit, LENGTHS) is None and unit not in ANGLES:
        notes.append(
            f"{found.get('x') or found['y']} is in {unit}, which is no length that is known: its numbers are taken for "
            "metres (--unit says how long one is)"
        )
    notes += filter(None, (called_a_place(given[key]) for key in ("x", "y") if key in given))
    if unit in ANGLES:
        notes.append(
            f"{found.get('x') or found['y']} is in a unit of angles and is taken for a place: an angle is said as "
            "--columns angle=NAME"
        )
    return Found(
        clock=t,
        counts=counts,
        body=body,
        x=x,
        y=y,
        angle=table.numbers(found["angle"]) if "angle" in found else None,
        length=known(unit, LENGTHS),
        time=time,
        turn=known(said_unit(table, found.get("angle")), ANGLES),
        y_down=is_from_top(table.header),
        rows=table.lines,
        unmeasured=only_one(found),
        lone=f"column {found['x']}" if unnamed and only_one(found) else _lone(table, found, given),
        notes=notes,
    )


def _taken(table: Table, given: Mapping[str, str], t: np.ndarray, options: Options) -> str:
    """What is said of the columns of a table without a header. Raises InputError where its clock may count frames."""
    names = " and ".join((", ".join([*given][:-1]), [*given][-1]))
    said = ",".join(f"{key}={column}" for key, column in given.items())
    if options.time_unit is None and (np.diff(t) == 1).all():
        raise InputError(
            f"has no header, and its first column goes up by one: does it count frames (--columns {said} --fps HZ) or "
            "seconds (--time-unit s)?",
            file=table.source,
        )
    other = "t=1,x=3,y=2" if "y" in given else "t=1,y=2"
    return (
        f"it has no header, and its first column rises in even steps: its columns are taken for {names} (where "
        f"they are others, say so: --columns {other})"
    )


def _lone(table: Table, found: Mapping[str, str], given: Mapping[str, str]) -> str | None:
    """The heading of the only coordinate, where it names no axis and the user did not."""
    column = found.get("x", "")
    if only_one(found) != "y" or "x" in given:
        return None
    return column if is_lone(column) or is_way(column, table.header) else None


IMPORTER = Importer("long", "plain table, one row per body and frame (t,body,x,y[,angle])", recognise, read)
