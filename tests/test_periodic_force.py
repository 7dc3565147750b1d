"""What is shaken at a frequency that nobody wrote down: the law, where it is asked for, and what a film tells of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from granswim_pymunk import Body, Scene, Simulation, api, use
from granswim_pymunk.inference.candidates import named_terms, unseen_terms
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.line import lines
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.steps import time_steps

MASS, STIFFNESS, DRAG, NOISE = 0.5, 8.0, 0.05, 5e-4  # kg, N/m, kg/s, m
FREQUENCY, A, B = 0.9, 0.276, -0.117  # Hz, m/s^2, m/s^2
CART = Body("cart", "free", 0.05, MASS)
SPRING = use("spring", bodies=["cart"], anchor=(0.0, 0.0), stiffness=STIFFNESS, length=0.0)


@pytest.mark.parametrize("mode", ["verlet", "chipmunk", "python"])
def test_a_free_body_goes_to_and_fro(mode):
    """m x'' = m a cos w t from rest: x = a (1 - cos w t)/w^2; and y = b (w t - sin w t)/w^2."""
    f, a, b, dt = 2.0, 0.4, 0.3, 1e-4
    law = use("periodic_force", a=(a, 0.0), b=(0.0, b), f=f)
    run = Simulation(Scene((Body("puck", "free", 0.03, 0.2, initial=(0.0, 0.0, 0.0, 0.0)),), (law,)), dt=dt, mode=mode)
    run.advance(7000)
    turn = 2 * math.pi * f * 0.7
    true = np.array([a * (1 - math.cos(turn)), b * (turn - math.sin(turn))]) / (2 * math.pi * f) ** 2
    assert run.state().xy[0] == pytest.approx(true, abs=2e-6)


def shaken(a: float = A, b: float = B, seconds: float = 20.0):
    """A cart on a spring that slows down in air, on a table that is shaken: t [s] and x, y [m] at 30 Hz."""
    t, turn = np.arange(int(30 * seconds)) / 30, 2 * math.pi * FREQUENCY

    def rate(t, s):
        pushed = a * math.cos(turn * t) + b * math.sin(turn * t)
        return [s[1], -(STIFFNESS * s[0] + DRAG * s[1]) / MASS + pushed]

    x = solve_ivp(rate, (0.0, t[-1]), [0.12, 0.0], t_eval=t, rtol=1e-9, atol=1e-11).y[0]
    x = x + np.random.default_rng(4).normal(0.0, NOISE, len(t))
    return t, np.stack([x, np.zeros_like(x)], axis=1)[:, None]


def recording():
    rail = use("rail", bodies=["cart"], direction=(1.0, 0.0))
    scene = Scene((CART,), (rail, SPRING))
    return api.make_recording(*shaken(), scene=scene, position_noise=NOISE)


def test_its_search_begins_at_the_frequency():
    """Beside a drag, as without one the cart's own swings are most of what is left; and no number has to be right."""
    case = prepare(recording(), held_out=False, split=True)
    assert not any(t.mechanism == "periodic_force" for t in named_terms([case]))
    (term,) = unseen_terms([case], "beat")
    fitter = Fitter([case], Predictor(time_steps([case])))
    drag = next(t for t in named_terms([case]) if t.label == "linear_drag")
    fit = fitter.fit(Hypothesis((drag,)), [DRAG])
    strongest, *others = lines(fit, [case], 3)
    assert strongest.frequency == pytest.approx(FREQUENCY, abs=0.5 / 12) and strongest.paid > 1000
    assert all(line.gain < strongest.gain for line in others)
    (signature,) = make_bank(fitter, fit, [term]).signatures
    first = {f.name: f.first for f in signature.term.free}
    assert first["periodic_force.f"] == pytest.approx(FREQUENCY, abs=0.02)
    assert math.hypot(first["periodic_force.a_x"], first["periodic_force.b_x"]) == pytest.approx(0.3, rel=0.2)
    assert "periodic_force.a_y" not in first  # along a rail nothing across shows


@pytest.mark.deep
def test_a_shaken_cart_has_its_drag_and_its_shaker():
    """It was unmodelled, with the frequency of what is left in its words."""
    verdict = api.diagnose(recording()).verdict
    named = {m["name"]: m["parameters"] for m in verdict["mechanisms"]}
    assert set(named) == {"periodic_force", "linear_drag"}, verdict
    for name, key, true in (("linear_drag", "c", DRAG), ("periodic_force", "f", FREQUENCY)):
        told = named[name][key]
        assert told["low"] < true < told["high"] and told["high"] - told["low"] < 0.02 * true, (name, told)
    assert named["periodic_force"]["a"]["value"][0] == pytest.approx(A, rel=0.02)
    assert named["periodic_force"]["b"]["value"][0] == pytest.approx(B, rel=0.03)
