"""Held-out frames in windows, in which an impact may be missed: what is evidence against a law, and what is not."""

from __future__ import annotations

import numpy as np
import pytest

from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.hypothesis import Hypothesis
from granswim_pymunk.inference.tracks.held_out import held_out_errors, paired_verdict, worse_by_chance
from granswim_pymunk.inference.tracks.study import study_of
from granswim_pymunk.validation.pucks import LAYOUTS, draw


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
