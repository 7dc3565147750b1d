"""Where the time of a step goes: the engine with more and more of its work taken away.

Processor time of interleaved blocks in one process, the fastest of each; a phase is the difference of two.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pymunk

from granswim_pymunk.engine import Simulation
from granswim_pymunk.scene import Scene

from .speed import timed

CHIPMUNK_UP_TO = 20000  # bodies; beyond, a step takes a second


@dataclass(frozen=True)
class Phase:
    """What one phase takes of a step of a mode [ns a grain]."""

    mode: str
    grains: int
    phase: str
    ns_per_grain: float


def _verlet(scene: Scene) -> dict[str, Any]:
    """Simulations that do the work up to the end of each phase."""
    alone = tuple(item for item in scene.laws if item.law.kind != "pair")
    return {
        "Chipmunk's calls of drift and kick": Simulation(replace(scene, laws=())),
        "laws of bodies and chains": Simulation(replace(scene, laws=alone)),
        "pairs and their lists": Simulation(scene),
    }


def _chipmunk(scene: Scene) -> dict[str, Any]:
    bare = replace(scene, laws=())
    moving = Simulation(bare, mode="chipmunk")
    moving.backend.world.remove_shapes()
    passing = Simulation(bare, mode="chipmunk")
    nothing = pymunk.ShapeFilter(categories=0, mask=0)
    world = passing.backend.world
    for circle in [*world.circles, *(circle for _, circle in world.ghosts)]:
        circle.filter = nothing
    return {
        "Chipmunk's calls of drift and kick": moving,
        "broad phase": passing,
        "narrow phase and arbiters": Simulation(bare, mode="chipmunk"),
        "laws": Simulation(scene, mode="chipmunk"),
    }


def profile(scene: Scene, grains: int, rounds: int = 12, block: float = 0.04) -> list[Phase]:
    """Phases of a step of ``verlet`` and, up to some size, of ``chipmunk`` [ns a grain], in the order of the step."""
    result = []
    for mode, build in {"verlet": _verlet, "chipmunk": _chipmunk}.items():
        if mode == "chipmunk" and grains > CHIPMUNK_UP_TO:
            continue
        running = build(scene)
        steps = {}
        for name, simulation in running.items():
            simulation.advance(2)
            first = timed(simulation, 3)
            least = 300 if mode == "verlet" else 3  # several neighbour lists to a block
            steps[name] = max(math.ceil(block / first), least)
            simulation.advance(steps[name])
        best = dict.fromkeys(running, math.inf)
        for _ in range(rounds):
            for name, simulation in running.items():
                best[name] = min(best[name], timed(simulation, steps[name]))
        before = 0.0
        for name, seconds in best.items():
            result.append(Phase(mode, grains, name, 1e9 * (seconds - before) / grains))
            before = seconds
    return result


def table(phases: Iterable[Phase]) -> str:
    """The phases as a table in Markdown, a column for each size [ns a grain]."""
    phases = list(phases)
    sizes: Sequence[int] = sorted({phase.grains for phase in phases})
    found = {(p.mode, p.phase, p.grains): p.ns_per_grain for p in phases}
    lines = [
        f"| mode | ns a grain and step | {' | '.join(f'{size} grains' for size in sizes)} |",
        "|---|---|" + "---|" * len(sizes),
    ]
    for mode, name in dict.fromkeys((p.mode, p.phase) for p in phases):
        numbers = [found.get((mode, name, size)) for size in sizes]
        lines.append(f"| `{mode}` | {name} | {' | '.join('' if n is None else f'{n:.1f}' for n in numbers)} |")
    return "\n".join(lines) + "\n"
