"""H5MD (de Buyl, Colberg & Hoefling 2014, doi:10.1016/j.cpc.2014.01.018): particles/GROUP/position, id, box.

Trajectories that ``granswim run`` writes are of this form too; their scene's radii and masses are taken along.
"""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options, grid
from .source import Source
from .units import LENGTHS


def recognise(source: Source) -> bool:
    return {"h5md", "particles"} <= source.hdf5_names.keys()


def read(source: Source, options: Options) -> Found:
    """Positions of one group of particles (``table``: which), in the unit that the file states."""
    try:
        with h5py.File(source.path, "r") as file:
            return _read(file, source, options)
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise InputError(f"is not H5MD that can be read: {error}", file=source.path) from None


def _read(file: Any, source: Source, options: Options) -> Found:
    groups = [name for name in file["particles"] if "position" in file["particles"][name]]
    wanted = str(options.table) if options.table is not None else (groups[0] if groups else "")
    if wanted not in groups:
        raise InputError(f"has no particles {wanted!r} with positions; it has: {', '.join(groups)}", file=source.path)
    group = file[f"particles/{wanted}"]
    position = group["position"]
    xyz = np.asarray(position["value"][...], dtype=float)
    plane = [{"x": 0, "y": 1, "z": 2}.get(options.column_map().get(key, key), 0) for key in ("x", "y")]
    xy = xyz[..., plane]
    frames, n = xy.shape[:2]
    period = None
    box = group.get("box")
    kinds = np.ravel(box.attrs.get("boundary", [])).tolist() if box is not None else []
    boundary = [kind.decode() if isinstance(kind, bytes) else str(kind) for kind in kinds]
    if box is not None and "edges" in box and boundary and boundary[plane[0]] == "periodic":
        edges = np.asarray(box["edges"]["value"][0] if isinstance(box["edges"], h5py.Group) else box["edges"][...])
        period = float(edges[plane[0]] if edges.ndim == 1 else edges[plane[0], plane[0]])
    if "image" in group and period:
        image = np.asarray(group["image/value"][...], dtype=float)[..., plane]
        xy = xy + image * np.array([period, 0.0])
    ids = _ids(group, n)
    if "time" in position:
        t, counts = _series(position["time"], frames), "time"
    else:
        t, counts = _series(position["step"], frames), "step"
    clock, body, x, y = grid(t, ids, xy)
    found = Found(clock=clock, counts=counts, body=body, x=x, y=y, period=period)
    found.length = _unit(position["value"])
    found.time = _unit(position["time"]) if counts == "time" else None
    if "angle" in group:
        found.angle = np.asarray(group["angle/value"][...], dtype=float)[:frames].reshape(-1)
    for key, into in (("radius", found.radius), ("mass", found.mass)):
        values = group.get(key)
        if values is not None:
            place = values["value"] if isinstance(values, h5py.Group) else values
            data = np.ravel(place[0] if isinstance(values, h5py.Group) else place[...]).astype(float)
            own = _unit(place)
            if key == "radius" and own in LENGTHS and found.length in LENGTHS:
                data = data * (LENGTHS[own] / LENGTHS[found.length])  # stated apart from the positions
            into.update(zip(ids, data.tolist(), strict=False))
    return found


def _ids(group: Any, n: int) -> list[str]:
    data = group.get("id")
    if data is None:
        return [str(k) for k in range(n)]
    values = data["value"][0] if isinstance(data, h5py.Group) else data[...]
    return [i.decode() if isinstance(i, bytes) else str(i) for i in np.ravel(values).tolist()]


def _series(data: Any, frames: int) -> np.ndarray:
    """Step or time of every frame: a list, or a fixed step with an offset."""
    values = np.asarray(data[...], dtype=float)
    if values.ndim:
        return values[:frames]
    return float(data.attrs.get("offset", 0.0)) + float(values) * np.arange(frames)


def _unit(data: Any) -> str | None:
    unit = data.attrs.get("unit")
    return None if unit is None else (unit.decode() if isinstance(unit, bytes) else str(unit))


IMPORTER = Importer("h5md", "H5MD trajectory, also of granswim run", recognise, read)
