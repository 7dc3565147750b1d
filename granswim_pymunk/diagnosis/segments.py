"""How far a simulation can follow a track before its start has to be found again: segments that join up.

Multiple shooting: each segment has a start of its own, and what the one before it ends with is, within a spread, what
it begins with. Between impacts that spread is narrow, so that nothing is lost of what a steady force shows over a long
time; at an impact it allows for what a rigid collision leaves out.
Source: Bock 1983, in: Deuflhard & Hairer, Numerical Treatment of Inverse Problems; Pisarenko & Sornette 2004,
Phys. Rev. E 69, 036122.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..inference.criteria import DEFAULT, SegmentCriteria
from ..scene import Scene
from ..walls import gap_to_wall
from .data import Case
from .start import StartBody, describe_starts

CONTACTS = ("contact_elastic", "contact_linear", "contact_hertz")


@dataclass(frozen=True)
class Segment:
    """A stretch of one recording with a start of its own.

    frames : (T,) mask of the frames that are compared;  starts : how its start is described, at the first of them
    until : when the next one begins [s], None for the last;  tie : (m,) one standard deviation of the step from the
    end of the segment before to the free numbers of this start, empty for the first;  limit : (m,) of such a step over
    its spread, beyond which it counts in proportion: bounded for bodies that met
    """

    frames: np.ndarray
    starts: tuple[StartBody, ...]
    until: float | None
    tie: np.ndarray
    limit: np.ndarray

    @property
    def size(self) -> int:
        """How many free numbers its start has."""
        return sum(int(s.free.sum()) for s in self.starts)


@dataclass(frozen=True)
class Impact:
    """Bodies that met: ``row`` of the closest frame, ``apart`` the first after it in which they are clear.

    kick : |change of velocity| of each [m/s]
    """

    row: int
    apart: int
    bodies: tuple[str, ...]
    kick: dict[str, float]


def make_segments(case: Case, frames: np.ndarray, criteria: SegmentCriteria = DEFAULT.segments) -> tuple[Segment, ...]:
    """Segments of the ``frames`` (T,) of a recording: one, or one between each two impacts."""
    rows = np.flatnonzero(frames)
    impacts = [i for i in find_impacts(case, criteria) if rows[0] < i.row < rows[-1]] if len(rows) else []
    cuts: list[tuple[int, list[Impact]]] = []
    for impact in impacts:
        after = int(np.searchsorted(rows, impact.apart))
        before = cuts[-1][0] if cuts else 0
        if cuts and after - before < criteria.frames:
            cuts[-1][1].append(impact)  # too near the last one: both lie in one segment
            cuts[-1] = (max(after, before), cuts[-1][1])
        elif after >= criteria.frames and len(rows) - after >= criteria.frames:
            cuts.append((after, [impact]))
    edges = [0, *(c for c, _ in cuts), len(rows)]
    segments = []
    for k, (begin, end) in enumerate(pairwise(edges)):
        mask = np.zeros(len(case.t), dtype=bool)
        mask[rows[begin:end]] = True
        starts = describe_starts(case, mask)
        until = float(case.t[rows[end]]) if end < len(rows) else None
        tie, limit = _tie(starts, cuts[k - 1][1] if k else None, criteria)
        segments.append(Segment(mask, starts, until, tie, limit))
    return tuple(segments)


def _tie(
    starts: Sequence[StartBody], impacts: Sequence[Impact] | None, criteria: SegmentCriteria
) -> tuple[np.ndarray, np.ndarray]:
    """Spread and limit of the step between the end of one segment and the start of the next, over its free numbers."""
    spreads, limits = [np.zeros(0)], [np.zeros(0)]
    for start in starts if impacts is not None else ():
        spread = criteria.narrow * np.where(start.scale > 0, start.scale, 1.0)
        kick = sum(i.kick.get(start.body, 0.0) for i in impacts or ())
        met = kick > 0 and start.form in ("free", "rail")
        if met:
            speeds = np.arange(len(spread)) >= 2
            spread = np.maximum(spread, np.where(speeds, criteria.impulse * kick, criteria.lateness * kick))
        spreads.append(spread[start.free])
        limits.append(np.full(int(start.free.sum()), criteria.robust if met else np.inf))
    return np.concatenate(spreads), np.concatenate(limits)


def limits_of(segments: Sequence[Segment]) -> np.ndarray:
    """Limits of all steps of a recording, in the order of its segments."""
    return np.concatenate([s.limit for s in segments])


def find_impacts(case: Case, criteria: SegmentCriteria = DEFAULT.segments) -> list[Impact]:
    """Where bodies met, told from the tracks: their gap has a minimum near zero and their velocities change there."""
    scene = case.recording.scene
    if not any(scene.laws_named(name) for name in CONTACTS) or len(case.t) < 2 * criteria.around + 2:
        return []
    columns = {c.body: {} for c in case.channels}  # type: dict[str, dict[str, int]]
    for k, channel in enumerate(case.channels):
        columns[channel.body][channel.kind] = k
    paths = {
        b: (case.values[:, [c["x"], c["y"]]], float(max(case.sigma[c["x"]], case.sigma[c["y"]])))
        for b, c in columns.items()
        if {"x", "y"} <= set(c)
    }
    names = list(paths)
    met: list[tuple[int, int, tuple[str, ...]]] = []
    for k, a in enumerate(names):
        for bodies, noise, size, gap in _met_by(a, names[k + 1 :], paths, scene):
            near = criteria.near * (scene.body(a).radius + size)
            spread = float(np.hypot(paths[a][1], noise))
            met += [(row, _apart(gap, row, 2 * spread), bodies) for row in _minima(gap, 4 * spread + near)]
    found = []
    for row, apart, bodies in sorted(met):
        kick = {b: _kick(case.t, paths[b][0], paths[b][1], (row, apart), criteria) for b in bodies}
        if any(size > 0 for size in kick.values()):
            found.append(Impact(row, apart, bodies, kick))
    return found


def _met_by(
    body: str, others: Sequence[str], paths: Mapping[str, tuple[np.ndarray, float]], scene: Scene
) -> Iterator[tuple[tuple[str, ...], float, float, np.ndarray]]:
    """What a body may meet: the bodies that move, the other's noise and radius [m], and the gap (T,) [m]."""
    xy, radius = paths[body][0], scene.body(body).radius
    for name in others:
        other, noise = paths[name]
        size = scene.body(name).radius
        yield (body, name), noise, size, np.linalg.norm(xy - other, axis=1) - radius - size
    for post in scene.bodies:
        if not post.mobile and post.initial is not None:
            gap = np.linalg.norm(xy - np.array(post.initial[:2]), axis=1) - radius - post.radius
            yield (body,), 0.0, post.radius, gap
    for wall in scene.walls:
        yield (body,), 0.0, wall.radius, gap_to_wall(xy, radius, wall, scene.periodic_x)


def _apart(gap: np.ndarray, row: int, clear: float) -> int:
    """The first row after ``row`` in which a gap (T,) is above ``clear``."""
    for later in range(row + 1, len(gap)):
        if gap[later] > clear:
            return later
    return len(gap) - 1


def _minima(gap: np.ndarray, near: float) -> list[int]:
    """Rows of the minima of a gap (T,) that are below ``near`` or what is covered between two frames."""
    seen = np.flatnonzero(np.isfinite(gap))
    if len(seen) < 5:
        return []
    values = gap[seen]
    steps = np.abs(np.diff(values))
    between = np.concatenate([[steps[0]], np.maximum(steps[1:], steps[:-1]), [steps[-1]]])
    rows = []
    for k in range(1, len(seen) - 1):
        window = values[max(k - 3, 0) : k + 4]
        if values[k] == window.min() and values[k] < near + between[k]:
            rows.append(int(seen[k]))
    return rows


def _kick(
    t: np.ndarray, xy: np.ndarray, sigma: float, span: tuple[int, int], criteria: SegmentCriteria
) -> float:
    """|change of velocity| [m/s] across a span of rows, from lines through frames beside it; 0 where it is noise."""
    n, (row, apart) = criteria.around, span
    speeds: list[np.ndarray] = []
    spreads: list[float] = []
    for rows in (np.arange(max(row - n, 0), row), np.arange(apart, min(apart + n, len(t)))):
        rows = rows[np.isfinite(xy[rows]).all(axis=1)]
        if len(rows) < 3:
            return 0.0
        s = t[rows] - t[rows].mean()
        speeds.append(s @ xy[rows] / float(s @ s))
        spreads.append(sigma / float(np.sqrt(s @ s)))
    size = float(np.linalg.norm(speeds[1] - speeds[0]))
    return size if size > criteria.kick * float(np.hypot(spreads[0], spreads[1])) else 0.0
