"""Whole tracks of free, pinned, sprung and colliding bodies: how they are held against simulations, step by step."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from scipy import stats

from ..inference.criteria import current
from ..inference.explained import Scores, explained
from ..inference.judge import (
    Claim,
    Completeness,
    Form,
    Judgement,
    Mismatch,
    Remains,
    Weighed,
    as_large_by_chance,
    best_form,
    completeness,
    remains_of,
)
from ..inference.mechanisms import UNKNOWN, plainly
from ..inference.model import Course, HeldOut, Left, ObservationModel, Proposal, Rival
from ..inference.noise import Noise
from ..inference.pipeline import diagnose_by
from ..inference.result import Diagnosis, Progress, Used
from ..inference.significance import Null, after_looks, price
from ..laws import all_laws
from ..recording import Recording
from ..scene import Scene
from .believed import believed_terms
from .blocks import make_blocks, score
from .candidates import flexible_terms, in_contact_alone, named_terms, scaled_like
from .choose import choose, left_over, prune, rivals_of, score_inner, worth
from .data import Case, prepare_all
from .experiment import propose
from .fit import Fit, Fitter, joined
from .held_out import (
    Errors,
    carried_on,
    held_out_errors,
    learn_memory,
    left_of_held_out,
    meets_when_scored,
    noise_floor,
    paired_verdict,
    right_law_errors,
    training_errors,
)
from .hypothesis import Failed, Hypothesis, Predictor, Term, adjustable_terms
from .innovations import Place, Whiteness, WindowMap, locate, memory_of, series_of, whiteness, window_map
from .intervals import with_limits
from .name import InnerSplit, Trial, is_limit, label_of, refit, spread_of, try_candidates, unstuck
from .nulls import noise_of, search_nulls
from .pairs import Exchange, drag_and_push, pair_of, rivals_of_pair, second_law, settled, third_law
from .score_test import chance_of_more
from .settle import (
    apparatus_beside,
    in_names_of_apparatus,
    that_earn_their_place,
    within_belief,
    without_idle_numbers,
)
from .signatures import Bank, make_bank
from .steps import shifts, time_steps
from .verdict import Told, revised_scene, used
from .whom import whom

BENDS_AS_WELL = "more than noise is left, and a picture that is bent looks like a little of anything"
AS_BELIEVED = "masses and radii as far off as was stated do the same"


def _silent(text: str, share: float) -> None:
    return None


@dataclass
class TrackFinding:
    """What the figures of whole tracks are drawn from; ``rivals``: with whether these data cannot tell them apart."""

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
    spread: float
    train: dict[str, Errors]
    held: dict[str, Errors]
    floor: tuple[float | None, float | None]
    inner: dict[str, float]


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

    def stop(self) -> bool:
        """Whether the time is up: fits then end where they stand."""
        return self.late(current().budget.fits)


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


class Tracks(ObservationModel):
    """Whole tracks, or segments of them that join up: starts are free numbers of the fit."""

    kind = "bodies"
    tail = "chi-squared of the innovations of a window over their spread, all windows counted"

    def __init__(
        self, recordings: Sequence[Recording], hold_out: Sequence[Recording] = (), *, minutes: float | None = None,
        seed: int = 0, progress: Progress = _silent,
    ) -> None:  # fmt: skip
        """``minutes``: the budget; when it runs short, pairs, nulls and proposals are cut down and the notes say so.

        Raises InputError for recordings that cannot be used.
        """
        began = time.monotonic()

        def late(share: float) -> bool:
            return minutes is not None and time.monotonic() - began > 60 * minutes * share

        self.progress = progress
        self.study = _study(recordings, hold_out, np.random.default_rng(seed), progress, late)
        self.notes = self.study.notes
        self.dropped: dict[str, str] = {}
        self.near: list[tuple[Trial, bool]] = []  # what could stand in place of what was found
        self.best_form: Trial | None = None
        self.windows: WindowMap | None = None
        self.right = np.zeros(0)
        # recordings with impacts that a run goes on through, and what the start of it adds to the noise there
        self.followed: dict[str, float] = {}
        self.floor: tuple[float | None, float | None] = (None, None)
        self._completeness: dict[int, tuple[Fit, Completeness]] = {}

    @property
    def plain(self) -> Claim:
        return Claim((), self.tried.recalibrated)

    def recalibrate(self) -> None:
        self.naive_fit, self.recalibrated_fit = _calibrated(self.study)

    def try_candidates(self) -> None:
        tried = _tried(self.study, self.naive_fit, self.recalibrated_fit)
        self.study, self.tried = _with_memory(self.study, tried)

    def nulls(self) -> Null | None:
        self.null, self.chosen = _beyond_nulls(self.study, self.tried)
        return self.null

    def search(self, null: Null | None) -> Claim:
        claim = self._search()
        follows = self._without_laws(claim)
        if follows is not None:
            # all that was compared was compared with a scene that lost its way: again, with one that follows
            self.study, self.tried = _with_memory(self.study, _tried(self.study, self.tried.naive, follows))
            self.nulls()
            claim = self._search()
        return claim

    def null_after(self, null: Null | None) -> Null | None:
        return self.null

    def _without_laws(self, claim: Claim) -> Fit | None:
        """The scene without a law from where that with laws ended, None where it follows no better than it did.

        Through impacts a search may be caught far from where it should be, and every law then seems to help. Better is
        what a law would have to earn.
        """
        study, plain, revised = self.study, self.tried.recalibrated, claim.fit
        if not claim.laws or study.late(current().budget.candidates):
            return None
        n = len(plain.values)
        like = all(len(revised.segments[name]) == len(segments) for name, segments in study.fitter.segments.items())
        try:
            starts = revised.starts if like else study.fitter.continued(revised)
        except Failed:
            return None
        again = study.fitter.fit(plain.hypothesis, revised.values[:n], starts)
        earned = price(len(self.tried.terms), 1) * self.spread
        return again if again.chi2 < plain.chi2 - earned else None

    def _search(self) -> Claim:
        study, tried = self.study, self.tried
        found, revised, self.dropped, self.near = _explained(study, tried, self.chosen)
        self.fitter = study.fitter
        if found and self.fitter.segmented:
            self.fitter, revised = joined(self.fitter, revised)
            found = [replace(t, fit=revised) for t in found]
        self.spread = spread_of(revised, study.training) if found else tried.spread
        if found:
            self.tried, self.fitter, found, revised = _finely(study, tried, self.fitter, found, revised, self.spread)
        return Claim(tuple(found), revised)

    def weigh(self, claim: Claim) -> Weighed:
        """Scores of unseen blocks: recalibrated, named, and the nameless forces that gain most."""
        study, tried, rng = self.study, self.tried, self.study.rng
        study.progress("what explains", 0.72)
        self.blocks = make_blocks(study.cases)
        noise = completeness(series_of(tried.best, study.training)).noise

        def scores(fit: Fit) -> Scores:
            return score(fit, self.blocks, study.predictor, noise, rng)

        before = scores(tried.recalibrated)
        self.scores: dict[str, Scores] = {}
        named = None
        if claim.laws:
            self.scores[claim.label] = scores(claim.fit)
            named = explained(self.scores[claim.label], before, rng)
        most = max((t.gain for t in tried.arms), default=0.0)
        forms = []
        for arm in tried.arms:
            if arm.fit is not None and arm.gain > current().left.forms * most and arm.gain > 0:
                form = Claim((arm,), arm.fit)
                self.scores[form.label] = scores(arm.fit)
                share = explained(self.scores[form.label], before, rng)
                forms.append(Form(form, share, worth(arm, tried.spread)))
        best = best_form(forms)
        self.best_form = None if best is None else best.claim.laws[0]
        gain = (tried.recalibrated.chi2 - claim.fit.chi2) / self.spread - 2 * sum(t.used for t in claim.laws)
        ahead = gain - max((worth(f.claim.laws[0], self.spread) for f in forms), default=-np.inf)
        return Weighed(named, tuple(forms), ahead=ahead)

    def completeness(self, fit: Fit) -> Completeness:
        """Whether what a fit leaves of the training part passes for noise, or is less than matters."""
        if id(fit) not in self._completeness:
            found = completeness(series_of(fit, self.study.training))
            if not found.passes and _below_tolerance(fit, self.study.training):
                found = Completeness(found.noise, found.chance, True)
            self._completeness[id(fit)] = fit, found
        return self._completeness[id(fit)][1]

    def mismatch(self, claim: Claim) -> Mismatch:
        study, tried = self.study, self.tried
        left = self.completeness(tried.recalibrated)
        real = bool(claim.laws) or left.chance < current().verdict.alarm
        if left.passes and _below_tolerance(tried.recalibrated, study.training):
            real = False
        laws = list(claim.laws)
        if real and laws:
            _, alike = within_belief(laws, claim.fit, tried.recalibrated, self._fitter_of(claim.fit), self.spread)
            if len(alike) == len(laws):
                self.notes.append(f"{claim.label}: {AS_BELIEVED}")
                real = False
        return Mismatch(real, bool(study.adjustables) and self._moved())

    def _moved(self) -> bool:
        """Whether the adjustables explain more than they would by chance."""
        naive, best = self.tried.naive, self.tried.recalibrated
        improved = naive.chi2 - best.chi2
        if self.study.believed:  # what radii and masses explain is not theirs
            own = [k for k, f in enumerate(best.hypothesis.free) if not f.prior]
            off = best.values[own] - [best.hypothesis.free[k].first for k in own]
            improved = float(off @ np.linalg.pinv(best.covariance[np.ix_(own, own)]) @ off)
        return improved / self.spread > current().verdict.moved + 2 * len(best.values)

    def settle(self, judged: Judgement) -> Judgement:
        """With profiles of chi2 where numbers are known only together, or unevenly.

        Without those of several laws that masses and radii imitate, as far off as was said.
        """
        if judged.verdict not in ("missing_physics", "measurement"):
            return judged
        count = len(self.tried.recalibrated.values)
        late = partial(self.study.late, current().budget.settling)
        fit = with_limits(self.fitter, judged.claim.fit, count, self.spread, late)
        laws = judged.claim.laws
        fit, alike = within_belief(laws, fit, self.tried.recalibrated, self.fitter, self.spread)
        if alike and len(alike) < len(laws):
            named = Claim(tuple(alike), fit).label
            self.notes.append(f"{named}, in the revised scene, is not named: {AS_BELIEVED}")
            laws = tuple(t for t in laws if not any(t is a for a in alike))
        plain = self.tried.recalibrated
        idle = [] if self.completeness(fit).passes else apparatus_beside(laws, fit, plain, self.fitter)
        if idle:
            named = Claim(tuple(idle), fit).label
            self.notes.append(f"{named}, in the revised scene, is not named: {BENDS_AS_WELL}")
            laws = tuple(t for t in laws if not any(t is a for a in idle))
        if fit.limits:
            names = ", ".join(fit.hypothesis.free[k].name for k in fit.limits)
            self.notes.append(
                f"{names}: known only together with others, or unevenly: their intervals are those of chi2 itself"
            )
        return replace(judged, claim=replace(judged.claim, laws=laws, fit=fit))

    def hold_out(self, judged: Judgement) -> HeldOut:
        study, revised = self.study, judged.claim.fit
        study.progress("held-out data", 0.8)
        fits = {"naive": self.tried.naive, "recalibrated": self.tried.recalibrated, "revised": revised}
        self.train = {name: training_errors(fit, study.training) for name, fit in fits.items()}
        cut = [c for c in study.cases if any(len(f.segments.get(c.name, ())) > 1 for f in fits.values())]
        spreads = {c.name: carried_on(revised, c, study.predictor, study.rng) for c in cut}
        self.followed = {name: spread for name, spread in spreads.items() if spread < 1.0}
        self.held = {name: self._held_out(fit) for name, fit in fits.items()}
        study.progress("noise floor", 0.86)
        how = revised.hypothesis, revised, study.cases, study.predictor, study.stop, study.rng
        self.floor = noise_floor(*how)
        rms, floor = self.held["revised"].rms, self.floor[1]
        # beyond the floor there may be the errors of the numbers that were found, too
        beyond = rms is not None and floor and rms > current().left.asked * floor
        if beyond and len(revised.values) and not study.late(current().budget.experiment):
            self.right = right_law_errors(*how, followed=self.followed)
        outcome = None
        if judged.claim.laws:
            outcome = paired_verdict(self.held["recalibrated"], self.held["revised"], study.rng)
            if outcome == "fails" and self._by_its_start():
                outcome = "undecided"
        train, held = (
            {name: e.rms for name, e in part.items()} | {"noise_floor": floor}
            for part, floor in zip((self.train, self.held), self.floor, strict=True)
        )
        return HeldOut(
            train, held, outcome, self._gain(self.held["revised"]), judged.claim, judged.explained,
            self.held["revised"].window, {name: e.whole for name, e in self.held.items()},
        )  # fmt: skip

    def _by_its_start(self) -> bool:
        """Whether runs that go on through impacts are worse by no more than the start of one such run is unsure.

        All frames of it are off together: there is one number of evidence, however many blocks of them are compared.
        """
        before, after = (self.held[name].scored or {} for name in ("recalibrated", "revised"))
        worse = {n: float(np.nansum(after[n] ** 2 - before[n] ** 2)) for n in after if n in before}
        count = {n: int(np.isfinite(after[n]).sum()) for n in worse}
        within = current().left.within
        return all(worse[n] <= within * self.followed.get(n, 0.0) * count[n] for n in worse)

    def _held_out(self, fit: Fit, whole: bool = True) -> Errors:
        study, memory = self.study, math.inf
        # where the scene is not the whole truth, a start counts its latest frames most; how much, training tells
        if any(c.held_out for c in study.cases) and spread_of(fit, study.training) > 1.0:
            memory = learn_memory(fit.hypothesis, fit, study.cases, study.predictor, study.stop)
        return held_out_errors(
            fit.hypothesis, fit, study.cases, study.predictor, study.stop, whole=whole, memory=memory,
            followed=self.followed,
        )  # fmt: skip

    def _gain(self, errors: Errors) -> float | None:
        """Half the fall of chi2 on held-out data, recalibrated less this."""
        before = self.held["recalibrated"]
        return None if before.rms is None or errors.rms is None else (before.chi2 - errors.chi2) / 2

    def locate(self, judged: Judgement) -> tuple[Sequence[Mapping[str, Any]], Sequence[str]]:
        """By innovations of short windows."""
        self.study.progress("locating", 0.88)
        found = list(judged.claim.laws)
        followed = judged.claim.fit if found else self.tried.best
        self.windows, places = _located(
            self.study, judged.verdict, self.tried.naive, self.tried.recalibrated, followed, found
        )
        return [place.as_dict() for place in places], [place.case for place in places]

    def left(self, judged: Judgement) -> Left:
        # a mismatch that is real and was not explained is more than noise, however little of it shows in one place
        complete = self.completeness(judged.claim.fit).passes
        complete = complete and (bool(judged.claim.laws) or judged.verdict != "unmodelled")
        complete = complete and not self._more_to_see(judged.claim.fit)
        if complete and judged.claim.laws and self._more_held_out():
            return Left(False, left_of_held_out(self.held["revised"], self.study.cases, self.floor[1]))
        if complete or judged.verdict in ("no_mismatch", "recalibrate"):
            return Left(complete, None)
        return Left(False, self._remains(judged.claim))

    def _more_held_out(self) -> bool:
        """Whether held-out data are off by more than numbers of the right law, found from as noisy frames, leave."""
        rms = self.held["revised"].rms
        return rms is not None and as_large_by_chance(rms, self.right) < current().left.chance

    def _fitter_of(self, fit: Fit) -> Fitter:
        """The fitter with the segments of a fit: what is claimed may be followed in one, where other fits are not."""
        counts = {name: len(segments) for name, segments in fit.segments.items()}
        same = all(len(self.fitter.segments[name]) == count for name, count in counts.items())
        return self.fitter if same else self.study.fitter

    def _more_to_see(self, fit: Fit) -> bool:
        """Whether what is left, and matters, holds more along the signature of a candidate than noise would."""
        study, tried = self.study, self.tried
        if study.late(current().budget.remains) or _below_tolerance(fit, study.training):
            return False
        # not of the forms without a name: theirs were shaped by these very residuals, and gain more than in noise
        return chance_of_more(self._fitter_of(fit), fit, tried.terms, study.rng) < current().noise.alarm

    def _remains(self, claim: Claim) -> Remains | None:
        """What is left of unseen blocks, and which law or nameless force beside the revised scene is the like."""
        study, tried, fit = self.study, self.tried, claim.fit
        scores = self.scores.get(claim.label)
        if scores is None:
            scores = score(fit, self.blocks, study.predictor, self.completeness(fit).noise, study.rng)
        taken = {t.mechanism for t in fit.hypothesis.terms}
        # nor what a named law stands for in such an apparatus: it is the same
        taken |= {other for t in fit.hypothesis.terms if t.law in all_laws() for other in all_laws()[t.law].stands_for}
        few = current().left
        leaders = sorted(tried.alive, key=lambda t: -t.gain)[: few.beside]
        beside = [
            t.term for t in (*leaders, *tried.arms) if t.mechanism not in taken and len(t.term.free) <= few.numbers
        ]
        signatures = make_bank(self._fitter_of(fit), fit, beside).signatures
        best = max(signatures, key=lambda s: s.gain - 2 * len(s.term.free), default=None)
        looks = "nothing that was tried"
        if best is not None and best.gain > few.looks:
            looks = plainly(best.term.mechanism)
        return remains_of(scores, [b.case.t[b.rest] for b in self.blocks], looks)

    def rivals(self, judged: Judgement) -> tuple[list[Rival], list[tuple[Rival, float]]]:
        found, alive = list(judged.claim.laws or judged.withdrawn), self.tried.alive
        near = self.near
        taken = {t.mechanism for t in (*found, *(t for t, _ in near))}
        if len(found) > 1:
            beside = [*near, *((t, False) for t in alive if t.mechanism not in taken)][: max(3, len(near))]
        else:
            beside = [*near, *(r for r in rivals_of(found, alive, self.spread) if r[0].mechanism not in taken)]
        gains: dict[str, float | None] = {}
        for t in (*(t for t, _ in judged.closest), *(t for t, _ in beside)):
            if t.fit is not None and t.mechanism not in gains:
                gains[t.mechanism] = self._gain(self._held_out(t.fit, whole=False))
        closest = [(Rival(t, gains.get(t.mechanism), False), share) for t, share in judged.closest]
        return [Rival(t, gains.get(t.mechanism), same) for t, same in beside], closest

    def propose(self, judged: Judgement, rivals: Sequence[Rival]) -> Proposal | None:
        study, found = self.study, judged.claim.laws
        loser = next((r.law for r in rivals if r.law.fit is not None), None)
        if len(found) != 1 or loser is None or found[0].fit is None or study.late(current().budget.experiment):
            return None
        study.progress("the next experiment", 0.95)
        names = (found[0].mechanism, loser.mechanism)
        return propose(found[0].fit, loser.fit, names, study.cases, study.predictor, study.stop)

    # ---- what is handed over

    @property
    def unit(self) -> str:
        return next(c.unit for c in self.study.cases)

    def mechanisms(self, course: Course) -> list[dict[str, Any]]:
        judged, gain = course.judged, course.held.gain
        told = Told(judged.claim.fit, self.spread, self.study.cases)
        if judged.verdict == "unmodelled":
            return [entry | {"name": UNKNOWN} for t in judged.claim.laws[:1] for entry in told.entries(t, gain)[:1]]
        return [entry for t in judged.claim.laws for entry in told.entries(t, gain)]

    def adjustables(self, course: Course) -> dict[str, tuple[float, float | None, float | None]]:
        fit = course.judged.claim.fit
        free = self.tried.recalibrated.hypothesis.free
        return {f.name: fit.interval(k, self.spread) for k, f in enumerate(free) if not f.prior}

    def believed(self) -> dict[str, tuple[float, float, float]]:
        free = self.tried.recalibrated.hypothesis.free
        return {f.name: (f.first, f.low, f.high) for f in free if not f.prior}

    def closing_notes(self, course: Course) -> list[str]:
        notes = []
        failures = self.study.predictor.failures
        if len(failures) > current().left.failed * self.runs:
            notes.append(f"{len(failures)} runs could not be finished, the first: {failures[0]}")
        notes += [f"{b}: not named, {why}" for b, why in self.dropped.items()]
        laws = course.judged.claim.laws
        if laws and course.held.outcome == "undecided" and all(in_contact_alone(t.term) for t in laws):
            if not any(meets_when_scored(c) for c in self.study.cases):
                notes.append(f"the held-out part holds no impact, where alone {course.judged.claim.label} shows")
        revised, floor = self.standing(course, self.held)["revised"].rms, self.floor[1]
        if revised and floor and revised > current().left.told * floor:
            times = revised / floor
            text = f"a held-out misfit of {revised:.3g} {self.unit} remains, {times:.1f} times the noise floor"
            if self.right_law is not None:
                least, most = self.right_law
                text += "; where the law is right, numbers found from as noisy frames leave "
                text += f"{least:.2g} to {most:.2g} {self.unit}"
            notes.append(text)
        return notes

    def revised(self, course: Course) -> dict[str, Scene]:
        fit, dt = course.judged.claim.fit, self.study.predictor.dt
        own = self.standing(course, self.held)["revised"].values or {}
        return {c.name: revised_scene(fit, own.get(c.name, fit.values), c, dt[c.name]) for c in self.study.cases}

    def used(self) -> tuple[Used, ...]:
        return tuple(used(case, self.study.predictor.dt.get(case.name)) for case in self.study.cases)

    @staticmethod
    def standing(course: Course, errors: Mapping[str, Errors]) -> dict[str, Errors]:
        """Errors of each model, those of the recalibrated scene where no claim stands."""
        return dict(errors) if course.judged.claim.laws else {**errors, "revised": errors["recalibrated"]}

    def evidence(self, course: Course) -> TrackFinding:
        tried, judged, study = self.tried, course.judged, self.study
        fits = (tried.naive, tried.recalibrated, judged.claim.fit)
        naive, recalibrated, revised = (whiteness(fit, study.training, fit.numbers) for fit in fits)
        return TrackFinding(
            study.cases, *fits, judged.verdict, list(judged.claim.laws), [(r.law, r.same) for r in course.rivals],
            tried.alive + tried.untried, self.best_form or min(tried.arms, key=lambda t: t.inner, default=None),
            course.null, naive, recalibrated, revised, self.windows, self.spread, self.standing(course, self.train),
            self.standing(course, self.held), self.floor, tried.inner,
        )  # fmt: skip

    @property
    def right_law(self) -> tuple[float, float] | None:
        return (float(self.right.min()), float(self.right.max())) if len(self.right) else None

    @property
    def widened(self) -> float:
        return math.sqrt(self.spread)

    @property
    def runs(self) -> int:
        return self.study.predictor.runs


def diagnose_tracks(
    training: Sequence[Recording], held: Sequence[Recording] = (), *, minutes: float | None = None, seed: int = 0,
    progress: Progress = _silent,
) -> Diagnosis:  # fmt: skip
    """Explain recordings of free, pinned, sprung and colliding bodies by what their scene lacks.

    ``minutes``: the budget;  ``seed``: of the nulls.  Raises InputError for recordings that cannot be used.
    """
    return diagnose_by(Tracks(training, held, minutes=minutes, seed=seed, progress=progress), seed)


# ---- steps -----------------------------------------------------------------------------------


def _study(
    recordings: Sequence[Recording], hold_out: Sequence[Recording], rng: np.random.Generator, progress: Progress,
    late: Callable[[float], bool],
) -> Study:  # fmt: skip
    cases = prepare_all(recordings, hold_out)
    training = [c for c in cases if not c.held_out]
    predictor = Predictor(time_steps(cases))
    stages = (0.1, 0.35, 1.0) if max(len(c.t) for c in training) > 150 else (1.0,)
    fitter = Fitter(cases, predictor, stop=lambda: late(current().budget.fits))
    inner = InnerSplit.make(training, predictor, lambda: late(current().budget.fits))
    terms = adjustable_terms(cases), believed_terms(cases)
    study = Study(cases, training, predictor, fitter, inner, stages, *terms, rng, progress, late)
    study.notes += dict.fromkeys(note for case in cases for note in case.notes)
    if len({c.unit for c in cases}) > 1:
        study.notes.append("some recordings are angles only: errors are pooled in the unit of the first")
    return study


def _calibrated(study: Study) -> tuple[Fit, Fit]:
    """The scene as it is believed to be, and with its adjustables fitted: recalibration comes first."""
    study.progress("fitting the starts of the naive scene", 0.02)
    naive = study.fitter.fit_widely(Hypothesis(), None, stages=study.stages)
    study.progress("recalibrating", 0.06)
    terms = study.adjustables + study.believed
    return naive, study.fitter.fit_widely(Hypothesis(terms), naive, stages=study.stages) if terms else naive


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
        lambda: late(current().budget.candidates),
    )
    recalibrated, trials = unstuck(fitter, recalibrated, trials)
    again = fitter.fit(naive.hypothesis, naive.values, recalibrated.starts)
    naive = again if again.chi2 < naive.chi2 else naive
    progress("the flexible arm", 0.52)
    if late(current().budget.forms):
        study.notes.append("the flexible arm was not tried: the time was up")
    arms = make_bank(fitter, recalibrated, [] if late(current().budget.forms) else flexible_terms(study.cases))
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


def _with_memory(study: Study, tried: Tried) -> tuple[Study, Tried]:
    """The study with the slow part of the noise in its likelihood, and all fits that matter again from where they were.

    Where what the best fit leaves has no memory, both as they were. A slow part is counted as far as it passes for
    noise; what is slower or larger stays with the laws, and widens intervals as before.
    """
    # what is left beyond twice the most that noise may be is physics, and says nothing of the noise
    most = 2 * (1 + current().noise.slow_most**2)
    if study.late(current().budget.memory) or tried.best.chi2 > most * tried.best.count:
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
            if t.fit is None or t.gain < current().refits.memory * most:
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
    sets, late = current().sets, study.late(current().budget.exchanges)
    replicates = sets.replicates_late if late else sets.replicates
    chosen = choose(tried.alive, tried.spread, tried.inner["recalibrated"] + study.inner.slack)
    signatures = tried.bank.signatures
    if not signatures:
        return None, None
    open_ = np.array([s.surviving > current().signatures.surviving for s in signatures])
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
    in_time = not study.late(current().budget.pairs)
    if in_time:
        study.progress("pairs", 0.7)
        found, revised = second_law(
            found, revised, recalibrated, fitter, tried.terms, inner, scores, study.rng, training
        )
    if len(found) == 1:
        # of two, whom each acts on is asked when both have their last form
        kept, dropped = prune(
            found[0], recalibrated, fitter, inner, study.notes
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
    if spread_of(revised, training) > 1.0 and left > current().sets.poor:
        pair = pair_of(
            recalibrated, fitter, tried.terms, tried.alive, inner, scores, now, predictor, study.rng, training,
            study.stop,
        )  # fmt: skip
        if pair and pair[0].fit is not None:
            found, revised = pair, pair[0].fit
    if not study.late(current().budget.exchanges):
        found, revised = drag_and_push(
            found, revised, recalibrated, fitter, tried.terms, inner, scores, training
        )
    others: list[Exchange] = []
    if len(found) == 2 and not study.late(current().budget.exchanges):
        found, revised, others = settled(
            found, revised, recalibrated, fitter, tried.terms, inner, scores, training
        )
    if not study.late(current().budget.exchanges):
        found, revised = third_law(
            found, revised, recalibrated, fitter, tried.terms, inner, scores, study.rng, training
        )
    if len(found) > 1 and not study.late(current().budget.settling):
        found, revised, dropped = whom(
            found, revised, recalibrated, fitter, tried.terms, inner, training, study.notes
        )
    near = rivals_of_pair(others, study.notes) if len(found) > 1 else []
    if found and not study.late(current().budget.settling):
        if len(found) > 1:
            found, revised = without_idle_numbers(found, revised, recalibrated, fitter, tried.terms, training)
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
    for _ in range(current().fits.halvings):
        moved = shifts(fitter, revised, spread)
        if moved.max(initial=0.0) < current().fits.shift or study.late(current().budget.settling):
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
