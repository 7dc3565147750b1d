"""How fast a swimmer goes, with an error from blocks of time, and averages with a 95 % error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..distributions import t as student
from ..errors import InputError
from ..recording import Recording


@dataclass(frozen=True)
class Speed:
    """A swimming speed [m/s], head first positive.

    value, error : mean and half width of its 95 % interval, from the scatter of the blocks
    along_x : the same displacement measured towards -x, where the swimmer was put to point
    blocks : (b,) speed in each block;  turn : angle that the heading turned through [rad]
    """

    value: float
    error: float
    along_x: float
    blocks: np.ndarray
    turn: float


def mean_error(values: np.ndarray, axis: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Mean and half width of its 95 % interval, Student t on n - 1; NaN are left out, n < 2 gives NaN."""
    values = np.asarray(values, dtype=float)
    n = np.isfinite(values).sum(axis=axis)
    filled = np.where(np.isfinite(values), values, 0.0)
    mean = filled.sum(axis=axis) / np.where(n > 0, n, np.nan)
    apart = np.where(np.isfinite(values), values - np.expand_dims(mean, axis), 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = np.sqrt((apart**2).sum(axis=axis) / (n - 1))
        error = student.ppf(0.975, np.maximum(n - 1, 1)) * spread / np.sqrt(n)
    return mean, np.where(n > 1, error, np.nan)


def center_of_mass(xy: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """(T, 2) of xy (T, n, 2) [m] and masses (n,)."""
    return np.einsum("tna,n->ta", xy, mass) / float(np.sum(mass))


def heading(xy: np.ndarray) -> np.ndarray:
    """(T, 2) unit vector from tail to head, xy (T, n, 2) head first."""
    ahead = xy[:, 0] - xy[:, -1]
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)


def swimming_speed(
    t: np.ndarray, xy: np.ndarray, mass: np.ndarray, frequency: float, settle: float = 0.5
) -> Speed:
    """Speed of the centre of mass along the body's own axis, in blocks of whole cycles.

    t (T,) [s], xy (T, n, 2) [m] unwrapped, head first, mass (n,), frequency of the drive [Hz]; what comes
    before ``settle`` [s] after the start is left out. In each block of one cycle (longer where frames are
    few) the displacement of the centre is projected on the mean heading of the block. Neighbouring blocks
    are joined until their scatter gives no larger error (Flyvbjerg & Petersen 1989, J. Chem. Phys. 91, 461).
    Raises InputError with fewer than two cycles.
    """
    t = np.asarray(t, dtype=float)
    begin = t[0] + settle
    cycles = int(np.floor((t[-1] - begin) * frequency + 1e-9)) if len(t) else 0
    if cycles < 2 or len(t) < 4:
        raise InputError(f"needs two cycles of {frequency:g} Hz after {settle:g} s", where="speed")
    edges = begin + np.arange(cycles + 1) / frequency
    center = center_of_mass(xy, mass)
    place = np.column_stack([np.interp(edges, t, center[:, k]) for k in (0, 1)])
    ahead = heading(xy)
    # integrals of the heading, so that a block's mean needs no frame at its edge
    area = np.vstack([[0.0, 0.0], np.cumsum(0.5 * (ahead[1:] + ahead[:-1]) * np.diff(t)[:, None], axis=0)])
    total = np.column_stack([np.interp(edges, t, area[:, k]) for k in (0, 1)])
    mean = np.diff(total, axis=0)
    mean = mean / np.linalg.norm(mean, axis=1, keepdims=True)
    steps = np.diff(place, axis=0)
    blocks = np.einsum("ba,ba->b", steps, mean) * frequency
    angle = np.unwrap(np.arctan2(mean[:, 1], mean[:, 0]))
    return Speed(
        value=float(blocks.mean()),
        error=block_error(blocks),
        along_x=float(-(place[-1, 0] - place[0, 0]) / (edges[-1] - edges[0])),
        blocks=blocks,
        turn=float(angle[-1] - angle[0]),
    )


def block_error(values: np.ndarray) -> float:
    """95 % half width of the mean of a correlated series: the largest over blocks of 1, 2, 4 ... values.

    At least four blocks are kept where there are as many values.
    """
    series = np.asarray(values, dtype=float)
    error = 0.0
    while True:
        found = float(mean_error(series)[1])
        error = max(error, found) if np.isfinite(found) else error
        if len(series) < 8:
            return error if error > 0 or len(values) > 1 else float("nan")
        series = 0.5 * (series[0 : len(series) // 2 * 2 : 2] + series[1 : len(series) // 2 * 2 : 2])


def recording_speed(recording: Recording, settle: float = 0.5, swimmer: int = 0) -> Speed:
    """Speed of a recorded swimmer; frames where a disk was not seen are left out.

    The frequency is that of the scene's bending law. Raises InputError without swimmer, law or frames.
    """
    chains = recording.scene.chains
    if swimmer >= len(chains):
        raise InputError("has no such swimmer", where=f"recording {recording.name}")
    laws = recording.scene.laws_named("bending")
    if not laws:
        raise InputError("has no bending law that would give the frequency", where=f"recording {recording.name}")
    bodies = [recording.scene.bodies[k] for k in chains[swimmer]]
    columns = [recording.column(b.id) for b in bodies]
    xy = recording.unwrapped().xy[:, columns]
    seen = np.isfinite(xy).all(axis=(1, 2))
    mass = np.array([b.mass for b in bodies])
    return swimming_speed(recording.t[seen], xy[seen], mass, laws[0].values["frequency"], settle)


__all__ = [
    "Speed", "block_error", "center_of_mass", "heading", "mean_error", "recording_speed", "swimming_speed",
]
