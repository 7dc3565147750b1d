"""Near pairs: cut from the long list every few steps, the long list made every few hundred. Text, see ``kernel``."""

from numba import types

from ..neighbours import build_list, moved, near_walls, prune
from .names import *

# ---- text ----


@cfunc(types.void(types.int64), **CALLBACK)
def renew_lists(context):
    """Lists of near pairs, and of bodies near straight walls, for the coming steps."""
    unpack(context)
    n_mobile = I[N_MOBILE]
    if I[ROOM] > 0:
        I[CUTS] += 1
        for i in range(n):
            place_x[i] = state[i, X]
            place_y[i] = state[i, Y]
        if moved(place_x, place_y, old_x, old_y, n_mobile, 0.5 * F[F_SKIN], allowance):
            if I[FIXED_SKIN] == 0 and I[REBUILDS] > 0:
                # a list that lasts too short was too narrow, one that lasts long has pairs to spare
                if F[F_STEP] - F[F_BUILT] < SHORT_BUILD:
                    F[F_SKIN] = min(1.2 * F[F_SKIN], F[F_MOST_SKIN])
                elif F[F_STEP] - F[F_BUILT] > LONG_BUILD:
                    F[F_SKIN] = max(0.9 * F[F_SKIN], F[F_LEAST_SKIN])
            F[F_BUILT] = F[F_STEP]
            count = build_list(place_x, place_y, radius, mobile, group, apart, F[F_REACH] + F[F_SKIN], scalars[0],
                               pair_i, pair_j, pair_shift, heads, nexts, sorted_x, sorted_y, sorted_reach, near_i,
                               near_j, starts)
            if count < 0:
                I[STATUS] = count
                return
            I[N_PAIRS] = count
            I[REBUILDS] += 1
            for i in range(n):
                old_x[i] = place_x[i]
                old_y[i] = place_y[i]
        prune(place_x, place_y, reaching, inverse_mass, radius, starts, blocks, pair_i, pair_j, pair_shift, near_i,
              near_j, near_shift, near_touch, near_mass, near_starts, near_seam, ROW)
        if I[N_WALLS] > 0:
            near_walls(place_x, place_y, reaching, mobile, walls, scalars[0], blocks, wall_i, wall_k, wall_starts)
