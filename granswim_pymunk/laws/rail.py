"""A body that can move along a line only."""

import math

from .base import Parameter, law


@law(
    kind="constraint",
    expression="v.n = 0, n across the direction of the rail",
    reference="Goldstein, Classical Mechanics, ch. 1.3 (holonomic constraint)",
    parameters=[Parameter("direction", "1", "direction of the rail; its length does not matter", size=2)],
    role="guide",
)
def rail(vx, vy, mass, fx, fy, dt, direction_x, direction_y):
    size = math.sqrt(direction_x * direction_x + direction_y * direction_y)
    nx = -direction_y / size
    ny = direction_x / size
    across = (fx + mass * vx / dt) * nx + (fy + mass * vy / dt) * ny
    return -across * nx, -across * ny
