"""A second effect that a portmanteau test does not see, and how often noise looks like one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.inference.candidates import flexible_terms, named_terms, scaled_like
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.judge import completeness
from granswim_pymunk.inference.noise import Noise
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.innovations import series_of
from granswim_pymunk.inference.tracks.score_test import chance_of_more, largest_by_chance
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Body, Scene, use

WHITE = Noise()
BELIEVED = Scene((Body("a", "free", 0.01, 0.05, initial=(0.0, 0.0, 0.5, 0.2)),))


def fitted(*laws, seed=0, slow=WHITE):
    """A fit of a linear drag alone to a sliding body, and all candidates."""
    rng = np.random.default_rng(seed)
    seen = film(BELIEVED.with_laws(*laws), np.arange(0.0, 2.0, 0.01), rng=rng, noise=0.0)
    noisy = seen.xy + 1e-4 * slow.draw(seen.xy.shape, rng)
    bodies = tuple(replace(b, initial=None) for b in BELIEVED.bodies)
    recording = replace(seen, xy=noisy, scene=replace(BELIEVED, bodies=bodies), position_noise=1e-4)
    case = prepare(recording, held_out=False, split=False)
    fitter = Fitter([case], Predictor({case.name: 1e-3}))
    base = fitter.fit(Hypothesis(), None)
    terms = named_terms([case])
    terms = [scaled_like(t, s.term) for t, s in zip(terms, make_bank(fitter, base, terms).signatures, strict=True)]
    drag = next(t for t in terms if t.mechanism == "linear_drag")
    return case, fitter, fitter.fit(Hypothesis((drag,)), [0.01], base.starts), [*terms, *flexible_terms([case])]


def test_a_weak_second_effect_is_seen():
    """A tilt of some six standard errors beside a drag: not by its spectrum, but along what a tilt does."""
    case, fitter, fit, terms = fitted(use("linear_drag", c=0.02), use("uniform_force", a=(0.0, 1.1e-3)))
    assert completeness(series_of(fit, [case])).passes
    assert chance_of_more(fitter, fit, terms, np.random.default_rng(1)) < 0.005


@pytest.mark.parametrize("slow", [WHITE, Noise(0.7, 10.0)])
def test_noise_is_not_more_to_see(slow):
    """Right law, white noise or slow: p is what it says, from many draws along the same signatures."""
    case, fitter, fit, terms = fitted(use("linear_drag", c=0.02), slow=slow)
    assert chance_of_more(fitter, fit, terms, np.random.default_rng(1)) > 0.02
    bank = make_bank(fitter, fit, terms)
    bank = replace(bank, signatures=tuple(s for s in bank.signatures if s.surviving > 0.02 and s.directions.shape[1]))
    rng = np.random.default_rng(2)
    count = len(bank.innovations)

    def draw(n):
        return slow.draw((len(case.t), len(case.channels), n), rng).reshape(count, n)

    null = draw(400)
    p = np.array([largest_by_chance(bank, column, null) for column in draw(200).T])
    assert 0.3 < np.median(p) < 0.7 and np.mean(p < 0.05) < 0.11


def test_a_law_left_out_is_no_noise_that_is_slow():
    """The slow part is told beside the law that gains most, which it would otherwise swallow."""
    _, fitter, fit, terms = fitted(
        use("linear_drag", c=0.02), use("uniform_force", a=(0.0, 4e-3)), slow=Noise(0.5, 5.0)
    )
    assert chance_of_more(fitter, fit, terms, np.random.default_rng(1)) < 0.005
