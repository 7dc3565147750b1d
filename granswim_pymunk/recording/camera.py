"""What a simulation looks like filmed: seen = s R(+angle) L(F true) + b + u t + j, at the frame's time plus an offset.

s R turns and stretches the picture about the origin, or about a place of the picture that the scene has from it.
u t is how far a picture that creeps has gone by then, and j by how much it has jumped.
F is a view at an angle: F true = true - (1 - f) (true . e) e.
L is the lens: L(true) = o + (true - o)(1 + k |true - o|^2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..joints import angles_of, hinged
from ..scene import Scene
from .recording import Recording


def bent(xy: np.ndarray, k: float, middle: Sequence[float]) -> np.ndarray:
    """Positions (..., 2) [m] as a lens shows them: o + (true - o)(1 + k |true - o|^2).

    k [1/m^2], above zero where the corners of a picture are drawn outwards (pincushion);  middle o : (2,) [m]
    Below zero this would turn back at |true - o| = 1/sqrt(-3 k), and no lens shows what is farther away nearer to the
    middle: from there on all is seen at the rim.
    Source: Brown 1966, Photogrammetric Engineering 32, 444 (the first radial term); the contract's lens_distortion.
    """
    away = np.asarray(xy, dtype=float) - np.asarray(middle, dtype=float)
    if k < 0:
        rim = 1.0 / math.sqrt(-3.0 * k)
        away = away * np.minimum(1.0, rim / np.maximum(np.sqrt(np.sum(away**2, axis=-1, keepdims=True)), rim))
    return np.asarray(middle) + away * (1.0 + k * np.sum(away**2, axis=-1, keepdims=True))


def foreshortened(xy: np.ndarray, f: float, direction: float) -> np.ndarray:
    """Positions (..., 2) [m] as a camera shows them that looks at an angle: true - (1 - f) (true . e) e.

    f [1] : what is left of lengths along e = (cos direction, sin direction), direction [rad]; the cosine of the angle
    between the line of sight and the normal of the plane of motion, above one where lengths were set by a ruler along e
    Source: the parallel projection of a plane (Hartley & Zisserman 2004, Multiple View Geometry, section 6.3).
    """
    e = np.array([math.cos(direction), math.sin(direction)])
    xy = np.asarray(xy, dtype=float)
    return xy - (1.0 - f) * (xy @ e)[..., None] * e


def see(
    xy: np.ndarray,
    *,
    scale: float = 1.0,
    tilt: float = 0.0,
    bias: Sequence[float] = (0.0, 0.0),
    distortion: float = 0.0,
    middle: Sequence[float] = (0.0, 0.0),
    foreshortening: float = 1.0,
    direction: float = 0.0,
    drift: Sequence[float] = (0.0, 0.0),
    jump: Sequence[float] = (0.0, 0.0),
    jumped: float = 0.0,
    about: Sequence[float] = (0.0, 0.0),
    since: np.ndarray | None = None,
) -> np.ndarray:
    """Positions as the camera shows them: seen = s R(+tilt) L(F true) + b + drift since, + jump where since >= jumped.

    xy : (..., 2) true unwrapped positions [m];  scale s;  tilt [rad], counter-clockwise, about the origin;
    bias b : (2,) [m];  distortion [1/m^2] and middle (2,) [m] of the lens L, see ``bent``
    foreshortening [1] and direction [rad] of a view F at an angle, see ``foreshortened``
    about (2,) [m] : what scale and tilt leave in place, the origin where not given
    drift (2,) [m/s] of a picture that creeps;  jump (2,) [m] of one that jumps, ``jumped`` [s] after the first frame
    since (T,) [s] : times after the first frame, of xy (T, n, 2); where not given, neither is seen
    Returns (..., 2) [m].
    Source: the contract's camera_scale, camera_tilt, tracking_bias.
    """
    if foreshortening != 1.0:
        xy = foreshortened(xy, foreshortening, direction)
    if distortion:
        xy = bent(xy, distortion, middle)
    if any(about):
        xy, bias = np.asarray(xy) - np.asarray(about), (bias[0] + about[0], bias[1] + about[1])
    c, s = scale * math.cos(tilt), scale * math.sin(tilt)
    seen = np.empty_like(xy, dtype=float)
    seen[..., 0] = c * xy[..., 0] - s * xy[..., 1] + bias[0]
    seen[..., 1] = s * xy[..., 0] + c * xy[..., 1] + bias[1]
    if since is not None and (any(drift) or any(jump)):
        since = np.asarray(since, dtype=float)
        seen += (np.multiply.outer(since, drift) + np.multiply.outer(since >= jumped, jump))[:, None]
    return seen


def rod_angle(xy: np.ndarray, anchor: Sequence[float], gravity: Sequence[float] = (0.0, -9.81)) -> np.ndarray:
    """Angle of a pinned body's rod, 0 when hanging along gravity, counter-clockwise [rad], in (-pi, pi].

    atan2(down x d, down . d) with d = xy - anchor, which for gravity along -y is atan2(dx, -dy).
    xy : (..., 2) [m]; without gravity, down is -y. Returns (...).
    """
    size = math.hypot(gravity[0], gravity[1])
    down_x, down_y = (gravity[0] / size, gravity[1] / size) if size > 0 else (0.0, -1.0)
    dx, dy = xy[..., 0] - anchor[0], xy[..., 1] - anchor[1]
    return np.arctan2(down_x * dy - down_y * dx, down_x * dx + down_y * dy)


def _angles(
    scene: Scene, rows: np.ndarray, true: np.ndarray, asked: Sequence[int], sampled: np.ndarray
) -> np.ndarray:
    """Angles (T, n) [rad] of pinned and hinged bodies among ``rows``, not a number of the others.

    true : (T, n, 2) places of these;  sampled : (T, m, 2) of the rows ``asked``, all that hinges need among them
    """
    angle = np.full(true.shape[:2], np.nan)
    at = {scene.bodies[row].id: column for column, row in enumerate(rows)}
    for pin in scene.laws_named("pin"):
        for body in pin.bodies or ():
            if body in at:
                angle[:, at[body]] = np.unwrap(rod_angle(true[:, at[body]], pin.values["anchor"], scene.gravity))
    turning = [scene.ids.index(name) for name in hinged(scene)]
    if turning:
        whole = np.array([body.initial for body in scene.bodies], dtype=float)[:, :2]
        whole = np.repeat(whole[None], len(true), axis=0)
        whole[:, list(asked)] = sampled
        turned = np.unwrap(angles_of(scene, whole, np.zeros_like(whole))[0], axis=0)
        for row in turning:
            if scene.ids[row] in at:
                angle[:, at[scene.ids[row]]] = turned[:, row]
    return angle


def film(
    source: Any,
    times: Sequence[float] | np.ndarray,
    *,
    rng: np.random.Generator | None = None,
    noise: float = 0.0,
    angle_noise: float = 0.0,
    scale: float = 1.0,
    tilt: float = 0.0,
    time_offset: float = 0.0,
    bias: Sequence[float] = (0.0, 0.0),
    distortion: float = 0.0,
    middle: Sequence[float] | None = None,
    foreshortening: float = 1.0,
    direction: float = 0.0,
    drift: Sequence[float] = (0.0, 0.0),
    drop: float | np.ndarray = 0.0,
    positions: bool = True,
    wrap: bool = False,
    name: str = "simulation",
    mode: str = "verlet",
) -> Recording:
    """Run a scene and film it: a Recording of its observed mobile bodies.

    source : Scene, or a Simulation that stands before the first frame
    times : (T,) stamps of the frames [s], rising; a frame stamped t shows the state at t + time_offset
    noise [m], angle_noise [rad] : one standard deviation, drawn from ``rng``
    scale, tilt [rad], bias (2,) [m] : as in ``see``; a pinned body's angle is seen turned by the tilt too
    distortion [1/m^2], middle (2,) [m] : of the lens; its middle is the mean of all true places where not given
    foreshortening [1], direction [rad] : of a view at an angle, and drift (2,) [m/s] of a picture that creeps: ``see``
    drop : share of sightings that are lost at random, or (T, n) True where a body is not seen
    positions : False leaves angles only (an encoder);  wrap : fold x into the periodic box
    Raises InputError where nothing is observed or random numbers are asked for without a generator.
    """
    from ..engine import Simulation

    simulation = Simulation(source, mode=mode) if isinstance(source, Scene) else source
    scene: Scene = simulation.scene
    times = np.asarray(times, dtype=float)
    rows = np.array([i for i, b in enumerate(scene.bodies) if b.mobile and b.observed], dtype=np.int64)
    if not len(rows):
        raise InputError("no mobile body is observed", where=f"recording {name}")
    shape = (len(times), len(rows))
    if rng is None and (noise > 0 or angle_noise > 0 or (np.ndim(drop) == 0 and drop > 0)):
        raise InputError("noise and random drops need a generator (rng)", where=f"recording {name}")

    turning = [scene.ids.index(name) for name in hinged(scene)]
    asked = list(dict.fromkeys((*rows.tolist(), *turning)))
    sampled = simulation.sample(times + time_offset, asked)
    true = sampled[:, : len(rows)]
    if distortion and scene.periodic_x:
        raise InputError("a lens does not show unwrapped positions", where=f"recording {name}")
    about = tuple(true.reshape(-1, 2).mean(axis=0).tolist()) if middle is None and true.size else middle or (0.0, 0.0)
    xy = see(
        true, scale=scale, tilt=tilt, bias=bias, distortion=distortion, middle=about, foreshortening=foreshortening,
        direction=direction, drift=drift, since=times - times[:1],
    )  # fmt: skip
    angle = _angles(scene, rows, true, asked, sampled) + tilt
    if rng is not None:
        if noise > 0:
            xy = xy + rng.normal(0.0, noise, xy.shape)
        if angle_noise > 0:
            angle = angle + rng.normal(0.0, angle_noise, shape)
    if wrap and scene.periodic_x:
        xy[..., 0] %= scene.periodic_x
    lost = _lost(drop, shape, rng)
    xy[lost], angle[lost] = np.nan, np.nan
    if not positions:
        xy[:] = np.nan
    has_angle = bool(np.isfinite(angle).any())
    seen = np.isfinite(xy[..., 0]) | np.isfinite(angle)
    kept = np.flatnonzero(seen.any(axis=0))
    steps = np.diff(times)
    return Recording(
        name=name, title=scene.title, scene=scene, t=times, ids=tuple(scene.bodies[row].id for row in rows[kept]),
        xy=xy[:, kept], angle=angle[:, kept] if has_angle else None,
        sampling=float(1 / np.median(steps)) if len(steps) else None,
        position_noise=noise if noise > 0 else None,
        angle_noise=angle_noise if has_angle and angle_noise > 0 else None,
    )  # fmt: skip


def _lost(drop: float | np.ndarray, shape: tuple[int, int], rng: np.random.Generator | None) -> np.ndarray:
    """(T, n) sightings that are lost, see ``film``."""
    if np.ndim(drop) == 0:
        return np.zeros(shape, dtype=bool) if rng is None or not drop else rng.random(shape) < drop
    lost = np.asarray(drop, dtype=bool)
    if lost.shape != shape:
        raise InputError(f"drop should have the shape (T, n) = {shape}, got {lost.shape}")
    return lost
