"""One definition of p and z of a place, for every kind of recording."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .. import distributions as stats
from .criteria import current


def rank(value: float, sample: np.ndarray) -> float:
    """p of a value among replicates: (1 + how many reach it)/(replicates + 1), never below 1/(replicates + 1)."""
    return float((1 + np.sum(sample >= value)) / (len(sample) + 1))


@dataclass(frozen=True)
class Null:
    """Best gains of the whole search where nothing is missing.

    gains : (replicates,) best fall in chi2 over all candidates;  case : that of the recording
    """

    gains: np.ndarray
    case: float

    @property
    def p(self) -> float:
        return rank(self.case, self.gains)


def at_alarm(gains: np.ndarray) -> float:
    """The gain that so few replicates (n,) reach that it is no false alarm, see ``VerdictCriteria.alarm``."""
    return float(np.quantile(gains, 1 - current().verdict.alarm))


def price(candidates: int, numbers: int = 1) -> float:
    """Fall in chi2 that one more law of a set has to earn: 2 ln(n_0/p_0) of n_0 candidates, and AIC of its numbers.

    Source: Gerardos & Ronceray 2025, Phys. Rev. Lett. 135, 167401.
    """
    return 2 * math.log(max(candidates, 1) / current().verdict.by_chance) + 2 * (numbers - 1)


def half_interval(variance: float) -> float:
    """Half the central 95 % of a normal number with that variance, in its unit."""
    return current().intervals.normal * math.sqrt(max(variance, 0.0))


def student(freedom: float) -> float:
    """By how much 95 % are wider where so many degrees of freedom tell the spread: Student's t over the normal."""
    return float(stats.t.ppf(0.975, freedom) / stats.norm.ppf(0.975))


def beyond(value: float, sample: np.ndarray, least: float) -> float:
    """Student's t of a number beside a sample (N,) of normal ones, of N - 1 degrees of freedom: a prediction interval.

    least : of the sample's standard deviation.  Source: Hahn 1969, J. Qual. Technol. 1, 168.
    """
    spread = max(float(sample.std(ddof=1)), least) * math.sqrt(1 + 1 / len(sample))
    return (value - float(sample.mean())) / spread


def normal_score(p: float) -> float:
    """z with P(Z > z) = p for a standard normal Z; between -8 and 37, where doubles end."""
    return float(stats.norm.isf(min(max(p, current().rounding.nothing), 1.0 - 1e-15)))


def after_looks(p_one: float, looked: int) -> tuple[float, float]:
    """z and p of a place that is one of ``looked``: p is the probability that the largest of all is as large.

    p = 1 - (1 - p_one)^looked, that of independent places, which for dependent ones is no smaller than the truth.
    Source: Šidák 1967, J. Am. Stat. Assoc. 62, 626.
    """
    p = -math.expm1(max(looked, 1) * math.log1p(-min(p_one, 1.0 - 1e-16)))
    p = max(p, current().rounding.nothing)
    return normal_score(p), p
