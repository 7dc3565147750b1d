"""How finely the recordings of a diagnosis are simulated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...engine import advise_dt
from ..criteria import current
from ..data import Case
from ..hypothesis import Failed, Hypothesis, Predictor
from ..linear import project
from ..start import StartBody, describe_starts, first_numbers, states
from .fit import Fitter
from .fitted import Fit


def shifts(fitter: Fitter, fit: Fit, spread: float) -> np.ndarray:
    """By how many of its standard errors each number (p,) would move if the steps were half as long.

    One Gauss-Newton step, (J'J)^-1 J' (r_half - r) over numbers and starts, J and r those of the fit: one run of each
    recording. Empty where a run with the shorter steps fails.
    """
    p = len(fit.values)
    finer = Predictor({name: dt / 2 for name, dt in fitter.predictor.dt.items()})
    information, gradient = np.zeros((p, p)), np.zeros(p)
    for case in fitter.cases:
        by_value, by_start = fit.jacobian[case.name]
        half = Fitter([case], finer, {case.name: fitter.frames[case.name]})
        half.segments = {case.name: fit.segments[case.name]}
        here = fitter.vector(case, fit.hypothesis, fit.values, fit.starts[case.name])
        there = half.vector(case, fit.hypothesis, fit.values, fit.starts[case.name])
        worst = max(np.abs(here).max(initial=0.0), np.abs(there).max(initial=0.0))
        if len(here) != len(there) or worst >= current().fits.hopeless:
            return np.zeros(0)
        change = (there - here) * fit.roots(case.name)
        values = by_value - project(by_start, by_value)
        information += values.T @ values
        gradient += values.T @ change
    size = np.sqrt(np.diag(information))
    told = size > 0
    result = np.zeros(p)
    if told.any():
        scaled = information[np.ix_(told, told)] / np.outer(size[told], size[told])
        step = np.linalg.lstsq(scaled, gradient[told] / size[told], rcond=1e-9)[0] / size[told]
        # no variance is below that of a number alone, whatever rounding makes of the inverse
        error = np.sqrt(np.maximum(np.diag(fit.covariance)[told], 1 / size[told] ** 2) * spread)
        result[told] = np.abs(step) / error
    return result


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
        # a whole number of steps between frames, and never too few; where disks meet, what acts just before they touch
        # has to be seen
        criteria = current().fits
        least = criteria.steps_met if any(i.law.kind == "impulse" for i in scene.laws) else criteria.steps
        steps = max(int(np.ceil(spacing / dt)), least)
        if any(item.law.kind == "pair" for item in scene.laws_as("contact")):
            steps = _fine_enough(case, described, steps, spacing)
        result[case.name] = spacing / steps
    return result


def short(fitter: Fitter) -> bool:
    """Whether no run, from segment to segment, takes as many steps as threads need (``WorkCriteria.alone``)."""
    longest = 0.0
    for case in fitter.cases:
        lasts = max(float(np.ptp(case.t[s.frames])) for s in fitter.segments[case.name])
        longest = max(longest, len(case.recording.scene.bodies) * lasts / fitter.predictor.dt[case.name])
    return longest < current().work.alone


def _fine_enough(case: Case, described: tuple[StartBody, ...], steps: int, spacing: float) -> int:
    """How many steps a frame are needed for the path not to hang on them, compared with its noise.

    Fifteen steps a contact are right to some 0.1 mm for disks of a centimetre, which a good camera sees. Doubled until
    the rms change is small beside the noise, or no smaller than before: then the motion is chaotic.
    """
    numbers, t = first_numbers(described), case.t[case.start]

    def path(steps: int) -> np.ndarray:
        predictor = Predictor({case.name: spacing / steps})
        return predictor(Hypothesis(), case, (), described, numbers, float(t[0]), t) / case.sigma

    try:
        last, before = path(steps), np.inf
        for k in range(current().fits.finer):
            now = path(steps * 2 ** (k + 1))
            change = float(np.sqrt(np.nanmean((now - last) ** 2)))
            if change < current().fits.steady:
                return steps * 2**k
            if change > current().fits.chaotic * before:
                return steps
            last, before = now, change
    except Failed:
        return steps
    return steps * 2 ** current().fits.finer
