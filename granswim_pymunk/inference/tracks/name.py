"""Naming: every candidate refitted by simulation, compared on data inside the training part, alone and in pairs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count

import numpy as np
from scipy.linalg import block_diag

from ...laws import has_role
from ..candidates import rescaled, with_numbers
from ..criteria import current
from ..data import Case
from ..hypothesis import Failed, Predictor, Term
from ..mechanisms import APPARATUS
from ..simpler import by_chance, ended_at_bound, special_cases
from ..trial import Tried
from .fit import Fitter, side_by_side
from .fitted import Fit
from .innovations import inflation
from .segments import find_cuts
from .signatures import Bank, Signature, make_bank, that_moves_alike

TOO_LATE = "not refitted: the time was up"


@dataclass(frozen=True)
class Trial(Tried):
    """A candidate after refitting.

    gain : fall in chi2 on the training part;  inner : how badly the part of the training data is predicted that
    its fit did not see (``InnerSplit.score``);  reason : why there is no fit, if so
    """

    signature: Signature
    fit: Fit | None
    gain: float
    inner: float
    reason: str = ""

    @classmethod
    def untried(cls, signature: Signature, reason: str = "") -> Trial:
        """A candidate that was not refitted by itself."""
        return cls(signature, None, 0.0, float("inf"), reason)

    @property
    def term(self) -> Term:
        return self.signature.term

    @property
    def values(self) -> np.ndarray:
        """Its numbers in its fit, where others may stand before and behind them; none without a fit."""
        return np.zeros(0) if self.fit is None else self.fit.values[self.fit.hypothesis.rows(self.label)]

    @property
    def used(self) -> int:
        """How many numbers were used: a strength that ended at its bound, where its law is absent, was not."""
        if self.fit is None:
            return self.numbers
        idle = sum(
            f.neutral in (f.low, f.high) and abs(v - f.neutral) < current().rounding.bound * f.scale and not f.inner
            for v, f in zip(self.values, self.term.free, strict=True)
        )
        return max(self.numbers - idle, 1)

    def holds(self, other: Trial, within: float) -> bool:
        """Whether what the other law explains, but for ``within`` in chi2, could be this one's doing: as where the
        other is a special case."""
        mine, its = self.signature.directions, other.signature.directions
        if not its.shape[1]:
            return True
        rest = its - mine @ (mine.T @ its)
        return float(np.sum(rest**2)) / its.shape[1] * other.signature.gain < within


@dataclass(frozen=True)
class InnerSplit:
    """Fits on the first part of each training recording and scores on the rest of it."""

    fitter: Fitter
    cases: tuple[Case, ...]
    rest: Mapping[str, np.ndarray]

    @classmethod
    def make(
        cls, cases: Sequence[Case], predictor: Predictor, stop: Callable[[], bool], closeness: float = 1.0
    ) -> InnerSplit:
        first, rest = {}, {}
        for case in cases:
            if not case.training.any():
                continue
            at = np.flatnonzero(case.training)
            cut = max(_cut_among_impacts(case, at) or int(len(at) * current().split.inner), min(6, len(at)))
            first[case.name] = np.zeros(len(case.t), dtype=bool)
            rest[case.name] = np.zeros(len(case.t), dtype=bool)
            first[case.name][at[:cut]] = True
            rest[case.name][at[cut:]] = True
        used = [c for c in cases if c.name in first]
        return cls(Fitter(used, predictor, first, stop).tightened(closeness), tuple(used), rest)

    @property
    def slack(self) -> float:
        """By how much a score may be above another and still be no evidence against: 2 in -2 ln p of all that follows.

        Source: Kass & Raftery 1995, J. Am. Stat. Assoc. 90, 773: below 2, not worth more than a bare mention.
        """
        count = sum(int(np.isfinite(c.values[self.rest[c.name]]).sum()) for c in self.cases)
        return 2.0 / max(count, 1)

    def score(self, whole: Fit) -> tuple[float, dict[str, float]]:
        """How badly a law predicts the rest, -2 ln p(rest | first part) per number, and the chi2 there by recording.

        ln p is the difference of two Laplace approximations, of all and of the first part:
        -2 ln p = chi2 - chi2_1 + ln det J'J - ln det J_1'J_1, J the derivatives by values and starts. About 1 for a
        right law, however little the first part says of its numbers; what they leave open is paid for by the
        determinants. ``whole``: the fit to both parts; the search on the first begins there.
        Source: MacKay 1992, Neural Computation 4, 415; Dawid 1984, J. R. Stat. Soc. A 147, 278.
        """
        enough = current().evaluations.inner
        in_one = self.fitter.segmented and all(len(s) == 1 for s in whole.segments.values())
        first = (self.fitter.in_one() if in_one else self.fitter).refitted(whole, evaluations=enough)
        by_case, total, count = {}, 0.0, 0
        for case in self.cases:
            both = whole.white[case.name]
            before = both[self.fitter.frames[case.name]]  # the same frames, in one segment or in several
            n = int(np.isfinite(both[self.rest[case.name]]).sum())
            left = float(np.nansum(both**2)) + whole.step_loss(case.name)
            # of the first part: no worse than the fit to all is there
            ties = len(first.steps[case.name]) - len(whole.hypothesis.priors(case, whole.values))
            least = float(np.nansum(before**2)) + whole.step_loss(case.name, ties)
            alone = float(np.nansum(first.white[case.name] ** 2)) + first.step_loss(case.name)
            left -= min(alone, least)
            if n:
                by_case[case.name] = left / n
            total, count = total + left, count + n
        if not count:
            return float("inf"), by_case
        value = (total + _open(whole, first)) / count
        return (value if np.isfinite(value) else float("inf")), by_case

    def scores(self, fits: Sequence[Fit]) -> list[tuple[float, dict[str, float]]]:
        """``score`` of each, side by side."""

        def of(own: Fitter, whole: Fit) -> tuple[float, dict[str, float]]:
            return replace(self, fitter=own).score(whole)

        return side_by_side(self.fitter, [partial(of, whole=whole) for whole in fits])


def _cut_among_impacts(case: Case, rows: np.ndarray) -> int | None:
    """How many of the frames ``rows`` come before as large a share of the impacts as of the frames has passed.

    What acts in impacts alone is not tested by a rest without any. None where the usual cut leaves enough of them, or
    where there are fewer than two; before a single one that counts in full, where a start is told there.
    """
    impacts = [i for i in find_cuts(case) if rows[0] < i.row < rows[-1]]
    met = np.unique([i.row for i in impacts])
    if len(met) == 1 and not any(i.curved for i in impacts):
        before = int(np.searchsorted(rows, met[0]))
        return before if current().segments.around <= before < len(rows) * current().split.inner else None
    early = min(int(np.ceil(current().split.inner * len(met))), len(met) - 1)
    if early < 1 or (met > rows[int(len(rows) * current().split.inner)]).sum() >= len(met) - early:
        return None
    return int(np.searchsorted(rows, (met[early - 1] + met[early] + 1) // 2))


def _open(whole: Fit, first: Fit) -> float:
    """ln det J'J of all data less that of the first part; what all do not tell either counts in neither.

    A start that lies after the first part is known there as well as it is tied to what comes before.
    """
    told = []
    for fit in (whole, first):
        values, starts = zip(*(_padded(fit, whole, name) for name in first.starts), strict=True)
        told.append(np.hstack([np.concatenate(values), block_diag(*starts)]))
    size = np.linalg.norm(told[0], axis=0)
    scale = np.where(size > 0, 1.0 / np.where(size > 0, size, 1.0), 0.0)
    # what the first part leaves open is bounded by a thousand times what all would tell
    least = 1e-6 * np.eye(len(size))
    more, less = (np.linalg.slogdet(scale * (j.T @ j) * scale[:, None] + least)[1] for j in told)
    return float(more - less)


def _padded(fit: Fit, whole: Fit, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of a recording, with rows for the starts that ``whole`` has and this fit does not."""
    by_value, by_start = fit.jacobian[name]
    ties = np.concatenate([s.tie for s in whole.segments[name]])
    missing = len(whole.starts[name]) - by_start.shape[1]
    if missing <= 0:
        return by_value, by_start
    rows = np.zeros((missing, by_value.shape[1]))
    return np.vstack([by_value, rows]), block_diag(by_start, np.diag(1.0 / ties[len(ties) - missing :]))


def refit(fitter: Fitter, base: Fit, signature: Signature, stages: Sequence[float]) -> Fit:
    """Fit base and candidate together, from the first-order amount or from other sizes, whichever begins best."""
    hypothesis = base.hypothesis.with_term(signature.term)
    first_will_do, evaluations, beginnings = _beginnings(base, signature.term)
    if fitter.segmented and not is_limit(signature.term):
        # over a segment the prediction is nearly linear: its first-order amount is where to begin
        evaluations, beginnings = current().refits.segment_evaluations, beginnings[:1]
    few = current().refits
    best: Fit | None = None
    for share, begin in beginnings:
        values, starts = fitter.beside(base, hypothesis, begin)
        found = fitter.fit(
            hypothesis, values, starts, stages=stages if share != 1 else (1.0,), evaluations=evaluations,
            near=base,
        )  # fmt: skip
        if best is None or found.chi2 < best.chi2:
            best = found
        if fitter.of_many_numbers and base.chi2 - found.chi2 > few.foreseen * signature.gain:
            break  # as first order foresaw: gradually, from parts, nothing else is found, and many starts each time
        if first_will_do and (found.chi2 < few.first_share * base.chi2 or base.chi2 < few.noise * base.count):
            break
    assert best is not None
    if best.chi2 > base.chi2 and not is_limit(signature.term):
        # a scene with a law cannot do worse than without: what first order says led beyond an impact, or along a
        # valley of nearly equal numbers to where nothing is followed any more. From there, then
        none = np.array([f.first if f.inner else f.neutral for f in signature.term.free])
        found = fitter.fit(hypothesis, np.concatenate([base.values, none]), base.starts, evaluations=few.evaluations)
        best = min(best, found, key=lambda fit: fit.chi2)
    return best


def is_limit(term: Term) -> bool:
    """Whether a term is a single limit, which changes nothing until it is reached."""
    only = term.free[0]
    return len(term.free) == 1 and only.neutral in (only.low, only.high) and bool(np.isfinite(only.high - only.low))


def _beginnings(base: Fit, term: Term) -> tuple[bool, int, list[tuple[float, np.ndarray]]]:
    """Where the search for the numbers of a term begins: (share of the first-order amount, numbers) in turn.

    Also whether a good first one is enough, and how many evaluations each has.
    """
    first = np.array([f.first for f in term.free])
    neutral = np.array([f.neutral for f in term.free])
    refits, most = current().refits, current().evaluations
    if is_limit(term):
        # it is looked for over its range
        only = term.free[0]
        top = only.low + only.span if only.span else only.high
        near, far = (only.low, top) if only.neutral == only.low else (top, only.low)
        return False, most.limit, [(1.0, np.array([near + part * (far - near)])) for part in refits.limits]
    # beyond the linear range the first-order amount may be far off: begin from a part of it too
    usual = [(share, neutral + share * (first - neutral)) for share in refits.shares]
    beside = any(has_role(f.name.partition(".")[0], "drag") for f in base.hypothesis.free)
    if has_role(term.mechanism, "medium") and beside and len(first) > 1 and first[0] > 0:
        # where another drag is adjustable, only c u shows: the same push by a slower and by a faster stream
        part = np.array([refits.slower, *[1 / refits.slower] * (len(first) - 1)])
        return False, most.stream, [*usual, (1.0, first * part), (1.0, first / part)]
    shaped = np.array([f.inner for f in term.free])
    if shaped.any() and base.chi2 > current().signatures.far ** 2 * base.count:
        # strength and shape lie along a bent valley, and what first order says of the strength is far off
        far_off = [(1.0, np.where(shaped, first, factor * first)) for factor in refits.valleys]
        return False, most.limit, [*usual, *far_off]
    return True, refits.few_evaluations if len(first) > refits.many else refits.evaluations, usual


@dataclass(frozen=True)
class Heats:
    """Candidates fitted to the first part of long recordings that the scene without them is far from.

    fits : of those that come near the best there, by their place among the signatures
    over : those that do not, and are not tried further
    """

    fits: Mapping[int, Fit]
    over: frozenset[int]


def heats(fitter: Fitter, base: Fit, signatures: Sequence[Signature], late: Callable[[], bool]) -> Heats | None:
    """Fits to the first part of the recordings, None where they are short, or the scene without a candidate is near.

    Where one law takes most of a misfit far beyond the noise away, those that leave most of it need no further look,
    and the others begin on the whole from where they ended.
    """
    frames = {c.name: np.flatnonzero(fitter.frames[c.name]) for c in fitter.cases}
    refits, far = current().refits, current().signatures.far ** 2
    if fitter.segmented or max(map(len, frames.values())) < refits.heat_frames or base.chi2 < far * base.count:
        return None
    parts = {c.name: np.zeros(len(c.t), dtype=bool) for c in fitter.cases}
    for name, rows in frames.items():
        parts[name][rows[: max(int(current().refits.heat * len(rows)), 1)]] = True
    first = Fitter(fitter.cases, fitter.predictor, parts, fitter.stop, rough=True)
    short = first.refitted(base, stages=refits.heat_stages)
    if short.chi2 < far * short.count:
        return None
    least = current().signatures.surviving
    open_ = [k for k, s in enumerate(signatures) if s.surviving > least and not is_limit(s.term)]

    def fitted(k: int, own: Fitter) -> Fit | None:
        return None if late() else refit(own, short, signatures[k], refits.heat_stages)

    open_ = [open_[k] for k in in_turn([signatures[k].term for k in open_])]
    found = side_by_side(first, [partial(fitted, k) for k in open_])
    fits = {k: fit for k, fit in zip(open_, found, strict=True) if fit is not None}
    best = min((f.chi2 for f in fits.values()), default=short.chi2)
    if short.chi2 - best < current().refits.heat_won * short.chi2:
        return Heats(fits, frozenset())
    lost = {k for k, f in fits.items() if short.chi2 - f.chi2 < current().refits.heat_won * (short.chi2 - best)}
    return Heats({k: f for k, f in fits.items() if k not in lost}, frozenset(lost))


def try_candidates(
    fitter: Fitter,
    base: Fit,
    bank: Bank,
    stages: Sequence[float],
    progress: Callable[[str, int, int], None],
    late: Callable[[], bool] = lambda: False,
    ahead: float = 0.0,
    shortly: bool = False,
) -> list[Trial]:
    """Refit the candidates that are not imitated by starts and recalibration, best first.

    ahead : the gain of the best of others that were tried before: those far behind it are not searched to their end;
    shortly : nor is any
    """
    ranked = sorted(zip(bank.signatures, bank.asked, strict=True), key=lambda entry: -entry[0].gain)
    order = [signature for signature, _ in ranked]
    run = heats(fitter, base, order, late)
    forms: dict[tuple[str, int], int] = {}
    reasons: list[str] = []
    begun = count()
    for signature in order:
        form = (signature.term.mechanism, len(signature.term.free))
        forms[form] = forms.get(form, 0) + 1
        reasons.append(_hopeless(fitter, signature, order[0].gain, forms[form], run, len(reasons)))

    def tried(k: int, own: Fitter) -> Trial:
        signature, reason = order[k], reasons[k]
        progress(signature.term.label, next(begun), len(order))
        if not reason and k != turn[0] and (run is None or k not in run.fits) and late():
            reason = TOO_LATE
        if reason:
            return Trial.untried(signature, reason)
        if run is not None and k in run.fits:
            begin = run.fits[k]
            evaluations = _beginnings(base, signature.term)[1]
            found = own.refitted(begin, evaluations=evaluations)
        else:
            found = refit(own, base, signature, stages)
        return Trial(signature, found, base.chi2 - found.chi2, float("inf"))

    turn = in_turn([signature.term for signature in order])
    done = dict(zip(turn, side_by_side(fitter, [partial(tried, k) for k in turn]), strict=True))
    trials = [done[k] for k in range(len(order))]
    if not late():
        alone = tuple(trials)
        trials = [_from_special_case(fitter, base, t, alone) for t in trials]
        trials = _from_the_tracks(fitter, base, trials, stages)
        trials = _from_pieces(fitter, base, trials, [term for _, term in ranked])
        trials = _with_numbers_that_show(fitter, base, trials, [term for _, term in ranked])
        least = current().refits.valley * (math.inf if shortly else max([ahead, *(t.gain for t in trials)]))
        # of a law that is looked for from several exponents or ranges one valley is walked through segments
        leading = {t.term.label: t for t in sorted(trials, key=lambda t: t.gain)} if fitter.segmented else {}
        apart = [t is not leading.get(t.term.label, t) for t in trials]
        jobs = [
            partial(_to_its_end, base=base, trial=t, least=math.inf if behind else least)
            for t, behind in zip(trials, apart, strict=True)
        ]
        trials = side_by_side(fitter, jobs)
        least = current().refits.inner_scored * max([ahead, *(t.gain for t in trials)])
        trials = [t if t.gain < least else _off_its_bounds(fitter, base, t) for t in trials]
    return sorted(trials, key=lambda t: -t.gain)


def in_turn(terms: Sequence[Term]) -> list[int]:
    """In which order candidates are refitted, of which those that gain most to first order stand first.

    Where the time is short the last are not. Each law comes before the fault of the apparatus that is as far ahead of
    its kind: to first order a drift of the camera gains as much as any law where the scene is lost. Special faults,
    which hardly any laboratory has, come last.
    """
    kinds = [(term.special, term.mechanism in APPARATUS) for term in terms]
    ranks = {kind: count() for kind in kinds}
    places = [(special, next(ranks[special, fault]), fault) for special, fault in kinds]
    return sorted(range(len(terms)), key=lambda k: places[k])


def _from_the_tracks(fitter: Fitter, base: Fit, trials: Sequence[Trial], stages: Sequence[float]) -> list[Trial]:
    """The leading laws again with starts from the first frames, where those of the fit without them are far off.

    A scene that cannot follow has had its many starts bent to do what the law does (a swimmer is thrown so that it
    first drifts as it later swims), and no step leads back from there.
    """
    if not fitter.of_many_numbers or fitter.segmented or not far_off(base):
        return list(trials)
    order = [k for k in np.argsort([-t.gain for t in trials]) if trials[k].fit is not None][: current().refits.leaders]

    def again(k: int, own: Fitter) -> Fit:
        fit = trials[k].fit
        assert fit is not None
        return own.fit(fit.hypothesis, fit.values, None, stages=stages)

    return _if_better(fitter, base, trials, order, again)


def _from_pieces(fitter: Fitter, base: Fit, trials: Sequence[Trial], terms: Sequence[Term]) -> list[Trial]:
    """The leading laws again with numbers from pieces of the recordings, where no law brings a scene near that is lost.

    Bodies that turn at a distance go on through one another in a scene without what repels them, or collide: all starts
    and first-order amounts are then those of another motion, and no step leads from there. Over a piece with a start of
    its own the scene cannot go far astray, and what a law does there is nearly linear in its numbers. Multiple
    shooting, as a beginning only: see ``segments``.
    terms : of the trials, with numbers too that change nothing about the path of the scene that is lost
    """
    fits = {k: t.fit for k, t in enumerate(trials) if t.fit is not None}
    if fitter.segmented or not fits or not all(map(far_off, [base, *fits.values()])):
        return list(trials)
    try:
        pieces = fitter.in_pieces(current().refits.pieces)
        plain = pieces.fit(base.hypothesis, base.values)
        bank = make_bank(pieces, plain, [terms[k] for k in fits])
    except Failed:
        return list(trials)
    least = current().signatures.surviving
    seen = {k: s for k, s in zip(fits, bank.signatures, strict=True) if s.surviving > least}
    order = sorted(seen, key=lambda k: -seen[k].gain)[: current().refits.leaders]

    def again(k: int, own: Fitter) -> Fit:
        try:
            return own.fit_from(refit(own.in_pieces(current().refits.pieces), plain, seen[k], (1.0,)))
        except Failed:
            return fits[k]

    return _if_better(fitter, base, trials, order, again)


def _with_numbers_that_show(
    fitter: Fitter, base: Fit, trials: Sequence[Trial], terms: Sequence[Term]
) -> list[Trial]:
    """The leading laws with the numbers, too, that changed nothing about the path of the scene without them.

    What goes straight on without a spring goes to and fro with it: a drag beside it is a constant force at first, and
    shows then. Such numbers are asked about the path that a law made, and fitted where they gain more than chance.
    terms : of the trials, with all of their numbers
    """
    if fitter.segmented:
        return list(trials)
    fewer = [k for k, t in enumerate(trials) if t.fit is not None and t.fit.excess and _missing(t.term, terms[k])]
    order = sorted(fewer, key=lambda k: -trials[k].gain)[: current().refits.leaders]

    def again(k: int, own: Fitter) -> Fit:
        fit, full, more = trials[k].fit, terms[k], _missing(trials[k].term, terms[k])
        assert fit is not None
        part = replace(with_numbers(full, more), label=f"{full.label}, more")
        (signature,) = make_bank(own, fit, [part]).signatures
        if by_chance(signature.gain / spread_of(fit, fitter.cases), len(signature.term.free)):
            return fit
        values = fit.values[fit.hypothesis.rows(trials[k].label)]
        known = {f.name: (f.scale, float(v)) for f, v in zip(trials[k].term.free, values, strict=True)}
        known |= {f.name: (f.scale, f.first) for f in signature.term.free}
        term = with_numbers(full, [i for i, f in enumerate(full.free) if f.name in known])
        scales, firsts = zip(*(known[f.name] for f in term.free), strict=True)
        begin = np.concatenate([fit.values[: len(base.values)], firsts])
        found = own.fit(base.hypothesis.with_term(rescaled(term, scales, firsts)), begin, fit.starts)
        gained = len(term.free) - len(trials[k].term.free)
        return fit if by_chance((fit.chi2 - found.chi2) / spread_of(found, fitter.cases), gained) else found

    return _if_better(fitter, base, trials, order, again)


def _missing(term: Term, full: Term) -> list[int]:
    """Which strengths of a law are not among the numbers of a term that is told in the same components."""
    names = {f.name for f in term.free}
    return [] if term.along else [i for i, f in enumerate(full.free) if f.name not in names and not f.inner]


def far_off(fit: Fit) -> bool:
    """Whether a fit leaves so much that first order means little."""
    return fit.chi2 >= current().signatures.far ** 2 * fit.count


def _if_better(
    fitter: Fitter, base: Fit, trials: Sequence[Trial], order: Sequence[int], again: Callable[[int, Fitter], Fit]
) -> list[Trial]:
    """The trials, those of ``order`` with a fit made ``again`` where it is no worse than the one that they have."""
    trials = list(trials)
    for k, found in zip(order, side_by_side(fitter, [partial(again, int(k)) for k in order]), strict=True):
        fit = trials[k].fit
        if fit is None or found.chi2 <= fit.chi2:
            # another beginning may have shown other numbers of the law to change anything
            term = next(t for t in found.hypothesis.terms if t.label == trials[k].label)
            signature = replace(trials[k].signature, term=term)
            trials[k] = replace(trials[k], signature=signature, fit=found, gain=base.chi2 - found.chi2)
    return trials


def _hopeless(fitter: Fitter, signature: Signature, most: float, variant: int, run: Heats | None, k: int) -> str:
    """Why a candidate needs no refit, empty where it does. ``variant``: which one of its form it is;  k : its place."""
    if fitter.segmented and (signature.gain < current().refits.near * most or variant > current().refits.variants):
        return "others explain far more to first order"
    unseen_limit = is_limit(signature.term) and not signature.directions.shape[1]
    if signature.surviving <= current().signatures.surviving and not unseen_limit:
        return "recalibration or the starts imitate it"
    if run is not None and k in run.over:
        return "others explain far more of the first part"
    return ""


def unstuck(fitter: Fitter, base: Fit, trials: Sequence[Trial]) -> tuple[Fit, list[Trial]]:
    """The fit without a law, again from where those with one ended, and the trials with the gains over it.

    A fit may be caught in a minimum that every further number helps it out of: that is no gain of the law.
    """
    n = len(base.values)
    best = base
    leaders = sorted(trials, key=lambda t: -t.gain)[:3]
    ends = [t.fit for t in leaders if t.fit is not None and t.gain > current().verdict.noticed]

    def again(own: Fitter, end: Fit) -> Fit:
        return own.fit(base.hypothesis, end.values[:n], end.starts)

    for found in side_by_side(fitter, [partial(again, end=end) for end in ends]):
        best = found if found.chi2 < best.chi2 - current().refits.unstuck else best
    if best is base:
        return base, list(trials)
    moved = [t if t.fit is None else replace(t, gain=best.chi2 - t.fit.chi2) for t in trials]
    return best, sorted(moved, key=lambda t: -t.gain)


def _from_special_case(fitter: Fitter, base: Fit, trial: Trial, trials: Sequence[Trial]) -> Trial:
    """A law that holds another as a special case cannot fit worse: where it does, the search begins from that one.

    Drag in still air is a flow of no speed. So where a law is another form of the same mechanism: friction that holds
    stops a cart after one swing or after two, and no step leads from one to the other.
    """
    names = special_cases(trial.term.law)
    if trial.fit is None:
        return trial
    special = [t for t in trials if t.mechanism in names and t.numbers == 1 and t.fit is not None]
    special += [
        t for t in trials
        if (t.mechanism, t.numbers) == (trial.mechanism, trial.numbers) and t.term.law != trial.term.law
        and t.fit is not None
    ]  # fmt: skip
    best = max(special, key=lambda t: t.gain, default=None)
    if best is None or best.fit is None or best.gain <= trial.gain:
        return trial
    n = len(base.values)
    own = [*best.fit.values[n : n + best.numbers], *[0.0] * (trial.numbers - best.numbers)]
    # a core where the other form has a power: it begins anew, and the strength is that which moves the bodies alike
    anew = [k for k, (f, g) in enumerate(zip(trial.term.free, best.term.free, strict=False)) if f.inner
            and f.unit != g.unit]  # fmt: skip
    for k in [0, *anew] if anew else []:
        own[k] = trial.term.free[k].first if k else trial.term.free[k].neutral
    if best.term.free[0].unit != trial.term.free[0].unit or anew:
        # a drag with the square of the speed as strong as the linear one is there
        at_it = rescaled(trial.term, [f.scale for f in trial.term.free], own)
        amount = that_moves_alike(fitter, best.fit, slice(n, n + 1), best.fit.values[n : n + 1], at_it)
        if amount is None:
            return trial
        own[: len(amount)] = amount
    hypothesis = base.hypothesis.with_term(trial.term)
    begin, enough = [*best.fit.values[:n], *own], current().evaluations.special
    found = fitter.fit(hypothesis, begin, best.fit.starts, evaluations=enough)
    if found.chi2 >= trial.fit.chi2:
        return trial
    return Trial(trial.signature, found, base.chi2 - found.chi2, float("inf"))


def _to_its_end(fitter: Fitter, base: Fit, trial: Trial, least: float) -> Trial:
    """A search that was short goes on: to the end of a bent valley, or through segments.

    Strength and shape of a law lie along a bent valley.  Through segments a scene without the law has bent what leads
    through an impact, and the few steps of a first search only begin to straighten it.
    Laws that gain no more than ``least`` stay as they are.
    """
    fit = trial.fit
    if fit is None or trial.gain <= least or (fit.ended and not any(f.inner for f in trial.term.free)):
        return trial
    if not fit.excess:
        return trial
    found = fitter.refitted(fit, evaluations=current().evaluations.valley)
    return replace(trial, fit=found, gain=base.chi2 - found.chi2) if found.chi2 < fit.chi2 else trial


def _off_its_bounds(fitter: Fitter, base: Fit, trial: Trial) -> Trial:
    if trial.fit is None:
        return trial
    fit = off_bounds(fitter, trial.fit, trial.fit.hypothesis.rows(trial.label))
    return trial if fit is trial.fit else replace(trial, fit=fit, gain=base.chi2 - fit.chi2)


def off_bounds(fitter: Fitter, fit: Fit, rows: slice) -> Fit:
    """The fit with factors of a strength halfway from where their search began to their bounds, if they ended there
    and may as well lie halfway.

    Where only a product is known, as the push c u of a stream beside an adjustable drag, chi2 has a level valley along
    which a search runs until a bound stops it: such an end says nothing against the law. Where chi2 with the number
    held halfway rises by more than chance (``by_chance``), the number is pulled to its bound. A strength at its bound
    is as large as it may be (a picture of another size), and stays there.
    """
    for k in range(rows.start, rows.stop):
        free = fit.hypothesis.free[k]
        ended = ended_at_bound([(free, float(fit.values[k]))]) if free.inner else None
        if ended is None:
            continue
        fit = _along_its_valley(fitter, fit, k, (ended[1] + free.neutral) / 2) or fit
    return fit


def _along_its_valley(fitter: Fitter, fit: Fit, k: int, end: float) -> Fit | None:
    """The fit with its number ``k`` held at ``end``, None where chi2 rises by more than chance on the way there.

    A valley bends: a step after which the other numbers do not find back to it is halved.
    """
    criteria, here, step = current().intervals, fit, end - float(fit.values[k])
    least = criteria.fine * abs(step)
    for _ in range(criteria.most):
        values = here.values.copy()
        values[k] += step
        few = criteria.evaluations
        found = fitter.fit(fit.hypothesis, values, here.starts, evaluations=few, held=(k,), near=here)
        rest = end - float(found.values[k])
        if not by_chance(found.chi2 - fit.chi2, 1):
            step /= 2
            if abs(step) < least:
                break
        elif abs(rest) < least:
            return found
        else:
            here, step = found, math.copysign(min(abs(rest), criteria.growth * abs(step)), rest)
    return None


def label_of(*trials: Trial) -> str:
    """Of laws that are tried together, as their score is kept."""
    return " + ".join(t.term.label for t in trials)


def is_part(term: Term, others: Iterable[Term]) -> bool:
    """Whether one of the others is the same law on these bodies and more, or the same fault of more recordings."""
    mine = set(term.bodies or ())

    def more(other: Term) -> bool:
        whole = term.recordings is not None and other.recordings is None and term.bodies == other.bodies
        return other.mechanism == term.mechanism and (whole or mine < set(other.bodies or ()))

    return any(map(more, others))


def spread_of(fit: Fit, cases: Sequence[Case]) -> float:
    """Inflation of variances by what a fit leaves over."""
    used = [c for c in cases if c.name in fit.innovations]
    return inflation(fit, used, fit.numbers)
