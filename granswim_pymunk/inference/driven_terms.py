"""Faults of the motors that drive bodies: a lag, a delay, a limit or a dead band of the commanded velocity.

And what has no name: another answer to a step of the command than at once and as large as it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..laws import Law, all_laws, get_law
from ..scene import Scene, use
from .criteria import current
from .data import Case
from .hypothesis import Free, Term


def driven_terms(cases: Sequence[Case], *, each: bool = True) -> list[Term]:
    """One term for each fault that a driven velocity can have, none where nothing is driven.

    Lag and delay are tried from about the time between frames, a limit from the largest command on, a dead band from
    none, up to the largest command that an adjustable gain allows. ``each``: of several motors also one term with a
    number for each of them, as no two are alike.
    """
    driven, top = _driven(cases)
    spacing = min((float(np.median(np.diff(c.t))) for c in cases if len(c.t) > 1), default=np.inf)
    if not driven or top == 0.0 or not np.isfinite(spacing):
        return []
    terms, step, most = list[Term](), current().candidates.step, top * _gains(cases)
    for law in _of_commands("named"):
        strength = law.parameter(law.strength[0])
        name = f"{law.name}.{strength.name}"
        if strength.unit == "s":
            # no motor answers before its command
            free = Free(name, "s", 0.0, np.inf, 0.0, step * spacing, None, 0.0)
        else:
            absent = min(strength.neutral, most)
            free = Free(name, "m/s", 0.0, most, absent, step * top, None, absent, span=top)
        alike = ((strength.name, (0,)),)
        terms.append(Term(law.mechanism, law.name, (free,), _Fault(law), driven, law.expression, {}, alike))
        if each and len(driven) > 1:
            own = tuple(
                replace(free, name=f"{name}[{b}]", cases=frozenset(c.name for c in cases if b in c.recording.scene.ids))
                for b in driven
            )
            groups = tuple((strength.name, (k,)) for k in range(len(own)))
            apply, label = _Fault(law, owners=driven), f"{law.name} (each body)"
            terms.append(Term(law.mechanism, label, own, apply, driven, law.expression, {}, groups))
    return terms


def driven_forms(cases: Sequence[Case]) -> list[Term]:
    """One term for each free answer of a motor to its command, none where nothing is driven."""
    driven, top = _driven(cases)
    lengths = [float(np.ptp(c.t[c.training])) for c in cases if not c.held_out and c.training.sum() > 1]
    if not driven or top == 0.0 or not lengths:
        return []
    sizes = {"span": current().candidates.settles * max(lengths), "top": top}
    terms = []
    for law in _of_commands("flexible"):
        free = tuple(Free(f"{law.name}.{name}", "1", -np.inf, np.inf, 0.0, 1.0) for name in law.strength)
        fixed = {p.name: sizes[p.name] for p in law.parameters if p.name in sizes}
        terms.append(
            Term(law.mechanism, law.name, free, _Fault(law, fixed), driven, law.expression, {},
                 law=law.name, fixed={name: (value, law.parameter(name).unit) for name, value in fixed.items()},
                 groups=tuple((name, (k,)) for k, name in enumerate(law.strength)))
        )  # fmt: skip
    return terms


def step_answer(law: Law, values: Mapping[str, float], times: np.ndarray) -> np.ndarray:
    """(k,) what a law makes of a command that steps from 0 to 1 at 0, at some times [s] after it."""
    if law.series is None:
        raise ValueError(f"{law.name} is no answer to a command")
    at_once = -current().candidates.at_once * times[-1]
    step = np.array([at_once, 0.0, times[-1]]), np.array([0.0, 1.0, 1.0])
    return np.asarray(np.interp(times, *law.series(*step, **values)))


def held_answer(law: Law, values: Mapping[str, float], commands: np.ndarray) -> np.ndarray:
    """(k,) what a law makes of commands [m/s] that are held, rising, where it has no memory."""
    if law.series is None:
        raise ValueError(f"{law.name} is no answer to a command")
    rows = np.arange(float(len(commands)))
    return np.asarray(np.interp(rows, *law.series(rows, commands, **values)))


def as_an_answer(term: Term, values: np.ndarray) -> list[str]:
    """What a free answer to steps is like: when a half of it is reached, how far it goes over, where it settles."""
    law = all_laws().get(term.law)
    if law is None or law.series is None or "span" not in term.fixed:
        return []
    span = float(term.fixed["span"][0])
    # numbers of it that the data do not tell are left out, and stand as the law has them
    numbers = {name: law.parameter(name).default for name in law.strength}
    numbers |= {f.name.split(".")[-1]: float(v) for f, v in zip(term.free, values, strict=True)}
    times = np.linspace(0.0, span, current().candidates.drawn)
    answer = step_answer(law, {"span": span, **numbers}, times)
    settled = answer[-1]
    if settled <= 0:
        return []
    over, near = answer / settled, current().candidates.settled
    half = times[np.argmax(2 * over >= 1)]
    outside = np.flatnonzero(np.abs(over - 1) > near)
    text = f"its answer to a step settles at {settled:.3g} of what is commanded"
    text += f"; a half of that is there after {half:.2g} s"
    if over.max() - 1 > near:
        text += f", it goes {100 * (over.max() - 1):.0f} % over it at {times[np.argmax(over)]:.2g} s"
    if len(outside):
        text += f", and within {100 * near:.0f} % it stays from {times[outside[-1]]:.2g} s on"
    return [text]


def _driven(cases: Sequence[Case]) -> tuple[tuple[str, ...], float]:
    """Bodies that follow a command, and the largest one [m/s]."""
    every = list(commanded(cases))
    return tuple(dict.fromkeys(body for body, _ in every)), max((float(np.abs(v).max()) for _, v in every), default=0.0)


def _gains(cases: Sequence[Case]) -> float:
    """By how much the gain of a motor may be larger than believed, where it is adjustable: 1 where it is not."""
    result = 1.0
    for scene in (case.recording.scene for case in cases):
        for item in scene.laws_as("command"):
            gain = abs(float(scene.resolved(item)["gain"]))
            own = [a for a in scene.adjustable if a.law == item.law.name and a.parameter == "gain" and gain]
            result = max([result, *(max(abs(a.low), abs(a.high)) / gain for a in own)])
    return result


def commanded(cases: Sequence[Case]) -> Iterator[tuple[str, np.ndarray]]:
    """Each body that follows a command, in each recording, and its velocities (k,) [m/s] as it is told them."""
    for scene in (case.recording.scene for case in cases):
        for item in scene.laws_as("command"):
            for body in item.bodies or ():
                if body in scene.inputs:
                    yield body, float(scene.resolved(item)["gain"]) * np.asarray(scene.inputs[body][1], dtype=float)


def _of_commands(candidate: str) -> list[Law]:
    """Laws that make something else of the commanded velocity of a body."""
    return [
        law for law in all_laws().values()
        if law.series is not None and law.candidate == candidate
        and any(get_law(name).role == "command" for name in law.refines)
    ]  # fmt: skip


def last(term: Term) -> Term | None:
    """A limit that acts on what all other faults of the motor leave of the command, None of any other term."""
    fault = term.apply
    if not (isinstance(fault, _Fault) and fault.ahead):
        return None
    behind = _Fault(fault.law, fault.fixed, fault.owners, ahead=False)
    expression = f"{term.expression}, of what the other faults make of the command"
    return replace(term, label=f"{term.label} (last)", apply=behind, expression=expression, last=True)


class _Fault:
    """Adds the fault with the sizes found, and ``fixed`` ones: one for all motors, or one for each of ``owners``.

    What has no memory acts on the command itself, ``ahead`` of all that is late: in whichever order two are found, the
    motor is one and the same.
    """

    def __init__(
        self, law: Law, fixed: Mapping[str, Any] | None = None, owners: Sequence[str] = (), ahead: bool | None = None
    ) -> None:
        self.law, self.fixed, self.owners = law, dict(fixed or {}), tuple(owners)
        self.ahead = law.role == "limit" if ahead is None else ahead

    def __call__(self, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        if not scene.laws_as("command"):
            return scene, camera
        width = len(self.law.strength)
        for k, owner in enumerate(self.owners or (None,)):
            mine = values[k * width : (k + 1) * width]
            given: dict[str, Any] = {name: float(v) for name, v in zip(self.law.strength, mine, strict=True)}
            if owner is None or owner in scene.inputs:
                bodies = None if owner is None else [owner]
                *before, fault = scene.with_laws(use(self.law, bodies=bodies, **self.fixed, **given)).laws
                after = (k for k, item in enumerate(before) if self.ahead and self._goes_before(item.law))
                at = next(after, len(before))
                scene = scene.having_laws((*before[:at], fault, *before[at:]))
        return scene, camera

    def _goes_before(self, law: Law) -> bool:
        return law.series is not None and (law.role != self.law.role or law.name > self.law.name)
