"""Held-out frames in windows, in which an impact may be missed: what is evidence against a law, and what is not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.hypothesis import Hypothesis
from granswim_pymunk.inference.tracks import held_out
from granswim_pymunk.inference.tracks.held_out import (
    held_out_errors,
    noise_floor,
    paired_verdict,
    worse_by_chance,
)
from granswim_pymunk.inference.tracks.study import study_of
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Body, Scene, use
from granswim_pymunk.validation.pucks import LAYOUTS, draw
from granswim_pymunk.walls import Wall


@pytest.mark.deep
def test_a_glancing_impact_that_a_start_may_miss_is_one_number_of_evidence():
    """Restitution 0.75 takes 4300 of chi2 away; of six pucks two graze each other in one held-out window."""
    film = draw(800, "restitution", True, LAYOUTS[:2]).recording
    study = study_of([film], [], np.random.default_rng(0), lambda *a: None, lambda share: False)
    (case,), closer = study.cases, study.fitter.tightened(0.2)
    law = next(t for t in named_terms(study.cases) if t.mechanism == "restitution")
    loose = study.fitter.fit(Hypothesis(study.believed), None)
    plain = closer.fit(loose.hypothesis, loose.values, loose.starts, evaluations=12)
    right = closer.fit(loose.hypothesis.with_term(law), [*loose.values, 0.75], loose.starts)
    assert right.values[-1] == pytest.approx(0.75, abs=0.003) and plain.chi2 - right.chi2 > 4000

    def against(fit):
        errors = [held_out_errors(f, study.cases, study.predictor, lambda: False) for f in (plain, fit)]
        before, after = (e.scored[case.name] for e in errors)
        allowed = worse_by_chance(fit, case, after - before, study.predictor, np.random.default_rng(0))
        return paired_verdict(*errors, np.random.default_rng(0)), np.nansum(after**2 - before**2), allowed

    said, worse, allowed = against(right)
    assert said == "fails" and 0 < worse < allowed
    # a friction of the table that is not there slows all of them, in flights of which the starts are as unsure
    friction = next(t for t in named_terms(study.cases) if t.label == "coulomb_substrate")
    more = right.hypothesis.with_term(friction)
    wrong = closer.fit(more, [*right.values, 0.2], right.starts, held=(len(right.values),))
    said, worse, allowed = against(wrong)
    assert said == "fails" and worse > allowed


CORNERS = ((0.0, 0.0), (0.6, 0.0), (0.6, 0.45), (0.0, 0.45))
BEGIN = ((0.10, 0.10, 0.5, 0.31), (0.45, 0.30, -0.42, 0.1), (0.30, 0.12, 0.1, -0.5), (0.2, 0.33, 0.33, 0.2))
BOX = Scene(
    tuple(Body(f"p{k}", "free", 0.025, 0.03, initial=at) for k, at in enumerate(BEGIN)),
    (use("contact_elastic", restitution=0.95),),
    walls=tuple(Wall(a, b) for a, b in zip(CORNERS, (*CORNERS[1:], CORNERS[0]), strict=True)),
)


def test_the_floor_through_impacts_is_what_the_right_scene_leaves():
    """A run from the training part leaves a millimetre: impacts spread paths that a start does not tell apart."""
    seen = film(BOX, np.arange(0, 2.0, 0.01), rng=np.random.default_rng(1), noise=1e-4)
    hidden = tuple(replace(b, initial=None) for b in BOX.bodies)
    seen = replace(seen, scene=replace(BOX, bodies=hidden))
    study = study_of([seen], [], np.random.default_rng(0), lambda *a: None, lambda share: False)
    fit = study.fitter.fit(Hypothesis(), None)
    how = study.cases, study.predictor, lambda: False
    data = held_out_errors(fit, *how)
    assert data.rms is not None and data.window is not None and data.rms < 3e-4
    train, floor = noise_floor(fit, *how, np.random.default_rng(0))
    assert floor is not None and train == pytest.approx(1e-4, rel=0.1)
    assert 0.6 < floor / data.rms < 1.6


def test_a_repeat_that_misses_an_impact_is_not_the_floor(monkeypatch):
    """Of three repeats one is off by 30 mm; where nothing meets in held-out frames all count, as before."""
    case = SimpleNamespace(
        name="r", held_out=False, t=np.arange(30) * 0.1, training=np.arange(30) < 20, scored=np.arange(30) >= 20,
        values=np.zeros((30, 2)), in_unit=np.ones(2, dtype=bool),
    )  # fmt: skip
    seen = iter([np.full((30, 2), size) for size in (1e-4, 3e-2, 1e-4)] * 2)
    inner = SimpleNamespace(refitted=lambda *a, **k: None, predict=lambda *a: next(seen))
    monkeypatch.setattr(held_out, "Fitter", lambda *a: inner)
    monkeypatch.setattr(held_out, "_as_explained", lambda *a: (case.values, None, False))
    monkeypatch.setattr(held_out, "_filmed_again", lambda *a: case)
    floors = []
    for meets in (True, False):
        monkeypatch.setattr(held_out, "meets_when_scored", lambda case, meets=meets: meets)
        how = None, [case], None, lambda: False, np.random.default_rng(0)
        floors.append(noise_floor(*how, followed=["r"])[1])  # type: ignore[arg-type]
    assert floors == pytest.approx([1e-4, np.sqrt((2e-8 + 9e-4) / 3)])
