"""Whose track is whose: labels that a tracker swapped are put back."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from .criteria import current
from .noise import larger_by


@dataclass(frozen=True, eq=False)
class Linked:
    """Tracks that are put right.

    xy : (T, n, 2) [m];  who : (T, n) the label that each body had;  put_back : labels;  left_out : sightings
    """

    xy: np.ndarray
    who: np.ndarray
    put_back: int
    left_out: int


def linked(
    t: np.ndarray, xy: np.ndarray, sigma: float, period: float = 0.0, *, strays: bool = True
) -> Linked:
    """Tracks whose labels were swapped put right, and sightings that fit no motion left out (where ``strays``).

    t : (T,) [s];  xy : (T, n, 2) [m], unwrapped along ``period``, NaN where not seen.  A body is looked for where the
    last two sightings lead it. Bodies that are all elsewhere in one frame are given to each other by least total
    distance, for good or for that frame, if their tracks are much smoother so, the next two frames included: a body
    that is hit strays, too.
    Source: Crocker & Grier 1996, J. Colloid Interface Sci. 179, 298 (linking); Munkres 1957 (assignment).
    """
    criteria = current().linking
    second = np.hypot(*np.moveaxis(np.diff(xy, n=2, axis=0), -1, 0))
    found = np.isfinite(second)
    if not found.any():
        return Linked(np.array(xy), np.tile(np.arange(xy.shape[1]), (len(t), 1)), 0, 0)
    # the second difference of a body's motion is mostly below this; of one that is hardly seen, as of all
    common = float(np.median(second[found]))
    enough = criteria.sightings
    usual = np.array([np.median(c[f]) if f.sum() > enough else common for c, f in zip(second.T, found.T, strict=True)])
    far = np.maximum(criteria.far[0] * sigma, criteria.far[1] * np.maximum(usual, common))
    linking = _Linking(t, np.array(xy), period, far, strays)
    for k in range(1, len(t)):
        linking.frame(k)
    return Linked(linking.out, linking.who, linking.put_back, linking.left_out)


def off_links(xy: np.ndarray, joints: np.ndarray, sigma: float, period: float = 0.0) -> tuple[np.ndarray, int]:
    """Tracks without the sightings of linked disks that no link allows, and how many were left out.

    xy : (T, n, 2) [m], unwrapped along ``period``, NaN where not seen;  joints : (k, 2) bodies that a link holds at one
    distance;  sigma [m]
    A disk may be fast, its links are as long as ever: a length far off its median says that one of the two is not where
    it was seen, the one that is farther from the middle of the frames before and after. Where neither has both, both.
    """
    xy, criteria = np.array(xy), current().linking
    middle = np.full_like(xy, np.nan)
    middle[1:-1] = 0.5 * (xy[2:] + xy[:-2])
    away = np.hypot(*np.moveaxis(xy - middle, -1, 0))
    wrong = np.zeros(away.shape, dtype=bool)
    for i, j in joints:
        dx, dy = np.moveaxis(xy[:, j] - xy[:, i], -1, 0)
        length = np.hypot(dx - period * np.round(dx / period) if period else dx, dy)
        seen = np.isfinite(length)
        if seen.sum() <= criteria.sightings:
            continue
        off = np.abs(length - np.median(length[seen])) / (math.sqrt(2.0) * max(sigma, current().rounding.nothing))
        # what a link gives way is in the usual deviation, too
        for k in np.flatnonzero(seen & (off > criteria.link * larger_by(off))):
            both = np.nan_to_num(away[k, [i, j]], nan=math.inf)
            wrong[k, [b for b, a in zip((i, j), both, strict=True) if a == both.max()]] = True
    xy[wrong] = np.nan
    return xy, int(wrong.sum())


class _Linking:
    """Tracks that are put right frame by frame, see ``linked``.

    out : (T, n, 2) [m];  far : (n,) how far from where it is led a body may be a step later [m]
    last, before : (n, 2) the last two sightings [m], at ``when`` and ``earlier`` (n,) [s];  known : (n,) seen so far
    column : (n,) whose label each body has, who : (T, n) in each frame;  put_back : labels;  left_out : sightings
    """

    def __init__(self, t: np.ndarray, out: np.ndarray, period: float, far: np.ndarray, strays: bool) -> None:
        self.t, self.out, self.period, self.far, self.strays = t, out, period, far, strays
        self.last, self.before = out[0].copy(), np.full_like(out[0], np.nan)
        self.when, self.earlier = np.full(out.shape[1], t[0]), np.full(out.shape[1], np.nan)
        self.known = np.isfinite(self.last[:, 0])
        self.column = np.arange(out.shape[1])
        self.who = np.tile(self.column, (len(t), 1))
        self.put_back = self.left_out = 0

    def turns(self, away: np.ndarray) -> np.ndarray:
        """Whole periods in a distance (..., 2): a body that is followed across a seam may stand any number on."""
        if not self.period:
            return np.zeros_like(away)
        whole = self.period * np.round(np.nan_to_num(away[..., 0]) / self.period)
        return np.stack([whole, np.zeros(away.shape[:-1])], axis=-1)

    def path(
        self, body: int, label: int, k: int, after: int | None = None, ahead: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Times (p,) and places (p, 2): the last two sightings of a body, and three from ``k`` on under a label.

        ``after``: the label of the last two of these, if another;  ``ahead``: k and others after it, if not the next
        """
        ahead = np.arange(k, min(k + 3, len(self.t))) if ahead is None else ahead
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
        self.who[k] = self.column
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
        for b in odd[off[odd] > wide[odd]] if self.strays else ():
            if len(lost):
                away = here[b] - guess[lost]
                if (np.hypot(*(away - self.turns(away)).T) < wide[lost]).any():
                    here[b] = np.nan  # stands where one that is not seen should be: wait for the next frame
                    continue
            if self._apart(k, int(b)):
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
        column, smoother = self.column, current().linking.smoother
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
                self.who[k, mine] = others

    def _apart(self, k: int, body: int) -> bool:
        """Whether a body's sighting in frame k is a single one apart from a smooth track."""
        criteria = current().linking
        label = self.column[body]
        seen = np.flatnonzero(np.isfinite(self.out[k + 1 : k + 1 + criteria.ahead, label, 0]))
        # the next two in which it is seen: bad sightings come where a body is hard to see, and lost ones beside them
        times, places = self.path(body, label, k, ahead=np.concatenate([[k], k + 1 + seen[:2]]))
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
    if len(t) < current().linking.sightings:
        return math.inf
    s = (t - t[0]) / (t[-1] - t[0])
    design = np.stack([np.ones_like(s), s, s**2], axis=1)
    rest = places - design @ np.linalg.lstsq(design, places, rcond=None)[0]
    return float(np.sum(rest**2))
