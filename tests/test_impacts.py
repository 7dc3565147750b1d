"""Friction of the impulse, beside contact_elastic."""

import math
from dataclasses import replace

import numpy as np
import pymunk
import pytest

from granswim_pymunk.engine import Simulation
from granswim_pymunk.engine.advice import advise_dt
from granswim_pymunk.engine.world import World
from granswim_pymunk.scene import Body, Scene, Time, Wall, use
from granswim_pymunk.validation.hard_disks import Physics, Table, run
from granswim_pymunk.validation.reference import Reference

MASS, RADIUS = 0.1, 0.02


def glancing(mu, restitution=0.9, offset=0.02):
    bodies = (
        Body("a", "free", RADIUS, MASS, initial=(-0.1, offset, 1.0, 0.0)),
        Body("b", "free", RADIUS, MASS, initial=(0.0, 0.0, 0.0, 0.0)),
    )
    laws = [use("contact_elastic", restitution=restitution)]
    laws += [use("contact_friction", mu=mu)] if mu else []
    return Scene(bodies, tuple(laws), time=Time(dt=1e-4))


@pytest.mark.parametrize("mu", [0.1, 0.25, 5.0])
def test_closed_solution(mu):
    """A disk strikes one at rest: the impulse across is mu of that along, or what stops the slip (a third of it).

    k = 2/5 of a sphere: slip u_t changes by j_t (2/m + 2 r^2/I) = 7 j_t/m.
    """
    restitution, offset = 0.9, 0.02
    scene = glancing(mu, restitution, offset)
    n = np.array([math.sqrt(1 - (offset / (2 * RADIUS)) ** 2), -offset / (2 * RADIUS)])
    t = np.array([-n[1], n[0]])
    along = (1 + restitution) * MASS / 2 * n[0]
    slip = -t[0]
    across = float(np.clip(-slip * MASS / 7, -mu * along, mu * along))
    after = (along * n + across * t) / MASS
    spin = -RADIUS * across / (0.4 * MASS * RADIUS**2)
    for code in (Simulation(scene), Reference(scene)):
        code.advance(1500)
        state = code.state()
        np.testing.assert_allclose(state.v[1], after, rtol=2e-4, atol=1e-6)
        np.testing.assert_allclose(state.v[0], np.array([1.0, 0.0]) - after, rtol=2e-4, atol=1e-6)
        np.testing.assert_allclose(state.spin, (spin, spin), rtol=2e-4)


@pytest.mark.parametrize("mode", ["verlet", "chipmunk", "python", "batch"])
@pytest.mark.parametrize("beta", [0.25, -0.4])
def test_what_a_body_carries_along_is_struck_too(mode, beta):
    """An impulse is a force for an instant: v_b = (1 + e) v m_a/(m_a + (1 + beta) m_b), and a push is weaker by it."""
    push, restitution = 0.03, 0.8
    scene = glancing(0.0, restitution, offset=0.0)
    laws = (*scene.laws, use("uniform_force", a=(0.0, push)), use("added_mass", beta=beta, bodies=["b"]))
    scene = replace(scene, laws=laws)
    u = (1 + restitution) / (2 + beta)
    before = 0.1 - 2 * RADIUS
    for code in (Simulation(scene, mode=mode), Reference(scene)):
        seen = code.sample(np.array([0.05, 0.15, 0.25]))
        np.testing.assert_allclose(seen[1:, 1, 0], u * (np.array([0.15, 0.25]) - before), atol=1.5e-4)  # v dt
        np.testing.assert_allclose(np.diff(seen[1:, 0, 0]), 0.1 * (1 - (1 + beta) * u), atol=1e-5)
        np.testing.assert_allclose(seen[0, :, 1], 0.5 * push * 0.05**2 / np.array([1, 1 + beta]), rtol=5e-3)


def test_without_friction_nothing_turns():
    run = Simulation(glancing(0.0))
    run.advance(1500)
    assert np.abs(run.state().spin).max() < 1e-13  # rounding of the point of contact; rad/s
    assert abs(run.state().v[1, 1]) > 0.1


def test_some_bodies_rub():
    scene = glancing(0.3)
    only = Scene(scene.bodies, (scene.laws[0], use("contact_friction", mu=0.3, bodies=["a"])), time=scene.time)
    run = Simulation(only)
    run.advance(1500)
    assert np.abs(run.state().spin).max() < 1e-13  # rounding of the point of contact; rad/s


@pytest.mark.parametrize("stretch", [1.0, 5.0])
@pytest.mark.parametrize("drag", [0.0, 0.02])
def test_a_chain_of_impacts_is_where_another_code_has_it(drag, stretch):
    """Five disks, five impacts: to a hundred-thousandth of a millimetre, also where drag bends the way to them.

    With the moment of impact known to a thousandth of a step it was a quarter of a micrometre, and twelve where the
    drag after an impact was still that of before it.
    """
    place = np.array([[-0.2, 0.0], [0.0, 0.01], [0.15, -0.02], [0.04, 0.12], [0.03, -0.14]])
    speed = np.array([[0.8, 0.0], [0.0, 0.0], [-0.6, 0.1], [-0.1, -0.5], [0.0, 0.6]])
    n = len(place)
    table = Table(np.full(n, 0.025), np.full(n, MASS), np.zeros(n, dtype=bool))
    t = np.arange(0.0, 0.5, 0.01)
    flight = run(table, Physics(restitution=0.95, drag=drag), np.hstack([place, speed]), t)
    assert len(flight.touches) >= 5
    bodies = tuple(Body(str(k), "free", 0.025, MASS, initial=(*place[k], *speed[k])) for k in range(n))
    laws = [use("contact_elastic", restitution=0.95)] + ([use("linear_drag", c=drag)] if drag else [])
    scene = Scene(bodies, tuple(laws), time=Time(dt=2e-4))
    seen = Simulation(scene, stretch=stretch).sample(t)
    assert np.abs(seen - flight.xy).max() < 1e-8


LENGTH = 0.3


def bob(wall=None, *others):
    start = (LENGTH * math.sin(-1.0), -LENGTH * math.cos(1.0), 0.0, 0.0)
    pin = use("pin", bodies=["bob"], anchor=(0.0, 0.0), length=LENGTH)
    laws = (use("gravity"), pin, use("contact_elastic", restitution=0.9))
    body = Body("bob", "free", RADIUS, MASS, initial=start)
    return Scene((body, *others), laws, gravity=(0.0, -9.81), walls=() if wall is None else (wall,))


def on_rail():
    laws = (use("rail", bodies=["a"], direction=(1.0, 0.0)), use("contact_elastic", restitution=0.9))
    body = Body("a", "free", RADIUS, MASS, initial=(-0.1, 0.0, 0.5, 0.0))
    return Scene((body,), laws, walls=(Wall((0.1, -0.2), (0.2, 0.2)),))


HELD = {
    "pin, upright wall": lambda: bob(Wall((0.02, -1.0), (0.02, 0.0))),
    "pin, slanted wall": lambda: bob(Wall((-0.1, -0.5), (0.3, -0.2))),
    "pin, post": lambda: bob(None, Body("post", "wall", 0.02, 1.0, initial=(0.02, -0.32, 0.0, 0.0))),
    "rail, slanted wall": on_rail,
}


@pytest.mark.parametrize("scene", HELD.values(), ids=HELD)
def test_what_holds_a_body_takes_its_part_of_an_impulse(scene):
    """Impulses across what holds a body: it stays on its circle or rail, and gives way along it alone."""
    scene = scene()
    times = np.linspace(0.01, 0.9, 37)  # no multiples of the step
    run = Simulation(scene, dt=5e-4)
    path = run.sample(times)[:, 0]
    np.testing.assert_allclose(path, Reference(scene, dt=1e-4).sample(times)[:, 0], atol=2e-6)
    if scene.bodies[0].id == "bob":
        np.testing.assert_allclose(np.hypot(*path.T), LENGTH, atol=1e-6)
    else:
        assert np.abs(path[:, 1]).max() < 1e-9
    assert np.ptp(path, axis=0).max() > 0.1


@pytest.mark.parametrize("joined", ["rod", "hinge"])
def test_joined_bodies_keep_their_energy_in_impacts(joined):
    """Two disks joined to each other bounce about in a box without loss."""
    if joined == "rod":
        link = use("rod", bodies=["a", "b"], length=0.1)
        start = {"a": (0.1, 0.1, 0.8, 0.5), "b": (0.2, 0.1, 0.8, -0.3)}
    else:
        # the hinge is at the centre of b, so a is an arm that swings about it
        link = use("hinge", bodies=["a", "b"], anchor_a=(0.1, 0.0), anchor_b=(0.0, 0.0))
        start = {"a": (0.1, 0.1, 0.8, 0.5), "b": (0.2, 0.1, 0.8, -0.3)}
    bodies = tuple(Body(name, "free", RADIUS, MASS, initial=state) for name, state in start.items())
    scene = Scene.box(0.3, 0.2).add(*bodies, link, use("contact_elastic", restitution=1.0))
    run = Simulation(scene, dt=2e-4)

    def energy():
        state = run.state()
        moment = np.array([b.moment for b in scene.bodies])
        return 0.5 * MASS * (state.v**2).sum() + 0.5 * (moment * state.spin**2).sum()

    before = energy()
    for end in np.linspace(0.1, 0.9, 5):
        path = run.sample(np.array([end]))[0]
        run.advance(3)  # away from an impact, velocities are those of a whole step
        assert math.dist(*path) == pytest.approx(0.1, abs=1e-5)
        assert energy() == pytest.approx(before, rel=2e-2)
    inside = np.array([0.3, 0.2]) - RADIUS + 1e-4
    assert (path > RADIUS - 1e-4).all() and (path < inside).all()


def test_friction_of_impulses_asks_for_no_shorter_step():
    assert advise_dt(glancing(0.25)) == advise_dt(glancing(0.0))


@pytest.mark.parametrize("end", [0.2, 0.2999996, 0.3000004, 0.30042, 0.61])
def test_velocities_are_those_of_the_time_between_two_steps(end):
    """Steps beside impulses are of any length, and half of the last one is what velocities are ahead by."""
    e, g, height = 0.8, 9.81, 0.3
    ball = Body("ball", "free", 0.02, 0.01, initial=(0.0, 0.02 + height, 0.2, 0.0))
    floor = Wall((-2.0, 0.0), (2.0, 0.0))
    laws = (use("contact_elastic", restitution=e),)
    scene = Scene((ball,), laws, gravity=(0.0, -g), walls=(floor,), time=Time(dt=1e-3))
    simulation = Simulation(scene, averaged=True, stretch=5.0)
    simulation.sample(np.array([0.0, 0.1, end]))
    met = math.sqrt(2 * height / g)
    v = -g * end if end < met else e * g * met - g * (end - met)
    assert simulation.state().v[0, 1] == pytest.approx(v, abs=2e-5)


def test_a_clump_that_meets_without_end_comes_to_an_end():
    """Disks in a box that a strong attraction presses together: gone to one by one, their impacts took minutes."""
    rng = np.random.default_rng(1)
    places = [(0.06 * (k % 5) + 0.01 * rng.random(), 0.06 * (k // 5) + 0.01 * rng.random()) for k in range(24)]
    bodies = tuple(
        Body(f"b{k}", "free", 0.015, 0.02, initial=(x, y, *0.3 * rng.normal(size=2))) for k, (x, y) in enumerate(places)
    )
    corners = [(-0.03, -0.03), (0.34, -0.03), (0.34, 0.34), (-0.03, 0.34)]
    walls = tuple(Wall(a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True))
    laws = (use("contact_elastic", restitution=0.5), use("cohesion", force=150.0, range=0.07))
    simulation = Simulation(Scene(bodies, laws, time=Time(dt=2e-4), walls=walls), averaged=True, stretch=5)
    xy = simulation.sample(np.linspace(0.0, 0.03, 3))
    assert np.isfinite(xy).all()
    assert np.abs(xy).max() < 0.4


def lively():
    """Disks in a box that meet one another and the walls, fall, come to rest on the floor and rub."""
    rng = np.random.default_rng(3)
    places = [(0.05 + 0.06 * i, 0.05 + 0.07 * j) for i in range(3) for j in range(2)]
    bodies = tuple(
        Body(f"d{k}", "free", 0.02 + 0.001 * k, MASS, initial=(*place, *rng.normal(size=2)))
        for k, place in enumerate(places)
    )
    laws = (use("contact_elastic", restitution=0.6), use("contact_friction", mu=0.2))
    scene = Scene.box(0.25, 0.2).add(*bodies, *laws)
    return replace(scene, gravity=(0.0, -9.81), time=Time(dt=1e-3))


def test_steps_in_which_nothing_touches_need_no_rounds(monkeypatch):
    """Once through Chipmunk's solver, or a hundred times: the same bits, through impacts and at rest."""
    times = np.linspace(0.0, 1.5, 151)
    once = Simulation(lively())
    assert once.backend.world.rounds() == (100, 1)
    found = once.sample(times)
    assert once.state().xy[:, 1].min() < 0.03  # some lie on the floor
    monkeypatch.setattr(World, "rounds", lambda self: (100, 100))
    np.testing.assert_array_equal(found, Simulation(lively()).sample(times))


def test_what_a_user_puts_into_the_space_is_solved_in_all_rounds():
    run = Simulation(lively())
    floor = pymunk.Segment(run.space.static_body, (-1e3, -1e3), (-1e3, -2e3), 0.0)
    run.space.add(floor)
    assert run.backend.world.rounds() == (100, 100)
    run.advance(10)
    assert run.space.iterations == 100


@pytest.mark.parametrize(("dt", "stretch"), [(0.00041665, 1.0), (0.00041665, 5.0), (1 / 2400, 5.0)])
def test_a_rail_holds_between_stamps_that_no_number_of_steps_divides(dt, stretch):
    """What was left of each frame was a step of its own, in which joints held: weight then moved a cart by 7 mm."""
    bodies = (
        Body("a", "free", 0.03, MASS, initial=(0.0, 0.0, 0.3, 0.0)),
        Body("b", "free", 0.03, MASS, initial=(0.5, 0.0, -0.05, 0.0)),
    )
    laws = (use("rail", direction=(1.0, 0.0)), use("contact_elastic", restitution=0.9), use("gravity"))
    run = Simulation(Scene(bodies, laws, gravity=(0.0, -9.81)), dt=dt, averaged=True, stretch=stretch)
    seen = run.sample(np.arange(0.0, 3.0, 1 / 120))
    assert np.abs(seen[:, :, 1]).max() < 1e-5
    np.testing.assert_allclose(seen[-1, :, 0], (0.32077083, 0.92714583), atol=1e-7)
