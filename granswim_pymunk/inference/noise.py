"""The noise of a recording: white, with a slow part, and single outliers; and whether what is left passes for it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from ..compiled import njit
from .criteria import NoiseCriteria, current


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


@njit()
def _filter(series, frames, size, memory, back, out):
    """Kalman filter of white noise of unit size and an autoregressive process of first order beside it.

    series, out (n, c), NaN where not seen; frames (n,) their numbers. ``back``: from the whitened series to the series.
    Returns half the logarithm of the determinant of the covariance, summed over all columns.
    """
    total = 0.0
    for c in range(series.shape[1]):
        mean, variance, last = 0.0, size * size, frames[0]
        for k in range(series.shape[0]):
            out[k, c] = np.nan
            value = series[k, c]
            if math.isnan(value):
                continue
            kept = math.exp(-(frames[k] - last) / memory)
            mean *= kept
            variance = kept * kept * variance + size * size * (1.0 - kept * kept)
            last = frames[k]
            root = math.sqrt(1.0 + variance)
            error = value * root if back else value - mean
            out[k, c] = mean + error if back else error / root
            total += math.log(root)
            gain = variance / (1.0 + variance)
            mean += gain * error
            variance *= 1.0 - gain
    return total


def whitened(series: np.ndarray, frames: np.ndarray, noise: Noise) -> tuple[np.ndarray, float]:
    """One-step prediction errors over their spread, and ln det C / 2 of what was seen.

    series : (n, ...) in units of the white part, NaN where not seen;  frames : (n,) their numbers, gaps included
    For noise of covariance C = 1 + s^2 exp(-|i - j|/memory) the sum of squares is r' C^-1 r, so that least squares in
    them is generalised least squares. Source: Harvey 1989, Forecasting, Structural Time Series Models and the Kalman
    Filter, ch. 3.
    """
    if noise.size == 0.0:
        return series, 0.0
    flat = np.ascontiguousarray(series.reshape(len(series), -1), dtype=float)
    out = np.empty_like(flat)
    half = _filter(flat, np.asarray(frames, dtype=float), noise.size, noise.memory, False, out) if flat.size else 0.0
    return out.reshape(series.shape), float(half)


def coloured(series: np.ndarray, frames: np.ndarray, noise: Noise) -> np.ndarray:
    """The series (n, ...) that ``whitened`` makes this one of."""
    if noise.size == 0.0:
        return series
    flat = np.ascontiguousarray(series.reshape(len(series), -1), dtype=float)
    out = np.empty_like(flat)
    if flat.size:
        _filter(flat, np.asarray(frames, dtype=float), noise.size, noise.memory, True, out)
    return out.reshape(series.shape)


def slopes(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Rates of change (T, c) of values (T, c) [1/s] by lines through seven sightings, 0 where too few were seen."""
    found = np.zeros(values.shape)
    for c in range(values.shape[1]):
        seen = np.flatnonzero(np.isfinite(values[:, c]))
        if len(seen) < current().stamps.sightings:
            continue
        window = np.lib.stride_tricks.sliding_window_view
        s, v = window(t[seen], current().stamps.sightings), window(values[seen, c], current().stamps.sightings)
        s = s - s.mean(axis=1, keepdims=True)
        slope = np.sum(s * v, axis=1) / np.sum(s**2, axis=1)
        middle = t[seen][current().stamps.sightings // 2 : len(seen) - current().stamps.sightings // 2]
        found[:, c] = np.interp(t, middle, slope)
    return found


def timing(
    t: np.ndarray, values: np.ndarray, sigma: np.ndarray, stated: float | None = None
) -> tuple[float, float]:
    """Error of the stamps [s], one standard deviation, and by how much the white noise is larger than sigma (c,).

    values : (T, c). A stamp that is off by d moves all bodies of its frame along their ways by v d: the covariance of a
    frame is a^2 diag(sigma^2) + tau^2 v v'. Both by maximum likelihood with Student's t, from what polynomials of fifth
    degree over nine frames leave of their middle. 0 and 1 where no timing error shows.
    """
    width = 9
    if len(t) < max(current().stamps.frames, width):
        return (stated or 0.0), 1.0
    window = np.lib.stride_tricks.sliding_window_view
    s = window(t, width) - t[width // 2 : len(t) - width // 2, None]
    left = np.full(values.shape, np.nan)
    design = np.power((s / np.maximum(np.ptp(s, axis=1, keepdims=True), 1e-300))[..., None], np.arange(6))
    q, _ = np.linalg.qr(design)
    keep = 1.0 - np.sum(q[:, width // 2, :] ** 2, axis=1)
    inside = slice(width // 2, len(t) - width // 2)
    for c in range(values.shape[1]):
        v = window(values[:, c], width)
        fitted = np.einsum("wk,wlk,wl->w", q[:, width // 2, :], q, v)
        left[inside, c] = (values[inside, c] - fitted) / np.sqrt(np.maximum(keep, 1e-6)) / sigma[c]
    along = slopes(t, values) / sigma
    seen = np.isfinite(left)
    rows = seen.any(axis=1)
    if rows.sum() < current().stamps.frames // 2:
        return (stated or 0.0), 1.0
    left, along, seen = np.where(seen, left, 0.0)[rows], np.where(seen, along, 0.0)[rows], seen[rows]
    count = seen.sum(axis=1)
    squares, inner, speed = np.sum(left**2, axis=1), np.sum(left * along, axis=1), np.sum(along**2, axis=1)

    def loss(a: float, tau: float) -> float:
        inflated = a**2 + tau**2 * speed
        distance = (squares - tau**2 * inner**2 / inflated) / a**2
        half = 2 * (count - 1) * math.log(a) + np.log(inflated)
        return float(np.sum(half + (current().stamps.tail + count) * np.log1p(distance / current().stamps.tail)))

    # Student's t of unit scale is wider than the Gaussian that it stands for: the size that is likeliest is rescaled
    sizes = np.geomspace(0.2, 5.0, 41)
    alone = min(loss(float(a), 0.0) for a in sizes)
    fastest = math.sqrt(float(np.quantile(speed / count, 0.9)))
    if fastest <= 0:
        return 0.0, 1.0
    taus = np.geomspace(0.1, 100.0, 41) / fastest
    table = np.array([[loss(float(a), float(tau)) for tau in taus] for a in sizes])
    i, j = np.unravel_index(int(np.argmin(table)), table.shape)
    if stated:
        near = int(np.argmin(np.abs(np.log(taus * WIDER / stated))))
        if table[:, near].min() < table[i, j] + current().stamps.refuted:
            return stated, float(sizes[int(np.argmin(table[:, near]))]) * WIDER
    if table[i, j] > alone - current().stamps.sure:
        return 0.0, 1.0
    return float(taus[j]) * WIDER, float(sizes[i]) * WIDER


WIDER = 1.09  # scale of Student's t with six degrees of freedom that Gaussian noise is fitted by, the other way round


def periodogram(series: np.ndarray) -> np.ndarray:
    """|FFT|^2/n of a series (n,) at the frequencies 1/n to 1/2 per frame."""
    return np.asarray(np.abs(np.fft.rfft(series)[1 : len(series) // 2 + 1]) ** 2 / len(series))


def believable(fast: np.ndarray) -> float:
    """Mean of the fast halves of spectra, as far as it may be off from 1 and still be the noise."""
    off = current().noise.fast_off**2
    return float(np.clip(fast.mean(), 1 / off, off))


def _spectra(residuals: Sequence[np.ndarray]) -> list[tuple[np.ndarray, int]]:
    """Periodograms over the level of their fast half, which no fit of something slow has touched, and its size."""
    found = []
    for r in residuals:
        if len(r) < 12:
            continue
        power = periodogram(r)
        fast = power[len(power) // 2 :]
        level = believable(fast)
        found.append((power / level, len(fast)))
    return found


def fit_noise(residuals: Sequence[np.ndarray], criteria: NoiseCriteria | None = None) -> Noise:
    """The noise that makes residuals of several channels, in units of the white part, most likely.

    Only the slow part is looked for, within what the criteria let pass; the white part is known.
    -2 ln L = 2 sum(ln S + I/S) over frequencies (Whittle 1953, Ark. Mat. 2, 423).
    """
    criteria = criteria or current().noise
    series = [power for power, _ in _spectra(residuals)]
    if not series:
        return Noise()
    sizes = criteria.slow_most * np.array([0.0, 0.1, 0.2, 0.3, 0.45, 0.65, 0.85, 1.0])
    memories = np.geomspace(1.0, criteria.memory_most, 9)
    best, least = Noise(), math.inf
    for size in sizes:
        for memory in memories if size > 0 else memories[:1]:
            noise = Noise(float(size), float(memory))
            value = 0.0 if size == 0 else current().noise.two_numbers
            for power in series:
                expected = noise.spectrum(2 * len(power))[: len(power)]
                value += 2 * float(np.sum(np.log(expected) + power / expected))
            if value < least:
                best, least = noise, value
    return best


@dataclass(frozen=True)
class Seen:
    """Residuals of a recording and what was fitted to it, for the noise to be told from what fits have not taken away.

    residuals : (T, c) over the white part of the noise, NaN where not seen;  frames : (T,) their numbers
    by_value, by_start : (T, c, p), (T, c, q) derivatives of the prediction, in the same units
    ties : (m, p + q) derivatives of the steps between segments;  steps : (m,) these steps
    """

    residuals: np.ndarray
    frames: np.ndarray
    by_value: np.ndarray
    by_start: np.ndarray
    ties: np.ndarray
    steps: np.ndarray


def slow_part(recordings: Sequence[Seen], criteria: NoiseCriteria | None = None) -> Noise:
    """The slow part of the noise, within what the criteria let pass, by restricted maximum likelihood.

    -2 ln L = ln det C + ln det(J' C^-1 J) + r' C^-1 r - r' C^-1 J (J' C^-1 J)^-1 J' C^-1 r: a fit of J takes the
    slowest noise away, which is counted as not seen. Source: Patterson & Thompson 1971, Biometrika 58, 545.
    """
    criteria = criteria or current().noise
    levelled = [_levelled(seen) for seen in recordings]
    sizes = criteria.slow_most * np.array([0.2, 0.35, 0.5, 0.7, 0.85, 1.0])
    best, least = Noise(), _restricted(levelled, Noise()) - current().noise.two_numbers
    for size in sizes:
        for memory in np.geomspace(1.5, criteria.memory_most, 8):
            noise = Noise(float(size), float(memory))
            value = _restricted(levelled, noise)
            if value < least:
                best, least = noise, value
    return best


def _levelled(seen: Seen) -> Seen:
    """The same in units of the white part that the fast half of each channel's spectrum shows."""
    roots = np.ones(seen.residuals.shape[1])
    for c in range(len(roots)):
        column = seen.residuals[:, c]
        column = column[np.isfinite(column)]
        if len(column) >= 12:
            power = periodogram(column)
            roots[c] = math.sqrt(believable(power[len(power) // 2 :]))
    by = roots[:, None]
    return Seen(seen.residuals / roots, seen.frames, seen.by_value / by, seen.by_start / by, seen.ties, seen.steps)


def _restricted(recordings: Sequence[Seen], noise: Noise) -> float:
    """-2 ln of the restricted likelihood but for a constant; what hardly shows is held by a little beside it."""
    p = recordings[0].by_value.shape[-1]
    information, gradient, total = np.zeros((p, p)), np.zeros(p), 0.0
    for seen in recordings:
        every = np.concatenate([seen.residuals[..., None], seen.by_value, seen.by_start], axis=-1)
        every[~np.isfinite(seen.residuals)] = np.nan
        white, half = whitened(every, seen.frames, noise)
        rows = white[np.isfinite(seen.residuals)]
        rows = np.vstack([rows, np.hstack([seen.steps[:, None], seen.ties])])
        total += 2 * half / every.shape[-1]
        r, values, starts = rows[:, 0], rows[:, 1 : p + 1], rows[:, p + 1 :]
        if starts.shape[1]:
            size = np.maximum(np.linalg.norm(seen.by_start.reshape(-1, starts.shape[1]), axis=0), 1e-300)
            starts = np.nan_to_num(starts / np.where(np.isfinite(size), size, 1.0))
            inner = starts.T @ starts + 1e-10 * np.eye(starts.shape[1])
            total += float(np.linalg.slogdet(inner)[1])
            solved = np.linalg.solve(inner, starts.T @ np.column_stack([r, values]))
            left = np.column_stack([r, values]) - starts @ solved
            r, values = left[:, 0], left[:, 1:]
        total += float(r @ r)
        information += values.T @ values
        gradient += values.T @ r
    if p:
        size = np.sqrt(sum(np.nansum(s.by_value**2, axis=(0, 1)) for s in recordings))
        size = np.where(size > 0, size, 1.0)
        scaled = information / np.outer(size, size) + 1e-10 * np.eye(p)
        total += float(np.linalg.slogdet(scaled)[1])
        total -= float((gradient / size) @ np.linalg.solve(scaled, gradient / size))
    return total


def chance_of(residuals: Sequence[np.ndarray], noise: Noise) -> float:
    """Probability that this noise looks as large as these residuals at low frequencies.

    I/S is exponential at each frequency, so that the mean over low ones against that over the fast half has the F
    distribution. The least of these probabilities over several bands, times their number.
    """
    spectra = [(power / noise.spectrum(2 * len(power))[: len(power)], fast) for power, fast in _spectra(residuals)]
    if not spectra:
        return 1.0
    half = max(len(power) - fast for power, fast in spectra)
    bands = [m for m in current().noise.bands if m < half] + [half]
    told = sum(fast for _, fast in spectra)
    least = 1.0
    for m in bands:
        low = [power[: min(m, len(power) - fast)] for power, fast in spectra]
        count = sum(len(part) for part in low)
        ratio = sum(float(part.sum()) for part in low) / max(count, 1)
        least = min(least, float(stats.f.sf(ratio, 2 * count, 2 * told)))
    return min(1.0, least * len(bands))


def outliers(t: np.ndarray, values: np.ndarray, sigma: float, criteria: NoiseCriteria | None = None) -> np.ndarray:
    """(T,) True where a single sighting is off the line through the frames before it and off that through those after.

    t (T,) [s], values (T,), NaN where not seen. A kink, as in a collision, continues one of the two; a jump that
    stays continues the other.
    """
    criteria = criteria or current().noise
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

    The line's own curvature is allowed for by what lines leave among these frames. A frame among them that is itself
    far off the line through the others is left out, or it would hide one that is no position: not the nearest, which
    may have been struck with the one that is looked at.
    """
    result = np.full(len(t), np.nan)
    if len(t) <= k:
        return result
    window = np.lib.stride_tricks.sliding_window_view
    s, v = window(t, k)[:-1], window(values, k)[:-1]
    at, value = t[k:], values[k:]
    off, own = _off_line(s, v, at, value, sigma)
    for j in range(k - 1):
        others = [m for m in range(k) if m != j]
        alone, less = _off_line(s[:, others], v[:, others], at, value, sigma)
        hidden = own > current().noise.hides**2 * less
        off, own = np.where(hidden, alone, off), np.where(hidden, less, own)
    result[k:] = off
    return result


def _off_line(
    s: np.ndarray, v: np.ndarray, at: np.ndarray, value: np.ndarray, sigma: float
) -> tuple[np.ndarray, np.ndarray]:
    """|value (n,) - line through v (n, k) at s (n, k), followed to ``at`` (n,)| over its standard deviation.

    Also the variance that lines leave among the frames themselves, at least that of the noise.
    """
    k = s.shape[1]
    mean_s, mean_v = s.mean(axis=1, keepdims=True), v.mean(axis=1, keepdims=True)
    power = np.sum((s - mean_s) ** 2, axis=1)
    slope = np.sum((s - mean_s) * (v - mean_v), axis=1) / power
    lever = at - mean_s[:, 0]
    left = v - mean_v - slope[:, None] * (s - mean_s)
    own = np.maximum(np.sum(left**2, axis=1) / max(k - 2, 1), sigma**2)
    spread = np.sqrt(own * (1 + 1 / k + lever**2 / power))
    return np.abs(value - mean_v[:, 0] - slope * lever) / spread, own
