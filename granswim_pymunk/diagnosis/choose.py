"""Which of the laws that were tried is named: one, one for some of the bodies, two, or none."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from .candidates import camera_terms, for_bodies, owners
from .data import Case
from .fit import Fit, Fitter
from .hypothesis import Hypothesis, Predictor, Term
from .innovations import Whiteness
from .name import InnerSplit, Trial, is_apparatus, pair_gains, refit, spread_of
from .nulls import noise_of, search_nulls
from .signatures import make_bank

ALARM = 0.01  # the share of noise-only recordings that may be called a mismatch
SAME = 4.0  # two laws whose chi2 differ by less (d' below 2) cannot be told apart on these data
SIMPLER = 1e-3  # how improbable the gain of further numbers must be by chance before the richer law is named
POOR = 0.03  # the share of the misfit (in chi2, on data inside the training part) that an explanation may leave
MOST_LEFT = 0.5  # of the misfit: an apparatus that leaves more is not what is wrong
REPLICATES = 299
NEAR_PARTNER = 0.7  # of what one of two laws explains: how much another one must, to first order, to be its rival
PARTNERS = 4  # such rivals that are refitted
SINGLE = ("linear_drag", "quadratic_drag", "coulomb_substrate")  # laws of one strength, alike over a short time


def score_inner(inner: InnerSplit, trials: list[Trial], spread: float) -> list[Trial]:
    """Inner scores of the trials that are near the best; the others keep an infinite one."""
    if not trials:
        return []
    best = max(t.gain for t in trials)
    result = []
    for t in trials:
        assert t.fit is not None
        if t.gain >= 0.5 * best and t.gain > 0:
            score, _ = inner.score(t.fit)
            t = replace(t, inner=score)
        result.append(t)
    return result


def _worth(trial: Trial, spread: float) -> float:
    """Gain in chi2 over the inflation, less what as many free numbers gain by chance (AIC)."""
    return trial.gain / spread - 2 * trial.used


def _excess(trial: Trial) -> float:
    """Chi2 beyond that of noise, 0 where it is within three of its standard deviations."""
    assert trial.fit is not None
    left = trial.fit.chi2 - trial.fit.count
    return left if left > 3 * np.sqrt(2 * trial.fit.count) else 0.0


def choose(trials: list[Trial], spread: float, base_inner: float) -> Trial | None:
    """The candidate to be named.

    Where the best fit leaves noise (spread 1) chi2 decides; where something remains, prediction inside the
    training part does, since chi2 then rewards whatever bends. Of candidates that cannot be told apart, the
    one with fewest numbers, apparatus before physics, and a law on all bodies before the same law on one of them,
    which had as many chances as there are bodies.
    """
    trials = [t for t in trials if _worth(t, spread) > 8 and t.inner < base_inner]
    if not trials:
        return None
    if spread <= 1.0:
        best = max(trials, key=lambda t: _worth(t, spread))
        same = [t for t in trials if _worth(best, spread) - _worth(t, spread) < SAME]
        # the best of several richer laws gains by chance more than one of them would
        for t in trials:
            extra, ahead = best.used - t.used, (best.gain - t.gain) / spread
            if extra > 0 and best.holds(t, SAME * spread) and ahead < stats.chi2.isf(SIMPLER, extra):
                same.append(t)
    else:
        near = [t for t in trials if _worth(t, spread) > 0.5 * max(_worth(u, spread) for u in trials)]
        best = min(near, key=lambda t: t.inner)
        same = [t for t in near if t.inner < 1.02 * best.inner]
    # where something remains, a law with more numbers must remove most of what a simpler one leaves
    same += [t for t in trials if t.used < best.used and _excess(t) < 2 * _excess(best)]
    return min(same, key=lambda t: (t.used, not is_apparatus(t), _is_part(t, same), -t.gain))


def _is_part(trial: Trial, others: Sequence[Trial]) -> bool:
    """Whether one of the others is the same law on these bodies and more."""
    mine = set(trial.term.bodies or ())
    return any(t.mechanism == trial.mechanism and mine < set(t.term.bodies or ()) for t in others)


def prune(
    chosen: Trial,
    base: Fit,
    fitter: Fitter,
    inner: InnerSplit,
    spread: float,
    predictor: Predictor,
    stop: Callable[[], bool],
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
        alone = Fitter(mine, predictor, {c.name: fitter.frames[c.name] for c in mine}, stop)
        base_fit = alone.fit(base.hypothesis, base.values, base.starts, fixed=True)
        own = for_bodies(chosen.term, [owner])
        assert own is not None
        term, index = own
        n = len(base.hypothesis.free)
        start = np.concatenate([base.values, chosen.fit.values[n + np.array(index)]])
        hypothesis = Hypothesis((*base.hypothesis.terms, term))
        with_law = alone.fit(hypothesis, start, chosen.fit.starts)
        own_spread = spread_of(with_law, mine)
        gain = (base_fit.chi2 - with_law.chi2) / own_spread
        split = InnerSplit.make(mine, predictor, stop)
        without, _ = split.score(base_fit)
        with_, _ = split.score(with_law)
        if gain < 10:
            dropped[owner] = f"its own data gain only {gain:.1f} in chi2 (over their spread)"
        elif gain < 40 and not with_ < without:
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
    values = np.concatenate([base.values, chosen.fit.values[len(base.values) + np.array(index)]])
    fit = fitter.fit(base.hypothesis.with_term(term), values, chosen.fit.starts)
    score, _ = inner.score(fit)
    signature = replace(chosen.signature, term=term)
    return Trial(signature, fit, base.chi2 - fit.chi2, score), dropped


def _one_camera_will_do(chosen: Trial, owner: str, base: Fit, fitter: Fitter, spread: float) -> bool:
    """Whether a scale of the one camera, with the law on all other bodies, does as well as the law on this one too."""
    scale = next((t for t in camera_terms(fitter.cases) if t.mechanism == "camera_scale"), None)
    others = for_bodies(chosen.term, [b for b in owners(chosen.term) if b != owner])
    if scale is None or others is None or chosen.fit is None:
        return False
    term, index = others
    start = np.concatenate([base.values, chosen.fit.values[len(base.values) + np.array(index)], [1.0]])
    rival = fitter.fit(base.hypothesis.with_term(term, scale), start, chosen.fit.starts, evaluations=12)
    return (rival.chi2 - chosen.fit.chi2) / spread < SAME


def second_law(
    found: list[Trial], revised: Fit, recalibrated: Fit, fitter: Fitter, terms: Sequence[Term], inner: InnerSplit,
    inner_scores: dict[str, float], rng: np.random.Generator, training: Sequence[Case],
) -> tuple[list[Trial], Fit]:  # fmt: skip
    """Add a second law where it is significant and predicts better."""
    if found:
        first = found[0]
        rest = [t for t in terms if t.mechanism != first.mechanism]
        beside = make_bank(fitter, revised, rest)
        # where something else is wrong too, a law with many numbers fits whatever that is
        spread = spread_of(revised, training)
        open_ = [s for s in beside.signatures if spread <= 1.0 or len(s.term.free) <= first.numbers]
        order = sorted((s for s in open_ if s.surviving > 0.02 and s.gain / spread > 8), key=lambda s: -s.gain)[:4]
        second_trials = []
        for signature in order:
            fit = refit(fitter, revised, signature, (1.0,))
            second_trials.append(Trial(signature, fit, revised.chi2 - fit.chi2, float("inf")))
        if not second_trials:
            return found, revised
        best_fit = min((t.fit for t in second_trials if t.fit), key=lambda f: f.chi2)
        spread = spread_of(best_fit, training)
        base_inner, base_by = inner.score(revised)
        scored = []
        for t in second_trials:
            if _worth(t, spread) > 8:
                assert t.fit is not None
                score, by_case = inner.score(t.fit)
                better = np.mean([by_case[k] < base_by[k] for k in by_case if k in base_by] or [False])
                scored.append((replace(t, inner=score), float(better)))
        good = (
            [t for t, better in scored if t.inner < 0.9 * base_inner and better > 0.8]
            if spread > 1.0
            else [t for t, _ in scored if t.inner < base_inner]
        )
        if not good:
            return found, revised
        best = choose(good, spread, base_inner)
        if best is None or best.fit is None:
            return found, revised
        null = search_nulls(
            beside, noise_of(best.fit, fitter.cases, spread),
            np.array([s.surviving > 0.02 for s in beside.signatures]),
            best.gain, 99, rng,
        )  # fmt: skip
        if null.p > ALARM:
            return found, revised
        # the first may only have been stuck: refitted alone from where the two ended
        alone = fitter.fit(revised.hypothesis, best.fit.values[: len(revised.values)], best.fit.starts)
        if alone.chi2 < revised.chi2:
            first = replace(first, fit=alone, gain=recalibrated.chi2 - alone.chi2)
            found, revised = [first], alone
        gain = (alone.chi2 - best.fit.chi2) / spread
        if gain < 12 + 2 * best.numbers or not _away_from_absent(best.fit, best, spread):
            return found, revised
        inner_scores[f"{first.term.label} + {best.term.label}"] = best.inner
        # beside the second law another drag than the one that came first alone may do better
        both = [replace(first, fit=best.fit, gain=recalibrated.chi2 - best.fit.chi2, inner=best.inner), best]
        pair = _partners(both, recalibrated, fitter, terms, inner, inner_scores, training)
        if pair is not both and pair[0].fit is not None:
            return pair, pair[0].fit
        return [first, best], best.fit
    return found, revised


def pair_of(
    base: Fit, fitter: Fitter, terms: Sequence[Term], inner: InnerSplit, inner_scores: dict[str, float], best: float,
    predictor: Predictor, rng: np.random.Generator, training: Sequence[Case], stop: Callable[[], bool],
) -> list[Trial]:  # fmt: skip
    """Two laws that help only together (a repulsion at a distance and a drag), none where there is no such pair.

    Signatures of the first third of each track rank the pairs, where the prediction is still linear in them;
    the best are refitted on growing parts. ``best``: the inner score that they have to beat.
    """
    third = {}
    for case in fitter.cases:
        rows = np.flatnonzero(fitter.frames[case.name])
        third[case.name] = np.zeros(len(case.t), dtype=bool)
        third[case.name][rows[: max(len(rows) // 3, min(12, len(rows)))]] = True
    short = Fitter(fitter.cases, predictor, third, stop)
    start = short.fit(base.hypothesis, base.values)
    bank = make_bank(short, start, [t for t in terms if len(t.free) <= 2])
    ranked = [(extra, i, j) for extra, i, j in pair_gains(bank) if extra > 20]
    tried: set[tuple[str, str]] = set()
    winner: list[Trial] = []
    for _, i, j in ranked:
        a, b = bank.signatures[i], bank.signatures[j]
        names = (a.term.mechanism, b.term.mechanism)
        if names in tried:
            continue  # the best of their variants has been tried
        if len(tried) == 6:
            break
        tried.add(names)
        hypothesis = base.hypothesis.with_term(a.term, b.term)
        fit = fitter.fit(hypothesis, None, start.starts, stages=(0.35, 0.65, 1.0), evaluations=30)
        gain = base.chi2 - fit.chi2
        spread = spread_of(fit, training)
        if gain / spread < 12 + 2 * len(hypothesis.free):
            continue
        score, _ = inner.score(fit)
        # the first pair has to beat what there is by a margin, the next ones only that pair
        if not score < (best if winner else 0.5 * best):
            continue
        whole = make_bank(fitter, base, [a.term, b.term])
        null = search_nulls(whole, noise_of(fit, fitter.cases, spread), np.ones(2, dtype=bool), gain, 199, rng)
        if null.p <= ALARM:
            best = score
            inner_scores[f"{a.term.label} + {b.term.label}"] = score
            winner = [Trial(a, fit, gain, score), Trial(b, fit, gain, score)]
    if winner and winner[0].fit is not None:
        # strength and shape of a law lie along a valley: walk it to its end
        fit = winner[0].fit
        fit = fitter.fit(fit.hypothesis, fit.values, fit.starts, evaluations=120)
        winner = [replace(t, fit=fit, gain=base.chi2 - fit.chi2) for t in winner]
        winner = _partners(winner, base, fitter, terms, inner, inner_scores, training)
    return winner


def _partners(
    pair: list[Trial], base: Fit, fitter: Fitter, terms: Sequence[Term], inner: InnerSplit,
    inner_scores: dict[str, float], training: Sequence[Case],
) -> list[Trial]:  # fmt: skip
    """The pair with its drag (a law of one strength on single bodies) exchanged for every other, the best of them.

    The signatures that found the pair were those of a short first part, where one drag looks like another.
    Each begins at the amount that moves the bodies as the present one does.
    """
    best, fit = pair, pair[0].fit
    assert fit is not None
    offset = len(base.values)
    for which in (0, 1):
        term, keep = pair[which].term, pair[1 - which]
        at = offset + (len(pair[0].term.free) if which else 0)
        if len(term.free) != 1 or term.mechanism not in SINGLE:
            continue
        rows = slice(offset + (0 if which else 1), offset + (0 if which else 1) + len(keep.term.free))
        moved = np.concatenate([fit.jacobian[c.name][0][:, at] for c in fitter.cases]) * fit.values[at]
        others = [t for t in terms if t.mechanism in SINGLE and len(t.free) == 1 and t.label != term.label]
        others = [t for t in others if t.mechanism != keep.mechanism]
        for other in make_bank(fitter, fit, others).signatures:
            alone = fitter.fit(fit.hypothesis.with_term(other.term), [*fit.values, 0.0], fit.starts, stages=())
            column = np.concatenate([alone.jacobian[c.name][0][:, -1] for c in fitter.cases])
            power = float(column @ column)
            if power == 0.0:
                continue
            amount = float(np.clip(column @ moved / power, other.term.free[0].low, other.term.free[0].high))
            hypothesis = base.hypothesis.with_term(keep.term, other.term)
            begin = [*fit.values[:offset], *fit.values[rows], amount]
            found = fitter.fit(hypothesis, begin, fit.starts, evaluations=60)
            gain = base.chi2 - found.chi2
            if gain > best[0].gain + SAME * spread_of(found, training):
                score, _ = inner.score(found)
                inner_scores[f"{keep.term.label} + {other.term.label}"] = score
                best = [replace(keep, fit=found, gain=gain, inner=score), Trial(other, found, gain, score)]
    return best


def _away_from_absent(fit: Fit, trial: Trial, spread: float) -> bool:
    """Whether the interval of at least one strength of the last term leaves out where the law is absent."""
    offset = len(fit.values) - trial.numbers
    for k, free in enumerate(trial.term.free):
        _, low, high = fit.interval(offset + k, spread)
        if not free.inner and not low <= free.neutral <= high:
            return True
    return False


def left_over(revised: Fit, recalibrated: Fit, inner: float, base: float, training: Sequence[Case]) -> float:
    """The share of the misfit that an explanation leaves: of that inside the training part, or of chi2 if larger.

    A wrong law with a number for each body may predict far better than none and still follow nothing closely;
    where the size of the noise is given, what is left in chi2 shows it.
    """
    share = (inner - 1.0) / max(base - 1.0, 1e-12)
    rest = revised.chi2 - revised.count
    if all(c.sigma_known for c in training) and rest > 3 * np.sqrt(2 * revised.count):
        share = max(share, rest / max(recalibrated.chi2 - recalibrated.count, 1e-12))
    return float(share)


def verdict_among(
    found: list[Trial], arms: Sequence[Trial], inner_scores: Mapping[str, float], white_recalibrated: Whiteness,
    naive: Fit, recalibrated: Fit, revised: Fit, spread: float, adjustable: bool, training: Sequence[Case],
    notes: list[str],
) -> tuple[str, Trial | None]:  # fmt: skip
    """Which of the five verdicts, and the flexible arm where it wins."""
    base = inner_scores["recalibrated"]
    arm = min(arms, key=lambda t: t.inner, default=None)
    named_inner = inner_scores.get(" + ".join(t.term.label for t in found), found[0].inner) if found else base
    named_gain = recalibrated.chi2 - revised.chi2
    if arm is not None and arm.fit is not None:
        more = arm.numbers - sum(t.numbers for t in found)
        # where the size of the noise is given, what a law leaves beyond it does not excuse the law
        level = min(spread, spread_of(arm.fit, training)) if all(c.sigma_known for c in training) else spread
        ahead = (arm.gain - named_gain) / level - 2 * more
        # a margin in prediction and in fit, so that a spline of the same law does not win by chance
        clear = ahead > (25 if more > 0 else 12) and arm.inner < 0.9 * named_inner
        clear = clear and arm.inner - 1.0 < 0.6 * (named_inner - 1.0)
        # two laws that one force of no more numbers replaces were put together to imitate it
        instead = len(found) > 1 and more <= 0 and ahead > SAME and arm.inner <= named_inner
        if arm.inner < base and (clear or instead):
            return "unmodelled", arm
    if found:
        # a law that is the best of a poor lot is not an explanation
        left = left_over(revised, recalibrated, named_inner, base, training)
        if spread > 1.0 and left > POOR:
            notes.append(f"the best named law, {found[0].mechanism}, leaves {100 * left:.0f} % of the misfit")
            if all(is_apparatus(t) for t in found) and left < MOST_LEFT:
                notes.append("until the apparatus is put right these data say nothing about the physics")
                return "measurement", None
            return "unmodelled", arm
        if all(is_apparatus(t) for t in found):
            return "measurement", None
        return "missing_physics", None
    if white_recalibrated.z > 6 and white_recalibrated.p < 1e-6:
        # the size of the noise is given, and this is more than noise
        notes.append("the innovations are far above the stated noise, and no named law predicts them better")
        return "unmodelled", arm
    improved = naive.chi2 - recalibrated.chi2
    if adjustable and improved / spread > 12 + 2 * len(recalibrated.values):
        return "recalibrate", None
    if white_recalibrated.p < 1e-4:
        notes.append("the innovations are not white noise, but nothing tried predicts them better")
    return "no_mismatch", None


def rivals_of_pair(
    found: list[Trial], revised: Fit, recalibrated: Fit, fitter: Fitter, terms: Sequence[Term], spread: float,
    notes: list[str],
) -> list[tuple[Trial, bool]]:  # fmt: skip
    """Laws that may stand in place of one of the two found, best first; True where these data cannot tell.

    Beside the other one alone they are ranked by signatures, and those that come near are refitted.
    """
    result: dict[str, tuple[Trial, bool]] = {}
    first = len(recalibrated.values)
    cut = first + found[0].numbers
    for replaced, keep, rows in ((found[1], found[0], slice(first, cut)), (found[0], found[1], slice(cut, None))):
        hypothesis = recalibrated.hypothesis.with_term(keep.term)
        begin = np.concatenate([revised.values[:first], revised.values[rows]])
        alone = fitter.fit(hypothesis, begin, revised.starts)
        others = [t for t in terms if t.mechanism not in {f.mechanism for f in found}]
        ranked = sorted(make_bank(fitter, alone, others).signatures, key=lambda s: -s.gain)
        lost = alone.chi2 - revised.chi2
        for signature in [s for s in ranked if s.gain > NEAR_PARTNER * lost][:PARTNERS]:
            fit = refit(fitter, alone, signature, (1.0,))
            trial = Trial(signature, fit, recalibrated.chi2 - fit.chi2, float("inf"))
            ahead = (fit.chi2 - revised.chi2) / spread + 2 * (trial.used - replaced.used)
            best = result.get(trial.mechanism)
            if trial.gain > 0 and (best is None or trial.gain > best[0].gain):
                result[trial.mechanism] = trial, bool(ahead < SAME)
                note = f"{trial.mechanism} in place of {replaced.mechanism} does as well"
                if ahead < SAME and note not in notes:
                    notes.append(note)
    return sorted(result.values(), key=lambda r: -r[0].gain)[:3]


def rivals_of(found: list[Trial], alive: list[Trial], spread: float, verdict: str) -> list[tuple[Trial, bool]]:
    """Other candidates than the one found, best first, once for each name; True where data cannot tell them apart."""
    if not found:
        return []
    winner = found[0]
    result: list[tuple[Trial, bool]] = []
    seen = {winner.mechanism}
    for t in sorted(alive, key=lambda t: -t.gain):
        if t.mechanism in seen or t.fit is None or winner.fit is None:
            continue
        if t.gain < 0.2 * winner.gain:
            continue
        seen.add(t.mechanism)
        same = _worth(winner, spread) - _worth(t, spread) < SAME
        result.append((t, bool(same)))
    return result[:8]
