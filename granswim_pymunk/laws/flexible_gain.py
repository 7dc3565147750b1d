"""A form without a name of a motor: a gain that depends on its command."""

import numpy as np

from .actuator_saturation import with_crossings
from .base import Parameter, law

LAST = 4
_KNOTS = [
    Parameter(
        f"w{k}", "1", f"what the answer has over the command at {k - LAST}/{LAST} of the largest one, in its size",
        default=0.0, typical=1.0,
    )
    for k in range(2 * LAST + 1)
]  # fmt: skip


def bent(t, value, top, **over):
    """A command that is followed as v = c + top W(c/top), W linear between nine knots from -1 to 1.

    t : (n,) float, times [s], rising;  value : (n,) float, command, linear between rows;  top : largest command
    over : w0 to w8, W at the knots
    Returns t and value (k,) of the answer, exact between rows: there is one wherever the command crosses a knot.
    """
    knots = top * np.arange(-LAST, LAST + 1) / LAST
    times, command = with_crossings(t, value, knots)
    return times, command + top * np.interp(command, knots, [over[p.name] for p in _KNOTS])


@law(
    kind="chain",
    expression="v = c + top W(c/top), W linear between nine knots from -1 to 1",
    reference="Ljung, System Identification, 2nd ed., ch. 5.1 (Hammerstein model)",
    parameters=[Parameter("top", "m/s", "largest command", low=0.0, default=1.0), *_KNOTS],
    strength=tuple(p.name for p in _KNOTS),
    candidate="flexible",
    phrase="a gain that depends on the command",
    refines=("drive",),
    series=bent,
)
def flexible_gain(command, top, w8):
    # of the largest command
    return command + top * w8
