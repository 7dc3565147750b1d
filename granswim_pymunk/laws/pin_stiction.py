"""Dry friction in a pin that holds: a pendulum that it has brought to rest stays there, beside the vertical."""

import math

from .base import AUTOMATIC, Parameter, law


@law(
    kind="constraint",
    expression="torque on b = -M w/|w|, w its angular velocity about the pin; at rest what keeps it there, up to M",
    reference="Coulomb 1785, Theorie des machines simples; Moreau 1999, Comput. Methods Appl. Mech. Eng. 177, 329",
    parameters=[
        Parameter("torque", "N m", "friction torque M, of rest and of motion", low=0.0, typical=1.0),
        Parameter("anchor", "m", "where the rod hangs; that of the scene's pin where not given", size=2,
                  default=AUTOMATIC),
    ],
    strength=("torque",),
    candidate="named",
    refines=("pin",),
    form_of="joint_friction",
    form="that holds",
    role="brake",
    preferred_where=("pin",),
    stands_for=("joint_friction", "coulomb_substrate"),
)
def pin_stiction(x, y, vx, vy, mass, given_inertia, fx, fy, dt, torque, anchor_x, anchor_y):
    dx = x - anchor_x
    dy = y - anchor_y
    length = math.sqrt(dx * dx + dy * dy)
    tx = -dy / length
    ty = dx / length
    heavy = mass + given_inertia / (length * length)
    most = torque / length
    pull = fx * tx + fy * ty
    speed = vx * tx + vy * ty
    rest = dt
    if speed != 0.0:
        side = math.copysign(1.0, speed)
        slowing = most - pull * side
        if slowing * dt < heavy * abs(speed):
            return -most * side * tx, -most * side * ty
        rest = dt - heavy * abs(speed) / slowing
    # from rest on: it is held, or swings where the forces draw it
    left = rest * (1.0 - most / abs(pull)) / heavy if abs(pull) > most else 0.0
    push = heavy * (left * pull - speed) / dt - pull if most > 0.0 else 0.0
    return push * tx, push * ty
