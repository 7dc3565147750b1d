"""Dry friction in a pin or hinge."""

import math

from .base import Parameter, law


@law(
    kind="joint",
    expression="torque on b = -M w/sqrt(w^2 + w_0^2), the opposite on a; w = w_b - w_a, in a pin or a hinge of one "
    "body its angular velocity",
    reference="Coulomb 1785, Theorie des machines simples",
    parameters=[
        Parameter("torque", "N m", "friction torque M", low=0.0, typical=1.0),
        Parameter(
            "w_0", "rad/s", "angular velocity below which it goes smoothly to zero", low=0.0, default=1.0e-2
        ),
    ],
    strength=("torque",),
    candidate="named",
    refines=("hinge", "pin"),
    form_of="joint_friction",
    preferred_where=("hinge", "pin"),
    stands_for=("coulomb_substrate",),
)
def pin_friction(rate, torque, w_0):
    size = math.sqrt(rate * rate + w_0 * w_0)
    if size == 0.0:
        return 0.0
    return -torque * rate / size
