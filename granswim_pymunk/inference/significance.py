"""One definition of p and z of a place, for every kind of recording."""

from __future__ import annotations

import math

from scipy import stats

SMALLEST = 1e-300  # where doubles end


def normal_score(p: float) -> float:
    """z with P(Z > z) = p for a standard normal Z; between -8 and 37, where doubles end."""
    return float(stats.norm.isf(min(max(p, SMALLEST), 1.0 - 1e-15)))


def after_looks(p_one: float, looked: int) -> tuple[float, float]:
    """z and p of a place that is one of ``looked``: p is the probability that the largest of all is as large.

    p = 1 - (1 - p_one)^looked, that of independent places, which for dependent ones is no smaller than the truth.
    Source: Šidák 1967, J. Am. Stat. Assoc. 62, 626.
    """
    p = -math.expm1(max(looked, 1) * math.log1p(-min(p_one, 1.0 - 1e-16)))
    p = max(p, SMALLEST)
    return normal_score(p), p
