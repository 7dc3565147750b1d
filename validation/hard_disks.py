"""Hard disks on a table, from event to event: neither the engine's code nor that of the proof's simulator.

Between impacts a disk flies by its closed solution (free, or slowed by dry friction) or, under repulsion and drag, by
Runge and Kutta's fourth order. Steps shrink as two disks come near, and the moment of touching is found by bisection.
An impact is Newton's (restitution e) with Coulomb's bound on the tangential impulse, the spins followed.

A real impact is no instant: it may come a little late, or spread its impulse over a short time (``Impacts``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from granswim_pymunk.errors import SimulationError

G = 9.81  # m/s^2
LONGEST = 2e-3  # s, of a step in flight
SHORTEST = 2e-6  # s, of a step towards a touch; what is left is bisected
PARTS = 8  # an impact that lasts is given in so many equal parts


@dataclass(frozen=True)
class Physics:
    """What acts on the disks, SI.

    restitution : -v_n'/v_n;  at_walls : the same at straight walls, None: that of disks
    contact_friction : bound of the tangential impulse over the normal one
    substrate : deceleration over g;  drag : force over velocity [kg/s], each disk alike
    repulsion : (s [N], n, r_0 [m]), a force s (r_0/d)^n along the line of centres at a distance d;  g [m/s^2]
    """

    restitution: float = 1.0
    at_walls: float | None = None
    contact_friction: float = 0.0
    substrate: float = 0.0
    drag: float = 0.0
    repulsion: tuple[float, float, float] | None = None
    g: float = G


@dataclass(frozen=True)
class Impacts:
    """How impacts depart from an instant at the moment of touching.

    late : each comes up to so many seconds late;  lasting : each lasts up to so many seconds
    """

    late: float = 0.0
    lasting: float = 0.0


@dataclass(frozen=True)
class Table:
    """Disks on a table, some of them fixed, and straight walls.

    radius (n,) [m];  mass (n,) [kg];  fixed (n,) bool;  walls : pairs of points [m]
    """

    radius: np.ndarray
    mass: np.ndarray
    fixed: np.ndarray
    walls: tuple[tuple[tuple[float, float], tuple[float, float]], ...] = ()

    @property
    def inertia(self) -> np.ndarray:
        """Moments of inertia (n,) [kg m^2]: 2/5 m r^2, as the contract has them."""
        return 0.4 * self.mass * self.radius**2


@dataclass(frozen=True)
class Flight:
    """xy (T, n, 2) [m], v (T, n, 2) [m/s], spin (T, n) [rad/s] at the asked times.

    touches : (t [s], i, j, closing speed [m/s], slip [m/s]) of every impact; j is n + k at wall k
    """

    xy: np.ndarray
    v: np.ndarray
    spin: np.ndarray
    touches: tuple[tuple[float, int, int, float, float], ...]


@dataclass(order=True)
class _Kick:
    """An impulse that is still to come: from touching pair (i, j) at ``t``; ``share`` None: worked out then."""

    t: float
    i: int = field(compare=False)
    j: int = field(compare=False)
    share: np.ndarray | None = field(compare=False, default=None)  # impulse on j [N s], (2,)
    last: bool = field(compare=False, default=True)


class _Run:
    """The state of one run; times in s, everything SI."""

    def __init__(self, table: Table, physics: Physics, impacts: Impacts, rng: np.random.Generator | None) -> None:
        self.table, self.physics, self.impacts, self.rng = table, physics, impacts, rng
        self.t = 0.0
        n = len(table.radius)
        self.n = n
        self.x = np.zeros((n, 2))
        self.v = np.zeros((n, 2))
        self.spin = np.zeros(n)
        self.kicks: list[_Kick] = []
        self.busy: set[tuple[int, int]] = set()
        self.touches: list[tuple[float, int, int, float, float]] = []
        first, second = np.triu_indices(n, 1)
        both = ~(table.fixed[first] & table.fixed[second])
        self.first, self.second = first[both], second[both]
        self.reach = table.radius[self.first] + table.radius[self.second]
        self.inverse = np.where(table.fixed, 0.0, 1.0 / table.mass)

    # ---- flight ---------------------------------------------------------------------------------

    def acceleration(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Of repulsion and drag (n, 2) [m/s^2]."""
        force = -self.physics.drag * v
        if self.physics.repulsion is not None:
            s, n, r_0 = self.physics.repulsion
            apart = x[self.second] - x[self.first]
            d = np.hypot(apart[:, 0], apart[:, 1])
            push = (s * (r_0 / d) ** n / d)[:, None] * apart
            np.add.at(force, self.second, push)
            np.add.at(force, self.first, -push)
        return force * self.inverse[:, None]

    def flown(self, s: float) -> tuple[np.ndarray, np.ndarray]:
        """Places and velocities after ``s`` seconds without an impact."""
        x, v, physics = self.x, self.v, self.physics
        if physics.drag == 0.0 and physics.repulsion is None:
            if physics.substrate == 0.0:
                return x + s * v, v
            speed = np.hypot(v[:, 0], v[:, 1])
            slowing = physics.substrate * physics.g
            way = np.divide(v, speed[:, None], out=np.zeros_like(v), where=speed[:, None] > 0)
            time = np.minimum(s, speed / slowing)
            return x + way * (speed * time - 0.5 * slowing * time**2)[:, None], way * (speed - slowing * time)[:, None]
        a1 = self.acceleration(x, v)
        v2 = v + 0.5 * s * a1
        a2 = self.acceleration(x + 0.5 * s * v, v2)
        v3 = v + 0.5 * s * a2
        a3 = self.acceleration(x + 0.5 * s * v2, v3)
        v4 = v + s * a3
        a4 = self.acceleration(x + s * v3, v4)
        return x + s / 6 * (v + 2 * v2 + 2 * v3 + v4), v + s / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    # ---- touching -------------------------------------------------------------------------------

    def near(self, x: np.ndarray, v: np.ndarray) -> list[tuple[float, float, int, int]]:
        """(gap, closing speed, i, j) of all pairs and walls that approach and are not in an impact already."""
        apart = x[self.second] - x[self.first]
        d = np.hypot(apart[:, 0], apart[:, 1])
        closing = -((v[self.second] - v[self.first]) * apart).sum(axis=1) / d
        found = []
        for k in np.flatnonzero(closing > 0):
            pair = (int(self.first[k]), int(self.second[k]))
            if pair not in self.busy:
                found.append((float(d[k] - self.reach[k]), float(closing[k]), *pair))
        for w in range(len(self.table.walls)):
            for i in np.flatnonzero(~self.table.fixed):
                pair = (int(i), self.n + w)
                normal, gap = self.to_wall(x[i], w)
                speed = float(v[i] @ normal)
                if speed > 0 and pair not in self.busy:
                    found.append((gap - float(self.table.radius[i]), speed, *pair))
        return found

    def to_wall(self, point: np.ndarray, wall: int) -> tuple[np.ndarray, float]:
        """Unit vector from a point to the nearest one of a wall, and the distance [m]."""
        begin, end = (np.asarray(p, dtype=float) for p in self.table.walls[wall])
        along = end - begin
        share = min(max(float((point - begin) @ along / (along @ along)), 0.0), 1.0)
        way = begin + share * along - point
        distance = math.hypot(*way)
        return way / distance, distance

    def gap(self, x: np.ndarray, i: int, j: int) -> float:
        if j >= self.n:
            return self.to_wall(x[i], j - self.n)[1] - float(self.table.radius[i])
        return math.hypot(*(x[j] - x[i])) - float(self.table.radius[i] + self.table.radius[j])

    def normal(self, i: int, j: int) -> np.ndarray:
        """Unit vector from i to j."""
        if j >= self.n:
            return self.to_wall(self.x[i], j - self.n)[0]
        way = self.x[j] - self.x[i]
        return way / math.hypot(*way)

    def impulse(self, i: int, j: int) -> tuple[np.ndarray, float, float]:
        """Impulse on j (2,) [N s] that an impact now would give; closing speed and slip [m/s]."""
        table, normal = self.table, self.normal(i, j)
        across = np.array([-normal[1], normal[0]])
        wall = j >= self.n
        inverse = self.inverse[i] + (0.0 if wall else self.inverse[j])
        relative = (0.0 if wall else self.v[j]) - self.v[i]
        closing = -float(relative @ normal)
        slip = float(relative @ across) - self.spin[i] * table.radius[i]
        turning = 0.0 if table.fixed[i] else table.radius[i] ** 2 / table.inertia[i]
        if not wall:
            slip -= self.spin[j] * table.radius[j]
            turning += 0.0 if table.fixed[j] else table.radius[j] ** 2 / table.inertia[j]
        physics = self.physics
        bounce = physics.at_walls if wall and physics.at_walls is not None else physics.restitution
        push = (1.0 + bounce) * closing / inverse
        most = self.physics.contact_friction * push
        rub = float(np.clip(-slip / (inverse + turning), -most, most))
        return push * normal + rub * across, closing, slip

    def give(self, i: int, j: int, impulse: np.ndarray) -> None:
        """Add an impulse on j, and the opposite one on i."""
        table, normal = self.table, self.normal(i, j)
        rub = float(-impulse[0] * normal[1] + impulse[1] * normal[0])
        self.v[i] -= self.inverse[i] * impulse
        if not table.fixed[i]:
            self.spin[i] -= table.radius[i] * rub / table.inertia[i]
        if j < self.n:
            self.v[j] += self.inverse[j] * impulse
            if not table.fixed[j]:
                self.spin[j] -= table.radius[j] * rub / table.inertia[j]

    def touch(self, i: int, j: int) -> None:
        """An impact begins: at once, late, or in parts."""
        impulse, closing, slip = self.impulse(i, j)
        self.touches.append((self.t, i, j, closing, slip))
        if len(self.touches) > 10000:
            raise SimulationError("more than 10000 impacts: the disks are jammed")
        rng = self.rng
        if rng is not None and self.impacts.late > 0:
            self.busy.add((i, j))
            self.kicks.append(_Kick(self.t + rng.uniform(0.0, self.impacts.late), i, j))
        elif rng is not None and self.impacts.lasting > 0:
            self.busy.add((i, j))
            lasts = rng.uniform(0.0, self.impacts.lasting)
            for k in range(PARTS):
                when = self.t + lasts * (k + 0.5) / PARTS
                self.kicks.append(_Kick(when, i, j, impulse / PARTS, k == PARTS - 1))
        else:
            self.give(i, j, impulse)
        self.kicks.sort()

    # ---- running --------------------------------------------------------------------------------

    def advance(self, until: float) -> None:
        """Fly to ``until``, through all that happens before."""
        while self.t < until:
            while self.kicks and self.kicks[0].t <= self.t:
                kick = self.kicks.pop(0)
                self.give(kick.i, kick.j, self.impulse(kick.i, kick.j)[0] if kick.share is None else kick.share)
                if kick.last:
                    self.busy.discard((kick.i, kick.j))
            end = min([until] + [kick.t for kick in self.kicks[:1]])
            pairs = self.near(self.x, self.v)
            step = min([LONGEST, end - self.t] + [max(0.5 * gap / speed, SHORTEST) for gap, speed, _, _ in pairs])
            x, v = self.flown(step)
            met = [(i, j) for _, _, i, j in pairs if self.gap(x, i, j) <= 0.0]
            if not met:
                self.x, self.v = x, v
                self.t = end if self.t + step >= end else self.t + step
                continue
            when, (i, j) = min((self.moment(i, j, step), (i, j)) for i, j in met)
            self.x, self.v = self.flown(when)
            self.t += when
            self.touch(i, j)

    def moment(self, i: int, j: int, step: float) -> float:
        """When within the step the gap closes [s]; 0 where it is closed already."""
        low, high = 0.0, step
        if self.gap(self.x, i, j) <= 0.0:
            return 0.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            if self.gap(self.flown(middle)[0], i, j) > 0.0:
                low = middle
            else:
                high = middle
        return high


def run(
    table: Table, physics: Physics, start: np.ndarray, times: Sequence[float] | np.ndarray,
    impacts: Impacts | None = None, rng: np.random.Generator | None = None,
) -> Flight:
    """Fly from ``start`` (n, 4: x, y, vx, vy) at ``times[0]``, without spin.

    rng : draws how late each impact is or how long it lasts.  Raises SimulationError where disks are jammed.
    """
    times = np.asarray(times, dtype=float)
    state = _Run(table, physics, impacts or Impacts(), rng)
    state.t = float(times[0])
    state.x, state.v = np.array(start[:, :2], dtype=float), np.array(start[:, 2:], dtype=float)
    state.v[table.fixed] = 0.0
    xy, v = np.empty((len(times), state.n, 2)), np.empty((len(times), state.n, 2))
    spin = np.empty((len(times), state.n))
    for k, t in enumerate(times):
        state.advance(float(t))
        xy[k], v[k], spin[k] = state.x, state.v, state.spin
    return Flight(xy, v, spin, tuple(state.touches))
