"""Which law is taken beside one that was found."""

import math
from types import SimpleNamespace

import numpy as np

from granswim_pymunk.inference.criteria import DEFAULT
from granswim_pymunk.inference.hypothesis import Free, Hypothesis, Term
from granswim_pymunk.inference.tracks import pairs
from granswim_pymunk.inference.tracks.name import Trial
from granswim_pymunk.inference.tracks.signatures import Signature


def term(label, *names):
    free = tuple(Free(name, "N m s", 0.0, math.inf, 0.0, 1e-6) for name in names)
    return Term("joint_drag", label, free, lambda *a: None)


def fitted(chi2, values, ends, score, *terms):
    left = chi2 - 100
    fit = SimpleNamespace(
        chi2=chi2, count=100, excess=left if left > 3 * math.sqrt(200) else 0.0, values=np.array(values), starts={},
        hypothesis=Hypothesis(terms), score=score,
    )  # fmt: skip
    fit.interval = lambda k, spread: (fit.values[k], *ends[k])
    return fit


def test_a_number_for_each_joint_hides_no_number_for_all(monkeypatch):
    """With one for each joint one is none and the other known badly: refused; one for both joints is taken."""
    free = Free("linear_drag.c", "kg/s", 0.0, math.inf, 0.0, 1.0)
    drag = Term("linear_drag", "linear_drag", (free,), lambda *a: None)
    base = fitted(1e5, [1.0], [(0.9, 1.1)], 900.0, drag)
    both, each = term("joint_drag", "c"), term("joint_drag (each body)", "c[a]", "c[b]")
    fits = {
        both.label: fitted(5e4, [1.0, 1e-5], [(0.9, 1.1), (8e-6, 1.2e-5)], 430.0, drag, both),
        each.label: fitted(4.8e4, [1.0, 0.0, 2e-5], [(0.9, 1.1), (-9e-5, 9e-5), (-1e-6, 4e-5)], 400.0, drag, each),
    }
    signatures = tuple(Signature(t, np.zeros((4, 1)), 0.5, 1e4) for t in (each, both))
    monkeypatch.setattr(pairs, "make_bank", lambda *a: SimpleNamespace(signatures=signatures))
    monkeypatch.setattr(pairs, "_refitted", lambda search, fit, signatures: [fits[s.term.label] for s in signatures])
    monkeypatch.setattr(pairs, "noise_of", lambda *a: None)
    monkeypatch.setattr(pairs, "search_nulls", lambda *a: SimpleNamespace(p=0.001))
    def score(fit):
        return fit.score, {"r": fit.score}

    inner = SimpleNamespace(score=score, scores=lambda fits: list(map(score, fits)), slack=0.0)
    fitter = SimpleNamespace(cases=[], fit=lambda *a, **k: base)
    found = [Trial(Signature(drag, np.zeros((4, 1)), 1.0, 1e6), base, 1e6, 900.0)]
    search = SimpleNamespace(
        base=base, fitter=fitter, inner=inner, rng=np.random.default_rng(1), spread=lambda fit: 500.0,
        as_in=lambda fit, laws: laws,
    )  # fmt: skip
    _, _, second = pairs._one_more(search, found, base, [both, each])
    assert second is not None and second.label == "joint_drag"


def test_pairs_are_compared_at_the_ends_of_their_fits(monkeypatch):
    """The right one is behind another that cannot be bettered, until its strength and shape are walked to their end."""
    ends, asked = {400.0: 400.0, 900.0: 90.0}, []

    def refitted(fit, evaluations):
        asked.append(evaluations)
        return SimpleNamespace(chi2=ends[fit.chi2])

    monkeypatch.setattr(pairs, "side_by_side", lambda fitter, jobs: [job(fitter) for job in jobs])
    search = SimpleNamespace(fitter=SimpleNamespace(refitted=refitted))
    begun = [("push", name, SimpleNamespace(chi2=chi2)) for name, chi2 in (("lens", 400.0), ("repulsion", 900.0))]
    found = pairs._to_their_ends(search, begun)  # type: ignore[arg-type]
    assert [(b, fit.chi2) for _, b, fit in found] == [("lens", 400.0), ("repulsion", 90.0)]
    assert asked == [DEFAULT.evaluations.pair_valley] * 2


def test_a_first_pair_has_to_take_most_of_what_is_beyond_noise():
    """A right law has an inner score of about 1: half of a score of 2 is less than noise leaves."""
    assert pairs.most_of_a_pair(2.0) == 1.5
    assert pairs.most_of_a_pair(100.0) == 50.5
    assert pairs.most_of_a_pair(0.9) == 0.9  # never more than there is


def test_what_does_as_well_is_told_in_place_of_what_is_named_in_the_end():
    def law(name):
        return SimpleNamespace(mechanism=name)

    def exchange(keep, replaced, other, ahead=0.0):
        return pairs.Exchange((law(keep),), law(replaced), law(other), ahead)

    others = [
        exchange("camera_scale", "coulomb_substrate", "linear_drag"),
        exchange("camera_scale", "coulomb_substrate", "ambient_flow"),
        exchange("coulomb_substrate", "camera_scale", "camera_tilt"),
        exchange("coulomb_substrate", "camera_scale", "tracking_bias", ahead=-100.0),
    ]
    said = pairs.as_well_in_place(others, ["coulomb_substrate", "camera_scale"])
    assert said == [f"{a} in place of {b} does as well" for a, b in (
        ("linear_drag", "coulomb_substrate"), ("ambient_flow", "coulomb_substrate"), ("camera_tilt", "camera_scale"),
    )]  # fmt: skip
    for named in ([], ["camera_scale"], ["camera_scale", "quadratic_drag"]):
        assert not pairs.as_well_in_place(others, named)
