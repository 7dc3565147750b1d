"""A hypothesis: the naive scene with some parameters free and some terms added; and what it predicts.

A term is a law missing from the list (or a changed parameter, or a part of the camera) with free numbers.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from ..engine import Simulation
from ..errors import BodyLost, InputError, SimulationError
from ..joints import hinged
from ..laws import has_role
from ..recording.camera import see
from ..scene import Adjustable, Scene
from .criteria import current
from .data import Case
from .start import StartBody, numbers_at, states, turning_angle

NO_CAMERA: dict[str, Any] = {
    "scale": 1.0, "tilt": 0.0, "rate": 1.0, "time_offset": 0.0, "bias": (0.0, 0.0), "distortion": 0.0,
    "middle": (0.0, 0.0), "foreshortening": 1.0, "direction": 0.0, "drift": (0.0, 0.0),
    "jump": (0.0, 0.0), "jumped": 0.0, "about": (0.0, 0.0), "zeros": (),
}  # fmt: skip


def clock(camera: Mapping[str, Any], t: Any) -> Any:
    """The time [s] of the scene that frames stamped ``t`` show: rate t + time_offset."""
    return camera["rate"] * t + camera["time_offset"]


def _often_enough(times: np.ndarray, turning: float) -> tuple[np.ndarray, np.ndarray | slice]:
    """Times (T',) [s] so near one another that turns can be counted, and which of them are ``times`` (T,).

    turning : how fast bodies turn [rad/s]
    """
    if not turning:
        return times, slice(None)
    fits = current().fits
    steps = np.ceil(np.clip(np.diff(times) * (turning / fits.turned), 1, fits.between)).astype(np.int64)
    if not (steps > 1).any():
        return times, slice(None)
    at = np.concatenate([[0], np.cumsum(steps)])
    return np.interp(np.arange(at[-1] + 1), at, times), at


@dataclass(frozen=True)
class Free:
    """One number to be found. ``cases``: the names of the recordings it bears on (None: all)."""

    name: str
    unit: str
    low: float
    high: float
    first: float
    scale: float
    cases: frozenset[str] | None = None
    neutral: float = 0.0  # where the term is absent
    natural: bool = False  # its bounds are those of nature (a restitution of one), and may be the answer
    inner: bool = False  # shapes the term (a range, an exponent) and shows only when its strength is not zero
    ordinary: float = 0.0  # distance from ``neutral`` up to which it is what laboratories are off by
    unseen: float = 0.0  # standard deviation about ``neutral`` that a careful laboratory does not notice, 0: none
    usual: float = 0.0  # the same of what is told in its own terms, as a mass or a length of the picture is
    prior: float = 0.0  # standard deviation about ``neutral`` that it was believed with beforehand, 0: nothing was
    follows: str = ""  # the number of the scene that it is equal to where the term is absent
    span: float = 0.0  # of a limit: how far above the lower bound it is looked for at first, 0: all the way

    @property
    def error(self) -> float:
        """Standard deviation by which any laboratory is off in it, 0 where it is no error of an apparatus."""
        return self.usual or self.unseen


# scene, camera and values to the scene and the camera with them
Apply = Callable[[Scene, Mapping[str, Any], Sequence[float] | np.ndarray], tuple[Scene, Mapping[str, Any]]]


@dataclass(frozen=True)
class Term:
    """Something added to the scene or the camera: ``apply(scene, camera, values)`` gives both changed."""

    mechanism: str
    label: str
    free: tuple[Free, ...]
    apply: Apply
    bodies: tuple[str, ...] | None = None
    expression: str = ""
    choices: Mapping[str, Any] = field(default_factory=dict)
    groups: tuple[tuple[str, tuple[int, ...]], ...] = ()  # verdict parameter -> numbers that make it up
    law: str = ""  # name of the law that it is made of
    suited: bool = False  # its law is declared for an apparatus that the recordings have: it goes before its equals
    fixed: Mapping[str, tuple[Any, str]] = field(default_factory=dict)  # value and unit of what the recording gives
    # numbers that are the size of a vector along a unit direction, by their names: all of it that the data see
    along: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    special: bool = False  # a special fault of the apparatus: of equals with as many numbers the plain one is named
    last: bool = False  # it acts on what all other terms leave, wherever it stands

    @property
    def recordings(self) -> frozenset[str] | None:
        """Names of the recordings that all its numbers bear on alone; None where one bears on all there are."""
        named = [f.cases for f in self.free if f.cases is not None]
        return frozenset[str]().union(*named) if self.free and len(named) == len(self.free) else None


@dataclass(frozen=True)
class Hypothesis:
    """Terms on top of the naive scene; ``dt`` is one for all, so that differences are smooth."""

    terms: tuple[Term, ...] = ()

    @property
    def free(self) -> tuple[Free, ...]:
        return tuple(f for term in self.terms for f in term.free)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest of all free numbers, (p,) each."""
        return np.array([f.low for f in self.free]), np.array([f.high for f in self.free])

    @property
    def believed(self) -> list[int]:
        """Which numbers have a prior: those of the apparatus that are known, but not exactly."""
        return [k for k, f in enumerate(self.free) if f.prior]

    @property
    def owner(self) -> dict[int, str]:
        """Of the numbers with a prior that are a radius or mass of one body, which body."""
        of_term = [term for term in self.terms for _ in term.free]
        return {k: bodies[0] for k in self.believed if len(bodies := of_term[k].bodies or ()) == 1}

    def rows(self, label: str) -> slice:
        """Where the numbers of the term with this label lie among those of all; raises KeyError where there is none."""
        at = 0
        for term in self.terms:
            if term.label == label:
                return slice(at, at + len(term.free))
            at += len(term.free)
        raise KeyError(label)

    def priors(self, case: Case, values: Sequence[float] | np.ndarray) -> np.ndarray:
        """(k,) of the numbers with a prior that bear on a recording, how far they are off it in standard deviations.

        Their squares belong to chi2. What several recordings share counts in each for its part.
        """
        found = [
            (f.neutral - float(v)) / (f.prior * math.sqrt(len(f.cases or (case.name,))))
            for v, f in zip(values, self.free, strict=True) if f.prior and (f.cases is None or case.name in f.cases)
        ]  # fmt: skip
        return np.array(found)

    def followed(self, term: Term, values: Sequence[float] | np.ndarray) -> Term:
        """The term, absent where its numbers are equal to those of mine that they follow."""
        mine = {f.name: float(v) for f, v in zip(self.free, values, strict=True)}
        if not any(f.follows in mine for f in term.free):
            return term
        moved = {f.name: mine.get(f.follows, f.neutral) for f in term.free}
        free = tuple(
            replace(f, neutral=moved[f.name], first=f.first + moved[f.name] - f.neutral) for f in term.free
        )
        return replace(term, free=free)

    def with_term(self, *terms: Term) -> Hypothesis:
        return Hypothesis(self.terms + terms)

    def turns(self, case: Case) -> bool:
        """Whether disks are made to spin, and spin matters to them: what one segment ends with the next begins with."""
        return any(has_role(t.law, "spin") for t in self.terms) or bool(case.recording.scene.laws_as("spin"))

    def scene(self, case: Case, values: Sequence[float] | np.ndarray) -> tuple[Scene, Mapping[str, Any]]:
        """Scene and camera of a recording under these values."""
        scene: Scene = case.recording.scene
        camera: Mapping[str, Any] = NO_CAMERA
        at, rows = 0, list[tuple[Term, int]]()
        for term in self.terms:
            rows.append((term, at))
            at += len(term.free)
        for term, at in sorted(rows, key=lambda row: row[0].last):
            if _bears_on(term, case):
                scene, camera = term.apply(scene, camera, values[at : at + len(term.free)])
        return scene, camera


def _bears_on(term: Term, case: Case) -> bool:
    return not term.free or any(f.cases is None or case.name in f.cases for f in term.free)


def adjustable_terms(cases: Sequence[Case]) -> tuple[Term, ...]:
    """One term for every ``[[adjustable]]`` of the recordings (each of its copies, per body or recording)."""
    terms: dict[str, Term] = {}
    for case in cases:
        scene = case.recording.scene
        for a in scene.adjustable:
            parameter = scene.laws_named(a.law)[0].law.number(a.parameter)
            if parameter.size != 1 or parameter.choices:
                raise InputError("only a single number can be adjustable", where=f"adjustable {a.name}")
            copies: list[tuple[str, tuple[str, ...] | None, frozenset[str]]]
            if a.per == "recording":
                copies = [(f"{a.name}@{case.name}", None, frozenset([case.name]))]
            elif a.per == "body":
                acting = [scene.bodies[k].id for u in scene.laws_named(a.law) for k in scene.rows(u)]
                copies = [
                    (f"{a.name}[{b}]", (b,), frozenset(c.name for c in cases if b in c.recording.scene.ids))
                    for b in acting
                ]
            else:
                where = frozenset(c.name for c in cases if a in c.recording.scene.adjustable)
                copies = [(a.name + own, bodies, where) for own, bodies in _sharing(scene, a)]
            for name, bodies, where in copies:
                if name in terms:
                    continue
                first = float(np.clip(_believed(scene, a, bodies), a.low, a.high))
                terms[name] = adjustable_term(name, parameter.unit, (a.low, a.high), first, a.name, bodies, where)
    return tuple(terms.values())


def _believed(scene: Scene, number: Adjustable, bodies: tuple[str, ...] | None) -> float:
    """What is believed of an adjustable number, for some bodies or all."""
    for item in scene.laws_named(number.law):
        if bodies is None or item.bodies is None or set(bodies) & set(item.bodies):
            return float(scene.number(item, number.parameter))
    raise InputError("no body has it", where=f"adjustable {number.name}")


def _sharing(scene: Scene, number: Adjustable) -> list[tuple[str, tuple[str, ...] | None]]:
    """Who shares an adjustable number: all, or the bodies of each of several laws of which it is believed to differ.

    Two springs that are believed to be of 8 and 12 N/m have no stiffness in common; one of 50 N/m that may be adjusted
    up to 20 N/m is not meant. With what tells their names apart.
    """
    uses = scene.laws_named(number.law)
    owners = [item.bodies or () for item in uses]
    apart = all(owners) and sum(map(len, owners)) == len({b for names in owners for b in names})
    believed = [_believed(scene, number, names) for names in owners] if apart else list[float]()
    if len(set(believed)) < 2:
        return [("", None)]
    meant = [n for n, value in zip(owners, believed, strict=True) if number.low <= value <= number.high]
    return [(f"[{', '.join(names)}]", names) for names in meant or owners]


def adjustable_term(
    name: str, unit: str, bounds: tuple[float, float], first: float, number: str, bodies: tuple[str, ...] | None = None,
    where: frozenset[str] | None = None,
) -> Term:  # fmt: skip
    """The term of a number of a scene's law, "law.parameter", of some bodies or all, in some recordings or all."""
    low, high = bounds
    free = Free(name, unit, low, high, first, current().candidates.adjustable * (high - low), where)
    return Term("adjustable", name, (free,), set_numbers((number,), bodies), bodies=bodies, expression=name)


def set_numbers(names: Sequence[str], bodies: tuple[str, ...] | None = None) -> Apply:
    """Puts values in the place of numbers of the scene's laws, "law.parameter" each, of some bodies or all."""

    def apply(scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        present = None if bodies is None else [b for b in bodies if b in scene.ids]
        for name, value in zip(names, values, strict=True):
            scene = scene.with_parameter(name, float(value), bodies=present)
        return scene, camera

    return apply


def set_camera(key: str) -> Apply:
    """Puts the value, or the values, in the place of one of the camera's (``NO_CAMERA``)."""

    def apply(scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        value = float(values[0]) if len(values) == 1 else tuple(float(v) for v in values)
        return scene, {**camera, key: value}

    return apply


def equation_with(expression: str, numbers: Iterable[tuple[str, Any, str]]) -> str:
    """An equation with its numbers: (name, value, unit) each."""
    shown = with_units(numbers)
    return f"{expression}; {shown}" if shown else expression


def with_units(numbers: Iterable[tuple[str, Any, str]]) -> str:
    """Numbers in a line: (name, value, unit) each."""

    def said(value: Any) -> str:
        if isinstance(value, list | tuple):
            return "[" + ", ".join(said(v) for v in value) + "]"
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    return ", ".join(
        f"{name} = {said(value)}" + (f" {unit}" if unit not in ("1", "") else "") for name, value, unit in numbers
    )


FLEW_OFF = "a body is not within"  # how a failure begins that says so
NO_NUMBERS = "numbers that no law takes"


class Failed(Exception):
    """A run that could not be finished: a reason, never a number in the likelihood."""


def left_out(failures: Sequence[str]) -> str:
    """For the reader what runs that could not be finished were, each told as "recording: why"."""
    flown = [why for why in failures if f": {FLEW_OFF} " in why]
    beyond = [why for why in failures if f": {NO_NUMBERS}: " in why]
    plain = {*flown, *beyond}
    others = [why for why in failures if why not in plain]
    kinds = [(len(flown), "bodies flew off there"), (len(beyond), "no law takes numbers such as theirs")]
    if others:
        why = f"it could not be followed to the end: {others[0]}"
        if len(others) > 1:
            why = f"they could not be followed to the end, the first: {others[0]}"
        kinds.append((len(others), why))
    kinds = [(count, why) for count, why in kinds if count]
    first = [f"{_scenes(count)} left out of the search, as {why}" for count, why in kinds[:1]]
    return "; ".join([*first, *(f"{count} more, as {why}" for count, why in kinds[1:])])


def _scenes(count: int) -> str:
    return f"{count} trial scene{' was' if count == 1 else 's were'}"


@dataclass(frozen=True)
class End:
    """What a run ends with: the free numbers (m,) of the start that comes after, and the spins (n,) [rad/s]."""

    numbers: np.ndarray
    spin: np.ndarray


@dataclass(frozen=True)
class Beginning:
    """With what a run begins, and the start that comes after it.

    starts, numbers : description of the start, and its free numbers;  t0 [s] : when it is
    following : time [s] and description of a start that comes after;  spin : (n,) of the scene's bodies to begin with
    [rad/s], none where not given
    """

    starts: tuple[StartBody, ...]
    numbers: np.ndarray
    t0: float
    following: tuple[float, tuple[StartBody, ...]] | None = None
    spin: np.ndarray | None = None


@dataclass
class Predictor:
    """Simulates recordings under a hypothesis and looks at them as the camera does.

    short : its runs are so short that threads gain nothing, see ``steps.short``
    """

    dt: Mapping[str, float]
    short: bool = False
    runs: int = 0
    failures: list[str] = field(default_factory=list)
    _last: _Last = field(default_factory=lambda: _Last(), repr=False)
    _kept: _Kept = field(default_factory=lambda: _Kept(), repr=False)
    _counted: Predictor | None = field(default=None, repr=False)  # who counts its runs, where it does not itself
    _others: dict[float, Predictor] = field(default_factory=dict, repr=False)  # by times the step

    def with_steps(self, times: float) -> Predictor:
        """The same with steps ``times`` as long. Its failures are its own: what it is asked for can be had without."""
        dt = {name: times * dt for name, dt in self.dt.items()}
        found = self._others.get(times)
        if found is None or found.dt != dt:
            found = self._others[times] = Predictor(dt, self.short, _kept=self._kept, _counted=self)
        return found

    def __call__(
        self,
        hypothesis: Hypothesis,
        case: Case,
        values: Sequence[float] | np.ndarray,
        starts: tuple[StartBody, ...],
        numbers: np.ndarray,
        t0: float,
        t: np.ndarray,
    ) -> np.ndarray:
        """Predicted channels (T, c) at frame times ``t``, the first of which is ``t0``. Raises Failed."""
        return self.run(hypothesis, case, values, Beginning(starts, numbers, t0), t)[0]

    def run(
        self, hypothesis: Hypothesis, case: Case, values: Sequence[float] | np.ndarray, begin: Beginning, t: np.ndarray
    ) -> tuple[np.ndarray, End | None]:
        """Predicted channels (T, c) at frame times ``t``, and the start that the run ends with. Raises Failed."""
        when, after = begin.following or (None, ())
        spin = () if begin.spin is None else begin.spin
        numbered = [np.asarray(part, dtype=float).tobytes() for part in (values, begin.numbers, spin)]
        terms = tuple(map(id, hypothesis.terms))
        times = (begin.t0, hash(t.tobytes()), when, self.dt[case.name])
        key = (id(case), id(begin.starts), id(after), *terms, *times, *numbered)
        known = self._kept.get(key)
        if known is None:
            known = self._ran(hypothesis, case, values, begin, t)
            self._kept.put(key, (case, hypothesis.terms, begin.starts, after), known)
        return known[0].copy(), known[1]

    def _ran(
        self, hypothesis: Hypothesis, case: Case, values: Sequence[float] | np.ndarray, begin: Beginning, t: np.ndarray
    ) -> tuple[np.ndarray, End | None]:
        """As ``run``, by a simulation."""
        starts, numbers, t0 = begin.starts, begin.numbers, begin.t0
        following, spin = begin.following, begin.spin
        if spin is None and hypothesis.turns(case):
            spin = case.spins_at(t0)
        try:
            scene, camera = self._scene(hypothesis, case, values)
            begins = float(clock(camera, t0))
            placed = states(starts, numbers, scene, begins)
        except InputError as error:  # numbers that a search tried and no law takes
            self.failures.append(f"{case.name}: {NO_NUMBERS}: {error}")
            raise Failed(str(error)) from None
        (self._counted or self).runs += 1
        # angles of hinged bodies follow from the places of those that they hang from
        rows = [scene.ids.index(b) for b in dict.fromkeys((*case.bodies, *hinged(scene)))]
        times, at_frames = _often_enough(np.maximum(clock(camera, t), begins), case.turning)
        end = None
        try:
            with np.errstate(all="ignore"):
                simulation = self._simulation(hypothesis, case, values, scene, placed, begins, spin)
                if following is None:
                    xy = simulation.sample(times, rows)
                else:
                    ends, after = float(clock(camera, following[0])), following[1]
                    xy = simulation.sample(np.append(times, ends), rows)[:-1]
                    end = _end_of(simulation, scene, ends, after)
        except (SimulationError, InputError) as error:
            self._leave(hypothesis, case, values)
            why = f"{FLEW_OFF} {current().fits.escaped:g} m" if isinstance(error, BodyLost) else str(error)
            self.failures.append(f"{case.name}: {why}")
            raise Failed(str(error)) from None
        if not (np.abs(xy) < current().fits.escaped).all():  # so also where one is not a number
            self._leave(hypothesis, case, values)
            why = f"{FLEW_OFF} {current().fits.escaped:g} m"
            self.failures.append(f"{case.name}: {why}")
            raise Failed(why)
        between, xy = xy, xy[at_frames]
        seen = xy
        if camera is not NO_CAMERA:
            shows = {key: value for key, value in camera.items() if key not in ("rate", "time_offset", "zeros")}
            seen = see(xy, since=t - case.t[0], **shows)
        at, zeros = {b: k for k, b in enumerate(case.bodies)}, dict(camera["zeros"])
        out = np.empty((len(t), len(case.channels)))
        for c, channel in enumerate(case.channels):
            k = at[channel.body]
            if channel.kind == "angle":
                angle = turning_angle(between, rows, scene, channel.body)[at_frames] + camera["tilt"]
                angle = angle + zeros.get(channel.body, 0.0)
                # the same turn as the start that was asked for
                first = next(s for s in starts if s.body == channel.body)
                asked = numbers[_offset(starts, channel.body)] if first.free[0] else first.first[0]
                out[:, c] = angle + 2 * np.pi * round((asked - angle[0]) / (2 * np.pi))
            else:
                out[:, c] = seen[:, k, 0 if channel.kind == "x" else 1]
        return out, end

    def _key(self, hypothesis: Hypothesis, case: Case, values: Sequence[float] | np.ndarray) -> tuple[Any, ...]:
        """What runs have in common that differ in the start alone."""
        terms = tuple(map(id, hypothesis.terms))
        return id(case), self.dt[case.name], terms, np.asarray(values, dtype=float).tobytes()

    def _scene(
        self, hypothesis: Hypothesis, case: Case, values: Sequence[float] | np.ndarray
    ) -> tuple[Scene, Mapping[str, Any]]:
        """Scene and camera under these values: the last ones where only the start is another, as all segments ask."""
        key, last = self._key(hypothesis, case, values), self._last
        if last.scene is None or last.scene[0] != key:
            last.scene = key, (case, hypothesis.terms), hypothesis.scene(case, values)
        return last.scene[2]

    def _leave(self, hypothesis: Hypothesis, case: Case, values: Any) -> None:
        """The simulation of these runs is not begun again, see ``Simulation.restart``."""
        self._last.begun.pop(self._key(hypothesis, case, values)[:3], None)

    def _simulation(
        self, hypothesis: Hypothesis, case: Case, values: Any, scene: Scene, placed: Mapping[str, Any], t0: float,
        spin: np.ndarray | None,
    ) -> Simulation:  # fmt: skip
        """A simulation that stands at its start: one of the last begun again where only the start, or a law's numbers,
        are others.

        Most runs of a fit differ in nothing else, and building a simulation takes longer than running it. Derivatives
        of fits that go on side by side come to a thread in turn, so that it keeps several.
        """
        key, begun = self._key(hypothesis, case, values), self._last.begun
        begin = np.array([placed.get(b.id, b.initial) for b in scene.bodies], dtype=float)
        alike = key[:3] if key[:3] in begun else next(reversed(begun), None)
        last = begun.pop(alike, None)  # until it stands
        if last is not None and (
            last.key == key
            or (last.key[1] == key[1] and _but_for_laws(last.scene, scene) and last.simulation.retune(scene.laws))
        ):
            last.simulation.restart(begin[:, :2], begin[:, 2:], t0, spin)
            begun[key[:3]] = _Begun(key, (case, hypothesis.terms), last.simulation, scene)
            return last.simulation
        if last is not None and alike != key[:3]:
            begun[alike] = last
        whole = replace(scene.with_initial(placed), time=replace(scene.time, start=t0, dt=self.dt[case.name]))
        simulation = Simulation(whole, averaged=True, stretch=current().fits.stretch)
        if simulation.mode == "verlet":
            begun[key[:3]] = _Begun(key, (case, hypothesis.terms), simulation, scene)
            if len(begun) > current().fits.begun:
                del begun[next(iter(begun))]
            if spin is not None:
                simulation.restart(begin[:, :2], begin[:, 2:], t0, spin)
        return simulation


_BUT_LAWS = tuple(f.name for f in fields(Scene) if f.name != "laws")


def _but_for_laws(one: Scene | None, other: Scene) -> bool:
    """Whether two scenes have all but their laws in common, as one that was made of the other by other laws.

    Bodies are compared by what they are: those of fitted masses and radii are made anew for every run.
    """
    pairs = ((getattr(one, name), getattr(other, name)) for name in _BUT_LAWS) if one is not None else ()
    return one is not None and all(mine is theirs or mine == theirs for mine, theirs in pairs)


def _end_of(simulation: Simulation, scene: Scene, time: float, starts: tuple[StartBody, ...]) -> End:
    """The start at a time that the simulation has just reached, or is less than a step before."""
    state = simulation.state()
    ahead = time - state.t
    mass = np.array([b.mass for b in scene.bodies])
    v = state.v + simulation.forces() / mass[:, None] * ahead
    return End(numbers_at(starts, scene, state.xy + v * ahead, v), np.array(state.spin))


class _Kept:
    """The last runs: a fit begins where another ended, and ends where its derivatives were taken."""

    def __init__(self) -> None:
        self._runs: dict[Any, tuple[Any, tuple[np.ndarray, End | None]]] = {}
        self._bytes = 0
        self._lock = threading.Lock()

    def get(self, key: Any) -> tuple[np.ndarray, End | None] | None:
        with self._lock:
            found = self._runs.get(key)
        return None if found is None else found[1]

    def put(self, key: Any, held: Any, run: tuple[np.ndarray, End | None]) -> None:
        """``held``: what the key speaks of by id, so that nothing else gets it."""
        with self._lock:
            if key not in self._runs:
                self._runs[key] = held, run
                self._bytes += run[0].nbytes
            while self._bytes > current().work.predictions:
                self._bytes -= self._runs.pop(next(iter(self._runs)))[1][0].nbytes


@dataclass(frozen=True)
class _Begun:
    """A simulation and what it was built for."""

    key: tuple[Any, ...]
    held: tuple[Any, ...]  # what the key speaks of, so that nothing else gets its id
    simulation: Simulation
    scene: Scene  # what it runs, but for the start


class _Last(threading.local):
    """The simulations and the scene that this thread used last."""

    def __init__(self) -> None:
        self.begun: dict[Any, _Begun] = {}  # the latest one at the end
        # its key, what that speaks of, and camera
        self.scene: tuple[Any, Any, tuple[Scene, Mapping[str, Any]]] | None = None


def _offset(starts: tuple[StartBody, ...], body: str) -> int:
    at = 0
    for start in starts:
        if start.body == body:
            return at
        at += int(start.free.sum())
    raise KeyError(body)
