"""Why is my simulated swimmer too fast? All that is known is its speed against frequency.

A curve.csv is made here from a swimmer whose grains rub against each other; the simulation believes them smooth.
With a curve of your own, put it beside a recording.toml and call ``granswim diagnose FOLDER --out DIR``.

python -m granswim_pymunk.scenarios.speed_curve [FOLDER] [SCENE]
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from granswim_pymunk.engine import Simulation
from granswim_pymunk.inference.entry import diagnose
from granswim_pymunk.packing import pack
from granswim_pymunk.recording import Recording, write_recording
from granswim_pymunk.recording.recording import CURVE
from granswim_pymunk.run import find_scene
from granswim_pymunk.scene import Scene, Time, read_scene, use

FREQUENCIES = (5.0, 7.0, 9.0, 11.0, 13.0, 15.0)  # Hz
PACKINGS = 5  # swimmers measured at each frequency


def measure(believed: Scene) -> np.ndarray:
    """Mean speed after the first half second, head first positive, and its standard error, at each frequency."""
    rows = []
    masses = np.array([believed.bodies[k].mass for k in believed.swimmer])
    for frequency in FREQUENCIES:
        speeds = []
        for packing in range(PACKINGS):
            scene = replace(believed.with_parameter("bending.frequency", frequency), seed=200 + packing)
            true = pack(scene).with_laws(use("contact_friction", mu=0.3))
            xy = Simulation(true).sample(np.array([0.5, 1.1]), list(true.swimmer))
            x = xy[..., 0] @ masses / masses.sum()
            speeds.append(-(x[1] - x[0]) / 0.6)  # the head points along -x
        sem = np.std(speeds, ddof=1) / np.sqrt(PACKINGS)
        rows.append((frequency, 0.0, np.mean(speeds), sem, PACKINGS))
        print(f"{frequency:g} Hz: {1e3 * rows[-1][2]:.1f} +- {1e3 * sem:.1f} mm/s", flush=True)
    return np.array(rows, dtype=CURVE)


def main(out: str = "out/speed_curve", scene: str = "swim") -> None:
    believed = replace(read_scene(find_scene(scene)), time=Time(), frames={})
    nothing = np.empty(0), (), np.empty((0, 0, 2))
    curve = Recording("curve", believed, *nothing, curve=measure(believed))
    write_recording(curve, Path(out) / "curve")

    def tell(text: str, share: float) -> None:
        print(f"[{100 * share:3.0f} %] {text}", end="\r", flush=True)

    verdict = diagnose([Path(out) / "curve"], Path(out) / "diagnosis", progress=tell).verdict
    print(f"\nverdict: {verdict['verdict']}")
    for entry in verdict["mechanisms"]:
        print(f"  {entry['name']}: {entry['expression']}")
    same = [rival["name"] for rival in verdict["rivals"] if rival["indistinguishable"]]
    if same:
        print(f"  the curve cannot tell it from {', '.join(same)}")
    if verdict["next_experiment"]:
        print(f"  next: {verdict['next_experiment']['change']}")


if __name__ == "__main__":
    main(*sys.argv[1:])
