"""How well a fitted hypothesis predicts blocks of training data that its numbers and starts did not see."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from ...laws import all_laws
from ..criteria import BlockCriteria, current
from ..data import Case
from ..explained import Scores
from ..hypothesis import Failed, Predictor
from ..linear import project
from ..noise import LikelyNoise, Noise
from .fit import Fitter
from .fitted import Fit, spin_at
from .segments import find_impacts, make_segments


@dataclass(frozen=True)
class Block:
    """Frames of one training recording: those that its start is fitted on, and those that are then predicted.

    start, rest : (T,) masks of frames;  whole : the block is a whole recording
    """

    case: Case
    start: np.ndarray
    rest: np.ndarray
    whole: bool

    @property
    def frames(self) -> np.ndarray:
        return self.start | self.rest


def make_blocks(cases: Sequence[Case], criteria: BlockCriteria | None = None) -> list[Block]:
    """Whole recordings where there are three or more for training, otherwise pieces of the training parts."""
    criteria = criteria or current().blocks
    training = [c for c in cases if not c.held_out and c.training.any()]
    blocks = []
    whole = len(training) >= criteria.recordings
    pieces = 1 if whole else math.ceil(criteria.pieces / max(len(training), 1))
    share = criteria.whole_start if whole else criteria.start
    for case in training:
        through = [] if whole else _through_impacts(case, criteria)
        if through:
            blocks += through
            continue
        rows = np.flatnonzero(case.training)
        # what nothing in the scene explains is asked of no law
        stretches = np.split(rows, np.searchsorted(rows, sorted(kick.row for kick in case.kicks)))
        for stretch in stretches[:1] if whole else stretches:
            mine = math.ceil(pieces * len(stretch) / len(rows))
            for start, rest in cut(case.t, stretch, mine, share, criteria) if mine else ():
                blocks.append(Block(case, start, rest, whole))
    return blocks


def cut(
    t: np.ndarray, rows: np.ndarray, pieces: int, share: float, criteria: BlockCriteria | None = None
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Pieces of frames ``rows`` of times t (T,): masks (T,) of those a start is fitted on, and of the rest.

    share : of a piece's time that its start is fitted on, at least ``criteria.start_frames`` frames
    """
    criteria = criteria or current().blocks
    result = []
    for part in np.array_split(rows, max(1, min(pieces, len(rows) // criteria.frames))):
        begin, end = t[part[0]], t[part[-1]]
        first = max(int(np.searchsorted(t[part], begin + share * (end - begin))), criteria.start_frames)
        start, rest = np.zeros(len(t), dtype=bool), np.zeros(len(t), dtype=bool)
        start[part[:first]] = True
        rest[part[first:]] = True
        if rest.any():
            result.append((start, rest))
    return result


def _through_impacts(case: Case, criteria: BlockCriteria) -> list[Block]:
    """From the flight before an impact through it to the next one; none where nothing met."""
    segments = make_segments(case, case.training)
    hits = np.array([i.row for i in find_impacts(case)] or [len(case.t)])
    blocks = []
    for before, after in pairwise(segments):
        first = np.flatnonzero(before.frames)[0]
        if any(first < kick.row <= np.flatnonzero(after.frames)[-1] for kick in case.kicks):
            continue
        hit = hits[hits > first].min(initial=len(case.t))
        start = before.frames & (np.arange(len(case.t)) < hit)
        if start.sum() >= criteria.start_frames // 2:
            blocks.append(Block(case, start, after.frames, False))
    return blocks


def without(fit: Fit, block: Block) -> np.ndarray:
    """Values (p,) of a fit from all data but a block, by one Gauss-Newton step from the fit to all.

    delta = (J'J)^-1 J'r over the other numbers, the starts projected out of both. What only this block tells of a law
    stays. Numbers of a force without a name in place or in time have a Gaussian prior about zero, as wide as the mean
    square of its numbers (ridge regression, Hoerl & Kennard 1970): where only the block tells it, it could follow
    anything there. One by the speed has the same few numbers everywhere, as a law has. Shapes (an exponent, a range)
    stay as all data tell them, too: along the tangent of the bent valley in which strength and shape lie a repulsion
    became an attraction. Masses and radii that are believed stay: they are nuisances of every scene, and with those
    that were believed all would miss the impacts of the block alike.
    """
    if not len(fit.hypothesis.free):
        return fit.values
    low, high = fit.hypothesis.bounds
    here = np.clip(fit.values, low, high)
    information, gradient, told = _told(fit, block, here)
    told &= [not free.inner for free in fit.hypothesis.free]
    if not told.any():
        return fit.values
    size = np.sqrt(np.diag(information))[told]
    scaled = information[np.ix_(told, told)] / np.outer(size, size)
    room = (low - here)[told] * size, (high - here)[told] * size
    moved = here.copy()
    moved[told] += _step(scaled, gradient[told] / size, *room) / size
    return np.clip(moved, low, high)


def _told(fit: Fit, block: Block, here: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Information (p, p) and gradient (p,) at the values ``here``, and which numbers (p,) all data but a block tell."""
    prior = _of_fields(fit)
    information, gradient, all_told = np.diag(prior), -prior * here, prior.copy()
    for name, (by_value, by_start) in fit.jacobian.items():
        keep = _outside(fit, name, block) if name == block.case.name else np.ones(len(by_value), dtype=bool)
        whole = by_value - project(by_start, by_value)
        all_told += np.sum(whole**2, axis=0)
        values = by_value[keep]
        if not len(values):
            continue
        values = values - project(by_start[keep], values)
        information += values.T @ values
        gradient += values.T @ fit.used(name)[keep]
    least = current().blocks.told * np.maximum(all_told, current().rounding.nothing)
    told = (np.diag(information) > least) | (prior > 0)
    told[fit.hypothesis.believed] = False
    return information, gradient, told


def outside(fit: Fit, block: Block, cases: Sequence[Case], predictor: Predictor) -> np.ndarray:
    """Values (p,) of a fit from all data but a block: by one Gauss-Newton step, or by a fit of its own.

    Of a law that has a shape (an exponent, a range) strength and shape lie along a bent valley: one step along its
    tangent leaves it. Such a law is fitted to what is left, where recordings are followed in one. What only the block
    tells of it stays, as there.

    cases : those that were fitted
    """
    shaped = any(f.inner for f in fit.hypothesis.free)
    if not shaped or any(len(segments) > 1 for segments in fit.segments.values()):
        return without(fit, block)
    frames = {c.name: c.training & ~block.frames if c.name == block.case.name else c.training for c in cases}
    if not any(part.any() for part in frames.values()):
        return without(fit, block)
    _, _, told = _told(fit, block, fit.values)
    if not told.any():
        return fit.values
    rest = Fitter(cases, predictor, frames, whole=True)
    evaluations, held = current().blocks.evaluations, tuple(int(k) for k in np.flatnonzero(~told))
    try:
        # where the first block is left out, what is left begins later
        starts = {case.name: rest.begun(fit, case) for case in rest.cases}
    except Failed:
        return without(fit, block)
    return rest.fit(fit.hypothesis, fit.values, starts, evaluations=evaluations, held=held).values


def _step(information: np.ndarray, gradient: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The step d (p,) with the least d'Id/2 - g'd within its bounds.

    Where one number stops at its bound the others go where they do best with it there: cut off afterwards, they would
    still make up for a step that it did not take.
    """
    size, axes = np.linalg.eigh(information)
    kept = size > current().rounding.direction * size.max()
    root = np.sqrt(size[kept])
    matrix, wanted = root[:, None] * axes[:, kept].T, (axes[:, kept].T @ gradient) / root
    step = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    if ((step >= low) & (step <= high)).all():
        return np.asarray(step)
    # an interval of no width is none to the solver
    wide = np.maximum(high, low + 1e-12)
    return np.asarray(lsq_linear(matrix, wanted, (low, wide)).x)


def _of_fields(fit: Fit) -> np.ndarray:
    """(p,) information of the prior on numbers of fields in place or time without a name, zero for all others."""
    laws, rows, result = all_laws(), 0, np.zeros(len(fit.values))
    for term in fit.hypothesis.terms:
        own = range(rows, rows + len(term.free))
        rows += len(term.free)
        law = laws.get(term.mechanism)
        field = law is not None and law.candidate == "flexible" and {"t", "x", "y"} & set(law.arguments)
        if field and not any(free.inner for free in term.free):
            result[own] = 1.0 / max(float(np.mean(fit.values[own] ** 2)), 1e-100)
    return result


def _outside(fit: Fit, name: str, block: Block) -> np.ndarray:
    """Rows of a recording in ``Fit.used`` that do not lie in a block, nor join segments that do."""
    frame_of = np.nonzero(np.isfinite(fit.innovations[name]))[0]
    inside = [bool((s.frames & block.frames).any()) for s in fit.segments[name]]
    ties = [
        np.full(len(s.tie), not (inside[k] or inside[k - 1])) for k, s in enumerate(fit.segments[name]) if k
    ]  # fmt: skip
    outside = np.concatenate([~block.frames[frame_of], *ties])
    return np.concatenate([outside, np.ones(len(fit.used(name)) - len(outside), dtype=bool)])  # priors


def score(
    fit: Fit,
    blocks: Sequence[Block],
    predictor: Predictor,
    noise: Noise | LikelyNoise,
    rng: np.random.Generator,
    criteria: BlockCriteria | None = None,
) -> Scores:
    """Predict each block from a start fitted on its first frames, with numbers found without it.

    The expected covariance is that of white noise and of the start that comes of it: 1 + J_2 (J_1'J_1)^-1 J_2', J the
    derivatives by the start on its frames and on the rest. A block that cannot be run counts as ``failed``; bodies that
    are not followed for so long from a start as well as it is known are not scored there.
    """
    criteria = criteria or current().blocks
    sums: dict[tuple[Any, ...], float] = {}
    counts: dict[tuple[Any, ...], int] = {}
    residuals: dict[int, np.ndarray] = {}
    floor: list[np.ndarray] = []
    failed: list[str] = []
    cases = list({block.case.name: block.case for block in blocks}.values())
    for b, block in enumerate(blocks):
        try:
            values = outside(fit, block, cases, predictor)
            left, raw, whiten, answer, bent = _predicted(fit, values, block, predictor, criteria, rng.spawn(1)[0])
        except Failed as error:
            failed.append(f"{block.case.name}: {error}")
            continue
        seen = np.isfinite(left)
        white = whiten(left[seen])
        body_of = np.array([channel.body for channel in block.case.channels])[np.nonzero(seen)[1]]
        stretch_of = _stretches(len(left), len(blocks), criteria)[np.nonzero(seen)[0]]
        draws = whiten(answer(_drawn(block, Noise() if block.case.noise.size else noise, rng, criteria.draws)))
        told = len(floor)
        for body in dict.fromkeys(body_of.tolist()):
            for k in range(stretch_of.max(initial=-1) + 1):
                mine = (body_of == body) & (stretch_of == k)
                if mine.any() and np.mean(bent[mine]) <= criteria.bent:
                    sums[b, body, k] = float(np.sum(white[mine] ** 2))
                    counts[b, body, k] = int(mine.sum())
                    floor.append(np.sum(draws[mine] ** 2, axis=0))
        if len(floor) == told:
            failed.append(f"{block.case.name}: no body is followed from a start as well as it is known")
            continue
        residuals[b] = np.where(block.case.in_unit, raw * block.case.sigma, np.nan)
    return Scores(sums, counts, residuals, np.array(floor).T.reshape(criteria.draws, len(floor)), tuple(failed))


def _stretches(frames: int, blocks: int, criteria: BlockCriteria) -> np.ndarray:
    """(frames,) into which stretch of a block's predicted frames each falls: what is resampled, so there are several.

    Whitened residuals are independent of one another where a hypothesis is right.
    """
    count = max(1, min(math.ceil(criteria.units / blocks), frames // criteria.unit_frames))
    return np.arange(frames) * count // max(frames, 1)


def _drawn(
    block: Block, noise: Noise | LikelyNoise, rng: np.random.Generator, draws: int
) -> tuple[np.ndarray, np.ndarray]:
    """Noise on the frames of the start and on the rest, where something was seen: (n_1, draws), (n_2, draws)."""
    frames = np.flatnonzero(block.frames)
    drawn = noise.draw((len(frames), len(block.case.channels), draws), rng)
    seen = np.isfinite(block.case.values)
    first, rest = block.start[frames], block.rest[frames]
    return drawn[first][seen[block.start]], drawn[rest][seen[block.rest]]


def _predicted(
    fit: Fit, values: np.ndarray, block: Block, predictor: Predictor, criteria: BlockCriteria, rng: np.random.Generator
):
    """Residuals (T_rest, c) in standard deviations, what whitens them, and what noise makes of them. Raises Failed.

    values : (p,) of the fit, found without the block
    Of the residuals first without the memory of the noise (``Case.white``), then with it. Last, mean squares (n,) of
    what is bent: of starts as far off as they are known, the part of the prediction that is not in proportion. Where it
    is no less than the noise, as where disks touch each other or not, the spread that is expected means nothing, and
    what is left says nothing of a law.
    """
    case = block.case
    spin = {case.name: spin_at(predictor, fit, case, float(case.t[block.start][0]))}
    fitter = Fitter([case], predictor, {case.name: block.start}, whole=True, spin=spin)
    found = fitter.started(fit, values, criteria.evaluations)
    numbers = found.starts[case.name]
    here, _ = fitter.innovations(case, fit.hypothesis, values, numbers, block.frames)
    _, columns = fitter.derivatives(case, fit.hypothesis, values, numbers, block.frames, True, here)
    frames = np.flatnonzero(block.frames)
    first, rest = block.start[frames], block.rest[frames]
    seen = np.isfinite(case.values[block.frames])
    if not np.isfinite(here[seen]).all() or np.abs(here[seen]).max(initial=0.0) >= current().fits.hopeless:
        raise Failed("a block could not be predicted")
    by_start = np.stack(columns, axis=-1) if columns else np.zeros((*here.shape, 0))
    j1, j2 = by_start[first][seen[first]], by_start[rest][seen[rest]]
    u, s, vt = np.linalg.svd(j1, full_matrices=False)
    kept = s > current().rounding.column * s.max(initial=0.0)
    inverse = (vt[kept].T / s[kept]) @ u[:, kept].T  # pseudo-inverse of J_1
    errors = vt[kept].T / s[kept]
    left, size, axes = np.linalg.svd(j2 @ errors, full_matrices=False)
    shrink = 1.0 - 1.0 / np.sqrt(1.0 + size**2)

    def whiten(vectors: np.ndarray) -> np.ndarray:
        along = left.T @ vectors
        return np.asarray(vectors - left @ (shrink[:, None] * along if vectors.ndim > 1 else shrink * along))

    def answer(noise: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        return noise[1] - j2 @ (inverse @ noise[0])

    def bend(off: np.ndarray) -> np.ndarray:
        run = fitter.innovations(case, fit.hypothesis, values, numbers + off, block.frames)[0]
        return whiten((run - here)[rest][seen[rest]] + j2 @ off) ** 2

    bent = np.zeros(int(seen[rest].sum()))
    if size.max(initial=0) > 1:
        along = [errors @ axes[0], -errors @ axes[0]]
        along += list((errors @ rng.normal(size=(errors.shape[1], criteria.starts))).T)
        with np.errstate(over="ignore", invalid="ignore"):
            bent = np.mean(fitter.spread(bend, along), axis=0)
        bent = np.where(np.isfinite(bent), bent, np.inf)
    # what hangs on a start that no frame tells, as of a body that came later, says nothing either
    untold = j2 - (j2 @ vt[kept].T) @ vt[kept]
    bent[np.sum(untold**2, axis=1) > current().blocks.told * np.sum(j2**2, axis=1)] = np.inf
    raw = case.raw(here, block.frames)
    masked = (np.where(seen[rest], part[rest], np.nan) for part in (here, raw))
    return *masked, whiten, answer, bent
