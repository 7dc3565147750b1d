"""What may be missing where the bed is not seen, and how much of it a first run tries."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ...errors import InputError
from ...laws import Law, Parameter, all_laws
from ...scene import Scene, use
from ..candidates import applies, lightest
from ..criteria import current
from ..hypothesis import NO_CAMERA, Free, Term, set_camera, set_numbers
from ..swimmer_terms import swimmer_terms, tried_below
from ..trial import Tried
from .summaries import Condition, Shim

KINDS = ("body", "pair", "constraint")  # of laws that act on all bodies alike; those of a chain: ``swimmer_terms``


@dataclass(frozen=True)
class Candidate(Tried):
    """A candidate and the points at which it is run first.

    design : (n, n) rows are amounts (value less neutral) of its n numbers; empty for the apparatus, which needs
    no runs;  extent : the class of bodies it acts on, for the verdict
    other : times the first amount, where else to look for one that shows: at the size that the units tell
    cost : of a run, in those of the naive scene, see ``priced``
    """

    term: Term
    design: np.ndarray
    extent: tuple[str, ...]
    other: float | None = None
    cost: float = 1.0

    @property
    def neutral(self) -> np.ndarray:
        return np.array([f.neutral for f in self.term.free])

    def packings(self, usual: int) -> int:
        """How many packings it is run in, where a candidate as dear as most is run in ``usual``.

        Variances of means fall like 1/n and the time grows like cost n: of several together the least variance for a
        time is had where n goes like cost^(-1/2).
        """
        dear = max(self.cost / current().packings.pairs, 1.0)
        return max(round(usual / math.sqrt(dear)), min(usual, 2), 1)

    def scaled(self, factor: float) -> Candidate:
        """The same, first tried at another amount, inside its bounds."""
        criteria = current().packings
        design = self.design * factor
        for k, f in enumerate(self.term.free):
            room = (f.low - f.neutral, f.high - f.neutral)
            design[:, k] = np.clip(design[:, k], criteria.inside * room[0], criteria.inside * room[1])
        return replace(self, design=design)


def candidates_of(conditions: Sequence[Condition]) -> list[Candidate]:
    """Apparatus first, then laws on bodies and pairs, then what the swimmer itself may have."""
    recordings = {c.recording.name: c.recording for c in conditions}
    shims = [Shim(r) for r in recordings.values()]
    scenes = [c.scene for c in conditions]
    found = _camera(conditions)
    found += _contacts(scenes[0], {a.name for s in shims for a in s.recording.scene.adjustable})
    found += _fields(conditions, shims)
    for term in swimmer_terms(scenes):
        # the side on which there is room: a joint gets weaker, a limit comes nearer
        below = tried_below(term)
        amounts = [current().packings.amounts.below * f.scale if below else f.scale for f in term.free]
        signs = [-1.0 if below or f.neutral >= f.high else 1.0 for f in term.free]
        whole = term.bodies is None or len(term.bodies) == len(scenes[0].chains[0])
        bodies = ("swimmer",) if whole else tuple(term.bodies or ())
        found.append(Candidate(term, np.diag([a * s for a, s in zip(amounts, signs, strict=True)]), bodies))
    return found


def priced(candidates: Sequence[Candidate], packed: Scene) -> list[Candidate]:
    """The candidates with what their runs cost in a packed scene.

    A law that acts beyond contact is worked out for all pairs within its reach, each of which takes what a step of a
    body takes (measured in a full bed: 2.7, 3.7, 6.4 and 25 naive runs for 1.3, 2.9, 5.4 and 22 pairs a body).
    """
    tree = cKDTree([b.initial[:2] for b in packed.bodies if b.initial is not None])
    touch = 2 * float(np.mean([b.radius for b in packed.bodies]))

    def cost(x: Candidate) -> float:
        reach = 0.0 if x.apparatus else _reach(x, packed)
        return 1.0 + len(tree.query_pairs(touch + reach)) / tree.n if reach > 0 else current().packings.pairs

    return [replace(x, cost=cost(x)) for x in candidates]


def _reach(x: Candidate, packed: Scene) -> float:
    """How far beyond contact the laws of a scene with the candidate act [m]; 0 where it cannot be put in."""
    try:
        scene, _ = x.term.apply(packed, NO_CAMERA, x.neutral + x.design[0])
        return max((float(scene.resolved(u)[u.law.reach]) for u in scene.laws if u.law.reach), default=0.0)
    except InputError:
        return 0.0  # told where it is run


def packings_for(candidates: Iterable[Candidate], usual: int) -> int:
    """How many packings candidates are run in together, see ``Candidate.packings``."""
    return min((x.packings(usual) for x in candidates), default=usual)


def _camera(conditions: Sequence[Condition]) -> list[Candidate]:
    first, ends = current().packings.amounts, current().apparatus
    rows = [("camera_scale", "scale", "1", *first.widest, 1.0, first.scale, "seen = s true", "s")]
    if any(not c.any_view.curve for c in conditions):
        rows += [
            ("camera_tilt", "tilt", "rad", -ends.tilt, ends.tilt, 0.0, first.scale, "seen = R(+angle) true", "angle"),
            ("time_offset", "time_offset", "s", -ends.offset, ends.offset, 0.0, first.offset,
             "a frame stamped t shows the state at t + offset", "offset"),
        ]  # fmt: skip
    return [
        Candidate(
            Term(name, name, (Free(f"camera.{key}", unit, low, high, neutral, scale, None, neutral),), set_camera(key),
                 expression=expression, groups=((said, (0,)),)),
            np.zeros((0, 0)), (),
        )
        for name, key, unit, low, high, neutral, scale, expression, said in rows
    ]  # fmt: skip


def _contacts(scene: Scene, adjustable: set[str]) -> list[Candidate]:
    """Contacts that lose more, or less, than believed."""
    found = []
    for use_ in {i.name: i for i in reversed(scene.laws_as("contact"))}.values():
        name = f"{use_.name}.{use_.law.loses}"
        if use_.law.kind != "pair" or name in adjustable:
            continue
        believed = float(use_.values[use_.law.loses])
        first = believed if believed > 0 else current().packings.amounts.damping
        free = Free(name, "1/s", 0.0, math.inf, believed, first, None, believed)
        term = Term("restitution", f"restitution ({name})", (free,), set_numbers((name,)),
                    expression=use_.law.expression, groups=(("damping", (0,)),))  # fmt: skip
        found.append(Candidate(term, np.array([[first]]), ("swimmer", "grains")))
    return found


def _fields(conditions: Sequence[Condition], shims: Sequence[Shim]) -> list[Candidate]:
    """Every named law on bodies and pairs, from its declaration; a user's own are among them."""
    scale = natural_scale(conditions)
    found = []
    for law in all_laws().values():
        if law.candidate != "named" or law.kind not in KINDS or law.form or not law.strength:
            continue
        if any(c.scene.laws_named(law.name) for c in conditions):
            continue  # it is known already; its strength is the adjustables' business
        if not applies(law, shims):  # type: ignore[arg-type]
            continue
        if law.role == "medium":
            found.append(_flow_candidate(law, scale))
            continue
        free: list[Free] = []
        groups = []
        for name in law.strength:
            p = law.parameter(name)
            at, size = len(free), _declared(law, p) or scale(p)
            # masses of a bed follow from its density: what is carried along only adds to them
            low = max(p.low, lightest()) if p.within == "weight" else p.low
            free += [
                Free(f"{law.name}.{argument}", p.unit, low, p.high, p.neutral, size, None, p.neutral)
                for argument in p.arguments
            ]
            groups.append((name, tuple(range(at, len(free)))))
        amounts = [_inward(f) for f in free]
        if not all(amounts):
            continue  # its bounds hold it where it is absent
        term = Term(
            law.mechanism, law.name, tuple(free), _Adder(law), expression=law.expression, groups=tuple(groups),
            choices=_fixed(law),
        )  # fmt: skip
        declared = _declared(law, law.parameter(law.strength[0]))
        other = scale(law.parameter(law.strength[0])) / declared if declared else None
        found.append(Candidate(term, np.diag(amounts), ("swimmer", "grains"), other))
    return found


def _declared(law: Law, p: Parameter) -> float | None:
    """The size that a user's own law declares as typical; sizes of the package's laws follow from the bed."""
    return None if law.shipped or not p.typical else abs(float(p.typical))


def _inward(free: Free) -> float:
    """The amount of a first try, on the side of neutral with room for it, inside the bounds; 0 where there is none."""
    up, down = free.high - free.neutral, free.neutral - free.low
    if up >= free.scale or up >= down:
        return min(free.scale, current().packings.inside * up)
    return -min(free.scale, current().packings.inside * down)


Scale = Callable[[Parameter], float]


def natural_scale(conditions: Sequence[Condition]) -> Scale:
    """The size of a parameter that tells on the motion, from its unit alone.

    Mass M of the mean grain, time T = 1/(1.5 f), length L = u T with u the swimmer's typical speed sideways: a force
    of M L/T^2 stops a grain at that speed within a tenth of a cycle. Numbers without a unit: what the law declares as
    typical. Amounts are tried and scaled afterwards, see ``amounts.scaled_candidates``.
    """
    scene = conditions[0].scene
    bed = scene.bed
    if bed is not None:
        a, b = bed.grain_diameter
        mass = bed.density * math.pi / 6 * ((b**4 - a**4) / (4 * (b - a)) if b > a else a**3)
    else:
        mass = float(np.mean([b.mass for b in scene.bodies if b.role == "grain"]))
    frequency = float(np.mean([c.frequency for c in conditions]))
    length = sum(2 * scene.bodies[k].radius for k in scene.chains[0])
    amplitude = abs(float(scene.laws_as("stroke")[0].values["amplitude"])) or 1.0
    criteria = current().packings.amounts
    speed = criteria.speed * amplitude * 2 * math.pi * frequency * length
    time = 1 / (criteria.stops * frequency)

    def size(p: Parameter) -> float:
        powers = dimension(p.unit)
        if powers is None or powers == (0, 0, 0):
            return abs(p.typical or criteria.unitless)
        return float(mass ** powers[0] * (speed * time) ** powers[1] * time ** powers[2])

    return size


def dimension(unit: str) -> tuple[float, float, float] | None:
    """Powers of kg, m and s in a unit such as "kg/s", "N m", "m/s^2"; rad and 1 have none; None for other units."""
    known = {
        "kg": (1, 0, 0), "m": (0, 1, 0), "s": (0, 0, 1), "N": (1, 1, -2), "J": (1, 2, -2), "Pa": (1, -1, -2),
        "Hz": (0, 0, -1), "rad": (0, 0, 0), "1": (0, 0, 0), "": (0, 0, 0),
    }  # fmt: skip
    total = [0.0, 0.0, 0.0]
    for k, part in enumerate(unit.replace("*", " ").split("/")):
        for factor in part.strip("() ").split():
            base, _, power = factor.partition("^")
            if base not in known:
                return None
            times = (float(power) if power else 1.0) * (1 if k == 0 else -1)
            for axis in range(3):
                total[axis] += times * known[base][axis]
    return total[0], total[1], total[2]


def _flow_candidate(law: Law, scale: Scale) -> Candidate:
    """Linear in c and in the push c u: u itself means nothing where c is zero."""
    c0 = scale(law.parameter("c"))
    push = c0 * current().packings.amounts.stream * scale(law.parameter("u"))
    free = (
        Free(f"{law.name}.c", "kg/s", 0.0, math.inf, 0.0, c0),
        *[Free(f"{law.name}.push_{k}", "N", -math.inf, math.inf, 0.0, push) for k in "xy"],
    )
    term = Term(law.mechanism, law.name, free, partial(_flow, law), expression=law.expression,
                groups=(("c", (0,)), ("push", (1, 2))))  # fmt: skip
    design = np.array([[c0, 0.0, 0.0], [c0, push, 0.0], [c0, 0.0, push]])
    return Candidate(term, design, ("swimmer", "grains"))


def _fixed(law: Law) -> dict[str, Any]:
    """Numbers of a law that are not looked for here, at their usual sizes."""
    fixed: dict[str, Any] = {}
    for p in law.parameters:
        if p.name in law.strength:
            continue
        if p.choices:
            fixed[p.name] = p.default if p.default is not None else p.choices[0]
        elif p.typical is not None and p.size == 1:
            fixed[p.name] = float(p.typical)
    return fixed


class _Adder:
    """Adds a law with its strengths, the rest at usual sizes."""

    def __init__(self, law: Law) -> None:
        self.law, self.fixed = law, _fixed(law)

    def __call__(self, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        given = dict(self.fixed)
        at = 0
        for name in self.law.strength:
            n = self.law.parameter(name).size
            given[name] = float(values[at]) if n == 1 else tuple(float(v) for v in values[at : at + n])
            at += n
        return scene.with_laws(use(self.law, **given)), camera


def _flow(law: Law, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
    c = max(float(values[0]), 1e-15)
    return scene.with_laws(use(law, c=c, u=(float(values[1]) / c, float(values[2]) / c))), camera
