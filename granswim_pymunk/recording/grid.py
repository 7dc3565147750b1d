"""Values that lie on a grid: whole pixels, counts of an encoder, readings that were rounded."""

from __future__ import annotations

import numpy as np

# of the usual step between stamps, by which steps of a clock that is read at even stations differ at least
UNEVEN = 1e-2


def least_step(values: np.ndarray, same: float = 1e-9) -> float:
    """The least difference between two of the values (T,) that are not the same, 0 where all are.

    Values that are not written more finely differ by no less. Pixels of a picture that was straightened lie on no grid.

    same : of their range, below which two are one that arithmetic has split
    """
    levels = np.unique(values)
    steps = np.diff(levels)
    steps = steps[steps > same * np.ptp(values)] if len(levels) > 1 else steps
    return float(steps.min()) if len(steps) else 0.0


def grid_of(values: np.ndarray, same: float = 1e-9, off: float = 0.01) -> float:
    """The step of the grid that all of the values (T,) lie on (whole pixels), 0 where they lie on none.

    Values that are written to few digits are off their grid by as much, and so is the least of their differences: each
    difference of neighbouring levels tells how many steps it is, and all of them together tell the step.

    same : as for ``least_step``;  off : of a step, by which none is farther off the grid
    """
    step = least_step(values, same)
    if not step:
        return 0.0
    levels = np.unique(values)
    away = levels - levels[0]
    count = np.cumsum(np.round(np.diff(away, prepend=0.0) / step))
    step = float(count @ away / (count @ count))
    return step if np.abs(away / step - count).max() < off else 0.0


def rounded_to(t: np.ndarray, values: np.ndarray, same: float = 1e-9, off: float = 0.01) -> float:
    """The step that values (T,) at t (T,) were rounded to, NaN where not seen: that of their grid, 0 of stations."""
    seen = np.isfinite(values)
    return 0.0 if stations(t[seen], values[seen], same) else grid_of(values[seen], same, off)


def stations(t: np.ndarray, values: np.ndarray, same: float = 1e-9) -> bool:
    """Whether values (T,) are even stations, and their stamps t (T,) when they were passed: splits, gates, an encoder.

    Each is then as far from the one before, all the same way, at uneven times. Such a step is no rounding: the clock is
    what has noise. A camera, whose places are rounded, sees its bodies go by one step in every frame by chance alone,
    and its stamps are even.
    """
    if len(values) < 4:
        return False
    steps, passed = np.diff(values), np.diff(t)
    even = np.ptp(steps) <= same * np.ptp(values) and steps[0] != 0
    return bool(even and np.ptp(passed) > UNEVEN * np.median(passed))
