"""Starts of short windows in a bed: drawn from what five frames say, without overlaps and stretched joints.

Twenty micrometres of tracking noise are forty contact overlaps: a start from raw positions would throw the
grains about at a metre a second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from ...compiled import njit
from ...scene import Scene
from ..criteria import current

HALF = 2  # frames on either side of the start; more smooth the velocities, fewer leave them twice as wide
CLEAR = 5.0e-7  # m, overlaps and joint lengths are put right to below this


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
    for half in range(HALF, current().windows.starts.widest + 1):
        low, high = max(frame - half, 0), min(frame + half + 1, len(t))
        piece = xy[low:high][:, todo]
        seen = np.isfinite(piece[..., 0])
        enough = seen.sum(axis=0) >= (4 if half < current().windows.starts.widest else 3)
        if enough.any():
            _solve(t[low:high] - t[frame], piece[:, enough], seen[:, enough], sigma, todo[enough], mean, root)
        todo = todo[~enough]
        if not len(todo):
            break
    for k in todo:  # hardly seen at all: where it was last, at rest, as unsure as a tenth of a millimetre
        at = np.flatnonzero(np.isfinite(xy[:, k, 0]))
        near = at[np.argmin(np.abs(at - frame))] if len(at) else 0
        mean[k, 0] = xy[near, k] if len(at) else 0.0
        root[k] = np.diag([1e-4, 1e-2])
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
    xy = np.array(xy)
    for _ in range(4):
        pairs = _near(xy, shapes)
        left = _relax(
            xy,
            shapes.radius,
            shapes.mobile,
            pairs,
            shapes.joints,
            shapes.lengths,
            shapes.period,
            criteria.rounds,
            CLEAR,
        )
        if left <= CLEAR:
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
def _relax(xy, radius, mobile, pairs, joints, lengths, period, rounds, clear):
    worst = 0.0
    for _ in range(rounds):
        worst = 0.0
        for kind in range(2):
            rows = joints if kind == 0 else pairs
            for k in range(rows.shape[0]):
                i, j = rows[k, 0], rows[k, 1]
                dx, dy = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
                if period > 0.0:
                    dx -= period * round(dx / period)
                d = (dx * dx + dy * dy) ** 0.5
                wrong = (lengths[k] if kind == 0 else radius[i] + radius[j]) - d
                if (wrong <= 0.0 and kind == 1) or d == 0.0:
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


def followed(t: np.ndarray, xy: np.ndarray, sigma: float, period: float = 0.0) -> tuple[np.ndarray, int, int]:
    """Tracks whose labels were swapped put right, and sightings that fit no motion left out.

    t : (T,) [s];  xy : (T, n, 2) [m], unwrapped along ``period``, NaN where not seen.  Returns the tracks, how
    many labels were put back, how many sightings left out. A body is looked for where the last two sightings lead
    it. Bodies that are all elsewhere in one frame are given to each other by least total distance, for good or for
    that frame, if their tracks are much smoother so, the next two frames included: a body that is hit strays, too.
    Source: Crocker & Grier 1996, J. Colloid Interface Sci. 179, 298 (linking); Munkres 1957 (assignment).
    """
    out, smoother = np.array(xy), current().windows.starts.smoother
    put_back = left_out = 0
    second = np.hypot(*np.moveaxis(np.diff(out, n=2, axis=0), -1, 0))
    found = np.isfinite(second)
    if not found.any():
        return out, 0, 0
    # the second difference of a body's motion is mostly below this; of one that is hardly seen, as of all
    common = float(np.median(second[found]))
    usual = np.array([np.median(c[f]) if f.sum() > 4 else common for c, f in zip(second.T, found.T, strict=True)])
    far = np.maximum(12.0 * sigma, 5.0 * np.maximum(usual, common))

    def turns(away: np.ndarray) -> np.ndarray:
        """Whole periods in a distance (..., 2): a body that is followed across a seam may stand any number on."""
        if not period:
            return np.zeros_like(away)
        whole = period * np.round(np.nan_to_num(away[..., 0]) / period)
        return np.stack([whole, np.zeros(away.shape[:-1])], axis=-1)

    last, before = out[0].copy(), np.full_like(out[0], np.nan)
    when, earlier = np.full(out.shape[1], t[0]), np.full(out.shape[1], np.nan)
    known = np.isfinite(last[:, 0])
    column = np.arange(out.shape[1])  # whose label each body has

    def path(body: int, label: int, k: int, after: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Times (p,) and places (p, 2): the last two sightings of a body, and three from ``k`` on under a label.

        ``after``: the label of the last two of these, if another.
        """
        ahead = np.arange(k, min(k + 3, len(t)))
        labels = [label, *[label if after is None else after] * (len(ahead) - 1)]
        times = np.array([earlier[body], when[body], *t[ahead]])
        places = np.concatenate([before[[body]], last[[body]], out[ahead, labels]])
        places -= turns(places - last[body])
        good = np.isfinite(places[:, 0]) & np.isfinite(times)
        return times[good], places[good]

    for k in range(1, len(t)):
        here = out[k, column]
        seen = np.isfinite(here[:, 0])
        v = np.where(np.isfinite(before), (last - before) / (when - earlier)[:, None], 0.0)
        guess = last + v * (t[k] - when)[:, None]
        here = here - turns(here - guess)
        off = np.hypot(*(here - guess).T)
        gone = np.where(np.isfinite(before[:, 0]), (t[k] - when) / (when - earlier), 2.0)
        wide = far * np.clip(gone, 1.0, 4.0)
        odd = np.flatnonzero(seen & known & (off > wide))
        if len(odd) > 1:
            away = here[odd][None] - guess[odd][:, None]
            away -= turns(away)
            _, best = linear_sum_assignment(np.hypot(*np.moveaxis(away, -1, 0)))
            former = column[odd].copy()
            for ring in _rings(best):
                mine, others = odd[ring], former[best[ring]]
                now = np.sum([_bend(*path(b, column[b], k)) for b in mine])
                then = np.sum([_bend(*path(b, c, k)) for b, c in zip(mine, others, strict=True)])
                once = np.sum([_bend(*path(b, c, k, column[b])) for b, c in zip(mine, others, strict=True)])
                if min(then, once) < smoother * now:
                    if then < once:  # who has another's label keeps it until shown otherwise
                        column[mine] = others
                    else:
                        put_back += len(mine)
                    here[mine] = guess[mine] + away[ring, best[ring]]
                    off[mine] = np.hypot(*(here[mine] - guess[mine]).T)
        lost = np.flatnonzero(known & ~seen)
        for b in odd[off[odd] > wide[odd]]:
            if len(lost):
                away = here[b] - guess[lost]
                if (np.hypot(*(away - turns(away)).T) < wide[lost]).any():
                    here[b] = np.nan  # stands where one that is not seen should be: wait for the next frame
                    continue
            times, places = path(b, column[b], k)
            rest = times != t[k]
            if rest.sum() >= 4 and _bend(times[rest], places[rest]) < smoother**2 * _bend(times, places):
                here[b] = np.nan  # one sighting apart from a smooth track
                left_out += 1
        out[k] = here
        seen = np.isfinite(here[:, 0])
        before[seen], earlier[seen] = last[seen], when[seen]
        last[seen], when[seen] = here[seen], t[k]
        fresh = seen & ~known
        before[fresh] = np.nan
        known |= seen
        put_back += int(np.sum((column != np.arange(len(column))) & seen))
    return out, put_back, left_out


def _rings(best: np.ndarray) -> list[np.ndarray]:
    """Rings of a permutation that are longer than one."""
    left = set(np.flatnonzero(best != np.arange(len(best))).tolist())
    found = []
    while left:
        ring = [left.pop()]
        while int(best[ring[-1]]) in left:
            ring.append(int(best[ring[-1]]))
            left.discard(ring[-1])
        found.append(np.array(ring))
    return found


def _bend(t: np.ndarray, places: np.ndarray) -> float:
    """Sum of squares [m^2] that x0 + v s + a s^2/2 leaves of places (p, 2); infinite with less than four."""
    if len(t) < 4:
        return math.inf
    s = (t - t[0]) / (t[-1] - t[0])
    design = np.stack([np.ones_like(s), s, s**2], axis=1)
    rest = places - design @ np.linalg.lstsq(design, places, rcond=None)[0]
    return float(np.sum(rest**2))
