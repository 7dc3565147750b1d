"""A sweep from a script: the small bed at three frequencies and two packings, with a measurement of one's own.

python sweep_swim.py [FOLDER]
"""

import sys
from dataclasses import replace
from pathlib import Path

import xarray as xr

from granswim_pymunk.run import find_scene
from granswim_pymunk.scene import Scene, read_scene
from granswim_pymunk.sweep import observe, sweep


def build(frequency: float, seed: int) -> Scene:
    """The scene of one run, from the names of the axes."""
    scene = read_scene(find_scene("pocket_swim")).with_parameter("bending.frequency", frequency)
    return replace(scene, seed=seed)


def measure(scene: Scene) -> xr.Dataset:
    """What is kept of one run: here the usual numbers, and how far the tail swings."""
    run = observe(scene, duration=0.3, settle=0.05)
    tail = run["xy"].sel(axis="y").isel(body=-1)
    return run.assign(tail_swing=float(tail.max() - tail.min()))


# worker processes import this file anew: what starts them stands behind this line
if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/sweep_script")
    table = sweep(build, {"frequency": [8.0, 12.0, 16.0], "seed": [1, 2]}, measure, out / "runs")
    print(table["reason"].values)
    for frequency in table["frequency"].values:
        swing = float(table["tail_swing"].sel(frequency=frequency).mean("seed"))
        energy = float(table["kinetic_energy"].sel(frequency=frequency).mean("seed"))
        print(f"{frequency:4g} Hz   tail swings {1e3 * swing:.2f} mm   mean kinetic energy {1e6 * energy:.2f} uJ")
