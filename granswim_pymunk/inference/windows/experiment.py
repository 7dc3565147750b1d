"""Which next recording would tell the law that was found from its nearest rival."""

from __future__ import annotations

import math

import numpy as np

from ..criteria import current
from ..hypothesis import Failed, Hypothesis, Term
from ..model import Proposal
from .likelihood import WindowLikelihood, Windows
from .signatures import off
from .trial import BedTrial
from .windows import POOL


def _drive(key: str, factor: float) -> Term:
    def apply(scene, camera, values):
        for item in scene.laws_as("stroke"):
            scene = scene.with_parameter(f"{item.name}.{key}", factor * float(item.values[key]))
        return scene, camera

    return Term("other_drive", f"drive {key} times {factor:g}", (), apply)


def propose(
    likelihood: WindowLikelihood,
    hypothesis: Hypothesis,
    values: np.ndarray,
    found: BedTrial,
    rival: BedTrial,
    windows: Windows,
) -> Proposal | None:
    """The frequency of the drive, or the length of the film, that separates the two best; None where none can be run.

    The winner is simulated throughout under the new drive and filmed; windows of that film are predicted with
    winner and rival, and what the rival and the adjustables can take over is projected out (T-optimal design:
    Atkinson & Fedorov 1975, Biometrika 62, 57).
    """
    number = next(k for k, w in enumerate(windows) if len(w))
    bed, predictor, noise = likelihood.beds[number], likelihood.predictors[number], likelihood.noises[number]
    bending = bed.scene.laws_as("stroke")
    options: list[tuple[str, Term]] = []
    if bending:
        f = float(bending[0].values["frequency"])
        for factor in current().windows.places.drives:
            options.append((f"frequency = {f * factor:.3g} Hz", _drive("frequency", factor)))
    chosen = [int(w) for w in windows[number]][: current().windows.places.windows]

    def weigh(option: tuple[str, Term]) -> float | None:
        plain = Hypothesis((option[1],)).with_term(*hypothesis.terms)
        winner, other = plain.with_term(found.term), plain.with_term(rival.term)
        try:
            film = predictor.replicate(winner, np.concatenate([values, found.values]), 90)
            own = predictor.of(film, 2)
            rows = [
                own.weigh(winner, np.concatenate([values, found.values]), chosen),
                own(other, np.concatenate([values, rival.values]), chosen),
                own(plain, values, chosen),
            ]
            for k, free in enumerate(hypothesis.free):
                moved = values.copy()
                step = current().windows.polish.step * (free.high - free.low)
                moved[k] += step * (1 if values[k] < free.high else -1)
                rows.append(own(plain, np.clip(moved, free.low, free.high), chosen))
        except Failed:
            return None
        late = bed.times[chosen] > bed.film.t[bed.half] + current().windows.places.settle
        means = [r.mean(axis=1) for r in rows]

        def white(difference: np.ndarray) -> np.ndarray:
            full = np.zeros((len(bed.starts), bed.size))
            full[chosen] = difference
            return noise.whiten(full, chosen)[late].ravel()

        taken = np.column_stack([white(m - means[2]) for m in (means[1], *means[3:])])
        left = off(taken, white(means[0] - means[1]))
        share = sum(len(b.starts) for b in likelihood.beds) / max(int(late.sum()), 1)
        return math.sqrt(float(left @ left) * share)

    found_d = list(POOL.map(weigh, options))
    tried = [(text, d) for (text, _), d in zip(options, found_d, strict=True) if d is not None]
    apart = math.sqrt(max((found.gain or found.linear) - (rival.gain or rival.linear), 0.0))
    if 0 < apart < current().windows.places.enough:
        times = min(math.ceil((current().windows.places.enough / apart) ** 2), current().windows.places.longest)
        tried.append((f"film {times} times as long, drive as before", apart * math.sqrt(times)))
    if not tried:
        return None
    change, d = max(tried, key=lambda c: c[1])
    return Proposal(change, (found.mechanism, rival.mechanism), d)
