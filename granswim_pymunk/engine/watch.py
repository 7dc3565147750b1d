"""A watch on a run: it stops a simulation that has gone wrong, and says which grain, when and why."""

from __future__ import annotations

import numpy as np

from ..errors import SimulationError
from .simulation import Simulation

OVERLAP = 0.02  # of the smaller radius, between the hard grains of a bed
THROUGH = 0.5  # in a scene without grains, whose bodies may be as soft as one likes
JUMP = 1000.0  # of the largest kinetic energy of a single body so far
SETTLING = 10  # looks before that energy is known


class Watch:
    """Looks at a simulation between blocks of steps.

    Parameters
    ----------
    simulation : what is watched
    overlap : largest overlap of two bodies, as a part of the smaller radius; None: 0.02 in a scene with grains, 0.5
        in one without; inf: any. Bodies that overlap more when the watch begins may go on until they have come apart

    ``look`` raises SimulationError where a position or velocity is not finite, two bodies overlap more than that, a
    grain or swimmer of a bed is outside its walls, or a body's kinetic energy is a thousand times all seen before.
    """

    def __init__(self, simulation: Simulation, overlap: float | None = None) -> None:
        self.simulation = simulation
        scene = simulation.scene
        if overlap is None:
            overlap = OVERLAP if any(b.role == "grain" for b in scene.bodies) else THROUGH
        self.overlap = overlap
        self._ids = scene.ids
        self._mobile = np.array([b.mobile for b in scene.bodies], dtype=bool)
        self._mass = np.array([b.mass if b.mobile else 0.0 for b in scene.bodies])
        self._radius = np.array([b.radius for b in scene.bodies])
        self._looks = 0
        self._most = 0.0
        self._excused: set[tuple[int, int]] = set()
        self._box = self._find_box()
        if overlap < np.inf:
            i, j, part = simulation.overlaps()
            late = part > overlap
            self._excused = set(zip(i[late].tolist(), j[late].tolist(), strict=True))

    def _find_box(self) -> tuple[float, float, float, float] | None:
        """Bounds of the centres of a bed's bodies [m]: x_low, x_high, y_low, y_high."""
        scene = self.simulation.scene
        grains = [b for b in scene.bodies if b.role == "grain"]
        walls = [b for b in scene.bodies if not b.mobile]
        if not grains or not walls:
            return None
        bounds = []
        for k in range(2):
            at = [b.initial[k] for b in walls if b.initial is not None]
            held = [b.initial[k] for b in scene.bodies if b.mobile and b.initial is not None]
            closed = min(at) <= min(held) and max(held) <= max(at) and not (k == 0 and scene.periodic_x)
            bounds += [min(at), max(at)] if closed else [-np.inf, np.inf]
        return bounds[0], bounds[1], bounds[2], bounds[3]

    def _stop(self, row: int, why: str) -> None:
        s = self.simulation
        raise SimulationError(
            f"body {self._ids[row]} {why} after step {s.step} (t = {s.t:.6g} s, dt = {s.dt:.3g} s); "
            "a smaller dt may help"
        )

    def look(self) -> None:
        """Raise SimulationError where something has gone wrong."""
        s = self.simulation
        raw = s.raw()
        xy = np.column_stack([raw["x"], raw["y"]])
        v = np.column_stack([raw["vx"], raw["vy"]])
        lost = ~(np.isfinite(xy).all(axis=1) & np.isfinite(v).all(axis=1))
        if lost.any():
            self._stop(int(np.flatnonzero(lost)[0]), "has a position or velocity that is not finite")
        if self._box is not None:
            low_x, high_x, low_y, high_y = self._box
            out = (xy[:, 0] < low_x) | (xy[:, 0] > high_x) | (xy[:, 1] < low_y) | (xy[:, 1] > high_y)
            out &= self._mobile
            if out.any():
                k = int(np.flatnonzero(out)[0])
                self._stop(k, f"is out of the box, at x = {xy[k, 0]:.6g} m, y = {xy[k, 1]:.6g} m,")
        kinetic = 0.5 * self._mass * (v**2).sum(axis=1)
        if len(kinetic):
            k = int(np.argmax(kinetic))
            if self._looks >= SETTLING and self._most > 0 and kinetic[k] > JUMP * self._most:
                self._stop(k, f"has {kinetic[k] / self._most:.3g} times the largest kinetic energy before")
            self._most = max(self._most, float(kinetic[k]))
        self._looks += 1
        if self.overlap < np.inf:
            i, j, part = s.overlaps()
            late = np.flatnonzero(part > self.overlap)
            now = {(int(i[m]), int(j[m])) for m in late}
            self._excused &= now
            for m in late:
                if (int(i[m]), int(j[m])) not in self._excused:
                    self._stop(
                        int(i[m]),
                        f"overlaps body {self._ids[j[m]]} by {100 * part[m]:.2g} % of a radius "
                        f"(more than {100 * self.overlap:.2g} %)",
                    )
