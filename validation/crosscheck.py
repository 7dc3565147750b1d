"""A bed that two codes compute: run it here, and say how far the positions lie apart.

A bed is ``NAME.npz`` (role, radius [m], mass [kg], ``start`` and ``after_N``: (n, 4) x, y [m], vx, vy
[m/s], the velocities being the leapfrog's half-step ones) with ``NAME.toml`` beside it (scene, time with
dt, start and steps, laws). Bodies are called by their row, "0", "1" ..., unless the npz has an ``id``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import granswim_pymunk
from granswim_pymunk.errors import InputError
from granswim_pymunk.limits import read_arrays
from granswim_pymunk.scene import ROLES, Scene, read_toml, scene_from_dict

from .reference import Reference

MODES = ("verlet", "chipmunk", "python", "reference")
SHIPPED = Path(granswim_pymunk.__file__).parent / "recordings" / "crosscheck"
# words about a bed that no run needs
REMARKS = ("format", "title", "description", "source", "licence", "license", "note", "notes", "comment")


@dataclass(frozen=True)
class StoredBed:
    """A scene with its start, and positions (n, 2) [m] (or (n, 4) with velocities) after so many steps."""

    scene: Scene
    after: Mapping[int, np.ndarray]


@dataclass(frozen=True)
class Deviation:
    """Largest deviation of a position [m] after ``steps`` steps."""

    steps: int
    max_position_error: float


def find_bed(name: str | Path) -> Path:
    """The npz file: a path, or the name of a bed that comes with the package. Raises InputError."""
    path = Path(name)
    shipped = SHIPPED / f"{name}.npz"
    if not path.exists() and path.name == str(name) and shipped.exists():
        return shipped
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in SHIPPED.glob("*.npz")))
        raise InputError(f"no such file; beds that come with the package: {known}", file=path)
    return path


def _texts(values: np.ndarray, key: str, path: Path) -> list[str]:
    """An array as texts. Raises InputError where its bytes are no characters."""
    try:
        return [v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v) for v in values.ravel()]
    except (SystemError, ValueError):  # what Python says of a character beyond the last one
        raise InputError("holds what is no text", file=path, where=key) from None


def _numbers(data: Mapping[str, np.ndarray], key: str, shape: tuple[int, ...], path: Path) -> np.ndarray:
    array = data[key]
    if array.dtype.kind not in "fiu" or array.shape not in (
        shape,
        (*shape[:-1], 2) if key.startswith("after") else shape,
    ):
        raise InputError(
            f"should be numbers of shape {shape}, got {array.dtype} {array.shape}", file=path, where=key
        )
    return array.astype(float)


def read_bed(name: str | Path) -> StoredBed:
    """Read ``NAME.npz`` and ``NAME.toml``. Raises InputError naming file and key."""
    path = find_bed(name)
    beside = path.with_suffix(".toml")
    data, table = read_arrays(path), read_toml(beside)
    for key in ("role", "radius", "mass", "start"):
        if key not in data:
            raise InputError(f"has no {key!r}; it needs role, radius, mass, start and after_N", file=path)
    roles = _texts(data["role"], "role", path)
    n = len(roles)
    for row, role in enumerate(roles):
        if role not in ROLES:
            raise InputError(
                f"should be one of {', '.join(ROLES)}, got {role!r}", file=path, where=f"role of row {row}"
            )
    radius, mass = (_numbers(data, key, (n,), path) for key in ("radius", "mass"))
    start = _numbers(data, "start", (n, 4), path)
    ids = _texts(data.get("id", np.arange(n)), "id", path)
    if len(ids) != n:
        raise InputError(f"should have {n} entries, got {len(ids)}", file=path, where="id")
    inertia = _numbers(data, "inertia", (n,), path) if "inertia" in data else np.full(n, np.nan)

    bodies: list[dict[str, Any]] = []
    for k in range(n):
        body: dict[str, Any] = {"id": ids[k], "role": roles[k], "radius": float(radius[k])}
        if roles[k] == "wall":
            body |= {"x": float(start[k, 0]), "y": float(start[k, 1])}
        else:
            body |= {"mass": float(mass[k]), "initial": start[k].tolist()}
            if np.isfinite(inertia[k]):
                body["inertia"] = float(inertia[k])
        bodies.append(body)

    time = table.get("time")
    if not isinstance(time, dict) or "dt" not in time:
        raise InputError("needs dt [s]", file=beside, where="time")
    time = dict(time)
    stored = {int(k[6:]): k for k in data if k.startswith("after_") and k[6:].isdecimal()}
    time["scheme"] = "half_step"  # that of the codes that computed the bed
    steps = time.pop("steps", sorted(stored))
    if (
        not isinstance(steps, list)
        or not steps
        or any(isinstance(s, bool) or not isinstance(s, int) or s < 0 for s in steps)
    ):
        raise InputError(
            f"should be a list of numbers of steps, got {steps!r}", file=beside, where="time.steps"
        )
    for step in steps:
        if step not in stored:
            raise InputError(f"has no 'after_{step}', which {beside.name} lists in time.steps", file=path)
    kept = {key: value for key, value in table.items() if key not in REMARKS}
    if "body" in kept or "bodies" in kept or "swimmer" in kept:
        raise InputError("bodies stand in the npz, not here", file=beside)
    scene = scene_from_dict({**kept, "time": time, "body": bodies}, file=beside)
    after = {step: _numbers(data, stored[step], (n, 4), path) for step in sorted(set(steps))}
    for step, array in after.items():
        if not np.isfinite(array[:, :2]).all():
            raise InputError("a position is not finite", file=path, where=f"after_{step}")
    return StoredBed(replace(scene, title=scene.title or path.stem), after)


def crosscheck(
    bed: StoredBed | str | Path, mode: str = "verlet", most: int | None = None
) -> Iterator[Deviation]:
    """Run a bed and yield the deviation at each stored step, in order; none beyond ``most`` steps.

    Positions may be wrapped or not: deviations along a periodic x are those of the nearest image.
    ``mode``: one of the engine's, or ``reference``. Raises InputError.
    """
    if mode not in (*MODES, "batch"):
        raise InputError(f"should be one of {', '.join(MODES)}, got {mode!r}", where="mode")
    if not isinstance(bed, StoredBed):
        bed = read_bed(bed)
    run: Any
    if mode == "reference":
        run = Reference(bed.scene, start="leapfrog")
    else:
        from granswim_pymunk.engine import Simulation

        run = Simulation(bed.scene, mode=mode, start="leapfrog")
    done = 0
    for steps, stored in bed.after.items():
        if most is not None and steps > most:
            return
        run.advance(steps - done)
        done = steps
        apart = run.state().xy - stored[:, :2]
        if bed.scene.periodic_x is not None:
            apart[:, 0] -= bed.scene.periodic_x * np.round(apart[:, 0] / bed.scene.periodic_x)
        yield Deviation(steps, float(np.hypot(apart[:, 0], apart[:, 1]).max(initial=0.0)))
