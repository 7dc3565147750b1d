"""Drag against a medium that moves."""

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = -c (v_i - u)",
    reference="Stokes 1851, Trans. Camb. Phil. Soc. 9, 8; in the frame of the medium",
    parameters=[
        Parameter("c", "kg/s", "drag coefficient", low=0.0, typical=1.0),
        Parameter(
            "u", "m/s", "velocity of the medium", size=2, default=(0.0, 0.0), typical=1.0e-2, within="speed"
        ),
    ],
    strength=("c",),
    candidate="named",
    phrase="an ambient flow",
    nests=("linear_drag",),
    linear=True,
    role="medium",
)
def ambient_flow(vx, vy, c, u_x, u_y):
    return -c * (vx - u_x), -c * (vy - u_y)
