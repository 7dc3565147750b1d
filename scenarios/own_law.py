"""A law of one's own: one function, its parameters declared, and it runs compiled like those of the package.

The law here is a whirl: it pushes sideways, round a point, as stirring does. It is declared twice, compiled
and as plain Python (which may print, call anything, and be slow), and both give the same path.

    python own_law.py [FOLDER]
"""

import math
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from granswim_pymunk.engine import Simulation
from granswim_pymunk.laws import Parameter, law
from granswim_pymunk.render import draw_frame
from granswim_pymunk.scene import Body, Scene, use

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/own_law_script")
out.mkdir(parents=True, exist_ok=True)

ABOUT = {
    "kind": "body",
    "expression": "F = s (-y, x)/(r + r_c), r = |(x, y)|",
    "reference": "this script",
    "parameters": [
        Parameter("s", "N", "strength of the whirl", low=0.0, typical=1e-4),
        Parameter("core", "m", "radius r_c of its core", low=0.0, default=5e-3),
    ],
}


@law(**ABOUT, strength=["s"])
def whirl(x, y, s, core):
    r = math.sqrt(x * x + y * y)
    return -s * y / (r + core), s * x / (r + core)


calls = 0


@law(**ABOUT, compiled=False)
def whirl_in_python(x, y, s, core):
    global calls
    calls += 1  # plain Python may do what it likes
    r = math.hypot(x, y)
    return -s * y / (r + core), s * x / (r + core)


def stirred(name: str) -> Scene:
    """Four disks that a whirl drives, drag slows and a spring holds."""
    disks = tuple(
        Body(f"disk {k}", "free", 3e-3, 1e-4, initial=(0.01 + 0.008 * k, 0.0, 0.0, 0.0)) for k in range(4)
    )
    return Scene(
        title=f"{name}: four disks in a whirl",
        bodies=disks,
        laws=(
            use(name, s=3e-5),
            use("linear_drag", c=2e-4),
            use("spring", anchor=(0.0, 0.0), stiffness=2e-3),
            use("contact_linear", stiffness=20.0, damping=50.0),
        ),
    )


times = np.linspace(0, 1.0, 101)
paths = {}
for name in ("whirl", "whirl_in_python"):
    scene = stirred(name)
    mode = "verlet" if name == "whirl" else "python"
    sim = Simulation(scene, mode=mode, dt=2e-4)
    paths[name] = sim.sample(times)
    print(f"{name}: ran in {sim.mode} mode")
print(
    f"largest distance between the two paths: {np.abs(paths['whirl'] - paths['whirl_in_python']).max():.1e} m"
)
print(f"the plain function was called {calls} times")

figure, ax = plt.subplots(figsize=(8, 5.4), layout="constrained")
draw_frame(scene, sim.state(), ax=ax, view=(-0.03, 0.04, -0.025, 0.02))
for k in range(4):
    ax.plot(*paths["whirl"][:, k].T, lw=1.2, color="#b3122a", alpha=0.7, zorder=2)
ax.set_title("paths of four disks in a whirl")
figure.savefig(out / "whirl.png", dpi=120)
print(f"picture in {out}")
