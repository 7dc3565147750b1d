"""A form without a name in place and velocity: the equation of motion about a point, to first order in both."""

from .base import Parameter, law
from .flexible_place import SCALED, coefficients

_COEFFICIENTS = coefficients("1", "x", "y")


@law(
    kind="body",
    expression="F_i = sum_k a_k p_k(x_i, y_i) - c v_i, p_k the monomials to the first degree",
    reference="Goldstein, Poole & Safko, Classical Mechanics, ch. 6 (forced and damped oscillations about a point)",
    parameters=[
        *SCALED,
        *_COEFFICIENTS,
        Parameter("c", "kg/s", "drag coefficient", low=0.0, default=0.0, typical=1.0),
    ],
    strength=(*(p.name for p in _COEFFICIENTS), "c"),
    candidate="flexible",
    role="place",
    form_of="flexible_place",
    form="to first order, with a drag",
    phrase="a force that depends on the place",
)
def flexible_spring(x, y, vx, vy, centre_x, centre_y, size, a0, a1, a2, b0, b1, b2, c):
    u = (x - centre_x) / size
    v = (y - centre_y) / size
    return a0 + a1 * u + a2 * v - c * vx, b0 + b1 * u + b2 * v - c * vy
