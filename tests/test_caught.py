"""A scene without a law whose fit was caught: what every law seemed to help with was a start."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.judge import Claim
from granswim_pymunk.inference.tracks import closer, name, study
from granswim_pymunk.inference.tracks import model as tracks
from granswim_pymunk.inference.tracks.model import Tracks
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Body, Scene, use


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
    model.tried = SimpleNamespace(recalibrated=caught, terms=[term], naive=caught, alive=[])
    again: list[Any] = []

    def tried(study, naive, fit, earlier):
        again.append(fit)
        return SimpleNamespace(recalibrated=fit)

    monkeypatch.setattr(tracks, "tried_alone", tried)
    monkeypatch.setattr(tracks, "without_outliers", lambda study, tried, best=None: (study, tried))
    monkeypatch.setattr(tracks, "with_memory", lambda study, tried, best=None: (study, tried))
    monkeypatch.setattr(tracks, "beyond_nulls", lambda study, tried: ("another null", None))
    found = iter([claim, Claim((), plain)])
    monkeypatch.setattr(model, "_search", lambda: next(found))
    assert model.search(None).laws == () and model.null_after(None) == "another null"
    assert len(again) == 1 and again[0].chi2 < plain.chi2 + 1e-3 and model.tried.recalibrated is again[0]


@pytest.mark.deep
def test_laws_are_tried_again_from_where_a_caught_scene_got_free(monkeypatch):
    """What laws do to first order, and their own fits, begin where the scene without them is: not where it was."""
    disk = Body("a", "free", 0.01, 0.02, initial=(0.0, 0.0, 0.4, 0.1))
    truth = Scene((disk,), (use("linear_drag", c=0.01),))
    seen = film(truth, np.arange(0.0, 0.5, 0.01), rng=np.random.default_rng(1), noise=1e-4)
    model = Tracks([replace(seen, scene=Scene((replace(disk, initial=None),), ()))])
    model.recalibrate()
    right = model.recalibrated_fit
    wrong = {name: s + 0.3 for name, s in right.starts.items()}
    caught = replace(model.study.fitter.fit(right.hypothesis, right.values, wrong, evaluations=0), chi2=1e7)
    bases: list[Any] = []
    tried = name.try_candidates

    def counted(fitter, base, *rest, **more):
        if "ahead" not in more:
            bases.append(base)
        return tried(fitter, base, *rest, **more)

    monkeypatch.setattr(study, "try_candidates", counted)
    found = study.tried_alone(model.study, caught, caught)
    assert [b.chi2 for b in bases] == [1e7, found.recalibrated.chi2] and found.recalibrated.chi2 < 2 * right.chi2
    drag = next(t for t in found.alive if t.mechanism == "linear_drag")
    assert drag.gain > 30
    # a scene that was not caught is asked once
    bases.clear()
    study.tried_alone(model.study, right, right)
    assert len(bases) == 1


def test_a_caught_scene_does_not_hide_that_a_law_of_contacts_follows_closer_joints(monkeypatch):
    """Its own numbers promise a fall that the search did not find: then first order says nothing of a law either."""
    restitution = SimpleNamespace(law="contact_elastic", free=[None], mechanism="restitution")
    other = SimpleNamespace(law="linear_drag", free=[None], mechanism="linear_drag")
    weak = [SimpleNamespace(term=t, gain=1.0) for t in (other, restitution)]
    fits = {"restitution": SimpleNamespace(chi2=170.0), "linear_drag": SimpleNamespace(chi2=349.0)}
    fell: list[str] = []

    def refitted(fitter, fit, signature, stages):
        fell.append(signature.term.mechanism)
        return fits[signature.term.mechanism]

    monkeypatch.setattr(closer, "make_bank", lambda *a: SimpleNamespace(signatures=weak))
    monkeypatch.setattr(closer, "refit", refitted)
    monkeypatch.setattr(closer, "in_contact_alone", lambda term: term.mechanism == "restitution")
    base, loose = SimpleNamespace(chi2=349.0), SimpleNamespace(chi2=180.0, allowed_rise=16.0)
    along, across = np.eye(3)[:, :1], np.eye(3)[:, 1:2]
    left = SimpleNamespace(left=np.array([11.0, 0.0, 13.0]), starts=along, open_numbers=across)
    monkeypatch.setattr(closer, "stacked", lambda *a: left)
    assert closer._explained_by_one(None, base, loose, [other, restitution])
    assert fell == ["restitution"]
    # where the fit came to its end, nothing is promised, and first order is believed
    left.left = np.array([0.1, 0.2, 13.0])
    assert not closer._explained_by_one(None, base, loose, [other, restitution])
    assert fell == ["restitution"]
