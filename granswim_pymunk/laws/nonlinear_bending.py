"""Joints that stiffen as they bend."""

import math

from .base import Parameter, law
from .bending import of_bending


@law(
    kind="chain",
    expression="F_t = -k_3 phi_i^3 on i+1, the opposite on i (form = elastic: the forces of k_3 d/4 sum "
    "phi^4)",
    reference="Landau & Lifshitz, Theory of Elasticity, ch. II, with the next even power of the bend",
    parameters=[
        Parameter("k_3", "N/rad^3", "cubic bending force", typical=1.0e-3),
        *of_bending("amplitude", "frequency", "phase", "form", "length"),
    ],
    strength=("k_3",),
    candidate="named",
    refines=("bending",),
)
def nonlinear_bending(t, x, y, fx, fy, k_3, amplitude, frequency, phase, form, length):
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
        force = -k_3 * bend * bend * bend
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
