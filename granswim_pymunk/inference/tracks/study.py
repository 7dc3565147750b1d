"""The search for what whole tracks lack, step by step: recalibration, candidates alone, memory, nulls, several laws."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ... import distributions as stats
from ...recording import Recording
from ..candidates import beside_terms, flexible_terms, named_terms, scaled_like
from ..criteria import current
from ..data import Case, left_out, prepare_all
from ..hypothesis import Hypothesis, Predictor, Term, adjustable_terms
from ..mechanisms import field_alone
from ..noise import Noise, left_alone, single_ones
from ..result import NOT_TRIED, PAIRS, Progress
from ..significance import Null, at_alarm, price
from ..simpler import by_chance
from .believed import believed_terms, shown_terms
from .choose import absurd, choose, left_over, prune, score_inner, worth
from .closer import joined_closely, shows_one_more
from .deleted import followed_sighting
from .fit import Fitter
from .fitted import Fit
from .innovations import leaves_noise, memory_of, tells_noise
from .jumps import jump_terms, scored_before_jumps
from .kicks import cut_at_kicks, without_struck_last
from .name import TOO_LATE, InnerSplit, Trial, is_limit, label_of, refit, spread_of, try_candidates, unstuck
from .nulls import noise_of, search_nulls
from .pairs import (
    Exchange,
    drag_and_push,
    in_their_order,
    pair_of,
    rivals_of_pair,
    second_law,
    settled,
    third_law,
    two_beside,
    two_for_one,
)
from .segments import shortened
from .sets import SetSearch
from .settle import in_names_of_apparatus, that_earn_their_place, without_idle_numbers
from .signatures import Bank, Signature, make_bank
from .steps import shifts, short, time_steps
from .usual import beyond_usual, is_usual, usual_errors
from .whom import whom


@dataclass
class Study:
    """What every step needs: the recordings, how they are simulated and fitted, and how much time there is."""

    cases: list[Case]
    training: list[Case]
    predictor: Predictor
    fitter: Fitter
    inner: InnerSplit
    stages: tuple[float, ...]  # shares of the frames that long fits take in one after the other
    adjustables: tuple[Term, ...]
    believed: tuple[Term, ...]  # radii and masses that are known, but not exactly
    rng: np.random.Generator
    progress: Progress
    late: Callable[[float], bool]  # whether that share of the budget is spent
    notes: list[str] = field(default_factory=list)
    # roles of which one of several laws has to have one, where all without it were tried before
    seeks: tuple[str, ...] = ()

    @property
    def kicked(self) -> list[Case]:
        """Recordings in which bodies go on at velocities of their own, for no reason that the scene has."""
        return [c for c in self.training if any(c.training[kick.row] for kick in c.kicks)]

    def stop(self) -> bool:
        """Whether the time is up: fits then end where they stand."""
        return self.late(current().budget.fits)


@dataclass
class FittedAlone:
    """All that was fitted alone: the scene as believed, recalibrated, and with each candidate in turn.

    alive : candidates that were refitted, ``untried`` those that were not;  forms : laws without a name
    spread : inflation of variances by what the ``best`` of all these fits leaves
    inner : score of each on later data inside the training part, by its label
    """

    naive: Fit
    recalibrated: Fit
    terms: list[Term]
    bank: Bank
    alive: list[Trial]
    untried: list[Trial]
    forms: list[Trial]
    best: Fit
    spread: float
    inner: dict[str, float]


def study_of(
    recordings: Sequence[Recording], hold_out: Sequence[Recording], rng: np.random.Generator, progress: Progress,
    late: Callable[[float], bool],
) -> Study:  # fmt: skip
    cases = [
        shortened(without_struck_last(cut_at_kicks(scored_before_jumps(case))))
        for case in prepare_all(recordings, hold_out)
    ]
    training = [c for c in cases if not c.held_out]
    predictor = Predictor(time_steps(cases))
    refits = current().refits
    stages = refits.stages if max(len(c.t) for c in training) > refits.staged else (1.0,)
    fitter = Fitter(cases, predictor, stop=lambda: late(current().budget.fits))
    predictor.short = short(fitter)
    inner = InnerSplit.make(training, predictor, lambda: late(current().budget.fits))
    terms = adjustable_terms(cases), believed_terms(cases)
    study = Study(cases, training, predictor, fitter, inner, stages, *terms, rng, progress, late)
    study.notes += dict.fromkeys(note for case in cases for note in case.notes)
    if len({c.unit for c in cases}) > 1:
        study.notes.append("some recordings are angles only: errors are pooled in the unit of the first")
    return study


def calibrated(study: Study) -> tuple[Fit, Fit]:
    """The scene as it is believed to be, and with its adjustables fitted: recalibration comes first."""
    study.progress("fitting the starts of the naive scene", 0.02)
    fitter = study.fitter
    naive = fitter.fit_widely(Hypothesis(), None, stages=study.stages)
    flights = None
    if _caught(study, naive):
        flights = fitter.from_flights(naive.hypothesis, naive.values)
        again = fitter.fit(naive.hypothesis, naive.values, flights)
        naive = again if again.chi2 < naive.chi2 else naive
    study.progress("recalibrating", 0.06)
    study.believed += shown_terms(study.cases, fitter, naive, study.adjustables, study.believed)
    terms = study.adjustables + study.believed
    if not terms:
        return naive, naive
    recalibrated = fitter.fit_widely(Hypothesis(terms), naive, stages=study.stages)
    if flights is not None and _caught(study, recalibrated):
        # starts of a scene that was caught at an impact lead the other numbers nowhere: from the tracks themselves
        first = [f.first for f in recalibrated.hypothesis.free]
        anew = fitter.fit(recalibrated.hypothesis, first, flights)
        if anew.chi2 < recalibrated.chi2:
            recalibrated = anew
            again = fitter.fit(naive.hypothesis, naive.values, anew.starts)
            naive = again if again.chi2 < naive.chi2 else naive
    return naive, recalibrated


def _caught(study: Study, fit: Fit) -> bool:
    """Whether a fit to segments leaves more than noise, so that some may be caught beside an impact."""
    return study.fitter.segmented and fit.excess > 0


def with_cases(study: Study, cases: list[Case]) -> Study:
    """The study of the same recordings with other sightings or another noise; segments join as closely as before."""
    training, closeness = [c for c in cases if not c.held_out], study.fitter.closeness
    fitter = Fitter(cases, study.predictor, stop=study.stop).tightened(closeness)
    inner = InnerSplit.make(training, study.predictor, study.stop, closeness)
    return replace(study, cases=cases, training=training, fitter=fitter, inner=inner)


def standing_out(case: Case, left: np.ndarray, follows: bool = False) -> np.ndarray:
    """(T, c) True where a sighting stands out from what a fit leaves, (T, c) over the noise, of the frames about it.

    An error of a stamp moves all that moves, and is no fault of a sighting.  follows : with a law that follows, so that
    noise alone is left
    """
    of_noise = 1.0 if case.late is None else np.sqrt(1 + case.late**2)
    alone = single_ones if follows else left_alone
    return alone(left / of_noise, [channel.body for channel in case.channels])


def without_single_ones(study: Study, naive: Fit, recalibrated: Fit) -> tuple[Study, Fit, Fit]:
    """The study without sightings that stand out from what a fit leaves about them, and the fits to the others.

    About an impact neighbouring frames alone do not tell them, and a fit follows through it.
    """
    training = [c for c in study.training if c.name in recalibrated.innovations]
    found = {c.name: standing_out(c, recalibrated.innovations[c.name]) for c in training}
    before, study = study, without_sightings(study, found)
    if study is before:
        return study, naive, recalibrated
    fits = [study.fitter.refitted(fit) for fit in (naive, recalibrated)]
    return study, fits[0], fits[1] if recalibrated is not naive else fits[0]


def without_sightings(study: Study, found: Mapping[str, np.ndarray]) -> Study:
    """The study without the sightings (T, c) of each recording that were found to be none; the same without such.

    Nor any where another impact is seen without them: that is for what looks for impacts.
    """
    cases = [
        replace(c, values=np.where(found[c.name], np.nan, c.values)) if c.name in found else c for c in study.cases
    ]
    lost = {name: int(those.any(axis=1).sum()) for name, those in found.items() if those.any()}
    if not lost:
        return study
    after = with_cases(study, cases)
    segments, those = after.fitter.segments, study.fitter.segments
    if any(len(segments[c.name]) != len(those[c.name]) for c in study.training):
        return study
    for name, many in lost.items():
        study.notes.append(f"{name}: {left_out(many, 'far off what a fit leaves')}")
    return after


def with_close_joints(study: Study, recalibrated: Fit) -> tuple[Study, Fit]:
    """The study with segments that join as closely as the recordings allow, and the recalibrated fit to these."""
    study.progress("joining segments", 0.08)
    fitter, fit = joined_closely(study.fitter, recalibrated, named_terms(study.cases))
    if fitter is study.fitter:
        return study, recalibrated
    inner = InnerSplit.make(study.training, study.predictor, study.stop, fitter.closeness)
    return replace(study, fitter=fitter, inner=inner), fit


def with_closer_joints(
    study: Study, tried: FittedAlone, fitter: Fitter, revised: Fit
) -> tuple[Study, FittedAlone]:
    """The study with segments joined so closely that the ``revised`` scene shows a law it lacks, all fitted again.

    Both as they were where none shows.  fitter : with which the revised scene was fitted, as closely as it follows
    """
    if study.late(current().budget.candidates):
        return study, tried
    closer = shows_one_more(fitter, revised, tried.terms)
    if closer is None:
        return study, tried
    study.progress("joining segments more closely", 0.6)
    inner = InnerSplit.make(study.training, study.predictor, study.stop, closer.closeness)
    study = replace(study, fitter=closer, inner=inner)
    return study, _all_again(study, tried)


def tried_alone(study: Study, naive: Fit, recalibrated: Fit, earlier: Sequence[Trial] = ()) -> FittedAlone:
    """Each candidate alone, and the laws without a name beside them.

    earlier : the same candidates as they were fitted to the same segments from elsewhere
    """
    fitter, late, progress = study.fitter, study.late, study.progress
    named = named_terms(study.cases) + jump_terms(study.training)
    for _ in range(current().refits.rounds):
        progress("signatures of the candidates", 0.1)
        bank = make_bank(fitter, recalibrated, named)
        # whatever their units, later fits step by what changes the prediction as much as the noise does
        terms = [scaled_like(t, s.term) for t, s in zip(named, bank.signatures, strict=True)]
        trials = try_candidates(
            fitter,
            recalibrated,
            bank,
            study.stages,
            lambda text, k, n: progress(f"refitting {text}", 0.12 + 0.4 * k / n),
            lambda: late(current().budget.candidates),
        )
        free, trials = unstuck(fitter, recalibrated, _or_earlier(trials, earlier, recalibrated))
        earlier = trials
        # through segments a search is dear, and what moves no law's gain by more than is left out anyway is no matter
        ahead = max((t.gain for t in trials), default=0.0) if fitter.segmented else 0.0
        least = max(price(len(named), 1), current().refits.near * ahead)
        stuck, recalibrated = free.chi2 < recalibrated.chi2 - least, free
        if not stuck or late(current().budget.candidates):
            break
        # what laws do was told, and their fits begun, where the scene was caught: again from where it got free
    again = fitter.fit(naive.hypothesis, naive.values, recalibrated.starts)
    naive = again if again.chi2 < naive.chi2 else naive
    progress("forces without a name", 0.52)
    if late(current().budget.forms):
        study.notes.append("forces without a name was not tried: the time was up")
    forms = make_bank(fitter, recalibrated, [] if late(current().budget.forms) else flexible_terms(study.cases))
    ahead = max((t.gain for t in trials), default=0.0)
    # where a law leaves noise alone, a form can only do the same, and through segments its end is far
    shortly = fitter.segmented and any(_leaves_noise(t) for t in trials)
    flexible_trials = try_candidates(fitter, recalibrated, forms, (1.0,), lambda *a: None, ahead=ahead, shortly=shortly)
    study.notes += _not_tried(trials)
    alive = [t for t in trials if t.fit is not None]
    forms_alive = [t for t in flexible_trials if t.fit is not None]

    fits = [t.fit for t in alive + forms_alive if t.fit is not None]
    best = min([*fits, recalibrated], key=lambda fit: fit.chi2)
    spread = spread_of(best, study.training)

    progress("testing inside the training part", 0.56)
    scores = {"recalibrated": study.inner.score(recalibrated)[0]}
    ahead = max((t.gain for t in alive), default=0.0)
    alive = score_inner(study.inner, alive)
    forms_alive = _scored_forms(study, forms_alive, alive, spread)
    scores |= {t.term.label: t.inner for t in alive + forms_alive}
    untried = [t for t in trials if t.fit is None]
    return FittedAlone(naive, recalibrated, terms, bank, alive, untried, forms_alive, best, spread, scores)


def tried_besides(study: Study, tried: FittedAlone, terms: Sequence[Term]) -> FittedAlone:
    """What was fitted alone, and further candidates beside it, each alone."""
    fitter, plain, before = study.fitter, tried.recalibrated, tried.bank
    bank = make_bank(fitter, plain, terms)
    trials = try_candidates(fitter, plain, bank, study.stages, lambda *a: None, study.stop)
    alive = score_inner(study.inner, [t for t in trials if t.fit is not None])
    both = replace(before, signatures=(*before.signatures, *bank.signatures), asked=(*before.asked, *bank.asked))
    more = [scaled_like(t, s.term) for t, s in zip(terms, bank.signatures, strict=True)]
    fits = [tried.best, *(t.fit for t in alive if t.fit is not None)]
    best = min(fits, key=lambda fit: fit.chi2)
    return replace(
        tried, terms=[*tried.terms, *more], bank=both, best=best, spread=spread_of(best, study.training),
        alive=sorted([*tried.alive, *alive], key=lambda t: -t.gain),
        untried=[*tried.untried, *(t for t in trials if t.fit is None)],
        inner=tried.inner | {t.term.label: t.inner for t in alive},
    )  # fmt: skip


def _or_earlier(trials: Sequence[Trial], earlier: Sequence[Trial], base: Fit) -> list[Trial]:
    """The trials, with fits of an earlier round where these follow more closely, or there was no time for another.

    From where a scene without a law follows better, through impacts, a law may not find back to where it was.
    """
    best = {t.label: t for t in sorted(earlier, key=lambda t: t.gain) if t.fit is not None}

    def kept(t: Trial) -> Trial:
        had = best.get(t.label)
        if had is None or had.fit is None:
            return t
        now = base if t.fit is None else t.fit
        nearer = t.reason == TOO_LATE or had.fit.chi2 < now.chi2
        return replace(had, gain=base.chi2 - had.fit.chi2) if nearer else t

    return sorted(map(kept, trials), key=lambda t: -t.gain)


def _not_tried(trials: Sequence[Trial]) -> list[str]:
    """Notes on candidates that were only compared to first order, and which of them may gain more than by chance."""
    late = [t for t in trials if t.reason == TOO_LATE]
    if not late:
        return []
    refitted = {t.mechanism for t in trials if t.fit is not None}
    gains = [t for t in late if t.mechanism not in refitted and not by_chance(t.signature.gain, t.numbers)]
    names = dict.fromkeys(t.mechanism for t in sorted(gains, key=lambda t: -t.signature.gain))
    notes = ["some candidates were only compared to first order: the time was up"]
    return [*notes, f"{NOT_TRIED}{', '.join(names)}"] if names else notes


def _leaves_noise(trial: Trial) -> bool:
    return trial.fit is not None and not trial.fit.excess and not absurd(trial)


def _scored_forms(study: Study, forms: list[Trial], named: Sequence[Trial], spread: float) -> list[Trial]:
    """Inner scores of forms without a name; through segments, where a score is dear, of those ahead of all names alone.

    Numbers paid for: what follows the data that it was fitted to no better than a name is no better explanation.
    """
    ahead = max((t.gain for t in named), default=0.0)
    if study.fitter.segmented:
        least = max((worth(t, spread) for t in named if not absurd(t)), default=-np.inf)
        behind = [t for t in forms if worth(t, spread) <= least]
        return [*score_inner(study.inner, [t for t in forms if worth(t, spread) > least], ahead), *behind]
    return score_inner(study.inner, forms, ahead)


def with_memory(study: Study, tried: FittedAlone, best: Fit | None = None) -> tuple[Study, FittedAlone]:
    """The study with the slow part of the noise in its likelihood, and all fits that matter again from where they were.

    best : what leaves least, with several laws where one leaves more than noise; the best of one where not given
    Where what it leaves has no memory, or that is counted already, both as they were. A slow part is counted as far as
    it passes for noise; what is slower or larger stays with the laws, and widens intervals as before.
    """
    counted = any(c.noise.size for c in study.training)
    if counted or study.late(current().budget.memory) or not tells_noise(best or tried.best):
        return study, tried
    best = best or _left_by_a_name(study, tried)
    if not tells_noise(best):
        return study, tried
    noise = _slow_noise(study, tried, best)
    if not noise.size:
        return study, tried
    study.progress("the memory of the noise", 0.58)
    study = with_cases(study, [replace(c, noise=noise) for c in study.cases])
    study.notes.append(
        f"the noise has a slow part: {noise.size:.2g} times its white part, correlated over {noise.memory:.0f} frames"
    )
    return study, _all_again(study, tried)


def _left_by_a_name(study: Study, tried: FittedAlone) -> Fit:
    """What leaves least of all fits alone; of names alone, where a form is ahead by what slow noise does.

    A form with many numbers, of the time above all, follows the slow part of the noise: it leaves none to be told.
    Where a name leaves noise with a memory, and with that memory counted the form gains no more than so many numbers
    do by chance, it is the noise.
    """
    named = [t.fit for t in tried.alive if t.fit is not None]
    plain = min([*named, tried.recalibrated], key=lambda fit: fit.chi2)
    more = len(tried.best.values) - len(plain.values)
    if more <= 0 or tried.best.chi2 >= plain.chi2:
        return tried.best
    noise = memory_of(plain, study.fitter.cases)
    if not noise.size:
        return tried.best
    fitter = with_cases(study, [replace(c, noise=noise) for c in study.cases]).fitter
    few = current().evaluations.memory
    one, other = (fitter.refitted(fit, evaluations=few) for fit in (plain, tried.best))
    gain = (one.chi2 - other.chi2) / spread_of(other, study.training)
    return plain if gain < stats.chi2.isf(current().verdict.alarm, more) else tried.best


def without_outliers(study: Study, tried: FittedAlone) -> tuple[Study, FittedAlone]:
    """The study without single sightings that no noise explains where a law follows, and all fits that matter again.

    Before a law was found they did not stand out of what the scene leaves, or of frames about them that are noisier: a
    stamp that is off shows where a body is fast.
    """
    left = tried.best.innovations
    found = {c.name: standing_out(c, left[c.name], follows=True) for c in study.training if c.name in left}
    before, study = study, without_sightings(study, found)
    tried = tried if study is before else _all_again(study, tried)
    for _ in range(current().noise.row):
        before, study = study, without_sightings(study, followed_sighting(tried.alive, study.training))
        if study is before:
            break
        tried = _all_again(study, tried)
    return study, tried


def _all_again(study: Study, tried: FittedAlone) -> FittedAlone:
    """All fits that matter from where they were, to the recordings as they are now."""
    fitter, inner, training = study.fitter, study.inner, study.training

    def again(fit: Fit) -> Fit:
        return fitter.refitted(fit, evaluations=current().evaluations.memory)

    naive = again(tried.naive)
    recalibrated = naive if tried.recalibrated is tried.naive else again(tried.recalibrated)
    bank = make_bank(fitter, recalibrated, tried.terms)
    forms_bank = make_bank(fitter, recalibrated, [t.term for t in tried.forms])
    alive, untried, refits = list[Trial](), list(tried.untried), current().refits
    # beside a law that leaves noise alone no second one is looked for, and none that is far behind is its equal
    first = max(tried.alive, key=lambda t: t.gain, default=None)
    alone = first is not None and first.fit is not None and leaves_noise(first.fit, training)
    for kind, signatures in ((tried.alive, bank.signatures), (tried.forms, forms_bank.signatures)):
        by_form = {_form(s.term): s for s in signatures}
        most = max((t.gain for t in kind), default=0.0)
        for t in kind:
            behind = alone and t.gain < refits.memory_behind * most and most - t.gain > refits.memory_lead
            if t.fit is None or t.gain < refits.memory * most or (behind and kind is tried.alive):
                untried.append(replace(t, fit=None, reason="others explain far more"))
                continue
            fit = again(t.fit)
            signature = replace(by_form.get(_form(t.term)) or _signature_of(fitter, recalibrated, t), term=t.term)
            alive.append(Trial(signature, fit, recalibrated.chi2 - fit.chi2, float("inf")))
    best = min([*(t.fit for t in alive if t.fit is not None), recalibrated], key=lambda fit: fit.chi2)
    spread = spread_of(best, training)
    flexible = {t.term.label for t in tried.forms}
    alive = sorted(alive, key=lambda t: -t.gain)
    ahead = max((t.gain for t in alive), default=0.0)
    named = score_inner(inner, [t for t in alive if t.term.label not in flexible], ahead)
    forms = _scored_forms(study, [t for t in alive if t.term.label in flexible], named, spread)
    inner_scores = {"recalibrated": inner.score(recalibrated)[0]} | {t.term.label: t.inner for t in named + forms}
    untried = [t for t in untried if t.term.label not in flexible]
    return FittedAlone(naive, recalibrated, tried.terms, bank, named, untried, forms, best, spread, inner_scores)


def _signature_of(fitter: Fitter, recalibrated: Fit, trial: Trial) -> Signature:
    """The signature of a law as its trial has it, where a bank has it with other numbers."""
    return make_bank(fitter, recalibrated, [trial.term]).signatures[0]


def _slow_noise(study: Study, tried: FittedAlone, best: Fit) -> Noise:
    """The slow part of the noise; what one more law beside the best explains is slow too, and is not taken for it."""
    alone, fitter = best, study.fitter
    noise = memory_of(best, fitter.cases)
    if not noise.size:
        return noise
    taken = {t.mechanism for t in best.hypothesis.terms}
    rest = make_bank(fitter, best, [t for t in tried.terms if t.mechanism not in taken]).signatures
    for signature in rest:
        if is_limit(signature.term):  # to first order it changes nothing
            found = refit(fitter, alone, signature, (1.0,))
            if best.chi2 - found.chi2 > price(len(rest), 1):
                best = found
    more = max(rest, key=lambda s: s.gain - 2 * s.directions.shape[1], default=None)
    if best is not alone or more is None or more.gain < price(len(rest), more.directions.shape[1]):
        return memory_of(best, fitter.cases)
    return memory_of(best, fitter.cases, more.directions)


def _form(term: Term) -> tuple[str, tuple[float, ...]]:
    """What tells terms of one law apart: its choices, and from which ranges and exponents it is looked for."""
    return term.label, tuple(f.neutral for f in term.free if f.inner)


def beyond_nulls(study: Study, tried: FittedAlone) -> tuple[Null | None, Trial | None]:
    """The same search on data without a mismatch, and the candidate to be named where it gains more than that."""
    study.progress("nulls", 0.64)
    sets, late = current().sets, study.late(current().budget.exchanges)
    replicates = sets.replicates_late if late else sets.replicates
    signatures = tried.bank.signatures
    if not signatures:
        return None, None
    open_ = np.array([s.surviving > current().signatures.surviving for s in signatures])
    gain = max((s.gain for s, counts in zip(signatures, open_, strict=True) if counts), default=0.0)
    noise = noise_of(tried.best, study.fitter.cases, tried.spread)
    null = search_nulls(tried.bank, noise, open_, gain, replicates, study.rng)
    chosen = chosen_alone(study, tried, null)
    least = tried.inner["recalibrated"] + study.inner.slack
    if chosen is not None:
        null = replace(null, case=chosen.gain)
    elif (ahead := choose(tried.alive, tried.spread, least, len(tried.terms))) is not None:
        null = replace(null, case=ahead.gain)
        if null.p <= current().verdict.alarm:  # noise alone does not explain it, these errors do
            errors = usual_errors(tried.bank)
            study.notes.append(
                f"{ahead.label} would explain no more than what any apparatus is off by, each in a way of its own: "
                + ", ".join(errors)
            )
            moved = np.hstack(list(errors.values()))
            null = search_nulls(tried.bank, noise, open_, ahead.gain, replicates, study.rng, moved)
    return null, chosen if null.p <= current().verdict.alarm else None


def chosen_alone(study: Study, tried: FittedAlone, null: Null) -> Trial | None:
    """The candidate to be named first: for what it explains beyond what any apparatus is off by."""
    beyond = beyond_usual(tried.bank, tried.alive, tried.spread) > at_alarm(null.gains)
    named = [t for t, more in zip(tried.alive, beyond, strict=True) if more or is_usual(t)]
    return choose(named, tried.spread, tried.inner["recalibrated"] + study.inner.slack, len(tried.terms))


def without_laws(tried: FittedAlone, mechanisms: Collection[str]) -> FittedAlone:
    """What was tried, without some laws."""
    return replace(
        tried, terms=[t for t in tried.terms if t.mechanism not in mechanisms],
        alive=[t for t in tried.alive if t.mechanism not in mechanisms],
    )  # fmt: skip


@dataclass(frozen=True)
class Explanation:
    """The laws that explain, their ``fit``, and what was seen on the way to them.

    dropped : for each body that a law was not kept for, why;  near : what could stand in place of what was found, True
        where these data cannot tell;  exchanged : of these, laws fitted in place of one of several
    """

    laws: list[Trial]
    fit: Fit
    dropped: dict[str, str]
    near: Sequence[tuple[Trial, bool]] = ()
    exchanged: Sequence[Exchange] = ()


def search_with(study: Study, tried: FittedAlone, fitter: Fitter) -> SetSearch:
    """The search of several laws, where segments join as they do for ``fitter``."""
    base, inner = tried.recalibrated, study.inner
    asked = beside_terms(study.cases)
    beside = [scaled_like(t, s.term) for t, s in zip(asked, make_bank(fitter, base, asked).signatures, strict=True)]
    return SetSearch(
        base, fitter, [*tried.terms, *beside], study.training, inner, tried.inner, study.rng, study.notes, study.seeks
    )


def explained_by(study: Study, tried: FittedAlone, chosen: Trial | None) -> Explanation:
    """The law that was chosen for the bodies that ask for it, a second one beside it, or two needed together."""
    fitter, inner, recalibrated = study.fitter, study.inner, tried.recalibrated
    search = search_with(study, tried, fitter)
    found: list[Trial] = []
    revised = recalibrated
    dropped: dict[str, str] = {}
    if chosen is not None and chosen.fit is not None:
        found, revised = [chosen], chosen.fit
    scores, training = tried.inner, study.training
    in_time = not study.late(current().budget.pairs)
    if in_time:
        study.progress("pairs", 0.7)
        found, revised = second_law(search, found, revised)
    if len(found) == 1:
        # of two, whom each acts on is asked when both have their last form
        kept, dropped = prune(found[0], recalibrated, fitter, inner, study.notes)
        found = [] if kept is None else [kept]
        revised = recalibrated if kept is None or kept.fit is None else kept.fit
    if not in_time:
        study.notes.append(f"{NOT_TRIED}{PAIRS}")
        return Explanation(found, revised, dropped)
    # a poor first law, or none although the innovations are not noise: perhaps two are needed together
    now = scores.get(label_of(*found), found[0].inner) if found else np.inf
    now = min(now, scores["recalibrated"])
    left = left_over(revised, recalibrated, now, scores["recalibrated"], training)
    # a small part of a misfit a thousand times the noise is still far from noise, where one law alone stands
    poor = left > current().sets.poor or (len(found) < 2 and now > current().signatures.far ** 2)
    # with what nobody sees beside a drag the search begins, or with it alone: other pairs were tried without it
    if spread_of(revised, training) > 1 and poor and not study.seeks:
        pair = pair_of(search, tried.alive, now)
        if pair and pair[0].fit is not None:
            found, revised = pair, pair[0].fit
    if not study.late(current().budget.exchanges):
        if not study.seeks:
            found, revised = two_for_one(search, tried.alive, found, revised)
        found, revised = drag_and_push(search, found, revised)
        found, revised = two_beside(search, found, revised)
    others: list[Exchange] = []
    if len(found) == 2 and not study.late(current().budget.exchanges):
        found, revised, others = settled(search, found, revised)
    if not study.late(current().budget.exchanges):
        found, revised = third_law(search, found, revised)
        if len(found) > 2 and not study.late(current().budget.exchanges):
            found, revised, others = settled(search, found, revised)
    if len(found) > 1 and not study.late(current().budget.settling):
        found, revised = in_their_order(search, found, revised)
        found, revised, dropped = whom(search, found, revised)
    near = rivals_of_pair(others) if len(found) > 1 else []
    if found and not study.late(current().budget.settling):
        if len(found) > 1:
            found, revised = without_idle_numbers(search, found, revised)
        found, revised, equal = in_names_of_apparatus(search, found, revised)
        gave_way = [(e.gave_way, True) for e in equal]
        named = {t.mechanism for t in (*found, *(t for t, _ in gave_way))}
        near = [*gave_way, *(r for r in near if r[0].mechanism not in named)]
        found, revised, gone = that_earn_their_place(search, found, revised)
        dropped |= gone
    if field_alone(t.mechanism for t in found):
        return Explanation([], recalibrated, dropped)
    return Explanation(found, revised, dropped, near, others)


def finely(
    study: Study, tried: FittedAlone, fitter: Fitter, found: list[Trial], revised: Fit, spread: float
) -> tuple[FittedAlone, Fitter, list[Trial], Fit]:
    """What was found, with steps so short that no number hangs on them: halved and fitted again where one does."""
    for _ in range(current().fits.halvings):
        moved = shifts(fitter, revised, spread)
        if moved.max(initial=0.0) < current().fits.shift or study.late(current().budget.settling):
            break
        worst = revised.hypothesis.free[int(np.argmax(moved))].name
        study.predictor.dt = {name: dt / 2 for name, dt in study.predictor.dt.items()}
        study.notes.append(f"{worst} would move by {moved.max():.1f} standard errors with half the time step: halved")
        few = current().evaluations.finer
        revised = fitter.refitted(revised, evaluations=few)
        naive = study.fitter.refitted(tried.naive, evaluations=few)
        recalibrated = naive
        if tried.recalibrated is not tried.naive:
            then = tried.recalibrated
            recalibrated = study.fitter.refitted(then, evaluations=few)
        tried = replace(tried, naive=naive, recalibrated=recalibrated)
        found = [replace(t, fit=revised, gain=recalibrated.chi2 - revised.chi2) for t in found]
    return tried, fitter, found, revised
