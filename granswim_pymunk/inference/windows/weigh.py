"""What laws explain of the mismatch in windows, whether the rest is like that of replicates, and what it looks like."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..criteria import current
from ..explained import Explained, Scores, explained
from ..hypothesis import Hypothesis
from ..judge import Remains, paired
from ..mechanisms import NOTHING, UNKNOWN, nameless, plainly
from ..significance import student
from .judge import disks_of, errors, noise_floor
from .likelihood import Prediction, WindowLikelihood, Windows
from .places import maps
from .search import Answer, Search
from .signatures import Noise, make_signature, off
from .trial import BedTrial, first_order


def squares_of(
    noises: Sequence[Noise], rows: Sequence[np.ndarray], windows: Windows, replicate: int | None
) -> np.ndarray:
    """(windows,) squares of innovations (W, D) [m] of each bed, by what the replicates but one tell of the noise.

    replicate : the one that is left out, None for the mean over all. A film is judged by as many replicates as each
    replicate is by the others: their covariance, which few samples tell, would otherwise be another for the two.
    """
    out = []
    for noise, own, chosen in zip(noises, rows, windows, strict=True):
        every = noise.by_others()
        metrics = every if replicate is None else [every[replicate % len(every)]]
        out.append(np.mean([np.sum(m.whiten(own, chosen) ** 2, axis=1) for m in metrics], axis=0))
    return np.concatenate(out)


def scores_of(
    likelihood: WindowLikelihood,
    judge: WindowLikelihood,
    rows: Prediction,
    windows: Windows,
    columns: np.ndarray | None = None,
) -> Scores:
    """Squared whitened innovations of each window, with the estimator's bias in the replicates of ``judge``; its floor.

    One covariance, that of ``likelihood``, whatever the scene: otherwise S of two scenes could not be compared.
    Replicates of ``judge`` start with the noise of those of ``likelihood`` that have their number: each is judged by
    the others. columns : (n, p) whitened, of the numbers that were fitted: each window then counts with numbers from
    all others, in the film and in the replicates, to which as many numbers are fitted
    """
    sizes = sizes_of(likelihood, windows)
    innovations = judge.innovations(rows)
    squares = squares_of(likelihood.noises, innovations, windows, None)
    if columns is not None:
        squares = squares + by_others(columns, judge.white(rows, windows), sizes)
    floor = []
    for k in range(min(len(noise.residuals) for noise in judge.noises)):
        replicate = [noise.residuals[k] for noise in judge.noises]
        floor.append(squares_of(likelihood.noises, replicate, windows, k))
        if columns is not None:
            floor[-1] = floor[-1] + fitted_by_others(columns, _white(likelihood.noises, replicate, windows, k), sizes)
    sums: dict[tuple[int, str], float] = {}
    counts: dict[tuple[int, str], int] = {}
    residuals: dict[int, np.ndarray] = {}
    for bed, own, chosen in zip(likelihood.beds, innovations, windows, strict=True):
        for w in chosen:
            unit = len(sums)
            sums[unit, bed.name] = float(squares[unit])
            counts[unit, bed.name] = int(np.isfinite(own[w]).sum())
            residuals[unit] = disks_of(own[w], bed)
    return Scores(sums, counts, residuals, np.array(floor).reshape(-1, len(sums)))


def _white(noises: Sequence[Noise], rows: Sequence[np.ndarray], windows: Windows, replicate: int) -> np.ndarray:
    """(n,) innovations (W, D) [m] of each bed, whitened by what the replicates but one tell."""
    every = [noise.by_others() for noise in noises]
    parts = [m[replicate % len(m)].whiten(own, w).ravel() for m, own, w in zip(every, rows, windows, strict=True)]
    return np.concatenate(parts)


def fitted_by_others(columns: np.ndarray, white: np.ndarray, sizes: Sequence[int]) -> np.ndarray:
    """(windows,) how the squares of each window change where numbers are fitted to r, to each from all other windows.

    columns : (n, p);  white : (n,) r;  sizes : how many of the n rows each window has
    """
    if len(sizes) < 2 or not columns.shape[1]:
        return np.zeros(len(sizes))
    rest = white - columns @ np.linalg.lstsq(columns, white, rcond=1e-10)[0]
    at = np.cumsum(sizes)[:-1]
    change = [float(b @ b - a @ a) for a, b in zip(np.split(white, at), np.split(rest, at), strict=True)]
    return np.array(change) + by_others(columns, rest, sizes)


def by_others(columns: np.ndarray, white: np.ndarray, sizes: Sequence[int]) -> np.ndarray:
    """(windows,) how much larger the squares of each window are where its numbers come from all other windows.

    To first order: |r_w - C_w (d_w - d)|^2 - |r_w|^2, d the step of least squares from all of r, d_w from all but r_w.
    columns : (n, p) C;  white : (n,) r;  sizes : how many of the n rows each window has
    """
    if len(sizes) < 2 or not columns.shape[1]:
        return np.zeros(len(sizes))
    parts = np.split(np.arange(len(white)), np.cumsum(sizes)[:-1])
    square, product = columns.T @ columns, columns.T @ white
    whole = np.linalg.lstsq(columns, white, rcond=1e-10)[0]
    further = []
    for part in parts:
        c, r = columns[part], white[part]
        rest = np.linalg.pinv(square - c.T @ c, rcond=1e-12, hermitian=True) @ (product - c.T @ r)
        away = c @ (rest - whole)
        further.append(float(away @ away - 2 * r @ away))
    return np.array(further)


def sizes_of(likelihood: WindowLikelihood, windows: Windows) -> list[int]:
    """How many numbers each window has, in the order of ``WindowLikelihood.white``."""
    return [bed.size for bed, chosen in zip(likelihood.beds, windows, strict=True) for _ in chosen]


def variation(likelihood: WindowLikelihood, rows: Prediction, base: Prediction, windows: Windows) -> float:
    """Spread of S between replicates with what the laws change added: films of the same mismatch, other noise."""
    change = [after.mean(axis=1) - before.mean(axis=1) for after, before in zip(rows, base, strict=True)]
    count = sum(int(np.isfinite(c[w]).sum()) for c, w in zip(change, windows, strict=True))
    sums = []
    for k in range(min(len(noise.residuals) for noise in likelihood.noises)):
        films = [noise.residuals[k] + c for noise, c in zip(likelihood.noises, change, strict=True)]
        sums.append(squares_of(likelihood.noises, films, windows, k).sum())
    return float(np.std(sums)) / max(count, 1)


def share_of(after: Scores, before: Scores, rng: np.random.Generator, varies: float = 0.0) -> Explained:
    """See ``explained``; few replicates know their spread badly: Student's t for the normal, and of their mean."""
    number = max(len(before.floor), 2)
    wider = student(number - 1) * math.sqrt(1 + 1 / number)
    return explained(after, before, rng, beyond=current().verdict.beyond * wider, few=True, varies=varies)


def before_of(search: Search) -> Scores:
    """S of the recalibrated scene."""
    return scores_of(search.likelihood, search.likelihood, search.base, search.used, search.nuisance)


def explained_by(search: Search, answer: Answer, before: Scores, rng: np.random.Generator) -> Explained | None:
    """What the laws of an answer explain on training windows; None where these were not simulated with them."""
    likelihood, judge, rows = search.likelihood, answer.judge, answer.rows
    if rows is None:
        rows = judge.predict([(answer.hypothesis, answer.values)], search.used)[0]
    if rows is None:
        return None
    varies = variation(likelihood, rows, search.base, search.used)
    return share_of(scores_of(likelihood, judge, rows, search.used, answer.columns), before, rng, varies)


def explained_by_trial(search: Search, trial: BedTrial, before: Scores, rng: np.random.Generator) -> Explained | None:
    """What a trial explains in place of the answer.

    Where its columns are those of fewer windows, very much was left, beside which what its few numbers owe to the
    window itself is nothing.
    """
    likelihood, used = search.likelihood, search.used
    rows = likelihood.predict([beside(search, trial)], used)[0]
    if rows is None:
        return None
    columns = None
    if len(trial.signature.columns) == len(search.nuisance):
        columns = np.hstack([search.nuisance, trial.signature.columns])
    return share_of(scores_of(likelihood, likelihood, rows, used, columns), before, rng)


def beside(search: Search, trial: BedTrial) -> tuple[Hypothesis, np.ndarray]:
    """The recalibrated scene with a trial, the adjustables moved, to first order, to where they then belong."""
    values = search.values
    columns = trial.signature.columns
    known = {len(search.few_nuisance): search.at, len(search.nuisance): np.arange(len(search.nuisance))}
    if len(values) and len(columns) in known:
        rows = known[len(columns)]
        left = search.white[rows] - columns @ trial.amounts
        low, high = search.hypothesis.bounds
        change = np.linalg.lstsq(search.nuisance[rows], left, rcond=1e-10)[0]
        reach = current().windows.polish.reach * (high - low)
        values = np.clip(values + np.clip(change, -reach, reach), low, high)
    return search.hypothesis.with_term(trial.term), np.concatenate([values, trial.values])


def weighed(
    search: Search, answer: Answer, form: BedTrial | None, trials: Sequence[BedTrial], before: Scores,
    rng: np.random.Generator,
) -> tuple[Explained | None, list[tuple[BedTrial, Explained]]]:  # fmt: skip
    """What the answer explains, None where it could not be run, and what forces without a name do in its place.

    form : forces without a name that was tried;  trials : all that was, among them forces without a name
    before : of the recalibrated scene
    """
    criteria = current().windows.search
    if answer.found is None:
        return None, []
    named = explained_by(search, answer, before, rng)
    others = [t for t in trials if nameless(t.mechanism) and t.gain is not None and t is not form][: criteria.forms]
    forms: list[tuple[BedTrial, Explained]] = []
    for t in ([] if form is None else [form]) + others:
        mine = t.label == answer.found.label
        share = named if mine else explained_by_trial(search, t, before, rng)
        if share is not None and not (forms and search.clock.late(current().windows.budget.beside)):
            forms.append((t, share))
    return named, forms


def explained_by_scale(
    search: Search, judge: WindowLikelihood, predicted: Mapping[str, Prediction], rng: np.random.Generator
) -> Explained | None:
    """What is explained where the picture's scale is among what was found."""
    if "recalibrated" not in predicted or "revised" not in predicted:
        return None
    likelihood, used = search.likelihood, search.used
    before = scores_of(likelihood, likelihood, predicted["recalibrated"], used)
    return share_of(scores_of(likelihood, judge, predicted["revised"], used), before, rng)


# ---- what is left ----------------------------------------------------------------------------


def like_replicates(
    likelihood: WindowLikelihood, judge: WindowLikelihood, rows: Prediction, windows: Windows, excess: float
) -> bool:
    """Whether what a scene leaves passes for what it leaves of its replicates, or is less than matters.

    excess : standard deviations of the nulls' chi2, see ``NoiseChi2``
    """
    scores = scores_of(likelihood, judge, rows, windows)
    if excess <= current().windows.search.unexplained or scores.mean <= float(scores.floors.max()):
        return True
    matters = [bed.recording.tolerance for bed in likelihood.beds if bed.training.any()]
    rms, floor = errors(judge, rows, windows).rms, noise_floor(judge, windows)
    if rms is None or not matters or any(m is None for m in matters):
        return False
    return math.sqrt(max(rms**2 - floor**2, 0.0)) <= min(m for m in matters if m is not None)


def looks_like(search: Search, answer: Answer, rows: Prediction, trials: Sequence[BedTrial], level: float) -> str:
    """The law, or force without a name, that gains most in what is left, to first order; in plain words.

    level : how far one is ahead by chance
    """
    columns = search.nuisance if answer.columns is None else answer.columns
    nuisance = columns[search.at]
    left = off(nuisance, answer.judge.white(rows, search.used)[search.at])
    taken = {t.mechanism for t in answer.laws} - {UNKNOWN} | {t.term.label for t in answer.laws}
    best: BedTrial | None = None
    for t in trials:
        s = t.signature
        if t.mechanism in taken or t.term.label in taken or len(s.columns) != len(left):
            continue
        mine = make_signature(s.term, s.tried, s.columns, nuisance, s.other, s.windows)
        rest = first_order(mine, left, t.spread)
        if best is None or rest.ahead > best.ahead:
            best = rest
    if best is None or best.ahead <= level:
        return NOTHING
    return best.term.label if nameless(best.mechanism) else plainly(best.mechanism)


def remains_in(
    likelihood: WindowLikelihood, judge: WindowLikelihood, rows: Prediction, windows: Windows, looks: str
) -> Remains | None:
    """What is left of training windows: rms of the disks [m], sqrt(S/S_floor), which disks, the window with most."""
    rms = errors(judge, rows, windows).rms
    scores = scores_of(likelihood, judge, rows, windows)
    if rms is None:
        return None
    size: dict[str, float] = {}
    for found, chosen in zip(maps(judge, rows), windows, strict=True):
        if len(chosen):
            more = found.disks[chosen].mean(axis=0) - found.replicate_disks[:, chosen].mean(axis=(0, 1))
            for row, excess in zip(found.bed.rows, more, strict=True):
                body = found.bed.scene.bodies[int(row)].id
                size[body] = max(size.get(body, -math.inf), float(excess))
    worst = max(size.values())
    bodies = tuple(b for b, excess in size.items() if excess > current().verdict.bodies * worst) or tuple(size)
    floor = scores.floor.mean(axis=0)
    most = int(np.argmax(np.array(list(scores.sums.values())) / np.maximum(floor, 1e-12)))
    places = [(bed, int(w)) for bed, chosen in zip(likelihood.beds, windows, strict=True) for w in chosen]
    bed, window = places[most]
    t = bed.film.t[int(bed.starts[window]) + bed.looks[[0, -1]]]
    times = math.sqrt(scores.mean / max(float(floor.sum()) / max(sum(scores.counts.values()), 1), 1e-12))
    return Remains(rms, times, bodies, (float(t[0]), float(t[1])), None, looks)


# ---- held-out windows ------------------------------------------------------------------------


def by_window(likelihood: WindowLikelihood, white: np.ndarray, windows: Windows) -> list[np.ndarray]:
    """Squares of whitened numbers (n,), cut into windows."""
    return np.split(white**2, np.cumsum(sizes_of(likelihood, windows))[:-1])


def held_verdict(
    likelihood: WindowLikelihood, before: np.ndarray, after: np.ndarray, rng: np.random.Generator
) -> str | None:
    """Whether held-out windows are predicted better, see ``paired``; None where there are none.

    before, after : (n,) whitened innovations of the held-out windows
    """
    if not len(before):
        return None
    return paired(by_window(likelihood, before, likelihood.held), by_window(likelihood, after, likelihood.held), rng)


def rival_gains(search: Search, base: Prediction | None, rivals: Sequence[BedTrial]) -> Mapping[str, float]:
    """By label, half the fall of chi2 of held-out windows, recalibrated less rival; of those that could be run."""
    likelihood = search.likelihood
    if base is None or not rivals or not any(len(w) for w in likelihood.held):
        return {}
    shown = likelihood.predict([beside(search, t) for t in rivals], likelihood.held)
    before = float(np.sum(likelihood.white(base, likelihood.held) ** 2))
    return {
        t.term.label: 0.5 * (before - float(np.sum(likelihood.white(rows, likelihood.held) ** 2)))
        for t, rows in zip(rivals, shown, strict=True)
        if rows is not None
    }
