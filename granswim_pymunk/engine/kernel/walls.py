"""Forces of straight walls. Text, see ``kernel``."""

import math

import numpy as np
from numba import types

from ..native import call_wall
from ..neighbours import to_wall
from .names import *

# ---- text ----


@cfunc(types.void(types.int64, types.int64, types.int64, types.float64, types.float64), **CALLBACK)
def add_walls(context, begin, end, t, dt):
    """Add the forces [N] and torques [N m] of straight walls on the bodies that touch them."""
    unpack(context)
    step = scalars[5] * dt
    for m in range(begin, end):
        i = wall_i[m]
        k = wall_k[m]
        dx, dy = to_wall(state[i, X], state[i, Y], walls, k, scalars[0])
        ri = radius[i]
        touch = ri + walls[k, 4]
        square = dx * dx + dy * dy
        if square >= touch * touch or square == 0.0:
            continue
        d = math.sqrt(square)
        nx = dx / d
        ny = dy / d
        gap = d - touch
        wi = state[i, SPIN]
        vn = -state[i, VX] * nx - state[i, VY] * ny
        vt = state[i, VX] * ny - state[i, VY] * nx - wi * ri
        # a dashpot counts in its first and last step by the share of it that it lasts, as between bodies
        deep = abs(vn) * step
        if -gap < deep:
            vn *= 0.5 - gap / deep
        for u in range(uses.shape[0]):
            if uses[u, USE_WALL] != 0 and (uses[u, 4] == 0 or mask[u, i]):
                call_wall(uses[u, USE_WALL], context, u, np.int64(i), np.int64(k), t, d, gap, vn, vt, nx, ny)
