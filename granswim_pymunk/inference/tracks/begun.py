"""First frames in which something else still moves the bodies: a hand that throws, a launcher, a magnet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

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
    """What is left once the first ``first`` frames are left out.

    cost : chi2 that is left, and twice as many as there are numbers: of the frames left out, and of a law;
    noise : whether it passes for noise;  laws : how many there are
    gone : numbers in the frames left out;  chi2 : that is left
    """

    first: int
    cost: float
    noise: bool
    laws: int
    gone: int
    chi2: float

    @classmethod
    def of(cls, study: Study, case: Case, first: int, fits: Sequence[Fit]) -> list[_Left]:
        """With the hypotheses of fits to fewer frames, the first of which is that of the scene without a law."""
        later, scene = _from(case, first), fits[0].hypothesis
        fitter = Fitter([later], study.predictor, stop=study.stop)
        gone = int(np.isfinite(case.values[case.training & ~later.training]).sum())
        told = []
        for begin in fits:
            fit = fitter.fit(begin.hypothesis, begin.values, stages=study.stages)
            numbers, laws = (len(getattr(fit.hypothesis, k)) - len(getattr(scene, k)) for k in ("free", "terms"))
            told.append(cls(first, fit.chi2 + 2 * (gone + numbers), fit.excess == 0, laws, gone, fit.chi2))
        return told


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
        asked = not (case.held_out or case.recording.scene.inputs)
        first = (_first_free(study, tried, case) or _out_already(case)) if asked else 0
        if first:
            cases[at] = _from(case, first)
            notes.append(_said(case, first, float(case.t[np.flatnonzero(case.training)[first]])))
    if not notes:
        return None
    study.notes += notes
    return with_cases(study, cases)


def _first_free(study: Study, tried: FittedAlone, case: Case) -> int:
    """How many of the first frames of a recording are none of the motion."""
    criteria = current().release
    most = int(criteria.share * case.training.sum())
    counts = [int(k) for k in np.unique(np.linspace(0, most, criteria.begun + 1).astype(int))]
    if len(counts) < 3:
        return 0
    used = len(tried.best.values) - len(tried.recalibrated.values)
    try:
        plain, with_laws = _without(study, tried.recalibrated, case, counts[-1])
        if not any(_is_noise(fit) for fit in (plain, *with_laws)):
            return 0  # something is missing all along
        left = [_Left.of(study, case, k, [plain, *with_laws]) for k in counts]
    except Failed:
        return 0
    if left[0][0].noise:
        return 0  # nothing asks for it
    fitted = [2 * used + float(np.nansum(tried.best.white[case.name] ** 2))] if case.name in tried.best.white else []
    now = min([*fitted, *(w.cost for w in left[0])])
    # what a hand does is far from any noise, slow noise too, whatever law is there; once it is seen to be there, AIC
    # says up to when
    out = _out_already(case) > 0
    far = -math.inf if out else criteria.away**2
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


def _out_already(case: Case) -> int:
    """How many of the first frames are left out as single sightings; 0 for one, which chance may have made."""
    rows = np.flatnonzero(case.training)
    out = ~np.isfinite(case.values[rows]).any(axis=1) & np.isfinite(case.recording.xy[rows]).any(axis=(1, 2))
    first = int(np.argmin(out))
    return first if first > 1 else 0


def _is_noise(fit: Fit) -> bool:
    return fit.excess == 0


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


def held_out_later(cases: Sequence[Case], fits: Sequence[Fit], predictor: Predictor) -> tuple[list[Case], list[str]]:
    """Held-out recordings from where nothing else moves the bodies any more, and notes; others as they are.

    Asked once the verdict is fixed, where films that were learnt from begin in a hand. The numbers of ``fits``, without
    a law and with what was found, stay; starts are fitted. What is left need not be noise, as numbers are not exact:
    it is held against the size of what the best leaves.
    """
    found, notes = list[Case](), list[str]()
    for case in cases:
        asked = case.held_out and len(find_cuts(case)) == 0 and not case.recording.scene.inputs
        first = _first_free_held_out(case, fits, predictor) if asked else 0
        if first:
            _, start, scored = frames_of(case.t, case.values, first, held_out=True, split=False)
            case = replace(case, start=start, scored=scored)
            notes.append(_said(case, first, float(case.t[first])))
        found.append(case)
    return found, notes


def _first_free_held_out(case: Case, fits: Sequence[Fit], predictor: Predictor) -> int:
    criteria, frames = current().release, case.start | case.scored
    rows = np.flatnonzero(frames)
    most = int(criteria.share * current().split.training * len(rows))
    counts = [int(k) for k in np.unique(np.linspace(0, most, criteria.begun + 1).astype(int))]
    if len(counts) < 3:
        return 0
    told: list[list[tuple[float, int, int]]] = []  # chi2 that each leaves, how many numbers, and how many are left out
    try:
        for k in counts:
            later = frames.copy()
            later[rows[:k]] = False
            fitter = Fitter([case], predictor, {case.name: later})
            gone = int(np.isfinite(case.values[frames & ~later]).sum())
            left = (fitter.fit(fit.hypothesis, fit.values, None, fixed=True) for fit in fits)
            told.append([(fit.chi2, fit.count, gone) for fit in left])
    except Failed:
        return 0
    chi2, count, _ = min(entry for those in told for entry in those)
    size = max(chi2 / max(count, 1), 1.0)
    cost = np.array([min(chi2 / size + 2 * gone for chi2, _, gone in those) for those in told])
    k = int(np.flatnonzero(cost <= cost.min() + current().verdict.same)[0])
    fall = min(chi2 for chi2, _, _ in told[0]) - min(chi2 for chi2, _, _ in told[k])
    far = fall > criteria.away**2 * size * told[k][0][2]
    return counts[k] if 0 < k < len(counts) - 1 and far else 0


def _said(case: Case, first: int, begins: float) -> str:
    return (
        f"{case.name}: the first {first} frames are left out, up to t = {begins:.4g} s: bodies move there as nothing "
        "in the scene moves them, as in a hand or a launcher"
    )


def _from(case: Case, first: int) -> Case:
    """The recording, learnt from its ``first`` training frame on, counted from none."""
    gone = np.zeros(len(case.t), dtype=bool)
    gone[np.flatnonzero(case.training)[:first]] = True
    return replace(case, training=case.training & ~gone, start=case.start & ~gone)
