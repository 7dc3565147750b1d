"""Drag proportional to the square of the speed."""

import math

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = -c (r_i/r_0)^p |v_i| v_i",
    reference="Newton 1687, Principia, book II; Rayleigh 1876, Phil. Mag. 2, 430",
    parameters=[
        Parameter("c", "kg/m", "drag coefficient of a body of the mean radius r_0", low=0.0, typical=1.0),
        Parameter("p", "1", "power of the radius", default=0.0, choices=(0, 1, 2)),
    ],
    strength=("c",),
    candidate="named",
    apart=True,
    role="drag",
)
def quadratic_drag(vx, vy, radius, r0, c, p):
    rate = c * math.sqrt(vx * vx + vy * vy)
    if p == 1:
        rate *= radius / r0
    elif p == 2:
        rate *= (radius / r0) * (radius / r0)
    return -rate * vx, -rate * vy
