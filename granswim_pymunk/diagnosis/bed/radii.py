"""Radii of grains, put right by who touches whom: grains of a bed do not overlap, and seldom stand apart.

Of two grains that touch most of the time the distance is the sum of their radii, whatever the rest of the bed does.
Each grain has some four such neighbours, and all their radii follow from all those distances together. What is left of
the error is told, so that twins are as far off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from ...recording import Recording
from ...scene import Body

LOOKS = 120  # frames that are looked at, at most
NEAR = 0.1  # of the sum of two radii, a gap, or an overlap, up to which a pair is followed
MOST = 0.05  # relative error beyond which it is not the radii that are wrong: circles are read better than that
FEWEST = 10  # frames in which it is near
LOW = 0.2  # quantile of a pair's distances: it has touched in so many of them, and noise has brought it no nearer
SHIFT = 0.6, 0.1  # of the noise of a distance by which noise lowers that quantile where a pair touches, and its spread
ALIKE = 0.03  # spread of an error that all distances share: a picture's scale, which is told elsewhere
APART = 0.015  # of the sum of radii: a gap beyond which a pair may as well not touch
ROUGH = 0.002  # of the sum of radii: how well a quantile tells a distance where there is no noise
ROUNDS, FAR = 30, 3.0  # of the fit; in the first ten ``APART`` is so much larger, to begin with
FIRST = 0.02  # relative error of radii that is thought likely where nothing was said
WORTH = 0.005  # relative error that was not said, below which radii stay as believed: circles are read off to that
TOLD = 0.5  # posterior over prior variance below which a radius counts as told
MANY = 20  # radii that have to be told
DENSITY = 2e-3  # relative: masses that follow from the radii so well are put right with them


@dataclass(frozen=True)
class Touching:
    """Pairs of bodies that were near: rows i, j (p,), low quantile of the distance [m], frames in which they were."""

    i: np.ndarray
    j: np.ndarray
    distance: np.ndarray
    frames: np.ndarray


@dataclass(frozen=True)
class Sized:
    """change : (n,) relative change of each radius, 0 of those that are known;  off : rms error of what was believed
    left : rms error that remains, both relative;  told : how many radii the pairs tell"""

    change: np.ndarray
    off: float
    left: float
    told: int


def touching(film: np.ndarray, radius: np.ndarray, free: np.ndarray) -> Touching:
    """Pairs of which at least one radius is ``free`` (n,), in frames (T, n, 2) [m], unwrapped, NaN where not seen.

    Those across the ends of a periodic bed are left out: a wrong scale of the picture would let them overlap.
    """
    first, second, away = [], [], []
    for frame in film[np.unique(np.linspace(0, len(film) - 1, LOOKS).round().astype(int))]:
        seen = np.flatnonzero(np.isfinite(frame).all(axis=1))
        xy = frame[seen]
        pairs = cKDTree(xy).query_pairs((1 + NEAR) * 2 * radius.max(), output_type="ndarray")
        distance, (i, j) = np.hypot(*(xy[pairs[:, 0]] - xy[pairs[:, 1]]).T), np.sort(seen[pairs], axis=1).T
        near = (np.abs(distance / (radius[i] + radius[j]) - 1.0) < NEAR) & (free[i] | free[j])
        first.append(i[near])
        second.append(j[near])
        away.append(distance[near])
    i, j, distance = (np.concatenate(parts) for parts in (first, second, away))
    pair = i * len(radius) + j
    order = np.lexsort((distance, pair))
    _, begin, count = np.unique(pair[order], return_index=True, return_counts=True)
    begin, count = begin[count >= FEWEST], count[count >= FEWEST]
    at = order[begin]
    return Touching(i[at], j[at], distance[order[begin + (LOW * (count - 1)).round().astype(int)]], count)


def sized(near: Touching, radius: np.ndarray, free: np.ndarray, sigma: float, stated: float | None) -> Sized:
    """Relative errors of radii from the distances of pairs, by least squares with the errors' own spread as prior.

    A pair that is nearer than it may be counts in full, one that stands apart the less the farther (Cauchy's weight),
    as it may never have touched. The prior's spread is ``stated``, or fitted (expectation maximisation: Dempster,
    Laird & Rubin 1977, J. R. Stat. Soc. B 39, 1). Tracking noise sigma [m] brings all pairs nearer by a share of it,
    and a wrong scale of the picture all apart: both are fitted, and are no errors of radii.
    """
    i, j, total = near.i, near.j, radius[near.i] + radius[near.j]
    gap, noise = near.distance / total - 1.0, math.sqrt(2.0) * sigma / total
    error = np.sqrt(2.0 * noise**2 / np.minimum(near.frames, LOOKS / 2) + ROUGH**2)
    column = np.cumsum(free) - 1
    count = int(free.sum())
    rows = np.arange(len(i))
    entries = [(rows, np.maximum(column[k], 0), free[k] * radius[k] / total) for k in (i, j)]
    entries += [(rows, np.full(len(i), count), -noise), (rows, np.full(len(i), count + 1), np.ones(len(i)))]
    r, c, v = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    design = csc_matrix((v, (r, c)), shape=(len(i), count + 2))
    spread, found = stated or FIRST, np.zeros(count + 2)
    found[count] = SHIFT[0]
    variance = np.full(count, spread**2)
    for k in range(ROUNDS):
        rest = gap - design @ found
        wide = APART * (1.0 + FAR * max(0.0, 1.0 - k / 10))
        weight = np.where(rest > 0, 1.0 / (1.0 + (rest / wide) ** 2) ** 2, 1.0) / error**2
        prior = np.append(np.full(count, spread**-2), [SHIFT[1] ** -2, ALIKE**-2])
        solver = splu((design.T @ diags(weight) @ design + diags(prior)).tocsc())
        found = solver.solve(design.T @ (weight * gap) + prior * np.append(np.zeros(count), [SHIFT[0], 0.0]))
        if k % 5 == 4:
            variance = np.diag(solver.solve(np.eye(count + 2)))[:count]
            told = variance < TOLD * spread**2
            if stated is None and told.sum() >= MANY:
                spread = float(np.sqrt(np.mean(found[:count][told] ** 2 + variance[told])))
    change = np.zeros(len(radius))
    change[free] = found[:count]
    return Sized(change, spread, float(np.sqrt(variance.mean())), int((variance < TOLD * spread**2).sum()))


def with_radii(
    recording: Recording, film: np.ndarray, sigma: float, learnt: int
) -> tuple[Recording, Sized | None]:
    """The recording with radii of grains put right, and how far off they were; None where they are as believed.

    film : (T, n, 2) in the scene's order [m];  learnt : frames of it that may be looked at
    """
    bodies, stated = recording.scene.bodies, recording.radius_error
    free = np.array([b.role == "grain" for b in bodies]) & (np.isfinite(film[:learnt, :, 0]).sum(axis=0) >= FEWEST)
    if stated == 0 or free.sum() < MANY:
        return recording, None
    radius = np.array([b.radius for b in bodies])
    near = touching(film[:learnt], radius, free)
    if len(near.i) < free.sum():
        return recording, None
    found = sized(near, radius, free, sigma, stated)
    if found.told < MANY or found.off > MOST or (stated is None and found.off < WORTH):
        return recording, None
    scene = replace(recording.scene, bodies=_resized(bodies, found.change))
    return replace(recording, scene=scene, radius_error=found.left), found


def _resized(bodies: Sequence[Body], change: np.ndarray) -> tuple[Body, ...]:
    """Bodies with other radii; masses that follow from the radii go with them."""
    grains = [b for b in bodies if b.role == "grain"]
    density = np.array([b.mass / b.radius**3 for b in grains])
    power = 3 if np.ptp(density) < DENSITY * density.mean() else 0
    return tuple(
        replace(b, radius=b.radius * (1 + float(c)), mass=b.mass * (1 + float(c)) ** power) if c else b
        for b, c in zip(bodies, change, strict=True)
    )
