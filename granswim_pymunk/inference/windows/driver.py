"""The steps of ``Windows``: recalibration, replicates, signatures, laws refitted by simulation, held-out windows."""

from __future__ import annotations

import gc
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError
from ...recording import Recording
from ..criteria import current
from ..data import divided
from ..hypothesis import Failed, Hypothesis, Term, adjustable_terms
from ..judge import Judgement, Remains, unexplained
from ..kept import Store
from ..mechanisms import NOTHING
from ..places import Place
from ..result import NOT_TRIED
from ..simpler import special_cases
from .candidates import LawAdder, PictureScale, bed_terms, check_bed, nameless_terms, picture_scale
from .chance import Chance, as_in_replicates, chance, share_of_most
from .judge import Discrepancy, held_gain
from .likelihood import Prediction, WindowLikelihood, Windows, both_sides, check_runs
from .places import locate, locate_law
from .plan import Clock, Plan, make_plan
from .polish import polish, readjusted, widened
from .radii import unsure_sizes
from .search import (
    Answer,
    NoiseChi2,
    Progress,
    Search,
    best_form,
    clock_before_motor,
    plainer_first,
    positions,
    second_law,
    thinned,
)
from .signatures import BedSignature, make_signature, off, recombined
from .stamps import jitter_of, lateness, sighting_noise
from .trial import BedTrial, beyond_nothing, first_order, moved_to
from .weigh import held_verdict, like_replicates, looks_like, remains_in
from .windows import BedCase, BedPredictor, bed_case
from .work import Work


@dataclass
class Beginning:
    """What is known before anything is fitted: the scene as believed, and what can be afforded."""

    began: float  # s, by the machine's clock
    likelihood: WindowLikelihood
    plan: Plan
    clock: Clock
    store: Store
    naive: Hypothesis
    naive_values: np.ndarray
    # the naive scene, with what is off in the film: the scale that the swimmer shows where that is wrong, or a number
    # or two more for radii that are unsure
    hypothesis: Hypothesis
    values: np.ndarray
    wrong: PictureScale | None
    terms: list[Term]


# ---- steps -----------------------------------------------------------------------------------


def begin(
    recordings: Sequence[Recording], hold_out: Sequence[Recording], minutes: float | None, seed: int,
    candidates: Sequence[str] | None, plan: Plan | None, cut: bool, notes: list[str],
) -> Beginning:  # fmt: skip
    """Windows, candidates, and as much of a plan as the budget allows."""
    began = time.monotonic()
    beds = windows_of(recordings, hold_out, seed, current().windows.plan.most)
    for bed in beds:
        if bed.resized is not None:
            notes.append(
                f"{bed.name}: radii of grains are off by {100 * bed.resized.off:.2g} %, as their distances show where "
                "they touch; they were put right"
            )
        unsure = {"radii of grains": bed.recording.radius_error, "masses": bed.recording.mass_error}
        told = [f"{what} to {100 * error:.2g} %" for what, error in unsure.items() if error]
        if told:
            notes.append(f"{bed.name}: {' and '.join(told)}: its replicates are as far off, and errors as much wider")
        if any(bed.repaired):
            notes.append(f"{bed.name}: {bed.repaired[0]} labels put back, {bed.repaired[1]} sightings left out")
    # of held-out recordings, too, but for what only they have: nothing could tell it
    learnt = {b.name for b in beds if b.training.any()}
    adjustables = tuple(
        t for t in adjustable_terms([b.case for b in beds]) if any(f.cases is None or f.cases & learnt for f in t.free)
    )
    naive = Hypothesis(adjustables)
    values = np.array([f.first for f in naive.free])
    picture = picture_scale([b.case for b in beds])
    # a wrong scale is plain in the swimmer itself, and until it is put right windows cannot even be started
    wrong = picture if picture is not None and picture.wrong else None
    likelihood = WindowLikelihood(beds, 1, 1, cut=cut)
    more = [wrong.held] if wrong is not None else _of_the_film(likelihood)
    hypothesis = naive.with_term(*more)
    first = np.concatenate([values, [f.first for f in hypothesis.free[len(values) :]]])
    terms = _wanted_terms(beds, hypothesis, candidates)
    if picture is not None and (picture.wrong or not picture.off):
        terms = [t for t in terms if t.mechanism != "camera_scale"]

    # what a member of a window costs decides how many there are
    gauge = [w[: current().windows.search.gauge] for w in likelihood.every]
    check_runs(likelihood.predict([(hypothesis, first)], gauge, 1)[0], f"recording {beds[0].name}")
    gc.freeze()  # what imports and the compiler left is not walked through again and again
    clock = Clock(minutes, Work())
    windows = sum(len(b.starts) for b in beds)
    cost = sum(p.member_cost * len(p.bed.starts) for p in likelihood.predictors) / windows / current().work.cores
    training = sum(int(b.training.sum()) for b in beds)
    given, replicates = plan is not None, current().windows.plan.replicates
    films = [(b.film.t, b.film.xy, b.film.sigma, b.recording.time_noise, b.scene.hash) for b in beds]
    store = Store("bed", *films, minutes, seed, replicates, candidates, cut)
    if plan is None:
        whole = max(p.whole for p in likelihood.predictors)
        plan = make_plan(cost, windows, training, len(terms), clock.seconds, replicates, whole)
    if plan.windows < max(len(b.starts) for b in beds):
        beds = windows_of(recordings, hold_out, seed, plan.windows)
    beds = [as_filmed(bed, hypothesis, first, notes) for bed in beds]
    enough, full = current().windows.plan.usual, Plan.usual(replicates)
    if not given and plan != full and (plan != replace(full, windows=enough) or windows > enough):
        notes.append(
            f"for want of time: {plan.members} members a window, {plan.screening} for signatures, "
            f"{plan.replicates} replicates, "
            f"at most {plan.windows} windows of a recording, {plan.leaders} laws refitted"
        )
    likelihood = WindowLikelihood(beds, plan.replicates, plan.members, store, cut, clock.work)
    for bed, predictor in zip(beds, likelihood.predictors, strict=True):
        if len(bed.hidden):
            notes.append(
                f"{bed.name}: {len(bed.hidden)} grains that the film does not show were put where a void stays as "
                "large as a grain while all about it moves"
            )
        if predictor.cut is not None:
            notes.append(
                f"{bed.name}: of {len(bed.scene.bodies)} bodies, the {len(predictor.cut.inside)} nearest to the "
                f"swimmer (within {1e3 * current().windows.cut.reach:g} mm) were simulated in windows, "
                f"{len(predictor.cut.wall)} around them carried along as seen"
            )
    return Beginning(began, likelihood, plan, clock, store, naive, values, hypothesis, first, wrong, terms)


def recalibrated(start: Beginning, rng: np.random.Generator, progress: Progress) -> tuple[Search, Prediction]:
    """Adjustables first, with replicates of that scene; also the naive scene's prediction."""
    criteria = current().windows
    likelihood, hypothesis, values = start.likelihood, start.hypothesis, start.values
    used = likelihood.training
    progress("recalibrating", 0.04)
    base = check_runs(likelihood.weigh(hypothesis, values), f"recording {likelihood.beds[0].name}")
    likelihood.first_noise(base, used)
    steps = 2 if len(values) else 0
    for _ in range(steps):
        values, base, _ = _recalibrate(likelihood, hypothesis, values, base, used)
    # replicates of the recalibrated scene: bias, covariance, nulls
    likelihood.make_replicates(hypothesis, values, lambda share: progress("replicates", 0.08 + 0.24 * share))
    # numbers of the scene that nobody asked for are near enough by then
    for _ in range(2 if len(start.naive_values) else 1):
        values, base, nuisance = _recalibrate(likelihood, hypothesis, values, base, used)
    left = off(nuisance, likelihood.white(base, used))
    naive_base = base
    adjusted = len(start.naive_values)
    if adjusted and start.wrong is None:
        # as believed, but for the radii
        naive_base = likelihood.predict_surely(
            [(hypothesis, np.concatenate([start.naive_values, values[adjusted:]]))], used
        )[0]

    # where very much is left, fewer windows tell the candidates apart
    chi2 = np.sum(off(nuisance, recombined(likelihood.noises, used, criteria.signatures.replicates, rng)) ** 2, axis=0)
    noise = NoiseChi2(float(chi2.mean()), float(chi2.std()))
    surplus = float(left @ left) - noise.mean - 2.0 * noise.spread
    few = thinned(used, criteria.search.clear_gain / surplus if surplus > criteria.search.clear_gain else 1.0)
    at = positions(likelihood, used, few)
    search = Search(
        likelihood, hypothesis, values, base, nuisance, used, few, at, noise, start.plan, start.clock, progress
    )
    return search, naive_base


def signatures_in_time(search: Search, terms: Sequence[Term], notes: list[str]) -> list[BedSignature]:
    """Of all terms that there is time for, in a part of the windows."""
    apart = search.apart()
    signatures: list[BedSignature] = []
    untried: list[str] = []
    for k, term in enumerate(terms):
        search.progress(f"signatures: {term.label}", 0.34 + 0.30 * k / max(len(terms), 1))
        if search.clock.late(current().windows.budget.signatures):
            untried.append(term.label)
            continue
        signature = search.signature(term, apart)
        if signature is None:
            notes.append(f"{term.label} could not be simulated")
        else:
            signatures.append(signature)
    if untried:
        notes.append(f"{NOT_TRIED}{', '.join(untried)}")
    return signatures


def screened(
    search: Search, signatures: Sequence[BedSignature], rng: np.random.Generator, notes: list[str]
) -> tuple[list[BedTrial], Chance]:
    """All candidates to first order, the farthest ahead of chance first; what the same search gains by chance."""
    left = search.few_left
    by_chance = chance(search.likelihood, search.few, search.few_nuisance, signatures, rng)
    trials = [first_order(s, left, by_chance.spreads[s.term.label]) for s in signatures]
    trials.sort(key=lambda t: -t.ahead)
    share = current().windows.budget.replicates
    if trials and 0.0 < trials[0].linear < current().windows.search.doubtful and not search.clock.late(share):
        search.progress("leaders in replicates", 0.64)
        try:
            trials = as_in_replicates(
                search.likelihood, trials, search.few, search.few_nuisance, left, search.plan.screening,
                lambda: search.clock.late(share),
            )  # fmt: skip
        except Failed:
            notes.append("replicates could not be run with the laws that lead: their gains are not corrected")
    return trials, by_chance


def leading_laws(
    search: Search, trials: list[BedTrial], by_chance: Chance, p: float, notes: list[str]
) -> tuple[list[BedTrial], list[BedTrial]]:
    """Leaders refitted by simulation, best first; and those among them that are beyond the nulls."""
    criteria = current().windows
    if p <= criteria.search.open:
        trials = search.leaders(trials, search.likelihood.beds[0])
    trials = plainer_first(clock_before_motor(sorted(trials, key=lambda t: (t.gain is None, -t.worth))))
    if p > current().verdict.alarm:
        return trials, []
    # the lowest of several simulations flatters: what first order does not show either is not named
    sure = [t for t in trials if t.gain is not None and t.gain - t.attenuation >= criteria.search.sure]
    named = []
    for t in sure:
        if not by_chance.beyond(t):
            continue
        several = len(t.signature.windows) >= criteria.signatures.several
        if t.linear < criteria.search.doubtful and several and share_of_most(t) > criteria.search.one_window:
            notes.append(f"{t.term.label} is not named: a single window brings most of what it gains")
        else:
            named.append(t)
    return trials, named


def without_law(search: Search) -> Answer:
    """The recalibrated scene, and how well its adjustables are known."""
    white, nuisance = search.white, search.nuisance
    left = off(nuisance, white)
    size = max(float(left @ left) / max(len(left) - len(search.values), 1), 1.0)
    windows = sum(len(w) for w in search.used)
    covariance = widened(np.linalg.pinv(nuisance.T @ nuisance) * size, nuisance, white, windows)
    return Answer(search.hypothesis, search.values, covariance, search.likelihood, search.noise.above(left))


def refined(
    search: Search, plain: Answer, leading: Sequence[BedTrial], trials: Sequence[BedTrial],
    signatures: Sequence[BedSignature], alone: bool, rng: np.random.Generator, notes: list[str],
) -> Answer:  # fmt: skip
    """Adjustables and law together, with the noise of replicates that have the law, and a second law where it is
    needed.

    ``plain``: the answer without a law.  ``leading``: laws to be fitted, the first that stands is the answer;
    ``trials``: all that were tried, among them simpler laws that one may turn out to be.
    ``alone``: False where the camera's scale is already one of two.
    """
    criteria = current().windows.search
    clock, used, budget = search.clock, search.used, current().windows.budget
    adjusted = len(search.values)

    def polished(beside: Answer, values: np.ndarray, trial: BedTrial, share: float) -> Answer:
        z, covariance, moved, judge, columns = polish(search, beside.hypothesis, values, trial, clock.late(share))
        hypothesis = beside.hypothesis.with_term(trial.term)
        return Answer(hypothesis, z, covariance, judge, beside.unexplained, moved, columns=columns)

    def left(answer: Answer) -> Answer:
        """With what it leaves unexplained."""
        rows = answer.judge.predict([(answer.hypothesis, answer.values)], used)[0]
        if rows is None:
            return answer
        rest = off(search.nuisance, answer.judge.white(rows, used))
        return replace(answer, rows=rows, unexplained=search.noise.above(rest))

    for found in leading[: criteria.tries]:
        values = readjusted(search, found)
        first = polished(plain, values, found, budget.first)
        named = first.found
        assert named is not None
        if beyond_nothing(named):
            plainer = plainer_of(named, trials)
            if plainer is not None:
                other = polished(plain, values, plainer, budget.first)
                if other.found is not None and beyond_nothing(other.found):
                    notes.append(f"{found.term.label} is {plainer.term.label}: its other numbers are none")
                    first, found, named = other, plainer, other.found
            break
        within = f"within {criteria.clearly:g} standard errors of none"
        notes.append(f"{found.term.label}: in the last fit its numbers are {within}")
    else:
        return plain
    first = left(first)
    more = first.unexplained > criteria.unexplained and alone and found.mechanism != "unknown"
    if not more or first.columns is None or first.rows is None or clock.late(budget.second):
        return first
    search.progress("a second law", 0.80)
    beside = replace(
        search, likelihood=first.judge, hypothesis=first.hypothesis, values=first.values, base=first.rows,
        nuisance=first.columns,
    )  # fmt: skip
    partner = second_law(beside, named, signatures, rng)
    if partner is None:
        return first
    both = polished(first, first.values, partner, budget.both)
    part = slice(adjusted, adjusted + len(named.values))
    moved = moved_to(named, both.values[part], both.covariance[part, part])
    return left(replace(both, found=moved, partner=both.found, alone=first))


def plainer_of(found: BedTrial, trials: Sequence[BedTrial]) -> BedTrial | None:
    """The law that a richer one becomes where all its numbers but the strength are none within their intervals.

    A flow of no speed is drag in still air. None where they are not, or where there is no such law.
    """
    names = special_cases(found.mechanism)
    apply = found.term.apply
    if not names or not isinstance(apply, LawAdder) or not np.isfinite(found.covariance).all():
        return None
    flow = apply.flow(found.values, found.covariance)
    if flow is None or flow[1] is None:
        return None
    if np.any(np.abs(flow[0][1:]) > current().intervals.normal * np.sqrt(np.maximum(np.diag(flow[1])[1:], 0.0))):
        return None
    alike = [t for t in trials if t.mechanism in names and len(t.values) == 1 and t.term.bodies == found.term.bodies]
    if not alike:
        return None
    plain = max(alike, key=lambda t: (t.gain is not None, t.worth))
    moved = moved_to(plain, found.values[:1], found.covariance[:1, :1])
    return replace(moved, gain=found.gain if plain.gain is None else plain.gain)


def beyond_names(
    search: Search, answer: Answer, trials: Sequence[BedTrial], notes: list[str]
) -> tuple[BedTrial | None, bool]:
    """The best form without a name, None where none was tried, and whether it explains what no law with a name does."""
    if search.clock.late(current().windows.budget.nameless):
        notes.append("forces without a name were not tried: the time was up")
        return None, False
    criteria = current().windows.search
    search.progress("forces without a name", 0.84)
    swimmer = search.likelihood.beds[0].scene.swimmer_ids
    form = best_form(search, answer.found is not None and answer.found.term.bodies == swimmer)
    best_named = max((t.worth for t in trials if t.gain is not None), default=0.0)
    best_named += answer.partner.worth if answer.partner is not None else 0.0
    first = answer.alone or answer
    if first.found is not None and first.rows is not None:
        left = off(search.nuisance, search.white)
        rest = off(search.nuisance, search.likelihood.white(first.rows, search.used))
        best_named = max(best_named, float(left @ left - rest @ rest))
    if form is not None and form.worth < max(best_named + criteria.sure, criteria.ahead * best_named):
        notes.append(
            f"a force without a name ({form.term.label}) gains {form.gain:.0f} in chi2, "
            "no more than the laws with a name"
        )
        return form, False
    return form, True


def by_form(search: Search, form: BedTrial, unexplained: float) -> Answer:
    """The recalibrated scene with a form without a name."""
    values = np.concatenate([search.values, form.values])
    unknown = np.full((len(values),) * 2, np.nan)
    return Answer(search.hypothesis.with_term(form.term), values, unknown, search.likelihood, unexplained, form)


def on_held_out(
    search: Search, start: Beginning, answer: Answer, rng: np.random.Generator, notes: list[str],
) -> tuple[Answer, dict[str, Prediction], float | None, str | None]:  # fmt: skip
    """All windows under each scene: what is left of the answer, predictions by model, gain, outcome.

    gain : half the fall in chi2 of the held-out windows that the laws bring;  outcome : see ``held_verdict``
    """
    likelihood = search.likelihood
    any_held = any(len(w) for w in likelihood.held)
    wanted = [(start.naive, start.naive_values), (search.hypothesis, search.values)]
    if answer.found is not None:
        wanted.append((answer.hypothesis, answer.values))
    if answer.alone is not None:
        wanted.append((answer.alone.hypothesis, answer.alone.values))
    simulated = likelihood.predict(wanted, likelihood.every)
    if answer.partner is not None and answer.alone is not None and answer.found is not None:
        # windows that neither saw may turn the second law down, as they may the first
        with_both, with_one = simulated[2], simulated[3]
        fails = with_both is None or with_one is None or _turned_down(likelihood, with_one, with_both, rng)
        if fails and any_held:
            notes.append(f"{answer.partner.mechanism} beside {answer.found.mechanism} predicts held-out windows worse")
            answer = answer.alone
            simulated[2] = with_one
    named = zip(("naive", "recalibrated", "revised"), [*simulated, *simulated[1:2]][:3], strict=True)
    predicted = {label: rows for label, rows in named if rows is not None}
    if answer.found is None or not any_held or not {"recalibrated", "revised"} <= set(predicted):
        return answer, predicted, None, None
    before, after = (likelihood.white(predicted[k], likelihood.held) for k in ("recalibrated", "revised"))
    if (answer.found.gain or 0.0) < current().windows.search.clear_gain:
        moved = _foreseen(likelihood, search, answer)
        after = after if moved is None else before - moved
    gain = 0.5 * float(before @ before - after @ after)
    return answer, predicted, gain, held_verdict(likelihood, before, after, rng)


def _turned_down(likelihood: WindowLikelihood, one: Prediction, both: Prediction, rng: np.random.Generator) -> bool:
    """Whether held-out windows are predicted worse with two laws than with the first."""
    before, after = (likelihood.white(rows, likelihood.held) for rows in (one, both))
    return held_verdict(likelihood, before, after, rng) == "fails"


def _foreseen(likelihood: WindowLikelihood, search: Search, answer: Answer) -> np.ndarray | None:
    """(n,) what the laws change in held-out windows, whitened, to first order; None where that cannot be run.

    The chaos of two predictions differs in thousands of numbers and hides what a weak law does. Columns from amounts
    that stand above it, made by members of their own, let through one number for each of the answer's.
    """
    free = answer.hypothesis.free
    neutral = np.array([f.neutral for f in free[len(search.values) :]])
    before = np.concatenate([search.values, neutral])
    change = answer.values - before
    tried = np.concatenate([np.abs(t.signature.tried) for t in answer.laws])
    scales = np.array([f.scale for f in free[len(search.values) :]])
    low, high = answer.hypothesis.bounds
    steps = current().windows.polish.step * (high - low)
    steps[len(search.values) :] = np.maximum(np.abs(change[len(search.values) :]), tried * scales)
    ends, spans = both_sides(before, steps, low, high)
    try:
        wanted = [(answer.hypothesis, end) for end in ends]
        shown = likelihood.predict_surely(wanted, likelihood.held, None, likelihood.members)
    except Failed:
        return None
    moved: np.ndarray = likelihood.columns(shown, spans, likelihood.held) @ change
    return moved


def places_of(search: Search, answer: Answer, predicted: Mapping[str, Prediction], verdict: str) -> list[Place]:
    """Where the laws show, and where the mismatch does."""
    shown = "naive" if verdict == "recalibrate" else "recalibrated"
    if verdict == "no_mismatch" or shown not in predicted:
        return []
    places = _showing(search, answer) if verdict != "measurement" else []
    return places + locate(search.likelihood, predicted[shown], search.likelihood.every)


def left_of(
    search: Search, answer: Answer, predicted: Mapping[str, Prediction], judged: Judgement, excess: Mapping[str, float],
    discrepancy: Discrepancy | None, trials: Sequence[BedTrial], level: float,
) -> tuple[bool, Remains | None]:  # fmt: skip
    """Whether what the revised scene leaves of training windows passes for that of replicates, and what it is."""
    rows = predicted.get("revised")
    if rows is None:
        return False, None
    judge = answer.judge if answer.found is not None else search.likelihood
    noise = discrepancy is None and not unexplained(judged)
    if noise and like_replicates(search.likelihood, judge, rows, search.used, excess["revised"]):
        return True, None
    if judged.verdict in ("no_mismatch", "recalibrate"):
        return False, None
    looks = looks_like(search, answer, rows, trials, level) if discrepancy is None else NOTHING
    remains = remains_in(search.likelihood, judge, rows, search.used, looks)
    if remains is not None and discrepancy is not None and discrepancy.place.bodies:
        remains = replace(remains, bodies=tuple(discrepancy.place.bodies))
    return False, remains


def _showing(search: Search, answer: Answer) -> list[Place]:
    """Where the laws that were found show, in the training windows."""
    if answer.columns is None or answer.rows is None:
        return []
    adjusted = len(search.values)
    amounts = answer.values - np.array([f.neutral for f in answer.hypothesis.free])
    known = answer.columns[:, :adjusted]
    change = off(known, answer.columns[:, adjusted:] @ amounts[adjusted:])
    rest = off(known, answer.judge.white(answer.rows, search.used))
    mobile = {b.id for b in search.likelihood.beds[0].scene.bodies if b.mobile}
    acting = {b for t in answer.laws for b in (mobile if t.term.bodies is None else t.term.bodies)}
    return locate_law(search.likelihood.beds, search.used, change, rest + change, acting)


def scale_errors(
    search: Search, start: Beginning, predicted: Mapping[str, Prediction], gain: float | None, outcome: str | None,
    rng: np.random.Generator,
) -> tuple[BedTrial, dict[str, Prediction], float | None, str | None]:  # fmt: skip
    """The wrong scale of the picture as what was found, beside the scene with the picture as it is; see
    ``on_held_out``."""
    likelihood, predicted = search.likelihood, dict(predicted)
    assert start.wrong is not None
    predicted.setdefault("revised", predicted["recalibrated"])
    plain = likelihood.predict([(start.naive, search.values)], likelihood.every)[0]
    if plain is None:
        predicted.pop("recalibrated")
    else:
        predicted["recalibrated"] = plain
        gain = held_gain(likelihood, plain, predicted["revised"]) if any(len(w) for w in likelihood.held) else None
        before, after = (likelihood.white(rows, likelihood.held) for rows in (plain, predicted["revised"]))
        outcome = held_verdict(likelihood, before, after, rng)
    scale = _scale_trial(likelihood, start.wrong, search.nuisance, plain, search.base, search.used)
    return scale, predicted, gain, outcome


def excess_of(
    search: Search, start: Beginning, answer: Answer, predicted: Mapping[str, Prediction]
) -> dict[str, float]:
    """Standard deviations of the nulls' chi2 that each scene leaves in the training windows."""
    excess = {}
    for label, rows in predicted.items():
        # with a law found, the estimator's bias is that of replicates that have the law
        judge = answer.judge if label == "revised" and answer.found is not None else search.likelihood
        raw = label == "naive" or (start.wrong is not None and label == "recalibrated")
        white = judge.white(rows, search.used)
        excess[label] = search.noise.above(white if raw else off(search.nuisance, white))
    return excess


def windows_of(recordings: Sequence[Recording], hold_out: Sequence[Recording], seed: int, most: int) -> list[BedCase]:
    """Windows of all recordings, training first."""
    for r in (*recordings, *hold_out):
        check_bed(r.scene, r.name)
    training, held = divided(recordings, hold_out)
    beds = [bed_case(r, split=not held, seed=seed, most=most) for r in training]
    return beds + [bed_case(r, held_out=True, seed=seed, most=most) for r in held]


def _of_the_film(likelihood: WindowLikelihood) -> list[Term]:
    """Numbers of every fit that are no physics, where radii are unsure in what is learnt from."""
    unsure = [b.name for b in likelihood.beds if b.recording.radius_error and len(b.grains)]
    if not any(b.training.any() for b in likelihood.beds if b.name in unsure):
        return []
    whole = all(p.cut is None for p in likelihood.predictors)
    return unsure_sizes([b.given for b in likelihood.beds], unsure, whole)


def as_filmed(bed: BedCase, hypothesis: Hypothesis, values: np.ndarray, notes: list[str]) -> BedCase:
    """The recording with its noise as it is seen, and the moments of its frames put right where they are uneven.

    Both only by what a film of the scene as believed, with the noise that is said and even frames, does not have.
    """
    criteria, film, said = current().windows.stamps, bed.film, bed.given
    learnt = len(film.t)
    if bed.training.any() and not bed.training.all():
        learnt = int(bed.starts[bed.training][-1] + bed.looks[-1]) + 1
    t, xy = film.t[:learnt], film.xy[:learnt]
    noise, late = sighting_noise(t, xy), lateness(t, xy, film.sigma)
    uneven = late.size > criteria.fine * float(np.median(np.diff(t)))
    if said.time_noise is not None:
        uneven = said.time_noise > 0
    if said.position_noise and film.sigma != said.position_noise:
        notes.append(_of_noise(bed, film.sigma))
    if noise <= criteria.refuted * film.sigma and not uneven:
        return bed

    def simulated(bed: BedCase) -> np.ndarray:
        return BedPredictor(bed, cut=False).replicate(hypothesis, values, criteria.number).xy[:learnt]

    try:
        other = simulated(bed)
        like = sighting_noise(t, other)
        if noise > criteria.refuted * like > 0:
            film = replace(film, sigma=float(np.sqrt(film.sigma**2 + noise**2 - like**2)))
            bed = replace(bed, film=film)
            notes.append(_of_noise(bed, film.sigma))
            late, other = lateness(t, xy, film.sigma), simulated(bed)
    except Failed:
        return bed
    jitter = jitter_of(late, lateness(t, other, film.sigma)) if uneven else None
    if jitter is None:
        return bed
    moments = jitter.put_right(film.t, film.xy, film.sigma)
    notes.append(
        f"{bed.name}: frames are early or late by {jitter.size:.2g} s (one standard deviation), as all bodies show "
        "together; their moments were put right as far as that tells, and replicates are as uneven"
    )
    return replace(bed, film=replace(film, t=moments), jitter=jitter)


def _of_noise(bed: BedCase, sigma: float) -> str:
    said = bed.given.position_noise
    return f"{bed.name}: the noise of a sighting is {sigma:.2g} m" + (f", not {said:.2g} m as is said" if said else "")


def _wanted_terms(beds: Sequence[BedCase], hypothesis: Hypothesis, candidates: Sequence[str] | None) -> list[Term]:
    learnt = [b.case for b in beds if b.training.any()]
    terms = [*bed_terms(learnt), *nameless_terms(learnt)]
    taken = {f.name for f in hypothesis.free}
    terms = [t for t in terms if not any(f.name in taken for f in t.free)]
    return terms if candidates is None else [t for t in terms if t.mechanism in candidates]


def _recalibrate(
    likelihood: WindowLikelihood, hypothesis: Hypothesis, values: np.ndarray, base: Prediction, windows: Windows
) -> tuple[np.ndarray, Prediction, np.ndarray]:
    """One Gauss-Newton step: values, predictions with them, whitened columns (n, p) of the adjustables."""
    if not len(values):
        return values, base, np.zeros((len(likelihood.white(base, windows)), 0))
    low, high = hypothesis.bounds
    # chaos forgives no small step: a tenth of the range to either side
    ends, spans = both_sides(values, current().windows.polish.step * (high - low), low, high)
    try:
        shown = likelihood.predict_surely([(hypothesis, end) for end in ends], windows)
        columns = likelihood.columns(shown, spans, windows)
        change = np.linalg.lstsq(columns, likelihood.white(base, windows), rcond=1e-10)[0]
        new = np.clip(values + change, low, high)
        return new, likelihood.predict_surely([(hypothesis, new)], windows)[0], columns
    except Failed:
        raise InputError("the scene cannot be run with other values of its adjustables") from None


def _scale_trial(
    likelihood: WindowLikelihood, wrong: PictureScale, nuisance: np.ndarray, without: Prediction | None,
    base: Prediction,
    windows: Windows,
) -> BedTrial:  # fmt: skip
    """The scale of the picture, as the swimmer shows it, as what was found."""
    free = wrong.term.free[0]
    amounts = np.array([(wrong.value - free.neutral) / free.scale])
    column, gain = np.zeros((len(nuisance), 1)), 1e6  # where it cannot be run without
    if without is not None:
        column = likelihood.change(base, without, windows)[:, None] / amounts
        gain = float(np.sum(likelihood.white(without, windows) ** 2) - np.sum(likelihood.white(base, windows) ** 2))
    signature = make_signature(wrong.term, amounts, column, nuisance)
    return BedTrial(signature, amounts, np.array([wrong.value]), np.array([[wrong.error**2]]), gain, gain)
