"""Errors of recordings that show positions and angles: told in metres, of positions alone, as a rad is no metre."""

from __future__ import annotations

import numpy as np
import pytest

from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.judge import remains_of
from granswim_pymunk.inference.noise import Noise
from granswim_pymunk.inference.tracks.blocks import make_blocks, score
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.held_out import held_out_errors, noise_floor, training_errors
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Body, Scene, use

NOISE, ANGLE_NOISE = 1e-4, 0.05  # m, rad


def an_arm(positions: bool):
    hinge = use("hinge", bodies=["arm"], anchor_a=(0.0, 0.1), anchor=(0.0, 0.0))
    arm = Body("arm", "free", 0.01, 0.1, inertia=3e-4, initial=(0.05, -0.0866, 0.0, 0.0))
    scene = Scene((arm,), (hinge,), gravity=(0.0, -9.81))
    t = np.arange(0, 1, 0.01)
    seen = film(scene, t, rng=np.random.default_rng(1), noise=NOISE, angle_noise=ANGLE_NOISE, positions=positions)
    case = prepare(seen, held_out=False, split=True)
    predictor = Predictor({case.name: 1e-3})
    return case, predictor, Fitter([case], predictor).fit(Hypothesis())


@pytest.mark.parametrize(("positions", "size"), [(True, NOISE), (False, ANGLE_NOISE)])
def test_errors_are_told_of_what_is_in_their_unit(positions, size):
    case, predictor, fit = an_arm(positions)
    assert case.unit == ("m rms" if positions else "rad rms")
    held = held_out_errors(fit, [case], predictor, lambda: False)
    rng = np.random.default_rng(2)
    floor = noise_floor(fit, [case], predictor, lambda: False, rng)
    blocks = make_blocks([case])
    left = remains_of(score(fit, blocks, predictor, Noise(), rng), [case.t[b.rest] for b in blocks], "")
    told = [training_errors(fit, [case]).rms, held.rms, held.by_case[case.name], *floor, left.rms]
    assert all(0.5 * size < error < 3 * size for error in told)


def test_angles_beside_positions_count_over_their_own_noise():
    case, predictor, fit = an_arm(True)
    held = held_out_errors(fit, [case], predictor, lambda: False)
    count = np.isfinite(held.scored[case.name]).sum(axis=0)
    assert (count == case.scored.sum()).all() and held.chi2 == pytest.approx(count.sum(), rel=0.5)
