"""What a run shows of itself at one time: the bodies, and the pairs of them that touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class State:
    """The bodies at one time, rows in the order of ``scene.bodies``.

    t : float, time [s]
    xy : (n, 2) float, positions [m], unwrapped along a periodic x
    v : (n, 2) float, velocities [m/s] at t
    angle, spin : (n,) float, angle [rad] and angular velocity [rad/s]; of a pinned body those of its rod,
        0 when it hangs along -y, in (-pi, pi]
    """

    t: float
    xy: np.ndarray
    v: np.ndarray
    angle: np.ndarray
    spin: np.ndarray


@dataclass(frozen=True)
class Contacts:
    """Touching pairs, rows i < j of ``scene.bodies``.

    normal : (k, 2), from i to j;  force : (k,) normal force on j along the normal [N];
    overlap : (k,) sum of radii less distance [m]
    """

    i: np.ndarray
    j: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    overlap: np.ndarray
