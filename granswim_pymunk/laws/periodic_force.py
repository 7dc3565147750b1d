"""A force that goes to and fro at one frequency: a table that is shaken, a motor or a fan beside the apparatus."""

import math

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = m_i (a cos 2 pi f t + b sin 2 pi f t)",
    reference="Rayleigh 1894, The Theory of Sound, vol. 1, ch. 3 (forced oscillations)",
    parameters=[
        Parameter("a", "m/s^2", "acceleration in phase with the clock", size=2, typical=1.0),
        Parameter("b", "m/s^2", "acceleration a quarter of a period later", size=2, default=(0.0, 0.0), typical=1.0),
        Parameter("f", "Hz", "frequency", low=0.0, typical=1.0),
    ],
    strength=("a", "b"),
    phrase="a periodic force",
    role="beat",
)
def periodic_force(t, mass, a_x, a_y, b_x, b_y, f):
    c = mass * math.cos(2.0 * math.pi * f * t)
    s = mass * math.sin(2.0 * math.pi * f * t)
    return c * a_x + s * b_x, c * a_y + s * b_y
