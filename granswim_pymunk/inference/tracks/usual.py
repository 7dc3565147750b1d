"""How much of a mismatch is what any apparatus is off by, and what a law explains beyond that.

A picture's scale is off by half a per cent, masses by two, a table by half a millimetre in a metre: nobody states it,
and every recording has it. A law that moves the bodies as such errors do explains nothing that was not to be expected.
So what a fit leaves is held against noise and these errors together, of covariance C = s^2 1 + N N', with N what each
does at its usual size; beyond them a law with directions D explains r' C^-1 D (D' C^-1 D)^-1 D' C^-1 r.
Source: Tarantola 2005, Inverse Problem Theory, ch. 3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..criteria import current
from ..linear import basis
from .name import Trial, is_part
from .signatures import Bank


def is_usual(trial: Trial) -> bool:
    """Whether a law is an error that any apparatus has, no larger than they are."""
    most = current().verdict.usual
    numbers = zip(trial.term.free, map(float, trial.values), strict=True)
    return all(abs(value - free.neutral) <= most * free.error for free, value in numbers)


def usual_errors(bank: Bank) -> dict[str, np.ndarray]:
    """What any apparatus is off by, and what it does (n, m): of a kind the one with most numbers, for all bodies."""
    every = [s.term for s in bank.signatures]
    found: dict[str, np.ndarray] = {}
    for s in bank.signatures:
        if s.usual is None or not s.usual.any() or is_part(s.term, every):
            continue
        if s.term.mechanism not in found or found[s.term.mechanism].shape[1] < s.usual.shape[1]:
            found[s.term.mechanism] = s.usual
    return found


def beyond_usual(bank: Bank, trials: Sequence[Trial], spread: float) -> np.ndarray:
    """Fall in chi2 by each law (m,) beside what any apparatus is off by, those of its own kind aside.

    spread : s^2, the inflation of the noise
    """
    errors, left = usual_errors(bank), bank.left
    found = []
    for trial in trials:
        others = [moved for mechanism, moved in errors.items() if mechanism != trial.mechanism]
        moves = _moves(bank, trial)
        if not others or not moves.shape[1]:
            found.append(trial.gain)
            continue
        n = np.hstack(others)
        inner = spread * np.eye(n.shape[1]) + n.T @ n
        rest, own = (v - n @ np.linalg.solve(inner, n.T @ v) for v in (left, moves))
        found.append(float(rest @ moves @ np.linalg.pinv(moves.T @ own, hermitian=True) @ (moves.T @ rest)))
    return np.array(found)


def _moves(bank: Bank, trial: Trial) -> np.ndarray:
    """(n, k) orthonormal, how a law moves the bodies: to first order, or, where that is not its gain, as in its fit."""
    signature, fit = trial.signature, trial.fit
    if fit is None or signature.gain >= current().verdict.nearly * trial.gain:
        return signature.directions
    change = bank.innovations - np.concatenate([fit.used(name) for name in bank.fit.innovations])
    return basis((change - bank.nuisance @ (bank.nuisance.T @ change))[:, None])
