"""Extended XYZ (github.com/libAtoms/extxyz) for OVITO and ASE.

Programs for molecules know chemical elements only, so the species of a role is an element that begins as it does;
the column role has the true name.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .base import Exporter, Frames

ELEMENTS = {"head": "H", "tail": "Ta", "grain": "Ga", "wall": "W", "free": "F"}


def write_xyz(frames: Frames, path: Path) -> None:
    """Lengths in m; a body that is not seen has no row."""
    _, edges = frames.box()
    lattice = " ".join(f"{v!r}" for v in np.diag(edges).ravel().tolist())
    origin = " ".join(f"{v!r}" for v in frames.box()[0].tolist())
    columns = "species:S:1:pos:R:3:velo:R:3:id:I:1:radius:R:1:mass:R:1:name:S:1:role:S:1"
    names = [name.replace(" ", "_") or "_" for name in frames.ids]
    boundary = "T F F" if frames.periodic_x else "F F F"
    with path.open("w", encoding="utf-8") as out:
        for k in range(len(frames.t)):
            xyz, v = frames.points(k).tolist(), frames.velocities(k).tolist()
            seen = np.flatnonzero(np.isfinite(frames.xy[k]).all(axis=-1)).tolist()
            out.write(f"{len(seen)}\n")
            out.write(
                f'Lattice="{lattice}" Origin="{origin}" Properties={columns} pbc="{boundary}" '
                f"Time={float(frames.t[k])!r} Step={int(frames.step[k])}\n"
            )
            for b in seen:
                numbers = " ".join(f"{value!r}" for value in (*xyz[b], *v[b]))
                out.write(
                    f"{ELEMENTS[frames.roles[b]]} {numbers} {b} {float(frames.radius[b])!r} {float(frames.mass[b])!r} "
                    f"{names[b]} {frames.roles[b]}\n"
                )


XYZ = Exporter("xyz", ".xyz", "extended XYZ: OVITO, ASE", write_xyz)
