"""VTK XML for ParaView: a .pvd that lists the times, and beside it a folder with a .vtp of each frame.

Points with radius, mass, velocity and what else is known of each body; in ParaView show them as "Point Gaussian" or
glyphs with the radius. Written here, as the format is plain XML with base64 arrays.
"""

from __future__ import annotations

import base64
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from .base import Exporter, Frames, species

TYPES = {"f8": "Float64", "i4": "Int32", "i8": "Int64"}


def _array(name: str, values: np.ndarray) -> str:
    """A DataArray: the length of the bytes, then the bytes, in base64."""
    kind = values.dtype.kind + str(values.dtype.itemsize)
    raw = np.ascontiguousarray(values.astype(values.dtype.newbyteorder("<"))).tobytes()
    text = base64.b64encode(np.uint64(len(raw)).tobytes() + raw).decode()
    parts = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
    return f'<DataArray type="{TYPES[kind]}" Name={quoteattr(name)}{parts} format="binary">{text}</DataArray>\n'


def _frame(frames: Frames, k: int) -> str:
    seen = np.isfinite(frames.xy[k]).all(axis=-1)
    count = int(seen.sum())
    _, kinds = species(frames.roles)
    data = {
        "radius": frames.radius[seen].astype(float),
        "mass": frames.mass[seen].astype(float),
        "velocity": frames.velocities(k)[seen],
        "role": np.array(kinds, dtype=np.int32)[seen],
        "row": np.flatnonzero(seen).astype(np.int32),
    }
    data |= {name: values[k][seen].astype(float) for name, values in frames.more.items()}
    ends = np.arange(1, count + 1, dtype=np.int64)
    return (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n<PolyData>\n'
        f'<Piece NumberOfPoints="{count}" NumberOfVerts="{count}" NumberOfLines="0" NumberOfStrips="0" '
        'NumberOfPolys="0">\n<PointData Scalars="radius" Vectors="velocity">\n'
        + "".join(_array(name, values) for name, values in data.items())
        + "</PointData>\n<Points>\n"
        + _array("Points", frames.points(k)[seen])
        + "</Points>\n<Verts>\n"
        + _array("connectivity", ends - 1)
        + _array("offsets", ends)
        + "</Verts>\n</Piece>\n</PolyData>\n</VTKFile>\n"
    )


def write_vtk(frames: Frames, path: Path) -> None:
    folder = path.with_name(path.name.removeprefix(".").removesuffix(".part").removesuffix(".pvd") + "_frames")
    folder.mkdir(exist_ok=True)
    for old in folder.glob("frame_*.vtp"):
        old.unlink()
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">',
        "<Collection>",
    ]
    for k in range(len(frames.t)):
        name = f"frame_{k:06d}.vtp"
        (folder / name).write_text(_frame(frames, k), encoding="ascii")
        file = quoteattr(f"{folder.name}/{name}")
        lines.append(f'<DataSet timestep="{float(frames.t[k])!r}" group="" part="0" file={file}/>')
    path.write_text("\n".join([*lines, "</Collection>", "</VTKFile>", ""]), encoding="utf-8")


VTK = Exporter("vtk", ".pvd", "VTK: ParaView", write_vtk)
