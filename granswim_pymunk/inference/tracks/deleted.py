"""A single bad sighting that a fit follows: told by what a law leaves without it.

Where frames are few, as at the ends of a short film, a start follows a bad sighting and leaves as much at its
neighbours: none stands out. Without sighting i the fit leaves chi2 - r_i' (1 - H_ii)^-1 r_i, with r its residuals and H
the projection on all that was fitted. Source: Cook & Weisberg 1982, Residuals and Influence in Regression, ch. 2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ... import distributions as stats
from ..criteria import current
from ..data import Case
from ..linear import basis, project
from ..trial import best_of_each
from .fitted import Fit
from .name import Trial

Sighting = tuple[str, int, str]  # recording, frame, body


def followed_sighting(trials: Iterable[Trial], cases: Sequence[Case]) -> dict[str, np.ndarray]:
    """(T, c) of a recording, True at the one sighting without which a law leaves noise; empty where there is none.

    Of all sightings noise has one so far off with the chance ``NoiseCriteria.single``, and with it no law leaves noise.
    """
    fits = [t.fit for t, _ in best_of_each(sorted(trials, key=lambda t: -t.gain), lambda t: True, ()) if t.fit]
    fits = fits[: current().noise.laws_asked]
    if not fits or any(_passes(fit.chi2, fit.count - fit.numbers) for fit in fits):
        return {}
    least, found = np.inf, None
    for fit in fits:
        falls = _falls(fit, cases)
        if not falls:
            continue
        sighting = max(falls, key=lambda key: falls[key][0])
        fall, columns = falls[sighting]
        left = fit.chi2 - fall
        chance = len(falls) * float(stats.chi2.sf(fall, len(columns)))
        passes = _passes(left, fit.count - fit.numbers - len(columns))
        if chance < current().noise.single and passes and left < least:
            least, found = left, (sighting, columns)
    if found is None:
        return {}
    (name, frame, _), columns = found
    mask = np.zeros(next(c for c in cases if c.name == name).values.shape, dtype=bool)
    mask[frame, columns] = True
    return {name: mask}


def _passes(chi2: float, freedom: int) -> bool:
    """Whether so much is left of noise; where nothing is left to tell, nothing passes."""
    return freedom > current().noise.freedom and chi2 < float(stats.chi2.isf(current().verdict.alarm, freedom))


def _falls(fit: Fit, cases: Sequence[Case]) -> Mapping[Sighting, tuple[float, list[int]]]:
    """By how much chi2 falls without each sighting, and which columns of its frame it has."""
    spanned, values, left, owners = [], [], [], list[tuple[Sighting, int] | None]()
    for case in cases:
        if case.name not in fit.innovations:
            continue
        by_value, by_start = fit.jacobian[case.name]
        spanned.append(basis(by_start))
        values.append(by_value - project(by_start, by_value))
        left.append(fit.used(case.name))
        seen = np.argwhere(np.isfinite(fit.innovations[case.name]))
        owners += [((case.name, int(row), case.channels[c].body), int(c)) for row, c in seen]
        owners += [None] * (len(left[-1]) - len(seen))  # steps between segments, and priors
    shared, residuals, at = basis(np.concatenate(values)), np.concatenate(left), 0
    rows: dict[Sighting, list[int]] = {}
    columns: dict[Sighting, list[int]] = {}
    for k, owner in enumerate(owners):
        if owner is not None:
            rows.setdefault(owner[0], []).append(k)
            columns.setdefault(owner[0], []).append(owner[1])
    result, own = {}, np.zeros((len(residuals), max((s.shape[1] for s in spanned), default=0)))
    for part in spanned:
        own[at : at + len(part), : part.shape[1]] = part
        at += len(part)
    for sighting, mine in rows.items():
        kept = np.eye(len(mine)) - shared[mine] @ shared[mine].T - own[mine] @ own[mine].T
        size, axes = np.linalg.eigh(kept)
        told = size > current().noise.leverage  # what the fit follows whatever it is says nothing
        along = axes[:, told].T @ residuals[mine]
        result[sighting] = float(np.sum(along**2 / size[told])), columns[sighting]
    return result
