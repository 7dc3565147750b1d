"""Whether gravity and rails fit what is seen: a wrong frame rate or unit shows in how bodies fall and swing.

And whether a body that falls meets something that the scene has not.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import ellipk

from ...joints import arm_of
from ..recording import Recording
from ..turns import continuous
from .periods import ROUND, last_swing_of

FALLS_OFF = 1.5  # times gravity, either way, from which a fall is told: drag and buoyancy take away less at the start
FALLS_TOLD = 0.1  # of gravity, from which a fall that is too fast is told where its course is that of a fall
UPWARDS = 0.3  # of gravity, from which a fall the other way is that of a y which counts downwards
COURSE_LEFT = (3.0, 3e-3)  # times the noise, and part of the height, that such a course leaves
SWINGS_OFF = 1.5  # of the square of a period: the inertia of a rod about its end makes it 2/3
OFF_RAIL = 0.06  # of the way along a rail, as far across; a bent picture of a straight one has a few hundredths
INNER = (0.02, 0.98)  # quantiles between which a way is taken: single wrong points make none
TOLD_NOISE = 6.0  # times the noise that a way across has to be
SURE = 0.25  # of gravity, within which three standard errors of an acceleration lie
STRETCH = 4  # frames before and after a bounce, of which a velocity is read off
HIDDEN = 1  # frames between them, in which it touches
SHARP = 4.0  # times what a stretch is off a fall the bounce changes the way of a frame; a wrong point makes 1.1
REBOUND = 0.1  # of that change, by which a body moves towards what it meets, and away from it
BEYOND = 1.5  # times what gravity changes in that time, and drag or a wrong frame rate with it
UNUSUAL = 5.0  # times the change of most other stretches
PULLS = ("body", "pair", "link")  # kinds of laws that pull at a body, where they are no dampings
HELD = {"pin", "rail", "spring", "drive", "hinge", "rod"}  # laws that turn a body round themselves


def doubts(recording: Recording, noise: float) -> list[str]:
    """What is said of bodies that leave their rail, or fall or swing at another rate than gravity lets them.

    noise : one standard deviation of a coordinate [m]
    """
    scene = recording.scene
    gravity = math.hypot(*scene.gravity)
    free = all(not item.law.parameters for item in scene.laws) and not scene.walls  # nothing but gravity acts
    said = [_off_rail(recording, k, name, noise) for k, name in enumerate(recording.ids)]
    for k, name in enumerate(recording.ids if gravity else ()):
        acting = [item.law for item in scene.laws if name in (item.bodies or (name,))]
        if any(law.name == "pin" for law in acting):
            # what else pulls at it, as a spring to another pendulum, makes its period another one
            alone = all(law.name in ("pin", "gravity") or law.damping or law.kind not in PULLS for law in acting)
            said.append(_swing(recording, k, name, gravity) if alone else "")
        elif free:
            said.append(_fall(recording, k, name, gravity, noise))
    return [s for s in said if s][:1]


def bounced(recording: Recording) -> list[str]:
    """A line where a single body falls and turns round between two frames, and the scene has nothing to be met."""
    scene = recording.scene
    alone = len(scene.bodies) == 1 and not scene.walls
    if not alone or not any(scene.gravity) or HELD & {item.name for item in scene.laws}:
        return []
    seen = np.isfinite(recording.xy[:, 0]).all(axis=1)
    t, xy = recording.t[seen], recording.xy[seen, 0]
    at = _bounce(t, xy, np.array(scene.gravity))
    if at is None:
        return []
    place = ", ".join(f"{v:.3g}" for v in xy[at])
    return [
        f"{recording.ids[0]} turns round within two frames at t = {t[at]:.4g} s, with its centre near ({place}) m, and "
        "the scene has nothing there: a floor is a [[wall]] with from = [x, y] and to = [x, y], and a [[law]] "
        "contact_elastic, in a TOML for --scene"
    ]


def _bounce(t: np.ndarray, xy: np.ndarray, gravity: np.ndarray) -> int | None:
    """The frame of the strongest bounce, by velocities of the stretches before and after; None where there is none."""
    apart = STRETCH + HIDDEN
    if len(t) < 2 * apart:
        return None
    step = float(np.median(np.diff(t)))
    times = sliding_window_view(t, STRETCH)
    middle = times.mean(axis=1)
    offset = times - middle[:, None]
    # beside a free fall: there a body moves along a line until it meets something
    lines = sliding_window_view(xy - 0.5 * np.square(t - t[0])[:, None] * gravity, STRETCH, axis=0)
    lines = lines - lines.mean(axis=-1, keepdims=True)
    slope = (lines * offset[:, None]).sum(axis=-1) / np.square(offset).sum(axis=-1)[:, None]
    off = np.sqrt(np.square(lines - slope[..., None] * offset[:, None]).sum(axis=(1, 2)) / STRETCH)
    velocity = slope + (middle - t[0])[:, None] * gravity
    change = slope[apart:] - slope[:-apart]
    size = np.hypot(*change.T)
    along = change / np.maximum(size, np.finfo(float).tiny)[:, None]
    towards, away = (velocity[:-apart] * along).sum(axis=1), (velocity[apart:] * along).sum(axis=1)
    span = middle[apart:] - middle[:-apart]
    turned = (towards < -REBOUND * size) & (away > REBOUND * size)
    turned &= size * step > SHARP * np.maximum(np.median(off), np.maximum(off[:-apart], off[apart:]))
    turned &= size > np.maximum(BEYOND * math.hypot(*gravity) * span, UNUSUAL * np.quantile(size, 0.25))
    turned &= span < (apart + 0.5) * step  # no frame is lost in between
    return int(np.argmax(np.where(turned, size, 0.0))) + STRETCH if turned.any() else None


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
    """The acceleration along gravity, where in stretches of the track it is too large or nowhere large enough.

    Or where the fall from the highest place on is a little too fast, which no drag makes.
    """
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
        told = _too_fast(t, along, gravity, noise)
        if told is None:
            return ""
        rate = told
    if rate < -UPWARDS * gravity:
        return (
            f"{name} falls upwards, with {-rate:.3g} m/s^2: does y count downwards, as in a picture (--flip-y 0, or "
            "--flip-y HEIGHT with the picture's height in the file's unit)?"
        )
    fps, unit = "", ""
    if rate > 0.01 * gravity:
        fps, unit = f", times {math.sqrt(gravity / rate):.3g}", f", times {gravity / rate:.3g}"
    medium = ", or does a medium bear it" if rate < gravity else ""
    return (
        f"{name} falls with {rate:.3g} m/s^2 where gravity is {gravity:.3g}: is the frame rate wrong (--fps{fps}) "
        f"or the unit (--unit{unit}){medium}?"
    )


def _too_fast(t: np.ndarray, along: np.ndarray, gravity: float, noise: float) -> float | None:
    """Acceleration [m/s^2] of a fall at times t [s], places along gravity [m], from its highest place to its lowest.

    None where it is not a tenth above gravity, and above it by three of its errors, or where the course is not that
    of a fall: v' = g - k v is y = a + b t + g t^2/2 - k (integral of y). On the way down a drag takes away, and a
    parabola has too small a g by it. Nothing is told of a g that is a little too small: a drag, a medium and a hand
    that lets go late look like it.
    """
    top = int(np.argmin(along))
    low = top + int(np.argmax(along[top:])) + 1
    t, along = t[top:low] - t[top], along[top:low] - along[top]
    if len(t) < 8:
        return None
    passed = np.concatenate([[0.0], np.cumsum(0.5 * (along[1:] + along[:-1]) * np.diff(t))])
    columns = np.stack([np.ones_like(t), t, 0.5 * t**2, -passed], axis=-1)
    most, part = COURSE_LEFT
    _, left = _fitted(columns, along)
    if not left < max(most * noise, part * float(np.ptp(along))):
        return None  # a hand throws it, it bounces, or something else acts
    numbers, left = _fitted(columns[:, :3], along)
    error = left * math.sqrt(float(np.linalg.inv(columns[:, :3].T @ columns[:, :3])[2, 2]))
    rate = float(numbers[2])
    return rate if rate > (1 + FALLS_TOLD) * gravity and rate - 3 * error > gravity else None


def _fitted(columns: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, float]:
    """Of values (k,) as a sum of columns (k, n): their numbers (n,), and one standard deviation of what is left."""
    numbers, *_ = np.linalg.lstsq(columns, values, rcond=None)
    left = float(np.sum(np.square(values - columns @ numbers)))
    return numbers, math.sqrt(left / (len(values) - len(numbers)))


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
    t, angle = recording.t[seen], continuous(angle[seen])
    swing = last_swing_of(t, angle)
    if swing is None or swing.amplitude > ROUND:
        return ""
    period = swing.period
    believed = 4 * math.sqrt(length / gravity) * float(ellipk(math.sin(swing.amplitude / 2) ** 2))
    if 1 / SWINGS_OFF < (period / believed) ** 2 < SWINGS_OFF:
        return ""
    return (
        f"{name} swings with a period of {period:.3g} s, where a point on a rod of {length:.3g} m has "
        f"{believed:.3g} s: is the frame rate (--fps), or the rod's length "
        f"(times {(period / believed) ** 2:.2g} would do), wrong?"
    )
