"""Plain tables with one row per frame: ``t,x1,y1,x2,y2``, ``t,x1,x2``, ``t,ball_x,ball_y`` or ``t,angle1,angle2``."""

from __future__ import annotations

import re

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options, only_one
from .headings import is_clock, is_rate
from .long import clock, frames_by_row, known, passed_over, said_unit
from .source import Source
from .table import Table
from .units import ANGLES, LENGTHS, is_unit, split_unit

_ANGLES = ("angle", "theta", "phi", "θ", "φ", "winkel", "ángulo", "ângulo", "angulo", "angolo")
_KINDS = "|".join(("x", "y", *_ANGLES))
_FIRST = re.compile(rf"({_KINDS})[ _.]?(.+)", re.IGNORECASE)
_LAST = re.compile(rf"(.+?)[ _.:/]({_KINDS})", re.IGNORECASE)
# beside a coordinate they are no bodies: rates and errors
_NO_BODY = re.compile(r"d?dots?\d*|err(?:or)?s?|std|sigma|sem|noise|uncertainty|fehler", re.IGNORECASE)


def place(column: str) -> tuple[str, str] | None:
    """Body and coordinate of a column called ``x1``, ``x_left``, ``left_x`` or ``theta1``, with a unit or not."""
    if is_rate(column):
        return None
    plain, _ = split_unit(column)
    if (match := _LAST.fullmatch(plain)) is not None:
        name, kind = match[1], match[2].lower()
    elif (match := _FIRST.fullmatch(plain)) is not None and not is_unit(match[2]):
        name, kind = match[2], match[1].lower()
    else:
        return None
    if _NO_BODY.fullmatch(name.strip()):
        return None
    return name.strip(), "angle" if kind in _ANGLES else kind


def find_places(table: Table, options: Options) -> tuple[dict[str, str], dict[str, dict[str, str]]]:
    """The columns of the clock ("t", "frame"), and those of each body."""
    names = table.mapped(options.column_map())
    if "t" in names:
        clocks = {"t": names.pop("t")}
    else:
        kinds = {c: is_clock(c) for c in table.header}
        clocks = {kind: c for c, kind in reversed(kinds.items()) if kind is not None}
    places: dict[str, dict[str, str]] = {}
    for key, column in names.items():
        name, dot, kind = key.rpartition(".")
        if not dot or kind not in ("x", "y", "angle"):
            raise InputError(f"unknown name {key!r}; known: t, BODY.x, BODY.y, BODY.angle", where="columns")
        places.setdefault(name, {})[kind] = column
    mapped = {*names.values(), *clocks.values()}
    for column in table.header:
        if column not in mapped and (at := place(column)) is not None:
            places.setdefault(at[0], {}).setdefault(at[1], column)
    if not places:
        # "left [deg],right [deg]": with no coordinate by its name a unit of angles tells the bodies
        turned = [c for c in table.header if c not in mapped and said_unit(table, c) in ANGLES]
        places = {split_unit(column)[0]: {"angle": column} for column in turned}
    return clocks, places


def _by_its_name(
    places: dict[str, dict[str, str]], options: Options, notes: list[str]
) -> dict[str, dict[str, str]]:
    """The columns of the only body by the name that the user gave it, where a heading has another: "Angle of arm"."""
    named = [text.partition(":")[0].strip() for text in options.bodies]
    if len(places) != 1 or len(named) != 1 or named[0] in ("*", *places) or options.column_map().keys() - {"t"}:
        return places
    ((heading, columns),) = places.items()
    notes.append(f"{', '.join(columns.values())}: {heading!r} is taken for {named[0]}, the only body")
    return {named[0]: columns}


def recognise(source: Source) -> bool:
    if not source.columns or source.table is None:
        return False
    try:
        clocks, places = find_places(source.table, source.options)
    except InputError:
        return False
    return (bool(clocks) or source.options.fps is not None) and bool(places)


def read(source: Source, options: Options) -> Found:
    """The text after (or before) x, y or angle is the body's id. Without a time column ``fps`` makes it of the row."""
    table = source.table
    if table is None:
        raise InputError("is not a table", file=source.path)
    clocks, places = find_places(table, options)
    notes: list[str] = []
    passed = passed_over(table, clocks, options, options.column_map())
    if options.fps is not None and (passed or not clocks):
        t, counts, unit = frames_by_row(None, len(table), notes, passed), "frame", None
    else:
        t, counts, unit = clock(table, clocks, options)
    if not places:
        raise InputError(f"has no columns like x1, y1; it has: {', '.join(table.header)}", file=source.path)
    places = _by_its_name(places, options, notes)
    size = len(t)
    nothing = np.full(size, np.nan)
    xs, ys, angles = [], [], []
    body: list[str] = []
    for name, kinds in places.items():
        x = table.numbers(kinds["x"]) if "x" in kinds else nothing
        y = table.numbers(kinds["y"]) if "y" in kinds else nothing
        if "x" in kinds and "y" not in kinds:
            y = np.where(np.isfinite(x), 0.0, np.nan)
        elif "y" in kinds and "x" not in kinds:
            x = np.where(np.isfinite(y), 0.0, np.nan)
        xs.append(x)
        ys.append(y)
        body += [name] * size
        angles.append(table.numbers(kinds["angle"]) if "angle" in kinds else nothing)
    turned = np.concatenate(angles)
    used = list(places.values())
    return Found(
        clock=np.tile(t, len(places)),
        counts=counts,
        body=body,
        x=np.concatenate(xs),
        y=np.concatenate(ys),
        angle=turned if np.isfinite(turned).any() else None,
        length=known(said_unit(table, *(k.get("x") or k.get("y") for k in used)), LENGTHS),
        time=unit,
        turn=known(said_unit(table, *(k.get("angle") for k in used)), ANGLES),
        rows=list(table.lines) * len(places),
        unmeasured=only_one({kind for kinds in used for kind in kinds}),
        notes=notes,
    )


IMPORTER = Importer(
    "wide",
    "plain table, one row per frame (t,x1,y1,x2,y2 or t,x1,x2 or t,left_x,left_y or t,angle1,angle2)",
    recognise,
    read,
)
