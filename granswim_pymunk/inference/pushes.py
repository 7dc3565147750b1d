"""What a constant acceleration is in an apparatus: gravity of another size, a table that is not level, or a push."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..laws import all_laws
from ..laws.base import PUSHES
from ..scene import Scene
from ..scene.parts import STANDARD_GRAVITY
from .criteria import current

GRAVITY, TILT, PUSH = PUSHES


def form_of_push(a: Sequence[float] | np.ndarray, on_all: bool, scenes: Sequence[Scene]) -> str:
    """What a constant acceleration [m/s^2] is in an apparatus: one of ``PUSHES`` (contract 2).

    What acts on all bodies alike where the picture has gravity in it, and along it, is gravity of another size; over a
    table it is a tilt of it, sin(angle) = |a|/g, and where a table would be too steep to be one, gravity that the
    scene lacks. Anything else pushes.
    """
    acceleration = np.asarray(a, dtype=float)
    size, judged = float(np.linalg.norm(acceleration)), set[str]()
    for scene in scenes:
        gravity = np.array(scene.gravity)
        in_picture = float(np.linalg.norm(gravity))
        if not in_picture:
            steep = size > current().apparatus.steep * STANDARD_GRAVITY
            judged.add(GRAVITY if steep else TILT)
        else:
            across = acceleration - gravity * (acceleration @ gravity) / in_picture**2
            along = float(np.linalg.norm(across)) <= current().verdict.ordinary * size
            judged.add(GRAVITY if along else PUSH)
    return judged.pop() if on_all and len(judged) == 1 else PUSH


def with_form(
    mechanism: str, parameters: Mapping[str, tuple[Any, Any, Any, str]], on_all: bool, scenes: Sequence[Scene]
) -> dict[str, tuple[Any, Any, Any, str]]:
    """The numbers of a law, of a push with what it is in this apparatus: ``form``."""
    law = all_laws().get(mechanism)
    a = parameters.get(law.strength[0]) if law is not None and law.role == "push" else None
    if a is None or not isinstance(a[0], list):
        return dict(parameters)
    return {**parameters, "form": (form_of_push(a[0], on_all, scenes), None, None, "")}


def degrees_of_tilt(a: Sequence[float]) -> float:
    """By how many degrees a table leans on which bodies are accelerated so [m/s^2]."""
    return math.degrees(math.asin(min(float(np.linalg.norm(a)) / STANDARD_GRAVITY, 1.0)))


def told_as(parameters: Mapping[str, tuple[Any, Any, Any, str]]) -> str:
    """What stands behind the equation of a push: by how many degrees a table leans, or that it is gravity."""
    form = parameters["form"][0] if "form" in parameters else ""
    if form == GRAVITY:
        return "; along gravity, on all bodies in proportion to their masses"
    a = next((value for value, *_ in parameters.values() if isinstance(value, list)), None)
    return f"; a table that leans by {degrees_of_tilt(a):.2g} degrees" if form == TILT and a is not None else ""
