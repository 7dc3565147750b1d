"""Start states as free numbers: what can move at the start of a window, and a first estimate from the tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..scene import Scene
from .data import Case

Camera = Mapping[str, float]


@dataclass(frozen=True)
class StartBody:
    """How the start of one body is described.

    ``form``: "free" x, y, vx, vy; "pin" angle, angular velocity; "rail" x, y, speed along it;
    "drive" x, y (its velocity is commanded). ``known`` numbers are kept, the others are free.
    """

    body: str
    form: str
    first: np.ndarray  # first estimate of all numbers
    scale: np.ndarray  # how well the tracks determine them
    free: np.ndarray  # mask


def _hanging(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Unit vector along gravity (down where there is none), and the same turned by +90 degrees."""
    g = np.array(scene.gravity)
    size = math.hypot(*g)
    down = g / size if size > 0 else np.array([0.0, -1.0])
    return down, np.array([-down[1], down[0]])


def pin_of(scene: Scene, body: str):
    return next((scene.resolved(i) for i in scene.laws_named("pin") if body in (i.bodies or ())), None)


def _direction_of(scene: Scene, body: str, law: str) -> np.ndarray | None:
    for item in scene.laws_named(law):
        if item.bodies is None or body in item.bodies:
            direction = np.array(scene.resolved(item)["direction"], dtype=float)
            return direction / math.hypot(*direction)
    return None


def _local_fit(t: np.ndarray, values: np.ndarray, t0: float, sigma: float) -> tuple[float, float, float, float]:
    """Value and slope at t0 from a quadratic over the first frames, with their standard deviations."""
    seen = np.flatnonzero(np.isfinite(values))[:9]
    if len(seen) < 2:
        return (float(values[seen[0]]) if len(seen) else 0.0), 0.0, sigma, 1.0
    s = t[seen] - t0
    degree = 2 if len(seen) >= 5 else 1
    design = np.vander(s, degree + 1, increasing=True)
    coefficients, *_ = np.linalg.lstsq(design, values[seen], rcond=None)
    covariance = np.linalg.pinv(design.T @ design) * sigma**2
    return (
        float(coefficients[0]), float(coefficients[1]),
        float(np.sqrt(covariance[0, 0])) or sigma, float(np.sqrt(covariance[1, 1])) or sigma,
    )  # fmt: skip


def describe_starts(case: Case, frames: np.ndarray, scene: Scene | None = None) -> tuple[StartBody, ...]:
    """The start of every mobile body at the first of ``frames`` (T,) mask. Unseen bodies keep ``initial``."""
    scene = scene or case.recording.scene
    t0 = float(case.t[frames][0])
    t = case.t[frames]
    result = []
    for body in scene.bodies:
        if not body.mobile:
            continue
        columns = {c.kind: k for k, c in enumerate(case.channels) if c.body == body.id}
        given = body.initial or (0.0, 0.0, 0.0, 0.0)
        estimates = {}
        for kind, k in columns.items():
            estimates[kind] = _local_fit(t, case.values[frames, k], t0, float(case.sigma[k]))
        x = estimates.get("x", (given[0], given[2], 1e-12, 1e-12))
        y = estimates.get("y", (given[1], given[3], 1e-12, 1e-12))
        if not columns and body.id in case.recording.ids:
            k = case.recording.ids.index(body.id)
            seen = case.recording.xy[:, k, :]
            if np.isfinite(seen).any():  # seen, but never moving
                x = (float(np.nanmedian(seen[:, 0])), 0.0, 1e-12, 1e-12)
                y = (float(np.nanmedian(seen[:, 1])), 0.0, 1e-12, 1e-12)
        elif columns:
            # a coordinate that stays the same was left out of the channels: it stands where it stands
            k = case.recording.ids.index(body.id)
            for axis, kind in enumerate("xy"):
                seen = case.recording.xy[:, k, axis]
                if kind not in columns and np.isfinite(seen).any():
                    fixed = (float(np.nanmedian(seen)), 0.0, 1e-12, 1e-12)
                    x, y = (fixed, y) if kind == "x" else (x, fixed)
        pin = pin_of(scene, body.id)
        rail = _direction_of(scene, body.id, "rail")
        drive = _direction_of(scene, body.id, "drive")
        if pin is not None:
            result.append(_start_of_pinned(body.id, pin, scene, estimates, x, y, given))
        elif drive is not None and body.id in scene.inputs:
            result.append(
                StartBody(body.id, "drive", np.array([x[0], y[0]]), np.array([x[2], y[2]]),
                          np.array(["x" in columns, "y" in columns]))
            )  # fmt: skip
        elif rail is not None:
            speed = x[1] * rail[0] + y[1] * rail[1]
            result.append(
                StartBody(body.id, "rail", np.array([x[0], y[0], speed]), np.array([x[2], y[2], max(x[3], y[3])]),
                          np.array(["x" in columns, "y" in columns, bool(columns)]))
            )  # fmt: skip
        else:
            result.append(
                StartBody(
                    body.id, "free", np.array([x[0], y[0], x[1], y[1]]), np.array([x[2], y[2], x[3], y[3]]),
                    np.array(["x" in columns, "y" in columns, "x" in columns, "y" in columns]),
                )
            )  # fmt: skip
    return tuple(result)


def _start_of_pinned(body, pin, scene, estimates, x, y, given) -> StartBody:
    down, across = _hanging(scene)
    if "angle" in estimates:
        angle = estimates["angle"]
        return StartBody(body, "pin", np.array(angle[:2]), np.array(angle[2:]), np.array([True, True]))
    arm = np.array([x[0], y[0]]) - np.array(pin["anchor"])
    velocity = np.array([x[1], y[1]])
    angle = math.atan2(float(arm @ across), float(arm @ down))
    tangent = math.cos(angle) * across - math.sin(angle) * down
    spin = float(velocity @ tangent) / pin["length"]
    seen = bool(estimates)
    sigma = max(x[2], y[2]) / pin["length"], max(x[3], y[3]) / pin["length"]
    return StartBody(body, "pin", np.array([angle, spin]), np.array(sigma), np.array([seen, seen]))


def states(
    bodies: tuple[StartBody, ...], numbers: np.ndarray, scene: Scene, t0: float
) -> dict[str, tuple[float, float, float, float]]:
    """x, y, vx, vy of every body from the free ``numbers`` (in the order of the bodies)."""
    result = {}
    at = 0
    for start in bodies:
        values = start.first.copy()
        count = int(start.free.sum())
        values[start.free] = numbers[at : at + count]
        at += count
        if start.form == "free":
            result[start.body] = tuple(values)
        elif start.form == "pin":
            pin = pin_of(scene, start.body)
            down, across = _hanging(scene)
            arm = pin["length"] * (math.cos(values[0]) * down + math.sin(values[0]) * across)
            tangent = math.cos(values[0]) * across - math.sin(values[0]) * down
            velocity = pin["length"] * values[1] * tangent
            place = np.array(pin["anchor"]) + arm
            result[start.body] = (place[0], place[1], velocity[0], velocity[1])
        elif start.form == "rail":
            direction = _direction_of(scene, start.body, "rail")
            assert direction is not None
            result[start.body] = (values[0], values[1], values[2] * direction[0], values[2] * direction[1])
        else:
            direction = _direction_of(scene, start.body, "drive")
            assert direction is not None
            t, command = scene.inputs[start.body]
            gain = next(scene.resolved(i)["gain"] for i in scene.laws_named("drive") if start.body in (i.bodies or ()))
            speed = gain * float(np.interp(t0, t, command))
            result[start.body] = (values[0], values[1], speed * direction[0], speed * direction[1])
    return result


def numbers_at(bodies: tuple[StartBody, ...], scene: Scene, xy: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The free numbers of a start that a state would have: the inverse of ``states``.

    xy, v : (n, 2) positions [m] and velocities [m/s], rows in the order of the scene's bodies
    """
    row = {name: k for k, name in enumerate(scene.ids)}
    found = []
    for start in bodies:
        x, y, vx, vy = np.concatenate([xy[row[start.body]], v[row[start.body]]]).tolist()
        if start.form == "free":
            values = np.array([x, y, vx, vy])
        elif start.form == "pin":
            pin = pin_of(scene, start.body)
            down, across = _hanging(scene)
            arm = np.array([x, y]) - np.array(pin["anchor"])
            angle = math.atan2(float(arm @ across), float(arm @ down))
            # the same turn as the start that it is held against
            angle += 2 * math.pi * round((start.first[0] - angle) / (2 * math.pi))
            tangent = math.cos(angle) * across - math.sin(angle) * down
            values = np.array([angle, float(np.array([vx, vy]) @ tangent) / pin["length"]])
        elif start.form == "rail":
            direction = _direction_of(scene, start.body, "rail")
            assert direction is not None
            values = np.array([x, y, vx * direction[0] + vy * direction[1]])
        else:
            values = np.array([x, y])
        found.append(values[start.free])
    return np.concatenate(found) if found else np.zeros(0)


def first_numbers(bodies: tuple[StartBody, ...]) -> np.ndarray:
    return np.concatenate([b.first[b.free] for b in bodies]) if bodies else np.zeros(0)


def number_scales(bodies: tuple[StartBody, ...]) -> np.ndarray:
    return np.concatenate([b.scale[b.free] for b in bodies]) if bodies else np.zeros(0)


def pendulum_angle(xy: np.ndarray, scene: Scene, body: str) -> np.ndarray:
    """Angle of the rod (T,) from positions (T, 2): 0 when hanging, counter-clockwise, unwrapped."""
    pin = pin_of(scene, body)
    down, across = _hanging(scene)
    arm = xy - np.array(pin["anchor"])
    return np.unwrap(np.arctan2(arm @ across, arm @ down))
