"""The verdict of contract 2: what explains, whether it is complete, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import distributions as stats
from .criteria import Criteria, current
from .explained import Explained, Scores
from .mechanisms import APPARATUS, forms_in_words, nameless
from .noise import Noise, chance_of, fit_noise
from .significance import beyond


@dataclass(frozen=True)
class Completeness:
    """Whether what a fit leaves passes for noise: the most likely noise, and the chance that it looks like that."""

    noise: Noise
    chance: float
    passes: bool


def completeness(residuals: Sequence[np.ndarray], criteria: Criteria | None = None) -> Completeness:
    """residuals : of each channel, seen minus predicted over the white part of the noise, (n,) each."""
    criteria = criteria or current()
    noise = fit_noise(residuals, criteria.noise)
    chance = chance_of(residuals, noise)
    return Completeness(noise, chance, chance >= criteria.noise.alarm)


def as_large_by_chance(error: float, repeats: np.ndarray) -> float:
    """Probability that one more repeat is as far off as ``error`` [m or rad, rms]; 1 where repeats (n,) are too few.

    Logarithms of such errors are taken for normal, with mean and spread from the repeats themselves (``beyond``).
    """
    logs = np.log(repeats[repeats > 0])
    if len(logs) < current().left.repeats:
        return 1.0
    return float(stats.t.sf(beyond(float(np.log(error)), logs, 1e-12), len(logs) - 1))


# why a verdict may not be complete although what was learnt from shows no more than noise
HELD_OUT_OFF = "held-out data are off by more than numbers that are found from as noisy frames leave"


@dataclass(frozen=True)
class Remains:
    """What is left of unseen training data: rms [m or rad], its ratio to the floor, whom, when, and what it is like.

    alike : (form, law, whether better) of forms without a name that do as well in place of a named law: what is left
        is no more than noise then, and yet the form of the law is not told
    why : clauses that say why the verdict is not complete, where its size does not
    """

    rms: float | None
    times_floor: float | None
    bodies: tuple[str, ...]
    t: tuple[float, float] | None
    before_contact: bool | None
    looks_like: str
    phase: tuple[float, float] | None = None
    alike: tuple[tuple[str, str, bool], ...] = ()
    why: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        when = {"t": self.t, "phase": self.phase, "before_contact": self.before_contact}
        looks = f"nothing but noise; {forms_in_words(self.alike)}" if self.alike else self.looks_like
        return {
            "rms": self.rms, "times_floor": self.times_floor, "bodies": list(self.bodies), "when": when,
            "looks_like": looks, "alike": [list(entry) for entry in self.alike], "why": list(self.why),
        }  # fmt: skip


def remains_of(scores: Scores, times: Sequence[np.ndarray], looks_like: str) -> Remains | None:
    """Where most of what is left lies: the bodies and the time in which it stands out from the floor.

    times : [s] of the predicted frames of each block
    """
    if not scores.sums:
        return None
    values = np.concatenate([r[np.isfinite(r)] for r in scores.residuals.values()])
    floor = float(scores.floors.mean())
    by_body: dict[str, list[float]] = {}
    by_block: dict[int, list[float]] = {}
    for key, total in scores.sums.items():
        b, body, *_ = key
        mean = total / max(scores.counts[key], 1)
        by_body.setdefault(body, []).append(mean)
        by_block.setdefault(b, []).append(mean)
    means = {body: float(np.mean(m)) for body, m in by_body.items()}
    worst = max(means.values())
    least = current().verdict.bodies * (worst - floor)
    bodies = tuple(b for b, m in means.items() if m - floor > least) or tuple(means)
    block = max(by_block, key=lambda b: float(np.mean(by_block[b])))
    t = times[block]
    rms = float(np.sqrt(np.mean(values**2))) if len(values) else None
    return Remains(
        rms, float(np.sqrt(scores.mean / max(floor, 1e-12))), bodies,
        (float(t[0]), float(t[-1])), None, looks_like,
    )  # fmt: skip


@dataclass(frozen=True)
class Claim:
    """What is said to be missing, and the scene with it.

    laws : one to three candidates, the more telling first, or one form without a name; empty: the recalibrated scene
    fit : the numbers of the scene with them, as the kind of recording keeps them
    """

    laws: tuple[Any, ...]
    fit: Any

    @property
    def nameless(self) -> bool:
        return any(nameless(law.mechanism) for law in self.laws)

    @property
    def label(self) -> str:
        *first, last = [law.label for law in self.laws] or [""]
        return f"{', '.join(first)} and {last}" if first else last

    @property
    def are(self) -> str:
        """The verb behind the label."""
        return "are" if len(self.laws) > 1 else "is"


@dataclass(frozen=True)
class Form:
    """A form without a name in place of the names: what it explains; worth: its gain, paid for its numbers (AIC).

    later : whether it predicts later data inside the training part no worse than the names. A form of many numbers
        fills in what lies between data that it has seen, and says nothing of what comes after
    """

    claim: Claim
    explained: Explained
    worth: float
    later: bool = True


@dataclass(frozen=True)
class Weighed:
    """What is explained of unseen blocks of the training part.

    named : by the claim, None where it could not be run there
    forms : by forms without a name;  possible : whether such forms were among the candidates: where none of them was
        weighed, none led anywhere
    ahead : chi2 by which the claim is ahead of the best form, numbers paid for (AIC)
    few : the floor is that of few replicates, which know it badly
    plainer : a form with no more numbers does as well as names with a special fault among them, "" where none does
    """

    named: Explained | None = None
    forms: tuple[Form, ...] = ()
    possible: bool = False
    ahead: float = 0.0
    few: bool = False
    plainer: str = ""

    @property
    def free_form(self) -> float | None:
        """The largest share of a form without a name, at least 0; None where none was weighed."""
        return max(0.0, *(f.explained.share for f in self.forms)) if self.forms else None

    def without(self, label: str) -> Weighed:
        """The same where one of the forms is out of question."""
        rest = tuple(f for f in self.forms if f.claim.label != label)
        best, second = (max((f.worth for f in forms), default=-np.inf) for forms in (self.forms, rest))
        plainer = "" if self.plainer == label else self.plainer
        return replace(self, forms=rest, ahead=self.ahead + (best - second if best > second else 0.0), plainer=plainer)


@dataclass(frozen=True)
class Mismatch:
    """Whether the scene is off by more than replicates without a mismatch are, and whether an adjustable moved."""

    real: bool
    moved: bool

    @classmethod
    def of(cls, laws: Sequence[Any], p: float, moved: bool) -> Mismatch:
        """By the contract's rule: real where laws stand, or where p is within the alarm.

        p : that of the search where nothing is missing, or that noise alone looks like what the scene leaves
        A search that asks for a law of which none stands is a mismatch that nothing explains, and no match.
        """
        return cls(bool(laws) or p <= current().verdict.alarm, moved)


@dataclass(frozen=True)
class Judgement:
    """What a diagnosis concludes.

    verdict : as in the contract;  claim : what stands, without laws where nothing does
    explained : of what was named, or of the curve; None where no share can be said
    free_form : the largest share of a form without a name, None where none was possible
    closest : names that were not accepted, with their share;  withdrawn : those that held-out data turned down
    told_from : labels of what training data cannot tell from the claim, and held-out data have told from it
    """

    verdict: str
    claim: Claim
    explained: Explained | None = None
    free_form: float | None = None
    closest: tuple[tuple[Any, float], ...] = ()
    withdrawn: tuple[Any, ...] = ()
    told_from: tuple[str, ...] = ()


def named_verdict(laws: Sequence[Any]) -> str:
    """The verdict where these laws are the explanation."""
    if nameless(laws[0].mechanism):
        return "unmodelled"
    return "measurement" if all(law.mechanism in APPARATUS for law in laws) else "missing_physics"


def without_laws(mismatch: Mismatch) -> str:
    """The verdict where nothing is named."""
    return "unmodelled" if mismatch.real else "recalibrate" if mismatch.moved else "no_mismatch"


def judge(claim: Claim, weighed: Weighed, mismatch: Mismatch, plain: Claim, notes: list[str]) -> Judgement:
    """The contract's verdict from the training part alone.

    plain : the recalibrated scene, which is what stands where nothing is told;  notes : why a claim does not stand
    """
    free_form = weighed.free_form
    if not claim.laws or not mismatch.real:
        return Judgement(without_laws(mismatch), plain, None, free_form)
    named = weighed.named
    if claim.nameless:
        if named is not None and named.sure and not _helps(named):
            notes.append(f"{claim.label} predicts data that it was not fitted to no better than the scene without it")
            return Judgement("unmodelled", plain, None, free_form)
        return Judgement("unmodelled", claim, named, free_form)
    if named is None:
        return Judgement(named_verdict(claim.laws), claim, None, free_form)
    forms = [f.explained for f in weighed.forms if f.later]
    if not forms and (weighed.possible or weighed.forms):
        forms = [replace(named, share=0.0, low=0.0, high=0.0, left=named.left_before, spread=0.0)]
    good, why = accepted(named, forms, weighed.ahead, several=len(claim.laws) > 1)
    if weighed.plainer:
        # a bent picture looks like a little of anything, and hardly any laboratory has one
        good, why = False, f"{weighed.plainer} does as well with no more numbers, and without a special fault"
    least = current().verdict.share
    if not good and weighed.few and 0 < named.low < named.share < least <= named.high:
        # few replicates know the floor badly: a share that may as well be enough takes no name away
        notes.append(f"{why}, within {100 * named.low:.0f} to {100 * named.high:.0f} %: replicates are few")
        good = True
    if good:
        return Judgement(named_verdict(claim.laws), claim, named, free_form)
    notes.append(f"{claim.label} {claim.are} not named: {why}")
    return not_named(claim, weighed, plain)


def unexplained(judged: Judgement) -> bool:
    """Whether a mismatch is real and nothing was found for it: more than noise, however little shows in one place."""
    return judged.verdict == "unmodelled" and not judged.claim.laws


def not_named(claim: Claim, weighed: Weighed, plain: Claim) -> Judgement:
    """What is told where the laws of a claim are no explanation: the best form without a name, if one helps."""
    share = 0.0 if weighed.named is None else weighed.named.share
    closest, best = tuple((law, share) for law in claim.laws), best_form(weighed.forms)
    told, explained = (plain, None) if best is None else (best.claim, best.explained)
    return Judgement("unmodelled", told, explained, weighed.free_form, closest)


def _helps(explained: Explained) -> bool:
    """Whether a form without a name predicts unseen blocks better than the scene, by more than nothing."""
    return explained.share >= current().verdict.told and explained.low > 0


def best_form(forms: Sequence[Form]) -> Form | None:
    """The form that leaves least of those that help; of those that leave as little, within what replicates do, the
    one that is worth most."""
    helps = [f for f in forms if _helps(f.explained)]
    least = min((f.explained.left for f in helps), default=0.0)
    near = [f for f in helps if f.explained.left - least <= current().verdict.beyond * f.explained.spread]
    return max(near, key=lambda f: f.worth, default=None)


def bends(judged: Judgement) -> bool:
    """Whether a special fault of the apparatus is claimed, as a lens that bends the picture."""
    return any(law.special for law in judged.claim.laws)


def turned_down(judged: Judgement) -> str:
    """How held-out data speak against what was told, in words."""
    if bends(judged):
        return f"off by more than numbers of {judged.claim.label} can be"
    return f"predicted worse with {judged.claim.label} than without"


def withdrawn(judged: Judgement, plain: Claim, notes: list[str]) -> Judgement:
    """The judgement where held-out data are predicted worse with what was told than without."""
    what = "they are" if len(judged.claim.laws) > 1 else "it is"
    notes.append(f"held-out data are {turned_down(judged)}: {what} withdrawn")
    named = () if judged.claim.nameless else judged.claim.laws
    return Judgement("unmodelled", plain, None, judged.free_form, judged.closest, named)


def accepted(
    named: Explained, forms: Sequence[Explained], ahead: float, criteria: Criteria | None = None, *,
    several: bool = False,
) -> tuple[bool, str]:
    """Whether named laws are the explanation, and why not.

    named : what they explain;  forms : what forms without a name explain in their place
    ahead : chi2 by which the names are ahead of the best form, its further numbers paid for (AIC)
    several : there is more than one name, which the words follow
    """
    criteria = criteria or current()
    c = criteria.verdict
    if not named.sure:
        # too weak for a share: chi2 beyond the nulls, and beyond all forms without a name
        return ahead > -c.same, "a force without a name does better"
    least = c.share if forms else c.share_alone
    if named.share < least:
        explains = "together they explain" if several else "it explains"
        if named.share <= 0:
            return False, f"{explains} nothing of the mismatch"
        return False, f"{explains} {100 * named.share:.0f} % of the mismatch, {100 * least:.0f} % are asked"
    if named.low <= 0:
        they, them = ("they predict", "them") if several else ("it predicts", "it")
        return False, f"on some parts of the data {they} no better than the scene without {them}"
    part = c.free_form_high if named.share >= c.high else c.free_form
    best = min((f.left for f in forms), default=np.inf)
    # where both leave no more than replicates do, neither is ahead; nor is a form for which the data that it was fitted
    # to ask less than for the names, its numbers paid for
    if best < part * named.left and named.left - max(best, 0.0) > c.beyond * named.spread and ahead < c.same:
        return False, "a force without a name leaves far less"
    return True, ""


def explained_dict(judged: Judgement) -> dict[str, Any] | None:
    """``explained`` as it stands in verdict.json."""
    e = judged.explained
    if e is None or not e.sure or judged.verdict in ("no_mismatch", "recalibrate"):
        return None
    return {"share": e.share, "low": e.low, "high": e.high, "best_free_form": judged.free_form}


def paired(
    before: Sequence[np.ndarray], after: Sequence[np.ndarray], rng: np.random.Generator
) -> str:
    """Whether held-out data are predicted better: "holds", "fails" or "undecided".

    before, after : squared errors over the variance of the noise, one array for each block of held-out frames
    A bootstrap of the blocks of the mean difference; central 95 %. A change of all together that one number makes by
    chance decides nothing, however even it is: of a law of contacts bodies that do not meet say nothing but rounding.
    """
    differences = np.array([float(np.sum(b - a)) for b, a in zip(before, after, strict=True)])
    if not len(differences) or not np.isfinite(differences).all():
        return "undecided"
    if abs(differences.sum()) < current().blocks.decides:
        return "undecided"
    draws = current().blocks.bootstrap
    drawn = differences[rng.integers(0, len(differences), size=(draws, len(differences)))].mean(axis=1)
    low, high = np.quantile(drawn, current().intervals.central)
    if len(differences) < 3:
        return "undecided" if low <= 0 <= high else ("holds" if low > 0 else "fails")
    return "holds" if low > 0 else "fails" if high < 0 else "undecided"
