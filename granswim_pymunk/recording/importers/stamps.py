"""Stamps that were rounded until rows of one body share a time, told from bodies that are not told apart."""

from __future__ import annotations

import numpy as np

EVEN = 0.5  # of a step, by which stamps of one clock are off it at the most: beyond, they would be another frame
LEFT_OUT = 1.5  # times the usual step of the stamps, from which a frame is left out for all bodies
OFTEN = 0.1  # of the steps, that are as short as a frame where most have lost one
MULTIPLE = 0.1  # of a frame, by which steps are off whole numbers of them at the most
TOGETHER = 3  # rows of one body that rounding gives one time: more are other bodies, or an end of the clock
NEARER = 2.0  # times as far apart as every other row are neighbouring rows where bodies take turns


def look_rounded(t: np.ndarray, *seen: np.ndarray | None) -> bool:
    """Whether rows, (k,) times and coordinates in the file's order, are of one body whose stamps were rounded.

    Rows of one time are neighbours and few, and each row lies as near to the next one as to the one after that; where
    bodies take turns, every other row is near.
    """
    times, counts = np.unique(t, return_counts=True)
    shared = np.flatnonzero(np.diff(t) == 0)
    neighbours = len(shared) == len(t) - len(times)
    if not len(shared) or not neighbours or counts.max() > TOGETHER or (np.diff(t) < 0).any():
        return False
    shared = shared[shared + 2 < len(t)]
    places = np.stack([c for c in seen if c is not None and np.isfinite(c).any()])
    next_one = np.hypot.reduce(places[:, shared + 1] - places[:, shared])
    after = np.hypot.reduce(places[:, shared + 2] - places[:, shared])
    known = np.isfinite(next_one) & np.isfinite(after)
    return bool(known.any()) and float(np.median(next_one[known])) <= NEARER * float(np.median(after[known]))


def rounded(t: np.ndarray, rows: str) -> str:
    """What is said of such rows. t : (k,) [s];  rows : which two share a time"""
    about = f" (about {(len(t) - 1) / float(np.ptp(t)):.3g})" if np.ptp(t) > 0 else ""
    return (
        f"its times are rounded: {rows} are of one body and have one time. Say the frame rate, --fps RATE{about}, and "
        "in a table name the columns of places alone (--columns x=X,y=Y): each row is then the next frame"
    )


def usual_step(steps: np.ndarray) -> float:
    """The step of a clock [s] by those of its stamps (k,): their median, or a shorter one of which all are multiples.

    Where every second or third frame is lost most steps are two frames long. Not a power of ten, of which stamps are
    multiples that were rounded to so many digits.
    """
    usual = float(np.median(steps))
    short = steps[steps < LEFT_OUT * steps.min()]
    step = float(np.mean(short))
    if not step > 0 or np.isclose(np.log10(step), np.rint(np.log10(step)), rtol=0, atol=1e-6):
        return usual
    off = float(np.max(np.abs(steps / step - np.rint(steps / step))))
    return step if LEFT_OUT * step < usual and len(short) > OFTEN * len(steps) and off < MULTIPLE else usual


def frame_rate(t: np.ndarray) -> float:
    """Frames a second of stamps (T,) [s], two or more: of all of them together, where they belong to one clock.

    A stamp that was rounded to a millisecond tells a step of 33 ms to three per cent, a hundred of them to a part in
    3000. Where frames follow one another unevenly it is one over the usual step.
    """
    steps = np.diff(t)
    usual = float(np.mean(steps[steps < LEFT_OUT * usual_step(steps)]))
    frames = np.concatenate([[0.0], np.cumsum(np.rint(steps / usual))])
    rate = frames[-1] / float(t[-1] - t[0])
    off = float(np.max(np.abs(t - t[0] - frames / rate)))
    return rate if rate > 0 and off < EVEN * usual else 1.0 / float(np.median(steps))
