"""Vibration modes of the swimmer: of the paper's chain, and of the bending law that is simulated."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from ..engine.swimmers import swimmer_forces
from ..errors import InputError
from ..scene import Scene

# appendix A of the paper, as printed: label k_B, damping ratio, natural and resonant angular frequency of modes 1, 2
PRINTED = (
    (100.0, 0.29, (26.37, 62.59), (23.96, 56.91)),
    (150.0, 0.24, (32.30, 76.66), (30.38, 72.09)),
    (200.0, 0.20, (37.30, 88.52), (35.65, 84.60)),
    (500.0, 0.13, (58.98, 139.96), (57.95, 137.51)),
)
# the mass that gives all eight printed natural frequencies, in the paper's grams: a sphere of 980 kg/m^3
PRINTED_MASS = 0.013854
PRINTED_DAMPING = 1.0e2  # 1/s; with the printed 1e3 the damping ratio would be 2.9, and nothing would resonate


def chain_frequencies(stiffness: float, masses: np.ndarray) -> np.ndarray:
    """Natural angular frequencies of masses in a row, joined by equal springs: K u = omega^2 M u.

    stiffness k, masses (n,): any units that give k/m in 1/s^2. Returns the n - 1 frequencies above zero, rising
    (the chain as a whole moves freely). Source: appendix A of the paper.
    """
    n = len(masses)
    matrix = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    matrix[0, 0] = matrix[-1, -1] = 1.0
    squares = eigh(stiffness * matrix, np.diag(np.asarray(masses, dtype=float)), eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0))[1:]


def swimmer_masses(mass: float, disks: int = 7, head_factor: float = 7.0) -> np.ndarray:
    """(disks,) masses of a swimmer, head first."""
    masses = np.full(disks, mass)
    masses[0] *= head_factor
    return masses


def damping_ratio(stiffness: float, mass: float, damping: float) -> float:
    """xi = c/(2 sqrt(m k)) with c = gamma m_r, m_r = m/2 of two tail disks."""
    return damping * (mass / 2) / (2 * math.sqrt(mass * stiffness))


def resonant(natural: np.ndarray | float, xi: float) -> np.ndarray | float:
    """omega_r = omega_0 sqrt(1 - 2 xi^2); NaN where xi > 1/sqrt(2), as there is no resonance."""
    inside = 1 - 2 * xi * xi
    return natural * (math.sqrt(inside) if inside >= 0 else math.nan)


@dataclass(frozen=True)
class TableRow:
    """One mode of the paper's table [rad/s]; ``stated`` uses the printed xi, ``computed`` the exact one."""

    label: float
    mode: int
    xi_printed: float
    xi: float
    natural_printed: float
    natural: float
    resonant_printed: float
    resonant_stated: float
    resonant_computed: float

    @property
    def natural_agrees(self) -> bool:
        return f"{self.natural:.2f}" == f"{self.natural_printed:.2f}"

    @property
    def misprints(self) -> tuple[str, ...]:
        found = []
        if f"{self.xi:.2f}" != f"{self.xi_printed:.2f}":
            found.append(f"xi is {self.xi:.3f}, printed {self.xi_printed:.2f}")
        if not self.natural_agrees:
            found.append(f"omega_0 is {self.natural:.2f}, printed {self.natural_printed:.2f}")
        if f"{self.resonant_computed:.2f}" != f"{self.resonant_printed:.2f}":
            found.append(
                f"omega_r is {self.resonant_computed:.2f} ({self.resonant_stated:.2f} with the printed xi), "
                f"printed {self.resonant_printed:.2f}"
            )
        return tuple(found)


def resonance_table(mass: float = PRINTED_MASS, damping: float = PRINTED_DAMPING) -> list[TableRow]:
    """The paper's table, computed: a chain of seven, head seven times as heavy, in the paper's grams."""
    rows = []
    for label, xi_printed, natural_printed, resonant_printed in PRINTED:
        natural = chain_frequencies(label, swimmer_masses(mass))
        xi = damping_ratio(label, mass, damping)
        for mode in (0, 1):
            omega = float(natural[mode])
            rows.append(
                TableRow(
                    label, mode + 1, xi_printed, xi, natural_printed[mode], omega, resonant_printed[mode],
                    float(resonant(omega, xi_printed)), float(resonant(omega, xi)),
                )
            )  # fmt: skip
    return rows


def second_resonance(label: float) -> float:
    """The frequency [Hz] at which the paper expects the optimum: its table's second resonant mode."""
    for row in resonance_table():
        if row.label == label and row.mode == 2:
            return row.resonant_computed / (2 * math.pi)
    natural = chain_frequencies(label, swimmer_masses(PRINTED_MASS))[1]
    return float(resonant(natural, damping_ratio(label, PRINTED_MASS, PRINTED_DAMPING))) / (2 * math.pi)


@dataclass(frozen=True)
class Modes:
    """Transverse modes of a straight swimmer in nothing, slowest first.

    natural : |lambda|/2 pi [Hz] of the law without its damping
    ratio : damping ratio of the damped modes, -Re(lambda)/|lambda|;  damped : |Im lambda|/2 pi [Hz]
    shapes : (modes, n) transverse displacements, largest 1
    """

    natural: np.ndarray
    damped: np.ndarray
    ratio: np.ndarray
    shapes: np.ndarray


def linearised_modes(scene: Scene) -> Modes:
    """Modes of the scene's chain laws about the straight swimmer at rest with its head axis along it.

    M y'' = -K y - C y': K and C are the derivatives of the laws' own functions by transverse displacement and
    velocity (central differences), so any law of kind chain counts. Raises InputError without a swimmer.
    """
    if not scene.chains:
        raise InputError("has no swimmer", where="scene")
    rows = list(scene.chains[0])
    bodies = [scene.bodies[k] for k in rows]
    mass = np.array([b.mass for b in bodies])
    n = len(rows)
    laws = [item for item in scene.laws if item.law.kind == "chain" and item.law.series is None]
    spacing = 2 * bodies[0].radius
    for item in scene.laws_named("union"):
        spacing = float(scene.resolved(item)["length"])
    x = np.arange(n) * spacing

    def transverse(y: np.ndarray, vy: np.ndarray) -> np.ndarray:
        xy, v = np.column_stack([x, y]), np.column_stack([np.zeros(n), vy])
        # the head axis points along the chain at t = 0
        forces = [swimmer_forces(item.law, scene.resolved(item), 0.0, xy, v, mass)[1] for item in laws]
        return np.sum([np.zeros(n), *forces], axis=0)

    small_y, small_v = 1e-6 * spacing, 1e-6
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
    zero = np.zeros(n)
    for k in range(n):
        step = np.zeros(n)
        step[k] = 1.0
        stiffness[:, k] = -(transverse(small_y * step, zero) - transverse(-small_y * step, zero)) / (2 * small_y)
        damping[:, k] = -(transverse(zero, small_v * step) - transverse(zero, -small_v * step)) / (2 * small_v)
    weight = 1 / mass[:, None]
    squares, vectors = np.linalg.eig(weight * stiffness)
    order = np.argsort(np.abs(squares))[1:]  # the first is the free motion of the whole
    natural = np.sqrt(np.abs(squares[order])) / (2 * math.pi)
    shapes = np.real(vectors[:, order]).T
    shapes = shapes / shapes[np.arange(len(order)), np.abs(shapes).argmax(axis=1)][:, None]
    full = np.block([[np.zeros((n, n)), np.eye(n)], [-weight * stiffness, -weight * damping]])
    roots = np.linalg.eigvals(full)
    roots = roots[(np.abs(roots) > 1e-3 * 2 * math.pi * natural[0]) & (roots.imag >= 0)]
    roots = roots[np.argsort(np.abs(roots))]
    return Modes(natural, np.abs(roots.imag) / (2 * math.pi), -roots.real / np.abs(roots), shapes)


__all__ = [
    "PRINTED", "Modes", "TableRow", "chain_frequencies", "damping_ratio", "linearised_modes", "resonance_table",
    "resonant", "second_resonance", "swimmer_masses",
]  # fmt: skip
