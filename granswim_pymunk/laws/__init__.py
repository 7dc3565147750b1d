"""Laws: the physics a scene is made of. One file, one compiled function, one declaration each."""

import importlib
import pkgutil

from .base import AUTOMATIC, STATE, Law, Parameter, all_laws, flexible, get_law, has_role, law

for _module in pkgutil.iter_modules(__path__):
    if _module.name != "base":
        importlib.import_module(f"{__name__}.{_module.name}")

__all__ = ["AUTOMATIC", "STATE", "Law", "Parameter", "all_laws", "flexible", "get_law", "has_role", "law"]
