"""Which of the laws that were tried is named: one, one for some of the bodies, or none, and with what verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ... import distributions as stats
from ...laws import all_laws
from ..camera_terms import camera_terms
from ..candidates import for_bodies, owners
from ..criteria import current
from ..data import Case
from ..significance import price
from ..simpler import by_chance, ended_at_bound, special_cases
from ..trial import best_of_each
from .fit import Fitter
from .fitted import Fit
from .name import InnerSplit, Trial, is_part, spread_of


def score_inner(inner: InnerSplit, trials: list[Trial], ahead: float = 0.0) -> list[Trial]:
    """Inner scores of the trials that are near the best; the others keep an infinite one.

    ahead : the gain of the best of others, which may be the best of all
    """
    best = max([ahead, *(t.gain for t in trials)])
    least = current().refits.inner_scored * best
    near = {k: t.fit for k, t in enumerate(trials) if t.fit is not None and t.gain >= least and t.gain > 0}
    scores = dict(zip(near, inner.scores(list(near.values())), strict=True))
    return [replace(t, inner=scores[k][0]) if k in scores else t for k, t in enumerate(trials)]


def worth(trial: Trial, spread: float) -> float:
    """Gain in chi2 over the inflation, less what as many free numbers gain by chance (AIC), and what a search gains."""
    return trial.gain / spread - 2 * trial.used - searched(trial, spread)


def searched(trial: Trial, spread: float) -> float:
    """What a special fault gains by being looked for: the middle of a lens in a range, a direction all round.

    Of k such numbers found with covariance S in ranges w the evidence keeps (2 pi)^(k/2) |S|^(1/2) / prod w, twice its
    logarithm in chi2 (MacKay 2003, ch. 28), of which AIC counts 2 k. A lens about a place far off bends any few tracks
    as they need it; strengths are a prior's width of every law alike, and are left to AIC.
    """
    if trial.fit is None or not trial.special:
        return 0.0
    first = trial.fit.hypothesis.rows(trial.label).start
    ranges = {k: f.high - f.low for k, f in enumerate(trial.term.free, first) if f.inner}
    sought = {k: width for k, width in ranges.items() if math.isfinite(width)}
    if not sought:
        return 0.0
    at, widths = list(sought), np.array(list(sought.values()))
    shares = trial.fit.covariance[np.ix_(at, at)] * max(spread, 1.0) / np.outer(widths, widths)
    told = np.linalg.slogdet(2 * math.pi * shares + 1e-300 * np.eye(len(at)))[1]
    return max(-float(told) - 2 * len(at), 0.0)


def absurd(trial: Trial) -> str:
    """Why the numbers of a law make no sense for the apparatus; empty where they do."""
    if trial.fit is None:
        return ""
    ended = ended_at_bound(zip(trial.term.free, map(float, trial.values), strict=True))
    return "" if ended is None else f"{ended[0]} ends at {ended[1]:g}, where its search ends"


def ordinary(trial: Trial) -> bool:
    """Whether a law is no more than what laboratories are off by: a mass by some per cent, a picture by its scale.

    Of apparatus: its numbers lie within a part of the way to where they are absurd (``VerdictCriteria.ordinary``); and
    no special fault: a camera that stands otherwise than it was put, a lens that bends the picture.
    """
    if trial.fit is None:
        return False
    apparatus = trial.apparatus and not trial.special
    for free, value in zip(trial.term.free, trial.values, strict=True):
        away = float(value) - free.neutral
        room = current().verdict.ordinary * abs((free.high if away > 0 else free.low) - free.neutral)
        if not free.inner and abs(away) > (room if apparatus else free.ordinary):
            return False
    return True


def of_laboratories(trial: Trial) -> bool:
    """Whether it is what laboratories are off by, a mass or a picture's scale, whatever its size."""
    return trial.apparatus or any(free.ordinary for free in trial.term.free)


def extraordinary(trial: Trial) -> bool:
    """Whether it is what laboratories are off by, and by more than they are."""
    return of_laboratories(trial) and not ordinary(trial)


def foretold(trial: Trial, spread: float, base_inner: float, looked: int) -> bool:
    """Whether a law is one that later data inside the training part do not speak against.

    Where it leaves noise alone, all data are asked: ln p(all) = ln p(first part) + ln p(rest | first part), and what
    acts in the first part alone (an end stop met while a motor starts) can only lose in the rest. It has to earn
    the price of one of ``looked`` candidates in all (``significance.price``). So it has where so few frames are learnt
    from that none are later: then ``base_inner``, what they are predicted by without a law, is infinite.
    """
    told = math.isfinite(trial.inner) or math.isinf(base_inner)
    return trial.inner < base_inner or (spread <= 1 and told and trial.gain / spread > price(looked, trial.used))


def choose(trials: list[Trial], spread: float, base_inner: float, looked: int) -> Trial | None:
    """The candidate to be named, of ``looked`` that were compared.

    Where the best fit leaves noise (spread 1) chi2 decides; where something remains, prediction inside the
    training part does, since chi2 then rewards whatever bends. Of candidates that cannot be told apart, the
    one with fewest numbers, what laboratories are off by before physics, physics before what they are not off by that
    much, and a law on all bodies before the same law on one of them, which had as many chances as there are bodies.
    """
    verdict, sets = current().verdict, current().sets
    trials = [t for t in trials if worth(t, spread) > verdict.noticed and foretold(t, spread, base_inner, looked)]
    trials = [t for t in trials if not absurd(t)]
    if not trials:
        return None
    every = [t.term for t in trials]
    # on whom of several bodies a law acts is found from the data as well: a number more
    part = {id(t): int(is_part(t.term, every)) for t in trials}
    paid = {id(t): worth(t, spread) - 2 * part[id(t)] for t in trials}
    if spread <= 1:
        best = max(trials, key=lambda t: paid[id(t)])
        same = [t for t in trials if paid[id(best)] - paid[id(t)] < verdict.same]
        # the best of several richer laws gains by chance more than one of them would
        for t in trials:
            extra, ahead = best.used - t.used, (best.gain - t.gain) / spread
            if extra > 0 and best.holds(t, verdict.same * spread) and ahead < stats.chi2.isf(verdict.simpler, extra):
                same.append(t)
    else:
        near = [t for t in trials if worth(t, spread) > sets.near_best * max(worth(u, spread) for u in trials)]
        near = _without_large_faults(near)
        best = min(near, key=lambda t: t.inner)
        same = [t for t in near if t.inner < sets.same_score * best.inner]
    # a law whose further numbers are compatible with none gives way to what it is then (a stream at rest is a drag)
    plain = special_cases(best.term.law)
    same += [
        t for t in trials
        if t.mechanism in plain and t.used < best.used
        and by_chance((best.gain - t.gain) / max(spread, 1.0), best.used - t.used)
    ]  # fmt: skip
    # where something remains, a law with more numbers must remove most of what a simpler one leaves
    most = sets.left * (best.fit.excess if best.fit is not None else 0.0)
    same += [t for t in trials if t.used < best.used and t.fit is not None and t.fit.excess < most]
    # a special fault hardly any laboratory has: no law gives way to it that explains more than chance would
    most = max((paid[id(t)] for t in same if not t.special), default=-np.inf)
    same = [t for t in same if not t.special or paid[id(t)] > most - verdict.same]
    forms = [t.term for t in same]
    # a picture's scale is off more often than the inertia of a body
    chosen = min(
        same,
        key=lambda t: (t.used + part[id(t)], not ordinary(t), t.special, ordinary(t) and not t.apparatus,
                       extraordinary(t), is_part(t.term, forms), is_other_form(t), -t.gain),
    )  # fmt: skip
    return of_the_apparatus(chosen, trials, spread)


def _without_large_faults(near: list[Trial]) -> list[Trial]:
    """Without faults larger than laboratories have, but for one that removes most of what the other leading laws leave.

    Where more than noise remains a picture that is turned far enough bends to a little of anything: a track that is no
    circle was a camera that hangs askew by 25 degrees.
    """
    large = [bool(t.apparatus and extraordinary(t)) for t in near]
    others = [t.fit.excess for t, fault in zip(near, large, strict=True) if not fault and t.fit is not None]
    if not others:
        return near
    most = min(others) / current().sets.left
    asked = zip(near, large, strict=True)
    return [t for t, fault in asked if not fault or (t.fit is not None and t.fit.excess < most)]


def is_other_form(trial: Trial) -> bool:
    """Whether a law is not the one that its mechanism is called by, but differs from that in form."""
    law = all_laws().get(trial.term.law)
    return law is not None and bool(law.form)


def of_the_apparatus(chosen: Trial, trials: Sequence[Trial], spread: float) -> Trial:
    """The law that by its declaration stands for the chosen one in such an apparatus and does as well, else itself."""
    laws = all_laws()
    equals = [
        t for t in trials
        if t.term.suited and chosen.mechanism in laws[t.term.law].stands_for
        and worth(chosen, spread) - worth(t, spread) < current().verdict.same
    ]  # fmt: skip
    return max(equals, key=lambda t: t.gain, default=chosen)


def prune(
    chosen: Trial,
    base: Fit,
    fitter: Fitter,
    inner: InnerSplit,
    notes: list[str],
) -> tuple[Trial | None, dict[str, str]]:
    """Keep a law only for the bodies whose own recordings ask for it, and where no camera scale does as well."""
    bodies = owners(chosen.term)
    if len(bodies) < 2 or chosen.fit is None:
        return chosen, {}
    dropped: dict[str, str] = {}
    kept = []
    for owner in bodies:
        mine = [c for c in fitter.cases if owner in c.recording.scene.ids]
        if not mine:
            continue
        base_fit, with_law = _without_and_with(owner, chosen, base, fitter, mine)
        own_spread = spread_of(with_law, mine)
        gain = (base_fit.chi2 - with_law.chi2) / own_spread
        split = InnerSplit.make(mine, fitter.predictor, fitter.stop, fitter.closeness)
        without, _ = split.score(base_fit)
        with_, _ = split.score(with_law)
        if gain < current().sets.entry:
            dropped[owner] = f"its own data gain only {gain:.1f} in chi2 (over their spread)"
        elif gain < current().sets.entry_sure and not with_ < without:
            dropped[owner] = "its own data gain little, and are not predicted better with it"
        elif _one_camera_will_do(chosen, owner, base, fitter, own_spread):
            dropped[owner] = "one camera scale for all recordings explains its data as well"
        if owner not in dropped:
            kept.append(owner)
    if not kept:
        notes.append(f"{chosen.mechanism} was not kept for any single body")
        return None, dropped
    if len(kept) == len(bodies):
        return chosen, dropped
    part = for_bodies(chosen.term, kept)
    assert part is not None
    term, index = part
    values = _with_numbers(chosen, len(base.values), index)
    fit = fitter.fit(base.hypothesis.with_term(term), values, chosen.fit.starts)
    score, _ = inner.score(fit)
    signature = replace(chosen.signature, term=term)
    return Trial(signature, fit, base.chi2 - fit.chi2, score), dropped


def _without_and_with(owner: str, chosen: Trial, base: Fit, fitter: Fitter, mine: list[Case]) -> tuple[Fit, Fit]:
    """Fits to the recordings with this body, ``mine``: the law on all others in them, and on this one too.

    The others keep theirs: what they would miss without it would drown what this one gains.
    """
    assert chosen.fit is not None
    there = [b for b in owners(chosen.term) if any(b in c.recording.scene.ids for c in mine)]
    alone = Fitter(mine, fitter.predictor, {c.name: fitter.frames[c.name] for c in mine}, fitter.stop)
    alone = alone.tightened(fitter.closeness)
    fits = []
    for kept in ([b for b in there if b != owner], there):
        part = for_bodies(chosen.term, kept)
        if part is None:
            fits.append(alone.refitted(base, fixed=True))
            continue
        # the other numbers begin where they are with the law: without it they may have made up for it
        start, starts = _with_numbers(chosen, len(base.values), part[1]), chosen.fit.starts
        fits.append(alone.fit(base.hypothesis.with_term(part[0]), start, starts))
    return fits[0], fits[1]


def _with_numbers(chosen: Trial, before: int, index: Sequence[int], *more: float) -> np.ndarray:
    """Values of a fit: those ``before`` the law's, those of its numbers that are kept, and further ones."""
    assert chosen.fit is not None
    values = chosen.fit.values
    return np.concatenate([values[:before], values[before + np.array(index)], more])


def _one_camera_will_do(chosen: Trial, owner: str, base: Fit, fitter: Fitter, spread: float) -> bool:
    """Whether a scale of the one camera, with the law on all other bodies, does as well as the law on this one too."""
    scale = next((t for t in camera_terms(fitter.cases) if t.mechanism == "camera_scale"), None)
    others = for_bodies(chosen.term, [b for b in owners(chosen.term) if b != owner])
    if scale is None or others is None or chosen.fit is None:
        return False
    term, index = others
    start = _with_numbers(chosen, len(base.values), index, 1.0)
    few = current().evaluations.camera
    rival = fitter.fit(base.hypothesis.with_term(term, scale), start, chosen.fit.starts, evaluations=few)
    return (rival.chi2 - chosen.fit.chi2) / spread < current().verdict.same


def left_over(revised: Fit, recalibrated: Fit, inner: float, base: float, training: Sequence[Case]) -> float:
    """The share of the misfit that an explanation leaves: of that inside the training part, or of chi2 if larger.

    A wrong law with a number for each body may predict far better than none and still follow nothing closely;
    where the size of the noise is given, what is left in chi2 shows it.
    """
    share = (inner - 1.0) / max(base - 1.0, 1e-12)
    if all(c.sigma_known for c in training) and revised.excess:
        share = max(share, revised.excess / max(recalibrated.chi2 - recalibrated.count, 1e-12))
    return float(share)


def rivals_of(found: list[Trial], alive: list[Trial], spread: float) -> list[tuple[Trial, bool]]:
    """Other candidates than the one found, best first, once for each name; True where data cannot tell them apart."""
    if not found or found[0].fit is None:
        return []
    winner, criteria = found[0], current().verdict
    near = [t for t in alive if t.fit is not None and t.gain >= criteria.rival * winner.gain]

    def same(t: Trial) -> bool:
        return worth(winner, spread) - worth(t, spread) < criteria.same

    return best_of_each(sorted(near, key=lambda t: -t.gain), same, {winner.mechanism})[: criteria.rivals]
