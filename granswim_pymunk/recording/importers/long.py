"""Plain tables with one row per body and frame: ``t,body,x,y[,angle]``, under many names."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options
from .source import Source
from .table import Table
from .units import ANGLES, LENGTHS, PIXELS, TIMES, split_unit

NAMES: dict[str, tuple[str, ...]] = {
    "t": ("t", "time", "times", "zeit", "temps", "tiempo", "tempo", "timestamp", "trial time", "time_s", "t_s"),
    "frame": ("frame", "frames", "frame_number", "frame number", "frame_index", "frameindex", "bild", "image"),
    "body": ("body", "particle", "track", "track_id", "trackid", "id", "object", "name", "label", "marker", "teilchen",
             "individual", "body_id", "disk", "grain", "ball", "particle_id"),
    "x": ("x", "pos_x", "position_x", "posx", "xpos", "x_pos", "cx", "center_x", "x_center", "x center", "position x",
          "centroid_x", "x-position", "x position"),
    "y": ("y", "pos_y", "position_y", "posy", "ypos", "y_pos", "cy", "center_y", "y_center", "y center", "position y",
          "centroid_y", "y-position", "y position"),
    "angle": ("angle", "theta", "phi", "orientation", "winkel"),
}  # fmt: skip
KEYS = ("t", "body", "x", "y", "angle")


def find_columns(table: Table, given: Mapping[str, str]) -> dict[str, str]:
    """Which column is what: those given, then exact names, then names in other words or with a unit behind them."""
    found = dict(given)
    taken = set(given.values())
    plain = {name: split_unit(name)[0].lower() for name in table.header}
    for key, names in NAMES.items():
        if key in found or (key == "frame" and "t" in found):
            continue
        for wanted in names:
            match = [n for n in table.header if n not in taken and wanted in (n, n.lower(), plain[n])]
            if match:
                found[key] = min(match, key=lambda n: n != wanted)
                taken.add(found[key])
                break
    return found


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
    column = found.get("t") or found.get("frame")
    if column is None:
        raise InputError("has no column t or frame; say which column it is (--columns t=NAME)", file=table.source)
    frames = column == found.get("frame") or split_unit(column)[0].lower() in NAMES["frame"]
    # a frame rate says that the column counts frames, whatever its name
    counts = "frame" if frames or options.fps is not None else "time"
    return table.numbers(column, required=True), counts, known(said_unit(table, column), TIMES)


def recognise(source: Source) -> bool:
    if not source.columns or source.table is None:
        return False
    if any("." in key for key in source.options.column_map()):
        return False  # BODY.x: a row per frame, a wide table
    found = find_columns(source.table, _given(source.options))
    return ("t" in found or "frame" in found) and any(key in found for key in ("x", "y", "angle"))


def _given(options: Options) -> dict[str, str]:
    names = options.column_map()
    for key in names:
        if key not in KEYS:
            raise InputError(f"unknown name {key!r}; known: {', '.join(KEYS)}", where="columns")
    return names


def read(source: Source, options: Options) -> Found:
    """t (or frame), body, x, y and perhaps angle; x or y may stand alone."""
    table = source.table
    if table is None:
        raise InputError("is not a table", file=source.path)
    given = _given(options)
    found = find_columns(table, given)
    for key in given.values():
        table.cells(key)
    t, counts, time = clock(table, found, options)
    if not any(key in found for key in ("x", "y", "angle")):
        raise InputError(f"has no column x, y or angle; it has: {', '.join(table.header)}", file=source.path)
    nothing = np.full(len(t), math.nan)
    x = table.numbers(found["x"]) if "x" in found else nothing
    y = table.numbers(found["y"]) if "y" in found else nothing
    if "x" in found and "y" not in found:
        y = np.where(np.isfinite(x), 0.0, math.nan)
    elif "y" in found and "x" not in found:
        x = np.where(np.isfinite(y), 0.0, math.nan)
    return Found(
        clock=t,
        counts=counts,
        body=table.texts(found["body"]) if "body" in found else None,
        x=x,
        y=y,
        angle=table.numbers(found["angle"]) if "angle" in found else None,
        length=known(said_unit(table, found.get("x"), found.get("y")), LENGTHS),
        time=time,
        turn=known(said_unit(table, found.get("angle")), ANGLES),
        rows=table.lines,
    )


IMPORTER = Importer("long", "plain table, one row per body and frame (t,body,x,y[,angle])", recognise, read)
