"""Bending of the swimmer towards its driven head axis."""

import math

from .base import AUTOMATIC, Parameter, law

FORMS = ("leader", "elastic", "head_axis")


def of_bending(*names: str) -> list[Parameter]:
    """Declarations of numbers that a law which acts on the bending shares with it, and takes from it where not given.

    ``names`` : of ``stiffness`` [N], ``amplitude`` [rad], ``frequency`` [Hz], ``phase`` [rad], ``form``, ``length`` [m]
    """
    axis = "of the head axis; that of the scene's bending where not given"
    shared = (
        Parameter(
            "stiffness",
            "N",
            "bending force per radian; that of the scene's bending where not given",
            low=0.0,
            default=AUTOMATIC,
        ),
        Parameter("amplitude", "rad", f"amplitude {axis}", default=AUTOMATIC),
        Parameter("frequency", "Hz", f"frequency {axis}", low=0.0, default=AUTOMATIC),
        Parameter("phase", "rad", f"phase {axis}", default=AUTOMATIC),
        Parameter("form", "", "form of the bending; the scene's where not given", default=AUTOMATIC, choices=FORMS),
        Parameter(
            "length",
            "m",
            "resting distance of disks (form = elastic); the scene's where not given",
            low=0.0,
            default=AUTOMATIC,
        ),
    )
    declared = {p.name: p for p in shared}
    return [declared[name] for name in names]


@law(
    kind="chain",
    expression="F_t = -k_B phi_i - gamma_B m_r v_ij.t on i+1, the opposite on i; "
    "phi_i = alpha_i - alpha_(i-1), alpha_(-1) = A sin(2 pi f t + phase)",
    reference="Echeverria-Huarte, Telo da Gama & Araujo, "
    "Optimal frequency for undulatory motion in granular media, Eq. 3",
    parameters=[
        Parameter("stiffness", "N", "bending force per radian k_B", low=0.0),
        Parameter("damping", "1/s", "bending damping gamma_B", low=0.0, default=0.0),
        Parameter("amplitude", "rad", "amplitude A of the head axis"),
        Parameter("frequency", "Hz", "frequency f of the head axis", low=0.0),
        Parameter("phase", "rad", "phase of the head axis", default=0.0),
        Parameter(
            "form",
            "",
            "leader: phi_i acts on the pair i, i+1; elastic: forces of the energy k_B d/2 sum phi^2 on "
            "the trimer; head_axis: phi_i = alpha_i - theta_head",
            default="leader",
            choices=FORMS,
        ),
        Parameter(
            "length",
            "m",
            "resting distance d of consecutive disks, used by form = elastic only; that of the scene's "
            "union, else twice the radius, where not given",
            low=0.0,
            default=AUTOMATIC,
        ),
    ],
)
def bending(t, x, y, vx, vy, mass, fx, fy, stiffness, damping, amplitude, frequency, phase, form, length):
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
        reduced = mass[i] * mass[j] / (mass[i] + mass[j])
        vt = (vx[j] - vx[i]) * tx + (vy[j] - vy[i]) * ty
        force = -damping * reduced * vt
        if form == 1:
            # minus the gradient of k_B d/2 phi^2: the torque k_B d phi turns this segment back and, from
            # the second joint on, the segment before it forward; d is a constant, or energy would leak
            force -= stiffness * bend * length / distance
            if i > 0:
                reaction = stiffness * bend * length / previous_length
                fx[i] += reaction * previous_tx
                fy[i] += reaction * previous_ty
                fx[i - 1] -= reaction * previous_tx
                fy[i - 1] -= reaction * previous_ty
        else:
            force -= stiffness * bend
        fx[j] += force * tx
        fy[j] += force * ty
        fx[i] -= force * tx
        fy[i] -= force * ty
        previous = angle
        previous_length = distance
        previous_tx = tx
        previous_ty = ty
