"""The engine: a scene on pymunk, forces by compiled callbacks."""

from .advice import advise_dt, contact_duration
from .simulation import MODES, Contacts, Simulation, State
from .units import Units

__all__ = ["MODES", "Contacts", "Simulation", "State", "Units", "advise_dt", "contact_duration"]
