"""The verdict of contract 2: what explains, whether it is complete, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .criteria import Criteria, current
from .explained import Explained, Scores
from .noise import Noise, chance_of, fit_noise


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


@dataclass(frozen=True)
class Remains:
    """What is left of unseen training data: rms [m or rad], its ratio to the floor, whom, when, and what it is like."""

    rms: float
    times_floor: float
    bodies: tuple[str, ...]
    t: tuple[float, float] | None
    before_contact: bool | None
    looks_like: str

    def as_dict(self) -> dict[str, Any]:
        when = {"t": None if self.t is None else list(self.t), "phase": None, "before_contact": self.before_contact}
        return {
            "rms": self.rms, "times_floor": self.times_floor, "bodies": list(self.bodies), "when": when,
            "looks_like": self.looks_like,
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
    bodies = tuple(b for b, m in means.items() if m - floor > 0.5 * (worst - floor)) or tuple(means)
    block = max(by_block, key=lambda b: float(np.mean(by_block[b])))
    t = times[block]
    return Remains(
        float(np.sqrt(np.mean(values**2))), float(np.sqrt(scores.mean / max(floor, 1e-12))), bodies,
        (float(t[0]), float(t[-1])), None, looks_like,
    )  # fmt: skip


@dataclass(frozen=True)
class Judgement:
    """What a diagnosis concludes, and why.

    verdict : as in the contract;  explained : of what was named, or of the curve; None where no share can be said
    free_form : the largest share of a form without a name, None where none was possible
    notes : what a reader should know of how it came about
    """

    verdict: str
    explained: Explained | None
    free_form: float | None
    notes: tuple[str, ...] = field(default=())


def accepted(
    named: Explained, forms: Sequence[Explained], ahead: float, criteria: Criteria | None = None
) -> tuple[bool, str]:
    """Whether named laws are the explanation, and why not.

    named : what they explain;  forms : what forms without a name explain in their place
    ahead : chi2 by which the names are ahead of the best form, its further numbers paid for (AIC)
    """
    criteria = criteria or current()
    c = criteria.verdict
    if not named.sure:
        # too weak for a share: chi2 beyond the nulls, and beyond all forms without a name
        return ahead > -4.0, "a force without a name does better"
    least = c.share if forms else c.share_alone
    if named.share < least:
        return False, f"it explains {100 * named.share:.0f} % of the mismatch"
    if named.low <= 0:
        return False, "on some parts of the data it predicts no better than the scene without it"
    part = c.free_form_high if named.share >= c.high else c.free_form
    best = min((f.left for f in forms), default=np.inf)
    # where both leave no more than replicates do, neither is ahead
    if best < part * named.left and named.left - max(best, 0.0) > c.beyond * named.spread:
        return False, "a force without a name leaves far less"
    return True, ""


def explained_dict(judged: Judgement) -> dict[str, Any] | None:
    """``explained`` as it stands in verdict.json."""
    e = judged.explained
    if e is None or not e.sure or judged.verdict in ("no_mismatch", "recalibrate"):
        return None
    return {"share": e.share, "low": e.low, "high": e.high, "best_free_form": judged.free_form}


def paired(
    before: Sequence[np.ndarray], after: Sequence[np.ndarray], rng: np.random.Generator, draws: int = 2000
) -> str:
    """Whether held-out data are predicted better: "holds", "fails" or "undecided".

    before, after : squared errors over the variance of the noise, one array for each block of held-out frames
    A bootstrap of the blocks of the mean difference; central 95 %.
    """
    differences = np.array([float(np.sum(b - a)) for b, a in zip(before, after, strict=True)])
    if not len(differences) or not np.isfinite(differences).all():
        return "undecided"
    drawn = differences[rng.integers(0, len(differences), size=(draws, len(differences)))].mean(axis=1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    if len(differences) < 3:
        return "undecided" if low <= 0 <= high else ("holds" if low > 0 else "fails")
    return "holds" if low > 0 else "fails" if high < 0 else "undecided"
