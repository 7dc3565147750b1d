"""Steps that end where an impact begins.

Chipmunk finds an impulsive collision only when two disks overlap already, up to a whole step too late. For
scenes with ``contact_elastic`` the step is cut short at the time of contact, so that a prediction changes
smoothly with its start. Sources: event-driven molecular dynamics, Alder & Wainwright 1959, J. Chem. Phys. 31, 459.
"""

from __future__ import annotations

import math

from ..compiled import njit
from .native import call_step, load_float, store_float, store_int32
from .neighbours import together

# short steps across an impact: after so many the disks are clear of one another, and what hangs on velocities is found
# anew before the next step
SETTLE = 20.0
# of a step: how short the one across an impact is; the normal of the impact and its time are off by half of it
SHORTEST = 1e-6
# of a step: shorter ones do not close what holds bodies, as a gap over the square of a step is a force; Chipmunk's
# joints keep their velocities instead
TOO_SHORT = 0.02
# steps within one of full length, after which impacts are no longer gone to one by one: a clump that an attraction
# presses together meets without end (inelastic collapse, McNamara & Young 1992, Phys. Fluids A 4, 496). Chipmunk then
# finds the contacts of a whole step by itself
CROWDED = 100
# of a step, by which one may be longer: a frame rate of 240 stamped in microseconds divides into no number of steps,
# and the rest of each frame would be a step of its own, in which joints stand in for the forces that hold bodies
ROUNDED = 1e-3
ROUNDS = 4  # of Newton's method for the time of contact
# of the time to contact, where longer steps are allowed: what acts between near disks changes over their gap
CLOSER = 0.2


@njit(cache=True, nogil=True)
def _clear_for(gap, speed):
    """How long a gap stays open where it closes by no more than ``speed``."""
    if gap <= 0.0:
        return 0.0
    return gap / speed if speed > 0.0 else math.inf


@njit(cache=True, nogil=True)
def _ahead(
    addresses, radius, group, apart, touching, mobile, position, velocity, fx, fy, inverse_mass, kick, last, most
):  # fmt: skip
    """Shortest time [engine units] below ``most`` until two disks touch, and the least |gap|/speed of all pairs.

    The third is how long none can touch, whatever acts in a step of at most ``most``; zero where two do.

    A step of s moves a body by s (v + (s - last) a/2), v the velocity of the middle of the last step: the time of
    contact is the root of that gap, so that the step which goes there ends at contact whatever acts.
    kick : turns force over mass into velocity over time, engine units
    """
    n = addresses.shape[0]
    soonest, room, free = most, math.inf, math.inf
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
            touch = radius[i] + radius[j]
            square, speed = dx * dx + dy * dy, ux * ux + uy * uy
            c = square - touch * touch
            gap = math.sqrt(square) - touch
            if speed > 0.0:
                room = min(room, abs(gap) / math.sqrt(speed))
            ax = kick * (fx[j] * inverse_mass[j] * mobile[j] - fx[i] * inverse_mass[i] * mobile[i])
            ay = kick * (fy[j] * inverse_mass[j] * mobile[j] - fy[i] * inverse_mass[i] * mobile[i])
            free = min(free, _clear_for(gap, math.sqrt(speed) + most * math.sqrt(ax * ax + ay * ay)))
            b = dx * ux + dy * uy
            # touching already, and Chipmunk has seen it, or moving apart
            if b >= 0.0 or c <= 0.0:
                continue
            root = b * b - speed * c
            if root < 0.0:
                continue
            when = c / (-b + math.sqrt(root))
            if when > 2.0 * soonest:
                continue
            vx, vy = ux - 0.5 * last * ax, uy - 0.5 * last * ay
            for _ in range(ROUNDS):
                x, y = dx + when * (vx + 0.5 * when * ax), dy + when * (vy + 0.5 * when * ay)
                slope = 2.0 * (x * (vx + when * ax) + y * (vy + when * ay))
                if slope >= 0.0:
                    break
                when -= (x * x + y * y - touch * touch) / slope
            if 0.0 <= when < soonest:
                soonest = when
    return soonest, room, free


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
def _ahead_of_walls(
    addresses, radius, touching, mobile, position, velocity, fx, fy, inverse_mass, kick, last, walls, most, soonest,
    room, free,
):  # fmt: skip
    """As ``_ahead``, with what that found: the straight ``walls`` (W, 5) taken in."""
    for i in range(addresses.shape[0] if walls.shape[0] > 0 else 0):
        if not (touching[i] and mobile[i]):
            continue
        x = load_float(addresses[i] + position)
        y = load_float(addresses[i] + position + 8)
        ux = load_float(addresses[i] + velocity)
        uy = load_float(addresses[i] + velocity + 8)
        ax, ay = kick * fx[i] * inverse_mass[i], kick * fy[i] * inverse_mass[i]
        speed = math.sqrt(ux * ux + uy * uy)
        for k in range(walls.shape[0]):
            px, py, touch = x - walls[k, 0], y - walls[k, 1], radius[i] + walls[k, 4]
            square = walls[k, 2] ** 2 + walls[k, 3] ** 2
            foot = min(max((px * walls[k, 2] + py * walls[k, 3]) / square, 0.0), 1.0)
            gap = math.sqrt((px - foot * walls[k, 2]) ** 2 + (py - foot * walls[k, 3]) ** 2) - touch
            if speed > 0.0:
                room = min(room, abs(gap) / speed)
            free = min(free, _clear_for(gap, speed + most * math.sqrt(ax * ax + ay * ay)))
            when = _time_to_wall(px, py, ux, uy, walls[k, 2], walls[k, 3], touch)
            for _ in range(ROUNDS):
                if when > 2.0 * soonest:
                    break
                # at the velocity that a step of this length would have
                shift = 0.5 * (when - last)
                when = _time_to_wall(px, py, ux + shift * ax, uy + shift * ay, walls[k, 2], walls[k, 3], touch)
            soonest = min(soonest, when)
    return soonest, room, free


@njit(cache=True, nogil=True)
def advance_to(
    step_address, space, last_step, iterations, rounds, idle, start, ends, dt, time_unit, ints, status, floats,
    slot_start, slot_dt, slot_step, slot_lasts, addresses, radius, group, apart, touching, mobile, position, velocity,
    length_unit, velocity_unit, last, walls, constrained, joints, fx, fy, inverse_mass, stretch, chosen, out,
):  # fmt: skip
    """Go on to each of the times ``ends`` [s], in steps of at most ``dt`` that end at impacts.

    rounds : of Chipmunk's solver in steps in which something may touch or its joints hold, ``idle`` of others: all of
        them go over its constraints, and that is most of what a step of a few disks takes
    stretch : how many times longer a step may be where disks are far from one another
    joints : addresses of the largest forces of Chipmunk's joints, which hold bodies in very short steps, as across an
        impact, in place of the forces that do so otherwise;  constrained : slot of whether those act

    Positions of the bodies at ``chosen`` addresses are written to ``out`` (T, k, 2) [m]. Returns the time reached
    and the length of the last step [s].
    """
    t, met, longest = start, False, (1.0 + 2.0 * ROUNDED) * stretch * dt / time_unit
    begun, within = start, 0
    for s in range(ends.shape[0]):
        while ends[s] - t > 1e-12 * dt + 1e-15 * abs(t):
            if t - begun >= dt:
                begun, within = t, 0
            within += 1
            until, room, free = _ahead(
                addresses, radius, group, apart, touching, mobile, position, velocity, fx, fy, inverse_mass,
                time_unit / velocity_unit, last / time_unit, longest,
            )
            until, room, free = _ahead_of_walls(
                addresses, radius, touching, mobile, position, velocity, fx, fy, inverse_mass,
                time_unit / velocity_unit, last / time_unit, walls, longest, until, room, free,
            )
            until = until * time_unit if within < CROWDED else math.inf
            step, left = max(dt, min(stretch * dt, CLOSER * room * time_unit)), ends[s] - t
            if left < (1.0 + ROUNDED) * step:
                step = left
            across = met  # Chipmunk may see the contact a step later
            hair = SHORTEST * dt
            if until < step:
                # up to just before the contact, then a short step across it: Chipmunk takes the velocity of
                # the middle of a step for that of the impact
                met = until <= hair
                step = min(step, hair) if met else until - 0.5 * hair
            elif met:
                met, step = False, min(step, SETTLE * hair)
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
            jointed = False
            if joints.shape[0] > 0:
                jointed = met or across or step < TOO_SHORT * dt
                ints[constrained] = 0 if jointed else 1
                for k in range(joints.shape[0]):
                    store_float(joints[k], math.inf if jointed else 0.0)
            alone = step / time_unit < 0.9 * free and not jointed  # less by what rounding may do
            store_int32(space + iterations, idle if alone else rounds)
            call_step(step_address, space, step / time_unit)
            store_int32(space + iterations, rounds)
            t += step
            last = step
            if ints[status] != 0:
                return t, last
        for k in range(chosen.shape[0]):
            out[s, k, 0] = load_float(chosen[k] + position) * length_unit
            out[s, k, 1] = load_float(chosen[k] + position + 8) * length_unit
    return t, last
