"""Plain tables: long (one row per body and frame) and wide (one row per frame)."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..scene import Scene, read_toml, scene_from_dict
from .folder import RECORDING_KEYS
from .recording import Recording, rail_axes

LENGTHS = {"m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
ANGLES = {"rad": 1.0, "deg": math.pi / 180, "rev": 2 * math.pi}
MISSING = ("", "nan")


def factor(text: str | float, units: Mapping[str, float], what: str) -> float:
    """SI per unit: the name of a unit, or a number (metres per pixel, seconds per tick)."""
    if isinstance(text, str) and text in units:
        return units[text]
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise InputError(
            f"should be one of {', '.join(units)} or a number above zero, got {text!r}", where=what
        )
    return value


def read_table(source: Path, delimiter: str = ",") -> tuple[list[str], list[list[str]], list[int]]:
    """Header, rows and their line numbers of a delimited text. Raises InputError naming the row."""
    if len(delimiter) != 1:
        raise InputError(f"should be a single character, got {delimiter!r}", where="delimiter")
    try:
        with source.open(newline="", encoding="utf-8-sig") as handle:
            table = list(csv.reader(handle, delimiter=delimiter))
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=source) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"is not a table in UTF-8: {error}", file=source) from None
    numbered = [(line, row) for line, row in enumerate(table, start=1) if any(cell.strip() for cell in row)]
    if not numbered:
        raise InputError("is empty", file=source)
    header = [cell.strip() for cell in numbered[0][1]]
    for line, row in numbered[1:]:
        if len(row) != len(header):
            raise InputError(
                f"expected {len(header)} columns, got {len(row)}", file=source, where=f"row {line}"
            )
    if len(numbered) == 1:
        raise InputError("is empty: it has no rows", file=source)
    if len(set(header)) != len(header):
        raise InputError("a column stands in the header twice", file=source)
    return header, [row for _, row in numbered[1:]], [line for line, _ in numbered[1:]]


class _Table:
    """Columns of a table by name, as numbers, with a sentinel for what is missing."""

    def __init__(self, source: Path, delimiter: str, missing: Sequence[str]) -> None:
        self.source = source
        self.header, rows, self.lines = read_table(source, delimiter)
        self.columns = dict(zip(self.header, zip(*rows, strict=True), strict=True))
        self.sentinels = {text.strip().lower() for text in (*MISSING, *missing)}
        self.sentinel_numbers = set()
        for text in missing:
            try:
                self.sentinel_numbers.add(float(text))
            except ValueError:
                continue

    def texts(self, name: str) -> tuple[str, ...]:
        if name not in self.columns:
            raise InputError(f"has no column {name!r}; it has: {', '.join(self.header)}", file=self.source)
        return self.columns[name]

    def numbers(self, name: str, *, required: bool = False) -> np.ndarray:
        """(k,) values, NaN where missing; with ``required`` nothing may be missing."""
        values = np.full(len(self.lines), np.nan)
        for k, cell in enumerate(self.texts(name)):
            if cell.strip().lower() in self.sentinels:
                if required:
                    raise InputError(f"{name} is missing", file=self.source, where=f"row {self.lines[k]}")
                continue
            try:
                value = float(cell)
            except ValueError:
                value = math.inf
            if not math.isfinite(value):
                raise InputError(
                    f"{name} should be a number, got {cell[:60]!r}",
                    file=self.source,
                    where=f"row {self.lines[k]}",
                )
            if value not in self.sentinel_numbers:
                values[k] = value
            elif required:
                raise InputError(f"{name} is missing", file=self.source, where=f"row {self.lines[k]}")
        return values

    def times(self, name: str | None, time_unit: str | float, fps: float | None) -> np.ndarray:
        """(k,) [s]: a time column, a frame number over the frame rate, or the row's number over it."""
        if fps is not None and not (math.isfinite(fps) and fps > 0):
            raise InputError(f"should be above zero [Hz], got {fps!r}", where="fps")
        if name is not None and name in self.columns:
            values = self.numbers(name, required=True)
            return values / fps if fps is not None else values * factor(time_unit, TIMES, "time unit")
        if name is not None:
            self.texts(name)
        raise InputError(
            "has no column t or frame; say which column it is (--columns t=NAME)", file=self.source
        )


def parse_body(text: str) -> dict[str, Any]:
    """``id:radius:mass[:role]`` in SI as a [[body]] table; the role is ``free`` where not given."""
    parts = text.split(":")
    if len(parts) not in (3, 4):
        raise InputError(f"should be id:radius:mass[:role], got {text!r}", where="body")
    try:
        radius, mass = float(parts[1]), float(parts[2])
    except ValueError:
        raise InputError(f"radius [m] and mass [kg] should be numbers, got {text!r}", where="body") from None
    return {"id": parts[0], "role": parts[3] if len(parts) == 4 else "free", "radius": radius, "mass": mass}


def build_scene(
    bodies: Sequence[str], scene: str | Path | None, found: Sequence[str]
) -> tuple[Scene, dict[str, Any]]:
    """The scene of an imported table, from a template and single bodies, and the template's own numbers."""
    data: dict[str, Any] = read_toml(scene) if scene is not None else {}
    data.pop("format", None)
    if bodies:
        listed = data.get("body", [])
        data["body"] = (listed if isinstance(listed, list) else []) + [parse_body(text) for text in bodies]
    if not any(key in data for key in ("body", "bodies", "swimmer")):
        raise InputError(
            f"which bodies are these? The table has {', '.join(found[:8])}: give "
            "--body id:radius:mass[:role] for each, or --scene TEMPLATE.toml"
        )
    built = scene_from_dict(data, file=scene, strict=False, extra=RECORDING_KEYS)
    return built, {key: data[key] for key in ("title", *RECORDING_KEYS) if key in data}


def assemble(
    source: Path,
    scene: Scene,
    t: np.ndarray,
    body: Sequence[str],
    x: np.ndarray,
    y: np.ndarray,
    angle: np.ndarray | None,
    lines: Sequence[int],
    numbers: Mapping[str, Any],
) -> Recording:
    """A recording from long columns in SI. Raises InputError naming the row."""
    order = {name: row for row, name in enumerate(scene.ids)}
    rails = rail_axes(scene)
    placed = np.isfinite(x) & np.isfinite(y)
    placed |= np.array([name in rails and bool(np.isfinite((x, y)[rails[name]][k])) for k, name in enumerate(body)])
    seen = placed.copy()
    if angle is not None:
        seen |= np.isfinite(angle)
    kept: list[int] = np.flatnonzero(seen).tolist()
    if not kept:
        raise InputError("is empty: no body is seen in any frame", file=source)
    for k in kept:
        if body[k] not in order:
            raise InputError(
                f"body {body[k]!r} is not in the scene; it has: {', '.join(scene.ids[:8])}",
                file=source,
                where=f"row {lines[k]}",
            )
    used = sorted({body[k] for k in kept}, key=order.__getitem__)
    column = {name: c for c, name in enumerate(used)}
    times, frame = np.unique(t[kept], return_inverse=True)
    xy = np.full((len(times), len(used), 2), np.nan)
    angles = None if angle is None else np.full((len(times), len(used)), np.nan)
    taken: dict[tuple[int, int], int] = {}
    for f, k in zip(frame.tolist(), kept, strict=True):
        c = column[body[k]]
        if (f, c) in taken:
            raise InputError(
                f"two rows for body {body[k]} at t = {t[k]:g} s (the other is row {taken[f, c]})",
                file=source,
                where=f"row {lines[k]}",
            )
        taken[f, c] = lines[k]
        if placed[k]:
            xy[f, c] = x[k], y[k]
        if angles is not None and angle is not None:
            angles[f, c] = angle[k]
    steps = np.diff(times)
    known: dict[str, Any] = {key: numbers.get(key) for key in RECORDING_KEYS}
    if known["sampling"] is None and len(steps):
        known["sampling"] = float(f"{1 / np.median(steps):.6g}")
    return Recording(
        name=source.stem,
        title=str(numbers.get("title") or source.stem),
        scene=scene,
        t=times,
        ids=tuple(used),
        xy=xy,
        angle=angles,
        **known,
    )


def _map(columns: str | Mapping[str, str] | None) -> dict[str, str]:
    """``t=time,x=cx`` as a dictionary."""
    if columns is None or isinstance(columns, Mapping):
        return dict(columns or {})
    pairs = [part.partition("=") for part in columns.split(",")]
    if not all(sign and key.strip() and value.strip() for key, sign, value in pairs):
        raise InputError(f"should be NAME=COLUMN,NAME=COLUMN ..., got {columns!r}", where="columns")
    return {key.strip(): value.strip() for key, _, value in pairs}


def _given(template: Mapping[str, Any], **options: Any) -> dict[str, Any]:
    return {**template, **{key: value for key, value in options.items() if value is not None}}


def import_long(
    source: str | Path,
    *,
    bodies: Sequence[str] = (),
    scene: str | Path | None = None,
    columns: str | Mapping[str, str] | None = None,
    unit: str | float = "m",
    time_unit: str | float = "s",
    fps: float | None = None,
    angle_unit: str | float = "rad",
    flip_y: float | None = None,
    missing: Sequence[str] = (),
    delimiter: str = ",",
    title: str | None = None,
    sampling: float | None = None,
    position_noise: float | None = None,
    angle_noise: float | None = None,
) -> Recording:
    """A table with one row per body and frame: t (or frame), body, x, y and perhaps angle.

    bodies : ``id:radius:mass[:role]`` each, in SI;  scene : a TOML with bodies, laws, gravity ...
    columns : where t, body, x, y, angle stand, ``{"t": "time", "x": "cx"}``; x or y may stand alone
    unit, time_unit, angle_unit : of the table, a name or SI per unit;  fps : t counts frames [Hz]
    flip_y : height of the picture in the table's unit, y = height - y (angles change sign too)
    missing : texts or numbers that mean "not seen", besides nothing and NaN
    sampling [Hz], position_noise [m], angle_noise [rad] : as in recording.toml
    Raises InputError naming file and row.
    """
    source = Path(source)
    table = _Table(source, delimiter, missing)
    names = _map(columns)
    for key in names:
        if key not in ("t", "body", "x", "y", "angle"):
            raise InputError(f"unknown name {key!r}; known: t, body, x, y, angle", where="columns")
    time_column = names.get("t") or next((c for c in ("t", "time", "frame") if c in table.columns), None)
    if time_column == "frame" and fps is None:
        raise InputError("column frame needs the frame rate (--fps)", file=source)
    t = table.times(time_column, time_unit, fps)
    nothing = np.full(len(t), np.nan)
    found = {
        key: names.get(key) or (key if key in table.columns else None) for key in ("body", "x", "y", "angle")
    }
    if not any(found[key] for key in ("x", "y", "angle")):
        raise InputError(f"has no column x, y or angle; it has: {', '.join(table.header)}", file=source)
    x = table.numbers(found["x"]) if found["x"] else (0.0 * nothing)
    y = table.numbers(found["y"]) if found["y"] else (0.0 * nothing)
    if found["x"] and not found["y"]:
        y = np.where(np.isfinite(x), 0.0, np.nan)
    elif found["y"] and not found["x"]:
        x = np.where(np.isfinite(y), 0.0, np.nan)
    angle = (
        table.numbers(found["angle"]) * factor(angle_unit, ANGLES, "angle unit") if found["angle"] else None
    )
    body: Sequence[str]
    if found["body"]:
        body = [text.strip() for text in table.texts(found["body"])]
        listed = list(dict.fromkeys(body))
    else:
        listed = ["one body, as there is no column body"]
        body = []
    built, template = build_scene(bodies, scene, listed)
    if not found["body"]:
        mobile = [b.id for b in built.bodies if b.mobile]
        if len(mobile) != 1:
            raise InputError("has no column body, and the scene has more than one", file=source)
        body = mobile * len(t)
    x, y, angle = _to_si(x, y, angle, unit, flip_y)
    numbers = _given(
        template, title=title, sampling=sampling, position_noise=position_noise, angle_noise=angle_noise
    )
    return assemble(source, built, t, body, x, y, angle, table.lines, numbers)


def _to_si(
    x: np.ndarray, y: np.ndarray, angle: np.ndarray | None, unit: str | float, flip_y: float | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    length = factor(unit, LENGTHS, "unit")
    if flip_y is not None:
        y, angle = flip_y - y, None if angle is None else -angle
    return x * length, y * length, angle


def import_wide(
    source: str | Path,
    *,
    bodies: Sequence[str] = (),
    scene: str | Path | None = None,
    columns: str | Mapping[str, str] | None = None,
    unit: str | float = "m",
    time_unit: str | float = "s",
    fps: float | None = None,
    angle_unit: str | float = "rad",
    flip_y: float | None = None,
    missing: Sequence[str] = (),
    delimiter: str = ",",
    title: str | None = None,
    sampling: float | None = None,
    position_noise: float | None = None,
    angle_noise: float | None = None,
) -> Recording:
    """A table with one row per frame: ``t,x1,y1,x2,y2``, or ``t,x1,x2`` for motion along x.

    The text after x, y or angle is the body's id. ``columns`` names others: ``{"t": "time", "1.x": "left"}``.
    Without a time column ``fps`` makes the time out of the row. Everything else as in ``import_long``.
    """
    source = Path(source)
    table = _Table(source, delimiter, missing)
    names = _map(columns)
    time_column = names.pop("t", None) or next(
        (c for c in ("t", "time", "frame") if c in table.columns), None
    )
    if time_column is None and fps is not None:
        t = np.arange(len(table.lines)) / table_rate(fps)
    else:
        if time_column == "frame" and fps is None:
            raise InputError("column frame needs the frame rate (--fps)", file=source)
        t = table.times(time_column, time_unit, fps)
    places: dict[str, dict[str, str]] = {}
    for key, column in names.items():
        name, dot, kind = key.rpartition(".")
        if not dot or kind not in ("x", "y", "angle"):
            raise InputError(f"unknown name {key!r}; known: t, BODY.x, BODY.y, BODY.angle", where="columns")
        places.setdefault(name, {})[kind] = column
    mapped = {*names.values(), time_column}
    for column in table.header:
        match = re.fullmatch(r"(x|y|angle|theta)[ _.]?(.+)", column)
        if match and column not in mapped:
            kind = "angle" if match[1] == "theta" else match[1]
            places.setdefault(match[2], {}).setdefault(kind, column)
    if not places:
        raise InputError(f"has no columns like x1, y1; it has: {', '.join(table.header)}", file=source)
    built, template = build_scene(bodies, scene, list(places))
    size = len(t)
    xs, ys, angles = [], [], []
    body: list[str] = []
    for name, kinds in places.items():
        x = table.numbers(kinds["x"]) if "x" in kinds else np.full(size, np.nan)
        y = table.numbers(kinds["y"]) if "y" in kinds else np.full(size, np.nan)
        if "x" in kinds and "y" not in kinds:
            y = np.where(np.isfinite(x), 0.0, np.nan)
        elif "y" in kinds and "x" not in kinds:
            x = np.where(np.isfinite(y), 0.0, np.nan)
        xs.append(x)
        ys.append(y)
        body += [name] * size
        angles.append(table.numbers(kinds["angle"]) if "angle" in kinds else np.full(size, np.nan))
    turned = np.concatenate(angles) * factor(angle_unit, ANGLES, "angle unit")
    one_dimensional = not any("y" in kinds for kinds in places.values())
    x, y, angle = _to_si(
        np.concatenate(xs), np.concatenate(ys), turned if np.isfinite(turned).any() else None, unit,
        None if one_dimensional else flip_y,
    )  # fmt: skip
    numbers = _given(
        template, title=title, sampling=sampling, position_noise=position_noise, angle_noise=angle_noise
    )
    return assemble(
        source, built, np.tile(t, len(places)), body, x, y, angle, table.lines * len(places), numbers
    )


def table_rate(fps: float) -> float:
    if not (math.isfinite(fps) and fps > 0):
        raise InputError(f"should be above zero [Hz], got {fps!r}", where="fps")
    return fps
