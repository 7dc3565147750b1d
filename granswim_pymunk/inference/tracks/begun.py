"""First frames in which something else still moves the bodies: a hand that throws, a launcher, a magnet."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..candidates import named_terms
from ..criteria import current
from ..data import Case, frames_of
from ..hypothesis import Failed, Predictor
from ..significance import price
from .fit import Fitter
from .fitted import Fit
from .name import refit
from .pairs import leaders
from .segments import find_cuts
from .signatures import make_bank
from .study import FittedAlone, Study, with_cases


@dataclass(frozen=True)
class _Left:
    """What a hypothesis leaves once the first ``first`` frames are left out.

    gone : numbers in the frames left out;  numbers, laws : that it has beside the scene without a law
    chi2 : that is left, of ``count`` numbers;  noise : whether it passes for noise
    """

    first: int
    gone: int
    numbers: int
    laws: int
    chi2: float
    count: int
    noise: bool

    @property
    def cost(self) -> float:
        """Chi2, and two for each number of the frames left out, and of a law (AIC)."""
        return self.chi2 + 2 * (self.gone + self.numbers)


def _counts(frames: float) -> list[int]:
    """How many first frames are tried, none among them, of so many that are learnt from."""
    criteria = current().release
    counts = np.unique(np.linspace(0, int(criteria.share * frames), criteria.begun + 1).astype(int))
    return [int(k) for k in counts] if len(counts) > 2 else []


def _left(
    case: Case, frames: np.ndarray, counts: Sequence[int], fits: Sequence[Fit], predictor: Predictor,
    stop: Callable[[], bool], **how: Any,
) -> list[list[_Left]]:  # fmt: skip
    """For each count what fits, the first of which is without a law, leave of ``frames`` (T,) but the first ones.

    how : as for ``Fitter.fit``.  Raises Failed.
    """
    rows, scene, found = np.flatnonzero(frames), fits[0].hypothesis, []
    for first in counts:
        later = frames.copy()
        later[rows[:first]] = False
        fitter = Fitter([case], predictor, {case.name: later}, stop)
        gone = int(np.isfinite(case.values[frames & ~later]).sum())
        told = []
        for begin in fits:
            fit, hypothesis = fitter.fit(begin.hypothesis, begin.values, **how), begin.hypothesis
            numbers, laws = len(hypothesis.free) - len(scene.free), len(hypothesis.terms) - len(scene.terms)
            told.append(_Left(first, gone, numbers, laws, fit.chi2, fit.count, not fit.excess))
        found.append(told)
    return found


def without_first_frames(study: Study, tried: FittedAlone) -> Study | None:
    """The study without first frames in which something else moves the bodies; None where there are none.

    A frame that is left out costs as much as a number of its own for each that was measured in it (AIC). So a law that
    acts all along goes before them, as it takes few numbers to say what it does, and so do they before a law that is
    only asked for by what a hand did. Not in recordings with impacts or commands, where motion begins anew anyway.
    """
    if study.fitter.segmented or study.kicked or study.late(current().budget.candidates):
        return None
    cases, notes = list(study.cases), list[str]()
    for at, case in enumerate(cases):
        if case.held_out or case.recording.scene.inputs:
            continue
        out = _out_already(case)
        if first := _first_free(study, tried, case, out > 0) or out:
            cases[at] = _from(case, first)
            notes.append(_said(case, first, float(case.t[np.flatnonzero(case.training)[first]])))
    if not notes:
        return None
    study.notes += notes
    return with_cases(study, cases)


def _first_free(study: Study, tried: FittedAlone, case: Case, out: bool) -> int:
    """How many of the first frames of a recording are none of the motion; ``out``: some are left out already."""
    counts = _counts(case.training.sum())
    if not counts:
        return 0
    used = len(tried.best.values) - len(tried.recalibrated.values)
    try:
        plain, with_laws = _without(study, tried.recalibrated, case, counts[-1])
        fits = [plain, *with_laws]
        if all(fit.excess for fit in fits):
            return _beside_the_rest(study, tried, case, counts, plain)  # something is missing all along
        left = _left(case, case.training, counts, fits, study.predictor, study.stop, stages=study.stages)
    except Failed:
        return 0
    if left[0][0].noise:
        return 0  # nothing asks for it
    fitted = [2 * used + float(np.nansum(tried.best.white[case.name] ** 2))] if case.name in tried.best.white else []
    now = min([*fitted, *(w.cost for w in left[0])])
    # what a hand does is far from any noise, slow noise too, whatever law is there; once it is seen to be there, AIC
    # says up to when
    far = -math.inf if out else current().release.away**2
    best = {laws: min(w.chi2 for w in left[0] if w.laws <= laws) for laws in {w.laws for w in left[0]}}
    found = [w for those in left[1:] for w in those if w.noise and best[w.laws] - w.chi2 > far * max(w.gone, 1)]
    if not found:
        return 0
    least = min(w.cost for w in found)
    alike = [w for w in found if w.cost <= least + current().verdict.same]
    begun = min(alike, key=lambda w: (w.laws, w.first))  # the scene as it is before one with a law
    # what acts all along leaves less the more is left out
    asks = begun.first < counts[-1] and begun.cost < now - (price(len(counts), 1) if begun.laws and not out else 0)
    return begun.first if asks else 0


def _beside_the_rest(study: Study, tried: FittedAlone, case: Case, counts: Sequence[int], late: Fit) -> int:
    """How many first frames leave far more than all later ones do, where these leave more than noise, too.

    Each of their numbers leaves ``ReleaseCriteria.away`` squared times as much as a later one, whatever law that has a
    name is fitted to them, and as much more than the next ones do when they are left out: what is missing later on is
    missing all along, and a law that shows most at first shows a little less from frame to frame. Raises Failed.

    late : the scene without a law, fitted to all but the most first frames
    """
    # a lens bends to whatever a hand does
    fits = [tried.recalibrated, *(t.fit for t in tried.alive if t.fit is not None and not t.special)]
    named = min(float(np.nansum(fit.white[case.name] ** 2)) for fit in fits)
    far, size = current().release.away ** 2, max(late.chi2 / max(late.count, 1), 1.0)
    if named - late.chi2 < far * size * counts[1]:
        return 0
    plain = [tried.recalibrated]
    left = _left(case, case.training, counts, plain, study.predictor, study.stop, stages=study.stages)
    every, last = [each[0] for each in left], left[-1][0]
    begun = min(every, key=lambda w: w.chi2 / size + far * w.gone)
    if not every[0].gone < begun.gone < last.gone:
        return 0
    after = (begun.chi2 - last.chi2) / (last.gone - begun.gone)
    return begun.first if (named - begun.chi2) / begun.gone > far * max(size, after) else 0


def _out_already(case: Case) -> int:
    """How many of the first frames are left out as single sightings; 0 for one, which chance may have made."""
    rows = np.flatnonzero(case.training)
    out = ~np.isfinite(case.values[rows]).any(axis=1) & np.isfinite(case.recording.xy[rows]).any(axis=(1, 2))
    first = int(np.argmin(out))
    return first if first > 1 else 0


def _without(study: Study, plain: Fit, case: Case, first: int) -> tuple[Fit, list[Fit]]:
    """The scene fitted to all frames but the first ones, and with each of the laws that explain most to first order.

    With none where a long film leaves far more than noise so: it is not worth their fits.
    """
    later = _from(case, first)
    fitter = Fitter([later], study.predictor, stop=study.stop)
    fit = fitter.fit(plain.hypothesis, plain.values, {case.name: fitter.begun(plain, later)}, stages=study.stages)
    bank = make_bank(fitter, fit, named_terms([later])).signatures
    ahead = sorted((2 * len(s.directions.T) - s.gain, k) for k, s in enumerate(bank))
    shown = [bank[k] for behind, k in ahead if behind < 0]
    far = current().signatures.far ** 2 * fit.count
    if later.training.sum() > current().refits.staged and fit.chi2 - max((s.gain for s in shown), default=0.0) > far:
        return fit, []
    return fit, [refit(fitter, fit, s, study.stages) for s in leaders(shown, current().sets.seconds)]


def held_out_later(
    cases: Sequence[Case], fits: Sequence[Fit], predictor: Predictor, stop: Callable[[], bool]
) -> tuple[list[Case], list[str]]:
    """Held-out recordings from where nothing else moves the bodies any more, and notes; others as they are.

    Asked once the verdict is fixed, where films that were learnt from begin in a hand. The numbers of ``fits``, without
    a law and with what was found, stay; starts are fitted. What is left need not be noise, as numbers are not exact:
    it is held against the size of what the best leaves.
    """
    found, notes = list[Case](), list[str]()
    for case in cases:
        frames = case.start | case.scored
        asked = case.held_out and not find_cuts(case) and not case.recording.scene.inputs
        first = _first_free_held_out(case, frames, fits, predictor, stop) if asked else 0
        if first:
            row = int(np.flatnonzero(frames)[first])
            _, start, scored = frames_of(case.t, case.values, row, held_out=True, split=False)
            case = replace(case, start=start & frames, scored=scored & frames)
            notes.append(_said(case, first, float(case.t[row])))
        found.append(case)
    return found, notes


def _first_free_held_out(
    case: Case, frames: np.ndarray, fits: Sequence[Fit], predictor: Predictor, stop: Callable[[], bool]
) -> int:
    counts = _counts(current().split.training * frames.sum())
    if not counts:
        return 0
    try:
        left = _left(case, frames, counts, fits, predictor, stop, fixed=True)
    except Failed:
        return 0
    least = min((w for those in left for w in those), key=lambda w: w.chi2)
    size = max(least.chi2 / max(least.count, 1), 1.0)
    chi2, gone = np.array([min(w.chi2 for w in those) for those in left]), np.array([those[0].gone for those in left])
    cost = chi2 / size + 2 * gone
    k = int(np.flatnonzero(cost <= cost.min() + current().verdict.same)[0])
    far = chi2[0] - chi2[k] > current().release.away ** 2 * size * gone[k]
    return counts[k] if 0 < k < len(counts) - 1 and far else 0


def _said(case: Case, first: int, begins: float) -> str:
    frames = f"{first} frames are" if first > 1 else "frame is"
    return (
        f"{case.name}: the first {frames} left out, up to t = {begins:.4g} s: bodies move there as nothing in the "
        "scene moves them, as in a hand or a launcher"
    )


def _from(case: Case, first: int) -> Case:
    """The recording, learnt from its ``first`` training frame on, counted from none."""
    gone = np.zeros(len(case.t), dtype=bool)
    gone[np.flatnonzero(case.training)[:first]] = True
    return replace(case, training=case.training & ~gone, start=case.start & ~gone)
