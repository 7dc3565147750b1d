"""Straight walls: segments of infinite mass that never move, as ``[[wall]]`` says in a scene.

A disk touches a wall where it is nearest to the segment, as it would touch a disk of the wall's radius that stands
there: the contact law of the scene acts along the line between the two, with the disk's own mass as the reduced mass.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .errors import InputError
from .limits import LARGEST_RADIUS, check_id

MOST_WALLS = 10_000
MOST_MEETINGS = 20_000_000  # bodies times walls
KEYS = ("from", "to", "radius", "id")


@dataclass(frozen=True)
class Wall:
    """A segment from ``begin`` to ``end`` [m], ``radius`` [m] thick to both sides and round at its ends."""

    begin: tuple[float, float]
    end: tuple[float, float]
    radius: float = 0.0
    id: str = ""

    def __post_init__(self) -> None:
        where = f"wall {self.id}".strip()
        if self.id:
            check_id(self.id)
        for name, value in (("from", self.begin), ("to", self.end)):
            if not _is_place(value):
                raise InputError(f"{name} should be two finite numbers [m], got {value!r}", where=where)
        object.__setattr__(self, "begin", (float(self.begin[0]), float(self.begin[1])))
        object.__setattr__(self, "end", (float(self.end[0]), float(self.end[1])))
        if not _is_number(self.radius) or not 0 <= self.radius <= LARGEST_RADIUS:
            raise InputError(f"radius should be a number, zero or above [m], got {self.radius!r}", where=where)
        object.__setattr__(self, "radius", float(self.radius))
        if not self.length > 0:
            raise InputError("from and to should be two places, got the same one twice", where=where)

    @property
    def length(self) -> float:
        """From end to end [m]."""
        return math.dist(self.begin, self.end)

    def to_dict(self) -> dict[str, Any]:
        """As it stands in TOML."""
        data: dict[str, Any] = {"from": list(self.begin), "to": list(self.end)}
        if self.radius:
            data["radius"] = self.radius
        if self.id:
            data["id"] = self.id
        return data


def _is_number(value: Any) -> bool:
    number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    return number and abs(value) < LARGEST_RADIUS  # not where it is no number either


def _is_place(value: Any) -> bool:
    return isinstance(value, Sequence | np.ndarray) and len(value) == 2 and all(map(_is_number, value))


def check_walls(walls: Sequence[Wall], bodies: int, ids: Iterable[str], period: float | None) -> None:
    """Raise InputError where walls cannot be told apart from each other or from bodies, or are too many."""
    if len(walls) > MOST_WALLS or len(walls) * bodies > MOST_MEETINGS:
        raise InputError(
            f"has {len(walls)} walls for {bodies} bodies; at most {MOST_WALLS}, and bodies times walls at most "
            f"{MOST_MEETINGS}, can be computed",
            where="wall",
        )
    known = set(ids) if walls else set()
    for wall in walls:
        if wall.id and wall.id in known:
            raise InputError("this id is used twice", where=f"wall {wall.id}")
        known.add(wall.id)
        if period and abs(wall.end[0] - wall.begin[0]) > period and wall.end[1] != wall.begin[1]:
            raise InputError(
                f"reaches farther along x than the period, {period:g} m: a wall that does should be parallel to x",
                where=f"wall {wall.id}".strip(),
            )


def outline(wall: Wall) -> np.ndarray:
    """(m, 2) corners [m] of a polygon around a wall, its round ends in steps of 15 degrees."""
    along = math.atan2(wall.end[1] - wall.begin[1], wall.end[0] - wall.begin[0])
    turn = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 13 if wall.radius else 1)
    half = [
        np.array(place) + wall.radius * np.column_stack([np.cos(way + turn), np.sin(way + turn)])
        for place, way in ((wall.end, along), (wall.begin, along + math.pi))
    ]
    return np.concatenate(half)


def table_of(walls: Sequence[Wall]) -> np.ndarray:
    """(k, 5) begin x, y, the way to the end x, y, radius [m]."""
    rows = [(*w.begin, w.end[0] - w.begin[0], w.end[1] - w.begin[1], w.radius) for w in walls]
    return np.array(rows, dtype=float).reshape(-1, 5)


def way_to_wall(xy: np.ndarray, wall: Wall, period: float | None = None) -> np.ndarray:
    """From places ``xy`` (..., 2) [m] to the nearest one on the middle line of a wall (..., 2) [m]."""
    begin, along = np.array(wall.begin), np.subtract(wall.end, wall.begin)
    place = np.asarray(xy, dtype=float) - begin
    if not period:
        return _way(place, along)
    place[..., 0] -= period * np.floor((place[..., 0] - 0.5 * along[0]) / period + 0.5)
    ways = [_way(place - (image * period, 0.0), along) for image in (0, -1, 1)]
    sizes = [np.hypot(w[..., 0], w[..., 1]) for w in ways]
    nearest = np.argmin(sizes, axis=0)
    return np.choose(nearest[..., None], ways)


def _way(place: np.ndarray, along: np.ndarray) -> np.ndarray:
    share = np.clip(place @ along / (along @ along), 0.0, 1.0)
    return share[..., None] * along - place


def gap_to_wall(xy: np.ndarray, radius: float, wall: Wall, period: float | None = None) -> np.ndarray:
    """Gap (...) [m] between disks of a radius [m] at ``xy`` (..., 2) [m] and a wall."""
    way = way_to_wall(xy, wall, period)
    return np.hypot(way[..., 0], way[..., 1]) - radius - wall.radius
