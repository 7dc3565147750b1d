"""What decides in every kind of recording: what passes for noise, what is explained, when a law is named."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NoiseCriteria:
    """What passes for noise.

    slow_most : of the white part, how large the slow part of the noise may be (contract: no larger)
    memory_most : frames, over how many the slow part may be correlated (contract: 30)
    alarm : probability of noise below which what is left is said to be more than noise. Choice: one in 200
    stated_off : ln of stated over estimated noise from which the estimate is believed. Choice: the estimate of 100
        frames is good to a tenth, and laboratories state sizes that are off by two
    sightings : of a coordinate, the fewest that are looked at. Theory: a parabola has three numbers
    degree : of the scatter about a polynomial, to which one degree more has to lower it to be taken. Choice
    spectrum : numbers of a series, from which its spectrum is told;  correlated : the same of its correlation time;
        frequencies : above which its fast half tells the white part. Choices
    anew : frames between two segments, for a memory that ends where one begins. Theory: far beyond ``memory_most``
    frames : of a channel, from which its noise can be told. Theory: the relative error of a size is 1/sqrt(2 n), a
        ninth;  refutes : over sqrt(2 n) of the n frames of all channels, how far off in ln a stated noise has to be as
        well to be refuted. Theory: 3.5 standard errors, that of ``data.estimate_noise`` is 1.35/sqrt(2 n)
    outlier : standard deviations, from both sides, from which a single sighting is no position. Theory: of 1e5
        sightings of Gaussian noise 2e-4 are farther off than 6
    outlier_frames : frames on each side that an outlier is held against
    single : chance with which noise has any sighting of a film so far off a law that follows it, below which it is
        none;  beside_single : above which the sightings beside it pass for noise. Choices: one film in a thousand, and
        three standard deviations;  row : so many in a row. Theory: with one bad sighting in 200, each by itself, three
        in a row come in one film of 1000 sightings in 8000;  laws_asked : best laws of different names, without which
        sighting each leaves noise. Choice;  leverage : of a sighting's variance, below which a fit follows it whatever
        it is;  freedom : numbers that have to be left over for noise to be told of what a law leaves. Choices
    hides : times what the other frames leave of a line, from which a frame among them is no position itself. Choice:
        as ``outlier``
    share_most : of a channel's sightings that may be taken out; beyond it they are no single ones. Choice
    bands : lowest frequencies whose power is summed, beside the lower half. Choice: physics that was left out is slow
    fast_off : by how much the fast half of a spectrum may differ from the noise that was believed and still be it.
        Choice
    two_numbers : of -2 ln L, what the size and the memory of the slow part gain by chance. Theory: 2 a number
        (Akaike 1974)
    digits : of a number, the most that are looked at. Theory: binary64 has 15
    same_level : of the range of values, below which two are one that arithmetic has split;  on_grid : of the step of a
        grid, how far values may be off it. Theory: of ten random values that all lie so near one is by chance in 1e15
    inflated : standard deviations of chi2 over its degrees of freedom, and ``remembers`` [frames], below both of which
        innovations pass for white noise of known size, whose variances are not inflated. Choice: 4 come by chance
        once in 3e4 fits, and a correlation time is known to a half
    degrees : of polynomials through nine frames, whose scatter tells the white part. Theory: a degree more than the
        motion has leaves noise alone
    sizes : of ``slow_most``, at which the likelihood of a slow part is looked at, ``slow`` where there is one. Choice:
        it changes by less than one number's worth between two of them
    believed : frequencies of a spectrum, that a stated white part counts for where none is told. Choice
    beside : frames on either side, through which a curve is drawn that a sighting is held against, a polynomial of
        degree ``curve``. Theory: its six numbers leave four;  whens : of the three frames about two sightings that are
        held against a kick, at which it is looked for. Choice: an eighth of a frame is between them
    """

    slow_most: float = 1.0
    memory_most: float = 30.0
    alarm: float = 0.005
    stated_off: float = 0.25
    sightings: int = 4
    degree: float = 0.9
    spectrum: int = 12
    correlated: int = 8
    frequencies: int = 6
    anew: int = 1_000_000
    frames: int = 40
    refutes: float = 4.7
    outlier: float = 6.0
    outlier_frames: int = 4
    single: float = 1e-3
    beside_single: float = 0.0027
    row: int = 2
    laws_asked: int = 3
    leverage: float = 1e-6
    freedom: int = 8
    hides: float = 6.0
    share_most: float = 0.1
    bands: tuple[int, ...] = (4, 12, 40)
    fast_off: float = 1.5
    two_numbers: float = 4.0
    digits: int = 15
    same_level: float = 1e-9
    on_grid: float = 0.01
    inflated: float = 4.0
    remembers: float = 1.5
    degrees: tuple[int, ...] = (2, 3, 4, 5, 6)
    sizes: tuple[float, ...] = (0.0, 0.1, 0.2, 0.3, 0.45, 0.65, 0.85, 1.0)
    slow: tuple[float, ...] = (0.2, 0.35, 0.5, 0.7, 0.85, 1.0)
    believed: int = 1000
    beside: int = 5
    curve: int = 5
    whens: int = 25


@dataclass(frozen=True)
class WorkCriteria:
    """What a budget of minutes is worth, told from the size of runs and not by the clock.

    cores : idle ones, that a budget is meant for. Choice
    body_step [s] : of a core, that a step of one body takes. Measured: full beds (benchmarks/speed.py)
    body_start [s] : of a core, that a body's start takes: estimated, drawn, taken apart from its neighbours. Measured
    start_up [s] : of a core, that a run takes to begin. Measured
    predictions [bytes] : that are kept in memory. Choice;  stretches : of recordings that a fit keeps cut up. Choice
    alone : steps times bodies of the longest run, below which all is done in one thread. Measured, ``granswim
        diagnose`` held to one core against two: of runs of 3000 (four pucks) two threads make 1.16 of the time that
        one takes, of 20,000 (a cart) 0.93, of 46,000 (the shipped pendulum) 0.77
    least : of a budget, that each further look at a kind of recording gets where nothing is left of it. Choice
    """

    cores: int = 2
    body_step: float = 1.4e-8
    body_start: float = 1e-5
    start_up: float = 0.15
    predictions: int = 2**25
    stretches: int = 64
    alone: int = 10_000
    least: float = 0.1


@dataclass(frozen=True)
class ApparatusCriteria:
    """How far the camera and the clock may be off, and by what their numbers first step.

    tilt [rad] : where the search for one ends, ``offset`` [s] and ``bias`` [m] the same. Choices: beyond them a film
        says so at a glance
    scale : of a picture's scale and of a tilt [rad], the first step;  shift [m] : of a bias;  frame : of the time
        between two frames, of an offset;  turn [rad] : of a direction;  middle : of the extent of all tracks, of the
        middle of a lens. Choices
    off_level [rad] : of a table, or of a picture with gravity in it, one standard deviation that nobody notices.
        Choice: half a millimetre on a metre
    steep : of gravity, what acts in the picture's plane, beyond which bodies lie on no substrate. Choice: it is a slope
        of 64 degrees
    even : of gravity, the acceleration below which what sinks has come to an even speed; the same of the way down, of
        the way across. Theory: after three times m/c a drag leaves e^-3 of it
    within_frame : of the time between two frames, one standard deviation of when in it a flash is. Theory: 1/sqrt(12)
    outside : factor by which a number is sought outside its bounds where nothing within follows; of one that may be
        zero so many widths of its range to both sides. Choice: twice a period is four times a stiffness
    usual_scale : by how much any picture's scale is off, one standard deviation. Source: what proofs under real-life
        conditions draw; usual errors of laws are declared with them
    """

    tilt: float = 0.8
    offset: float = 0.2
    bias: float = 1.0
    scale: float = 1e-3
    shift: float = 1e-4
    frame: float = 0.1
    turn: float = 0.1
    middle: float = 0.1
    off_level: float = 5e-4
    steep: float = 0.9
    even: float = 0.05
    within_frame: float = 0.3
    outside: float = 8.0
    usual_scale: float = 0.005


@dataclass(frozen=True)
class StampCriteria:
    """When the stamps of frames are said to be off, each by an error of its own.

    window : frames, through which polynomials of fifth degree tell the noise of the middle one. Choice
    sightings : that a speed is told from, by a cubic. Theory: its error is that of a line through six
    tail : degrees of freedom of Student's t. Choice: impacts and single outliers make no error of stamps;  scale : by
        which Gaussian noise is larger than that of the t that is fitted to it. Theory: where its likelihood is largest
    sure : of -2 ln L, by which an error has to be likelier than none. Theory: chance gives as much one time in six
        hundred (chi2 of one number), and a wrong model of the noise often more
    refuted : of -2 ln L, by which the likeliest error has to be ahead of a stated one. Theory: three standard errors
    frames : from which an error of stamps can be told. Choice;  rows : of at most so many. Theory: a size is known to a
        sixtieth from them
    stated_off : factor, one standard deviation, by which a stated white part may be off. Choice: laboratories state
        sizes that are off by two;  unstated_off : by which one told from the same frames may be, which late stamps
        enlarge
    most : of the time from frame to frame, up to which stamps are late. Choice: beyond, frames would change places
    struck : standard deviations of a sighting, by which bodies that meet come nearer from frame to frame, the least.
        Choice: what rests on a wall seems to move by less
    """

    window: int = 9
    sightings: int = 11
    tail: float = 6.0
    scale: float = 1.09
    sure: float = 10.0
    refuted: float = 9.0
    frames: int = 40
    rows: int = 2000
    stated_off: float = 2.0
    unstated_off: float = 4.0
    most: float = 0.5
    struck: float = 4.0


@dataclass(frozen=True)
class ReleaseCriteria:
    """When the first frames, or the last, show bodies that are held.

    still : frames at rest, the least. Choice;  same : that show one number to the last digit, the least of what gravity
        pulls. Theory: a parabola has each number twice
    after : of the motion, the least. Theory: a parabola has three numbers
    away : standard deviations from the place of rest, in three frames running;  clear : times as far, up to which
        a parabola is tried in turn: the farther, the more it shows, and the less it follows. Choice
    tried : frames, the most that are tried as that of the release. Choice
    sure : of chi2, by which rest and then motion has to be ahead of one smooth motion. Theory: chance gives as much to
        a number once in 3e7;  alarm : probability of what the better one leaves, below which neither describes it
    falls : standard deviations that a body which rests at the end would have fallen meanwhile, the least. Choice
    commanded : times ``away``, that a command would have moved a body which rests, the least. Choice: a gain that is
        believed is seldom six times too large, and what follows a command is not so much slower than it at first
    lasts : of the first command, down to which it goes on. Choice
    share : of the frames that are learnt from, up to which first ones are left out as those of a hand. Choice: a third
        of the film has to be another motion to be taken for the motion;  begun : how many numbers of first frames are
        tried. Choice: a start is then known to a thirtieth of the film
    """

    still: int = 5
    same: int = 3
    after: int = 6
    away: float = 4.0
    clear: tuple[float, ...] = (10.0, 30.0, 100.0)
    tried: int = 200
    sure: float = 30.0
    alarm: float = 1e-4
    falls: float = 100.0
    commanded: float = 6.0
    lasts: float = 0.5
    share: float = 0.34
    begun: int = 12


@dataclass(frozen=True)
class LostCriteria:
    """When stamps go on evenly where frames are missing, or where a frame is there twice.

    windows : (degree, half, frames) of polynomials that bodies follow over so many frames on either side of the gap,
        and how many are looked for. Choice: a parabola where the next gap is near, a cubic follows most motions, a
        fifth degree half an oscillation
    gap : of the usual time between frames, from which the stamps themselves tell of missing ones. Theory: between one
        and two;  long : from which bodies may have turned meanwhile. Choice
    sure : of chi2, by which the way with the frames missing has to be ahead of the way without, and of a way with a
        kink there, which a gap that is long enough follows as well. Theory: as for a kick
    times : what the way without them leaves beyond noise over what is left with them;  most : of chi2 over its degrees
        of freedom, that may be left with them. Choice: laboratories state noise that is off by two
    chance : of numbers that are the same in two frames by chance, below which the picture is. Choice: once in a hundred
        films of 10^5 frames
    often : pictures that are shown again, from which the share of all frames that they are tells how likely a further
        one is. Choice;  odds : against chance, as a share, that it is one. Choice: a hundred to one
    """

    windows: tuple[tuple[int, int, int], ...] = ((2, 4, 4), (3, 6, 12), (5, 9, 18))
    gap: float = 1.5
    long: float = 3.5
    sure: float = 50.0
    times: float = 4.0
    most: float = 4.0
    chance: float = 1e-7
    often: int = 3
    odds: float = 0.01


@dataclass(frozen=True)
class FilledCriteria:
    """When sightings are made up by a tracker that had lost a body.

    side : frames, that a cubic goes through on either side of a place that is kept, twice as many where one is open.
        Choice
    most : of chi2 over its degrees of freedom, that it may leave of these. Choice: laboratories state noise that is
        off by two
    away : standard deviations, that a body has to have gone meanwhile. Choice: as for an outlier
    chance : with which what is measured is so by chance, below which it is made up. Choice: once in a hundred films of
        10^5 frames
    row : frames on a line, the least, one where they are a ``share`` of all. Choices: of pixels that are not told as a
        grid one or two are on a line by chance, and a film with frames put in between has every second one there
    times : the chance of one, that this share is at least;  many : frames on lines, from which it is told. Choices
    fast : of the speeds, that are less than the one by which a stamp's last place moves a body on. Choice
    """

    side: int = 4
    most: float = 4.0
    away: float = 6.0
    chance: float = 1e-7
    row: int = 3
    share: float = 0.2
    times: float = 20.0
    many: int = 10
    fast: float = 0.9


@dataclass(frozen=True)
class SmoothedCriteria:
    """When tracks are said to have been smoothed.

    apart : frames, that noise is told from;  frames : so far apart, the fewest. Theory: a size told
        from as many is good to a fifth;  rows : frames, that are looked at;  columns : numbers in each, about how many.
        Choices
    grown : over the noise told from neighbours, that told from every third frame has to be. Theory: slow noise of a
        camera, no larger than its white part, makes that sqrt(2) at the most;  second : that told from every second
        one. Choice: a motion that is not followed over more frames is followed over twice as many
    power : of the distance, with which the square of what is added may grow. Theory: noise whose neighbours are one
        grows with the square, or the fourth power where the filter is steep; what polynomials of sixth degree do not
        follow of a motion with the fourteenth;  steep : that of the step from three frames to four. Choice: halfway
    level : from which distance to the next it grows no more. Choice
    shares : of windows, that leave less than the one which tells it;  alike : how much more one may tell than another.
        Choice: told from noise they are one, an impact is in some windows, and in them alone
    quiet : of the frames, about which nothing is hit as far as a window reaches. Choice
    seen : of the frames, in which a number has to be seen. Choice
    of_motion : of the spread of a track, from which what is told is no noise that a filter hid. Choice: a filter that
        hides a tenth of the motion would bend the motion, too
    coarse : of the noise that neighbours show, the step of a grid from which they tell of it and of no filter. Theory:
        rounding to a step is 1/sqrt(12) of it; a body at rest whose noise is less than a step is told by few numbers
    """

    apart: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16)
    frames: int = 20
    rows: int = 1000
    columns: int = 6
    grown: float = 1.5
    second: float = 1.1
    power: float = 5.0
    steep: float = 7.0
    level: float = 1.12
    shares: tuple[float, ...] = (0.2, 0.5, 0.8)
    alike: float = 2.0
    quiet: float = 0.3
    seen: float = 0.8
    of_motion: float = 0.1
    coarse: float = 1.0


@dataclass(frozen=True)
class LinkingCriteria:
    """When two tracks have swapped their labels.

    sightings : that tell a place, a velocity and a curvature with one to spare
    far : standard deviations of a sighting, and times the usual second difference of a motion, from which a body is not
        where its last two sightings lead. Choice
    smoother : of the squares that a smooth motion leaves: what is better than that belongs together. Choice
    ahead : frames, among which the next two sightings are looked for. Choice: over more a motion is no parabola
    link : standard deviations from which the length of a link is not that of two sightings. Theory: of 10^5 lengths one
        is beyond 4.4 by chance, and errors of two sightings are not all normal
    """

    sightings: int = 4
    far: tuple[float, float] = (12.0, 5.0)
    smoother: float = 0.2
    ahead: int = 5
    link: float = 6.0


@dataclass(frozen=True)
class SplitCriteria:
    """What is held out where the user says nothing (contract, "Held out").

    training : of the time, where single recordings are split
    start : of a held-out recording, on which its start is fitted
    inner : of the training frames of one recording, on which a law is fitted; the rest tests the choice between
        candidates. Choice: as for what is held out
    """

    training: float = 0.6
    start: float = 0.2
    inner: float = 0.6


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
    start : share of a block's frames on which its start is fitted. Choice;  whole_start : where whole recordings
        are the blocks (contract)
    start_frames : the least of them;  unit_frames : of a stretch
    evaluations : of the fit of a start
    told : of what all data tell of a number, below which that number stays as it is where a block is left out. Choice
    draws : replicates of the noise for the floor;  bootstrap : resamples for intervals
    decides : change of chi2 of all held-out frames, below which they decide nothing. Theory: what one number gains by
        chance
    drawn : of the mismatch, that a resample has to hold to say something of its share. Choice
    starts : drawn, from which a block is predicted again to tell whether it is followed. Theory: a meeting that one
        start in ten misses is noticed in all but one film in a hundred and fifty, with twelve in all but one in four
    bent : mean square of what is not in proportion to the error of its start, over the noise, up to which it is.
        Choice: that of ``SegmentCriteria.bend``
    held_out : blocks that the held-out frames of a recording are cut into, for each body, where errors are compared,
        and pieces of a recording in one of which most is said to be left.
        Choice: a bootstrap of fewer makes intervals of no width
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
    told: float = 0.1
    draws: int = 60
    bootstrap: int = 2000
    decides: float = 1.0
    drawn: float = 0.05
    starts: int = 48
    bent: float = 0.25
    held_out: int = 8


@dataclass(frozen=True)
class VerdictCriteria:
    """When a law is named (contract 2, "The verdict").

    alarm : probability of a false alarm below which a mismatch is real
    by_chance : probability with which one more law of a set is named although there is none. Source: PASTIS (Gerardos &
        Ronceray 2025, PRL 135, 167401)
    share : of the mismatch that named laws explain at least;  share_alone : where no free form was possible
    told : of the mismatch, that a form without a name explains at least to be told. Choice: less is 0 % on the page
    free_form : a free form that leaves less than this part of what the names leave is the better explanation;
        ``free_form_high`` where the names explain ``high`` or more
    beyond : spreads of the difference between replicates from which a share can be said
    scale_off : a scale of the picture that is off by more is no explanation
    ordinary : of the way from absent to where the search for a number ends, within which a fault of the apparatus is
        what laboratories are off by. Choice: scales by 3 %
    usual : standard deviations of what any laboratory is off by, within which an error of the apparatus is usual.
        Theory: chance exceeds three one time in four hundred
    nearly : of the gain of a refitted law, that its signature alone shows where first order will do. Choice
    at_bound : of the way from absent to where the search for a number ends, within which it ended there. Choice
    decides : d' from which an experiment is worth doing. Theory: below 2 chance decides one time in six
    settles : d' from which an experiment settles it. Theory: halfway between two laws that are d' apart chance errs one
        time in 44
    further : by how many times the d' of another experiment must be larger before it is proposed in place of an
        earlier, simpler one. Choice
    same : two laws whose chi2 differ by less cannot be told apart. Theory: the square of a d' of 2
    alike : chi2, by which a law has to be ahead of a form without a name for nothing to be said of that form. Theory:
        where the form acts, d' from the law, the law is ahead by -d'^2 +- 2 d', and by as much as this once in twenty
        films at the most, whatever d' is: sf(1.645) = 0.05. The name is complete where the law is ahead at all
    line : of the longest extent of places, below which they lie on a line;  field : of the variance of a field where it
        was seen, that a spring may leave to be told as one. Choices
    instead : laws, the best in the training part, that are asked of held-out data where these turn down a special fault
        of the apparatus. Choice
    simpler : how improbable the gain of further numbers must be by chance before the richer law is named. Choice
    absent : with which chance numbers that are absent gain as much: what it means that a 95 % interval holds "absent"
    noticed : chi2 over its spread, numbers paid for, from which a law is looked at. Theory: chance gives it to one
        number one time in two hundred
    moved : chi2 that recalibration gains before an adjustable is said to be off, ``noticed`` and half of it
    bodies : of the excess of the worst body over the floor, from which another one is told beside it. Choice
    rival : of the gain of what is named, from which another law is told as its rival;  rivals : that are told at most;
        ``rivals_of_pair`` beside several laws, and all that these data cannot tell. Choice
    as_given : of the held-out error with what is named, below which that of the scene as given is told to be smaller.
        Choice: a difference that the report calls one
    """

    alarm: float = 0.01
    by_chance: float = 1e-3
    share: float = 0.5
    share_alone: float = 0.7
    told: float = 0.005
    high: float = 0.9
    free_form: float = 0.5
    free_form_high: float = 0.1
    beyond: float = 2.0
    scale_off: float = 0.3
    ordinary: float = 0.1
    usual: float = 3.0
    nearly: float = 0.7
    at_bound: float = 1e-3
    line: float = 0.03
    field: float = 0.05
    decides: float = 2.0
    settles: float = 4.0
    further: float = 1.1
    same: float = 4.0
    alike: float = 2.7
    instead: int = 3
    simpler: float = 1e-3
    absent: float = 0.05
    noticed: float = 8.0
    moved: float = 12.0
    bodies: float = 0.5
    rival: float = 0.2
    rivals: int = 8
    rivals_of_pair: int = 3
    as_given: float = 0.9
