"""Runs and recordings for other programs, one format a file: OVITO, MDAnalysis, ASE, ParaView, pandas."""

from __future__ import annotations

import os
from pathlib import Path

from ..errors import InputError
from .base import Exporter, Frames, frames_of_recording, frames_of_trajectory, open_frames
from .gsd import GSD
from .h5md import H5MD
from .tables import CSV, PARQUET, table_of
from .vtk import VTK
from .xyz import XYZ

EXPORTERS = {e.name: e for e in (GSD, XYZ, CSV, PARQUET, VTK, H5MD)}


def export(source: str | Path | Frames, to: str, out: str | Path | None = None, *, every: int = 1) -> Path:
    """Write a run (its folder or trajectory.h5) or a recording in another program's format; the file.

    to : gsd, xyz, csv, parquet, vtk or h5md;  out : a file, or a folder that is there (default: NAME.SUFFIX in it)
    every : one frame in so many. Raises InputError; a file appears whole or not at all.
    """
    if to not in EXPORTERS:
        raise InputError(f"unknown format {to!r}; known: {', '.join(EXPORTERS)}", where="to")
    exporter = EXPORTERS[to]
    frames = source if isinstance(source, Frames) else open_frames(source, every)
    path = Path(out) if out is not None else Path(f"{frames.name}{exporter.suffix}")
    if path.is_dir():
        path = path / f"{frames.name}{exporter.suffix}"
    if not path.parent.is_dir():
        raise InputError("its folder does not exist", file=path)
    beside = path.with_name(f".{path.name}.part")
    try:
        exporter.write(frames, beside)
        os.replace(beside, path)
    except OSError as error:
        raise InputError(f"cannot write it: {error.strerror or error}", file=path) from None
    finally:
        beside.unlink(missing_ok=True)
    return path


__all__ = [
    "EXPORTERS", "Exporter", "Frames", "export", "frames_of_recording", "frames_of_trajectory", "open_frames",
    "table_of",
]  # fmt: skip
