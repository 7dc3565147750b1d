"""What decides where a bed is not seen: which candidates are run, in how many packings, and what is concluded."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PackingCriteria:
    """All that decides where statistics over packings are compared.

    survives : of a signature, below which recalibration imitates it. Choice
    visible : a signature has to stand out of the runs' own noise by this factor. Choice
    replicates : of the search in packings of the recalibrated scene. Theory: p is told to a third at 0.01
    probes : amounts of a candidate that are tried at most;  inside : of the way to a bound, how far
    more : p of the search, up to which those that lead are run in more packings. Choice
    side : standard deviations, one-sided 95 %
    of_a_class : of what the best gains on speeds alone, from which a law is of its class. Choice
    resamples : of the frames of a curve, for the share that is explained
    folds : into which pairs of packings are cut where a regression is tested on others
    wild : mean square of a scene's residuals, in those of the naive scene, beyond which they do not count. Choice
    aside : of a found amount, how far on both sides of it runs tell its slope. Choice: curvature cancels to first order
    lean : runs that the spread of all scenes counts for, beside those of one scene. Choice
    settled : of a number's standard error, or of the number, by how much it may be off where it was run. Choice
    reach : standard deviations of the runs' error, from which a law that is behind cannot be the best. Theory: 1 in 700
    behind : of the best gain, within which a law is run where it is fitted before it is left behind. Choice
    cycles : below which nothing can be told about harmonics
    films : that the budget of a diagnosis is meant for; fewer take their part of it
    probed : runs of a candidate at amounts that show too little or too much, before one that shows. Measured: 1.5
    pairs : cost of a candidate's run in those of the naive scene. Measured: 1.3 over all candidates
    spread : packings of the naive scene that tell the spread of some forty numbers, at the least
    """

    survives: float = 0.02
    visible: float = 2.0
    replicates: int = 299
    probes: int = 5
    inside: float = 0.95
    more: float = 0.2
    side: float = 1.645
    of_a_class: float = 0.95
    resamples: int = 400
    folds: int = 5
    wild: float = 3.0
    settled: tuple[float, float] = (0.5, 0.1)
    reach: float = 3.0
    behind: float = 0.2
    aside: float = 0.4
    lean: float = 4.0
    cycles: float = 1.2
    films: int = 4
    probed: float = 1.5
    pairs: float = 1.3
    spread: int = 60
