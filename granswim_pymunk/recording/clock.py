"""Are the frames' times those of one film? Stray stamps, long gaps, and a clock in another unit.

Whatever compares a simulation with a recording runs from the first frame to the last, through every gap. One wrong
stamp would make it run for the wrong one.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..scene import SceneWarning
from .recording import Recording

LONGEST_GAP = 10.0  # times all the rest of the recording: beyond, a stamp is wrong or these are two films
MOST_EMPTY = 100.0  # frame intervals for each frame: a recording may be as sparse as this, not sparser
FEWEST_INTERVALS = 50.0  # a gap shorter than this is never refused
NOTED_GAP = 0.5  # times the rest: such a gap is said


def check_clock(recording: Recording, rows: Sequence[int] | None = None) -> None:
    """Refuse a recording whose times cannot be one film; warn (SceneWarning) of a long gap and of another frame rate.

    rows : line of the first row of each frame in tracks.csv, for the messages; frames are counted from 0 without it.
    Raises InputError naming the row.
    """
    _check_rate(recording)
    _check_gaps(recording, rows)


def _check_gaps(recording: Recording, rows: Sequence[int] | None) -> None:
    """The longest way from one frame to the next, against all other ways and against the frame interval."""
    t = recording.t
    if len(t) < 3:
        return
    steps = np.diff(t)
    at = int(np.argmax(steps))
    gap = float(steps[at])
    rest = float(np.delete(steps, at).sum())
    interval = float(np.median(steps))
    if recording.sampling:
        interval = min(interval, 1 / recording.sampling)
    if gap <= FEWEST_INTERVALS * interval:
        return
    before, after = (f"row {rows[k]}" if rows is not None else f"frame {k}" for k in (at, at + 1))
    empty = (t[-1] - t[0]) / interval > MOST_EMPTY * len(t)
    if gap > LONGEST_GAP * rest or empty:
        # the side with fewer frames is the one that has strayed
        wrong, other, k = (before, after, at) if at + 1 <= len(t) - at - 1 else (after, before, at + 1)
        side = "before" if k == at else "after"
        nearest = t[2 * at + 1 - k]
        raise InputError(
            f"t = {t[k]:.10g} s is {gap:.3g} s {side} the nearest frame ({other}, t = {nearest:.10g} s), where "
            f"frames are {interval:.3g} s apart and all the rest lasts {rest:.3g} s: correct the time stamp, leave "
            "these rows out, or make two recordings of it",
            file=recording.folder,
            where=wrong,
        )
    if gap > NOTED_GAP * rest:
        warnings.warn(
            f"{recording.folder}: nothing is seen for {gap:.3g} s, from {before} (t = {t[at]:.10g} s) to {after}; "
            f"the rest lasts {rest:.3g} s",
            SceneWarning,
            stacklevel=4,
        )


def _check_rate(recording: Recording) -> None:
    """The frame interval of the tracks against the nominal rate."""
    if recording.sampling is None or len(recording.t) < 3:
        return
    steps = np.diff(recording.t)
    shortest, typical = float(steps.min()) * recording.sampling, float(np.median(steps)) * recording.sampling
    numbered = bool(np.all(recording.t == np.round(recording.t))) and typical > 5
    if shortest > 100 or typical < 0.01 or numbered:
        ratio = shortest if shortest > 100 else typical
        raise InputError(
            f"units look mixed: frames are {ratio / recording.sampling:.3g} apart, the sampling of "
            f"{recording.sampling:g} "
            f"Hz says {1 / recording.sampling:.3g} s; is t in ms, or a frame number? It should be in s",
            file=recording.folder,
        )
    if shortest > 5 or typical < 0.2:
        warnings.warn(
            f"{recording.folder}: frames are {typical / recording.sampling:.3g} s apart, but sampling is "
            f"{recording.sampling:g} Hz",
            SceneWarning,
            stacklevel=4,
        )
