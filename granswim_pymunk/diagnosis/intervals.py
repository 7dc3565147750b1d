"""Intervals of numbers that only together are known: a profile of chi2 in place of its curvature.

Where a drag is adjustable and a flow is missing, c (v - u) shows as c u and as c plus the other drag: any c will do,
with a u to match. The curvature at one place of such a valley says nothing of how far it goes, and it bends.
Source: Venzon & Moolgavkar 1988, Applied Statistics 37, 87.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .fit import Fit, Fitter, information_of

ALONE = 1e-3  # share of its information that a number keeps beside the others, below which it is not known alone
LEVEL = 3.84  # rise of chi2 at the ends of 95 %
GROWTH = 2.0  # of steps along a valley that were good
MOST = 20  # steps to either side, after which there is no end but the bound
FINE = 0.05  # of its distance, to which an end is found
EVALUATIONS = 30


def with_limits(
    fitter: Fitter, fit: Fit, first: int, spread: float, late: Callable[[], bool] = lambda: False
) -> Fit:
    """The fit with sharp derivatives, and with profiles for its numbers from ``first`` on that are not known alone.

    spread : inflation of variances by what the fit leaves;  late : stops between two numbers
    """
    fit = fitter.sharpened(fit)
    told = information_of(fit.jacobian, len(fit.values))
    limits = {}
    for k in unknown_alone(told):
        if k < first or late():
            continue
        step = 1.96 / math.sqrt(told[k, k])
        limits[k] = _end(fitter, fit, k, spread, -1.0, step), _end(fitter, fit, k, spread, 1.0, step)
    return replace(fit, limits=limits) if limits else fit


def unknown_alone(information: np.ndarray) -> list[int]:
    """Numbers of an information matrix (p, p) of whose information the others take nearly all."""
    size = np.sqrt(np.diag(information))
    shown = np.flatnonzero(size > 0)
    if len(shown) < 2:
        return []
    part = (information / np.outer(size, size).clip(1e-300))[np.ix_(shown, shown)]
    # of a singular matrix the inverse of what it lacks is huge
    inverse = np.linalg.inv(part + 1e-9 * np.eye(len(part)))
    return [int(k) for k, wide in zip(shown, np.diag(inverse), strict=True) if wide * ALONE > 1.0]


def _end(fitter: Fitter, fit: Fit, k: int, spread: float, side: float, first: float) -> float:
    """Where chi2, all others refitted, has risen by ``LEVEL``; the bound where it never does; ``first``: a step."""
    free = fit.hypothesis.free[k]
    bound = free.high if side > 0 else free.low
    step, here, failed = first, fit, False
    for _ in range(MOST):
        at = float(here.values[k]) + side * step
        if (at - bound) * side >= 0:
            at = bound
        values = here.values.copy()
        values[k] = at
        found = fitter.fit(fit.hypothesis, values, here.starts, evaluations=EVALUATIONS, held=(k,))
        if found.chi2 - fit.chi2 < LEVEL * spread:
            if at == bound:
                return bound
            here = found
            step *= 1.0 if failed else GROWTH
        else:
            # the end, or a valley that bends more than one search can follow
            failed = True
            step *= 0.5
            if step < 0.1 * first + FINE * abs(float(here.values[k] - fit.values[k])):
                return at
    return at if failed else bound
