"""A constant acceleration: a tilted table, or gravity of another size."""

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = m_i a",
    reference="Galilei 1638, Discorsi",
    parameters=[Parameter("a", "m/s^2", "acceleration", size=2, typical=1.0)],
    strength=("a",),
    candidate="named",
    phrase="a uniform force",
    role="push",
    apart=True,
)
def uniform_force(mass, a_x, a_y):
    return mass * a_x, mass * a_y
