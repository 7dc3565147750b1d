"""A rigid massless rod from an anchor to the centre of a body: a pendulum."""

import math

from .base import Parameter, law


@law(
    kind="constraint",
    expression="|r - a| = L at every step (tension by the quadratic of SHAKE); "
    "with an inertia I about the centre, tangential forces are scaled by m L^2/(m L^2 + I)",
    reference="Ryckaert, Ciccotti & Berendsen 1977, J. Comput. Phys. 23, 327; doi:10.1016/0021-9991(77)90098-5",
    parameters=[
        Parameter("anchor", "m", "where the rod hangs", size=2),
        Parameter("length", "m", "length L of the rod", low=1e-12),
    ],
    role="pendulum",
)
def pin(x, y, vx, vy, mass, given_inertia, fx, fy, dt, anchor_x, anchor_y, length):
    dx = x - anchor_x
    dy = y - anchor_y
    # the body turns with the rod: its own inertia slows the swing
    square = dx * dx + dy * dy
    tangential = (fy * dx - fx * dy) / square
    turned = -tangential * given_inertia / (mass * length * length + given_inertia)
    fx_turned = -turned * dy
    fy_turned = turned * dx
    # the position after the next drift without tension, then the tension that keeps the length
    ux = dx + dt * (vx + dt * (fx + fx_turned) / mass)
    uy = dy + dt * (vy + dt * (fy + fy_turned) / mass)
    b = ux * dx + uy * dy
    c = ux * ux + uy * uy - length * length
    scale = -c / (b + math.sqrt(max(b * b - square * c, 0.0)))
    tension = scale * mass / (dt * dt)
    return fx_turned + tension * dx, fy_turned + tension * dy
