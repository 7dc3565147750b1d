"""A force towards or away from a fixed point at which nothing is seen: a magnet below the table."""

import math

from .base import Parameter, law


@law(
    kind="body",
    expression="F = s (r_0/d)^n e, d the distance from a, e away from it; within r_0 s (d/r_0) e; s > 0 repels",
    reference="Mie 1903, Ann. Phys. 316, 657 (inverse powers); doi:10.1002/andp.19033160802",
    parameters=[
        Parameter("s", "N", "force at a distance of one mean radius r_0", typical=1.0),
        Parameter("a", "m", "where it comes from", size=2, typical=1.0, within="tracks"),
        Parameter("n", "1", "power of the distance", low=0.0, high=20.0, default=2.0, typical=2.0),
    ],
    strength=("s",),
    phrase="a force from a point",
    role="source",
)
def point_force(x, y, r0, s, a_x, a_y, n):
    dx = x - a_x
    dy = y - a_y
    distance = math.sqrt(dx * dx + dy * dy)
    if distance < r0:
        return s * dx / r0, s * dy / r0
    size = s * (r0 / distance) ** n / distance
    return size * dx, size * dy
