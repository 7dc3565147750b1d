"""A scene without a law whose fit was caught: what every law seemed to help with was a start."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.judge import Claim
from granswim_pymunk.inference.tracks import model as tracks
from granswim_pymunk.inference.tracks.model import Tracks
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Body, Scene


def test_what_a_start_explains_is_no_law(monkeypatch):
    """The search begins anew with the scene that follows, and what is then found counts; once, and only if it does."""
    disk = Body("a", "free", 0.01, 0.02, initial=(0.0, 0.0, 0.4, 0.1))
    seen = film(Scene((disk,), ()), np.arange(0.0, 0.5, 0.01), rng=np.random.default_rng(1), noise=1e-4)
    model = Tracks([replace(seen, scene=Scene((replace(disk, initial=None),), ()))])
    model.recalibrate()
    plain = model.recalibrated_fit
    term = next(t for t in named_terms(model.study.cases) if t.mechanism == "linear_drag")
    fit = model.study.fitter.fit(plain.hypothesis.with_term(term), [0.0], plain.starts)
    claim = Claim((SimpleNamespace(term=term, label="drag"),), fit)
    model.spread = 1.0
    model.tried = SimpleNamespace(recalibrated=plain, terms=[term], naive=plain)
    assert model._without_laws(claim) is None and model._without_laws(Claim((), plain)) is None

    caught = replace(plain, chi2=1e5, starts={name: s + 0.1 for name, s in plain.starts.items()})
    model.tried = SimpleNamespace(recalibrated=caught, terms=[term], naive=caught)
    again: list[Any] = []

    def tried(study, naive, fit):
        again.append(fit)
        return SimpleNamespace(recalibrated=fit)

    monkeypatch.setattr(tracks, "tried_alone", tried)
    monkeypatch.setattr(tracks, "with_memory", lambda study, tried: (study, tried))
    monkeypatch.setattr(tracks, "beyond_nulls", lambda study, tried: ("another null", None))
    found = iter([claim, Claim((), plain)])
    monkeypatch.setattr(model, "_search", lambda: next(found))
    assert model.search(None).laws == () and model.null_after(None) == "another null"
    assert len(again) == 1 and again[0].chi2 < plain.chi2 + 1e-3 and model.tried.recalibrated is again[0]
