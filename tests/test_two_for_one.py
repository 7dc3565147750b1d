"""Two simple laws in place of one with as many numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from granswim_pymunk import diagnose, make_recording
from granswim_pymunk.inference.hypothesis import Free, Hypothesis, Term
from granswim_pymunk.inference.tracks.choose import absurd
from granswim_pymunk.inference.tracks.fitted import Fit
from granswim_pymunk.inference.tracks.name import Trial
from granswim_pymunk.inference.tracks.signatures import Signature
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene

NOISE = 2e-5  # m
RATE = 70.0  # frames/s
DRAG = 4e-4  # kg/s
SLOPE = np.array([0.0049, -0.0008])  # m/s2, of a table that is half a millimetre per metre off level


def pucks_on_a_slope() -> Recording:
    """Two pucks that do not meet, v' = -c/m v + a, in closed form; each slows down in a way of its own."""
    bodies = (Body("light", "free", 0.011, 0.0058), Body("heavy", "free", 0.0225, 0.0188))
    places, speeds = np.array([[0.36, 0.20], [0.24, 0.39]]), np.array([[0.073, -0.150], [-0.125, 0.135]])
    t = np.arange(110) / RATE
    tracks = []
    for body, place, speed in zip(bodies, places, speeds, strict=True):
        k = DRAG / body.mass
        end, gone = SLOPE / k, (1 - np.exp(-k * t))[:, None] / k
        tracks.append(place + end * t[:, None] + (speed - end) * gone)
    xy = np.stack(tracks, axis=1)
    xy = np.round(xy + NOISE * np.random.default_rng(7).normal(size=xy.shape), 8)
    names = tuple(b.id for b in bodies)
    return Recording("slope", Scene(bodies, ()), t, names, xy, sampling=RATE, position_noise=NOISE)


@pytest.mark.deep
def test_a_drag_on_a_table_that_is_not_level_is_no_bent_picture():
    """A lens whose middle is sought has three numbers, as both laws together, and leaves a little of each."""
    verdict = diagnose([pucks_on_a_slope()]).verdict
    named = {m["name"]: m["parameters"] for m in verdict["mechanisms"]}
    assert set(named) == {"linear_drag", "uniform_force"}, named
    assert named["linear_drag"]["c"]["value"] == pytest.approx(DRAG, rel=0.05)
    assert named["uniform_force"]["a"]["value"] == pytest.approx(SLOPE, abs=3e-4)


@pytest.mark.deep
def test_a_cart_with_a_fan_is_pushed_and_slowed_and_no_bent_picture():
    """Before it goes at half its last speed a stream would be faster than any body, and a lens bends as much."""
    t, push, rate = np.arange(200) / 50, 0.252, 0.3
    x = push / rate * (t - (1 - np.exp(-rate * t)) / rate)
    xy = np.stack([x, 0 * t], axis=1)[:, None] + np.random.default_rng(9).normal(0, 1e-3, (200, 1, 2))
    verdict = diagnose([make_recording(t, xy, radius=0.05, mass=0.5)]).verdict
    named = {m["name"]: m["parameters"] for m in verdict["mechanisms"]}
    assert set(named) == {"linear_drag", "uniform_force"}, (named, verdict["notes"])
    assert named["uniform_force"]["a"]["value"][0] == pytest.approx(push, rel=0.05)
    assert named["linear_drag"]["c"]["value"] == pytest.approx(rate * 0.5, rel=0.2)


@pytest.mark.parametrize("place", [0, 1])
def test_each_of_two_laws_counts_the_numbers_that_it_uses_itself(place):
    """In their common fit the first law's numbers stand before the other's: what is idle in one is not in the other."""
    drags = Term(
        "joint_drag", "joint_drag (each body)",
        tuple(Free(f"joint_drag.c[{b}]", "N m s", 0.0, math.inf, 1e-5, 1e-5) for b in "ab"), lambda *a: None,
    )  # fmt: skip
    push = Term(
        "uniform_force", "uniform_force",
        (Free("uniform_force.a_x", "m/s2", -math.inf, 20.0, 0.0, 1.0), Free("uniform_force.a_y", "m/s2", -20.0, 20.0,
                                                                          0.0, 1.0)), lambda *a: None,
    )  # fmt: skip
    order = (drags, push) if place == 0 else (push, drags)
    own = {drags.label: (0.0, 2e-5), push.label: (19.99, 3.0)}  # a drag that is none; a push that ends at its bound
    stiffness = Term("spring", "spring", (Free("spring.stiffness", "N/m", 1.0, 9.0, 5.0, 1.0),), lambda *a: None)
    values = np.array([4.0, *own[order[0].label], *own[order[1].label]])
    fit = Fit(Hypothesis((stiffness, *order)), values, {}, {}, {}, 1.0, 9, np.eye(5))
    of_drags, of_push = (Trial(Signature(t, np.zeros((9, 0)), 1.0, 0.0), fit, 0.0, 0.0) for t in (drags, push))
    assert of_drags.used == 1 and of_push.used == 2
    assert tuple(of_drags.values) == own[drags.label] and tuple(of_push.values) == own[push.label]
    assert absurd(of_push) and not absurd(of_drags)
