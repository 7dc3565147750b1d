"""Apparatuses to conceal an effect in: what everybody may know of a case, drawn before and without the effect."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..scene import Adjustable, Body, LawUse, Scene, use


@dataclass(frozen=True)
class Setup:
    """A scene with its true base numbers, and how it is filmed.

    scene : bodies with ``initial``, the laws everybody knows, ``adjustable`` with bounds
    t : (T,) frame times [s];  dt : time step of the proof's simulator [s]
    noise : one standard deviation [m], or [rad] where ``angles`` (an encoder on the pin)
    candidates : names of effects that may be concealed here;  cameras : faults of the camera that could show
    """

    name: str
    scene: Scene
    t: np.ndarray
    dt: float
    noise: float
    candidates: tuple[str, ...]
    cameras: tuple[str, ...]
    angles: bool = False

    @property
    def mobile(self) -> tuple[str, ...]:
        return tuple(b.id for b in self.scene.bodies if b.mobile)


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number that is even on a logarithmic scale."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def _times(rng: np.random.Generator, duration: float, rate: float) -> tuple[np.ndarray, float]:
    """Frame times at a rate that is no round number; the clock does not begin at zero. Also the rate [Hz]."""
    rate = round(rate * float(rng.uniform(0.9, 1.1)), 2)
    begin = round(float(rng.uniform(0.1, 2.0)), 4)
    return begin + np.arange(max(int(duration * rate), 40)) / rate, rate


def _names(rng: np.random.Generator, count: int) -> list[str]:
    start = int(rng.integers(0, 20))
    return [f"b{start + k}" for k in range(count)]


def _maybe(rng: np.random.Generator, share: float, item: Adjustable) -> tuple[Adjustable, ...]:
    return (item,) if rng.random() < share else ()


def _bounded(rng: np.random.Generator, law: str, parameter: str, value: float, most: float = math.inf) -> Adjustable:
    low = float(f"{value * rng.uniform(0.2, 0.6):.3g}")
    return Adjustable(law, parameter, low, min(float(f"{value * rng.uniform(1.7, 3.5):.3g}"), most))


def _initial(
    place: Sequence[float] | np.ndarray, velocity: Sequence[float] | np.ndarray
) -> tuple[float, float, float, float]:
    return float(place[0]), float(place[1]), float(velocity[0]), float(velocity[1])


DRAGS = ("linear_drag", "quadratic_drag", "coulomb_substrate", "ambient_flow", "uniform_force")
OUTSIDE_FREE = ("attraction", "cubic_drag", "transverse_force", "shaking")


def table(rng: np.random.Generator) -> Setup:
    """Disks that slide over a table and do not meet."""
    count = int(rng.integers(2, 4))
    bodies = []
    turn = rng.uniform(0, 2 * math.pi)
    for k, name in enumerate(_names(rng, count)):
        radius, speed = float(rng.uniform(0.008, 0.025)), float(rng.uniform(0.12, 0.4))
        # they begin on a ring and move away from its centre, each in its own sector
        at = turn + 2 * math.pi * k / count
        way = at + rng.uniform(-0.5, 0.5)
        place = 0.12 * np.array([math.cos(at), math.sin(at)]) + rng.normal(size=2) * 0.01 + 0.3
        mass = 900.0 * radius**2 * rng.uniform(0.02, 0.06)
        velocity = speed * np.array([math.cos(way), math.sin(way)])
        bodies.append(
            Body(
                name,
                "free",
                round(radius, 5),
                float(f"{mass:.4g}"),
                initial=_initial(place, velocity),
            )
        )
    laws: tuple[LawUse, ...] = ()
    adjustable: tuple[Adjustable, ...] = ()
    if rng.random() < 0.5:
        mass = float(np.mean([b.mass for b in bodies]))
        c = mass * between(rng, 0.15, 0.8)
        laws = (use("linear_drag", c=c),)
        adjustable = (_bounded(rng, "linear_drag", "c", c),)
    t, _ = _times(rng, rng.uniform(0.7, 1.1), 70.0)
    scene = Scene(tuple(bodies), laws, adjustable=adjustable)
    return Setup("table", scene, t, 5e-4, between(rng, 1.2e-5, 6e-5), (*DRAGS, *OUTSIDE_FREE), ())


def meeting(rng: np.random.Generator) -> Setup:
    """Two or three disks that collide, the collision instantaneous."""
    count = int(rng.integers(2, 4))
    names = _names(rng, count)
    bodies = []
    turn = rng.uniform(0, 2 * math.pi)
    for k, name in enumerate(names):
        radius = float(rng.uniform(0.009, 0.018))
        at = turn + 2 * math.pi * k / count + rng.uniform(-0.2, 0.2)
        far = rng.uniform(0.05, 0.08)
        place = far * np.array([math.cos(at), math.sin(at)]) + 0.2
        # towards the centre, a little beside it
        aim = at + math.pi + rng.uniform(-0.1, 0.1)
        speed = rng.uniform(0.12, 0.3)
        velocity = speed * np.array([math.cos(aim), math.sin(aim)])
        mass = 900.0 * radius**2 * rng.uniform(0.04, 0.12)
        bodies.append(
            Body(
                name,
                "free",
                round(radius, 5),
                float(f"{mass:.4g}"),
                initial=_initial(place, velocity),
            )
        )
    restitution = float(rng.uniform(0.65, 0.97))
    item = Adjustable("contact_elastic", "restitution", float(f"{rng.uniform(0.3, 0.5):.3g}"), 1.0)
    t, _ = _times(rng, rng.uniform(0.6, 0.9), 110.0)
    scene = Scene(tuple(bodies), (use("contact_elastic", restitution=restitution),), adjustable=_maybe(rng, 0.6, item))
    candidates = ("restitution", "distance_force", "pair_lubrication", "cohesion", *DRAGS[:3], "uniform_force",
                "cubic_drag", "transverse_force", "attraction")  # fmt: skip
    return Setup("meeting", scene, t, 5e-4, between(rng, 1.2e-5, 5e-5), candidates, ("camera_scale",))


def pressing(rng: np.random.Generator) -> Setup:
    """Two disks that collide softly and off the centre: friction and loss of the contact show."""
    names = _names(rng, 2)
    angle = rng.uniform(0, 2 * math.pi)
    along, across = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
    radii = rng.uniform(0.012, 0.02, size=2)
    masses = [float(f"{900.0 * r**2 * rng.uniform(0.06, 0.12):.4g}") for r in radii]
    off = rng.uniform(0.3, 0.7) * radii.sum()
    bodies = []
    for k, sign in enumerate((-1, 1)):
        place = 0.2 + sign * along * rng.uniform(0.045, 0.06) + sign * across * off / 2
        velocity = -sign * along * rng.uniform(0.12, 0.25)
        bodies.append(
            Body(
                names[k],
                "free",
                round(float(radii[k]), 5),
                masses[k],
                initial=_initial(place, velocity),
            )
        )
    stiffness, damping = between(rng, 60.0, 250.0), between(rng, 3.0, 15.0)
    parameter, value = ("damping", damping) if rng.random() < 0.5 else ("stiffness", stiffness)
    item = _bounded(rng, "contact_linear", parameter, value)
    t, _ = _times(rng, rng.uniform(0.6, 0.9), 120.0)
    law = use("contact_linear", stiffness=stiffness, damping=damping)
    scene = Scene(tuple(bodies), (law,), adjustable=_maybe(rng, 0.6, item))
    candidates = ("contact_friction", "restitution", "cohesion", "distance_force", "pair_lubrication", "linear_drag",
                "coulomb_substrate", "cubic_drag")  # fmt: skip
    return Setup("pressing", scene, t, 2e-4, between(rng, 1.2e-5, 4e-5), candidates, ("camera_scale",))


def pendulum(rng: np.random.Generator) -> Setup:
    """A pendulum, seen by an encoder or a camera."""
    length = float(rng.uniform(0.12, 0.3))
    radius, mass = round(float(rng.uniform(0.008, 0.02)), 5), float(f"{rng.uniform(0.05, 0.2):.4g}")
    swing, spin = rng.uniform(0.4, 1.1) * rng.choice([-1, 1]), rng.uniform(-1, 1)
    anchor = np.round(rng.uniform(-0.05, 0.05, size=2), 4)
    place = anchor + length * np.array([math.sin(swing), -math.cos(swing)])
    velocity = spin * length * np.array([math.cos(swing), math.sin(swing)])
    (name,) = _names(rng, 1)
    body = Body(name, "free", radius, mass, initial=_initial(place, velocity))
    laws = [use("gravity"), use("pin", anchor=tuple(map(float, anchor)), length=length, bodies=[name])]
    choice = rng.random()
    adjustable: tuple[Adjustable, ...] = ()
    if choice < 0.4:
        adjustable = (
            Adjustable("pin", "length", float(f"{length * rng.uniform(0.7, 0.9):.3g}"),
                       float(f"{length * rng.uniform(1.1, 1.4):.3g}")),
        )  # fmt: skip
    elif choice < 0.7:
        c = mass * between(rng, 0.05, 0.3)
        laws.append(use("linear_drag", c=c))
        adjustable = (_bounded(rng, "linear_drag", "c", c),)
    angles = bool(rng.random() < 0.5)
    t, _ = _times(rng, rng.uniform(2.5, 4.0), 40.0)
    scene = Scene((body,), tuple(laws), gravity=(0.0, -9.81), adjustable=adjustable)
    candidates = ("linear_drag", "quadratic_drag", "joint_friction", "uniform_force", "added_mass", "cubic_drag",
                "shaking")  # fmt: skip
    noise = between(rng, 3e-4, 2e-3) if angles else between(rng, 5e-5, 2e-4)
    cameras = ("camera_tilt",) if angles else ("camera_tilt", "camera_scale", "tracking_bias")
    return Setup("pendulum", scene, t, 4e-4, noise, candidates, cameras, angles)


def cart(rng: np.random.Generator) -> Setup:
    """A cart on a rail between springs."""
    angle = rng.uniform(0, math.pi)
    direction = np.array([math.cos(angle), math.sin(angle)])
    anchor = np.round(rng.uniform(-0.1, 0.1, size=2), 4)
    mass, stiffness = float(f"{rng.uniform(0.1, 0.5):.4g}"), 0.0
    stiffness = mass * (2 * math.pi * rng.uniform(0.7, 1.4)) ** 2
    place = anchor + direction * rng.uniform(0.05, 0.1) * rng.choice([-1, 1])
    velocity = direction * rng.uniform(-0.2, 0.2)
    (name,) = _names(rng, 1)
    body = Body(name, "free", round(float(rng.uniform(0.01, 0.03)), 5), mass,
                initial=_initial(place, velocity))  # fmt: skip
    laws = [
        use("rail", direction=tuple(map(float, direction)), bodies=[name]),
        use("spring", anchor=tuple(map(float, anchor)), stiffness=stiffness, bodies=[name]),
    ]
    adjustable: tuple[Adjustable, ...] = ()
    choice = rng.random()
    if choice < 0.5:
        adjustable = (_bounded(rng, "spring", "stiffness", stiffness),)
    elif choice < 0.75:
        c = mass * between(rng, 0.05, 0.3)
        laws.append(use("linear_drag", c=c))
        adjustable = (_bounded(rng, "linear_drag", "c", c),)
    t, _ = _times(rng, rng.uniform(2.5, 4.0), 30.0)
    candidates = ("nonlinear_spring", "linear_drag", "quadratic_drag", "coulomb_substrate", "uniform_force",
                  "added_mass", "cubic_drag", "shaking")  # fmt: skip
    return Setup("cart", Scene((body,), tuple(laws), adjustable=adjustable), t, 5e-4, between(rng, 4e-5, 2e-4),
                 candidates, ("tracking_bias",))  # fmt: skip


def motor(rng: np.random.Generator) -> Setup:
    """A body on a rail that follows a motor."""
    t, _ = _times(rng, rng.uniform(1.6, 2.4), 50.0)
    (name,) = _names(rng, 1)
    angle = rng.uniform(0, math.pi)
    direction = tuple(map(float, (math.cos(angle), math.sin(angle))))
    when = np.arange(t[0] - 0.3, t[-1] + 0.3, 0.01)
    command = np.zeros_like(when)
    for _ in range(3):
        command += rng.uniform(0.03, 0.1) * np.sin(2 * math.pi * rng.uniform(0.5, 3.5) * when + rng.uniform(0, 6))
    place = np.round(rng.uniform(-0.1, 0.1, size=2), 4)
    body = Body(name, "free", round(float(rng.uniform(0.01, 0.03)), 5), float(f"{rng.uniform(0.1, 0.5):.4g}"),
                initial=_initial(place, (0.0, 0.0)))  # fmt: skip
    gain = float(rng.uniform(0.8, 1.2))
    laws = (use("rail", direction=direction, bodies=[name]), use("drive", bodies=[name], gain=gain))
    scene = Scene(
        (body,), laws, adjustable=_maybe(rng, 0.6, _bounded(rng, "drive", "gain", gain)),
        inputs={name: (tuple(float(f"{x:.4f}") for x in when), tuple(float(f"{x:.6f}") for x in command))},
    )  # fmt: skip
    return Setup("motor", scene, t, 5e-4, between(rng, 3e-5, 2e-4),
                 ("actuator_lag", "actuator_delay", "actuator_saturation"), ("time_offset", "camera_tilt"))  # fmt: skip


def falling(rng: np.random.Generator) -> Setup:
    """Balls thrown in air or in a liquid."""
    count = int(rng.integers(2, 4))
    bodies = []
    for k, name in enumerate(_names(rng, count)):
        radius = float(rng.uniform(0.01, 0.03))
        mass = float(f"{4 / 3 * math.pi * radius**3 * rng.uniform(200, 1500):.4g}")
        place = (0.4 * k + rng.uniform(-0.05, 0.05), rng.uniform(1.5, 2.5))
        velocity = (rng.uniform(-0.6, 0.6), rng.uniform(-0.5, 2.0))
        bodies.append(Body(name, "free", round(radius, 5), mass, initial=_initial(place, velocity)))
    laws: list[LawUse] = [use("gravity")]
    adjustable: tuple[Adjustable, ...] = ()
    if rng.random() < 0.5:
        c = float(np.mean([b.mass for b in bodies])) * between(rng, 0.1, 0.5)
        laws.append(use("linear_drag", c=c))
        adjustable = (_bounded(rng, "linear_drag", "c", c),)
    t, _ = _times(rng, rng.uniform(0.6, 0.9), 80.0)
    candidates = ("linear_drag", "quadratic_drag", "uniform_force", "added_mass", "ambient_flow", *OUTSIDE_FREE)
    scene = Scene(tuple(bodies), tuple(laws), gravity=(0.0, -9.81), adjustable=adjustable)
    return Setup("falling", scene, t, 5e-4, between(rng, 1e-4, 6e-4), candidates, ("camera_scale", "camera_tilt"))


def pucks(rng: np.random.Generator) -> Setup:
    """Four to six disks that meet three to ten times; not one of SETUPS, whose draws are fixed."""
    for _ in range(500):
        count = int(rng.integers(4, 7))
        turn = rng.uniform(0, 2 * math.pi)
        bodies = []
        for n, name in enumerate(_names(rng, count)):
            radius = float(rng.uniform(0.02, 0.035))
            at = turn + 2 * math.pi * (n + rng.uniform(-0.25, 0.25)) / count
            place = rng.uniform(0.14, 0.3) * np.array([math.cos(at), math.sin(at)])
            way = math.atan2(-place[1], -place[0]) + rng.normal() * 0.25
            velocity = rng.uniform(0.3, 0.8) * np.array([math.cos(way), math.sin(way)])
            mass = float(f"{radius**2 * rng.uniform(50.0, 110.0):.4g}")
            bodies.append(Body(name, "free", round(radius, 5), mass, initial=_initial(place, velocity)))
        restitution = float(f"{rng.uniform(0.7, 0.97):.3g}")
        scene = Scene(tuple(bodies), (use("contact_elastic", restitution=restitution),))
        t, _ = _times(rng, rng.uniform(1.0, 1.5), 240.0)
        candidates = ("restitution", "distance_force", "contact_friction", "linear_drag", "quadratic_drag",
                    "coulomb_substrate", "uniform_force")  # fmt: skip
        setup = Setup("pucks", scene, t, 2e-4, between(rng, 1e-4, 4e-4), candidates, ("camera_scale",))
        if _far_apart(scene) and 3 <= len(meetings(setup)) <= 10:
            return setup
    raise AssertionError("no pucks that meet in 500 draws")


def _far_apart(scene: Scene) -> bool:
    """Whether the disks' edges are 5 mm apart and more at the start."""
    xy = np.array([b.initial[:2] for b in scene.bodies if b.initial is not None])
    radius = np.array([b.radius for b in scene.bodies])
    i, j = np.triu_indices(len(xy), 1)
    return bool((np.hypot(*(xy[i] - xy[j]).T) - radius[i] - radius[j]).min() > 5e-3)


def meetings(setup: Setup) -> np.ndarray:
    """Frames (k,) before which something met, of a scene of instantaneous collisions without other forces."""
    from .world import World

    v = World(setup.scene, [], setup.dt).sample(setup.t, t0=float(setup.t[0])).v
    return np.flatnonzero(np.any(np.abs(np.diff(v, axis=0)) > 1e-9, axis=(1, 2)))


def pin_length(setup: Setup) -> float | None:
    """Length of the pendulum [m], by which a drag is a torque."""
    pins = setup.scene.laws_named("pin")
    return float(pins[0].values["length"]) if pins else None


SETUPS: dict[str, Callable[[np.random.Generator], Setup]] = {
    make.__name__: make for make in (table, meeting, pressing, pendulum, cart, motor, falling)
}


def draw_setup(rng: np.random.Generator) -> Setup:
    """One of the apparatuses, with numbers of its own."""
    name = list(SETUPS)[int(rng.choice(len(SETUPS), p=[0.2, 0.17, 0.13, 0.15, 0.13, 0.1, 0.12]))]
    return SETUPS[name](rng)
