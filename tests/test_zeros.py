"""Sensors of angles whose zeros are off: two encoders, each switched on where its arm happened to hang."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from granswim_pymunk import Body, Scene, api, use
from granswim_pymunk.inference.camera_terms import camera_terms
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.steps import time_steps

LENGTH, NOISE, ZEROS = 0.64, 1.5e-3, (math.radians(-0.64), math.radians(1.04))  # m, rad, rad
BODIES = (Body("left", "free", 0.03, 1.0), Body("right", "free", 0.03, 1.0))


def swings(stiffness: float, drag: float, zeros=ZEROS, seconds: float = 12.0):
    """Two pendulums with a spring [N/m] between their bobs, 0.3 m apart, and a drag c/m [1/s]: t [s], angles [rad]."""
    t = np.arange(int(20 * seconds)) / 20

    def rate(_, s):
        apart = stiffness * (math.sin(s[0]) - math.sin(s[1]))
        pull = np.array([-apart * math.cos(s[0]), apart * math.cos(s[1])]) / LENGTH
        return [*s[2:], *(-9.81 / LENGTH * np.sin(s[:2]) + LENGTH * pull / LENGTH - drag * s[2:])]

    angles = solve_ivp(rate, (0.0, t[-1]), [0.15, 0.02, 0.0, 0.0], t_eval=t, rtol=1e-9, atol=1e-11).y[:2].T
    return t, angles + np.array(zeros) + np.random.default_rng(2).normal(0.0, NOISE, angles.shape)


def recording(t, angles, *laws):
    pins = [use("pin", bodies=[b.id], anchor=(0.3 * k, 0.0), length=LENGTH) for k, b in enumerate(BODIES)]
    scene = Scene(BODIES, (*pins, *laws), gravity=(0.0, -9.81))
    nowhere = np.full((*angles.shape, 2), np.nan)
    return api.make_recording(t, nowhere, angle=angles, scene=scene)


def test_each_sensor_has_a_zero_of_its_own():
    case, *_ = prepare_all([recording(*swings(0.0, 0.0))])
    terms = {t.label: t for t in camera_terms([case])}
    both = terms["tracking_bias of every angle"]
    assert [f.name for f in both.free] == ["camera.zero[left]", "camera.zero[right]"]
    assert terms["tracking_bias of the angle of left"].bodies == ("left",)
    fitter = Fitter([case], Predictor(time_steps([case])))
    plain, fit = fitter.fit(Hypothesis(), None), fitter.fit(Hypothesis((both,)), [0.0, 0.0])
    assert plain.chi2 > 10 * fit.chi2 and fit.chi2 < 1.3 * fit.count
    assert fit.values == pytest.approx(ZEROS, abs=4 * max(np.sqrt(np.diag(fit.covariance))))


def test_of_one_sensor_it_is_a_picture_that_is_turned():
    t, angles = swings(0.0, 0.0)
    scene = Scene(BODIES[:1], (use("pin", bodies=["left"], anchor=(0.0, 0.0), length=LENGTH),), gravity=(0.0, -9.81))
    nowhere = np.full((len(t), 1, 2), np.nan)
    one = api.make_recording(t, nowhere, angle=angles[:, :1], scene=scene)
    assert not any(t.mechanism == "tracking_bias" for t in camera_terms(prepare_all([one])))


@pytest.mark.deep
def test_zeros_are_told_beside_a_drag():
    """They were two pushes, which no two arms on one axle have."""
    verdict = api.diagnose(recording(*swings(0.0, 0.05))).verdict
    named = [(m["name"], m["bodies"]) for m in verdict["mechanisms"]]
    assert {name for name, _ in named} == {"joint_drag", "tracking_bias"}, verdict["mechanisms"]
    zeros = {m["bodies"][0]: m["parameters"]["b"] for m in verdict["mechanisms"] if m["name"] == "tracking_bias"}
    for body, true in zip(("left", "right"), ZEROS, strict=True):
        assert zeros[body]["low"] < true < zeros[body]["high"], zeros
