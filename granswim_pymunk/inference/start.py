"""Start states as free numbers: what can move at the start of a window, and a first estimate from the tracks."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..joints import angles_of, hanging
from ..joints import place as placed
from ..scene import Body, Scene
from .criteria import current
from .data import Case

Camera = Mapping[str, float]
State = tuple[float, float, float, float]  # x, y, vx, vy
Estimate = tuple[float, float, float, float]  # value and slope at the start, with their standard deviations


@dataclass(frozen=True)
class StartBody:
    """How the start of one body is described: in which coordinates, and which of its numbers are free.

    first : first estimate of all numbers;  scale : how well the tracks determine them
    free : mask of those that are fitted, the others are kept
    """

    body: str
    coordinates: Coordinates
    first: np.ndarray
    scale: np.ndarray
    free: np.ndarray


@dataclass(frozen=True)
class Seen:
    """What the first frames show of a body.

    estimates : by channel ("x", "y", "angle");  x, y : its place, also where a coordinate is no channel
    """

    body: Body
    case: Case
    frames: np.ndarray
    scene: Scene
    estimates: Mapping[str, Estimate]
    x: Estimate
    y: Estimate

    def start(
        self, coordinates: Coordinates, first: Sequence[float], scale: Sequence[float], free: Sequence[bool]
    ) -> StartBody:
        return StartBody(self.body.id, coordinates, np.array(first), np.array(scale), np.array(free))


class Coordinates(ABC):
    """The numbers that describe where a body is at the start and how it moves, in what a constraint leaves to it.

    kinds : what they are: places x and y, speeds v, an angle a and its rate s
    """

    kinds: ClassVar[str]

    @property
    def swings(self) -> bool:
        return "a" in self.kinds

    @property
    def pushed(self) -> bool:
        """Whether an impact changes its speed: place first, then one speed or two."""
        return "v" in self.kinds

    @abstractmethod
    def holds(self, scene: Scene, body: str) -> bool:
        """Whether these are the coordinates of a body."""

    @abstractmethod
    def begin(self, seen: Seen) -> StartBody:
        """First estimates from the tracks."""

    @abstractmethod
    def values(
        self, start: StartBody, scene: Scene, row: Mapping[str, int], xy: np.ndarray, v: np.ndarray
    ) -> np.ndarray:
        """The numbers that a state of all bodies (n, 2), (n, 2) would have; ``row``: of each body."""


class OfOneBody(Coordinates):
    """Coordinates whose numbers give the state of a body as soon as those of the bodies before it are known."""

    @abstractmethod
    def state(self, values: np.ndarray, scene: Scene, body: str, before: Mapping[str, State], t0: float) -> State:
        """The state that the numbers mean; ``before``: those of the bodies described before this one."""


class Unbound(OfOneBody):
    """A body that may go anywhere."""

    kinds = "xyvv"

    def holds(self, scene: Scene, body: str) -> bool:
        return True

    def begin(self, seen: Seen) -> StartBody:
        x, y = seen.x, seen.y
        free = [kind in seen.estimates for kind in "xyxy"]
        return seen.start(self, [x[0], y[0], x[1], y[1]], [x[2], y[2], x[3], y[3]], free)

    def state(self, values: np.ndarray, scene: Scene, body: str, before: Mapping[str, State], t0: float) -> State:
        return values[0], values[1], values[2], values[3]

    def values(
        self, start: StartBody, scene: Scene, row: Mapping[str, int], xy: np.ndarray, v: np.ndarray
    ) -> np.ndarray:
        return np.concatenate([xy[row[start.body]], v[row[start.body]]])


class Guided(OfOneBody):
    """A body on a rail: its place, and its speed along it."""

    kinds = "xyv"

    def holds(self, scene: Scene, body: str) -> bool:
        return _acting(scene, body, "guide") is not None

    def begin(self, seen: Seen) -> StartBody:
        x, y = seen.x, seen.y
        along = self._direction(seen.scene, seen.body.id)
        free = ["x" in seen.estimates, "y" in seen.estimates, bool(seen.estimates)]
        speed = x[1] * along[0] + y[1] * along[1]
        return seen.start(self, [x[0], y[0], speed], [x[2], y[2], max(x[3], y[3])], free)

    def state(self, values: np.ndarray, scene: Scene, body: str, before: Mapping[str, State], t0: float) -> State:
        along = self._direction(scene, body)
        return values[0], values[1], values[2] * along[0], values[2] * along[1]

    def values(
        self, start: StartBody, scene: Scene, row: Mapping[str, int], xy: np.ndarray, v: np.ndarray
    ) -> np.ndarray:
        along, k = self._direction(scene, start.body), row[start.body]
        return np.array([xy[k, 0], xy[k, 1], v[k, 0] * along[0] + v[k, 1] * along[1]])

    @staticmethod
    def _direction(scene: Scene, body: str, role: str = "guide") -> np.ndarray:
        """Unit vector along which a body moves."""
        direction = np.array(_given(scene, body, role)["direction"], dtype=float)
        return direction / math.hypot(*direction)


class Commanded(Guided):
    """A body that follows a command: its place alone, its velocity is commanded."""

    kinds = "xy"

    def holds(self, scene: Scene, body: str) -> bool:
        return body in scene.inputs and _acting(scene, body, "command") is not None

    def begin(self, seen: Seen) -> StartBody:
        return seen.start(self, [seen.x[0], seen.y[0]], [seen.x[2], seen.y[2]], [k in seen.estimates for k in "xy"])

    def state(self, values: np.ndarray, scene: Scene, body: str, before: Mapping[str, State], t0: float) -> State:
        direction = self._direction(scene, body, "command")
        t, command = scene.inputs[body]
        speed = _given(scene, body, "command")["gain"] * float(np.interp(t0, t, command))
        return values[0], values[1], speed * direction[0], speed * direction[1]

    def values(
        self, start: StartBody, scene: Scene, row: Mapping[str, int], xy: np.ndarray, v: np.ndarray
    ) -> np.ndarray:
        return np.array(xy[row[start.body]])


class Swinging(OfOneBody):
    """A body at a fixed distance from a place: the angle [rad] from gravity, counter-clockwise, and its rate."""

    kinds = "as"

    @abstractmethod
    def arm(self, scene: Scene, body: str) -> tuple[str | None, np.ndarray, float]:
        """The body it is held by (None: the world), where that is where it is known, and the distance [m]."""

    def state(self, values: np.ndarray, scene: Scene, body: str, before: Mapping[str, State], t0: float) -> State:
        other, at, length = self.arm(scene, body)
        down, across = _hanging(scene)
        arm = length * (math.cos(values[0]) * down + math.sin(values[0]) * across)
        turn = length * values[1] * (math.cos(values[0]) * across - math.sin(values[0]) * down)
        if other is None:
            place, velocity = at + arm, turn
        else:
            held = np.array(before[other] if other in before else scene.body(other).initial, dtype=float)
            place, velocity = held[:2] + arm, held[2:] + turn
        return place[0], place[1], velocity[0], velocity[1]

    def values(
        self, start: StartBody, scene: Scene, row: Mapping[str, int], xy: np.ndarray, v: np.ndarray
    ) -> np.ndarray:
        other, at, length = self.arm(scene, start.body)
        k, down, across = row[start.body], *_hanging(scene)
        arm, turn = (xy[k] - at, v[k]) if other is None else (xy[k] - xy[row[other]], v[k] - v[row[other]])
        angle = math.atan2(float(arm @ across), float(arm @ down))
        angle += _turns(start, angle)
        tangent = math.cos(angle) * across - math.sin(angle) * down
        return np.array([angle, float(turn @ tangent) / length])


class Pendulum(Swinging):
    """A body that swings about a place in the world."""

    def holds(self, scene: Scene, body: str) -> bool:
        return pin_of(scene, body) is not None

    def arm(self, scene: Scene, body: str) -> tuple[str | None, np.ndarray, float]:
        pin = _given(scene, body, "pendulum")
        return None, np.array(pin["anchor"]), pin["length"]

    def begin(self, seen: Seen) -> StartBody:
        if "angle" in seen.estimates:
            return _by_angle(self, seen)
        x, y = seen.x, seen.y
        down, across = _hanging(seen.scene)
        _, at, length = self.arm(seen.scene, seen.body.id)
        arm = np.array([x[0], y[0]]) - at
        angle = math.atan2(float(arm @ across), float(arm @ down))
        tangent = math.cos(angle) * across - math.sin(angle) * down
        spin = float(np.array([x[1], y[1]]) @ tangent) / length
        sigma = max(x[2], y[2]) / length, max(x[3], y[3]) / length
        return seen.start(self, [angle, spin], sigma, [bool(seen.estimates)] * 2)


class Bar(Swinging):
    """A body that a rod joins to one described before it."""

    def holds(self, scene: Scene, body: str) -> bool:
        return body in rods_of(scene)

    def arm(self, scene: Scene, body: str) -> tuple[str | None, np.ndarray, float]:
        other, length = rods_of(scene)[body]
        return other, np.zeros(2), length

    def begin(self, seen: Seen) -> StartBody:
        """Angle and rate of the rod from where both its ends are seen."""
        other, _, length = self.arm(seen.scene, seen.body.id)
        assert other is not None
        down, across = _hanging(seen.scene)
        t = seen.case.t[seen.frames]
        places = []
        for name in (other, seen.body.id):
            given = seen.scene.body(name).initial or (0.0, 0.0, 0.0, 0.0)
            tracked = _seen_at(seen.case, name, seen.frames)
            places.append(tracked if np.isfinite(tracked).any() else np.full((len(t), 2), given[:2]))
        arm = places[1] - places[0]
        angle = _unwrapped(np.arctan2(arm @ across, arm @ down))
        sigma = max(seen.x[2], seen.y[2]) / length
        value, rate, spread, rate_spread = _local_fit(t, angle, float(t[0]), sigma)
        return seen.start(self, [value, rate], [spread, rate_spread], [bool(seen.estimates)] * 2)


class Hinged(Coordinates):
    """A body that hangs from the world by hinges: its own angle and rate."""

    kinds = "as"

    def holds(self, scene: Scene, body: str) -> bool:
        return body in hanging(scene)

    def begin(self, seen: Seen) -> StartBody:
        """From the tracked angle, else from the places of the bodies it hangs from."""
        if "angle" in seen.estimates:
            return _by_angle(self, seen)
        case, scene, body = seen.case, seen.scene, seen.body.id
        t = case.t[seen.frames]
        given = np.array([b.initial or (0.0, 0.0, 0.0, 0.0) for b in scene.bodies], dtype=float)
        xy = np.repeat(given[None, :, :2], len(t), axis=0)
        for k, other in enumerate(scene.bodies):
            tracked = _seen_at(case, other.id, seen.frames)
            xy[:, k] = tracked if np.isfinite(tracked).any() else xy[:, k]
        angle = _unwrapped(angles_of(scene, xy, np.zeros_like(xy))[0][:, scene.ids.index(body)])
        sigma = [case.sigma[k] for k, c in enumerate(case.channels) if c.body == body and c.kind != "angle"]
        arm = max(hanging(scene)[body], 1e-12)
        value, rate, spread, rate_spread = _local_fit(t, angle, float(t[0]), max(sigma, default=1e-6) / arm)
        return seen.start(self, [value, rate], [spread, rate_spread], [bool(sigma)] * 2)

    def values(
        self, start: StartBody, scene: Scene, row: Mapping[str, int], xy: np.ndarray, v: np.ndarray
    ) -> np.ndarray:
        angle, rate = (of[row[start.body]] for of in angles_of(scene, xy, v))
        return np.array([angle + _turns(start, angle), rate])


# the first that holds: what a constraint leaves to a body
COORDINATES: tuple[Coordinates, ...] = (Hinged(), Bar(), Pendulum(), Commanded(), Guided(), Unbound())


def _by_angle(coordinates: Coordinates, seen: Seen) -> StartBody:
    angle = seen.estimates["angle"]
    return seen.start(coordinates, angle[:2], angle[2:], [True, True])


def _turns(start: StartBody, angle: float) -> float:
    """Whole turns [rad] to the angle of the start that it is held against."""
    return 2 * math.pi * round((start.first[0] - angle) / (2 * math.pi))


def _unwrapped(angle: np.ndarray) -> np.ndarray:
    """An angle (T,) without jumps, NaN where it is not seen."""
    finite = np.isfinite(angle)
    angle[finite] = np.unwrap(angle[finite])
    return angle


def _hanging(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Unit vector along gravity (down where there is none), and the same turned by +90 degrees."""
    g = np.array(scene.gravity)
    size = math.hypot(*g)
    down = g / size if size > 0 else np.array([0.0, -1.0])
    return down, np.array([-down[1], down[0]])


def _acting(scene: Scene, body: str, role: str) -> Mapping[str, Any] | None:
    """Values of the first law with a role that acts on a body."""
    found = (i for i in scene.laws_as(role) if i.bodies is None or body in i.bodies)
    return next((scene.resolved(item) for item in found), None)


def _given(scene: Scene, body: str, role: str) -> Mapping[str, Any]:
    found = _acting(scene, body, role)
    assert found is not None
    return found


def pin_of(scene: Scene, body: str) -> Mapping[str, Any] | None:
    """Values of the law by which a body swings about a place in the world."""
    found = (i for i in scene.laws_as("pendulum") if body in (i.bodies or ()))
    return next((scene.resolved(item) for item in found), None)


def rods_of(scene: Scene) -> dict[str, tuple[str, float]]:
    """Of each body that a rod joins to one described before it: that body, and the length [m]."""
    found: dict[str, tuple[str, float]] = {}
    order = {body.id: k for k, body in enumerate(scene.bodies)}
    for item in scene.laws_as("bar"):
        first, second = sorted(item.bodies or (), key=lambda name: order[name])
        held = pin_of(scene, second) or _acting(scene, second, "guide") or _acting(scene, second, "command")
        if second not in found and not held and scene.body(second).mobile:
            found[second] = (first, float(item.values["length"]))
    return found


def _local_fit(t: np.ndarray, values: np.ndarray, t0: float, sigma: float) -> Estimate:
    """Value and slope at t0 from a quadratic over the first frames, with their standard deviations."""
    seen = np.flatnonzero(np.isfinite(values))[:9]
    if len(seen) < 2:
        return (float(values[seen[0]]) if len(seen) else 0.0), 0.0, sigma, 1.0
    s = t[seen] - t0
    degree = 2 if len(seen) >= current().fits.curved else 1
    design = np.vander(s, degree + 1, increasing=True)
    coefficients, *_ = np.linalg.lstsq(design, values[seen], rcond=None)
    covariance = np.linalg.pinv(design.T @ design) * sigma**2
    return (
        float(coefficients[0]), float(coefficients[1]),
        float(np.sqrt(covariance[0, 0])) or sigma, float(np.sqrt(covariance[1, 1])) or sigma,
    )  # fmt: skip


def _seen_at(case: Case, body: str, frames: np.ndarray) -> np.ndarray:
    """Places (T_frames, 2) [m] of a body in a case, which may hold other frames than its recording; NaN where not seen.

    A coordinate that is no channel did not change.
    """
    xy = np.full((int(frames.sum()), 2), np.nan)
    for axis, kind in enumerate("xy"):
        mine = [k for k, c in enumerate(case.channels) if (c.body, c.kind) == (body, kind)]
        if mine:
            xy[:, axis] = case.values[frames, mine[0]]
        elif body in case.recording.ids:
            known = case.recording.xy[:, case.recording.ids.index(body), axis]
            xy[:, axis] = np.median(known[np.isfinite(known)]) if np.isfinite(known).any() else np.nan
    return xy


def _what_is_seen(body: Body, case: Case, frames: np.ndarray, scene: Scene) -> Seen:
    """A coordinate that is no channel stands where it stands; a body that is never seen keeps its ``initial``."""
    t = case.t[frames]
    estimates: dict[str, Estimate] = {
        c.kind: _local_fit(t, case.values[frames, k], float(t[0]), float(case.sigma[k]))
        for k, c in enumerate(case.channels) if c.body == body.id
    }  # fmt: skip
    given = body.initial or (0.0, 0.0, 0.0, 0.0)
    place = {"x": (given[0], given[2], 1e-12, 1e-12), "y": (given[1], given[3], 1e-12, 1e-12)}
    place |= {kind: estimates[kind] for kind in "xy" if kind in estimates}
    if body.id in case.recording.ids:
        seen = case.recording.xy[:, case.recording.ids.index(body.id), :]
        for axis, kind in enumerate("xy"):
            # without any channel it is its place that counts where both were seen in some frame
            known = seen if not estimates else seen[:, axis]
            if kind not in estimates and np.isfinite(known).any():
                place[kind] = (float(np.nanmedian(seen[:, axis])), 0.0, 1e-12, 1e-12)
    return Seen(body, case, frames, scene, estimates, place["x"], place["y"])


def describe_starts(case: Case, frames: np.ndarray, scene: Scene | None = None) -> tuple[StartBody, ...]:
    """The start of every mobile body at the first of ``frames`` (T,) mask. Unseen bodies keep ``initial``."""
    scene = scene or case.recording.scene
    return tuple(
        next(c for c in COORDINATES if c.holds(scene, body.id)).begin(_what_is_seen(body, case, frames, scene))
        for body in scene.bodies if body.mobile
    )  # fmt: skip


def states(bodies: tuple[StartBody, ...], numbers: np.ndarray, scene: Scene, t0: float) -> dict[str, State]:
    """x, y, vx, vy of every body from the free ``numbers`` (in the order of the bodies)."""
    result: dict[str, State] = {}
    angles: dict[str, float] = {}
    spins: dict[str, float] = {}
    at = 0
    for start in bodies:
        values = start.first.copy()
        count = int(start.free.sum())
        values[start.free] = numbers[at : at + count]
        at += count
        if isinstance(start.coordinates, OfOneBody):
            result[start.body] = start.coordinates.state(values, scene, start.body, result, t0)
        else:  # in hinges: a chain is placed as a whole
            angles[start.body], spins[start.body] = float(values[0]), float(values[1])
    return result | placed(scene, angles, spins) if angles else result


def numbers_at(bodies: tuple[StartBody, ...], scene: Scene, xy: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The free numbers of a start that a state would have: the inverse of ``states``.

    xy, v : (n, 2) positions [m] and velocities [m/s], rows in the order of the scene's bodies
    """
    row = {name: k for k, name in enumerate(scene.ids)}
    found = [s.coordinates.values(s, scene, row, xy, v)[s.free] for s in bodies]
    return np.concatenate(found) if found else np.zeros(0)


def first_numbers(bodies: tuple[StartBody, ...]) -> np.ndarray:
    return np.concatenate([b.first[b.free] for b in bodies]) if bodies else np.zeros(0)


def number_scales(bodies: tuple[StartBody, ...]) -> np.ndarray:
    return np.concatenate([b.scale[b.free] for b in bodies]) if bodies else np.zeros(0)


def pendulum_angle(xy: np.ndarray, scene: Scene, body: str) -> np.ndarray:
    """Angle of the rod (T,) from positions (T, 2): 0 when hanging, counter-clockwise, unwrapped."""
    down, across = _hanging(scene)
    arm = xy - np.array(_given(scene, body, "pendulum")["anchor"])
    return _without_turns(np.arctan2(arm @ across, arm @ down))


def _without_turns(angle: np.ndarray) -> np.ndarray:
    """``np.unwrap`` of an angle (T,), as it is where it does not jump: most runs of most fits."""
    return np.unwrap(angle) if (np.abs(np.diff(angle)) > np.pi).any() else angle


def turning_angle(xy: np.ndarray, rows: Sequence[int], scene: Scene, body: str) -> np.ndarray:
    """Angle (T,) [rad], unwrapped, of a pinned rod or of a body in a hinge, from positions (T, k, 2) of ``rows``.

    For a hinged body ``rows`` of ``scene.bodies`` hold all bodies that it hangs from.
    """
    if pin_of(scene, body) is not None:
        return pendulum_angle(xy[:, list(rows).index(scene.ids.index(body))], scene, body)
    whole = np.zeros((len(xy), len(scene.bodies), 2))
    for k, other in enumerate(scene.bodies):
        whole[:, k] = xy[:, list(rows).index(k)] if k in rows else (other.initial or (0.0, 0.0))[:2]
    return _without_turns(angles_of(scene, whole, np.zeros_like(whole))[0][:, scene.ids.index(body)])
