"""Lift of what spins in the air: the law, where it is asked, and what a film of a ball tells of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from granswim_pymunk import Body, Scene, Simulation, api, use
from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.scene import Wall

MASS, RADIUS = 0.0459, 0.0213


@pytest.mark.parametrize("mode", ["verlet", "chipmunk", "python"])
def test_without_weight_a_ball_flies_in_a_circle_whatever_its_speed(mode):
    """m v^2/R = l v^2: R = m/l, passed in 2 pi R/v at the same speed all along."""
    radius, speed = 0.5, 2.0
    ball = Body("ball", "free", RADIUS, MASS, initial=(0.0, 0.0, speed, 0.0))
    run = Simulation(Scene((ball,), (use("lift", l=MASS / radius),)), dt=1e-4, mode=mode)
    run.advance(round(0.25 * 2 * math.pi * radius / speed / 1e-4))
    state = run.state()
    assert state.xy[0] == pytest.approx([radius, radius], abs=2e-4)
    assert np.hypot(*state.v[0]) == pytest.approx(speed, rel=1e-6)


def flight(c, lift, seed=3, noise=5e-3):
    """A golf ball for two seconds at 60 frames a second."""
    def rate(_, y):
        v = y[2:]
        speed = np.hypot(*v)
        return [*v, *(-c * speed * v + lift * speed * np.array([-v[1], v[0]])) / MASS + [0.0, -9.81]]

    t = np.arange(120) / 60
    xy = solve_ivp(rate, (0.0, 2.0), [0.0, 1.0, 32.0, 14.0], t_eval=t, rtol=1e-9).y[:2].T
    return t, xy[:, None] + np.random.default_rng(seed).normal(0.0, noise, (len(t), 1, 2))


def scene(*laws, **more):
    return Scene((Body("ball", "free", RADIUS, MASS),), laws, gravity=(0.0, -9.81), **more)


@pytest.mark.deep
@pytest.mark.parametrize("lift", [1.6e-4, -0.8e-4, 0.0])
def test_drag_and_lift_of_a_ball_that_spins_are_named(lift):
    c = 2.7e-4
    t, xy = flight(c, lift)
    verdict = api.diagnose(t, xy, scene=scene(), position_noise=5e-3).verdict
    named = {m["name"]: m["parameters"] for m in verdict["mechanisms"]}
    assert set(named) == {"quadratic_drag", *(["lift"] if lift else [])} and verdict["complete"], verdict["notes"]
    for name, key, true in (("quadratic_drag", "c", c), ("lift", "l", lift)):
        if true:
            told = named[name][key]
            assert told["low"] < true < told["high"] and told["high"] - told["low"] < 0.1 * abs(true), (name, told)


def test_it_is_asked_of_what_flies_alone():
    t, xy = flight(2.7e-4, 0.0)

    def asked(scene):
        return "lift" in {term.mechanism for term in named_terms(prepare_all([api.make_recording(t, xy, scene=scene)]))}

    assert asked(scene())
    assert not asked(Scene((Body("ball", "free", RADIUS, MASS),)))  # on a table
    assert not asked(scene(use("pin", bodies=["ball"], anchor=(27.0, 30.0), length=30.0)))
    floor = Wall((-1.0, 0.0), (90.0, 0.0))
    assert not asked(scene(use("contact_elastic", restitution=0.8), walls=(floor,)))
