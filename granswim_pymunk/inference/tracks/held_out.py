"""Held-out errors: naive, recalibrated, revised, and the floor that perfect knowledge of the physics leaves."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from ...scene import Scene
from ..criteria import current
from ..data import Case
from ..hypothesis import Failed, Hypothesis, Predictor, Term
from ..judge import Remains, paired
from ..linear import errors_of
from ..mechanisms import NOTHING
from ..noise import Noise, drawn_noises
from .blocks import cut
from .fit import Fitter, side_by_side
from .fitted import Fit
from .innovations import seen_by, tells_noise, white_sizes
from .kicks import shown_later
from .segments import find_impacts, follower, is_followed, make_segments


@dataclass(frozen=True)
class Errors:
    """Root mean square of seen minus predicted [m or rad], and by recording.

    Over positions where a recording has any, in m: a rad is no m, and angles beside them count in ``scored`` alone,
    each over its own noise.
    ``whole``: where starts were fitted to whole held-out recordings, reported beside it.
    ``values``: for a held-out recording with numbers of its own, all numbers (p,) as it was scored with.
    """

    rms: float | None
    by_case: Mapping[str, float]
    whole: float | None = None
    whole_by_case: Mapping[str, float] | None = None
    predicted: Mapping[str, np.ndarray] | None = None
    values: Mapping[str, np.ndarray] | None = None
    # (T, c) of each recording in standard deviations of the noise, NaN where not scored
    scored: Mapping[str, np.ndarray] | None = None
    window: float | None = None  # s, of the windows that were scored, None for whole runs

    @property
    def chi2(self) -> float:
        """Sum of squares in units of the noise."""
        return float(sum(np.nansum(e**2) for e in (self.scored or {}).values()))


def paired_verdict(before: Errors, after: Errors, rng: np.random.Generator) -> str:
    """Whether held-out data are predicted better: by a bootstrap of blocks of frames, see ``paired``."""
    blocks: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    for name, first in (before.scored or {}).items():
        second = (after.scored or {}).get(name)
        if second is None:
            continue
        for c in range(first.shape[1]):
            rows = np.flatnonzero(np.isfinite(first[:, c]) & np.isfinite(second[:, c]))
            for part in np.array_split(rows, current().blocks.held_out):
                if len(part):
                    blocks[0].append(first[part, c] ** 2)
                    blocks[1].append(second[part, c] ** 2)
    return paired(*blocks, rng)


def largest_when(scaled: Mapping[str, np.ndarray], cases: Sequence[Case]) -> tuple[float, float] | None:
    """First and last time [s] of the piece of a recording in which errors are largest, None where there are none.

    scaled : errors (T, c) of each recording in standard deviations of the noise, NaN where there is none
    """
    worst, when = 0.0, None
    for case in cases:
        mine = scaled.get(case.name)
        if mine is None:
            continue
        for rows in np.array_split(np.flatnonzero(np.isfinite(mine).any(axis=1)), current().blocks.held_out):
            size = float(np.nanmean(mine[rows] ** 2)) if len(rows) else 0.0
            if size > worst:
                worst, when = size, (float(case.t[rows[0]]), float(case.t[rows[-1]]))
    return when


def left_of_held_out(
    errors: Errors, cases: Sequence[Case], floor: float | None, nameless: bool = False
) -> Remains:
    """What held-out data show beyond noise where the training part shows nothing: of whom, and when most.

    floor : [m or rad, rms] of the held-out errors;  nameless : a form without a name was told, which follows what
        shaped it and need not hold beyond: that is no sign of other physics
    """
    sizes: dict[str, list[float]] = {}
    for case in cases:
        scored = (errors.scored or {}).get(case.name)
        if scored is None:
            continue
        for c, channel in enumerate(case.channels):
            if np.isfinite(scored[:, c]).any():
                sizes.setdefault(channel.body, []).append(float(np.nanmean(scored[:, c] ** 2)))
    means = {body: float(np.mean(m)) for body, m in sizes.items()}
    least = 1.0 + current().verdict.bodies * (max(means.values()) - 1.0)  # one: the noise
    bodies = tuple(body for body, mean in means.items() if mean > least) or tuple(means)
    times = errors.rms / floor if errors.rms is not None and floor else None
    later = next(filter(None, map(shown_later, cases)), "")
    looks = f"physics that the training part does not show{': ' if later else ''}{later}"
    looks = NOTHING if nameless and not later else looks
    return Remains(errors.rms, times, bodies, largest_when(errors.scored or {}, cases), None, looks)


def meets_when_scored(case: Case) -> bool:
    """Whether bodies meet in the held-out frames of a recording."""
    return any(case.scored[impact.row] for impact in find_impacts(case))


class _Bound:
    """Applies a term with some of its numbers; the others stay at the values given."""

    def __init__(self, term: Term, kept: Sequence[int], values: np.ndarray) -> None:
        self.term, self.kept, self.values = term, list(kept), np.array(values, dtype=float)

    def __call__(self, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        full = self.values.copy()
        full[self.kept] = values
        return self.term.apply(scene, camera, full)


def own_numbers(hypothesis: Hypothesis, values: np.ndarray, case: Case) -> tuple[Hypothesis, np.ndarray]:
    """The hypothesis in which only the numbers that belong to this recording alone are free, and which those are.

    No training recording says anything of them, so they are found with the start.
    """
    terms, own = [], []
    at = 0
    for term in hypothesis.terms:
        kept = [k for k, f in enumerate(term.free) if f.cases == frozenset([case.name])]
        bears = not term.free or any(f.cases is None or case.name in f.cases for f in term.free)
        if bears:
            free = tuple(term.free[k] for k in kept)
            terms.append(replace(term, free=free, apply=_Bound(term, kept, values[at : at + len(term.free)])))
            own += [at + k for k in kept]
        at += len(term.free)
    return Hypothesis(tuple(terms)), np.array(own, dtype=int)


def training_errors(fit: Fit, cases: Sequence[Case]) -> Errors:
    """Errors on the training part, from the innovations of a fit."""
    return _pool({c.name: fit.innovations[c.name] * c.sigma for c in cases if c.name in fit.innovations}, cases)


def _pool(errors: Mapping[str, np.ndarray], cases: Sequence[Case]) -> Errors:
    by_case = {}
    squares, count = 0.0, 0
    for case in (c for c in cases if c.name in errors):
        array = errors[case.name][:, case.in_unit]
        used = array[np.isfinite(array)]
        if len(used):
            by_case[case.name] = float(np.sqrt(np.mean(used**2)))
            squares += float(used @ used)
            count += len(used)
    return Errors(float(np.sqrt(squares / count)) if count else None, by_case)


def fading(case: Case, frames: np.ndarray, memory: float) -> np.ndarray:
    """Weights (T,) of frames that fade into the past: exp(-(t_last - t)/(memory * span)).

    A start that is to predict what comes counts the latest frames most where the scene is not the whole truth
    (exponential forgetting: Jazwinski 1970, Stochastic Processes and Filtering Theory, ch. 8).
    """
    if not np.isfinite(memory):
        return np.ones(len(case.t))
    t = case.t[frames]
    span = max(float(t[-1] - t[0]), 1e-12)
    return np.exp(-np.maximum(float(t[-1]) - case.t, 0.0) / (memory * span) / 2)


def learn_memory(training: Fit, cases: Sequence[Case], predictor: Predictor, stop: Callable[[], bool]) -> float:
    """The memory that predicts whole training recordings best from their first 20 %."""
    best, least = np.inf, np.inf
    for memory in current().left.memories:
        squares = 0.0
        for case in cases:
            if case.held_out or not case.training.all():
                continue
            first = case.t <= case.t[0] + current().split.start * (case.t[-1] - case.t[0])
            weights = {case.name: fading(case, first, memory)}
            fitter = Fitter([case], predictor, {case.name: first}, stop, weights)
            try:
                fit = fitter.refitted(training, fixed=True, evaluations=current().evaluations.start)
                error = ((case.values - fitter.predict(fit, case, ~first)) / case.sigma)[~first]
            except Failed:
                squares = np.inf
                break
            squares += float(np.nansum(error**2))
        if squares < least:
            best, least = memory, squares
    return best


def held_out_errors(
    training: Fit,
    cases: Sequence[Case],
    predictor: Predictor,
    stop: Callable[[], bool],
    *,
    whole: bool = True,
    memory: float = np.inf,
    followed: Collection[str] = (),
    lost: Mapping[str, int] | None = None,
) -> Errors:
    """Score the held-out frames with the parameters of the training fit.

    A split recording runs on from its training part. A held-out recording gets its start, and the adjustables
    that belong to it alone, from its first 20 % and the rest is scored; ``whole`` also fits the start to all of it.
    ``memory``: see ``fading``;  ``followed``: recordings that are run on although they are cut into segments;
    ``lost``: those that are not, although they are not cut, and how many windows of each are, see ``is_lost``.
    """
    errors: dict[str, np.ndarray] = {}
    sizes: dict[str, np.ndarray] = {}
    window: float | None = None
    everything: dict[str, np.ndarray] = {}
    predicted: dict[str, np.ndarray] = {}
    used: dict[str, np.ndarray] = {}
    for case in cases:
        if not case.scored.any():
            continue
        windows = [] if case.name in followed else _windows(case, lost)
        if windows:
            seen, length = _by_windows(training, case, windows, predictor, stop)
            if seen is None:
                continue
            array = np.where(case.scored[:, None], case.values - seen, np.nan)
            errors[case.name], predicted[case.name], window = array, seen, length
            sizes[case.name] = array / case.sigma
            continue
        runs = [(case.start, errors, case.scored)]
        if case.held_out and whole:
            runs.append((np.ones(len(case.t), dtype=bool), everything, np.ones(len(case.t), dtype=bool)))
        for frames, into, scored in runs:
            forget = {case.name: fading(case, frames, memory)} if case.held_out and into is errors else None
            fitter = Fitter([case], predictor, {case.name: frames}, stop, forget)
            try:
                fit, own = _with_its_start(fitter, training, case)
                seen = fitter.predict(fit, case, scored | frames)
            except Failed:
                continue
            if len(own) and into is errors:
                used[case.name] = training.values.copy()
                used[case.name][own] = fit.values
            array = np.where(scored[:, None], case.values - seen, np.nan)
            into[case.name] = array
            if into is errors:
                predicted[case.name] = seen
                sizes[case.name] = array / case.sigma
    pooled = _pool(errors, cases)
    all_frames = _pool(everything, cases)
    return replace(
        pooled, whole=all_frames.rms, whole_by_case=all_frames.by_case, predicted=predicted, values=used,
        scored=sizes, window=window,
    )  # fmt: skip


def _with_its_start(fitter: Fitter, training: Fit, case: Case) -> tuple[Fit, np.ndarray]:
    """The training fit with the start of a recording, of one that is held out also with the numbers that belong to it
    alone, and which of all those are."""
    if not case.held_out:
        return fitter.refitted(training, fixed=True), np.zeros(0, dtype=int)
    reduced, own = own_numbers(training.hypothesis, training.values, case)
    if len(own):
        return fitter.fit(reduced, training.values[own], None), own
    return fitter.fit(training.hypothesis, training.values, None, fixed=True), own


def carried_on(fit: Fit, case: Case, predictor: Predictor, rng: np.random.Generator) -> float:
    """Mean square, over the noise, of what a fit leaves open where a run goes on into the held-out frames.

    Numbers and starts drawn from their covariance (J'J)^-1 are run on. Below one the run can be followed, as where a
    ball bounces; where disks scatter one another it grows far beyond. Infinite where nothing can be said.
    """
    if case.held_out or not case.scored.any() or case.name not in fit.jacobian:
        return math.inf
    try:
        runs = _drawn_on(fit, case, predictor, rng)
    except Failed:
        return math.inf
    return float(np.nanmean(((runs[1:] - runs[0]) / case.sigma) ** 2))


def is_lost(fit: Fit, case: Case, predictor: Predictor, rng: np.random.Generator) -> bool:
    """Whether what is not known of numbers and starts carries a run as far off as the motion is wide, and farther.

    Two runs of a chaotic scene that have lost each other are apart by twice the variance of its motion, mean square,
    and one is off the mean of all by once that: there a run from one start says nothing of a law, whatever it is, and
    held-out frames are followed in windows with starts of their own. Asked of pieces of them: one is enough, since the
    largest errors are all that counts in a sum of squares. False where what is seen hardly moves, or nothing can be
    said; nor of recordings that are cut at impacts, of which held-out frames are cut into windows anyway.
    """
    if _windows(case):
        return False
    try:
        every, narrow = np.arange(len(case.t)), current().segments.narrow
        if is_followed(case, every, follower(Hypothesis(), np.zeros(0), case, predictor), narrow):
            return False  # the scene is not chaotic: numbers that are not known are no fault of the run
        # a fit that leaves more than noise knows its numbers as well as what it leaves says
        runs = _drawn_on(fit, case, predictor, rng, math.sqrt(max(fit.chi2 / fit.count, 1.0)))
    except (Failed, np.linalg.LinAlgError):
        return False
    wide = np.nanvar(case.values / case.sigma, axis=0)[case.in_unit]
    if wide.sum() < current().signatures.far ** 2 * len(wide):
        return False
    apart = ((runs[1:] - runs[0])[..., case.in_unit] / case.sigma[case.in_unit]) ** 2
    pieces = np.array_split(apart.mean(axis=0), current().blocks.held_out)
    return any(float(np.nanmean(piece)) > float(wide.mean()) for piece in pieces if np.isfinite(piece).any())


def windows_of_lost(fit: Fit, case: Case, predictor: Predictor) -> int:
    """How many windows the held-out frames of a recording that ``is_lost`` are cut into, 0 where nothing can be said.

    As few as have starts that are found: twice as many until each is followed through the frames that its start is
    fitted on as well as that is known before, or is as short as a block may be.
    """
    criteria, frames = current().blocks, int(case.scored.sum())
    count = criteria.windows
    follow = follower(fit.hypothesis, fit.values, case, predictor)
    while 2 * count * criteria.frames <= frames:
        try:
            firsts = [np.flatnonzero(first) for first, _ in _windows(case, {case.name: count})]
            if all(is_followed(case, rows, follow) for rows in firsts):
                return count
        except Failed:
            return 0
        count *= 2
    return count


def _drawn_on(
    fit: Fit, case: Case, predictor: Predictor, rng: np.random.Generator, widened: float = 1.0
) -> np.ndarray:
    """Runs (n, T_scored, c) of the held-out frames, first that of a fit, then those of numbers and starts drawn.

    Drawn from what the frames that they were found from leave open, (J'J)^-1, ``widened`` times as far off. Raises
    Failed, or LinAlgError.
    """
    low, high = fit.hypothesis.bounds
    fitter = Fitter([case], predictor, {case.name: case.start if case.held_out else case.training})
    p = len(fit.values)
    if case.held_out:
        found, own = _with_its_start(fitter, fit, case)
        values = fit.values.copy()
        if len(own):
            values[own] = found.values
        size, axes = np.linalg.eigh(fit.covariance)
        numbers = axes * np.sqrt(np.maximum(size, 0.0))
        numbers[own] = 0.0  # no training recording says anything of them
        errors = block_diag(numbers, errors_of(found.jacobian[case.name][1]))
        fit = replace(fit, values=values, starts=found.starts)
    else:
        fitter.segments = {case.name: fit.segments[case.name]}
        errors = errors_of(np.hstack(fit.jacobian[case.name]))
    runs = [fitter.predict(fit, case, case.scored)[case.scored]]
    for _ in range(current().left.starts):
        off = widened * (errors @ rng.normal(size=errors.shape[1]))
        starts = {case.name: fit.starts[case.name] + off[p:]}
        drawn = replace(fit, values=np.clip(fit.values + off[:p], low, high), starts=starts)
        runs.append(fitter.predict(drawn, case, case.scored)[case.scored])
    return np.array(runs)


def worse_by_chance(
    training: Fit, case: Case, apart: np.ndarray, predictor: Predictor, rng: np.random.Generator,
    lost: Mapping[str, int] | None = None,
) -> float:  # fmt: skip
    """By how much the right law may do worse than none in windows of held-out frames, in chi2, in one of twenty films.

    With an error d of its prediction, by the starts of the windows and by the numbers of the training fit, and with
    noise n, it is off by d + n and the scene without it by d + n - D: chi2 rises by 2 D'(d + n) - D'D, of a spread of
    2 sqrt(<(D'd)^2> + D'D). All frames after an impact that a start may miss are off together. d is drawn.

    apart : D (T, c), what the scene without the law predicts less what it does with it, over the noise; NaN elsewhere
    Infinite where nothing can be said.
    """
    low, high = training.hypothesis.bounds
    apart = np.nan_to_num(apart)
    along = np.zeros(current().blocks.draws)
    drawn = rng.multivariate_normal(training.values, training.covariance, size=len(along))
    try:
        for first, rest in _windows(case, lost):
            fitter = Fitter([case], predictor, {case.name: first})
            fit = fitter.started(training, training.values, current().evaluations.start)
            here = fitter.predict(fit, case, rest)[rest]
            spread = np.linalg.pinv(fit.jacobian[case.name][1].T @ fit.jacobian[case.name][1])
            for k, values in enumerate(np.clip(drawn, low, high)):
                starts = {case.name: rng.multivariate_normal(fit.starts[case.name], spread)}
                there = fitter.predict(replace(fit, values=values, starts=starts), case, rest)[rest]
                along[k] += float(np.nansum((there - here) / case.sigma * apart[rest]))
    except (Failed, np.linalg.LinAlgError):
        return math.inf
    size = float(np.sum(apart**2))
    return 2 * math.sqrt(current().left.within * (float(np.mean(along**2)) + size)) - size


def _windows(case: Case, lost: Mapping[str, int] | None = None) -> list[tuple[np.ndarray, np.ndarray]]:
    """Windows of held-out frames with starts of their own, (frames of the start, the rest), where a run would part.

    None where the recording can be followed from one start: then the run goes on.
    lost : those that cannot, though they are not cut, and into how many windows each is then
    """
    criteria, lost = current().blocks, lost or {}
    if case.name not in lost and len(make_segments(case, np.ones(len(case.t), dtype=bool))) == 1:
        return []
    return cut(case.t, np.flatnonzero(case.scored), lost.get(case.name, criteria.windows), criteria.start)


def _by_windows(
    training: Fit, case: Case, windows: Sequence[tuple[np.ndarray, np.ndarray]], predictor: Predictor,
    stop: Callable[[], bool],
) -> tuple[np.ndarray | None, float]:  # fmt: skip
    """What is predicted (T, c) of the windows after their starts, NaN elsewhere, and how long they are [s]."""
    out = np.full(case.values.shape, np.nan)
    lengths = []
    for first, rest in windows:
        fitter = Fitter([case], predictor, {case.name: first}, stop)
        try:
            fit = fitter.started(training, training.values, current().evaluations.start)
            seen = fitter.predict(fit, case, rest)
        except Failed:
            continue
        out[rest] = seen[rest]
        lengths.append(float(np.ptp(case.t[rest])))
    return (out, float(np.mean(lengths))) if lengths else (None, 0.0)


def window_errors(
    hypothesis: Hypothesis, values: np.ndarray, case: Case, rows: np.ndarray, length: float, predictor: Predictor,
    share: float = 1.0,
) -> np.ndarray:  # fmt: skip
    """Errors (windows,) [m or rad, rms] over windows of ``rows`` of a recording, NaN where one cannot be run.

    length : [s] of a window;  share : of its frames that its start is fitted on; the others are predicted, or all of
    them where the start was fitted on all
    """
    t = case.t[rows]
    count = max(int(np.floor((t[-1] - t[0]) / length + 1e-6)), 1)
    same = current().rounding.time
    found = []
    for k in range(count):
        begin = t[0] + k * length
        mine = rows[(t >= begin - same) & (t < begin + length - same)]
        first, rest = np.zeros(len(case.t), dtype=bool), np.zeros(len(case.t), dtype=bool)
        cut_at = max(math.ceil(share * len(mine)), current().blocks.start_frames)
        first[mine[:cut_at]] = True
        rest[mine[cut_at:] if cut_at < len(mine) else mine] = True
        fitter = Fitter([case], predictor, {case.name: first}, whole=True)
        try:
            how = current().evaluations
            fit = fitter.fit(
                hypothesis, values, None, fixed=True, stages=how.block_stages, evaluations=how.block
            )  # fmt: skip
            left = (case.values - fitter.predict(fit, case, first | rest))[np.ix_(rest, case.in_unit)]
        except Failed:
            found.append(np.nan)
            continue
        found.append(float(np.sqrt(np.nanmean(left**2))))
    return np.array(found)


def noise_floor(
    training: Fit, cases: Sequence[Case], predictor: Predictor, stop: Callable[[], bool], rng: np.random.Generator,
    repeats: int = 3, followed: Collection[str] = (), lost: Mapping[str, int] | None = None,
) -> tuple[float | None, float | None]:  # fmt: skip
    """Training and held-out error when the physics is known exactly: simulated repeats with fresh noise.

    Of held-out frames in which bodies meet, or that are ``lost``, the error is scored as that of the data is, in
    windows with starts of their own but for recordings that are ``followed``: disks spread neighbouring paths at each
    impact (Sinai 1970), and a run from the training part leaves their distance there, however well all is known. Of
    repeats the median counts, as one that misses an impact is off in all that comes after it (Huber 1981, Robust
    Statistics, ch. 1). Of squares of k numbers it lies two thirds of one below the mean (Wilson & Hilferty 1931), which
    among hundreds is nothing.
    """
    squares = {"train": [0.0, 0], "heldout": [0.0, 0]}
    for case in cases:
        try:
            truth, fit, alone = _as_explained(training, case, predictor, stop)
        except Failed:
            continue
        frames = case.start if case.held_out else case.training
        meets = case.name in (lost or {}) or meets_when_scored(case)
        means, later = list[float](), 0
        # a number found from few frames moves the floor more than noise does
        for _ in range(4 * repeats if alone else repeats):
            replicate = _filmed_again(case, truth, rng)
            inner = Fitter([replicate], predictor, {case.name: frames}, stop)
            try:
                few = current().evaluations.repeat
                found = inner.refitted(fit, fixed=not alone, evaluations=few)
                seen = inner.predict(found, replicate, np.ones(len(case.t), dtype=bool))
            except Failed:
                continue
            ends: np.ndarray | None = seen
            if meets and case.name not in followed and (windows := _windows(replicate, lost)):
                ends, _ = _by_windows(found, replicate, windows, predictor, stop)
            for key, mask, there in (("train", case.training, seen), ("heldout", case.scored, ends)):
                used = np.zeros(0) if there is None else (replicate.values - there)[np.ix_(mask, case.in_unit)]
                used = used[np.isfinite(used)]
                if key == "train" or not meets:
                    squares[key][0] += float(used @ used)
                    squares[key][1] += len(used)
                elif len(used):
                    means.append(float(np.mean(used**2)))
                    later += len(used)
        if later:
            squares["heldout"][0] += later * float(np.median(means))
            squares["heldout"][1] += later
    train, held = (float(np.sqrt(s / n)) if n else None for s, n in squares.values())
    return train, held


def right_law_errors(
    training: Fit, cases: Sequence[Case], predictor: Predictor, stop: Callable[[], bool], rng: np.random.Generator,
    repeats: int | None = None, followed: Collection[str] = (), lost: Mapping[str, int] | None = None,
) -> np.ndarray:  # fmt: skip
    """Held-out errors (repeats,) [m or rad, rms] where the law is right and its numbers are found as these were.

    The noise floor knows the numbers. They come from noisy frames, and held-out ones are later: by then a number
    that is a little off has carried the bodies away. Their noise is as large, and as slow, as the film shows it, and
    known no better than that. Repeats that fail are left out.
    """
    return errors_of_repeats([training], cases, predictor, stop, rng, repeats, followed, lost)[:, 0]


def errors_of_repeats(
    fits: Sequence[Fit], cases: Sequence[Case], predictor: Predictor, stop: Callable[[], bool],
    rng: np.random.Generator, repeats: int | None = None, followed: Collection[str] = (),
    lost: Mapping[str, int] | None = None,
) -> np.ndarray:  # fmt: skip
    """Held-out errors (repeats, fits) [m or rad, rms] of fits to films in which what the first says is true.

    See ``right_law_errors``, which are those of that one.
    """
    training, truths = fits[0], {}
    for case in cases:
        try:
            truths[case.name] = _as_explained(training, case, predictor, stop)[0]
        except Failed:
            continue
    count = current().left.right if repeats is None else repeats
    sizes = white_sizes(training, [c for c in cases if c.name in training.white], rng.spawn(1)[0], count)
    # where a slow part shows, a few hundred frames do not say how slow, and a few dozen not whether there is one
    told = tells_noise(training) or any(c.noise.size > 0 for c in cases)
    noises = drawn_noises(seen_by(training, cases), rng.spawn(1)[0], count) if told else [None] * count
    filmed = [
        [_filmed_again(c, truths[c.name], rng, s, noise) for c in cases if c.name in truths]
        for s, noise in zip(sizes, noises, strict=True)
    ]

    def left(replicates: list[Case], own: Fitter, near: Sequence[Fit] | None) -> tuple[list[float], list[Fit]]:
        again = Fitter(replicates, predictor, None, own.stop)
        errors, found, enough = [], [], current().evaluations.right
        for k, fit in enumerate(fits):
            try:
                fit = again.refitted(fit, evaluations=enough, near=near[k] if near else None)
            except Failed:
                return [], []
            how = replicates, predictor, own.stop
            rms = held_out_errors(fit, *how, whole=False, followed=followed, lost=lost).rms
            if rms is None:
                return [], []
            errors.append(rms)
            found.append(fit)
        return errors, found

    whole = Fitter(cases, predictor, None, stop)
    # through segments derivatives by starts hardly hang on the noise: those of the first repeat will do for the others
    leads = 1 if whole.segmented else 0
    first = [left(replicates, whole, None) for replicates in filmed[:leads]]
    near = first[0][1] if first else None
    found = first + side_by_side(whole, [partial(left, replicates, near=near) for replicates in filmed[leads:]])
    return np.array([errors for errors, _ in found if errors]).reshape(-1, len(fits))


def _as_explained(
    training: Fit, case: Case, predictor: Predictor, stop: Callable[[], bool]
) -> tuple[np.ndarray, Fit, bool]:
    """What a recording (T, c) would be without noise, the fit of its start, and whether numbers of its own are in it.

    What belongs to a held-out recording alone has to be found from its first frames. Raises Failed.
    """
    frames = case.start if case.held_out else case.training
    fitter = Fitter([case], predictor, {case.name: frames}, stop)
    fit, own = _with_its_start(fitter, training, case)
    return fitter.predict(fit, case, np.ones(len(case.t), dtype=bool)), fit, len(own) > 0


def _filmed_again(
    case: Case, truth: np.ndarray, rng: np.random.Generator, size: float = 1.0, noise: Noise | None = None
) -> Case:
    """The recording with noise of its own, or as slow as another, ``size`` times as large, seen where it was."""
    like = case if noise is None else replace(case, noise=noise)
    noisy = truth + size * like.draw(rng)
    noisy[~np.isfinite(case.values)] = np.nan
    return replace(case, values=noisy)
