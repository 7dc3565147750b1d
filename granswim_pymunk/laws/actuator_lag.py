"""A motor that lags behind its command."""

import math

import numpy as np

from .base import Parameter, law
from .bending import of_bending

STEPS_PER_TAU = 50  # of the followed series, where it is not a straight line
MOST_ROWS = 500_000


def lagging(t, value, tau):
    """What follows a command by tau dx/dt = command - x, at rest at the first row.

    t : (n,) float, times [s], rising;  value : (n,) float, command, linear between rows
    Returns t and value (k,) of the answer: exact at its rows, which lie close enough for straight lines
    between them (1/50 of tau, as long as they are not more than half a million).
    """
    t, value = np.asarray(t, dtype=float), np.asarray(value, dtype=float)
    if tau <= 0.0 or len(t) < 2:
        return t, value
    # after the last row the command is held: the answer is followed until it has come there
    t = np.append(t, t[-1] + 20.0 * tau)
    value = np.append(value, value[-1])
    step = max(tau / STEPS_PER_TAU, (t[-1] - t[0]) / MOST_ROWS)
    times, answers = [t[:1]], [value[:1]]
    behind = 0.0  # answer less command at the start of a piece
    for k in range(len(t) - 1):
        width = t[k + 1] - t[k]
        s = np.linspace(0.0, width, max(int(np.ceil(width / step)), 1) + 1)[1:]
        s[-1] = width
        slope = (value[k + 1] - value[k]) / width
        error = -slope * tau + (behind + slope * tau) * np.exp(-s / tau)
        times.append(t[k] + s)
        answers.append(value[k] + slope * s + error)
        behind = error[-1]
    return np.concatenate(times), np.concatenate(answers)


@law(
    kind="chain",
    expression="tau dtheta/dt = command - theta, theta(0) = command(0); the same for a driven velocity",
    reference="Franklin, Powell & Emami-Naeini, Feedback Control of Dynamic Systems, ch. 3 (first-order lag)",
    parameters=[
        Parameter("tau", "s", "time constant of the lag", low=0.0, typical=1.0e-3, in_bed=2e-3),
        *of_bending("stiffness", "amplitude", "frequency", "phase", "form", "length"),
    ],
    strength=("tau",),
    candidate="named",
    phrase="a lag of the actuator",
    refines=("bending", "drive"),
    series=lagging,
    role="late",
)
def actuator_lag(t, command, tau, amplitude, frequency, phase):
    if tau <= 0.0 or t <= 0.0:
        return command
    # the steady answer to a sine, and what is left of the start
    turning = 2.0 * math.pi * frequency
    late = math.atan(turning * tau)
    gain = amplitude * math.cos(late)
    left = amplitude * math.sin(phase) - gain * math.sin(phase - late)
    return gain * math.sin(turning * t + phase - late) + left * math.exp(-t / tau)
