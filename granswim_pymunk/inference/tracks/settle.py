"""What was found, told in the names of the apparatus, and with those entries alone that earn their place."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import distributions as stats
from ...laws import Law, all_laws, has_role
from ..candidates import for_bodies, owners, with_numbers
from ..criteria import current
from ..hypothesis import Free, Hypothesis, Term
from ..significance import price
from ..simpler import all_absent, by_chance, special_cases
from ..trial import rows_of
from .believed import stated_terms
from .choose import absurd
from .fit import Fitter
from .fitted import Fit, may_be_absent
from .intervals import with_believed_errors, with_shape_held
from .name import Trial, off_bounds
from .sets import SetSearch
from .signatures import make_bank, that_moves_alike


@dataclass(frozen=True)
class StandIn:
    """A law ``named`` in place of one that ``gave_way``, and by how much of chi2 over the spread it is ``ahead``."""

    named: Trial
    gave_way: Trial
    ahead: float


def in_names_of_apparatus(
    search: SetSearch, found: Sequence[Trial], revised: Fit
) -> tuple[list[Trial], Fit, list[StandIn]]:
    """Each law exchanged for the one that by its declaration stands for it in such an apparatus and does as well.

    Of one law, two or three. They may be the same law in other numbers, so each begins at the amount that moves the
    bodies alike. Of errors that any apparatus has the one whose usual size is nearer to the amount found. Also which
    laws gave way: these data cannot tell them from those that are named.
    """
    found, told = list(found), list[StandIn]()
    for k in range(len(found)):
        best: StandIn | None = None
        others = _usual_instead(search, found[k].term)
        for term in [*_standing_for(found[k].term, search.terms), *others]:
            beside = {t.mechanism for t in found if t is not found[k]}
            if term.label == found[k].label or term.mechanism in beside:
                continue
            trial = _in_place(search, found, k, term, revised)
            if trial is None or trial.fit is None:
                continue
            row = rows_of(found, search.first)[k].start
            if term in others and _as_usual(trial.fit, row) <= _as_usual(revised, row):
                continue
            ahead = (revised.chi2 - trial.fit.chi2) / search.spread(trial.fit)
            if ahead > -current().verdict.same and (best is None or ahead > best.ahead):
                best = StandIn(trial, found[k], float(ahead))
        if best is None or best.named.fit is None:
            continue
        if best.named.mechanism != best.gave_way.mechanism:
            told.append(best)
        found[k], revised = best.named, best.named.fit
        found = search.as_in(revised, found)
    return found, revised, told


def _standing_for(term: Term, terms: Sequence[Term]) -> list[Term]:
    """Terms of laws that stand for this one in the apparatus of the recordings, with numbers for the same bodies."""
    laws, bodies = all_laws(), owners(term)
    result = []
    for other in terms:
        if not other.suited or term.mechanism not in laws[other.law].stands_for:
            continue
        part = for_bodies(other, bodies) if bodies else None
        mine = part[0] if part is not None else other
        if owners(mine) == bodies and len(mine.free) == len(term.free):
            result.append(mine)
    return result


def _usual_instead(search: SetSearch, term: Term) -> list[Term]:
    """Other errors that any apparatus has, of one number that shows each, in place of one of one number."""
    if len(term.free) > 1 or not term.free[0].error:
        return []
    every = [t for t in search.terms if all(f.error for f in t.free) and t.mechanism != term.mechanism]
    shown = (s.term for s in make_bank(search.fitter, search.base, every).signatures)
    return [t for t in shown if len(t.free) == 1]


def _as_usual(fit: Fit, k: int) -> float:
    """Logarithm of how probable data are if number k is an error of its usual size, to compare errors by.

    Of a likelihood with its maximum at v and the error s, and a Gaussian prior of width u, up to a constant:
    -chi2/2 + ln(s/sqrt(u^2 + s^2)) - v^2/2(u^2 + s^2). Source: MacKay 2003, Information Theory, ch. 28.
    """
    free, variance = fit.hypothesis.free[k], float(fit.covariance[k, k])
    both = max(free.error**2 + variance, 1e-300)
    off = float(fit.values[k]) - free.neutral
    return -fit.chi2 / 2 + math.log(max(variance, 1e-300) / both) / 2 - off**2 / (2 * both)


def _in_place(search: SetSearch, found: Sequence[Trial], k: int, term: Term, revised: Fit) -> Trial | None:
    """A law refitted in place of the ``k``-th of those found, from the amount that moves the bodies as that one does.

    None where it does not move them.
    """
    rows = rows_of(found, search.first)[k]
    amount = revised.values[rows] - np.array([f.neutral for f in found[k].term.free])
    numbers = that_moves_alike(search.fitter, revised, rows, amount, term)
    if numbers is None:
        return None
    low, high = np.array([(f.low, f.high) for f in term.free]).T
    begin = revised.values.copy()
    begin[rows] = np.clip(numbers + [f.neutral for f in term.free], low, high)
    hypothesis = search.scene_with(*(term if t is found[k] else t.term for t in found))
    fit = search.fitter.fit(hypothesis, begin, revised.starts, evaluations=current().intervals.refit)
    (signature,) = make_bank(search.fitter, search.base, [term]).signatures
    return Trial(replace(signature, term=term), fit, search.base.chi2 - fit.chi2, found[k].inner)


def that_earn_their_place(
    search: SetSearch, found: Sequence[Trial], revised: Fit
) -> tuple[list[Trial], Fit, dict[str, str]]:
    """The laws without the entries (of a body or joint, or one of several laws) whose numbers may as well be absent.

    One after the other, that which is nearest to absent first, and all refitted: an entry goes where the intervals of
    all its strengths hold their neutral values, and chi2 without it rises no further than chance. One entry stays.
    Also why each went, by the body or the law.
    """
    found, dropped = list(found), dict[str, str]()
    first = search.first
    while sum(max(len(owners(t.term)), 1) for t in found) > 1:
        weakest = _weakest(found, search.fitter.sharpened(revised), first, search.spread(revised))
        if weakest is None:
            break
        k, owner, numbers = weakest
        kept = [n for n in range(found[k].numbers) if n not in numbers]
        fewer = list(found)
        if kept:
            bodies = tuple(b for b in owners(found[k].term) if b != owner)
            term = replace(with_numbers(found[k].term, kept), bodies=bodies)
            fewer[k] = replace(found[k], signature=replace(found[k].signature, term=term))
        else:
            del fewer[k]
        rows = rows_of(found, first)[k]
        begin = np.delete(revised.values, [rows.start + n for n in numbers])
        hypothesis = search.scene_with(*(t.term for t in fewer))
        fit = search.fitter.fit(hypothesis, begin, revised.starts, evaluations=current().intervals.refit)
        rise = (fit.chi2 - revised.chi2) / search.spread(revised)
        if not by_chance(rise, len(numbers)):
            break
        dropped[owner or found[k].mechanism] = f"the interval of its {found[k].mechanism} holds zero"
        found, revised = search.as_in(fit, fewer), fit
    return found, revised, dropped


def has_idle_entry(trial: Trial, spread: float) -> bool:
    """Whether of several entries of a law, one for each body or joint, one may as well be absent.

    Such a law is one with fewer entries in other numbers, and is as good as that one by chance alone.
    spread : inflation of variances by what the fit leaves
    """
    if trial.fit is None or len(owners(trial.term)) < 2:
        return False
    return _weakest([trial], trial.fit, trial.fit.hypothesis.rows(trial.label).start, spread) is not None


def is_its_special_case(trial: Trial, spread: float) -> bool:
    """Whether a law may as well be the one that it is where its further numbers are none: a stream, at rest.

    Of which the intervals of all these numbers hold what they are then. False of a law that is no other one's form.
    """
    law = all_laws().get(trial.term.law)
    if trial.fit is None or law is None or not special_cases(law.name):
        return False
    first = trial.fit.hypothesis.rows(trial.label).start
    ends = []
    for k, free in enumerate(trial.term.free):
        if free.inner:
            _, low, high = trial.fit.interval(first + k, spread)
            ends.append((_where_it_is_none(law, free.name), low, high))
    return bool(ends) and all_absent(ends)


def _where_it_is_none(law: Law, number: str) -> float:
    """Where a free number of a law is as if it were not there: what its parameter is where nobody says.

    Of a vector that shows along one direction alone, whose size there goes by the parameter's name, the size.
    """
    name = number.partition(".")[2].partition("[")[0]
    for p in law.parameters:
        default = np.broadcast_to(np.asarray(p.default or 0.0, dtype=float), p.size)
        if name in p.arguments:
            return float(default[p.arguments.index(name)])
        if name == p.name:
            return float(np.linalg.norm(default))
    return 0.0


def with_numbers_that_were_found(
    fitter: Fitter, base: Fit, found: Sequence[Trial], revised: Fit, spread: float
) -> tuple[list[Trial], Fit, dict[str, str]]:
    """The laws without those of which a number ended where its search ends: such a number was not found.

    Laws and faults of the apparatus alike, by the rule for one alone (``absurd``); a fault beside laws also where its
    interval reaches that far: it may be as large as none is. One after the other, that without which chi2 is least, and
    the rest refitted: a number may lie at its bound because of another that does. None stays where all did. Also why
    each went, by its name.
    spread : inflation of variances by what the fit leaves
    """
    found, dropped, first = list(found), dict[str, str](), len(base.values)
    level = revised
    for own in rows_of(found, first):
        level = off_bounds(fitter, level, own)
    if level is not revised:
        found, revised = [replace(t, fit=level, gain=base.chi2 - level.chi2) for t in found], level
    while found:
        best: tuple[Fit, int, str] | None = None
        rows = rows_of(found, first)
        for k, trial in enumerate(found):
            why = absurd(replace(trial, fit=revised))
            if not why and trial.apparatus and not all(t.apparatus for t in found):
                why = _unsure(trial, revised, rows[k], spread)
            if not why:
                continue
            hypothesis = base.hypothesis.with_term(*(t.term for t in found if t is not trial))
            fit = base if len(found) == 1 else _refitted_without(fitter, base, hypothesis, revised, rows[k])
            best = (fit, k, why) if best is None or fit.chi2 < best[0].chi2 else best
        if best is None:
            break
        revised, k, why = best
        dropped[found.pop(k).mechanism] = why
        found = [replace(t, fit=revised, gain=base.chi2 - revised.chi2) for t in found]
    return found, revised, dropped


def _refitted_without(fitter: Fitter, base: Fit, hypothesis: Hypothesis, revised: Fit, rows: slice | list[int]) -> Fit:
    """The fit without a law, from where it was with it and from where the scene was without laws: the lower one.

    A number at its bound may have carried starts and masses away to where no fit without it comes back from.
    """
    begin, evaluations = np.delete(revised.values, rows), current().intervals.refit
    anew = np.concatenate([base.values, begin[len(base.values) :]])
    fits = (fitter.fit(hypothesis, v, s, evaluations=evaluations)
            for v, s in ((begin, revised.starts), (anew, base.starts)))  # fmt: skip
    return min(fits, key=lambda fit: fit.chi2)


def _unsure(trial: Trial, fit: Fit, rows: slice, spread: float) -> str:
    """Which strength of a fault has an interval that reaches where its search ends; empty where none does."""
    for k, free in enumerate(trial.term.free, rows.start):
        if not free.inner and _endless(free, fit.interval(k, spread)[1:]):
            return f"the interval of {free.name} reaches where its search ends"
    return ""


def reaches_its_end(trial: Trial, fit: Fit, spread: float) -> str:
    """Which strength of a law has an interval that touches a bound of its search (contract 2); empty where none does.

    As it may be there as well, it has not been found. Not a bound where the law is absent, nor one of nature. Nor has
    one that, at the law's shape, goes from where that is absent to no end: anything would do. Of a force from a point
    that nobody sees place and shape count too: far away, and with any power, it is a smooth field like many others. A
    spring whose stiffness may be none is no spring.
    spread : inflation of variances by what the fit leaves
    """
    unseen = has_role(trial.mechanism, "source")
    for k, free in enumerate(trial.term.free, fit.hypothesis.rows(trial.label).start):
        ends = zip(fit.interval(k, spread)[1:], (free.low, free.high), strict=True)
        counts = not free.natural and (unseen or not free.inner)
        if counts and any(end == bound != free.neutral and math.isfinite(bound) for end, bound in ends):
            return f"the interval of {free.name} reaches where its search ends"
    held = with_shape_held(fit, trial.label) if any(f.inner for f in trial.term.free) else fit
    strengths = [f for f in trial.term.free if not f.inner]
    for k, free in enumerate(strengths, held.hypothesis.rows(trial.label).start):
        value, low, high = held.interval(k, spread)
        far = current().signatures.longest * free.scale
        if low <= free.neutral <= high and max(high - value, value - low) > far:
            return f"the interval of {free.name} holds none and has no end"
    law = all_laws().get(trial.term.law)
    needed = {f"{law.name}.{p.name}" for p in law.parameters if p.needed} if law is not None else set[str]()
    for k, free in enumerate(trial.term.free, fit.hypothesis.rows(trial.label).start):
        _, low, high = fit.interval(k, spread)
        if free.name in needed and low <= free.neutral <= high:
            return f"{free.name} may as well be none, and without it this is another law"
    return ""


def without_one(fitter: Fitter, base: Fit, revised: Fit, those: Sequence[Trial]) -> tuple[Trial, Fit]:
    """Of several laws in a fit that one without which chi2 is least, and the fit without it."""
    found = [(trial, without_labels(fitter, base, revised, [trial.label])) for trial in those]
    return min(found, key=lambda entry: entry[1].chi2)


def without_labels(fitter: Fitter, base: Fit, revised: Fit, gone: Collection[str]) -> Fit:
    """The fit of the laws of a fit without some of them."""
    terms = [t for t in revised.hypothesis.terms[len(base.hypothesis.terms) :] if t.label not in gone]
    rows = [k for label in gone for k in range(*revised.hypothesis.rows(label).indices(len(revised.values)))]
    return _refitted_without(fitter, base, base.hypothesis.with_term(*terms), revised, rows)


def without_idle_numbers(
    search: SetSearch, found: Sequence[Trial], revised: Fit, idle: Collection[str] | None = None
) -> tuple[list[Trial], Fit]:
    """Each law as the one that it is where its further numbers add nothing: a stream at rest is a drag.

    Where chi2 without them rises no further than chance; of several laws as of one (``choose``).
    idle : labels of the laws of which intervals hold that, and that alone are asked: of them chi2 rises by less than a
        search gains by chance
    """
    found = list(found)
    for k, trial in enumerate(found):
        names = special_cases(trial.term.law)
        if not names or any(t.mechanism in names for t in found) or (idle is not None and trial.label not in idle):
            continue
        rows = rows_of(found, search.first)[k]
        plain = [t for t in search.terms if t.mechanism in names and len(t.free) == 1 < trial.numbers]
        best: tuple[Fit, Term] | None = None
        for term in plain:
            begin = np.concatenate([revised.values[: rows.start + 1], revised.values[rows.stop :]])
            hypothesis = search.scene_with(*(term if t is trial else t.term for t in found))
            fit = search.fitter.fit(hypothesis, begin, revised.starts, evaluations=current().intervals.refit)
            best = (fit, term) if best is None or fit.chi2 < best[0].chi2 else best
        if best is None:
            continue
        rise = (best[0].chi2 - revised.chi2) / search.spread(revised)
        more = trial.numbers - 1
        if by_chance(rise, more) or (idle is not None and rise < price(len(search.terms), more)):
            revised = best[0]
            (signature,) = make_bank(search.fitter, search.base, [best[1]]).signatures
            found[k] = Trial(replace(signature, term=best[1]), revised, 0.0, trial.inner)
            found = search.as_in(revised, found)
    return found, revised


def apparatus_beside(
    found: Sequence[Trial], revised: Fit, recalibrated: Fit, fitter: Fitter
) -> tuple[list[Trial], Fit | None]:
    """Faults of the apparatus beside laws that explain as much as a name has to without them, and the fit without them.

    A scale, a tilt or a lens maps the picture smoothly, and so takes a part of any smooth remainder of a few tracks:
    where it leaves more than noise it is a term of a series, not a fault that was found. None where it leads itself.
    """
    faults = [t for t in found if t.apparatus]
    laws = [t for t in found if not t.apparatus]
    if not faults or not laws:
        return [], None
    first = len(recalibrated.values)
    rows = rows_of(found, first)
    kept = [revised.values[r] for t, r in zip(found, rows, strict=True) if not t.apparatus]
    hypothesis = recalibrated.hypothesis.with_term(*(t.term for t in laws))
    begin = np.concatenate([revised.values[:first], *kept])
    alone = fitter.fit(hypothesis, begin, revised.starts, evaluations=current().intervals.refit)
    share = (recalibrated.chi2 - alone.chi2) / max(recalibrated.chi2 - revised.chi2, 1e-300)
    return (faults, alone) if share >= current().verdict.share else ([], None)


def that_may_be_absent(
    found: Sequence[Trial], fit: Fit, spread: float, doubted: Callable[[Fit], Fit]
) -> list[Trial]:
    """Laws whose strength may be that of no law, with whatever doubt the intervals of a fit were given.

    Of laws with one strength: components of a push may each be none, and not both. That of a law with a shape lies
    along a bent valley with it, and without the law there is no shape: the strength is asked with the shape held.
    doubted : the fit with intervals that hold what else may move its numbers
    """
    doubtful = []
    for trial in found:
        free, held = list(trial.term.free), fit
        if sum(not f.inner for f in free) > 1:
            continue
        if len(free) > 1:
            held, free = doubted(with_shape_held(fit, trial.label)), [f for f in free if not f.inner]
        if may_be_absent(held, free, held.hypothesis.rows(trial.label).start, spread):
            doubtful.append(trial)
    return doubtful


def known_together(found: Sequence[Trial], fit: Fit, first: int, spread: float) -> list[Trial]:
    """Laws of which only a combination is known: two or more whose strengths have no end on one side.

    A drag c against a push F that holds a body at F/c: any c will do, with an F to match. What is known of them is
    neither, and a number without an end is none that was found (contract 2). One such law alone is a limit.
    first, spread : as in ``intervals.with_limits``, whose limits these are
    """
    loose = []
    for trial, rows in zip(found, rows_of(found, first), strict=True):
        strengths = [(k, f) for k, f in enumerate(trial.term.free, rows.start) if not f.inner]
        if all(_endless(free, fit.interval(k, spread)[1:]) for k, free in strengths):
            loose.append(trial)
    return loose if len(loose) > 1 else []


def _endless(free: Free, ends: tuple[float, float]) -> bool:
    """Whether an interval ends at infinity, or where its search does."""
    bounds = zip(ends, (free.low, free.high), strict=True)
    return any(
        not np.isfinite(end) or (end == bound and bound != free.neutral and not free.natural) for end, bound in bounds
    )


def within_belief(
    found: Sequence[Trial], revised: Fit, recalibrated: Fit, fitter: Fitter, spread: float
) -> tuple[Fit, list[Trial]]:
    """The fit with what errors of the believed masses and radii add to its intervals, and laws that they imitate.

    Those whose strengths all have intervals that then hold their neutral values, and do so together (Wald's test with
    the whole covariance: of a stream beside an adjustable drag only products are known, and the intervals of both
    factors hold nought): masses and radii as far off as the experimenter says they may be do the same. None where
    nothing was said of such errors.
    """
    fit = with_believed_errors(fitter, revised, spread)
    alike = []
    if fit.believed is not None:
        for trial, rows in zip(found, rows_of(found, len(recalibrated.values)), strict=True):
            strengths = [(k, f) for k, f in enumerate(trial.term.free, rows.start) if not f.inner]
            ends = [(f.neutral, *fit.interval(k, spread)[1:]) for k, f in strengths]
            mine = [k for k, _ in strengths]
            away = fit.values[mine] - [f.neutral for _, f in strengths]
            covariance = (fit.covariance * spread + fit.believed)[np.ix_(mine, mine)]
            together = float(away @ np.linalg.pinv(covariance, hermitian=True) @ away)
            near = by_chance(together, len(mine)) and all_absent(ends)
            if near and by_chance(_imitated(found, trial, revised, recalibrated, fitter) / spread, len(mine)):
                alike.append(trial)
    return fit, alike


def _imitated(found: Sequence[Trial], trial: Trial, revised: Fit, recalibrated: Fit, fitter: Fitter) -> float:
    """By how much chi2 rises where errors of masses and radii, within their priors, take the place of a law.

    What the curvature at the end of a fit says of numbers that are known only as a product reaches nought in any case.
    """
    others = [t for t in found if t is not trial]
    fitted = {f.name for f in revised.hypothesis.free if f.prior}
    stand_in = stated_terms(fitter.cases, fitted)
    kept = [revised.values[: len(recalibrated.values)]]
    rows = rows_of(found, len(recalibrated.values))
    kept += [revised.values[r] for t, r in zip(found, rows, strict=True) if t is not trial]
    hypothesis = recalibrated.hypothesis.with_term(*(t.term for t in others), *stand_in)
    begin = np.concatenate([*kept, np.zeros(len(stand_in))])
    fit = fitter.fit(hypothesis, begin, revised.starts, evaluations=current().intervals.refit)
    return float(fit.chi2 - revised.chi2)


def _away(fit: Fit, k: int, neutral: float, spread: float) -> float:
    """How many standard errors number k is from where its law is absent: on that side, where it has a profile."""
    value, error = float(fit.values[k]), math.sqrt(max(float(fit.covariance[k, k]) * spread, 1e-300))
    if k in fit.profiles:
        low, high = fit.profiles[k]
        error = max((value - low if neutral < value else high - value) / current().intervals.normal, 1e-300)
    return abs(value - neutral) / error


def _weakest(found: Sequence[Trial], fit: Fit, first: int, spread: float) -> tuple[int, str, list[int]] | None:
    """The entry that is nearest to absent: its law's place, its body ("" where it is for all) and its numbers.

    None where the interval of at least one strength of every entry leaves out where the law is absent.
    """
    nearest: tuple[float, int, str, list[int]] | None = None
    for k, (trial, rows) in enumerate(zip(found, rows_of(found, first), strict=True)):
        for owner in owners(trial.term) or [""]:
            mine = [n for n, f in enumerate(trial.term.free) if not owner or f.name.endswith(f"[{owner}]")]
            away = 0.0
            for n in mine:
                if not trial.term.free[n].inner:
                    away = max(away, _away(fit, rows.start + n, trial.term.free[n].neutral, spread))
            if away < stats.norm.isf(current().verdict.absent / 2) and (nearest is None or away < nearest[0]):
                nearest = away, k, owner, mine
    return None if nearest is None else nearest[1:]
