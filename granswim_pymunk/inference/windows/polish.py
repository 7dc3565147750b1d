"""Adjustables and laws fitted together, with the bias and the scatter of replicates that have the laws."""

from __future__ import annotations

import numpy as np

from ..criteria import current
from ..hypothesis import Failed, Hypothesis
from ..significance import student
from .likelihood import WindowLikelihood, Windows, both_sides
from .search import Search
from .signatures import whole_films
from .trial import BedTrial, moved_to


def readjusted(search: Search, trial: BedTrial) -> np.ndarray:
    """Adjustables moved, to first order, to where they belong once the law is there."""
    values, likelihood = search.values, search.likelihood
    if not len(values):
        return values
    full = search.hypothesis.with_term(trial.term)
    predicted = likelihood.predict([(full, np.concatenate([values, trial.values]))], search.used)[0]
    if predicted is None:
        return values
    low, high = search.hypothesis.bounds
    change = np.linalg.lstsq(search.nuisance, likelihood.white(predicted, search.used), rcond=1e-10)[0]
    reach = current().windows.polish.reach * (high - low)
    return np.clip(values + np.clip(change, -reach, reach), low, high)


def polish(
    search: Search, hypothesis: Hypothesis, values: np.ndarray, trial: BedTrial, hurried: bool
) -> tuple[np.ndarray, np.ndarray, BedTrial, WindowLikelihood, np.ndarray | None]:
    """Adjustables and laws together, with the bias of replicates that have the laws.

    The estimator's bias depends on the physics, and the first-order step from a scene without the law falls short.
    ``hypothesis``, ``values``: what is there beside the law of ``trial``; the first are the search's adjustables.
    ``hurried``: numbers stay as the trial has them.
    Returns values of all, their covariance, the trial, the likelihood of those replicates, and its whitened columns.
    """
    criteria, adjusted = current().windows.polish, len(search.values)
    likelihood, windows = search.likelihood, search.used
    full = hypothesis.with_term(trial.term)
    z = np.concatenate([values, trial.values])
    n = len(values)
    free = full.free
    rough = np.full((len(z), len(z)), np.nan)
    rough[n:, n:] = trial.covariance
    if hurried:
        return z, rough, trial, likelihood, None
    second = likelihood.with_replicates(max(min(search.plan.replicates - 2, 6), 3))
    told: np.ndarray | None = None
    steps = np.array([criteria.step * (f.high - f.low) for f in free[:adjusted]] + [
        criteria.amount * away if (away := abs(v - f.neutral)) > criteria.nought * f.scale
        else criteria.absent * f.scale
        for v, f in zip(z[adjusted:], free[adjusted:], strict=True)
    ])  # fmt: skip
    low, high = full.bounds
    try:
        late = search.clock.late(current().windows.budget.told)
        second.make_replicates(full, z)
        if not late and search.clock.has_room(second.cost_of_views(2 * len(z), windows)):
            told = _told_by_replicates(second, full, z, steps, windows)
        bias = 0.0 if told is None else told.mean(axis=0)
        for _ in range(criteria.rounds):
            # to both sides: a base that the columns share with the innovations would push along its own chaos
            ends, spans = both_sides(z, steps, low, high)
            here, *beside = second.predict_surely([(full, z), *((full, end) for end in ends)], windows)
            columns = second.columns(beside, spans, windows)
            white = second.white(here, windows)
            steered, away = _bias_follows(likelihood, second, columns, windows, trial, n, z)
            answer = np.linalg.lstsq(columns, white, rcond=1e-10)[0]
            change = steered @ (answer - away - bias)
            # never further than the columns were taken
            change = np.clip(change, -criteria.most * spans / 2, criteria.most * spans / 2)
            before, z = z, np.clip(z + change, low, high)
            if np.all(np.abs(z - before) < criteria.still * spans):
                break
    except (Failed, np.linalg.LinAlgError, ZeroDivisionError):
        return np.concatenate([values, trial.values]), rough, trial, likelihood, None
    # the replicates' covariance is measured, not known, and columns carry the bed's chaos
    rest = white - columns @ answer
    size = max(float(rest @ rest) / max(len(white) - len(z), 1), 1.0)
    covariance = widened(np.linalg.pinv(columns.T @ columns) * size, columns, white, sum(len(w) for w in windows))
    if told is None:
        # the columns of the film in place of those of each replicate
        told = np.linalg.lstsq(columns, whole_films(second.noises, windows), rcond=1e-10)[0].T
    covariance = steered @ as_replicates_scatter(covariance, told) @ steered.T
    return z, covariance, moved_to(trial, z[n:], covariance[n:, n:]), second, columns


def _told_by_replicates(
    likelihood: WindowLikelihood, full: Hypothesis, z: np.ndarray, steps: np.ndarray, windows: Windows
) -> np.ndarray:
    """Answers (N, p) of replicates of ``z``, each with columns of its own starts.

    The truth of replicates is known: the mean is the bias of least squares whose columns have the errors of the starts.
    """
    ends, spans = both_sides(z, steps, *full.bounds)
    views = likelihood.replicate_views([(full, end) for end in ends], windows, likelihood.members)
    films = whole_films(likelihood.noises, windows)
    return np.array(
        [
            np.linalg.lstsq((shown[:, 1::2] - shown[:, ::2]) / spans, film, rcond=1e-10)[0]
            for shown, film in zip(views, films.T, strict=False)
        ]
    )


def _bias_follows(
    likelihood: WindowLikelihood,
    second: WindowLikelihood,
    columns: np.ndarray,
    windows: Windows,
    trial: BedTrial,
    n: int,
    z: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """How the estimator's bias, which grows with the law, changes a step: change = M (least squares - away).

    The replicates of ``second`` have the law as strong as in ``trial``, those of ``likelihood`` have none; between and
    beyond the bias b is linear in the first number of the law: b = b_1 + (b_1 - b_0) (z - z_1)/(z_1 - neutral). (Grains
    that roll, say: no film shows their spin, so each window begins without.)
    """
    parts = []
    for after, before, seen, chosen in zip(second.noises, likelihood.noises, likelihood.seen, windows, strict=True):
        hidden = np.where(np.isfinite(seen), 0.0, np.nan)
        parts.append(after.whiten(after.bias - before.bias + hidden, chosen).ravel())
    size = len(z)
    strength = float(trial.values[0] - trial.term.free[0].neutral)
    if strength == 0.0:
        return np.eye(size), np.zeros(size)
    slope = np.linalg.lstsq(columns, np.concatenate(parts), rcond=1e-10)[0] / strength
    # what would more than triple a step is not believed
    least = 1 / current().windows.polish.tripled - 1
    if slope[n] < least:
        slope = slope * (least / slope[n])
    along = np.zeros((size, size))
    along[:, n] = slope
    return np.linalg.inv(np.eye(size) + along), slope * float(z[n] - trial.values[0])


def widened(covariance: np.ndarray, columns: np.ndarray, white: np.ndarray, windows: int) -> np.ndarray:
    """The covariance, no narrower than the scatter of the answers when windows are left out in turn.

    Columns carry the bed's chaos, which least squares takes for exact.
    Source: Efron & Stein 1981, Ann. Stat. 9, 586 (jackknife variance).
    """
    if windows < 3 or not columns.shape[1]:
        return covariance
    answers = []
    for k in range(windows):
        kept = np.ones(len(white), dtype=bool)
        kept[k * (len(white) // windows) : (k + 1) * (len(white) // windows)] = False
        answers.append(np.linalg.lstsq(columns[kept], white[kept], rcond=1e-10)[0])
    scatter = (windows - 1) * np.var(np.array(answers), axis=0)
    # few windows know their own scatter badly: Student's t in place of the normal 95 %
    factor = student(windows - 1) * np.sqrt(np.maximum(scatter / np.maximum(np.diag(covariance), 1e-300), 1.0))
    return covariance * np.outer(factor, factor)


def as_replicates_scatter(covariance: np.ndarray, answers: np.ndarray) -> np.ndarray:
    """The covariance, no narrower than the scatter of the answers (N, p) that replicates give, whose truth is known.

    Source: Efron & Tibshirani 1993, An Introduction to the Bootstrap, ch. 6 (parametric bootstrap).
    """
    number = len(answers)
    if number < 3:
        return covariance
    scatter = np.var(answers, axis=0, ddof=1) * (1 + 1 / number)
    factor = np.sqrt(np.maximum(student(number) ** 2 * scatter / np.maximum(np.diag(covariance), 1e-300), 1.0))
    return covariance * np.outer(factor, factor)
