"""How far from each other bodies turn away that meet, where their radii as believed say another distance."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from ..criteria import current
from ..data import Case
from .kicks import with_step
from .segments import paths_of


def away_from_radii(case: Case) -> list[str]:
    """A note on the pairs that turn away at another distance than the sum of their radii, by more than errors explain.

    An impact is a step in the velocity of one towards the other, away from it. All impacts of a pair have to agree:
    what turns bodies away before they touch, as magnets do, depends on how fast they come. Not where a law acts between
    them at a distance, or none does where they touch. It asks all frames, and is told once the verdict is fixed.
    """
    scene, c = case.recording.scene, current().touches
    reaches = any(item.law.kind == "pair" and item.law.reach for item in scene.laws)
    paths, off = paths_of(case), list[tuple[float, str]]()
    if not scene.laws_as("contact") or reaches or len(paths) > c.most:
        return []
    for a, b in combinations(paths, 2):
        radii = scene.body(a).radius + scene.body(b).radius
        met = list(_impacts(case.t, paths[b][0] - paths[a][0], radii, float(np.hypot(paths[a][1], paths[b][1]))))
        if not met:
            continue
        apart, variance = np.array(met).T
        mean, error = float(apart @ (1 / variance) / (1 / variance).sum()), float((1 / variance).sum() ** -0.5)
        agree = float(((apart - mean) ** 2 / variance).sum()) <= c.agree * len(met)
        if agree and abs(mean - radii) > max(c.sure * error, c.share * radii):
            text = f"{a} and {b} {1000 * mean:.4g} mm (+- {1000 * error:.2g}; their radii make {1000 * radii:.4g} mm)"
            off.append((abs(mean / radii - 1), text))
    if not off:
        return []
    (_, worst), *more = sorted(off, reverse=True)
    further = f", and so do {len(more)} more pairs" if len(more) > 1 else ", and so does one more pair" if more else ""
    return [
        f"{case.name}: bodies turn away from each other at another distance of their centres than their radii make: "
        f"{worst}{further}; look at the radii and at the scale of the picture (radius_error says how well radii are "
        "known)"
    ]


def nearer_than_radii(case: Case) -> list[str]:
    """A note on the pair whose centres come much nearer than its radii allow: laws that end at contact end too early.

    Where contacts are soft, or a radius is a guess as of a cart's half length, bodies overlap a little in any film.
    """
    scene, c, paths = case.recording.scene, current().touches, paths_of(case)
    deepest = None
    for a, b in combinations(paths if len(paths) <= c.most else (), 2):
        radii = scene.body(a).radius + scene.body(b).radius
        gap = np.linalg.norm(paths[b][0] - paths[a][0], axis=1)
        near = np.sort(gap[np.isfinite(gap)])[: c.frames]
        noise = float(np.hypot(paths[a][1], paths[b][1]))
        if len(near) == c.frames and near[-1] < min((1 - c.deep) * radii, radii - c.sure * noise):
            deepest = min(deepest or (1.0, "", "", 0.0, 0.0), (near[-1] / radii, a, b, near[-1], radii))
    if deepest is None:
        return []
    _, a, b, near, radii = deepest
    return [
        f"{case.name}: {a} and {b} come as near as {1000 * near:.4g} mm between their centres, and their radii make "
        f"{1000 * radii:.4g} mm: laws between bodies that do not touch end there; look at the radii"
    ]


def _impacts(t: np.ndarray, way: np.ndarray, radii: float, noise: float) -> Iterator[tuple[float, float]]:
    """Of each impact the distance of the centres [m] and its variance: where a parabola's velocity has a step.

    way : (T, 2) from one centre to the other [m], NaN where one is not seen;  noise : of its coordinates [m]
    """
    c, kicks = current().touches, current().kicks
    seen = np.flatnonzero(np.isfinite(way).all(axis=1))
    gap, usual = np.linalg.norm(way[seen], axis=1), float(np.median(np.diff(t)))
    for k in np.flatnonzero((gap > 0) & (gap <= (1 + c.near) * radii)).tolist():
        half = min(kicks.half, k, len(seen) - 1 - k)
        if half < kicks.few or gap[k] > gap[k - half : k + half + 1].min():
            continue
        rows = seen[k - half : k + half + 1]
        s = t[rows] - t[seen[k]]
        if np.diff(s).max() > kicks.gap * usual:
            continue
        left, when, step = with_step(s, way[rows], half)
        freedom = 2 * (len(s) - 4) - 1
        design = np.column_stack([np.ones(len(s)), s, s**2, np.maximum(s - when, 0.0)])
        numbers, *_ = np.linalg.lstsq(design, way[rows], rcond=None)
        place = numbers[0] + numbers[1] * when + numbers[2] * when**2
        apart = max(float(np.hypot(*place)), 1e-300)
        size, along = float(np.hypot(*step)), float(step @ place) / apart
        more = max(left / (freedom * noise**2), 1.0)  # what an impact that lasts leaves beyond noise
        covariance = np.linalg.inv(design.T @ design) * noise**2 * more
        # of the place at the step, and of how fast it goes there on in the middle for the error of its time
        here = np.array([1.0, when, when**2, 0.0])
        drift = float((numbers[1] + 2 * when * numbers[2] + step / 2) @ place) / apart
        late = noise / max(size, 1e-300) * np.sqrt(c.late * more)
        sharp = size * (s[1] - s[0]) > c.sharp * noise and along > c.along * size
        if sharp and left < kicks.most * freedom * noise**2:
            yield apart, float(here @ covariance @ here) + (drift * late) ** 2
