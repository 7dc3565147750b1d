"""Pucks between cushions that take more of their speed than the scene believes."""

import numpy as np

from granswim_pymunk.engine import Simulation
from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.tracks.name import refit
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.study import calibrated, study_of
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene, Wall, use

NOISE = 2e-4  # m


def table(*laws, initial=None) -> Scene:
    walls = tuple(Wall(*ends) for ends in (((0, 0), (2, 0)), ((2, 0), (2, 1)), ((0, 1), (2, 1))))
    return Scene((Body("puck", "free", 0.03, 0.024, initial=initial),), laws, walls=walls)


def filmed(*laws, seconds=1.1, seed=0) -> Recording:
    """A fast puck at 60 Hz between three walls, as the scene with a restitution of 1 is believed to be."""
    t = np.arange(int(60 * seconds)) / 60
    xy = Simulation(table(*laws, initial=(0.4, 0.5, 2.4, -2.9)), dt=1e-4).sample(t)[:, :1]
    seen = xy + NOISE * np.random.default_rng(seed).normal(size=xy.shape)
    return Recording("puck", table(use("contact_elastic", restitution=1.0)), t, ("puck",), seen, sampling=60.0)


def test_a_cushion_that_takes_40_percent_is_evidence_as_large_as_it_is():
    """Of a body that met one straight wall no run misses it: what comes out slower than believed counts in full.

    Counted in proportion beyond four standard deviations, a weak drag in flight was worth more than the cushions.
    """
    recording = filmed(use("contact_elastic", restitution=0.6), use("linear_drag", c=5e-4))
    study = study_of([recording], [], np.random.default_rng(0), lambda *told: None, lambda share: False)
    _, plain = calibrated(study)
    bank = make_bank(study.fitter, plain, named_terms(study.training))
    alone = {s.term.label: s for s in bank.signatures if s.term.label in ("restitution", "linear_drag")}
    fits = {label: refit(study.fitter, plain, s, (1.0,)) for label, s in alone.items()}
    gains = {label: plain.chi2 - fit.chi2 for label, fit in fits.items()}
    # the one cushion in the training part is off by 33 standard deviations of the place, and 25 of the velocity
    assert gains["restitution"] > 1000 and gains["restitution"] > 5 * gains["linear_drag"] > 0
    assert abs(fits["restitution"].values[-1] - 0.6) < 0.01
