"""Steps that end where an impact begins.

Chipmunk finds an impulsive collision only when two disks overlap already, up to a whole step too late. For
scenes with ``contact_elastic`` the step is cut short at the time of contact, so that a prediction changes
smoothly with its start. Sources: event-driven molecular dynamics, Alder & Wainwright 1959, J. Chem. Phys. 31, 459.
"""

from __future__ import annotations

import math

from ..compiled import njit
from .native import call_step, load_float, store_float
from .neighbours import together

# of a step: how short the one across an impact is; the normal of the impact is off by half of it
SHORTEST = 0.001
# of a step: from where the time of contact is computed again; moving straight over a whole step is off by
# acceleration, and a step that ends inside the other disk gives the impact too late
NEAR = 0.03


@njit(cache=True, nogil=True)
def _time_to_contact(addresses, radius, group, apart, touching, mobile, position, velocity, most):
    """Shortest time [engine units] below ``most`` until two approaching disks touch, moving straight."""
    n = addresses.shape[0]
    soonest = most
    for i in range(n):
        if not touching[i]:
            continue
        for j in range(i + 1, n):
            if not touching[j] or not (mobile[i] or mobile[j]) or together(i, j, group, apart):
                continue
            dx = load_float(addresses[j] + position) - load_float(addresses[i] + position)
            dy = load_float(addresses[j] + position + 8) - load_float(addresses[i] + position + 8)
            ux = load_float(addresses[j] + velocity) - load_float(addresses[i] + velocity)
            uy = load_float(addresses[j] + velocity + 8) - load_float(addresses[i] + velocity + 8)
            b = dx * ux + dy * uy
            if b >= 0.0:
                continue
            touch = radius[i] + radius[j]
            c = dx * dx + dy * dy - touch * touch
            if c <= 0.0:
                continue  # touching already: Chipmunk has seen it
            a = ux * ux + uy * uy
            root = b * b - a * c
            if root < 0.0:
                continue
            when = c / (-b + math.sqrt(root))
            if when < soonest:
                soonest = when
    return soonest


@njit(cache=True, nogil=True)
def _enters(px, py, ux, uy, touch):
    """When a point that moves straight from (px, py) enters a circle about the origin; infinite where it does not."""
    b = px * ux + py * uy
    c = px * px + py * py - touch * touch
    root = b * b - (ux * ux + uy * uy) * c
    if b >= 0.0 or c <= 0.0 or root < 0.0:
        return math.inf
    return c / (-b + math.sqrt(root))


@njit(cache=True, nogil=True)
def _time_to_wall(px, py, ux, uy, along_x, along_y, touch):
    """Time until a point that moves straight is ``touch`` away from a segment from the origin; infinite where never.

    That is when it enters a rectangle about the segment, or a circle about one of its ends.
    """
    length = math.sqrt(along_x * along_x + along_y * along_y)
    ex = along_x / length
    ey = along_y / length
    foot = px * ex + py * ey
    away = py * ex - px * ey
    beyond = foot - min(max(foot, 0.0), length)
    if beyond * beyond + away * away <= touch * touch:
        return math.inf  # touching already: Chipmunk has seen it
    soonest = min(_enters(px, py, ux, uy, touch), _enters(px - along_x, py - along_y, ux, uy, touch))
    side = 1.0 if away > 0.0 else -1.0
    closing = -side * (uy * ex - ux * ey)
    if side * away > touch and closing > 0.0:
        when = (side * away - touch) / closing
        there = foot + (ux * ex + uy * ey) * when
        if 0.0 <= there <= length:
            soonest = min(soonest, when)
    return soonest


@njit(cache=True, nogil=True)
def _time_to_walls(addresses, radius, touching, mobile, position, velocity, walls, most):
    """Shortest time [engine units] below ``most`` until a disk touches one of the straight ``walls`` (W, 5)."""
    soonest = most
    for i in range(addresses.shape[0] if walls.shape[0] > 0 else 0):
        if not (touching[i] and mobile[i]):
            continue
        x = load_float(addresses[i] + position)
        y = load_float(addresses[i] + position + 8)
        ux = load_float(addresses[i] + velocity)
        uy = load_float(addresses[i] + velocity + 8)
        for k in range(walls.shape[0]):
            when = _time_to_wall(
                x - walls[k, 0], y - walls[k, 1], ux, uy, walls[k, 2], walls[k, 3], radius[i] + walls[k, 4]
            )
            soonest = min(soonest, when)
    return soonest


@njit(cache=True, nogil=True)
def advance_to(
    step_address, space, last_step, start, ends, dt, time_unit, ints, status, floats, slot_start, slot_dt, slot_step,
    slot_lasts, addresses, radius, group, apart, touching, mobile, position, velocity, length_unit, velocity_unit,
    last, walls, fx, fy, inverse_mass, chosen, out,
):  # fmt: skip
    """Go on to each of the times ``ends`` [s], in steps of at most ``dt`` that end at impacts.

    Positions of the bodies at ``chosen`` addresses are written to ``out`` (T, k, 2) [m]. Returns the time reached
    and the length of the last step [s].
    """
    t = start
    for s in range(ends.shape[0]):
        while ends[s] - t > 1e-12 * dt + 1e-15 * abs(t):
            step = min(dt, ends[s] - t)
            until = _time_to_contact(
                addresses, radius, group, apart, touching, mobile, position, velocity, step / time_unit
            )
            until = _time_to_walls(addresses, radius, touching, mobile, position, velocity, walls, until)
            until *= time_unit
            hair = SHORTEST * dt
            if until < step:
                # up to just before the contact, then a short step across it: Chipmunk takes the velocity of
                # the middle of a step for that of the impact
                if until > NEAR * dt:
                    step = until - 0.5 * NEAR * dt
                else:
                    step = until - 0.5 * hair if until > hair else min(step, hair)
            # the velocity belongs to the middle of the coming step, whatever its length
            shift = 0.5 * (step - last) / velocity_unit
            if shift != 0.0:
                for k in range(addresses.shape[0]):
                    if mobile[k]:
                        at = addresses[k]
                        store_float(at + velocity, load_float(at + velocity) + shift * fx[k] * inverse_mass[k])
                        store_float(at + velocity + 8, load_float(at + velocity + 8) + shift * fy[k] * inverse_mass[k])
            floats[slot_start] = t
            floats[slot_dt] = step
            floats[slot_step] = 0.0
            floats[slot_lasts] = 0.0  # steps of any length, none of them counted: near pairs anew in each
            # Chipmunk starts a contact from its last impulse times the ratio of the steps, but its bounds on the
            # sum leave the ratio out: equal steps for it, else a resting disk is thrown
            store_float(space + last_step, step / time_unit)
            call_step(step_address, space, step / time_unit)
            t += step
            last = step
            if ints[status] != 0:
                return t, last
        for k in range(chosen.shape[0]):
            out[s, k, 0] = load_float(chosen[k] + position) * length_unit
            out[s, k, 1] = load_float(chosen[k] + position + 8) * length_unit
    return t, last
