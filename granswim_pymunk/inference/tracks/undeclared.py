"""Numbers of the scene that nobody declared adjustable, and the frame rate, that would do instead of what was named.

A rod that is longer than believed swings as one with a heavier bob in a picture of another scale, and so does any in a
film of another frame rate. What may be adjusted is the experimenter's to say; that another number does as well is told.
So is an adjustable number that would do outside the bounds it was given: a period that was read off as half of what it
is makes a spring four times too stiff, and no law mends that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...laws import Parameter
from ...recording import Recording
from ...scene import Adjustable, Scene
from ..criteria import current
from ..data import Case
from ..hypothesis import Failed, Free, Hypothesis, Term, adjustable_term, set_camera
from ..mechanisms import nameless, plainly
from ..simpler import ended_at_bound
from .fit import Fitter
from .fitted import Fit
from .name import Trial, far_off

CLOCK = "frame_rate"


@dataclass(frozen=True)
class Instead:
    """A number of the scene that does what ``replaced`` laws do, or where nothing was named most of what is missing.

    name, unit, believed : of the number;  value, low, high : as fitted, central 95 %;  left : of chi2 beyond noise
    term : by which it was fitted;  makes_room : with fewer numbers than it replaces, or where nothing was named, so
        that other laws may have a place
    bounds : in which it was adjustable, where it does so outside them;  lost : it brings back a scene that was lost
    likelier : than what it replaces: laws that are new to the scene, or a fault that hardly any camera has (``camera``)
    """

    name: str
    unit: str
    believed: float
    value: float
    low: float
    high: float
    replaced: tuple[str, ...]
    left: float
    term: Term
    makes_room: bool
    bounds: tuple[float, float] | None = None
    lost: bool = False
    likelier: bool = False
    camera: bool = False

    @property
    def of_the_scene(self) -> bool:
        """Whether it is a number of the scene, which may be declared adjustable; else it is the film's clock."""
        return self.term.mechanism != CLOCK

    def __str__(self) -> str:
        half = 0.5 * (self.high - self.low)
        digits = 2 + max(math.ceil(math.log10(abs(self.value) / half)), 1) if half > 0 else 4
        value, low, high = (f"{v:.{digits}g}" for v in (self.value, self.low, self.high))
        unit = "" if self.unit in ("", "1") else f" {self.unit}"
        if self.bounds is not None:
            lowest, highest = self.bounds
            return (
                f"{self.name} = {value}{unit} ({low} to {high}), outside its {lowest:.4g} to {highest:.4g}, leaves "
                f"{100 * self.left:.2g} % of what is left within them beyond noise: look at how they were found"
            )
        does = f"does as well as {' and '.join(self.replaced)}"
        if self.likelier:
            does += ", and is likelier: what the scene has with another number, before what it has not"
        if self.camera:
            does += "; a ruler in the picture, along the motion and across, tells them apart"
        if not self.replaced:
            does = f"leaves {100 * self.left:.2g} % of what the scene as believed leaves beyond noise"
        return (
            f"{self.name} = {value}{unit} ({low} to {high}), where {self.believed:.4g} is believed, {does}: "
            + ("it may be declared adjustable" if self.of_the_scene else "look at how the frames got their stamps")
        )


def instead_of(laws: Sequence[Trial], fit: Fit, plain: Fit, fitter: Fitter, spread: float) -> list[Instead]:
    """Numbers of the scene, each in place of all that laboratories are off by among what is told, best first.

    Of names, that is the apparatus and laws that declare what is usual (masses, a table's tilt). A number does as well
    where chi2 and AIC do not prefer the laws; where nothing is named, where less than half is left. In place of one
    number that is new to the scene it has to do better, by as much as two laws differ that can be told apart; of laws
    that cannot be the one with fewest numbers is named. One number moves at a time, between half and twice what is
    believed.
    """
    usual = [t for t in laws if t.apparatus or any(f.ordinary for f in t.term.free)]
    replaced = usual or list(laws)
    most = current().verdict.same if usual or sum(t.numbers for t in laws) > 1 else -current().verdict.same
    if laws and most < 0 and not fit.excess:
        return []  # nothing does better than one number that leaves noise
    kept = [t for t in laws if not any(t is r for r in replaced)]
    begin = [*plain.values, *(v for t in kept for v in t.values)]
    names = tuple(dict.fromkeys(plainly(t.mechanism) for t in replaced))
    found = []
    for term in (*_numbers(fitter.cases), frame_rate()):
        hypothesis = plain.hypothesis.with_term(*(t.term for t in kept), term)
        free = term.free[0]
        try:
            again = fitter.fit(hypothesis, [*begin, free.first], fit.starts)
        except Failed:
            continue
        left = again.excess / plain.excess if plain.excess else 1.0
        paid = (again.chi2 - fit.chi2) / spread + 2 * (1 - sum(t.numbers for t in replaced))
        if paid > most if replaced else left > current().verdict.share:
            continue
        value, low, high = again.interval(len(begin), max(spread, 1.0))
        if not low <= free.first <= high and _inside(free, value):
            fewer = len(fit.values) - len(again.values)
            room = not replaced or (fewer > 0 and (again.chi2 - fit.chi2) / spread < 2 * fewer)
            camera = any(t.special for t in usual)
            likelier = camera or bool(laws and not usual)
            told = free.name, free.unit, free.first, value, low, high, names, left, term, room
            number = Instead(*told, likelier=likelier, camera=camera)
            found.append((again.chi2, number if number.of_the_scene else _as_rate(number, fitter.cases)))
    return [number for _, number in sorted(found, key=lambda entry: entry[0])]


def in_a_lost_scene(laws: Sequence[Trial], fit: Fit, plain: Fit, fitter: Fitter) -> list[Instead]:
    """Numbers, adjustable ones outside their bounds and others far from what is believed, that bring a scene back.

    Each alone takes away more than half of what the scene as believed leaves, and more than all that was named, best
    first. Asked where the scene is lost, and with the laws that have a name still is; not through impacts.
    Arguments as of ``instead_of``
    """
    named = bool(laws) and not any(nameless(t.mechanism) for t in laws)
    if fitter.segmented or not far_off(plain) or (named and not far_off(fit)):
        return []
    scene, found = fitter.cases[0].recording.scene, []
    adjustable = {a.name for c in fitter.cases for a in c.recording.scene.adjustable}
    # they are the first numbers of a fit, each a term of its own
    at = {t.label: k for k, t in enumerate(plain.hypothesis.terms) if t.label in adjustable}
    for term in (*(plain.hypothesis.terms[k] for k in at.values()), *_numbers(fitter.cases)):
        (free,) = term.free
        low, high = _widely(free, scene)
        wide = replace(term, free=(replace(free, low=low, high=high),))
        terms, values = [*plain.hypothesis.terms], plain.values
        k, bounds = at.get(term.label, len(values)), None
        if term.label in at:
            terms[k], bounds = wide, (free.low, free.high)
        else:
            terms, values = [*terms, wide], np.append(values, free.first)
        try:
            again = _from_short_pieces(fitter, Hypothesis(tuple(terms)), values)
        except Failed:
            continue
        left = again.excess / plain.excess
        value, least, most = again.interval(k, max(again.chi2 / again.count, 1.0))
        believed = bounds or (free.first, free.first)
        elsewhere = (most < believed[0] or least > believed[1]) and _inside(wide.free[0], value)
        if elsewhere and left < current().verdict.share and again.chi2 < fit.chi2:
            told = free.name, free.unit, free.first, value, least, most, (), left, wide, True, bounds, True
            found.append((again.chi2, Instead(*told)))
    return [number for _, number in sorted(found, key=lambda entry: entry[0])]


def _inside(free: Free, value: float) -> bool:
    """Whether a number was found inside its bounds: at the end of its search it was not."""
    return free.low < value < free.high and ended_at_bound([(free, value)]) is None


def _widely(free: Free, scene: Scene) -> tuple[float, float]:
    """Where a number is sought outside its bounds: of a size by ratio, of another to both sides."""
    law, _, name = free.name.partition(".")
    p, far = scene.laws_named(law)[0].law.number(name), current().apparatus.outside
    if free.low > 0:
        low, high = free.low / far, free.high * far
    else:
        low, high = free.low - far * (free.high - free.low), free.high + far * (free.high - free.low)
    return max(low, p.low), min(high, p.high)


def _from_short_pieces(fitter: Fitter, hypothesis: Hypothesis, values: np.ndarray) -> Fit:
    """A fit whose numbers come from pieces of the recordings, first the shortest, of which no scene loses its way."""
    for pieces in current().refits.short_pieces:
        found = fitter.in_pieces(pieces).fit(hypothesis, values)
        values = found.values
    return fitter.fit_from(found)


def _as_rate(number: Instead, cases: Sequence[Case]) -> Instead:
    """The stretch of a clock as the frame rate of the films that it stretches."""
    rate = 1.0 / float(np.median(np.concatenate([np.diff(c.t) / c.apart for c in cases])))
    value, low, high = rate / number.value, rate / number.high, rate / number.low
    return replace(number, name="frame rate", unit="1/s", believed=rate, value=value, low=low, high=high)


def declared(recordings: Sequence[Recording], number: Instead) -> list[Recording]:
    """The recordings with a number of their scenes declared adjustable, as far as it was sought."""
    law, _, parameter = number.name.partition(".")
    free = number.term.free[0]
    more = Adjustable(law, parameter, free.low, free.high)

    def freed(scene: Scene) -> Scene:
        return replace(scene, adjustable=tuple(a for a in scene.adjustable if a.name != number.name)).add(more)

    return [replace(r, scene=freed(r.scene)) for r in recordings]


def frame_rate() -> Term:
    """A film whose stamps run slow or fast: a frame stamped t shows the state at rate t."""

    free = Free("camera.rate", "1", 0.5, 2.0, 1.0, current().apparatus.scale, neutral=1.0)
    return Term(CLOCK, CLOCK, (free,), set_camera("rate"), expression="a frame stamped t shows the state at rate t")


def _numbers(cases: Sequence[Case]) -> list[Term]:
    """A term for each number that stands in the laws of all scenes alike and is not adjustable."""
    scenes = [c.recording.scene for c in cases]
    declared = {a.name for s in scenes for a in s.adjustable}
    first, *others = (_given(s) for s in scenes)
    terms = []
    for name, (p, value) in first.items():
        if name not in declared and all(other.get(name) == (p, value) for other in others):
            low, high = sorted((0.5 * value, 2 * value))
            terms.append(adjustable_term(name, p.unit, (max(low, p.low), min(high, p.high)), value, name))
    return terms


def _given(scene: Scene) -> dict[str, tuple[Parameter, float]]:
    """Numbers, but zeros, of the laws that a scene has once, by "law.parameter".

    Not what contacts lose: that has a name of its own. Nor defaults with a unit: they are choices of the model; a
    gain of one or a power of two is what the apparatus is taken for.
    """
    found = {}
    for item in scene.laws:
        for p in item.law.parameters if len(scene.laws_named(item.name)) == 1 else ():
            value = item.values.get(p.name)
            lost = p.name in (item.law.loses, item.law.loses_at_walls)
            if p.size != 1 or p.choices or lost or value == 0 or (value == p.default and p.unit != "1"):
                continue
            if isinstance(value, int | float) and not isinstance(value, bool):
                found[f"{item.name}.{p.name}"] = p, float(value)
    return found
