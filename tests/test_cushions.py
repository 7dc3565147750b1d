"""Pucks between cushions that take more of their speed than the scene believes."""

from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.engine import Simulation
from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.criteria import current
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.tracks.name import refit
from granswim_pymunk.inference.tracks.segments import make_segments
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.study import calibrated, study_of
from granswim_pymunk.recording import Recording, film
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


@pytest.fixture(scope="module")
def fits():
    """The study of a film with one cushion in its training part, the scene as it is, and laws that were refitted."""
    recording = filmed(use("contact_elastic", restitution=0.6), use("linear_drag", c=5e-4))
    study = study_of([recording], [], np.random.default_rng(0), lambda *told: None, lambda share: False)
    _, plain = calibrated(study)
    bank = make_bank(study.fitter, plain, named_terms(study.training))
    alone = {s.term.label: s for s in bank.signatures if s.term.label in ("restitution", "linear_drag")}
    return study, plain, {label: refit(study.fitter, plain, s, (1.0,)) for label, s in alone.items()}


def test_a_cushion_that_takes_40_percent_is_evidence_as_large_as_it_is(fits):
    """Of a body that met one straight wall no run misses it: what comes out slower than believed counts in full.

    Counted in proportion beyond four standard deviations, a weak drag in flight was worth more than the cushions.
    """
    _, plain, laws = fits
    gains = {label: plain.chi2 - fit.chi2 for label, fit in laws.items()}
    # the one cushion in the training part is off by 33 standard deviations of the place, and 25 of the velocity
    assert gains["restitution"] > 1000 and gains["restitution"] > 5 * gains["linear_drag"] > 0
    assert abs(laws["restitution"].values[-1] - 0.6) < 0.01


def test_a_single_cushion_tests_what_acts_in_it(fits):
    """It lay in the first part of the training data, and no law predicted the flight after it better than none."""
    study, plain, laws = fits
    assert study.inner.score(laws["restitution"])[0] < 0.5 * study.inner.score(plain)[0]


def test_steps_count_in_proportion_where_disks_meet():
    """A disk spreads paths, and a run that misses one is no evidence; a flat wall does not (Sinai 1970)."""
    starts = {"a": (0.5, 0.5, 1.0, 0.0), "b": (0.9, 0.51, -1.0, 0.0), "c": (1.6, 0.3, 0.0, -1.0)}
    limits = []
    for names in ("abc", "ac"):
        bodies = tuple(Body(name, "free", 0.03, 0.024, initial=starts[name]) for name in names)
        scene = replace(table(use("contact_elastic", restitution=0.9)), bodies=bodies)
        seen = film(scene, np.arange(90) / 120, rng=np.random.default_rng(0), noise=NOISE)
        case = prepare(replace(seen, angle=None), held_out=False, split=False)
        found = np.concatenate([segment.limit for segment in make_segments(case, case.training)])
        limits.append(set(found[np.isfinite(found)]))
    assert limits == [{current().segments.robust}, {current().segments.full}]
