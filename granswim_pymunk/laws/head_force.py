"""A constant force on the swimmer's head."""

import math

from .base import Parameter, law
from .bending import of_bending


@law(
    kind="chain",
    expression="F = F_0 (cos a, sin a) on the head; a a fixed angle, or along its axis: a = theta_head(t), which "
    "points from the head to the tail",
    reference="Newton 1687, Principia, lex II",
    parameters=[
        Parameter("force", "N", "force F_0", typical=1.0e-4),
        Parameter("angle", "rad", "direction, used by axis = fixed only", default=0.0, typical=0.0),
        Parameter(
            "axis", "", "fixed in space, or along the head's axis", default="fixed", choices=("fixed", "head")
        ),
        *of_bending("amplitude", "frequency", "phase"),
    ],
    strength=("force",),
    candidate="named",
    phrase="a force on the head",
    refines=("bending",),
)
def head_force(t, fx, fy, force, angle, axis, amplitude, frequency, phase):
    direction = angle
    if axis == 1:
        direction = amplitude * math.sin(2.0 * math.pi * frequency * t + phase)
    fx[0] += force * math.cos(direction)
    fy[0] += force * math.sin(direction)
