"""What decides where a bed is not seen: which candidates are run, in how many packings, and what is concluded."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace


@dataclass(frozen=True)
class Sizes:
    """How many packings are run of each kind, for every recording; see ``planned_sizes``. Choices.

    true : of the naive scene with its own contacts;  soft : with softer ones: the spread needs them
    adjustable : of each adjustable;  screen : of every candidate;  more : beside those, of the candidates in question
    leader : at a leader's fitted amount;  final : of the revised scene with its own contacts
    leaders : laws that are refitted;  duel : of the best two, where they are near each other
    spread : of the naive scene in all training films together, where ``soft`` are fewer, or the budget pays for more

    Theory: a prediction from n_t true, n_s soft and n_l of a leader has 1/n_t + 1/n_s + 1/n_l of a packing's variance,
    beside that of the film's own packing, which no run makes smaller.
    """

    true: int = 8
    soft: int = 20
    adjustable: int = 4
    screen: int = 1
    more: int = 3
    leader: int = 6
    final: int = 4
    leaders: int = 5
    duel: int = 12
    spread: int = 0

    def times(self, factor: float) -> Sizes:
        """More, or fewer, of everything; hardly more of what tells directions, or is known best already."""
        steady = ("leaders", "soft", "screen", "more")
        least = {"true": 3, "soft": 3, "adjustable": 2, "leader": 2, "final": 2, "leaders": 3, "duel": 4, "screen": 1}
        return replace(self, **{
            f.name: max(round(getattr(self, f.name) * (min(factor, 1.2) if f.name in steady else factor)),
                        least.get(f.name, 0))
            for f in fields(self) if f.name != "spread"
        })  # fmt: skip


@dataclass(frozen=True)
class RunCriteria:
    """How a scene is run in other packings.

    softer : times, by which contacts are softer at most in runs that only give differences; restitution stays. Choice
    cheaper : times, at least, that such a run has to be, or contacts stay as they are: softness bends numbers. Choice
    stroke : contacts that a cycle of the drive is long, at least, where they are softer. Choice
    per_contact : steps that a soft contact lasts;  own : of the advised step, where contacts are the scene's: 10 steps
        a contact;  coarser : the step of all other laws where contacts are soft: 25 a period of the union. Choices: the
        spread between packings is some per cent
    first_seed : of the packings. Choice: unlikely to be that of a simulated recording
    apart : of the sum of radii, between which linked disks keep their distance in a run that counts. Choice
    parts : of a run, after each of which it may be given up. Choice
    """

    softer: float = 25.0
    cheaper: float = 3.0
    stroke: float = 450.0
    per_contact: float = 10.0
    own: float = 1.5
    coarser: float = 4.0
    first_seed: int = 700_001
    apart: tuple[float, float] = (0.7, 1.5)
    parts: int = 40


@dataclass(frozen=True)
class SummaryCriteria:
    """What is compared of a recording whose bed is not seen.

    harmonics : of the angles. Theory: a straight symmetric swimmer has no even ones;  higher : cycles from which more
        than the first is told. Choice
    cycles : below which nothing can be told about harmonics;  frames : of a disk, the fewest
    straight [rad] : off the axis, up to which a swimmer is straight
    curve [s] : what a curve's speed leaves out (contract);  least [s] : that it has to last beyond;  end [s] : of one
        that does not say how long it was;  look [s] : between two looks at a simulated swimmer of a curve
    speeds : of a curve, from which every third is held out. Choice
    settled : (s, cycles) that a film from rest leaves out, whichever is longer;  under_way : the same of one that
        begins on the way, whose bed remembers;  ``late``: of the film, at most. Choice
    draws : of the tracking noise, that tell its covariance;  shares : of it, of its diagonal and of the whole. Choice:
        tens of draws give the sizes, not the weak correlations
    """

    harmonics: tuple[int, ...] = (1, 3)
    higher: float = 1.9
    cycles: float = 1.2
    frames: int = 16
    straight: float = 0.1
    curve: float = 0.5
    least: float = 0.1
    end: float = 1.1
    look: float = 2e-3
    speeds: int = 6
    settled: tuple[float, float] = (0.1, 0.5)
    under_way: tuple[float, float] = (0.3, 2.0)
    late: float = 0.4
    draws: int = 60
    shares: tuple[float, float] = (0.3, 0.7)


@dataclass(frozen=True)
class AmountCriteria:
    """How much of a candidate is run.

    least : of its shift, in what two packings differ by;  most : of the same;  wanted : of it. Theory: where it is r,
        its direction is known to a cosine of sqrt(1 - 1/r^2), 0.87 at the least
    grow : times the amount where it shows too little;  gone : where no run survives it. Choices
    below : of its scale, the first amount of a number that is less than usual. Choice
    scale : of a camera's scale and tilt [rad], and ``offset`` [s] of the clock, the first;  widest : where a scale ends
    speed : of the tail, how fast grains are;  stops : times in a cycle that such a grain is stopped by a strength of
        the size that units tell;  unitless : such a size where no unit tells one;  stream : of a grain's speed
    damping [1/s] : of contacts, where none is believed. Choices
    """

    least: float = 2.0
    most: float = 9.0
    wanted: float = 4.0
    grow: float = 6.0
    gone: float = 0.2
    below: float = 0.4
    scale: float = 1e-2
    offset: float = 1e-3
    widest: tuple[float, float] = (0.5, 2.0)
    speed: float = 0.15
    stops: float = 1.5
    unitless: float = 0.1
    stream: float = 0.3
    damping: float = 1e4


@dataclass(frozen=True)
class PackingCriteria:
    """All that decides where statistics over packings are compared.

    minutes : what a diagnosis may take where nothing is said;  sizes : how many packings are run;  runs : how
    summaries : what is compared;  amounts : how much of a candidate is run
    step : of an adjustable's range, and ``slope``: of a number's scale, by which derivatives step. Choice
    moved : of such a step, and ``moved_errors``: of its standard error, from which an adjustable is run again where it
        is. Choice;  chord : of its scale, from which a number's slope is the chord to where it was run. Choice
    led : of the best gain, from which a candidate is refitted, ``led_apparatus`` one of the apparatus, ``led_bent`` one
        that is fitted at ``bent`` times the amount of its signature, or at less than that part;  sharper : from
        which it is run in more packings, at most ``sharpened``;  rival : from which it is told beside. Choices
    arc : of the largest, above which a phase is of the place of a mismatch. Choice
    falls : of the objective, below which a step of its fit is none, and the last one. Choice

    survives : of a signature, below which recalibration imitates it. Choice
    visible : a signature has to stand out of the runs' own noise by this factor. Choice
    replicates : of the search in packings of the recalibrated scene. Theory: p is told to a third at 0.01
    probes : amounts of a candidate that are tried at most;  inside : of the way to a bound, how far
    more : p of the search, up to which those that lead are run in more packings. Choice
    side : standard deviations, one-sided 95 %
    of_a_class : of what the best gains on speeds alone, from which a law is of its class. Choice
    resamples : of the frames of a curve, for the share that is explained
    folds : into which pairs of packings are cut where a regression is tested on others
    wild : mean square of a scene's residuals, in those of the naive scene, beyond which they do not count. Choice
    aside : of a found amount, how far on both sides of it runs tell its slope. Choice: curvature cancels to first order
    lean : runs that the spread of all scenes counts for, beside those of one scene. Choice
    settled : of a number's standard error, or of the number, by how much it may be off where it was run. Choice
    reach : standard deviations of the runs' error, from which a law that is behind cannot be the best. Theory: 1 in 700
    behind : of the best gain, within which a law is run where it is fitted before it is left behind. Choice
    films : that the budget of a diagnosis is meant for; fewer take their part of it
    probed : runs of a candidate at amounts that show too little or too much, before one that shows. Measured: 1.5
    pairs : cost of a candidate's run in those of the naive scene, where it acts on contacts or bodies. Measured
    spread : packings of the naive scene that tell the spread of some forty numbers, at the least;  spreads : those
        that are run where they cost no more than ``share`` of the budget. Theory: of n - 1 degrees of freedom of the
        spread of p numbers F keeps (n - p)/n;  screens : times the usual packings of every candidate, where they cost
        no more than that. Theory: signatures known from n packings may be smaller by sqrt(n), and bend less
    share : of the budget. Choice
    tails : degrees of freedom of t that are told apart. Choice
    rounds : of a fit, ``pair_rounds`` where a law is tried beside another;  steps : of its change, that are tried
    factors : times the usual sizes, that are held against a budget. Choices
    picture [m] : of a picture, over which a ruler or a plumb line is read;  read : the least error of it [1, rad]
    """

    minutes: float = 15.0
    sizes: Sizes = field(default_factory=Sizes)
    runs: RunCriteria = field(default_factory=RunCriteria)
    summaries: SummaryCriteria = field(default_factory=SummaryCriteria)
    amounts: AmountCriteria = field(default_factory=AmountCriteria)
    step: float = 0.15
    slope: float = 0.05
    moved: float = 0.25
    moved_errors: float = 0.5
    chord: float = 0.1
    led: float = 0.3
    led_apparatus: float = 0.15
    led_bent: float = 0.1
    bent: float = 2.0
    sharper: float = 0.3
    sharpened: int = 8
    rival: float = 0.2
    arc: float = 0.5
    falls: tuple[float, float] = (1e-9, 1e-4)
    survives: float = 0.02
    visible: float = 2.0
    replicates: int = 299
    probes: int = 5
    inside: float = 0.95
    more: float = 0.2
    side: float = 1.645
    of_a_class: float = 0.95
    resamples: int = 400
    folds: int = 5
    wild: float = 3.0
    settled: tuple[float, float] = (0.5, 0.1)
    reach: float = 3.0
    behind: float = 0.2
    aside: float = 0.4
    lean: float = 4.0
    films: int = 4
    probed: float = 1.5
    pairs: float = 1.3
    spread: int = 60
    spreads: tuple[int, ...] = (120, 240)
    screens: tuple[int, ...] = (2, 4)
    share: float = 0.1
    tails: tuple[float, ...] = (3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 14.0, 20.0, 30.0, 50.0, 100.0, math.inf)
    rounds: int = 12
    pair_rounds: int = 6
    steps: tuple[float, ...] = (1.0, 0.5, 0.2)
    factors: tuple[float, ...] = (2.0, 1.5, 1.2, 1.0, 0.8, 0.6, 0.45, 0.3)
    picture: float = 3e-3
    read: float = 1e-4
