"""Time per step and memory of the engine's modes, of LAMMPS and of a plain loop, side by side.

All run in one process, one after the other in short blocks, round after round, so that whatever else the
machine does meets all of them; processor time is counted, and the fastest block of each. The engine computes
the whole bed (contacts, drag, union, bending), LAMMPS and the plain loop its contacts and drag.
"""

from __future__ import annotations

import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from granswim_pymunk.engine import Simulation
from granswim_pymunk.errors import InputError
from granswim_pymunk.scene import Scene

from .beds import bed, contacts_only
from .lammps_bed import LammpsBed, find_lammps
from .plain_loop import PlainLoop

ENGINES = ("verlet", "chipmunk", "python", "plain", "lammps")
LABELS = {
    "verlet": "granswim verlet",
    "chipmunk": "granswim chipmunk",
    "python": "pymunk, Python callbacks",
    "plain": "plain numba loop",
    "lammps": "LAMMPS gran/hooke",
}
PYTHON_UP_TO = 5000  # bodies; beyond, a single step takes seconds


@dataclass(frozen=True)
class Row:
    """One engine at one size. ``memory_mb``: what the bed adds to a process of its own, at its peak."""

    engine: str
    grains: int
    bodies: int
    us_per_step: float
    ratio_to_lammps: float | None
    memory_mb: float | None


@dataclass(frozen=True)
class Agreement:
    """Largest deviation of a position [m] from the engine's verlet mode after some steps."""

    engine: str
    steps: int
    max_position_error: float


def build(engine: str, scene: Scene) -> Any:
    """Something with ``advance(steps)`` for this engine."""
    if engine == "lammps":
        return LammpsBed(contacts_only(scene))
    if engine == "plain":
        return PlainLoop(contacts_only(scene))
    return Simulation(scene, mode=engine)


def usable(engines: Iterable[str], grains: int) -> list[str]:
    return [e for e in engines if e != "python" or grains <= PYTHON_UP_TO]


def measure(scene: Scene, engines: Sequence[str], rounds: int = 12, block: float = 0.04) -> dict[str, float]:
    """Seconds a step of each engine: the fastest of ``rounds`` interleaved blocks of about ``block`` seconds."""
    running = {engine: build(engine, scene) for engine in engines}
    steps: dict[str, int] = {}
    for engine, it in running.items():
        it.advance(1)
        first = timed(it, 1 if engine == "python" else 20)
        it.advance(1 if engine == "python" else 200)  # past the first lists
        # several neighbour lists to a block, or their cost would be left out
        steps[engine] = 1 if engine == "python" else max(math.ceil(block / first), 300)
    best = dict.fromkeys(engines, math.inf)
    for turn in range(rounds):
        for engine, it in running.items():
            if engine == "python" and turn >= 3:
                continue
            best[engine] = min(best[engine], timed(it, steps[engine]))
    for it in running.values():
        if isinstance(it, LammpsBed):
            it.close()
    return best


def timed(it: Any, steps: int) -> float:
    """Processor time [s] of a step."""
    # the processor time of this thread: waiting for other programs does not count
    begin = time.thread_time()
    it.advance(steps)
    return (time.thread_time() - begin) / steps


def agreement(scene: Scene, engines: Sequence[str], steps: int = 100) -> list[Agreement]:
    """Contacts and drag alone, computed by each engine from one state; positions compared with verlet."""
    plain_scene = contacts_only(scene)
    period = scene.periodic_x or math.inf
    result = []
    for engine in engines:
        if engine == "verlet":
            continue
        count = min(steps, 10) if engine == "python" else steps
        # LAMMPS begins with half a kick, the plain loop with the half-step velocities
        start = "leapfrog" if engine == "plain" else "synchronised"
        own = Simulation(plain_scene, mode="verlet", start=start)
        own.advance(count)
        other = build(engine, plain_scene)
        other.advance(count)
        there = other.state().xy if isinstance(other, Simulation) else other.positions()
        apart = there - own.state().xy
        apart[:, 0] -= period * np.round(apart[:, 0] / period) if math.isfinite(period) else 0.0
        result.append(Agreement(engine, count, float(np.abs(apart).max())))
        if isinstance(other, LammpsBed):
            other.close()
    return result


def memory(engine: str, grains: int) -> float | None:
    """Megabytes that a bed of this size adds to a process of its own, at its peak; None where unknown."""
    if not Path("/proc/self/status").exists():
        return None
    command = [sys.executable, "-m", "granswim_pymunk.benchmarks.footprint", engine, str(grains)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return float(done.stdout) if done.returncode == 0 else None


def benchmark(
    sizes: Sequence[int],
    engines: Sequence[str] = ENGINES,
    *,
    rounds: int = 12,
    with_memory: bool = True,
    say: Callable[[str], None] = print,
) -> tuple[list[Row], list[Agreement]]:
    """Time and memory of each engine at each size, and how far the engines agree at the first one.

    LAMMPS is left out, with a word, where it is not installed. Raises InputError for a size below 50 or
    an engine that does not exist.
    """
    for engine in engines:
        if engine not in ENGINES:
            raise InputError(f"unknown engine {engine!r}; expected one of {', '.join(ENGINES)}")
    for size in sizes:
        if size < 50:
            raise InputError(f"a bed needs at least 50 grains, got {size}")
    engines = list(dict.fromkeys(engines))
    if "lammps" in engines:
        missing = find_lammps()
        if missing:
            say(f"{missing}: going on without it")
            engines.remove("lammps")
    scenes = {size: bed(size) for size in dict.fromkeys(sizes)}
    apart: list[Agreement] = []
    if "verlet" in engines:
        size = min(scenes, key=lambda s: abs(s - 2264))
        apart = agreement(scenes[size], usable(engines, size))
        for a in apart:
            say(f"{LABELS[a.engine]:<26} within {a.max_position_error:.1e} m of verlet after {a.steps} steps")
    rows = []
    say(f"\n{'engine':<26} {'grains':>8} {'us/step':>10} {'ns/grain':>9} {'LAMMPS = 1':>11} {'memory MB':>10}")
    for size, scene in scenes.items():
        chosen = usable(engines, size)
        if len(chosen) < len(engines):
            say(f"{LABELS['python']:<26} {size:>8}   left out: one step takes seconds")
        best = measure(scene, chosen, rounds)
        for engine in chosen:
            ratio = best[engine] / best["lammps"] if "lammps" in best else None
            used = memory(engine, size) if with_memory else None
            row = Row(engine, size, len(scene.bodies), best[engine] * 1e6, ratio, used)
            rows.append(row)
            say(
                f"{LABELS[engine]:<26} {size:>8} {row.us_per_step:>10.1f} {1e3 * row.us_per_step / size:>9.1f} "
                f"{'-' if ratio is None else f'{ratio:.2f}':>11} {'-' if used is None else f'{used:.0f}':>10}"
            )
    return rows, apart


def as_json(rows: Iterable[Row]) -> list[dict[str, Any]]:
    return [asdict(row) for row in rows]


def table(rows: Iterable[Row]) -> str:
    """The rows as a table in Markdown."""
    lines = [
        "| engine | grains | us a step | ns a grain | over LAMMPS | memory [MB] |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        ratio = "" if row.ratio_to_lammps is None else f"{row.ratio_to_lammps:.2f}"
        used = "" if row.memory_mb is None else f"{row.memory_mb:.0f}"
        per_grain = 1e3 * row.us_per_step / row.grains
        name = LABELS[row.engine]
        lines.append(f"| {name} | {row.grains} | {row.us_per_step:.1f} | {per_grain:.1f} | {ratio} | {used} |")
    return "\n".join(lines) + "\n"


def draw(rows: Sequence[Row], path: str | Path) -> None:
    """Time a step against the number of grains, both on logarithmic axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for engine in ENGINES:
        points = sorted((row.grains, row.us_per_step) for row in rows if row.engine == engine)
        if points:
            sizes, times = zip(*points, strict=True)
            style = {"lammps": "k--s", "plain": "k:^"}.get(engine, "-o")
            axes.loglog(sizes, times, style, label=LABELS[engine])
    axes.set_xlabel("grains")
    axes.set_ylabel("time per step [µs]")
    axes.grid(True, which="both", alpha=0.25)
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)
