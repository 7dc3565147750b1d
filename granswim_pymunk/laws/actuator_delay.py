"""A motor that does what it is told some time later."""

import math

import numpy as np

from .base import Parameter, law
from .bending import of_bending


def delayed(t, value, tau):
    """A command series some time later: t (n,) [s] and value (n,); before, the first value holds."""
    return np.asarray(t, dtype=float) + tau, np.asarray(value, dtype=float)


@law(
    kind="chain",
    expression="theta(t) = command(t - tau); the same for a driven velocity",
    reference="Franklin, Powell & Emami-Naeini, Feedback Control of Dynamic Systems, ch. 5 (time delay)",
    parameters=[
        Parameter("tau", "s", "delay", low=0.0, typical=1.0e-3, in_bed=2e-3),
        *of_bending("stiffness", "amplitude", "frequency", "phase", "form", "length"),
    ],
    strength=("tau",),
    candidate="named",
    phrase="a delay of the actuator",
    refines=("bending", "drive"),
    series=delayed,
    role="late",
    same_as=("time_offset",),
)
def actuator_delay(t, tau, amplitude, frequency, phase):
    return amplitude * math.sin(2.0 * math.pi * frequency * (t - tau) + phase)
