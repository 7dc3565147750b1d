"""Sightings that a tracker made up where it had lost a body: it keeps the last place, or draws a straight line."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .. import distributions as stats
from .criteria import current
from .noise import in_a_row


def held_places(t: np.ndarray, values: np.ndarray, sigmas: Sequence[float], steps: Sequence[float]) -> np.ndarray:
    """(T,) frames in which a body is where it was seen last, to the last digit, and goes on from elsewhere.

    t : (T,) [s];  values : (T, c) numbers of one body, NaN where not seen
    sigmas : (c,) one standard deviation of each;  steps : (c,) how finely they are told
    Two numbers of one size are told as the same with probability g/(2 sigma sqrt(pi)), g the step. A cubic through
    frames on both sides, or a parabola through those before where the film ends, has to follow those and to leave the
    place that is kept: what comes to rest and starts again lies on a curve that rests.
    """
    c, sigma = current().filled, np.asarray(sigmas, dtype=float)
    mask = np.zeros(len(values), dtype=bool)
    if not (sigma > 0).all():
        return mask
    seen = np.flatnonzero(np.isfinite(values).all(axis=1))
    again = np.zeros(len(seen), dtype=bool)
    again[1:] = (values[seen[1:]] == values[seen[:-1]]).all(axis=1)
    measured = seen[~again]
    same = float(np.prod(np.minimum(np.asarray(steps) / (2 * sigma * math.sqrt(math.pi)), 1.0)))
    for first, end in in_a_row(again):
        run = seen[first:end]
        before, after = measured[measured < run[0]], measured[measured > run[-1]]
        if len(after):
            near, degree = np.concatenate([before[-c.side :], after[: c.side]]), 3
        else:
            near, degree = before[-2 * c.side :], 2
        if min(len(before), len(after) or c.side) < c.side:
            continue
        off, left = _off_curve(t, values / sigma, near, run, degree)
        chance = same ** len(run) * float(np.prod(2 * stats.norm.sf(off)))
        if left < c.most * (len(near) - degree - 1) * len(sigma) and off.max() > c.away and chance < c.chance:
            mask[run] = True
    return mask


def on_a_line(
    t: np.ndarray, values: np.ndarray, sigmas: Sequence[float], digits: Sequence[float], stamp: float = 0.0
) -> np.ndarray:  # fmt: skip
    """(T,) frames in which a body is just where a straight line between those about them has it, to the last digit.

    values : (T, c) numbers of one body, NaN where not seen
    sigmas : (c,) what their noise is by these numbers;  digits : (c,) the last place in which they are told,
    stamp [s] : that of the times, between which a body moves on
    What is measured is off that line by sigma sqrt(3/2), and by no more than the last digit g with probability
    2 g/(sigma sqrt(3 pi)). Pixels are on such lines more often, as single frames show, and in steps
    that are taken elsewhere as well.
    """
    c, sigma = current().filled, np.asarray(sigmas, dtype=float)
    mask = np.zeros(len(values), dtype=bool)
    seen = np.flatnonzero(np.isfinite(values).all(axis=1))
    if not (sigma > 0).all() or len(seen) < c.side:
        return mask
    s, v = t[seen], values[seen]
    speed = np.quantile(np.abs(np.diff(v, axis=0) / np.diff(s)[:, None]), c.fast, axis=0)
    digit = np.asarray(digits) + speed * stamp
    step = (s[1:-1] - s[:-2])[:, None]
    line = np.zeros(len(seen), dtype=bool)
    line[1:-1] = (np.abs(v[:-2] + (v[2:] - v[:-2]) * step / (s[2:] - s[:-2])[:, None] - v[1:-1]) <= digit).all(axis=1)
    chance = float(np.prod(np.minimum(2 * digit / (sigma * math.sqrt(3 * math.pi)), 1.0)))
    runs = in_a_row(line)
    if line.mean() > c.share > c.times * chance and line.sum() > c.many:
        rows = _own_steps(v, digit, runs)
        if rows.mean() > c.share:
            mask[seen[rows]] = True
            return mask
    long = [(a, b) for a, b in runs if b - a >= c.row]
    filled = sum(b - a for a, b in long)
    # of pixels one frame and another are on a line, and so some in a row by chance
    chance = max(chance, (line.sum() - filled) / (len(line) - filled))
    mask[seen[_own_steps(v, digit, [(a, b) for a, b in long if chance ** (b - a) < c.chance])]] = True
    return mask


def _own_steps(v: np.ndarray, digit: np.ndarray, runs: Sequence[tuple[int, int]]) -> np.ndarray:
    """(T,) rows of those runs along v (T, c) whose steps are taken nowhere else, to within some of the last digit."""
    steps = np.round(np.diff(v, axis=0) / (4 * digit))
    others, rows = np.ones(len(steps), dtype=bool), np.zeros(len(v), dtype=bool)
    for first, end in runs:
        others[first - 1 : end] = False
    for first, end in runs:
        rows[first:end] = not (np.abs(steps[others] - steps[first - 1]) <= 1).all(axis=1).any()
    return rows


def _off_curve(
    t: np.ndarray, z: np.ndarray, near: np.ndarray, rows: np.ndarray, degree: int
) -> tuple[np.ndarray, float]:  # fmt: skip
    """How far z (T, c) of ``rows`` are off polynomials through those ``near``, over the spread; chi2 these leave."""
    middle, span = t[near].mean(), np.ptp(t[near])
    design, there = (np.power(((t[k] - middle) / span)[:, None], np.arange(degree + 1)) for k in (near, rows))
    inverse = np.linalg.pinv(design)
    spread = np.sqrt(1.0 + np.sum((there @ inverse) ** 2, axis=1))[:, None]
    coefficients = inverse @ z[near]
    left = float(np.sum((z[near] - design @ coefficients) ** 2))
    return np.asarray(np.abs(z[rows] - there @ coefficients) / spread), left
