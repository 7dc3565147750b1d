"""What is written of whole tracks: entries of the laws that were found, revised scenes, how recordings were used."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...laws import all_laws, has_role
from ...scene import Scene
from ...scene.parts import STANDARD_GRAVITY
from ..candidates import distinct_bodies, joints_by_body, names_of, owners, weighed
from ..criteria import current
from ..data import Case, with_gravity
from ..hypothesis import Free, Term, clock, equation_with, with_units
from ..mechanisms import nameless
from ..pushes import told_as, with_form
from ..result import HELD_OUT, PARTLY, TRAINING, Used, handed_over, mechanism_entry
from ..start import describe_starts, first_numbers, states
from ..swimmer_terms import is_components, reported_parameters
from .at_distance import force_where_seen
from .fitted import Fit
from .intervals import with_shape_held
from .name import Trial

Written = tuple[Any, Any, Any, str]  # value, low, high, unit


def at_its_bound(number: Free, value: float) -> str:
    """That an adjustable number would have gone on, so that what is named may do its part."""
    unit = "" if number.unit in ("", "1") else f" {number.unit}"
    return (
        f"{number.name} ended at {value:.4g}{unit}, where it may not go on ({number.low:.4g} to {number.high:.4g}): "
        "what is named may stand for the rest of it"
    )


def below(trials: Sequence[Trial], spread: float) -> list[str]:
    """How large a law of one strength may be where none was found, by its 95 % interval.

    trials : laws that were fitted alone, each told once;  spread : inflation of their variances
    """
    told: dict[str, str] = {}
    for trial in trials:
        fit, (free, *more) = trial.fit, trial.term.free
        if fit is None or more or free.inner or trial.mechanism in told or trial.term.law not in all_laws():
            continue
        _, low, high = fit.interval(fit.hypothesis.rows(trial.label).start, spread)
        most = max(abs(low - free.neutral), abs(high - free.neutral))
        if free.neutral == 0 and math.isfinite(most) and low < free.high and (high < free.high or free.natural):
            unit = "" if free.unit in ("", "1") else f" {free.unit}"
            told[trial.mechanism] = f"{trial.mechanism}.{free.name.rpartition('.')[2]} = {most:.2g}{unit}"
    most_of = ", ".join(told.values())
    return [f"with 95 % confidence no more than this may be there, each alone: {most_of}"] if told else []


def beside_its_own(entries: Sequence[Mapping[str, Any]], cases: Sequence[Case]) -> list[str]:
    """That a law which is named is one that the scene has already: how strong both are together.

    Forces of one law add up where its strengths alone differ, and what else it takes is the same in both.
    """
    notes, scenes = [], [case.recording.scene for case in cases]
    for entry in entries:
        law, numbers = all_laws().get(str(entry["name"])), entry["parameters"]
        own = scenes[0].laws_named(str(entry["name"]))
        if law is None or len(own) != 1 or any(scene.laws != scenes[0].laws for scene in scenes):
            continue
        values, bodies = scenes[0].resolved(own[0]), own[0].bodies or names_of(cases)
        others = [name for name in numbers if name not in law.strength]
        told = {name: numbers[name]["value"] for name in law.strength if name in numbers}
        if set(bodies) != set(entry["bodies"]) or any(numbers[name]["value"] != values.get(name) for name in others):
            continue
        if not told or any(isinstance(value, list) or name not in values for name, value in told.items()):
            continue
        before = with_units((name, values[name], numbers[name]["unit"]) for name in told)
        both = with_units((name, values[name] + value, numbers[name]["unit"]) for name, value in told.items())
        notes.append(f"{law.name} stands in the scene already, with {before}: together {both}")
    return notes


def as_the_picture(entries: Sequence[Mapping[str, Any]], cases: Sequence[Case]) -> list[str]:
    """What a push along gravity is the same as: a picture of another scale, of another frame rate, or upside down.

    x = s x' and t = r t' make s/r^2 of an acceleration; s only of bodies that nothing but gravity holds, r where
    nothing else says how fast they are (a spring, a motor). A pendulum swings by g/l: where its bob is no point, l is
    I/(m d), and no ruler tells it.
    """
    notes: list[str] = []
    scenes = [case.recording.scene for case in cases]
    gravity = np.array(scenes[0].gravity)
    size = float(np.linalg.norm(gravity))
    if not size or any(tuple(scene.gravity) != tuple(gravity) for scene in scenes):
        return notes
    falls = weighed(cases)
    timed = any(scene.laws_as(role) for scene in scenes for role in ("tether", "command"))  # by more than gravity
    for entry in entries:
        law = all_laws().get(str(entry["name"]))
        if law is None or not has_role(law.name, "push"):
            continue
        a = np.array(entry["parameters"][law.strength[0]]["value"], float)
        seen = float((gravity + a) @ gravity) / size**2
        across = float(np.linalg.norm(a - gravity * (a @ gravity) / size**2))
        ordinary = current().verdict.ordinary
        if across > ordinary * float(np.linalg.norm(a)):
            if float(np.linalg.norm(a)) < ordinary * size:
                turned = math.degrees(math.atan2(across, seen * size))
                total = float(np.linalg.norm(gravity + a)) / size
                notes.append(
                    f"with {law.name} gravity is {total:.4g} times that of the scene, turned by {turned:.2g} degrees: "
                    f"a camera that hangs askew by as much, and lengths off by {100 * abs(total - 1):.2g} %, look so"
                )
            continue
        if abs(1 + seen) < ordinary:
            notes.append(
                f"{law.name} turns gravity round: bodies fall against it, with {-seen * size:.3g} m/s^2; tracks whose "
                "axis is counted the other way look so (rows of a picture are counted downwards)"
            )
        elif abs(seen) < ordinary and falls:
            notes.append(
                f"{law.name} takes gravity away: bodies neither gain nor lose speed, as where they have come to the "
                "speed at which a drag bears their weight, c = m g/v"
            )
        elif seen > 0 and not timed:
            scaled = f"lengths times {1 / seen:.3g}, or " if falls else ""
            share = 100 * (1 - seen)
            borne = f"; so would a medium that bears {share:.0f} % of the weight" if falls and seen < 1 else ""
            if seen < 1:
                rolls = ", as of what rolls (a ball 1.4, a disk 1.5)" if 1 / seen > 1 + 2 * ordinary else ""
                borne += f"; so would an inertia of {1 / seen:.3g} masses{rolls}"
            rods = {float(scene.resolved(i)["length"]) for scene in scenes for i in scene.laws_as("pendulum")}
            if len(rods) == 1:
                scaled = f"a pendulum {min(rods) / seen:.3g} m long in place of {min(rods):.3g} m, or "
            notes.append(
                f"{law.name} lies along gravity: bodies fall with {seen * size:.3g} m/s^2 where {size:.3g} is "
                f"believed; {scaled}a frame rate times {seen**-0.5:.3g} would make that right as well{borne}"
            )
    return notes


def as_a_push(entries: Sequence[Mapping[str, Any]], cases: Sequence[Case], forms: Collection[str]) -> list[str]:
    """What a stream is where all bodies have one mass: a drag and a push as well, -c (v - u) = -c v + m a, a = c u/m.

    A push against gravity g is that of a larger inertia, too, as of a ball that sinks: g - a = g/(1 + beta).
    forms : laws that were found; another form of a stream, whose drag is no line, is no sum of such two
    """
    masses = {mass for name, _, mass in distinct_bodies(cases)}
    flat = not with_gravity(cases)
    notes: list[str] = []
    for entry in entries:
        law = all_laws().get(str(entry["name"]))
        numbers = entry["parameters"]
        if law is None or law.name not in forms or law.role != "medium" or not law.linear:
            continue
        if len(masses) != 1 or not {"c", "u"} <= set(numbers):
            continue
        a = float(numbers["c"]["value"]) * np.array(numbers["u"]["value"], float) / min(masses)
        size = float(np.hypot(*a))
        slope = min(size / STANDARD_GRAVITY, 1.0)
        gravity = np.array(cases[0].recording.scene.gravity)
        borne = -float(a @ gravity) / max(float(gravity @ gravity), 1e-300)  # of its weight
        heavier = ""
        if 0 < borne < 1 and float(np.linalg.norm(a + borne * gravity)) < current().verdict.ordinary * size:
            more = 1 / (1 - borne)
            drag = more * float(numbers["c"]["value"])
            heavier = f", and as an inertia of {more:.3g} masses with c = {drag:.3g} kg/s, as of what sinks in a liquid"
        level = f", as of a table that leans by {math.degrees(math.asin(slope)):.2g} degrees" if flat else ""
        notes.append(
            f"{law.mechanism} is the same as {law.nests[0]} with this c and a push on all bodies of "
            f"({a[0]:.3g}, {a[1]:.3g}) m/s^2{level}{heavier}: no motion of bodies of one mass tells them apart"
        )
    return notes


def as_a_spring(trial: Trial, fit: Fit, cases: Sequence[Case]) -> list[str]:
    """That a smooth field is nearly a spring where one body was seen: F = -k (x - c), by least squares over its places.

    Of what a rail or another law of the scene holds, for which no law with a name is asked that draws it to a point.
    Along a line, one component.
    """
    law = all_laws().get(trial.term.law)
    bodies = owners(trial.term) or tuple({b.id for c in cases for b in c.recording.scene.bodies if b.mobile})
    if law is None or not has_role(law.name, "place") or len(bodies) != 1:
        return []
    values = fit.values[fit.hypothesis.rows(trial.label)]
    numbers = dict(zip((f.name.split(".")[-1] for f in trial.term.free), values, strict=True))
    given: dict[str, Any] = {}
    for p in law.parameters:
        at = trial.term.fixed[p.name][0] if p.name in trial.term.fixed else p.default
        given |= dict(zip(p.arguments, map(float, np.atleast_1d(at if at is not None else 0.0)), strict=False))
    given |= dict(trial.term.choices) | numbers | {name: 0.0 for name in ("vx", "vy") if name in law.arguments}
    told, places, masses = current().verdict, list[np.ndarray](), list[float]()
    for case in (c for c in cases if bodies[0] in c.recording.ids):
        if any(bodies[0] in ids for ids in case.recording.scene.joints_of.values()):
            return []  # along a rod no force shows
        seen = case.recording.on_rails().xy[case.training, case.recording.ids.index(bodies[0])]
        places += list(seen[np.isfinite(seen).all(axis=1)])
        masses += [case.recording.scene.body(bodies[0]).mass] * (len(places) - len(masses))
    if len(places) < len(numbers):  # of a body whose angle alone was seen there are none
        return []
    where = np.array(places)
    middle = where.mean(axis=0)
    _, spread, axes = np.linalg.svd(where - middle, full_matrices=False)
    axes = axes[spread > told.line * spread[0]]  # along a line what acts across it was not seen
    where = middle + (where - middle) @ axes.T @ axes
    weighed = ["mass"] if "mass" in law.arguments else []
    force = np.array(
        [law.function(**given, x=x, y=y, **dict.fromkeys(weighed, m)) for (x, y), m in zip(where, masses, strict=True)]
    )
    at, along = (where - middle) @ axes.T, force @ axes.T
    # -k (x - c) = f - k x: one stiffness, a force at the middle for each component
    n, d = at.shape
    design = np.column_stack([-at.T.ravel(), np.kron(np.eye(d), np.ones((n, 1)))])
    (stiffness, *at_middle), *_ = np.linalg.lstsq(design, along.T.ravel(), rcond=None)
    left = along.T.ravel() - design @ [stiffness, *at_middle]
    if stiffness <= 0 or left @ left > told.field * np.sum((along - along.mean(axis=0)) ** 2):
        return []
    x, y = middle + (np.array(at_middle) / stiffness) @ axes
    return [
        f"where {bodies[0]} was seen this field is nearly a spring to ({x:.3g}, {y:.3g}) m with {stiffness:.3g} N/m: "
        "the scene may lack one"
    ]


def _offset(fit: Fit, trial: Trial) -> int:
    """Where the numbers of a trial's term begin among those of the fit."""
    at = 0
    for term in fit.hypothesis.terms:
        if term.label == trial.term.label and term.mechanism == trial.mechanism:
            return at
        at += len(term.free)
    raise KeyError(trial.term.label)


@dataclass(frozen=True)
class Told:
    """The revised fit, told as entries of ``mechanisms``; spread: inflation of its variances."""

    fit: Fit
    spread: float
    cases: Sequence[Case]

    def entries(self, trial: Trial, gain: float | None) -> list[dict[str, Any]]:
        """The entries of one law: one, or one for each body that has a strength of its own."""
        offset, term, untold = _offset(self.fit, trial), trial.term, self.untold(trial)
        bodies = owners(term)
        # a joint is named by the bodies that it joins
        known = all_laws().get(term.law)
        of_joint = known is not None and known.kind == "joint"
        joints = {b: list(names) for b, names in joints_by_body(self.cases).items()} if of_joint else {}
        acting = list(dict.fromkeys(b for names in joints.values() for b in names))
        acting = acting or list(term.bodies if term.bodies is not None else names_of(self.cases))
        entries = []
        for owner in list[str | None](bodies) or [None]:
            parameters: dict[str, Written] = {}
            if is_components(term):
                both = slice(offset, offset + len(term.free))
                covariance = self.fit.covariance[both, both] * self.spread
                parameters |= reported_parameters(term, self.fit.values[both], covariance)
            for name, rows in () if is_components(term) else term.groups:
                mine = [r for r in rows if r < 0 or owner is None or term.free[r].name.endswith(f"[{owner}]")]
                if any(r >= 0 for r in mine):
                    parameters[name] = self._parameter(offset, term, mine, untold)
            for name, (value, unit) in ({k: (v, "1") for k, v in term.choices.items()} | dict(term.fixed)).items():
                parameters[name] = (value, None, None, unit)
            said = term.expression
            if nameless(trial.mechanism):
                parameters, said = self._of_what_shows(term, parameters)
            expression = equation_with(said, ((k, p[0], p[3]) for k, p in parameters.items()))
            on_all = owner is None and set(acting) == set(names_of(self.cases))
            parameters = with_form(term.law, parameters, on_all, [case.recording.scene for case in self.cases])
            expression += told_as(parameters)
            if owner is None:
                expression += force_where_seen(term, self.fit, offset, self.spread, self.cases)
            shown = [r for r, f in enumerate(term.free) if f.name in term.along]
            mine = [r for r in shown if owner is None or term.free[r].name.endswith(f"[{owner}]")]
            expression += "".join(self._seen_along(offset, term, r) for r in mine)
            entries.append(
                mechanism_entry(
                    trial.mechanism, expression, acting if owner is None else joints.get(owner, [owner]), parameters,
                    trial.signature.surviving, gain,
                )
            )  # fmt: skip
        return entries

    def untold(self, trial: Trial) -> list[int]:
        """Numbers of the shape of a law with a name that may be anything that was sought: nothing tells them."""
        if nameless(trial.mechanism):
            return []
        told, offset = [], _offset(self.fit, trial)
        for r, free in enumerate(trial.term.free):
            _, low, high = self.fit.interval(offset + r, self.spread)
            if free.inner and math.isfinite(free.high - free.low) and _anything(free, low, high):
                told.append(r)
        return told

    def _of_what_shows(self, term: Term, parameters: Mapping[str, Written]) -> tuple[dict[str, Written], str]:
        """Numbers and expression of a form without a name, without those that change nothing of what was seen.

        Nor is a width told of a number that may be anything that was sought, or a coordinate that no body has.
        """
        told, said, rows_of = dict(parameters), term.expression, dict(term.groups)
        kinds = {channel.kind for case in self.cases for channel in case.channels}
        unseen = set("xy") - kinds if kinds and kinds < set("xy") else set[str]()
        for name, (value, low, high, unit) in parameters.items():
            rows = [r for r in rows_of.get(name, ()) if r >= 0]
            if name in term.fixed and isinstance(value, list | tuple) and unseen:
                del told[name]
                parts = zip("xy", value, strict=True)
                told |= {f"{name}_{axis}": (part, None, None, unit) for axis, part in parts if axis not in unseen}
            elif len(rows) == 1 and low is not None and low == high:
                del told[name]
                said = re.sub(rf" [+-] {re.escape(name)} [A-Z]\b", "", said)
            elif len(rows) == 1 and low is not None and high is not None:
                free = term.free[rows[0]]
                told[name] = (value, None, None, unit) if _anything(free, low, high) else told[name]
        if unseen:
            said = said.replace("X, Y the place", f"{(kinds.pop()).upper()} the place")
        return told, said

    def _parameter(self, offset: int, term: Term, rows: Sequence[int], untold: Collection[int] = ()) -> Written:
        found: list[tuple[float, float | None, float | None]] = []
        # along the valley of a strength and a shape that nothing tells the strength may be anything, too
        held = with_shape_held(self.fit, term.label) if untold else self.fit
        for r in rows:
            if r >= 0 and term.free[r].name in term.along:  # components that show only together: each may be any
                size = float(self.fit.values[offset + r])
                found += [(size * part, None, None) for part in term.along[term.free[r].name]]
            elif r < 0:  # a component that these recordings do not show
                found.append((0.0, None, None))
            elif r in untold:
                found.append((float(self.fit.values[offset + r]), None, None))
            else:
                own = self.fit if term.free[r].inner else held
                row = offset + r - sum(f.inner for f in term.free[:r]) * (own is not self.fit)
                value, *ends = own.interval(row, self.spread)
                low, high = (end if math.isfinite(end) else None for end in ends)
                found.append((value, low, high))
        unit = next(term.free[r].unit for r in rows if r >= 0)
        if len(found) == 1:
            return (*found[0], unit)
        values, lows, highs = (list(column) for column in zip(*found, strict=True))
        return values, lows, highs, unit

    def _seen_along(self, offset: int, term: Term, r: int) -> str:
        """What is known of a vector of which one direction alone shows."""
        free = term.free[r]
        value, low, high = self.fit.interval(offset + r, self.spread)
        direction = ", ".join(f"{part:.3g}" for part in term.along[free.name])
        return f"; only its part along [{direction}] shows, {value:.4g} ({low:.4g} to {high:.4g}) {free.unit}"


def _anything(free: Free, low: float, high: float) -> bool:
    """Whether an interval holds all that was sought."""
    return low <= free.low and high >= free.high


def at_any_shape(told: Told, laws: Sequence[Trial]) -> list[str]:
    """Notes on laws whose shape may be anything that was sought: their strengths are told at one shape."""
    notes = []
    for law in laws:
        free = [law.term.free[r] for r in told.untold(law)]
        if free:
            names = " and ".join(f"{f.name} ({f.low:g} to {f.high:g})" for f in free)
            notes.append(f"{names}: anything that was sought will do; strengths are told at the value given")
    return notes


def revised_scene(fit: Fit, values: np.ndarray, case: Case, dt: float) -> Scene:
    """The scene of a recording with what was found added; it runs as it is.

    values : (p,) of the fit, with those that belong to this recording alone;  dt [s]
    """
    scene, camera = fit.hypothesis.scene(case, values)
    t0 = float(clock(camera, case.t[0]))
    if case.name in fit.starts:
        scene = scene.with_initial(states(*fit.start_of(case.name), scene, t0))
    else:
        described = describe_starts(case, case.start, scene)
        scene = scene.with_initial(states(described, first_numbers(described), scene, t0))
    duration = float(case.t[-1] - case.t[0])
    spacing = duration / max(len(case.t) - 1, 1)
    return handed_over(scene, camera, case.recording, dt=dt, start=t0, duration=duration, output=spacing)


def used(case: Case, dt: float | None) -> Used:
    """How a recording was used; dt [s] of its runs."""
    part = HELD_OUT if case.held_out else PARTLY if case.scored.any() else TRAINING
    sizes = zip(case.sigma, case.channels, strict=True)
    return replace(
        Used.of(case.recording, part, dt), frames=len(case.t), length=float(case.t[-1] - case.t[0]),
        noise=tuple((float(s), "rad" if c.kind == "angle" else "m") for s, c in sizes), estimated=not case.sigma_known,
    )  # fmt: skip
