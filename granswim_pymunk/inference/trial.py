"""A candidate that was tried: what is the same of it in every kind of recording."""

from __future__ import annotations

from abc import ABC, abstractmethod

from .hypothesis import Term
from .mechanisms import APPARATUS


class Tried(ABC):
    """A law, or a fault of the apparatus, that was held against recordings; each kind adds what its fit came to."""

    @property
    @abstractmethod
    def term(self) -> Term:
        """What was added to the scene."""

    @property
    def mechanism(self) -> str:
        """Its name in the verdict."""
        return self.term.mechanism

    @property
    def label(self) -> str:
        """Its name with what it was chosen for: a joint, some bodies, an exponent."""
        return self.term.label

    @property
    def numbers(self) -> int:
        """How many free numbers it has."""
        return len(self.term.free)

    @property
    def apparatus(self) -> bool:
        """Whether it is of the camera or the clock."""
        return self.term.mechanism in APPARATUS
