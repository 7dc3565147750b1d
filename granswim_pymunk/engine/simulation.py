"""A scene running on pymunk: Chipmunk integrates every body, compiled laws give the forces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pymunk

from ..choices import MODES
from ..errors import InputError
from ..scene import LawUse, Scene
from ..snapshot import Contacts, State
from . import contacts
from .backends import backend_for
from .units import Units


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

    ``backend`` is the machinery of the mode: its arrays, rows and Space (``engine.backends.base``).

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
        if scene.periodic_x and any(item.law.kind == "impulse" for item in scene.laws):
            raise InputError(
                "Chipmunk's impulses do not reach across a periodic seam; use contact_linear",
                where="law contact_elastic",
            )
        self.backend = backend_for(
            scene, mode, dt=dt, start=start, units=units, skin=skin, only=only, carried=carried, averaged=averaged,
            stretch=stretch,
        )  # fmt: skip

    # ---- what it was given ----------------------------------------------------------------------

    @property
    def scene(self) -> Scene:
        """The scene; after ``restart`` with the time at which the run began again."""
        scene, start = self.backend.scene, self.backend.start_time
        return scene if scene.time.start == start else scene.starting_at(start)

    @property
    def mode(self) -> str:
        """The mode that runs, which may be another one than asked for where that cannot run the scene."""
        return self.backend.name

    @property
    def units(self) -> Units:
        """What the units of the Space are in SI."""
        return self.backend.units

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return self.backend.dt

    @property
    def start(self) -> str:
        """Which velocities the run began with: "synchronised" or "leapfrog"."""
        return self.backend.start

    @property
    def impulse(self) -> list[LawUse]:
        """Laws that Chipmunk's impulses stand for."""
        return self.backend.impulse

    # ---- time -----------------------------------------------------------------------------------

    @property
    def step(self) -> int:
        """Steps done."""
        return self.backend.step

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.backend.t

    def advance(self, steps: int) -> None:
        """Do that many steps. Raises SimulationError when a number is no longer finite."""
        self.backend.begin()
        self.backend.advance(steps)

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
        order = self.backend.order
        chosen = np.arange(order.n) if rows is None else np.asarray(rows, dtype=np.int64)
        inner = order.inner[chosen]
        if (inner < 0).any():
            raise InputError(f"body {self.backend.scene.bodies[int(chosen[inner < 0][0])].id} is not simulated here")
        if not len(times):
            return np.full((0, len(chosen), 2), np.nan)
        self.backend.begin()
        return self.backend.sample(times, inner)

    def restart(self, xy: np.ndarray, v: np.ndarray, t: float, spin: np.ndarray | None = None) -> None:
        """Begin again from other positions (n, 2) [m] and velocities (n, 2) [m/s] of the scene's bodies at t [s].

        Many times cheaper than a new Simulation of many bodies, and the same run: disks that do not spin (those in
        hinges turn as their places and velocities say), velocities at the time of the positions. Walls go where ``xy``
        says. Verlet mode only. Not after a run that ended in a SimulationError: beside ``contact_elastic`` a rail is
        Chipmunk's own joint, which keeps its last impulse, and one that is no number spoils every run that follows.

        spin : (n,) [rad/s] of disks that do spin, for those in no hinge
        """
        self.backend.restart(xy, v, t, spin)

    def retune(self, laws: Sequence[LawUse]) -> bool:
        """Give the laws of the scene other numbers, before a ``restart``: the same run as of a new Simulation.

        ``laws``: those of the scene, on the same bodies, in the same order. False where more hangs on them than their
        tables (impulses, hinges and rods, a reach), or in another mode than verlet: a new Simulation is needed.
        """
        return self.backend.retune(tuple(laws))

    def steer(self, v: np.ndarray) -> None:
        """From now on the carried bodies move at ``v`` (n, 2) [m/s], of the scene's bodies; other rows are not read."""
        self.backend.steer(v)

    def freeze(self) -> dict[str, np.ndarray]:
        """What a checkpoint keeps: (n,) arrays of the simulated bodies, in engine units and order."""
        return self.backend.freeze()

    def thaw(self, arrays: dict[str, np.ndarray], step: int, begun: bool) -> None:
        """Go on from what ``freeze`` gave, ``step`` steps after the start; ``begun``: past the first kick.

        Raises InputError where the arrays belong to other bodies.
        """
        self.backend.thaw(arrays, step, begun)

    @property
    def begun(self) -> bool:
        """Whether the first kick was given: velocities are half a step ahead of the positions."""
        return self.backend.begun

    # ---- what there is --------------------------------------------------------------------------

    def raw(self) -> dict[str, np.ndarray]:
        """Leapfrog arrays in scene order: x, y [m], vx, vy [m/s] of the coming drift, angle, spin."""
        self.backend.begin()
        return {name: self.backend.order.of_scene(values) for name, values in self.backend.raw().items()}

    def state(self) -> State:
        """The state at the present time, velocities taken back by the half kick [m, m/s, rad, rad/s]."""
        raw = self.backend.synchronised()
        self._turn_rods(raw)
        of_scene = self.backend.order.of_scene
        return State(
            t=self.t,
            xy=of_scene(np.column_stack([raw["x"], raw["y"]])),
            v=of_scene(np.column_stack([raw["vx"], raw["vy"]])),
            angle=of_scene(raw["angle"]),
            spin=of_scene(raw["spin"]),
        )

    def _turn_rods(self, raw: dict[str, np.ndarray]) -> None:
        """Angle and spin of a pinned body are those of its rod."""
        for item in self.backend.scene.laws_named("pin"):
            k = self.backend.order.inner[self.backend.scene.rows(item)]
            dx = raw["x"][k] - item.values["anchor"][0]
            dy = raw["y"][k] - item.values["anchor"][1]
            raw["angle"][k] = np.arctan2(dx, -dy)
            raw["spin"][k] = (dx * raw["vy"][k] - dy * raw["vx"][k]) / (dx * dx + dy * dy)

    def forces(self) -> np.ndarray:
        """(n, 2) sum of all forces on each body at the last force call [N]."""
        self.backend.begin()
        return self.backend.order.of_scene(self.backend.forces())

    def overlaps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Overlapping pairs that a pair law acts on: rows i, j of ``scene.bodies``, and overlap/smaller radius."""
        self.backend.begin()
        return contacts.overlaps(self.backend)

    def contacts(self) -> Contacts:
        """Touching pairs with the normal force of all pair laws, velocities at the time of the positions."""
        return contacts.contacts(self.backend)

    @property
    def space(self) -> pymunk.Space:
        """The ordinary ``pymunk.Space`` (engine units, see ``units``), with a Circle on every Body.

        In verlet mode the circles are in the Space while you look, and out of it while it runs fast.
        """
        return self.backend.world.shown()

    def body(self, name: str) -> pymunk.Body:
        """The ``pymunk.Body`` of a body of the scene (engine units)."""
        self.backend.scene.body(name)
        return self.backend.body(self.backend.scene.ids.index(name))

    @property
    def diagnostics(self) -> dict[str, Any]:
        """Mode, steps and neighbour lists built."""
        return self.backend.diagnostics
