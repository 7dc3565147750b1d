"""Drift and kick: what Chipmunk calls for every body in every step, in some ten to twenty instructions each.

They are written as LLVM instructions because the wrapper that numba puts around a callback costs more than
the motion itself, and because a position or a velocity is one register of two floats here.

Two kinds. "In place": bodies are in SI and the laws read and write Chipmunk's own memory, so drift and kick
are v dt and f dt/m and no more. "Apart": bodies are in engine units (where Chipmunk finds the contacts), the
laws have rows of their own, and the drift fills them. What they need besides stands in front of each body,
in the memory that the package puts it into (``native.rows_of_bodies``).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pymunk
from llvmlite import ir
from numba.core.registry import cpu_target
from pymunk._chipmunk_cffi import ffi, lib

from ..compiled import fetch
from .native import LEAD, ROW, Offsets, column, offsets, releaser, rows_of_bodies, settle_in

# in front of each body: in place, the speed it may reach before the neighbour list is renewed, squared
# [m2/s2]; apart, the address of its row. Then the address of the numbers in MOTION
LIMIT = 0
OWN_ROW = 0
NUMBERS = 1
# what drift and kick know besides: floats ...
MOTION = (
    "length_unit", "velocity_unit", "spin_unit", "force_scale", "torque_scale", "margin",
    # ... and a whole number in the same array
    "left",
)  # fmt: skip

# Chipmunk takes the bodies one after the other: while one moves, the rows so many bodies on come into the caches
AHEAD = 40

_FLOAT, _INT = ir.DoubleType(), ir.IntType(64)
_PAIR = ir.VectorType(_FLOAT, 2)
_NOTHING = ir.Constant(_PAIR, [0.0, 0.0])


@functools.cache
def columns(o: Offsets | None) -> dict[str, int]:
    """Columns of a row as the laws see it: x, y, vx, vy, fx, fy, spin, torque, and where a list was made."""
    if o is None:  # nothing native: any will do
        names = ("near_x", "near_y", "x", "y", "vx", "vy", "fx", "fy", "spin", "torque", "angle")
        return {name: 8 + k for k, name in enumerate(names)}
    result: dict[str, int] = {}
    for name, offset in (("x", o.position), ("vx", o.velocity), ("fx", o.force)):
        result[name] = column(offset)
        result[name.replace("x", "y")] = column(offset) + 1
    result["spin"], result["torque"], result["angle"] = column(o.spin), column(o.torque), column(o.angle)
    # in rows apart from the bodies only, so any that are free; if they can, beside x
    taken = set(result.values())
    free = [k for k in range(2, 16) if k not in taken]
    result["near_y"], result["near_x"] = free[-1], free[-2]
    return result


class _Writer:
    """A function in the writing, with loads and stores at byte offsets."""

    def __init__(self, module: ir.Module, name: str, arguments: list[Any]) -> None:
        function = ir.Function(module, ir.FunctionType(ir.VoidType(), [_INT, *arguments]), name)
        self.body, *self.arguments = function.args
        self.builder = ir.IRBuilder(function.append_basic_block())
        self.fetch_later(self.body, 0, 64)

    def at(self, base: Any, offset: int, kind: Any) -> Any:
        place = self.builder.add(base, ir.Constant(_INT, offset))
        return self.builder.inttoptr(place, kind.as_pointer())

    def load(self, base: Any, offset: int, kind: Any = _FLOAT) -> Any:
        value = self.builder.load(self.at(base, offset, kind))
        value.align = 8
        return value

    def store(self, value: Any, base: Any, offset: int) -> None:
        self.builder.store(value, self.at(base, offset, value.type)).align = 8

    def slot(self, which: int, kind: Any = _INT) -> Any:
        """What stands in front of the body."""
        return self.load(self.body, 8 * (which - LEAD), kind)

    def fetch_later(self, row: Any, *lines: int) -> None:
        for line in lines:
            fetch(self.builder, self.at(row, 8 * ROW * AHEAD + line, ir.IntType(8)))

    def own_row(self) -> Any:
        row = self.slot(OWN_ROW)
        self.fetch_later(row, 64, 128)
        return row

    def motion(self, name: str) -> Any:
        return self.load(self.slot(NUMBERS), 8 * MOTION.index(name))

    def mark_left(self) -> None:
        self.store(ir.Constant(_INT, 1), self.slot(NUMBERS), 8 * MOTION.index("left"))

    def both(self, a: Any, b: Any = None) -> Any:
        """Two floats in one register."""
        pair = self.builder.insert_element(ir.Constant(_PAIR, ir.Undefined), a, ir.Constant(_INT, 0))
        return self.builder.insert_element(pair, a if b is None else b, ir.Constant(_INT, 1))

    def square(self, pair: Any) -> Any:
        b = self.builder
        product = b.fmul(pair, pair)
        return b.fadd(*(b.extract_element(product, ir.Constant(_INT, k)) for k in (0, 1)))


def _drift_in_place(module: ir.Module, o: Offsets, turning: bool) -> None:
    """x += v dt, force zero; a mark where the body is faster than its neighbour list allows."""
    w = _Writer(module, "drift_turning" if turning else "drift", [_FLOAT])
    b = w.builder
    (dt,) = w.arguments
    velocity = w.load(w.body, o.velocity, _PAIR)
    w.store(b.fadd(w.load(w.body, o.position, _PAIR), b.fmul(velocity, w.both(dt))), w.body, o.position)
    w.store(_NOTHING, w.body, o.force)
    if turning:
        w.store(b.fadd(w.load(w.body, o.angle), b.fmul(w.load(w.body, o.spin), dt)), w.body, o.angle)
        w.store(ir.Constant(_FLOAT, 0.0), w.body, o.torque)
    # "not below" rather than "above": true for NaN too
    with b.if_then(b.fcmp_unordered(">", w.square(velocity), w.slot(LIMIT, _FLOAT)), likely=False):
        w.mark_left()
    b.ret_void()


def _kick_in_place(module: ir.Module, o: Offsets, turning: bool) -> None:
    """v = v damping + (gravity + f/m) dt as Chipmunk's own; the force stays until the next drift."""
    # gravity is a cpVect by value: two doubles where such pairs pass in registers
    w = _Writer(module, "kick_turning" if turning else "kick", [_FLOAT, _FLOAT, _FLOAT, _FLOAT])
    b = w.builder
    gravity_x, gravity_y, damping, dt = w.arguments
    force = b.fmul(w.load(w.body, o.force, _PAIR), w.both(w.load(w.body, o.inverse_mass)))
    gain = b.fadd(w.both(gravity_x, gravity_y), force)
    velocity = b.fmul(w.load(w.body, o.velocity, _PAIR), w.both(damping))
    w.store(b.fadd(velocity, b.fmul(gain, w.both(dt))), w.body, o.velocity)
    if turning:
        gain = b.fmul(b.fmul(w.load(w.body, o.torque), w.load(w.body, o.inverse_moment)), dt)
        w.store(b.fadd(b.fmul(w.load(w.body, o.spin), damping), gain), w.body, o.spin)
    b.ret_void()


def _drift_apart(module: ir.Module, o: Offsets) -> None:
    """x += v dt; the state [SI] into its row, force zero; a mark where the body left its surroundings."""
    w = _Writer(module, "drift_apart", [_FLOAT])
    b = w.builder
    (dt,) = w.arguments
    row = w.own_row()
    at = {name: 8 * k for name, k in columns(o).items()}
    velocity = w.load(w.body, o.velocity, _PAIR)
    position = b.fadd(w.load(w.body, o.position, _PAIR), b.fmul(velocity, w.both(dt)))
    spin = w.load(w.body, o.spin)
    w.store(position, w.body, o.position)
    w.store(position, w.body, o.transform)  # its rotation stays: a disk needs no sine and cosine
    angle = b.fadd(w.load(w.body, o.angle), b.fmul(spin, dt))
    w.store(angle, w.body, o.angle)
    w.store(angle, row, at["angle"])
    seen = b.fmul(position, w.both(w.motion("length_unit")))
    way = b.fsub(seen, w.load(row, at["near_x"], _PAIR))
    w.store(seen, row, at["x"])
    w.store(b.fmul(velocity, w.both(w.motion("velocity_unit"))), row, at["vx"])
    w.store(_NOTHING, row, at["fx"])
    w.store(b.fmul(spin, w.motion("spin_unit")), row, at["spin"])
    w.store(ir.Constant(_FLOAT, 0.0), row, at["torque"])
    with b.if_then(b.fcmp_unordered(">", w.square(way), w.motion("margin")), likely=False):
        w.mark_left()
    b.ret_void()


def _kick_apart(module: ir.Module, o: Offsets) -> None:
    """v = v damping + (gravity + f/m) dt as Chipmunk's own, f being the user's force and that of the laws."""
    w = _Writer(module, "kick_apart", [_FLOAT, _FLOAT, _FLOAT, _FLOAT])
    b = w.builder
    gravity_x, gravity_y, damping, dt = w.arguments
    row = w.own_row()
    at = {name: 8 * k for name, k in columns(o).items()}
    law = b.fmul(w.load(row, at["fx"], _PAIR), w.both(w.motion("force_scale")))
    force = b.fadd(w.load(w.body, o.force, _PAIR), law)
    gain = b.fadd(w.both(gravity_x, gravity_y), b.fmul(force, w.both(w.load(w.body, o.inverse_mass))))
    velocity = b.fmul(w.load(w.body, o.velocity, _PAIR), w.both(damping))
    w.store(b.fadd(velocity, b.fmul(gain, w.both(dt))), w.body, o.velocity)
    w.store(_NOTHING, w.body, o.force)
    torque = b.fadd(w.load(w.body, o.torque), b.fmul(w.load(row, at["torque"]), w.motion("torque_scale")))
    gain = b.fmul(b.fmul(torque, w.load(w.body, o.inverse_moment)), dt)
    w.store(b.fadd(b.fmul(w.load(w.body, o.spin), damping), gain), w.body, o.spin)
    w.store(ir.Constant(_FLOAT, 0.0), w.body, o.torque)
    b.ret_void()


@dataclass(frozen=True)
class Motion:
    """Addresses of the compiled functions; ``kicks``: Chipmunk can call the kicks on this machine."""

    drift: int
    drift_turning: int
    drift_apart: int
    kick: int
    kick_turning: int
    kick_apart: int
    kicks: bool
    engine: Any  # keeps the code


@functools.cache
def motion_functions() -> Motion:
    """Compile drifts and kicks, and try a kick. Raises ProbeError where bodies cannot be put into own memory."""
    o = offsets()
    assert cpu_target.target_context is not None  # has LLVM set up
    module = ir.Module(name="granswim_motion")
    for turning in (False, True):
        _drift_in_place(module, o, turning)
        _kick_in_place(module, o, turning)
    _drift_apart(module, o)
    _kick_apart(module, o)
    parsed = llvm.parse_assembly(str(module))
    parsed.verify()
    # no contraction of product and sum, as in all of the engine: LLVM does that only where it is told to
    machine = llvm.Target.from_default_triple().create_target_machine(opt=2)
    engine = llvm.create_mcjit_compiler(parsed, machine)
    engine.finalize_object()
    names = ("drift", "drift_turning", "drift_apart", "kick", "kick_turning", "kick_apart")
    found = {name: engine.get_function_address(name) for name in names}
    return Motion(**found, kicks=_kicks(found["kick_turning"], o), engine=engine)


def _kicks(kick: int, o: Offsets) -> bool:
    """Try the kick on one body: does its gravity arrive?"""
    memory = rows_of_bodies(1)
    space = pymunk.Space()
    space.gravity = (1.25, -2.5)
    body = pymunk.Body(0.5, 2.0)
    settle_in(body, memory[0, LEAD:].ctypes.data, releaser(memory))
    body.velocity = (10.0, 20.0)
    space.add(body)
    body.force, body.torque = (0.75, -1.25), 6.0
    lib.cpBodySetVelocityUpdateFunc(body._body, ffi.cast("cpBodyVelocityFunc", kick))
    space.step(0.5)
    return tuple(body.velocity) == (11.375, 17.5) and body.angular_velocity == 1.5


def motion_numbers(floats: dict[str, float]) -> np.ndarray:
    """The array behind ``MOTION``."""
    numbers = np.zeros(len(MOTION))
    for name, value in floats.items():
        numbers[MOTION.index(name)] = value
    return numbers
