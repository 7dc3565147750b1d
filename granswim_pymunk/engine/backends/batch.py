"""Stepping without native callbacks: forces through ``pymunk.batch``.

A force set before ``space.step`` would be evaluated at the old positions (explicit Euler, energy grows),
so it is evaluated at x + dt v, where the drift of this very step will put the bodies: exact leapfrog.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pymunk.batch
from pymunk.batch import BodyFields

from ...errors import BodyLost
from ..motion import Motion
from ..native import Offsets
from .base import Plan
from .compiled import Compiled

_READ = (
    BodyFields.BODY_ID | BodyFields.POSITION | BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY | BodyFields.ANGLE
    | BodyFields.FORCE | BodyFields.TORQUE
)  # fmt: skip


class Batch(Compiled):
    """Owner of the two buffers: one for getting, one for setting, both used again every step."""

    name: ClassVar[str] = "batch"

    def __init__(self, plan: Plan, offsets: Offsets | None = None, motion: Motion | None = None) -> None:
        """See ``Backend``; nothing native is used."""
        super().__init__(plan)
        self._out = pymunk.batch.Buffer()
        self._in = pymunk.batch.Buffer()

    def advance(self, steps: int) -> None:
        """Do that many steps. Raises SimulationError when a number is no longer finite."""
        b, u = self.state.bodies, self.units
        dt = self.dt / u.time
        space = self.world.space
        if not self.impulse:
            self.world.remove_shapes()
        rows_of_id = {body.id: k for k, body in enumerate(self.world.bodies)}
        x, y, vx, vy, angle, spin = (b.row(name) for name in ("x", "y", "vx", "vy", "angle", "spin"))
        for _ in range(steps):
            self._out.clear()
            pymunk.batch.get_space_bodies(space, _READ, self._out)
            # the order of rows is Chipmunk's own and changes when a body is removed
            ids = np.frombuffer(self._out.int_buf(), dtype=np.uintp)
            values = np.frombuffer(self._out.float_buf(), dtype=float).reshape(len(ids), 9)
            rows = np.array([rows_of_id.get(int(k), -1) for k in ids])
            # statics (walls) are among the rows; only mobile ones move
            ours = (rows >= 0) & (rows < self.order.n_mobile)
            at = rows[ours]
            x[at] = (values[ours, 0] + values[ours, 3] * dt) * u.length
            y[at] = (values[ours, 1] + values[ours, 4] * dt) * u.length
            angle[at] = values[ours, 2] + values[ours, 5] * dt
            vx[at] = values[ours, 3] * u.velocity
            vy[at] = values[ours, 4] * u.velocity
            spin[at] = values[ours, 5] / u.time
            if not np.isfinite(x).all() or not np.isfinite(y).all():
                raise BodyLost(f"a position is not finite after step {self.step} (t = {self.t:.6g} s)")
            self.array_forces(True, self.start_time + (self.step + 1) * self.dt, b.state, in_step=True)
            forces = values[:, 6:9].copy()  # what the user put on the bodies
            forces[ours, 0] += b.fx[at] * b.heavier[at] / u.force
            forces[ours, 1] += b.fy[at] * b.heavier[at] / u.force
            forces[ours, :2] *= b.ease[at, None]  # in the other modes the mass does that
            forces[ours, 2] += b.torque[at] / u.torque
            self._in.set_float_buf(np.ascontiguousarray(forces).reshape(-1))
            pymunk.batch.set_space_bodies(space, BodyFields.FORCE | BodyFields.TORQUE, self._in)
            space.step(dt)
            self.step += 1
