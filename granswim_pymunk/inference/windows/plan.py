"""What a diagnosis of beds may spend, and what it simulates for it."""

from __future__ import annotations

from dataclasses import dataclass

from ..criteria import current
from .windows import MEMBERS, MOST_WINDOWS
from .work import CORES, Work

REPLICATES = 8
LEADERS = 7
MINUTES = 10.0  # where no budget is given


class Clock:
    """The budget, in seconds of ``CORES`` idle cores: how much of it is spent."""

    def __init__(self, minutes: float | None, work: Work) -> None:
        self.seconds = 60.0 * (minutes or MINUTES)
        self.work = work

    @property
    def spent(self) -> float:
        return self.work.seconds / CORES

    def late(self, share: float) -> bool:
        return self.spent > share * self.seconds


@dataclass(frozen=True)
class Plan:
    """How much is simulated: members of a window, of a signature; replicates; windows of a recording; leaders."""

    members: int
    screening: int
    replicates: int
    windows: int
    leaders: int


def make_plan(
    cost: float, windows: int, training: int, terms: int, seconds: float, replicates: int, whole: float = 1.0
) -> Plan:
    """The best plan that should be done in ``seconds``; ``cost`` [s] of one member of one window on ``CORES``.

    Every step is counted, though few recordings ask for all of them.

    ``whole``: how many times the bodies of a window the whole bed has, of which replicates are simulated.

    What is given up first: the fourth and third member, then windows, then replicates, then leaders.
    """
    plans = [
        Plan(m, s, n, w, k)
        for m, s, n, w, k in (
            (MEMBERS, 2, replicates, MOST_WINDOWS, LEADERS), (MEMBERS, 2, replicates, 26, LEADERS), (MEMBERS, 2, 6,
            26, LEADERS),
            (2, 2, 6, 26, LEADERS), (2, 1, 6, 26, 5), (2, 1, 6, 16, 5), (2, 1, 5, 12, 4),
            (2, 1, 4, 9, 4), (2, 1, 4, 7, 3), (1, 1, 4, 6, 3),
        )
        if n <= replicates
    ] or [Plan(2, 1, replicates, 26, 5)]  # fmt: skip
    for plan in plans:
        part = min(1.0, plan.windows / max(windows, 1))
        every, used = windows * part, max(training * part, 1.0)
        runs = 13 * used * plan.members + plan.replicates * every * (plan.members + 1.4 * whole)
        runs += terms * used * plan.screening * 2.6 + 2 * plan.leaders * 3 * used * plan.screening
        runs += plan.replicates * used * plan.screening * 2.5 * current().windows.search.leaning
        runs += (
            (plan.leaders - 2) * 4 * used * plan.members
            + 3 * every * plan.members
            + 0.6 * plan.replicates * every * (plan.members + 1.4 * whole)
        )
        if runs * cost < seconds:
            return plan
    return plans[-1]
