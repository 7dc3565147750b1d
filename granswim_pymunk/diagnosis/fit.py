"""Fitting by simulation: starts and free numbers together, least squares in observed space."""

from __future__ import annotations

import copy
import math
import os
import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from scipy import stats
from scipy.optimize import least_squares

from ..inference.criteria import SegmentCriteria, current
from ..inference.threads import ContextPool
from .data import Case
from .hypothesis import Failed, Free, Hypothesis, Predictor
from .segments import Segment, cut_by_growth, limits_of, make_segments
from .solve import Blocks, Secant, descend
from .start import Pendulum, StartBody, first_numbers, number_scales

_POOL = ContextPool(max_workers=max(os.cpu_count() or 1, 1), thread_name_prefix="granswim")
# whole fits side by side; what they simulate goes to the other pool, so that none waits for itself
_FITS = ContextPool(max_workers=max(os.cpu_count() or 1, 1), thread_name_prefix="granswim-fit")

Found = TypeVar("Found")
COUPLED = ("pivot", "bar", "pendulum", "tether")  # two of them and more in one scene may swing chaotically


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis.

    values : (p,) free numbers of the terms;  starts : numbers of each recording's starts, segment after segment
    segments : of each recording, one where the whole of it is followed from one start
    innovations : (T, c) seen minus predicted over sigma, per recording, NaN where not used
    believed : (p, p) covariance of the values by errors of the believed masses and radii, None where they are exact
    whitened : the same with the memory of the noise taken out (``Case.white``); left out where it has none
    steps : (m,) from the ends of segments to the starts of the next ones, over their spread, per recording; after them
        how far numbers with a prior are off it
    covariance : (p, p) of the values, noise taken as known and white
    chi2, count : sum of squared innovations and steps, and how many innovations there are
    jacobian : per recording, d(predicted/sigma)/d(values) and /d(starts), on the used numbers, then on the steps
    limits : of numbers whose 95 % interval was found by profiles, see ``intervals.py``
    """

    hypothesis: Hypothesis
    values: np.ndarray
    starts: Mapping[str, np.ndarray]
    segments: Mapping[str, tuple[Segment, ...]]
    innovations: Mapping[str, np.ndarray]
    chi2: float
    count: int
    covariance: np.ndarray
    jacobian: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    limits: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    steps: Mapping[str, np.ndarray] = field(default_factory=dict)
    whitened: Mapping[str, np.ndarray] = field(default_factory=dict)
    believed: np.ndarray | None = None

    @property
    def white(self) -> Mapping[str, np.ndarray]:
        """Innovations with the memory of the noise taken out, the squares of which chi2 sums up."""
        return self.whitened or self.innovations

    @property
    def numbers(self) -> int:
        """How many numbers were fitted, those of the starts included, less the steps that tie them."""
        ties = sum(len(s) for s in self.steps.values())
        return len(self.values) + sum(len(s) for s in self.starts.values()) - ties

    def start_of(self, case: str) -> tuple[tuple[StartBody, ...], np.ndarray]:
        """How the first start of a recording is described, and its free numbers."""
        first = self.segments[case][0]
        return first.starts, self.starts[case][: first.size]

    def interval(self, k: int, inflation: float = 1.0) -> tuple[float, float, float]:
        """Value, low, high of free number k: central 95 %, cut at its bounds."""
        free = self.hypothesis.free[k]
        value = float(self.values[k])
        more = 0.0 if self.believed is None else 1.96**2 * max(float(self.believed[k, k]), 0.0)
        if k in self.limits:
            low, high = self.limits[k]
        else:
            half = 1.96 * float(np.sqrt(max(self.covariance[k, k], 0.0) * inflation))
            low, high = value - half, value + half
        low, high = value - math.hypot(value - low, math.sqrt(more)), value + math.hypot(high - value, math.sqrt(more))
        return value, max(low, free.low), min(high, free.high)

    def used(self, case: str) -> np.ndarray:
        """Innovations of a recording as one vector, the steps between its segments after them, weighted."""
        array, steps = self.white[case], self.steps.get(case, np.zeros(0))
        return np.concatenate([array[np.isfinite(array)], steps * self._step_roots(case)])

    def _step_roots(self, case: str) -> np.ndarray:
        steps = self.steps.get(case, np.zeros(0))
        return weight_roots(steps, limits_of(self.segments[case])) if len(steps) else steps

    def roots(self, case: str) -> np.ndarray:
        """Roots of the weights of ``used``: 1 but for steps that are far."""
        return np.concatenate([np.ones(int(np.isfinite(self.innovations[case]).sum())), self._step_roots(case)])

    def step_loss(self, case: str, most: int | None = None) -> float:
        """What the first ``most`` steps between segments, and priors, of a recording add to chi2."""
        steps, limit = self.steps.get(case, np.zeros(0)), limits_of(self.segments[case])
        between, priors = steps[: len(limit)][:most], steps[len(limit) :]
        return huber(between, limit) + float(priors @ priors)


def _limits(steps: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Limits of so many steps; what follows them has none."""
    return np.concatenate([limit[: len(steps)], np.full(max(len(steps) - len(limit), 0), np.inf)])


def huber(steps: np.ndarray, limit: np.ndarray) -> float:
    """Sum of Huber's loss: r^2 within the limit d, 2 d |r| - d^2 beyond it."""
    size, limit = np.abs(steps), _limits(steps, limit)
    return float(np.sum(np.minimum(size, limit) * (2 * size - np.minimum(size, limit))))


def weight_roots(steps: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Roots of the weights with which squares have the gradient of Huber's loss: d/|r| beyond the limit."""
    size = np.maximum(np.abs(steps), 1e-300)
    return np.asarray(np.sqrt(np.minimum(1.0, _limits(steps, limit) / size)))


def joined(fitter: Fitter, fit: Fit) -> tuple[Fitter, Fit]:
    """The fit again with segments that join more closely at impacts, at last as one, as far as the recordings allow.

    Allowed is a rise of chi2 that as many narrower steps would bring by chance in one of twenty fits. What numbers say
    grows with the length that is followed from one start, and closely tied segments may be caught in the bent valley
    between their starts, where one long one is not. Through many impacts chi2 of one start has many valleys itself: it
    counts only where the search ends in the same one from the loosely and from the closely joined segments.
    """
    ties = sum(int(np.isfinite(s.limit).sum()) for c in fit.segments.values() for s in c)
    level = max(fit.chi2 / max(fit.count, 1), 1.0)
    allowed = level * float(stats.chi2.isf(current().segments.joins, max(ties, 1)))
    loose = fit
    for share in current().segments.tighter if ties else ():
        closer = fitter.tightened(share)
        again = closer.fit(fit.hypothesis, fit.values, fit.starts, evaluations=12)
        if again.chi2 - fit.chi2 > allowed:
            break
        fitter, fit = closer, again
    if not fitter.segmented or fitter.stop():
        return fitter, fit
    one = fitter.in_one()
    ends = [one.fit_from(begin) for begin in ((fit,) if fit is loose else (fit, loose))]
    whole = min(ends, key=lambda f: f.chi2)
    spread = np.sqrt(np.diag(whole.covariance) * level)
    same = all((np.abs(f.values - whole.values) <= current().segments.same_valley * spread).all() for f in ends)
    if not same or whole.chi2 - fit.chi2 > allowed:
        return fitter, fit
    if not ties:
        return one, whole
    # how late each impact was stays open: what one start through rigid impacts would say is too sharp
    again = fitter.fit(fit.hypothesis, whole.values, fitter.continued(whole), evaluations=30)
    return (fitter, again) if again.chi2 <= whole.chi2 else (one, whole)


def side_by_side(fitter: Fitter, jobs: Sequence[Callable[[Fitter], Found]]) -> list[Found]:
    """What each job makes of a fitter of its own, in their order; no bit of it hangs on how many run at a time."""
    gone = threading.Event()

    def stop() -> bool:
        return gone.is_set() or fitter.stop()

    def done(job: Callable[[Fitter], Found]) -> Found:
        own = fitter.apart()
        own.stop = stop
        return job(own)

    try:
        return list(_FITS.map(done, jobs))
    finally:
        gone.set()  # whoever waits no longer, as at Ctrl-C, does not wait for the fits that are under way


class TimeUp(Exception):
    """The budget is spent: a fit ends where it stands."""


class Fitter:
    """Fits hypotheses to the same frames of the same recordings.

    stop : whether the time is up: a fit then ends with the best that it has seen
    whole : follow every recording from one start, also through impacts
    spin : (n,) [rad/s] of the scene's bodies at the start of a recording, none where not given
    rough : its fits end early: they tell what is worth fitting
    """

    def __init__(
        self,
        cases: Sequence[Case],
        predictor: Predictor,
        frames: Mapping[str, np.ndarray] | None = None,
        stop: Callable[[], bool] = lambda: False,
        weights: Mapping[str, np.ndarray] | None = None,
        whole: bool = False,
        spin: Mapping[str, np.ndarray | None] | None = None,
        rough: bool = False,
    ) -> None:
        self.rough = rough
        self.spin = spin or {}
        # (T,) of each recording: how much a frame counts in the fit; 1 where not given
        self.weights = weights or {}
        self.cases = [c for c in cases if (frames[c.name] if frames else c.training).any()]
        self.frames = {c.name: (frames[c.name] if frames else c.training) for c in self.cases}
        self.predictor = predictor
        self.stop = stop
        criteria = replace(current().segments, frames=10**9) if whole else current().segments
        self.segments = {c.name: self._segments(c, criteria, whole) for c in self.cases}
        # of each recording, derivatives by its starts (n, q) and by numbers with a prior (n, k) at the last fit
        self._kept: dict[str, Slow] = {}

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

    def in_one(self) -> Fitter:
        """The same with every recording followed from one start."""
        return Fitter(self.cases, self.predictor, self.frames, self.stop, self.weights, whole=True, spin=self.spin)

    def fit_from(self, segments: Fit) -> Fit:
        """Recordings followed from one start, beginning where a fit to their segments ended, over growing parts."""
        first = {name: numbers[: self.segments[name][0].size] for name, numbers in segments.starts.items()}
        return self.fit(segments.hypothesis, segments.values, first, stages=(0.35, 0.65, 1.0), evaluations=30)

    def continued(self, whole: Fit) -> dict[str, np.ndarray]:
        """Numbers of all segments' starts where a fit from one start to each recording passes them."""
        starts = {}
        for case in self.cases:
            numbers = self._begin(case.name, whole.starts)
            at, spin = 0, self.spin.get(case.name)
            for k, segment in enumerate(self.segments[case.name][:-1]):
                part = self._parts(case, numbers, self.frames[case.name])[k]
                run = self._follow(case, whole.hypothesis, whole.values, replace(part, spin=spin))
                at, spin = at + segment.size, run.spin
                following = self.segments[case.name][k + 1]
                numbers[at : at + following.size] -= run.steps * following.tie
            starts[case.name] = numbers
        return starts

    def apart(self) -> Fitter:
        """The same for fits of their own: what these leave behind is not seen here."""
        other = copy.copy(self)
        other._kept = dict(self._kept)
        return other

    def tightened(self, share: float) -> Fitter:
        """The same with the spread of steps at impacts multiplied by a share, as far as ``Segment.least``."""

        def closer(s: Segment) -> Segment:
            return replace(s, tie=np.where(np.isfinite(s.limit), np.maximum(share * s.tie, s.least), s.tie))

        other = copy.copy(self)
        other._kept = {}  # its rows of steps are others
        other.segments = {name: tuple(map(closer, segments)) for name, segments in self.segments.items()}
        return other

    # ---- residuals ------------------------------------------------------------------------------

    def innovations(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, numbers: np.ndarray, frames: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Seen minus predicted over sigma (T_frames, c), and the steps between segments and off priors (m,).

        A segment is followed to the start of the next one, the last as far as ``frames`` (T,) ask for.
        """
        runs = self._through(case, hypothesis, values, self._parts(case, numbers, frames))
        full, steps = self._joined(case, runs, frames)
        return full, np.concatenate([steps, hypothesis.priors(case, values)])

    def _parts(self, case: Case, numbers: np.ndarray, frames: np.ndarray) -> list[_Part]:
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
            parts.append(_Part(k, segment, mine, wanted, follower))
        return parts

    def _through(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, parts: Sequence[_Part], together: bool = False
    ) -> list[_Run]:
        """All segments in turn, or ``together``; each begins with the spins that the one before it ends with."""
        if not hypothesis.turns(case):
            how = _POOL.map if together else map
            return list(how(lambda part: self._follow(case, hypothesis, values, part), parts))
        runs: list[_Run] = []
        spin = self.spin.get(case.name)
        for part in parts:
            runs.append(self._follow(case, hypothesis, values, replace(part, spin=spin)))
            spin = runs[-1].spin
        return runs

    def _follow(self, case: Case, hypothesis: Hypothesis, values: np.ndarray, part: _Part) -> _Run:
        """One segment: its part, innovations on its frames, steps to the start of the next one."""
        segment, after = part.segment, part.follower
        seen = case.values[part.frames]
        t0 = float(case.t[segment.frames][0])
        following = None if after is None else (after[0], after[1].starts)
        nothing = np.zeros(0)
        try:
            predicted, end = self.predictor.run(
                hypothesis, case, values, segment.starts, part.numbers, t0, case.t[part.frames], following,
                part.spin,
            )  # fmt: skip
        except Failed:
            lost = nothing if after is None else np.full(after[1].size, current().fits.hopeless)
            return _Run(part, np.where(np.isfinite(seen), current().fits.hopeless, np.nan), lost, None)
        innovations = case.white((seen - predicted) / case.sigma, part.frames)
        if case.name in self.weights:
            innovations = innovations * self.weights[case.name][part.frames, None]
        if after is None or end is None:
            return _Run(part, innovations, nothing, None)
        return _Run(part, innovations, (after[2] - end.numbers) / after[1].tie, end.spin)

    @staticmethod
    def _joined(
        case: Case, runs: Sequence[_Run], frames: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
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

    def fit(
        self,
        hypothesis: Hypothesis,
        values: Sequence[float] | np.ndarray | None = None,
        starts: Mapping[str, np.ndarray] | None = None,
        *,
        fixed: bool = False,
        stages: Sequence[float] = (1.0,),
        evaluations: int = 25,
        held: Collection[int] = (),
        near: Fit | None = None,
    ) -> Fit:
        """Fit starts, and the free numbers unless ``fixed``, on the training frames; those ``held`` stay.

        ``stages``: shares of the frames taken in one after the other, so that a long oscillation is not
        caught a period off. ``values``, ``starts``: where to begin. ``near``: a fit of another hypothesis nearby, whose
        derivatives by the starts are good enough as long as the search gets on with them.
        """
        free = hypothesis.free
        x = np.array([f.first for f in free] if values is None else values, dtype=float)
        numbers = {c.name: self._begin(c.name, starts) for c in self.cases}
        if self.segmented:
            active = [] if fixed else [k for k, f in enumerate(free) if self._bears(f) and k not in held]
            known = self._known(near)
            x, numbers = self._descend(hypothesis, x, numbers, active, evaluations, known)
            return self._finish(hypothesis, x, numbers, fixed, known)
        for share in stages:
            if share == 1.0 and near is not None and not fixed and self.of_many_numbers:
                active = [k for k, f in enumerate(free) if self._bears(f) and k not in held]
                x, numbers = self._descend(hypothesis, x, numbers, active, evaluations, self._known(near))
            else:
                x, numbers = self._solve(hypothesis, x, numbers, fixed, share, evaluations, held)
        return self._finish(hypothesis, x, numbers, fixed)

    def _known(self, near: Fit | None) -> dict[str, Slow]:
        """Derivatives by the starts, and by numbers with a prior, from a fit nearby, where there are any.

        Over a segment they hardly hang on the law that is fitted: those of the last fit will do for the next one, which
        takes them anew where it gets on badly.
        """
        if near is None:
            return dict(self._kept)
        believed = near.hypothesis.believed
        given = {name: Slow(by_start, by_value[:, believed]) for name, (by_value, by_start) in near.jacobian.items()}
        return self._kept | given

    @property
    def of_many_numbers(self) -> bool:
        """Whether most derivatives are by starts, so that those of a fit nearby save most of the runs."""
        return max(len(self.first_numbers(c.name)) for c in self.cases) >= current().fits.own

    @property
    def segmented(self) -> bool:
        """Whether some recording is followed in more than one segment."""
        return any(len(s) > 1 for s in self.segments.values())

    def _begin(self, name: str, starts: Mapping[str, np.ndarray] | None) -> np.ndarray:
        """The numbers given, as far as they are those of the same segments, the others from the first frames."""
        first = self.first_numbers(name)
        given = (starts or {}).get(name, np.zeros(0))
        if len(self.segments[name]) == 1 and len(given) != len(first):
            given = given[: len(first)]
        same = min(len(given), len(first))
        return np.concatenate([given[:same], first[same:]])

    def first_numbers(self, name: str) -> np.ndarray:
        """First estimates of the numbers of all starts of a recording."""
        return np.concatenate([first_numbers(s.starts) for s in self.segments[name]])

    def number_scales(self, name: str) -> np.ndarray:
        """How well the first frames determine them."""
        return np.concatenate([number_scales(s.starts) for s in self.segments[name]])

    def _descend(
        self, hypothesis: Hypothesis, x: np.ndarray, numbers: Mapping[str, np.ndarray], active: list[int],
        evaluations: int, known: dict[str, Slow],
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:  # fmt: skip
        """The numbers that are ``active`` and all starts, by ``solve.descend``."""
        low, high = hypothesis.bounds
        at = np.array(active, dtype=int)

        def whole(part: np.ndarray) -> np.ndarray:
            values = np.array(x, dtype=float)
            values[at] = part
            return values

        def evaluate(part: np.ndarray, starts: list[np.ndarray]) -> list[np.ndarray]:
            values = whole(part)
            return [self._vector(c, hypothesis, values, s) for c, s in zip(self.cases, starts, strict=True)]

        held = [k for k in range(len(x)) if k not in set(active)]
        believed = [k for k in hypothesis.believed if k not in held]
        kept = known
        normal = {name: slow.by_start.T @ slow.by_start for name, slow in kept.items()}

        def differentiate(
            part: np.ndarray, starts: list[np.ndarray], here: list[np.ndarray], starts_too: bool
        ) -> list[Blocks]:
            values = whole(part)
            blocks = []
            for c, s, r in zip(self.cases, starts, here, strict=True):
                anew = starts_too or c.name not in kept or not kept[c.name].fits(r, s, believed)
                quick = held if anew else [*held, *believed]
                by_value, by_start = self._sensitivity(c, hypothesis, values, s, False, r, quick, anew)
                roots = self._roots(c, r)[:, None]
                by_value *= roots
                if anew:
                    kept[c.name] = Slow(by_start * roots, by_value[:, believed])
                    normal[c.name] = kept[c.name].by_start.T @ kept[c.name].by_start
                by_value[:, believed] = kept[c.name].by_believed
                blocks.append(Blocks(r * roots[:, 0], by_value[:, at], kept[c.name].by_start, normal[c.name]))
            return blocks

        def loss(vectors: list[np.ndarray]) -> float:
            return sum(self._loss(c, v) for c, v in zip(self.cases, vectors, strict=True))

        begin = (np.asarray(x, dtype=float)[at], [numbers[c.name] for c in self.cases])
        try:
            with np.errstate(all="ignore"):
                part, starts = descend(
                    evaluate, differentiate, loss, begin, (low[at], high[at]), stale=bool(known),
                    evaluations=evaluations, stop=self.stop,
                )  # fmt: skip
        except (ValueError, np.linalg.LinAlgError) as error:
            self.predictor.failures.append(f"fit: {error}")
            return x, dict(numbers)
        return whole(part), {c.name: s for c, s in zip(self.cases, starts, strict=True)}

    def fit_widely(self, hypothesis: Hypothesis, base: Fit | None, *, stages: Sequence[float] = (1.0,)) -> Fit:
        """Fit from several beginnings and keep the best: an oscillation has a local minimum in every period.

        Beginnings: gradually from the tracks, from ``base``, from every adjustable on a grid, and from swings
        of other amplitudes (an undamped pendulum follows a decaying one best with an amplitude in between).
        """
        found = [self.fit(hypothesis, None, base.starts if base else None, stages=stages)]
        values = np.array([f.first for f in hypothesis.free], dtype=float)
        beginnings: list[tuple[np.ndarray, dict[str, np.ndarray]]] = []
        if self.segmented:
            return found[0] if base is None else self._from_grid(hypothesis, found[0], base)
        starts = {c.name: self.first_numbers(c.name) for c in self.cases}
        bodies = [s for segments in self.segments.values() for s in segments[0].starts]
        swinging = any(isinstance(s.coordinates, Pendulum) for s in bodies)
        shares = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5) if swinging else (1.0,)
        grid = [values]
        for k, f in enumerate(hypothesis.free):
            for share in np.linspace(0.05, 0.95, 13) if self._bears(f) and not f.prior else ():
                other = values.copy()
                other[k] = f.low + share * (f.high - f.low)
                if np.isfinite(other[k]):
                    grid.append(other)
        for share in shares:
            beginnings += [(v, {name: n * share for name, n in starts.items()}) for v in grid]
        if base is not None:
            beginnings += [(v, dict(base.starts)) for v in grid]
        if len(beginnings) > 1:
            chi2 = list(_POOL.map(lambda b: self._chi2(hypothesis, *b), beginnings))
            for k in np.argsort(chi2)[:3]:
                found.append(self.fit(hypothesis, beginnings[k][0], beginnings[k][1]))
        return min(found, key=lambda fit: fit.chi2)

    def _from_grid(self, hypothesis: Hypothesis, first: Fit, base: Fit) -> Fit:
        """The best of a fit and of those that begin where single numbers lie elsewhere between their bounds."""
        found = [first]
        for k, f in enumerate(hypothesis.free):
            sought = self._bears(f) and np.isfinite(f.high - f.low) and not f.prior
            for share in (0.15, 0.5, 0.85) if sought else ():
                values = first.values.copy()
                values[k] = f.low + share * (f.high - f.low)
                found.append(self.fit(hypothesis, values, base.starts, near=first))
        return min(found, key=lambda fit: fit.chi2)

    def _vector(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, numbers: np.ndarray
    ) -> np.ndarray:
        """As ``vector`` on the frames of this fitter, the segments side by side."""
        frames = self.frames[case.name]
        runs = self._through(case, hypothesis, values, self._parts(case, numbers, frames), together=True)
        innovations, steps = self._joined(case, runs, frames)
        return np.concatenate([innovations[np.isfinite(case.values[frames])], steps, hypothesis.priors(case, values)])

    def _chi2(self, hypothesis: Hypothesis, values: np.ndarray, starts: Mapping[str, np.ndarray]) -> float:
        return sum(self._loss(c, self.vector(c, hypothesis, values, starts[c.name])) for c in self.cases)

    def _seen(self, case: Case) -> int:
        return int(np.isfinite(case.values[self.frames[case.name]]).sum())

    def _loss(self, case: Case, vector: np.ndarray) -> float:
        """chi2 of a vector: squares of innovations, Huber's loss of steps."""
        seen = self._seen(case)
        return float(vector[:seen] @ vector[:seen]) + huber(vector[seen:], limits_of(self.segments[case.name]))

    def _roots(self, case: Case, vector: np.ndarray) -> np.ndarray:
        seen = self._seen(case)
        return np.concatenate([np.ones(seen), weight_roots(vector[seen:], limits_of(self.segments[case.name]))])

    def _part(self, case: Case, share: float) -> np.ndarray:
        frames = self.frames[case.name]
        if share >= 1.0:
            return frames
        rows = np.flatnonzero(frames)
        part = np.zeros_like(frames)
        part[rows[: max(int(len(rows) * share), min(8, len(rows)))]] = True
        return part

    def _bears(self, free: Free) -> bool:
        return free.cases is None or any(c.name in free.cases for c in self.cases)

    def _solve(self, hypothesis, x, numbers, fixed, share, evaluations, held):
        free, cases = hypothesis.free, self.cases
        parts = {c.name: self._part(c, share) for c in cases}
        use = {c.name: np.isfinite(c.values[parts[c.name]]) for c in cases}
        # a number that bears on none of these recordings would only run into its bounds and shorten every step
        active = [] if fixed else [k for k, f in enumerate(free) if self._bears(f) and k not in held]
        p, place = len(active), {k: n for n, k in enumerate(active)}
        sizes = [len(numbers[c.name]) for c in cases]
        offsets = p + np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        scale, low, high = self._box([free[k] for k in active])
        if not len(scale):
            return x, numbers

        def unpack(z):
            z = np.clip(z * scale, low, high)
            values = np.array(x)
            values[active] = z[:p]
            return values, {c.name: z[offsets[k] : offsets[k + 1]] for k, c in enumerate(cases)}

        def residuals(z):
            if last and self.stop():
                raise TimeUp
            values, starts = unpack(z)
            seen = _POOL.map(lambda c: self.innovations(c, hypothesis, values, starts[c.name], parts[c.name])[0], cases)
            last.update(z=np.array(z), seen=dict(zip(parts, seen, strict=True)))
            found = seen_of(values)
            if float(found @ found) < best[0]:
                best[:] = [float(found @ found), np.array(z)]
            return found

        best: list[Any] = [np.inf, None]  # chi2 and numbers of the best so far, where time runs out
        last: dict[str, Any] = {}  # where the solver last looked, and what it saw there

        def seen_of(values):
            seen = [last["seen"][name][use[name]] for name in parts]
            return np.concatenate([*seen, *(hypothesis.priors(c, values) for c in cases)])

        secant = Secant()
        rows = np.concatenate([[0], np.cumsum([u.sum() for u in use.values()])]).astype(int)

        def jacobian(z):
            values, starts = unpack(z)
            if not last or not np.array_equal(last["z"], z):
                residuals(z)
            seen = seen_of(values)
            result = np.zeros((len(seen), len(z)))
            if (updated := secant.at(z, seen)) is not None:
                return updated
            for k, c in enumerate(cases):
                here = last["seen"][c.name]
                given = c, hypothesis, values, starts[c.name], parts[c.name], fixed, here, held
                columns, block = self.derivatives(*given)
                span = slice(rows[k], rows[k + 1])
                for index, column in zip(columns, block, strict=True):
                    target = place[index] if index >= 0 else offsets[k] - index - 1
                    result[span, target] = -column[use[c.name]] * scale[target]
            for k in set(hypothesis.believed) & set(place):
                result[rows[-1] :, place[k]] = self._by_prior(hypothesis, values, k) * scale[place[k]]
            secant.anew(z, seen, result)
            return result

        rough = self.rough or share < 1.0
        z0 = np.concatenate([x[active]] + [numbers[c.name] for c in cases]) / scale
        fall = current().fits.rough if rough else max(current().fits.fine / rows[-1], 1e-7)
        # the solver wants to begin strictly inside the bounds
        z0 = np.clip(z0, low / scale + 1e-9, high / scale - 1e-9)
        try:
            # a first-order amount can be far off: what overflows is a step that is taken back
            with np.errstate(all="ignore"):
                end = least_squares(
                    residuals, z0, jac=jacobian, bounds=(low / scale, high / scale), x_scale="jac",
                    max_nfev=evaluations, xtol=1e-6, ftol=fall, gtol=1e-9,
                ).x  # fmt: skip
        except (ValueError, np.linalg.LinAlgError) as error:
            self.predictor.failures.append(f"fit: {error}")
            return x, numbers
        except TimeUp:
            end = best[1]
        values, starts = unpack(end)
        return np.array(values), {name: np.array(v) for name, v in starts.items()}

    def _box(self, free: Sequence[Free]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Scale, low and high of numbers and, after them, of all starts."""
        starts = np.concatenate([self.number_scales(c.name) for c in self.cases])
        ends = np.full(len(starts), np.inf)
        scale, low, high = ([getattr(f, name) for f in free] for name in ("scale", "low", "high"))
        return tuple(np.concatenate(both) for both in ((scale, starts), (low, -ends), (high, ends)))  # type: ignore

    def _by_prior(self, hypothesis: Hypothesis, values: np.ndarray, k: int) -> np.ndarray:
        """How what numbers are off their priors, of all recordings in turn, changes with number ``k``, by its unit."""
        ends = np.array(values), np.array(values)
        ends[1][k] += 1.0
        before, after = (np.concatenate([hypothesis.priors(c, v) for c in self.cases]) for v in ends)
        return np.asarray(after - before)

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
        found = list(_POOL.map(lambda c: self.innovations(case, hypothesis, c[0], c[1], frames)[0], changes))
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
        moved = list(_POOL.map(lambda s: self.vector(case, hypothesis, s[1], numbers), shifts))
        for (k, _, step), vector in zip(shifts, moved, strict=True):
            by_value[:, k] = (here - vector) / step
        by_start = np.zeros((len(here), len(numbers)))
        if starts_too:
            jobs = self._start_jobs(case, hypothesis, values, numbers, frames)
            runs = list(_POOL.map(lambda j: self._follow(case, hypothesis, values, j[2]), jobs))
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
    ) -> list[tuple[int, float, _Part]]:
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

    def sharpened(self, fit: Fit) -> Fit:
        """The fit with derivatives and covariance from central differences, over steps that change chi2 by about one.

        A search does with steps of a tenth of a scale to one side; where two numbers nearly make up for one another,
        the curvature over such a step looks like a difference between them.
        """
        size = np.sqrt(sum(np.sum(by_value**2, axis=0) for by_value, _ in fit.jacobian.values()))
        jacobian = {c.name: self._central(c, fit, size) for c in self.cases}
        return replace(fit, jacobian=jacobian, covariance=np.linalg.pinv(information_of(jacobian, len(fit.values))))

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
        seen = list(_POOL.map(lambda e: self.vector(case, fit.hypothesis, e[0], e[1]), ends))
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

    def _finish(self, hypothesis, x, numbers, fixed, known: dict[str, Slow] | None = None) -> Fit:
        innovations, white, jacobian, steps = {}, {}, {}, {}
        p = len(hypothesis.free)
        chi2, count = 0.0, 0
        for c in self.cases:
            frames = self.frames[c.name]
            full = np.full(c.values.shape, np.nan)
            full[frames], steps[c.name] = self.innovations(c, hypothesis, x, numbers[c.name], frames)
            white[c.name] = full
            innovations[c.name] = self._raw(c, full, numbers[c.name])
            seen = full[np.isfinite(full)]
            here = np.concatenate([seen, steps[c.name]])
            kept, believed = (known or {}).get(c.name), hypothesis.believed
            if kept is not None and not kept.fits(here, numbers[c.name], believed):
                kept = None
            quick = believed if kept is not None else ()
            by_value, by_start = self._sensitivity(c, hypothesis, x, numbers[c.name], fixed, here, quick, kept is None)
            roots = self._roots(c, here)[:, None]
            by_value, by_start = by_value * roots, by_start * roots
            if kept is not None:
                by_start = kept.by_start
                by_value[:, believed] = 0.0 if fixed else kept.by_believed
            jacobian[c.name] = by_value, by_start
            if not fixed or not believed:
                self._kept[c.name] = Slow(by_start, by_value[:, believed])
            chi2 += self._loss(c, here)
            count += len(seen)
        covariance = np.linalg.pinv(information_of(jacobian, p)) if p and not fixed else np.zeros((p, p))
        return Fit(
            hypothesis, np.array(x), numbers, self.segments, innovations, chi2, count, covariance, jacobian,
            steps=steps, whitened=white,
        )  # fmt: skip

    def _raw(self, case: Case, white: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Innovations (T, c) as they were before ``Case.white``, which begins anew in each segment."""
        if not case.noise.size and case.late is None:
            return white
        raw = white.copy()
        for part in self._parts(case, numbers, self.frames[case.name]):
            weight = self.weights[case.name][part.frames, None] if case.name in self.weights else 1.0
            raw[part.frames] = case.raw(white[part.frames] / weight, part.frames) * weight
        return raw

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
                out[part.frames], end = self.predictor.run(
                    fit.hypothesis, case, fit.values, part.segment.starts, part.numbers, t0, case.t[part.frames],
                    following, spin,
                )  # fmt: skip
                spin = end.spin if end is not None and fit.hypothesis.turns(case) else None
        return out


def spin_at(predictor: Predictor, fit: Fit, case: Case, t0: float) -> np.ndarray | None:
    """Spins (n,) [rad/s] of the scene's bodies where the last segment of a fit that begins at ``t0`` or before begins.

    None where nothing turns, or where that is the first.
    """
    spin = None
    if not fit.hypothesis.turns(case):
        return None
    segments, numbers = fit.segments[case.name], fit.starts[case.name]
    for segment, after in pairwise(segments):
        if segment.until is None or segment.until > t0:
            break
        mine, numbers = numbers[: segment.size], numbers[segment.size :]
        begin = case.t[segment.frames][:1]
        _, end = predictor.run(
            fit.hypothesis, case, fit.values, segment.starts, mine, float(begin[0]), begin,
            (segment.until, after.starts), spin,
        )  # fmt: skip
        spin = None if end is None else end.spin
    return spin


@dataclass(frozen=True)
class _Part:
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
class _Run:
    """A segment followed: innovations (T, c) on its frames, steps (m,) to the next start, spins (n,) it ends with."""

    part: _Part
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


def information_of(jacobian: Mapping[str, tuple[np.ndarray, np.ndarray]], p: int) -> np.ndarray:
    """(p, p) of the values, the starts projected out."""
    information = np.zeros((p, p))
    for by_value, by_start in jacobian.values():
        projected = by_value - project(by_start, by_value)
        information += projected.T @ projected
    return information


def basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the columns (n, k), those that are numerically dependent left out."""
    if columns.shape[1] == 0:
        return columns
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0] / size[size > 0]
    if columns.shape[1] == 0:
        return columns
    if columns.shape[1] > current().fits.many:
        # many starts hardly depend on one another: the roots of their normal equations do
        values, vectors = np.linalg.eigh(columns.T @ columns)
        kept = values > 1e-10 * values[-1]
        return np.asarray(columns @ (vectors[:, kept] / np.sqrt(values[kept])))
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, s > 1e-7 * s[0]]


def project(columns: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Projection of ``vectors`` (n, m) on the span of ``columns`` (n, k)."""
    if columns.shape[1] > current().fits.many:
        size = np.linalg.norm(columns, axis=0)
        columns = columns[:, size > 0] / size[size > 0]
        values, turned = np.linalg.eigh(columns.T @ columns)
        kept = values > 1e-10 * values[-1]
        inner = turned[:, kept].T @ (columns.T @ vectors) / values[kept, None]
        return np.asarray(columns @ (turned[:, kept] @ inner))
    q = basis(columns)
    return np.asarray(q @ (q.T @ vectors))
