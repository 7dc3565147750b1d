"""Radii of grains, put right by who touches whom: grains of a bed do not overlap, and seldom stand apart.

Of two grains that touch most of the time the distance is the sum of their radii, whatever the rest of the bed does.
Each grain has some four such neighbours, and all their radii follow from all those distances together. What is left of
the error is told, so that replicates are as far off. Where links are as long as the first disk is wide, and that is
unsure, their length is what the film shows.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from ...laws import AUTOMATIC
from ...recording import Recording
from ...scene import Body, LawUse, Scene
from ..criteria import current
from ..hypothesis import Free, Term, set_camera

# pairs of neighbours make a matrix that is symmetric and nearly planar
SYMMETRIC: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True},
}  # fmt: skip


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
    row, at, v = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    sizes = csc_matrix((v, (row, at)), shape=(len(i), count))
    shared = np.column_stack([-noise, np.ones(len(i))])
    believed, sure = np.array([c.shift, 0.0]), np.array([c.shift_spread**-2, c.alike**-2])
    spread, found, both = stated or c.first, np.zeros(count), believed
    variance = np.full(count, spread**2)
    for k in range(c.rounds):
        rest = gap - sizes @ found - shared @ both
        wide = c.apart * (1.0 + c.far * max(0.0, 1.0 - k / c.narrowed))
        weight = np.where(rest > 0, 1.0 / (1.0 + (rest / wide) ** 2) ** 2, 1.0) / error**2
        # what all pairs share would fill the sparse matrix: it is eliminated by hand
        solver = splu((sizes.T @ diags(weight) @ sizes + diags(np.full(count, spread**-2))).tocsc(), **SYMMETRIC)
        cross = sizes.T @ (weight[:, None] * shared)
        apart = solver.solve(cross)
        own = shared.T @ (weight[:, None] * shared) + np.diag(sure) - cross.T @ apart
        alone = solver.solve(sizes.T @ (weight * gap))
        both = np.linalg.solve(own, shared.T @ (weight * gap) + sure * believed - cross.T @ alone)
        found = alone - apart @ both
        # a stated spread stays as it is: how well radii are known is asked at the end alone
        if k + 1 == c.rounds or (stated is None and (k + 1) % c.every == 0):
            inverse = np.diag(solver.solve(np.eye(count)))
            variance = inverse + np.sum(apart * np.linalg.solve(own, apart.T).T, axis=1)
            told = variance < c.told * spread**2
            if stated is None and told.sum() >= c.many:
                spread = float(np.sqrt(np.mean(found[told] ** 2 + variance[told])))
    change = np.zeros(len(radius))
    change[free] = found
    return Sized(change, spread, float(np.sqrt(variance.mean())), int((variance < c.told * spread**2).sum()))


def with_radii(recording: Recording, film: np.ndarray, sigma: float, learnt: int) -> tuple[Recording, Sized | None]:
    """The recording with radii of grains put right, and how far off they were; None where they are as believed.

    Links that are as long as a disk is wide get the length that the film shows, where radii are unsure.
    film : (T, n, 2) in the scene's order [m];  learnt : frames of it that may be looked at
    """
    stated = recording.radius_error
    found = None if stated == 0 else _told(recording, film[:learnt], sigma)
    if found is not None:
        bodies = _resized(recording.scene.bodies, found.change)
        recording = replace(recording, scene=replace(recording.scene, bodies=bodies), radius_error=found.left)
    if found is not None or stated:
        recording = replace(recording, scene=_linked_as_seen(recording.scene, film[:learnt], sigma))
    return recording, found


def _told(recording: Recording, film: np.ndarray, sigma: float) -> Sized | None:
    """What the pairs of a film (T, n, 2) say of radii; None where that is too little, or no more than was believed."""
    c = current().radii
    bodies, stated = recording.scene.bodies, recording.radius_error
    free = np.array([b.role == "grain" for b in bodies]) & (np.isfinite(film[:, :, 0]).sum(axis=0) >= c.fewest)
    if free.sum() < c.many:
        return None
    radius = np.array([b.radius for b in bodies])
    near = touching(film, radius, free)
    if len(near.i) < free.sum():
        return None
    found = sized(near, radius, free, sigma, stated)
    if found.told < c.many or found.off > c.most or (stated is None and found.off < c.worth):
        return None
    return found


def link_stretch(scene: Scene, item: LawUse, film: np.ndarray, sigma: float) -> list[np.ndarray]:
    """Of linked disks that are seen often enough, their distances (k,) over the length of their link at rest.

    film : (T, n, 2) in the scene's order, unwrapped [m], NaN where not seen.  The noise across a link lengthens it by
    sigma^2/|r|, which is taken off.
    """
    length, found = float(scene.resolved(item)["length"]), list[np.ndarray]()
    for i, j in (pair for chain in scene.chains for pair in pairwise(chain)) if length > 0 else ():
        d = np.hypot(*(film[:, j] - film[:, i]).T)
        d = d[np.isfinite(d)]
        if len(d) > current().windows.candidates.sights:
            found.append((d - sigma**2 / np.maximum(d, 1e-12)) / length)
    return found


def _linked_as_seen(scene: Scene, film: np.ndarray, sigma: float) -> Scene:
    """The scene whose links that follow from radii are as long as the film (T, n, 2) shows them.

    The springs between disks are stiff: their mean length is that at rest.
    """
    for item in scene.laws_as("link"):
        means = [q.mean() for q in link_stretch(scene, item, film, sigma)] if item.values["length"] is AUTOMATIC else []
        if len(means) > 1:
            length = float(scene.resolved(item)["length"]) * float(np.mean(means))
            scene = scene.with_parameter(f"{item.name}.length", length)
    return scene


def all_sizes(names: Collection[str]) -> Term:
    """All radii of what moves, in the recordings of these names, too large or too small by one factor.

    Circles are read off too wide or too narrow, all alike: that is no physics, and the factor a number of every fit.
    """
    off = current().radii.all
    free = Free("radii", "1", 1 - off, 1 + off, 1.0, current().radii.worth, frozenset(names), 1.0)

    def apply(scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        bodies = tuple(replace(b, radius=b.radius * float(values[0])) if b.mobile else b for b in scene.bodies)
        return replace(scene, bodies=bodies), camera

    return Term("radius_error", "radii of all", (free,), apply, expression="radius = s believed")


def seen_scale(names: Collection[str], links: Collection[str]) -> Term:
    """The scale of the picture where links, the laws of these names, have the length that is seen and cannot tell it.

    A period, or walls, tell it, and it is a number of every fit: seen = s true.
    """
    off = current().radii.all
    free = Free("camera.scale", "1", 1 - off, 1 + off, 1.0, current().radii.worth, frozenset(names), 1.0)

    def apply(scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        s = float(values[0])
        for item in scene.laws_as("link"):
            if item.name in links:
                scene = scene.with_parameter(f"{item.name}.length", float(item.values["length"]) / s)
        return set_camera("scale")(scene, camera, values)

    return Term("camera_scale", "picture of all", (free,), apply, expression="seen = s true")


def unsure_sizes(given: Sequence[Recording], unsure: Collection[str], whole: bool) -> list[Term]:
    """Numbers of every fit, of the recordings whose radii are ``unsure``, by their names; ``given`` : as they came.

    ``whole`` : windows have the whole bed. In a part of it, grains about it carried along as seen, the scale of the
    picture and that of all radii are one.
    """
    own = [r for r in given if r.name in unsure]
    if not own:
        return []
    links = {item.name for r in own for item in r.scene.laws_as("link") if item.values["length"] is AUTOMATIC}
    fixed = whole and all(r.scene.periodic_x or any(not b.mobile for b in r.scene.bodies) for r in own)
    return [all_sizes(unsure)] + [seen_scale(unsure, links)] * bool(links and fixed)


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
