"""Lift: the force across its motion on a ball that spins, or on a wing, in the air."""

import math

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = l |v_i| (-v_y, v_x)",
    reference="Magnus 1853, Ann. Phys. 164, 1; Mehta 1985, Annu. Rev. Fluid Mech. 17, 151 (balls in sports)",
    parameters=[
        Parameter("l", "kg/m", "lift over the square of the speed, to the left of the motion above 0", typical=1.0),
    ],
    strength=("l",),
    candidate="named",
    phrase="a lift, as of a ball that spins",
    role="across",
)
def lift(vx, vy, l):
    speed = math.sqrt(vx * vx + vy * vy)
    return -l * speed * vy, l * speed * vx
