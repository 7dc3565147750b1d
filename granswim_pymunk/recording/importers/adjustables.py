"""What recalibration may move, as a user says it: ``spring.stiffness=3:5``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ...errors import InputError
from ...scene import Adjustable, Scene

FORM = "LAW.PARAMETER=LOW:HIGH, as spring.stiffness=3:5"


def adjusted(scene: Scene, texts: Sequence[str]) -> Scene:
    """The scene with these adjustables, each in the place of one of the same name that a template gave.

    Raises InputError where the scene has no such law, the law no such number, or a value lies outside.
    """
    for text in texts:
        found = _parse(text)
        uses = scene.laws_named(found.law)
        if not uses:
            listed = ", ".join(dict.fromkeys(item.name for item in scene.laws)) or "none"
            raise InputError(f"the scene has no law {found.law!r}; it has: {listed}", where=f"adjustable {found.name}")
        for item in uses:
            names = item.law.number(found.parameter).arguments  # raises where there is no such one
            value = scene.number(item, found.parameter)
            if not isinstance(value, float):
                which = f"; its components are {' and '.join(f'{found.law}.{name}' for name in names)}"
                told = f"is no single number: {value!r}{which if len(names) > 1 else ''}"
                raise InputError(told, where=f"adjustable {found.name}")
            if not found.low <= value <= found.high:
                raise InputError(
                    f"{value:g} is believed, which is outside {found.low:g} to {found.high:g}",
                    where=f"adjustable {found.name}",
                )
            for end in (found.low, found.high):
                item.with_values(**{found.parameter: end})  # raises where the law allows no such value
        same = [known for known in scene.adjustable if known.name == found.name]
        others = tuple(known for known in scene.adjustable if known.name != found.name)
        # of several bodies each may have its own, as the template says; and no two motors are alike
        motors = sum(item.law.role == "command" for item in uses) > 1
        found = replace(found, per=same[0].per if same else "body" if motors else found.per)
        scene = replace(scene, adjustable=(*others, found))
    return scene


def _parse(text: str) -> Adjustable:
    name, _, bounds = text.partition("=")
    law, _, parameter = (part.strip() for part in name.partition("."))
    try:
        low, high = (float(part) for part in bounds.split(":"))
    except ValueError:
        low = high = math.nan
    if not law or not parameter or not (math.isfinite(low) and math.isfinite(high)):
        raise InputError(f"should be {FORM}, got {text!r}", where="adjustable")
    if not low < high:
        raise InputError(f"low should be below high, got {low:g} and {high:g}", where=f"adjustable {law}.{parameter}")
    return Adjustable(law, parameter, low, high)
