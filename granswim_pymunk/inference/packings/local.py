"""Near what was found: how the numbers change there, and how far packings scatter there.

A law that is strong is not linear: the chord from its absence is not its slope where it stands, and packings under it
differ by more, or less, than without it. Both decide how well its numbers are known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..criteria import current
from .candidates import Candidate, packings_for
from .response import Fit, Means, Model, Point, Sum, add
from .runs import Job
from .screening import columns_of
from .state import Search, extra_at, jobs_for, label_of, rounded
from .summaries import Condition


def near(s: Search, model: Model, candidates: Sequence[Candidate]) -> tuple[Model, set[Point]]:
    """The model with slopes from runs on both sides of its centre, and the scenes that were run there.

    As far as such a slope is noise it gives way to the model's own, see ``shrunk``; numbers of the camera need no runs.
    Where a run fails the slope stays as it is.
    """
    sides = _sides(s, model, candidates)
    count = packings_for(candidates, max(s.sizes.leader // max(len(sides) - 1, 1), 2))
    jobs: list[Job] = []
    labels: dict[int, list[str]] = {}
    for k, ends in sides.items():
        where = [c for c in s.training if c.name in model.slopes[k]]
        labels[k] = []
        for u in ends:
            theta, extra = u[: len(s.adjust)], extra_at(s, candidates, u)
            labels[k].append(label_of(s.adjust, theta, extra))
            jobs += jobs_for(where, s.adjust, theta, extra, count, True)
    s.runner.do(jobs, lambda k, n: s.progress("near what was found", 0.92 + 0.02 * k / n))
    s.means.refresh()
    s.test.refresh()
    slopes, run = list(model.slopes), set()
    for k, (low, high) in sides.items():
        known = {c.name: c for c in s.training if c.name in model.slopes[k]}
        points = [(label, True) for label in labels[k]]
        if any(p not in s.means.mean[name] for p in points for name in known):
            continue
        run.update(points)
        across = float(high[k] - low[k])
        raw = {name: {points[1]: 1 / across, points[0]: -1 / across} for name in known}
        slopes[k] = shrunk(s.means, list(known.values()), raw, model.slopes[k])
    return replace(model, slopes=tuple(slopes)), run


def _sides(s: Search, model: Model, candidates: Sequence[Candidate]) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """For each number but the camera's the points (k,) on both sides of the centre at which scenes are run."""
    neutral = np.concatenate([np.zeros(len(s.adjust)), *[x.neutral for x in candidates]])
    found = {}
    for k, f in enumerate(model.free):
        if model.camera[k] is not None:
            continue
        u = model.centre
        away = 0.5 * f.scale if k < len(s.adjust) else current().packings.aside * abs(u[k] - neutral[k])
        away = min(away, current().packings.inside * min(u[k] - f.low, f.high - u[k]))
        step = np.where(np.arange(len(u)) == k, away, 0.0)
        low, high = rounded(u - step), rounded(u + step)
        if low[k] < high[k]:
            found[k] = low, high
    return found


def shrunk(
    means: Means, conditions: Sequence[Condition], raw: Mapping[str, Sum], known: Mapping[str, Sum]
) -> dict[str, Sum]:
    """A slope from few runs, drawn towards a multiple of one that is known well.

    b C + w (R - b C), b the regression of the raw slope R on the known one C in units of the spread, and
    w = max(1 - E/|R - b C|^2, 0) with E what the runs' noise is expected to put there (James & Stein 1961).
    """
    found, before, noise = [], [], 0.0
    for c in conditions:
        factor = np.linalg.cholesky(means.covariance[c.name])
        found.append(np.linalg.solve(factor, means.predict(c, raw[c.name])[0]))
        before.append(np.linalg.solve(factor, means.predict(c, known[c.name])[0]))
        for point, k in raw[c.name].items():
            rows, dof = means.apart(c, [point])  # their own scatter: packings may differ by more here
            noise += k * k / (dof + 1) * float(np.mean(np.sum(np.linalg.solve(factor, rows.T) ** 2, axis=0)))
    r, one = np.concatenate(found), np.concatenate(before)
    size = float(one @ one)
    b = float(one @ r) / size if size > 0 else 0.0
    off = float(np.sum((r - b * one) ** 2))
    w = max(1 - noise / off, 0.0) if off > 0 else 1.0
    return {c.name: add((w, raw[c.name]), ((1 - w) * b, known[c.name])) for c in conditions}


def scatter_of(s: Search, found: Fit, points: set[Point]) -> tuple[np.ndarray, int] | None:
    """(k,) variance of the numbers by how runs near what was found scatter, in what the fit says; degrees of freedom.

    With H = J' V^-1 J and W = H^-1 J' V^-1 the numbers scatter by W S W', S the covariance of runs of these scenes;
    their few degrees of freedom lean on some of the spread of all. None where nothing but means was seen.
    """
    columns = columns_of(s, found.model, found.u, {n: np.linalg.cholesky(v) for n, (_, v) in found.left.items()})
    inverse = np.linalg.pinv(columns.T @ columns)
    lean = current().packings.lean
    at, said, seen, runs = 0, np.zeros(len(found.u)), np.zeros(len(found.u)), 0
    for c in s.training:
        factor = np.linalg.cholesky(found.left[c.name][1])
        block = columns[at : at + len(factor)]
        at += len(factor)
        if c.averaged:
            continue
        w = np.linalg.solve(factor.T, block @ inverse).T
        rows, dof = s.means.apart(c, points)
        # the recording's own packing, and those that its prediction is the mean of
        packings = 1 + found.model.predict(s.means, c, found.u)[1]
        usual = packings * np.einsum("ki,ij,kj->k", w, s.means.covariance[c.name], w)
        # these runs are among those that the weights were made of: other packings scatter more
        own = packings * s.means.inflation[c.name] * np.sum((w @ rows.T) ** 2, axis=1) / max(len(rows), 1)
        said += usual
        seen += (dof * own + lean * usual) / (dof + lean)
        runs += dof
    whole = np.diag(inverse)
    if not runs or not np.all(whole > 0):
        return None
    return (whole - said + seen) / whole, runs + int(lean)


def wilder_there(s: Search, points: set[Point]) -> float:
    """Mean square of packings near what was found, in units of the spread by which recordings are weighed; at least 1.

    A law may make the motion wilder: what a fit leaves is then no more than one packing under that law differs by.
    """
    squares, count = 0.0, 0
    for c in s.training:
        rows, dof = s.means.apart(c, points)
        if c.averaged or not dof:
            continue
        z = np.linalg.solve(np.linalg.cholesky(s.means.covariance[c.name]), rows.T)
        squares += s.means.inflation[c.name] * dof * float(np.mean(z**2))
        count += dof
    return max(squares / count, 1.0) if count else 1.0
