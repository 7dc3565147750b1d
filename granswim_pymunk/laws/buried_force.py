"""A force from a fixed point that ends nowhere near it: a form of the one with a power."""

import math

from .base import Parameter, law


@law(
    kind="body",
    expression="F = s r_0^2/(d^2 + b^2) e, d the distance from a, e away from it; s > 0 repels",
    reference="Plummer 1911, Mon. Not. R. Astron. Soc. 71, 460 (a softened inverse square)",
    parameters=[
        Parameter("s", "N", "force at a distance of one mean radius r_0 where b is none", typical=1.0),
        Parameter("a", "m", "where it comes from", size=2, typical=1.0, within="tracks"),
        Parameter("b", "m", "distance below which it grows no further", low=0.0, default=0.0, typical=1e-3),
    ],
    strength=("s",),
    candidate="named",
    phrase="a force from a point",
    form_of="point_force",
    form="with a core",
    role="source",
)
def buried_force(x, y, r0, s, a_x, a_y, b):
    dx = x - a_x
    dy = y - a_y
    distance = math.sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return 0.0, 0.0
    size = s * r0 * r0 / (distance * distance + b * b) / distance
    return size * dx, size * dy
