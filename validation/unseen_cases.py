"""Small recordings of a swimmer whose bed is not seen, made by the reference integrator, each with something concealed.

python -m granswim_pymunk.validation.unseen_cases FOLDER [CASE ...]

The bed is a toy (about 200 soft grains), so that a diagnosis of it takes a minute; the effects are strong.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from granswim_pymunk.packing import pack
from granswim_pymunk.recording import Recording, write_recording
from granswim_pymunk.scene import Adjustable, Bed, Scene, swimmer, use

from .reference import Reference

NOISE = 2e-5  # m
RATE = 500.0  # Hz
DURATION = 0.5  # s
FREQUENCIES = (10.0, 14.0)  # Hz

CASES: dict[str, Callable[[Scene], Scene]] = {
    "nothing": lambda scene: scene,
    "substrate": lambda scene: scene.with_laws(use("coulomb_substrate", mu=0.3)),
    "lag": lambda scene: scene.with_laws(use("actuator_lag", tau=6e-3)),
    "softer": lambda scene: scene.with_parameter("bending.stiffness", 1.6e-3),
}
ADJUSTABLE = ("softer",)  # cases whose recordings say that the bending stiffness may be off


def toy_scene(frequency: float, *, adjustable: bool = False) -> Scene:
    """A swimmer in a bed of about 200 grains, ten times as soft as the paper's, as the experimenter believes it."""
    return Scene(
        title=f"swimmer in a toy bed, {frequency:g} Hz",
        bodies=tuple(swimmer(head=(0.006, 0.008))),
        laws=(
            use("contact_linear", stiffness=2.2e2, damping=3.2e3),
            use("union", stiffness=2e2, damping=4.5e2),
            use("bending", stiffness=2e-3, damping=1e2, amplitude=math.pi / 4, frequency=frequency),
        ),
        periodic_x=0.032,
        bed=Bed(height=0.016, packing_fraction=0.78, grain_diameter=(1e-3, 2e-3), density=1004.0),
        adjustable=(Adjustable("bending", "stiffness", 1e-3, 4e-3),) if adjustable else (),
    )


def make(case: str, frequency: float, seed: int, dt: float = 7e-6) -> Recording:
    """A recording (DURATION at RATE, NOISE on every position) of a case, in the packing of ``seed``."""
    believed = toy_scene(frequency, adjustable=case in ADJUSTABLE)
    true = replace(CASES[case](replace(believed, adjustable=())), seed=seed)
    packed = pack(true)
    t = np.arange(round(DURATION * RATE)) / RATE
    rows = np.array(packed.swimmer)
    xy = Reference(packed, dt=dt).sample(t, rows)
    xy = xy + np.random.default_rng(seed).normal(0.0, NOISE, xy.shape)
    ids = tuple(packed.bodies[k].id for k in rows)
    name = f"{case}_{frequency:g}_Hz"
    return Recording(name, believed, t, ids, xy, title=believed.title, sampling=RATE, position_noise=NOISE)


def main(out: str, *cases: str) -> None:
    for case in cases or CASES:
        for k, frequency in enumerate(FREQUENCIES):
            recording = make(case, frequency, seed=1 + k + 10 * list(CASES).index(case))
            write_recording(recording, Path(out) / recording.name)
            print(recording.name, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
