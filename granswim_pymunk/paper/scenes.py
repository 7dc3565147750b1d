"""The paper's system as a scene, every parameter by name."""

from __future__ import annotations

import math
from dataclasses import replace

from ..scene import Bed, Scene, Time, swimmer, use

# N per radian for one unit of the paper's label, 1.36e-3 N for "10^2": with it the free swimmer of label 100 is fastest
# at the table's second resonance (F4 fits this one number; ``readings`` compares)
K_B_PER_LABEL = 1.36e-5
K_B_FIRST = 2.0e-5  # the same, as first taken: an independent code had its optimum near 9 to 11 Hz with it
# s/m: a third of the free speed at 11 layers and 9 Hz (F3a measures it; 0.16 with K_B_FIRST); the paper prints 0.22
MU_EFF = 0.13
LAYERS = {1: 5, 2: 11, 3: 18}  # height of the bed [cm]: layers of grains above
AMPLITUDE = math.pi / 4
RADIUS = 1.5e-3  # m, of a swimmer's disk
DISKS = 7
HEAD_MASS_FACTOR = 7.0
DENSITY = 1004.0  # kg/m^3
STIFFNESS = 2.2e3  # N/m, of a contact
CONTACT_DAMPING = 1.0e4  # 1/s
UNION_STIFFNESS = 1.0e3  # N/m
STEP = 4e-6  # s, converged for these stiffnesses


def bending_stiffness(k_B: float, k_B_scale: float = 1.0) -> float:
    """Bending force per radian [N] of a label, to ten digits: equal stiffnesses reached in two ways are one scene."""
    return float(f"{k_B * K_B_PER_LABEL * k_B_scale:.10g}")


def paper_scene(
    *,
    frequency: float = 9.0,
    k_B: float = 100.0,
    layers: float = 0.0,
    seed: int = 0,
    mu_eff: float = MU_EFF,
    form: str = "leader",
    gamma_B: float = 1.0e2,
    k_B_scale: float = 1.0,
    grain_diameter: float = 1.5e-3,
    width: float = 0.100,
    height: float = 0.050,
    packing_fraction: float = 0.80,
    softness: float = 25.0,
    dt: float = 0.0,
    stored: str = "",
) -> Scene:
    """The swimmer in its bed (the bed still to be packed).

    frequency [Hz]; k_B: the paper's label (100, 150, 200, 500), times ``k_B_scale`` times ``K_B_PER_LABEL``;
    layers of grains above (0: free) with mu_eff [s/m]; seed of the packing; form and gamma_B [1/s] of the
    bending law; mean grain_diameter [m], uniform between 2/3 and 4/3 of it; box width x height [m];
    packing_fraction with the swimmer counted.

    softness s: contacts s times softer than 2.2e3 N/m with the dashpot reduced by sqrt(s), so that the
    restitution stays, the union by up to ten, and a step sqrt(s) times longer (4e-6 s at s = 1). dt [s]
    overrides the step where above zero. How far this changes the free speed is part of the results.

    stored : start from this stored bed (``validation.crosscheck``) of another code, as it was packed there; its seed,
    grains and box are then its own.
    """
    root = math.sqrt(softness)
    laws = [
        use("contact_linear", stiffness=STIFFNESS / softness, damping=CONTACT_DAMPING / root),
        use("union", stiffness=UNION_STIFFNESS / min(softness, 10.0), damping=1.0e3),
        use(
            "bending", stiffness=bending_stiffness(k_B, k_B_scale), damping=gamma_B, amplitude=AMPLITUDE,
            frequency=frequency, form=form,
        ),
    ]  # fmt: skip
    if layers > 0 and mu_eff > 0:
        laws.append(use("confinement", mu_eff=mu_eff, layers=layers))
    if stored:
        from ..validation.crosscheck import read_bed

        bed = read_bed(stored).scene
        time = replace(bed.time, dt=dt if dt > 0 else STEP * root)
        return replace(bed, title=f"{stored} at {frequency:g} Hz", laws=tuple(laws), time=time, seed=seed)
    return Scene(
        title=f"swimmer at {frequency:g} Hz, k_B {k_B:g}, {layers:g} layers, seed {seed}",
        bodies=tuple(
            swimmer(
                disks=DISKS, radius=RADIUS, density=DENSITY, head_mass_factor=HEAD_MASS_FACTOR,
                head=(width / 2 - (DISKS - 1) * RADIUS, height / 2),
            )
        ),
        laws=tuple(laws),
        periodic_x=width,
        bed=Bed(height, packing_fraction, (grain_diameter * 2 / 3, grain_diameter * 4 / 3), DENSITY, float(layers)),
        time=Time(dt=dt if dt > 0 else STEP * root, scheme="half_step"),  # the paper's own scheme
        seed=seed,
    )  # fmt: skip
