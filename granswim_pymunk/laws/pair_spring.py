"""A spring between bodies each of which something else holds: coupled pendulums, carts on one rail."""

from .base import AUTOMATIC, Parameter, law


@law(
    kind="pair",
    reach="cutoff",
    expression="F_n = f_0 - k d, d the distance of centres: a spring that is f_0/k long at rest",
    reference="Hooke 1678, De Potentia Restitutiva",
    parameters=[
        Parameter("k", "N/m", "stiffness of the spring", low=0.0, typical=1.0, needed=True),
        Parameter("f_0", "N", "stiffness times the length at rest; above zero it pushes what is nearer", typical=1.0),
        Parameter(
            "cutoff",
            "m",
            "gap beyond which there is none; left out: as the range of distance_force",
            low=0.0,
            default=AUTOMATIC,
        ),
    ],
    strength=("k", "f_0"),
    candidate="named",
    refines=("pin", "hinge", "rail", "spring"),
    phrase="a spring between bodies",
)
def pair_spring(distance, k, f_0, cutoff):
    return f_0 - k * distance, 0.0
