"""The swimmer's shape: overlays in the co-moving frame, and how each segment follows the head's axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .speed import center_of_mass, heading


def comoving_shapes(
    t: np.ndarray,
    xy: np.ndarray,
    mass: np.ndarray,
    frequency: float,
    cycles: float = 1.0,
    count: int = 20,
    upright: bool = True,
) -> np.ndarray:
    """(count, n, 2) shapes [m] over the last ``cycles``, the centre of mass at the origin.

    t (T,) [s], xy (T, n, 2) [m] head first, mass (n,). ``upright``: turned so that the mean heading over
    these cycles is -x, as the swimmer was put. Raises InputError where the record is shorter.
    """
    begin = t[-1] - cycles / frequency
    if begin < t[0]:
        raise InputError(f"is shorter than {cycles:g} cycles of {frequency:g} Hz", where="shape")
    relative = xy - center_of_mass(xy, mass)[:, None]
    if upright:
        ahead = heading(xy)[t >= begin].mean(axis=0)
        c, s = -ahead / np.hypot(*ahead)
        relative = relative @ np.array([[c, -s], [s, c]])
    times = np.linspace(begin, t[-1], count)
    flat = relative.reshape(len(t), -1)
    return np.stack([np.interp(times, t, column) for column in flat.T], axis=-1).reshape(count, *xy.shape[1:])


@dataclass(frozen=True)
class Response:
    """How the segments oscillate at the drive's frequency.

    amplitude : (n - 1,) [rad] of each segment's angle, head first
    lag : (n - 1,) [rad] behind sin(2 pi f t), unwrapped from the head to the tail
    tail : amplitude of the last disk's oscillation across the mean heading [m]
    """

    amplitude: np.ndarray
    lag: np.ndarray
    tail: float


def segment_response(t: np.ndarray, xy: np.ndarray, mass: np.ndarray, frequency: float) -> Response:
    """Amplitude and phase of the segments' angles against the head axis A sin(2 pi f t), by least squares.

    t (T,) [s] on the drive's clock, xy (T, n, 2) [m] head first. A constant and a slope (the swimmer turning)
    are fitted along.
    """
    segment = np.diff(xy, axis=1)
    angle = np.unwrap(np.arctan2(segment[..., 1], segment[..., 0]), axis=0)
    phase = 2 * np.pi * frequency * t
    design = np.column_stack([np.sin(phase), np.cos(phase), np.ones_like(t), t - t.mean()])
    fit = np.linalg.lstsq(design, angle, rcond=None)[0]
    amplitude = np.hypot(fit[0], fit[1])
    lag = np.unwrap(np.arctan2(-fit[1], fit[0]))
    ahead = heading(xy).mean(axis=0)
    across = (xy[:, -1] - center_of_mass(xy, mass)) @ np.array([-ahead[1], ahead[0]]) / np.hypot(*ahead)
    tail = np.linalg.lstsq(design, across, rcond=None)[0]
    return Response(amplitude, lag, float(np.hypot(tail[0], tail[1])))


__all__ = ["Response", "comoving_shapes", "segment_response"]
