"""What any apparatus is off by explains nothing but itself, and a law only what is beyond that."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Free, Hypothesis, Predictor, Term
from granswim_pymunk.inference.significance import Null
from granswim_pymunk.inference.tracks import study
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.name import Trial
from granswim_pymunk.inference.tracks.nulls import search_nulls
from granswim_pymunk.inference.tracks.settle import _as_usual
from granswim_pymunk.inference.tracks.signatures import Bank, Signature, make_bank
from granswim_pymunk.inference.tracks.usual import beyond_usual, is_usual, usual_errors
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Body, Scene, use

BODIES = (Body("a", "free", 0.01, 0.05, initial=(0.0, 0.0, 0.5, 0.3)),)


def tried(true: Scene, scale: float = 1.0) -> tuple[Bank, dict[str, Trial]]:
    """The bank about the scene without its law, of a body on a table, and each law alone fitted beside it."""
    seen = film(true, np.arange(0.0, 2.0, 0.01), rng=np.random.default_rng(1), noise=1e-5)
    seen = replace(seen, scene=Scene(BODIES, ()), position_noise=1e-5, xy=scale * seen.xy)
    case = prepare(seen, held_out=False, split=False)
    fitter = Fitter([case], Predictor({case.name: 1e-3}))
    base = fitter.fit(Hypothesis(), None)
    bank = make_bank(fitter, base, named_terms([case]))
    found = {}
    for signature in bank.signatures:
        if signature.term.mechanism in ("uniform_force", "linear_drag"):
            fit = fitter.fit(base.hypothesis.with_term(signature.term), None, base.starts)
            found[signature.term.mechanism] = Trial(signature, fit, base.chi2 - fit.chi2, 0.0)
    return bank, found


def test_a_tilt_of_usual_size_is_no_reason_to_name_a_law():
    """Against a table off level by 0.4 mm/m a drag is what imitates it; held against what tables are, it is nothing."""
    v = np.array(BODIES[0].initial[2:])
    against = tuple(-9.81 * 4e-4 * v / np.linalg.norm(v))
    bank, laws = tried(Scene(BODIES, (use("uniform_force", a=against),)))
    drag, push = laws["linear_drag"], laws["uniform_force"]
    assert drag.gain > 1000.0
    assert beyond_usual(bank, [drag], 1.0)[0] < 0.05 * drag.gain
    assert is_usual(push) and not is_usual(drag)
    # such an error is no reason for a false alarm either
    errors = np.hstack(list(usual_errors(bank).values()))
    every = np.ones(len(bank.signatures), dtype=bool)
    rng = np.random.default_rng(0)
    assert search_nulls(bank, 1.0, every, drag.gain, 99, rng).p == pytest.approx(0.01)
    assert search_nulls(bank, 1.0, every, drag.gain, 99, rng, errors).p > 0.05


def test_a_law_that_does_more_than_any_apparatus_is_named():
    bank, laws = tried(Scene(BODIES, (use("linear_drag", c=0.02),)))
    drag = laws["linear_drag"]
    assert beyond_usual(bank, [drag], 1.0)[0] > 1000.0
    # a push larger than tables are off level is not usual
    bank, laws = tried(Scene(BODIES, (use("uniform_force", a=(0.05, 0.0)),)))
    assert not is_usual(laws["uniform_force"])


def test_of_two_errors_that_do_the_same_the_one_nearer_to_its_usual_size_is_likelier():
    _, laws = tried(Scene(BODIES, (use("uniform_force", a=(0.004, 0.0)),)))
    fit = laws["uniform_force"].fit
    assert fit is not None
    free = fit.hypothesis.free[0]

    def likelihood(size: float) -> float:
        (term,) = fit.hypothesis.terms
        numbers = (replace(free, unseen=size, usual=0.0), *term.free[1:])
        return _as_usual(replace(fit, hypothesis=Hypothesis((replace(term, free=numbers),))), 0)

    near, large, small = likelihood(0.005), likelihood(0.5), likelihood(5e-5)
    assert near > large and near > small


@pytest.mark.parametrize("gain", [9.0, 40.0])
def test_a_recording_without_usual_errors_is_told_by_noise_alone(monkeypatch, gain):
    """No picture, no table, masses that cancel: a law that noise may gain as much as is not named, and no note blames
    errors that are not there."""
    rate = Free("linear_drag.c", "kg/s", 0.0, np.inf, 0.0, 1.0)
    drag = Signature(Term("linear_drag", "linear_drag", (rate,), lambda *a: None), np.ones((4, 1)) / 2, 1.0, gain)
    trial = SimpleNamespace(
        term=drag.term, values=np.ones(1), gain=gain, fit=None, signature=drag, mechanism="linear_drag"
    )  # fmt: skip
    bank = Bank(None, np.zeros(4), np.zeros((4, 0)), (drag,))  # type: ignore[arg-type]
    nulls = np.full(299, 10.0)
    monkeypatch.setattr(study, "noise_of", lambda *a: 1.0)
    monkeypatch.setattr(study, "choose", lambda trials, *a: trials[0] if trials else None)
    monkeypatch.setattr(study, "search_nulls", lambda *a: Null(nulls, gain))
    the = SimpleNamespace(
        progress=lambda *a: None, late=lambda share: False, fitter=SimpleNamespace(cases=[]), rng=None, notes=[],
        inner=SimpleNamespace(slack=0.0),
    )  # fmt: skip
    tried = SimpleNamespace(
        bank=bank, best=None, spread=1.0, inner={"recalibrated": 1.0}, alive=[trial], terms=[drag.term]
    )  # fmt: skip
    _, chosen = study.beyond_nulls(the, tried)  # type: ignore[arg-type]
    assert (chosen is trial) == (gain > 10.0) and not the.notes
