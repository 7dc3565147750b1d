"""Frames that a camera dropped, or showed twice, without a word of it: the stamps go on evenly, the bodies do not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .. import distributions as stats
from .criteria import current


def missing(t: np.ndarray, values: np.ndarray, sigmas: Sequence[float]) -> list[tuple[int, int]]:
    """(row, how many frames are missing right before it) where all that moves jumps ahead along its way.

    t : (T,) stamps [s];  values : (T, c) measured numbers;  sigmas : (c,) one standard deviation of each
    No force moves a body at once: bodies that are all as far ahead as they move in a whole number of frames were not
    seen in between. A camera that numbers the frames it kept leaves no gap in its stamps; about those that they tell of
    bodies may have turned unseen, and nothing more is looked for. Polynomials over some frames have to follow with so
    many frames put in, and neither without nor with velocities that change at once instead, as in an impact.
    """
    c, sigma = current().lost, np.asarray(sigmas, dtype=float)
    if not (sigma > 0).all():
        return []
    t, z = np.array(t, dtype=float), values / sigma
    spacing, found = float(np.median(np.diff(t))), dict[int, int]()
    told = np.diff(t) > c.gap * spacing
    for _ in range(len(t)):
        best = min((place for d, half in c.windows for place in _jumps(t, z, told, d, half, spacing)), default=None)
        if best is None:
            break
        _, row, count = best
        found[row] = found.get(row, 0) + count
        t[row:] += count * spacing
    return sorted(found.items())


def _jumps(
    t: np.ndarray, z: np.ndarray, told: np.ndarray, degree: int, half: int, spacing: float
) -> list[tuple[float, int, int]]:
    """(fall of chi2 below zero, row, frames) of each place where frames are missing.

    z : (T, c) over their noise;  told : (T - 1,) where the stamps themselves tell of a gap
    """
    c, size = current().lost, 2 * half
    if len(t) < size:
        return []
    after = np.arange(size) >= half
    windows, places = sliding_window_view(t, size), sliding_window_view(z, size, axis=0)
    even = ~sliding_window_view(told, size - 1).any(axis=-1)
    full = np.isfinite(places).all(axis=2) & np.reshape(even, (-1, 1))
    bases: dict[tuple[float, ...], np.ndarray] = {}
    found = []

    def left(times: np.ndarray, seen: np.ndarray, kink: float | None = None) -> float:
        """What polynomials leave of chi2; their bases are the same wherever frames are evenly spaced."""
        s = (times - times[0]) / spacing
        key = (*np.round(s, 3).tolist(), -1.0 if kink is None else kink)
        if key not in bases:
            design = np.power((s / s[-1])[:, None], np.arange(degree + 1))
            if kink is not None:
                design = np.column_stack([design, np.maximum(np.arange(size) - kink, 0.0)])
            bases[key] = np.linalg.qr(design)[0]
        return float(np.sum(seen**2) - np.sum((bases[key].T @ seen) ** 2))

    for w in np.flatnonzero(full.any(axis=1)).tolist():
        seen = places[w][full[w]].T
        before = left(windows[w], seen)
        freedom = (size - degree - 1) * seen.shape[1] - 1
        if before < freedom + c.sure:
            continue
        with_gap = [left(windows[w] + k * spacing * after, seen) for k in range(1, c.frames + 2)]
        k = int(np.argmin(with_gap))
        least = with_gap[k]
        ahead = before - least > c.sure and before - freedom > c.times * (least - freedom)
        if k == c.frames or not ahead or least > c.most * freedom:
            continue
        kinked = min(left(windows[w], seen, float(at)) for at in np.linspace(half - 2, half + 1, 7))
        if kinked - least > c.sure:
            found.append((least - before, w + half, k + 1))
    return found


def repeated(values: np.ndarray, sigmas: Sequence[float], steps: Sequence[float]) -> np.ndarray:
    """(T,) frames that show what the one before shows, to the last digit, while bodies move: the same picture again.

    values : (T, c) measured numbers;  sigmas : (c,) one standard deviation of each
    steps : (c,) how finely they are told
    Two numbers of one size are told as the same with probability g/(2 sigma sqrt(pi)), g the step. The cubic through
    two frames on either side says where a body is, (4 (x_-1 + x_1) - x_-2 - x_2)/6, give or take sigma sqrt(17/18).
    """
    sigma, step = np.asarray(sigmas, dtype=float), np.asarray(steps, dtype=float)
    same = np.zeros(len(values), dtype=bool)
    if not (sigma > 0).all():
        return same
    seen = np.isfinite(values)
    equal = ((values[1:] == values[:-1]) | ~(seen[1:] | seen[:-1])).all(axis=1)
    there = (4 * (values[1:-3] + values[3:-1]) - values[:-4] - values[4:]) / 6
    off = np.abs(values[2:-2] - there) / (sigma * np.sqrt(1 + 17 / 18))
    by_chance = np.minimum(step / (2 * sigma * np.sqrt(np.pi)), 1.0) * 2 * stats.norm.sf(off)
    same[2:-2] = equal[1:-2] & (np.nanprod(by_chance, axis=1) < current().lost.chance)
    return same
