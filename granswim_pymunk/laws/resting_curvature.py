"""A swimmer that is not straight at rest."""

import math

from .base import Parameter, law
from .bending import of_bending


@law(
    kind="chain",
    expression="F_t = +k_B phi_0 on j+1, the opposite on j: the bend phi_j counts from phi_0, at one joint "
    "or all",
    reference="Echeverria-Huarte, Telo da Gama & Araujo, Optimal frequency for undulatory motion in "
    "granular media, Eq. 3",
    parameters=[
        Parameter("phi_0", "rad", "bend at rest", low=-3.14, high=3.14, typical=0.1),
        Parameter(
            "joint",
            "1",
            "which joint, or all; 0 is the one against the head's axis",
            choices=("all", *range(32)),
            default="all",
        ),
        *of_bending("stiffness", "form", "length"),
    ],
    strength=("phi_0",),
    candidate="named",
    phrase="a resting curvature",
    refines=("bending",),
)
def resting_curvature(x, y, fx, fy, phi_0, joint, stiffness, form, length):
    previous_length = 1.0
    previous_tx = 0.0
    previous_ty = 0.0
    for i in range(x.shape[0] - 1):
        j = i + 1
        dx = x[j] - x[i]
        dy = y[j] - y[i]
        distance = math.sqrt(dx * dx + dy * dy)
        tx = -dy / distance
        ty = dx / distance
        # the choices are counted: 0 is "all", 1 joint 0
        force = stiffness * phi_0 if joint == 0 or joint == i + 1 else 0.0
        if form == 1:
            # as the gradient of an energy: a torque on this segment, the opposite one on the segment before
            if i > 0:
                back = force * length / previous_length
                fx[i] -= back * previous_tx
                fy[i] -= back * previous_ty
                fx[i - 1] += back * previous_tx
                fy[i - 1] += back * previous_ty
            force *= length / distance
        fx[j] += force * tx
        fy[j] += force * ty
        fx[i] -= force * tx
        fy[i] -= force * ty
        previous_length = distance
        previous_tx = tx
        previous_ty = ty
