"""A plain DEM loop: arrays, a neighbour list, leapfrog; what the bench costs without Chipmunk.

Contacts (linear spring-dashpot) and drag only. Shares no code with the engine.
"""

from __future__ import annotations

import math

import numpy as np

from granswim_pymunk.compiled import njit
from granswim_pymunk.errors import SimulationError
from granswim_pymunk.scene import Scene


@njit(cache=True, nogil=True)
def neighbours(
    x,
    y,
    radius,
    group,
    n_mobile,
    skin,
    length,
    size_x,
    size_y,
    columns,
    rows,
    low,
    heads,
    nexts,
    lo,
    hi,
    shift,
):
    """Pairs closer than touch + skin, by cells; -1 when the list is full."""
    heads[:] = -1
    for i in range(x.shape[0] - 1, -1, -1):
        cx = int((x[i] - length * math.floor(x[i] / length)) / size_x) % columns
        cell = cx * rows + min(max(int((y[i] - low) / size_y), 0), rows - 1)
        nexts[i] = heads[cell]
        heads[cell] = i
    count = 0
    for i in range(n_mobile):
        cx = int((x[i] - length * math.floor(x[i] / length)) / size_x) % columns
        cy = min(max(int((y[i] - low) / size_y), 0), rows - 1)
        for ox in range(-1, 2):
            for gy in range(max(cy - 1, 0), min(cy + 2, rows)):
                j = heads[(cx + ox) % columns * rows + gy]
                while j >= 0:
                    if j > i and (group[i] < 0 or group[i] != group[j]):
                        dx = x[j] - x[i]
                        image = -length * math.floor(dx / length + 0.5)
                        dx += image
                        dy = y[j] - y[i]
                        reach = radius[i] + radius[j] + skin
                        if dx * dx + dy * dy < reach * reach:
                            if count == lo.shape[0]:
                                return -1
                            lo[count] = i
                            hi[count] = j
                            shift[count] = image
                            count += 1
                    j = nexts[j]
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def contacts(x, y, vx, vy, fx, fy, radius, inverse_mass, lo, hi, shift, count, stiffness, damping):
    for k in range(count):
        i = lo[k]
        j = hi[k]
        dx = x[j] - x[i] + shift[k]
        dy = y[j] - y[i]
        touch = radius[i] + radius[j]
        square = dx * dx + dy * dy
        if square < touch * touch:
            d = math.sqrt(square)
            inverse = 1.0 / d
            nx = dx * inverse
            ny = dy * inverse
            vn = (vx[j] - vx[i]) * nx + (vy[j] - vy[i]) * ny
            force = stiffness * (touch - d) - damping * vn / (inverse_mass[i] + inverse_mass[j])
            px = force * nx
            py = force * ny
            fx[i] -= px
            fy[i] -= py
            fx[j] += px
            fy[j] += py


@njit(cache=True, nogil=True, error_model="numpy")
def drift(x, y, vx, vy, old_x, old_y, n_mobile, dt):
    """Positions on; the largest squared way since the last list."""
    most = 0.0
    for i in range(n_mobile):
        x[i] += dt * vx[i]
        y[i] += dt * vy[i]
        mx = x[i] - old_x[i]
        my = y[i] - old_y[i]
        most = max(most, mx * mx + my * my)
    return most


@njit(cache=True, nogil=True, error_model="numpy")
def kick(vx, vy, fx, fy, inverse_mass, n_mobile, drag, dt):
    for i in range(n_mobile):
        vx[i] += dt * inverse_mass[i] * (fx[i] - drag * vx[i])
        vy[i] += dt * inverse_mass[i] * (fy[i] - drag * vy[i])
    fx[:] = 0.0
    fy[:] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def advance(
    steps, dt, x, y, vx, vy, fx, fy, old_x, old_y, radius, inverse_mass, group, n_mobile, stiffness, damping, drag,
    skin, length, size_x, size_y, columns, rows, low, heads, nexts, lo, hi, shift, count,
):  # fmt: skip
    """Leapfrog for so many steps; the number of pairs, or -1."""
    for _ in range(steps):
        most = drift(x, y, vx, vy, old_x, old_y, n_mobile, dt)
        if 4.0 * most > skin * skin or count < 0:
            count = neighbours(
                x,
                y,
                radius,
                group,
                n_mobile,
                skin,
                length,
                size_x,
                size_y,
                columns,
                rows,
                low,
                heads,
                nexts,
                lo,
                hi,
                shift,
            )
            if count < 0:
                return count
            old_x[:] = x
            old_y[:] = y
        contacts(x, y, vx, vy, fx, fy, radius, inverse_mass, lo, hi, shift, count, stiffness, damping)
        kick(vx, vy, fx, fy, inverse_mass, n_mobile, drag, dt)
    return count


class PlainLoop:
    """The bed in arrays, mobile bodies first and in columns along x, so that neighbours lie close in memory."""

    def __init__(self, scene: Scene, skin: float = 2.0e-4) -> None:
        assert scene.periodic_x and scene.time.dt
        bodies = scene.bodies
        group = np.full(len(bodies), -1)
        for k, chain in enumerate(scene.chains):
            group[list(chain)] = k
        state = np.array([b.initial for b in bodies])
        wall = np.array([not b.mobile for b in bodies])
        largest = max(b.radius for b in bodies)
        cell = 2 * largest + skin
        columns = int(scene.periodic_x / cell)
        column = np.floor(np.mod(state[:, 0], scene.periodic_x) / cell)
        self._order = np.lexsort((state[:, 1], column, wall))
        x, y, vx, vy = (np.ascontiguousarray(state[self._order, k]) for k in range(4))
        n = len(bodies)
        n_mobile = n - int(wall.sum())
        inverse = np.array([1 / b.mass if b.mobile else 0.0 for b in bodies])[self._order]
        contact = scene.laws_named("contact_linear")[0].values
        drag = sum(item.values["c"] for item in scene.laws_named("linear_drag"))
        low = float(y.min())
        rows = int((y.max() - low) / cell) + 1
        room = 8 * n
        self._arguments = [
            scene.time.dt, x, y, vx, vy, np.zeros(n), np.zeros(n), np.full(n, np.inf), np.full(n, np.inf),
            np.array([b.radius for b in bodies])[self._order], inverse, group[self._order], n_mobile,
            contact["stiffness"], contact["damping"], drag, skin, scene.periodic_x, scene.periodic_x / columns, cell,
            columns, rows, low, np.zeros(columns * rows, np.int32), np.zeros(n, np.int32), np.zeros(room, np.int32),
            np.zeros(room, np.int32), np.zeros(room),
        ]  # fmt: skip
        self._count = -1

    def advance(self, steps: int) -> None:
        """Velocities are the leapfrog's own, half a step ahead."""
        self._count = advance(steps, *self._arguments, self._count)
        if self._count < 0:
            raise SimulationError("the neighbour list is full")

    def positions(self) -> np.ndarray:
        """(n, 2) [m], in the order of the scene."""
        result = np.empty((len(self._order), 2))
        result[self._order, 0] = self._arguments[1]
        result[self._order, 1] = self._arguments[2]
        return result
