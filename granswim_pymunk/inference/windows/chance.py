"""What candidates gain where nothing is missing: in replicates, by the columns of the film and by columns of their own.

Noise is neither white nor known for sure, so a candidate gains more by chance than its numbers say, and not all gain
alike: grains that a bed scrambles lend a loss at contacts more than they lend a bent joint. Gains are therefore held
against the spread of each candidate's own before the best is taken; with one spread for all, those that scatter most
set the level for the rest. Source: Westfall & Young 1993, Resampling-Based Multiple Testing, ch. 2 (balanced tests).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..criteria import current
from ..linear import basis
from ..significance import Null
from .likelihood import WindowLikelihood, Windows
from .signatures import BedSignature, coherence, off, recombined, to_values, whole_films
from .trial import BedTrial, first_order, surplus


@dataclass(frozen=True)
class Chance:
    """What candidates gain in replicates.

    spreads : of each by its label, the mean gain of one of its numbers: 1 where noise is white and known
    best : (replicates,) the most that one of them is ahead there, see ``BedTrial.ahead``; without the window that
        brings most of it, there as in the film
    """

    spreads: Mapping[str, float]
    best: np.ndarray

    @property
    def level(self) -> float:
        """How far a law is ahead by chance in few searches."""
        return float(np.quantile(self.best, 1 - current().verdict.alarm))

    def threshold(self, trial: BedTrial) -> float:
        """What a trial gains in chi2 by chance, without the window that brings most, in few searches."""
        return float(trial.gain_at(np.array(self.level)))

    def beyond(self, trial: BedTrial) -> bool:
        """Whether a trial gains more to first order than chance gives it, and enough to be sure of."""
        return trial.linear >= current().windows.search.sure and trial.jackknife >= self.threshold(trial)

    def null(self, leader: BedTrial | None) -> Null:
        """The nulls in chi2 of the trial that leads."""
        return Null(self.best, 0.0) if leader is None else Null(leader.gain_at(self.best), leader.jackknife)


def chance(
    likelihood: WindowLikelihood, windows: Windows, nuisance: np.ndarray, signatures: Sequence[BedSignature],
    rng: np.random.Generator,
) -> Chance:  # fmt: skip
    """Of windows of replicates in new order; the spread of a spread is that of a few with columns of their own."""
    criteria = current().windows.signatures
    drawn = off(nuisance, recombined(likelihood.noises, windows, criteria.replicates, rng))
    films = off(nuisance, whole_films(likelihood.noises, windows))
    coherent = coherence(signatures, films, drawn)
    spreads: dict[str, float] = {}
    best = np.zeros(criteria.replicates)
    for s in signatures:
        q = basis(s.clear)
        number = max(q.shape[1], 1)
        alone = float(np.mean(np.sum((q.T @ drawn) ** 2, axis=0))) / number
        spreads[s.term.label] = max(coherent * alone, 1.0)
        known = criteria.alike + number * (films.shape[1] - 1)
        ratio = s.jackknife(drawn) / max(alone, 1e-12) * known / rng.chisquare(known, criteria.replicates)
        best = np.maximum(best, surplus(ratio, number))
    return Chance(spreads, best * unsure(likelihood, rng))


def share_of_most(trial: BedTrial) -> float:
    """The share of what a trial gains to first order that one window, the one it owes most, brings."""
    return 1.0 - trial.jackknife / trial.linear if trial.linear > 0.0 else 0.0


def unsure(likelihood: WindowLikelihood, rng: np.random.Generator) -> np.ndarray:
    """(replicates,) factors on gains of nulls: the spread along one direction is known from few samples.

    nu/chi2_nu with nu = (replicates - 1) windows, what makes chi2 with a known spread Hotelling's T^2 with a measured
    one. Source: Hotelling 1931, Ann. Math. Stat. 2, 360. Few of them tell one direction, but not the covariance
    of some hundred numbers: a budget that leaves no more has to see an effect twice as strong.
    """
    criteria = current().windows.signatures
    pairs = zip(likelihood.beds, likelihood.noises, strict=True)
    known = sum((len(noise.replicates) - 1) * len(b.starts) for b, noise in pairs)
    known = max(known, 3)
    return known / rng.chisquare(known, criteria.replicates) * (4.0 if known < criteria.scanty else 1.0)


def own_answers(
    likelihood: WindowLikelihood, trials: Sequence[BedTrial], windows: Windows, nuisance: np.ndarray, members: int
) -> list[tuple[np.ndarray, list[np.ndarray]]]:
    """Of each trial the amounts (N, k) that replicates, which lack nothing, show, with columns (n, k) of their own
    starts.

    Raises Failed.
    """
    assert likelihood.replicate_scene is not None
    hypothesis, values = likelihood.replicate_scene
    wanted = [(hypothesis, values)]
    ends: list[list[tuple[int, int]]] = []  # of each number of each trial: the views that its column is made of
    for t in trials:
        mine = []
        for k, pair in enumerate(zip(t.signature.tried, t.signature.other, strict=True)):
            at = []
            for amount in pair:
                at.append(len(wanted) if amount else 0)
                if amount:
                    numbers = to_values(t.term, amount * np.eye(len(t.amounts))[k])
                    wanted.append((hypothesis.with_term(t.term), np.concatenate([values, numbers])))
            mine.append((at[0], at[1]))
        ends.append(mine)
    views = likelihood.replicate_views(wanted, windows, members, likelihood.members)
    films = off(nuisance, whole_films(likelihood.noises, windows))
    found = []
    for t, pairs in zip(trials, ends, strict=True):
        after, before = np.array(pairs).T
        spans = t.signature.tried - t.signature.other
        shapes = [off(nuisance, (view[:, after] - view[:, before]) / spans) for view in views[: films.shape[1]]]
        answers = [np.linalg.lstsq(c, film, rcond=1e-8)[0] for c, film in zip(shapes, films.T, strict=False)]
        found.append((np.array(answers), shapes))
    return found


def as_in_replicates(
    likelihood: WindowLikelihood, trials: Sequence[BedTrial], windows: Windows, nuisance: np.ndarray,
    left: np.ndarray, members: int,
    late: Callable[[], bool] = lambda: False,
) -> list[BedTrial]:  # fmt: skip
    """The trials, best first; of those that lead, what the same columns made of each replicate's own starts give is
    off.

    A start has errors, and columns made of it have them too: where it is too fast, a loss gains. In replicates, which
    lack nothing, the mean amount is that bias, and the scatter about it tells the spread; what the middle one of the
    leaders has counts beside it, as few replicates tell little. It goes on until what leads was held against
    replicates, ``criteria.windows.search.most`` were, or it is ``late``.
    Raises Failed.
    Source: Fuller 1987, Measurement Error Models, ch. 1 (errors in the regressors).
    """
    criteria = current().windows
    films = off(nuisance, whole_films(likelihood.noises, windows))
    rest = sorted(trials, key=lambda t: -t.ahead)
    done: list[BedTrial] = []  # without their spreads in replicates
    ratios: list[float] = []
    count = criteria.search.leaning
    while True:
        leading, rest = rest[:count], rest[count:]
        given = own_answers(likelihood, leading, windows, nuisance, members)
        for t, (answers, shapes) in zip(leading, given, strict=True):
            bias = answers.mean(axis=0)
            mine = first_order(t.signature, left - t.signature.clear @ bias, t.spread)
            done.append(replace(mine, attenuation=max(t.linear - mine.linear, 0.0)))
            away = answers - bias
            # each replicate is judged by the others, so its errors along common columns are as wide as the film's, and
            # are none on the mean; what columns of its own add is in the bias, too
            own = away - np.linalg.lstsq(t.signature.clear, films, rcond=1e-8)[0].T[: len(away)]
            ratios.append((_size(shapes, away) + 2 / (len(away) - 1) * _size(shapes, own)) / (len(bias) * t.spread))
        alike = max(float(np.median(ratios)), 1.0)
        weights = [(films.shape[1] - 1) * len(t.amounts) for t in done]
        many = criteria.signatures.alike
        wider = [(many * alike + w * r) / (many + w) for w, r in zip(weights, ratios, strict=True)]
        held = [replace(t, spread=t.spread * max(w, 1.0)) for t, w in zip(done, wider, strict=True)]
        others = [replace(t, spread=t.spread * alike) for t in rest]
        every = sorted([*held, *others], key=lambda t: -t.ahead)
        if any(every[0] is t for t in held) or len(held) + criteria.search.more > criteria.search.most or late():
            return every
        count = criteria.search.more


def _size(shapes: Sequence[np.ndarray], answers: np.ndarray) -> float:
    """Mean length squared of what answers (N, k) make of columns (n, k) each."""
    return float(np.mean([np.sum((c @ a) ** 2) for c, a in zip(shapes, answers, strict=True)]))
