"""How far a simulation can follow a track before its start has to be found again: segments that join up.

Multiple shooting: each segment has a start of its own, and what the one before it ends with is, within a spread, what
it begins with. Between impacts that spread is narrow, so that nothing is lost of what a steady force shows over a long
time; at an impact it allows for what a rigid collision leaves out.
Source: Bock 1983, in: Deuflhard & Hairer, Numerical Treatment of Inverse Problems; Pisarenko & Sornette 2004,
Phys. Rev. E 69, 036122.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...scene import Scene
from ...walls import gap_to_wall
from ..criteria import SegmentCriteria, current
from ..data import Case
from ..hypothesis import Hypothesis, Predictor
from ..start import StartBody, describe_starts, first_numbers, number_scales


@dataclass(frozen=True)
class Segment:
    """A stretch of one recording with a start of its own.

    frames : (T,) mask of the frames that are compared;  starts : how its start is described, at the first of them
    until : when the next one begins [s], None for the last;  tie : (m,) one standard deviation of the step from the
    end of the segment before to the free numbers of this start, empty for the first;  limit : (m,) of such a step over
    its spread, beyond which it counts in proportion: finite for bodies that met;  least : (m,) spread that is left
    where masses and radii are right: an impact lasts, and nobody knows for how long
    """

    frames: np.ndarray
    starts: tuple[StartBody, ...]
    until: float | None
    tie: np.ndarray
    limit: np.ndarray
    least: np.ndarray

    @property
    def size(self) -> int:
        """How many free numbers its start has."""
        return sum(int(s.free.sum()) for s in self.starts)


@dataclass(frozen=True)
class Impact:
    """Bodies that met: ``row`` of the closest frame, ``apart`` the first after it in which they are clear.

    kick : |change of velocity| of each [m/s]
    met : who touched, also what never moves; a straight wall has no name, and what nobody knows neither
    place, speed : spread of the place [m] and of the velocity [m/s] of each right after it, where a rigid impact that
        was not quite where it is believed to be is followed
    """

    row: int
    apart: int
    bodies: tuple[str, ...]
    kick: dict[str, float]
    place: dict[str, float]
    speed: dict[str, float]
    met: tuple[str, ...] = ()
    unknown: bool = False

    @property
    def curved(self) -> bool:
        """Whether anything but a straight wall was met, so that small errors of paths grow by what comes of it."""
        return self.unknown or len(self.met) > 1


def make_segments(case: Case, frames: np.ndarray, criteria: SegmentCriteria | None = None) -> tuple[Segment, ...]:
    """Segments of the ``frames`` (T,) of a recording: one, or one between each two impacts."""
    criteria = criteria or current().segments
    rows = np.flatnonzero(frames)
    every = find_cuts(case, criteria) if len(rows) else []
    impacts = [i for i in every if rows[0] < i.row < rows[-1]]
    # what bodies that met do to others spreads; the same for the first part of what is learnt from as for all of it
    spreads = any(i.curved and (frames | case.training)[i.row :].any() for i in every)
    limit = criteria.robust if spreads else criteria.full
    cuts: list[tuple[int, list[Impact]]] = []
    for impact in impacts:
        after = int(np.searchsorted(rows, impact.apart))
        before = cuts[-1][0] if cuts else 0
        if len(rows) - after < criteria.frames:
            continue  # what comes after it is too short for a start
        if cuts and (after - before < criteria.frames or _struck_again(impact, cuts[-1], rows, criteria)):
            cuts[-1][1].append(impact)  # too near the last one: both lie in one segment
            cuts[-1] = (max(after, before), cuts[-1][1])
        elif after >= criteria.frames:
            cuts.append((after, [impact]))
    edges = [0, *(c for c, _ in cuts), len(rows)]
    segments = []
    for k, (begin, end) in enumerate(pairwise(edges)):
        mask = np.zeros(len(case.t), dtype=bool)
        mask[rows[begin:end]] = True
        starts = describe_starts(_until_met(case, rows[begin], impacts), mask)
        until = float(case.t[rows[end]]) if end < len(rows) else None
        met = cuts[k - 1][1] if k else None
        segments.append(Segment(mask, starts, until, *_tie(starts, met, limit, criteria)))
    return tuple(segments)


def _struck_again(impact: Impact, cut: tuple[int, list[Impact]], rows: np.ndarray, criteria: SegmentCriteria) -> bool:
    """Whether a body that was struck at a cut is struck again before its flight is long enough to tell a start."""
    begin, before = cut
    struck = {body for other in before for body in other.bodies}
    # before a kick that nothing explains there is nothing to go on from, however short the flight is
    least = criteria.velocity if any(other.unknown for other in before) else criteria.frames
    return bool(struck & set(impact.bodies)) and int(np.searchsorted(rows, impact.row)) - begin < least


def shortened(case: Case) -> Case:
    """The recording with fewer frames to learn from where so many bodies meet so often that their starts are too many.

    It is learnt from up to an impact before which no more than ``criteria.segments.most`` numbers of starts are to be
    fitted; what comes after, and is not held out, is not used, and a note says so.
    """
    segments = make_segments(case, case.training) if case.training.any() else ()
    numbers = np.cumsum([s.size for s in segments])
    kept = int(np.searchsorted(numbers, current().segments.most, side="right"))
    if len(segments) < 2 or kept >= len(segments):
        return case
    until = float(case.t[segments[max(kept, 1)].frames][0])
    note = (
        f"{case.name}: learnt from up to t = {until:.4g} s: {len(segments)} stretches between impacts, with starts of "
        f"{numbers[-1]} numbers in all, are more than can be fitted"
    )
    return replace(case, training=case.training & (case.t < until), notes=(*case.notes, note))


def cut_in_pieces(case: Case, frames: np.ndarray, pieces: int) -> tuple[Segment, ...]:
    """The ``frames`` (T,) of a recording in ``pieces`` of as many each, fewer where a start could not be told from one.

    Their starts are free of what comes before.
    """
    criteria, rows = current().segments, np.flatnonzero(frames)
    parts = np.array_split(rows, max(min(pieces, len(rows) // (2 * criteria.frames)), 1))
    segments = []
    for k, part in enumerate(parts):
        mask = np.zeros(len(case.t), dtype=bool)
        mask[part] = True
        starts = describe_starts(case, mask)
        size = sum(int(s.free.sum()) for s in starts) if k else 0
        until = float(case.t[parts[k + 1][0]]) if k + 1 < len(parts) else None
        tie = np.full(size, criteria.untied)
        segments.append(Segment(mask, starts, until, tie, np.full(size, criteria.robust), np.zeros(size)))
    return tuple(segments)


Follow = Callable[[tuple[StartBody, ...], np.ndarray, np.ndarray], np.ndarray]


def follower(hypothesis: Hypothesis, values: np.ndarray, case: Case, predictor: Predictor) -> Follow:
    """What follows a recording from any start, with these numbers of a hypothesis."""

    def follow(starts: tuple[StartBody, ...], numbers: np.ndarray, t: np.ndarray) -> np.ndarray:
        return predictor(hypothesis, case, values, starts, numbers, float(t[0]), t)

    return follow


def cut_by_growth(
    case: Case, frames: np.ndarray, follow: Follow, criteria: SegmentCriteria | None = None
) -> tuple[Segment, ...]:
    """Segments of ``frames`` (T,) of a recording without impacts, each as long as one start can be followed.

    follow(starts, numbers, t) : what is predicted (T, c) at times t from a start at t[0]
    The answer of the prediction to a start that is a little off, by what the first frames leave open of it times
    ``narrow``, grows; where it is no longer in proportion (x(+d) + x(-d) - 2 x(0) against x(+d) - x(-d)) a fit cannot
    find its way. For motions that are not chaotic that is never.
    """
    criteria = criteria or current().segments
    rows = np.flatnonzero(frames)
    segments: list[Segment] = []
    begin = 0
    while begin < len(rows):
        mask = np.zeros(len(case.t), dtype=bool)
        mask[rows[begin:]] = True
        starts = describe_starts(case, mask)
        end = begin + _followed_for(case, rows[begin : begin + criteria.ahead], starts, follow, criteria)
        if len(rows) - end < current().segments.start_frames:
            end = len(rows)
        mask[rows[end:]] = False
        scale = np.concatenate([np.where(s.scale > 0, s.scale, 1.0)[s.free] for s in starts])
        tie = scale if begin else np.zeros(0)
        until = float(case.t[rows[end]]) if end < len(rows) else None
        limit = np.full(len(tie), criteria.robust)
        segments.append(Segment(mask, starts, until, tie, limit, np.zeros(len(tie))))
        begin = end
    return tuple(segments)


def is_followed(case: Case, rows: np.ndarray, follow: Follow, narrow: float = 1.0) -> bool:
    """Whether the answer to an error of the start is in proportion to it over all frames ``rows`` of a recording.

    narrow : the error, over what the first frames leave open of a start: where it is as large a fit of the start finds
        its way;  other arguments as of ``cut_by_growth``
    """
    mask = np.zeros(len(case.t), dtype=bool)
    mask[rows] = True
    criteria = replace(current().segments, narrow=narrow)
    return _followed_for(case, rows, describe_starts(case, mask), follow, criteria) >= len(rows)


def _followed_for(
    case: Case, rows: np.ndarray, starts: tuple[StartBody, ...], follow: Follow, criteria: SegmentCriteria
) -> int:
    """For how many of the ``rows`` the answer to errors of the start is in proportion to them, at least as many as a
    start is found from."""
    numbers, t = first_numbers(starts), case.t[rows]
    here = follow(starts, numbers, t)
    curved, straight = np.zeros(len(rows)), np.full(len(rows), 1e-300)
    for k, scale in enumerate(number_scales(starts)):
        ends = []
        for side in (-1.0, 1.0):
            moved = numbers.copy()
            moved[k] += side * criteria.narrow * scale
            ends.append(follow(starts, moved, t))
        curved = np.maximum(curved, np.abs((ends[0] + ends[1] - 2 * here) / case.sigma).max(axis=1))
        straight = np.maximum(straight, np.abs((ends[1] - ends[0]) / case.sigma).max(axis=1))
    # what is below the noise is no bend
    bent = np.flatnonzero((curved > criteria.bend * straight) & (curved > 1))
    return max(int(bent[0]), current().segments.start_frames) if len(bent) else len(rows)


def _until_met(case: Case, begin: int, impacts: Sequence[Impact]) -> Case:
    """The recording with each body unseen from where it is struck next: what comes later tells nothing of its start."""
    values = case.values.copy()
    for impact in impacts:
        for k, channel in enumerate(case.channels):
            if channel.body in impact.bodies and impact.row - begin >= 2:
                values[impact.row :, k] = np.nan
    return replace(case, values=values)


def _tie(
    starts: Sequence[StartBody], impacts: Sequence[Impact] | None, limit: float, criteria: SegmentCriteria
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Spread, limit and least spread of the step between the end of one segment and the start of the next.

    Of each over the free numbers of the start.  limit : of a step of what met
    """
    spreads, limits, least = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    for start in starts if impacts is not None else ():
        spread = criteria.narrow * np.where(start.scale > 0, start.scale, 1.0)
        mine = [i for i in impacts or () if i.kick.get(start.body, 0.0) > 0]
        met = bool(mine) and start.coordinates.pushed
        late = np.zeros(len(spread))
        if met:
            late[:2] = criteria.lateness * float(np.hypot.reduce([i.kick[start.body] for i in mine]))
            place = float(np.hypot.reduce([i.place[start.body] for i in mine]))
            speed = float(np.hypot.reduce([i.speed[start.body] for i in mine]))
            spread = np.maximum(spread, np.where(np.arange(len(spread)) >= 2, speed, place))
            if any(i.unknown for i in mine):
                late = spread  # no scene tells more of it
        spreads.append(spread[start.free])
        limits.append(np.full(int(start.free.sum()), limit if met else np.inf))
        least.append(late[start.free])
    return np.concatenate(spreads), np.concatenate(limits), np.concatenate(least)


def limits_of(segments: Sequence[Segment]) -> np.ndarray:
    """Limits of all steps of a recording, in the order of its segments."""
    return np.concatenate([s.limit for s in segments])


def find_cuts(case: Case, criteria: SegmentCriteria | None = None) -> list[Impact]:
    """Where bodies met, and where they go on at velocities of their own whatever struck them, in order of time."""
    criteria = criteria or current().segments
    found = find_impacts(case, criteria)
    if not case.kicks:
        return found
    # the frames of a kick are left out: what a body covers in between is no way to a wall
    found = [i for i in found if not any(k.body in i.bodies and i.row < k.row <= i.apart for k in case.kicks)]
    frame = float(np.median(np.diff(case.t)))
    for kick in case.kicks:
        # it comes within a frame or two, and how large it is is open
        size = float(np.linalg.norm(kick.change))
        place, speed = {kick.body: frame * size}, {kick.body: criteria.open * size}
        found.append(Impact(kick.row - 1, kick.row, (kick.body,), {kick.body: size}, place, speed, unknown=True))
    return sorted(found, key=lambda i: i.row)


def find_impacts(case: Case, criteria: SegmentCriteria | None = None) -> list[Impact]:
    """Where bodies met, told from the tracks: their gap has a minimum near zero and their velocities change there."""
    criteria = criteria or current().segments
    asked = "impacts", criteria, current().segments
    if asked not in case.told:
        case.told[asked] = _found_impacts(case, criteria)
    return list(case.told[asked])


def _found_impacts(case: Case, criteria: SegmentCriteria) -> list[Impact]:
    scene = case.recording.scene
    if not scene.laws_as("contact") or len(case.t) < 2 * criteria.around + 2:
        return []
    paths = paths_of(case)
    names = list(paths)
    met: list[tuple[int, int, tuple[str, str], float]] = []
    for k, a in enumerate(names):
        for b, noise, size, gap in met_by(a, names[k + 1 :], paths, scene):
            near = criteria.near * (scene.body(a).radius + (size if np.isfinite(size) else 0.0))
            spread = float(np.hypot(paths[a][1], noise))
            near += 4 * spread
            met += [(row, _apart(gap, last, 2 * spread), (a, b), size) for row, last in _minima(gap, near, spread)]
    met.sort(key=lambda m: m[:2])
    meetings: dict[str, list[tuple[int, int]]] = {}
    for row, apart, pair, _ in met:
        for b in pair:
            meetings.setdefault(b, []).append((row, apart))
    found = []
    for row, apart, pair, size in met:
        bodies = tuple(b for b in pair if b in paths)
        told = {}
        for b in bodies:
            span = _span(meetings[b], (row, apart), len(case.t), criteria)
            told[b] = _kick(case.t, *paths[b], span, criteria)
        kick = {b: size for b, (size, _) in told.items()}
        if len(bodies) > 1 and any(kick.values()):
            # of one that meets others just then, by what the partner's momentum changes
            given = max(kick[b] * scene.body(b).mass for b in bodies)
            kick = {b: size or given / scene.body(b).mass for b, size in kick.items()}
        if any(size > 0 for size in kick.values()):
            speed = float(np.linalg.norm(told[bodies[0]][1] - (told[bodies[1]][1] if len(bodies) > 1 else 0.0)))
            noise = float(np.hypot.reduce([paths[b][1] for b in bodies]))
            spreads = _followed(scene, size, kick, speed, noise, criteria)
            found.append(Impact(row, apart, bodies, kick, *spreads, tuple(name for name in pair if name)))
    return found


def paths_of(case: Case) -> dict[str, tuple[np.ndarray, float]]:
    """Places (T, 2) and noise [m] of the bodies. A coordinate that is no channel stays as it is: across a rail."""
    columns: dict[str, dict[str, int]] = {c.body: {} for c in case.channels if c.kind in ("x", "y")}
    for k, channel in enumerate(case.channels):
        if channel.kind in ("x", "y"):
            columns[channel.body][channel.kind] = k
    whole = case.recording.on_rails().xy
    paths = {}
    for body, mine in columns.items():
        xy = np.empty((len(case.t), 2))
        for axis, kind in enumerate("xy"):
            if kind in mine:
                xy[:, axis] = case.values[:, mine[kind]]
                continue
            known = whole[:, case.recording.ids.index(body), axis]
            xy[:, axis] = np.median(known[np.isfinite(known)]) if np.isfinite(known).any() else np.nan
        paths[body] = xy, float(max(case.sigma[k] for k in mine.values()))
    return paths


def gaps_of(case: Case, body: str) -> list[np.ndarray]:
    """Gaps (T,) [m] between a body and all else in its recording: seen bodies, posts, straight walls."""
    paths = paths_of(case)
    others = [name for name in paths if name != body]
    return [gap for *_, gap in met_by(body, others, paths, case.recording.scene)]


def met_by(
    body: str, others: Sequence[str], paths: Mapping[str, tuple[np.ndarray, float]], scene: Scene
) -> Iterator[tuple[str, float, float, np.ndarray]]:
    """What a body may meet: its name, the noise of its track and its radius [m], and the gap (T,) [m].

    A straight wall has no name, and a radius without end.
    """
    xy, radius = paths[body][0], scene.body(body).radius
    for name in others:
        other, noise = paths[name]
        size = scene.body(name).radius
        yield name, noise, size, np.linalg.norm(xy - other, axis=1) - radius - size
    for post in scene.bodies:
        if not post.mobile and post.initial is not None:
            gap = np.linalg.norm(xy - np.array(post.initial[:2]), axis=1) - radius - post.radius
            yield post.id, 0.0, post.radius, gap
    for wall in scene.walls:
        yield "", 0.0, np.inf, gap_to_wall(xy, radius, wall, scene.periodic_x)


def _followed(
    scene: Scene, size: float, kick: Mapping[str, float], speed: float, noise: float, criteria: SegmentCriteria
) -> tuple[dict[str, float], dict[str, float]]:
    """Spread of place [m] and velocity [m/s] of bodies after a rigid impact at a relative ``speed``.

    kick : of those that move;  size : radius [m] of what the first of them met, without end for a straight wall

    An impact at an angle theta to the line of centres strikes R cos(theta)^2/2 deep into the sum R of the radii. An
    error b of that depth changes the kick by the share b/(R cos(theta)^2), at most all of it, and the impact comes
    b/(u cos(theta)) too early or late.
    """
    mass = {b: scene.body(b).mass for b in kick}
    radius = scene.body(next(iter(kick))).radius
    reach = radius + size
    believed = criteria.depth * (reach if np.isfinite(reach) else radius)
    depth = float(np.hypot(believed, noise / np.sqrt(criteria.around)))
    reduced = 1.0 / sum(1.0 / m for m in mass.values())
    closing = max(kick[b] * mass[b] / reduced for b in kick) / criteria.rebound
    cosine = float(np.clip(closing / max(speed, 1e-12), 1e-6, 1.0))
    share = min(float(np.hypot(criteria.impulse, depth / (reach * cosine**2))), 1.0)
    late = float(np.hypot(criteria.lateness, depth / closing)) if closing > 0 else criteria.lateness
    return {b: k * late for b, k in kick.items()}, {b: k * share for b, k in kick.items()}


def _apart(gap: np.ndarray, row: int, clear: float) -> int:
    """The first row after ``row`` in which a gap (T,) is above ``clear``."""
    for later in range(row + 1, len(gap)):
        if gap[later] > clear:
            return later
    return len(gap) - 1


def _minima(gap: np.ndarray, near: float, spread: float) -> list[tuple[int, int]]:
    """Rows of the minima of a gap (T,) that are below ``near`` or what is covered between two frames.

    Those that follow at once are taken together, as where a third body throws two at each other again: first and last.
    spread : one standard deviation of the gap [m]; between two minima it has risen by more than noise
    """
    seen = np.flatnonzero(np.isfinite(gap))
    if len(seen) < current().segments.gaps:
        return []
    values = gap[seen]
    steps = np.abs(np.diff(values))
    between = np.concatenate([[steps[0]], np.maximum(steps[1:], steps[:-1]), [steps[-1]]])
    low = (values[1:-1] <= values[:-2]) & (values[1:-1] < values[2:]) & (values < near + between)[1:-1]
    rows: list[tuple[int, int]] = []
    for k in (1 + np.flatnonzero(low)).tolist():
        if rows and seen[k] - rows[-1][1] <= current().segments.at_once:
            last = int(np.searchsorted(seen, rows[-1][1]))
            if values[last : k + 1].max() > max(values[last], values[k]) + current().segments.risen * spread:
                rows[-1] = (rows[-1][0], int(seen[k]))
            continue
        if values[k] == values[max(k - current().segments.at_once, 0) : k + current().segments.at_once + 1].min():
            rows.append((int(seen[k]), int(seen[k])))
    return rows


def _span(
    mine: Sequence[tuple[int, int]], here: tuple[int, int], count: int, criteria: SegmentCriteria
) -> tuple[int, int, int, int]:
    """First row of those before a meeting, rows, end of those after it, with no other meeting of the body in between.

    Where too few rows for a velocity lie between two meetings, as in the corner of a box, one change tells of both.

    mine : (row, first row in which it is clear) of all meetings of the body;  here : of this one;  count : of rows
    """
    row, apart = here
    while True:
        before = max((m for m in mine if m[0] < row), key=lambda m: m[1], default=(0, 0))
        if before[1] == 0 or row - before[1] >= criteria.velocity:
            break
        row = before[0]
    while True:
        after = min((m for m in mine if m[0] > apart or (m[0] > here[0] and m[1] > apart)), default=(count, count))
        if after[0] == count or after[0] - apart >= criteria.velocity:
            break
        apart = max(after[1], apart)
    return min(before[1], row), row, apart, max(after[0], apart)


def _kick(
    t: np.ndarray, xy: np.ndarray, sigma: float, span: tuple[int, int, int, int], criteria: SegmentCriteria
) -> tuple[float, np.ndarray]:
    """|change of velocity| [m/s] between two rows, 0 where it is noise, and the velocity (2,) [m/s] before.

    Lines through the frames beside, as few as show it. span : first row of those before, rows, end of those after
    """
    first, row, apart, last = span
    before = np.zeros(2)
    for n in (criteria.around * 2**k for k in range(criteria.wider + 1)):
        speeds: list[np.ndarray] = []
        spreads: list[float] = []
        for rows in (np.arange(max(row - n, first), row), np.arange(apart, min(apart + n, last))):
            rows = rows[np.isfinite(xy[rows]).all(axis=1)]
            if len(rows) < criteria.velocity:
                return 0.0, before
            s = t[rows] - t[rows].mean()
            speeds.append(s @ xy[rows] / float(s @ s))
            spreads.append(sigma / float(np.sqrt(s @ s)))
        before = speeds[0]
        size = float(np.linalg.norm(speeds[1] - speeds[0]))
        if size > criteria.kick * float(np.hypot(spreads[0], spreads[1])):
            return size, before
    return 0.0, before
