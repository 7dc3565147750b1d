"""What the search knows, and how a hypothesis becomes runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...scene import Scene
from ..criteria.packings import Sizes
from ..hypothesis import NO_CAMERA, Term
from ..trial import Tried, rows_of
from .candidates import Candidate
from .response import Fit, Means
from .runs import Change, Job, Runner
from .summaries import Condition

NAIVE = "naive"

Progress = Callable[[str, float], None]

@dataclass
class Trial(Tried):
    """A candidate after its fit. ``gain``: fall of the objective;  ``reason``: why it was not fitted, if so."""

    candidate: Candidate
    surviving: float
    gain: float
    fit: Fit | None = None
    refitted: int = 0
    reason: str = ""

    @property
    def term(self) -> Term:
        return self.candidate.term

    @property
    def worth(self) -> float:
        """Gain less what as many numbers gain by chance (AIC)."""
        return self.gain - 2 * self.numbers

    def values(self) -> np.ndarray:
        """(k,) the candidate's own numbers, those of the recalibration left out."""
        assert self.fit is not None
        return self.fit.u[-self.numbers :]


@dataclass
class Nulls:
    """What the search finds in simulated recordings of the recalibrated physics in other packings."""

    chi2: np.ndarray  # (r,) of the naive or recalibrated prediction
    recalibration: np.ndarray  # (r,) gain of the adjustables
    best: np.ndarray  # (r,) the best worth of all candidates
    left: np.ndarray  # (r,) chi2 after recalibration
    drawn: np.ndarray  # (r, n) whitened innovations
    refitted: np.ndarray  # (r, n) the same after recalibration


@dataclass
class Search:
    """Everything that the search knows. ``looked``: candidates that count, by which a further law is priced."""

    conditions: list[Condition]
    runner: Runner
    sizes: Sizes
    rng: np.random.Generator
    progress: Progress
    means: Means
    test: Means
    adjust: tuple[Term, ...]
    theta: np.ndarray
    naive: Fit
    base: Fit
    trials: list[Trial] = field(default_factory=list)
    nulls: Nulls | None = None
    notes: list[str] = field(default_factory=list)
    p_recalibration: float = 1.0
    p_search: float = 1.0
    looked: int = 2

    @property
    def training(self) -> list[Condition]:
        return [c for c in self.conditions if c.view is not None]

    @property
    def testing(self) -> list[Condition]:
        return [c for c in self.conditions if c.test is not None]


def bears_on(term: Term, condition: Condition) -> bool:
    return not term.free or any(f.cases is None or condition.recording.name in f.cases for f in term.free)


def change_of(
    condition: Condition, adjust: Sequence[Term], theta: Sequence[float] | np.ndarray,
    extra: Sequence[tuple[Term, np.ndarray]] = (),
) -> Change:  # fmt: skip
    """The scene's change under values of the adjustables and of further terms."""

    def change(scene: Scene) -> Scene:
        for term, value in zip(adjust, theta, strict=True):
            if bears_on(term, condition):
                scene, _ = term.apply(scene, NO_CAMERA, [float(value)])
        for term, values in extra:
            if bears_on(term, condition):
                scene, _ = term.apply(scene, NO_CAMERA, values)
        return scene

    return change


def label_of(
    adjust: Sequence[Term], theta: Sequence[float] | np.ndarray, extra: Sequence[tuple[Term, np.ndarray]] = ()
) -> str:
    parts = [f"{t.label}={v:.9g}" for t, v in zip(adjust, theta, strict=True)]
    parts += [f"{t.label}({', '.join(f'{v:.9g}' for v in values)})" for t, values in extra]
    return "; ".join(parts) or NAIVE


def jobs_for(
    conditions: Sequence[Condition], adjust: Sequence[Term], theta: np.ndarray,
    extra: Sequence[tuple[Term, np.ndarray]], count: int, soft: bool, label: str | None = None,
) -> list[Job]:  # fmt: skip
    name = label or label_of(adjust, theta, extra)
    return [Job(c, name, change_of(c, adjust, theta, extra), k, soft) for k in range(count) for c in conditions]


def extra_at(s: Search, laws: Sequence[Tried], u: np.ndarray) -> list[tuple[Term, np.ndarray]]:
    """(term, values) of laws at the numbers u of a fit, the apparatus left out."""
    rows = zip(laws, rows_of(laws, len(s.adjust)), strict=True)
    return [(t.term, u[own].copy()) for t, own in rows if not t.apparatus]


def base_point(s: Search) -> str:
    """Label of the soft runs of the recalibrated scene."""
    if not s.adjust or np.allclose(s.theta, [t.free[0].first for t in s.adjust]):
        return NAIVE
    return label_of(s.adjust, s.theta)


def rounded(u: np.ndarray) -> np.ndarray:
    """To four digits: a scene that is run again after an interruption is the same scene."""
    return np.array([float(f"{v:.4g}") for v in u])
