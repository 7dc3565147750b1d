"""The engine: a scene on pymunk, forces by compiled callbacks."""

from .advice import advise_dt, contact_duration, softened
from .checkpoint import load_checkpoint, resume, save_checkpoint
from .simulation import MODES, Contacts, Simulation, State
from .units import Units
from .watch import Watch

__all__ = [
    "MODES", "Contacts", "Simulation", "State", "Units", "Watch", "advise_dt", "contact_duration", "load_checkpoint",
    "resume", "save_checkpoint", "softened",
]  # fmt: skip
