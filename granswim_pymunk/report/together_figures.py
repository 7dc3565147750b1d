"""Figures of the report on recordings of several kinds: those of each kind, said to be its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from .page import pictures as pictures_of
from .style import Drawing

if TYPE_CHECKING:
    from ..inference.result import Diagnosis

KINDS = {"bodies": "bodies without a bed", "bed": "a bed that is seen", "unseen": "a bed that is not seen"}


def pictures(parts: Sequence[Diagnosis]) -> dict[str, Drawing]:
    """The figures of every part by kind and name."""
    return {
        f"{part.kind}_{name}": replace(drawing, caption=f"{KINDS[part.kind].capitalize()}. {drawing.caption}")
        for part in parts
        for name, drawing in pictures_of(part).items()
    }
