"""Start states as free numbers: what can move at the start of a window, and a first estimate from the tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..joints import angles_of, hanging
from ..joints import place as placed
from ..scene import Scene
from .data import Case

Camera = Mapping[str, float]


@dataclass(frozen=True)
class StartBody:
    """How the start of one body is described.

    ``form``: "free" x, y, vx, vy; "pin" angle, angular velocity; "hinge" the same of a body that hangs from the world
    by hinges; "rod" those of a rod to the body before; "rail" x, y, speed along it; "drive" x, y (its velocity is
    commanded). ``known`` numbers are kept, the others are free.
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
    result: list[StartBody] = []
    hung, rods = hanging(scene), rods_of(scene)
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
        if body.id in hung:
            result.append(_start_of_hinged(body.id, case, frames, scene, estimates))
        elif body.id in rods:
            result.append(_start_of_rod(body.id, rods[body.id], scene, estimates, x, y, case, frames))
        elif pin is not None:
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


def rods_of(scene: Scene) -> dict[str, tuple[str, float]]:
    """Of each body that a rod joins to one described before it: that body, and the length [m]."""
    found: dict[str, tuple[str, float]] = {}
    order = {body.id: k for k, body in enumerate(scene.bodies)}
    for item in scene.laws_named("rod"):
        first, second = sorted(item.bodies or (), key=lambda name: order[name])
        free = pin_of(scene, second) is None and not any(
            _direction_of(scene, second, law) is not None for law in ("rail", "drive")
        )
        if second not in found and free and scene.body(second).mobile:
            found[second] = (first, float(item.values["length"]))
    return found


def _seen_at(case: Case, body: str, frames: np.ndarray) -> np.ndarray:
    """Places (T_frames, 2) [m] of a body in a case, which may hold other frames than its recording; NaN where not seen.

    A coordinate that is no channel did not change.
    """
    xy = np.full((int(frames.sum()), 2), np.nan)
    for axis, kind in enumerate("xy"):
        mine = [k for k, c in enumerate(case.channels) if (c.body, c.kind) == (body, kind)]
        if mine:
            xy[:, axis] = case.values[frames, mine[0]]
        elif body in case.recording.ids:
            known = case.recording.xy[:, case.recording.ids.index(body), axis]
            xy[:, axis] = np.median(known[np.isfinite(known)]) if np.isfinite(known).any() else np.nan
    return xy


def _start_of_hinged(body, case, frames, scene, estimates) -> StartBody:
    """Angle and rate from the tracked angle, else from the places of the bodies it hangs from."""
    if "angle" in estimates:
        angle = estimates["angle"]
        return StartBody(body, "hinge", np.array(angle[:2]), np.array(angle[2:]), np.array([True, True]))
    t = case.t[frames]
    given = np.array([b.initial or (0.0, 0.0, 0.0, 0.0) for b in scene.bodies], dtype=float)
    xy = np.repeat(given[None, :, :2], len(t), axis=0)
    for k, other in enumerate(scene.bodies):
        seen = _seen_at(case, other.id, frames)
        xy[:, k] = seen if np.isfinite(seen).any() else xy[:, k]
    row = scene.ids.index(body)
    angle = angles_of(scene, xy, np.zeros_like(xy))[0][:, row]
    finite = np.isfinite(angle)
    angle[finite] = np.unwrap(angle[finite])
    sigma = [case.sigma[k] for k, c in enumerate(case.channels) if c.body == body and c.kind != "angle"]
    arm = max(hanging(scene)[body], 1e-12)
    value, rate, spread, rate_spread = _local_fit(t, angle, float(t[0]), max(sigma, default=1e-6) / arm)
    seen_it = bool(sigma)
    return StartBody(
        body, "hinge", np.array([value, rate]), np.array([spread, rate_spread]), np.array([seen_it, seen_it])
    )


def _start_of_rod(body, rod, scene, estimates, x, y, case, frames) -> StartBody:
    """Angle and rate of the rod to the body before, from where both are seen."""
    other, length = rod
    down, across = _hanging(scene)
    t = case.t[frames]
    places = []
    for name in (other, body):
        given = scene.body(name).initial or (0.0, 0.0, 0.0, 0.0)
        seen = np.full((len(t), 2), given[:2])
        tracked = _seen_at(case, name, frames)
        seen = tracked if np.isfinite(tracked).any() else seen
        places.append(seen)
    arm = places[1] - places[0]
    angle = np.arctan2(arm @ across, arm @ down)
    finite = np.isfinite(angle)
    angle[finite] = np.unwrap(angle[finite])
    value, rate, spread, rate_spread = _local_fit(t, angle, float(t[0]), max(x[2], y[2]) / length)
    seen_it = bool(estimates)
    return StartBody(
        body, "rod", np.array([value, rate]), np.array([spread, rate_spread]), np.array([seen_it, seen_it])
    )


def states(
    bodies: tuple[StartBody, ...], numbers: np.ndarray, scene: Scene, t0: float
) -> dict[str, tuple[float, float, float, float]]:
    """x, y, vx, vy of every body from the free ``numbers`` (in the order of the bodies)."""
    result: dict[str, tuple[float, float, float, float]] = {}
    angles: dict[str, float] = {}
    spins: dict[str, float] = {}
    at = 0
    for start in bodies:
        values = start.first.copy()
        count = int(start.free.sum())
        values[start.free] = numbers[at : at + count]
        at += count
        if start.form == "free":
            result[start.body] = tuple(values)
        elif start.form == "hinge":
            angles[start.body], spins[start.body] = float(values[0]), float(values[1])
        elif start.form == "rod":
            other, length = rods_of(scene)[start.body]
            down, across = _hanging(scene)
            arm = length * (math.cos(values[0]) * down + math.sin(values[0]) * across)
            turn = length * values[1] * (math.cos(values[0]) * across - math.sin(values[0]) * down)
            before = result[other] if other in result else scene.body(other).initial
            result[start.body] = tuple(np.array(before, dtype=float) + np.concatenate([arm, turn]))
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
    return result | placed(scene, angles, spins) if angles else result


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
        elif start.form == "hinge":
            turned, rate = (of[row[start.body]] for of in angles_of(scene, xy, v))
            values = np.array([turned + 2 * math.pi * round((start.first[0] - turned) / (2 * math.pi)), rate])
        elif start.form == "rod":
            other, length = rods_of(scene)[start.body]
            down, across = _hanging(scene)
            arm, turn = xy[row[start.body]] - xy[row[other]], v[row[start.body]] - v[row[other]]
            turned = math.atan2(float(arm @ across), float(arm @ down))
            turned += 2 * math.pi * round((start.first[0] - turned) / (2 * math.pi))
            tangent = math.cos(turned) * across - math.sin(turned) * down
            values = np.array([turned, float(turn @ tangent) / length])
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


def turning_angle(xy: np.ndarray, rows: Sequence[int], scene: Scene, body: str) -> np.ndarray:
    """Angle (T,) [rad], unwrapped, of a pinned rod or of a body in a hinge, from positions (T, k, 2) of ``rows``.

    For a hinged body ``rows`` of ``scene.bodies`` hold all bodies that it hangs from.
    """
    if pin_of(scene, body) is not None:
        return pendulum_angle(xy[:, list(rows).index(scene.ids.index(body))], scene, body)
    whole = np.zeros((len(xy), len(scene.bodies), 2))
    for k, other in enumerate(scene.bodies):
        whole[:, k] = xy[:, list(rows).index(k)] if k in rows else (other.initial or (0.0, 0.0))[:2]
    return np.unwrap(angles_of(scene, whole, np.zeros_like(whole))[0][:, scene.ids.index(body)])
