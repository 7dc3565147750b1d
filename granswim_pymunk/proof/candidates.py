"""Effects to be concealed, and rivals to hold them against: how each is drawn, and which of its numbers are fitted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .setups import Setup
from .world import Camera, Effect, World

APPARATUS = (
    "camera_scale", "camera_tilt", "time_offset", "tracking_bias", "lens_distortion", "camera_foreshortening",
)  # fmt: skip
OUTSIDE = ("attraction", "cubic_drag", "transverse_force", "shaking", "phase_drag")

# name -> the number that makes it strong or weak, and the numbers that a fit may move
STRENGTH = {
    "linear_drag": "c", "quadratic_drag": "c", "cubic_drag": "c", "ambient_flow": "c", "added_mass": "beta",
    "coulomb_substrate": "mu", "uniform_force": "a", "contact_friction": "mu", "cohesion": "force",
    "distance_force": "s", "pair_lubrication": "c", "actuator_lag": "tau", "actuator_delay": "tau",
    "joint_friction": "torque", "nonlinear_spring": "k_3", "wall_drag": "c", "attraction": "strength",
    "transverse_force": "strength", "shaking": "a", "phase_drag": "c", "camera_scale": "s", "camera_tilt": "angle",
    "time_offset": "offset", "tracking_bias": "b", "weak_joint": "factor", "resting_curvature": "phi_0",
    "nonlinear_bending": "k_3", "head_force": "force",
}  # fmt: skip
FITTED = {
    "ambient_flow": ("c", "u"), "cohesion": ("force", "range"), "distance_force": ("s", "n"),
    "pair_lubrication": ("c", "range"), "actuator_saturation": ("limit",), "wall_drag": ("c", "range"),
    "restitution": ("restitution",),
}  # fmt: skip


def fitted(effect: Effect) -> tuple[str, ...]:
    """The numbers of an effect that a fit moves."""
    if effect.name == "restitution":
        return ("restitution",) if "restitution" in effect.values else ("damping",)
    if effect.name == "joint_friction":
        return ("torque",) if "torque" in effect.values else ("force",)
    return FITTED.get(effect.name) or (STRENGTH[effect.name],)


def stands_for(effect: Effect) -> str:
    """The number of the scene in whose place an effect stands, as contact_elastic.restitution; "" where it adds one."""
    if effect.name != "restitution":
        return ""
    key = fitted(effect)[0]
    return f"{'contact_elastic' if key == 'restitution' else 'contact_linear'}.{key}"


def numbers(effect: Effect) -> np.ndarray:
    """The fitted numbers as one vector."""
    return np.concatenate([np.atleast_1d(np.asarray(effect.values[key], dtype=float)) for key in fitted(effect)])


_BOUNDS = {
    "c": (0.0, math.inf), "mu": (0.0, math.inf), "force": (0.0, math.inf), "range": (1e-7, math.inf),
    "tau": (0.0, math.inf), "torque": (0.0, math.inf), "limit": (0.0, math.inf), "n": (0.0, 20.0),
    "restitution": (0.0, 1.0), "damping": (0.0, math.inf), "beta": (-0.9, math.inf),
}  # fmt: skip


def bounds(effect: Effect) -> tuple[np.ndarray, np.ndarray]:
    """Low and high of the fitted numbers: a drag never pushes."""
    pairs = []
    for key in fitted(effect):
        size = 2 if isinstance(effect.values[key], tuple) else 1
        pairs += [_BOUNDS.get(key, (-math.inf, math.inf))] * size
    return np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])


def with_numbers(effect: Effect, vector: Sequence[float] | np.ndarray) -> Effect:
    """The effect with other fitted numbers."""
    values, at = dict(effect.values), 0
    for key in fitted(effect):
        if isinstance(values[key], tuple):
            values[key] = tuple(float(x) for x in vector[at : at + 2])
            at += 2
        else:
            values[key] = float(vector[at])
            at += 1
    return replace(effect, values=values)


def camera_of(effects: Sequence[Effect]) -> Camera:
    """What those of the effects that are faults of the camera make of it."""
    camera = Camera()
    for e in effects:
        if e.name == "camera_scale":
            camera = replace(camera, scale=1.0 + e.values["s"])  # less one, so that zero is no fault
        elif e.name == "camera_tilt":
            camera = replace(camera, tilt=e.values["angle"])
        elif e.name == "time_offset":
            camera = replace(camera, time_offset=e.values["offset"])
        elif e.name == "tracking_bias":
            camera = replace(camera, bias=e.values["b"])
    return camera


def physics_of(effects: Sequence[Effect]) -> list[Effect]:
    return [e for e in effects if e.name not in APPARATUS]


class Sizes:
    """Typical sizes of an apparatus, by which effects are drawn."""

    def __init__(self, setup: Setup) -> None:
        run = World(setup.scene, [], setup.dt).sample(setup.t, t0=float(setup.t[0]))
        rows = [i for i, b in enumerate(setup.scene.bodies) if b.mobile]
        xy = run.xy[:, rows]
        v = np.diff(xy, axis=0) / np.diff(setup.t)[:, None, None]
        self.duration = float(setup.t[-1] - setup.t[0])
        self.speed = float(np.sqrt(np.mean(np.sum(v**2, axis=-1)))) or 0.1
        self.extent = float(max(np.ptp(xy[..., 0]), np.ptp(xy[..., 1]), 1e-3))
        self.centre = tuple(float(x) for x in xy.reshape(-1, 2).mean(axis=0))
        bodies = [setup.scene.bodies[i] for i in rows]
        self.mass = float(np.mean([b.mass for b in bodies]))
        self.radius = float(np.mean([b.radius for b in bodies]))
        spring = setup.scene.laws_named("spring")
        self.stiffness = float(spring[0].values["stiffness"]) if spring else 1.0
        pin = setup.scene.laws_named("pin")
        self.length = float(pin[0].values["length"]) if pin else self.extent
        self.fastest = float(np.sqrt(np.max(np.sum(v**2, axis=-1))))


def typical(name: str, setup: Setup, sizes: Sizes) -> Effect:
    """An effect of clearly visible size in the contract's own form: where rivals begin to be fitted."""
    m, v, T, r = sizes.mass, sizes.speed, sizes.duration, sizes.radius
    rate = 0.2 / T
    values: dict[str, Any]
    if name == "linear_drag":
        values = {"c": m * rate, "p": 0}
    elif name == "quadratic_drag":
        values = {"c": m * rate / v, "p": 0}
    elif name == "cubic_drag":
        values = {"c": m * rate / v**2, "p": 0}
    elif name == "ambient_flow":
        values = {"c": m * rate, "u": (0.3 * v, -0.2 * v)}
    elif name == "added_mass":
        values = {"beta": 0.05}
    elif name == "coulomb_substrate":
        values = {"mu": 0.15 * v / T / 9.81}
    elif name == "uniform_force":
        values = {"a": (0.1 * v / T, 0.07 * v / T)}
    elif name == "contact_friction":
        values = {"mu": 0.15}
    elif name == "restitution":
        elastic = setup.scene.laws_named("contact_elastic")
        if elastic:
            values = {"restitution": 0.9 * elastic[0].values["restitution"]}
        else:
            values = {"damping": 1.5 * setup.scene.laws_named("contact_linear")[0].values["damping"]}
    elif name == "cohesion":
        values = {"force": 0.02 * m * v**2 / r, "range": 0.25 * r}
    elif name == "distance_force":
        values = {"s": 0.3 * m * v**2 / r, "n": 2.0}
    elif name == "pair_lubrication":
        values = {"c": 0.5 * v / r, "range": 0.25 * r}
    elif name in ("actuator_lag", "actuator_delay"):
        values = {"tau": 0.01}
    elif name == "actuator_saturation":
        values = {"limit": 0.75 * sizes.fastest}
    elif name == "joint_friction":
        values = {"torque": 0.03 * m * v * sizes.length / T}
    elif name == "nonlinear_spring":
        values = {"k_3": 0.15 * sizes.stiffness / sizes.extent**2}
    elif name == "attraction":
        away = 0.35 * sizes.extent
        values = {
            "strength": 0.15 * m * v * sizes.extent / T, "size": 0.3 * sizes.extent,
            "centre": (sizes.centre[0] + away, sizes.centre[1] - 0.5 * away),
        }  # fmt: skip
    elif name == "transverse_force":
        values = {"strength": m * rate}
    elif name == "shaking":
        values = {"a": (0.6 * v / T, -0.4 * v / T), "frequency": 2.3 / T, "phase": 1.0}
    elif name == "camera_scale":
        values = {"s": 0.01}
    elif name == "camera_tilt":
        values = {"angle": 0.01}
    elif name == "time_offset":
        values = {"offset": 0.01}
    elif name == "tracking_bias":
        values = {"b": (0.02 * sizes.extent, 0.01 * sizes.extent)}
    else:
        raise ValueError(name)
    return Effect(name, values)


def draw(name: str, setup: Setup, sizes: Sizes, rng: np.random.Generator, other: bool) -> Effect:
    """An effect with numbers of its own; ``other``: in another functional form than the contract's, if it has one.

    The strength is set later, by its standard errors.
    """
    effect = typical(name, setup, sizes)
    values: dict[str, Any] = dict(effect.values)
    for key, value in values.items():
        if key == "p":
            values[key] = int(rng.integers(0, 3 if name == "quadratic_drag" else 2)) if len(setup.mobile) > 1 else 0
        elif key == "n":
            values[key] = float(rng.uniform(1.5, 3.5))
        elif isinstance(value, tuple):
            size, way = math.hypot(*value) * rng.uniform(0.7, 1.4), rng.uniform(0, 2 * math.pi)
            values[key] = (size * math.cos(way), size * math.sin(way))
            if key == "centre":
                values[key] = (sizes.centre[0] + values[key][0] * 0.3, sizes.centre[1] + values[key][1] * 0.3)
        elif key not in ("limit", "restitution", "damping"):
            values[key] = float(value * np.exp(rng.uniform(-0.4, 0.4)))
    if name == "attraction":
        away, way = 0.5 * sizes.extent, rng.uniform(0, 2 * math.pi)
        values["centre"] = (sizes.centre[0] + away * math.cos(way), sizes.centre[1] + away * math.sin(way))
    if name in ("camera_scale", "camera_tilt", "time_offset") and rng.random() < 0.5:
        key = STRENGTH[name]
        values[key] = -values[key] if name != "time_offset" else values[key]
    bodies = None
    single = ("linear_drag", "quadratic_drag", "coulomb_substrate", "uniform_force", "attraction", "transverse_force")
    if len(setup.mobile) > 1 and name in single and rng.random() < 0.25:
        bodies = (setup.mobile[int(rng.integers(len(setup.mobile)))],)
        if "p" in values:
            values["p"] = 0
    return Effect(name, values, bodies, _other(name, setup, sizes, rng) if other else {})


def _other(name: str, setup: Setup, sizes: Sizes, rng: np.random.Generator) -> dict[str, Any]:
    """Another functional form of the same mechanism; empty where there is only one."""
    sign = float(rng.choice([-1, 1]))
    if name in ("linear_drag", "quadratic_drag", "ambient_flow"):
        return {"power": sign * rng.uniform(0.05, 0.15), "speed": sizes.speed}
    if name == "added_mass" and len(setup.mobile) > 1:
        return {"power": sign * rng.uniform(0.1, 0.3)}
    if name == "coulomb_substrate":
        return {"form": 1.0, "v_0": rng.uniform(2e-3, 6e-3)}
    if name == "contact_friction":
        return {"form": 1.0, "v_0": rng.uniform(3e-3, 8e-3)}
    if name == "restitution":
        if setup.scene.laws_named("contact_elastic"):
            return {"power": rng.uniform(0.02, 0.1), "speed": 1.5 * sizes.speed}
        return {"power": rng.uniform(0.1, 0.5), "overlap": 0.02 * sizes.radius}
    if name in ("cohesion", "pair_lubrication"):
        return {"form": 1.0}
    if name == "distance_force":
        return {"screening": rng.uniform(3, 8) * sizes.radius}
    if name == "actuator_lag":
        return {"order": 2}
    if name == "actuator_saturation":
        return {"smooth": rng.uniform(6, 12)}
    if name == "joint_friction":
        return {"form": 1.0, "w_0": rng.uniform(0.03, 0.08)}
    if name == "nonlinear_spring":
        return {"power": sign * rng.uniform(0.1, 0.3), "stretch": 0.4 * sizes.extent}
    return {}


def scale_strength(effect: Effect, factor: float, setup: Setup) -> Effect:
    """The effect made stronger by a factor, kept within what makes sense."""
    values = dict(effect.values)
    if effect.name == "restitution":
        key = fitted(effect)[0]
        believed = float(setup.scene.parameter(stands_for(effect)))
        values[key] = float(
            np.clip(believed + factor * (values[key] - believed), 0.05, 1.0 if key == "restitution" else 500)
        )
        return replace(effect, values=values)
    if effect.name == "actuator_saturation":
        # the nearer the limit to the fastest command, the weaker; a logarithm keeps it positive
        values["limit"] = float(values["limit"] * np.exp(-0.1 * np.log(factor)))
        return replace(effect, values=values)
    return effect.scaled(factor, STRENGTH[effect.name])
