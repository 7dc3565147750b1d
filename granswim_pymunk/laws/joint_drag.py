"""Viscous friction in a pin or hinge."""

from .base import Parameter, law


@law(
    kind="joint",
    expression="torque on b = -c (w_b - w_a), the opposite on a; in a pin, or a hinge of one body, w_a = 0",
    reference="Stokes 1851, Trans. Camb. Phil. Soc. 9, 8 (a film that is sheared)",
    parameters=[Parameter("c", "N m s", "drag coefficient c of the joint", low=0.0, typical=1.0)],
    strength=("c",),
    candidate="named",
    refines=("hinge", "pin"),
    preferred_where=("hinge", "pin"),
    stands_for=("linear_drag",),
)
def joint_drag(rate, c):
    return -c * rate
