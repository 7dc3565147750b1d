"""Radii of grains, put right by who touches whom: grains of a bed do not overlap, and seldom stand apart.

Of two grains that touch most of the time the distance is the sum of their radii, whatever the rest of the bed does.
Each grain has some four such neighbours, and all their radii follow from all those distances together. What is left of
the error is told, so that replicates are as far off.
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
from ..criteria import current


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
    c = current().radii
    first, second, away = [], [], []
    for frame in film[np.unique(np.linspace(0, len(film) - 1, c.looks).round().astype(int))]:
        seen = np.flatnonzero(np.isfinite(frame).all(axis=1))
        xy = frame[seen]
        pairs = cKDTree(xy).query_pairs((1 + c.near) * 2 * radius.max(), output_type="ndarray")
        distance, (i, j) = np.hypot(*(xy[pairs[:, 0]] - xy[pairs[:, 1]]).T), np.sort(seen[pairs], axis=1).T
        gap = distance / (radius[i] + radius[j]) - 1.0
        near = (np.abs(gap) < c.near) & (free[i] | free[j])
        first.append(i[near])
        second.append(j[near])
        away.append(distance[near])
    i, j, distance = (np.concatenate(parts) for parts in (first, second, away))
    pair = i * len(radius) + j
    order = np.lexsort((distance, pair))
    _, begin, count = np.unique(pair[order], return_index=True, return_counts=True)
    begin, count = begin[count >= c.fewest], count[count >= c.fewest]
    at = order[begin]
    return Touching(i[at], j[at], distance[order[begin + (c.low * (count - 1)).round().astype(int)]], count)


def sized(near: Touching, radius: np.ndarray, free: np.ndarray, sigma: float, stated: float | None) -> Sized:
    """Relative errors of radii from the distances of pairs, by least squares with the errors' own spread as prior.

    A pair that is nearer than it may be counts in full, one that stands apart the less the farther (Cauchy's weight),
    as it may never have touched. The prior's spread is ``stated``, or fitted (expectation maximisation: Dempster,
    Laird & Rubin 1977, J. R. Stat. Soc. B 39, 1). Tracking noise sigma [m] brings all pairs nearer by a share of it,
    and a wrong scale of the picture all apart: both are fitted, and are no errors of radii.
    """
    c = current().radii
    i, j, total = near.i, near.j, radius[near.i] + radius[near.j]
    gap, noise = near.distance / total - 1.0, math.sqrt(2.0) * sigma / total
    error = np.sqrt(2.0 * noise**2 / np.minimum(near.frames, c.looks / 2) + c.rough**2)
    column = np.cumsum(free) - 1
    count = int(free.sum())
    rows = np.arange(len(i))
    entries = [(rows, np.maximum(column[k], 0), free[k] * radius[k] / total) for k in (i, j)]
    entries += [(rows, np.full(len(i), count), -noise), (rows, np.full(len(i), count + 1), np.ones(len(i)))]
    row, at, v = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    design = csc_matrix((v, (row, at)), shape=(len(i), count + 2))
    spread, found = stated or c.first, np.zeros(count + 2)
    found[count] = c.shift
    variance = np.full(count, spread**2)
    for k in range(c.rounds):
        rest = gap - design @ found
        wide = c.apart * (1.0 + c.far * max(0.0, 1.0 - k / c.narrowed))
        weight = np.where(rest > 0, 1.0 / (1.0 + (rest / wide) ** 2) ** 2, 1.0) / error**2
        prior = np.append(np.full(count, spread**-2), [c.shift_spread**-2, c.alike**-2])
        solver = splu((design.T @ diags(weight) @ design + diags(prior)).tocsc())
        found = solver.solve(design.T @ (weight * gap) + prior * np.append(np.zeros(count), [c.shift, 0.0]))
        if (k + 1) % c.every == 0:
            variance = np.diag(solver.solve(np.eye(count + 2)))[:count]
            told = variance < c.told * spread**2
            if stated is None and told.sum() >= c.many:
                spread = float(np.sqrt(np.mean(found[:count][told] ** 2 + variance[told])))
    change = np.zeros(len(radius))
    change[free] = found[:count]
    return Sized(change, spread, float(np.sqrt(variance.mean())), int((variance < c.told * spread**2).sum()))


def with_radii(recording: Recording, film: np.ndarray, sigma: float, learnt: int) -> tuple[Recording, Sized | None]:
    """The recording with radii of grains put right, and how far off they were; None where they are as believed.

    film : (T, n, 2) in the scene's order [m];  learnt : frames of it that may be looked at
    """
    c = current().radii
    bodies, stated = recording.scene.bodies, recording.radius_error
    free = np.array([b.role == "grain" for b in bodies]) & (np.isfinite(film[:learnt, :, 0]).sum(axis=0) >= c.fewest)
    if stated == 0 or free.sum() < c.many:
        return recording, None
    radius = np.array([b.radius for b in bodies])
    near = touching(film[:learnt], radius, free)
    if len(near.i) < free.sum():
        return recording, None
    found = sized(near, radius, free, sigma, stated)
    if found.told < c.many or found.off > c.most or (stated is None and found.off < c.worth):
        return recording, None
    scene = replace(recording.scene, bodies=_resized(bodies, found.change))
    return replace(recording, scene=scene, radius_error=found.left), found


def _resized(bodies: Sequence[Body], change: np.ndarray) -> tuple[Body, ...]:
    """Bodies with other radii; masses that follow from the radii go with them."""
    grains = [b for b in bodies if b.role == "grain"]
    scatter = current().radii.density
    density = np.array([b.mass / b.radius**3 for b in grains])
    power = 3 if np.ptp(density) < scatter * density.mean() else 0
    return tuple(
        replace(b, radius=b.radius * (1 + float(off)), mass=b.mass * (1 + float(off)) ** power) if off else b
        for b, off in zip(bodies, change, strict=True)
    )
