"""Held-out frames of a chaotic motion that no run from one start follows: windows with starts of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.held_out import held_out_errors, is_lost, right_law_errors, windows_of_lost
from granswim_pymunk.joints import place
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Body, Scene, use

NOISE = 2e-4  # m


def two_arms(upper: float, lower: float, name: str, last: float):
    """Two arms that start at these angles [rad], filmed without anything missing from their scene."""
    arms = Body("a", "free", 0.01, 0.1, inertia=3.3e-4), Body("b", "free", 0.01, 0.08, inertia=2.2e-4)
    hinges = (
        use("hinge", bodies=["a"], anchor_a=(0.0, 0.1), anchor=(0.0, 0.0)),
        use("hinge", bodies=["a", "b"], anchor_a=(0.0, -0.1), anchor_b=(0.0, 0.09)),
    )
    scene = Scene(arms, hinges, gravity=(0.0, -9.81))
    start = place(scene, {"a": upper, "b": lower}, {"a": 0.0, "b": 0.0})
    scene = replace(scene, bodies=tuple(replace(b, initial=start[b.id]) for b in arms))
    seen = film(scene, np.arange(0, last, 1 / 120), rng=np.random.default_rng(3), noise=NOISE, angle_noise=2e-3)
    return replace(seen, name=name, scene=scene)


@pytest.mark.deep
@pytest.mark.parametrize(("upper", "lower", "lost"), [(2.4, 1.9, True), (0.3, 0.2, False)])
def test_windows_are_scored_where_a_run_is_lost_and_whole_runs_where_it_is_not(upper, lower, lost):
    learnt = prepare(two_arms(0.3, 0.2, "learnt", 0.8), held_out=False, split=False)
    kept = prepare(two_arms(upper, lower, "kept", 10.0), held_out=True, split=False)
    predictor = Predictor({"learnt": 1e-3, "kept": 1e-3})
    fit = Fitter([learnt], predictor).fit(Hypothesis())
    how = [kept], predictor, lambda: False
    assert is_lost(fit, kept, predictor, np.random.default_rng(0)) is lost
    names = {"kept": windows_of_lost(fit, kept, predictor)} if lost else {}
    whole = held_out_errors(fit, *how, whole=False)
    errors = held_out_errors(fit, *how, whole=False, lost=names)
    if not lost:
        assert errors.window is None and errors.rms == whole.rms and errors.rms < 1.5 * NOISE
        return
    assert names == {"kept": 8}
    # the scene is the truth, and a whole run is as far off as the arms reach
    assert whole.rms > 0.03 and errors.rms < whole.rms / 20
    assert errors.window == pytest.approx(0.65 * kept.scored.sum() / 120 / names["kept"], rel=0.1)
    right = right_law_errors(fit, [learnt, kept], *how[1:], np.random.default_rng(1), 2, lost=names)
    assert (right < whole.rms / 20).all()
