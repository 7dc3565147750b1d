"""Compiling laws into the callbacks that Chipmunk calls.

The laws are put into one generated module: the sum of all forces (an ordinary array function, used by
every mode and by the reference to nothing), and the native callbacks around it. The module is a file
in the user's cache, named by the hash of its text, so numba keeps the machine code beside it and the
second start takes a quarter of a second. The generated text is meant to be read.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.util
import inspect
import linecache
import math
import os
import re
import sys
import tempfile
import textwrap
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import platformdirs

from ..errors import InputError
from ..laws import Law, all_laws
from . import native, neighbours
from .motion import MOTION, STATE
from .native import Offsets

KIND_ORDER = {"pair": 0, "chain": 1, "body": 2, "constraint": 3}

# columns of the integer table that says how a law is used
USE_COLUMNS = ("code", "parameters", "first", "last", "mask", "first_run", "last_run")

# slots of the context that the callbacks find behind a pointer: addresses and whole numbers ...
INTS = (
    "n", "n_mobile", "room", "n_pairs", "n_rows", "n_uses", "n_parameters", "n_input", "status", "rebuilds",
    "n_cells", "n_table", "n_contacts", "margin_crossed", "n_chains", "n_runs", "n_near", "own_drift", "own_kick",
    "from_list", "constrained",
    "bodies", "state", "motion", "place_x", "place_y", "spin", "mass", "inverse_mass", "radius", "given_inertia", "torque",
    "old_x", "old_y", "mobile", "group", "parameters", "uses", "runs", "mask", "pair_i", "pair_j", "pair_shift",
    "near_i", "near_j", "near_shift", "near_touch", "near_mass",
    "allowance", "far", "reaching", "sorted_x", "sorted_y", "sorted_reach", "starts",
    "heads", "nexts", "chains", "input_t", "input_v", "input_at", "scalars", "floats", "table_keys",
    "table_values", "contact_i", "contact_j", "contact_fx", "contact_fy", "contact_ti", "contact_tj",
    "order", "listing", "image_shift",
)  # fmt: skip
# ... and floats
FLOATS = (
    "t_start", "dt", "step", "skin", "reach", "margin", "near_skin", "pruned",
)  # fmt: skip
# steps that a list of near pairs should last: cutting it costs as much as two or three steps
SHORT_PRUNE = 16
LONG_PRUNE = 32
AHEAD = 40  # steps for which a body's own speed is allowed for
# numbers that laws may ask for
SCALARS = ("length", "gx", "gy", "g", "mean_mass")


def cache_folder() -> Path:
    """Where compiled kernels are kept: GRANSWIM_CACHE, else the user's cache, else a temporary folder."""
    chosen = os.environ.get("GRANSWIM_CACHE")
    folder = Path(chosen) if chosen else Path(platformdirs.user_cache_dir("granswim_pymunk"))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError:
        folder = Path(tempfile.gettempdir()) / "granswim_pymunk"
        folder.mkdir(parents=True, exist_ok=True)
    return folder


_PLAIN_GLOBALS = {"math", "np", "numpy"}


def _law_source(law: Law) -> str | None:
    """The law's function as a text that stands alone, or None where there is none."""
    function = inspect.unwrap(law.function)
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError):
        return None
    definition = next((node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)), None)
    if definition is None or function.__closure__:
        return None
    constants: list[ast.stmt] = []
    for name in function.__code__.co_names:
        if name in function.__globals__ and name not in _PLAIN_GLOBALS:
            value = function.__globals__[name]
            if not isinstance(value, int | float) or not math.isfinite(value):
                return None
            number = int(value) if isinstance(value, int) else float(value)
            constants.append(ast.parse(f"{name} = {number!r}").body[0])
    definition.decorator_list = []
    definition.name = f"law_{law.name}"
    definition.returns = None
    for argument in definition.args.args:
        argument.annotation = None
    if definition.body and isinstance(definition.body[0], ast.Expr) and isinstance(definition.body[0].value, ast.Constant):
        definition.body = definition.body[1:]  # the docstring
    # inside the function: two laws may give one name to different numbers
    definition.body = constants + definition.body
    return "@njit(**INLINE)\n" + ast.unparse(ast.fix_missing_locations(definition)) + "\n"


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


def _pair_block(law: Law, code: int) -> str:
    """Loop over the neighbour list for one pair law."""
    read, names = _parameter_locals(law)
    spin = "vt" in law.arguments
    available = {
        "t": "t", "gap": "gap", "distance": "d", "vn": "vn", "vt": "vt", "reduced_mass": "reduced_mass",
        "reduced_radius": "radius[i] * radius[j] / touch", "r0": "parameters[o - 1]", **names,
    }  # fmt: skip
    reach = f" + {names.get(law.reach, f'parameters[o + {_slot(law, law.reach)}]')}" if law.reach else ""
    lines = [
        "dy = state[j, Y] - state[i, Y]",
        "square = dx * dx + dy * dy",
        f"limit = touch{reach}",
        "if square < limit * limit and square > 0.0:",
        "    d = math.sqrt(square)",
        "    nx = dx / d",
        "    ny = dy / d",
        "    gap = d - touch",
        "    ux = state[j, VX] - state[i, VX]",
        "    uy = state[j, VY] - state[i, VY]",
        "    vn = ux * nx + uy * ny",
    ]
    if spin:
        lines.append("    vt = uy * nx - ux * ny - spin[j] * radius[j] - spin[i] * radius[i]")
    lines.append(f"    fn, ft = {_call(law, available)}")
    force = ["px = fn * nx", "py = fn * ny"]
    if spin:
        force = ["px = fn * nx - ft * ny", "py = fn * ny + ft * nx", "ti = -radius[i] * ft", "tj = -radius[j] * ft"]
    add = ["state[j, FX] += px", "state[j, FY] += py", "state[i, FX] -= px", "state[i, FY] -= py"]
    if spin:
        add += ["torque[i] += ti", "torque[j] += tj"]
    inner = ["    " + line for line in force]
    # the same lines twice: a call for each pair with all its arrays costs more than the force
    return f"""
@njit(**PLAIN)
def pair_{law.name}(i, j, o, t, state, spin, inverse_mass, radius, parameters, scalars):
    length = scalars[0]
    px = 0.0
    py = 0.0
    ti = 0.0
    tj = 0.0
{_indent(read, 1)}    touch = radius[i] + radius[j]
    reduced_mass = 1.0 / (inverse_mass[i] + inverse_mass[j])
    dx = state[j, X] - state[i, X]
    if length > 0.0:
        dx -= length * math.floor(dx / length + 0.5)
{_indent(lines + inner, 1)}    return px, py, ti, tj


@njit(**PLAIN)
def sum_{law.name}(u, t, state, spin, radius, torque, parameters, uses, mask, near_i, near_j, near_shift,
                   near_touch, near_mass, n_near):
    o = uses[u, 1]
    masked = uses[u, 4]
{_indent(read, 1)}    for k in range(n_near):
        i = near_i[k]
        j = near_j[k]
        touch = near_touch[k]
        reduced_mass = near_mass[k]
        dx = state[j, X] - state[i, X] + near_shift[k]
        if masked and not (mask[u, i] and mask[u, j]):
            continue
{_indent([*lines, *inner, *("    " + line for line in add)], 2)}"""


def _slot(law: Law, name: str) -> int:
    return [a for p in law.parameters for a in p.arguments].index(name)


def _body_block(law: Law, code: int) -> list[str]:
    read, names = _parameter_locals(law)
    available = {
        "t": "t", "dt": "dt", "x": "state[i, X]", "y": "state[i, Y]", "vx": "state[i, VX]", "vy": "state[i, VY]", "mass": "mass[i]",
        "radius": "radius[i]", "r0": "r0", "given_inertia": "given_inertia[i]", "fx": "state[i, FX]",
        "fy": "state[i, FY]",
        "command": "command", **_SCENE, **names,
    }  # fmt: skip
    lines = [f"elif code == {code}:  # {law.name}", *("    " + line for line in read)]
    # unsigned: numba then leaves out the test for an index counted from the end
    lines += [
        "    for run in range(uses[u, 5], uses[u, 6]):",
        "        for i in range(np.uint64(runs[run, 0]), np.uint64(runs[run, 1])):",
    ]
    if "command" in law.arguments:
        lines.append("            command = interpolate(t + 0.5 * dt, input_t, input_v, input_at[i, 0], input_at[i, 1])")
    lines += [f"            ax, ay = {_call(law, available)}", "            state[i, FX] += ax", "            state[i, FY] += ay"]
    return lines


def _chain_block(law: Law, code: int) -> list[str]:
    read, names = _parameter_locals(law)
    available = {"t": "t"} | {a: f"state[a:b, {a.upper()}]" for a in ("x", "y", "vx", "vy", "fx", "fy")}
    available |= {"mass": "mass[a:b]", **names}
    return [
        f"elif code == {code}:  # {law.name}",
        *("    " + line for line in read),
        "    for k in range(chains.shape[0]):",
        "        a = chains[k, 0]",
        "        b = chains[k, 1]",
        f"        {_call(law, available)}",
    ]


def _context_arrays(used: set[str]) -> str:
    """Lines that turn the context behind a pointer into arrays, those that are used."""
    n = "n"
    shapes = {
        "state": (f"(n, {len(STATE)})", "f8"), "motion": (str(len(MOTION)), "f8"),
        "bodies": (n, "i8"), "mobile": (n, "u1"), "group": (n, "i8"), "old_x": (n, "f8"), "old_y": (n, "f8"),
        "parameters": ("I[N_PARAMETERS]", "f8"), "uses": (f"(I[N_USES], {len(USE_COLUMNS)})", "i8"),
        "runs": ("(I[N_RUNS], 2)", "i8"), "mask": ("(I[N_USES], n)", "u1"), "pair_i": ("I[ROOM]", "u4"),
        "pair_j": ("I[ROOM]", "u4"), "pair_shift": ("I[ROOM]", "f8"), "near_i": ("I[ROOM]", "u4"),
        "near_j": ("I[ROOM]", "u4"), "near_shift": ("I[ROOM]", "f8"), "near_touch": ("I[ROOM]", "f8"),
        "near_mass": ("I[ROOM]", "f8"), "starts": ("n + 1", "i8"),
        "heads": ("I[N_CELLS]", "i8"), "nexts": (n, "i8"), "chains": ("(I[N_CHAINS], 2)", "i8"),
        "input_t": ("I[N_INPUT]", "f8"), "input_v": ("I[N_INPUT]", "f8"), "input_at": ("(n, 2)", "i8"),
        "scalars": (str(len(SCALARS)), "f8"), "table_keys": ("I[N_TABLE]", "i8"),
        "table_values": ("I[N_TABLE]", "i8"), "contact_i": ("I[ROOM]", "i8"), "contact_j": ("I[ROOM]", "i8"),
        "contact_fx": ("I[ROOM]", "f8"), "contact_fy": ("I[ROOM]", "f8"), "contact_ti": ("I[ROOM]", "f8"),
        "contact_tj": ("I[ROOM]", "f8"), "order": ("I[ROOM]", "i8"), "listing": ("n + 1", "i8"),
    }  # fmt: skip
    kinds = {"f8": "np.float64", "i8": "np.int64", "u4": "np.uint32", "u1": "np.uint8"}
    lines = []
    for name in INTS[INTS.index("bodies") :]:
        if name not in used or name == "floats":
            continue
        shape, kind = shapes.get(name, (n, "f8"))
        lines.append(f"    {name} = carray(pointer_to(I[{name.upper()}]), {shape}, {kinds[kind]})")
    return "\n".join(lines)


def generate(laws: Sequence[Law], offsets: Offsets | None) -> tuple[str, dict[str, Any], dict[str, int]]:
    """Text of the module for these laws, functions that could not be written into it, and law codes."""
    laws = sorted((law for law in laws if law.kind in KIND_ORDER), key=lambda law: (KIND_ORDER[law.kind], law.name))
    codes = {law.name: k + 1 for k, law in enumerate(laws)}
    given: dict[str, Any] = {}
    parts = [
        '"""Generated from the laws; see granswim_pymunk/engine/callbacks.py."""\n',
        "import math\n\nimport numpy as np\nfrom numba import carray, cfunc, njit, types\n",
        "from granswim_pymunk.engine.native import load_float, load_int, pointer_to, store_byte, store_float\n",
        "from granswim_pymunk.engine.neighbours import build_list, moved, prune\n\n",
        # no fast-math and no contraction: the same bits in every run and every mode
        "PLAIN = dict(cache=CACHE, error_model='numpy', nogil=True)\n".replace("CACHE", "True"),
        "INLINE = dict(cache=True, error_model='numpy', nogil=True, inline='never')\n",
    ]
    for slot, name in enumerate(INTS):
        parts.append(f"{name.upper()} = {slot}\n")
    for slot, name in enumerate(FLOATS):
        parts.append(f"F_{name.upper()} = {slot}\n")
    for slot, name in enumerate(MOTION):
        parts.append(f"M_{name.upper()} = {slot}\n")
    for slot, name in enumerate(STATE[:6]):
        parts.append(f"{name.upper()} = {slot}  # column of the state\n")
    parts.append("numpy = np\n\n")
    for law in laws:
        text = _law_source(law)
        if text is None:
            given[f"law_{law.name}"] = numba.njit(error_model="numpy", nogil=True)(law.function)
        else:
            parts.append("\n" + text)
    parts.append(
        '''

@njit(**PLAIN)
def interpolate(t, times, values, first, last):
    """Linear between rows, constant outside."""
    if last <= first:
        return 0.0
    if t <= times[first]:
        return values[first]
    if t >= times[last - 1]:
        return values[last - 1]
    low = first
    high = last - 1
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= t:
            low = middle
        else:
            high = middle
    weight = (t - times[low]) / (times[high] - times[low])
    return values[low] + weight * (values[high] - values[low])
'''
    )
    pairs = [law for law in laws if law.kind == "pair"]
    parts += [_pair_block(law, codes[law.name]) for law in pairs]
    arguments = (
        "t, dt, state, spin, mass, inverse_mass, radius, given_inertia, torque, parameters, uses,\n"
        "    runs, mask, near_i, near_j, near_shift, near_touch, near_mass, n_near, scalars, chains, input_t, input_v, input_at"
    )
    pair_sums = []
    for law in pairs:
        pair_sums += [
            f"elif code == {codes[law.name]}:",
            "    if from_list != 0:",
            f"        sum_{law.name}(u, t, state, spin, radius, torque, parameters, uses, mask,",
            "            near_i, near_j, near_shift, near_touch, near_mass, n_near)",
        ]
    others = [line for law in laws if law.kind in ("body", "constraint") for line in _body_block(law, codes[law.name])]
    chains = [line for law in laws if law.kind == "chain" for line in _chain_block(law, codes[law.name])]
    constraint_codes = [codes[law.name] for law in laws if law.kind == "constraint"]
    parts.append(f'''

@njit(**PLAIN)
def add_forces(from_list, constrained, {arguments}):
    """Add all forces [N] to the columns FX, FY of the state, and torques [N m]. Uses are sorted: pairs, chains, bodies, constraints.

    ``from_list``: sum the pairs of the list of near ones (else the contacts are there already);
    ``constrained``: with the constraints. Both are whole numbers, or each would be compiled on its own.
    """
    for u in range(uses.shape[0]):
        code = uses[u, 0]
        o = uses[u, 1]
        r0 = parameters[o - 1]
        if code == 0:
            continue
        if constrained == 0 and code >= {min(constraint_codes, default=10**6)}:
            continue
        if False:
            pass
{_indent(pair_sums, 2)}{_indent(chains, 2)}{_indent(others, 2)}''')
    pair_calls = []
    for law in pairs:
        pair_calls += [
            f"elif code == {codes[law.name]}:",
            f"    px, py, ti, tj = pair_{law.name}(i, j, uses[u, 1], t, state, spin, inverse_mass, radius, parameters, scalars)",
        ]
    parts.append(f'''

@njit(**PLAIN)
def pair_force(i, j, t, state, spin, inverse_mass, radius, parameters, uses, mask, scalars):
    """Force on j [N] and torques on i and j [N m] by all pair laws; i gets the opposite force."""
    sx = 0.0
    sy = 0.0
    si = 0.0
    sj = 0.0
    for u in range(uses.shape[0]):
        code = uses[u, 0]
        if code == 0 or (uses[u, 4] and not (mask[u, i] and mask[u, j])):
            continue
        px = 0.0
        py = 0.0
        ti = 0.0
        tj = 0.0
        if False:
            pass
{_indent(pair_calls, 2)}        sx += px
        sy += py
        si += ti
        sj += tj
    return sx, sy, si, sj
''')
    if offsets is not None:
        parts.append(_native_text(offsets, arguments))
    return "".join(parts), given, codes


def _native_text(o: Offsets, arguments: str) -> str:
    text = f'''

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
def gather(n_mobile, bodies, state, motion, spin, torque, far):
    """What the drift does besides moving: read the mobile bodies [SI]; True where one left its surroundings."""
    left = False
    for i in range(n_mobile):
        at = bodies[i]
        state[i, X] = load_float(at + {o.position}) * motion[M_LENGTH_UNIT]
        state[i, Y] = load_float(at + {o.position + 8}) * motion[M_LENGTH_UNIT]
        state[i, VX] = load_float(at + {o.velocity}) * motion[M_VELOCITY_UNIT]
        state[i, VY] = load_float(at + {o.velocity + 8}) * motion[M_VELOCITY_UNIT]
        state[i, FX] = 0.0
        state[i, FY] = 0.0
        spin[i] = load_float(at + {o.spin}) * motion[M_SPIN_UNIT]
        torque[i] = 0.0
        way_x = state[i, X] - state[i, {STATE.index("near_x")}]
        way_y = state[i, Y] - state[i, {STATE.index("near_y")}]
        if not way_x * way_x + way_y * way_y <= far[i]:
            left = True
    return left


@njit(**PLAIN)
def hand_over(n_mobile, bodies, state, motion, torque):
    """What the kick does first: add the forces to what the user put on the bodies."""
    for i in range(n_mobile):
        at = bodies[i]
        store_float(at + {o.force}, load_float(at + {o.force}) + state[i, FX] * motion[M_FORCE_SCALE])
        store_float(at + {o.force + 8}, load_float(at + {o.force + 8}) + state[i, FY] * motion[M_FORCE_SCALE])
        if torque[i] != 0.0:
            store_float(at + {o.torque}, load_float(at + {o.torque}) + torque[i] * motion[M_TORQUE_SCALE])


@njit(**PLAIN)
def finite(state):
    for i in range(state.shape[0]):
        if not (math.isfinite(state[i, X]) and math.isfinite(state[i, Y])):
            return False
    return True


@njit(**PLAIN)
def surround(n_mobile, state, radius, allowance, far, reaching, floor, ahead, most, reach):
    """Give each body an allowance [m] that lasts some steps: the drift says when one has used it up."""
    for i in range(n_mobile):
        state[i, {STATE.index("near_x")}] = state[i, X]
        state[i, {STATE.index("near_y")}] = state[i, Y]
        speed = math.sqrt(state[i, VX] * state[i, VX] + state[i, VY] * state[i, VY])
        way = min(floor + ahead * speed, most)
        allowance[i] = way
        far[i] = way * way
        reaching[i] = radius[i] + 0.5 * reach + way


@cfunc(types.void(types.int64, types.int64), cache=True, error_model='numpy')
def verlet_step(constraint, space):
    """A constraint's preSolve: after the drift, before any kick. One force call over the near pairs."""
    I = carray(pointer_to(load_int(constraint + {o.user_data})), {len(INTS)}, np.int64)
    UNPACK
    whole = carray(pointer_to(I[MOTION]), {len(MOTION)}, np.int64)
    n_mobile = I[N_MOBILE]
    if I[OWN_DRIFT] == 0 and gather(n_mobile, bodies, state, motion, spin, torque, far):
        whole[M_LEFT] = 1
    if whole[M_LEFT] != 0:
        whole[M_LEFT] = 0
        if not finite(state):
            I[STATUS] = -2
            return
        if I[ROOM] > 0:
            # the near list is cut from the long one every few steps, the long one built every few hundred
            lasted = F[F_STEP] - F[F_PRUNED]
            F[F_PRUNED] = F[F_STEP]
            if lasted < {SHORT_PRUNE}:
                F[F_NEAR_SKIN] = min(1.2 * F[F_NEAR_SKIN], 0.5 * F[F_SKIN])
            elif lasted > {LONG_PRUNE}:
                F[F_NEAR_SKIN] *= 0.8
            surround(n_mobile, state, radius, allowance, far, reaching, 0.5 * F[F_NEAR_SKIN], {AHEAD} * F[F_DT],
                     0.25 * F[F_SKIN], F[F_REACH])
            for i in range(n):
                place_x[i] = state[i, X]
                place_y[i] = state[i, Y]
            if moved(place_x, place_y, old_x, old_y, n_mobile, 0.5 * F[F_SKIN], allowance):
                count = build_list(place_x, place_y, radius, mobile, group, F[F_REACH] + F[F_SKIN], scalars[0], pair_i,
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
            I[N_NEAR] = prune(place_x, place_y, reaching, inverse_mass, radius, pair_i, pair_j, pair_shift, I[N_PAIRS],
                              near_i, near_j, near_shift, near_touch, near_mass)
    F[F_STEP] += 1.0
    t = F[F_T_START] + F[F_STEP] * F[F_DT]
    dt = F[F_DT]
    n_near = I[N_NEAR]
    for i in range(n_mobile, n):
        state[i, FX] = 0.0  # of the mobile ones, the drift did it
        state[i, FY] = 0.0
        torque[i] = 0.0
    add_forces(I[FROM_LIST], I[CONSTRAINED], {arguments})
    if I[OWN_KICK] == 0:
        hand_over(n_mobile, bodies, state, motion, torque)


@cfunc(types.void(types.int64, types.int64, types.int64), cache=True, error_model='numpy')
def contact_presolve(arbiter, space, data):
    """preSolve of one contact that Chipmunk found: its force goes to a buffer, Chipmunk's impulse is off."""
    I = carray(pointer_to(data), {len(INTS)}, np.int64)
    UNPACK
    store_byte(arbiter + {o.process_collision}, 0)
    a = find(load_int(arbiter + {o.body_a}), table_keys, table_values)
    b = find(load_int(arbiter + {o.body_b}), table_keys, table_values)
    if a == -1 or b == -1 or (a < 0 and b < 0):
        return  # a body of the user's own, or two ghosts, whose originals meet elsewhere
    i = a if a >= 0 else -a - 2
    j = b if b >= 0 else -b - 2
    if i > j:
        i, j = j, i
    if not (mobile[i] or mobile[j]) or (group[i] != 0 and group[i] == group[j]):
        return
    t = F[F_T_START] + (F[F_STEP] + 1.0) * F[F_DT]
    px, py, ti, tj = pair_force(i, j, t, state, spin, inverse_mass, radius, parameters, uses, mask, scalars)
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


@cfunc(types.void(types.int64, types.int64), cache=True, error_model='numpy')
def chipmunk_step(constraint, space):
    """A constraint's preSolve: sums the contacts in a fixed order (Chipmunk's differs between processes)."""
    I = carray(pointer_to(load_int(constraint + {o.user_data})), {len(INTS)}, np.int64)
    UNPACK
    whole = carray(pointer_to(I[MOTION]), {len(MOTION)}, np.int64)
    n_mobile = I[N_MOBILE]
    if I[OWN_DRIFT] == 0 and gather(n_mobile, bodies, state, motion, spin, torque, far):
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
        torque[i] = 0.0
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
                torque[i] += contact_ti[c]
                torque[j] += contact_tj[c]
        first = last
    I[N_CONTACTS] = 0
    n_near = I[N_NEAR]
    add_forces(I[FROM_LIST], I[CONSTRAINED], {arguments})
    if I[OWN_KICK] == 0:
        hand_over(n_mobile, bodies, state, motion, torque)


@cfunc(types.void(types.int64, types.float64), cache=True, error_model='numpy')
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
    # each callback unpacks the arrays that it uses: numba takes its time over each of them
    first, *callbacks = text.split("\n@cfunc(")
    for k, callback in enumerate(callbacks):
        arrays = _context_arrays(set(re.findall(r"\w+", callback)))
        unpack = f"    F = carray(pointer_to(I[FLOATS]), {len(FLOATS)}, np.float64)\n    n = I[N]\n{arrays}"
        callbacks[k] = callback.replace("    UNPACK", unpack)
    return "\n@cfunc(".join([first, *callbacks])


class Kernel:
    """A compiled module: ``codes`` maps a law's name to its code in the table of uses."""

    def __init__(self, module: ModuleType | Any, codes: dict[str, int], file: Path | None) -> None:
        self.module = module
        self.codes = codes
        self.file = file

    def __getattr__(self, name: str) -> Any:
        return getattr(self.module, name)


@functools.lru_cache(maxsize=32)
def _compile(laws: tuple[Law, ...], offsets: Offsets | None) -> Kernel:
    text, given, codes = generate(laws, offsets)
    # numba looks at the kernel's own file only: what is compiled into it from elsewhere is in the name
    parts = "".join(inspect.getsource(module) for module in (native, neighbours))
    digest = hashlib.sha256(f"{text}{parts}{numba.__version__}{sys.version}".encode()).hexdigest()[:20]
    name = f"granswim_kernel_{digest}"
    if given:
        # a function without a source of its own cannot be cached on disk
        text = text.replace("cache=True", "cache=False")
        module = ModuleType(name)
        module.__dict__.update(given)
        file = f"<{name}>"
        linecache.cache[file] = (len(text), None, text.splitlines(True), file)
        try:
            exec(compile(text, file, "exec"), module.__dict__)
        except numba.core.errors.NumbaError as error:
            raise _compile_error(given, error) from None
        return Kernel(module, codes, None)
    folder = cache_folder() / "kernels"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.py"
    if not path.exists():
        beside = folder / f".{name}.{os.getpid()}"
        beside.write_text(text, encoding="utf-8")
        os.replace(beside, path)
    if name in sys.modules:
        return Kernel(sys.modules[name], codes, path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except numba.core.errors.NumbaError as error:
        sys.modules.pop(name, None)
        raise _compile_error({f"law_{law.name}": law for law in laws}, error) from None
    return Kernel(module, codes, path)


def _compile_error(functions: dict[str, Any], error: Exception) -> InputError:
    names = ", ".join(name.removeprefix("law_") for name in functions)
    first = str(error).strip().splitlines()
    return InputError(
        f"numba cannot compile one of these laws ({names}): {' '.join(first[:3])}; "
        "write it with floats and math, or declare it with compiled=False"
    )


def compile_laws(used: Sequence[Law], offsets: Offsets | None) -> Kernel:
    """The kernel for these laws.

    All laws that come with the package are compiled together, once, so that scenes which differ only
    in their laws share one kernel. A user's own law gets a kernel with just the laws it is used with,
    which is ready sooner.
    """
    package = [law for law in all_laws().values() if (law.function.__module__ or "").startswith("granswim_pymunk.laws")]
    own = [law for law in dict.fromkeys(used) if law not in package]
    for law in own:
        if not law.compiled:
            raise InputError("is plain Python (compiled=False) and runs in python mode only", where=f"law {law.name}")
    base = [law for law in package if law in used] if own else package
    return _compile(tuple(base + own), offsets)
