"""Whether gravity and rails fit what is seen: a wrong frame rate or unit shows in how bodies fall and swing."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ellipk

from ...joints import arm_of
from ..recording import Recording

FALLS_OFF = 1.5  # times gravity, either way, from which a fall is told: drag and buoyancy take away less at the start
SWINGS_OFF = 1.5  # of the square of a period: the inertia of a rod about its end makes it 2/3
OFF_RAIL = 0.1  # of the way along a rail, as far across; a bent picture of a straight one has a few hundredths
INNER = (0.02, 0.98)  # quantiles between which a way is taken: single wrong points make none
TOLD_NOISE = 6.0  # times the noise that a way across has to be
SURE = 0.25  # of gravity, within which three standard errors of an acceleration lie


def doubts(recording: Recording, noise: float) -> list[str]:
    """What is said of bodies that leave their rail, or fall or swing at another rate than gravity lets them.

    noise : one standard deviation of a coordinate [m]
    """
    scene = recording.scene
    gravity = math.hypot(*scene.gravity)
    free = all(not item.law.parameters for item in scene.laws) and not scene.walls  # nothing but gravity acts
    said = [_off_rail(recording, k, name, noise) for k, name in enumerate(recording.ids)]
    for k, name in enumerate(recording.ids if gravity else ()):
        if any(name in (item.bodies or (name,)) for item in scene.laws_named("pin")):
            said.append(_swing(recording, k, name, gravity))
        elif free:
            said.append(_fall(recording, k, name, gravity, noise))
    return [s for s in said if s][:1]


def _off_rail(recording: Recording, k: int, name: str, noise: float) -> str:
    """How far a body goes across its rail, where that is a large part of its way along it."""
    rail = next((i for i in recording.scene.laws_named("rail") if name in (i.bodies or (name,))), None)
    xy = recording.unwrapped().xy[:, k]
    xy = xy[np.isfinite(xy).all(axis=1)]
    if rail is None or not len(xy):
        return ""
    x, y = np.array(rail.values["direction"], dtype=float) / math.hypot(*rail.values["direction"])
    along, across = (float(np.ptp(np.quantile(xy @ way, INNER))) for way in (np.array([x, y]), np.array([-y, x])))
    if across < max(OFF_RAIL * along, TOLD_NOISE * noise if math.isfinite(noise) else 0.0) or across == 0:
        return ""
    return (
        f"{name} leaves its rail: it goes {across:.3g} m across it and {along:.3g} m along it. Is the path a curve, "
        f"which no rail is, or the direction wrong (--law 'rail:{name},direction=1 0')?"
    )


def _fall(recording: Recording, k: int, name: str, gravity: float, noise: float) -> str:
    """The acceleration along gravity, where in stretches of the track it is too large or nowhere large enough."""
    xy = recording.xy[:, k]
    seen = np.isfinite(xy).all(axis=1)
    t, along = recording.t[seen], xy[seen] @ np.array(recording.scene.gravity) / gravity
    if len(t) < 8 or not math.isfinite(noise):
        return ""
    if np.ptp(along) == 0:
        return f"{name} was not measured along gravity: is its one coordinate the vertical one (--columns y=NAME)?"
    dt = float(np.median(np.diff(t)))
    # a parabola through n places: the error of its acceleration is sqrt(720/n^5) of that of a place over dt^2
    n = max(5, math.ceil((720 * (3 * noise / (SURE * gravity * dt**2)) ** 2) ** 0.2))
    if n > len(t) // 2:
        return ""
    rates = np.array([2 * np.polyfit(t[i : i + n] - t[i], along[i : i + n], 2)[0] for i in range(len(t) - n + 1)])
    rate = 2 * float(np.polyfit(t - t[0], along, 2)[0])
    if rates.max() > gravity / FALLS_OFF and float(np.median(rates)) < gravity * FALLS_OFF:
        return ""
    fps, unit = "", ""
    if rate > 0.01 * gravity:
        fps, unit = f", times {math.sqrt(gravity / rate):.3g}", f", times {gravity / rate:.3g}"
    medium = ", or does a medium bear it" if rate < gravity else ""
    return (
        f"{name} falls with {rate:.3g} m/s^2 where gravity is {gravity:.3g}: is the frame rate wrong (--fps{fps}) "
        f"or the unit (--unit{unit}){medium}?"
    )


def _swing(recording: Recording, k: int, name: str, gravity: float) -> str:
    """The period of a pendulum against that of a point on its rod, at the amplitude that is seen."""
    item = next(i for i in recording.scene.laws_named("pin") if name in (i.bodies or (name,)))
    length = arm_of(recording.scene, name)
    if recording.angle is not None and np.isfinite(recording.angle[:, k]).sum() > 8:
        angle = recording.angle[:, k]
    else:
        x, y = (recording.xy[:, k] - np.array(item.values["anchor"])).T
        angle = np.arctan2(x, -y)
    seen = np.isfinite(angle)
    t, angle = recording.t[seen], np.unwrap(angle[seen])
    if len(t) < 8:
        return ""
    swing = float(np.quantile(np.abs(angle), 0.95))
    side = np.sign(angle) * (np.abs(angle) > 0.2 * swing)
    clear = np.flatnonzero(side)
    turned = np.flatnonzero(np.diff(side[clear]) != 0)
    if len(turned) < 3 or swing > 0.9 * math.pi:
        return ""
    halves = np.diff([0.5 * (t[clear[i]] + t[clear[i + 1]]) for i in turned])
    period = 2 * float(np.median(halves))
    believed = 4 * math.sqrt(length / gravity) * float(ellipk(math.sin(swing / 2) ** 2))
    if 1 / SWINGS_OFF < (period / believed) ** 2 < SWINGS_OFF:
        return ""
    return (
        f"{name} swings with a period of {period:.3g} s, where a point on a rod of {length:.3g} m has "
        f"{believed:.3g} s: is the frame rate (--fps), or the rod's length "
        f"(times {(period / believed) ** 2:.2g} would do), wrong?"
    )
