"""Automatic values of laws: what the scene works out where a parameter is not given."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..laws import AUTOMATIC

if TYPE_CHECKING:
    from .model import Scene
    from .parts import LawUse


def _mean_grain_mass(scene: Scene, item: LawUse) -> float:
    grains = [b.mass for b in scene.bodies if b.role == "grain"]
    if not grains and scene.bed is not None:
        low, high = scene.bed.grain_diameter
        # mean of a sphere's mass over a uniform diameter: <d^3> = (a^4 - b^4)/(4 (a - b))
        cube = (high**4 - low**4) / (4 * (high - low)) if high > low else low**3
        return scene.bed.density * math.pi / 6 * cube
    return float(np.mean(grains or [b.mass for b in scene.bodies if b.mobile]))


def _disk_distance(scene: Scene, item: LawUse) -> float:
    """The length of the union, else twice the radius of the first disk."""
    for union in scene.laws_named("union"):
        if union.values["length"] is not AUTOMATIC:
            return float(union.values["length"])
    return 2 * scene.bodies[scene.swimmer[0]].radius if scene.swimmer else 0.0


FEW_BODIES = 100  # up to here every pair may be in the neighbour list
UNLIMITED = 1.0e3  # m


def _far_range(scene: Scene, item: LawUse) -> float:
    """Gap to which a force at a distance reaches: no limit among few bodies, six mean radii in a bed.

    With a period never beyond what the nearest image covers.
    """
    radii = [b.radius for b in scene.bodies]
    reach = UNLIMITED if len(radii) <= FEW_BODIES else 6 * float(np.mean(radii))
    if scene.periodic_x is not None:
        reach = min(reach, 0.45 * scene.periodic_x - 2 * max(radii))
    return reach


def _wall_line(side: int) -> Callable[[Scene, LawUse], float]:
    """The line [m] that the walls below (-1) or above (+1) the mobile bodies touch from outside."""

    def work_out(scene: Scene, item: LawUse) -> float:
        walls = [(b.initial[1], b.radius) for b in scene.bodies if not b.mobile and b.initial is not None]
        if not walls and scene.walls:
            return side * UNLIMITED  # straight walls are looked at themselves
        if not walls:
            raise InputError("needs bodies with role wall, or straight walls", where=f"law {item.name}")
        places = [b.initial[1] for b in scene.bodies if b.mobile and b.initial is not None]
        middle = float(np.mean(places or [y for y, _ in walls]))
        # the outermost row only: walls at the sides are no floor
        last = max(side * y for y, _ in walls)
        row = [(y, r) for y, r in walls if last - side * y < r and side * (y - middle) > 0]
        return side * min((side * y - r for y, r in row), default=UNLIMITED)

    return work_out


# LAW.PARAMETER, or PARAMETER in any law: what stands for an AUTOMATIC value. A law that refines another
# takes what is not listed here from that one.
AUTOMATIC_VALUES: dict[str, Callable[[Scene, LawUse], Any]] = {
    "mean_mass": _mean_grain_mass,
    "contact_elastic.wall_restitution": lambda scene, item: float(item.values["restitution"]),
    "union.length": _disk_distance,
    "bending.length": _disk_distance,
    "distance_force.range": _far_range,
    "pair_spring.cutoff": _far_range,
    "pair_lubrication.cutoff": lambda scene, item: 5 * float(item.values["range"]),
    "wall_drag.bottom": _wall_line(-1),
    "wall_drag.top": _wall_line(+1),
}
# where an automatic value is taken from a refined law's parameter of another name: that LAW.PARAMETER
RENAMED = {
    "contact_friction.stiffness": "contact_linear.stiffness",
    "contact_friction.hertz": "contact_hertz.stiffness",
    "rolling_resistance.stiffness": "contact_linear.stiffness",
    "rolling_resistance.hertz": "contact_hertz.stiffness",
}
