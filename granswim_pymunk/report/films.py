"""What plays in the page of bodies: the places of every body as recorded and as simulated."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..joints import place
from ..scene import Scene
from .figures import chosen_cases, models, predicted
from .player import MOST_FRAMES, Moving

if TYPE_CHECKING:
    from ..diagnosis.data import Case
    from ..diagnosis.driver import TrackFinding

Hung = tuple[int, "int | tuple[float, float]"]


def _down(scene: Scene) -> np.ndarray:
    """The direction in which a rod hangs at angle 0."""
    down = np.array(scene.gravity if any(scene.gravity) else (0.0, -1.0), dtype=float)
    return down / math.hypot(*down)


def places(case: Case, values: np.ndarray) -> np.ndarray:
    """Places (T, n, 2) [m] of the observed bodies from channels (T, c); of an angle alone by its pin or hinge.

    NaN where a place is not known. Of a rail, of which one coordinate was recorded, the other is zero.
    """
    scene, column = case.recording.scene, {(c.body, c.kind): k for k, c in enumerate(case.channels)}
    found = np.full((len(values), len(case.bodies), 2), np.nan)
    for i, body in enumerate(case.bodies):
        x, y, angle = (column.get((body, kind)) for kind in ("x", "y", "angle"))
        if x is not None or y is not None:
            for axis, k in enumerate((x, y)):
                found[:, i, axis] = 0.0 if k is None else values[:, k]
            continue
        pin = next((item for item in scene.laws_named("pin") if body in (item.bodies or ())), None)
        if pin is not None and angle is not None:
            down, turn = _down(scene), values[:, angle, None]
            end = np.cos(turn) * down + np.sin(turn) * np.array([-down[1], down[0]])
            found[:, i] = np.array(pin.values["anchor"]) + pin.values["length"] * end
    if scene.laws_named("hinge") and not np.isfinite(found).any():
        angles = {body: column[body, "angle"] for body in case.bodies if (body, "angle") in column}
        still = dict.fromkeys(angles, 0.0)
        for frame, row in enumerate(values):
            known = {body: float(row[k]) for body, k in angles.items() if math.isfinite(row[k])}
            for body, state in place(scene, known, still).items():
                found[frame, case.bodies.index(body)] = state[:2]
    return found


def _lines(case: Case) -> list[Hung]:
    """What joins bodies to each other and to the scene: pins, springs, rods, hinges."""
    scene, row = case.recording.scene, {body: i for i, body in enumerate(case.bodies)}
    result: list[Hung] = []
    for item in scene.laws:
        mine = [row[body] for body in item.bodies or () if body in row]
        anchor = item.values.get("anchor")
        if item.name in ("rod", "hinge") and len(item.bodies or ()) == 2:
            if len(mine) == 2:
                result.append((mine[0], mine[1]))
        elif anchor is not None:
            result += [(i, (float(anchor[0]), float(anchor[1]))) for i in mine]
    return result


def film_of(diagnosis: TrackFinding) -> Moving | None:
    """The recording that the figures show first, and what each model makes of it; None where no place is known."""
    case = max(chosen_cases(diagnosis), key=lambda c: c.scored.sum(), default=None)
    if case is None or len(case.t) < 2:
        return None
    keep = np.unique(np.round(np.linspace(0, len(case.t) - 1, min(MOST_FRAMES, len(case.t)))).astype(int))
    panels = {"seen": places(case, case.values[keep])}
    if not np.isfinite(panels["seen"]).any():
        return None
    names = [name for name in models(diagnosis) if name != "recalibrated" or not diagnosis.found]
    for name in names:
        panels[name] = places(case, predicted(diagnosis, name, case)[keep])
    scene = case.recording.scene
    still = [b for b in scene.bodies if not b.mobile and b.initial is not None]
    fixed = np.array([(*b.initial[:2], b.radius) for b in still if b.initial is not None]).reshape(-1, 3)
    walls = np.array([(*wall.begin, *wall.end, wall.radius) for wall in scene.walls]).reshape(-1, 5)
    radius = np.array([scene.body(body).radius for body in case.bodies])
    return Moving(case.t[keep], panels, case.bodies, radius, case.scored[keep], fixed, walls, _lines(case))
