"""The noise of a recording: white, with a slow part, and single outliers; and whether what is left passes for it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import distributions as stats
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
    n, width = series.shape
    # gains hang on which frames are seen alone: columns that follow one with the same ones share them
    of = np.zeros(width, dtype=np.int64)
    first = np.zeros(width, dtype=np.int64)
    groups = 0
    for c in range(width):
        same = c > 0
        for k in range(n if same else 0):
            if math.isnan(series[k, c]) != math.isnan(series[k, c - 1]):
                same = False
                break
        if not same:
            first[groups] = c
            groups += 1
        of[c] = groups - 1
    kept = np.ones((n, groups))
    root = np.ones((n, groups))
    gain = np.zeros((n, groups))
    for g in range(groups):
        variance, last = size * size, frames[0]
        for k in range(n):
            if math.isnan(series[k, first[g]]):
                continue
            lasts = math.exp(-(frames[k] - last) / memory)
            variance = lasts * lasts * variance + size * size * (1.0 - lasts * lasts)
            last = frames[k]
            kept[k, g], root[k, g], gain[k, g] = lasts, math.sqrt(1.0 + variance), variance / (1.0 + variance)
            variance *= 1.0 - gain[k, g]
    logs = np.log(root)
    total = 0.0
    for c in range(width):
        for k in range(n):
            total += logs[k, of[c]]
    mean = np.zeros(width)
    for k in range(n):
        for c in range(width):
            value = series[k, c]
            if math.isnan(value):
                out[k, c] = np.nan
                continue
            g = of[c]
            mean[c] *= kept[k, g]
            error = value * root[k, g] if back else value - mean[c]
            out[k, c] = mean[c] + error if back else error / root[k, g]
            mean[c] += gain[k, g] * error
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
    """Rates of change (T, c) of values (T, c) [1/s] by cubics through some sightings, 0 where too few were seen.

    A straight line through as many is steadier, but where a pendulum turns it points past the way that it takes.
    """
    found = np.zeros(values.shape)
    count = current().stamps.sightings
    window, half = np.lib.stride_tricks.sliding_window_view, count // 2
    for c in range(values.shape[1]):
        seen = np.flatnonzero(np.isfinite(values[:, c]))
        if len(seen) < count:
            continue
        s = window(t[seen], count)
        s = s - s[:, half : half + 1]
        span = np.maximum(np.abs(s).max(axis=1), 1e-300)
        design = np.power((s / span[:, None])[..., None], np.arange(4))
        fitted = np.einsum("wkl,wl->wk", np.linalg.pinv(design), window(values[seen, c], count))
        slope, at = fitted[:, 1] / span, t[seen][half : len(seen) - half]
        found[:, c] = np.interp(t, at, slope)
        for end, rows in ((0, t < at[0]), (-1, t > at[-1])):  # by the first and the last cubic
            x = (t[rows] - at[end]) / span[end]
            inside = np.clip(x, -1.0, 1.0)
            found[rows, c] = (fitted[end, 1:] @ np.array([x**0, 2 * inside, 3 * inside**2])) / span[end]
    return found


def timing(
    t: np.ndarray, values: np.ndarray, sigma: np.ndarray, stated: float | None = None, known: bool = True,
    smooth: np.ndarray | None = None,
) -> tuple[float, float]:  # fmt: skip
    """Error of the stamps [s], one standard deviation, and by how much the white noise is larger than sigma (c,).

    values : (T, c);  known : whether sigma was stated, and not told from these values;  smooth : (T,) mask of the
    frames about which nothing is hit: a kink of a path is no error of a stamp

    A stamp that is off by d moves all bodies of its frame along their ways by v d: the covariance of a frame is
    a^2 diag(sigma^2) + tau^2 v v'. Both by maximum likelihood with Student's t, from what polynomials of fifth degree
    over some frames leave of their middle. 0 and 1 where no timing error shows.
    """
    if len(t) < max(current().stamps.frames, current().stamps.window):
        return (stated or 0.0), 1.0
    left, spread = _left_of_middles(t, values, sigma)
    rows = np.flatnonzero(np.isfinite(left).any(axis=1) & (True if smooth is None else smooth))
    if len(rows) < current().stamps.frames // 2:
        return (stated or 0.0), 1.0
    rows = rows[:: -(-len(rows) // current().stamps.rows)]
    seen = np.isfinite(left[rows])
    count = seen.sum(axis=1)
    along, axes = np.linalg.eigh(spread[rows] * (seen[:, :, None] & seen[:, None]))
    along = np.maximum(along, 0.0)
    squares = np.einsum("kcd,kc->kd", axes, np.where(seen, left[rows], 0.0)) ** 2
    missing = seen.shape[1] - count
    off = math.log(current().stamps.stated_off if known else current().stamps.unstated_off)

    wider = current().stamps.scale  # Student's t of unit scale is wider than the Gaussian that it stands for

    def loss(a: float, tau: float) -> float:
        variances = a**2 + tau**2 * along
        half = np.sum(np.log(variances), axis=1) - 2 * missing * math.log(a)
        distance = np.sum(squares / variances, axis=1)
        told = half + (current().stamps.tail + count) * np.log1p(distance / current().stamps.tail)
        # where the stamps hide the white part, it is as large as was believed, within what that may be off
        return float(np.sum(told)) + (math.log(a * wider) / off) ** 2

    sizes = np.geomspace(0.02, 5.0, 70)
    alone = min(loss(float(a), 0.0) for a in sizes)
    fastest = math.sqrt(float(np.quantile(along.sum(axis=1) / count, 0.9)))
    if fastest <= 0:
        return 0.0, 1.0
    taus = np.geomspace(0.1, 100.0, 41) / fastest
    table = np.array([[loss(float(a), float(tau)) for tau in taus] for a in sizes])
    i, j = np.unravel_index(int(np.argmin(table)), table.shape)
    if stated:
        told = [loss(float(a), stated / wider) for a in sizes]
        if min(told) < table[i, j] + current().stamps.refuted:
            return stated, float(sizes[int(np.argmin(told))]) * wider
    # frames come in their order: what looks later is a motion that polynomials over so few frames do not follow
    most = current().stamps.most * float(np.median(np.diff(t)))
    if table[i, j] > alone - current().stamps.sure or taus[j] * wider > most:
        return 0.0, 1.0
    return float(taus[j]) * wider, float(sizes[i]) * wider


def _left_of_middles(t: np.ndarray, values: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What polynomials over some frames leave of their middle (T, c), and its covariance by stamps (T, c, c) [1/s^2].

    Both in units of the white part of what is left. With w the weights of the frames in it, sum w^2 of the noise
    is left; what a stamp does to each of them, not to the middle alone, counts as much: where a pendulum turns, the
    middle stands still, and its neighbours are late.
    """
    window, wide = np.lib.stride_tricks.sliding_window_view, current().stamps.window
    half = wide // 2
    s = window(t, wide) - t[half : len(t) - half, None]
    design = np.power((s / np.maximum(np.ptp(s, axis=1, keepdims=True), 1e-300))[..., None], np.arange(6))
    q, _ = np.linalg.qr(design)
    weights = np.eye(wide)[half] - np.einsum("wk,wlk->wl", q[:, half], q)
    weights /= np.sqrt(np.maximum(np.sum(weights**2, axis=1, keepdims=True), 1e-6))
    width = values.shape[1]
    left, spread = np.full(values.shape, np.nan), np.zeros((len(t), width, width))
    inside = slice(half, len(t) - half)
    along = slopes(t, values) / sigma
    for c in range(width):
        left[inside, c] = np.einsum("wl,wl->w", weights, window(values[:, c], wide)) / sigma[c]
    for k in range(wide):
        mine = along[k : len(t) - wide + 1 + k]
        spread[inside] += weights[:, k, None, None] ** 2 * mine[:, :, None] * mine[:, None]
    return left, spread


def periodogram(series: np.ndarray) -> np.ndarray:
    """|FFT|^2/n of a series (n,) at the frequencies 1/n to 1/2 per frame."""
    return np.asarray(np.abs(np.fft.rfft(series)[1 : len(series) // 2 + 1]) ** 2 / len(series))


def believable(fast: np.ndarray) -> float:
    """Mean of the fast halves of spectra, as far as it may be off from 1 and still be the noise."""
    off = current().noise.fast_off ** 2
    return float(np.clip(fast.mean(), 1 / off, off))


def _spectra(residuals: Sequence[np.ndarray]) -> list[tuple[np.ndarray, int]]:
    """Periodograms over the level of their fast half, which no fit of something slow has touched, and its size."""
    found = []
    for r in residuals:
        if len(r) < current().noise.spectrum:
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
    sizes = criteria.slow_most * np.array(criteria.sizes)
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
    best, least = Noise(), _restricted(levelled, Noise()).deviance - current().noise.two_numbers
    for noise in _slow_noises(criteria):
        value = _restricted(levelled, noise).deviance
        if value < least:
            best, least = noise, value
    return best


def _slow_noises(criteria: NoiseCriteria) -> list[Noise]:
    """Slow parts of all sizes and memories that pass for noise."""
    sizes = criteria.slow_most * np.array(criteria.slow)
    return [Noise(float(s), float(m)) for s in sizes for m in np.geomspace(1.5, criteria.memory_most, 8)]


@dataclass(frozen=True)
class LikelyNoise:
    """All noises that residuals may be, for replicates: a short film tells the slow part badly or not at all.

    noises, weights : as of ``averaged``
    """

    noises: tuple[Noise, ...]
    weights: np.ndarray

    @classmethod
    def of(cls, recordings: Sequence[Seen], criteria: NoiseCriteria | None = None) -> LikelyNoise:
        if not recordings:
            return cls((Noise(),), np.ones(1))
        noises, _, weights = _weighed(recordings, criteria or current().noise)
        return cls(noises, weights)

    def draw(self, shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
        """As ``Noise.draw``; each of the last axis has a noise of its own."""
        drawn, result = rng.choice(len(self.noises), size=shape[-1], p=self.weights), np.empty(shape)
        for k in np.unique(drawn):
            mine = drawn == k
            result[..., mine] = self.noises[k].draw((*shape[:-1], int(mine.sum())), rng)
        return result


def averaged(recordings: Sequence[Seen], criteria: NoiseCriteria | None = None) -> tuple[np.ndarray, np.ndarray]:
    """How far numbers move (p,), and their covariance (p, p), over all noises that these residuals may be.

    With b_i and V_i the estimate and covariance by generalised least squares for noise i, and w_i its weight, the mean
    is sum w_i b_i and the covariance sum w_i (V_i + (b_i - b)(b_i - b)'). Weights are the restricted likelihood times
    what is likely beforehand: a slow part or none, and all sizes and memories alike. V_i is larger where residuals are
    larger than that noise. Source: Hoeting et al. 1999, Statistical Science 14, 382.
    """
    told, weights = _weighed(recordings, criteria or current().noise)[1:]
    moved = np.array([t.moved for t in told])
    mean = weights @ moved
    within = np.einsum("i,ikl->kl", weights, np.array([t.covariance * max(t.size, 1.0) for t in told]))
    return mean, within + np.einsum("i,ik,il->kl", weights, moved - mean, moved - mean)


def squares_in_slow_noise(
    recordings: Sequence[Seen], criteria: NoiseCriteria | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """(m,) chi2 of what a fit leaves, first in white noise, then in each slow one, and which of these it excludes not.

    What was fitted is estimated again by generalised least squares, to first order. A noise is excluded where it is
    less likely than the likeliest by more than two numbers are by chance (``VerdictCriteria.alarm``).
    """
    told = [_restricted(recordings, noise) for noise in (Noise(), *_slow_noises(criteria or current().noise))]
    deviance = np.array([t.deviance for t in told])
    may_be = deviance < deviance.min() + stats.chi2.isf(current().verdict.alarm, 2)
    return np.array([t.squares for t in told]), may_be


def size_in(recordings: Sequence[Seen], noise: Noise) -> float:
    """Squares of what is left in a noise over their expectation, all that was fitted estimated again to first order."""
    return _restricted(recordings, noise).size


def drawn_noises(recordings: Sequence[Seen], rng: np.random.Generator, draws: int) -> list[Noise]:
    """Noises that these residuals may be, as often as each is likely (``averaged``)."""
    noises, _, weights = _weighed(recordings, current().noise)
    return [noises[k] for k in rng.choice(len(noises), size=draws, p=weights)]


def _weighed(
    recordings: Sequence[Seen], criteria: NoiseCriteria
) -> tuple[tuple[Noise, ...], list[Restricted], np.ndarray]:
    """Noises, what each makes of the residuals, and its weight, see ``averaged``."""
    levelled = [_levelled(seen) for seen in recordings]
    noises = (Noise(), *_slow_noises(criteria))
    told = [_restricted(levelled, noise) for noise in noises]
    prior = np.array([1.0] + [1.0 / (len(noises) - 1)] * (len(noises) - 1))
    deviance = np.array([t.deviance for t in told])
    weights = prior * np.exp(-(deviance - deviance.min()) / 2)
    return noises, told, weights / weights.sum()


def _levelled(seen: Seen) -> Seen:
    """The same in units of the white part that the fast half of each channel's spectrum shows."""
    roots = np.ones(seen.residuals.shape[1])
    for c in range(len(roots)):
        column = seen.residuals[:, c]
        column = column[np.isfinite(column)]
        if len(column) >= current().noise.spectrum:
            power = periodogram(column)
            roots[c] = math.sqrt(believable(power[len(power) // 2 :]))
    by = roots[:, None]
    return Seen(seen.residuals / roots, seen.frames, seen.by_value / by, seen.by_start / by, seen.ties, seen.steps)


@dataclass(frozen=True)
class Restricted:
    """What one noise makes of residuals.

    deviance : -2 ln of the restricted likelihood but for a constant;  moved : (p,) by generalised least squares
    covariance : (p, p) of these numbers;  size : of what is left, squared, over its expectation
    squares : chi2 of what is left, all that was fitted estimated again
    """

    deviance: float
    moved: np.ndarray
    covariance: np.ndarray
    size: float
    squares: float


def _restricted(recordings: Sequence[Seen], noise: Noise) -> Restricted:
    """What hardly shows is held by a little beside it."""
    p = recordings[0].by_value.shape[-1]
    information, gradient, total, squares, count = np.zeros((p, p)), np.zeros(p), 0.0, 0.0, -p
    for seen in recordings:
        every = np.concatenate([seen.residuals[..., None], seen.by_value, seen.by_start], axis=-1)
        every[~np.isfinite(seen.residuals)] = np.nan
        white, half = whitened(every, seen.frames, noise)
        rows = white[np.isfinite(seen.residuals)]
        rows = np.vstack([rows, np.hstack([seen.steps[:, None], seen.ties])])
        total += 2 * half / every.shape[-1]
        r, values, starts = rows[:, 0], rows[:, 1 : p + 1], rows[:, p + 1 :]
        count += len(r) - starts.shape[1]
        if starts.shape[1]:
            size = np.linalg.norm(seen.by_start.reshape(-1, starts.shape[1]), axis=0)
            # what no frame shows is known by its ties alone
            starts = np.nan_to_num(starts / np.where(np.isfinite(size) & (size > 0), size, 1.0))
            inner = starts.T @ starts + 1e-10 * np.eye(starts.shape[1])
            total += float(np.linalg.slogdet(inner)[1])
            solved = np.linalg.solve(inner, starts.T @ np.column_stack([r, values]))
            left = np.column_stack([r, values]) - starts @ solved
            r, values = left[:, 0], left[:, 1:]
        squares += float(r @ r)
        information += values.T @ values
        gradient += values.T @ r
    moved, covariance = np.zeros(p), np.zeros((p, p))
    if p:
        size = np.sqrt(sum(np.nansum(s.by_value**2, axis=(0, 1)) for s in recordings))
        size = np.where(size > 0, size, 1.0)
        scaled = information / np.outer(size, size) + 1e-10 * np.eye(p)
        total += float(np.linalg.slogdet(scaled)[1])
        moved = np.linalg.solve(scaled, gradient / size) / size
        squares -= float(gradient @ moved)
        covariance = np.linalg.inv(scaled) / np.outer(size, size)
    return Restricted(total + squares, moved, covariance, squares / max(count, 1), squares)


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


def outliers(
    t: np.ndarray, values: np.ndarray, sigma: float, smooth: np.ndarray | None = None,
    pressed: np.ndarray | None = None, criteria: NoiseCriteria | None = None,
) -> np.ndarray:  # fmt: skip
    """(T,) True where a single sighting is off the line through the frames before it and off that through those after.

    t (T,) [s], values (T,), NaN where not seen. A kink, as in a collision, continues one of the two; a jump that
    stays continues the other.  smooth : (T,) mask of frames about which nothing is hit: there a curve through the
    frames on both sides tells far more than what is extrapolated from one.
    pressed : (T,) mask of frames in which a contact may last: while it does, a body lies on neither line.
    """
    criteria = criteria or current().noise
    found = np.zeros(len(t), dtype=bool)
    for _ in range(3):  # neighbours that are outliers themselves hide others
        seen = np.flatnonzero(np.isfinite(values) & ~found)
        k = criteria.outlier_frames
        if len(seen) < 2 * k + 1 or sigma <= 0:
            break
        turns = np.zeros(len(seen))
        if pressed is not None:
            turns = np.where(pressed[seen], _turn(t[seen], values[seen], k), 0.0)
        before = _extrapolated(t[seen], values[seen], k, sigma, turns)
        after = _extrapolated(-t[seen][::-1], values[seen][::-1], k, sigma, turns[::-1])[::-1]
        off = np.minimum(np.where(np.isnan(before), after, before), np.where(np.isnan(after), before, after))
        # a line from one side alone does not tell a bend from a sighting that is off
        first, last = np.flatnonzero(np.isnan(before)), np.flatnonzero(np.isnan(after))
        off[first] = np.fmin(off[first], _off_cubic(t[seen], values[seen], first, 1, sigma))
        off[last] = np.fmin(off[last], _off_cubic(t[seen], values[seen], last, -1, sigma))
        if smooth is not None:
            ends = np.concatenate([first, last])
            off[ends[~smooth[seen[ends]]]] = np.nan  # nor from a bounce
            curve = _off_both_sides(t[seen], values[seen], sigma, smooth[seen])
            off = np.where(smooth[seen], np.fmax(off, curve), off)
        new = seen[np.nan_to_num(off) > criteria.outlier]
        # of neighbours that accuse one another the worst goes first
        if len(new):
            strength = dict(zip(seen.tolist(), np.nan_to_num(off).tolist(), strict=True))
            new = np.array([r for r in new if strength[int(r)] >= max(strength.get(int(r) + d, 0.0) for d in (-1, 1))])
        if not len(new) and smooth is not None:
            new = seen[_runs_off(t[seen], values[seen], sigma, smooth[seen], criteria)]
        if not len(new):
            break
        found[new] = True
    if found.sum() > criteria.share_most * np.isfinite(values).sum():
        return np.zeros(len(t), dtype=bool)
    return found


def _runs_off(
    t: np.ndarray, values: np.ndarray, sigma: float, smooth: np.ndarray, criteria: NoiseCriteria
) -> np.ndarray:  # fmt: skip
    """(T,) True in a few sightings in a row, no more than ``row``, that are all off one curve that goes on behind them.

    Each of them hides the others from what is held against one at a time, and bends a curve as a kick does. The curve
    follows the frames on both sides as closely as noise lets it, and one whose velocity jumps there does not follow
    all: no force leaves a body and brings it back to where it would be without it. None of the sightings passes for
    noise, and all together are as improbable as ``outlier`` standard deviations in one.
    """
    found, half, window = np.zeros(len(t), dtype=bool), criteria.beside, np.lib.stride_tricks.sliding_window_view
    follows = float(stats.chi2.isf(criteria.alarm, 2 * half - criteria.curve - 1))
    alone, simple = float(stats.norm.isf(criteria.beside_single / 2)), current().kicks.smooth
    for length in range(2, criteria.row + 1):
        count = 2 * half + length
        if len(t) < count:
            break
        run = list(range(half, half + length))
        off, least, left = _off_together(window(t, count), window(values, count) / sigma, run, criteria.curve)
        off[(least < alone) | (left > follows) | ~window(smooth, count).all(axis=1)] = 0.0
        # of runs that share sightings the worst is the one that is off
        near = window(np.pad(off, length - 1), 2 * length - 1).max(axis=1)
        most = float(stats.chi2.isf(2 * stats.norm.sf(criteria.outlier), length))
        struck = float(stats.chi2.isf(criteria.alarm, count - simple - 3))  # a jump has a size and a time
        for w in np.flatnonzero((off > most) & (off == near)).tolist():
            if _left_of_kick(t[w : w + count], values[w : w + count] / sigma, run, simple) > struck:
                found[w + half : w + half + length] = True
    return found


def _off_together(
    t: np.ndarray, z: np.ndarray, run: Sequence[int], degree: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """(n,) chi2 of z[:, run] about the polynomial through the others, the least of their own distances, and that left.

    z : (n, k) over the noise at t (n, k).  Distances are over their standard deviations, which noise has that is no
    less than what is left of the others, and the curve itself, which is the same for all of the run.
    """
    others = [k for k in range(t.shape[1]) if k not in run]
    s = (t - t.mean(axis=1, keepdims=True)) / np.ptp(t, axis=1)[:, None]
    design = np.power(s[..., None], np.arange(degree + 1))
    inverse = np.linalg.pinv(design[:, others])
    away = z - np.einsum("nkd,ndl,nl->nk", design, inverse, z[:, others])
    left = np.sum(away[:, others] ** 2, axis=1)
    weights = design[:, run] @ inverse
    spread = np.eye(len(run)) + weights @ np.swapaxes(weights, 1, 2)
    off = away[:, run] / np.sqrt(np.maximum(left / (len(others) - degree - 1), 1.0))[:, None]
    together = np.einsum("nk,nkl,nl->n", off, np.linalg.inv(spread), off)
    return together, np.min(np.abs(off) / np.sqrt(np.diagonal(spread, axis1=1, axis2=2)), axis=1), left


def _left_of_kick(t: np.ndarray, z: np.ndarray, run: Sequence[int], degree: int) -> float:
    """The least of chi2 that a polynomial leaves of z (n,) whose velocity jumps once beside or within the run."""
    s = (t - t.mean()) / np.ptp(t)
    smooth, left = np.power(s[:, None], np.arange(degree + 1)), []
    for when in np.linspace(s[run[0] - 1], s[run[-1] + 1], current().noise.whens):
        design = np.column_stack([smooth, np.maximum(s - when, 0.0)])
        left.append(float(np.sum((z - design @ np.linalg.lstsq(design, z, rcond=None)[0]) ** 2)))
    return min(left)


def left_alone(residuals: np.ndarray, bodies: Sequence[str], criteria: NoiseCriteria | None = None) -> np.ndarray:
    """(T, c) True where a single sighting stands out from what a fit leaves of the frames about it.

    residuals (T, c) over the noise, NaN where not used; bodies (c,): whose each column is. What a law left out leaves
    is smooth from frame to frame: a parabola through the frames on both sides tells it, and where that fits badly
    (about an impact) what it leaves counts as noise. The coordinates of a body are held against it together: a sum of
    squares, as improbable as ``outlier`` standard deviations in one.
    """
    criteria = criteria or current().noise
    found = np.zeros(residuals.shape, dtype=bool)
    columns = np.array(bodies)
    half = criteria.outlier_frames
    for body in dict.fromkeys(bodies):
        mine = np.flatnonzero(columns == body)
        rows = np.flatnonzero(np.isfinite(residuals[:, mine]).all(axis=1))
        if len(rows) < 2 * half + 1:
            continue
        off = np.zeros(len(rows))
        for c in mine:
            own = _off_middle(rows.astype(float), residuals[rows, c], half, 1.0, 2)
            off += (own / larger_by(own)) ** 2
        least = float(stats.chi2.isf(2 * stats.norm.sf(criteria.outlier), len(mine)))
        # of neighbours that accuse one another the worst is the one that is off
        near = np.lib.stride_tricks.sliding_window_view(np.pad(np.nan_to_num(off), half), 2 * half + 1).max(axis=1)
        found[np.ix_(rows[(off > least) & (off == near)], mine)] = True
    return found


def single_ones(residuals: np.ndarray, bodies: Sequence[str], criteria: NoiseCriteria | None = None) -> np.ndarray:
    """(T, c) True where noise leaves no sighting of a body so far from a law that follows it, nor from those beside it.

    residuals (T, c) over the noise, NaN where not used; bodies (c,): whose each column is. Of all bodies and
    frames together noise has one so far off with the chance ``single``; both neighbours in time pass for noise
    (``beside_single``), as they do not where a law is missing, or about an impact. So it is of a few in a row, no more
    than ``row``, as where a tracker follows something else for a moment: no force leaves a body and brings it back.
    """
    criteria = criteria or current().noise
    found, columns = np.zeros(residuals.shape, dtype=bool), np.array(bodies)
    every = max(int(sum(np.isfinite(residuals[:, columns == b]).any(axis=1).sum() for b in set(bodies))), 1)
    for body in dict.fromkeys(bodies):
        mine = np.flatnonzero(columns == body)
        rows = np.flatnonzero(np.isfinite(residuals[:, mine]).all(axis=1))
        if len(rows) < 3:
            continue
        own = residuals[np.ix_(rows, mine)]
        chance = np.asarray(stats.chi2.sf(np.sum((own / larger_by(own)) ** 2, axis=1), len(mine)))
        quiet = np.concatenate([[True], chance > criteria.beside_single, [True]])
        for begin, end in in_a_row(chance < criteria.single / every):
            # of the padded marks the one before the first, and the one behind the last
            if end - begin <= criteria.row and quiet[begin] and quiet[end + 1]:
                found[np.ix_(rows[begin:end], mine)] = True
    return found


def in_a_row(mask: np.ndarray) -> list[tuple[int, int]]:
    """First and one past the last of each row of True in (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def larger_by(off: np.ndarray) -> np.ndarray:
    """By how much noise is larger than was believed, of residuals (T, ...) over it: half are beyond its quartile."""
    return np.asarray(np.maximum(np.nanmedian(np.abs(off), axis=0) / float(stats.norm.isf(0.25)), 1.0))


def _off_middle(t: np.ndarray, values: np.ndarray, half: int, sigma: float, degree: int) -> np.ndarray:
    """(T,) |value - polynomial through so many frames on either side| over its standard deviation; NaN at the ends."""
    window = np.lib.stride_tricks.sliding_window_view
    count = 2 * half + 1
    result = np.full(len(t), np.nan)
    if len(t) >= count:
        result[half : len(t) - half] = _off_curve(window(t, count), window(values, count), half, sigma, degree)
    return result


def _off_both_sides(t: np.ndarray, values: np.ndarray, sigma: float, smooth: np.ndarray) -> np.ndarray:
    """|value - polynomial of fifth degree through the frames about it| over its standard deviation.

    So many on either side; of the first and last of them, the others of the first and last window, where all of it is
    ``smooth`` (else NaN).  Half of these frames would be left by a jump that stays: the curve then fits badly, and what
    it leaves of the others is counted as their noise.
    """
    half, degree = current().noise.beside, current().noise.curve
    count = 2 * half + 1
    result = _off_middle(t, values, half, sigma, degree)
    if len(t) < count:
        return result
    for k in range(half):
        if smooth[:count].all():
            result[k] = _off_curve(t[None, :count], values[None, :count], k, sigma, degree)[0]
        if smooth[-count:].all():
            result[-1 - k] = _off_curve(t[None, -count:], values[None, -count:], count - 1 - k, sigma, degree)[0]
    return result


def _off_curve(t: np.ndarray, values: np.ndarray, at: int, sigma: float, degree: int) -> np.ndarray:
    """(n,) |values[:, at] - polynomial through the others (n, k)| over its standard deviation.

    As of a line, a frame that is itself far off the curve through the others is left out: of two sightings nearby that
    are no positions each would hide the other.
    """
    others = [k for k in range(t.shape[1]) if k != at]
    off, own = _off_by(t, values, at, others, sigma, degree)
    far = np.flatnonzero(own > current().noise.hides ** 2 * sigma**2)
    if len(far):
        fewer = ([k for k in others if k != j] for j in others)
        tried = [_off_by(t[far], values[far], at, kept, sigma, degree) for kept in fewer]
        alone, less = (np.array(part) for part in zip(*tried, strict=True))
        best = np.argmin(less, axis=0), np.arange(len(far))
        hidden = own[far] > current().noise.hides ** 2 * less[best]
        off[far] = np.where(hidden, alone[best], off[far])
    return off


def _off_by(
    t: np.ndarray, values: np.ndarray, at: int, others: Sequence[int], sigma: float, degree: int
) -> tuple[np.ndarray, np.ndarray]:
    """What ``_off_curve`` says by the frames ``others``, and the variance (n,) of these about the curve, at least that
    of the noise."""
    s = t - t[:, at, None]
    span = np.maximum(np.abs(s).max(axis=1, keepdims=True), 1e-300)
    design = np.power((s[:, others] / span)[..., None], np.arange(degree + 1))
    inverse = np.linalg.pinv(design)
    v = values[:, others]
    left = v - np.einsum("nkd,ndl,nl->nk", design, inverse, v)
    own = np.maximum(np.sum(left**2, axis=1) / (len(others) - degree - 1), sigma**2)
    weights = inverse[:, 0]  # of the curve where the frame lies
    off = values[:, at] - np.sum(weights * v, axis=1)
    return np.abs(off) / np.sqrt(own * (1 + np.sum(weights**2, axis=1))), own


def _off_cubic(t: np.ndarray, values: np.ndarray, rows: np.ndarray, side: int, sigma: float) -> np.ndarray:
    """|value - cubic through the seven frames after it (``side`` 1) or before it (-1)| over its standard deviation."""
    result, count = np.full(len(rows), np.nan), 7
    for k, row in enumerate(rows):
        others = row + side * np.arange(1, count + 1)
        if others.min() < 0 or others.max() >= len(t):
            continue
        s = (t[others] - t[row]) / np.ptp(t[others])
        inverse = np.linalg.pinv(np.power(s[:, None], np.arange(4)))
        left = values[others] - np.power(s[:, None], np.arange(4)) @ (inverse @ values[others])
        own = max(float(np.sum(left**2)) / (count - 4), sigma**2)
        weights = inverse[0]  # of the curve where the row lies
        result[k] = abs(values[row] - weights @ values[others]) / np.sqrt(own * (1 + weights @ weights))
    return result


def _turn(t: np.ndarray, values: np.ndarray, k: int) -> np.ndarray:
    """How far (T,) a body may be off both lines while its velocity changes from that before to that after.

    At a steady acceleration over a time tau it is off by dv tau/8; the frames next to the middle one are still on the
    lines, or nearly so, where tau is up to four frames. NaN-free: no less than none near the ends.
    """
    result = np.zeros(len(t))
    if len(t) < 2 * k + 1:
        return result
    window = np.lib.stride_tricks.sliding_window_view
    s, v = window(t, k), window(values, k)
    off = s - s.mean(axis=1, keepdims=True)
    slope = np.sum(off * v, axis=1) / np.sum(off**2, axis=1)
    frame = np.maximum(np.diff(t)[k - 1 : len(t) - k - 1], np.diff(t)[k : len(t) - k])
    result[k : len(t) - k] = np.abs(slope[k + 1 :] - slope[: len(slope) - k - 1]) * frame / 2
    return result


def _extrapolated(t: np.ndarray, values: np.ndarray, k: int, sigma: float, turns: np.ndarray) -> np.ndarray:
    """|value - line through the k frames before it| over its standard deviation, NaN for the first k.

    The line's own curvature is allowed for by what lines leave among these frames. A frame among them that is itself
    far off the line through the others is left out, or it would hide one that is no position: not the nearest, which
    may have been struck with the one that is looked at.
    turns : (T,) by how much it may be off in any case
    """
    result = np.full(len(t), np.nan)
    if len(t) <= k:
        return result
    window = np.lib.stride_tricks.sliding_window_view
    s, v = window(t, k)[:-1], window(values, k)[:-1]
    at, value = t[k:], values[k:]
    off, own = _off_line(s, v, at, value, sigma, turns[k:])
    for j in range(k - 1):
        others = [m for m in range(k) if m != j]
        alone, less = _off_line(s[:, others], v[:, others], at, value, sigma, turns[k:])
        hidden = own > current().noise.hides ** 2 * less
        off, own = np.where(hidden, alone, off), np.where(hidden, less, own)
    result[k:] = off
    return result


def _off_line(
    s: np.ndarray, v: np.ndarray, at: np.ndarray, value: np.ndarray, sigma: float, turns: np.ndarray
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
    return np.maximum(np.abs(value - mean_v[:, 0] - slope * lever) - turns, 0.0) / spread, own
