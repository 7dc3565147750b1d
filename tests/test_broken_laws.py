"""The reference shares no law code with the engine: a law that is broken in the engine makes the two part."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.engine import Simulation
from granswim_pymunk.laws import all_laws
from granswim_pymunk.scene import Body, Scene, Wall, swimmer, use
from granswim_pymunk.validation.reference import Reference

OFF = 1.01  # what a broken law's answer is multiplied by
MASS = 0.2


def sliding(*laws, **more):
    bodies = (
        Body("a", "free", 0.01, MASS, initial=(0.0, 0.0, 0.3, 0.1)),
        Body("b", "free", 0.02, 2 * MASS, initial=(0.2, 0.1, -0.1, 0.2)),
    )
    return Scene(bodies, laws, **more), 1e-3


def pressed(*laws):
    """Three disks and a wall, all of which overlap a little, sliding along each other."""
    bodies = (
        Body("a", "free", 0.01, MASS, initial=(0.0, 0.0, 0.3, 0.1)),
        Body("b", "free", 0.02, 2 * MASS, initial=(0.0298, 0.001, -0.1, 0.4)),
        Body("c", "free", 0.01, MASS, initial=(0.012, -0.0158, 0.1, 0.2)),
    )
    own = () if any(item.name == "contact_hertz" for item in laws) else (use("contact_linear", stiffness=400.0),)
    return Scene(bodies, (*own, *laws), walls=(Wall((-0.0098, -1.0), (-0.0098, 1.0)),)), 1e-4


def carts(*laws):
    springs = [
        use("spring", bodies=["a"], anchor=(0.0, 0.0), stiffness=3.0, length=0.06),
        use("spring", bodies=["b"], anchor=(0.5, 0.1), stiffness=2.0),
    ]
    scene, dt = sliding(*springs, *laws)
    return scene.with_initial({"a": (0.1, 0.02, 0.3, 0.1)}), dt


def pendulum(*laws):
    start = (0.3 * math.sin(0.5), -0.3 * math.cos(0.5), 0.4 * math.cos(0.5), 0.4 * math.sin(0.5))
    body = Body("bob", "free", 0.02, MASS, initial=start, inertia=4e-4)
    pin = use("pin", bodies=["bob"], anchor=(0.0, 0.0), length=0.3)
    return Scene((body,), (use("gravity"), pin, *laws), gravity=(0.0, -9.81)), 1e-5


def driven(*laws):
    t = np.linspace(0.0, 0.3, 31)
    scene, dt = sliding(use("drive", bodies=["a"], gain=0.5), *laws)
    return replace(scene, inputs={"a": (tuple(t), tuple(np.cos(20 * t)))}), dt


def worm(*laws, form="leader"):
    """A bent swimmer whose disks move, its head at an angle."""
    rng = np.random.default_rng(2)
    disks = [
        replace(b, initial=tuple(np.array(b.initial) + rng.normal(size=4) * [2e-4, 2e-4, 5e-3, 5e-3]))
        for b in swimmer(disks=5)
    ]
    own = (
        use("union", stiffness=100.0, damping=1e3),
        use("bending", stiffness=2e-3, damping=1e2, amplitude=0.7, frequency=9.0, phase=1.0, form=form),
    )
    return Scene(tuple(disks), (*own, *laws)), 2e-5


def on_a_rail(*laws):
    return sliding(use("rail", bodies=["a"], direction=(0.6, 0.8)), use("uniform_force", a=(0.5, -0.2)), *laws)


OF_A_SWIMMER = {
    "nonlinear_bending": {"k_3": 2.0}, "weak_joint": {"factor": 10.0, "joint": 1}, "resting_curvature": {"phi_0": 0.3},
    "joint_friction": {"force": 1e-3}, "head_force": {"force": 2e-3, "angle": 0.7}, "actuator_lag": {"tau": 1e-3},
    "actuator_delay": {"tau": 1e-3}, "actuator_saturation": {"limit": 0.05},
}  # fmt: skip
CASES = [
    ("gravity", lambda: sliding(use("gravity"), gravity=(0.0, -9.81))),
    ("uniform_force", lambda: sliding(use("uniform_force", a=(0.5, -0.2)))),
    ("linear_drag", lambda: sliding(use("linear_drag", c=0.1, p=1))),
    ("quadratic_drag", lambda: sliding(use("quadratic_drag", c=0.3, p=2))),
    ("coulomb_substrate", lambda: sliding(use("coulomb_substrate", mu=0.05))),
    ("coulomb_substrate", lambda: sliding(use("dry_friction", mu=0.05))),
    ("confinement", lambda: sliding(use("confinement", mu_eff=0.3, layers=1.0))),
    ("ambient_flow", lambda: sliding(use("ambient_flow", c=0.1, u=(0.3, -0.1)))),
    ("ambient_flow", lambda: sliding(use("quadratic_flow", c=0.3, u=(0.3, -0.1), p=1))),
    ("added_mass", lambda: sliding(use("uniform_force", a=(0.5, -0.2)), use("added_mass", beta=0.4))),
    ("spring", carts),
    ("lift", lambda: sliding(use("lift", l=-0.3))),
    ("periodic_force", lambda: sliding(use("periodic_force", a=(0.4, -0.2), b=(0.1, 0.3), f=1.3))),
    ("curved_surface", lambda: sliding(use("curved_surface", curvature=0.4, centre=(0.1, 0.2)))),
    ("nonlinear_spring", lambda: carts(use("nonlinear_spring", k_3=400.0))),
    ("wall_drag", lambda: pressed(use("wall_drag", c=0.5, range=0.01))),
    ("contact_linear", pressed),
    ("contact_hertz", lambda: pressed(use("contact_hertz", stiffness=1e5, damping=7.0))),
    ("contact_friction", lambda: pressed(use("contact_friction", mu=0.4))),
    ("rolling_resistance", lambda: pressed(use("contact_friction", mu=0.4), use("rolling_resistance", mu_r=0.3))),
    ("cohesion", lambda: pressed(use("cohesion", force=0.1, range=1e-2))),
    ("distance_force", lambda: sliding(use("distance_force", s=1.0, n=2.0))),
    ("point_force", lambda: sliding(use("point_force", s=0.5, a=(0.1, 0.2), n=2.0))),
    ("point_force", lambda: sliding(use("buried_force", s=0.5, a=(0.1, 0.2), n=2, b=0.05))),
    ("pair_spring", lambda: carts(use("pair_spring", k=2.0, f_0=0.7))),
    ("pair_lubrication", lambda: pressed(use("pair_lubrication", c=3.0, range=2e-3))),
    ("pin", pendulum),
    ("joint_friction", lambda: pendulum(use("joint_friction", torque=0.1))),
    ("joint_friction", lambda: pendulum(use("pin_stiction", torque=0.1))),
    ("joint_drag", lambda: pendulum(use("joint_drag", c=0.05))),
    ("rail", on_a_rail),
    ("drive", driven),
    *[(name, functools.partial(worm, form=form)) for name in ("union", "bending")
      for form in ("leader", "elastic", "head_axis")],
    *[(name, functools.partial(worm, use(name, **values), form=form)) for name, values in OF_A_SWIMMER.items()
      for form in ("leader", "elastic")],
    ("actuator_lag", lambda: driven(use("actuator_lag", tau=0.03))),
    ("actuator_delay", lambda: driven(use("actuator_delay", tau=0.03))),
    ("actuator_saturation", lambda: driven(use("actuator_saturation", limit=0.2))),
    ("actuator_deadband", lambda: driven(use("actuator_deadband", width=0.2))),
]  # fmt: skip
# without a force that a factor could be put on: Chipmunk's own impulse (see below), and what holds bodies together,
# which test_links holds against an integrator of its own
ELSE = {"contact_elastic", "hinge", "rod"}


def broken(law):
    """The law with all that it answers off by one per cent."""

    @functools.wraps(law.function)
    def function(*values):
        found = law.function(*values)
        return tuple(OFF * v for v in found) if isinstance(found, tuple) else OFF * found

    @functools.wraps(law.function)
    def on_a_chain(*values):
        given = dict(zip(law.arguments, values, strict=True))
        fresh = {name: np.zeros_like(given[name]) for name in ("fx", "fy")}
        law.function(*(given | fresh).values())
        for name, force in fresh.items():
            given[name] += OFF * force

    def series(t, value, **numbers):
        times, followed = law.series(t, value, **numbers)
        return times, OFF * followed

    whole = law.kind == "chain" and not law.sees_joint
    return replace(law, function=on_a_chain if whole else function, series=law.series and series)


def ends(run, steps=60):
    run.advance(steps)
    return run.state().xy


@pytest.mark.parametrize(("name", "make"), CASES, ids=[f"{k}-{name}" for k, (name, _) in enumerate(CASES)])
def test_a_broken_law_is_seen(name, make):
    scene, dt = make()
    scene = replace(scene, time=replace(scene.time, scheme="half_step"))
    reference = ends(Reference(scene, dt=dt))
    sound = np.abs(ends(Simulation(scene, mode="python", dt=dt)) - reference).max()
    meant = [item.law.mechanism == name for item in scene.laws]
    assert any(meant)
    laws = [replace(item, law=broken(item.law)) if it else item for item, it in zip(scene.laws, meant, strict=True)]
    off = np.abs(ends(Simulation(replace(scene, laws=tuple(laws)), mode="python", dt=dt)) - reference).max()
    assert off > 20 * sound and off > 1e-13


def test_no_law_is_left_out():
    shipped = {law.mechanism for law in all_laws().values() if law.shipped and not law.name.startswith("flexible_")}
    assert shipped == {name for name, _ in CASES} | ELSE


def test_a_broken_impulse_is_seen():
    bodies = (
        Body("a", "free", 0.01, MASS, initial=(0.0, 0.0, 0.5, 0.0)),
        Body("b", "free", 0.01, MASS, initial=(0.0205, 0.004, 0.0, 0.0)),
    )
    scene = Scene(bodies, (use("contact_elastic", restitution=0.8),))
    reference = ends(Reference(scene, dt=1e-4), 200)
    sound = np.abs(ends(Simulation(scene, dt=1e-4), 200) - reference).max()
    wrong = scene.with_parameter("contact_elastic.restitution", 0.8 * OFF)
    assert np.abs(ends(Simulation(wrong, dt=1e-4), 200) - reference).max() > 20 * sound


# what other numbers of a law are made of more than its tables of: commands that a series makes longer
MADE_ANEW = {"actuator_lag"}


@pytest.mark.parametrize("scheme", ["half_step", "exact"])
@pytest.mark.parametrize(("name", "make"), CASES, ids=[f"{k}-{name}" for k, (name, _) in enumerate(CASES)])
def test_laws_with_other_numbers_run_as_in_a_new_simulation(name, make, scheme):
    """A simulation that was run with other numbers, given those of the scene and begun again: the same bits."""
    scene, dt = make()
    scene = replace(scene, time=replace(scene.time, scheme=scheme))
    start = np.array([b.initial for b in scene.bodies])
    times = scene.time.start + dt * np.arange(0.0, 60.0, 7.3)

    def other(item):
        """Its numbers a tenth more, as far as their range goes; lists of pairs are laid out for how far it reaches."""
        values = {}
        for p in item.law.parameters if item.law.mechanism == name else ():
            if item.law.reach and p.name not in item.law.strength:
                continue
            if isinstance(item.values[p.name], float):
                values[p.name] = min(1.1 * item.values[p.name], p.high)
            elif isinstance(item.values[p.name], tuple) and p.name != "direction":
                values[p.name] = tuple(1.1 * v for v in item.values[p.name])
        return item.with_values(**values)

    fresh = Simulation(scene, dt=dt, averaged=True).sample(times)
    before = Simulation(replace(scene, laws=tuple(map(other, scene.laws))), dt=dt, averaged=True)
    differs = not np.array_equal(before.sample(times), fresh)
    if not before.retune(scene.laws):
        assert name in MADE_ANEW
        return
    before.restart(start[:, :2], start[:, 2:], scene.time.start)
    assert np.array_equal(before.sample(times), fresh)
    assert differs or all(other(item).values == item.values for item in scene.laws)
    assert not before.retune(scene.laws[1:]) and (not scene.laws[1:] or not before.retune(scene.laws[::-1]))


def meeting(*laws):
    """Disks that meet twice and go on from impact to impact."""
    bodies = (
        Body("a", "free", 0.01, MASS, initial=(0.0, 0.0, 0.5, 0.0)),
        Body("b", "free", 0.01, MASS, initial=(0.0205, 0.004, 0.0, 0.0)),
        Body("c", "free", 0.015, MASS, initial=(0.06, -0.01, -0.2, 0.05)),
    )
    return Scene(bodies, (use("contact_elastic", restitution=0.8), *laws)), 1e-3


def arms(*laws):
    """Two arms, one hung from the other."""
    bodies = (
        Body("upper", "free", 0.01, 0.2, inertia=6e-4, initial=(0.1, 0.0, 0.0, 0.0)),
        Body("lower", "free", 0.01, 0.1, inertia=2e-4, initial=(0.2, -0.08, 0.0, 0.0)),
    )
    hinges = (
        use("hinge", bodies=["upper"], anchor=(0.0, 0.0), anchor_a=(-0.1, 0.0)),
        use("hinge", bodies=["upper", "lower"], anchor_a=(0.1, 0.0), anchor_b=(0.0, 0.08)),
    )
    return Scene(bodies, (use("gravity"), *hinges, *laws), gravity=(0.0, -9.81)), 1e-4


def cart(*laws):
    """A cart on a rail that follows commands, as far as its motor does."""
    bodies = (Body("cart", "free", 0.01, 0.2, initial=(0.0, 0.0, 0.0, 0.0)),)
    commands = {"cart": ((0.0, 0.1, 0.2, 0.3), (0.0, 1.0, -1.0, 0.0))}
    return Scene(bodies, (use("rail", bodies=["cart"], direction=(1.0, 0.0)), *laws), inputs=commands), 1e-3


def motor(gain):
    return use("drive", bodies=["cart"], gain=gain)


def boxed(*laws):
    """Two disks that meet each other and the walls of a box."""
    scene = Scene.box(0.1, 0.06)
    a = Body("a", "free", 0.01, MASS, initial=(0.02, 0.02, 0.9, 0.35))
    b = Body("b", "free", 0.01, MASS, initial=(0.06, 0.031, -0.4, 0.1))
    return replace(scene, bodies=(a, b, *scene.bodies), laws=laws), 1e-3


def bounce(restitution, walls=None):
    walls = {} if walls is None else {"wall_restitution": walls}
    return use("contact_elastic", restitution=restitution, **walls)


def rub(mu, *bodies):
    return use("contact_friction", mu=mu, bodies=bodies or None)


PUSH = use("uniform_force", a=(0.4, 0.1))
LIMIT = use("actuator_saturation", limit=0.5)


@pytest.mark.parametrize(
    ("make", "before", "after", "tables"),
    [
        (meeting, [use("linear_drag", c=0.3, p=1)], [use("linear_drag", c=0.2, p=1)], True),
        (meeting, [PUSH], [use("uniform_force", a=(0.1, -0.3))], True),
        (meeting, [use("contact_friction", mu=0.01)], [use("contact_friction", mu=0.02)], True),
        (boxed, [bounce(0.8), rub(0.1)], [bounce(0.6, 0.9), rub(0.3)], True),
        (boxed, [bounce(0.8), rub(0.1, "a"), rub(0.2, "b")], [bounce(0.8), rub(0.3, "a"), rub(0.4, "b")], True),
        (boxed, [bounce(0.8), rub(0.1, "a"), rub(0.2, "b")], [bounce(0.8), rub(0.3, "a"), rub(0.3, "b")], False),
        (boxed, [bounce(0.8), rub(0.1, "a"), rub(0.1, "b")], [bounce(0.8), rub(0.3, "a"), rub(0.4, "b")], False),
        (meeting, [PUSH, use("added_mass", beta=0.2)], [PUSH, use("added_mass", beta=0.4)], False),
        (cart, [motor(0.9), LIMIT], [motor(0.7), LIMIT], True),
        (arms, [use("joint_drag", c=1e-3)], [use("joint_drag", c=2e-3)], True),
        (arms, [use("linear_drag", c=0.3, p=1)], [use("linear_drag", c=0.2, p=1)], True),
        (arms, [use("added_mass", beta=0.2)], [use("added_mass", beta=0.4)], False),
    ],
)
def test_beside_impacts_and_hinges_too_and_not_where_more_than_tables_is_made_of_them(make, before, after, tables):
    (other, dt), (scene, _) = make(*before), make(*after)
    start, times = np.array([b.initial for b in scene.bodies]), np.arange(0.0, 0.3, 0.021)
    fresh = Simulation(scene, dt=dt, averaged=True).sample(times)
    simulation = Simulation(other, dt=dt, averaged=True)
    assert not np.array_equal(simulation.sample(times), fresh)
    assert simulation.retune(scene.laws) == tables
    if tables:
        simulation.restart(start[:, :2], start[:, 2:], scene.time.start)
        assert np.array_equal(simulation.sample(times), fresh)
