"""Compiled neighbour lists: cells, periodic along x, rows sorted, so that sums have a fixed order."""

from __future__ import annotations

import math

import numpy as np

from ..compiled import njit

OVERFLOW = -1
NOT_FINITE = -2
ESCAPED = -3


@njit(cache=True, error_model="numpy", nogil=True)
def together(i, j, group, apart):
    """Whether two bodies never touch: disks of a swimmer (groups above zero), or joined by a hinge or rod (below).

    ``apart`` (k,): the joined pairs i < j as i n + j.
    """
    if group[i] == 0 or group[i] != group[j]:
        return False
    if group[i] > 0:
        return True
    code = min(i, j) * group.shape[0] + max(i, j)
    for k in range(apart.shape[0]):
        if apart[k] == code:
            return True
    return False


@njit(cache=True, error_model="numpy")
def build_list(
    x, y, reach, mobile, group, apart, extra, length, pair_i, pair_j, pair_shift, cells, order, sorted_x, sorted_y,
    sorted_reach, found_i, found_j, starts,
):  # fmt: skip
    """Fill ``pair_i < pair_j`` with all pairs closer than reach_i + reach_j + extra [m], sorted.

    ``pair_shift`` [m] is what brings x_j - x_i to the nearest image while the list lasts. ``length`` is
    the period along x, 0 for none; ``reach`` (n,) the radii. Pairs of two immobile bodies, and
    those that are ``together``, are left out. The rest are work arrays: ``order``, ``sorted_...`` (n,), ``starts``
    (n + 1,), ``found_...`` as long as the list; the number of cells is bounded by the size of ``cells``.
    Returns the number of pairs, OVERFLOW, NOT_FINITE, or ESCAPED where a body is so far away that floats
    cannot resolve a contact there.
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
    size = 2.0 * largest + extra
    if max(high_x, -low_x, high_y, -low_y) > 1e10 * size:
        return ESCAPED
    if length > 0.0:
        low_x = 0.0
        span_x = length
    else:
        span_x = high_x - low_x
    span_y = high_y - low_y
    # cells no smaller than the cutoff, and no more of them than there is room for
    while (math.floor(span_x / size) + 1.0) * (math.floor(span_y / size) + 1.0) >= cells.shape[0]:
        size *= 1.5
    columns = int(span_x / size)
    if length <= 0.0:
        columns += 1
    elif columns < 3:
        columns = 1  # else a pair would be met on both sides
    rows = int(span_y / size) + 1
    scale_x = columns / length if length > 0.0 else 1.0 / size
    scale_y = 1.0 / size

    # bodies sorted by cell, columns one behind the other
    for c in range(columns * rows):
        cells[c] = 0
    for i in range(n):
        position = x[i] - low_x
        if length > 0.0:
            # floor, not truncation: a grain at a small negative x belongs to the last cell
            position -= length * math.floor(position / length)
        column = min(max(int(position * scale_x), 0), columns - 1)
        cell = column * rows + min(int((y[i] - low_y) * scale_y), rows - 1)
        starts[i] = cell
        cells[cell] += 1
    total = 0
    for c in range(columns * rows):
        total += cells[c]
        cells[c] = total - cells[c]
    for i in range(n):
        k = cells[starts[i]]
        cells[starts[i]] = k + 1  # in the end that of the next cell's first body
        order[k] = i
        position = x[i]
        if length > 0.0:
            position -= length * math.floor(position / length)
        sorted_x[k] = position
        sorted_y[k] = y[i]
        sorted_reach[k] = reach[i] + extra

    # each body with those behind it in its cell and the next, and with three cells of the next column
    room = pair_i.shape[0]
    count = 0
    for column in range(columns):
        other = column + 1
        across = 0.0
        if other == columns and length > 0.0:
            other = 0
            across = length
        for row in range(rows):
            cell = column * rows + row
            begin = cells[cell - 1] if cell > 0 else 0
            behind = cells[cell + 1] if row + 1 < rows else cells[cell]
            first = 0
            last = 0
            if columns > 1 and other < columns:
                low = other * rows + max(row - 1, 0)
                first = cells[low - 1] if low > 0 else 0
                last = cells[other * rows + min(row + 1, rows - 1)]
            for k in range(begin, cells[cell]):
                i = order[k]
                for part in range(2):
                    shifted = sorted_x[k] - (across if part == 1 else 0.0)
                    for q in range(k + 1 if part == 0 else first, behind if part == 0 else last):
                        dx = sorted_x[q] - shifted
                        if columns == 1 and length > 0.0:
                            dx -= length * math.floor(dx / length + 0.5)
                        dy = sorted_y[q] - sorted_y[k]
                        cutoff = sorted_reach[k] + sorted_reach[q] - extra
                        if dx * dx + dy * dy < cutoff * cutoff:
                            j = order[q]
                            if (mobile[i] or mobile[j]) and not together(i, j, group, apart):
                                if count == room:
                                    return OVERFLOW
                                found_i[count] = min(i, j)
                                found_j[count] = max(i, j)
                                count += 1

    # sorted by i, then by j
    for i in range(n + 1):
        starts[i] = 0
    for k in range(count):
        starts[found_i[k] + 1] += 1
    for i in range(n):
        starts[i + 1] += starts[i]
    for k in range(count):
        i = found_i[k]
        pair_j[starts[i]] = found_j[k]
        starts[i] += 1  # in the end where the row ends
    first = 0
    for i in range(n):
        for k in range(first, starts[i]):
            j = pair_j[k]
            at = k
            while at > first and pair_j[at - 1] > j:
                pair_j[at] = pair_j[at - 1]
                at -= 1
            pair_j[at] = j
        for k in range(first, starts[i]):
            dx = x[pair_j[k]] - x[i]
            pair_i[k] = i
            pair_shift[k] = -length * math.floor(dx / length + 0.5) if length > 0.0 else 0.0
        first = starts[i]
    return count


@njit(cache=True, error_model="numpy")
def prune(
    x, y, room, inverse_mass, radius, ends, blocks, pair_i, pair_j, pair_shift, near_i, near_j, near_shift, near_touch,
    near_mass, near_starts, near_seam, row,
):  # fmt: skip
    """Keep the pairs of a list that are closer than the sum of their ``room`` (n,) [m]; their number.

    ``ends`` (n,): where the pairs of each i end in the list. ``blocks`` (b + 1,): where blocks of bodies begin;
    in ``near_starts`` (b + 1,) where the pairs of their i begin, in ``near_seam`` (b,) whether one has a shift.
    ``near_i`` and ``near_j`` are ``row`` times the bodies' numbers: where their rows begin in a flat array.
    ``near_touch`` [m] is the sum of radii, ``near_mass`` [kg] the reduced mass. The order stays.
    """
    near = np.uint64(0)
    one = np.uint64(1)
    first = np.uint64(0)
    for b in range(blocks.shape[0] - 1):
        near_starts[b] = near
        last = np.uint64(ends[blocks[b + 1] - 1]) if blocks[b + 1] > 0 else np.uint64(0)
        seam = 0.0
        for k in range(first, last):
            i = pair_i[k]
            j = pair_j[k]
            shift = pair_shift[k]
            dx = x[j] - x[i] + shift
            dy = y[j] - y[i]
            cutoff = room[i] + room[j]
            # written in any case, kept if near: no branch that cannot be foreseen
            near_i[near] = i
            near_j[near] = j
            near_shift[near] = shift
            near += one if dx * dx + dy * dy < cutoff * cutoff else np.uint64(0)
            seam += abs(shift)
        near_seam[b] = seam != 0.0
        first = last
    near_starts[blocks.shape[0] - 1] = near
    for k in range(near):
        i = near_i[k]
        j = near_j[k]
        near_touch[k] = radius[i] + radius[j]
        near_i[k] = i * np.uint32(row)
        near_j[k] = j * np.uint32(row)
        near_mass[k] = 1.0 / (inverse_mass[i] + inverse_mass[j])
    return near


@njit(cache=True, error_model="numpy")
def moved(x, y, old_x, old_y, n, way, less):
    """Whether one of the first ``n`` bodies is farther than ``way - less[i]`` [m] from its old position."""
    far = 0
    for i in range(n):
        dx = x[i] - old_x[i]
        dy = y[i] - old_y[i]
        limit = way - less[i]
        far += 0 if dx * dx + dy * dy <= limit * limit else 1
    return far > 0


@njit(cache=True, error_model="numpy", nogil=True)
def to_wall(x, y, walls, k, length):
    """The way (dx, dy) [m] from a place to the nearest one on the middle line of wall k.

    ``walls`` (W, 5): begin x, y, the way to the end x, y, radius [m]. ``length``: the period along x, 0 for none; of
    the images of a wall the nearest counts.
    """
    along_x = walls[k, 2]
    along_y = walls[k, 3]
    square = along_x * along_x + along_y * along_y
    px = x - walls[k, 0]
    py = y - walls[k, 1]
    if length <= 0.0:
        share = min(max((px * along_x + py * along_y) / square, 0.0), 1.0)
        return share * along_x - px, share * along_y - py
    px -= length * math.floor((px - 0.5 * along_x) / length + 0.5)
    dx = math.inf
    dy = 0.0
    for image in range(3):
        qx = px - (length if image == 1 else -length if image == 2 else 0.0)
        share = min(max((qx * along_x + py * along_y) / square, 0.0), 1.0)
        ex = share * along_x - qx
        ey = share * along_y - py
        if ex * ex + ey * ey < dx * dx + dy * dy:
            dx = ex
            dy = ey
    return dx, dy


@njit(cache=True, error_model="numpy", nogil=True)
def gap_to_walls(x, y, radius, walls, length):
    """Gap [m] between a disk and the nearest wall, infinite where there is none."""
    gap = math.inf
    for k in range(walls.shape[0]):
        dx, dy = to_wall(x, y, walls, k, length)
        gap = min(gap, math.sqrt(dx * dx + dy * dy) - radius - walls[k, 4])
    return gap


@njit(cache=True, error_model="numpy", nogil=True)
def near_walls(x, y, room, mobile, walls, length, blocks, wall_i, wall_k, wall_starts):
    """Bodies and walls that are closer than ``room`` (n,) and the wall's radius [m], in the order of the bodies.

    ``blocks`` (b + 1,): where blocks of bodies begin; in ``wall_starts`` (b + 1,) where the meetings of theirs do.
    """
    count = 0
    for b in range(blocks.shape[0] - 1):
        wall_starts[b] = count
        for i in range(blocks[b], blocks[b + 1] if walls.shape[0] > 0 else blocks[b]):
            if not mobile[i]:
                continue
            for k in range(walls.shape[0]):
                dx, dy = to_wall(x[i], y[i], walls, k, length)
                limit = room[i] + walls[k, 4]
                if dx * dx + dy * dy < limit * limit:
                    wall_i[count] = i
                    wall_k[count] = k
                    count += 1
    wall_starts[blocks.shape[0] - 1] = count
    return count
