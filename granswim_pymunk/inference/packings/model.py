"""Recordings in which the grains are not seen, and curves: statistics of the swimmer's motion over packings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...recording import Recording
from ...scene import Scene
from ..criteria import current
from ..criteria.packings import Sizes
from ..explained import Explained
from ..hypothesis import Free
from ..judge import Claim, Form, Judgement, Mismatch, Remains, Weighed, judge, not_named, unexplained
from ..model import Course, HeldOut, Left, ObservationModel, Proposal, Rival
from ..pipeline import diagnose_by
from ..places import Place
from ..pushes import with_form
from ..result import Diagnosis, Progress, Table, Used, mechanism_entry
from ..significance import Null
from ..swimmer_terms import equation
from .amounts import more_runs, try_all
from .candidates import candidates_of, priced
from .checks import (
    confirm,
    errors_of,
    gain_of,
    ids_of,
    locate,
    outcome_of,
    predicted_by,
    prediction,
    propose,
    rest_of,
    shifted,
)
from .conclude import (
    BY_CHANCE,
    NOT_TOLD,
    Curve,
    Finding,
    both_earned,
    by_themselves,
    explained,
    in_reach,
    named_laws,
    within_absence,
)
from .recalibrate import begin, recalibrate
from .refitting import goodness
from .response import fit
from .runs import Runner, workers
from .screening import screen
from .state import NAIVE, Trial, base_point
from .summaries import Condition, conditions_of
from .verdict import curve_text, parameters_of, revised_scene, tables_of, used_of


class Packings(ObservationModel):
    """The naive scene in other packings than the recording's: means and harmonics of angles, strokes and drift."""

    kind = "unseen"
    tail = "F with the degrees of freedom of the spread, all places counted"

    def __init__(
        self, recordings: Sequence[Recording], hold_out: Sequence[Recording] = (), *, minutes: float | None = None,
        seed: int = 0, progress: Progress = lambda text, share: None, sizes: Sizes | None = None,
    ) -> None:  # fmt: skip
        """``minutes``: the budget on two idle cores; it sets how many packings are run of each kind, by the size of the
        runs and not by the clock, so that a busy machine gives the same answer later. ``seed``: of the packings and
        the nulls. Finished runs are kept in the user's cache, so that an interrupted diagnosis goes on.

        Raises InputError for recordings that cannot be used.
        """
        self.progress = progress
        conditions = conditions_of(recordings, hold_out, seed)
        runner = Runner(seed=seed, workers=workers())
        minutes = current().packings.minutes if minutes is None else minutes
        chosen = sizes or planned_sizes(conditions, runner, minutes)
        self.state = begin(conditions, runner, chosen, np.random.default_rng(seed), progress)
        self.notes = self.state.notes
        self.near: list[tuple[Trial, bool]] = []
        self.weighable = False
        self.free_gain: float | None = None

    @property
    def plain(self) -> Claim:
        return Claim((), Finding(self.state, [], self.state.base, base_point(self.state), False))

    def recalibrate(self) -> None:
        recalibrate(self.state)

    def try_candidates(self) -> None:
        s = self.state
        self.candidates = try_all(s)
        self.bank = screen(s, self.candidates)
        open_ = self._open()
        if s.p_search <= current().packings.more and open_ and s.sizes.more:
            least = current().packings.sharper * open_[0].gain
            chosen = [t.candidate for t in open_ if t.gain > least and not t.apparatus]
            more_runs(s, chosen[: current().packings.sharpened], 0.6)
            self.bank = screen(s, self.candidates)

    def _open(self) -> list[Trial]:
        """Candidates that are still in question, best first."""
        return [t for t in self.state.trials if not t.reason and t.gain > 0]

    def nulls(self) -> Null:
        nulls = self.state.nulls
        assert nulls is not None
        top = max((t.gain - 2 * (t.numbers - 1) for t in self.state.trials if not t.reason), default=0.0)
        return Null(nulls.best, top)

    def search(self, null: Null | None) -> Claim:
        s, open_ = self.state, self._open()
        if s.p_search > current().verdict.alarm or not open_:
            return self.plain
        found, revised, self.near = named_laws(s, self.bank, open_, self.candidates)
        if revised is None:
            return self.plain
        return Claim(tuple(found), Finding(s, found, revised, "", False))

    def weigh(self, claim: Claim) -> Weighed:
        if not claim.laws:
            return Weighed()
        named, free = explained(self.state, claim.fit.revised)
        self.weighable = free is not None
        forms = () if free is None else (Form(Claim((Curve(),), self.plain.fit), free, 0.0),)
        return Weighed(named, forms)

    def mismatch(self, claim: Claim) -> Mismatch:
        s, alarm = self.state, current().verdict.alarm
        rank, tail = goodness(s, s.base, len(s.base.u))
        if not claim.laws and s.p_search <= alarm:
            self.notes.append(
                "the recordings ask for a law more than other packings do, but none that was tried stands"
            )
        p = min(s.p_search, rank) if tail < current().verdict.by_chance else s.p_search
        return Mismatch.of(claim.laws, p, bool(s.adjust) and s.p_recalibration <= alarm)

    def settle(self, judged: Judgement) -> Judgement:
        """With runs of the revised scene as it is given to the user, in all conditions."""
        finding: Finding = judged.claim.fit
        s = self.state
        self.goodness = goodness(s, finding.revised, len(finding.revised.u))
        confirm(finding, [t for t, _ in self.near] + [t for t, _ in judged.closest])
        if not both_earned(finding):
            claim = self._alone(finding)
            return self.settle(judge(claim, self.weigh(claim), self.mismatch(claim), self.plain, self.notes))
        if within_absence(finding):
            s.notes.append(f"{judged.claim.label} {judged.claim.are} not named: {NOT_TOLD}")
            return self.settle(not_named(judged.claim, self.weigh(judged.claim), self.plain))
        if finding.found:
            self.goodness = goodness(s, finding.revised, len(finding.revised.u), finding.wilder)
        return judged

    def _alone(self, pair: Finding) -> Claim:
        """Of two laws that do not stand together the one that explains more by itself, with the contacts as believed.

        The other is its rival. Without laws where neither can be an explanation.
        """
        s, alone = self.state, by_themselves(pair)
        fits = {t.label: self._claim(t).fit for t in alone}
        for t in alone:
            # what the error of the runs cannot have put behind the best needs no dear runs
            if in_reach(s, alone[0], t):
                confirm(fits[t.label], [])
        # all runs tell the spread by which each is weighed
        worth = {t.label: s.base.objective - fit(fits[t.label].revised.model, s.means, s.training).objective
                 - 2 * t.numbers for t in alone}  # fmt: skip
        told = sorted(alone, key=lambda t: -worth[t.label])
        if not told:
            return self.plain
        kept, *others = told
        for gone in (t for t in pair.found if t.label != kept.label):
            s.notes.append(f"{gone.label} is not named beside {kept.label}: {BY_CHANCE}")
        self.near = [(t, worth[kept.label] - worth[t.label] < current().verdict.same) for t in others] + self.near
        return self._claim(kept)

    def _claim(self, law: Trial) -> Claim:
        assert law.fit is not None
        return Claim((law,), Finding(self.state, [law], law.fit, "", False))

    def hold_out(self, judged: Judgement) -> HeldOut:
        self.progress("held-out data", 0.95)
        s, finding = self.state, judged.claim.fit
        train, held = errors_of(finding, s.means, s.training), errors_of(finding, s.test, s.testing)
        named = gain_of(finding, lambda c: prediction(finding, s.test, c, "revised"))
        curve = gain_of(finding, lambda c: shifted(finding, c))
        self.free_gain = None if curve is None else curve[0]
        told = curve if judged.claim.nameless else named
        outcome = None if told is None or not judged.claim.laws else outcome_of(*told)
        if self._only_curves:
            train, held = {}, {}
        return HeldOut(
            train, held, outcome or "undecided", None if told is None else told[0], judged.claim, judged.explained
        )

    @property
    def _only_curves(self) -> bool:
        return all(c.any_view.curve for c in self.state.conditions)

    def locate(self, judged: Judgement) -> Sequence[Place]:
        self.progress("where it shows", 0.96)
        self.places = {} if judged.verdict == "no_mismatch" else locate(judged.claim.fit, judged.verdict)
        return list(self.places.values())

    def left(self, judged: Judgement) -> Left:
        finding: Finding = judged.claim.fit
        if judged.withdrawn:
            self.goodness = goodness(self.state, finding.revised, len(finding.revised.u))
        complete = self.goodness[0] > current().verdict.alarm and not unexplained(judged)
        if complete or judged.verdict in ("no_mismatch", "recalibrate"):
            return Left(complete, None)
        errors = errors_of(finding, self.state.means, self.state.training)
        rms, floor = errors.get("revised"), errors.get("noise_floor")
        (joint, phase), ids = rest_of(finding), ids_of(finding)
        looks = "the drift, or all joints alike"
        if joint is not None:
            looks = f"a bend at joint {joint} that the drive's phase sets"
        times = rms / floor if rms is not None and floor else None
        bodies = tuple(ids) if joint is None else (ids[joint],)
        return Left(False, Remains(rms, times, bodies, None, None, looks, phase))

    def alike(self, judged: Judgement) -> Sequence[Claim]:
        return [self._claim(t) for t, same in self.near if same and t.fit is not None and t.refitted]

    def beside(self, judged: Judgement) -> list[tuple[Trial, bool]]:
        return [(t, same) for t, same in self.near if all(t is not law for law in judged.claim.laws)]

    def refitted(self) -> list[Trial]:
        return sorted((t for t in self.state.trials if t.fit is not None and t.worth > 0), key=lambda t: -t.worth)

    def share(self, law: Trial) -> Explained | None:
        return None if law.fit is None else explained(self.state, law.fit)[0]

    def gains(self, judged: Judgement, fallen: Sequence[Trial], beside: Sequence[Trial]) -> dict[str, float | None]:
        def gain(laws: Sequence[Trial]) -> float | None:
            fitted = laws[0].fit
            if fitted is None:
                return None
            found = gain_of(judged.claim.fit, lambda c: predicted_by(self.state, laws, fitted, c))
            return None if found is None else found[0]

        return {t.label: gain([t]) for t in beside} | {t.label: gain(fallen) for t in fallen}

    def propose(self, judged: Judgement, rivals: Sequence[Rival]) -> Proposal | None:
        self.progress("the next experiment", 0.97)
        if not judged.claim.laws or not rivals or judged.verdict == "unmodelled":
            return None
        return propose(self.state, judged.claim.laws[0], next((r.law for r in rivals if r.same), rivals[0].law))

    # ---- what is handed over

    @property
    def unit(self) -> str | None:
        return None if self._only_curves else "m rms"

    def mechanisms(self, course: Course) -> list[dict[str, Any]]:
        finding, judged, gain = course.judged.claim.fit, course.judged, course.held.gain
        ids = ids_of(finding)
        if judged.verdict != "unmodelled":
            entries = []
            for t in judged.claim.laws:
                parameters = parameters_of(finding, t)
                bodies = ids if t.apparatus else list(t.candidate.extent)
                text = equation(t.term, parameters)
                # of a bed that is not seen it is the swimmer that shows it
                parameters = with_form(t.mechanism, parameters, False, [])
                entries.append(mechanism_entry(t.mechanism, text, bodies, parameters, t.surviving, gain))
            return entries
        # of one film no part is unseen by the fit: its curve is told where it predicts what follows
        untested = not self.weighable and not judged.withdrawn and (self.free_gain is None or self.free_gain > 0)
        if not judged.claim.laws and not untested:
            return []
        joint = next((joint for joint in self.places if joint is not None), None)
        bodies = ids if joint is None else [ids[joint]]
        return [mechanism_entry("unknown", curve_text(finding, joint), bodies, {}, None, self.free_gain)]

    def adjusted(self) -> dict[int, Free]:
        return {k: t.free[0] for k, t in enumerate(self.state.adjust)}

    def interval(self, course: Course, k: int) -> tuple[float, float | None, float | None]:
        fitted = course.judged.claim.fit.revised
        return (float(fitted.u[k]), *fitted.interval(k))

    def false_alarm(self, course: Course) -> float:
        s, verdict = self.state, course.judged.verdict
        if verdict == "unmodelled" and not course.judged.claim.laws:
            return min(self.goodness[0], s.p_search)
        return s.p_recalibration if verdict == "recalibrate" else s.p_search

    def closing_notes(self, course: Course) -> list[str]:
        s, finding, notes = self.state, course.judged.claim.fit, []
        if self._only_curves:
            notes.append("the contract's units of errors do not fit a curve of speeds: fit is null, see the figure")
        rank, tail = self.goodness
        if rank <= current().verdict.alarm and course.judged.verdict != "unmodelled":
            notes.append(f"the last fit leaves more than packings do (rank p = {rank:.2g}, chi2 tail p = {tail:.2g})")
        unseen = [t.label for t in s.trials if t.reason.startswith("no amount")]
        if unseen:
            notes.append("these recordings would not show: " + ", ".join(unseen))
        failed = [t for t in s.trials if t.reason and not t.reason.startswith(("no amount", "recalibration"))]
        notes += [f"{t.label} was not judged: {t.reason}" for t in failed[:5]]
        notes.append(
            "p_false_alarm ranks this recording among replicates, each the deviations of two simulated packings mixed "
            "in a random proportion, with tracking noise; z and p of places are tails of F with the runs' degrees of "
            "freedom"
        )
        if finding.found and not finding.true and finding.label != NAIVE:
            notes.append("numbers are from softened contacts: the revised scene could not be run as it is")
        return notes

    def revised(self, course: Course) -> dict[str, Scene]:
        conditions = self.state.conditions
        first = {c.recording.name: c for c in reversed(conditions)}  # the first condition of each
        order = dict.fromkeys(c.recording.name for c in conditions)
        return {name: revised_scene(course.judged.claim.fit, first[name]) for name in order}

    def used(self) -> tuple[Used, ...]:
        return used_of(self.state)

    def evidence(self, course: Course) -> Finding:
        held = course.held if course.judged.claim.laws else course.held.without()
        return replace(course.judged.claim.fit, train=dict(held.train), held=dict(held.held))

    def tables(self, course: Course) -> tuple[Table, ...]:
        return tables_of(self.state)

    @property
    def runs(self) -> int:
        return self.state.runner.runs + self.state.runner.cached


def planned_sizes(conditions: Sequence[Condition], runner: Runner, minutes: float) -> Sizes:
    """Packings of each kind that a budget pays for, at most twice as many as usual.

    The budget is that of ``films`` recordings, of fewer their part of it: runs beyond the usual narrow what is told of
    a film, whose own packing is one draw, by 14 % however many they are, and from twice the usual by 8 %.
    """
    known = current().packings
    usual = replace(known.sizes, spread=known.spread)
    training = [c for c in conditions if c.view is not None]
    candidates = priced(candidates_of(training), runner.packed(training[0], 0))
    adjustables = len({a.name for c in conditions for a in c.recording.scene.adjustable})
    soft = {c.name: runner.cost(c, True) for c in conditions}
    part = {c.name: runner.cost(c, True, part=True) for c in conditions}
    true = {c.name: runner.cost(c, False) for c in conditions}

    def seconds(z: Sizes) -> float:
        screened = known.probed * part[training[0].name] * sum(x.cost * len(x.design) for x in candidates)
        runs = z.soft + adjustables * z.adjustable + 2 * z.leaders * (z.leader // 2) + z.leaders * z.leader + 2 * z.duel
        runs += 2 * (1 + adjustables) * z.leader  # near what was found
        parts = sum(x.cost * len(x.design) * x.packings(z.screen) for x in candidates)
        parts += known.pairs * known.sharpened * z.more
        parts += max(z.spread / len(training) - z.soft, 0.0)
        held = z.true // 2 + z.final, z.soft // 2 + 4 * z.leader
        inside = sum(soft[c.name] * runs + part[c.name] * parts + true[c.name] * (z.true + z.final) for c in training)
        outside = sum(true[c.name] * held[0] + soft[c.name] * held[1] for c in conditions if c.view is None)
        return screened + inside + outside

    budget = 60 * minutes * current().work.cores * min(len(conditions) / known.films, 1.0)
    sizes = [usual.times(factor) for factor in known.factors]
    chosen = next((z for z in sizes if seconds(z) <= budget), sizes[-1])
    # what is left over tells the spread, and every signature, from more packings
    richer = [("spread", n) for n in known.spreads] + [("screen", n * usual.screen) for n in known.screens]
    for name, n in richer:
        more = replace(chosen, **{name: n})
        if n > getattr(chosen, name) and seconds(more) <= min(seconds(chosen) + known.share * budget, budget):
            chosen = more
    return chosen


def diagnose_unseen(
    training: Sequence[Recording], held: Sequence[Recording] = (), *, seed: int = 0, **options: Any
) -> Diagnosis:
    """Explain recordings of a swimmer in a bed that is not seen, and curves, by what their scene lacks.

    ``seed``: of the packings and the nulls;  ``options``: those of ``Packings``: minutes, progress, sizes.
    Raises InputError for recordings that cannot be used.
    """
    return diagnose_by(Packings(training, held, seed=seed, **options), seed)
