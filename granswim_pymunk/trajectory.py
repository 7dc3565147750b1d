"""Trajectories: float64, HDF5 in H5MD layout (de Buyl, Colberg & Hoefling 2014, Comput. Phys. Commun. 185,
1546; doi:10.1016/j.cpc.2014.01.018), written frame by frame.

::

    h5md                            version, author, creator
    particles/all/box               dimension, boundary, edges [m]
    particles/all/position          step, time [s], value (T, n, 2) [m], unwrapped along a periodic x
    particles/all/velocity          value (T, n, 2) [m/s]
    particles/all/angle, spin       value (T, n) [rad], [rad/s], where bodies turn
    particles/all/contact_force     value (T, n) [N], sum of the normal forces on a body
    particles/all/id, species, radius, mass
    observables/kinetic_energy ...  step, time, value (T,)
    parameters/scene                the scene as TOML

The root and ``parameters`` carry the scene's hash as an attribute; the TOML of a bed is longer than HDF5
allows an attribute to be, so it stands in a dataset.
"""

from __future__ import annotations

import getpass
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from . import __version__
from .errors import InputError
from .files import Reserved, refuse_links
from .scene import ROLES, Scene, scene_from_dict

if TYPE_CHECKING:
    from .snapshot import State

UNITS = {"position": "m", "velocity": "m s-1", "angle": "rad", "spin": "rad s-1", "contact_force": "N"}


@dataclass(frozen=True)
class Trajectory:
    """States of a run, rows of bodies in the order of ``scene.bodies``.

    step, t : (T,) step count and time [s]
    xy, v : (T, n, 2) positions [m], unwrapped, and velocities [m/s] at those times
    more : further values of each body, (T, n): angle [rad], spin [rad/s], contact_force [N]
    observables : values of the whole scene, (T,) or (T, k)
    """

    scene: Scene
    scene_hash: str
    step: np.ndarray
    t: np.ndarray
    xy: np.ndarray
    v: np.ndarray
    ids: tuple[str, ...]
    roles: tuple[str, ...]
    radius: np.ndarray
    mass: np.ndarray
    more: Mapping[str, np.ndarray] = field(default_factory=dict)
    observables: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.t)

    def state(self, frame: int) -> State:
        """One frame as the engine gives it."""
        from .snapshot import State

        zero = np.zeros(len(self.ids))
        angle = self.more["angle"][frame] if "angle" in self.more else zero
        spin = self.more["spin"][frame] if "spin" in self.more else zero
        return State(t=float(self.t[frame]), xy=self.xy[frame], v=self.v[frame], angle=angle, spin=spin)


# bytes that HDF5 may need beside the numbers: for the trees in which it finds its chunks, and for everything else
_EACH_CHUNK = 8192
_EACH_FILE = 16384


class TrajectoryWriter:
    """Writes a trajectory frame by frame; what has been added can be read even if the program is killed.

    Room for a state is reserved before it is written: on a full disk ``add`` raises OSError, and the states before
    can be read. Use as a context manager. ``add`` takes positions (n, 2) [m], velocities (n, 2) [m/s], ``more``
    values (n,) of each body and ``observables``; the first frame decides which there are.
    """

    def __init__(self, path: str | Path, scene: Scene, author: str | None = None) -> None:
        self.path = Path(path)
        self.frames = 0
        refuse_links(self.path.parent, [self.path.name])
        try:
            if self.path.exists():
                with h5py.File(self.path, "a"):  # fails where another program has it open
                    pass
                self.path.unlink()
            self._file = h5py.File(self.path, "x")  # a file of its own, whatever appears there meanwhile
        except OSError as error:
            raise InputError(f"cannot write it: {error.strerror or error}", file=path) from None
        self._room = Reserved(self.path)
        said = scene.to_toml()
        try:
            self._reserve(len(said.encode()) + 64 * len(scene.bodies) + len(scene.title.encode()) * 4)
        except OSError as error:
            self._file.close()
            self.path.unlink(missing_ok=True)
            raise InputError(f"cannot write it: {error.strerror}", file=path) from None
        self._write_head(scene, said, author)

    def _reserve(self, more: int) -> None:
        self._room.until(self._file.id.get_filesize() + more + _EACH_FILE)

    def _write_head(self, scene: Scene, said: str, author: str | None) -> None:
        file = self._file
        text = h5py.string_dtype("utf-8")
        head = file.create_group("h5md")
        head.attrs["version"] = np.array([1, 1], dtype=np.int32)
        head.create_group("author").attrs["name"] = author or _user()
        creator = head.create_group("creator")
        creator.attrs["name"] = "granswim_pymunk"
        creator.attrs["version"] = __version__
        units = head.create_group("modules/units")
        units.attrs["version"] = np.array([1, 0], dtype=np.int32)
        units.attrs["system"] = "SI"
        group = self._group = file.create_group("particles/all")
        box = group.create_group("box")
        box.attrs["dimension"] = 2
        box.attrs["boundary"] = np.array(["periodic" if scene.periodic_x else "none", "none"], dtype=text)
        if scene.periodic_x:
            height = scene.bed.height if scene.bed else _height(scene)
            box.create_dataset("edges", data=np.array([scene.periodic_x, height])).attrs["unit"] = "m"
        group.create_dataset("id", data=np.array([b.id for b in scene.bodies], dtype=object), dtype=text)
        kinds = h5py.enum_dtype({role: k for k, role in enumerate(ROLES)}, basetype="i4")
        species = [ROLES.index(b.role) for b in scene.bodies]
        group.create_dataset("species", data=np.array(species, dtype="i4"), dtype=kinds)
        group.create_dataset("radius", data=[b.radius for b in scene.bodies]).attrs["unit"] = "m"
        group.create_dataset("mass", data=[b.mass for b in scene.bodies]).attrs["unit"] = "kg"
        parameters = file.create_group("parameters")
        parameters.create_dataset("scene", data=said, dtype=text)
        for place in (file, parameters):
            place.attrs["scene_hash"] = scene.identity
            place.attrs["seed"] = scene.seed
            place.attrs["title"] = scene.title
        self._series: dict[str, h5py.Dataset] = {}
        file.flush()

    @classmethod
    def reopen(cls, path: str | Path, step: int) -> TrajectoryWriter:
        """Go on with a trajectory after ``step``: frames of later steps, and half frames, are dropped.

        Raises InputError where the file cannot be read.
        """
        length = len(read_trajectory(path))  # says what is wrong with it; only whole frames count
        self = cls.__new__(cls)
        self.path = Path(path)
        try:
            file = self._file = h5py.File(self.path, "r+")
        except OSError as error:
            raise InputError(f"cannot write it: {error.strerror or error}", file=path) from None
        self._room = Reserved(self.path)
        try:
            self._reserve(0)
        except OSError as error:
            file.close()
            raise InputError(f"cannot write it: {error.strerror}", file=path) from None
        group = self._group = file["particles/all"]
        self._series = {}
        self.frames = 0
        if "position" in group:
            steps = group["position/step"][:length]
            self.frames = int(np.searchsorted(steps, step, side="right"))
            self._series = {"step": group["position/step"], "time": group["position/time"]}
            for place in (group, file.get("observables", {})):
                for name, item in place.items():
                    if _holds(item, "value", "step"):
                        self._series[f"{place.name}/{name}"] = item["value"]
            for data in self._series.values():
                data.resize(self.frames, axis=0)
        file.flush()
        return self

    def _begin(self, values: Mapping[str, np.ndarray], observables: Mapping[str, Any]) -> None:
        """Create the series; every element shares one step and one time, as H5MD allows by links."""
        file, group = self._file, self._group
        steps = group.create_dataset("position/step", (0,), "i8", maxshape=(None,), chunks=(1024,))
        times = group.create_dataset("position/time", (0,), "f8", maxshape=(None,), chunks=(1024,))
        times.attrs["unit"] = "s"
        self._series = {"step": steps, "time": times}
        for name, value in values.items():
            self._element(group, name, value, UNITS.get(name, ""))
        for name, value in observables.items():
            self._element(file.require_group("observables"), name, np.asarray(value, dtype=float), "")

    def _element(self, group: h5py.Group, name: str, value: np.ndarray, unit: str) -> None:
        element = group.require_group(name)
        if "step" not in element:
            element["step"] = self._series["step"]
            element["time"] = self._series["time"]
        data = element.create_dataset(
            "value", (0, *value.shape), "f8", maxshape=(None, *value.shape), chunks=_chunk(value.shape)
        )
        if unit:
            data.attrs["unit"] = unit
        self._series[f"{group.name}/{name}"] = data

    def add(
        self,
        step: int,
        t: float,
        xy: np.ndarray,
        v: np.ndarray,
        more: Mapping[str, np.ndarray] | None = None,
        observables: Mapping[str, float] | None = None,
    ) -> None:
        """Append one frame and flush it to the file. Raises OSError, and adds nothing, where the disk is full."""
        values = {"position": xy, "velocity": v, **(more or {})}
        totals = observables or {}
        shapes = [(), (), *(np.asarray(value).shape for value in (*values.values(), *totals.values()))]
        chunks = [_chunk(shape) for shape in shapes]
        self._reserve(sum(8 * math.prod(c) + _EACH_CHUNK for c in chunks if self.frames % c[0] == 0))
        if not self._series:
            self._begin(values, totals)
        rows: dict[str, Any] = {"step": step, "time": t}
        rows |= {f"{self._group.name}/{name}": value for name, value in values.items()}
        rows |= {f"/observables/{name}": value for name, value in totals.items()}
        if rows.keys() != self._series.keys():
            raise ValueError("every frame needs the same values as the first")
        for name, value in rows.items():
            data = self._series[name]
            data.resize(self.frames + 1, axis=0)
            data[self.frames] = value
        self.frames += 1
        self._file.flush()

    def close(self) -> None:
        """Close the file; what was reserved and not needed is given back. A second time it does nothing."""
        if self._file.id.valid:
            self._file.flush()
            size = self._file.id.get_filesize()
            self._file.close()
            self._room.give_back(size)

    def __enter__(self) -> TrajectoryWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _chunk(shape: tuple[int, ...]) -> tuple[int, ...]:
    """States of many numbers one by one, of few a thousand at a time."""
    return (1, *shape) if math.prod(shape) > 8 else (1024, *shape)


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # no user name in a bare container
        return "unknown"


def _height(scene: Scene) -> float:
    places = [(b.initial[1], b.radius) for b in scene.bodies if b.initial is not None]
    return max(y + r for y, r in places) - min(y - r for y, r in places)


def _holds(item: h5py.Group | h5py.Dataset, *names: str) -> bool:
    """Whether it is a group with these in it; to ask a dataset would read it number by number."""
    return isinstance(item, h5py.Group) and all(name in item for name in names)


def count_states(path: str | Path) -> int:
    """Number of whole states in a trajectory of this program. Raises InputError where it is none."""
    try:
        with h5py.File(path, "r") as file:
            if file["h5md/creator"].attrs["name"] != "granswim_pymunk":
                raise KeyError("another program wrote it")
            group = file["particles/all"]
            lengths = [len(item["value"]) for item in group.values() if _holds(item, "value", "step")]
            return min([*lengths, len(group["position/step"])]) if "position" in group else 0
    except (OSError, KeyError, AttributeError, RuntimeError, TypeError) as error:
        raise InputError(f"is not a trajectory that can be read: {error}", file=path) from None


def read_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory; of an interrupted run, all frames that are complete.

    Raises InputError where the file is not there, is not HDF5, or lacks what such a trajectory has.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError("no such file", file=path)
    try:
        with h5py.File(path, "r") as file:
            group = file["particles/all"]
            series: dict[str, np.ndarray] = {
                name: item["value"][...] for name, item in group.items() if _holds(item, "value", "step")
            }
            observables = {
                name: item["value"][...]
                for name, item in file.get("observables", {}).items()
                if _holds(item, "value")
            }
            ids = tuple(group["id"].asstr()[...].tolist())
            roles = tuple(ROLES[k] for k in group["species"][...])
            radius, mass = group["radius"][...], group["mass"][...]
            toml = file["parameters/scene"].asstr()[()]
            digest = str(file.attrs["scene_hash"])
            empty = "position" not in series
            step = np.zeros(0, dtype=np.int64) if empty else group["position/step"][...]
            t = np.zeros(0) if empty else group["position/time"][...]
    except (OSError, KeyError, AttributeError, RuntimeError) as error:
        raise InputError(f"is not a trajectory that can be read: {error}", file=path) from None
    xy = series.pop("position", np.zeros((0, len(ids), 2)))
    v = series.pop("velocity", np.zeros((0, len(ids), 2)))
    # a run that was killed while it wrote a frame leaves some series one longer than others
    frames = min(len(a) for a in (step, t, xy, v, *series.values(), *observables.values()))
    return Trajectory(
        scene=scene_from_dict(tomllib.loads(toml)),
        scene_hash=digest,
        step=step[:frames],
        t=t[:frames],
        xy=xy[:frames],
        v=v[:frames],
        ids=ids,
        roles=roles,
        radius=radius,
        mass=mass,
        more={name: a[:frames] for name, a in series.items()},
        observables={name: a[:frames] for name, a in observables.items()},
    )
