"""``diagnose_unseen``: recordings in which the grains are not seen, and curves, explained together."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...recording import Recording
from ..outcome import Outcome
from .conclude import confirm, locate, propose, score, search_and_conclude
from .conditions import conditions_of
from .runs import Runner, workers
from .search import Search, Sizes, begin
from .tell import outcome_of

Progress = Callable[[str, float], None]

ROOM = 240.0  # s that more runs than usual may take
ROOM_SHARE = 0.4  # of the budget
NOMINAL = 1.5e-8  # s that a step of one body takes, two at a time


def diagnose_unseen(
    recordings: Sequence[Recording],
    hold_out: Sequence[Recording] = (),
    *,
    minutes: float | None = None,
    seed: int = 0,
    progress: Progress = lambda text, share: None,
    sizes: Sizes | None = None,
) -> Outcome:
    """Explain all recordings together by one set of missing laws.

    The naive scene is simulated in other packings than the recording's; means and harmonics of the segments'
    angles, the stroke of the head and the drift are compared with their spread between packings. ``minutes``: the
    budget; when it runs short, fewer packings and fewer suspects are run, and the notes say so. ``seed``: of the
    packings and the nulls. Finished runs are kept in the user's cache, so that an interrupted diagnosis goes on.
    Raises InputError for recordings that cannot be used.
    """
    began = time.monotonic()
    rng = np.random.default_rng(seed)
    conditions = conditions_of(recordings, hold_out, seed)
    deadline = None if minutes is None else began + 60 * minutes
    runner = Runner(seed=seed, workers=workers())
    chosen = sizes or sizes_for(len(conditions), all(c.any_view.curve for c in conditions))

    def late(share: float) -> bool:
        return deadline is not None and time.monotonic() > began + share * (deadline - began)

    s = begin(conditions, runner, chosen, rng, progress)
    if minutes is not None:
        # what is planned is cut to what the time allows, now that a run's cost is known
        s.sizes = affordable(chosen, s, 60 * minutes - (time.monotonic() - began))
        if s.sizes != chosen:
            s.notes.append(f"the budget of {minutes:g} minutes allowed {s.sizes} instead of {chosen} runs a scene")
        runner.deadline = began + 0.8 * (deadline - began) if deadline else None
    if sizes is None and s.sizes == chosen:
        more = generous(chosen, s, min(ROOM, ROOM_SHARE * 60 * minutes) if minutes is not None else ROOM)
        if more != chosen:  # runs that are done are not done again
            s = begin(conditions, runner, more, rng, progress)
    finding = search_and_conclude(s, late)
    runner.deadline = deadline
    confirm(finding)
    progress("where it shows", 0.93)
    finding.spots = locate(finding)
    if finding.verdict == "no_mismatch":
        finding.spots = []
    progress("held-out data", 0.95)
    score(finding)
    progress("the next experiment", 0.97)
    propose(finding)
    outcome = outcome_of(finding, time.monotonic() - began, seed)
    progress("done", 1.0)
    return outcome


def sizes_for(conditions: int, curve: bool) -> Sizes:
    """Runs of each kind: the more recordings, the fewer packings each needs."""
    if curve:
        return Sizes(true=6, soft=6, adjustable=3, screen=2, more=1, leader=3, final=4, leaders=4, duel=6)
    if conditions <= 2:
        return Sizes()
    return Sizes(true=8, soft=6, adjustable=3, screen=1, more=2, leader=3, final=4, leaders=5, duel=8)


def generous(sizes: Sizes, s: Search, seconds: float) -> Sizes:
    """More runs of everything where runs are cheap: means of few packings blur what a refit gains.

    Told from the size of a run, not from its time: a diagnosis that was interrupted plans the same again.
    """
    more = replace(
        sizes, true=3 * sizes.true, soft=2 * sizes.soft, adjustable=2 * sizes.adjustable, screen=2 * sizes.screen,
        more=3 * sizes.more, leader=4 * sizes.leader, final=2 * sizes.final, duel=round(2.4 * sizes.duel),
    )  # fmt: skip
    steps = float(np.mean([s.runner.steps(c) for c in s.conditions]))
    return more if planned(more, s, NOMINAL * steps) <= seconds else sizes


def planned(z: Sizes, s: Search, cost: float) -> float:
    """Seconds that the runs of a search take, about; ``cost`` [s] of one."""
    count = 32 * len(s.training) * z.screen + len(s.training) * (
        z.soft * bool(s.adjust) + z.adjustable * len(s.adjust) + 6 * z.more + 2 * z.leaders * z.leader + 2 * z.duel
    )
    return cost * (0.7 * count + z.final * len(s.conditions) * 1.5)


def affordable(sizes: Sizes, s: Search, seconds: float) -> Sizes:
    """Sizes cut down to ``seconds`` that are left."""
    cost = s.runner.cost
    if cost <= 0:
        return sizes
    for smaller in (
        sizes,
        replace(sizes, more=1, leader=3, final=3, leaders=4, duel=6),
        replace(sizes, screen=1, more=1, leader=2, final=2, leaders=3, soft=4, adjustable=2, duel=4),
        replace(sizes, screen=1, more=0, leader=2, final=2, leaders=2, soft=3, adjustable=2, duel=2),
    ):
        if planned(smaller, s, cost) <= seconds:
            return smaller
    return smaller
