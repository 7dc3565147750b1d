"""The contact network: coordination number, fabric tensor, anisotropy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Network:
    """Averages over the contacts of a bed.

    coordination : contacts per body, F_1 + F_2 of the fabric F = (1/N) sum over bodies and contacts n n
    anisotropy : (F_1 - F_2)/(F_1 + F_2), eigenvalues F_1 >= F_2;  direction : of F_1 [rad], in (-pi/2, pi/2]
    fabric : (2, 2)
    branch_trace, branch_anisotropy : the same of R = sum of r_ij r_ij, each contact once, as the paper writes it:
        its trace is an area [m^2], not a number of contacts
    floaters : share of the bodies without any contact
    """

    coordination: float
    anisotropy: float
    direction: float
    fabric: np.ndarray
    branch_trace: float
    branch_anisotropy: float
    floaters: float


def contact_network(i: np.ndarray, j: np.ndarray, branch: np.ndarray, bodies: np.ndarray) -> Network:
    """Fabric of the contacts i, j (k,) rows with branch vectors r_j - r_i (k, 2) [m].

    bodies : rows that count; a contact with another body (a wall) counts once, for the one that does.
    Source: appendix C of the paper; the normalised form is that of Satake 1982 and Madadi et al. 2004,
    doi:10.1007/s10035-004-0162-4.
    """
    bodies = np.asarray(bodies)
    weight = np.isin(i, bodies).astype(float) + np.isin(j, bodies)
    kept = weight > 0
    weight, branch = weight[kept], branch[kept]
    length = np.hypot(branch[:, 0], branch[:, 1])
    normal = branch / np.where(length > 0, length, 1.0)[:, None]
    count = max(len(bodies), 1)
    fabric = np.einsum("k,ka,kb->ab", weight, normal, normal) / count
    branches = 0.5 * np.einsum("k,ka,kb->ab", weight, branch, branch)
    degree = np.bincount(np.concatenate([i[kept], j[kept]]), minlength=int(bodies.max(initial=0)) + 1)
    trace, spread, direction = _principal(fabric)
    branch_trace, branch_spread, _ = _principal(branches)
    return Network(
        coordination=trace,
        anisotropy=spread / trace if trace > 0 else 0.0,
        direction=direction,
        fabric=fabric,
        branch_trace=branch_trace,
        branch_anisotropy=branch_spread / branch_trace if branch_trace > 0 else 0.0,
        floaters=float(np.mean(degree[bodies] == 0)) if len(bodies) else 0.0,
    )


def _principal(tensor: np.ndarray) -> tuple[float, float, float]:
    """Trace, difference of the eigenvalues, direction of the larger one of a symmetric (2, 2)."""
    values, vectors = np.linalg.eigh(tensor)
    x, y = vectors[:, 1]
    angle = float(np.arctan2(y, x))
    angle = angle - np.pi if angle > np.pi / 2 else angle + np.pi if angle <= -np.pi / 2 else angle
    return float(values.sum()), float(values[1] - values[0]), angle


__all__ = ["Network", "contact_network"]
