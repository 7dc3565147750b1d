"""GSD (gsd.readthedocs.io) for OVITO, MDAnalysis, freud and HOOMD-blue, by the package gsd.

GSD holds single precision about the middle of its box. The place of that middle, and the times, are logged.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import InputError
from .base import Exporter, Frames, need_positions, species


def write_gsd(frames: Frames, path: Path) -> None:
    """Lengths in m; images count the periods along x; ``log/time`` [s] and ``log/origin`` [m]."""
    try:
        import gsd.hoomd
    except ImportError:
        raise InputError("GSD needs the package gsd: pip install 'granswim_pymunk[files]'") from None
    need_positions(frames, path, "GSD")
    low, edges = frames.box()
    middle = low + edges / 2
    types, of_type = species(frames.roles)
    with gsd.hoomd.open(str(path), "w") as out:
        for k in range(len(frames.t)):
            frame = gsd.hoomd.Frame()
            frame.configuration.step = int(frames.step[k])
            frame.configuration.dimensions = 2
            frame.configuration.box = [*edges.tolist(), 0, 0, 0]
            particles = frame.particles
            particles.N = len(frames.ids)
            particles.types, particles.typeid = types, of_type
            particles.position = (frames.points(k) - middle).astype(np.float32)
            particles.velocity = frames.velocities(k)
            particles.diameter = 2 * frames.radius
            particles.mass = frames.mass
            image = np.zeros((len(frames.ids), 3), dtype=np.int32)
            if frames.periodic_x:
                image[:, 0] = np.floor(frames.xy[k, :, 0] / frames.periodic_x)
            particles.image = image
            if "angle" in frames.more and np.isfinite(frames.more["angle"][k]).all():
                half = frames.more["angle"][k] / 2
                zero = np.zeros_like(half)
                particles.orientation = np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1)
            frame.log = {"time": np.array([frames.t[k]]), "origin": middle}
            if not frames.periodic_x:
                frame.log["open"] = np.array([1])
            out.append(frame)


GSD = Exporter("gsd", ".gsd", "GSD: OVITO, MDAnalysis, freud, HOOMD-blue", write_gsd)
