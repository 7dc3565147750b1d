"""What decides where whole tracks are followed: candidates, segments, fits, the search of one to three laws."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class CandidateCriteria:
    """Which candidates there are.

    radius [m] : of the bodies that typical ranges of laws are declared for
    places : sightings from which the middle of a picture is told. Choice
    farthest : of the extent of all tracks, how far from their mean the middle of a lens, or the point that a spring
        draws to, is looked for. Choice
    believed : standard deviations of a believed mass or radius, to which it is looked for;  unstated : such a standard
        deviation, relative, where nothing is said. Choice: a per cent, as a ruler on a film or the maker of a batch
        tells, and what laboratories are off by is one to three
    shows : change of chi2 by one stated standard deviation of a mass or radius, above which it is a number of every
        fit. One is what a number gains by chance: the mean of chi2 with one degree of freedom
    single : bodies, up to which a push on each single one is a candidate, and recordings, up to which a fault of
        the camera in each. Choice: it is looked for as many times
    step : of its typical size, by which a number first steps;  adjustable : of its range, one that is declared
    ranges : times the typical range of a law, from which it is looked for, ``shapes`` of another shape. Choice
    settles : of the longest training part, the time after a step of its command when a motor is at rest again;
        ``settled`` : of where it ends, within which it is, told off its answer at ``drawn`` times to a step within
        ``at_once`` of them. Choices; 0.05 is usual for settling (Franklin, Powell & Emami-Naeini, ch. 3)
    top : times the fastest that bodies moved, over which a drag by the speed is drawn;  fastest : quantile of the steps
        that says how fast. Choice: a hundredth of them may be wrong
    loss : of what contacts lose, and ``kept`` at the least, by which a restitution first steps
    layer : sightings within a layer along walls, the fewest, that show more of it than an impact does, and outside of
        it, that show more than a drag everywhere does. Choice
    amplitude : of the drive's amplitude, by which a number within it first steps
    """

    radius: float = 1e-3
    places: int = 20
    farthest: float = 3.0
    believed: float = 6.0
    unstated: float = 0.01
    shows: float = 1.0
    single: int = 6
    step: float = 0.1
    layer: int = 4
    adjustable: float = 1e-3
    ranges: tuple[float, ...] = (1.0, 0.1, 3.0)
    shapes: tuple[float, ...] = (1.0, 0.3, 3.0)
    settles: float = 0.25
    settled: float = 0.05
    drawn: int = 400
    at_once: float = 1e-9
    top: float = 1.2
    fastest: float = 0.98
    loss: float = 0.01
    kept: float = 0.1
    amplitude: float = 0.15


@dataclass(frozen=True)
class KickCriteria:
    """When a velocity changes at once without anything to strike.

    half : frames on either side in which it is looked for. Choice
    sure : of chi2, by which a parabola with one step of its velocity has to be ahead of a cubic. Theory: chance gives
        as much to the two numbers of a step once in 7e10;  times : what the cubic leaves beyond noise over what
        a step leaves beyond it
    turns : of chi2, by which it has to be ahead of a polynomial of fifth degree, too. Source: Kass & Raftery 1995,
        beyond which evidence is very strong
    most : of chi2 over its degrees of freedom, that the parabola with a step may leave. Choice: laboratories state
        noise that is off by two;  gap : of the usual time of so many frames, that those with lost ones among them may
        take
    smooth : degree of the polynomials that follow what does not step;  turning : of those that follow sharp turns
    rounds : of seven times, in which that of a step is sought: to a sixtieth of a frame. Choice
    few : sightings on either side of one, the least where a film has few. Theory: a line leaves two of them free
    clear : radii of a body, beyond which what it may meet does not act on it as in a contact. Choice
    whip : of the frames in which it is looked for, how many times their time an arm of a linkage of length l has to
        take for sqrt(l/g). Theory: with all energy of two arms that fell, the lower one turns at 3 sqrt(g/l)
    """

    half: int = 6
    sure: float = 50.0
    times: float = 4.0
    turns: float = 10.0
    most: float = 4.0
    gap: float = 1.5
    smooth: int = 3
    turning: int = 5
    rounds: int = 4
    few: int = 4
    clear: float = 2.0
    whip: float = 3.0


@dataclass(frozen=True)
class TouchCriteria:
    """When bodies turn away from each other at another distance than their radii make.

    near : of the sum of the radii, a gap below which bodies may have met. Choice: nobody guesses a radius worse
    sharp : noise that the step of a velocity makes in one frame;  along : of it, that goes along the line of centres.
        Choices: friction is a part of the impulse, and what turns two bodies over several frames is no impact
    late : variances of noise that the time of a step has, over its size squared. Theory: of parabolas through six
        frames on either side
    agree : chi2 of each impact about their mean, at most;  sure : standard errors of the mean;  share : of the sum of
        the radii. Choices: a ruler tells a hundredth
    deep : of the sum of the radii, by which centres are nearer than that in ``frames``, from which it is told. Choices:
        soft contacts give way by less, and outliers are single ones
    most : bodies, beyond which their pairs are not looked at. Choice: it stays below a second
    """

    near: float = 0.15
    sharp: float = 5.0
    along: float = 0.5
    late: float = 3.0
    agree: float = 4.0
    sure: float = 4.0
    share: float = 0.01
    deep: float = 0.1
    frames: int = 3
    most: int = 100


@dataclass(frozen=True)
class SegmentCriteria:
    """Where tracks are cut, and how closely their segments join.

    near : of the sum of two radii, a gap below which they may have met. Choice: radii are known to a few per cent
    around : frames on either side from which a change of velocity is told, doubled so many times as ``wider`` says: a
        glancing impact shows over a long time;  kick : its standard deviations;  velocity : frames, from which one is
        told with its error. Theory: one more than a line has numbers
    at_once : frames, within which minima of a gap are those of one meeting, but for ``risen`` standard deviations
        between them. Choice
    frames : the least of a segment, and of the flight of a body that is struck again;  start_frames : the least of one
        that no impact ends. Choice
    narrow : spread of a step where nothing met, of what the first nine frames tell of the start. Choice: a fiftieth
        is, beside what a segment as a whole tells, no freedom
    untied : spread of a step into a start that is free of what comes before. Choice: far beyond what any film shows
    impulse : of the change of velocity in an impact, what a rigid collision may be off by. Choice: a per cent, as
        radii that are off by half a per cent turn the line of centres by as much
    lateness : s, of an impact: it lasts. Source: discs of plastic or steel touch for 0.05 to 0.2 ms
        (Goldsmith 1960, Impact)
    depth : of the sum of two radii, how well it is known. Choice: half a per cent. How deep a glancing impact strikes,
        and with it the whole kick, hangs on that and on the noise: so much wider is the step after one
    bend : of the answer to a small error of the start, how much of it may be curved: beyond, linear steps do not find
        the start, which is where chaos begins to show. Choice
    ahead : frames over which a start is followed without asking, and looked ahead where there are more
    open : times the change of a velocity that nothing explains, within which it may be anything. Choice
    robust : standard deviations of a step beyond which it counts in proportion (Huber 1964, Ann. Math. Stat. 35, 73):
        a run that misses a glancing impact is no evidence of that size;  full : the same where straight walls alone
        were met. Theory: a flat wall spreads no two paths, and a disk does (Sinai 1970, Russ. Math. Surv. 25, 137), so
        that no run comes near such an impact and misses it; far beyond what any film shows
    tighter : of the spread of steps at impacts, tried in turn once a law is found. Choice: each by a larger factor than
        the one before, until what a segment leaves open is nothing beside what it tells
    closer : the same before candidates are compared. Choice: steps of five
    gaps : frames in which a gap is seen, from which its minima are told. Theory: a minimum has two neighbours
    joins : with which chance narrower steps raise chi2 as much, before looser ones stay. Choice: one in twenty
    rivals : laws of impacts with which closer joints are tried, by first order. Choice
    same_valley : standard errors that two searches through many impacts may end apart in one valley. Choice
    most : numbers of all starts of a recording that are fitted. Choice: the work of a fit grows with their square, and
        with five hundred a diagnosis takes some minutes; five impacts of 25 disks, or twenty-five of five
    rebound : of the closing speed, what two bodies part with and close with together. Choice: 1 + e, e from 0.5 to 1
    path : a path between two frames is at most so many times the longest way between two of three. Choice;  spare :
        of their radii, by which two bodies count as near each other before they touch. Choice
    """

    near: float = 0.03
    around: int = 6
    wider: int = 2
    kick: float = 6.0
    velocity: int = 3
    at_once: int = 3
    risen: float = 4.0
    frames: int = 4
    start_frames: int = 24
    narrow: float = 0.02
    untied: float = 1e9
    impulse: float = 0.01
    lateness: float = 1e-4
    depth: float = 0.005
    bend: float = 0.25
    ahead: int = 1000
    open: float = 10.0
    robust: float = 4.0
    full: float = 1e6
    tighter: tuple[float, ...] = (0.2, 0.008, 6.4e-5)
    closer: tuple[float, ...] = (0.2, 0.04, 0.008)
    gaps: int = 5
    joins: float = 0.05
    rivals: int = 3
    same_valley: float = 0.2
    most: int = 500
    rebound: float = 1.8
    path: float = 1.5
    spare: float = 0.05


@dataclass(frozen=True)
class FitCriteria:
    """When a fit ends, and how finely it is simulated.

    rough : of chi2, a fall at which a fit ends that only leads to another one;  fine : of the mean square of the
        residuals, the same for one that counts. Choice: a hundredth of what one number gains by chance
    enough : of chi2, a fall that no decision hangs on. Choice: a two-hundredth of ``VerdictCriteria.same``
    damping : of the diagonal, to begin with (Levenberg-Marquardt);  least : to which it falls, by ``softer`` after a
        good step;  again : from which it grows where a step was bad, by ``harder``;  stiff : beyond which nothing is
        found;  good : of the promised fall, from which it falls. Choices
    curved : sightings from which a start has a curvature. Theory: two more than its numbers
    spun : frames from which the spin of a disk is told that turns freely. Choice: few, as it may be struck soon
    turned [rad] : at most, by the turn that all but a share ``fast`` of the frames stay below, between two places that
        tell how far a simulated body has turned. Theory: half a turn cannot be told from one the other way; a quarter
        of that, as without what slows a body down it turns faster;  between : of two frames, so many places at most
    escaped [m] : beyond which a body is lost. Theory: squares of what is farther off may overflow
    renewed : of the promised fall in chi2, below which derivatives that were taken over are renewed. Source: Moré 1978
    straight : of a change of the residuals, how far a linear prediction of it may be off for derivatives to be updated
        by a secant; ``updates``: how often, until they are taken anew;  valley : steps by central differences along
        that of a strength and a shape, at most. Choice
    jump : standard deviations that a step changes the prediction by, in all, from which the derivative is asked on the
        other side, too;  unlike : of the larger one, below which the smaller one is taken: the step went beyond an
        impact. Choices
    own : numbers of the starts of one recording, from which they are eliminated. Choice: two free bodies;
        ``many``: from which their normal equations stand in for singular values
    hopeless : innovation of a run that failed, in standard deviations: the step is taken back
    stretch : times the finest step, how long one may be where no disks are near each other. Choice
    steady : standard deviations that a path may change when its steps are halved, at most ``finer`` times. Choice
    chaotic : of the change before, one that is no smaller is no error of the steps: the motion is chaotic. Choice
    shift : of its standard error, that a number may move when the steps are halved, at most ``halvings`` times. Choice:
        with it intervals are wider by a fiftieth
    flights : evaluations of starts from flights alone, which are nearly linear;  drawn : starts, as well known as
        these, that are tried through the impacts. Choices
    gone : of the strength of a law with a shape, to which it fell where it may be none or of the other sign. Choice
    longer : times the step, with which a search takes its first derivatives. Theory: both sides of a difference have
        the same error of the steps; what is left of it leaves that share of the way open in each step of Gauss-Newton.
        Such a search ends early (``rough``); the fine derivatives at its end, which errors are told from, lead on where
        they promise more than a fit ends for
    step : of a number's scale, by which derivatives step: a tenth of a standard deviation. Choice
    ends : of chi2, a fall at which least squares end where nothing else is said
    steps : of the engine between two frames, at the least, and ``steps_met`` where bodies collide. Choices: in the end
        numbers are held against half the step (``shift``)
    begun : simulations that a thread keeps to begin again. Choice: of as many recordings as are fitted together mostly,
        in some of the fits that go on side by side
    swings : of a believed amplitude, from which the start of a pendulum is looked for;  grid : of the way between its
        bounds, from which a declared number is, where tracks are followed in segments. Choices
    """

    rough: float = 1e-3
    fine: float = 0.01
    enough: float = 0.02
    damping: float = 1e-3
    least: float = 1e-9
    again: float = 1e-3
    stiff: float = 1e8
    good: float = 0.5
    curved: int = 5
    spun: int = 4
    turned: float = math.pi / 4
    fast: float = 0.1
    between: int = 64
    escaped: float = 1e9
    renewed: float = 0.25
    straight: float = 0.1
    updates: int = 3
    valley: int = 6
    jump: float = 50.0
    unlike: float = 0.5
    own: int = 8
    many: int = 60
    hopeless: float = 1e6
    stretch: float = 5.0
    steady: float = 0.1
    finer: int = 4
    chaotic: float = 0.8
    shift: float = 0.2
    halvings: int = 2
    flights: int = 6
    drawn: int = 24
    gone: float = 0.01
    longer: float = 5.0
    step: float = 0.1
    ends: float = 1e-5
    softer: float = 5.0
    harder: float = 10.0
    steps: int = 5
    steps_met: int = 20
    swings: tuple[float, ...] = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
    grid: tuple[float, ...] = (0.15, 0.5, 0.85)
    begun: int = 40


@dataclass(frozen=True)
class SignatureCriteria:
    """What a signature says.

    same_column : of its length, to which a column that others imitate says nothing of its own. Choice: derivatives by
        differences are good to 1e-4
    rounding : of the longest column of numbers with the same unit, below which one is what rounding left. Theory: paths
        are good to 1e-12 of their length, and that is 1e8 standard deviations at most
    moves : standard deviations, between which the largest change is that a derivative is told from. Choice: above
        rounding, and near enough to be linear;  aim : that is gone for below it;  longest : times a scale, beyond which
        no step goes;  farther : times a step that moves nothing (``nothing``), tried next
    leaves : of a signature, what starts have to leave to be told from rounding;  beside : of a direction, what another
        law has to leave for both to be told. Choices
    surviving : share that recalibration leaves of a signature, below which it imitates the law. Choice: gains are then
        a millionth;  shows : from which a law is tried beside others, or looked for in what is left. Choice
    directions : the least share that is told from rounding
    far : standard deviations of the innovations, beyond which first order means little. Choice
    still : of the force of a stream, below which its drag is not told by first order. Choice
    step : of its scale, by which a number is first moved;  room : of the way between its bounds, the largest scale of
        one;  slow : of the fastest speed, the least scale of a stream's. Choices
    places : of the extent of all tracks, where to either side of their middle a point that acts on bodies is looked
        for, and then about the best place in turn. Choice: a force that falls off shows within its distance alone
    beats : strongest lines of what is left, about which a force at one frequency is begun, ``about_beat``: from each,
        in lines' widths. Choices: of a few the strongest is the resonance's own, and a line is told to a part of its
        width;  beat_step : of that width, by which such a frequency is first moved. Choice
    """

    same_column: float = 1e-4
    rounding: float = 1e-6
    moves: tuple[float, float] = (1e-3, 10.0)
    aim: float = 0.1
    longest: float = 1e6
    farther: float = 1e3
    nothing: float = 1e-9
    leaves: float = 1e-5
    beside: float = 1e-3
    surviving: float = 1e-3
    shows: float = 0.02
    directions: float = 1e-4
    far: float = 2.0
    still: float = 0.1
    step: float = 1e-3
    room: float = 0.05
    slow: float = 1e-3
    places: tuple[tuple[float, ...], ...] = (
        (-1.0, -0.5, 0.0, 0.5, 1.0), (-0.25, 0.0, 0.25), (-0.125, 0.0, 0.125), (-0.0625, 0.0, 0.0625)
    )  # fmt: skip
    beats: int = 4
    about_beat: tuple[float, ...] = (-0.5, -0.25, 0.0, 0.25, 0.5)
    beat_step: float = 0.05


@dataclass(frozen=True)
class RefitCriteria:
    """Which candidates are refitted by simulation, and how far.

    valley : of the best gain, from which laws of a bent valley are searched to its end. Choice
    segment_evaluations : of a refit where recordings are followed in segments. Theory: over a segment the prediction is
        nearly linear
    near : of the best first-order gain, below which laws are not refitted where segments are short, nor more than
        ``variants`` forms of one law. Choice
    first_share : of the misfit, that a first beginning has to take away for others not to be tried;  noise : times the
        degrees of freedom, below which chi2 of the scene without it asks for no other. Choice
    staged : frames, beyond which fits take in a part of them first, ``stages``: shares of them. Choice
    evaluations : of a refit, ``few_evaluations`` of a law of more than ``many`` numbers. Choice
    unstuck : of chi2, by which a scene without a law has to do better from where one ended to have been stuck. Choice
    rounds : in which candidates are tried, where a scene without a law that was stuck got free meanwhile. Choice
    leaders : laws that are fitted again from the tracks themselves, where the scene without them bent many starts, or
        where no law comes near from it: from ``pieces`` of each recording. Choice: a turn lies in one or two
    short_pieces : the same where a scene is lost that an adjustable number may bring back, one after the other. Choice:
        as short as starts allow, so that no period is missed, and longer ones, which tell it better
    foreseen : of the fall of chi2 that first order promises, which a good search finds. Choice
    heat : of the frames, over which candidates are compared first;  heat_frames : from which that is worth it. Choice
    heat_won : of the misfit there, that the best has to take away for others to be given up, and of that, what these
        have to take. Choice
    inner_scored : of the best gain, from which a law is scored on data inside the training part. Choice
    memory : of the gain of the best law, below which others are not refitted once the memory of the noise is known.
        Choice;  memory_behind : the same where the best law leaves noise alone, if it is ahead in chi2 by
        ``memory_lead``. Theory: slow noise of the size of the white part, correlated over 30 frames, makes variances 61
        times larger, and leaves 16 of such a lead
    limits : of the range of a single limit, where the search for it begins. Choice: most of what a limit does is near
        where it is absent
    parts : of what one law that is late took, with which another is looked for beside it. Choice: either may lead
    shares : of its first-order amount, from which a law is looked for;  valleys : times it, where strength and shape
        lie along a bent valley;  slower : times, a drag with a stream as much slower, and the other way round. Choices
    heat_stages : of the frames over which candidates are compared first, as ``stages``
    """

    valley: float = 0.5
    segment_evaluations: int = 10
    near: float = 0.1
    variants: int = 2
    first_share: float = 0.5
    noise: float = 1.5
    staged: int = 150
    stages: tuple[float, ...] = (0.1, 0.35, 1.0)
    evaluations: int = 20
    few_evaluations: int = 8
    many: int = 12
    unstuck: float = 1.0
    rounds: int = 2
    leaders: int = 4
    pieces: int = 12
    short_pieces: tuple[int, ...] = (96, 24)
    foreseen: float = 0.5
    heat: float = 0.35
    heat_frames: int = 600
    heat_won: float = 0.5
    inner_scored: float = 0.5
    memory: float = 0.1
    memory_behind: float = 0.5
    memory_lead: float = 1000.0
    limits: tuple[float, ...] = (0.08, 0.2, 0.35, 0.55)
    shares: tuple[float, ...] = (1.0, 0.2)
    parts: tuple[float, ...] = (0.3, 0.7)
    valleys: tuple[float, ...] = (20.0, 400.0)
    slower: float = 4.0
    heat_stages: tuple[float, ...] = (0.3, 1.0)


@dataclass(frozen=True)
class EvaluationCriteria:
    """Evaluations of least squares, after which a fit ends with the best it has. Choices: a fit that is nearly linear
    ends after five of itself, one along a bent valley after a hundred, and of those that only compare few are enough.

    usual : where nothing else is said;  inner : on the first part of the training data
    limit : of a law that is looked for over its range;  stream : of one beside an adjustable drag
    special : of a law from where its special case ended;  valley : to the end of a bent one, ``pair_valley`` of two
        laws;  pair : of two laws over growing parts, ``exchange`` of one in place of another
    joints : of segments that are joined more closely;  one_start : of recordings followed from one start;  growing :
        shares of the frames that such a fit, and one of two laws, takes in one after the other
    camera : of the one scale of a camera in place of a law;  memory : once the memory of the noise is known
    finer : with shorter steps of the engine;  window : of the start of a short window;  proposal : of a loser to a
        winner's prediction
    start : of a held-out start;  block : of one of a block of held-out frames, and ``block_stages``;  repeat : of a
        repeat with fresh noise, ``right`` where its numbers are found anew
    """

    usual: int = 25
    inner: int = 15
    limit: int = 20
    stream: int = 60
    special: int = 20
    valley: int = 150
    pair_valley: int = 120
    pair: int = 30
    exchange: int = 60
    joints: int = 12
    one_start: int = 30
    growing: tuple[float, ...] = (0.35, 0.65, 1.0)
    camera: int = 12
    memory: int = 10
    finer: int = 8
    window: int = 8
    proposal: int = 6
    start: int = 10
    block: int = 15
    block_stages: tuple[float, ...] = (0.2, 1.0)
    repeat: int = 6
    right: int = 20


@dataclass(frozen=True)
class SetCriteria:
    """Several laws, and whom each acts on.

    replicates : nulls of the search of one law, ``replicates_late`` where time is short;  ``replicates_second`` of the
        search beside a law that was found, ``replicates_pair`` of two at once. Theory: p is told to a third at 0.01
    near_best : of what the best is worth, from which a law may be named by what it predicts where something remains.
        Choice;  same_score : times the best score inside the training part, below which another one is as good. Choice
    left : times the excess of a law with more numbers over noise, below which one with fewer is as good. Choice
    poor : share of the misfit left by one law, above which two are looked for, also where less is left and yet far
        (``SignatureCriteria.far``) from noise. Choice
    part : of chi2 beyond noise, that a law beside others has to take away to first order to be refitted, where that is
        less than what their spread asks for. Choice: what a refit finds is tested as ever
    seconds : mechanisms that are refitted beside one that was found, by first order;  better : of the score inside the
        training part, and ``recordings``: share of the recordings that a second one has to predict better;  numbers :
        laws of so many stay open where something else is wrong, too. Theory: a strength and a shape
    firsts : laws beside which a second one is looked for, ``variants`` of one name;  pairs : that are refitted, of each
        way to look for them. Choice
    together : chi2 to first order that two laws have to gain beyond the better one. Theory: the price of one of ten
        candidates at ``VerdictCriteria.by_chance`` (PASTIS)
    both : chi2 over its spread, numbers paid for, that two laws gain. Choice: ``moved``
    clearly : of what the score of what there is exceeds that of noise by, which is 1, what the first pair may leave.
        Choice
    near_partner : of what one of two laws explains, how much another one must, to first order, to be its rival;
        ``partners``: such rivals that are refitted;  rounds : in which one of two laws may be exchanged. Choice
    as_well : of chi2 that the best second law leaves to first order, which one of fewer numbers may leave to be
        refitted, too. Choice: first order is right to a factor
    stream : of the speed of the fastest body, below which a stream is rather a correction to a drag. Choice
    entry : chi2 that a body's own recordings have to gain for a law to act on it;  entry_sure : that needs no better
        prediction. Choice: 10 come by chance one time in six hundred, 40 never
    """

    replicates: int = 299
    replicates_late: int = 99
    replicates_second: int = 99
    replicates_pair: int = 199
    near_best: float = 0.5
    same_score: float = 1.02
    left: float = 2.0
    poor: float = 0.03
    part: float = 0.1
    seconds: int = 4
    better: float = 0.9
    recordings: float = 0.8
    numbers: int = 2
    firsts: int = 8
    variants: int = 2
    pairs: int = 8
    together: float = 20.0
    both: float = 12.0
    clearly: float = 0.5
    near_partner: float = 0.7
    as_well: float = 2.0
    partners: int = 4
    rounds: int = 2
    stream: float = 0.15
    entry: float = 10.0
    entry_sure: float = 40.0


@dataclass(frozen=True)
class IntervalCriteria:
    """Intervals of numbers that are known only together, or unevenly: profiles of chi2.

    alone : share of its information that a number keeps beside the others, below which it is not known alone. Choice
    normal : standard deviations on either side of a number. Theory: the central 95 % of a normal one;  central : the
        quantiles of these
    level : rise of chi2 at the ends. Theory: 95 % of chi2 of one number
    at_first : of a number's distance from neutral, the longest first step along it
    growth : of steps along a valley that were good;  most : steps to either side, after which there is no end but the
        bound
    unlike : times what curvature says of chi2 at the ends of an interval, beyond which it is no measure of them. Choice
    lopsided : of half an interval, by which its ends may be elsewhere and still be told by curvature. Choice
    fine : of its distance, to which an end is found
    probe : evaluations of a fit where curvature puts an end. Choice: one that stops short calls the ends uneven, and
        these are then looked for with many
    evaluations : of each fit along a profile;  again : fits that were not at their end are gone on with so often
    refit : evaluations of a fit that begins where another one ended
    sizes : of the standard deviation of a believed mass or radius, by which derivatives step
    """

    alone: float = 1e-3
    normal: float = 1.96
    central: tuple[float, float] = (0.025, 0.975)
    level: float = 3.84
    at_first: float = 0.1
    growth: float = 2.0
    most: int = 20
    unlike: float = 3.0
    lopsided: float = 0.1
    fine: float = 0.05
    probe: int = 10
    evaluations: int = 30
    again: int = 3
    refit: int = 30
    sizes: float = 0.1


@dataclass(frozen=True)
class LeftCriteria:
    """What is told of held-out errors and of what is left.

    draws : of the noise, for score tests. Theory: p is told to a third at 0.01
    memories : of a start estimate, in parts of the frames it is made from, that are tried
    starts : draws of numbers and starts, whose spread is followed through held-out data. Choice
    within : of its expected square, what one number may show. Theory: by chance in one of twenty
    asked : times the noise floor, from which a held-out error is asked where it comes from
    told : times the noise floor, from which a held-out error is said to remain. Choice;  as_small : up to which what is
        left is said to be as small as the noise, and one error as large as another. Theory: one, in two digits
    few_frames : of all recordings together, the most that are fitted at once to say what they ask for. Choice: of more
        the part that is learnt from tells as much
    chance : probability, where the law is right, of a held-out error as large, below which others of its class are
        asked. Choice: as the alarm of the noise;  repeats : of the right law, from which that is told, and beyond all
        of which what is named is not all. Choice
    beside : leading laws of which what is left may be the like, of at most ``numbers`` numbers;  looks : chi2 that the
        one it looks like has to gain. Choice: one time in six hundred
    line : of what is left, that an oscillation has to be to be told as one;  periodic : frames of a coordinate, the
        fewest. Choices
    forms : of the gain of the best form without a name, below which others are not weighed. Choice
    failed : share of the runs that could not be finished, from which it is told. Choice
    places : probability of chance below which a body is a place of the mismatch, after looking at all;  windows : the
        same for the windows that it is told from. Choice
    touching : standard deviations of a gap, below which bodies touch
    distances : of two bodies, evenly over those that were seen, at which a force between them is asked for; step : of a
        number, by which it is moved to differentiate that force. Choices
    right : repeats, that tell the errors of the right law;  pieces : that a recording is cut into where places of the
        mismatch are looked for;  proposal : frames of a recording, of which the next experiment is weighed. Choices
    """

    draws: int = 999
    memories: tuple[float, ...] = (float("inf"), 0.5, 0.25, 0.12)
    starts: int = 6
    within: float = 3.84
    asked: float = 1.2
    as_small: float = 1.05
    few_frames: int = 500
    told: float = 1.5
    chance: float = 0.005
    repeats: int = 6
    beside: int = 6
    numbers: int = 6
    looks: float = 10.0
    line: float = 0.5
    periodic: int = 30
    forms: float = 0.3
    failed: float = 0.05
    places: float = 0.01
    windows: float = 0.05
    touching: float = 4.0
    distances: int = 21
    step: float = 1e-4
    right: int = 10
    pieces: int = 8
    proposal: int = 400


@dataclass(frozen=True)
class BudgetCriteria:
    """Shares of the time that was given, after which steps are left out or cut short. Choices.

    fits : a fit ends with the best it has;  candidates : that are refitted;  forms : without a name;  memory : of the
        noise;  pairs : of laws;  exchanges : of one of several, and fewer nulls;  settling : the names of the
        apparatus, entries, intervals, shorter steps;  experiment : the proposal, and where a held-out error comes from
    remains : what is left of unseen data;  foretold : after which it is said how much time is left;  again : all of it
        once more, with a number that nobody declared adjustable;  bodies : of how many at the most
    """

    fits: float = 0.9
    candidates: float = 0.45
    forms: float = 0.5
    memory: float = 0.55
    pairs: float = 0.6
    exchanges: float = 0.7
    settling: float = 0.75
    experiment: float = 0.9
    remains: float = 0.95
    foretold: float = 0.05
    again: float = 0.45
    bodies: int = 4
