"""Fitting by simulation: starts and free numbers together, least squares in observed space."""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import least_squares, lsq_linear
from scipy.sparse.csgraph import connected_components

from ...laws import has_role
from ...machine import cores
from ..candidates import ABOUT
from ..criteria import current
from ..data import Case
from ..hypothesis import Failed, Free, Hypothesis, Predictor
from ..linear import errors_of
from ..start import Pendulum
from ..threads import ContextPool, at_work
from .fitted import Fit, covariance_of, huber, information_of, passed_at, weight_roots
from .follow import Follower, Slow
from .segments import Segment, cut_in_pieces, find_cuts, limits_of
from .solve import Blocks, Problem, Secant, descend, gauss_newton

# whole fits side by side; what they simulate goes to the other pool, so that none waits for itself
_FITS = ContextPool(max_workers=cores(), thread_name_prefix="granswim-fit")

Found = TypeVar("Found")


def joined(fitter: Fitter, fit: Fit) -> tuple[Fitter, Fit]:
    """The fit again with segments that join more closely at impacts, at last as one, as far as the recordings allow.

    Allowed is a rise of chi2 that as many narrower steps would bring by chance in one of twenty fits. What numbers say
    grows with the length that is followed from one start, and closely tied segments may be caught in the bent valley
    between their starts, where one long one is not. Through many impacts chi2 of one start has many valleys itself: it
    counts only where the search ends in the same one from the loosely and from the closely joined segments.
    """
    ties, level = fit.ties, max(fit.chi2 / max(fit.count, 1), 1.0)
    allowed = fit.allowed_rise
    loose = fit
    for share in current().segments.tighter if ties else ():
        if share >= fitter.closeness:
            continue
        closer = fitter.tightened(share / fitter.closeness)
        again = closer.refitted(fit, evaluations=current().evaluations.joints)
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
    enough = current().evaluations.one_start
    again = fitter.fit(fit.hypothesis, whole.values, fitter.continued(whole), evaluations=enough)
    # a search through close joints may not have come to its end, and what was found with them before be ahead of it
    return (fitter, min(again, fit, key=lambda f: f.chi2)) if again.chi2 <= whole.chi2 else (one, whole)


def promised(fit: Fit, active: Sequence[int]) -> float:
    """The fall of chi2 that a step of Gauss-Newton from the end of a fit promises, within the bounds of its numbers."""
    as_they_are = Straight.of(fit.hypothesis, fit.values, np.array(active, dtype=int), plainly=True)
    return _step_ahead(fit, as_they_are, active)[0]


def _step_ahead(fit: Fit, straight: Straight, active: Sequence[int]) -> tuple[float, np.ndarray]:
    """The fall of chi2 that a step of Gauss-Newton promises, and the step of coordinates and starts (k + q,)."""
    names, at = list(fit.jacobian), list(active)
    r = np.concatenate([fit.used(name) for name in names])
    own = block_diag(*(fit.jacobian[name][1] for name in names))
    slopes = straight.slopes(straight.begin)
    j = np.hstack([np.vstack([fit.jacobian[name][0][:, at] * slopes for name in names]), own])
    size = np.linalg.norm(j, axis=0)
    told = size > 0
    low, high = (np.full(j.shape[1], end) for end in (-np.inf, np.inf))
    for edge, bound in zip((low, high), straight.bounds, strict=True):
        edge[: len(at)] = bound - straight.begin
    box = np.minimum(low, 0.0)[told] * size[told], np.maximum(high, 0.0)[told] * size[told]
    step = np.zeros(j.shape[1])
    if not told.any() or not np.isfinite(j).all():
        return 0.0, step
    found = lsq_linear(j[:, told] / size[told], r, box, method="bvls", lsq_solver="exact")
    step[told] = found.x / size[told]
    return float(r @ r - 2 * found.cost), step


def side_by_side(fitter: Fitter, jobs: Sequence[Callable[[Fitter], Found]]) -> list[Found]:
    """What each job makes of a fitter of its own, in their order; no bit of it hangs on how many run at a time."""
    gone = threading.Event()

    def stop() -> bool:
        return gone.is_set() or fitter.stop()

    def done(job: Callable[[Fitter], Found]) -> Found:
        own = fitter.apart()
        own.stop = stop
        with at_work():
            return job(own)

    try:
        return [done(job) for job in jobs] if fitter.predictor.short else list(_FITS.map(done, jobs))
    finally:
        gone.set()  # whoever waits no longer, as at Ctrl-C, does not wait for the fits that are under way


@dataclass(frozen=True)
class Straight:
    """Coordinates (k,) of numbers that are fitted, in which the valley between strength and shape of a law is straight.

    A force s (r_0/r)^n at the distances r where it acts hardly changes along ln s = n ln(r/r_0) + const: a line in
    ln |s| and n, and bent in s and n. So it is for a range in place of an exponent. A strength that begins at none has
    no logarithm and stays as it is, as do all numbers of laws without a shape.

    sign : (k,) of those that are logarithms, 0 where the number stays as it is;  begin : (k,), bounds : two of (k,)
    """

    sign: np.ndarray
    begin: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray]

    @classmethod
    def of(
        cls, hypothesis: Hypothesis, x: np.ndarray, at: np.ndarray, plainly: bool = False, streams: bool = False
    ) -> Straight:
        """Of the numbers ``at`` (k,) among all (p,) of a hypothesis, which begin at ``x`` (p,); ``plainly``: none.

        ``streams``: also of a drag in a stream, which is c u along its valley, and hardly straighter in ln c and u.
        """
        shaped = [
            not (f.inner or f.neutral or plainly) and any(g.inner for g in term.free)
            and (streams or not has_role(term.mechanism, *ABOUT))
            for term in hypothesis.terms for f in term.free
        ]  # fmt: skip
        sign = np.where(np.array(shaped, dtype=bool), np.sign(x), 0.0)[at]
        low, high = (end[at] for end in hypothesis.bounds)
        near, far = np.where(sign < 0, -high, low), np.where(sign < 0, -low, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = [np.log(np.maximum(size, 0.0)) for size in (np.abs(x[at]), near, far)]
        begin, least, most = (np.where(sign != 0, a, b) for a, b in zip(logs, (x[at], low, high), strict=True))
        return cls(sign, begin, (least, most))

    def values(self, part: np.ndarray) -> np.ndarray:
        """(k,) the numbers themselves; a search that is lost may ask for a strength beyond all numbers."""
        most = math.log(np.finfo(float).max)
        return np.where(self.sign != 0, self.sign * np.exp(np.where(self.sign != 0, np.minimum(part, most), 0.0)), part)

    def gone(self, part: np.ndarray) -> bool:
        """Whether a strength has nearly vanished on the way."""
        return bool(((self.sign != 0) & (part < self.begin + math.log(current().fits.gone))).any())

    def slopes(self, part: np.ndarray) -> np.ndarray:
        """(k,) d(number)/d(coordinate)."""
        return np.where(self.sign != 0, self.values(part), 1.0)


def _searched(
    residuals: Callable[[np.ndarray], np.ndarray], jacobian: Callable[[np.ndarray], np.ndarray], begin: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray], evaluations: int, fall: float,
) -> tuple[np.ndarray, int]:  # fmt: skip
    """Where least squares end, within bounds, and how many evaluations are left; ``fall``: of chi2, that is the end."""
    # the solver wants to begin strictly inside the bounds
    begin = np.clip(begin, bounds[0] + 1e-9, bounds[1] - 1e-9)
    # a first-order amount can be far off: what overflows is a step that is taken back
    with np.errstate(all="ignore"):
        found = least_squares(
            residuals, begin, jac=jacobian, bounds=bounds, x_scale="jac", max_nfev=evaluations, xtol=1e-6, gtol=1e-9,
            ftol=fall,
        )  # fmt: skip
    return found.x, evaluations - int(found.nfev)


class TimeUp(Exception):
    """The budget is spent: a fit ends where it stands."""


class Fitter(Follower):
    """Fits hypotheses to the same frames of the same recordings.

    stop : whether the time is up: a fit then ends with the best that it has seen
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
        super().__init__(cases, predictor, frames, weights, whole, spin)
        self.rough = rough
        self.closeness = 1.0  # by which the spread of steps at impacts is multiplied, as far as ``Segment.least``
        self.stop = stop
        # of each recording, derivatives by its starts (n, q) and by numbers with a prior (n, k) at the last fit
        self._kept: dict[str, Slow] = {}

    def in_one(self) -> Fitter:
        """The same with every recording followed from one start."""
        return Fitter(self.cases, self.predictor, self.frames, self.stop, self.weights, whole=True, spin=self.spin)

    def in_pieces(self, pieces: int) -> Fitter:
        """The same with every recording cut into pieces whose starts are free of one another."""
        free = Fitter(self.cases, self.predictor, self.frames, self.stop, self.weights, whole=True, spin=self.spin)
        free.segments = {c.name: cut_in_pieces(c, self.frames[c.name], pieces) for c in self.cases}
        return free

    def of_all_frames(self, cases: Sequence[Case]) -> Fitter:
        """Of all frames of these recordings, held-out ones too, in segments between all impacts."""
        frames = {case.name: case.training | case.start | case.scored for case in cases}
        return Fitter(cases, self.predictor, frames, self.stop, spin=self.spin)

    def fit_from(self, segments: Fit) -> Fit:
        """Recordings followed from one start, beginning where a fit to their segments ended, over growing parts."""
        first = {name: numbers[: self.segments[name][0].size] for name, numbers in segments.starts.items()}
        how = current().evaluations
        return self.fit(
            segments.hypothesis, segments.values, first, stages=how.growing, evaluations=how.one_start
        )  # fmt: skip

    def is_cut_as(self, fit: Fit) -> bool:
        """Whether a fit has as many segments of each recording as are followed here."""
        return all(len(self.segments[name]) == len(segments) for name, segments in fit.segments.items())

    def of_these_segments(self, fit: Fit) -> Fit:
        """A fit as it is where it is cut as here; else fitted anew, from where it ended."""
        if self.is_cut_as(fit):
            return fit
        return self.refitted(fit) if self.segmented else self.fit_from(fit)

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

    def from_flights(self, hypothesis: Hypothesis, values: Sequence[float] | np.ndarray) -> dict[str, np.ndarray]:
        """Numbers of all starts from the frames of each segment in which a body was not struck yet, and from no steps.

        What comes after an impact that a start a little off misses, or makes where there was none, leads it astray; a
        flight alone leads every start to where it is. Few starts see no impact in their segment: several bodies meet
        while two are still near each other.
        """
        cases, segments = [], {}
        for case in self.cases:
            seen, impacts = case.values.copy(), find_cuts(case)
            for segment in self.segments[case.name]:
                rows = np.flatnonzero(segment.frames)
                for k, channel in enumerate(case.channels):
                    hits = [i.row for i in impacts if channel.body in i.bodies and rows[0] <= i.row <= rows[-1]]
                    if hits and min(hits) - rows[0] >= current().segments.frames:
                        seen[min(hits) : rows[-1] + 1, k] = np.nan
            cases.append(replace(case, values=seen))
            untied = current().segments.untied
            segments[case.name] = tuple(replace(s, tie=np.full(s.tie.shape, untied)) for s in self.segments[case.name])
        free = Fitter(cases, self.predictor, self.frames, self.stop, self.weights, spin=self.spin)
        free.segments = segments
        fit = free.fit(hypothesis, values, fixed=True, evaluations=current().fits.flights)
        return {case.name: self._drawn(case, fit) for case in self.cases}

    def _drawn(self, case: Case, flights: Fit) -> np.ndarray:
        """Of starts drawn as well as flights tell them, those that follow best what comes after the impacts.

        Bodies that meet in a segment are chosen together, the others apart from them.
        """
        rng, criteria = np.random.default_rng(0), current().fits
        numbers, errors = flights.starts[case.name], errors_of(flights.jacobian[case.name][1])
        off = errors @ rng.normal(size=(len(numbers), criteria.drawn))
        drawn = numbers + np.vstack([np.zeros(len(numbers)), off.T])
        segments, impacts = self.segments[case.name], find_cuts(case)
        bodies = list(dict.fromkeys([c.body for c in case.channels] + [s.body for s in segments[0].starts]))
        column = np.array([bodies.index(c.body) for c in case.channels])
        frames, left = self.frames[case.name], []
        for one in drawn:
            parts = self._parts(case, one, frames)
            runs = self._through(case, flights.hypothesis, flights.values, parts, together=True)
            squares = (np.nansum(np.minimum(np.abs(run.innovations), criteria.hopeless) ** 2, axis=0) for run in runs)
            left.append([np.bincount(column, s, len(bodies)) for s in squares])
        best, at = numbers.copy(), 0
        for k, segment in enumerate(segments[: len(left[0])]):
            rows = np.flatnonzero(segment.frames)
            met = np.eye(len(bodies))
            for impact in impacts:
                mine = [bodies.index(b) for b in impact.bodies if rows[0] <= impact.row <= rows[-1]]
                met[np.ix_(mine, mine)] = 1
            group = connected_components(met, directed=False)[1]
            loss = np.array([np.bincount(group, one[k]) for one in left])
            chosen = loss.argmin(axis=0)[group]
            for s in segment.starts:
                for _ in range(int(s.free.sum())):
                    best[at] = drawn[chosen[bodies.index(s.body)], at]
                    at += 1
        return best

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
        other.closeness = share * self.closeness
        return other

    def fit(
        self,
        hypothesis: Hypothesis,
        values: Sequence[float] | np.ndarray | None = None,
        starts: Mapping[str, np.ndarray] | None = None,
        *,
        fixed: bool = False,
        stages: Sequence[float] = (1.0,),
        evaluations: int | None = None,
        held: Collection[int] = (),
        near: Fit | None = None,
    ) -> Fit:
        """Fit starts, and the free numbers unless ``fixed``, on the training frames; those ``held`` stay.

        ``stages``: shares of the frames taken in one after the other, so that a long oscillation is not
        caught a period off; none: only followed from where it begins. ``values``, ``starts``: where to begin.
        ``near``: a fit of another hypothesis nearby, whose derivatives by the starts are good enough as long as the
        search gets on with them.
        """
        free = hypothesis.free
        evaluations = current().evaluations.usual if evaluations is None else evaluations
        x = np.array([f.first for f in free] if values is None else values, dtype=float)
        numbers = {c.name: self._begin(c.name, starts) for c in self.cases}
        # a number that bears on none of these recordings would only run into its bounds and shorten every step
        active = [] if fixed else [k for k, f in enumerate(free) if self._bears(f) and k not in held]
        if self.segmented:
            known, ended = self._known(near), False
            if stages:
                x, numbers, ended = self._descend(hypothesis, x, numbers, active, evaluations, known)
            return replace(self._finish(hypothesis, x, numbers, fixed, known), ended=ended)
        left = 0
        for share in stages:
            if share == 1 and near is not None and not fixed and self.of_many_numbers:
                x, numbers, _ = self._descend(hypothesis, x, numbers, active, evaluations, self._known(near))
            else:
                x, numbers, left = self._solve(hypothesis, x, numbers, active, share, evaluations, True)
        found = self._finish(hypothesis, x, numbers, fixed)
        enough = max(self._share(found.count) * found.chi2, current().fits.enough)
        if left > 0 and not self.stop() and promised(found, active) > enough:
            x, numbers, _ = self._solve(hypothesis, x, numbers, active, 1.0, left, False)
            found = self._finish(hypothesis, x, numbers, fixed)
        return found if fixed or self.rough or not stages else self._along_the_valley(found, active, enough)

    def _along_the_valley(self, found: Fit, active: Sequence[int], enough: float) -> Fit:
        """A fit of a strength and a shape gone on with by central differences, where these promise ``enough`` of chi2.

        A search ends where differences to one side, in which a strength and a shape nearly make up for one another,
        promise nothing more.
        """
        at = np.array(active, dtype=int)
        for _ in range(current().fits.valley):
            straight = Straight.of(found.hypothesis, found.values, at)
            if self.stop() or not (straight.sign != 0).any():
                break
            fall, step = _step_ahead(self.sharpened(found), straight, active)
            if fall < enough:
                break
            again = self._stepped(found, straight, step, active)
            if again is None:
                break
            found = again
        return found

    def _stepped(self, found: Fit, straight: Straight, step: np.ndarray, active: Sequence[int]) -> Fit | None:
        """The fit after a step, or a half or a quarter of it, that lowers chi2; None where none does."""
        values, sizes = found.values.copy(), [len(found.starts[c.name]) for c in self.cases]
        steps = np.split(step[len(active) :], np.cumsum(sizes)[:-1])
        for share in (1.0, 1 / 2, 1 / 4):
            part = np.clip(straight.begin + share * step[: len(active)], *straight.bounds)
            with np.errstate(over="ignore"):  # a step that is too long ends nowhere
                values[list(active)] = straight.values(part)
            if not np.isfinite(values).all():
                continue
            starts = {c.name: found.starts[c.name] + share * s for c, s in zip(self.cases, steps, strict=True)}
            try:
                again = self._finish(found.hypothesis, values, starts, False)
            except Failed:
                continue
            if again.chi2 < found.chi2:
                return again
        return None

    def refitted(self, fit: Fit, **how: Any) -> Fit:
        """The same hypothesis fitted once more, from where another fit of it ended; ``how`` as for ``fit``."""
        return self.fit(fit.hypothesis, fit.values, fit.starts, **how)

    def begun(self, fit: Fit, case: Case) -> np.ndarray:
        """Numbers (m,) of the first start of a recording where a fit to other frames passes it. Raises Failed."""
        first = self.segments[case.name][0]
        return passed_at(self.predictor, fit, case, float(case.t[first.frames][0]), first.starts)

    def started(self, fit: Fit, values: np.ndarray, evaluations: int) -> Fit:
        """The start of the only recording fitted with these numbers of the hypothesis of a fit to other frames.

        It is sought from what its frames show at once, and from where that fit passes: with an impact right behind
        them, either search may end where bodies meet too early.
        """
        (case,) = self.cases
        found = self.fit(fit.hypothesis, values, None, fixed=True, evaluations=evaluations)
        if len(self.segments[case.name]) > 1 or case.name not in fit.segments:
            return found
        try:
            begin = {case.name: self.begun(fit, case)}
        except Failed:
            return found
        passed = self.fit(fit.hypothesis, values, begin, fixed=True, evaluations=evaluations)
        return min(passed, found, key=lambda f: f.chi2)

    def beside(
        self, base: Fit, hypothesis: Hypothesis, begin: np.ndarray
    ) -> tuple[np.ndarray, Mapping[str, np.ndarray]]:
        """Values and starts from which to look for numbers beside those of a fit: (p + k,), and (q,) per recording.

        With a law of numbers ``begin`` (k,) and the starts of a fit without it, a run goes astray, however right they
        are: a first-order amount is what is best once starts and free numbers have made room for it. They are moved
        as the derivatives of the fit ``base`` ask for, where that is nearer.
        """
        values = np.concatenate([base.values, begin])
        left = [self.vector(c, hypothesis, values, base.starts[c.name]) for c in self.cases]
        blocks = []
        for c, r in zip(self.cases, left, strict=True):
            roots, (by_value, by_start) = self._roots(c, r), base.jacobian[c.name]
            none = np.zeros((len(by_value), len(begin)))
            blocks.append(Blocks(roots * r, np.hstack([by_value, none]), by_start))
        low, high = (np.array(end) for end in hypothesis.bounds)
        step, steps, _ = gauss_newton(blocks, values, (low, high), current().fits.least)
        moved = np.clip(values + step, low, high)
        starts = {c.name: base.starts[c.name] + d for c, d in zip(self.cases, steps, strict=True)}
        there = sum(self._loss(c, self.vector(c, hypothesis, moved, starts[c.name])) for c in self.cases)
        here = sum(self._loss(c, r) for c, r in zip(self.cases, left, strict=True))
        return (moved, starts) if there < here else (values, base.starts)

    def _share(self, count: int, rough: bool = False) -> float:
        """Of chi2, the fall at which a fit ends."""
        return current().fits.rough if rough or self.rough else max(current().fits.fine / count, 1e-7)

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

    def _begin(self, name: str, starts: Mapping[str, np.ndarray] | None) -> np.ndarray:
        """The numbers given, as far as they are those of the same segments, the others from the first frames."""
        first = self.first_numbers(name)
        given = (starts or {}).get(name, np.zeros(0))
        if len(self.segments[name]) == 1 and len(given) != len(first):
            given = given[: len(first)]
        same = min(len(given), len(first))
        return np.concatenate([given[:same], first[same:]])

    def _descend(
        self, hypothesis: Hypothesis, x: np.ndarray, numbers: Mapping[str, np.ndarray], active: list[int],
        evaluations: int, known: dict[str, Slow], plainly: bool = False,
    ) -> tuple[np.ndarray, dict[str, np.ndarray], bool]:  # fmt: skip
        """The numbers that are ``active`` and all starts, by ``solve.descend``, and whether it came to its end.

        ``plainly``: by the numbers themselves, not in coordinates that are ``Straight``.
        """
        at = np.array(active, dtype=int)
        straight = Straight.of(hypothesis, np.asarray(x, dtype=float), at, plainly, streams=True)

        def whole(part: np.ndarray) -> np.ndarray:
            values = np.array(x, dtype=float)
            values[at] = straight.values(part)
            return values

        def evaluate(part: np.ndarray, starts: list[np.ndarray]) -> list[np.ndarray]:
            values = whole(part)
            return [self._vector(c, hypothesis, values, s) for c, s in zip(self.cases, starts, strict=True)]

        held = [k for k in range(len(x)) if k not in set(active)]
        # joined more closely than any scene without a law is: what was found is near, and all move together
        least = min(current().segments.closer)
        narrow = self.segmented and self.closeness < least and not np.isclose(self.closeness, least)
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
                by_value, by_start = self._sensitivity(c, hypothesis, values, s, False, quick, anew)
                roots = self._roots(c, r)[:, None]
                by_value *= roots
                if anew:
                    kept[c.name] = Slow(by_start * roots, by_value[:, believed])
                    normal[c.name] = kept[c.name].by_start.T @ kept[c.name].by_start
                by_value[:, believed] = kept[c.name].by_believed
                own, seen = kept[c.name].by_start, self._seen(c) if narrow else None
                by_part = by_value[:, at] * straight.slopes(part)
                blocks.append(Blocks(r * roots[:, 0], by_part, own, normal[c.name], seen))
            return blocks

        def loss(vectors: list[np.ndarray]) -> float:
            return sum(self._loss(c, v) for c, v in zip(self.cases, vectors, strict=True))

        begin = (straight.begin, [numbers[c.name] for c in self.cases])
        try:
            with np.errstate(all="ignore"):
                part, starts, ended = descend(
                    Problem(evaluate, differentiate, loss), begin, straight.bounds, stale=bool(known),
                    evaluations=evaluations, stop=self.stop,
                )  # fmt: skip
        except (ValueError, np.linalg.LinAlgError) as error:
            self.predictor.failures.append(f"fit: {error}")
            return x, dict(numbers), True
        numbers = {c.name: s for c, s in zip(self.cases, starts, strict=True)}
        if straight.gone(part):  # on its way through none a strength may change its sign, which no logarithm does
            return self._descend(hypothesis, whole(part), numbers, active, evaluations, known, plainly=True)
        return whole(part), numbers, ended

    def fit_widely(self, hypothesis: Hypothesis, base: Fit | None, *, stages: Sequence[float] = (1.0,)) -> Fit:
        """Fit from several beginnings and keep the best: an oscillation has a local minimum in every period.

        Beginnings: gradually from the tracks, from ``base``, from every adjustable on a grid, and from swings
        of other amplitudes (an undamped pendulum follows a decaying one best with an amplitude in between).
        """

        def gradually(own: Fitter) -> Fit:
            return own.fit(hypothesis, None, base.starts if base else None, stages=stages)

        def begun(own: Fitter, values: np.ndarray, starts: Mapping[str, np.ndarray]) -> Fit:
            return own.fit(hypothesis, values, starts)

        if self.segmented:
            first = gradually(self)
            return first if base is None else self._from_grid(hypothesis, first, base)
        values = np.array([f.first for f in hypothesis.free], dtype=float)
        beginnings: list[tuple[np.ndarray, dict[str, np.ndarray]]] = []
        starts = {c.name: self.first_numbers(c.name) for c in self.cases}
        bodies = [s for segments in self.segments.values() for s in segments[0].starts]
        swinging = any(isinstance(s.coordinates, Pendulum) for s in bodies)
        shares = current().fits.swings if swinging else (1.0,)
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
        jobs: list[Callable[[Fitter], Fit]] = [gradually]
        if len(beginnings) > 1:
            chi2 = self.spread(lambda b: self._chi2(hypothesis, *b), beginnings)
            nearest = [beginnings[k] for k in np.argsort(chi2)[:3]]
            jobs += [partial(begun, values=values, starts=starts) for values, starts in nearest]
        return min(side_by_side(self, jobs), key=lambda fit: fit.chi2)

    def _from_grid(self, hypothesis: Hypothesis, first: Fit, base: Fit) -> Fit:
        """The best of a fit and of those that begin where single numbers lie elsewhere between their bounds."""
        found = [first]
        for k, f in enumerate(hypothesis.free):
            sought = self._bears(f) and np.isfinite(f.high - f.low) and not f.prior
            for share in current().fits.grid if sought else ():
                values = first.values.copy()
                values[k] = f.low + share * (f.high - f.low)
                found.append(self.fit(hypothesis, values, base.starts, near=first))
        return min(found, key=lambda fit: fit.chi2)

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
        if share >= 1:
            return frames
        rows = np.flatnonzero(frames)
        part = np.zeros_like(frames)
        part[rows[: max(int(len(rows) * share), min(8, len(rows)))]] = True
        return part

    def _solve(
        self, hypothesis: Hypothesis, x: np.ndarray, numbers: dict[str, np.ndarray], active: list[int], share: float,
        evaluations: int, longer: bool, plainly: bool = False,
    ) -> tuple[np.ndarray, dict[str, np.ndarray], int]:  # fmt: skip
        """Numbers and starts, and how many evaluations are left. ``longer``: derivatives as ``FitCriteria`` says.

        ``plainly``: by the numbers themselves, not in coordinates that are ``Straight``.
        """
        free, cases = hypothesis.free, self.cases
        fixed, held = not active, [k for k in range(len(free)) if k not in set(active)]
        led = self.with_steps(current().fits.longer) if longer else self
        parts = {c.name: self._part(c, share) for c in cases}
        use = {c.name: np.isfinite(c.values[parts[c.name]]) for c in cases}
        p, place = len(active), {k: n for n, k in enumerate(active)}
        offsets = p + np.concatenate([[0], np.cumsum([len(numbers[c.name]) for c in cases])]).astype(int)
        straight = Straight.of(hypothesis, np.asarray(x, dtype=float), np.array(active, dtype=int), plainly)
        scale, low, high = self._box([free[k] for k in active], straight)
        if not len(scale):
            return x, numbers, 0

        def unpack(z):
            z = np.clip(z * scale, low, high)
            values = np.array(x)
            values[active] = straight.values(z[:p])
            return values, {c.name: z[offsets[k] : offsets[k + 1]] for k, c in enumerate(cases)}

        def residuals(z):
            if last and self.stop():
                raise TimeUp
            values, at = unpack(z)
            seen = self.spread(lambda c: self.innovations(c, hypothesis, values, at[c.name], parts[c.name])[0], cases)
            last.update(z=np.array(z), seen=dict(zip(parts, seen, strict=True)))
            found = seen_of(values)
            if float(found @ found) < best[0]:
                best[:] = [float(found @ found), np.array(z)]
            return found

        best: list[Any] = [np.inf, None]  # chi2 and numbers of the best so far, where time runs out
        last: dict[str, Any] = {}  # where the solver last looked, and what it saw there

        def seen_of(values):
            seen = (last["seen"][name][use[name]] for name in parts)
            return np.concatenate([*seen, *(hypothesis.priors(c, values) for c in cases)])

        secant = Secant()
        rows = np.concatenate([[0], np.cumsum([u.sum() for u in use.values()])]).astype(int)

        def jacobian(z):
            if not last or not np.array_equal(last["z"], z):
                residuals(z)
            values, starts = unpack(z)
            seen = seen_of(values)
            result = np.zeros((len(seen), len(z)))
            if (updated := secant.at(z, seen)) is not None:
                return updated
            for k, c in enumerate(cases):
                here = None if longer else last["seen"][c.name]
                moved = led.derivatives(c, hypothesis, values, starts[c.name], parts[c.name], fixed, here, held)
                for index, column in zip(*moved, strict=True):
                    at = place[index] if index >= 0 else offsets[k] - index - 1
                    result[rows[k] : rows[k + 1], at] = -column[use[c.name]] * scale[at]
            for k in set(hypothesis.believed) & set(place):
                result[rows[-1] :, place[k]] = self._by_prior(hypothesis, values, k) * scale[place[k]]
            result[:, :p] *= straight.slopes(z[:p] * scale[:p])
            secant.anew(z, seen, result)
            return result

        z0 = np.concatenate([straight.begin] + [numbers[c.name] for c in cases]) / scale
        fall = self._share(int(rows[-1]), share < 1 or longer)
        try:
            end, left = _searched(residuals, jacobian, z0, (low / scale, high / scale), evaluations, fall)
        except (ValueError, np.linalg.LinAlgError) as error:
            self.predictor.failures.append(f"fit: {error}")
            return x, numbers, evaluations if longer else 0
        except TimeUp:
            end, left = best[1], 0
        values, starts = unpack(end)
        if left > 0 and straight.gone(end[:p] * scale[:p]):  # it may change its sign, which no logarithm does
            return self._solve(hypothesis, values, starts, active, share, left, longer, plainly=True)
        return np.array(values), {name: np.array(v) for name, v in starts.items()}, left

    def _box(self, free: Sequence[Free], straight: Straight) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Scale, low and high of the coordinates of numbers and, after them, of all starts."""
        starts = np.concatenate([self.number_scales(c.name) for c in self.cases])
        ends = np.full(len(starts), np.inf)
        scale = np.array([f.scale for f in free]) / np.abs(straight.slopes(straight.begin))
        low, high = straight.bounds
        return tuple(np.concatenate(both) for both in ((scale, starts), (low, -ends), (high, ends)))  # type: ignore

    def sharpened(self, fit: Fit) -> Fit:
        """The fit with derivatives and covariance from central differences, over steps that change chi2 by about one.

        A search does with steps of a tenth of a scale to one side; where two numbers nearly make up for one another,
        the curvature over such a step looks like a difference between them.
        """
        size = np.sqrt(sum(np.sum(by_value**2, axis=0) for by_value, _ in fit.jacobian.values()))
        jacobian = {c.name: self._central(c, fit, size) for c in self.cases}
        return replace(fit, jacobian=jacobian, covariance=covariance_of(information_of(jacobian, len(fit.values))))

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
            by_value, by_start = self._sensitivity(c, hypothesis, x, numbers[c.name], fixed, quick, kept is None)
            roots = self._roots(c, here)[:, None]
            # where a body flies off its derivatives are no numbers, and tell nothing
            by_value, by_start = (np.nan_to_num(d * roots, posinf=0.0, neginf=0.0) for d in (by_value, by_start))
            if kept is not None:
                by_start = kept.by_start
                by_value[:, believed] = 0.0 if fixed else kept.by_believed
            jacobian[c.name] = by_value, by_start
            if not fixed or not believed:
                self._kept[c.name] = Slow(by_start, by_value[:, believed])
            chi2 += self._loss(c, here)
            count += len(seen)
        covariance = covariance_of(information_of(jacobian, p)) if p and not fixed else np.zeros((p, p))
        return Fit(
            hypothesis, np.array(x), numbers, self.segments, innovations, chi2, count, covariance, jacobian,
            steps=steps, whitened=white,
        )  # fmt: skip
