"""A recording: what was seen of some bodies, and the scene as the experimenter believes it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..limits import one_title
from ..scene import Scene
from .backdrop import Backdrop

CURVE_FIELDS = ("frequency", "layers", "speed", "speed_sem", "n")
CURVE = np.dtype([(name, float) for name in CURVE_FIELDS])

# what the experimenter knows of the measurement, and its unit; None where it is not known
NUMBERS = {
    "sampling": "Hz",
    "position_noise": "m",
    "angle_noise": "rad",
    "tolerance": "m",
    "angle_tolerance": "rad",
    "time_noise": "s",
    "radius_error": "relative",
    "mass_error": "relative",
}


def checked_number(key: str, value: object) -> float | None:
    """One of NUMBERS as a float, or None. Raises InputError where it is negative, not finite or no number."""
    if value is None:
        return None
    unit = NUMBERS[key]
    number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    if not number or not 0 <= value < math.inf:  # type: ignore[operator]
        raise InputError(f"should be a number, not below zero [{unit}], got {value!r}", where=key)
    if key == "sampling" and value == 0:
        raise InputError("should be above zero [Hz]", where=key)
    if unit == "relative" and value >= 1:  # type: ignore[operator]
        raise InputError(f"should be a share below 1 (0.02 for 2 %), got {value!r}", where=key)
    return float(value)  # type: ignore[arg-type]


def rail_axes(scene: Scene) -> dict[str, int]:
    """Bodies on a rail along x (0) or y (1); their other coordinate need not be measured."""
    found: dict[str, int] = {}
    for item in scene.laws_named("rail"):
        x, y = (abs(float(v)) for v in scene.resolved(item)["direction"])
        if min(x, y) <= 1e-9 * max(x, y):
            on = item.bodies if item.bodies is not None else tuple(b.id for b in scene.bodies if b.mobile)
            found |= dict.fromkeys(on, 0 if x > y else 1)
    return found


class Track(NamedTuple):
    """One body in the frames where it was seen: t (k,) [s], xy (k, 2) [m], angle (k,) [rad] or None."""

    t: np.ndarray
    xy: np.ndarray
    angle: np.ndarray | None


@dataclass(frozen=True, eq=False)
class Recording:
    """Tracks in SI; a filmed experiment, an imported file and a filmed simulation give the same.

    name : how reports call it (the folder's name)
    scene : bodies, box and laws of the naive simulation; commands of the apparatus in ``scene.inputs``
    t : (T,) frame times [s], rising
    ids : the n bodies that were seen at least once, in the scene's order
    xy : (T, n, 2) positions [m], NaN where not seen: both coordinates, or the one across a rail along x or y
    angle : (T, n) angles [rad], NaN where not measured, or None; of a pinned body: its rod's, 0 hanging
    sampling : nominal frame rate [Hz]
    position_noise, angle_noise : one standard deviation [m], [rad] of the camera's white noise
    tolerance, angle_tolerance : smaller differences [m], [rad] (rms) do not matter to the experimenter
    time_noise : error of the stamps [s];  radius_error, mass_error : relative, one standard deviation
    curve : None or structured (k,) with frequency [Hz], layers, speed, speed_sem [m/s], n (NaN: not given)
    folder : where it was read from, or None;  notes : what was said when it was read
    film : what the tracks were read from and where it lies, only to be shown; None where there is none

    All numbers are None where unknown.
    Raises InputError where shapes, order or NaN do not fit.
    """

    name: str
    scene: Scene
    t: np.ndarray
    ids: tuple[str, ...]
    xy: np.ndarray
    angle: np.ndarray | None = None
    title: str = ""
    sampling: float | None = None
    position_noise: float | None = None
    angle_noise: float | None = None
    tolerance: float | None = None
    angle_tolerance: float | None = None
    time_noise: float | None = None
    radius_error: float | None = None
    mass_error: float | None = None
    curve: np.ndarray | None = None
    folder: Path | None = None
    notes: tuple[str, ...] = ()
    film: Backdrop | None = None

    def __post_init__(self) -> None:
        frozen = {"t": self.t, "xy": self.xy, "angle": self.angle}
        for key, values in frozen.items():
            if values is not None:
                array = np.array(values, dtype=float)
                array.setflags(write=False)
                object.__setattr__(self, key, array)
        object.__setattr__(self, "ids", tuple(self.ids))
        object.__setattr__(self, "title", one_title(self.title))
        shape = (len(self.t), len(self.ids))
        if self.t.ndim != 1 or self.xy.shape != (*shape, 2):
            raise self._error(
                f"xy should have the shape (T, n, 2) = ({shape[0]}, {shape[1]}, 2), got {self.xy.shape}"
            )
        if self.angle is not None and self.angle.shape != shape:
            raise self._error(f"angle should have the shape (T, n) = {shape}, got {self.angle.shape}")
        if not np.all(np.isfinite(self.t)) or np.any(np.diff(self.t) <= 0):
            raise self._error("frame times should be finite and rise")
        order = {name: row for row, name in enumerate(self.scene.ids)}
        rows = [order.get(name, -1) for name in self.ids]
        if -1 in rows:
            raise self._error(f"body {self.ids[rows.index(-1)]} is not in the scene")
        if rows != sorted(set(rows)):
            raise self._error("bodies should stand in the order of the scene, each once")
        if half_seen(self.xy, self.ids, self.scene).any():
            raise self._error("a position has one coordinate only")
        for key in NUMBERS:
            try:
                object.__setattr__(self, key, checked_number(key, getattr(self, key)))
            except InputError as error:
                raise self._error(f"{key} {error.message}") from None
        if self.curve is not None and self.curve.dtype.names != CURVE_FIELDS:
            raise self._error(f"curve should have the fields {', '.join(CURVE_FIELDS)}")

    def _error(self, message: str) -> InputError:
        return InputError(message, file=self.folder, where=f"recording {self.name}")

    # ---- asking -------------------------------------------------------------------------------

    @property
    def track_rows(self) -> np.ndarray:
        """(n,) rows of ``scene.bodies`` that the columns of xy and angle belong to."""
        order = {name: row for row, name in enumerate(self.scene.ids)}
        return np.array([order[name] for name in self.ids], dtype=np.int64)

    @property
    def seen(self) -> np.ndarray:
        """(T, n) True where a position or an angle was measured."""
        seen = np.isfinite(self.xy).any(axis=2)
        return seen if self.angle is None else seen | np.isfinite(self.angle)

    def column(self, name: str) -> int:
        """Column of a body in xy and angle. Raises InputError where it was never seen."""
        try:
            return self.ids.index(name)
        except ValueError:
            raise self._error(f"body {name} has no track") from None

    def body(self, name: str) -> Track:
        """Times, positions and angles of one body in the frames where it was seen."""
        column = self.column(name)
        seen = self.seen[:, column]
        angle = None if self.angle is None else self.angle[seen, column]
        return Track(self.t[seen], self.xy[seen, column], angle)

    # ---- changing -----------------------------------------------------------------------------

    def select(self, times: slice | tuple[float, float] | np.ndarray) -> Recording:
        """Some frames: ``slice`` and arrays count frames, a pair (begin, end) is in seconds, both included.

        All bodies stay, also those that are not seen in these frames.
        """
        if isinstance(times, tuple):
            begin, end = times
            chosen: slice | np.ndarray = (self.t >= begin) & (self.t <= end)
        else:
            chosen = times
        angle = None if self.angle is None else self.angle[chosen]
        return replace(self, t=self.t[chosen], xy=self.xy[chosen], angle=angle)

    def unwrapped(self) -> Recording:
        """Positions followed across the periodic seam.

        Between two frames where a body is seen it is taken to move by less than half a period; the first
        position stays as it is. Without ``periodic_x`` nothing changes.
        """
        period = self.scene.periodic_x
        if period is None:
            return self
        xy = self.xy.copy()
        for column in range(len(self.ids)):
            seen = np.isfinite(xy[:, column, 0])
            xy[seen, column, 0] = np.unwrap(xy[seen, column, 0], period=period)
        return replace(self, xy=xy)

    def on_rails(self) -> Recording:
        """Coordinates across a rail that were not measured, set to where the rail runs.

        That is the body's ``initial``, else the median of what was measured of it, else 0.
        """
        xy = self.xy
        for name, along in rail_axes(self.scene).items():
            if name not in self.ids:
                continue
            column, across = self.ids.index(name), 1 - along
            missing = np.isnan(xy[:, column, across]) & np.isfinite(xy[:, column, along])
            if not missing.any():
                continue
            initial = self.scene.body(name).initial
            measured = xy[np.isfinite(xy[:, column, across]), column, across]
            place = initial[across] if initial is not None else float(np.median(measured)) if len(measured) else 0.0
            xy = xy.copy()
            xy[missing, column, across] = place
        return self if xy is self.xy else replace(self, xy=xy)

    # ---- text ---------------------------------------------------------------------------------

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.title}" if self.title else self.name]
        if len(self.t):
            rate = f", {self.sampling:g} Hz" if self.sampling else ""
            lines.append(f"  {len(self.t)} frames, {self.t[0]:g} .. {self.t[-1]:g} s{rate}")
            names = ", ".join(self.ids) if len(self.ids) <= 8 else f"{self.ids[0]} .. {self.ids[-1]}"
            share = float(np.mean(self.seen)) if self.seen.size else 0.0
            bodies = "body" if len(self.ids) == 1 else "bodies"
            lines.append(f"  {len(self.ids)} {bodies} seen ({names}), in {share:.0%} of the frames")
            measured = [
                f"{what} ({'noise unknown' if noise is None else f'noise {noise:.3g} {unit}'})"
                for what, noise, unit, values in (
                    ("positions", self.position_noise, "m", self.xy),
                    ("angles", self.angle_noise, "rad", self.angle),
                )
                if values is not None and np.isfinite(values).any()
            ]
            lines.append("  " + ", ".join(measured))
        if self.curve is not None:
            lines.append(f"  curve of {len(self.curve)} speeds")
        if self.scene.inputs:
            lines.append(f"  commands: {', '.join(self.scene.inputs)}")
        lines += ["  " + line for line in str(self.scene).splitlines()[1:]]
        return "\n".join(lines)


def half_seen(xy: np.ndarray, ids: Sequence[str], scene: Scene) -> np.ndarray:
    """(T, n) True where one coordinate is missing and no rail along the other one makes up for it.

    xy : (T, n, 2) [m] of the bodies ``ids``.
    """
    missing = np.isnan(xy)
    wrong = missing[..., 0] != missing[..., 1]
    if wrong.any():
        axes = rail_axes(scene)
        for column, name in enumerate(ids):
            if name in axes:
                wrong[:, column] &= missing[:, column, axes[name]]
    return wrong
