"""What has more numbers than there is to tell gives way to what is simpler, and held-out data tell of it."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from granswim_pymunk.inference import diagnose, pipeline
from granswim_pymunk.inference.criteria import current
from granswim_pymunk.inference.hypothesis import Free, Hypothesis, Term
from granswim_pymunk.inference.judge import Judgement
from granswim_pymunk.inference.model import Claim, HeldOut
from granswim_pymunk.inference.tracks import model, pairs, rivalled
from granswim_pymunk.inference.tracks.forms import fitted_as_good
from granswim_pymunk.inference.tracks.held_out import Errors
from granswim_pymunk.inference.tracks.name import Trial
from granswim_pymunk.inference.tracks.signatures import Signature
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Adjustable, Body, Scene, use


def law(label: str, numbers: int, chi2: float, special: bool = False, mechanism: str = "") -> Trial:
    free = tuple(Free(f"{label}.{k}", "1", -10.0, 10.0, 0.0, 1.0) for k in range(numbers))
    term = Term(mechanism or label, label, free, lambda *a: None, special=special)
    fit = SimpleNamespace(chi2=chi2, values=np.full(numbers, 0.5), hypothesis=Hypothesis((term,)))
    return Trial(Signature(term, np.eye(6)[:, :numbers], 1.0, 0.0), fit, 1000.0 - chi2, 1.0)  # type: ignore[arg-type]


def claim(*laws: Trial) -> Claim:
    return Claim(laws, laws[0].fit)


def test_two_laws_that_are_preferred_are_asked_before_one_with_more_numbers():
    """A stream takes the part of a drag and of a wrong scale; with more numbers and a worse fit it is no simpler."""
    drag, stream = claim(law("drag", 1, 151.0)), claim(law("stream", 3, 146.0))
    ahead, alike, behind = (claim(law("a", 1, c), law("b", 1, c)) for c in (139.0, 145.0, 158.0))
    order = model._with_two([drag, stream], [ahead, behind], 1.0)
    assert order == [drag, ahead, stream, behind]
    # one law of a class stands first where data do not tell, and where it has fewer numbers
    assert model._with_two([drag, stream], [alike], 1.0) == [drag, stream, alike]
    assert model._with_two([drag], [ahead], 1.0) == [drag, ahead]


def told(monkeypatch, found: list[Trial], a: Trial, b: Trial, chi2: float) -> list[str]:
    """The labels that ``two_for_one`` leaves of laws that were found, where two others fit as closely as ``chi2``."""
    fit = SimpleNamespace(chi2=chi2)
    monkeypatch.setattr(pairs, "_beside_each", lambda *args, **how: [(a.signature, b.signature, fit)])
    monkeypatch.setattr(pairs, "_partners", lambda search, pair: pair)
    search = SimpleNamespace(
        terms=[None] * 20, spread=lambda fit: 1.0, scores={},
        inner=SimpleNamespace(score=lambda fit: (1.01, {}), slack=0.04),
        scored=lambda fit, laws, score: [Trial(t.signature, fit, 0.0, score) for t in laws],
    )  # fmt: skip
    laws, _ = pairs.two_for_one(search, [], found, found[0].fit)  # type: ignore[arg-type]
    return [t.label for t in laws]


def test_a_bent_picture_beside_another_fault_gives_way_to_two_laws_that_do_as_well(monkeypatch):
    """As one that stands alone does: hardly any laboratory has one. Not to another one, nor to what does worse."""
    bias, bent = law("bias", 2, 109.0), law("foreshortening", 1, 109.0, special=True)
    scale, push = law("scale", 1, 0.0), law("push", 2, 0.0)
    assert told(monkeypatch, [bias, bent], scale, push, 95.0) == ["scale", "push"]
    assert told(monkeypatch, [bias, bent], scale, push, 112.0) == ["scale", "push"]
    assert told(monkeypatch, [bias, bent], scale, push, 130.0) == ["bias", "foreshortening"]
    lens = law("lens", 2, 0.0, special=True)
    assert told(monkeypatch, [bias, bent], scale, lens, 95.0) == ["bias", "foreshortening"]
    # without a special fault two others have to be ahead by what a further law earns
    stream = law("stream", 3, 109.0)
    assert told(monkeypatch, [stream], scale, push, 95.0) == ["stream"]


def test_a_form_that_was_fitted_itself_counts_with_no_more_numbers():
    spring = law("spring", 3, 200.0)
    forms = [law("across", 1, 201.0), law("speed", 3, 203.0), law("place", 8, 150.0), law("power", 2, 300.0)]
    found = fitted_as_good(spring, spring.fit, forms, 1.0)
    # a little behind it, the one with fewer numbers counts, and one with as many is only told
    assert [(a.form.label, a.ahead, a.counts) for a in found] == [("across", 3.0, True)]
    near = fitted_as_good(spring, spring.fit, [law("speed", 3, 202.0), law("across", 1, 206.0)], 1.0)
    assert [(a.form.label, a.counts) for a in near] == [("speed", False), ("across", True)]


def test_where_all_of_a_class_is_refuted_slower_noise_is_asked_as_well(monkeypatch):
    """A stream and the same told as a drag and a push are both refuted: what slow noise leaves open is asked then."""
    stream, same, other = (claim(law(name, 3, 190.0)) for name in ("stream", "drag and push", "square drag"))
    unlike = {"stream": True, "drag and push": True, "square drag": False}

    def held(of: Claim) -> HeldOut:
        return HeldOut({}, {}, "holds", 5.0, of, None, unlike=unlike[of.label], beyond=unlike[of.label])

    monkeypatch.setattr(pipeline, "judge", lambda of, *a: Judgement("missing_physics", of, None))
    stub = SimpleNamespace(
        notes=[], plain=None, alike=lambda judged: [same], alike_in_slow_noise=lambda judged: [other],
        weigh=lambda of: None, mismatch=lambda of: None, settle=lambda judged: judged,
        hold_out=lambda judged: held(judged.claim), predicts_better=lambda a, b: a is not b,
    )  # fmt: skip
    first = Judgement("missing_physics", stream, None)

    def stands() -> str:
        return pipeline.another_of_the_class(stub, first, held(stream))[0].claim.label  # type: ignore[arg-type]

    monkeypatch.setattr(stub, "predicts_better", lambda a, b: a.claim is stream)
    assert stands() == "square drag"
    # where those are refuted as well the class itself goes first
    unlike["square drag"] = True
    assert stands() == "drag and push"


def test_two_laws_are_as_far_behind_one_as_they_are_in_the_noise_that_is_asked(monkeypatch):
    stream, drag, push = law("stream", 3, 190.0), law("drag", 1, 0.0), law("push", 2, 0.0)
    fit = SimpleNamespace(chi2=197.0)
    monkeypatch.setattr(pairs, "_beside_each", lambda *args, **how: [(drag.signature, push.signature, fit)])
    monkeypatch.setattr(pairs, "_in_place_of", lambda *args: [])
    search = SimpleNamespace(spread=lambda fit: 1.0, scored=lambda fit, laws: [t.label for t in laws])
    assert pairs.two_alike(search, [], stream, 3) == []  # type: ignore[arg-type]
    assert pairs.two_alike(search, [], stream, 3, lambda fit: 0.3) == [["drag", "push"]]  # type: ignore[arg-type]


def errors(size: float, seed: int = 0) -> Errors:
    noise = np.random.default_rng(seed).normal(size=(80, 2)) * size
    return Errors(size, {}, scored={"film": noise})


@pytest.mark.parametrize(
    ("mine", "its", "in_films", "stands"),
    [(9.0, 1.0, 1.0, True), (9.0, 1.0, 9.0, False), (1.0, 1.0, 1.0, False), (1.0, 3.0, 1.0, False)],
)
def test_a_rival_predicts_better_by_more_than_a_true_claim_leaves(mine, its, in_films, stands):
    """Frames of a run are off together: that a claim is behind is told from films in which it is true."""
    ratios = in_films * np.exp(np.random.default_rng(1).normal(size=10) * 0.2)
    films = np.stack([ratios, np.ones(10)], axis=1)
    rival, rng = law("across", 1, 200.0), np.random.default_rng(0)
    found = rivalled.predicts_better(
        law("spring", 3, 200.0).fit, errors(mine), [rival], lambda fit: errors(its, 1), lambda fits: films, rng, 0.005
    )
    assert found is (rival if stands else None)


def test_rivals_of_a_claim_have_no_more_numbers_and_no_special_fault():
    spring, plain = law("spring", 3, 200.0), SimpleNamespace(chi2=1000.0)
    others = [
        law("across", 1, 210.0), law("place", 8, 150.0), law("lens", 2, 205.0, special=True), law("push", 2, 950.0),
        law("spring on one", 3, 190.0, mechanism="spring"), law("stream", 3, 204.0),
    ]  # fmt: skip
    found = rivalled.as_simple([spring], spring.fit, plain, others, 1.0)  # type: ignore[arg-type]
    assert [t.label for t in found] == ["stream", "across"]
    assert current().verdict.rival * 800 > 50  # what gains hardly anything is none


def test_held_out_data_that_a_simpler_one_predicts_better_speak_against_a_bent_picture(monkeypatch):
    lens = claim(law("lens", 3, 200.0, special=True))
    tracks = SimpleNamespace(notes=[], _more_held_out=lambda bent: False)
    for rival, unlike in (("a force across the motion", True), ("", False)):
        tracks._predicted_better = lambda claim, chance, rival=rival: rival
        judged = Judgement("measurement", lens, None)
        assert model.Tracks._unlike(tracks, judged) is unlike  # type: ignore[arg-type]
    assert len(tracks.notes) == 1 and "a force across the motion" in tracks.notes[0]
    drag = Judgement("missing_physics", claim(law("drag", 1, 200.0)), None)
    tracks._predicted_better = None  # not asked of what is no special fault
    assert model.Tracks._unlike(tracks, drag) is False  # type: ignore[arg-type]


def on_a_turning_table(speed: float, drag: float, seconds: float, seed: int) -> Recording:
    """A puck of 0.1 kg that glides where a force of 0.0404 kg/s times its speed acts across it, seen from above."""
    mass, across, noise, t = 0.1, 0.0404, 3e-4, np.arange(int(seconds * 60)) / 60
    rate = complex(-drag, across) / mass
    z = speed * np.exp(0.3j) * (np.exp(rate * t) - 1) / rate
    xy = np.stack([z.real, z.imag], axis=1) + noise * np.random.default_rng(seed).normal(size=(len(t), 2))
    known, free = (use("linear_drag", c=drag),), (Adjustable("linear_drag", "c", drag / 3, 3 * drag),)
    scene = Scene((Body("puck", "free", 0.01, mass),), known, gravity=(0.0, 0.0), adjustable=free)
    angle = np.full((len(t), 1), math.nan)
    return Recording("table", scene, t, ("puck",), xy[:, None], angle, position_noise=noise, sampling=60.0)


@pytest.mark.deep
def test_a_spring_far_off_is_not_all_there_is_where_a_force_across_the_motion_does_as_well():
    """A spring of three numbers, its end a radius of curvature away, leaves noise; so does one number."""
    found = diagnose([on_a_turning_table(0.6, 0.02, 2.5, 3)]).verdict
    assert [m["name"] for m in found["mechanisms"]] == ["unknown"] or not found["complete"]
