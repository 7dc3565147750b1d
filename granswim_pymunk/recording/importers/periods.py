"""The period of a swing, off one coordinate or an angle, and the rod that a point with that period hangs on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ellipk

CLEAR = 0.2  # of the swing, from which a side of its middle is one and no noise
INNER = (0.02, 0.98)  # quantiles between which it swings: single wrong points do not count
LATER = (0.5, 0.75)  # of a swing that slows down, from which on its passages may be even
CROSSINGS = 4  # passages through the middle: two tell half a period, and a middle that is off needs two more
EVEN = 0.1  # of half a period, to which the passages are even
ROUND = 0.9 * math.pi  # rad, of a swing that may go round


@dataclass(frozen=True)
class Swing:
    """period and its standard error [s]; middle and amplitude in the unit of what swings."""

    period: float
    error: float
    middle: float
    amplitude: float


def swing_of(t: np.ndarray, values: np.ndarray) -> Swing | None:
    """The swing of (k,) values at times t [s]; None where they do not pass their middle often and evenly enough.

    The passages lie at t_0 + k P/2 +- d, where d is of a middle that is off.
    """
    middle = float(np.quantile(values, INNER).mean()) if len(values) else math.nan
    away = values - middle
    clear = np.flatnonzero(np.abs(away) > CLEAR * np.quantile(np.abs(away), 0.95)) if len(values) else np.empty(0, int)
    turned = np.flatnonzero(np.diff(np.sign(away[clear])) != 0)
    if len(turned) < CROSSINGS:
        return None
    passed = np.array([_passage(t[clear[i] : clear[i + 1] + 1], away[clear[i] : clear[i + 1] + 1]) for i in turned])
    half = float(np.median(np.diff(passed)))
    # passages in frames that were lost are counted too
    number = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(np.diff(passed) / half), 1.0))])
    columns = np.stack([np.ones_like(number), number, np.where(number % 2, 1.0, -1.0)], axis=-1)
    numbers, *_ = np.linalg.lstsq(columns, passed, rcond=None)
    # three numbers of four passages leave hardly anything: no passage is told better than the frames tell it
    off = np.sum(np.square(passed - columns @ numbers)) / max(len(passed) - 3, 1)
    spread = math.sqrt(max(float(off), (0.1 * float(np.median(np.diff(t)))) ** 2))
    if not spread < EVEN * numbers[1]:
        return None
    error = 2 * spread * math.sqrt(np.linalg.pinv(columns.T @ columns)[1, 1])
    return Swing(2 * float(numbers[1]), error, middle, math.sqrt(2) * float(np.std(values)))


def last_swing_of(t: np.ndarray, values: np.ndarray) -> Swing | None:
    """``swing_of`` all values, or of later ones where those are not even: wide swings last longer than small ones."""
    begins = [int(share * len(values)) for share in (0.0, *LATER)]
    return next((swing for k in begins if (swing := swing_of(t[k:], values[k:])) is not None), None)


def _passage(t: np.ndarray, away: np.ndarray) -> float:
    """When the middle is passed, by a line through the places from the one clear side to the other."""
    return float(np.polyfit(away, t, 1)[1])


def rod_of(swing: Swing, gravity: float, *, across: bool) -> float:
    """Length [m] of the rod of a point with that period, P = 4 sqrt(L/g) K(sin^2(A/2)); nan where it may go round.

    gravity : m/s^2;  across : the swing is of a coordinate across gravity [m], A = asin(a/L), and not of an angle [rad]
    """
    length = gravity * (swing.period / (2 * math.pi)) ** 2
    for _ in range(20 if across else 1):
        angle = math.asin(min(swing.amplitude / length, 1.0)) if across else swing.amplitude
        if angle > (0.45 * math.pi if across else ROUND):
            return math.nan
        length = gravity * (swing.period / (4 * float(ellipk(math.sin(angle / 2) ** 2)))) ** 2
    return length
