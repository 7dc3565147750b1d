"""Signatures: how the predictions change for a little of each candidate, and what recalibration leaves of it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from ...laws import all_laws, has_role
from ..candidates import ABOUT, along_only, rescaled, with_numbers
from ..criteria import current
from ..hypothesis import Term
from ..linear import basis, project
from .fit import Fitter
from .fitted import Fit
from .line import lines


@dataclass(frozen=True)
class Signature:
    """A candidate's signature around a fit, all recordings stacked.

    directions : (n, k) orthonormal, what is left when starts and free numbers are projected out
    surviving : share (0..1) of the signature's length that recalibration cannot imitate (starts, which
        every hypothesis refits, are projected out of both)
    gain : how much chi2 falls, to first order
    usual : (n, m) what its numbers do at the size that any laboratory is off by (``Free.error``), projected as
        ``directions`` are; none where one of them is no such error
    """

    term: Term
    directions: np.ndarray
    surviving: float
    gain: float
    usual: np.ndarray | None = None


@dataclass(frozen=True)
class Bank:
    """All signatures around one fit, with the innovations they are held against.

    asked : the candidate of each signature with all of its numbers: about another path those may show that do not here
    """

    fit: Fit
    innovations: np.ndarray
    nuisance: np.ndarray
    signatures: tuple[Signature, ...]
    asked: tuple[Term, ...] = ()

    @property
    def left(self) -> np.ndarray:
        """(n,) innovations, starts and free numbers projected out."""
        return np.asarray(self.innovations - self.nuisance @ (self.nuisance.T @ self.innovations))

    def gains(self, innovations: np.ndarray) -> np.ndarray:
        """Fall in chi2 of every candidate (m,) for other innovations (n,), or (m, k) for k of them (n, k)."""
        left = innovations - self.nuisance @ (self.nuisance.T @ innovations)
        return np.array([np.sum((s.directions.T @ left) ** 2, axis=0) for s in self.signatures])


@dataclass(frozen=True)
class Stacked:
    """All recordings of a fit, one behind the other.

    left : (n,) what the fit leaves;  numbers : (n, p) derivatives by its values
    starts : (n, q) orthonormal, what the starts can take over
    open_numbers : (n, p) what the starts cannot take over of these, none by numbers held at their bounds: what an
        adjustable number there cannot take up, a law of the same form may
    """

    left: np.ndarray
    numbers: np.ndarray
    starts: np.ndarray
    open_numbers: np.ndarray

    def beside(self, vectors: np.ndarray) -> np.ndarray:
        """What the starts cannot take over of vectors (n,) or (n, k)."""
        return np.asarray(vectors - self.starts @ (self.starts.T @ vectors))


def stacked(fitter: Fitter, fit: Fit) -> Stacked:
    """What a fit leaves of all recordings of a fitter, and its derivatives."""
    left = np.concatenate([fit.used(c.name) for c in fitter.cases])
    numbers = np.concatenate([fit.jacobian[c.name][0] for c in fitter.cases])
    starts = block_diag(*(basis(fit.jacobian[c.name][1]) for c in fitter.cases))
    whole = Stacked(left, numbers, starts, numbers)
    open_numbers = whole.beside(numbers)
    open_numbers[:, held_at_bounds(fit, open_numbers.T @ whole.beside(left))] = 0.0
    return replace(whole, open_numbers=open_numbers)


def held_at_bounds(fit: Fit, downhill: np.ndarray) -> list[int]:
    """Numbers that lie where their search ends, and would go on if it did not: ``downhill`` (p,), where chi2 falls."""
    held = []
    for k, free in enumerate(fit.hypothesis.free):
        near = current().verdict.at_bound * (free.high - free.low)
        value = float(fit.values[k])
        if math.isfinite(near) and downhill[k] * ((value > free.high - near) - (value < free.low + near)) > 0:
            held.append(k)
    return held


def columns_of(fitter: Fitter, fit: Fit, term: Term) -> tuple[np.ndarray, np.ndarray]:
    """d(predicted/sigma)/d(number) of a term's numbers (n, k), and scales that change the prediction by a sigma."""
    criteria = current().signatures
    hypothesis, (least, most) = fit.hypothesis.with_term(term), criteria.moves
    columns = []
    scales = []
    for k, free in enumerate(term.free):
        if free.inner:
            continue
        step = free.scale * criteria.step
        column = np.zeros(sum(len(fit.used(c.name)) for c in fitter.cases))
        for _ in range(12):
            # inside the bounds, on the side with more room
            above, below = free.high - free.first, free.first - free.low
            step = min(abs(step), above) if above >= below else -min(abs(step), below)
            at = 0
            worst = 0.0
            for c in fitter.cases:
                base, roots = fit.used(c.name), fit.roots(c.name)
                size = len(base)
                if free.cases is None or c.name in free.cases:
                    values = np.concatenate([fit.values, [f.first for f in term.free]])
                    values[len(fit.values) + k] += step
                    difference = base - roots * fitter.vector(c, hypothesis, values, fit.starts[c.name])
                    column[at : at + size] = difference / step
                    worst = max(worst, float(np.abs(difference).max(initial=0.0)))
                at += size
            # far enough to be above rounding, near enough to be linear
            if worst > most:
                step *= max(1.0 / worst, 1e-4)
            elif worst < least:
                if abs(step) >= min(max(above, below), criteria.longest):
                    break
                step *= criteria.farther if worst < criteria.nothing else min(criteria.aim / worst, criteria.longest)
            else:
                break
        with np.errstate(over="ignore"):
            rms = float(np.sqrt(np.mean(column**2)))
        if 2 * worst > current().fits.hopeless or not math.isfinite(rms):
            column[:], rms = 0.0, 0.0  # however little of it: no run that could be compared
        columns.append(column)
        scales.append(1.0 / rms if rms > 0 else abs(step))
    return _beyond_rounding(term, np.column_stack(columns)), np.array(scales)


def _beyond_rounding(term: Term, columns: np.ndarray) -> np.ndarray:
    """Derivatives (n, k) by the numbers of a term that are not inner, none where they are what rounding left.

    A force across a rail moves nothing; held against numbers of the same unit beside it, that shows.
    """
    units = np.array([f.unit for f in term.free if not f.inner])
    sizes = np.linalg.norm(columns, axis=0)
    most = np.array([sizes[units == unit].max() for unit in units])
    return np.where(sizes > current().signatures.rounding * most, columns, 0.0)


def that_moves_alike(fitter: Fitter, fit: Fit, rows: slice, amount: np.ndarray, term: Term) -> np.ndarray | None:
    """(k,) strengths of a term that move the bodies as ``amount`` (m,) of the fit's numbers ``rows`` does.

    To first order, by least squares, the starts projected out of both; None where the term does not move them.
    """
    columns = columns_of(fitter, fit, term)[0]
    left, moved, at = [], [], 0
    for case in fitter.cases:
        by_value, by_start = fit.jacobian[case.name]
        both = np.column_stack([columns[at : at + len(by_value)], by_value[:, rows] @ amount])
        at += len(by_value)
        both = both - project(by_start, both)
        left.append(both[:, :-1])
        moved.append(both[:, -1])
    size = np.linalg.norm(np.concatenate(left), axis=0)
    if not size.all():
        return None
    return np.asarray(np.linalg.lstsq(np.concatenate(left) / size, np.concatenate(moved), rcond=1e-6)[0] / size)


def _held_against(
    columns: np.ndarray, scales: np.ndarray, starts: np.ndarray, nuisance: np.ndarray, left: np.ndarray
) -> tuple[np.ndarray, float, float, np.ndarray]:
    """Directions that starts and free numbers leave, surviving fraction, first-order gain and amounts."""
    after_starts = columns - starts @ (starts.T @ columns)
    after_all = columns - nuisance @ (nuisance.T @ columns)
    size = float(np.linalg.norm(columns * scales))
    before, after = float(np.linalg.norm(after_starts * scales)), float(np.linalg.norm(after_all * scales))
    surviving = after / before if before > current().signatures.leaves * size else 0.0
    directions = basis(after_all * scales) if surviving > current().signatures.directions else np.zeros((len(left), 0))
    gain = float(np.sum((directions.T @ left) ** 2))
    amount = np.linalg.lstsq(after_all * scales, left, rcond=1e-6)[0] * scales
    return directions, surviving, gain, amount


def _independent(columns: np.ndarray) -> np.ndarray:
    """(k,) whether a column of (n, k) changes something that longer ones do not."""
    sizes = np.linalg.norm(columns, axis=0)
    kept = np.zeros(columns.shape[1], dtype=bool)
    for k in np.argsort(-sizes, kind="stable"):
        if sizes[k] > 0:
            q = basis(columns[:, kept])
            rest = columns[:, k] - q @ (q.T @ columns[:, k])
            kept[k] = np.linalg.norm(rest) > current().signatures.same_column * sizes[k]
    return kept


def _to_a_sigma(columns: np.ndarray) -> np.ndarray:
    """(k,) of numbers by their columns (n, k), what changes the prediction by a sigma; 1 where nothing does."""
    rms = np.sqrt(np.mean(columns**2, axis=0))
    return np.where(rms > 0, 1.0 / np.where(rms > 0, rms, 1.0), 1.0)


def _only_direction(columns: np.ndarray) -> np.ndarray | None:
    """The unit direction (k,) of a vector that alone shows, where its columns (n, k) are all multiples of one.

    None where more of it shows, or components do not at all: then the others are what is known of it.
    """
    if columns.shape[1] < 2 or not columns.any(axis=0).all() or _independent(columns).sum() > 1:
        return None
    direction = np.linalg.svd(columns, full_matrices=False)[2][0]
    return np.asarray(direction * np.sign(direction[np.argmax(np.abs(direction))]))


def _told_along(term: Term, columns: np.ndarray) -> tuple[Term, np.ndarray]:
    """A term without inner numbers, and its columns (n, k), with one number for each vector of one direction alone.

    Of a push on a body on a slanted rail both components show, and only together.
    """
    for rows in [rows for _, rows in reversed(term.groups) if len(rows) > 1 and min(rows) >= 0]:
        absent = all(term.free[r].neutral == 0 for r in rows)
        direction = _only_direction(columns[:, list(rows)]) if absent else None
        if direction is not None:
            term = along_only(term, rows, direction)
            size = columns[:, list(rows)] @ direction
            columns = np.column_stack([columns[:, : rows[0]], size, columns[:, rows[-1] + 1 :]])
    return term, columns


def _flow_signature(
    fitter: Fitter, fit: Fit, term: Term, starts: np.ndarray, nuisance: np.ndarray, left: np.ndarray
) -> Signature:
    """The signature of -c (v - u), which is linear in c and c u and in nothing else: all three at once.

    So of -k (r - a) in k and k a, a counted from where its search begins.
    """
    speeds = has_role(term.mechanism, "medium")
    spans = [
        np.nanmax(np.abs(np.diff(case.values[:, k]))) / float(np.median(np.diff(case.t)))
        for case in fitter.cases
        for k, channel in enumerate(case.channels)
        if channel.kind != "angle"
    ]
    top = (float(max(spans, default=0.0)) or 1e-2) if speeds else term.free[1].high - term.free[1].first
    origin = np.array([f.first for f in term.free[1:]])
    probes = []
    for away in ((0.0, 0.0), (top, 0.0), (0.0, top)):
        probe = rescaled(term, [f.scale for f in term.free], [term.free[0].first, *(origin + away)])
        probes.append(columns_of(fitter, fit, probe)[0][:, 0])
    streams = [probe - probes[0] for probe in probes[1:]]
    rounding = current().signatures.rounding * max(float(np.linalg.norm(probe)) for probe in probes)
    # of a component that a rail takes away the difference is rounding, and looks like no other column
    streams = [change if np.linalg.norm(change) > rounding else np.zeros_like(change) for change in streams]
    columns = np.column_stack([probes[0], *(change / top for change in streams)])
    if not columns.any():
        return Signature(term, np.zeros((len(left), 0)), 0.0, 0.0)
    if speeds:
        term, columns = _told_along(term, columns)
    scales = _to_a_sigma(columns)
    # of a motion that is straight and steady without the law, drag and stream look alike: that is no reason
    answered = np.concatenate([[columns[:, 0].any()], _independent(columns[:, 1:])])
    if answered[0] and not answered.all():
        term = with_numbers(term, [int(k) for k in np.flatnonzero(answered)])
        columns, scales = columns[:, answered], scales[answered]
    origin = np.array([f.first for f in term.free[1:]])
    directions, surviving, gain, (c, *push) = _held_against(columns, scales, starts, nuisance, left)
    force = float(np.linalg.norm(push))
    # where nothing tells the drag (another one is adjustable), a flow as fast as the bodies
    if c * top < current().signatures.still * force:
        c = force / top
    u = np.array(push) / c if c > 0 else np.zeros(len(push))
    least = current().signatures.slow * top
    sizes = [float(scales[0]), *(max(float(x) / c if c > 0 else 0.0, least) for x in scales[1:])]
    return Signature(rescaled(term, sizes, [c, *(origin + u)]), directions, surviving, gain)


def _at_its_place(fitter: Fitter, fit: Fit, term: Term, nuisance: np.ndarray, left: np.ndarray) -> Term:
    """A force from a point that nobody sees, begun from the place at which it explains most to first order.

    On a grid over all places that were seen, then on finer ones about the best.
    """
    rows = next(rows for name, rows in term.groups if all_laws()[term.law].parameter(name).within == "tracks")
    firsts, scales = [f.first for f in term.free], [f.scale for f in term.free]
    ends = [(term.free[k].low, term.free[k].high) for k in rows]
    at = np.array([0.5 * (low + high) for low, high in ends])
    extent = 0.5 * (ends[0][1] - ends[0][0]) / current().candidates.farthest
    best, most = term, -1.0
    for grid in current().signatures.places:
        middle, steps = at, extent * np.array(grid)
        for away in itertools.product(steps, steps):
            for k, place in zip(rows, middle + away, strict=True):
                firsts[k] = float(place)
            begun = rescaled(term, scales, firsts)
            columns, sizes = columns_of(fitter, fit, begun)
            _, surviving, gain, _ = _held_against(columns, sizes, nuisance[:, :0], nuisance, left)
            if columns.any():
                scales[0] = float(sizes[0])  # the next place is about as telling
            if gain > most and surviving > current().signatures.surviving:
                best, most, at = begun, gain, middle + away
    return best


def _at_its_frequency(fitter: Fitter, fit: Fit, term: Term, nuisance: np.ndarray, left: np.ndarray) -> Term:
    """A force at one frequency, begun from that at which it explains most to first order.

    About the frequencies at which most of what is left goes to and fro: a resonance answers at its own as well.
    """
    criteria = current().signatures
    row = next(k for k, f in enumerate(term.free) if f.inner)
    firsts, scales = [f.first for f in term.free], [f.scale for f in term.free]
    longest = max(float(np.ptp(case.t)) for case in fitter.cases)
    scales[row] = criteria.beat_step / longest
    best, most = term, -1.0
    for line in lines(fit, fitter.cases, criteria.beats):
        for away in criteria.about_beat:
            firsts[row] = line.frequency + away / longest
            begun = rescaled(term, scales, firsts)
            columns, sizes = columns_of(fitter, fit, begun)
            _, surviving, gain, _ = _held_against(columns, sizes, nuisance[:, :0], nuisance, left)
            if gain > most and surviving > criteria.surviving:
                best, most = begun, gain
    return best


def _as_fast(term: Term, stream: Term) -> Term:
    """A term with the first values and scales that those of its numbers which are speeds have in another."""
    other = {f.name.rpartition(".")[2]: f for f in stream.free if f.unit == "m/s"}
    mine = [other.get(f.name.rpartition(".")[2], f) for f in term.free]
    return rescaled(term, [f.scale for f in mine], [f.first for f in mine])


def make_bank(fitter: Fitter, fit: Fit, terms: Sequence[Term]) -> Bank:
    """Signatures of all candidates around a fit; their numbers get scales and first-order first values.

    When the time is up the others have none, and are not fitted.
    """
    whole = stacked(fitter, fit)
    r, starts = whole.left, whole.starts
    nuisance = np.hstack([starts, basis(whole.open_numbers)])
    left = r - nuisance @ (nuisance.T @ r)
    misfit = float(np.sqrt(np.mean(left**2)))
    signatures: list[Signature] = []
    for term in (fit.hypothesis.followed(t, fit.values) for t in terms):
        if fitter.stop():
            signatures.append(Signature(term, np.zeros((len(r), 0)), 0.0, 0.0))
            continue
        if has_role(term.mechanism, *ABOUT) and len(term.free) == 3:
            if all_laws()[term.law].linear or has_role(term.mechanism, "tether"):
                signatures.append(_flow_signature(fitter, fit, term, starts, nuisance, left))
                continue
            # as fast as the stream that the linear drag asks for
            term = next((_as_fast(term, s.term) for s in signatures if s.term.mechanism == term.mechanism), term)
        if has_role(term.mechanism, "source"):
            term = _at_its_place(fitter, fit, term, nuisance, left)
        if has_role(term.mechanism, "beat") and any(f.inner for f in term.free):
            term = _at_its_frequency(fitter, fit, term, nuisance, left)
        columns, scales = columns_of(fitter, fit, term)
        if not any(f.inner for f in term.free):
            term, columns = _told_along(term, columns)
            scales = scales if len(scales) == len(term.free) else _to_a_sigma(columns)
        answered = _independent(columns)
        if not answered.any():
            signatures.append(Signature(term, np.zeros((len(r), 0)), 0.0, 0.0))
            continue
        linear = [k for k, f in enumerate(term.free) if not f.inner]
        if not answered.all():
            # a number that changes nothing these recordings show, or only what others do (a force on a rail has one
            # component), stays where the law is absent
            keep = {linear[k] for k in np.flatnonzero(answered)} | {k for k, f in enumerate(term.free) if f.inner}
            term = with_numbers(term, sorted(keep))
            linear = [k for k, f in enumerate(term.free) if not f.inner]
            columns, scales = columns[:, answered], scales[answered]
        directions, surviving, gain, amount = _held_against(columns, scales, starts, nuisance, left)
        firsts = [f.first for f in term.free]
        sizes = [f.scale for f in term.free]
        one_way = len(linear) == 1 and term.free[linear[0]].low == firsts[linear[0]] and amount[0] < 0
        if misfit > current().signatures.far and one_way:
            # so far away first order means little: a force that can only go one way is tried as large as the misfit
            amount = np.array([misfit * scales[0]])
        for k, number in enumerate(linear):
            firsts[number] += float(amount[k])
            # what hardly shows to first order (a limit that is just reached) has a scale beyond its bounds
            room = current().signatures.room * (term.free[number].high - term.free[number].low)
            sizes[number] = min(float(scales[k]), room)
        usual = np.array([term.free[k].error for k in linear])
        after_all = (columns - nuisance @ (nuisance.T @ columns)) * usual if usual.all() else None
        signatures.append(Signature(rescaled(term, sizes, firsts), directions, surviving, gain, after_all))
    return Bank(fit, r, nuisance, tuple(signatures), tuple(terms))
