"""What a force between bodies is where it was seen: its strength may be told at a distance at which nobody ever was."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from ...laws import AUTOMATIC, Law, all_laws
from ..criteria import current
from ..data import Case
from ..hypothesis import Term
from ..significance import half_interval
from .fitted import Fit
from .segments import paths_of

SEEN = {"gap", "distance", "r0"}  # of the state of two bodies, what a force that is told so may ask for


def force_where_seen(term: Term, fit: Fit, offset: int, spread: float, cases: Sequence[Case]) -> str:
    """The force [N] at the distance of centres at which the films tell it best, with its interval, as part of a line.

    Of a law F(d; p) with numbers p of covariance C, var F = (dF/dp) C (dF/dp)^T; of the distances that were seen that
    with the least var F/F^2. Empty where the law has one number, or asks for more than the distance.
    offset : where the term's numbers begin in the fit;  spread : inflation of variances
    """
    law = all_laws().get(term.law)
    names = [f.name.rpartition(".")[2] for f in term.free]
    if law is None or law.kind != "pair" or not law.reach or len(names) < 2 or any("[" in n for n in names):
        return ""
    given = _given(law, term)
    if set(law.arguments) - SEEN - {*names, *given}:
        return ""
    distances, radii = seen_distances(term, cases)
    if not len(distances):
        return ""
    rows = slice(offset, offset + len(names))
    values, covariance = fit.values[rows], fit.covariance[rows, rows] * spread
    steps = np.maximum(np.abs(values), [abs(f.scale) for f in term.free]) * current().left.step
    best = (math.inf, 0.0, 0.0, 0.0)  # relative variance, distance, force, half of its interval
    for d in np.quantile(distances, np.linspace(0.0, 1.0, current().left.distances)).tolist():

        def force(numbers: np.ndarray, d: float = d) -> float:
            state = {"gap": d - 2 * radii, "distance": d, "r0": radii}
            told = {**state, **given, **dict(zip(names, map(float, numbers), strict=True))}
            return float(law(*(told[a] for a in law.arguments))[0])

        size = force(values)
        slopes = np.array([(force(values + h) - force(values - h)) / 2 for h in np.diag(steps)]) / steps
        variance = float(slopes @ covariance @ slopes)
        if size and math.isfinite(variance) and variance / size**2 < best[0]:
            best = variance / size**2, d, size, half_interval(variance)
    relative, d, size, half = best
    if not math.isfinite(relative):
        return ""
    return f"; {size:.4g} ({size - half:.4g} to {size + half:.4g}) N at d = {d:.3g} m, where it is told best"


def _given(law: Law, term: Term) -> Mapping[str, Any]:
    """Values of the single numbers of a law that are not fitted."""
    told = {p.name: p.default for p in law.parameters} | dict(term.choices) | {k: v for k, (v, _) in term.fixed.items()}
    told = {name: math.inf if value is AUTOMATIC else value for name, value in told.items()}
    return {name: value for name, value in told.items() if isinstance(value, int | float)}


def seen_distances(term: Term, cases: Sequence[Case]) -> tuple[np.ndarray, float]:
    """Distances of centres (k,) [m] in the training parts of bodies that a law acts on, and their mean radius [m]."""
    found, radii = list[np.ndarray](), list[float]()
    for case in cases:
        acting = {b.id: b.radius for b in case.recording.scene.bodies if term.bodies is None or b.id in term.bodies}
        radii += acting.values()
        paths = {name: path for name, (path, _) in paths_of(case).items() if name in acting}
        for a, b in combinations(paths, 2):
            gap = np.linalg.norm(paths[b] - paths[a], axis=1)[case.training]
            found.append(gap[np.isfinite(gap)])
    return np.concatenate(found) if found else np.zeros(0), float(np.mean(radii)) if radii else 0.0
