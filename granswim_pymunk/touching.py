"""Which disks overlap: pairs of any sizes, in a time that grows with the disks and the overlaps alone."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

CLASS = 2.0  # radii in one class differ by less than this factor
AT_ONCE = 1_000_000  # candidates looked at together


def overlapping(xy: np.ndarray, radius: np.ndarray, period: float | None = None) -> Iterator[tuple[int, int]]:
    """Pairs (i, j), i < j, whose centres are nearer than the sum of their radii.

    xy : (n, 2) [m], x in [0, period) and y >= 0 where there is a period along x;  radius : (n,) [m]
    Disks are looked up class by class: with one search radius for all, a single large disk among many small ones would
    make every pair a candidate.
    """
    box = (period, 0.0) if period else None
    order = np.argsort(radius, kind="stable")
    if not len(order):
        return
    level = np.floor(np.log(radius[order] / radius[order[0]]) / np.log(CLASS)).astype(int)
    groups = [order[level == k] for k in np.unique(level)]
    trees = [cKDTree(xy[group], boxsize=box) for group in groups]
    for k, group in enumerate(groups):
        for below, tree in zip(groups[: k + 1], trees, strict=False):
            yield from _between(xy, radius, group, below, tree, period)


def _between(
    xy: np.ndarray, radius: np.ndarray, group: np.ndarray, below: np.ndarray, tree: cKDTree, period: float | None
) -> Iterator[tuple[int, int]]:
    """Overlaps of the disks ``group`` with the disks ``below``, which are in ``tree``; both may be the same."""
    reach = radius[group] + float(radius[below].max())
    counts = np.asarray(tree.query_ball_point(xy[group], reach, return_length=True))
    part = np.cumsum(counts) // AT_ONCE
    bounds = [0, *(np.flatnonzero(np.diff(part)) + 1).tolist(), len(group)]
    for begin, end in pairwise(bounds):
        some = group[begin:end]
        near = tree.query_ball_point(xy[some], reach[begin:end])
        i = np.repeat(some, counts[begin:end])
        j = below[np.concatenate([np.asarray(found, dtype=np.int64) for found in near])]
        if below is group:
            i, j = i[j < i], j[j < i]
        away = xy[j] - xy[i]
        if period:
            away[:, 0] -= period * np.round(away[:, 0] / period)
        hit = np.hypot(away[:, 0], away[:, 1]) < radius[i] + radius[j]
        yield from zip(np.minimum(i, j)[hit].tolist(), np.maximum(i, j)[hit].tolist(), strict=True)
