"""When a motion begins by itself, and when it ends: frames in which bodies are held, as by a hand, are no motion."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .. import distributions as stats
from ..recording import Recording
from .criteria import current


def first_free(
    recording: Recording, t: np.ndarray, values: np.ndarray, sigmas: Sequence[float], steps: Sequence[float] = ()
) -> int:
    """The first frame in which nothing holds the bodies any more, 0 where nothing shows that they were held.

    values : (T, c) measured numbers;  sigmas : (c,) one standard deviation of each
    steps : (c,) of the coarse grids that they lie on, as of an encoder, 0 where they lie on none
    Where forces do not depend on time, what is at rest stays at rest. Two descriptions of the first frames are
    compared by chi2: at rest until a time, a parabola from there on, and one cubic throughout, which a motion from
    rest at the first frame follows. Not where a command or an unseen body may begin the motion.
    On a coarse grid what rests is told by one number again and again, to which rounding is all the noise: g/sqrt(12) of
    a step g (Widrow & Kollar 2008, Quantization Noise). What moves is off by more, as its stamps are, too: there noise
    is what the better description leaves, and the other has to leave more of it than chance does.
    """
    c = current().release
    hidden = any(b.mobile and b.id not in recording.ids for b in recording.scene.bodies)
    sigma = np.asarray(sigmas, float)
    if recording.scene.inputs or hidden or len(t) < c.still + c.after or not (sigma > 0).all():
        return 0
    lead = values[: c.still]
    if not np.isfinite(lead).all():
        return 0
    off = np.nan_to_num(np.abs(values - np.median(lead, axis=0)) / sigma).max(axis=1)
    away = np.flatnonzero((off[:-2] > c.away) & (off[1:-1] > c.away) & (off[2:] > c.away))
    if not len(away) or away[0] < c.still:
        return 0
    gone, on_grid = int(away[0]), np.asarray(steps if len(steps) else np.zeros(len(sigma)), float)
    rounding = np.where(on_grid > 0, np.minimum(on_grid / math.sqrt(12.0), sigma), sigma)
    same = np.abs(values - np.median(lead, axis=0)) < on_grid / 2
    same[gone:] = False
    weights = np.where(same, sigma / rounding, 1.0)
    for clear in c.clear:
        beyond = np.flatnonzero(off[gone:] > clear * c.away)
        most = max(gone, 2 * c.after)
        end = min(len(t), gone + max(c.after, min(most, int(beyond[0]) if len(beyond) else most)))
        z, scaled = values[:end] / sigma, bool(on_grid.all())
        first = _held_until(t[:end], z, gone, weights[:end], scaled=scaled, still=c.still)
        if first:
            return first
    return 0


def first_pulled(t: np.ndarray, values: np.ndarray, sigmas: Sequence[float], pulls: Sequence[float]) -> int:
    """The first frame after those in which a number that gravity changes at once is one number to the last digit.

    values : (T, c) measured numbers;  sigmas : (c,) one standard deviation of each
    pulls : (c,) [m/s^2] acceleration of each by gravity, 0 where there is none or something of the scene may hold it
    No parabola has one number three times. A hand or a table that bears a body holds what gravity pulls alone: other
    numbers may go on, as of a ball that rolls to the edge. Rest and then a parabola is held against one cubic, as in
    ``first_free``; noise is as large as the better one leaves it, for few frames tell little of it. At rest a picture
    gives one number again and again; of a motion two are the same with probability g/(2 sigma sqrt(pi)), g the least
    by which any two differ, and so are those of other coordinates that begin to change in the same frame.
    """
    c, found = current().release, 0
    same = [_one_number(column) for column in values.T]
    told = [np.diff(np.unique(column[np.isfinite(column)])) for column in values.T]
    step = min((float(steps.min()) for steps in told if len(steps)), default=0.0)
    for number, sigma, pull, count in zip(values.T, sigmas, pulls, same, strict=True):
        # its way about where it turns is more than what may be told as one number
        if count < c.same or not sigma > 0 or pull * ((t[count - 1] - t[0]) / 2) ** 2 / 2 <= step:
            continue
        off = np.nan_to_num(np.abs(number - number[0])) > c.away * sigma
        away = np.flatnonzero(off[:-2] & off[1:-1] & off[2:])
        if not len(away) or not step:
            continue
        sizes = np.array([s for s, n in zip(sigmas, same, strict=True) if n == count and s > 0])
        chance = np.minimum(step / (2 * sizes * math.sqrt(math.pi)), 1.0)
        unlikely = -2 * (count - 1) * float(np.log(chance).sum())
        gone = int(away[0])
        end = gone + max(c.after, gone)
        z = number[:end, None] / sigma
        rest = _held_until(t[:end], z, gone, np.ones_like(z), scaled=True, still=c.same, unlikely=unlikely)
        found = max(found, rest)
    return found


def _one_number(column: np.ndarray) -> int:
    """In how many of its first frames a column (T,) is one number to the last digit."""
    other = np.flatnonzero(column != column[0])
    return int(other[0]) if len(other) else len(column)


def at_rest_though_commanded(
    t: np.ndarray, values: np.ndarray, sigmas: Sequence[float], commanded: np.ndarray
) -> int:  # fmt: skip
    """In how many of its first frames a driven body rests, though its first command would have moved it by far.

    values : (T, c) measured numbers of the body;  sigmas : (c,) one standard deviation of each
    commanded : (T, c) their rates by the command
    0 where it does not rest, or does not begin to move before that command ends: what never moves is not driven.
    """
    c, seen = current().release, np.isfinite(values).all(axis=1)
    t, z, rate = t[seen], values[seen] / np.asarray(sigmas), commanded[seen] / np.asarray(sigmas)
    size = np.linalg.norm(rate, axis=1)
    if len(t) < c.still or not size[0] > 0:
        return 0
    ended = np.flatnonzero(size < c.lasts * size[0])
    first = slice(int(ended[0]) if len(ended) else len(t))
    way = np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(t)[:, None], axis=0)
    least = math.sqrt(2.0) * c.away  # of a difference of two frames
    far = np.flatnonzero(np.linalg.norm(way, axis=1)[first] > c.commanded * least)
    off = np.linalg.norm(z[1:] - z[0], axis=1)[first] > least
    moved = np.flatnonzero(off[:-2] & off[1:-1] & off[2:])  # a single one is off by chance
    return int(moved[0]) + 1 if len(far) and len(moved) and moved[0] > far[0] else 0


def begins_at_rest(t: np.ndarray, values: np.ndarray, sigmas: Sequence[float], commanded: np.ndarray) -> bool:
    """Whether a driven body gains its speed in its first frames, though its first command has it move at once.

    Arguments as of ``at_rest_though_commanded``. A motor that lags is faster from frame to frame, and rests in none.
    Two ways along the command are compared by chi2: at its speed times any gain, and from rest with that as
    acceleration. The first speed by a parabola has to be as far below the command as no gain is.
    """
    c, seen = current().release, np.flatnonzero(np.isfinite(values).all(axis=1))
    seen = seen[: c.still]
    size = np.linalg.norm(commanded[seen], axis=1)
    if len(seen) < c.still or not size.min(initial=math.inf) > c.lasts * size[0]:
        return False
    along, sigma, s = commanded[seen[0]] / size[0], np.asarray(sigmas), t[seen] - t[seen[0]]
    z = (values[seen] @ along / math.hypot(*(along * sigma)))[:, None]
    steps, one = np.diff(s), np.ones(len(s))
    way = np.append(0.0, np.cumsum((size[1:] + size[:-1]) / 2 * steps))
    rising = np.append(0.0, np.cumsum((way[1:] + way[:-1]) / 2 * steps))
    at_once, from_rest = (_left(np.column_stack([one, shape]), z) for shape in (way, rising))
    parabola = np.linalg.lstsq(np.column_stack([one, s, s**2]), z * math.hypot(*(along * sigma)), rcond=None)[0]
    return at_once - from_rest > c.sure and abs(float(parabola[1, 0])) < size[0] / c.commanded


def caught(t: np.ndarray, values: np.ndarray, sigmas: Sequence[float], gravity: float) -> int | None:
    """The first frame from which a falling body rests to the end, as if it was caught; None where it was not.

    values : (T, c) measured numbers of one body;  sigmas : (c,) one standard deviation of each
    gravity : [m/s^2], which would move it by far meanwhile
    A body that is stopped goes on at its speed until then: what friction brings to rest slows down to it. Both are
    compared by chi2 over the frames about the stop, a parabola from the rest on with a speed at the stop and without.
    """
    c, sigma = current().release, np.asarray(sigmas, float)
    seen = np.flatnonzero(np.isfinite(values).all(axis=1))
    if len(seen) < 2 * c.still or not (sigma > 0).all():
        return None
    z = values[seen] / sigma
    away = np.abs(z - np.median(z[-c.still :], axis=0)).max(axis=1) > c.away
    running = np.flatnonzero(away[:-2] & away[1:-1] & away[2:])  # a single one is off by chance
    first = int(running[-1]) + 3 if len(running) else 0
    rest = t[seen[first:]]
    if first < c.after or len(rest) < c.still or gravity * np.ptp(rest) ** 2 / 2 <= c.falls * sigma.max():
        return None
    about = slice(first - c.after, first + c.still)
    sudden, gentle = (_stopped(t[seen[about]], z[about], powers) for powers in ((1, 2), (2, 3)))
    return int(seen[first]) if gentle - sudden > c.sure else None


def _stopped(t: np.ndarray, z: np.ndarray, powers: Sequence[int]) -> float:
    """What is left of chi2 of numbers (T, c) that rest from the best moment on, these powers of the time until then."""
    left = []
    for end in np.linspace(t[len(t) // 2], t[-1], current().release.tried):
        until = np.minimum(t - end, 0.0) / (t[-1] - t[0])
        left.append(_left(np.column_stack([np.ones(len(t)), *(until**k for k in powers)]), z))
    return min(left)


def _held_until(
    t: np.ndarray, z: np.ndarray, gone: int, weights: np.ndarray, *, scaled: bool, still: int,
    unlikely: float = 0.0,
) -> int:  # fmt: skip
    """The first frame after a rest until then, 0 where the numbers (T, c) in units of their noise do not show one.

    gone : frame from which they are away from the place of rest;  weights : (T, c) how much less noise each has
    scaled : noise is as large as the better description leaves it, where that is more;  still : frames at rest
    unlikely : of chi2, what is against a motion beside what it leaves
    """
    c = current().release
    seen = np.isfinite(z).all(axis=1)
    s, z, weights = (t[seen] - t[0]) / (t[-1] - t[0]), z[seen], weights[seen]
    tried = np.unique(np.linspace(still - 1, gone, min(gone, c.tried)).astype(int))
    held = []
    for k in tried:
        since = np.maximum(s - (t[k] - t[0]) / (t[-1] - t[0]), 0.0)
        held.append(_weighed(np.column_stack([np.ones(len(s)), since, since**2]), z, weights))
    best = int(np.argmin(held))
    smooth = _weighed(np.power(s[:, None], np.arange(4)), z, weights)
    freedom = z.size - 3 * z.shape[1] - 1
    larger = max(held[best] / freedom, 1.0) if scaled else 1.0
    if smooth - held[best] < (c.sure - unlikely) * larger or held[best] > stats.chi2.isf(c.alarm, freedom) * larger:
        return 0
    return int(tried[best]) + 1


def _weighed(design: np.ndarray, z: np.ndarray, weights: np.ndarray) -> float:
    """What a linear fit to each number leaves of chi2, ``weights`` (T, c) over the noise that ``z`` is in units of."""
    if (weights == 1).all():
        return _left(design, z)
    return sum(_left(design * w[:, None], (w * k)[:, None]) for k, w in zip(z.T, weights.T, strict=True))


def _left(design: np.ndarray, z: np.ndarray) -> float:
    """What a linear fit leaves of chi2."""
    return float(np.sum((z - design @ np.linalg.lstsq(design, z, rcond=None)[0]) ** 2))
