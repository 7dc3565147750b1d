"""A bed that is not seen: statistics of the swimmer's motion, and curves of its speed, against their spread."""

from .model import diagnose_unseen

__all__ = ["diagnose_unseen"]
