"""Whom each of several laws acts on, and whether one number does for all of them: asked when all laws are there.

Before that it cannot be asked: a body that a second force pushes along seems to feel no friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ... import distributions as stats
from ..candidates import owners
from ..criteria import current
from ..trial import rows_of
from .choose import prune
from .fitted import Fit
from .name import Trial
from .sets import SetSearch


def whom(search: SetSearch, found: list[Trial], revised: Fit) -> tuple[list[Trial], Fit, dict[str, str]]:
    """Two or more laws, each kept for the bodies whose own data ask for it, with one number where one will do.

    Also, for each body that a law was not kept for, why.
    """
    dropped: dict[str, str] = {}
    if len(found) < 2:
        return found, revised, dropped
    for _ in range(len(found)):
        # each in turn comes last, behind all the others; after the last turn they stand as they did
        law, *others = found
        law, revised = _behind(search, law, others, revised)
        if len(owners(law.term)) < 2:
            found = [*others, law]
            continue
        base = _without_last(search, law, others, revised)
        spread = search.spread(revised)
        one = _with_one_number(search, law, base, spread)
        if one is not law and one.fit is not None and _more_than_any(one, law, base):
            revised, found = one.fit, [*others, one]
            continue
        kept, why = prune(law, base, search.fitter, search.inner, search.notes)
        dropped |= why
        if kept is None or kept.fit is None:
            found, revised = others, base
            if len(found) == 1:
                break
            continue
        if not why:
            kept = one
        revised, found = kept.fit or revised, [*others, kept]
    return search.as_in(revised, found), revised, dropped


def _behind(search: SetSearch, law: Trial, others: Sequence[Trial], revised: Fit) -> tuple[Trial, Fit]:
    """The same fit with the first law's numbers behind those of the others."""
    first = search.first
    mine, *theirs = rows_of([law, *others], first)
    values = np.concatenate([revised.values[:first], *(revised.values[s] for s in theirs), revised.values[mine]])
    hypothesis = search.scene_with(*(t.term for t in others), law.term)
    fit = search.fitter.fit(hypothesis, values, revised.starts, evaluations=3)
    return replace(law, fit=fit), fit


def _without_last(search: SetSearch, law: Trial, others: Sequence[Trial], revised: Fit) -> Fit:
    hypothesis = search.scene_with(*(t.term for t in others))
    return search.fitter.fit(hypothesis, revised.values[: len(revised.values) - law.numbers], revised.starts)


def _more_than_any(one: Trial, each: Trial, base: Fit) -> bool:
    """Whether one number for all explains more than that of any body alone: then it is not that body which is special.

    Of a body alone as much as its number, over its error, is beyond none.
    """
    assert each.fit is not None
    rows = slice(len(base.values), len(each.fit.values))
    off = each.fit.values[rows] - [f.neutral for f in each.term.free]
    variance = np.diag(each.fit.covariance)[rows]
    return bool(np.all((one.gain * variance >= off**2) | (variance <= 0)))


def _with_one_number(search: SetSearch, law: Trial, base: Fit, spread: float) -> Trial:
    """The same law with the same numbers for all bodies, where their differences are no larger than their errors."""
    assert law.fit is not None
    own = dict(zip((f.name for f in law.term.free), law.fit.values[len(base.values) :], strict=True))
    best = law
    for term in search.terms:
        if term.mechanism != law.mechanism or len(term.free) >= law.numbers or term.bodies != law.term.bodies:
            continue
        begin = []
        for f in term.free:
            mine = [v for name, v in own.items() if name.split("[")[0] == f.name]
            begin.append(float(np.mean(mine)) if mine else f.first)
        start = [*law.fit.values[: len(base.values)], *begin]
        found = search.fitter.fit(base.hypothesis.with_term(term), start, law.fit.starts)
        more = (found.chi2 - law.fit.chi2) / max(spread, 1.0)
        simpler = more < stats.chi2.isf(current().verdict.simpler, law.numbers - len(term.free))
        if simpler and (best is law or best.fit is None or found.chi2 < best.fit.chi2):
            score, _ = search.inner.score(found)
            best = Trial(replace(law.signature, term=term), found, base.chi2 - found.chi2, score)
    return best
