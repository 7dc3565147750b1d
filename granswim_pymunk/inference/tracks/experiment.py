"""Which next recording would separate the rivals: simulated with the winner, the loser refitted to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..checks import TOOLS, of_the_apparatus
from ..criteria import current
from ..data import Case, driven
from ..hypothesis import Failed, Predictor
from ..model import Proposal
from .fit import Fitter
from .fitted import Fit
from .undeclared import CLOCK


def _shortened(case: Case, most: int) -> Case:
    """The first frames of a long recording: what separates laws shows there, at a fraction of the cost."""
    if len(case.t) <= most:
        return case
    keep = slice(0, most)
    return replace(
        case, t=case.t[keep], values=case.values[keep], training=case.training[keep], start=case.start[keep],
        scored=case.scored[keep], late=None if case.late is None else case.late[keep],
        recording=case.recording.select(keep),
    )  # fmt: skip


def _stretched(case: Case, factor: float) -> Case:
    t = case.t[0] + (case.t - case.t[0]) * factor
    every = np.ones(len(t), dtype=bool)
    return replace(
        case, t=t, values=np.zeros_like(case.values), training=every, start=every, scored=~every, held_out=False
    )


def _commanded(case: Case, larger: float, faster: float) -> Case:
    """With commands so much larger, and running so much faster, again and again, from the first frame on."""
    scene, begin = case.recording.scene, float(case.t[0])

    def changed(t: Sequence[float], value: Sequence[float]) -> tuple[tuple[float, ...], tuple[float, ...]]:
        rows, size = begin + (np.asarray(t) - begin) / faster, larger * np.asarray(value)
        # what was commanded before the film is the beginning; it is told once
        later, passed = rows >= begin, rows[-1] - begin
        again = np.flatnonzero(later)[1:] if faster > 1 else np.zeros(0, dtype=int)
        return tuple(np.append(rows, rows[again] + passed)), tuple(np.append(size, size[again]))

    inputs = {name: changed(*rows) for name, rows in scene.inputs.items()}
    return replace(case, recording=replace(case.recording, scene=replace(scene, inputs=inputs)))


def _free_start(case: Case) -> bool:
    """Whether a body moves that nothing commands: how fast it starts is the experimenter's to choose."""
    scene = case.recording.scene
    led = driven(scene)
    return any(b.mobile and b.id not in led for b in scene.bodies)


def propose(
    winner: Fit,
    loser: Fit,
    names: tuple[str, str],
    cases: Sequence[Case],
    predictor: Predictor,
    stop: Callable[[], bool],
    others: Sequence[tuple[str, Fit]] = (),
) -> Proposal | None:
    """Try longer, faster and wider repeats of the training recordings and return the best.

    others : further mechanisms that do as well, with their fits: where no motion decides and one of them is a fault of
        the apparatus, that is to be measured
    d' is the square root of the chi2 that the loser keeps when it is refitted to the winner's prediction
    (T-optimality: Atkinson & Fedorov 1975, Biometrika 62, 57).
    """
    training = [_shortened(c, current().left.proposal) for c in cases if c.name in winner.starts][:3]
    best: Proposal | None = None
    changes = [("film twice as long", 2.0, 1.0, 1.0)]
    if any(map(_free_start, training)):
        changes += [("start at half the speed", 1.0, 0.5, 1.0), ("start at twice the speed", 1.0, 2.0, 1.0)]
    if any(s.coordinates.swings for case in training for s in winner.start_of(case.name)[0]):
        changes.append(("release at a quarter of the angle", 1.0, 0.25, 0.25))
    orders = dict.fromkeys((text for text, *_ in changes), (1.0, 1.0))
    if any(case.recording.scene.laws_as("command") for case in training):
        orders |= {"command twice as much": (2.0, 1.0), "command the same twice as fast": (1.0, 2.0)}
        changes += [(text, 1.0, 1.0, 1.0) for text in orders if text not in dict(c[:2] for c in changes)]
    for text, longer, faster, wider in changes:
        total = 0.0
        try:
            for case in training:
                synthetic = _commanded(_stretched(case, longer), *orders[text])
                described, numbers = winner.start_of(case.name)
                start = _changed(described, numbers, faster, wider)
                # what is kept of a start is part of its description
                truth = predictor(
                    winner.hypothesis, synthetic, winner.values, described, start, float(synthetic.t[0]), synthetic.t
                )
                replicate = replace(synthetic, values=np.where(np.isfinite(case.values), truth, np.nan))
                inner = Fitter([replicate], predictor, None, stop, whole=True)
                inner.segments = {case.name: tuple(replace(s, starts=described) for s in inner.segments[case.name])}
                few = current().evaluations.proposal
                found = inner.fit(loser.hypothesis, loser.values, {case.name: start}, evaluations=few)
                total += found.chi2
        except Failed:
            continue
        d = float(np.sqrt(total))
        if best is None or d > current().verdict.further * best.d_prime:
            best = Proposal(text, names, d)
    if best is not None and best.d_prime >= current().verdict.decides:
        return best
    told = _apparatus_check(winner, names, training)
    for name, fit in ((names[1], loser), *others):
        if told is None or told.d_prime < current().verdict.decides:
            told = _apparatus_check(fit, (names[0], name), training) or told
    if told is not None and told.d_prime >= current().verdict.decides:
        return told
    if best is None:
        return told
    return replace(best, change=f"none of these would decide: {', '.join(text for text, *_ in changes)}")


def with_clock(told: Proposal | None, name: str, off: float, cases: Sequence[Case]) -> Proposal | None:
    """To film a clock, where a frame rate that is ``off`` by a share does as well as what is named ``name``.

    In place of a motion that does not decide, and beside another check of the apparatus.
    """
    decides = current().verdict.decides
    checks = told is not None and told.change in [text for _, text in TOOLS.values()]
    clock = of_the_apparatus((name, CLOCK), {CLOCK: off}, cases[0].t, lambda: None)
    if clock is None or clock.d_prime < decides or (told is not None and told.d_prime >= decides and not checks):
        return told
    if told is None or told.d_prime < decides:
        return clock
    d_prime = min(told.d_prime, clock.d_prime)
    return Proposal(f"{told.change}, and {clock.change}", (*told.separates, CLOCK), d_prime)


def _apparatus_check(fit: Fit, names: tuple[str, str], cases: Sequence[Case]) -> Proposal | None:
    """Where no other motion separates the apparatus from physics, measure the apparatus itself."""
    case, free = cases[0], fit.hypothesis.free
    off = {f.name: abs(float(v) - f.neutral) for f, v in zip(reversed(free), reversed(fit.values), strict=True)}
    changes = {name: off[key] for name, (key, _) in TOOLS.items() if key in off}

    def picture() -> float | None:
        places = [c for c, channel in enumerate(case.channels) if channel.kind != "angle"]
        if not places:
            return None
        seen = case.values[:, places]
        extent = float(np.max(np.nanmax(seen, axis=0) - np.nanmin(seen, axis=0)))
        return float(np.sqrt(2) * np.max(case.sigma[places])) / extent

    return of_the_apparatus(names, changes, case.t, picture)


def _changed(described, numbers, faster, wider):
    result = numbers.copy()
    at = 0
    for start in described:
        for kind, is_free in zip(start.coordinates.kinds, start.free, strict=True):
            if not is_free:
                continue
            result[at] *= faster if kind in "vs" else wider if kind == "a" else 1.0
            at += 1
    return result
