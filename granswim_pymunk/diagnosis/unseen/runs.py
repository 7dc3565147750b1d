"""Runs of a swimmer in packed beds, kept on disk by the hash of their scene: an interrupted diagnosis goes on."""

from __future__ import annotations

import hashlib
import json
import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...engine import Simulation, advise_dt, softened
from ...errors import InputError, SimulationError
from ...packing import pack
from ...scene import Scene
from ...storage import cache_folder
from ..kept import load_array, store_array
from .conditions import Condition

SOFTER = 4.0  # contacts are softer by this in runs that only give differences; restitution stays the same
FIRST_SEED = 700_001  # of the packings of a diagnosis: unlikely to be that of a simulated recording
CODE = 2  # part of the cache's key
SLACK = 1.5  # of the advised time step: 10 steps a contact instead of 15

Change = Callable[[Scene], Scene]


@dataclass(frozen=True)
class Job:
    """One run: a condition under a change of its scene, in one packing. ``label`` names the change."""

    condition: Condition
    label: str
    change: Change
    number: int  # of the packing
    soft: bool


@dataclass
class Runner:
    """Does runs in threads, remembers them on disk, and knows how long they take.

    ``tracks`` maps (condition, label, soft) to {packing: (T, n, 2) [m]}; failures are kept as reasons.
    """

    seed: int = 0
    workers: int = 2
    deadline: float | None = None  # time.monotonic() after which nothing new begins
    tracks: dict[tuple[str, str, bool], dict[int, np.ndarray]] = field(default_factory=dict)
    failures: dict[tuple[str, str, bool], str] = field(default_factory=dict)
    runs: int = 0
    cached: int = 0
    busy: float = 0.0  # s of all threads together
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _packed: dict[tuple[str, int], Scene] = field(default_factory=dict)
    _dt: dict[tuple[str, bool], float] = field(default_factory=dict)

    @property
    def late(self) -> bool:
        return self.deadline is not None and time.monotonic() > self.deadline

    @property
    def cost(self) -> float:
        """Mean wall time of one run [s], 0 before the first."""
        return self.busy / self.runs / self.workers if self.runs else 0.0

    def steps(self, condition: Condition) -> float:
        """Steps of single bodies that a run with softer contacts takes."""
        scene = self.packed(condition, 0)
        duration = float(condition.frames[-1]) - scene.time.start
        return len(scene.bodies) * duration / self._time_step(condition, True)

    def do(self, jobs: Sequence[Job], tell: Callable[[int, int], None] = lambda done, of: None) -> None:
        """Do what is not done yet. Stops early when the time is up; Ctrl-C keeps what is finished."""
        todo = [
            j for j in jobs
            if j.number not in self.tracks.get(self._key(j), {}) and self._key(j) not in self.failures
        ]  # fmt: skip
        if not todo:
            return
        with ThreadPoolExecutor(self.workers) as pool:
            waiting: set[Future[None]] = set()
            done, queue = 0, list(todo)
            try:
                while queue or waiting:
                    while queue and len(waiting) < self.workers + 1 and not self.late:
                        waiting.add(pool.submit(self._one, queue.pop(0)))
                    if not waiting:
                        break
                    finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                    for future in finished:
                        future.result()
                        done += 1
                    tell(done, len(todo))
            except BaseException:
                for future in waiting:
                    future.cancel()
                raise

    def values(self, condition: Condition, label: str, soft: bool) -> np.ndarray | None:
        """(k, T, n, 2) tracks of all packings done, None where there are none."""
        found = self.tracks.get((condition.name, label, soft))
        return np.array([found[k] for k in sorted(found)]) if found else None

    @staticmethod
    def _key(job: Job) -> tuple[str, str, bool]:
        return job.condition.name, job.label, job.soft

    def _one(self, job: Job) -> None:
        key = self._key(job)
        try:
            packed = self.packed(job.condition, job.number)
            scene = job.change(packed)
            if job.soft:
                scene = _soft(scene)
            dt = self._time_step(job.condition, job.soft)
            scene = replace(scene, time=replace(scene.time, dt=dt))
            file = self._file(scene, job.condition)
            xy = load_array(file, (len(job.condition.frames), len(job.condition.rows), 2))
            if xy is None or not np.isfinite(xy).all():
                began = time.perf_counter()
                with np.errstate(all="ignore"):
                    xy = Simulation(scene).sample(job.condition.frames, list(job.condition.rows))
                if not np.isfinite(xy).all():
                    raise SimulationError("a position is not finite")
                store_array(file, xy)
                with self._lock:
                    self.runs += 1
                    self.busy += time.perf_counter() - began
            else:
                with self._lock:
                    self.cached += 1
            _whole(xy, scene, job.condition)
        except (SimulationError, InputError) as error:
            with self._lock:
                self.failures[key] = str(error)
            return
        with self._lock:
            self.tracks.setdefault(key, {})[job.number] = xy

    def packed(self, condition: Condition, number: int) -> Scene:
        """The naive scene of a condition in one of its packings."""
        key = (condition.name, number)
        with self._lock:
            found = self._packed.get(key)
        if found is not None:
            return found
        seed = FIRST_SEED + 1000 * self.seed + number
        scene = replace(condition.scene, seed=seed)
        if any(b.role == "grain" for b in scene.bodies):
            # the packing is known: what differs between runs is what chaos makes of the last digits
            rng = np.random.default_rng(seed)
            moved = {
                b.id: (b.initial[0] + 1e-6 * b.radius * rng.normal(), b.initial[1] + 1e-6 * b.radius * rng.normal(),
                       *b.initial[2:])
                for b in scene.bodies if b.role == "grain" and b.initial is not None
            }  # fmt: skip
            scene = scene.with_initial(moved)
        else:
            scene = pack(scene)
        with self._lock:
            self._packed[key] = scene
        return scene

    def _time_step(self, condition: Condition, soft: bool) -> float:
        key = (condition.name, soft)
        with self._lock:
            found = self._dt.get(key)
        if found is None:
            scene = self.packed(condition, 0)
            if condition.scene.time.dt is not None and not soft:
                found = condition.scene.time.dt
            else:
                found = SLACK * advise_dt(_soft(scene) if soft else scene)
            with self._lock:
                self._dt[key] = found
        return found

    @staticmethod
    def _file(scene: Scene, condition: Condition) -> Path:
        key = [CODE, scene.hash, hashlib.sha256(np.ascontiguousarray(condition.frames).tobytes()).hexdigest(),
               list(condition.rows)]  # fmt: skip
        name = hashlib.sha256(json.dumps(key).encode()).hexdigest()
        return cache_folder() / "runs" / name[:2] / f"{name}.npy"


def _whole(xy: np.ndarray, scene: Scene, condition: Condition) -> None:
    """Raise SimulationError where the swimmer came apart or left the bed: such a run says nothing."""
    radius = np.array([scene.bodies[k].radius for k in condition.rows])
    apart = np.hypot(*np.moveaxis(np.diff(xy, axis=1), -1, 0)) / (radius[1:] + radius[:-1])
    if apart.min() < 0.7 or apart.max() > 1.5:
        raise SimulationError("the swimmer came apart")
    y, edge = xy[..., 1], radius.max()
    if scene.bed is not None and (y.min() < -edge or y.max() > scene.bed.height + edge):
        raise SimulationError("the swimmer left the bed")


def _soft(scene: Scene) -> Scene:
    """The scene with softer contacts, where it has any: one lasts twice as long, still a thousandth of a stroke."""
    has = scene.laws_named("contact_linear") or scene.laws_named("contact_hertz")
    return softened(scene, SOFTER) if has else scene


def workers() -> int:
    """Threads that this process may use at once."""
    return max(1, min(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1, 8))
