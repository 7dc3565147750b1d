"""Masses and radii that are known, but not exactly: numbers with a prior, fitted beside whatever is tried.

Through an impact an error b of the sum R of two radii turns the line of centres by about b/R, and within some diameters
that is seen. A fit with exact radii takes it for whatever else bends paths a little: a scale of the picture, a drag
near the walls. So radii (and masses, where the recording says how well they are known) of bodies that met are numbers
of every fit, held to what is believed by a Gaussian prior. Source: Tarantola 2005, Inverse Problem Theory, ch. 3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..inference.criteria import current
from ..scene import Scene
from .data import Case
from .hypothesis import Free, Term
from .segments import find_impacts


def believed_terms(cases: Sequence[Case]) -> tuple[Term, ...]:
    """A term for every radius and mass that is not known exactly, of bodies that met in what is learned from.

    Where nothing was said of them, radii are as uncertain as ``criteria.segments.depth``, and masses are exact. A body
    with the same id, radius and mass in two recordings is the same body, and off by the same.
    """
    met: dict[tuple[str, float, float], Case] = {}
    for case in cases:
        names = {n for i in find_impacts(case) if case.training[i.row] for n in i.met} if not case.held_out else ()
        for name in sorted(names):
            body = case.recording.scene.body(name)
            met.setdefault((name, body.radius, body.mass), case)
    terms = []
    for (name, radius, mass), case in met.items():
        where = frozenset(
            c.name for c in cases for b in c.recording.scene.bodies if (b.id, b.radius, b.mass) == (name, radius, mass)
        )
        errors = {"radius": case.recording.radius_error, "mass": case.recording.mass_error}
        if errors["radius"] is None:
            errors["radius"] = current().segments.depth
        if not case.recording.scene.body(name).mobile:
            del errors["mass"]
        for what, error in errors.items():
            if error:
                most = min(current().candidates.believed * error, 0.5)
                free = Free(error_name(what, name), "1", -most, most, 0.0, error, where, 0.0, prior=error)
                terms.append(Term(f"{what}_error", free.name, (free,), _Off(what, name), (name,), free.name))
    return tuple(terms)


def error_name(what: str, body: str) -> str:
    """The name of the number that says by which share the ``mass`` or ``radius`` of a body is off."""
    return f"{what}_error[{body}]"


def with_error(scene: Scene, what: str, body: str, share: float) -> Scene:
    """The scene with the ``mass`` or ``radius`` of a body larger by a share."""
    bodies = tuple(replace(b, **{what: getattr(b, what) * (1.0 + share)}) if b.id == body else b for b in scene.bodies)
    return replace(scene, bodies=bodies)


class _Off:
    """Makes a radius or mass larger by the share that was found."""

    def __init__(self, what: str, body: str) -> None:
        self.what, self.body = what, body

    def __call__(self, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        return with_error(scene, self.what, self.body, float(values[0])), camera
