"""Which runs each claim needs, in two settings, and in which order they are worth running."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from .measure import Plan
from .scenes import K_B_FIRST, K_B_PER_LABEL, MU_EFF, STEP

Point = dict[str, Any]

# frequencies [Hz] of the free swimmer at the label k_B
FREE = {
    100.0: (4.0, 9.0, 15.0, 11.0, 6.0, 20.0),
    200.0: (9.0, 13.5, 18.0, 24.0, 11.0, 16.0),
    500.0: (9.0, 22.0, 27.0, 36.0, 17.0),
    150.0: (9.0, 11.5, 15.0, 20.0),
}
THREE = (9.0, 4.0, 15.0)
FRICTION = (0.11, 0.16, 0.055, 0.22)  # s/m, at 11 layers, besides the calibrated one
HEIGHTS = (5.0, 18.0)  # layers
SIZES: tuple[Point, ...] = (
    {"grain_diameter": 2.0e-3},
    {"height": 0.035},
)
FIRST: Point = {"k_B_scale": K_B_FIRST / K_B_PER_LABEL}
READINGS: tuple[Point, ...] = (
    {"form": "elastic"},
    {"form": "head_axis"},
    {"gamma_B": 1.0e3},
    {"k_B_scale": 0.25},
    FIRST,
)
LOOSE: Point = {"packing_fraction": 0.79}
# of a box of 140 mm with as much area to spare as one of 100 mm at 0.80, were grains dense at 0.85:
# 0.85 - (0.85 - 0.80) 100/140
TIGHT: Point = {"packing_fraction": 0.814}


@dataclass(frozen=True)
class Setting:
    """How much is run: seeds of the packings, how each run is measured, how soft the contacts are.

    order : blocks with seeds of packings, the most telling ones first
    usual : values of ``paper_scene`` that differ from the paper's everywhere
    """

    name: str
    order: tuple[tuple[str, tuple[int, ...]], ...]
    plan: Plan
    softness: float
    usual: Mapping[str, Any] = field(default_factory=dict)

    @property
    def k_B_scale(self) -> float:
        """How many times the default's k_B all runs have that say nothing else."""
        return float(self.usual.get("k_B_scale", 1.0))

    @property
    def mu_eff(self) -> float:
        """The calibrated mu_eff [s/m]: of all runs under layers that say nothing else."""
        return float(self.usual.get("mu_eff", MU_EFF))

    @property
    def friction(self) -> tuple[float, ...]:
        """All mu_eff [s/m] at 11 layers, rising."""
        return tuple(sorted({self.mu_eff, *FRICTION}))

    @property
    def seeds(self) -> tuple[int, ...]:
        return tuple(sorted({seed for _, seeds in self.order for seed in seeds}))

    def plan_of(self, point: Point) -> Plan:
        """How a point is measured: coarse-grained fields only where a claim is about them, for the free swimmer."""
        usual = complete({"frequency": point["frequency"]}, self, point["seed"])
        return self.plan if point == usual else replace(self.plan, spacing=0.0)


# each with all packings; besides there is "stored", one bed packed by another code
BLOCKS = ("free", "k_B", "friction", "heights", "readings", "convergence", "sizes", "convergence_15")
_EIGHT = (1, 2, 3, 4, 5, 6, 7, 8)
POCKET = Setting(
    "pocket",
    (
        # two packings of everything first, then one claim after the other
        ("friction", _EIGHT[:2]), ("k_B", _EIGHT[:2]), ("readings", _EIGHT[:2]),
        *((name, _EIGHT) for name in ("free", "friction", "k_B", "heights", "sizes")),
        ("stored", (1,)), ("convergence", _EIGHT), ("readings", _EIGHT), ("convergence_15", _EIGHT),
    ),
    Plan(),
    25.0,
)
_TWENTY = tuple(range(1, 21))
PAPER = Setting("paper", (*((name, _TWENTY) for name in BLOCKS), ("stored", (1,))), Plan(duration=10.5, skin=0.0), 1.0)
SETTINGS = {s.name: s for s in (POCKET, PAPER)}


def convergence(setting: Setting) -> tuple[Point, ...]:
    """What is changed to see whether it matters: stiffness of the contacts, half the step, a longer box."""
    half = round(STEP * math.sqrt(setting.softness) / 2, 12)
    return ({"dt": half}, {"width": 0.140}, {"width": 0.140, **TIGHT}, LOOSE, stiff(setting))


def stiff(setting: Setting) -> Point:
    """Contacts and union as stiff as the paper's, or soft ones where those are usual."""
    return {"softness": 25.0 if setting.softness == 1.0 else 1.0}


def blocks(setting: Setting) -> dict[str, list[Point]]:
    """Points of each block, without seed and softness, the most telling ones first."""
    return {
        "free": [{"k_B": 100.0, "frequency": f} for f in FREE[100.0]],
        "k_B": [{"k_B": k, "frequency": f} for k in (200.0, 500.0, 150.0) for f in FREE[k]],
        "convergence": [{"frequency": 9.0, **c} for c in convergence(setting)],
        "convergence_15": [{"frequency": 15.0, **c} for c in (LOOSE, stiff(setting))],
        "friction": [{"layers": 11.0, "mu_eff": mu, "frequency": f} for mu in setting.friction for f in THREE],
        "heights": [{"layers": n, "frequency": f} for n in HEIGHTS for f in THREE],
        # what an independent code did, it did with the k_B first taken, at 11 Hz too
        "readings": [*({**r, "frequency": f} for r in READINGS for f in THREE), {**FIRST, "frequency": 11.0}],
        "stored": [{"stored": "bed_9Hz", "frequency": f, **FIRST} for f in (9.0, 15.0)],
        "sizes": [{**s, "frequency": f} for s in SIZES for f in THREE],
    }


def points_of(setting: Setting, names: list[str] | None = None) -> list[Point]:
    """All points of these blocks (default: all), in the order in which they should be run, each once."""
    chosen = blocks(setting)
    result: dict[tuple[Any, ...], Point] = {}
    for name, seeds in setting.order:
        if names is None or name in names:
            for seed in seeds:
                for point in chosen[name]:
                    full = complete(point, setting, seed)
                    result.setdefault(tuple(full.values()), full)
    return list(result.values())


def complete(point: Point, setting: Setting, seed: int) -> Point:
    """The point with everything it leaves out."""
    return {
        "frequency": 9.0, "k_B": 100.0, "layers": 0.0, "mu_eff": MU_EFF, "form": "leader", "gamma_B": 1.0e2,
        "k_B_scale": 1.0,
        "grain_diameter": 1.5e-3, "width": 0.100, "height": 0.050, "softness": setting.softness, "dt": 0.0,
        "stored": "", "packing_fraction": 0.80,
        **setting.usual, **point, "seed": seed,
    }  # fmt: skip
