"""What a case of the validation returns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from granswim_pymunk.scene import Scene

from .reference import Reference


@dataclass(frozen=True)
class Figure:
    """One deviation that must not be larger than ``bound``. ``note``: what was compared."""

    name: str
    value: float
    bound: float
    unit: str = "1"
    note: str = ""

    @property
    def holds(self) -> bool:
        return math.isfinite(self.value) and abs(self.value) <= self.bound


@dataclass(frozen=True)
class Line:
    """One curve of a plot; ``style`` as in matplotlib."""

    label: str
    x: np.ndarray
    y: np.ndarray
    style: str = "o-"


@dataclass(frozen=True)
class Panel:
    """A plot: ``log`` names the logarithmic axes, "", "x", "y" or "xy"."""

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line]
    log: str = ""


@dataclass(frozen=True)
class Case:
    """A case with its figures and plots."""

    name: str
    figures: Sequence[Figure]
    panels: Sequence[Panel] = field(default_factory=tuple)

    @property
    def holds(self) -> bool:
        return all(figure.holds for figure in self.figures)


def runner(scene: Scene, mode: str, dt: float, start: str = "synchronised") -> Any:
    """The scene ready to run: by an engine mode, or by the reference integrator."""
    if mode == "reference":
        return Reference(scene, dt=dt, start=start)
    from granswim_pymunk.engine import Simulation

    return Simulation(scene, mode=mode, dt=dt, start=start)


def crossings(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Times at which a sampled curve passes through zero, linear between samples."""
    k = np.flatnonzero(np.signbit(values[:-1]) != np.signbit(values[1:]))
    return times[k] - values[k] * (times[k + 1] - times[k]) / (values[k + 1] - values[k])


def drift(times: np.ndarray, values: np.ndarray) -> float:
    """Change of the straight line fitted to a series, from its first to its last time."""
    return float(np.polyfit(times, values, 1)[0] * (times[-1] - times[0]))
