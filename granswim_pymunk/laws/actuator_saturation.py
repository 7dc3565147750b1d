"""A motor that stops at a limit."""

import numpy as np

from .base import Parameter, law
from .bending import of_bending

NO_LIMIT = 1.0e9


def with_crossings(t, value, edges):
    """A command series with a row wherever it crosses one of some values: t (k,) [s] and value (k,)."""
    t, value = np.asarray(t, dtype=float), np.asarray(value, dtype=float)
    extra = []
    for edge in edges:
        over = value > edge
        k = np.flatnonzero(over[1:] != over[:-1])
        extra.append(t[k] + (edge - value[k]) / (value[k + 1] - value[k]) * (t[k + 1] - t[k]))
    times = np.unique(np.concatenate([t, *extra]))
    return times, np.interp(times, t, value)


def clipped(t, value, limit):
    """A command series clipped at plus and minus ``limit``: t (k,) [s] and value (k,), exact between rows.

    Rows are added where the command crosses the limit.
    """
    times, command = with_crossings(t, value, (-limit, limit))
    return times, np.clip(command, -limit, limit)


@law(
    kind="chain",
    expression="theta = min(max(command, -limit), limit); the same for a driven velocity",
    reference="Franklin, Powell & Emami-Naeini, Feedback Control of Dynamic Systems, ch. 9 (saturation)",
    parameters=[
        Parameter(
            "limit",
            "rad or m/s",
            "largest size that the motor reaches",
            low=0.0,
            high=NO_LIMIT,
            typical=0.5,
            neutral=NO_LIMIT,
            within="amplitude",
        ),
        *of_bending("stiffness", "amplitude", "frequency", "phase", "form", "length"),
    ],
    strength=("limit",),
    candidate="named",
    phrase="a saturation of the actuator",
    refines=("bending", "drive"),
    series=clipped,
    role="limit",
)
def actuator_saturation(command, limit):
    return min(max(command, -limit), limit)
