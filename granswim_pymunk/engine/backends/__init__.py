"""The modes of the engine, and which of them runs a scene."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Sequence

import numpy as np

from ...errors import InputError
from ...scene import Scene
from ..advice import advise_dt
from ..motion import Motion, motion_functions
from ..native import Offsets, ProbeError, offsets, step_address
from ..order import part_of
from ..units import Units
from .base import Backend, Plan
from .batch import Batch
from .chipmunk import Chipmunk
from .python import Python
from .verlet import Verlet

log = logging.getLogger("granswim")

BACKENDS: dict[str, type[Backend]] = {kind.name: kind for kind in (Verlet, Chipmunk, Python, Batch)}
# callbacks are compiled and installed by one thread at a time; runs are free
_BUILDING = threading.RLock()


def backend_for(
    scene: Scene, mode: str, *, dt: float | None, start: str, units: Units | None, skin: float | None,
    only: Sequence[int] | np.ndarray | None, carried: Sequence[int] | np.ndarray, averaged: bool, stretch: float,
) -> Backend:  # fmt: skip
    """The backend that runs a scene; see ``Simulation`` for the arguments.

    A mode that cannot run it gives way with a word: to ``python`` for laws that cannot be compiled, to ``batch`` where
    no native callbacks can be installed. Raises InputError for what no mode can run.
    """
    kind = BACKENDS[mode]
    impulses = any(item.law.kind == "impulse" for item in scene.laws)
    plain = [item.name for item in scene.laws if not item.law.compiled]
    if plain and not kind.plain_laws:
        log.warning("law %s is plain Python: running in python mode", ", ".join(plain))
        kind = Python
    known: Offsets | None = None
    if kind.native:
        try:
            known = _probed()
        except ProbeError as error:
            log.warning("compiled callbacks cannot be installed (%s): using the batch interface", error)
            kind = Batch
    far = [item.name for item in scene.laws if item.law.reach]
    if far and not kind.reaches:
        raise InputError(f"{', '.join(far)} acts before contact, which Chipmunk does not report; use mode verlet")
    motion = _own_motion() if known is not None and not impulses else None
    present = part_of(scene, only, carried, kind.carries and not impulses)
    step = float(dt if dt is not None else scene.time.dt or advise_dt(scene))
    if not (np.isfinite(step) and step > 0):
        raise InputError(f"dt should be above zero [s], got {dt!r}")
    plan = Plan(scene, step, start, units, skin, present, frozenset(map(int, carried)), averaged, float(stretch))
    with _BUILDING:
        return kind(plan, known, motion)


def _probed() -> Offsets:
    """Where the fields of Chipmunk's structures are. Raises ProbeError where compiled callbacks cannot be installed."""
    if os.environ.get("GRANSWIM_NO_NATIVE"):
        raise ProbeError("switched off by GRANSWIM_NO_NATIVE")
    found = offsets()
    step_address()
    return found


def _own_motion() -> Motion | None:
    """Compiled drifts and kicks; None where Chipmunk's own must do.

    Beside impulses they must: its own position function knows about its overlap correction.
    """
    try:
        found = motion_functions()
    except ProbeError as error:
        log.debug("bodies stay where Chipmunk puts them: %s", error)
        return None
    return found if found.kicks else None
