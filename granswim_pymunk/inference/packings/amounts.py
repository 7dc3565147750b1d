"""Amounts of candidates that show, and do not overturn everything."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from ..criteria import current
from .candidates import Candidate, candidates_of, priced
from .runs import Job
from .state import NAIVE, Search, Trial, bears_on, change_of, label_of
from .summaries import Condition


@dataclass
class Amount:
    """The search for an amount of a candidate that shows, in units of its first one.

    sharp : by how much signatures are known better than from one packing: shifts may be smaller
    tried : shift at each amount, infinite where the run did not survive it;  factor : what is tried next
    other : what is tried after the first, where that did not show or overturned everything
    """

    sharp: float = 1.0
    factor: float = 1.0
    other: float | None = None
    tried: dict[float, float] = field(default_factory=dict)
    settled: bool = False

    def add(self, size: float, at_bound: bool) -> None:
        """Take in the shift at ``factor``. Once one was too small and another too large, the next lies between."""
        shown, size = current().packings.amounts, size * self.sharp
        self.tried[self.factor] = size
        small = max((f for f, r in self.tried.items() if r < shown.least), default=None)
        large = min((f for f, r in self.tried.items() if r > shown.most), default=None)
        self.settled = shown.least <= size <= shown.most or (size < shown.least and at_bound)
        if self.other is not None:
            self.factor, self.other = self.other, None
        elif small is not None and large is not None:
            self.factor = self._rounded(math.sqrt(small * large))
        elif size < shown.least:
            self.factor *= shown.grow
        else:
            self.factor = self._rounded(self.factor * (shown.wanted / size if math.isfinite(size) else shown.gone))

    def _rounded(self, factor: float) -> float:
        """To a power of two, where that was not tried: other recordings of the same bed then share these runs."""
        near = 2.0 ** round(math.log2(factor))
        return factor if near in self.tried else near

    @property
    def best(self) -> float | None:
        """The amount whose shift is nearest to what is wanted, None where no run survived."""
        alive = {f: max(r, 1e-6) for f, r in self.tried.items() if math.isfinite(r)}
        return min(alive, key=lambda f: abs(math.log(alive[f] / current().packings.amounts.wanted)), default=None)


def amount_label(x: Candidate, row: np.ndarray) -> str:
    """Label of the runs of a candidate in the naive scene, at one of the points of its design."""
    return label_of((), (), [(x.term, x.neutral + row)])


def amount_jobs(
    x: Candidate, row: np.ndarray, conditions: Sequence[Condition], packings: Sequence[int], part: bool = True
) -> list[Job]:
    """Runs of a candidate in the naive scene; ``part``: see ``Job``."""
    extra = [(x.term, x.neutral + row)]
    label = amount_label(x, row)
    return [
        Job(c, label, change_of(c, (), (), extra), k, True, part)
        for k in packings for c in conditions if bears_on(x.term, c)
    ]  # fmt: skip


def in_spreads(s: Search, c: Condition, shift: np.ndarray) -> float:
    """Root mean square of a shift (p,), in what the numbers of two packings differ by."""
    mean_square = float(shift @ np.linalg.solve(s.means.covariance[c.name], shift)) / len(shift)
    return math.sqrt(mean_square / 2.0)


def spreads_off(s: Search, c: Condition) -> float:
    """How far the recording is from the recalibrated scene, in what two packings differ by; 0.7 where nothing lacks."""
    return in_spreads(s, c, s.base.left[c.name][0])


def scaled_candidates(s: Search) -> list[Candidate]:
    """All candidates at amounts that show in the first recording and do not overturn everything there.

    Signatures bend: where more is to be explained than a usual first amount changes, they are taken at that size.
    """
    every = priced(candidates_of(s.training), s.runner.packed(s.training[0], 0))
    adjustable = {t.label for t in s.adjust}
    every = [x for x in every if not any(f.name in adjustable for f in x.term.free)]
    physical = [x for x in every if not x.apparatus]
    probe = s.training[0]
    stretch = max(spreads_off(s, probe) / current().packings.amounts.wanted, 1.0)
    amounts = {x.label: Amount(math.sqrt(x.packings(s.sizes.screen)), other=x.other) for x in physical}
    for attempt in range(current().packings.probes):
        trying = [(x, x.scaled(amounts[x.label].factor)) for x in physical if not amounts[x.label].settled]
        if not trying:
            break
        jobs = [j for _, scaled in trying for j in amount_jobs(scaled, scaled.design[0], [probe], [0])]
        begun = partial(lambda at, k, n: s.progress("trying the candidates", 0.26 + 0.015 * (at + k / n)), attempt)
        s.runner.do(jobs, begun)
        s.means.refresh()
        for x, scaled in trying:
            found = s.means.mean[probe.name].get((amount_label(scaled, scaled.design[0]), True))
            size = math.inf
            if found is not None:
                size = in_spreads(s, probe, found[0] - s.means.mean[probe.name][NAIVE, True][0]) / stretch
            bigger = x.scaled(2 * amounts[x.label].factor)
            amounts[x.label].add(size, np.allclose(bigger.design, scaled.design))
    settled = {label: a.best for label, a in amounts.items() if a.best is not None}
    for x in physical:
        if x.label not in settled:
            why = s.runner.reason(amount_label(x, x.design[0])) or "no amount that was tried could be run"
            s.trials.append(Trial(x, 0.0, 0.0, None, 0, why))
    result = [x for x in every if x.apparatus]
    return result + [x.scaled(settled[x.label]) for x in physical if x.label in settled]


def try_all(s: Search) -> list[Candidate]:
    """Runs of every candidate in the naive scene: what it changes there is its signature."""
    result = scaled_candidates(s)
    jobs = [
        j for x in result if not x.apparatus for row in x.design
        for j in amount_jobs(x, row, s.training, range(x.packings(s.sizes.screen)))
    ]  # fmt: skip
    s.runner.do(jobs, lambda k, n: s.progress("signatures of the candidates", 0.34 + 0.26 * k / n))
    s.means.refresh()
    return result


def more_runs(s: Search, chosen: Sequence[Candidate], share: float) -> None:
    """Sharper signatures of those that are still in question."""
    usual = s.sizes.screen, s.sizes.screen + s.sizes.more
    jobs = [
        j for x in chosen for row in x.design for j in amount_jobs(x, row, s.training, range(*map(x.packings, usual)))
    ]
    s.runner.do(jobs, lambda k, n: s.progress("sharper signatures of the best", share + 0.04 * k / n))
    s.means.refresh()
