"""What a hypothesis explains of the mismatch on data that it was not fitted to, of whatever kind."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .criteria import BlockCriteria, current


@dataclass(frozen=True)
class Scores:
    """Squared residuals of unseen blocks in units of their expected spread.

    sums, counts : by (block, body, stretch of its time): sum of squares and how many numbers
    residuals : by block (T_rest, c) seen minus predicted [m or rad], not whitened, NaN where not seen and of
        angles beside positions
    floor : (draws, units) the same sums for noise alone, in the order of ``sums``
    """

    sums: Mapping[tuple[Any, ...], float]
    counts: Mapping[tuple[Any, ...], int]
    residuals: Mapping[int, np.ndarray]
    floor: np.ndarray
    failed: tuple[str, ...] = ()

    @property
    def mean(self) -> float:
        """S: the mean squared residual."""
        return sum(self.sums.values()) / max(sum(self.counts.values()), 1)

    @property
    def floors(self) -> np.ndarray:
        """(draws,) S of replicates without a mismatch."""
        return np.asarray(self.floor.sum(axis=1) / max(sum(self.counts.values()), 1))


def spread_with_mismatch(before: Scores) -> float:
    """Spread of S between replicates that have the mismatch of the recalibrated scene.

    Of n numbers m + e with noise e of variance f and a mismatch of mean square b, S is f + b and varies by
    sqrt((2 f^2 + 4 f b)/n): sqrt(1 + 2 b/f) times what noise alone does.
    """
    floors = before.floors
    floor = float(floors.mean())
    return float(floors.std()) * math.sqrt(1.0 + 2.0 * max(before.mean - floor, 0.0) / max(floor, 1e-300))


@dataclass(frozen=True)
class Explained:
    """Share of the mismatch on unseen blocks that goes with a hypothesis.

    share : min(1, 1 - (S - S_floor)/(S_recalibrated - S_floor));  low, high : central 95 % from a block bootstrap
    left, left_before : S - S_floor with the hypothesis and of the recalibrated scene
    spread : of S between replicates without a mismatch
    sure : the mismatch is larger than twice the spread of S between replicates; else no share can be said
    """

    share: float
    low: float
    high: float
    left: float
    left_before: float
    sure: bool
    spread: float = 0.0


def spoken_against(found: Explained) -> Explained:
    """With its share told, however small the mismatch, where unseen data are predicted worse with it than without.

    By more than replicates of S vary: too weak a mismatch for a share says nothing of a law, such a prediction does.
    """
    against = found.left - found.left_before > current().verdict.beyond * found.spread
    return replace(found, sure=True) if against else found


def explained(
    after: Scores, before: Scores, rng: np.random.Generator, criteria: BlockCriteria | None = None,
    beyond: float | None = None, few: bool = False, varies: float = 0.0,
) -> Explained:  # fmt: skip
    """Compare the scores of a hypothesis with those of the recalibrated scene, on the blocks that neither failed.

    few : the floor is the mean of so few replicates that its own error widens the interval: they are drawn anew, too
    varies : spread of S between replicates that have the mismatch, where that is known: what they all lack and the
        noise of each add up or cancel
    """
    criteria = criteria or current().blocks
    beyond = current().verdict.beyond if beyond is None else beyond
    units = [u for u in before.sums if u in after.sums]
    if not before.sums:  # so few frames that none is unseen: nothing is told, and nothing speaks against anything
        return Explained(0.0, 0.0, 0.0, 0.0, 0.0, False)
    if not units:
        # what could not be run has explained nothing, and leaves no less than there was
        return Explained(0.0, 0.0, 0.0, math.inf, before.mean, False)
    order = {u: k for k, u in enumerate(after.sums)}
    floors = after.floor[:, [order[u] for u in units]]
    s0 = np.array([before.sums[u] for u in units])
    s1 = np.array([after.sums[u] for u in units])
    n = np.array([after.counts[u] for u in units], dtype=float)
    f = floors.mean(axis=0)
    order0 = {u: k for k, u in enumerate(before.sums)}
    f0 = before.floor[:, [order0[u] for u in units]].sum(axis=1) / n.sum()

    total = float(n.sum())
    before_left, left = float((s0 - f).sum() / total), float((s1 - f).sum() / total)
    least = beyond * max(float(f0.std()), varies)
    sure = before_left > least and len(units) > 1
    # a sample in which hardly any mismatch was drawn, or one that is not sure by the rule for the whole, says nothing
    # of its share
    asked = max(current().blocks.drawn * abs(before_left), least if sure else 0.0) * total

    def share(a: np.ndarray, b: np.ndarray, floor: np.ndarray) -> np.ndarray:
        rest = b.sum(axis=-1) - floor.sum(axis=-1)
        with np.errstate(all="ignore"):
            value = np.minimum(1.0 - (a.sum(axis=-1) - floor.sum(axis=-1)) / rest, 1.0)
        return np.where(rest > asked, value, np.nan)

    drawn = rng.integers(0, len(units), size=(criteria.bootstrap, len(units)))
    floor = f[drawn]
    if few and len(floors) > 1:
        # a bootstrap of n is too narrow by n/(n - 1) (Efron & Tibshirani 1993, ch. 5)
        count = rng.multinomial(len(floors), np.full(len(floors), 1 / len(floors)), size=criteria.bootstrap)
        weights = 1 / len(floors) + (count / len(floors) - 1 / len(floors)) * math.sqrt(len(floors) / (len(floors) - 1))
        floor = np.take_along_axis(weights @ floors, drawn, axis=1)
    shares = share(s1[drawn], s0[drawn], floor)
    low, high = np.nanquantile(shares, current().intervals.central) if np.isfinite(shares).any() else (0.0, 0.0)
    value = float(np.nan_to_num(share(s1, s0, f)))
    return Explained(value, min(float(low), value), max(float(high), value), left, before_left, sure, float(f0.std()))
