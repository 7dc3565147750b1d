"""A recording: what was seen of some bodies, and the scene as the experimenter believes it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..scene import Scene

CURVE_FIELDS = ("frequency", "layers", "speed", "speed_sem", "n")
CURVE = np.dtype([(name, float) for name in CURVE_FIELDS])


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
    xy : (T, n, 2) positions [m], NaN where not seen (always both coordinates)
    angle : (T, n) angles [rad], NaN where not measured, or None; of a pinned body: its rod's, 0 hanging
    sampling : nominal frame rate [Hz] or None
    position_noise, angle_noise : one standard deviation [m], [rad], None where unknown
    curve : None or structured (k,) with frequency [Hz], layers, speed, speed_sem [m/s], n (NaN: not given)
    folder : where it was read from, or None

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
    curve: np.ndarray | None = None
    folder: Path | None = None

    def __post_init__(self) -> None:
        frozen = {"t": self.t, "xy": self.xy, "angle": self.angle}
        for key, values in frozen.items():
            if values is not None:
                array = np.array(values, dtype=float)
                array.setflags(write=False)
                object.__setattr__(self, key, array)
        object.__setattr__(self, "ids", tuple(self.ids))
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
        if np.any(np.isnan(self.xy[..., 0]) != np.isnan(self.xy[..., 1])):
            raise self._error("a position has one coordinate only")
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
        seen = np.isfinite(self.xy[..., 0])
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
