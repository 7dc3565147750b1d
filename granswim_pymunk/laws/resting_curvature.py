"""A swimmer that is not straight at rest."""

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
def resting_curvature(index, phi_0, joint, stiffness):
    # the choices are counted: 0 is "all", 1 joint 0
    return stiffness * phi_0 if joint == 0 or joint == index + 1 else 0.0
