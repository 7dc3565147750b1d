"""Runs of a swimmer in packed beds, kept on disk by the hash of their scene: an interrupted diagnosis goes on."""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from ...engine import Simulation, advise_dt, softened
from ...engine.advice import contact_duration
from ...errors import InputError, SimulationError
from ...machine import cores
from ...packing import pack
from ...scene import Scene
from ...storage import cache_folder
from ..criteria import current
from ..kept import load_array, store_array
from ..threads import ContextPool
from .summaries import Condition

CODE = "3"  # part of the cache's key

Change = Callable[[Scene], Scene]
Key = TypeVar("Key")
Value = TypeVar("Value")


class GivenUp(Exception):
    """Nobody waits for a run any more."""


@dataclass(frozen=True)
class Job:
    """One run: a condition under a change of its scene, in one packing. ``label`` names the change.

    part : the run ends with the training part: candidates that are only screened predict nothing that is held out
    """

    condition: Condition
    label: str
    change: Change
    number: int  # of the packing
    soft: bool
    part: bool = False

    @property
    def key(self) -> tuple[str, str, bool]:
        """The scene of a condition that this is a run of."""
        return self.condition.name, self.label, self.soft

    @property
    def frames(self) -> np.ndarray:
        """(k,) times [s] at which the run is looked at: all of the condition's, or those up to the held-out part."""
        every = self.condition.frames
        return every[: self.condition.learnt] if self.part else every


@dataclass
class Runner:
    """Does runs in threads and remembers them on disk.

    ``tracks`` maps (condition, label, soft) to {packing: (T, n, 2) [m]}, NaN after the end of a run of the training
    part alone. A scene of which one run fails is not used; ``failures`` has the reason.
    """

    seed: int = 0
    workers: int = 2
    tracks: dict[tuple[str, str, bool], dict[int, np.ndarray]] = field(default_factory=dict)
    failures: dict[tuple[str, str, bool], dict[int, str]] = field(default_factory=dict)
    runs: int = 0
    cached: int = 0
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _gone: threading.Event = field(default_factory=threading.Event)  # nobody waits for the runs under way
    _packed: dict[tuple[str, int], Scene] = field(default_factory=dict)
    _dt: dict[tuple[str, bool], float] = field(default_factory=dict)
    _softness: dict[str, float] = field(default_factory=dict)

    def cost(self, condition: Condition, soft: bool, part: bool = False) -> float:
        """Seconds of a run on one core, about: told from its size, so that plans repeat; ``part``: see ``Job``."""
        scene = self.packed(condition, 0)
        duration = float(condition.frames[condition.learnt - 1 if part else -1]) - scene.time.start
        work = current().work
        return work.start_up + work.body_step * len(scene.bodies) * duration / self.time_step(condition, soft)

    def do(self, jobs: Sequence[Job], tell: Callable[[int, int], None] = lambda done, of: None) -> None:
        """Do what is not done yet. Ctrl-C keeps what is finished, and ends the runs under way."""
        self._gone.clear()
        # longer ones last: of a run that is asked for twice they stay
        wanted = sorted((j for j in jobs if not self.done(j)), key=lambda j: not j.part)
        todo = {(*j.key, j.number): j for j in wanted}
        if not todo:
            return
        with ContextPool(self.workers) as pool:
            waiting: set[Future[None]] = set()
            done, queue = 0, list(todo.values())[::-1]
            try:
                while queue or waiting:
                    while queue and len(waiting) < self.workers + 1:
                        waiting.add(pool.submit(self._one, queue.pop()))
                    finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                    for future in finished:
                        future.result()
                        done += 1
                    tell(done, len(todo))
            except BaseException:
                self._gone.set()
                for future in waiting:
                    future.cancel()
                raise

    def reason(self, label: str, soft: bool = True) -> str:
        """Why runs of a scene failed, the first reason by recording and packing; empty where none did."""
        found = sorted((key[0], *k) for key, why in self.failures.items() if key[1:] == (label, soft)
                       for k in why.items())  # fmt: skip
        return found[0][2] if found else ""

    def values(self, condition: Condition, label: str, soft: bool) -> np.ndarray | None:
        """(k, T, n, 2) tracks of all packings done, None where there are none."""
        found = self.tracks.get((condition.name, label, soft))
        return np.array([found[k] for k in sorted(found)]) if found else None

    def done(self, job: Job) -> bool:
        """Whether a run, at least as long, is there or failed."""
        if job.number in self.failures.get(job.key, {}):
            return True
        found = self.tracks.get(job.key, {}).get(job.number)
        return found is not None and (job.part or bool(np.isfinite(found[-1]).all()))

    def _one(self, job: Job) -> None:
        frames = job.frames
        try:
            scene = job.change(self.packed(job.condition, job.number))
            if job.soft:
                scene = _soft(scene, self.softness(job.condition))
            scene = replace(scene, time=replace(scene.time, dt=self.time_step(job.condition, job.soft)))
            file = self._file(scene, frames, job.condition.rows)
            xy = load_array(file, (len(frames), len(job.condition.rows), 2))
            new = xy is None or not np.isfinite(xy).all()
            if new:
                xy = self._sampled(scene, frames, list(job.condition.rows))
                if not np.isfinite(xy).all():
                    raise SimulationError("a position is not finite")
                store_array(file, xy)
            assert xy is not None
            _whole(xy, scene, job.condition)
            later = len(job.condition.frames) - len(frames)
            if later:
                xy = np.concatenate([xy, np.full((later, *xy.shape[1:]), np.nan)])
        except (SimulationError, InputError) as error:
            with self._lock:
                self.failures.setdefault(job.key, {})[job.number] = str(error)
            return
        with self._lock:
            self.runs += new
            self.cached += not new
            self.tracks.setdefault(job.key, {})[job.number] = xy

    def _sampled(self, scene: Scene, frames: np.ndarray, rows: list[int]) -> np.ndarray:
        """(T, n, 2) [m] of a run, looked at now and then whether anybody still waits for it. Raises GivenUp."""
        simulation, found = Simulation(scene), list[np.ndarray]()
        for part in np.array_split(frames, min(current().packings.runs.parts, len(frames))):
            if self._gone.is_set():
                raise GivenUp
            with np.errstate(all="ignore"):
                found.append(simulation.sample(part, rows))
        return np.concatenate(found)

    def packed(self, condition: Condition, number: int) -> Scene:
        """The naive scene of a condition in one of its packings."""
        return self._once(self._packed, (condition.name, number), lambda: self._pack(condition, number))

    def _pack(self, condition: Condition, number: int) -> Scene:
        seed = current().packings.runs.first_seed + 1000 * self.seed + number
        scene = replace(condition.scene, seed=seed)
        if not any(b.role == "grain" for b in scene.bodies):
            return pack(scene)
        # the packing is known: what differs between runs is what chaos makes of the last digits
        rng = np.random.default_rng(seed)
        moved = {
            b.id: (b.initial[0] + 1e-6 * b.radius * rng.normal(), b.initial[1] + 1e-6 * b.radius * rng.normal(),
                   *b.initial[2:])
            for b in scene.bodies if b.role == "grain" and b.initial is not None
        }  # fmt: skip
        return scene.with_initial(moved)

    def time_step(self, condition: Condition, soft: bool) -> float:
        """Step [s] of all runs of a condition."""
        given = None if soft else condition.scene.time.dt
        return self._once(
            self._dt, (condition.name, soft), lambda: given or time_step(self.packed(condition, 0), soft)
        )  # fmt: skip

    def softness(self, condition: Condition) -> float:
        """Times by which contacts are softer in all runs of a condition that only give differences."""
        return self._once(self._softness, condition.name, lambda: softness(self.packed(condition, 0)))

    def _once(self, kept: dict[Key, Value], key: Key, make: Callable[[], Value]) -> Value:
        """What is kept under a key, made where it is not there yet; threads may make it side by side, all alike."""
        with self._lock:
            found = kept.get(key)
        if found is None:
            found = make()
            with self._lock:
                kept[key] = found
        return found

    @staticmethod
    def _file(scene: Scene, frames: np.ndarray, rows: Sequence[int]) -> Path:
        key = [CODE, scene.hash, hashlib.sha256(np.ascontiguousarray(frames).tobytes()).hexdigest(), list(rows)]
        name = hashlib.sha256(json.dumps(key).encode()).hexdigest()
        return cache_folder() / "runs" / name[:2] / f"{name}.npy"


def _whole(xy: np.ndarray, scene: Scene, condition: Condition) -> None:
    """Raise SimulationError where the swimmer came apart or left the bed: such a run says nothing."""
    radius = np.array([scene.bodies[k].radius for k in condition.rows])
    apart = np.hypot(*np.moveaxis(np.diff(xy, axis=1), -1, 0)) / (radius[1:] + radius[:-1])
    least, most = current().packings.runs.apart
    if apart.min() < least or apart.max() > most:
        raise SimulationError("the swimmer came apart")
    y, edge = xy[..., 1], radius.max()
    if scene.bed is not None and (y.min() < -edge or y.max() > scene.bed.height + edge):
        raise SimulationError("the swimmer left the bed")


def softness(scene: Scene) -> float:
    """How much softer contacts may be where runs only give differences: short beside a stroke, see ``RunCriteria``."""
    criteria = current().packings.runs
    duration = contact_duration(scene)
    if duration is None:
        return 1.0
    frequency = float(scene.laws_as("stroke")[0].values["frequency"])
    factor = float(min(max((1 / (criteria.stroke * frequency) / duration) ** 2, 1.0), criteria.softer))
    worth = factor > 1 and _coarse(softened(scene, factor)) > criteria.cheaper * _coarse(scene)
    return factor if worth else 1.0


def _soft(scene: Scene, factor: float) -> Scene:
    return softened(scene, factor) if factor > 1 else scene


def time_step(scene: Scene, soft: bool) -> float:
    """Step [s] of a run whose numbers are compared with a spread between packings of some per cent."""
    if not soft:
        return current().packings.runs.own * advise_dt(scene)
    return _coarse(_soft(scene, softness(scene)))


def _coarse(scene: Scene) -> float:
    """Step [s] that contacts of a run that gives differences allow, and all other laws."""
    criteria, contact = current().packings.runs, contact_duration(scene)
    others = replace(scene, laws=tuple(u for u in scene.laws if u.law.role != "contact" or u.law.kind != "pair"))
    return min(criteria.coarser * advise_dt(others), contact / criteria.per_contact if contact is not None else 1e-3)


def workers() -> int:
    """Threads that this process may use at once."""
    return min(cores(), 8)
