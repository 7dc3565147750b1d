"""One run of the swimmer in its bed, and what is kept of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from ..analysis.contacts import ContactFinder, Directions, contact_directions
from ..analysis.fields import Fields, Grid, coarse_grain
from ..analysis.network import contact_network
from ..engine import Contacts, Simulation
from ..engine.swimmers import swimmer_forces
from ..errors import InputError
from ..packing import pack
from ..scene import Scene
from ..sweep import Watch

VERSION = 2  # of what is measured; another number makes other jobs


@dataclass(frozen=True)
class Plan:
    """How a run is measured: ``settle`` and ``duration`` [s], seconds between samples of the swimmer and of the bed.

    spacing [m]: of the grid of the coarse-grained fields, 2 L_s wide, around the head; 0: none
    """

    duration: float = 1.5
    settle: float = 0.5
    swimmer_every: float = 1e-3
    bed_every: float = 17e-3
    spacing: float = 5e-4
    skin: float = 3e-4


def measure(scene: Scene, plan: Plan = Plan(), watch: Watch | None = None) -> xr.Dataset:
    """Pack the bed if needed, run the scene and keep (SI):

    ``xy``, ``v`` (time, disk, axis): swimmer, every ``swimmer_every``, from the start on
    ``bed_energy``, ``swimmer_energy`` (time): kinetic energies [J]
    ``bending_power`` (time): power of the bending law on the swimmer [W]
    ``direction_count``, ``direction_force`` (disk, angle): contacts on the disks after ``settle``
    ``coordination``, ``anisotropy``, ``branch_anisotropy``, ``overlap``, ``contact_force`` ...: means over the bed
    after ``settle``; ``field_...`` (y, x): means of coarse-grained fields of the grains around the head, contacts
    with grains and walls; ``field_swimmer_contact``: trace of the stress of their contacts with the swimmer [N/m]

    Raises InputError where the scene has no swimmer, SimulationError where the run cannot go on.
    """
    scene = pack(scene)
    if len(scene.chains) != 1:
        raise InputError("needs one swimmer", where="scene")
    sim = Simulation(scene, skin=plan.skin or None)
    rows = np.array(scene.swimmer)
    mass = np.array([b.mass for b in scene.bodies])
    grains = np.array([k for k, b in enumerate(scene.bodies) if b.role == "grain"])
    mobile = np.array([k for k, b in enumerate(scene.bodies) if b.mobile])
    bending = [(item.law, scene.resolved(item)) for item in scene.laws_named("bending")]
    length = 2.0 * sum(scene.bodies[k].radius for k in scene.swimmer)
    stride = max(round(plan.swimmer_every / sim.dt), 1)
    bed_stride = max(round(plan.bed_every / plan.swimmer_every), 1)
    samples = round(plan.duration / (stride * sim.dt))

    means = _BedMeans(scene, rows, length, plan)
    t = np.zeros(samples + 1)
    xy = np.zeros((samples + 1, len(rows), 2))
    v = np.zeros_like(xy)
    bed_energy, swimmer_energy, power = np.zeros(samples + 1), np.zeros(samples + 1), np.zeros(samples + 1)
    for k in range(samples + 1):
        if k:
            sim.advance(stride)
        state = sim.state()
        t[k], xy[k], v[k] = state.t, state.xy[rows], state.v[rows]
        energy = 0.5 * mass * (state.v**2).sum(axis=1)
        bed_energy[k], swimmer_energy[k] = energy[grains].sum(), energy[rows].sum()
        for law, values in bending:
            f = swimmer_forces(law, values, t[k], xy[k], v[k], mass[rows])
            power[k] += float((f.T * v[k]).sum())
        if watch is not None and k % 20 == 0:
            watch(k / samples)
        if state.t >= plan.settle and not k % bed_stride:
            means.add(state.xy, state.v)
    data: dict[str, Any] = {
        "xy": (("time", "disk", "axis"), xy.astype(np.float32)),
        "v": (("time", "disk", "axis"), v.astype(np.float32)),
        "bed_energy": ("time", bed_energy),
        "swimmer_energy": ("time", swimmer_energy),
        "bending_power": ("time", power),
        "disk_mass": ("disk", mass[rows]),
        "grains": len(grains),
        "mobile": len(mobile),
        "packed_fraction": _fraction(scene),
    }
    coords: dict[str, Any] = {"time": t, "axis": ["x", "y"], "disk": np.arange(len(rows))}
    means.put(data, coords)
    result = xr.Dataset(data, coords=coords)
    result.attrs |= {
        "settle": plan.settle, "dt": sim.dt, "steps": sim.step, "mode": sim.mode, "scene_hash": scene.identity,
        "grain_radius": means.grain_radius,
    }  # fmt: skip
    return result


class _BedMeans:
    """Means over looks at the bed: contacts of the disks, the network of contacts, fields around the head.

    rows : of the swimmer's disks;  length : of the swimmer [m]
    """

    NAMES = (
        "coordination", "anisotropy", "branch_trace", "branch_anisotropy", "floaters", "overlap", "contact_force",
        "fabric_xx", "fabric_xy", "fabric_yy",
    )  # fmt: skip

    def __init__(self, scene: Scene, rows: np.ndarray, length: float, plan: Plan) -> None:
        self.scene, self.rows, self.plan = scene, rows, plan
        self.reach = 2 * length
        self.find = ContactFinder(scene)
        self.mass = np.array([b.mass for b in scene.bodies])
        self.radius = np.array([b.radius for b in scene.bodies])
        self.grain = np.array([b.role == "grain" for b in scene.bodies])
        self.grains = np.flatnonzero(self.grain)
        self.grain_radius = float(self.radius[self.grains].mean())
        self.directions: Directions | None = None
        self.fields: Fields | None = None
        self.with_swimmer: np.ndarray | None = None
        self.network: list[tuple[float, ...]] = []

    def add(self, xy: np.ndarray, v: np.ndarray) -> None:
        """Look at the bed: places and velocities (n, 2) of all bodies [m, m/s]."""
        contacts, radius = self.find(xy, v), self.radius
        seen = contact_directions(contacts, self.rows.tolist(), bins=36)
        self.directions = seen if self.directions is None else self.directions + seen
        distance = radius[contacts.i] + radius[contacts.j] - contacts.overlap
        branch = contacts.normal * distance[:, None]
        net = contact_network(contacts.i, contacts.j, branch, self.grains)
        smaller = np.minimum(radius[contacts.i], radius[contacts.j])
        self.network.append(
            (
                net.coordination, net.anisotropy, net.branch_trace, net.branch_anisotropy, net.floaters,
                float((contacts.overlap / smaller).max(initial=0.0)), float(contacts.force.sum()),
                *net.fabric[[0, 0, 1], [0, 1, 1]],
            )
        )  # fmt: skip
        if self.plan.spacing > 0:
            self._add_fields(xy, v, contacts, branch)

    def _add_fields(self, xy: np.ndarray, v: np.ndarray, contacts: Contacts, branch: np.ndarray) -> None:
        grains, mass, radius, period = self.grains, self.mass, self.radius, self.scene.periodic_x
        head = xy[self.rows[0]]
        grid = Grid.around(head[0], head[1], self.reach, self.reach, self.plan.spacing)
        force = contacts.normal * contacts.force[:, None]
        body = np.isin(contacts.i, self.rows) | np.isin(contacts.j, self.rows)
        bed, other = ~body, body & (self.grain[contacts.i] | self.grain[contacts.j])
        now = coarse_grain(
            grid, self.grain_radius, xy[grains], v[grains], mass[grains], radius[grains],
            (xy[contacts.i][bed], branch[bed], force[bed]), period,
        )  # fmt: skip
        self.fields = now if self.fields is None else self.fields + now
        none = np.zeros((0, 2))
        swimmers = coarse_grain(
            grid, self.grain_radius, none, none, mass[:0], radius[:0],
            (xy[contacts.i][other], branch[other], force[other]), period,
        ).contact_pressure  # fmt: skip
        self.with_swimmer = swimmers if self.with_swimmer is None else self.with_swimmer + swimmers

    def put(self, data: dict[str, Any], coords: dict[str, Any]) -> None:
        """Put the means where they were taken, see ``measure``."""
        if self.network:
            for name, value in zip(self.NAMES, np.array(self.network).mean(axis=0), strict=True):
                data[name] = float(value)
        if self.directions is not None:
            data["direction_count"] = (("disk", "angle"), self.directions.count)
            data["direction_force"] = (("disk", "angle"), self.directions.force)
            coords["angle"] = 0.5 * (self.directions.edges[1:] + self.directions.edges[:-1])
        if self.fields is not None and self.with_swimmer is not None:
            shown = (self.with_swimmer / self.fields.snapshots).astype(np.float32)
            data["field_swimmer_contact"] = (("y", "x"), shown)
            for name, value in vars(self.fields.mean).items():
                if name != "snapshots":
                    data[f"field_{name}"] = (("y", "x"), value.astype(np.float32))
            around = Grid.around(0.0, 0.0, self.reach, self.reach, self.plan.spacing)
            coords |= {"x": around.x, "y": around.y}


def _fraction(scene: Scene) -> float:
    if scene.bed is None or scene.periodic_x is None:
        return math.nan
    area = math.pi * sum(b.radius**2 for b in scene.bodies if b.mobile)
    return area / (scene.periodic_x * scene.bed.height)
