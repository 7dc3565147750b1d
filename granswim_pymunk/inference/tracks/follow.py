"""How a hypothesis is followed through recordings: innovations, steps between segments, and how they change."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..criteria import SegmentCriteria, current
from ..data import Case
from ..hypothesis import Beginning, Failed, Free, Hypothesis, Predictor
from ..start import StartBody, first_numbers, number_scales
from ..threads import ContextPool
from .fitted import Fit
from .segments import Segment, cut_by_growth, make_segments

POOL = ContextPool(max_workers=max(os.cpu_count() or 1, 1), thread_name_prefix="granswim")
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


@dataclass(frozen=True)
class Run:
    """A segment followed: innovations (T, c) on its frames, steps (m,) to the next start, spins (n,) it ends with."""

    part: Part
    innovations: np.ndarray
    steps: np.ndarray
    spin: np.ndarray | None


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
        criteria = replace(current().segments, frames=10**9) if whole else current().segments
        self.segments = {c.name: self._segments(c, criteria, whole) for c in self.cases}

    def _segments(self, case: Case, criteria: SegmentCriteria, whole: bool) -> tuple[Segment, ...]:
        """Cut at impacts, or where chaos has made too much of a small error of the start."""
        frames = self.frames[case.name]
        segments = make_segments(case, frames, criteria)
        scene = case.recording.scene
        links = scene.laws_as(*COUPLED)
        if whole or len(segments) > 1 or len(links) < 2 or frames.sum() <= criteria.ahead:
            return segments
        naive = Hypothesis()

        def follow(starts: tuple[StartBody, ...], numbers: np.ndarray, t: np.ndarray) -> np.ndarray:
            return self.predictor(naive, case, np.zeros(0), starts, numbers, float(t[0]), t)

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
        segments = self.segments[case.name]
        last = case.t[frames][-1]
        parts, at = [], 0
        for k, segment in enumerate(segments):
            mine = numbers[at : at + segment.size]
            at += segment.size
            begin = case.t[segment.frames][0]
            if k and begin > last:
                break
            wanted = frames & (case.t >= begin) if k else frames.copy()
            if segment.until is not None:
                wanted &= case.t < segment.until
            follower = None
            if segment.until is not None and segment.until <= last:
                nxt = segments[k + 1]
                follower = (segment.until, nxt, numbers[at : at + nxt.size])
            parts.append(Part(k, segment, mine, wanted, follower))
        return parts

    def _through(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, parts: Sequence[Part], together: bool = False
    ) -> list[Run]:
        """All segments in turn, or ``together``; each begins with the spins that the one before it ends with."""
        if not hypothesis.turns(case):
            how = POOL.map if together else map
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
        innovations = case.white((seen - predicted) / case.sigma, part.frames)
        if case.name in self.weights:
            innovations = innovations * self.weights[case.name][part.frames, None]
        if after is None or end is None:
            return Run(part, innovations, nothing, None)
        return Run(part, innovations, (after[2] - end.numbers) / after[1].tie, end.spin)

    @staticmethod
    def _joined(case: Case, runs: Sequence[Run], frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
        fixed: bool, here: np.ndarray, held: Collection[int] = (),
    ) -> tuple[list[int], list[np.ndarray]]:  # fmt: skip
        """d(predicted/sigma) on ``frames`` by the numbers that bear on a recording: (indices, list of (T, c)).

        Indices below zero are numbers of the start: -1 the first. ``here``: the innovations where they stand.
        Numbers that are ``held`` have none. For a recording of one segment.
        """
        columns: list[int] = []
        changes: list[tuple[np.ndarray, np.ndarray, float]] = []
        for k, shifted, step in () if fixed else self._value_steps(case, hypothesis, values, held):
            columns.append(k)
            changes.append((shifted, numbers, step))
        for k, scale in enumerate(self.number_scales(case.name)):
            moved = numbers.copy()
            moved[k] += 0.1 * scale
            columns.append(-k - 1)
            changes.append((np.asarray(values, dtype=float), moved, 0.1 * scale))
        # the compiled loops release the GIL; threads change no bit of the result
        found = list(POOL.map(lambda c: self.innovations(case, hypothesis, c[0], c[1], frames)[0], changes))
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
            step = min(0.1 * f.scale, max(f.high - values[k], values[k] - f.low))
            if values[k] + step > f.high:
                step = -step
            shifted = np.array(values, dtype=float)
            shifted[k] += step
            found.append((k, shifted, step))
        return found

    def _sensitivity(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, numbers: np.ndarray, fixed: bool,
        here: np.ndarray, held: Collection[int] = (), starts_too: bool = True,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """d(predicted/sigma) of the vector ``here`` (n,), by all values (n, p) and by the numbers of the starts (n, q).

        A number of a start moves its own segment alone, and the steps on both sides of it.
        """
        frames = self.frames[case.name]
        use = np.isfinite(case.values[frames])
        shifts = [] if fixed else self._value_steps(case, hypothesis, values, held)
        by_value = np.zeros((len(here), len(hypothesis.free)))
        moved = list(POOL.map(lambda s: self.vector(case, hypothesis, s[1], numbers), shifts))
        for (k, _, step), vector in zip(shifts, moved, strict=True):
            by_value[:, k] = (here - vector) / step
        by_start = np.zeros((len(here), len(numbers)))
        if starts_too:
            jobs = self._start_jobs(case, hypothesis, values, numbers, frames)
            runs = list(POOL.map(lambda j: self._follow(case, hypothesis, values, j[2]), jobs))
            rows = np.full(case.values.shape, -1)
            rows[frames] = np.where(use, np.cumsum(use.ravel()).reshape(use.shape) - 1, -1)
            ties = int(use.sum()) + np.concatenate([[0], np.cumsum([s.tie.size for s in self.segments[case.name]])])
            for (column, step, part), run in zip(jobs, runs, strict=True):
                innovations, steps = run.innovations, run.steps
                mine = rows[part.frames]
                seen = mine >= 0
                by_start[mine[seen], column] = (here[mine[seen]] - innovations[seen]) / step
                if len(steps):
                    span = slice(ties[part.k + 1], ties[part.k + 2])
                    by_start[span, column] = (here[span] - steps) / step
                if part.k:
                    # what was predicted for this start is fixed: the step changes with the start itself
                    at = column - sum(s.size for s in self.segments[case.name][: part.k])
                    row = ties[part.k] + at
                    by_start[row, column] = -1.0 / part.segment.tie[at]
        return by_value, by_start

    def _start_jobs(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, numbers: np.ndarray, frames: np.ndarray
    ) -> list[tuple[int, float, Part]]:
        """For each number of a start its column, the step it is moved by, and its segment with it moved."""
        jobs = []
        at = 0
        parts = self._parts(case, numbers, frames)
        if hypothesis.turns(case):
            # the spins that each begins with stay those of the fit
            runs = self._through(case, hypothesis, values, parts)
            parts = [replace(p, spin=run.spin) for p, run in zip(parts[1:], runs, strict=False)]
            parts.insert(0, runs[0].part)
        for part in parts:
            for k, scale in enumerate(number_scales(part.segment.starts)):
                moved = part.numbers.copy()
                moved[k] += 0.1 * scale
                jobs.append((at + k, 0.1 * scale, replace(part, numbers=moved)))
            at += part.segment.size
        return jobs

    def _central(self, case: Case, fit: Fit, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``_sensitivity``, by central differences; ``size`` (p,): of derivatives by values, in all recordings."""
        numbers = fit.starts[case.name]
        p = len(fit.values)
        columns: list[int] = []
        ends: list[tuple[np.ndarray, np.ndarray]] = []
        spans: list[float] = []
        for k, f in enumerate(fit.hypothesis.free):
            if f.cases is not None and case.name not in f.cases:
                continue
            step = min(1.0 / size[k], 0.1 * f.scale) if size[k] > 0 else 0.1 * f.scale
            low, high = (float(np.clip(fit.values[k] + side * step, f.low, f.high)) for side in (-1.0, 1.0))
            for end in (low, high):
                moved = fit.values.copy()
                moved[k] = end
                ends.append((moved, numbers))
            columns.append(k)
            spans.append(high - low)
        single = len(self.segments[case.name]) == 1
        for k, scale in enumerate(self.number_scales(case.name)) if single else ():
            told = float(np.linalg.norm(fit.jacobian[case.name][1][:, k]))
            step = min(1.0 / told, 0.1 * scale) if told > 0 else 0.1 * scale
            for side in (-1.0, 1.0):
                shifted = numbers.copy()
                shifted[k] += side * step
                ends.append((fit.values, shifted))
            columns.append(p + k)
            spans.append(2 * step)
        seen = list(POOL.map(lambda e: self.vector(case, fit.hypothesis, e[0], e[1]), ends))
        roots = fit.roots(case.name)
        result = np.zeros((len(roots), p + len(numbers)))
        for column, before, after, span in zip(columns, seen[::2], seen[1::2], spans, strict=True):
            if span > 0:
                result[:, column] = (before - after) / span
        if not single:
            here = fit.used(case.name) / roots
            result[:, p:] = self._sensitivity(case, fit.hypothesis, fit.values, numbers, True, here)[1]
        result *= roots[:, None]
        return result[:, :p], result[:, p:]

    def _by_prior(self, hypothesis: Hypothesis, values: np.ndarray, k: int) -> np.ndarray:
        """How what numbers are off their priors, of all recordings in turn, changes with number ``k``, by its unit."""
        ends = np.array(values), np.array(values)
        ends[1][k] += 1.0
        before, after = (np.concatenate([hypothesis.priors(c, v) for c in self.cases]) for v in ends)
        return np.asarray(after - before)
