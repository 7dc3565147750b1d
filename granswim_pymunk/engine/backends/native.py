"""Modes in which Chipmunk calls compiled functions: set-up, steps, and what they report."""

from __future__ import annotations

import functools
import weakref
from typing import Any, ClassVar

import numpy as np
from pymunk._chipmunk_cffi import ffi, lib

from ...errors import SimulationError
from .. import events, neighbours, stepping
from ..callbacks import INTS, Kernel
from ..motion import NUMBERS, OWN_ROW, Motion
from ..native import ROW, Offsets, address, column, space_offsets, step_address
from ..state import Slots, context_of
from .base import Plan
from .compiled import Compiled


class Native(Compiled):
    """A mode with compiled callbacks.

    context : counts and addresses of the arrays, which the callbacks find behind a pointer (``callbacks.INTS``)
    """

    native: ClassVar[bool] = True
    from_list: ClassVar[bool]  # the callback sums the pairs of the neighbour list
    offsets: Offsets

    def __init__(self, plan: Plan, offsets: Offsets | None = None, motion: Motion | None = None) -> None:
        """See ``Backend``; ``offsets`` must be known."""
        assert offsets is not None
        super().__init__(plan, offsets, motion)
        self._last_step = self.dt
        self._event_time: float | None = None  # where steps end at impacts, time is not a number of steps
        self.context = context_of(self.state, self.order, self.kernel, self.from_list, plan.skin is not None)
        self._space = address(self.world.space._space)
        # the constraint is a motor at rest between two private bodies: only its preSolve matters, which comes after
        # collision detection and before any kick. Of Chipmunk's constraints it asks least of the solver
        anchors = [lib.cpBodyNew(1.0, 1.0), lib.cpBodyNew(1.0, 1.0)]
        hook = lib.cpSimpleMotorNew(anchors[0], anchors[1], 0.0)
        lib.cpConstraintSetPreSolveFunc(hook, ffi.cast("cpConstraintPreSolveFunc", self.step_function(self.kernel)))
        lib.cpConstraintSetUserData(hook, ffi.cast("void *", self.context.values.ctypes.data))
        lib.cpSpaceAddConstraint(self.world.space._space, hook)
        if motion is not None and (self.in_place or not self.moves_in_place):
            self._move_ourselves()
        keep = (self.state, self.context, self.kernel, motion)
        self._close = weakref.finalize(
            self, _uninstall, self.world.space, hook, anchors, self.watch_contacts(),
            self.world.bodies[: self.order.n_mobile], self.world.ghosts, offsets, keep,
        )  # fmt: skip

    def context_of_now(self) -> Slots:
        """A copy of what the callbacks have."""
        return self.context.copy()

    # ---- what a mode does in its own way --------------------------------------------------------

    def step_function(self, kernel: Kernel) -> int:
        """Address of the constraint's preSolve that gives the forces of a step."""
        raise NotImplementedError

    def watch_contacts(self) -> tuple[Any, Any]:
        """Let Chipmunk report contacts: its handler and the function that was there before; (None, None) without."""
        return None, None

    def before_steps(self) -> None:
        """Called before a block of steps."""

    def after_steps(self) -> None:
        """Called after a block of steps."""

    # ---- memory ---------------------------------------------------------------------------------

    def _move_ourselves(self) -> None:
        """Compiled drift and kick in place of Chipmunk's."""
        b = self.state.bodies
        assert b.memory is not None
        self.context["own_drift"] = self.context["own_kick"] = 1
        front = b.memory.view(np.int64)
        front[:, NUMBERS] = self.state.motion.ctypes.data
        if not self.in_place:
            front[:, OWN_ROW] = b.state.ctypes.data + 8 * ROW * np.arange(self.order.n)
        self.moving = "turning" if self.in_place else "apart"
        self.let_move(self.moving)

    def let_move(self, how: str) -> None:
        """Which drift and kick Chipmunk calls: in place "turning" or "still" (disks keep their angle), or "apart"."""
        m, memory = self.motion, self.state.bodies.memory
        assert m is not None and memory is not None
        drift, kick = {
            "still": (m.drift, m.kick),
            "turning": (m.drift_turning, m.kick_turning),
            "apart": (m.drift_apart, m.kick_apart),
        }[how]
        rows = memory[: self.order.n_mobile].view(np.int64)
        rows[:, column(self.offsets.drift)] = drift
        rows[:, column(self.offsets.kick)] = kick

    @functools.cached_property
    def _fields(self) -> np.ndarray:
        o = self.offsets
        return np.array([o.position, o.position + 8, o.velocity, o.velocity + 8, o.angle, o.spin])

    @functools.cached_property
    def _touching(self) -> np.ndarray:
        """(n,) 1 where Chipmunk lets a body touch others."""
        return np.array([circle.filter.mask != 0 for circle in self.world.circles], dtype=np.uint8)

    def read(self) -> np.ndarray:
        """(6, n) ``FIELDS`` of all bodies as Chipmunk has them [engine units]."""
        values = np.empty((6, self.order.n))
        stepping.read_fields(self.state.bodies.bodies, self._fields, values)
        return values

    def put(
        self, x: np.ndarray, y: np.ndarray, vx: np.ndarray, vy: np.ndarray, angle: np.ndarray, spin: np.ndarray
    ) -> None:
        """Put the bodies there [engine units], free of forces."""
        o, values = self.offsets, np.zeros((11, self.order.n))
        values[0] = values[2] = x
        values[1] = values[3] = y
        values[4], values[5], values[6], values[7] = vx, vy, angle, spin
        places = [o.position, o.transform, o.velocity]
        fields = [at + k for at in places for k in (0, 8)] + [o.angle, o.spin, o.force, o.force + 8, o.torque]
        stepping.write_fields(self.state.bodies.bodies, np.array(fields), values)

    def set_velocities(self, vx: np.ndarray, vy: np.ndarray) -> None:
        """Velocities [engine units] of the mobile bodies."""
        self.write_velocities(np.arange(self.order.n_mobile), np.array([vx, vy]))

    def write_velocities(self, rows: np.ndarray, v: np.ndarray) -> None:
        """Velocities (2, k) [engine units] of some inner rows."""
        o = self.offsets
        stepping.write_fields(self.state.bodies.bodies[rows], np.array([o.velocity, o.velocity + 8]), v)

    # ---- time -----------------------------------------------------------------------------------

    @property
    def t(self) -> float:
        """Time [s]."""
        return super().t if self._event_time is None else self._event_time

    def advance(self, steps: int) -> None:
        """Do that many steps. Raises SimulationError when a number is no longer finite."""
        if self.impulse:
            self._advance_events(np.array([self.t + steps * self.dt]), np.zeros(0, dtype=np.int64))
            return
        if not self.finds_contacts:
            self.world.remove_shapes()
        left = steps
        while left > 0:
            self.before_steps()
            saved = self._save()
            done = stepping.advance(
                step_address(), self._space, self.dt / self.units.time, left, self.context.values,
                self.context.at("status"), self.context.at("margin_crossed"),
            )  # fmt: skip
            self.after_steps()
            if self._interrupted(saved):
                continue
            self.step += int(done)
            left -= int(done)

    def sample(self, times: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """(T, k, 2) positions [m] of inner ``rows`` at rising ``times`` [s]; the run goes on to the last of them."""
        if self.impulse:
            return self._advance_events(times, rows)
        steps, ahead = self.steps_to(times)
        if not self.finds_contacts:
            self.world.remove_shapes()
        out = np.full((len(times), len(rows), 2), np.nan)
        b, o, u = self.state.bodies, self.offsets, self.units
        addresses = b.bodies[rows].copy()
        sample = 0
        while sample < len(times):
            self.before_steps()
            saved = self._save()
            at = self.step
            shift = b.images[rows] * (self.scene.periodic_x or 0.0)
            sample, step = stepping.advance_and_sample(
                step_address(), self._space, self.dt / u.time, sample, self.step, steps, ahead, self.context.values,
                self.context.at("status"), self.context.at("margin_crossed"), addresses, shift, o.position, o.velocity,
                u.length, u.velocity, out,
            )  # fmt: skip
            self.after_steps()
            if self._interrupted(saved):
                sample = int(np.searchsorted(steps, at))
                continue
            self.step = int(step)
        return out

    def _advance_events(self, ends: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Go on to times ``ends`` [s] in steps that end at impacts; positions of inner ``rows`` there."""
        b, u, numbers, context = self.state.bodies, self.units, self.state.numbers, self.context
        out = np.full((len(ends), len(rows), 2), np.nan)
        reached, last = events.advance_to(
            step_address(), self._space, *space_offsets(), *self.world.rounds(), self.t, ends, self.dt, u.time,
            context.values, context.at("status"), numbers.values, numbers.at("t_start"), numbers.at("dt"),
            numbers.at("step"), numbers.at("lasts"), b.bodies, b.radius / u.length, b.group, self.state.links.apart,
            self._touching, b.mobile, self.offsets.position, self.offsets.velocity, u.length, u.velocity,
            self._last_step, self.state.walls.walls / u.length, context.at("constrained"), self.world.joint_limits,
            b.fx, b.fy, b.inverse_mass, self.plan.stretch, b.bodies[rows].copy(), out,
        )  # fmt: skip
        self._event_time, self._last_step = float(reached), float(last)
        self.step = max(round((reached - self.start_time) / self.dt), 1)
        self._interrupted(None)
        return out

    @property
    def last_step(self) -> float:
        return self.dt if self._event_time is None else self._last_step

    def forget_events(self) -> None:
        """Time is counted in steps again, from none on."""
        self._event_time, self._last_step = None, self.dt
        self.state.numbers["dt"] = self.dt

    def _save(self) -> tuple[dict[str, np.ndarray], float] | None:
        # what a neighbour list that overflowed in the middle of a block goes back to
        room = self.state.lists.room
        if not room or room >= self.order.n * self.order.n:
            return None
        return self.raw(), self.state.numbers["step"]

    def _interrupted(self, saved: tuple[dict[str, np.ndarray], float] | None) -> bool:
        """Deal with what the callbacks reported; True: the block was taken back."""
        context, numbers = self.context, self.state.numbers
        status = context["status"]
        if status in (neighbours.NOT_FINITE, neighbours.ESCAPED):
            self.step = int(numbers["step"])
            raise self.lost()
        if status == neighbours.OVERFLOW:
            context["status"] = context["n_contacts"] = 0
            if saved is None:
                raise SimulationError("the neighbour list is full")
            self.grow()
            self.restore(saved[0])
            numbers["step"] = saved[1]
            return True
        if context["margin_crossed"]:
            context["margin_crossed"] = 0
            self.lay_out_seam()
        return False

    # ---- arrays that change ---------------------------------------------------------------------

    def make_room(self, room: int) -> None:
        """Room for so many pairs; lists are built anew."""
        super().make_room(room)
        self.refresh()

    def refresh(self) -> None:
        """Tell the callbacks where arrays are that were made anew."""
        fresh = context_of(self.state, self.order, self.kernel, self.from_list, self.plan.skin is not None)
        for name in (*INTS[INTS.index("bodies") :], "room", "n_table"):
            self.context[name] = fresh[name]

    @property
    def diagnostics(self) -> dict[str, Any]:
        """Mode, steps and neighbour lists built."""
        return super().diagnostics | {"neighbour_lists": self.context["rebuilds"]}


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
