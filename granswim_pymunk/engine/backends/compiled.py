"""Modes whose laws are compiled: forces of all bodies in one call, and the first kick."""

from __future__ import annotations

import numpy as np

from ...compiled import shown
from ...laws import Law
from .. import neighbours
from ..callbacks import FUNCTIONS, HALF_STEP, SCALARS, USE_COLUMNS, Addresses, Kernel, kernel_for
from ..native import ROW
from ..state import Slots, context_of
from .base import Backend


class Compiled(Backend):
    """A mode with a kernel."""

    kernel: Kernel

    def compiled(self) -> Kernel:
        """What is compiled for this layout of Chipmunk's memory."""
        with shown(FUNCTIONS):
            return kernel_for(self.offsets)

    def addresses(self, law: Law) -> Addresses:
        """Where the compiled functions of a law are; 0 where this scene does not need one."""
        pair = law.kind == "pair"
        with shown(FUNCTIONS):
            one = self.kernel.one(law) if pair and self.finds_contacts else 0
            wall = self.kernel.wall(law) if pair and not law.reach and self.scene.walls else 0
            return self.kernel.block(law), one, wall

    def context_of_now(self) -> Slots:
        """Counts and addresses of the arrays, for a call from Python."""
        return context_of(self.state, self.order, self.kernel, from_list=True, fixed_skin=False)

    def array_forces(
        self, constrained: bool, t: float, state: np.ndarray | None = None, in_step: bool = False
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forces and torques [N, N m] at the positions and velocities in ``state``; left out, those of now.

        constrained : with the constraints;  in_step : the velocities are those of half a step before, as in a step
        """
        c = self.state.bodies.columns
        if state is None:
            state = self.rows_of_now()
        context, scalars = self._context_at(state)
        scheme = scalars[SCALARS.index("scheme")] if in_step else HALF_STEP
        self.kernel.forces_of_now(int(constrained), float(scheme), t, self.dt, context.values.ctypes.data)
        return state[:, c["fx"]], state[:, c["fy"]], state[:, c["torque"]]

    def _context_at(self, state: np.ndarray) -> tuple[Slots, np.ndarray]:
        """Context for forces of a moment, not of a step, at the rows ``state``; its scalars. Lists are made for it."""
        b, laws, lists, c = self.state.bodies, self.state.laws, self.state.lists, self.state.bodies.columns
        if lists.room:
            reach = self.state.numbers["reach"]
            x, y = state[:, c["x"]].copy(), state[:, c["y"]].copy()
            self.fresh_list(x, y, reach)
            neighbours.prune(
                x, y, b.radius + 0.5 * reach, b.inverse_mass, b.radius, lists.starts, laws.blocks, lists.pair_i,
                lists.pair_j, lists.pair_shift, lists.near_i, lists.near_j, lists.near_shift, lists.near_touch,
                lists.near_mass, lists.near_starts, lists.near_seam, ROW,
            )  # fmt: skip
            walls = self.state.walls
            neighbours.near_walls(
                x, y, b.radius, b.mobile, walls.walls, self.scene.periodic_x or 0.0, laws.blocks, walls.wall_i,
                walls.wall_k, walls.wall_starts,
            )  # fmt: skip
        self.state.forget_lists()
        scalars = laws.scalars.copy()
        scalars[SCALARS.index("share")] = 0.0
        context = self.context_of_now()
        context["state"], context["scalars"] = state.ctypes.data, scalars.ctypes.data
        return context, scalars

    def rows_of_now(self, raw: dict[str, np.ndarray] | None = None) -> np.ndarray:
        """(n, ROW) rows as the laws see them, apart from Chipmunk's memory, at ``raw`` or where the bodies are."""
        state = np.zeros((self.order.n, ROW))
        for name, values in (raw or self.raw()).items():
            if name in self.state.bodies.columns:
                state[:, self.state.bodies.columns[name]] = values
        return state

    def first_kick(self) -> None:
        """Half a kick; of bodies that a constraint holds, a whole one from half a step before."""
        b, held, state = self.state.bodies, self.held_rows, self.rows_of_now()
        context, scalars = self._context_at(state)
        v, before = np.empty((self.order.n, 3)), np.empty((self.order.n, 3))
        scheme = float(scalars[SCALARS.index("scheme")])
        self.kernel.begin(self.t, self.dt, scheme, int(held.any()), held, before, v, context.values.ctypes.data)
        u, m = self.units, self.order.n_mobile
        self.set_velocities(v[:m, 0] / u.velocity, v[:m, 1] / u.velocity)
        for row in np.flatnonzero(v[:m, 2]):
            self.world.bodies[int(row)].angular_velocity = float(v[row, 2] * u.time)
        b.fx[:], b.fy[:] = state[:, b.columns["fx"]], state[:, b.columns["fy"]]

    def forces(self) -> np.ndarray:
        """(n, 2) sum of all forces on each body at the last force call [N], inner order; 0 on walls."""
        b = self.state.bodies
        if self.step == 0:
            result = np.column_stack(self.array_forces(True, self.t)[:2])
        else:
            result = np.column_stack([b.fx, b.fy]) * b.ease[:, None]
        result[self.order.n_mobile :] = 0.0
        return result

    def pair_forces(self, i: np.ndarray, j: np.ndarray, normal: np.ndarray, raw: dict[str, np.ndarray]) -> np.ndarray:
        """(k,) force on each j along ``normal`` (k, 2) [N] by all laws of pairs, bodies being as ``raw`` says."""
        force = np.empty(len(i))
        for u, item in enumerate(self.uses.items):
            if item.law.kind == "pair":
                self.state.laws.uses[u, USE_COLUMNS.index("one")] = self.kernel.one(item.law)
        state, context = self.rows_of_now(raw), self.context_of_now()
        context["state"] = state.ctypes.data
        self.kernel.pair_forces(i, j, normal, self.t, context.values.ctypes.data, force)
        return force
