"""Single bodies: spring, drags, fields, rail, drive and pendulum against closed solutions; orders."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from granswim_pymunk.scene import Body, LawUse, Scene, Time, swimmer, use

from .analytic import pendulum_period
from .reference import exact
from .results import Case, Figure, Line, Panel, crossings, drift, runner

MASS, RADIUS = 0.02, 0.01  # kg, m


def one_body(*laws: LawUse, initial: tuple[float, float, float, float], **scene: object) -> Scene:
    """A single body ``ball`` under these laws."""
    inertia = scene.pop("inertia", None)
    ball = Body("ball", "free", RADIUS, MASS, initial=initial, inertia=inertia)  # type: ignore[arg-type]
    return Scene((ball,), laws, **scene)  # type: ignore[arg-type]


def spring(mode: str = "verlet", quick: bool = False) -> Case:
    """Period, energy and angular momentum of a body on an undamped spring."""
    k, periods = 3.0, 20 if quick else 200
    omega = math.sqrt(k / MASS)
    dt = 0.01 / omega
    straight = one_body(use("spring", anchor=(0.0, 0.0), stiffness=k), initial=(0.1, 0.0, 0.0, 0.0))
    times = dt * np.arange(round(periods * 2 * math.pi / 0.01))
    zeros = crossings(times, runner(straight, mode, dt).sample(times)[:, 0, 0])
    period = 2 * (zeros[-1] - zeros[0]) / (len(zeros) - 1)
    # leapfrog swings at a frequency of its own: sin(omega' dt/2) = omega dt/2
    discrete = math.pi * dt / math.asin(omega * dt / 2)

    length = 0.06
    law = use("spring", anchor=(0.01, 0.02), stiffness=k, length=length)
    run = runner(one_body(law, initial=(0.1, 0.0, 0.05, 0.9)), mode, dt)
    t, energy, turning = [], [], []
    for _ in range(200):
        state = run.state()
        r, v = state.xy[0] - (0.01, 0.02), state.v[0]
        t.append(state.t)
        energy.append(0.5 * MASS * (v @ v) + 0.5 * k * (np.hypot(*r) - length) ** 2)
        turning.append(MASS * (r[0] * v[1] - r[1] * v[0]))
        run.advance(len(times) // 200)
    e, l = np.array(energy), np.array(turning)
    return Case(
        f"spring ({mode})",
        (
            Figure("period against 2 pi sqrt(m/k)", float(abs(period * omega / (2 * math.pi) - 1)), 1e-5),
            Figure("period against leapfrog's own", float(abs(period / discrete - 1)), 1e-9),
            Figure("energy, largest deviation", float(np.abs(e / e[0] - 1).max()), 1e-4),
            Figure("energy, drift", float(abs(drift(np.array(t), e)) / e[0]), 1e-5),
            Figure("angular momentum", float(np.abs(l / l[0] - 1).max()), 1e-11),
        ),
        (Panel("energy of a spring", "t [s]", "E/E(0) - 1", (Line(mode, np.array(t), e / e[0] - 1, "-"),)),),
    )


def motions(mode: str = "verlet", quick: bool = False) -> Case:
    """Drags, substrate, fields, rail and drive: the path of one body against the closed solution."""
    v0, c, g = 0.8, 0.01, 9.81
    slope = np.array([0.8, -0.6])
    moving = (0.0, 0.0, v0, 0.0)
    rows = (0.0, 0.2, 0.5, 1.0), (0.0, 1.0, -0.5, 2.0)
    driven = np.array([0.0, 0.1, 0.175, 0.55])  # integral of the command at those times [m]

    def command_path(t: np.ndarray) -> np.ndarray:
        k = np.clip(np.searchsorted(rows[0], t, side="right") - 1, 0, 2)
        t0, t1 = np.array(rows[0])[k], np.array(rows[0])[k + 1]
        a, b = np.array(rows[1])[k], np.array(rows[1])[k + 1]
        s = t - t0
        return 0.5 * (driven[k] + a * s + (b - a) / (t1 - t0) * s**2 / 2)

    rate = 0.01 * 1.774e-6 * 9.81 * 11
    confined = use("confinement", mu_eff=0.01, layers=11, mean_mass=1.774e-6)
    light = Body("ball", "grain", RADIUS, 1.774e-6, initial=moving)
    rest = (0.0, 0.0, 0.0, 0.0)
    cases = [
        (
            one_body(use("linear_drag", c=c), initial=moving),
            lambda t: v0 * MASS / c * -np.expm1(-c * t / MASS),
            1e-4,
        ),
        (
            one_body(use("quadratic_drag", c=c), initial=moving),
            lambda t: MASS / c * np.log1p(c * v0 * t / MASS),
            1e-4,
        ),
        (
            one_body(use("coulomb_substrate", mu=0.07), initial=moving),
            lambda t: v0 * t - 0.07 * g * t**2 / 2,
            1e-4,
        ),
        (
            Scene((light,), (confined,)),
            lambda t: v0 * light.mass / rate * -np.expm1(-rate * t / light.mass),
            2e-4,
        ),
        (one_body(use("gravity"), initial=rest, gravity=(2.0, -9.0)), lambda t: t**2, 1e-10),
        (one_body(use("uniform_force", a=(1.5, 0.0)), initial=moving), lambda t: v0 * t + 0.75 * t**2, 1e-10),
        (
            one_body(use("rail", direction=tuple(slope)), use("gravity"), initial=rest, gravity=(0.0, -g)),
            lambda t: slope[0] * g * 0.6 * t**2 / 2,
            1e-10,
        ),
        (
            one_body(
                use("drive", bodies=["ball"], gain=0.5),
                use("rail", direction=(1.0, 0.0)),
                use("linear_drag", c=c),
                initial=rest,
                inputs={"ball": rows},
            ),
            command_path,
            1e-10,
        ),
    ]
    dt = 2e-4 if quick else 1e-4
    times = np.linspace(0.05, 1.0, 20)
    figures, lines = [], []
    for scene, path, bound in cases:
        name = scene.laws[0].name
        measured = runner(scene, mode, dt).sample(times)[:, 0, 0]
        expected = path(times)
        error = np.abs(measured - expected) / np.abs(expected).max()
        figures.append(Figure(f"{name}: path", float(error.max()), bound, note=f"dt {dt:g} s"))
        lines.append(Line(name, times, measured, "o"))
        lines.append(Line("", times, expected, "k-"))
    return Case(f"single bodies ({mode})", figures, (Panel("single bodies", "t [s]", "x [m]", lines),))


def pendulum(mode: str = "verlet", quick: bool = False) -> Case:
    """Period of a pendulum, as a point and with an inertia, against the elliptic integral; its length."""
    length, g, dt = 0.3, 9.81, 2e-4
    amplitudes = [0.1, 1.0, 2.0] if quick else [0.1, 0.5, 1.0, 1.5, 2.0, 2.5]
    figures, lines = [], []
    stretched = 0.0
    for inertia in (0.0, 4e-4):
        measured = []
        for amplitude in amplitudes:
            scene = one_body(
                use("gravity"),
                use("pin", bodies=["ball"], anchor=(0.0, 0.0), length=length),
                initial=(length * math.sin(amplitude), -length * math.cos(amplitude), 0.0, 0.0),
                gravity=(0.0, -g),
                inertia=inertia or None,
            )
            times = dt * np.arange(round(4.5 / dt))
            xy = runner(scene, mode, dt).sample(times)[:, 0]
            zeros = crossings(times, np.arctan2(xy[:, 0], -xy[:, 1]))
            measured.append(2 * (zeros[-1] - zeros[0]) / (len(zeros) - 1))
            stretched = max(stretched, float(np.abs(np.hypot(*xy.T) / length - 1).max()))
        expected = np.array([pendulum_period(length, g, a, MASS, inertia) for a in amplitudes])
        what = "with inertia" if inertia else "point"
        worst = float(np.abs(np.array(measured) / expected - 1).max())
        figures.append(Figure(f"{what}: period", worst, 1e-5, note=f"amplitudes to {max(amplitudes):g} rad"))
        lines += [
            Line(f"{what}, elliptic integral", np.array(amplitudes), expected, "-"),
            Line(f"{what}, {mode}", np.array(amplitudes), np.array(measured), "o"),
        ]
    figures.append(Figure("length of the rod", stretched, 1e-11))
    panel = Panel("period of a pendulum", "amplitude [rad]", "period [s]", lines)
    return Case(f"pendulum ({mode})", figures, (panel,))


def convergence(mode: str = "verlet", quick: bool = False) -> Case:
    """Order of convergence: 2, but 1 where a damping has the half-step velocity."""
    disks = swimmer(disks=4)
    swimming = [
        use("union", stiffness=1e3),
        use("bending", stiffness=2e-3, amplitude=0.7, frequency=30.0, form="elastic"),
    ]
    spring = use("spring", anchor=(0.0, 0.0), stiffness=3.0, length=0.06)
    conservative = one_body(spring, initial=(0.1, 0.0, 0.05, 0.9))
    hertz = Scene(
        (
            Body("a", "free", 1e-2, MASS, initial=(-0.0201, 0.0, 0.5, 0.0)),
            Body("b", "free", 1e-2, MASS, initial=(0.0, 0.003, 0.0, 0.0)),
        ),
        (use("contact_hertz", stiffness=1e6),),
    )
    pinned, heavy = (
        one_body(
            use("gravity"),
            use("pin", bodies=["ball"], anchor=(0.0, 0.0), length=0.3),
            initial=(0.3, 0.0, 0.0, 0.0),
            gravity=(0.0, -9.81),
            inertia=inertia,
        )
        for inertia in (None, 4e-4)
    )
    dragged = conservative.with_laws(use("linear_drag", c=0.05))
    curved = conservative.with_laws(use("quadratic_drag", c=0.05), use("coulomb_substrate", mu=0.02, v_0=0.1))
    swinging = pinned.with_laws(use("linear_drag", c=0.05))
    half_step = Time(scheme="half_step")
    systems = [
        ("spring", conservative, 0.5, 2e-3, 2),
        ("spring and drag", dragged, 0.5, 2e-3, 2),
        ("spring and drag, half step", replace(dragged, time=half_step), 0.5, 2e-3, 1),
        ("spring, quadratic drag and friction", curved, 0.5, 2e-3, 2),
        ("pendulum and drag", swinging, 0.9, 2e-3, 2),
        ("swimmer, undamped", Scene(tuple(disks), tuple(swimming)), 0.01, 8e-6, 2),
        ("Hertz contact", hertz, 3e-3, 2e-5, 2),
        ("pendulum", pinned, 0.9, 2e-3, 2),
        ("pendulum with inertia", heavy, 0.9, 2e-3, 2),
    ]
    figures, lines = [], []
    for name, scene, duration, coarse, order in systems:
        times = np.array([duration])
        truth = exact(scene, times, rtol=1e-12, max_step=duration / 200)
        dts = coarse / 2.0 ** np.arange(3 if quick else 5)
        errors = np.array([np.abs(runner(scene, mode, dt).sample(times) - truth).max() for dt in dts])
        measured = float(np.polyfit(np.log(dts), np.log(errors), 1)[0])
        figures.append(
            Figure(
                f"{name}: order against {order}", abs(measured - order), 0.15, note=f"measured {measured:.3f}"
            )
        )
        lines.append(Line(f"{name} ({measured:.2f})", dts, errors))
    panel = Panel("convergence", "dt [s]", "largest error of a position [m]", lines, "xy")
    return Case(f"order of convergence ({mode})", figures, (panel,))
