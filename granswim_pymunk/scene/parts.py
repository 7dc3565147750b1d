"""What a scene is made of: bodies, laws put to use, adjustables, a bed, time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..errors import InputError
from ..laws import AUTOMATIC, Law, get_law
from ..limits import (
    LARGEST_MASS,
    LARGEST_RADIUS,
    MOST_BODIES,
    SMALLEST_MASS,
    SMALLEST_RADIUS,
    check_between,
    check_id,
)  # fmt: skip

ROLES = ("head", "tail", "grain", "wall", "free")
SCHEMES = ("exact", "half_step")
STANDARD_GRAVITY = 9.81  # m/s^2, where a law needs g and the scene has none (contract)
LARGEST_NUMBER = 1e100  # anywhere in a scene or a recording.toml


class SceneWarning(UserWarning):
    """Something in a recording.toml was not understood and was left out."""


def too_many(count: int) -> InputError:
    return InputError(f"has {count} bodies; more than {MOST_BODIES} cannot be computed")


def number_of(value: Any, name: str, unit: str, *, file: Any, where: str | None, positive: bool = False) -> float:
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


def numbers_of(value: Any, size: int, name: str, unit: str, *, file: Any, where: str | None) -> tuple[float, ...]:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != size:
        raise InputError(f"{name} should be {size} numbers [{unit}], got {value!r}", file=file, where=where)
    return tuple(number_of(item, name, unit, file=file, where=where) for item in value)


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
        object.__setattr__(self, "radius", number_of(self.radius, "radius", "m", file=None, where=where, positive=True))
        if self.role != "wall":
            object.__setattr__(self, "mass", number_of(self.mass, "mass", "kg", file=None, where=where, positive=True))
            check_between(self.mass, "mass", "kg", SMALLEST_MASS, LARGEST_MASS, where)
        check_between(self.radius, "radius", "m", SMALLEST_RADIUS, LARGEST_RADIUS, where)
        if self.inertia is not None:
            inertia = number_of(self.inertia, "inertia", "kg m^2", file=None, where=where, positive=True)
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
        """With other values; a component of a vector goes by its own name, ``a_x`` of ``a``."""
        for p in self.law.parameters:
            old = self.values[p.name]
            if p.size > 1 and old is not AUTOMATIC and not values.keys().isdisjoint(p.arguments):
                values[p.name] = tuple(values.pop(name, part) for name, part in zip(p.arguments, old, strict=True))
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
    """A parameter that recalibration may move, or a component of a vector (``a_x`` of ``a``).

    ``per``: "all" recordings share it, or "body", "recording".
    """

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
