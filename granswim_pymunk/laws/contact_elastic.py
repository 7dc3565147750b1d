"""Instantaneous collision by Chipmunk's own impulse solver."""

from .base import Parameter, law


@law(
    kind="impulse",
    expression="v_n' = -e v_n",
    reference="Newton 1687; Chipmunk2D cpArbiter",
    parameters=[Parameter("restitution", "1", "coefficient of restitution e", low=0.0, high=1.0)],
    role="contact",
    loses="restitution",
)
def contact_elastic(vn, restitution):
    """Normal relative velocity after the collision [m/s]."""
    return -restitution * vn
