"""Short windows through a bed with the proof's own simulator: how strong an effect is there, and a calibration.

A window starts from states estimated on the film (a parabola through five frames, overlaps pushed apart); members are
drawn from how unsure that estimate is. Compared are the swimmer's disks 8 and 16 ms on, and of the grains near the
swimmer and far from it the mean displacement and that along their motion. The noise is the members' scatter, pooled
over the windows, half of its correlations kept, with the camera's noise added. The standard errors of an effect are
the root of the chi2 of its mean change, what the adjustable numbers can imitate taken off, times (windows that the
training part holds / windows computed). All is linear in the amounts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import SimulationError
from ..scene import Scene
from . import kernels as k
from .bed_candidates import resolved
from .beds import BedSetup
from .fitting import with_adjusted
from .world import Effect, World

TRAINING = 0.6  # of the time
LOOKS = (0.008, 0.016)  # s after the start of a window
HALF = 2  # frames on each side of a start
NEAR = 3e-3  # m, gap of near grains to the swimmer
STEP = 8e-6  # s, at least: four steps in the shortest contact; changes of the mean need no more
MEMBERS = {True: 4, False: 3}  # of a small bed, of a full one
MOST = {True: 10, False: 8}  # windows computed
FEW = 2  # members where few will do
REACH = 0.012  # m from a disk's centre: what moves in a neighbourhood
RING = 0.0026  # m beyond that: grains that stand still there


def estimated(t: np.ndarray, xy: np.ndarray, frame: int, sigma: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place and velocity (n, 2) at a frame by parabolas through the frames around, and how unsure: root (n, 2, 2).

    A body seen in fewer than three of them stays where it was seen nearest, at rest.
    """
    around = slice(frame - HALF, frame + HALF + 1)
    s = t[around] - t[frame]
    design = np.column_stack([np.ones_like(s), s, s**2])
    values = xy[around]
    n = xy.shape[1]
    place, speed = np.zeros((n, 2)), np.zeros((n, 2))
    root = np.zeros((n, 2, 2))
    seen = np.isfinite(values[..., 0])
    for pattern in np.unique(seen, axis=1).T:
        mine = (seen == pattern[:, None]).all(axis=0)
        if pattern.sum() >= 3:
            a = design[pattern]
            inverse = np.linalg.inv(a.T @ a)
            found = np.einsum("ij,jnc->inc", inverse @ a.T, values[pattern][:, mine])
            place[mine], speed[mine] = found[0], found[1]
            # beyond three frames nothing tells a parabola from its noise: the third number is left out of the draw
            root[mine] = sigma * np.linalg.cholesky(inverse[:2, :2])
            continue
        for i in np.flatnonzero(mine):
            known = np.flatnonzero(np.isfinite(xy[:, i, 0]))
            place[i] = xy[known[np.argmin(np.abs(known - frame))], i]
    return place, speed, root


@dataclass
class Windows:
    """Windows of a film of a bed, ready to be predicted.

    scene : packed, with the numbers everybody knows;  t (T,), xy (T, n, 2) of all its bodies, NaN where not seen
    """

    setup: BedSetup
    scene: Scene
    t: np.ndarray
    xy: np.ndarray
    seed: int = 0
    most: int | None = None  # windows computed, at most; as MOST says where not given
    whole: bool = True  # else, in a full bed, what is near the swimmer only

    def __post_init__(self) -> None:
        bodies = self.scene.bodies
        self.members = MEMBERS[self.setup.small]
        self.chain = np.array([i for i, b in enumerate(bodies) if b.role in ("head", "tail")], dtype=np.int64)
        self.grains = np.array([i for i, b in enumerate(bodies) if b.role == "grain"], dtype=np.int64)
        self.radius = np.array([b.radius for b in bodies])
        self.walls = np.array([b.role == "wall" for b in bodies])
        self.xy = self.xy.copy()
        for i, b in enumerate(bodies):
            if b.role == "wall" and b.initial is not None:
                self.xy[:, i] = b.initial[:2]
        spacing = float(np.median(np.diff(self.t)))
        self.looks = [round(look / spacing) for look in LOOKS]
        size = HALF + self.looks[-1] + 1
        last = int(np.searchsorted(self.t, self.t[0] + TRAINING * (self.t[-1] - self.t[0]))) - self.looks[-1]
        every = np.arange(HALF, max(last, HALF + 1), size)
        self.count = len(every)
        computed = min(self.most or MOST[self.setup.small], self.count)
        few = np.unique(np.round(np.linspace(0, self.count - 1, computed)).astype(int))
        self.frames = every[few]
        self.share = self.count / len(self.frames)
        self.starts = [self._members(int(frame)) for frame in self.frames]
        self.noise: np.ndarray | None = None

    def _members(self, frame: int):
        place, speed, root = estimated(self.t, self.xy, frame, self.setup.noise)
        rng = np.random.default_rng((self.seed, frame))
        period = self.scene.periodic_x or 0.0
        kind = np.where(self.walls, k.WALL, k.FREE).astype(np.int64)
        in_chain = np.zeros(len(place), dtype=np.bool_)
        in_chain[self.chain] = True
        speed[self.walls], root[self.walls] = 0.0, 0.0
        drawn = []
        for _ in range(self.members):
            normal = rng.normal(size=(len(place), 2, 2))
            shift = np.einsum("nij,njc->nic", root, normal)
            xy = np.ascontiguousarray(place + shift[:, 0])
            k.separate(xy, kind, self.radius, in_chain, self.chain, 2 * self.radius[self.chain[0]], period, 5e-7, 400)
            drawn.append(np.column_stack([xy, speed + shift[:, 1]]))
        disks = place[self.chain]
        apart = place[self.grains][:, None] - disks[None]
        if period:
            apart[..., 0] -= period * np.round(apart[..., 0] / period)
        gap = np.hypot(apart[..., 0], apart[..., 1]).min(axis=1) - self.radius[self.grains] - self.radius[self.chain[0]]
        return place, speed, gap < NEAR, drawn

    def _numbers(self, window: int, xy: np.ndarray) -> np.ndarray:
        """(D,) what is compared of places (looks, n, 2) [m]."""
        place, speed, near, _ = self.starts[window]
        v = speed[self.grains]
        size = np.maximum(np.hypot(*v.T), 1e-12)
        out = [xy[:, self.chain].ravel()]
        for moved in xy[:, self.grains] - place[self.grains]:
            along = np.einsum("gc,gc->g", moved, v / size[:, None])
            for mine in (near, ~near):
                good = mine & np.isfinite(moved[:, 0])
                if good.sum() < 3:
                    out.append(np.zeros(3))
                    continue
                out.append(np.array([*moved[good].mean(axis=0), float(size[good] @ along[good] / size[good].sum())]))
        return np.concatenate(out)

    def seen(self) -> np.ndarray:
        """(W, D) as the film shows it."""
        return np.array([
            self._numbers(w, self.xy[[frame + look for look in self.looks]]) for w, frame in enumerate(self.frames)
        ])  # fmt: skip

    def predict(
        self, scene: Scene, effects: Sequence[Effect] = (), members: int | None = None, every: int = 1
    ) -> np.ndarray:
        """(W, m, D) of the first members, of every so many windows. Raises SimulationError."""
        acting = [resolved(e, self.scene) for e in effects]
        dt = max(STEP, self.setup.dt)
        # grains that stand still would be walls to a drag near walls
        whole = self.whole or self.setup.small or any(e.name == "wall_drag" for e in acting)
        world = World(scene, acting, dt) if whole else None
        out = []
        for w, frame in list(enumerate(self.frames))[::every]:
            times = self.t[[frame + look for look in self.looks]]
            here, rows = (world, np.arange(len(self.radius))) if world else self._neighbourhood(w, scene, acting, dt)
            row = []
            for start in self.starts[w][3][:members]:
                xy = np.full((len(times), len(self.radius), 2), np.nan)
                xy[:, rows] = here.sample(times, start[rows], t0=float(self.t[frame])).xy
                row.append(self._numbers(w, xy))
            out.append(row)
        return np.array(out)

    def _neighbourhood(self, window: int, scene: Scene, effects: Sequence[Effect], dt: float):
        """What is near the swimmer at the start of a window, in a ring of grains that stand still; and its rows."""
        place = self.starts[window][0]
        apart = place[:, None] - place[self.chain][None]
        period = scene.periodic_x or 0.0
        if period:
            apart[..., 0] -= period * np.round(apart[..., 0] / period)
        away = np.hypot(apart[..., 0], apart[..., 1]).min(axis=1)
        rows = np.flatnonzero(away < REACH + RING)
        bodies = tuple(
            scene.bodies[i] if away[i] < REACH
            else replace(scene.bodies[i], role="wall", initial=(float(place[i, 0]), float(place[i, 1]), 0.0, 0.0))
            for i in rows
        )  # fmt: skip
        present = {b.id for b in bodies}

        def left(names: tuple[str, ...] | None) -> tuple[str, ...] | None:
            return None if names is None else tuple(n for n in names if n in present)

        laws = tuple(replace(item, bodies=left(item.bodies)) for item in scene.laws)
        part = [replace(e, bodies=left(e.bodies)) for e in effects]
        return World(replace(scene, bodies=bodies, laws=laws), part, dt), rows

    def settle_noise(self) -> np.ndarray:
        """The prediction of the known scene (W, members, D), and from its scatter what whitens."""
        base = self.predict(self.scene)
        covariance = scatter(base)
        disks = 2 * len(self.chain) * len(self.looks)
        camera = np.full(len(covariance), 0.1 * self.setup.noise)
        camera[:disks] = self.setup.noise
        # a mean over some members scatters too
        covariance = (1 + 1 / self.members) * covariance + np.diag(camera**2)
        self.noise = np.linalg.inv(np.linalg.cholesky(covariance))
        return base

    def widen_noise(self) -> None:
        """The noise no smaller than what the film shows, by groups of numbers: disks and grains at each look.

        For a film without anything concealed. Members know neither what the estimate of a start does wrong on the
        whole nor how a mean over many grains errs. The whole bed is simulated for it.
        """
        assert self.noise is not None
        found = replace(self, whole=True).predict(self.scene)
        left = np.nan_to_num(self.seen() - found.mean(axis=1)) @ self.noise.T
        # the whitening is lower triangular, so a group is whitened by itself and what stands before it
        disks, looks = 2 * len(self.chain), len(self.looks)
        groups = [np.arange(k * disks, (k + 1) * disks) for k in range(looks)]
        groups += [looks * disks + 6 * k + 3 * part + np.arange(3) for k in range(looks) for part in (0, 1)]
        for group in groups:
            self.noise[group] /= max(float(np.sqrt(np.mean(left[:, group] ** 2))), 1.0)

    def white(self, change: np.ndarray) -> np.ndarray:
        """Whitened changes (..., D), counted as many times as the training part holds windows."""
        assert self.noise is not None
        return math.sqrt(self.share) * np.nan_to_num(change @ self.noise.T)


def scatter(base: np.ndarray) -> np.ndarray:
    """Covariance (D, D) of repeats (W, m, D) about their means, pooled, half of its correlations kept."""
    windows, repeats, size = base.shape
    left = (base - base.mean(axis=1, keepdims=True)).reshape(-1, size)
    covariance = left.T @ left / (windows * (repeats - 1))
    return 0.5 * covariance + 0.5 * np.diag(np.diag(covariance))


def adjusted_steps(setup: BedSetup) -> dict[str, float]:
    """A step of every adjustable number: 10 % of its value."""
    return {a.name: 0.1 * float(setup.scene.parameter(a.name)) for a in setup.scene.adjustable}


def product(a: np.ndarray, b: np.ndarray) -> float:
    """Scalar product of the mean changes behind members a (m, N) and b (k, N), from pairs of different members.

    Members share no chaos, so what chaos adds to each of them averages out, which it does not in a square.
    """
    same = min(len(a), len(b))
    pairs = len(a) * len(b) - same
    crossed = a.sum(axis=0) @ b.sum(axis=0) - np.einsum("mn,mn->", a[:same], b[:same])
    return float(crossed / max(pairs, 1))


def beyond(truth: np.ndarray, columns: Sequence[np.ndarray]) -> tuple[float, np.ndarray]:
    """Size of what of a change (m, N) the columns, each (k, N), cannot imitate; and the fitted amounts of those."""
    size = product(truth, truth)
    shown = [c for c in columns if product(c, c) > 0]
    amounts = np.zeros(len(columns))
    if shown:
        gram = np.array([[product(a, b) for b in shown] for a in shown])
        scale = np.sqrt(np.diag(gram))
        # what little noise the products have may not make a number out of two columns that are one
        inverse = np.linalg.pinv(gram / np.outer(scale, scale), rcond=0.02, hermitian=True)
        along = np.array([product(c, truth) for c in shown]) / scale
        found = inverse @ along
        size -= float(along @ found)
        amounts[[n for n, c in enumerate(columns) if product(c, c) > 0]] = found / scale
    return math.sqrt(max(size, 0.0)), amounts


@dataclass
class WindowSensitivity:
    """Whitened changes of what windows show (m, N), one row a member; those of a small step of each adjustable."""

    windows: Windows

    def __post_init__(self) -> None:
        self.base = self.windows.settle_noise()
        self.windows.widen_noise()
        self.columns: dict[str, np.ndarray] = {}
        for name, step in adjusted_steps(self.windows.setup).items():
            value = float(self.windows.scene.parameter(name))
            moved = self.windows.predict(with_adjusted(self.windows.scene, {name: value + step}))
            self.columns[name] = self._rows(moved) / step

    def _rows(self, moved: np.ndarray, every: int = 1) -> np.ndarray:
        """(m, N) of predictions (w, m, D), every so many windows."""
        change = moved - self.base[::every, : moved.shape[1]]
        white = self.windows.white(change) * math.sqrt(len(self.base) / len(change))
        return np.moveaxis(white, 1, 0).reshape(moved.shape[1], -1)

    def adjustable(self, few: bool = False) -> list[np.ndarray]:
        """The columns of the adjustable numbers."""
        if not few:
            return list(self.columns.values())
        count = self.windows.members
        shape = (count, len(self.base), -1)
        factor = math.sqrt(len(self.base) / len(self.base[::2]))
        return [factor * c.reshape(shape)[:, ::2].reshape(count, -1) for c in self.columns.values()]

    def change(self, effects: Sequence[Effect], few: bool = False) -> np.ndarray:
        """(m, N) of some effects; ``few``: of half of the windows and fewer members. Raises SimulationError."""
        every = 2 if few else 1
        moved = self.windows.predict(self.windows.scene, effects, FEW if few else None, every)
        return self._rows(moved, every)


def calibrated(setup: BedSetup, scene: Scene, t: np.ndarray, xy: np.ndarray, guess: Mapping[str, float]):
    """The adjustable numbers that predict the windows of a film best: three steps of least squares from a guess.

    A function of film, guess and scene alone.
    """
    windows = Windows(setup, scene, t, xy, most=min(MOST[setup.small], 8))
    windows.settle_noise()
    seen = windows.seen()
    here = dict(guess)
    for _ in range(3):
        now = windows.predict(with_adjusted(scene, here), members=2).mean(axis=1)
        columns = []
        for a in setup.scene.adjustable:
            step = 0.1 * here[a.name] if here[a.name] * 1.1 < a.high else -0.1 * here[a.name]
            moved = windows.predict(with_adjusted(scene, {**here, a.name: here[a.name] + step}), members=2)
            columns.append(windows.white(moved.mean(axis=1) - now).ravel() / step)
        found = np.linalg.lstsq(np.array(columns).T, windows.white(seen - now).ravel(), rcond=None)[0]
        moved_by = 0.0
        for a, change in zip(setup.scene.adjustable, found, strict=True):
            new = float(np.clip(here[a.name] + np.clip(change, -0.4 * here[a.name], 0.4 * here[a.name]), a.low, a.high))
            moved_by = max(moved_by, abs(new / here[a.name] - 1))
            here[a.name] = new
        if moved_by < 0.01:
            break
    return here


def film_of(setup: BedSetup, scene: Scene, effects: Sequence[Effect], offset: float = 0.0) -> np.ndarray:
    """(T, n, 2) true places [m] at the frames, of a run from rest at t = 0; ``offset`` of the camera's clock [s].

    Raises SimulationError where the run fails.
    """
    world = World(replace(scene, adjustable=()), [resolved(e, scene) for e in effects], setup.dt)
    run = world.sample(np.maximum(setup.t + offset, 0.0), t0=0.0)
    if np.abs(run.xy[-1]).max() > 1.0:
        raise SimulationError("a body left the bed")
    return run.xy
