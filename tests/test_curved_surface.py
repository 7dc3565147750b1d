"""Tracks and tables that are bent: a name beside another law, and none by itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from granswim_pymunk import Body, Scene, Simulation, api, use
from granswim_pymunk.inference.candidates import beside_terms, named_terms
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.inference.mechanisms import field_alone
from granswim_pymunk.recording import Recording
from granswim_pymunk.validation import school

G = 9.81


def diagnosed(made):
    r = made.recording
    return api.diagnose(r.t, r.xy, scene=r.scene, position_noise=r.position_noise).verdict


@pytest.mark.parametrize("mode", ["verlet", "chipmunk", "python"])
def test_a_puck_in_a_bowl_swings_as_a_pendulum_of_its_radius(mode):
    curvature = 0.4
    puck = Body("puck", "free", 0.02, 0.1, initial=(0.3, -0.1, 0.0, 0.2))
    bowl = use("curved_surface", curvature=curvature, centre=(0.1, 0.0))
    run, rate = Simulation(Scene((puck,), (bowl,)), dt=1e-4, mode=mode), math.sqrt(G * curvature)
    run.advance(12000)
    turn = rate * 1.2
    assert run.state().xy[0] == pytest.approx(
        [0.1 + 0.2 * math.cos(turn), -0.1 * math.cos(turn) + 0.2 / rate * math.sin(turn)], abs=1e-7
    )


def test_a_table_that_is_bent_along_x_pushes_nothing_along_y():
    puck = Body("puck", "free", 0.02, 0.1, initial=(0.3, -0.1, 0.0, 0.2))
    run = Simulation(Scene((puck,), (use("curved_surface", curvature=-0.2, bent=1),)), dt=1e-4)
    run.advance(10000)
    rate = math.sqrt(0.2 * G)
    assert run.state().xy[0] == pytest.approx([0.3 * math.cosh(rate), 0.1], abs=1e-7)


@pytest.mark.deep
def test_a_car_on_a_bent_track_has_its_friction_and_the_bend():
    made = school.bent(np.random.default_rng(5), "bent-5")
    verdict = diagnosed(made)
    named = {m["name"]: m["parameters"] for m in verdict["mechanisms"]}
    assert set(named) == {"coulomb_substrate", "curved_surface"} and verdict["heldout"] == "holds", verdict["notes"]
    for effect in made.truth["effects"]:
        ((name, true),) = effect["values"].items()
        told = named[effect["name"]][name]
        assert told["low"] < true < told["high"] and told["high"] - told["low"] < 0.3 * true, (name, told)


@pytest.mark.deep
def test_friction_on_a_straight_track_has_none_beside_it():
    t = np.arange(180) / 30
    x = school.rubbed(0.0, lambda _, x: -0.2, 0.004, 0.0, t, v=0.7)
    xy = np.column_stack([x, 0 * x])[:, None] + np.random.default_rng(3).normal(0, 2e-4, (180, 1, 2))
    cart = Body("cart", "free", 0.05, 0.5)
    laws = (use("rail", direction=(1.0, 0.0)), use("uniform_force", a=(-0.2, 0.0)))
    verdict = api.diagnose(t, xy, scene=Scene((cart,), laws), position_noise=2e-4).verdict
    assert [m["name"] for m in verdict["mechanisms"]] == ["coulomb_substrate"], verdict["notes"]


@pytest.mark.deep
def test_by_itself_it_is_no_name():
    """Any smooth force in place is such a surface to first order: alone it is a force without a name."""
    t, rate = np.arange(150) / 30, math.sqrt(G * 0.02)
    x = 0.4 * np.cos(rate * t) + 0.1
    xy = np.column_stack([x, 0 * x])[:, None] + np.random.default_rng(4).normal(0, 2e-4, (150, 1, 2))
    cart = Body("cart", "free", 0.05, 0.5)
    scene = Scene((cart,), (use("rail", direction=(1.0, 0.0)),))
    verdict = api.diagnose(t, xy, scene=scene, position_noise=2e-4).verdict
    assert not {"curved_surface"} & {m["name"] for m in verdict["mechanisms"]}, verdict["mechanisms"]
    assert verdict["verdict"] == "unmodelled" and verdict["mechanisms"], verdict["notes"]
    assert field_alone(["curved_surface"]) and field_alone(["uniform_force", "curved_surface"])
    assert not field_alone(["curved_surface", "linear_drag"]) and not field_alone(["uniform_force"])
    assert not field_alone([]) and field_alone(["spring", "curved_surface"])


def test_it_is_asked_of_what_slides_or_rolls_alone():
    t = np.arange(60) / 30

    def asked(*laws, gravity=(0.0, 0.0)):
        xy = np.column_stack([0.3 * t, 0 * t])[:, None]
        scene = Scene((Body("a", "free", 0.02, 0.1),), laws, gravity=gravity)
        cases = prepare_all([Recording("r", scene, t, ("a",), xy, position_noise=1e-4)], [])
        assert "curved_surface" not in {term.mechanism for term in named_terms(cases)}
        return {term.label for term in beside_terms(cases)}

    rail = use("rail", direction=(1.0, 0.0))
    assert len(asked()) == 3 and asked(rail) and asked(rail, use("gravity"), gravity=(-0.3, 0.0))
    assert not asked(use("gravity"), gravity=(0.0, -G))
    assert not asked(use("spring", anchor=(0.0, 0.0), stiffness=1.0))
    assert not asked(use("pin", bodies=["a"], anchor=(0.0, 1.0), length=1.0))


@pytest.mark.parametrize("frames", [8, 60])
def test_what_was_seen_of_a_surface_leans_by_no_radian(frames):
    """A ball on a ramp was followed by a radius of curvature of 17 mm; friction, and what rolls, do as well."""
    t = np.arange(frames) / 30
    xy = np.column_stack([0.3 * t, 0 * t])[:, None]
    scene = Scene((Body("a", "free", 0.02, 0.1),), (use("rail", direction=(1.0, 0.0)),))
    cases = prepare_all([Recording("r", scene, t, ("a",), xy, position_noise=1e-4)], [])
    seen = 0.3 * t[cases[0].training]
    for term in beside_terms(cases):
        (curvature,) = term.free
        assert curvature.high == -curvature.low == pytest.approx(2 / np.ptp(seen), rel=0.01)
