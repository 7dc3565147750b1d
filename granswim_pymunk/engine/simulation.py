"""A scene running on pymunk: Chipmunk integrates every body, compiled laws give the forces."""

from __future__ import annotations

import logging
import math
import os
import threading
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pymunk
from pymunk._chipmunk_cffi import ffi, lib

from ..choices import MODES
from ..errors import InputError, SimulationError
from ..joints import angles_of, hinged
from ..laws import Law
from ..scene import Body, LawUse, Scene
from ..walls import table_of
from . import events, neighbours, stepping
from .advice import advise_dt
from .callbacks import (
    ALONE,
    BLOCK,
    BODIES,
    CHAINS,
    FLOATS,
    HALF_STEP,
    INTS,
    KEPT,
    KIND_ORDER,
    LINKS,
    SCALARS,
    TOGETHER,
    USE_COLUMNS,
    WALL,
    WALLS,
    WORK,
    Kernel,
    compile_laws,
    spins,
)  # fmt: skip
from .held import joints_for
from .links import linked_rows, links_of, no_links
from .motion import MOTION, NUMBERS, OWN_ROW, Motion, columns, motion_functions, motion_numbers
from .native import (
    LEAD,
    ROW,
    Offsets,
    ProbeError,
    address,
    column,
    last_step_offset,
    offsets,
    releaser,
    rows_of_bodies,
    settle_in,
    step_address,
)  # fmt: skip
from .units import Units

log = logging.getLogger("granswim")

# callbacks are compiled and installed by one thread at a time; runs are free
_BUILDING = threading.RLock()
MOST_SURFACES = 8
IMMOVABLE = 1e15  # times its mass, a body that is carried along is to Chipmunk

_SLOT = {name: k for k, name in enumerate(INTS)}
_FLOAT_SLOT = {name: k for k, name in enumerate(FLOATS)}


@dataclass(frozen=True)
class State:
    """The bodies at one time, rows in the order of ``scene.bodies``.

    t : float, time [s]
    xy : (n, 2) float, positions [m], unwrapped along a periodic x
    v : (n, 2) float, velocities [m/s] at t
    angle, spin : (n,) float, angle [rad] and angular velocity [rad/s]; of a pinned body those of its rod,
        0 when it hangs along -y, in (-pi, pi]
    """

    t: float
    xy: np.ndarray
    v: np.ndarray
    angle: np.ndarray
    spin: np.ndarray


@dataclass(frozen=True)
class Contacts:
    """Touching pairs, rows i < j of ``scene.bodies``.

    normal : (k, 2), from i to j;  force : (k,) normal force on j along the normal [N];
    overlap : (k,) sum of radii less distance [m]
    """

    i: np.ndarray
    j: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    overlap: np.ndarray


class Simulation:
    """A scene on a ``pymunk.Space``.

    Parameters
    ----------
    scene : bodies must be listed (a bed packed) and every mobile one needs ``initial``
    mode : how contacts are found and forces enter. "verlet": one compiled force call a step over a
        neighbour list; "chipmunk": Chipmunk's broad and narrow phase, a compiled pre-solve per contact;
        "python": Python pre-solve and velocity callbacks; "batch": pymunk.batch, without native callbacks
    dt : time step [s]; left out, that of the scene, else one that resolves the fastest law
    start : "synchronised": the velocities of the scene belong to the time of the positions;
        "leapfrog": they are those of the coming drift, half a step ahead
    only : rows of ``scene.bodies`` that are simulated, all where not given. The others are absent; laws keep the
        numbers (mean mass, radii) of the whole scene, and ``state``, ``raw``, ``forces`` give NaN for them
    carried : rows that move at the velocities they are given, whatever pushes them: walls that move. Mode verlet
    averaged : a contact's dashpot, and a force that ends at a reach, count in their first and last step by the share
        of the step that they last, so that no moment is rounded to steps. Mode verlet, in others without effect
    stretch : beside ``contact_elastic``, how many times longer than ``dt`` a step may be where no disks are near each
        other: a fifth of the time in which the nearest two cover their gap

    Scheme: positions drift with v, forces at the new positions with the last half-step velocity in the
    dampings, velocities kick (leapfrog). Where the scene's ``time.scheme`` is "exact", drags and friction of substrate
    and joints see the velocity of the positions' time instead: that to which half a kick with the last half-step
    velocity leads (a predictor-corrector of second order). Runs are repeatable bit for bit.

    Raises InputError for a scene that cannot be run, SimulationError when a run cannot go on.
    """

    def __init__(
        self,
        scene: Scene,
        mode: str = "verlet",
        dt: float | None = None,
        start: str = "synchronised",
        units: Units | None = None,
        skin: float | None = None,
        only: Sequence[int] | np.ndarray | None = None,
        carried: Sequence[int] | np.ndarray = (),
        averaged: bool = False,
        stretch: float = 1.0,
    ) -> None:
        if mode not in MODES:
            raise InputError(f"unknown mode {mode!r}; expected one of {', '.join(MODES)}")
        if start not in ("synchronised", "leapfrog"):
            raise InputError(f'start should be "synchronised" or "leapfrog", got {start!r}')
        if scene.bed is not None and not any(b.role == "grain" for b in scene.bodies):
            raise InputError("the bed is not packed yet: use granswim_pymunk.packing.pack(scene)", where="scene.bed")
        for body in scene.bodies:
            if body.initial is None:
                raise InputError("needs initial = [x, y, vx, vy]", where=f"body {body.id}")
        self.scene = scene
        self.averaged = averaged
        self.stretch = float(stretch)  # of dt, how long a step may be where an impact is far
        self.impulse = [item for item in scene.laws if item.law.kind == "impulse"]
        if self.impulse and scene.periodic_x:
            raise InputError(
                "Chipmunk's impulses do not reach across a periodic seam; use contact_linear",
                where="law contact_elastic",
            )
        plain = [item.name for item in scene.laws if not item.law.compiled]
        if plain and mode != "python":
            log.warning("law %s is plain Python: running in python mode", ", ".join(plain))
            mode = "python"
        self._offsets: Offsets | None = None
        if mode in ("verlet", "chipmunk"):
            try:
                if os.environ.get("GRANSWIM_NO_NATIVE"):
                    raise ProbeError("switched off by GRANSWIM_NO_NATIVE")
                self._offsets = offsets()
                step_address()
            except ProbeError as error:
                log.warning("compiled callbacks cannot be installed (%s): using the batch interface", error)
                mode = "batch"
        if mode == "chipmunk" and any(item.law.reach for item in scene.laws):
            far = ", ".join(item.name for item in scene.laws if item.law.reach)
            raise InputError(f"{far} acts before contact, which Chipmunk does not report; use mode verlet")
        self.mode = mode
        self._motion = self._own_motion()
        self._present = self._part(only, carried)
        self._carried = set(map(int, carried))
        # in place: the laws read and write Chipmunk's own memory, which is in SI where its collision is not used
        self._in_place = mode == "verlet" and self._motion is not None and units in (None, Units(1.0, 1.0, 1.0))
        self.units = units or (Units(1.0, 1.0, 1.0) if self._in_place else Units.for_scene(scene))
        self.dt = float(dt if dt is not None else scene.time.dt or advise_dt(scene))
        if not (math.isfinite(self.dt) and self.dt > 0):
            raise InputError(f"dt should be above zero [s], got {dt!r}")
        self.step = 0
        self._last_step = self.dt
        self._event_time: float | None = None  # where steps end at impacts, time is not a number of steps
        self._started = False
        self._start_kind = start
        with _BUILDING:
            self._arrays(skin)
            self._build_space()
            if mode in ("verlet", "chipmunk"):
                self._install_native()
        if mode == "python":
            from .python_mode import PythonCallbacks

            self._python = PythonCallbacks(self)
        elif mode == "batch":
            from .batch_mode import BatchStepper

            self._batch = BatchStepper(self)

    # ---- set-up -------------------------------------------------------------------------------

    def _part(self, only: Sequence[int] | np.ndarray | None, carried: Sequence[int] | np.ndarray) -> np.ndarray:
        """(n,) bool: bodies of the scene that are simulated."""
        count = len(self.scene.bodies)
        present = np.full(count, only is None)
        for name, rows in (("only", () if only is None else only), ("carried", carried)):
            if len(rows) and not (0 <= min(rows) and max(rows) < count):
                raise InputError(f"{name} should be rows of the scene's {count} bodies")
        if only is not None:
            present[np.asarray(only, dtype=np.int64)] = True
        if len(carried) and (self.mode != "verlet" or self.impulse):
            raise InputError("carried bodies need mode verlet, without impulses")
        for chain in self.scene.chains:
            if len({bool(present[i]) for i in chain}) > 1:
                raise InputError("a swimmer should be simulated whole or not at all")
        return present

    def _own_motion(self) -> Motion | None:
        """Compiled drifts and kicks; None where Chipmunk's own must do."""
        if self._offsets is None or self.impulse:  # its own position function knows about its overlap correction
            return None
        try:
            found = motion_functions()
        except ProbeError as error:
            log.debug("bodies stay where Chipmunk puts them: %s", error)
            return None
        return found if found.kicks else None

    def _arrays(self, skin: float | None) -> None:
        scene = self.scene
        # inside, chains come first, then the other mobile bodies, then walls; neighbours near in memory
        present, carried = self._present, self._carried
        chains = tuple(chain for chain in scene.chains if present[chain[0]])
        in_chain = {i for chain in chains for i in chain}
        order = [i for chain in chains for i in chain]
        # joined bodies follow, in the first block of bodies: their forces are found together
        joined = [i for i in linked_rows(scene) if present[i]]
        if 0 < len(joined) < len(linked_rows(scene)):
            raise InputError("bodies in hinges and rods should be simulated all together or not at all")
        in_first = [*joined]
        if any(item.law.kind == "joint" for item in scene.laws):
            hung = {int(row) for item in scene.laws_named("pin") for row in scene.rows(item)}
            in_first += sorted(row for row in hung - {*joined, *in_chain} if present[row])
        order += in_first
        in_chain |= set(in_first)
        rest = [i for i, b in enumerate(scene.bodies) if b.mobile and present[i] and i not in in_chain]
        order += _in_columns(scene, [i for i in rest if i not in carried])
        order += _in_columns(scene, [i for i in rest if i in carried])
        self._n_mobile = len(order)  # the carried ones drift, too
        order += _in_columns(scene, [i for i, b in enumerate(scene.bodies) if not b.mobile and present[i]])
        self._rows_of = np.array(order, dtype=np.int64)  # inner row -> scene row
        self._inner = np.full(len(scene.bodies), -1, dtype=np.int64)  # scene row -> inner row, -1 where absent
        self._inner[self._rows_of] = np.arange(len(order))
        bodies = [scene.bodies[i] for i in order]
        n = self._n = len(bodies)

        initial = np.array([b.initial for b in bodies], dtype=float).reshape(n, 4)
        places = np.array([b.initial for b in scene.bodies], dtype=float).reshape(len(scene.bodies), 4)
        self._turned = np.stack(angles_of(scene, places[:, :2], places[:, 2:]), axis=1)[order]  # angle, spin
        a: dict[str, np.ndarray] = {}
        self._initial = initial
        self._columns = columns(self._offsets)
        self._memory = rows_of_bodies(n) if self._motion is not None else None
        a["state"] = self._memory if self._in_place and self._memory is not None else rows_of_bodies(n)
        for name, k in self._columns.items():
            a[name] = a["state"][:, k]
        if self._in_place:
            # of the last force call; the next one begins in Chipmunk's memory
            for name in ("fx", "fy", "torque"):
                a[name] = np.zeros(n)
        else:
            for k, name in enumerate(("x", "y", "vx", "vy")):
                a[name][:] = initial[:, k]
            a["angle"][:], a["spin"][:] = self._turned.T
        a["push"] = np.zeros((n, 3))
        a["which"] = np.zeros(BLOCK + 1, dtype=np.uint64)
        a["work"] = np.zeros(BLOCK * len(WORK) + 8)
        a["place_x"], a["place_y"] = np.zeros(n), np.zeros(n)  # for building a list
        a["mass"] = np.array([b.mass for b in bodies])
        # to forces, a carried body is a wall
        free = [b.mobile and i not in carried for b, i in zip(bodies, order, strict=True)]
        a["mobile"] = np.array(free, dtype=np.uint8)
        a["inverse_mass"] = np.where(a["mobile"] == 1, 1.0 / a["mass"], 0.0)
        a["radius"] = np.array([b.radius for b in bodies])
        a["given_inertia"] = np.array([b.inertia or 0.0 for b in bodies])
        a["old_x"] = np.full(n, np.inf)  # forces the first list
        a["old_y"] = np.full(n, np.inf)
        a["group"] = np.zeros(n, dtype=np.int64)
        at = 0
        spans: list[tuple[int, int]] = []
        for k, chain in enumerate(chains):
            a["group"][at : at + len(chain)] = k + 1
            spans.append((at, at + len(chain)))
            at += len(chain)
        self._set_links(a, joined, at)
        at += len(in_first)
        a["chains"] = np.array(spans, dtype=np.int64).reshape(-1, 2)
        a["blocks"] = blocks = np.array([0, *range(at, n, BODIES), n], dtype=np.int64)

        self._kernel: Kernel | None = None
        codes: dict[str, int] = {}
        if self.mode != "python":
            self._kernel = compile_laws([item.law for item in scene.laws], self._offsets)
            codes = self._kernel.codes
        uses = [item for item in scene.acting if item.law.kind in KIND_ORDER and not self._is_link(item)]
        if self.impulse:
            # beside impulses it is one, too: Chipmunk's own friction of the shapes
            uses = [item for item in uses if item.name != "contact_friction"]
        exact = scene.time.scheme == "exact"
        # a constant drag is a heavier body to the kick, which costs nothing; constraints and impacts want the true mass
        eased = exact and not self.impulse and not any(_holds(item.law) for item in uses)
        eased = eased and not joined
        damped = [item for item in uses if exact and item.law.damping and not (eased and item.law.linear)]
        late = {id(item) for item in damped}
        uses.sort(key=lambda item: (_place(item, id(item) in late), _constraint_order(item.name)))
        self._uses = uses
        self._scheme = TOGETHER if damped and joined else _scheme(uses, damped)
        rate = np.zeros(n)  # kg/s, sum of the constant drags
        share = np.ones(n)  # of the force that accelerates, where something is carried along
        parameters: list[float] = []
        rows: list[int] = []
        runs: list[np.ndarray] = []
        run_starts = np.zeros((len(uses), len(blocks)), dtype=np.int64)
        n_runs = 0
        table = []
        joint_of: list[int] = []
        mask = np.zeros((len(uses), n), dtype=np.uint8)
        reach = 0.0
        for u, item in enumerate(uses):
            chosen = self._inner[scene.rows(item)]
            chosen = np.sort(chosen[chosen >= 0])
            if present.all():
                mean_radius = float(a["radius"][chosen].mean()) if len(chosen) else 1.0
            else:  # of the whole scene
                mean_radius = float(np.mean([scene.bodies[i].radius for i in scene.rows(item)] or [1.0]))
            parameters.append(mean_radius)  # r_0
            own_runs = _runs(chosen, blocks)
            run_starts[u] = n_runs + np.searchsorted(own_runs[:, 0], blocks)
            runs.append(own_runs)
            n_runs += len(own_runs)
            table.append(
                [codes.get(item.name, 0), len(parameters), len(rows), len(rows) + len(chosen), item.bodies is not None,
                 id(item) in late]
            )  # fmt: skip
            if item.law.kind == "joint":
                acts = self._joints_under(item)
                table[-1][2:4] = [len(joint_of), len(joint_of) + len(acts)]
                joint_of += acts
            values = scene.resolved(item)
            parameters += item.law.encode(values)
            if eased and item.law.linear:
                answers = np.array([self._linear_answer(item, values, mean_radius, bodies[k]) for k in chosen])
                if item.law.kind == "body":
                    rate[chosen] += answers
                else:
                    share[chosen] *= 1.0 + answers
            rows += chosen.tolist()
            mask[u, chosen] = 1
            if item.law.kind == "chain":
                for first, last in spans:  # a law acts on whole swimmers: on those of which it names a disk
                    mask[u, first:last] = mask[u, first:last].any()
            if item.law.reach:
                reach = max(reach, float(values[item.law.reach]))
        self._ease = a["mass"] / (a["mass"] + 0.5 * self.dt * rate * share)
        a["kick_mass"] = a["inverse_mass"] * self._ease * share  # while constraints have not taken their share yet
        a["parameters"] = np.array(parameters or [0.0], dtype=float)
        a["uses"] = np.array(table, dtype=np.int64).reshape(-1, len(USE_COLUMNS))
        a["rows"] = np.array(rows or [0], dtype=np.int64)
        a["runs"] = np.concatenate([np.zeros((0, 2), dtype=np.int64), *runs])
        a["run_starts"] = run_starts
        a["near_starts"] = np.zeros(len(blocks), dtype=np.int64)
        a["near_seam"] = np.zeros(len(blocks) - 1, dtype=np.uint8)
        a["mask"] = mask
        a["joint_of"] = np.array(joint_of, dtype=np.int64)

        commands = scene.commands
        times: list[float] = []
        series: list[float] = []
        a["input_at"] = np.zeros((n, 2), dtype=np.int64)
        for name, (t, value) in commands.items():
            if name in scene.ids and self._inner[scene.ids.index(name)] >= 0:
                row = self._inner[scene.ids.index(name)]
                a["input_at"][row] = len(times), len(times) + len(t)
                times += t
                series += value
        for item in scene.laws_named("drive"):
            for name in item.bodies or ():
                if name not in commands:
                    raise InputError(f"no command for body {name} in input.csv", where="law drive")
        a["input_t"] = np.array(times or [0.0])
        a["input_v"] = np.array(series or [0.0])

        has_pairs = any(item.law.kind == "pair" for item in uses)
        smallest = float(a["radius"].min()) if n else 1.0
        self._skin = skin if skin is not None else 0.4 * smallest
        self._room = (max(16 * n, 64) if n > 60 else n * n) if has_pairs else 0
        self._allocate_lists(a)
        a["walls"] = table_of(scene.walls)
        meetings = int(a["mobile"].sum()) * len(scene.walls)
        a["wall_i"], a["wall_k"] = np.zeros((2, meetings), dtype=np.uint32)
        a["wall_starts"] = np.zeros(len(blocks), dtype=np.int64)
        a["wall_met"] = np.zeros(n, dtype=np.uint8)  # bodies that Chipmunk has found to touch a wall
        a["heads"] = np.zeros(4 * n + 256, dtype=np.int64)
        a["nexts"] = np.zeros(n, dtype=np.int64)
        a["starts"] = np.zeros(n + 1, dtype=np.int64)
        a["allowance"] = np.zeros(n)
        a["reaching"] = a["radius"] + 0.5 * reach
        for name in ("sorted_x", "sorted_y", "sorted_reach"):
            a[name] = np.zeros(n)
        a["image_shift"] = np.zeros(n)  # m, what was taken off the x of a body in the Space
        a["listing"] = np.zeros(n + 1, dtype=np.int64)
        a["table_keys"] = np.zeros(64, dtype=np.int64)
        a["table_values"] = np.zeros(64, dtype=np.int64)
        mean_mass = [b.mass for b in scene.bodies if b.role == "grain"] or [b.mass for b in bodies if b.mobile] or [1.0]
        a["scalars"] = np.array(
            [scene.periodic_x or 0.0, *scene.gravity, scene.gravity_size, float(np.mean(mean_mass)),
             float(self.averaged and self.mode == "verlet"), float(self._scheme), self._links.size]
        )  # fmt: skip
        assert len(a["scalars"]) == len(SCALARS)
        a["bodies"] = np.zeros(n, dtype=np.int64)
        self._inverse_moment = np.array([1.0 / b.moment if f else 0.0 for b, f in zip(bodies, free, strict=True)])
        a["inverse_moment"] = self._inverse_moment
        a["kept"] = np.zeros((n, len(KEPT)))
        self._a = a
        floats = np.zeros(len(FLOATS))
        for name, number in {
            "t_start": scene.time.start,
            "dt": self.dt,
            "skin": self._skin,
            "least_skin": 0.1 * smallest,
            "most_skin": 1.5 * smallest,
            "reach": reach,
            "headroom": 0.001 * self._skin / self.dt,
        }.items():
            floats[_FLOAT_SLOT[name]] = number
        self._floats = floats
        own = self.units
        units = {
            "length_unit": own.length, "velocity_unit": own.velocity, "spin_unit": 1.0 / own.time,
            "force_scale": 1.0 / own.force, "torque_scale": 1.0 / own.torque,
        }  # fmt: skip
        self._fixed_skin = skin is not None
        self._turning = any(spins(item.law) for item in uses) or bool(len(self._links.rows))
        a["motion"] = motion_numbers({**units, "margin": math.inf})
        self._forget_lists()
        self._images = np.zeros(n)  # whole periods taken off the x of a body in the Space

    def _set_links(self, a: dict[str, np.ndarray], joined: list[int], at: int) -> None:
        """Hinges, rods and the joints that laws act in; the joined bodies begin at inner row ``at``."""
        scene, n = self.scene, self._n
        links = self._links = links_of(scene, self._inner) if joined else no_links()
        self._linked_scene = set(joined)
        a["group"][at : at + len(joined)] = -1
        pairs = set()
        for item in scene.links:
            rows = sorted(int(self._inner[scene.ids.index(name)]) for name in item.bodies or ())
            if len(rows) == 2 and rows[0] >= 0:
                pairs.add((rows[0], rows[1]))
                a["group"][rows] = -1
        self._apart = sorted(pairs)
        a["apart"] = np.array([i * n + j for i, j in self._apart], dtype=np.int64)
        a["link_kind"], a["link_first"], a["link_second"] = links.kind, links.first, links.second
        a["link_geometry"], a["linked"], a["mobility"] = links.geometry, links.rows, links.mobility
        self._close_links()
        names = ("link_gap", "link_arms", "link_here", "link_there", "link_matrix", "link_push", "link_q", "link_trial")
        a |= dict(zip(names, links.work, strict=True))
        joints: list[tuple[int, int, int]] = []
        places: list[tuple[float, float]] = []
        self._joint_places: dict[int, list[int]] = {}
        for k, names_of in scene.joints_of.items():
            item = scene.laws[k]
            rows = [int(self._inner[scene.ids.index(name)]) if scene.body(name).mobile else -1 for name in names_of]
            self._joint_places[k] = []
            if item.name == "pin":
                for row in rows:
                    self._joint_places[k].append(len(joints))
                    joints.append((0, -1, row))
                    places.append(item.values["anchor"])
            else:
                self._joint_places[k].append(len(joints))
                joints.append((1, -1, rows[0]) if len(rows) == 1 else (1, rows[0], rows[1]))
                places.append((0.0, 0.0))
        a["joints"] = self._a_joints = np.array(joints, dtype=np.int64).reshape(-1, 3)
        a["joint_at"] = np.array(places, dtype=float).reshape(-1, 2)

    def _close_links(self) -> None:
        """Close what rounding leaves open at the start. Raises InputError where it is more than that."""
        links = self._links
        if not len(links.rows):
            return
        q = np.column_stack([self._initial[links.rows, :2], self._turned[links.rows, 0]])
        closed, worst = links.closed(q)
        if not worst <= 1e-3 * links.size or not np.isfinite(closed).all():
            names = ", ".join(sorted({name for item in self.scene.links for name in item.bodies or ()}))
            raise InputError(
                f"the bodies ({names}) do not start where hinges and rods hold them: a gap of {worst:.3g} m",
                where="initial",
            )
        self._initial[links.rows, :2] = closed[:, :2]
        self._turned[links.rows, 0] = closed[:, 2]

    def _is_link(self, item: LawUse) -> bool:
        """Whether a pin is held together with the hinges and rods of its body."""
        return item.name == "pin" and any(self.scene.ids.index(b) in self._linked_scene for b in item.bodies or ())

    def _joints_under(self, item: LawUse) -> list[int]:
        found = [j for k in self.scene.joints_under(item) for j in self._joint_places[k]]
        wanted = None if item.bodies is None else {int(self._inner[self.scene.ids.index(b)]) for b in item.bodies}
        return [
            j
            for j in found
            if (self._a_joints[j, 0] == 1 or wanted is None or self._a_joints[j, 2] in wanted)
            and self._a_joints[j, 2] >= (0 if self._a_joints[j, 1] < 0 else -1)
        ]

    def _linear_answer(self, item: LawUse, values: dict[str, Any], mean_radius: float, body: Body) -> float:
        """What a linear law does, from the law itself: c [kg/s] of a force -c (v - u), or what is added to 1 N."""
        known = {
            "mass": body.mass, "radius": body.radius, "r0": mean_radius, "g": self.scene.gravity_size,
            "gx": self.scene.gravity[0], "gy": self.scene.gravity[1], "dt": self.dt, "t": 0.0, "x": 0.0, "y": 0.0,
            "mean_mass": float(np.mean([b.mass for b in self.scene.bodies if b.mobile])),
        }  # fmt: skip
        names = [name for p in item.law.parameters for name in p.arguments]
        known |= dict(zip(names, item.law.encode(values), strict=True))
        force = [
            item.law.function(*({**known, "vx": v, "vy": 0.0, "fx": v, "fy": 0.0}[a] for a in item.law.arguments))[0]
            for v in (0.0, 1.0)
        ]
        return float(force[0] - force[1]) if item.law.kind == "body" else float(force[1])

    def _allocate_lists(self, a: dict[str, np.ndarray]) -> None:
        # near pairs are taken four by four: the last four may reach beyond the list
        for name in ("pair_i", "pair_j", "near_i", "near_j"):
            a[name] = np.zeros(self._room + 4, dtype=np.uint32)[: self._room]
        for name in ("contact_i", "contact_j", "order"):
            a[name] = np.zeros(self._room, dtype=np.int64)
        for name in (
            "pair_shift", "near_shift", "near_touch", "near_mass", "contact_fx", "contact_fy", "contact_ti",
            "contact_tj",
        ):  # fmt: skip
            a[name] = np.zeros(self._room + 4)[: self._room]

    def _build_space(self) -> None:
        space = pymunk.Space()
        space.gravity = (0.0, 0.0)
        space.damping = 1.0
        space.iterations = 100 if self.impulse else 1
        space.sleep_time_threshold = float("inf")
        u = self.units
        a = self._a
        restitution = {b: 1.0 for b in self.scene.ids}
        for item in self.impulse:
            for name in item.bodies or self.scene.ids:
                restitution[name] = math.sqrt(item.values["restitution"])
        friction = dict.fromkeys(self.scene.ids, 0.0)
        for item in self.scene.laws_named("contact_friction") if self.impulse else ():
            for name in item.bodies or self.scene.ids:
                friction[name] = math.sqrt(item.values["mu"])  # Chipmunk takes the product of two
        touching = set(self.scene.ids) if not self.impulse else set()
        for item in self.impulse:
            touching |= set(item.bodies or self.scene.ids)
        # how bodies bounce and rub: a bit for each way, which tells Chipmunk the segments they meet
        ways = list(dict.fromkeys((restitution[b.id], friction[b.id]) for b in self.scene.bodies if b.mobile))
        self._surfaces = {way: 1 << (31 - k) for k, way in enumerate(ways if self.scene.walls else ())}
        if len(self._surfaces) > MOST_SURFACES:
            raise InputError(f"beside straight walls bodies may have {MOST_SURFACES} restitutions, got {len(ways)}")
        self._bodies: list[pymunk.Body] = []
        self._circles: list[pymunk.Circle] = []
        release = releaser(self._memory) if self._memory is not None else None
        for k, (x, y, vx, vy) in enumerate(self._initial.tolist()):
            body = self.scene.bodies[self._rows_of[k]]
            if body.mobile:
                heavy = IMMOVABLE if int(self._rows_of[k]) in self._carried else 1.0
                own = pymunk.Body(heavy * body.mass / u.mass, heavy * body.moment / u.moment)
                own.velocity = (vx / u.velocity, vy / u.velocity)
                own.angle, own.angular_velocity = float(self._turned[k, 0]), float(self._turned[k, 1] * u.time)
            else:
                own = pymunk.Body(body_type=pymunk.Body.STATIC)
            own.position = (x / u.length, y / u.length)
            if self._memory is not None and release is not None:
                settle_in(own, self._memory.ctypes.data + 8 * (ROW * k + LEAD), release)
            self._bodies.append(own)
        # bodies first, all circles afterwards: what a step touches lies close together
        for k, own in enumerate(self._bodies):
            body = self.scene.bodies[self._rows_of[k]]
            circle = pymunk.Circle(own, body.radius / u.length)
            circle.elasticity = restitution[body.id]
            circle.friction = friction[body.id]
            group = max(int(a["group"][k]), 0)
            if body.id in touching:
                surface = self._surfaces.get((restitution[body.id], friction[body.id]), 0)
                circle.filter = self._shape_filter(k, group, surface)
            else:
                circle.filter = pymunk.ShapeFilter(group=group, categories=0, mask=0)
            self._circles.append(circle)
        space.add(*self._bodies)
        self._lay_walls(space)
        self._shapes_in = False
        self._space = space
        a["bodies"][:] = [address(b._body) for b in self._bodies]
        if self._offsets is not None:
            # what the kick divides by; ``mass`` stays what it is
            kicked = slice(0, self._n_mobile)
            kick = np.array([[1.0 / body.mass for body in self._bodies[kicked]]]) * self._ease[kicked]
            stepping.write_fields(a["bodies"][kicked].copy(), np.array([self._offsets.inverse_mass]), kick)
        self._joints: list[pymunk.Constraint] = []
        self._joint_limits = np.zeros(0, dtype=np.int64)
        if self.impulse and self._offsets is not None:
            self._joints, self._joint_limits = joints_for(self.scene, self._bodies, self._inner, u, space)
        self._ghosts: list[tuple[pymunk.Body, pymunk.Circle]] = []
        if self.impulse or self.mode in ("chipmunk", "python"):
            self._add_shapes()

    def _shape_filter(self, k: int, group: int, surface: int) -> pymunk.ShapeFilter:
        """Chipmunk's filter of inner row k, of a body with the bit ``surface``.

        Joined bodies have a bit each, which their partners do not see; bits of surfaces are those of segments.
        """
        every = pymunk.ShapeFilter.ALL_MASKS()
        surfaces = sum(self._surfaces.values())
        mask = every & ~surfaces | surface
        members = sorted({row for pair in self._apart for row in pair})
        if k not in members:
            return pymunk.ShapeFilter(group=group, categories=every & ~surfaces, mask=mask)
        most = 31 - len(self._surfaces)
        if len(members) > most:
            raise InputError(f"at most {most} bodies may be joined where Chipmunk finds contacts, got {len(members)}")
        bit = {row: 1 << m for m, row in enumerate(members)}
        hidden = sum(bit[other] for pair in self._apart if k in pair for other in pair if other != k)
        return pymunk.ShapeFilter(categories=bit[k], mask=mask & ~hidden)

    def _lay_walls(self, space: pymunk.Space) -> None:
        """Chipmunk's segments of the straight walls, in one static body; with a period, their images beside them."""
        self._segments: list[pymunk.Segment] = []
        self._wall_body = pymunk.Body(body_type=pymunk.Body.STATIC)
        if not self.scene.walls:
            return
        space.add(self._wall_body)
        u, period = self.units.length, self.scene.periodic_x or 0.0
        for wall in self.scene.walls:
            for shift in (-period, 0.0, period) if period else (0.0,):
                ends = [((x + shift) / u, y / u) for x, y in (wall.begin, wall.end)]
                # Chipmunk takes the product of two: a segment for each way in which bodies bounce and rub
                for (bounce, rub), bit in self._surfaces.items():
                    segment = pymunk.Segment(self._wall_body, ends[0], ends[1], wall.radius / u)
                    segment.elasticity, segment.friction = bounce, rub
                    segment.filter = pymunk.ShapeFilter(categories=bit)
                    self._segments.append(segment)

    def _add_shapes(self) -> None:
        if not self._shapes_in:
            self._space.add(*self._circles, *self._segments)
            self._shapes_in = True

    def _remove_shapes(self) -> None:
        if self._shapes_in:
            self._space.remove(*self._circles, *self._segments)
            self._shapes_in = False

    def _context(self) -> np.ndarray:
        a = self._a
        ints = np.zeros(len(INTS), dtype=np.int64)
        counts = {
            "n": self._n, "n_mobile": self._n_mobile, "room": self._room, "n_runs": len(a["runs"]),
            "n_blocks": len(a["blocks"]) - 1,
            "first_body": 0 if self._memory is None else self._memory.ctypes.data + 8 * LEAD,
            "from_list": int(self.mode != "chipmunk"), "constrained": 1, "fixed_skin": int(self._fixed_skin),
            "n_uses": len(a["uses"]), "n_parameters": len(a["parameters"]), "n_input": len(a["input_t"]),
            "n_cells": len(a["heads"]), "n_table": len(a["table_keys"]), "n_chains": len(a["chains"]),
            "n_joints": len(a["joints"]), "n_joint_of": len(a["joint_of"]), "n_links": len(a["link_kind"]),
            "n_linked": len(a["linked"]), "n_held": len(a["link_gap"]), "n_apart": len(a["apart"]),
            "n_walls": len(a["walls"]), "n_meetings": len(a["wall_i"]),
        }  # fmt: skip
        for name, value in counts.items():
            ints[_SLOT[name]] = value
        for name in INTS[INTS.index("bodies") :]:
            array = self._floats if name == "floats" else a[name]
            assert array.flags.c_contiguous
            ints[_SLOT[name]] = array.ctypes.data
        return ints

    def _install_native(self) -> None:
        assert self._kernel is not None and self._offsets is not None
        kernel = self._kernel
        self._ints = self._context()
        # the constraint holds two private bodies together with a spring of no strength: only its
        # preSolve matters, which comes after collision detection and before any kick
        anchors = [lib.cpBodyNew(1.0, 1.0), lib.cpBodyNew(1.0, 1.0)]
        hook = lib.cpDampedSpringNew(anchors[0], anchors[1], (0, 0), (0, 0), 1.0, 0.0, 0.0)
        which = kernel.verlet_step if self.mode == "verlet" else kernel.chipmunk_step
        lib.cpConstraintSetPreSolveFunc(hook, ffi.cast("cpConstraintPreSolveFunc", which.address))
        lib.cpConstraintSetUserData(hook, ffi.cast("void *", self._ints.ctypes.data))
        lib.cpSpaceAddConstraint(self._space._space, hook)
        if self._motion is not None and self._memory is not None and (self._in_place or self.mode == "chipmunk"):
            self._ints[_SLOT["own_drift"]] = self._ints[_SLOT["own_kick"]] = 1
            front = self._memory.view(np.int64)
            front[:, NUMBERS] = self._a["motion"].ctypes.data
            if not self._in_place:
                front[:, OWN_ROW] = self._a["state"].ctypes.data + 8 * ROW * np.arange(self._n)
            self._moving = "turning" if self._in_place else "apart"
            self._let_move(self._moving)
        handler = before = None
        if self.mode == "chipmunk" and not self.impulse:
            handler = lib.cpSpaceAddGlobalCollisionHandler(self._space._space)
            before = handler.preSolveFunc
            handler.preSolveFunc = ffi.cast("cpCollisionPreSolveFunc", kernel.contact_presolve.address)
            handler.userData = ffi.cast("void *", self._ints.ctypes.data)
        keep = (self._a, self._floats, self._ints, kernel, self._motion)
        self._close = weakref.finalize(
            self, _uninstall, self._space, hook, anchors, (handler, before), self._bodies[: self._n_mobile],
            self._ghosts, self._offsets, keep,
        )  # fmt: skip
        if self.mode == "chipmunk":
            self._lay_out_seam()

    def _let_move(self, how: str) -> None:
        """Which drift and kick Chipmunk calls: in place "turning" or "still" (disks keep their angle), or "apart"."""
        assert self._motion is not None and self._offsets is not None and self._memory is not None
        m = self._motion
        drift, kick = {
            "still": (m.drift, m.kick),
            "turning": (m.drift_turning, m.kick_turning),
            "apart": (m.drift_apart, m.kick_apart),
        }[how]
        rows = self._memory[: self._n_mobile].view(np.int64)
        rows[:, column(self._offsets.drift)] = drift
        rows[:, column(self._offsets.kick)] = kick

    # ---- the seam (Chipmunk knows no periodic boundary) --------------------------------------------

    def _lay_out_seam(self, wrap: bool = True) -> None:
        """Wrap the bodies in the Space, and put ghosts of those near the left edge one period on."""
        a = self._a
        length = self.scene.periodic_x
        if not length:
            self._fill_table({})
            self._floats[_FLOAT_SLOT["margin"]] = np.inf
            return
        largest = float(a["radius"].max())
        margin = largest  # how far a body may go before this is done again
        self._floats[_FLOAT_SLOT["margin"]] = 0.8 * margin
        period = length / self.units.length
        for k in range(self._n):
            body = self._bodies[k]
            position = body.position
            turns = math.floor(position.x / period)
            if turns and wrap:
                body.position = (position.x - turns * period, position.y)
                self._images[k] += turns
                if self._shapes_in:
                    self._space.reindex_shapes_for_body(body)
        for ghost, circle in self._ghosts:
            self._space.remove(ghost, circle)
        self._ghosts.clear()
        self._ghost_originals: list[int] = []
        values = {}
        shell = (2 * largest + 2 * margin) / self.units.length
        for k in range(self._n):
            original = self._bodies[k]
            # bodies a little left of the edge (wrapped to the far right) are met as originals
            if original.position.x < shell:
                ghost = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
                ghost.position = (original.position.x + period, original.position.y)
                circle = pymunk.Circle(ghost, self._circles[k].radius)
                circle.filter = pymunk.ShapeFilter(group=10**6)
                self._ghosts.append((ghost, circle))
                self._ghost_originals.append(k)
                self._space.add(ghost, circle)
                if self._offsets is not None:
                    _point_ghost(ghost, original, period, self._offsets)
                    assert self._kernel is not None
                    lib.cpBodySetPositionUpdateFunc(
                        ghost._body, ffi.cast("cpBodyPositionFunc", self._kernel.ghost_position.address)
                    )
                values[address(ghost._body)] = -k - 2
        self._fill_table(values)
        x, y = self._positions_inner()
        a["near_x"][:] = x - self._images * length
        a["near_y"][:] = y
        a["motion"][MOTION.index("margin")] = self._floats_margin() ** 2
        a["image_shift"][:] = self._images * length

    def _floats_margin(self) -> float:
        return float(self._floats[_FLOAT_SLOT["margin"]])

    def _fill_table(self, ghosts: dict[int, int]) -> None:
        """Open-addressing table from a body's address to its row."""
        if self._offsets is None:
            return
        a = self._a
        entries = ghosts | {address(self._wall_body._body): WALL}
        if self._memory is None:
            entries |= {int(key): k for k, key in enumerate(a["bodies"])}
        size = 64
        while size < 3 * len(entries):
            size *= 2
        a["table_keys"] = np.zeros(size, dtype=np.int64)
        a["table_values"] = np.zeros(size, dtype=np.int64)
        for key, value in entries.items():
            k = ((key >> 4) * 2654435761) & (size - 1)
            while a["table_keys"][k]:
                k = (k + 1) & (size - 1)
            a["table_keys"][k], a["table_values"][k] = key, value
        self._refresh_context()

    def _refresh_context(self) -> None:
        fresh = self._context()
        for name in (*INTS[INTS.index("bodies") :], "room", "n_table"):
            self._ints[_SLOT[name]] = fresh[_SLOT[name]]

    # ---- time ---------------------------------------------------------------------------------

    @property
    def t(self) -> float:
        """Time [s]."""
        if self._event_time is not None:
            return self._event_time
        return self.scene.time.start + self.step * self.dt

    def _array_forces(
        self, constrained: bool, t: float, state: np.ndarray | None = None, in_step: bool = False
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forces and torques [N, N m] at the positions and velocities in ``state``; left out, those of now.

        ``in_step``: the velocities are those of half a step before, as in a step.
        """
        a = self._a
        assert self._kernel is not None
        c = self._columns
        if state is None:
            state = self._rows_of_now()
        for name in ("fx", "fy", "torque"):
            state[:, c[name]] = 0.0
        reach = float(self._floats[_FLOAT_SLOT["reach"]])
        x, y = state[:, c["x"]].copy(), state[:, c["y"]].copy()
        if self._room:
            self._fresh_list(x, y, reach)
            neighbours.prune(
                x, y, a["radius"] + 0.5 * reach, a["inverse_mass"], a["radius"], a["starts"], a["blocks"], a["pair_i"],
                a["pair_j"], a["pair_shift"], a["near_i"], a["near_j"], a["near_shift"], a["near_touch"],
                a["near_mass"], a["near_starts"], a["near_seam"], ROW,
            )  # fmt: skip
            neighbours.near_walls(
                x, y, a["radius"], a["mobile"], a["walls"], self.scene.periodic_x or 0.0, a["blocks"], a["wall_i"],
                a["wall_k"], a["wall_starts"],
            )  # fmt: skip
        self._forget_lists()
        plain = a["scalars"].copy()  # forces of this moment, not of a step
        plain[SCALARS.index("share")] = 0.0
        if not in_step:
            plain[SCALARS.index("scheme")] = HALF_STEP
        self._kernel.add_forces(
            1, int(constrained), t, self.dt, state, a["mass"], a["inverse_mass"], a["radius"], a["given_inertia"],
            a["parameters"], a["uses"], a["runs"], a["run_starts"], a["blocks"], a["mask"], a["near_i"], a["near_j"],
            a["near_shift"], a["near_touch"], a["near_mass"], a["near_starts"], a["near_seam"], plain,
            a["chains"], a["input_t"], a["input_v"], a["input_at"], a["which"], a["work"], a["kick_mass"],
            a["inverse_moment"], a["kept"], *(a[name.strip()] for name in f"{LINKS}, {WALLS}".split(",")),
        )  # fmt: skip
        return state[:, c["fx"]], state[:, c["fy"]], state[:, c["torque"]]

    def _rows_of_now(self, raw: dict[str, np.ndarray] | None = None) -> np.ndarray:
        """Rows as the laws see them, apart from Chipmunk's memory, at the present positions and velocities."""
        state = np.zeros((self._n, ROW))
        for name, values in (raw or self._raw_inner()).items():
            if name in self._columns:
                state[:, self._columns[name]] = values
        return state

    def _fresh_list(self, x: np.ndarray, y: np.ndarray, extra: float) -> int:
        a = self._a
        while True:
            count = neighbours.build_list(
                x, y, a["radius"], a["mobile"], a["group"], a["apart"], extra, self.scene.periodic_x or 0.0,
                a["pair_i"], a["pair_j"], a["pair_shift"], a["heads"], a["nexts"], a["sorted_x"], a["sorted_y"],
                a["sorted_reach"],
                a["near_i"], a["near_j"], a["starts"],
            )  # fmt: skip
            if count in (neighbours.NOT_FINITE, neighbours.ESCAPED):
                raise self._lost()
            if count != neighbours.OVERFLOW:
                return int(count)
            self._grow()

    def _grow(self) -> None:
        """Twice the room for pairs; a list is never cut short."""
        if self._room > 400 * self._n + 10**6:
            raise SimulationError(f"more than {self._room} pairs for {self._n} bodies: the bed has collapsed")
        self._room *= 2
        self._allocate_lists(self._a)
        self._forget_lists()
        if hasattr(self, "_ints"):
            self._refresh_context()

    def _forget_lists(self) -> None:
        """The next step builds the neighbour lists anew."""
        self._a["old_x"][:] = np.inf
        self._floats[_FLOAT_SLOT["lasts"]] = -np.inf

    def _begin(self) -> None:
        """The first kick: velocities half a step ahead of the positions."""
        if self._started:
            return
        self._started = True
        if self._start_kind == "leapfrog":
            return
        if self.mode == "python":
            self._python.begin()
            return
        half = 0.5 * self.dt
        weight = self._a["inverse_mass"]
        state = self._rows_of_now()
        c = self._columns
        start_x, start_y, start_spin = (state[:, c[name]].copy() for name in ("vx", "vy", "spin"))
        turning = self._inverse_moment
        held = self._held_rows()
        fx, fy, torque = (f.copy() for f in self._array_forces(True, self.t, state))
        # bodies that no constraint holds: half a kick
        vx, vy = start_x + half * (fx * weight), start_y + half * (fy * weight)
        spin = start_spin + half * torque * turning
        if held.any():
            # a constraint sees the velocity half a step behind, here as in every later step: that velocity
            # is what the force of the constraint itself leads to, found in two rounds
            fx, fy, moment = self._array_forces(False, self.t, state)
            for _ in range(2):
                state[:, c["vx"]] = np.where(held, start_x - half * fx * weight, start_x)
                state[:, c["vy"]] = np.where(held, start_y - half * fy * weight, start_y)
                state[:, c["spin"]] = np.where(held, start_spin - half * moment * turning, start_spin)
                fx, fy, moment = self._array_forces(True, self.t, state, in_step=True)
            vx = np.where(held, state[:, c["vx"]] + self.dt * fx * weight, vx)
            vy = np.where(held, state[:, c["vy"]] + self.dt * fy * weight, vy)
            spin = np.where(held, state[:, c["spin"]] + self.dt * moment * turning, spin)
        u, o = self.units, self._offsets
        if o is not None:
            mobile = slice(0, self._n_mobile)
            stepping.write_fields(
                self._a["bodies"][mobile].copy(), np.array([o.velocity, o.velocity + 8]),
                np.array([vx[mobile], vy[mobile]]) / u.velocity,
            )  # fmt: skip
        else:
            for k in range(self._n_mobile):
                self._bodies[k].velocity = (vx[k] / u.velocity, vy[k] / u.velocity)
        for row in np.flatnonzero(spin[: self._n_mobile]):
            self._bodies[int(row)].angular_velocity = float(spin[row] * u.time)
        self._a["fx"][:], self._a["fy"][:] = fx, fy

    def _held_rows(self) -> np.ndarray:
        """(n,) bool, inner order: bodies under a constraint that looks at the velocity."""
        held = np.zeros(self._n, dtype=bool)
        held[self._links.rows] = True
        for u, item in enumerate(self._uses):
            if item.law.kind == "constraint" and {"vx", "vy"} & set(item.law.arguments):
                held |= self._a["mask"][u].astype(bool)
        return held

    def restart(self, xy: np.ndarray, v: np.ndarray, t: float, spin: np.ndarray | None = None) -> None:
        """Begin again from other positions (n, 2) [m] and velocities (n, 2) [m/s] of the scene's bodies at t [s].

        Many times cheaper than a new Simulation of many bodies, and the same run: disks that do not spin (those in
        hinges turn as their places and velocities say), velocities at the time of the positions. Walls go where ``xy``
        says. Verlet mode only.

        spin : (n,) [rad/s] of disks that do spin, for those in no hinge
        """
        if self.mode != "verlet":
            raise InputError("only a simulation in mode verlet can begin again")
        u = self.units
        rows = self._rows_of
        self._initial = np.column_stack([xy, v])[rows]
        self._initial[self._n_mobile :, 2:] = 0.0
        turned = angles_of(self.scene, xy, v)
        if spin is not None:
            free = np.array([b not in hinged(self.scene) for b in self.scene.ids])
            turned = (turned[0], np.where(free, spin, turned[1]))
        self._turned = np.stack(turned, axis=1)[rows]
        self._close_links()
        self._images[:] = 0.0
        place, speed = self._initial[:, :2] / u.length, self._initial[:, 2:] / u.velocity
        self._remove_shapes()  # and with them Chipmunk's contacts and their impulses
        self._set_bodies(place[:, 0], place[:, 1], speed[:, 0], speed[:, 1], self._turned[:, 0],
                         self._turned[:, 1] * u.time)  # fmt: skip
        if not self._in_place:
            for k, name in enumerate(("x", "y")):
                self._a[name][:] = self._initial[:, k]  # walls are not read again
        self.scene = replace(self.scene, time=replace(self.scene.time, start=float(t)))
        if self.impulse:
            self._add_shapes()
            self._event_time, self._last_step = None, self.dt
            self._floats[_FLOAT_SLOT["dt"]] = self.dt
        self._floats[_FLOAT_SLOT["t_start"]] = t
        self._floats[_FLOAT_SLOT["step"]] = 0.0
        self._ints[_SLOT["status"]] = 0
        self.step, self._started, self._start_kind = 0, False, "synchronised"
        self._forget_lists()

    def steer(self, v: np.ndarray) -> None:
        """From now on the carried bodies move at ``v`` (n, 2) [m/s], of the scene's bodies; other rows are not read."""
        assert self._offsets is not None
        rows = np.flatnonzero((self._a["mobile"] == 0)[: self._n_mobile])
        speed = np.asarray(v, dtype=float)[self._rows_of[rows]] / self.units.velocity
        o = self._offsets
        stepping.write_fields(
            self._a["bodies"][rows].copy(), np.array([o.velocity, o.velocity + 8]), np.ascontiguousarray(speed.T)
        )
        if not self._in_place:
            for k, name in enumerate(("vx", "vy")):
                self._a[name][rows] = speed[:, k] * self.units.velocity

    def advance(self, steps: int) -> None:
        """Do that many steps. Raises SimulationError when a number is no longer finite."""
        self._begin()
        if self.mode == "python":
            self._python.advance(steps)
            return
        if self.mode == "batch":
            self._batch.advance(steps)
            return
        if self.impulse:
            self._advance_events(np.array([self.t + steps * self.dt]), np.zeros(0, dtype=np.int64))
            return
        if self.mode == "verlet":
            self._remove_shapes()
        left = steps
        while left > 0:
            self._take()
            saved = self._save()
            done = stepping.advance(
                step_address(), address(self._space._space), self.dt / self.units.time, left, self._ints,
                _SLOT["status"], _SLOT["margin_crossed"],
            )  # fmt: skip
            self._settle()
            if self._interrupted(saved):
                continue
            self.step += int(done)
            left -= int(done)

    def _advance_events(self, ends: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Go on to times ``ends`` [s] in steps that end at impacts; positions of inner ``rows`` there."""
        a = self._a
        assert self._offsets is not None
        touching = np.array([circle.filter.mask != 0 for circle in self._circles], dtype=np.uint8)
        radius = a["radius"] / self.units.length
        out = np.full((len(ends), len(rows), 2), np.nan)
        reached, last = events.advance_to(
            step_address(), address(self._space._space), last_step_offset(), self.t, ends, self.dt, self.units.time,
            self._ints, _SLOT["status"], self._floats, _FLOAT_SLOT["t_start"], _FLOAT_SLOT["dt"], _FLOAT_SLOT["step"],
            _FLOAT_SLOT["lasts"], a["bodies"], radius, a["group"], a["apart"], touching, a["mobile"],
            self._offsets.position, self._offsets.velocity, self.units.length, self.units.velocity, self._last_step,
            a["walls"] / self.units.length, _SLOT["constrained"], self._joint_limits, a["fx"], a["fy"],
            a["inverse_mass"], self.stretch, a["bodies"][rows].copy(), out,
        )  # fmt: skip
        self._event_time, self._last_step = float(reached), float(last)
        self.step = max(round((reached - self.scene.time.start) / self.dt), 1)
        self._interrupted(())
        return out

    def _take(self) -> None:
        """Before Chipmunk steps in place: what the user put on the bodies goes to the coming force call."""
        if not self._in_place:
            return
        a, o = self._a, self._offsets
        assert o is not None and self._memory is not None
        turns, pushed = stepping.take(
            self._memory, self._n_mobile, column(o.force), column(o.torque), column(o.spin), a["push"]
        )
        self._ints[_SLOT["pushed"]] = int(pushed)
        how = "turning" if turns or self._turning else "still"
        if how != self._moving:
            self._moving = how
            self._let_move(how)

    def _settle(self) -> None:
        """After steps in place: the forces of the last one to their arrays, Chipmunk's transforms renewed."""
        if not self._in_place:
            return
        a, o = self._a, self._offsets
        assert o is not None and self._memory is not None
        stepping.settle(
            self._memory, self._n_mobile, column(o.force), column(o.torque), column(o.position), column(o.transform),
            a["fx"], a["fy"], a["torque"],
        )  # fmt: skip

    def _write(self, fields: dict[int, np.ndarray]) -> None:
        """Fields of all bodies by their offsets, in engine units."""
        values = np.ascontiguousarray(np.stack(list(fields.values())))
        stepping.write_fields(self._a["bodies"], np.array(list(fields)), values)

    def _save(self) -> tuple[Any, ...]:
        # what a neighbour list that overflowed in the middle of a block goes back to
        if self._room >= self._n * self._n:
            return ()
        return (self._raw_inner(), float(self._floats[_FLOAT_SLOT["step"]]))

    def _interrupted(self, saved: tuple[Any, ...]) -> bool:
        """Deal with what the callbacks reported; True: the block was taken back."""
        ints = self._ints
        status = int(ints[_SLOT["status"]])
        if status in (neighbours.NOT_FINITE, neighbours.ESCAPED):
            self.step = int(self._floats[_FLOAT_SLOT["step"]])
            raise self._lost()
        if status == neighbours.OVERFLOW:
            ints[_SLOT["status"]] = 0
            ints[_SLOT["n_contacts"]] = 0
            if not saved:
                raise SimulationError("the neighbour list is full")
            self._grow()
            self._restore_inner(saved[0])
            self._floats[_FLOAT_SLOT["step"]] = saved[1]
            return True
        if ints[_SLOT["margin_crossed"]]:
            ints[_SLOT["margin_crossed"]] = 0
            self._lay_out_seam()
        return False

    def _lost(self) -> SimulationError:
        x, y = self._positions_inner()
        away = np.hypot(x, y)
        lost = int(np.argmax(np.where(np.isfinite(away), away, np.inf)))
        what = f"is {away[lost]:.3g} m away" if np.isfinite(away[lost]) else "is not finite"
        return SimulationError(
            f"the position of body {self.scene.bodies[self._rows_of[lost]].id} {what} after step {self.step + 1} "
            f"(t = {self.t:.6g} s, dt = {self.dt:.3g} s); a smaller dt may help"
        )

    def run(self, duration: float, progress: Callable[[int, int], None] | None = None) -> State:
        """Run for ``duration`` [s] in blocks, calling ``progress(done, total)`` between them."""
        total = max(round(duration / self.dt), 0)
        block = max(total // 200, 1)
        done = 0
        while done < total:
            size = min(block, total - done)
            self.advance(size)
            done += size
            if progress is not None:
                progress(done, total)
        return self.state()

    def sample(self, times: Sequence[float] | np.ndarray, rows: Sequence[int] | np.ndarray | None = None) -> np.ndarray:
        """Run on and return positions at these times [s] (rising, from now on): (T, k, 2) [m], unwrapped.

        ``rows`` of ``scene.bodies``; left out, all.
        """
        times = np.asarray(times, dtype=float)
        if len(times) and (np.any(np.diff(times) < 0) or times[0] < self.t - 1e-9 * self.dt):
            raise InputError("times should rise and not lie before the present one")
        chosen = np.arange(self._n) if rows is None else np.asarray(rows, dtype=np.int64)
        inner = self._inner[chosen]
        if (inner < 0).any():
            raise InputError(f"body {self.scene.bodies[int(chosen[inner < 0][0])].id} is not simulated here")
        out = np.full((len(times), len(chosen), 2), np.nan)
        if not len(times):
            return out
        self._begin()
        if self.impulse and self._offsets is not None:
            return self._advance_events(times, inner)
        steps = np.floor((times - self.scene.time.start) / self.dt + 1e-9).astype(np.int64)
        ahead = times - (self.scene.time.start + steps * self.dt)
        if self.mode in ("python", "batch"):
            for s in range(len(times)):
                self.advance(int(steps[s]) - self.step)
                raw = self._raw_inner()
                out[s, :, 0] = raw["x"][inner] + raw["vx"][inner] * ahead[s]
                out[s, :, 1] = raw["y"][inner] + raw["vy"][inner] * ahead[s]
            return out
        if self.mode == "verlet" and not self.impulse:
            self._remove_shapes()
        assert self._offsets is not None
        addresses = self._a["bodies"][inner].copy()
        sample = 0
        while sample < len(times):
            self._take()
            saved = self._save()
            at = self.step
            shift = self._images[inner] * (self.scene.periodic_x or 0.0)
            sample, step = stepping.advance_and_sample(
                step_address(), address(self._space._space), self.dt / self.units.time, sample, self.step, steps,
                ahead, self._ints, _SLOT["status"], _SLOT["margin_crossed"], addresses, shift,
                self._offsets.position, self._offsets.velocity, self.units.length, self.units.velocity, out,
            )  # fmt: skip
            self._settle()
            if self._interrupted(saved):
                sample = int(np.searchsorted(steps, at))
                continue
            self.step = int(step)
        return out

    # ---- what there is --------------------------------------------------------------------------

    def _positions_inner(self) -> tuple[np.ndarray, np.ndarray]:
        raw = self._raw_inner()
        return raw["x"], raw["y"]

    def _raw_inner(self) -> dict[str, np.ndarray]:
        """What Chipmunk has, in SI and inner order: unwrapped x, y, half-step velocities, angle, spin."""
        n = self._n
        result = {name: np.empty(n) for name in ("x", "y", "vx", "vy", "angle", "spin")}
        u = self.units
        if self._offsets is not None:
            o = self._offsets
            stepping.read_fields(
                self._a["bodies"], np.array([o.position, o.position + 8, o.velocity, o.velocity + 8, o.angle, o.spin]),
                fields := np.empty((6, n)),
            )  # fmt: skip
            result = dict(zip(("x", "y", "vx", "vy", "angle", "spin"), fields, strict=True))
        else:
            for k, body in enumerate(self._bodies):
                result["x"][k], result["y"][k] = body.position
                result["vx"][k], result["vy"][k] = body.velocity
                result["angle"][k], result["spin"][k] = body.angle, body.angular_velocity
        result["x"] *= u.length
        result["y"] *= u.length
        result["vx"] *= u.velocity
        result["vy"] *= u.velocity
        result["spin"] /= u.time
        if self.scene.periodic_x:
            result["x"] += self._images * self.scene.periodic_x
        return result

    def _restore_inner(self, raw: dict[str, np.ndarray]) -> None:
        u = self.units
        period = self.scene.periodic_x or 0.0
        x, y = (raw["x"] - self._images * period) / u.length, raw["y"] / u.length
        self._set_bodies(
            x, y, raw["vx"] / u.velocity, raw["vy"] / u.velocity, raw["angle"], raw["spin"] * u.time
        )  # fmt: skip
        self._forget_lists()

    def _frozen(self) -> dict[str, np.ndarray]:
        """What a checkpoint keeps of each body, inner order: Chipmunk's fields, and the forces of the last step."""
        names = ("x", "y", "vx", "vy", "angle", "spin")
        if self._offsets is not None:
            o = self._offsets
            fields = np.array([o.position, o.position + 8, o.velocity, o.velocity + 8, o.angle, o.spin])
            stepping.read_fields(self._a["bodies"], fields, values := np.empty((6, self._n)))
        else:
            values = np.array(
                [(*b.position, *b.velocity, b.angle, b.angular_velocity) for b in self._bodies]
            ).reshape(self._n, 6).T  # fmt: skip
        result = dict(zip(names, values, strict=True)) | {"images": self._images}
        result |= {name: self._a[name] for name in ("fx", "fy", "torque")}
        laid = ("near_x", "near_y") if self.mode == "chipmunk" else ("old_x", "old_y")
        result |= {"laid_x": np.nan_to_num(self._a[laid[0]]), "laid_y": np.nan_to_num(self._a[laid[1]])}
        return result | {"vx_start": self._initial[:, 2], "vy_start": self._initial[:, 3]}

    def _thaw(self, arrays: dict[str, np.ndarray], step: int, begun: bool) -> None:
        """The counterpart of ``_frozen``: go on from there."""
        if any(array.shape != (self._n,) for array in arrays.values()):
            raise InputError(f"the checkpoint has other bodies than its scene, which has {self._n}")
        self._images[:] = arrays["images"]
        self._initial[:, 2], self._initial[:, 3] = arrays["vx_start"], arrays["vy_start"]
        self._set_bodies(*(arrays[name] for name in ("x", "y", "vx", "vy", "angle", "spin")))
        for name in ("fx", "fy", "torque"):
            self._a[name][:] = arrays[name]
        self.step, self._started = step, begun
        if hasattr(self, "_ints"):
            self._floats[_FLOAT_SLOT["step"]] = float(step)
        self._forget_lists()
        if self.mode == "chipmunk":
            # ghosts where bodies are; who is wrapped, and when next, stays as it was: wrapping rounds
            self._lay_out_seam(wrap=False)
            self._a["near_x"][:], self._a["near_y"][:] = arrays["laid_x"], arrays["laid_y"]
        elif self.mode == "python":
            self._python.resume()

    def _set_bodies(
        self, x: np.ndarray, y: np.ndarray, vx: np.ndarray, vy: np.ndarray, angle: np.ndarray, spin: np.ndarray
    ) -> None:
        """Put the bodies there [engine units], free of forces."""
        if self._offsets is None:
            for k, body in enumerate(self._bodies):
                body.position = (x[k], y[k])
                if k < self._n_mobile:
                    body.velocity, body.angle, body.angular_velocity = (vx[k], vy[k]), angle[k], spin[k]
                    body.force, body.torque = (0.0, 0.0), 0.0
            return
        o = self._offsets
        self._write(
            {
                o.position: x, o.position + 8: y, o.transform: x, o.transform + 8: y, o.velocity: vx,
                o.velocity + 8: vy, o.angle: angle, o.spin: spin,
                **dict.fromkeys((o.force, o.force + 8, o.torque), np.zeros(self._n)),
            }
        )  # fmt: skip

    def raw(self) -> dict[str, np.ndarray]:
        """Leapfrog arrays in scene order: x, y [m], vx, vy [m/s] of the coming drift, angle, spin."""
        self._begin()
        inner = self._raw_inner()
        return {name: self._of_scene(values) for name, values in inner.items()}

    def _of_scene(self, values: np.ndarray) -> np.ndarray:
        """Values in inner order (n, ...) in that of the scene, NaN for bodies that are not simulated."""
        result = values[self._inner]
        result[self._inner < 0] = np.nan
        return result

    def _synchronised(self) -> dict[str, np.ndarray]:
        """What Chipmunk has, velocities and spins taken back by the half kick."""
        raw = self._raw_inner()
        if self._started and (self.step > 0 or self._start_kind == "synchronised"):
            half = 0.5 * self.dt
            m = slice(0, self._n_mobile)
            a = self._a
            if self.step > 0:
                raw["vx"][m] -= half * a["fx"][m] * a["inverse_mass"][m] * self._ease[m]
                raw["vy"][m] -= half * a["fy"][m] * a["inverse_mass"][m] * self._ease[m]
                raw["spin"][m] -= half * a["torque"][m] * self._inverse_moment[m]
            else:
                raw["vx"], raw["vy"] = self._initial[:, 2:].T.copy()
                raw["spin"][:] = self._turned[:, 1]
        return raw

    def state(self) -> State:
        """The state at the present time, velocities taken back by the half kick [m, m/s, rad, rad/s]."""
        raw = self._synchronised()
        self._turn_rods(raw)
        return State(
            t=self.t,
            xy=self._of_scene(np.column_stack([raw["x"], raw["y"]])),
            v=self._of_scene(np.column_stack([raw["vx"], raw["vy"]])),
            angle=self._of_scene(raw["angle"]),
            spin=self._of_scene(raw["spin"]),
        )

    def _turn_rods(self, raw: dict[str, np.ndarray]) -> None:
        """Angle and spin of a pinned body are those of its rod."""
        for item in self.scene.laws_named("pin"):
            k = self._inner[self.scene.rows(item)]
            dx = raw["x"][k] - item.values["anchor"][0]
            dy = raw["y"][k] - item.values["anchor"][1]
            raw["angle"][k] = np.arctan2(dx, -dy)
            raw["spin"][k] = (dx * raw["vy"][k] - dy * raw["vx"][k]) / (dx * dx + dy * dy)

    def forces(self) -> np.ndarray:
        """(n, 2) sum of all forces on each body at the last force call [N]."""
        self._begin()
        if self.mode == "python":
            return self._python.forces()[self._inner]
        if self.step == 0:
            result = np.column_stack(self._array_forces(True, self.t)[:2])
        else:
            result = np.column_stack([self._a["fx"], self._a["fy"]]) * self._ease[:, None]
        result[self._n_mobile :] = 0.0
        return self._of_scene(result)

    def overlaps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Overlapping pairs that a pair law acts on: rows i, j of ``scene.bodies``, and overlap/smaller radius."""
        self._begin()
        if not self._room:
            empty = np.zeros(0, dtype=np.int64)
            return empty, empty, np.zeros(0)
        raw = self._raw_inner()
        a = self._a
        count = self._fresh_list(raw["x"], raw["y"], 0.0)
        i, j = a["pair_i"][:count].astype(np.int64), a["pair_j"][:count].astype(np.int64)
        self._forget_lists()
        dx = raw["x"][j] - raw["x"][i]
        if self.scene.periodic_x:
            dx -= self.scene.periodic_x * np.floor(dx / self.scene.periodic_x + 0.5)
        overlap = a["radius"][i] + a["radius"][j] - np.hypot(dx, raw["y"][j] - raw["y"][i])
        return self._rows_of[i], self._rows_of[j], overlap / np.minimum(a["radius"][i], a["radius"][j])

    def contacts(self) -> Contacts:
        """Touching pairs with the normal force of all pair laws, velocities at the time of the positions."""
        raw = self._synchronised()
        a = self._a
        if not self._room:
            empty = np.zeros(0, dtype=np.int64)
            return Contacts(empty, empty, np.zeros((0, 2)), np.zeros(0), np.zeros(0))
        count = self._fresh_list(raw["x"], raw["y"], 0.0)
        i, j = a["pair_i"][:count].astype(np.int64), a["pair_j"][:count].astype(np.int64)
        self._forget_lists()  # the running list is gone; a new one has the same pairs within reach
        dx = raw["x"][j] - raw["x"][i]
        if self.scene.periodic_x:
            dx -= self.scene.periodic_x * np.floor(dx / self.scene.periodic_x + 0.5)
        dy = raw["y"][j] - raw["y"][i]
        distance = np.hypot(dx, dy)
        normal = np.column_stack([dx, dy]) / np.where(distance > 0, distance, 1.0)[:, None]
        force = np.empty(count)
        if self._kernel is None:
            for k in range(count):
                px, py, _, _ = self._python.pair_force(int(i[k]), int(j[k]), self.t, raw)
                force[k] = px * normal[k, 0] + py * normal[k, 1]
        else:
            self._kernel.pair_forces(
                i, j, normal, self.t, self._rows_of_now(raw), a["inverse_mass"], a["radius"], a["parameters"],
                a["uses"], a["mask"], a["scalars"], force,
            )  # fmt: skip
        rows = self._rows_of
        oi, oj = rows[i], rows[j]
        flip = oi > oj
        normal[flip] *= -1
        oi, oj = np.where(flip, oj, oi), np.where(flip, oi, oj)
        return Contacts(oi, oj, normal, force, a["radius"][i] + a["radius"][j] - distance)

    @property
    def space(self) -> pymunk.Space:
        """The ordinary ``pymunk.Space`` (engine units, see ``units``), with a Circle on every Body.

        In verlet mode the circles are in the Space while you look, and out of it while it runs fast.
        """
        self._add_shapes()
        for body in self._bodies[: self._n_mobile]:
            body.angle = body.angle  # renews Chipmunk's rotation, which the lean drift leaves alone
        self._space.reindex_shapes_for_body(self._space.static_body)
        for circle in self._circles[: self._n_mobile]:
            circle.cache_bb()
        return self._space

    def body(self, name: str) -> pymunk.Body:
        """The ``pymunk.Body`` of a body of the scene (engine units)."""
        self.scene.body(name)
        return self._bodies[int(self._inner[self.scene.ids.index(name)])]

    @property
    def diagnostics(self) -> dict[str, Any]:
        """Mode, steps and neighbour lists built."""
        result: dict[str, Any] = {"mode": self.mode, "dt": self.dt, "steps": self.step, "scene": self.scene.identity}
        if hasattr(self, "_ints"):
            result["neighbour_lists"] = int(self._ints[_SLOT["rebuilds"]])
        return result


def _place(item: LawUse, damped: bool) -> float:
    """Order of the kinds; in the exact scheme dampings come behind all they act against, but before constraints."""
    if damped:
        return KIND_ORDER["body"] + (0.4 if item.law.kind == "chain" else 0.5)
    return KIND_ORDER[item.law.kind]


def _scheme(uses: Sequence[LawUse], damped: Sequence[LawUse]) -> int:
    """How dampings see the velocity: as it is, body after body, or together where constraints or chains join them."""
    if not damped:
        return HALF_STEP
    if any(_holds(item.law) for item in uses):
        return TOGETHER
    return CHAINS if any(item.law.kind == "chain" for item in damped) else ALONE


def _holds(law: Law) -> bool:
    """Whether a law holds bodies back: a constraint that does more than take a share of the force."""
    return law.kind == "constraint" and not law.linear


def _constraint_order(name: str) -> int:
    # what changes the inertia comes first; a rail gives way to the drive along it; a pin comes before both
    return {"pin": 1, "rail": 2, "drive": 3}.get(name, 0)


def _in_columns(scene: Scene, rows: list[int]) -> list[int]:
    """Rows sorted by place: columns along x, from bottom to top in each."""
    if not rows:
        return rows
    bodies = [scene.bodies[i] for i in rows]
    xy = np.array([b.initial[:2] for b in bodies if b.initial is not None])
    width = 2 * max(b.radius for b in bodies)
    x = np.mod(xy[:, 0], scene.periodic_x) if scene.periodic_x else xy[:, 0] - xy[:, 0].min()
    return [rows[k] for k in np.lexsort((xy[:, 1], np.floor(x / width)))]


def _runs(rows: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """Sorted rows as half-open ranges (k, 2), none across the edge of a block: loops over bodies need no table."""
    if not len(rows):
        return np.zeros((0, 2), dtype=np.int64)
    ends = np.flatnonzero((np.diff(rows) > 1) | (np.diff(np.searchsorted(blocks, rows, side="right")) > 0))
    first = rows[np.concatenate([[0], ends + 1])]
    last = rows[np.concatenate([ends, [len(rows) - 1]])] + 1
    return np.column_stack([first, last])


def _point_ghost(ghost: pymunk.Body, original: pymunk.Body, period: float, o: Offsets) -> None:
    base = address(ghost._body)
    ffi.cast("int64_t *", base + o.torque)[0] = address(original._body)
    ffi.cast("double *", base + o.force)[0] = period


def _uninstall(
    space: Any, hook: Any, anchors: Any, handler: tuple[Any, Any], bodies: Any, ghosts: Any, o: Offsets, keep: Any
) -> None:
    """Take the callbacks out before their code and context go: the Space stays usable."""
    plain = ffi.cast("cpBodyPositionFunc", ffi.addressof(lib, "cpBodyUpdatePosition"))
    plain_kick = ffi.cast("cpBodyVelocityFunc", ffi.addressof(lib, "cpBodyUpdateVelocity"))
    for body in bodies:
        lib.cpBodySetPositionUpdateFunc(body._body, plain)
        lib.cpBodySetVelocityUpdateFunc(body._body, plain_kick)
    for ghost, circle in ghosts:
        space.remove(ghost, circle)
    if handler[0] is not None:
        handler[0].preSolveFunc = handler[1]
    lib.cpSpaceRemoveConstraint(space._space, hook)
    lib.cpConstraintFree(hook)
    for anchor in anchors:
        lib.cpBodyFree(anchor)
    del keep
