"""Numbers that the core of generated code defines (see ``callbacks``), named here for editors and linters alone.

The values are those of the core; these here are never used.

FX ... : columns of the rows that the laws see;  P_... : the same, unsigned
W_... : where the numbers of the pairs that touch begin in ``work``;  PLAIN : options of compilation
"""

from typing import Any

PLAIN: dict[str, Any] = {}
FX: int = 0
FY: int = 0
P_FX: int = 0
P_ROW: int = 0
P_SPIN: int = 0
P_TORQUE: int = 0
P_VX: int = 0
P_VY: int = 0
P_X: int = 0
P_Y: int = 0
SPIN: int = 0
TORQUE: int = 0
VX: int = 0
VY: int = 0
W_DX: int = 0
W_DY: int = 0
W_MASS: int = 0
W_PX: int = 0
W_PY: int = 0
W_RI: int = 0
W_RJ: int = 0
W_TI: int = 0
W_TJ: int = 0
W_TOUCH: int = 0
W_UX: int = 0
W_UY: int = 0
W_WI: int = 0
W_WJ: int = 0
