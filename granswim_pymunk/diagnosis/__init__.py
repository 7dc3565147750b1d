"""Finding the physics that a scene lacks: compare, recalibrate, name, prove on held-out data, abstain, propose."""

from ..inference.result import Diagnosis, write_verdict
from .diagnose import diagnose
from .tracks import TrackFinding, diagnose_tracks

__all__ = ["Diagnosis", "TrackFinding", "diagnose", "diagnose_tracks", "write_verdict"]
