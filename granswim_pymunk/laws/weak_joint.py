"""One joint that is softer, or stiffer, than the others."""

import math

from .base import Parameter, law
from .bending import of_bending


@law(
    kind="chain",
    expression="F_t = -(factor - 1) k_B phi_j on j+1, the opposite on j: joint j has factor times the "
    "stiffness",
    reference="Echeverria-Huarte, Telo da Gama & Araujo, Optimal frequency for undulatory motion in "
    "granular media, Eq. 3",
    parameters=[
        Parameter(
            "factor", "1", "stiffness of the joint in units of the others'", low=0.0, typical=0.5, neutral=1.0
        ),
        Parameter(
            "joint",
            "1",
            "which joint; 0 is the one against the head's axis",
            choices=tuple(range(32)),
            default=0,
        ),
        *of_bending("stiffness", "amplitude", "frequency", "phase", "form", "length"),
    ],
    strength=("factor",),
    candidate="named",
    phrase="a weak joint",
    refines=("bending",),
)
def weak_joint(t, x, y, fx, fy, factor, joint, stiffness, amplitude, frequency, phase, form, length):
    head = amplitude * math.sin(2.0 * math.pi * frequency * t + phase)
    previous = head
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
        angle = math.atan2(dy, dx)
        bend = angle - (head if form == 2 else previous)
        bend -= 2.0 * math.pi * math.ceil((bend - math.pi) / (2.0 * math.pi))
        force = -(factor - 1.0) * stiffness * bend if i == joint else 0.0
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
        previous = angle
        previous_length = distance
        previous_tx = tx
        previous_ty = ty
