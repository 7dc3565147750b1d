"""What the engine holds while it runs: typed arrays, rows in inner order (see ``order``), in SI.

Compiled callbacks find each of these arrays by its name (``callbacks.INTS``), so a name stands for one array in all of
the classes below. n bodies, b blocks of bodies, u uses of laws, room: how many pairs a list holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..joints import angles_of
from ..scene import Scene
from ..walls import table_of
from .callbacks import BLOCK, FLOATS, INTS, KEPT, WORK, Kernel
from .links import Links
from .motion import columns, motion_numbers
from .native import LEAD, Offsets, rows_of_bodies
from .order import Order
from .units import Units

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Short = NDArray[np.uint32]
Marks = NDArray[np.uint8]


class Slots:
    """An array whose places have names: how compiled callbacks read single numbers."""

    def __init__(self, names: Sequence[str], kind: type) -> None:
        self.values: np.ndarray = np.zeros(len(names), dtype=kind)
        self._at = {name: k for k, name in enumerate(names)}

    def copy(self) -> Slots:
        """The same names with numbers of its own."""
        other = Slots.__new__(Slots)
        other.values, other._at = self.values.copy(), self._at
        return other

    def at(self, name: str) -> int:
        """Place of a number."""
        return self._at[name]

    def __getitem__(self, name: str) -> Any:
        return self.values[self._at[name]].item()

    def __setitem__(self, name: str, value: float) -> None:
        self.values[self._at[name]] = value


@dataclass
class Bodies:
    """Each body.

    memory : (n, ROW), rows that hold Chipmunk's own bodies; None where Chipmunk has allocated them itself
    state : (n, ROW), rows as the laws see them; where bodies move in place, ``memory`` itself
    columns : column of a row for x, y [m], vx, vy [m/s], fx, fy [N], spin [rad/s], torque [N m], angle [rad]
    fx, fy, torque : (n,) of the last force call [N, N m]
    initial : (n, 4) x, y [m], vx, vy [m/s] at the start;  turned : (n, 2) angle [rad] and spin [rad/s] there
    bodies : (n,) addresses of the cpBody of each
    mass, radius, given_inertia : (n,) [kg, m, kg m^2], the last 0 where it is that of a disk
    mobile : (n,) 1 where forces move a body (not walls, nor bodies that are carried along)
    inverse_mass, inverse_moment : (n,) [1/kg, 1/(kg m^2)], 0 where it is not mobile
    kick_mass : (n,) [1/kg], what the kick multiplies a force by, before constraints take their share
    ease : (n,) share of the kick that constant drags leave, where they are taken into the mass
    heavier : (n,) m (1 + beta)/m where Chipmunk's impulses move what a body carries along, else 1
    group : (n,) bodies of one group above zero never touch, those of -1 only with the partners in ``apart``
    push : (n, 3) force and torque that a user put on a body for the coming step
    images : (n,) whole periods, and image_shift : (n,) [m], what was taken off the x of a body in the Space
    place_x, place_y : (n,) places [m] as a list is built;  kept : (n, 6) what is kept while dampings are taken twice
    """

    memory: Floats | None
    state: Floats
    columns: dict[str, int]
    fx: Floats
    fy: Floats
    torque: Floats
    initial: Floats
    turned: Floats
    bodies: Ints
    mass: Floats
    radius: Floats
    given_inertia: Floats
    mobile: Marks
    inverse_mass: Floats
    inverse_moment: Floats
    kick_mass: Floats
    ease: Floats
    heavier: Floats
    group: Ints
    push: Floats
    images: Floats
    image_shift: Floats
    place_x: Floats
    place_y: Floats
    kept: Floats

    def row(self, name: str) -> Floats:
        """(n,) one column of ``state``."""
        values: Floats = self.state[:, self.columns[name]]
        return values

    @property
    def first_body(self) -> int:
        """Address of the first cpBody in ``memory``, 0 without it."""
        return 0 if self.memory is None else self.memory.ctypes.data + 8 * LEAD


@dataclass
class LawTable:
    """How the laws act (see ``tables``).

    uses : (u, 6) int, columns ``callbacks.USE_COLUMNS``;  parameters : all numbers of laws, each use's behind its r_0
    rows : bodies of each use;  runs : (k, 2) the same as half-open ranges;  run_starts : (u, b + 1) those of a block
    mask : (u, n) 1 where a use acts on a body;  blocks : (b + 1,);  chains : (c, 2) rows of each swimmer
    joints : (q, 3) kind (0 a pin, 1 a hinge), bodies i and j, -1 the world;  joint_at : (q, 2) anchor of a pin [m]
    joint_of : joints of each use of a law of joints
    input_t, input_v : commands [s, 1];  input_at : (n, 2) a body's part of them
    scalars : ``callbacks.SCALARS``
    """

    uses: Ints
    parameters: Floats
    rows: Ints
    runs: Ints
    run_starts: Ints
    mask: Marks
    blocks: Ints
    chains: Ints
    joints: Ints
    joint_at: Floats
    joint_of: Ints
    input_t: Floats
    input_v: Floats
    input_at: Ints
    scalars: Floats


@dataclass
class Lists:
    """Neighbour lists, and what is needed to build them.

    room : pairs that the lists hold
    pair_i, pair_j, pair_shift : (room,) all pairs within reach and skin, i < j, sorted; shift to the nearest image [m]
    near_i, near_j, near_shift, near_touch, near_mass : (room,) those that may touch before the next look: where their
        rows begin, shift [m], sum of radii [m], reduced mass [kg]
    near_starts, near_seam : (b + 1,), (b,) where a block's pairs begin, whether one of them crosses the seam
    contact_i, contact_j, contact_fx, contact_fy, contact_ti, contact_tj, order : (room,) contacts that Chipmunk found
    old_x, old_y : (n,) places [m] when the list was built, infinite where it must be built anew
    allowance, reaching : (n,) ways [m] for which the list of near pairs holds
    heads, nexts, starts, sorted_x, sorted_y, sorted_reach, listing, which, work : work arrays
    table_keys, table_values : from the address of a body to its row (open addressing)
    """

    room: int
    pair_i: Short
    pair_j: Short
    pair_shift: Floats
    near_i: Short
    near_j: Short
    near_shift: Floats
    near_touch: Floats
    near_mass: Floats
    near_starts: Ints
    near_seam: Marks
    contact_i: Ints
    contact_j: Ints
    contact_fx: Floats
    contact_fy: Floats
    contact_ti: Floats
    contact_tj: Floats
    order: Ints
    old_x: Floats
    old_y: Floats
    allowance: Floats
    reaching: Floats
    heads: Ints
    nexts: Ints
    starts: Ints
    sorted_x: Floats
    sorted_y: Floats
    sorted_reach: Floats
    listing: Ints
    which: NDArray[np.uint64]
    work: Floats
    table_keys: Ints
    table_values: Ints

    def allocate(self, room: int) -> None:
        """Room for so many pairs; what the lists held is gone."""
        self.room = room
        for name, array in _pair_arrays(room).items():
            setattr(self, name, array)


@dataclass
class LinkArrays:
    """Hinges and rods for compiled code: fields and work arrays of ``links.Links``.

    apart : joined pairs i < j, which never touch, as i n + j
    """

    apart: Ints
    link_kind: Ints
    link_first: Ints
    link_second: Ints
    link_geometry: Floats
    linked: Ints
    mobility: Floats
    link_gap: Floats
    link_arms: Floats
    link_here: Floats
    link_there: Floats
    link_matrix: Floats
    link_push: Floats
    link_q: Floats
    link_trial: Floats


@dataclass
class WallArrays:
    """Straight walls.

    walls : (w, 5) begin x, y, way to the end x, y, radius [m];  wall_i, wall_k : bodies and walls that are near
    wall_starts : (b + 1,) where those of a block begin;  wall_met : (n,) 1 where Chipmunk found a body to touch one
    """

    walls: Floats
    wall_i: Short
    wall_k: Short
    wall_starts: Ints
    wall_met: Marks


@dataclass
class EngineState:
    """All of it. ``motion``: numbers for drift and kick (``motion.MOTION``); ``numbers``: ``callbacks.FLOATS``."""

    bodies: Bodies
    laws: LawTable
    lists: Lists
    links: LinkArrays
    walls: WallArrays
    motion: Floats
    numbers: Slots

    def array(self, name: str) -> Any:
        """The array of that name, wherever it stands."""
        if name == "floats":
            return self.numbers.values
        if name == "motion":
            return self.motion
        return getattr(getattr(self, _GROUP_OF[name]), name)

    def forget_lists(self) -> None:
        """The next step builds the neighbour lists anew."""
        self.lists.old_x[:] = np.inf
        self.numbers["lasts"] = -np.inf


_GROUPS = {"bodies": Bodies, "laws": LawTable, "lists": Lists, "links": LinkArrays, "walls": WallArrays}
_GROUP_OF = {field.name: group for group, kind in _GROUPS.items() for field in fields(kind)}  # type: ignore[arg-type]


_FIRST_ARRAY = INTS.index("bodies")  # in a context: counts come before, addresses from there on


def context_of(state: EngineState, order: Order, kernel: Kernel, from_list: bool, fixed_skin: bool) -> Slots:
    """Counts and addresses of the arrays, as compiled callbacks find them (``callbacks.INTS``)."""
    context = Slots(INTS, np.int64)
    laws, lists, links, walls = state.laws, state.lists, state.links, state.walls
    counts = {
        "n": order.n, "n_mobile": order.n_mobile, "room": lists.room, "n_runs": len(laws.runs),
        "n_blocks": len(laws.blocks) - 1, "first_body": state.bodies.first_body, "from_list": int(from_list),
        "constrained": 1, "fixed_skin": int(fixed_skin), "n_uses": len(laws.uses),
        "n_parameters": len(laws.parameters), "n_input": len(laws.input_t), "n_cells": len(lists.heads),
        "n_table": len(lists.table_keys), "n_chains": len(laws.chains), "n_joints": len(laws.joints),
        "n_joint_of": len(laws.joint_of), "n_links": len(links.link_kind), "n_linked": len(links.linked),
        "n_held": len(links.link_gap), "n_apart": len(links.apart), "n_walls": len(walls.walls),
        "n_meetings": len(walls.wall_i),
        "renew_lists": kernel.lists.renew_lists.address if lists.room or len(walls.walls) else 0,
        "add_walls": kernel.walls.add_walls.address if len(walls.walls) else 0,
        "hold_links": kernel.links.hold_links.address if len(links.linked) else 0,
    }  # fmt: skip
    for name, value in counts.items():
        context[name] = value
    arrays = [state.array(name) for name in INTS[_FIRST_ARRAY:]]
    assert all(array.flags.c_contiguous for array in arrays)
    context.values[_FIRST_ARRAY:] = [array.__array_interface__["data"][0] for array in arrays]
    return context


def bodies_of(
    scene: Scene, order: Order, carried: frozenset[int], offsets: Offsets | None, own_memory: bool, in_place: bool
) -> Bodies:
    """The bodies where the scene has them at the start.

    own_memory : Chipmunk's bodies stand in rows of ours;  in_place : and the laws read and write these rows
    """
    bodies = [scene.bodies[i] for i in order.rows_of]
    n = len(bodies)
    places = np.array([b.initial for b in scene.bodies], dtype=float).reshape(len(scene.bodies), 4)
    turned = np.stack(angles_of(scene, places[:, :2], places[:, 2:]), axis=1)
    memory = rows_of_bodies(n) if own_memory else None
    state = memory if in_place and memory is not None else rows_of_bodies(n)
    where = columns(offsets)
    # in place, those of the last force call: the next one begins in Chipmunk's memory
    forces = [np.zeros(n) if in_place else state[:, where[name]] for name in ("fx", "fy", "torque")]
    mass = np.array([b.mass for b in bodies])
    # to forces, a carried body is a wall
    free = [b.mobile and i not in carried for b, i in zip(bodies, order.rows_of, strict=True)]
    mobile = np.array(free, dtype=np.uint8)
    group = np.zeros(n, dtype=np.int64)
    for k, (first, last) in enumerate(order.spans):
        group[first:last] = k + 1
    return Bodies(
        memory=memory, state=state, columns=where, fx=forces[0], fy=forces[1], torque=forces[2],
        initial=places[order.rows_of], turned=turned[order.rows_of], bodies=np.zeros(n, dtype=np.int64), mass=mass,
        radius=np.array([b.radius for b in bodies]), given_inertia=np.array([b.inertia or 0.0 for b in bodies]),
        mobile=mobile, inverse_mass=np.where(mobile == 1, 1.0 / mass, 0.0),
        inverse_moment=np.array([1.0 / b.moment if f else 0.0 for b, f in zip(bodies, free, strict=True)]),
        kick_mass=np.zeros(n), ease=np.ones(n), heavier=_heavier(scene)[order.rows_of], group=group,
        push=np.zeros((n, 3)), images=np.zeros(n), image_shift=np.zeros(n), place_x=np.zeros(n), place_y=np.zeros(n),
        kept=np.zeros((n, len(KEPT))),
    )  # fmt: skip


def _heavier(scene: Scene) -> Floats:
    """(n,) by how much each body of the scene is heavier to Chipmunk's impulses: they move what it carries along.

    An impulse is a force for an instant; the laws' forces have their share already.
    """
    heavier = np.ones(len(scene.bodies))
    if any(item.law.kind == "impulse" for item in scene.laws):
        for item in scene.laws_named("added_mass"):
            heavier[list(scene.rows(item))] *= 1.0 + item.values["beta"]
    return heavier


def _pair_arrays(room: int) -> dict[str, np.ndarray]:
    arrays: dict[str, np.ndarray] = {}
    # near pairs are taken four by four: the last four may reach beyond the list
    for name in ("pair_i", "pair_j", "near_i", "near_j"):
        arrays[name] = np.zeros(room + 4, dtype=np.uint32)[:room]
    for name in ("contact_i", "contact_j", "order"):
        arrays[name] = np.zeros(room, dtype=np.int64)
    for name in ("pair_shift", "near_shift", "near_touch", "near_mass", "contact_fx", "contact_fy", "contact_ti",
                 "contact_tj"):  # fmt: skip
        arrays[name] = np.zeros(room + 4)[:room]
    return arrays


def lists_of(n: int, blocks: int, has_pairs: bool, radius: Floats, reach: float) -> Lists:
    """Empty lists. ``reach`` [m]: how far beyond their radii bodies act on one another."""
    room = (max(16 * n, 64) if n > 60 else n * n) if has_pairs else 0
    return Lists(
        room=room, **_pair_arrays(room), near_starts=np.zeros(blocks + 1, dtype=np.int64),
        near_seam=np.zeros(blocks, dtype=np.uint8), old_x=np.full(n, np.inf), old_y=np.full(n, np.inf),
        allowance=np.zeros(n), reaching=radius + 0.5 * reach, heads=np.zeros(4 * n + 256, dtype=np.int64),
        nexts=np.zeros(n, dtype=np.int64), starts=np.zeros(n + 1, dtype=np.int64), sorted_x=np.zeros(n),
        sorted_y=np.zeros(n), sorted_reach=np.zeros(n), listing=np.zeros(n + 1, dtype=np.int64),
        which=np.zeros(BLOCK + 1, dtype=np.uint64), work=np.zeros(BLOCK * len(WORK) + 8),
        table_keys=np.zeros(64, dtype=np.int64), table_values=np.zeros(64, dtype=np.int64),
    )  # fmt: skip


def link_arrays(links: Links, apart: Sequence[tuple[int, int]], n: int) -> LinkArrays:
    """The links, and the pairs of rows that are ``apart``, of n bodies."""
    return LinkArrays(
        np.array([i * n + j for i, j in apart], dtype=np.int64), links.kind, links.first, links.second, links.geometry,
        links.rows, links.mobility, *links.work,
    )  # fmt: skip


def walls_of(scene: Scene, bodies: Bodies, blocks: int) -> WallArrays:
    """The straight walls of a scene, with room for the meetings of all mobile bodies with all walls."""
    meetings = int(bodies.mobile.sum()) * len(scene.walls)
    return WallArrays(
        table_of(scene.walls), np.zeros(meetings, dtype=np.uint32), np.zeros(meetings, dtype=np.uint32),
        np.zeros(blocks + 1, dtype=np.int64), np.zeros(len(bodies.mass), dtype=np.uint8),
    )  # fmt: skip


def numbers_of(start: float, dt: float, skin: float, smallest: float, reach: float) -> Slots:
    """The single numbers that callbacks know.

    start, dt [s];  skin [m] of the full list at first;  smallest [m] radius;  reach [m] beyond the radii
    """
    numbers = Slots(FLOATS, np.float64)
    given = {
        "t_start": start, "dt": dt, "skin": skin, "least_skin": 0.1 * smallest, "most_skin": 1.5 * smallest,
        "reach": reach, "headroom": 0.001 * skin / dt,
    }  # fmt: skip
    for name, value in given.items():
        numbers[name] = value
    return numbers


def motion_of(units: Units) -> Floats:
    """Numbers for drift and kick: what turns engine units into SI and back, and no margin yet."""
    return motion_numbers({
        "length_unit": units.length, "velocity_unit": units.velocity, "spin_unit": 1.0 / units.time,
        "force_scale": 1.0 / units.force, "torque_scale": 1.0 / units.torque, "margin": np.inf,
    })  # fmt: skip
