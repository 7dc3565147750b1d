"""What plays in the page of bodies: the places of every body as recorded and as simulated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .player import MOST_FRAMES, Moving
from .track_drawing import chosen_cases, end_of_rod, hinged_places, models, predicted

if TYPE_CHECKING:
    from ..inference.data import Case
    from ..inference.tracks.model import TrackFinding

Hung = tuple[int, "int | tuple[float, float]"]


def places(case: Case, values: np.ndarray) -> np.ndarray:
    """Places (T, n, 2) [m] of the observed bodies from channels (T, c); of an angle alone by its pin or hinge.

    NaN where a place is not known. On a rail, the coordinate that was not recorded is that of the rail.
    """
    scene, column = case.recording.scene, {(c.body, c.kind): k for k, c in enumerate(case.channels)}
    railed = case.recording.on_rails()
    turned = hinged_places(case, values)
    found = np.full((len(values), len(case.bodies), 2), np.nan)
    for i, body in enumerate(case.bodies):
        seen = [column.get((body, kind)) for kind in "xy"]
        angle = column.get((body, "angle"))
        if any(k is not None for k in seen):
            across = railed.xy[:, railed.ids.index(body)]
            for axis, k in enumerate(seen):
                found[:, i, axis] = np.nanmedian(across[:, axis]) if k is None else values[:, k]
        elif body in turned:
            found[:, i] = turned[body]
        elif angle is not None:
            end = end_of_rod(scene, body, values[:, angle])
            if end is not None:
                found[:, i] = end
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
    return Moving(
        case.t[keep], panels, case.bodies, radius, case.scored[keep], fixed, walls, _lines(case),
        backdrop=case.recording.film,
    )  # fmt: skip
