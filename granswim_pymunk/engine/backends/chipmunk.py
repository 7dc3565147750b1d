"""Chipmunk's broad and narrow phase each step, a compiled preSolve for each contact, ghosts at the seam."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from pymunk._chipmunk_cffi import ffi, lib

from ..callbacks import Kernel
from ..motion import MOTION, Motion
from ..native import Offsets, address
from ..world import point_ghost, row_table
from .base import Plan
from .native import Native


class Chipmunk(Native):
    """Contacts as Chipmunk finds them; their forces are kept and summed in a fixed order before the kick."""

    name: ClassVar[str] = "chipmunk"
    from_list: ClassVar[bool] = False
    reaches: ClassVar[bool] = False
    finds_contacts: ClassVar[bool] = True

    def __init__(self, plan: Plan, offsets: Offsets | None = None, motion: Motion | None = None) -> None:
        """See ``Backend``."""
        super().__init__(plan, offsets, motion)
        self.lay_out_seam()

    def step_function(self, kernel: Kernel) -> int:
        """Address of the constraint's preSolve that gives the forces of a step."""
        return int(kernel.contacts.chipmunk_step.address)

    def watch_contacts(self) -> tuple[Any, Any]:
        """Let Chipmunk report contacts; with impulses it solves them itself."""
        if self.impulse:
            return None, None
        handler = lib.cpSpaceAddGlobalCollisionHandler(self.world.space._space)
        before = handler.preSolveFunc
        handler.preSolveFunc = ffi.cast("cpCollisionPreSolveFunc", self.kernel.contacts.contact_presolve.address)
        handler.userData = ffi.cast("void *", self.context.values.ctypes.data)
        return handler, before

    def lay_out_seam(self, wrap: bool = True) -> None:
        """See ``Backend``; compiled code moves the ghosts and knows bodies by their addresses."""
        super().lay_out_seam(wrap)
        world, b, length = self.world, self.state.bodies, self.scene.periodic_x
        rows = {}
        for (ghost, _), k in zip(world.ghosts, world.originals, strict=True):
            period = (length or 0.0) / self.units.length
            point_ghost(ghost, world.bodies[k], period, self.offsets, self.kernel.contacts.ghost_position.address)
            rows[address(ghost._body)] = -k - 2
        strangers = b.bodies if b.memory is None else np.zeros(0, dtype=np.int64)
        lists = self.state.lists
        lists.table_keys, lists.table_values = row_table(rows, world.wall_body, strangers)
        self.refresh()
        if length:
            raw = self.raw()
            b.row("near_x")[:] = raw["x"] - b.images * length
            b.row("near_y")[:] = raw["y"]
            self.state.motion[MOTION.index("margin")] = self.state.numbers["margin"] ** 2

    def laid_out(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) x, y [m] at which the present ghosts were made."""
        return self.state.bodies.row("near_x"), self.state.bodies.row("near_y")

    def thaw(self, arrays: dict[str, np.ndarray], step: int, begun: bool) -> None:
        """See ``Backend``."""
        super().thaw(arrays, step, begun)
        # ghosts where bodies are; who is wrapped, and when next, stays as it was: wrapping rounds
        self.lay_out_seam(wrap=False)
        self.state.bodies.row("near_x")[:], self.state.bodies.row("near_y")[:] = arrays["laid_x"], arrays["laid_y"]
