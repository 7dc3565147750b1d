"""Chipmunk's memory as compiled code sees it: field offsets found at run time, addresses, pointers.

``cpBody`` and ``cpConstraint`` are opaque to cffi, so the offsets of their fields are found once by
writing through the exported accessors and looking where the value landed.
"""

from __future__ import annotations

import ctypes
import functools
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
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
    transform: int
    kick: int  # the body's velocity function
    drift: int  # the body's position function
    user_data: int  # of cpConstraint
    body_a: int  # of cpArbiter
    body_b: int
    process_collision: int


_BODY_BYTES = 216  # what is known to lie inside cpBody
_CONSTRAINT_BYTES = 104
_SPACE_BYTES = 128


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

    mark = 0x5A5A1234ABCD
    lib.cpBodySetVelocityUpdateFunc(body._body, ffi.cast("cpBodyVelocityFunc", mark))
    kick = _find(memory, _BODY_BYTES, struct.pack("q", mark), "the velocity function")
    lib.cpBodySetPositionUpdateFunc(body._body, ffi.cast("cpBodyPositionFunc", mark + 64))
    drift = _find(memory, _BODY_BYTES, struct.pack("q", mark + 64), "the position function")

    constraint = pymunk.DampedSpring(pymunk.Body(1, 1), pymunk.Body(1, 1), (0, 0), (0, 0), 1, 0, 0)
    kept = lib.cpConstraintGetUserData(constraint._constraint)
    lib.cpConstraintSetUserData(constraint._constraint, ffi.cast("void *", mark))
    user_data = _find(
        ffi.cast("char *", constraint._constraint), _CONSTRAINT_BYTES, struct.pack("q", mark), "user data"
    )
    lib.cpConstraintSetUserData(constraint._constraint, kept)

    fields = dict(ffi.typeof("cpArbiter").fields)
    found = Offsets(
        position, velocity, force, angle, spin, torque, inverse_mass, inverse_moment, transform, kick, drift,
        user_data, fields["body_a"].offset, fields["body_b"].offset, fields["processCollision"].offset,
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


@functools.cache
def last_step_offset() -> int:
    """Byte offset in a cpSpace of the length of its last step. Raises ProbeError where it is not found."""
    space = pymunk.Space()
    memory = ffi.cast("char *", space._space)
    space.step(1.2345e-7)
    found = _find(memory, _SPACE_BYTES, struct.pack("d", 1.2345e-7), "the last step of a space")
    space.step(2.5e-3)
    if found != _find(memory, _SPACE_BYTES, struct.pack("d", 2.5e-3), "the last step of a space"):
        raise ProbeError("the last step of a space moves")
    return found


def address(pointer: Any) -> int:
    """Address of a cffi pointer."""
    return int(ffi.cast("intptr_t", pointer))


# ---- bodies in memory of our own ------------------------------------------------------------------

# A row of ROW floats holds two floats of ours and a cpBody. Rows begin where cache lines do, so the functions, the
# inverse mass and what is ours share one line, position, velocity and force the next.
LEAD = 2
ROW = 40


def _room_of(body: pymunk.Body) -> int:
    """Bytes that were allocated for a cpBody."""
    library = ctypes.CDLL(None)
    for name in ("malloc_usable_size", "malloc_size"):
        if hasattr(library, name):
            measure = getattr(library, name)
            measure.restype, measure.argtypes = ctypes.c_size_t, [ctypes.c_void_p]
            return int(measure(address(body._body)))
    raise ProbeError("the size of a body cannot be found here")


@functools.cache
def body_bytes() -> int:
    """How much of a fresh body to copy. Raises ProbeError where that is unknown or more than a row holds."""
    try:
        size = _room_of(pymunk.Body(1.0, 1.0))
    except (OSError, TypeError) as error:
        raise ProbeError(f"the size of a body cannot be found: {error}") from None
    if not _BODY_BYTES <= size <= 8 * (ROW - LEAD):
        raise ProbeError(f"a body takes {size} bytes")
    return size


def rows_of_bodies(n: int) -> np.ndarray:
    """(n, ROW) zeros, each row at the beginning of a cache line."""
    raw = np.zeros(ROW * n + 8)
    first = -(raw.ctypes.data // 8) % 8
    return raw[first : first + ROW * n].reshape(n, ROW)


def column(offset: int) -> int:
    """Column of a row where the field at this offset of a cpBody stands."""
    return LEAD + offset // 8


def settle_in(body: pymunk.Body, at: int, release: Callable[[Any], None]) -> None:
    """Move a body that is in no Space yet to address ``at``; ``release`` is called when it goes."""
    size = body_bytes()
    ffi.memmove(ffi.cast("char *", at), ffi.cast("char *", body._body), size)
    # what pymunk allocated goes with the handle that is replaced here
    body._body = ffi.gc(ffi.cast("cpBody *", at), release)


def releaser(memory: np.ndarray) -> Callable[[Any], None]:
    """What pymunk does when a body goes, but for freeing its memory: that goes with the last body."""

    def release(body: Any, memory: np.ndarray = memory) -> None:
        lib.cpBodyEachShape(body, lib.ext_cpBodyShapeIteratorFunc, ffi.NULL)
        lib.cpBodyEachConstraint(body, lib.ext_cpBodyConstraintIteratorFunc, ffi.NULL)
        space = lib.cpBodyGetSpace(body)
        if space != ffi.NULL:
            lib.cpSpaceRemoveBody(space, body)
        lib.cpBodyDestroy(body)

    return release


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
def lowest_bit(typingctx, word):
    """Number of the lowest bit that is set in an uint64, which must not be zero."""

    def generate(context, builder, signature, args):
        return builder.cttz(args[0], cgutils.true_bit)

    return types.uint64(types.uint64), generate


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
