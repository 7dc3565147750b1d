"""Grains and swimmers on pymunk: script a scene, watch it, hold it against a recording.

    import granswim_pymunk as gs

    result = gs.diagnose(t, xy, radius="5mm", mass="10g", laws=["pin:bob,anchor=0 0,length=0.25"], gravity=9.81,
                         names=["bob"])
    print(result.summary())

SI at every public edge (m, kg, s, rad, N); y points up, angles are counter-clockwise. What is named here is loaded
when it is first used. Where it lives, and what else there is:

scene       Scene, Body, Adjustable, Bed, Time, use, read_scene, write_scene: what is simulated
laws        Law, Parameter, law, get_law, all_laws: one file for each law
engine      Simulation, State, Contacts: a scene running on a pymunk.Space
packing     pack: the bed of a scene
run         run_scene, RunResult: a scene to a folder with trajectory, pictures, film
trajectory  read_trajectory
render      draw_frame
sweep       a scene over many values
recording   Recording, read_recording, write_recording, shipped_names, film (a simulation seen by a camera);
            recording.importers: import_recording (files of trackers and codes); recording.track_film: track (films)
api         make_recording, diagnose: of arrays, tables and everything else
result      Result, load_verdict: what a diagnosis found
inference   how it is found and judged: entry, pipeline, one folder for each kind of recording
report      how it is told: figures, words, one page
export      export.export: a run for other programs
errors      InputError (what was given is wrong), SimulationError (a run cannot go on)
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from .beside import find_beside

__version__ = "0.1.0"

__all__ = [
    "Adjustable", "Bed", "Body", "Contacts", "InputError", "Law", "Parameter", "Recording", "Result", "RunResult",
    "Scene", "Simulation", "SimulationError", "State", "Time", "all_laws", "diagnose", "draw_frame", "film", "get_law",
    "import_recording", "law", "load_verdict", "make_recording", "pack", "read_recording", "read_scene",
    "read_trajectory", "run_scene", "shipped_names", "track", "use", "write_recording", "write_scene",
]  # fmt: skip

if TYPE_CHECKING:
    from .api import diagnose, make_recording
    from .engine import Contacts, Simulation, State
    from .errors import InputError, SimulationError
    from .laws import Law, Parameter, all_laws, get_law, law
    from .packing import pack
    from .recording import Recording, film, read_recording, shipped_names, write_recording
    from .recording.importers import import_recording
    from .recording.track_film import track
    from .render import draw_frame
    from .result import Result, load_verdict
    from .run import RunResult, run_scene
    from .scene import Adjustable, Bed, Body, Scene, Time, read_scene, use, write_scene
    from .trajectory import read_trajectory

# the modules of the names above, in the same order as there
_PLACES = {
    "api": ("diagnose", "make_recording"),
    "engine": ("Contacts", "Simulation", "State"),
    "errors": ("InputError", "SimulationError"),
    "laws": ("Law", "Parameter", "all_laws", "get_law", "law"),
    "packing": ("pack",),
    "recording": ("Recording", "film", "read_recording", "shipped_names", "write_recording"),
    "recording.importers": ("import_recording",),
    "recording.track_film": ("track",),
    "render": ("draw_frame",),
    "result": ("Result", "load_verdict"),
    "run": ("RunResult", "run_scene"),
    "scene": ("Adjustable", "Bed", "Body", "Scene", "Time", "read_scene", "use", "write_scene"),
    "trajectory": ("read_trajectory",),
}
_MODULE = {name: module for module, names in _PLACES.items() for name in names}

find_beside(__name__, __file__)


def __getattr__(name: str) -> Any:
    """Load what is asked for: importing the package alone stays fast."""
    if name not in _MODULE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{_MODULE[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
