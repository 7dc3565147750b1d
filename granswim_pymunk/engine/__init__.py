"""The engine: a scene on pymunk, forces by compiled callbacks."""

from ..choices import MODES
from ..snapshot import Contacts, State
from .advice import advise_dt, contact_duration, softened
from .checkpoint import load_checkpoint, resume, save_checkpoint
from .simulation import Simulation
from .units import Units
from .watch import Watch

__all__ = [
    "MODES", "Contacts", "Simulation", "State", "Units", "Watch", "advise_dt", "contact_duration", "load_checkpoint",
    "resume", "save_checkpoint", "softened",
]  # fmt: skip
