"""What a diagnosis of beds may spend, and what it simulates for it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..criteria import current
from .work import Work


class Clock:
    """The budget, in seconds of so many idle cores as it is meant for: how much of it is spent."""

    def __init__(self, minutes: float | None, work: Work) -> None:
        self.seconds = 60.0 * (minutes or current().windows.plan.minutes)
        self.work = work

    @property
    def spent(self) -> float:
        return self.work.seconds / current().work.cores

    def late(self, share: float) -> bool:
        return self.spent > share * self.seconds

    def has_room(self, seconds: float) -> bool:
        """Whether what takes so many seconds of a core [s] ends within the budget."""
        return self.spent + seconds / current().work.cores < self.seconds


@dataclass(frozen=True)
class Plan:
    """How much is simulated: members of a window, of a signature; replicates; windows of a recording; leaders."""

    members: int
    screening: int
    replicates: int
    windows: int
    leaders: int

    @classmethod
    def usual(cls, replicates: int) -> Plan:
        """Where there is time for all."""
        plan = current().windows.plan
        return cls(plan.members, plan.screening, replicates, plan.most, plan.leaders)


def make_plan(
    cost: float, windows: int, training: int, terms: int, seconds: float, replicates: int, whole: float = 1.0
) -> Plan:
    """The best plan that should be done in ``seconds``; ``cost`` [s] of one member of one window on all cores.

    Every step is counted, though few recordings ask for all of them.

    ``whole``: how many times the bodies of a window the whole bed has, of which replicates are simulated.
    What is given up first: see ``WindowPlanCriteria.fewer``.
    """
    criteria, full = current().windows.plan, Plan.usual(replicates)
    fewer = [Plan(*numbers) for numbers in criteria.fewer]
    plans = [full, replace(full, windows=criteria.usual), *(p for p in fewer if p.replicates <= replicates)]
    for plan in plans:
        part = min(1.0, plan.windows / max(windows, 1))
        every, used = windows * part, max(training * part, 1.0)
        film = plan.replicates * every * (plan.members + criteria.film * whole)
        runs = criteria.fits * used * plan.members + film
        runs += terms * used * plan.screening * criteria.signature + 2 * plan.leaders * 3 * used * plan.screening
        runs += plan.replicates * used * plan.screening * criteria.replicate * current().windows.search.leaning
        runs += (
            (plan.leaders - 2) * 4 * used * plan.members
            + 3 * every * plan.members
            + criteria.polish * film
        )
        if runs * cost < seconds:
            return plan
    return plans[-1]
