"""Beds: grains at random in a box twice as high, compressed by moving walls, relaxed until quiet.

The compression has dynamics of its own, not those of the scene: soft disks of equal mass and stiffness,
driven to the nearest minimum of their elastic energy after each small step of the walls (FIRE: Bitzek,
Koskinen, Gaehler, Moseler & Gumbsch 2006, Phys. Rev. Lett. 97, 170201; doi:10.1103/PhysRevLett.97.170201).
A bed below jamming comes out without any overlap, one above it in equilibrium under a linear contact law.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .compiled import ask_for, njit
from .errors import InputError, SimulationError
from .files import written_whole
from .limits import MOST_BODIES
from .scene import Body, Scene
from .storage import cache_folder

log = logging.getLogger("granswim")

# part of the cache's key: a bed packed by other code is another bed
ALGORITHM = 1
OVERLAP = 0.02  # largest overlap a bed may come out with, in radii of the smaller grain (MODEL.md)
# grains repel from a gap this much of a radius sum: a bed that fits ends with gaps, not with tiny overlaps
MARGIN = 2e-4
SKIN = 0.35  # of a mean diameter
ROUNDS = 80  # of exchanging grains, at most
BLOCK = 400  # steps between two looks at the clock and the keyboard
LATER = 64  # places are asked for so many pairs ahead: pairs come in the order of numbers, from anywhere in the bed
PAIRS = 256  # are looked at before the forces of those that touch are summed: they stay in the first-level cache

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Quality:
    """What a packed bed is like: area fraction (swimmer counted), grains, largest overlap in radii."""

    packing_fraction: float
    grains: int
    overlap: float


def pack(scene: Scene, cache: bool = True, progress: Progress | None = None) -> Scene:
    """The scene with grains "g0" ... and wall grains "w0" ... added, as ``scene.bed`` says.

    Grain diameters are uniform over ``bed.grain_diameter``, masses those of spheres, rho 4/3 pi r^3; there
    are as many as bring the area fraction of the box periodic_x x height nearest to
    ``bed.packing_fraction``, bodies already placed (the swimmer) counted. Those are held meanwhile. Wall
    grains have the mean grain's diameter, touch each other and sit just outside the box at both y ends.

    ``cache``: look for the bed in the user's cache folder first and leave it there afterwards.
    ``progress``: called with the part done, 0 to 1. A scene without a bed, or with grains, comes back as
    it is. The seed of the scene fixes the bed bit for bit.

    Raises InputError where the bed cannot be made from what is given, SimulationError where it does not
    come to rest with overlaps below 2 % of a radius.
    """
    if scene.bed is None or any(b.role == "grain" for b in scene.bodies):
        return scene
    _check(scene)
    file = cache_file(scene)
    arrays = _load(file) if cache else None
    if arrays is None:
        arrays = _make(scene, progress)
        if cache:
            _store(file, arrays)
    if progress is not None:
        progress(1.0)
    radius, xy = arrays
    density = scene.bed.density

    def disk(name: str, role: str, r: float, place: np.ndarray) -> Body:
        mass = density * 4 / 3 * math.pi * r**3
        return Body(name, role, r, mass, initial=(float(place[0]), float(place[1]), 0.0, 0.0))

    wall, places = _wall(scene)
    grains = [disk(f"g{k}", "grain", float(radius[k]), xy[k]) for k in range(len(radius))]
    walls = [disk(f"w{k}", "wall", wall, places[k]) for k in range(len(places))]
    return replace(scene, bodies=(*scene.bodies, *grains, *walls))


def quality(scene: Scene) -> Quality:
    """Area fraction, number of grains and largest overlap of a packed scene."""
    from scipy.spatial import cKDTree

    assert scene.bed is not None and scene.periodic_x is not None
    bodies = scene.bodies
    xy = np.array([b.initial[:2] for b in bodies if b.initial is not None])
    radius = np.array([b.radius for b in bodies])
    chain = np.array([b.role in ("head", "tail") for b in bodies])
    wall = np.array([b.role == "wall" for b in bodies])
    area = math.pi * float((radius[~wall] ** 2).sum())
    wrapped = xy.copy()
    wrapped[:, 0] %= scene.periodic_x
    wrapped[:, 1] -= wrapped[:, 1].min()
    tree = cKDTree(wrapped, boxsize=(scene.periodic_x, 4 * (float(np.ptp(xy[:, 1])) + scene.bed.height)))
    pairs = tree.query_pairs(2 * float(radius.max()), output_type="ndarray")
    i, j = pairs[:, 0], pairs[:, 1]
    kept = ~(chain[i] & chain[j]) & ~(wall[i] & wall[j])
    i, j = i[kept], j[kept]
    d = xy[j] - xy[i]
    d[:, 0] -= scene.periodic_x * np.round(d[:, 0] / scene.periodic_x)
    overlap = (radius[i] + radius[j] - np.hypot(d[:, 0], d[:, 1])) / np.minimum(radius[i], radius[j])
    return Quality(
        area / (scene.periodic_x * scene.bed.height),
        sum(b.role == "grain" for b in bodies),
        max(float(overlap.max(initial=0.0)), 0.0),
    )


# ---- what is to be packed ---------------------------------------------------------------------


def _check(scene: Scene) -> None:
    bed = scene.bed
    assert bed is not None
    if scene.periodic_x is None:
        raise InputError("a bed needs periodic_x, the width of its box [m]", where="scene.bed")
    if any(b.role == "wall" for b in scene.bodies):
        raise InputError("a bed brings its own wall grains: no body may have role wall", where="scene.bed")
    high = bed.grain_diameter[1]
    if scene.periodic_x < 4 * high or bed.height < 4 * high:
        raise InputError(
            f"the box {scene.periodic_x:g} x {bed.height:g} m is narrower than four of the largest grains",
            where="scene.bed",
        )
    if bed.packing_fraction > 0.84:
        raise InputError(
            f"packing_fraction {bed.packing_fraction:g} is too dense; up to 0.84 is possible",
            where="scene.bed",
        )
    for body in scene.bodies:
        if body.initial is None:
            raise InputError("needs a place before the bed can be packed around it", where=f"body {body.id}")
        if not body.radius <= body.initial[1] <= bed.height - body.radius:
            raise InputError(
                f"its y = {body.initial[1]:g} m is not inside the bed, 0 .. {bed.height:g} m",
                where=f"body {body.id}",
            )
    if _held_area(scene) >= bed.packing_fraction * scene.periodic_x * bed.height:
        raise InputError("the bodies already placed fill the box to its packing_fraction", where="scene.bed")


def _held_area(scene: Scene) -> float:
    return math.pi * sum(b.radius**2 for b in scene.bodies)


def _wall(scene: Scene) -> tuple[float, np.ndarray]:
    """Radius of a wall grain [m] and the places of both rows (n, 2) [m]."""
    assert scene.bed is not None and scene.periodic_x is not None
    count = max(round(scene.periodic_x / (sum(scene.bed.grain_diameter) / 2)), 1)
    radius = scene.periodic_x / count / 2
    x = (np.arange(count) + 0.5) * 2 * radius
    rows = [np.column_stack([x, np.full(count, y)]) for y in (-radius, scene.bed.height + radius)]
    return radius, np.vstack(rows)


def _radii(scene: Scene, rng: np.random.Generator) -> np.ndarray:
    """Grain radii [m], as many as bring the area fraction nearest to the wanted one."""
    bed = scene.bed
    assert bed is not None and scene.periodic_x is not None
    wanted = bed.packing_fraction * scene.periodic_x * bed.height - _held_area(scene)
    low, high = bed.grain_diameter
    expected = wanted / (math.pi / 4 * low**2)
    if not expected < MOST_BODIES:
        raise InputError(
            f"would have about {expected:.2g} grains; more than {MOST_BODIES} cannot be computed", where="scene.bed"
        )
    most = math.ceil(expected) + 1
    radius = rng.uniform(low, high, most) / 2
    area = np.concatenate([[0.0], np.cumsum(math.pi * radius**2)])
    return radius[: int(np.argmin(np.abs(area - wanted)))]


# ---- cache ------------------------------------------------------------------------------------


def cache_file(scene: Scene) -> Path:
    """Where the bed of this scene is kept: named by the hash of all that makes it what it is."""
    bed = scene.bed
    assert bed is not None
    key = {
        "algorithm": ALGORITHM,
        "bed": [bed.height, bed.packing_fraction, *bed.grain_diameter],
        "periodic_x": scene.periodic_x,
        "seed": scene.seed,
        "held": [[*b.initial[:2], b.radius] for b in scene.bodies if b.initial is not None],
    }
    name = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()
    return cache_folder() / "beds" / f"{name}.npz"


def _load(file: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """Radii and places from the cache; None where there are none, or none that can be read."""
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as data:
            radius, xy = data["radius"], data["xy"]
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        log.warning("the cached bed %s cannot be read (%s): packing it again", file, error)
        return None
    right = radius.ndim == 1 and xy.shape == (len(radius), 2) and len(radius)
    if not right or not (np.isfinite(radius).all() and np.isfinite(xy).all()):
        log.warning("the cached bed %s is damaged: packing it again", file)
        return None
    return radius, xy


def _store(file: Path, arrays: tuple[np.ndarray, np.ndarray]) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(file, mode=0o600) as stream:
            np.savez(stream, radius=arrays[0], xy=arrays[1])
    except OSError as error:
        log.warning("the bed is not kept in the cache: %s", error)


# ---- compression ------------------------------------------------------------------------------


class _Box:
    """Grains, held bodies and both wall rows, in mean diameters; walls symmetric about the middle."""

    def __init__(self, scene: Scene, rng: np.random.Generator) -> None:
        bed = scene.bed
        assert bed is not None and scene.periodic_x is not None
        self.unit = sum(bed.grain_diameter) / 2
        self.grain_radius = _radii(scene, rng)
        self.count = len(self.grain_radius)
        self.width = scene.periodic_x / self.unit
        self.height = bed.height / self.unit
        self.middle = self.height / 2
        wall, places = _wall(scene)
        self.wall_x = places[:, 0] / self.unit
        self.wall_side = np.where(places[:, 1] < 0, -1.0, 1.0)
        self.wall_radius = wall / self.unit
        held = np.array([b.initial[:2] for b in scene.bodies if b.initial is not None]).reshape(-1, 2)
        held = held / self.unit
        held_radius = [b.radius for b in scene.bodies]
        walls = np.full(len(places), wall)
        self.radius = np.concatenate([self.grain_radius, held_radius, walls]) / self.unit
        self.scale = 2.0  # height of the box now, in target heights
        n = len(self.radius)
        self.x = np.zeros(n)
        self.y = np.zeros(n)
        self.x[self.count : self.count + len(held)] = held[:, 0]
        self.y[self.count : self.count + len(held)] = held[:, 1]
        self.x[n - len(places) :] = self.wall_x
        # a grain at random anywhere between the walls; overlaps are relaxed before compression starts
        self.x[: self.count] = rng.uniform(0.0, self.width, self.count)
        room = self.scale * self.height / 2 - self.radius[: self.count]
        self.y[: self.count] = self.middle + room * rng.uniform(-1.0, 1.0, self.count)
        self.place_walls()

    def place_walls(self) -> None:
        away = self.scale * self.height / 2 + self.wall_radius
        self.y[len(self.y) - len(self.wall_x) :] = self.middle + self.wall_side * away

    def squeeze(self, factor: float) -> None:
        """Bring the walls together by this factor, and the grains with them."""
        self.scale *= factor
        inner = slice(0, self.count)
        self.y[inner] = self.middle + (self.y[inner] - self.middle) * factor
        self.place_walls()

    def relax(self, steps: int, quiet: float, enough: float) -> float:
        """At most ``steps`` steps of FIRE; returns the largest overlap in radii of the smaller disk.

        Stops when overlaps fall below ``enough``, or when no grain feels a net force above ``quiet``.
        """
        overlap = math.inf
        memory = _memory(self.count)
        for _ in range(0, steps, BLOCK):
            overlap, done = _relax(
                self.x,
                self.y,
                self.radius,
                self.count,
                self.width,
                *memory,
                BLOCK,
                quiet,
                enough,
                MARGIN,
                SKIN,
            )
            if done:
                break
            if not math.isfinite(overlap):
                raise SimulationError("packing failed: a position is not finite")
        return float(overlap)

    def shake(self, rng: np.random.Generator, size: float) -> None:
        """Move every grain by about ``size`` mean diameters, out of the minimum it sits in."""
        self.x[: self.count] += rng.normal(0.0, size, self.count)
        self.y[: self.count] += rng.normal(0.0, size, self.count)

    def exchange(self, rng: np.random.Generator) -> None:
        """Exchange pairs of radii wherever that lowers the elastic energy, 200 tries a grain."""
        tries = rng.integers(0, self.count, (200 * self.count, 2))
        order = np.arange(self.count)
        _exchange(self.x, self.y, self.radius, self.count, self.width, tries, order, MARGIN)
        self.grain_radius = self.grain_radius[order]


def _memory(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Velocities of the grains and the state of FIRE: dt, mixing, steps downhill."""
    return np.zeros(count), np.zeros(count), np.array([0.1, 0.1, 0.0])


def _make(scene: Scene, progress: Progress | None) -> tuple[np.ndarray, np.ndarray]:
    assert scene.bed is not None
    rng = np.random.default_rng(scene.seed)
    box = _Box(scene, rng)
    say = progress or (lambda part: None)
    say(0.0)
    box.relax(4000, 1e-6, 1e-3)
    start = box.scale
    while box.scale > 1.0:
        # the denser, the smaller the step: near jamming a large one would lock a bad arrangement in
        ahead = box.scale - 1.0
        step = min(max(0.06 * ahead, 0.001), 0.03)
        box.squeeze(max((box.scale - step) / box.scale, 1.0 / box.scale))
        if box.scale < 1.0 + 1e-9:
            box.squeeze(1.0 / box.scale)
            box.scale = 1.0
            box.place_walls()
            break
        box.relax(1200, 1e-5, 1e-3)
        say(0.9 * (start - box.scale) / (start - 1.0))
    overlap = box.relax(40000, 1e-9, -0.5 * MARGIN)
    for attempt in range(ROUNDS):
        if overlap < 0.9 * OVERLAP:
            break
        # a narrow box jams early at its walls: let grains of different size change places
        box.exchange(rng)
        if attempt % 6 == 5 and attempt < ROUNDS - 5:
            box.shake(rng, 0.1)
        overlap = box.relax(40000, 1e-9, -0.5 * MARGIN)
    if not overlap < OVERLAP:
        raise SimulationError(
            f"packing to {scene.bed.packing_fraction:g} leaves overlaps of {overlap:.3g} radii; "
            "a larger box, a lower packing_fraction or another seed may do"
        )
    say(0.99)
    xy = np.column_stack([box.x[: box.count] % box.width, box.y[: box.count]]) * box.unit
    return box.grain_radius, xy


# Rows of the working arrays are sorted by place, so that neighbours lie near each other in memory. Pairs and sums keep
# the order of the grains' numbers, and of the cells about each: the order of rows changes no bit of a bed.
@njit(cache=True, nogil=True, error_model="numpy")
def _cells(x, y, radius, width, reach):
    """Cells no smaller than the longest distance in a list: their columns and rows, column and row of each disk."""
    n = x.shape[0]
    cell = 0.0
    bottom = np.inf
    top = -np.inf
    for i in range(n):
        cell = max(cell, radius[i])
        bottom = min(bottom, y[i])
        top = max(top, y[i])
    cell = 2.0 * cell + reach
    columns = max(int(width / cell), 1)
    rows = int((top - bottom) / cell) + 1
    if columns < 3:
        columns = 1  # then every column neighbours itself only, and the image is found by rounding
    at = np.empty((n, 2), dtype=np.int32)
    for i in range(n):
        turned = x[i] - width * math.floor(x[i] / width)
        at[i, 0] = min(int(turned / width * columns), columns - 1)
        at[i, 1] = min(int((y[i] - bottom) / cell), rows - 1)
    return columns, rows, at


@njit(cache=True, nogil=True, error_model="numpy")
def _sorted(columns, rows, at, count):
    """Where the disks of each cell begin, disks by cells; which grain each row of the working arrays holds, and back.

    Grains (numbers below ``count``) come first, by cells; the others stay in their rows.
    """
    n = at.shape[0]
    begins = np.zeros(columns * rows + 1, dtype=np.int64)
    for i in range(n):
        begins[at[i, 0] * rows + at[i, 1] + 1] += 1
    for c in range(columns * rows):
        begins[c + 1] += begins[c]
    free = begins.copy()
    members = np.empty(n, dtype=np.int32)
    for i in range(n):
        c = at[i, 0] * rows + at[i, 1]
        members[free[c]] = i
        free[c] += 1
    order = np.arange(n)
    row_of = np.arange(n)
    row = 0
    for i in members:
        if i < count:
            order[row] = i
            row_of[i] = row
            row += 1
    return begins, members, order, row_of


@njit(cache=True, nogil=True, error_model="numpy")
def _list(x, y, radius, count, width, reach, first, second):
    """Pairs with a grain in them nearer than ``reach`` plus radii, by cells; -1 where they do not fit.

    Their number, and of the rows sorted by place which disk each holds, and which row each disk has.
    """
    n = x.shape[0]
    columns, rows, at = _cells(x, y, radius, width, reach)
    begins, members, order, row_of = _sorted(columns, rows, at, count)
    seen = np.empty((n, 3))  # side by side for those of a cell
    for k in range(n):
        i = members[k]
        seen[k, 0] = x[i] - width * math.floor(x[i] / width)
        seen[k, 1] = y[i]
        seen[k, 2] = radius[i] + reach
    side = 0 if columns == 1 else 1
    total = 0
    for i in range(count):
        here = x[i] - width * math.floor(x[i] / width)
        for row in range(max(at[i, 1] - 1, 0), min(at[i, 1] + 2, rows)):
            for column in range(at[i, 0] - side, at[i, 0] + side + 1):
                away = here + (width if column < 0 else -width if column >= columns else 0.0)
                cell = column % columns * rows + row
                for k in range(begins[cell], begins[cell + 1]):
                    dx = seen[k, 0] - away
                    if columns == 1:
                        dx -= width * math.floor(dx / width + 0.5)
                    dy = seen[k, 1] - y[i]
                    near = radius[i] + seen[k, 2]
                    if members[k] > i and dx * dx + dy * dy < near * near:
                        if total == first.shape[0]:
                            return -1, order, row_of
                        first[total] = i
                        second[total] = members[k]
                        total += 1
    return total, order, row_of


@njit(cache=True, nogil=True, error_model="numpy")
def _in_rows(x, radius, width, margin, row_of, pairs, first, second, shift, reach):
    """From numbers of disks to rows; what brings x_j - x_i of a pair to the nearest image, and where it touches."""
    for k in range(pairs):
        i = first[k]
        j = second[k]
        shift[k] = -width * math.floor((x[j] - x[i]) / width + 0.5)
        reach[k] = (radius[i] + radius[j]) * (1.0 + margin)
        first[k] = row_of[i]
        second[k] = row_of[j]


@njit(cache=True, nogil=True, error_model="numpy")
def _forces(xy, radius, pairs, first, second, shift, reach, force):
    """Sum the forces on all grains; the largest overlap in radii of the smaller disk.

    The pairs that touch are gathered first, block by block, without a branch that cannot be foreseen.
    """
    way_x = np.empty(PAIRS)
    way_y = np.empty(PAIRS)
    square = np.empty(PAIRS)
    touch = np.empty(PAIRS)
    least = np.empty(PAIRS)
    push = np.empty(PAIRS)
    which = np.empty(PAIRS, dtype=np.uint64)
    force[:] = 0.0
    overlap = -np.inf
    end = np.uint64(pairs)
    for low in range(np.uint64(0), end, np.uint64(PAIRS)):
        met = np.uint64(0)
        for k in range(low, min(low + np.uint64(PAIRS), end)):
            i = first[k]
            j = second[k]
            dx = xy[j, 0] - xy[i, 0] + shift[k]
            dy = xy[j, 1] - xy[i, 1]
            apart = dx * dx + dy * dy
            way_x[met] = dx
            way_y[met] = dy
            square[met] = apart
            which[met] = k
            met += np.uint64(apart < reach[k] * reach[k])
            later = min(k + np.uint64(LATER), end - np.uint64(1))
            ask_for(xy, first[later])  # type: ignore[call-arg]
            ask_for(xy, second[later])  # type: ignore[call-arg]
        for m in range(met):
            i = first[which[m]]
            j = second[which[m]]
            touch[m] = radius[i] + radius[j]
            least[m] = min(radius[i], radius[j])
            push[m] = reach[which[m]]
        for m in range(met):
            distance = math.sqrt(square[m])
            least[m] = (touch[m] - distance) / least[m]
            distance = distance if distance > 0.0 else 1.0
            push[m] = (push[m] - distance) / distance
            way_x[m] = push[m] * (way_x[m] if square[m] > 0.0 else 1.0)  # apart along x, from one place
            way_y[m] = push[m] * way_y[m]
        for m in range(met):
            overlap = max(overlap, least[m])
            i = first[which[m]]
            j = second[which[m]]
            force[i, 0] -= way_x[m]
            force[i, 1] -= way_y[m]
            force[j, 0] += way_x[m]
            force[j, 1] += way_y[m]
    return overlap


@njit(cache=True, nogil=True, error_model="numpy")
def _sums(order, v, force, terms):
    """Power, squares of all velocities and of all forces, the largest force squared; in the order of the grains."""
    power = 0.0
    speed = 0.0
    square = 0.0
    largest = 0.0
    for i in range(v.shape[0]):
        at = order[i]
        terms[at, 0] = force[i, 0] * v[i, 0] + force[i, 1] * v[i, 1]
        terms[at, 1] = v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1]
        terms[at, 2] = force[i, 0] * force[i, 0] + force[i, 1] * force[i, 1]
    for i in range(v.shape[0]):
        power += terms[i, 0]
        speed += terms[i, 1]
        square += terms[i, 2]
        largest = max(largest, terms[i, 2])
    return power, speed, square, largest


@njit(cache=True, nogil=True, error_model="numpy")
def _downhill(memory, power, turning, xy, v, force, old):
    """A step of FIRE; how far the grain went that went farthest since the list was made, squared."""
    dt = memory[0]
    count = v.shape[0]
    if power > 0.0:
        mix = memory[1]
        turn = mix * turning
        for i in range(count):
            for c in range(2):
                v[i, c] = (1.0 - mix) * v[i, c] + turn * force[i, c]
        memory[2] += 1.0
        if memory[2] > 5.0:
            memory[0] = dt = min(dt * 1.1, 0.5)
            memory[1] = mix * 0.99
    else:
        for i in range(count):
            for c in range(2):
                xy[i, c] -= 0.5 * dt * v[i, c]
                v[i, c] = 0.0
        memory[0] = dt = max(dt * 0.5, 0.02)
        memory[1] = 0.1
        memory[2] = 0.0
    moved = 0.0
    for i in range(count):
        for c in range(2):
            v[i, c] += dt * force[i, c]
            xy[i, c] += dt * v[i, c]
        moved = max(moved, (xy[i, 0] - old[i, 0]) ** 2 + (xy[i, 1] - old[i, 1]) ** 2)
    return moved


@njit(cache=True, nogil=True, error_model="numpy")
def _into_rows(order, x, y, vx, vy, xy, v):
    for row in range(order.shape[0]):
        xy[row, 0] = x[order[row]]
        xy[row, 1] = y[order[row]]
    for row in range(v.shape[0]):
        v[row, 0] = vx[order[row]]
        v[row, 1] = vy[order[row]]


@njit(cache=True, nogil=True, error_model="numpy")
def _out_of_rows(order, x, y, vx, vy, xy, v):
    for row in range(v.shape[0]):
        x[order[row]] = xy[row, 0]
        y[order[row]] = xy[row, 1]
        vx[order[row]] = v[row, 0]
        vy[order[row]] = v[row, 1]


@njit(cache=True, nogil=True, error_model="numpy")
def _relax(x, y, radius, count, width, vx, vy, memory, steps, quiet, enough, margin, skin):
    """FIRE on the grains (numbers below ``count``); the others stay. Returns largest overlap, and if it is done.

    Force on j: (1 + margin) (r_i + r_j) - d along the line of centres, unit stiffness and mass.
    """
    n = x.shape[0]
    first, second, shift, reach = _room(16 * n)
    order = np.arange(n)
    sizes = radius
    xy, force = np.empty((n, 2)), np.empty((n, 2))
    v, old, terms = np.empty((count, 2)), np.empty((count, 2)), np.empty((count, 3))
    _into_rows(order, x, y, vx, vy, xy, v)
    pairs = 0
    overlap = 0.0
    done = False
    moved = np.inf
    for _ in range(steps):
        if not moved < 0.25 * skin * skin:
            _out_of_rows(order, x, y, vx, vy, xy, v)
            pairs, order, row_of = _list(x, y, radius, count, width, skin, first, second)
            _into_rows(order, x, y, vx, vy, xy, v)
            if pairs < 0:
                first, second, shift, reach = _room(2 * first.shape[0])
                continue
            _in_rows(x, radius, width, margin, row_of, pairs, first, second, shift, reach)
            sizes = radius[order]
            old[:] = xy[:count]
        overlap = _forces(xy, sizes, pairs, first, second, shift, reach, force)
        done = overlap < enough
        if done:
            break
        power, speed, square, largest = _sums(order, v, force, terms)
        done = largest < quiet * quiet
        if done:
            break
        moved = _downhill(memory, power, math.sqrt(speed / square), xy, v, force, old)
    _out_of_rows(order, x, y, vx, vy, xy, v)
    return overlap, done


@njit(cache=True, nogil=True)
def _room(pairs):
    """For a list of so many pairs."""
    return np.empty(pairs, np.uint32), np.empty(pairs, np.uint32), np.empty(pairs), np.empty(pairs)


@njit(cache=True, nogil=True)
def _energy(i, r, skipped, x, y, radius, width, start, near, margin):
    """Elastic energy of grain i with radius r against all its neighbours but one."""
    total = 0.0
    for k in range(start[i], start[i + 1]):
        j = near[k]
        if j == skipped:
            continue
        dx = x[j] - x[i]
        dx -= width * math.floor(dx / width + 0.5)
        dy = y[j] - y[i]
        reach = (r + radius[j]) * (1.0 + margin)
        square = dx * dx + dy * dy
        if square < reach * reach:
            total += 0.5 * (reach - math.sqrt(square)) ** 2
    return total


@njit(cache=True, nogil=True)
def _exchange(x, y, radius, count, width, tries, order, margin):
    """Exchange the radii of pairs of grains where the energy falls; ``order`` follows."""
    n = x.shape[0]
    smallest = radius[:count].min()
    largest = radius[:count].max()
    # no pair that touches after an exchange is missing from this list
    reach = 2.0 * (largest - smallest) + 2.0 * margin * largest
    first, second, _shift, _reach = _room(16 * n)
    pairs, _order, _row_of = _list(x, y, radius, count, width, reach, first, second)
    while pairs < 0:
        first, second, _shift, _reach = _room(2 * first.shape[0])
        pairs, _order, _row_of = _list(x, y, radius, count, width, reach, first, second)
    start = np.zeros(n + 2, dtype=np.int64)
    for k in range(pairs):
        start[first[k] + 2] += 1
        start[second[k] + 2] += 1
    for i in range(n):
        start[i + 2] += start[i + 1]
    near = np.empty(2 * pairs, dtype=np.int64)
    for k in range(pairs):
        i = first[k]
        j = second[k]
        near[start[i + 1]] = j
        start[i + 1] += 1
        near[start[j + 1]] = i
        start[j + 1] += 1
    done = 0
    for k in range(tries.shape[0]):
        i = tries[k, 0]
        j = tries[k, 1]
        if i == j:
            continue
        before = _energy(i, radius[i], j, x, y, radius, width, start, near, margin)
        before += _energy(j, radius[j], i, x, y, radius, width, start, near, margin)
        if before == 0.0:
            continue
        after = _energy(i, radius[j], j, x, y, radius, width, start, near, margin)
        after += _energy(j, radius[i], i, x, y, radius, width, start, near, margin)
        # a third grain that touches both is met with the new radius of one and of the other: exact, as
        # only the radii of i and j change
        if after < before:
            radius[i], radius[j] = radius[j], radius[i]
            order[i], order[j] = order[j], order[i]
            done += 1
    return done
