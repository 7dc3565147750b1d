"""One joint that is softer, or stiffer, than the others."""

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
            "factor", "1", "stiffness of the joint in units of the others'", low=0.0, typical=0.5, side=-1, neutral=1.0
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
def weak_joint(bend, index, factor, joint, stiffness):
    return -(factor - 1.0) * stiffness * bend if index == joint else 0.0
