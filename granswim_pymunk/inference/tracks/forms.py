"""Forms without a name that these data cannot tell from a law: the law has been found, its form has not.

Where a third power of the speed follows the tracks as well as its square, what is left is noise under either. Then a
name is the best approximation so far.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from ..candidates import asked_terms, owners
from ..criteria import current
from ..hypothesis import Term
from ..linear import basis
from .fit import Fitter
from .fitted import Fit
from .name import Trial, rows_of
from .signatures import columns_of


def forms_as_good(
    found: Sequence[Trial], fit: Fit, first: int, fitter: Fitter, spread: float
) -> list[tuple[Term, Trial]]:
    """Forms of no more numbers than a law that do as well in its place, and that law.

    With a law's columns J times its numbers v put back, r + J v is what it has to explain; a form with columns C leaves
    the least |r + J v - C c|^2 over c, starts and all other numbers. It does as well where that is above what the law
    leaves by less than what is told apart (``VerdictCriteria.same``, times ``spread``), further numbers paid for (AIC).
    first : of the numbers of the fit, where those of the laws begin
    """
    starts = block_diag(*(fit.jacobian[c.name][1] for c in fitter.cases))
    numbers = np.concatenate([fit.jacobian[c.name][0] for c in fitter.cases])
    left = np.concatenate([fit.used(c.name) for c in fitter.cases])
    taken = basis(starts)

    def beside(vectors: np.ndarray) -> np.ndarray:
        return np.asarray(vectors - taken @ (taken.T @ vectors))

    def least(vector: np.ndarray, columns: np.ndarray) -> float:
        q = basis(beside(columns))
        vector = beside(vector)
        rest = vector - q @ (q.T @ vector)
        return float(rest @ rest)

    now, told = least(left, numbers), list[tuple[Term, Trial]]()
    for trial, rows in zip(found, rows_of(found, first), strict=True):
        if trial.apparatus:
            continue
        mine = fit.values[rows] - np.array([f.neutral for f in trial.term.free])
        others = np.delete(numbers, np.arange(rows.start, rows.stop), axis=1)
        for term in asked_terms(fitter.cases, owners(trial.term)):
            fewer = trial.used - len(term.free)
            if fewer < 0:
                continue
            columns = np.hstack([columns_of(fitter, fit, term)[0], others])
            rise = least(left + numbers[:, rows] @ mine, columns) - now
            if rise / spread - 2 * fewer < current().verdict.same:
                told.append((term, trial))
    return told
