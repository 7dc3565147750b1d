"""A body that enters the picture after what is learnt from: nothing says how it starts, and it is left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..recording import Recording
from ..scene import Scene
from .criteria import current


def without_latecomers(recording: Recording, share: float) -> tuple[Recording, list[str]]:
    """The recording without bodies that are seen too few times in its first ``share``, and notes that say so.

    A start is fitted to those frames alone. Where such a body comes near another one, all frames from then on are left
    out, as what it does to that is not known. A body that a joint holds stays, and so do all where no other is seen.
    """
    t = recording.t
    early = t <= t[0] + share * (t[-1] - t[0])
    seen, least = recording.seen, current().noise.sightings
    held = {b for ids in recording.scene.joints_of.values() for b in ids}
    late = [
        k for k, name in enumerate(recording.ids)
        if seen[early, k].sum() < least <= seen[:, k].sum() and name not in held
        and recording.scene.body(name).mobile and name not in recording.scene.inputs
    ]  # fmt: skip
    if not late or not (seen[early].sum(axis=0) >= least).any():
        return recording, []
    names = {recording.ids[k] for k in late}
    near = _first_near(recording, late)
    kept = [k for k in range(len(recording.ids)) if k not in late]
    less = replace(
        recording, scene=_without(recording.scene, names), ids=tuple(recording.ids[k] for k in kept),
        xy=recording.xy[:, kept], angle=None if recording.angle is None else recording.angle[:, kept],
    ).select(slice(0, near))  # fmt: skip
    told = f"{recording.name}: {', '.join(sorted(names))} first seen after what is learnt from, and left out"
    return less, [told + ("" if near == len(t) else f"; all frames from t = {t[near]:.4g} s on are, as it comes near")]


def _first_near(recording: Recording, late: list[int]) -> int:
    """The first row in which one of these bodies is nearer to another than both are wide; how many rows there are."""
    radius = np.array([recording.scene.body(name).radius for name in recording.ids])
    others = [k for k in range(len(radius)) if k not in late]
    first = len(recording.t)
    for k in late:
        away = np.hypot(*np.moveaxis(recording.xy[:, others] - recording.xy[:, [k]], -1, 0))
        rows = np.flatnonzero((away < 2 * (radius[others] + radius[k])).any(axis=1))
        first = min(first, int(rows[0])) if len(rows) else first
    return first


def _without(scene: Scene, names: set[str]) -> Scene:
    """The scene without some bodies, and without the laws that act on these alone."""
    laws = []
    for item in scene.laws:
        left = None if item.bodies is None else tuple(b for b in item.bodies if b not in names)
        if left is None or left:
            laws.append(replace(item, bodies=left))
    return replace(scene, bodies=tuple(b for b in scene.bodies if b.id not in names), laws=tuple(laws))
