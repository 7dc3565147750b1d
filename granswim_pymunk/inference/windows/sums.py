"""What is said of many grains at once: weighted means of their displacements, near the swimmer and far from it.

A grain whose path a bed scrambles tells little, one that goes freely much: each counts by how well it is predicted,
q_i = 1/(s_i^2 + (2 sigma)^2), with s_i the scatter of the members of its window. The weights are a film's own and the
same for whatever is predicted, so that all numbers but the two sizes are linear in the displacements.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from ..criteria import current
from .starts import Posterior

# of grains near and of grains far; "alike": all that surely move count alike, "fast": by the square of their speed
MOMENTS = (
    "mean dx", "mean dy", "along, alike", "along", "along, fast", "across, alike", "across", "across, fast",
    "stretch x", "stretch y", "shear x", "shear y", "size across", "spread",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Sums:
    """How grains of one window are added up, by what the film shows before and at its start.

    start : (g, 2) where they are seen to start [m], NaN where not;  along : (g, 2) unit vectors of their motion
    speed : (g,) [m/s];  moving : (g,) bool, beyond three standard errors;  near : (g,) bool, within two diameters of
    the swimmer;  disk : (g,) which of its disks is the nearest;  disks : how many those are
    place : (g, 2) from the middle of the swimmer [m];  q : (L - 1, g) weights [m^-2], alike where nothing is predicted
    """

    start: np.ndarray
    along: np.ndarray
    speed: np.ndarray
    moving: np.ndarray
    near: np.ndarray
    disk: np.ndarray
    disks: int
    place: np.ndarray
    q: np.ndarray = field(default_factory=lambda: np.ones((1, 1)))

    @property
    def size(self) -> int:
        """How many numbers there are at one look."""
        return size_of(self.disks)

    def sure(self, moved: np.ndarray, sigma: float) -> np.ndarray:
        """Weights (L - 1, g) [m^-2] from members' displacements (m, L - 1, g, 2) [m]; sigma [m] of a sighting."""
        scatter = np.nan_to_num(moved).var(axis=0, ddof=1).mean(axis=-1)
        return 1.0 / (scatter + (current().windows.sums.sure * sigma) ** 2)

    def of(self, moved: np.ndarray) -> np.ndarray:
        """(L - 1, size) of displacements (L - 1, g, 2) [m] since the seen start: moments of grains near, the same of
        those far, then means (dx, dy) of the near about each disk, and of the far; NaN where too few are seen."""
        return np.stack([self._at(d, q) for d, q in zip(moved, np.broadcast_to(self.q, moved.shape[:2]), strict=True)])

    def _at(self, d: np.ndarray, q: np.ndarray) -> np.ndarray:
        valid = np.isfinite(d[:, 0])
        d, place = np.where(valid[:, None], d, 0.0), np.where(valid[:, None], self.place, 0.0)
        q = np.where(valid, q, 0.0)
        parts = np.column_stack([valid & self.near, valid & ~self.near]).astype(float)
        along = np.einsum("gc,gc->g", d, self.along)
        across = d[:, 1] * self.along[:, 0] - d[:, 0] * self.along[:, 1]
        alike, v = q * self.moving, q * self.speed
        fast = v * self.speed
        x, y = q * place[:, 0], q * place[:, 1]
        above = [q * d[:, 0], q * d[:, 1], alike * along, v * along, fast * along, alike * across, v * across,
                 fast * across, x * d[:, 0], y * d[:, 1], y * d[:, 0], x * d[:, 1]]  # fmt: skip
        top = np.array(above) @ parts
        one, some, more, most, wide, high = np.array([q, alike, v, fast, x * place[:, 0], y * place[:, 1]]) @ parts
        # of a stretch, the displacement at the root mean square distance
        below = [one, one, some, more, most, some, more, most, *[np.sqrt(s * one) for s in (wide, high, high, wide)]]
        moments = top / np.maximum(np.array(below), 1e-300)
        count = parts.sum(axis=0)
        mean = np.stack([d[:, 0], d[:, 1]]) @ parts / np.maximum(count, 1.0)
        size = np.sqrt((self.speed * across**2) @ parts / np.maximum(self.speed @ parts, 1e-300))
        spread = np.sqrt(np.maximum(np.sum(d**2, axis=1) @ parts / np.maximum(count, 1.0) - np.sum(mean**2, axis=0), 0))
        moments = np.concatenate([moments, size[None], spread[None]])
        moments[:, count < current().windows.sums.grains] = np.nan
        return np.concatenate([moments.T.ravel(), self._cells(d, q, valid).ravel()])

    def _cells(self, d: np.ndarray, q: np.ndarray, valid: np.ndarray) -> np.ndarray:
        """(2, disks, 2) weighted mean displacement about each disk, of near and of far grains."""
        cell = np.where(self.near, 0, self.disks) + self.disk
        total, count = (np.bincount(cell, weight, 2 * self.disks) for weight in (q, valid.astype(float)))
        added = np.stack([np.bincount(cell, q * d[:, k], 2 * self.disks) for k in (0, 1)], axis=-1)
        means = added / np.maximum(total, 1e-300)[:, None]
        means[count < current().windows.sums.about] = np.nan
        return means.reshape(2, self.disks, 2)


def size_of(disks: int) -> int:
    """How many numbers say how grains about a swimmer of that many disks have moved, at one look."""
    return 2 * len(MOMENTS) + 4 * disks


def near_or_far(disks: int) -> np.ndarray:
    """(size_of(disks),) of each number at one look: 0 of grains near, 1 of grains far."""
    return np.repeat([0, 1, 0, 1], [len(MOMENTS)] * 2 + [2 * disks] * 2)


def sums_of(
    posterior: Posterior, seen: np.ndarray, rows: np.ndarray, grains: np.ndarray, radius: np.ndarray, period: float
) -> Sums:
    """Sums about a frame whose state is ``posterior``.

    seen : (n,) bool, in that frame;  rows, grains : of disks and grains;  radius : (n,) [m];  period [m] along x, or 0
    """
    criteria = current().windows.sums
    start = posterior.mean[grains, 0].copy()
    start[~seen[grains]] = np.nan
    v = posterior.mean[grains, 1]
    speed = np.hypot(*v.T)
    error = np.hypot(*posterior.root[grains, 1].T)
    disks = posterior.mean[rows, 0].copy()
    middle = disks.mean(axis=0)
    place = start - middle
    images, places = disks, start.copy()
    if period:
        place[:, 0] -= period * np.round(place[:, 0] / period)
        images = np.concatenate([disks % [period, np.inf] + np.array([k * period, 0.0]) for k in (-1, 0, 1)])
        places[:, 0] %= period
    known = np.isfinite(places[:, 0])
    distance, nearest = np.full(len(grains), np.inf), np.zeros(len(grains), dtype=np.int64)
    if known.any():
        distance[known], nearest[known] = cKDTree(images).query(places[known])
    nearest %= len(rows)
    near = known & (distance < radius[grains] + radius[rows[nearest]] + criteria.near)
    along = v / np.maximum(speed, 1e-12)[:, None]
    return Sums(start, along, speed, speed > criteria.moving * error, near, nearest, len(rows), place)
