"""Two simple laws in place of one with as many numbers."""

from __future__ import annotations

import numpy as np
import pytest

from granswim_pymunk import diagnose
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


def test_a_drag_on_a_table_that_is_not_level_is_no_bent_picture():
    """A lens whose middle is sought has three numbers, as both laws together, and leaves a little of each."""
    verdict = diagnose([pucks_on_a_slope()]).verdict
    named = {m["name"]: m["parameters"] for m in verdict["mechanisms"]}
    assert set(named) == {"linear_drag", "uniform_force"}, named
    assert named["linear_drag"]["c"]["value"] == pytest.approx(DRAG, rel=0.05)
    assert named["uniform_force"]["a"]["value"] == pytest.approx(SLOPE, abs=3e-4)
