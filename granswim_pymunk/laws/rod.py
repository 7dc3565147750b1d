"""A rigid massless rod between the centres of two bodies."""

from .base import Parameter, law


@law(
    kind="link",
    expression="|r_b - r_a| = L at every step",
    reference="Ryckaert, Ciccotti & Berendsen 1977, J. Comput. Phys. 23, 327; doi:10.1016/0021-9991(77)90098-5",
    parameters=[Parameter("length", "m", "length L of the rod", low=1.0e-12)],
    role="bar",
)
def rod(x_i, y_i, x_j, y_j, length):
    """What is held at zero [m]."""
    return (((x_j - x_i) ** 2 + (y_j - y_i) ** 2 - length * length) / (2.0 * length),)
