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
    """The frequency at which cosine and sine in each coordinate gain most, see ``lines``; None where none could be."""
    return next(iter(lines(fit, cases)), None)


def lines(fit: Fit, cases: Sequence[Case], most: int = 1) -> list[Line]:
    """Frequencies at which cosine and sine in each coordinate gain most, by least squares, the strongest first.

    ``most`` of them, each a width of a line from the others; none where none could be.

    Of n numbers with the Fourier sum F they gain 2 |F|^2/n: frames are laid on the grid of the shortest interval, where
    n log n steps do, and frames that are missing or late cost little. Of m frequencies looked at, chance gains 2 ln m
    and AIC of two numbers a coordinate. Fewer than two periods are no oscillation. Free numbers stay where they are, so
    that the gain is the least that it may be. Source: Schuster 1898, Terrestrial Magnetism 3, 13.
    """
    series = []  # times from the first, innovations
    for case in cases:
        for channel in fit.white[case.name].T:
            seen = np.isfinite(channel)
            if seen.sum() >= current().left.periodic:
                series.append((case.t[seen] - case.t[seen][0], channel[seen]))
    if not series:
        return []
    longest = max(float(t[-1]) for t, _ in series)
    step = min(float(np.median(np.diff(t))) for t, _ in series)
    size = 4 * (round(longest / step) + 1)  # four points a line's width
    frequencies = np.fft.rfftfreq(size, step)
    gains = np.zeros(len(frequencies))
    for t, r in series:
        laid = np.bincount(np.round(t / step).astype(int), weights=r, minlength=size)
        gains += 2 * np.abs(np.fft.rfft(laid)) ** 2 / len(r)
    several = frequencies >= 2 / longest
    found, open_ = list[Line](), np.where(several, gains, 0.0)
    while len(found) < most and open_.any():
        best = int(np.argmax(open_))
        paid = float(gains[best]) - 2 * math.log(several.sum()) - 4 * len(series)
        found.append(Line(float(frequencies[best]), float(gains[best]), paid))
        open_[max(best - 4, 0) : best + 5] = 0.0
    return found
