"""Compiled neighbour list: cells, periodic along x, rows sorted, so that sums have a fixed order."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

OVERFLOW = -1
NOT_FINITE = -2


@njit(cache=True)
def build_list(x, y, reach, mobile, group, cutoff_extra, length, pair_i, pair_j, pair_shift, heads, nexts):
    """Fill ``pair_i < pair_j`` with all pairs closer than reach_i + reach_j + cutoff_extra [m].

    ``pair_shift`` [m] is what brings x_j - x_i to the nearest image while the list lasts.
    ``length`` is the period along x, 0 for none; ``reach`` (n,) the radii. Pairs of two immobile
    bodies, or of one non-zero ``group``, are left out. ``heads`` and ``nexts`` are work arrays; the number of cells
    is bounded by the size of ``heads``. Returns the number of pairs, OVERFLOW or NOT_FINITE.
    """
    n = x.shape[0]
    largest = 0.0
    low_x = math.inf
    high_x = -math.inf
    low_y = math.inf
    high_y = -math.inf
    for i in range(n):
        if not (math.isfinite(x[i]) and math.isfinite(y[i])):
            return NOT_FINITE
        largest = max(largest, reach[i])
        low_x = min(low_x, x[i])
        high_x = max(high_x, x[i])
        low_y = min(low_y, y[i])
        high_y = max(high_y, y[i])
    size = 2.0 * largest + cutoff_extra
    if length > 0.0:
        low_x = 0.0
        span_x = length
    else:
        span_x = high_x - low_x
    span_y = high_y - low_y
    # cells no smaller than the cutoff, and no more of them than there is room for
    most = heads.shape[0]
    while (math.floor(span_x / size) + 1.0) * (math.floor(span_y / size) + 1.0) > most:
        size *= 1.5
    nx = max(int(span_x / size), 1) if length > 0.0 else int(span_x / size) + 1
    ny = int(span_y / size) + 1
    scale_x = nx / length if length > 0.0 else 1.0 / size
    scale_y = 1.0 / size
    plain = length > 0.0 and nx < 3  # every cell would be met twice
    for c in range(nx * ny):
        heads[c] = -1
    for i in range(n - 1, -1, -1):
        position = x[i] - low_x
        if length > 0.0:
            # floor, not truncation: a grain at a small negative x belongs to the last cell
            position -= length * math.floor(position / length)
        cx = min(int(position * scale_x), nx - 1)
        cy = min(int((y[i] - low_y) * scale_y), ny - 1)
        c = cy * nx + cx
        nexts[i] = heads[c]
        heads[c] = i
    count = 0
    room = pair_i.shape[0]
    for i in range(n):
        first = count
        position = x[i] - low_x
        if length > 0.0:
            position -= length * math.floor(position / length)
        cx = min(int(position * scale_x), nx - 1)
        cy = min(int((y[i] - low_y) * scale_y), ny - 1)
        for oy in range(-1, 2):
            gy = cy + oy
            if gy < 0 or gy >= ny:
                continue
            for ox in range(-1, 2):
                gx = cx + ox
                if plain:
                    if ox < 0 or ox >= nx:
                        continue
                    gx = ox
                elif length > 0.0:
                    gx %= nx
                elif gx < 0 or gx >= nx:
                    continue
                j = heads[gy * nx + gx]
                while j >= 0:
                    if j > i and (mobile[i] or mobile[j]) and (group[i] == 0 or group[i] != group[j]):
                        dx = x[j] - x[i]
                        shift = 0.0
                        if length > 0.0:
                            shift = -length * math.floor(dx / length + 0.5)
                            dx += shift
                        dy = y[j] - y[i]
                        cutoff = reach[i] + reach[j] + cutoff_extra
                        if dx * dx + dy * dy < cutoff * cutoff:
                            if count >= room:
                                return OVERFLOW
                            # insertion keeps the row sorted by j
                            k = count
                            while k > first and pair_j[k - 1] > j:
                                pair_j[k] = pair_j[k - 1]
                                pair_shift[k] = pair_shift[k - 1]
                                k -= 1
                            pair_j[k] = j
                            pair_shift[k] = shift
                            pair_i[count] = i
                            count += 1
                    j = nexts[j]
    return count


@njit(cache=True, error_model="numpy")
def prune(
    x, y, radius, inverse_mass, extra, pair_i, pair_j, pair_shift, count, near_i, near_j, near_shift, near_touch, near_mass
):
    """Keep the pairs of a list that are closer than touch + extra [m]; their number.

    ``near_touch`` [m] is the sum of radii, ``near_mass`` [kg] the reduced mass. The order stays.
    """
    near = np.uint64(0)
    one = np.uint64(1)
    for k in range(count):
        i = pair_i[k]
        j = pair_j[k]
        dx = x[j] - x[i] + pair_shift[k]
        dy = y[j] - y[i]
        cutoff = radius[i] + radius[j] + extra
        # written in any case, kept if near: no branch that cannot be foreseen
        near_i[near] = i
        near_j[near] = j
        near_shift[near] = pair_shift[k]
        near += one if dx * dx + dy * dy < cutoff * cutoff else np.uint64(0)
    for k in range(near):
        i = near_i[k]
        j = near_j[k]
        near_touch[k] = radius[i] + radius[j]
        near_mass[k] = 1.0 / (inverse_mass[i] + inverse_mass[j])
    return near


@njit(cache=True, error_model="numpy")
def moved(x, y, old_x, old_y, n, way):
    """Whether one of the first ``n`` bodies is farther than ``way`` [m] from its old position, or not finite."""
    far = 0
    limit = way * way
    for i in range(n):
        dx = x[i] - old_x[i]
        dy = y[i] - old_y[i]
        far += 0 if dx * dx + dy * dy <= limit else 1
    return far > 0
