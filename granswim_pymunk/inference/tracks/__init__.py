"""Whole tracks of bodies, in one piece or in segments between impacts, held against simulations."""

from .model import TrackFinding, diagnose_tracks

__all__ = ["TrackFinding", "diagnose_tracks"]
