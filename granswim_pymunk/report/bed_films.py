"""What plays in the page of a bed that is seen: a swimmer in windows, as recorded and as predicted from its start."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..inference.windows.judge import disks_of
from .player import Moving

if TYPE_CHECKING:
    from ..inference.windows.model import BedFinding

NEAR = 10.0  # radii of the largest grain around the swimmer's way, within which grains are shown
SHOWN = ("recalibrated", "revised")


def film_of(d: BedFinding) -> Moving | None:
    """Starts and ends of the windows of the first recording, and what each model predicts there; None without any.

    At its start a window is what was seen; a prediction is what was seen less its innovation. Grains are those that
    were recorded near the swimmer.
    """
    bed = d.beds[0]
    names = [name for name in SHOWN if name in d.predicted and (name != "revised" or d.laws)]
    order = np.argsort(bed.starts)
    if not names or not len(order):
        return None
    frames = (bed.starts[order][:, None] + bed.looks).ravel()
    seen = bed.film.xy[frames]
    disks = seen[:, bed.rows]
    shape = (len(order), len(bed.looks), len(bed.rows), 2)
    panels = {"seen": disks}
    for name in names:
        rows = d.likelihood.innovations(d.predicted[name])[0][order]
        off = np.zeros(shape)
        off[:, 1:] = disks_of(rows, bed).reshape(shape[0], shape[1] - 1, *shape[2:])
        panels[name] = disks - off.reshape(-1, *shape[2:])
    ids = [bed.scene.bodies[row].id for row in bed.rows]
    radius = np.array([bed.scene.bodies[row].radius for row in bed.rows])
    held = np.repeat(~bed.training[order], len(bed.looks))
    lines = [(i, i + 1) for i in range(len(ids) - 1)]
    around, sizes = _around(d, seen, disks)
    note = f"Each window of {1e3 * bed.span:.0f} ms begins with what was seen; rings are what is predicted from there."
    return Moving(
        bed.film.t[frames], panels, ids, radius, held, lines=lines, around=around, around_radius=sizes, note=note,
        backdrop=bed.case.recording.film,
    )  # fmt: skip


def _around(d: BedFinding, seen: np.ndarray, disks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(F, g, 2) places [m] of grains near the swimmer's way, also across a seam, and (g,) their radii [m]."""
    bed = d.beds[0]
    grains = seen[:, bed.grains].copy()
    radii = np.array([bed.scene.bodies[row].radius for row in bed.grains])
    known = disks[np.isfinite(disks).all(axis=2)]
    if not len(known) or not len(radii):
        return np.zeros((0, 0, 2)), np.zeros(0)
    low, high = known.min(axis=0), known.max(axis=0)
    period = bed.scene.periodic_x
    if period:
        middle = 0.5 * (low[0] + high[0])
        grains[..., 0] += period * np.round((middle - grains[..., 0]) / period)
    reach = NEAR * float(radii.max())
    with np.errstate(invalid="ignore"):
        near = ((grains > low - reach) & (grains < high + reach)).all(axis=2).any(axis=0)
    return grains[:, near], radii[near]
