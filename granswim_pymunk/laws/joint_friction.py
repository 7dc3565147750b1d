"""Dry friction of the swimmer's joints."""

import math

from .base import Parameter, law
from .bending import of_bending


@law(
    kind="chain",
    expression="F_t = -F w/sqrt(w^2 + w_0^2) on i+1, the opposite on i; w = dphi_i/dt",
    reference="Coulomb 1785, Theorie des machines simples",
    parameters=[
        Parameter("force", "N", "friction force F of each joint", low=0.0, typical=1.0e-4),
        Parameter(
            "w_0", "rad/s", "rate of bending below which it goes smoothly to zero", low=0.0, default=1.0
        ),
        *of_bending("amplitude", "frequency", "phase", "form", "length"),
    ],
    strength=("force",),
    candidate="named",
    phrase="friction in the joints",
    refines=("bending",),
    damping=True,
)
def joint_friction(t, x, y, vx, vy, fx, fy, force, w_0, amplitude, frequency, phase, form, length):
    most = force
    turning = 2.0 * math.pi * frequency
    head_rate = amplitude * turning * math.cos(turning * t + phase)
    previous_rate = head_rate
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
        rate = ((vx[j] - vx[i]) * tx + (vy[j] - vy[i]) * ty) / distance
        bending_rate = rate - (head_rate if form == 2 else previous_rate)
        size = math.sqrt(bending_rate * bending_rate + w_0 * w_0)
        force = -most * bending_rate / size if size > 0.0 else 0.0
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
        previous_rate = rate
        previous_length = distance
        previous_tx = tx
        previous_ty = ty
