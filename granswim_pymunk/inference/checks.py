"""Where a fault of the apparatus is one of two rivals: measure the apparatus itself."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .criteria import current
from .model import Proposal

# mechanism to the name of its number and what measures it
TOOLS = {
    "camera_scale": (
        "camera.scale", "film a ruler in the same picture, at the depth of the motion, along and across it"
    ),
    "camera_tilt": ("camera.tilt", "film a plumb line in the same picture"),
    "camera_foreshortening": (
        "camera.foreshortening", "film a ruler along x and along y in the same picture, at the depth of the motion"
    ),
    "time_offset": ("camera.time_offset", "film a flash that the apparatus triggers"),
    "frame_rate": ("camera.rate", "film a clock, or a lamp that blinks at a known rate"),
}  # fmt: skip


def of_the_apparatus(
    names: tuple[str, str], changes: dict[str, float], t: np.ndarray, picture: Callable[[], float | None]
) -> Proposal | None:
    """The check that tells the first of ``names`` that one measures from the other, None where there is none.

    changes : by mechanism how far its number is from none;  t : (T,) times of frames [s];  picture : how well a
    ruler or a plumb line tells, None where nothing is seen of it
    """
    for name in names:
        if name not in TOOLS or name not in changes:
            continue
        # a frame, evenly distributed
        within = current().apparatus.within_frame * float(np.median(np.diff(t)))
        # two moments, read off a clock to that, tell the rate of a film between them
        clocks = {"time_offset": within, "frame_rate": math.sqrt(2.0) * within / max(float(np.ptp(t)), within)}
        resolution = clocks[name] if name in clocks else picture()
        if resolution is not None:
            return Proposal(TOOLS[name][1], names, changes[name] / resolution)
    return None
