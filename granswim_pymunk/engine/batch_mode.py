"""Stepping without native callbacks: forces through ``pymunk.batch``.

A force set before ``space.step`` would be evaluated at the old positions (explicit Euler, energy grows),
so it is evaluated at x + dt v, where the drift of this very step will put the bodies: exact leapfrog.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pymunk.batch
from pymunk.batch import BodyFields

from ..errors import SimulationError

if TYPE_CHECKING:
    from .simulation import Simulation


class BatchStepper:
    """Owner of the two buffers: one for getting, one for setting, both used again every step."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self._out = pymunk.batch.Buffer()
        self._in = pymunk.batch.Buffer()

    def advance(self, steps: int) -> None:
        """Do that many steps. Raises SimulationError when a number is no longer finite."""
        s = self.simulation
        a = s._a
        u = s.units
        space = s._space
        if not s.impulse:
            s._remove_shapes()
        n_mobile = s._n_mobile
        kinds = BodyFields.BODY_ID | BodyFields.POSITION | BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY
        kinds |= BodyFields.ANGLE
        kinds |= BodyFields.FORCE | BodyFields.TORQUE
        rows_of_id = {body.id: k for k, body in enumerate(s._bodies)}
        for _ in range(steps):
            self._out.clear()
            pymunk.batch.get_space_bodies(space, kinds, self._out)
            # the order of rows is Chipmunk's own and changes when a body is removed
            ids = np.frombuffer(self._out.int_buf(), dtype=np.uintp)
            values = np.frombuffer(self._out.float_buf(), dtype=float).reshape(len(ids), 9)
            rows = np.array([rows_of_id.get(int(k), -1) for k in ids])
            # statics (walls) are among the rows; only mobile ones move
            ours = (rows >= 0) & (rows < n_mobile)
            at = rows[ours]
            a["x"][at] = (values[ours, 0] + values[ours, 3] * (s.dt / u.time)) * u.length
            a["y"][at] = (values[ours, 1] + values[ours, 4] * (s.dt / u.time)) * u.length
            a["angle"][at] = values[ours, 2] + values[ours, 5] * (s.dt / u.time)
            a["vx"][at] = values[ours, 3] * u.velocity
            a["vy"][at] = values[ours, 4] * u.velocity
            a["spin"][at] = values[ours, 5] / u.time
            if not np.isfinite(a["x"]).all() or not np.isfinite(a["y"]).all():
                raise SimulationError(f"a position is not finite after step {s.step} (t = {s.t:.6g} s)")
            s._array_forces(True, s.scene.time.start + (s.step + 1) * s.dt, a["state"], in_step=True)
            forces = values[:, 6:9].copy()  # what the user put on the bodies
            forces[ours, 0] += a["fx"][at] / u.force
            forces[ours, 1] += a["fy"][at] / u.force
            forces[ours, :2] *= s._ease[at, None]  # in the other modes the mass does that
            forces[ours, 2] += a["torque"][at] / u.torque
            self._in.set_float_buf(np.ascontiguousarray(forces).reshape(-1))
            pymunk.batch.set_space_bodies(space, BodyFields.FORCE | BodyFields.TORQUE, self._in)
            space.step(s.dt / u.time)
            s.step += 1
