"""Drag with the square of the speed, against a medium that moves: a ball in the wind."""

import math

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = -c (r_i/r_0)^p |v_i - u| (v_i - u)",
    reference="Newton 1687, Principia, book II; Rayleigh 1876, Phil. Mag. 2, 430; in the frame of the medium",
    parameters=[
        Parameter("c", "kg/m", "drag coefficient of a body of the mean radius r_0", low=0.0, typical=1.0),
        Parameter(
            "u", "m/s", "velocity of the medium", size=2, default=(0.0, 0.0), typical=1.0e-2, within="speed"
        ),
        Parameter("p", "1", "power of the radius", default=0.0, choices=(0, 1, 2)),
    ],
    strength=("c",),
    candidate="named",
    phrase="an ambient flow, drag with the square of the speed",
    form_of="ambient_flow",
    form="with the square of the speed",
    nests=("quadratic_drag",),
    role="medium",
)
def quadratic_flow(vx, vy, radius, r0, c, u_x, u_y, p):
    wx = vx - u_x
    wy = vy - u_y
    rate = c * math.sqrt(wx * wx + wy * wy)
    if p == 1:
        rate *= radius / r0
    elif p == 2:
        rate *= (radius / r0) * (radius / r0)
    return -rate * wx, -rate * wy
