"""What a film of many bodies says of itself: the noise of its sightings, and moments of frames that are uneven.

A frame that is late shows every body a step along its own way. What a body's place is off its path through the frames
about it, along its velocity, is noise; summed over a bed it tells the lateness to a hundredth of a frame. Slow
changes of the lateness look like motion: they are not told, and replicates have them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded
from scipy.sparse import csr_matrix

from ... import distributions as stats
from ..criteria import current


@dataclass(frozen=True)
class Lateness:
    """What each frame is late by, less a quadratic through the lateness of the frames about it.

    frames : (k,) which;  late : (k,) [s];  variance : (k,) of it, by the noise of sightings [s^2]
    weights : (k, T) of the frames' own lateness in it;  size [s] : rms of the frames' own beyond that noise
    """

    frames: np.ndarray
    late: np.ndarray
    variance: np.ndarray
    weights: csr_matrix

    @property
    def size(self) -> float:
        spread = float(self.weights.multiply(self.weights).sum())
        return math.sqrt(max(float(np.sum(self.late**2 - self.variance)), 0.0) / spread) if spread else 0.0


def _quadratics(t: np.ndarray) -> Iterator[tuple[int, slice, np.ndarray, np.ndarray]]:
    """Of each frame but the outermost: its number, the frames about it, and what of these (5,) give the residual there,
    and the slope [1/s], of a quadratic through them."""
    half = current().windows.starts.half
    for f in range(half, len(t) - half):
        near = slice(f - half, f + half + 1)
        s = t[near] - t[f]
        inverse = np.linalg.pinv(np.stack([np.ones_like(s), s / s[-1], (s / s[-1]) ** 2], axis=1))
        residual = -inverse[0]
        residual[half] += 1.0
        yield f, near, residual, inverse[1] / s[-1]


def sighting_noise(t: np.ndarray, xy: np.ndarray) -> float:
    """Standard deviation [m] of a coordinate, of the bodies that move least; 0 where too little is seen.

    t : (T,) [s];  xy : (T, n, 2) unwrapped [m], NaN where not seen.  Whatever bends a path within five frames adds to
    it: it is an upper bound.
    """
    criteria = current().windows.stamps
    found = []
    for _, near, residual, slope in _quadratics(t):
        x = xy[near]
        found.append([np.tensordot(w, x, 1) for w in (residual / math.sqrt(residual @ residual), slope)])
    if len(found) < criteria.frames:
        return 0.0
    rest, speed = np.moveaxis(np.array(found), 1, 0)
    seen = np.isfinite(rest[..., 0]).sum(axis=0)
    often = np.flatnonzero(seen >= criteria.frames)
    if not len(often):
        return 0.0
    pace = np.nanmean(np.sum(speed[:, often] ** 2, axis=-1), axis=0)
    slow = often[np.argsort(pace)[: max(int(criteria.slowest * len(often)), 1)]]
    values = np.abs(rest[:, slow][np.isfinite(rest[:, slow])])
    size = float(np.median(values) / stats.norm.ppf(3 / 4)) or float(np.sqrt(np.mean(values**2)))
    for _ in range(2):  # single sightings far off do not count
        size = float(np.sqrt(np.mean(values[values <= criteria.far * size] ** 2)))
    return size


def lateness(t: np.ndarray, xy: np.ndarray, sigma: float) -> Lateness:
    """Of frames at t (T,) [s] of bodies at xy (T, n, 2) [m], NaN where not seen; sigma [m] of a sighting.

    A quadratic through five frames gives velocity v and residual r of each body; late = sum v.r/(sum v.v - noise). The
    noise of v and of r is not correlated (least squares).
    """
    criteria = current().windows.stamps
    frames, late, variance, rows = list[int](), list[float](), list[float](), list[np.ndarray]()
    for f, near, residual, slope in _quadratics(t):
        x = xy[near][:, np.isfinite(xy[near]).all(axis=(0, 2))]
        r, v = np.tensordot(residual, x, 1), np.tensordot(slope, x, 1)
        noise, blur = float(residual @ residual) * sigma**2, 2.0 * float(slope @ slope) * sigma**2
        # a first look lets a frame be late by much, the second takes what is still far off for a bad sighting
        found, room = 0.0, criteria.late * float(np.median(np.diff(t[near])))
        for allowed in (room, 0.0):
            far = criteria.far * math.sqrt(noise) + allowed * np.hypot(*v.T)
            good = np.hypot(*(r - found * v).T) < far
            square = float(np.sum(v[good] ** 2))
            moving = square - blur * int(good.sum())
            if not moving > square / 2:  # hardly anything moves
                break
            found = float(np.sum(v[good] * r[good])) / moving
        else:
            row = np.zeros(len(t))
            row[near] = residual
            frames.append(f)
            late.append(found)
            variance.append(noise * square / moving**2)
            rows.append(row)
    weights = csr_matrix(np.array(rows).reshape(-1, len(t)))
    return Lateness(np.array(frames, dtype=np.int64), np.array(late), np.array(variance), weights)


@dataclass(frozen=True)
class Jitter:
    """Of the moments of a film's frames: size, and what a film of a simulated bed shows where there is none [s]."""

    size: float
    physics: float

    def put_right(self, t: np.ndarray, xy: np.ndarray, sigma: float) -> np.ndarray:
        """(T,) the most likely moments [s] of the frames at stamps t: mean of normal numbers, given what is seen."""
        seen = lateness(t, xy, sigma)
        if not len(seen.frames):
            return t
        both = self.size**2 + self.physics**2
        covariance = both * (seen.weights @ seen.weights.T)
        wide = 4 * current().windows.starts.half
        bands = np.zeros((wide + 1, len(seen.frames)))
        for k in range(min(wide + 1, len(seen.frames))):
            bands[k, : len(seen.frames) - k] = covariance.diagonal(-k)
        bands[0] += seen.variance
        shift = self.size**2 * (seen.weights.T @ solveh_banded(bands, seen.late, lower=True))
        return in_order(t, shift)


def in_order(t: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Stamps t (T,) moved by (T,) [s], by no more than keeps their order."""
    most = current().windows.stamps.late * float(np.diff(t).min())
    moved: np.ndarray = t + np.clip(shift, -most, most)
    return moved


def jitter_of(seen: Lateness, simulated: Lateness) -> Jitter | None:
    """What a film has beyond what a simulated one of the same bed has, whose moments are even; None if nothing."""
    size, physics = seen.size, simulated.size
    count, other = len(seen.frames), len(simulated.frames)
    if min(count, other) < current().windows.stamps.frames or size <= physics:
        return None
    ratio = float(np.mean(seen.late**2) / np.mean(simulated.late**2))
    # neighbouring frames share the frames about them: half as many count
    if stats.f.sf(ratio, count / 2, other / 2) > current().verdict.alarm:
        return None
    return Jitter(math.sqrt(size**2 - physics**2), physics)
