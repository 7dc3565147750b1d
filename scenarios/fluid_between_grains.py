"""Two kinds of recording, one cause: a grain that slides on its own, and a swimmer in a bed of such grains.

Both move in a fluid that the scenes do not know. The single grain shows the drag best; the bed is then asked whether
the same law explains it, and measures the coefficient a second time.

    python fluid_between_grains.py [FOLDER] [MINUTES]
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from granswim_pymunk import Result
from granswim_pymunk.engine import Simulation
from granswim_pymunk.inference.entry import ProgressLine, diagnose
from granswim_pymunk.packing import pack
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Adjustable, Body, Scene, read_scene, use

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/fluid_between_grains")
minutes = float(sys.argv[2]) if len(sys.argv) > 2 else None
drag = 4e-4  # kg/s, of every body

# the single grain, pushed three times
pushes = []
for k, (vx, vy) in enumerate(((0.1, 0.0), (0.06, 0.04), (0.0, 0.05))):
    slide = Scene((Body("g0", "grain", radius=1.4e-3, mass=2.9e-5, initial=(0.0, 0.0, vx, vy)),))
    filmed = film(
        Simulation(slide.with_laws(use("linear_drag", c=drag))), np.arange(101) / 500.0,
        rng=np.random.default_rng(k), noise=2e-5, name=f"push_{k + 1}",
    )  # fmt: skip
    pushes.append(replace(filmed, scene=replace(slide, bodies=(replace(slide.bodies[0], initial=None),))))

# the swimmer in its bed, a small one
believed = pack(read_scene(Path(__file__).parent / "pocket_swim.toml"))
believed = replace(believed, bed=None, adjustable=(Adjustable("bending", "stiffness", 1e-3, 4e-3),))
wet = replace(believed.with_laws(use("linear_drag", c=drag)), adjustable=())
swim = film(
    Simulation(wet, dt=4e-6), 0.1 + np.arange(201) / 500.0, rng=np.random.default_rng(9), noise=2e-5, name="swimmer"
)
bodies = tuple(replace(b, initial=None) if b.mobile else b for b in believed.bodies)
swim = replace(swim, scene=replace(believed, bodies=bodies, time=replace(believed.time, dt=None)))

found = diagnose([*pushes, swim], out, minutes=minutes, progress=ProgressLine())
print(Result(found.verdict).summary())
for entry in found.verdict["mechanisms"]:
    c = entry["parameters"].get("c")
    if c:
        print(f"{entry['name']}: c = {c['value']:.3g} kg/s, 95 % {c['low']:.3g} to {c['high']:.3g} (true: {drag})")
print(f"report: {out / 'report.html'}")
