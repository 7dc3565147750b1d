"""Text dumps of LAMMPS (docs.lammps.org/dump.html): ITEM: TIMESTEP, BOX BOUNDS, ATOMS id type x y ..."""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options
from .source import Source


def recognise(source: Source) -> bool:
    return any(line.startswith(("ITEM: TIMESTEP", "ITEM: UNITS", "ITEM: TIME")) for line in source.start[:3])


def read(source: Source, options: Options) -> Found:
    """x, y (or xu, yu unwrapped, or xs, ys scaled), ids, radius and mass. Time: ITEM: TIME, else steps."""
    lines = (source.text or "").splitlines()
    given = options.column_map()
    clock: list[np.ndarray] = []
    body: list[str] = []
    rows: list[int] = []
    xs, ys = [], []
    radius: dict[str, float] = {}
    mass: dict[str, float] = {}
    period = None
    timed = any(line.startswith("ITEM: TIME") and "STEP" not in line for line in lines[:20])
    step = time = 0.0
    bounds: list[tuple[float, float]] = []
    boundary: list[str] = []
    at = count = 0
    while at < len(lines):
        item = lines[at].strip()
        try:
            if item == "ITEM: TIMESTEP":
                step, at = float(lines[at + 1]), at + 2
            elif item == "ITEM: TIME":
                time, at = float(lines[at + 1]), at + 2
            elif item == "ITEM: UNITS":
                at += 2
            elif item == "ITEM: NUMBER OF ATOMS":
                count, at = int(lines[at + 1]), at + 2
            elif item.startswith("ITEM: BOX BOUNDS"):
                boundary = [word for word in item.split()[3:] if len(word) == 2]
                bounds = [tuple(map(float, line.split()[:2])) for line in lines[at + 1 : at + 4]]  # type: ignore[misc]
                at += 4
            elif item.startswith("ITEM: ATOMS"):
                names = item.split()[2:]
                block = [line.split() for line in lines[at + 1 : at + 1 + count]]
                if len(block) != count or any(len(row) != len(names) for row in block):
                    raise ValueError(f"expected {count} atoms of {len(names)} values")
                columns = dict(zip(names, zip(*block, strict=True), strict=True)) if block else {}
                x = _coordinate("x", 0, columns, bounds, given)
                y = _coordinate("y", 1, columns, bounds, given)
                ids = list(columns.get(given.get("body", "id"), map(str, range(1, count + 1))))
                xs.append(x)
                ys.append(y)
                clock.append(np.full(count, time if timed else step))
                body += ids
                rows += range(at + 2, at + 2 + count)
                for what, into in (("radius", radius), ("mass", mass)):
                    if what in columns:
                        into.update((i, float(v)) for i, v in zip(ids, columns[what], strict=True) if i not in into)
                if "diameter" in columns and not radius:
                    radius.update((i, float(v) / 2) for i, v in zip(ids, columns["diameter"], strict=True))
                if boundary and boundary[0] == "pp" and period is None:
                    period = bounds[0][1] - bounds[0][0]
                at += 1 + count
            elif not item:
                at += 1
            else:
                raise ValueError(f"what is {item[:40]!r}?")
        except (ValueError, IndexError, KeyError) as error:
            raise InputError(
                f"is not a dump that can be read: {error}", file=source.path, where=f"row {at + 1}"
            ) from None
    if not body:
        raise InputError("is empty: it has no atoms", file=source.path)
    return Found(
        clock=np.concatenate(clock), counts="time" if timed else "step", body=body, x=np.concatenate(xs),
        y=np.concatenate(ys), rows=rows, radius=radius, mass=mass, period=period,
    )  # fmt: skip


def _coordinate(
    name: str, axis: int, columns: dict[str, tuple[str, ...]], bounds: list[tuple[float, float]], given: dict[str, str]
) -> np.ndarray:
    """One coordinate in the dump's length, unwrapped where the dump says how."""
    wanted = given.get(name, name)
    axis = {"x": 0, "y": 1, "z": 2}.get(wanted[0], axis)
    low, high = bounds[axis] if axis < len(bounds) else (0.0, 1.0)
    for suffix, scaled, wrapped in (("u", False, False), ("", False, True), ("su", True, False), ("s", True, True)):
        column = wanted if wanted in columns and wanted != name else wanted + suffix
        if column in columns:
            values = np.array(columns[column], dtype=float)
            if scaled:
                values = low + values * (high - low)
            image = columns.get("i" + (wanted[0] if wanted[0] in "xyz" else name))
            if wrapped and image is not None:
                values = values + np.array(image, dtype=float) * (high - low)
            return values
    raise KeyError(f"no column {wanted}; it has {', '.join(columns)}")


IMPORTER = Importer("lammps", "text dump of LAMMPS", recognise, read)
