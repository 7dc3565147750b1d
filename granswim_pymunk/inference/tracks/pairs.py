"""Two laws together: a second one beside the first, two that explain only together, and what could stand in place."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...laws import all_laws, has_role
from ..candidates import fastest_of, in_contact_alone, is_damping
from ..criteria import current
from ..driven_terms import last
from ..hypothesis import Failed, Free, Hypothesis, Term
from ..mechanisms import APPARATUS, field_alone
from ..significance import price
from ..trial import pair_gains, rows_of
from .choose import absurd, choose, of_laboratories, ordinary, worth
from .fit import Fitter, side_by_side
from .fitted import Fit, may_be_absent
from .name import Trial, is_limit, is_part, label_of, refit
from .nulls import noise_of, search_nulls
from .sets import SetSearch
from .signatures import Signature, make_bank

PUSHES = ("push", "medium")  # roles


def second_law(search: SetSearch, found: list[Trial], revised: Fit) -> tuple[list[Trial], Fit]:
    """Add a second law where it is significant and predicts better."""
    if not found:
        return found, revised
    apart = [t for t in search.terms if search.new(found[0].term, t) and not any_field(found[0].term, t, search.terms)]
    found, revised, best = _one_more(search, found, revised, apart)
    if best is None or best.fit is None:
        return found, revised
    first = found[0]
    search.scores[label_of(first, best)] = best.inner
    # beside the second law another drag than the one that came first alone may do better
    both = [*(replace(t, inner=best.inner) for t in search.as_in(best.fit, [first])), best]
    pair = _partners(search, both)
    if pair is not both and pair[0].fit is not None:
        return pair, pair[0].fit
    return [first, best], best.fit


def two_beside(search: SetSearch, found: list[Trial], revised: Fit) -> tuple[list[Trial], Fit]:
    """Two laws beside the one that was found, which explain together what neither does beside it alone.

    What a wrong scale, a wrong mass and a weak drag leave of each other is no noise, and its spread hides every one of
    them from the test of a second law. Pairs are ranked by their normal equations beside the one found; with both,
    each has to earn its place over what all three leave, and later data inside the training part are predicted better.
    Not through segments, where masses and radii leave such a rest in any case.
    """
    sets = current().sets
    if len(found) != 1 or search.fitter.segmented or search.spread(revised) <= 1 or found[0].term.special:
        return found, revised
    (law,), terms = found, search.terms
    rest = [
        t for t in terms
        if t.mechanism != law.mechanism and len(t.free) <= sets.numbers and not t.special
        and not any_field(law.term, t, terms) and not stands_beside(t)
    ]  # fmt: skip
    bank = make_bank(search.fitter, revised, rest)
    signatures, earned = bank.signatures, price(len(terms))
    ranked = pair_gains(bank.left, [s.term.mechanism for s in signatures], [s.directions for s in signatures])
    chosen: dict[frozenset[str], tuple[Signature, Signature]] = {}
    for both, i, j in ranked:
        a, b = signatures[i], signatures[j]
        helps = both - max(a.gain, b.gain) > sets.together and search.new(law.term, a.term, b.term)
        if helps and not any_field(a.term, b.term, terms):
            chosen.setdefault(frozenset((a.term.mechanism, b.term.mechanism)), (a, b))
        if len(chosen) == sets.partners:
            break
    pairs = list(chosen.values())
    single = {id(s): s for pair in pairs for s in pair}
    asked = [*pairs, *((s,) for s in single.values())]
    fits = side_by_side(search.fitter, [partial(fit_beside, base=revised, signatures=those) for those in asked])
    alone = dict(zip(single, (fit.chi2 for fit in fits[len(pairs) :]), strict=True))
    least, _ = search.inner.score(revised)
    best, answer = revised, found
    for (a, b), fit in zip(pairs, fits[: len(pairs)], strict=True):
        level, less = search.spread(fit), min(alone[id(a)], alone[id(b)])
        three = [law, Trial.untried(a), Trial.untried(b)]
        if fit.chi2 > best.chi2 or (less - fit.chi2) / level < earned or _idle(three, fit, search.first, level):
            continue
        score, _ = search.inner.score(fit)
        if score < least:
            best, answer = fit, search.scored(fit, three, score)
    return answer, best


def fit_beside(fitter: Fitter, base: Fit, signatures: Sequence[Signature]) -> Fit:
    """A fit with laws beside those of a fit, from their first-order amounts."""
    hypothesis = base.hypothesis.with_term(*(s.term for s in signatures))
    begin = np.array([f.first for s in signatures for f in s.term.free])
    values, starts = fitter.beside(base, hypothesis, begin)
    return fitter.fit(hypothesis, values, starts, evaluations=current().evaluations.pair)


def third_law(search: SetSearch, found: list[Trial], revised: Fit) -> tuple[list[Trial], Fit]:
    """Add a third law to two where it is significant, predicts better and leaves the other two their place."""
    if len(found) != 2:
        return found, revised
    own = [t.term for t in found]
    apart = [t for t in search.terms if search.new(*own, t) and not _any_field_of(found, t, search.terms)]
    two, alone, best = _one_more(search, found, revised, apart)
    if best is None or best.fit is None:
        return two, alone
    fit = best.fit
    idle = _idle(two, fit, search.first, search.spread(fit))
    if idle:
        # the third does what one of the two was there for: in its place it may lead where that one could not
        return _in_place(search, idle, two, best, alone)
    return search.scored(fit, [*two, best], best.inner), fit


def in_their_order(search: SetSearch, found: list[Trial], revised: Fit) -> tuple[list[Trial], Fit]:
    """Faults of a motor with a limit last in place of first, where the data are followed more closely that way.

    A command that is clipped and then lags is another one than a command that lags and is then clipped.
    """
    for k, law in enumerate(found):
        behind = last(law.term)
        if behind is None or not any(has_role(t.mechanism, "late") for t in found):
            continue
        other = [*found[:k], replace(law, signature=replace(law.signature, term=behind)), *found[k + 1 :]]
        hypothesis = search.scene_with(*(t.term for t in other))
        fit = search.fitter.fit(
            hypothesis, revised.values, revised.starts, evaluations=current().evaluations.exchange
        )
        if (revised.chi2 - fit.chi2) / search.spread(fit) > current().verdict.same:
            found, revised = search.scored(fit, other), fit
    return found, revised


def _idle(found: Sequence[Trial], fit: Fit, first: int, spread: float) -> list[Trial]:
    """Laws all of whose strengths are compatible with none; their numbers follow the ``first`` ones of the fit."""
    both = zip(found, rows_of(found, first), strict=True)
    return [t for t, rows in both if may_be_absent(fit, t.term.free, rows.start, spread)]


def _in_place(
    search: SetSearch, idle: Sequence[Trial], two: list[Trial], third: Trial, revised: Fit
) -> tuple[list[Trial], Fit]:
    """The third law in place of an idle one of the two, where the data then are followed more closely."""
    assert third.fit is not None
    best, fit = two, revised
    first, values = search.first, third.fit.values
    *own, last = rows_of([*two, third], first)
    for gone in idle:
        keep, rows = (two[1], own[1]) if gone is two[0] else (two[0], own[0])
        begin = [*values[:first], *values[rows], *values[last]]
        hypothesis = search.scene_with(keep.term, third.term)
        found = search.fitter.fit(hypothesis, begin, third.fit.starts, evaluations=current().evaluations.exchange)
        if found.chi2 < fit.chi2:
            best, fit = search.scored(found, [keep, third]), found
    return best, fit


def two_for_one(
    search: SetSearch, alive: Sequence[Trial], found: list[Trial], revised: Fit
) -> tuple[list[Trial], Fit]:
    """Two simple laws in place of one law, or two, with as many numbers or more, where these follow no better.

    What a stream, a bent picture, its middle sought, or a layer along walls can do is a little of many things: a drag
    there takes speed as a cushion and its friction do. A law beside it then has little left to explain, though two
    simple ones explain more. With as many numbers they have to be ahead by what a
    further law earns and predict better; with fewer they give the name where the data cannot tell (contract 2), and
    with as many that of a special fault, alone or beside another law, which hardly any laboratory has (as ``choose``).
    """
    used = sum(t.used for t in found)
    most = current().sets.numbers
    bends = used > most and any(t.numbers > most or t.special for t in found)
    law = all_laws().get(found[0].term.law) if len(found) == 1 else None
    layer = law is not None and any(p.within == "sight" for p in law.parameters)
    if not found or len(found) > 2 or not (bends or layer) or math.isinf(found[0].inner):
        return found, revised
    score = search.scores.get(label_of(*found), found[0].inner)
    best, pair = revised, list[Trial]()
    earned, same = price(len(search.terms)), current().verdict.same
    fault, bent = len(found) == 1 and found[0].special, any(t.special for t in found)
    # what two laws leave together is far from what first order says beside one that leaves much
    below = math.inf if fault or len(found) > 1 else revised.chi2 - earned
    for a, b, fit in _beside_each(search, alive, numbers=used, below=below):
        bends_too = a.term.special or b.term.special
        if fault and bends_too:
            continue
        fewer = used - len(a.term.free) - len(b.term.free) if fault or len(found) > 1 else 0
        plainer = fewer > 0 or (bent and not bends_too)
        # over what the better fit leaves: the other's spread is that of what it does not follow
        level = search.spread(min(revised, fit, key=lambda f: f.chi2))
        least = -same - 2 * fewer if plainer else earned
        if (revised.chi2 - fit.chi2) / level < least or (pair and fit.chi2 > best.chi2):
            continue
        now, _ = search.inner.score(fit)
        if now < score + (search.inner.slack if plainer else 0.0):
            best, score, pair = fit, now, search.scored(fit, [Trial.untried(a), Trial.untried(b)], now)
    if pair:
        pair = _partners(search, pair)
    return (pair, pair[0].fit or best) if pair else (found, revised)


def two_alike(
    search: SetSearch, alive: Sequence[Trial], law: Trial, numbers: int,
    behind: Callable[[Fit], float] | None = None,
) -> list[list[Trial]]:  # fmt: skip
    """Two simple laws with no more ``numbers``, which training data cannot tell from one, best first.

    A stream along a rail is a drag about a middle speed. So are friction and a drag with the square of the speed, until
    the body has become slow. A wind up along a fall is a drag in a picture whose scale is off.
    behind : by how much of chi2 over the spread a fit is behind the law; in the noise as it was found where not given
    """
    assert law.fit is not None
    single, spread = law.fit, search.spread(law.fit)

    def as_found(fit: Fit) -> float:
        return float(fit.chi2 - single.chi2) / spread

    behind = behind or as_found
    same, best = current().verdict.same, dict[frozenset[str], tuple[float, Signature, Signature, Fit]]()
    for a, b, fit in (*_beside_each(search, alive, numbers=numbers), *_in_place_of(search, law, numbers)):
        if a.term.special or b.term.special:
            continue
        left = behind(fit) + 2 * (len(a.term.free) + len(b.term.free) - law.used)
        labels = frozenset((a.term.label, b.term.label))
        if left < min(same, best[labels][0] if labels in best else same):
            best[labels] = left, a, b, fit
    nearest = sorted(best.values(), key=lambda f: f[0])[: current().verdict.instead]
    return [search.scored(fit, [Trial.untried(a), Trial.untried(b)]) for _, a, b, fit in nearest]


def _in_place_of(search: SetSearch, law: Trial, numbers: int) -> list[tuple[Signature, Signature, Fit]]:
    """The pairs that follow short pieces of the recordings best, to first order, each refitted from there to the whole.

    Beside a scene without either a law that leaves most is no leader, and its signature is that of another path. Pieces
    with starts of their own lie along the path that was seen, as they do for ``name._from_pieces``. Not through
    impacts, nor of many bodies, whose pieces have too many starts.
    """
    if search.fitter.segmented or search.fitter.of_many_numbers:
        return []
    own = search.fitter.in_pieces(current().refits.pieces)
    simple = [t for t in search.terms if t.mechanism != law.mechanism and not t.special]
    simple = [t for t in simple if not stands_beside(t) and not any(f.inner for f in t.free)]
    try:
        plain = own.fit(search.base.hypothesis, search.base.values)
        bank = make_bank(own, plain, simple)
    except Failed:
        return []
    signatures = bank.signatures
    ranked = []
    for gain, i, j in pair_gains(bank.left, [t.mechanism for t in simple], [s.directions for s in signatures]):
        a, b = signatures[i], signatures[j]
        used = len(a.term.free) + len(b.term.free)
        if used <= numbers and not any_field(a.term, b.term, search.terms):
            ranked.append((gain - 2 * used, a, b))
    nearest = sorted(ranked, key=lambda r: -r[0])[: current().sets.seconds]

    def followed(whole: Fitter, a: Signature, b: Signature) -> Fit | None:
        try:
            return whole.fit_from(fit_beside(own.apart(), plain, (a, b)))
        except Failed:
            return None

    fits = side_by_side(search.fitter, [partial(followed, a=a, b=b) for _, a, b in nearest])
    return [(a, b, fit) for (_, a, b), fit in zip(nearest, fits, strict=True) if fit is not None]


def drag_and_push(search: SetSearch, found: list[Trial], revised: Fit) -> tuple[list[Trial], Fit]:
    """A stream that hardly moves told as what it is then: a drag in still air, and a steady push.

    -c (v - u) is -c v + c u. Where u is small beside the speeds of the bodies the law is a drag, with a correction that
    a table which is not level makes as well. Both are kept where the data cannot prefer the stream.
    """
    laws = all_laws()
    for k, stream in enumerate(found):
        law = laws.get(stream.term.law)
        moved = [a for p in law.parameters if p.within == "speed" for a in p.arguments] if law is not None else []
        if not moved or len(found) > 2 or any(has_role(t.mechanism, *PUSHES) for t in found if t is not stream):
            continue
        first = search.first
        rows = rows_of(found, first)
        own = zip(stream.term.free, revised.values[rows[k]], strict=True)
        speed = [float(v) for f, v in own if f.name.split(".")[-1] in moved]
        if not speed or math.hypot(*speed) > current().sets.stream * fastest_of(search.training):
            continue
        others = [t for t in found if t is not stream]
        keep = [revised.values[:first], *(revised.values[rows[n]] for n in range(len(found)) if n != k)]
        # at rest it is one of the drags that its forms are then
        at_rest = {name for other in laws.values() if other.mechanism == stream.mechanism for name in other.nests}
        plain = [t for t in search.terms if t.mechanism in at_rest and len(t.free) == 1]
        pushes = [t for t in search.terms if has_role(t.mechanism, "push") and not is_part(t, search.terms)]
        best: tuple[Fit, Signature, Signature] | None = None
        for term in plain if pushes else []:
            hypothesis = search.scene_with(*(t.term for t in others), term)
            drag = make_bank(search.fitter, search.base, [term])
            alone = search.fitter.fit(hypothesis, np.concatenate([*keep, revised.values[rows[k]][:1]]), revised.starts)
            push = make_bank(search.fitter, alone, pushes[:1]).signatures[0]
            fit = refit(search.fitter, alone, push, (1.0,))
            if best is None or fit.chi2 < best[0].chi2:
                best = fit, drag.signatures[0], push
        if best is None or (best[0].chi2 - revised.chi2) / search.spread(best[0]) > current().verdict.same:
            continue
        fit, drag_, push = best
        two = [Trial.untried(replace(drag_, term=fit.hypothesis.terms[-2])), Trial.untried(push)]
        return search.scored(fit, [*others, *two]), fit
    return found, revised


def _one_more(
    search: SetSearch, found: list[Trial], revised: Fit, terms: Sequence[Term]
) -> tuple[list[Trial], Fit, Trial | None]:
    """The law beside those found that is significant and predicts better, None where there is none.

    Also those found and their fit, which may have got free from where it was stuck.
    """
    sets = current().sets
    nothing: tuple[list[Trial], Fit, None] = (found, revised, None)
    taken = {t.mechanism for t in found}
    rest = [t for t in terms if t.mechanism not in taken]
    beside = make_bank(search.fitter, revised, rest)
    # where something else is wrong too, a law with many numbers fits whatever that is; not the one that is sought
    spread = search.spread(revised)
    most = max(sets.numbers, *(t.numbers for t in found))
    open_ = [s for s in beside.signatures if spread <= 1 or len(s.term.free) <= most or search.seeks_for(s.term)]
    shown = sorted((s for s in open_ if _shows(s, spread, revised)), key=lambda s: -s.gain)
    order = leaders(shown, sets.seconds)
    order += [s for s in open_ if is_limit(s.term) and not any(s is o for o in order)]  # no first order in a limit
    late = _as_late(search, revised, found, open_)
    order = [s for s in order if not any(s is o for o, _ in late)]
    more = [*late, *_in_other_orders(search, revised, found, order)]
    fits = [*_refitted(search, revised, order), *(fit for _, fit in more)]
    order += [s for s, _ in more]
    trials = [Trial(s, fit, revised.chi2 - fit.chi2, float("inf")) for s, fit in zip(order, fits, strict=True)]
    if not trials:
        return nothing
    best_fit = min((t.fit for t in trials if t.fit), key=lambda f: f.chi2)
    spread = search.spread(best_fit)
    base_inner, base_by = search.inner.score(revised)
    scored = []
    noticed = [t for t in trials if worth(t, spread) > current().verdict.noticed]
    for t, (score, by_case) in zip(noticed, search.inner.scores([t.fit for t in noticed if t.fit]), strict=True):
        better = np.mean([by_case[k] < base_by[k] for k in by_case if k in base_by] or [False])
        scored.append((replace(t, inner=score), float(better)))
    good = (
        [t for t, better in scored if t.inner < sets.better * base_inner and better > sets.recordings]
        if spread > 1
        else [t for t, _ in scored if t.inner < base_inner + search.inner.slack]
    )
    # what may as well be absent stands in the way of no other: of joints of their own one may have none
    good = [t for t in good if t.fit is not None and _away_from_absent(t.fit, t, spread)] or good
    best = choose(good, spread, base_inner + search.inner.slack, len(beside.signatures)) if good else None
    if best is None or best.fit is None:
        return nothing
    null = search_nulls(
        beside, noise_of(best.fit, search.fitter.cases, spread),
        np.array([s.surviving > current().signatures.shows for s in beside.signatures]),
        best.gain, sets.replicates_second, search.rng,
    )  # fmt: skip
    if null.p > current().verdict.alarm:
        return nothing
    found = _as_ordered(found, best.fit)
    # those found may only have been stuck: refitted alone from where all ended
    alone = search.fitter.fit(revised.hypothesis, best.fit.values[: len(revised.values)], best.fit.starts)
    if alone.chi2 < revised.chi2:
        found, revised = search.as_in(alone, found), alone
    gain = (revised.chi2 - best.fit.chi2) / spread
    if gain < price(len(beside.signatures), best.numbers) or not _away_from_absent(best.fit, best, spread):
        return found, revised, None
    return found, revised, best


def leaders(ranked: Sequence[Signature], count: int) -> list[Signature]:
    """Of signatures, best first, the first ``count``, and those of the first ``count`` mechanisms.

    Of each of these the best, and the form of its law with fewest numbers: one with a number for each body is never
    behind the one with one for all, and what bodies at rest make of a friction is far from first order, so that only a
    refit tells whether one number is enough.
    """
    by_name: dict[str, list[Signature]] = {}
    for s in ranked:
        by_name.setdefault(s.term.mechanism, []).append(s)
    chosen = list(ranked[:count])
    for forms in list(by_name.values())[:count]:
        best, fewest = forms[0], min(len(s.term.free) for s in forms)
        plainer = [s for s in forms if len(s.term.free) == fewest and s.term.law == best.term.law]
        mine = [best, *plainer[:1]] if len(best.term.free) > fewest else [best]
        chosen += [s for s in mine if not any(s is other for other in chosen)]
    return chosen


def _nearest(ranked: Sequence[Signature], count: int) -> list[Signature]:
    """The same, and the best of those that stand beside others alone: they take no other law's place."""
    named, beside = ([s for s in ranked if stands_beside(s.term) is kind] for kind in (False, True))
    return leaders(named, count) + beside[:1]


def _refitted(search: SetSearch, base: Fit, signatures: Sequence[Signature]) -> list[Fit]:
    """A fit with each of these laws beside those of a fit."""
    jobs = [partial(refit, base=base, signature=s, stages=(1.0,)) for s in signatures]
    return side_by_side(search.fitter, jobs)


def _as_late(
    search: SetSearch, revised: Fit, found: Sequence[Trial], signatures: Sequence[Signature]
) -> list[tuple[Signature, Fit]]:
    """Laws that are late beside one that is, each with its best fit from where both share what that one has alone.

    A lag is a delay to first order, so that beside one nothing shows of it, while the one has taken the time of both.
    """
    late = [s for s in signatures if has_role(s.term.mechanism, "late") and len(s.term.free) == 1]
    if not late or not any(has_role(t.mechanism, "late") for t in found):
        return []
    rows = rows_of(found, search.first)
    own = [at.start for t, at in zip(found, rows, strict=True) if has_role(t.mechanism, "late") and t.numbers == 1]
    if not own:
        return []

    def shared(fitter: Fitter, signature: Signature, part: float) -> Fit:
        begin = np.append(revised.values, 0.0)
        begin[own[0]], begin[-1] = (1 - part) * revised.values[own[0]], part * revised.values[own[0]]
        hypothesis = revised.hypothesis.with_term(signature.term)
        return fitter.fit(hypothesis, begin, revised.starts, evaluations=current().evaluations.limit)

    asked = [(s, part) for s in late for part in current().refits.parts]
    fits = side_by_side(search.fitter, [partial(shared, signature=s, part=part) for s, part in asked])
    tried = list(zip(asked, fits, strict=True))
    return [(s, min((fit for (of, _), fit in tried if of is s), key=lambda f: f.chi2)) for s in late]


def _in_other_orders(
    search: SetSearch, revised: Fit, found: Sequence[Trial], signatures: Sequence[Signature]
) -> list[tuple[Signature, Fit]]:
    """Limits and what is late with the limit last, each with its fit: see ``in_their_order``."""
    asked = list[tuple[Signature, Fit]]()
    if any(has_role(t.mechanism, "late") for t in found):
        behind = ((s, last(s.term)) for s in signatures)
        asked = [(replace(s, term=term), revised) for s, term in behind if term is not None]
    else:
        base = _limits_last(revised)
        asked = [(s, base) for s in signatures if base is not revised and has_role(s.term.mechanism, "late")]
    jobs = [partial(refit, base=base, signature=s, stages=(1.0,)) for s, base in asked]
    fits = side_by_side(search.fitter, jobs) if jobs else []
    return [(s, fit) for (s, _), fit in zip(asked, fits, strict=True)]


def _limits_last(fit: Fit) -> Fit:
    """The same fit with limits that would act behind what is late, of which there is none; itself without a limit."""
    terms = tuple(last(t) or t for t in fit.hypothesis.terms)
    return fit if terms == fit.hypothesis.terms else replace(fit, hypothesis=Hypothesis(terms))


def _as_ordered(found: list[Trial], fit: Fit) -> list[Trial]:
    """Laws in the order that they have in a fit with one more, which comes last."""
    terms = fit.hypothesis.terms[-len(found) - 1 : -1]
    both = zip(found, terms, strict=True)
    return [t if t.term is term else replace(t, signature=replace(t.signature, term=term)) for t, term in both]


def _shows(signature: Signature, spread: float, fit: Fit) -> bool:
    """Whether a law is worth a refit beside those of a fit, to first order.

    Where a fit still leaves far more than noise, its spread is that of what is missing, and hides it.
    """
    criteria = current()
    if signature.surviving <= criteria.signatures.shows:
        return False
    least = min(criteria.verdict.noticed * spread, criteria.sets.part * (fit.chi2 - fit.count))
    return signature.gain > max(least, criteria.verdict.noticed)


def pair_of(search: SetSearch, alive: Sequence[Trial], best: float) -> list[Trial]:
    """Two laws that explain together what neither does alone, none where there is no such pair.

    ``alive``: laws fitted alone, beside which others are looked for.  ``best``: the inner score that they have to beat.
    """
    sets = current().sets
    found = [
        (a, b, fit)
        for a, b, fit in _to_their_ends(search, _from_the_first_third(search) + _beside_each(search, alive))
        if (search.base.chi2 - fit.chi2) / search.spread(fit) >= sets.both + 2 * len(fit.hypothesis.free)
    ]  # fmt: skip
    scores = search.inner.scores([fit for *_, fit in found])
    most = most_of_a_pair(best)
    pairs = [_Pair(*of, score) for of, (score, _) in zip(found, scores, strict=True) if score < most]
    for pair in _in_order(search, pairs):
        fit = pair.fit
        whole = make_bank(search.fitter, search.base, [pair.a.term, pair.b.term])
        noise, wanted = noise_of(fit, search.fitter.cases, search.spread(fit)), np.ones(2, dtype=bool)
        gain = search.base.chi2 - fit.chi2
        if search_nulls(whole, noise, wanted, gain, sets.replicates_pair, search.rng).p > current().verdict.alarm:
            continue
        winner = search.scored(fit, [Trial.untried(pair.a), Trial.untried(pair.b)], pair.score)
        return _partners(search, search.as_in(fit, winner))
    return []


def most_of_a_pair(best: float) -> float:
    """What the inner score of the first pair has to stay below, where ``best`` is that of what there is.

    Noise has a score of 1: what predictions exceed it by has to fall clearly.
    """
    clearly = current().sets.clearly
    return min(max(clearly * best, 1 + clearly * (best - 1)), best)


def _to_their_ends(
    search: SetSearch, pairs: Sequence[tuple[Signature, Signature, Fit]]
) -> list[tuple[Signature, Signature, Fit]]:
    """Fits of pairs, gone on with: strength and shape of a law lie along a valley, and are walked to its end.

    Half way along it the right pair may be no better than another one at its end.
    """
    enough = current().evaluations.pair_valley

    def walked(own: Fitter, fit: Fit) -> Fit:
        return own.refitted(fit, evaluations=enough)

    fits = side_by_side(search.fitter, [partial(walked, fit=fit) for *_, fit in pairs])
    return [(a, b, fit) for (a, b, _), fit in zip(pairs, fits, strict=True)]


@dataclass(frozen=True)
class _Pair:
    """Two laws fitted together; ``score``: inside the training part."""

    a: Signature
    b: Signature
    fit: Fit
    score: float

    @property
    def rank(self) -> tuple[int, int, int]:
        """How many numbers it has, how many special faults of the apparatus, and how many of any kind."""
        terms = self.a.term, self.b.term
        faults = [t for t in terms if t.mechanism in APPARATUS]
        return sum(len(t.free) for t in terms), sum(t.special for t in terms), len(faults)


def _in_order(search: SetSearch, pairs: Sequence[_Pair]) -> list[_Pair]:
    """Pairs, best first; of those that cannot be told apart from the best, that with fewest numbers (as ``choose``).

    By chi2 where the best leaves noise, otherwise by what they predict inside the training part.
    """
    if not pairs:
        return []
    best = min(pairs, key=lambda p: p.score)
    level = search.spread(best.fit)

    def paid(p: _Pair) -> float:
        return p.fit.chi2 / level + 2 * len(p.fit.values)

    least = min(map(paid, pairs))

    def as_good(p: _Pair) -> bool:
        if level <= 1:
            return paid(p) - least < current().verdict.same
        return p.score < current().sets.same_score * best.score

    return sorted(pairs, key=lambda p: (0, *p.rank, p.score) if as_good(p) else (1, 0, 0, 0, p.score))


def _from_the_first_third(search: SetSearch) -> list[tuple[Signature, Signature, Fit]]:
    """Two laws that help only together (a repulsion at a distance and a drag), best first.

    Signatures of the first third of each track rank the pairs, where the prediction is still linear in them;
    the best are refitted on growing parts.
    """
    third = {}
    for case in search.fitter.cases:
        rows = np.flatnonzero(search.fitter.frames[case.name])
        third[case.name] = np.zeros(len(case.t), dtype=bool)
        third[case.name][rows[: max(len(rows) // 3, min(12, len(rows)))]] = True
    whole = search.fitter
    short = Fitter(whole.cases, whole.predictor, third, whole.stop).tightened(whole.closeness)
    start = short.fit(search.base.hypothesis, search.base.values)
    bank = make_bank(short, start, [t for t in search.terms if len(t.free) <= 2 and not stands_beside(t)])
    tried: set[tuple[str, str]] = set()
    mechanisms = [s.term.mechanism for s in bank.signatures]
    ranked = pair_gains(bank.left, mechanisms, [s.directions for s in bank.signatures])
    beyond = [(both - max(bank.signatures[i].gain, bank.signatures[j].gain), i, j) for both, i, j in ranked]
    chosen = []
    for extra, i, j in sorted(beyond, reverse=True):
        a, b = bank.signatures[i], bank.signatures[j]
        names = (a.term.mechanism, b.term.mechanism)
        if extra <= current().sets.together or len(tried) == current().sets.pairs:
            break
        new = names not in tried and search.new(a.term, b.term)
        if new and not any_field(a.term, b.term, search.terms):  # the best of their variants comes first
            tried.add(names)
            chosen.append((a, b))
    how = current().evaluations

    def fitted(own: Fitter, a: Signature, b: Signature) -> Fit:
        hypothesis = search.scene_with(a.term, b.term)
        return own.fit(hypothesis, None, start.starts, stages=how.growing, evaluations=how.pair)

    fits = side_by_side(search.fitter, [partial(fitted, a=a, b=b) for a, b in chosen])
    return [(a, b, fit) for (a, b), fit in zip(chosen, fits, strict=True)]


def _beside_each(
    search: SetSearch, alive: Sequence[Trial], numbers: float = math.inf, below: float = math.inf
) -> list[tuple[Signature, Signature, Fit]]:
    """Beside each of the laws that explain most alone, the ones that explain most of what it leaves, best first.

    Of what leaves nearly as little, to first order, the one with fewest numbers is asked as well: a lift beside a drag,
    where a stream comes first.
    numbers : that both have together at most;  below : where chi2 is to first order
    """
    sets, firsts = current().sets, list[Trial]()
    for t in alive:
        variant = sum(t.mechanism == f.mechanism for f in firsts)
        if t.fit is not None and t.numbers < numbers and variant < sets.variants and len(firsts) < sets.firsts:
            firsts.append(replace(t, fit=search.fitter.of_these_segments(t.fit)))
    ranked, plainer = [], []
    for first in firsts:
        assert first.fit is not None
        spread = search.spread(first.fit)
        others = [t for t in search.terms if t.mechanism != first.mechanism]
        others = [t for t in others if not any_field(first.term, t, search.terms)]
        others = [t for t in others if first.numbers + len(t.free) <= numbers and search.new(first.term, t)]
        bank = make_bank(search.fitter, first.fit, others)
        beside = [s for s in bank.signatures if _shows(s, spread, first.fit)]
        beside = sorted((s for s in beside if first.fit.chi2 - s.gain < below), key=lambda s: -s.gain)
        left = {id(s): first.fit.chi2 - s.gain for s in beside}
        ranked += [(place, left[id(s)], first, s) for place, s in enumerate(beside)]
        near = [s for s in beside if left[id(s)] < sets.as_well * left[id(beside[0])] and not stands_beside(s.term)]
        fewest = min(near, key=lambda s: (len(s.term.free), left[id(s)]), default=None)
        if fewest is not None and fewest is not beside[0]:
            plainer.append((left[id(fewest)], first, fewest))
    chosen: dict[frozenset[str], tuple[Trial, Signature]] = {}
    for _, _, first, second in sorted(ranked, key=lambda r: r[:2]):
        chosen.setdefault(frozenset((first.term.label, second.term.label)), (first, second))
    every = chosen.values()
    named, extra = ([pair for pair in every if stands_beside(pair[1].term) is kind] for kind in (False, True))
    pairs = named[: sets.pairs] + extra[: sets.variants]
    more = [(first, s) for _, first, s in sorted(plainer, key=lambda p: p[0])[: sets.partners]]
    pairs += [pair for pair in more if not any(pair[0] is a and pair[1] is b for a, b in pairs)]

    def fitted(own: Fitter, first: Trial, second: Signature) -> Fit:
        assert first.fit is not None
        return refit(own, first.fit, second, (1.0,))

    fits = side_by_side(search.fitter, [partial(fitted, first=first, second=second) for first, second in pairs])
    return [(first.signature, second, fit) for (first, second), fit in zip(pairs, fits, strict=True)]


def stands_beside(term: Term) -> bool:
    """Whether a candidate has a name beside another law alone: it is asked with others and takes no place of theirs."""
    return field_alone([term.mechanism])


def any_field(a: Term, b: Term, terms: Sequence[Term]) -> bool:
    """Whether both push, or one of them on some of the bodies only: together they imitate any force in space.

    What goes with the speed of bodies, or acts where they touch, is no force in space, and has its place beside a push
    on one of them. So do a force from a point that nobody sees, or that of a curved surface, and one between bodies: of
    disks that repel one another their middle repels each.
    """
    places = any(has_role(t.mechanism, "source") or stands_beside(t) for t in (a, b))
    if places and (_at_a_distance(a) or _at_a_distance(b)):
        return True
    if field_alone((a.mechanism, b.mechanism)):
        return True
    pushes = [t for t in (a, b) if has_role(t.mechanism, *PUSHES)]
    if len(pushes) != 1:
        return len(pushes) == 2
    other = b if pushes[0] is a else a
    return is_part(pushes[0], terms) and not (goes_with_speed(other) or in_contact_alone(other))


def _any_field_of(found: Sequence[Trial], term: Term, terms: Sequence[Term]) -> bool:
    """The same of a law beside several; a push on all and a curved surface are none beside what is no field itself."""
    fields = [t for t in found if any_field(t.term, term, terms)]
    whole = not any(is_part(t, terms) for t in (term, *(f.term for f in fields)))
    flat = whole and all(field_alone((t.mechanism, term.mechanism)) for t in fields)
    return bool(fields) and not (flat and len(fields) < len(found))


def _at_a_distance(term: Term) -> bool:
    """Whether a force acts between bodies that do not touch, whatever their speeds."""
    law = all_laws().get(term.law)
    return law is not None and law.kind == "pair" and bool(law.reach) and not goes_with_speed(term)


def goes_with_speed(term: Term) -> bool:
    """Whether a force goes with the speed of a body, or of one towards another."""
    law = all_laws().get(term.law)
    return law is not None and (law.damping or bool({"vn", "vt"} & set(law.arguments)))


def _partners(search: SetSearch, pair: list[Trial]) -> list[Trial]:
    """The pair with its drag exchanged, its shapes begun anew where that follows better, and the drag once more."""
    best = _exchanged(search, pair)
    shaped = _of_typical_shape(search, best)
    return best if shaped is best else _exchanged(search, shaped)


def _of_typical_shape(search: SetSearch, pair: list[Trial]) -> list[Trial]:
    """The pair refitted from the shapes that its laws begin with as candidates, where that follows the bodies better.

    A strength at some distance and the power of a force lie along a bent valley, at whose far end (a strength of 84
    times the true one, a power of 5.5 for 2) many laws end that helped only together. Strengths begin at the amounts
    that move the bodies as the present ones do.
    """
    best, fit = pair, pair[0].fit
    assert fit is not None
    for law, own in zip(pair, rows_of(pair, search.first), strict=True):
        hypothesis, now = fit.hypothesis, fit
        inner = [k for k in range(own.start, own.stop) if hypothesis.free[k].inner]
        strengths = [k for k in range(own.start, own.stop) if not hypothesis.free[k].inner]
        if not inner or len(strengths) != 1:
            continue
        (at,) = strengths
        free = hypothesis.free[at]
        moved = _column(search.fitter, now, at) * (now.values[at] - free.neutral)
        alike = [t for t in search.terms if t.label == law.term.label and len(t.free) == own.stop - own.start]
        shapes = sorted({tuple(t.free[k - own.start].first for k in inner) for t in alike})
        jobs = [partial(_of_shape, now=now, at=at, moved=moved, inner=inner, shape=shape) for shape in shapes]
        for found in side_by_side(search.fitter, jobs):
            if found is not None and _gains_more(search, found, best):
                best, fit = search.as_in(found, best), found
    return best


def _of_shape(
    fitter: Fitter, now: Fit, at: int, moved: np.ndarray, inner: list[int], shape: tuple[float, ...]
) -> Fit | None:
    """A fit begun anew with another shape in its rows ``inner`` and a strength, in row ``at``, that moves as much."""
    free, how = now.hypothesis.free[at], current().evaluations
    begin = now.values.copy()
    begin[inner], begin[at] = shape, free.neutral
    amount = _as_much(_column(fitter, fitter.fit(now.hypothesis, begin, now.starts, stages=()), at), moved, free)
    if amount is None:
        return None
    begin[at] = amount
    found = fitter.fit(now.hypothesis, begin, now.starts, stages=how.growing, evaluations=how.pair)
    return fitter.refitted(found, evaluations=how.pair_valley)


def _gains_more(search: SetSearch, found: Fit, best: Sequence[Trial]) -> bool:
    """Whether a fit follows better than the best laws so far, by more than data that cannot tell two laws apart."""
    return search.base.chi2 - found.chi2 > best[0].gain + current().verdict.same * search.spread(found)


def _column(fitter: Fitter, fit: Fit, at: int) -> np.ndarray:
    """(n,) derivatives of all that a fit predicts by one of its numbers."""
    return np.concatenate([fit.jacobian[c.name][0][:, at] for c in fitter.cases])


def _as_much(column: np.ndarray, moved: np.ndarray, free: Free) -> float | None:
    """The strength that moves bodies as ``moved`` (n,) says, within its bounds; None where it moves none.

    column (n,): derivatives by the strength, where it is absent.
    """
    power = float(column @ column)
    return float(np.clip(free.neutral + column @ moved / power, free.low, free.high)) if power else None


def _exchanged(search: SetSearch, pair: list[Trial]) -> list[Trial]:
    """The pair with its drag (a law of one strength on single bodies) exchanged for every other, the best of them.

    The signatures that found the pair were those of a short first part, where one drag looks like another.
    Each begins at the amount that moves the bodies as the present one does.
    """
    best, fit = pair, pair[0].fit
    assert fit is not None
    offset = search.first
    for which in (0, 1):
        term, keep = pair[which].term, pair[1 - which]
        if not is_damping(term):
            continue
        own = rows_of(pair, offset)
        at, rows = own[which].start, own[1 - which]
        moved = _column(search.fitter, fit, at) * fit.values[at]
        others = [t for t in search.terms if is_damping(t) and t.label != term.label]
        others = [t for t in others if t.mechanism != keep.mechanism]
        signatures = make_bank(search.fitter, fit, others).signatures
        kept = [*fit.values[:offset], *fit.values[rows]]
        jobs = [
            partial(_with_another, fit=fit, hypothesis=search.scene_with(keep.term, s.term), kept=kept, moved=moved)
            for s in signatures
        ]
        fits = side_by_side(search.fitter, jobs)
        for signature, found in zip(signatures, fits, strict=True):
            if found is not None and _gains_more(search, found, best):
                best = search.scored(found, [keep, Trial.untried(signature)])
    return best


def _with_another(
    fitter: Fitter, fit: Fit, hypothesis: Hypothesis, kept: list[float], moved: np.ndarray
) -> Fit | None:
    """The last law of a hypothesis in place of one of a fit, from the ``kept`` numbers and a strength that moves as
    much."""
    other = hypothesis.terms[-1]
    alone = fitter.fit(fit.hypothesis.with_term(other), [*fit.values, 0.0], fit.starts, stages=())
    amount = _as_much(_column(fitter, alone, -1), moved, other.free[0])
    if amount is None:
        return None
    return fitter.fit(hypothesis, [*kept, amount], fit.starts, evaluations=current().evaluations.exchange)


def _away_from_absent(fit: Fit, trial: Trial, spread: float) -> bool:
    """Whether the interval of at least one strength of the last term leaves out where the law is absent."""
    return not may_be_absent(fit, trial.term.free, len(fit.values) - trial.numbers, spread)


@dataclass(frozen=True)
class Exchange:
    """A law refitted in place of one of several, how far it is ``ahead`` of it in chi2 over the spread, less AIC.

    keep : the others, which stay
    """

    keep: tuple[Trial, ...]
    replaced: Trial
    trial: Trial
    ahead: float

    @property
    def alike(self) -> bool:
        """Whether training data cannot tell it from the law that it replaces, or prefer it."""
        return self.ahead > -current().verdict.same


def exchanges(search: SetSearch, found: list[Trial], revised: Fit) -> list[Exchange]:
    """Laws in place of one of those found, of each name the one that is ahead, numbers paid for; best first.

    Beside the others alone they are ranked by signatures, and those that come near are refitted; of which a number
    ends at its bound, none stays.
    """
    result: dict[str, Exchange] = {}
    first, spread = search.first, search.spread(revised)
    rows = rows_of(found, first)
    for k in reversed(range(len(found))):
        replaced, keep = found[k], tuple(t for t in found if t is not found[k])
        hypothesis = search.scene_with(*(t.term for t in keep))
        begin = [revised.values[:first], *(revised.values[rows[n]] for n in range(len(found)) if n != k)]
        alone = search.fitter.fit(hypothesis, np.concatenate(begin), revised.starts)
        others = [t for t in search.terms if t.mechanism not in {f.mechanism for f in found}]
        ranked = sorted(make_bank(search.fitter, alone, others).signatures, key=lambda s: -s.gain)
        lost = alone.chi2 - revised.chi2
        near = _nearest([s for s in ranked if s.gain > current().sets.near_partner * lost], current().sets.partners)
        for signature, fit in zip(near, _refitted(search, alone, near), strict=True):
            trial = Trial(signature, fit, search.base.chi2 - fit.chi2, float("inf"))
            ahead = (revised.chi2 - fit.chi2) / spread - 2 * (trial.used - replaced.used)
            best = result.get(trial.mechanism)
            if trial.gain > 0 and not absurd(trial) and (best is None or ahead > best.ahead):
                result[trial.mechanism] = Exchange(keep, replaced, trial, float(ahead))
    return sorted(result.values(), key=lambda e: -e.trial.gain)


def settled(search: SetSearch, found: list[Trial], revised: Fit) -> tuple[list[Trial], Fit, list[Exchange]]:
    """Several laws, one or another exchanged as long as that does better, and what could stand in their place."""
    score = search.scores.get(label_of(*found), found[0].inner)
    others: list[Exchange] = []
    for _ in range(current().sets.rounds):
        others = exchanges(search, found, revised)
        open_ = [e for e in others if not _any_field_beside(search, e)]
        better = max(open_, key=lambda e: e.ahead, default=None)
        if better is None or better.ahead <= current().verdict.same or better.trial.fit is None:
            break
        now, _ = search.inner.score(better.trial.fit)
        if not now < score:
            break
        score, revised = now, better.trial.fit
        found = search.scored(revised, [*better.keep, better.trial], now)
        others = []
    others = others or exchanges(search, found, revised)
    simpler = _simpler(search, others)
    if simpler is not None and simpler.trial.fit is not None:
        revised = simpler.trial.fit
        found = search.scored(revised, [*simpler.keep, simpler.trial])
        others = exchanges(search, found, revised)
    return found, revised, others


def _simpler(search: SetSearch, others: Sequence[Exchange]) -> Exchange | None:
    """Of laws that cannot be told apart from one of those found, the best with fewest numbers; None without one.

    As of one law (``choose``). Contract 2: of a class the first has fewest parameters. With as many numbers what any
    laboratory is off by, a mass by a per cent, goes before physics.
    """

    def simpler(e: Exchange) -> bool:
        usual = ordinary(e.trial) and not of_laboratories(e.replaced)
        return e.trial.used < e.replaced.used or (e.trial.used == e.replaced.used and usual)

    same = [e for e in others if e.alike and simpler(e) and not _any_field_beside(search, e)]
    return min(same, key=lambda e: (e.trial.used - e.replaced.used, -e.ahead), default=None)


def _any_field_beside(search: SetSearch, e: Exchange) -> bool:
    """Whether a law that stands in place of another makes any field beside one of those that stay."""
    return any(any_field(t.term, e.trial.term, search.terms) for t in e.keep)


def rivals_of_pair(others: Sequence[Exchange]) -> list[tuple[Trial, bool]]:
    """Laws that may stand in place of one of those found, best first; True where these data cannot tell, all such."""
    first = [e for e in others if e.alike]
    rest = [e for e in others if not e.alike][: max(current().verdict.rivals_of_pair - len(first), 0)]
    return [(e.trial, e.alike) for e in (*first, *rest)]


def as_well_in_place(others: Sequence[Exchange], named: Collection[str]) -> list[str]:
    """A line for each law that does as well in place of one of the mechanisms that are ``named`` in the end.

    What else was found and went, or was exchanged itself, tells a reader nothing.
    """
    return [
        f"{e.trial.mechanism} in place of {e.replaced.mechanism} does as well"
        for e in others
        if e.alike and e.trial.mechanism not in named and {t.mechanism for t in (*e.keep, e.replaced)} <= {*named}
    ]
