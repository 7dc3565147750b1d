"""Dry friction of the swimmer's joints."""

import math

from .base import Parameter, law
from .bending import of_bending


@law(
    kind="chain",
    expression="F_t = -F w/sqrt(w^2 + w_0^2) on i+1, the opposite on i; w = dphi_i/dt",
    reference="Coulomb 1785, Theorie des machines simples",
    parameters=[
        Parameter("force", "N", "friction force F of each joint", low=0.0, typical=1.0e-4, in_bed=2e-4),
        Parameter(
            "w_0", "rad/s", "rate of bending below which it goes smoothly to zero", low=0.0, default=1.0
        ),
        *of_bending("amplitude", "frequency", "phase", "form", "length"),
    ],
    strength=("force",),
    candidate="named",
    phrase="friction in the joints",
    refines=("bending",),
    damping=True,
)
def joint_friction(rate, force, w_0):
    size = math.sqrt(rate * rate + w_0 * w_0)
    return -force * rate / size if size > 0.0 else 0.0
