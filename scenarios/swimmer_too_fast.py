"""My simulated swimmer is faster than the filmed one: why?

Films a swimmer in a small bed whose grains rub (which the scene does not know), and asks what the scene lacks.
Put your own recording in place of ``recording``: a folder as docs/swimmer_too_fast.md describes it will do.

python swimmer_too_fast.py [FOLDER] [MINUTES]
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from granswim_pymunk import Result
from granswim_pymunk.engine import Simulation
from granswim_pymunk.inference.entry import ProgressLine, diagnose
from granswim_pymunk.packing import pack
from granswim_pymunk.recording import film, write_recording
from granswim_pymunk.scene import Adjustable, read_scene, use

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/swimmer_too_fast")
minutes = float(sys.argv[2]) if len(sys.argv) > 2 else None

# what I believe: smooth grains, and a stiffness that I know to a factor of two
believed = pack(read_scene(Path(__file__).parent / "pocket_swim.toml"))
believed = replace(believed, bed=None, adjustable=(Adjustable("bending", "stiffness", 1e-3, 4e-3),))

# what is there: the grains rub
true = believed.with_laws(use("contact_friction", mu=0.3))
times = 0.1 + np.arange(201) / 500.0
simulation = Simulation(replace(true, adjustable=()), dt=4e-6)
filmed = film(simulation, times, rng=np.random.default_rng(1), noise=2e-5, name="rough_grains")

# the film, told as the scene that I believe
bodies = tuple(replace(b, initial=None) if b.mobile else b for b in believed.bodies)
recording = replace(filmed, scene=replace(believed, bodies=bodies, time=replace(believed.time, dt=None)))
write_recording(recording, out / "recording")

found = diagnose([out / "recording"], out / "diagnosis", minutes=minutes, progress=ProgressLine())
print(Result(found.verdict).summary())
print(f"report: {out / 'diagnosis' / 'report.html'}")
