"""Dry friction in a pin."""

import math

from .base import AUTOMATIC, Parameter, law


@law(
    kind="body",
    expression="torque about the anchor = -M w/sqrt(w^2 + w_0^2), w the angular velocity of the rod",
    reference="Coulomb 1785, Theorie des machines simples",
    parameters=[
        Parameter("torque", "N m", "friction torque M", low=0.0, typical=1.0),
        Parameter(
            "w_0", "rad/s", "angular velocity below which it goes smoothly to zero", low=0.0, default=1.0e-2
        ),
        Parameter(
            "anchor", "m", "where the rod hangs; the scene's pin where not given", size=2, default=AUTOMATIC
        ),
    ],
    strength=("torque",),
    candidate="named",
    refines=("pin",),
    form_of="joint_friction",
)
def pin_friction(x, y, vx, vy, torque, w_0, anchor_x, anchor_y):
    dx = x - anchor_x
    dy = y - anchor_y
    square = dx * dx + dy * dy
    rate = (dx * vy - dy * vx) / square
    size = math.sqrt(rate * rate + w_0 * w_0)
    if size == 0.0:
        return 0.0, 0.0
    push = -torque * rate / (size * square)
    return -push * dy, push * dx
