"""Where innovations are beyond what replicates show: disks, grains near and far, parts of the cycle, times, speeds."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ... import distributions as stats
from ..criteria import current
from ..places import Place
from ..significance import after_looks, beyond, normal_score
from .likelihood import Prediction, WindowLikelihood, Windows
from .sums import MOMENTS, near_or_far, size_of
from .windows import BedCase

GRAINS = ("grains within two diameters of the swimmer", "grains farther from the swimmer")


@dataclass(frozen=True)
class Map:
    """Sizes of the innovations of one recording against those of replicates; 1 is what noise gives.

    disks : (W, s) mean square of each disk in each window;  sums : (W, 2) of grains near and far
    cells : (W, s) of the near grains about each disk
    replicate_disks : (N, W, s), replicate_sums : (N, W, 2), replicate_cells : (N, W, s) the same of replicates, each
    against the spread of all
    speed : (W,) of the swimmer's disks [m/s], root mean square
    """

    bed: BedCase
    disks: np.ndarray
    sums: np.ndarray
    cells: np.ndarray
    replicate_disks: np.ndarray
    replicate_sums: np.ndarray
    replicate_cells: np.ndarray
    speed: np.ndarray

    def of_replicate(self, number: int) -> Map:
        """The map that a replicate has beside the others."""
        others = np.arange(len(self.replicate_disks)) != number
        own = self.replicate_disks[number], self.replicate_sums[number], self.replicate_cells[number]
        those = self.replicate_disks[others], self.replicate_sums[others], self.replicate_cells[others]
        return Map(self.bed, *own, *those, self.speed)


def maps(likelihood: WindowLikelihood, predicted: Prediction) -> list[Map]:
    """One map for each recording, of all its windows."""
    criteria = current().windows.places
    found = []
    innovations = likelihood.innovations(predicted)
    for bed, noise, rows, seen in zip(likelihood.beds, likelihood.noises, innovations, likelihood.seen, strict=True):
        spread = np.sqrt(np.maximum(np.mean(np.square(np.nan_to_num(noise.residuals)), axis=(0, 1)), 1e-18))
        own, replicates = np.nan_to_num(rows / spread) ** 2, np.nan_to_num(noise.residuals / spread) ** 2
        s, looks = len(bed.rows), len(bed.looks)

        def disks(values: np.ndarray, bed=bed, looks=looks, s=s) -> np.ndarray:
            cut = values[..., : bed.swimmer_size].reshape(*values.shape[:-1], looks, s, 2)
            return cut.mean(axis=(-3, -1))

        def grains(values: np.ndarray, bed=bed, looks=looks, s=s) -> tuple[np.ndarray, np.ndarray]:
            shape = values.shape[:-1]
            if bed.size == bed.swimmer_size:
                return np.zeros((*shape, 2)), np.zeros((*shape, s))
            cut = np.minimum(values[..., bed.swimmer_size :], criteria.farthest**2)
            cut = cut.reshape(*shape, looks - 1, size_of(s))
            moments, cells = np.split(cut, [2 * len(MOMENTS)], axis=-1)
            groups = moments.reshape(*shape, looks - 1, 2, len(MOMENTS)).mean(axis=(-3, -1))
            return groups, cells.reshape(*shape, looks - 1, 2, s, 2)[..., 0, :, :].mean(axis=(-3, -1))

        path = seen[:, : bed.swimmer_size].reshape(len(bed.starts), looks, s, 2)
        moved = np.hypot(*np.moveaxis(path[:, -1] - path[:, 0], -1, 0)) / bed.span
        speed = np.sqrt(np.nanmean(np.where(np.isfinite(moved), moved, 0.0) ** 2, axis=1))
        found.append(Map(bed, disks(own), *grains(own), disks(replicates), *grains(replicates), speed))
    return found


def locate(likelihood: WindowLikelihood, predicted: Prediction, windows: Sequence[np.ndarray]) -> list[Place]:
    """Places where the innovations are beyond the replicates', the clearest first, each after all looks.

    How clear the first place of each replicate is among the others says what all looks make of chance: places depend on
    one another, and some beds jam.
    """
    of_film = list(zip(maps(likelihood, predicted), map(np.asarray, windows), strict=True))
    first = _first_of_replicates(of_film)
    places = []
    for place, z in _after_looks(of_film):
        z, p = _among(z, first)
        if p < current().windows.places.level:
            places.append(replace(place, z=z, p=p))
    return sorted(places, key=lambda q: -q.z)


def _after_looks(films: Sequence[tuple[Map, np.ndarray]]) -> list[tuple[Place, float]]:
    """The places in the chosen windows (w,) of all films, each with z after all looks as if they were independent."""
    candidates = [candidate for found, chosen in films for candidate in _of_one(found, chosen)]
    return [(place, after_looks(p_one, len(candidates))[0]) for place, p_one in candidates]


def _first_of_replicates(films: Sequence[tuple[Map, np.ndarray]]) -> np.ndarray:
    """(N,) z of the clearest place of each replicate, the others taken for its replicates."""
    number = min((len(found.replicate_disks) for found, _ in films), default=0)
    if number < current().windows.places.replicates:
        return np.zeros(0)
    found = [_after_looks([(of_film.of_replicate(k), chosen) for of_film, chosen in films]) for k in range(number)]
    return np.array([max(z for _, z in places) for places in found if places])


def _among(z: float, those: np.ndarray) -> tuple[float, float]:
    """z and p of the first place of a film among those of replicates (N,), taken for normal; among few, as it is."""
    number = len(those)
    if number < current().windows.places.replicates:
        return z, float(stats.norm.sf(z))
    p = float(stats.t.sf(beyond(z, those, current().rounding.nothing), number - 1))
    return normal_score(p), max(p, current().rounding.nothing)


def locate_law(
    beds: Sequence[BedCase], used: Windows, change: np.ndarray, left: np.ndarray, acting: Collection[str]
) -> list[Place]:
    """Places where a law shows: those whose own numbers ask for it, the clearest first, then parts of the cycle.

    change : (n,) what the law does to the numbers of the used windows, whitened;  left : (n,) what is seen beyond
    the scene without it;  acting : ids of the bodies that the law acts on. z = change . left/|change| of the numbers
    of a place alone, p after all looks. A force on all bodies that is weak everywhere makes no place stand out in
    size, but it does in this.
    """
    size = max(float(np.mean((left - change) ** 2)), 1.0)
    candidates: list[tuple[Place, float]] = []
    at = 0
    for bed, chosen in zip(beds, used, strict=True):
        n = len(chosen) * bed.size
        rows = [a[at : at + n].reshape(len(chosen), bed.size) for a in (change, left)]
        at += n
        products, squares = rows[0] * rows[1], rows[0] ** 2
        for where, of_place in _numbers_of(bed, chosen, acting):
            total = float(squares[of_place].sum())
            if total > 0:
                candidates.append((where, float(products[of_place].sum()) / math.sqrt(total * size)))
    looked = max(len(candidates), 1)
    scored = [(where, *after_looks(float(stats.norm.sf(z)), looked)) for where, z in candidates]
    found = [replace(where, z=z, p=p) for where, z, p in scored]
    return sorted((q for q in found if q.p < current().windows.places.level), key=lambda q: (q.phase is not None, -q.z))


def _role(disk: int, disks: int) -> str:
    return "head" if disk == 0 else "tail" if disk == disks - 1 else "swimmer"


def _by_phase(bed: BedCase, chosen: np.ndarray) -> list[tuple[np.ndarray, tuple[float, float]]]:
    """Of each part of the cycle, which of the chosen windows (w,) are in it; nothing where nothing is driven."""
    criteria = current().windows.places
    phases = bed.phases()
    if phases is None:
        return []
    part = np.floor(criteria.bins * phases[chosen]).astype(int) % criteria.bins
    return [(part == k, (k / criteria.bins, (k + 1) / criteria.bins)) for k in np.unique(part)]


def _numbers_of(bed: BedCase, chosen: np.ndarray, acting: Collection[str]) -> list[tuple[Place, tuple[Any, ...]]]:
    """Places, and which of the numbers (w, D) of the chosen windows are theirs."""
    s, looks = len(bed.rows), len(bed.looks)
    ids = tuple(bed.scene.bodies[r].id for r in bed.rows)
    swims = tuple(i for i in ids if i in acting)
    of_disk = np.tile(np.repeat(np.arange(s), 2), looks)
    every = slice(None)
    result: list[tuple[Place, tuple[Any, ...]]] = []

    def add(numbers: tuple[Any, ...], bodies: tuple[str, ...] = (), region: str | None = None, phase=None) -> None:
        result.append((Place(bodies, 0.0, 1.0, region, phase=phase), numbers))

    for k, name in enumerate(ids):
        add((every, np.flatnonzero(of_disk == k)), (name,), _role(k, s))
    if len(bed.grains):
        of_grains = np.tile(near_or_far(s), looks - 1)
        for k, region in enumerate(GRAINS):
            add((every, bed.swimmer_size + np.flatnonzero(of_grains == k)), (), region)
    for mine, phase in _by_phase(bed, chosen):
        add((mine,), swims, "swimmer" if swims else "grains", phase)
    return result


def _steady(squares: np.ndarray) -> np.ndarray:
    """Means (...,) over windows (..., w) without the one that adds most, where there are several.

    A tail that jams in one window is far from any prediction there, in beds that lack nothing, too; what is missing
    shows in all windows in which it acts, and what shows in one is told as that window. Source: Hampel et al. 1986,
    Robust Statistics, ch. 2 (the influence of one observation).
    """
    n = squares.shape[-1]
    mean: np.ndarray = squares.mean(axis=-1) if n == 1 else (squares.sum(axis=-1) - squares.max(axis=-1)) / (n - 1)
    return mean


def _of_one(found: Map, chosen: np.ndarray) -> list[tuple[Place, float]]:
    if not len(chosen):
        return []
    bed = found.bed
    disks, replicates = found.disks[chosen], found.replicate_disks[:, chosen]
    ids = [bed.scene.bodies[r].id for r in bed.rows]
    result: list[tuple[Place, float]] = []

    def freedom_of(squares: np.ndarray) -> float:
        """Of one window (N, W, k): numbers that vary together, or of which a few are large, count as fewer."""
        means = _steady(np.moveaxis(squares, 1, -1))
        scatter = max(float(np.mean(means.var(axis=0, ddof=1))), 1e-12)
        return max(2.0 * float(np.mean(means.mean(axis=0) ** 2)) / scatter / len(chosen), 0.3)

    per_window = freedom_of(replicates)

    def judge(mine: np.ndarray, others: np.ndarray, freedom: float) -> float:
        ratio = float(_steady(mine) / max(float(_steady(others).mean()), 1e-12))
        return float(stats.f.sf(ratio, max(freedom, 1.0), max(freedom * len(replicates), 1.0)))

    def add(p: float, bodies=(), region=None, phase=None, t=None, speed=None) -> None:
        result.append((Place(tuple(bodies), 0.0, 1.0, region, phase=phase, t=t, speed=speed), p))

    n = len(chosen)
    for k, name in enumerate(ids):
        add(judge(disks[:, k], replicates[:, :, k], per_window * n), [name], _role(k, len(ids)))
    if len(bed.grains):
        sums, cells = found.replicate_sums[:, chosen], found.replicate_cells[:, chosen]
        of_sums, of_cells = n * freedom_of(sums), n * freedom_of(cells)
        for k, region in enumerate(GRAINS):
            add(judge(found.sums[chosen, k], sums[:, :, k], of_sums), (), region)
        for k, name in enumerate(ids):
            about = judge(found.cells[chosen, k], cells[:, :, k], of_cells)
            add(about, (), f"grains within two diameters of disk {name}")
    whole = disks.mean(axis=1)
    whole_replicates = replicates.mean(axis=2)
    for mine, phase in _by_phase(bed, chosen):
        p = judge(whole[mine], whole_replicates[:, mine], per_window * mine.sum())
        add(p, ids, "swimmer", phase=phase)
    edges = np.quantile(found.speed[chosen], [0.0, 1 / 3, 2 / 3, 1.0])
    for low, high in pairwise(edges):
        mine = (found.speed[chosen] >= low) & (found.speed[chosen] <= high)
        if mine.any() and high > low:
            p = judge(whole[mine], whole_replicates[:, mine], per_window * mine.sum())
            add(p, ids, "swimmer", speed=(float(low), float(high)))
    for k, w in enumerate(chosen):
        t = float(bed.times[w])
        add(judge(whole[k : k + 1], whole_replicates[:, k : k + 1], per_window), ids, "swimmer", t=(t, t + bed.span))
    return result
