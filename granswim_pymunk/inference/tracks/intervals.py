"""Intervals of numbers that only together are known, or known unevenly: a profile of chi2 in place of its curvature.

Where a drag is adjustable and a flow is missing, c (v - u) shows as c u and as c plus the other drag: any c will do,
with a u to match. The curvature at one place of such a valley says nothing of how far it goes, and it bends. Where all
impacts end without slip, any larger friction says the same, and curvature is none.
Source: Venzon & Moolgavkar 1988, Applied Statistics 37, 87.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.optimize import brentq

from ... import distributions as stats
from ...laws import all_laws
from ..candidates import with_numbers
from ..criteria import current
from ..data import Case
from ..hypothesis import Hypothesis, Term
from ..linear import project
from ..mechanisms import APPARATUS
from ..noise import averaged
from ..significance import half_interval
from .believed import error_name, with_error
from .fit import Fitter, side_by_side
from .fitted import Fit, covariance_of, information_of
from .innovations import seen_by
from .signatures import columns_of, stacked


def with_limits(fitter: Fitter, fit: Fit, first: int, spread: float, late: Callable[[], bool] = lambda: False) -> Fit:
    """The fit with sharp derivatives, and with profiles for its numbers from ``first`` on that are not known alone.

    spread : inflation of variances by what the fit leaves;  late : stops between two numbers
    """
    fit = fitter.sharpened(fit)
    uneven: list[int] = []
    probes: dict[int, tuple[tuple[float, float] | None, Fit]] = {}
    rows = range(first, len(fit.values))

    def probed(own: Fitter, k: int, fit: Fit) -> tuple[tuple[float, float] | None, Fit] | None:
        return None if late() else _probe(own, fit, k, spread)

    for _ in range(current().intervals.again):
        found = side_by_side(fitter, [partial(probed, k=k, fit=fit) for k in rows])
        probes = {k: probe for k, probe in zip(rows, found, strict=True) if probe is not None}
        uneven = [k for k, (ends, _) in probes.items() if ends is None]
        lowest = min((best for _, best in probes.values()), key=lambda f: f.chi2, default=fit)
        if lowest.chi2 > fit.chi2 - spread or late():
            break
        # the fit was not at its end yet
        better = fitter.fit(fit.hypothesis, lowest.values, lowest.starts, evaluations=current().intervals.evaluations)
        fit = fitter.sharpened(min(lowest, better, key=lambda f: f.chi2))
    told = information_of(fit.jacobian, len(fit.values))
    limits = {k: both for k, (both, _) in probes.items() if both is not None and _lopsided(fit, k, both, spread)}

    def ended(own: Fitter, k: int, side: float) -> float | None:
        free = fit.hypothesis.free[k]
        least = current().intervals.at_first * (abs(float(fit.values[k]) - free.neutral) or free.scale)
        step = min(current().intervals.normal / math.sqrt(told[k, k]), least) if told[k, k] > 0 else least
        return None if late() else _end(own, fit, k, spread, side, step)

    open_ = [k for k in sorted({*unknown_alone(told), *uneven}) if k >= first]
    ends = iter(side_by_side(fitter, [partial(ended, k=k, side=side) for k in open_ for side in (-1.0, 1.0)]))
    for k, low, high in zip(open_, ends, ends, strict=True):
        if low is not None and high is not None:
            limits[k] = low, high
    return replace(fit, limits=limits, profiles=limits) if limits else fit


def _lopsided(fit: Fit, k: int, ends: tuple[float, float], spread: float) -> bool:
    """Whether the ends of an interval are not where its curvature puts them, by more than a part of its half."""
    half = half_interval(float(fit.covariance[k, k]) * spread)
    away = (float(fit.values[k]) - ends[0]) / half, (ends[1] - float(fit.values[k])) / half
    return any(abs(part - 1) > current().intervals.lopsided for part in away)


def _probe(fitter: Fitter, fit: Fit, k: int, spread: float) -> tuple[tuple[float, float] | None, Fit]:
    """The ends of 95 % of a number where chi2 rises about as its curvature says, None where it does not.

    It is looked at where curvature puts them, the other numbers fitted: there it should have risen by ``LEVEL``. As it
    rises with the square of the distance, a rise by R puts the end at sqrt(LEVEL/R) of that. Also the best of these
    fits, or the one that was given.
    """
    variance, best = float(fit.covariance[k, k]), fit
    if not variance > 0:
        return None, best
    free, as_told = fit.hypothesis.free[k], True
    away = current().intervals.normal * math.sqrt(spread / variance) * fit.covariance[:, k]
    bounds = np.array([(f.low, f.high) for f in fit.hypothesis.free]).T
    ends = []
    for side in (-1.0, 1.0):
        values = fit.values + side * away
        ends.append(float(values[k]))
        if not free.low <= values[k] <= free.high:
            continue  # it is cut there
        criteria = current().intervals
        found = fitter.fit(
            fit.hypothesis, np.clip(values, *bounds), fit.starts, held=(k,), evaluations=criteria.probe, near=fit
        )
        best = min(best, found, key=lambda f: f.chi2)
        rise = (found.chi2 - fit.chi2) / (criteria.level * spread)
        as_told = as_told and 1 / criteria.unlike < rise < criteria.unlike
        if as_told:
            ends[-1] = float(fit.values[k] + side * away[k] / math.sqrt(rise))
    return (ends[0], ends[1]) if as_told else None, best


def unknown_alone(information: np.ndarray) -> list[int]:
    """Numbers of an information matrix (p, p) of whose information the others take nearly all."""
    size = np.sqrt(np.diag(information))
    shown = np.flatnonzero(size > 0)
    if len(shown) < 2:
        return []
    part = (information / np.outer(size, size).clip(1e-300))[np.ix_(shown, shown)]
    # of a singular matrix the inverse of what it lacks is huge
    inverse = np.linalg.inv(part + 1e-9 * np.eye(len(part)))
    return [int(k) for k, wide in zip(shown, np.diag(inverse), strict=True) if wide * current().intervals.alone > 1]


def with_believed_errors(fitter: Fitter, fit: Fit, spread: float) -> Fit:
    """The fit with the variance that errors of the believed masses and radii add to its numbers.

    ``mass_error`` and ``radius_error`` of the recordings are standard deviations of relative errors b, one of each for
    every body: nuisances with a prior. With J and M the derivatives of the prediction by the numbers and by b over its
    standard deviation, starts projected out, the covariance of both is ([J M]'[J M]/spread + diag(0, 1))^-1: of the
    numbers alone J'J/spread would be left, the difference is added.
    """
    p = len(fit.values)
    fitted = {free.name for free in fit.hypothesis.free if free.prior}
    nuisances = dict.fromkeys(key for case in fitter.cases for key, _, _ in _believed(case, fitted))
    if not p or not nuisances:
        return fit
    place = {key: p + k for k, key in enumerate(nuisances)}
    told = np.zeros((p + len(place), p + len(place)))
    for case in fitter.cases:
        by_value, by_start = fit.jacobian[case.name]
        both = np.hstack([by_value, np.zeros((len(by_value), len(place)))])
        for key, low, high in _believed(case, fitted):
            below, above = (fitter.vector(c, fit.hypothesis, fit.values, fit.starts[case.name]) for c in (low, high))
            # of two runs, so much of a standard deviation to either side
            both[:, place[key]] = (below - above) / (2 * current().intervals.sizes) * fit.roots(case.name)
        both = both - project(by_start, both)
        told += both.T @ both / spread
    alone = np.linalg.pinv(told[:p, :p])
    whole = np.linalg.pinv(told + np.diag([0.0] * p + [1.0] * len(place)))[:p, :p]
    return replace(fit, believed=whole - alone)


def precision(covariance: np.ndarray) -> np.ndarray:
    """(p,) of numbers by themselves, the others held: the diagonal of the inverse of their covariance (p, p)."""
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return np.diag(np.linalg.pinv(covariance / np.outer(size, size), hermitian=True)) / size**2


def with_doubt(fitter: Fitter, fit: Fit, first: int, spread: float) -> Fit:
    """The fit with limits of its numbers from ``first`` on that hold what other noise would make of them, too.

    A fit knows one likely size and memory of the slow part of the noise, or none where it is not sure of one. Numbers
    are estimated again, to first order, with each slow part that the residuals may have (``noise.averaged``): an
    interval reaches from the lower to the higher end of both.
    """
    recordings, p = seen_by(fit, fitter.cases), len(fit.values)
    if p <= first or not recordings:
        return fit
    moved, covariance = averaged(recordings)
    limits = dict(fit.limits)
    # of a number by itself, as what only several are known by together has a variance of rounding alone
    told, known = np.diag(information_of(fit.jacobian, p)) / spread, precision(covariance)
    for k in range(first, p):
        value, low, high = replace(fit, believed=None).interval(k, spread)
        below = above = half_interval(float(covariance[k, k]))
        if k in fit.profiles:  # which keep their shape
            share = max(math.sqrt(told[k] / known[k]), 1.0) if known[k] > 0 else 1.0
            below, above = (value - low) * share, (high - value) * share
        limits[k] = min(low, value + float(moved[k]) - below), max(high, value + float(moved[k]) + above)
    return replace(fit, limits=limits)


def with_slopes(fitter: Fitter, fit: Fit, first: int, spread: float, terms: Sequence[Term]) -> Fit:
    """The fit with limits of its laws' numbers from ``first`` on that hold what they are where nothing is quite level.

    No table is, nor a picture with gravity in it, and what nobody notices of it is not named. Such slopes e, each over
    the size that it usually has (``Free.unseen``), are nuisances with a prior: with J and M the derivatives by the
    numbers and by e, starts projected out, both have the covariance ([J M]'[J M]/spread + diag(0, 1))^-1 about what
    the data make of them. An interval reaches from the lower to the higher end of its own and that one. Not so of a
    fault of the apparatus that is named itself: what would stand in its place is told as its rival.
    terms : of which those with such sizes are taken that the fit lacks
    """
    p, taken = len(fit.values), {t.label for t in fit.hypothesis.terms}
    faults = [
        t for t in terms
        if t.label not in taken and t.recordings is None and t.free and all(f.unseen for f in t.free)
    ]  # fmt: skip
    if p <= first or not faults:
        return fit
    whole = stacked(fitter, fit)
    sized = [columns_of(fitter, fit, t)[0] * [f.unseen for f in t.free] for t in faults]
    both = np.column_stack([whole.open_numbers, whole.beside(np.column_stack(sized))])
    left = whole.beside(whole.left)
    size = np.linalg.norm(both, axis=0)
    size[size == 0] = 1.0
    prior = np.concatenate([np.zeros(p), np.ones(both.shape[1] - p)])
    inverse = np.linalg.pinv((both / size).T @ (both / size) / spread + np.diag(prior / size**2), hermitian=True)
    covariance = inverse / np.outer(size, size)
    moved = covariance @ (both.T @ left) / spread
    limits = dict(fit.limits)
    of_term = [t for t in fit.hypothesis.terms for _ in t.free]
    for k in [k for k in range(first, p) if of_term[k].mechanism not in APPARATUS]:
        at, half = float(fit.values[k]) + float(moved[k]), half_interval(float(covariance[k, k]))
        limits[k] = _widened(fit, k, spread, at - half, at + half)
    return replace(fit, limits=limits)


def with_shape_held(fit: Fit, label: str) -> Fit:
    """The fit with the inner numbers of a term no longer free: curvature is that of the others at this shape."""
    at, rows = [t.label for t in fit.hypothesis.terms].index(label), fit.hypothesis.rows(label)
    term, own = fit.hypothesis.terms[at], fit.values[rows]
    kept = [k for k, f in enumerate(term.free) if not f.inner]
    free = tuple(replace(f, neutral=float(v)) if f.inner else f for f, v in zip(term.free, own, strict=True))
    held = with_numbers(replace(term, free=free), kept)
    all_kept = [*range(rows.start), *(rows.start + k for k in kept), *range(rows.stop, len(fit.values))]
    return replace(
        fit,
        hypothesis=Hypothesis((*fit.hypothesis.terms[:at], held, *fit.hypothesis.terms[at + 1 :])),
        values=fit.values[all_kept],
        covariance=covariance_of(information_of(fit.jacobian, len(fit.values))[np.ix_(all_kept, all_kept)]),
        jacobian={name: (by_value[:, all_kept], by_start) for name, (by_value, by_start) in fit.jacobian.items()},
        limits={}, profiles={}, believed=None,
    )  # fmt: skip


def with_none_beyond(fit: Fit, named: Collection[str], spread: float) -> Fit:
    """The fit with intervals of strengths that end where their law would be absent, of laws that are not.

    named : labels of the terms for which that was excluded. Along the valley of a strength and its power a search may
    come out on the other side of none, through what was excluded.
    """
    limits = dict(fit.limits)
    for term in fit.hypothesis.terms:
        first = fit.hypothesis.rows(term.label).start
        shaped = term.label in named and any(f.inner for f in term.free)
        for k, free in enumerate(term.free, first):
            value, low, high = fit.interval(k, spread)
            if shaped and not free.inner and low < free.neutral < high:
                low, high = limits.get(k, (low, high))
                limits[k] = (free.neutral, high) if value > free.neutral else (low, free.neutral)
    return replace(fit, limits=limits)


def with_other_choices(
    fitter: Fitter, fit: Fit, first: int, spread: float, terms: Sequence[Term], late: Callable[[], bool] = lambda: False
) -> tuple[Fit, list[str]]:
    """The fit with limits of its numbers from ``first`` on that hold them under choices (a power) that do as well.

    A choice is a number that is not fitted but tried, and what it is moves the others. Each other one among ``terms``
    stands in its law's place and all is refitted: where that raises chi2 by D below the level L of 95 %, the interval
    of the same number there is sqrt(1 - D/L) of what it is here, and the limits hold both. That is the profile of chi2
    over the choice (``with_limits``). Returned with it are notes on what does as well.
    spread : inflation of variances by what the fit leaves;  late : stops between two choices
    """
    limits, notes = dict(fit.limits), list[str]()
    plain, level = replace(fit, believed=None), current().intervals.level * spread
    for at, term in enumerate(fit.hypothesis.terms):
        equal = list[str]()
        # from other first sizes of a range or an exponent the same choice is not tried again
        for other in {str(t.choices): t for t in terms if _differ_by_choice(t, term)}.values():
            if late():
                break
            changed = Hypothesis((*fit.hypothesis.terms[:at], other, *fit.hypothesis.terms[at + 1 :]))
            found = fitter.fit(changed, fit.values, fit.starts, evaluations=current().intervals.refit)
            share = math.sqrt(max(1.0 - max(found.chi2 - fit.chi2, 0.0) / level, 0.0))
            if not share:
                continue
            for k in range(first, len(fit.values)):
                value, low, high = plain.interval(k, spread)
                below, above = limits.get(k, (low, high))
                there = float(found.values[k])
                limits[k] = min(below, there - (value - low) * share), max(above, there + (high - value) * share)
            equal.append(_chosen(other))
        if equal:
            told = f"{_chosen(term)} was chosen; {' or '.join(equal)} does as well"
            notes.append(f"{term.law}: {told}, which the intervals hold")
    return replace(fit, limits=limits), notes


def _chosen(term: Term) -> str:
    """The numbers of a law that are chosen, in words."""
    return " and ".join(f"{name} = {number:g}" for name, number in term.choices.items())


def _differ_by_choice(one: Term, other: Term) -> bool:
    """Whether two terms are the same law on the same bodies, with another number chosen (no joint)."""
    law = all_laws().get(one.law)
    if law is None or one.law != other.law or one.bodies != other.bodies or one.choices == other.choices:
        return False
    named = any(isinstance(law.parameter(c).choices[0], str) for c in one.choices)
    return not named and [f.name for f in one.free] == [f.name for f in other.free]


def _widened(fit: Fit, k: int, spread: float, below: float, above: float) -> tuple[float, float]:
    """The interval of number k, with the ends that a normal number has for another reason.

    A profile keeps its shape: where it ends at twice the distance that curvature says, so does the other reason. A
    strength known together with its power would have both signs otherwise: the valley of both is straight in its
    logarithm, and the distance is one there.
    """
    value, low, high = replace(fit, believed=None).interval(k, spread)
    half = half_interval(float(fit.covariance[k, k]) * spread)
    if k in fit.profiles and half > 0:
        lower, upper = fit.profiles[k]
        parts = (value - below) / half, (above - value) / half
        if _of_a_shape(fit, k) and lower * upper > 0 and lower <= value <= upper:
            most = math.log(sys.float_info.max / max(abs(value), 1.0))
            below, above = (
                value * math.exp(min(part * math.log(end / value), most))
                for part, end in zip(parts, (lower, upper), strict=True)
            )
        else:
            below, above = value - parts[0] * (value - lower), value + parts[1] * (upper - value)
    return min(low, below), max(high, above)


def _of_a_shape(fit: Fit, k: int) -> bool:
    """Whether number k is the strength of a law whose shape, a power or a range, is free beside it."""
    free = fit.hypothesis.free[k]
    own = next(t for t in fit.hypothesis.terms for f in t.free if f is free)
    return not free.inner and any(f.inner for f in own.free)


def with_company(fitter: Fitter, fit: Fit, first: int, spread: float, terms: Sequence[Term]) -> Fit:
    """The fit with limits of its numbers from ``first`` on that hold what they would be beside one more law.

    Of a fit that leaves more than noise something else acts as well, and nobody knows what. To first order a law with
    columns C beside the fit's J has amplitudes a that what is left tells, and moves the numbers by -(J'J)^-1 J'C a.
    Of each law of another mechanism a is drawn from a normal distribution of the likeliest size (none where noise alone
    does as well), given what is left; laws are weighed by their likelihood and AIC of that size, no law beside them. An
    interval reaches from the lower to the higher end of its own 95 % and those of the mixture.
    Source: Robbins 1956, Proc. 3rd Berkeley Symp. 1, 157 (empirical Bayes); Hoeting et al. 1999, Stat. Sci. 14, 382.
    spread : inflation of variances by what the fit leaves
    """
    p, taken = len(fit.values), {t.mechanism for t in fit.hypothesis.terms}
    if p <= first:
        return fit
    whole = stacked(fitter, fit)
    left, numbers = whole.beside(whole.left), whole.open_numbers
    own = np.linalg.pinv(numbers)
    company = []
    for term in terms:
        columns = columns_of(fitter, fit, term)[0] if term.mechanism not in taken else np.zeros((len(left), 0))
        columns = whole.beside(columns[:, columns.any(axis=0)])
        size = np.linalg.norm(columns, axis=0)
        columns = columns[:, size > 0] / size[size > 0]
        rest = columns - numbers @ (own @ columns)
        if not rest.size or np.linalg.norm(rest) < current().signatures.shows * np.linalg.norm(columns):
            continue
        u, told, axes = np.linalg.svd(rest, full_matrices=False)
        company.append((told, u.T @ left, own @ columns @ axes.T))
    if not company:
        return fit
    # beside the best of them less is left than inflated the variances of the fit alone
    most = max(float(z @ z) for _, z, _ in company)
    level = max(float(left @ left - most) / max(fit.count - fit.numbers, 1), 1.0)
    moved, variances, deviances = [np.zeros(p)], [np.zeros(p)], [0.0]
    for told, z, turned in company:
        size, deviance = _likeliest_size(told**2 / level, z**2 / level)
        held = size * told**2 / (level + size * told**2)  # of an amplitude, what its size leaves of it
        amount = held * z / told
        moved.append(-turned @ amount)
        variances.append(turned**2 @ (held * level / told**2))
        deviances.append(deviance + 2.0)
    weights = np.exp(-(np.array(deviances) - min(deviances)) / 2)
    weights /= weights.sum()
    limits = dict(fit.limits)
    for k in range(first, p):
        means = float(fit.values[k]) + np.array(moved)[:, k]
        errors = np.sqrt(np.maximum(level * float(fit.covariance[k, k]) + np.array(variances)[:, k], 1e-300))
        ends = [mixed_quantile(part, means, errors, weights) for part in current().intervals.central]
        if np.isfinite(ends).all():
            limits[k] = _widened(fit, k, spread, *ends)
    return replace(fit, limits=limits)


def _likeliest_size(information: np.ndarray, gains: np.ndarray) -> tuple[float, float]:
    """The likeliest variance of amplitudes of which so much is known (k,), and -2 ln of the likelihood ratio to none.

    An amplitude with variance s of information h gains 1 + s h on average where noise gains one.
    """
    sizes = np.concatenate([[0.0], np.geomspace(1e-3, 1e6, 91) / max(float(information.max()), 1e-300)])
    more = np.outer(sizes, information)
    deviance = np.sum(np.log1p(more) - gains * more / (1.0 + more), axis=1)
    best = int(np.argmin(deviance))
    return float(sizes[best]), float(deviance[best])


def mixed_quantile(part: float, means: np.ndarray, errors: np.ndarray, weights: np.ndarray) -> float:
    """Where a mixture of normal distributions has that part of its probability below."""
    ends = means + float(stats.norm.ppf(part)) * errors
    low, high = float(ends.min()), float(ends.max())

    def beyond(x: float) -> float:
        return float(weights @ stats.norm.cdf((x - means) / errors)) - part

    # by rounding alone where one of them has all the weight
    if not beyond(low) < 0:
        return low
    return float(brentq(beyond, low, high)) if beyond(high) > 0 else high


def _believed(case: Case, fitted: Collection[str]) -> Iterator[tuple[tuple[str, str, float, float], Case, Case]]:
    """For each mass and radius that is not known well: whose, and the case with it smaller and larger by a little.

    A body with the same id, radius and mass in two recordings is the same body, and off by the same. What never moves
    has no mass that matters. Left out are those that are ``fitted`` (``believed.py``).
    """
    recording = case.recording
    for kind, error in (("mass", recording.mass_error), ("radius", recording.radius_error)):
        for body in recording.scene.bodies if error else ():
            if (kind == "mass" and not body.mobile) or error_name(kind, body.id) in fitted:
                continue
            changed = []
            for side in (-1.0, 1.0):
                share = side * current().intervals.sizes * float(error or 0.0)
                scene = with_error(recording.scene, kind, body.id, share)
                changed.append(replace(case, recording=replace(recording, scene=scene)))
            yield (kind, body.id, body.radius, body.mass), changed[0], changed[1]


def _end(fitter: Fitter, fit: Fit, k: int, spread: float, side: float, first: float) -> float:
    """Where chi2, all others refitted, has risen to its ends; the bound where it never does; ``first``: a step.

    As it rises with the square of the distance, sqrt(rise) is a line: that says where to look next, no farther than
    twice the last step, as a valley may bend, and no farther than half of one that failed.
    """
    free, criteria = fit.hypothesis.free[k], current().intervals
    bound = free.high if side > 0 else free.low
    step, here, least = first, fit, criteria.fine * first
    # where the last fit beyond the end was, its chi2, and whether no lost search can have made that
    failed, beyond, height, sure = False, math.nan, math.nan, False
    for _ in range(criteria.most):
        at = float(here.values[k]) + side * step
        if (at - bound) * side >= 0:
            at = bound
        values = here.values.copy()
        values[k] = at
        found = fitter.fit(fit.hypothesis, values, here.starts, evaluations=criteria.evaluations, held=(k,), near=here)
        # 1 at the end
        before, now = (math.sqrt(max(f.chi2 - fit.chi2, 0.0) / (criteria.level * spread)) for f in (here, found))
        away = abs(at - float(fit.values[k]))
        if now < 1:
            if at == bound:
                return bound
            here = found
            if now > 1 - criteria.fine:
                return at
            foreseen = away * (1.0 / now - 1.0) if now > 0 else math.inf
            step = min(foreseen, step if failed else criteria.growth * step)
            if sure and step >= abs(beyond - at) * (1 - criteria.fine):
                step = abs(beyond - at) / 2
        else:
            # the end, or a valley that bends more than one search can follow: such a one is lost elsewhere next time
            again = math.isclose(at, beyond, rel_tol=1e-9) and abs(found.chi2 - height) < criteria.level * spread
            failed, beyond, height, sure = True, at, found.chi2, again
            step = abs(at - float(here.values[k]))
            half = step / 2
            # near a bound what counts is how far it is from there: 0.3 is an end that 0 is not, seen from 100 as well
            close = min(least + criteria.fine * away, criteria.fine * abs(float(here.values[k]) - bound))
            if now < 1 + criteria.fine or half < close:
                return at
            # a search that is lost says nothing of where the end is
            foreseen = step * (1.0 - before) / (now - before) if now < criteria.unlike else half
            step = min(half, max(foreseen, criteria.fine * step))
    return at if failed else bound
