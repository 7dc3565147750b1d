"""A form without a name in the power of the speed: a drag between, or beyond, those with a name."""

import math

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = -c (r_i/r_0)^p (|v_i|/top)^n v_i/|v_i|",
    reference="Ostwald 1925, Kolloid-Zeitschrift 36, 99 (power law)",
    parameters=[
        Parameter("top", "m/s", "speed at which the force is c", low=0.0, default=1.0),
        Parameter("c", "N", "force on a body of the mean radius r_0 at the top speed", low=0.0, typical=1.0),
        Parameter("n", "1", "power of the speed", low=0.2, high=6.0, typical=2.0, asked=(3.0,)),
        Parameter("p", "1", "power of the radius", default=0.0, choices=(0, 1, 2)),
    ],
    strength=("c",),
    candidate="flexible",
    phrase="a drag with a power of the speed",
)
def flexible_power(vx, vy, radius, r0, top, c, n, p):
    speed = math.sqrt(vx * vx + vy * vy)
    if speed < 1e-9 * top:
        return 0.0, 0.0
    size = c * math.pow(speed / top, n)
    if p == 1:
        size *= radius / r0
    elif p == 2:
        size *= (radius / r0) * (radius / r0)
    return -size * vx / speed, -size * vy / speed
