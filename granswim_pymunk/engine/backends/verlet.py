"""The default mode: one compiled force call a step over a neighbour list; Chipmunk finds no contacts."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ...joints import angles_of, hinged
from ...scene import LawUse
from .. import stepping
from ..callbacks import KIND_ORDER, Kernel, spins
from ..motion import Motion
from ..native import Offsets, column
from ..tables import anchors_of, close_links, commands_of, law_numbers, uses_of
from .base import Plan
from .native import Native


class Verlet(Native):
    """Forces over a list of near pairs; where it can be, the laws read and write Chipmunk's own memory."""

    name: ClassVar[str] = "verlet"
    from_list: ClassVar[bool] = True
    carries: ClassVar[bool] = True
    averages: ClassVar[bool] = True
    moves_in_place: ClassVar[bool] = True

    def __init__(self, plan: Plan, offsets: Offsets | None = None, motion: Motion | None = None) -> None:
        """See ``Backend``."""
        super().__init__(plan, offsets, motion)
        if not self.impulse:
            # Chipmunk raises it to the power of dt in each step, for overlaps of which it finds none
            self.world.space.collision_bias = 0.0
        self._turning = any(spins(item.law) for item in self.uses.items) or bool(len(self.joints.links.rows))

    def step_function(self, kernel: Kernel) -> int:
        """Address of the constraint's preSolve that gives the forces of a step."""
        return int(kernel.verlet_step.address)

    def rows_of_now(self, raw: dict[str, np.ndarray] | None = None) -> np.ndarray:
        """See ``Compiled``; where the laws read Chipmunk's memory, a copy of it."""
        if raw is None and self.in_place and not self.scene.periodic_x:
            return self.state.bodies.state.copy()
        return super().rows_of_now(raw)

    def set_velocities(self, vx: np.ndarray, vy: np.ndarray) -> None:
        """Velocities [engine units] of the mobile bodies."""
        if not self.in_place:
            super().set_velocities(vx, vy)
            return
        b, m = self.state.bodies, self.order.n_mobile
        b.row("vx")[:m], b.row("vy")[:m] = vx, vy

    def before_steps(self) -> None:
        """What the user put on the bodies goes to the coming force call."""
        if not self.in_place:
            return
        b, o = self.state.bodies, self.offsets
        turns, pushed = stepping.take(
            b.memory, self.order.n_mobile, column(o.force), column(o.torque), column(o.spin), b.push
        )
        self.context["pushed"] = int(pushed)
        how = "turning" if turns or self._turning else "still"
        if how != self.moving:
            self.moving = how
            self.let_move(how)

    def after_steps(self) -> None:
        """The forces of the last step go to their arrays, Chipmunk's transforms are renewed."""
        if not self.in_place:
            return
        b, o = self.state.bodies, self.offsets
        stepping.settle(
            b.memory, self.order.n_mobile, column(o.force), column(o.torque), column(o.position), column(o.transform),
            b.fx, b.fy, b.torque,
        )  # fmt: skip

    def restart(self, xy: np.ndarray, v: np.ndarray, t: float, spin: np.ndarray | None) -> None:
        """Begin again, see ``Simulation.restart``."""
        u, b, rows = self.units, self.state.bodies, self.order.rows_of
        b.initial = np.column_stack([xy, v])[rows]
        b.initial[self.order.n_mobile :, 2:] = 0.0
        turned = angles_of(self.scene, xy, v)
        if spin is not None:
            free = np.array([b not in hinged(self.scene) for b in self.scene.ids])
            turned = (turned[0], np.where(free, spin, turned[1]))
        b.turned = np.stack(turned, axis=1)[rows]
        close_links(self.scene, self.joints.links, b)
        b.images[:] = 0.0
        place, speed = b.initial[:, :2] / u.length, b.initial[:, 2:] / u.velocity
        if not self.impulse:
            self.world.remove_shapes()
        self.put(place[:, 0], place[:, 1], speed[:, 0], speed[:, 1], b.turned[:, 0], b.turned[:, 1] * u.time)
        if not self.in_place:
            for k, name in enumerate(("x", "y")):
                b.row(name)[:] = b.initial[:, k]  # walls are not read again
        self.begin_at(t)
        if self.impulse:
            self.world.renew_shapes()
            self.forget_events()
        self.state.numbers["step"] = 0.0
        self.context["status"] = 0
        self.step, self.begun, self.start = 0, False, "synchronised"
        self.state.forget_lists()

    def retune(self, laws: tuple[LawUse, ...]) -> bool:
        """Give the laws other numbers, see ``Simulation.retune``."""
        before = self.scene.laws
        if len(laws) != len(before):
            return False
        held = bool(self.impulse) or len(self.joints.links.rows) > 0
        for old, new in zip(before, laws, strict=True):
            if old.law is not new.law or old.bodies != new.bodies:
                return False
            # more than tables is made of Chipmunk's joints, links and what they move
            if held and old.law.kind == "constraint" and old.values != new.values:
                return False
            if old.law.kind not in (*KIND_ORDER, "impulse") and old.values != new.values:
                return False
        scene = self.scene.having_laws(laws)
        uses = self.uses.of(before, laws) or uses_of(scene, self.order)
        if uses.reach(scene) != self.uses.reach(self.scene):
            return False
        known, b = self.state.laws, self.state.bodies
        # what a motor makes of its commands hangs on its gain
        t, v = commands_of(scene, self.order)[:2] if scene.inputs else (known.input_t, known.input_v)
        if t.shape != known.input_t.shape or (self.impulse and not self.world.resurface(scene)):
            return False
        known.input_t[...], known.input_v[...] = t, v
        self.scene, self.uses = scene, uses
        self.impulse = [item for item in scene.laws if item.law.kind == "impulse"]
        if len(known.joint_at):
            known.joint_at[...] = anchors_of(scene)
        eased = b.ease.copy()
        known.parameters[...] = law_numbers(scene, self.order, b, uses, self.acting, self.dt)[0]
        if not np.array_equal(b.ease, eased):
            self.world.ease(b, self.offsets)
        return True

    def steer(self, v: np.ndarray) -> None:
        """From now on carried bodies move at these velocities, see ``Simulation.steer``."""
        rows = np.flatnonzero((self.state.bodies.mobile == 0)[: self.order.n_mobile])
        speed = np.asarray(v, dtype=float)[self.order.rows_of[rows]] / self.units.velocity
        self.write_velocities(rows, np.ascontiguousarray(speed.T))
        if not self.in_place:
            for k, name in enumerate(("vx", "vy")):
                self.state.bodies.row(name)[rows] = speed[:, k] * self.units.velocity
