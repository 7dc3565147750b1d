"""What an exporter gets: the frames of a run or a recording, in SI, and what it may do with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..recording import Recording
from ..scene import ROLES, Scene
from ..trajectory import Trajectory, read_trajectory

DEPTH = 1.0  # thickness of the box along z, in largest diameters: the motion is in the plane z = 0


@dataclass(frozen=True)
class Frames:
    """Bodies over time.

    t, step : (T,) times [s] and numbers of time steps (of a recording: of frames)
    xy : (T, n, 2) positions [m], unwrapped, NaN where not seen;  v : (T, n, 2) [m/s] or None
    more : values of each body, (T, n): angle [rad], spin [rad/s], contact_force [N]
    ids, roles, radius [m], mass [kg] : of the n bodies;  periodic_x : [m] or None
    """

    name: str
    title: str
    scene: Scene
    t: np.ndarray
    step: np.ndarray
    xy: np.ndarray
    v: np.ndarray | None
    ids: tuple[str, ...]
    roles: tuple[str, ...]
    radius: np.ndarray
    mass: np.ndarray
    periodic_x: float | None
    more: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """Whether every body is seen in every frame."""
        return bool(np.isfinite(self.xy).all())

    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Origin (3,) and edges (3,) [m] of a box around everything; along a periodic x it is the period."""
        reach = self.radius[:, None] if len(self.radius) else np.zeros((1, 1))
        low = np.nanmin(np.nanmin(self.xy, axis=0) - reach, axis=0)
        high = np.nanmax(np.nanmax(self.xy, axis=0) + reach, axis=0)
        if self.periodic_x:
            low[0], high[0] = 0.0, self.periodic_x
        thick = 2 * DEPTH * float(self.radius.max())
        return np.array([*low, -thick / 2]), np.array([*(high - low), thick])

    def points(self, frame: int) -> np.ndarray:
        """(n, 3) positions of a frame [m], wrapped into the box along a periodic x, z = 0."""
        xy = self.xy[frame].copy()
        if self.periodic_x:
            xy[:, 0] %= self.periodic_x
        return np.concatenate([xy, np.zeros((len(xy), 1))], axis=1)

    def velocities(self, frame: int) -> np.ndarray:
        """(n, 3) [m/s], zero where the velocity is not known."""
        flat = np.zeros((len(self.ids), 3))
        if self.v is not None:
            flat[:, :2] = self.v[frame]
        return flat


@dataclass(frozen=True)
class Exporter:
    """A format by name: its ending, what opens it, and the function that writes it."""

    name: str
    suffix: str
    help: str
    write: Callable[[Frames, Path], None]


def frames_of_trajectory(trajectory: Trajectory, name: str) -> Frames:
    return Frames(
        name=name,
        title=trajectory.scene.title,
        scene=trajectory.scene,
        t=trajectory.t,
        step=trajectory.step,
        xy=trajectory.xy,
        v=trajectory.v,
        ids=trajectory.ids,
        roles=trajectory.roles,
        radius=trajectory.radius,
        mass=trajectory.mass,
        periodic_x=trajectory.scene.periodic_x,
        more=dict(trajectory.more),
    )


def frames_of_recording(recording: Recording) -> Frames:
    """The tracks of a recording; bodies that are never seen are left out."""
    bodies = [recording.scene.bodies[row] for row in recording.track_rows]
    unwrapped = recording.unwrapped()
    return Frames(
        name=recording.name,
        title=recording.title,
        scene=recording.scene,
        t=unwrapped.t,
        step=np.arange(len(unwrapped.t)),
        xy=unwrapped.xy,
        v=None,
        ids=recording.ids,
        roles=tuple(b.role for b in bodies),
        radius=np.array([b.radius for b in bodies]),
        mass=np.array([b.mass for b in bodies]),
        periodic_x=recording.scene.periodic_x,
        more={} if recording.angle is None else {"angle": recording.angle},
    )


def open_frames(source: str | Path, every: int = 1) -> Frames:
    """The frames of a run's folder, its trajectory.h5, or a recording; each ``every``-th. Raises InputError."""
    from ..recording import read_recording, resolve_recording

    path = Path(source)
    if every < 1:
        raise InputError(f"should be one or more, got {every}", where="every")
    if path.is_dir() and (path / "trajectory.h5").is_file():
        frames = frames_of_trajectory(read_trajectory(path / "trajectory.h5"), path.resolve().name)
    elif path.is_file():
        frames = frames_of_trajectory(read_trajectory(path), path.stem)
    else:
        folders = resolve_recording(source)
        if len(folders) > 1:
            listed = ", ".join(folder.name for folder in folders[:4])
            raise InputError(f"is several recordings ({listed} ...): say which", file=source)
        if not (folders[0] / "recording.toml").is_file():
            raise InputError("is neither a run (trajectory.h5) nor a recording", file=source)
        frames = frames_of_recording(read_recording(folders[0]))
    if not len(frames.t):
        raise InputError("has no frames", file=source)
    return frames if every == 1 else thin(frames, every)


def thin(frames: Frames, every: int) -> Frames:
    from dataclasses import replace

    some = slice(None, None, every)
    return replace(
        frames,
        t=frames.t[some],
        step=frames.step[some],
        xy=frames.xy[some],
        v=None if frames.v is None else frames.v[some],
        more={name: values[some] for name, values in frames.more.items()},
    )


def species(roles: tuple[str, ...]) -> tuple[list[str], list[int]]:
    """Names of the roles that occur, and the number of each body's."""
    used = [role for role in ROLES if role in roles]
    return used, [used.index(role) for role in roles]


def need_positions(frames: Frames, path: Path, what: str) -> None:
    """Raise InputError where a format that has no gaps would have to invent a place."""
    if not np.isfinite(frames.xy).any():
        raise InputError("has angles only, no positions", file=path)
    if not frames.complete:
        raise InputError(
            f"{what} cannot say that a body is not seen: xyz, csv, parquet and vtk leave it out", file=path
        )
