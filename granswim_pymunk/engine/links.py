"""Hinges and rods: the forces with which the coming drift leaves no gap, for all of them together.

Positions at the end of the coming drift are q + dt (v + dt M^-1 (f + J(q)^T lambda)); Newton's method finds the
multipliers lambda [N] that close every link there. It begins at zero in each step, so a run that goes on from a
checkpoint takes the same steps. Without dampings this is SHAKE with leapfrog: symplectic and reversible.
Source: Ryckaert, Ciccotti & Berendsen 1977, J. Comput. Phys. 23, 327; doi:10.1016/0021-9991(77)90098-5
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..compiled import njit
from ..errors import InputError
from ..scene import Scene

HINGE, ROD = 0, 1
# columns of ``geometry``: the hinge in the axes of body i, and of body j (in the scene, where j is the world); of a
# rod the length stands first, the place in the scene where the second point would
GEOMETRY = ("a_x", "a_y", "b_x", "b_y")
MOST_ROUNDS = 30
HELD = 1e-14  # of the longest arm: a link is closed


@njit(cache=True, error_model="numpy", nogil=True)
def gaps(kind, first, second, geometry, q, gap, arms):
    """Gaps (m,) [m] of the links at places ``q`` (B, 3) x, y [m], angle [rad]; arms of the forces (L, 4) there."""
    row = 0
    for k in range(kind.shape[0]):
        i = first[k]
        j = second[k]
        if kind[k] == HINGE:
            c = math.cos(q[i, 2])
            s = math.sin(q[i, 2])
            ax = c * geometry[k, 0] - s * geometry[k, 1]
            ay = s * geometry[k, 0] + c * geometry[k, 1]
            bx = geometry[k, 2]
            by = geometry[k, 3]
            x = -q[i, 0] - ax
            y = -q[i, 1] - ay
            if j >= 0:
                c = math.cos(q[j, 2])
                s = math.sin(q[j, 2])
                bx = c * geometry[k, 2] - s * geometry[k, 3]
                by = s * geometry[k, 2] + c * geometry[k, 3]
                x += q[j, 0]
                y += q[j, 1]
            gap[row] = x + bx
            gap[row + 1] = y + by
            arms[k, 0] = ax
            arms[k, 1] = ay
            arms[k, 2] = bx
            arms[k, 3] = by
            row += 2
        else:
            length = geometry[k, 0]
            x = (q[j, 0] if j >= 0 else geometry[k, 2]) - q[i, 0]
            y = (q[j, 1] if j >= 0 else geometry[k, 3]) - q[i, 1]
            gap[row] = (x * x + y * y - length * length) / (2.0 * length)
            arms[k, 0] = x / length
            arms[k, 1] = y / length
            row += 1


@njit(cache=True, error_model="numpy", nogil=True)
def rows_of(kind, first, second, arms, out):
    """Gradients (m, B, 3) of the gaps with respect to the places, from the arms."""
    out[:] = 0.0
    row = 0
    for k in range(kind.shape[0]):
        i = first[k]
        j = second[k]
        if kind[k] == HINGE:
            out[row, i, 0] = -1.0
            out[row, i, 2] = arms[k, 1]
            out[row + 1, i, 1] = -1.0
            out[row + 1, i, 2] = -arms[k, 0]
            if j >= 0:
                out[row, j, 0] = 1.0
                out[row, j, 2] = -arms[k, 3]
                out[row + 1, j, 1] = 1.0
                out[row + 1, j, 2] = arms[k, 2]
            row += 2
        else:
            out[row, i, 0] = -arms[k, 0]
            out[row, i, 1] = -arms[k, 1]
            if j >= 0:
                out[row, j, 0] = arms[k, 0]
                out[row, j, 1] = arms[k, 1]
            row += 1


@njit(cache=True, error_model="numpy", nogil=True)
def eliminate(matrix, right):
    """Solve in place by Gauss with pivots; rows that say nothing new (a loop of rods) get zero."""
    m = right.shape[0]
    largest = 0.0
    for r in range(m):
        largest = max(largest, abs(matrix[r, r]))
    for c in range(m):
        best = c
        for r in range(c + 1, m):
            if abs(matrix[r, c]) > abs(matrix[best, c]):
                best = r
        if best != c:
            for k in range(c, m):
                matrix[c, k], matrix[best, k] = matrix[best, k], matrix[c, k]
            right[c], right[best] = right[best], right[c]
        if abs(matrix[c, c]) <= 1e-13 * largest:
            continue
        for r in range(c + 1, m):
            share = matrix[r, c] / matrix[c, c]
            if share != 0.0:
                for k in range(c + 1, m):
                    matrix[r, k] -= share * matrix[c, k]
                right[r] -= share * right[c]
    for c in range(m - 1, -1, -1):
        if abs(matrix[c, c]) <= 1e-13 * largest:
            right[c] = 0.0
            continue
        total = right[c]
        for k in range(c + 1, m):
            total -= matrix[c, k] * right[k]
        right[c] = total / matrix[c, c]


@njit(cache=True, error_model="numpy", nogil=True)
def close(kind, first, second, geometry, mobility, size, q, trial, scale, gap, arms, here, there, matrix, push):
    """Move ``trial`` (B, 3) by scale M^-1 J(q)^T lambda so that every link is closed.

    ``mobility`` (B, 4): the inverse mass tensor xx, xy, yy [1/kg] and inverse moment [1/(kg m^2)]; ``size`` [m] that
    of the longest arm; ``push`` (B, 3): J^T lambda, forces [N] and torques [N m] where ``scale`` is dt^2.
    Returns whether it could. The rest are work arrays.
    """
    count = q.shape[0]
    m = gap.shape[0]
    gaps(kind, first, second, geometry, q, gap, arms)
    rows_of(kind, first, second, arms, here)
    push[:] = 0.0
    before = math.inf
    for _ in range(MOST_ROUNDS):
        gaps(kind, first, second, geometry, trial, gap, arms)
        worst = 0.0
        for r in range(m):
            worst = max(worst, abs(gap[r]))
        if not math.isfinite(worst):
            return False
        # down to rounding
        if worst <= HELD * size or (worst <= 1e-10 * size and worst > 0.5 * before):
            return True
        before = worst
        rows_of(kind, first, second, arms, there)
        for r in range(m):
            for c in range(m):
                total = 0.0
                for b in range(count):
                    x = here[c, b, 0]
                    y = here[c, b, 1]
                    turn = here[c, b, 2]
                    if x != 0.0 or y != 0.0 or turn != 0.0:
                        total += there[r, b, 0] * (mobility[b, 0] * x + mobility[b, 1] * y)
                        total += there[r, b, 1] * (mobility[b, 1] * x + mobility[b, 2] * y)
                        total += there[r, b, 2] * mobility[b, 3] * turn
                matrix[r, c] = scale * total
            gap[r] = -gap[r]
        eliminate(matrix, gap)
        for b in range(count):
            x = 0.0
            y = 0.0
            turn = 0.0
            for c in range(m):
                x += here[c, b, 0] * gap[c]
                y += here[c, b, 1] * gap[c]
                turn += here[c, b, 2] * gap[c]
            push[b, 0] += x
            push[b, 1] += y
            push[b, 2] += turn
            trial[b, 0] += scale * (mobility[b, 0] * x + mobility[b, 1] * y)
            trial[b, 1] += scale * (mobility[b, 1] * x + mobility[b, 2] * y)
            trial[b, 2] += scale * mobility[b, 3] * turn
    return False


def work_arrays(bodies: int, links: int, rows: int) -> tuple[np.ndarray, ...]:
    """What ``close`` works in: gap, arms, here, there, matrix, push, and places q, trial."""
    return (
        np.zeros(rows), np.zeros((links, 4)), np.zeros((rows, bodies, 3)), np.zeros((rows, bodies, 3)),
        np.zeros((rows, rows)), np.zeros((bodies, 3)), np.zeros((bodies, 3)), np.zeros((bodies, 3)),
    )  # fmt: skip


@dataclass(frozen=True)
class Links:
    """The hinges and rods of a scene, for the bodies that they join.

    rows : (B,) inner rows of the joined bodies;  kind, first, second : (L,) of each link, bodies by their place in
    ``rows``, -1 the world;  geometry : (L, 4);  mobility : (B, 4), see ``close``;  size [m];  rows_held : gaps in all
    apart : pairs of inner rows i < j that never touch, as i n + j
    """

    rows: np.ndarray
    kind: np.ndarray
    first: np.ndarray
    second: np.ndarray
    geometry: np.ndarray
    mobility: np.ndarray
    size: float
    rows_held: int
    work: tuple[np.ndarray, ...]

    def hold(
        self, dt: float, q: np.ndarray, v: np.ndarray, force: np.ndarray, inverse: np.ndarray
    ) -> np.ndarray | None:
        """(B, 3) forces [N] and torques [N m] of the links, None where they cannot be closed.

        q, v, force (B, 3): places and angles, half-step velocities, all other forces and torques; ``inverse`` (B, 3)
        what these are multiplied by in a kick.
        """
        trial = q + dt * (v + dt * inverse * force)
        fixed = self.mobility[:, 3] == 0.0
        trial[fixed, 2] = q[fixed, 2]
        push = self.work[5]
        return push.copy() if self._close(q, trial, dt * dt) else None

    def _close(self, q: np.ndarray, trial: np.ndarray, scale: float) -> bool:
        return bool(
            close(
                self.kind, self.first, self.second, self.geometry, self.mobility, self.size, q, trial, scale,
                *self.work[:6],
            )
        )  # fmt: skip

    def closed(self, q: np.ndarray) -> tuple[np.ndarray, float]:
        """Places (B, 3) with every link closed, the nearest by their masses, and the largest gap before [m]."""
        gaps(self.kind, self.first, self.second, self.geometry, q, self.work[0], self.work[1])
        worst = float(np.abs(self.work[0]).max())
        trial = q.copy()
        self._close(q, trial, 1.0)
        return trial, worst


def no_links() -> Links:
    none, flat = np.zeros(0, dtype=np.int64), np.zeros((0, 4))
    return Links(none, none, none, none, flat, flat, 1.0, 0, work_arrays(0, 0, 0))


def linked_rows(scene: Scene) -> list[int]:
    """Rows of the scene's mobile bodies in hinges and rods."""
    names = {name for item in scene.links for name in item.bodies or ()}
    return [k for k, body in enumerate(scene.bodies) if body.id in names and body.mobile]


def links_of(scene: Scene, inner: np.ndarray) -> Links:
    """The links of a scene; ``inner`` (n,) maps its rows to the engine's. Pins of the joined bodies are among them.

    Raises InputError where a joined body has a pin and an inertia of its own, whose rod would turn with it.
    """
    rows = linked_rows(scene)
    at = {scene.bodies[row].id: k for k, row in enumerate(rows)}
    fixed = {b.id: np.array(b.initial[:2]) for b in scene.bodies if not b.mobile and b.initial is not None}
    kind, first, second, geometry = [], [], [], []
    for item in scene.laws:
        values, bodies = item.values, item.bodies or ()
        if item.name == "hinge":
            points = [np.array(values["anchor_a"]), np.array(values["anchor_b"])][: len(bodies)]
            if len(bodies) == 2 and bodies[0] in fixed:
                bodies, points = bodies[::-1], points[::-1]
            if len(bodies) == 1:
                other, there = -1, np.array(values["anchor"])
            elif bodies[1] in fixed:
                other, there = -1, fixed[bodies[1]] + points[1]
            else:
                other, there = at[bodies[1]], points[1]
            kind.append(HINGE)
            first.append(at[bodies[0]])
            second.append(other)
            geometry.append((*points[0], *there))
        elif item.name == "rod":
            if bodies[0] in fixed:
                bodies = bodies[::-1]
            there = fixed.get(bodies[1], np.zeros(2))
            kind.append(ROD)
            first.append(at[bodies[0]])
            second.append(-1 if bodies[1] in fixed else at[bodies[1]])
            geometry.append((values["length"], 0.0, *there))
        elif item.name == "pin":
            for name in bodies:
                if name not in at:
                    continue
                if scene.body(name).inertia is not None:
                    raise InputError(
                        "is in a hinge or rod too and has an inertia: hang it by a hinge", where=f"law pin, body {name}"
                    )
                kind.append(ROD)
                first.append(at[name])
                second.append(-1)
                geometry.append((values["length"], 0.0, *values["anchor"]))
    table = np.array(geometry, dtype=float).reshape(-1, len(GEOMETRY))
    mobility = np.array([_mobility(scene, row) for row in rows], dtype=float).reshape(-1, 4)
    arms = [math.hypot(*g[:2]) for g in geometry]
    arms += [math.hypot(*g[2:]) for g, j in zip(geometry, second, strict=True) if j >= 0]
    held = sum(2 if k == HINGE else 1 for k in kind)
    return Links(
        rows=inner[rows] if rows else np.zeros(0, dtype=np.int64),
        kind=np.array(kind, dtype=np.int64), first=np.array(first, dtype=np.int64),
        second=np.array(second, dtype=np.int64), geometry=table, mobility=mobility, size=max(arms, default=0.0) or 1.0,
        rows_held=held, work=work_arrays(len(rows), len(kind), held),
    )  # fmt: skip


def _mobility(scene: Scene, row: int) -> tuple[float, float, float, float]:
    """Inverse mass tensor xx, xy, yy [1/kg] and inverse moment [1/(kg m^2)]: what rail and drive leave of them."""
    body = scene.bodies[row]
    heavy = body.mass
    direction: np.ndarray | None = None
    for item in scene.laws:
        if item.law.kind != "constraint" or row not in scene.rows(item):
            continue
        if item.name == "drive":
            return 0.0, 0.0, 0.0, 0.0
        if item.name == "added_mass":
            heavy *= 1 + item.values["beta"]
        elif item.name == "rail":
            direction = np.array(item.values["direction"]) / math.hypot(*item.values["direction"])
        elif item.name != "pin":
            raise InputError("cannot be combined with hinges and rods", where=f"law {item.name}, body {body.id}")
    if direction is None:
        return 1 / heavy, 0.0, 1 / heavy, 1 / body.moment
    x, y = direction
    return x * x / heavy, x * y / heavy, y * y / heavy, 0.0
