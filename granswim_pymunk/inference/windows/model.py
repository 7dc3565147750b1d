"""A swimmer in its bed, both seen: short windows from drawn states, held against those of simulated films."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...recording import Recording
from ...scene import Scene
from ..criteria import current
from ..explained import Explained
from ..hypothesis import Free, Term
from ..judge import Claim, Form, Judgement, Mismatch, Weighed
from ..model import Course, HeldOut, Left, ObservationModel, Proposal, Rival
from ..pipeline import diagnose_by
from ..places import Place
from ..result import HELD_OUT, PARTLY, TRAINING, Diagnosis, Progress, Table, Used
from ..significance import Null, after_looks, half_interval
from .driver import (
    begin,
    beyond_names,
    by_form,
    excess_of,
    leading_laws,
    left_of,
    on_held_out,
    places_of,
    recalibrated,
    refined,
    scale_errors,
    screened,
    signatures_in_time,
    without_law,
)
from .experiment import propose
from .judge import Discrepancy, errors, moved_away, noise_floor, predictive_check, rivals_of
from .likelihood import Prediction, WindowLikelihood
from .plan import Plan
from .search import Answer
from .trial import BedTrial
from .verdict import body_map, chance_of_law, entry_of, place_of, revised_scene
from .weigh import before_of, explained_by_scale, explained_by_trial, rival_gains, weighed
from .windows import BedCase


@dataclass
class BedFinding:
    """What the figures are drawn from. ``predicted`` : all windows by model;  ``level`` : see ``Chance.level``
    map : size of each body's innovation where it is largest, and that window."""

    likelihood: WindowLikelihood
    verdict: str
    adjustables: tuple[Term, ...]
    laws: list[BedTrial]
    trials: list[BedTrial]
    null: np.ndarray
    score: float
    level: float
    predicted: dict[str, Prediction]
    map: tuple[np.ndarray, int] | None

    @property
    def beds(self) -> list[BedCase]:
        return self.likelihood.beds


def _least_p() -> float:
    """What a replicate more than there are would show."""
    return 1 / (current().windows.signatures.replicates + 1)


class Windows(ObservationModel):
    """Windows of some milliseconds: states drawn from what the frames say; replicates tell bias, spread and nulls."""

    kind = "bed"
    tail = "F, normal and chi-squared tails of sums over windows, as replicates tell their spread, all places counted"

    def __init__(
        self, recordings: Sequence[Recording], hold_out: Sequence[Recording] = (), *, minutes: float | None = None,
        seed: int = 0, progress: Progress = lambda text, share: None, candidates: Sequence[str] | None = None,
        plan: Plan | None = None, cut: bool = True,
    ) -> None:  # fmt: skip
        """``minutes``: the budget, ten where not given; when it is short, members, windows and candidates are left out.

        ``candidates``: names of the mechanisms to try, all where not given. ``plan``: how much is simulated, whatever
        the time. ``cut``: in windows, grains far from the swimmer are walls that move as seen, where that saves much.
        Finished predictions are kept in the user's cache until there is a verdict: a diagnosis that was interrupted
        goes on from there.  Raises InputError for recordings that cannot be used.
        """
        self.rng, self.progress, self.notes = np.random.default_rng(seed), progress, []
        self.judging = np.random.default_rng((seed, 1))  # of its own: what is found does not hang on how it is judged
        progress("cutting windows", 0.01)
        self.start = begin(recordings, hold_out, minutes, seed, candidates, plan, cut, self.notes)
        self.form: BedTrial | None = None
        self.discrepancy: Discrepancy | None = None
        self.scale: BedTrial | None = None
        self.leading: list[BedTrial] = []

    @property
    def plain(self) -> Claim:
        return Claim((), self.alone)

    def recalibrate(self) -> None:
        self.state, self.naive_base = recalibrated(self.start, self.rng, self.progress)
        own = len(self.start.naive_values)
        for free, value in zip(self.state.hypothesis.free[own:], self.state.values[own:], strict=True):
            if abs(value - free.neutral) > current().radii.rough:
                what = "all radii together are" if free.name == "radii" else "the picture is"
                self.notes.append(f"{what} {100 * (value - free.neutral):+.2g} % off: a number of every fit")

    def try_candidates(self) -> None:
        self.signatures = signatures_in_time(self.state, self.start.terms, self.notes)
        self.trials, self.chance = screened(self.state, self.signatures, self.rng, self.notes)

    def nulls(self) -> Null:
        self.null = self.chance.null(self.trials[0] if self.trials else None)
        return self.null

    def search(self, null: Null | None) -> Claim:
        search, p = self.state, self.null.p
        self.trials, self.leading = leading_laws(search, self.trials, self.chance, p, self.notes)
        self.progress("refining what was found", 0.78)
        self.alone = without_law(search)
        answer = self._refined(self.leading)
        if answer.unexplained > current().windows.search.unexplained and p <= current().verdict.alarm:
            self.form, ahead = beyond_names(search, answer, self.trials, self.notes)
            if self.form is not None and ahead:
                self.trials = [self.form, *self.trials]
                answer = by_form(search, self.form, answer.unexplained)
        return Claim(tuple(answer.laws), answer)

    def _refined(self, leading: Sequence[BedTrial]) -> Answer:
        alone = self.start.wrong is None
        return refined(self.state, self.alone, leading, self.trials, self.signatures, alone, self.rng, self.notes)

    def runners_up(self, judged: Judgement) -> Iterator[Claim]:
        """Those beyond the nulls that come next, each refined as if it led."""
        taken = {law.label for law in judged.claim.laws}
        for trial in self.leading:
            if self.state.clock.late(current().windows.budget.second):
                return
            if trial.label not in taken:
                self.progress(f"{trial.label} in its place", 0.87)
                answer = self._refined([trial])
                if answer.laws:
                    yield Claim(tuple(answer.laws), answer)

    def weigh(self, claim: Claim) -> Weighed:
        self.progress("what explains", 0.87)
        search, answer = self.state, claim.fit
        self.before = before_of(search)
        named, forms = weighed(search, answer, self.form, self.trials, self.before, self.judging)
        told = tuple(Form(Claim((t,), by_form(search, t, answer.unexplained)), e, t.worth) for t, e in forms)
        return Weighed(named, told, possible=True, few=True)

    def mismatch(self, claim: Claim) -> Mismatch:
        moved = moved_away(self.state, self.naive_base, self.start.naive_values, self.alone.covariance)
        if not claim.laws and self.null.p <= current().verdict.alarm:
            self.notes.append("windows ask for a law more than those of replicates do, but none stands that was tried")
        return Mismatch.of(claim.laws, min(self.null.p, self._p_left), moved)

    @property
    def _p_left(self) -> float:
        """p of what recalibration leaves, as a whole: none of the nulls leaves as much, or 1."""
        return _least_p() if self.alone.unexplained > 2 * current().windows.search.unexplained else 1.0

    def hold_out(self, judged: Judgement) -> HeldOut:
        self.progress("held-out windows", 0.88)
        search, start = self.state, self.start
        likelihood = search.likelihood
        answer, predicted, gain, outcome = on_held_out(search, start, judged.claim.fit, self.judging, self.notes)
        laws, share = list(answer.laws), judged.explained if answer.laws else None
        if start.wrong is not None:
            if outcome == "fails":
                self.notes.append(f"held-out windows are predicted worse with {judged.claim.label}: it is withdrawn")
                answer, laws = self.alone, []
                predicted["revised"] = predicted["recalibrated"]
            self.scale, predicted, gain, outcome = scale_errors(search, start, predicted, gain, outcome, self.judging)
            if "recalibrated" not in predicted:
                self.notes.append("with the picture as it is the scene cannot be run")
            # what was told beside a wrong scale is the second law; without the scale nothing is right
            laws, self.trials = [self.scale, *laws], [self.scale, *self.trials]
            self.null = replace(self.null, case=max(self.null.case, float(self.scale.gain or 0.0)))
            share = explained_by_scale(search, answer.judge, predicted, self.judging)
        self.predicted = predicted
        train, held = (
            {label: errors(likelihood, rows, windows).rms for label, rows in predicted.items()}
            | {"noise_floor": noise_floor(likelihood, windows)}
            for windows in (likelihood.training, likelihood.held)
        )
        window = float(np.median([bed.span for bed in likelihood.beds]))
        return HeldOut(train, held, outcome, gain, Claim(tuple(laws), answer), share, window)

    def fails_predictive_check(self, judged: Judgement) -> bool:
        self.discrepancy = predictive_check(self.state.likelihood, self.predicted.get("recalibrated"))
        if self.discrepancy is not None:
            self.notes.append(self.discrepancy.text)
        return self.discrepancy is not None

    def locate(self, judged: Judgement) -> Sequence[Place]:
        search, scene = self.state, self.state.likelihood.beds[0].scene
        if not judged.claim.laws and "recalibrated" in self.predicted:
            self.predicted["revised"] = self.predicted["recalibrated"]
        frequency = self.frequencies()
        places: list[Place] = []
        if judged.verdict == "missing_physics":
            for trial in judged.claim.laws:
                z, p = after_looks(chance_of_law(trial, search.likelihood), len(self.trials))
                places += place_of(trial, scene, z, p)
        found = places_of(search, judged.claim.fit, self.predicted, judged.verdict)
        if self.discrepancy is not None and judged.verdict != "no_mismatch":
            found.insert(0, self.discrepancy.place)
        return [replace(place, frequency=frequency) for place in (*places, *found)]

    def frequencies(self) -> tuple[float, float] | None:
        """The lowest and the highest of the drive [Hz]."""
        found = [f for b in self.state.likelihood.beds if (f := b.frequency()) is not None]
        return (min(found), max(found)) if found else None

    def left(self, judged: Judgement) -> Left:
        search, answer = self.state, judged.claim.fit
        self.excess = excess_of(search, self.start, answer, self.predicted)
        complete, remains = left_of(
            search,
            answer,
            self.predicted,
            judged,
            self.excess,
            self.discrepancy,
            self.trials,
            self.chance.level,
        )
        return Left(complete, remains)

    def beside(self, judged: Judgement) -> list[tuple[BedTrial, bool]]:
        laws = [t for t in (judged.claim.laws or judged.withdrawn) if t is not self.scale]
        beside = rivals_of(laws[0] if laws else None, [t for t in self.trials if t is not self.scale])
        return [(t, same) for t, same in beside if all(t.mechanism != law.mechanism for law in laws[1:])]

    def refitted(self) -> list[BedTrial]:
        late = self.state.clock.late(current().windows.budget.rivals)
        tried = [] if late else [t for t in self.trials if t.gain is not None and t.worth > 0]
        return sorted(tried, key=lambda t: -t.worth)

    def share(self, law: BedTrial) -> Explained | None:
        return explained_by_trial(self.state, law, self.before, self.judging)

    def gains(
        self, judged: Judgement, fallen: Sequence[BedTrial], beside: Sequence[BedTrial]
    ) -> dict[str, float | None]:
        leading = list({t.label: t for t in (*fallen, *beside)}.values())[: current().windows.search.rivals]
        if self.state.clock.late(current().windows.budget.rivals):
            return {}
        return dict(rival_gains(self.state, self.predicted.get("recalibrated"), leading))

    def propose(self, judged: Judgement, rivals: Sequence[Rival]) -> Proposal | None:
        search, laws = self.state, judged.claim.laws
        late = search.clock.late(current().windows.budget.proposal)
        if not laws or not rivals or self.start.wrong is not None or late:
            return None
        self.progress("the next experiment", 0.93)
        return propose(search.likelihood, search.hypothesis, search.values, laws[0], rivals[0].law, search.used)

    # ---- what is handed over

    def mechanisms(self, course: Course) -> list[dict[str, Any]]:
        scene = self.state.likelihood.beds[0].scene
        return [entry_of(trial, scene, course.held.gain) for trial in course.judged.claim.laws]

    def adjusted(self) -> dict[int, Free]:
        return dict(enumerate(self.start.naive.free))

    def interval(self, course: Course, k: int) -> tuple[float, float | None, float | None]:
        answer, f = course.judged.claim.fit, self.start.naive.free[k]
        value, half = float(answer.values[k]), half_interval(float(answer.covariance[k, k]))
        ends = (max(value - half, f.low), min(value + half, f.high)) if math.isfinite(half) else (None, None)
        return (value, *ends)

    def false_alarm(self, course: Course) -> float:
        p = self.null.p if course.judged.claim.laws else min(self.null.p, self._p_left)
        return p if self.discrepancy is None else min(p, max(self.discrepancy.place.p, _least_p()))

    def revised(self, course: Course) -> dict[str, Scene]:
        values = course.judged.claim.fit.values[: len(self.state.values)]
        laws = course.judged.claim.laws
        believed = self.start.naive if self.start.wrong is not None else self.start.hypothesis
        return {bed.name: revised_scene(bed, believed, values, laws) for bed in self.state.likelihood.beds}

    def used(self) -> tuple[Used, ...]:
        found = []
        for bed in self.state.likelihood.beds:
            part = HELD_OUT if not bed.training.any() else TRAINING if bed.training.all() else PARTLY
            found.append(Used.of(bed.given, part, bed.dt))
        return tuple(found)

    def evidence(self, course: Course) -> BedFinding:
        judged, search = course.judged, self.state
        shown = None
        if judged.verdict != "no_mismatch":
            model = "naive" if judged.verdict == "recalibrate" else "recalibrated"
            scene = self.start.naive, self.start.naive_values
            if model != "naive":
                scene = (self.start.naive if self.start.wrong is not None else search.hypothesis), search.values
            if model in self.predicted:
                shown = body_map(search.likelihood, self.predicted[model], *scene)
        return BedFinding(
            search.likelihood, judged.verdict, self.start.naive.terms, list(judged.claim.laws), self.trials,
            self.null.gains,
            self.null.case, self.chance.level, self.predicted, shown,
        )  # fmt: skip

    def tables(self, course: Course) -> tuple[Table, ...]:
        rows = [
            [
                t.label, f"{t.linear:.0f}", "–" if t.gain is None else f"{t.gain:.0f}", f"{t.signature.surviving:.2f}",
                ", ".join(f"{v:.3g}" for v in t.values),
            ]
            for t in self.trials[:25]
        ]  # fmt: skip
        table = Table(
            "Candidates", ("law", "gain, first order", "gain, simulated", "surviving", "numbers"), rows, (1, 2, 3),
            "Gains are falls in χ² of the training windows after recalibration.",
        )  # fmt: skip
        return (table,) if rows else ()

    @property
    def runs(self) -> int:
        return self.state.likelihood.runs

    def done(self) -> None:
        self.start.store.forget()


def diagnose_bed(
    training: Sequence[Recording], held: Sequence[Recording] = (), *, seed: int = 0, **options: Any
) -> Diagnosis:
    """Explain recordings of a swimmer and its grains, both seen, by what their scene lacks.

    ``seed``: of draws, replicates and nulls;  ``options``: those of ``Windows``: minutes, progress, plan, ...
    Raises InputError for recordings that cannot be used.
    """
    return diagnose_by(Windows(training, held, seed=seed, **options), seed)
