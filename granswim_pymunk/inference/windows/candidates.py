"""What a bed and its swimmer may have had that their scene lacks: apparatus, contacts, grains, swimmer.

Every strength comes in units of a size that suits a bed of millimetre grains moving at centimetres a second,
so that a first try changes a window by about as much as the noise does.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import InputError
from ...laws import Law, all_laws, flexible
from ...laws.base import AUTOMATIC
from ...scene import Scene, use
from ..camera_terms import camera_terms
from ..candidates import applies
from ..criteria import current
from ..data import Case
from ..flow import flow_of
from ..hypothesis import Free, Term, set_numbers
from ..mechanisms import RESTITUTION
from ..swimmer_terms import swimmer_terms
from .hidden import NAME
from .radii import link_stretch

KINDS = ("body", "pair", "constraint")


def bed_terms(cases: Sequence[Case]) -> list[Term]:
    """All named candidates with one choice of exponents each (see ``siblings`` for the others), apparatus first."""
    scene = cases[0].recording.scene
    terms, amounts = [], dict(current().windows.candidates.apparatus)
    for term in camera_terms(cases):
        if term.mechanism in amounts:
            terms.append(_sized(term, [amounts[term.mechanism]]))
    terms += _contact_damping(cases)
    laws = [law for law in all_laws().values() if law.kind in KINDS and law.candidate == "named"]
    laws = [law for law in laws if not law.form and applies(law, cases)]
    drift = mean_drift(cases)
    terms += [t for law in laws if not _far(law) for t in law_terms(law, scene, drift)[:1]]
    terms += [t for law in laws if law.apart for t in on_some(law, scene, drift)[:1]]
    terms += swimmer_terms([c.recording.scene for c in cases])
    # what reaches far costs many times a step: it comes last, and is what is left out where the time is up
    return terms + [t for law in laws if _far(law) for t in law_terms(law, scene, drift)[:1]]


@dataclass(frozen=True)
class PictureScale:
    """Scale of the picture by the swimmer itself, whose disks keep their distance: value, standard error, term.

    held : the term with that value, nothing in it free
    """

    value: float
    error: float
    term: Term

    @property
    def held(self) -> Term:
        def apply(scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
            return self.term.apply(scene, camera, [self.value])

        return replace(self.term, free=(), groups=(), apply=apply)

    @property
    def off(self) -> bool:
        """Whether the disks are nearer, or farther, than their links are long: a wrong scale, or a force on them."""
        return abs(self.value - 1) > current().windows.candidates.scale_sure * self.error

    @property
    def wrong(self) -> bool:
        """Whether by more than forces on the links do."""
        return self.off and abs(self.value - 1) > current().windows.candidates.least_scale


def picture_scale(cases: Sequence[Case]) -> PictureScale | None:
    """s = mean of |r_i - r_j|/l over linked disks that are seen, l the length at rest; None where too few are.

    The springs between disks are stiff: what stretches them in a bed is far below what noise shows.
    """
    seen: list[np.ndarray] = []
    for case in cases:
        scene, xy = case.recording.scene, case.recording.unwrapped().xy
        film = np.full((len(xy), len(scene.bodies), 2), np.nan)
        film[:, case.recording.track_rows] = xy
        sigma = float(np.nanmean(case.sigma)) if len(case.sigma) else 0.0
        seen += [q for item in scene.laws_as("link") for q in link_stretch(scene, item, film, sigma)]
    term = next((t for t in camera_terms(cases) if t.mechanism == "camera_scale"), None)
    if len(seen) < 2 or term is None:
        return None
    value = float(np.mean([q.mean() for q in seen]))
    # between links, too: a disk whose radius is not what it is believed to be is no scale
    error = float(np.hypot(np.std([q.mean() for q in seen], ddof=1), 1e-4) / math.sqrt(len(seen)))
    if error > current().windows.candidates.coarse_scale:
        return None
    return PictureScale(value, error, term)


def mean_drift(cases: Sequence[Case]) -> tuple[float, float]:
    """Mean velocity [m/s] of all bodies that were seen, from first to last sight: a bed that a flow carries along."""
    found = []
    for case in cases:
        xy, t = case.recording.unwrapped().xy, case.recording.t
        for k in range(xy.shape[1]):
            seen = np.flatnonzero(np.isfinite(xy[:, k, 0]))
            if len(seen) > 1:
                first, last = seen[0], seen[-1]
                found.append((xy[last, k] - xy[first, k]) / (t[last] - t[first]))
    mean = np.mean(found, axis=0) if found else np.zeros(2)
    return float(mean[0]), float(mean[1])


def _far(law: Law) -> bool:
    """Whether a law reaches far beyond contact, where a bed has many pairs."""
    return bool(law.reach) and law.parameter(law.reach or "").default is AUTOMATIC


def siblings(term: Term, scene: Scene) -> list[Term]:
    """The same law with its other exponents of the radius, or ranges, or on the swimmer or the grains alone."""
    law = all_laws().get(term.mechanism)
    if law is None or law.kind not in KINDS:
        return []
    drift = term.apply.drift if isinstance(term.apply, LawAdder) else (0.0, 0.0)
    others = law_terms(law, scene, drift)
    if law.kind == "body":
        others += on_some(law, scene, drift)
    return [t for t in others if t.label != term.label]


def on_some(law: Law, scene: Scene, drift: tuple[float, float]) -> list[Term]:
    """A law of bodies, in its usual form, on the swimmer alone and on the grains alone."""
    swimmer = scene.swimmer_ids
    grains = tuple(b.id for b in scene.bodies if b.mobile and b.id not in swimmer and not b.id.startswith(NAME))
    usual = {whose: law_terms(law, scene, drift, bodies)[0] for whose, bodies in
             (("the swimmer", swimmer), ("the grains", grains))}  # fmt: skip
    return [replace(t, label=f"{t.label} on {whose}") for whose, t in usual.items()]


def _sized(term: Term, sizes: Sequence[float]) -> Term:
    return replace(term, free=tuple(replace(f, scale=s) for f, s in zip(term.free, sizes, strict=True)))


def mean_grain_mass(scene: Scene) -> float:
    grains = [b.mass for b in scene.bodies if b.role == "grain"]
    return float(np.mean(grains or [b.mass for b in scene.bodies if b.mobile]))


def size_of(law: Law, name: str, unit: str, scene: Scene) -> float:
    """A strength of the law that shows in a window without overturning it."""
    criteria = current().windows.candidates
    mass = mean_grain_mass(scene)
    force = mass * criteria.acceleration
    parameter = law.parameter(name)
    if parameter.in_bed is not None:
        return parameter.in_bed * {"force": force, "drag": force / criteria.speed}.get(parameter.in_bed_times, 1.0)
    by_unit = {
        "kg/s": force / criteria.speed, "kg/m": 2 * force / criteria.speed**2, "N": force,
        "m/s^2": criteria.acceleration, "1/s": 1e2,
    }  # fmt: skip
    return by_unit.get(unit, abs(parameter.typical or 1.0))


def law_terms(
    law: Law, scene: Scene, drift: tuple[float, float] = (0.0, 0.0), bodies: tuple[str, ...] | None = None
) -> list[Term]:
    """Terms that add a law of bodies or pairs, one for each choice of its exponents; the usual choice first.

    On all mobile bodies, or on ``bodies``. Ranges stay as typical. A flow that drags has its force on bodies that go
    at ``drift`` [m/s] as numbers, so that a first-order change is linear in them, and a drag alone does not stop a bed
    that is carried along.
    """
    mobile = tuple(b.id for b in scene.bodies if b.mobile)
    radii = {b.radius for b in scene.bodies if b.mobile}
    choices = [(p.name, p.choices) for p in law.parameters if p.choices and not isinstance(p.choices[0], str)]
    combinations = [
        dict(zip([n for n, _ in choices], values, strict=True))
        for values in itertools.product(*[c for _, c in choices])
    ]
    if len(radii) == 1:
        combinations = combinations[:1]
    usual = {p.name: p.default for p in law.parameters}
    combinations.sort(key=lambda c: any(usual[k] != v for k, v in c.items()))
    vector = [p for p in law.parameters if p.size > 1 and p.name not in law.strength and p.typical is not None]
    terms = []
    for choice in combinations:
        free: list[Free] = []
        groups: list[tuple[str, tuple[int, ...]]] = []
        for p in law.parameters:
            if p.name not in law.strength:
                continue
            size = size_of(law, p.name, p.unit, scene)
            begin = len(free)
            for argument in p.arguments:
                free.append(Free(f"{law.name}.{argument}", p.unit, p.low, p.high, p.neutral, size, None, p.neutral))
            groups.append((p.name, tuple(range(begin, len(free)))))
        fixed: dict[str, Any] = dict(choice)
        for p in law.parameters:
            if p.typical is not None and p.name not in law.strength and p.size == 1:
                fixed[p.name] = float(p.typical if p.default in (None, AUTOMATIC) else p.default)
        pushed = ""
        if vector:
            pushed = vector[0].name
            size = mean_grain_mass(scene) * current().windows.candidates.acceleration
            free += [Free(f"{law.name}.force_{k}", "N", -math.inf, math.inf, 0.0, size) for k in "xy"]
            groups.append((pushed, (1, 2)))
        label = law.name + "".join(f" {k} = {v:g}" for k, v in choice.items() if len(combinations) > 1)
        terms.append(
            Term(
                law.mechanism, label, tuple(free), LawAdder(law, fixed, tuple(groups), pushed, drift, bodies),
                bodies or mobile, law.expression, {**choice}, tuple(groups),
            )
        )  # fmt: skip
    return terms


class LawAdder:
    """Adds a law with its strengths; a force of a flow on bodies that go at ``drift`` becomes the flow's velocity."""

    def __init__(
        self, law: Law, fixed: Mapping[str, Any], groups, pushed: str, drift: tuple[float, float] = (0.0, 0.0),
        bodies: tuple[str, ...] | None = None,
    ) -> None:  # fmt: skip
        self.law, self.fixed, self.groups, self.pushed, self.drift = law, dict(fixed), groups, pushed, drift
        self.bodies = bodies

    def __call__(self, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        given = dict(self.fixed)
        for name, rows in self.groups:
            numbers = [float(values[r]) for r in rows]
            if name == self.pushed:
                drag = max(float(values[0]), 1e-12)  # a force without a drag is a fast, thin flow
                given[self.law.strength[0]] = drag
                numbers = [n / drag + d for n, d in zip(numbers, self.drift, strict=True)]
            elif self.pushed and name == self.law.strength[0]:
                continue
            given[name] = numbers[0] if len(numbers) == 1 else tuple(numbers)
        return scene.with_laws(use(self.law, bodies=self.bodies, **given)), camera

    def flow(self, values: np.ndarray, covariance: np.ndarray | None):
        """(drag, flow) with their covariance, to first order, where the law has a flow; else None."""
        return flow_of(values, covariance, self.drift) if self.pushed else None


def _contact_damping(cases: Sequence[Case]) -> list[Term]:
    """Contacts that lose more, or less, than believed."""
    scene = cases[0].recording.scene
    terms = []
    for item in {i.name: i for i in reversed(scene.laws_as("contact"))}.values():
        name = f"{item.name}.{item.law.loses}"
        if item.law.kind != "pair" or name in {a.name for a in scene.adjustable}:
            continue
        believed = float(item.values[item.law.loses])
        lost = item.law.parameter(item.law.loses)
        free = Free(name, lost.unit, 0.0, math.inf, believed, max(believed, 1e3), None, believed)
        bodies = tuple(b.id for b in scene.bodies if b.mobile)
        groups = ((lost.name, (0,)),)
        apply = set_numbers((name,))
        terms.append(Term(RESTITUTION, RESTITUTION, (free,), apply, bodies, item.law.expression, {}, groups))
    return terms


def check_bed(scene: Scene, name: str) -> None:
    """Raise InputError where the scene is no bed listed body by body with a swimmer in it."""
    if not scene.chains or not any(b.role == "grain" for b in scene.bodies):
        raise InputError("needs a swimmer and grains, listed body by body", where=f"recording {name}")


def flexible_terms(
    case: Case, places: np.ndarray, speeds: np.ndarray, bodies: tuple[str, ...] | None = None
) -> list[Term]:
    """The forms that name nothing: smooth in place (a force, an acceleration), in speed, in the drive's phase.

    places : (k, 2) where bodies are seen [m];  speeds : (k,) how fast they go [m/s];  bodies : on which they act, all
    that move where not given
    """
    criteria = current().windows.candidates
    scene = case.recording.scene
    mobile = tuple(b.id for b in scene.bodies if b.mobile)
    centre, size = places.mean(axis=0), float(max(np.ptp(places, axis=0).max() / 2, 1e-6))
    force = mean_grain_mass(scene) * criteria.acceleration
    top = float(current().candidates.top * np.quantile(speeds, criteria.fastest))
    place: dict[str, Any] = {"centre": (float(centre[0]), float(centre[1])), "size": size}
    linear = [f"{axis}{k}" for axis in "ab" for k in range(3)]
    forms: list[tuple[Law, str, dict[str, Any], Sequence[str], float]] = [
        (flexible("place"), "a force smooth in place", {**place, "q": 0}, linear, force),
        (flexible("place"), "an acceleration smooth in place", {**place, "q": 1}, linear, criteria.acceleration),
        (
            flexible("speed"), "a drag smooth in speed", {"top": top},
            [f"c{k}" for k in range(5)], force / criteria.speed,
        ),
    ]  # fmt: skip
    cycle = _cycle(scene)
    if cycle:
        names = ["c0", "a1", "b1", "a2", "b2"]
        forms.append((flexible("cycle"), "a drag that follows the drive", cycle, names, force / criteria.speed))
    return [_nameless(law, label, fixed, numbers, scale, mobile, bodies) for law, label, fixed, numbers, scale in forms]


def _nameless(
    law: Law, label: str, fixed: dict[str, Any], numbers: Sequence[str], scale: float, mobile: tuple[str, ...],
    bodies: tuple[str, ...] | None = None,
) -> Term:  # fmt: skip
    free = tuple(
        Free(f"{law.name}.{n}", law.parameter(n).unit, -math.inf, math.inf, 0.0, scale, None, 0.0) for n in numbers
    )
    groups = tuple((n, (k,)) for k, n in enumerate(numbers))
    adder = LawAdder(law, fixed, groups, "", bodies=bodies)
    return Term("unknown", label, free, adder, bodies or mobile, law.expression, {}, groups)


def nameless_terms(cases: Sequence[Case]) -> list[Term]:
    """Forces that nothing with a name imitates, so that the search has to hold them from the beginning.

    One across the motion, of all bodies and of the swimmer's, and, where all swimmers are driven alike, a drag that
    follows the drive.
    """
    scene = cases[0].recording.scene
    mass, mobile = mean_grain_mass(scene), tuple(b.id for b in scene.bodies if b.mobile)
    scale = mass * current().windows.candidates.acceleration / current().windows.candidates.speed
    across, label = flexible("across"), "a force across the motion"
    terms = [
        _nameless(across, label, {}, ["s"], scale, mobile),
        _nameless(across, f"{label} on the swimmer", {}, ["s"], scale, mobile, scene.swimmer_ids),
    ]
    cycles = [_cycle(c.recording.scene) for c in cases]
    if cycles[0] and all(c == cycles[0] for c in cycles):
        label, numbers = "a drag in time with the drive", ["c0", "a1", "b1"]
        terms.append(_nameless(flexible("cycle"), label, cycles[0], numbers, scale, mobile))
    return terms


def _cycle(scene: Scene) -> dict[str, Any]:
    """Frequency and phase of the first drive; nothing where there is none."""
    for item in scene.laws_as("stroke")[:1]:
        return {"frequency": float(item.values["frequency"]), "phase": float(item.values["phase"])}
    return {}
