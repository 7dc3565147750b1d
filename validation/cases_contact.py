"""Collisions of two disks, and of a disk with a wall, against closed solutions."""

from __future__ import annotations

import math

import numpy as np

from granswim_pymunk.scene import Body, LawUse, Scene, use

from .analytic import hertz_duration, linear_duration, linear_restitution
from .results import Case, Figure, Line, Panel, crossings, runner

DENSITY = 1004.0  # kg/m^3
STIFFNESS, DAMPING = 2.2e3, 1.0e4  # N/m, 1/s
HERTZ = 1.0e5  # N/m^1.5
RESTITUTION = 0.8


def sphere_mass(radius: float) -> float:
    """[kg] of a grain."""
    return DENSITY * 4 / 3 * math.pi * radius**3


def collision_scene(law: LawUse, *, wall: bool, speed: float, gap: float, oblique: bool = False) -> Scene:
    """A disk flying at a slightly larger one at rest (or at a wall disk), ``gap`` [m] before the contact."""
    small, large = 0.7e-3, 0.9e-3
    angle = 0.3 if oblique else 0.0
    n = np.array([math.cos(angle), math.sin(angle)])
    x, y = -(small + large + gap) * n
    vx, vy = speed * n
    return Scene(
        bodies=(
            Body("moving", "free", small, sphere_mass(small), initial=(x, y, vx, vy)),
            Body("hit", "wall" if wall else "free", large, sphere_mass(large), initial=(0.0, 0.0, 0.0, 0.0)),
        ),
        laws=(law,),
    )


def reduced_mass(scene: Scene) -> float:
    """m_r [kg] of the scene's two bodies; that of the mobile one against a wall."""
    a, b = scene.bodies
    return a.mass if not b.mobile else a.mass * b.mass / (a.mass + b.mass)


def collide(scene: Scene, mode: str, dt: float, duration: float) -> tuple[float, float, float]:
    """Restitution, duration [s] and relative change of momentum of the one collision of a scene.

    ``duration`` [s]: time to run. The contact is timed by where the gap crosses zero, which is exact for
    positions that drift straight from step to step.
    """
    run = runner(scene, mode, dt)
    before = run.state().v
    times = scene.time.start + dt * np.arange(round(duration / dt) + 1)
    xy = run.sample(times)
    after = run.state().v
    gap = np.hypot(*(xy[:, 1] - xy[:, 0]).T) - scene.bodies[0].radius - scene.bodies[1].radius
    touching = crossings(times, gap)
    lasted = float(touching[1] - touching[0]) if len(touching) == 2 else math.nan
    mass = np.array([[body.mass] for body in scene.bodies])
    moved = np.hypot(*(mass * (after - before)).sum(axis=0)) / np.hypot(*(mass * before).sum(axis=0))
    restitution = np.hypot(*(after[1] - after[0])) / np.hypot(*(before[1] - before[0]))
    return float(restitution), lasted, float(moved)


def linear_collision(mode: str = "verlet", quick: bool = False) -> Case:
    """Restitution and duration of the linear contact for several time steps, to 0.1 % at dt = 1e-7 s.

    Where in a step the disks meet is chance; the worst of several distances at the start counts.
    """
    steps = [4e-6, 1e-6, 1e-7] if quick else [4e-6, 2e-6, 1e-6, 4e-7, 2e-7, 1e-7]
    # the error depends on the part of a step that is left when the contact ends
    offsets = np.arange(20 if quick else 40) / (20 if quick else 40)
    figures, lines_e, lines_t = [], [], []
    law = use("contact_linear", stiffness=STIFFNESS, damping=DAMPING)
    speed = 0.1
    for wall in (False, True):
        what = "disk and wall" if wall else "two disks"
        worst_e, worst_t, worst_p = [], [], []
        for dt in steps:
            errors = []
            for offset in offsets:
                scene = collision_scene(
                    law, wall=wall, speed=speed, gap=(10 + offset) * speed * dt, oblique=True
                )
                m = reduced_mass(scene)
                expected = linear_restitution(STIFFNESS, DAMPING, m), linear_duration(STIFFNESS, DAMPING, m)
                e, lasted, moved = collide(scene, mode, dt, 11 * dt + 1.3 * expected[1])
                errors.append((abs(e / expected[0] - 1), abs(lasted / expected[1] - 1), moved))
            worst = np.max(errors, axis=0).tolist()
            worst_e.append(worst[0])
            worst_t.append(worst[1])
            worst_p.append(worst[2])
        figures += [
            Figure(
                f"{what}: restitution at dt 1e-7 s", worst_e[-1], 1e-3, note=f"analytic {expected[0]:.6f}"
            ),
            Figure(f"{what}: duration at dt 1e-7 s", worst_t[-1], 1e-3, note=f"analytic {expected[1]:.4e} s"),
        ]
        if not wall:
            figures.append(Figure("two disks: momentum, any dt", max(worst_p), 1e-12))
        lines_e.append(Line(what, np.array(steps), np.array(worst_e)))
        lines_t.append(Line(what, np.array(steps), np.array(worst_t)))
    return Case(
        f"linear contact ({mode})",
        figures,
        (
            Panel("restitution, linear contact", "dt [s]", "relative error", lines_e, "xy"),
            Panel("duration, linear contact", "dt [s]", "relative error", lines_t, "xy"),
        ),
    )


def hertz_collision(mode: str = "verlet", quick: bool = False) -> Case:
    """Duration of an undamped Hertz contact ~ v^(-1/5), and its prefactor; engine and reference agree."""
    speeds = np.array([0.01, 0.1, 1.0]) if quick else np.geomspace(0.01, 1.0, 9)
    law = use("contact_hertz", stiffness=HERTZ)
    durations, expected, apart, restitution = [], [], 0.0, []
    for speed in speeds:
        scene = collision_scene(law, wall=False, speed=speed, gap=1e-9)
        expected.append(hertz_duration(HERTZ, reduced_mass(scene), speed))
        dt = expected[-1] / 2000
        e, lasted, _ = collide(scene, mode, dt, 1.1 * expected[-1])
        durations.append(lasted)
        restitution.append(e)
        if mode != "reference":
            _, other, _ = collide(scene, "reference", dt, 1.1 * expected[-1])
            apart = max(apart, abs(other / lasted - 1))
    slope = np.polyfit(np.log(speeds), np.log(durations), 1)[0]
    figures = [
        Figure(
            "exponent of the speed against -1/5",
            float(abs(slope / -0.2 - 1)),
            0.01,
            note=f"measured {slope:.6f}",
        ),
        Figure("duration against v^(-1/5)", float(np.max(np.abs(np.array(durations) / expected - 1))), 0.01),
        Figure("restitution 1 without damping", float(np.max(np.abs(np.array(restitution) - 1))), 1e-3),
    ]
    if mode != "reference":
        figures.append(Figure("duration, engine against reference", apart, 1e-9))
    lines = [Line("analytic", speeds, np.array(expected), "-"), Line(mode, speeds, np.array(durations), "o")]
    return Case(
        f"Hertz contact ({mode})",
        figures,
        (Panel("duration, Hertz contact", "speed [m/s]", "duration [s]", lines, "xy"),),
    )


def impulse_collision(mode: str = "verlet", quick: bool = False) -> Case:
    """Instantaneous collision: v_n' = -e v_n and momentum, two disks and a disk with a wall."""
    figures = []
    law = use("contact_elastic", restitution=RESTITUTION)
    for wall in (False, True):
        what = "disk and wall" if wall else "two disks"
        dt = 1e-5
        scene = collision_scene(law, wall=wall, speed=0.1, gap=10.3 * 0.1 * dt, oblique=True)
        e, _, moved = collide(scene, mode, dt, 40 * dt)
        figures.append(
            Figure(f"{what}: restitution", abs(e / RESTITUTION - 1), 1e-3, note=f"measured {e:.6f}")
        )
        if not wall:
            figures.append(Figure("two disks: momentum", moved, 1e-12))
        if mode == "chipmunk":
            continue  # its contacts do not reach beyond the disks
        # an attraction on both sides of the impact does the work w m_r/2: v'^2 = e^2 (v^2 + w) - w
        reach, speed, dt = 1e-4, 0.1, 2e-6
        scene = collision_scene(law, wall=wall, speed=speed, gap=8 * reach)
        force = 0.15 * reduced_mass(scene) * speed**2 / reach
        scene = scene.with_laws(use("cohesion", force=force, range=reach))
        e, _, _ = collide(scene, mode, dt, 30 * reach / speed)
        expected = math.sqrt(RESTITUTION**2 * 1.3 - 0.3)
        figures.append(
            Figure(f"{what}: restitution with an attraction", abs(e / expected - 1), 3e-3, note=f"measured {e:.6f}")
        )
    return Case(f"instantaneous contact ({mode})", figures)
