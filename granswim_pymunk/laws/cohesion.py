"""An attraction between bodies that touch or nearly do."""

from .base import Parameter, law


@law(
    kind="pair",
    reach="range",
    expression="F_n = -F_c while gap < range",
    reference="Herminghaus 2005, Adv. Phys. 54, 221 (wet grains); doi:10.1080/00018730500167855",
    parameters=[
        Parameter("force", "N", "attraction F_c", low=0.0, typical=1.0, in_bed=30.0, in_bed_times="force"),
        Parameter("range", "m", "gap up to which it acts", low=0.0, default=1.0e-4, typical=1.0e-4),
    ],
    strength=("force",),
    candidate="named",
)
def cohesion(gap, force, range):
    return -force, 0.0
