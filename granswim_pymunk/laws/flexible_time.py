"""A form without a name in time: a frame that is shaken, with no name."""

from .base import Parameter, law

_KNOTS = [
    Parameter(f"{axis}{k}", "m/s^2", f"acceleration along {along} at {k}/7 of the span", default=0.0, typical=1.0)
    for axis, along in (("a", "x"), ("b", "y"))
    for k in range(8)
]


@law(
    kind="body",
    expression="F_i = m_i a(t), a piecewise linear through eight knots, none before the first and after the last",
    reference="Hastie, Tibshirani & Friedman, The Elements of Statistical Learning, ch. 5 (linear splines)",
    parameters=[
        Parameter("begin", "s", "time of the first knot", default=0.0),
        Parameter("span", "s", "time from the first knot to the last", low=0.0, default=1.0),
        *_KNOTS,
    ],
    strength=tuple(p.name for p in _KNOTS),
    candidate="flexible",
    phrase="a push that changes in time",
)
def flexible_time(t, mass, begin, span, a0, a1, a2, a3, a4, a5, a6, a7, b0, b1, b2, b3, b4, b5, b6, b7):
    s = 7.0 * (t - begin) / span
    x = 0.0
    y = 0.0
    # what nobody saw is not drawn out
    if s < 0.0 or s > 7.0:
        return x, y
    for k, knot in enumerate(((a0, b0), (a1, b1), (a2, b2), (a3, b3), (a4, b4), (a5, b5), (a6, b6), (a7, b7))):
        hat = max(1.0 - abs(s - k), 0.0)
        x += hat * knot[0]
        y += hat * knot[1]
    return mass * x, mass * y
