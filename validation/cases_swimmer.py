"""Small motions of the swimmer against its linearisation, and elastic bending against its energy."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from granswim_pymunk.scene import LawUse, Scene, swimmer, use

from .analytic import bending_stiffness, chain_damping, chain_stiffness, linear_motion, modes
from .results import Case, Figure, Line, Panel, crossings, runner

UNION, BENDING = 1.0e3, 2.0e-3  # N/m, N
UNION_DAMPING, BENDING_DAMPING = 1.0e3, 1.0e2  # 1/s
FORMS = ("leader", "elastic", "head_axis")
DISTANCE = 3.0e-3  # m
SMALL = 1e-8  # m


def chain_scene(laws: list[LawUse], displacement: np.ndarray) -> Scene:
    """The paper's swimmer, straight and at rest but for ``displacement`` (n, 2) [m]."""
    bodies = tuple(
        replace(body, initial=(body.initial[0] + dx, body.initial[1] + dy, 0.0, 0.0))
        for body, (dx, dy) in zip(swimmer(), displacement, strict=True)
        if body.initial is not None
    )
    return Scene(bodies, tuple(laws))


def bending_use(form: str, damping: float = 0.0) -> LawUse:
    return use("bending", stiffness=BENDING, damping=damping, amplitude=0.0, frequency=0.0, form=form)


def swimmer_modes(mode: str = "verlet", quick: bool = False) -> Case:
    """Frequency of every mode of union and bending, and the damped motion, of a swimmer hardly displaced.

    A mode is set off alone; its share in the motion (by its dual vector) is timed by its zeros.
    """
    mass = np.array([body.mass for body in swimmer()])
    n = len(mass)
    figures, lines, damped = [], [], []
    kinds = [("union", 0, chain_stiffness(n, UNION))]
    kinds += [(f"bending, {form}", 1, bending_stiffness(n, BENDING, DISTANCE, form)) for form in FORMS]
    for name, axis, stiffness in kinds:
        omegas, shapes, duals = modes(stiffness, mass)
        chosen = [0, 1, n - 2] if quick else range(n - 1)
        measured = []
        form = name.removeprefix("bending, ") if axis else "leader"
        laws = [use("union", stiffness=UNION, length=DISTANCE)]
        if axis:
            laws.append(bending_use(form))
        for k in chosen:
            displacement = np.zeros((n, 2))
            displacement[:, axis] = SMALL * shapes[k] / np.abs(shapes[k]).max()
            # bending hangs on the union's fast springs, which the step has to follow too
            dt = 0.01 / omegas[k] if not axis else min(0.01 / omegas[k], 1e-5)
            times = dt * np.arange(math.ceil((1.5 if quick else 2.5) * 2 * math.pi / omegas[k] / dt))
            scene = chain_scene(laws, displacement)
            rest = chain_scene(laws, np.zeros((n, 2))).bodies
            moved = runner(scene, mode, dt).sample(times)[:, :, axis] - [
                body.initial[axis] for body in rest if body.initial
            ]
            zeros = crossings(times, moved @ duals[k])
            measured.append(math.pi * (len(zeros) - 1) / (zeros[-1] - zeros[0]))
        ratio = np.array(measured) / omegas[list(chosen)]
        figures.append(
            Figure(
                f"{name}: frequencies",
                float(np.abs(ratio - 1).max()),
                1e-4,
                note=", ".join(f"{m / (2 * math.pi):.2f}" for m in measured) + " Hz",
            )
        )
        number = np.array(list(chosen)) + 1
        lines += [
            Line("", number, omegas[list(chosen)] / (2 * math.pi), "k_"),
            Line(name, number, np.array(measured) / (2 * math.pi), "x"),
        ]
        damped.append(_damped(name, axis, form, stiffness, mass, mode, quick))
    panels = [
        Panel("modes of the swimmer, bars: linearised", "mode", "frequency [Hz]", lines, "y"),
        *[panel for _, panel in damped],
    ]
    return Case(f"swimmer's modes ({mode})", figures + [figure for figure, _ in damped], panels)


def _damped(
    name: str, axis: int, form: str, stiffness: np.ndarray, mass: np.ndarray, mode: str, quick: bool
) -> tuple[Figure, Panel]:
    """A kink in the middle, with damping, against the matrix exponential."""
    n = len(mass)
    damping = chain_damping(mass, BENDING_DAMPING if axis else UNION_DAMPING)
    displacement = np.zeros((n, 2))
    displacement[3, axis] = SMALL
    laws = [use("union", stiffness=UNION, damping=UNION_DAMPING, length=DISTANCE)]
    if axis:
        laws.append(bending_use(form, BENDING_DAMPING))
    duration, dt = (0.05, 5e-6) if axis else (2e-3, 1e-7)
    if quick:
        duration /= 4
    times = np.linspace(duration / 40, duration, 40)
    expected = linear_motion(stiffness, damping, mass, displacement[:, axis], times)
    run = runner(chain_scene(laws, displacement), mode, dt)
    rest = np.array([body.initial for body in chain_scene(laws, np.zeros((n, 2))).bodies])[:, axis]
    measured = run.sample(times)[:, :, axis] - rest
    error = float(np.abs(measured - expected).max() / SMALL)
    lines = [
        Line("disk 3", times, measured[:, 3] / SMALL, "o"),
        Line("linearised", times, expected[:, 3] / SMALL, "-"),
    ]
    return (
        Figure(f"{name}: damped motion against the matrix exponential", error, 1e-3, note=f"dt {dt:g} s"),
        Panel(f"damped, {name}", "t [s]", "displacement/start", lines),
    )


def elastic_bending(mode: str = "verlet", quick: bool = False) -> Case:
    """Energy of a strongly bent undamped swimmer with ``elastic`` bending, its head axis held.

    E = kinetic + k_U/2 sum stretch^2 + k_B d/2 sum phi^2 must stay, large bends included.
    """
    rng = np.random.default_rng(5)
    stiff = 20.0  # times softer union: stretches of a per cent, so that d and the distance differ
    laws = [use("union", stiffness=UNION / stiff, length=DISTANCE), bending_use("elastic")]
    angle = np.cumsum(rng.uniform(-0.5, 0.5, 6))
    xy = np.zeros((7, 2))
    xy[1:] = np.cumsum(1.05 * DISTANCE * np.stack([np.cos(angle), np.sin(angle)], axis=1), axis=0)
    start = np.array([body.initial[:2] for body in swimmer() if body.initial is not None])
    run = runner(chain_scene(laws, xy - start), mode, 2e-6)
    mass = np.array([body.mass for body in swimmer()])
    t, energy = [], []
    for _ in range(100):
        state = run.state()
        r = np.diff(state.xy, axis=0)
        turn = np.arctan2(r[:, 1], r[:, 0])
        phi = np.diff(turn, prepend=0.0)
        phi -= 2 * np.pi * np.round(phi / (2 * np.pi))
        stretch = np.hypot(*r.T) - DISTANCE
        energy.append(
            0.5 * float(mass @ (state.v**2).sum(axis=1))
            + 0.5 * UNION / stiff * float(stretch @ stretch)
            + 0.5 * BENDING * DISTANCE * float(phi @ phi)
        )
        t.append(state.t)
        run.advance(100 if quick else 500)
    e = np.array(energy)
    return Case(
        f"energy of elastic bending ({mode})",
        (Figure("largest deviation", float(np.abs(e / e[0] - 1).max()), 1e-4),),
        (
            Panel(
                "energy of elastic bending",
                "t [s]",
                "E/E(0) - 1",
                (Line(mode, np.array(t), e / e[0] - 1, "-"),),
            ),
        ),
    )
