"""A small, slow, obvious integrator to judge the engine by. It shares no force code with it.

Scheme: positions drift with the half-step velocity, forces are taken at the new positions with that
same velocity in every damping, velocities kick (leapfrog; velocity Verlet up to the half step of the
velocity). Where the scene's scheme is exact, drags and friction see the mean of the velocities before and after a
first kick instead (Heun's method). A pinned body is integrated by its angle, a driven one stands where
the integral of its command puts it, and an instantaneous collision is resolved at its own moment inside a step::

    from granswim_pymunk.validation.reference import Reference
    reference = Reference(scene, dt=1e-5)
    xy = reference.sample(times)          # (T, n, 2) [m]

SI throughout: m, kg, s, rad, N. Rows of all arrays are the bodies of the scene in its order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from granswim_pymunk.errors import InputError, SimulationError
from granswim_pymunk.scene import Scene

from . import reference_mechanisms as mechanisms
from .reference_forces import BRAKES, CONSTRAINTS, Force, Forces

MOST_COLLISIONS = 20_000  # in one step; more is an inelastic collapse that instantaneous impacts cannot do


@dataclass(frozen=True)
class State:
    """Positions ``xy`` (n, 2) [m] (unwrapped) and velocities ``v`` (n, 2) [m/s] at time ``t`` [s].

    ``angle`` (n,) [rad] and ``spin`` (n,) [rad/s]: those of the rod for a pinned body (0 when it hangs
    along -y); others start at zero and are turned by friction at contacts only.
    """

    t: float
    xy: np.ndarray
    v: np.ndarray
    angle: np.ndarray
    spin: np.ndarray


@dataclass
class _Pin:
    """theta [rad] from -y, omega [rad/s]; (m L^2 + I) domega/dt = L F.t"""

    row: int
    anchor: np.ndarray
    length: float
    moment: float
    theta: float
    omega: float

    @property
    def along(self) -> np.ndarray:
        return np.array([math.sin(self.theta), -math.cos(self.theta)])

    @property
    def across(self) -> np.ndarray:
        return np.array([math.cos(self.theta), math.sin(self.theta)])


class _Drive:
    """Body ``row`` at ``start`` + gain * direction * integral of the input, linear between its rows."""

    def __init__(
        self, row: int, start: np.ndarray, t0: float, step: np.ndarray, t: np.ndarray, value: np.ndarray
    ):
        self.row, self.start, self.step = row, start, step
        self.t, self.value = t, value
        self.area = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(t))])
        self.offset = self._integral(t0)

    def _integral(self, t: float) -> float:
        """Integral of the input from its first row; held constant outside its rows."""
        if t <= self.t[0]:
            return float(self.value[0] * (t - self.t[0]))
        k = int(np.searchsorted(self.t, t, side="right")) - 1
        return float(self.area[k] + 0.5 * (self.value[k] + self.command(t)) * (t - self.t[k]))

    def command(self, t: float) -> float:
        return float(np.interp(t, self.t, self.value))

    def position(self, t: float) -> np.ndarray:
        return self.start + self.step * (self._integral(t) - self.offset)

    def velocity(self, t: float) -> np.ndarray:
        return self.step * self.command(t)


def _commands(scene: Scene) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The commands of driven bodies (t [s], value) as their actuators follow them, in the order of the laws.

    An actuator sees the commanded velocity, gain times input.
    """
    found = {name: (np.array(t), np.array(value)) for name, (t, value) in scene.inputs.items()}
    for item in scene.laws:
        if item.name not in mechanisms.ACTUATORS:
            continue
        for drive in scene.laws_named("drive"):
            gain = drive.values["gain"]
            for name in drive.bodies or ():
                if name in found and gain != 0 and (item.bodies is None or name in item.bodies):
                    t, value = found[name]
                    t, value = mechanisms.followed_command(item.name, dict(item.values), t, gain * value)
                    found[name] = t, value / gain
    return found


class Constraints:
    """Pins, rails and drives of a scene, and how each body can be moved at all."""

    def __init__(self, scene: Scene, xy: np.ndarray, v: np.ndarray, t0: float) -> None:
        n = len(scene.bodies)
        self.pins: list[_Pin] = []
        self.rails: list[tuple[int, np.ndarray]] = []
        self.drives: list[_Drive] = []
        held: dict[int, str] = {}
        driven = {int(row) for item in scene.laws_named("drive") for row in scene.rows(item)}
        commands = _commands(scene)
        for item in scene.laws:
            if item.name not in CONSTRAINTS:
                continue
            values = scene.resolved(item)
            for row in map(int, scene.rows(item)):
                if item.name == "rail" and row in driven:
                    continue  # the drive's direction is the rail's
                body = scene.bodies[row]
                if row in held:
                    raise InputError(f"has a {held[row]} already", where=f"law {item.name}, body {body.id}")
                held[row] = item.name
                if item.name == "pin":
                    anchor, length = np.array(values["anchor"]), values["length"]
                    if length <= 0:
                        raise InputError("should be above zero [m]", where="law pin, parameter length")
                    r = xy[row] - anchor
                    theta = math.atan2(r[0], -r[1])
                    moment = body.mass * length**2 + (body.inertia or 0.0)
                    pin = _Pin(row, anchor, length, moment, theta, 0.0)
                    pin.omega = float(v[row] @ pin.across) / length
                    self.pins.append(pin)
                elif item.name == "rail":
                    direction = np.array(values["direction"])
                    self.rails.append((row, direction / np.hypot(*direction)))
                else:
                    if body.id not in commands:
                        raise InputError("has no rows in the input", where=f"law drive, body {body.id}")
                    times, command = commands[body.id]
                    direction = np.array(values["direction"])
                    step = values["gain"] * direction / np.hypot(*direction)
                    self.drives.append(_Drive(row, xy[row].copy(), t0, step, times, command))
        self.fixed = np.array([not body.mobile for body in scene.bodies])
        self.inverse_mass = np.where(self.fixed, 0.0, [1 / body.mass for body in scene.bodies])
        self.inverse_moment = np.where(self.fixed, 0.0, [1 / body.moment for body in scene.bodies])
        self.drift_free = np.ones(n, dtype=bool)
        for pin in self.pins:
            self.drift_free[pin.row] = False
        for drive in self.drives:
            self.drift_free[drive.row] = False

    def mobility(self) -> np.ndarray:
        """(n, 2, 2) [1/kg]: dv = mobility @ impulse, with what a constraint forbids projected out."""
        matrix = self.inverse_mass[:, None, None] * np.eye(2)
        for row, direction in self.rails:
            matrix[row] = np.outer(direction, direction) * self.inverse_mass[row]
        for pin in self.pins:
            matrix[pin.row] = np.outer(pin.across, pin.across) * pin.length**2 / pin.moment
        for drive in self.drives:
            matrix[drive.row] = 0.0
        return matrix


class Reference:
    """Integrate a scene with listed bodies, each mobile one with an ``initial``.

    Parameters
    ----------
    scene : the scene; its ``time.start`` is the time at the start
    dt : time step [s]; the scene's where None
    start : ``synchronised``: the scene's velocities belong to the same time as its positions;
        ``leapfrog``: they are the half-step velocities that the next drift uses
    extra : extra(t, xy, v) -> (n, 2) [N], forces that no law of the scene describes

    Raises InputError (no dt, a body without a start, a law it does not have) and SimulationError
    (not finite, inelastic collapse).
    Source: Verlet 1967, Phys. Rev. 159, 98; doi:10.1103/PhysRev.159.98
    """

    def __init__(
        self, scene: Scene, dt: float | None = None, start: str = "synchronised", extra: Force | None = None
    ) -> None:
        chosen = scene.time.dt if dt is None else dt
        if chosen is None or not chosen > 0:
            raise InputError("the reference integrator needs a time step above zero [s]", where="time.dt")
        if start not in ("synchronised", "leapfrog"):
            raise InputError(f"should be synchronised or leapfrog, got {start!r}", where="start")
        for body in scene.bodies:
            if body.initial is None:
                raise InputError("needs initial = [x, y, vx, vy]", where=f"body {body.id}")
        if scene.links:
            raise InputError("hinges and rods are integrated by validation.linked", where=f"law {scene.links[0].name}")
        self.scene = scene
        self.dt = float(chosen)
        self.step = 0
        initial = np.array([body.initial for body in scene.bodies], dtype=float).reshape(-1, 4)
        self.xy = initial[:, :2].copy()
        self._v = initial[:, 2:].copy()
        self._v[[not body.mobile for body in scene.bodies]] = 0.0
        self.laws = Forces(scene, extra)
        self._restitutions = [
            (item, values) for item, values, _ in self.laws.uses if item.name == "contact_elastic"
        ]
        # friction that holds: mu g [m/s^2] and the rows it slows; the torque [N m] on each that hangs
        used = {name: [(v, rows) for item, v, rows in self.laws.uses if item.name == name] for name in BRAKES}
        self._grips = [(v["mu"] * scene.gravity_size, rows) for v, rows in used["dry_friction"] if v["mu"] > 0]
        self._torques: dict[int, float] = {}
        for values, rows in used["pin_stiction"]:
            for row in map(int, rows):
                self._torques[row] = self._torques.get(row, 0.0) + values["torque"]
        self._constraints = Constraints(scene, self.xy, self._v, self.t)
        for row, direction in self._constraints.rails:
            self._v[row] = direction * (self._v[row] @ direction)
        self._place()
        self._a = np.zeros_like(self._v)
        self._angle = np.zeros(len(self.xy))
        self._spin = np.zeros(len(self.xy))
        self._spin_now = np.zeros(len(self.xy))
        before = self._v.copy(), [pin.omega for pin in self._constraints.pins]
        if start == "synchronised":
            self._kick(0.5 * self.dt)
            self._v_now, spins = before
        else:
            # the kick that led to the half-step velocity is unknown: one is taken back for the look of it
            self._kick(-0.5 * self.dt)
            self._v_now, spins = self._v.copy(), [pin.omega for pin in self._constraints.pins]
            self._v = before[0]
            self._spin[:] = 0.0
            for pin, omega in zip(self._constraints.pins, before[1], strict=True):
                pin.omega = omega
            self._place()
            self._lead_drives()
        self._remember_spins(spins)

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.scene.time.start + self.step * self.dt

    @property
    def v_half(self) -> np.ndarray:
        """(n, 2) half-step velocities [m/s], those that the next drift uses."""
        return self._v.copy()

    def advance(self, n_steps: int) -> None:
        """Do ``n_steps`` steps."""
        pins = self._constraints.pins
        for _ in range(n_steps):
            self._drift(self.dt)
            self.step += 1
            self._place()
            before, spins = self._v.copy(), [pin.omega for pin in pins]
            spin = self._spin.copy()
            middle = None
            if self.scene.time.scheme == "exact" and self.laws.damped:
                self._kick(self.dt)
                middle = 0.5 * (before + self._v)
                self._v, self._spin = before.copy(), spin.copy()
                for pin, omega in zip(pins, spins, strict=True):
                    pin.omega = omega
            self._kick(self.dt, middle)
            self._v_now = 0.5 * (before + self._v)
            self._spin_now = 0.5 * (spin + self._spin)
            self._remember_spins([0.5 * (a + pin.omega) for a, pin in zip(spins, pins, strict=True)])
            if not np.isfinite(self._v).all():
                row = int(np.flatnonzero(~np.isfinite(self._v).all(axis=1))[0])
                raise SimulationError(f"body {self.scene.bodies[row].id} is not finite at t = {self.t:g} s")

    def state(self) -> State:
        """Positions and velocities at the present time, velocities synchronised."""
        v = self._v_now.copy()
        angle = self._angle.copy()
        for pin in self._constraints.pins:
            angle[pin.row] = pin.theta
            v[pin.row] = self._spin_now[pin.row] * pin.length * pin.across
        for drive in self._constraints.drives:
            v[drive.row] = drive.velocity(self.t)
        return State(self.t, self.xy.copy(), v, angle, self._spin_now.copy())

    def forces(self) -> np.ndarray:
        """(n, 2) [N]: sum of the forces at the present positions, without those of constraints."""
        self.laws.spin = self._spin
        return self.laws(self.t, self.xy, self._v)

    def sample(self, times: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """(T, n, 2) positions [m] at ``times`` (T,) [s], none before now; ``rows`` picks bodies.

        Between two steps a body drifts straight on, as it does in the scheme itself.
        """
        times = np.asarray(times, dtype=float)
        if times.size and not times.min() >= self.t - 1e-9 * self.dt:
            raise InputError(f"{times.min():g} s lies before the present time {self.t:g} s", where="times")
        out = np.empty((len(times), len(self.xy), 2))
        for k in np.argsort(times, kind="stable"):
            steps = math.floor((times[k] - self.scene.time.start) / self.dt + 1e-9) - self.step
            self.advance(steps)
            rest = times[k] - self.t
            if abs(rest) < 1e-9 * self.dt:
                out[k] = self.xy
                continue
            angle = self._angle.copy()
            kept = self.xy.copy(), self._v.copy(), [(pin.theta, pin.omega) for pin in self._constraints.pins]
            self._drift(rest)
            self._place(self.t + rest)
            out[k] = self.xy
            self.xy, self._v, self._angle = kept[0], kept[1], angle
            for pin, (theta, omega) in zip(self._constraints.pins, kept[2], strict=True):
                pin.theta, pin.omega = theta, omega
        return out if rows is None else out[:, rows]

    # ---- one step ------------------------------------------------------------------------------

    def _remember_spins(self, spins: list[float]) -> None:
        for pin, spin in zip(self._constraints.pins, spins, strict=True):
            self._spin_now[pin.row] = spin

    def _place(self, t: float | None = None) -> None:
        """Positions and half-step velocities of pinned and driven bodies from their own coordinates."""
        t = self.t if t is None else t
        for pin in self._constraints.pins:
            self.xy[pin.row] = pin.anchor + pin.length * pin.along
            self._v[pin.row] = pin.omega * pin.length * pin.across
        for drive in self._constraints.drives:
            self.xy[drive.row] = drive.position(t)

    def _kick(self, dt: float, middle: np.ndarray | None = None) -> None:
        """Velocities after ``dt`` [s]; ``middle`` (n, 2) [m/s] are those that drags and friction see."""
        self.laws.spin = self._spin
        force = self.laws(self.t, self.xy, self._v, middle) / self.laws.inertia[:, None]
        self._spin = self._spin + dt * self.laws.torque * self._constraints.inverse_moment
        moved = self._constraints
        before = self._v.copy()
        for pin in moved.pins:
            pull = pin.length * float(force[pin.row] @ pin.across) / pin.moment
            pin.omega = self._held_back(dt, pin, pull, float(self.laws.inertia[pin.row]))
        for row, direction in moved.rails:
            force[row] = direction * (force[row] @ direction)
        self._brake(dt, force)
        free = moved.drift_free
        self._v[free] += dt * force[free] * moved.inverse_mass[free, None]
        for pin in moved.pins:
            self._v[pin.row] = pin.omega * pin.length * pin.across
        self._lead_drives()
        self._a = (self._v - before) / dt

    def _brake(self, dt: float, force: np.ndarray) -> None:
        """Add to ``force`` (n, 2) [N] the dry friction that holds: what comes to rest within ``dt`` [s] stays there.

        Without it a body that moves at v with the acceleration a stops after v/(mu g - a.v/v).
        """
        for grip, rows in self._grips:
            for row in rows:
                v, a = self._v[row], force[row] * self._constraints.inverse_mass[row]
                speed, pull = float(np.hypot(*v)), float(np.hypot(*a))
                ahead = v / speed if speed else np.zeros(2)
                stops = speed / max(grip - float(a @ ahead), 1e-300)
                if speed and stops > dt:
                    middle = v + 0.5 * dt * (a - grip * ahead)
                    after = v + dt * (a - grip * middle / np.hypot(*middle))
                else:
                    after = (dt - stops) * max(1.0 - grip / pull, 0.0) * a if pull else np.zeros(2)
                force[row] = (after - v) / dt / self._constraints.inverse_mass[row]

    def _held_back(self, dt: float, pin: _Pin, pull: float, inertia: float) -> float:
        """The angular velocity after ``dt`` [s] at the angular acceleration ``pull``, with the friction that holds.

        The friction is that of the body without what it carries along, and moves it all: ``inertia`` times its own.
        """
        grip, free = self._torques.get(pin.row, 0.0) / pin.moment, dt
        if grip == 0:
            return pin.omega + dt * pull
        pull *= inertia
        after = 0.0
        if pin.omega:
            after = pin.omega + dt * (pull - math.copysign(grip, pin.omega))
            free -= abs(pin.omega) / max(grip - math.copysign(pull, pull * pin.omega), 1e-300)
        if after * pin.omega <= 0:
            after = free * math.copysign(max(abs(pull) - grip, 0.0), pull)
        return pin.omega + (after - pin.omega) / inertia

    def _lead_drives(self) -> None:
        """Driven bodies get the mean velocity of the coming step: a drift lands where the command leads."""
        for drive in self._constraints.drives:
            self._v[drive.row] = (drive.position(self.t + self.dt) - drive.position(self.t)) / self.dt

    def _drift(self, duration: float) -> None:
        """Straight motion for ``duration`` [s], with the instantaneous collisions on the way."""
        if not self._restitutions:
            self._move(duration)
            return
        left = duration
        for _ in range(MOST_COLLISIONS):
            fastest = math.sqrt(float((self._v**2).sum(axis=1).max()))
            self.laws.pairs.update(self.xy, 2 * fastest * left)
            wait, collision = self._next_collision(left, 1e-12 * fastest)
            self._move(wait)
            left -= wait
            if collision is None:
                return
            self._collide(*collision, duration - left - 0.5 * self.dt)
        raise SimulationError(f"an endless sequence of collisions at t = {self.t:g} s (inelastic collapse)")

    def _move(self, duration: float) -> None:
        self.xy += duration * self._v
        self._angle += duration * self._spin
        for pin in self._constraints.pins:
            pin.theta += duration * pin.omega
            self.xy[pin.row] = pin.anchor + pin.length * pin.along
            self._v[pin.row] = pin.omega * pin.length * pin.across

    def _next_collision(self, left: float, slow: float) -> tuple[float, tuple[int, int, float] | None]:
        """Time to the next contact of an approaching pair within ``left`` [s], and i, j, restitution.

        Of pairs that touch already the fastest comes first; approach below ``slow`` [m/s] is rest.
        """
        best: tuple[float, float, tuple[int, int, float] | None] = (left, 0.0, None)
        for item, values in self._restitutions:
            i, j, n, gap = self.laws.touching(item, self.xy, margin=math.inf)
            if not len(i):
                continue
            u = self._v[j] - self._v[i]
            touch = self.laws.radius[i] + self.laws.radius[j]
            distance = gap + touch
            closing = -(u * n).sum(axis=1)  # speed of approach
            # |r + u t| = R: t = c/(b + sqrt(b^2 - u^2 c)), b = -r.u, c = r^2 - R^2
            b, c, uu = closing * distance, gap * (distance + touch), (u**2).sum(axis=1)
            root = b * b - uu * c
            meets = (closing > slow) & (root >= 0)
            wait = np.full(len(i), math.inf)
            wait[meets] = np.maximum(c[meets], 0.0) / (b[meets] + np.sqrt(root[meets]))
            first = int(np.lexsort((-closing, wait))[0])
            candidate = (
                float(wait[first]),
                -float(closing[first]),
                (int(i[first]), int(j[first]), values["restitution"]),
            )
            if candidate[0] < left and candidate[:2] < best[:2]:
                best = candidate
        for wait, closing, collision in self._wall_collisions(left, slow):
            if (wait, -closing) < best[:2]:
                best = wait, -closing, collision
        return best[0], best[2]

    def _wall_collisions(self, left: float, slow: float) -> list[tuple[float, float, tuple[int, int, float]]]:
        """Contacts with straight walls within ``left`` [s]: when, closing speed [m/s], and what ``_collide`` takes."""
        walls, found = self.laws.walls, []
        for item, values in self._restitutions:
            for i in self.laws.scene.rows(item):
                if not len(walls.radius) or self._constraints.fixed[i]:
                    continue
                xy, v = self.xy[i], self._v[i]
                for k, wait in enumerate(walls.wait(xy, v, float(self.laws.radius[i]), left)):
                    if wait < left:
                        way = walls.ways((xy + wait * v)[None])[0, k]
                        closing = float(v @ way) / math.hypot(*way)
                        if closing > slow:
                            found.append((wait, closing, (int(i), -1 - k, values["wall_restitution"])))
        return found

    def _friction_between(self, i: int, j: int) -> float:
        """mu of an instantaneous collision, 0 where nothing rubs."""
        for item, values, rows in self.laws.uses:
            if item.name == "contact_friction" and i in rows and j in rows:
                return float(values["mu"])
        return 0.0

    def _collide(self, i: int, j: int, restitution: float, late: float) -> None:
        """v_n' = -e v_n by an impulse along n, each body giving way as far as its constraint lets it.

        ``j`` below zero is the straight wall -1 - j. ``late`` [s]: how long after the half step it happens; the
        velocity of that moment is reflected.
        """
        straight = j < 0  # a wall, which stands still and does not turn
        if straight:
            r = self.laws.walls.ways(self.xy[i][None])[0, -1 - j]
        else:
            r = self.laws.pairs.vector(self.xy, np.array([i]), np.array([j]))[0]
        n = r / np.hypot(*r)
        mobility = self._constraints.mobility() / self.laws.inertia[:, None, None]
        ease_j = np.zeros((2, 2)) if straight else mobility[j]
        v_j, a_j = (np.zeros(2), np.zeros(2)) if straight else (self._v[j], self._a[j])
        give = float(n @ (mobility[i] + ease_j) @ n)
        if give <= 0:
            return
        half = float((v_j - self._v[i]) @ n)
        speed = half + late * float((a_j - self._a[i]) @ n)
        if half - (1 + restitution) * min(speed, 0.0) <= 0:
            speed = half  # slower than one step's gravity: a body at rest on another
        impulse = -(1 + restitution) * min(speed, 0.0) / give * n
        rub = self._friction_between(i, i if straight else j)
        if rub > 0:
            # across the normal: what stops the slip of the surfaces, but no more than mu times the impulse along it
            t = np.array([-n[1], n[0]])
            r_i, r_j = self.laws.radius[i], 0.0 if straight else self.laws.radius[j]
            turn = self._constraints.inverse_moment
            spin_j, turn_j = (0.0, 0.0) if straight else (self._spin[j], turn[j])
            slip = float((v_j - self._v[i]) @ t) - r_j * spin_j - r_i * self._spin[i]
            ease = float(t @ (mobility[i] + ease_j) @ t) + r_i**2 * turn[i] + r_j**2 * turn_j
            most = rub * float(np.hypot(*impulse))
            across = float(np.clip(-slip / ease, -most, most))
            self._spin[i] -= r_i * across * turn[i]
            if not straight:
                self._spin[j] -= r_j * across * turn[j]
            impulse = impulse + across * t
        if not straight:
            self._v[j] += mobility[j] @ impulse
        self._v[i] -= mobility[i] @ impulse
        for pin in self._constraints.pins:
            if pin.row in (i, j):
                pin.omega = float(self._v[pin.row] @ pin.across) / pin.length


def exact(
    scene: Scene,
    times: np.ndarray,
    *,
    rtol: float = 1e-10,
    max_step: float | None = None,
    extra: Force | None = None,
) -> np.ndarray:
    """(T, n, 2) positions [m] at ``times`` (T,) [s] by an adaptive Runge-Kutta method of order 8.

    For few bodies. The start is the scene's, at its ``time.start``; velocities belong to the same time.
    Pins and rails enter by their acceleration, drives by their integral. ``max_step`` [s] keeps it from
    stepping over a short contact (default: a 1000th of the whole).
    Raises InputError for ``contact_elastic``, which has no force, and for friction that holds, whose force jumps; and
    SimulationError where it fails.
    Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I (DOP853).
    """
    if scene.laws_named("contact_elastic"):
        raise InputError("is instantaneous; use Reference", where="law contact_elastic")
    if scene.laws_named("contact_friction"):
        raise InputError("turns bodies; use Reference", where="law contact_friction")
    for item in scene.laws_as("brake"):
        raise InputError("jumps where a body comes to rest; use Reference", where=f"law {item.name}")
    at_start = Reference(scene, dt=1.0, extra=extra)
    state, laws, held = at_start.state(), at_start.laws, at_start._constraints
    n, t0 = len(state.xy), scene.time.start
    times = np.asarray(times, dtype=float)
    end = float(times.max(initial=t0))
    if times.size and times.min() < t0:
        raise InputError(f"{times.min():g} s lies before the start {t0:g} s", where="times")

    def follow_drives(t: float, xy: np.ndarray, v: np.ndarray) -> None:
        for drive in held.drives:
            xy[drive.row], v[drive.row] = drive.position(t), drive.velocity(t)

    def change(t: float, y: np.ndarray) -> np.ndarray:
        xy, v = y[: 2 * n].reshape(n, 2).copy(), y[2 * n :].reshape(n, 2).copy()
        follow_drives(t, xy, v)
        force = laws(t, xy, v) / laws.inertia[:, None]
        a = force * held.inverse_mass[:, None]
        for row, direction in held.rails:
            a[row] = direction * (a[row] @ direction)
        for pin in held.pins:
            r = (xy[pin.row] - pin.anchor) / pin.length
            across = np.array([-r[1], r[0]])
            turn = pin.length**2 * float(force[pin.row] @ across) / pin.moment
            a[pin.row] = turn * across - float(v[pin.row] @ v[pin.row]) / pin.length * r
        for drive in held.drives:
            a[drive.row] = 0.0
        return np.concatenate([v.ravel(), a.ravel()])

    out = np.repeat(state.xy[None], len(times), axis=0)
    later = times > t0
    if later.any():
        unique, index = np.unique(times[later], return_inverse=True)
        solution = solve_ivp(
            change,
            (t0, end),
            np.concatenate([state.xy.ravel(), state.v.ravel()]),
            method="DOP853",
            t_eval=unique,
            rtol=rtol,
            atol=rtol * float(laws.radius.min()),
            max_step=(end - t0) / 1000 if max_step is None else max_step,
        )
        if not solution.success:
            raise SimulationError(f"the adaptive integration failed: {solution.message}")
        out[later] = solution.y[: 2 * n].T.reshape(-1, n, 2)[index]
    for k, t in enumerate(times):
        for drive in held.drives:
            out[k, drive.row] = drive.position(float(t))
    return out
