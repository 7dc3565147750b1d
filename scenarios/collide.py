"""Two disks collide head on: restitution and duration against the formula, and a picture of before and after.

python collide.py [FOLDER]
"""

import math
import sys
from pathlib import Path

import numpy as np

from granswim_pymunk.engine import Simulation
from granswim_pymunk.render import draw_frame
from granswim_pymunk.scene import Body, Scene, use

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/collide_script")
out.mkdir(parents=True, exist_ok=True)

radius, mass, speed = 3e-3, 1.1e-4, 0.2  # m, kg, m/s
stiffness, damping = 2.2e3, 1e3  # N/m, 1/s
scene = Scene(
    title="head-on collision",
    bodies=(
        Body("left", "free", radius, mass, initial=(-3.5e-3, 0.0, speed, 0.0)),
        Body("right", "free", radius, mass, initial=(3.5e-3, 0.0, -speed, 0.0)),
    ),
    laws=(use("contact_linear", stiffness=stiffness, damping=damping),),
)

sim = Simulation(scene, dt=1e-7)
draw_frame(scene, sim.state(), path=out / "before.png", width=700)
touching = []
while sim.t < 5e-3:
    sim.advance(10)
    if len(sim.contacts().i):
        touching.append(sim.t)
after = sim.state()
draw_frame(scene, after, path=out / "after.png", width=700)

# x'' = -(k/m_r) x - gamma x' until x = 0 again
reduced = mass / 2
omega = math.sqrt(stiffness / reduced - (damping / 2) ** 2)
bounce, formula = np.diff(after.v[:, 0])[0] / (2 * speed), math.exp(-damping / 2 * math.pi / omega)
print(f"restitution {bounce:.5f}, formula {formula:.5f}")
print(f"duration {1e6 * (touching[-1] - touching[0] + 1e-6):.1f} us, formula {1e6 * math.pi / omega:.1f} us")
print(f"momentum left {float((mass * after.v).sum()):.1e} kg m/s")
print(f"pictures in {out}")
