"""What a claim is: what the paper says, what was measured, whether it holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from .results import Results

HOLDS, FAILS, OPEN, CALIBRATED = "holds", "does not hold", "not decided", "calibrated"


@dataclass(frozen=True)
class Finding:
    """One statement: the paper's words, the measured value with its 95 % half width, and the verdict.

    value, error are in ``unit``; packings says from how many; note: anything to add.
    """

    says: str
    measured: str
    verdict: str
    value: float | None = None
    error: float | None = None
    unit: str = ""
    packings: int = 0
    note: str = ""


@dataclass(frozen=True)
class Claim:
    """A table or figure of the paper.

    blocks : of runs that it needs (``plans.blocks``);  judge, draw : from the results
    """

    name: str
    title: str
    where: str
    blocks: tuple[str, ...]
    judge: Callable[[Results], list[Finding]]
    draw: Callable[[Results], Figure | None]


@dataclass
class Verdict:
    """A judged claim."""

    claim: Claim
    findings: list[Finding]
    figure: str = ""
    missing: int = 0
    failed: list[str] = field(default_factory=list)

    @property
    def verdict(self) -> str:
        """The worst of its statements that are decided: refuted if any is, open if none is decided."""
        found = [f.verdict for f in self.findings]
        if FAILS in found:
            return FAILS if HOLDS not in found else "holds in part"
        if HOLDS in found:
            return HOLDS if OPEN not in found else "holds as far as decided"
        return found[0] if found and len(set(found)) == 1 else OPEN

    @property
    def packings(self) -> int:
        """The fewest packings that any of its statements rests on (0 where one has no runs, or none needs any)."""
        return min((f.packings for f in self.findings), default=0)

    def to_dict(self) -> dict[str, Any]:
        return {
            "claim": self.claim.name,
            "title": self.claim.title,
            "where": self.claim.where,
            "verdict": self.verdict,
            "packings": self.packings,
            "figure": self.figure,
            "runs_missing": self.missing,
            "runs_failed": self.failed,
            "findings": [{k: _plain(v) for k, v in asdict(f).items()} for f in self.findings],
        }


def _plain(value: Any) -> Any:
    if isinstance(value, float | np.floating):
        return None if not np.isfinite(value) else float(value)
    return value


def above(value: float, error: float, bound: float = 0.0) -> str:
    """HOLDS where value lies above the bound by more than its error, FAILS where below, else OPEN."""
    if not (np.isfinite(value) and np.isfinite(error)):
        return OPEN
    return HOLDS if value - error > bound else FAILS if value + error < bound else OPEN


def within(value: float, error: float, low: float, high: float) -> str:
    """HOLDS where the interval lies inside, FAILS where it lies outside, else OPEN."""
    if not (np.isfinite(value) and np.isfinite(error)):
        return OPEN
    if low <= value - error and value + error <= high:
        return HOLDS
    return FAILS if value + error < low or value - error > high else OPEN


def number(value: float, error: float, unit: str = "", scale: float = 1.0, digits: int = 3) -> str:
    """``8.02 ± 0.41 mm/s``; without a finite error only the value."""
    value, error = value * scale, error * scale
    if not np.isfinite(value):
        return "no runs"
    tail = f" {unit}" if unit else ""
    if not np.isfinite(error):
        return f"{value:.{digits}g}{tail} (one packing)"
    places = max(0, digits - 1 - int(np.floor(np.log10(max(abs(value), abs(error), 1e-300)))))
    return f"{value:.{places}f} ± {error:.{places}f}{tail}" if places < 7 else f"{value:.2e} ± {error:.1e}{tail}"


def least(counts: Sequence[int]) -> int:
    """Fewest packings, those that are missing altogether left out."""
    real = [c for c in counts if c > 0]
    return min(real) if real else 0


def peak(
    frequency: np.ndarray, speeds: list[np.ndarray], rng: np.random.Generator, draws: int = 2000
) -> tuple[float, float, float]:
    """The frequency of the largest mean speed and its central 95 % [Hz]; see ``peaks``."""
    best, sampled = peaks(frequency, speeds, rng, draws)
    low, high = np.percentile(sampled, [2.5, 97.5])
    return best, float(low), float(high)


def peaks(
    frequency: np.ndarray, speeds: list[np.ndarray], rng: np.random.Generator, draws: int = 2000
) -> tuple[float, np.ndarray]:
    """The frequency of the largest mean speed [Hz], and (draws,) where it might as well have been.

    frequency (k,) rising; speeds: k arrays, one value a packing, two or more each. Through the largest mean and
    its two neighbours goes a parabola; at the ends of the range the end itself is returned. For the draws
    every mean is drawn anew from its own Student t, which knows how few packings there were.
    """
    frequency = np.asarray(frequency, dtype=float)

    def top(means: np.ndarray) -> float:
        k = int(np.argmax(means))
        if k in (0, len(means) - 1):
            return float(frequency[k])
        a, b, _ = np.polyfit(frequency[k - 1 : k + 2], means[k - 1 : k + 2], 2)
        return float(-b / (2 * a)) if a < 0 else float(frequency[k])

    means = np.array([s.mean() for s in speeds])
    errors = np.array([s.std(ddof=1) / np.sqrt(len(s)) for s in speeds])
    freedom = np.array([len(s) - 1 for s in speeds])
    return top(means), np.array([top(means + errors * rng.standard_t(freedom)) for _ in range(draws)])
