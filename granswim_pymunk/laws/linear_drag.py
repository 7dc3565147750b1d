"""Drag proportional to the velocity."""

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = -c (r_i/r_0)^p v_i",
    reference="Stokes 1851, Trans. Camb. Phil. Soc. 9, 8",
    parameters=[
        Parameter("c", "kg/s", "drag coefficient of a body of the mean radius r_0", low=0.0, typical=1.0),
        Parameter("p", "1", "power of the radius", default=0.0, choices=(0, 1)),
    ],
    strength=("c",),
    candidate="named",
    linear=True,
    apart=True,
    role="drag",
)
def linear_drag(vx, vy, radius, r0, c, p):
    rate = c * (radius / r0) if p == 1 else c
    return -rate * vx, -rate * vy
