"""Which part of a scene a picture shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .walls import outline

if TYPE_CHECKING:
    from .scene import LawUse, Scene

View = tuple[float, float, float, float]  # x low, x high, y low, y high [m]


def is_bed(scene: Scene) -> bool:
    """A scene that fills its box: the view is the box."""
    return bool(scene.periodic_x) and any(b.role == "wall" for b in scene.bodies)


def anchors(scene: Scene) -> list[tuple[LawUse, int, tuple[float, float]]]:
    """Pins and springs: the law, the row of the body, the anchor [m]."""
    found = []
    for item in scene.laws:
        if item.name in ("pin", "spring"):
            anchor = item.values["anchor"]
            found += [(item, int(row), (anchor[0], anchor[1])) for row in scene.rows(item)]
    return found


def view_of(scene: Scene, positions: np.ndarray | None = None) -> View:
    """What a picture should show [m]: the box of a bed, else everything that moves and hangs.

    ``positions``: (..., n, 2) [m], all that have to fit in; left out, the initial ones.
    """
    radius = np.array([b.radius for b in scene.bodies])
    if positions is None:
        positions = np.array([b.initial[:2] if b.initial else (np.nan, np.nan) for b in scene.bodies])
    if is_bed(scene):
        walls = [b for b in scene.bodies if b.role == "wall" and b.initial is not None]
        low = min(b.initial[1] - b.radius for b in walls if b.initial)
        high = max(b.initial[1] + b.radius for b in walls if b.initial)
        return 0.0, float(scene.periodic_x or 1.0), low, high
    xs, ys = [], []
    if len(radius):
        xy = np.asarray(positions, dtype=float).reshape(-1, len(radius), 2)
        xs += [np.nanmin(xy[..., 0] - radius), np.nanmax(xy[..., 0] + radius)]
        ys += [np.nanmin(xy[..., 1] - radius), np.nanmax(xy[..., 1] + radius)]
    for wall in scene.walls:
        corners = outline(wall)
        xs += [float(corners[:, 0].min()), float(corners[:, 0].max())]
        ys += [float(corners[:, 1].min()), float(corners[:, 1].max())]
    for _, _, anchor in anchors(scene):
        xs.append(anchor[0])
        ys.append(anchor[1])
    if scene.periodic_x:
        xs = [0.0, scene.periodic_x]
    x_low, x_high, y_low, y_high = min(xs), max(xs), min(ys), max(ys)
    pad = 0.08 * max(x_high - x_low, y_high - y_low)
    x_low, x_high, y_low, y_high = x_low - pad, x_high + pad, y_low - pad, y_high + pad
    # neither a ribbon nor a needle
    wide, tall = x_high - x_low, y_high - y_low
    if wide > 2.4 * tall:
        y_low, y_high = y_low - (wide / 2.4 - tall) / 2, y_high + (wide / 2.4 - tall) / 2
    elif tall > 1.25 * wide:
        x_low, x_high = x_low - (tall / 1.25 - wide) / 2, x_high + (tall / 1.25 - wide) / 2
    return float(x_low), float(x_high), float(y_low), float(y_high)


def shrunk(view: View, part: float) -> View:
    pad = part * max(view[1] - view[0], view[3] - view[2])
    return view[0] + pad, view[1] - pad, view[2] + pad, view[3] - pad


def inside(inner: View, outer: View) -> bool:
    return inner[0] >= outer[0] and inner[1] <= outer[1] and inner[2] >= outer[2] and inner[3] <= outer[3]
