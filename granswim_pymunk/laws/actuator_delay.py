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
        Parameter("tau", "s", "delay", low=0.0, typical=1.0e-3),
        *of_bending("stiffness", "amplitude", "frequency", "phase", "form", "length"),
    ],
    strength=("tau",),
    candidate="named",
    phrase="a delay of the actuator",
    refines=("bending", "drive"),
    series=delayed,
)
def actuator_delay(t, x, y, fx, fy, tau, stiffness, amplitude, frequency, phase, form, length):
    turning = 2.0 * math.pi * frequency
    head = amplitude * math.sin(turning * t + phase)
    follows = amplitude * math.sin(turning * (t - tau) + phase)
    last = x.shape[0] - 1 if form == 2 else min(x.shape[0] - 1, 1)
    for i in range(last):
        j = i + 1
        dx = x[j] - x[i]
        dy = y[j] - y[i]
        distance = math.sqrt(dx * dx + dy * dy)
        angle = math.atan2(dy, dx)
        bend = angle - head
        bend -= 2.0 * math.pi * math.ceil((bend - math.pi) / (2.0 * math.pi))
        true_bend = angle - follows
        true_bend -= 2.0 * math.pi * math.ceil((true_bend - math.pi) / (2.0 * math.pi))
        force = -stiffness * (true_bend - bend) / distance
        if form == 1:
            force *= length / distance
        fx[j] -= force * dy
        fy[j] += force * dx
        fx[i] += force * dy
        fy[i] -= force * dx
