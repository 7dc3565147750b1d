"""A spring that stiffens."""

import math

from .base import AUTOMATIC, Parameter, law


@law(
    kind="body",
    expression="F = -k_3 x^3 (r - a)/|r - a|, x = |r - a| - l; for l = 0, F = -k_3 |r - a|^2 (r - a)",
    reference="Duffing 1918, Erzwungene Schwingungen bei veraenderlicher Eigenfrequenz",
    parameters=[
        Parameter("k_3", "N/m^3", "cubic stiffness", typical=1.0),
        Parameter(
            "anchor",
            "m",
            "where the spring is fixed; that of the scene's spring where not given",
            size=2,
            default=AUTOMATIC,
        ),
        Parameter(
            "length",
            "m",
            "length at rest l; that of the scene's spring where not given",
            low=0.0,
            default=AUTOMATIC,
        ),
    ],
    strength=("k_3",),
    candidate="named",
    phrase="a nonlinear spring",
    refines=("spring",),
)
def nonlinear_spring(x, y, k_3, anchor_x, anchor_y, length):
    dx = x - anchor_x
    dy = y - anchor_y
    distance = math.sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return 0.0, 0.0
    stretch = distance - length
    pull = -k_3 * stretch * stretch * stretch / distance
    return pull * dx, pull * dy
