"""``python -m granswim_pymunk.benchmarks.bed_power RECORDING [REPLICATES]``: what the search in a bed loses.

Of one recording of a swimmer and its grains: the variance of whitened innovations of replicates, each judged by the
others (1 where their covariance is known); what candidates gain in replicates with the columns of the film, and with
columns of the replicates' own starts (a number of degrees of freedom is 1 where noise is white); the 1 % of the nulls
before and after that is allowed for. Some five minutes for a full bed.
"""

from __future__ import annotations

import sys

import numpy as np

from granswim_pymunk.inference.criteria import DEFAULT, current
from granswim_pymunk.inference.linear import basis
from granswim_pymunk.inference.windows.chance import own_answers
from granswim_pymunk.inference.windows.driver import begin, recalibrated, screened, signatures_in_time
from granswim_pymunk.inference.windows.plan import Plan
from granswim_pymunk.inference.windows.signatures import off, recombined, whole_films
from granswim_pymunk.recording import read_recording

ASKED = 12  # candidates, the first of the search
MINUTES = 60.0


def main(folder: str, replicates: int = DEFAULT.windows.plan.replicates) -> None:
    """Print the table for the recording in ``folder``."""
    criteria = current().windows.signatures
    notes: list[str] = []
    plan = Plan.usual(replicates)
    start = begin([read_recording(folder)], [], MINUTES, 0, None, plan, True, notes)
    search, _ = recalibrated(start, np.random.default_rng(0), lambda text, share: print(text, file=sys.stderr))
    signatures = signatures_in_time(search, start.terms, notes)
    likelihood, few, nuisance = search.likelihood, search.few, search.few_nuisance
    films = off(nuisance, whole_films(likelihood.noises, few))
    drawn = off(nuisance, recombined(likelihood.noises, few, criteria.replicates, np.random.default_rng(1)))
    plain = np.max([s.best(drawn)[1] for s in signatures], axis=0)
    trials, by_chance = screened(search, signatures, np.random.default_rng(2), notes)
    null = by_chance.null(trials[0])
    asked = trials[:ASKED]
    cross, own = [], []
    for t, (answers, shapes) in zip(asked, own_answers(likelihood, asked, few, nuisance, plan.screening), strict=True):
        q = basis(t.signature.clear)
        size = q.shape[1]
        cross.append(np.mean(np.sum((q.T @ films) ** 2, axis=0)) / size)
        away = answers - answers.mean(axis=0)
        own.append(np.mean([np.sum((c @ a) ** 2) for a, c in zip(away, shapes, strict=True)]) / size)
    print(f"recording {folder}, {replicates} replicates, {len(few[0])} windows, {len(signatures)} candidates")
    print(f"variance of whitened innovations: {np.mean(films**2):.2f}")
    text = f"{np.mean(cross):.2f} by columns of the film, {np.mean(own):.2f} by their own"
    print(f"gain of a number in replicates: {text}")
    print(f"a bias that so many replicates tell: {(replicates + 1) / (replicates - 1):.2f} times the scatter")
    levels = [float(np.quantile(gains, 1 - DEFAULT.verdict.alarm)) for gains in (plain, null.gains)]
    print(f"1 % of the nulls: {levels[0]:.1f} in replicates, {levels[1]:.1f} in the end")
    print(f"most that a candidate gains here: {null.case:.1f} ({trials[0].term.label})")


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:3]))
