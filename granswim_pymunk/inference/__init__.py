"""Finding the physics that a scene lacks: compare, recalibrate, name, prove on held-out data, abstain, propose.

``entry`` chooses how recordings are compared; the ``pipeline`` then asks a kind of recording (an
``ObservationModel``, ``model``) for each step. The kinds: ``tracks`` (whole tracks and segments), ``windows`` (of a
bed that is seen), ``packings`` (statistics where it is not). What stands here directly serves every kind. What is
named here is loaded when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__all__ = ["Diagnosis", "ProgressLine", "diagnose", "write_verdict"]

if TYPE_CHECKING:
    from .entry import ProgressLine, diagnose
    from .result import Diagnosis, write_verdict

_MODULE = {"Diagnosis": "result", "ProgressLine": "entry", "diagnose": "entry", "write_verdict": "result"}


def __getattr__(name: str) -> Any:
    if name not in _MODULE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_MODULE[name]}", __name__), name)
