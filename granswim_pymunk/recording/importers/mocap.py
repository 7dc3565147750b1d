"""Markers of motion capture: CSV of OptiTrack Motive and of Vicon Nexus, TSV of Qualisys Track Manager.

Each has some rows about the take, the names of the markers above three coordinates each, and a row for each frame.
"""

from __future__ import annotations

import math

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options, grid, single
from .source import Source
from .table import numeric, some_of, split
from .templates import TEMPLATES
from .units import LENGTHS

KEYS_OF_QUALISYS = 40  # rows at the top among which its keys stand: a dozen, and events
WHAT_WORKS = "BODY=MARKER takes that marker for BODY and leaves out those that are not said, y=z takes x and z"
TOLD = 12  # markers that are listed at most


def recognise(source: Source) -> bool:
    first = source.start[0].strip() if source.start else ""
    if first.startswith("Format Version,") or _is_qualisys(source):
        return True
    return first == "Trajectories" and any(line.startswith("Frame,Sub Frame") for line in source.start[:6])


def read(source: Source, options: Options) -> Found:
    """Two of the three coordinates, x and y where ``columns`` does not say ``y=z``; a body for each marker.

    Of the markers those are taken that ``columns`` says, ``BODY=MARKER`` each, or else those that ``bodies`` names.
    """
    if _is_qualisys(source):
        return _qualisys(split(source.text or "", "\t", source.path), source, options)
    rows = split(source.text or "", ",", source.path)
    vicon = source.start[0].strip() == "Trajectories"
    return _vicon(rows, source, options) if vicon else _optitrack(rows, source, options)


def _is_qualisys(source: Source) -> bool:
    """Newer versions write FILE_VERSION above NO_OF_FRAMES."""
    return any(line.startswith("NO_OF_FRAMES\t") for line in source.start[:KEYS_OF_QUALISYS])


Rows = list[tuple[int, list[str]]]


def _found(
    names: list[str], at: list[int], clock: int | None, rows: Rows, source: Source, options: Options, *,
    rate: float | None, length: str, zero: bool = False,
) -> Found:  # fmt: skip
    """``at``: the first of a marker's three columns;  ``zero``: the origin means not seen."""
    if not names or not rows:
        raise InputError("is empty: it has no markers, or no rows", file=source.path)
    plane, notes = _plane(options, source), list[str]()
    names, at = _chosen(names, at, source, options, notes)
    xyz = np.full((len(rows), len(names), 3), math.nan)
    t = np.arange(len(rows), dtype=float)
    for k, (line, row) in enumerate(rows):
        for b, start in enumerate(at):
            for axis, cell in enumerate(row[start : start + 3]):
                if numeric(cell):
                    xyz[k, b, axis] = float(cell)
                elif cell.strip().lower() not in ("", "nan", "null", "-"):
                    raise InputError(f"should be a number, got {cell[:60]!r}", file=source.path, where=f"row {line}")
        if clock is not None:
            if clock >= len(row) or not numeric(row[clock]):
                raise InputError("has no time, or no frame", file=source.path, where=f"row {line}")
            t[k] = float(row[clock])
    if zero:
        xyz[(xyz == 0).all(axis=-1)] = math.nan
    x, y = single(xyz[..., plane[0]], xyz[..., plane[1]])
    counted, body, xs, ys = grid(t, names, np.stack([x, y], axis=-1))
    timed = clock is not None and rate is None
    seen = "xyz"[plane[0]], "xyz"[plane[1]]
    return Found(
        clock=counted, counts="time" if timed else "frame", body=body, x=xs, y=ys, length=length,
        time="s" if timed else None, rate=rate, rows=[line for line, _ in rows for _ in names],
        notes=[f"of its three coordinates {seen[0]} and {seen[1]} are taken (--columns y=z takes x and z)", *notes],
    )  # fmt: skip


def _plane(options: Options, source: Source) -> list[int]:
    """Which of a marker's three coordinates are x and y. Raises InputError."""
    said = {key: options.column_map().get(key, key).lower() for key in ("x", "y")}
    for key, axis in said.items():
        if axis not in ("x", "y", "z"):
            raise InputError(
                f"{key} is one of a marker's coordinates x, y, z, got {axis!r} ({WHAT_WORKS})",
                file=source.path, where="columns",
            )  # fmt: skip
    return ["xyz".index(axis) for axis in said.values()]


def _chosen(
    names: list[str], at: list[int], source: Source, options: Options, notes: list[str]
) -> tuple[list[str], list[int]]:
    """Bodies and their columns: the markers that the user chose, all where none was chosen. Raises InputError."""
    said = {key: column for key, column in options.column_map().items() if key not in ("x", "y")}
    wanted: dict[str, int] = {}
    for body, marker in said.items():
        if marker.replace(" ", "_") not in names or body == "t" or "." in body:
            raise InputError(
                f"{body}={marker} says no marker: {WHAT_WORKS}; the markers are {some_of(names, TOLD)}",
                file=source.path, where="columns",
            )  # fmt: skip
        wanted[body] = names.index(marker.replace(" ", "_"))
    if not said:
        named = {text.partition(":")[0].strip() for text in options.bodies}
        wanted = {name: k for k, name in enumerate(names) if "*" in named or _is_scene(options) or name in named}
    if not wanted:
        return names, at
    left_out = [name for k, name in enumerate(names) if k not in wanted.values()]
    if left_out:
        way = "--columns" if said else "--body"
        notes.append(f"markers that {way} does not name are left out: {some_of(left_out, TOLD)}")
    return list(wanted), [at[k] for k in wanted.values()]


def _is_scene(options: Options) -> bool:
    """Whether a file says which bodies there are."""
    return options.scene is not None and str(options.scene) not in TEMPLATES


def _optitrack(rows: Rows, source: Source, options: Options) -> Found:
    """Motive: ``Length Units`` in the first row; names, kinds (Position, Rotation) and X, Y, Z above the numbers."""
    first = dict(zip(rows[0][1][::2], rows[0][1][1::2], strict=False))
    start = next((k for k, (_, row) in enumerate(rows) if row[0] == "Frame"), None)
    if start is None or start < 2:
        raise InputError("has no row Frame,Time (Seconds),X,Y,Z", file=source.path)
    header, kinds = rows[start][1], rows[start - 1][1]
    above = [row for _, row in rows[1:start]]
    named = next((row for row in above if row[1:2] == ["Name"]), above[min(1, len(above) - 1)])
    at = [
        k for k, axis in enumerate(header)
        if axis == "X" and k < min(len(kinds), len(named)) and kinds[k] == "Position"
    ]  # fmt: skip
    length = first.get("Length Units", "Meters").lower()
    return _found(
        _unlike([named[k] for k in at]), at, 1, rows[start + 1 :], source, options, rate=None,
        length=length if length in LENGTHS else "m",
    )  # fmt: skip


def _vicon(rows: Rows, source: Source, options: Options) -> Found:
    """Nexus: ``Trajectories``, the rate, the markers' names, Frame, Sub Frame, X, Y, Z and a row of units."""
    start = next(k for k, (_, row) in enumerate(rows) if row[:2] == ["Frame", "Sub Frame"])
    header, names, units = rows[start][1], rows[start - 1][1], rows[start + 1][1]
    rate = next((float(row[0]) for _, row in rows[1:start] if numeric(row[0])), None)
    at = [k for k, axis in enumerate(header) if axis.strip() == "X" and k < len(names) and names[k].strip()]
    body: Rows = []
    for line, row in rows[start + 2 :]:
        if not numeric(row[0]):
            break  # the next section of the file
        body.append((line, row))
    length = units[at[0]].strip() if at and at[0] < len(units) else "mm"
    found = _found(
        _unlike([names[k].split(":")[-1].strip() for k in at]), at, 0, body, source, options, rate=rate,
        length=length if length in LENGTHS else "mm",
    )  # fmt: skip
    return found


def _qualisys(rows: Rows, source: Source, options: Options) -> Found:
    """Track Manager: keys with a value each, MARKER_NAMES among them, perhaps a header, then numbers in mm.

    A row may begin with its frame and time. Where it does not, the place of its line in the file is its frame: lines
    in which no marker is seen are empty.
    """
    keys = {row[0]: row[1:] for _, row in rows[:KEYS_OF_QUALISYS] if row[0].isupper()}
    names = [name.strip() for name in keys.get("MARKER_NAMES", []) if name.strip()]
    rate = keys.get("FREQUENCY", [""])[0]
    if not numeric(rate) or not float(rate) > 0:
        raise InputError("says no FREQUENCY", file=source.path)
    begin = next((k for k, (_, row) in enumerate(rows) if all(numeric(c) for c in row if c.strip())), len(rows))
    body = rows[begin:]
    # a marker that is not seen leaves its cells empty, the last one shortens the row
    width = max((k + 1 for _, row in body for k, cell in enumerate(row) if cell.strip()), default=0)
    lead = width - 3 * len(names)
    if body and lead not in (0, 1, 2):
        raise InputError(f"expected {3 * len(names)} coordinates in each row, got {width}", file=source.path)
    at = [max(lead, 0) + 3 * b for b in range(len(names))]
    found = _found(
        _unlike(names), at, 0 if lead > 0 else None, body, source, options, rate=float(rate), length="mm", zero=True
    )
    if lead == 0:
        found.clock = np.repeat([float(line - body[0][0]) for line, _ in body], len(found.x) // len(body))
    return found


def _unlike(names: list[str]) -> list[str]:
    """Names, numbered where one stands for several markers."""
    names = [name.strip().replace(" ", "_") for name in names]
    return names if len(set(names)) == len(names) else [f"{name}.{k + 1}" for k, name in enumerate(names)]


IMPORTER = Importer("mocap", "motion capture: CSV of OptiTrack and Vicon, TSV of Qualisys", recognise, read)
