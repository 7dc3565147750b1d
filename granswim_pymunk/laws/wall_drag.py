"""Drag near the walls below and above, and near straight walls wherever they are."""

from .base import AUTOMATIC, Parameter, law


@law(
    kind="body",
    expression=(
        "F_i = -c v_i while the gap to the wall below or above, or to a straight wall, is below the range; it sets in"
        " along a tenth of the range, half of it to either side"
    ),
    reference="Faxen 1922, Ann. Phys. 373, 89 (drag grows near a wall); doi:10.1002/andp.19223731003",
    parameters=[
        Parameter("c", "kg/s", "drag coefficient near a wall", low=0.0, typical=1.0, in_bed=10.0, in_bed_times="drag"),
        Parameter(
            "range",
            "m",
            "gap between body and wall up to which it acts",
            low=0.0,
            default=2.0e-3,
            typical=2.0e-3,
            within="sight",
        ),
        Parameter(
            "bottom",
            "m",
            "y of the wall below; the top of the lowest row of wall bodies where not given",
            default=AUTOMATIC,
        ),
        Parameter(
            "top",
            "m",
            "y of the wall above; the bottom of the highest row of wall bodies where not given",
            default=AUTOMATIC,
        ),
    ],
    strength=("c",),
    candidate="named",
    phrase="drag near the walls",
)
def wall_drag(y, vx, vy, radius, wall_gap, c, range, bottom, top):
    # with a sharp edge a run would hang on the range by whole steps alone, and no number could be fitted to it
    gap = min(min(y - bottom, top - y) - radius, wall_gap)
    if gap < 0.95 * range:
        return -c * vx, -c * vy
    if gap < 1.05 * range:
        part = c * (1.05 * range - gap) / (0.1 * range)
        return -part * vx, -part * vy
    return 0.0, 0.0
