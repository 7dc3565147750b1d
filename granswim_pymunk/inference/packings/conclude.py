"""From gains to laws: leaders refitted by simulation, pairs, what they explain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ... import distributions as stats
from ...laws import all_laws, has_role
from ..criteria import current
from ..explained import Explained
from ..flow import flow_of
from ..mechanisms import UNKNOWN
from ..significance import at_alarm, price
from ..simpler import all_absent, by_chance, ended_at_bound, special_cases
from ..trial import Tried, best_of_each, pair_gains, rows_of
from .candidates import Candidate
from .refitting import arrived, refit
from .response import Fit, fit, spread_of, whitened
from .screening import Bank, counts, extended, model_of
from .state import NAIVE, Search, Trial, base_point, extra_at, rounded
from .summaries import fastest_of

BY_CHANCE = "with the scene's own contacts it is not beyond chance"
NOT_TOLD = "packings under it differ so widely that its numbers may as well be none"


@dataclass(frozen=True)
class Curve:
    """The form without a name: the mean shift of all numbers, as the other recordings show it."""

    mechanism: str = UNKNOWN
    label: str = "a mean shift of all numbers"
    special: bool = False  # see ``Tried``


@dataclass
class Finding:
    """The laws that are told, and the scene with them.

    label : of its runs;  true : whether those have the scene's own contacts
    train, held : errors by model, see ``HeldOut``;  wilder : see ``wilder_there``
    """

    search: Search
    found: list[Trial]
    revised: Fit
    label: str
    true: bool
    train: dict[str, float | None] = field(default_factory=dict)
    held: dict[str, float | None] = field(default_factory=dict)
    wilder: float = 1.0

    @property
    def values(self) -> np.ndarray:
        """Values of the adjustables in the revised scene."""
        return rounded(self.revised.u[: len(self.search.adjust)])

    def extra(self) -> list[tuple]:
        """(term, values) of the laws found, the apparatus left out."""
        return extra_of(self.search, self.found, self.revised)

    def camera(self) -> dict[str, float]:
        return {name: float(self.revised.u[k]) for k, name in enumerate(self.revised.model.camera) if name is not None}

    def own(self, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
        """A found law's numbers in the revised fit, and their covariance, see ``Fit.told``."""
        own = zip(self.found, rows_of(self.found, len(self.search.adjust)), strict=True)
        rows = next(rows for t, rows in own if t is trial)
        f = self.revised
        student = float(stats.t.ppf(0.975, max(f.dof, 2))) / current().intervals.normal
        return f.u[rows], f.told[rows, rows] * student**2


def extra_of(s: Search, found: Sequence[Tried], fitted: Fit) -> list[tuple]:
    """(term, values) of laws in a fit, the apparatus left out."""
    return extra_at(s, found, rounded(fitted.u))


# ---- the search -----------------------------------------------------------------------------------


def named_laws(
    s: Search, bank: Bank, open_: Sequence[Trial], candidates: Sequence[Candidate]
) -> tuple[list[Trial], Fit | None, list[tuple[Trial, bool]]]:
    """Leaders refitted by simulation: one law or two, their fit, and laws that come near, with whether they do as well.

    No law, and None, where none of them stands beyond the nulls. ``open_``: candidates in question, best first.
    """
    criteria = current().packings
    leaders = _refitted_leaders(s, open_)
    assert s.nulls is not None
    threshold = max(at_alarm(s.nulls.best), current().verdict.noticed)
    leaders = [t for t in leaders if sensible(s, t)]
    if not leaders or leaders[0].worth < threshold:
        return [], None, []
    same = [t for t in leaders if _alike(s, leaders[0], t)]
    chosen = min(same, key=lambda t: (t.numbers, not t.apparatus, -t.gain))
    chosen = plainer(s, chosen, leaders)
    found, revised = [chosen], chosen.fit
    pair = _pair(s, bank, chosen, candidates)
    if pair is not None:
        found, revised = pair
    names = {f.mechanism for f in found}
    near = [t for t in leaders if t.gain > criteria.rival * chosen.gain]
    # a few speeds say one thing only: whatever explains it to first order is of the same class
    curves, least = all(c.any_view.curve for c in s.training), criteria.of_a_class * open_[0].gain
    first_order = [
        _to_first_order(s, t) for t in open_
        if curves and t.fit is None and t.gain > least and t.mechanism not in names
    ]  # fmt: skip

    def alike(t: Trial) -> bool:
        one_class = curves and t.gain > criteria.of_a_class * chosen.gain
        return one_class or any(t is o for o in first_order) or _alike(s, chosen, t)

    return found, revised, best_of_each([*near, *first_order], alike, names)


def _refitted_leaders(s: Search, open_: Sequence[Trial]) -> list[Trial]:
    """What comes near the best, refitted by simulation, best first; signatures are not linear."""
    criteria, best, noticed = current().packings, open_[0].gain, current().verdict.noticed

    def leads(t: Trial) -> bool:
        if t.gain > (criteria.led_apparatus if t.apparatus else criteria.led) * best:
            return True
        bent = not t.apparatus and t.gain > max(criteria.led_bent * best, noticed)
        return bent and not _within_signature(s, t)

    leaders = [t for t in open_ if leads(t)]
    leaders = leaders[: 2 * s.sizes.leaders]
    for k, t in enumerate(leaders):
        again(s, t, 0.64 + 0.08 * k / len(leaders), 1, max(s.sizes.leader // 2, 2))
    leaders = sorted((t for t in leaders if t.fit is not None), key=lambda t: -t.worth)
    for k, t in enumerate(leaders):
        if not in_reach(s, leaders[0], t) and not _is_there(s, t) and _may_yet_lead(leaders[0], t):
            # its runs were not where its fit is: what it gains there is not known yet
            again(s, t, 0.72 + 0.02 * k / len(leaders), 1, max(s.sizes.leader // 2, 2))
    leaders.sort(key=lambda t: -t.worth)
    settled: set[str] = set()
    while leaders:
        # whoever comes near the best has to be known as well as the best
        near = [t for t in leaders if in_reach(s, leaders[0], t)]
        rest = [t for t in near[: s.sizes.leaders] if t.label not in settled]
        if not rest:
            break
        again(s, rest[0], 0.74 + 0.04 * min(len(settled) / s.sizes.leaders, 1.0), 2, s.sizes.leader)
        settled.add(rest[0].candidate.label)
        leaders.sort(key=lambda t: -t.worth)
    dueled: set[str] = set()
    for t in leaders[1:3]:
        if leaders[0].worth - t.worth < current().verdict.same + 2 * _noise(s, leaders[0], t):
            # the error of the simulated means is what keeps these two together: more runs of both
            for one in (leaders[0], t):
                if one.label not in dueled:
                    again(s, one, 0.79, 1, s.sizes.duel)
                    dueled.add(one.label)
    return sorted(leaders, key=lambda t: -t.worth)


def _within_signature(s: Search, t: Trial) -> bool:
    """Whether a law is fitted near the amounts of its signature: elsewhere that bends, and what it gains is unknown."""
    model = model_of(s, [t.candidate])
    if model is None:
        return True
    found, n = fit(model, s.means, s.training), len(s.adjust)
    run = np.abs(t.candidate.design).max(axis=0)
    away = float(np.max(np.abs(found.u[n:] - t.candidate.neutral) / run))
    return 1 / current().packings.bent < away < current().packings.bent


def in_reach(s: Search, best: Trial, other: Trial) -> bool:
    """Whether the error of the runs may be what keeps a law below the best."""
    reach = current().packings.reach * _noise(s, best, other)
    return best.worth - other.worth < current().verdict.same + reach


def _may_yet_lead(best: Trial, other: Trial) -> bool:
    behind = current().packings.behind * best.worth
    return best.worth - other.worth < behind + current().verdict.same


def _is_there(s: Search, t: Trial) -> bool:
    """Whether a law was run at the numbers that it is fitted with."""
    if t.fit is None or t.apparatus:
        return True
    own = slice(len(s.adjust), None)
    off, away = np.abs(t.fit.u - t.fit.model.centre)[own], t.values() - t.candidate.neutral
    return arrived(off, np.sqrt(np.diag(t.fit.covariance)[own]), away)


def plainer(s: Search, found: Trial, leaders: Sequence[Trial]) -> Trial:
    """The law that a richer one becomes where the numbers that it adds are none within their intervals (contract).

    A flow of no speed is drag in still air. The law itself where they are not, or where the other does not stand.
    """
    plain = None if found.fit is None else _nested(s, found.candidate, found.fit, len(s.adjust))
    if plain is None:
        return found
    if plain not in leaders or not plain.refitted:
        again(s, plain, 0.8, 2, s.sizes.leader)
    if plain.fit is None or not sensible(s, plain):
        return found
    s.notes.append(f"{found.mechanism}: what it adds to {plain.mechanism} is none within its intervals")
    return plain


def _nested(s: Search, x: Candidate, found: Fit, at: int) -> Trial | None:
    """The trial of the law that x is where all its numbers but the first are neutral; None where they are not.

    found : a fit in which the numbers of x begin at ``at``
    """
    names = special_cases(x.mechanism)
    added = ((found.model.free[k].neutral, *found.interval(k)) for k in range(at + 1, at + x.numbers))
    if not names or not all_absent(added):
        return None
    return next((t for t in s.trials if t.mechanism in names and not t.reason), None)


def _to_first_order(s: Search, t: Trial) -> Trial:
    """A trial with the fit that its signature gives, where it was not simulated again."""
    model = model_of(s, [t.candidate])
    if model is not None:
        t.fit = fit(model, s.means, s.training)
    return t


def sensible(s: Search, t: Trial) -> bool:
    """Whether a fitted law can be an explanation: not at a bound of its declaration, no scale far off."""
    return _sound(s, t.candidate, t.values())


def _sound(s: Search, x: Candidate, values: np.ndarray) -> bool:
    """As ``sensible``, of a candidate with these numbers of its own, alone or beside another."""
    ended = ended_at_bound(zip(x.term.free, map(float, values), strict=True))
    if ended is not None:
        s.notes.append(f"{x.label} is no explanation: it runs into its bound, {ended[0]} = {ended[1]:.3g}")
        return False
    if has_role(x.mechanism, "medium"):
        speed, fastest = math.hypot(*flow_of(values, None)[0][1:]), fastest_of(s.training)
        if speed > fastest:
            s.notes.append(f"{x.label} is no explanation: it would go at {speed:.3g} m/s, no disk at {fastest:.3g}")
            return False
    value = float(values[0])
    if x.mechanism == "camera_scale" and abs(value - 1) > current().verdict.scale_off:
        s.notes.append(f"{x.label} is no explanation: {x.term.free[0].name} would be {value:.3g}")
        return False
    return True


def _noise(s: Search, a: Trial, b: Trial) -> float:
    """Standard deviation of the difference of two objectives that comes from the error of their simulated means."""
    if a is b or a.fit is None or b.fit is None:
        return 0.0

    def own(t: Trial) -> float:
        """Variance of what its own runs put into the objective, in units of 4: chi2 times that of the mean."""
        assert t.fit is not None
        shares = []
        for c in s.training:
            points = t.fit.model.sums(c.name, t.fit.u)
            found = s.means.mean[c.name]
            # what both share, the naive runs and those of the recalibrated scene, drops out of the difference
            apart = [p for p in points if p[0] not in (NAIVE, base_point(s))]
            shares.append(sum(points[p] ** 2 / found[p][1] for p in apart))
        return t.fit.weighed(2) * float(np.mean(shares))

    return 2.0 * math.sqrt(max(own(a) + own(b), 0.0))


def _one_and_the_same(a: str, b: str) -> bool:
    """Whether two mechanisms are one where only the drive depends on time: what differs is the error of the runs."""
    laws = all_laws()
    return any(one in laws and other in laws[one].same_as for one, other in ((a, b), (b, a)))


def _alike(s: Search, best: Trial, other: Trial) -> bool:
    """Whether these data, and the runs that were done, cannot tell the other law from the best."""
    if _one_and_the_same(best.mechanism, other.mechanism):
        return True
    return best.worth - other.worth < current().verdict.same + _noise(s, best, other)


def again(s: Search, t: Trial, share: float, rounds: int, count: int) -> None:
    """Refit a trial by simulation, from where it stands."""
    found, done, reason = refit(s, [t.candidate], share, rounds, count, t.fit)
    t.refitted += done
    if found is not None and (done or t.fit is None):
        t.fit = found
    elif found is None:
        t.reason = reason
    _level(s)


def _level(s: Search) -> None:
    """Every run tells more of the spread: base and trials are fitted again with what is known of it now."""
    s.base = fit(s.base.model, s.means, s.training)
    for t in s.trials:
        if t.fit is not None:
            t.fit = fit(t.fit.model, s.means, s.training)
            t.gain = s.base.objective - t.fit.objective


# ---- two laws ---------------------------------------------------------------------------------------


def best_pair(bank: Bank, candidates: Sequence[Candidate]) -> tuple[float, Candidate, Candidate] | None:
    """The pair that gains most to first order, of those of which no bound forbids a sign; None where there is none."""
    left = bank.refitted(bank.left)
    shapes = [bank.directions[x.label] for x in candidates]
    for gain, i, j in pair_gains(left, [x.mechanism for x in candidates], shapes):
        a, b = candidates[i], candidates[j]
        columns = np.hstack([bank.columns[a.label], bank.columns[b.label]])
        amounts, *_ = np.linalg.lstsq(columns, left, rcond=None)
        if all(
            x.numbers > 1 or bank.room[x.label][0] <= v <= bank.room[x.label][1]
            for x, v in ((a, amounts[0]), (b, amounts[-1]))
        ):
            return gain, a, b
    return None


def _pair(s: Search, bank: Bank, first: Trial, candidates: Sequence[Candidate]) -> tuple[list[Trial], Fit] | None:
    """Two laws, where each earns its price beside the other; refitted together by simulation."""
    assert first.fit is not None
    alive = [x for x in candidates if counts(bank, x)]
    cost = price(s.looked)
    tried: list[tuple[float, list[Candidate], Fit | None]] = []
    for x in alive:
        if x.mechanism == first.mechanism or _one_and_the_same(x.mechanism, first.mechanism):
            continue
        beside, rounds = extended(s, first.fit.model, x, first.fit.u), current().packings.pair_rounds
        both = fit(beside, s.means, s.training, rounds=rounds)
        tried.append((first.fit.objective - both.objective - 2 * (x.numbers - 1), [first.candidate, x], both))
    together = best_pair(bank, alive)
    if together is not None and first.label not in (together[1].label, together[2].label):
        gain, a, b = together
        tried.append((gain - first.gain - 2 * (a.numbers + b.numbers - 2), [a, b], None))
    tried.sort(key=lambda item: -item[0])
    for gain, pair, start in tried[:2]:
        if gain < cost:
            break
        found, _, why = refit(s, pair, 0.81, 2, s.sizes.leader, start)
        if found is None or why:
            continue
        simpler = _simpler(s, pair, found)
        if simpler != pair:
            pair = simpler
            found, _, why = refit(s, pair, 0.82, 2, s.sizes.leader)
            if found is None or why:
                continue
        _level(s)
        found = fit(found.model, s.means, s.training)
        assert first.fit is not None
        if first.fit.objective - found.objective < cost + 2 * (pair[1].numbers - 1):
            continue
        if min(_from_absence(s, pair, found, found.covariance)) < cost:
            continue
        if not all(_sound(s, *own) for own in _own(s, pair, found)):
            continue
        gains = first.fit.objective - found.objective
        known = {t.label: t for t in s.trials}
        trials = [replace(known[x.label], fit=found, gain=first.gain + gains, refitted=2) for x in pair]
        return trials, found
    return None


def _simpler(s: Search, pair: list[Candidate], found: Fit) -> list[Candidate]:
    """The laws, each that is a simpler one within its intervals as that one; the same where that is there already."""
    result: list[Candidate] = []
    for x, rows in zip(pair, rows_of(pair, len(s.adjust)), strict=True):
        plain = _nested(s, x, found, rows.start)
        other = x if plain is None else plain.candidate
        result.append(x if other.mechanism in {o.mechanism for o in (*pair, *result)} else other)
    return result


def _own(s: Search, laws: Sequence[Candidate], found: Fit) -> list[tuple[Candidate, np.ndarray]]:
    """Each law of a set with its own numbers in a fit."""
    return [(x, found.u[rows]) for x, rows in zip(laws, rows_of(laws, len(s.adjust)), strict=True)]


def _from_absence(s: Search, laws: Sequence[Candidate], found: Fit, covariance: np.ndarray) -> list[float]:
    """How far each law of a set is from its absence, in chi2 of its numbers: what its price is held against."""
    result = []
    for x, rows in zip(laws, rows_of(laws, len(s.adjust)), strict=True):
        away = found.u[rows] - x.neutral
        result.append(float(away @ np.linalg.pinv(covariance[rows, rows]) @ away))
    return result


def both_earned(f: Finding) -> bool:
    """Whether of two laws each earns its price beside the other in the scene as it is given to the user, too.

    The search ran with softer contacts and fewer packings, and what differs there looks like a weak second law.
    """
    s, both = f.search, [t.candidate for t in f.found]
    if len(both) != 2:
        return True
    far = _from_absence(s, both, f.revised, f.revised.told)
    sound = [_sound(s, *law) for law in _own(s, both, f.revised)]
    return all(sound) and min(far) >= price(s.looked)


def within_absence(f: Finding) -> bool:
    """Whether the numbers of a law that was found alone may as well be none in the scene as it is given to the user.

    Packings that differ widely under a law tell little of its numbers, however much nearer their mean comes.
    """
    if len(f.found) != 1:
        return False
    law = f.found[0].candidate
    return by_chance(_from_absence(f.search, [law], f.revised, f.revised.told)[0], law.numbers)


def by_themselves(f: Finding) -> list[Trial]:
    """The laws of a pair, each with its own fit, that can be an explanation without the other, best first."""
    s, found = f.search, []
    for law in f.found:
        alone = next(t for t in s.trials if t.label == law.label)
        if alone.fit is None or not alone.refitted:
            again(s, alone, 0.93, 2, s.sizes.leader)
        if alone.fit is not None and sensible(s, alone):
            found.append(alone)
    return sorted(found, key=lambda t: -t.worth)


# ---- what is explained ------------------------------------------------------------------------------


def explained(s: Search, revised: Fit) -> tuple[Explained, Explained | None]:
    """Share of the misfit explained by a fit, and by a form without a name.

    Of several recordings each is predicted by a fit to the others; of one, degrees of freedom are taken off. S_floor is
    that of the nulls. The form without a name is the mean shift of all numbers in the other recordings, None where
    there are none.
    """
    criteria = current().packings
    assert s.nulls is not None
    n = s.base.count
    freedom = max(n - len(s.base.u), 1)
    floor = float(s.nulls.left.mean()) / freedom
    wide = float(s.nulls.left.std()) / n
    before = float((_unseen(s, s.base) ** 2).mean())
    rng = np.random.default_rng(s.runner.seed)

    # what the recording's own packing adds is in the misfit before and after alike
    own = rng.choice(s.nulls.left, criteria.resamples) / freedom - floor

    def drawn(mean: float) -> np.ndarray:
        """Mean squares above the floor: less that of the own packing, and its product with what is missing."""
        beyond = max(mean - floor, 0.0)
        return mean - floor - own + rng.normal(size=criteria.resamples) * 2 * math.sqrt(beyond / n)

    def share(after: np.ndarray | float, before: np.ndarray | float) -> np.ndarray:
        return np.minimum(1 - np.asarray(after) / np.maximum(before, 1e-9), 1.0)

    def told(after: float) -> Explained:
        low, high = np.quantile(share(drawn(after), drawn(before)), current().intervals.central)
        value, left, left_before = float(share(after - floor, before - floor)), after - floor, before - floor
        return Explained(
            value, float(low), float(high), left, left_before, left_before >= current().verdict.beyond * wide, wide
        )

    named = told(float((_unseen(s, revised) ** 2).mean()))
    free = _free_form(s)
    return named, None if free is None else told(float((free**2).mean()))


def _unseen(s: Search, found: Fit) -> np.ndarray:
    """(n,) residuals in units of their spread, of each recording by a fit to the others."""
    if len(s.training) < 2 or any(c.any_view.curve for c in s.training):
        freedom = max(found.count - len(found.u), 1)
        return whitened(found) * math.sqrt(found.count / freedom)
    rows = []
    for c in s.training:
        others = fit(found.model, s.means, [o for o in s.training if o is not c], start=found.u)
        mean, variance = found.model.predict(s.means, c, others.u)
        rows.append(np.linalg.solve(np.linalg.cholesky(spread_of(s.means, c, variance, c.error)), c.seen - mean))
    return np.concatenate(rows)


def _free_form(s: Search) -> np.ndarray | None:
    """(n,) residuals that are left where each recording is shifted as the others are, None for one or for curves."""
    if len(s.training) < 2 or len({len(c.seen) for c in s.training}) > 1 or any(c.any_view.curve for c in s.training):
        return None
    rows = []
    for c in s.training:
        others = [s.base.left[o.name][0] for o in s.training if o is not c]
        r, v = s.base.left[c.name]
        v = v * (1 + 1 / len(others))
        rows.append(np.linalg.solve(np.linalg.cholesky(v), r - np.mean(others, axis=0)))
    return np.concatenate(rows)
