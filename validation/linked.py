"""Bodies in hinges and rods, independently of the engine: constrained accelerations, adaptively integrated.

With q = (x, y, angle) of all bodies, M their masses and moments, g(q) = 0 the links and J = dg/dq, the motion is
M q'' = f + J^T lambda with J q'' = -(dJ/dt) q': linear equations for q'' and lambda at each moment (Lagrange's of the
first kind). No step of the engine, no multiplier of SHAKE, no law code of the package. SI throughout.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from granswim_pymunk.errors import InputError, SimulationError
from granswim_pymunk.scene import Scene

from .reference_forces import Forces


class _Links:
    """Rows of J and of -(dJ/dt) q' for the hinges, rods, pins and rails of a scene."""

    def __init__(self, scene: Scene) -> None:
        rows = {body.id: k for k, body in enumerate(scene.bodies)}
        self.n = len(rows)
        self.hinges: list[tuple[int, complex, int | None, complex]] = []
        self.rods: list[tuple[int, int | None, complex]] = []
        self.rails: list[tuple[int, complex]] = []
        for item in scene.laws:
            values = item.values
            if item.name == "hinge":
                a = rows[item.bodies[0]]
                if len(item.bodies) == 1:
                    self.hinges.append((a, complex(*values["anchor_a"]), None, complex(*values["anchor"])))
                else:
                    b = rows[item.bodies[1]]
                    self.hinges.append((a, complex(*values["anchor_a"]), b, complex(*values["anchor_b"])))
            elif item.name == "rod":
                self.rods.append((rows[item.bodies[0]], rows[item.bodies[1]], 0j))
            elif item.name == "pin":
                self.rods += [(rows[name], None, complex(*values["anchor"])) for name in item.bodies]
            elif item.name == "rail":
                along = complex(*values["direction"])
                self.rails += [(int(row), along / abs(along)) for row in scene.rows(item)]

    def rows(self, q: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """J (m, 3 n) and the right-hand sides (m,) [m/s^2] at q, u = q' (n, 3)."""
        z, w = q[:, 0] + 1j * q[:, 1], u[:, 0] + 1j * u[:, 1]
        matrix: list[np.ndarray] = []
        right: list[float] = []
        for a, arm_a, b, arm_b in self.hinges:
            # z_b + e^(i t_b) arm_b - z_a - e^(i t_a) arm_a = 0, real and imaginary part
            parts = np.zeros((self.n, 3), dtype=complex)
            turned = arm_a * np.exp(1j * q[a, 2])
            parts[a] = -1.0, -1j, -1j * turned
            rest = -(u[a, 2] ** 2) * turned
            if b is not None:
                turned = arm_b * np.exp(1j * q[b, 2])
                parts[b] = 1.0, 1j, 1j * turned
                rest += u[b, 2] ** 2 * turned
            matrix += [parts.real.ravel(), parts.imag.ravel()]
            right += [rest.real, rest.imag]
        for a, other, anchor in self.rods:
            r = (anchor if other is None else z[other]) - z[a]
            s = (0j if other is None else w[other]) - w[a]
            row = np.zeros((self.n, 3))
            row[a, :2] = -r.real, -r.imag
            if other is not None:
                row[other, :2] = r.real, r.imag
            matrix.append(row.ravel())
            right.append(-(abs(s) ** 2))
        for a, along in self.rails:
            row = np.zeros((self.n, 3))
            row[a, :2] = -along.imag, along.real
            turn = np.zeros((self.n, 3))
            turn[a, 2] = 1.0  # it does not turn
            matrix += [row.ravel(), turn.ravel()]
            right += [0.0, 0.0]
        return np.array(matrix), np.array(right)


def linked_motion(
    scene: Scene,
    times: np.ndarray,
    angle: np.ndarray,
    spin: np.ndarray,
    *,
    rtol: float = 1e-11,
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (T, n, 2) [m] and angles (T, n) [rad] at ``times`` (T,) [s], rising, from the scene's start.

    ``angle`` [rad] and ``spin`` [rad/s] (n,) are those at the start. Laws of bodies and joints are in it; none of
    contacts, and no driven body. Raises InputError for those and SimulationError where the integration fails.
    Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I (DOP853).
    """
    for item in scene.laws:
        if item.law.kind in ("pair", "impulse", "chain") or item.name == "drive" or item.law.role == "brake":
            raise InputError("is not among what this integrator has", where=f"law {item.name}")
    laws, links = Forces(scene), _Links(scene)
    initial = np.array([body.initial for body in scene.bodies], dtype=float)
    n = len(initial)
    mass = np.array([[b.mass, b.mass, b.moment] for b in scene.bodies])
    mass[:, :2] *= laws.inertia[:, None]
    weight = np.diag(mass.ravel())

    def change(t: float, y: np.ndarray) -> np.ndarray:
        q, u = y[: 3 * n].reshape(n, 3), y[3 * n :].reshape(n, 3)
        laws.spin = u[:, 2]
        force = np.zeros((n, 3))
        force[:, :2] = laws(t, q[:, :2], u[:, :2])
        force[:, 2] = laws.torque
        rows, right = links.rows(q, u)
        m = len(right)
        system = np.block([[weight, -rows.T], [rows, np.zeros((m, m))]])
        answer = np.linalg.solve(system, np.concatenate([force.ravel(), right]))
        return np.concatenate([u.ravel(), answer[: 3 * n]])

    times = np.asarray(times, dtype=float)
    start = np.concatenate(
        [np.column_stack([initial[:, :2], angle]).ravel(), np.column_stack([initial[:, 2:], spin]).ravel()]
    )
    t0 = scene.time.start
    found = solve_ivp(
        change, (t0, float(times.max())), start, method="DOP853", t_eval=times, rtol=rtol, atol=rtol * 1e-2
    )
    if not found.success:
        raise SimulationError(f"the adaptive integration failed: {found.message}")
    path = found.y[: 3 * n].T.reshape(-1, n, 3)
    return path[..., :2], path[..., 2]


def double_pendulum(
    times: np.ndarray,
    start: tuple[float, float, float, float],
    *,
    mass: tuple[float, float],
    inertia: tuple[float, float],
    arm: tuple[float, float],
    length: float,
    gravity: float = 9.81,
    drag: tuple[float, float] = (0.0, 0.0),
) -> np.ndarray:
    """(T, 2) angles [rad] of two bars from the vertical, by Lagrange's equations of the second kind in the angles.

    start : angles [rad], rates [rad/s];  mass [kg], inertia about the centres [kg m^2]
    arm : from each bar's upper hinge to its centre [m];  length : between the hinges of the first bar [m]
    drag : of the first hinge, to the world, and of the second, between the bars [N m s]
    Source: Goldstein, Classical Mechanics, ch. 1.4.
    """
    own = inertia[0] + mass[0] * arm[0] ** 2 + mass[1] * length**2
    other = inertia[1] + mass[1] * arm[1] ** 2
    cross = mass[1] * length * arm[1]
    weights = gravity * (mass[0] * arm[0] + mass[1] * length), gravity * mass[1] * arm[1]

    def change(t: float, y: np.ndarray) -> list[float]:
        first, second, rate, other_rate = y
        c, s = math.cos(first - second), math.sin(first - second)
        between = drag[1] * (other_rate - rate)
        right = (
            -cross * s * other_rate**2 - weights[0] * math.sin(first) - drag[0] * rate + between,
            cross * s * rate**2 - weights[1] * math.sin(second) - between,
        )
        whole = own * other - (cross * c) ** 2
        return [
            rate, other_rate, (right[0] * other - right[1] * cross * c) / whole,
            (right[1] * own - right[0] * cross * c) / whole,
        ]  # fmt: skip

    times = np.asarray(times, dtype=float)
    found = solve_ivp(
        change, (0.0, float(times.max())), start, method="DOP853", t_eval=times, rtol=1e-12, atol=1e-13
    )
    if not found.success:
        raise SimulationError(f"the adaptive integration failed: {found.message}")
    return found.y[:2].T
