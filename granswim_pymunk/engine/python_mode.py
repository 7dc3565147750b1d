"""The slow way that can be read: ordinary Python pre-solve and velocity callbacks of pymunk.

For prototyping a law and for reading what the compiled modes do; some hundred times slower.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import pymunk

from ..errors import SimulationError
from ..scene import LawUse
from .callbacks import ALONE, HALF_STEP, TOGETHER, USE_COLUMNS, WALL
from .neighbours import gap_to_walls, to_wall, together

if TYPE_CHECKING:
    from .simulation import Simulation


class PythonCallbacks:
    """Pre-solve of every contact collects pair forces; the first velocity callback of a step adds the rest."""

    def __init__(self, simulation: Simulation) -> None:
        s = self.simulation = simulation
        self._pairs: dict[tuple[int, int], tuple[float, float, float, float]] = {}
        self._met: set[int] = set()  # rows that Chipmunk has found to touch a straight wall
        self._summed_step = -1
        n = s._n
        self._fx = np.zeros(n)
        self._fy = np.zeros(n)
        self._torque = np.zeros(n)
        self._row = self._rows_by_id()
        self._encoded = [
            dict(
                zip(
                    [a for p in item.law.parameters for a in p.arguments],
                    item.law.encode(s.scene.resolved(item)),
                    strict=True,
                )
            )
            for item in s._uses
        ]
        self._far = [item for item in s._uses if item.law.kind == "pair" and item.law.reach]
        for k, body in enumerate(s._bodies[: s._n_mobile]):
            body.velocity_func = self._velocity_function(k)
        if not s.impulse:
            s._space.on_collision(pre_solve=self._pre_solve)
        self._lay_out_seam()

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
        arrays = self.simulation._a
        if not (arrays["mobile"][i] or arrays["mobile"][j]):
            return  # a wall and the ghost of another
        if together(i, j, arrays["group"], arrays["apart"]):
            return  # a swimmer across the seam
        self._pairs[i, j] = self.pair_force(i, j, self._time())

    def _velocity_function(self, k: int) -> Any:
        def update(body: pymunk.Body, gravity: Any, damping: float, dt: float) -> None:
            self._sum()
            u = self.simulation.units
            body.force += pymunk.Vec2d(self._fx[k] / u.force, self._fy[k] / u.force)
            body.force *= self.simulation._ease[k]  # in the compiled modes the mass does that
            body.torque += self._torque[k] / u.torque
            pymunk.Body.update_velocity(body, (0.0, 0.0), 1.0, dt)

        return update

    def _rows_by_id(self) -> dict[int, int]:
        s = self.simulation
        return {body.id: k for k, body in enumerate(s._bodies)} | {s._wall_body.id: WALL}

    # ---- forces, in SI ----------------------------------------------------------------------------

    def _vector(self, k: int) -> tuple[float, float, float, float]:
        """x, y [m] (unwrapped), vx, vy [m/s] of a row."""
        s = self.simulation
        body = s._bodies[k]
        (x, y), (vx, vy) = body.position, body.velocity
        length, velocity = s.units.length, s.units.velocity
        return (
            x * length + s._images[k] * (s.scene.periodic_x or 0.0), y * length, vx * velocity, vy * velocity
        )  # fmt: skip

    def _row_state(self, k: int) -> tuple[float, ...]:
        """x, y [m] (unwrapped), vx, vy [m/s], spin [rad/s] of a row."""
        s = self.simulation
        return *self._vector(k), s._bodies[k].angular_velocity / s.units.time

    def pair_force(
        self, i: int, j: int, t: float, raw: dict[str, np.ndarray] | None = None
    ) -> tuple[float, float, float, float]:
        """Force on j [N], torques on i and j [N m] at time t [s]; ``raw``: a state other than the Space's."""
        s = self.simulation
        a = s._a
        if raw is None:
            first, second = self._row_state(i), self._row_state(j)
        else:
            first, second = (tuple(float(raw[name][k]) for name in ("x", "y", "vx", "vy", "spin")) for k in (i, j))
        xi, yi, ui, vi, wi = first
        xj, yj, uj, vj, wj = second
        dx, dy = xj - xi, yj - yi
        length = s.scene.periodic_x
        if length:
            dx -= length * math.floor(dx / length + 0.5)
        ri, rj = float(a["radius"][i]), float(a["radius"][j])
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
            "reduced_mass": 1.0 / (float(a["inverse_mass"][i]) + float(a["inverse_mass"][j])),
            "reduced_radius": ri * rj / (ri + rj),
            "radius_i": ri,
            "radius_j": rj,
            "spin_i": wi,
            "spin_j": wj,
        }
        fx = fy = ti = tj = 0.0
        for u, item in enumerate(s._uses):
            if item.law.kind != "pair" or not (a["mask"][u, i] and a["mask"][u, j]):
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
        s = self.simulation
        a = s._a
        x, y, vx, vy, spin = self._row_state(i)
        radius = float(a["radius"][i])
        for k in range(len(a["walls"])):
            dx, dy = to_wall(x, y, a["walls"], k, s.scene.periodic_x or 0.0)
            distance = math.hypot(dx, dy)
            thick = float(a["walls"][k, 4])
            gap = distance - (radius + thick)
            if gap >= 0.0 or distance == 0.0:
                continue
            nx, ny = dx / distance, dy / distance
            available = {
                "t": t, "gap": gap, "distance": distance, "vn": -vx * nx - vy * ny,
                "vt": vx * ny - vy * nx - spin * radius, "reduced_mass": 1.0 / float(a["inverse_mass"][i]),
                "reduced_radius": radius, "radius_i": radius, "radius_j": thick, "spin_i": spin, "spin_j": 0.0,
            }  # fmt: skip
            for u, item in enumerate(s._uses):
                if item.law.kind != "pair" or item.law.reach or not a["mask"][u, i]:
                    continue
                fn, ft, *torques = self._call(item, u, available)
                self._fx[i] -= fn * nx - ft * ny
                self._fy[i] -= fn * ny + ft * nx
                self._torque[i] += (torques[0] if torques else 0.0) - radius * ft

    def _call(self, item: LawUse, u: int, available: dict[str, Any]) -> Any:
        a = self.simulation._a
        given = {**available, **self._encoded[u], "r0": float(a["parameters"][a["uses"][u, 1] - 1])}
        return item.law.function(*(given[name] for name in item.law.arguments))

    def _sum(self, constrained: bool = True, in_step: bool = True) -> None:
        """All forces of this step; positions are new, velocities still half a step behind.

        ``in_step`` False: the velocities are those of the time of the positions.
        """
        s = self.simulation
        if self._summed_step == s.step + 1 and constrained:
            return
        self._summed_step = s.step + 1 if constrained else -1
        a = s._a
        t = self._time()
        fx, fy, torque = self._fx, self._fy, self._torque
        fx[:], fy[:], torque[:] = 0.0, 0.0, 0.0
        if self._far:
            for i in range(s._n):
                for j in range(i + 1, s._n):
                    if (a["mobile"][i] or a["mobile"][j]) and not together(i, j, a["group"], a["apart"]):
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
        state = np.array([(*self._row_state(k), s._bodies[k].angle) for k in range(s._n)])
        exact = in_step and s._scheme != HALF_STEP
        if not exact:
            self._add(range(len(s._uses)), t, state, constrained)
            self._hold(state, constrained)
            return
        # dampings twice, as the compiled modes do: those of all rows that are joined together, else one after the other
        damped = np.flatnonzero(a["uses"][:, USE_COLUMNS.index("damping")]).tolist()
        joined = np.zeros(s._n, dtype=bool)
        joined[: {ALONE: 0, TOGETHER: s._n}.get(s._scheme, int(a["chains"].max(initial=0)))] = True
        half = 0.5 * s.dt * a["kick_mass"]

        def middle() -> np.ndarray:
            result = state.copy()
            result[:, 2] += half * fx
            result[:, 3] += half * fy
            result[:, 4] += 0.5 * s.dt * s._inverse_moment * torque
            return result

        everything = range(damped[0], len(s._uses))
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
        s, a, fx, fy = self.simulation, self.simulation._a, self._fx, self._fy
        for u in uses:
            item = s._uses[u]
            kind = item.law.kind
            if kind == "chain":
                for first, last in a["chains"]:
                    if not a["mask"][u, first]:
                        continue
                    m = slice(first, last)
                    arrays = {
                        "t": t, "x": state[m, 0].copy(), "y": state[m, 1].copy(), "vx": state[m, 2].copy(),
                        "vy": state[m, 3].copy(), "mass": a["mass"][m], "fx": fx[m], "fy": fy[m],
                    }  # fmt: skip
                    self._call(item, u, arrays)
            elif kind == "joint":
                for q in a["joint_of"][a["uses"][u, 2] : a["uses"][u, 3]]:
                    self._add_torque(item, u, t, state, q)
            elif kind == "body" or (kind == "constraint" and constrained):
                for k in a["rows"][a["uses"][u, 2] : a["uses"][u, 3]]:
                    ax, ay = self._call(item, u, self._body_state(k, t, state, item))
                    fx[k] += ax
                    fy[k] += ay

    def _add_torque(self, item: LawUse, u: int, t: float, state: np.ndarray, q: int) -> None:
        """A law of joints in joint q: a pin pushes the body at the end of its rod across, a hinge turns its bodies."""
        a = self.simulation._a
        kind, i, j = a["joints"][q]
        if kind == 0:
            (dx, dy), (vx, vy) = state[j, :2] - a["joint_at"][q], state[j, 2:4]
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
        s = self.simulation
        links = s._links
        rows = links.rows
        if not len(rows) or not constrained:
            return
        a = s._a
        fixed = links.mobility[:, 3] == 0.0
        self._torque[rows[fixed]] = 0.0
        force = np.column_stack([self._fx[rows], self._fy[rows], self._torque[rows]])
        inverse = np.column_stack([a["inverse_mass"][rows]] * 2 + [s._inverse_moment[rows]])
        push = links.hold(s.dt, state[rows][:, [0, 1, 5]].copy(), state[rows][:, 2:5], force, inverse)
        if push is None:
            self._fx[rows] = math.nan
            return
        xx, xy, yy, _ = links.mobility.T
        self._fx[rows] += a["mass"][rows] * (xx * push[:, 0] + xy * push[:, 1])
        self._fy[rows] += a["mass"][rows] * (xy * push[:, 0] + yy * push[:, 1])
        self._torque[rows] += np.where(fixed, 0.0, push[:, 2])

    def _time(self) -> float:
        """Time of the positions [s], which the drift has led one step on."""
        s = self.simulation
        return s.scene.time.start + (s.step + (1 if self._stepping else 0)) * s.dt

    _stepping = False

    def _body_state(self, k: int, t: float, state: np.ndarray, item: LawUse) -> dict[str, Any]:
        s = self.simulation
        a = s._a
        x, y, vx, vy = (float(v) for v in state[k, :4])
        command = 0.0
        if "command" in item.law.arguments:
            first, last = a["input_at"][k]
            command = float(np.interp(t + 0.5 * s.dt, a["input_t"][first:last], a["input_v"][first:last]))
        _, gx, gy, g, mean_mass, *_ = (float(v) for v in a["scalars"])
        return {
            "t": t, "dt": s.dt, "x": x, "y": y, "vx": vx, "vy": vy, "mass": float(a["mass"][k]),
            "radius": float(a["radius"][k]), "given_inertia": float(a["given_inertia"][k]), "fx": self._fx[k],
            "fy": self._fy[k], "command": command,
            "wall_gap": gap_to_walls(x, y, float(a["radius"][k]), a["walls"], s.scene.periodic_x or 0.0),
            "gx": gx, "gy": gy, "g": g, "mean_mass": mean_mass,
        }  # fmt: skip

    # ---- time -------------------------------------------------------------------------------------

    def begin(self) -> None:
        """The first kick, as in the compiled modes: half of one; where a constraint holds a body, a whole one."""
        s = self.simulation
        n, half, unit = s._n_mobile, 0.5 * s.dt, s.units.velocity
        weight = np.column_stack([s._a["inverse_mass"], s._a["inverse_mass"], s._inverse_moment])[:n]
        touching = self._touching()
        start = np.array([(*body.velocity, body.angular_velocity) for body in s._bodies[:n]]).reshape(n, 3)
        start *= [unit, unit, 1 / s.units.time]
        held = s._held_rows()[:n, None]

        def set_state(v: np.ndarray) -> None:
            for body, (vx, vy, w) in zip(s._bodies, v / [unit, unit, 1 / s.units.time], strict=False):
                body.velocity, body.angular_velocity = (vx, vy), w

        def accelerations(v: np.ndarray, constrained: bool, in_step: bool = False) -> np.ndarray:
            set_state(v)
            self._pairs = {(i, j): self.pair_force(i, j, s.t) for i, j in touching}
            self._met = set(range(n)) if s.scene.walls else set()
            self._summed_step = -1
            self._sum(constrained, in_step)
            return weight * np.column_stack([self._fx, self._fy, self._torque])[:n]

        v = start + half * accelerations(start, True)
        if held.any():
            a = accelerations(start, False)
            for _ in range(2):
                behind = np.where(held, start - half * a, start)
                a = accelerations(behind, True, in_step=True)
            v = np.where(held, behind + s.dt * a, v)
        set_state(v)
        self._summed_step = -1

    def resume(self) -> None:
        """Go on from what stands in the simulation's arrays."""
        a = self.simulation._a
        self._fx[:], self._fy[:], self._torque[:] = a["fx"], a["fy"], a["torque"]
        self._summed_step = -1
        self._lay_out_seam()

    def _touching(self) -> list[tuple[int, int]]:
        s = self.simulation
        if not any(item.law.kind == "pair" for item in s._uses):
            return []
        a = s._a
        count = s._fresh_list(a["x"].copy(), a["y"].copy(), 0.0)
        return list(zip(a["pair_i"][:count].tolist(), a["pair_j"][:count].tolist(), strict=True))

    def advance(self, steps: int) -> None:
        """Do that many steps. Raises SimulationError when a number is no longer finite."""
        s = self.simulation
        length = s.scene.periodic_x
        for _ in range(steps):
            self._stepping = True
            s._space.step(s.dt / s.units.time)
            self._stepping = False
            s.step += 1
            m = slice(0, s._n_mobile)
            for name, own in (("fx", self._fx), ("fy", self._fy), ("torque", self._torque)):
                s._a[name][m] = own[m]
            positions = np.array([body.position for body in s._bodies[: s._n_mobile]])
            if not np.isfinite(positions).all():
                who = int(np.flatnonzero(~np.isfinite(positions).all(axis=1))[0])
                name = s.scene.bodies[s._rows_of[who]].id
                raise SimulationError(
                    f"the position of body {name} is not finite after step {s.step} (t = {s.t:.6g} s)"
                )
            if length:
                way = np.hypot(*(positions * s.units.length - self._laid_out[m]).T)
                if way.max() > s._floats_margin():
                    self._lay_out_seam()

    def _lay_out_seam(self) -> None:
        s = self.simulation
        if not s.scene.periodic_x:
            return
        s._lay_out_seam()
        self._row = self._rows_by_id()
        originals = {ghost.id: k for (ghost, _), k in zip(s._ghosts, s._ghost_originals, strict=True)}
        period = s.scene.periodic_x / s.units.length
        for ghost, _ in s._ghosts:
            k = originals[ghost.id]
            self._row[ghost.id] = -k - 2
            ghost.position_func = _follow(s._bodies[k], period)
        self._laid_out = np.array([body.position for body in s._bodies]) * s.units.length

    def forces(self) -> np.ndarray:
        """(n, 2) forces of the last step [N], inner order."""
        result = np.column_stack([self._fx, self._fy])
        result[self.simulation._n_mobile :] = 0.0
        return result * self.simulation._ease[:, None]


def _follow(original: pymunk.Body, period: float) -> Any:
    def update(ghost: pymunk.Body, dt: float) -> None:
        ghost.position = (original.position.x + period, original.position.y)
        ghost.velocity = original.velocity

    return update
