"""A recording of two arms hung from one another, for tests of laws of joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from granswim_pymunk.joints import place
from granswim_pymunk.recording import Recording, film
from granswim_pymunk.scene import Body, Scene, use

DRAG = 6e-4  # N m s, of the first axle; the second is free


def two_arms(t: np.ndarray) -> Recording:
    """Filmed by their angles at times t (T,) [s], to 0.2 mrad; the scene knows of no friction."""
    arms = (
        Body("arm1", "free", 0.02, 0.09, inertia=4.4e-4), Body("arm2", "free", 0.02, 0.14, inertia=1.3e-3)
    )  # fmt: skip
    hinges = (
        use("hinge", bodies=["arm1"], anchor_a=(0.0, 0.11), anchor=(0.0, 0.0)),
        use("hinge", bodies=["arm1", "arm2"], anchor_a=(0.0, -0.06), anchor_b=(0.0, 0.12)),
    )
    believed = Scene(arms, hinges, gravity=(0.0, -9.81))
    start = place(believed, {"arm1": 0.9, "arm2": 0.5}, {"arm1": 0.0, "arm2": 0.0})
    truth = replace(believed, bodies=tuple(replace(b, initial=start[b.id]) for b in arms))
    seen = film(
        truth.with_laws(use("joint_drag", bodies=["arm1"], c=DRAG)), t, rng=np.random.default_rng(3), angle_noise=2e-4,
        positions=False,
    )  # fmt: skip
    return replace(seen, scene=believed)
