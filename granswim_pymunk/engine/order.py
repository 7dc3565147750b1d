"""The order in which the engine holds bodies: chains first, then joined ones, then the rest by place, walls last."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..scene import Scene
from .callbacks import BODIES
from .links import linked_rows


@dataclass(frozen=True)
class Order:
    """Rows of the scene and of the engine ("inner" rows).

    rows_of : (n,) int, inner row -> row of ``scene.bodies``
    inner : (N,) int, row of ``scene.bodies`` -> inner row, -1 for a body that is not simulated
    n_mobile : the first so many inner rows drift (among them bodies that are carried along); the others are walls
    spans : (c, 2) int, inner rows of each swimmer as half-open ranges
    joined : rows of the scene in hinges and rods, at inner rows from ``joined_at`` on
    blocks : (b + 1,) int, where blocks of bodies begin: forces are summed block after block
    """

    rows_of: np.ndarray
    inner: np.ndarray
    n_mobile: int
    spans: np.ndarray
    joined: tuple[int, ...]
    joined_at: int
    blocks: np.ndarray

    @property
    def n(self) -> int:
        """How many bodies are simulated."""
        return len(self.rows_of)

    def of_scene(self, values: np.ndarray) -> np.ndarray:
        """Values in inner order (n, ...) in that of the scene, NaN for bodies that are not simulated."""
        result = values[self.inner]
        result[self.inner < 0] = np.nan
        return result


def part_of(
    scene: Scene, only: Sequence[int] | np.ndarray | None, carried: Sequence[int] | np.ndarray, carries: bool
) -> np.ndarray:
    """(N,) bool: bodies of the scene that are simulated. ``carries``: some may be carried along. Raises InputError."""
    count = len(scene.bodies)
    present = np.full(count, only is None)
    for name, rows in (("only", () if only is None else only), ("carried", carried)):
        if len(rows) and not (0 <= min(rows) and max(rows) < count):
            raise InputError(f"{name} should be rows of the scene's {count} bodies")
    if only is not None:
        present[np.asarray(only, dtype=np.int64)] = True
    if len(carried) and not carries:
        raise InputError("carried bodies need mode verlet, without impulses")
    for chain in scene.chains:
        if len({bool(present[i]) for i in chain}) > 1:
            raise InputError("a swimmer should be simulated whole or not at all")
    return present


def order_of(scene: Scene, present: np.ndarray, carried: frozenset[int]) -> Order:
    """The inner order of the bodies that are ``present`` (N,). Raises InputError where a linkage is cut in two."""
    chains = [chain for chain in scene.chains if present[chain[0]]]
    order = [i for chain in chains for i in chain]
    ends = np.cumsum([len(chain) for chain in chains], dtype=np.int64)
    spans = np.array([(end - len(chain), end) for chain, end in zip(chains, ends, strict=True)], dtype=np.int64)
    joined = [i for i in linked_rows(scene) if present[i]]
    if 0 < len(joined) < len(linked_rows(scene)):
        raise InputError("bodies in hinges and rods should be simulated all together or not at all")
    joined_at = len(order)
    # joined bodies follow, in the first block of bodies: their forces are found together
    hung: set[int] = set()
    if any(item.law.kind == "joint" for item in scene.laws):
        hung = {int(row) for item in scene.laws_named("pin") for row in scene.rows(item)}
    order += [*joined, *sorted(row for row in hung - {*joined, *order} if present[row])]
    first_block = len(order)
    placed = set(order)
    rest = [i for i, b in enumerate(scene.bodies) if b.mobile and present[i] and i not in placed]
    order += _in_columns(scene, [i for i in rest if i not in carried])
    order += _in_columns(scene, [i for i in rest if i in carried])
    n_mobile = len(order)
    order += _in_columns(scene, [i for i, b in enumerate(scene.bodies) if not b.mobile and present[i]])
    inner = np.full(len(scene.bodies), -1, dtype=np.int64)
    rows_of = np.array(order, dtype=np.int64)
    inner[rows_of] = np.arange(len(order))
    n = len(order)
    return Order(
        rows_of=rows_of, inner=inner, n_mobile=n_mobile, spans=spans.reshape(-1, 2), joined=tuple(joined),
        joined_at=joined_at, blocks=np.array([0, *range(first_block, n, BODIES), n], dtype=np.int64),
    )  # fmt: skip


def _in_columns(scene: Scene, rows: list[int]) -> list[int]:
    """Rows sorted by place: columns along x, from bottom to top in each."""
    if not rows:
        return rows
    bodies = [scene.bodies[i] for i in rows]
    xy = np.array([b.initial[:2] for b in bodies if b.initial is not None])
    width = 2 * max(b.radius for b in bodies)
    x = np.mod(xy[:, 0], scene.periodic_x) if scene.periodic_x else xy[:, 0] - xy[:, 0].min()
    return [rows[k] for k in np.lexsort((xy[:, 1], np.floor(x / width)))]
