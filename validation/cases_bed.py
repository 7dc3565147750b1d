"""Beds: energy and momentum, and the engine's modes against the reference and against another code."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from granswim_pymunk.scene import Body, LawUse, Scene, swimmer, use

from .cases_bodies import MASS, one_body
from .cases_contact import sphere_mass
from .crosscheck import crosscheck, read_bed
from .results import Case, Figure, Line, Panel, drift, runner

STIFFNESS, DAMPING = 2.2e3, 1.0e4  # N/m, 1/s
BED = "bed_9Hz"
# what each mode must reach against the other code: steps -> bound [m]
BED_BOUNDS = {
    "verlet": {100: 1e-12, 1000: 1e-9},
    "chipmunk": {100: 1e-12, 1000: 1e-9},
    "reference": {100: 1e-12, 1000: 1e-9},
    "batch": {100: 1e-12, 1000: 1e-9},
    "python": {10: 1e-12},
}


def contact_energy(scene: Scene, xy: np.ndarray, stiffness: float) -> float:
    """k_C/2 sum overlap^2 [J] at positions (n, 2) [m]; two walls and two disks of a swimmer do not touch."""
    radius = np.array([body.radius for body in scene.bodies])
    wall = np.array([not body.mobile for body in scene.bodies])
    disk = np.array([body.role in ("head", "tail") for body in scene.bodies])
    points, box = xy.copy(), None
    if scene.periodic_x is not None:
        points[:, 0] = np.mod(points[:, 0], scene.periodic_x)
        points[points[:, 0] >= scene.periodic_x, 0] = 0.0
        points[:, 1] -= points[:, 1].min()
        box = [scene.periodic_x, 10 * float(points[:, 1].max()) + 1.0]
    pairs = cKDTree(points, boxsize=box).query_pairs(2 * float(radius.max()), output_type="ndarray")
    i, j = pairs[:, 0], pairs[:, 1]
    r = xy[j] - xy[i]
    if scene.periodic_x is not None:
        r[:, 0] -= scene.periodic_x * np.round(r[:, 0] / scene.periodic_x)
    overlap = np.maximum(radius[i] + radius[j] - np.hypot(r[:, 0], r[:, 1]), 0.0)
    overlap[(wall[i] & wall[j]) | (disk[i] & disk[j])] = 0.0
    return 0.5 * stiffness * float(overlap @ overlap)


def elastic_bed(mode: str = "verlet", quick: bool = False, n_steps: int = 50_000) -> Case:
    """Energy of an undamped bed that streams across the periodic seam, over ``n_steps`` (a third if quick).

    The grains of the shipped bed without its swimmer, with a mean flow of 0.2 m/s and random velocities.
    Energy = kinetic + k_C/2 sum overlap^2, velocities synchronised.
    """
    rng = np.random.default_rng(11)
    bed = read_bed(BED).scene
    bodies = []
    for body in bed.bodies:
        if body.role in ("grain", "wall") and body.initial is not None:
            vx, vy = rng.normal(0.0, 0.03, 2).tolist() if body.mobile else (-0.2, 0.0)
            bodies.append(replace(body, initial=(*body.initial[:2], vx + 0.2, vy)))
    scene = Scene(tuple(bodies), (use("contact_linear", stiffness=STIFFNESS),), periodic_x=bed.periodic_x)
    mass = np.array([body.mass if body.mobile else 0.0 for body in scene.bodies])
    run = runner(scene, mode, 1e-6)
    every = (n_steps // 3 if quick else n_steps) // 200
    t, energy = [], []
    start = run.state().xy
    for k in range(201):
        state = run.state()
        kinetic = 0.5 * float(mass @ (state.v**2).sum(axis=1))
        energy.append(kinetic + contact_energy(scene, state.xy, STIFFNESS))
        t.append(state.t)
        if k < 200:
            run.advance(every)
    period = scene.periodic_x or math.inf
    # leapfrog keeps an energy that differs from this one by about (omega dt)^2/8 of that in contacts:
    # as the flow turns to heat and contacts multiply the deviation follows, and stays where they do
    crossed = int((np.floor(state.xy[:, 0] / period) != np.floor(start[:, 0] / period)).sum())
    e = np.array(energy)
    name = f"{200 * every} steps"
    return Case(
        f"elastic bed across the seam ({mode})",
        (
            Figure(f"energy over {name}, largest deviation", float(np.abs(e / e[0] - 1).max()), 2e-3),
            Figure(f"energy over {name}, drift", float(abs(drift(np.array(t), e)) / e[0]), 2e-4),
            Figure(
                "lacking of 50 grains across the seam",
                max(0.0, 50.0 - crossed),
                0.0,
                "1",
                f"{crossed} crossed",
            ),
        ),
        (
            Panel(
                "energy of an elastic bed",
                "t [s]",
                "E/E(0) - 1",
                [Line(mode, np.array(t), e / e[0] - 1, "-")],
            ),
        ),
    )


def momentum(mode: str = "verlet", quick: bool = False) -> Case:
    """Momentum of a swimming swimmer among grains without walls or drag, against the sum of all sizes."""
    scene = small_bed(walls=False)
    scene = replace(scene, laws=tuple(item for item in scene.laws if item.name != "confinement"))
    mass = np.array([[body.mass] for body in scene.bodies])
    run = runner(scene, mode, 2e-6)
    before = run.state().v
    run.advance(500)
    after = run.state().v
    size = float((mass * np.abs(after)).sum())
    change = float(np.abs((mass * (after - before)).sum(axis=0)).max()) / size
    exchanged = float(np.abs(mass * (after - before)).sum()) / size
    return Case(
        f"momentum of a bed ({mode})",
        (
            Figure(
                "momentum over 500 steps", change, 1e-12, note=f"share that changed hands: {exchanged:.2g}"
            ),
        ),
    )


def small_bed(
    walls: bool = True, form: str = "leader", contact: LawUse | None = None, speed: float = 0.2
) -> Scene:
    """A swimmer of five disks in some eighty grains, periodic along x, jittered from a fixed seed."""
    rng = np.random.default_rng(3)
    spacing, columns, rows = 1.7e-3, 14, 9
    period = spacing * columns
    disks = swimmer(disks=5, head=(0.3 * period, 0.5 * rows * spacing * math.sqrt(3) / 2))
    at = np.array([disk.initial[:2] for disk in disks if disk.initial is not None])
    bodies = list(disks)
    for row in range(rows):
        for column in range(columns):
            x = (column + 0.5 * (row % 2)) * spacing
            y = row * spacing * math.sqrt(3) / 2
            edge = row in (0, rows - 1)
            radius = float(rng.uniform(0.8, 0.86)) * 1e-3
            if not edge:
                x, y = (np.array([x, y]) + rng.normal(0.0, 2e-5, 2)).tolist()
            dx = x - at[:, 0]
            dx -= period * np.round(dx / period)
            if np.hypot(dx, y - at[:, 1]).min() < 1.5e-3 + 0.98 * radius or (edge and not walls):
                continue
            vx, vy = (0.0, 0.0) if edge else rng.normal(0.0, speed, 2).tolist()
            role = "wall" if edge else "grain"
            # some start a period away: positions may be unwrapped
            x += period * (int(rng.integers(-1, 2)) if role == "grain" else 0)
            name = f"{role}{row}.{column}"
            bodies.append(Body(name, role, radius, sphere_mass(radius), initial=(x, y, vx, vy)))
    return Scene(
        tuple(bodies),
        (
            contact or use("contact_linear", stiffness=STIFFNESS, damping=DAMPING),
            use("union", stiffness=1e3, damping=1e3),
            use("bending", stiffness=2e-3, damping=1e2, amplitude=math.pi / 4, frequency=60.0, form=form),
            use("confinement", mu_eff=0.11, layers=11),
        ),
        periodic_x=period,
    )


_REFERENCES: dict[tuple[str, float, int, str], np.ndarray] = {}  # where its runs end: the same beside each mode


def _apart(scene: Scene, mode: str, dt: float, n_steps: int) -> float:
    # where a bed has rails or drives the first half kick is a matter of definition (by a multiple of
    # gamma a dt^2): there the velocities are taken as half-step ones
    held = len(scene.bodies) > 10 and any(item.law.kind == "constraint" for item in scene.laws)
    start = "leapfrog" if held else "synchronised"
    run = runner(scene, mode, dt, start)
    run.advance(n_steps)
    key = scene.hash, dt, n_steps, start
    if key not in _REFERENCES:
        other = runner(scene, "reference", dt, start)
        other.advance(n_steps)
        _REFERENCES[key] = other.state().xy
    return float(np.abs(run.state().xy - _REFERENCES[key]).max())


def against_reference(mode: str = "verlet", quick: bool = False) -> Case:
    """The engine beside the reference integrator: a small periodic bed under each set of laws.

    Same scheme, other code: they part by rounding only. A pin differs by method (rod constraint here,
    angle there), so it agrees to second order of the step; Chipmunk's impulses to first order.
    """
    n_steps = 20 if quick and mode == "python" else 200
    scenes: list[tuple[str, Scene, float, int, float]] = [
        (f"bed, bending {form}", small_bed(form=form), 2e-6, n_steps, 1e-12)
        for form in ("leader", "elastic", "head_axis")
    ]
    hertz = use("contact_hertz", stiffness=1e5, damping=DAMPING)
    scenes.append(("bed, contact_hertz", small_bed(contact=hertz), 2e-6, n_steps, 1e-12))
    bed = small_bed().with_laws(
        use("linear_drag", c=5e-5, p=1),
        use("quadratic_drag", c=1e-3, p=2),
        use("coulomb_substrate", mu=0.3),
        use("gravity"),
        use("uniform_force", a=(0.5, 0.2), bodies=["0", "1"]),
        use("spring", anchor=(0.02, 0.0), stiffness=0.1, length=0.01, bodies=["0"]),
        use("rail", direction=(1.0, 0.5), bodies=["2"]),
    )
    bed = replace(bed, gravity=(0.3, -9.7))
    x, y = bed.body("2").initial[:2]  # type: ignore[index]
    bed = bed.with_initial({"2": (x, y, 0.02, 0.01)})
    scenes.append(("bed, drags, fields, spring, rail", bed, 2e-6, n_steps, 1e-12))
    last = [body.id for body in bed.bodies if body.role == "grain"][-1]
    command = tuple(np.linspace(0.0, 1e-3, 6).tolist()), (0.0, 0.3, -0.2, 0.4, 0.4, 0.0)
    drive = replace(
        small_bed().with_laws(use("drive", bodies=[last], direction=(0.6, 0.8))), inputs={last: command}
    )
    x, y = drive.body(last).initial[:2]  # type: ignore[index]
    first = 0.3 / 2e-4 * 1e-6  # the command in the middle of the first step
    drive = drive.with_initial({last: (x, y, 0.6 * first, 0.8 * first)})
    scenes.append(("bed, driven grain", drive, 2e-6, n_steps, 1e-12))
    pin = one_body(
        use("gravity"),
        use("linear_drag", c=5e-3),
        use("pin", bodies=["ball"], anchor=(0.1, 0.2), length=0.3),
        initial=(0.1 + 0.3 * math.sin(1.2), 0.2 - 0.3 * math.cos(1.2), 0.0, 0.0),
        gravity=(0.0, -9.81),
        inertia=4e-4,
    )
    scenes.append(("pin with inertia", pin, 1e-4, 1000 if quick else 4000, 1e-6))
    bounce = Scene(
        (
            Body("floor", "wall", 0.1, MASS, initial=(0.0, -0.1, 0.0, 0.0)),
            Body("low", "free", 0.01, MASS, initial=(0.0, 0.02, 0.0, 0.0)),
            Body("high", "free", 0.008, MASS / 2, initial=(0.0, 0.05, 0.0, 0.0)),
        ),
        (use("gravity"), use("rail", direction=(0.0, 1.0)), use("contact_elastic", restitution=0.7)),
        gravity=(0.0, -9.81),
    )
    # until the low one rests: an impact on a disk at rest on the floor is two impacts in turn for the reference,
    # one of three bodies for Chipmunk
    whole_steps = 1e-4 if mode in ("python", "batch") else 1e-7  # an impact there is up to a step late
    scenes.append(("contact_elastic, two falling disks", bounce, 1e-5, 8_000 if quick else 16_000, whole_steps))
    alone = replace(bounce, bodies=bounce.bodies[:2])
    scenes.append(("contact_elastic, a disk that comes to rest", alone, 1e-5, 30_000, 1e-7))
    figures = [
        Figure(name, _apart(scene, mode, dt, n), bound, "m", f"{n} steps")
        for name, scene, dt, n, bound in scenes
    ]
    return Case(f"{mode} against the reference", figures)


def against_other_code(mode: str = "verlet", quick: bool = False) -> Case:
    """The shipped bed, computed by an independent code."""
    bounds = BED_BOUNDS[mode]
    if quick and mode in ("chipmunk", "batch"):
        bounds = {100: bounds[100]}
    found = {d.steps: d.max_position_error for d in crosscheck(BED, mode, most=max(bounds))}
    figures = [
        Figure(f"{BED} after {steps} steps", found[steps], bound, "m") for steps, bound in bounds.items()
    ]
    line = Line(mode, np.array(list(found)), np.array(list(found.values())))
    panel = Panel(f"{BED} against another code", "steps", "largest deviation [m]", (line,), "xy")
    return Case(f"{mode} against another code", figures, (panel,))
