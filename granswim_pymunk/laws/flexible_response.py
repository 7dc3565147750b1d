"""A form without a name of a motor: whatever it answers to a step of its command."""

import numpy as np

from .base import Parameter, law

GROWS = 1.6  # each time between two knots over the one before
LAST = 7
FINE = 2  # straight lines in the least time between two knots
STEP = 0.01  # of that time, in which a command changes at once
MOST_ROWS = 100_000
AT = (GROWS ** np.arange(LAST + 1) - 1) / (GROWS**LAST - 1)

_KNOTS = [
    Parameter(
        f"w{k}", "1", f"what the answer to a step of 1 has over it after {at:.4f} of the span",
        default=0.0, typical=1.0,
    )
    for k, at in enumerate(AT)
]  # fmt: skip


def answering(t, value, span, *over, **named):
    """What follows a command with a free answer R(s) to a step, linear between knots and 1 + w_7 after the last.

    v(t) = R(0) c(t) + int_0^span R'(s) c(t - s) ds, c held at its first value before the first row.

    t : (n,) float, times [s], rising;  value : (n,) float, command, linear between rows;  span [s]
    over : (8,) w_k = R(s_k) - 1 (also as w0=..., w1=...)
    Returns t and value (k,) of the answer, close enough for straight lines between them.
    """
    t, value = np.asarray(t, dtype=float), np.asarray(value, dtype=float)
    w = np.array([*over] if over else [named[p.name] for p in _KNOTS], dtype=float)
    if not w.any() or len(t) < 2:
        return t, value
    knots = span * AT
    # c is held after its last row: the answer is followed until it has settled
    least = max(knots[1] / FINE, (t[-1] - t[0] + span) / MOST_ROWS)
    width = np.diff(t)
    at_once = t[1:][width < STEP * knots[1]][: MOST_ROWS // len(knots)]
    # what follows a command that changes slowly bends slowly, and bends sharply only where a knot comes after a step
    times = np.unique(np.concatenate([t, np.arange(t[0], t[-1] + span, least), *(at_once + s for s in knots)]))
    area = np.append(0.0, np.cumsum(0.5 * (value[1:] + value[:-1]) * width))
    slope = np.diff(value) / width

    def integral(at):
        k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
        s = np.clip(at - t[k], 0.0, t[k + 1] - t[k])
        inside = area[k] + value[k] * s + 0.5 * slope[k] * s * s
        return inside + np.minimum(at - t[0], 0.0) * value[0] + np.maximum(at - t[-1], 0.0) * value[-1]

    steps = np.diff([integral(times - s) for s in knots], axis=0)
    answer = (1.0 + w[0]) * np.interp(times, t, value) - (np.diff(w) / np.diff(knots)) @ steps
    return times, answer


@law(
    kind="chain",
    expression="v(t) = R(0) c(t) + int R'(s) c(t - s) ds, R the answer to a step, linear between eight knots",
    reference="Ljung, System Identification, 2nd ed., ch. 6.1 (step response)",
    parameters=[Parameter("span", "s", "time after a step when the answer has settled", low=0.0, default=1.0), *_KNOTS],
    strength=tuple(p.name for p in _KNOTS),
    candidate="flexible",
    phrase="another answer to the command",
    refines=("drive",),
    series=answering,
)
def flexible_response(command, w7):
    # of a command that is held
    return command * (1.0 + w7)
