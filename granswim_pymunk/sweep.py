"""Sweeps: many runs over the values of some parameters, one file a run, collected into labelled arrays.

A sweep is a function that builds a scene from named values, the values, and a function that measures a scene::

    def build(frequency, seed):
        scene = read_scene("swim.toml").with_parameter("bending.frequency", frequency)
        return replace(scene, seed=seed)

    table = sweep(build, {"frequency": [4.0, 9.0, 15.0], "seed": range(8)}, observe, "out/sweep")
    table["speed"].mean("seed")            # an xarray.DataArray over frequency

Each run is a netCDF file named by the hash of its scene and of how it is measured. Runs that are there
already are not run again, so a sweep that was stopped goes on where it was, and a larger one reuses a
smaller one. A run that fails leaves its reason in the table.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import io
import itertools
import json
import math
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from tqdm import tqdm

from .errors import InputError
from .files import writing, written_whole
from .fingerprint import fingerprint
from .laws import all_laws
from .limits import MOST_RUNS, MOST_STATES, MOST_STEPS, check_seed
from .machine import cores
from .scene import Scene

Watch = Callable[[float], None]
Build = Callable[..., Scene]
Measure = Callable[..., xr.Dataset]
MISSING = "not run"


@dataclass(frozen=True)
class Job:
    """One run: the values it is built from, the hash of scene and measurement, its file."""

    point: Mapping[str, Any]
    key: str
    file: Path

    @property
    def done(self) -> bool:
        return self.file.exists()


# ---- the jobs ---------------------------------------------------------------------------------


def varied(scene: Scene, **values: Any) -> Scene:
    """The scene with ``seed``, a field of its bed (``bed.height``) or ``LAW.PARAMETER`` replaced by each value.

    Dots in names may be written as two underscores, where a keyword is wanted. Raises InputError naming what
    the scene does not have.
    """
    for name, value in values.items():
        name = name.replace("__", ".")
        head, _, tail = name.partition(".")
        if name == "seed":
            scene = replace(scene, seed=check_seed(value))
        elif head == "bed":
            if scene.bed is None or tail not in ("height", "packing_fraction", "density", "layers"):
                raise InputError("the scene has no such field of a bed", where=f"vary {name}")
            changed: dict[str, Any] = {tail: float(value)}
            scene = replace(scene, bed=replace(scene.bed, **changed))
        elif tail:
            scene = scene.with_parameter(name, value)
        else:
            raise InputError("should be seed, bed.FIELD or LAW.PARAMETER", where=f"vary {name}")
    return scene


def build_from(scene: Scene) -> Build:
    """A function of named values for ``sweep``, from a scene: names as ``varied`` takes them."""
    return functools.partial(varied, scene)


def grid(axes: Mapping[str, Iterable[Any]]) -> list[dict[str, Any]]:
    """Every combination of the axes' values; the last axis runs fastest."""
    return [dict(zip(axes, values, strict=True)) for values in itertools.product(*map(list, axes.values()))]


def make_jobs(build: Build, points: Iterable[Mapping[str, Any]], measure: Measure, folder: str | Path) -> list[Job]:
    """Jobs of these points, without running anything. Raises what ``build`` raises on values that cannot be."""
    folder = Path(folder)
    how = _describe(measure)
    jobs = []
    for point in points:
        key = hashlib.sha256(f"{build(**point).hash} {how}".encode()).hexdigest()[:24]
        jobs.append(Job(dict(point), key, folder / f"{key}.nc"))
    return jobs


def _describe(measure: Measure) -> str:
    """A measurement's name, its module's VERSION, the settings it was given; of a script's own, what it does."""
    settings: list[Any] = []
    inner: Any = measure
    while isinstance(inner, functools.partial):
        settings.append((inner.args, dict(inner.keywords)))
        inner = inner.func
    module = str(getattr(inner, "__module__", ""))
    version = getattr(inspect.getmodule(inner), "VERSION", 0)
    name = f"{module} {getattr(inner, '__qualname__', type(inner).__qualname__)}"
    own = "" if module.startswith("granswim_pymunk.") else fingerprint(inner)
    return " ".join([name, str(version), fingerprint(settings), own])


def run_job(build: Build, measure: Measure, point: Mapping[str, Any], file: Path, watch: Watch | None = None) -> str:
    """Run one job and write its file; returns the reason of a failure, empty where there was none.

    A failure that comes from the machine (a full disk, no memory, a module that is not there) is not written: the
    next sweep tries again. Raises InputError where a run that came to its end cannot be written.
    """
    reason = ""
    began = time.perf_counter()
    try:
        if watch is not None and "watch" in inspect.signature(measure).parameters:
            result = measure(build(**point), watch=watch)
        else:
            result = measure(build(**point))
    except Exception as error:  # any failure is a row of the table, not the end of the sweep
        reason = f"{type(error).__name__}: {error}"
        if isinstance(error, OSError | MemoryError | ImportError | SystemError):
            return reason
        result = xr.Dataset()
    result.attrs |= {
        "point": json.dumps(dict(point), default=float),
        "reason": reason,
        "wall_time_s": round(time.perf_counter() - began, 3),
    }
    write_dataset(result, file)
    return reason


def _run_packed(packed: bytes, point: Mapping[str, Any], file: Path) -> str:
    """``run_job`` in another process."""
    *declared, work = pickle.loads(packed)
    for law in declared:
        pickle.loads(law)  # receiving it registers it
    build, measure = pickle.loads(work)
    return run_job(build, measure, point, file)


def _pack(build: Build, measure: Measure) -> bytes:
    """Both as they go to another process; what stands in a script or a shell goes as a whole.

    With them go the laws that do not come with the package: a scene may call them by their names.
    Raises InputError where something in them cannot leave this process.
    """
    from numba import cloudpickle  # type: ignore[attr-defined]

    declared = []
    for law in all_laws().values():
        if not law.shipped:
            with suppress(Exception):  # one that this work may not need at all
                declared.append(cloudpickle.dumps(law))
    try:
        return pickle.dumps([*declared, cloudpickle.dumps((build, measure))])
    except Exception as error:  # pickling calls anybody's code
        raise InputError(
            f"cannot be sent to other processes: {type(error).__name__}: {error}; use one process",
            where=f"{getattr(build, '__name__', 'build')}, {getattr(measure, '__name__', 'measure')}",
        ) from None


def write_dataset(data: xr.Dataset, file: str | Path) -> None:
    """netCDF, written beside and renamed: a reader never sees half of it. Raises InputError.

    It is put together in memory: HDF5 that meets a full disk leaves a broken file, and may end the program.
    """
    file = Path(file)
    small = {name: {"zlib": True} for name, v in data.data_vars.items() if v.ndim and v.dtype.kind in "fi"}
    whole = io.BytesIO()
    with _not_distributed():
        data.to_netcdf(whole, engine="h5netcdf", encoding=small)
    with writing(file):
        file.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(file) as stream:
            stream.write(whole.getbuffer())


def _not_distributed() -> AbstractContextManager[Any]:
    """On a worker of a cluster xarray would lock the file by a name that all know; what lies in memory has none."""
    if "dask" not in sys.modules:
        return nullcontext()
    import dask

    return dask.config.set(scheduler="synchronous")


def read_dataset(file: str | Path) -> xr.Dataset:
    """A netCDF file, all of it in memory. Raises InputError where it is not one."""
    try:
        with xr.open_dataset(file, engine="h5netcdf") as data:
            return data.load()
    except FileNotFoundError:
        raise InputError("no such file", file=file) from None
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"is not netCDF that can be read: {error}", file=file) from None


# ---- a measurement for any scene --------------------------------------------------------------

VERSION = 1  # of ``observe``


def observe(
    scene: Scene,
    duration: float | None = None,
    settle: float = 0.0,
    every: float = 1e-3,
    watch: Watch | None = None,
) -> xr.Dataset:
    """Run any scene and keep numbers that most scenes have (SI).

    duration [s] (left out: the scene's), settle [s] left out of the means, every [s] between samples.
    ``kinetic_energy`` : mean of all bodies;  ``xy``, ``v`` (time, body, axis) of bodies that are neither grain
    nor wall;  ``coordination``, ``anisotropy`` of the contacts between mobile bodies, at ten times;
    ``speed``, ``speed_error`` : of a swimmer with a bending law, head first, where two cycles were run.
    Raises InputError, SimulationError.
    """
    from .analysis.contacts import ContactFinder
    from .analysis.network import contact_network
    from .analysis.speed import swimming_speed
    from .engine import Simulation
    from .packing import pack

    duration = duration if duration is not None else scene.time.duration
    if duration is None or not duration > 0:
        raise InputError("needs a duration above zero [s]", where="time.duration")
    if not 0 <= settle < duration:
        raise InputError(f"settle should lie between 0 and the duration {duration:g} s", where="settle")
    scene = pack(scene)
    sim = Simulation(scene)
    mass = np.array([b.mass if b.mobile else 0.0 for b in scene.bodies])
    radius = np.array([b.radius for b in scene.bodies])
    mobile = np.flatnonzero(mass)
    kept = [k for k, b in enumerate(scene.bodies) if b.role not in ("grain", "wall")]
    pairs = any(item.law.kind == "pair" for item in scene.laws)
    if not duration / sim.dt <= MOST_STEPS:
        raise InputError(f"a duration of {duration:g} s is more than {MOST_STEPS:g} steps of {sim.dt:.3g} s")
    stride = max(round(every / sim.dt), 1)
    samples = max(round(duration / (stride * sim.dt)), 1)
    finder = ContactFinder(scene)
    t, energy = np.zeros(samples + 1), np.zeros(samples + 1)
    xy, v = np.zeros((samples + 1, len(kept), 2)), np.zeros((samples + 1, len(kept), 2))
    networks = []
    for k in range(samples + 1):
        sim.advance(stride if k else 0)
        state = sim.state()
        t[k], xy[k], v[k] = state.t, state.xy[kept], state.v[kept]
        energy[k] = 0.5 * float((mass * (state.v**2).sum(axis=1)).sum())
        if pairs and state.t - t[0] >= settle and (samples - k) % max(samples // 10, 1) == 0:
            found = finder(state.xy, state.v, state.t)
            branch = found.normal * (radius[found.i] + radius[found.j] - found.overlap)[:, None]
            networks.append(contact_network(found.i, found.j, branch, mobile))
        if watch is not None:
            watch(k / samples)
    after = t - t[0] >= settle
    data: dict[str, Any] = {
        "kinetic_energy": float(energy[after].mean()),
        "xy": (("time", "body", "axis"), xy),
        "v": (("time", "body", "axis"), v),
    }
    if networks:
        data["coordination"] = float(np.mean([n.coordination for n in networks]))
        data["anisotropy"] = float(np.mean([n.anisotropy for n in networks]))
    drives = [item for item in scene.laws_named("bending") if item.values["frequency"] > 0]
    if len(scene.chains) == 1 and drives:
        frequency = float(drives[0].values["frequency"])
        if (duration - settle) * frequency >= 2:
            rows = [kept.index(k) for k in scene.chains[0]]
            speed = swimming_speed(t, xy[:, rows], mass[list(scene.chains[0])], frequency, settle)
            data |= {"speed": speed.value, "speed_error": speed.error}
    names = [scene.bodies[k].id for k in kept]
    result = xr.Dataset(data, coords={"time": t, "axis": ["x", "y"], "body": names})
    result.attrs |= {"dt": sim.dt, "steps": sim.step, "mode": sim.mode, "scene_hash": scene.identity}
    return result


# ---- running them -----------------------------------------------------------------------------


def _as_a_worker() -> None:
    # a worker that is interrupted just goes: its file is written at the end, or not at all
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # so it does where the main process was killed, which has no time to say so
    threading.Thread(target=_end_with, args=(multiprocessing.parent_process(),), daemon=True).start()


def _end_with(main: BaseProcess | None) -> None:
    if main is not None:
        main.join()
        os._exit(1)


@contextmanager
def _script_hidden() -> Iterator[None]:
    """Processes that are started meanwhile do not run the script again, which may come from the standard input."""
    main = sys.modules["__main__"]
    kept: dict[str, Any] = {name: vars(main)[name] for name in ("__file__", "__spec__") if name in vars(main)}
    try:
        vars(main).pop("__file__", None)
        main.__spec__ = None
        yield
    finally:
        vars(main).update(kept)


class _FreshProcess(SpawnProcess):
    """A new process that knows nothing of the script: what it needs of it is sent to it as a whole."""

    def start(self) -> None:
        with _script_hidden():
            super().start()


class _Fresh(SpawnContext):
    Process = _FreshProcess  # type: ignore[assignment,misc]


def pool(processes: int) -> ProcessPoolExecutor:
    """A pool of fresh processes: nothing in them but what is sent."""
    return ProcessPoolExecutor(processes, _Fresh(), _as_a_worker)


@contextmanager
def dask_executor(address: str, processes: int | None = None) -> Iterator[Executor]:
    """A Dask cluster as an executor: its scheduler's address, or "local" for one on this machine.

    Raises InputError where Dask is not installed or the scheduler does not answer.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise InputError("Dask is not installed: pip install 'granswim_pymunk[cluster]'") from None
    cluster = None
    try:
        if address == "local":
            with _script_hidden():
                cluster = LocalCluster(
                    n_workers=processes or cores(), threads_per_worker=1, dashboard_address=None
                )
        # not the default client: xarray would take its locks from a cluster that is gone afterwards
        client = Client(cluster if cluster is not None else address, timeout="10s", set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers: {error}", where=f"--dask {address}") from None
    try:
        with client.get_executor() as executor:
            yield executor
    finally:
        client.close()
        if cluster is not None:
            cluster.close()


def run_jobs(
    jobs: Sequence[Job],
    build: Build,
    measure: Measure,
    *,
    executor: Executor | None = None,
    processes: int | None = None,
    dask: str | None = None,
    retry_failed: bool = False,
    quiet: bool = False,
) -> dict[Path, str]:
    """Run what is not there yet, in the order given.

    executor : any ``concurrent.futures`` executor; left out, ``dask`` (an address or "local"), else that
        many local ``processes`` (default: one a core; 1: in this process)
    retry_failed : run jobs again that failed before

    Shows progress with the time left. On Ctrl-C the runs that are complete stay. A worker process that dies
    costs its own run a second try, then that run's reason says so.

    Returns the reasons of runs that came to nothing and are not stored, by their files: they will be tried again.
    """
    waiting: dict[Path, Job] = {}
    for job in jobs:
        again = retry_failed and job.done and read_dataset(job.file).attrs.get("reason")
        if not job.done or again:
            waiting.setdefault(job.file, job)
    if not waiting:
        return {}
    todo = list(waiting.values())
    form = "{desc}: {percentage:3.0f}%|{bar}| {n:.2f}/{total_fmt} runs [{elapsed}<{remaining}{postfix}]"
    with tqdm(total=len(todo), desc="sweep", disable=quiet or None, bar_format=form, dynamic_ncols=True) as bar:
        work = _Work(bar)
        count = min(processes or cores(), len(todo))
        if executor is not None:
            work.submit(todo, executor, functools.partial(run_job, build, measure))
        elif dask is not None:
            packed = _pack(build, measure)
            with dask_executor(dask, processes) as cluster:
                work.submit(todo, cluster, functools.partial(_run_packed, packed))
        elif count == 1:
            work.one_by_one(todo, build, measure)
        else:
            work.own_pool(todo, functools.partial(_run_packed, _pack(build, measure)), count)
    return work.unstored


class _Work:
    """Jobs being run: how many failed, and why those that left no file did."""

    def __init__(self, bar: Any) -> None:
        self.bar = bar
        self.failed = 0
        self.unstored: dict[Path, str] = {}

    def note(self, job: Job, reason: str) -> None:
        if reason:
            self.failed += 1
            self.bar.set_postfix_str(f", {self.failed} failed")
            if not job.done:
                self.unstored[job.file] = reason

    def one_by_one(self, jobs: list[Job], build: Build, measure: Measure) -> None:
        for number, job in enumerate(jobs):

            def watch(part: float, number: int = number) -> None:
                self.bar.update(number + min(part, 1.0) - self.bar.n)

            self.note(job, run_job(build, measure, job.point, job.file, watch))
            self.bar.update(number + 1 - self.bar.n)

    def submit(self, jobs: list[Job], executor: Executor, run: Callable[..., str]) -> list[Job]:
        """Run jobs on an executor; returns those that were lost because a worker died."""
        futures: dict[Future[str], Job] = {}
        lost: list[Job] = []
        try:
            for job in jobs:
                futures[executor.submit(run, dict(job.point), job.file)] = job
            left = set(futures)
            while left:
                done, left = wait(left, return_when=FIRST_COMPLETED)
                for future in done:
                    job = futures[future]
                    try:
                        self.note(job, future.result())
                    except BrokenExecutor:
                        lost.append(job)
                        continue
                    except InputError:  # a run that came to its end cannot be written: no other one could
                        raise
                    except Exception as error:  # lost on its way to or from a worker
                        self.note(job, f"{type(error).__name__}: {error}")
                    self.bar.update(1)
        except BrokenExecutor:
            lost += [job for job in jobs if job not in futures.values() or job in lost]
        except BaseException:
            for future in futures:
                future.cancel()
            raise
        return [job for job in jobs if job in lost and not job.done]

    def own_pool(self, jobs: list[Job], run: Callable[..., str], processes: int) -> None:
        workers = pool(processes)
        try:
            lost = self.submit(jobs, workers, run)
        except BaseException:
            workers.shutdown(wait=False, cancel_futures=True)
            raise
        workers.shutdown()
        # one of these killed its worker and took the others along: each gets a process of its own
        for job in lost:
            alone = pool(1)
            if self.submit([job], alone, run):
                _write_reason(job, "the worker process died")
                self.bar.update(1)
            alone.shutdown()


def _write_reason(job: Job, reason: str) -> None:
    attrs = {"point": json.dumps(dict(job.point), default=float), "reason": reason, "wall_time_s": 0.0}
    write_dataset(xr.Dataset(attrs=attrs), job.file)


# ---- the table --------------------------------------------------------------------------------


def collect(
    jobs: Sequence[Job],
    axes: Mapping[str, Iterable[Any]],
    reduce: Callable[[xr.Dataset], xr.Dataset] | None = None,
    unstored: Mapping[Path, str] | None = None,
) -> xr.Dataset:
    """The runs as labelled arrays over ``axes``.

    reduce : what to keep of a run; left out, its values without a dimension
    unstored : reasons of runs that left no file, as ``run_jobs`` returns them
    Variables that a run lacks are NaN there. ``reason`` (over the axes) is empty where a run succeeded.
    """
    values = {name: list(v) for name, v in axes.items()}
    shape = tuple(map(len, values.values()))
    place = {tuple(point.values()): at for at, point in zip(np.ndindex(shape), grid(values), strict=True)}
    reason = np.full(shape, MISSING, dtype=object)
    wall = np.full(shape, np.nan)
    found: dict[str, tuple[tuple[str, ...], np.ndarray]] = {}
    coords: dict[str, Any] = dict(values)
    for job in jobs:
        at = place.get(tuple(job.point[name] for name in values))
        if at is None:
            continue
        if not job.done:
            reason[at] = (unstored or {}).get(job.file, MISSING)
            continue
        run = read_dataset(job.file)
        reason[at], wall[at] = run.attrs.get("reason", ""), run.attrs.get("wall_time_s", np.nan)
        if reason[at]:
            continue
        run = reduce(run) if reduce is not None else run
        for key, variable in run.data_vars.items():
            name = str(key)
            if reduce is None and variable.ndim:
                continue
            if name not in found:
                found[name] = (tuple(map(str, variable.dims)), np.full((*shape, *variable.shape), np.nan))
                coords |= {str(d): run[d].values for d in variable.dims if d in run.coords}
            if found[name][1].shape[len(shape) :] == variable.shape:
                found[name][1][at] = variable.values
    data = {name: ((*values, *dims), array) for name, (dims, array) in found.items()}
    table = xr.Dataset(data, coords=coords)
    table["reason"] = (tuple(values), reason.astype(str))
    table["wall_time"] = (tuple(values), wall)
    return table


def sweep(
    build: Build | Scene,
    axes: Mapping[str, Iterable[Any]],
    measure: Measure,
    folder: str | Path,
    *,
    reduce: Callable[[xr.Dataset], xr.Dataset] | None = None,
    executor: Executor | None = None,
    processes: int | None = None,
    dask: str | None = None,
    retry_failed: bool = False,
    quiet: bool = False,
) -> xr.Dataset:
    """Run every combination of the axes' values and return the table; the arguments of ``run_jobs`` and ``collect``.

    build : function of the axes' names, or a Scene with axes named as ``varied`` takes them
    Raises InputError before anything is run where a combination cannot be built.
    """
    if isinstance(build, Scene):
        build = build_from(build)
    values = {name: list(v) for name, v in axes.items()}
    for name, items in values.items():
        if not items or len(set(items)) != len(items):
            raise InputError("needs values, each once", where=f"axis {name}")
    if math.prod(map(len, values.values())) > MOST_RUNS:
        raise InputError(f"would be more than {MOST_RUNS:g} runs", where="axes")
    jobs = make_jobs(build, grid(values), measure, folder)
    unstored = run_jobs(
        jobs, build, measure, executor=executor, processes=processes, dask=dask, retry_failed=retry_failed,
        quiet=quiet,
    )  # fmt: skip
    return collect(jobs, values, reduce, unstored)


# ---- the command ------------------------------------------------------------------------------


def parse_axis(text: str) -> tuple[str, list[Any]]:
    """``NAME=4,9,15``, ``NAME=1:8`` or ``NAME=2:20:2`` (both ends included). Raises InputError."""
    name, equals, values = text.partition("=")
    name = name.strip()
    where = f"--vary {text}"
    if not equals or not name or not values.strip():
        raise InputError("should be NAME=VALUES", where=where)
    found: list[Any] = []
    for item in values.split(","):
        parts = item.strip().split(":")
        try:
            numbers = [float(part) for part in parts]
        except ValueError:
            if len(parts) > 1:
                raise InputError(f"{item!r} is not first:last or first:last:step", where=where) from None
            found.append(item.strip())  # a choice, as in bending.form=leader,elastic
            continue
        if not np.isfinite(numbers).all():
            raise InputError(f"{item!r} is not finite", where=where)
        if len(numbers) == 1:
            found.append(numbers[0])
            continue
        step = numbers[2] if len(numbers) == 3 else 1.0
        if len(numbers) > 3 or step <= 0 or numbers[1] < numbers[0]:
            raise InputError(f"{item!r} is not first:last or first:last:step with first <= last", where=where)
        count = int(np.floor((numbers[1] - numbers[0]) / step + 1e-9)) + 1
        if count > 100_000:
            raise InputError(f"{item!r} has {count} values", where=where)
        found += [numbers[0] + k * step for k in range(count)]
    if name == "seed":
        found = [int(v) if isinstance(v, float) and v.is_integer() else v for v in found]
    if any(isinstance(v, str) for v in found) and (name == "seed" or not all(isinstance(v, str) for v in found)):
        raise InputError("some values are numbers, some are not", where=where)
    return name, found


def scene_sweep(
    scene: Scene,
    axes: Mapping[str, Sequence[Any]],
    out: str | Path,
    *,
    duration: float | None = None,
    settle: float = 0.0,
    every: float = 1e-3,
    **how: Any,
) -> xr.Dataset:
    """``sweep`` of a scene with ``observe``; writes OUT/table.nc and returns it. ``how``: as ``run_jobs``."""
    duration = duration if duration is not None else scene.time.duration
    if duration is None or not duration > 0:
        raise InputError("needs a duration above zero [s]: in the scene's [time], or as --duration")
    if not 0 <= settle < duration or not every > 0:
        raise InputError(f"settle should lie between 0 and the duration {duration:g} s, every above 0")
    if not duration / every <= MOST_STATES:
        raise InputError(f"{duration / every:.2g} samples of a run; at most {MOST_STATES:g} can be kept")
    measure = functools.partial(observe, duration=duration, settle=settle, every=every)
    table = sweep(scene, axes, measure, Path(out) / "runs", **how)
    table.attrs |= {"scene": scene.to_toml() if len(scene.bodies) < 100 else scene.title, "scene_hash": scene.identity}
    write_dataset(table, Path(out) / "table.nc")
    return table


def summary_lines(table: xr.Dataset) -> list[str]:
    """The table in words: a line for each combination, averaged over seeds with its 95 % error; failures."""
    from .analysis.speed import mean_error

    axes = list(table["reason"].dims)
    shown = [str(a) for a in axes if a != "seed"]
    numbers = [str(n) for n, v in table.data_vars.items() if v.dtype.kind == "f" and set(v.dims) == set(axes)]
    numbers = [n for n in numbers if n != "wall_time"]
    lines = ["  ".join([*(f"{a:>20s}" for a in shown), *(f"{n:>24s}" for n in numbers)])]
    for at in np.ndindex(tuple(table.sizes[a] for a in shown)):
        here = table.isel(dict(zip(shown, at, strict=True)))
        cells = [f"{here[a].values.item()!s:>20.20s}" for a in shown]
        for name in numbers:
            values = np.atleast_1d(here[name].values)
            mean, error = mean_error(values)
            cells.append(f"{mean:>12.4g}" + (f" +- {error:<8.2g}" if np.isfinite(error) else " " * 12))
        lines.append("  ".join(cells))
    reasons = table["reason"].values
    for at in zip(*np.nonzero(reasons != ""), strict=True):
        where = ", ".join(f"{a} = {table[a].values[k]!s}" for a, k in zip(axes, at, strict=True))
        lines.append(f"  failed at {where}: {reasons[at]}")
    return lines
