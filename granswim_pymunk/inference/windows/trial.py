"""A candidate that was fitted, and when one counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ... import distributions as stats
from ..criteria import current
from ..hypothesis import Term
from ..trial import Tried
from .signatures import BedSignature, to_values


@dataclass(frozen=True)
class BedTrial(Tried):
    """A candidate, and what became of it.

    amounts : in units of the scales of the term's numbers, ``values`` those numbers, ``covariance`` of the values
    linear, gain : fall in chi2 to first order, and simulated (None: not refitted)
    spread : what one of its numbers gains by chance, 1 in noise that is white and known
    jackknife : the linear gain without the window that brings most of it
    attenuation : part of a simulated gain that errors of the starts lend it, see ``chance.as_in_replicates``
    """

    signature: BedSignature
    amounts: np.ndarray
    values: np.ndarray
    covariance: np.ndarray
    linear: float
    gain: float | None
    jackknife: float = 0.0
    spread: float = 1.0
    attenuation: float = 0.0

    @property
    def term(self) -> Term:
        return self.signature.term

    @property
    def worth(self) -> float:
        """Gain less what as many numbers gain by chance, and less what errors of the starts lend it."""
        return (self.linear if self.gain is None else self.gain - self.attenuation) - 2.0 * self.numbers

    @property
    def ahead(self) -> float:
        """Gain to first order, as if of one number in white noise: laws whose noise differs become comparable.

        Without the window that brings most of it: a few odd ones would decide which law leads, and p.
        """
        return float(surplus(np.array(self.jackknife / self.spread), self.numbers))

    def gain_at(self, ahead: np.ndarray) -> np.ndarray:
        """The gains at which this trial would be so far ahead."""
        gains: np.ndarray = self.spread * (ahead + current().windows.search.further * (self.numbers - 1))
        return gains


def surplus(ratio: np.ndarray, numbers: int) -> np.ndarray:
    """Of gains over their spread, what is comparable between laws of one number and of several."""
    left: np.ndarray = ratio - current().windows.search.further * (numbers - 1)
    return left


def first_order(signature: BedSignature, left: np.ndarray, spread: float = 1.0) -> BedTrial:
    """What a candidate gains to first order in what is left (n,)."""
    amounts, gain = signature.best(left[:, None])
    jackknife = float(signature.jackknife(left[:, None])[0])
    return trial_of(signature, amounts[:, 0], float(gain[0]), jackknife=jackknife, spread=spread)


def trial_of(
    signature: BedSignature, amounts: np.ndarray, linear: float, gain: float | None = None, jackknife: float = 0.0,
    spread: float = 1.0,
) -> BedTrial:  # fmt: skip
    term = signature.term
    scales = np.array([f.scale for f in term.free])
    covariance = np.linalg.pinv(signature.clear.T @ signature.clear) * np.outer(scales, scales)
    return BedTrial(signature, amounts, to_values(term, amounts), covariance, linear, gain, jackknife, spread)


def beyond_nothing(trial: BedTrial) -> bool:
    """Whether the numbers of a law are clearly away from those with which it is absent."""
    criteria = current().windows.search
    away = trial.values - np.array([f.neutral for f in trial.term.free])
    if not np.isfinite(trial.covariance).all():
        return True
    chi2 = float(away @ np.linalg.pinv(trial.covariance) @ away)
    return chi2 > float(stats.chi2.isf(2 * stats.norm.sf(criteria.clearly), len(away)))


def moved_to(trial: BedTrial, values: np.ndarray, covariance: np.ndarray) -> BedTrial:
    """The trial with other numbers."""
    scales = np.array([f.scale for f in trial.term.free])
    neutral = np.array([f.neutral for f in trial.term.free])
    return replace(trial, values=values, amounts=(values - neutral) / scales, covariance=covariance)


def smooth_minimum(chi2: Mapping[float, float]) -> tuple[float, float]:
    """Where a parabola through the points about the lowest has its minimum, and how low that is.

    Each chi2 carries the bed's chaos: the lowest of several would flatter. Without a minimum: the lowest point.
    """
    best = min(chi2, key=lambda s: chi2[s])
    low, high = (part * best for part in current().windows.search.about)
    near = sorted((s for s in chi2 if best == 0.0 or low <= s <= high), key=lambda s: abs(s - best))
    if len(near) < 3:
        near = sorted(chi2, key=lambda s: abs(s - best))[:3]
    if len(near) >= 3:
        x, y = np.array(near[:6]), np.array([chi2[s] for s in near[:6]])
        fitted = np.polyfit(x, y, 2)
        if fitted[0] > 0:
            share = float(np.clip(-fitted[1] / (2 * fitted[0]), x.min(), x.max()))
            lowest = float(np.polyval(fitted, share))
            # a parabola that undercuts all points by much fits badly
            room = current().windows.search.undercut * abs(chi2.get(0.0, y.max()) - float(y.min()))
            return share, max(lowest, float(y.min()) - room)
    return best, chi2[best]
