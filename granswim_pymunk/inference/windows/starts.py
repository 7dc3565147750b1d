"""Starts of short windows in a bed: drawn from what five frames say, without overlaps and stretched joints.

Twenty micrometres of tracking noise are forty contact overlaps: a start from raw positions would throw the
grains about at a metre a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from ...compiled import njit
from ...scene import Scene
from ..criteria import current


@dataclass(frozen=True)
class Posterior:
    """Positions and velocities of the tracked bodies at one frame, and their spread.

    mean : (n, 2, 2) position [m], velocity [m/s] by axis;  root : (n, 2, 2) with root root^T the covariance
    of (position, velocity) of one axis
    """

    mean: np.ndarray
    root: np.ndarray


def local_quadratic(t: np.ndarray, xy: np.ndarray, frame: int, sigma: float) -> Posterior:
    """Least squares x0 + v s + a s^2/2 over ``frame`` - 2 .. + 2, wider for a body that is missing in some.

    t : (T,) [s];  xy : (T, n, 2) [m], unwrapped, NaN where not seen;  sigma [m]
    Source: Savitzky & Golay 1964, Anal. Chem. 36, 1627.
    """
    n = xy.shape[1]
    mean, root = np.zeros((n, 2, 2)), np.zeros((n, 2, 2))
    todo = np.arange(n)
    criteria = current().windows.starts
    for half in range(criteria.half, criteria.widest + 1):
        low, high = max(frame - half, 0), min(frame + half + 1, len(t))
        piece = xy[low:high][:, todo]
        seen = np.isfinite(piece[..., 0])
        enough = seen.sum(axis=0) >= (criteria.sightings if half < criteria.widest else criteria.scanty)
        if enough.any():
            _solve(t[low:high] - t[frame], piece[:, enough], seen[:, enough], sigma, todo[enough], mean, root)
        todo = todo[~enough]
        if not len(todo):
            break
    for k in todo:  # hardly seen at all: where it was last, at rest, as unsure as a tenth of a millimetre
        at = np.flatnonzero(np.isfinite(xy[:, k, 0]))
        near = at[np.argmin(np.abs(at - frame))] if len(at) else 0
        mean[k, 0] = xy[near, k] if len(at) else 0.0
        root[k] = np.diag(current().windows.starts.lost)
    return Posterior(mean, root)


def _solve(s, piece, seen, sigma, rows, mean, root) -> None:
    scale = max(float(np.abs(s).max()), 1e-12)
    design = np.stack([np.ones_like(s), s / scale, 0.5 * (s / scale) ** 2], axis=1)
    normal = np.einsum("tn,ti,tj->nij", seen.astype(float), design, design)
    right = np.einsum("ti,tnc->nic", design, np.where(seen[..., None], piece, 0.0))
    inverse = np.linalg.inv(normal)
    found = inverse @ right
    unit = np.array([1.0, 1.0 / scale])
    mean[rows] = found[:, :2] * unit[:, None]
    root[rows] = np.linalg.cholesky(sigma**2 * inverse[:, :2, :2] * unit[:, None] * unit)


def draw(posterior: Posterior, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (n, 2) of one member; ``normals`` (n, 2, 2): standard normal numbers."""
    change = posterior.root @ normals
    return posterior.mean[:, 0] + change[:, 0], posterior.mean[:, 1] + change[:, 1]


@dataclass(frozen=True)
class Shapes:
    """What may not overlap: radii [m], walls, the period, who hangs together at which length [m]."""

    radius: np.ndarray
    mobile: np.ndarray
    group: np.ndarray
    joints: np.ndarray
    lengths: np.ndarray
    period: float

    @classmethod
    def of(cls, scene: Scene) -> Shapes:
        group = np.zeros(len(scene.bodies), dtype=np.int64)
        joints: list[tuple[int, int]] = []
        lengths: list[float] = []
        length = 0.0
        for item in scene.laws_as("link"):
            length = float(scene.resolved(item)["length"])
        for number, chain in enumerate(scene.chains):
            group[list(chain)] = number + 1
            if length:
                joints += list(pairwise(chain))
                lengths += [length] * (len(chain) - 1)
        return cls(
            np.array([b.radius for b in scene.bodies]),
            np.array([b.mobile for b in scene.bodies]),
            group,
            np.array(joints, dtype=np.int64).reshape(-1, 2),
            np.array(lengths),
            float(scene.periodic_x or 0.0),
        )

    def part(self, rows: np.ndarray, held: Sequence[int] | np.ndarray = ()) -> Shapes:
        """Of some bodies, joints that lie wholly among them; ``held`` do not give way."""
        if len(rows) == len(self.radius) and not len(held):
            return self
        new = np.full(len(self.radius), -1, dtype=np.int64)
        new[rows] = np.arange(len(rows))
        mobile = np.array(self.mobile)
        mobile[np.asarray(held, dtype=np.int64)] = False
        joints = new[self.joints]
        kept = (joints >= 0).all(axis=1)
        return Shapes(
            self.radius[rows], mobile[rows], self.group[rows], joints[kept], self.lengths[kept], self.period
        )  # fmt: skip


def take_apart(xy: np.ndarray, shapes: Shapes) -> np.ndarray:
    """The nearest positions (n, 2) [m] without overlaps and with joints at their length, to below 0.5 micrometres.

    Gauss-Seidel on the pairs, each moved by half of what is wrong (walls stay).
    Source: Jakobsen 2001, Advanced character physics (position projection).
    """
    criteria = current().windows.starts
    xy, links = np.array(xy), len(shapes.joints)
    for _ in range(4):
        pairs = np.concatenate([shapes.joints, _near(xy, shapes)])
        lengths = np.concatenate([shapes.lengths, shapes.radius[pairs[links:]].sum(axis=1)])
        left = _relax(xy, shapes.mobile, pairs, lengths, links, shapes.period, criteria.rounds, criteria.clear)
        if left <= criteria.clear:
            break
    return xy


def _near(xy: np.ndarray, shapes: Shapes) -> np.ndarray:
    reach = 2 * float(shapes.radius.max()) + current().windows.starts.room
    if shapes.period:
        wrapped = np.column_stack([np.mod(xy[:, 0], shapes.period), xy[:, 1] - xy[:, 1].min() + reach])
        wrapped[wrapped[:, 0] >= shapes.period, 0] = 0.0
        height = float(wrapped[:, 1].max()) + 2 * reach
        tree = cKDTree(wrapped, boxsize=(shapes.period, height))
    else:
        tree = cKDTree(xy)
    pairs = tree.query_pairs(reach, output_type="ndarray")
    i, j = pairs.T
    d = xy[j] - xy[i]
    if shapes.period:
        d[:, 0] -= shapes.period * np.round(d[:, 0] / shapes.period)
    close = np.hypot(*d.T) < shapes.radius[i] + shapes.radius[j] + current().windows.starts.room
    apart = (shapes.group[i] == 0) | (shapes.group[i] != shapes.group[j])
    chosen = pairs[close & apart & (shapes.mobile[i] | shapes.mobile[j])]
    return np.ascontiguousarray(chosen[np.lexsort((chosen[:, 1], chosen[:, 0]))].astype(np.int64))


@njit(cache=True, nogil=True)
def _relax(xy, mobile, pairs, lengths, links, period, rounds, clear):
    """Move pairs to their lengths [m]: the first ``links`` to these, the others to no less; what is left [m]."""
    worst = 0.0
    for _ in range(rounds):
        worst = 0.0
        for k in range(pairs.shape[0]):
            i, j = pairs[k, 0], pairs[k, 1]
            dx, dy = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
            if period > 0.0:
                dx -= period * round(dx / period)
            d = (dx * dx + dy * dy) ** 0.5
            wrong = lengths[k] - d
            if (wrong <= 0.0 and k >= links) or d == 0.0:
                continue
            worst = max(worst, abs(wrong))
            share = wrong / d / (int(mobile[i]) + int(mobile[j]))
            if mobile[i]:
                xy[i, 0] -= share * dx
                xy[i, 1] -= share * dy
            if mobile[j]:
                xy[j, 0] += share * dx
                xy[j, 1] += share * dy
        if worst <= clear:
            break
    return worst
