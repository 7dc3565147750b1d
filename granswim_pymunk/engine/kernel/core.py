"""Blocks of pairs, dampings taken twice, and the sum of all forces: what every scene needs.

This is text, as all files of this folder: see ``kernel``.
"""

import math

import numpy as np

from ..native import (
    call_block,
    call_links,
    call_one,
    call_walls,
    difference,
    four_shifted_ways,
    four_ways,
    lowest_bit,
    push_apart,
)
from .names import *

# ---- text ----


@njit(**PLAIN)
def interpolate(t, times, values, first, last):
    """Linear between rows, constant outside."""
    if last <= first:
        return 0.0
    if t <= times[first]:
        return values[first]
    if t >= times[last - 1]:
        return values[last - 1]
    low = first
    high = last - 1
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= t:
            low = middle
        else:
            high = middle
    weight = (t - times[low]) / (times[high] - times[low])
    return values[low] + weight * (values[high] - values[low])


# Neither a branch nor the place of a store depends on whether a pair touches, which cannot be foreseen: the answers
# are gathered as the bits of a word, and the bits that are set are then taken one by one. numba counts references
# to arrays unless a function is one straight line to its end: hence two of them.
@njit(**PLAIN)
def touching(first, last, seam, flat, near_i, near_j, near_shift, near_touch, which, work):
    """Which pairs of a block touch, but for two at one place: their numbers in the block; of each the way to j."""
    m = np.uint64(0)
    begin = np.uint64(first)
    count = np.uint64(last) - begin
    for low in range(np.uint64(0), count, np.uint64(64)):
        word = np.uint64(0)
        for q in range(low, min(low + np.uint64(64), count), np.uint64(4)):
            if seam == 0:
                word |= four_ways(flat, P_X, near_i, near_j, near_shift, near_touch, begin + q,
                                  work, q + W_DX, q + W_DY) << (q - low)
            else:
                word |= four_shifted_ways(flat, P_X, near_i, near_j, near_shift, near_touch, begin + q,
                                          work, q + W_DX, q + W_DY) << (q - low)
        if count - low < np.uint64(64):
            word &= (np.uint64(1) << (count - low)) - np.uint64(1)  # the last four may be fewer
        while word != np.uint64(0):
            which[m] = low + lowest_bit(word)
            m += np.uint64(1)
            word &= word - np.uint64(1)
    return m


@njit(**PLAIN)
def reached(first, last, reach, step, masked, mask, flat, near_i, near_j, near_shift, near_touch, which, work):
    """The same for a law that reaches farther, or acts on some bodies only; half a ``step`` before or after, too."""
    m = np.uint64(0)
    begin = np.uint64(first)
    end = np.uint64(last)
    for low in range(begin, end, np.uint64(64)):
        word = np.uint64(0)
        for k in range(low, min(low + np.uint64(64), end)):
            i = near_i[k]
            j = near_j[k]
            dx = flat[j + P_X] - flat[i + P_X] + near_shift[k]
            dy = flat[j + P_Y] - flat[i + P_Y]
            work[k - begin + W_DX] = dx
            work[k - begin + W_DY] = dy
            limit = near_touch[k] + reach
            if step > 0.0:
                ux = flat[j + P_VX] - flat[i + P_VX]
                uy = flat[j + P_VY] - flat[i + P_VY]
                limit += 0.5 * step * math.sqrt(ux * ux + uy * uy)
            chosen = masked == 0 or (mask[i // P_ROW] and mask[j // P_ROW])
            word |= np.uint64(chosen and 0.0 < dx * dx + dy * dy < limit * limit) << (k - low)
        while word != np.uint64(0):
            which[m] = low - begin + lowest_bit(word)
            m += np.uint64(1)
            word &= word - np.uint64(1)
    return m


@njit(**PLAIN)
def collect(first, count, round_, flat, radius, near_i, near_j, near_touch, near_mass, which, work):
    """What the laws look at, of the pairs within reach."""
    begin = np.uint64(first)
    for m in range(count):
        q = which[m]
        k = begin + q
        i = near_i[k]
        j = near_j[k]
        dx = work[q + W_DX]
        dy = work[q + W_DY]
        which[m] = k
        work[m + W_DX] = dx
        work[m + W_DY] = dy
        difference(flat, i + P_VX, j + P_VX, work, m + W_UX, m + W_UY)
        work[m + W_TOUCH] = near_touch[k]
        work[m + W_MASS] = near_mass[k]
        if round_ != 0:
            work[m + W_RI] = radius[i // P_ROW]
            work[m + W_RJ] = radius[j // P_ROW]
            work[m + W_WI] = flat[i + P_SPIN]
            work[m + W_WJ] = flat[j + P_SPIN]


@njit(**PLAIN)
def scatter(count, spin, flat, near_i, near_j, which, work):
    """Forces and torques to the bodies, in the order of the list."""
    for m in range(count):
        k = which[m]
        i = near_i[k]
        j = near_j[k]
        push_apart(flat, i + P_FX, j + P_FX, work[m + W_PX], work[m + W_PY])
        if spin != 0:
            flat[i + P_TORQUE] += work[m + W_TI]
            flat[j + P_TORQUE] += work[m + W_TJ]


@njit(**PLAIN)
def keep(first, last, state, kept):
    """Remember the forces before any damping, and the half-step velocities."""
    for i in range(first, last):
        kept[i, 0] = state[i, FX]
        kept[i, 1] = state[i, FY]
        kept[i, 2] = state[i, TORQUE]
        kept[i, 3] = state[i, VX]
        kept[i, 4] = state[i, VY]
        kept[i, 5] = state[i, SPIN]


@njit(**PLAIN)
def half_kick(first, last, half, state, kick_mass, inverse_moment, kept):
    """Back to the forces before any damping, at the velocities of the time of the positions."""
    for i in range(first, last):
        state[i, VX] += half * kick_mass[i] * state[i, FX]
        state[i, VY] += half * kick_mass[i] * state[i, FY]
        state[i, SPIN] += half * inverse_moment[i] * state[i, TORQUE]
        state[i, FX] = kept[i, 0]
        state[i, FY] = kept[i, 1]
        state[i, TORQUE] = kept[i, 2]


@njit(**PLAIN)
def give_back(first, last, state, kept):
    """The half-step velocities again: constraints and kick start from them."""
    for i in range(first, last):
        state[i, VX] = kept[i, 3]
        state[i, VY] = kept[i, 4]
        state[i, SPIN] = kept[i, 5]


@njit(**PLAIN)
def add_forces(from_list, constrained, t, dt, context):
    """Add all forces [N] to the columns FX, FY of the state, and torques [N m] to TORQUE.

    Block of bodies after block; of a pair, i is the smaller number, so behind a block nothing is added to its
    bodies any more. Uses are sorted: pairs, chains (all in the first block), bodies, constraints; in the exact scheme
    dampings follow the other laws of bodies, and are taken twice, the second time with the velocity that half the kick
    of the first time leads to: together with the constraints where there are any, else each for itself, the last one
    at once.
    ``from_list``: sum the pairs of the list of near ones (else the contacts are there already);
    ``constrained``: with the constraints. Both are whole numbers, or each would be compiled on its own.
    """
    unpack(context)
    count = uses.shape[0]
    damped = count  # the first damping, and the last
    final = -1
    if scalars[6] != SCHEME_HALF_STEP:
        for u in range(count):
            if uses[u, USE_DAMPING] != 0:
                damped = min(damped, u)
                final = u
    for pass_ in range(2 * (blocks.shape[0] - 1)):
        b = pass_ // 2
        again = pass_ - 2 * b
        together_ = scalars[6] == SCHEME_TOGETHER or (scalars[6] == SCHEME_CHAINS and b == 0)
        until = count
        if again != 0:
            if together_:
                half_kick(blocks[b], blocks[b + 1], 0.5 * dt, state, kick_mass, inverse_moment, kept)
            else:
                until = final
        elif wall_starts[b + 1] > wall_starts[b]:
            call_walls(I[ADD_WALLS], context, wall_starts[b], wall_starts[b + 1], t, dt)
        swapped = together_ and again != 0
        fresh = 1.0 if again == 0 else 0.0
        for u in range(damped if again != 0 else 0, until):
            code = uses[u, USE_CODE]
            if code == 0 or (constrained == 0 and code == CODE_CONSTRAINT):
                continue
            if together_ and again == 0 and u == damped:
                keep(blocks[b], blocks[b + 1], state, kept)
            if swapped and uses[u, USE_DAMPING] == 0:
                swapped = False
                give_back(blocks[b], blocks[b + 1], state, kept)
            twice = not together_ and (again != 0 or u == final)
            if code != CODE_PAIR or from_list != 0:
                call_block(uses[u, USE_BLOCK], context, u, b, t, dt, np.int64(twice), fresh)
        if swapped:
            give_back(blocks[b], blocks[b + 1], state, kept)
        if b == 0 and constrained != 0 and I[N_LINKED] > 0 and (again == 0 or damped < count):
            call_links(I[HOLD_LINKS], context, dt)


@njit(**PLAIN)
def pair_force(i, j, t, context):
    """Force on j [N] and torques on i and j [N m] by all pair laws; i gets the opposite force."""
    unpack(context)
    for k in range(4):
        work[k] = 0.0
    for u in range(uses.shape[0]):
        if uses[u, USE_ONE] != 0 and (uses[u, 4] == 0 or (mask[u, i] and mask[u, j])):
            call_one(uses[u, USE_ONE], context, u, i, j, t)
    return work[0], work[1], work[2], work[3]


@njit(**PLAIN)
def pair_forces(i, j, normal, t, context, out):
    """The same of many pairs, along their ``normal`` (k, 2), into ``out`` (k,) [N]."""
    for k in range(out.shape[0]):
        px, py, _ti, _tj = pair_force(i[k], j[k], t, context)
        out[k] = px * normal[k, 0] + py * normal[k, 1]


@njit(**PLAIN)
def forces_of_now(constrained, scheme, t, dt, context):
    """All forces at the rows as they are, none before; how dampings see the velocity goes to the context."""
    unpack(context)
    for i in range(n):
        state[i, FX] = 0.0
        state[i, FY] = 0.0
        state[i, TORQUE] = 0.0
    scalars[6] = scheme
    add_forces(1, constrained, t, dt, context)


@njit(**PLAIN)
def begin(t, dt, scheme, any_held, held, start, out, context):
    """Velocities and spins ``out`` (n, 3) after the first kick, from those in the rows, kept in ``start`` (n, 3).

    Of bodies that no constraint holds half a kick. A constraint sees the velocity half a step behind, here as in every
    later step: of those that are ``held`` (n,) that velocity is what the force of the constraint itself leads to, found
    in two rounds.
    """
    unpack(context)
    half = 0.5 * dt
    for i in range(n):
        start[i, 0] = state[i, VX]
        start[i, 1] = state[i, VY]
        start[i, 2] = state[i, SPIN]
    forces_of_now(1, SCHEME_HALF_STEP, t, dt, context)
    for i in range(n):
        out[i, 0] = start[i, 0] + half * (state[i, FX] * inverse_mass[i])
        out[i, 1] = start[i, 1] + half * (state[i, FY] * inverse_mass[i])
        out[i, 2] = start[i, 2] + half * state[i, TORQUE] * inverse_moment[i]
    if any_held == 0:
        return
    forces_of_now(0, SCHEME_HALF_STEP, t, dt, context)
    for _round in range(2):
        for i in range(n):
            share = half if held[i] else 0.0
            state[i, VX] = start[i, 0] - share * state[i, FX] * inverse_mass[i]
            state[i, VY] = start[i, 1] - share * state[i, FY] * inverse_mass[i]
            state[i, SPIN] = start[i, 2] - share * state[i, TORQUE] * inverse_moment[i]
        forces_of_now(1, scheme, t, dt, context)
    for i in range(n):
        if held[i]:
            out[i, 0] = state[i, VX] + dt * state[i, FX] * inverse_mass[i]
            out[i, 1] = state[i, VY] + dt * state[i, FY] * inverse_mass[i]
            out[i, 2] = state[i, SPIN] + dt * state[i, TORQUE] * inverse_moment[i]
