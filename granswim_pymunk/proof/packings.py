"""Beds that are not seen: what of the swimmer's motion averages over packings, how strong an effect is there.

Compared are, of each recording, the mean and the first harmonic of the angles of the segments against the drive's
phase and the drift; of a curve the speeds. The noise is the spread between packings (half of its correlations kept;
of a curve the spread of a mean), changes are those of common packings. All is linear in the amounts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import SimulationError
from ..scene import Scene
from .bed_candidates import resolved
from .beds import BedSetup, packed
from .fitting import with_adjusted
from .windows import adjusted_steps, scatter
from .world import Effect, World

CURVE = (0.5, 1.1)  # s, between which a curve's speed is measured
STEP, SOFT_STEP = 4e-6, 1e-5  # s, of contacts as they are and of soft ones
START = 0.1  # s, not compared: the swimmer starts from rest


def tracks(
    setup: BedSetup, scene: Scene, effects: Sequence[Effect], t: np.ndarray, dt: float, offset: float = 0.0
) -> np.ndarray:
    """(T, k, 2) places of the swimmer's disks [m] at ``t``, from rest at t = 0 in a packed bed.

    Raises SimulationError where the run fails.
    """
    world = World(replace(scene, adjustable=()), [resolved(e, scene) for e in effects], dt)
    xy = world.sample(np.maximum(t + offset, 0.0), t0=0.0).xy[:, list(scene.swimmer)]
    if np.abs(xy).max() > 1.0:
        raise SimulationError("the swimmer left the bed")
    return xy


def angles(t: np.ndarray, xy: np.ndarray, frequency: float, phase: float) -> np.ndarray:
    """(p,) means and first harmonics of the segments' angles [rad], and the drift [m/s], of tracks (T, k, 2)."""
    keep = t >= START
    xy, t = xy[keep], t[keep]
    step = np.diff(xy, axis=1)
    turn = 2 * math.pi * frequency * t + phase
    waves = [f(h * turn) for h in (1, 2) for f in (np.cos, np.sin)]
    design = np.column_stack([np.ones_like(t), *waves])
    out = []
    for s in range(step.shape[1]):
        good = np.isfinite(step[:, s, 0])
        angle = np.unwrap(np.arctan2(step[good, s, 1], step[good, s, 0]))
        found = np.linalg.lstsq(design[good], angle, rcond=None)[0]
        found[0] -= 2 * math.pi * round(found[0] / (2 * math.pi))
        out += [*found[:3]]
    good = np.isfinite(xy[..., 0]).all(axis=1)
    middle = xy[good].mean(axis=1)
    trend = np.column_stack([design[good], t[good] - t.mean()])
    out += [float(np.linalg.lstsq(trend, middle[:, axis], rcond=None)[0][-1]) for axis in (0, 1)]
    return np.array(out)


def speed(scene: Scene, xy: np.ndarray) -> float:
    """Mean velocity of the centre of mass [m/s] between two looks (2, k, 2), positive head first (towards -x)."""
    masses = np.array([scene.bodies[i].mass for i in scene.swimmer])
    middle = np.einsum("tkc,k->tc", xy, masses / masses.sum())
    return float(-(middle[-1, 0] - middle[0, 0]) / (CURVE[1] - CURVE[0]))


def looks(setup: BedSetup) -> np.ndarray:
    """(T,) times [s] that a run is looked at."""
    return np.array(CURVE) if setup.name == "curve" else setup.t


def numbers(setup: BedSetup, scene: Scene, xy: np.ndarray) -> np.ndarray:
    """What is compared of one run (T, k, 2)."""
    if setup.name == "curve":
        return np.array([speed(scene, xy)])
    bending = scene.laws_named("bending")[0].values
    return angles(setup.t, xy, float(bending["frequency"]), float(bending["phase"]))


@dataclass
class PackingSensitivity:
    """Whitened changes of the numbers of some drives, each the mean over common packings.

    drives : which of the setup's;  seeds : of the packings of each
    """

    setup: BedSetup
    drives: Sequence[int]
    seeds: Sequence[Sequence[int]]

    def __post_init__(self) -> None:
        setup = self.setup
        self.dt = SOFT_STEP if setup.dt > STEP else STEP
        self.share = len(setup.drives) / len(self.drives)
        self.scenes = [
            [packed(setup.driven(setup.scene, d), seed) for seed in seeds]
            for d, seeds in zip(self.drives, self.seeds, strict=True)
        ]
        self.base = self._numbers({}, ())
        covariance = scatter(self.base)
        if setup.name == "curve":
            covariance = covariance / setup.runs
        self.noise = np.linalg.inv(np.linalg.cholesky(covariance))
        self.columns: dict[str, np.ndarray] = {}
        for name, step in adjusted_steps(setup).items():
            moved = self._numbers({name: float(setup.scene.parameter(name)) + step}, ())
            self.columns[name] = self._rows(moved) / step

    def _numbers(self, adjusted: Mapping[str, float], effects: Sequence[Effect], few: int | None = None) -> np.ndarray:
        """(drives, packings, p). Raises SimulationError."""
        t = looks(self.setup)
        out = []
        for scenes in self.scenes:
            row = []
            for scene in scenes[:few]:
                changed = with_adjusted(scene, adjusted)
                row.append(numbers(self.setup, changed, tracks(self.setup, changed, effects, t, self.dt)))
            out.append(row)
        return np.array(out)

    def _white(self, change: np.ndarray) -> np.ndarray:
        """Whitened changes (..., p), counted as many times as there are recordings."""
        return math.sqrt(self.share) * (change @ self.noise.T)

    def _rows(self, moved: np.ndarray) -> np.ndarray:
        """(packings, N) of numbers (drives, packings, p)."""
        white = self._white(moved - self.base[:, : moved.shape[1]])
        return np.moveaxis(white, 1, 0).reshape(moved.shape[1], -1)

    def adjustable(self, few: bool = False) -> list[np.ndarray]:
        """The columns of the adjustable numbers."""
        return list(self.columns.values())

    def change(self, effects: Sequence[Effect], few: bool = False) -> np.ndarray:
        """(packings, N) of some effects; ``few``: of two packings. Raises SimulationError."""
        return self._rows(self._numbers({}, effects, 2 if few else None))

    def calibrated(self, seen: np.ndarray) -> dict[str, float]:
        """The adjustable numbers that fit what was seen (drives, p) best, one step of least squares."""
        left = self._white(seen - self.base.mean(axis=1)).ravel()
        basis = np.array([c.mean(axis=0) for c in self.columns.values()]).T
        found = np.linalg.lstsq(basis, left, rcond=None)[0]
        result = {}
        for a, change in zip(self.setup.scene.adjustable, found, strict=True):
            result[a.name] = float(np.clip(float(self.setup.scene.parameter(a.name)) + change, a.low, a.high))
        return result
