"""Scenes to start from: what is believed about a pendulum, a puck, a drop, a cart, a swimmer.

A template looks at the tracks and says gravity, laws and what recalibration may move. Laws that the user gives
complete or replace the template's.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from ...errors import InputError
from ...laws import get_law
from ..turns import continuous
from .periods import Swing, last_swing_of, rod_of, swing_of
from .plausible import SWINGS_OFF
from .table import some_of

G = 9.81
MARGIN = 0.05  # part of a length by which recalibration may move it
AGREE = 0.003  # to which the lengths of an arc and a period agree with 9.81 m/s^2 anywhere: g is 9.780 to 9.832
NO_CIRCLE = 0.03  # of a rod's length, that a path is off a circle; lenses, and cameras at an angle, bend one by less
CLEARLY = 5.0  # times the noise, that it is off at least
SWING_LEFT = 0.2  # of what a coordinate alone goes, that a swing which is its course may leave


@dataclass(frozen=True)
class Tracks:
    """One entry for each body and frame: t [s], body, x, y [m], angle [rad] or None."""

    t: np.ndarray
    body: Sequence[str]
    x: np.ndarray
    y: np.ndarray
    angle: np.ndarray | None

    def of(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Times (k,) and places (k, 2) where the body is seen, in the order of time."""
        own = (np.array(self.body) == name) & np.isfinite(self.x) & np.isfinite(self.y)
        order = np.argsort(self.t[own], kind="stable")
        return self.t[own][order], np.stack([self.x[own], self.y[own]], axis=-1)[order]

    def why_unseen(self, name: str, otherwise: str) -> str:
        """What is said of a body of which too little is seen: that the file has no such body, or ``otherwise``."""
        bodies = list(dict.fromkeys(self.body))
        return otherwise if name in bodies else f"{name} is not in the file, whose bodies are: {some_of(bodies, 8)}"

    def turned(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Times (k,) and angles (k,) where the angle of the body is seen, in the order of time."""
        angle = np.full(len(self.t), np.nan) if self.angle is None else self.angle
        own = (np.array(self.body) == name) & np.isfinite(angle)
        order = np.argsort(self.t[own], kind="stable")
        return self.t[own][order], continuous(angle[own][order])


@dataclass(frozen=True)
class Filled:
    """What a template says: tables of recording.toml, remarks, and laws of the user that it did not use."""

    data: dict[str, Any]
    notes: list[str]
    left_over: list[dict[str, Any]]


@dataclass(frozen=True)
class Template:
    name: str
    help: str
    make: Callable[[Tracks, list[dict[str, Any]], list[dict[str, Any]], Mapping[str, Any]], Filled]


# ---- what the user writes -----------------------------------------------------------------------


def parse_gravity(text: str | float | Sequence[float]) -> tuple[float, float]:
    """``9.81`` (downwards) or ``gx,gy`` [m/s^2]. Raises InputError."""
    if isinstance(text, int | float):
        return 0.0, -float(text)
    try:
        parts = re.split(r"[,\s]+", text.strip()) if isinstance(text, str) else list(text)
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) == 1 and math.isfinite(numbers[0]):
        return 0.0, -numbers[0]
    if len(numbers) != 2 or not all(map(math.isfinite, numbers)):
        raise InputError(f"should be a size or gx,gy [m/s^2], got {text!r}", where="gravity")
    return numbers[0], numbers[1]


def parse_law(text: str) -> dict[str, Any]:
    """``pin:bob,anchor=0 0,length=0.25``, ``rod:a,b,length=0.25`` as a [[law]] table. Raises InputError.

    Parameters may follow the name or the bodies after , or :. Values are checked later.
    """
    name, *parts = (part.strip() for part in re.split("[:,]", text))
    pairs = [part for part in parts if "=" in part]
    who = parts[: len(parts) - len(pairs)]  # before all parameters
    wrong = InputError(f"should be NAME[:BODY[,BODY]],PARAMETER=VALUE,..., got {text!r}", where="law")
    if not name or any("=" in part for part in who) or (who and ":" not in text.partition(",")[0]):
        raise wrong
    declared = get_law(name)
    table: dict[str, Any] = {"name": name}
    bodies = [part for item in who for part in re.split(r"[+\s]+", item) if part]
    if len(bodies) == 1:
        table["body"] = bodies[0]
    elif bodies:
        table["bodies"] = bodies
    for pair in pairs:
        key, _, value = (part.strip() for part in pair.partition("="))
        if not key or not value:
            raise wrong
        table[key] = _value(value)
    declared = get_law(name, given=[key for key in table if key not in ("name", "body", "bodies")])
    for key in table:
        if key not in ("name", "body", "bodies"):
            declared.parameter(key)
    if any(p.name in bodies[1:] and p.name not in table for p in declared.parameters):
        raise wrong  # a parameter without a value, and no body
    return table


def _value(text: str) -> Any:
    try:
        numbers = [float(part) for part in text.strip("[]()").split()]
    except ValueError:
        return text
    return numbers[0] if len(numbers) == 1 else numbers


def _take(laws: list[dict[str, Any]], name: str, body: str | None = None) -> dict[str, Any]:
    """The user's values for a law, taken out of the list; empty where there are none."""
    for item in laws:
        if item["name"] == name and (body is None or item.get("body", body) == body):
            laws.remove(item)
            return {key: value for key, value in item.items() if key not in ("name", "body", "bodies")}
    return {}


def _round(value: float, digits: int = 6) -> float:
    return float(f"{value:.{digits}g}")


# ---- the templates ------------------------------------------------------------------------------


def _circle(xy: np.ndarray, length: float | None, below: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Centre, radius and (roughly) its relative error, of the circle through places (k, 2), by least squares.

    length : the radius where it is known;  below : unit vector of gravity, the centre lies the other way
    """
    middle = xy.mean(axis=0)
    size = float(np.hypot(*np.ptp(xy, axis=0))) or 1.0
    guess = length or size
    start = [*(middle - guess * below), *([] if length else [guess])]

    def misfit(p: np.ndarray) -> np.ndarray:
        return np.hypot(*(xy - p[:2]).T) - (length or p[2])

    fit = least_squares(misfit, start, x_scale=size)
    if length:
        return fit.x[:2], length, 0.0
    radius = float(abs(fit.x[2]))
    spread = float(np.sqrt(2 * fit.cost / max(len(xy) - len(fit.x), 1)))
    # what the radius hangs on is how far the arc is from its chord: the sagitta s = chord^2/(8 R). The
    # covariance at a minimum says nothing where noise has bent a short arc into another circle
    sagitta = size**2 / (8 * radius)
    return fit.x[:2], radius, 4 * spread / math.sqrt(len(xy)) / sagitta


def _swing_fit(
    t: np.ndarray,
    xy: np.ndarray,
    anchor: np.ndarray,
    length: float,
    gravity: tuple[float, float],
    free: tuple[str, ...],
    seen: Sequence[int] = (0, 1),
) -> tuple[np.ndarray, float] | None:
    """Anchor and length of a pendulum by its course as well as its arc; None where no damped swing fits.

    theta'' = -(g/L) sin(theta) - a theta' - b |theta'| theta' over at most twelve swings, the dampings free: the
    period tells the length far better than the arc does. ``free`` : which of anchor and length may move;  ``seen`` :
    the coordinates that were measured, x (0) and y (1)
    """
    g = math.hypot(*gravity)
    if g == 0:
        return None
    axes = list(seen)
    below = np.array(gravity) / g
    side = np.array([-below[1], below[0]])
    kept = t <= t[0] + 12 * 2 * math.pi * math.sqrt(length / g)
    chosen = np.unique(np.linspace(0, np.count_nonzero(kept) - 1, 400).astype(int))
    t, xy = t[kept][chosen] - t[0], xy[kept][chosen]
    if len(t) < 20:
        return None

    away = xy - anchor
    angle = _angles(away, length, below, side, axes)
    few = slice(0, max(3, int(np.searchsorted(t, 0.4 * math.sqrt(length / g)))))
    speed, first = np.polyfit(t[few], angle[few], 1)
    moved = [*anchor[axes]] if "anchor" in free else []
    start = [first, speed, 0.0, 0.0, *moved, *([length] if "length" in free else [])]
    size = np.array([0.1, 0.1 * math.sqrt(g / length), 0.1, 0.1, *([0.01 * length] * (len(start) - 4))])

    def place(p: np.ndarray) -> tuple[np.ndarray, float]:
        centre = anchor.copy()
        centre[axes[: len(moved)]] = p[4 : 4 + len(moved)]
        return centre, (float(p[-1]) if "length" in free else length)

    def misfit(q: np.ndarray) -> np.ndarray:
        p = np.array(start) + size * (q - 1)
        centre, rod = place(p)
        if not 0.5 * length < rod < 2 * length:
            return np.full(len(t) * len(axes), length)
        run = solve_ivp(
            lambda _, s: (s[1], -g / rod * math.sin(s[0]) - (p[2] + p[3] * abs(s[1])) * s[1]),
            (0.0, float(t[-1])),
            p[:2],
            t_eval=t,
            rtol=1e-8,
            atol=1e-9,
        )
        if run.y.shape[1] != len(t):
            return np.full(len(t) * len(axes), length)
        turned = run.y[0][:, None]
        return (centre + rod * (np.cos(turned) * below + np.sin(turned) * side) - xy)[:, axes].ravel()

    # around one, so that the differences that make the derivatives are 1e-3 of each size
    fit = least_squares(misfit, np.ones(len(start)), diff_step=1e-3, max_nfev=25)
    centre, rod = place(np.array(start) + size * (fit.x - 1))
    spread = float(np.sqrt(2 * fit.cost / (len(axes) * len(t) - len(start))))
    bound = 1.5 * float(np.std(np.hypot(*away.T))) if len(axes) > 1 else SWING_LEFT * float(np.std(xy[:, axes]))
    if not (rod > 0 and spread < bound):
        return None
    return np.array(centre), rod


def _angles(away: np.ndarray, length: float, below: np.ndarray, side: np.ndarray, axes: Sequence[int]) -> np.ndarray:
    """(k,) angles [rad] of places (k, 2) away from the anchor, 0 hanging; off one coordinate none is above pi/2."""
    if len(axes) > 1:
        return np.unwrap(np.arctan2(away @ side, away @ below))
    (axis,) = axes
    return np.arcsin(np.clip(away[:, axis] / length, -1, 1) * np.sign(side[axis])) - math.atan(below[axis] / side[axis])


def _pin_of(name: str, tracks: Tracks, given: Mapping[str, Any], gravity: tuple[float, float]) -> tuple[dict, str]:
    """Anchor and length of one pendulum, what is not given from its tracks, and a remark. Raises InputError."""
    t, xy = tracks.of(name)
    if "anchor" in given and "length" in given:
        return dict(given), ""
    ask = f"say how long its rod is, as --law 'pin:{name},length=0.25'"
    if len(xy) < 10:
        anchor = np.zeros(2)
        if "length" in given:
            return {"anchor": anchor.tolist(), **given}, ""
        swing, g = last_swing_of(*tracks.turned(name)), math.hypot(*gravity)
        length = math.nan if swing is None or not g else rod_of(swing, g, across=False)
        if swing is None or not math.isfinite(length):
            few = f"{name} is seen in {len(xy)} frames, too few to tell its rod from"
            only = f"only the angle of {name} is measured, and no period can be told"
            hardly = f"{few if len(xy) else only}: {ask}"
            raise InputError(tracks.why_unseen(name, hardly), where="scene pendulum")
        return _hung(name, anchor, length, given, _by_period(swing, g, "the angle"))
    flat = [axis for axis in (0, 1) if np.ptp(xy[:, axis]) == 0]
    if len(flat) == 1:
        return _pin_of_one(name, t, xy, 1 - flat[0], given, gravity)
    below = np.array(gravity) / (math.hypot(*gravity) or 1.0)
    free = tuple(key for key in ("anchor", "length") if key not in given)
    if "anchor" in given:
        anchor = np.array(given["anchor"], dtype=float)
        away = np.hypot(*(xy - anchor).T)
        length = float(np.median(away))
        error = float(np.std(away)) / math.sqrt(len(away)) / length
    else:
        anchor, length, error = _circle(xy, given.get("length"), below)
    if error > 0.05:
        found = f"{length:.3g} m +- {100 * error:.0f} %"
        raise InputError(f"the arc of {name} is too short to tell its radius ({found}): {ask}", where="scene pendulum")
    side = np.array([-below[1], below[0]])
    swing = swing_of(t, _angles(xy - anchor, length, below, side, (0, 1))) if any(gravity) else None
    refined, how = _swing_fit(t, xy, anchor, length, gravity, free), "its arc"
    fitted = math.nan if refined is None or "length" in given else refined[1]
    told = _period_told(name, swing, math.hypot(*gravity), length, 5 * error, "length" in given, fitted=fitted)
    # the rod of another length, as a wrong scale or a bob that is no point makes it, would hang from another place
    agree = "length" in given or (refined is not None and abs(refined[1] / length - 1) < 5 * error)
    if refined is not None and agree:
        (anchor, length), how = refined, "its arc and its period" if swing else "its arc and how it falls along it"
    return _hung(name, anchor, length, given, f"by {how}{told}{_no_circle(xy - anchor, length)}")


def _no_circle(away: np.ndarray, length: float) -> str:
    """What is added where places (k, 2) [m] from the anchor lie at distances of no rod; empty where they do.

    Noise is what distances differ by of places that are neighbours along the path.
    """
    far = np.hypot(*away.T)[np.argsort(np.arctan2(away[:, 1], away[:, 0]))]
    off = float(np.sqrt(np.mean(np.square(far - length))))
    noise = float(np.median(np.abs(np.diff(far, n=2)))) / (0.6745 * math.sqrt(6)) if len(far) > 2 else math.inf
    if off < max(NO_CIRCLE * length, CLEARLY * noise):
        return ""
    return (
        f"; but its path is no circle: it is {off:.2g} m off that one (rms). Does another thing than a rod hold it (a "
        "bowl, a spring, a string that slackens), or is the picture bent, or seen at an angle?"
    )


def _hung(name: str, anchor: np.ndarray, length: float, given: Mapping[str, Any], how: str) -> tuple[dict, str]:
    """A pin with what is given and what was found, and the remark."""
    pin: dict[str, Any] = {"anchor": [_round(float(v)) for v in anchor], "length": _round(float(length))}
    place = f"({pin['anchor'][0]:.5g}, {pin['anchor'][1]:.5g}) m, {pin['length']:.5g} m long"
    return {**pin, **given}, f"{name} hangs on a rod from {place}, {how}"


def _period_told(
    name: str, swing: Swing | None, g: float, length: float, error: float, said: bool, *, across: bool = False,
    fitted: float = math.nan,
) -> str:  # fmt: skip
    """What is added where the period tells another length than the arc, or than what the user said; empty else.

    Another by SWINGS_OFF is told of the recording, whatever template made it.
    fitted : the length that a fit of the whole course tells, as the amplitude may fade; nan where there is none
    """
    rod = math.nan if swing is None else rod_of(swing, g, across=across)
    if swing is None or not math.isfinite(rod):
        return ""
    unsure = 6 * swing.error / swing.period
    if math.isfinite(fitted):
        rod, unsure = fitted, 0.0  # of a whole course the period is surer than the arc
    least = max(MARGIN if said else AGREE, error, unsure)
    if abs(rod / length - 1) < least or not 1 / SWINGS_OFF < rod / length < SWINGS_OFF:
        return ""
    told = f"; but its period of {swing.period:.4g} s is that of a point on a rod of {rod:.4g} m"
    if said:
        low, high = sorted((rod, length))
        return (
            f"{told}, which is more off the length that was said than the {100 * MARGIN:.0f} % by which it is adjusted "
            f"(--adjustable pin.length={low * (1 - MARGIN):.3g}:{high * (1 + MARGIN):.3g} lets it be either)"
        )
    large = "large" if length > rod else "small"
    return (
        f"{told}: is the scale of the picture {100 * abs(length / rod - 1):.2g} % too {large} (--unit, times "
        f"{rod / length:.4g}) or the frame rate wrong (--fps, times {math.sqrt(rod / length):.4g}), or is {name} no "
        "point on a rod without a mass?"
    )


def _pin_of_one(
    name: str, t: np.ndarray, xy: np.ndarray, axis: int, given: Mapping[str, Any], gravity: tuple[float, float]
) -> tuple[dict, str]:
    """As ``_pin_of`` where one coordinate alone was measured: no arc, the length is that of the period.

    Its pivot is above the middle of the swing, where the other coordinate, which stands as one number, is the lowest.
    """
    there, missing = "xy"[axis], "yx"[axis]
    g = math.hypot(*gravity)
    below = np.array(gravity) / (g or 1.0)
    side = np.array([-below[1], below[0]])
    if g and abs(below[axis]) > abs(side[axis]):
        raise InputError(
            f"of {name} {there} alone is measured, which goes along gravity: a pendulum is told by the coordinate "
            f"across it (--columns {missing}=NAME)",
            where="scene pendulum",
        )
    swing = swing_of(t, xy[:, axis])
    length = float(given["length"]) if "length" in given else math.nan
    if swing is not None and g and "length" not in given:
        length = rod_of(swing, g, across=True)
    if not math.isfinite(length):
        why = "no period can be told" if swing is None or not g else "its swing is too wide"
        raise InputError(
            f"of {name} {there} alone is measured, which has no arc, and {why}: say how long its rod is, as "
            f"--law 'pin:{name},length=0.25'",
            where="scene pendulum",
        )
    lowest = xy[0].copy()
    lowest[axis] = np.mean(xy[:, axis]) if swing is None else swing.middle
    anchor = np.array(given.get("anchor", lowest - length * below), dtype=float)
    free = tuple(key for key in ("anchor", "length") if key not in given)
    refined = _swing_fit(t, xy, anchor, length, gravity, free, (axis,)) if swing is not None else None
    if refined is not None:
        anchor, length = refined
        anchor[1 - axis] = (lowest - length * below)[1 - axis]
    if "length" in given:
        how = f"above the middle of its swing, as {there} alone is measured"
        return _hung(name, anchor, length, given, how + _period_told(name, swing, g, length, 0.0, True, across=True))
    assert swing is not None
    return _hung(name, anchor, length, given, _by_period(swing, g, there))


def _by_period(swing: Swing, g: float, seen: str) -> str:
    return (
        f"by its period of {swing.period:.4g} s, as that of a point on a rod under {g:.4g} m/s^2: {seen} alone is "
        "measured, which has no arc"
    )


def _pendulum(
    tracks: Tracks, bodies: list[dict[str, Any]], laws: list[dict[str, Any]], box: Mapping[str, Any]
) -> Filled:
    """Each body on a rigid rod from an anchor; both are found from its course where they are not given."""
    gravity = tuple(box.get("gravity", (0.0, -G)))
    laws, notes = list(laws), []
    pins: list[dict[str, Any]] = []
    for body in bodies:
        values, note = _pin_of(body["id"], tracks, _take(laws, "pin", body["id"]), gravity)
        pins.append({"name": "pin", "body": body["id"], **values})
        notes += [note] if note else []
    lengths = [float(p["length"]) for p in pins]
    low, high = min(lengths) * (1 - MARGIN), max(lengths) * (1 + MARGIN)
    adjustable: dict[str, Any] = {"law": "pin", "parameter": "length", "low": _round(low), "high": _round(high)}
    if len(pins) > 1:
        adjustable["per"] = "body"
    return Filled({"scene": {**box, "gravity": list(gravity)}, "law": pins, "adjustable": [adjustable]}, notes, laws)


def _wheel(tracks: Tracks, bodies: list[dict[str, Any]], laws: list[dict[str, Any]], box: Mapping[str, Any]) -> Filled:
    """Bodies that turn about their own centres, each with the moment of inertia of a uniform disk.

    A turn moves no centre, which is what is simulated: all the mass sits at one point of the body, without gravity, at
    the distance sqrt(I/m) from where it turns.
    """
    laws, pins, notes = list(laws), [], []
    for body in bodies:
        name: str = body["id"]
        of_a_disk = _round(float(body["radius"]) / math.sqrt(2))
        pin: dict[str, Any] = {"anchor": [0.0, 0.0], "length": of_a_disk} | _take(laws, "pin", name)
        pins.append({"name": "pin", "body": name, **pin})
        length = float(pin["length"])
        inertia = f"{body['mass'] * length**2:.3g} kg m^2"
        note = f"{name} turns about its own centre, its mass as if {length:.4g} m away: {inertia}"
        if length == of_a_disk:
            note += f", that of a uniform disk (--law pin:{name},length=L says another one, m L^2)"
        notes.append(note)
    return Filled({"scene": {**box, "gravity": [0.0, 0.0]}, "law": pins}, notes, laws)


def _ever_near(tracks: Tracks, bodies: list[dict[str, Any]]) -> bool:
    """Whether two bodies come within a diameter of touching in any frame."""
    size = max(float(b["radius"]) for b in bodies)
    seen = np.isfinite(tracks.x) & np.isfinite(tracks.y)
    order = np.argsort(tracks.t[seen], kind="stable")
    t, xy = tracks.t[seen][order], np.stack([tracks.x[seen], tracks.y[seen]], axis=-1)[order]
    for frame in np.split(xy, np.flatnonzero(np.diff(t)) + 1):
        if len(frame) > 1 and len(cKDTree(frame).query_pairs(4 * size)):
            return True
    return False


def _puck(tracks: Tracks, bodies: list[dict[str, Any]], laws: list[dict[str, Any]], box: Mapping[str, Any]) -> Filled:
    """Bodies that glide on a level table without friction; they collide, if they do, without loss."""
    laws = list(laws)
    data: dict[str, Any] = {"scene": {"gravity": [0.0, 0.0], **box}}
    notes = ["pucks on a level table: no gravity, no friction is believed"]
    # not by friction of contacts, which goes beside another contact law
    told = any(get_law(item["name"]).loses for item in laws)
    if len(bodies) > 1 and not told and not _ever_near(tracks, bodies):
        notes.append("they never come near each other: no contact law (--law contact_elastic,restitution=1 adds one)")
    elif len(bodies) > 1 and not told:
        data["law"] = [{"name": "contact_elastic", "restitution": 1.0}]
        data["adjustable"] = [{"law": "contact_elastic", "parameter": "restitution", "low": 0.3, "high": 1.0}]
    return Filled(data, notes, laws)


def _drop(tracks: Tracks, bodies: list[dict[str, Any]], laws: list[dict[str, Any]], box: Mapping[str, Any]) -> Filled:
    """Bodies that fall freely."""
    return Filled({"scene": {"gravity": [0.0, -G], **box}}, [], list(laws))


def _line_of(xy: np.ndarray) -> np.ndarray:
    """Unit vector (2,) of the line that places (n, 2) lie along: an axis where its slope is within three of its errors.

    The squares across an axis are then those across the line, larger by no more than nine of their mean.
    """
    away = xy - xy.mean(axis=0)
    spread, axes = np.linalg.svd(away, full_matrices=False)[1:]
    along = axes[0] * (1 if axes[0][np.argmax(np.abs(axes[0]))] > 0 else -1)
    least = max(float(spread[1]) ** 2 / len(xy), (np.finfo(float).eps * float(spread[0])) ** 2)
    for k in (0, 1):
        if np.sum(away[:, 1 - k] ** 2) <= float(spread[1]) ** 2 + 9 * least:
            return np.eye(2)[k]
    return np.asarray(along)


def _cart(tracks: Tracks, bodies: list[dict[str, Any]], laws: list[dict[str, Any]], box: Mapping[str, Any]) -> Filled:
    """Each body on a rail; its direction is that of the largest spread, an axis where that does as well."""
    laws, rails, notes = list(laws), [], []
    for body in bodies:
        name = body["id"]
        given = _take(laws, "rail", name)
        direction = given.get("direction")
        if direction is None:
            _, xy = tracks.of(name)
            if len(xy) < 3:
                hardly = f"{name} is hardly seen: say its rail, as --law 'rail:{name},direction=1 0'"
                raise InputError(tracks.why_unseen(name, hardly), where="scene cart")
            direction = [_round(float(v)) for v in _line_of(xy)]
            notes.append(f"{name} moves along ({direction[0]:.4g}, {direction[1]:.4g}): its rail")
        rails.append({"name": "rail", "bodies": [name], "direction": direction})
    return Filled({"scene": {"gravity": [0.0, 0.0], **box}, "law": rails}, notes, laws)


def _swimmer(
    tracks: Tracks, bodies: list[dict[str, Any]], laws: list[dict[str, Any]], box: Mapping[str, Any]
) -> Filled:
    """A chain of disks, the first the head whose axis is driven; the rate of the drive is that of the head's swing."""
    if len(bodies) < 3:
        raise InputError("a swimmer has three disks or more, head first", where="scene swimmer")
    disks = [b for b in bodies if b["role"] in ("free", "head", "tail")]
    chain = [{**b, "role": "head" if k == 0 else "tail"} for k, b in enumerate(disks)]
    others = [b for b in bodies if b not in disks]
    laws, notes = list(laws), []
    given = _take(laws, "bending")
    if "frequency" not in given:
        given["frequency"] = _swing(tracks, chain[0]["id"], chain[1]["id"])
        notes.append(f"the head swings at {given['frequency']:.4g} Hz: the frequency of its drive")
    contact = {"stiffness": 2.2e3, "damping": 1.0e4} | _take(laws, "contact_linear")
    union = {"stiffness": 1.0e3, "damping": 1.0e3} | _take(laws, "union")
    bend = {"stiffness": 2.0e-3, "damping": 1.0e2, "amplitude": math.pi / 4} | given
    stiffness = float(bend["stiffness"])
    notes.append(f"stiffness of the bending: {stiffness:g} N is believed, recalibration may halve or double it")
    return Filled(
        {
            "scene": {"gravity": [0.0, 0.0], **box},
            "body": chain + others,
            "law": [
                {"name": "contact_linear", **contact}, {"name": "union", **union}, {"name": "bending", **bend},
            ],
            "adjustable": [{"law": "bending", "parameter": "stiffness", "low": stiffness / 2, "high": 2 * stiffness}],
        },
        notes, laws,
    )  # fmt: skip


def _swing(tracks: Tracks, head: str, neck: str) -> float:
    """Frequency [Hz] of the largest peak of the angle of the line between two bodies."""
    (t, a), (s, b) = tracks.of(head), tracks.of(neck)
    both, i, j = np.intersect1d(t, s, return_indices=True)
    if len(both) < 16:
        raise InputError("its frequency cannot be read off: --law 'bending,frequency=9'", where="scene swimmer")
    line = a[i] - b[j]
    angle = np.unwrap(np.arctan2(line[:, 1], line[:, 0]))
    even = np.linspace(both[0], both[-1], len(both))
    signal = np.interp(even, both, angle)
    signal = (signal - np.polyval(np.polyfit(even, signal, 1), even)) * np.hanning(len(even))
    size = 16 * len(signal)  # padded with zeros: the peak between two lines of the spectrum
    spectrum = np.abs(np.fft.rfft(signal, size))
    frequency = np.fft.rfftfreq(size, even[1] - even[0])
    return _round(float(frequency[1:][np.argmax(spectrum[1:])]), 4)


TEMPLATES = {
    t.name: t
    for t in (
        Template("pendulum", "bodies on rigid rods under gravity", _pendulum),
        Template("wheel", "bodies turning about their own centres, by their angles", _wheel),
        Template("puck", "bodies gliding on a level table", _puck),
        Template("drop", "bodies in free fall", _drop),
        Template("cart", "bodies on rails", _cart),
        Template("swimmer", "a chain of disks with a driven head", _swimmer),
    )
}
