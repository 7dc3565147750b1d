"""Where a fault of the apparatus is one of two rivals: measure the apparatus itself."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .criteria import current
from .model import Proposal

# mechanism to the name of its number and what measures it
TOOLS = {
    "camera_scale": ("camera.scale", "film a ruler in the same picture"),
    "camera_tilt": ("camera.tilt", "film a plumb line in the same picture"),
    "camera_foreshortening": ("camera.foreshortening", "film a ruler along x and along y in the same picture"),
    "time_offset": ("camera.time_offset", "film a flash that the apparatus triggers"),
}


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
        resolution = within if name == "time_offset" else picture()
        if resolution is not None:
            return Proposal(TOOLS[name][1], names, changes[name] / resolution)
    return None
