"""The naive scene in other packings, and its adjustables refitted there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...errors import InputError
from ..criteria import current
from ..criteria.packings import Sizes
from ..hypothesis import adjustable_terms
from ..simpler import ended_at_bound
from .response import Means, Model, Sum, add, fit
from .runs import Job, Runner
from .state import NAIVE, Progress, Search, bears_on, jobs_for, label_of, rounded
from .summaries import Condition, Shim


def begin(
    conditions: list[Condition], runner: Runner, sizes: Sizes, rng: np.random.Generator, progress: Progress
) -> Search:
    """Naive runs of all conditions, and how far off they are."""
    recordings = {c.recording.name: c.recording for c in conditions}
    adjust = adjustable_terms([Shim(r) for r in recordings.values()])  # type: ignore[misc]
    theta = np.array([t.free[0].first for t in adjust])
    means = Means(runner, [c for c in conditions if c.view is not None])
    test = Means(runner, [c for c in conditions if c.test is not None], test=True)
    training = [c for c in conditions if c.view is not None]
    only_test = [c for c in conditions if c.view is None]
    jobs = jobs_for(training, (), np.zeros(0), (), sizes.true, False, NAIVE)
    jobs += jobs_for(training, (), np.zeros(0), (), sizes.soft, True, NAIVE)
    for k in range(sizes.soft, -(-sizes.spread // len(training))):
        jobs += [Job(c, NAIVE, lambda scene: scene, k, True, part=True) for c in training]
    jobs += jobs_for(only_test, (), np.zeros(0), (), max(sizes.true // 2, 3), False, NAIVE)
    jobs += jobs_for(only_test, (), np.zeros(0), (), max(sizes.soft // 2, 3), True, NAIVE)
    runner.do(jobs, lambda k, n: progress("naive scene in other packings", 0.02 + 0.18 * k / n))
    for c in conditions:
        for soft in (False, True):
            if len(runner.tracks.get((c.name, NAIVE, soft), {})) < 2 or (c.name, NAIVE, soft) in runner.failures:
                why = runner.reason(NAIVE, soft)
                raise InputError(f"the naive scene could not be run: {why}", file=c.recording.folder, where=c.name)
    means.refresh()
    test.refresh()
    model = Model("naive", (), np.zeros(0), {c.name: {(NAIVE, False): 1.0} for c in conditions}, (), ())
    naive = fit(model, means, training)
    return Search(conditions, runner, sizes, rng, progress, means, test, adjust, theta, naive, naive)


def recalibrate(s: Search) -> None:
    """Gauss-Newton on simulated differences; the adjustables' slopes are taken once, the anchor follows.

    A number that ends at its bound explains nothing (contract 2): it stays as it is believed, and the others are fitted
    without it. Its slope, followed that far, would take up whatever is missing.
    """
    if not s.adjust:
        return
    criteria, first = current().packings, s.theta.copy()
    steps = []
    for k, term in enumerate(s.adjust):
        f = term.free[0]
        step = criteria.step * (f.high - f.low)
        steps.append(step if f.high - first[k] > first[k] - f.low else -step)
    jobs = []
    points = []
    for k, term in enumerate(s.adjust):
        theta = first.copy()
        theta[k] += steps[k]
        where = [c for c in s.conditions if bears_on(term, c)]
        jobs += jobs_for(where, s.adjust, theta, (), s.sizes.adjustable, True)
        points.append(label_of(s.adjust, theta))
    s.runner.do(jobs, lambda k, n: s.progress("recalibrating", 0.2 + 0.06 * k / n))
    s.means.refresh()
    s.test.refresh()
    slopes = []
    for k, term in enumerate(s.adjust):
        slope: dict[str, Sum] = {}
        for c in s.conditions:
            if bears_on(term, c) and (c.name, points[k], True) not in s.runner.failures:
                slope[c.name] = {(points[k], True): 1 / steps[k], (NAIVE, True): -1 / steps[k]}
        slopes.append(slope)
    free = tuple(
        replace(t.free[0], scale=abs(step), first=float(v)) for t, step, v in zip(s.adjust, steps, first, strict=True)
    )
    anchor: dict[str, Sum] = {c.name: {(NAIVE, False): 1.0} for c in s.conditions}
    model = Model("recalibrated", free, first, anchor, tuple(slopes), (None,) * len(free))
    s.base = fit(model, s.means, s.training)
    for _ in range(3):
        moved = np.abs(s.base.u - s.base.model.centre) / np.abs(steps)
        sigma = np.sqrt(np.diag(s.base.covariance)) / np.abs(steps)
        if not np.any((moved > criteria.moved) & (moved > criteria.moved_errors * sigma)):
            break
        theta = rounded(s.base.u)
        label = label_of(s.adjust, theta)
        s.runner.do(
            jobs_for(s.conditions, s.adjust, theta, (), s.sizes.soft, True),
            lambda k, n: s.progress("recalibrated scene in other packings", 0.26 + 0.04 * k / n),
        )
        s.means.refresh()
        s.test.refresh()
        if any((label, True) not in s.means.mean[c.name] for c in s.training):
            s.notes.append("recalibration stopped early: a recalibrated scene could not be run")
            break
        anchor = {
            c.name: add((1.0, {(NAIVE, False): 1.0}), (1.0, {(label, True): 1.0}), (-1.0, {(NAIVE, True): 1.0}))
            for c in s.conditions
        }
        s.base = fit(replace(model, centre=theta, anchor=anchor), s.means, s.training)
    ended = ended_at_bound(zip(free, map(float, s.base.u), strict=True))
    if ended is not None:
        s.notes.append(
            f"recalibration alone runs into the bound {ended[0]} = {ended[1]:.3g}: something else is missing, and that "
            "number stays as it is believed"
        )
        kept = [k for k, f in enumerate(free) if f.name != ended[0]]
        s.adjust, s.theta, s.base = tuple(s.adjust[k] for k in kept), first[kept], s.naive
        recalibrate(s)
        return
    s.theta = s.base.model.centre.copy()
