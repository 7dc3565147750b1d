"""``python -m granswim_pymunk.validation.school --out DIR --seed S --count N``: what is measured in a school.

Experiments of an afternoon, with what a film of them has; what is missing in the scene is in the name of the truth:

- ``sink``: a ball sinks in water, lighter by what it displaces;  ``wind``: two balls fall past a fan;  ``gale``: three
  in a wind that drags with the square of the speed
- ``spin``: a ball that spins flies on a curve;  ``incline``: a ball rolls down, and was thought to slide
- ``bounce``: a ball bounces on a floor;  ``cradle``: two pendulums that strike each other
- ``coupled``: two pendulums with a weak spring between them;  ``lens``: a pendulum before a lens that bends
- ``halts``: a pendulum that its bearing stops
- ``hard``: a cart on a spring that stiffens;  ``dry``: a cart on a spring that rubs;  ``rests``: one that stops
- ``slips``: a block that a motor draws by a spring, and that sticks and slips;  ``limit``: a motor at its limit
- ``carts``: two carts with magnets on one rail;  ``drawn``: two pucks that attract each other as they pass
- ``bent``: a cart goes up a track that is bent, and comes back;  ``sags``: a puck on a table that sags
- ``loaded``: pucks in a box, one of them loaded;  ``rack``: five balls on a table with cushions
- ``still``, ``quiet``: a pendulum and a box of pucks in which nothing is missing

SciPy's adaptive method (Dormand & Prince) integrates here, of a ball from impact to impact; the cradle goes in steps of
1/24000 s, what rubs and stops in steps of 1/20000 s, and the pucks are those of ``hard_disks``. No law of the engine or
of the proof is called. DIR, the truth and ``--score`` are as those of ``validation.lab``.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp

from granswim_pymunk.scene import Adjustable, Body, LawUse, Scene, Wall, use

from . import hard_disks
from .lab import UNKNOWN, Experiments, G, Made, as_filmed, film_errors, main, truth_of

DOWN = (0.0, -G)  # m/s^2
AIR, WATER = 1.2, 1000.0  # kg/m^3
Law = tuple[str, dict[str, float]]
Slope = Callable[[np.ndarray], np.ndarray]


def path_of(slope: Slope, start: Sequence[float], t: np.ndarray) -> np.ndarray:
    """(T, k) states at times t of y' = slope(y)."""
    found = solve_ivp(lambda _, y: slope(y), (t[0], t[-1]), start, t_eval=t, rtol=1e-9, atol=1e-11, max_step=0.01)
    return np.asarray(found.y.T)


def frames(seconds: float, rate: float) -> np.ndarray:
    return np.arange(int(seconds * rate)) / rate


def made(
    rng: np.random.Generator, name: str, t: np.ndarray, xy: np.ndarray, bodies: Sequence[Body], laws: Sequence[LawUse],
    truth: Sequence[Law], beside: str, noise: float = 3e-4, gravity: tuple[float, float] = (0.0, 0.0), **more: object,
) -> Made:  # fmt: skip
    """The film of places xy (T, n, 2) with the scene that is believed."""
    errors, stated = film_errors(rng, noise)
    scene = Scene(tuple(bodies), tuple(laws), gravity=gravity, **more)  # type: ignore[arg-type]
    return Made(as_filmed(name, scene, t, xy, errors, rng, stated), truth_of(name, list(truth), beside))


def falling(rate: float, push: np.ndarray, quadratic: float = 0.0, turn: float = 0.0) -> Slope:
    """r'' = push - rate v - quadratic |v| v + turn (-v_y, v_x)."""

    def slope(y: np.ndarray) -> np.ndarray:
        v = y[2:]
        a = push - (rate + quadratic * math.hypot(*v)) * v + turn * np.array([-v[1], v[0]])
        return np.concatenate([v, a])

    return slope


def sink(rng: np.random.Generator, name: str) -> Made:
    radius, mass, t = 0.005, 4.1e-3, frames(1.0, 240)
    c = 0.5 * WATER * 0.45 * math.pi * radius**2
    lift = G * WATER * 4 / 3 * math.pi * radius**3 / mass
    start = [0.0, 0.4, rng.uniform(0.2, 0.5), 0.1]
    path = path_of(falling(0.0, np.array([0.0, lift - G]), c / mass), start, t)
    truth = [("quadratic_drag", {"c": c}), ("uniform_force", {"a": lift})]
    ball = [Body("ball", "free", radius, mass)]
    return made(rng, name, t, path[:, None, :2], ball, [use("gravity")], truth, "in still water", gravity=DOWN)


def wind(rng: np.random.Generator, name: str) -> Made:
    t, c, u, masses = frames(0.9, 240), 0.004, rng.uniform(0.8, 1.5), (0.01, 0.02)
    starts = ([0.0, 2.0, 0.2, 0.5], [0.3, 2.0, 0.0, 1.0])
    paths = [
        path_of(falling(c / m, np.array([c * u / m, -G])), s, t)[:, :2] for m, s in zip(masses, starts, strict=True)
    ]
    bodies = [Body(k, "free", 0.02, m) for k, m in zip("ab", masses, strict=True)]
    truth = [("ambient_flow", {"c": c, "u": u})]
    return made(rng, name, t, np.stack(paths, axis=1), bodies, [use("gravity")], truth, "a fan", gravity=DOWN)


def gale(rng: np.random.Generator, name: str) -> Made:
    t, c, u, masses = frames(1.0, 120), 0.002, rng.uniform(1.0, 2.0), (0.005, 0.01, 0.02)
    starts = ([0.0, 2.0, 1.0, 1.0], [0.3, 2.0, 0.0, 2.0], [0.6, 2.0, -1.0, 1.0])

    def slope(y: np.ndarray, mass: float) -> np.ndarray:
        against = y[2:] - [u, 0.0]
        return np.concatenate([y[2:], DOWN - c / mass * math.hypot(*against) * against])

    paths = [path_of(lambda y, m=m: slope(y, m), s, t)[:, :2] for m, s in zip(masses, starts, strict=True)]
    bodies = [Body(k, "free", 0.02, m) for k, m in zip("abc", masses, strict=True)]
    truth = [("ambient_flow", {"c": c, "u": u})]
    return made(rng, name, t, np.stack(paths, axis=1), bodies, [use("gravity")], truth, "in a wind", gravity=DOWN)


def spin(rng: np.random.Generator, name: str) -> Made:
    t, mass, turn = frames(0.9, 240), 0.0027, rng.uniform(0.4, 0.8)
    start = [0.0, 1.0, rng.uniform(1.5, 2.5), rng.uniform(1.0, 2.0)]
    path = path_of(falling(0.0, np.array(DOWN), turn=turn), start, t)
    ball, truth = [Body("ball", "free", 0.02, mass)], [(UNKNOWN, {"s": turn * mass})]
    return made(rng, name, t, path[:, None, :2], ball, [use("gravity")], truth, "across the motion", 5e-4, DOWN)


def incline(rng: np.random.Generator, name: str) -> Made:
    t, along = frames(1.5, 60), G * math.sin(math.radians(rng.uniform(4, 8)))
    x = 0.5 * along / 1.4 * t**2 + 0.05 * t
    xy = np.column_stack([x, np.zeros(len(t))])[:, None]
    ball, laws, truth = [Body("ball", "free", 0.02, 0.05)], [use("gravity")], [("added_mass", {"beta": 0.4})]
    return made(rng, name, t, xy, ball, laws, truth, "which rolls", gravity=(float(f"{along:.5g}"), 0.0))


def bounce(rng: np.random.Generator, name: str) -> Made:
    t, radius, mass, e = frames(2.2, 240), 0.02, 2.7e-3, rng.uniform(0.74, 0.82)
    c = 0.5 * AIR * 0.47 * math.pi * radius**2
    slope = falling(0.0, np.array(DOWN), c / mass)

    def floor(_: float, y: np.ndarray) -> float:
        return float(y[1] - radius)

    floor.terminal, floor.direction = True, -1.0  # type: ignore[attr-defined]
    xy, y, now = np.zeros((len(t), 2)), np.array([0.0, 0.8, rng.uniform(0.2, 0.5), 0.0]), 0.0
    while now < t[-1] - 1e-9:
        way = solve_ivp(
            lambda _, y: slope(y), (now, t[-1]), y, events=floor, dense_output=True, rtol=1e-10, atol=1e-12
        )
        inside = (t >= now - 1e-12) & (t <= way.t[-1] + 1e-12)
        xy[inside] = way.sol(t[inside])[:2].T
        now, y = float(way.t[-1]), way.y[:, -1] * [1, 1, 1, -e]
        y[1] = radius + 1e-12
    laws = [use("gravity"), use("contact_elastic", restitution=0.9)]
    truth = [("restitution", {"restitution": e}), ("quadratic_drag", {"c": c})]
    walls = (Wall((-1.0, 0.0), (3.0, 0.0)),)
    ball = [Body("ball", "free", radius, mass)]
    return made(rng, name, t, xy[:, None], ball, laws, truth, "in air", gravity=DOWN, walls=walls)


def hung(angles: np.ndarray, length: float, at: Sequence[float]) -> np.ndarray:
    """(T, n, 2) places of bobs at ``angles`` (T, n) below anchors at x ``at``."""
    return np.stack([np.asarray(at) + length * np.sin(angles), -length * np.cos(angles)], axis=2)


def pins(at: Sequence[float], length: float) -> list[LawUse]:
    return [use("gravity")] + [
        use("pin", anchor=(float(x), 0.0), length=length, bodies=[name]) for x, name in zip(at, "ab", strict=False)
    ]


def cradle(rng: np.random.Generator, name: str) -> Made:
    length, radius, mass, e, rate = 0.3, 0.025, 0.2, rng.uniform(0.85, 0.92), 0.05
    at, t, dt = np.array([0.0, 0.0501]), frames(4.0, 240), 1 / 24000
    angle, speed, seen = np.array([-0.6, 0.0]), np.zeros(2), np.zeros((len(t), 2))
    for k in range(int(t[-1] / dt) + 1):
        if k % 100 == 0:
            seen[k // 100] = angle
        speed = speed - dt * (G / length * np.sin(angle) + rate * speed)
        angle = angle + dt * speed
        apart = np.diff(hung(angle[None], length, at)[0], axis=0)[0]
        if math.hypot(*apart) < 2 * radius:
            # how each gives way along the line of centres
            lever = np.column_stack([np.cos(angle), np.sin(angle)]) @ apart / math.hypot(*apart)
            closing = length * float(np.diff(speed * lever)[0])
            if closing < 0:
                speed += (1 + e) * closing / length / float(lever @ lever) * lever * [1, -1]
    bodies = [Body(k, "free", radius, mass) for k in "ab"]
    laws = [*pins(at, length), use("contact_elastic", restitution=0.98)]
    truth = [("restitution", {"restitution": e}), ("joint_drag", {"c": rate * mass * length**2})]
    return made(rng, name, t, hung(seen, length, at), bodies, laws, truth, "in bearings", 2e-4, DOWN)


def coupled(rng: np.random.Generator, name: str) -> Made:
    length, mass, at, stiffness, rate, t = 0.5, 0.3, np.array([0.0, 0.2]), rng.uniform(0.3, 0.6), 0.02, frames(10.0, 60)

    def slope(y: np.ndarray) -> np.ndarray:
        angle, speed = y[:2], y[2:]
        apart = np.diff(hung(angle[None], length, at)[0], axis=0)[0]
        far = math.hypot(*apart)
        push = np.array([1, -1]) * stiffness * (far - 0.2) / far
        turned = push * (np.column_stack([np.cos(angle), np.sin(angle)]) @ apart) / mass / length
        return np.concatenate([speed, turned - G / length * np.sin(angle) - rate * speed])

    path = path_of(slope, [0.2, 0.0, 0.0, 0.0], t)
    truth = [("pair_spring", {"k": stiffness}), ("joint_drag", {"c": rate * mass * length**2})]
    bodies = [Body(k, "free", 0.02, mass) for k in "ab"]
    return made(rng, name, t, hung(path[:, :2], length, at), bodies, pins(at, length), truth, "a spring", 3e-4, DOWN)


def swing(length: float, rate: float, start: float, t: np.ndarray) -> np.ndarray:
    """(T, 1, 2) places of a bob with a viscous bearing."""
    path = path_of(lambda y: np.array([y[1], -G / length * math.sin(y[0]) - rate * y[1]]), [start, 0.0], t)
    return hung(path[:, :1], length, [0.0])


def lens(rng: np.random.Generator, name: str) -> Made:
    length, mass, rate, t = 0.4, 0.2, rng.uniform(0.05, 0.1), frames(8.0, 60)
    xy, k = swing(length, rate, 0.7, t), rng.uniform(-0.3, -0.15)
    off = xy - xy.mean(axis=(0, 1))
    xy = xy + off * k * (off**2).sum(axis=2, keepdims=True)
    truth = [("joint_drag", {"c": rate * mass * length**2}), ("lens_distortion", {"k": k})]
    return made(rng, name, t, xy, [Body("a", "free", 0.02, mass)], pins([0.0], length), truth, "a lens", 2e-4, DOWN)


def still(rng: np.random.Generator, name: str) -> Made:
    t = frames(10.0, 60)
    xy = swing(0.4, 0.0, rng.uniform(0.3, 0.9), t)
    return made(rng, name, t, xy, [Body("a", "free", 0.02, 0.2)], pins([0.0], 0.4), [], "a pendulum", 2e-4, DOWN)


CART, SPRING = 0.25, 8.0  # kg, N/m


def on_spring(
    rng: np.random.Generator, name: str, x: np.ndarray, t: np.ndarray, truth: Sequence[Law], beside: str
) -> Made:
    """A cart on a rail that a spring draws to 0, at places x (T,) [m]."""
    laws = [use("rail", direction=(1.0, 0.0), bodies=["cart"]),
            use("spring", anchor=(0.0, 0.0), stiffness=SPRING, length=0.0, bodies=["cart"])]  # fmt: skip
    xy = np.column_stack([x, np.zeros(len(t))])[:, None]
    return made(rng, name, t, xy, [Body("cart", "free", 0.03, CART)], laws, truth, beside)


def swung(force: Callable[[float, float], float], t: np.ndarray) -> np.ndarray:
    """(T,) places of the cart let go at 0.12 m, ``force`` (x, v) [N] beside the spring's."""
    return path_of(lambda y: np.array([y[1], (force(*y) - SPRING * y[0]) / CART]), [0.12, 0.0], t)[:, 0]


def rubbed(
    x: float, pull: Callable[[float, float], float], mu: float, drag: float, t: np.ndarray, v: float = 0.0
) -> np.ndarray:
    """(T,) places or angles x, at first at rate v, that ``pull`` (t, x) [1/s^2] draws, held by friction up to mu g."""
    dt, most = 1 / 20000, mu * G
    seen = np.empty(int(t[-1] / dt) + 2)
    for k in range(len(seen)):
        seen[k] = x
        a = pull(k * dt, x) - drag * v
        side = math.copysign(1.0, v or a)
        after = v + dt * (a - side * most)
        # against the motion it cannot turn it round, and what rests it only holds
        v = after if after * side > 0 else 0.0
        x += dt * v
    return np.interp(t, np.arange(len(seen)) * dt, seen)


def hard(rng: np.random.Generator, name: str) -> Made:
    cubic, c = rng.uniform(60, 120), rng.uniform(0.002, 0.006)
    truth = [("nonlinear_spring", {"k_3": cubic}), ("linear_drag", {"c": c})]
    t = frames(6.0, 120)
    return on_spring(rng, name, swung(lambda x, v: -cubic * x**3 - c * v, t), t, truth, "on a rail")


def dry(rng: np.random.Generator, name: str) -> Made:
    mu, c = rng.uniform(0.004, 0.007), rng.uniform(0.002, 0.006)
    truth = [("coulomb_substrate", {"mu": mu}), ("linear_drag", {"c": c})]
    t = frames(6.0, 120)
    x = swung(lambda x, v: -mu * CART * G * math.tanh(v / 1e-3) - c * v, t)
    return on_spring(rng, name, x, t, truth, "on a rail")


def rests(rng: np.random.Generator, name: str) -> Made:
    mu, c, t = rng.uniform(0.02, 0.04), 0.004, frames(6.0, 60)
    x = rubbed(0.12, lambda _, x: -SPRING / CART * x, mu, c / CART, t)
    truth = [("coulomb_substrate", {"mu": mu}), ("linear_drag", {"c": c})]
    return on_spring(rng, name, x, t, truth, "it stops")


def bent(rng: np.random.Generator, name: str) -> Made:
    mu, curvature, t = rng.uniform(0.002, 0.004), rng.uniform(0.003, 0.006), frames(6.0, 30)
    slope, middle = rng.uniform(0.2, 0.24), 0.6
    x = rubbed(0.0, lambda _, x: -slope - G * curvature * (x - middle), mu, 0.0, t, v=0.75)
    truth = [("coulomb_substrate", {"mu": mu}), ("curved_surface", {"curvature": curvature})]
    xy = np.column_stack([x, np.zeros(len(t))])[:, None]
    laws = [use("rail", direction=(1.0, 0.0)), use("uniform_force", a=(-0.22, 0.0))]
    told = (Adjustable("uniform_force", "a_x", -0.3, -0.1),)
    cart = [Body("cart", "free", 0.05, 0.5)]
    return made(rng, name, t, xy, cart, laws, truth, "up a track and back", 2e-4, adjustable=told)


def sags(rng: np.random.Generator, name: str) -> Made:
    c, curvature, mass, t = rng.uniform(0.003, 0.006), rng.uniform(0.004, 0.008), 0.03, frames(5.0, 60)

    def slope(y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[2:], [-G * curvature * y[0], 0.0] - c / mass * y[2:]])

    path = path_of(slope, [-0.4, -0.2, rng.uniform(0.3, 0.4), 0.15], t)
    truth = [("linear_drag", {"c": c}), ("curved_surface", {"curvature": curvature})]
    return made(rng, name, t, path[:, None, :2], [Body("puck", "free", 0.03, mass)], [], truth, "on a long table", 2e-4)


def halts(rng: np.random.Generator, name: str) -> Made:
    torque, c, length, mass, t = rng.uniform(0.02, 0.04), 0.001, 0.4, 0.2, frames(8.0, 60)
    moment = mass * length**2
    angle = rubbed(0.8, lambda _, a: -G / length * math.sin(a), torque / moment / G, c / moment, t)
    truth = [("joint_friction", {"torque": torque}), ("joint_drag", {"c": c})]
    bob = [Body("a", "free", 0.02, mass)]
    xy = hung(angle[:, None], length, [0.0])
    return made(rng, name, t, xy, bob, pins([0.0], length), truth, "it stops", 2e-4, DOWN)


def slips(rng: np.random.Generator, name: str) -> Made:
    mu, mass, stiffness, apart, t = rng.uniform(0.03, 0.06), 0.3, 6.0, 0.2, frames(10.0, 60)
    when = np.arange(0.0, 10.02, 0.02)
    command = np.round(0.05 + 0.03 * np.sin(0.8 * math.pi * when), 6)
    drawn = np.concatenate([[0.0], np.cumsum(0.01 * (command[1:] + command[:-1]))])
    # the command at each of the steps of ``rubbed``
    led = np.interp(np.arange(len(when) * 400) / 20000, when, drawn)
    block = rubbed(0.0, lambda now, x: stiffness / mass * (float(led[round(now * 20000)]) - x), mu, 0.0, t)
    motor = np.interp(t, when, drawn) + apart
    xy = np.stack([np.column_stack([x, np.zeros(len(t))]) for x in (motor, block)], axis=1)
    laws = [use("rail", direction=(1.0, 0.0), bodies=["motor", "block"]), use("drive", bodies=["motor"], gain=1.0),
            use("pair_spring", bodies=["motor", "block"], k=stiffness, f_0=stiffness * apart)]  # fmt: skip
    told = {"motor": (tuple(map(float, np.round(when, 4))), tuple(map(float, command)))}
    bodies = [Body("motor", "free", 0.02, 0.5), Body("block", "free", 0.02, mass)]
    truth = [("coulomb_substrate", {"mu": mu})]
    return made(rng, name, t, xy, bodies, laws, truth, "it sticks", 2e-4, inputs=told)


def limit(rng: np.random.Generator, name: str) -> Made:
    most, t, when = rng.uniform(0.14, 0.17), frames(8.0, 60), np.arange(0.0, 8.01, 0.01)

    def command(now: np.ndarray) -> np.ndarray:
        return 0.2 * np.sin(2 * math.pi * 0.35 * now) + 0.05 * np.sin(2 * math.pi * 0.9 * now + 0.4)

    fine = np.arange(0.0, 8.0, 1e-4)
    x = np.interp(t, fine, np.cumsum(np.clip(command(fine), -most, most)) * 1e-4)
    laws = [use("rail", direction=(1.0, 0.0), bodies=["cart"]), use("drive", bodies=["cart"], gain=1.0)]
    told = {"cart": (tuple(map(float, np.round(when, 4))), tuple(map(float, np.round(command(when), 6))))}
    xy, cart = np.column_stack([x, np.zeros(len(t))])[:, None], [Body("cart", "free", 0.03, 0.3)]
    truth = [("actuator_saturation", {"limit": most})]
    return made(rng, name, t, xy, cart, laws, truth, "a motor", inputs=told)


def carts(rng: np.random.Generator, name: str) -> Made:
    strength, c, mass, radius, t = rng.uniform(3, 5), 0.01, 0.2, 0.03, frames(4.0, 120)

    def slope(y: np.ndarray) -> np.ndarray:
        push = strength * (radius / (y[1] - y[0])) ** 3
        return np.array([y[2], y[3], -(push + c * y[2]) / mass, (push - c * y[3]) / mass])

    path = path_of(slope, [0.0, 0.5, rng.uniform(0.2, 0.3), -0.05], t)
    xy = np.stack([path[:, :2], np.zeros((len(t), 2))], axis=2)
    laws = [use("rail", direction=(1.0, 0.0), bodies=["a", "b"]), use("contact_elastic", restitution=0.9)]
    truth = [("distance_force", {"s": strength, "n": 3.0}), ("linear_drag", {"c": c})]
    return made(rng, name, t, xy, [Body(k, "free", radius, mass) for k in "ab"], laws, truth, "magnets")


def drawn(rng: np.random.Generator, name: str) -> Made:
    strength, drag, mass, radius, t = rng.uniform(0.05, 0.08), 0.002, 0.05, 0.02, frames(4.0, 120)

    def slope(y: np.ndarray) -> np.ndarray:
        apart = y[2:4] - y[:2]
        far = math.hypot(*apart)
        pull = strength * (radius / far) ** 2 * apart / far
        return np.concatenate([y[4:], (pull - drag * y[4:6]) / mass, (-pull - drag * y[6:]) / mass])

    speed = 0.8 * math.sqrt(strength * (radius / 0.3) ** 2 * 0.15 / mass)
    path = path_of(slope, [-0.15, 0.0, 0.15, 0.0, 0.02, speed, 0.02, -speed], t)
    bodies, laws = [Body(k, "free", radius, mass) for k in "ab"], [use("contact_elastic", restitution=0.9)]
    truth = [("distance_force", {"s": -strength, "n": 2.0}), ("linear_drag", {"c": drag})]
    return made(rng, name, t, path[:, :4].reshape(-1, 2, 2), bodies, laws, truth, "which attract", 2e-4)


CORNERS = ((0.0, 0.0), (0.6, 0.0), (0.6, 0.6), (0.0, 0.6))
SIDES = tuple(zip(CORNERS, (*CORNERS[1:], CORNERS[0]), strict=True))


def boxed(
    rng: np.random.Generator, masses: np.ndarray, mu: float, e: float, t: np.ndarray
) -> tuple[np.ndarray, list[tuple[float, int, int]]]:
    """(T, n, 2) places of disks of 3 cm in a box of 0.6 m, slowed by dry friction; when which two of them met."""
    n = len(masses)
    places = np.array([(0.12 + 0.18 * (k % 3), 0.15 + 0.25 * (k // 3)) for k in range(n)])
    start = np.hstack([places + rng.uniform(-0.04, 0.04, (n, 2)), rng.uniform(-0.5, 0.5, (n, 2))])
    table = hard_disks.Table(np.full(n, 0.03), masses, np.zeros(n, dtype=bool), SIDES)
    flight = hard_disks.run(table, hard_disks.Physics(restitution=e, substrate=mu), start, t)
    return flight.xy, [(when, i, j) for when, i, j, *_ in flight.touches if j < n]


def _box(rng: np.random.Generator, name: str, load: float, mu: float, truth: Sequence[Law], beside: str) -> Made:
    t, e, masses = frames(2.0, 240), 0.9, np.full(4, 0.1)
    masses[2] *= 1 + load
    while True:
        xy, met = boxed(rng, masses, mu, e, t)
        # what nothing strikes in what is learnt from shows no load
        if not load or any(2 in (i, j) and when < 0.5 * t[-1] for when, i, j in met):
            break
    walls = tuple(Wall(a, b) for a, b in SIDES)
    bodies, laws = [Body(k, "free", 0.03, 0.1) for k in "abcd"], [use("contact_elastic", restitution=e)]
    return made(rng, name, t, xy, bodies, laws, truth, beside, walls=walls)


def loaded(rng: np.random.Generator, name: str) -> Made:
    load, mu = rng.uniform(0.2, 0.4), 0.003
    truth = [("added_mass", {"beta": load}), ("coulomb_substrate", {"mu": mu})]
    return _box(rng, name, load, mu, truth, "in a box")


def rack(rng: np.random.Generator, name: str) -> Made:
    t, e, mu = frames(2.5, 240), rng.uniform(0.75, 0.82), rng.uniform(0.01, 0.02)
    at = np.array([(0.15, 0.3), (0.5, 0.15), (0.5, 0.3), (0.5, 0.45), (0.7, 0.3)]) + rng.uniform(-0.02, 0.02, (5, 2))
    speed = np.zeros((5, 2))
    speed[0], speed[4] = (1.2, rng.uniform(-0.1, 0.1)), (-0.3, 0.2)
    sides = tuple(((1.5 * a[0], a[1]), (1.5 * b[0], b[1])) for a, b in SIDES)
    table = hard_disks.Table(np.full(5, 0.026), np.full(5, 0.17), np.zeros(5, dtype=bool), sides)
    flight = hard_disks.run(table, hard_disks.Physics(restitution=e, substrate=mu), np.hstack([at, speed]), t)
    bodies, laws = [Body(k, "free", 0.026, 0.17) for k in "abcde"], [use("contact_elastic", restitution=0.95)]
    truth = [("restitution", {"restitution": e}), ("coulomb_substrate", {"mu": mu})]
    walls = tuple(Wall(a, b) for a, b in sides)
    return made(rng, name, t, flight.xy, bodies, laws, truth, "on felt", walls=walls)


def quiet(rng: np.random.Generator, name: str) -> Made:
    return _box(rng, name, 0.0, 0.0, [], "a box of pucks")


ALL = (
    sink, wind, spin, incline, bounce, cradle, coupled, lens, hard, dry, limit, carts, loaded, still, quiet, rests,
    slips, halts, gale, drawn, rack, bent, sags,
)  # fmt: skip
EXPERIMENTS: Experiments = {make.__name__: make for make in ALL}

if __name__ == "__main__":
    sys.exit(main(of=EXPERIMENTS, about=__doc__, stream=31))
