"""Nulls: what the same search finds in noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..criteria import current
from ..data import Case
from ..significance import Null
from .fitted import Fit
from .signatures import Bank


def correlation_time(series: np.ndarray) -> float:
    """1 + 2 sum of the autocorrelation up to its first value that is not clearly above zero; 1 for white noise."""
    series = series - series.mean()
    n = len(series)
    power = float(series @ series)
    if n < current().noise.correlated or power == 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, n // 3):
        rho = float(series[:-lag] @ series[lag:]) / power
        if rho < 2 / np.sqrt(n):
            break
        total += 2 * rho
    return total


def shuffled(series: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The series with the phases of its Fourier components drawn anew: same spectrum, no memory of when."""
    spectrum = np.fft.rfft(series)
    phases = np.exp(2j * np.pi * rng.random(len(spectrum)))
    phases[0] = 1.0
    if len(series) % 2 == 0:
        phases[-1] = 1.0
    return np.fft.irfft(spectrum * phases, n=len(series))


def surrogate(innovations: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Innovations (T, c) with the phases of every channel shuffled; NaN stays where it is. As one vector."""
    result = np.full(innovations.shape, np.nan)
    for c in range(innovations.shape[1]):
        seen = np.isfinite(innovations[:, c])
        if seen.any():
            result[seen, c] = shuffled(innovations[seen, c], rng)
    return result[np.isfinite(result)]


def search_nulls(
    bank: Bank,
    noise: Sequence[tuple[np.ndarray, int]] | float,
    wanted: np.ndarray,
    case: float,
    replicates: int,
    rng: np.random.Generator,
    errors: np.ndarray | None = None,
) -> Null:
    """Search again in innovations that hold no candidate.

    ``noise``: the size of white noise, or innovations (T, c) of each recording, in the order of the bank, whose
    phases are shuffled, and how many steps between segments come after them. ``wanted`` (candidates,): mask of those
    that count; ``case``: the gain found on the data; ``errors`` (n, m): what errors of the apparatus add at their usual
    sizes, each drawn anew.
    """
    if isinstance(noise, float):
        drawn = noise * rng.normal(size=(len(bank.innovations), replicates))
    else:
        drawn = np.column_stack([_shuffled_again(noise, rng) for _ in range(replicates)])
    if errors is not None:
        drawn = drawn + errors @ rng.normal(size=(errors.shape[1], replicates))
    return Null(bank.gains(drawn)[wanted].max(axis=0, initial=0.0), case)


def _shuffled_again(noise: Sequence[tuple[np.ndarray, int]], rng: np.random.Generator) -> np.ndarray:
    """One replicate of all recordings; steps between segments are as wide as they are expected to be."""
    return np.concatenate(
        [part for array, steps in noise for part in (surrogate(array, rng), rng.normal(size=steps))]
    )  # fmt: skip


def noise_of(fit: Fit, cases: Sequence[Case], spread: float) -> list[tuple[np.ndarray, int]] | float:
    """What the nulls are drawn from: the size of white noise, or, where more remains, what the best fit leaves over.

    A fit takes the slow part of the noise away, which is where laws are: where white noise remains its size alone
    is kept, counted without the numbers that were fitted, and not its spectrum.
    """
    free = max(fit.count - fit.numbers, 1)
    if spread <= 1:
        return 1.0 if all(c.sigma_known for c in cases) else float(np.sqrt(fit.chi2 / free))
    size = np.sqrt(fit.count / free)
    return [(fit.white[c.name] * size, len(fit.steps.get(c.name, ()))) for c in cases]
