"""Films of a small bed with something hidden in it, by the reference integrator: python tests/data/make_small_beds.py

A swimmer among some 300 grains in a box that is just wide enough, 0.26 s at 500 frames a second with 20 micrometres
of noise, told as the scene without what was hidden. Positions are kept to a micrometre. Takes minutes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from granswim_pymunk.packing import pack
from granswim_pymunk.recording import Recording, write_recording
from granswim_pymunk.scene import Adjustable, Bed, Scene, read_scene, use
from granswim_pymunk.validation.reference import Reference

HERE = Path(__file__).parent
POCKET = HERE.parent.parent / "scenarios" / "pocket_swim.toml"
NOISE = 2.0e-5  # m
RATE = 500.0  # Hz
DURATION = 0.26  # s
SETTLE = 0.06  # s, before the camera runs

HIDDEN: dict[str, Callable[[Scene], Scene]] = {
    "small_joint": lambda s: s.with_laws(use("weak_joint", factor=0.4, joint=4)),
    "small_stiffness": lambda s: s.with_parameter("bending.stiffness", 1.5e-3),
    "small_nothing": lambda s: s,
}


def small_bed(seed: int) -> Scene:
    """The packed pocket bed, just wide and high enough for the swimmer."""
    scene = replace(read_scene(POCKET), seed=seed)
    assert isinstance(scene.bed, Bed)
    scene = replace(scene, bed=replace(scene.bed, height=0.020), periodic_x=0.036)
    starts = [b.initial for b in scene.bodies if b.initial is not None]
    lower = float(np.mean([s[1] for s in starts])) - 0.010
    bodies = tuple(
        replace(b, initial=(b.initial[0] - 0.003, b.initial[1] - lower, 0.0, 0.0)) if b.initial else b
        for b in scene.bodies
    )
    return pack(replace(scene, bodies=bodies))


def make(name: str, seed: int) -> None:
    """Simulate, film and write one of ``HIDDEN``."""
    scene = small_bed(seed)
    t = SETTLE + np.arange(round(RATE * DURATION) + 1) / RATE
    xy = Reference(HIDDEN[name](scene), dt=4e-6).sample(t)
    mobile = np.array([b.mobile for b in scene.bodies])
    rng = np.random.default_rng(seed)
    seen = np.round(xy[:, mobile] + rng.normal(0.0, NOISE, xy[:, mobile].shape), 6)
    believed = replace(
        scene,
        bed=None,
        time=replace(scene.time, dt=None),
        adjustable=(Adjustable("bending", "stiffness", 1e-3, 4e-3),),
        bodies=tuple(replace(b, initial=None) if b.mobile else b for b in scene.bodies),
    )
    ids = tuple(b.id for b in scene.bodies if b.mobile)
    write_recording(Recording(name, believed, t, ids, seen, sampling=RATE, position_noise=NOISE), HERE / name)
    (HERE / name / "tracks.csv").unlink()
    np.savez_compressed(HERE / name / "tracks.npz", t=t, body=np.array(ids), xy=seen.astype(np.float32))


if __name__ == "__main__":
    for number, chosen in enumerate(sys.argv[1:] or HIDDEN, start=1):
        make(chosen, number)
