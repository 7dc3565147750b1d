"""Friction of the impulse, beside contact_elastic."""

import math

import numpy as np
import pytest

from granswim_pymunk.engine import Simulation
from granswim_pymunk.scene import Body, Scene, Time, use
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
