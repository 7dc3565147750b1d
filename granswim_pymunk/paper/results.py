"""Finished runs, each boiled down to the numbers that the claims are judged by."""

from __future__ import annotations

import functools
import itertools
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..analysis.contacts import mean_direction
from ..analysis.fields import inertial_number, shear_rate
from ..analysis.shape import comoving_shapes, segment_response
from ..analysis.speed import center_of_mass, mean_error, swimming_speed
from ..analysis.work import work_per_cycle
from ..errors import InputError
from ..sweep import Job, make_jobs, read_dataset, run_jobs, write_dataset
from .measure import Plan, measure
from .plans import Point, Setting, complete
from .scenes import DENSITY, DISKS, RADIUS, paper_scene

SUMMARY = 3  # version of ``summarise``; kept numbers of another one are not used
HEAD, CENTRE, TAIL = 0, DISKS // 2, DISKS - 1
LENGTH, WIDTH = 2 * RADIUS * DISKS, 2 * RADIUS  # L_s, D_s of the swimmer [m]
SHAPES = 24  # in a cycle
HEIGHTS = np.arange(-6.0, 6.01, 0.5)  # y/D_s of the vertical profiles


def summarise(run: xr.Dataset) -> xr.Dataset:
    """The numbers of one run (SI), from what ``measure`` keeps.

    speed, speed_error, speed_x, turn : of ``swimming_speed`` after the settling time
    speed_early, speed_late, speed_whole, speed_head : displacement towards -x over time, of the centre of mass before
    the settling time, in the second half of what follows, from the start to the end; of the head from start to end
    bed_energy, swimmer_energy : means [J];  bed_pulse, bed_once : amplitudes of the bed's energy at 2 f and f
    work_stated [N s], work_corrected [J] : means of W_T;  work_spread : standard deviation of W_T
    push_pulse, push_once : amplitudes of F.v/|v| at 2 f and f [N];  push_peak : 95th percentile of it
    input : work of the bending law in a cycle [J];  segment_amplitude, segment_lag [rad], tail_swing [m]
    lean_x (disk) : mean x of the unit vectors of contact pushes, by number;  lean_x_force : weighed by force
    profile_... (height) : over L_s x D_s, above and below the swimmer; maps stay in the run's file
    """
    point = json.loads(run.attrs["point"])
    f = float(point["frequency"])
    t, mass = run["time"].values, run["disk_mass"].values
    xy, v = run["xy"].values.astype(float), run["v"].values.astype(float)
    settle = float(run.attrs["settle"])
    speed = swimming_speed(t, xy, mass, f, settle)
    after = t >= t[0] + settle - 1e-9
    center = center_of_mass(xy, mass)

    def towards(place: np.ndarray, begin: float, end: float) -> float:
        return float(np.interp(begin, t, place[:, 0]) - np.interp(end, t, place[:, 0])) / (end - begin)

    data: dict[str, Any] = {
        "speed": speed.value, "speed_error": speed.error, "speed_x": speed.along_x, "turn": speed.turn,
        "speed_early": towards(center, t[0], t[0] + settle),
        "speed_late": towards(center, 0.5 * (t[0] + settle + t[-1]), t[-1]),
        "speed_whole": towards(center, t[0], t[-1]), "speed_head": towards(xy[:, 0], t[0], t[-1]),
        "bed_energy": float(run["bed_energy"].values[after].mean()),
        "swimmer_energy": float(run["swimmer_energy"].values[after].mean()),
        "input": float(run["bending_power"].values[after].mean()) / f,
    }  # fmt: skip
    data["bed_once"], data["bed_pulse"] = _harmonics(t[after], run["bed_energy"].values[after], f)
    work = work_per_cycle(t[after], v[after], mass, f)
    data["work_stated"], data["work_corrected"] = float(np.nanmean(work.stated)), float(np.nanmean(work.corrected))
    data["work_spread"], data["push_peak"] = float(np.nanstd(work.stated)), float(np.percentile(work.rate, 95))
    data["propulsion"] = work.propulsion
    data["push_once"], data["push_pulse"] = _harmonics(work.t, work.rate, f)
    response = segment_response(t[after], xy[after], mass, f)
    data["segment_amplitude"] = ("segment", response.amplitude)
    data["segment_lag"] = ("segment", response.lag)
    data["tail_swing"] = response.tail
    for name in (
        "coordination", "anisotropy", "branch_anisotropy", "floaters", "overlap", "contact_force", "packed_fraction",
    ):  # fmt: skip
        if name in run:
            data[name] = float(run[name])
    if "direction_count" in run:
        bins = run.sizes["angle"]
        edges = np.linspace(-np.pi, np.pi, bins + 1)
        data["direction_count"] = (("disk", "angle"), run["direction_count"].values)
        data["lean_x"] = ("disk", mean_direction(edges, run["direction_count"].values)[:, 0])
        data["lean_x_force"] = ("disk", mean_direction(edges, run["direction_force"].values)[:, 0])
    data["shape"] = (("phase", "disk", "axis"), comoving_shapes(t, xy, mass, f, 1.0, SHAPES))
    if "field_fraction" in run:
        data |= {f"profile_{k}": ("height", value) for k, value in profiles(run).items()}
    coords: dict[str, Any] = {"height": HEIGHTS, "segment": np.arange(DISKS - 1), "disk": np.arange(DISKS)}
    return xr.Dataset(data, coords=coords).assign_attrs(run.attrs)


def nan_mean(values: Any, axis: int | None = None) -> Any:
    """Mean without the NaN, NaN where there is nothing else."""
    values = np.asarray(values, dtype=float)
    seen = np.isfinite(values)
    count = seen.sum(axis=axis)
    return np.where(seen, values, 0.0).sum(axis=axis) / np.where(count > 0, count, np.nan)


def _harmonics(t: np.ndarray, series: np.ndarray, frequency: float) -> tuple[float, float]:
    """Amplitudes at the drive's frequency and at twice it, over whole cycles."""
    cycles = np.floor((t[-1] - t[0]) * frequency + 1e-6)
    kept = t <= t[0] + cycles / frequency
    phase = 2 * np.pi * frequency * t[kept]
    columns = [np.ones(kept.sum()), t[kept] - t[0]]
    columns += [fun(k * phase) for k in (1, 2) for fun in (np.sin, np.cos)]
    fit = np.linalg.lstsq(np.column_stack(columns), series[kept], rcond=None)[0]
    return float(np.hypot(fit[2], fit[3])), float(np.hypot(fit[4], fit[5]))


def fields_of(run: xr.Dataset) -> dict[str, np.ndarray]:
    """Maps (ny, nx) of a run in the head's frame (SI): fraction, kinetic, stated_kinetic, contact, shear, inertial.

    ``contact`` : of every contact that a grain has;  ``bed_contact`` : without those with the swimmer
    ``inertial`` is a pure number: P over the thickness of the layer, 2/3 of the mean diameter;
    ``stated_inertial`` has P and rho as the paper writes them.
    """
    density = run["field_density"].values
    safe = np.where(density > 0, density, 1.0)
    vx, vy = run["field_momentum_x"].values / safe, run["field_momentum_y"].values / safe
    shear = shear_rate(vx, vy, float(run["x"][1] - run["x"][0]))
    kinetic = run["field_kinetic_xx"].values + run["field_kinetic_yy"].values
    bed = run["field_contact_xx"].values + run["field_contact_yy"].values
    contact = bed + run["field_swimmer_contact"].values
    diameter = 2 * float(run.attrs["grain_radius"])
    pressure = 0.5 * (kinetic + contact)
    return {
        "fraction": run["field_fraction"].values,
        "kinetic": kinetic,
        "stated_kinetic": run["field_stated_kinetic"].values,
        "contact": contact,
        "bed_contact": bed,
        "shear": shear,
        "inertial": inertial_number(shear, pressure, diameter, DENSITY, depth=2 * diameter / 3),
        "stated_inertial": inertial_number(shear, pressure, diameter, DENSITY),
    }


def profiles(run: xr.Dataset) -> dict[str, np.ndarray]:
    """(len(HEIGHTS),) means over cells of L_s x D_s, one above the other, that begin at the head.

    The inertial numbers are those of a cell's mean shear rate and mean pressure: point by point they have no
    bound where a swimmer has left nothing to press.
    """
    x, y = run["x"].values, run["y"].values
    columns = (x >= -RADIUS) & (x <= LENGTH - RADIUS)
    rows = [np.abs(y - h * WIDTH) <= WIDTH / 2 for h in HEIGHTS]
    maps = fields_of(run)
    result = {
        name: np.array([nan_mean(maps[name][np.ix_(row, columns)]) for row in rows])
        for name in ("fraction", "kinetic", "stated_kinetic", "contact", "bed_contact", "shear")
    }
    diameter = 2 * float(run.attrs["grain_radius"])
    pressure = 0.5 * (result["kinetic"] + result["contact"])
    result["inertial"] = inertial_number(result["shear"], pressure, diameter, DENSITY, depth=2 * diameter / 3)
    result["stated_inertial"] = inertial_number(result["shear"], pressure, diameter, DENSITY)
    return result


@dataclass
class Results:
    """Summaries of the finished runs of a setting, by what their points are.

    folder : of the run files (maps, tracks);  failed : reasons by point
    """

    setting: Setting
    folder: Path
    runs: list[tuple[Point, xr.Dataset]] = field(default_factory=list)
    failed: list[tuple[Point, str]] = field(default_factory=list)
    files: dict[tuple[Any, ...], Path] = field(default_factory=dict)
    maps: xr.Dataset | None = None

    def select(self, **conditions: Any) -> list[tuple[Point, xr.Dataset]]:
        """Runs with these values; what is not named has its usual one, the seed is free."""
        wanted = complete(conditions, self.setting, 0)
        wanted.pop("seed")
        return sorted(
            ((p, s) for p, s in self.runs if all(_same(p[k], v) for k, v in wanted.items())),
            key=lambda item: item[0]["seed"],
        )

    def values(self, name: str, **conditions: Any) -> np.ndarray:
        """(packings, ...) one value (or array) for each packing that has it."""
        found = [s[name].values for _, s in self.select(**conditions) if name in s]
        # a kept table has NaN for what a run did not measure
        return np.array([v for v in found if np.isfinite(v).any()], dtype=float)

    def mean(self, name: str, **conditions: Any) -> tuple[Any, Any, int]:
        """Mean, half width of its 95 % interval, packings."""
        values = self.values(name, **conditions)
        if not len(values):
            return np.nan, np.nan, 0
        mean, error = mean_error(values)
        return (mean, error, len(values)) if values.ndim > 1 else (float(mean), float(error), len(values))

    def frequencies(self, **conditions: Any) -> list[float]:
        """Frequencies [Hz] that were run with these values."""
        wanted = complete(conditions, self.setting, 0)
        wanted.pop("seed"), wanted.pop("frequency")
        return sorted({p["frequency"] for p, _ in self.runs if all(_same(p[k], v) for k, v in wanted.items())})

    def difference(
        self, name: str, first: Point, second: Point, pick: Callable[[np.ndarray], Any] = lambda v: v
    ) -> tuple[float, float, int]:
        """Mean of first less second, packing by packing, with its 95 % half width; unpaired where seeds differ."""
        a = {p["seed"]: float(pick(s[name].values)) for p, s in self.select(**first) if name in s}
        b = {p["seed"]: float(pick(s[name].values)) for p, s in self.select(**second) if name in s}
        both = [k for k in sorted(set(a) & set(b)) if np.isfinite(a[k] - b[k])]
        if not both:
            return np.nan, np.nan, 0
        mean, error = mean_error(np.array([a[k] - b[k] for k in both]))
        return float(mean), float(error), len(both)

    def full(self, point: Point) -> xr.Dataset | None:
        """The whole run of a point (with its seed), None where its file is not here."""
        file = self.files.get(_key(point))
        return _remembered(file, file.stat().st_mtime_ns) if file is not None and file.exists() else None

    def averaged(self, name: str, frequency: float) -> tuple[np.ndarray, int] | None:
        """Mean map of ``fields_of`` over packings of the free swimmer, and their number.

        From the run files; where more packings stand in the maps that were kept, from those.
        """
        files = [run for p, _ in self.select(frequency=frequency) if (run := self.full(p)) is not None]
        old = self.maps
        if old is not None and frequency in old["frequency"].values:
            row = old.sel(frequency=frequency)
            if name in row and int(row["packings"]) > len(files):
                return row[name].values, int(row["packings"])
        return (nan_mean([fields_of(run)[name] for run in files], axis=0), len(files)) if files else None

    def shapes(self, **conditions: Any) -> list[np.ndarray]:
        """Co-moving shapes (``SHAPES``, n, 2) [m] over the last cycle, one array a packing."""
        return list(self.values("shape", **conditions))


def _same(a: Any, b: Any) -> bool:
    return a == b if isinstance(a, str) or isinstance(b, str) else bool(np.isclose(a, b, rtol=1e-9, atol=0))


def _key(point: Point) -> tuple[Any, ...]:
    return tuple(sorted(point.items()))


def jobs_of(points: Iterable[Point], setting: Setting, folder: Path) -> list[Job]:
    """The jobs of these points in OUT/runs."""
    return [
        job for point in points for job in make_jobs(paper_scene, [point], measuring(setting.plan_of(point)), folder)
    ]


def measuring(plan: Plan) -> Callable[..., xr.Dataset]:
    """The measurement of a run by a plan."""
    return functools.partial(measure, plan=plan)


def run_points(jobs: Sequence[Job], setting: Setting, **how: Any) -> None:
    """``sweep.run_jobs`` for jobs of ``jobs_of``, in their order, neighbours that are measured alike together."""
    for plan, group in itertools.groupby(jobs, lambda job: setting.plan_of(dict(job.point))):
        run_jobs(list(group), paper_scene, measuring(plan), **how)


def kept_rows(file: Path) -> dict[str, tuple[Point, xr.Dataset]]:
    """Points and summaries of the table that ``keep`` writes, by job key; nothing where it is another version's."""
    if not file.exists():
        return {}
    table = read_dataset(file)
    if table.attrs.get("summary") != SUMMARY or "key" not in table:
        return {}
    plain = table.drop_vars(["key", "point"])
    rows = zip(table["key"].values, table["point"].values, strict=True)
    return {str(key): (json.loads(str(point)), plain.isel(run=k)) for k, (key, point) in enumerate(rows)}


def load(jobs: Sequence[Job], setting: Setting, folder: Path, kept: dict[str, tuple[Point, xr.Dataset]]) -> Results:
    """Summaries of the jobs that are done or that ``kept`` has."""
    results = Results(setting, folder)
    for job in jobs:
        point = dict(job.point)
        if job.key in kept:
            results.runs.append((point, kept[job.key][1]))
        elif job.done:
            run = read_dataset(job.file)
            if run.attrs.get("reason"):
                results.failed.append((point, run.attrs["reason"]))
                continue
            results.runs.append((point, summarise(run)))
        if job.done:
            results.files[_key(point)] = job.file
    return results


@functools.lru_cache(maxsize=64)
def _remembered(file: Path, stamp: int) -> xr.Dataset:
    return read_dataset(file)


def keep(results: Results, jobs: Sequence[Job], file: Path) -> None:
    """Write the summaries of all runs as one small table (run, ...), by which ``load`` finds them again."""
    keys = {_key(dict(job.point)): job.key for job in jobs}
    rows = [(p, s) for p, s in results.runs if _key(p) in keys]
    if not rows:
        raise InputError("there is no finished run to keep", file=file)
    plain = [s.reset_coords(drop=True).drop_attrs() for _, s in rows]
    table = xr.concat(
        [s.astype(np.float32) for s in plain], dim="run", data_vars="all", join="outer", coords="minimal",
        compat="override",
    )  # fmt: skip
    table["key"] = ("run", np.array([keys[_key(p)] for p, _ in rows]))
    table["point"] = ("run", np.array([json.dumps(p) for p, _ in rows]))
    table.attrs |= {"setting": results.setting.name, "summary": SUMMARY}
    write_dataset(table, file)


def mean_maps(results: Results, names: Sequence[str], frequencies: Sequence[float]) -> xr.Dataset | None:
    """Mean maps (frequency, y, x) as ``averaged`` gives them, to be kept; None where there are none."""
    found = {f: {n: results.averaged(n, frequency=f) for n in names} for f in frequencies}
    have = [f for f in frequencies if all(v is not None for v in found[f].values())]
    if not have:
        return None
    data: dict[str, Any] = {
        n: (("frequency", "y", "x"), np.array([found[f][n][0] for f in have], dtype=np.float32))  # type: ignore[index]
        for n in names
    }
    data["packings"] = ("frequency", [found[f][names[0]][1] for f in have])  # type: ignore[index]
    return xr.Dataset(data, coords={"frequency": list(have)})


def labelled(results: Results) -> xr.Dataset:
    """Scalars of the runs in the paper's bed over frequency, k_B, layers and packing seed."""
    usual = complete({}, results.setting, 0)
    free = ("frequency", "k_B", "layers", "seed")
    runs = [(p, s) for p, s in results.runs if all(_same(p[k], v) for k, v in usual.items() if k not in free)]
    axes = {name: sorted({p[name] for p, _ in runs}) for name in free}
    shape = tuple(map(len, axes.values()))
    data: dict[str, np.ndarray] = {}
    for point, summary in runs:
        at = tuple(axes[name].index(point[name]) for name in free)
        for key, variable in summary.data_vars.items():
            if variable.ndim == 0 and variable.dtype.kind == "f":
                data.setdefault(str(key), np.full(shape, np.nan))[at] = float(variable)
    return xr.Dataset({k: (free, v) for k, v in data.items()}, coords=axes)
