"""Forms without a name that these data cannot tell from a law: the law has been found, its form has not.

Where a third power of the speed follows the tracks as well as its square, what is left is noise under either. Then a
name is the best approximation so far. So it is where a field that changes in place follows them better than a uniform
force.

A form in place of a law is a claim as well, and held-out data may turn it down. Where a body slows down, they are often
all that tells one power of the speed from another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..candidates import asked_terms, owners
from ..criteria import current
from ..hypothesis import Failed, Term
from ..judge import completeness
from ..linear import basis
from ..trial import rows_of
from .fit import Fitter
from .fitted import Fit
from .innovations import series_of
from .name import Trial
from .signatures import columns_of, stacked


@dataclass(frozen=True)
class Alike:
    """A form without a name that these data cannot tell from a law, or prefer to it.

    better : it has more numbers than the law and earns them
    ahead : chi2 by which it leaves less than the law, its further numbers paid for; below 0 the law is nearer
    fewer : it has fewer numbers than the law, and of what cannot be told apart that with fewest goes first
    """

    form: Term
    law: Trial
    better: bool
    ahead: float
    fewer: bool = False

    @property
    def counts(self) -> bool:
        """Whether the form of the law is not told beside it."""
        return self.ahead >= 0 or self.fewer


def forms_as_good(found: Sequence[Trial], fit: Fit, first: int, fitter: Fitter, spread: float) -> list[Alike]:
    """Forms that do as well in place of a law with no more numbers than it has, or better with more.

    With a law's columns J times its numbers v put back, r + J v is what it has to explain; a form with columns C leaves
    the least |r + J v - C c|^2 over c, starts and all other numbers. It does as well where this is above what the law
    leaves by less than ``VerdictCriteria.alike`` (times ``spread``), and better where it is below by more than what is
    told apart (``same``); numbers are paid for (AIC).
    first : of the numbers of the fit, where those of the laws begin
    """
    whole = stacked(fitter, fit)
    left, numbers = whole.left, whole.numbers

    def least(vector: np.ndarray, columns: np.ndarray) -> float:
        q = basis(whole.beside(columns))
        vector = whole.beside(vector)
        rest = vector - q @ (q.T @ vector)
        return float(rest @ rest)

    now, told, verdict = least(left, numbers), list[Alike](), current().verdict
    for trial, rows in zip(found, rows_of(found, first), strict=True):
        if trial.apparatus:
            continue
        mine = fit.values[rows] - np.array([f.neutral for f in trial.term.free])
        others = np.delete(numbers, np.arange(rows.start, rows.stop), axis=1)
        for term in (t for t in asked_terms(fitter.cases, owners(trial.term)) if t.mechanism != trial.mechanism):
            columns = columns_of(fitter, fit, term)[0]
            more = basis(whole.beside(columns)).shape[1] - trial.used
            rise = least(left + numbers[:, rows] @ mine, np.hstack([columns, others])) - now
            ahead = -rise / spread - 2 * more
            if columns.any() and ahead > (verdict.same if more > 0 else -verdict.alike):
                told.append(Alike(term, trial, more > 0, ahead))
    return told


def fitted_as_good(law: Trial, fit: Fit, forms: Sequence[Trial], spread: float) -> list[Alike]:
    """Forms, fitted themselves in place of the one law, that do as well as it with no more numbers than it has.

    A law that lies far off along a bent valley, as a spring whose other end is a radius of curvature away, has no
    columns that say what it does: only a fit of the form tells that a force across the motion is enough.
    """
    criteria = current().verdict
    ahead = [(t, (fit.chi2 - t.fit.chi2) / spread + 2 * (law.used - t.used)) for t in forms if t.fit is not None]
    near = [(t, a) for t, a in ahead if t.used <= law.used and a > -criteria.alike]
    return [Alike(t.term, law, False, a, t.used < law.used) for t, a in near]


def left_standing(
    told: Sequence[Alike], found: Sequence[Trial], fit: Fit, first: int, whole: Fitter, spread: float
) -> list[Alike]:
    """Those forms that do as well on all frames together, held-out ones among them, and how far ahead they are there.

    Numbers and starts of the laws are found again from all frames. Where that fails, or leaves more than noise, the
    laws are not all there is, and nothing is turned down.
    whole : of all frames;  other arguments as of ``forms_as_good``
    """
    try:
        again = whole.refitted(fit)
    except Failed:
        return list(told)
    if not completeness(series_of(again, whole.cases)).passes:
        return list(told)
    stood = {(a.form.mechanism, a.law.mechanism) for a in told}
    standing = forms_as_good(found, again, first, whole, spread)
    return [a for a in standing if (a.form.mechanism, a.law.mechanism) in stood]
