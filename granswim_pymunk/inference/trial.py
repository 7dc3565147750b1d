"""A candidate that is tried, and several of them together: what is the same of them in every kind of recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from .criteria import current
from .hypothesis import Term
from .mechanisms import APPARATUS


class Tried:
    """A law, or a fault of the apparatus, that is held against recordings; each kind adds what its fit came to."""

    if TYPE_CHECKING:  # a field of some, a property of others

        @property
        def term(self) -> Term:
            """What was added to the scene."""
            ...

    @property
    def mechanism(self) -> str:
        """Its name in the verdict."""
        return self.term.mechanism

    @property
    def label(self) -> str:
        """Its name with what it was chosen for: a joint, some bodies, an exponent."""
        return self.term.label

    @property
    def special(self) -> bool:
        """Whether it is a fault of the apparatus that hardly any has, as a lens that bends the picture."""
        return self.term.special

    @property
    def numbers(self) -> int:
        """How many free numbers it has."""
        return len(self.term.free)

    @property
    def apparatus(self) -> bool:
        """Whether it is of the camera or the clock."""
        return self.term.mechanism in APPARATUS


T = TypeVar("T", bound=Tried)


def rows_of(laws: Sequence[Tried], first: int) -> list[slice]:
    """Where the numbers of each of several laws lie among those of their fit; ``first``: of the adjustables."""
    ends = first + np.cumsum([0, *(t.numbers for t in laws)])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def pair_gains(left: np.ndarray, names: Sequence[str], shapes: Sequence[np.ndarray]) -> list[tuple[float, int, int]]:
    """Falls in chi2 by two laws together to first order, best first: (fall, i, j) of each pair of two names.

    By normal equations, which cost nothing once signatures are known: what the second brings in what the first leaves.
    left : (n,) whitened, adjustables projected out;  shapes : (n, k) orthonormal directions of each law, none of one
    that shows nothing
    """
    seen = [k for k, shape in enumerate(shapes) if shape.shape[1]]
    result = []
    for at, i in enumerate(seen):
        a = shapes[i]
        alone = a.T @ left
        rest, gain = left - a @ alone, float(np.sum(alone**2))
        for j in seen[at + 1 :]:
            if names[i] == names[j]:
                continue
            u, s, _ = np.linalg.svd(shapes[j] - a @ (a.T @ shapes[j]), full_matrices=False)
            u = u[:, s > current().signatures.beside]
            result.append((gain + float(np.sum((u.T @ rest) ** 2)), i, j))
    return sorted(result, reverse=True)


def best_of_each(laws: Iterable[T], alike: Callable[[T], bool], taken: Iterable[str] = ()) -> list[tuple[T, bool]]:
    """Rivals, the first of each mechanism in their order, without those ``taken``: (law, whether it is ``alike``)."""
    found: dict[str, T] = {}
    for law in laws:
        if law.mechanism not in taken:
            found.setdefault(law.mechanism, law)
    return [(law, alike(law)) for law in found.values()]
