"""Faults of the motors that drive bodies: a lag, a delay, a limit or a dead band of the commanded velocity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..laws import Law, all_laws, get_law
from ..scene import Scene, use
from .criteria import current
from .data import Case
from .hypothesis import Free, Term


def driven_terms(cases: Sequence[Case]) -> list[Term]:
    """One term for each fault that a driven velocity can have, none where nothing is driven.

    Lag and delay are tried from about the time between frames, a limit from the largest command on, a dead band from
    none.
    """
    driven: dict[str, None] = {}
    top, spacing = 0.0, np.inf
    for case in cases:
        scene = case.recording.scene
        for item in scene.laws_as("command"):
            for body in item.bodies or ():
                if body in scene.inputs:
                    driven[body] = None
                    gain = float(scene.resolved(item)["gain"])
                    top = max(top, abs(gain) * float(np.max(np.abs(scene.inputs[body][1]))))
        if len(case.t) > 1:
            spacing = min(spacing, float(np.median(np.diff(case.t))))
    if not driven or top == 0.0 or not np.isfinite(spacing):
        return []
    terms, step = [], current().candidates.step
    for law in all_laws().values():
        if law.series is None or law.candidate != "named" or not any(
            get_law(name).role == "command" for name in law.refines
        ):
            continue
        strength = law.parameter(law.strength[0])
        name = f"{law.name}.{strength.name}"
        if strength.unit == "s":
            # no motor answers before its command
            free = Free(name, "s", 0.0, np.inf, 0.0, step * spacing, None, 0.0)
        else:
            absent = min(strength.neutral, top)
            free = Free(name, "m/s", 0.0, top, absent, step * top, None, absent)
        terms.append(
            Term(law.mechanism, law.name, (free,), _Fault(law), tuple(driven), law.expression, {},
                 ((strength.name, (0,)),))
        )  # fmt: skip
    return terms


class _Fault:
    """Adds the fault with the size found."""

    def __init__(self, law: Law) -> None:
        self.law = law

    def __call__(self, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        if not scene.laws_as("command"):
            return scene, camera
        given: dict[str, Any] = {self.law.strength[0]: float(values[0])}
        return scene.with_laws(use(self.law, **given)), camera
