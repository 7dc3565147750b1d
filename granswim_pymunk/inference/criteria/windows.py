"""What decides where a bed is followed in windows: their starts, replicates, the search and its verdict."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class StartCriteria:
    """How the state at the start of a window is told.

    widest : frames on either side, where a body is missing in some
    rounds : in which overlaps and joint lengths are put right
    room [m] : pairs nearer than this are watched while overlaps are taken out
    smoother : of the squares that a smooth motion leaves: what is better than that belongs together. Choice
    """

    widest: int = 6
    rounds: int = 400
    room: float = 4.0e-4
    smoother: float = 0.2


@dataclass(frozen=True)
class HiddenCriteria:
    """Grains that a film does not show, told from voids among those that it shows.

    carriers : bodies with which a void goes from frame to frame
    beginnings : frames from which voids are followed
    open : of the frames, in which the circle is as large as the smallest grain. Choice
    farthest : mean radii that its centre may move against the bodies about it from frame to frame. Choice
    stride [s] : between the frames at which voids are followed; between them their centres go straight
    strained : least radii, how far bodies about a void move against it where it would have closed. Choice
    size : quantile of the circle's radius over time that the grain has: it is never larger than its cage
    """

    carriers: int = 5
    beginnings: int = 9
    open: float = 0.95
    farthest: float = 0.5
    stride: float = 2e-3
    strained: float = 1.0
    size: float = 0.1


@dataclass(frozen=True)
class BedCandidateCriteria:
    """How large candidates are tried in a bed.

    speed [m/s] : of the grains that move;  acceleration [m/s^2] : that shows after a window
    least_scale : of a picture: less may be what a force does that squeezes or stretches the links. Choice
    coarse_scale : standard error above which links say too little;  sights : of a link, the fewest
    """

    speed: float = 0.05
    acceleration: float = 0.5
    least_scale: float = 3e-3
    coarse_scale: float = 2e-3
    sights: int = 10


@dataclass(frozen=True)
class BedSignatureCriteria:
    """Spread of innovations, told by replicates of the recalibrated scene.

    finest [m] : a spread below this is not believed;  unknown [m] : that nobody knows
    windows : of replicates, the fewest that tell a spread;  several : windows, of which one may be left out
    shrunk : of the covariance, towards its diagonal. Source: with a tenth, laws show 1.1 to 1.25 times more weakly
        (benchmarks/bed_numbers.py)
    scanty : windows of replicates, less one of each, below which they tell one direction and not the covariance
    alike : degrees of freedom that the middle of all leaders is worth for the spread of one. Choice
    replicates : of the noise of windows, recombined
    """

    finest: float = 1e-8
    unknown: float = 1.0
    windows: int = 8
    several: int = 6
    shrunk: float = 0.5
    scanty: int = 60
    alike: int = 21
    replicates: int = 499


@dataclass(frozen=True)
class BedSearchCriteria:
    """Which laws are simulated, and which of them stands.

    response : rms of the change that a signature is made of, in standard deviations, least and most. Source: well above
        the 0.2 to 0.4 that chaos adds whatever the amount (columns of a force across the motion at 0.4 were mostly
        chaos, and had a tenth of the gain), yet near linear (three times as far as need be, they had a tenth, too)
    rough : of the amounts so far, simulated when a leader is refitted;  fine : the same once more, in all windows
    seconds : laws that are tried beside the one that was found
    leaning : leaders that are held against what replicates give them;  ``more`` where others come to lead, ``most`` in
    all one_window : share of a gain that one window of several may bring where a law is named. Choice
    sure : chi2 that a law must gain, besides being beyond the nulls. Theory: five standard errors
    clearly : standard errors, as few replicates and windows widen them, that the last fit has to be from none
    further : by which every further number moves the tail of chi2. Theory: about one in a thousand
    chaos : chi2 by which the gain of the same law differs when it is simulated again. Source: the bed's own chaos
    clear_gain : chi2 that tells candidates apart; windows beyond those that hold so much are for later. Choice
    doubtful : chi2 below which the leaders' gains are held against what replicates give them. Choice
    tries : laws that are fitted to the end, one after the other, until one stands
    gauge : windows that show whether the scene can be run
    unexplained : standard deviations of the nulls' chi2 that are left before forms without a name are tried. Choice
    pace : least spread of the logarithm of the pace of replicates: few of them know it badly
    forms : forces without a name that are held against names, besides the best
    rivals : of which held-out windows are predicted
    """

    response: tuple[float, float] = (0.8, 2.5)
    rough: tuple[float, ...] = (0.7, 1.5, 3.0)
    fine: tuple[float, ...] = (0.8, 1.0, 1.25)
    seconds: int = 6
    leaning: int = 4
    more: int = 2
    most: int = 8
    one_window: float = 0.5
    sure: float = 25.0
    clearly: float = 3.0
    further: float = 3.0
    chaos: float = 16.0
    clear_gain: float = 400.0
    doubtful: float = 400.0
    tries: int = 3
    gauge: int = 4
    unexplained: float = 5.0
    pace: float = 0.05
    forms: int = 2
    rivals: int = 3


@dataclass(frozen=True)
class BedPlaceCriteria:
    """Where a mismatch of a bed is told to be, and what the next film is asked for.

    level : probability of chance below which a place is told, after looking at all
    bins : of the cycle
    farthest : standard deviations: how far a sum of grains strays beyond that hangs on a single violent one
    members : of the windows that the map is made of
    settle [s] : a film under a new drive is not looked at before;  enough : d' that is asked of the next recording
    """

    level: float = 0.01
    bins: int = 8
    farthest: float = 5.0
    members: int = 6
    settle: float = 0.02
    enough: float = 3.0


@dataclass(frozen=True)
class WindowCriteria:
    """All that decides where a bed is followed in windows, step by step.

    starts : of windows;  hidden : grains;  candidates : how large they are tried;  signatures : and spreads
    search : which law stands;  places : where the mismatch is, and the next film
    """

    starts: StartCriteria = field(default_factory=StartCriteria)
    hidden: HiddenCriteria = field(default_factory=HiddenCriteria)
    candidates: BedCandidateCriteria = field(default_factory=BedCandidateCriteria)
    signatures: BedSignatureCriteria = field(default_factory=BedSignatureCriteria)
    search: BedSearchCriteria = field(default_factory=BedSearchCriteria)
    places: BedPlaceCriteria = field(default_factory=BedPlaceCriteria)
