"""Whole tracks of free, pinned, sprung and colliding bodies: how they are held against simulations, step by step."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from copy import copy, deepcopy
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ... import distributions as stats
from ...laws import all_laws, has_role
from ...recording import Recording
from ...scene import Scene
from ..candidates import asked_terms, in_contact_alone, names_of, unseen_terms
from ..criteria import current
from ..data import Case
from ..driven_terms import as_an_answer
from ..explained import Explained, Scores, explained, spoken_against, spread_with_mismatch
from ..hypothesis import Failed, Free, left_out
from ..judge import (
    HELD_OUT_OFF,
    Claim,
    Completeness,
    Form,
    Judgement,
    Mismatch,
    Remains,
    Weighed,
    as_large_by_chance,
    bends,
    best_form,
    completeness,
    judge,
    named_verdict,
    not_named,
    remains_of,
    unexplained,
)
from ..mechanisms import CLAIMED, NOTHING, UNKNOWN, field_alone, plainly
from ..model import Course, HeldOut, Left, ObservationModel, Proposal, Rival
from ..noise import LikelyNoise, squares_in_slow_noise
from ..pipeline import diagnose_by, judged_by_training
from ..places import Place
from ..result import Diagnosis, Progress, Used
from ..significance import Null, after_looks, price
from ..trial import rows_of
from .all_frames import asked_by_all_frames
from .begun import held_out_later, without_first_frames
from .believed import off_belief
from .blocks import make_blocks, score
from .choose import absurd, choose, of_the_apparatus, rivals_of, worth
from .experiment import propose, with_clock
from .fit import Fitter, joined
from .fitted import Fit, may_be_absent
from .forms import Alike, fitted_as_good, forms_as_good, left_standing
from .held_out import (
    Errors,
    carried_on,
    errors_of_repeats,
    held_out_errors,
    is_lost,
    largest_when,
    learn_memory,
    left_of_held_out,
    meets_when_scored,
    noise_floor,
    paired_verdict,
    right_law_errors,
    training_errors,
    windows_of_lost,
    worse_by_chance,
)
from .hidden import slowed_beside
from .innovations import Whiteness, WindowMap, locate, seen_by, series_of, variance_by_case, whiteness, window_map
from .intervals import with_company, with_doubt, with_limits, with_none_beyond, with_other_choices, with_slopes
from .kicks import all_kicks, chance_of_one, not_of, remains_of_kicks, told_of_few
from .kicks import told as told_of
from .line import strongest_line
from .name import Trial, spread_of
from .pairs import Exchange, as_well_in_place, two_alike
from .rivalled import as_simple, predicts_better
from .score_test import chance_of_more
from .settle import (
    apparatus_beside,
    has_idle_entry,
    is_its_special_case,
    known_together,
    reaches_its_end,
    that_earn_their_place,
    that_may_be_absent,
    with_numbers_that_were_found,
    within_belief,
    without_idle_numbers,
    without_labels,
    without_one,
)
from .signatures import make_bank
from .study import (
    FittedAlone,
    Study,
    beyond_nulls,
    calibrated,
    chosen_alone,
    explained_by,
    finely,
    search_with,
    study_of,
    tried_alone,
    tried_besides,
    with_close_joints,
    with_closer_joints,
    with_memory,
    without_laws,
    without_outliers,
    without_single_ones,
)
from .touch import away_from_radii, nearer_than_radii
from .undeclared import Instead, declared, in_a_lost_scene, instead_of
from .verdict import (
    Told,
    as_a_push,
    as_a_spring,
    as_the_picture,
    at_any_shape,
    at_its_bound,
    below,
    beside_its_own,
    revised_scene,
    used,
)

BENDS_AS_WELL = "more than noise is left, and a picture or a clock that is off looks like a little of anything"
MAY_BE_ABSENT = "noise, or a table that is not quite level, may be all of it"
TOGETHER = "only what they do together is known, any strength of one will do with one of the other: neither is named"
FREED = "which nobody declared adjustable, is fitted: as it is believed more than noise is left, whatever is named"
SHOWS_LATER = (
    "held-out data are off by more than the scene as it is can leave: something is missing that what was learnt from"
    " does not show; all of a recording is learnt from where another one of the same apparatus is held out (--hold-out)"
)
MORE_TO_SEE = "more of it lies along the signature of a law than noise would have there"
PREDICTED_BETTER = "with no more numbers, held-out data are predicted better with"
UNEXPLAINED = "the scene is off by more than noise, and no law that explains it stands"
LOST = (
    "a run from one start is lost before its end, whatever the law: held-out frames are scored in windows with starts"
    " of their own"
)
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
    white_recalibrated: Whiteness
    white_revised: Whiteness
    windows: WindowMap | None
    spread: float
    train: dict[str, Errors]
    held: dict[str, Errors]
    floor: tuple[float | None, float | None]
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
            spent = (time.monotonic() - began) / 60
            return minutes is not None and spent > minutes * share

        self.progress = progress
        self.study = study_of(recordings, hold_out, np.random.default_rng(seed), progress, late)
        self.notes = self.study.notes
        self.tightened = 0.0  # what closer joints of the segments added to chi2 of what was found
        self.dropped: dict[str, str] = {}
        self.undeclared: list[Instead] = []  # numbers that nobody declared adjustable, and that would do
        self._asked_instead: Judgement | None = None  # of which those were asked
        self.near: list[tuple[Trial, bool]] = []  # what could stand in place of what was found
        self.exchanged: Sequence[Exchange] = ()
        self.beside_names: list[str] = []  # notes on laws of the revised scene that are not named
        self._draws: np.random.Generator | None = None
        self._looked_at: set[str] = set()
        self.best_form: Trial | None = None
        self.windows: WindowMap | None = None
        # recordings with impacts that a run goes on through, and what the start of it adds to the noise there
        self.followed: dict[str, float] = {}
        # recordings that no run from one start follows to their ends, with how many windows are; and whether asked
        self.lost: dict[str, int] = {}
        self._asked_lost = False
        self.floor: tuple[float | None, float | None] = (None, None)
        self._completeness: dict[int, tuple[Fit, Completeness]] = {}
        self.begun_in_hands = False  # first frames were left out of what is learnt from, see ``without_first_frames``
        self.let_go: list[str] | None = None  # notes on held-out recordings that begin so, once they were asked
        self._of_the_unseen: list[str] = []  # notes on a law of what nobody sees, and what stands beside it
        self.beside_more: Fit | None = None  # what is claimed, with the intervals that it has beside one more law

    @property
    def plain(self) -> Claim:
        return Claim((), self.tried.recalibrated)

    def recalibrate(self) -> None:
        self.naive_fit, self.recalibrated_fit = calibrated(self.study)

    def try_candidates(self) -> None:
        fits = without_single_ones(self.study, self.naive_fit, self.recalibrated_fit)
        self.study, self.naive_fit, self.recalibrated_fit = fits
        self.study, self.recalibrated_fit = with_close_joints(self.study, self.recalibrated_fit)
        tried = tried_alone(self.study, self.naive_fit, self.recalibrated_fit)
        later = without_first_frames(self.study, tried)
        if later is not None:
            self.study, self.begun_in_hands = later, True
            self.recalibrate()
            tried = tried_alone(self.study, self.naive_fit, self.recalibrated_fit)
        self.study, self.tried = with_memory(*without_outliers(self.study, tried))

    def with_unseen(self, told: int, claim: Claim) -> Tracks | None:
        roles = ("source", "beat") if self._goes_to_and_fro(claim) else ("source",)
        terms = unseen_terms(self.study.cases, *roles)
        if not terms or self.null is None or self.study.late(current().budget.settling):
            return None
        other = copy(self)
        other.study = replace(self.study, rng=deepcopy(self.study.rng), notes=self.notes[:told], seeks=roles)
        other.notes = other.study.notes
        other.dropped, other.undeclared, other.beside_names = dict(self.dropped), [], []
        other._looked_at, other._completeness = set(self._looked_at), dict(self._completeness)
        other.tried = tried_besides(other.study, self.tried, terms)
        other.chosen = chosen_alone(other.study, other.tried, self.null)
        alone = other.chosen if other.chosen is not None and has_role(other.chosen.mechanism, *roles) else None
        if alone is not None and not has_role(alone.mechanism, "beat"):
            return other
        # without a drag a force at the frequency of a resonance makes its swings smaller, too
        best, used = (claim.fit, sum(t.used for t in claim.laws)) if alone is None else (alone.fit, alone.numbers)
        search = search_with(other.study, other.tried, other.study.fitter)
        slowed = None if best is None else slowed_beside(search, self.tried.alive, terms, best, used)
        other.chosen = slowed or alone
        return other if other.chosen is not None else None

    def _goes_to_and_fro(self, claim: Claim) -> bool:
        """Whether most of what a claim, or the scene without laws, leaves is an oscillation at one frequency."""
        few, training = current().left, self.study.training
        for fit in (claim.fit, self.tried.recalibrated):
            line = strongest_line(fit, training)
            if line is not None and line.paid > few.looks and line.gain > few.line * fit.excess:
                return True
        return False

    def as_unseen(self, judged: Judgement) -> Judgement | None:
        laws = judged.claim.laws
        # one that is a candidate of itself, as a law of the user's own, has its name
        unseen = [t for t in laws if has_role(t.mechanism, "source") and all_laws()[t.term.law].candidate != "named"]
        others = [t for t in laws if all(t is not u for u in unseen)]
        if not unseen:
            return judged if any(has_role(t.mechanism, "beat") for t in laws) else None
        told = Told(judged.claim.fit, self.spread, self.study.cases)
        self.notes[:] = [note for note in self.notes if note not in self._of_the_unseen]  # another claim's
        (entry, *_), phrase = told.entries(unseen[0], None), plainly(unseen[0].mechanism)
        self._of_the_unseen = [
            *(f"beside it, in the revised scene: {e['name']}: {e['expression']}" for t in others
              for e in told.entries(t, None)),
            f"{phrase} at which nothing is seen, as of a magnet below a table: {entry['expression']}",
        ]  # fmt: skip
        self.notes += self._of_the_unseen
        return replace(judged, verdict="unmodelled", claim=replace(judged.claim, laws=(*unseen, *others)))

    def passes(self, claim: Claim) -> bool:
        return self.completeness(claim.fit).passes

    def nulls(self) -> Null | None:
        self.null, self.chosen = beyond_nulls(self.study, self.tried)
        return self.null

    def search(self, null: Null | None) -> Claim:
        claim = self._search()
        follows = self._without_laws(claim)
        if follows is not None:
            # all that was compared was compared with a scene that lost its way: again, with one that follows
            tried = tried_alone(self.study, self.tried.naive, follows, self.tried.alive)
            claim = self._search_again(*with_memory(*without_outliers(self.study, tried)))
        if claim.laws and self.fitter.segmented:
            claim = self._joined_more_closely(claim)
        if len(claim.laws) > 1:
            # where one law leaves more than noise, only several together show how slow the noise is
            study, tried = with_memory(self.study, self.tried, claim.fit)
            if study is not self.study:
                claim = self._search_again(study, tried)
        return claim

    def _search_again(self, study: Study, tried: FittedAlone) -> Claim:
        """The claim once all that was compared has been fitted again."""
        self.study, self.tried = study, tried
        self.nulls()
        return self._search()

    def _joined_more_closely(self, claim: Claim) -> Claim:
        """The claim of the search with closer joints, where impacts show that way that one more law is missing.

        It stands where it has more laws, or leaves noise alone where the claim did not; otherwise all is searched as
        before: joints that close know the names that do as well no better.
        """
        before, passed = (self.study, self.tried), self.completeness(claim.fit).passes
        after = with_closer_joints(*before, self.fitter, claim.fit)
        if after[0] is before[0]:
            return claim
        again = self._search_again(*after)
        cured = bool(again.laws) and not passed and self.completeness(again.fit).passes
        if len(again.laws) > len(claim.laws) or cured:
            return again
        return self._search_again(*before)

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
        """Laws of which every number was found; without those that were not, again, where none is left."""
        claim, unfound = self._explained(self.tried, self.chosen)
        missed, dropped = set[str](), self.dropped
        while unfound - missed and not claim.laws and not self.study.late(current().budget.candidates):
            missed |= unfound
            rest = without_laws(self.tried, missed)
            chosen = None if self.null is None else chosen_alone(self.study, rest, self.null)
            if chosen is None:
                break
            claim, unfound = self._explained(rest, chosen)
            dropped = self.dropped = dropped | self.dropped
        return claim

    def _explained(self, tried: FittedAlone, chosen: Trial | None) -> tuple[Claim, set[str]]:
        """What explains, and which laws would have, of which a number ended where its search ends."""
        study, unfound = self.study, set[str]()
        explanation = explained_by(study, tried, chosen)
        found, revised, self.dropped = explanation.laws, explanation.fit, explanation.dropped
        self.near, self.exchanged = list(explanation.near), explanation.exchanged
        self.fitter, self.tightened = study.fitter, 0.0
        if found and self.fitter.segmented:
            loose = revised.chi2
            self.fitter, revised = joined(self.fitter, revised)
            self.tightened = max(revised.chi2 - loose, 0.0)
            found = [replace(t, fit=revised) for t in found]
        self.spread = spread_of(revised, study.training) if found else tried.spread
        if found:
            self.tried, self.fitter, found, revised = finely(
                study, self.tried, self.fitter, found, revised, self.spread
            )
            plain, spread = self.tried.recalibrated, spread_of(revised, study.training)
            found, revised, gone = with_numbers_that_were_found(self.fitter, plain, found, revised, spread)
            self.dropped |= gone
            unfound = set(gone)
            if gone:
                # what could stand in place of one of several laws stood beside those that are gone, too
                self.near = []
                self.fitter = self.fitter if found else study.fitter
                self.spread = spread_of(revised, study.training) if found else tried.spread
        return Claim(tuple(found), revised), unfound

    def weigh(self, claim: Claim) -> Weighed:
        """Scores of unseen blocks: recalibrated, named, and the nameless forces that gain most."""
        study, tried, rng = self.study, self.tried, self.study.rng
        study.progress("what explains", 0.72)
        self.blocks = make_blocks(study.cases)
        noise = LikelyNoise.of(seen_by(tried.best, study.training))

        def scores(fit: Fit) -> Scores:
            return score(fit, self.blocks, study.predictor, noise, rng)

        before = self.before = scores(tried.recalibrated)
        varies = spread_with_mismatch(before) if before.sums else 0.0
        self.scores: dict[str, Scores] = {}
        named = None
        if claim.laws:
            self.scores[claim.label] = scores(claim.fit)
            named = spoken_against(explained(self.scores[claim.label], before, rng, varies=varies))
        most = max((t.gain for t in tried.forms), default=0.0)
        forms = []
        for trial in tried.forms:
            if trial.fit is not None and trial.gain > current().left.forms * most and trial.gain > 0:
                form = Claim((trial,), trial.fit)
                self.scores[form.label] = scores(trial.fit)
                share = explained(self.scores[form.label], before, rng, varies=varies)
                later = not claim.laws or not math.isfinite(claim.laws[0].inner) or trial.inner <= claim.laws[0].inner
                forms.append(Form(form, share, worth(trial, tried.spread), later))
        best = best_form(forms)
        self.best_form = None if best is None else best.claim.laws[0]
        # forms were fitted to segments as they were: what closer joints of the names cost is no gain of theirs
        gain = (tried.recalibrated.chi2 - claim.fit.chi2 + self.tightened) / self.spread
        gain -= 2 * sum(t.used for t in claim.laws)
        ahead = gain - max((worth(f.claim.laws[0], self.spread) for f in forms), default=-np.inf)
        self.weighed = Weighed(named, tuple(forms), ahead=ahead, plainer=self._plainer(claim, forms, gain))
        return self.weighed

    def _plainer(self, claim: Claim, forms: Sequence[Form], gain: float) -> str:
        """The form that does as well as names with a special fault among them and has no more numbers, "" for none."""
        if not any(t.special for t in claim.laws):
            return ""
        numbers, least = sum(t.used for t in claim.laws), gain - current().verdict.same
        # each law beside the first was looked for among all, and chance may have given as much as it had to earn
        least -= (len(claim.laws) - 1) * price(len(self.tried.terms), 0)
        laws = [f.claim.laws[0] for f in forms]
        does = [t for t in laws if t.used <= numbers and worth(t, self.spread) > least]
        return max(does, key=lambda t: worth(t, self.spread)).label if does else ""

    def completeness(self, fit: Fit) -> Completeness:
        """Whether what a fit leaves of the training part passes for noise, or is less than matters, as no kick does."""
        found = self._between_kicks(fit)
        return replace(found, chance=min(found.chance, chance_of_one()), passes=False) if self.study.kicked else found

    def _between_kicks(self, fit: Fit) -> Completeness:
        """The same of the stretches between velocities that change at once for no reason that the scene has."""
        if id(fit) not in self._completeness:
            found = completeness(series_of(fit, self.study.training))
            if not found.passes and _below_tolerance(fit, self.study.training):
                found = Completeness(found.noise, found.chance, True)
            self._completeness[id(fit)] = fit, found
        return self._completeness[id(fit)][1]

    def mismatch(self, claim: Claim) -> Mismatch:
        study, tried = self.study, self.tried
        left = self.completeness(tried.recalibrated)
        found = Mismatch.of(claim.laws, left.chance, bool(study.adjustables) and self._moved())
        if left.passes and _below_tolerance(tried.recalibrated, study.training):
            found = replace(found, real=False)
        laws = list(claim.laws)
        if found.real and laws:
            _, alike = within_belief(laws, claim.fit, tried.recalibrated, self._fitter_of(claim.fit), self.spread)
            # where they leave more than noise, so do masses and radii: something is missing, whatever does the same
            if len(alike) == len(laws) and self.completeness(claim.fit).passes:
                self.notes.append(f"{claim.label}: {AS_BELIEVED}")
                found = replace(found, real=False)
        return found

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
        if judged.claim.nameless:
            # numbers of a form are known as well as what it leaves says, not as the names that it stands for
            self.spread = spread_of(judged.claim.fit, self.study.training)
        if judged.verdict not in CLAIMED:
            return judged
        count = len(self.tried.recalibrated.values)
        late = partial(self.study.late, current().budget.settling)
        fitter = self._fitter_of(judged.claim.fit)
        fit = with_limits(fitter, judged.claim.fit, count, self.spread, late)
        laws = judged.claim.laws
        if fit.profiles and len(laws) > 1:
            # through impacts a number may be known far less well than the curvature at its place says
            search = search_with(self.study, self.tried, fitter)
            kept, alone, gone = that_earn_their_place(search, laws, fit)
            if gone:
                self.dropped |= gone
                laws, fit = tuple(kept), with_limits(fitter, alone, count, self.spread, late)
        if loose := known_together(laws, fit, count, self.spread):
            self.notes.append(f"{Claim(tuple(loose), fit).label}: {TOGETHER}")
            return not_named(judged.claim, self.weighed, self.plain)
        fit, alike = within_belief(laws, fit, self.tried.recalibrated, fitter, self.spread)
        if alike and len(alike) < len(laws):
            laws = self._unnamed(laws, alike, fit, AS_BELIEVED)
        found = self._without_faults(laws, fit)
        if isinstance(found, Judgement):
            return found
        laws, fit = found
        if fit.limits:
            names = ", ".join(fit.hypothesis.free[k].name for k in fit.limits)
            self.notes.append(
                f"{names}: known only together with others, or unevenly: their intervals are those of chi2 itself"
            )

        def doubted(of: Fit) -> Fit:
            of = with_doubt(fitter, of, count, self.spread)
            return with_slopes(fitter, of, count, self.spread, self.tried.terms)

        fit = doubted(fit)
        # of numbers that a richer law adds, none may be all there is, as they are known in the end
        at_rest = {t.label for t in laws if is_its_special_case(replace(t, fit=fit), self.spread)}
        if at_rest and not late():
            search = search_with(self.study, self.tried, fitter)
            plainer, fit = without_idle_numbers(search, laws, fit, at_rest)
            laws, fit = tuple(plainer), doubted(fit)
        fit, notes = with_other_choices(fitter, fit, count, self.spread, self.tried.terms, late)
        self.notes += notes
        doubtful = that_may_be_absent(laws, fit, self.spread, doubted)
        if 0 < len(doubtful) < len(laws):
            laws = self._unnamed(laws, doubtful, fit, MAY_BE_ABSENT)
        sure = [t.label for t in laws if not any(t is u for u in doubtful)]
        fit = with_none_beyond(fit, sure, self.spread)
        if field_alone(t.mechanism for t in laws):
            return not_named(judged.claim, self.weighed, self.plain)
        # a law that is no longer named may have been the only one that is no fault of the apparatus
        return self._with_its_notes(
            self._by_names_alone(
                self._without_ended(
                    replace(judged, verdict=named_verdict(laws), claim=replace(judged.claim, laws=laws, fit=fit))
                )
            )
        )

    def _without_faults(
        self, laws: tuple[Trial, ...], fit: Fit
    ) -> tuple[tuple[Trial, ...], Fit] | Judgement:
        """Laws without faults of the apparatus that take a part of anything, where more than noise is left.

        The names have to explain without what is not named, and better than a form in place of them: the judgement
        where they do not. Where they explain enough with a tilt or a scale and not without, it is no term of a series.
        """
        plain, fitter = self.tried.recalibrated, self._fitter_of(fit)
        idle, without = ([], None) if self.completeness(fit).passes else apparatus_beside(laws, fit, plain, fitter)
        if without is None:
            return laws, fit
        others, gain = [t for t in laws if not any(t is a for a in idle)], plain.chi2 - without.chi2
        less = Claim(tuple(replace(t, fit=without, gain=gain) for t in others), without)
        told, ended = len(self.notes), [why for t in idle if (why := absurd(replace(t, fit=fit)))]
        again = judged_by_training(self, less)
        if again.verdict == "unmodelled":
            if ended or any(t.special for t in idle):
                return again
            del self.notes[told:]
            return laws, fit
        if not ended:
            return self._unnamed(laws, idle, fit, BENDS_AS_WELL), fit
        # a number that was not found is in no scene
        self.notes.append(f"{Claim(tuple(idle), fit).label}: left out, {ended[0]}")
        late = partial(self.study.late, current().budget.settling)
        fit = with_limits(fitter, without, len(plain.values), self.spread, late)
        return tuple(replace(t, fit=fit) for t in less.laws), fit

    def _with_its_notes(self, judged: Judgement) -> Judgement:
        """A judgement, without notes on what stays in the revised scene where that is not told."""
        if judged.verdict == "unmodelled":
            self.notes[:] = [note for note in self.notes if note not in self.beside_names]
        return judged

    def _by_names_alone(self, judged: Judgement) -> Judgement:
        """With the share of the laws that are named, alone with the adjustables, by which they are judged.

        What stays in the revised scene without a name may have explained most: a name that needs it explains nothing.
        """
        laws, fit, plain = judged.claim.laws, judged.claim.fit, self.tried.recalibrated
        named = {t.label for t in laws}
        gone = [t.label for t in fit.hypothesis.terms[len(plain.hypothesis.terms) :] if t.label not in named]
        if judged.verdict == "unmodelled" or judged.explained is None or not gone:
            return judged
        alone = without_labels(self._fitter_of(fit), plain, fit, gone)
        gain = plain.chi2 - alone.chi2
        claim = Claim(tuple(replace(t, fit=alone, gain=gain) for t in laws), alone)
        lost = (alone.chi2 - fit.chi2) / self.spread - 2 * (len(fit.values) - len(alone.values))
        weighed = replace(self.weighed, named=spoken_against(self._share_of(alone)), ahead=self.weighed.ahead - lost)
        again = judge(claim, weighed, self.mismatch(claim), self.plain, self.notes)
        return again if again.verdict == "unmodelled" else replace(judged, explained=again.explained)

    def _without_ended(self, judged: Judgement) -> Judgement:
        """Without laws of which an interval reaches where its search ends: the others have to explain without them."""
        laws, fit, plain = judged.claim.laws, judged.claim.fit, self.tried.recalibrated
        why = {t.label: text for t in laws if (text := reaches_its_end(t, fit, self.spread))}
        if not why:
            return judged
        if len(why) == len(laws):
            self.notes.append(f"{judged.claim.label} {judged.claim.are} not named: {next(iter(why.values()))}")
            return not_named(judged.claim, self.weighed, self.plain)
        gone, without = without_one(self._fitter_of(fit), plain, fit, [t for t in laws if t.label in why])
        self.notes.append(f"{gone.label}: left out, {why[gone.label]}")
        gain = plain.chi2 - without.chi2
        less = Claim(tuple(replace(t, fit=without, gain=gain) for t in laws if t is not gone), without)
        again = judged_by_training(self, less)
        return again if again.verdict == "unmodelled" else self.settle(again)

    def _unnamed(self, laws: Sequence[Trial], those: Sequence[Trial], fit: Fit, why: str) -> tuple[Trial, ...]:
        """The laws but for those that stay in the revised scene and are not named, which a note says."""
        gone = Claim(tuple(those), fit)
        self.beside_names.append(f"{gone.label}, in the revised scene, {gone.are} not named: {why}")
        self.notes.append(self.beside_names[-1])
        return tuple(t for t in laws if not any(t is u for u in those))

    def alike(self, judged: Judgement) -> Sequence[Claim]:
        if len(judged.claim.laws) > 1:
            return self._alike_in_sets(judged.claim.laws)
        winner, ahead = judged.claim.laws[0], partial(worth, spread=self.spread)
        alive = _that_stand(self.tried.alive, winner, self.spread)
        same = [t for t in alive if ahead(winner) - ahead(t) < current().verdict.same]
        if winner.special:  # what bends the picture takes a part of whatever is smooth: later data tell
            laws = sorted((t for t in alive if not t.special), key=ahead, reverse=True)
            same += [t for t in laws[: current().verdict.instead] if not any(t is u for u in same)]
        least = self.tried.inner["recalibrated"] + self.study.inner.slack
        claims = _in_order(same, winner, alive, self.spread, least, len(self.tried.terms))
        numbers = max(t.used for t in (winner, *same))
        if numbers < 2 or self.study.late(current().budget.pairs):
            return claims
        return _with_two(claims, self._two_alike(judged, numbers), self.spread)

    def _two_alike(
        self, judged: Judgement, numbers: int, behind: Callable[[Fit], float] | None = None
    ) -> list[Claim]:
        """Claims of two laws with no more numbers in place of the one that is claimed, see ``two_alike``."""
        search = search_with(self.study, self.tried, self._fitter_of(judged.claim.fit))
        pairs = two_alike(search, self.tried.alive, judged.claim.laws[0], numbers, behind)
        pairs = [p for p in pairs if not any(absurd(t) for t in p)]
        return [Claim(tuple(p), p[0].fit) for p in pairs if p[0].fit is not None]

    def alike_in_slow_noise(self, judged: Judgement) -> Sequence[Claim]:
        """Laws, and two of them, that would be told from the claim in white noise alone, where no slow part was found.

        Few frames hide one: each fit has taken the slowest noise away. Two laws differ in something slow, and noise
        that is correlated over as long may leave open which it is.
        """
        winner, training = judged.claim.laws[0], self.study.training
        if len(judged.claim.laws) > 1 or winner.fit is None or any(c.noise.size for c in training):
            return []
        alive, same = _that_stand(self.tried.alive, winner, self.spread), current().verdict.same
        mine, _ = squares_in_slow_noise(seen_by(winner.fit, training))

        def behind(fit: Fit) -> float:
            its, may_be = squares_in_slow_noise(seen_by(fit, training))
            return float(np.min((its - mine)[may_be]) / self.spread)

        found = []
        for t in alive:
            gained = worth(t, self.spread)
            in_the_class = t is winner or worth(winner, self.spread) - gained < same
            if in_the_class or t.fit is None or t.special or gained <= current().verdict.noticed:
                continue
            if behind(t.fit) - 2 * (winner.used - t.used) < same:
                found.append(t)
        least = self.tried.inner["recalibrated"] + self.study.inner.slack
        claims = _in_order(found, winner, alive, self.spread, least, len(self.tried.terms))
        if winner.used < 2 or self.study.late(current().budget.pairs):
            return claims
        single = winner.fit

        def newly_behind(fit: Fit) -> float:
            more = len(fit.values) - len(single.values)
            asked = (fit.chi2 - single.chi2) / self.spread + 2 * more < same  # with the class itself
            return math.inf if asked else behind(fit)

        return _with_two(claims, self._two_alike(judged, winner.used, newly_behind), self.spread)

    def _alike_in_sets(self, laws: Sequence[Trial]) -> list[Claim]:
        """The laws with another one in place of one of them, which training data cannot tell from it.

        Not one that gives way to another of these in the apparatus of the recordings.
        """
        found, names, declared = list[Claim](), {t.mechanism for t in laws}, all_laws()
        alike = [e for e in self.exchanged if e.alike and {t.mechanism for t in (*e.keep, e.replaced)} == names]
        first = {(e.replaced.mechanism, n) for e in alike if e.trial.term.suited
                 for n in declared[e.trial.term.law].stands_for}  # fmt: skip
        for e in alike:
            fit = e.trial.fit
            if fit is None or (e.replaced.mechanism, e.trial.mechanism) in first:
                continue
            # with the steps and joints that what is claimed has
            fit = self.fitter.refitted(fit, evaluations=current().intervals.refit)
            gain = self.tried.recalibrated.chi2 - fit.chi2
            several = tuple(replace(t, fit=fit, gain=gain) for t in (*e.keep, e.trial))
            if not any(absurd(t) or is_its_special_case(t, self.spread) for t in several):
                found.append(Claim(several, fit))
        return found

    def parts(self, judged: Judgement) -> Sequence[Claim]:
        plain, fit, found = self.tried.recalibrated, judged.claim.fit, list[Claim]()
        for law, rows in zip(judged.claim.laws, rows_of(judged.claim.laws, len(plain.values)), strict=True):
            if field_alone([law.mechanism]):
                continue
            values = [*fit.values[: len(plain.values)], *fit.values[rows]]
            alone = self.fitter.fit(plain.hypothesis.with_term(law.term), values, fit.starts)
            trial = replace(law, fit=alone, gain=plain.chi2 - alone.chi2)
            if worth(trial, self.spread) > current().verdict.noticed and not absurd(trial):
                found.append(Claim((trial,), alone))
        return sorted(found, key=lambda claim: claim.fit.chi2)

    def predicts_better(self, before: HeldOut, after: HeldOut) -> bool:
        return paired_verdict(before.detail, after.detail, self.study.rng) == "holds"

    def hold_out(self, judged: Judgement) -> HeldOut:
        revised = judged.claim.fit
        self.study.progress("held-out data", 0.8)
        if self.begun_in_hands and self.let_go is None:
            both = [self.tried.recalibrated, revised]
            cases, self.let_go = held_out_later(self.study.cases, both, self.study.predictor, self.study.stop)
            self.study = replace(self.study, cases=cases)
        study = self.study
        fits = {"naive": self.tried.naive, "recalibrated": self.tried.recalibrated, "revised": revised}
        self.train = {name: training_errors(fit, study.training) for name, fit in fits.items()}
        cut = [c for c in study.cases if any(len(f.segments.get(c.name, ())) > 1 for f in fits.values())]
        rng = self._draws_for(judged.claim.label)
        spreads = {c.name: carried_on(revised, c, study.predictor, rng) for c in cut}
        self.followed = {name: spread for name, spread in spreads.items() if spread < 1}
        self._find_lost(revised)
        self.held = {name: self._held_out(fit) for name, fit in fits.items()}
        study.progress("noise floor", 0.86)
        how = revised, study.cases, study.predictor, study.stop, rng
        self.floor = noise_floor(*how, followed=self.followed, lost=self.lost)
        rms, floor = self.held["revised"].rms, self.floor[1]
        # beyond the floor there may be the errors of the numbers that were found, too
        beyond = rms is not None and floor and rms > current().left.asked * floor
        asked = beyond and not study.late(current().budget.experiment)
        self.right = right_law_errors(*how, followed=self.followed, lost=self.lost) if asked else np.zeros(0)
        outcome = None
        if judged.claim.laws:
            outcome = paired_verdict(self.held["recalibrated"], self.held["revised"], rng)
            if judged.claim.nameless:
                # a curve has no merit but that it predicts: errors that grow are no matter of chance
                outcome = "fails" if outcome != "holds" and self._worse() else outcome
            elif outcome == "fails" and self._excused(judged.claim):
                outcome = "undecided"
            elif outcome == "undecided" and self._refuted(judged.claim):
                outcome = "fails"
        train, held = (
            {name: e.rms for name, e in part.items()} | {"noise_floor": floor}
            for part, floor in zip((self.train, self.held), self.floor, strict=True)
        )
        return HeldOut(
            train, held, outcome, self._gain(self.held["revised"]), judged.claim, judged.explained,
            self.held["revised"].window, {name: e.whole for name, e in self.held.items()},
            self._unlike(judged), self._beyond_the_right_law(), self.held["revised"],
        )  # fmt: skip

    def _find_lost(self, fit: Fit) -> None:
        """Which recordings are scored in windows, as a run from one start says nothing there: of all claims alike."""
        if self._asked_lost:
            return
        self._asked_lost, study = True, self.study
        asked = [c for c in study.cases if c.scored.any() and c.name not in self.followed]
        # random numbers of its own: what is drawn after it is as it would be
        rng, run = deepcopy(study.rng), study.predictor
        windows = {c.name: windows_of_lost(fit, c, run) for c in asked if is_lost(fit, c, run, rng)}
        self.lost = {name: count for name, count in windows.items() if count}
        self.notes += [f"{name}: {LOST}" for name in self.lost]

    def _unlike(self, judged: Judgement) -> bool:
        """Whether held-out data are off by more than the claim leaves where it is right.

        Of a special fault of the apparatus also where something as simple predicts them better.
        """
        bent = bends(judged)
        more = self._more_held_out(bent)
        if more or not bent:
            return more
        rival = self._predicted_better(judged.claim, current().verdict.absent)
        if rival:
            self.notes.append(f"{PREDICTED_BETTER} {rival} than with {judged.claim.label}")
        return bool(rival)

    def _predicted_better(self, claim: Claim, chance: float) -> str:
        """What has no more numbers than a claim and predicts held-out data better, in words; empty where nothing does.

        chance : with which the claim, if it is true, is as far behind
        """
        study, mine = self.study, self.held["revised"]
        if mine.rms is None or not self._matters(mine.rms) or study.late(current().budget.experiment):
            return ""
        plain, tried = self.tried.recalibrated, [*self.tried.alive, *self.tried.forms]
        rivals = as_simple(claim.laws, claim.fit, plain, tried, self.spread)
        how = study.cases, study.predictor, study.stop, study.rng.spawn(1)[0]

        def films(fits: Sequence[Fit]) -> np.ndarray:
            return errors_of_repeats(fits, *how, followed=self.followed, lost=self.lost)

        errors = partial(self._held_out, whole=False)
        best = predicts_better(claim.fit, mine, rivals, errors, films, study.rng.spawn(1)[0], chance)
        return "" if best is None else plainly(best.mechanism)

    def _draws_for(self, label: str) -> np.random.Generator:
        """Random numbers that are the same for every claim that is held out: laws are compared in the same noise.

        A claim that is looked at again, as no other one stands in its place, is so in other noise.
        """
        if self._draws is None:
            self._draws = deepcopy(self.study.rng)
        again = not self._looked_at or label in self._looked_at
        self._looked_at.add(label)
        return self.study.rng if again else deepcopy(self._draws)

    def _excused(self, claim: Claim) -> bool:
        """Whether held-out data are predicted worse by what was not known well enough, not by a law that is none."""
        unsure = self._by_its_start(claim.fit) or self._by_its_numbers() or self._by_chance(claim.fit)
        return unsure and self._earned_on_all_frames(claim)

    def _refuted(self, claim: Claim) -> bool:
        """Whether held-out data are predicted worse, by blocks so few that chance may have it, and it has not.

        By more than numbers of the right law leave; and on all frames together the laws do not earn their price.
        """
        return self._worse() and self._more_held_out() and not self._earned_on_all_frames(claim)

    def _worse(self) -> bool:
        """Whether held-out errors are larger with the claim than without."""
        after, before = self.held["revised"].rms, self.held["recalibrated"].rms
        return after is not None and before is not None and after > before

    def _earned_on_all_frames(self, claim: Claim) -> bool:
        """Whether laws earn their price on training and held-out frames together, on which their numbers are sure.

        What is there gains with every frame; what noise made of some of them has lost it where later ones are no worse
        without. True where recordings are cut into segments, or cannot be followed to their ends.
        """
        fitter = self._fitter_of(claim.fit)
        if fitter.segmented or self.lost:
            return True
        whole, used = fitter.of_all_frames(self.study.cases), sum(t.used for t in claim.laws)
        try:
            plain, again = whole.refitted(self.tried.recalibrated), whole.refitted(claim.fit)
        except Failed:
            return True
        return plain.chi2 - again.chi2 >= self.spread * price(len(self.tried.terms), used)

    def _by_its_start(self, revised: Fit) -> bool:
        """Whether runs through impacts are worse by no more than their starts, and numbers, are unsure.

        All frames of one run are off together: there is one number of evidence, however many blocks of them are
        compared. Where held-out frames are cut into windows, each of these is such a run.
        """
        before, after = (self.held[name] for name in ("recalibrated", "revised"))
        scored, left = before.scored or {}, after.scored or {}
        study, within = self.study, current().left.within
        for case in (c for c in study.cases if c.name in scored and c.name in left):
            worse = float(np.nansum(left[case.name] ** 2 - scored[case.name] ** 2))
            allowed = within * self.followed.get(case.name, 0.0) * int(np.isfinite(left[case.name]).sum())
            if worse > allowed and case.name not in self.followed and after.window is not None:
                apart = left[case.name] - scored[case.name]
                allowed = worse_by_chance(revised, case, apart, study.predictor, study.rng.spawn(1)[0], self.lost)
            if worse > allowed:
                return False
        return True

    def _by_its_numbers(self) -> bool:
        """Whether numbers of the right law, found from as noisy frames, leave as much by chance as the claim does.

        A number that is a little off carries the bodies away in all later frames together: blocks of them are no
        independent evidence against the law.
        """
        rms = self.held["revised"].rms
        enough = len(self.right) >= current().left.repeats
        return rms is not None and enough and as_large_by_chance(rms, self.right) > current().verdict.absent

    def _by_chance(self, revised: Fit) -> bool:
        """Whether the claim would be as much worse than the scene without it, were it true, in one of so many films.

        Where impacts magnify what is not known of numbers and starts, either may be ahead in all later frames, and
        blocks of them are no independent evidence.
        """
        study, plain = self.study, self.tried.recalibrated
        before, after = self.held["recalibrated"].rms, self.held["revised"].rms
        if not before or after is None or study.late(current().budget.experiment):
            return False
        how = study.cases, study.predictor, study.stop, study.rng.spawn(1)[0]
        films = errors_of_repeats([revised, plain], *how, followed=self.followed, lost=self.lost)
        if len(films) < current().left.repeats:
            return False
        return as_large_by_chance(after / before, films[:, 0] / films[:, 1]) > current().verdict.absent

    def _held_out(self, fit: Fit, whole: bool = True) -> Errors:
        study, memory = self.study, math.inf
        # where the scene is not the whole truth, a start counts its latest frames most; how much, training tells
        if any(c.held_out for c in study.cases) and spread_of(fit, study.training) > 1:
            memory = learn_memory(fit, study.cases, study.predictor, study.stop)
        return held_out_errors(
            fit, study.cases, study.predictor, study.stop, whole=whole, memory=memory, followed=self.followed,
            lost=self.lost,
        )  # fmt: skip

    def _gain(self, errors: Errors) -> float | None:
        """Half the fall of chi2 on held-out data, recalibrated less this."""
        before = self.held["recalibrated"]
        return None if before.rms is None or errors.rms is None else (before.chi2 - errors.chi2) / 2

    def locate(self, judged: Judgement) -> Sequence[Place]:
        """By innovations of short windows."""
        self.study.progress("locating", 0.88)
        found = list(judged.claim.laws)
        followed = judged.claim.fit if found else self.tried.best
        self.windows, places = _located(
            self.study, judged.verdict, self.tried.naive, self.tried.recalibrated, followed, found
        )
        return places

    def left(self, judged: Judgement) -> Left:
        (left, more), study, claim = self._left(judged), self.study, judged.claim
        self.beside_more = None
        if claim.laws and not claim.nameless and more and not study.late(current().budget.remains):
            # something acts beside the laws: their intervals hold what they are where that is one of these
            # not forms without a name: one by the speed holds a drag itself, whose number would then be any
            few = [t for t in self.tried.terms if len(t.free) <= current().left.numbers]
            first = len(self.tried.recalibrated.values)
            wide = with_company(self._fitter_of(claim.fit), claim.fit, first, self.spread, few)
            self.beside_more = with_none_beyond(wide, [t.label for t in claim.laws], self.spread)
        return left

    def with_found_numbers(self, judged: Judgement) -> Judgement:
        laws = judged.claim.laws
        if self.beside_more is None or judged.verdict not in CLAIMED:
            return judged
        more, spread = self.beside_more, self.spread
        ended = {t.label: f"beside one more law {why}" for t in laws if (why := reaches_its_end(t, more, spread))}
        for t in laws:  # one with a shape is asked with that held (``that_may_be_absent``)
            shaped = any(f.inner for f in t.term.free)
            if not shaped and may_be_absent(more, t.term.free, more.hypothesis.rows(t.label).start, spread):
                ended.setdefault(t.label, "one more law may be all of it")
        if field_alone(t.mechanism for t in laws if t.label not in ended) or len(ended) in (0, len(laws)):
            return judged
        for trial in [t for t in laws if t.label in ended]:
            laws = self._unnamed(laws, [trial], judged.claim.fit, ended[trial.label])
        return replace(judged, verdict=named_verdict(laws), claim=replace(judged.claim, laws=laws))

    def _left(self, judged: Judgement) -> tuple[Left, bool]:
        """What is left, and whether that is more than noise in what was learnt from: held-out data move no interval."""
        quiet, kicked = self._between_kicks(judged.claim.fit).passes, self.study.kicked
        named = judged.verdict not in ("no_mismatch", "recalibrate")
        if named and quiet and kicked and not self._more_to_see(judged.claim.fit):
            return Left(False, remains_of_kicks(kicked)), False
        complete = quiet and not kicked and not unexplained(judged)
        off = off_belief(self._fitter_of(judged.claim.fit), judged.claim.fit)
        if off.shares:
            self.notes.append(str(off))
        more = complete and not off.why and self._more_to_see(judged.claim.fit)
        complete = complete and not off.why and not more
        if not named and self._more_held_out() and self._beyond_the_right_law():
            # held-out data make no claim: they only say that more is there
            self.notes.append(SHOWS_LATER)
            complete = False
        if complete and judged.claim.laws and self._beyond_the_right_law():
            left = left_of_held_out(self.held["revised"], self.study.cases, self.floor[1], judged.claim.nameless)
            return Left(False, replace(left, why=(HELD_OUT_OFF,))), False
        if complete and judged.claim.laws and not judged.claim.nameless:
            if rival := self._predicted_better(judged.claim, current().left.chance):
                left = left_of_held_out(self.held["revised"], self.study.cases, self.floor[1])
                why = f"{PREDICTED_BETTER} {rival}"
                return Left(False, replace(left, looks_like=rival, why=(why,))), False
        if complete and judged.claim.laws and (alike := self._forms_as_good(judged.claim)):
            remains = self._remains(judged.claim)
            return Left(False, remains and replace(remains, alike=alike)), False
        if complete or judged.verdict in ("no_mismatch", "recalibrate"):
            return Left(complete, None), False
        remains = self._remains(judged.claim)
        return Left(False, remains and self._with_why(remains, judged, off=off.why, more=more)), True

    def _with_why(self, remains: Remains, judged: Judgement, *, off: str, more: bool) -> Remains:
        """What is left, with all that says that it is no noise, where its size does not say so."""
        left, small = self._between_kicks(judged.claim.fit), current().left.as_small
        if remains.times_floor is not None and remains.times_floor >= small and not left.passes:
            return remains
        said = {
            f"noise alone is like it with p = {left.chance:.1g}": not left.passes,
            UNEXPLAINED: left.passes and not judged.claim.laws and judged.verdict == "unmodelled",
            off: bool(off), MORE_TO_SEE: more, HELD_OUT_OFF: bool(judged.claim.laws) and self._beyond_the_right_law(),
        }  # fmt: skip
        return replace(remains, why=tuple(text for text, holds in said.items() if holds))

    def _more_held_out(self, bent: bool = False) -> bool:
        """Whether held-out data are off by more than numbers of the right law, found from as noisy frames, leave.

        bent : asked of a special fault of the apparatus, which once in twenty is enough to doubt
        """
        rms = self.held["revised"].rms
        if rms is None or not self._matters(rms):
            return False
        return as_large_by_chance(rms, self.right) < (current().verdict.absent if bent else current().left.chance)

    def _beyond_the_right_law(self) -> bool:
        """Whether held-out data are farther off than in every repeat with the right law: what is told beside them."""
        rms, enough = self.held["revised"].rms, len(self.right) >= current().left.repeats
        return rms is not None and enough and rms > self.right.max() and self._matters(rms)

    def _matters(self, rms: float) -> bool:
        """Whether what held-out errors [m or rad, rms] exceed the noise by matters to the experimenter."""
        angles = self.unit.startswith("rad")
        recordings = [c.recording for c in self.study.cases]
        least = [r.angle_tolerance if angles else r.tolerance for r in recordings]
        excess = math.sqrt(max(rms**2 - (self.floor[1] or 0.0) ** 2, 0.0))
        return any(tolerance is None or excess > tolerance for tolerance in least)

    def _forms_as_good(self, claim: Claim) -> tuple[tuple[str, str, bool], ...]:
        """Forms without a name that do no worse than a law, see ``Remains``; none where time is up.

        Those that do a little worse, and are not told apart from it, are noted.
        """
        if self.study.late(current().budget.remains):
            return ()
        first, fitter = len(self.tried.recalibrated.values), self._fitter_of(claim.fit)
        alike = forms_as_good(claim.laws, claim.fit, first, fitter, self.spread)
        scored = not self.lost and any(case.scored.any() for case in self.study.cases)
        whole = fitter.of_all_frames(self.study.cases) if scored else fitter
        if alike and scored:
            alike = left_standing(alike, claim.laws, claim.fit, first, whole, self.spread)
        if len(claim.laws) == 1 and not claim.nameless:
            alike += self._fitted_as_good(claim, whole)
        told = [(a.counts, (a.form.mechanism, a.law.mechanism, a.better)) for a in alike]
        ahead = tuple(dict.fromkeys(names for counts, names in told if counts))
        for form, law, _ in dict.fromkeys(names for _, names in told if names not in ahead):
            self.notes.append(f"nearly as little is left with {plainly(form)} in place of {plainly(law)}")
        return ahead

    def _fitted_as_good(self, claim: Claim, whole: Fitter) -> list[Alike]:
        """Forms that do as well as a law when they are fitted in its place, and do so on all frames together."""
        (law,) = claim.laws
        forms = fitted_as_good(law, claim.fit, self.tried.forms, self.spread)
        if not forms:
            return []
        labels = {a.form.label for a in forms}
        named = [t for t in self.tried.forms if t.fit is not None and t.label in labels]
        try:
            again = whole.refitted(claim.fit)
            fits = [whole.refitted(t.fit) for t in named if t.fit is not None]
        except Failed:
            return forms
        those = [replace(t, fit=fit) for t, fit in zip(named, fits, strict=True)]
        return fitted_as_good(law, again, those, self.spread)

    def _fitter_of(self, fit: Fit) -> Fitter:
        """The fitter with the segments of a fit: what is claimed may be followed in one, where other fits are not."""
        return self.fitter if self.fitter.is_cut_as(fit) else self.study.fitter

    def _more_to_see(self, fit: Fit) -> bool:
        """Whether what is left, and matters, holds more along the signature of a candidate than noise would."""
        study, tried = self.study, self.tried
        if study.late(current().budget.remains) or _below_tolerance(fit, study.training):
            return False
        # not of the forms that were fitted: theirs were shaped by these very residuals, and gain more than in noise
        asked = [*tried.terms, *asked_terms(study.cases)]
        return chance_of_more(self._fitter_of(fit), fit, asked, study.rng) < current().noise.alarm

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
            t.term for t in (*leaders, *tried.forms) if t.mechanism not in taken and len(t.term.free) <= few.numbers
        ]
        signatures = make_bank(self._fitter_of(fit), fit, beside).signatures
        best = max(signatures, key=lambda s: s.gain - 2 * len(s.term.free), default=None)
        looks, gain = NOTHING, few.looks
        if best is not None and best.gain > gain:
            looks, gain = plainly(best.term.mechanism), best.gain - 2 * len(best.term.free)
        line = strongest_line(fit, study.training)
        if line is not None and line.paid > gain and line.gain > few.line * (fit.chi2 - fit.count):
            looks = f"an oscillation at {line.frequency:.3g} Hz"
        elif not claim.laws:
            looks = self._beside_the_nearest() or looks
        remains = remains_of(scores, [b.case.t[b.rest] for b in self.blocks], looks)
        # blocks do not predict the frames that their starts are fitted on, in which most may be left
        return remains and replace(remains, t=largest_when(fit.innovations, study.training) or remains.t)

    def _beside_the_nearest(self) -> str:
        """The law that comes closest where none is named, with an oscillation if that is most of what it leaves."""
        nearest, few = next(iter(self.refitted()), None), current().left
        if nearest is None or nearest.fit is None:
            return ""
        line = strongest_line(nearest.fit, self.study.training)
        if line is None or line.paid <= few.looks or line.gain <= few.line * nearest.fit.excess:
            return ""
        return f"{plainly(nearest.mechanism)} and an oscillation at {line.frequency:.3g} Hz"

    def refitted(self) -> list[Trial]:
        """Laws that gain more than their numbers do by chance, best first; of those that ended at no bound, if any."""
        tried = sorted(self.tried.alive, key=lambda t: -worth(t, self.spread))
        found = [t for t in tried if t.fit is not None and worth(t, self.spread) > 0]
        return [t for t in found if not absurd(t)] or found

    def share(self, law: Trial) -> Explained | None:
        return None if law.fit is None else self._share_of(law.fit)

    def _share_of(self, fit: Fit) -> Explained:
        """What the scene of a fit explains on unseen blocks, by random numbers of its own."""
        rng = self.study.rng.spawn(1)[0]
        noise = LikelyNoise.of(seen_by(self.tried.best, self.study.training))
        after = score(fit, self.blocks, self.study.predictor, noise, rng)
        return explained(after, self.before, rng, varies=spread_with_mismatch(self.before) if self.before.sums else 0.0)

    def beside(self, judged: Judgement) -> list[tuple[Trial, bool]]:
        found, alive = list(judged.claim.laws or judged.withdrawn), self.tried.alive
        named = {t.mechanism for t in found}
        near = [(t, same) for t, same in self.near if t.mechanism not in named]
        taken = named | {t.mechanism for t, _ in near}
        if len(found) > 1:
            return [*near, *((t, False) for t in alive if t.mechanism not in taken)][: max(3, len(near))]
        return [*near, *(r for r in rivals_of(found, alive, self.spread) if r[0].mechanism not in taken)]

    def gains(self, judged: Judgement, fallen: Sequence[Trial], beside: Sequence[Trial]) -> dict[str, float | None]:
        fits = {t.label: t.fit for t in (*beside, *fallen) if t.fit is not None}
        return {label: self._gain(self._held_out(fit, whole=False)) for label, fit in fits.items()}

    def propose(self, judged: Judgement, rivals: Sequence[Rival]) -> Proposal | None:
        """None where these data tell the law from all its rivals: another film would part what is parted."""
        study, found = self.study, judged.claim.laws
        if len(found) != 1 or found[0].fit is None or study.late(current().budget.experiment):
            return None
        study.progress("the next experiment", 0.95)
        told, name = None, found[0].mechanism
        alike = [(r.law.mechanism, r.law.fit) for r in rivals if r.same and r.law.fit is not None]
        if alike:
            (other, loser), *more = alike
            how = study.cases, study.predictor, study.stop
            told = propose(found[0].fit, loser, (name, other), *how, more)
        for rate in (n for n in self._numbers_instead(judged) if not n.of_the_scene):
            told = with_clock(told, name, abs(rate.believed / rate.value - 1.0), study.training)
        return told

    # ---- what is handed over

    def false_alarm(self, course: Course) -> float:
        p = super().false_alarm(course)
        sought = any(has_role(t.mechanism, "beat") for t in course.judged.claim.laws)
        if course.null is None or not (sought or course.judged.verdict == "unmodelled"):
            return p
        # no candidate gains more than in noise, and yet what is left is none: so is a force at one frequency asked for
        return min(p, max(self.completeness(self.tried.recalibrated).chance, 1 / (len(course.null.gains) + 1)))

    @property
    def unit(self) -> str:
        return next(c.unit for c in self.study.cases)

    def mechanisms(self, course: Course) -> list[dict[str, Any]]:
        judged, gain = course.judged, course.held.gain
        told = Told(self.beside_more or judged.claim.fit, self.spread, self.study.cases)
        if judged.verdict == "unmodelled":
            return [entry | {"name": UNKNOWN} for t in judged.claim.laws[:1] for entry in told.entries(t, gain)[:1]]
        return [entry for t in judged.claim.laws for entry in told.entries(t, gain)]

    def adjusted(self) -> dict[int, Free]:
        return {k: f for k, f in enumerate(self.tried.recalibrated.hypothesis.free) if not f.prior}

    def interval(self, course: Course, k: int) -> tuple[float, float | None, float | None]:
        fit: Fit = course.judged.claim.fit
        if fit.told(k):
            return fit.interval(k, self.spread)
        free = fit.hypothesis.free[k]
        low, high = (end if math.isfinite(end) else None for end in (free.low, free.high))
        return float(fit.values[k]), low, high

    def instead(self, course: Course) -> tuple[str, ...]:
        return tuple(map(str, self._numbers_instead(course.judged)))

    def _numbers_instead(self, judged: Judgement) -> list[Instead]:
        claim, told = judged.claim, judged.verdict
        if told in ("no_mismatch", "recalibrate") or self.study.late(current().budget.remains):
            return []
        if self._asked_instead is not judged:
            given = claim.laws, claim.fit, self.tried.recalibrated, self._fitter_of(claim.fit)
            self.undeclared = in_a_lost_scene(*given) or instead_of(*given, self.spread)
            self._asked_instead = judged
        return self.undeclared

    def closing_notes(self, course: Course) -> list[str]:
        notes = list(self.let_go or ())
        failures = self.study.predictor.failures
        if len(failures) > current().left.failed * self.runs:
            notes.append(left_out(failures))
        notes += [f"{b}: not named, {why}" for b, why in self.dropped.items()]
        laws = course.judged.claim.laws
        if course.judged.verdict in ("no_mismatch", "recalibrate"):
            notes += below(self.tried.alive, self.spread)
        notes += as_well_in_place(self.exchanged, [t.mechanism for t in laws])
        if laws and course.held.outcome == "undecided" and all(in_contact_alone(t.term) for t in laws):
            if not any(meets_when_scored(c) for c in self.study.cases):
                shows = "show" if len(laws) > 1 else "shows"
                notes.append(f"the held-out part holds no impact, where alone {course.judged.claim.label} {shows}")
        if course.judged.verdict in CLAIMED:
            fit = self.beside_more or course.judged.claim.fit
            notes += at_any_shape(Told(fit, self.spread, self.study.cases), laws)
        entries = self.mechanisms(course)
        notes += beside_its_own(entries, self.study.cases)
        notes += as_the_picture(entries, self.study.cases)
        notes += as_a_push(entries, self.study.cases, {t.term.law for t in laws})
        if course.judged.claim.nameless:
            claimed = course.judged.claim.fit
            notes += as_a_spring(laws[0], claimed, self.study.training) or self._as_a_spring_after_all()
            notes += as_an_answer(laws[0].term, claimed.values[claimed.hypothesis.rows(laws[0].label)])
        if laws:
            notes += [at_its_bound(f, value) for f, value in self._at_bounds(course.judged.claim.fit)]
        if not course.left.complete:
            notes += self._kicks_untold(laws)
        notes += [note for case in self.study.cases for note in (*away_from_radii(case), *nearer_than_radii(case))]
        revised, floor = self.standing(course, self.held)["revised"].rms, self.floor[1]
        if revised and floor and revised > current().left.told * floor:
            times = revised / floor
            text = f"a held-out misfit of {revised:.3g} {self.unit} remains, {times:.1f} times the noise floor"
            if self.right_law is not None:
                least, most = self.right_law
                text += "; where the law is right, numbers found from as noisy frames leave "
                text += f"{least:.2g} to {most:.2g} {self.unit}"
            notes.append(text)
        return notes + self._asked_by_all_frames(course)

    def _asked_by_all_frames(self, course: Course) -> list[str]:
        """What all frames ask for, where held-out ones turn down what was learnt, or are off by more than it leaves."""
        claim, study, tried = course.judged.claim, self.study, self.tried
        asked = course.judged.verdict == "unmodelled" or (claim.laws and self._beyond_the_right_law())
        scored = any(c.scored.any() for c in study.cases) and not self.lost
        if not (asked and scored) or course.left.complete or study.late(current().budget.experiment):
            return []
        fitter = self._fitter_of(claim.fit)
        return asked_by_all_frames(fitter, study.cases, claim, tried.recalibrated, tried.alive, len(tried.terms))

    def _as_a_spring_after_all(self) -> list[str]:
        """That a field in place leaves less than the form that is told, where frames are too few to predict some by it.

        Compared by what each leaves, of a size that nobody knows: n ln chi2 + 2 numbers (AIC), noise at the least.
        """
        tried = [(t.fit, t) for t in self.tried.forms if t.fit is not None]
        price = {t.label: fit.count * math.log(max(fit.chi2, fit.count)) + 2 * t.used for fit, t in tried}
        fields = [(fit, t) for fit, t in tried if has_role(t.term.law, "place")]
        fit, best = min(fields, key=lambda entry: price[entry[1].label], default=(None, None))
        if fit is None or best is None or price[best.label] > min(price.values()):
            return []
        return as_a_spring(best, fit, self.study.training)

    def _kicks_untold(self, laws: Sequence[Trial]) -> list[str]:
        """Notes on velocities that change at once, but for those that a law between bodies is there for."""
        declared = all_laws()
        between = [t for t in laws if t.term.law in declared and declared[t.term.law].kind in ("pair", "impulse")]
        acting, frames = [b for t in between for b in t.term.bodies or ()], 2 * current().kicks.half
        left = ((case, not_of(all_kicks(case), acting, frames)) for case in self.study.cases)
        few = [note for case in self.study.cases for note in told_of_few(case)]
        return [*(told_of(case, kicks) for case, kicks in left if kicks), *few]

    def _at_bounds(self, fit: Fit) -> list[tuple[Free, float]]:
        """Adjustable numbers that ended where they may not go on, and their values."""
        found = []
        for k, free in self.adjusted().items():
            near = current().verdict.at_bound * (free.high - free.low)
            if not free.natural and fit.told(k) and min(fit.values[k] - free.low, free.high - fit.values[k]) <= near:
                found.append((free, float(fit.values[k])))
        return found

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
        recalibrated, revised = (whiteness(fit, study.training, fit.numbers) for fit in fits[1:])
        return TrackFinding(
            study.cases, *fits, judged.verdict, list(judged.claim.laws), [(r.law, r.same) for r in course.rivals],
            tried.alive + tried.untried, self.best_form or min(tried.forms, key=lambda t: t.inner, default=None),
            course.null, recalibrated, revised, self.windows, self.spread, self.standing(course, self.train),
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
    Where more than noise is left and a number of the scene that nobody declared adjustable would do for several of the
    laws, or for most where nothing is named, all is asked again with that number free. It is told so if then only noise
    is left: a rod of another length takes two errors of the apparatus to imitate, and leaves no room for a third law.
    So where a scene is lost that an adjustable number outside its bounds would bring back, and where a number is
    likelier than what is told in its place and leaves noise.
    Not of many bodies, of which it would take too long.
    """
    began = time.monotonic()
    model = Tracks(training, held, minutes=minutes, seed=seed, progress=progress)
    found = diagnose_by(model, seed)
    number = next((n for n in model.undeclared if n.of_the_scene and (n.makes_room or n.likelier)), None)
    budget = current().budget
    long = len(names_of(model.study.cases)) > budget.bodies or model.study.late(budget.again)
    if number is None or (found.verdict["complete"] and not number.likelier) or long:
        return found
    left = None if minutes is None else minutes - (time.monotonic() - began) / 60
    freed = (declared(recordings, number) for recordings in (training, held))

    def once_more(text: str, share: float) -> None:
        progress(f"{text}, with {number.name} free", (1 + share) / 2)

    again = diagnose_by(Tracks(*freed, minutes=left, seed=seed, progress=once_more), seed)
    told = again.verdict["verdict"]
    if told not in CLAIMED or not again.verdict["complete"]:
        # a number that brings back a lost scene takes away most by itself, and the rest may be noise or not
        alone = number.lost or (number.likelier and again.verdict["complete"])
        if not alone or told in ("no_mismatch", "unmodelled"):
            return found
    verdict = dict(again.verdict)
    verdict["notes"] = [str(number) if number.lost or number.likelier else f"{number.name}, {FREED}", *verdict["notes"]]
    return replace(again, verdict=verdict, seconds=time.monotonic() - began, runs=found.runs + again.runs)


def _that_stand(trials: Sequence[Trial], winner: Trial, spread: float) -> list[Trial]:
    """Laws that were refitted, without those that have an entry which may be none, or are a special case then."""
    return [t for t in trials if t is winner or not (has_idle_entry(t, spread) or is_its_special_case(t, spread))]


def _in_order(
    same: Sequence[Trial], winner: Trial, alive: Sequence[Trial], spread: float, least: float, looked: int
) -> list[Claim]:
    """Laws that cannot be told from the winner, first the one that would be named without it, and so on.

    alive : all that were refitted;  other arguments as of ``choose``
    """
    found, taken = list[Trial](), {winner.mechanism}
    others = [t for t in alive if t is not winner]
    while same := [t for t in same if t.mechanism not in taken]:
        best = choose(same, spread, least, looked)
        if best is None:
            break
        taken.add(best.mechanism)
        # of another form of the winner, too, which stands for this one in such an apparatus
        found.append(of_the_apparatus(best, others, spread))
    return [Claim((t,), t.fit) for t in found]


def _with_two(one: Sequence[Claim], two: Sequence[Claim], spread: float) -> list[Claim]:
    """Claims of one law and of two in the order in which they are asked: two stand after one that does as well.

    Before the first of which training data prefer them, by more than they leave open and with no more numbers: a stream
    that takes the part of a drag and of a wrong scale is no simpler than these two. Numbers are paid for (AIC).
    """
    order = list(one)

    def used(claim: Claim) -> int:
        return sum(t.used for t in claim.laws)

    def paid(claim: Claim) -> float:
        return float(claim.fit.chi2 / spread + 2 * used(claim))

    def behind(claim: Claim, pair: Claim) -> bool:
        ahead = paid(claim) - paid(pair) > current().verdict.same
        return len(claim.laws) == 1 and used(claim) >= used(pair) and ahead

    for pair in two:
        at = next((k for k, claim in enumerate(order) if behind(claim, pair)), len(order))
        order.insert(at, pair)
    return order


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
    variance = variance_by_case(revised, training)

    def seen(fit: Fit, **how: int) -> tuple[WindowMap, tuple[Place, ...]]:
        windows = window_map(study.fitter, fit, variance, **how)
        return windows, locate(windows)

    windows, places = seen(recalibrated)
    if not places and verdict != "recalibrate":
        windows, places = seen(recalibrated, pieces=2)
    if not places and found:
        places = _whole(found, recalibrated, revised, training)
    if verdict == "recalibrate" and not places:
        windows, places = seen(naive, pieces=2)
    return windows, places


def _whole(found: list[Trial], recalibrated: Fit, revised: Fit, cases: Sequence[Case]) -> tuple[Place, ...]:
    """Where no window stands out: the bodies the law acts on, over the whole time."""
    bodies = tuple(dict.fromkeys(b for t in found for b in (t.term.bodies or ())))
    seen = tuple(dict.fromkeys(b for c in cases for b in c.bodies))
    bodies = bodies or seen
    gain = recalibrated.chi2 - revised.chi2
    numbers = sum(t.numbers for t in found)
    z, p = after_looks(float(stats.chi2.sf(gain, numbers)), 1)
    t = float(min(c.t[0] for c in cases)), float(max(c.t[-1] for c in cases))
    return (Place(tuple(b for b in bodies if b in seen) or bodies, z, p, t=t, recording=cases[0].name),)
