"""A swimmer whose numbers are a known function of the laws in its scene, plus the spread between packings.

Stands in for the simulations of a diagnosis: what they cost is left out, all its statistics stay.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np

from granswim_pymunk.inference.packings.candidates import Candidate, candidates_of
from granswim_pymunk.inference.packings.runs import Job, Runner
from granswim_pymunk.inference.packings.summaries import Condition, View, conditions_of
from granswim_pymunk.recording import Recording
from granswim_pymunk.recording.recording import CURVE
from granswim_pymunk.validation.unseen_cases import toy_scene

T = np.arange(400) * 2e-3  # s
FREQUENCIES = (8.0, 10.0, 12.0, 14.0)  # Hz
STIFFNESS = 2e-3  # N, believed
NOISE = 2e-5  # m
NAMES = View(T, T > 0.1, 10.0, 0.0, np.ones(7)).numbers()
SPREAD = {"mean": 6e-3, "cos": 1e-2, "sin": 1e-2, "head_cos": 3e-5, "head_sin": 3e-5, "drift": 2e-3, "length": 2e-6}
SD = np.array([SPREAD[n.kind] * (0.5 + 0.3 * n.place) / (2 if n.harmonic == 3 else 1) for n in NAMES])
_RNG = np.random.default_rng(5)
_MIXED = _RNG.normal(size=(len(NAMES), len(NAMES) // 2))
_COVARIANCE = 0.6 * _MIXED @ _MIXED.T / _MIXED.shape[1] + 0.4 * np.eye(len(NAMES))
_SIZE = np.sqrt(np.diag(_COVARIANCE))
MIX = np.linalg.cholesky(_COVARIANCE / np.outer(_SIZE, _SIZE))  # of the deviations of a packing
SHARED = _RNG.normal(size=(len(NAMES), 10))  # ways in which laws change the motion: none is alone in its own


def _generator(*parts: object) -> np.random.Generator:
    return np.random.default_rng(int(hashlib.sha1(repr(parts).encode()).hexdigest()[:12], 16))


@cache
def _way(label: str, frequency: float) -> np.ndarray:
    """(p,) by a law at its first size: 40 spreads of a packing, another at another frequency."""
    rng = _generator(label)
    way = SHARED @ rng.normal(size=10) / math.sqrt(10) + 0.5 * rng.normal(size=len(NAMES))
    other = SHARED @ rng.normal(size=10) / math.sqrt(10)
    way = way / np.linalg.norm(way) + 0.1 * (frequency - 10) * other / np.linalg.norm(other)
    return 40 * SD * (MIX @ way)


def _change(label: str, amount: float, frequency: float) -> np.ndarray:
    """(p,) by a law at ``amount`` of its first size, bent."""
    return _way(label, frequency) * (amount + 0.12 * amount * abs(amount) * np.cos(np.arange(len(NAMES))))


@cache
def _usual(frequency: float) -> np.ndarray:
    """(p,) numbers of the naive scene: a wave from head to tail."""
    values = {"mean": 0.0, "head_cos": 1e-3, "head_sin": 2e-3, "length": 3e-3}
    out = []
    for n in NAMES:
        if n.kind in ("cos", "sin"):
            wave = -math.sin(0.7 * n.place) if n.kind == "cos" else math.cos(0.7 * n.place)
            out.append(0.6 * wave * (0.05 if n.harmonic == 3 else (frequency / 10) ** 0.3))
        else:
            out.append(values.get(n.kind, -0.02 if n.place == 0 else 0.0))
    return np.array(out)


def _tracks(
    numbers: np.ndarray, frequency: float, noise: float, rng: np.random.Generator, t: np.ndarray = T
) -> np.ndarray:
    """(T, 7, 2) of a swimmer that has these numbers."""
    turn = 2 * math.pi * frequency * t
    waves: dict[str, Callable[[np.ndarray], np.ndarray]] = {"cos": np.cos, "sin": np.sin}
    angle, xy, length = np.zeros((len(t), 6)), np.zeros((len(t), 7, 2)), 3e-3
    for value, n in zip(numbers, NAMES, strict=True):
        kind = n.kind.removeprefix("head_")
        if n.kind == "mean":
            angle[:, n.place] += value
        elif n.kind in waves:
            angle[:, n.place] += value * waves[kind](n.harmonic * turn)
        elif n.kind == "drift":
            xy[:, 0, n.place] += value * t
        elif n.kind == "length":
            length = value
        else:
            xy[:, 0, n.place] += value * waves[kind](n.harmonic * turn)
    step = length * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    xy[:, 1:] = xy[:, :1] + np.cumsum(step, axis=1)
    return xy + np.array([0.006, 0.008]) + noise * rng.normal(size=xy.shape)


class World(Runner):
    """Runs that cost nothing. ``shuffle``: does them in another order, as a busy machine would."""

    candidates: Mapping[str, Candidate] = {}
    shuffle: int | None = None
    saturates: float = 0.0  # of laws: their first amount does (1 - exp(-saturates))/saturates of what it would
    softer: float = 0.0  # by how much less a law changes the motion where contacts are soft
    wilder: float = 0.0  # by how much more packings spread under the first amount of a law

    def cost(self, condition: Condition, soft: bool, part: bool = False) -> float:
        return 0.2 if soft else 0.3

    def time_step(self, condition: Condition, soft: bool) -> float:
        return 1e-5

    def do(self, jobs: Sequence[Job], tell: Callable[[int, int], None] = lambda done, of: None) -> None:
        order = range(len(jobs)) if self.shuffle is None else np.random.default_rng(self.shuffle).permutation(len(jobs))
        for k in order:
            job = jobs[k]
            if self.done(job):
                continue
            rng = _generator(self.seed, job.key, job.number)
            made_of = amounts(job.label)
            found = swum(
                job.condition.frequency, made_of, rng, self.candidates, soft=job.soft, t=job.condition.frames
            )
            found[len(job.frames) :] = np.nan
            self.tracks.setdefault(job.key, {})[job.number] = found


def amounts(label: str) -> dict[str, list[float]]:
    """What the label of a run says of its scene."""
    found = {}
    for part in label.split("; "):
        if part.startswith("bending.stiffness="):
            found["stiffness"] = [float(part.partition("=")[2])]
        elif part != "naive":
            said = re.fullmatch(r"(.*)\(([^()]*)\)", part)
            assert said is not None
            found[said[1]] = [float(v) for v in said[2].split(",")]
    return found


def swum(
    frequency: float, laws: Mapping[str, Sequence[float]], rng: np.random.Generator,
    candidates: Mapping[str, Candidate], *, soft: bool = False, noise: float = 0.0, t: np.ndarray = T,
) -> np.ndarray:  # fmt: skip
    """(T, 7, 2) tracks of one packing under these laws, see ``World`` for how they act."""
    packing, wilder = SD * (MIX @ rng.normal(size=len(NAMES))), 1.0
    numbers = _usual(frequency)
    numbers = numbers + 0.05 * soft * _change("softness", 1.0, frequency)
    for label, values in laws.items():
        if label == "stiffness":
            numbers = numbers + _change(label, 3 * (values[0] / STIFFNESS - 1), frequency)
            continue
        x = candidates[label]
        for k, (value, f) in enumerate(zip(values, x.term.free, strict=True)):
            # a flow without speed is drag
            way = "linear_drag/0" if (label, k) == ("ambient_flow", 0) else f"{label}/{k}"
            amount = (value - f.neutral) / np.abs(x.design[:, k]).max()
            wilder += World.wilder * abs(amount)
            if World.saturates:
                amount = math.copysign(1 - math.exp(-World.saturates * abs(amount)), amount) / World.saturates
            amount *= 1 - World.softer * soft
            numbers = numbers + _change(way, amount, frequency)
    return _tracks(numbers + wilder * packing, frequency, noise, rng, t)


def filmed(laws: Mapping[str, Sequence[float]], seed: int, films: int = 4) -> list[Recording]:
    """Films of the swimmer under ``laws``, each at its own frequency; one film: at 10 Hz."""
    rng = np.random.default_rng(seed)
    found = []
    for k, frequency in enumerate(FREQUENCIES if films > 1 else FREQUENCIES[1:2]):
        scene = toy_scene(frequency, adjustable=True)
        xy = swum(frequency, laws, rng, world_candidates(), noise=NOISE)
        found.append(Recording(f"film-{k + 1}", scene, T, scene.ids, xy, position_noise=NOISE))
    return found[:films]


def curve_of(laws: Mapping[str, Sequence[float]], seed: int, packings: int = 6) -> Recording:
    """A curve: at each of six frequencies the mean speed in some packings, with its standard error."""
    rng = np.random.default_rng(seed)
    scene = toy_scene(10.0, adjustable=True)
    t = np.arange(0.0, 1.1 + 1e-3, 2e-3)
    masses = np.array([scene.bodies[k].mass for k in scene.chains[0]])
    rows = []
    for frequency in (7.0, 8.5, 10.0, 11.5, 13.0, 14.5):
        view = View(t, t >= 0.5 - 1e-9, frequency, 0.0, masses, curve=True)
        speeds = [float(view.observe(swum(frequency, laws, rng, world_candidates(), t=t))[0]) for _ in range(packings)]
        sem = float(np.std(speeds, ddof=1)) / math.sqrt(packings)
        rows.append((frequency, math.nan, float(np.mean(speeds)), sem, packings))
    return Recording("curve", scene, np.zeros(0), scene.ids, np.zeros((0, 7, 2)), curve=np.array(rows, dtype=CURVE))


def world_candidates() -> dict[str, Candidate]:
    """All candidates at their first amounts, by label."""
    if not World.candidates:
        scene = toy_scene(10.0, adjustable=True)
        xy = _tracks(_usual(10.0), 10.0, NOISE, np.random.default_rng(0))
        shown = Recording("one", scene, T, scene.ids, xy, position_noise=NOISE)
        World.candidates = {x.label: x for x in candidates_of(conditions_of([shown], [], 0))}
    return dict(World.candidates)
