"""The diagnosis of free, pinned, sprung and colliding bodies, step by step."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import stats

from ..inference.criteria import Criteria, current
from ..inference.explained import Explained, Scores, explained
from ..inference.judge import Completeness, Judgement, Remains, accepted, completeness, remains_of
from ..inference.mechanisms import plainly
from ..inference.noise import Noise
from ..inference.significance import after_looks
from ..recording import Recording
from .blocks import Block, make_blocks, score
from .candidates import flexible_terms, named_terms, scaled_like
from .choose import POOR, REPLICATES, choose, left_over, prune, rivals_of, score_inner, worth
from .data import Case, prepare_all
from .experiment import Proposal, propose
from .fit import Fit, Fitter, joined
from .held_out import (
    Errors,
    held_out_errors,
    learn_memory,
    noise_floor,
    paired_verdict,
    right_law_errors,
    training_errors,
)
from .hypothesis import Hypothesis, Predictor, Term, adjustable_terms
from .innovations import Place, Whiteness, WindowMap, locate, memory_of, series_of, whiteness, window_map
from .intervals import with_believed_errors, with_limits
from .name import InnerSplit, Trial, is_apparatus, is_limit, label_of, refit, spread_of, try_candidates, unstuck
from .nulls import Null, noise_of, search_nulls
from .pairs import Exchange, drag_and_push, pair_of, price, rivals_of_pair, second_law, settled, third_law
from .settle import in_names_of_apparatus, that_earn_their_place, within_belief
from .signatures import Bank, make_bank
from .steps import HALVINGS, SHIFT, shifts, time_steps
from .whom import whom

Progress = Callable[[str, float], None]
FITS_END = 0.9  # of the budget, after which a fit ends with the best it has
BEYOND_FLOOR = 1.2  # times the noise floor that a held-out error is asked where it comes from


def _silent(text: str, share: float) -> None:
    return None


@dataclass
class TrackFinding:
    """Everything that was found in whole tracks; ``rival_held`` goes by mechanism."""

    cases: list[Case]
    naive: Fit
    recalibrated: Fit
    revised: Fit
    verdict: str
    found: list[Trial]
    rivals: list[tuple[Trial, bool]]
    trials: list[Trial]
    flexible: Trial | None
    null: Null | None
    white_naive: Whiteness
    white_recalibrated: Whiteness
    white_revised: Whiteness
    windows: WindowMap | None
    places: tuple[Place, ...]
    spread: float
    train: dict[str, Errors]
    held: dict[str, Errors]
    rival_held: dict[str, Errors]
    floor: tuple[float | None, float | None]
    right_law: np.ndarray  # held-out errors where the law is right and its numbers are found from noisy frames
    inner: dict[str, float]
    proposal: Proposal | None
    judged: Judgement
    complete: bool
    remains: Remains | None
    heldout: str | None
    closest: list[tuple[Trial, Explained]]  # named laws that were not accepted, with what they explain
    withdrawn: list[Trial]  # named laws that held-out data turned down
    withdrawn_held: Errors | None
    window: float | None
    notes: list[str] = field(default_factory=list)
    seconds: float = 0.0
    runs: int = 0
    seed: int = 0
    dropped_bodies: dict[str, str] = field(default_factory=dict)
    dt: dict[str, float] = field(default_factory=dict)


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
    rng: np.random.Generator
    progress: Progress
    late: Callable[[float], bool]  # whether that share of the budget is spent
    notes: list[str] = field(default_factory=list)

    def stop(self) -> bool:
        """Whether the time is up: fits then end where they stand."""
        return self.late(FITS_END)


@dataclass
class Tried:
    """All that was fitted alone: the scene as believed, recalibrated, and with each candidate in turn.

    alive : candidates that were refitted, ``untried`` those that were not;  arms : laws without a name
    spread : inflation of variances by what the ``best`` of all these fits leaves
    inner : score of each on later data inside the training part, by its label
    """

    naive: Fit
    recalibrated: Fit
    terms: list[Term]
    bank: Bank
    alive: list[Trial]
    untried: list[Trial]
    arms: list[Trial]
    best: Fit
    spread: float
    inner: dict[str, float]


def diagnose_bodies(
    recordings: Sequence[Recording],
    hold_out: Sequence[Recording] = (),
    *,
    minutes: float | None = None,
    seed: int = 0,
    progress: Progress = _silent,
) -> TrackFinding:
    """Explain all recordings together by one set of missing laws.

    ``minutes``: the budget; when it runs short, pairs, nulls and proposals are cut down and the notes say so.
    Raises InputError for recordings that cannot be used.
    """
    began = time.monotonic()

    def late(share: float) -> bool:
        return minutes is not None and time.monotonic() - began > 60 * minutes * share

    study = _study(recordings, hold_out, np.random.default_rng(seed), progress, late)
    cases, training, notes = study.cases, study.training, study.notes
    tried = _tried(study, *_calibrated(study))
    study, tried = _with_memory(study, tried)
    cases, training = study.cases, study.training
    naive, recalibrated = tried.naive, tried.recalibrated
    null, chosen = _beyond_nulls(study, tried)
    found, revised, dropped, near = _explained(study, tried, chosen)
    fitter = study.fitter
    if found and fitter.segmented:
        fitter, revised = joined(fitter, revised)
        found = [replace(t, fit=revised) for t in found]
    spread = spread_of(revised, training) if found else tried.spread
    if found:
        tried, fitter, found, revised = _finely(study, tried, fitter, found, revised, spread)
        naive, recalibrated = tried.naive, tried.recalibrated
    whites = [whiteness(fit, training, fit.numbers) for fit in (naive, recalibrated, revised)]
    study.progress("what explains", 0.72)
    weighed = _weighed(study, tried, found, revised)
    judged, found, revised, closest = _judged(study, tried, found, revised, spread, weighed)
    verdict = judged.verdict
    flexible = weighed.best_form
    taken = {t.mechanism for t in (*found, *(t for t, _ in near))}
    if len(found) > 1:
        rivals = [*near, *((t, False) for t in tried.alive if t.mechanism not in taken)][: max(3, len(near))]
    else:
        rivals = [*near, *(r for r in rivals_of(found, tried.alive, spread) if r[0].mechanism not in taken)]

    if found and verdict in ("missing_physics", "measurement"):
        revised = with_limits(fitter, revised, len(recalibrated.values), spread, lambda: late(0.75))
        revised = with_believed_errors(fitter, revised, spread)
        if revised.limits:
            names = ", ".join(revised.hypothesis.free[k].name for k in revised.limits)
            notes.append(f"{names} and the adjustables are known only together: their intervals are profiles of chi2")
    # innovations of short windows under the recalibrated scene
    study.progress("locating", 0.76)
    followed = revised if found else tried.best
    windows, places = _located(study, verdict, naive, recalibrated, followed, found)

    # looked at only now that the verdict is fixed
    study.progress("held-out data", 0.84)
    fits = {"naive": naive, "recalibrated": recalibrated, "revised": revised}
    train = {name: training_errors(fit, training) for name, fit in fits.items()}
    held = {name: _held_out(study, fit) for name, fit in fits.items()}
    scored = [t for t, _ in rivals] + [t for t, _ in closest]
    rival_held = {t.mechanism: _held_out(study, t.fit, whole=False) for t in scored if t.fit is not None}
    study.progress("noise floor", 0.92)
    floor = noise_floor(revised.hypothesis, revised, cases, study.predictor, study.stop, study.rng)

    right_law = np.zeros(0)
    rms = held["revised"].rms
    # beyond the floor there may be the errors of the numbers that were found, too
    if rms is not None and floor[1] and rms > BEYOND_FLOOR * floor[1] and len(revised.values) and not late(0.9):
        right_law = right_law_errors(revised.hypothesis, revised, cases, study.predictor, study.stop, study.rng)
    proposal = _proposed(study, found, rivals)
    heldout, withdrawn, withdrawn_held = None, list[Trial](), None
    if found and verdict in ("missing_physics", "measurement", "unmodelled"):
        heldout = paired_verdict(held["recalibrated"], held["revised"], study.rng)
    if heldout == "fails":
        study.notes.append(f"held-out data are predicted worse with {label_of(*found)} than without: it is withdrawn")
        withdrawn = found if verdict != "unmodelled" else []
        withdrawn_held = held["revised"]
        judged, verdict = Judgement("unmodelled", None, judged.free_form), "unmodelled"
        found, revised = [], recalibrated
        held["revised"], train["revised"] = held["recalibrated"], train["recalibrated"]
    # a mismatch that is real and was not explained is more than noise, however little of it shows in one place
    complete = weighed.completeness(revised, study).passes and (bool(found) or verdict != "unmodelled")
    remains = None
    if not complete and verdict not in ("no_mismatch", "recalibrate"):
        remains = _remains(study, tried, revised, weighed)
    study.progress("done", 1.0)
    failures = study.predictor.failures
    if len(failures) > 0.05 * study.predictor.runs:
        notes.append(f"{len(failures)} runs could not be finished, the first: {failures[0]}")
    return TrackFinding(
        cases=cases, naive=naive, recalibrated=recalibrated, revised=revised, verdict=verdict, found=found,
        rivals=rivals, trials=tried.alive + tried.untried,
        flexible=flexible or min(tried.arms, key=lambda t: t.inner, default=None),
        null=null, white_naive=whites[0], white_recalibrated=whites[1], white_revised=whites[2],
        windows=windows, places=places, spread=spread, train=train, held=held, rival_held=rival_held,
        floor=floor, right_law=right_law, inner=tried.inner, proposal=proposal, judged=judged,
        complete=complete, remains=remains, heldout=heldout, closest=closest, withdrawn=withdrawn,
        withdrawn_held=withdrawn_held,
        window=held["revised"].window, notes=notes,
        seconds=time.monotonic() - began, runs=study.predictor.runs, seed=seed, dropped_bodies=dropped,
        dt=dict(study.predictor.dt),
    )  # fmt: skip


# ---- steps -----------------------------------------------------------------------------------


def _study(
    recordings: Sequence[Recording], hold_out: Sequence[Recording], rng: np.random.Generator, progress: Progress,
    late: Callable[[float], bool],
) -> Study:  # fmt: skip
    cases = prepare_all(recordings, hold_out)
    training = [c for c in cases if not c.held_out]
    predictor = Predictor(time_steps(cases))
    stages = (0.1, 0.35, 1.0) if max(len(c.t) for c in training) > 150 else (1.0,)
    fitter = Fitter(cases, predictor, stop=lambda: late(FITS_END))
    inner = InnerSplit.make(training, predictor, lambda: late(FITS_END))
    study = Study(cases, training, predictor, fitter, inner, stages, adjustable_terms(cases), rng, progress, late)
    study.notes += dict.fromkeys(note for case in cases for note in case.notes)
    if len({c.unit for c in cases}) > 1:
        study.notes.append("some recordings are angles only: errors are pooled in the unit of the first")
    return study


def _calibrated(study: Study) -> tuple[Fit, Fit]:
    """The scene as it is believed to be, and with its adjustables fitted: recalibration comes first."""
    study.progress("fitting the starts of the naive scene", 0.02)
    naive = study.fitter.fit_widely(Hypothesis(), None, stages=study.stages)
    study.progress("recalibrating", 0.06)
    if not study.adjustables:
        return naive, naive
    return naive, study.fitter.fit_widely(Hypothesis(study.adjustables), naive, stages=study.stages)


def _tried(study: Study, naive: Fit, recalibrated: Fit) -> Tried:
    """Each candidate alone, and the laws without a name beside them."""
    fitter, late, progress = study.fitter, study.late, study.progress
    progress("signatures of the candidates", 0.1)
    terms = named_terms(study.cases)
    bank = make_bank(fitter, recalibrated, terms)
    # whatever their units, later fits step by what changes the prediction as much as the noise does
    terms = [scaled_like(t, s.term) for t, s in zip(terms, bank.signatures, strict=True)]
    trials = try_candidates(
        fitter,
        recalibrated,
        bank,
        study.stages,
        lambda text, k, n: progress(f"refitting {text}", 0.12 + 0.4 * k / n),
        lambda: late(0.45),
    )
    recalibrated, trials = unstuck(fitter, recalibrated, trials)
    again = fitter.fit(naive.hypothesis, naive.values, recalibrated.starts)
    naive = again if again.chi2 < naive.chi2 else naive
    progress("the flexible arm", 0.52)
    if late(0.5):
        study.notes.append("the flexible arm was not tried: the time was up")
    arms = make_bank(fitter, recalibrated, [] if late(0.5) else flexible_terms(study.cases))
    flexible_trials = try_candidates(fitter, recalibrated, arms, (1.0,), lambda *a: None)
    if any(t.reason.startswith("not refitted") for t in trials):
        study.notes.append("some candidates were only compared to first order: the time was up")
    alive = [t for t in trials if t.fit is not None]
    arms_alive = [t for t in flexible_trials if t.fit is not None]

    fits = [t.fit for t in alive + arms_alive if t.fit is not None]
    best = min([*fits, recalibrated], key=lambda fit: fit.chi2)
    spread = spread_of(best, study.training)

    progress("testing inside the training part", 0.56)
    scores = {"recalibrated": study.inner.score(recalibrated)[0]}
    alive, arms_alive = score_inner(study.inner, alive, spread), score_inner(study.inner, arms_alive, spread)
    scores |= {t.term.label: t.inner for t in alive + arms_alive}
    untried = [t for t in trials if t.fit is None]
    return Tried(naive, recalibrated, terms, bank, alive, untried, arms_alive, best, spread, scores)


AGAIN = 0.1  # of the gain of the best law: the others are not refitted once the memory of the noise is known


def _with_memory(study: Study, tried: Tried) -> tuple[Study, Tried]:
    """The study with the slow part of the noise in its likelihood, and all fits that matter again from where they were.

    Where what the best fit leaves has no memory, both as they were. A slow part is counted as far as it passes for
    noise; what is slower or larger stays with the laws, and widens intervals as before.
    """
    # what is left beyond twice the most that noise may be is physics, and says nothing of the noise
    most = 2 * (1 + current().noise.slow_most**2)
    if study.late(0.55) or tried.best.chi2 > most * tried.best.count:
        return study, tried
    noise = _slow_noise(study, tried)
    if not noise.size:
        return study, tried
    study.progress("the memory of the noise", 0.58)
    slow = {c.name: replace(c, noise=noise) for c in study.cases}
    cases, training = list(slow.values()), [slow[c.name] for c in study.training]
    fitter = Fitter(cases, study.predictor, stop=study.stop)
    inner = InnerSplit.make(training, study.predictor, study.stop)
    study = replace(study, cases=cases, training=training, fitter=fitter, inner=inner)
    study.notes.append(
        f"the noise has a slow part: {noise.size:.2g} times its white part, correlated over {noise.memory:.0f} frames"
    )

    def again(fit: Fit) -> Fit:
        return fitter.fit(fit.hypothesis, fit.values, fit.starts, evaluations=10)

    naive = again(tried.naive)
    recalibrated = naive if tried.recalibrated is tried.naive else again(tried.recalibrated)
    bank = make_bank(fitter, recalibrated, tried.terms)
    arms_bank = make_bank(fitter, recalibrated, [t.term for t in tried.arms])
    alive, untried = list[Trial](), list(tried.untried)
    for kind, signatures in ((tried.alive, bank.signatures), (tried.arms, arms_bank.signatures)):
        by_form = {_form(s.term): s for s in signatures}
        most = max((t.gain for t in kind), default=0.0)
        for t in kind:
            if t.fit is None or t.gain < AGAIN * most:
                untried.append(replace(t, fit=None, reason="others explain far more"))
                continue
            fit = again(t.fit)
            signature = replace(by_form.get(_form(t.term), t.signature), term=t.term)
            alive.append(Trial(signature, fit, recalibrated.chi2 - fit.chi2, float("inf")))
    best = min([*(t.fit for t in alive if t.fit is not None), recalibrated], key=lambda fit: fit.chi2)
    spread = spread_of(best, training)
    flexible = {t.term.label for t in tried.arms}
    alive = score_inner(inner, sorted(alive, key=lambda t: -t.gain), spread)
    inner_scores = {"recalibrated": inner.score(recalibrated)[0]} | {t.term.label: t.inner for t in alive}
    arms = [t for t in alive if t.term.label in flexible]
    named = [t for t in alive if t.term.label not in flexible]
    untried = [t for t in untried if t.term.label not in flexible]
    return study, Tried(naive, recalibrated, tried.terms, bank, named, untried, arms, best, spread, inner_scores)


def _slow_noise(study: Study, tried: Tried) -> Noise:
    """The slow part of the noise; what one more law beside the best explains is slow too, and is not taken for it."""
    best, fitter = tried.best, study.fitter
    noise = memory_of(best, fitter.cases)
    if not noise.size:
        return noise
    taken = {t.mechanism for t in best.hypothesis.terms}
    rest = make_bank(fitter, best, [t for t in tried.terms if t.mechanism not in taken]).signatures
    for signature in rest:
        if is_limit(signature.term):  # to first order it changes nothing
            found = refit(fitter, tried.best, signature, (1.0,))
            if best.chi2 - found.chi2 > price(len(rest), 1):
                best = found
    more = max(rest, key=lambda s: s.gain - 2 * s.directions.shape[1], default=None)
    if best is not tried.best or more is None or more.gain < price(len(rest), more.directions.shape[1]):
        return memory_of(best, fitter.cases)
    return memory_of(best, fitter.cases, more.directions)


def _form(term: Term) -> tuple[str, tuple[float, ...]]:
    """What tells terms of one law apart: its choices, and from which ranges and exponents it is looked for."""
    return term.label, tuple(f.neutral for f in term.free if f.inner)


def _beyond_nulls(study: Study, tried: Tried) -> tuple[Null | None, Trial | None]:
    """The same search on data without a mismatch, and the candidate to be named where it gains more than that."""
    study.progress("nulls", 0.64)
    replicates = REPLICATES if not study.late(0.7) else 99
    chosen = choose(tried.alive, tried.spread, tried.inner["recalibrated"] + study.inner.slack)
    signatures = tried.bank.signatures
    if not signatures:
        return None, None
    open_ = np.array([s.surviving > 1e-3 for s in signatures])
    gain = max((s.gain for s, counts in zip(signatures, open_, strict=True) if counts), default=0.0)
    noise = noise_of(tried.best, study.fitter.cases, tried.spread)
    null = search_nulls(tried.bank, noise, open_, gain if chosen is None else chosen.gain, replicates, study.rng)
    return null, chosen if null.p <= current().verdict.alarm else None


def _explained(
    study: Study, tried: Tried, chosen: Trial | None
) -> tuple[list[Trial], Fit, dict[str, str], list[tuple[Trial, bool]]]:
    """The law that was chosen for the bodies that ask for it, a second one beside it, or two that help only together.

    Also, for each body that the law was not kept for, why, and what could stand in place of what was found: True where
    these data cannot tell.
    """
    fitter, inner, predictor, recalibrated = study.fitter, study.inner, study.predictor, tried.recalibrated
    found: list[Trial] = []
    revised = recalibrated
    dropped: dict[str, str] = {}
    if chosen is not None and chosen.fit is not None:
        found, revised = [chosen], chosen.fit
    scores, training = tried.inner, study.training
    in_time = not study.late(0.6)
    if in_time:
        study.progress("pairs", 0.7)
        found, revised = second_law(
            found, revised, recalibrated, fitter, tried.terms, inner, scores, study.rng, training
        )
    if len(found) == 1:
        # of two, whom each acts on is asked when both have their last form
        kept, dropped = prune(
            found[0], recalibrated, fitter, inner, tried.spread, predictor, study.stop, study.notes
        )
        found = [] if kept is None else [kept]
        revised = recalibrated if kept is None or kept.fit is None else kept.fit
    if not in_time:
        study.notes.append("pairs were not tried: the time was up")
        return found, revised, dropped, []
    # a poor first law, or none although the innovations are not noise: perhaps two are needed together
    now = scores.get(label_of(*found), found[0].inner) if found else np.inf
    now = min(now, scores["recalibrated"])
    left = left_over(revised, recalibrated, now, scores["recalibrated"], training)
    if spread_of(revised, training) > 1.0 and left > POOR:
        pair = pair_of(
            recalibrated, fitter, tried.terms, tried.alive, inner, scores, now, predictor, study.rng, training,
            study.stop,
        )  # fmt: skip
        if pair and pair[0].fit is not None:
            found, revised = pair, pair[0].fit
    if not study.late(0.7):
        found, revised = drag_and_push(
            found, revised, recalibrated, fitter, tried.terms, inner, scores, training
        )
    others: list[Exchange] = []
    if len(found) == 2 and not study.late(0.7):
        found, revised, others = settled(
            found, revised, recalibrated, fitter, tried.terms, inner, scores, training
        )
    if not study.late(0.7):
        found, revised = third_law(
            found, revised, recalibrated, fitter, tried.terms, inner, scores, study.rng, training
        )
    if len(found) > 1 and not study.late(0.75):
        found, revised, dropped = whom(
            found, revised, recalibrated, fitter, tried.terms, inner, training, study.notes
        )
    near = rivals_of_pair(others, study.notes) if len(found) > 1 else []
    if found and not study.late(0.75):
        found, revised, equal = in_names_of_apparatus(found, revised, recalibrated, fitter, tried.terms, training)
        gave_way = [(e.gave_way, True) for e in equal]
        named = {t.mechanism for t in (*found, *(t for t, _ in gave_way))}
        near = [*gave_way, *(r for r in near if r[0].mechanism not in named)]
        found, revised, gone = that_earn_their_place(found, revised, recalibrated, fitter, training)
        dropped |= gone
    return found, revised, dropped, near


def _finely(
    study: Study, tried: Tried, fitter: Fitter, found: list[Trial], revised: Fit, spread: float
) -> tuple[Tried, Fitter, list[Trial], Fit]:
    """What was found, with steps so short that no number hangs on them: halved and fitted again where one does."""
    for _ in range(HALVINGS):
        moved = shifts(fitter, revised, spread)
        if moved.max(initial=0.0) < SHIFT or study.late(0.75):
            break
        worst = revised.hypothesis.free[int(np.argmax(moved))].name
        study.predictor.dt = {name: dt / 2 for name, dt in study.predictor.dt.items()}
        study.notes.append(f"{worst} would move by {moved.max():.1f} standard errors with half the time step: halved")
        revised = fitter.fit(revised.hypothesis, revised.values, revised.starts, evaluations=8)
        naive = study.fitter.fit(tried.naive.hypothesis, tried.naive.values, tried.naive.starts, evaluations=8)
        recalibrated = naive
        if tried.recalibrated is not tried.naive:
            then = tried.recalibrated
            recalibrated = study.fitter.fit(then.hypothesis, then.values, then.starts, evaluations=8)
        tried = replace(tried, naive=naive, recalibrated=recalibrated)
        found = [replace(t, fit=revised, gain=recalibrated.chi2 - revised.chi2) for t in found]
    return tried, fitter, found, revised


@dataclass
class Weighed:
    """Scores on unseen blocks of the training part: of the recalibrated scene, of what was named, of nameless forces.

    forms : each with what it explains;  best_form : the one that leaves least, None where none predicts better
    """

    blocks: list[Block]
    before: Scores
    named: Explained | None
    named_scores: Scores | None
    forms: list[tuple[Trial, Explained]]
    best_form: Trial | None
    criteria: Criteria = field(default_factory=current)
    told: dict[int, Completeness] = field(default_factory=dict)

    def completeness(self, fit: Fit, study: Study) -> Completeness:
        """Whether what a fit leaves of the training part passes for noise, or is less than matters."""
        if id(fit) not in self.told:
            found = completeness(series_of(fit, study.training), self.criteria)
            if not found.passes and _below_tolerance(fit, study.training):
                found = Completeness(found.noise, found.chance, True)
            self.told[id(fit)] = found
        return self.told[id(fit)]


BESIDE, FEW = 6, 6  # leading laws, and how many numbers one may have, of which what is left may be the like
FORMS = 0.3  # of the gain of the best form without a name: those below it are not weighed


def _below_tolerance(fit: Fit, training: Sequence[Case]) -> bool:
    """Whether what exceeds the noise is smaller, rms, than what matters to the experimenter."""
    for case in training:
        innovations = fit.innovations[case.name]
        for k, channel in enumerate(case.channels):
            recording = case.recording
            matters = recording.angle_tolerance if channel.kind == "angle" else recording.tolerance
            used = innovations[np.isfinite(innovations[:, k]), k]
            excess = max(float(np.mean(used**2)) - 1.0, 0.0) if len(used) else 0.0
            if matters is None or float(np.sqrt(excess)) * case.sigma[k] > matters:
                return False
    return True


def _weighed(study: Study, tried: Tried, found: list[Trial], revised: Fit) -> Weighed:
    """Scores of unseen blocks: recalibrated, named, and the nameless forces that gain most."""
    blocks = make_blocks(study.cases)
    noise = completeness(series_of(tried.best, study.training)).noise

    def scores(fit: Fit) -> Scores:
        return score(fit, blocks, study.predictor, noise, study.rng)

    before = scores(tried.recalibrated)
    named_scores = scores(revised) if found else None
    named = explained(named_scores, before, study.rng) if named_scores else None
    most = max((t.gain for t in tried.arms), default=0.0)
    forms = []
    for arm in tried.arms:
        if arm.fit is not None and arm.gain > FORMS * most and arm.gain > 0:
            forms.append((arm, explained(scores(arm.fit), before, study.rng)))
    helps = [(arm, e) for arm, e in forms if e.share > 0 and e.low > 0]
    return Weighed(blocks, before, named, named_scores, forms, _best_form(helps, tried.spread))


def _best_form(helps: Sequence[tuple[Trial, Explained]], spread: float) -> Trial | None:
    """The form that leaves least; of those that leave as little, within what replicates do, the simplest that fits."""
    least = min((e.left for _, e in helps), default=0.0)
    near = [t for t, e in helps if e.left - least <= current().verdict.beyond * e.spread]
    return max(near, key=lambda t: worth(t, spread), default=None)


def _judged(
    study: Study, tried: Tried, found: list[Trial], revised: Fit, spread: float, weighed: Weighed
) -> tuple[Judgement, list[Trial], Fit, list[tuple[Trial, Explained]]]:
    """The verdict of the contract, the laws or the nameless force that stand, their fit, and the names that fell."""
    recalibrated, notes = tried.recalibrated, study.notes
    shares = [e.share for _, e in weighed.forms]
    form_share = max(shares, default=None)
    form_share = None if form_share is None else max(form_share, 0.0)
    left = weighed.completeness(recalibrated, study)
    real = bool(found) or left.chance < weighed.criteria.verdict.alarm
    if _below_tolerance(recalibrated, study.training) and left.passes:
        found, real = [], False
    if found and within_belief(found, revised, recalibrated, study.fitter, spread):
        notes.append(f"{label_of(*found)}: masses and radii as far off as was stated do the same")
        found, real = [], False
    if not real:
        improved = tried.naive.chi2 - recalibrated.chi2
        moved = bool(study.adjustables) and improved / spread > 12 + 2 * len(recalibrated.values)
        return Judgement("recalibrate" if moved else "no_mismatch", None, None), [], recalibrated, []
    closest: list[tuple[Trial, Explained]] = []
    if found and weighed.named is not None:
        fits = [t for t, _ in weighed.forms]
        best = max((worth(t, spread) for t in fits), default=-np.inf)
        gain = (recalibrated.chi2 - revised.chi2) / spread - 2 * sum(t.used for t in found)
        good, why = accepted(weighed.named, [e for _, e in weighed.forms], gain - best)
        if good:
            verdict = "measurement" if all(is_apparatus(t) for t in found) else "missing_physics"
            return Judgement(verdict, weighed.named, form_share), found, revised, []
        notes.append(f"{label_of(*found)} is not named: {why}")
        closest = [(t, weighed.named) for t in found]
    form = weighed.best_form
    if form is not None and form.fit is not None:
        told = next(e for t, e in weighed.forms if t is form)
        return Judgement("unmodelled", told, form_share), [form], form.fit, closest
    return Judgement("unmodelled", None, form_share), [], recalibrated, closest


def _remains(study: Study, tried: Tried, revised: Fit, weighed: Weighed) -> Remains | None:
    """What is left of unseen training data, and which law or nameless force beside the revised scene is the like."""
    noise = weighed.completeness(revised, study).noise
    scores = weighed.named_scores
    if scores is None or weighed.named is None or revised is tried.recalibrated:
        scores = score(revised, weighed.blocks, study.predictor, noise, study.rng)
    taken = {t.mechanism for t in revised.hypothesis.terms}
    leaders = sorted(tried.alive, key=lambda t: -t.gain)[:BESIDE]
    beside = [t.term for t in (*leaders, *tried.arms) if t.mechanism not in taken and len(t.term.free) <= FEW]
    signatures = make_bank(study.fitter, revised, beside).signatures
    best = max(signatures, key=lambda s: s.gain - 2 * len(s.term.free), default=None)
    looks = plainly(best.term.mechanism) if best is not None and best.gain > 10 else "nothing that was tried"
    return remains_of(scores, [b.case.t[b.rest] for b in weighed.blocks], looks)


def _located(
    study: Study, verdict: str, naive: Fit, recalibrated: Fit, revised: Fit, found: list[Trial]
) -> tuple[WindowMap | None, tuple[Place, ...]]:
    """Where innovations of short windows under the recalibrated scene stand out, and their map."""
    if verdict == "no_mismatch":
        return None, ()
    training = study.training
    variance = _variance_by_case(revised, training)

    def seen(fit: Fit, **how: int) -> tuple[WindowMap, tuple[Place, ...]]:
        windows = window_map(study.fitter, fit, variance, **how)
        return windows, locate(windows, training)

    windows, places = seen(recalibrated)
    if not places and verdict != "recalibrate":
        windows, places = seen(recalibrated, pieces=2)
    if not places and found:
        places = _whole(found, recalibrated, revised, training)
    if verdict == "recalibrate" and not places:
        windows, places = seen(naive, pieces=2)
    return windows, places


def _held_out(study: Study, fit: Fit, whole: bool = True) -> Errors:
    memory = np.inf
    # where the scene is not the whole truth, a start counts its latest frames most; how much, training tells
    if any(c.held_out for c in study.cases) and spread_of(fit, study.training) > 1.0:
        memory = learn_memory(fit.hypothesis, fit, study.cases, study.predictor, study.stop)
    return held_out_errors(fit.hypothesis, fit, study.cases, study.predictor, study.stop, whole=whole, memory=memory)


def _proposed(study: Study, found: list[Trial], rivals: list[tuple[Trial, bool]]) -> Proposal | None:
    """The experiment that decides between what was found and its first rival."""
    close = [trial for trial, _ in rivals if trial.fit is not None]
    if not found or not close or found[0].fit is None or study.late(0.9):
        return None
    study.progress("the next experiment", 0.95)
    loser = close[0].fit
    assert loser is not None
    if len(found) > 1:
        return None
    names = (found[0].mechanism, close[0].mechanism)
    return propose(found[0].fit, loser, names, study.cases, study.predictor, study.stop)


def _variance_by_case(fit: Fit, cases: Sequence[Case]) -> dict[str, float]:
    """Variance of the innovations of each recording under the revised scene, at least that of the noise."""
    result = {}
    for case in cases:
        used = fit.used(case.name)
        dof = max(len(used) - len(fit.starts[case.name]), 1)
        result[case.name] = max(float(used @ used) / dof, 1.0)
    return result


def _whole(found: list[Trial], recalibrated: Fit, revised: Fit, cases: Sequence[Case]) -> tuple[Place, ...]:
    """Where no window stands out: the bodies the law acts on, over the whole time."""
    bodies = tuple(dict.fromkeys(b for t in found for b in (t.term.bodies or ())))
    seen = tuple(dict.fromkeys(b for c in cases for b in c.bodies))
    bodies = bodies or seen
    gain = recalibrated.chi2 - revised.chi2
    numbers = sum(t.numbers for t in found)
    z, p = after_looks(float(stats.chi2.sf(gain, numbers)), 1)
    t = [float(min(c.t[0] for c in cases)), float(max(c.t[-1] for c in cases))]
    return (
        Place(tuple(b for b in bodies if b in seen) or bodies, {}, {"t": t}, None, z, p, cases[0].name),
    )
