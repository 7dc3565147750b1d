"""Missing physics of a swimmer and its grains, both seen: short windows started from estimated states."""

from .model import diagnose_bed

__all__ = ["diagnose_bed"]
