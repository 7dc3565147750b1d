"""A candidate of one's own: a disk on a table swings where it should glide, and a hidden tether is the guess.

The recording is written down from the solution of m x'' = -k (x - x_0), y'' = 0, with 20 micrometres of noise; the
scene has no force at all. The candidate is declared as a law and tried beside the candidates of the package.

    python candidate.py [FOLDER]
"""

import sys
from pathlib import Path

import numpy as np

from granswim_pymunk.inference import diagnose
from granswim_pymunk.laws import Parameter, law
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/candidate")


@law(
    kind="body",
    expression="F = -k (x - x_0), along x only",
    reference="a tether seen in the laboratory and not in the scene",
    parameters=[
        Parameter("k", "N/m", "stiffness of the tether", low=0.0, typical=1.0),
        Parameter("x_0", "m", "where it is slack", default=0.0),
    ],
    strength=("k",),
    candidate="named",
)
def tether(x, k, x_0):
    return -k * (x - x_0), 0.0


mass, stiffness = 0.2, 3.7
t = np.arange(0.0, 2.0, 0.01)
omega = np.sqrt(stiffness / mass)
xy = np.stack([0.05 * np.cos(omega * t) + 0.1 / omega * np.sin(omega * t), 0.02 + 0.06 * t], axis=1)
xy += np.random.default_rng(1).normal(0.0, 2e-5, xy.shape)
disk = Body("disk", "free", radius=0.02, mass=mass)
recording = Recording(
    name="table", scene=Scene((disk,)), t=t, ids=("disk",), xy=xy[:, None, :], position_noise=2e-5, sampling=100.0
)

verdict = diagnose([recording], out).verdict
print(verdict["verdict"])
for entry in verdict["mechanisms"]:
    k = entry["parameters"].get("k", {})
    print(f"{entry['name']}: {entry['expression']}, central 95 % {k.get('low'):.3f} to {k.get('high'):.3f} N/m")
print(f"true stiffness {stiffness} N/m; the report is {out / 'report.html'}")
