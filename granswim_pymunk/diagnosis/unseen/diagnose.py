"""``diagnose_unseen``: recordings in which the grains are not seen, and curves, explained together."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from ...inference.result import Diagnosis, Progress
from ...recording import Recording
from .candidates import suspects_of
from .checks import confirm, locate, propose, score
from .conclude import search_and_conclude
from .report import result_of
from .runs import Runner, workers
from .search import Sizes, begin
from .summaries import Condition, conditions_of

MINUTES = 15.0  # what a diagnosis may take on CORES idle cores, where nothing is said
CORES = 2
PAIRS = 1.6  # cost of a candidate's run in those of the naive scene: laws of pairs at a distance take longer


def diagnose_unseen(
    recordings: Sequence[Recording],
    hold_out: Sequence[Recording] = (),
    *,
    minutes: float | None = None,
    seed: int = 0,
    progress: Progress = lambda text, share: None,
    sizes: Sizes | None = None,
) -> Diagnosis:
    """Explain all recordings together by one set of missing laws.

    The naive scene is simulated in other packings than the recording's; means and harmonics of the segments'
    angles, the stroke of the head and the drift are compared with their spread between packings. ``minutes``: the
    budget on two idle cores; it sets how many packings are run of each kind, by the size of the runs and not by the
    clock, so that a busy machine gives the same answer later. ``seed``: of the packings and the nulls. Finished runs
    are kept in the user's cache, so that an interrupted diagnosis goes on.
    Raises InputError for recordings that cannot be used.
    """
    began = time.monotonic()
    rng = np.random.default_rng(seed)
    conditions = conditions_of(recordings, hold_out, seed)
    runner = Runner(seed=seed, workers=workers())
    chosen = sizes or planned_sizes(conditions, runner, MINUTES if minutes is None else minutes)
    s = begin(conditions, runner, chosen, rng, progress)
    finding = search_and_conclude(s)
    confirm(finding)
    progress("where it shows", 0.93)
    finding.spots = [] if finding.verdict == "no_mismatch" else locate(finding)
    progress("held-out data", 0.95)
    score(finding)
    progress("the next experiment", 0.97)
    propose(finding)
    found = result_of(finding, time.monotonic() - began, seed)
    progress("done", 1.0)
    return found


def planned_sizes(conditions: Sequence[Condition], runner: Runner, minutes: float) -> Sizes:
    """Packings of each kind that a budget pays for, at most three times as many as usual."""
    usual = Sizes()
    training = [c for c in conditions if c.view is not None]
    candidates = sum(len(x.design) for x in suspects_of(training))
    adjustables = len({a.name for c in conditions for a in c.recording.scene.adjustable})
    soft = {c.name: runner.cost(c, True) for c in conditions}
    true = {c.name: runner.cost(c, False) for c in conditions}

    def seconds(z: Sizes) -> float:
        probes = 3 * candidates * soft[training[0].name] * PAIRS
        runs = z.soft + adjustables * z.adjustable + candidates * PAIRS * z.screen + 8 * PAIRS * z.more
        runs += 2 * z.leaders * (z.leader // 2) + z.leaders * z.leader + 2 * z.duel
        held = z.true // 2 + z.final, z.soft // 2 + 4 * z.leader
        inside = sum(soft[c.name] * runs + true[c.name] * (z.true + z.final) for c in training)
        outside = sum(
            true[c.name] * held[0] + soft[c.name] * held[1] for c in conditions if c.view is None
        )
        return probes + inside + outside

    budget = 60 * minutes * CORES
    factors = (3.0, 2.0, 1.5, 1.2, 1.0, 0.8, 0.6, 0.45, 0.3)
    return next((z for z in map(usual.times, factors) if seconds(z) <= budget), usual.times(factors[-1]))
