"""Compiling laws into the callbacks that Chipmunk calls.

Each law is a generated module of its own, compiled when a scene first uses it: what it adds to the forces of one block
of bodies. The core, another module, goes through the blocks and the uses of laws and calls them by their addresses; it
holds the native callbacks too. What only some scenes need (lists of pairs, straight walls, links, Chipmunk's contacts)
are modules as well; what no law changes of all these stands as Python in ``kernel``. All of them find their arrays behind one pointer, the context. A module is laid out as a file in
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
from dataclasses import fields
from pathlib import Path
from types import ModuleType
from typing import Any

import numba

from ..errors import InputError
from ..files import written_whole
from ..laws import Law
from ..storage import code_folder
from . import links, native, neighbours
from .law_text import raises, source_of
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
    "order", "listing", "image_shift", "which", "work", "kick_mass", "heavier", "inverse_moment", "kept",
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
BODIES = 512
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
    unpack(context)
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
    unpack(context)
    o = uses[u, 1]
    step = scalars[5] * dt
{_indent(pair.read if pair.reach else [], 1)}    reach = 0.0{pair.reach}
    {_FLAT}
    end = near_starts[b + 1]
    for first in range(near_starts[b], end, {BLOCK}):
        last = min(first + {BLOCK}, end)
        {"if uses[u, 4] == 0:" if not pair.reach else "if False:"}
            count = touching(first, last, near_seam[b], flat, near_i, near_j, near_shift, near_touch, which, work)
        else:
            count = reached(first, last, reach, {'step' if law.reach else '0.0'}, uses[u, 4], mask[u], flat, near_i, near_j,
                            near_shift, near_touch, which, work)
        collect(first, count, {int(round_)}, flat, radius, near_i, near_j, near_touch, near_mass, which, work)
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
    unpack(context)
    o = uses[u, 1]
    ri = radius[i]
    reduced_mass = 1.0 / inverse_mass[i]
    wi = state[i, SPIN]
{_indent([*read, f"{answer} = {_call(law, available)}"], 1)}{_indent(["state[i, TORQUE] += mi"] if _turns(law) else [], 1)}
    state[i, FX] -= fn * nx - ft * ny
    state[i, FY] -= fn * ny + ft * nx
    state[i, TORQUE] -= ri * ft
"""


def _slot(law: Law, name: str) -> int:
    return [a for p in law.parameters for a in p.arguments].index(name)


# numba would call a function for ``state.reshape`` in every step
_FLAT = f"flat = carray(pointer_to(I[STATE]), n * {ROW}, np.float64)"
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
    plain = [*loops, "        add_two(flat, i * P_ROW + P_FX, ax, ay)"]
    # once more, with the velocity that half the kick leads to; ``fresh``: 1.0 where the force is not in the sum yet
    again = [
        *loops,
        "        half = 0.5 * dt * kick_mass[i]",
        "        mx = state[i, VX] + half * (state[i, FX] + fresh * ax)",
        "        my = state[i, VY] + half * (state[i, FY] + fresh * ay)",
        f"        bx, by = {_call(law, available | {'vx': 'mx', 'vy': 'my'})}",
        "        add_two(flat, i * P_ROW + P_FX, bx - (1.0 - fresh) * ax, by - (1.0 - fresh) * ay)",
    ]
    lines = ["o = uses[u, 1]", "r0 = parameters[o - 1]", _FLAT, *read]
    if law.damping:
        lines += ["if twice:", *("    " + line for line in again), "else:", *("    " + line for line in plain)]
    else:
        lines += plain
    return f"\n{_BLOCK}\n    unpack(context)\n{_indent(lines, 1)}"


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
    return f"\n{_BLOCK}\n    unpack(context)\n{_indent(lines, 1)}"


def _joint_text(law: Law) -> str:
    """A law of joints, whose bodies lie in the first block."""
    read, names = _parameter_locals(law)
    call = _call(law, {"t": "t", "rate": "rate", "bend": "bend", **names})
    bends = "bend" in law.arguments  # an arctangent takes as long as all the rest
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
        *(["        bend = math.atan2(dx, -dy)"] if bends else []),
        f"        torque = {call}",
        "        state[j, FX] -= torque / square * dy",
        "        state[j, FY] += torque / square * dx",
        "    else:",
        "        rate = state[j, SPIN] if j >= 0 else 0.0",
        *(["        bend = state[j, ANGLE] if j >= 0 else 0.0"] if bends else []),
        "        if i >= 0:",
        "            rate -= state[i, SPIN]",
        *(["            bend -= state[i, ANGLE]"] if bends else []),
        f"        torque = {call}",
        "        if j >= 0:",
        "            state[j, TORQUE] += torque",
        "        if i >= 0:",
        "            state[i, TORQUE] -= torque",
    ]
    return f"\n{_BLOCK}\n    unpack(context)\n{_indent(lines, 1)}"


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
        functions[k] = function.replace("    unpack(context)", f"{unpack}    n = I[N]\n{_context_arrays(used)}")
    return "\n@".join([first, *functions])


# what the texts of ``kernel`` call further numbers
_NUMBERS = {
    "ROW": ROW, "N_MOTION": len(MOTION), "LIMIT": LIMIT, "WALL_ROW": WALL, "CODE_PAIR": PAIR,
    "CODE_CONSTRAINT": CONSTRAINT, "SCHEME_HALF_STEP": HALF_STEP, "SCHEME_TOGETHER": TOGETHER, "SCHEME_CHAINS": CHAINS,
    "NEAR_LASTS": NEAR_LASTS, "SHORT_BUILD": SHORT_BUILD, "LONG_BUILD": LONG_BUILD,
}  # fmt: skip


def text_of(name: str) -> str:
    """What a file of ``kernel`` adds to the generated code: all below its line."""
    whole = Path(__file__).with_name("kernel").joinpath(f"{name}.py").read_text(encoding="utf-8")
    return "\n\n" + whole.partition("# ---- text ----\n")[2].strip("\n") + "\n"


def _core_text(offsets: Offsets | None) -> str:
    """Text of the module that all laws share: slots, blocks of pairs, the sum of all forces, the step."""
    parts = [
        '"""The core of the engine; see granswim_pymunk/engine/callbacks.py."""\n',
        "import math\n\nimport numpy as np\nfrom numba import carray, types\n",
        "from granswim_pymunk.compiled import cfunc, njit\n",
        "from granswim_pymunk.engine.native import call_block, call_links, call_lists, call_one, call_wall, call_walls\n",
        "from granswim_pymunk.engine.native import add_two, difference, four_shifted_ways, four_ways, load_float, load_int\n",
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
    parts += [f"{name} = {number}\n" for name, number in _NUMBERS.items()]
    if offsets is not None:
        parts += [f"AT_{f.name.upper()} = {getattr(offsets, f.name)}\n" for f in fields(offsets)]
    parts += ["numpy = np\n\n", text_of("core")]
    if offsets is not None:
        parts.append(text_of("step"))
    return _unpacked("".join(parts))


class Kernel:
    """What is compiled for a layout of Chipmunk's memory: the core, and what is asked for besides, once each."""

    def __init__(self, offsets: Offsets | None) -> None:
        self.offsets = offsets
        self.core = _module("kernel", _core_text(offsets))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.core, name)

    @functools.cached_property
    def lists(self) -> ModuleType:
        return self._beside("lists", text_of("lists"))

    @functools.cached_property
    def walls(self) -> ModuleType:
        return self._beside("walls", text_of("walls"))

    @functools.cached_property
    def links(self) -> ModuleType:
        return self._beside("links", text_of("links"))

    @functools.cached_property
    def contacts(self) -> ModuleType:
        return self._beside("contacts", text_of("contacts"))

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
        if raises(law.function):
            # Chipmunk calls it: an error has nowhere to go, and the step would go on without the force
            raise InputError(
                "raises errors, which compiled code cannot pass on: let it return math.nan, which stops the run, or "
                "declare it with compiled=False",
                where=f"law {law.name}",
            )
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
        name = f"{name}_{next(_SERIAL)}"
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


_SERIAL = itertools.count()


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
