"""Joints that stiffen as they bend."""

from .base import Parameter, law
from .bending import of_bending


@law(
    kind="chain",
    expression="F_t = -k_3 phi_i^3 on i+1, the opposite on i (form = elastic: the forces of k_3 d/4 sum "
    "phi^4)",
    reference="Landau & Lifshitz, Theory of Elasticity, ch. II, with the next even power of the bend",
    parameters=[
        Parameter("k_3", "N/rad^3", "cubic bending force", typical=1.0e-3, in_bed=1e-3),
        *of_bending("amplitude", "frequency", "phase", "form", "length"),
    ],
    strength=("k_3",),
    candidate="named",
    refines=("bending",),
)
def nonlinear_bending(bend, k_3):
    return -k_3 * bend * bend * bend
