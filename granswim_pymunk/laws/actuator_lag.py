"""A motor that lags behind its command."""

import math

import numpy as np

from .base import Parameter, law
from .bending import of_bending

STEPS_PER_TAU = 100  # of the followed series where it bends most, at the start of a piece
MOST_ROWS = 500_000


def lagging(t, value, tau):
    """What follows a command by tau dx/dt = command - x, at rest at the first row.

    t : (n,) float, times [s], rising;  value : (n,) float, command, linear between rows
    Returns t and value (k,) of the answer: exact at its rows, which lie close enough for straight lines
    between them. Between two rows of the command it nears a line as exp(-s/tau), and a row each tau/100 exp(s/(2 tau))
    keeps straight lines as near throughout: 200 rows at the most, however long that takes.
    """
    t, value = np.asarray(t, dtype=float), np.asarray(value, dtype=float)
    if tau <= 0.0 or len(t) < 2:
        return t, value
    # after the last row the command is held: the answer is followed until it has come there
    t = np.append(t, t[-1] + 20.0 * tau)
    value = np.append(value, value[-1])
    width = np.diff(t)
    slope, decay = np.diff(value) / width, np.exp(-width / tau)
    # off the line that it nears, at the start of each piece
    off, behind = np.empty(len(width)), 0.0
    for k, (steep, left) in enumerate(zip((slope * tau).tolist(), decay.tolist(), strict=True)):
        off[k] = behind + steep
        behind = off[k] * left - steep
    way = -np.expm1(-width / (2.0 * tau))
    rows = np.where(off != 0.0, np.ceil(2.0 * STEPS_PER_TAU * way), 1.0)
    rows = rows.clip(1, max(MOST_ROWS // len(t), 1)).astype(int)
    piece = np.repeat(np.arange(len(rows)), rows)
    row = np.arange(1, len(piece) + 1) - np.repeat(np.cumsum(rows) - rows, rows)
    last = row == rows[piece]
    s = -2.0 * tau * np.log1p(-way[piece] * np.where(last, 0.0, row / rows[piece]))
    s[last] = width
    answer = value[piece] + slope[piece] * (s - tau) + off[piece] * np.exp(-s / tau)
    return np.append(t[0], np.where(last, t[piece + 1], t[piece] + s)), np.append(value[0], answer)


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
