"""A body that follows a commanded velocity exactly."""

import math

from .base import Parameter, law


@law(
    kind="constraint",
    expression="v = gain * input(t) along the direction of the body's rail",
    reference="Goldstein, Classical Mechanics, ch. 1.3 (rheonomic constraint)",
    parameters=[
        Parameter("gain", "1", "commanded velocity per unit of input", default=1.0),
        Parameter(
            "direction",
            "1",
            "direction of the motion; that of the body's rail where it has one",
            size=2,
            default=(1.0, 0.0),
        ),
    ],
    role="command",
)
def drive(vx, vy, mass, fx, fy, dt, command, gain, direction_x, direction_y):
    size = math.sqrt(direction_x * direction_x + direction_y * direction_y)
    target_x = gain * command * direction_x / size
    target_y = gain * command * direction_y / size
    return mass * (target_x - vx) / dt - fx, mass * (target_y - vy) / dt - fy
