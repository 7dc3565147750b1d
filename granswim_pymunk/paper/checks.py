"""Checks of the measuring itself: fields, stress and work against what is known exactly."""

from __future__ import annotations

import functools
import math

import numpy as np
from matplotlib.figure import Figure

from ..analysis.contacts import find_contacts
from ..analysis.fields import Grid, coarse_grain
from ..analysis.work import Audit, power_audit
from ..engine import Simulation
from ..packing import pack
from ..scene import Bed, Body, Scene, use
from .claim import FAILS, HOLDS, Claim, Finding
from .results import Results
from .scenes import paper_scene

SMALL = {"width": 0.036, "height": 0.024, "softness": 25.0, "seed": 2}  # a bed in which a swimmer just fits


@functools.lru_cache(maxsize=4)
def fractions(height: float = 0.050, width: float = 0.100, seed: int = 1) -> tuple[float, float]:
    """Solid fraction of a packed bed with its swimmer over the box: coarse-grained, and from the areas."""
    scene = pack(paper_scene(height=height, width=width, seed=seed))
    mobile = np.array([b.mobile for b in scene.bodies])
    xy = np.array([b.initial[:2] for b in scene.bodies if b.initial is not None])[mobile]
    mass, radius = np.array([(b.mass, b.radius) for b in scene.bodies])[mobile].T
    cells = round(width / 5e-4)
    grid = Grid(0.0, -4e-3, width / cells, cells, round((height + 8e-3) * cells / width))
    found = coarse_grain(grid, 7.5e-4, xy, np.zeros_like(xy), mass, radius, None, width)
    box = width * height
    return float(found.fraction.sum()) * grid.spacing**2 / box, math.pi * float((radius**2).sum()) / box


@functools.lru_cache(maxsize=1)
def squeezed() -> tuple[float, float]:
    """Contact stress s_yy inside a bed squeezed beyond jamming and at rest, and the force on its wall per length.

    Both [N/m]; the second from the contacts of the wall alone.
    """
    scene = pack(
        Scene(
            bodies=(Body("probe", "free", 1e-3, 4e-6, initial=(0.006, 0.008, 0, 0)),),
            laws=(use("contact_linear", stiffness=100.0, damping=2e3), use("linear_drag", c=2e-4)),
            periodic_x=0.02, bed=Bed(0.018, 0.84, (1e-3, 2e-3), 1004.0), seed=4,
        )
    )  # fmt: skip
    closer = {
        b.id: (b.initial[0], b.initial[1] + (4e-4 if b.initial[1] < 0 else -4e-4), 0.0, 0.0)
        for b in scene.bodies if b.role == "wall" and b.initial is not None
    }  # fmt: skip
    scene = scene.with_initial(closer)
    assert scene.periodic_x is not None
    sim = Simulation(scene, dt=1e-5)
    sim.advance(30000)
    state = sim.state()
    contacts = find_contacts(scene, state.xy, state.v)
    top = np.array([b.role == "wall" and b.initial is not None and b.initial[1] > 0.009 for b in scene.bodies])
    on_wall = top[contacts.i] != top[contacts.j]
    push = contacts.force[on_wall] * np.where(top[contacts.j], 1, -1)[on_wall] * contacts.normal[on_wall, 1]
    mobile = np.array([b.mobile for b in scene.bodies])
    mass, radius = np.array([(b.mass, b.radius) for b in scene.bodies]).T
    branch = contacts.normal * (radius[contacts.i] + radius[contacts.j] - contacts.overlap)[:, None]
    found = coarse_grain(
        Grid(0.0, 0.005, 2.5e-4, 80, 32), 7.5e-4, state.xy[mobile], state.v[mobile], mass[mobile], radius[mobile],
        (state.xy[contacts.i], branch, contacts.normal * contacts.force[:, None]), scene.periodic_x,
    )  # fmt: skip
    return float(found.contact_yy.mean()), float(push.sum()) / scene.periodic_x


@functools.lru_cache(maxsize=1)
def audited(steps: int = 1500) -> Audit:
    """Power audit of a swimmer under confinement in a small bed."""
    sim = Simulation(pack(paper_scene(layers=11, **SMALL)))  # type: ignore[arg-type]
    sim.advance(4000)
    return power_audit(sim, steps)


def judge(results: Results) -> list[Finding]:
    fields, areas = fractions()
    stress, wall = squeezed()
    audit = audited()
    rows = (
        (
            "coarse-grained solid fraction is the area fraction over the box, to 1 %", fields / areas - 1, 1e-2,
            f"{fields:.5f} from the field, {areas:.5f} from the areas", "the bed of the main text, packing 1",
        ),
        (
            "contact stress of a bed compressed and at rest is the force on its wall, to 1 %", stress / wall - 1, 1e-2,
            f"{stress:.4f} N/m inside, {wall:.4f} N/m on the wall", "squeezed beyond jamming, damped to rest",
        ),
        (
            "work of all laws is the change of kinetic energy, to 0.1 % of the input", audit.residual, 1e-3,
            f"input {audit.input:.4g} J, " + ", ".join(f"{name} {work:+.2g}" for name, work in audit.work.items())
            + f", kinetic energy {audit.kinetic:+.2g} J",
            "a swimmer under confinement in a small bed; forces by code that the engine does not share",
        ),
    )  # fmt: skip
    return [
        Finding(
            says=says, measured=f"{text}: differs by {100 * abs(off):.2g} %",
            verdict=HOLDS if abs(off) < bound else FAILS, value=off, note=note,
        )
        for says, off, bound, text, note in rows
    ]  # fmt: skip


def draw(results: Results) -> Figure | None:
    return None


CLAIM = Claim("checks", "Fields, stress and work against what is known", "appendix B", (), judge, draw)
