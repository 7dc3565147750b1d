"""A spring from a body to a fixed anchor."""

import math

from .base import Parameter, law


@law(
    kind="body",
    expression="F = -k (|r - a| - l) (r - a)/|r - a|; for l = 0, F = -k (r - a)",
    reference="Hooke 1678, De Potentia Restitutiva",
    parameters=[
        Parameter("anchor", "m", "where the spring is fixed", size=2, typical=1.0, within="tracks"),
        Parameter("stiffness", "N/m", "stiffness k", low=0.0, typical=1.0),
        Parameter("length", "m", "length at rest l", low=0.0, default=0.0),
    ],
    strength=("stiffness",),
    candidate="named",
    phrase="a spring to a point",
    role="tether",
)
def spring(x, y, anchor_x, anchor_y, stiffness, length):
    dx = x - anchor_x
    dy = y - anchor_y
    if length == 0.0:
        return -stiffness * dx, -stiffness * dy
    distance = math.sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return 0.0, 0.0
    pull = -stiffness * (distance - length) / distance
    return pull * dx, pull * dy
