"""Numbers that the core of generated code defines (see ``callbacks``), named here for editors and linters alone.

FX ... : columns of the rows that the laws see;  P_... : the same, unsigned
W_... : where the numbers of the pairs that touch begin in ``work``;  PLAIN : options of compilation
"""

from typing import Any

PLAIN: dict[str, Any]
FX: int
FY: int
P_FX: int
P_ROW: int
P_SPIN: int
P_TORQUE: int
P_VX: int
P_VY: int
P_X: int
P_Y: int
SPIN: int
TORQUE: int
VX: int
VY: int
W_DX: int
W_DY: int
W_MASS: int
W_PX: int
W_PY: int
W_RI: int
W_RJ: int
W_TI: int
W_TJ: int
W_TOUCH: int
W_UX: int
W_UY: int
W_WI: int
W_WJ: int
