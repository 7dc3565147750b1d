"""Poses of DeepLabCut (Mathis et al. 2018, doi:10.1038/s41593-018-0209-y): three or four header rows.

scorer / (individuals) / bodyparts / coords, one row a frame, each body part with x, y [px] and likelihood.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options, grid, single
from .source import Source

LEVELS = ("scorer", "individuals", "bodyparts", "coords")


def recognise(source: Source) -> bool:
    if source.is_hdf5:
        return source.frame is not None and "bodyparts" in (source.frame.columns.names or ())
    return len(source.start) > 2 and source.start[0].startswith("scorer") and "bodyparts" in "".join(source.start[1:3])


def read(source: Source, options: Options) -> Found:
    """A position with a likelihood below ``options.likelihood`` is not seen."""
    labels, frames, values = _of_frame(source.frame) if source.is_hdf5 else _of_text(source)
    parts: dict[str, dict[str, int]] = {}
    several = len({label.get("individuals", "") for label in labels}) > 1
    for column, label in enumerate(labels):
        name = label["bodyparts"]
        if several:
            name = f"{label['individuals']}.{name}"
        parts.setdefault(name, {})[label["coords"]] = column
    xy = np.full((len(frames), len(parts), 2), np.nan)
    doubtful = 0
    for k, columns in enumerate(parts.values()):
        if not {"x", "y"} <= columns.keys():
            raise InputError(f"body part {list(parts)[k]} has no x and y", file=source.path)
        x, y = single(values[:, columns["x"]], values[:, columns["y"]])
        if "likelihood" in columns:
            low = np.isfinite(x) & ~(values[:, columns["likelihood"]] >= options.likelihood)
            doubtful += int(low.sum())
            x, y = np.where(low, np.nan, x), np.where(low, np.nan, y)
        xy[:, k] = np.stack([x, y], axis=-1)
    clock, body, x, y = grid(frames, list(parts), xy)
    notes = []
    if doubtful:
        notes.append(f"{doubtful} positions have a likelihood below {options.likelihood:g} and count as not seen")
    return Found(clock=clock, counts="frame", body=body, x=x, y=y, length="px", y_down=True, notes=notes)


def _of_frame(frame: Any) -> tuple[list[dict[str, str]], np.ndarray, np.ndarray]:
    names = list(frame.columns.names)
    labels = [dict(zip(names, map(str, column), strict=True)) for column in frame.columns]
    index = np.asarray(frame.index)
    frames = index.astype(float) if index.dtype.kind in "iuf" else np.arange(len(frame), dtype=float)
    return labels, frames, frame.to_numpy(dtype=float)


def _of_text(source: Source) -> tuple[list[dict[str, str]], np.ndarray, np.ndarray]:
    head: dict[str, list[str]] = {}
    rows = list(source.rows)
    while rows and rows[0][1][0].strip() in LEVELS:
        _, row = rows.pop(0)
        head[row[0].strip()] = [cell.strip() for cell in row[1:]]
    if not {"bodyparts", "coords"} <= head.keys() or not rows:
        raise InputError("needs the header rows scorer, bodyparts, coords and frames below them", file=source.path)
    labels = [{level: head[level][k] for level in head} for k in range(len(head["coords"]))]
    values = np.full((len(rows), len(labels)), np.nan)
    frames = np.empty(len(rows))
    for k, (line, row) in enumerate(rows):
        if len(row) != len(labels) + 1:
            expected = len(labels) + 1
            raise InputError(f"expected {expected} columns, got {len(row)}", file=source.path, where=f"row {line}")
        try:
            values[k] = [float(cell) if cell.strip() else np.nan for cell in row[1:]]
            frames[k] = float(row[0]) if row[0].strip().replace(".", "").isdigit() else k
        except ValueError:
            raise InputError("should hold numbers", file=source.path, where=f"row {line}") from None
    return labels, frames, values


IMPORTER = Importer("deeplabcut", "poses of DeepLabCut: CSV with three header rows, or h5", recognise, read)
