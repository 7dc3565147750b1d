"""Signatures of the candidates, what each gains to first order, and the same search in nulls."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..criteria import current
from ..significance import rank
from .amounts import amount_label
from .candidates import Candidate
from .response import Model, add, fit, heavy, heavy_weight, stride
from .state import NAIVE, Nulls, Search, Trial, bears_on
from .summaries import Condition


def model_of(s: Search, candidates: Sequence[Candidate]) -> Model | None:
    """The recalibrated model with these candidates added, linear through their first points; None where not run."""
    base = s.base.model
    anchor = {c.name: base.sums(c.name, s.base.u) for c in s.training}
    model = Model(" + ".join(x.label for x in candidates), base.free, s.base.u.copy(), anchor, base.slopes, base.camera)
    for x in candidates:
        points = [amount_label(x, row) for row in x.design]
        if any((p, True) not in s.means.mean[c.name] for p in points for c in s.training if bears_on(x.term, c)):
            return None
        model = extended(s, model, x, model.centre)
    return model


def extended(s: Search, model: Model, x: Candidate, u: np.ndarray) -> Model:
    """A model with one more candidate, absent at its centre; ``u``: the values of the others there.

    Slopes are those of the naive scene: differences of soft runs, so that softness drops out.
    """
    free, slopes, camera = list(model.free), list(model.slopes), list(model.camera)
    if x.apparatus:
        free.append(x.term.free[0])
        slopes.append({})
        camera.append(x.term.free[0].name.removeprefix("camera."))
    else:
        inverse = np.linalg.inv(x.design)
        points = [amount_label(x, row) for row in x.design]
        for k, f in enumerate(x.term.free):
            # du_k: sum over the points of inverse[k, i] (mean_i - naive)
            slopes.append({
                c.name: add(*[
                    (float(inverse[k, i]), {(p, True): 1.0, (NAIVE, True): -1.0}) for i, p in enumerate(points)
                ])
                for c in s.training if bears_on(x.term, c)
            })  # fmt: skip
            free.append(replace(f, scale=float(np.abs(x.design[:, k]).max())))
            camera.append(None)
    centre = np.concatenate([u, x.neutral])
    anchor = {c.name: model.sums(c.name, u) for c in s.training}
    return Model(f"{model.name} + {x.label}", tuple(free), centre, anchor, tuple(slopes), tuple(camera))


@dataclass
class Bank:
    """Whitened signatures around the recalibrated fit."""

    factors: dict[str, np.ndarray]
    tails: tuple[tuple[slice, float], ...]  # rows of each recording, and the tail of its packing, see ``heavy``
    left: np.ndarray
    adjust: np.ndarray  # orthonormal basis of the adjustables
    columns: dict[str, np.ndarray]  # of each candidate, adjustables projected out
    directions: dict[str, np.ndarray]  # orthonormal
    room: dict[str, tuple[float, float]]  # of single numbers: from neutral to their bounds
    surviving: dict[str, float]
    visible: dict[str, float]

    def refitted(self, r: np.ndarray) -> np.ndarray:
        """(n, ...) what adjustables leave of innovations r."""
        return np.asarray(r - self.adjust @ (self.adjust.T @ r))


def bank_of(s: Search, candidates: Sequence[Candidate], fold: int | None = None) -> Bank:
    """``fold``: with the spread by all runs but those of that part, see ``Means.folds``."""
    factors, left, tails, at = {}, [], [], 0
    for c in s.training:
        r, v = s.base.left[c.name]
        tails.append((slice(at, at + len(r)), s.means.nu(c)))
        at += len(r)
        if fold is not None:
            v = c.error + _own_packing(s, c) * s.means.folds[c.name][fold][1]
        factors[c.name] = np.linalg.cholesky(v)
        left.append(np.linalg.solve(factors[c.name], r))
    r = np.concatenate(left)
    adjust = np.zeros((len(r), 0))
    if s.base.model.free:
        adjust = _basis(columns_of(s, s.base.model, s.base.u, factors))
    bank = Bank(factors, tuple(tails), r, adjust, {}, {}, {}, {}, {})
    n = len(s.base.u)
    for x in candidates:
        model = model_of(s, [x])
        if model is None:
            continue
        a = columns_of(s, model, model.centre, factors)[:, n:]
        after = bank.refitted(a)
        scale = np.array([f.scale for f in model.free[n:]])
        before, behind = float(np.linalg.norm(a * scale)), float(np.linalg.norm(after * scale))
        bank.columns[x.label] = after
        bank.directions[x.label] = _basis(after * scale)
        bank.surviving[x.label] = behind / before if before > 0 else 0.0
        # how long a signature of nothing would be: the noise of the means that it is made of
        noise = 0.0
        for c in s.training:
            for k in range(n, len(model.free)):
                total = model.slopes[k].get(c.name, {})
                variance = sum(q * q / s.means.mean[c.name][p][1] for p, q in total.items())
                solved = np.linalg.solve(factors[c.name], s.means.covariance[c.name])
                size = float(np.trace(np.linalg.solve(factors[c.name], solved.T)))
                noise += variance * size * model.free[k].scale ** 2
        bank.visible[x.label] = before / math.sqrt(noise) if noise > 0 else math.inf
        f = x.term.free[0]
        bank.room[x.label] = (f.low - f.neutral, f.high - f.neutral)
    return bank


def gains(bank: Bank, candidate: Candidate, r: np.ndarray) -> np.ndarray:
    """(k,) what innovations r (n, k) gain, adjustables refitted; of a single number within its bounds.

    By one step of reweighted least squares, which lowers what ``heavy`` counts: each recording by its weight before.
    """
    left = bank.refitted(r)
    directions = bank.directions[candidate.label]
    if not directions.shape[1]:
        return np.zeros(r.shape[1])
    weights = np.empty_like(left)
    for rows, tail in bank.tails:
        weights[rows] = heavy_weight(np.sum(left[rows] ** 2, axis=0), rows.stop - rows.start, tail)
    if candidate.numbers == 1:
        column = bank.columns[candidate.label][:, 0]
        amount = (column @ (weights * left)) / np.maximum(column**2 @ weights, current().rounding.nothing)
        after = left - np.outer(column, np.clip(amount, *bank.room[candidate.label]))
    else:
        inside = np.einsum("ni,nk,nj->kij", directions, weights, directions)
        amounts = np.linalg.solve(inside, (directions.T @ (weights * left)).T[:, :, None])[:, :, 0]
        after = left - directions @ amounts.T
    return counted(bank, left) - counted(bank, after)


def counted(bank: Bank, left: np.ndarray) -> np.ndarray:
    """(k,) what residuals (n, k) count for, see ``heavy``."""
    total: np.ndarray = np.zeros(left.shape[1])
    for rows, tail in bank.tails:
        total = total + heavy(np.sum(left[rows] ** 2, axis=0), rows.stop - rows.start, tail)
    return total


def _basis(a: np.ndarray) -> np.ndarray:
    criteria = current().rounding
    u, w, _ = np.linalg.svd(a, full_matrices=False)
    return u[:, w > criteria.direction * max(w[0], criteria.nothing)] if len(w) else u


def columns_of(s: Search, model: Model, u: np.ndarray, factors: Mapping[str, np.ndarray]) -> np.ndarray:
    """(n, k) whitened derivatives of the prediction by the model's numbers."""
    blocks = []
    for c in s.training:
        base, _ = model.predict(s.means, c, u)
        columns = []
        for k, f in enumerate(model.free):
            step = stride(u[k], f.scale, f.high)
            moved = u.copy()
            moved[k] += step
            columns.append((model.predict(s.means, c, moved)[0] - base) / step)
        blocks.append(np.linalg.solve(factors[c.name], np.array(columns).T))
    return np.concatenate(blocks)


def draw_nulls(s: Search, bank: Bank, candidates: Sequence[Candidate]) -> Nulls:
    """Runs seen as if they were the recording: what two packings do, mixed in a random proportion, and tracking noise.

    Mixing a cos + b sin of two runs' deviations, as far off as one of them, keeps their covariance and their tails, and
    makes more replicates than there are runs. Where there are several recordings each gets its own. A recording took no
    part in the spread by which it is weighed, and signatures stand out most where that is too small by chance: so each
    part of the runs is weighed, and held against signatures, by the spread of the others.
    """
    folds = current().packings.folds
    alive = [x for x in candidates if counts(bank, x)]
    parts, best = [], []
    for fold in range(folds):
        count = (current().packings.replicates + fold) // folds
        apart = bank_of(s, alive, fold)
        r = np.concatenate([_seen_as_recorded(s, c, fold, count, apart) for c in s.training])
        of_all = [np.zeros(count), *(gains(apart, x, r) - 2 * (x.numbers - 1) for x in alive)]
        parts.append(r)
        best.append(np.max(of_all, axis=0))
    drawn = np.hstack(parts)
    refitted = bank.refitted(drawn)
    recalibration = counted(bank, drawn) - counted(bank, refitted)
    whole, left = np.sum(drawn**2, axis=0), np.sum(refitted**2, axis=0)
    return Nulls(whole, recalibration, np.concatenate(best), left, drawn.T, refitted.T)


def _own_packing(s: Search, c: Condition) -> float:
    """Variance of a recording's numbers about the prediction, in units of the spread between packings."""
    _, variance = s.base.model.predict(s.means, c, s.base.u)
    return (0.0 if c.averaged else 1.0) + variance


def _seen_as_recorded(s: Search, c: Condition, fold: int, count: int, bank: Bank) -> np.ndarray:
    """(p, count) whitened numbers of replicates from one part of the runs."""
    residuals, _ = s.means.folds[c.name][fold]
    if not len(residuals):
        residuals = s.means.residuals[c.name]
    first, second = s.rng.integers(len(residuals), size=(2, count))
    turn = s.rng.uniform(0.0, 2 * math.pi, (count, 1))
    factor = bank.factors[c.name]
    white = np.linalg.solve(factor, residuals.T).T
    mixed = white[first] * np.cos(turn) + white[second] * np.sin(turn)
    # as far off as the first of the two: a mixture of a wild packing and a usual one is neither
    far, now = (np.sum(x**2, axis=1, keepdims=True) for x in (white[first], mixed))
    chosen = mixed * np.sqrt(_own_packing(s, c) * far / np.maximum(now, current().rounding.nothing))
    if np.any(np.diag(c.error) > 0):
        values, vectors = np.linalg.eigh(c.error)
        noise = (s.rng.normal(size=chosen.shape) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
        chosen = chosen + np.linalg.solve(factor, noise.T).T
    return chosen.T


def counts(bank: Bank, x: Candidate) -> bool:
    criteria = current().packings
    there = x.label in bank.directions and bank.surviving[x.label] > criteria.survives
    return there and bank.visible[x.label] > criteria.visible


def screen(s: Search, candidates: Sequence[Candidate]) -> Bank:
    """First-order gains of all candidates, and the nulls of that search."""
    # the spread is better known now than before the candidates were run
    s.naive = fit(s.naive.model, s.means, s.training)
    s.base = fit(s.base.model, s.means, s.training) if s.adjust else s.naive
    bank = bank_of(s, candidates)
    s.trials = [t for t in s.trials if t.reason and not t.fit and t.label not in bank.directions]
    for x in candidates:
        if x.label not in bank.directions:
            s.trials.append(Trial(x, 0.0, 0.0, None, 0, "not run everywhere"))
            continue
        reason = ""
        if bank.surviving[x.label] <= current().packings.survives:
            reason = "recalibration imitates it"
        elif bank.visible[x.label] <= current().packings.visible:
            reason = "no amount of it shows in these recordings"
        gain = 0.0 if reason else float(gains(bank, x, bank.left[:, None])[0])
        s.trials.append(Trial(x, bank.surviving[x.label], gain, None, 0, reason))
    s.nulls = draw_nulls(s, bank, candidates)
    s.looked = max(sum(counts(bank, x) for x in candidates), 2)
    apart = np.concatenate([np.linalg.solve(bank.factors[c.name], s.naive.left[c.name][0]) for c in s.training])
    gained = counted(bank, apart[:, None]) - counted(bank, bank.refitted(apart)[:, None])
    s.p_recalibration = rank(float(gained[0]), s.nulls.recalibration) if s.adjust else 1.0
    top = max((t.gain - 2 * (t.numbers - 1) for t in s.trials if not t.reason), default=0.0)
    s.p_search = rank(top, s.nulls.best)
    s.trials.sort(key=lambda t: -t.worth)
    return bank
