"""What all modes of the engine share: the bodies, the laws' tables, the Space, and how it is read and written."""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pymunk

from ...errors import BodyLost, InputError, SimulationError
from ...laws import Law
from ...scene import LawUse, Scene
from .. import neighbours
from ..callbacks import Addresses, Kernel
from ..motion import Motion
from ..native import Offsets
from ..order import order_of
from ..state import (
    EngineState,
    bodies_of,
    link_arrays,
    lists_of,
    motion_of,
    numbers_of,
    walls_of,
)  # fmt: skip
from ..tables import acting_of, joints_of, law_table, uses_of
from ..units import Units
from ..world import World

SI = Units(1.0, 1.0, 1.0)
FIELDS = ("x", "y", "vx", "vy", "angle", "spin")  # what Chipmunk keeps of a body


@dataclass(frozen=True)
class Plan:
    """What a simulation was asked for; see ``Simulation`` for what the names mean.

    present : (N,) bool, bodies of the scene that are simulated;  carried : rows of the scene;  dt [s]
    skin [m], units : None where they are for the engine to choose
    """

    scene: Scene
    dt: float
    start: str
    units: Units | None
    skin: float | None
    present: np.ndarray
    carried: frozenset[int]
    averaged: bool
    stretch: float


class Backend(ABC):
    """One way in which contacts are found and forces enter, and the run itself.

    A subclass says how steps are made (``advance``), where forces come from (``forces``, ``pair_forces``) and how the
    first kick is given (``first_kick``); it may read and write bodies faster (``read``, ``put``).

    scene : with the time at which the run began;  dt, step, t : step [s], steps done, time [s]
    order : of the rows;  state : the arrays;  world : the Space;  uses, joints : what the laws' tables were made of
    kernel : the compiled laws, None where they run as Python
    begun : whether the first kick was given
    """

    name: ClassVar[str]
    native: ClassVar[bool] = False  # Chipmunk calls compiled functions, and memory of bodies is read and written
    plain_laws: ClassVar[bool] = False  # laws that cannot be compiled run, too
    reaches: ClassVar[bool] = True  # laws that act before contact can be had
    carries: ClassVar[bool] = False  # bodies may be carried along
    averages: ClassVar[bool] = False  # contacts may count by the share of a step
    moves_in_place: ClassVar[bool] = False  # laws may read and write Chipmunk's own memory
    finds_contacts: ClassVar[bool] = False  # shapes are in the Space: Chipmunk finds the contacts

    def __init__(self, plan: Plan, offsets: Offsets | None = None, motion: Motion | None = None) -> None:
        """``offsets``, ``motion``: Chipmunk's structures and compiled moves, where the mode is native."""
        scene = plan.scene
        self.plan, self.scene, self.dt = plan, scene, plan.dt
        self.start_time = scene.time.start  # [s]; another one than the scene's once the run has begun again
        self.offsets, self.motion = offsets, motion
        self.impulse: list[LawUse] = [item for item in scene.laws if item.law.kind == "impulse"]
        # the laws read and write Chipmunk's own memory, which is in SI where its collision is not used
        self.in_place = self.moves_in_place and motion is not None and plan.units in (None, SI)
        self.units = plan.units or (SI if self.in_place else Units.for_scene(scene))
        self.step, self.begun, self.start = 0, False, plan.start
        self.order = order_of(scene, plan.present, plan.carried)
        bodies = bodies_of(scene, self.order, plan.carried, offsets, motion is not None, self.in_place)
        self.joints = joints_of(scene, self.order, bodies)
        if not self.in_place:
            for k, name in enumerate(("x", "y", "vx", "vy")):
                bodies.row(name)[:] = bodies.initial[:, k]
            bodies.row("angle")[:], bodies.row("spin")[:] = bodies.turned.T
        self.kernel = self.compiled()
        self.uses = uses_of(scene, self.order)
        self.acting = acting_of(scene, self.order, bodies, self.uses)
        averaged = plan.averaged and self.averages
        laws = law_table(
            scene, self.order, bodies, self.uses, self.acting, self.joints, self.addresses, self.dt, averaged
        )
        smallest = float(bodies.radius.min()) if self.order.n else 1.0
        skin = plan.skin if plan.skin is not None else 0.4 * smallest
        reach = self.uses.reach(scene)
        blocks = len(self.order.blocks) - 1
        self.state = EngineState(
            bodies, laws, lists_of(self.order.n, blocks, self.uses.has_pairs, bodies.radius, reach),
            link_arrays(self.joints.links, self.joints.apart, self.order.n), walls_of(scene, bodies, blocks),
            motion_of(self.units), numbers_of(scene.time.start, self.dt, skin, smallest, reach),
        )  # fmt: skip
        self.state.forget_lists()
        self.world = World(scene, self.order, self.units, bodies, self.joints.apart, plan.carried, offsets)
        if self.impulse or self.finds_contacts:
            self.world.add_shapes()

    # ---- what a mode does in its own way --------------------------------------------------------

    def compiled(self) -> Kernel | None:
        """The compiled laws, None where they run as Python."""
        return None

    def addresses(self, law: Law) -> Addresses:
        """Where the compiled functions of a law are: for a block of bodies, for one pair, for a body at a wall."""
        return 0, 0, 0

    @abstractmethod
    def first_kick(self) -> None:
        """Bring the velocities half a step ahead of the positions."""

    @abstractmethod
    def advance(self, steps: int) -> None:
        """Do that many steps. Raises SimulationError when a number is no longer finite."""

    @abstractmethod
    def forces(self) -> np.ndarray:
        """(n, 2) sum of all forces on each body at the last force call [N], inner order; 0 on walls."""

    @abstractmethod
    def pair_forces(self, i: np.ndarray, j: np.ndarray, normal: np.ndarray, raw: dict[str, np.ndarray]) -> np.ndarray:
        """(k,) force on each j along ``normal`` (k, 2) [N] by all laws of pairs, bodies being as ``raw`` says."""

    # ---- time -----------------------------------------------------------------------------------

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.start_time + self.step * self.dt

    def begin(self) -> None:
        """The first kick, where the velocities of the scene belong to the time of the positions."""
        if not self.begun:
            self.begun = True
            if self.start != "leapfrog":
                self.first_kick()

    def sample(self, times: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """(T, k, 2) positions [m] of inner ``rows`` at rising ``times`` [s]; the run goes on to the last of them."""
        steps, ahead = self.steps_to(times)
        out = np.empty((len(times), len(rows), 2))
        for s in range(len(times)):
            self.advance(int(steps[s]) - self.step)
            raw = self.raw()
            out[s, :, 0] = raw["x"][rows] + raw["vx"][rows] * ahead[s]
            out[s, :, 1] = raw["y"][rows] + raw["vy"][rows] * ahead[s]
        return out

    def steps_to(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Steps done just before each time, and how far it is into the coming drift [s]."""
        steps = np.floor((times - self.start_time) / self.dt + 1e-9).astype(np.int64)
        return steps, times - (self.start_time + steps * self.dt)

    def restart(self, xy: np.ndarray, v: np.ndarray, t: float, spin: np.ndarray | None) -> None:
        """Begin again, see ``Simulation.restart``."""
        raise InputError("only a simulation in mode verlet can begin again")

    def retune(self, laws: tuple[LawUse, ...]) -> bool:
        """Give the laws other numbers, see ``Simulation.retune``."""
        return False

    def steer(self, v: np.ndarray) -> None:
        """From now on carried bodies move at these velocities, see ``Simulation.steer``."""
        raise InputError("only a simulation in mode verlet has bodies that are carried along")

    def begin_at(self, t: float) -> None:
        """The run begins at this time [s]."""
        self.start_time = float(t)
        self.state.numbers["t_start"] = t

    # ---- bodies ---------------------------------------------------------------------------------

    def read(self) -> np.ndarray:
        """(6, n) ``FIELDS`` of all bodies as Chipmunk has them [engine units]."""
        rows = [(*b.position, *b.velocity, b.angle, b.angular_velocity) for b in self.world.bodies]
        return np.array(rows, dtype=float).reshape(self.order.n, len(FIELDS)).T

    def put(
        self, x: np.ndarray, y: np.ndarray, vx: np.ndarray, vy: np.ndarray, angle: np.ndarray, spin: np.ndarray
    ) -> None:
        """Put the bodies there [engine units], free of forces."""
        for k, body in enumerate(self.world.bodies):
            body.position = (x[k], y[k])
            if k < self.order.n_mobile:
                body.velocity, body.angle, body.angular_velocity = (vx[k], vy[k]), angle[k], spin[k]
                body.force, body.torque = (0.0, 0.0), 0.0

    def set_velocities(self, vx: np.ndarray, vy: np.ndarray) -> None:
        """Velocities (n,) [engine units] of the mobile bodies."""
        for k in range(self.order.n_mobile):
            self.world.bodies[k].velocity = (vx[k], vy[k])

    def raw(self) -> dict[str, np.ndarray]:
        """What Chipmunk has, in SI and inner order: unwrapped x, y, half-step velocities, angle, spin."""
        result = dict(zip(FIELDS, np.array(self.read()), strict=True))
        u = self.units
        result["x"] *= u.length
        result["y"] *= u.length
        result["vx"] *= u.velocity
        result["vy"] *= u.velocity
        result["spin"] /= u.time
        if self.scene.periodic_x:
            result["x"] += self.state.bodies.images * self.scene.periodic_x
        return result

    def restore(self, raw: dict[str, np.ndarray]) -> None:
        """Go back to what ``raw`` gave."""
        u = self.units
        x = raw["x"] - self.state.bodies.images * (self.scene.periodic_x or 0.0)
        self.put(
            x / u.length, raw["y"] / u.length, raw["vx"] / u.velocity, raw["vy"] / u.velocity, raw["angle"],
            raw["spin"] * u.time,
        )  # fmt: skip
        self.state.forget_lists()

    @property
    def last_step(self) -> float:
        """Length of the last step [s], half of which velocities are ahead."""
        return self.dt

    def synchronised(self) -> dict[str, np.ndarray]:
        """As ``raw``, with velocities and spins taken back by the half kick."""
        raw = self.raw()
        if not self.begun:
            return raw
        b = self.state.bodies
        if self.step > 0:
            half = 0.5 * self.last_step
            m = slice(0, self.order.n_mobile)
            raw["vx"][m] -= half * b.fx[m] * b.inverse_mass[m] * b.ease[m]
            raw["vy"][m] -= half * b.fy[m] * b.inverse_mass[m] * b.ease[m]
            raw["spin"][m] -= half * b.torque[m] * b.inverse_moment[m]
        elif self.start == "synchronised":
            raw["vx"], raw["vy"] = b.initial[:, 2:].T.copy()
            raw["spin"][:] = b.turned[:, 1]
        return raw

    @functools.cached_property
    def held_rows(self) -> np.ndarray:
        """(n,) bool, inner order: bodies under a constraint that looks at the velocity half a step behind.

        What brakes a body asks where it goes from the start on, and along a rail nothing lies behind.
        """
        held = np.zeros(self.order.n, dtype=bool)
        held[self.joints.links.rows] = True
        masks = self.state.laws.mask.astype(bool)
        braked = masks[[u for u, item in enumerate(self.uses.items) if item.law.role == "brake"]].any(axis=0)
        for u, item in enumerate(self.uses.items):
            if item.law.kind == "constraint" and {"vx", "vy"} & set(item.law.arguments) and item.law.role != "brake":
                held |= masks[u] & ~braked if item.law.role == "guide" else masks[u]
        return held

    # ---- checkpoints ----------------------------------------------------------------------------

    def laid_out(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) x, y [m] at which the present lists, or ghosts, were made; infinite where there are none."""
        return self.state.lists.old_x, self.state.lists.old_y

    def freeze(self) -> dict[str, np.ndarray]:
        """What a checkpoint keeps of each body, inner order: Chipmunk's fields, and the forces of the last step."""
        b = self.state.bodies
        laid_x, laid_y = map(np.nan_to_num, self.laid_out())
        return dict(zip(FIELDS, self.read(), strict=True)) | {
            "images": b.images, "fx": b.fx, "fy": b.fy, "torque": b.torque, "laid_x": laid_x, "laid_y": laid_y,
            "vx_start": b.initial[:, 2], "vy_start": b.initial[:, 3],
        }  # fmt: skip

    def thaw(self, arrays: dict[str, np.ndarray], step: int, begun: bool) -> None:
        """The counterpart of ``freeze``: go on from there, ``step`` steps after the start. Raises InputError."""
        n = self.order.n
        if any(array.shape != (n,) for array in arrays.values()):
            raise InputError(f"the checkpoint has other bodies than its scene, which has {n}")
        b = self.state.bodies
        b.images[:] = arrays["images"]
        b.initial[:, 2], b.initial[:, 3] = arrays["vx_start"], arrays["vy_start"]
        self.put(*(arrays[name] for name in FIELDS))
        b.fx[:], b.fy[:], b.torque[:] = arrays["fx"], arrays["fy"], arrays["torque"]
        self.step, self.begun = step, begun
        self.state.numbers["step"] = float(step)
        self.state.forget_lists()

    # ---- lists of near bodies -------------------------------------------------------------------

    def fresh_list(self, x: np.ndarray, y: np.ndarray, extra: float) -> int:
        """Fill the list with all pairs closer than their radii and ``extra`` [m]; their number.

        Raises SimulationError where a body is lost.
        """
        b, apart = self.state.bodies, self.state.links.apart
        while True:
            a = self.state.lists
            count = neighbours.build_list(
                x, y, b.radius, b.mobile, b.group, apart, extra, self.scene.periodic_x or 0.0, a.pair_i, a.pair_j,
                a.pair_shift, a.heads, a.nexts, a.sorted_x, a.sorted_y, a.sorted_reach, a.near_i, a.near_j, a.starts,
            )  # fmt: skip
            if count in (neighbours.NOT_FINITE, neighbours.ESCAPED):
                raise self.lost()
            if count != neighbours.OVERFLOW:
                return int(count)
            self.grow()

    def pairs_within(self, raw: dict[str, np.ndarray], extra: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Inner rows i < j of the pairs that a law of pairs may act on and that are closer than ``extra`` [m]."""
        lists = self.state.lists
        if not lists.room:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        count = self.fresh_list(raw["x"], raw["y"], extra)
        i, j = lists.pair_i[:count].astype(np.int64), lists.pair_j[:count].astype(np.int64)
        self.state.forget_lists()  # the running list is gone; a new one has the same pairs within reach
        return i, j

    def way(self, raw: dict[str, np.ndarray], i: np.ndarray, j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k,) dx, dy [m] from each i to the nearest image of each j."""
        dx = raw["x"][j] - raw["x"][i]
        if self.scene.periodic_x:
            dx -= self.scene.periodic_x * np.floor(dx / self.scene.periodic_x + 0.5)
        return dx, raw["y"][j] - raw["y"][i]

    def grow(self) -> None:
        """Twice the room for pairs; a list is never cut short. Raises SimulationError where a bed has collapsed."""
        room, n = self.state.lists.room, self.order.n
        if room > 400 * n + 10**6:
            raise SimulationError(f"more than {room} pairs for {n} bodies: the bed has collapsed")
        self.make_room(2 * room)

    def make_room(self, room: int) -> None:
        """Room for so many pairs; lists are built anew."""
        self.state.lists.allocate(room)
        self.state.forget_lists()

    def lost(self) -> BodyLost:
        """The error for a body that went astray."""
        raw = self.raw()
        away = np.hypot(raw["x"], raw["y"])
        lost = int(np.argmax(np.where(np.isfinite(away), away, np.inf)))
        what = f"is {away[lost]:.3g} m away" if np.isfinite(away[lost]) else "is not finite"
        return BodyLost(
            f"the position of body {self.scene.bodies[self.order.rows_of[lost]].id} {what} after step {self.step + 1} "
            f"(t = {self.t:.6g} s, dt = {self.dt:.3g} s); a smaller dt may help"
        )

    # ---- the seam -------------------------------------------------------------------------------

    def lay_out_seam(self, wrap: bool = True) -> None:
        """Wrap the bodies in the Space, and put ghosts of those near the left edge one period on.

        How far a body may go before this is done again becomes the ``margin`` among the numbers [m].
        """
        b, length = self.state.bodies, self.scene.periodic_x
        largest = float(b.radius.max()) if length else np.inf
        self.state.numbers["margin"] = 0.8 * largest
        if length:
            if wrap:
                self.world.wrap(b.images)
            self.world.lay_ghosts(2 * largest + 2 * largest)
            b.image_shift[:] = b.images * length

    # ---- what there is --------------------------------------------------------------------------

    @property
    def diagnostics(self) -> dict[str, Any]:
        """Mode, steps and what the mode counts."""
        return {"mode": self.name, "dt": self.dt, "steps": self.step, "scene": self.scene.identity}

    def body(self, row: int) -> pymunk.Body:
        """The ``pymunk.Body`` of a row of the scene (engine units)."""
        return self.world.bodies[int(self.order.inner[row])]
