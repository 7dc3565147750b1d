"""Compiled loops around ``cpSpaceStep``: no Python between steps, and the GIL is released."""

from __future__ import annotations

from ..compiled import njit
from .native import call_step, load_float, store_float


@njit(cache=True, nogil=True)
def advance(step_address, space, dt, steps, ints, status, crossed):
    """Step until done, an error, or a crossed margin; return the number of steps done."""
    for k in range(steps):
        call_step(step_address, space, dt)
        if ints[status] != 0 or ints[crossed] != 0:
            return k + 1
    return steps


@njit(cache=True, nogil=True)
def read_rows(addresses, position_offset, velocity_offset, length_unit, velocity_unit, ahead, out):
    """Positions [m] of some bodies, ``ahead`` seconds into the coming drift, into ``out`` (k, 2)."""
    for k in range(addresses.shape[0]):
        at = addresses[k]
        out[k, 0] = (
            load_float(at + position_offset) * length_unit + load_float(at + velocity_offset) * velocity_unit * ahead
        )
        out[k, 1] = (
            load_float(at + position_offset + 8) * length_unit
            + load_float(at + velocity_offset + 8) * velocity_unit * ahead
        )


@njit(cache=True, nogil=True)
def advance_and_sample(
    step_address, space, dt, first, step, until, ahead, ints, status, crossed, addresses, shift, position_offset,
    velocity_offset, length_unit, velocity_unit, out,
):  # fmt: skip
    """Sample positions after given numbers of steps. Returns (next sample, steps done so far)."""
    for s in range(first, until.shape[0]):
        while step < until[s]:
            call_step(step_address, space, dt)
            step += 1
            if ints[status] != 0 or ints[crossed] != 0:
                return s, step
        read_rows(addresses, position_offset, velocity_offset, length_unit, velocity_unit, ahead[s], out[s])
        for k in range(addresses.shape[0]):
            out[s, k, 0] += shift[k]
    return until.shape[0], step


@njit(cache=True, nogil=True)
def read_fields(addresses, field_offsets, out):
    """Fields of all bodies, as Chipmunk has them, into ``out`` (fields, n)."""
    for k in range(addresses.shape[0]):
        for f in range(field_offsets.shape[0]):
            out[f, k] = load_float(addresses[k] + field_offsets[f])


@njit(cache=True, nogil=True)
def write_fields(addresses, field_offsets, values):
    """The counterpart of ``read_fields``: ``values`` (fields, n)."""
    for k in range(addresses.shape[0]):
        for f in range(field_offsets.shape[0]):
            store_float(addresses[k] + field_offsets[f], values[f, k])


@njit(cache=True, nogil=True)
def take(memory, n_mobile, force, torque, spin, push):
    """Forces and torques that stand in rows of bodies, into ``push`` (n, 3). Returns (one turns, one is pushed)."""
    turns = False
    pushed = False
    for i in range(n_mobile):
        fx = memory[i, force]
        fy = memory[i, force + 1]
        moment = memory[i, torque]
        push[i, 0] = fx
        push[i, 1] = fy
        push[i, 2] = moment
        if moment != 0.0 or memory[i, spin] != 0.0:
            turns = True
        if fx != 0.0 or fy != 0.0 or moment != 0.0:
            pushed = True
    return turns, pushed


@njit(cache=True, nogil=True)
def settle(memory, n_mobile, force, torque, position, transform, fx, fy, moment):
    """The counterpart: forces of the last step out of the rows, and the place where Chipmunk shows it."""
    for i in range(n_mobile):
        fx[i] = memory[i, force]
        fy[i] = memory[i, force + 1]
        moment[i] = memory[i, torque]
        memory[i, force] = 0.0
        memory[i, force + 1] = 0.0
        memory[i, torque] = 0.0
        memory[i, transform] = memory[i, position]
        memory[i, transform + 1] = memory[i, position + 1]
