"""A form without a name across the motion: a force that turns a path and does no work, as on a spinning ball."""

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = s (-v_y, v_x)",
    reference="Magnus 1853, Ann. Phys. 164, 1 (lift of spinning bodies)",
    parameters=[Parameter("s", "kg/s", "force to the left of the motion over speed", default=0.0, typical=1.0)],
    strength=("s",),
    candidate="flexible",
    role="across",
    phrase="a force across the motion",
)
def flexible_across(vx, vy, s):
    return -s * vy, s * vx
