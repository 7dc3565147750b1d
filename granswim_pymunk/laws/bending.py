"""Bending of the swimmer towards its driven head axis."""

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
    role="stroke",
)
def bending(bend, vt, reduced_mass, stiffness, damping):
    return -stiffness * bend, -damping * reduced_mass * vt
