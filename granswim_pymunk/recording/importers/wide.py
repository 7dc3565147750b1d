"""Plain tables with one row per frame: ``t,x1,y1,x2,y2``, ``t,x1,x2``, ``t,ball_x,ball_y`` or ``t,angle1,angle2``."""

from __future__ import annotations

import re
import unicodedata

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options, only_one
from .headings import BESIDE, NAMES, NO_BODY, folded, is_clock, is_rate, words
from .long import clock, frames_by_row, known, passed_over, said_unit
from .source import Source
from .table import Table, some_of
from .units import ANGLES, LENGTHS, is_unit, split_unit

# a short word of an angle is one only where it ends there: "ang_a", but not "anger" or "angel"
_SHORT = "ang"
_ANGLES = "|".join(re.escape(word).replace(r"\ ", "[ _]") for word in NAMES["angle"] if word != _SHORT)
_KINDS = rf"x|y|{_ANGLES}|{_SHORT}"
_FIRST = re.compile(rf"(x|y|{_ANGLES}|{_SHORT}(?=[ _.\d]))[ _.]?(.+)")
_LAST = re.compile(rf"(.+?)[ _.:/]({_KINDS})")
# a word of a heading that looks like an angle or a coordinate, whatever stands beside it
_LIKE = re.compile(rf"(?:{_KINDS}|z)\d*|(?:{_ANGLES})\w*")
_CENTRE = BESIDE | {"c"}  # words for the centre of a body
TOLD = 8  # columns that are listed in a note at most


def place(column: str) -> tuple[str, str] | None:
    """Body and coordinate of a column called ``x1``, ``x_left``, ``left_x`` or ``theta1``, with a unit or not."""
    if is_rate(column):
        return None
    plain = unicodedata.normalize("NFC", split_unit(column)[0])
    letters = folded(plain)
    if len(letters) != len(plain):  # a sign that is several letters: places in the one are none in the other
        plain = letters
    if (match := _LAST.fullmatch(letters)) is not None:
        name, kind = plain[slice(*match.span(1))], match[2]
    elif (match := _FIRST.fullmatch(letters)) is not None and not is_unit(plain[slice(*match.span(2))]):
        name, kind = plain[slice(*match.span(2))], match[1]
    else:
        return None
    if NO_BODY.fullmatch(name.strip()):
        return None
    return name.strip(), kind if kind in ("x", "y") else "angle"


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


def _joined(places: dict[str, dict[str, str]], options: Options, notes: list[str]) -> dict[str, dict[str, str]]:
    """The angle and the place of one body whose headings differ by a word for its centre: "c_a_x", "ang_a"."""
    alone = {tuple(words(name)): name for name, columns in places.items() if columns.keys() == {"angle"}}
    named = [text.partition(":")[0].strip() for text in options.bodies]
    for name, columns in list(places.items()):
        plain = tuple(word for word in words(name) if word not in _CENTRE)
        turned = alone.pop(plain, None) if "angle" not in columns else None
        if turned is None or {turned, name} <= {*named}:
            continue
        both = turned if turned in named else name
        columns = {**columns, **places[turned]}
        places = {both if key == name else key: columns if key == name else value
                  for key, value in places.items() if key != turned}  # fmt: skip
        notes.append(f"{', '.join(columns.values())} are taken for one body, {both}")
    return places


def _left_over(table: Table, clocks: dict[str, str], places: dict[str, dict[str, str]]) -> list[str]:
    """A line on columns that are not read and look like an angle or a coordinate of a body."""
    read = {*clocks.values(), *(column for columns in places.values() for column in columns.values())}
    like = [column for column in table.header if column not in read and _looks_like_a_place(table, column)]
    if not like:
        return []
    return [
        f"not read, though by the heading an angle or a coordinate: {some_of(like, TOLD)} (--columns BODY.angle=NAME, "
        "BODY.x=NAME or BODY.y=NAME says which)"
    ]


def _looks_like_a_place(table: Table, column: str) -> bool:
    said = words(column)
    if is_rate(column) or is_clock(column) is not None or any(NO_BODY.fullmatch(word) for word in said):
        return False
    return said_unit(table, column) in ANGLES or any(_LIKE.fullmatch(word) for word in said)


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
    places = _joined(places, options, notes)
    notes += _left_over(table, clocks, places)
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
