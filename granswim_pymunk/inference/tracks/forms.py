"""Forms without a name that these data cannot tell from a law: the law has been found, its form has not.

Where a third power of the speed follows the tracks as well as its square, what is left is noise under either. Then a
name is the best approximation so far. So it is where a field that changes in place follows them better than a uniform
force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..candidates import asked_terms, owners
from ..criteria import current
from ..hypothesis import Term
from ..linear import basis
from ..trial import rows_of
from .fit import Fitter
from .fitted import Fit
from .name import Trial
from .signatures import columns_of, stacked


@dataclass(frozen=True)
class Alike:
    """A form without a name that these data cannot tell from a law, or prefer to it."""

    form: Term
    law: Trial
    better: bool


def forms_as_good(found: Sequence[Trial], fit: Fit, first: int, fitter: Fitter, spread: float) -> list[Alike]:
    """Forms that do as well in place of a law with no more numbers than it has, or better with more.

    With a law's columns J times its numbers v put back, r + J v is what it has to explain; a form with columns C leaves
    the least |r + J v - C c|^2 over c, starts and all other numbers. It does as well where this is above what the law
    leaves by less than what is told apart (``VerdictCriteria.same``, times ``spread``), and better where it is below by
    more than that; numbers are paid for (AIC).
    first : of the numbers of the fit, where those of the laws begin
    """
    whole = stacked(fitter, fit)
    left, numbers = whole.left, whole.numbers

    def least(vector: np.ndarray, columns: np.ndarray) -> float:
        q = basis(whole.beside(columns))
        vector = whole.beside(vector)
        rest = vector - q @ (q.T @ vector)
        return float(rest @ rest)

    now, told, same = least(left, numbers), list[Alike](), current().verdict.same
    for trial, rows in zip(found, rows_of(found, first), strict=True):
        if trial.apparatus:
            continue
        mine = fit.values[rows] - np.array([f.neutral for f in trial.term.free])
        others = np.delete(numbers, np.arange(rows.start, rows.stop), axis=1)
        for term in asked_terms(fitter.cases, owners(trial.term)):
            columns = columns_of(fitter, fit, term)[0]
            more = basis(whole.beside(columns)).shape[1] - trial.used
            rise = least(left + numbers[:, rows] @ mine, np.hstack([columns, others])) - now
            ahead = -rise / spread - 2 * more
            if columns.any() and ahead > (same if more > 0 else -same):
                told.append(Alike(term, trial, more > 0))
    return told
