"""What stands behind the names of the core's text, for editors and linters alone: the values are never used.

Upper case: numbers that ``callbacks`` writes before the text. X, VX ... columns of the rows that the laws see, P_ the
same, unsigned; W_ where the numbers of the pairs that touch begin in ``work``; F_ slots of the floats of the context,
M_ of ``motion``, USE_ columns of ``uses``; AT_ offsets in Chipmunk's memory; the others are slots of its whole numbers.

Lower case: arrays that ``unpack`` finds behind the pointer to the context; I, F, n: its whole numbers, its floats, how
many bodies there are.
"""

from collections.abc import Callable
from typing import Any

PLAIN: dict[str, Any] = {}
CALLBACK: dict[str, Any] = {}
_ANY: Any = None
I = F = _ANY
n: int = 0


def njit(**options: Any) -> Callable[[Any], Any]:
    """Stands for that of ``compiled``: nothing is compiled here."""
    return lambda function: function


def cfunc(signature: Any, **options: Any) -> Callable[[Any], Any]:
    return lambda function: function


def unpack(context: int) -> None:
    """Stands for the lines that make arrays of what is behind the pointer, those that the function uses."""


ADD_WALLS = ANGLE = AT_ANGLE = AT_BODY_A = AT_BODY_B = AT_FORCE = AT_POSITION = AT_PROCESS_COLLISION = AT_SPIN = 0
AT_TORQUE = AT_TRANSFORM = AT_USER_DATA = AT_VELOCITY = CODE_CONSTRAINT = CODE_PAIR = CONSTRAINED = CUTS = 0
FIRST_BODY = FIXED_SKIN = FROM_LIST = FX = FY = F_BUILT = F_DT = F_HEADROOM = F_LASTS = F_LEAST_SKIN = 0
F_MOST_SKIN = F_PRUNED = F_REACH = F_SKIN = F_STEP = F_T_START = HOLD_LINKS = LIMIT = LONG_BUILD = 0
MARGIN_CROSSED = MOTION = M_FORCE_SCALE = M_LEFT = M_LENGTH_UNIT = M_MARGIN = M_SPIN_UNIT = M_TORQUE_SCALE = 0
M_VELOCITY_UNIT = NEAR_LASTS = NEAR_X = NEAR_Y = N_CONTACTS = N_LINKED = N_MOBILE = N_MOTION = N_PAIRS = 0
N_WALLS = OWN_DRIFT = OWN_KICK = PUSHED = P_FX = P_ROW = P_SPIN = P_TORQUE = P_VX = P_VY = P_X = P_Y = REBUILDS = 0
RENEW_LISTS = ROOM = ROW = SCHEME_CHAINS = SCHEME_HALF_STEP = SCHEME_TOGETHER = SHORT_BUILD = SPIN = STATUS = 0
TORQUE = USE_BLOCK = USE_CODE = USE_DAMPING = USE_ONE = USE_WALL = VX = VY = WALL_ROW = W_DX = W_DY = W_MASS = 0
W_PX = W_PY = W_RI = W_RJ = W_TI = W_TJ = W_TOUCH = W_UX = W_UY = W_WI = W_WJ = X = Y = 0
allowance = apart = blocks = bodies = contact_fx = contact_fy = contact_i = contact_j = contact_ti = _ANY
contact_tj = group = heads = heavier = image_shift = inverse_mass = inverse_moment = kept = kick_mass = link_arms = _ANY
link_first = link_gap = link_geometry = link_here = link_kind = link_matrix = link_push = link_q = _ANY
link_second = link_there = link_trial = linked = listing = mask = mass = mobile = mobility = motion = near_i = _ANY
near_j = near_mass = near_seam = near_shift = near_starts = near_touch = nexts = old_x = old_y = order = _ANY
pair_i = pair_j = pair_shift = place_x = place_y = push = radius = reaching = scalars = sorted_reach = _ANY
sorted_x = sorted_y = starts = state = table_keys = table_values = uses = wall_i = wall_k = wall_met = _ANY
wall_starts = walls = work = _ANY
