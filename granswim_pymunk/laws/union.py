"""The spring that holds consecutive disks of a swimmer together."""

import math

from .base import AUTOMATIC, Parameter, law


@law(
    kind="chain",
    expression="F_n = -k_U (|r_ij| - l) - gamma_U m_r v_ij.n, consecutive disks",
    reference="Echeverria-Huarte, Telo da Gama & Araujo, "
    "Optimal frequency for undulatory motion in granular media, Eq. 1",
    parameters=[
        Parameter("stiffness", "N/m", "union stiffness k_U", low=0.0),
        Parameter("damping", "1/s", "union damping gamma_U", low=0.0, default=0.0),
        Parameter("length", "m", "length at rest; twice the radius where not given", low=0.0, default=AUTOMATIC),
    ],
    role="link",
)
def union(x, y, vx, vy, mass, fx, fy, stiffness, damping, length):
    for i in range(x.shape[0] - 1):
        j = i + 1
        dx = x[j] - x[i]
        dy = y[j] - y[i]
        distance = math.sqrt(dx * dx + dy * dy)
        nx = dx / distance
        ny = dy / distance
        reduced = mass[i] * mass[j] / (mass[i] + mass[j])
        vn = (vx[j] - vx[i]) * nx + (vy[j] - vy[i]) * ny
        force = -stiffness * (distance - length) - damping * reduced * vn
        fx[j] += force * nx
        fy[j] += force * ny
        fx[i] -= force * nx
        fy[i] -= force * ny
