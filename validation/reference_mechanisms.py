"""Formulas of the mechanisms that a scene may lack, written anew for the reference integrator.

No code of the engine's laws; only parameter values come from the scene. SI throughout.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

FIELDS = ("ambient_flow", "quadratic_flow", "wall_drag", "nonlinear_spring", "point_force", "buried_force")
JOINTS = ("pin_friction", "joint_drag")
PAIRS = ("distance_force", "pair_spring", "cohesion", "contact_friction", "pair_lubrication", "rolling_resistance")
ACTUATORS = ("actuator_lag", "actuator_delay", "actuator_saturation", "actuator_deadband")
CHAIN_LAWS = (
    "nonlinear_bending", "weak_joint", "resting_curvature", "joint_friction", "head_force", "actuator_lag",
    "actuator_delay", "actuator_saturation", "actuator_deadband",
)  # fmt: skip
INERTIA = ("added_mass",)
REACH = {"distance_force": "range", "pair_spring": "cutoff", "cohesion": "range", "pair_lubrication": "cutoff"}

Values = dict[str, Any]


def reach(name: str, values: Values) -> float:
    """Gap [m] below which a law of pairs acts; 0: contact."""
    return float(values[REACH[name]]) if name in REACH else 0.0


def smooth_sign(u: np.ndarray, small: float) -> np.ndarray:
    """u/sqrt(u^2 + small^2)"""
    size = np.hypot(u, small)
    return np.divide(u, size, out=np.zeros_like(size), where=size > 0)


def field(
    name: str, values: Values, xy: np.ndarray, v: np.ndarray, radius: np.ndarray, wall_gap: np.ndarray
) -> np.ndarray:
    """(k, 2) force [N] on k bodies at xy (k, 2) [m] with v (k, 2) [m/s], each by its own state.

    ``wall_gap`` (k,) [m]: to the nearest straight wall.
    """
    if name == "ambient_flow":
        return values["c"] * (np.array(values["u"]) - v)
    if name == "quadratic_flow":
        against = np.array(values["u"]) - v
        larger = (radius / radius.mean()) ** values["p"]
        return values["c"] * (larger * np.hypot(*against.T))[:, None] * against
    if name == "wall_drag":
        rows = np.minimum(xy[:, 1] - values["bottom"], values["top"] - xy[:, 1]) - radius
        beyond = np.minimum(rows, wall_gap) - values["range"]
        near = np.clip(0.5 - 10 * beyond / values["range"], 0.0, 1.0)
        return -values["c"] * near[:, None] * v
    if name in ("point_force", "buried_force"):
        size = radius.mean()
        r = xy - np.array(values["a"])
        d = np.linalg.norm(r, axis=1, keepdims=True)
        if name == "point_force":
            return values["s"] * np.where(d < size, r / size, r / d * (size / np.where(d > 0, d, 1.0)) ** values["n"])
        deep = np.sqrt(d**2 + values["b"] ** 2)
        return values["s"] * (size / deep) ** values["n"] * r / deep
    r = xy - np.array(values["anchor"])
    distance = np.hypot(r[:, 0], r[:, 1])[:, None]
    return -values["k_3"] * (distance - values["length"]) ** 3 * r / distance


def joint_torque(name: str, values: Values, rate: float) -> float:
    """Torque [N m] on what turns at ``rate`` [rad/s] against the rest of a joint."""
    if name == "joint_drag":
        return float(-values["c"] * rate)
    return float(-values["torque"] * smooth_sign(np.array(rate), values["w_0"]))


def pair(
    name: str,
    values: Values,
    gap: np.ndarray,
    touch: np.ndarray,
    approach: np.ndarray,
    slip: np.ndarray,
    reduced: np.ndarray,
    mean_radius: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Force on the second body along the normal and across it (k,), (k,) [N].

    gap, touch (sum of radii) [m]; approach (v_j - v_i).n and slip of the surfaces [m/s]; reduced mass [kg].
    """
    none = np.zeros_like(gap)
    if name == "distance_force":
        return np.where(gap > 0, values["s"] * (mean_radius / (gap + touch)) ** values["n"], 0.0), none
    if name == "pair_spring":
        return values["f_0"] - values["k"] * (gap + touch), none
    if name == "cohesion":
        return none - values["force"], none
    if name == "pair_lubrication":
        return -values["c"] * reduced * approach * values["range"] / (
            values["range"] + np.maximum(gap, 0.0)
        ), none
    if name == "rolling_resistance":
        return none, none
    return none, -values["mu"] * pressed(values, gap, approach, reduced) * smooth_sign(slip, values["v_0"])


def pressed(values: Values, gap: np.ndarray, approach: np.ndarray, reduced: np.ndarray) -> np.ndarray:
    """(k,) repulsion [N] in contacts, linear or Hertz, never below zero."""
    overlap = np.maximum(-gap, 0.0)
    elastic = values["stiffness"] * overlap + values["hertz"] * overlap**1.5
    return np.maximum(elastic - values["damping"] * reduced * approach, 0.0)


def rolling(values: Values, normal: np.ndarray, radius: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """(k,) torques [N m] against the spin of bodies in contacts with forces ``normal`` [N]."""
    return -values["mu_r"] * radius * normal * smooth_sign(spin, values["w_0"])


def head_angle(values: Values, t: float) -> float:
    """Commanded angle of the head's axis [rad]."""
    return values["amplitude"] * math.sin(2 * math.pi * values["frequency"] * t + values["phase"])


def followed_angle(name: str, values: Values, t: float) -> float:
    """Angle [rad] that the actuator makes of the command."""
    if name == "actuator_delay":
        return head_angle(values, t - values["tau"])
    if name == "actuator_saturation":
        return float(np.clip(head_angle(values, t), -values["limit"], values["limit"]))
    if name == "actuator_deadband":
        asked = head_angle(values, t)
        return math.copysign(max(abs(asked) - values["width"], 0.0), asked)
    tau, omega = values["tau"], 2 * math.pi * values["frequency"]
    if tau == 0 or t <= 0:
        return head_angle(values, t)
    # theta = Im z e^(i omega t) + rest e^(-t/tau), z the complex answer to the complex command
    z = values["amplitude"] * np.exp(1j * values["phase"]) / (1 + 1j * omega * tau)
    rest = head_angle(values, 0.0) - z.imag
    return float((z * np.exp(1j * omega * t)).imag + rest * math.exp(-t / tau))


def followed_command(name: str, values: Values, t: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What an actuator makes of a commanded velocity: (t [s], value), straight lines between rows.

    A lag begins at rest at the first row and is followed until 20 of its times after the last one.
    """
    if name == "actuator_delay":
        return t + values["tau"], value
    if name == "actuator_saturation":
        return _clipped(t, value, values["limit"])
    if name == "actuator_deadband":
        rows, inside = _clipped(t, value, values["width"])
        return rows, np.interp(rows, t, value) - inside
    tau = values["tau"]
    if tau == 0 or len(t) < 2:
        return t, value
    end = t[-1] + 20 * tau
    grid = np.union1d(t, np.linspace(t[0], end, int(np.clip((end - t[0]) / tau * 200, 2, 500_000))))
    command = np.interp(grid, t, value)
    followed = np.empty_like(command)
    followed[0] = command[0]
    for k, h in enumerate(np.diff(grid)):
        # tau dx/dt = u - x over a straight piece of u: what is left of the start, and what has come of the piece
        left = math.exp(-h / tau)
        slope = (command[k + 1] - command[k]) / h
        followed[k + 1] = left * followed[k] + (1 - left) * command[k] + slope * (h - tau * (1 - left))
    return grid, followed


def _clipped(t: np.ndarray, value: np.ndarray, limit: float) -> tuple[np.ndarray, np.ndarray]:
    """A broken line held between plus and minus a limit, with a row wherever it reaches one."""
    times, values = [float(t[0])], [float(value[0])]
    for k in range(len(t) - 1):
        rise = value[k + 1] - value[k]
        shares = [(edge - value[k]) / rise for edge in (-limit, limit) if rise != 0]
        for share in sorted(s for s in shares if 0 < s < 1):
            times.append(float(t[k] + share * (t[k + 1] - t[k])))
            values.append(float(value[k] + share * rise))
        times.append(float(t[k + 1]))
        values.append(float(value[k + 1]))
    return np.array(times), np.clip(values, -limit, limit)


def _turns(angle: np.ndarray) -> np.ndarray:
    """The angle between -pi (excluded) and pi."""
    return angle - 2 * np.pi * np.ceil((angle - np.pi) / (2 * np.pi))


def chain(name: str, values: Values, t: float, xy: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(n, 2) forces [N] on the disks of one swimmer, head first."""
    force = np.zeros_like(xy)
    if name == "head_force":
        angle = values["angle"] if values["axis"] == "fixed" else head_angle(values, t)
        force[0] = values["force"] * np.array([math.cos(angle), math.sin(angle)])
        return force
    r, u = np.diff(xy, axis=0), np.diff(v, axis=0)
    length = np.hypot(r[:, 0], r[:, 1])
    across = np.stack([-r[:, 1], r[:, 0]], axis=1) / length[:, None]
    alpha = np.arctan2(r[:, 1], r[:, 0])
    rate = (u * across).sum(axis=1) / length
    joints = np.arange(len(r))

    def against(first: float, angles: np.ndarray) -> np.ndarray:
        """Difference to the segment before, or to the head's axis."""
        if values["form"] == "head_axis":
            return angles - first
        return np.diff(angles, prepend=first)

    # pushes[j] [N]: what the joint adds to the force across its segment
    if name == "nonlinear_bending":
        pushes = -values["k_3"] * _turns(against(head_angle(values, t), alpha)) ** 3
    elif name == "weak_joint":
        phi = _turns(against(head_angle(values, t), alpha))
        pushes = np.where(joints == values["joint"], (1 - values["factor"]) * values["stiffness"] * phi, 0.0)
    elif name == "resting_curvature":
        chosen = (joints == values["joint"]) | (values["joint"] == "all")
        pushes = np.where(chosen, values["stiffness"] * values["phi_0"], 0.0)
    elif name == "joint_friction":
        omega = 2 * math.pi * values["frequency"]
        turning = values["amplitude"] * omega * math.cos(omega * t + values["phase"])
        pushes = -values["force"] * smooth_sign(against(turning, rate), values["w_0"])
    else:
        command, angle = head_angle(values, t), followed_angle(name, values, t)
        bend, believed = _turns(against(angle, alpha)), _turns(against(command, alpha))
        pushes = -values["stiffness"] * (bend - believed)
    if values["form"] == "elastic":
        # joint j turns segment j one way and segment j - 1 the other, by the torque push * d
        torque = values["length"] * (pushes - np.append(pushes[1:], 0.0))
        pushes = torque / length
    force[1:] += pushes[:, None] * across
    force[:-1] -= pushes[:, None] * across
    return force
