"""Held-out data tell which of a class it is, where training data cannot."""

from __future__ import annotations

import numpy as np
import pytest

from granswim_pymunk import diagnose
from granswim_pymunk.inference.tracks.intervals import precision
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene

NOISE = 1e-4  # m
SPEED, SLOWED = 0.3, 0.1  # m/s, m/s2


def up_a_slope() -> Recording:
    """A puck slides up a slope and comes to rest at 3 s, after all that is learnt from (2.4 s); then it comes back.

    Until it rests a push against its motion and dry friction are the same; friction is one number, a push is two.
    """
    t = np.arange(240) / 60
    x = SPEED * t - SLOWED * t**2 / 2
    xy = np.column_stack([x, np.zeros(len(t))])[:, None]
    xy = np.round(xy + NOISE * np.random.default_rng(3).normal(size=xy.shape), 7)
    scene = Scene((Body("puck", "free", 0.02, 0.05),), ())
    return Recording("puck", scene, t, ("puck",), xy, sampling=60.0, position_noise=NOISE)


@pytest.mark.deep
def test_what_came_back_was_no_friction():
    verdict = diagnose([up_a_slope()]).verdict
    (named,) = verdict["mechanisms"]
    assert named["name"] == "uniform_force" and verdict["heldout"] == "holds"
    assert named["parameters"]["a"]["value"][0] == pytest.approx(-SLOWED, rel=0.02)
    assert any("held-out data tell" in note and "coulomb_substrate" in note for note in verdict["notes"])


def through_air_up_a_slope() -> Recording:
    """The same with a sail: v' = -q v|v| - a, w = sqrt(a/q); v = w tan(w q (s - t)) to rest at s, then -w tanh."""
    t, q, pull, start = np.arange(280) / 60, 2.0, 0.08, 0.6
    w = np.sqrt(pull / q)
    rest = np.arctan(start / w) / (w * q)
    before, after = np.minimum(t, rest), np.maximum(t - rest, 0.0)
    x = (np.log(np.cos(w * q * (rest - before)) / np.cos(w * q * rest)) - np.log(np.cosh(w * q * after))) / q
    xy = np.column_stack([x, np.zeros(len(t))])[:, None]
    xy = np.round(xy + NOISE * np.random.default_rng(4).normal(size=xy.shape), 7)
    scene = Scene((Body("puck", "free", 0.02, 0.05),), ())
    return Recording("puck", scene, t, ("puck",), xy, sampling=60.0, position_noise=NOISE)


@pytest.mark.deep
def test_what_came_back_was_no_friction_beside_a_drag_either():
    verdict = diagnose([through_air_up_a_slope()]).verdict
    named = {m["name"]: m["parameters"] for m in verdict["mechanisms"]}
    assert set(named) == {"quadratic_drag", "uniform_force"} and verdict["heldout"] == "holds"
    assert named["uniform_force"]["a"]["value"][0] == pytest.approx(-0.08, rel=0.03)
    assert named["quadratic_drag"]["c"]["value"] == pytest.approx(2.0 * 0.05, rel=0.03)
    assert any("held-out data tell" in note and "coulomb_substrate" in note for note in verdict["notes"])
    assert all(r["name"] not in named for r in verdict["rivals"])


def test_a_number_by_itself_is_known_where_only_a_sum_of_two_is():
    known = np.array([[1.0, 1.0], [1.0, 1.0]])  # of a sum alone, held by next to nothing beside it
    told = precision(np.linalg.inv(known + 1e-9 * np.eye(2)))
    assert told == pytest.approx([1.0, 1.0], rel=1e-3)
