"""A form without a name in drag: one on this side of a straight edge, another beyond it, as on a partly rough table."""

import math

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = -(c_0 + (c_1 - c_0) S) v_i, S = (1 + tanh(r + p X + q Y))/2, X, Y the place from the centre over "
    "the size",
    reference="Jacobs, Jordan, Nowlan & Hinton 1991, Neural Comput. 3, 79 (two experts and a gate)",
    parameters=[
        Parameter("centre", "m", "where the scaled coordinates are zero", size=2, default=(0.0, 0.0)),
        Parameter("size", "m", "length that scales the coordinates", low=0.0, default=1.0),
        Parameter("c0", "kg/s", "drag on this side", default=0.0, typical=1.0),
        Parameter("c1", "kg/s", "drag beyond the edge", default=0.0, typical=1.0),
        Parameter("p", "1", "how steeply it becomes the other along x", low=-100.0, high=100.0, typical=1.0),
        Parameter("q", "1", "how steeply along y", low=-100.0, high=100.0, typical=0.5),
        Parameter("r", "1", "where: on the edge r + p X + q Y = 0", low=-100.0, high=100.0, typical=0.1),
    ],
    strength=("c0", "c1"),
    nests=("linear_drag",),
    candidate="flexible",
    phrase="a drag that begins at an edge",
)
def flexible_edge(x, y, vx, vy, centre_x, centre_y, size, c0, c1, p, q, r):
    gate = r + (p * (x - centre_x) + q * (y - centre_y)) / size
    rate = c0 + (c1 - c0) * 0.5 * (1.0 + math.tanh(gate))
    return -rate * vx, -rate * vy
