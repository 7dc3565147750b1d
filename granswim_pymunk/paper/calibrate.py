"""The one free number of the confinement, mu_eff, from a measured curve or from the ratio of one third."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..sweep import Job, read_dataset
from .plans import Point, Setting, complete
from .results import Results, jobs_of, run_points, summarise

TARGET = 1.0 / 3.0


@dataclass(frozen=True)
class Calibration:
    """mu_eff [s/m] with its 95 % half width.

    rms : misfit of the curve at mu_eff [m/s] (NaN where a ratio was asked for);  ratio : free over confined
    speed at the paper's layers, at the setting's mu_eff;  mu, misfit : what was tried
    """

    mu_eff: float
    error: float
    ratio: float
    rms: float
    packings: int
    mu: np.ndarray
    misfit: np.ndarray

    @property
    def text(self) -> str:
        if not np.isfinite(self.mu_eff):
            return "not reached between the values that were run"
        return f"{self.mu_eff:.3f} ± {self.error:.3f} s/m" if np.isfinite(self.error) else f"{self.mu_eff:.3f} s/m"


def third_of_free(results: Results, seed: int = 0, draws: int = 1000) -> Calibration:
    """mu_eff at which the speed at 9 Hz under 11 layers is a third of the free one.

    Straight lines between the values of mu_eff that were run (0 included). For the error every mean is drawn anew
    from its own Student t.
    """
    mu = np.array([0.0, *results.setting.friction])
    speeds = [
        results.values("speed", frequency=9.0)
        if m == 0
        else results.values("speed", frequency=9.0, layers=11.0, mu_eff=float(m))
        for m in mu
    ]
    have = np.array([len(s) > 0 for s in speeds])
    nothing = Calibration(np.nan, np.nan, np.nan, np.nan, 0, mu[have], np.array([]))
    if have.sum() < 2 or not have[0]:
        return nothing
    mu, speeds = mu[have], [s for s in speeds if len(s)]
    means = np.array([s.mean() for s in speeds])
    rng = np.random.default_rng(seed)
    sampled = []
    for _ in range(draws):
        drawn = np.array([_redrawn(s, rng) for s in speeds])
        sampled.append(_crossing(mu, drawn / drawn[0]))
    kept = np.array(sampled)
    kept = kept[np.isfinite(kept)]
    few = min(len(s) for s in speeds) < 2
    low, high = np.percentile(kept, [2.5, 97.5]) if len(kept) > draws / 2 and not few else (np.nan, np.nan)
    at = np.flatnonzero(np.isclose(mu, results.setting.mu_eff))
    ratio = float(means[0] / means[at[0]]) if len(at) else np.nan
    return Calibration(
        _crossing(mu, means / means[0]), float(high - low) / 2, ratio, np.nan, min(len(s) for s in speeds), mu,
        np.abs(means / means[0] - TARGET),
    )  # fmt: skip


def _redrawn(values: np.ndarray, rng: np.random.Generator) -> float:
    """A mean as it might have been: from its Student t, which knows how few packings there were."""
    n = len(values)
    return float(values.mean() + (values.std(ddof=1) / np.sqrt(n) * rng.standard_t(n - 1) if n > 1 else 0.0))


def _crossing(mu: np.ndarray, ratio: np.ndarray) -> float:
    """Where the ratio first falls through a third."""
    below = np.flatnonzero(ratio <= TARGET)
    if not len(below) or below[0] == 0:
        return float("nan")
    k = int(below[0])
    part = (ratio[k - 1] - TARGET) / (ratio[k - 1] - ratio[k])
    return float(mu[k - 1] + part * (mu[k] - mu[k - 1]))


def fit_curve(
    curve: np.ndarray, mu: np.ndarray, speeds: Sequence[Sequence[np.ndarray]], seed: int = 0, draws: int = 500
) -> Calibration:
    """mu_eff whose simulated speeds have the least mean squared difference from a measured curve.

    curve : structured (k,) as ``recording.folder.read_curve`` gives it (frequency, layers, speed, speed_sem)
    mu : (m,) values that were run [s/m], rising;  speeds[i][j] : (packings,) speeds at mu i, row j [m/s]
    Between the values of mu speeds are interpolated linearly; rows are weighed by 1/speed_sem^2 where all rows
    have one. For the error every mean is drawn anew from its own Student t. Raises InputError where fewer than two
    mu have runs.
    """
    mu = np.asarray(mu, dtype=float)
    if len(mu) < 2 or any(len(s) == 0 for row in speeds for s in row):
        raise InputError("needs runs at two values of mu_eff for every row of the curve", where="calibration")
    sem = curve["speed_sem"]
    weight = 1 / sem**2 if np.isfinite(sem).all() and (sem > 0).all() else np.ones(len(curve))
    fine = np.linspace(mu[0], mu[-1], 401)

    def misfit(means: np.ndarray) -> np.ndarray:
        model = np.array([np.interp(fine, mu, column) for column in means.T])
        return np.average((model - curve["speed"][:, None]) ** 2, axis=0, weights=weight)

    means = np.array([[s.mean() for s in row] for row in speeds])
    squares = misfit(means)
    best = int(np.argmin(squares))
    rng = np.random.default_rng(seed)
    sampled = [
        fine[np.argmin(misfit(np.array([[_redrawn(s, rng) for s in row] for row in speeds])))]
        for _ in range(draws)
    ]
    low, high = np.percentile(sampled, [2.5, 97.5])
    packings = min(len(s) for row in speeds for s in row)
    return Calibration(
        float(fine[best]), float(high - low) / 2 if packings > 1 else np.nan, np.nan, float(np.sqrt(squares[best])),
        packings, fine, np.sqrt(squares),
    )  # fmt: skip


def calibrate(
    curve: np.ndarray, setting: Setting, folder: str | Path, mu: Sequence[float] | None = None, **how: Any
) -> Calibration:
    """Run what a curve needs (its frequencies and layers, each mu_eff, all packings) and fit mu_eff.

    folder : of the run files, shared with the claims;  mu : [s/m] (default: none and those of the claims)
    how : as ``sweep.run_jobs``
    """
    mu = (0.0, *setting.friction) if mu is None else mu
    if not len(curve):
        raise InputError("has no rows", where="curve")
    rows = [(float(row["frequency"]), float(row["layers"])) for row in curve]
    jobs: dict[tuple[int, int], list[Job]] = {}
    for i, m in enumerate(mu):
        for j, (frequency, layers) in enumerate(rows):
            point: Point = {"frequency": frequency}
            if m > 0 and layers > 0:
                point |= {"layers": layers, "mu_eff": float(m)}
            jobs[i, j] = jobs_of([complete(point, setting, seed) for seed in setting.seeds], setting, Path(folder))
    run_points([job for group in jobs.values() for job in group], setting, **how)
    speeds = []
    for i in range(len(mu)):
        line = []
        for j in range(len(rows)):
            runs = [read_dataset(job.file) for job in jobs[i, j] if job.done]
            line.append(np.array([float(summarise(r)["speed"]) for r in runs if not r.attrs.get("reason")]))
        speeds.append(line)
    return fit_curve(curve, np.array(mu), speeds)


__all__ = ["Calibration", "calibrate", "fit_curve", "third_of_free"]
