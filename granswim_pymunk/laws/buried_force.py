"""A force from a point below the table, a magnet or a charge: what of it lies in the plane ends above the point."""

import math

from .base import Parameter, law


@law(
    kind="body",
    expression="F = s (r_0/D)^n (d/D) e, D = sqrt(d^2 + b^2), d the distance from a, e away from it; s > 0 repels",
    reference="Griffiths, Introduction to Electrodynamics, ch. 2 and 6 (n = 1 a line, 2 a charge, 4 two dipoles)",
    parameters=[
        Parameter("s", "N", "force at a distance of one mean radius r_0 where b is none", typical=1.0),
        Parameter("a", "m", "place in the plane that it lies under", size=2, typical=1.0, within="tracks"),
        Parameter("n", "1", "power of the distance from it", default=2.0, choices=(1, 2, 4), always=True),
        Parameter("b", "m", "how deep it lies", low=0.0, default=0.0, typical=1e-3),
    ],
    strength=("s",),
    phrase="a force from a point",
    form_of="point_force",
    form="below the plane",
    role="source",
)
def buried_force(x, y, r0, s, a_x, a_y, n, b):
    dx = x - a_x
    dy = y - a_y
    square = dx * dx + dy * dy + b * b
    if square == 0.0:
        return 0.0, 0.0
    size = s * math.pow(r0 * r0 / square, 0.5 * n) / math.sqrt(square)
    return size * dx, size * dy
