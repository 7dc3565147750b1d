"""A motor drives a cart, and the cart is not where the command would have it: why?

The cart is filmed at 100 frames a second; the command is known. The simulation that makes the film gives the motor a
lag that the scene does not know. A driven body needs no bed and no second body: command and film are enough.

    python late_motor.py [FOLDER]
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from granswim_pymunk.engine import Simulation
from granswim_pymunk.inference import diagnose
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Body, Scene, use

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/late_motor")
lag = 0.02  # s

# what I believe: the cart follows the commanded velocity exactly, along its rail
t = np.arange(0.0, 2.2, 0.002)
command = 0.1 * np.sin(7.0 * t) + 0.05 * np.sin(17.0 * t)
believed = Scene(
    bodies=(Body("cart", "free", radius=0.02, mass=0.3, initial=(0.0, 0.0, 0.0, 0.0)),),
    laws=(use("rail", direction=(1.0, 0.0)), use("drive", bodies=["cart"])),
    inputs={"cart": (tuple(t), tuple(command))},
)

# what is there
true = believed.with_laws(use("actuator_lag", tau=lag))
filmed = film(
    Simulation(true, dt=1e-3), np.arange(0.0, 2.0, 0.01), rng=np.random.default_rng(3), noise=2e-5, name="late_cart"
)
bodies = (replace(believed.bodies[0], initial=None),)

verdict = diagnose([replace(filmed, scene=replace(believed, bodies=bodies))], out).verdict
print(verdict["verdict"])
for entry in verdict["mechanisms"]:
    for name, value in entry["parameters"].items():
        print(f"{entry['name']} of the {entry['bodies'][0]}: {name} = {value['value']:.4g} {value['unit']}, "
              f"95 % {value['low']:.4g} to {value['high']:.4g} (true: {lag} s)")  # fmt: skip
print(f"report: {out / 'report.html'}")
