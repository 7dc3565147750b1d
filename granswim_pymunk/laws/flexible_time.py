"""The flexible arm in time: a frame that is shaken, with no name."""

from .base import Parameter, law

_KNOTS = [
    Parameter(f"{axis}{k}", "m/s^2", f"acceleration along {along} at {k}/7 of the span", default=0.0, typical=1.0)
    for axis, along in (("a", "x"), ("b", "y"))
    for k in range(8)
]


@law(
    kind="body",
    expression="F_i = m_i a(t), a piecewise linear through eight knots",
    reference="Hastie, Tibshirani & Friedman, The Elements of Statistical Learning, ch. 5 (linear splines)",
    parameters=[
        Parameter("begin", "s", "time of the first knot", default=0.0),
        Parameter("span", "s", "time from the first knot to the last", low=0.0, default=1.0),
        *_KNOTS,
    ],
    strength=tuple(p.name for p in _KNOTS),
    candidate="flexible",
)
def flexible_time(t, mass, begin, span, a0, a1, a2, a3, a4, a5, a6, a7, b0, b1, b2, b3, b4, b5, b6, b7):
    s = min(max(7.0 * (t - begin) / span, 0.0), 6.999999)
    k = int(s)
    w = s - k
    if k == 0:
        x, y = a0 + w * (a1 - a0), b0 + w * (b1 - b0)
    elif k == 1:
        x, y = a1 + w * (a2 - a1), b1 + w * (b2 - b1)
    elif k == 2:
        x, y = a2 + w * (a3 - a2), b2 + w * (b3 - b2)
    elif k == 3:
        x, y = a3 + w * (a4 - a3), b3 + w * (b4 - b3)
    elif k == 4:
        x, y = a4 + w * (a5 - a4), b4 + w * (b5 - b4)
    elif k == 5:
        x, y = a5 + w * (a6 - a5), b5 + w * (b6 - b5)
    else:
        x, y = a6 + w * (a7 - a6), b6 + w * (b7 - b6)
    return mass * x, mass * y
