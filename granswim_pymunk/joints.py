"""Angles of bodies in hinges: from the places of the bodies and back."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .scene import Scene


def hinged(scene: Scene) -> tuple[str, ...]:
    """Ids of the bodies that turn in a hinge, in the order of the scene."""
    names = {name for item in scene.laws_named("hinge") for name in item.bodies or ()}
    return tuple(body.id for body in scene.bodies if body.id in names and body.mobile)


def _turned(vector: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """(..., 2) ``vector`` (2,) turned by ``angle`` (...)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]], axis=-1)


def _ends(scene: Scene) -> list[tuple[str, np.ndarray, str | None, np.ndarray]]:
    """Each hinge from both its sides: body, point in its axes, the other body (None: the world), point there."""
    result: list[tuple[str, np.ndarray, str | None, np.ndarray]] = []
    for item in scene.laws_named("hinge"):
        a, *rest = item.bodies or ()
        on_a = np.array(item.values["anchor_a"])
        if not rest:
            result.append((a, on_a, None, np.array(item.values["anchor"])))
            continue
        on_b = np.array(item.values["anchor_b"])
        result += [(a, on_a, rest[0], on_b), (rest[0], on_b, a, on_a)]
    if not result:
        return result
    fixed = {body.id: np.array(body.initial[:2]) for body in scene.bodies if not body.mobile and body.initial}
    return [
        (body, own, None, fixed[other] + there) if other in fixed else (body, own, other, there)
        for body, own, other, there in result
        if body not in fixed
    ]


def angles_of(scene: Scene, xy: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles [rad] and angular velocities [rad/s] (..., n) of the bodies at places and velocities (..., n, 2).

    Those of a body in a hinge follow from where the hinge is, which is known in the world, at the centre of a body, and
    on a body whose own angle is known; all others are zero.
    """
    angle, spin = np.zeros(xy.shape[:-1]), np.zeros(xy.shape[:-1])
    ends = [end for end in _ends(scene) if math.hypot(*end[1]) > 0]
    if not ends:
        return angle, spin
    rows = {body.id: k for k, body in enumerate(scene.bodies)}
    known: set[str] = set()
    while True:
        ready = [
            (body, own, other, there)
            for body, own, other, there in ends
            if body not in known and (other is None or other in known or math.hypot(*there) == 0)
        ]
        if not ready:
            return angle, spin
        body, own, other, there = ready[0]
        i = rows[body]
        if other is None:
            point, speed = np.broadcast_to(there, xy[..., i, :].shape), np.zeros_like(v[..., i, :])
        else:
            j = rows[other]
            arm = _turned(there, angle[..., j])
            point = xy[..., j, :] + arm
            speed = v[..., j, :] + spin[..., j, None] * np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
        reach = point - xy[..., i, :]
        turned = np.arctan2(reach[..., 1], reach[..., 0]) - math.atan2(own[1], own[0])
        angle[..., i] = turned - 2 * np.pi * np.ceil((turned - np.pi) / (2 * np.pi))
        across = np.stack([-reach[..., 1], reach[..., 0]], axis=-1)
        spin[..., i] = ((speed - v[..., i, :]) * across).sum(axis=-1) / (reach**2).sum(axis=-1)
        known.add(body)


def hanging(scene: Scene) -> dict[str, float]:
    """Bodies that hang from the world by hinges, each with the distance [m] of its centre from the one it hangs by."""
    found: dict[str, float] = {}
    ends = _ends(scene)
    while True:
        ready = [(body, own) for body, own, other, _ in ends if body not in found and (other is None or other in found)]
        if not ready:
            return found
        found[ready[0][0]] = float(math.hypot(*ready[0][1]))


State = tuple[float, float, float, float]


def place(scene: Scene, angle: dict[str, float], spin: dict[str, float]) -> dict[str, State]:
    """x, y, vx, vy of the bodies that hang from the world by hinges, from their angles [rad] and rates [rad/s]."""
    found: dict[str, State] = {}
    ends = _ends(scene)
    while True:
        ready = [end for end in ends if end[0] not in found and end[0] in angle and (end[2] is None or end[2] in found)]
        if not ready:
            return found
        body, own, other, there = ready[0]
        point, speed = there, np.zeros(2)
        if other is not None:
            arm = _turned(there, np.array(angle[other]))
            x, y, vx, vy = found[other]
            point = np.array([x, y]) + arm
            speed = np.array([vx, vy]) + spin[other] * np.array([-arm[1], arm[0]])
        arm = _turned(own, np.array(angle[body]))
        centre = point - arm
        velocity = speed - spin[body] * np.array([-arm[1], arm[0]])
        found[body] = (float(centre[0]), float(centre[1]), float(velocity[0]), float(velocity[1]))


def arm_of(scene: Scene, body: str) -> float:
    """How far a body's centre is from the joint it hangs from [m], 1 where it hangs from none.

    The length of its pin, or of the anchor of its first hinge: what turns a rate into a speed.
    """
    for item in scene.laws_named("pin"):
        if item.bodies is None or body in item.bodies:
            return float(item.values["length"])
    for item in scene.laws_named("hinge"):
        bodies = item.bodies or ()
        if body in bodies:
            anchor = item.values["anchor_a" if body == bodies[0] and len(bodies) == 1 else "anchor_b"]
            if body == bodies[0] and len(bodies) > 1:
                continue  # what hangs from it
            return float(np.hypot(*anchor)) or 1.0
    return 1.0
