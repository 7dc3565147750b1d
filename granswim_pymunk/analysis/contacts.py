"""Who touches whom, with what force, and in which directions.

Works on positions and velocities alone: of a simulation, a stored trajectory or tracks from elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..engine import Contacts
from ..errors import InputError
from ..scene import Scene


def touching_pairs(
    xy: np.ndarray, radius: np.ndarray, period: float | None = None, gap: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs with |r_j - r_i| < r_i + r_j + gap, by minimum image along a periodic x.

    xy : (n, 2) [m];  radius : (n,) [m];  period : length of a periodic x [m]
    Returns i < j (k,), (k,) rows and r_j - r_i (k, 2) [m], in rising order of (i, j).
    """
    xy = np.asarray(xy, dtype=float)
    points = xy - xy.min(axis=0)
    box = None
    if period:
        points[:, 0] %= period
        points[points[:, 0] >= period, 0] = 0.0
        box = [period, 4 * (float(points[:, 1].max()) + 4 * float(radius.max()) + gap)]
    pairs = cKDTree(points, boxsize=box).query_pairs(2 * float(radius.max()) + gap, output_type="ndarray")
    i, j = pairs.min(axis=1), pairs.max(axis=1)
    branch = xy[j] - xy[i]
    if period:
        branch[:, 0] -= period * np.round(branch[:, 0] / period)
    near = np.einsum("ij,ij->i", branch, branch) < (radius[i] + radius[j] + gap) ** 2
    i, j, branch = i[near], j[near], branch[near]
    order = np.lexsort((j, i))
    return i[order].astype(np.int64), j[order].astype(np.int64), branch[order]


class ContactFinder:
    """The touching pairs of a scene's bodies with the normal force that its contact laws give them.

    ``finder(xy, v, t)`` takes xy (n, 2) [m] and v (n, 2) [m/s], rows of ``scene.bodies``. Pairs of walls and
    pairs within one swimmer are left out, as in the engine. Laws that turn bodies (contact friction) give
    their normal part only. Raises InputError where the shapes do not fit.
    """

    def __init__(self, scene: Scene) -> None:
        self.period = scene.periodic_x
        self.radius = np.array([b.radius for b in scene.bodies])
        self.mobile = np.array([b.mobile for b in scene.bodies])
        self.inverse = np.where(self.mobile, 1.0 / np.array([b.mass for b in scene.bodies]), 0.0)
        self.chain = np.full(len(scene.bodies), -1)
        for number, rows in enumerate(scene.chains):
            self.chain[list(rows)] = number
        self.laws = []
        for item in scene.acting:
            if item.law.kind == "pair" and not item.law.reach:
                acts = np.zeros(len(scene.bodies), dtype=bool)
                acts[scene.rows(item)] = True
                self.laws.append((item.law, scene.resolved(item), acts, float(self.radius[acts].mean())))

    def __call__(self, xy: np.ndarray, v: np.ndarray, t: float = 0.0) -> Contacts:
        n = len(self.radius)
        if np.shape(xy) != (n, 2) or np.shape(v) != (n, 2):
            raise InputError(f"xy and v should have the shape ({n}, 2), got {np.shape(xy)} and {np.shape(v)}")
        radius, inverse = self.radius, self.inverse
        i, j, branch = touching_pairs(xy, radius, self.period)
        kept = (self.mobile[i] | self.mobile[j]) & ~((self.chain[i] >= 0) & (self.chain[i] == self.chain[j]))
        i, j, branch = i[kept], j[kept], branch[kept]
        distance = np.hypot(branch[:, 0], branch[:, 1])
        normal = branch / np.where(distance > 0, distance, 1.0)[:, None]
        relative = v[j] - v[i]
        state = {
            "gap": distance - radius[i] - radius[j],
            "distance": distance,
            "vn": np.einsum("ij,ij->i", relative, normal),
            "vt": relative[:, 1] * normal[:, 0] - relative[:, 0] * normal[:, 1],
            "reduced_mass": 1.0 / (inverse[i] + inverse[j]),
            "reduced_radius": radius[i] * radius[j] / (radius[i] + radius[j]),
            "t": np.full(len(i), t),
        }
        force = np.zeros(len(i))
        for law, values, acts, mean_radius in self.laws:
            state["r0"] = np.full(len(i), mean_radius)
            on = acts[i] & acts[j]
            if law.name == "contact_linear":
                push = law.function(*(state[a] if a in state else values[a] for a in law.arguments))[0]
                force += np.where(on, push, 0.0)
                continue
            # a law's function is written for one pair
            for k in np.flatnonzero(on):
                force[k] += law.function(*(state[a][k] if a in state else values[a] for a in law.arguments))[0]
        return Contacts(i, j, normal, force, -state["gap"])


def find_contacts(scene: Scene, xy: np.ndarray, v: np.ndarray, t: float = 0.0) -> Contacts:
    """The contacts of one snapshot of a scene; of many, keep a ``ContactFinder``."""
    return ContactFinder(scene)(xy, v, t)


@dataclass(frozen=True)
class Directions:
    """Histograms of the directions of contact forces on some bodies.

    edges : (bins + 1,) [rad], from -pi to pi, counter-clockwise from +x
    count : (bodies, bins) number of contacts;  force : (bodies, bins) sum of force sizes [N]
    """

    edges: np.ndarray
    count: np.ndarray
    force: np.ndarray

    def __add__(self, other: Directions) -> Directions:
        return Directions(self.edges, self.count + other.count, self.force + other.force)


def contact_directions(
    contacts: Contacts, bodies: Sequence[int], bins: int = 36, axis: float = 0.0
) -> Directions:
    """In which directions contacts push these bodies (rows): the force ON the body, repulsive ones only.

    ``axis`` [rad] is subtracted from the directions: with the heading of a swimmer they count from it.
    """
    edges = np.linspace(-np.pi, np.pi, bins + 1)
    count = np.zeros((len(bodies), bins))
    force = np.zeros((len(bodies), bins))
    push = contacts.force > 0
    angle_j = np.arctan2(contacts.normal[:, 1], contacts.normal[:, 0])
    for row, body in enumerate(bodies):
        for mine, turn in ((contacts.j == body, 0.0), (contacts.i == body, np.pi)):
            chosen = mine & push
            angle = np.mod(angle_j[chosen] + turn - axis + np.pi, 2 * np.pi) - np.pi
            count[row] += np.histogram(angle, edges)[0]
            force[row] += np.histogram(angle, edges, weights=contacts.force[chosen])[0]
    return Directions(edges, count, force)


def mean_direction(edges: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Sum of weighted unit vectors over the sum of weights, (..., 2): how one-sided a histogram is, and where to.

    weight : (..., bins)
    """
    middle = 0.5 * (edges[1:] + edges[:-1])
    total = weight.sum(axis=-1)
    unit = np.stack([np.cos(middle), np.sin(middle)], axis=-1)
    return (weight @ unit) / np.where(total > 0, total, 1.0)[..., None]


__all__ = ["ContactFinder", "Directions", "contact_directions", "find_contacts", "mean_direction", "touching_pairs"]
