"""What plays in the page of a bed that is not seen: one cycle of the swimmer's mean motion, seen and predicted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..inference.packings.checks import prediction
from .player import Moving
from .unseen_figures import models

if TYPE_CHECKING:
    from ..inference.packings.conclude import Finding

FRAMES = 73  # of one cycle, first and last alike but for the drift


def film_of(f: Finding) -> Moving | None:
    """The means and harmonics that are compared, as the motion they describe; None where there are curves alone.

    Single frames cannot be compared where the grains are not seen: a simulation has them in other places.
    """
    s = f.search
    tracked = [c for c in s.training if not c.any_view.curve]
    if not tracked:
        return None
    c = tracked[0]
    view = s.means.view(c)
    phases = np.linspace(0.0, 2 * math.pi, FRAMES)
    panels = {"seen": view.places(c.seen, phases)}
    names = models(f)
    for name in names if "revised" not in names else [n for n in names if n != "recalibrated"]:
        found = prediction(f, s.means, c, name)
        if found is not None:
            panels[name] = view.places(found[0], phases)
    bodies = [c.scene.bodies[row] for row in c.rows]
    lines = [(i, i + 1) for i in range(len(bodies) - 1)]
    note = (
        "One cycle of the drive, t from the phase 0: the mean motion that is compared, made of means, harmonics and "
        "drift, each centred at half time. Predictions are means over packings."
    )
    return Moving(
        phases / (2 * math.pi * c.frequency), panels, [b.id for b in bodies], np.array([b.radius for b in bodies]),
        np.zeros(FRAMES, dtype=bool), lines=lines, note=note,
    )  # fmt: skip
