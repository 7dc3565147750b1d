"""A number that ended where its search ends is no explanation, of a law or of the apparatus."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from granswim_pymunk import diagnose
from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.judge import Claim, Judgement, Weighed
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.model import Tracks
from granswim_pymunk.inference.tracks.name import Trial
from granswim_pymunk.inference.tracks.settle import reaches_its_end, with_numbers_that_were_found, without_one
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.steps import time_steps
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene, use

G, MASS, STIFFNESS, MU = 9.81, 0.2, 10.0, 0.08
NOISE = 2e-4  # m


def block(duration: float) -> Recording:
    """A block on a spring rubs on a table: m x'' = -k x - mu m g sign(x'), sharper about rest than the fitted law.

    All lengths s times as large with a friction s times as strong are the same motion but for what is about rest.
    """

    def rate(_, y):
        return [y[1], -STIFFNESS / MASS * y[0] - MU * G * math.tanh(y[1] / 5e-4)]

    t = np.arange(int(duration * 120)) / 120
    how = {"method": "LSODA", "rtol": 1e-8, "atol": 1e-10, "max_step": 2e-3}
    path = solve_ivp(rate, (0, t[-1]), [0.1, 0.0], t_eval=t, **how).y[0]
    xy = np.column_stack([path, np.zeros(len(t))])[:, None]
    xy = np.round(xy + NOISE * np.random.default_rng(0).normal(size=xy.shape), 7)
    scene = Scene((Body("block", "free", 0.02, MASS),), (use("spring", anchor=(0.0, 0.0), stiffness=STIFFNESS),))
    return Recording("block", scene, t, ("block",), xy, sampling=120.0, position_noise=NOISE)


@pytest.mark.deep
def test_a_picture_at_its_bound_is_not_named_beside_a_friction():
    """The picture took up how sharply the friction turns, its scale ended at 0.7, and friction was told as 0.114."""
    verdict = diagnose([block(6.0)]).verdict
    (only,) = verdict["mechanisms"]
    assert only["name"] == "coulomb_substrate"
    assert only["parameters"]["mu"]["value"] == pytest.approx(MU, rel=0.02)
    assert verdict["heldout"] == "holds" and verdict["explained"]["low"] > 0.9


@pytest.fixture(scope="module")
def fits():
    case = prepare(block(2.0), held_out=False, split=True)
    fitter = Fitter([case], Predictor(time_steps([case])))
    base = fitter.fit(Hypothesis(), None)
    terms = {t.label: t for t in named_terms([case])}
    return fitter, base, terms


def trials(fitter, base, terms, *names):
    return [Trial.untried(s) for s in make_bank(fitter, base, [terms[n] for n in names]).signatures]


@pytest.mark.parametrize("order", [("coulomb_substrate", "camera_scale"), ("camera_scale", "coulomb_substrate")])
def test_the_rest_is_fitted_again(fits, order):
    fitter, base, terms = fits
    begin = {"coulomb_substrate": MU / 0.7, "camera_scale": 0.7}
    hypothesis = base.hypothesis.with_term(*(terms[n] for n in order))
    held = (order.index("camera_scale"),)
    both = fitter.fit(hypothesis, [begin[n] for n in order], base.starts, held=held)
    found, fit, dropped = with_numbers_that_were_found(fitter, base, trials(fitter, base, terms, *order), both, 1.0)
    assert [t.mechanism for t in found] == ["coulomb_substrate"] and list(dropped) == ["camera_scale"]
    assert fit.values == pytest.approx([MU], rel=0.02)
    assert found[0].fit is fit and found[0].gain == base.chi2 - fit.chi2


def test_numbers_within_their_bounds_stay(fits):
    fitter, base, terms = fits
    names = ("coulomb_substrate", "tracking_bias")
    hypothesis = base.hypothesis.with_term(*(terms[n] for n in names))
    both = fitter.fit(hypothesis, [MU, 0.0, 0.0], base.starts)
    found, fit, dropped = with_numbers_that_were_found(fitter, base, trials(fitter, base, terms, *names), both, 1.0)
    assert len(found) == 2 and fit is both and not dropped


def test_none_stays_where_all_ended_at_their_bounds(fits):
    fitter, base, terms = fits
    hypothesis = base.hypothesis.with_term(terms["camera_scale"])
    alone = fitter.fit(hypothesis, [1.3], base.starts, stages=())
    only = trials(fitter, base, terms, "camera_scale")
    found, fit, dropped = with_numbers_that_were_found(fitter, base, only, alone, 1.0)
    assert found == [] and fit is base and list(dropped) == ["camera_scale"]


def test_a_law_whose_interval_reaches_a_bound_is_not_named(fits):
    """Contract 2: of an added mass of -0.47 (-0.5 to -0.39), with -0.5 the end of its search, the value lay within."""
    fitter, base, terms = fits
    names = ("coulomb_substrate", "camera_scale")
    both = fitter.fit(base.hypothesis.with_term(*(terms[n] for n in names)), [MU, 1.0], base.starts)
    friction, scale = trials(fitter, base, terms, *names)
    assert not reaches_its_end(scale, both, 1.0)
    wide = replace(both, limits={1: (0.7, 1.1)})
    assert not reaches_its_end(friction, wide, 1.0) and "camera.scale" in reaches_its_end(scale, wide, 1.0)
    # no end on either side, as of a number of which nothing is known: any would do, none as well
    loose = {k: (-math.inf, 1e20) for k in range(2)}
    for law in (friction, scale):
        told = reaches_its_end(law, replace(both, limits=loose), 1.0)
        assert "search ends" in told or told == "the interval of coulomb_substrate.mu holds none and has no end"
    gone, without = without_one(fitter, base, wide, [scale])
    assert gone is scale and without.values == pytest.approx([MU], rel=0.02)

    plain, notes = Claim((), base), list[str]()
    model = SimpleNamespace(tried=SimpleNamespace(recalibrated=base), spread=1.0, notes=notes, weighed=Weighed())
    model.plain = plain
    judged = Judgement("measurement", Claim((scale,), wide))
    told = Tracks._without_ended(model, judged)
    assert told.verdict == "unmodelled" and told.claim is plain and told.closest == ((scale, 0.0),)
    assert notes == ["camera_scale is not named: the interval of camera.scale reaches where its search ends"]
    assert Tracks._without_ended(model, replace(judged, claim=Claim((scale,), both))).verdict == "measurement"


def test_a_body_is_no_lighter_than_its_mass_was_stated():
    """Six standard errors of what was stated; where nothing was, and nothing weighs it, a half."""
    t, body = np.arange(60) / 60, Body("p", "free", 0.02, MASS)
    xy = np.column_stack([0.1 * t, 0.2 * t])[:, None]
    recording = Recording("p", Scene((body,)), t, ("p",), xy, sampling=60.0, position_noise=NOISE)
    for error, low in ((None, -0.5), (0.01, -0.06), (0.02, -0.12)):
        case = prepare(replace(recording, mass_error=error), held_out=False, split=True)
        (term,) = [t for t in named_terms([case]) if t.mechanism == "added_mass"]
        assert term.free[0].low == pytest.approx(low)


def test_the_share_of_a_name_is_its_own():
    """A push stood as the name of what a friction did that was in the revised scene without one."""
    model = Tracks([block(4.0)])
    model.recalibrate()
    base, fitter = model.recalibrated_fit, model.study.fitter
    terms = {t.label: t for t in named_terms(model.study.training)}
    names = ("coulomb_substrate", "uniform_force")
    friction, push = trials(fitter, base, terms, *names)
    values = [MU, *[0.0] * push.numbers]
    both = fitter.fit(base.hypothesis.with_term(friction.term, push.term), values, base.starts)
    friction, push = (replace(t, fit=both, gain=base.chi2 - both.chi2) for t in (friction, push))
    model.tried = SimpleNamespace(recalibrated=base, naive=base, best=both, forms=[], alive=[], spread=1.0)
    model.fitter, model.spread = fitter, 1.0
    whole = model.weigh(Claim((friction, push), both)).named
    judged = Judgement("missing_physics", Claim((friction,), both), whole)
    alone = model._by_names_alone(judged)
    assert alone.verdict == "missing_physics" and alone.claim.fit is both
    assert 0.9 < alone.explained.share <= 1 and alone.explained is not whole
    none = model._by_names_alone(replace(judged, claim=Claim((push,), both)))
    assert none.verdict == "unmodelled" and none.closest[0][1] < 0.5 < whole.share
    assert model.notes[-1].startswith("uniform_force is not named: it explains")
