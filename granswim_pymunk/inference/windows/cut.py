"""The neighbourhood of a swimmer, cut out of its bed: grains farther off are walls that move as the film shows.

What a window costs grows with the bodies in it, what it tells comes from the swimmer and the grains around it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...scene import Scene
from ..criteria import current


@dataclass(frozen=True, eq=False)
class Cut:
    """Rows of a scene's bodies: ``inside`` those that move freely (and fixed ones near them), ``wall`` those that
    are carried along as the film shows them."""

    inside: np.ndarray
    wall: np.ndarray

    @property
    def rows(self) -> np.ndarray:
        return np.sort(np.concatenate([self.inside, self.wall]))


def cut_out(
    scene: Scene, xy: np.ndarray, frames: Sequence[int] | np.ndarray, span: int, reach: float | None = None
) -> Cut | None:
    """What is near the swimmer in any window of a film, or None where that is nearly all.

    xy : (T, n, 2) [m], unwrapped, NaN where not seen;  frames : at which windows start;  span : their length, frames
    reach [m] : within which of a disk grains are simulated, see ``CutCriteria``
    """
    criteria = current().windows.cut
    reach = criteria.reach if reach is None else reach
    radius = np.array([b.radius for b in scene.bodies])
    mobile = np.array([b.mobile for b in scene.bodies])
    fixed = [k for k, b in enumerate(scene.bodies) if not b.mobile and b.initial is not None]
    disks = np.array([k for chain in scene.chains for k in chain], dtype=np.int64)
    period = scene.periodic_x or 0.0

    def tree(points: np.ndarray) -> cKDTree:
        if not period:
            return cKDTree(points)
        return cKDTree(np.concatenate([points + np.array([k * period, 0.0]) for k in (-1, 0, 1)]))

    looks = []
    for frame in frames:
        for at in (int(frame), int(frame) + span):
            places = np.array(xy[at])
            for k in fixed:
                places[k] = scene.bodies[k].initial[:2]  # type: ignore[index]
            if period:
                places[:, 0] %= period
            looks.append((places, np.isfinite(places[:, 0])))
    inside = np.zeros(len(radius), dtype=bool)
    for places, known in looks:
        mine = disks[known[disks]]
        if len(mine):
            away, _ = tree(places[mine]).query(np.where(known[:, None], places, 1e9))
            inside |= known & (away < reach)
    inside[disks] = True
    near = np.array(inside)
    widest = 2.0 * float(radius.max()) + criteria.gap
    for places, known in looks:
        mine = np.flatnonzero(inside & known)
        others = np.flatnonzero(~inside & known)
        if not len(mine) or not len(others):
            continue
        pairs = tree(places[mine]).query_ball_point(places[others], widest)
        for other, found in zip(others, pairs, strict=True):
            if found:
                j = mine[np.asarray(found) % len(mine)]
                d = places[j] - places[other]
                if period:
                    d[:, 0] -= period * np.round(d[:, 0] / period)
                near[other] |= bool((np.hypot(*d.T) < radius[other] + radius[j] + criteria.gap).any())
    wall = near & ~inside & mobile
    inside = near & ~wall
    if inside.sum() + wall.sum() > criteria.worth * len(radius):
        return None
    return Cut(np.flatnonzero(inside), np.flatnonzero(wall))


def carried_paths(t: np.ndarray, xy: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Where bodies are at times ``at`` (A,) [s], (A, k, 2), by x0 + v s + a s^2/2 through their sightings.

    t : (T,) [s];  xy : (T, k, 2) [m], unwrapped, NaN where not seen. With less than four sightings: a straight line
    through two or three, a body at rest with one; NaN with none. Source: Savitzky & Golay 1964, Anal. Chem. 36, 1627.
    """
    middle, scale = 0.5 * (t[0] + t[-1]), max(0.5 * float(t[-1] - t[0]), 1e-12)
    s, later = (t - middle) / scale, (at - middle) / scale
    out = np.full((len(at), xy.shape[1], 2), np.nan)
    seen = np.isfinite(xy[..., 0])
    count, enough = seen.sum(axis=0), current().windows.starts.sightings
    for terms, chosen in ((3, count >= enough), (2, (count > 1) & (count < enough)), (1, count == 1)):
        rows = np.flatnonzero(chosen)
        if not len(rows):
            continue
        design = np.stack([s**p for p in range(terms)], axis=1)
        mine = seen[:, rows].astype(float)
        normal = np.einsum("tn,ti,tj->nij", mine, design, design)
        right = np.einsum("ti,tnc->nic", design, np.where(seen[:, rows, None], xy[:, rows], 0.0))
        found = np.linalg.solve(normal, right)
        out[:, rows] = np.einsum("ai,nic->anc", np.stack([later**p for p in range(terms)], axis=1), found)
    return out
