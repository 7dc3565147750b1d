"""Drift and kick: what Chipmunk calls for every body in every step, in some twenty instructions each.

They are written as LLVM instructions because the wrapper that numba puts around a callback costs as much
as the motion itself, and because a position or a velocity is one register of two floats here.

The pointers that they need stand in the place of a body's centre of gravity, which is zero for a disk:
its row of the state, and the numbers in ``MOTION``. Read as floats they are smaller than any length that
matters (1e-309).
"""

from __future__ import annotations

import functools
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pymunk
from llvmlite import ir
from numba.core.registry import cpu_target
from pymunk._chipmunk_cffi import ffi, lib

from .native import Offsets, offsets, write_slot

# columns of the state [SI]; one row is one cache line
STATE = ("x", "y", "vx", "vy", "fx", "fy", "near_x", "near_y")
# what drift and kick know besides: floats ...
MOTION = (
    "length_unit", "velocity_unit", "spin_unit", "force_scale", "torque_scale",
    # ... and whole numbers in the same array
    "left", "turning", "state", "spin", "torque", "far",
)  # fmt: skip

_FLOAT, _INT = ir.DoubleType(), ir.IntType(64)
_PAIR = ir.VectorType(_FLOAT, 2)


class _Writer:
    """A function in the writing, with loads and stores at byte offsets."""

    def __init__(self, module: ir.Module, name: str, arguments: list[Any]) -> None:
        function = ir.Function(module, ir.FunctionType(ir.VoidType(), [_INT, *arguments]), name)
        self.body, *self.arguments = function.args
        self.builder = ir.IRBuilder(function.append_basic_block())

    def at(self, base: Any, offset: int, kind: Any) -> Any:
        place = self.builder.add(base, ir.Constant(_INT, offset))
        return self.builder.inttoptr(place, kind.as_pointer())

    def load(self, base: Any, offset: int, kind: Any = _FLOAT) -> Any:
        value = self.builder.load(self.at(base, offset, kind))
        value.align = 8
        return value

    def store(self, value: Any, base: Any, offset: int) -> None:
        self.builder.store(value, self.at(base, offset, value.type)).align = 8

    def motion(self, name: str, kind: Any = _FLOAT) -> Any:
        return self.load(self.numbers, 8 * MOTION.index(name), kind)

    def both(self, a: Any, b: Any = None) -> Any:
        """Two floats in one register."""
        pair = self.builder.insert_element(ir.Constant(_PAIR, ir.Undefined), a, ir.Constant(_INT, 0))
        return self.builder.insert_element(pair, a if b is None else b, ir.Constant(_INT, 1))

    def slot(self, o: Offsets) -> None:
        self.row = self.load(self.body, o.center, _INT)
        self.numbers = self.load(self.body, o.center + 8, _INT)

    def place(self, array: str) -> Any:
        """Address of the body's element in an array of floats; a row of the state has 64 bytes."""
        b = self.builder
        way = b.lshr(b.sub(self.row, self.motion("state", _INT)), ir.Constant(_INT, 3))
        return b.add(self.motion(array, _INT), way)


def _column(name: str) -> int:
    return 8 * STATE.index(name)


def _write_drift(module: ir.Module, o: Offsets) -> None:
    """x += v dt; the state [SI] into its row, force zero; a mark where the body left its surroundings."""
    w = _Writer(module, "drift", [_FLOAT])
    b = w.builder
    (dt,) = w.arguments
    w.slot(o)
    velocity = w.load(w.body, o.velocity, _PAIR)
    position = b.fadd(w.load(w.body, o.position, _PAIR), b.fmul(velocity, w.both(dt)))
    spin = w.load(w.body, o.spin)
    w.store(position, w.body, o.position)
    w.store(position, w.body, o.transform)  # its rotation stays: a disk needs no sine and cosine
    w.store(b.fadd(w.load(w.body, o.angle), b.fmul(spin, dt)), w.body, o.angle)
    seen = b.fmul(position, w.both(w.motion("length_unit")))
    way = b.fsub(seen, w.load(w.row, _column("near_x"), _PAIR))
    w.store(seen, w.row, _column("x"))
    w.store(b.fmul(velocity, w.both(w.motion("velocity_unit"))), w.row, _column("vx"))
    w.store(ir.Constant(_PAIR, [0.0, 0.0]), w.row, _column("fx"))
    square = b.fmul(way, way)
    total = b.fadd(*(b.extract_element(square, ir.Constant(_INT, k)) for k in (0, 1)))
    # "not inside" rather than "outside": true for NaN too
    with b.if_then(b.fcmp_unordered(">", total, w.load(w.place("far"), 0)), likely=False):
        w.store(ir.Constant(_INT, 1), w.numbers, 8 * MOTION.index("left"))
    with b.if_then(b.icmp_unsigned("!=", w.motion("turning", _INT), ir.Constant(_INT, 0)), likely=False):
        w.store(b.fmul(spin, w.motion("spin_unit")), w.place("spin"), 0)
        w.store(ir.Constant(_FLOAT, 0.0), w.place("torque"), 0)
    b.ret_void()


def _write_kick(module: ir.Module, o: Offsets) -> None:
    """v = v damping + (gravity + f/m) dt as Chipmunk's own, f being the user's force and that of the laws."""
    # gravity is a cpVect by value: two doubles where such pairs pass in registers
    w = _Writer(module, "kick", [_FLOAT, _FLOAT, _FLOAT, _FLOAT])
    b = w.builder
    gravity_x, gravity_y, damping, dt = w.arguments
    w.slot(o)
    law = b.fmul(w.load(w.row, _column("fx"), _PAIR), w.both(w.motion("force_scale")))
    force = b.fadd(w.load(w.body, o.force, _PAIR), law)
    gain = b.fadd(w.both(gravity_x, gravity_y), b.fmul(force, w.both(w.load(w.body, o.inverse_mass))))
    velocity = b.fmul(w.load(w.body, o.velocity, _PAIR), w.both(damping))
    w.store(b.fadd(velocity, b.fmul(gain, w.both(dt))), w.body, o.velocity)
    w.store(ir.Constant(_PAIR, [0.0, 0.0]), w.body, o.force)
    own = w.load(w.body, o.torque)
    before = b.block
    with b.if_then(b.icmp_unsigned("!=", w.motion("turning", _INT), ir.Constant(_INT, 0)), likely=False):
        added = b.fadd(own, b.fmul(w.load(w.place("torque"), 0), w.motion("torque_scale")))
        inner = b.block
    torque = b.phi(_FLOAT)
    torque.add_incoming(own, before)
    torque.add_incoming(added, inner)
    gain = b.fmul(b.fmul(torque, w.load(w.body, o.inverse_moment)), dt)
    w.store(b.fadd(b.fmul(w.load(w.body, o.spin), damping), gain), w.body, o.spin)
    w.store(ir.Constant(_FLOAT, 0.0), w.body, o.torque)
    b.ret_void()


@functools.cache
def motion_functions() -> tuple[int, int | None, Any]:
    """Addresses of drift and kick (None where Chipmunk cannot call it), and what keeps them alive."""
    o = offsets()
    assert cpu_target.target_context is not None  # has LLVM set up
    module = ir.Module(name="granswim_motion")
    _write_drift(module, o)
    _write_kick(module, o)
    parsed = llvm.parse_assembly(str(module))
    parsed.verify()
    # no contraction of product and sum, as in all of the engine: LLVM does that only where it is told to
    machine = llvm.Target.from_default_triple().create_target_machine(opt=2)
    engine = llvm.create_mcjit_compiler(parsed, machine)
    engine.finalize_object()
    kick: int | None = engine.get_function_address("kick")
    assert kick is not None
    if not _kicks(kick, o):
        kick = None
    return engine.get_function_address("drift"), kick, engine


def _kicks(kick: int, o: Offsets) -> bool:
    """Try the kick on one body: does its gravity arrive?"""
    state, torque = np.zeros(8), np.zeros(1)
    state[STATE.index("fx")], state[STATE.index("fy")], torque[0] = 0.375, -0.625, 1.5
    numbers = motion_numbers({"force_scale": 2.0, "torque_scale": 4.0}, state, torque, torque, torque, True)
    space = pymunk.Space()
    space.gravity = (1.25, -2.5)
    body = pymunk.Body(0.5, 2.0)
    body.velocity = (10.0, 20.0)
    space.add(body)
    write_slot(body, o, state.ctypes.data, numbers.ctypes.data)
    lib.cpBodySetVelocityUpdateFunc(body._body, ffi.cast("cpBodyVelocityFunc", kick))
    space.step(0.5)
    return tuple(body.velocity) == (11.375, 17.5) and body.angular_velocity == 1.5


def motion_numbers(
    floats: dict[str, float], state: np.ndarray, spin: np.ndarray, torque: np.ndarray, far: np.ndarray, turning: bool
) -> np.ndarray:
    """The array behind ``MOTION``: floats, and whole numbers bit by bit. The caller keeps it and the arrays."""
    numbers = np.zeros(len(MOTION))
    for name, value in floats.items():
        numbers[MOTION.index(name)] = value
    whole = numbers.view(np.int64)
    for name, number in {
        "turning": int(turning), "state": state.ctypes.data, "spin": spin.ctypes.data, "torque": torque.ctypes.data,
        "far": far.ctypes.data,
    }.items():  # fmt: skip
        whole[MOTION.index(name)] = number
    return numbers


def make_state(n: int) -> np.ndarray:
    """(n, 8) zeros, a row to a cache line."""
    raw = np.zeros(8 * n + 8)
    first = -(raw.ctypes.data // 8) % 8
    return raw[first : first + 8 * n].reshape(n, 8)
