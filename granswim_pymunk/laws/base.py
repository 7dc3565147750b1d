"""What a law is: one function, its declared parameters, one expression, one reference.

A law's function takes what it needs by name, as a test takes fixtures: the names of the state it
looks at (see ``STATE`` below) and the names of its parameters. Lifting it to bodies, pairs, chains
and lists is the engine's business, so base physics and candidates for missing physics are written
the same way, and a user's script can add one::

    from granswim_pymunk.laws import Parameter, law

    @law(kind="body", expression="F = -k x", reference="Hooke 1678",
         parameters=[Parameter("k", "N/m", "stiffness", low=0.0)])
    def trap(x, y, k):
        return -k * x, -k * y

Everything a law sees and returns is in SI (m, kg, s, rad, N).

Kinds
-----
``body``
    returns ``(fx, fy)`` [N], the force on one body.
``pair``
    for two bodies whose gap is below ``reach`` (0: contact); n points from i to j, t is n turned by
    +90 degrees; returns ``(fn, ft)`` [N], the force on j along n and t; i gets the opposite. A law that
    asks for ``spin_i`` or ``spin_j`` returns ``(fn, ft, mi, mj)``, with a torque on each besides [N m].
``chain``
    of a swimmer. Sees one joint (``bend``, ``rate``, ``index``) and returns the force F_t [N] across the segment
    behind it, on disk i + 1; disk i gets the opposite. A law that asks for ``vt`` returns ``(F_t, across)``: the second
    acts on the segment alone, whatever the form of the bending. A law with a ``series``, or that asks for ``command``,
    returns the angle [rad] of the head's axis. A law that asks for ``fx``, ``fy`` sees the arrays of the whole
    swimmer, head first, and adds to these two. ``damping=True`` where it is a friction. Amplitude, frequency and phase
    of the head's axis, form and resting length are the law's parameters of these names (``laws.bending.of_bending``).
``joint``
    sees the rate of turning and the bend of a pin or hinge and returns the torque [N m] on the second body; the first
    gets the opposite. A friction: ``damping`` is set.
``link``
    what a hinge or rod holds at zero between two bodies; the engine solves for the forces of all links together.
``constraint``
    sees the sum of all other forces on one body and returns what must be added to it.
``impulse``
    an instantaneous collision; Chipmunk's own solver performs it.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import math
import pickle
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from ..errors import InputError
from ..fingerprint import fingerprint

STATE: dict[str, dict[str, str]] = {
    "body": {
        "t": "time [s]",
        "dt": "time step [s]",
        "x": "position [m] (unwrapped)",
        "y": "position [m]",
        "vx": "velocity [m/s]",
        "vy": "velocity [m/s]",
        "mass": "mass [kg]",
        "radius": "radius [m]",
        "wall_gap": "gap to the nearest straight wall [m], infinite where there is none",
        "r0": "mean radius of the bodies the law acts on [m]",
        "mean_mass": "mean mass of the grains [kg]",
        "g": "size of gravity [m/s^2], 9.81 where the scene has none",
        "gx": "gravity of the scene, x [m/s^2]",
        "gy": "gravity of the scene, y [m/s^2]",
    },
    "pair": {
        "t": "time [s]",
        "gap": "distance of centres less the sum of radii [m]",
        "distance": "distance of centres [m]",
        "vn": "relative velocity of j against i along n [m/s]",
        "vt": "relative surface velocity of j against i along t, spin counted [m/s]",
        "radius_i": "radius of i [m]",
        "radius_j": "radius of j [m]",
        "spin_i": "angular velocity of i [rad/s]; the law then returns (fn, ft, torque on i, torque on j)",
        "spin_j": "angular velocity of j [rad/s]; as spin_i",
        "reduced_mass": "m_i m_j/(m_i + m_j), that of the mobile one against a wall [kg]",
        "reduced_radius": "r_i r_j/(r_i + r_j) [m]",
        "r0": "mean radius of the bodies the law acts on [m]",
    },
    "chain": {
        "t": "time [s]",
        "x": "(n,) positions, head first [m]",
        "y": "(n,) positions [m]",
        "vx": "(n,) velocities [m/s]",
        "vy": "(n,) velocities [m/s]",
        "mass": "(n,) masses [kg]",
        "fx": "(n,) force, to be added to [N]",
        "fy": "(n,) force, to be added to [N]",
        "index": "of a joint: which one, 0 the one against the head's axis",
        "bend": "of a joint: angle of the segment behind it against the one before, or the head's axis [rad]",
        "rate": "of a joint: rate at which it bends [rad/s]",
        "vt": "of a joint: velocity of disk i + 1 against disk i across the segment [m/s]",
        "reduced_mass": "of a joint: m_i m_(i+1)/(m_i + m_(i+1)) [kg]",
        "command": "of the head's axis: the angle that it is told [rad]",
    },
    "joint": {
        "t": "time [s]",
        "rate": "angular velocity of b less that of a; in a pin that of the rod [rad/s]",
        "bend": "angle of b less that of a [rad]",
    },
    "link": {
        "x_i": "place of the first body [m]",
        "y_i": "place of the first body [m]",
        "angle_i": "its angle [rad]",
        "x_j": "place of the second body [m]",
        "y_j": "place of the second body [m]",
        "angle_j": "its angle [rad]",
    },
    "constraint": {
        "t": "time [s]",
        "dt": "time step [s]",
        "x": "position [m]",
        "y": "position [m]",
        "vx": "velocity, half a step behind [m/s]",
        "vy": "velocity, half a step behind [m/s]",
        "mass": "mass [kg]",
        "given_inertia": "moment of inertia about the centre [kg m^2], 0 where none was given",
        "fx": "sum of all other forces [N]",
        "fy": "sum of all other forces [N]",
        "g": "size of gravity [m/s^2], 9.81 where the scene has none",
        "command": "commanded value of the body's input over the coming step",
    },
    "impulse": {},
}


@dataclass(frozen=True)
class Parameter:
    """One parameter of a law.

    ``size`` 2 is a vector, which the law's function sees as ``NAME_x`` and ``NAME_y``. ``choices`` of
    strings reach the function as their position in the list. A ``default`` of None means required.
    """

    name: str
    unit: str
    meaning: str
    default: Any = None
    low: float = -math.inf
    high: float = math.inf
    size: int = 1
    choices: tuple[Any, ...] = ()
    # numeric choices are asked where bodies are alike, too: no power of what bodies differ in, radius or mass
    always: bool = False
    # the size of a first try when the parameter is to be found from data; None: not fitted
    typical: float | None = None
    # the value of a strength at which the law is absent
    neutral: float = 0.0
    # "speed": no larger than the fastest body moves, or it explains nothing;  "amplitude": no larger than that of the
    # drive, above which it does nothing;  "weight": no less than masses are off by where gravity moves what nothing
    # holds, as it acts on mass and inertia alike;  "sight": of a layer along walls, no thinner or wider than shows;
    # "lean": of a curvature, none with which what was seen of a surface leans by a radian at its end, or is no surface;
    # "tracks": a place, no farther from the middle of all tracks than bodies that were seen can tell
    within: str = ""
    # the size of a first try in a bed of grains, where its unit does not tell it: a number, or a multiple of the force
    # that shows there ("force", N), or of that force over the grains' speed ("drag", kg/s)
    in_bed: float | None = None
    in_bed_times: str = ""
    # of one of several strengths: without it the law is another one, as a spring that is not stiff
    needed: bool = False
    # -1: it is tried below its neutral value first, as of a joint that is weaker
    side: int = 0
    # up to which a strength is what laboratories are off by in what they believe; 0: it is never that
    ordinary: float = 0.0
    # by how much a strength is off in any laboratory, one standard deviation: an error that nobody states, and beside
    # which other laws have to explain something; 0: it is no such error
    usual: float = 0.0
    # of the shape of a form without a name: values that no law with a name has, at which that form is held beside one
    asked: tuple[float, ...] = ()

    @property
    def arguments(self) -> tuple[str, ...]:
        return (self.name,) if self.size == 1 else (f"{self.name}_x", f"{self.name}_y")

    def check(self, value: Any, *, law: str, file: Any = None) -> Any:
        """Return ``value`` as float, pair or choice; raise InputError naming law and parameter."""
        where = f"law {law}, parameter {self.name}"
        if self.choices:
            if value not in self.choices:
                names = ", ".join(map(str, self.choices))
                raise InputError(f"{value!r} is not one of {names}", file=file, where=where)
            return value
        values = list(value) if self.size > 1 and isinstance(value, Iterable) else [value]
        if len(values) != self.size:
            raise InputError(f"expected {self.size} numbers [{self.unit}], got {value!r}", file=file, where=where)
        unit = "" if self.unit == "1" else f" {self.unit}"
        for number in values:
            if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
                raise InputError(f"expected a finite number [{self.unit}], got {number!r}", file=file, where=where)
            if abs(number) > 1e100:
                raise InputError(f"{number:g}{unit} is absurdly large", file=file, where=where)
            if not self.low <= number <= self.high:
                raise InputError(
                    f"{number:g}{unit} is outside [{self.low:g}, {self.high:g}]", file=file, where=where
                )
        return float(values[0]) if self.size == 1 else tuple(float(number) for number in values)

    def encode(self, value: Any) -> tuple[float, ...]:
        """The numbers that the compiled function gets."""
        if self.choices and isinstance(self.choices[0], str):
            return (float(self.choices.index(value)),)
        return tuple(float(number) for number in value) if self.size > 1 else (float(value),)


# what a law may be to a scene
ROLES = {
    "": "nothing that anybody asks for",
    "contact": "between bodies that touch",
    "spin": "turns bodies that touch",
    "link": "holds the disks of a swimmer together",
    "stroke": "bends a swimmer at one frequency",
    "command": "a body follows a series",
    "late": "shifts a drive in time",
    "limit": "bends a command as it is, without memory",
    "drag": "against a medium at rest",
    "medium": "a drag against a medium that moves",
    "push": "the same on all bodies, always",
    "surface": "the slope of what bodies slide or roll on",
    "pendulum": "a body swings about a place",
    "guide": "a body moves along a line",
    "bar": "holds the centres of two bodies apart",
    "pivot": "two bodies, or one and the world, turn about a point",
    "tether": "draws a body to a place",
    "source": "a force from a place at which nothing is seen",
    "beat": "a force at one frequency, of what nobody sees",
    "brake": "holds a body that has come to rest",
    # of forms without a name: what they are smooth in
    "place": "a force smooth in place",
    "speed": "a drag smooth in speed",
    "cycle": "a drag smooth in the drive's phase",
    "across": "a force across the motion",
}


# what a law with the role "push" is in an apparatus: of another size than the scene's, of a table, or anything else
PUSHES = ("gravity", "tilt", "push")


@dataclass(frozen=True, eq=False)
class Law:
    """A declared law. Call it as the plain Python function it was made from."""

    name: str
    kind: str
    function: Callable[..., Any]
    parameters: tuple[Parameter, ...]
    expression: str
    reference: str
    compiled: bool = True
    reach: str | None = None
    # the parameters that make up the strength: zero (their ``neutral`` value) means that the law is absent
    strength: tuple[str, ...] = ()
    # may be proposed as physics that a scene lacks: "named", "beside" (a name that stands beside another alone: any
    # smooth force has a part of it), or "flexible" (a form that names nothing)
    candidate: str = ""
    # how a sentence calls it: "a uniform force"; its name where empty
    phrase: str = ""
    # laws one of which must be in the scene: this one acts where that one does (unless it names bodies),
    # and its automatic parameters are that one's parameters of the same name
    refines: tuple[str, ...] = ()
    # what it makes of a commanded series: series(t, value, **values) -> (t, value)
    series: Callable[..., Any] | None = None
    # the mechanism that it is a form of, its own name where empty; and how it differs from the law of that name
    form_of: str = ""
    form: str = ""
    # laws of an apparatus in which this law goes before its equals (joint_drag in a pin); there it stands for others,
    # whose effect can hardly be told from its own and which are then rivals, not names
    preferred_where: tuple[str, ...] = ()
    stands_for: tuple[str, ...] = ()
    # laws that are this one with some of its numbers at their neutral values (a flow at rest is a drag)
    nests: tuple[str, ...] = ()
    # what it is to a scene, so that none who asks needs its name: one of ``ROLES``
    role: str = ""
    # the parameter of a contact that says what impacts lose
    loses: str = ""
    # the same of what impacts at straight walls lose, where that is a number of its own
    loses_at_walls: str = ""
    # it is looked for on the swimmer and on the grains alone from the beginning: on all it looks like something else
    apart: bool = False
    # apparatus that does one and the same to a drive of a single frequency
    same_as: tuple[str, ...] = ()
    # a drag or a friction: where the scheme is exact it sees the velocity of the time of the positions, not that of
    # half a step before. All laws of kind body that look at a velocity are; others say so
    damping: bool = False
    # such a law of kind body whose force is -c (v - u), c and u the same everywhere and at all times: the exact scheme
    # then costs nothing (the body is kicked as if it were heavier by c dt/2). Of kind constraint: what it adds is a
    # fixed share of the force
    linear: bool = False
    # of a form without a name that is a series: its strengths to first order; all of them where empty
    low_order: tuple[str, ...] = ()

    @property
    def mechanism(self) -> str:
        """Its name among the mechanisms: two laws can be forms of one (joint_friction of a pin, of a swimmer)."""
        return self.form_of or self.name

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self.function(*args, **kwargs)

    @functools.cached_property
    def arguments(self) -> tuple[str, ...]:
        """Names of what the function is given."""
        return tuple(inspect.signature(self.function).parameters)

    @property
    def sees_joint(self) -> bool:
        """Whether a law of a swimmer sees one joint, or the head's axis, and not the arrays of all disks."""
        return self.kind == "chain" and not {"fx", "fy"} & set(self.arguments)

    @property
    def shipped(self) -> bool:
        """Whether the law comes with the package; one made by ``exec`` has no module at all."""
        return (self.function.__module__ or "").startswith("granswim_pymunk.")

    @property
    def fingerprint(self) -> str:
        """What the law does: its functions, constants and all, and how it is declared. It keys caches."""
        declared = [self.name, self.kind, self.reach, self.strength, self.refines, self.form_of, self.compiled]
        numbers = [(p.name, p.size, p.choices, repr(p.default)) for p in self.parameters]
        return fingerprint(declared, numbers, self.function, self.series)

    def __reduce__(self) -> tuple[Any, ...]:
        """How the law goes to another process: by where it is found, or, from a script or shell, as a whole.

        ``@law`` puts the law in the place of its function, so the function alone cannot be found by its name.
        """
        module, place = self.function.__module__, self.function.__qualname__
        whole = None
        if module == "__main__" or _law_at(module, place) is not self:
            # a worker of a cluster has not seen this script
            from numba import cloudpickle  # type: ignore[attr-defined]

            values = {f.name: getattr(self, f.name) for f in fields(self)}
            whole = cloudpickle.dumps(values)
        return _received, (self.name, module, place, self.fingerprint, sys.version, whole)

    def parameter(self, name: str) -> Parameter:
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        known = ", ".join(p.name for p in self.parameters) or "none"
        raise InputError(f"unknown parameter {name!r}; it has: {known}", where=f"law {self.name}")

    def number(self, name: str) -> Parameter:
        """A single number: a parameter, or a component of one that is a vector, ``a_x`` of ``a``."""
        vector = next((p for p in self.parameters if p.size > 1 and name in p.arguments), None)
        return self.parameter(name) if vector is None else replace(vector, name=name, size=1)

    def components(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Those of its vectors by their names, ``a_x`` and ``a_y`` of ``a``; not of one that the scene works out."""
        vectors = [p for p in self.parameters if p.size > 1 and values[p.name] is not AUTOMATIC]
        return {name: value for p in vectors for name, value in zip(p.arguments, values[p.name], strict=True)}

    def check(self, values: Mapping[str, Any], *, file: Any = None) -> dict[str, Any]:
        """Values for every parameter, in the order of declaration, checked and completed by defaults."""
        known = {parameter.name for parameter in self.parameters}
        for name in values:
            if name not in known:
                listed = ", ".join(sorted(known)) or "none"
                raise InputError(f"unknown parameter {name!r}; it has: {listed}", file=file, where=f"law {self.name}")
        result = {}
        for parameter in self.parameters:
            value = values.get(parameter.name, parameter.default)
            if value is None:
                raise InputError(
                    f"needs {parameter.name} [{parameter.unit}]: {parameter.meaning}",
                    file=file,
                    where=f"law {self.name}",
                )
            result[parameter.name] = value if value is AUTOMATIC else parameter.check(value, law=self.name, file=file)
        return result

    def encode(self, values: Mapping[str, Any]) -> list[float]:
        return [number for p in self.parameters for number in p.encode(values[p.name])]


class _Automatic:
    """A default that the scene works out (mean mass of the grains, twice the radius ...)."""

    def __repr__(self) -> str:
        return "automatic"

    def __reduce__(self) -> str:
        return "AUTOMATIC"  # there is one, also in another process


AUTOMATIC = _Automatic()

_REGISTRY: dict[str, Law] = {}


# laws that came from another process as a whole, by fingerprint: of each there is one
_RECEIVED: dict[str, Law] = {}


def _law_at(module: str, place: str) -> Any:
    """What stands under a dotted name in a module, None where nothing does."""
    try:
        found: Any = importlib.import_module(module)
        for name in place.split("."):
            found = getattr(found, name)
    except (ImportError, AttributeError, ValueError):
        return None
    return found


def _received(name: str, module: str, place: str, mark: str, version: str, whole: bytes | None) -> Law:
    """The law that another process sent: this process's own where it does the same.

    Raises UnpicklingError where the law is declared differently here than where it was sent from.
    """
    here = _law_at(module, place) if whole is None else None
    for found in (here, _REGISTRY.get(name), _RECEIVED.get(mark)):
        # fingerprints of two versions of Python cannot be compared
        if isinstance(found, Law) and (found.fingerprint == mark or (found is here and version != sys.version)):
            return found
    if whole is None:
        raise pickle.UnpicklingError(f"law {name}: {module} no longer declares it as it was when the work was sent")
    law = _RECEIVED[mark] = Law(**pickle.loads(whole))
    _REGISTRY.setdefault(name, law)
    return law


def _check_arguments(declared: Law) -> None:
    """Raise InputError where a law's function asks for what is neither a parameter nor a state of its kind."""
    known = set(STATE[declared.kind]) | {a for p in declared.parameters for a in p.arguments}
    for argument in declared.arguments if declared.kind != "impulse" else ():
        if argument not in known:
            raise InputError(
                f"the function asks for {argument!r}, which is neither a parameter nor one of "
                + ", ".join(sorted(STATE[declared.kind])),
                where=f"law {declared.name}",
            )
    whole = {"x", "y", "vx", "vy", "mass"} & set(declared.arguments)
    single = {"index", "bend", "rate", "vt", "reduced_mass", "command"} & set(declared.arguments)
    if declared.kind == "chain" and (whole if declared.sees_joint else single):
        raise InputError(
            "asks for arrays of a swimmer and for what one joint sees; with fx and fy it gets arrays, without them "
            "a joint",
            where=f"law {declared.name}",
        )


def law(
    *,
    kind: str,
    expression: str,
    reference: str,
    parameters: Iterable[Parameter] = (),
    compiled: bool = True,
    reach: str | None = None,
    strength: Iterable[str] = (),
    candidate: str = "",
    phrase: str = "",
    refines: Iterable[str] = (),
    series: Callable[..., Any] | None = None,
    form_of: str = "",
    form: str = "",
    preferred_where: Iterable[str] = (),
    stands_for: Iterable[str] = (),
    nests: Iterable[str] = (),
    role: str = "",
    loses: str = "",
    loses_at_walls: str = "",
    apart: bool = False,
    same_as: Iterable[str] = (),
    damping: bool = False,
    linear: bool = False,
    low_order: Iterable[str] = (),
    name: str | None = None,
) -> Callable[[Callable[..., Any]], Law]:
    """Declare a law and put it in the registry.

    ``compiled=False`` keeps it plain Python: the engine then runs the scene in ``python`` mode.
    Raises InputError where the function asks for a state or parameter that does not exist.
    """
    if kind not in STATE:
        raise InputError(f"unknown kind {kind!r}; expected one of {', '.join(STATE)}")
    if role not in ROLES:
        raise InputError(f"unknown role {role!r}; expected one of {', '.join(filter(None, ROLES))}")
    parameters = tuple(parameters)

    def declare(function: Callable[..., Any]) -> Law:
        declared = Law(
            name=name or function.__name__,
            kind=kind,
            function=function,
            parameters=parameters,
            expression=expression,
            reference=reference,
            compiled=compiled,
            reach=reach,
            strength=tuple(strength),
            candidate=candidate,
            phrase=phrase,
            refines=tuple(refines),
            series=series,
            form_of=form_of,
            form=form,
            preferred_where=tuple(preferred_where),
            stands_for=tuple(stands_for),
            nests=tuple(nests),
            role=role,
            loses=loses,
            loses_at_walls=loses_at_walls,
            apart=apart,
            same_as=tuple(same_as),
            damping=damping or kind == "joint",
            linear=linear,
            low_order=tuple(low_order),
        )
        if kind == "body" and {"vx", "vy"} & set(declared.arguments):
            declared = replace(declared, damping=True)
        _check_arguments(declared)
        _REGISTRY[declared.name] = declared
        return declared

    return declare


def get_law(name: str, *, given: Iterable[str] = (), file: Any = None) -> Law:
    """The declared law of that name; InputError lists the known ones.

    ``given``: names of parameters. Where the law does not have them all but another form of the same
    mechanism does, it is that one (``joint_friction`` with a ``torque`` is the one of a pin). What differs by its
    ``form`` alone goes by its own name only.
    """
    try:
        found = _REGISTRY[name]
    except KeyError:
        raise InputError(f"unknown law {name!r}; known: {', '.join(sorted(_REGISTRY))}", file=file) from None
    wanted = set(given)
    forms = [found, *(law for law in _REGISTRY.values() if law.form_of == name and not law.form)]
    return next((law for law in forms if wanted <= {p.name for p in law.parameters}), found)


def all_laws() -> dict[str, Law]:
    return dict(_REGISTRY)


def flexible(role: str) -> Law:
    """The form without a name that is smooth in what its role says: the place, the speed, the drive's cycle."""
    return next(law for law in _REGISTRY.values() if law.candidate.startswith("flexible") and law.role == role)


def has_role(mechanism: str, *roles: str) -> bool:
    """Whether a mechanism is a law that has one of these roles; apparatus, and a form without a name, have none."""
    law = _REGISTRY.get(mechanism)
    return law is not None and law.role in roles
