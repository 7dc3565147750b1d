"""Compiling laws into the callbacks that Chipmunk calls.

Each law is a generated module of its own, compiled when a scene first uses it: what it adds to the forces of one block
of bodies. The core, another module, goes through the blocks and the uses of laws and calls them by their addresses; it
holds the native callbacks too. What only some scenes need (lists of pairs, straight walls, links, Chipmunk's contacts)
are modules as well. All of them find their arrays behind one pointer, the context. A module is laid out as a file in
the user's cache, named by the hash of its text, and its machine code is kept beside it (see ``compiled``). The generated
text is meant to be read.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import itertools
import linecache
import logging
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numba

from ..errors import InputError
from ..files import written_whole
from ..laws import Law
from ..storage import code_folder
from . import links, native, neighbours
from .law_text import source_of
from .motion import LIMIT, MOTION, columns
from .native import ROW, Offsets
from .swimmers import lifted

log = logging.getLogger("granswim")

KIND_ORDER = {"pair": 0, "chain": 1, "body": 2, "joint": 2, "constraint": 3}

# columns of the integer table that says how a law is used; the code is that of its kind, 0 of one that has no forces
# here; then addresses: of what it adds to a block of bodies, of one pair, of a body at a straight wall
USE_COLUMNS = ("code", "parameters", "first", "last", "mask", "damping", "block", "one", "wall")
PAIR, CONSTRAINT = (1 + KIND_ORDER[kind] for kind in ("pair", "constraint"))

# slots of the context that the callbacks find behind a pointer: addresses and whole numbers ...
INTS = (
    "n", "n_mobile", "room", "n_pairs", "n_rows", "n_uses", "n_parameters", "n_input", "status", "rebuilds", "cuts",
    "n_cells", "n_table", "n_contacts", "margin_crossed", "n_chains", "n_runs", "n_blocks", "own_drift", "own_kick",
    "from_list", "constrained", "fixed_skin", "pushed", "first_body", "n_joints", "n_joint_of", "n_links", "n_linked",
    "n_held", "n_apart", "n_walls", "n_meetings", "renew_lists", "add_walls", "hold_links",
    "bodies", "state", "motion", "place_x", "place_y", "mass", "inverse_mass", "radius", "given_inertia",
    "old_x", "old_y", "mobile", "group", "parameters", "uses", "runs", "run_starts", "blocks", "mask",
    "pair_i", "pair_j", "pair_shift", "near_i", "near_j", "near_shift", "near_touch", "near_mass", "near_starts",
    "near_seam",
    "allowance", "reaching", "sorted_x", "sorted_y", "sorted_reach", "starts", "push",
    "heads", "nexts", "chains", "input_t", "input_v", "input_at", "scalars", "floats", "table_keys",
    "table_values", "contact_i", "contact_j", "contact_fx", "contact_fy", "contact_ti", "contact_tj",
    "order", "listing", "image_shift", "which", "work", "kick_mass", "inverse_moment", "kept",
    "apart", "joints", "joint_at", "joint_of", "link_kind", "link_first", "link_second", "link_geometry", "linked",
    "mobility", "link_gap", "link_arms", "link_here", "link_there", "link_matrix", "link_push", "link_q", "link_trial",
    "walls", "wall_i", "wall_k", "wall_starts", "wall_met",
)  # fmt: skip
# what stands for the row of the straight walls, which are one static body to Chipmunk
WALL = -(2**40)
# ... and floats
FLOATS = (
    "t_start", "dt", "step", "skin", "least_skin", "most_skin", "reach", "margin", "lasts", "headroom", "pruned",
    "built",
)  # fmt: skip
# steps that the list of near pairs should last: cutting it costs about as much as half a step
NEAR_LASTS = 24
# steps between two full lists below and above which the skin is made wider and narrower
SHORT_BUILD = 250
LONG_BUILD = 1000
# forces are summed body after body in blocks of so many, all laws for one block before the next, so that what a
# block touches stays in the second-level cache; the disks of chains are one block, the first
BODIES = 128
# the pair laws go through the near list in blocks of so many pairs, which stay in the first-level cache;
# WORK is what is kept of those that touch
BLOCK = 256
WORK = ("dx", "dy", "ux", "uy", "touch", "mass", "px", "py", "ri", "rj", "wi", "wj", "ti", "tj")
# numbers that laws may ask for
# the last: 1 where a contact or a reach counts in its first and last step by the share of it that it lasts, else 0
# and how dampings see the velocity (SCHEME)
# and the longest arm of a hinge
SCALARS = ("length", "gx", "gy", "g", "mean_mass", "share", "scheme", "arm")
# dampings see the last half-step velocity; or that of the positions' time: body after body, where each damping sees one
# body; all bodies of a block together, where constraints join them; the first block together, where chains are damped
HALF_STEP, ALONE, TOGETHER, CHAINS = 0, 1, 2, 3
# what is kept of each body while dampings are taken twice
KEPT = ("fx", "fy", "torque", "vx", "vy", "spin")

# functions that are compiled for a scene of few laws, about: the length of the progress bar
FUNCTIONS = 30
# of what a law adds to a block of bodies, of one pair, of a body at a straight wall; 0 where it is not needed
Addresses = tuple[int, int, int]

def _parameter_locals(law: Law) -> tuple[list[str], dict[str, str]]:
    """Lines that read the parameters of use u, and the name each argument got."""
    names: dict[str, str] = {}
    lines = []
    for k, argument in enumerate(a for p in law.parameters for a in p.arguments):
        if argument in law.arguments:
            lines.append(f"q_{argument} = parameters[o + {k}]")
            names[argument] = f"q_{argument}"
    return lines, names


def _call(law: Law, available: dict[str, str]) -> str:
    return f"law_{law.name}({', '.join(available[a] for a in law.arguments)})"


def _indent(lines: Sequence[str], depth: int) -> str:
    return "".join("    " * depth + line + "\n" for line in lines)


_SCENE = {"gx": "scalars[1]", "gy": "scalars[2]", "g": "scalars[3]", "mean_mass": "scalars[4]"}


def _turns(law: Law) -> bool:
    """Whether a pair law returns torques of its own."""
    return bool({"spin_i", "spin_j"} & set(law.arguments))


def spins(law: Law) -> bool:
    """Whether a pair law looks at spins, and so gives torques."""
    return law.kind == "pair" and (_turns(law) or "vt" in law.arguments)


def _work(name: str) -> str:
    # the number of a column is unsigned: numba then leaves out the test for an index counted from the end
    return f"work[m + W_{name.upper()}]"


class _Pair:
    """The text of a pair law: what it reads, how it is called, and what is done with its answer."""

    def __init__(self, law: Law) -> None:
        self.read, names = _parameter_locals(law)
        self.spin = spin = spins(law)
        available = {
            "t": "t", "gap": "gap", "distance": "d", "vn": "vn", "vt": "vt", "reduced_mass": "reduced_mass",
            "reduced_radius": "ri * rj / touch", "r0": "r0", "radius_i": "ri", "radius_j": "rj", "spin_i": "wi",
            "spin_j": "wj", **names,
        }  # fmt: skip
        self.reach = f" + {names.get(law.reach, f'parameters[o + {_slot(law, law.reach)}]')}" if law.reach else ""
        self.opening = ["nx = dx / d", "ny = dy / d", "gap = d - touch", "vn = ux * nx + uy * ny"]
        self.answer = ["vt = uy * nx - ux * ny - wj * rj - wi * ri"] if spin else []
        self.answer.append(f"{'fn, ft, mi, mj' if _turns(law) else 'fn, ft'} = {_call(law, available)}")
        self.push = ["px = fn * nx - ft * ny", "py = fn * ny + ft * nx"] if spin else ["px = fn * nx", "py = fn * ny"]
        if spin:
            self.push += ["ti = -ri * ft", "tj = -rj * ft"]
        if _turns(law):
            self.push += ["ti += mi", "tj += mj"]


def _one_text(law: Law) -> str:
    """What a pair law does to one pair: added to the first four numbers of ``work``."""
    pair = _Pair(law)
    return f"""
@cfunc(types.void(types.int64, types.int64, types.int64, types.int64, types.float64), **CALLBACK)
def one(context, u, i, j, t):
    UNPACK
    o = uses[u, 1]
    length = scalars[0]
    r0 = parameters[o - 1]
    px = 0.0
    py = 0.0
    ti = 0.0
    tj = 0.0
{_indent(pair.read, 1)}    ri = radius[i]
    rj = radius[j]
    wi = state[i, SPIN]
    wj = state[j, SPIN]
    touch = ri + rj
    reduced_mass = 1.0 / (inverse_mass[i] + inverse_mass[j])
    dx = state[j, X] - state[i, X]
    if length > 0.0:
        dx -= length * math.floor(dx / length + 0.5)
    dy = state[j, Y] - state[i, Y]
    square = dx * dx + dy * dy
    limit = touch{pair.reach}
    if square < limit * limit and square > 0.0:
        d = math.sqrt(square)
        ux = state[j, VX] - state[i, VX]
        uy = state[j, VY] - state[i, VY]
{_indent([*pair.opening, *pair.answer, *pair.push], 2)}    work[0] += px
    work[1] += py
    work[2] += ti
    work[3] += tj
"""


def _pair_text(law: Law) -> str:
    """A pair law for the near pairs of a block of bodies: those that touch together, which can be vectorised."""
    pair = _Pair(law)
    # a dashpot acts at once when bodies touch, an attraction at its reach: without this the moment is rounded to steps
    deep = "deep = abs(vn) * step"
    shared, lasting = [], []
    if law.reach:
        shared = [deep, f"inside = touch{pair.reach} - d", f"gap = min(gap, 0.0{pair.reach})"]
        lasting = ["lasts = min(max(0.5 + inside / max(deep, 1e-300), 0.0), 1.0)", "fn *= lasts", "ft *= lasts"]
    elif "vn" in law.arguments:
        shared = [deep, "vn *= 0.5 - gap / deep if -gap < deep else 1.0"]
    round_ = pair.spin or "reduced_radius" in law.arguments
    inputs = ["dx", "dy", "ux", "uy", "touch", "mass", *(["ri", "rj", "wi", "wj"] if round_ else [])]
    unpack = [f"{'reduced_mass' if name == 'mass' else name} = {_work(name)}" for name in inputs]
    pack = [f"{_work(name)} = {name}" for name in ("px", "py", *(["ti", "tj"] if pair.spin else []))]
    return f"""
@njit(**PLAIN)
def each(count, o, t, step, parameters, work):
    r0 = parameters[o - 1]
{_indent(pair.read, 1)}    for m in range(np.uint64(count)):
{_indent(unpack, 2)}        d = math.sqrt(dx * dx + dy * dy)
{_indent([*pair.opening, *shared, *pair.answer, *lasting, *pair.push, *pack], 2)}

{_BLOCK}
    UNPACK
    o = uses[u, 1]
    step = scalars[5] * dt
{_indent(pair.read if pair.reach else [], 1)}    reach = 0.0{pair.reach}
    flat = state.reshape(state.size)
    end = near_starts[b + 1]
    for first in range(near_starts[b], end, {BLOCK}):
        last = min(first + {BLOCK}, end)
        {"if uses[u, 4] == 0:" if not pair.reach else "if False:"}
            count = touching(first, last, near_seam[b], flat, near_i, near_j, near_shift, near_touch, which, work)
        else:
            count = reached(first, last, reach, {'step' if law.reach else '0.0'}, uses[u, 4], mask[u], flat, near_i, near_j,
                            near_shift, near_touch, which, work)
        count = collect(first, count, {int(round_)}, flat, radius, near_i, near_j, near_touch, near_mass, which, work)
        each(count, o, t, step, parameters, work)
        scatter(count, {int(pair.spin)}, flat, near_i, near_j, which, work)
"""


def _wall_text(law: Law) -> str:
    """What a law of contact does to a body at a straight wall."""
    read, names = _parameter_locals(law)
    available = {
        "t": "t", "gap": "gap", "distance": "d", "vn": "vn", "vt": "vt", "reduced_mass": "reduced_mass",
        "reduced_radius": "ri", "r0": "parameters[o - 1]", "radius_i": "ri", "radius_j": "walls[k, 4]",
        "spin_i": "wi", "spin_j": "0.0", **names,
    }  # fmt: skip
    answer = "fn, ft, mi, mj" if _turns(law) else "fn, ft"
    return f"""
@cfunc(types.void(*[types.int64] * 4, *[types.float64] * 7), **CALLBACK)
def wall(context, u, i, k, t, d, gap, vn, vt, nx, ny):
    UNPACK
    o = uses[u, 1]
    ri = radius[i]
    reduced_mass = 1.0 / inverse_mass[i]
    wi = state[i, SPIN]
{_indent([*read, f"{answer} = {_call(law, available)}"], 1)}{_indent(["state[i, TORQUE] += mi"] if _turns(law) else [], 1)}
    state[i, FX] -= fn * nx - ft * ny
    state[i, FY] -= fn * ny + ft * nx
    state[i, TORQUE] -= ri * ft
"""


_WALLS = '''

@cfunc(types.void(types.int64, types.int64, types.int64, types.float64, types.float64), **CALLBACK)
def add_walls(context, begin, end, t, dt):
    """Add the forces [N] and torques [N m] of straight walls on the bodies that touch them."""
    UNPACK
    step = scalars[5] * dt
    for m in range(begin, end):
        i = wall_i[m]
        k = wall_k[m]
        dx, dy = to_wall(state[i, X], state[i, Y], walls, k, scalars[0])
        ri = radius[i]
        touch = ri + walls[k, 4]
        square = dx * dx + dy * dy
        if square >= touch * touch or square == 0.0:
            continue
        d = math.sqrt(square)
        nx = dx / d
        ny = dy / d
        gap = d - touch
        wi = state[i, SPIN]
        vn = -state[i, VX] * nx - state[i, VY] * ny
        vt = state[i, VX] * ny - state[i, VY] * nx - wi * ri
        # a dashpot counts in its first and last step by the share of it that it lasts, as between bodies
        deep = abs(vn) * step
        if -gap < deep:
            vn *= 0.5 - gap / deep
        for u in range(uses.shape[0]):
            if uses[u, USE_WALL] != 0 and (uses[u, 4] == 0 or mask[u, i]):
                call_wall(uses[u, USE_WALL], context, u, np.int64(i), np.int64(k), t, d, gap, vn, vt, nx, ny)
'''


_LINKS = '''

@cfunc(types.void(types.int64, types.float64), **CALLBACK)
def hold_links(context, dt):
    """Forces and torques of hinges and rods, all other forces being there: the coming drift leaves no gap."""
    UNPACK
    arm = scalars[7]
    for k in range(linked.shape[0]):
        i = linked[k]
        link_q[k, 0] = state[i, X]
        link_q[k, 1] = state[i, Y]
        link_q[k, 2] = state[i, ANGLE]
        link_trial[k, 0] = state[i, X] + dt * (state[i, VX] + dt * (inverse_mass[i] * state[i, FX]))
        link_trial[k, 1] = state[i, Y] + dt * (state[i, VY] + dt * (inverse_mass[i] * state[i, FY]))
        link_trial[k, 2] = state[i, ANGLE]
        if mobility[k, 3] > 0.0:
            link_trial[k, 2] += dt * (state[i, SPIN] + dt * (inverse_moment[i] * state[i, TORQUE]))
        else:
            state[i, TORQUE] = 0.0  # on a rail, or driven: it does not turn
    if not close(link_kind, link_first, link_second, link_geometry, mobility, arm, link_q, link_trial, dt * dt, link_gap,
                 link_arms, link_here, link_there, link_matrix, link_push):
        state[linked[0], FX] = math.nan  # noticed as a position that is not finite
        return
    for k in range(linked.shape[0]):
        i = linked[k]
        x = link_push[k, 0]
        y = link_push[k, 1]
        state[i, FX] += mass[i] * (mobility[k, 0] * x + mobility[k, 1] * y)
        state[i, FY] += mass[i] * (mobility[k, 1] * x + mobility[k, 2] * y)
        if mobility[k, 3] > 0.0:
            state[i, TORQUE] += link_push[k, 2]
'''


def _slot(law: Law, name: str) -> int:
    return [a for p in law.parameters for a in p.arguments].index(name)


_BLOCK = """@cfunc(types.void(*[types.int64] * 3, types.float64, types.float64, types.int64, types.float64), **CALLBACK)
def block(context, u, b, t, dt, twice, fresh):"""


def _body_text(law: Law) -> str:
    """A law of single bodies, or a constraint, for a block of bodies."""
    read, names = _parameter_locals(law)
    available = {
        "t": "t", "dt": "dt", "x": "state[i, X]", "y": "state[i, Y]", "vx": "state[i, VX]", "vy": "state[i, VY]", "mass": "mass[i]",
        "radius": "radius[i]", "r0": "r0", "given_inertia": "given_inertia[i]", "fx": "state[i, FX]",
        "fy": "state[i, FY]",
        "command": "command", "wall_gap": "gap_to_walls(state[i, X], state[i, Y], radius[i], walls, scalars[0])",
        **_SCENE, **names,
    }  # fmt: skip
    # unsigned: numba then leaves out the test for an index counted from the end
    loops = [
        "for run in range(run_starts[u, b], run_starts[u, b + 1]):",
        "    for i in range(np.uint64(runs[run, 0]), np.uint64(runs[run, 1])):",
    ]
    if "command" in law.arguments:
        loops.append("        command = interpolate(t + 0.5 * dt, input_t, input_v, input_at[i, 0], input_at[i, 1])")
    loops.append(f"        ax, ay = {_call(law, available)}")
    plain = [*loops, "        state[i, FX] += ax", "        state[i, FY] += ay"]
    # once more, with the velocity that half the kick leads to; ``fresh``: 1.0 where the force is not in the sum yet
    again = [
        *loops,
        "        half = 0.5 * dt * kick_mass[i]",
        "        mx = state[i, VX] + half * (state[i, FX] + fresh * ax)",
        "        my = state[i, VY] + half * (state[i, FY] + fresh * ay)",
        f"        bx, by = {_call(law, available | {'vx': 'mx', 'vy': 'my'})}",
        "        state[i, FX] += bx - (1.0 - fresh) * ax",
        "        state[i, FY] += by - (1.0 - fresh) * ay",
    ]
    lines = ["o = uses[u, 1]", "r0 = parameters[o - 1]", *read]
    if law.damping:
        lines += ["if twice:", *("    " + line for line in again), "else:", *("    " + line for line in plain)]
    else:
        lines += plain
    return f"\n{_BLOCK}\n    UNPACK\n{_indent(lines, 1)}"


def _chain_text(law: Law) -> str:
    """A law of swimmers, all of whose disks lie in the first block of bodies."""
    read, names = _parameter_locals(law)
    available = {"t": "t"} | {a: f"state[first:last, {a.upper()}]" for a in ("x", "y", "vx", "vy", "fx", "fy")}
    available |= {"mass": "mass[first:last]", **names}
    lines = [
        "o = uses[u, 1]",
        *read,
        "for k in range(chains.shape[0] if b == 0 else 0):",
        "    first = chains[k, 0]",
        "    last = chains[k, 1]",
        "    if mask[u, first]:",  # a law acts on whole swimmers
        f"        {_call(law, available)}",
    ]
    return f"\n{_BLOCK}\n    UNPACK\n{_indent(lines, 1)}"


def _joint_text(law: Law) -> str:
    """A law of joints, whose bodies lie in the first block."""
    read, names = _parameter_locals(law)
    call = _call(law, {"t": "t", "rate": "rate", "bend": "bend", **names})
    lines = [
        "o = uses[u, 1]",
        *read,
        "for k in range(uses[u, 2], uses[u, 3] if b == 0 else uses[u, 2]):",
        "    q = joint_of[k]",
        "    i = joints[q, 1]",
        "    j = joints[q, 2]",
        "    if joints[q, 0] == 0:  # a pin: the rod turns, the body at its end is pushed across",
        "        dx = state[j, X] - joint_at[q, 0]",
        "        dy = state[j, Y] - joint_at[q, 1]",
        "        square = dx * dx + dy * dy",
        "        rate = (dx * state[j, VY] - dy * state[j, VX]) / square",
        "        bend = math.atan2(dx, -dy)",
        f"        torque = {call}",
        "        state[j, FX] -= torque / square * dy",
        "        state[j, FY] += torque / square * dx",
        "    else:",
        "        rate = state[j, SPIN] if j >= 0 else 0.0",
        "        bend = state[j, ANGLE] if j >= 0 else 0.0",
        "        if i >= 0:",
        "            rate -= state[i, SPIN]",
        "            bend -= state[i, ANGLE]",
        f"        torque = {call}",
        "        if j >= 0:",
        "            state[j, TORQUE] += torque",
        "        if i >= 0:",
        "            state[i, TORQUE] -= torque",
    ]
    return f"\n{_BLOCK}\n    UNPACK\n{_indent(lines, 1)}"


_TEXTS = {
    "pair": _pair_text, "chain": _chain_text, "body": _body_text, "joint": _joint_text, "constraint": _body_text,
}  # fmt: skip


def _context_arrays(used: set[str]) -> str:
    """Lines that turn the context behind a pointer into arrays, those that are used."""
    n = "n"
    shapes = {
        "state": (f"(n, {ROW})", "f8"), "push": ("(n, 3)", "f8"), "which": (str(BLOCK + 1), "u8"),
        "work": (str(BLOCK * len(WORK) + 8), "f8"), "kept": (f"(n, {len(KEPT)})", "f8"), "motion": (str(len(MOTION)), "f8"),
        "bodies": (n, "i8"), "mobile": (n, "u1"), "group": (n, "i8"), "old_x": (n, "f8"), "old_y": (n, "f8"),
        "parameters": ("I[N_PARAMETERS]", "f8"), "uses": (f"(I[N_USES], {len(USE_COLUMNS)})", "i8"),
        "runs": ("(I[N_RUNS], 2)", "i8"), "mask": ("(I[N_USES], n)", "u1"), "pair_i": ("I[ROOM]", "u4"),
        "pair_j": ("I[ROOM]", "u4"), "pair_shift": ("I[ROOM]", "f8"), "near_i": ("I[ROOM]", "u4"),
        "near_j": ("I[ROOM]", "u4"), "near_shift": ("I[ROOM]", "f8"), "near_touch": ("I[ROOM]", "f8"),
        "near_mass": ("I[ROOM]", "f8"), "near_starts": ("I[N_BLOCKS] + 1", "i8"), "near_seam": ("I[N_BLOCKS]", "u1"),
        "blocks": ("I[N_BLOCKS] + 1", "i8"), "run_starts": ("(I[N_USES], I[N_BLOCKS] + 1)", "i8"), "starts": ("n + 1", "i8"),
        "heads": ("I[N_CELLS]", "i8"), "nexts": (n, "i8"), "chains": ("(I[N_CHAINS], 2)", "i8"),
        "input_t": ("I[N_INPUT]", "f8"), "input_v": ("I[N_INPUT]", "f8"), "input_at": ("(n, 2)", "i8"),
        "scalars": (str(len(SCALARS)), "f8"), "table_keys": ("I[N_TABLE]", "i8"),
        "table_values": ("I[N_TABLE]", "i8"), "contact_i": ("I[ROOM]", "i8"), "contact_j": ("I[ROOM]", "i8"),
        "contact_fx": ("I[ROOM]", "f8"), "contact_fy": ("I[ROOM]", "f8"), "contact_ti": ("I[ROOM]", "f8"),
        "contact_tj": ("I[ROOM]", "f8"), "order": ("I[ROOM]", "i8"), "listing": ("n + 1", "i8"),
        "apart": ("I[N_APART]", "i8"), "joints": ("(I[N_JOINTS], 3)", "i8"), "joint_at": ("(I[N_JOINTS], 2)", "f8"),
        "joint_of": ("I[N_JOINT_OF]", "i8"), "link_kind": ("I[N_LINKS]", "i8"), "link_first": ("I[N_LINKS]", "i8"),
        "link_second": ("I[N_LINKS]", "i8"), "link_geometry": ("(I[N_LINKS], 4)", "f8"), "linked": ("I[N_LINKED]", "i8"),
        "mobility": ("(I[N_LINKED], 4)", "f8"), "link_gap": ("I[N_HELD]", "f8"), "link_arms": ("(I[N_LINKS], 4)", "f8"),
        "link_here": ("(I[N_HELD], I[N_LINKED], 3)", "f8"), "link_there": ("(I[N_HELD], I[N_LINKED], 3)", "f8"),
        "link_matrix": ("(I[N_HELD], I[N_HELD])", "f8"), "link_push": ("(I[N_LINKED], 3)", "f8"),
        "link_q": ("(I[N_LINKED], 3)", "f8"), "link_trial": ("(I[N_LINKED], 3)", "f8"),
        "walls": ("(I[N_WALLS], 5)", "f8"), "wall_i": ("I[N_MEETINGS]", "u4"), "wall_k": ("I[N_MEETINGS]", "u4"),
        "wall_starts": ("I[N_BLOCKS] + 1", "i8"), "wall_met": (n, "u1"),
    }  # fmt: skip
    kinds = {"f8": "np.float64", "i8": "np.int64", "u4": "np.uint32", "u8": "np.uint64", "u1": "np.uint8"}
    lines = []
    for name in INTS[INTS.index("bodies") :]:
        if name not in used or name == "floats":
            continue
        shape, kind = shapes.get(name, (n, "f8"))
        lines.append(f"    {name} = carray(pointer_to(I[{name.upper()}]), {shape}, {kinds[kind]})")
    return "\n".join(lines)


def _unpacked(text: str) -> str:
    """Each function of a text that asks for it unpacks the arrays that it uses: numba takes its time over each."""
    first, *functions = text.split("\n@")
    for k, function in enumerate(functions):
        used = set(re.findall(r"\w+", function))
        unpack = f"    I = carray(pointer_to(context), {len(INTS)}, np.int64)\n"
        if "F" in used:
            unpack += f"    F = carray(pointer_to(I[FLOATS]), {len(FLOATS)}, np.float64)\n"
        functions[k] = function.replace("    UNPACK", f"{unpack}    n = I[N]\n{_context_arrays(used)}")
    return "\n@".join([first, *functions])


def _core_text(offsets: Offsets | None) -> str:
    """Text of the module that all laws share: slots, blocks of pairs, the sum of all forces, the step."""
    parts = [
        '"""The core of the engine; see granswim_pymunk/engine/callbacks.py."""\n',
        "import math\n\nimport numpy as np\nfrom numba import carray, types\n",
        "from granswim_pymunk.compiled import cfunc, njit\n",
        "from granswim_pymunk.engine.native import call_block, call_links, call_lists, call_one, call_wall, call_walls\n",
        "from granswim_pymunk.engine.native import difference, four_shifted_ways, four_ways, load_float, load_int\n",
        "from granswim_pymunk.engine.native import lowest_bit, pointer_to, push_apart, store_byte, store_float\n",
        "from granswim_pymunk.engine.links import close\n",
        "from granswim_pymunk.engine.neighbours import build_list, gap_to_walls, moved, near_walls\n",
        "from granswim_pymunk.engine.neighbours import prune, to_wall, together\n\n",
        # no fast-math and no contraction: the same bits in every run and every mode
        "PLAIN = dict(cache=True, error_model='numpy', nogil=True)\n",
        "INLINE = dict(cache=True, error_model='numpy', nogil=True, inline='never')\n",
        "CALLBACK = dict(cache=True, error_model='numpy')\n",
    ]
    for slot, name in enumerate(INTS):
        parts.append(f"{name.upper()} = {slot}\n")
    for slot, name in enumerate(USE_COLUMNS):
        parts.append(f"USE_{name.upper()} = {slot}\n")
    for slot, name in enumerate(FLOATS):
        parts.append(f"F_{name.upper()} = {slot}\n")
    for slot, name in enumerate(MOTION):
        parts.append(f"M_{name.upper()} = {slot}\n")
    for name, number in columns(offsets).items():
        parts.append(f"{name.upper()} = {number}  # column of the state\nP_{name.upper()} = np.uint64({number})\n")
    parts.append(f"P_ROW = np.uint64({ROW})\n")
    for slot, name in enumerate(WORK):
        parts.append(f"W_{name.upper()} = np.uint64({BLOCK * slot})\n")
    parts.append("numpy = np\n\n")
    blocks = Path(__file__).with_name("kernel_text.py").read_text(encoding="utf-8")
    parts += ["\n\n", blocks.partition("# ---- text ----\n")[2].strip("\n"), "\n", _FORCES]
    if offsets is not None:
        parts.append(_step_text(offsets))
    return _unpacked("".join(parts))


_FORCES = f'''

@njit(**PLAIN)
def add_forces(from_list, constrained, t, dt, context):
    """Add all forces [N] to the columns FX, FY of the state, and torques [N m] to TORQUE.

    Block of bodies after block; of a pair, i is the smaller number, so behind a block nothing is added to its
    bodies any more. Uses are sorted: pairs, chains (all in the first block), bodies, constraints; in the exact scheme
    dampings follow the other laws of bodies, and are taken twice, the second time with the velocity that half the kick
    of the first time leads to: together with the constraints where there are any, else each for itself, the last one
    at once.
    ``from_list``: sum the pairs of the list of near ones (else the contacts are there already);
    ``constrained``: with the constraints. Both are whole numbers, or each would be compiled on its own.
    """
    UNPACK
    count = uses.shape[0]
    damped = count  # the first damping, and the last
    final = -1
    if scalars[6] != {HALF_STEP}.0:
        for u in range(count):
            if uses[u, USE_DAMPING] != 0:
                damped = min(damped, u)
                final = u
    for pass_ in range(2 * (blocks.shape[0] - 1)):
        b = pass_ // 2
        again = pass_ - 2 * b
        together_ = scalars[6] == {TOGETHER}.0 or (scalars[6] == {CHAINS}.0 and b == 0)
        until = count
        if again != 0:
            if together_:
                half_kick(blocks[b], blocks[b + 1], 0.5 * dt, state, kick_mass, inverse_moment, kept)
            else:
                until = final
        elif wall_starts[b + 1] > wall_starts[b]:
            call_walls(I[ADD_WALLS], context, wall_starts[b], wall_starts[b + 1], t, dt)
        swapped = together_ and again != 0
        fresh = 1.0 if again == 0 else 0.0
        for u in range(damped if again != 0 else 0, until):
            code = uses[u, USE_CODE]
            if code == 0 or (constrained == 0 and code == {CONSTRAINT}):
                continue
            if together_ and again == 0 and u == damped:
                keep(blocks[b], blocks[b + 1], state, kept)
            if swapped and uses[u, USE_DAMPING] == 0:
                swapped = False
                give_back(blocks[b], blocks[b + 1], state, kept)
            twice = not together_ and (again != 0 or u == final)
            if code != {PAIR} or from_list != 0:
                call_block(uses[u, USE_BLOCK], context, u, b, t, dt, np.int64(twice), fresh)
        if swapped:
            give_back(blocks[b], blocks[b + 1], state, kept)
        if b == 0 and constrained != 0 and I[N_LINKED] > 0 and (again == 0 or damped < count):
            call_links(I[HOLD_LINKS], context, dt)


@njit(**PLAIN)
def pair_force(i, j, t, context):
    """Force on j [N] and torques on i and j [N m] by all pair laws; i gets the opposite force."""
    UNPACK
    for k in range(4):
        work[k] = 0.0
    for u in range(uses.shape[0]):
        if uses[u, USE_ONE] != 0 and (uses[u, 4] == 0 or (mask[u, i] and mask[u, j])):
            call_one(uses[u, USE_ONE], context, u, i, j, t)
    return work[0], work[1], work[2], work[3]


@njit(**PLAIN)
def pair_forces(i, j, normal, t, context, out):
    """The same of many pairs, along their ``normal`` (k, 2), into ``out`` (k,) [N]."""
    for k in range(out.shape[0]):
        px, py, ti, tj = pair_force(i[k], j[k], t, context)
        out[k] = px * normal[k, 0] + py * normal[k, 1]
'''


def _step_text(o: Offsets) -> str:
    """The step over lists of pairs."""
    return f'''

@njit(**PLAIN)
def gather(n_mobile, bodies, state, motion):
    """What the drift does besides moving: read the mobile bodies [SI]."""
    for i in range(n_mobile):
        at = bodies[i]
        state[i, X] = load_float(at + {o.position}) * motion[M_LENGTH_UNIT]
        state[i, Y] = load_float(at + {o.position + 8}) * motion[M_LENGTH_UNIT]
        state[i, VX] = load_float(at + {o.velocity}) * motion[M_VELOCITY_UNIT]
        state[i, VY] = load_float(at + {o.velocity + 8}) * motion[M_VELOCITY_UNIT]
        state[i, FX] = 0.0
        state[i, FY] = 0.0
        state[i, ANGLE] = load_float(at + {o.angle})
        state[i, SPIN] = load_float(at + {o.spin}) * motion[M_SPIN_UNIT]
        state[i, TORQUE] = 0.0


@njit(**PLAIN)
def fast(n_mobile, state):
    """Whether a body is faster than the list of near pairs allows, or is no number."""
    found = False
    for i in range(n_mobile):
        if not state[i, VX] * state[i, VX] + state[i, VY] * state[i, VY] <= state[i, {LIMIT}]:
            found = True
    return found


@njit(**PLAIN)
def hand_over(n_mobile, bodies, state, motion):
    """What the kick does first: add the forces to what the user put on the bodies."""
    for i in range(n_mobile):
        at = bodies[i]
        store_float(at + {o.force}, load_float(at + {o.force}) + state[i, FX] * motion[M_FORCE_SCALE])
        store_float(at + {o.force + 8}, load_float(at + {o.force + 8}) + state[i, FY] * motion[M_FORCE_SCALE])
        if state[i, TORQUE] != 0.0:
            store_float(at + {o.torque}, load_float(at + {o.torque}) + state[i, TORQUE] * motion[M_TORQUE_SCALE])


@njit(**PLAIN)
def finite(state):
    for i in range(state.shape[0]):
        if not (math.isfinite(state[i, X]) and math.isfinite(state[i, Y])):
            return False
    return True


@njit(**PLAIN)
def surround(n_mobile, state, radius, allowance, reaching, headroom, dt, most, reach, ahead):
    """Give each body a speed limit, and so a way [m] within which its list of near pairs holds.

    Returns the number of steps for which: fewer where the fastest body would go farther than ``most``. Pairs that will
    be within reach ``ahead`` steps later are near, too.
    """
    top = 0.0
    for i in range(n_mobile):
        square = state[i, VX] * state[i, VX] + state[i, VY] * state[i, VY]
        speed = headroom + 1.25 * math.sqrt(square)
        top = max(top, speed)
        allowance[i] = speed
        state[i, {LIMIT}] = speed * speed
    lasts = {NEAR_LASTS}.0
    if top * lasts * dt > most:
        lasts = max(math.floor(most / (top * dt)), 1.0)
    # a hair more than the way at the limit: rounding in a drift and in the limit itself
    for i in range(n_mobile):
        way = allowance[i] * ((lasts + ahead) * dt * 1.000001)
        allowance[i] = way
        reaching[i] = radius[i] + 0.5 * reach + way
    return lasts


@cfunc(types.void(types.int64, types.int64), **CALLBACK)
def verlet_step(constraint, space):
    """A constraint's preSolve: after the drift, before any kick. One force call over the near pairs."""
    context = load_int(constraint + {o.user_data})
    UNPACK
    whole = carray(pointer_to(I[MOTION]), {len(MOTION)}, np.int64)
    n_mobile = I[N_MOBILE]
    if I[OWN_DRIFT] == 0:
        gather(n_mobile, bodies, state, motion)
        if fast(n_mobile, state):
            whole[M_LEFT] = 1
    lasted = F[F_STEP] - F[F_PRUNED]
    early = whole[M_LEFT] != 0
    if early or lasted >= F[F_LASTS]:
        whole[M_LEFT] = 0
        if early and not finite(state):
            I[STATUS] = -2
            return
        # the near list is cut from the long one every few steps, the long one built every few hundred
        if early and lasted < {NEAR_LASTS // 2}:
            F[F_HEADROOM] *= 1.3
        elif not early:
            F[F_HEADROOM] *= 0.97
        F[F_PRUNED] = F[F_STEP]
        most = 0.25 * F[F_SKIN]
        F[F_HEADROOM] = min(F[F_HEADROOM], 0.5 * most / ({NEAR_LASTS} * F[F_DT]))
        F[F_LASTS] = surround(n_mobile, state, radius, allowance, reaching, F[F_HEADROOM], F[F_DT], most, F[F_REACH],
                              scalars[5])
        if I[ROOM] > 0 or I[N_WALLS] > 0:
            call_lists(I[RENEW_LISTS], context)
            if I[STATUS] != 0:
                return
    F[F_STEP] += 1.0
    t = F[F_T_START] + F[F_STEP] * F[F_DT]
    dt = F[F_DT]
    for i in range(n_mobile, n):
        state[i, FX] = 0.0  # of the mobile ones, the drift did it
        state[i, FY] = 0.0
        state[i, TORQUE] = 0.0
    add_forces(I[FROM_LIST], I[CONSTRAINED], t, dt, context)
    if I[PUSHED] != 0:
        # what the user put on the bodies, for this one step
        I[PUSHED] = 0
        for i in range(n_mobile):
            state[i, FX] += push[i, 0]
            state[i, FY] += push[i, 1]
            state[i, TORQUE] += push[i, 2]
    if I[OWN_KICK] == 0:
        hand_over(n_mobile, bodies, state, motion)
'''


# near pairs are cut from the long list every few steps, the long list is made every few hundred
_LISTS = f'''

@cfunc(types.void(types.int64), **CALLBACK)
def renew_lists(context):
    """Lists of near pairs, and of bodies near straight walls, for the coming steps."""
    UNPACK
    n_mobile = I[N_MOBILE]
    if I[ROOM] > 0:
        I[CUTS] += 1
        for i in range(n):
            place_x[i] = state[i, X]
            place_y[i] = state[i, Y]
        if moved(place_x, place_y, old_x, old_y, n_mobile, 0.5 * F[F_SKIN], allowance):
            if I[FIXED_SKIN] == 0 and I[REBUILDS] > 0:
                # a list that lasts too short was too narrow, one that lasts long has pairs to spare
                if F[F_STEP] - F[F_BUILT] < {SHORT_BUILD}:
                    F[F_SKIN] = min(1.2 * F[F_SKIN], F[F_MOST_SKIN])
                elif F[F_STEP] - F[F_BUILT] > {LONG_BUILD}:
                    F[F_SKIN] = max(0.9 * F[F_SKIN], F[F_LEAST_SKIN])
            F[F_BUILT] = F[F_STEP]
            count = build_list(place_x, place_y, radius, mobile, group, apart, F[F_REACH] + F[F_SKIN], scalars[0], pair_i,
                               pair_j, pair_shift, heads, nexts, sorted_x, sorted_y, sorted_reach, near_i, near_j,
                               starts)
            if count < 0:
                I[STATUS] = count
                return
            I[N_PAIRS] = count
            I[REBUILDS] += 1
            for i in range(n):
                old_x[i] = place_x[i]
                old_y[i] = place_y[i]
        prune(place_x, place_y, reaching, inverse_mass, radius, starts, blocks, pair_i, pair_j, pair_shift, near_i,
              near_j, near_shift, near_touch, near_mass, near_starts, near_seam, {ROW})
        if I[N_WALLS] > 0:
            near_walls(place_x, place_y, reaching, mobile, walls, scalars[0], blocks, wall_i, wall_k, wall_starts)
'''


def _contacts_text(o: Offsets) -> str:
    """The step over contacts that Chipmunk finds."""
    return f'''

@njit(**PLAIN)
def find(key, keys, values):
    """Row of a body from its address (open addressing); -1 for a stranger."""
    size = keys.shape[0]
    k = ((key >> 4) * 2654435761) & (size - 1)
    while keys[k] != key:
        if keys[k] == 0:
            return -1
        k = (k + 1) & (size - 1)
    return values[k]


@njit(**PLAIN)
def row_of(body, first, n, keys, values):
    """The same; bodies in rows of the package's own begin at ``first``, 0 where they do not."""
    place = np.uint64(body - first)
    if first != 0 and place < np.uint64(n * {8 * ROW}):
        return np.int64(place // np.uint64({8 * ROW}))
    return find(body, keys, values)


@njit(**PLAIN)
def away(n_mobile, state, margin):
    """Whether a body left its surroundings, or is no number."""
    found = False
    for i in range(n_mobile):
        way_x = state[i, X] - state[i, NEAR_X]
        way_y = state[i, Y] - state[i, NEAR_Y]
        if not way_x * way_x + way_y * way_y <= margin:
            found = True
    return found


@cfunc(types.void(types.int64, types.int64, types.int64), **CALLBACK)
def contact_presolve(arbiter, space, data):
    """preSolve of one contact that Chipmunk found: its force goes to a buffer, Chipmunk's impulse is off."""
    context = data
    UNPACK
    store_byte(arbiter + {o.process_collision}, 0)
    if I[ROOM] == 0:
        return  # no law of pairs: nothing to keep
    a = row_of(load_int(arbiter + {o.body_a}), I[FIRST_BODY], n, table_keys, table_values)
    b = row_of(load_int(arbiter + {o.body_b}), I[FIRST_BODY], n, table_keys, table_values)
    if a == {WALL} or b == {WALL}:
        i = max(a, b)  # a ghost's original meets the image of the wall itself
        if i >= 0 and mobile[i]:
            wall_met[i] = 1
        return
    if a == -1 or b == -1 or (a < 0 and b < 0):
        return  # a body of the user's own, or two ghosts, whose originals meet elsewhere
    i = a if a >= 0 else -a - 2
    j = b if b >= 0 else -b - 2
    if i > j:
        i, j = j, i
    if not (mobile[i] or mobile[j]) or together(i, j, group, apart):
        return
    t = F[F_T_START] + (F[F_STEP] + 1.0) * F[F_DT]
    px, py, ti, tj = pair_force(i, j, t, context)
    c = I[N_CONTACTS]
    if c >= I[ROOM]:
        I[STATUS] = -1
        return
    contact_i[c] = i
    contact_j[c] = j
    contact_fx[c] = px
    contact_fy[c] = py
    contact_ti[c] = ti
    contact_tj[c] = tj
    I[N_CONTACTS] = c + 1


@cfunc(types.void(types.int64, types.int64), **CALLBACK)
def chipmunk_step(constraint, space):
    """A constraint's preSolve: sums the contacts in a fixed order (Chipmunk's differs between processes)."""
    context = load_int(constraint + {o.user_data})
    UNPACK
    whole = carray(pointer_to(I[MOTION]), {len(MOTION)}, np.int64)
    n_mobile = I[N_MOBILE]
    if I[OWN_DRIFT] == 0:
        gather(n_mobile, bodies, state, motion)
        if away(n_mobile, state, motion[M_MARGIN]):
            whole[M_LEFT] = 1
    if whole[M_LEFT] != 0:
        whole[M_LEFT] = 0
        if not finite(state):
            I[STATUS] = -2
            return
        I[MARGIN_CROSSED] = 1  # the ghosts at the seam must be laid out anew
    for i in range(n_mobile):
        state[i, X] += image_shift[i]  # bodies in the Space are wrapped, one by one
    F[F_STEP] += 1.0
    t = F[F_T_START] + F[F_STEP] * F[F_DT]
    dt = F[F_DT]
    for i in range(n_mobile, n):
        state[i, FX] = 0.0
        state[i, FY] = 0.0
        state[i, TORQUE] = 0.0
    count = I[N_CONTACTS]
    for i in range(n + 1):
        listing[i] = 0
    for c in range(count):
        listing[contact_i[c] + 1] += 1
    for i in range(n):
        listing[i + 1] += listing[i]
    for c in range(count):
        i = contact_i[c]
        order[listing[i]] = c
        listing[i] += 1
    first = 0
    for i in range(n):
        last = listing[i]
        for k in range(first + 1, last):
            c = order[k]
            m = k
            while m > first and contact_j[order[m - 1]] > contact_j[c]:
                order[m] = order[m - 1]
                m -= 1
            order[m] = c
        for k in range(first, last):
            c = order[k]
            j = contact_j[c]
            if contact_fx[c] != 0.0 or contact_fy[c] != 0.0:
                state[j, FX] += contact_fx[c]
                state[j, FY] += contact_fy[c]
                state[i, FX] -= contact_fx[c]
                state[i, FY] -= contact_fy[c]
                state[i, TORQUE] += contact_ti[c]
                state[j, TORQUE] += contact_tj[c]
        first = last
    I[N_CONTACTS] = 0
    if I[N_WALLS] > 0:
        for i in range(n_mobile):
            place_x[i] = state[i, X]
            place_y[i] = state[i, Y]
        near_walls(place_x, place_y, radius, wall_met, walls, scalars[0], blocks, wall_i, wall_k, wall_starts)
        for i in range(n_mobile):
            wall_met[i] = 0
    add_forces(I[FROM_LIST], I[CONSTRAINED], t, dt, context)
    if I[OWN_KICK] == 0:
        hand_over(n_mobile, bodies, state, motion)


@cfunc(types.void(types.int64, types.float64), **CALLBACK)
def ghost_position(body, dt):
    """A ghost stands where its original stands, one period on.

    The original's address is kept in the ghost's torque, the period in its force: Chipmunk uses
    neither for a kinematic body.
    """
    at = load_int(body + {o.torque})
    px = load_float(at + {o.position}) + load_float(body + {o.force})
    py = load_float(at + {o.position + 8})
    store_float(body + {o.position}, px)
    store_float(body + {o.position + 8}, py)
    store_float(body + {o.transform}, px)
    store_float(body + {o.transform + 8}, py)
    store_float(body + {o.velocity}, load_float(at + {o.velocity}))
    store_float(body + {o.velocity + 8}, load_float(at + {o.velocity + 8}))
'''


class Kernel:
    """What is compiled for a layout of Chipmunk's memory: the core, and what is asked for besides, once each."""

    def __init__(self, offsets: Offsets | None) -> None:
        self.offsets = offsets
        self.core = _module("kernel", _core_text(offsets))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.core, name)

    @functools.cached_property
    def lists(self) -> ModuleType:
        return self._beside("lists", _LISTS)

    @functools.cached_property
    def walls(self) -> ModuleType:
        return self._beside("walls", _WALLS)

    @functools.cached_property
    def links(self) -> ModuleType:
        return self._beside("links", _LINKS)

    @functools.cached_property
    def contacts(self) -> ModuleType:
        assert self.offsets is not None
        return self._beside("contacts", _contacts_text(self.offsets))

    def block(self, law: Law) -> int:
        """Address of what a law adds to the forces of a block of bodies."""
        return int(self._of(law, "block", _TEXTS[law.kind]).block.address)

    def one(self, law: Law) -> int:
        """Address of what a pair law does to a single pair."""
        return int(self._of(law, "one", _one_text).one.address)

    def wall(self, law: Law) -> int:
        """Address of what a law of contact does to a body at a straight wall."""
        return int(self._of(law, "wall", _wall_text).wall.address)

    def _of(self, law: Law, what: str, text: Callable[[Law], str]) -> ModuleType:
        if not law.compiled:
            raise InputError("is plain Python (compiled=False) and runs in python mode only", where=f"law {law.name}")
        return _of_law(self, law, what, text)

    def _beside(self, name: str, text: str, given: Mapping[str, Any] | None = None) -> ModuleType:
        return _module(name, f"from {self.core.__name__} import *  # the core\n{_unpacked(text)}", given)


@functools.lru_cache(maxsize=512)
def _of_law(kernel: Kernel, law: Law, what: str, text: Callable[[Law], str]) -> ModuleType:
    law = lifted(law)
    source = source_of(law)
    given = {}
    if source is None:
        given[f"law_{law.name}"] = numba.njit(error_model="numpy", nogil=True)(law.function)
    try:
        return kernel._beside(f"{what}_{law.name}", f"\n\n{source or ''}{text(law)}", given)
    except numba.core.errors.NumbaError as error:
        raise _compile_error(law, error) from None


def _module(kind: str, text: str, given: Mapping[str, Any] | None = None) -> ModuleType:
    """The module of a text, compiled or out of the cache. ``given``: functions that could not be written into it."""
    # numba looks at the module's own file only: what is compiled into it from elsewhere is in the name
    parts = "".join(inspect.getsource(module) for module in (native, neighbours, links))
    digest = hashlib.sha256(f"{text}{parts}{numba.__version__}{sys.version}".encode()).hexdigest()[:20]
    name = f"granswim_{kind}_{digest}"
    if given:
        # a function without a source has no name on a disk
        text = text.replace("from granswim", "import numba\nfrom granswim", 1).replace("**CALLBACK", "**CALLBACK | {'cache': False}")
        text = text.replace("**PLAIN", "**PLAIN | {'cache': False}")
        name = f"{name}_{next(_NUMBERS)}"
    elif name in sys.modules:
        return sys.modules[name]
    folder = None if given else code_folder()
    path = None if folder is None else folder / f"{name}.py"
    if path is not None:
        _lay_out(path, text)
    # what runs is the text itself: the file is there to be read, and nothing is loaded from it
    file = f"<{name}>" if path is None else str(path)
    module = ModuleType(name)
    module.__file__ = file
    module.__dict__.update(given or {})
    linecache.cache[file] = (len(text), None, text.splitlines(True), file)
    sys.modules[name] = module
    try:
        exec(compile(text, file, "exec"), module.__dict__)
    except BaseException:
        sys.modules.pop(name, None)
        raise
    return module


_NUMBERS = itertools.count()


def _lay_out(path: Path, text: str) -> None:
    """The kernel's text as a file, for a person or a debugger to read."""
    try:
        whole = text.encode("utf-8")
        if not path.exists() or path.read_bytes() != whole:
            with written_whole(path, mode=0o600) as stream:
                stream.write(whole)
    except OSError as error:
        log.warning("the text of the compiled laws is not kept: %s", error)


def _compile_error(law: Law, error: Exception) -> InputError:
    first = str(error).strip().splitlines()
    return InputError(
        f"numba cannot compile it: {' '.join(first[:3])}; "
        "write it with floats and math, or declare it with compiled=False",
        where=f"law {law.name}",
    )


@functools.lru_cache(maxsize=4)
def kernel_for(offsets: Offsets | None) -> Kernel:
    """The kernel for a layout of Chipmunk's memory."""
    return Kernel(offsets)
