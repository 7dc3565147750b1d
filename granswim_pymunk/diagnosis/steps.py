"""How finely the recordings of a diagnosis are simulated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..engine import advise_dt
from .data import Case
from .hypothesis import Failed, Hypothesis, Predictor
from .start import StartBody, describe_starts, first_numbers, states

STEADY = 0.1  # standard deviations that a path may change when its steps are halved
FINER = 4  # times that they are halved at most


def time_steps(cases: Sequence[Case]) -> dict[str, float]:
    """One dt for each recording [s], that of its naive scene with the starts estimated from the tracks.

    It stays the same under every hypothesis, so that differences between hypotheses are physics.
    """
    result = {}
    for case in cases:
        scene = case.recording.scene
        frames = case.start
        described = describe_starts(case, frames)
        placed = states(described, first_numbers(described), scene, float(case.t[0]))
        moving = scene.with_initial(placed)
        dt = scene.time.dt or advise_dt(moving)
        spacing = float(np.median(np.diff(case.t))) if len(case.t) > 1 else dt
        # a whole number of steps between frames, and never fewer than ten; where disks meet, what acts just before they
        # touch has to be seen
        steps = max(int(np.ceil(spacing / dt)), 20 if scene.laws_named("contact_elastic") else 10)
        if any(item.name in ("contact_linear", "contact_hertz") for item in scene.laws):
            steps = _fine_enough(case, described, steps, spacing)
        result[case.name] = spacing / steps
    return result


def _fine_enough(case: Case, described: tuple[StartBody, ...], steps: int, spacing: float) -> int:
    """How many steps a frame are needed for the path not to hang on them, compared with its noise.

    Fifteen steps a contact are right to some 0.1 mm for disks of a centimetre, which a good camera sees. Doubled until
    the rms change is below ``STEADY`` standard deviations, or no smaller than before: then the motion is chaotic.
    """
    numbers, t = first_numbers(described), case.t[case.start]

    def path(steps: int) -> np.ndarray:
        predictor = Predictor({case.name: spacing / steps})
        return predictor(Hypothesis(), case, (), described, numbers, float(t[0]), t) / case.sigma

    try:
        last, before = path(steps), np.inf
        for k in range(FINER):
            now = path(steps * 2 ** (k + 1))
            change = float(np.sqrt(np.nanmean((now - last) ** 2)))
            if change < STEADY:
                return steps * 2**k
            if change > 0.8 * before:
                return steps
            last, before = now, change
    except Failed:
        return steps
    return steps * 2**FINER
