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


def followed(t: np.ndarray, xy: np.ndarray, sigma: float, period: float = 0.0) -> tuple[np.ndarray, int, int]:
    """Tracks whose labels were swapped put right, and sightings that fit no motion left out.

    t : (T,) [s];  xy : (T, n, 2) [m], unwrapped along ``period``, NaN where not seen.  Returns the tracks, how
    many labels were put back, how many sightings left out. A body is looked for where the last two sightings lead
    it. Bodies that are all elsewhere in one frame are given to each other by least total distance, for good or for
    that frame, if their tracks are much smoother so, the next two frames included: a body that is hit strays, too.
    Source: Crocker & Grier 1996, J. Colloid Interface Sci. 179, 298 (linking); Munkres 1957 (assignment).
    """
    criteria = current().windows.starts
    second = np.hypot(*np.moveaxis(np.diff(xy, n=2, axis=0), -1, 0))
    found = np.isfinite(second)
    if not found.any():
        return np.array(xy), 0, 0
    # the second difference of a body's motion is mostly below this; of one that is hardly seen, as of all
    common = float(np.median(second[found]))
    enough = criteria.sightings
    usual = np.array([np.median(c[f]) if f.sum() > enough else common for c, f in zip(second.T, found.T, strict=True)])
    far = np.maximum(criteria.far[0] * sigma, criteria.far[1] * np.maximum(usual, common))
    linking = _Linking(t, np.array(xy), period, far)
    for k in range(1, len(t)):
        linking.frame(k)
    return linking.out, linking.put_back, linking.left_out


class _Linking:
    """Tracks that are put right frame by frame, see ``followed``.

    out : (T, n, 2) [m];  far : (n,) how far from where it is led a body may be a step later [m]
    last, before : (n, 2) the last two sightings [m], at ``when`` and ``earlier`` (n,) [s];  known : (n,) seen so far
    column : (n,) whose label each body has;  put_back, left_out : how many labels, how many sightings
    """

    def __init__(self, t: np.ndarray, out: np.ndarray, period: float, far: np.ndarray) -> None:
        self.t, self.out, self.period, self.far = t, out, period, far
        self.last, self.before = out[0].copy(), np.full_like(out[0], np.nan)
        self.when, self.earlier = np.full(out.shape[1], t[0]), np.full(out.shape[1], np.nan)
        self.known = np.isfinite(self.last[:, 0])
        self.column = np.arange(out.shape[1])
        self.put_back = self.left_out = 0

    def turns(self, away: np.ndarray) -> np.ndarray:
        """Whole periods in a distance (..., 2): a body that is followed across a seam may stand any number on."""
        if not self.period:
            return np.zeros_like(away)
        whole = self.period * np.round(np.nan_to_num(away[..., 0]) / self.period)
        return np.stack([whole, np.zeros(away.shape[:-1])], axis=-1)

    def path(self, body: int, label: int, k: int, after: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Times (p,) and places (p, 2): the last two sightings of a body, and three from ``k`` on under a label.

        ``after``: the label of the last two of these, if another.
        """
        ahead = np.arange(k, min(k + 3, len(self.t)))
        labels = [label, *[label if after is None else after] * (len(ahead) - 1)]
        times = np.array([self.earlier[body], self.when[body], *self.t[ahead]])
        places = np.concatenate([self.before[[body]], self.last[[body]], self.out[ahead, labels]])
        places -= self.turns(places - self.last[body])
        good = np.isfinite(places[:, 0]) & np.isfinite(times)
        return times[good], places[good]

    def frame(self, k: int) -> None:
        """Put frame k right, all before it are."""
        t, last, before = self.t, self.last, self.before
        here = self.out[k, self.column]
        seen = np.isfinite(here[:, 0])
        v = np.where(np.isfinite(before), (last - before) / (self.when - self.earlier)[:, None], 0.0)
        guess = last + v * (t[k] - self.when)[:, None]
        here = here - self.turns(here - guess)
        off = np.hypot(*(here - guess).T)
        gone = np.where(np.isfinite(before[:, 0]), (t[k] - self.when) / (self.when - self.earlier), 2.0)
        wide = self.far * np.clip(gone, 1.0, 4.0)
        odd = np.flatnonzero(seen & self.known & (off > wide))
        if len(odd) > 1:
            self._exchange(k, odd, here, guess)
            off[odd] = np.hypot(*(here[odd] - guess[odd]).T)
        lost = np.flatnonzero(self.known & ~seen)
        for b in odd[off[odd] > wide[odd]]:
            if len(lost):
                away = here[b] - guess[lost]
                if (np.hypot(*(away - self.turns(away)).T) < wide[lost]).any():
                    here[b] = np.nan  # stands where one that is not seen should be: wait for the next frame
                    continue
            if self._strays(k, int(b)):
                here[b] = np.nan
                self.left_out += 1
        self.out[k] = here
        seen = np.isfinite(here[:, 0])
        before[seen], self.earlier[seen] = last[seen], self.when[seen]
        last[seen], self.when[seen] = here[seen], t[k]
        before[seen & ~self.known] = np.nan
        self.known |= seen
        self.put_back += int(np.sum((self.column != np.arange(len(self.column))) & seen))

    def _exchange(self, k: int, odd: np.ndarray, here: np.ndarray, guess: np.ndarray) -> None:
        """Give bodies that are elsewhere in frame k to each other where their tracks are much smoother so."""
        column, smoother = self.column, current().windows.starts.smoother
        away = here[odd][None] - guess[odd][:, None]
        away -= self.turns(away)
        _, best = linear_sum_assignment(np.hypot(*np.moveaxis(away, -1, 0)))
        former = column[odd].copy()
        for ring in _rings(best):
            mine, others = odd[ring], former[best[ring]]
            now = np.sum([_bend(*self.path(b, column[b], k)) for b in mine])
            then = np.sum([_bend(*self.path(b, c, k)) for b, c in zip(mine, others, strict=True)])
            once = np.sum([_bend(*self.path(b, c, k, column[b])) for b, c in zip(mine, others, strict=True)])
            if min(then, once) < smoother * now:
                if then < once:  # who has another's label keeps it until shown otherwise
                    column[mine] = others
                else:
                    self.put_back += len(mine)
                here[mine] = guess[mine] + away[ring, best[ring]]

    def _strays(self, k: int, body: int) -> bool:
        """Whether a body's sighting in frame k is a single one apart from a smooth track."""
        criteria = current().windows.starts
        times, places = self.path(body, self.column[body], k)
        rest = times != self.t[k]
        if rest.sum() < criteria.sightings:
            return False
        return _bend(times[rest], places[rest]) < criteria.smoother**2 * _bend(times, places)


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
    if len(t) < current().windows.starts.sightings:
        return math.inf
    s = (t - t[0]) / (t[-1] - t[0])
    design = np.stack([np.ones_like(s), s, s**2], axis=1)
    rest = places - design @ np.linalg.lstsq(design, places, rcond=None)[0]
    return float(np.sum(rest**2))
