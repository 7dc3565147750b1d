"""GSD trajectories of HOOMD-blue (gsd.readthedocs.io), read by the package gsd."""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options, extra_needed, grid
from .source import Source

MAGIC = bytes.fromhex("df65df65df65df65")


def recognise(source: Source) -> bool:
    return source.head[:8] in (MAGIC, MAGIC[::-1])


def read(source: Source, options: Options) -> Found:
    """Unwrapped x, y; radius from the diameter, mass, a period along x. Time from a logged ``time``, else steps."""
    try:
        import gsd.hoomd
    except ImportError:
        raise extra_needed("gsd", "a GSD file", source) from None
    plane = [{"x": 0, "y": 1, "z": 2}.get(options.column_map().get(key, key), 0) for key in ("x", "y")]
    try:
        with gsd.hoomd.open(str(source.path), "r") as file:
            frames = list(file)
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"is not GSD that can be read: {error}", file=source.path) from None
    if not frames:
        raise InputError("is empty: it has no frames", file=source.path)
    n = frames[0].particles.N
    if any(frame.particles.N != n for frame in frames):
        raise InputError("its number of particles changes", file=source.path)
    box = np.asarray(frames[0].configuration.box if frames[0].configuration.box is not None else [0.0] * 6, dtype=float)
    edges = np.array([box[k] for k in plane])
    xy = np.stack([
        np.asarray(f.particles.position, dtype=float)[:, plane] + np.asarray(f.particles.image)[:, plane] * edges
        for f in frames
    ])  # fmt: skip
    logged = frames[0].log
    if "origin" in logged:  # where granswim export put the middle of the box
        xy = xy + np.asarray(logged["origin"], dtype=float)[plane]
    times = [f.log.get("time", f.log.get("simulation/time")) for f in frames]
    if all(time is not None for time in times):
        t, counts = np.array([float(np.ravel(time)[0]) for time in times]), "time"
    else:
        t, counts = np.array([float(f.configuration.step) for f in frames]), "step"
    ids = [str(k) for k in range(n)]
    period = float(edges[0]) if edges[0] > 0 and "open" not in logged else None
    clock, body, x, y = grid(t, ids, xy)
    first = frames[0].particles
    found = Found(clock=clock, counts=counts, body=body, x=x, y=y, period=period)
    found.radius = dict(zip(ids, (np.asarray(first.diameter, dtype=float) / 2).tolist(), strict=True))
    found.mass = dict(zip(ids, np.asarray(first.mass, dtype=float).tolist(), strict=True))
    return found


IMPORTER = Importer("gsd", "GSD trajectory of HOOMD-blue", recognise, read)
