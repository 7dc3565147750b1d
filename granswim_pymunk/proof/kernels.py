"""Compiled loops of the proof's own simulator: plain discrete elements, velocity Verlet, SI throughout.

Every formula here is written for this file, from the contract's table of mechanisms; no law of the engine or of
the reference integrator is called. Velocity Verlet with a predicted velocity: x += v_h dt, forces at (x, v_h + a
dt/2), so that dampings are of second order too (Groot & Warren 1997, J. Chem. Phys. 107, 4423, lambda = 1/2).
"""

from __future__ import annotations

import math

import numpy as np

from ..compiled import njit

# kinds of bodies
FREE, WALL, PIN, RAIL, DRIVEN = range(5)
# forces on one body
DRAG, FRICTION, UNIFORM, SPRING, PIN_FRICTION, WALL_DRAG, ATTRACTION, TRANSVERSE, PHASE_DRAG, SHAKING = range(10)
# forces between two bodies
DISTANCE, COHESION, LUBRICATION, CONTACT_FRICTION, ROLLING = range(5)
# contacts
NO_CONTACT, LINEAR, HERTZ, ELASTIC = range(4)
# places in the vector of base parameters
(
    GX, GY, PERIOD, CONTACT, K_C, GAMMA_C, RESTITUTION, DAMPING_POWER, DAMPING_SCALE, LOSS_POWER, LOSS_SCALE,
    K_U, GAMMA_U, L_U, K_B, GAMMA_B, FORM, K_3, POWER_3, JOINT_F, JOINT_W0, JOINT_FORM, HEAD_F, HEAD_ANGLE,
    HEAD_AXIS, SKIN, REACH, MU_E, BASE,
) = range(29)  # fmt: skip

_jit = njit(nogil=True, error_model="numpy")


@_jit
def saturating(u, small, form):
    """A smooth sign: u/sqrt(u^2 + small^2) (form 0) or tanh(u/small)."""
    if small <= 0.0:
        return math.copysign(1.0, u) if u != 0.0 else 0.0
    if form == 0:
        return u / math.sqrt(u * u + small * small)
    return math.tanh(u / small)


@_jit
def body_forces(t, xy, v, spin, kind, geometry, radius, code, par, weight, force):
    """Add the forces that depend on a body's own state to ``force`` (n, 2)."""
    n = xy.shape[0]
    for f in range(code.shape[0]):
        c = code[f]
        p = par[f]
        for i in range(n):
            w = weight[f, i]
            if w == 0.0 or kind[i] == WALL:
                continue
            if c == DRAG:
                ux = v[i, 0] - p[1]
                uy = v[i, 1] - p[2]
                rate = w
                if p[0] != 1.0:
                    speed = math.sqrt(ux * ux + uy * uy)
                    rate = w * speed ** (p[0] - 1.0) if speed > 0.0 else 0.0
                force[i, 0] -= rate * ux
                force[i, 1] -= rate * uy
            elif c == FRICTION:
                speed = math.sqrt(v[i, 0] ** 2 + v[i, 1] ** 2)
                if speed > 0.0:
                    push = w * saturating(speed, p[0], int(p[1])) / speed
                    force[i, 0] -= push * v[i, 0]
                    force[i, 1] -= push * v[i, 1]
            elif c == UNIFORM:
                force[i, 0] += w * p[0]
                force[i, 1] += w * p[1]
            elif c == SPRING:
                rx = xy[i, 0] - p[0]
                ry = xy[i, 1] - p[1]
                d = math.sqrt(rx * rx + ry * ry)
                if d > 0.0:
                    stretch = d - p[2]
                    size = w * math.copysign(abs(stretch) ** p[3], stretch) / d
                    force[i, 0] -= size * rx
                    force[i, 1] -= size * ry
            elif c == PIN_FRICTION:
                psi = math.atan2(xy[i, 1] - geometry[i, 1], xy[i, 0] - geometry[i, 0])
                push = w * saturating(spin[i], p[0], int(p[1])) / geometry[i, 2]
                force[i, 0] += push * math.sin(psi)
                force[i, 1] -= push * math.cos(psi)
            elif c == WALL_DRAG:
                gap = min(xy[i, 1] - p[1], p[2] - xy[i, 1]) - radius[i]
                rate = 0.0
                if p[3] == 0.0:
                    if gap < p[0]:
                        rate = w
                else:
                    rate = w * 0.5 * (1.0 - math.tanh((gap - p[0]) / (p[3] * p[0])))
                force[i, 0] -= rate * v[i, 0]
                force[i, 1] -= rate * v[i, 1]
            elif c == ATTRACTION:
                rx = xy[i, 0] - p[0]
                ry = xy[i, 1] - p[1]
                size = w / (rx * rx + ry * ry + p[2] * p[2])
                force[i, 0] -= size * rx
                force[i, 1] -= size * ry
            elif c == TRANSVERSE:
                force[i, 0] -= w * v[i, 1]
                force[i, 1] += w * v[i, 0]
            elif c == PHASE_DRAG:
                rate = w * (1.0 + math.cos(p[0] * t - p[1]))
                force[i, 0] -= rate * v[i, 0]
                force[i, 1] -= rate * v[i, 1]
            elif c == SHAKING:
                s = w * math.sin(p[2] * t + p[3])
                force[i, 0] += s * p[0]
                force[i, 1] += s * p[1]


@_jit
def across_gap(d, gap, par, f):
    """Force of a distance d, s (r_0/d)^n, between disks a ``gap`` apart, with its reach and screening; row f of par."""
    if not 0.0 < gap < par[f, 3]:
        return 0.0
    ratio = par[f, 2] / d
    size = par[f, 0] * (ratio * ratio if par[f, 1] == 2.0 else ratio ** par[f, 1])
    if par[f, 4] > 0.0:
        size *= math.exp(-gap / par[f, 4])
    return size


@_jit
def push_apart(force, i, j, dx, dy, size):
    """A central force ``size`` (dx, dy) on j, and its opposite on i."""
    force[i, 0] -= size * dx
    force[i, 1] -= size * dy
    force[j, 0] += size * dx
    force[j, 1] += size * dy


@_jit
def ends(code, par):
    """The gap beyond which nothing but a force of the distance acts: most pairs of a bed in which one reaches far."""
    gap = 0.0
    for f in range(code.shape[0]):
        if code[f] == COHESION:
            gap = max(gap, par[f, 1])
        elif code[f] == LUBRICATION:
            gap = max(gap, par[f, 2])
    return gap


@_jit
def pair_forces(xy, v, spin, kind, mass, radius, base, pairs, count, code, par, dt, force, torque):
    """Contacts and the other forces between the ``count`` listed pairs.

    A dashpot acts at once when disks touch. A step in which they first do counts by the share of it that they touch,
    so that its moment is not rounded to steps: of the force at its end, half that share more or less. So does an
    attraction that begins and ends at once.
    """
    period = base[PERIOD]
    half = 0.5 * period
    contact = int(base[CONTACT])
    near = ends(code, par)
    for q in range(count):
        i = pairs[q, 0]
        j = pairs[q, 1]
        dx = xy[j, 0] - xy[i, 0]
        dy = xy[j, 1] - xy[i, 1]
        if period > 0.0 and (dx > half or dx < -half):
            dx -= period * round(dx / period)
        touch = radius[i] + radius[j]
        limit = touch + base[REACH]
        d2 = dx * dx + dy * dy
        if d2 >= limit * limit:
            continue
        d = math.sqrt(d2)
        gap = d - touch
        if gap > near:
            for f in range(code.shape[0]):
                if code[f] == DISTANCE:
                    push_apart(force, i, j, dx, dy, across_gap(d, gap, par, f) / d)
            continue
        nx = dx / d
        ny = dy / d
        ux = v[j, 0] - v[i, 0]
        uy = v[j, 1] - v[i, 1]
        opening = ux * nx + uy * ny
        if kind[i] == WALL:
            reduced = mass[j]
        elif kind[j] == WALL:
            reduced = mass[i]
        else:
            reduced = mass[i] * mass[j] / (mass[i] + mass[j])
        normal = 0.0
        if gap < 0.0 and (contact == LINEAR or contact == HERTZ):
            damping = base[GAMMA_C]
            if base[DAMPING_POWER] != 0.0:
                damping *= (-gap / base[DAMPING_SCALE]) ** base[DAMPING_POWER]
            deep = abs(opening) * dt
            if -gap < deep:
                damping *= 0.5 - gap / deep
            normal = -damping * reduced * opening
            if contact == LINEAR:
                normal -= base[K_C] * gap
            else:
                normal += base[K_C] * (-gap) ** 1.5
        along = normal
        across = 0.0
        for f in range(code.shape[0]):
            c = code[f]
            p = par[f]
            if c == DISTANCE:
                along += across_gap(d, gap, par, f)
            elif c == COHESION:
                if gap < p[1]:
                    size = p[0]
                    deep = abs(opening) * dt
                    if p[2] == 1.0 and gap > 0.0:
                        size *= 2.0 * (1.0 - gap / p[1])
                    elif p[1] - gap < deep:
                        size *= 0.5 + (p[1] - gap) / deep
                    along -= size
            elif c == LUBRICATION:
                if gap < p[2]:
                    s = max(gap, 0.0) / p[1]
                    along -= p[0] * reduced * opening * (math.exp(-0.7 * s) if p[3] == 1.0 else 1.0 / (1.0 + s))
            elif c == CONTACT_FRICTION:
                if gap < 0.0 and normal > 0.0:
                    slip = -ux * ny + uy * nx - spin[i] * radius[i] - spin[j] * radius[j]
                    across -= p[0] * normal * saturating(slip, p[1], int(p[2]))
            elif c == ROLLING:
                if gap < 0.0 and normal > 0.0:
                    torque[i] -= p[0] * radius[i] * normal * saturating(spin[i], p[1], 0)
                    torque[j] -= p[0] * radius[j] * normal * saturating(spin[j], p[1], 0)
        fx = along * nx - across * ny
        fy = along * ny + across * nx
        force[i, 0] -= fx
        force[i, 1] -= fy
        force[j, 0] += fx
        force[j, 1] += fy
        torque[i] -= radius[i] * across
        torque[j] -= radius[j] * across


@_jit
def turned(angle):
    """The angle between -pi (excluded) and pi."""
    while angle > math.pi:
        angle -= 2.0 * math.pi
    while angle <= -math.pi:
        angle += 2.0 * math.pi
    return angle


@_jit
def chain_forces(head, head_rate, xy, v, mass, chain, base, stiffer, rest, force):
    """Unions, bending and what may be wrong with it, on the disks ``chain`` (k,), head first."""
    k = chain.shape[0]
    if k < 2:
        return
    period = base[PERIOD]
    form = int(base[FORM])
    before = head
    rate_before = head_rate
    back_x = 0.0
    back_y = 0.0
    back_d = 1.0
    for s in range(k - 1):
        i = chain[s]
        j = chain[s + 1]
        dx = xy[j, 0] - xy[i, 0]
        if period > 0.0:
            dx -= period * round(dx / period)
        dy = xy[j, 1] - xy[i, 1]
        d = math.sqrt(dx * dx + dy * dy)
        nx = dx / d
        ny = dy / d
        ux = v[j, 0] - v[i, 0]
        uy = v[j, 1] - v[i, 1]
        reduced = mass[i] * mass[j] / (mass[i] + mass[j])
        pull = -base[K_U] * (d - base[L_U]) - base[GAMMA_U] * reduced * (ux * nx + uy * ny)
        sideways = -ux * ny + uy * nx
        angle = math.atan2(dy, dx)
        rate = sideways / d
        phi = turned(angle - (head if form == 2 else before))
        phi_rate = rate - (head_rate if form == 2 else rate_before)
        # what the joint does: moment per length
        push = -base[K_B] * stiffer[s] * (phi - rest[s])
        if base[K_3] != 0.0:
            push -= base[K_3] * math.copysign(abs(phi) ** base[POWER_3], phi)
        if base[JOINT_F] != 0.0:
            push -= base[JOINT_F] * saturating(phi_rate, base[JOINT_W0], int(base[JOINT_FORM]))
        across = -base[GAMMA_B] * reduced * sideways
        if form == 1:
            # energy: a torque push*L on this segment, the opposite one on the segment before
            across += push * base[L_U] / d
            if s > 0:
                h = chain[s - 1]
                counter = -push * base[L_U] / back_d
                force[i, 0] += counter * back_x
                force[i, 1] += counter * back_y
                force[h, 0] -= counter * back_x
                force[h, 1] -= counter * back_y
        else:
            across += push
        fx = pull * nx - across * ny
        fy = pull * ny + across * nx
        force[j, 0] += fx
        force[j, 1] += fy
        force[i, 0] -= fx
        force[i, 1] -= fy
        before = angle
        rate_before = rate
        back_x = -ny
        back_y = nx
        back_d = d
    if base[HEAD_F] != 0.0:
        angle = head if base[HEAD_AXIS] == 1.0 else base[HEAD_ANGLE]
        force[chain[0], 0] += base[HEAD_F] * math.cos(angle)
        force[chain[0], 1] += base[HEAD_F] * math.sin(angle)


@_jit
def list_pairs(xy, kind, radius, in_chain, period, margin, pairs):
    """Pairs with a gap below ``margin`` into ``pairs`` (m, 2); how many, or -1 where they do not fit.

    Pairs of walls and pairs within the swimmer are left out.
    """
    n = xy.shape[0]
    count = 0
    largest = 0.0
    for i in range(n):
        largest = max(largest, radius[i])
    cell = 2.0 * largest + margin
    low_y = xy[0, 1]
    high_y = xy[0, 1]
    low_x = xy[0, 0]
    high_x = xy[0, 0]
    for i in range(n):
        low_y = min(low_y, xy[i, 1])
        high_y = max(high_y, xy[i, 1])
        low_x = min(low_x, xy[i, 0])
        high_x = max(high_x, xy[i, 0])
    if period > 0.0:
        low_x = 0.0
        columns = int(period / cell)
    else:
        columns = min(int((high_x - low_x) / cell) + 1, 400)
    rows = min(int((high_y - low_y) / cell) + 1, 400)
    if n <= 48 or columns < 4:
        for i in range(n):
            for j in range(i + 1, n):
                if (kind[i] == WALL and kind[j] == WALL) or (in_chain[i] and in_chain[j]):
                    continue
                dx = xy[j, 0] - xy[i, 0]
                if period > 0.0:
                    dx -= period * round(dx / period)
                dy = xy[j, 1] - xy[i, 1]
                # few bodies: all pairs, once and for all
                if n <= 48 or dx * dx + dy * dy < (radius[i] + radius[j] + margin) ** 2:
                    if count == pairs.shape[0]:
                        return -1
                    pairs[count, 0] = i
                    pairs[count, 1] = j
                    count += 1
        return count
    width = period / columns if period > 0.0 else max((high_x - low_x) / columns, cell)
    height = max((high_y - low_y) / rows, cell)
    first = np.full((columns, rows), -1, dtype=np.int64)
    following = np.full(n, -1, dtype=np.int64)
    at = np.empty((n, 2), dtype=np.int64)
    for i in range(n):
        x = xy[i, 0] - low_x
        if period > 0.0:
            x -= period * math.floor(x / period)
        a = min(int(x / width), columns - 1)
        b = min(int((xy[i, 1] - low_y) / height), rows - 1)
        at[i, 0] = a
        at[i, 1] = b
        following[i] = first[a, b]
        first[a, b] = i
    for i in range(n):
        for da in range(-1, 2):
            a = at[i, 0] + da
            if period > 0.0:
                a = a % columns
            elif a < 0 or a >= columns:
                continue
            for db in range(-1, 2):
                b = at[i, 1] + db
                if b < 0 or b >= rows:
                    continue
                j = first[a, b]
                while j >= 0:
                    if j > i and not (kind[i] == WALL and kind[j] == WALL) and not (in_chain[i] and in_chain[j]):
                        dx = xy[j, 0] - xy[i, 0]
                        if period > 0.0:
                            dx -= period * round(dx / period)
                        dy = xy[j, 1] - xy[i, 1]
                        if dx * dx + dy * dy < (radius[i] + radius[j] + margin) ** 2:
                            if count == pairs.shape[0]:
                                return -1
                            pairs[count, 0] = i
                            pairs[count, 1] = j
                            count += 1
                    j = following[j]
    return count


@_jit
def separate(xy, kind, radius, in_chain, chain, length, period, allowed, sweeps):
    """Push overlapping disks apart and neighbours of the chain to ``length``, in place; the largest fault left [m].

    Gauss-Seidel over the pairs, each fault shared by both bodies, until all are below ``allowed`` [m].
    """
    n = xy.shape[0]
    pairs = np.empty((8 * n + 16, 2), dtype=np.int64)
    mean = 0.0
    for i in range(n):
        mean += radius[i] / n
    count = list_pairs(xy, kind, radius, in_chain, period, 0.3 * mean, pairs)
    while count < 0:
        pairs = np.empty((2 * pairs.shape[0], 2), dtype=np.int64)
        count = list_pairs(xy, kind, radius, in_chain, period, 0.3 * mean, pairs)
    worst = 0.0
    for _ in range(sweeps):
        worst = 0.0
        for q in range(count + chain.shape[0] - 1):
            joined = q >= count
            i = chain[q - count] if joined else pairs[q, 0]
            j = chain[q - count + 1] if joined else pairs[q, 1]
            dx = xy[j, 0] - xy[i, 0]
            dy = xy[j, 1] - xy[i, 1]
            if period > 0.0:
                dx -= period * round(dx / period)
            d = math.sqrt(dx * dx + dy * dy)
            fault = (length if joined else radius[i] + radius[j]) - d
            if fault <= 0.0 and not joined:
                continue
            worst = max(worst, abs(fault))
            share = 0.5
            if kind[i] == WALL:
                share = 0.0
            elif kind[j] == WALL:
                share = 1.0
            xy[i, 0] -= share * fault * dx / d
            xy[i, 1] -= share * fault * dy / d
            xy[j, 0] += (1.0 - share) * fault * dx / d
            xy[j, 1] += (1.0 - share) * fault * dy / d
        if worst <= allowed:
            break
    return worst


@_jit
def collide(xy, v, spin, kind, mass, moment, radius, base, duration):
    """Straight motion for ``duration`` with every collision at its own moment; how many there were.

    The normal relative velocity turns to -e times itself; e falls with the speed as (v/scale)^-power. Friction stops
    the slip, or gives mu times the normal impulse where that is less.
    """
    n = xy.shape[0]
    left = duration
    hits = 0
    while hits < 10000:
        soonest = left
        hit_i = -1
        hit_j = -1
        for i in range(n):
            for j in range(i + 1, n):
                if kind[i] != FREE and kind[j] != FREE:
                    continue
                dx = xy[j, 0] - xy[i, 0]
                dy = xy[j, 1] - xy[i, 1]
                ux = v[j, 0] - v[i, 0]
                uy = v[j, 1] - v[i, 1]
                b = dx * ux + dy * uy
                if b >= 0.0:
                    continue
                c = dx * dx + dy * dy - (radius[i] + radius[j]) ** 2
                a = ux * ux + uy * uy
                if c <= 0.0:
                    when = 0.0
                else:
                    root = b * b - a * c
                    if root < 0.0:
                        continue
                    when = c / (-b + math.sqrt(root))
                if when < soonest:
                    soonest = when
                    hit_i = i
                    hit_j = j
        for i in range(n):
            if kind[i] == FREE:
                xy[i, 0] += soonest * v[i, 0]
                xy[i, 1] += soonest * v[i, 1]
        left -= soonest
        if hit_i < 0:
            return hits
        hits += 1
        i = hit_i
        j = hit_j
        dx = xy[j, 0] - xy[i, 0]
        dy = xy[j, 1] - xy[i, 1]
        d = math.sqrt(dx * dx + dy * dy)
        nx = dx / d
        ny = dy / d
        closing = (v[j, 0] - v[i, 0]) * nx + (v[j, 1] - v[i, 1]) * ny
        e = base[RESTITUTION]
        if base[LOSS_POWER] != 0.0:
            e = min(e * (-closing / base[LOSS_SCALE]) ** (-base[LOSS_POWER]), 1.0)
        inverse_i = 1.0 / mass[i] if kind[i] == FREE else 0.0
        inverse_j = 1.0 / mass[j] if kind[j] == FREE else 0.0
        push = -(1.0 + e) * closing / (inverse_i + inverse_j)
        v[i, 0] -= push * inverse_i * nx
        v[i, 1] -= push * inverse_i * ny
        v[j, 0] += push * inverse_j * nx
        v[j, 1] += push * inverse_j * ny
        if base[MU_E] > 0.0:
            slip = -(v[j, 0] - v[i, 0]) * ny + (v[j, 1] - v[i, 1]) * nx - spin[i] * radius[i] - spin[j] * radius[j]
            lever_i = radius[i] ** 2 / moment[i] if kind[i] == FREE else 0.0
            lever_j = radius[j] ** 2 / moment[j] if kind[j] == FREE else 0.0
            most = base[MU_E] * push
            rub = min(max(-slip / (inverse_i + inverse_j + lever_i + lever_j), -most), most)
            v[i, 0] += rub * inverse_i * ny
            v[i, 1] -= rub * inverse_i * nx
            v[j, 0] -= rub * inverse_j * ny
            v[j, 1] += rub * inverse_j * nx
            if kind[i] == FREE:
                spin[i] -= rub * radius[i] / moment[i]
            if kind[j] == FREE:
                spin[j] -= rub * radius[j] / moment[j]
    return hits


@_jit
def run(
    t0, dt, steps, xy, v, spin, kind, geometry, mass, inertia_factor, moment, radius, base, field_code, field_par,
    field_weight, pair_code, pair_par, chain, in_chain, stiffer, rest, head, head_rate, driven, path, pace,
    frame_step, frame_rest,
):  # fmt: skip
    """Integrate ``steps`` steps; positions (T, n, 2), velocities (T, n, 2) and angles (T, n) at the frames, and
    whether all went well.

    ``frame_step``, ``frame_rest`` (T,): the step before each frame and the time left to it. ``path``, ``pace``
    (steps + 1, k, 2): where driven bodies are and how fast. Arrays xy, v, spin are changed in place.
    """
    n = xy.shape[0]
    frames = frame_step.shape[0]
    seen = np.zeros((frames, n, 2))
    speeds = np.zeros((frames, n, 2))
    angles = np.zeros((frames, n))
    angle = np.zeros(n)
    force = np.zeros((n, 2))
    torque = np.zeros(n)
    a = np.zeros((n, 2))
    turning = np.zeros(n)  # angular acceleration
    ahead = np.zeros((n, 2))
    ahead_spin = np.zeros(n)
    psi = np.zeros(n)
    omega = np.zeros(n)
    for i in range(n):
        if kind[i] == PIN:
            psi[i] = math.atan2(xy[i, 1] - geometry[i, 1], xy[i, 0] - geometry[i, 0])
            omega[i] = (-v[i, 0] * math.sin(psi[i]) + v[i, 1] * math.cos(psi[i])) / geometry[i, 2]
    capacity = max(16 * n, n * (n - 1) // 2 if n <= 48 else 0, 16)
    pairs = np.empty((capacity, 2), dtype=np.int64)
    listed = xy.copy()
    contact = int(base[CONTACT])
    wants_pairs = contact == LINEAR or contact == HERTZ or pair_code.shape[0] > 0
    skin = base[SKIN]
    count = 0
    if wants_pairs:
        count = list_pairs(xy, kind, radius, in_chain, base[PERIOD], base[REACH] + skin, pairs)
        while count < 0:
            # what reaches far has many pairs
            pairs = np.empty((2 * pairs.shape[0], 2), dtype=np.int64)
            count = list_pairs(xy, kind, radius, in_chain, base[PERIOD], base[REACH] + skin, pairs)
    carried, frame = mass * inertia_factor, 0
    for step in range(steps + 1):
        t = t0 + step * dt
        if step > 0:
            # half a kick, then the drift
            for i in range(n):
                if kind[i] == FREE or kind[i] == RAIL:
                    v[i, 0] += 0.5 * dt * a[i, 0]
                    v[i, 1] += 0.5 * dt * a[i, 1]
                    spin[i] += 0.5 * dt * turning[i]
                    angle[i] += dt * spin[i]
                    if contact != ELASTIC:
                        xy[i, 0] += dt * v[i, 0]
                        xy[i, 1] += dt * v[i, 1]
                elif kind[i] == PIN:
                    omega[i] += 0.5 * dt * turning[i]
                    psi[i] += dt * omega[i]
            if contact == ELASTIC:
                collide(xy, v, spin, kind, carried, moment, radius, base, dt)
        # where constraints put their bodies
        for i in range(n):
            ahead[i, 0] = v[i, 0]
            ahead[i, 1] = v[i, 1]
            ahead_spin[i] = spin[i]
            if (kind[i] == FREE or kind[i] == RAIL) and step > 0:
                ahead[i, 0] += 0.5 * dt * a[i, 0]
                ahead[i, 1] += 0.5 * dt * a[i, 1]
                ahead_spin[i] += 0.5 * dt * turning[i]
            elif kind[i] == PIN:
                w = omega[i] + (0.5 * dt * turning[i] if step > 0 else 0.0)
                length = geometry[i, 2]
                xy[i, 0] = geometry[i, 0] + length * math.cos(psi[i])
                xy[i, 1] = geometry[i, 1] + length * math.sin(psi[i])
                ahead[i, 0] = -w * length * math.sin(psi[i])
                ahead[i, 1] = w * length * math.cos(psi[i])
                ahead_spin[i] = w
        for k in range(driven.shape[0]):
            i = driven[k]
            xy[i, 0] = path[step, k, 0]
            xy[i, 1] = path[step, k, 1]
            ahead[i, 0] = pace[step, k, 0]
            ahead[i, 1] = pace[step, k, 1]
        if wants_pairs and step > 0 and n > 48:
            limit = 0.25 * skin * skin
            for i in range(n):
                if (xy[i, 0] - listed[i, 0]) ** 2 + (xy[i, 1] - listed[i, 1]) ** 2 > limit:
                    count = list_pairs(xy, kind, radius, in_chain, base[PERIOD], base[REACH] + skin, pairs)
                    while count < 0:
                        pairs = np.empty((2 * pairs.shape[0], 2), dtype=np.int64)
                        count = list_pairs(xy, kind, radius, in_chain, base[PERIOD], base[REACH] + skin, pairs)
                    listed[:] = xy
                    break
        force[:] = 0.0
        torque[:] = 0.0
        body_forces(t, xy, ahead, ahead_spin, kind, geometry, radius, field_code, field_par, field_weight, force)
        if wants_pairs:
            pair_forces(
                xy, ahead, ahead_spin, kind, mass, radius, base, pairs, count, pair_code, pair_par, dt, force, torque
            )
        chain_forces(head[step], head_rate[step], xy, ahead, mass, chain, base, stiffer, rest, force)
        for i in range(n):
            if kind[i] == WALL or kind[i] == DRIVEN:
                continue
            fx = force[i, 0] + mass[i] * base[GX]
            fy = force[i, 1] + mass[i] * base[GY]
            if kind[i] == PIN:
                turning[i] = (
                    geometry[i, 2]
                    * (-fx * math.sin(psi[i]) + fy * math.cos(psi[i]))
                    / (geometry[i, 3] * inertia_factor[i])
                )
                if step > 0:
                    omega[i] += 0.5 * dt * turning[i]
                v[i, 0] = -omega[i] * geometry[i, 2] * math.sin(psi[i])
                v[i, 1] = omega[i] * geometry[i, 2] * math.cos(psi[i])
                continue
            if kind[i] == RAIL:
                along = fx * geometry[i, 0] + fy * geometry[i, 1]
                fx = along * geometry[i, 0]
                fy = along * geometry[i, 1]
            a[i, 0] = fx / carried[i]
            a[i, 1] = fy / carried[i]
            turning[i] = torque[i] / moment[i]
            if step > 0:
                v[i, 0] += 0.5 * dt * a[i, 0]
                v[i, 1] += 0.5 * dt * a[i, 1]
                spin[i] += 0.5 * dt * turning[i]
        if not math.isfinite(a[0, 0]) or not math.isfinite(xy[n - 1, 0]):
            return seen, speeds, angles, False
        while frame < frames and frame_step[frame] == step:
            s = frame_rest[frame]
            for i in range(n):
                seen[frame, i, 0] = xy[i, 0]
                seen[frame, i, 1] = xy[i, 1]
                speeds[frame, i, 0] = ahead[i, 0] if kind[i] == DRIVEN else v[i, 0] + s * a[i, 0]
                speeds[frame, i, 1] = ahead[i, 1] if kind[i] == DRIVEN else v[i, 1] + s * a[i, 1]
                angles[frame, i] = angle[i] + s * spin[i]
                if kind[i] == PIN:
                    later = psi[i] + s * omega[i] + 0.5 * s * s * turning[i]
                    seen[frame, i, 0] = geometry[i, 0] + geometry[i, 2] * math.cos(later)
                    seen[frame, i, 1] = geometry[i, 1] + geometry[i, 2] * math.sin(later)
                    angles[frame, i] = later
                elif kind[i] != WALL and s != 0.0:
                    if kind[i] == DRIVEN:
                        seen[frame, i, 0] += s * ahead[i, 0]
                        seen[frame, i, 1] += s * ahead[i, 1]
                    else:
                        seen[frame, i, 0] += s * v[i, 0] + 0.5 * s * s * a[i, 0]
                        seen[frame, i, 1] += s * v[i, 1] + 0.5 * s * s * a[i, 1]
            frame += 1
        if frame == frames:
            break
    return seen, speeds, angles, True
