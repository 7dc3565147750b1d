"""Is there more to see in what a fit leaves: score tests along what each candidate law would change.

A test that knows no alternative (``judge.completeness``) has to look everywhere, and so sees little anywhere. A law
that was left out moves the bodies in its own way: of all that noise could do, that one direction. The largest of many
such tests is held against the same in noise. Source: Rao 1948, Proc. Camb. Phil. Soc. 44, 50.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ... import distributions as stats
from ..criteria import current
from ..data import Case
from ..hypothesis import Term
from ..noise import Noise
from .fit import Fitter
from .fitted import Fit
from .innovations import memory_of, white_sizes
from .pairs import price
from .signatures import Bank, make_bank


def chance_of_more(fitter: Fitter, fit: Fit, terms: Sequence[Term], rng: np.random.Generator) -> float:
    """Probability that noise alone has as much along the signature of any candidate as what a fit leaves.

    The noise is white, and slow as far as noise may be: that of the likelihood, or, where it has none, what the
    residuals show beside the candidate that gains most.
    """
    bank = make_bank(fitter, fit, terms)
    shown = [s for s in bank.signatures if s.surviving > current().signatures.shows and s.directions.shape[1]]
    if not shown:
        return 1.0
    bank = Bank(bank.fit, bank.innovations, bank.nuisance, tuple(shown))
    noise = Noise()
    if not any(c.noise.size for c in fitter.cases):
        lead = max(shown, key=lambda s: s.gain - 2 * s.directions.shape[1])
        pays = lead.gain >= price(len(shown), lead.directions.shape[1])
        noise = memory_of(fit, fitter.cases, lead.directions if pays else None)
    drawn = np.column_stack([_drawn(fit, fitter.cases, noise, rng) for _ in range(current().left.draws)])
    drawn *= white_sizes(fit, fitter.cases, rng, current().left.draws)
    return largest_by_chance(bank, bank.innovations, drawn)


def largest_by_chance(bank: Bank, residuals: np.ndarray, drawn: np.ndarray) -> float:
    """p of the largest of the score tests of residuals (n,), from the same of noise (n, draws).

    The gain of a candidate with k directions over its mean in noise, times k, is chi2 of k degrees; the least of these
    probabilities is held against the least in each draw.
    """
    numbers = np.array([s.directions.shape[1] for s in bank.signatures], dtype=float)
    by_chance = bank.gains(drawn)  # (m, draws)
    mean = by_chance.mean(axis=1)
    found = stats.chi2.logsf(bank.gains(residuals) * numbers / mean, numbers).min()
    least = stats.chi2.logsf(by_chance * (numbers / mean)[:, None], numbers[:, None]).min(axis=0)
    return float((1 + np.sum(least <= found)) / (drawn.shape[1] + 1))


def _drawn(fit: Fit, cases: Sequence[Case], noise: Noise, rng: np.random.Generator) -> np.ndarray:
    """Noise (n,) in the order of ``Fit.used`` of all recordings in turn."""
    parts = []
    for case in cases:
        used = np.isfinite(fit.white[case.name])
        values = noise.draw(used.shape, rng)
        parts += [values[used], rng.normal(size=len(fit.steps.get(case.name, ())))]
    return np.concatenate(parts)
