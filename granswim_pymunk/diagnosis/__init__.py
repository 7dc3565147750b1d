"""Finding the physics that a scene lacks: compare, recalibrate, name, prove on held-out data, abstain, propose."""

from .diagnose import diagnose
from .driver import Diagnosis, diagnose_bodies
from .verdict import revised_scene, verdict_dict, write_verdict

__all__ = ["Diagnosis", "diagnose", "diagnose_bodies", "revised_scene", "verdict_dict", "write_verdict"]
