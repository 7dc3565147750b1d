"""A spring to a point that the scene lacks is told with its point and its stiffness, however strong it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.judge import HELD_OUT_OFF, Claim, Judgement
from granswim_pymunk.inference.pipeline import rivals_of
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.model import Tracks
from granswim_pymunk.inference.tracks.name import try_candidates
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.steps import time_steps
from granswim_pymunk.recording import Recording
from granswim_pymunk.result import standing
from granswim_pymunk.scene import Body, Scene, use

MASS, NOISE, POINT = 0.1, 8e-4, (0.31, 0.22)  # kg, m, m
PUCK = Body("p", "free", 0.02, MASS)


def puck(stiffness: float, duration: float = 5.0, scene: Scene | None = None) -> Recording:
    """A puck that a spring [N/m] draws to ``POINT``, filmed at 60 Hz by someone who does not know of it."""

    def rate(_, y):
        return [*y[2:], *(-stiffness / MASS * (y[:2] - POINT))]

    t = np.arange(int(60 * duration)) / 60
    path = solve_ivp(rate, (0, t[-1]), [0.1, 0.1, 0.25, -0.05], t_eval=t, rtol=1e-9, atol=1e-12).y[:2].T
    xy = path[:, None] + NOISE * np.random.default_rng(1).normal(size=(len(t), 1, 2))
    return Recording("puck", scene or Scene((PUCK,)), t, ("p",), xy, sampling=60.0, position_noise=NOISE)


def springs(recording: Recording) -> list:
    return [t for t in named_terms([prepare(recording, held_out=False, split=True)]) if t.law == "spring"]


@pytest.mark.parametrize("stiffness", [0.03, 0.35])
def test_its_point_and_stiffness_are_found(stiffness):
    """From the straight path of the scene without it, and where that is lost, from pieces of the film."""
    case = prepare(puck(stiffness), held_out=False, split=True)
    fitter = Fitter([case], Predictor(time_steps([case])))
    base = fitter.fit(Hypothesis(), None)
    (trial,) = try_candidates(fitter, base, make_bank(fitter, base, springs(puck(stiffness))), (1.0,), lambda *a: None)
    assert trial.fit.chi2 < 1.3 * trial.fit.count < base.chi2
    found = dict(zip((f.name for f in trial.term.free), trial.values, strict=True))
    errors = dict(zip(found, np.sqrt(np.diag(trial.fit.covariance)), strict=True))
    true = {"spring.stiffness": stiffness, "spring.anchor_x": POINT[0], "spring.anchor_y": POINT[1]}
    assert set(found) == set(true)
    assert all(abs(found[name] - value) < 4 * errors[name] for name, value in true.items())


def test_it_is_asked_of_what_nothing_holds():
    recording = puck(0.03, 1.0)
    assert len(springs(recording)) == 1
    held = [
        use("rail", bodies=["p"], direction=(1.0, 0.0)), use("spring", anchor=(0.0, 0.0), stiffness=1.0),
        use("pin", bodies=["p"], anchor=(0.0, 0.0), length=0.2),
    ]  # fmt: skip
    for law in held:
        assert not springs(replace(recording, scene=Scene((PUCK,), (law,))))
    # nor of what flies
    assert not springs(replace(recording, scene=replace(Scene((PUCK,)), gravity=(0.0, -9.81))))


@pytest.mark.deep
def test_what_comes_closest_is_told_where_nothing_is_named():
    model = Tracks([puck(0.03, 2.0)])
    model.recalibrate()
    model.try_candidates()
    model.fitter, model.spread = model.study.fitter, model.tried.spread
    model.weigh(model.plain)
    judged = Judgement("unmodelled", Claim((), model.tried.recalibrated))
    model.hold_out(judged)
    _, ((rival, share), *_) = rivals_of(model, judged)
    assert rival.law.label == model.refitted()[0].label and 0.5 < share <= 1


def test_nothing_named_is_no_approximation():
    left = {"times_floor": 43.0, "bodies": ["p"], "looks_like": "a drag"}
    verdict = {"rivals": [], "explained": None, "remains": left, "heldout": None, "complete": False}
    named, none = (standing(verdict | {"verdict": v}) for v in ("missing_physics", "unmodelled"))
    assert "the best approximation so far" in named[0]
    assert none == ["43 times the noise is left, most on p; it looks like a drag"]


def test_what_is_left_is_told_beside_the_noise_and_beside_the_scene_without_the_law():
    left = {"times_floor": 1.02, "bodies": ["p"], "looks_like": "a drag"}
    errors = {"naive": 0.05, "recalibrated": 0.04, "revised": 0.01, "noise_floor": 0.001}
    verdict = {"verdict": "missing_physics", "rivals": [], "explained": None, "remains": left, "heldout": "holds"}
    what, held = standing(verdict | {"complete": False, "fit": {"heldout": errors}})
    assert "what is left is as small as the noise (1 times), yet not all noise" in what
    assert held == "held-out data: holds, 10 times the noise is left there, 25 % of what the scene without it leaves"
    # where another reason decided that it is not complete, that one is told
    left |= {"looks_like": "nothing that was tried", "why": [HELD_OUT_OFF]}
    what, _ = standing(verdict | {"complete": False, "remains": left, "fit": {"heldout": errors}})
    assert what == (
        f"the best approximation so far: what is left is as small as the noise (1 times), most on p; not complete, as "
        f"{HELD_OUT_OFF}"
    )
