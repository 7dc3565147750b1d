"""A pendulum with and without drag: angles over time, and the last state drawn.

python pendulum.py [FOLDER]
"""

import math
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from granswim_pymunk.engine import Simulation
from granswim_pymunk.render import draw_frame
from granswim_pymunk.scene import Body, Scene, use

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/pendulum_script")
out.mkdir(parents=True, exist_ok=True)

length = 0.30  # m
start = math.radians(60)  # from hanging
free = Scene(
    title="pendulum",
    bodies=(
        Body(
            "bob", "free", 0.02, 0.1, initial=(length * math.sin(start), -length * math.cos(start), 0.0, 0.0)
        ),
    ),
    laws=(use("gravity"), use("pin", bodies=["bob"], anchor=(0.0, 0.0), length=length)),
    gravity=(0.0, -9.81),
)
damped = free.with_laws(use("linear_drag", c=0.05))

times = np.linspace(0, 6, 601)
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained", width_ratios=(2.2, 1))
for scene, name, color in ((free, "no drag", "#8b98a3"), (damped, "linear drag, c = 0.05 kg/s", "#b3122a")):
    sim = Simulation(scene)
    xy = sim.sample(times)[:, 0]
    left.plot(times, np.degrees(np.arctan2(xy[:, 0], -xy[:, 1])), color=color, label=name)
    print(f"{name}: rod {1e3 * np.hypot(*xy[-1]):.6f} mm long at the end")
left.set(xlabel="t [s]", ylabel="angle [°]")
left.legend(loc="upper right")
draw_frame(damped, sim.state(), ax=right)
figure.savefig(out / "pendulum.png", dpi=120)
print(f"picture in {out}")
