"""A force between bodies is told at a distance at which it was seen; and what is no spring is not called one."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from granswim_pymunk import Body, Scene, api, use
from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.data import Case, prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.tracks.at_distance import force_where_seen, seen_distances
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.settle import reaches_its_end
from granswim_pymunk.inference.tracks.steps import time_steps

MASSES, RADIUS, NOISE = (0.18, 0.32), 0.01, 3e-4  # kg, m, m
STRENGTH, POWER = 0.4 * 6.0**4, 4.0  # N at one radius, 0.4 N at 6 cm


def gliders() -> Case:
    """Two gliders with magnets that repel each other on an air track, one at rest: 2 s at 30 Hz."""
    def rate(_, s):
        push = STRENGTH * (RADIUS / (s[1] - s[0])) ** POWER
        return [s[2], s[3], -push / MASSES[0], push / MASSES[1]]

    t = np.arange(60) / 30
    x = solve_ivp(rate, (0.0, t[-1]), [0.0, 0.4, 0.01, -0.4], t_eval=t, rtol=1e-9, atol=1e-11).y[:2].T
    x = x + np.random.default_rng(5).normal(0.0, NOISE, x.shape)
    bodies = tuple(Body(name, "free", RADIUS, m) for name, m in zip(("one", "two"), MASSES, strict=True))
    scene = Scene(bodies, (use("rail", direction=(1.0, 0.0)),))
    xy = np.stack([x, np.zeros_like(x)], axis=2)
    return prepare(api.make_recording(t, xy, scene=scene, position_noise=NOISE), held_out=False, split=False)


@pytest.fixture(scope="module")
def fitted():
    case = gliders()
    fitter = Fitter([case], Predictor(time_steps([case])))
    (term,) = {t.mechanism: t for t in named_terms([case]) if t.label == "distance_force"}.values()
    return case, fitter, term, fitter.fit(Hypothesis((term,)), [STRENGTH, POWER])


def test_the_force_is_told_where_it_was_seen(fitted):
    """Its strength at one radius, at which the gliders never are, is known to a tenth; the force there far better."""
    case, _, term, fit = fitted
    told = force_where_seen(term, fit, 0, 1.0, [case])
    size, low, high, d = map(float, re.fullmatch(r"; (\S+) \((\S+) to (\S+)\) N at d = (\S+) m, .*", told).groups())
    true = STRENGTH * (RADIUS / d) ** POWER
    assert low < true < high and high - low < 0.1 * size
    seen, radius = seen_distances(term, [case])
    assert seen.min() - 1e-3 <= d <= seen.max() + 1e-3 and radius == RADIUS
    strength, least, most = fit.interval(0)
    assert (high - low) / size < 0.5 * (most - least) / strength


def test_of_one_number_nothing_more_is_told(fitted):
    case, fitter, _, _ = fitted
    drag = next(t for t in named_terms([case]) if t.label == "linear_drag")
    assert force_where_seen(drag, fitter.fit(Hypothesis((drag,)), [0.01]), 0, 1.0, [case]) == ""


def test_a_spring_whose_stiffness_may_be_none_is_no_spring(fitted):
    """It was named with k = 3.5e-16 N/m: a push that is the same at any distance."""
    case, fitter, *_ = fitted
    spring = next(t for t in named_terms([case]) if t.label == "pair_spring")
    names = [f.name for f in spring.free]
    fit = fitter.fit(Hypothesis((spring,)), [1.0, 0.1])
    trial = _trial(spring, fit)
    k = names.index("pair_spring.k")
    assert not reaches_its_end(trial, replace(fit, limits={k: (0.5, 2.0), 1 - k: (0.05, 0.2)}), 1.0)
    may_be_none = replace(fit, limits={k: (0.0, 0.01), 1 - k: (0.05, 0.2)})
    assert "pair_spring.k may as well be none" in reaches_its_end(trial, may_be_none, 1.0)


def _trial(term, fit):
    from granswim_pymunk.inference.tracks.name import Trial
    from granswim_pymunk.inference.tracks.signatures import Signature

    return Trial(Signature(term, np.zeros((1, 0)), 0.0, 0.0), fit, 0.0, 0.0)
