"""Frames of one body in windows of so many: what is smooth in them, and what a polynomial leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..criteria import current
from ..data import Case


@dataclass(frozen=True)
class Windows:
    """All windows of one body, w of them of n frames.

    rows, times [s], s : (w, n) of the frames, and their times from 0 to 1;  span : (w,) [s]
    places : (w, 2, n) over the ``noise`` [m];  variance : (w,) of these, as errors of the stamps make it
    """

    rows: np.ndarray
    times: np.ndarray
    span: np.ndarray
    s: np.ndarray
    places: np.ndarray
    variance: np.ndarray
    noise: float

    @property
    def whole(self) -> np.ndarray:
        """(w,) which have no more than so many lost frames among theirs."""
        return np.asarray(self.span < current().kicks.gap * np.median(self.span))


def windows_of(case: Case, body: str, xy: np.ndarray, noise: float) -> Windows | None:
    """Windows of a body's places xy (T, 2) [m]; None where too few of them are seen."""
    seen, size = np.flatnonzero(np.isfinite(xy).all(axis=1)), 2 * current().kicks.half
    if len(seen) < size:
        return None
    rows, places = sliding_window_view(seen, size), sliding_window_view(xy[seen] / noise, size, axis=0)
    times = case.t[rows]
    span = np.ptp(times, axis=1)
    s = (times - times[:, :1]) / span[:, None]
    variance = sliding_window_view(_variance_of(case, body)[seen], size).mean(axis=1)
    return Windows(rows, times, span, s, places, variance, noise)


def _variance_of(case: Case, body: str) -> np.ndarray:
    """(T,) by how much errors of the stamps make the variance of the places of a body larger than noise does."""
    own = [k for k, channel in enumerate(case.channels) if channel.body == body and channel.kind in ("x", "y")]
    return np.ones(len(case.t)) if case.late is None else 1 + np.mean(case.late[:, own] ** 2, axis=1)


def off_polynomials(degree: int, s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(w, k, n) what polynomials of a degree at s (w, n) leave of ``values`` (w, k, n)."""
    q, _ = np.linalg.qr(np.power(s[..., None], np.arange(degree + 1)))
    return np.asarray(values - np.einsum("wpk,wlk,wcl->wcp", q, q, values, optimize=True))


def left_by(degree: int, s: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(w,) sums of squares that polynomials of a degree at s (w, n) leave of ``places`` (w, 2, n)."""
    return np.asarray(np.sum(off_polynomials(degree, s, places) ** 2, axis=(1, 2)))
