"""Two bodies, or a body and the world, that turn about one point."""

import math

from .base import Parameter, law


@law(
    kind="link",
    expression="r_a + R(theta_a) a_a = r_b + R(theta_b) a_b at every step (forces by Newton's method on SHAKE's "
    "equations); with one body, r_a + R(theta_a) a_a = anchor",
    reference="Ryckaert, Ciccotti & Berendsen 1977, J. Comput. Phys. 23, 327; doi:10.1016/0021-9991(77)90098-5",
    parameters=[
        Parameter("anchor_a", "m", "the hinge in the axes of the first body", size=2, default=(0.0, 0.0)),
        Parameter("anchor_b", "m", "the hinge in the axes of the second body", size=2, default=(0.0, 0.0)),
        Parameter("anchor", "m", "the hinge in the scene, where there is one body", size=2, default=(0.0, 0.0)),
    ],
    role="pivot",
)
def hinge(x_i, y_i, angle_i, x_j, y_j, angle_j, anchor_a_x, anchor_a_y, anchor_b_x, anchor_b_y):
    """What is held at zero [m]: from the point of the first body to that of the second."""
    ci, si = math.cos(angle_i), math.sin(angle_i)
    cj, sj = math.cos(angle_j), math.sin(angle_j)
    return (
        x_j + cj * anchor_b_x - sj * anchor_b_y - x_i - ci * anchor_a_x + si * anchor_a_y,
        y_j + sj * anchor_b_x + cj * anchor_b_y - y_i - si * anchor_a_x - ci * anchor_a_y,
    )
