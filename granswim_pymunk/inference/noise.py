"""The noise of a recording: white, with a slow part, and single outliers; and whether what is left passes for it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from .criteria import DEFAULT, NoiseCriteria

BANDS = (4, 12, 40)  # lowest frequencies that are summed, beside the lower half: physics that was left out is slow
TRUSTED = 1.5  # by how much the fast half of a spectrum may differ from the noise that was believed and still be it


@dataclass(frozen=True)
class Noise:
    """Noise of one channel in units of its white part: seen = true + white + slow.

    size : of the slow part;  memory : frames after which its correlation has fallen to 1/e
    """

    size: float = 0.0
    memory: float = 1.0

    def spectrum(self, n: int) -> np.ndarray:
        """Expected periodogram |FFT|^2/n at the frequencies 1/n ... of a series of n frames.

        White noise and an autoregressive process of first order: 1 + s^2 (1 - rho^2)/(1 - 2 rho cos w + rho^2).
        Source: Priestley 1981, Spectral Analysis and Time Series, ch. 3.
        """
        w = 2 * np.pi * np.arange(1, n // 2 + 1) / n
        rho = math.exp(-1.0 / self.memory)
        return 1.0 + self.size**2 * (1 - rho**2) / (1 - 2 * rho * np.cos(w) + rho**2)

    def draw(self, shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
        """Noise (T, ...), independent along all axes but the first."""
        white = rng.normal(size=shape)
        if self.size == 0.0:
            return white
        rho = math.exp(-1.0 / self.memory)
        steps = rng.normal(size=shape) * math.sqrt(1 - rho**2)
        slow = np.empty(shape)
        slow[0] = rng.normal(size=shape[1:])
        for k in range(1, shape[0]):
            slow[k] = rho * slow[k - 1] + steps[k]
        return white + self.size * slow


def periodogram(series: np.ndarray) -> np.ndarray:
    """|FFT|^2/n of a series (n,) at the frequencies 1/n to 1/2 per frame."""
    return np.asarray(np.abs(np.fft.rfft(series)[1 : len(series) // 2 + 1]) ** 2 / len(series))


def _spectra(residuals: Sequence[np.ndarray]) -> list[tuple[np.ndarray, int]]:
    """Periodograms over the level of their fast half, which no fit of something slow has touched, and its size."""
    found = []
    for r in residuals:
        if len(r) < 12:
            continue
        power = periodogram(r)
        fast = power[len(power) // 2 :]
        level = float(np.clip(fast.mean(), 1 / TRUSTED**2, TRUSTED**2))
        found.append((power / level, len(fast)))
    return found


def fit_noise(residuals: Sequence[np.ndarray], criteria: NoiseCriteria = DEFAULT.noise) -> Noise:
    """The noise that makes residuals of several channels, in units of the white part, most likely.

    Only the slow part is looked for, within what the criteria let pass; the white part is known.
    -2 ln L = 2 sum(ln S + I/S) over frequencies (Whittle 1953, Ark. Mat. 2, 423).
    """
    series = [power for power, _ in _spectra(residuals)]
    if not series:
        return Noise()
    sizes = criteria.slow_most * np.array([0.0, 0.1, 0.2, 0.3, 0.45, 0.65, 0.85, 1.0])
    memories = np.geomspace(1.0, criteria.memory_most, 9)
    best, least = Noise(), math.inf
    for size in sizes:
        for memory in memories if size > 0 else memories[:1]:
            noise = Noise(float(size), float(memory))
            value = 0.0 if size == 0 else 4.0  # two more numbers (AIC)
            for power in series:
                expected = noise.spectrum(2 * len(power))[: len(power)]
                value += 2 * float(np.sum(np.log(expected) + power / expected))
            if value < least:
                best, least = noise, value
    return best


def chance_of(residuals: Sequence[np.ndarray], noise: Noise) -> float:
    """Probability that this noise looks as large as these residuals at low frequencies.

    I/S is exponential at each frequency, so that the mean over low ones against that over the fast half has the F
    distribution. The least of these probabilities over several bands, times their number.
    """
    spectra = [(power / noise.spectrum(2 * len(power))[: len(power)], fast) for power, fast in _spectra(residuals)]
    if not spectra:
        return 1.0
    half = max(len(power) - fast for power, fast in spectra)
    bands = [m for m in BANDS if m < half] + [half]
    told = sum(fast for _, fast in spectra)
    least = 1.0
    for m in bands:
        low = [power[: min(m, len(power) - fast)] for power, fast in spectra]
        count = sum(len(part) for part in low)
        ratio = sum(float(part.sum()) for part in low) / max(count, 1)
        least = min(least, float(stats.f.sf(ratio, 2 * count, 2 * told)))
    return min(1.0, least * len(bands))


def outliers(t: np.ndarray, values: np.ndarray, sigma: float, criteria: NoiseCriteria = DEFAULT.noise) -> np.ndarray:
    """(T,) True where a single sighting is off the line through the frames before it and off that through those after.

    t (T,) [s], values (T,), NaN where not seen. A kink, as in a collision, continues one of the two; a jump that
    stays continues the other.
    """
    found = np.zeros(len(t), dtype=bool)
    for _ in range(3):  # neighbours that are outliers themselves hide others
        seen = np.flatnonzero(np.isfinite(values) & ~found)
        k = criteria.outlier_frames
        if len(seen) < 2 * k + 1 or sigma <= 0:
            break
        before = _extrapolated(t[seen], values[seen], k, sigma)
        after = _extrapolated(-t[seen][::-1], values[seen][::-1], k, sigma)[::-1]
        off = np.minimum(np.where(np.isnan(before), after, before), np.where(np.isnan(after), before, after))
        new = seen[np.nan_to_num(off) > criteria.outlier]
        # of neighbours that accuse one another the worst goes first
        if len(new):
            strength = dict(zip(seen.tolist(), np.nan_to_num(off).tolist(), strict=True))
            new = np.array([r for r in new if strength[int(r)] >= max(strength.get(int(r) + d, 0.0) for d in (-1, 1))])
        if not len(new):
            break
        found[new] = True
    if found.sum() > criteria.share_most * np.isfinite(values).sum():
        return np.zeros(len(t), dtype=bool)
    return found


def _extrapolated(t: np.ndarray, values: np.ndarray, k: int, sigma: float) -> np.ndarray:
    """|value - line through the k frames before it| over its standard deviation, NaN for the first k.

    The line's own curvature is allowed for by what lines leave among these frames.
    """
    result = np.full(len(t), np.nan)
    if len(t) <= k:
        return result
    window = np.lib.stride_tricks.sliding_window_view
    s, v = window(t, k)[:-1], window(values, k)[:-1]
    at, value = t[k:], values[k:]
    mean_s, mean_v = s.mean(axis=1, keepdims=True), v.mean(axis=1, keepdims=True)
    power = np.sum((s - mean_s) ** 2, axis=1)
    slope = np.sum((s - mean_s) * (v - mean_v), axis=1) / power
    lever = at - mean_s[:, 0]
    left = v - mean_v - slope[:, None] * (s - mean_s)
    own = np.maximum(np.sum(left**2, axis=1) / max(k - 2, 1), sigma**2)
    spread = np.sqrt(own * (1 + 1 / k + lever**2 / power))
    result[k:] = np.abs(value - mean_v[:, 0] - slope * lever) / spread
    return result
