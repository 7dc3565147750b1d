"""A motor that small commands do not move."""

import numpy as np

from .actuator_saturation import clipped
from .base import Parameter, law


def beyond(t, value, width):
    """What of a command series goes beyond plus and minus ``width``: t (k,) [s] and value (k,), exact between rows.

    Rows are added where the command crosses the edge.
    """
    times, inside = clipped(t, value, width)
    return times, np.interp(times, t, value) - inside


@law(
    kind="chain",
    expression="v = command - min(max(command, -width), width): none up to a width, less by it beyond",
    reference="Khalil, Nonlinear Systems, 3rd ed., ch. 1.2.7 (dead zone)",
    parameters=[
        Parameter("width", "m/s", "largest command that moves nothing", low=0.0, typical=0.05),
    ],
    strength=("width",),
    candidate="named",
    phrase="a dead band of the actuator",
    refines=("drive",),
    series=beyond,
    role="limit",
)
def actuator_deadband(command, width):
    return command - min(max(command, -width), width)
