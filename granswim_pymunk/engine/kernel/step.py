"""The step over lists of pairs: drift, forces, kick. Text, see ``kernel``."""

import math

import numpy as np
from numba import carray, types

from ..native import call_lists, load_float, load_int, pointer_to, store_float
from .core import add_forces
from .names import *

# ---- text ----


@njit(**PLAIN)
def gather(n_mobile, bodies, state, motion):
    """What the drift does besides moving: read the mobile bodies [SI]."""
    for i in range(n_mobile):
        at = bodies[i]
        state[i, X] = load_float(at + AT_POSITION) * motion[M_LENGTH_UNIT]
        state[i, Y] = load_float(at + AT_POSITION + 8) * motion[M_LENGTH_UNIT]
        state[i, VX] = load_float(at + AT_VELOCITY) * motion[M_VELOCITY_UNIT]
        state[i, VY] = load_float(at + AT_VELOCITY + 8) * motion[M_VELOCITY_UNIT]
        state[i, FX] = 0.0
        state[i, FY] = 0.0
        state[i, ANGLE] = load_float(at + AT_ANGLE)
        state[i, SPIN] = load_float(at + AT_SPIN) * motion[M_SPIN_UNIT]
        state[i, TORQUE] = 0.0


@njit(**PLAIN)
def fast(n_mobile, state):
    """Whether a body is faster than the list of near pairs allows, or is no number."""
    found = False
    for i in range(n_mobile):
        if not state[i, VX] * state[i, VX] + state[i, VY] * state[i, VY] <= state[i, LIMIT]:
            found = True
    return found


@njit(**PLAIN)
def add_to_bodies(n_mobile, bodies, state, motion, heavier):
    """What the kick does first: add the forces to what the user put on the bodies.

    The laws' forces have their share for what a body carries along; Chipmunk divides by all it moves.
    """
    for i in range(n_mobile):
        at = bodies[i]
        scale = motion[M_FORCE_SCALE] * heavier[i]
        store_float(at + AT_FORCE, load_float(at + AT_FORCE) + state[i, FX] * scale)
        store_float(at + AT_FORCE + 8, load_float(at + AT_FORCE + 8) + state[i, FY] * scale)
        if state[i, TORQUE] != 0.0:
            store_float(at + AT_TORQUE, load_float(at + AT_TORQUE) + state[i, TORQUE] * motion[M_TORQUE_SCALE])


@njit(**PLAIN)
def finite(state):
    for i in range(state.shape[0]):
        if not (math.isfinite(state[i, X]) and math.isfinite(state[i, Y])):
            return False
    return True


@njit(**PLAIN)
def surround(n_mobile, state, radius, allowance, reaching, headroom, dt, most, reach, ahead):
    """Give each body a speed limit, and so a way [m] within which its list of near pairs holds.

    Returns the number of steps for which: fewer where the fastest body would go farther than ``most``. Pairs that will
    be within reach ``ahead`` steps later are near, too.
    """
    top = 0.0
    for i in range(n_mobile):
        square = state[i, VX] * state[i, VX] + state[i, VY] * state[i, VY]
        speed = headroom + 1.25 * math.sqrt(square)
        top = max(top, speed)
        allowance[i] = speed
        state[i, LIMIT] = speed * speed
    lasts = 1.0 * NEAR_LASTS
    if top * lasts * dt > most:
        lasts = max(math.floor(most / (top * dt)), 1.0)
    # a hair more than the way at the limit: rounding in a drift and in the limit itself
    for i in range(n_mobile):
        way = allowance[i] * ((lasts + ahead) * dt * 1.000001)
        allowance[i] = way
        reaching[i] = radius[i] + 0.5 * reach + way
    return lasts


@cfunc(types.void(types.int64, types.int64), **CALLBACK)
def verlet_step(constraint, space):
    """A constraint's preSolve: after the drift, before any kick. One force call over the near pairs."""
    context = load_int(constraint + AT_USER_DATA)
    unpack(context)
    whole = carray(pointer_to(I[MOTION]), N_MOTION, np.int64)
    n_mobile = I[N_MOBILE]
    if I[OWN_DRIFT] == 0:
        gather(n_mobile, bodies, state, motion)
        if fast(n_mobile, state):
            whole[M_LEFT] = 1
    lasted = F[F_STEP] - F[F_PRUNED]
    early = whole[M_LEFT] != 0
    if early or lasted >= F[F_LASTS]:
        whole[M_LEFT] = 0
        if early and not finite(state):
            I[STATUS] = -2
            return
        # the near list is cut from the long one every few steps, the long one built every few hundred
        if early and lasted < NEAR_LASTS // 2:
            F[F_HEADROOM] *= 1.3
        elif not early:
            F[F_HEADROOM] *= 0.97
        F[F_PRUNED] = F[F_STEP]
        most = 0.25 * F[F_SKIN]
        F[F_HEADROOM] = min(F[F_HEADROOM], 0.5 * most / (NEAR_LASTS * F[F_DT]))
        F[F_LASTS] = surround(n_mobile, state, radius, allowance, reaching, F[F_HEADROOM], F[F_DT], most, F[F_REACH],
                              scalars[5])
        if I[ROOM] > 0 or I[N_WALLS] > 0:
            call_lists(I[RENEW_LISTS], context)
            if I[STATUS] != 0:
                return
    F[F_STEP] += 1.0
    t = F[F_T_START] + F[F_STEP] * F[F_DT]
    dt = F[F_DT]
    for i in range(n_mobile, n):
        state[i, FX] = 0.0  # of the mobile ones, the drift did it
        state[i, FY] = 0.0
        state[i, TORQUE] = 0.0
    add_forces(I[FROM_LIST], I[CONSTRAINED], t, dt, context)
    if I[PUSHED] != 0:
        # what the user put on the bodies, for this one step
        I[PUSHED] = 0
        for i in range(n_mobile):
            state[i, FX] += push[i, 0]
            state[i, FY] += push[i, 1]
            state[i, TORQUE] += push[i, 2]
    if I[OWN_KICK] == 0:
        add_to_bodies(n_mobile, bodies, state, motion, heavier)
