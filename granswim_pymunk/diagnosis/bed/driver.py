"""The diagnosis of a swimmer in its bed, both seen, step by step.

Recalibration first, then twins (bias, covariance, nulls), signatures, least squares, leaders refitted by
simulation, held-out windows, places, the next experiment.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace

import numpy as np
from scipy import stats

from ...errors import InputError
from ...recording import Recording
from ..candidates import APPARATUS
from ..data import choose_held_out
from ..fit import basis
from ..hypothesis import Failed, Hypothesis, Term, adjustable_terms
from ..kept import Store
from ..name import SPECIAL_CASES
from .bench import Bench, Prediction, Windows, check_runs
from .candidates import PictureScale, across_term, bed_terms, check_bed, flexible_terms, picture_scale, siblings
from .cut import REACH
from .experiment import Proposal, propose
from .places import Place, locate
from .signatures import (
    BedSignature,
    coherence,
    limits,
    make_signature,
    off,
    recombined,
    to_values,
    whole_films,
)  # fmt: skip
from .windows import MEMBERS, MOST_WINDOWS, THREADS, BedCase, bed_case

ALARM = 0.01
REPLICATES = 499
TWINS = 8
FEWEST_TWINS = 4
SAME = 4.0  # chi2 by which two laws have to differ, d' = 2
CHAOS = 16.0  # chi2 by which the gain of the same law differs when it is simulated again: the bed's own chaos
UNEXPLAINED = 5.0  # standard deviations of the nulls' chi2 that are left before arms without a name are tried
LEAST_SPREAD = 0.05  # of the logarithm of the pace of twins: few of them know it badly
SURE = 25.0  # chi2 that a law must gain, besides being beyond the nulls: five standard errors
# rms of the change that a signature is made of, in standard deviations: well above the 0.2 to 0.4 that chaos adds
# whatever the amount (columns of a force across the motion at 0.4 were mostly chaos, and had a tenth of the gain), yet
# near linear (taken to one side, and three times as far as need be, they had a tenth, too)
RESPONSE = (0.8, 2.5)
CLEAR_GAIN = 200.0  # chi2 that tells candidates apart; windows beyond those that hold so much are for later
ROUGH, FINE = (0.7, 1.5, 3.0), (0.8, 1.0, 1.25)  # of the amounts so far, simulated when a leader is refitted
DOUBTFUL = 150.0  # chi2 below which the leaders' gains are held against what twins give them
LEANING = 4  # leaders of which that is asked
LEADERS = 7
SECONDS = 6  # laws that are tried beside the one that was found
LEAST_HELD = 2.0  # half a fall in chi2 of held-out windows, below which nothing is named
GAUGE = 4  # members that are timed
MINUTES = 10.0  # where no budget is given
LATE = ("actuator_lag", "actuator_delay")

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class BedTrial:
    """A candidate, and what became of it.

    amounts : in units of the scales of the term's numbers, ``values`` those numbers, ``covariance`` of the values
    linear, gain : fall in chi2 to first order, and simulated (None: not refitted)
    """

    signature: BedSignature
    amounts: np.ndarray
    values: np.ndarray
    covariance: np.ndarray
    linear: float
    gain: float | None

    @property
    def term(self) -> Term:
        return self.signature.term

    @property
    def mechanism(self) -> str:
        return self.signature.term.mechanism

    @property
    def worth(self) -> float:
        """Gain less what as many numbers gain by chance."""
        return (self.linear if self.gain is None else self.gain) - 2.0 * len(self.term.free)


@dataclass(frozen=True)
class Errors:
    """Root mean square of seen less predicted positions of the disks [m], the estimator's bias taken off."""

    rms: float | None
    chi2: float | None  # over the count of numbers


@dataclass(frozen=True)
class Strayed:
    """Where a film as a whole is unlike its twins, and in words."""

    place: Place
    text: str


@dataclass
class BedDiagnosis:
    """Everything that was found; ``verdict`` is one of the contract's five; ``partner`` a second law."""

    bench: Bench
    verdict: str
    adjustables: tuple[Term, ...]
    naive_values: np.ndarray
    recalibrated_values: np.ndarray
    values: np.ndarray
    value_covariance: np.ndarray
    found: BedTrial | None
    partner: BedTrial | None
    rivals: list[tuple[BedTrial, bool]]
    trials: list[BedTrial]
    null: np.ndarray
    score: float
    p: float
    train: dict[str, Errors]
    held: dict[str, Errors]
    floor: tuple[float, float]
    gain_held: float | None
    places: list[Place]
    proposal: Proposal | None
    predicted: dict[str, Prediction]
    excess: dict[str, float]
    notes: list[str] = field(default_factory=list)
    seconds: float = 0.0
    runs: int = 0
    seed: int = 0
    strayed: Strayed | None = None

    @property
    def beds(self) -> list[BedCase]:
        return self.bench.beds

    @property
    def laws(self) -> list[BedTrial]:
        """What was found, the more telling first."""
        return [t for t in (self.found, self.partner) if t is not None]


class Clock:
    """The budget: how much of it is spent."""

    def __init__(self, minutes: float | None) -> None:
        self.began = time.monotonic()
        self.seconds = 60.0 * (minutes or MINUTES)

    @property
    def spent(self) -> float:
        return time.monotonic() - self.began

    def late(self, share: float) -> bool:
        return self.spent > share * self.seconds


@dataclass(frozen=True)
class Plan:
    """How much is simulated: members of a window, of a signature; twins; windows of a recording; leaders."""

    members: int
    screening: int
    twins: int
    windows: int
    leaders: int


def make_plan(
    cost: float, windows: int, training: int, terms: int, seconds: float, twins: int, whole: float = 1.0
) -> Plan:
    """The best plan that should be done in ``seconds``; ``cost`` [s] of one member of one window, all threads busy.

    Every step is counted, though few recordings ask for all of them.

    ``whole``: how many times the bodies of a window the whole bed has, of which twins are simulated.

    What is given up first: the fourth and third member, then windows, then twins, then leaders.
    """
    plans = [
        Plan(m, s, n, w, k)
        for m, s, n, w, k in (
            (MEMBERS, 2, twins, MOST_WINDOWS, LEADERS), (MEMBERS, 2, twins, 26, LEADERS), (MEMBERS, 2, 6, 26, LEADERS),
            (2, 2, 6, 26, LEADERS), (2, 1, 6, 26, 5), (2, 1, 6, 16, 5), (2, 1, 5, 12, 4),
            (2, 1, 4, 9, 4), (2, 1, 4, 7, 3), (1, 1, 4, 6, 3),
        )
        if n <= twins
    ] or [Plan(2, 1, twins, 26, 5)]  # fmt: skip
    for plan in plans:
        part = min(1.0, plan.windows / max(windows, 1))
        every, used = windows * part, max(training * part, 1.0)
        runs = 13 * used * plan.members + plan.twins * every * (plan.members + 1.4 * whole)
        runs += terms * used * plan.screening * 2.6 + 2 * plan.leaders * 3 * used * plan.screening
        runs += plan.twins * used * plan.screening * 2.5 * LEANING
        runs += (
            (plan.leaders - 2) * 4 * used * plan.members
            + 3 * every * plan.members
            + 0.6 * plan.twins * every * (plan.members + 1.4 * whole)
        )
        if runs * cost < seconds:
            return plan
    return plans[-1]


def diagnose_windows(
    recordings: Sequence[Recording],
    hold_out: Sequence[Recording] = (),
    *,
    minutes: float | None = None,
    seed: int = 0,
    twins: int = TWINS,
    candidates: Sequence[str] | None = None,
    plan: Plan | None = None,
    cut: bool = True,
    progress: Progress = lambda text, share: None,
) -> BedDiagnosis:
    """Explain recordings of a swimmer and its grains, both seen, by what their scene lacks.

    ``minutes``: the budget, ten where not given; when it is short, members, windows and candidates are left out,
    and the notes say so. ``candidates``: names of the mechanisms to try, all where not given. ``plan``: how much is
    simulated, whatever the time. ``cut``: in windows, grains far from the swimmer are walls that move as seen, where
    that saves much. Finished predictions are kept in the user's cache until there is a verdict: a
    diagnosis that was interrupted goes on from there.
    Raises InputError for recordings that cannot be used.
    """
    clock = Clock(minutes)
    rng = np.random.default_rng(seed)
    notes: list[str] = []
    progress("cutting windows", 0.01)
    beds = windows_of(recordings, hold_out, seed, MOST_WINDOWS)
    for bed in beds:
        if any(bed.repaired):
            notes.append(f"{bed.name}: {bed.repaired[0]} labels put back, {bed.repaired[1]} sightings left out")
    # of held-out recordings, too, but for what only they have: nothing could tell it
    learnt = {b.name for b in beds if b.training.any()}
    adjustables = tuple(
        t for t in adjustable_terms([b.case for b in beds]) if any(f.cases is None or f.cases & learnt for f in t.free)
    )
    naive = Hypothesis(adjustables)
    values = naive_values = np.array([f.first for f in naive.free])
    picture = picture_scale([b.case for b in beds])
    # a wrong scale is plain in the swimmer itself, and until it is put right windows cannot even be started
    wrong = picture if picture is not None and picture.wrong else None
    hypothesis = naive if wrong is None else naive.with_term(wrong.held)
    terms = _wanted_terms(beds, hypothesis, candidates)
    if picture is not None:
        terms = [t for t in terms if t.mechanism != "camera_scale"]

    # what a member of a window costs decides how many there are
    bench = Bench(beds, 1, 1, cut=cut)
    gauge = [w[: max(GAUGE // len(beds), THREADS)] for w in _any(bench)]
    check_runs(bench.predict([(hypothesis, values)], gauge, 1)[0], f"recording {beds[0].name}")
    gc.freeze()  # what imports and the compiler left is not walked through again and again
    # the first run compiled the laws, once for all times: that is not counted
    clock = Clock(minutes)
    times = []
    for _ in range(3):
        began = time.monotonic()
        bench.predict([(hypothesis, values)], gauge, 1)
        times.append(time.monotonic() - began)
    cost = float(np.median(times)) / sum(len(w) for w in gauge)
    windows = sum(len(b.starts) for b in beds)
    training = sum(int(b.training.sum()) for b in beds)
    given = plan is not None
    store = Store("bed", *((b.film.t, b.film.xy, b.scene.hash) for b in beds), minutes, seed, twins, candidates, cut)
    if plan is None:
        kept = store.get("plan", (5,))
        # an interrupted diagnosis goes on with what it had planned: only then are its runs the same
        if kept is not None:
            plan = Plan(*map(int, kept))
        else:
            whole = max(p.whole for p in bench.predictors)
            plan = make_plan(cost, windows, training, len(terms), clock.seconds - clock.spent, twins, whole)
        store.put("plan", np.array(astuple(plan), dtype=float))
    if plan.windows < max(len(b.starts) for b in beds):
        beds = windows_of(recordings, hold_out, seed, plan.windows)
    if not given and plan != Plan(MEMBERS, 2, twins, MOST_WINDOWS, LEADERS) and (
        plan != Plan(MEMBERS, 2, twins, 26, LEADERS) or windows > 26
    ):
        notes.append(
            f"for want of time: {plan.members} members a window, {plan.screening} for signatures, {plan.twins} twins, "
            f"at most {plan.windows} windows of a recording, {plan.leaders} laws refitted"
        )
    bench = Bench(beds, plan.twins, plan.members, store, cut)
    for bed, predictor in zip(beds, bench.predictors, strict=True):
        if predictor.cut is not None:
            notes.append(
                f"{bed.name}: of {len(bed.scene.bodies)} bodies, the {len(predictor.cut.inside)} nearest to the "
                f"swimmer (within {1e3 * REACH:g} mm) were simulated in windows, {len(predictor.cut.wall)} around "
                "them carried along as seen"
            )
    used = bench.training

    # recalibration first
    progress("recalibrating", 0.04)
    base = check_runs(bench.predict([(hypothesis, values)], used)[0], f"recording {beds[0].name}")
    bench.first_noise(base, used)
    for _ in range(2 if adjustables else 0):
        values, base, _ = _recalibrate(bench, hypothesis, values, base, used)
    # twins of the recalibrated scene: bias, covariance, nulls
    bench.make_twins(hypothesis, values, lambda share: progress("twins", 0.08 + 0.24 * share))
    for _ in range(2 if adjustables else 1):
        values, base, nuisance = _recalibrate(bench, hypothesis, values, base, used)
    white = bench.white(base, used)
    left = off(nuisance, white)
    naive_base: Prediction | None = base
    if adjustables and wrong is None:
        naive_base = bench.predict_surely([(naive, naive_values)], used)[0]

    # signatures; where very much is left, fewer windows tell the candidates apart
    null_chi2 = np.sum(off(nuisance, recombined(bench.noises, used, REPLICATES, rng)) ** 2, axis=0)
    surplus = float(left @ left - null_chi2.mean())
    few = thinned(used, CLEAR_GAIN / surplus if surplus > CLEAR_GAIN else 1.0)
    at = positions(bench, used, few)
    few_nuisance, few_left = nuisance[at], off(nuisance[at], white[at])
    apart = _apart(bench, hypothesis, values, few, plan.screening)
    signatures: list[BedSignature] = []
    untried: list[str] = []
    for k, term in enumerate(terms):
        progress(f"signatures: {term.label}", 0.34 + 0.30 * k / max(len(terms), 1))
        if clock.late(0.72):
            untried.append(term.label)
            continue
        signature = signature_of(bench, hypothesis, values, apart, few_nuisance, term, few, plan.screening)
        if signature is None:
            notes.append(f"{term.label} could not be simulated")
        else:
            signatures.append(signature)
    if untried:
        notes.append(f"not tried, the time was up: {', '.join(untried)}")

    # nulls: the same search in windows of twins
    null = np.zeros(REPLICATES)
    drawn = off(few_nuisance, recombined(bench.noises, few, REPLICATES, rng))
    for s in signatures:
        null = np.maximum(null, s.best(drawn)[1])
    null *= coherence(signatures, off(few_nuisance, whole_films(bench.noises, few)), drawn) * unsure(bench, rng)

    # naming: leaders refitted by simulation
    trials = []
    for s in signatures:
        amounts, gain = s.best(few_left[:, None])
        trials.append(_trial(s, amounts[:, 0], float(gain[0]), None))
    trials.sort(key=lambda t: -t.linear)
    score = trials[0].linear if trials else 0.0
    if 0.0 < score < DOUBTFUL and not clock.late(0.6):
        progress("leaders in twins", 0.64)
        try:
            trials, wider = as_in_twins(bench, trials, few, few_nuisance, few_left, plan.screening)
        except Failed:
            notes.append("twins could not be run with the laws that lead: their gains are not corrected")
        else:
            null *= wider
            score = max(t.linear for t in trials[:LEANING])
            trials.sort(key=lambda t: -t.linear)
    p = float((1 + np.sum(null >= score)) / (REPLICATES + 1))
    if p <= 0.1:
        search = Search(bench, hypothesis, values, base, nuisance, used, few, at, plan, clock, progress)
        trials = search.leaders(trials, beds[0])
    trials = plainer_first(_clock_before_motor(sorted(trials, key=lambda t: (t.gain is None, -t.worth))))
    found = trials[0] if trials and trials[0].gain is not None else None
    # the lowest of several simulations flatters: what first order does not show either is not named
    threshold = max(float(np.quantile(null, 1 - ALARM)), SURE)
    if found is not None and (p > ALARM or (found.gain or 0.0) < SURE or score < threshold):
        found = None
    if found is not None and found.linear < threshold:
        sound = [t for t in trials if t.gain is not None and t.linear >= threshold and t.gain >= SURE]
        found = max(sound, key=lambda t: t.worth, default=None)

    # adjustables and law together, with the noise of twins that have the law
    progress("refining what was found", 0.78)
    size = max(float(left @ left) / max(len(left) - len(values), 1), 1.0)
    covariance = widened(np.linalg.pinv(nuisance.T @ nuisance) * size, nuisance, white, sum(len(w) for w in used))
    plain_covariance = covariance
    revised = hypothesis
    revised_values, after = values, bench

    def beyond_nulls(rest: np.ndarray) -> float:
        """Standard deviations by which the chi2 of whitened innovations is above the nulls'."""
        return float((rest @ rest - null_chi2.mean()) / null_chi2.std())

    unexplained = beyond_nulls(left)
    partner: BedTrial | None = None
    single: tuple[Hypothesis, np.ndarray] | None = None  # the first law alone, where there are two

    def still(rows: Prediction | None, judge: Bench) -> float:
        """Standard deviations of the nulls' chi2 that are left."""
        if rows is None:
            return unexplained
        return beyond_nulls(off(nuisance, judge.white(rows, used)))

    if found is not None:
        revised = hypothesis.with_term(found.term)
        readjusted = _readjusted(bench, hypothesis, values, nuisance, found, used)
        revised_values, covariance, found, after, columns = _polish(
            bench, hypothesis, readjusted, found, used, clock.late(0.85), clock.late(0.7), plan, len(values)
        )
        if not beyond_nothing(found):
            notes.append(f"{found.mechanism}: in the last fit its numbers are within three standard errors of none")
            found, covariance = None, plain_covariance
            revised, revised_values, after = hypothesis, values, bench
    if found is not None:
        rows = after.predict([(revised, revised_values)], used)[0]
        unexplained = still(rows, after)
        more = unexplained > UNEXPLAINED and wrong is None and found.mechanism != "unknown"
        if more and columns is not None and rows is not None and not clock.late(0.8):
            progress("a second law", 0.80)
            search = Search(after, revised, revised_values, rows, columns, used, few, at, plan, clock, progress)
            partner = _second_law(search, found, signatures, rng)
        if partner is not None:
            single, alone = (revised, revised_values), (covariance, found, after, unexplained)
            revised_values, covariance, partner, after, _ = _polish(
                bench, revised, revised_values, partner, used, clock.late(0.87), clock.late(0.7), plan, len(values)
            )
            revised = revised.with_term(partner.term)
            part = slice(len(values), len(values) + len(found.values))
            found = _moved_to(found, revised_values[part], covariance[part, part])
            unexplained = still(after.predict([(revised, revised_values)], used)[0], after)

    # the flexible arms, where something is left that no law with a name explains
    arm: BedTrial | None = None
    if unexplained > UNEXPLAINED and p <= ALARM:
        if clock.late(0.86):
            notes.append("flexible arms were not tried: the time was up")
        else:
            progress("flexible arms", 0.84)
            arm = _flexible(bench, hypothesis, values, base, nuisance, used, few, at, plan, clock, progress)
            best_named = max((t.worth for t in trials if t.gain is not None), default=0.0)
            best_named += partner.worth if partner is not None else 0.0
            if found is not None and rows is not None:
                polished = off(nuisance, bench.white(rows, used))
                best_named = max(best_named, float(left @ left - polished @ polished))
            if arm is not None and arm.worth < max(best_named + SURE, 1.15 * best_named):
                notes.append(
                    f"a flexible arm ({arm.term.label}) gains {arm.gain:.0f} in chi2, no more than the laws with a name"
                )
                arm = None
            if arm is not None:
                found, partner, single, revised = arm, None, None, hypothesis.with_term(arm.term)
                revised_values, after = np.concatenate([values, arm.values]), bench
                covariance = np.full((len(revised_values),) * 2, np.nan)
                trials = [arm, *trials]

    # held-out windows are looked at only now
    progress("held-out windows", 0.88)
    every = [np.arange(len(b.starts)) for b in beds]
    wanted = [(naive, naive_values), (hypothesis, values), (revised, revised_values)]
    if found is None:
        wanted = wanted[:2]
    if single is not None:
        wanted.append(single)
    simulated = bench.predict(wanted, every)
    if partner is not None and single is not None and found is not None:
        # the second law has to earn its place on windows that it never saw
        with_both, with_one = simulated[2], simulated[3]
        earned = -math.inf if with_both is None or with_one is None else held_gain(bench, with_one, with_both)
        if earned <= LEAST_HELD and any(len(w) for w in bench.held):
            notes.append(f"{partner.mechanism} beside {found.mechanism} does not predict held-out windows better")
            (revised, revised_values), (covariance, found, after, unexplained) = single, alone
            partner = None
            simulated[2] = with_one
    predicted: dict[str, Prediction] = {}
    for label, rows in zip(("naive", "recalibrated", "revised"), [*simulated, *simulated[1:2]][:3], strict=True):
        if rows is not None:
            predicted[label] = rows
    train = {label: errors(bench, rows, used) for label, rows in predicted.items()}
    held = {label: errors(bench, rows, bench.held) for label, rows in predicted.items()}
    gain_held = None
    if found is not None and {"recalibrated", "revised"} <= set(predicted) and any(len(w) for w in bench.held):
        gain_held = held_gain(bench, predicted["recalibrated"], predicted["revised"])
        if gain_held <= LEAST_HELD:
            notes.append(f"{found.mechanism} does not predict the held-out windows better: it is not named")
            found, partner, covariance = None, None, plain_covariance
            predicted["revised"] = predicted["recalibrated"]
            train["revised"], held["revised"] = train["recalibrated"], held["recalibrated"]
            gain_held = None
    floor = (noise_floor(bench, used), noise_floor(bench, bench.held))
    rivals = [r for r in _rivals(found, trials) if partner is None or r[0].mechanism != partner.mechanism]
    if wrong is not None:
        # what was told beside a wrong scale is the second law; without the scale nothing is right
        predicted.setdefault("revised", predicted["recalibrated"])
        plain = bench.predict([(naive, values)], every)[0]
        if plain is None:
            predicted.pop("recalibrated")
            notes.append("with the picture as it is the scene cannot be run")
        else:
            predicted["recalibrated"] = plain
            gain_held = held_gain(bench, plain, predicted["revised"]) if any(len(w) for w in bench.held) else None
        trial = _scale_trial(bench, wrong, nuisance, plain, base, used)
        found, partner = trial, found
        trials = [trial, *trials]
        score = max(score, float(trial.gain or 0.0))
        p = float((1 + np.sum(null >= score)) / (REPLICATES + 1))
        train = {label: errors(bench, rows, used) for label, rows in predicted.items()}
        held = {label: errors(bench, rows, bench.held) for label, rows in predicted.items()}
        hypothesis = naive

    # verdict
    excess = {}
    for label, rows in predicted.items():
        # with a law found, the estimator's bias is that of twins that have the law
        judge = after if label == "revised" and found is not None else bench
        raw = label == "naive" or (wrong is not None and label == "recalibrated")
        rest = bench.white(rows, used) if raw else off(nuisance, judge.white(rows, used))
        excess[label] = beyond_nulls(rest)
    laws = [t for t in (found, partner) if t is not None]
    verdict = _verdict(laws, unexplained, bench, naive_base, base, values, naive_values, covariance, used)
    strayed = astray(bench) if not laws else None
    if strayed is not None:
        verdict, p = "unmodelled", min(p, max(strayed.place.p, 1 / (REPLICATES + 1)))
        notes.append(strayed.text)
    shown = "naive" if verdict == "recalibrate" else "recalibrated"
    places: list[Place] = []
    if verdict != "no_mismatch" and shown in predicted:
        places = locate(bench, predicted[shown], every)
        if strayed is not None:
            places.insert(0, strayed.place)
    proposal = None
    if found is not None and rivals and wrong is None and not clock.late(0.93):
        progress("the next experiment", 0.93)
        proposal = propose(bench, hypothesis, values, found, rivals[0][0], used)
    progress("done", 1.0)
    store.forget()
    return BedDiagnosis(
        bench, verdict, adjustables, naive_values, values, revised_values[: len(values)],
        covariance[: len(values), : len(values)], found, partner, rivals, trials, null, score, p, train, held,
        floor, gain_held, places, proposal, predicted, excess, notes, clock.spent, bench.runs, seed, strayed,
    )  # fmt: skip


# ---- steps -----------------------------------------------------------------------------------


def windows_of(recordings: Sequence[Recording], hold_out: Sequence[Recording], seed: int, most: int) -> list[BedCase]:
    """Windows of all recordings, training first."""
    for r in (*recordings, *hold_out):
        check_bed(r.scene, r.name)
    if hold_out:
        training, held = list(recordings), list(hold_out)
    else:
        names = choose_held_out(recordings)
        training = [r for r in recordings if r.name not in names]
        held = [r for r in recordings if r.name in names]
    if not training:
        raise InputError("every recording is held out: nothing is left to learn from")
    beds = [bed_case(r, split=not held, seed=seed, most=most) for r in training]
    return beds + [bed_case(r, held_out=True, seed=seed, most=most) for r in held]


def _any(bench: Bench) -> list[np.ndarray]:
    return [np.arange(len(b.starts)) for b in bench.beds]


def _wanted_terms(beds: Sequence[BedCase], hypothesis: Hypothesis, candidates: Sequence[str] | None) -> list[Term]:
    learnt = [b.case for b in beds if b.training.any()]
    terms = [*bed_terms(learnt), across_term(learnt[0])]
    taken = {f.name for f in hypothesis.free}
    terms = [t for t in terms if not any(f.name in taken for f in t.free)]
    return terms if candidates is None else [t for t in terms if t.mechanism in candidates]


def _recalibrate(
    bench: Bench, hypothesis: Hypothesis, values: np.ndarray, base: Prediction, windows: Windows
) -> tuple[np.ndarray, Prediction, np.ndarray]:
    """One Gauss-Newton step: values, predictions with them, whitened columns (n, p) of the adjustables."""
    if not len(values):
        return values, base, np.zeros((len(bench.white(base, windows)), 0))
    wanted, ends = [], []
    for k, f in enumerate(hypothesis.free):
        # chaos forgives no small step: a tenth of the range to either side
        for side in (-0.1, 0.1):
            moved = values.copy()
            moved[k] = float(np.clip(values[k] + side * (f.high - f.low), f.low, f.high))
            ends.append(moved[k])
            wanted.append((hypothesis, moved))
    try:
        predicted = bench.predict_surely(wanted, windows)
        columns = np.column_stack(
            [
                bench.change(predicted[2 * k + 1], predicted[2 * k], windows) / (ends[2 * k + 1] - ends[2 * k])
                for k in range(len(values))
            ]
        )
        change = np.linalg.lstsq(columns, bench.white(base, windows), rcond=1e-10)[0]
        low, high = np.array([(f.low, f.high) for f in hypothesis.free]).T
        new = np.clip(values + change, low, high)
        return new, bench.predict_surely([(hypothesis, new)], windows)[0], columns
    except Failed:
        raise InputError("the scene cannot be run with other values of its adjustables") from None


def signature_of(
    bench: Bench, hypothesis: Hypothesis, values: np.ndarray, base: Prediction, nuisance: np.ndarray, term: Term,
    windows: Windows, members: int,
) -> BedSignature | None:  # fmt: skip
    """Columns of a term, each from an amount that changes the prediction by about a standard deviation.

    ``base``: see ``_apart``.
    """
    extended = hypothesis.with_term(term)
    low, high = limits(term)

    def shown(amounts: Sequence[float], k: int) -> list[Prediction | None]:
        """With these amounts of number k; the scene without the term where that is none."""
        numbers = [to_values(term, amount * np.eye(len(term.free))[k]) for amount in amounts if amount]
        wanted = [(extended, np.concatenate([values, n])) for n in numbers]
        found = bench.predict(wanted, windows, members, bench.members)
        return found if all(amounts) else [*found, base]

    tried, other, columns = [], [], []
    for k in range(len(term.free)):
        sign = 1.0 if high[k] > 1e-9 else -1.0
        if term.mechanism == "weak_joint":
            sign = -1.0
        most = 0.8 * (high[k] if sign > 0 else -low[k])
        amount = min(1.0, most)
        kept: tuple[float, float, np.ndarray] | None = None
        smallest_failed = math.inf
        for _ in range(3):
            there = sign * amount
            # to both sides where there is room: what is even in the amount falls out, and half of the chaos
            back = float(np.clip(-there, low[k], high[k]))
            back = back if abs(back) > 0.5 * amount else 0.0
            after, before = shown([there, back], k)
            if after is None or before is None:
                smallest_failed = amount
                amount *= 0.15
                continue
            change = bench.change(after, before, windows)
            kept = there, back, change / (there - back)
            size = float(np.sqrt(np.mean(change**2)))
            if size < RESPONSE[0]:
                factor = 8.0 if size < 0.3 * RESPONSE[0] else 3.0
            elif size > RESPONSE[1]:
                factor = 0.25 if size > 3 * RESPONSE[1] else 0.5
            else:
                break
            wider = min(amount * factor, most, 0.9 * smallest_failed)
            if abs(wider / amount - 1) < 0.1:
                break
            amount = wider
        if kept is None:
            return None
        tried.append(kept[0])
        other.append(kept[1])
        columns.append(kept[2])
    return make_signature(term, np.array(tried), np.column_stack(columns), nuisance, np.array(other))


def _apart(
    bench: Bench, hypothesis: Hypothesis, values: np.ndarray, windows: Windows, members: int
) -> Prediction:
    """The prediction that signatures are changes of, by members of their own.

    With the members of the innovations, the chaos of these would be in both and look like every candidate.
    """
    return bench.predict_surely([(hypothesis, values)], windows, members, bench.members)[0]


def _trial(signature: BedSignature, amounts: np.ndarray, linear: float, gain: float | None) -> BedTrial:
    term = signature.term
    scales = np.array([f.scale for f in term.free])
    covariance = np.linalg.pinv(signature.clear.T @ signature.clear) * np.outer(scales, scales)
    return BedTrial(signature, amounts, to_values(term, amounts), covariance, linear, gain)


def as_in_twins(
    bench: Bench, trials: Sequence[BedTrial], windows: Windows, nuisance: np.ndarray, left: np.ndarray, members: int
) -> tuple[list[BedTrial], float]:
    """The first trials with what the same columns, made of each twin's own starts, give in twins taken off.

    A start has errors, and columns made of it have them too: where it is too fast, a loss gains. In twins, which lack
    nothing, the mean amount is that bias. Returns the trials in their order, and by how much the gains of twins are
    wider so than with the columns of the film (1 at least). Raises Failed.
    Source: Fuller 1987, Measurement Error Models, ch. 1 (errors in the regressors).
    """
    assert bench.twin_scene is not None
    hypothesis, values = bench.twin_scene
    leading = list(trials[:LEANING])
    wanted = [(hypothesis, values)]
    ends: list[list[tuple[int, int]]] = []  # of each number of each trial: the views that its column is made of
    for t in leading:
        mine = []
        for k, pair in enumerate(zip(t.signature.tried, t.signature.other, strict=True)):
            at = []
            for amount in pair:
                at.append(len(wanted) if amount else 0)
                if amount:
                    numbers = to_values(t.term, amount * np.eye(len(t.amounts))[k])
                    wanted.append((hypothesis.with_term(t.term), np.concatenate([values, numbers])))
            mine.append((at[0], at[1]))
        ends.append(mine)
    views = bench.twin_views(wanted, windows, members, bench.members)
    films = off(nuisance, whole_films(bench.noises, windows))
    number = min(films.shape[1], len(views))
    done, own, cross = [], 0.0, 0.0
    for t, mine in zip(leading, ends, strict=True):
        answers, shapes = [], []
        after, before = np.array(mine).T
        for k in range(number):
            columns = (views[k][:, after] - views[k][:, before]) / (t.signature.tried - t.signature.other)
            clear = off(nuisance, columns)
            answers.append(np.linalg.lstsq(clear, films[:, k], rcond=1e-8)[0])
            shapes.append(clear)
        bias = np.mean(answers, axis=0)
        amounts, gain = t.signature.best((left - t.signature.clear @ bias)[:, None])
        done.append(_trial(t.signature, amounts[:, 0], float(gain[0]), None))
        scatter = [float(np.sum((c @ (a - bias)) ** 2)) for a, c in zip(answers, shapes, strict=True)]
        # of a mean of so many, and of the film's own answer beside it
        own += float(np.mean(scatter)) * (number + 1) / (number - 1)
        q = basis(t.signature.clear)
        cross += float(np.mean(np.sum((q.T @ films) ** 2, axis=0)))
    return [*done, *trials[LEANING:]], max(own / cross, 1.0) if cross > 0 else 1.0


def thinned(windows: Windows, share: float) -> list[np.ndarray]:
    """About that share of the windows of each recording, spread evenly, four at least."""
    result = []
    for w in windows:
        count = min(len(w), max(math.ceil(share * len(w)), 4))
        result.append(w[np.unique(np.round(np.linspace(0, len(w) - 1, count)).astype(int))] if len(w) else w)
    return result


def positions(bench: Bench, windows: Windows, chosen: Windows) -> np.ndarray:
    """Rows that ``chosen`` windows have in stacked numbers of all ``windows``."""
    rows, start = [], 0
    for bed, every, some in zip(bench.beds, windows, chosen, strict=True):
        index = start + np.arange(len(every) * bed.size).reshape(len(every), bed.size)
        rows.append(index[np.isin(every, some)].ravel())
        start += len(every) * bed.size
    return np.concatenate(rows)


@dataclass
class Search:
    """Leaders refitted by simulation around the recalibrated scene: many roughly, the best of them well."""

    bench: Bench
    hypothesis: Hypothesis
    values: np.ndarray
    base: Prediction
    nuisance: np.ndarray
    used: Windows
    few: Windows
    at: np.ndarray
    plan: Plan
    clock: Clock
    progress: Progress

    def leaders(self, trials: list[BedTrial], bed: BedCase) -> list[BedTrial]:
        """Trials with the gains of those that were refitted, in all training windows."""
        most = trials[0].linear
        chosen = [t for k, t in enumerate(trials) if k == 0 or t.linear > max(8.0, 0.12 * most)]
        chosen = _with_clock(chosen[: 2 * self.plan.leaders], trials)
        rough = []
        for k, t in enumerate(chosen):
            self.progress(f"refitting {t.term.label}", 0.64 + 0.06 * k / len(chosen))
            if k >= 2 and self.clock.late(0.78):
                break
            rough.append(self.refit(t, self.few, self.nuisance[self.at], self.plan.screening, ROUGH))
        rough.sort(key=lambda t: -t.worth)
        best = [t for k, t in enumerate(rough) if k == 0 or t.worth > 0.3 * rough[0].worth][: self.plan.leaders]
        # other exponents of a law that leads, and fewer bodies
        for t in list(best[:2]):
            for term in siblings(t.term, bed.scene):
                if not self.clock.late(0.8):
                    other = self.refit(replace(t, signature=replace(t.signature, term=term)), self.few,
                                       self.nuisance[self.at], self.plan.screening, (0.7, 1.0, 1.4))  # fmt: skip
                    rough.append(other)
                    best.append(other)
        best = _two_forms(sorted(best, key=lambda t: -t.worth))[: max(self.plan.leaders - 2, 2)]
        best = _with_clock(best, rough)
        done = []
        for k, t in enumerate(best):
            self.progress(f"refitting {t.term.label}, all windows", 0.70 + 0.08 * k / len(best))
            if k < 1 or not self.clock.late(0.84):
                done.append(self.refit(t, self.used, self.nuisance, self.bench.members, FINE))
        done = no_narrower(done)
        # the best form of each is kept; gains in few windows are not comparable
        known = {t.term.label for t in done}
        rest: list[BedTrial] = []
        for t in (*best, *rough, *trials):
            if t.term.label not in known:
                known.add(t.term.label)
                rest.append(replace(t, gain=None))
        return done + rest

    def chi2(self, predicted: Prediction, windows: Windows, nuisance: np.ndarray, members: int) -> float:
        rest = off(nuisance, self.bench.white(predicted, windows, members))
        return float(rest @ rest)

    def refit(
        self, trial: BedTrial, windows: Windows, nuisance: np.ndarray, members: int, shares: Sequence[float]
    ) -> BedTrial:
        """Simulate along the direction of the amounts and take the best of a parabola through chi2."""
        extended = self.hypothesis.with_term(trial.term)
        low, high = limits(trial.term)
        start = trial.amounts if np.any(trial.amounts) else trial.signature.tried
        chi2 = {0.0: self.chi2(self.base, windows, nuisance, members)}

        def measure(more: Sequence[float]) -> None:
            more = [s for s in dict.fromkeys(more) if s not in chi2]
            amounts = [np.clip(start * s, low, high) for s in more]
            rows = self.bench.predict(
                [(extended, np.concatenate([self.values, to_values(trial.term, a)])) for a in amounts],
                windows,
                members,
            )
            for share, predicted in zip(more, rows, strict=True):
                if predicted is not None:
                    chi2[share] = self.chi2(predicted, windows, nuisance, members)

        measure(shares)
        for _ in range(2):
            best = min(chi2, key=lambda s: chi2[s])
            if best == 0.0:
                measure([0.4 * min(s for s in (*chi2, *shares) if s > 0)])
            elif best == max(chi2):
                measure([1.7 * best])
            else:
                break
        if len(chi2) < 2:
            return replace(trial, gain=0.0)
        share, lowest = smooth_minimum(chi2)
        amounts = np.clip(start * (share or 1e-3), low, high)
        return _trial(trial.signature, amounts, trial.linear, chi2[0.0] - lowest)


    def turned(self, trial: BedTrial) -> BedTrial | None:
        """A step of least squares in all numbers of the term from where it is, and a refit along what that gives."""
        extended, neutral = self.hypothesis.with_term(trial.term), np.zeros(len(trial.amounts))
        low, high = limits(trial.term)
        ends = []
        for k, h in enumerate(np.abs(trial.signature.tried)):
            step = neutral.copy()
            step[k] = h
            ends += [np.clip(trial.amounts - step, low, high), np.clip(trial.amounts + step, low, high)]
        predicted = self.bench.predict(
            [(extended, np.concatenate([self.values, to_values(trial.term, a)])) for a in (trial.amounts, *ends)],
            self.used,
        )
        here, pairs = predicted[0], list(zip(predicted[1::2], predicted[2::2], strict=True))
        if here is None or any(a is None or b is None for a, b in pairs):
            return None
        columns = np.column_stack(
            [
                self.bench.change(after, before, self.used) / (ends[2 * k + 1][k] - ends[2 * k][k])
                for k, (before, after) in enumerate(pairs)
                if before is not None and after is not None
            ]
        )
        clear = off(self.nuisance, columns)
        change = np.linalg.lstsq(clear, off(self.nuisance, self.bench.white(here, self.used)), rcond=1e-8)[0]
        amounts = np.clip(trial.amounts + change, low, high)
        signature = replace(trial.signature, columns=columns, clear=clear)
        moved = replace(trial, amounts=amounts, signature=signature)
        return self.refit(moved, self.used, self.nuisance, self.bench.members, (0.6, 1.0, 1.4))


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
        return all(t.worth > o.worth + SAME for o in alike if set(o.term.bodies or ()) > set(t.term.bodies or ()))

    return [t for t in trials if needed(t)]


def smooth_minimum(chi2: Mapping[float, float]) -> tuple[float, float]:
    """Where a parabola through the points about the lowest has its minimum, and how low that is.

    Each chi2 carries the bed's chaos: the lowest of several would flatter. Without a minimum: the lowest point.
    """
    best = min(chi2, key=lambda s: chi2[s])
    near = sorted((s for s in chi2 if best == 0.0 or 0.35 * best <= s <= 2.2 * best), key=lambda s: abs(s - best))
    if len(near) < 3:
        near = sorted(chi2, key=lambda s: abs(s - best))[:3]
    if len(near) >= 3:
        x, y = np.array(near[:6]), np.array([chi2[s] for s in near[:6]])
        fitted = np.polyfit(x, y, 2)
        if fitted[0] > 0:
            share = float(np.clip(-fitted[1] / (2 * fitted[0]), x.min(), x.max()))
            lowest = float(np.polyval(fitted, share))
            # a parabola that undercuts all points by much fits badly
            return share, max(lowest, float(y.min()) - 0.1 * abs(chi2.get(0.0, y.max()) - float(y.min())))
    return best, chi2[best]


def _readjusted(
    bench: Bench, hypothesis: Hypothesis, values: np.ndarray, nuisance: np.ndarray, trial: BedTrial, windows: Windows
) -> np.ndarray:
    """Adjustables moved, to first order, to where they belong once the law is there."""
    if not len(values):
        return values
    full = hypothesis.with_term(trial.term)
    predicted = bench.predict([(full, np.concatenate([values, trial.values]))], windows)[0]
    if predicted is None:
        return values
    low, high = np.array([(f.low, f.high) for f in hypothesis.free]).T
    change = np.linalg.lstsq(nuisance, bench.white(predicted, windows), rcond=1e-10)[0]
    reach = 0.15 * (high - low)
    return np.clip(values + np.clip(change, -reach, reach), low, high)


def _polish(
    bench: Bench,
    hypothesis: Hypothesis,
    values: np.ndarray,
    trial: BedTrial,
    windows: Windows,
    hurried: bool,
    late: bool,
    plan: Plan,
    adjusted: int,
) -> tuple[np.ndarray, np.ndarray, BedTrial, Bench, np.ndarray | None]:
    """Adjustables and laws together, with the bias of twins that have the laws.

    The estimator's bias depends on the physics, and the first-order step from a scene without the law falls short.
    ``hypothesis``, ``values``: what is there beside the law of ``trial``; the first ``adjusted`` are adjustables.
    Returns values of all, their covariance, the trial, the bench of those twins, and its whitened columns.
    """
    full = hypothesis.with_term(trial.term)
    z = np.concatenate([values, trial.values])
    n = len(values)
    free = full.free
    rough = np.full((len(z), len(z)), np.nan)
    rough[n:, n:] = trial.covariance
    if hurried:
        return z, rough, trial, bench, None
    second = bench.with_twins(max(min(plan.twins - 2, 6), 3))
    told: np.ndarray | None = None
    steps = np.array([0.1 * (f.high - f.low) for f in free[:adjusted]] + [
        0.4 * abs(v - f.neutral) if abs(v - f.neutral) > 0.1 * f.scale else 0.3 * f.scale
        for v, f in zip(z[adjusted:], free[adjusted:], strict=True)
    ])  # fmt: skip
    low, high = np.array([(f.low, f.high) for f in free]).T
    try:
        second.make_twins(full, z)
        if not late:
            told = _told_by_twins(second, full, z, steps, windows)
        bias = 0.0 if told is None else told.mean(axis=0)
        for _ in range(3):
            # to both sides: a base that the columns share with the innovations would push along its own chaos
            ends, spans = _both_sides(full, z, steps)
            predicted = second.predict_surely([(full, z), *((full, end) for end in ends)], windows)
            columns = np.column_stack(
                [
                    second.change(predicted[2 * k + 2], predicted[2 * k + 1], windows) / span
                    for k, span in enumerate(spans)
                ]
            )
            white = second.white(predicted[0], windows)
            steered, away = _bias_follows(bench, second, columns, windows, trial, n, z)
            answer = np.linalg.lstsq(columns, white, rcond=1e-10)[0]
            change = steered @ (answer - away - bias)
            # never further than the columns were taken
            change = np.clip(change, -1.5 * spans / 2, 1.5 * spans / 2)
            before, z = z, np.clip(z + change, low, high)
            if np.all(np.abs(z - before) < 0.15 * spans):
                break
    except (Failed, np.linalg.LinAlgError, ZeroDivisionError):
        return np.concatenate([values, trial.values]), rough, trial, bench, None
    # the twins' covariance is measured, not known, and columns carry the bed's chaos
    rest = white - columns @ answer
    size = max(float(rest @ rest) / max(len(white) - len(z), 1), 1.0)
    covariance = widened(np.linalg.pinv(columns.T @ columns) * size, columns, white, sum(len(w) for w in windows))
    if told is None:
        # the columns of the film in place of those of each twin
        told = np.linalg.lstsq(columns, whole_films(second.noises, windows), rcond=1e-10)[0].T
    covariance = steered @ as_twins_scatter(covariance, told) @ steered.T
    return z, covariance, _moved_to(trial, z[n:], covariance[n:, n:]), second, columns


def _both_sides(full: Hypothesis, z: np.ndarray, steps: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Each number of ``z`` a step lower and a step higher, within bounds: (2p numbers in turn), and the spans (p,)."""
    low, high = np.array([(f.low, f.high) for f in full.free]).T
    pairs = [(np.clip(z - h, low, high), np.clip(z + h, low, high)) for h in np.diag(steps)]
    spans = np.array([after[k] - before[k] for k, (before, after) in enumerate(pairs)])
    return [end for pair in pairs for end in pair], spans


def _told_by_twins(
    bench: Bench, full: Hypothesis, z: np.ndarray, steps: np.ndarray, windows: Windows
) -> np.ndarray:
    """Answers (N, p) of twins of ``z``, each with columns of its own starts.

    The truth of twins is known: the mean is the bias of least squares whose columns have the errors of the starts.
    """
    ends, spans = _both_sides(full, z, steps)
    views = bench.twin_views([(full, end) for end in ends], windows, bench.members)
    films = whole_films(bench.noises, windows)
    return np.array(
        [
            np.linalg.lstsq((shown[:, 1::2] - shown[:, ::2]) / spans, film, rcond=1e-10)[0]
            for shown, film in zip(views, films.T, strict=False)
        ]
    )


def _bias_follows(
    bench: Bench, second: Bench, columns: np.ndarray, windows: Windows, trial: BedTrial, n: int, z: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How the estimator's bias, which grows with the law, changes a step: change = M (least squares - away).

    The twins of ``second`` have the law as strong as in ``trial``, those of ``bench`` have none; between and beyond
    the bias b is linear in the first number of the law: b = b_1 + (b_1 - b_0) (z - z_1)/(z_1 - neutral). (Grains that
    roll, say: no film shows their spin, so each window begins without.)
    """
    parts = []
    for after, before, seen, chosen in zip(second.noises, bench.noises, bench.seen, windows, strict=True):
        hidden = np.where(np.isfinite(seen), 0.0, np.nan)
        parts.append(after.whiten(after.bias - before.bias + hidden, chosen).ravel())
    size = len(z)
    strength = float(trial.values[0] - trial.term.free[0].neutral)
    if strength == 0.0:
        return np.eye(size), np.zeros(size)
    slope = np.linalg.lstsq(columns, np.concatenate(parts), rcond=1e-10)[0] / strength
    # what would more than triple a step is not believed
    if 1.0 + slope[n] < 1.0 / 3.0:
        slope = slope * (-2.0 / 3.0 / slope[n])
    along = np.zeros((size, size))
    along[:, n] = slope
    return np.linalg.inv(np.eye(size) + along), slope * float(z[n] - trial.values[0])


def astray(bench: Bench) -> Strayed | None:
    """Whether swimmer or grains move at another pace than in whole films simulated from the same start.

    Windows start from what was seen: a swimmer that is stuck stays stuck in them. Student's t of the logarithm of the
    rms speed among those of twins, corrected for the number of looks; None where all is as it should be.
    """
    worst: Strayed | None = None
    looks = 2 * len(bench.beds)
    for bed, predictor, paces in zip(bench.beds, bench.predictors, bench.paces, strict=True):
        number, seen = len(paces), predictor.pace()
        if number < 3 or not bed.training.any():
            continue
        swimmer = tuple(bed.scene.bodies[int(r)].id for r in bed.rows)
        movers = (("swimmer", swimmer, "the swimmer moves"), ("grains farther from the swimmer", (), "the grains move"))
        for k, (region, ids, what) in enumerate(movers):
            if not (seen[k] > 0 and (paces[:, k] > 0).all()):
                continue
            logs = np.log(paces[:, k])
            away = math.log(seen[k]) - float(logs.mean())
            t = away / (max(float(logs.std(ddof=1)), LEAST_SPREAD) * math.sqrt(1 + 1 / number))
            p = min(2.0 * float(stats.t.sf(abs(t), number - 1)) * looks, 1.0)
            if p > 0.1 * ALARM or (worst is not None and p >= worst.place.p):
                continue
            low, high = 1e3 * float(paces[:, k].min()), 1e3 * float(paces[:, k].max())
            worst = Strayed(
                Place(ids, region, None, None, None, abs(t), p),
                f"{bed.name}: over the whole film {what} at {1e3 * seen[k]:.3g} mm/s rms, "
                f"in films simulated from the same start at {low:.3g} to {high:.3g} mm/s; short windows, which begin "
                "with what was seen, do not show why",
            )
    return worst


def beyond_nothing(trial: BedTrial) -> bool:
    """Whether the numbers of a law are three standard errors from those with which it is absent."""
    away = trial.values - np.array([f.neutral for f in trial.term.free])
    if not np.isfinite(trial.covariance).all():
        return True
    chi2 = float(away @ np.linalg.pinv(trial.covariance) @ away)
    return chi2 > float(stats.chi2.isf(2 * stats.norm.sf(3.0), len(away)))


def _moved_to(trial: BedTrial, values: np.ndarray, covariance: np.ndarray) -> BedTrial:
    """The trial with other numbers."""
    scales = np.array([f.scale for f in trial.term.free])
    neutral = np.array([f.neutral for f in trial.term.free])
    return replace(trial, values=values, amounts=(values - neutral) / scales, covariance=covariance)


def _second_law(
    search: Search, found: BedTrial, signatures: Sequence[BedSignature], rng: np.random.Generator
) -> BedTrial | None:
    """What gains most beside the law that was found, beyond what the same search gives in nulls; or None.

    ``search``: about the scene with that law; its ``nuisance`` has the columns of adjustables and law.
    """
    bench, few = search.bench, search.few
    beside = search.nuisance[search.at]
    left = off(beside, bench.white(search.base, few))
    drawn = off(beside, recombined(bench.noises, few, REPLICATES, rng))
    null = np.zeros(REPLICATES)
    others: list[BedSignature] = []
    order: list[tuple[float, BedSignature]] = []
    for s in signatures:
        if s.term.label == found.term.label or s.term.mechanism == "unknown":
            continue
        other = make_signature(s.term, s.tried, s.columns, beside, s.other)
        null = np.maximum(null, other.best(drawn)[1])
        others.append(other)
        order.append((float(other.best(left[:, None])[1][0]) - 2.0 * len(s.term.free), s))
    null *= coherence(others, off(beside, whole_films(bench.noises, few)), drawn) * unsure(bench, rng)
    threshold = max(float(np.quantile(null, 1 - ALARM)), SURE)
    try:
        apart = _apart(bench, search.hypothesis, search.values, few, search.plan.screening)
    except Failed:
        return None
    order.sort(key=lambda item: -item[0])
    trials = []
    for gain, s in order[:SECONDS]:
        if gain < 0.5 * threshold or search.clock.late(0.82):
            break
        search.progress(f"beside it: {s.term.label}", 0.80)
        signature = signature_of(
            bench, search.hypothesis, search.values, apart, beside, s.term, few, search.plan.screening
        )
        if signature is not None:
            amounts, linear = signature.best(left[:, None])
            trials.append(_trial(signature, amounts[:, 0], float(linear[0]), None))
    trials = sorted((t for t in trials if t.linear > threshold), key=lambda t: -t.worth)[:3]
    done = [search.refit(t, search.used, search.nuisance, bench.members, FINE) for t in trials]
    done = [t for t in done if (t.gain or 0.0) > threshold]
    return max(done, key=lambda t: t.worth, default=None)


def unsure(bench: Bench, rng: np.random.Generator) -> np.ndarray:
    """(REPLICATES,) factors on gains of nulls: the spread along one direction is known from few samples.

    nu/chi2_nu with nu = (twins - 1) windows, what makes chi2 with a known spread Hotelling's T^2 with a measured one.
    Source: Hotelling 1931, Ann. Math. Stat. 2, 360.
    """
    known = sum((len(noise.twins) - 1) * len(b.starts) for b, noise in zip(bench.beds, bench.noises, strict=True))
    known = max(known, 3)
    return known / rng.chisquare(known, REPLICATES)


def widened(covariance: np.ndarray, columns: np.ndarray, white: np.ndarray, windows: int) -> np.ndarray:
    """The covariance, no narrower than the scatter of the answers when windows are left out in turn.

    Columns carry the bed's chaos, which least squares takes for exact.
    Source: Efron & Stein 1981, Ann. Stat. 9, 586 (jackknife variance).
    """
    if windows < 3 or not columns.shape[1]:
        return covariance
    answers = []
    for k in range(windows):
        kept = np.ones(len(white), dtype=bool)
        kept[k * (len(white) // windows) : (k + 1) * (len(white) // windows)] = False
        answers.append(np.linalg.lstsq(columns[kept], white[kept], rcond=1e-10)[0])
    scatter = (windows - 1) * np.var(np.array(answers), axis=0)
    # few windows know their own scatter badly: Student's t in place of the normal 95 %
    student = float(stats.t.ppf(0.975, windows - 1) / stats.norm.ppf(0.975))
    factor = student * np.sqrt(np.maximum(scatter / np.maximum(np.diag(covariance), 1e-300), 1.0))
    return covariance * np.outer(factor, factor)


def as_twins_scatter(covariance: np.ndarray, answers: np.ndarray) -> np.ndarray:
    """The covariance, no narrower than the scatter of the answers (N, p) that twins give, whose truth is known.

    Source: Efron & Tibshirani 1993, An Introduction to the Bootstrap, ch. 6 (parametric bootstrap).
    """
    number = len(answers)
    if number < 3:
        return covariance
    scatter = np.var(answers, axis=0, ddof=1) * (1 + 1 / number)
    student = float(stats.t.ppf(0.975, number) / stats.norm.ppf(0.975))
    factor = np.sqrt(np.maximum(student**2 * scatter / np.maximum(np.diag(covariance), 1e-300), 1.0))
    return covariance * np.outer(factor, factor)


def errors(bench: Bench, predicted: Prediction, windows: Windows) -> Errors:
    """Of the swimmer's disks after the start, in the chosen windows."""
    parts = []
    for bed, rows, chosen in zip(bench.beds, bench.innovations(predicted), windows, strict=True):
        disks = rows[chosen][:, : bed.swimmer_size].reshape(len(chosen), len(bed.looks), 2 * len(bed.rows))
        parts.append(disks[:, 1:].ravel())
    flat = np.concatenate(parts)
    flat = flat[np.isfinite(flat)]
    if not len(flat):
        return Errors(None, None)
    white = bench.white(predicted, windows)
    return Errors(float(np.sqrt(np.mean(flat**2))), float(np.mean(white**2)))


def held_gain(bench: Bench, before: Prediction, after: Prediction) -> float:
    """Half the fall in chi2 of the held-out windows."""
    return 0.5 * float(np.sum(bench.white(before, bench.held) ** 2) - np.sum(bench.white(after, bench.held) ** 2))


def noise_floor(bench: Bench, windows: Windows) -> float:
    """What perfect knowledge of the physics would leave [m rms]: the twins' own errors, of the disks."""
    parts = []
    for bed, noise, chosen in zip(bench.beds, bench.noises, windows, strict=True):
        rows = noise.residuals[:, chosen][:, :, : bed.swimmer_size]
        parts.append(rows.reshape(*rows.shape[:2], len(bed.looks), 2 * len(bed.rows))[:, :, 1:].ravel())
    flat = np.concatenate(parts)
    flat = flat[np.isfinite(flat)]
    return float(np.sqrt(np.mean(flat**2))) if len(flat) else float("nan")


def _flexible(
    bench: Bench, hypothesis: Hypothesis, values: np.ndarray, base: Prediction, nuisance: np.ndarray, used: Windows,
    few: Windows, at: np.ndarray, plan: Plan, clock: Clock, progress: Progress,
) -> BedTrial | None:  # fmt: skip
    """The best of the arms that name nothing, refitted by simulation; None where none could be."""
    bed, predictor = bench.beds[0], bench.predictors[0]
    frames = bed.starts[used[0]]
    seen = bed.film.xy[frames][:, [*bed.rows, *bed.grains]].reshape(-1, 2)
    speeds = np.concatenate([predictor.sums(int(w)).weight for w in used[0]])
    white = off(nuisance[at], bench.white(base, few))
    apart = _apart(bench, hypothesis, values, few, plan.screening)
    arms: list[BedTrial] = []
    for term in flexible_terms(bed.case, seen[np.isfinite(seen[:, 0])], speeds if len(speeds) else np.array([0.1])):
        if arms and clock.late(0.9):
            break
        signature = signature_of(bench, hypothesis, values, apart, nuisance[at], term, few, plan.screening)
        if signature is not None:
            amounts, gain = signature.best(white[:, None])
            arms.append(_trial(signature, amounts[:, 0], float(gain[0]), None))
    search = Search(bench, hypothesis, values, base, nuisance, used, few, at, plan, clock, progress)
    arms.sort(key=lambda t: -(t.linear - 2.0 * len(t.term.free)))
    done = []
    for t in arms[:2]:
        refitted = search.refit(t, used, nuisance, bench.members, (0.6, 1.0, 1.6))
        # few windows tell the direction of five numbers badly
        for _ in range(2):
            if clock.late(0.92):
                break
            turned = search.turned(refitted)
            if turned is None or turned.worth < refitted.worth + SAME:
                break
            refitted = turned
        done.append(refitted)
    return max(done, key=lambda t: t.worth, default=None)


def _scale_trial(
    bench: Bench, wrong: PictureScale, nuisance: np.ndarray, without: Prediction | None, base: Prediction,
    windows: Windows,
) -> BedTrial:  # fmt: skip
    """The scale of the picture, as the swimmer shows it, as what was found."""
    free = wrong.term.free[0]
    amounts = np.array([(wrong.value - free.neutral) / free.scale])
    column, gain = np.zeros((len(nuisance), 1)), 1e6  # where it cannot be run without
    if without is not None:
        column = bench.change(base, without, windows)[:, None] / amounts
        gain = float(np.sum(bench.white(without, windows) ** 2) - np.sum(bench.white(base, windows) ** 2))
    signature = make_signature(wrong.term, amounts, column, nuisance)
    return BedTrial(signature, amounts, np.array([wrong.value]), np.array([[wrong.error**2]]), gain, gain)


def _verdict(laws, unexplained, bench, naive_base, base, values, naive_values, covariance, used) -> str:
    if laws:
        if laws[0].mechanism == "unknown":
            return "unmodelled"
        return "measurement" if all(t.mechanism in APPARATUS for t in laws) else "missing_physics"
    if unexplained > 2 * UNEXPLAINED:
        return "unmodelled"
    if len(values):
        naive, after = bench.white(naive_base, used), bench.white(base, used)
        improved = float(naive @ naive - after @ after)
        spread = np.sqrt(np.diag(covariance))
        moved = float(np.max(np.abs(values - naive_values) / np.maximum(spread, 1e-300)))
        if improved > SURE + 2 * len(values) and moved > 4.0:
            return "recalibrate"
    return "no_mismatch"


def _rivals(found: BedTrial | None, trials: Sequence[BedTrial]) -> list[tuple[BedTrial, bool]]:
    """Other laws that were refitted and come near, the best form of each, and whether d' is below 2."""
    if found is None:
        return []
    score = max((t.worth for t in trials if t.mechanism == found.mechanism and t.gain is not None), default=found.worth)
    seen = {(found.mechanism, *sorted(map(str, found.term.choices.items())))}
    names = {found.mechanism, "unknown"} if "joint" not in found.term.choices else {"unknown"}
    rivals = []
    for t in trials:
        key = (t.mechanism, *sorted(map(str, t.term.choices.items())))
        if t.gain is None or t.mechanism in names or key in seen or t.worth < 0.2 * score:
            continue
        seen.add(key)
        names.add(t.mechanism)
        rivals.append((t, bool(score - t.worth < SAME + CHAOS)))
    return rivals


def _with_clock(chosen: list[BedTrial], trials: list[BedTrial]) -> list[BedTrial]:
    """Where a late motor or a shifted clock is to be refitted, what would look the same is refitted beside it.

    To first order it may be far behind: a shift that is not small is no longer linear.
    """
    first = next((t for t in chosen if t.mechanism in (*LATE, "time_offset")), None)
    if first is None:
        return chosen
    # a motor that is late by tau looks like a clock that is ahead by it
    late = float(first.values[0]) * (-1.0 if first.mechanism == "time_offset" else 1.0)
    if late <= 0.0:
        return chosen
    at = chosen.index(first) + 1
    beside: list[BedTrial] = []
    for t in trials:
        if t.mechanism in (*LATE, "time_offset") and t.mechanism not in {c.mechanism for c in (*chosen, *beside)}:
            amount = (-late if t.mechanism == "time_offset" else late) / t.term.free[0].scale
            low, high = limits(t.term)
            beside.append(replace(t, amounts=np.clip(np.array([amount]), low, high)))
    return [*chosen[:at], *beside, *chosen[at:]]


def plainer_first(trials: list[BedTrial]) -> list[BedTrial]:
    """A law that becomes another one when some of its numbers are none has to gain more than that by more than chaos.

    Drag in still air is a flow of no speed.
    """
    if not trials or trials[0].gain is None:
        return trials
    name = SPECIAL_CASES.get(trials[0].mechanism)
    plain = next((t for t in trials if t.mechanism == name and t.gain is not None), None)
    if plain is None or trials[0].worth - plain.worth > SAME + CHAOS:
        return trials
    return [plain, *(t for t in trials if t is not plain)]


def _clock_before_motor(trials: list[BedTrial]) -> list[BedTrial]:
    """A late motor that a shifted clock imitates to within chaos: apparatus comes before physics."""
    if not trials or trials[0].gain is None or trials[0].mechanism not in LATE:
        return trials
    offset = next((t for t in trials if t.mechanism == "time_offset" and t.gain is not None), None)
    if offset is None or trials[0].worth - offset.worth > SAME + CHAOS:
        return trials
    return [offset, *(t for t in trials if t is not offset)]
