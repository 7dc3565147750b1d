"""H5MD (doi:10.1016/j.cpc.2014.01.018) with a box of three dimensions, as MDAnalysis and VMD want it.

The trajectory of a run is H5MD too, in two dimensions. MDAnalysis knows no metre, so lengths are in nm here.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from .. import __version__
from .base import Exporter, Frames, need_positions, species

NANO = 1e9


def write_h5md(frames: Frames, path: Path) -> None:
    """particles/all: position [nm], velocity [m/s], box; species, id, radius [m], mass [kg]."""
    need_positions(frames, path, "H5MD")
    low, edges = frames.box()
    text = h5py.string_dtype("utf-8")
    count = len(frames.t)
    with h5py.File(path, "w") as out:
        head = out.create_group("h5md")
        head.attrs["version"] = np.array([1, 1], dtype=np.int32)
        head.create_group("author").attrs["name"] = "unknown"
        creator = head.create_group("creator")
        creator.attrs["name"], creator.attrs["version"] = "granswim_pymunk", __version__
        group = out.create_group("particles/all")
        box = group.create_group("box")
        box.attrs["dimension"] = 3
        sides = ["periodic" if frames.periodic_x else "none", "none", "none"]
        box.attrs["boundary"] = np.array(sides, dtype=text)
        step = group.create_dataset("position/step", data=np.asarray(frames.step, dtype=np.int64))
        time = group.create_dataset("position/time", data=np.asarray(frames.t, dtype=float))
        time.attrs["unit"] = "s"
        series = {
            "position": (np.stack([frames.points(k) for k in range(count)]) * NANO, "nm"),
            "velocity": (np.stack([frames.velocities(k) for k in range(count)]), "m s-1"),
            "box/edges": (np.tile(edges * NANO, (count, 1)), "nm"),
        }
        series |= {name: (values, "") for name, values in frames.more.items()}
        if frames.periodic_x:
            image = np.zeros((count, len(frames.ids), 3), dtype=np.int32)
            image[..., 0] = np.floor(frames.xy[..., 0] / frames.periodic_x)
            series["image"] = (image, "")
        for name, (values, unit) in series.items():
            element = group.require_group(name)
            if name != "position":
                element["step"], element["time"] = step, time
            data = element.create_dataset("value", data=values)
            if unit:
                data.attrs["unit"] = unit
        box.attrs["origin"] = low * NANO
        group.create_dataset("id", data=np.array(frames.ids, dtype=object), dtype=text)
        kinds, of_kind = species(frames.roles)
        enum = h5py.enum_dtype({role: k for k, role in enumerate(kinds)}, basetype="i4")
        group.create_dataset("species", data=np.array(of_kind, dtype="i4"), dtype=enum)
        group.create_dataset("radius", data=frames.radius).attrs["unit"] = "m"
        group.create_dataset("mass", data=frames.mass).attrs["unit"] = "kg"


H5MD = Exporter("h5md", ".h5md", "H5MD with a box of three dimensions: MDAnalysis, VMD", write_h5md)
