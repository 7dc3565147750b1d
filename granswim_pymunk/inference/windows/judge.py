"""What a fit is worth: errors and their floor, held-out windows, the verdict and its rivals, predictive checks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ... import distributions as stats
from ..criteria import current
from ..mechanisms import UNKNOWN
from ..places import Place
from ..significance import after_looks, beyond
from ..trial import best_of_each
from .likelihood import Prediction, WindowLikelihood, Windows
from .search import Search
from .trial import BedTrial
from .windows import BedCase


@dataclass(frozen=True)
class Errors:
    """Root mean square of seen less predicted positions of the disks [m], the estimator's bias taken off."""

    rms: float | None
    chi2: float | None  # over the count of numbers


@dataclass(frozen=True)
class Discrepancy:
    """Where a film as a whole is unlike its replicates, in words, and what no law explains."""

    place: Place
    text: str
    what: str = "the pace of the whole film"


def predictive_check(likelihood: WindowLikelihood, predicted: Prediction | None = None) -> Discrepancy | None:
    """Whether swimmer or grains move at another pace than in whole films simulated from the same start.

    A predictive check of what windows cannot show (Gelman, Meng & Stern 1996, Stat. Sinica 6, 733). They start from
    what was seen: a swimmer that is stuck stays stuck in them, and one that is pushed against grains is held by forces
    that no start shows. With ``predicted``, of all windows, also whether the swimmer's disks end farther from their
    prediction than those of replicates. Student's t of the logarithm of the rms speed, or error, among those of
    replicates, corrected for the number of looks; None where all is as it should be.
    """
    found: list[Discrepancy] = []
    looks = (2 if predicted is None else 3) * len(likelihood.beds)
    innovations = [None] * len(likelihood.beds) if predicted is None else likelihood.innovations(predicted)
    for b, (bed, predictor, paces, rows) in enumerate(
        zip(likelihood.beds, likelihood.predictors, likelihood.paces, innovations, strict=True)
    ):
        if not bed.training.any():
            continue
        pace = predictor.pace()
        swimmer = tuple(bed.scene.bodies[int(r)].id for r in bed.rows)
        movers = (("swimmer", swimmer, "the swimmer moves"), ("grains farther from the swimmer", (), "the grains move"))
        for k, (region, ids, what) in enumerate(movers):
            _, p = _beside_replicates(pace[k], paces[:, k])
            low, high = 1e3 * float(paces[:, k].min()), 1e3 * float(paces[:, k].max())
            text = (
                f"{bed.name}: over the whole film {what} at {1e3 * pace[k]:.3g} mm/s rms, "
                f"in films simulated from the same start at {low:.3g} to {high:.3g} mm/s; short windows, which begin "
                "with what was seen, do not show why"
            )
            found.append(Discrepancy(Place(ids, *after_looks(p, looks), region), text))
        if rows is None:
            continue
        error, *others = (_rms([disks_of(r, bed)]) or 0.0 for r in (rows, *likelihood.noises[b].residuals))
        those = np.array(others)
        away, p = _beside_replicates(error, those)
        text = (
            f"{bed.name}: the swimmer's disks end {1e6 * error:.3g} um rms from where they are predicted, in films "
            f"simulated from the same start {1e6 * those.min():.3g} to {1e6 * those.max():.3g} um, and no law that was "
            "tried says why"
        )
        if away > 0:
            place = Place(swimmer, *after_looks(p, looks), "swimmer")
            found.append(Discrepancy(place, text, "how far the swimmer ends from where it is predicted"))
    worst = min(found, key=lambda s: s.place.p, default=None)
    alarm = current().windows.places.whole_film * current().verdict.alarm
    return worst if worst is not None and worst.place.p <= alarm else None


def _beside_replicates(seen: float, replicates: np.ndarray) -> tuple[float, float]:
    """Student's t, and its p on both sides, of the logarithm of a number among replicates (N,); 0 and 1 for few."""
    number = len(replicates)
    if number < 3 or not (seen > 0 and (replicates > 0).all()):
        return 0.0, 1.0
    away = beyond(math.log(seen), np.log(replicates), current().windows.search.pace)
    return away, 2.0 * float(stats.t.sf(abs(away), number - 1))


def disks_of(rows: np.ndarray, bed: BedCase) -> np.ndarray:
    """(..., L - 1, n) of numbers (..., D): the swimmer's disks after the start."""
    return rows[..., : bed.swimmer_size].reshape(*rows.shape[:-1], len(bed.looks), 2 * len(bed.rows))[..., 1:, :]


def _rms(parts: Sequence[np.ndarray]) -> float | None:
    """Root mean square of all that was seen, None where nothing was."""
    flat = np.concatenate([part.ravel() for part in parts])
    flat = flat[np.isfinite(flat)]
    return float(np.sqrt(np.mean(flat**2))) if len(flat) else None


def errors(likelihood: WindowLikelihood, predicted: Prediction, windows: Windows) -> Errors:
    """Of the swimmer's disks after the start, in the chosen windows."""
    innovations = zip(likelihood.beds, likelihood.innovations(predicted), windows, strict=True)
    rms = _rms([disks_of(rows[chosen], bed) for bed, rows, chosen in innovations])
    if rms is None:
        return Errors(None, None)
    return Errors(rms, float(np.mean(likelihood.white(predicted, windows) ** 2)))


def held_gain(likelihood: WindowLikelihood, before: Prediction, after: Prediction) -> float:
    """Half the fall in chi2 of the held-out windows."""
    chi2 = [float(np.sum(likelihood.white(rows, likelihood.held) ** 2)) for rows in (before, after)]
    return 0.5 * (chi2[0] - chi2[1])


def noise_floor(likelihood: WindowLikelihood, windows: Windows) -> float:
    """What perfect knowledge of the physics would leave [m rms]: the replicates' own errors, of the disks."""
    replicates = zip(likelihood.beds, likelihood.noises, windows, strict=True)
    rms = _rms([disks_of(noise.residuals[:, chosen], bed) for bed, noise, chosen in replicates])
    return math.nan if rms is None else rms


def moved_away(search: Search, naive_base: Prediction, naive_values: np.ndarray, covariance: np.ndarray) -> bool:
    """Whether adjustables went away from ``naive_values`` by more than chance, and for the better."""
    likelihood, used, values = search.likelihood, search.used, search.values[: len(naive_values)]
    if not len(values):
        return False
    naive, after = likelihood.white(naive_base, used), likelihood.white(search.base, used)
    improved = float(naive @ naive - after @ after)
    spread = np.sqrt(np.diag(covariance))[: len(values)]
    moved = float(np.max(np.abs(values - naive_values) / np.maximum(spread, 1e-300)))
    criteria = current().windows.search
    return improved > criteria.sure + 2 * len(values) and moved > criteria.moved


def rivals_of(found: BedTrial | None, trials: Sequence[BedTrial]) -> list[tuple[BedTrial, bool]]:
    """Other laws that were refitted and come near, the best form of each, and whether d' is below 2."""
    if found is None:
        return []
    score = max((t.worth for t in trials if t.mechanism == found.mechanism and t.gain is not None), default=found.worth)
    near = [t for t in trials if t.gain is not None and t.worth >= current().verdict.rival * score]
    if "joint" in found.term.choices:  # at another joint it is another law
        near = [t for t in near if t.mechanism != found.mechanism or t.term.choices != found.term.choices]
        taken = {UNKNOWN}
    else:
        taken = {UNKNOWN, found.mechanism}
    same = current().verdict.same + current().windows.search.chaos
    return best_of_each(near, lambda t: score - t.worth < same, taken)
