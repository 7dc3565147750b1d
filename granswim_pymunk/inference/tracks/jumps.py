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

    rows (n,), s (n,) : of the frames, and their times from 0 to 1;  places (n, 2) [m];  noise [m] : one standard
    deviation, and what larger ``variance`` errors of the stamps make;  across (n,) [1/m] : what of a jump a cubic does
    not follow, over the noise
    """

    rows: np.ndarray
    s: np.ndarray
    places: np.ndarray
    variance: float
    noise: float
    across: np.ndarray


def jumps_of(case: Case) -> list[Jump]:
    """Jumps of the whole picture, in order of time.

    In windows of frames about two that follow each other a cubic for each body and one jump for all have to follow,
    and to be ahead by far of cubics without it, of polynomials of fifth degree, and of velocities that step.
    """
    c = current().kicks
    about: dict[int, list[_Window]] = {}
    for body, (xy, noise) in paths_of(case).items():
        if noise > 0:
            for window in _windows(case, body, xy, noise):
                about.setdefault(int(window.rows[c.half]), []).append(window)
    found = [jump for row, windows in about.items() if (jump := _jump(row, float(case.t[row]), windows)) is not None]
    kept: list[Jump] = []
    for jump in sorted(found, key=lambda j: -j.ahead):
        if all(abs(jump.row - other.row) > 2 * c.half for other in kept):
            kept.append(jump)
    return sorted(kept, key=lambda j: j.t)


def _windows(case: Case, body: str, xy: np.ndarray, noise: float) -> list[_Window]:
    """Windows of a body in which a jump in the middle would be ahead of a cubic by far."""
    c = current().kicks
    seen, size = np.flatnonzero(np.isfinite(xy).all(axis=1)), 2 * c.half
    if len(seen) < size:
        return []
    rows, places = sliding_window_view(seen, size), sliding_window_view(xy[seen], size, axis=0)
    times = case.t[rows]
    span = np.ptp(times, axis=1)
    s = (times - times[:, :1]) / span[:, None]
    variance = sliding_window_view(variance_of(case, body)[seen], size).mean(axis=1)
    q, _ = np.linalg.qr(np.power(s[..., None], np.arange(c.smooth + 1)))
    step = np.repeat([0.0, 1.0], c.half)
    across = (step - np.einsum("wpk,wlk,l->wp", q, q, step, optimize=True)) / (noise * np.sqrt(variance))[:, None]
    whole = span < c.gap * np.median(span)
    return [
        _Window(rows[w], s[w], places[w].T, float(variance[w]), noise, across[w])
        for w in np.flatnonzero(whole).tolist()
    ]


def _jump(row: int, t: float, windows: Sequence[_Window]) -> Jump | None:
    """One jump of all these bodies at a frame; None where it is no jump."""
    c = current().kicks
    size = sum(float(w.across @ w.across) for w in windows)
    toward = np.sum([w.across @ w.places / (w.noise * np.sqrt(w.variance)) for w in windows], axis=0)
    gain = float(toward @ toward) / size
    if gain <= c.sure:
        return None
    change = toward / size
    freedom = 2 * (2 * c.half - c.smooth - 1)
    smooth = off = turning = kinked = 0.0
    for w in windows:
        scaled = w.places[None].swapaxes(1, 2) / w.noise
        moved = scaled - (change[:, None] * np.repeat([0.0, 1.0], c.half))[None] / w.noise
        after = float(left_by(c.smooth, w.s[None], moved)[0]) / w.variance
        if after > c.most * freedom:  # this body does not jump with the others
            return None
        off += after
        smooth += float(left_by(c.smooth, w.s[None], scaled)[0]) / w.variance
        turning += float(left_by(c.turning, w.s[None], scaled)[0]) / w.variance
        kinked += with_step(w.s, scaled[0].T, c.half)[0] / w.variance
    ahead = min(smooth - off - c.sure, turning - off - c.turns, kinked - off - c.turns)
    if not ahead > 0:
        return None
    first, last = min(int(w.rows[0]) for w in windows), max(int(w.rows[-1]) for w in windows)
    return Jump(row, t, change, first, last, gain)


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
