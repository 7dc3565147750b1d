"""A force from a place at which nothing is seen, beside what slows bodies down."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from ..criteria import current
from ..hypothesis import Failed, Term
from .fit import Fitter, side_by_side
from .fitted import Fit
from .name import Trial
from .pairs import fit_beside, goes_with_speed
from .sets import SetSearch
from .signatures import Signature, make_bank


def slowed_beside(
    search: SetSearch, alive: Sequence[Trial], terms: Sequence[Term], claim: Fit, used: int
) -> Trial | None:
    """The law of one number that goes with the speed, alone, beside which one of ``terms`` leaves less than a claim.

    A table with a magnet below it slows its pucks as well, and either alone leaves more than other laws may. Numbers
    are paid for (AIC).
    used : numbers that the laws of the claim have
    """
    drags: dict[str, Trial] = {}
    for t in sorted(alive, key=lambda t: -t.gain):
        if t.fit is not None and t.numbers == 1 and goes_with_speed(t.term):
            drags.setdefault(t.mechanism, t)

    def fitted(own: Fitter, base: Fit, signature: Signature) -> Fit | None:
        try:
            return fit_beside(own, base, (signature,))
        except Failed:
            return None

    asked = [
        (t, s) for t in list(drags.values())[: current().sets.variants] if t.fit is not None
        for s in make_bank(search.fitter, t.fit, terms).signatures if len(s.directions.T)
    ]  # fmt: skip
    jobs = [partial(fitted, base=t.fit, signature=s) for t, s in asked if t.fit is not None]
    fits = side_by_side(search.fitter, jobs)
    both = [(fit, 1 + len(s.term.free), t) for (t, s), fit in zip(asked, fits, strict=True) if fit is not None]
    if not both:
        return None
    spread = search.spread(min((fit for fit, _, _ in both), key=lambda f: f.chi2))
    fit, numbers, drag = min(both, key=lambda entry: entry[0].chi2 / spread + 2 * entry[1])
    return drag if (claim.chi2 - fit.chi2) / spread > 2 * (numbers - used) else None
