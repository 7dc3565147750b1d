"""The swimmer in a small bed, scripted: build the scene, pack it, run it, draw it, look at its numbers.

python swim.py [FOLDER]
"""

import math
import sys
from pathlib import Path

import numpy as np

from granswim_pymunk.engine import Simulation
from granswim_pymunk.packing import pack
from granswim_pymunk.render import Painter
from granswim_pymunk.scene import Bed, Scene, swimmer, use

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/swim_script")
out.mkdir(parents=True, exist_ok=True)

scene = pack(
    Scene(
        title="swimmer, scripted",
        bodies=tuple(swimmer(head=(0.016, 0.015))),
        laws=(
            use("contact_linear", stiffness=2.2e3, damping=1e4),
            use("union", stiffness=1e3, damping=1e3),
            use("bending", stiffness=1.36e-3, damping=1e2, amplitude=math.pi / 4, frequency=9.0),
        ),
        periodic_x=0.05,
        bed=Bed(height=0.03, packing_fraction=0.80, grain_diameter=(1e-3, 2e-3), density=1004.0),
        seed=3,
    )
)
print(scene)

sim = Simulation(scene)
painter = Painter(scene, color="force", width=900)
period = round(1 / 9.0 / sim.dt)  # steps
head = scene.swimmer[0]
for quarter in range(9):
    if quarter:
        sim.advance(period // 4)
    state, contacts = sim.state(), sim.contacts()
    painter.paint(state, contacts)
    painter.save(out / f"swim_{quarter}.png")
    grains = np.array([b.role == "grain" for b in scene.bodies])
    speed = np.hypot(*state.v[grains].T).mean()
    print(
        f"t = {state.t:.4f} s   head at x = {1e3 * state.xy[head, 0]:.2f} mm   "
        f"mean speed of a grain {1e3 * speed:.1f} mm/s   {int((contacts.force > 0).sum())} contacts"
    )
print(f"pictures in {out}")
