"""Forces of hinges and rods. Text, see ``kernel``."""

import math

from numba import types

from ..links import close
from .names import *

# ---- text ----


@cfunc(types.void(types.int64, types.float64), **CALLBACK)
def hold_links(context, dt):
    """Forces and torques of hinges and rods, all other forces being there: the coming drift leaves no gap."""
    unpack(context)
    arm = scalars[7]
    for k in range(linked.shape[0]):
        i = linked[k]
        link_q[k, 0] = state[i, X]
        link_q[k, 1] = state[i, Y]
        link_q[k, 2] = state[i, ANGLE]
        link_trial[k, 0] = state[i, X] + dt * (state[i, VX] + dt * (inverse_mass[i] * state[i, FX]))
        link_trial[k, 1] = state[i, Y] + dt * (state[i, VY] + dt * (inverse_mass[i] * state[i, FY]))
        link_trial[k, 2] = state[i, ANGLE]
        if mobility[k, 3] > 0.0:
            link_trial[k, 2] += dt * (state[i, SPIN] + dt * (inverse_moment[i] * state[i, TORQUE]))
        else:
            state[i, TORQUE] = 0.0  # on a rail, or driven: it does not turn
    if not close(link_kind, link_first, link_second, link_geometry, mobility, arm, link_q, link_trial, dt * dt,
                 link_gap, link_arms, link_here, link_there, link_matrix, link_push):
        state[linked[0], FX] = math.nan  # noticed as a position that is not finite
        return
    for k in range(linked.shape[0]):
        i = linked[k]
        x = link_push[k, 0]
        y = link_push[k, 1]
        state[i, FX] += mass[i] * (mobility[k, 0] * x + mobility[k, 1] * y)
        state[i, FY] += mass[i] * (mobility[k, 1] * x + mobility[k, 2] * y)
        if mobility[k, 3] > 0.0:
            state[i, TORQUE] += link_push[k, 2]
