"""Where the time is up before all candidates were tried: what comes first, what is kept, and what is said of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

from granswim_pymunk.inference.hypothesis import Term
from granswim_pymunk.inference.result import NOT_TRIED, PAIRS, Diagnosis, empty_verdict, not_tried
from granswim_pymunk.inference.tracks.name import TOO_LATE, Trial, in_turn
from granswim_pymunk.inference.tracks.study import _not_tried, _or_earlier
from granswim_pymunk.report.sentences import headline
from granswim_pymunk.result import Result


def term(name: str, special: bool = False) -> Term:
    free = SimpleNamespace(name=f"{name}.k")
    return Term(name, name, (free,), lambda *a: None, special=special)  # type: ignore[arg-type]


def trial(name: str, *, gain: float, chi2: float | None = None, reason: str = "") -> Trial:
    signature = SimpleNamespace(term=term(name), gain=gain)
    fit = None if chi2 is None else SimpleNamespace(chi2=chi2)
    return Trial(signature, fit, gain, float("inf"), reason)  # type: ignore[arg-type]


def test_laws_come_before_faults_as_far_ahead_and_special_faults_last():
    terms = [
        term("camera_drift"), term("lens_distortion", special=True), term("tracking_bias"),
        term("camera_foreshortening", special=True), term("joint_drag"), term("joint_friction"), term("linear_drag"),
    ]  # fmt: skip
    said = [terms[k].mechanism for k in in_turn(terms)]
    assert said == [
        "joint_drag", "camera_drift", "joint_friction", "tracking_bias", "linear_drag", "lens_distortion",
        "camera_foreshortening",
    ]  # fmt: skip


def test_a_fit_of_an_earlier_round_is_kept_where_the_time_is_up_in_the_next():
    before = [trial("joint_drag", gain=900.0, chi2=100.0), trial("camera_drift", gain=10.0, chi2=990.0)]
    after = [trial("camera_drift", gain=5.0, chi2=795.0), trial("joint_drag", gain=0.0, reason=TOO_LATE)]
    found = _or_earlier(after, before, SimpleNamespace(chi2=800.0))  # type: ignore[arg-type]
    assert [(t.mechanism, t.gain, t.reason) for t in found] == [("joint_drag", 700.0, ""), ("camera_drift", 5.0, "")]


def test_what_was_not_tried_is_named_and_the_verdict_is_open():
    trials = [
        trial("camera_drift", gain=50.0, chi2=10.0), trial("joint_drag", gain=80.0, reason=TOO_LATE),
        trial("joint_friction", gain=90.0, reason=TOO_LATE), trial("linear_drag", gain=0.1, reason=TOO_LATE),
        trial("spring", gain=70.0, reason="recalibration or the starts imitate it"),
    ]  # fmt: skip
    notes = _not_tried(trials)
    assert notes[1:] == [f"{NOT_TRIED}joint_friction, joint_drag"]
    assert not _not_tried(trials[:1])
    verdict = {**empty_verdict("unmodelled"), "notes": [*notes, f"{NOT_TRIED}{PAIRS}"]}
    assert not_tried(verdict) == ["joint_friction", "joint_drag", PAIRS]
    said = headline(Diagnosis("bodies", verdict))
    assert "no law known here" not in said and "is open: the time was up before" in said and PAIRS in said
    assert "the time was up before all known laws were tried" in Result(verdict).summary()
    known = replace(Diagnosis("bodies", verdict), verdict=empty_verdict("unmodelled"))
    assert "no law known here describes it" in headline(known)
