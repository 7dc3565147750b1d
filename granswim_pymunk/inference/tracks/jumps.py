"""A picture that jumps at once: somebody ran against the camera while it filmed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..criteria import current
from ..data import Case
from ..hypothesis import Free, Term
from .kicks import left_by, variance_of, with_step
from .segments import paths_of


@dataclass(frozen=True)
class Jump:
    """All places are off by ``change`` (2,) [m] from the frame ``row`` on, at its time t [s].

    first, last : rows of the frames that it is told from;  ahead : of chi2 without it, by so much
    """

    row: int
    t: float
    change: np.ndarray
    first: int
    last: int
    ahead: float


@dataclass(frozen=True)
class _Window:
    """Frames of one body about a jump that may be.

    rows (n,), s (n,) : of the frames, and their times from 0 to 1;  places (n, 2) over the noise;  variance : of these
    noise [m] : one standard deviation
    """

    rows: np.ndarray
    s: np.ndarray
    places: np.ndarray
    variance: float
    noise: float


@dataclass(frozen=True)
class _Windows:
    """All windows of one body: what ``_Window`` has, of each.

    noise [m] : one standard deviation;  across (w, n) : what of a jump a cubic does not follow
    """

    rows: np.ndarray
    s: np.ndarray
    places: np.ndarray
    variance: np.ndarray
    across: np.ndarray
    noise: float

    def normal(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(w,) the row where each would jump, and the normal equations of the jump: (w,) [1/m^2], (w, 2) [1/m]."""
        rows = self.rows[:, current().kicks.half]
        size = np.sum(self.across**2, axis=1) / (self.variance * self.noise**2)
        along = np.einsum("wn,wnk->wk", self.across, self.places) / (self.variance * self.noise)[:, None]
        return rows, size, along

    def at(self, row: int) -> _Window | None:
        """The window that would jump at a row."""
        k = int(np.searchsorted(self.rows[:, current().kicks.half], row))
        if k == len(self.rows) or self.rows[k, current().kicks.half] != row:
            return None
        return _Window(self.rows[k], self.s[k], self.places[k], float(self.variance[k]), self.noise)


def jumps_of(case: Case) -> list[Jump]:
    """Jumps of the whole picture, in order of time.

    In windows of frames about two that follow each other a cubic for each body and one jump for all have to follow,
    and to be ahead by far of cubics without it, of polynomials of fifth degree, and of velocities that step.
    """
    c = current().kicks
    size, toward = np.zeros(len(case.t)), np.zeros((len(case.t), 2))
    followed = [_windows(case, body, xy, noise) for body, (xy, noise) in paths_of(case).items() if noise > 0]
    for windows in followed:
        rows, own, along = windows.normal()
        np.add.at(size, rows, own)
        np.add.at(toward, rows, along)
    gain = np.sum(toward**2, axis=1) / np.maximum(size, np.finfo(float).tiny)
    found = []
    for row in np.flatnonzero(gain > c.sure).tolist():
        mine = [one for windows in followed if (one := windows.at(row)) is not None]
        if _is_jump(mine, toward[row] / size[row]):
            first, last = min(int(w.rows[0]) for w in mine), max(int(w.rows[-1]) for w in mine)
            found.append(Jump(row, float(case.t[row]), toward[row] / size[row], first, last, float(gain[row])))
    kept: list[Jump] = []
    for jump in sorted(found, key=lambda j: -j.ahead):
        if all(abs(jump.row - other.row) > 2 * c.half for other in kept):
            kept.append(jump)
    return sorted(kept, key=lambda j: j.t)


def _windows(case: Case, body: str, xy: np.ndarray, noise: float) -> _Windows:
    """Windows of a body, none of those with more than so many lost frames among theirs."""
    c = current().kicks
    seen, size = np.flatnonzero(np.isfinite(xy).all(axis=1)), 2 * c.half
    if len(seen) < size:
        none = np.zeros((0, size))
        return _Windows(none.astype(int), none, np.zeros((0, size, 2)), np.zeros(0), none, noise)
    rows, places = sliding_window_view(seen, size), sliding_window_view(xy[seen] / noise, size, axis=0)
    times = case.t[rows]
    span = np.ptp(times, axis=1)
    whole = span < c.gap * np.median(span)
    s = ((times - times[:, :1]) / span[:, None])[whole]
    variance = sliding_window_view(variance_of(case, body)[seen], size).mean(axis=1)[whole]
    q, _ = np.linalg.qr(np.power(s[..., None], np.arange(c.smooth + 1)))
    step = _step()
    across = step - np.einsum("wpk,wlk,l->wp", q, q, step, optimize=True)
    return _Windows(rows[whole], s, places[whole].swapaxes(1, 2), variance, across, noise)


def _step() -> np.ndarray:
    """(n,) a jump of one in the middle of a window."""
    return np.repeat([0.0, 1.0], current().kicks.half)


def _is_jump(windows: Sequence[_Window], change: np.ndarray) -> bool:
    """Whether one ``change`` (2,) [m] of the places of all these bodies is ahead of all that goes without it."""
    c = current().kicks
    freedom = 2 * (2 * c.half - c.smooth - 1)
    smooth = off = turning = kinked = 0.0
    for w in windows:
        scaled = w.places.T[None]
        after = float(left_by(c.smooth, w.s[None], scaled - np.outer(change / w.noise, _step()))[0]) / w.variance
        if after > c.most * freedom:  # this body does not jump with the others
            return False
        off += after
        smooth += float(left_by(c.smooth, w.s[None], scaled)[0]) / w.variance
        turning += float(left_by(c.turning, w.s[None], scaled)[0]) / w.variance
        kinked += with_step(w.s, w.places, c.half)[0] / w.variance
    return min(smooth - off - c.sure, turning - off - c.turns, kinked - off - c.turns) > 0


def jump_terms(cases: Sequence[Case]) -> list[Term]:
    """The largest jump of the picture in the training part of the one recording, as a candidate."""
    if len(cases) != 1:
        return []
    (case,) = cases
    learnt = [j for j in jumps_of(case) if case.training[j.first : j.last + 1].all()]
    if not learnt:
        return []
    jump, ends = max(learnt, key=lambda j: float(np.hypot(*j.change))), current().apparatus
    since = jump.t - float(case.t[0])

    def apply(scene: Any, camera: Any, values: Any):
        return scene, {**camera, "jump": (float(values[0]), float(values[1])), "jumped": since}

    free = tuple(Free(f"camera.jump_{k}", "m", -ends.bias, ends.bias, 0.0, ends.shift) for k in "xy")
    # between two frames: half a frame before the first that shows it
    frame = float(np.median(np.diff(case.t)))
    told = {"t_1": (jump.t - frame / 2, "s")}
    return [
        Term("camera_jump", "camera_jump", free, apply, expression="seen = true + b from t_1 on",
             groups=(("b", (0, 1)),), fixed=told, special=True)
    ]  # fmt: skip


def scored_before_jumps(case: Case) -> Case:
    """The recording, its held-out frames counted up to where the picture jumps among them, which no law can know."""
    learnt = np.flatnonzero(case.start if case.held_out else case.training)
    later = [j for j in jumps_of(case) if len(learnt) and j.row > learnt[-1]]
    scored = case.scored.copy()
    if not later or scored[: later[0].row].sum() < current().kicks.half:
        return case
    scored[later[0].row :] = False
    size = float(np.hypot(*later[0].change))
    note = (
        f"{case.name}: the picture jumps by {size:.2g} m at t = {later[0].t:.4g} s; held-out frames count up to there"
    )
    return replace(case, scored=scored, notes=(*case.notes, note))
