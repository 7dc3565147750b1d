"""The slow way that can be read: ordinary Python pre-solve and velocity callbacks of pymunk.

For prototyping a law and for reading what the compiled modes do; some hundred times slower.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np
import pymunk

from ...errors import BodyLost, SimulationError
from ...scene import LawUse
from ..callbacks import ALONE, HALF_STEP, TOGETHER, USE_COLUMNS, WALL
from ..motion import Motion
from ..native import Offsets
from ..neighbours import gap_to_walls, to_wall, together
from ..swimmers import lifted
from .base import Backend, Plan


class Python(Backend):
    """Pre-solve of every contact collects pair forces; the first velocity callback of a step adds the rest."""

    name: ClassVar[str] = "python"
    plain_laws: ClassVar[bool] = True
    finds_contacts: ClassVar[bool] = True

    def __init__(self, plan: Plan, offsets: Offsets | None = None, motion: Motion | None = None) -> None:
        """See ``Backend``; nothing native is used."""
        super().__init__(plan)
        self._pairs: dict[tuple[int, int], tuple[float, float, float, float]] = {}
        self._met: set[int] = set()  # rows that Chipmunk has found to touch a straight wall
        self._summed_step = -1
        self._stepping = False
        self._failed: Exception | None = None  # pymunk prints what a callback raises, and goes on
        n = self.order.n
        self._fx = np.zeros(n)
        self._fy = np.zeros(n)
        self._torque = np.zeros(n)
        self._row = self._rows_by_id()
        self._encoded = [
            dict(
                zip(
                    [a for p in item.law.parameters for a in p.arguments],
                    item.law.encode(self.scene.resolved(item)),
                    strict=True,
                )
            )
            for item in self.uses.items
        ]
        self._laws = [lifted(item.law, compiled=False) for item in self.uses.items]
        self._far = [item for item in self.uses.items if item.law.kind == "pair" and item.law.reach]
        for k, body in enumerate(self.world.bodies[: self.order.n_mobile]):
            body.velocity_func = self._velocity_function(k)
        if not self.impulse:
            self.world.space.on_collision(pre_solve=self._pre_solve)
        self.lay_out_seam()

    # ---- pymunk's callbacks ---------------------------------------------------------------------

    def _pre_solve(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: Any) -> None:
        arbiter.process_collision = False  # else Chipmunk's impulses act too
        a, b = (self._row.get(shape.body.id) if shape.body else None for shape in arbiter.shapes)
        if a is None or b is None:
            return
        if WALL in (a, b):
            self._met |= {row for row in (a, b) if row >= 0}
            return
        if a < 0 and b < 0:
            return
        i, j = sorted((a if a >= 0 else -a - 2, b if b >= 0 else -b - 2))
        bodies = self.state.bodies
        if not (bodies.mobile[i] or bodies.mobile[j]):
            return  # a wall and the ghost of another
        if together(i, j, bodies.group, self.state.links.apart):
            return  # a swimmer across the seam
        try:
            self._pairs[i, j] = self.pair_force(i, j, self._time())
        except Exception as error:
            self._failed = self._failed or error

    def _velocity_function(self, k: int) -> Any:
        def update(body: pymunk.Body, gravity: Any, damping: float, dt: float) -> None:
            try:
                self._sum()
            except Exception as error:
                self._failed = self._failed or error
            u = self.units
            bodies = self.state.bodies
            law = pymunk.Vec2d(self._fx[k] / u.force, self._fy[k] / u.force)
            body.force += law * float(bodies.heavier[k])  # the laws have taken their share already
            body.force *= bodies.ease[k]  # in the compiled modes the mass does that
            body.torque += self._torque[k] / u.torque
            pymunk.Body.update_velocity(body, (0.0, 0.0), 1.0, dt)

        return update

    def _rows_by_id(self) -> dict[int, int]:
        return {body.id: k for k, body in enumerate(self.world.bodies)} | {self.world.wall_body.id: WALL}

    # ---- forces, in SI ----------------------------------------------------------------------------

    def _vector(self, k: int) -> tuple[float, float, float, float]:
        """x, y [m] (unwrapped), vx, vy [m/s] of a row."""
        body = self.world.bodies[k]
        (x, y), (vx, vy) = body.position, body.velocity
        length, velocity = self.units.length, self.units.velocity
        gone = self.state.bodies.images[k] * (self.scene.periodic_x or 0.0)
        return x * length + gone, y * length, vx * velocity, vy * velocity

    def _row_state(self, k: int) -> tuple[float, ...]:
        """x, y [m] (unwrapped), vx, vy [m/s], spin [rad/s] of a row."""
        return *self._vector(k), self.world.bodies[k].angular_velocity / self.units.time

    def pair_force(
        self, i: int, j: int, t: float, raw: dict[str, np.ndarray] | None = None
    ) -> tuple[float, float, float, float]:
        """Force on j [N], torques on i and j [N m] at time t [s]; ``raw``: a state other than the Space's."""
        b, laws = self.state.bodies, self.state.laws
        if raw is None:
            first, second = self._row_state(i), self._row_state(j)
        else:
            first, second = (tuple(float(raw[name][k]) for name in ("x", "y", "vx", "vy", "spin")) for k in (i, j))
        xi, yi, ui, vi, wi = first
        xj, yj, uj, vj, wj = second
        dx, dy = xj - xi, yj - yi
        length = self.scene.periodic_x
        if length:
            dx -= length * math.floor(dx / length + 0.5)
        ri, rj = float(b.radius[i]), float(b.radius[j])
        distance = math.sqrt(dx * dx + dy * dy)
        if distance == 0.0:
            return 0.0, 0.0, 0.0, 0.0
        nx, ny = dx / distance, dy / distance
        gap = distance - (ri + rj)
        available = {
            "t": t,
            "gap": gap,
            "distance": distance,
            "vn": (uj - ui) * nx + (vj - vi) * ny,
            "vt": (vj - vi) * nx - (uj - ui) * ny - wj * rj - wi * ri,
            "reduced_mass": 1.0 / (float(b.inverse_mass[i]) + float(b.inverse_mass[j])),
            "reduced_radius": ri * rj / (ri + rj),
            "radius_i": ri,
            "radius_j": rj,
            "spin_i": wi,
            "spin_j": wj,
        }
        fx = fy = ti = tj = 0.0
        for u, item in enumerate(self.uses.items):
            if item.law.kind != "pair" or not (laws.mask[u, i] and laws.mask[u, j]):
                continue
            reach = self._encoded[u][item.law.reach] if item.law.reach else 0.0
            if gap >= reach:
                continue
            fn, ft, *torques = self._call(item, u, available)
            mi, mj = torques or (0.0, 0.0)
            fx += fn * nx - ft * ny
            fy += fn * ny + ft * nx
            ti += mi - ri * ft
            tj += mj - rj * ft
        return fx, fy, ti, tj

    def _add_walls(self, i: int, t: float) -> None:
        """Add the forces of straight walls on row i: as of a disk that stands where the wall is nearest."""
        b, laws = self.state.bodies, self.state.laws
        x, y, vx, vy, spin = self._row_state(i)
        radius = float(b.radius[i])
        walls = self.state.walls.walls
        for k in range(len(walls)):
            dx, dy = to_wall(x, y, walls, k, self.scene.periodic_x or 0.0)
            distance = math.hypot(dx, dy)
            thick = float(walls[k, 4])
            gap = distance - (radius + thick)
            if gap >= 0.0 or distance == 0.0:
                continue
            nx, ny = dx / distance, dy / distance
            available = {
                "t": t, "gap": gap, "distance": distance, "vn": -vx * nx - vy * ny,
                "vt": vx * ny - vy * nx - spin * radius, "reduced_mass": 1.0 / float(b.inverse_mass[i]),
                "reduced_radius": radius, "radius_i": radius, "radius_j": thick, "spin_i": spin, "spin_j": 0.0,
            }  # fmt: skip
            for u, item in enumerate(self.uses.items):
                if item.law.kind != "pair" or item.law.reach or not laws.mask[u, i]:
                    continue
                fn, ft, *torques = self._call(item, u, available)
                self._fx[i] -= fn * nx - ft * ny
                self._fy[i] -= fn * ny + ft * nx
                self._torque[i] += (torques[0] if torques else 0.0) - radius * ft

    def _call(self, item: LawUse, u: int, available: dict[str, Any]) -> Any:
        laws = self.state.laws
        given = {**available, **self._encoded[u], "r0": float(laws.parameters[laws.uses[u, 1] - 1])}
        law = self._laws[u]
        try:
            return law.function(*(given[name] for name in law.arguments))
        except Exception as error:
            what = f"law {law.name} raised {type(error).__name__}: {error}"
            raise SimulationError(f"{what} (t = {self._time():.6g} s)") from error

    def _sum(self, constrained: bool = True, in_step: bool = True) -> None:
        """All forces of this step; positions are new, velocities still half a step behind.

        ``in_step`` False: the velocities are those of the time of the positions.
        """
        if self._summed_step == self.step + 1 and constrained:
            return
        self._summed_step = self.step + 1 if constrained else -1
        b, laws = self.state.bodies, self.state.laws
        t = self._time()
        fx, fy, torque = self._fx, self._fy, self._torque
        fx[:], fy[:], torque[:] = 0.0, 0.0, 0.0
        if self._far:
            for i in range(self.order.n):
                for j in range(i + 1, self.order.n):
                    if (b.mobile[i] or b.mobile[j]) and not together(i, j, b.group, self.state.links.apart):
                        self._pairs[i, j] = self.pair_force(i, j, t)
        for i, j in sorted(self._pairs):  # Chipmunk's order differs between processes
            px, py, ti, tj = self._pairs[i, j]
            fx[j] += px
            fy[j] += py
            fx[i] -= px
            fy[i] -= py
            torque[i] += ti
            torque[j] += tj
        self._pairs.clear()
        for i in sorted(self._met):
            self._add_walls(i, t)
        self._met.clear()
        state = np.array([(*self._row_state(k), self.world.bodies[k].angle) for k in range(self.order.n)])
        exact = in_step and self.uses.scheme != HALF_STEP
        if not exact:
            self._add(range(len(self.uses.items)), t, state, constrained)
            self._hold(state, constrained)
            return
        # dampings twice, as the compiled modes do: those of all rows that are joined together, else one after the other
        damped = np.flatnonzero(laws.uses[:, USE_COLUMNS.index("damping")]).tolist()
        joined = np.zeros(self.order.n, dtype=bool)
        joined[: {ALONE: 0, TOGETHER: self.order.n}.get(self.uses.scheme, int(laws.chains.max(initial=0)))] = True
        half = 0.5 * self.dt * b.kick_mass

        def middle() -> np.ndarray:
            result = state.copy()
            result[:, 2] += half * fx
            result[:, 3] += half * fy
            result[:, 4] += 0.5 * self.dt * b.inverse_moment * torque
            return result

        everything = range(damped[0], len(self.uses.items))
        self._add(range(damped[0]), t, state, constrained)
        before = fx.copy(), fy.copy(), torque.copy()
        self._add(everything, t, state, constrained)
        self._hold(state, constrained)
        after = middle()
        single = fx.copy(), fy.copy()
        if not joined.all():
            for u in (damped[-1], *damped[:-1]):
                now = middle()
                self._add([u], t, now, constrained)
                with_new = fx.copy(), fy.copy()
                self._add([u], t, state, constrained)
                fx[:], fy[:] = 2 * with_new[0] - fx, 2 * with_new[1] - fy
            single = fx.copy(), fy.copy()
        fx[:], fy[:], torque[:] = before
        for u in everything:
            self._add([u], t, after if u in damped else state, constrained)
        self._hold(state, constrained)
        fx[:], fy[:] = np.where(joined, fx, single[0]), np.where(joined, fy, single[1])

    def _add(self, uses: Iterable[int], t: float, state: np.ndarray, constrained: bool) -> None:
        """Add the forces of these uses but those of pairs.

        ``state`` (n, 6) x, y [m], vx, vy [m/s], spin [rad/s], angle [rad].
        """
        laws, b, fx, fy = self.state.laws, self.state.bodies, self._fx, self._fy
        for u in uses:
            item = self.uses.items[u]
            kind = item.law.kind
            if kind == "chain":
                for first, last in laws.chains:
                    if not laws.mask[u, first]:
                        continue
                    m = slice(first, last)
                    arrays = {
                        "t": t, "x": state[m, 0].copy(), "y": state[m, 1].copy(), "vx": state[m, 2].copy(),
                        "vy": state[m, 3].copy(), "mass": b.mass[m], "fx": fx[m], "fy": fy[m],
                    }  # fmt: skip
                    self._call(item, u, arrays)
            elif kind == "joint":
                for q in laws.joint_of[laws.uses[u, 2] : laws.uses[u, 3]]:
                    self._add_torque(item, u, t, state, q)
            elif kind == "body" or (kind == "constraint" and constrained):
                for k in laws.rows[laws.uses[u, 2] : laws.uses[u, 3]]:
                    ax, ay = self._call(item, u, self._body_state(k, t, state, item))
                    fx[k] += ax
                    fy[k] += ay

    def _add_torque(self, item: LawUse, u: int, t: float, state: np.ndarray, q: int) -> None:
        """A law of joints in joint q: a pin pushes the body at the end of its rod across, a hinge turns its bodies."""
        laws = self.state.laws
        kind, i, j = laws.joints[q]
        if kind == 0:
            (dx, dy), (vx, vy) = state[j, :2] - laws.joint_at[q], state[j, 2:4]
            square = dx * dx + dy * dy
            rate, bend = (dx * vy - dy * vx) / square, math.atan2(dx, -dy)
            push = self._call(item, u, {"t": t, "rate": rate, "bend": bend}) / square
            self._fx[j] -= push * dy
            self._fy[j] += push * dx
            return
        at_j, at_i = (state[k, 4:] if k >= 0 else np.zeros(2) for k in (j, i))
        torque = self._call(item, u, {"t": t, "rate": at_j[0] - at_i[0], "bend": at_j[1] - at_i[1]})
        for k, sign in ((j, 1.0), (i, -1.0)):
            if k >= 0:
                self._torque[k] += sign * torque

    def _hold(self, state: np.ndarray, constrained: bool) -> None:
        """Add the forces of hinges and rods."""
        links = self.joints.links
        rows = links.rows
        if not len(rows) or not constrained:
            return
        b = self.state.bodies
        fixed = links.mobility[:, 3] == 0.0
        self._torque[rows[fixed]] = 0.0
        force = np.column_stack([self._fx[rows], self._fy[rows], self._torque[rows]])
        inverse = np.column_stack([b.inverse_mass[rows]] * 2 + [b.inverse_moment[rows]])
        push = links.hold(self.dt, state[rows][:, [0, 1, 5]].copy(), state[rows][:, 2:5], force, inverse)
        if push is None:
            self._fx[rows] = math.nan
            return
        xx, xy, yy, _ = links.mobility.T
        self._fx[rows] += b.mass[rows] * (xx * push[:, 0] + xy * push[:, 1])
        self._fy[rows] += b.mass[rows] * (xy * push[:, 0] + yy * push[:, 1])
        self._torque[rows] += np.where(fixed, 0.0, push[:, 2])

    def _time(self) -> float:
        """Time of the positions [s], which the drift has led one step on."""
        return self.start_time + (self.step + (1 if self._stepping else 0)) * self.dt

    def _body_state(self, k: int, t: float, state: np.ndarray, item: LawUse) -> dict[str, Any]:
        b, laws = self.state.bodies, self.state.laws
        x, y, vx, vy = (float(v) for v in state[k, :4])
        command = 0.0
        if "command" in item.law.arguments:
            first, last = laws.input_at[k]
            command = float(np.interp(t + 0.5 * self.dt, laws.input_t[first:last], laws.input_v[first:last]))
        _, gx, gy, g, mean_mass, *_ = (float(v) for v in laws.scalars)
        return {
            "t": t, "dt": self.dt, "x": x, "y": y, "vx": vx, "vy": vy, "mass": float(b.mass[k]),
            "radius": float(b.radius[k]), "given_inertia": float(b.given_inertia[k]), "fx": self._fx[k],
            "fy": self._fy[k], "command": command,
            "wall_gap": gap_to_walls(x, y, float(b.radius[k]), self.state.walls.walls, self.scene.periodic_x or 0.0),
            "gx": gx, "gy": gy, "g": g, "mean_mass": mean_mass,
        }  # fmt: skip

    # ---- time -------------------------------------------------------------------------------------

    def first_kick(self) -> None:
        """The first kick, as in the compiled modes: half of one; where a constraint holds a body, a whole one."""
        n, half, unit = self.order.n_mobile, 0.5 * self.dt, self.units.velocity
        b = self.state.bodies
        weight = np.column_stack([b.inverse_mass, b.inverse_mass, b.inverse_moment])[:n]
        touching = self._touching()
        start = np.array([(*body.velocity, body.angular_velocity) for body in self.world.bodies[:n]]).reshape(n, 3)
        start *= [unit, unit, 1 / self.units.time]
        held = self.held_rows[:n, None]

        def set_state(v: np.ndarray) -> None:
            for body, (vx, vy, w) in zip(self.world.bodies, v / [unit, unit, 1 / self.units.time], strict=False):
                body.velocity, body.angular_velocity = (vx, vy), w

        def accelerations(v: np.ndarray, constrained: bool, in_step: bool = False) -> np.ndarray:
            set_state(v)
            self._pairs = {(i, j): self.pair_force(i, j, self.t) for i, j in touching}
            self._met = set(range(n)) if self.scene.walls else set()
            self._summed_step = -1
            self._sum(constrained, in_step)
            return weight * np.column_stack([self._fx, self._fy, self._torque])[:n]

        v = start + half * accelerations(start, True)
        if held.any():
            a = accelerations(start, False)
            for _ in range(2):
                behind = np.where(held, start - half * a, start)
                a = accelerations(behind, True, in_step=True)
            v = np.where(held, behind + self.dt * a, v)
        set_state(v)
        self._summed_step = -1

    def thaw(self, arrays: dict[str, np.ndarray], step: int, begun: bool) -> None:
        """See ``Backend``."""
        super().thaw(arrays, step, begun)
        b = self.state.bodies
        self._fx[:], self._fy[:], self._torque[:] = b.fx, b.fy, b.torque
        self._summed_step = -1
        self.lay_out_seam()

    def _touching(self) -> list[tuple[int, int]]:
        if not self.uses.has_pairs:
            return []
        b, lists = self.state.bodies, self.state.lists
        count = self.fresh_list(b.row("x").copy(), b.row("y").copy(), 0.0)
        return list(zip(lists.pair_i[:count].tolist(), lists.pair_j[:count].tolist(), strict=True))

    def advance(self, steps: int) -> None:
        """Do that many steps. Raises SimulationError when a number is no longer finite."""
        length = self.scene.periodic_x
        b = self.state.bodies
        for _ in range(steps):
            self._stepping = True
            self.world.space.step(self.dt / self.units.time)
            self._stepping = False
            failed, self._failed = self._failed, None
            if failed is not None:
                raise failed
            self.step += 1
            m = slice(0, self.order.n_mobile)
            b.fx[m], b.fy[m], b.torque[m] = self._fx[m], self._fy[m], self._torque[m]
            positions = np.array([body.position for body in self.world.bodies[: self.order.n_mobile]])
            if not np.isfinite(positions).all():
                who = int(np.flatnonzero(~np.isfinite(positions).all(axis=1))[0])
                name = self.scene.bodies[self.order.rows_of[who]].id
                raise BodyLost(
                    f"the position of body {name} is not finite after step {self.step} (t = {self.t:.6g} s)"
                )
            if length:
                way = np.hypot(*(positions * self.units.length - self._laid_out[m]).T)
                if way.max() > self.state.numbers["margin"]:
                    self.lay_out_seam()

    def lay_out_seam(self, wrap: bool = True) -> None:
        """See ``Backend``; ghosts follow their originals by a callback."""
        if not self.scene.periodic_x:
            return
        super().lay_out_seam(wrap)
        self._row = self._rows_by_id()
        originals = {ghost.id: k for (ghost, _), k in zip(self.world.ghosts, self.world.originals, strict=True)}
        period = self.scene.periodic_x / self.units.length
        for ghost, _ in self.world.ghosts:
            k = originals[ghost.id]
            self._row[ghost.id] = -k - 2
            ghost.position_func = _follow(self.world.bodies[k], period)
        self._laid_out = np.array([body.position for body in self.world.bodies]) * self.units.length

    def pair_forces(self, i: np.ndarray, j: np.ndarray, normal: np.ndarray, raw: dict[str, np.ndarray]) -> np.ndarray:
        """(k,) force on each j along ``normal`` (k, 2) [N] by all laws of pairs, bodies being as ``raw`` says."""
        force = np.empty(len(i))
        for k in range(len(i)):
            px, py, _, _ = self.pair_force(int(i[k]), int(j[k]), self.t, raw)
            force[k] = px * normal[k, 0] + py * normal[k, 1]
        return force

    def forces(self) -> np.ndarray:
        """(n, 2) forces of the last step [N], inner order."""
        result = np.column_stack([self._fx, self._fy])
        result[self.order.n_mobile :] = 0.0
        return result * self.state.bodies.ease[:, None]


def _follow(original: pymunk.Body, period: float) -> Any:
    def update(ghost: pymunk.Body, dt: float) -> None:
        ghost.position = (original.position.x + period, original.position.y)
        ghost.velocity = original.velocity

    return update
