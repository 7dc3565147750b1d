"""Analysis files of SLEAP (Pereira et al. 2022, doi:10.1038/s41592-022-01426-1): HDF5 with ``tracks``.

``tracks`` is (tracks, 2, nodes, frames) [px], NaN where not seen, as SLEAP writes it; other orders are told by the
names of its dimensions or by the lengths of ``track_names`` and ``node_names``.
"""

from __future__ import annotations

import itertools
from typing import Any

import h5py
import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options, grid, single
from .source import Source


def recognise(source: Source) -> bool:
    return {"tracks", "node_names"} <= source.hdf5_names.keys()


def read(source: Source, options: Options) -> Found:
    """A body for each node of each track: the node's name, with the track's before it where there are several."""
    try:
        with h5py.File(source.path, "r") as file:
            data = np.asarray(file["tracks"][...], dtype=float)
            nodes = _names(file["node_names"])
            tracks = _names(file["track_names"]) if "track_names" in file else []
            scores = np.asarray(file["point_scores"][...], dtype=float) if "point_scores" in file else None
            dims = file["tracks"].attrs.get("dims")
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"is not an analysis file of SLEAP: {error}", file=source.path) from None
    count = max(len(tracks), 1)
    if data.ndim != 4:
        raise InputError(f"tracks should have four dimensions, got {data.shape}", file=source.path)
    order = _order(data.shape, count, len(nodes), dims)
    if order is None:
        counted = f"{count} tracks of {len(nodes)} nodes"
        raise InputError(f"tracks of shape {data.shape} do not fit {counted}", file=source.path)
    data = data.transpose(order)  # frames, tracks, nodes, 2
    if scores is not None and scores.size == data[..., 0].size and scores.ndim == 3:
        # (tracks, nodes, frames) beside (tracks, 2, nodes, frames)
        scores = scores.transpose(2, 0, 1) if scores.shape == (count, len(nodes), len(data)) else None
    else:
        scores = None
    doubtful = 0
    if scores is not None:
        low = (scores < options.likelihood) & np.isfinite(data[..., 0])
        # scores of SLEAP are no probabilities: below what was asked for counts only where the user asked
        if options.likelihood != Options.likelihood:
            doubtful = int(low.sum())
            data = np.where(low[..., None], np.nan, data)
    names = [_name(track, node, tracks, nodes) for track, node in itertools.product(range(count), range(len(nodes)))]
    xy = data.reshape(len(data), -1, 2)
    x, y = single(xy[..., 0], xy[..., 1])
    clock, body, xs, ys = grid(np.arange(len(data)), names, np.stack([x, y], axis=-1))
    notes = []
    if doubtful:
        notes.append(f"{doubtful} positions have a score below {options.likelihood:g} and count as not seen")
    return Found(clock=clock, counts="frame", body=body, x=xs, y=ys, length="px", y_down=True, notes=notes)


def _names(data: Any) -> list[str]:
    return [item.decode() if isinstance(item, bytes) else str(item) for item in np.ravel(data[...]).tolist()]


def _name(track: int, node: int, tracks: list[str], nodes: list[str]) -> str:
    parts = [tracks[track]] if len(tracks) > 1 or (tracks and len(nodes) == 1) else []
    return ".".join(parts + ([nodes[node]] if len(nodes) > 1 or not parts else []))


def _order(shape: tuple[int, ...], tracks: int, nodes: int, dims: Any) -> tuple[int, ...] | None:
    """Axes in the order frames, tracks, nodes, xy."""
    if dims is not None:
        text = dims.decode() if isinstance(dims, bytes) else str(dims)
        wanted = [next((k for k, d in enumerate(text.strip("[]").replace('"', "").split(",")) if name in d), -1)
                  for name in ("frame", "track", "node", "xy")]  # fmt: skip
        if sorted(wanted) == [0, 1, 2, 3]:
            return tuple(wanted)
    for order in ((3, 0, 2, 1), (0, 3, 1, 2), (0, 3, 2, 1), (0, 1, 2, 3), (3, 0, 1, 2)):
        if tuple(shape[k] for k in order[1:]) == (tracks, nodes, 2):
            return order
    return None


IMPORTER = Importer("sleap", "poses of SLEAP: its analysis h5", recognise, read)
