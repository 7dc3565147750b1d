"""Instantaneous collision by Chipmunk's own impulse solver."""

from .base import AUTOMATIC, Parameter, law


@law(
    kind="impulse",
    expression="v_n' = -e v_n",
    reference="Newton 1687; Chipmunk2D cpArbiter",
    parameters=[
        Parameter("restitution", "1", "coefficient of restitution e", low=0.0, high=1.0),
        Parameter(
            "wall_restitution",
            "1",
            "e at straight walls, as of cushions; that of bodies where not given",
            low=0.0,
            high=1.0,
            default=AUTOMATIC,
        ),
    ],
    role="contact",
    loses="restitution",
    loses_at_walls="wall_restitution",
)
def contact_elastic(vn, at_wall, restitution, wall_restitution):
    """Normal relative velocity after the collision [m/s]."""
    return -(wall_restitution if at_wall else restitution) * vn
