"""Whether another explanation, fitted to the same frames, predicts held-out data better than the one that is claimed.

What has more numbers than there is to tell fits the frames that it has seen as closely as the truth does, and goes
astray behind them. Held-out data may take from a claim (contract 2) and make none: the other explanation is told of,
and what is claimed is no longer said to be all there is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..criteria import current
from ..judge import as_large_by_chance
from .choose import absurd, worth
from .fitted import Fit
from .held_out import Errors, paired_verdict
from .name import Trial


def as_simple(laws: Sequence[Trial], fit: Fit, base: Fit, others: Sequence[Trial], spread: float) -> list[Trial]:
    """Laws, and forms without a name, that have no more numbers than those claimed and are rivals in training, best
    first.

    Of other names, without a special fault of the apparatus, and with numbers that were found.
    """
    criteria, names = current().verdict, {t.mechanism for t in laws}
    numbers, least = sum(t.used for t in laws), criteria.rival * (base.chi2 - fit.chi2)
    near = [
        t for t in others
        if t.fit is not None and t.used <= numbers and t.gain >= least
        and t.mechanism not in names and not t.special and not absurd(t)
    ]  # fmt: skip
    return sorted(near, key=lambda t: -worth(t, spread))[: criteria.rivals]


def predicts_better(
    fit: Fit, mine: Errors, rivals: Sequence[Trial], errors: Callable[[Fit], Errors],
    films: Callable[[Sequence[Fit]], np.ndarray], rng: np.random.Generator, chance: float,
) -> Trial | None:  # fmt: skip
    """The rival that predicts held-out data better than a claim, None where none does by more than chance.

    Frame by frame, in pairs of blocks, as a claim is held against the scene without it. All frames of one run are off
    together by what is not known of numbers, so that this alone is no proof: films are drawn in which the claim is
    true, with noise as large and as slow as was found, and both are fitted to them and predict the rest. In these the
    claim is seldom as far behind (``chance``) as it is in the recordings.
    mine : held-out errors of the claim;  errors : makes them of another fit
    films : makes those (films, fits) [m or rad, rms] in films in which the first of several fits is true
    """
    told = [(t, errors(t.fit)) for t in rivals if t.fit is not None]
    best, its = min(told, key=lambda e: e[1].rms if e[1].rms is not None else np.inf, default=(None, mine))
    if best is None or best.fit is None or not its.rms or mine.rms is None or mine.rms <= its.rms:
        return None
    if paired_verdict(mine, its, rng) != "holds":
        return None
    drawn = films([fit, best.fit])
    return best if as_large_by_chance(mine.rms / its.rms, drawn[:, 0] / drawn[:, 1]) < chance else None
