"""Everything that decides: each number with its meaning and where it comes from (theory, a table, a choice)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from .arithmetic import RoundingCriteria
from .beds import RadiiCriteria
from .general import (
    ApparatusCriteria,
    BlockCriteria,
    FilledCriteria,
    LinkingCriteria,
    LostCriteria,
    NoiseCriteria,
    ReleaseCriteria,
    SmoothedCriteria,
    SplitCriteria,
    StampCriteria,
    VerdictCriteria,
    WorkCriteria,
)
from .packings import PackingCriteria
from .tracks import (
    BudgetCriteria,
    CandidateCriteria,
    EvaluationCriteria,
    FitCriteria,
    IntervalCriteria,
    KickCriteria,
    LeftCriteria,
    RefitCriteria,
    SegmentCriteria,
    SetCriteria,
    SignatureCriteria,
    TouchCriteria,
)
from .windows import WindowCriteria


@dataclass(frozen=True)
class Criteria:
    """All of them; ``diagnose(..., criteria=...)`` overrides.

    >>> from dataclasses import replace
    >>> strict = Criteria(verdict=replace(DEFAULT.verdict, share=0.8))
    >>> with using(strict):
    ...     current().verdict.share
    0.8
    """

    noise: NoiseCriteria = field(default_factory=NoiseCriteria)
    rounding: RoundingCriteria = field(default_factory=RoundingCriteria)
    work: WorkCriteria = field(default_factory=WorkCriteria)
    apparatus: ApparatusCriteria = field(default_factory=ApparatusCriteria)
    stamps: StampCriteria = field(default_factory=StampCriteria)
    linking: LinkingCriteria = field(default_factory=LinkingCriteria)
    lost: LostCriteria = field(default_factory=LostCriteria)
    filled: FilledCriteria = field(default_factory=FilledCriteria)
    smoothed: SmoothedCriteria = field(default_factory=SmoothedCriteria)
    release: ReleaseCriteria = field(default_factory=ReleaseCriteria)
    split: SplitCriteria = field(default_factory=SplitCriteria)
    blocks: BlockCriteria = field(default_factory=BlockCriteria)
    verdict: VerdictCriteria = field(default_factory=VerdictCriteria)
    candidates: CandidateCriteria = field(default_factory=CandidateCriteria)
    kicks: KickCriteria = field(default_factory=KickCriteria)
    touches: TouchCriteria = field(default_factory=TouchCriteria)
    segments: SegmentCriteria = field(default_factory=SegmentCriteria)
    fits: FitCriteria = field(default_factory=FitCriteria)
    signatures: SignatureCriteria = field(default_factory=SignatureCriteria)
    refits: RefitCriteria = field(default_factory=RefitCriteria)
    evaluations: EvaluationCriteria = field(default_factory=EvaluationCriteria)
    sets: SetCriteria = field(default_factory=SetCriteria)
    intervals: IntervalCriteria = field(default_factory=IntervalCriteria)
    left: LeftCriteria = field(default_factory=LeftCriteria)
    budget: BudgetCriteria = field(default_factory=BudgetCriteria)
    radii: RadiiCriteria = field(default_factory=RadiiCriteria)
    windows: WindowCriteria = field(default_factory=WindowCriteria)
    packings: PackingCriteria = field(default_factory=PackingCriteria)


DEFAULT = Criteria()
_CURRENT: ContextVar[Criteria] = ContextVar("criteria", default=DEFAULT)


def current() -> Criteria:
    """What decides in the diagnosis that is under way."""
    return _CURRENT.get()


@contextmanager
def using(criteria: Criteria | None) -> Iterator[None]:
    """Let these criteria decide in all that is called inside; None: as it is."""
    if criteria is None:
        yield
        return
    token = _CURRENT.set(criteria)
    try:
        yield
    finally:
        _CURRENT.reset(token)
