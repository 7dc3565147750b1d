"""Least squares with the proof's own simulator: calibrating a scene on tracks, and how strong an effect is.

The standard errors of an effect are the square root of the least chi2 that the scene without it reaches on tracks
without noise, after starts and adjustable parameters are fitted; d' of a rival is the same with the rival added,
beyond what the mechanism's own canonical form leaves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from ..errors import SimulationError
from ..scene import Scene
from . import kernels as k
from .candidates import bounds as bounds_of
from .candidates import camera_of, numbers, physics_of, with_numbers
from .setups import Setup
from .world import Effect, World

FAR = 1e6  # innovation of a run that did not stay finite


@dataclass(frozen=True)
class Sight:
    """What is seen of a case: frame times t (T,) [s], values (T, c), NaN where not seen; sigma; the seen bodies.

    ``values`` are x, y of each body in turn [m], or the rods' angles [rad] where the setup says so.
    """

    t: np.ndarray
    values: np.ndarray
    sigma: float

    def part(self, share: float) -> Sight:
        """The first ``share`` of the time."""
        keep = self.t <= self.t[0] + share * (self.t[-1] - self.t[0])
        return Sight(self.t[keep], self.values[keep], self.sigma)


@dataclass(frozen=True)
class Solution:
    """adjusted : LAW.PARAMETER -> value;  effects : with their fitted numbers;  start (n, 4);  chi2, count."""

    adjusted: Mapping[str, float]
    effects: tuple[Effect, ...]
    start: np.ndarray
    chi2: float
    count: int


def with_adjusted(scene: Scene, adjusted: Mapping[str, float]) -> Scene:
    for name, value in adjusted.items():
        scene = scene.with_parameter(name, float(value))
    return scene


def look(
    setup: Setup, scene: Scene, effects: Sequence[Effect], start: np.ndarray, t: np.ndarray, t0: float
) -> np.ndarray:
    """(T, c) what the camera gives at stamps ``t`` of a run from ``start`` at t0, without noise."""
    camera = camera_of(effects)
    world = World(scene, physics_of(effects), setup.dt)
    begin = t0 + camera.time_offset
    run = world.sample(t + camera.time_offset, start, t0=begin)
    rows = [i for i, b in enumerate(scene.bodies) if b.mobile and b.observed]
    if setup.angles:
        return run.angle[:, rows] + camera.tilt
    return camera.see(run.xy[:, rows]).reshape(len(t), -1)


class Starts:
    """The start of every mobile body as free numbers, by how it can move."""

    def __init__(self, setup: Setup, scene: Scene, t: np.ndarray, noise: float) -> None:
        world = World(scene, [], setup.dt)
        self.kind, self.geometry, self.down = world.kind, world.geometry, world.down
        self.fixed = world.start()
        self.drive = world.drive
        span = min(float(t[-1] - t[0]), 12 * float(np.median(np.diff(t))))
        size = []
        for i, b in enumerate(scene.bodies):
            if not b.mobile:
                continue
            if self.kind[i] == k.PIN:
                angle = noise if setup.angles else noise / self.geometry[i, 2]
                size += [angle, angle / span]
            elif self.kind[i] == k.RAIL:
                size += [noise, noise, noise / span]
            elif self.kind[i] == k.DRIVEN:
                size += [noise, noise]
            else:
                size += [noise, noise, noise / span, noise / span]
        self.size = np.array(size)

    def pack(self, start: np.ndarray) -> np.ndarray:
        z: list[float] = []
        for i in range(len(start)):
            x, y, vx, vy = start[i]
            if self.kind[i] == k.PIN:
                ax, ay, length, _ = self.geometry[i]
                psi = math.atan2(y - ay, x - ax)
                z += [psi, (-vx * math.sin(psi) + vy * math.cos(psi)) / length]
            elif self.kind[i] == k.RAIL:
                z += [x, y, vx * self.geometry[i, 0] + vy * self.geometry[i, 1]]
            elif self.kind[i] == k.DRIVEN:
                z += [x, y]
            elif self.kind[i] == k.FREE:
                z += [x, y, vx, vy]
        return np.array(z)

    def unpack(self, z: np.ndarray, world: World) -> np.ndarray:
        start = self.fixed.copy()
        at = 0
        for i in range(len(start)):
            if self.kind[i] == k.PIN:
                ax, ay, length, _ = world.geometry[i]  # the length may be adjustable
                psi, omega = z[at : at + 2]
                c, s = math.cos(psi), math.sin(psi)
                start[i] = [ax + length * c, ay + length * s, -length * omega * s, length * omega * c]
                at += 2
            elif self.kind[i] == k.RAIL:
                x, y, speed = z[at : at + 3]
                start[i] = [x, y, speed * self.geometry[i, 0], speed * self.geometry[i, 1]]
                at += 3
            elif self.kind[i] == k.DRIVEN:
                start[i, :2] = z[at : at + 2]
                at += 2
            elif self.kind[i] == k.FREE:
                start[i] = z[at : at + 4]
                at += 4
        return start


def solve(
    setup: Setup,
    scene: Scene,
    sight: Sight,
    effects: Sequence[Effect] = (),
    start: np.ndarray | None = None,
    *,
    fixed: bool = False,
    evaluations: int = 12,
) -> Solution:
    """Fit starts, the scene's adjustable parameters, and (unless ``fixed``) the numbers of ``effects`` to a sight."""
    t0 = float(sight.t[0])
    starts = Starts(setup, scene, sight.t, sight.sigma)
    names = [a.name for a in scene.adjustable]
    low = np.array([a.low for a in scene.adjustable])
    high = np.array([a.high for a in scene.adjustable])
    first = np.array([scene.parameter(a.name) for a in scene.adjustable], dtype=float)
    inner = np.concatenate([numbers(e) for e in effects]) if effects and not fixed else np.zeros(0)
    lengths = [len(numbers(e)) for e in effects]
    seen = np.isfinite(sight.values)
    s0 = starts.pack(starts.fixed if start is None else start)
    z0 = np.concatenate([np.clip(first, low, high), inner, s0])
    step = np.concatenate([1e-4 * (high - low), np.maximum(2e-3 * np.abs(inner), 1e-9), 0.2 * starts.size])
    a, e = len(names), len(inner)

    def apart(z: np.ndarray) -> tuple[Scene, list[Effect], np.ndarray]:
        changed = with_adjusted(scene, dict(zip(names, np.clip(z[:a], low, high), strict=True)))
        now, at = list(effects), a
        if not fixed:
            for n, effect in enumerate(effects):
                now[n] = with_numbers(effect, z[at : at + lengths[n]])
                at += lengths[n]
        return changed, now, starts.unpack(z[a + e :], World(changed, [], setup.dt))

    def innovations(z: np.ndarray) -> np.ndarray:
        try:
            changed, now, begin = apart(z)
            predicted = look(setup, changed, now, begin, sight.t, t0)
        except (SimulationError, ZeroDivisionError, OverflowError):
            return np.full(int(seen.sum()), FAR)
        return ((sight.values - predicted) / sight.sigma)[seen]

    def jacobian(z: np.ndarray) -> np.ndarray:
        base = innovations(z)
        columns = []
        for n in range(len(z)):
            moved = z.copy()
            width = step[n] if n >= a or z[n] + step[n] < high[n] else -step[n]
            moved[n] += width
            columns.append((innovations(moved) - base) / width)
        return np.column_stack(columns)

    limits = [bounds_of(effect) for effect in effects] if e else []
    bounds = (
        np.concatenate([low, *(b[0] for b in limits), np.full(len(s0), -np.inf)]),
        np.concatenate([high, *(b[1] for b in limits), np.full(len(s0), np.inf)]),
    )
    begin = np.clip(z0, bounds[0] + 1e-12, bounds[1] - 1e-12)
    with np.errstate(all="ignore"):
        found = least_squares(
            innovations, begin, jac=jacobian, bounds=bounds, x_scale="jac", max_nfev=evaluations, ftol=1e-5, xtol=1e-8
        )
    _, now, start_found = apart(found.x)
    return Solution(
        dict(zip(names, map(float, np.clip(found.x[:a], low, high)), strict=True)), tuple(now), start_found,
        2 * float(found.cost), int(seen.sum()),
    )  # fmt: skip


def first_start(setup: Setup, scene: Scene, sight: Sight) -> np.ndarray:
    """(n, 4) a first guess of the start from the first frames of the tracks: straight lines through them."""
    start = World(scene, [], setup.dt).start()
    rows = [i for i, b in enumerate(scene.bodies) if b.mobile and b.observed]
    few = slice(0, 9)

    def line(column: np.ndarray) -> tuple[float, float]:
        good = np.isfinite(column)
        if good.sum() < 2:
            return float(np.nan_to_num(np.nanmean(column))), 0.0
        degree = 2 if good.sum() > 5 else 1
        c = np.polynomial.polynomial.polyfit(sight.t[few][good] - sight.t[0], column[good], degree)
        return float(c[0]), float(c[1])

    world = World(scene, [], setup.dt)
    for n, i in enumerate(rows):
        if setup.angles:
            angle, rate = line(sight.values[few, n])
            psi = angle + world.down
            ax, ay, length, _ = world.geometry[i]
            start[i] = [
                ax + length * math.cos(psi), ay + length * math.sin(psi),
                -length * rate * math.sin(psi), length * rate * math.cos(psi),
            ]  # fmt: skip
            continue
        (x, vx), (y, vy) = line(sight.values[few, 2 * n]), line(sight.values[few, 2 * n + 1])
        start[i] = [x, y, vx, vy]
    return start


def calibrate(setup: Setup, scene: Scene, sight: Sight) -> dict[str, float]:
    """The adjustable parameters that make the scene fit the tracks best: a function of scene and tracks alone."""
    if not scene.adjustable:
        return {}
    start = first_start(setup, scene, sight)
    still = replace(scene, adjustable=())
    for share in (0.25, 0.6):
        # an early part may not show the numbers at all: only starts are fitted on it
        start = solve(setup, still, sight.part(share), start=start, evaluations=15).start
    found = [solve(setup, scene, sight, start=start, evaluations=20)]
    for a in scene.adjustable:
        for share in (0.1, 0.35, 0.6, 0.85):
            other = with_adjusted(scene, {a.name: a.low + share * (a.high - a.low)})
            found.append(solve(setup, other, sight, start=start, evaluations=20))
    return dict(min(found, key=lambda solution: solution.chi2).adjusted)


@dataclass(frozen=True)
class Strength:
    """How strong a concealed truth is, in standard errors, and the rivals' d'.

    sigma : sqrt of the chi2 that starts and adjustables leave;  own : the same with the mechanism's own canonical
    form fitted (0 where that is the truth);  rivals : name -> d' beyond ``own``
    """

    sigma: float
    own: float
    rivals: Mapping[str, float]

    @property
    def best(self) -> tuple[str, float]:
        return min(self.rivals.items(), key=lambda item: item[1], default=("", math.inf))


def left(
    setup: Setup, scene: Scene, truth: Sight, effects: Sequence[Effect], start: np.ndarray, tries: int = 10
) -> float:
    """sqrt of the least chi2 on tracks without noise."""
    return math.sqrt(max(solve(setup, scene, truth, effects, start, evaluations=tries).chi2, 0.0))


def canonical(effect: Effect) -> Effect:
    return replace(effect, other={})
