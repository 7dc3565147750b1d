"""Beds of any size, cut and tiled from the one that comes with the package."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from granswim_pymunk.scene import Body, Scene
from granswim_pymunk.validation.crosscheck import read_bed

# bodies of the shipped bed as its size is quoted: 7 disks, 2189 grains, half of the 132 wall grains
SHIPPED_SIZE = 2264

Placed = tuple[Body, tuple[float, ...]]  # a body and its x, y [m], vx, vy [m/s]


def shipped_bed() -> Scene:
    """The swimmer's bed at 9 Hz: 7 disks, 2189 grains, 132 wall grains, with all its laws."""
    return read_bed("bed_9Hz").scene


def bed(grains: int) -> Scene:
    """A channel of about that many grains, as dense (but for the seam) and as lively as the shipped bed.

    The shipped bed is repeated along x, whole and in part. Where a part meets the seam, grains that
    would overlap are left out; a swimmer that would be cut becomes grains.
    """
    scene = shipped_bed()
    if grains == SHIPPED_SIZE:
        return scene
    period = scene.periodic_x
    assert period is not None
    bodies = scene.bodies
    state = np.array([b.initial for b in bodies])
    radius = np.array([b.radius for b in bodies])
    swims = np.array([b.role in ("head", "tail") for b in bodies])
    # the swimmer stands first, so that a short piece holds it whole
    left = state[swims, 0].min() - 2 * radius[swims].max()
    state[:, 0] = np.mod(state[:, 0] - left, period)
    length = period * grains / SHIPPED_SIZE
    wanted = len(bodies) * grains / SHIPPED_SIZE
    for _ in range(4):
        placed = _tile(bodies, state, period, length)
        # those that give way at the seam are made up for by length
        if abs(len(placed) / wanted - 1) < 0.02:
            break
        length *= wanted / len(placed)
    cut = tuple(replace(body, id=str(row), initial=at) for row, (body, at) in enumerate(placed))  # type: ignore[arg-type]
    return replace(scene, bodies=cut, periodic_x=length, title=f"{scene.title}, {len(cut)} bodies")


def _tile(bodies: tuple[Body, ...], state: np.ndarray, period: float, length: float) -> list[Placed]:
    """Copies of the bed side by side, the last one cut where the channel ends."""
    copies, rest = divmod(length, period)
    if rest < 1e-6 * period:
        rest = 0.0
    swims = [b.role in ("head", "tail") for b in bodies]
    room = max(float(state[k, 0]) + b.radius for k, b in enumerate(bodies) if swims[k])
    placed: list[Placed] = []
    for copy in range(int(copies) + (rest > 0)):
        width = period if copy < int(copies) else rest
        for k, body in enumerate(bodies):
            if state[k, 0] < width:
                role = body.role if room < width or not swims[k] else "grain"
                at = (float(state[k, 0] + copy * period), *map(float, state[k, 1:]))
                placed.append((replace(body, role=role), at))
    return [placed[k] for k in _clear_of_the_seam(placed, length)] if rest else placed


def _clear_of_the_seam(placed: list[Placed], length: float) -> list[int]:
    """Rows that stay when grains left of the seam give way to those right of it."""
    widest = 2 * max(body.radius for body, _ in placed)
    right = [k for k, (_, at) in enumerate(placed) if at[0] < widest]
    keep = []
    for k, (body, at) in enumerate(placed):
        close = at[0] > length - widest and any(
            math.hypot(placed[j][1][0] + length - at[0], placed[j][1][1] - at[1])
            < 0.98 * (placed[j][0].radius + body.radius)
            for j in right
            if j != k
        )
        if not close or body.role in ("head", "tail"):
            keep.append(k)
    return keep


def contacts_only(scene: Scene) -> Scene:
    """The scene with contacts and drag alone: what every engine here can compute."""
    laws = tuple(item for item in scene.laws if item.name in ("contact_linear", "linear_drag"))
    return replace(scene, laws=laws)
