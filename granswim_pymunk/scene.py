"""A scene: bodies, box and a list of laws with parameters. Built, read, printed, hashed.

SI throughout (m, kg, s, rad, N); y points up, angles are counter-clockwise.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import tomllib
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from . import __version__
from .errors import InputError
from .fingerprint import fingerprint
from .laws import AUTOMATIC, Law, get_law
from .laws.base import Parameter
from .limits import (
    DEEPEST,
    LARGEST_MASS,
    LARGEST_RADIUS,
    LARGEST_TABLE,
    LARGEST_TOML,
    MOST_BODIES,
    SMALLEST_MASS,
    SMALLEST_RADIUS,
    check_between,
    check_id,
    check_keys,
    check_seed,
    one_title,
    ordinary_file,
)  # fmt: skip
from .walls import KEYS as WALL_KEYS
from .walls import Wall, check_walls, gap_to_wall

ROLES = ("head", "tail", "grain", "wall", "free")
SCHEMES = ("exact", "half_step")
STANDARD_GRAVITY = 9.81  # m/s^2, where a law needs g and the scene has none (contract)
LARGEST_NUMBER = 1e100  # anywhere in a scene or a recording.toml


class SceneWarning(UserWarning):
    """Something in a recording.toml was not understood and was left out."""


def _too_many(count: int) -> InputError:
    return InputError(f"has {count} bodies; more than {MOST_BODIES} cannot be computed")


def _number(value: Any, name: str, unit: str, *, file: Any, where: str | None, positive: bool = False) -> float:
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or value != value
        or value in (math.inf, -math.inf)
    ):
        raise InputError(f"{name} should be a finite number [{unit}], got {value!r}", file=file, where=where)
    if abs(value) > 1e300:
        raise InputError(f"{name} [{unit}] is too large: {str(value)[:20]}", file=file, where=where)
    if positive and value <= 0:
        raise InputError(f"{name} should be above zero [{unit}], got {value:g}", file=file, where=where)
    return float(value)


def _numbers(value: Any, size: int, name: str, unit: str, *, file: Any, where: str | None) -> tuple[float, ...]:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != size:
        raise InputError(f"{name} should be {size} numbers [{unit}], got {value!r}", file=file, where=where)
    return tuple(_number(item, name, unit, file=file, where=where) for item in value)


@dataclass(frozen=True)
class Body:
    """One disk. ``initial`` is x, y [m], vx, vy [m/s]; ``inertia`` [kg m^2] is 2/5 m r^2 where None."""

    id: str
    role: str
    radius: float
    mass: float
    observed: bool = True
    initial: tuple[float, float, float, float] | None = None
    inertia: float | None = None

    def __post_init__(self) -> None:
        check_id(str(self.id))
        where = f"body {self.id}"
        if self.role not in ROLES:
            raise InputError(f"role should be one of {', '.join(ROLES)}, got {self.role!r}", where=where)
        # whole numbers become floats, so that equal scenes have equal hashes
        object.__setattr__(self, "radius", _number(self.radius, "radius", "m", file=None, where=where, positive=True))
        if self.role != "wall":
            object.__setattr__(self, "mass", _number(self.mass, "mass", "kg", file=None, where=where, positive=True))
            check_between(self.mass, "mass", "kg", SMALLEST_MASS, LARGEST_MASS, where)
        check_between(self.radius, "radius", "m", SMALLEST_RADIUS, LARGEST_RADIUS, where)
        if self.inertia is not None:
            inertia = _number(self.inertia, "inertia", "kg m^2", file=None, where=where, positive=True)
            object.__setattr__(self, "inertia", inertia)
        if self.initial is not None:
            object.__setattr__(self, "initial", tuple(float(v) for v in self.initial))

    @property
    def mobile(self) -> bool:
        return self.role != "wall"

    @property
    def moment(self) -> float:
        """Moment of inertia about the centre [kg m^2]."""
        return 0.4 * self.mass * self.radius**2 if self.inertia is None else self.inertia


@dataclass(frozen=True)
class LawUse:
    """A law with its values, on some bodies (None: all mobile ones)."""

    law: Law
    values: Mapping[str, Any]
    bodies: tuple[str, ...] | None = None

    @property
    def name(self) -> str:
        return self.law.name

    def with_values(self, **values: Any) -> LawUse:
        return replace(self, values=self.law.check({**self.values, **values}))

    def __str__(self) -> str:
        numbers = ", ".join(
            f"{p.name} = {_show(self.values[p.name])}{' ' + p.unit if p.unit not in ('', '1') else ''}"
            for p in self.law.parameters
        )
        who = "" if self.bodies is None else f" on {', '.join(self.bodies)}"
        return f"{self.name}({numbers}){who}: {self.law.expression}"


def _show(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return "[" + ", ".join(_show(v) for v in value) + "]"
    return str(value)


def use(law: Law | str, *, bodies: Iterable[str] | None = None, **values: Any) -> LawUse:
    """Put a law to use: ``use("linear_drag", c=1e-5, bodies=["0"])``. Raises InputError on bad values."""
    declared = get_law(law, given=values) if isinstance(law, str) else law
    return LawUse(declared, declared.check(values), None if bodies is None else tuple(map(str, bodies)))


@dataclass(frozen=True)
class Adjustable:
    """A parameter that recalibration may move. ``per``: "all" recordings share it, or "body", "recording"."""

    law: str
    parameter: str
    low: float
    high: float
    per: str = "all"

    @property
    def name(self) -> str:
        return f"{self.law}.{self.parameter}"


@dataclass(frozen=True)
class Bed:
    """A bed that is not listed body by body; it is packed from the seed."""

    height: float  # m
    packing_fraction: float
    grain_diameter: tuple[float, float]  # m
    density: float  # kg/m^3
    layers: float = 0.0


@dataclass(frozen=True)
class Time:
    """Time step, start and duration [s]; ``output``: seconds between stored states.

    ``scheme``: "exact", drags and friction of substrate and joints see the velocity of the time of the positions, so
    that the step makes no error of first order; "half_step", they see the last half-step velocity, as in LAMMPS.
    Dampings of contacts, unions and bending are the same in both.
    """

    dt: float | None = None
    start: float = 0.0
    duration: float | None = None
    output: float | None = None
    scheme: str = "exact"

    def __post_init__(self) -> None:
        if self.scheme not in SCHEMES:
            raise InputError(f"should be one of {', '.join(SCHEMES)}, got {self.scheme!r}", where="time.scheme")


@dataclass(frozen=True)
class Scene:
    """Bodies, walls, box, laws. Immutable: every ``with_...`` gives a new scene.

    ``bodies`` in file order; the order of a swimmer's disks is their order here, head first.
    ``walls``: straight ones, beside bodies with the role wall.
    ``gravity`` [m/s^2] acts on all bodies where it is not zero: the law of that name need not be listed.
    ``inputs`` maps a body to (t [s], value) of its command, linear between rows.
    """

    bodies: tuple[Body, ...]
    laws: tuple[LawUse, ...] = ()
    gravity: tuple[float, float] = (0.0, 0.0)
    periodic_x: float | None = None
    bed: Bed | None = None
    adjustable: tuple[Adjustable, ...] = ()
    time: Time = Time()
    inputs: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]] = field(default_factory=dict)
    camera: Mapping[str, Any] = field(default_factory=dict)
    frames: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    title: str = ""
    walls: tuple[Wall, ...] = ()

    # ---- checks -------------------------------------------------------------------------------

    def __post_init__(self) -> None:
        object.__setattr__(self, "title", one_title(self.title))
        if len(self.bodies) > MOST_BODIES:
            raise _too_many(len(self.bodies))
        ids = [body.id for body in self.bodies]
        if len(set(ids)) != len(ids):
            twice = Counter(ids).most_common(1)[0][0]
            raise InputError("this id is used twice", where=f"body {twice}")
        check_walls(self.walls, len(ids), ids, self.periodic_x)
        if any(self.gravity) and not any(item.name == "gravity" for item in self.laws):
            # whoever says how strong it is means that it acts
            object.__setattr__(self, "laws", (use("gravity"), *self.laws))
        known = set(ids)
        for item in self.laws:
            for name in item.bodies or ():
                if name not in known:
                    raise InputError(f"acts on body {name!r}, which the scene does not have", where=f"law {item.name}")
            if item.law.kind == "constraint" and item.name in ("pin", "drive") and item.bodies is None:
                raise InputError("needs `body`, the one it acts on", where=f"law {item.name}")
            if item.law.kind == "link":
                self._check_link(item)
        if self.periodic_x is not None and not self.periodic_x > 0:
            raise InputError(f"should be above zero [m], got {self.periodic_x!r}", where="scene.periodic_x")
        for adjustable in self.adjustable:
            uses = [item for item in self.laws if item.name == adjustable.law]
            if not uses:
                raise InputError("the scene has no such law", where=f"adjustable {adjustable.name}")
            uses[0].law.parameter(adjustable.parameter)
            if not adjustable.low < adjustable.high:
                raise InputError("low should be below high", where=f"adjustable {adjustable.name}")

    def _check_link(self, item: LawUse) -> None:
        """Raise InputError where a hinge or rod does not name what it joins."""
        wanted = (1, 2) if item.name == "hinge" else (2,)
        bodies = item.bodies or ()
        where = f"law {item.name}"
        if len(bodies) not in wanted or len(set(bodies)) != len(bodies):
            count = "one or two bodies" if len(wanted) == 2 else "two bodies"
            raise InputError(f"needs `bodies`, {count}, got {', '.join(bodies) or 'none'}", where=where)
        joined = [self.body(name) for name in bodies]
        if not any(body.mobile for body in joined):
            raise InputError("needs a body that moves", where=where)
        for body in joined:
            if body.role in ("head", "tail"):
                raise InputError(f"cannot hold body {body.id}, a swimmer's disk", where=where)
        if self.periodic_x is not None:
            raise InputError("cannot be simulated with periodic_x", where=where)

    @property
    def links(self) -> tuple[LawUse, ...]:
        """The hinges and rods of the scene."""
        return tuple(item for item in self.laws if item.law.kind == "link")

    @property
    def joints_of(self) -> dict[int, tuple[str, ...]]:
        """Pins and hinges, by their place among ``laws``: the ids that a law of joints names to act in one of them."""
        return {k: item.bodies or () for k, item in enumerate(self.laws) if item.name in ("pin", "hinge")}

    def joints_under(self, item: LawUse) -> tuple[int, ...]:
        """Places among ``laws`` of the pins and hinges that a law of kind joint acts in.

        All where it names no bodies; else those of exactly these bodies ([a] for a pin or a hinge to the world).
        Raises InputError where there is none.
        """
        joints = self.joints_of
        if item.bodies is None:
            return tuple(joints)
        wanted = set(item.bodies)
        found = [
            k
            for k, names in joints.items()
            if set(names) == wanted or (self.laws[k].name == "pin" and wanted & set(names))
        ]
        if not found:
            raise InputError(f"the scene has no pin or hinge of {', '.join(item.bodies)}", where=f"law {item.name}")
        return tuple(found)

    def check_overlaps(self) -> None:
        """Raise InputError where two bodies that can touch overlap by more than half the smaller radius.

        A body that is wider than the period overlaps itself.
        """
        from .touching import overlapping  # scipy takes long to import

        placed = [b for b in self.bodies if b.initial is not None]
        if not any(item.law.kind in ("pair", "impulse") for item in self.laws):
            return
        if self.periodic_x is not None and self.bodies:
            widest = max(self.bodies, key=lambda b: b.radius)
            if self.periodic_x < 2 * widest.radius:
                raise InputError(
                    f"{self.periodic_x:g} m is less than the diameter of body {widest.id}, {2 * widest.radius:g} m: "
                    "it would touch itself",
                    where="scene.periodic_x",
                )
        xy = np.array([b.initial[:2] for b in placed if b.initial is not None]).reshape(-1, 2)
        radius = np.array([b.radius for b in placed])
        for wall in self.walls:
            inside = -gap_to_wall(xy, 0.0, wall, self.periodic_x) if len(xy) else np.zeros(0)
            for k in np.flatnonzero(inside + 0.5 * radius > 0):
                if placed[k].mobile:
                    name = f"wall {wall.id}" if wall.id else "a straight wall"
                    raise InputError(
                        f"overlaps {name} by {inside[k] + radius[k]:.3g} m, more than half a radius",
                        where=f"body {placed[k].id}",
                    )
        if len(placed) < 2:
            return
        joined = {frozenset(item.bodies or ()) for item in self.links}
        for i, j in overlapping(xy, radius):
            a, b = placed[i], placed[j]
            if frozenset((a.id, b.id)) in joined:
                continue
            if {a.role, b.role} <= {"head", "tail"} or {a.role, b.role} == {"wall"}:
                continue
            overlap = a.radius + b.radius - math.dist(xy[i], xy[j])
            if overlap > 0.5 * min(a.radius, b.radius):
                raise InputError(
                    f"overlaps body {b.id} by {overlap:.3g} m, more than half a radius", where=f"body {a.id}"
                )

    # ---- asking -------------------------------------------------------------------------------

    def body(self, name: str) -> Body:
        try:
            return self._by_id[name]
        except KeyError:
            raise InputError("the scene has no such body", where=f"body {name}") from None

    @cached_property
    def _by_id(self) -> dict[str, Body]:
        return {body.id: body for body in self.bodies}

    @property
    def ids(self) -> tuple[str, ...]:
        return tuple(body.id for body in self.bodies)

    @property
    def swimmer(self) -> tuple[int, ...]:
        """Rows of the swimmer's disks, head first (all swimmers, one behind the other)."""
        return tuple(i for i, b in enumerate(self.bodies) if b.role in ("head", "tail"))

    @property
    def swimmer_ids(self) -> tuple[str, ...]:
        """Ids of the swimmer's disks, in the order of ``swimmer``."""
        return tuple(self.bodies[i].id for i in self.swimmer)

    @property
    def chains(self) -> tuple[tuple[int, ...], ...]:
        """Rows of each swimmer's disks, head first."""
        chains: list[list[int]] = []
        for i in self.swimmer:
            if self.bodies[i].role == "head" or not chains:
                chains.append([])
            chains[-1].append(i)
        return tuple(map(tuple, chains))

    def laws_named(self, name: str) -> tuple[LawUse, ...]:
        return tuple(item for item in self.laws if item.name == name)

    def laws_as(self, *roles: str) -> tuple[LawUse, ...]:
        """Those that are declared to have one of these roles, see ``Law.role``."""
        return tuple(item for item in self.laws if item.law.role in roles)

    def rows(self, item: LawUse) -> np.ndarray:
        """Rows of the mobile bodies (for pair laws: all bodies) that a law acts on."""
        wanted = None if item.bodies is None else set(item.bodies)
        if item.law.kind == "joint" and wanted is None:
            wanted = {name for names in self.joints_of.values() for name in names}
        refined = self._refined(item)
        if wanted is None and refined and item.law.kind in ("body", "constraint"):
            everywhere = any(other.bodies is None for other in refined)
            wanted = None if everywhere else {name for other in refined for name in other.bodies or ()}
        return np.array(
            [
                i
                for i, b in enumerate(self.bodies)
                if (b.mobile or item.law.kind in ("pair", "impulse")) and (wanted is None or b.id in wanted)
            ],
            dtype=np.int64,
        )

    @property
    def gravity_size(self) -> float:
        size = math.hypot(*self.gravity)
        return size if size > 0 else STANDARD_GRAVITY

    def resolved(self, item: LawUse) -> dict[str, Any]:
        """Values with the automatic ones worked out from the scene."""
        values = dict(item.values)
        for name, value in values.items():
            if value is AUTOMATIC:
                values[name] = self._automatic(item, name)
        if item.name == "drive" and item.bodies:
            for rail in self.laws_named("rail"):
                if rail.bodies is None or item.bodies[0] in rail.bodies:
                    values["direction"] = rail.values["direction"]
        return values

    def _automatic(self, item: LawUse, parameter: str) -> Any:
        work_out = _AUTOMATIC.get(f"{item.name}.{parameter}") or _AUTOMATIC.get(parameter)
        if work_out is not None:
            return work_out(self, item)
        where = f"law {item.name}, parameter {parameter}"
        if not item.law.refines:
            raise InputError("has no automatic value", where=where)
        refined = self._refined(item)
        if not refined:
            raise InputError(f"the scene has no {' or '.join(item.law.refines)} to take it from", where=where)
        source = _RENAMED.get(f"{item.name}.{parameter}", parameter)
        name, _, source = source.rpartition(".")
        values = []
        for other in refined:
            if source in other.values and name in ("", other.name):
                value = other.values[source]
                values.append(self._automatic(other, source) if value is AUTOMATIC else value)
        if any(value != values[0] for value in values):
            names = " or ".join(item.law.refines)
            raise InputError(f"differs between the {names} of the scene: give it, or name the bodies", where=where)
        own = item.law.parameter(parameter)
        absent = own.choices[0] if own.choices else 0.0 if own.size == 1 else (0.0,) * own.size
        return values[0] if values else absent

    def _refined(self, item: LawUse) -> tuple[LawUse, ...]:
        """Uses of the laws that this one refines, on the same bodies."""
        found = [other for name in item.law.refines for other in self.laws_named(name)]
        if item.bodies is None:
            return tuple(found)
        return tuple(o for o in found if o.bodies is None or set(o.bodies) & set(item.bodies))

    @property
    def acting(self) -> tuple[LawUse, ...]:
        """The laws as they are run: one that refines several others (two springs) once for each of them."""
        result: list[LawUse] = []
        for item in self.laws:
            refined = self._refined(item)
            if item.law.kind == "body" and len(refined) > 1 and all(r.bodies is not None for r in refined):
                for other in refined:
                    own = item.bodies or other.bodies or ()
                    result.append(replace(item, bodies=tuple(b for b in own if b in (other.bodies or ()))))
            else:
                result.append(item)
        return tuple(result)

    @property
    def joints(self) -> int:
        """Number of joints of the longest swimmer, joint 0 the one against the head's axis."""
        return max((len(chain) - 1 for chain in self.chains), default=0)

    def admits(self, law: Law) -> bool:
        """Whether a law can act here: bodies, chain, walls and the laws that it refines are there."""
        if law.refines and not any(self.laws_named(name) for name in law.refines):
            return False
        drives = law.series is not None and self.laws_named("drive")
        if law.kind == "chain" and not self.joints and not drives:
            return False
        if law.kind == "pair" and len(self.bodies) < (1 if self.walls and not law.reach else 2):
            return False
        any_value = {p.name: 1.0 if p.size == 1 else (1.0,) * p.size for p in law.parameters}
        values = any_value | {p.name: AUTOMATIC for p in law.parameters if p.default is AUTOMATIC}
        item = LawUse(law, values)
        try:
            for part in replace(self, laws=(*self.laws, item)).acting[len(self.laws) :]:
                self.resolved(part)
        except InputError:
            return False
        return True

    @property
    def commands(self) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
        """``inputs`` as the apparatus follows them: through the scene's actuator laws, in their order."""
        result = dict(self.inputs)
        for item in self.laws:
            if item.law.series is None:
                continue
            for drive in self.laws_named("drive"):
                gain = drive.values["gain"]
                for name in drive.bodies or ():
                    if name in result and gain != 0.0 and (item.bodies is None or name in item.bodies):
                        t, value = (np.asarray(numbers, dtype=float) for numbers in result[name])
                        own = [p.name for p in item.law.parameters if p.default is not AUTOMATIC]
                        t, value = item.law.series(t, gain * value, **{p: item.values[p] for p in own})
                        result[name] = (tuple(map(float, t)), tuple(map(float, value / gain)))
        return result

    # ---- making -------------------------------------------------------------------------------

    @classmethod
    def box(cls, width: float, height: float, *, wall_radius: float | None = None, **more: Any) -> Scene:
        """A closed box with its lower left corner at (0, 0), of four straight walls: bottom, right, top, left.

        width, height : free room inside [m]
        wall_radius : how thick the walls are outwards is twice that [m]; a fortieth of the shorter side where not said
        more : what else a Scene has (``laws``, ``gravity``, ``title`` ...)

        >>> scene = Scene.box(0.2, 0.1).add(Body("a", "free", 0.01, 0.1, initial=(0.1, 0.05, 0.3, 0.0)))
        >>> scene = scene.add(use("contact_linear", stiffness=100.0, damping=1.0))
        >>> [wall.id for wall in scene.walls], scene.laws[0].name
        (['bottom', 'right', 'top', 'left'], 'contact_linear')
        """
        if not (width > 0 and height > 0):
            raise InputError(f"should be above zero [m], got {width!r} and {height!r}", where="box")
        r = min(width, height) / 40 if wall_radius is None else wall_radius
        if not r >= 0:
            raise InputError(f"should be zero or above [m], got {r!r}", where="wall_radius")
        corners = [(-r, -r), (width + r, -r), (width + r, height + r), (-r, height + r)]
        sides = zip(("bottom", "right", "top", "left"), pairwise([*corners, corners[0]]), strict=True)
        walls = tuple(Wall(begin, end, r, name) for name, (begin, end) in sides)
        return cls(walls=(*walls, *more.pop("walls", ())), **{"bodies": (), **more})

    def add(self, *items: Body | LawUse | Adjustable | Wall) -> Scene:
        """The scene with these bodies, laws, adjustables and straight walls as well."""
        for item in items:
            if not isinstance(item, Body | LawUse | Adjustable | Wall):
                raise InputError(
                    f"should be a Body, a law put to use, an Adjustable or a Wall, got {item!r}", where="add"
                )
        return replace(
            self,
            bodies=(*self.bodies, *(i for i in items if isinstance(i, Body))),
            laws=(*self.laws, *(i for i in items if isinstance(i, LawUse))),
            adjustable=(*self.adjustable, *(i for i in items if isinstance(i, Adjustable))),
            walls=(*self.walls, *(i for i in items if isinstance(i, Wall))),
        )

    def plot(self, state: Any = None, **options: Any) -> Any:
        """A figure of the scene where its bodies start, or of a ``state`` of its simulation; as ``render.draw_frame``.

        Raises InputError where a body has no ``initial`` place.
        """
        from .render import draw_frame
        from .snapshot import State

        if state is None:
            lost = [b.id for b in self.bodies if b.initial is None]
            if lost:
                raise InputError("has no initial place to be drawn at", where=f"body {lost[0]}")
            rows = np.array([b.initial for b in self.bodies], dtype=float).reshape(-1, 4)
            zero = np.zeros(len(rows))
            state = State(t=self.time.start, xy=rows[:, :2], v=rows[:, 2:], angle=zero, spin=zero)
        return draw_frame(self, state, **options)

    # ---- changing -----------------------------------------------------------------------------

    def with_laws(self, *items: LawUse) -> Scene:
        """The scene with these laws added."""
        return replace(self, laws=(*self.laws, *items))

    def with_actuator(self, kind: str, value: float, *, bodies: Iterable[str] | None = None) -> Scene:
        """The scene whose drives follow their command with a fault: "lag", "delay" [s] or "saturation".

        The same as adding the law ``actuator_KIND``: it acts on the bending drive and on every driven
        velocity, or on those of ``bodies``.
        """
        law = get_law(f"actuator_{kind}")
        return self.with_laws(use(law, bodies=bodies, **{law.strength[0]: value}))

    def parameter(self, name: str) -> Any:
        """The value of ``LAW.PARAMETER`` in the first use of that law. Raises InputError where there is none."""
        law, _, parameter = name.partition(".")
        for item in self.laws_named(law):
            return item.values[parameter]
        raise InputError("the scene has no such law", where=f"law {law}")

    def with_parameter(self, name: str, value: Any, *, bodies: Iterable[str] | None = None) -> Scene:
        """The scene with ``LAW.PARAMETER`` changed in every use of that law.

        With ``bodies`` the law is split, and changed for those bodies only.
        """
        law, _, parameter = name.partition(".")
        if not self.laws_named(law):
            raise InputError("the scene has no such law", where=f"law {law}")
        laws: list[LawUse] = []
        for item in self.laws:
            if item.name != law:
                laws.append(item)
            elif bodies is None:
                laws.append(item.with_values(**{parameter: value}))
            else:
                wanted = set(bodies)
                acts = item.bodies if item.bodies is not None else tuple(b.id for b in self.bodies if b.mobile)
                rest = tuple(b for b in acts if b not in wanted)
                if rest:
                    laws.append(replace(item, bodies=rest))
                chosen = tuple(b for b in acts if b in wanted)
                if chosen:
                    laws.append(replace(item, bodies=chosen).with_values(**{parameter: value}))
        return replace(self, laws=tuple(laws))

    def with_initial(self, states: Mapping[str, Sequence[float]]) -> Scene:
        """The scene with the states (x, y, vx, vy) of some bodies replaced."""
        bodies = tuple(
            replace(b, initial=tuple(float(v) for v in states[b.id])) if b.id in states else b  # type: ignore[arg-type]
            for b in self.bodies
        )
        return replace(self, bodies=bodies)

    # ---- text, files, hash --------------------------------------------------------------------

    def __str__(self) -> str:
        roles: dict[str, int] = {}
        for body in self.bodies:
            roles[body.role] = roles.get(body.role, 0) + 1
        lines = [self.title or "scene", "  bodies: " + ", ".join(f"{n} {role}" for role, n in roles.items())]
        if self.walls:
            some = ", ".join(w.id or f"{_show(w.begin)} to {_show(w.end)}" for w in self.walls[:8])
            lines.append(f"  straight walls [m]: {some}{' ...' if len(self.walls) > 8 else ''}")
        if self.periodic_x:
            lines.append(f"  periodic along x: {self.periodic_x:g} m")
        if any(self.gravity):
            lines.append(f"  gravity: [{self.gravity[0]:g}, {self.gravity[1]:g}] m/s^2")
        if self.bed:
            lines.append(f"  bed: {self.bed}")
        lines += [f"  {replace(item, values=self.resolved(item))}" for item in self.laws]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """A plain dictionary, as it stands in TOML."""
        data: dict[str, Any] = {"format": "granswim-scene/1", "title": self.title, "seed": self.seed}
        box: dict[str, Any] = {"gravity": list(self.gravity)}
        if self.periodic_x is not None:
            box["periodic_x"] = self.periodic_x
        if self.bed is not None:
            box["bed"] = {
                "height": self.bed.height,
                "packing_fraction": self.bed.packing_fraction,
                "grain_diameter": list(self.bed.grain_diameter),
                "density": self.bed.density,
                "layers": self.bed.layers,
            }
        data["scene"] = box
        data["time"] = {k: v for k, v in vars(self.time).items() if v is not None}
        if self.camera:
            data["camera"] = dict(self.camera)
        if self.frames:
            data["frames"] = dict(self.frames)
        if self.inputs:
            data["input"] = {k: {"t": list(t), "value": list(v)} for k, (t, v) in self.inputs.items()}
        if self.walls:
            data["wall"] = [wall.to_dict() for wall in self.walls]
        data["body"] = [_body_to_dict(b) for b in self.bodies]
        data["law"] = [_law_to_dict(item) for item in self.laws]
        if self.adjustable:
            data["adjustable"] = [
                {k: v for k, v in vars(a).items() if not (k == "per" and v == "all")} for a in self.adjustable
            ]
        return data

    def to_toml(self) -> str:
        return tomli_w.dumps(self.to_dict())

    @property
    def identity(self) -> str:
        """SHA-256 of what the scene says, titles and pictures left out; it goes into every output."""
        data = self.to_dict()
        data.pop("title"), data.pop("frames", None)
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()

    @property
    def hash(self) -> str:
        """SHA-256 of everything that changes a run: what the scene says, and what its laws do.

        Of a law: bytecode, constants, defaults, closure, the functions it calls, how it is declared. It keys
        caches; bytecode differs between versions of Python, so it is stored nowhere as the scene's identity.
        """
        return fingerprint(__version__, self.identity, [item.law.fingerprint for item in self.laws])


# ---- automatic values -------------------------------------------------------------------------


def _mean_grain_mass(scene: Scene, item: LawUse) -> float:
    grains = [b.mass for b in scene.bodies if b.role == "grain"]
    if not grains and scene.bed is not None:
        low, high = scene.bed.grain_diameter
        # mean of a sphere's mass over a uniform diameter: <d^3> = (a^4 - b^4)/(4 (a - b))
        cube = (high**4 - low**4) / (4 * (high - low)) if high > low else low**3
        return scene.bed.density * math.pi / 6 * cube
    return float(np.mean(grains or [b.mass for b in scene.bodies if b.mobile]))


def _disk_distance(scene: Scene, item: LawUse) -> float:
    """The length of the union, else twice the radius of the first disk."""
    for union in scene.laws_named("union"):
        if union.values["length"] is not AUTOMATIC:
            return float(union.values["length"])
    return 2 * scene.bodies[scene.swimmer[0]].radius if scene.swimmer else 0.0


FEW_BODIES = 100  # up to here every pair may be in the neighbour list
UNLIMITED = 1.0e3  # m


def _far_range(scene: Scene, item: LawUse) -> float:
    """Gap to which a force at a distance reaches: no limit among few bodies, six mean radii in a bed.

    With a period never beyond what the nearest image covers.
    """
    radii = [b.radius for b in scene.bodies]
    reach = UNLIMITED if len(radii) <= FEW_BODIES else 6 * float(np.mean(radii))
    if scene.periodic_x is not None:
        reach = min(reach, 0.45 * scene.periodic_x - 2 * max(radii))
    return reach


def _wall_line(side: int) -> Callable[[Scene, LawUse], float]:
    """The line [m] that the walls below (-1) or above (+1) the mobile bodies touch from outside."""

    def work_out(scene: Scene, item: LawUse) -> float:
        walls = [(b.initial[1], b.radius) for b in scene.bodies if not b.mobile and b.initial is not None]
        if not walls and scene.walls:
            return side * UNLIMITED  # straight walls are looked at themselves
        if not walls:
            raise InputError("needs bodies with role wall, or straight walls", where=f"law {item.name}")
        places = [b.initial[1] for b in scene.bodies if b.mobile and b.initial is not None]
        middle = float(np.mean(places or [y for y, _ in walls]))
        # the outermost row only: walls at the sides are no floor
        last = max(side * y for y, _ in walls)
        row = [(y, r) for y, r in walls if last - side * y < r and side * (y - middle) > 0]
        return side * min((side * y - r for y, r in row), default=UNLIMITED)

    return work_out


# LAW.PARAMETER, or PARAMETER in any law: what stands for an AUTOMATIC value. A law that refines another
# takes what is not listed here from that one.
_AUTOMATIC: dict[str, Callable[[Scene, LawUse], Any]] = {
    "mean_mass": _mean_grain_mass,
    "union.length": _disk_distance,
    "bending.length": _disk_distance,
    "distance_force.range": _far_range,
    "pair_lubrication.cutoff": lambda scene, item: 5 * float(item.values["range"]),
    "wall_drag.bottom": _wall_line(-1),
    "wall_drag.top": _wall_line(+1),
}
# where an automatic value is taken from a refined law's parameter of another name: that LAW.PARAMETER
_RENAMED = {
    "contact_friction.stiffness": "contact_linear.stiffness",
    "contact_friction.hertz": "contact_hertz.stiffness",
    "rolling_resistance.stiffness": "contact_linear.stiffness",
    "rolling_resistance.hertz": "contact_hertz.stiffness",
}


def _body_to_dict(body: Body) -> dict[str, Any]:
    data: dict[str, Any] = {"id": body.id, "role": body.role, "radius": body.radius, "mass": body.mass}
    if not body.observed:
        data["observed"] = False
    if body.role == "wall" and body.initial is not None:
        data["x"], data["y"] = body.initial[:2]
    elif body.initial is not None:
        data["initial"] = list(body.initial)
    if body.inertia is not None:
        data["inertia"] = body.inertia
    return data


def _law_to_dict(item: LawUse) -> dict[str, Any]:
    data: dict[str, Any] = {"name": item.name}
    if item.bodies is not None:
        if len(item.bodies) == 1:
            data["body"] = item.bodies[0]
        else:
            data["bodies"] = list(item.bodies)
    for name, value in item.values.items():
        if value is not AUTOMATIC:
            data[name] = list(value) if isinstance(value, tuple) else value
    return data


# ---- reading ----------------------------------------------------------------------------------


class _Reader:
    """Reads tables of a TOML file; unknown keys are an error (scene) or a warning (recording)."""

    def __init__(self, file: Any, strict: bool) -> None:
        self.file = file
        self.strict = strict

    def error(self, message: str, where: str | None = None) -> InputError:
        return InputError(message, file=self.file, where=where)

    def unknown(self, keys: Iterable[str], where: str, known: Iterable[str]) -> None:
        for key in keys:
            message = f"unknown key {key!r}; known: {', '.join(sorted(known))}"
            if self.strict:
                raise self.error(message, where)
            warnings.warn(f"{self.file}: {where}: {message}; it is left out", SceneWarning, stacklevel=4)

    def unknown_input(self, name: str) -> None:
        """A command for something that is no body of the scene."""
        message = "is the name of no body of the scene"
        if self.strict:
            raise self.error(message, f"input {name}")
        warnings.warn(f"{self.file}: input {name}: {message}; it is left out", SceneWarning, stacklevel=4)

    def table(self, data: Any, where: str, known: Sequence[str]) -> dict[str, Any]:
        if not isinstance(data, Mapping):
            raise self.error("should be a table", where)
        self.unknown([k for k in data if k not in known], where, known)
        return {k: v for k, v in data.items() if k in known}

    def tables(self, data: Any, where: str) -> list[Any]:
        if not isinstance(data, list):
            raise self.error(f"should be written [[{where}]]", where)
        return data


BODY_KEYS = ("id", "role", "radius", "mass", "observed", "initial", "inertia", "x", "y")


def _read_body(data: Any, reader: _Reader) -> Body:
    if not isinstance(data, Mapping):
        raise reader.error(f"should be a table, got {data!r}", "body")
    where = f"body {data.get('id', '(without id)')}"
    data = reader.table(data, where, BODY_KEYS)
    for key in ("id", "role", "radius"):
        if key not in data:
            raise reader.error(f"needs {key}", where)
    role = data["role"]
    if role != "wall" and "mass" not in data:
        raise reader.error("needs mass [kg]", where)
    initial = data.get("initial")
    if initial is not None:
        initial = _numbers(initial, 4, "initial", "m, m, m/s, m/s", file=reader.file, where=where)
    elif "x" in data or "y" in data:
        x = _number(data.get("x"), "x", "m", file=reader.file, where=where)
        y = _number(data.get("y"), "y", "m", file=reader.file, where=where)
        initial = (x, y, 0.0, 0.0)
    elif role == "wall":
        raise reader.error("a wall needs x and y [m]", where)
    observed = data.get("observed", True)
    if not isinstance(observed, bool):
        raise reader.error(f"observed should be true or false, got {observed!r}", where)
    try:
        return Body(
            id=str(data["id"]),
            role=role,
            radius=data["radius"],
            mass=data.get("mass", 1.0),
            observed=observed,
            initial=initial,
            inertia=data.get("inertia"),
        )
    except InputError as error:
        raise InputError(error.message, file=reader.file, where=error.where) from None


def _read_bodies_csv(path: Path, reader: _Reader) -> list[Body]:
    """``id,role,radius,mass,observed[,inertia][,x,y[,vx,vy]]``, empty where not given."""
    known = ("id", "role", "radius", "mass", "observed", "inertia", "x", "y", "vx", "vy")
    try:
        with ordinary_file(path, LARGEST_TABLE).open(newline="", encoding="utf-8-sig") as handle:
            rows = list(islice(csv.DictReader(handle), MOST_BODIES + 1))
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=path) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"is not a CSV in UTF-8: {error}", file=path) from None
    if len(rows) > MOST_BODIES:
        raise InputError(f"has more than {MOST_BODIES} bodies; so many cannot be computed", file=path)
    bodies = []
    inner = _Reader(path, reader.strict)
    for line, row in enumerate(rows, start=2):
        where = f"row {line}"
        if None in row or None in row.values():
            raise inner.error("has another number of columns than the header", where)
        inner.unknown([k for k in row if k not in known], where, known) if line == 2 else None
        data: dict[str, Any] = {}
        for key, text in row.items():
            text = (text or "").strip()
            if key not in known or text == "":
                continue
            if key in ("id", "role"):
                data[key] = text
            elif key == "observed":
                if text.lower() not in ("true", "false", "1", "0"):
                    raise inner.error(f"observed should be true or false, got {text!r}", where)
                data[key] = text.lower() in ("true", "1")
            else:
                try:
                    data[key] = float(text)
                except ValueError:
                    raise inner.error(f"{key} should be a number, got {text!r}", where) from None
        if "vx" in data or "vy" in data:
            data["initial"] = [data.pop("x", None), data.pop("y", None), data.pop("vx", None), data.pop("vy", None)]
        bodies.append(_read_body(data, inner))
    return bodies


def _read_law(data: Any, reader: _Reader) -> LawUse:
    if not isinstance(data, Mapping) or "name" not in data:
        raise reader.error("needs a name", "law")
    name = str(data["name"])
    given = [key for key in data if key not in ("name", "body", "bodies")]
    declared = get_law(name, given=given, file=reader.file)
    bodies: Any = data.get("bodies")
    if "body" in data:
        bodies = [data["body"]]
    if bodies is not None and (isinstance(bodies, str) or not isinstance(bodies, Sequence)):
        raise reader.error("bodies should be a list of ids", f"law {name}")
    values = {k: v for k, v in data.items() if k not in ("name", "body", "bodies")}
    known = [p.name for p in declared.parameters]
    reader.unknown([k for k in values if k not in known], f"law {name}", known)
    values = {k: (tuple(v) if isinstance(v, list) else v) for k, v in values.items() if k in known}
    return LawUse(
        declared, declared.check(values, file=reader.file), None if bodies is None else tuple(map(str, bodies))
    )


def _read_adjustable(data: Any, reader: _Reader, laws: Sequence[LawUse]) -> Adjustable:
    where = "adjustable"
    data = reader.table(data, where, ("law", "parameter", "low", "high", "per"))
    for key in ("law", "parameter", "low", "high"):
        if key not in data:
            raise reader.error(f"needs {key}", where)
    name = f"{data['law']}.{data['parameter']}"
    where = f"adjustable {name}"
    per = data.get("per", "all")
    if per not in ("all", "body", "recording"):
        raise reader.error(f'per should be "body" or "recording", got {per!r}', where)
    return Adjustable(
        law=str(data["law"]),
        parameter=str(data["parameter"]),
        low=_number(data["low"], "low", "as the parameter", file=reader.file, where=where),
        high=_number(data["high"], "high", "as the parameter", file=reader.file, where=where),
        per=per,
    )


SCENE_KEYS = (
    "format", "title", "seed", "scene", "time", "camera", "frames", "input", "bodies", "body", "wall", "law",
    "adjustable", "swimmer",
)  # fmt: skip


def scene_from_dict(
    data: Mapping[str, Any], *, file: str | Path | None = None, strict: bool = True, extra: Sequence[str] = ()
) -> Scene:
    """Build a scene from what stands in a TOML file.

    ``strict``: unknown keys are an error (a scene to be run) rather than a warning (a recording).
    ``extra``: further top-level keys that the caller reads itself.
    Raises InputError naming file, table and key.
    """
    reader = _Reader(file, strict)
    folder = Path(file).parent if file is not None else Path(".")
    reader.unknown([k for k in data if k not in SCENE_KEYS and k not in extra], "top level", SCENE_KEYS)

    box = reader.table(data.get("scene", {}), "scene", ("gravity", "periodic_x", "bed"))
    gravity = _numbers(box.get("gravity", [0.0, 0.0]), 2, "gravity", "m/s^2", file=file, where="scene")
    periodic_x = box.get("periodic_x")
    if periodic_x is not None:
        periodic_x = _number(periodic_x, "periodic_x", "m", file=file, where="scene", positive=True)
    bed = None
    if "bed" in box:
        table = reader.table(
            box["bed"], "scene.bed", ("height", "packing_fraction", "grain_diameter", "density", "layers")
        )
        for key in ("height", "packing_fraction", "grain_diameter", "density"):
            if key not in table:
                raise reader.error(f"needs {key}", "scene.bed")
        low, high = _numbers(table["grain_diameter"], 2, "grain_diameter", "m", file=file, where="scene.bed")
        if not 0 < low <= high:
            raise reader.error(f"grain_diameter should be [low, high] above zero, got [{low}, {high}]", "scene.bed")
        fraction = _number(table["packing_fraction"], "packing_fraction", "1", file=file, where="scene.bed")
        if not 0 < fraction <= 0.9:
            raise reader.error(f"packing_fraction should lie between 0 and 0.9, got {fraction:g}", "scene.bed")
        bed = Bed(
            height=_number(table["height"], "height", "m", file=file, where="scene.bed", positive=True),
            packing_fraction=fraction,
            grain_diameter=(low, high),
            density=_number(table["density"], "density", "kg/m^3", file=file, where="scene.bed", positive=True),
            layers=_number(table.get("layers", 0.0), "layers", "1", file=file, where="scene.bed"),
        )

    bodies = [_read_body(item, reader) for item in reader.tables(data.get("body", []), "body")]
    if "bodies" in data:
        if not isinstance(data["bodies"], str):
            raise reader.error("should name a file", "bodies")
        bodies += _read_bodies_csv(folder / data["bodies"], reader)
    if "swimmer" in data:
        bodies = _read_swimmer(data["swimmer"], reader) + bodies
    if not bodies:
        raise reader.error("has no bodies: write [[body]], or bodies = FILE.csv")

    walls = [_read_wall(item, reader) for item in reader.tables(data.get("wall", []), "wall")]
    laws = [_read_law(item, reader) for item in reader.tables(data.get("law", []), "law")]
    adjustable = [
        _read_adjustable(item, reader, laws) for item in reader.tables(data.get("adjustable", []), "adjustable")
    ]

    time = reader.table(data.get("time", {}), "time", ("dt", "start", "duration", "output", "scheme"))
    scheme = time.pop("scheme", SCHEMES[0])
    numbers = {
        key: _number(value, key, "s", file=file, where="time", positive=key != "start") for key, value in time.items()
    }
    inputs = _read_input(data.get("input", {}), reader, folder)
    for key in [key for key in inputs if not any(body.id == key for body in bodies)]:
        reader.unknown_input(key)
        del inputs[key]
    seed = data.get("seed", 0)
    if not isinstance(seed, int):
        raise reader.error(f"should be a whole number from 0 to 2^63 - 1, got {seed!r}", "seed")
    check_seed(seed)
    for key in ("camera", "frames"):
        if not isinstance(data.get(key, {}), Mapping):
            raise reader.error("should be a table", key)
    try:
        return Scene(
            bodies=tuple(bodies),
            laws=tuple(laws),
            gravity=(gravity[0], gravity[1]),
            periodic_x=periodic_x,
            bed=bed,
            adjustable=tuple(adjustable),
            time=Time(**numbers, scheme=scheme),
            inputs=inputs,
            camera=dict(data.get("camera", {})),
            frames=dict(data.get("frames", {})),
            seed=seed,
            title=str(data.get("title", "")),
            walls=tuple(walls),
        )
    except InputError as error:
        raise InputError(error.message, file=file, where=error.where) from None


def _read_wall(data: Any, reader: _Reader) -> Wall:
    where = f"wall {data['id']}" if isinstance(data, Mapping) and "id" in data else "wall"
    data = reader.table(data, where, WALL_KEYS)
    for key in ("from", "to"):
        if key not in data:
            raise reader.error(f"needs {key} = [x, y] [m]", where)
    try:
        return Wall(data["from"], data["to"], data.get("radius", 0.0), str(data.get("id", "")))
    except InputError as error:
        raise InputError(error.message, file=reader.file, where=error.where) from None


def _read_input(data: Any, reader: _Reader, folder: Path) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
    """``[input.BODY]`` with the lists t and value, or the name of a CSV."""
    if isinstance(data, str):
        return read_inputs(folder / data)
    if not isinstance(data, Mapping):
        raise reader.error("should be a table, or name a file", "input")
    inputs = {}
    for key, table in data.items():
        try:
            t, value = (tuple(map(float, table[name])) for name in ("t", "value"))
        except (KeyError, TypeError, ValueError):
            raise reader.error("needs two lists of numbers, t and value", f"input.{key}") from None
        if len(t) != len(value) or not t:
            raise reader.error(f"t has {len(t)} numbers and value {len(value)}", f"input.{key}")
        if not all(map(math.isfinite, (*t, *value))) or any(b <= a for a, b in pairwise(t)):
            raise reader.error("numbers should be finite and t should rise", f"input.{key}")
        inputs[key] = (t, value)
    return inputs


def _read_swimmer(data: Any, reader: _Reader) -> list[Body]:
    """``[swimmer]``: disks, radius, density, head_mass_factor, head = [x, y]; straight along +x."""
    table = reader.table(data, "swimmer", ("disks", "radius", "density", "head_mass_factor", "head"))
    try:
        return swimmer(**table)
    except (TypeError, InputError) as error:
        raise reader.error(str(error), "swimmer") from None


def swimmer(
    *,
    disks: int = 7,
    radius: float = 1.5e-3,
    density: float = 1004.0,
    head_mass_factor: float = 7.0,
    head: Sequence[float] = (0.0, 0.0),
) -> list[Body]:
    """The bodies of a straight swimmer at rest, head first, lying along +x from its head.

    Masses are those of spheres, rho 4/3 pi r^3; the head has ``head_mass_factor`` times that.
    """
    if isinstance(disks, bool) or not isinstance(disks, int) or not 1 <= disks:
        raise InputError(f"disks should be a whole number above zero, got {disks!r}")
    if disks > MOST_BODIES:
        raise _too_many(disks)
    for name, value, unit in (("radius", radius, "m"), ("density", density, "kg/m^3"),
                              ("head_mass_factor", head_mass_factor, "1")):  # fmt: skip
        _number(value, name, unit, file=None, where=None, positive=True)
    head = _numbers(head, 2, "head", "m", file=None, where=None)
    mass = density * 4 / 3 * math.pi * radius**3
    return [
        Body(
            id=str(i),
            role="head" if i == 0 else "tail",
            radius=radius,
            mass=mass * (head_mass_factor if i == 0 else 1.0),
            initial=(float(head[0]) + 2 * radius * i, float(head[1]), 0.0, 0.0),
        )
        for i in range(disks)
    ]


def read_inputs(path: str | Path) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
    """Read ``input.csv`` (t,name,value): commands given to the apparatus. Raises InputError with the row."""
    path = Path(path)
    series: dict[str, list[tuple[float, float]]] = {}
    try:
        with ordinary_file(path, LARGEST_TABLE).open(newline="", encoding="utf-8-sig") as handle:
            rows = csv.reader(handle)
            header = [c.strip() for c in next(rows, [])]
            if sorted(header) != ["name", "t", "value"]:
                raise InputError(f"header should be t,name,value, got {','.join(header)}", file=path)
            at = {name: header.index(name) for name in header}
            for line, row in enumerate(rows, start=2):
                if not row:
                    continue
                try:
                    t, value = float(row[at["t"]]), float(row[at["value"]])
                    name = row[at["name"]].strip()
                except (ValueError, IndexError):
                    raise InputError(
                        f"expected a time, a name and a number, got {','.join(row)}", file=path, where=f"row {line}"
                    ) from None
                if not (math.isfinite(t) and math.isfinite(value)):
                    raise InputError("a number is not finite", file=path, where=f"row {line}")
                series.setdefault(name, []).append((t, value))
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=path) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"is not a CSV in UTF-8: {error}", file=path) from None
    result = {}
    for name, pairs in series.items():
        pairs.sort()
        times = tuple(p[0] for p in pairs)
        if any(b <= a for a, b in pairwise(times)):
            raise InputError("two rows for one time", file=path, where=f"input {name}")
        result[name] = (times, tuple(p[1] for p in pairs))
    return result


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file; InputError names file and line, or the key of an absurd number."""
    path = Path(path)
    try:
        text = ordinary_file(path, LARGEST_TOML).read_bytes().decode("utf-8-sig")
        check_keys(text, path)
        data = tomllib.loads(text)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=path) from None
    except UnicodeDecodeError:
        raise InputError("is not a text in UTF-8", file=path) from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"is not valid TOML: {error}", file=path) from None
    except ValueError:  # Python refuses to convert so many digits
        raise InputError("is not valid TOML: an integer has thousands of digits", file=path) from None
    _check_numbers(data, path)
    return data


def _check_numbers(data: Mapping[str, Any], file: Path) -> None:
    """Refuse numbers that no float holds or no experiment gives before anything computes with them, or prints them.

    Very deep tables too: whatever walks through them would be stopped by Python itself.
    """
    waiting: list[tuple[Any, str, int]] = [(data, "", 0)]
    while waiting:
        value, key, depth = waiting.pop()
        if depth > DEEPEST:
            raise InputError(f"is nested deeper than {DEEPEST}", file=file, where=key.split(".")[0])
        if isinstance(value, Mapping):
            waiting += [(item, f"{key}.{name}" if key else str(name), depth + 1) for name, item in value.items()]
        elif isinstance(value, list):
            waiting += [(item, key, depth + 1) for item in value if isinstance(item, int | float | list | Mapping)]
        elif isinstance(value, int | float) and not isinstance(value, bool) and abs(value) > LARGEST_NUMBER:
            raise InputError("is absurdly large", file=file, where=key)


def read_scene(path: str | Path) -> Scene:
    """Read a scene to be run from TOML. Unknown keys are an error."""
    scene = scene_from_dict(read_toml(path), file=path, strict=True)
    scene.check_overlaps()
    return scene


def write_scene(scene: Scene, path: str | Path) -> None:
    """Write a scene as TOML; ``read_scene`` gives back an equal one (same hash)."""
    Path(path).write_text(scene.to_toml(), encoding="utf-8")


__all__ = [
    "Adjustable", "Bed", "Body", "LawUse", "Parameter", "Scene", "SceneWarning", "Time", "Wall", "read_inputs",
    "read_scene", "read_toml", "scene_from_dict", "swimmer", "use", "write_scene",
]  # fmt: skip
