"""The free swing of two arms, one hung from the other, of Kaheman et al., arXiv:2205.06231."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...scene import Body, Scene, use
from ..recording import Recording
from .base import Options
from .source import Source

# upstream's own estimates, both arms rigid
MASS = (0.0938, 0.1376)  # kg
CENTRE = (0.1086, 0.1168)  # m, from the hinge above an arm to its centre of mass
JOINT = 0.1727  # m, from the pivot to the joint of the two arms
INERTIA = (4.375e-4, 1.269e-3)  # kg m^2 about the centres of mass
GRAVITY = 9.8086  # m/s^2
RADIUS = 0.02  # m; nominal, the arms are no disks and nothing touches them
# rad; rms of what estimate_noise finds in the first 6 s for the two arms, 2.11e-5 and 6.15e-5
ANGLE_NOISE = 4.6e-5


def import_double_pendulum(source: str | Path) -> Recording:
    """Angles of both arms against the vertical: angles only, 0 hanging.

    source : double_pendulum_200Hz.csv (t_s [s], theta1_rad and theta2_rad [rad], both absolute, hanging at pi), or its
    folder. Upstream's estimates of the arms are used as they stand, without its viscous torques. Raises InputError.
    """
    source = Path(source)
    file = source / "double_pendulum_200Hz.csv" if source.is_dir() else source
    table = Source(file, Options(delimiter=",", decimal=".")).table
    if table is None:
        raise InputError("is not a table in UTF-8", file=file)
    t, *theta = (table.numbers(name, required=True) for name in ("t_s", "theta1_rad", "theta2_rad"))
    if len(t) < 2:
        raise InputError("needs two rows or more", file=file)
    order = np.argsort(t, kind="stable")
    ids = ("arm1", "arm2")
    scene = Scene(
        bodies=tuple(
            Body(id=name, role="free", radius=RADIUS, mass=mass, inertia=inertia)
            for name, mass, inertia in zip(ids, MASS, INERTIA, strict=True)
        ),
        laws=(
            use("gravity"),
            use("hinge", bodies=["arm1"], anchor_a=(0.0, CENTRE[0]), anchor=(0.0, 0.0)),
            # the joint in the axes of arm 1 is below its centre of mass
            use("hinge", bodies=list(ids), anchor_a=(0.0, round(CENTRE[0] - JOINT, 6)), anchor_b=(0.0, CENTRE[1])),
        ),
        gravity=(0.0, -GRAVITY),
    )
    return Recording(
        name="double_pendulum",
        title="free swing of two arms, one hung from the other, encoders",
        scene=scene,
        t=t[order],
        ids=ids,
        xy=np.full((len(t), 2, 2), np.nan),
        angle=np.column_stack(theta)[order] - math.pi,
        sampling=float(f"{1 / np.median(np.diff(t[order])):.6g}"),
        angle_noise=ANGLE_NOISE,
    )
