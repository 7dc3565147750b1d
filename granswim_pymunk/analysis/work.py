"""Work and power: the paper's work per cycle, and what each law of a scene does to the kinetic energy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..engine import Simulation
from ..errors import InputError
from ..scene import LawUse, Scene


@dataclass(frozen=True)
class CycleWork:
    """Work on a swimmer's centre of mass.

    t : (k,) middles of the samples [s];  force : (k, 2) total force M dV/dt [N]
    stated : (k,) W_T over the cycle that ends there, as the paper writes it: int F.v/|v| dt [N s], an impulse
    corrected : (k,) int F.v dt over that cycle [J]; NaN before the first cycle is complete
    rate : (k,) the integrand F.v/|v| [N]

    Both integrals are exact differences: F.v/|v| = M d|V|/dt and F.v = d(M V^2/2)/dt, whatever the forces are.
    Over a cycle they give the change of speed and of kinetic energy of the centre, so their long average is
    zero; ``rate`` is what pulses.
    """

    t: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    stated: np.ndarray
    corrected: np.ndarray

    @property
    def propulsion(self) -> float:
        """Mean of the positive part of ``rate`` [N]."""
        return float(np.maximum(self.rate, 0.0).mean())


def work_per_cycle(t: np.ndarray, v: np.ndarray, mass: np.ndarray, frequency: float) -> CycleWork:
    """W_T of a swimmer from its velocities.

    t (T,) [s], evenly spaced; v (T, n, 2) [m/s]; mass (n,) [kg]. The force is the change of momentum between
    samples, so its integral is exact however coarse they are. Raises InputError for a record below one cycle.
    """
    if len(t) < 3 or (t[-1] - t[0]) * frequency < 1:
        raise InputError(f"is shorter than one cycle of {frequency:g} Hz", where="work")
    total = float(np.sum(mass))
    center = np.einsum("tna,n->ta", v, mass) / total
    step = np.diff(t)
    force = total * np.diff(center, axis=0) / step[:, None]
    middle = 0.5 * (center[1:] + center[:-1])
    size = np.hypot(middle[:, 0], middle[:, 1])
    rate = np.einsum("ta,ta->t", force, middle) / np.where(size > 0, size, 1.0)
    span = max(round(1 / (frequency * float(np.median(step)))), 1)

    def over_cycle(series: np.ndarray) -> np.ndarray:
        sums = np.concatenate([[0.0], np.cumsum(series * step)])
        result = np.full(len(step), np.nan)
        result[span - 1 :] = sums[span:] - sums[:-span]
        return result

    power = np.einsum("ta,ta->t", force, middle)
    return CycleWork(0.5 * (t[1:] + t[:-1]), force, rate, over_cycle(rate), over_cycle(power))


@dataclass(frozen=True)
class Audit:
    """Work that each part of each law did on all bodies [J], against the change of kinetic energy.

    work : by law, springs and dashpots apart where a law has both
    kinetic : change of kinetic energy [J];  input : positive work of the drive's law [J]
    """

    work: Mapping[str, float]
    kinetic: float
    input: float

    @property
    def residual(self) -> float:
        """|sum of work - change of kinetic energy| over the input."""
        return abs(sum(self.work.values()) - self.kinetic) / self.input if self.input > 0 else float("nan")

    def __str__(self) -> str:
        lines = [f"  {name:30s} {value:+.4e} J" for name, value in self.work.items()]
        lines.append(f"  {'kinetic energy':30s} {self.kinetic:+.4e} J")
        lines.append(f"  not accounted for: {100 * self.residual:.2g} % of the input {self.input:.4e} J")
        return "\n".join(lines)


def law_parts(scene: Scene) -> list[tuple[str, LawUse]]:
    """The scene's laws, those with a stiffness and a damping as two: "NAME spring" and "NAME dashpot"."""
    parts = []
    for item in scene.acting:
        item = item.with_values(**scene.resolved(item))
        names = {p.name for p in item.law.parameters}
        if {"stiffness", "damping"} <= names and item.values["damping"] > 0:
            parts.append((f"{item.name} spring", item.with_values(damping=0.0)))
            parts.append((f"{item.name} dashpot", item.with_values(stiffness=0.0)))
        else:
            parts.append((item.name, item))
    return parts


def power_audit(sim: Simulation, steps: int, drive: str = "bending") -> Audit:
    """Run on for ``steps`` and account for the kinetic energy, law by law.

    In leapfrog, v(+) - v(-) = dt F/m gives exactly d(m v^2/2) = F.(v(+) + v(-))/2 dt in each step. F is
    evaluated anew for each law by the reference integrator's force code, which shares none with the engine,
    at the engine's positions and half-step velocities: a force that the engine adds and no law explains
    stays in ``residual``. Laws of kind constraint and impulse are not divided up; InputError names them.
    """
    from ..validation.reference_forces import Forces

    scene = sim.scene
    for item in scene.laws:
        if item.law.kind in ("constraint", "impulse"):
            raise InputError("does its work inside the solver and cannot be audited", where=f"law {item.name}")
    mass = np.array([b.mass if b.mobile else 0.0 for b in scene.bodies])
    parts = [(name, item.name, Forces(replace(scene, laws=(item,)))) for name, item in law_parts(scene)]
    work = {name: 0.0 for name, _, _ in parts}
    given = 0.0
    sim.advance(1)
    before = sim.raw()
    behind = np.column_stack([before["vx"], before["vy"]])
    start = 0.5 * float((mass[:, None] * behind**2).sum())
    for _ in range(steps):
        sim.advance(1)
        now = sim.raw()
        xy, ahead = np.column_stack([now["x"], now["y"]]), np.column_stack([now["vx"], now["vy"]])
        middle = 0.5 * (ahead + behind)
        driven = 0.0
        for name, law, forces in parts:
            done = float((forces(sim.t, xy, behind) * middle).sum()) * sim.dt
            work[name] += done
            driven += done if law == drive else 0.0
        given += max(driven, 0.0)
        behind = ahead
    kinetic = 0.5 * float((mass[:, None] * behind**2).sum()) - start
    return Audit(work, kinetic, given)


__all__ = ["Audit", "CycleWork", "law_parts", "power_audit", "work_per_cycle"]
