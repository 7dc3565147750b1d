"""Two tracked disks that collide, with a marker on each rim (github.com/MestreHq5/Collision-Study)."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...scene import Adjustable, Body, Scene, use
from ..recording import Recording
from .base import Options
from .source import Source

RADIUS = 0.040  # m
MASS = 0.0118  # kg
MILLIMETRE = 1e-3


def import_two_disk_spin(source: str | Path, *, fps: float = 54.89) -> Recording:
    """Centres and orientations of two disks on a table, from disk_tracks.csv or its folder.

    fps : frame rate [Hz]; upstream's scripts say 54.89 in one place and 30 in another
    angle : direction from the centre to the marker on the rim [rad], followed over turns
    Inertia m r^2/2 of a uniform disk. The calibration is rough: the disks' apparent radius grows by 20 %
    along the way, and the centres never come nearer than 89 mm although the disks are 80 mm wide.
    """
    source = Path(source)
    file = source / "disk_tracks.csv" if source.is_dir() else source
    if not (math.isfinite(fps) and fps > 0):
        raise InputError(f"should be above zero [Hz], got {fps!r}", where="fps")
    table = Source(file, Options(delimiter=",", decimal=".")).table
    if table is None:
        raise InputError("is not a table in UTF-8", file=file)
    t = table.numbers("frame", required=True) / fps
    cx, cy, mx, my = (table.numbers(name, required=True) for name in ("cx_mm", "cy_mm", "mx_mm", "my_mm"))
    disk = [text.strip() for text in table.texts("disk_id")]
    ids = ("0", "1")
    for k, name in enumerate(disk):
        if name not in ids:
            raise InputError(f"disk_id should be 0 or 1, got {name!r}", file=file, where=f"row {table.lines[k]}")
    times, frame = np.unique(t, return_inverse=True)
    column = np.array([ids.index(name) for name in disk])
    key, first = np.unique(frame * 2 + column, return_index=True)
    if len(key) != len(t):
        line = table.lines[min(set(range(len(t))) - set(first.tolist()))]
        raise InputError("two rows for one disk and frame", file=file, where=f"row {line}")
    xy = np.full((len(times), 2, 2), np.nan)
    xy[frame, column, 0] = cx * MILLIMETRE
    xy[frame, column, 1] = cy * MILLIMETRE
    angle = np.full((len(times), 2), np.nan)
    angle[frame, column] = np.arctan2(my - cy, mx - cx)
    for c in range(2):
        seen = np.isfinite(angle[:, c])
        # an arc tangent has another last digit on another machine
        angle[seen, c] = np.round(np.unwrap(angle[seen, c]), 12)
    scene = Scene(
        bodies=tuple(Body(id=i, role="free", radius=RADIUS, mass=MASS, inertia=0.5 * MASS * RADIUS**2) for i in ids),
        laws=(use("contact_elastic", restitution=1.0),),
        adjustable=(Adjustable("contact_elastic", "restitution", 0.3, 1.0),),
    )
    return Recording(
        name="two_disk_spin",
        title="two spinning disks collide (rough calibration)",
        scene=scene,
        t=times,
        ids=ids,
        xy=xy,
        angle=angle,
        sampling=fps,
    )
