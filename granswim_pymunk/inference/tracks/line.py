"""Whether what a fit leaves goes to and fro at one frequency: something shakes that the scene has not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..criteria import current
from ..data import Case
from .fitted import Fit


@dataclass(frozen=True)
class Line:
    """A harmonic motion in what is left. frequency [Hz];  gain : in chi2;  paid : the same less what chance gains."""

    frequency: float
    gain: float
    paid: float


def strongest_line(fit: Fit, cases: Sequence[Case]) -> Line | None:
    """The frequency at which cosine and sine in each coordinate gain most, by least squares; None where none could be.

    Of F frequencies looked at, chance gains 2 ln F and AIC of two numbers a coordinate. Fewer than two periods are no
    oscillation. Free numbers stay where they are, so that the gain is the least that it may be. Source: Lomb 1976,
    Astrophys. Space Sci. 39, 447.
    """
    from scipy.signal import lombscargle  # half a second, and asked only where something is left

    series = []  # times, innovations
    for case in cases:
        for channel in fit.white[case.name].T:
            seen = np.isfinite(channel)
            if seen.sum() >= current().left.periodic:
                series.append((case.t[seen], channel[seen]))
    if not series:
        return None
    longest = max(float(np.ptp(t)) for t, _ in series)
    top = 0.5 / min(float(np.median(np.diff(t))) for t, _ in series)
    frequencies = np.arange(2 / longest, top, 1 / (4 * longest))
    if not len(frequencies):
        return None
    # a periodogram is half of what least squares gain
    turning = 2 * math.pi * frequencies
    gains = np.sum([2 * lombscargle(t - t[0], r, turning) for t, r in series], axis=0)
    best = int(np.argmax(gains))
    paid = float(gains[best]) - 2 * math.log(len(frequencies)) - 4 * len(series)
    return Line(float(frequencies[best]), float(gains[best]), paid)
