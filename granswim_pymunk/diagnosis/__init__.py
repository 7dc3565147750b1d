"""Finding the physics that a scene lacks: compare, recalibrate, name, prove on held-out data, abstain, propose."""

from ..inference.result import Diagnosis, write_verdict
from .diagnose import diagnose
from .driver import TrackFinding, diagnose_bodies
from .verdict import result_of, revised_scene, verdict_dict

__all__ = [
    "Diagnosis", "TrackFinding", "diagnose", "diagnose_bodies", "result_of", "revised_scene", "verdict_dict",
    "write_verdict",
]  # fmt: skip
