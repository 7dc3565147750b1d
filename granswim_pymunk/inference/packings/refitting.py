"""Candidates refitted by simulation: run at the fitted numbers, anchored there, fitted again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ... import distributions as stats
from ..criteria import current
from ..significance import rank
from .candidates import Candidate, packings_for
from .response import Fit, Model, add, fit
from .screening import model_of
from .state import NAIVE, Search, extra_at, jobs_for, label_of, rounded


def refit(
    s: Search, candidates: Sequence[Candidate], share: float, rounds: int = 2, count: int | None = None,
    start: Fit | None = None,
) -> tuple[Fit | None, int, str]:  # fmt: skip
    """Fit candidates by simulation: run at the fitted numbers, put the anchor there, fit again.

    The slope of a single number becomes the chord from its absence to where it was run, see ``run_at``. ``count`` runs
    a condition; ``start``: an earlier fit of the same candidates to go on from.
    """
    model = model_of(s, candidates) if start is None else start.model
    if model is None:
        return None, 0, "not run everywhere"
    found = fit(model, s.means, s.training, start=None if start is None else start.u)
    physical = [x for x in candidates if not x.apparatus]
    if not physical:
        return found, 1, ""
    n = len(s.base.u)
    runs = packings_for(physical, count or s.sizes.leader)
    done = 0
    for _ in range(rounds):
        here = rounded(run_at(s, found, candidates))
        extra = extra_at(s, candidates, here)
        theta = here[:n].copy()
        label = label_of(s.adjust, theta, extra)
        s.runner.do(
            jobs_for(s.training, s.adjust, theta, extra, runs, True),
            lambda k, m: s.progress(f"refitting {candidates[-1].label}", share),
        )
        s.means.refresh()
        if any((label, True) not in s.means.mean[c.name] for c in s.training):
            return found, done, s.runner.reason(label)
        done += 1
        model = anchored(s, model, here, label)
        before = found.u
        found = fit(model, s.means, s.training)
        wide = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
        if arrived(np.abs(found.u - before), wide, before - _absent(s, candidates)):
            break
    return found, done, ""


def arrived(off: np.ndarray, wide: np.ndarray, away: np.ndarray) -> bool:
    """Whether numbers that are ``off`` by so much need no other run: little beside their errors, or what they are."""
    errors, share = current().packings.settled
    return bool(np.all(off <= np.maximum(errors * wide, share * np.abs(away))))


def run_at(s: Search, found: Fit, candidates: Sequence[Candidate]) -> np.ndarray:
    """Where candidates are run to be known near the fitted numbers.

    Of a single number r spreads strong, the mean of n runs at a times it gives the chord with an error of 1/(a sqrt(n))
    where at the number itself it is 1/sqrt(n): a weak law is run where it shows, as far as its first runs went.
    """
    (x, *more), u = candidates, found.u.copy()
    n = len(s.base.u)
    if more or x.apparatus or x.numbers != 1:
        return u
    absent = u.copy()
    absent[n] = x.neutral[0]
    size = []
    for c in s.training:
        change = found.model.predict(s.means, c, u)[0] - found.model.predict(s.means, c, absent)[0]
        size.append(float(change @ np.linalg.solve(s.means.covariance[c.name], change)) / (2.0 * len(change)))
    shift = math.sqrt(max(float(np.mean(size)), 1e-12))
    first = abs(float(x.design[0, 0]) / (u[n] - absent[n])) if u[n] != absent[n] else 1.0
    u[n] = absent[n] + (u[n] - absent[n]) * max(min(current().packings.amounts.least / shift, first), 1.0)
    return u


def _absent(s: Search, candidates: Sequence[Candidate]) -> np.ndarray:
    return np.concatenate([np.zeros(len(s.base.u)), *[x.neutral for x in candidates]])


def stiffer(s: Search, model: Model, u: np.ndarray, label: str) -> float:
    """By what factor contacts as they are change the numbers more than softer ones say, at u, where ``label`` is run.

    Softness drops out of differences to first order only. The regression of the change seen with the scene's own
    contacts on that which the model tells, in units of the spread, the noise of the latter taken off; drawn towards 1
    by its own error (James & Stein 1961), so that a weak law leaves it there.
    """
    along = size = error = 0.0
    for c in s.training:
        told = add((1.0, model.sums(c.name, u)), (-1.0, {(NAIVE, False): 1.0}))
        (a, va), (b, vb) = (s.means.predict(c, p) for p in (told, {(label, False): 1.0, (NAIVE, False): -1.0}))
        factor = np.linalg.cholesky(s.means.covariance[c.name])
        a, b = np.linalg.solve(factor, a), np.linalg.solve(factor, b)
        along, size, error = along + float(a @ b), size + float(a @ a) - va * len(a), error + (va + vb) * float(a @ a)
    if size <= 0 or label == NAIVE:
        return 1.0
    off, wide = along / size - 1, error / size**2
    return 1 + off * max(1 - wide / off**2, 0.0) if off else 1.0


def anchored(s: Search, model: Model, u: np.ndarray, label: str, soft: bool = True) -> Model:
    """The model with its anchor in runs at u; the chord replaces the slope of a single physical number.

    Runs with the contacts as they are (not ``soft``) are joined with what the model says there, each by its variance;
    changes by softer contacts are first put right by ``stiffer``.
    """
    n = len(s.base.u)
    anchor = {}
    slopes = list(model.slopes)
    physical = [k for k in range(n, len(u)) if model.camera[k] is None]
    more = 1.0 if soft else stiffer(s, model, u, label)
    for c in s.training:
        if soft:
            here = add((1.0, {(NAIVE, False): 1.0}), (1.0, {(label, True): 1.0}), (-1.0, {(NAIVE, True): 1.0}))
        else:
            known = add((more, model.sums(c.name, u)), (1 - more, {(NAIVE, False): 1.0}))
            here = {(label, False): 1.0}
            own, other = (s.means.predict(c, points)[1] for points in (here, known))
            here = add((other / (own + other), here), (own / (own + other), known)) if own + other > 0 else here
        anchor[c.name] = here
    if not soft:
        slopes = [{name: add((more, slope)) for name, slope in by_name.items()} for by_name in slopes]
    if len(physical) == 1 and soft:
        k = physical[0]
        amount = u[k] - model.free[k].neutral
        if abs(amount) > current().packings.chord * model.free[k].scale:
            # the chord from the recalibrated scene without the law to the one with it
            chord = {
                c.name: add((1 / amount, anchor[c.name]), (-1 / amount, s.base.model.sums(c.name, u[:n])))
                for c in s.training if c.name in model.slopes[k]
            }  # fmt: skip
            slopes[k] = chord
            free = list(model.free)
            free[k] = replace(free[k], scale=abs(amount))
            model = replace(model, free=tuple(free))
    return replace(model, centre=u.copy(), anchor=anchor, slopes=tuple(slopes))


def goodness(s: Search, found: Fit, free_numbers: int, wilder: float = 1.0) -> tuple[float, float]:
    """Two p-values of what a fit leaves: its rank among the nulls, and the tail of chi2.

    ``wilder``: mean square of packings under what was found, in units of the spread of all.
    """
    assert s.nulls is not None
    n, left = max(found.count - free_numbers, 1), found.chi2 / wilder
    scaled = np.sort(s.nulls.left) * n / max(found.count - len(s.base.u), 1)
    return rank(left, scaled), float(stats.chi2.sf(left, n))
