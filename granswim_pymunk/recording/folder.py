"""Recordings on disk: the folder of contract version 2 (and 1), read and written.

recording.toml (scene and what was recorded), tracks.csv or tracks.npz, input.csv, curve.csv, bodies.csv.
"""

from __future__ import annotations

import csv
import itertools
import math
import os
import shutil
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from ..errors import InputError
from ..limits import LARGEST_TABLE, MOST_CELLS, ordinary_file, read_arrays
from ..scene import Scene, SceneWarning, read_inputs, read_toml, scene_from_dict
from .backdrop import Backdrop, read_backdrop
from .plausible import check_plausible
from .recording import CURVE, CURVE_FIELDS, NUMBERS, Recording, checked_number, half_seen, rail_axes

FORMATS = ("granswim-recording/1", "granswim-recording/2")
RECORDING_KEYS = tuple(NUMBERS)
NEW_KEYS = ("tolerance", "angle_tolerance", "time_noise", "radius_error", "mass_error")  # of version 2
NEW_LAWS = ("hinge", "rod")
FILES = ("recording.toml", "tracks.csv", "tracks.npz", "input.csv", "curve.csv", "bodies.csv")

# Beyond these no recording is meant, and differences of such numbers overflow
LARGEST_POSITION = 1e9  # m
LARGEST_TIME = 1e12  # s, so that a Unix clock passes
LARGEST_ANGLE = 1e9  # rad

_CHUNK = 2000  # rows of a CSV taken at once; few, or the garbage collector walks through millions of texts
_CSV_ROWS = 50_000  # more rows than this are written as NPZ
_LISTED_BODIES = 40  # more bodies than this are written as bodies.csv


# ---- reading ----------------------------------------------------------------------------------


def read_recording(folder: str | Path) -> Recording:
    """Read a recording. Everything in SI; see the contract, versions 1 and 2.

    Rows may stand in any order. Unknown keys of recording.toml warn (SceneWarning); what was said stands in
    ``notes`` too. A film beside the tables is kept for the report and not looked at. Raises InputError,
    naming file and row or key, where something is missing, not a number, given twice, not plausible (mixed units,
    stray time stamps) or where bodies overlap by more than half.
    """
    try:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", SceneWarning)
            recording = _read(Path(folder))
    except InputError as error:
        raise one_line(error) from None
    for warning in said:
        warnings.warn(warning.message, warning.category, stacklevel=2)
    notes = [" ".join(str(w.message).split()) for w in said if issubclass(w.category, SceneWarning)]
    return replace(recording, notes=tuple(dict.fromkeys(notes)))


def _film(folder: Path) -> Backdrop | None:
    """The film beside the tables; it is only shown, so what is wrong with it is said and stops nothing."""
    try:
        return read_backdrop(folder)
    except InputError as error:
        warnings.warn(f"{one_line(error)}; the film is not shown", SceneWarning, stacklevel=2)
        return None


def one_line(error: InputError) -> InputError:
    """The error without the line breaks that quoted pieces of a file may have brought in."""
    where = None if error.where is None else " ".join(error.where.split())
    return InputError(" ".join(error.message.split()), file=error.file, where=where)


def _read(folder: Path) -> Recording:
    if folder.name == "recording.toml" and folder.is_file():
        folder = folder.parent
    try:
        if not folder.is_dir():
            raise InputError("is not a folder" if folder.exists() else "no such recording", file=folder)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read it: {error}", file=repr(str(folder))) from None
    file = folder / "recording.toml"
    data = read_toml(file)
    for key in ("body", "wall", "law", "adjustable"):
        if not isinstance(data.get(key, []), list) or not all(
            isinstance(i, Mapping) for i in data.get(key, [])
        ):
            raise InputError(f"should be tables, written [[{key}]]", file=file, where=key)
    if data.get("format", FORMATS[-1]) not in FORMATS:
        known = " or ".join(map(repr, FORMATS))
        raise InputError(f"should be {known}, got {_shorten(repr(data['format']))}", file=file, where="format")
    if "format" not in data:
        warnings.warn(f"{file}: has no format; taken to be {FORMATS[-1]!r}", SceneWarning, stacklevel=2)
    try:
        scene = scene_from_dict(data, file=file, strict=False, extra=RECORDING_KEYS)
    except (ValueError, TypeError, OverflowError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot be understood: {error}", file=file) from None
    try:
        numbers: dict[str, Any] = {key: checked_number(key, data.get(key)) for key in RECORDING_KEYS}
    except InputError as error:
        raise InputError(error.message, file=file, where=error.where) from None
    if (folder / "input.csv").exists():
        scene = _with_inputs(scene, folder / "input.csv")
    curve = read_curve(folder / "curve.csv") if (folder / "curve.csv").exists() else None
    tracks = _read_tracks(folder, scene, needed=curve is None)
    recording = Recording(
        name=folder.resolve().name,
        title=str(data.get("title", "")),
        scene=scene,
        t=tracks.t,
        ids=tracks.ids,
        xy=tracks.xy,
        angle=tracks.angle,
        curve=curve,
        folder=folder,
        film=_film(folder),
        **numbers,
    )
    check_plausible(recording, tracks.rows)
    return recording


def _with_inputs(scene: Scene, path: Path) -> Scene:
    """The scene with the commands of input.csv; a name that is no body's is said (SceneWarning) and left out."""
    inputs = read_inputs(path)
    for name in set(inputs) - set(scene.ids):
        warnings.warn(
            f"{path}: input {_shorten(name)} is the name of no body of the scene; it is left out",
            SceneWarning,
            stacklevel=3,
        )
        del inputs[name]
    return replace(scene, inputs={**scene.inputs, **inputs})


@dataclass(frozen=True)
class _Tracks:
    t: np.ndarray
    ids: tuple[str, ...]
    xy: np.ndarray
    angle: np.ndarray | None
    rows: Sequence[int] | None = None  # line of the first row of each frame in the CSV


def _read_tracks(folder: Path, scene: Scene, *, needed: bool) -> _Tracks:
    csv_file, npz_file = folder / "tracks.csv", folder / "tracks.npz"
    if csv_file.exists() and npz_file.exists():
        raise InputError("has both tracks.csv and tracks.npz: one of them must go", file=folder)
    if not csv_file.exists() and not npz_file.exists():
        if needed:
            raise InputError("has neither tracks.csv, tracks.npz nor curve.csv", file=folder)
        return _Tracks(np.empty(0), (), np.empty((0, 0, 2)), None)
    path = csv_file if csv_file.exists() else npz_file
    tracks = _read_csv(path, scene) if path is csv_file else _read_npz(path, scene)
    keep = []
    sighted = np.isfinite(tracks.xy).any(axis=(0, 2))
    if tracks.angle is not None:
        sighted |= np.isfinite(tracks.angle).any(axis=0)
    for column, name in enumerate(tracks.ids):
        body, seen = scene.body(name), sighted[column]
        if body.mobile and seen and not body.observed:
            warnings.warn(
                f"{path}: body {name} is not observed (recording.toml); its rows are left out",
                SceneWarning,
                stacklevel=3,
            )
        elif body.mobile and seen:
            keep.append(column)
    if not keep:
        raise InputError("is empty: no observed body is seen in any frame", file=path)
    angle = tracks.angle
    if angle is not None:
        angle = angle[:, keep] if np.isfinite(angle[:, keep]).any() else None
    return _Tracks(tracks.t, tuple(tracks.ids[c] for c in keep), tracks.xy[:, keep], angle, tracks.rows)


def _csv_chunks(
    path: Path, required: tuple[str, ...], optional: tuple[str, ...]
) -> Iterator[tuple[dict, Sequence[int]]]:
    """Columns of a CSV as tuples of texts, some rows at a time, with the line of every row."""
    try:
        with ordinary_file(path, LARGEST_TABLE).open(newline="", encoding="utf-8-sig") as handle:
            rows = csv.reader(handle)
            header = [cell.strip() for cell in next(rows, [])]
            for name in required:
                if name not in header:
                    raise InputError(
                        f"needs the columns {','.join(required)}, has {_shorten(','.join(header))!r}",
                        file=path,
                    )
            if len(set(header)) != len(header):
                raise InputError("a column stands in the header twice", file=path)
            unknown = [name for name in header if name not in required + optional]
            if unknown:
                warnings.warn(
                    f"{path}: unknown columns left out: {', '.join(unknown)}", SceneWarning, stacklevel=4
                )
            line = 2
            while chunk := list(itertools.islice(rows, _CHUNK)):
                lines: Sequence[int] = range(line, line + len(chunk))
                line += len(chunk)
                if set(map(len, chunk)) != {len(header)}:
                    lines = [number for number, row in zip(lines, chunk, strict=True) if row]
                    chunk = [row for row in chunk if row]
                    for number, row in zip(lines, chunk, strict=True):
                        if len(row) != len(header):
                            raise InputError(
                                f"expected {len(header)} columns ({','.join(header)}), got {len(row)}",
                                file=path,
                                where=f"row {number}",
                            )
                if chunk:
                    yield dict(zip(header, zip(*chunk, strict=True), strict=True)), lines
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=path) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"is not a CSV in UTF-8: {error}", file=path) from None


def _shorten(text: str) -> str:
    return text if len(text) <= 80 else text[:77] + "..."


def _parse(
    cells: tuple[str, ...], name: str, largest: float, path: Path, lines: Sequence[int], *, empty: bool
) -> np.ndarray:
    """Texts to floats; empty cells become NaN where they are allowed. InputError names the row."""
    try:
        values = np.fromiter(map(float, cells), dtype=float, count=len(cells))
        blank = np.zeros(len(cells), dtype=bool)
    except ValueError:
        values = np.full(len(cells), np.nan)
        blank = np.zeros(len(cells), dtype=bool)
        for k, cell in enumerate(cells):
            if empty and not cell.strip():
                blank[k] = True
                continue
            try:
                values[k] = float(cell)
            except ValueError:
                what = "is empty" if not cell.strip() else f"should be a number, got {_shorten(cell)!r}"
                raise InputError(f"{name} {what}", file=path, where=f"row {lines[k]}") from None
    bad = ~np.isfinite(values) & ~blank
    if bad.any():
        k = int(np.argmax(bad))
        hint = "; leave a body that is not seen out" if np.isnan(values[k]) else ""
        raise InputError(f"{name} is not finite{hint}", file=path, where=f"row {lines[k]}")
    large = np.abs(values) > largest
    if large.any():
        k = int(np.argmax(large))
        raise InputError(f"{name} = {values[k]:g} is absurdly large", file=path, where=f"row {lines[k]}")
    return values


def _read_csv(path: Path, scene: Scene) -> _Tracks:
    """``t,body,x,y[,angle]``, rows in any order; x and y both empty where only an angle was measured.

    On a rail along x or y the other coordinate may be empty.
    """
    order = {name: row for row, name in enumerate(scene.ids)}
    rails = np.full(len(order), -1)
    for name, axis in rail_axes(scene).items():
        rails[order[name]] = axis
    parts: list[tuple[np.ndarray, ...]] = []
    has_angle = False
    for columns, lines in _csv_chunks(path, ("t", "body", "x", "y"), ("angle",)):
        t = _parse(columns["t"], "t", LARGEST_TIME, path, lines, empty=False)
        x = _parse(columns["x"], "x", LARGEST_POSITION, path, lines, empty=True)
        y = _parse(columns["y"], "y", LARGEST_POSITION, path, lines, empty=True)
        if "angle" in columns:
            has_angle = True
            angle = _parse(columns["angle"], "angle", LARGEST_ANGLE, path, lines, empty=True)
        else:
            angle = np.full(len(t), np.nan)
        nothing = np.isnan(x) & np.isnan(y) & np.isnan(angle)
        if nothing.any():
            raise InputError(
                "has neither position nor angle; leave a body that is not seen out",
                file=path,
                where=f"row {lines[int(np.argmax(nothing))]}",
            )
        names = columns["body"]
        body = np.fromiter((order.get(name, -1) for name in names), dtype=np.int64, count=len(names))
        if (body < 0).any():
            body = np.fromiter(
                (order.get(name.strip(), -1) for name in names), dtype=np.int64, count=len(names)
            )
        if (body < 0).any():
            k = int(np.argmax(body < 0))
            raise InputError(
                f"body {_shorten(names[k])!r} is not in recording.toml", file=path, where=f"row {lines[k]}"
            )
        across = np.where(rails[body] == 0, np.isfinite(x), (rails[body] == 1) & np.isfinite(y))
        half = (np.isnan(x) != np.isnan(y)) & ~across
        if half.any():
            raise InputError("has one coordinate only", file=path, where=f"row {lines[int(np.argmax(half))]}")
        parts.append((t, body, x, y, angle, np.array(lines, dtype=np.int64)))
    if not parts:
        raise InputError("is empty: it has no rows", file=path)
    t, body, x, y, angle, line = (np.concatenate(column) for column in zip(*parts, strict=True))

    times, frame = _frames(t, body)
    rows = np.unique(body)
    column = np.searchsorted(rows, body)
    if len(times) * len(rows) > max(100 * len(t), 10_000_000):
        raise InputError(
            "hardly any two bodies share a time: the rows of one frame should have one t", file=path
        )
    if len(times) * len(rows) > MOST_CELLS:
        raise InputError(f"{len(times)} frames of {len(rows)} bodies are too many to read at once", file=path)
    key = frame * len(rows) + column
    sorting = np.argsort(key, kind="stable")
    twice = np.flatnonzero(np.diff(key[sorting]) == 0)
    if len(twice):
        first, second = sorting[twice[0]], sorting[twice[0] + 1]
        raise InputError(
            f"two rows for body {scene.bodies[body[second]].id} at t = {t[second]:g} s "
            f"(the other is row {line[first]})",
            file=path,
            where=f"row {line[second]}",
        )
    xy = np.full((len(times), len(rows), 2), np.nan)
    xy[frame, column, 0] = x
    xy[frame, column, 1] = y
    angles = None
    if has_angle:
        angles = np.full((len(times), len(rows)), np.nan)
        angles[frame, column] = angle
    first = np.full(len(times), np.iinfo(np.int64).max)
    np.minimum.at(first, frame, line)
    return _Tracks(times, tuple(scene.bodies[row].id for row in rows), xy, angles, first.tolist())


def _frames(t: np.ndarray, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frame times, and the frame of every row. Times that differ by their last digits are one frame."""
    order = np.lexsort((t, body))
    own = np.diff(t[order])[np.diff(body[order]) == 0]
    own = own[own > 0]
    tolerance = 1e-3 * float(np.median(own)) if len(own) else 0.0
    times, inverse = np.unique(t, return_inverse=True)
    begins = np.concatenate(([True], np.diff(times) > tolerance))
    return times[begins], (np.cumsum(begins) - 1)[inverse]


def _read_npz(path: Path, scene: Scene) -> _Tracks:
    """t (T,) [s], body (n,) names, xy (T, n, 2) [m], NaN where not seen[, angle (T, n)]."""
    data = read_arrays(path, ("t", "body", "xy", "angle"))
    for key in ("t", "body", "xy"):
        if key not in data:
            raise InputError(f"needs the array {key}", file=path)
    for key in ("t", "xy", "angle"):
        if key in data:
            if data[key].dtype.kind not in "fiu":
                raise InputError(f"should hold numbers, not {data[key].dtype}", file=path, where=key)
            data[key] = data[key].astype(float, copy=False)
    if data["body"].dtype.kind not in "USiu":
        raise InputError(f"should hold names, not {data['body'].dtype}", file=path, where="body")
    t, xy, angle = data["t"], data["xy"], data.get("angle")
    try:
        names = [str(n, "utf-8") if isinstance(n, bytes) else str(n) for n in data["body"].ravel().tolist()]
    except UnicodeDecodeError:
        raise InputError("names are not in UTF-8", file=path, where="body") from None
    shape = (len(t) if t.ndim == 1 else -1, len(names))
    if data["body"].ndim != 1 or t.ndim != 1 or xy.shape != (*shape, 2):
        raise InputError(
            f"expected t (T,), body (n,), xy (T, n, 2), got {t.shape}, {data['body'].shape}, {xy.shape}",
            file=path,
        )
    if angle is not None and angle.shape != shape:
        raise InputError(f"expected angle (T, n) = {shape}, got {angle.shape}", file=path)
    order = {name: row for row, name in enumerate(scene.ids)}
    for name in names:
        if name not in order:
            raise InputError(f"body {_shorten(name)!r} is not in recording.toml", file=path)
    if len(set(names)) != len(names):
        twice = Counter(names).most_common(1)[0][0]
        raise InputError(f"body {twice} has two columns", file=path)
    if not np.all(np.isfinite(t)):
        raise InputError("is not finite", file=path, where=f"t, frame {int(np.argmin(np.isfinite(t)))}")
    for key, values, largest in (
        ("t", t, LARGEST_TIME),
        ("xy", xy, LARGEST_POSITION),
        ("angle", angle, LARGEST_ANGLE),
    ):
        if values is None:
            continue
        large = np.abs(values) > largest
        if large.any():
            at = np.argwhere(large)[0]
            who = f", body {names[at[1]]}" if len(at) > 1 else ""
            raise InputError("is infinite or absurdly large", file=path, where=f"{key}, frame {at[0]}{who}")
    half = half_seen(xy, names, scene)
    if half.any():
        frame, column = np.argwhere(half)[0]
        raise InputError(
            "has one coordinate only", file=path, where=f"xy, frame {frame}, body {names[column]}"
        )
    frames = np.argsort(t, kind="stable")
    t = t[frames]
    if np.any(np.diff(t) == 0):
        raise InputError(f"two frames at t = {t[np.argmin(np.diff(t))]:g} s", file=path)
    if not len(t):
        raise InputError("is empty: it has no frames", file=path)
    columns = np.argsort([order[name] for name in names], kind="stable")
    picked = np.ix_(frames, columns)
    return _Tracks(t, tuple(names[c] for c in columns), xy[picked], None if angle is None else angle[picked])


def read_curve(path: Path) -> np.ndarray:
    """``frequency,layers,speed[,speed_sem,n]``: structured (k,), NaN where speed_sem or n are not given."""
    required, optional = CURVE_FIELDS[:3], CURVE_FIELDS[3:]
    parts = []
    for columns, lines in _csv_chunks(path, required, optional):
        part = np.full(len(lines), np.nan, dtype=CURVE)
        for name in (*required, *(n for n in optional if n in columns)):
            values = _parse(columns[name], name, LARGEST_POSITION, path, lines, empty=name in optional)
            if name != "speed" and (values < 0).any():
                raise InputError(
                    f"{name} is below zero", file=path, where=f"row {lines[int(np.argmax(values < 0))]}"
                )
            part[name] = values
        parts.append(part)
    if not parts:
        raise InputError("is empty: it has no rows", file=path)
    return np.concatenate(parts)


# ---- writing ----------------------------------------------------------------------------------


def write_recording(recording: Recording, folder: str | Path, *, tracks: str | None = None) -> Path:
    """Write a recording as a folder; ``read_recording`` gives back the same numbers, digit for digit.

    tracks : "csv" or "npz"; left out, CSV up to 50 000 rows. Everything is written beside the folder
    first and then moved into place, so that an error leaves nothing half-written; files in the folder
    that are not part of a recording stay. Raises InputError where it cannot be written.
    """
    folder = Path(folder)
    if tracks not in (None, "csv", "npz"):
        raise InputError(f'tracks should be "csv" or "npz", got {tracks!r}')
    if folder.exists() and not folder.is_dir():
        raise InputError("exists and is not a folder", file=folder)
    target = folder.resolve()
    staged = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        staged.mkdir()
        try:
            _write_files(recording, staged, tracks)
            if target.exists():
                for file in FILES:
                    if (staged / file).exists():
                        os.replace(staged / file, target / file)
                    else:
                        (target / file).unlink(missing_ok=True)
            else:
                os.replace(staged, target)
        finally:
            shutil.rmtree(staged, ignore_errors=True)
    except OSError as error:
        raise InputError(f"cannot write it: {error.strerror or error}", file=folder) from None
    return folder


def _write_files(recording: Recording, folder: Path, tracks: str | None) -> None:
    scene = recording.scene
    data = scene.to_dict()
    for key in ("format", "title", "seed", "input"):
        data.pop(key, None)
    if data.get("time") == {"start": 0.0, "scheme": "exact"}:
        del data["time"]  # what a recording that says nothing means
    head: dict[str, Any] = {"format": FORMATS[_version(recording, data) - 1], "title": recording.title}
    head |= {key: value for key in RECORDING_KEYS if (value := getattr(recording, key)) is not None}
    if scene.seed:
        head["seed"] = scene.seed
    if len(scene.bodies) > _LISTED_BODIES:
        head["bodies"] = "bodies.csv"
        _write_bodies(data.pop("body"), folder / "bodies.csv")
    laws = data["law"]
    if scene.laws and scene.laws[0].name == "gravity" and scene.laws[0].bodies is None and any(scene.gravity):
        laws = laws[1:]  # scene.gravity says it; the reader puts the law back in this place
    del data["law"]
    tables = {"body": data.pop("body", []), "wall": data.pop("wall", []), "law": laws}
    tables["adjustable"] = data.pop("adjustable", [])
    text = [tomli_w.dumps(head | data)]
    text += [f"[[{name}]]\n{tomli_w.dumps(table)}" for name, items in tables.items() for table in items]
    (folder / "recording.toml").write_text("\n".join(text), encoding="utf-8")
    if scene.inputs:
        rows = (
            (t, name, v)
            for name, (ts, values) in scene.inputs.items()
            for t, v in zip(ts, values, strict=True)
        )
        _write_csv(folder / "input.csv", ("t", "name", "value"), rows)
    if recording.curve is not None:
        used = [f for f in CURVE_FIELDS if f in CURVE_FIELDS[:3] or np.isfinite(recording.curve[f]).any()]
        _write_csv(folder / "curve.csv", used, (tuple(row[f] for f in used) for row in recording.curve))
    if not len(recording.t):
        return
    seen = recording.seen
    if tracks is None:
        tracks = "csv" if seen.sum() <= _CSV_ROWS else "npz"
    if tracks == "npz":
        arrays = {"t": recording.t, "body": np.array(recording.ids), "xy": recording.xy}
        if recording.angle is not None:
            arrays["angle"] = recording.angle
        np.savez_compressed(folder / "tracks.npz", **arrays)  # type: ignore[arg-type]
        return
    header = ["t", "body", "x", "y"] + (["angle"] if recording.angle is not None else [])
    frames, columns = np.nonzero(seen)
    parts: list[Any] = [
        recording.t[frames].tolist(),
        [recording.ids[c] for c in columns],
        recording.xy[frames, columns, 0].tolist(),
        recording.xy[frames, columns, 1].tolist(),
    ]
    if recording.angle is not None:
        parts.append(recording.angle[frames, columns].tolist())
    _write_csv(folder / "tracks.csv", header, zip(*parts, strict=True))


def _version(recording: Recording, data: Mapping[str, Any]) -> int:
    """2 where the recording uses what came with version 2, else 1, so that older readers take it."""
    missing = np.isnan(recording.xy)
    new = (
        any(getattr(recording, key) is not None for key in NEW_KEYS)
        or bool(recording.scene.walls)
        or data.get("time", {}).get("scheme") == "half_step"
        or any(item.name in NEW_LAWS for item in recording.scene.laws)
        or bool(np.any(missing[..., 0] != missing[..., 1]))
    )
    return 2 if new else 1


def _write_csv(path: Path, header: Any, rows: Any) -> None:
    """Floats with all their digits (repr), NaN as an empty cell."""
    with path.open("w", newline="", encoding="utf-8") as handle:
        writer = csv.writer(handle, lineterminator="\n")
        writer.writerow(header)
        for row in rows:
            writer.writerow([_cell(value) for value in row])


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return str(value)


def _write_bodies(bodies: list[dict[str, Any]], path: Path) -> None:
    columns = ["id", "role", "radius", "mass", "observed", "x", "y", "vx", "vy"]
    if any("inertia" in body for body in bodies):
        columns.append("inertia")
    rows = []
    for body in bodies:
        row = {**body, "observed": "true" if body.get("observed", True) else "false"}
        if "initial" in body:
            row |= dict(zip(("x", "y", "vx", "vy"), body["initial"], strict=True))
        rows.append([row.get(name, math.nan) for name in columns])
    _write_csv(path, columns, rows)
