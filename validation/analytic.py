"""Closed solutions, and the linearised swimmer. No code of the engine or of the reference. SI throughout."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.special import ellipk


def contact_frequency(stiffness: float, damping: float, reduced_mass: float) -> float:
    """omega = sqrt(k/m_r - gamma^2/4) [rad/s] of the overlap, m_r x'' = -k x - gamma m_r x'."""
    square = stiffness / reduced_mass - damping**2 / 4
    if square <= 0:
        raise ValueError("overdamped: such a contact never ends")
    return math.sqrt(square)


def linear_restitution(stiffness: float, damping: float, reduced_mass: float) -> float:
    """e = exp(-gamma pi/(2 omega)).

    The overlap is v/omega exp(-gamma t/2) sin(omega t); the bodies part when it is zero again, although
    the force has been attractive for a moment before.
    """
    return math.exp(-damping * math.pi / (2 * contact_frequency(stiffness, damping, reduced_mass)))


def linear_duration(stiffness: float, damping: float, reduced_mass: float) -> float:
    """T = pi/omega [s], whatever the speed."""
    return math.pi / contact_frequency(stiffness, damping, reduced_mass)


def hertz_duration(stiffness: float, reduced_mass: float, speed: float) -> float:
    """T = 2 delta/v int_0^1 ds/sqrt(1 - s^(5/2)), delta = (5 m_r v^2/(4 k))^(2/5) [s]: T ~ v^(-1/5).

    Source: Landau & Lifshitz, Theory of Elasticity, section 9, problem 1.
    """
    deepest = (5 * reduced_mass * speed**2 / (4 * stiffness)) ** 0.4
    # s = 1 - u^2 takes the singularity away
    integral = quad(lambda u: 2 * u / math.sqrt(1 - (1 - u * u) ** 2.5) if u else 2 / math.sqrt(2.5), 0, 1)[0]
    return 2 * deepest / speed * float(integral)


def pendulum_period(
    length: float, gravity: float, amplitude: float, mass: float = 1.0, inertia: float = 0.0
) -> float:
    """T = 4 sqrt((m L^2 + I)/(m g L)) K(sin(theta_0/2)) [s], K the complete elliptic integral."""
    slow = math.sqrt((mass * length**2 + inertia) / (mass * gravity * length))
    return 4 * slow * float(ellipk(math.sin(amplitude / 2) ** 2))


def chain_stiffness(n: int, stiffness: float) -> np.ndarray:
    """(n, n) [N/m] of n masses joined by n - 1 springs along a line: force = -K u."""
    gap = np.diff(np.eye(n), axis=0)
    return stiffness * gap.T @ gap


def bending_stiffness(n: int, stiffness: float, length: float, form: str) -> np.ndarray:
    """(n, n) [N/m] of sideways displacements w of a straight chain with its head axis held: force = -K w.

    alpha = D w/d with D the differences of neighbours. ``leader``: the bend phi = C alpha (C the
    differences again, the head's axis before the first) pushes disk s + 1 by -k_B phi_s and disk s
    back: K = k_B/d D^T C D. ``elastic``: of the energy k_B d/2 |phi|^2: K = k_B/d D^T C^T C D.
    ``head_axis``: phi = alpha: K = k_B/d D^T D. Of these only ``leader`` is not symmetric.
    """
    differences = np.diff(np.eye(n), axis=0)
    to_bend = np.eye(n - 1) - np.eye(n - 1, k=-1)
    middle = {"leader": to_bend, "elastic": to_bend.T @ to_bend, "head_axis": np.eye(n - 1)}[form]
    return stiffness / length * differences.T @ middle @ differences


def chain_damping(mass: np.ndarray, damping: float) -> np.ndarray:
    """(n, n) [kg/s] of dashpots gamma m_r between neighbours."""
    gap = np.diff(np.eye(len(mass)), axis=0)
    reduced = mass[1:] * mass[:-1] / (mass[1:] + mass[:-1])
    return gap.T @ np.diag(damping * reduced) @ gap


def modes(stiffness: np.ndarray, mass: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angular frequencies (k,) [rad/s], shapes (k, n) and their duals (k, n), without the rigid ones.

    For M u'' = -K u. ``duals[a] @ shapes[b]`` is one for a = b, else zero: the dual picks a mode's share
    out of a displacement, also where K is not symmetric.
    """
    values, vectors = np.linalg.eig(stiffness / mass[:, None])
    if np.abs(values.imag).max() > 1e-9 * np.abs(values).max():
        raise ValueError("a mode does not just oscillate")
    duals = np.linalg.inv(vectors).real
    shapes = vectors.real.T
    order = np.argsort(values.real)
    order = order[values.real[order] > 1e-9 * values.real.max()]
    return np.sqrt(values.real[order]), shapes[order], duals[order]


def linear_motion(
    stiffness: np.ndarray, damping: np.ndarray, mass: np.ndarray, start: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """(T, n) displacements [m] of M u'' = -K u - C u' from rest at ``start`` (n,), by matrix exponential."""
    n = len(mass)
    system = np.zeros((2 * n, 2 * n))
    system[:n, n:] = np.eye(n)
    system[n:, :n] = -stiffness / mass[:, None]
    system[n:, n:] = -damping / mass[:, None]
    state = np.concatenate([start, np.zeros(n)])
    return np.array([(expm(system * t) @ state)[:n] for t in times])
