"""Frames that a camera dropped, or showed twice, without a word of it: the stamps go on evenly, the bodies do not."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

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
    gaps = np.diff(t) / spacing
    for _ in range(len(t)):
        best = min((place for window in c.windows for place in _jumps(t, z, gaps, window, spacing)), default=None)
        if best is None:
            break
        _, row, count = best
        found[row] = found.get(row, 0) + count
        t[row:] += count * spacing
    return sorted(found.items())


def _jumps(
    t: np.ndarray, z: np.ndarray, gaps: np.ndarray, window: tuple[int, int, int], spacing: float
) -> list[tuple[float, int, int]]:
    """(fall of chi2 below zero, row, frames) of each place where frames are missing.

    z : (T, c) over their noise;  gaps : (T - 1,) between the stamps, over the usual time
    window : degree of polynomials, frames on either side, and how many are looked for
    """
    degree, half, most = window
    c, size = current().lost, 2 * half
    if len(t) < size:
        return []
    windows, places = sliding_window_view(t, size), sliding_window_view(z, size, axis=0)
    told = sliding_window_view(gaps, size - 1)
    even = (told < c.long).all(axis=1) & (told[:, half - 1] < c.gap)
    # each number is seen in all frames of a side but one, the ones about the gap among them
    seen = np.isfinite(places)
    full = (seen[..., :half].sum(axis=2) >= half - 1) & (seen[..., half:].sum(axis=2) >= half - 1)
    full &= seen[..., half - 1] & seen[..., half] & even[:, None]
    way = _Ways(degree, half, spacing)
    found = []
    rows = np.flatnonzero(full.any(axis=1))
    for w in rows[_open(way, windows[rows], places[rows], seen[rows], full[rows], most)].tolist():
        numbers, there = places[w][full[w]], seen[w][full[w]]
        before = way.left(windows[w], numbers, there)
        freedom = int(there.sum()) - (degree + 1) * len(there) - 1
        if before < freedom + c.sure:
            continue
        with_gap = [way.left(windows[w] + k * spacing * way.after, numbers, there) for k in range(1, most + 2)]
        k = int(np.argmin(with_gap))
        least = with_gap[k]
        ahead = before - least > c.sure and before - freedom > c.times * (least - freedom)
        if k == most or not ahead or least > c.most * freedom:
            continue
        kinked = min(way.left(windows[w], numbers, there, float(at)) for at in np.linspace(half - 2, half + 1, 7))
        if kinked - least > c.sure:
            found.append((least - before, w + half, k + 1))
    return found


def _open(
    way: _Ways, times: np.ndarray, numbers: np.ndarray, seen: np.ndarray, full: np.ndarray, most: int
) -> np.ndarray:
    """(W,) which windows may show a gap: most are told at once from all together, the rest one by one (``_jumps``).

    times : (W, n);  numbers : (W, c, n), where ``seen``;  full : (W, c) numbers that count
    """
    c = current().lost
    w, k = np.nonzero(full)
    z, there = numbers[w, k], seen[w, k]
    rounding = current().rounding.told * (1 + np.bincount(w, np.nansum(z**2, axis=1), len(times)))
    freedom = np.bincount(w, there.sum(axis=1) - way.degree - 1, len(times)) - 1

    def left(gap: int, which: np.ndarray) -> np.ndarray:
        mine = which[w]
        at = times[w[mine]] + gap * way.spacing * way.after
        return np.bincount(w[mine], way.each_left(at, z[mine], there[mine]), len(times))

    before = left(0, np.ones(len(times), dtype=bool))
    may = before >= freedom + c.sure - rounding
    least = np.full(len(times), np.inf)
    for gap in range(1, most + 1 if may.any() else 1):
        least = np.where(may, np.minimum(least, left(gap, may)), np.inf)
    may &= before - least > c.sure - 2 * rounding
    may &= before - freedom > c.times * (least - freedom) - (1 + c.times) * rounding
    return may & (least <= c.most * freedom + rounding)


class _Ways:
    """Polynomials over frames on either side of a gap; their bases are the same wherever frames are evenly spaced."""

    def __init__(self, degree: int, half: int, spacing: float) -> None:
        self.degree, self.size, self.spacing = degree, 2 * half, spacing
        self.after = np.arange(self.size) >= half
        self._bases: dict[tuple[float, ...], np.ndarray] = {}

    def left(self, times: np.ndarray, numbers: np.ndarray, seen: np.ndarray, kink: float | None = None) -> float:
        """What they leave of chi2 of numbers (c, n), where ``seen`` (c, n), at ``times`` (n,) [s]."""
        total = 0.0
        for rows in {row.tobytes(): row for row in seen}.values():
            part = numbers[(seen == rows).all(axis=1)][:, rows].T
            total += float(np.sum(part**2) - np.sum((self._basis(times, rows, kink).T @ part) ** 2))
        return total

    def each_left(self, times: np.ndarray, numbers: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """(k,) what they leave of chi2 of each row of numbers (k, n), as ``left`` does of those of a window."""
        s = np.round((times - times[:, :1]) / self.spacing, 3)
        _, first, kind = np.unique(np.hstack([s, seen]), axis=0, return_index=True, return_inverse=True)
        kind = kind.ravel()  # numpy 2.0 gives it another shape
        order = np.argsort(kind, kind="stable")
        ends = np.searchsorted(kind[order], np.arange(len(first) + 1))
        found = np.zeros(len(times))
        for place in np.argsort(first).tolist():
            mine, rows = order[ends[place] : ends[place + 1]], seen[first[place]]
            part = numbers[mine][:, rows]
            found[mine] = np.sum(part**2, axis=1)
            found[mine] -= np.sum((part @ self._basis(times[first[place]], rows, None)) ** 2, axis=1)
        return found

    def _basis(self, times: np.ndarray, rows: np.ndarray, kink: float | None) -> np.ndarray:
        s = (times - times[0]) / self.spacing
        key = (*np.round(s, 3).tolist(), *rows.tolist(), -1.0 if kink is None else kink)
        if key not in self._bases:
            design = np.power((s / s[-1])[:, None], np.arange(self.degree + 1))
            if kink is not None:
                design = np.column_stack([design, np.maximum(np.arange(self.size) - kink, 0.0)])
            self._bases[key] = np.linalg.qr(design[rows])[0]
        return self._bases[key]


def same_as_before(values: np.ndarray) -> np.ndarray:
    """(T - 1,) whether all numbers (T, c) of a frame are those of the one before, to the last digit; unseen ones, too.

    Not where nothing is seen in either.
    """
    seen = np.isfinite(values)
    equal = ((values[1:] == values[:-1]) | ~(seen[1:] | seen[:-1])).all(axis=1)
    return np.asarray(equal & seen[1:].any(axis=1))


def repeated(
    values: np.ndarray, sigmas: Sequence[float], steps: Sequence[float], grids: Sequence[float] | None = None
) -> np.ndarray:  # fmt: skip
    """(T,) frames that show what the one before shows, to the last digit, while bodies move: the same picture again.

    values : (T, c) measured numbers;  sigmas : (c,) one standard deviation of each
    steps : (c,) how finely they are told, at the least;  grids : (c,) of whole pixels, 0 where they lie on none
    Two numbers of one size are told as the same with probability g/(2 sigma sqrt(pi)), g the step. Where a body is
    the cubic through two frames on either side says, give or take noise, and so do parabolas through three of the four:
    one that is no position bends all curves through it. Rounding moves a number by half a step at the most, so that a
    body is only elsewhere than in the frame before where it has moved by more than rounding brings.
    """
    sigma, step = np.asarray(sigmas, dtype=float), np.asarray(steps, dtype=float)
    grid = np.zeros(len(sigma)) if grids is None else np.asarray(grids, dtype=float)
    c, same = current().lost, np.zeros(len(values), dtype=bool)
    if not (sigma > 0).all() or not len(values[2:-2]):
        return same
    equal = same_as_before(values)
    around, off = np.stack([values[:-4], values[1:-3], values[3:-1], values[4:]]), []
    for weights in _through():
        away = np.abs(values[2:-2] - np.tensordot(weights, np.where(weights[:, None, None], around, 0.0), axes=1))
        rounding = grid / 2 * (1 + np.abs(weights).sum())
        off.append(np.maximum(away - rounding, 0.0) / (sigma * np.sqrt(1 + weights @ weights)))
    by_chance = np.minimum(step / (2 * sigma * np.sqrt(np.pi)), 1.0) * 2 * stats.norm.sf(np.min(off, axis=0))
    chance = np.nanprod(by_chance, axis=1)
    same[2:-2] = equal[1:-2] & (chance < c.chance)
    if same.sum() >= c.often:  # where it happens again and again, a frame that is the same is likelier one more
        same[2:-2] |= equal[1:-2] & (chance < c.odds * same.mean())
    return same


def _through() -> list[np.ndarray]:
    """(4,) weights at 0 of the polynomials through frames -2, -1, 1, 2, and through three of them (Lagrange)."""
    frames = [k for k in range(-2, 3) if k]
    found = []
    for chosen in (frames, *combinations(frames, 3)):
        weights = {k: np.prod([j / (j - k) for j in chosen if j != k]) for k in chosen}
        found.append(np.array([weights.get(k, 0.0) for k in frames]))
    return found
