"""Chipmunk's memory as compiled code sees it: field offsets found at run time, addresses, pointers.

``cpBody`` and ``cpConstraint`` are opaque to cffi, so the offsets of their fields are found once by
writing through the exported accessors and looking where the value landed.
"""

from __future__ import annotations

import ctypes
import functools
import struct
from dataclasses import dataclass
from typing import Any

import pymunk
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from pymunk._chipmunk_cffi import ffi, lib


class ProbeError(RuntimeError):
    """The layout of Chipmunk's structures could not be found: compiled callbacks cannot be installed."""


@dataclass(frozen=True)
class Offsets:
    """Byte offsets of the fields that the compiled callbacks touch."""

    position: int
    velocity: int
    force: int
    angle: int
    spin: int
    torque: int
    inverse_mass: int
    inverse_moment: int
    center: int  # the centre of gravity, zero for a disk
    transform: int
    user_data: int  # of cpConstraint
    body_a: int  # of cpArbiter
    body_b: int
    process_collision: int


_BODY_BYTES = 216  # what is known to lie inside cpBody
_CONSTRAINT_BYTES = 104


def _find(memory: Any, size: int, value: bytes, what: str, *, skip: tuple[int, ...] = ()) -> int:
    raw = bytes(ffi.buffer(memory, size))
    at = [k for k in range(0, size - len(value) + 1, 8) if raw[k : k + len(value)] == value and k not in skip]
    if not at:
        raise ProbeError(f"the field for {what} was not found")
    return at[0]


@functools.cache
def offsets() -> Offsets:
    """Find the offsets, and check them on a second body. Raises ProbeError where that fails."""
    body = pymunk.Body(3.0, 7.0)
    memory = ffi.cast("char *", body._body)
    inverse_mass = _find(memory, _BODY_BYTES, struct.pack("d", 1.0 / 3.0), "the inverse mass")
    inverse_moment = _find(memory, _BODY_BYTES, struct.pack("d", 1.0 / 7.0), "the inverse moment of inertia")
    body.position = (1.2345e11, -6.789e7)
    position = _find(memory, _BODY_BYTES, struct.pack("dd", 1.2345e11, -6.789e7), "the position")
    transform = _find(
        memory, _BODY_BYTES, struct.pack("dd", 1.2345e11, -6.789e7), "the transform", skip=(position,)
    )
    body.velocity = (2.25e9, -3.5e9)
    velocity = _find(memory, _BODY_BYTES, struct.pack("dd", 2.25e9, -3.5e9), "the velocity")
    body.force = (4.125e9, -5.5e9)
    force = _find(memory, _BODY_BYTES, struct.pack("dd", 4.125e9, -5.5e9), "the force")
    body.angle = 6.0625e3
    angle = _find(memory, _BODY_BYTES, struct.pack("d", 6.0625e3), "the angle")
    body.angular_velocity = 7.03125e5
    spin = _find(memory, _BODY_BYTES, struct.pack("d", 7.03125e5), "the angular velocity")
    body.torque = 8.015625e7
    torque = _find(memory, _BODY_BYTES, struct.pack("d", 8.015625e7), "the torque")

    body.center_of_gravity = (3.0625e7, -9.25e8)
    center = _find(memory, _BODY_BYTES, struct.pack("dd", 3.0625e7, -9.25e8), "the centre of gravity")

    constraint = pymunk.DampedSpring(pymunk.Body(1, 1), pymunk.Body(1, 1), (0, 0), (0, 0), 1, 0, 0)
    kept = lib.cpConstraintGetUserData(constraint._constraint)
    mark = 0x5A5A1234ABCD
    lib.cpConstraintSetUserData(constraint._constraint, ffi.cast("void *", mark))
    user_data = _find(
        ffi.cast("char *", constraint._constraint), _CONSTRAINT_BYTES, struct.pack("q", mark), "user data"
    )
    lib.cpConstraintSetUserData(constraint._constraint, kept)

    fields = dict(ffi.typeof("cpArbiter").fields)
    found = Offsets(
        position, velocity, force, angle, spin, torque, inverse_mass, inverse_moment, center, transform, user_data,
        fields["body_a"].offset, fields["body_b"].offset, fields["processCollision"].offset,
    )  # fmt: skip

    other = pymunk.Body(1.0, 1.0)
    base = int(ffi.cast("intptr_t", other._body))
    # the accessor of the position reads it from the transform
    ctypes.c_double.from_address(base + found.transform + 8).value = 0.5
    ctypes.c_double.from_address(base + found.velocity).value = 0.25
    ctypes.c_double.from_address(base + found.force).value = 0.125
    ctypes.c_double.from_address(base + found.spin).value = 0.0625
    if (other.position.y, other.velocity.x, other.force.x, other.angular_velocity) != (0.5, 0.25, 0.125, 0.0625):
        raise ProbeError("a second body does not have the layout of the first")
    return found


@functools.cache
def step_address() -> int:
    """Address of the real ``cpSpaceStep`` (cffi's own symbol is a trampoline)."""
    try:
        library = ctypes.CDLL(pymunk._chipmunk.__file__)  # type: ignore[attr-defined]
        return int(ctypes.cast(library.cpSpaceStep, ctypes.c_void_p).value or 0)
    except (OSError, AttributeError) as error:
        raise ProbeError(f"cpSpaceStep is not exported: {error}") from None


def address(pointer: Any) -> int:
    """Address of a cffi pointer."""
    return int(ffi.cast("intptr_t", pointer))


def write_slot(body: pymunk.Body, o: Offsets, first: int, second: int) -> None:
    """Put two addresses where the body's centre of gravity stands (see ``motion``)."""
    slot = ffi.cast("int64_t *", address(body._body) + o.center)
    slot[0], slot[1] = first, second


# ---- what compiled code uses --------------------------------------------------------------------


@intrinsic
def load_float(typingctx, where):
    """The float64 at an address."""

    def generate(context, builder, signature, args):
        pointer = builder.inttoptr(args[0], cgutils.ir.DoubleType().as_pointer())
        return builder.load(pointer)

    return types.float64(types.int64), generate


@intrinsic
def store_float(typingctx, where, value):
    """Write a float64 at an address."""

    def generate(context, builder, signature, args):
        pointer = builder.inttoptr(args[0], cgutils.ir.DoubleType().as_pointer())
        builder.store(args[1], pointer)
        return context.get_dummy_value()

    return types.void(types.int64, types.float64), generate


@intrinsic
def load_int(typingctx, where):
    """The int64 at an address."""

    def generate(context, builder, signature, args):
        pointer = builder.inttoptr(args[0], cgutils.ir.IntType(64).as_pointer())
        return builder.load(pointer)

    return types.int64(types.int64), generate


@intrinsic
def store_byte(typingctx, where, value):
    """Write one byte at an address."""

    def generate(context, builder, signature, args):
        pointer = builder.inttoptr(args[0], cgutils.ir.IntType(8).as_pointer())
        builder.store(builder.trunc(args[1], cgutils.ir.IntType(8)), pointer)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), generate


@intrinsic
def pointer_to(typingctx, where):
    """An address as a void pointer, for ``numba.carray``."""

    def generate(context, builder, signature, args):
        return builder.inttoptr(args[0], cgutils.voidptr_t)

    return types.voidptr(types.int64), generate


@intrinsic
def call_step(typingctx, function, space, dt):
    """Call ``cpSpaceStep(space, dt)`` at a run-time address, without Python in between."""

    def generate(context, builder, signature, args):
        ir = cgutils.ir
        kind = ir.FunctionType(ir.VoidType(), [ir.IntType(8).as_pointer(), ir.DoubleType()])
        target = builder.inttoptr(args[0], kind.as_pointer())
        builder.call(target, [builder.inttoptr(args[1], ir.IntType(8).as_pointer()), args[2]])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.float64), generate
