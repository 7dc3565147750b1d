"""Which bodies bear on one another within a segment: derivatives by those that do not are had from one run.

A start number of a disk moves that disk, and those that it comes near to before the segment ends. Bodies that never
come near each other, not even by way of others, can be moved in one run, and each change told apart afterwards by whose
track it is. Of twenty disks on a table some three meet within a segment: twelve runs in place of eighty.
Source: Curtis, Powell & Reid 1974, On the estimation of sparse Jacobian matrices, J. Inst. Math. Appl. 13, 117.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ...scene import Scene
from ..criteria import current
from ..data import Case
from ..hypothesis import NO_CAMERA

AROUND = {"r0", "mean_mass", "wall_gap"}  # what a law may see of bodies other than its own
TIED = ("chain", "joint", "link")  # kinds of laws that tie their bodies together, wherever these are


class Bearing:
    """Who bears on whom within one segment.

    cluster : of each mobile body a number, the same for bodies that bear on one another
    beside : of each body that does not move, the clusters that come near it
    """

    def __init__(self, cluster: Mapping[str, int], beside: Mapping[str, frozenset[int]]) -> None:
        self.cluster, self.beside = cluster, beside

    def of(self, body: str) -> frozenset[int]:
        """Clusters that feel a body's radius or mass."""
        return frozenset({self.cluster[body]}) if body in self.cluster else self.beside.get(body, frozenset())

    @property
    def parted(self) -> bool:
        """Whether some bodies do not bear on others."""
        return len(set(self.cluster.values())) > 1

    def among(self, clusters: frozenset[int], bodies: Sequence[str]) -> np.ndarray:
        """(c,) which of the ``bodies`` belong to ``clusters``."""
        return np.array([self.cluster.get(b, -1) in clusters for b in bodies], dtype=bool)


def together(scene: Scene) -> Bearing:
    """Every body bears on every other one."""
    return Bearing(
        {b.id: 0 for b in scene.bodies if b.mobile}, {b.id: frozenset({0}) for b in scene.bodies if not b.mobile}
    )


def looks_around(scene: Scene) -> bool:
    """Whether a law sees a mean over bodies, or how far walls are: radius or mass of one body then bears on others."""
    return any(AROUND & set(item.law.arguments) for item in scene.laws)


def bearing(case: Case, scene: Scene, camera: Mapping[str, Any], predicted: np.ndarray | None) -> Bearing:
    """Who bears on whom where a segment is ``predicted`` (T, c) as the camera sees it; all, where that is not known."""
    if predicted is None:
        return together(scene)
    mobile = [b for b in scene.bodies if b.mobile]
    column = {(channel.body, channel.kind): k for k, channel in enumerate(case.channels)}
    known = all((b.id, kind) in column for b in mobile for kind in "xy")
    bent = any(camera[name] != NO_CAMERA[name] for name in ("distortion", "foreshortening"))
    tied = any(item.law.kind == "chain" for item in scene.laws)
    if len(mobile) < 3 or len(predicted) < 2 or scene.periodic_x or not known or bent or tied:
        return together(scene)
    fixed = [b for b in scene.bodies if not b.mobile]
    x, y = (np.column_stack([predicted[:, column[b.id, kind]] for b in mobile]) for kind in "xy")
    x, y = x / camera["scale"], y / camera["scale"]
    radius = np.array([b.radius for b in mobile])
    reach = max([0.0, *(float(scene.resolved(item)[item.law.reach]) for item in scene.laws if item.law.reach)])
    beyond = 1.0 + current().segments.spare
    near = _come_near(x, y, beyond * radius + 0.5 * reach)
    row = {b.id: k for k, b in enumerate(mobile)}
    for item in scene.laws:
        if item.law.kind in TIED:
            held = [row[name] for name in item.bodies or () if name in row]
            near[np.ix_(held, held)] = True
    label = connected_components(csr_array(near), directed=False)[1]
    cluster = {b.id: int(label[k]) for k, b in enumerate(mobile)}
    beside = {}
    for b in fixed:
        at = b.initial or (0.0, 0.0)
        px, py = (np.column_stack([v, np.full(len(v), u)]) for v, u in zip((x, y), at, strict=False))
        met = _come_near(px, py, beyond * np.append(radius, b.radius) + 0.5 * reach)[-1, :-1]
        beside[b.id] = frozenset(int(k) for k in label[met])
    return Bearing(cluster, beside)


def _come_near(x: np.ndarray, y: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """(n, n) whether two paths x, y (T, n) come nearer than the sum of radii, between frames as well."""
    dx, dy = x[:, :, None] - x[:, None, :], y[:, :, None] - y[:, None, :]
    apart = np.hypot(dx, dy)
    way = np.hypot(np.diff(dx, axis=0), np.diff(dy, axis=0))
    longest = way.copy()
    longest[1:] = np.maximum(longest[1:], way[:-1])
    longest[:-1] = np.maximum(longest[:-1], way[1:])
    # a path of length s between two places a and b away from a point passes it at (a + b - s)/2 at the nearest; the
    # segment goes on to the next frame
    longest *= current().segments.path
    least = np.minimum(0.5 * (apart[1:] + apart[:-1] - longest).min(axis=0), apart[-1] - longest[-1])
    return np.asarray(least < radius[:, None] + radius[None, :])


def coloured(sets: Sequence[Sequence[frozenset[int]]]) -> list[list[int]]:
    """Items in groups, no two of a group feel each other: sets[item][segment] are the clusters that feel it. Greedy."""
    groups: list[list[int]] = []
    taken: list[list[set[int]]] = []
    for item in sorted(range(len(sets)), key=lambda k: -sum(map(len, sets[k]))):
        for group, busy in zip(groups, taken, strict=True):
            if all(not (b & s) for b, s in zip(busy, sets[item], strict=True)):
                group.append(item)
                for b, s in zip(busy, sets[item], strict=True):
                    b |= s
                break
        else:
            groups.append([item])
            taken.append([set(s) for s in sets[item]])
    return groups
