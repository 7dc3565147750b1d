"""Angles over whole turns."""

from __future__ import annotations

import numpy as np

# of a turn, by which angles that were written within one may reach beyond it: rounding
BEYOND = 1e-3


def continuous(angle: np.ndarray) -> np.ndarray:
    """Angles (T,) [rad] over time, none of them NaN, without jumps of whole turns.

    What was written within one turn jumps where it leaves it. What goes beyond one counts its turns already: it stays
    as it is, so that a wheel of which one sees each half turn is not turned back by rounding.
    """
    if len(angle) == 0 or np.ptp(angle) > 2 * np.pi * (1 + BEYOND):
        return np.array(angle, dtype=float)
    return np.unwrap(angle)
