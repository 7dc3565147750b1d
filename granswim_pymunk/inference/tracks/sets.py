"""What the search of several laws goes on from, and how laws stand in one fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...laws import has_role
from ..data import Case
from ..hypothesis import Hypothesis, Term
from .fit import Fitter
from .fitted import Fit
from .name import InnerSplit, Trial, label_of, spread_of


@dataclass(frozen=True)
class SetSearch:
    """The search of laws that are needed together.

    base : the recalibrated scene, whose numbers come first in every fit;  fitter : of its segments
    terms : the candidates;  training : recordings that are learnt from;  inner : scores inside the training part
    scores : these scores, by the labels of laws: those of sets that are tried are added;  rng : of the nulls
    notes : what a reader should know, to which is added
    seeks : roles of which one law of a set has to have one, where all without it were tried before
    """

    base: Fit
    fitter: Fitter
    terms: Sequence[Term]
    training: Sequence[Case]
    inner: InnerSplit
    scores: dict[str, float]
    rng: np.random.Generator
    notes: list[str]
    seeks: tuple[str, ...] = ()

    @property
    def first(self) -> int:
        """How many numbers the recalibrated scene has: those of the laws follow."""
        return len(self.base.values)

    def spread(self, fit: Fit) -> float:
        """Inflation of variances by what a fit leaves over."""
        return spread_of(fit, self.training)

    def new(self, *terms: Term) -> bool:
        """Whether a set of laws has not been tried before for want of the role that is sought."""
        return not self.seeks or any(map(self.seeks_for, terms))

    def seeks_for(self, term: Term) -> bool:
        """Whether a law has a role that is sought."""
        return bool(self.seeks) and has_role(term.mechanism, *self.seeks)

    def scene_with(self, *terms: Term) -> Hypothesis:
        """The recalibrated scene with these laws."""
        return self.base.hypothesis.with_term(*terms)

    def as_in(self, fit: Fit, laws: Sequence[Trial]) -> list[Trial]:
        """Laws as they stand in a fit of all of them."""
        return [replace(t, fit=fit, gain=self.base.chi2 - fit.chi2) for t in laws]

    def scored(self, fit: Fit, laws: Sequence[Trial], score: float | None = None) -> list[Trial]:
        """Laws as they stand in a fit of all of them, with their score inside the training part, which is kept."""
        score = self.inner.score(fit)[0] if score is None else score
        self.scores[label_of(*laws)] = score
        return [replace(t, inner=score) for t in self.as_in(fit, laws)]
