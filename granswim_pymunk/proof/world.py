"""The proof's own simulator: a scene with concealed effects, computed without any code of the engine.

A ``Scene`` serves as a plain list of bodies and numbers; what its laws mean is written in ``kernels``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.signal import lfilter

from ..errors import InputError, SimulationError
from ..scene import Scene
from . import kernels as k

G = 9.81  # m/s^2, where a law needs it and the scene has none


@dataclass(frozen=True)
class Effect:
    """One concealed effect: a mechanism of the contract or one outside it.

    values : its numbers in SI, named as in the contract;  bodies : whom it acts on, None all mobile ones
    other : the numbers of another functional form than the contract's, empty for the contract's own
    """

    name: str
    values: Mapping[str, Any]
    bodies: tuple[str, ...] | None = None
    other: Mapping[str, Any] = field(default_factory=dict)

    def scaled(self, factor: float, strength: str) -> Effect:
        """The same with its strength multiplied (a vector as a whole)."""
        value = self.values[strength]
        new = tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value
        return replace(self, values={**self.values, strength: new})


@dataclass(frozen=True)
class Camera:
    """seen = scale R(+tilt) true + bias, at t + time_offset."""

    scale: float = 1.0
    tilt: float = 0.0
    time_offset: float = 0.0
    bias: tuple[float, float] = (0.0, 0.0)

    def see(self, xy: np.ndarray) -> np.ndarray:
        """(..., 2) as it is seen [m]."""
        turn = self.scale * np.exp(1j * self.tilt)
        z = turn * (xy[..., 0] + 1j * xy[..., 1])
        return np.stack([z.real + self.bias[0], z.imag + self.bias[1]], axis=-1)


@dataclass(frozen=True)
class Run:
    """xy : (T, n, 2) [m] unwrapped;  v : (T, n, 2) [m/s];  angle : (T, n) [rad], a pinned body's that of its rod,
    0 hanging.
    """

    xy: np.ndarray
    v: np.ndarray
    angle: np.ndarray


def followed(t: np.ndarray, command: np.ndarray, effects: Sequence[Effect]) -> np.ndarray:
    """What an actuator makes of a command on an even grid t (n,) [s]; at rest on the command at the first row."""
    result = np.asarray(command, dtype=float)
    dt = float(t[1] - t[0]) if len(t) > 1 else 1.0
    for effect in effects:
        if effect.name == "actuator_delay":
            result = np.interp(t - effect.values["tau"], t, result)
        elif effect.name == "actuator_saturation":
            limit = effect.values["limit"]
            if effect.other.get("smooth"):
                power = float(effect.other["smooth"])
                result = result / (1.0 + np.abs(result / limit) ** power) ** (1.0 / power)
            else:
                result = np.clip(result, -limit, limit)
        elif effect.name == "actuator_lag":
            stages = int(effect.other.get("order", 1))
            tau = effect.values["tau"] / stages
            if tau <= 0:
                continue
            for _ in range(stages):
                # tau y' = u - y, exact for a command that is linear between rows
                decay = math.exp(-dt / tau)
                first = tau / dt * (1 - decay)
                b = [1 - first, first - decay]
                result = lfilter(b, [1.0, -decay], result, zi=[(b[1] + decay) * result[0]])[0]
                # the first row holds the command itself: lfilter's state above says so
    return result


class World:
    """A scene with effects, ready to be run from any start.

    dt : time step [s].  Raises InputError for a law that this simulator does not have.
    """

    def __init__(self, scene: Scene, effects: Sequence[Effect] = (), dt: float = 1e-4) -> None:
        self.scene, self.effects, self.dt = scene, tuple(effects), float(dt)
        bodies = scene.bodies
        self.row = {b.id: i for i, b in enumerate(bodies)}
        n = len(bodies)
        self.radius = np.array([b.radius for b in bodies])
        self.mobile = np.array([b.role != "wall" for b in bodies])
        self.mass = np.array([b.mass if b.role != "wall" else 1.0 for b in bodies])
        self.kind = np.where(self.mobile, k.FREE, k.WALL).astype(np.int64)
        self.moment = np.array([0.4 * b.mass * b.radius**2 if b.inertia is None else b.inertia for b in bodies])
        self.moment[~self.mobile] = 1.0
        self.geometry = np.zeros((n, 4))
        self.inertia = np.ones(n)
        self.base = np.zeros(k.BASE)
        self.base[k.GX], self.base[k.GY] = scene.gravity
        self.base[k.PERIOD] = scene.periodic_x or 0.0
        size = math.hypot(*scene.gravity)
        self.g = size if size > 0 else G
        self.down = math.atan2(scene.gravity[1], scene.gravity[0]) if size > 0 else -math.pi / 2
        self.fields: list[tuple[int, list[float], np.ndarray]] = []
        self.pairs: list[tuple[int, list[float]]] = []
        chain = [i for i, b in enumerate(bodies) if b.role in ("head", "tail")]
        self.chain = np.array(chain, dtype=np.int64)
        self.in_chain = np.zeros(n, dtype=np.bool_)
        self.in_chain[chain] = True
        joints = max(len(chain) - 1, 0)
        self.stiffer, self.rest = np.ones(joints), np.zeros(joints)
        self.drive: dict[int, tuple[np.ndarray, float]] = {}  # row -> (unit direction, gain)
        self.bend = (0.0, 0.0, 0.0)  # amplitude, frequency, phase
        for item in scene.laws:
            self._believed(item.name, item.values, item.bodies)
        for effect in self.effects:
            self._concealed(effect)
        self.reach = max([0.0] + [self._reach(code, par) for code, par in self.pairs])
        self.base[k.REACH] = self.reach
        self.base[k.SKIN] = 0.3 * float(np.mean(self.radius[self.mobile])) if n > 48 else 0.0

    # ---- the scene's own laws -------------------------------------------------------------------

    def _rows(self, bodies: Sequence[str] | None) -> np.ndarray:
        return np.flatnonzero(self.mobile) if bodies is None else np.array([self.row[b] for b in bodies])

    def _weights(self, rows: np.ndarray, amount: Any) -> np.ndarray:
        weights = np.zeros(len(self.radius))
        weights[rows] = amount
        return weights

    def _believed(self, name: str, values: Mapping[str, Any], bodies: Sequence[str] | None) -> None:
        base, rows = self.base, self._rows(bodies)
        if name == "gravity":
            return  # the vector of the scene says it
        if name in ("contact_linear", "contact_hertz"):
            base[k.CONTACT] = k.LINEAR if name == "contact_linear" else k.HERTZ
            base[k.K_C], base[k.GAMMA_C] = values["stiffness"], values["damping"]
        elif name == "contact_elastic":
            base[k.CONTACT], base[k.RESTITUTION] = k.ELASTIC, values["restitution"]
        elif name == "union":
            length = values["length"]
            base[k.K_U], base[k.GAMMA_U] = values["stiffness"], values["damping"]
            base[k.L_U] = length if isinstance(length, float) else 2 * self.radius[self.chain[0]]
        elif name == "bending":
            base[k.K_B], base[k.GAMMA_B] = values["stiffness"], values["damping"]
            base[k.FORM] = ("leader", "elastic", "head_axis").index(values["form"])
            self.bend = (values["amplitude"], values["frequency"], values["phase"])
        elif name == "confinement":
            mean = values["mean_mass"]
            if not isinstance(mean, float):
                mean = float(np.mean([b.mass for b in self.scene.bodies if b.role == "grain"]))
            rate = values["mu_eff"] * mean * G * values["layers"]
            self.fields.append((k.DRAG, [1.0, 0.0, 0.0], self._weights(rows, rate)))
        elif name == "pin":
            for i in rows:
                length = values["length"]
                own = self.scene.bodies[i].inertia or 0.0
                self.kind[i] = k.PIN
                self.geometry[i] = [*values["anchor"], length, self.mass[i] * length**2 + own]
        elif name == "rail":
            direction = np.array(values["direction"]) / math.hypot(*values["direction"])
            for i in rows:
                if self.kind[i] != k.DRIVEN:
                    self.kind[i] = k.RAIL
                self.geometry[i, :2] = direction
                if i in self.drive:
                    self.drive[i] = (direction, self.drive[i][1])
        elif name == "drive":
            for i in rows:
                given = np.array(values["direction"])
                own = self.geometry[i, :2] if self.kind[i] == k.RAIL else given / math.hypot(*given)
                self.kind[i] = k.DRIVEN
                self.drive[int(i)] = (own.copy(), values["gain"])
        elif name == "spring":
            self.fields.append(
                (k.SPRING, [*values["anchor"], values["length"], 1.0], self._weights(rows, values["stiffness"]))
            )
        else:
            self._concealed(Effect(name, values, None if bodies is None else tuple(bodies)))

    # ---- concealed effects ----------------------------------------------------------------------

    def _concealed(self, effect: Effect) -> None:
        name, values, other, rows = effect.name, effect.values, effect.other, self._rows(effect.bodies)
        base = self.base
        relative = self.radius[rows] / float(np.mean(self.radius[rows]))
        smoothing = float(other.get("form", 0.0))
        if name in ("linear_drag", "quadratic_drag", "cubic_drag"):
            power = {"linear_drag": 1.0, "quadratic_drag": 2.0, "cubic_drag": 3.0}[name]
            # another exponent is normalised at a speed, so that the coefficient keeps its meaning there
            q = power + other.get("power", 0.0)
            c = values["c"] * relative ** float(values.get("p", 0.0)) * other.get("speed", 1.0) ** (power - q)
            self.fields.append((k.DRAG, [q, 0.0, 0.0], self._weights(rows, c)))
        elif name == "ambient_flow":
            q = 1.0 + other.get("power", 0.0)
            c = values["c"] * other.get("speed", 1.0) ** (1.0 - q)
            self.fields.append((k.DRAG, [q, *values["u"]], self._weights(rows, c)))
        elif name == "added_mass":
            self.inertia[rows] *= 1.0 + values["beta"] * relative ** other.get("power", 0.0)
        elif name == "coulomb_substrate":
            small = other.get("v_0", values.get("v_0", 1e-3))
            weights = self._weights(rows, values["mu"] * self.mass[rows] * self.g)
            self.fields.append((k.FRICTION, [small, smoothing], weights))
        elif name == "uniform_force":
            self.fields.append((k.UNIFORM, list(values["a"]), self._weights(rows, self.mass[rows])))
        elif name == "contact_friction" and base[k.CONTACT] == k.ELASTIC:
            base[k.MU_E] = values["mu"]
        elif name == "contact_friction":
            self.pairs.append((k.CONTACT_FRICTION, [values["mu"], other.get("v_0", 1e-3), smoothing]))
        elif name == "rolling_resistance":
            self.pairs.append((k.ROLLING, [values["mu_r"], 1e-2]))
        elif name == "restitution":
            if "restitution" in values:
                base[k.RESTITUTION] = values["restitution"]
                base[k.LOSS_POWER], base[k.LOSS_SCALE] = other.get("power", 0.0), other.get("speed", 1.0)
            else:
                base[k.GAMMA_C] = values["damping"]
                base[k.DAMPING_POWER], base[k.DAMPING_SCALE] = other.get("power", 0.0), other.get("overlap", 1.0)
        elif name == "cohesion":
            self.pairs.append((k.COHESION, [values["force"], values["range"], smoothing]))
        elif name == "distance_force":
            r0 = float(np.mean(self.radius[self.mobile]))
            reach = float(values.get("range") or 1e9)
            self.pairs.append((k.DISTANCE, [values["s"], values["n"], r0, reach, other.get("screening", 0.0)]))
        elif name == "pair_lubrication":
            cutoff = float(values.get("cutoff") or 5 * values["range"])
            self.pairs.append((k.LUBRICATION, [values["c"], values["range"], cutoff, smoothing]))
        elif name == "weak_joint":
            self.stiffer[int(values["joint"])] *= values["factor"]
        elif name == "resting_curvature":
            joint = values.get("joint", "all")
            self.rest[slice(None) if joint == "all" else int(joint)] += values["phi_0"]
        elif name == "nonlinear_bending":
            base[k.K_3], base[k.POWER_3] = values["k_3"], 3.0 + other.get("power", 0.0)
        elif name == "joint_friction" and "torque" in values:
            self.fields.append(
                (k.PIN_FRICTION, [other.get("w_0", 1e-2), smoothing], self._weights(rows, values["torque"]))
            )
        elif name == "joint_friction":
            base[k.JOINT_F], base[k.JOINT_W0], base[k.JOINT_FORM] = values["force"], other.get("w_0", 1.0), smoothing
        elif name == "head_force":
            base[k.HEAD_F], base[k.HEAD_ANGLE] = values["force"], values.get("angle", 0.0)
            base[k.HEAD_AXIS] = float(values.get("axis") == "head")
        elif name == "wall_drag":
            bottom, top = self.walls()
            par = [values["range"], bottom, top, other.get("width", 0.0)]
            self.fields.append((k.WALL_DRAG, par, self._weights(rows, values["c"])))
        elif name == "nonlinear_spring":
            for item in self.scene.laws_named("spring"):
                par = [*item.values["anchor"], item.values["length"], 3.0 + other.get("power", 0.0)]
                scale = other.get("stretch", 1.0) ** -other.get("power", 0.0)
                self.fields.append((k.SPRING, par, self._weights(self._rows(item.bodies), scale * values["k_3"])))
        elif not self._unknown(effect, rows) and not name.startswith("actuator_"):
            raise InputError("is not a law of the proof's simulator", where=f"law {name}")

    def _unknown(self, effect: Effect, rows: np.ndarray) -> bool:
        """A force that no law of the package gives, False where the effect is none."""
        name, values = effect.name, effect.values
        if name == "attraction":
            par = [*values["centre"], values["size"]]
            self.fields.append((k.ATTRACTION, par, self._weights(rows, values["strength"])))
        elif name == "transverse_force":
            self.fields.append((k.TRANSVERSE, [], self._weights(rows, values["strength"])))
        elif name == "phase_drag":
            par = [2 * math.pi * values["frequency"], values["phase"]]
            self.fields.append((k.PHASE_DRAG, par, self._weights(rows, values["c"])))
        elif name == "shaking":
            par = [*values["a"], 2 * math.pi * values["frequency"], values["phase"]]
            self.fields.append((k.SHAKING, par, self._weights(rows, self.mass[rows])))
        else:
            return False
        return True

    def _reach(self, code: int, par: Sequence[float]) -> float:
        far = {k.DISTANCE: 3, k.COHESION: 1, k.LUBRICATION: 2}.get(code)
        # without a limit: few bodies, all pairs; many, six radii
        limit = 1e9 if len(self.radius) <= 48 else 6 * float(np.mean(self.radius[self.mobile]))
        return 0.0 if far is None else min(par[far], limit)

    def walls(self) -> tuple[float, float]:
        """y of the walls below and above [m]: the inner edges of the wall bodies' rows."""
        y = np.array([b.initial[1] for b in self.scene.bodies if b.role == "wall" and b.initial])
        r = np.array([b.radius for b in self.scene.bodies if b.role == "wall"])
        if not len(y):
            raise InputError("needs walls", where="law wall_drag")
        low = y < (y.min() + y.max()) / 2
        return float((y + r)[low].max()), float((y - r)[~low].min())

    # ---- running --------------------------------------------------------------------------------

    def start(self) -> np.ndarray:
        """(n, 4) x, y, vx, vy of the scene's ``initial``."""
        return np.array([b.initial if b.initial else (0.0,) * 4 for b in self.scene.bodies], dtype=float)

    def sample(self, times: np.ndarray, start: np.ndarray | None = None, t0: float | None = None) -> Run:
        """Positions and angles at ``times`` (T,) [s], rising, from ``start`` (n, 4) at ``t0`` (the scene's).

        Raises SimulationError where the run does not stay finite.
        """
        times = np.asarray(times, dtype=float)
        t0 = self.scene.time.start if t0 is None else t0
        start = self.start() if start is None else start
        xy = np.ascontiguousarray(start[:, :2], dtype=float).copy()
        v = np.ascontiguousarray(start[:, 2:], dtype=float).copy()
        v[~self.mobile] = 0.0
        rail = self.kind == k.RAIL
        v[rail] = self.geometry[rail, :2] * (v[rail] * self.geometry[rail, :2]).sum(axis=1)[:, None]
        step = np.floor((times - t0) / self.dt + 1e-6).astype(np.int64)
        rest = times - t0 - step * self.dt
        rest[np.abs(rest) < 1e-6 * self.dt] = 0.0
        steps = int(step[-1]) + 1 if len(step) else 0
        if len(step) and step[0] < 0:
            raise InputError("a frame lies before the start", where="times")
        grid = t0 + self.dt * np.arange(steps + 1)
        head, rate = self._head(t0, grid)
        driven = np.array(sorted(self.drive), dtype=np.int64)
        path, pace = np.zeros((steps + 1, len(driven), 2)), np.zeros((steps + 1, len(driven), 2))
        for c, row in enumerate(driven):
            pace_of = self._speed(int(row), grid)
            moved = np.concatenate([[0.0], np.cumsum(0.5 * (pace_of[1:] + pace_of[:-1]) * self.dt)])
            direction = self.drive[int(row)][0]
            path[:, c] = xy[row] + moved[:, None] * direction
            pace[:, c] = pace_of[:, None] * direction
        code = np.array([f[0] for f in self.fields], dtype=np.int64)
        par = np.zeros((len(self.fields), 4))
        for r, f in enumerate(self.fields):
            par[r, : len(f[1])] = f[1]
        weight = np.array([f[2] for f in self.fields]).reshape(len(self.fields), len(self.radius))
        pair_code = np.array([p[0] for p in self.pairs], dtype=np.int64)
        pair_par = np.zeros((len(self.pairs), 5))
        for r, p in enumerate(self.pairs):
            pair_par[r, : len(p[1])] = p[1]
        seen, speed, angle, good = k.run(
            t0, self.dt, steps, xy, v, np.zeros(len(xy)), self.kind, self.geometry, self.mass, self.inertia,
            self.moment, self.radius, self.base, code, par, weight, pair_code, pair_par, self.chain, self.in_chain,
            self.stiffer, self.rest, head, rate, driven, path, pace, step, rest,
        )  # fmt: skip
        if not good or not np.isfinite(seen).all():
            raise SimulationError("the proof's simulator did not stay finite")
        pinned = np.flatnonzero(self.kind == k.PIN)
        for i in pinned:
            rod = np.unwrap(angle[:, i] - self.down)
            angle[:, i] = rod - 2 * np.pi * np.round(rod[0] / (2 * np.pi)) if len(rod) else rod
        return Run(seen, speed, angle)

    def _actuator(self) -> list[Effect]:
        return [e for e in self.effects if e.name.startswith("actuator_")]

    def _head(self, t0: float, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angle of the head's axis and its rate on the grid; an actuator lags from rest at t = 0."""
        amplitude, frequency, phase = self.bend
        if not len(self.chain):
            return np.zeros(len(grid)), np.zeros(len(grid))
        omega = 2 * math.pi * frequency
        rate = amplitude * omega * np.cos(omega * grid + phase)
        actuator = self._actuator()
        if not actuator:
            return amplitude * np.sin(omega * grid + phase), rate
        if actuator[0].name == "actuator_delay":  # before t = 0 the sine goes on
            return amplitude * np.sin(omega * (grid - actuator[0].values["tau"]) + phase), rate
        before = max(round(max(t0, 0.0) / self.dt), 0)
        long = grid[0] + self.dt * np.arange(-before, len(grid))
        return followed(long, amplitude * np.sin(omega * long + phase), actuator)[before:], rate

    def _speed(self, row: int, grid: np.ndarray) -> np.ndarray:
        """Velocity of a driven body along its direction on the grid [m/s]."""
        t, value = (np.asarray(a, dtype=float) for a in self.scene.inputs[self.scene.bodies[row].id])
        gain = self.drive[row][1]
        actuator = self._actuator()
        if not actuator:
            return gain * np.interp(grid, t, value)
        before = max(math.ceil((grid[0] - t[0]) / self.dt), 0)
        long = grid[0] + self.dt * np.arange(-before, len(grid))
        return followed(long, gain * np.interp(long, t, value), actuator)[before:]
