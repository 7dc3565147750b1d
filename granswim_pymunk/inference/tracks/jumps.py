"""A picture that jumps at once: somebody ran against the camera while it filmed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..criteria import current
from ..data import Case
from ..hypothesis import Free, Term
from .frames import Windows, left_by, off_polynomials, windows_of
from .kicks import with_step
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


def jumps_of(case: Case) -> list[Jump]:
    """Jumps of the whole picture, in order of time.

    In windows of frames about two that follow each other a cubic for each body and one jump for all have to follow,
    and to be ahead by far of cubics without it, of polynomials of fifth degree, and of velocities that step.
    """
    asked = ("jumps", current().kicks)
    if asked not in case.told:
        case.told[asked] = _found_jumps(case)
    return list(case.told[asked])


def _found_jumps(case: Case) -> list[Jump]:
    c = current().kicks
    size, toward = np.zeros(len(case.t)), np.zeros((len(case.t), 2))
    every = [windows_of(case, body, xy, noise) for body, (xy, noise) in paths_of(case).items() if noise > 0]
    followed = [windows for windows in every if windows is not None]
    for w in followed:
        # what of a jump a cubic does not follow, and its normal equations
        step = np.broadcast_to(_step(), (len(w.s), 1, 2 * c.half))
        across, rows, whole = off_polynomials(c.smooth, w.s, step)[:, 0], w.rows[:, c.half], w.whole
        np.add.at(size, rows[whole], (np.sum(across**2, axis=1) / (w.variance * w.noise**2))[whole])
        along = np.einsum("wn,wkn->wk", across, w.places) / (w.variance * w.noise)[:, None]
        np.add.at(toward, rows[whole], along[whole])
    gain = np.sum(toward**2, axis=1) / np.maximum(size, np.finfo(float).tiny)
    found = []
    for row in np.flatnonzero(gain > c.sure).tolist():
        mine = [(w, k) for w in followed for k in np.flatnonzero((w.rows[:, c.half] == row) & w.whole).tolist()]
        if _is_jump(mine, toward[row] / size[row]):
            first, last = min(int(w.rows[k, 0]) for w, k in mine), max(int(w.rows[k, -1]) for w, k in mine)
            found.append(Jump(row, float(case.t[row]), toward[row] / size[row], first, last, float(gain[row])))
    kept: list[Jump] = []
    for jump in sorted(found, key=lambda j: -j.ahead):
        if all(abs(jump.row - other.row) > 2 * c.half for other in kept):
            kept.append(jump)
    return sorted(kept, key=lambda j: j.t)


def _step() -> np.ndarray:
    """(n,) a jump of one in the middle of a window."""
    return np.repeat([0.0, 1.0], current().kicks.half)


def _is_jump(windows: Sequence[tuple[Windows, int]], change: np.ndarray) -> bool:
    """Whether one ``change`` (2,) [m] of the places of all these bodies is ahead of all that goes without it.

    windows : of each body, and which of them
    """
    c = current().kicks
    freedom = 2 * (2 * c.half - c.smooth - 1)
    smooth = off = turning = kinked = 0.0
    for w, k in windows:
        s, places, variance = w.s[k : k + 1], w.places[k : k + 1], float(w.variance[k])
        after = float(left_by(c.smooth, s, places - np.outer(change / w.noise, _step()))[0]) / variance
        if after > c.most * freedom:  # this body does not jump with the others
            return False
        off += after
        smooth += float(left_by(c.smooth, s, places)[0]) / variance
        turning += float(left_by(c.turning, s, places)[0]) / variance
        kinked += with_step(s[0], places[0].T, c.half)[0] / variance
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
