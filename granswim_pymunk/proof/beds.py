"""Beds with a swimmer to conceal an effect in: what everybody may know of a case, drawn before the effect.

Of every sort of recording there is a full form (the paper's box of 10 cm x 5 cm, some 2200 grains) and a small one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..packing import pack
from ..scene import Adjustable, Bed, LawUse, Scene, swimmer, use
from .setups import between

SETTLED = 0.06  # s at least before a bed is filmed
# mechanisms of the contract's table that can show in a bed. A torque against the spin alone does not: without
# friction of the contacts nothing spins
SUSPECTS = (
    "linear_drag", "quadratic_drag", "ambient_flow", "added_mass", "coulomb_substrate", "uniform_force",
    "contact_friction", "restitution", "cohesion", "distance_force", "pair_lubrication", "wall_drag",
    "actuator_lag", "actuator_delay", "actuator_saturation", "weak_joint", "resting_curvature",
    "nonlinear_bending", "joint_friction", "head_force",
)  # fmt: skip
OUTSIDE_BED = ("attraction", "phase_drag", "transverse_force")
CAMERAS = ("camera_scale", "time_offset")


@dataclass(frozen=True)
class BedSetup:
    """A swimmer in a bed with its true base numbers, and how it is filmed.

    name : "bed", "unseen" or "curve";  small : the small form
    scene : the swimmer with ``initial``, the bed by its numbers, the laws everybody knows, ``adjustable``
    t : (T,) frame times [s], empty for a curve;  noise [m];  dt : step of the proof's simulator [s]
    drives : frequency [Hz] and layers of each recording, or of each row of a curve
    runs : packings that a row of a curve is the mean of;  lost : share of sightings that are lost
    """

    name: str
    small: bool
    scene: Scene
    t: np.ndarray
    dt: float
    noise: float
    drives: tuple[tuple[float, float], ...]
    runs: int = 1
    lost: float = 0.0
    candidates: tuple[str, ...] = SUSPECTS
    outside: tuple[str, ...] = OUTSIDE_BED
    cameras: tuple[str, ...] = CAMERAS

    @property
    def swimmer(self) -> tuple[str, ...]:
        return tuple(b.id for b in self.scene.bodies if b.role in ("head", "tail"))

    def driven(self, scene: Scene, k: int) -> Scene:
        """The scene of recording (or row) ``k``: its frequency, its layers."""
        frequency, layers = self.drives[k]
        scene = scene.with_parameter("bending.frequency", frequency)
        return scene.with_parameter("confinement.layers", layers) if scene.laws_named("confinement") else scene


def digits(value: float, count: int = 6) -> float:
    return float(f"{value:.{count}g}")


def _laws(rng: np.random.Generator, soft: bool, frequency: float, confined: bool) -> tuple[LawUse, ...]:
    """Contact, union, bending, and perhaps confinement, with jittered numbers; ``soft``: contacts of a tenth."""

    def about(value: float, share: float = 0.1) -> float:
        return digits(value * float(rng.uniform(1 - share, 1 + share)))

    contact, union = ((220.0, 3.2e3), (200.0, 450.0)) if soft else ((2.2e3, 1.0e4), (1.0e3, 1.0e3))
    form = str(rng.choice(["leader", "elastic", "head_axis"], p=[0.8, 0.1, 0.1]))
    laws = [
        use("contact_linear", stiffness=about(contact[0]), damping=about(contact[1])),
        use("union", stiffness=about(union[0]), damping=about(union[1])),
        use("bending", stiffness=digits(2e-3 * between(rng, 0.85, 1.2)), damping=about(100.0),
            amplitude=about(math.pi / 4), frequency=frequency, phase=digits(float(rng.uniform(-0.3, 0.3))), form=form),
    ]  # fmt: skip
    mu = digits(0.11 * between(rng, 0.4, 1.1))
    layers = float(rng.choice([5.0, 8.0, 11.0]))
    if confined:
        laws.append(use("confinement", mu_eff=mu, layers=layers))
    return tuple(laws)


def _box(rng: np.random.Generator, name: str, small: bool) -> tuple[tuple[float, float], float, tuple[float, float]]:
    """Width and height [m], packing fraction, place of the head [m]."""
    if not small:
        box, fraction = (0.100, 0.050), rng.uniform(0.79, 0.805)
    elif name == "bed":
        box, fraction = (0.036, 0.020), rng.uniform(0.78, 0.80)
    else:
        box, fraction = (0.032, 0.016), rng.uniform(0.77, 0.785)
    width = digits(box[0] * float(rng.uniform(0.985, 1.015)), 4)
    height = digits(box[1] * float(rng.uniform(0.985, 1.015)), 4)
    head = (digits((width - 0.018) / 2 + float(rng.uniform(-1, 1)) * 1e-3, 4), digits(height / 2, 4))
    return (width, height), digits(float(fraction), 4), head


def draw_bed(rng: np.random.Generator, name: str, small: bool) -> BedSetup:
    """A bed of sort ``name`` ("bed", "unseen", "curve") with numbers of its own."""
    soft = small and name != "bed"
    (width, height), fraction, head = _box(rng, name, small)
    confined = bool(rng.random() < (0.6 if name == "curve" else 0.35))
    low = 8.0 if small else 7.0
    first = digits(float(rng.uniform(low, 13.0)), 4)
    laws = _laws(rng, soft, first, confined)
    stiffness = float(laws[2].values["stiffness"])
    adjustable: list[Adjustable] = []
    if rng.random() < 0.75:
        adjustable.append(Adjustable("bending", "stiffness", digits(0.5 * stiffness, 3), digits(2.0 * stiffness, 3)))
    if confined and (rng.random() < 0.8 or not adjustable):
        mu = float(laws[3].values["mu_eff"])
        adjustable.append(Adjustable("confinement", "mu_eff", digits(0.2 * mu, 3), digits(4.0 * mu, 3)))
    scene = Scene(
        tuple(swimmer(head=head)), laws, periodic_x=width, adjustable=tuple(adjustable),
        bed=Bed(height, fraction, (1e-3, 2e-3), 1004.0),
    )  # fmt: skip
    rate = round(500.0 * float(rng.uniform(0.98, 1.02)), 2)
    noise = digits(2e-5 * float(rng.uniform(0.95, 1.05)), 3)
    layers = float(laws[3].values["layers"]) if confined else 0.0
    dt = 8e-6 if soft else 3e-6
    lost = float(rng.uniform(0.0, 0.01))
    if name == "bed":
        duration = float(rng.uniform(0.3, 0.45) if small else rng.uniform(0.5, 1.0))
        begin = round(SETTLED + float(rng.uniform(0.0, 0.1)), 4)
        t = np.round(begin + np.arange(int(duration * rate) + 1) / rate, 7)
        return BedSetup(name, small, scene, t, dt, noise, ((first, layers),), lost=lost)
    if name == "unseen":
        count = 2 if small else 4
        grid = np.linspace(low, 14.0, count) + rng.uniform(-0.6, 0.6, count)
        t = np.round(np.arange(int((0.5 if small else 0.8) * rate) + 1) / rate, 7)
        return BedSetup(name, small, scene, t, dt, noise, tuple((digits(float(f), 4), layers) for f in grid), lost=lost)
    if name != "curve":
        raise ValueError(name)
    count = 5 if small else 6
    grid = np.linspace(5.0, 15.0, count) + rng.uniform(-0.5, 0.5, count)
    rows = [(digits(float(f), 4), float(rng.choice([0.0, layers])) if confined else 0.0) for f in grid]
    runs = 4 if small else 3
    outside = tuple(s for s in OUTSIDE_BED if s != "transverse_force")
    return BedSetup(name, small, scene, np.zeros(0), dt, 0.0, tuple(rows), runs, 0.0, SUSPECTS, outside,
                    ("camera_scale",))  # fmt: skip


def packed(scene: Scene, seed: int, cache: bool = False) -> Scene:
    """The scene with a bed from ``seed``, its radii and masses with seven digits."""
    full = pack(replace(scene, seed=seed), cache=cache)
    bodies = tuple(
        replace(b, radius=digits(b.radius, 7), mass=digits(b.mass, 7)) if b.role in ("grain", "wall") else b
        for b in full.bodies
    )
    return replace(full, bodies=bodies, seed=0)
