"""Tracks that somebody smoothed: the noise of neighbouring frames is one, and only frames apart tell it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .criteria import current

Scatter = Callable[[np.ndarray, np.ndarray, float], float]


def frames_apart(t: np.ndarray, columns: Sequence[np.ndarray], scatter: Scatter) -> int:
    """How many frames apart the noise of two is independent: 1 where the tracks were not smoothed.

    t : (T,) [s];  columns : (T,) each, NaN where not seen;  scatter : white noise on a smooth curve, of (t, values)
    A filter leaves next to nothing of what neighbours differ by, from which white noise is told. Told from frames that
    are farther apart noise grows: at first like 1 - the correlation of neighbours, with at most the square of their
    distance, up to where that is as long as the filter, and not beyond. The slow noise of a camera, no larger than its
    white part, adds a half at the most. A motion that polynomials do not follow grows with a high power of the
    distance. Source: Savitzky & Golay 1964, Anal. Chem. 36, 1627, for the filter that most trackers offer.
    """
    c = current().smoothed
    t, columns = t[: c.rows], [column[: c.rows] for column in columns]
    apart = [s for s in c.apart if len(t) // s >= c.frames]
    moving = [k for k in columns if np.isfinite(k).mean() > c.seen and np.nanstd(k) > 0]
    moving = moving[:: max(len(moving) // c.columns, 1)]
    if len(apart) < 3 or not moving or _told(t, moving, [apart[0], apart[2]], scatter, c.shares[1])[1] < c.grown:
        return 1
    told = np.array([_told(t, moving, apart, scatter, share) for share in c.shares])
    grown = np.median(told, axis=0)
    beyond, further = np.maximum(grown**2 - 1.0, np.finfo(float).eps), np.diff(np.log(apart))
    # the power of the distance with which the square of what is added grows; in the first step, of all of it
    powers = np.diff(np.log(beyond)) / further
    powers[0] = np.log(grown[1] ** 2) / further[0]
    shown = [(k, np.isfinite(k)) for k in moving]
    # impacts are in some of the windows, noise is in all alike
    second, third = told[:, 1], told[:, 2]
    if second.min() < c.second or third.min() < c.grown or third.max() > c.alike * third.min():
        return 1
    if powers[:2].max() > c.power or powers[2:3].max(initial=0.0) > c.steep:
        return 1
    best = 1
    for k in range(2, len(apart)):
        if grown[k] < c.level * grown[best] or powers[k - 1] > c.power:
            break
        best = k
    # of a motion that is seen too seldom polynomials follow nothing, over few frames as over many
    sizes = [scatter(t[seen][:: apart[best]], k[seen][:: apart[best]], c.shares[1]) / np.nanstd(k) for k, seen in shown]
    return apart[best] if np.median(sizes) < c.of_motion else 1


def _told(
    t: np.ndarray, columns: Sequence[np.ndarray], apart: Sequence[int], scatter: Scatter, share: float
) -> np.ndarray:  # fmt: skip
    """(k,) noise told from frames so far ``apart`` over that from neighbours, the median of all columns."""
    told = []
    for column in columns:
        seen = np.isfinite(column)
        at, values = t[seen], column[seen]
        sizes = np.array([np.median([scatter(at[k::s], values[k::s], share) for k in range(s)]) for s in apart])
        told.append(sizes / sizes[0] if sizes[0] > 0 else np.ones(len(apart)))
    return np.asarray(np.median(told, axis=0))
