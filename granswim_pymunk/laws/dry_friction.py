"""Dry friction against the substrate that holds: what it has brought to rest stays, up to the largest friction."""

import math

from .base import Parameter, law


@law(
    kind="constraint",
    expression="F_i = -mu m_i g v_i/|v_i|; at rest what keeps it there, up to mu m_i g",
    reference="Coulomb 1785, Theorie des machines simples; Moreau 1999, Comput. Methods Appl. Mech. Eng. 177, 329",
    parameters=[Parameter("mu", "1", "friction coefficient, of rest and of motion", low=0.0, typical=0.1)],
    strength=("mu",),
    candidate="named",
    phrase="dry friction with the substrate",
    form_of="coulomb_substrate",
    form="that holds",
    role="brake",
    # where something draws on a body at rest: elsewhere the friction that is smooth at small speeds is the same
    preferred_where=("spring", "pair_spring", "rail"),
    stands_for=("coulomb_substrate",),
)
def dry_friction(vx, vy, mass, g, fx, fy, dt, mu):
    # the step is cut in two where it comes to rest: v + t (F + friction)/m = 0
    most = mu * mass * g
    if most == 0.0:
        return 0.0, 0.0
    speed = math.sqrt(vx * vx + vy * vy)
    rest = dt
    if speed > 0.0:
        ux = vx / speed
        uy = vy / speed
        slowing = most - fx * ux - fy * uy
        if slowing * dt < mass * speed:  # it goes on: along the motion in the middle of the step
            mx = vx + 0.5 * dt * (fx - most * ux) / mass
            my = vy + 0.5 * dt * (fy - most * uy) / mass
            size = math.sqrt(mx * mx + my * my)
            return -most * mx / size, -most * my / size
        rest = dt - mass * speed / slowing
    # from rest on: it is held, or slides where the forces draw it
    size = math.sqrt(fx * fx + fy * fy)
    left = rest * (1.0 - most / size) / mass if size > most else 0.0
    return mass * (left * fx - vx) / dt - fx, mass * (left * fy - vy) / dt - fy
