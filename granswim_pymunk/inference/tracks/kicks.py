"""Velocities that change at once where the scene has nothing to strike: a stop, a hand, a magnet that was left out."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..criteria import current
from ..data import Case
from .segments import find_impacts, paths_of


@dataclass(frozen=True)
class Kick:
    """A change of velocity within a frame or two.

    t : when [s];  place : (2,) [m];  change : (2,) of the velocity [m/s]
    """

    body: str
    t: float
    place: np.ndarray
    change: np.ndarray


def unexplained(case: Case) -> list[Kick]:
    """Kicks of bodies that touch nothing that the scene has, in order of time.

    In windows of frames a parabola whose velocity steps once has to follow, and a cubic without a step to be off by
    far. Not of bodies that follow a command.
    """
    scene = case.recording.scene
    led = {b for item in scene.laws_as("command") for b in item.bodies or ()}
    struck = [(b, i.row) for i in find_impacts(case) for b in i.bodies]
    found = []
    for body, (xy, noise) in paths_of(case).items():
        if body in led or noise <= 0:
            continue
        rows = [row for b, row in struck if b == body]
        found += [
            kick for row, kick in _kicks(body, case.t, xy, noise)
            if all(abs(row - other) > current().kicks.half for other in rows)
        ]  # fmt: skip
    return sorted(found, key=lambda kick: kick.t)


def _kicks(body: str, t: np.ndarray, xy: np.ndarray, noise: float) -> list[tuple[int, Kick]]:
    """Kicks of one body with their rows; xy : (T, 2) places [m]."""
    c = current().kicks
    seen = np.flatnonzero(np.isfinite(xy).all(axis=1))
    size = 2 * c.half
    if len(seen) < size:
        return []
    times, places = sliding_window_view(t[seen], size), sliding_window_view(xy[seen] / noise, size, axis=0)
    span = np.ptp(times, axis=1)
    usual = np.median(span)
    s = (times - times[:, :1]) / span[:, None]
    q, _ = np.linalg.qr(np.power(s[..., None], np.arange(4)))
    left = places - np.einsum("wpk,wlk,wcl->wcp", q, q, places, optimize=True)
    smooth = np.sum(left**2, axis=(1, 2))
    freedom = 2 * (size - 4) - 1
    best: list[tuple[float, int, np.ndarray, float]] = []
    for w in np.flatnonzero((smooth > c.sure) & (span < c.gap * usual)).tolist():
        # the step lies about the middle: in between two frames, or within one
        for when in np.linspace(s[w, c.half - 2], s[w, c.half + 1], 7):
            design = np.column_stack([np.ones(size), s[w], s[w] ** 2, np.maximum(s[w] - when, 0.0)])
            numbers, *_ = np.linalg.lstsq(design, places[w].T, rcond=None)
            off = float(np.sum((places[w].T - design @ numbers) ** 2))
            if smooth[w] - off > c.sure and smooth[w] > c.times * off and off < c.most * freedom:
                best.append((off - smooth[w], w, numbers[3] * noise / span[w], float(when)))
    kicks: list[tuple[int, Kick]] = []
    for _, w, change, when in sorted(best, key=lambda found: found[0]):
        row = int(seen[w + c.half])
        if all(abs(row - other) > size for other, _ in kicks):
            kicks.append((row, Kick(body, float(times[w, 0] + when * span[w]), xy[row], change)))
    return kicks


def told(case: Case, kicks: list[Kick]) -> str:
    """One sentence of the first kicks: when, where, whose, and how far they are from each other."""
    first, near = kicks[0], current().kicks.half * float(np.median(np.diff(case.t)))
    now = {k.body: k for k in reversed(kicks) if abs(k.t - first.t) < near}
    later = len(kicks) - len(now)
    size = max(float(np.hypot(*k.change)) for k in now.values())
    text = (
        f"{case.name}: at t = {first.t:.4g} s, x = {first.place[0]:.3g} m, y = {first.place[1]:.3g} m the velocity of "
        f"{' and '.join(sorted(now))} changes by {size:.2g} m/s within a frame or two"
    )
    if later:
        text += f" (so does one {later} times later)" if later > 1 else " (and once later)"
    if len(now) > 1:
        there = {b: xy[np.abs(case.t - first.t) < near] for b, (xy, _) in paths_of(case).items() if b in now}
        gaps = [np.hypot(*(there[a] - there[b]).T) for a, b in combinations(there, 2)]
        apart = float(np.nanmin(np.concatenate(gaps)))
        return text + f", {apart:.2g} m from each other: something acts between them"
    return text + ", where nothing that the scene has touches it: a stop, a hand, another body?"
