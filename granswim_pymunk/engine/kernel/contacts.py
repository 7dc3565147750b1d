"""The step over contacts that Chipmunk finds. Text, see ``kernel``."""

import numpy as np
from numba import carray, types

from ..native import load_float, load_int, pointer_to, store_byte, store_float
from ..neighbours import near_walls, together
from .core import add_forces, pair_force
from .names import *
from .step import add_to_bodies, finite, gather

# ---- text ----


@njit(**PLAIN)
def find(key, keys, values):
    """Row of a body from its address (open addressing); -1 for a stranger."""
    size = keys.shape[0]
    k = ((key >> 4) * 2654435761) & (size - 1)
    while keys[k] != key:
        if keys[k] == 0:
            return -1
        k = (k + 1) & (size - 1)
    return values[k]


@njit(**PLAIN)
def row_of(body, first, n, keys, values):
    """The same; bodies in rows of the package's own begin at ``first``, 0 where they do not."""
    place = np.uint64(body - first)
    if first != 0 and place < np.uint64(n * 8 * ROW):
        return np.int64(place // np.uint64(8 * ROW))
    return find(body, keys, values)


@njit(**PLAIN)
def away(n_mobile, state, margin):
    """Whether a body left its surroundings, or is no number."""
    found = False
    for i in range(n_mobile):
        way_x = state[i, X] - state[i, NEAR_X]
        way_y = state[i, Y] - state[i, NEAR_Y]
        if not way_x * way_x + way_y * way_y <= margin:
            found = True
    return found


@cfunc(types.void(types.int64, types.int64, types.int64), **CALLBACK)
def contact_presolve(arbiter, space, data):
    """preSolve of one contact that Chipmunk found: its force goes to a buffer, Chipmunk's impulse is off."""
    context = data
    unpack(context)
    store_byte(arbiter + AT_PROCESS_COLLISION, 0)
    if I[ROOM] == 0:
        return  # no law of pairs: nothing to keep
    a = row_of(load_int(arbiter + AT_BODY_A), I[FIRST_BODY], n, table_keys, table_values)
    b = row_of(load_int(arbiter + AT_BODY_B), I[FIRST_BODY], n, table_keys, table_values)
    if a == WALL_ROW or b == WALL_ROW:
        i = max(a, b)  # a ghost's original meets the image of the wall itself
        if i >= 0 and mobile[i]:
            wall_met[i] = 1
        return
    if a == -1 or b == -1 or (a < 0 and b < 0):
        return  # a body of the user's own, or two ghosts, whose originals meet elsewhere
    i = a if a >= 0 else -a - 2
    j = b if b >= 0 else -b - 2
    if i > j:
        i, j = j, i
    if not (mobile[i] or mobile[j]) or together(i, j, group, apart):
        return
    t = F[F_T_START] + (F[F_STEP] + 1.0) * F[F_DT]
    px, py, ti, tj = pair_force(i, j, t, context)
    c = I[N_CONTACTS]
    if c >= I[ROOM]:
        I[STATUS] = -1
        return
    contact_i[c] = i
    contact_j[c] = j
    contact_fx[c] = px
    contact_fy[c] = py
    contact_ti[c] = ti
    contact_tj[c] = tj
    I[N_CONTACTS] = c + 1


@cfunc(types.void(types.int64, types.int64), **CALLBACK)
def chipmunk_step(constraint, space):
    """A constraint's preSolve: sums the contacts in a fixed order (Chipmunk's differs between processes)."""
    context = load_int(constraint + AT_USER_DATA)
    unpack(context)
    whole = carray(pointer_to(I[MOTION]), N_MOTION, np.int64)
    n_mobile = I[N_MOBILE]
    if I[OWN_DRIFT] == 0:
        gather(n_mobile, bodies, state, motion)
        if away(n_mobile, state, motion[M_MARGIN]):
            whole[M_LEFT] = 1
    if whole[M_LEFT] != 0:
        whole[M_LEFT] = 0
        if not finite(state):
            I[STATUS] = -2
            return
        I[MARGIN_CROSSED] = 1  # the ghosts at the seam must be laid out anew
    for i in range(n_mobile):
        state[i, X] += image_shift[i]  # bodies in the Space are wrapped, one by one
    F[F_STEP] += 1.0
    t = F[F_T_START] + F[F_STEP] * F[F_DT]
    dt = F[F_DT]
    for i in range(n_mobile, n):
        state[i, FX] = 0.0
        state[i, FY] = 0.0
        state[i, TORQUE] = 0.0
    count = I[N_CONTACTS]
    for i in range(n + 1):
        listing[i] = 0
    for c in range(count):
        listing[contact_i[c] + 1] += 1
    for i in range(n):
        listing[i + 1] += listing[i]
    for c in range(count):
        i = contact_i[c]
        order[listing[i]] = c
        listing[i] += 1
    first = 0
    for i in range(n):
        last = listing[i]
        for k in range(first + 1, last):
            c = order[k]
            m = k
            while m > first and contact_j[order[m - 1]] > contact_j[c]:
                order[m] = order[m - 1]
                m -= 1
            order[m] = c
        for k in range(first, last):
            c = order[k]
            j = contact_j[c]
            if contact_fx[c] != 0.0 or contact_fy[c] != 0.0:
                state[j, FX] += contact_fx[c]
                state[j, FY] += contact_fy[c]
                state[i, FX] -= contact_fx[c]
                state[i, FY] -= contact_fy[c]
                state[i, TORQUE] += contact_ti[c]
                state[j, TORQUE] += contact_tj[c]
        first = last
    I[N_CONTACTS] = 0
    if I[N_WALLS] > 0:
        for i in range(n_mobile):
            place_x[i] = state[i, X]
            place_y[i] = state[i, Y]
        near_walls(place_x, place_y, radius, wall_met, walls, scalars[0], blocks, wall_i, wall_k, wall_starts)
        for i in range(n_mobile):
            wall_met[i] = 0
    add_forces(I[FROM_LIST], I[CONSTRAINED], t, dt, context)
    if I[OWN_KICK] == 0:
        add_to_bodies(n_mobile, bodies, state, motion, heavier)


@cfunc(types.void(types.int64, types.float64), **CALLBACK)
def ghost_position(body, dt):
    """A ghost stands where its original stands, one period on.

    The original's address is kept in the ghost's torque, the period in its force: Chipmunk uses
    neither for a kinematic body.
    """
    at = load_int(body + AT_TORQUE)
    px = load_float(at + AT_POSITION) + load_float(body + AT_FORCE)
    py = load_float(at + AT_POSITION + 8)
    store_float(body + AT_POSITION, px)
    store_float(body + AT_POSITION + 8, py)
    store_float(body + AT_TRANSFORM, px)
    store_float(body + AT_TRANSFORM + 8, py)
    store_float(body + AT_VELOCITY, load_float(at + AT_VELOCITY))
    store_float(body + AT_VELOCITY + 8, load_float(at + AT_VELOCITY + 8))
