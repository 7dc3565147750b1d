"""Dry friction that holds what it has brought to rest: against a solution by hand and the reference, and diagnosed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk import Body, Recording, Scene, Simulation, use
from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.tracks import diagnose_tracks
from granswim_pymunk.validation.reference import Reference, exact

MASS, STIFFNESS, G, START = 0.25, 8.0, 9.81, 0.12
SPRING = use("spring", anchor=(0.0, 0.0), stiffness=STIFFNESS, length=0.0)
RAIL = use("rail", direction=(1.0, 0.0))


def cart(*laws, start=(START, 0.0, 0.0, 0.0), **more):
    return Scene((Body("cart", "free", 0.03, MASS, initial=start),), laws, **more)


def half_swings(mu, t):
    """(T,) places of a cart let go at START: half swings about +-mu m g/k, each less far by twice that, to a stop."""
    rate, off, side = math.sqrt(STIFFNESS / MASS), mu * MASS * G / STIFFNESS, 1.0
    x, far, begin = np.full(len(t), np.nan), START, 0.0
    while side * far > off:
        now = (t >= begin) & (t <= begin + math.pi / rate)
        x[now] = side * off + (far - side * off) * np.cos(rate * (t[now] - begin))
        far, begin, side = 2 * side * off - far, begin + math.pi / rate, -side
    x[t >= begin] = far
    return x


def followed(scene, t, dt, mode="verlet"):
    simulation, seen = Simulation(scene, dt=dt, mode=mode), []
    for now in t:
        simulation.advance(round(now / dt) - simulation.step)
        seen.append(simulation.state().xy[0])
    return np.array(seen)


@pytest.mark.parametrize("mode", ["verlet", "chipmunk", "python"])
def test_a_cart_on_a_spring_stops_beside_the_middle(mode):
    t, mu = np.linspace(0.0, 5.0, 101), 0.03
    expected = half_swings(mu, t)
    assert expected[-1] == expected[-10] and abs(expected[-1]) > 2e-3  # it rests, and not where the spring is slack
    off = [np.abs(followed(cart(RAIL, SPRING, use("dry_friction", mu=mu)), t, dt, mode)[:, 0] - expected).max()
           for dt in (2e-3, 1e-3)]  # fmt: skip
    assert off[1] < 5e-5
    assert off[1] < 0.4 * off[0]  # of second order in the step


def test_a_puck_that_slides_stops_after_v_squared_over_twice_mu_g():
    mu, speed = 0.05, np.array([0.3, 0.4])
    seen = followed(cart(use("dry_friction", mu=mu), start=(0.0, 0.0, *speed)), np.array([1.5, 3.0]), 1e-3)
    far = speed @ speed / (2 * mu * G)
    assert seen[-1] == pytest.approx(far * speed / np.hypot(*speed), abs=1e-6)
    assert (seen[0] == seen[1]).all()


def test_a_pendulum_stays_where_its_bearing_stops_it():
    """Held against small steps of the equation, friction up to M against what is left of the motion."""
    length, torque, dt = 0.4, 0.06, 1e-5
    moment, angle, rate, now = MASS * length**2, 0.8, 0.0, 0.0
    while now < 5.0:
        pull = -G / length * math.sin(angle)
        after = rate + dt * (pull - math.copysign(torque / moment, rate or pull))
        rate = after if after * (rate or pull) > 0 else 0.0
        angle, now = angle + dt * rate, now + dt
    start = (length * math.sin(0.8), -length * math.cos(0.8), 0.0, 0.0)
    pin = use("pin", anchor=(0.0, 0.0), length=length, bodies=["cart"])
    scene = cart(use("gravity"), pin, use("pin_stiction", torque=torque), start=start, gravity=(0.0, -G))
    seen = followed(scene, np.array([5.0, 6.0]), 1e-3)
    assert abs(angle) > 5e-3  # not where it hangs straight down
    assert math.atan2(seen[0, 0], -seen[0, 1]) == pytest.approx(angle, abs=3e-4)
    assert np.abs(seen[1] - seen[0]).max() < 1e-14
    for more in ((), (use("added_mass", beta=0.2),)):
        scene = replace(scene, laws=(*scene.laws, *more))
        one, other = Reference(scene, dt=1e-3, start="leapfrog"), Simulation(scene, dt=1e-3, start="leapfrog")
        one.advance(5000)
        other.advance(5000)
        np.testing.assert_allclose(other.state().xy, one.state().xy, rtol=0, atol=1e-8)


def test_friction_of_a_pin_slows_what_is_carried_along_too():
    """More inertia, the same torque: a body that turns without weight slows down less, by its share."""
    torque, length, speed, beta, t = 0.01, 0.4, 2.0, 0.25, 0.5
    pin = use("pin", anchor=(0.0, 0.0), length=length, bodies=["cart"])
    laws = (pin, use("pin_stiction", torque=torque), use("added_mass", beta=beta))
    simulation = Simulation(cart(*laws, start=(0.0, -length, speed, 0.0)), dt=1e-4)
    simulation.advance(5000)
    after = speed - t * torque / (MASS * (1 + beta) * length)
    assert np.hypot(*simulation.state().v[0]) == pytest.approx(after, abs=1e-5)


def test_on_a_slope_it_holds_up_to_its_angle():
    slope = {"gravity": (0.0, -G), "start": (0.0, 0.0, 0.0, 0.0)}
    for tangent, slides in ((0.04, False), (0.06, True)):
        rail = use("rail", direction=(1.0, -tangent))
        seen = followed(cart(use("gravity"), rail, use("dry_friction", mu=0.05), **slope), np.array([1.0]), 1e-3)
        # what presses on the rail is told by mu m g, whatever its angle
        along = max(G * tangent / math.hypot(1, tangent) - 0.05 * G, 0.0)
        assert np.hypot(*seen[0]) == pytest.approx(along / 2, abs=1e-9)
        assert (np.hypot(*seen[0]) > 0.01) == slides


def test_engine_and_reference_agree_with_drags_and_inertia_beside_it():
    bodies = (
        Body("a", "free", 0.03, MASS, initial=(START, 0.0, 0.0, 0.0)),
        Body("b", "free", 0.03, 0.1, initial=(0.3, 0.2, 0.4, -0.3)),
    )
    beside = (use("linear_drag", c=0.02), use("added_mass", beta=0.3))
    scene = Scene(bodies, (*beside, SPRING, use("dry_friction", mu=0.03)))
    one, other = Reference(scene, dt=1e-3, start="leapfrog"), Simulation(scene, dt=1e-3, start="leapfrog")
    one.advance(4000)
    other.advance(4000)
    np.testing.assert_allclose(other.state().xy, one.state().xy, rtol=0, atol=1e-12)


@pytest.mark.deep
def test_a_cart_that_rests_beside_the_middle_is_told_from_one_that_creeps():
    """With friction that is smooth below 1 mm/s the rest is a creep, and a drag beside it or a scale takes it up."""
    t, mu, noise = np.arange(0.0, 4.0, 1 / 60), 0.06, 2e-4
    rng = np.random.default_rng(4)
    xy = np.column_stack([half_swings(mu, t), np.zeros(len(t))]) + rng.normal(0.0, noise, (len(t), 2))
    scene = Scene((Body("cart", "free", 0.03, MASS),), (RAIL, SPRING))
    film = Recording("film", scene, t, ("cart",), xy[:, None], title="a cart", sampling=60.0, position_noise=noise)
    verdict = diagnose_tracks([film]).verdict
    (entry,) = verdict["mechanisms"]
    assert (verdict["verdict"], entry["name"], verdict["complete"]) == ("missing_physics", "coulomb_substrate", True)
    found = entry["parameters"]["mu"]
    assert found["low"] < mu < found["high"] and found["high"] - found["low"] < 0.05 * mu


def test_integrators_of_smooth_forces_refuse_it():
    with pytest.raises(InputError, match="comes to rest"):
        exact(cart(use("dry_friction", mu=0.03)), np.array([1.0]))
