"""Everything that decides: each number with its meaning and where it comes from (theory, a table, a choice)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field


@dataclass(frozen=True)
class NoiseCriteria:
    """What passes for noise.

    slow_most : of the white part, how large the slow part of the noise may be (contract: no larger)
    memory_most : frames, over how many the slow part may be correlated (contract: 30)
    alarm : probability of noise below which what is left is said to be more than noise. Choice: one in 200
    stated_off : ln of stated over estimated noise from which the estimate is believed. Choice: the estimate of 100
        frames is good to a tenth, and laboratories state sizes that are off by two
    outlier : standard deviations, from both sides, from which a single sighting is no position. Theory: of 1e5
        sightings of Gaussian noise 2e-4 are farther off than 6
    outlier_frames : frames on each side that an outlier is held against
    share_most : of a channel's sightings that may be taken out; beyond it they are no single ones. Choice
    """

    slow_most: float = 1.0
    memory_most: float = 30.0
    alarm: float = 0.005
    stated_off: float = 0.25
    outlier: float = 6.0
    outlier_frames: int = 4
    share_most: float = 0.05


@dataclass(frozen=True)
class SegmentCriteria:
    """Where tracks are cut, and how closely their segments join.

    near : of the sum of two radii, a gap below which they may have met. Choice: radii are known to a few per cent
    around : frames on either side from which a change of velocity is told, doubled so many times as ``wider`` says: a
        glancing impact shows over a long time;  kick : its standard deviations
    frames : the least of a segment
    narrow : spread of a step where nothing met, of what the first nine frames tell of the start. Choice: a fiftieth
        is, beside what a segment as a whole tells, no freedom
    impulse : of the change of velocity in an impact, what a rigid collision may be off by. Choice: a per cent, as
        radii that are off by half a per cent turn the line of centres by as much
    lateness : s, of an impact: it lasts. Source: discs of plastic or steel touch for 0.05 to 0.2 ms
        (Goldsmith 1960, Impact)
    depth : of the sum of two radii, how well it is known. Choice: half a per cent. How deep a glancing impact strikes,
        and with it the whole kick, hangs on that and on the noise: so much wider is the step after one
    bend : of the answer to a small error of the start, how much of it may be curved: beyond, linear steps do not find
        the start, which is where chaos begins to show. Choice
    ahead : frames over which a start is followed without asking, and looked ahead where there are more
    robust : standard deviations of a step beyond which it counts in proportion (Huber 1964, Ann. Math. Stat. 35, 73):
        a run that misses a glancing impact is no evidence of that size
    """

    near: float = 0.03
    around: int = 6
    wider: int = 2
    kick: float = 6.0
    frames: int = 4
    narrow: float = 0.02
    impulse: float = 0.01
    lateness: float = 1e-4
    depth: float = 0.005
    bend: float = 0.25
    ahead: int = 1000
    robust: float = 4.0


@dataclass(frozen=True)
class BlockCriteria:
    """How unseen data inside the training part are scored.

    recordings : so many training recordings, and whole recordings are the blocks (contract: 3)
    pieces : blocks that the training part of fewer recordings is cut into, altogether. Theory: chi2 of a steady force
        grows like the fifth power of the time over which one start is followed, so that k blocks show 1/k^4 of what the
        whole shows: two, the least that leaves data outside
    windows : that held-out frames are cut into where a run from one start would part from the recording
    units : so many stretches, of all blocks together and for each body, are resampled. Choice: of fewer, one that is
        drawn again and again makes the interval
    frames : the least of a block. Choice: a start takes some six
    start : share of a block's frames on which its start is fitted. Choice; for whole recordings that of the contract
    start_frames : the least of them;  unit_frames : of a stretch
    evaluations : of the fit of a start
    draws : replicates of the noise for the floor;  bootstrap : resamples for intervals
    """

    recordings: int = 3
    pieces: int = 2
    windows: int = 4
    units: int = 12
    unit_frames: int = 6
    frames: int = 24
    start: float = 0.35
    whole_start: float = 0.2
    start_frames: int = 6
    evaluations: int = 8
    draws: int = 60
    bootstrap: int = 2000


@dataclass(frozen=True)
class VerdictCriteria:
    """When a law is named (contract 2, "The verdict").

    alarm : probability of a false alarm below which a mismatch is real
    share : of the mismatch that named laws explain at least;  share_alone : where no free form was possible
    free_form : a free form that leaves less than this part of what the names leave is the better explanation;
        ``free_form_high`` where the names explain ``high`` or more
    beyond : spreads of the difference between replicates from which a share can be said
    scale_off : a scale of the picture that is off by more is no explanation
    decides : d' from which an experiment is worth doing. Theory: below 2 chance decides one time in six
    same : two laws whose chi2 differ by less cannot be told apart. Theory: the square of a d' of 2
    """

    alarm: float = 0.01
    share: float = 0.5
    share_alone: float = 0.7
    high: float = 0.9
    free_form: float = 0.5
    free_form_high: float = 0.1
    beyond: float = 2.0
    scale_off: float = 0.3
    decides: float = 2.0
    same: float = 4.0


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
    segments: SegmentCriteria = field(default_factory=SegmentCriteria)
    blocks: BlockCriteria = field(default_factory=BlockCriteria)
    verdict: VerdictCriteria = field(default_factory=VerdictCriteria)


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
