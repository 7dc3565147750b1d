"""Chipmunk's own joints for pins, rails, rods and hinges beside impulses, which act in very short steps alone.

Forces hold these bodies, exactly at the end of each drift. Chipmunk's impulse knows nothing of them: it would throw a
rail's body off its rail. So each constraint has a joint in the Space, without a bias of its own, whose largest force is
zero but in the steps across an impact, where it is unlimited: contacts and joints are then solved together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pymunk
from pymunk._chipmunk_cffi import ffi

from .native import ProbeError, address

if TYPE_CHECKING:
    from ..scene import Scene
    from .units import Units

LONG = 1e4  # of the rail to each side, in radii of its body
MARK = 1.2345e77  # a largest force that nothing else in a joint is equal to
WORDS = 32  # of a joint, that are looked through


def joints_for(
    scene: Scene, bodies: Sequence[pymunk.Body], inner: np.ndarray, units: Units, space: pymunk.Space
) -> tuple[list[pymunk.Constraint], np.ndarray]:
    """Joints of a scene, put into the Space, and where their largest forces stand (addresses).

    bodies : of the Space, rows in inner order;  inner : scene row -> inner row. Raises ProbeError.
    """
    row = {body.id: int(inner[k]) for k, body in enumerate(scene.bodies)}
    still = space.static_body
    u = units.length

    def scaled(place: Sequence[float]) -> tuple[float, float]:
        return float(place[0]) / u, float(place[1]) / u

    made: list[pymunk.Constraint] = []
    for item in scene.laws:
        names = [name for name in item.bodies or () if row[name] >= 0]
        own = [bodies[row[name]] for name in names]
        if item.name == "pin":
            made += [pymunk.PinJoint(still, body, scaled(item.values["anchor"]), (0.0, 0.0)) for body in own]
        elif item.name == "rod" and len(own) == 2:
            made.append(pymunk.PinJoint(own[0], own[1], (0.0, 0.0), (0.0, 0.0)))
        elif item.name == "hinge" and len(own) == 2:
            ends = scaled(item.values["anchor_a"]), scaled(item.values["anchor_b"])
            made.append(pymunk.PivotJoint(own[0], own[1], *ends))
        elif item.name == "hinge" and len(own) == 1:
            made.append(
                pymunk.PivotJoint(still, own[0], scaled(item.values["anchor"]), scaled(item.values["anchor_a"]))
            )
        elif item.name == "rail":
            way = np.array(item.values["direction"], dtype=float)
            for k in scene.rows(item):
                body = bodies[int(inner[k])]
                far = LONG * scene.bodies[int(k)].radius / u * way / np.hypot(*way)
                at = np.array(body.position)
                made.append(pymunk.GrooveJoint(still, body, tuple(at - far), tuple(at + far), (0.0, 0.0)))
    for joint in made:
        joint.error_bias = 1.0  # what places are left to correct is the forces' business
        joint.collide_bodies = True
    places = np.array([_place_of_largest_force(joint) for joint in made], dtype=np.int64)
    if made:
        space.add(*made)
    return made, places


def _place_of_largest_force(joint: pymunk.Constraint) -> int:
    """Address of a joint's largest force, found by writing it; it is zero afterwards. Raises ProbeError."""
    joint.max_force = MARK
    start = address(joint._constraint)
    words = ffi.cast("double *", joint._constraint)
    found = [k for k in range(WORDS) if words[k] == MARK]
    joint.max_force = 0.0
    if len(found) != 1 or words[found[0]] != 0.0:
        raise ProbeError("the largest force of a joint was not found")
    return start + 8 * found[0]
