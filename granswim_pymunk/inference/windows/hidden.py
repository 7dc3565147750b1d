"""Grains that a tracker never found: voids of the film that keep the size of a grain while all around them moves.

Where a grain is left out, its neighbours are predicted to move into its place. In a bed a circle of the smallest
grain's size seldom fits between grains, and where grains move such a void closes; one that stays open has a grain in
it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.spatial import Delaunay, QhullError, cKDTree

from ...recording import Recording
from ...scene import Body
from ..criteria import current

NAME = "hidden grain "  # with a number, of a grain that the film does not show


@cache
def triples(count: int) -> np.ndarray:
    """(k, 3) all choices of three out of so many."""
    return np.array(list(itertools.combinations(range(count), 3)))


@dataclass(frozen=True)
class Voids:
    """Of the frames that were looked at.

    centre : (L, k, 2) [m];  radius : (L, k) what is free about it [m];  strain : (k,) how far the bodies about it have
    moved against it, at most [m]
    """

    centre: np.ndarray
    radius: np.ndarray
    strain: np.ndarray


def circles(xy: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Circles that touch three circles from outside: centres (..., 2), radii (...), NaN where there is none.

    |p - x_k| = r_k + R; differences of the squares are linear in p and R, the first is then a quadratic in R.
    xy : (..., 3, 2) [m];  radius : (..., 3) [m]
    """
    away = xy[..., 1:, :] - xy[..., :1, :]
    r0 = radius[..., 0]
    more = radius[..., 1:] - r0[..., None]
    # away . q + more R = b, with q = p - x_0
    b = 0.5 * (np.sum(away**2, axis=-1) - radius[..., 1:] ** 2 + r0[..., None] ** 2)
    det = away[..., 0, 0] * away[..., 1, 1] - away[..., 0, 1] * away[..., 1, 0]
    with np.errstate(all="ignore"):
        rows = (away[..., 1, 1], -away[..., 0, 1]), (-away[..., 1, 0], away[..., 0, 0])
        inverse = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2) / det[..., None, None]
        p0 = np.einsum("...ij,...j->...i", inverse, b)
        p1 = -np.einsum("...ij,...j->...i", inverse, more)
        # |p0 + p1 R|^2 = (r0 + R)^2
        a2 = np.sum(p1**2, axis=-1) - 1.0
        a1 = np.sum(p0 * p1, axis=-1) - r0
        a0 = np.sum(p0**2, axis=-1) - r0**2
        root = np.sqrt(a1**2 - a2 * a0)
        both = np.stack([(-a1 - root) / a2, (-a1 + root) / a2], axis=-1)
        both = np.where(both > 0, both, np.inf)
        size = both.min(axis=-1)
        size = np.where(np.isfinite(size), size, np.nan)
        centre = xy[..., 0, :] + p0 + p1 * size[..., None]
    return centre, size


def _enclosed(centre: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(...) whether points (..., 2) lie inside triangles (..., 3, 2)."""
    d = corners - centre[..., None, :]
    cross = [d[..., i, 0] * d[..., j, 1] - d[..., i, 1] * d[..., j, 0] for i, j in ((0, 1), (1, 2), (2, 0))]
    signs = np.sign(np.stack(cross, axis=-1))
    inside: np.ndarray = np.abs(signs.sum(axis=-1)) == 3
    return inside


class _Frame:
    """Bodies of one frame, with their images along x."""

    def __init__(self, xy: np.ndarray, radius: np.ndarray, period: float) -> None:
        self.period = period
        places = xy.copy()
        if period:
            places[:, 0] %= period
        shifts = (-period, 0.0, period) if period else (0.0,)
        self.places = np.concatenate([places + np.array([s, 0.0]) for s in shifts])
        self.radius = np.tile(radius, len(shifts))
        near = np.ones(len(self.places), dtype=bool)
        if period:
            edge = current().windows.hidden.edge * radius.max()
            near = (self.places[:, 0] > -edge) & (self.places[:, 0] < period + edge)
        self.bodies = np.tile(np.arange(len(radius)), len(shifts))[near]
        self.places, self.radius = self.places[near], self.radius[near]
        self.tree = cKDTree(self.places)
        self.most, self.usual = float(radius.max()), float(radius.mean())

    def about(self, points: np.ndarray) -> np.ndarray:
        """(k, ``neighbours``) rows of ``places``: bodies whose surfaces are nearest to points (k, 2) in the box."""
        wanted = current().windows.hidden.neighbours
        distance, rows = self.tree.query(points, min(3 * wanted, len(self.places)))
        order = np.argsort(distance - self.radius[rows], axis=1)[:, :wanted]
        return np.take_along_axis(rows, order, axis=1)

    def void(self, points: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Empty circles held by three bodies, near points (k, 2): large ones, with centres within ``reach`` (k,) [m].

        Where there is none, the point itself and what is free about it: a cage that is open on one side holds none.
        """
        criteria = current().windows.hidden
        rows, three = self.about(points), triples(criteria.neighbours)
        corners, sizes = self.places[rows][:, three], self.radius[rows][:, three]
        centre, size = circles(corners, sizes)
        away = np.hypot(*np.moveaxis(centre[:, :, None] - self.places[rows][:, None], -1, 0))
        free = away - self.radius[rows][:, None]
        off = np.hypot(*np.moveaxis(centre - points[:, None], -1, 0))
        with np.errstate(invalid="ignore"):
            good = (free.min(axis=2) > size - criteria.rounding) & _enclosed(centre, corners)
            good &= (size < criteria.first[1] * self.most) & (off < reach[:, None])
            best = np.argmax(np.where(good, size - 0.5 * off, -np.inf), axis=1)
        at = np.arange(len(points)), best
        found = good[at]
        here = (np.hypot(*np.moveaxis(points[:, None] - self.places[rows], -1, 0)) - self.radius[rows]).min(axis=1)
        return np.where(found[:, None], centre[at], points), np.where(found, size[at], here)


def _filled(t: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Positions (T, n, 2) with what was not seen put in between, or as at the nearest sight; never seen: NaN."""
    out = xy.copy()
    for k in np.flatnonzero(~np.isfinite(xy[..., 0]).all(axis=0)):
        seen = np.isfinite(xy[:, k, 0])
        if seen.any():
            for a in (0, 1):
                out[:, k, a] = np.interp(t, t[seen], xy[seen, k, a])
    return out


def follow(
    frames: Sequence[_Frame], xy: np.ndarray, first: np.ndarray, begin: int, early: np.ndarray, least: float
) -> Voids:
    """Voids that are at ``first`` (k, 2) [m] in frame ``begin``, before and after it, of those that stay open.

    xy : (L, n, 2) of bodies in these frames [m];  early : (L,) bool, frames that tell whether a void stays open: it
    has ``least`` [m] about it in all but a few. From frame to frame a void goes with the bodies about it, then to where
    there is room.
    """
    period, step = frames[begin].period, current().windows.hidden.farthest * frames[begin].usual
    allowed = (1 - current().windows.hidden.open) * early.sum()

    def wrapped(points: np.ndarray) -> np.ndarray:
        return np.column_stack([points[:, 0] % period, points[:, 1]]) if period else points

    centre, size = np.zeros((len(frames), len(first), 2)), np.zeros((len(frames), len(first)))
    centre[begin], size[begin] = frames[begin].void(wrapped(first), np.full(len(first), step))
    missed = np.zeros(len(first))
    for way in (1, -1):
        k = begin
        while 0 <= k + way < len(frames):
            on = np.flatnonzero(missed <= allowed)
            if not len(on):
                break
            carriers = frames[k].bodies[frames[k].about(wrapped(centre[k, on]))[:, : current().windows.hidden.carriers]]
            carried = centre[k, on] + np.median((xy[k + way] - xy[k])[carriers], axis=1)
            k += way
            places, size[k, on] = frames[k].void(wrapped(carried), np.full(len(on), step))
            if period:
                places[:, 0] += period * np.round((carried[:, 0] - places[:, 0]) / period)
            centre[k, on] = places
            missed[on] += early[k] & (size[k, on] < least)
    stayed = missed <= allowed
    centre, size = centre[:, stayed], size[:, stayed]
    return Voids(centre, size, _strain(xy[early], centre[early], frames[begin], begin))


def _strain(xy: np.ndarray, centre: np.ndarray, frame: _Frame, begin: int) -> np.ndarray:
    """(k,) rms over the bodies about a void of how far they move against its centre, at most [m]."""
    points = centre[begin].copy()
    if frame.period:
        points[:, 0] %= frame.period
    about = frame.bodies[frame.about(points)[:, : current().windows.hidden.carriers]]
    moved = (xy - xy[begin])[:, about] - (centre - centre[begin])[:, :, None]
    largest: np.ndarray = np.sqrt(np.mean(np.sum(moved**2, axis=-1), axis=-1)).max(axis=0)
    return largest


def hidden_grains(
    t: np.ndarray, xy: np.ndarray, bodies: Sequence[Body], period: float, sigma: float, off: float, learnt: int
) -> tuple[list[Body], np.ndarray]:
    """Grains that a film does not show, and where they are: (T, k, 2) [m].

    xy : (T, n, 2) of all bodies [m], unwrapped, NaN where not seen;  sigma : of a sighting [m];  off : relative error
    of radii;  learnt : so many frames, the first ones, tell whether a void stays open
    """
    criteria = current().windows.hidden
    grains = [k for k, b in enumerate(bodies) if b.role == "grain"]
    none: tuple[list[Body], np.ndarray] = [], np.zeros((len(t), 0, 2))
    places = _filled(t, xy)
    for k, b in enumerate(bodies):
        if not np.isfinite(places[0, k]).all() and b.initial is not None:
            places[:, k] = b.initial[:2]
    there = np.isfinite(places[0, :, 0])
    if len(grains) < criteria.neighbours or there.sum() < criteria.neighbours + 1:
        return none
    sizes = np.array([bodies[k].radius for k in grains])
    radius = np.array([b.radius for b in bodies])[there]
    places = places[:, there]
    least = float(sizes.min()) * (1 - criteria.sure * off) - criteria.sure * sigma
    most = float(sizes.max()) * (1 + criteria.sure * off) + criteria.sure * sigma
    step = max(round(criteria.stride / float(np.median(np.diff(t)))), 1)
    looks = np.unique(np.append(np.arange(0, len(t), step), len(t) - 1))
    early = looks < learnt
    frames = [_Frame(places[k], radius, period) for k in looks]
    found: list[Voids] = []
    for begin in np.unique(np.linspace(0, early.sum() - 1, criteria.beginnings).astype(int)):
        first = _voids_of(frames[begin], least, float(sizes.max()))
        if len(first):
            found.append(follow(frames, places[looks], first, int(begin), early, least))
    if not found:
        return none
    centre = np.concatenate([v.centre for v in found], axis=1)
    strain = np.concatenate([v.strain for v in found])
    sized = np.quantile(np.concatenate([v.radius for v in found], axis=1)[early], criteria.size, axis=0)
    chosen = np.flatnonzero((sized >= least) & (sized <= most) & (strain > criteria.strained * least))
    density = float(np.median([bodies[k].mass / bodies[k].radius ** 3 for k in grains]))
    made: list[Body] = []
    kept: list[int] = []
    taken = {b.id for b in bodies}
    for k in map(int, chosen):
        apart = centre[:, kept] - centre[:, [k]]
        if period:
            apart[..., 0] -= period * np.round(apart[..., 0] / period)
        if kept and np.min(np.hypot(*np.moveaxis(apart, -1, 0))) < least:
            continue  # two that began apart went to the same place
        kept.append(k)
        r = float(np.clip(sized[k], sizes.min(), sizes.max()))
        name = next(n for n in (f"{NAME}{i}" for i in itertools.count(len(made) + 1)) if n not in taken)
        taken.add(name)
        made.append(replace(bodies[grains[0]], id=name, radius=r, mass=density * r**3, initial=None))
    between = [np.interp(t, t[looks], centre[:, k, a]) for k in kept for a in (0, 1)]
    return made, np.reshape(between, (len(kept), 2, len(t))).transpose(2, 0, 1)


def _voids_of(frame: _Frame, least: float, most: float) -> np.ndarray:
    """(k, 2) centres of empty circles of a grain's size, held by three bodies [m]."""
    try:
        triangles = Delaunay(frame.places).simplices
    except QhullError:
        return np.zeros((0, 2))
    criteria = current().windows.hidden
    start, size = circles(frame.places[triangles], frame.radius[triangles])
    good = np.isfinite(size) & (size > criteria.first[0] * least) & (size < criteria.first[1] * most)
    if frame.period:
        good &= (start[:, 0] >= 0.0) & (start[:, 0] < frame.period)
    start = start[good]
    if not len(start):
        return start
    found, room = frame.void(start, np.full(len(start), criteria.farthest * least))
    found = found[room > criteria.room * least]
    kept = np.sort(np.unique(np.round(found / (criteria.alike * least)), axis=0, return_index=True)[1])
    result: np.ndarray = found[kept]
    return result


def with_hidden(recording: Recording, film: np.ndarray, sigma: float, learnt: int) -> tuple[Recording, np.ndarray]:
    """The recording with grains that its tracker never found, and ``film`` (T, n, 2) with where they are."""
    scene = recording.scene
    made, centre = hidden_grains(
        recording.t, film, scene.bodies, scene.periodic_x or 0.0, sigma, recording.radius_error or 0.0, learnt
    )
    if not made:
        return recording, film
    more = replace(recording, scene=replace(scene, bodies=(*scene.bodies, *made)))
    return more, np.concatenate([film, centre], axis=1)
