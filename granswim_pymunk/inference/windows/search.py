"""The search for the law that is missing: signatures, leaders refitted by simulation, a second law, forms."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...laws import has_role
from ..criteria import current
from ..hypothesis import Failed, Hypothesis, Term
from ..linear import basis
from ..simpler import special_cases
from ..swimmer_terms import tried_below
from .candidates import flexible_terms, siblings
from .chance import chance
from .likelihood import Prediction, WindowLikelihood, Windows, both_sides
from .plan import Clock, Plan
from .signatures import BedSignature, limits, make_signature, off, to_values
from .trial import BedTrial, first_order, smooth_minimum, trial_of
from .windows import BedCase

Progress = Callable[[str, float], None]


def _shifts_the_drive(t: BedTrial) -> bool:
    """Whether a law or the clock shifts the drive in time."""
    return t.mechanism == "time_offset" or has_role(t.mechanism, "late")


def signature_of(
    likelihood: WindowLikelihood, hypothesis: Hypothesis, values: np.ndarray, base: Prediction, nuisance: np.ndarray,
    term: Term,
    windows: Windows, members: int,
) -> BedSignature | None:  # fmt: skip
    """Columns of a term, each from an amount that changes the prediction by about a standard deviation.

    ``base``: see ``Search.apart``.
    """
    extended = hypothesis.with_term(term)
    low, high = limits(term)

    def shown(amounts: Sequence[float], k: int) -> list[Prediction | None]:
        """With these amounts of number k; the scene without the term where that is none."""
        numbers = [to_values(term, amount * np.eye(len(term.free))[k]) for amount in amounts if amount]
        wanted = [(extended, np.concatenate([values, n])) for n in numbers]
        found = likelihood.predict(wanted, windows, members, likelihood.members)
        return found if all(amounts) else [*found, base]

    criteria = current().windows.search
    weak, strong = criteria.response
    tried, other, columns = [], [], []
    for k in range(len(term.free)):
        sign = 1.0 if high[k] > 0 else -1.0
        if tried_below(term):
            sign = -1.0
        most = criteria.inside * (high[k] if sign > 0 else -low[k])
        amount = min(1.0, most)
        kept: tuple[float, float, np.ndarray] | None = None
        smallest_failed = math.inf
        for _ in range(criteria.tries_amount):
            there = sign * amount
            # to both sides where there is room: what is even in the amount falls out, and half of the chaos
            back = float(np.clip(-there, low[k], high[k]))
            back = back if abs(back) > criteria.back * amount else 0.0
            after, before = shown([there, back], k)
            if after is None or before is None:
                smallest_failed = amount
                amount *= criteria.failed
                continue
            change = likelihood.change(after, before, windows)
            kept = there, back, change / (there - back)
            size = float(np.sqrt(np.mean(change**2)))
            if size < weak:
                factor = criteria.grow[size < criteria.weaker * weak]
            elif size > strong:
                factor = criteria.shrink[size > criteria.stronger * strong]
            else:
                break
            wider = min(amount * factor, most, criteria.shy * smallest_failed)
            if abs(wider / amount - 1) < criteria.as_tried:
                break
            amount = wider
        if kept is None:
            return None
        tried.append(kept[0])
        other.append(kept[1])
        columns.append(kept[2])
    sizes = [bed.size for bed, w in zip(likelihood.beds, windows, strict=True) for _ in w]
    return make_signature(term, np.array(tried), np.column_stack(columns), nuisance, np.array(other), sizes)


def thinned(windows: Windows, share: float) -> list[np.ndarray]:
    """About that share of the windows of each recording, spread evenly, four at least."""
    result = []
    for w in windows:
        count = min(len(w), max(math.ceil(share * len(w)), 4))
        result.append(w[np.unique(np.round(np.linspace(0, len(w) - 1, count)).astype(int))] if len(w) else w)
    return result


def positions(likelihood: WindowLikelihood, windows: Windows, chosen: Windows) -> np.ndarray:
    """Rows that ``chosen`` windows have in stacked numbers of all ``windows``."""
    rows, start = [], 0
    for bed, every, some in zip(likelihood.beds, windows, chosen, strict=True):
        index = start + np.arange(len(every) * bed.size).reshape(len(every), bed.size)
        rows.append(index[np.isin(every, some)].ravel())
        start += len(every) * bed.size
    return np.concatenate(rows)


@dataclass(frozen=True)
class NoiseChi2:
    """Mean and standard deviation of the chi2 that windows without a mismatch leave."""

    mean: float
    spread: float

    def above(self, rest: np.ndarray) -> float:
        """Standard deviations by which the chi2 of whitened innovations is above that."""
        return (float(rest @ rest) - self.mean) / self.spread


@dataclass
class Search:
    """Leaders refitted by simulation around the recalibrated scene: many roughly, the best of them well.

    base : prediction of ``hypothesis`` with ``values``;  nuisance : (n, p) whitened columns of these
    used : windows, of which ``few`` tell candidates apart, and ``at`` are their rows;  noise : of the used ones
    """

    likelihood: WindowLikelihood
    hypothesis: Hypothesis
    values: np.ndarray
    base: Prediction
    nuisance: np.ndarray
    used: Windows
    few: Windows
    at: np.ndarray
    noise: NoiseChi2
    plan: Plan
    clock: Clock
    progress: Progress

    @property
    def white(self) -> np.ndarray:
        """(n,) whitened innovations of the windows that are used."""
        return self.likelihood.white(self.base, self.used)

    @property
    def whole(self) -> bool:
        """Whether the windows that tell candidates apart are all that are used."""
        return all(len(a) == len(b) for a, b in zip(self.few, self.used, strict=True))

    @property
    def few_nuisance(self) -> np.ndarray:
        """(m, p) columns of the adjustables in the windows that tell candidates apart."""
        return self.nuisance[self.at]

    @property
    def few_left(self) -> np.ndarray:
        """(m,) whitened innovations there, the adjustables projected out."""
        return off(self.few_nuisance, self.white[self.at])

    def apart(self) -> Prediction:
        """The prediction that signatures are changes of, by members of their own. Raises Failed.

        With the members of the innovations, the chaos of these would be in both and look like every candidate.
        """
        wanted = [(self.hypothesis, self.values)]
        return self.likelihood.predict_surely(wanted, self.few, self.plan.screening, self.likelihood.members)[0]

    def signature(self, term: Term, apart: Prediction) -> BedSignature | None:
        """See ``signature_of``; ``apart`` as the method of that name gives it."""
        return signature_of(
            self.likelihood, self.hypothesis, self.values, apart, self.few_nuisance, term, self.few, self.plan.screening
        )

    def with_siblings(self, trials: list[BedTrial], bed: BedCase) -> list[BedTrial]:
        """Trials and, of the two that lead, other exponents and fewer bodies, to first order; best first."""
        more: list[BedTrial] = []
        known = {t.term.label for t in trials}
        apart, left = self.apart(), self.few_left
        for t in trials[:2]:
            for term in siblings(t.term, bed.scene):
                if self.clock.late(current().windows.budget.siblings):
                    break
                if term.label in known:
                    continue
                signature = self.signature(term, apart)
                if signature is not None:
                    known.add(term.label)
                    more.append(first_order(signature, left, t.spread))
        return sorted([*trials, *more], key=lambda t: -t.ahead)

    def leaders(self, trials: list[BedTrial], bed: BedCase) -> list[BedTrial]:
        """Trials with the gains of those that were refitted, in all training windows."""
        criteria, budget = current().windows.search, current().windows.budget
        self.progress("siblings of the leaders", 0.64)
        trials = self.with_siblings(trials, bed)
        span = basis(np.column_stack([t.signature.clear for t in trials]))
        most, least = max(t.linear for t in trials), current().verdict.noticed
        chosen = [t for k, t in enumerate(trials) if k == 0 or t.linear > max(least, criteria.led * most)]
        chosen = _with_clock(_two_forms(chosen)[: 2 * self.plan.leaders], trials)
        rough = []
        for k, t in enumerate(chosen):
            self.progress(f"refitting {t.term.label}", 0.66 + 0.04 * k / len(chosen))
            if k >= 2 and self.clock.late(budget.rough):
                break
            rough.append(self.refit(t, self.few, self.few_nuisance, self.plan.screening, criteria.rough, span))
        rough.sort(key=lambda t: -t.worth)
        best = [t for k, t in enumerate(rough) if k == 0 or t.worth > criteria.kept * rough[0].worth]
        best = best[: max(self.plan.leaders - 2, 2)]
        best = _with_clock(best, rough)
        done = []
        for k, t in enumerate(best):
            self.progress(f"refitting {t.term.label}, all windows", 0.70 + 0.08 * k / len(best))
            if k < 1 or not self.clock.late(budget.fine):
                mine = span if self.whole else None
                done.append(self.refit(t, self.used, self.nuisance, self.likelihood.members, criteria.fine, mine))
        done = no_narrower(done)
        # the best form of each is kept; gains in few windows are not comparable
        known = {t.term.label for t in done}
        rest: list[BedTrial] = []
        for t in (*best, *rough, *trials):
            if t.term.label not in known:
                known.add(t.term.label)
                rest.append(replace(t, gain=None))
        return done + rest

    def chi2(
        self, predicted: Prediction, windows: Windows, nuisance: np.ndarray, members: int,
        span: np.ndarray | None = None,
    ) -> float:  # fmt: skip
        """Of what is left, or of its part in the span (m, r) of all that is suspected: chaos is mostly elsewhere."""
        rest = off(nuisance, self.likelihood.white(predicted, windows, members))
        if span is not None:
            rest = span.T @ rest
        return float(rest @ rest)

    def refit(
        self, trial: BedTrial, windows: Windows, nuisance: np.ndarray, members: int, shares: Sequence[float],
        span: np.ndarray | None = None,
    ) -> BedTrial:  # fmt: skip
        """Simulate along the direction of the amounts and take the best of a parabola through chi2; see ``chi2``."""
        extended = self.hypothesis.with_term(trial.term)
        low, high = limits(trial.term)
        start = trial.amounts if np.any(trial.amounts) else trial.signature.tried
        chi2 = {0.0: self.chi2(self.base, windows, nuisance, members, span)}

        def measure(more: Sequence[float]) -> None:
            more = [s for s in dict.fromkeys(more) if s not in chi2]
            amounts = [np.clip(start * s, low, high) for s in more]
            rows = self.likelihood.predict(
                [(extended, np.concatenate([self.values, to_values(trial.term, a)])) for a in amounts],
                windows,
                members,
            )
            for share, predicted in zip(more, rows, strict=True):
                if predicted is not None:
                    chi2[share] = self.chi2(predicted, windows, nuisance, members, span)

        measure(shares)
        for _ in range(2):
            best = min(chi2, key=lambda s: chi2[s])
            if best == 0.0:
                measure([current().windows.search.nearer * min(s for s in (*chi2, *shares) if s > 0)])
            elif best == max(chi2):
                measure([current().windows.search.farther * best])
            else:
                break
        if len(chi2) < 2:
            return replace(trial, gain=0.0)
        share, lowest = smooth_minimum(chi2)
        amounts = np.clip(start * (share or 1e-3), low, high)
        found = trial_of(trial.signature, amounts, trial.linear, chi2[0.0] - lowest, trial.jackknife, trial.spread)
        return replace(found, attenuation=trial.attenuation)

    def turned(self, trial: BedTrial) -> BedTrial | None:
        """A step of least squares in all numbers of the term from where it is, and a refit along what that gives."""
        extended = self.hypothesis.with_term(trial.term)
        low, high = limits(trial.term)
        ends, spans = both_sides(trial.amounts, np.abs(trial.signature.tried), low, high)
        wanted = [np.concatenate([self.values, to_values(trial.term, a)]) for a in (trial.amounts, *ends)]
        try:
            here, *beside = self.likelihood.predict_surely([(extended, numbers) for numbers in wanted], self.used)
        except Failed:
            return None
        columns = self.likelihood.columns(beside, spans, self.used)
        clear = off(self.nuisance, columns)
        change = np.linalg.lstsq(clear, off(self.nuisance, self.likelihood.white(here, self.used)), rcond=1e-8)[0]
        amounts = np.clip(trial.amounts + change, low, high)
        signature = replace(trial.signature, columns=columns, clear=clear)
        moved = replace(trial, amounts=amounts, signature=signature)
        return self.refit(moved, self.used, self.nuisance, self.likelihood.members, current().windows.search.turned)


@dataclass
class Answer:
    """The scene as it is understood: adjustables, then the laws that were found; ``judge`` has replicates of it.

    covariance : of all its values, or of the adjustables where nothing was found
    unexplained : standard deviations of the nulls' chi2 that it leaves;  rows : its prediction, where it was made
    columns : whitened, of all its values, where there are any;  alone : the same with the first law only
    """

    hypothesis: Hypothesis
    values: np.ndarray
    covariance: np.ndarray
    judge: WindowLikelihood
    unexplained: float
    found: BedTrial | None = None
    partner: BedTrial | None = None
    rows: Prediction | None = None
    columns: np.ndarray | None = None
    alone: Answer | None = None

    @property
    def laws(self) -> list[BedTrial]:
        return [t for t in (self.found, self.partner) if t is not None]


def _two_forms(trials: Sequence[BedTrial]) -> list[BedTrial]:
    """No more than the first two forms of a law, so that others are refitted, too; joints are laws of their own."""
    kept: list[BedTrial] = []
    for t in trials:
        joint = t.term.choices.get("joint")
        if sum(o.mechanism == t.mechanism and o.term.choices.get("joint") == joint for o in kept) < 2:
            kept.append(t)
    return kept


def no_narrower(trials: Sequence[BedTrial]) -> list[BedTrial]:
    """Without laws on some bodies that gain no more than the same law does on all."""

    def needed(t: BedTrial) -> bool:
        alike = [o for o in trials if o.mechanism == t.mechanism]
        wider = [o for o in alike if set(o.term.bodies or ()) > set(t.term.bodies or ())]
        return all(t.worth > o.worth + current().verdict.same for o in wider)

    return [t for t in trials if needed(t)]


def second_law(
    search: Search, found: BedTrial, signatures: Sequence[BedSignature], rng: np.random.Generator
) -> BedTrial | None:
    """What gains most beside the law that was found, beyond what the same search gives in nulls; or None.

    ``search``: about the scene with that law; its ``nuisance`` has the columns of adjustables and law.
    """
    criteria = current().windows.search
    left = search.few_left
    others = [
        make_signature(s.term, s.tried, s.columns, search.few_nuisance, s.other, s.windows)
        for s in signatures
        if s.term.label != found.term.label and s.term.mechanism != "unknown"
    ]
    by_chance = chance(search.likelihood, search.few, search.few_nuisance, others, rng)
    order = sorted((first_order(s, left, by_chance.spreads[s.term.label]) for s in others), key=lambda t: -t.ahead)
    try:
        apart = search.apart()
    except Failed:
        return None
    trials = []
    for rough in order[: criteria.seconds]:
        if rough.ahead < criteria.beside * by_chance.level or search.clock.late(current().windows.budget.seconds):
            break
        search.progress(f"beside it: {rough.term.label}", 0.80)
        signature = search.signature(rough.term, apart)
        if signature is not None:
            trials.append(first_order(signature, left, rough.spread))
    span = basis(np.column_stack([s.clear for s in others])) if others and search.whole else None
    trials = sorted((t for t in trials if by_chance.beyond(t)), key=lambda t: -t.worth)[:3]
    members = search.likelihood.members
    done = [search.refit(t, search.used, search.nuisance, members, criteria.fine, span) for t in trials]
    done = [t for t in done if (t.gain or 0.0) > max(by_chance.threshold(t), criteria.sure)]
    return max(done, key=lambda t: t.worth, default=None)


def best_form(search: Search, swimmer: bool = False) -> BedTrial | None:
    """The best of the forms that name nothing, refitted by simulation; None where none could be.

    swimmer : whether they act on its disks alone
    """
    likelihood, used, clock = search.likelihood, search.used, search.clock
    bed, predictor = likelihood.beds[0], likelihood.predictors[0]
    frames = bed.starts[used[0]]
    seen = bed.film.xy[frames][:, [*bed.rows, *([] if swimmer else bed.grains)]].reshape(-1, 2)
    bodies = bed.scene.swimmer_ids if swimmer else None
    speeds = np.concatenate([predictor.sums(int(w)).speed for w in used[0]])
    left = search.few_left
    apart = search.apart()
    forms: list[BedTrial] = []
    fast = speeds if len(speeds) else np.array([current().windows.candidates.fast])
    for term in flexible_terms(bed.case, seen[np.isfinite(seen[:, 0])], fast, bodies):
        if forms and clock.late(current().windows.budget.forms):
            break
        signature = search.signature(term, apart)
        if signature is not None:
            forms.append(first_order(signature, left))
    forms.sort(key=lambda t: -t.worth)
    done = []
    for t in forms[:2]:
        refitted = search.refit(t, used, search.nuisance, likelihood.members, current().windows.search.form)
        # few windows tell the direction of five numbers badly
        for _ in range(2):
            if clock.late(current().windows.budget.turned):
                break
            turned = search.turned(refitted)
            if turned is None or turned.worth < refitted.worth + current().verdict.same:
                break
            refitted = turned
        done.append(refitted)
    return max(done, key=lambda t: t.worth, default=None)


def _with_clock(chosen: list[BedTrial], trials: list[BedTrial]) -> list[BedTrial]:
    """Where a late motor or a shifted clock is to be refitted, what would look the same is refitted beside it.

    To first order it may be far behind: a shift that is not small is no longer linear.
    """
    first = next((t for t in chosen if _shifts_the_drive(t)), None)
    if first is None:
        return chosen
    # a motor that is late by tau looks like a clock that is ahead by it
    late = float(first.values[0]) * (-1.0 if first.mechanism == "time_offset" else 1.0)
    if late <= 0.0:
        return chosen
    at = chosen.index(first) + 1
    beside: list[BedTrial] = []
    for t in trials:
        if _shifts_the_drive(t) and t.mechanism not in {c.mechanism for c in (*chosen, *beside)}:
            amount = (-late if t.mechanism == "time_offset" else late) / t.term.free[0].scale
            low, high = limits(t.term)
            beside.append(replace(t, amounts=np.clip(np.array([amount]), low, high)))
    return [*chosen[:at], *beside, *chosen[at:]]


def plainer_first(trials: list[BedTrial]) -> list[BedTrial]:
    """A law that becomes another one when some of its numbers are none has to gain more than that by more than chaos.

    Drag in still air is a flow of no speed. What has no name has to gain more than all that has one.
    """
    if not trials or trials[0].gain is None:
        return trials
    first = trials[0].mechanism
    names = {t.mechanism for t in trials} - {first} if first == "unknown" else set(special_cases(first))
    plain = next((t for t in trials if t.mechanism in names and t.gain is not None), None)
    if plain is None or trials[0].worth - plain.worth > current().verdict.same + current().windows.search.chaos:
        return trials
    return [plain, *(t for t in trials if t is not plain)]


def clock_before_motor(trials: list[BedTrial]) -> list[BedTrial]:
    """A late motor that a shifted clock imitates to within chaos: apparatus comes before physics."""
    if not trials or trials[0].gain is None or not has_role(trials[0].mechanism, "late"):
        return trials
    offset = next((t for t in trials if t.mechanism == "time_offset" and t.gain is not None), None)
    if offset is None or trials[0].worth - offset.worth > current().verdict.same + current().windows.search.chaos:
        return trials
    return [offset, *(t for t in trials if t is not offset)]
