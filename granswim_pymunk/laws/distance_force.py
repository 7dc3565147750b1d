"""A force between bodies that do not touch."""

from .base import AUTOMATIC, Parameter, law


@law(
    kind="pair",
    reach="range",
    expression="F_n = s (r_0/d)^n while 0 < gap < range, d the distance of centres; s > 0 repels",
    reference="Mie 1903, Ann. Phys. 316, 657 (inverse powers); doi:10.1002/andp.19033160802",
    parameters=[
        Parameter(
            "s", "N", "force at a distance of one mean radius r_0", typical=1.0, in_bed=3.0, in_bed_times="force"
        ),
        Parameter("n", "1", "power of the distance", low=0.0, high=20.0, default=2.0, typical=2.0),
        Parameter(
            "range",
            "m",
            "gap beyond which there is none; left out: no limit in a scene of up to 100 bodies, six mean "
            "radii in a larger one, and never beyond the nearest image of a period",
            low=0.0,
            default=AUTOMATIC,
        ),
    ],
    strength=("s",),
    candidate="named",
    phrase="a force at a distance",
)
def distance_force(gap, distance, r0, s, n, range):
    if gap <= 0.0:
        return 0.0, 0.0
    ratio = r0 / distance
    # where the power is not asked for, as in most fits, no logarithm is needed
    return s * (ratio * ratio if n == 2.0 else ratio**n), 0.0
