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

from ..compiled import fetch


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
def space_offsets() -> tuple[int, int]:
    """Byte offsets in a cpSpace of the length of its last step and of its iterations. Raises ProbeError where unknown.

    The length is a float, the iterations are an int of 32 bits.
    """
    found: set[tuple[int, int]] = set()
    for dt, iterations in ((1.2345e-7, 0x5A5A123), (2.5e-3, 0x1B2C3D4)):
        space = pymunk.Space()
        memory = ffi.cast("char *", space._space)
        space.iterations = iterations
        at = _find(memory, _SPACE_BYTES, struct.pack("i", iterations), "the iterations of a space")
        space.iterations = 1
        space.step(dt)
        found.add((_find(memory, _SPACE_BYTES, struct.pack("d", dt), "the last step of a space"), at))
    if len(found) > 1:
        raise ProbeError("the fields of a space move")
    return found.pop()


def address(pointer: Any) -> int:
    """Address of a cffi pointer."""
    return int(ffi.cast("intptr_t", pointer))


# ---- bodies in memory of our own ------------------------------------------------------------------

# A row of ROW floats holds two floats of ours and a cpBody. Rows begin where cache lines do, so the functions, the
# inverse mass and what is ours share one line, position, velocity and force the next.
LEAD = 2
ROW = 40
# rows this far on are asked for while the laws go through the pairs: beyond a column of grains, within the first cache
LATER = 192


def _room_of(pointer: Any) -> int:
    """Bytes that Chipmunk allocated there."""
    library = ctypes.CDLL(None)
    for name in ("malloc_usable_size", "malloc_size"):
        if hasattr(library, name):
            measure = getattr(library, name)
            measure.restype, measure.argtypes = ctypes.c_size_t, [ctypes.c_void_p]
            return int(measure(address(pointer)))
    raise ProbeError("the size of what Chipmunk allocates cannot be found here")


@functools.cache
def body_bytes() -> int:
    """How much of a fresh body to copy. Raises ProbeError where that is unknown or more than a row holds."""
    try:
        size = _room_of(pymunk.Body(1.0, 1.0)._body)
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


def _store_int(bits):
    @intrinsic
    def store_int(typingctx, where, value):
        """Write the lowest bits of an int64 at an address."""

        def generate(context, builder, signature, args):
            kind = cgutils.ir.IntType(bits)
            builder.store(builder.trunc(args[1], kind), builder.inttoptr(args[0], kind.as_pointer()))
            return context.get_dummy_value()

        return types.void(types.int64, types.int64), generate

    return store_int


store_byte = _store_int(8)
store_int32 = _store_int(32)


@intrinsic
def lowest_bit(typingctx, word):
    """Number of the lowest bit that is set in an uint64, which must not be zero."""

    def generate(context, builder, signature, args):
        return builder.cttz(args[0], cgutils.true_bit)

    return types.uint64(types.uint64), generate


def _column(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    """Pointer to the first number of an array."""
    return context.make_array(kind)(context, builder, array).data


def _two(builder: Any, base: Any, at: Any) -> Any:
    """Pointer to two floats side by side, in one register."""
    pair = cgutils.ir.VectorType(cgutils.ir.DoubleType(), 2)
    return builder.bitcast(builder.gep(base, [at]), pair.as_pointer())


def _load(builder: Any, pointer: Any) -> Any:
    value = builder.load(pointer)
    value.align = 8
    return value


def _four_ways(shifts: bool) -> Any:
    @intrinsic
    def four_ways(typingctx, flat, x, near_i, near_j, near_shift, near_touch, k, work, at_x, at_y):
        """Four pairs of a list, from the k-th: which of them touch, as four bits; the ways from i to j to ``work``.

        Two at one place have no direction, and count as not touching.

        ``flat`` holds the rows of bodies, their place side by side from column ``x``.
        """

        def generate(context, builder, signature, args):
            ir = cgutils.ir
            kinds = signature.args
            flat, i, j, shift, touch, work = (_column(context, builder, kinds[a], args[a]) for a in (0, 2, 3, 4, 5, 7))
            x, k, at_x, at_y = (args[a] for a in (1, 6, 8, 9))
            number = ir.IntType(64)
            four = ir.VectorType(ir.DoubleType(), 4)

            def quad(base: Any, at: Any) -> Any:
                return builder.bitcast(builder.gep(base, [at]), four.as_pointer())

            def shuffled(a: Any, b: Any, *order: int) -> Any:
                return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), len(order)), order))

            ways = []
            for q in range(4):
                place = []
                for rows in (j, i):
                    row = builder.load(builder.gep(rows, [builder.add(k, ir.Constant(number, q))]))
                    place.append(_two(builder, flat, builder.add(builder.zext(row, number), x)))
                ways.append(builder.fsub(*(_load(builder, p) for p in place)))
                # what stands in later rows comes into the caches meanwhile
                later = builder.gep(place[1], [ir.Constant(number, ROW * LATER // 2)])
                fetch(builder, builder.bitcast(later, ir.IntType(8).as_pointer()))
            dx, dy = (
                shuffled(shuffled(ways[0], ways[1], c, 2 + c), shuffled(ways[2], ways[3], c, 2 + c), 0, 1, 2, 3)
                for c in (0, 1)
            )
            if shifts:
                dx = builder.fadd(dx, _load(builder, quad(shift, k)))
            reach = _load(builder, quad(touch, k))
            for value, at in ((dx, at_x), (dy, at_y)):
                builder.store(value, quad(work, at)).align = 8
            square = builder.fadd(builder.fmul(dx, dx), builder.fmul(dy, dy))
            near = builder.fcmp_ordered("<", square, builder.fmul(reach, reach))
            apart = builder.fcmp_ordered(">", square, ir.Constant(four, [0.0] * 4))
            near = builder.and_(near, apart)
            return builder.zext(builder.bitcast(near, ir.IntType(4)), number)

        count = types.uint64
        lists = (near_i, near_j, near_shift, near_touch)
        return count(flat, count, *lists, count, work, count, count), generate

    return four_ways


four_ways = _four_ways(False)  # where no pair has a shift
four_shifted_ways = _four_ways(True)


@intrinsic
def difference(typingctx, flat, i, j, work, at_x, at_y):
    """Two floats side by side at j less those at i, into two places of ``work``."""

    def generate(context, builder, signature, args):
        flat, work = (_column(context, builder, signature.args[a], args[a]) for a in (0, 3))
        there, here = (_load(builder, _two(builder, flat, at)) for at in (args[2], args[1]))
        apart = builder.fsub(there, here)
        for c, at in enumerate(args[4:]):
            value = builder.extract_element(apart, cgutils.ir.Constant(cgutils.ir.IntType(64), c))
            builder.store(value, builder.gep(work, [at]))
        return context.get_dummy_value()

    return types.void(flat, types.uint64, types.uint64, work, types.uint64, types.uint64), generate


def _pair_of(builder: Any, *values: Any) -> Any:
    """Two floats in one register."""
    ir = cgutils.ir
    pair = ir.Constant(ir.VectorType(ir.DoubleType(), 2), ir.Undefined)
    for c, value in enumerate(values):
        pair = builder.insert_element(pair, value, ir.Constant(ir.IntType(64), c))
    return pair


@intrinsic
def add_two(typingctx, flat, i, px, py):
    """Add (px, py) to two floats side by side at i.

    Rows of bodies are far apart: taken eight at a time, as LLVM would, each number of a row is gathered and scattered
    on its own, which is three times slower.
    """

    def generate(context, builder, signature, args):
        place = _two(builder, _column(context, builder, signature.args[0], args[0]), args[1])
        builder.store(builder.fadd(_load(builder, place), _pair_of(builder, *args[2:])), place).align = 8
        return context.get_dummy_value()

    return types.void(flat, types.uint64, types.float64, types.float64), generate


@intrinsic
def push_apart(typingctx, flat, i, j, px, py):
    """Add (px, py) to two floats side by side at j, and take it from those at i."""

    def generate(context, builder, signature, args):
        flat = _column(context, builder, signature.args[0], args[0])
        force = _pair_of(builder, *args[3:])
        for at, change in ((args[2], builder.fadd), (args[1], builder.fsub)):
            place = _two(builder, flat, at)
            builder.store(change(_load(builder, place), force), place).align = 8
        return context.get_dummy_value()

    return types.void(flat, types.uint64, types.uint64, types.float64, types.float64), generate


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


def _calls(kinds: tuple[Any, ...]) -> Any:
    """Code that calls a function without a result at a run-time address, its arguments of these numba types."""

    def generate(context, builder, signature, args):
        ir = cgutils.ir
        kind = ir.FunctionType(ir.VoidType(), [context.get_value_type(k) for k in kinds])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value()

    return types.void(types.int64, *kinds), generate


_I, _F = types.int64, types.float64


@intrinsic
def call_block(typingctx, function, where, u, b, t, dt, twice, fresh):
    """What the use u of a law adds to block b of bodies; ``where``: the context."""
    return _calls((_I, _I, _I, _F, _F, _I, _F))


@intrinsic
def call_one(typingctx, function, where, u, i, j, t):
    """What the use u of a pair law does to one pair."""
    return _calls((_I, _I, _I, _I, _F))


@intrinsic
def call_wall(typingctx, function, where, u, i, k, t, d, gap, vn, vt, nx, ny):
    """What the use u of a law of contact does to body i at straight wall k."""
    return _calls((_I, _I, _I, _I, _F, _F, _F, _F, _F, _F, _F))


@intrinsic
def call_walls(typingctx, function, where, begin, end, t, dt):
    """The forces of straight walls, in meetings from ``begin`` to ``end``."""
    return _calls((_I, _I, _I, _F, _F))


@intrinsic
def call_links(typingctx, function, where, dt):
    """The forces of hinges and rods."""
    return _calls((_I, _F))


@intrinsic
def call_lists(typingctx, function, where):
    """The lists of near pairs anew."""
    return _calls((_I,))
