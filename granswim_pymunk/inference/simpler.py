"""When a simpler law will do (contract 2), and when a number was not found: one statement for every kind."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Protocol

from .. import distributions as stats
from ..laws import all_laws
from .criteria import current


class Bounded(Protocol):
    """A free number: where its search ends, and where its law is absent."""

    @property
    def name(self) -> str: ...
    @property
    def low(self) -> float: ...
    @property
    def high(self) -> float: ...
    @property
    def neutral(self) -> float: ...
    @property
    def natural(self) -> bool: ...


def special_cases(name: str) -> tuple[str, ...]:
    """Laws that one is when all its numbers but the first are where they add nothing: a flow at rest is a drag."""
    law = all_laws().get(name)
    return law.nests if law is not None else ()


def by_chance(rise: float, numbers: int) -> bool:
    """Whether so many numbers that are absent gain as much: ``rise`` of chi2 over its spread without them.

    Likelihood-ratio test. Source: Wilks 1938, Ann. Math. Stat. 9, 60.
    """
    return rise < float(stats.chi2.isf(current().verdict.absent, numbers))


def all_absent(numbers: Iterable[tuple[float, float, float]]) -> bool:
    """Whether intervals hold where their law is absent: (neutral, low, high) of each number."""
    return all(low <= neutral <= high for neutral, low, high in numbers)


def ended_at_bound(numbers: Iterable[tuple[Bounded, float]]) -> tuple[str, float] | None:
    """The first number, and its bound, that lies where its search ends and not where its law is absent.

    Such a number has not been found. Bounds are declared with the law: a scale that is off by 30 %, an added mass above
    the mass; those of nature (a restitution of one) may be the answer.
    """
    for free, value in numbers:
        for bound in (free.low, free.high):
            if math.isfinite(bound) and bound != free.neutral and not free.natural:
                if abs(value - bound) < current().verdict.at_bound * abs(bound - free.neutral):
                    return free.name, bound
    return None
