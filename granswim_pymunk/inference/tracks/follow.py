"""How a hypothesis is followed through recordings: innovations, steps between segments, and how they change."""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...errors import InputError
from ...machine import cores
from ..criteria import SegmentCriteria, current
from ..data import Case
from ..hypothesis import Beginning, Failed, Free, Hypothesis, Predictor
from ..start import StartBody, first_numbers, number_scales
from ..threads import Asked, ContextPool, Found
from .bearing import bearing, coloured, looks_around, together
from .fitted import Fit
from .segments import Segment, cut_by_growth, follower, make_segments

POOL = ContextPool(max_workers=cores(), thread_name_prefix="granswim")
COUPLED = ("pivot", "bar", "pendulum", "tether")  # two of them and more in one scene may swing chaotically


@dataclass(frozen=True)
class Part:
    """A segment with its numbers, the frames (T,) it is followed over, and (time, segment, numbers) after it.

    spin : (n,) [rad/s] that the bodies of the scene begin it with, none where not given
    """

    k: int
    segment: Segment
    numbers: np.ndarray
    frames: np.ndarray
    follower: tuple[float, Segment, np.ndarray] | None
    spin: np.ndarray | None = None


class Stretches:
    """Which frames each segment of a recording is followed over, as far as ``frames`` (T,) ask for: those of its parts.

    of : the segments;  ends : where among the numbers of all their starts those of each begin, and the last ends
    frames, until : of each that is followed, its frames (T,), and where the next one that is followed begins [s]
    """

    def __init__(self, segments: tuple[Segment, ...], case: Case, frames: np.ndarray) -> None:
        self.of, self.ends = segments, np.cumsum([0, *(segment.size for segment in segments)])
        self.frames, self.until = list[np.ndarray](), list[float | None]()
        last = case.t[frames][-1]
        for k, segment in enumerate(segments):
            begin = case.t[segment.frames][0]
            if k and begin > last:
                break
            wanted = frames & (case.t >= begin) if k else frames.copy()
            if segment.until is not None:
                wanted &= case.t < segment.until
            self.frames.append(wanted)
            self.until.append(segment.until if segment.until is not None and segment.until <= last else None)


@dataclass(frozen=True)
class Run:
    """A segment followed: innovations (T, c) on its frames, steps (m,) to the next start, spins (n,) it ends with.

    predicted : (T, c) what they come of, None where the run failed
    """

    part: Part
    innovations: np.ndarray
    steps: np.ndarray
    spin: np.ndarray | None
    predicted: np.ndarray | None = None


@dataclass(frozen=True)
class Slow:
    """Derivatives that hardly hang on the law that is fitted: by starts (n, q), by numbers with a prior (n, k)."""

    by_start: np.ndarray
    by_believed: np.ndarray

    def fits(self, vector: np.ndarray, numbers: np.ndarray, believed: Sequence[int]) -> bool:
        """Whether they are of such a vector (n,), by so many numbers."""
        n = len(vector)
        return self.by_start.shape == (n, len(numbers)) and self.by_believed.shape == (n, len(believed))


class Follower:
    """Follows hypotheses through the same frames of the same recordings.

    frames : of each recording, those of the training part where not given
    weights : (T,) of each recording: how much a frame counts in the fit; 1 where not given
    whole : follow every recording from one start, also through impacts
    spin : (n,) [rad/s] of the scene's bodies at the start of a recording, none where not given
    """

    def __init__(
        self,
        cases: Sequence[Case],
        predictor: Predictor,
        frames: Mapping[str, np.ndarray] | None = None,
        weights: Mapping[str, np.ndarray] | None = None,
        whole: bool = False,
        spin: Mapping[str, np.ndarray | None] | None = None,
    ) -> None:
        self.spin = spin or {}
        self.weights = weights or {}
        self.cases = [c for c in cases if (frames[c.name] if frames else c.training).any()]
        self.frames = {c.name: (frames[c.name] if frames else c.training) for c in self.cases}
        self.predictor = predictor
        self._stretches: dict[tuple[str, bytes], Stretches] = {}
        criteria = replace(current().segments, frames=10**9) if whole else current().segments
        self.segments = {c.name: self._segments(c, criteria, whole) for c in self.cases}

    def with_steps(self, times: float) -> Self:
        """The same with steps ``times`` as long, for derivatives."""
        other = copy.copy(self)
        other.predictor = self.predictor.with_steps(times)
        return other

    def spread(self, fn: Callable[[Asked], Found], items: Iterable[Asked]) -> list[Found]:
        """What ``fn`` makes of each, side by side where runs are long enough, see ``ContextPool.spread``."""
        return POOL.spread(fn, items, self.predictor.short)

    def _segments(self, case: Case, criteria: SegmentCriteria, whole: bool) -> tuple[Segment, ...]:
        """Cut at impacts, or where chaos has made too much of a small error of the start."""
        frames = self.frames[case.name]
        segments = make_segments(case, frames, criteria)
        scene = case.recording.scene
        links = scene.laws_as(*COUPLED)
        if whole or len(segments) > 1 or len(links) < 2 or frames.sum() <= criteria.ahead:
            return segments
        follow = follower(Hypothesis(), np.zeros(0), case, self.predictor)
        try:
            return cut_by_growth(case, frames, follow, criteria)
        except Failed:
            return segments

    def innovations(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, numbers: np.ndarray, frames: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Seen minus predicted over sigma (T_frames, c), and the steps between segments and off priors (m,).

        A segment is followed to the start of the next one, the last as far as ``frames`` (T,) ask for.
        """
        runs = self._through(case, hypothesis, values, self._parts(case, numbers, frames))
        full, steps = self._joined(case, runs, frames)
        return full, np.concatenate([steps, hypothesis.priors(case, values)])

    def _parts(self, case: Case, numbers: np.ndarray, frames: np.ndarray) -> list[Part]:
        key = case.name, frames.tobytes()
        segments, known = self.segments[case.name], self._stretches.get(key)
        if known is None or known.of is not segments:
            if len(self._stretches) >= current().work.stretches:
                self._stretches.clear()
            known = self._stretches[key] = Stretches(segments, case, frames)
        ends, parts = known.ends, []
        for k, (segment, wanted, until) in enumerate(zip(segments, known.frames, known.until, strict=False)):
            follower = None
            if until is not None:
                follower = until, segments[k + 1], numbers[ends[k + 1] : ends[k + 2]]
            parts.append(Part(k, segment, numbers[ends[k] : ends[k + 1]], wanted, follower))
        return parts

    def _through(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, parts: Sequence[Part], together: bool = False
    ) -> list[Run]:
        """All segments in turn, or ``together``; each begins with the spins that the one before it ends with."""
        if not hypothesis.turns(case):
            how: Callable[..., Iterable[Run]] = self.spread if together else map
            return list(how(lambda part: self._follow(case, hypothesis, values, part), parts))
        runs: list[Run] = []
        spin = self.spin.get(case.name)
        for part in parts:
            runs.append(self._follow(case, hypothesis, values, replace(part, spin=spin)))
            spin = runs[-1].spin
        return runs

    def _follow(self, case: Case, hypothesis: Hypothesis, values: np.ndarray, part: Part) -> Run:
        """One segment: its part, innovations on its frames, steps to the start of the next one."""
        segment, after = part.segment, part.follower
        seen = case.values[part.frames]
        t0 = float(case.t[segment.frames][0])
        following = None if after is None else (after[0], after[1].starts)
        nothing = np.zeros(0)
        try:
            begin = Beginning(segment.starts, part.numbers, t0, following, part.spin)
            predicted, end = self.predictor.run(hypothesis, case, values, begin, case.t[part.frames])
        except Failed:
            lost = nothing if after is None else np.full(after[1].size, current().fits.hopeless)
            return Run(part, np.where(np.isfinite(seen), current().fits.hopeless, np.nan), lost, None)
        innovations = self._white(case, (seen - predicted) / case.sigma, part)
        if after is None or end is None:
            return Run(part, innovations, nothing, None, predicted)
        return Run(part, innovations, (after[2] - end.numbers) / after[1].tie, end.spin, predicted)

    def _white(self, case: Case, innovations: np.ndarray, part: Part) -> np.ndarray:
        """Uncorrelated, and as much as their frames count: (T, c), linear in the innovations."""
        white = case.white(innovations, part.frames)
        return white * self.weights[case.name][part.frames, None] if case.name in self.weights else white

    @staticmethod
    def _joined(case: Case, runs: Sequence[Run], frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if len(runs) == 1 and np.array_equal(runs[0].part.frames, frames):
            return runs[0].innovations.copy(), runs[0].steps
        full = np.full(case.values.shape, np.nan)
        for run in runs:
            full[run.part.frames] = run.innovations
        return full[frames], np.concatenate([run.steps for run in runs])

    def vector(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, numbers: np.ndarray,
        frames: np.ndarray | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Innovations where something was seen, and steps, as one vector in the order of ``Fit.used``."""
        frames = self.frames[case.name] if frames is None else frames
        innovations, steps = self.innovations(case, hypothesis, values, numbers, frames)
        return np.concatenate([innovations[np.isfinite(case.values[frames])], steps])

    def _vector(self, case: Case, hypothesis: Hypothesis, values: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """As ``vector`` on the frames of this fitter, the segments side by side."""
        frames = self.frames[case.name]
        runs = self._through(case, hypothesis, values, self._parts(case, numbers, frames), together=True)
        innovations, steps = self._joined(case, runs, frames)
        return np.concatenate([innovations[np.isfinite(case.values[frames])], steps, hypothesis.priors(case, values)])

    @property
    def segmented(self) -> bool:
        """Whether some recording is followed in more than one segment."""
        return any(len(s) > 1 for s in self.segments.values())

    def first_numbers(self, name: str) -> np.ndarray:
        """First estimates of the numbers of all starts of a recording."""
        return np.concatenate([first_numbers(s.starts) for s in self.segments[name]])

    def number_scales(self, name: str) -> np.ndarray:
        """How well the first frames determine them."""
        return np.concatenate([number_scales(s.starts) for s in self.segments[name]])

    def _bears(self, free: Free) -> bool:
        return free.cases is None or any(c.name in free.cases for c in self.cases)

    def predict(self, fit: Fit, case: Case, frames: np.ndarray) -> np.ndarray:
        """Predicted channels (T, c) on ``frames`` and all before them, NaN elsewhere. Raises Failed."""
        t0 = float(case.t[self.frames[case.name]][0])
        wanted = (case.t >= t0) & (case.t <= case.t[frames].max())
        out = np.full(case.values.shape, np.nan)
        spin = self.spin.get(case.name)
        for part in self._parts(case, fit.starts[case.name], wanted):
            t0 = float(case.t[part.segment.frames][0])
            following = None if part.follower is None else (part.follower[0], part.follower[1].starts)
            if part.frames.any():
                begin = Beginning(part.segment.starts, part.numbers, t0, following, spin)
                out[part.frames], end = self.predictor.run(
                    fit.hypothesis, case, fit.values, begin, case.t[part.frames]
                )
                spin = end.spin if end is not None and fit.hypothesis.turns(case) else None
        return out

    def _raw(self, case: Case, white: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Innovations (T, c) as they were before ``Case.white``, which begins anew in each segment."""
        if not case.noise.size and case.late is None:
            return white
        raw = white.copy()
        for part in self._parts(case, numbers, self.frames[case.name]):
            weight = self.weights[case.name][part.frames, None] if case.name in self.weights else 1.0
            raw[part.frames] = case.raw(white[part.frames] / weight, part.frames) * weight
        return raw

    def derivatives(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, numbers: np.ndarray, frames: np.ndarray,
        fixed: bool, here: np.ndarray | None = None, held: Collection[int] = (),
    ) -> tuple[list[int], list[np.ndarray]]:  # fmt: skip
        """d(predicted/sigma) on ``frames`` by the numbers that bear on a recording: (indices, list of (T, c)).

        Indices below zero are numbers of the start: -1 the first. ``here``: the innovations where they stand, if known.
        Numbers that are ``held`` have none. For a recording of one segment.
        """
        if here is None:
            here = self.innovations(case, hypothesis, values, numbers, frames)[0]
        columns: list[int] = []
        changes: list[tuple[np.ndarray, np.ndarray, float]] = []
        for k, shifted, step in () if fixed else self._value_steps(case, hypothesis, values, held):
            columns.append(k)
            changes.append((shifted, numbers, step))
        for k, scale in enumerate(self.number_scales(case.name)):
            moved = numbers.copy()
            moved[k] += current().fits.step * scale
            columns.append(-k - 1)
            changes.append((np.asarray(values, dtype=float), moved, current().fits.step * scale))
        # the compiled loops release the GIL; threads change no bit of the result
        found = self.spread(lambda c: self.innovations(case, hypothesis, c[0], c[1], frames)[0], changes)
        return columns, [(here - other) / c[2] for other, c in zip(found, changes, strict=True)]

    def _value_steps(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, held: Collection[int]
    ) -> list[tuple[int, np.ndarray, float]]:
        """For each value that bears on a recording its index, the values with it moved, and by how much."""
        found = []
        for k, f in enumerate(hypothesis.free):
            if k in held or (f.cases is not None and case.name not in f.cases):
                continue
            # a scale may be wider than the bounds: into the wider room, and no further than there is
            step = min(current().fits.step * f.scale, max(f.high - values[k], values[k] - f.low))
            if values[k] + step > f.high:
                step = -step
            shifted = np.array(values, dtype=float)
            shifted[k] += step
            found.append((k, shifted, step))
        return found

    def _sensitivity(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, numbers: np.ndarray, fixed: bool,
        held: Collection[int] = (), starts_too: bool = True,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """d(predicted/sigma) of a recording's vector, by all values (n, p) and by the numbers of the starts (n, q).

        A number of a start moves its own segment alone, and the steps on both sides of it. Bodies that do not bear on
        one another are moved in one run.
        """
        p = len(hypothesis.free)
        run = _Moved(self, case, hypothesis, np.asarray(values, dtype=float), numbers)
        steps = np.zeros((1, p + len(numbers)))
        for k, _, step in () if fixed else self._value_steps(case, hypothesis, values, held):
            steps[0, k] = step
        if starts_too:
            steps[0, p:] = current().fits.step * self.number_scales(case.name)
        result = run.calmer(steps, run.derivatives(steps))
        return result[:, :p], result[:, p:]

    def _central(self, case: Case, fit: Fit, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``_sensitivity``, by central differences; ``size`` (p,): of derivatives by values, in all recordings."""
        numbers, p = fit.starts[case.name], len(fit.values)
        run = _Moved(self, case, fit.hypothesis, fit.values, numbers)
        steps = np.zeros((2, p + len(numbers)))
        for k, f in enumerate(fit.hypothesis.free):
            if f.cases is None or case.name in f.cases:
                step = current().fits.step * f.scale
                step = min(1.0 / size[k], step) if size[k] > 0 else step
                steps[:, k] = np.clip(fit.values[k] + np.array([-step, step]), f.low, f.high) - fit.values[k]
        scales = current().fits.step * self.number_scales(case.name)
        if len(self.segments[case.name]) == 1:
            told = np.linalg.norm(fit.jacobian[case.name][1], axis=0)
            scales = np.where(told > 0, np.minimum(1.0 / np.maximum(told, 1e-300), scales), scales)
            steps[0, p:] = -scales
        steps[1, p:] = scales
        result = run.derivatives(steps) * fit.roots(case.name)[:, None]
        return result[:, :p], result[:, p:]

    def _by_prior(self, hypothesis: Hypothesis, values: np.ndarray, k: int) -> np.ndarray:
        """How what numbers are off their priors, of all recordings in turn, changes with number ``k``, by its unit."""
        ends = np.array(values), np.array(values)
        ends[1][k] += 1.0
        before, after = (np.concatenate([hypothesis.priors(c, v) for c in self.cases]) for v in ends)
        return np.asarray(after - before)


@dataclass(frozen=True)
class Move:
    """A number that is moved: its column among the derivatives, by how much, and the body that it is of, if of one.

    part : the segment whose start it belongs to, and ``at`` which of its numbers it is; None for values
    """

    column: int
    step: float
    owner: str | None = None
    part: int | None = None
    at: int = 0


class _Moved:
    """Runs of all segments with numbers moved, against those with none moved."""

    def __init__(
        self, follower: Follower, case: Case, hypothesis: Hypothesis, values: np.ndarray, numbers: np.ndarray
    ) -> None:
        self.follower, self.case, self.hypothesis, self.values = follower, case, hypothesis, values
        self.frames = follower.frames[case.name]
        parts = follower._parts(case, numbers, self.frames)
        self.before = follower._through(case, hypothesis, values, parts, together=True)
        try:
            scene, camera = hypothesis.scene(case, values)
            self.bears = [bearing(case, scene, camera, run.predicted) for run in self.before]
            # a spin goes from segment to segment, and with it what a body bears on
            self.owner = {} if hypothesis.turns(case) or looks_around(scene) else hypothesis.owner
        except InputError:  # numbers that no law takes: none of the runs could be made
            self.bears, self.owner = [together(case.recording.scene) for _ in self.before], {}
        use = np.isfinite(case.values[self.frames])
        self.rows = np.full(case.values.shape, -1)
        self.rows[self.frames] = np.where(use, np.cumsum(use.ravel()).reshape(use.shape) - 1, -1)
        self.ties = int(use.sum()) + np.cumsum([0, *(s.tie.size for s in follower.segments[case.name])])

    def derivatives(self, steps: np.ndarray) -> np.ndarray:
        """(n, p) of the vector of innovations, steps between segments and priors, by values and numbers of the starts.

        steps : (sides, p) what each is moved by, on one side or on two; 0: not at all
        """
        free = len(self.values)
        result = np.zeros((self.ties[-1] + len(self.hypothesis.priors(self.case, self.values)), steps.shape[1]))
        for side in steps:
            groups = self._values([Move(int(k), side[k], self.owner.get(int(k))) for k in np.flatnonzero(side[:free])])
            groups += self._starts(free, side[free:]) if side[free:].any() else []
            for move, runs in self._all(groups):
                self._add(move, runs, result[:, move.column])
        return result / np.maximum(np.abs(steps).sum(axis=0), np.finfo(float).tiny)

    def calmer(self, steps: np.ndarray, found: np.ndarray) -> np.ndarray:
        """Derivatives (n, p), from the other side where a step went beyond an impact.

        A disk that passes another closely touches it, or does not, after a small step: the difference over it is of
        two courses of events, and no derivative. Where a step changes much, that to the other side is asked as well,
        and the smaller one taken where they are unlike.

        steps : (1, p) as in ``derivatives``, which gave what was ``found``
        """
        fits, free = current().fits, len(self.values)
        far = np.flatnonzero(np.linalg.norm(found, axis=0) * np.abs(steps[0]) > fits.jump)
        back = np.zeros_like(steps)
        back[0, far] = -steps[0, far]
        low, high = self.hypothesis.bounds
        there = self.values + back[0, :free]
        back[0, :free][(there < low) | (there > high)] = 0.0
        if not back.any():
            return found
        other = self.derivatives(back)
        lengths = np.linalg.norm(other, axis=0), np.linalg.norm(found, axis=0)
        return np.where((back[0] != 0) & (lengths[0] < fits.unlike * lengths[1]), other, found)

    def _values(self, moves: Sequence[Move]) -> list[list[Move]]:
        """Values in groups that are moved in one run: those of single bodies that do not bear on one another."""
        single = [m for m in moves if m.owner is not None]
        felt = [[b.of(m.owner) for b in self.bears] for m in single if m.owner is not None]
        return [[m] for m in moves if m.owner is None] + [[single[k] for k in g] for g in coloured(felt)]

    def _starts(self, first: int, steps: np.ndarray) -> list[list[Move]]:
        """Numbers of all starts, whose columns begin at ``first``, in such groups."""
        groups: list[list[Move]] = []
        at = 0
        for k, run in enumerate(self.before):
            owners = _owners(run.part.segment.starts)
            moves = [Move(first + at + j, steps[at + j], owner, k, j) for j, owner in enumerate(owners)]
            groups += [[moves[j] for j in g] for g in coloured([[self.bears[k].of(owner)] for owner in owners])]
            at += len(owners)
        return groups

    def _all(self, groups: Sequence[list[Move]]) -> Iterator[tuple[Move, dict[int, Run]]]:
        """Every move with its runs by segment; one by one where a run of several fails."""
        # the compiled loops release the GIL; threads change no bit of the result
        for group, runs in zip(groups, self.follower.spread(self._run, groups), strict=True):
            lost = len(group) > 1 and any(run.predicted is None for run in runs.values())
            for move in group:
                yield move, self._run([move]) if lost else runs

    def _run(self, group: Sequence[Move]) -> dict[int, Run]:
        values, k = np.array(self.values, dtype=float), group[0].part
        if k is None:
            for move in group:
                values[move.column] += move.step
            parts = [run.part for run in self.before]
            return dict(enumerate(self.follower._through(self.case, self.hypothesis, values, parts)))
        part = self.before[k].part
        numbers = part.numbers.copy()
        for move in group:
            numbers[move.at] += move.step
        return {k: self.follower._follow(self.case, self.hypothesis, values, replace(part, numbers=numbers))}

    def _add(self, move: Move, runs: Mapping[int, Run], column: np.ndarray) -> None:
        """What a move changes, with the sign of its step, is added to a ``column`` (n,)."""
        sign = np.sign(move.step)
        for k, run in runs.items():
            innovations, ties = self._change(move, k, run)
            mine = self.rows[run.part.frames]
            column[mine[mine >= 0]] += sign * innovations[mine >= 0]
            if len(ties):
                column[self.ties[k + 1] : self.ties[k + 2]] += sign * ties
        if move.part is None:
            shifted = np.array(self.values, dtype=float)
            shifted[move.column] += move.step
            before, after = (self.hypothesis.priors(self.case, v) for v in (self.values, shifted))
            column[self.ties[-1] :] += sign * (before - after)
        elif move.part:
            # what was predicted for this start is fixed: the step changes with the start itself
            tie = self.before[move.part].part.segment.tie[move.at]
            column[self.ties[move.part] + move.at] -= abs(move.step) / tie

    def _change(self, move: Move, k: int, run: Run) -> tuple[np.ndarray, np.ndarray]:
        """Innovations (T, c) and steps (m,), before less after, of what feels the body whose number is moved."""
        before, case, bears = self.before[k], self.case, self.bears[k]
        ties = before.steps - run.steps
        if move.owner is None or before.predicted is None or run.predicted is None or not bears.parted:
            return before.innovations - run.innovations, ties
        felt = bears.of(move.owner)
        mine = bears.among(felt, [channel.body for channel in case.channels])
        change = np.where(mine, (run.predicted - before.predicted) / case.sigma, 0.0)
        change[~np.isfinite(case.values[run.part.frames])] = np.nan
        if case.late is None:  # else a stamp that is off ties all numbers of a frame together
            white = np.zeros(change.shape)
            white[:, mine] = self.follower._white(case, change[:, mine], run.part)
            change = white
        else:
            change = self.follower._white(case, change, run.part)
        if len(ties) and run.part.follower is not None:
            ties = np.where(bears.among(felt, _owners(run.part.follower[1].starts)), ties, 0.0)
        return change, ties


def _owners(starts: Sequence[StartBody]) -> list[str]:
    """Of each free number of a start the body."""
    return [s.body for s in starts for _ in range(int(s.free.sum()))]
