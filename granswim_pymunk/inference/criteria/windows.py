"""What decides where a bed is followed in windows: their starts, replicates, the search and its verdict."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class WindowPlanCriteria:
    """How a film is cut into windows, and how much is simulated where time allows.

    length [s] : of a window. Source: benchmarks/bed_power.py; a difference in the last bit grows tenfold a millisecond,
        and what a steady force shows grows with the square of the time
    frames : of a film, the fewest;  windows : of a recording, the fewest;  ``most``: a second of film. Choice
    coarse : times the advised step, four steps in the shortest contact. Source: windows start from states with errors
        of their own, and replicates are as coarse; restitution shifts by less than 0.01 (benchmarks/cut_out.py)
    members : of a window;  screening : of a signature;  replicates : films of the recalibrated scene
    leaders : laws that are refitted;  fewer : (members, screening, replicates, windows, leaders), tried one after the
        other where time is short. Choice: what is given up first are members, then windows, replicates, leaders
    usual : windows of a recording, from which no want of time is told;  minutes : where no budget is given
    fits : predictions of a window that the last fits take;  film : times the bodies of a whole bed, what a replicate of
        one costs;  signature : predictions of a candidate's columns;  replicate : of a leader's, in replicates
    polish : films of replicates that are made anew with the law, in those of the first. Measured
    """

    length: float = 0.016
    frames: int = 12
    windows: int = 5
    most: int = 45
    coarse: float = 3.5
    members: int = 3
    screening: int = 2
    replicates: int = 8
    leaders: int = 7
    fewer: tuple[tuple[int, int, int, int, int], ...] = (
        (3, 2, 6, 26, 7), (2, 2, 6, 26, 7), (2, 1, 6, 26, 5), (2, 1, 6, 16, 5), (2, 1, 5, 12, 4), (2, 1, 4, 9, 4),
        (2, 1, 4, 7, 3), (1, 1, 4, 6, 3),
    )  # fmt: skip
    usual: int = 26
    minutes: float = 10.0
    fits: int = 13
    film: float = 1.4
    signature: float = 2.6
    replicate: float = 2.5
    polish: float = 0.6


@dataclass(frozen=True)
class BedBudgetCriteria:
    """Shares of the budget, after which steps are left out or cut short. Choices.

    replicates : leaders are held against what these give them;  siblings : other forms of the leaders
    signatures : candidates;  told : bias by replicates, of the last fit;  rough : leaders refitted in few windows
    second : a second law is looked for, ``seconds``: laws that are tried there;  fine : leaders refitted in all windows
    first : the last fit of the first law, and ``both``: of two;  nameless : forces without a name are begun
    forms : of them that are tried;  turned : further steps of them, and ``beside``: forms held against names
    proposal : the next experiment;  rivals : their shares and their gains on held-out data
    """

    replicates: float = 0.6
    siblings: float = 0.7
    told: float = 0.7
    signatures: float = 0.72
    rough: float = 0.78
    second: float = 0.8
    seconds: float = 0.82
    fine: float = 0.84
    first: float = 0.85
    both: float = 0.87
    nameless: float = 0.86
    forms: float = 0.9
    turned: float = 0.92
    beside: float = 0.92
    proposal: float = 0.93
    rivals: float = 0.95


@dataclass(frozen=True)
class CutCriteria:
    """What of a bed is simulated in windows.

    reach [m] : from the centre of a disk, within which grains are simulated: five of the largest diameters. Source:
        benchmarks/cut_out.py
    gap [m] : between surfaces: a grain this near to one that is simulated is part of the wall
    worth : of the bodies: a cut that leaves more than that saves nothing
    """

    reach: float = 0.010
    gap: float = 1.0e-3
    worth: float = 0.7


@dataclass(frozen=True)
class SumCriteria:
    """How the grains of a window are added up.

    near [m] : between the surfaces of a grain and the swimmer: two diameters
    grains : that make a moment;  about : that make a mean about one disk
    sure : standard deviations of a sighting: a displacement is not known better than that
    moving : standard errors of a speed, beyond which a grain moves
    """

    near: float = 3.0e-3
    grains: int = 3
    about: int = 2
    sure: float = 2.0
    moving: float = 3.0


@dataclass(frozen=True)
class StartCriteria:
    """How the state at the start of a window is told.

    half : frames on either side. Source: more smooth the velocities, fewer leave them twice as wide
    widest : frames on either side, where a body is missing in some
    sightings : that tell a place, a velocity and a curvature with one to spare;  ``scanty`` where no more frames help
    clear [m] : overlaps and joint lengths are put right to below this. Theory: the overlap of a contact at 1 mN
    rounds : in which overlaps and joint lengths are put right
    room [m] : pairs nearer than this are watched while overlaps are taken out
    lost [m, m/s] : how unsure place and velocity are of a body that is hardly seen at all
    kept : of cameras and radii, for how many the starts are kept. Choice: a step of least squares asks for six
    """

    half: int = 2
    widest: int = 6
    sightings: int = 4
    scanty: int = 3
    clear: float = 5.0e-7
    rounds: int = 400
    room: float = 4.0e-4
    lost: tuple[float, float] = (1e-4, 1e-2)
    kept: int = 8


@dataclass(frozen=True)
class StampCriteria:
    """How the noise of sightings, and uneven moments of frames, are told.

    fine : of a frame's time, lateness below which stamps count as even, unless it is said that they are not. Choice:
        what a swimmer does meanwhile is below what a sighting shows
    late : of a frame's time, the most that a frame is late by. Theory: half of it would change their order
    far : standard deviations of a residual, beyond which a sighting is a bad one
    frames : that tell it, the fewest;  number : of the draw of a film with even frames
    slowest : of the bodies, those that tell the noise
    refuted : times what is said of the noise, beyond which, and below one over that, what is seen counts. Source: in
        seven films of the proof the noise that is seen is 1.03 to 1.13 times the true one
    """

    fine: float = 0.015
    late: float = 0.4
    far: float = 6.0
    frames: int = 20
    number: int = 91
    slowest: float = 0.1
    refuted: float = 1.3


@dataclass(frozen=True)
class HiddenCriteria:
    """Grains that a film does not show, told from voids among those that it shows.

    neighbours : bodies about a void, of which three touch its circle
    carriers : bodies with which a void goes from frame to frame
    beginnings : frames from which voids are followed
    open : of the frames, in which the circle is as large as the smallest grain. Choice
    farthest : mean radii that its centre may move against the bodies about it from frame to frame. Choice
    stride [s] : between the frames at which voids are followed; between them their centres go straight
    strained : least radii, how far bodies about a void move against it where it would have closed. Choice
    size : quantile of the circle's radius over time that the grain has: it is never larger than its cage
    first : of the smallest and of the largest radius, between which circles are followed;  room : of the smallest,
        what is found about one;  alike : of the smallest, within which two are one. Choice
    sure : standard deviations of a radius and of a sighting, by which a grain may be smaller or larger
    rounding [m] : by which a circle may overlap what it touches
    edge : radii of the largest body, within which those beyond a periodic edge are looked at. Choice
    """

    neighbours: int = 9
    carriers: int = 5
    beginnings: int = 9
    open: float = 0.95
    farthest: float = 0.5
    stride: float = 2e-3
    strained: float = 1.0
    size: float = 0.1
    first: tuple[float, float] = (0.8, 1.5)
    room: float = 0.9
    alike: float = 0.2
    sure: float = 2.0
    rounding: float = 1e-7
    edge: float = 8.0


@dataclass(frozen=True)
class BedCandidateCriteria:
    """How large candidates are tried in a bed.

    speed [m/s] : of the grains that move;  acceleration [m/s^2] : that shows after a window
    least_scale : of a picture: less may be what a force does that squeezes or stretches the links. Choice
    coarse_scale : standard error above which links say too little;  sights : of a link, the fewest
    scale_sure : standard errors from which links are nearer, or farther, than they are long. Choice: by chance once in
        two million
    apparatus : faults that are tried, and the amount [1, rad, s] of each. Choice: a smaller shift drowns in chaos
    fast [m/s] : over which a drag by the speed is drawn where no speed is known;  fastest : quantile of the speeds else
    """

    speed: float = 0.05
    acceleration: float = 0.5
    least_scale: float = 3e-3
    coarse_scale: float = 2e-3
    sights: int = 10
    scale_sure: float = 5.0
    apparatus: tuple[tuple[str, float], ...] = (("camera_scale", 2e-3), ("camera_tilt", 3e-3), ("time_offset", 4e-3))
    fast: float = 0.1
    fastest: float = 0.99


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
    surviving : share that recalibration leaves of a signature, below which it imitates the law. Choice
    """

    finest: float = 1e-8
    unknown: float = 1.0
    windows: int = 8
    several: int = 6
    shrunk: float = 0.5
    scanty: int = 60
    alike: int = 21
    replicates: int = 499
    surviving: float = 0.05


@dataclass(frozen=True)
class BedSearchCriteria:
    """Which laws are simulated, and which of them stands.

    response : rms of the change that a signature is made of, in standard deviations, least and most. Source: well above
        the 0.2 to 0.4 that chaos adds whatever the amount (columns of a force across the motion at 0.4 were mostly
        chaos, and had a tenth of the gain), yet near linear (three times as far as need be, they had a tenth, too)
    tries_amount : amounts of a signature that are tried;  inside : of the way to a bound, how far;  failed : of the
        amount, tried where the run did not survive it;  weaker : of ``response``, below which the amount is made
        larger by the second factor of ``grow``, else by the first;  stronger : the same above it, of ``shrink``
    as_tried : of the amount, a change that is none;  back : of it, the least on the other side of neutral. Choices
    rough : of the amounts so far, simulated when a leader is refitted;  fine : the same once more, in all windows;
        form : of a form without a name;  turned : after a step of least squares;  nearer : of the least, one more
        where that is best;  farther : of the largest, the same
    shy : of the smallest amount that a run did not survive, how far one goes again
    undercut : of the gain, by which a parabola may be below all of its points. Choice
    led : of the best first-order gain, from which a law is refitted;  kept : of the best gain in few windows, from
        which it is refitted in all;  beside : of what nulls gain, from which a law is tried beside another. Choice
    open : p of the search up to which leaders are refitted. Choice
    about : of the best amount, between which points tell the parabola through its chi2. Choice
    seconds : laws that are tried beside the one that was found
    leaning : leaders that are held against what replicates give them;  ``more`` where others come to lead, ``most`` in
    all one_window : share of a gain that one window of several may bring where a law is named. Choice
    sure : chi2 that a law must gain, besides being beyond the nulls. Theory: five standard errors;  ahead : times what
        named laws gain, that a form without a name must. Choice
    moved : standard errors, as chaos widens them, from which an adjustable is said to be off. Choice
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
    tries_amount: int = 3
    inside: float = 0.8
    failed: float = 0.15
    weaker: float = 0.3
    grow: tuple[float, float] = (3.0, 8.0)
    stronger: float = 3.0
    shrink: tuple[float, float] = (0.5, 0.25)
    as_tried: float = 0.1
    back: float = 0.5
    rough: tuple[float, ...] = (0.7, 1.5, 3.0)
    fine: tuple[float, ...] = (0.8, 1.0, 1.25)
    form: tuple[float, ...] = (0.6, 1.0, 1.6)
    turned: tuple[float, ...] = (0.6, 1.0, 1.4)
    nearer: float = 0.4
    farther: float = 1.7
    shy: float = 0.9
    undercut: float = 0.1
    led: float = 0.12
    kept: float = 0.3
    beside: float = 0.5
    open: float = 0.1
    about: tuple[float, float] = (0.35, 2.2)
    seconds: int = 6
    leaning: int = 4
    more: int = 2
    most: int = 8
    one_window: float = 0.5
    sure: float = 25.0
    ahead: float = 1.15
    moved: float = 4.0
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
class PolishCriteria:
    """The last fit, of adjustables and laws together, with the bias of replicates that have the laws. Choices.

    step : of an adjustable's range, by which derivatives step: chaos forgives no smaller one;  amount : of a law's
        number, the same, where that is more than ``nought`` of its scale;  ``absent``: of its scale, elsewhere
    reach : of its range, how far an adjustable moves to first order once a law is there
    most : half steps of the derivatives, beyond which no step is taken;  still : of them, below which the fit ends
    rounds : of Gauss-Newton
    tripled : times a step that least squares gives, to which a bias that grows with the law may enlarge it
    """

    step: float = 0.1
    amount: float = 0.4
    nought: float = 0.1
    absent: float = 0.3
    reach: float = 0.15
    most: float = 1.5
    still: float = 0.15
    rounds: int = 3
    tripled: float = 3.0


@dataclass(frozen=True)
class BedPlaceCriteria:
    """Where a mismatch of a bed is told to be, and what the next film is asked for.

    level : probability of chance below which a place is told, after looking at all
    replicates : the fewest whose own first places tell what all looks make of chance. Choice: Student's t is then
        1.6 times as wide as the normal at one in a hundred, and of three twice
    bins : of the cycle
    farthest : standard deviations: how far a sum of grains strays beyond that hangs on a single violent one
    members : of the windows that the map is made of
    settle [s] : a film under a new drive is not looked at before;  enough : d' that is asked of the next recording
    whole_film : of ``VerdictCriteria.alarm``, the p below which a film as a whole is unlike its replicates. Choice
    drives : times the frequency, that are tried for the next film;  windows : of it, that are predicted;  longest :
        times the film, that is asked for at most. Choices
    """

    level: float = 0.01
    replicates: int = 5
    bins: int = 8
    farthest: float = 5.0
    members: int = 6
    settle: float = 0.02
    enough: float = 3.0
    whole_film: float = 0.1
    drives: tuple[float, ...] = (1.5, 0.6)
    windows: int = 10
    longest: int = 10


@dataclass(frozen=True)
class WindowCriteria:
    """All that decides where a bed is followed in windows, step by step.

    plan : windows, and how much is simulated;  budget : when steps are left out;  cut : what of the bed
    sums : of grains;  starts : of windows;  stamps : of frames;  hidden : grains
    candidates : how large they are tried
    signatures : and spreads;  search : which law stands;  polish : its last fit
    places : where the mismatch is, and the next film
    """

    plan: WindowPlanCriteria = field(default_factory=WindowPlanCriteria)
    budget: BedBudgetCriteria = field(default_factory=BedBudgetCriteria)
    cut: CutCriteria = field(default_factory=CutCriteria)
    sums: SumCriteria = field(default_factory=SumCriteria)
    starts: StartCriteria = field(default_factory=StartCriteria)
    stamps: StampCriteria = field(default_factory=StampCriteria)
    hidden: HiddenCriteria = field(default_factory=HiddenCriteria)
    candidates: BedCandidateCriteria = field(default_factory=BedCandidateCriteria)
    signatures: BedSignatureCriteria = field(default_factory=BedSignatureCriteria)
    search: BedSearchCriteria = field(default_factory=BedSearchCriteria)
    polish: PolishCriteria = field(default_factory=PolishCriteria)
    places: BedPlaceCriteria = field(default_factory=BedPlaceCriteria)
