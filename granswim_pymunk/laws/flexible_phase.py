"""A form without a name in the cycle: a drag that follows the phase of the drive and has no name."""

import math

from .base import Parameter, law

_RATES = [
    Parameter(name, "kg/s", f"drag rate times {what}", default=0.0, typical=1.0)
    for name, what in (("c0", "1"), ("a1", "cos p"), ("b1", "sin p"), ("a2", "cos 2p"), ("b2", "sin 2p"))
]


@law(
    kind="body",
    expression="F_i = -v_i (c_0 + a_1 cos p + b_1 sin p + a_2 cos 2p + b_2 sin 2p), p = 2 pi f t + phase",
    reference="Hastie, Tibshirani & Friedman, The Elements of Statistical Learning, ch. 5 (basis expansions)",
    parameters=[
        Parameter("frequency", "Hz", "frequency of the cycle", low=0.0),
        Parameter("phase", "rad", "phase at t = 0", default=0.0),
        *_RATES,
    ],
    strength=tuple(p.name for p in _RATES),
    candidate="flexible_cycle",
    role="cycle",
)
def flexible_phase(t, vx, vy, frequency, phase, c0, a1, b1, a2, b2):
    p = 2.0 * math.pi * frequency * t + phase
    rate = c0 + a1 * math.cos(p) + b1 * math.sin(p) + a2 * math.cos(2.0 * p) + b2 * math.sin(2.0 * p)
    return -rate * vx, -rate * vy
