"""Unseen blocks of the training part: with which numbers they are predicted."""

import math
from dataclasses import replace

import numpy as np

from granswim_pymunk.inference.candidates import flexible_terms, named_terms
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.inference.explained import explained
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor, adjustable_terms
from granswim_pymunk.inference.noise import Noise
from granswim_pymunk.inference.tracks.blocks import Block, make_blocks, outside, score, without
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.name import refit
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.steps import time_steps
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Adjustable, Body, Scene, use


def test_strength_and_exponent_are_refitted_without_the_block():
    """A bob that swings past a magnet: strength and exponent are known only together, along a bent valley.

    One step along its tangent lands where the force throws the bob out of the picture; fitted to what is left they
    explain what the law does.
    """
    bob = Body("bob", "free", 0.02, 0.1, initial=(0.4 * math.sin(0.5), -0.4 * math.cos(0.5), 0.0, 0.0))
    magnet = Body("magnet", "wall", 0.01, 0.05, initial=(0.05, -0.48, 0.0, 0.0))
    pin = use("pin", bodies=["bob"], anchor=(0.0, 0.0), length=0.4)
    true = Scene((bob, magnet), (pin, use("distance_force", s=-0.4, n=3.0)), gravity=(0.0, -9.81))
    seen = film(true, np.arange(0.0, 7.0, 1 / 50), rng=np.random.default_rng(2), noise=1e-4)
    bodies = (replace(bob, initial=None), magnet)
    seen = replace(seen, scene=replace(true, bodies=bodies, laws=(pin,)), angle=None)
    cases, rng = prepare_all([seen], ()), np.random.default_rng(1)
    predictor = Predictor(time_steps(cases))
    fitter = Fitter(cases, predictor)
    naive = fitter.fit(Hypothesis(), (), None)
    term = next(t for t in named_terms(cases) if t.mechanism == "distance_force")
    fit = fitter.fit(Hypothesis((term,)), (-0.4, 3.0), naive.starts, evaluations=60)
    assert fit.chi2 < 1.2 * fit.count < 0.5 * naive.chi2
    blocks = make_blocks(cases)
    share = explained(score(fit, blocks, predictor, Noise(), rng), score(naive, blocks, predictor, Noise(), rng), rng)
    assert share.share > 0.5 and share.low > 0.0  # what the contract asks of a name


def test_a_form_by_the_speed_keeps_its_numbers_without_a_block_and_a_field_does_not():
    """Where one block holds nearly all frames, nothing else tells either; a law keeps what it has there, too."""
    puck = Body("puck", "free", 0.02, 0.1, initial=(0.0, 0.0, 0.6, 0.2))
    true = Scene((puck,), (use("linear_drag", c=0.005),))
    seen = film(true, np.arange(0.0, 2.0, 1 / 50), rng=np.random.default_rng(2), noise=1e-4)
    seen = replace(seen, scene=replace(true, bodies=(replace(puck, initial=None),), laws=()), angle=None)
    cases = prepare_all([seen], ())
    fitter = Fitter(cases, Predictor(time_steps(cases)))
    naive = fitter.fit(Hypothesis(), (), None)
    frames = cases[0].training
    block = Block(cases[0], frames & (np.arange(len(frames)) < 20), frames & (np.arange(len(frames)) >= 20), False)
    terms = {t.mechanism: t for t in flexible_terms(cases)}
    left = {}
    for name in ("flexible_power", "flexible_place"):
        fit = refit(fitter, naive, make_bank(fitter, naive, [terms[name]]).signatures[0], (1.0,))
        assert fit.chi2 < naive.chi2 and np.any(fit.values)
        left[name] = without(fit, block) / np.where(fit.values == 0, 1.0, fit.values)
    assert np.allclose(left["flexible_power"], 1.0)
    assert np.abs(left["flexible_place"]).max() < 1e-6


def test_a_law_with_a_shape_keeps_what_only_the_block_tells():
    """A puck that flies past a magnet in the middle of the film: before and after it nothing tells its range."""
    puck = Body("puck", "free", 0.01, 0.05, initial=(-0.5, 0.03, 1.0, 0.0))
    magnet = Body("magnet", "wall", 0.01, 0.05, initial=(0.0, 0.0, 0.0, 0.0))
    true = Scene((puck, magnet), (use("distance_force", s=0.3, n=2.0),))
    seen = film(true, np.arange(0.0, 1.0, 1 / 100), rng=np.random.default_rng(2), noise=1e-4)
    bodies = (replace(puck, initial=None), magnet)
    seen = replace(seen, scene=replace(true, bodies=bodies, laws=()), angle=None)
    cases = prepare_all([seen], ())
    predictor = Predictor(time_steps(cases))
    fitter = Fitter(cases, predictor)
    naive = fitter.fit(Hypothesis(), (), None)
    term = next(t for t in named_terms(cases) if t.mechanism == "distance_force")
    fit = fitter.fit(Hypothesis((term,)), (0.3, 2.0), naive.starts, evaluations=60)
    frames, at = cases[0].training, np.arange(len(cases[0].t))
    # what is left are the first 40 frames, in which hardly any of the force is felt
    near = frames & (at >= 40)
    block = Block(cases[0], near & (at < 46), near & (at >= 46), False)
    assert np.array_equal(outside(fit, block, cases, predictor), fit.values)
    # by one step, as where tracks are cut, only the strength moves: strength and exponent lie along a bent valley
    early = frames & (at < 40)
    s, n = without(fit, Block(cases[0], early & (at < 6), early & (at >= 6), False))
    assert n == fit.values[1] and s != fit.values[0]


def test_what_begins_behind_a_block_begins_where_the_fit_passes():
    """Without the first block what is left begins later: numbers found there lie within their errors of all data's.

    From the start of the whole film, a time too early, a swing of many periods is not found again.
    """
    puck = Body("puck", "free", 0.02, 0.1, initial=(0.05, 0.0, 0.0, 0.0))
    spring = use("spring", anchor=(0.0, 0.0), stiffness=30.0)
    true = Scene((puck,), (spring, use("nonlinear_spring", k_3=2000.0), use("ambient_flow", c=0.02, u=(0.05, 0.0))))
    seen = film(true, np.arange(0.0, 4.0, 1 / 60), rng=np.random.default_rng(2), noise=1e-4)
    stiffness = Adjustable("spring", "stiffness", 10.0, 60.0)
    believed = replace(true, bodies=(replace(puck, initial=None),), laws=(spring,), adjustable=(stiffness,))
    cases = prepare_all([replace(seen, scene=believed, angle=None)], ())
    predictor = Predictor(time_steps(cases))
    fitter = Fitter(cases, predictor)
    calibrated = Hypothesis(adjustable_terms(cases))
    naive = fitter.fit(calibrated, [f.first for f in calibrated.free], None)
    terms = {t.label: t for t in named_terms(cases)}
    hypothesis = calibrated.with_term(terms["nonlinear_spring"], terms["ambient_flow"])
    assert any(f.inner for f in hypothesis.free)
    fit = fitter.fit(hypothesis, (30.0, 2000.0, 0.02, 0.05, 0.0), naive.starts, evaluations=60)
    assert fit.chi2 < 1.2 * fit.count
    first = make_blocks(cases)[0]
    assert first.frames[0]
    numbers = outside(fit, first, cases, predictor)
    assert np.any(numbers != fit.values)
    told = numbers != fit.values
    assert np.all(np.abs(numbers - fit.values)[told] < 15 * np.sqrt(np.diag(fit.covariance))[told])
