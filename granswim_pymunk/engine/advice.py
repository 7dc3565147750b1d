"""How small a time step has to be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..scene import Scene


def contact_duration(scene: Scene) -> float | None:
    """Shortest duration of a contact [s] between bodies of the scene, None without a stiff contact law.

    Linear law: pi/sqrt(k/m_r - (gamma/2)^2), m_r the reduced mass of the two lightest.
    Hertz law: 2.9432 (5 m_r/(4 k))^(2/5) v^(-1/5), at v = 1 m/s.
    """
    mobile = sorted(b.mass for b in scene.bodies if b.mobile)
    if not mobile:
        return None
    alone = not any(not b.mobile for b in scene.bodies)
    if len(mobile) < 2 and alone:
        return None
    reduced = mobile[0] * mobile[1] / (mobile[0] + mobile[1]) if len(mobile) > 1 else mobile[0]
    shortest = None
    for item in scene.laws:
        if item.name == "contact_linear" and item.values["stiffness"] > 0:
            square = item.values["stiffness"] / reduced - (item.values["damping"] / 2) ** 2
            duration = (
                math.pi / math.sqrt(square) if square > 0 else math.pi * math.sqrt(reduced / item.values["stiffness"])
            )
        elif item.name == "contact_hertz" and item.values["stiffness"] > 0:
            duration = 2.9432 * (5 * reduced / (4 * item.values["stiffness"])) ** 0.4
        else:
            continue
        shortest = duration if shortest is None else min(shortest, duration)
    return shortest


def softened(scene: Scene, factor: float) -> Scene:
    """The scene with contacts ``factor`` times softer, for screening runs.

    The stiffness of ``contact_linear`` and ``contact_hertz`` is divided by the factor and their damping by its root,
    so that the coefficient of restitution stays. A contact lasts, and a time step may be, sqrt(factor) times longer;
    the scene's own dt, if any, grows as far as its other laws allow. Overlaps grow by sqrt(factor) in impacts and by
    the factor under a steady load. Raises InputError where there is no such contact or the factor is below 1.
    """
    if not (math.isfinite(factor) and factor >= 1):
        raise InputError(f"should be 1 or more, got {factor!r}", where="softened")
    names = ("contact_linear", "contact_hertz")
    if not any(item.name in names for item in scene.laws):
        raise InputError("the scene has no contact_linear or contact_hertz to soften", where="softened")
    laws = tuple(
        item.with_values(
            stiffness=item.values["stiffness"] / factor, damping=item.values["damping"] / math.sqrt(factor)
        )
        if item.name in names
        else item
        for item in scene.laws
    )
    soft = replace(scene, laws=laws)
    if scene.time.dt is None:
        return soft
    longest = max(advise_dt(soft), scene.time.dt)
    return replace(soft, time=replace(soft.time, dt=min(scene.time.dt * math.sqrt(factor), longest)))


def advise_dt(scene: Scene) -> float:
    """A time step [s] that resolves the fastest law: 15 steps a contact, 100 a period, 1 % of a decay.

    A contact of 34 microseconds, as in the paper's bed, gets 2.3 microseconds. Forces at a distance and cohesion count
    by the stiffness of their slope, lubrication and drags by their decay, friction by the time in which gravity's
    share of it stops the slip below which it is smooth: in a hard impact the slip itself may change by more in a step,
    which friction bounds.
    """
    steps = [1e-3]
    duration = contact_duration(scene)
    if duration is not None:
        steps.append(duration / 15)
    masses = [b.mass for b in scene.bodies if b.mobile]
    lightest = min(masses, default=1.0)
    speed = max((math.hypot(*b.initial[2:]) for b in scene.bodies if b.initial is not None), default=0.0)
    for item in scene.laws:
        values = scene.resolved(item)
        if item.name in ("union", "bending"):
            link = min((scene.bodies[k].mass for k in scene.swimmer), default=lightest)
            k = values["stiffness"]
            if item.name == "bending":
                k /= 2 * min((b.radius for b in scene.bodies if b.role != "wall"), default=1.0)
                if values["frequency"] > 0:
                    steps.append(1 / (2000 * values["frequency"]))
            if k > 0:
                steps.append(2 * math.pi * math.sqrt(link / 2 / k) / 100)
            if values["damping"] > 0:
                steps.append(0.05 / values["damping"])
        elif item.name == "spring" and values["stiffness"] > 0:
            steps.append(2 * math.pi * math.sqrt(lightest / values["stiffness"]) / 1000)
        elif item.name == "pin":
            steps.append(2 * math.pi * math.sqrt(values["length"] / scene.gravity_size) / 1000)
            if speed > 0:
                steps.append(values["length"] / speed / 500)
        elif item.name in ("linear_drag", "ambient_flow", "wall_drag") and values["c"] > 0:
            steps.append(0.01 * lightest / values["c"])
        elif item.name == "pair_lubrication" and values["c"] > 0:
            steps.append(0.05 / values["c"])
        elif item.name == "cohesion" and values["force"] > 0 and values["range"] > 0:
            steps.append(2 * math.pi * math.sqrt(lightest / 2 * values["range"] / values["force"]) / 100)
        elif item.name == "distance_force" and values["s"] != 0:
            # its slope is steepest where two disks touch
            touch = 2 * min(b.radius for b in scene.bodies)
            mean = float(np.mean([scene.bodies[k].radius for k in scene.rows(item)]))
            slope = abs(values["s"] * values["n"]) / touch * (mean / touch) ** values["n"]
            if slope > 0:
                steps.append(2 * math.pi * math.sqrt(lightest / 2 / slope) / 100)
        elif item.name == "pair_spring" and values["k"] > 0:
            # the fastest of two bodies, each of which moves
            steps.append(2 * math.pi * math.sqrt(lightest / 2 / values["k"]) / 1000)
        elif item.name == "nonlinear_spring" and values["k_3"] > 0:
            ways = [math.dist(b.initial[:2], values["anchor"]) for b in scene.bodies if b.mobile and b.initial]
            stiffest = 3 * values["k_3"] * max((abs(way - values["length"]) for way in ways), default=0.0) ** 2
            if stiffest > 0:
                steps.append(2 * math.pi * math.sqrt(lightest / stiffest) / 1000)
        elif item.name == "contact_friction" and scene.laws_named("contact_elastic"):
            continue  # an impulse
        elif item.name in ("contact_friction", "coulomb_substrate") and values["mu"] > 0 and values["v_0"] > 0:
            steps.append(0.2 * values["v_0"] / (values["mu"] * scene.gravity_size))
        elif item.name in ("quadratic_drag", "quadratic_flow"):
            # against what moves itself
            rate = values["c"] * (speed + math.hypot(*values.get("u", ())))
            if rate > 0:
                steps.append(0.01 * lightest / rate)
    return float(np.min(steps))
