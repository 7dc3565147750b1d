"""The free swing of a single arm of Kaheman et al., arXiv:2205.06231."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...limits import read_arrays
from ...scene import Adjustable, Body, Scene, use
from ..recording import Recording
from .base import Options
from .source import Source

# upstream's own estimates, EstimatedParameters_SinglePendulum.mat
LENGTH = 0.14775  # m, from the axis to the arm's centre of mass
MASS = 0.14758  # kg
INERTIA = 1.0912e-4  # kg m^2 about the centre of mass
RADIUS = 0.02  # m; nominal, the arm is not a disk and nothing touches it
COUNTS = 40_000  # of the encoder, a turn


def import_single_pendulum(source: str | Path) -> Recording:
    """Angles of the arm: angle only, 0 hanging.

    source : single_pendulum_200Hz.csv or mounted_arm_1kHz.npz (t_s [s], theta_rad [rad], hanging at pi), or
    their folder. The noise stated is the encoder's step over sqrt(12). Upstream's estimates of the arm are
    used as they stand, without its damping; ``pin.length`` is adjustable by 10 %.
    """
    source = Path(source)
    file = source / "single_pendulum_200Hz.csv" if source.is_dir() else source
    if file.suffix == ".npz":
        data = read_arrays(file, ("t_s", "theta_rad"))
        if len(data) < 2 or any(a.dtype.kind not in "fiu" or a.ndim != 1 for a in data.values()):
            raise InputError("needs arrays t_s and theta_rad of numbers", file=file)
        t, theta = data["t_s"].astype(float), data["theta_rad"].astype(float)
        if len(t) != len(theta) or len(t) < 2:
            raise InputError(f"t_s has {len(t)} numbers and theta_rad {len(theta)}", file=file)
    else:
        table = Source(file, Options(delimiter=",", decimal=".")).table
        if table is None:
            raise InputError("is not a table in UTF-8", file=file)
        t, theta = table.numbers("t_s", required=True), table.numbers("theta_rad", required=True)
    order = np.argsort(t, kind="stable")
    t, theta = t[order], theta[order]
    scene = Scene(
        bodies=(Body(id="arm", role="free", radius=RADIUS, mass=MASS, inertia=INERTIA),),
        laws=(use("gravity"), use("pin", bodies=["arm"], anchor=(0.0, 0.0), length=LENGTH)),
        gravity=(0.0, -9.81),
        adjustable=(Adjustable("pin", "length", 0.133, 0.163),),
    )
    return Recording(
        name="pendulum",
        title="free swing of a single arm, encoder",
        scene=scene,
        t=t,
        ids=("arm",),
        xy=np.full((len(t), 1, 2), np.nan),
        angle=(theta - math.pi)[:, None],
        sampling=float(f"{1 / np.median(np.diff(t)):.6g}"),
        angle_noise=float(f"{2 * math.pi / COUNTS / math.sqrt(12):.3g}"),
    )
