"""A fitted hypothesis: its numbers, what they leave, and what chi2 makes of steps between segments."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ... import distributions as stats
from ..criteria import current
from ..data import Case
from ..hypothesis import Beginning, Failed, Free, Hypothesis, Predictor
from ..linear import project
from ..significance import half_interval
from ..start import StartBody
from .segments import Segment, limits_of


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
    profiles : ends of 95 % of numbers that are not known alone, or unevenly: by chi2 along them (``intervals.py``)
    limits : of 95 % intervals that are not those of the covariance: profiles, and what else may move a number
    ended : whether the search through segments came to its end; not where its evaluations did
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
    profiles: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    steps: Mapping[str, np.ndarray] = field(default_factory=dict)
    whitened: Mapping[str, np.ndarray] = field(default_factory=dict)
    believed: np.ndarray | None = None
    ended: bool = True

    @property
    def white(self) -> Mapping[str, np.ndarray]:
        """Innovations with the memory of the noise taken out, the squares of which chi2 sums up."""
        return self.whitened or self.innovations

    @property
    def excess(self) -> float:
        """Chi2 beyond that of noise, 0 where it is within three of its standard deviations."""
        left = self.chi2 - self.count
        return left if left > 3 * math.sqrt(2 * self.count) else 0.0

    @property
    def numbers(self) -> int:
        """How many numbers were fitted, those of the starts included, less the steps that tie them."""
        ties = sum(len(s) for s in self.steps.values())
        return len(self.values) + sum(len(s) for s in self.starts.values()) - ties

    @property
    def ties(self) -> int:
        """How many numbers of starts are held to an impact before them."""
        return sum(int(np.isfinite(s.limit).sum()) for segments in self.segments.values() for s in segments)

    @property
    def allowed_rise(self) -> float:
        """What narrower steps at impacts may add to chi2: as much as chance does in one of twenty fits."""
        level = max(self.chi2 / max(self.count, 1), 1.0)
        return level * float(stats.chi2.isf(current().segments.joins, max(self.ties, 1)))

    def start_of(self, case: str) -> tuple[tuple[StartBody, ...], np.ndarray]:
        """How the first start of a recording is described, and its free numbers."""
        first = self.segments[case][0]
        return first.starts, self.starts[case][: first.size]

    def told(self, k: int) -> bool:
        """Whether the frames say anything of free number k: what happens in none of them (an impact) says nothing."""
        return any(by_value[:, k].any() for by_value, _ in self.jacobian.values())

    def interval(self, k: int, inflation: float = 1.0) -> tuple[float, float, float]:
        """Value, low, high of free number k: central 95 %, cut at its bounds."""
        free = self.hypothesis.free[k]
        value = float(self.values[k])
        more = 0.0 if self.believed is None else half_interval(float(self.believed[k, k]))
        if k in self.limits:
            low, high = self.limits[k]
        else:
            half = half_interval(float(self.covariance[k, k]) * inflation)
            low, high = value - half, value + half
        low, high = value - math.hypot(value - low, more), value + math.hypot(high - value, more)
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


def may_be_absent(fit: Fit, free: Sequence[Free], first: int, inflation: float) -> bool:
    """Whether of a law's numbers, the ``first`` and those behind it, the intervals of all strengths hold none."""
    ends = ((f.neutral, *fit.interval(k, inflation)[1:]) for k, f in enumerate(free, first) if not f.inner)
    return all(low <= neutral <= high for neutral, low, high in ends)


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
        t = case.t[segment.frames][:1]
        begin = Beginning(segment.starts, mine, float(t[0]), (segment.until, after.starts), spin)
        _, end = predictor.run(fit.hypothesis, case, fit.values, begin, t)
        spin = None if end is None else end.spin
    return spin


def passed_at(predictor: Predictor, fit: Fit, case: Case, t0: float, starts: tuple[StartBody, ...]) -> np.ndarray:
    """Free numbers (m,) of a start at ``t0`` [s], described by ``starts``, where a fit passes there.

    The fit is followed from its last segment that begins at ``t0`` or before. Raises Failed where none does.
    """
    segments, numbers = fit.segments[case.name], fit.starts[case.name]
    first = 0
    for segment, after in pairwise(segments):
        if float(case.t[after.frames][0]) > t0:
            break
        numbers, first = numbers[segment.size :], first + 1
    mine = segments[first]
    begins = float(case.t[mine.frames][0])
    if begins > t0:
        raise Failed("the fit begins later")
    if begins == t0 and len(mine.starts) == len(starts):
        return numbers[: mine.size]
    begin = Beginning(mine.starts, numbers[: mine.size], begins, (t0, starts), spin_at(predictor, fit, case, begins))
    end = predictor.run(fit.hypothesis, case, fit.values, begin, np.array([begins, t0]))[1]
    assert end is not None
    return end.numbers


def information_of(jacobian: Mapping[str, tuple[np.ndarray, np.ndarray]], p: int) -> np.ndarray:
    """(p, p) of the values, the starts projected out."""
    information = np.zeros((p, p))
    for by_value, by_start in jacobian.values():
        projected = by_value - project(by_start, by_value)
        information += projected.T @ projected
    return information


def covariance_of(information: np.ndarray) -> np.ndarray:
    """The pseudo-inverse of an information matrix (p, p), each number in a unit of its own size.

    A strength of 1e6 N and its power of 6 are known along a valley; in their own units the longer way of it would be
    taken for one of which nothing is told, and cut.
    """
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    size[size == 0] = 1.0
    scaled = information / np.outer(size, size)
    return np.asarray(np.linalg.pinv(scaled, hermitian=True) / np.outer(size, size))
