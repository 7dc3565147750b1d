"""A scene: bodies, box and a list of laws with parameters. Built, printed, hashed."""
from __future__ import annotations

import hashlib
import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import tomli_w

from .. import __version__
from ..errors import InputError
from ..fingerprint import fingerprint
from ..laws import AUTOMATIC, Law, get_law
from ..limits import (
    MOST_BODIES,
    one_title,
)  # fmt: skip
from ..walls import Wall, check_walls, gap_to_wall
from .automatic import AUTOMATIC_VALUES, RENAMED
from .parts import STANDARD_GRAVITY, Adjustable, Bed, Body, LawUse, Time, _show, too_many, use


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
    time: Time = field(default_factory=Time)
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
            raise too_many(len(self.bodies))
        ids = [body.id for body in self.bodies]
        if len(set(ids)) != len(ids):
            twice = Counter(ids).most_common(1)[0][0]
            raise InputError("this id is used twice", where=f"body {twice}")
        check_walls(self.walls, len(ids), ids, self.periodic_x)
        if any(self.gravity) and not any(item.name == "gravity" for item in self.laws):
            # whoever says how strong it is means that it acts
            object.__setattr__(self, "laws", (use("gravity"), *self.laws))
        for item in self.laws:
            self._check_law(item)
        if self.periodic_x is not None and not self.periodic_x > 0:
            raise InputError(f"should be above zero [m], got {self.periodic_x!r}", where="scene.periodic_x")
        for adjustable in self.adjustable:
            uses = [item for item in self.laws if item.name == adjustable.law]
            if not uses:
                raise InputError("the scene has no such law", where=f"adjustable {adjustable.name}")
            uses[0].law.number(adjustable.parameter)
            if not adjustable.low < adjustable.high:
                raise InputError("low should be below high", where=f"adjustable {adjustable.name}")

    def _check_law(self, item: LawUse) -> None:
        """Raise InputError where a law acts on what is not there, or does not say what it acts on."""
        for name in item.bodies or ():
            if name not in self._by_id:
                raise InputError(f"acts on body {name!r}, which the scene does not have", where=f"law {item.name}")
        if item.law.kind == "constraint" and item.name in ("pin", "drive") and item.bodies is None:
            raise InputError("needs `body`, the one it acts on", where=f"law {item.name}")
        if item.law.kind == "link":
            self._check_link(item)

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
        from ..touching import overlapping  # scipy takes long to import

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

    @cached_property
    def ids(self) -> tuple[str, ...]:
        return tuple(body.id for body in self.bodies)

    @cached_property
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
        if wanted is None and refined and item.law.kind in ("body", "constraint", "pair"):
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

    def number(self, item: LawUse, name: str) -> Any:
        """A value of a law, or a component of a vector: ``a_x`` of ``a``."""
        values = self.resolved(item)
        return (values | item.law.components(values))[name]

    def _automatic(self, item: LawUse, parameter: str) -> Any:
        work_out = AUTOMATIC_VALUES.get(f"{item.name}.{parameter}") or AUTOMATIC_VALUES.get(parameter)
        if work_out is not None:
            return work_out(self, item)
        where = f"law {item.name}, parameter {parameter}"
        if not item.law.refines:
            raise InputError("has no automatic value", where=where)
        refined = self._refined(item)
        if not refined:
            raise InputError(f"the scene has no {' or '.join(item.law.refines)} to take it from", where=where)
        source = RENAMED.get(f"{item.name}.{parameter}", parameter)
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
            single = item.law.kind in ("body", "constraint")
            if single and len(refined) > 1 and all(r.bodies is not None for r in refined):
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

    def has_bodies_for(self, law: Law) -> bool:
        """Whether a law that it refines is there, and of a law of pairs two bodies that it acts on, or one and a wall.

        A spring between a bob and a body that nothing holds is none.
        """
        if law.refines and not any(self.laws_named(name) for name in law.refines):
            return False
        least = 1 if self.walls and not law.reach else 2
        return law.kind != "pair" or len(self.rows(LawUse(law, {}))) >= least

    def admits(self, law: Law) -> bool:
        """Whether a law can act here: bodies, chain, walls and the laws that it refines are there."""
        if not self.has_bodies_for(law):
            return False
        drives = law.series is not None and self.laws_named("drive")
        if law.kind == "chain" and not self.joints and not drives:
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
        from ..render import draw_frame
        from ..snapshot import State

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
        for item in items:
            self._check_law(item)
        return self.having_laws((*self.laws, *items))

    def having_laws(self, laws: tuple[LawUse, ...]) -> Scene:
        """The same bodies with these laws, which are not checked again: those of the scene with other numbers.

        A fit does this before every run.
        """
        return self._but(laws=laws)

    def starting_at(self, t: float) -> Scene:
        """The same scene from another time [s] on."""
        return self._but(time=replace(self.time, start=t))

    def _but(self, **other: Any) -> Scene:
        """With other laws or times, which are not checked; what is worked out once is worked out from the bodies."""
        scene = object.__new__(Scene)
        vars(scene).update(vars(self), **other)
        return scene

    def with_actuator(self, kind: str, value: float, *, bodies: Iterable[str] | None = None) -> Scene:
        """The scene whose drives follow their command with a fault: "lag", "delay" [s], "saturation" or "deadband".

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
        return self.having_laws(tuple(laws))

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
