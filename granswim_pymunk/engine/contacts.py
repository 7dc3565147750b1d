"""Which bodies touch, and with what forces, as a run stands."""

from __future__ import annotations

import numpy as np

from ..snapshot import Contacts
from .backends.base import Backend


def overlaps(run: Backend) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Overlapping pairs that a pair law acts on: rows i, j of ``scene.bodies``, and overlap/smaller radius."""
    raw = run.raw()
    i, j = run.pairs_within(raw)
    radius, rows = run.state.bodies.radius, run.order.rows_of
    overlap = radius[i] + radius[j] - np.hypot(*run.way(raw, i, j))
    return rows[i], rows[j], overlap / np.minimum(radius[i], radius[j])


def contacts(run: Backend) -> Contacts:
    """Touching pairs with the normal force of all pair laws, velocities at the time of the positions."""
    raw = run.synchronised()
    i, j = run.pairs_within(raw)
    dx, dy = run.way(raw, i, j)
    distance = np.hypot(dx, dy)
    normal = np.column_stack([dx, dy]) / np.where(distance > 0, distance, 1.0)[:, None]
    force = run.pair_forces(i, j, normal, raw) if len(i) else np.zeros(0)
    first, second = run.order.rows_of[i], run.order.rows_of[j]
    flip = first > second
    normal[flip] *= -1
    radius = run.state.bodies.radius
    return Contacts(
        np.where(flip, second, first), np.where(flip, first, second), normal, force, radius[i] + radius[j] - distance
    )
