"""A form without a name in speed: a drag curve with no name."""

import math

from .base import Parameter, law

_RATES = [
    Parameter(f"c{k}", "kg/s", f"drag rate at {k}/4 of the top speed", default=0.0, typical=1.0) for k in range(5)
]


@law(
    kind="body",
    expression="F_i = -c(|v_i|) v_i, c piecewise linear through five knots",
    reference="Hastie, Tibshirani & Friedman, The Elements of Statistical Learning, ch. 5 (linear splines)",
    parameters=[Parameter("top", "m/s", "speed of the last knot", low=0.0, default=1.0), *_RATES],
    strength=("c0", "c1", "c2", "c3", "c4"),
    candidate="flexible",
    role="speed",
    phrase="a drag that depends on the speed",
)
def flexible_speed(vx, vy, top, c0, c1, c2, c3, c4):
    s = min(4.0 * math.sqrt(vx * vx + vy * vy) / top, 3.999999)
    k = int(s)
    w = s - k
    if k == 0:
        rate = c0 + w * (c1 - c0)
    elif k == 1:
        rate = c1 + w * (c2 - c1)
    elif k == 2:
        rate = c2 + w * (c3 - c2)
    else:
        rate = c3 + w * (c4 - c3)
    return -rate * vx, -rate * vy
