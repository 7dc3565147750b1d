"""What a swimmer itself may have had that its scene lacks: one term for each law, joint and direction.

The same list serves recordings with the bed seen and without. Terms act on any scene with a chain in it,
packed or not; the number of a term that stands at its ``neutral`` value means that the law is absent.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..laws import Law, all_laws
from ..scene import Scene, use
from .criteria import current
from .hypothesis import Free, Term, equation_with
from .significance import half_interval


def swimmer_terms(scenes: Sequence[Scene]) -> list[Term]:
    """Terms for every named law of a chain that applies to the first swimmer of ``scenes``.

    ``weak_joint`` and ``resting_curvature`` give one for each joint (the latter one for all together, too),
    ``head_force`` one along the head's axis (1 number) and one fixed in space (2: its components [N]),
    the others one each. A law whose strength is already adjustable in a scene gives none.
    Raises InputError where no scene has a swimmer.
    """
    with_chain = [s for s in scenes if s.chains]
    if not with_chain:
        raise InputError("has no swimmer: a chain with a head is needed", where="scene")
    scene = with_chain[0]
    adjustable = {a.name for s in scenes for a in s.adjustable}
    terms: list[Term] = []
    for law in all_laws().values():
        if law.candidate != "named" or law.kind != "chain" or not scene.has_bodies_for(law):
            continue
        if any(f"{law.name}.{s}" in adjustable for s in law.strength):
            continue
        terms += [t for t in _terms(law, scene, with_chain) if _applies(t, scene)]
    return terms


def _applies(term: Term, scene: Scene) -> bool:
    """Whether the scene has what the law refines (a bending whose joints can be weak)."""
    step = current().candidates.step
    try:
        changed, _ = term.apply(scene, {}, [f.neutral + step * f.scale * _inward(f) for f in term.free])
        for item in changed.laws:
            changed.resolved(item)
    except InputError:
        return False
    return True


def tried_below(term: Term) -> bool:
    """Whether the law of a term is tried below its neutral value first, as its declaration says."""
    law = all_laws().get(term.mechanism)
    return law is not None and any(p.side < 0 for p in law.parameters)


def _inward(free: Free) -> float:
    return -1.0 if free.neutral >= free.high else 1.0


def _terms(law: Law, scene: Scene, scenes: Sequence[Scene]) -> list[Term]:
    ids = [scene.bodies[k].id for k in scene.chains[0]]
    joints = len(ids) - 1
    strength = law.parameter(law.strength[0])
    size = abs(strength.typical or 1.0) if strength.in_bed is None else strength.in_bed
    names = {p.name for p in law.parameters}
    of_head = law.series is not None or {"angle", "axis"} <= names
    bodies = (ids[0],) if of_head else tuple(ids)

    def term(label: str, free: Sequence[Free], groups, acting=bodies, **choices: Any) -> Term:
        return Term(
            law.mechanism, label, tuple(free), _Adder(law, choices, tuple(name for name, _ in groups)), acting,
            law.expression, choices, tuple(groups),
        )  # fmt: skip

    if {"angle", "axis"} <= names:
        part = [Free(f"{law.name}.{strength.name}{k}", strength.unit, -math.inf, math.inf, 0.0, size) for k in "xy"]
        along = Free(f"{law.name}.{strength.name}", strength.unit, -math.inf, math.inf, 0.0, size)
        return [
            term(f"{law.name} along the axis", [along], [(strength.name, (0,))], axis="head"),
            term(f"{law.name} fixed", part, [("x", (0,)), ("y", (1,))], axis="fixed"),
        ]
    free = Free(
        f"{law.name}.{strength.name}", strength.unit, strength.low, strength.high, strength.neutral, size,
        None, strength.neutral,
    )  # fmt: skip
    if strength.within == "amplitude":
        amplitude = max((abs(float(i.values["amplitude"])) for s in scenes for i in s.laws_as("stroke")), default=0.0)
        if amplitude <= 0.0:
            return []
        size = current().candidates.amplitude * amplitude
        free = Free(free.name, "rad", 0.0, amplitude, amplitude, size, None, amplitude)
    groups = [(strength.name, (0,))]
    if "joint" not in names:
        return [term(law.name, [free], groups)]
    every: Sequence[Any] = [c for c in law.parameter("joint").choices if isinstance(c, str) or c < joints]
    return [
        term(
            f"{law.name} at joint {j}" if j != "all" else f"{law.name} at all joints", [free], groups,
            acting=tuple(ids) if j == "all" else (ids[j],), joint=j,
        )
        for j in every
    ]  # fmt: skip


class _Adder:
    """Adds a law with its number; two components become its size and angle."""

    def __init__(self, law: Law, choices: Mapping[str, Any], names: tuple[str, ...]) -> None:
        self.law, self.choices, self.names = law, dict(choices), names

    def __call__(self, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        given = dict(self.choices)
        if self.names == ("x", "y"):
            given[self.law.strength[0]] = float(np.hypot(values[0], values[1]))
            given["angle"] = float(np.arctan2(values[1], values[0]))
        else:
            given[self.names[0]] = float(values[0])
        return scene.with_laws(use(self.law, **given)), camera


def is_components(term: Term) -> bool:
    """Whether the term's numbers are components of a force, which the verdict says as size and angle."""
    return [name for name, _ in term.groups] == ["x", "y"]


def reported_parameters(
    term: Term, values: Sequence[float] | np.ndarray, covariance: np.ndarray | None = None
) -> dict[str, tuple[Any, Any, Any, str]]:
    """What the verdict says of a term: name to (value, low, high, unit); a choice has no bounds.

    values : (k,) of the term's numbers;  covariance : (k, k), None: intervals are not known
    A vector has lists. The interval is the central 95 %, cut at the bounds of the number.
    """
    values = np.asarray(values, dtype=float)
    found: dict[str, tuple[Any, Any, Any, str]] = {}
    if is_components(term):
        size, angle = float(np.hypot(*values)), float(np.arctan2(values[1], values[0]))
        unit = term.free[0].unit
        if covariance is None or size == 0.0:
            found["force"], found["angle"] = (size, None, None, unit), (angle, None, None, "rad")
        else:
            along = values / size
            across = np.array([-along[1], along[0]])
            wide = half_interval(float(along @ covariance @ along))
            turn = min(half_interval(float(across @ covariance @ across)) / size, math.pi)
            found["force"] = (size, max(size - wide, 0.0), size + wide, unit)
            found["angle"] = (angle, angle - turn, angle + turn, "rad")
    else:
        for name, rows in term.groups:
            low: list[float | None] = []
            high: list[float | None] = []
            for r in rows:
                f = term.free[r]
                if covariance is None or not math.isfinite(covariance[r, r]):
                    low.append(None)
                    high.append(None)
                    continue
                half = half_interval(float(covariance[r, r]))
                low.append(max(float(values[r]) - half, f.low))
                high.append(min(float(values[r]) + half, f.high))
            numbers = [float(values[r]) for r in rows]
            unit = term.free[rows[0]].unit
            one = len(rows) == 1
            found[name] = (numbers[0], low[0], high[0], unit) if one else (numbers, low, high, unit)
    for name, choice in term.choices.items():
        found[name] = (choice, None, None, "1")
    return found


def equation(term: Term, parameters: Mapping[str, tuple[Any, Any, Any, str]]) -> str:
    """The term's expression with its numbers and units."""
    return equation_with(term.expression, ((name, p[0], p[3]) for name, p in parameters.items()))
