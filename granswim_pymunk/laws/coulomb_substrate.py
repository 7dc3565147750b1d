"""Dry friction against the substrate."""

import math

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = -mu m_i g v_i/|v_i|, smooth below v_0: v/sqrt(v^2 + v_0^2)",
    reference="Coulomb 1785, Theorie des machines simples",
    parameters=[
        Parameter("mu", "1", "friction coefficient", low=0.0, typical=0.1, in_bed=0.03),
        Parameter("v_0", "m/s", "speed below which the force goes smoothly to zero", low=0.0, default=1.0e-3),
    ],
    strength=("mu",),
    candidate="named",
    phrase="dry friction with the substrate",
    apart=True,
)
def coulomb_substrate(vx, vy, mass, g, mu, v_0):
    speed = math.sqrt(vx * vx + vy * vy + v_0 * v_0)
    if speed == 0.0:
        return 0.0, 0.0
    rate = mu * mass * g / speed
    return -rate * vx, -rate * vy
