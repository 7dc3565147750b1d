"""Forms without a name that do as well as a law: the law has been found, its form has not."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from granswim_pymunk.inference.candidates import asked_terms, flexible_terms, named_terms
from granswim_pymunk.inference.data import Channel, prepare
from granswim_pymunk.inference.explained import Scores, spread_with_mismatch
from granswim_pymunk.inference.hypothesis import Free, Hypothesis, Predictor, Term, adjustable_terms
from granswim_pymunk.inference.result import empty_verdict, mechanism_entry
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.forms import forms_as_good, left_standing
from granswim_pymunk.inference.tracks.intervals import mixed_quantile, with_company, with_slopes
from granswim_pymunk.inference.tracks.name import Trial, try_candidates
from granswim_pymunk.inference.tracks.settle import known_together
from granswim_pymunk.inference.tracks.signatures import held_at_bounds, make_bank
from granswim_pymunk.inference.tracks.verdict import Told, as_a_spring
from granswim_pymunk.laws import all_laws
from granswim_pymunk.recording import film
from granswim_pymunk.result import Result, law_line
from granswim_pymunk.scene import Adjustable, Body, Scene, use

ALONG, ACROSS = (0.5, 0.0), (0.3, 0.4)
C = 0.006  # kg/m


def found(law, *laws, velocity=ALONG, seconds=2.0, split=False):
    """A fit of one law to a body that slides under ``laws``, as a trial, and its fitter.

    ``split``: to the first 60 %
    """
    scene = Scene((Body("a", "free", 0.01, 0.05, initial=(0.0, 0.0, *velocity)),))
    seen = film(scene.with_laws(*laws), np.arange(0.0, seconds, 0.01), rng=np.random.default_rng(0), noise=1e-4)
    bodies = tuple(replace(b, initial=None) for b in scene.bodies)
    recording = replace(seen, scene=replace(scene, bodies=bodies), position_noise=1e-4)
    case = prepare(recording, held_out=False, split=split)
    fitter = Fitter([case], Predictor({case.name: 1e-3}))
    base = fitter.fit(Hypothesis(), None)
    signature = next(s for s in make_bank(fitter, base, named_terms([case])).signatures if s.term.mechanism == law)
    begin = [f.first for f in signature.term.free]
    fit = fitter.fit(Hypothesis((signature.term,)), begin, base.starts, evaluations=40)
    return Trial(signature, fit, base.chi2 - fit.chi2, 1.0), fitter


def told(trial, fitter):
    return {(a.form.mechanism, a.better) for a in forms_as_good([trial], trial.fit, 0, fitter, 1.0)}


def test_asked_forms_are_linear_and_shaped_by_no_data():
    case = found("linear_drag", use("linear_drag", c=0.02))[1].cases[0]
    terms = {t.mechanism: t for t in asked_terms([case])}
    power = terms["flexible_power"]
    (law,) = power.apply(case.recording.scene, {}, [1e-3])[0].laws
    assert len(power.free) == 1 and law.values["n"] == 3.0 and law.values["c"] == 1e-3
    assert [f.name.partition(".")[2] for f in terms["flexible_place"].free] == ["a0", "a1", "a2", "b0", "b1", "b2"]
    assert {t.mechanism for t in asked_terms([case], ["a"])} >= {"flexible_power", "flexible_across"}


@pytest.mark.parametrize("c, narrow", [(5e-4, True), (0.3, False)])
def test_a_third_power_is_told_from_a_square_over_a_range_of_speeds(c, narrow):
    """A speed that falls by a hundredth in two seconds: the third power does as well; to an eighth: it does not."""
    trial, fitter = found("quadratic_drag", use("quadratic_drag", c=c))
    assert trial.gain > 100
    assert (("flexible_power", False) in told(trial, fitter)) is narrow


@pytest.mark.parametrize("law", [use("quadratic_drag", c=C), use("flexible_power", top=0.5, c=C * 0.25, n=3.0, p=0)])
def test_held_out_frames_turn_a_form_down_where_they_tell_it_from_the_law(law):
    """Over 60 % of the time a third power does as well as a square, over all of it the one that acts does."""
    trial, fitter = found("quadratic_drag", law, split=True)
    alike = [a for a in forms_as_good([trial], trial.fit, 0, fitter, 1.0) if a.form.mechanism == "flexible_power"]
    assert alike
    whole = fitter.of_all_frames(fitter.cases)
    standing = left_standing(alike, [trial], trial.fit, 0, whole, 1.0)
    assert bool(standing) is (law.name == "flexible_power")


def test_a_force_across_a_straight_path_is_a_push():
    """A path that hardly turns; one that a push turns round has other velocities across it."""
    weak, strong = use("uniform_force", a=(0.0, 0.004)), use("uniform_force", a=(0.0, 0.5))
    assert ("flexible_across", False) in told(*found("uniform_force", weak, seconds=1.0))
    assert ("flexible_across", False) not in told(*found("uniform_force", strong, velocity=ACROSS))


def test_a_field_that_changes_in_place_is_no_uniform_force():
    """A spring of 0.05 N/m to a point 0.3 m below: a field to first order does better, its numbers paid for."""
    bent = use("spring", bodies=["a"], anchor=(0.3, -0.3), stiffness=0.05, length=0.0)
    assert ("flexible_place", True) in told(*found("uniform_force", bent, seconds=1.0))
    even = told(*found("uniform_force", use("uniform_force", a=(0.0, -0.3)), velocity=ACROSS, seconds=1.0))
    assert not any(better for _, better in even)


def test_an_interval_holds_what_a_law_is_beside_another():
    """A drag beside a weaker push that is not in the fit: the interval of the drag alone misses it."""
    c = 0.02
    trial, fitter = found("linear_drag", use("linear_drag", c=c), use("uniform_force", a=(0.004, 0.0)))
    terms = [t for t in named_terms(fitter.cases) if len(t.free) <= 6]
    wide = with_company(fitter, trial.fit, 0, 1.0, terms)
    _, low, high = trial.fit.interval(0)
    assert not low <= c <= high
    _, lower, higher = wide.interval(0)
    assert lower <= c <= higher and lower <= low and high <= higher


def test_an_interval_holds_what_a_law_is_on_a_table_that_is_not_level():
    """A drag on a slope of 0.4 mm/m that nobody notices: the interval of the drag alone misses it."""
    c = 0.002
    for slope, held in ((4e-4, True), (1e-2, False)):
        trial, fitter = found("linear_drag", use("linear_drag", c=c), use("uniform_force", a=(9.81 * slope, 0.0)))
        terms = named_terms(fitter.cases)
        wide = with_slopes(fitter, trial.fit, 0, 1.0, terms)
        (_, low, high), (_, lower, higher) = trial.fit.interval(0), wide.interval(0)
        assert not low <= c <= high
        assert (lower <= c <= higher) is held and lower <= low and high <= higher
    # a slope that the fit knows of is no nuisance
    level = [t for t in terms if t.mechanism != "uniform_force"]
    assert with_slopes(fitter, trial.fit, 0, 1.0, level) is trial.fit


def test_a_profile_keeps_its_shape_on_a_table_that_is_not_level():
    """Where an interval ends near below and far above, a slope widens it so: a strength keeps its sign."""
    trial, fitter = found("linear_drag", use("linear_drag", c=0.002), use("uniform_force", a=(4e-3, 0.0)))
    value, low, high = trial.fit.interval(0)
    ends = {0: (value - (value - low) / 4, value + (high - value) * 4)}
    even, uneven = (
        with_slopes(fitter, fit, 0, 1.0, named_terms(fitter.cases)).interval(0)
        for fit in (trial.fit, replace(trial.fit, limits=ends, profiles=ends))
    )
    assert even[1] < low and even[2] > high
    assert value - uneven[1] == pytest.approx((value - even[1]) / 4)
    assert uneven[2] - value == pytest.approx((even[2] - value) * 4)


def test_what_an_adjustable_at_its_bound_cannot_take_up_is_company():
    """More drag than the scene's may be, beside a push: its interval holds what it is where a drag is missing, too."""
    a, bodies = 0.05, (Body("a", "free", 0.01, 0.05, initial=(0.0, 0.0, *ACROSS)),)
    believed = Scene(bodies, (use("linear_drag", c=0.01),), adjustable=(Adjustable("linear_drag", "c", 0.005, 0.01),))
    true = Scene(bodies, (use("linear_drag", c=0.02), use("uniform_force", a=(0.0, a))))
    seen = film(true, np.arange(0.0, 2.0, 0.01), rng=np.random.default_rng(0), noise=1e-4)
    case = prepare(replace(seen, scene=believed, position_noise=1e-4), held_out=False, split=False)
    fitter = Fitter([case], Predictor({case.name: 1e-3}))
    terms = {t.mechanism: t for t in named_terms([case])}
    fit = fitter.fit(Hypothesis((*adjustable_terms([case]), terms["uniform_force"])), None, evaluations=40)
    assert fit.values[0] == pytest.approx(0.01)
    (drag,) = make_bank(fitter, fit, [terms["linear_drag"]]).signatures
    assert drag.gain > 1000.0
    # only a drag explains what is left, and without it the push is off
    wide = with_company(fitter, fit, 1, 1.0, [terms["linear_drag"]])
    assert not fit.interval(2)[1] <= a <= fit.interval(2)[2]
    assert wide.interval(2)[1] <= a <= wide.interval(2)[2]


def test_of_a_form_without_a_name_no_width_of_the_search_and_no_unseen_coordinate_is_told():
    law = all_laws()["flexible_edge"]
    names = [p.name for p in law.parameters if p.typical is not None]
    free = tuple(Free(f"{law.name}.{n}", "1", -100.0, 100.0, 0.0, 1.0) for n in names)
    term = Term(
        law.mechanism, law.name, free, lambda *given: given, expression=law.expression, law=law.name,
        groups=tuple((n, (k,)) for k, n in enumerate(names)), fixed={"centre": ((0.2, 0.0), "m"), "size": (0.3, "m")},
    )  # fmt: skip
    given = {
        "c0": (0.0, -0.1, 0.1, "kg/s"), "p": (53.0, -100.0, 100.0, "1"), "q": (43.0, 43.0, 43.0, "1"),
        "centre": ([0.2, 0.0], None, None, "m"), "size": (0.3, None, None, "m"),
    }  # fmt: skip
    cases = [SimpleNamespace(channels=[Channel("a", "x")])]
    numbers, said = Told._of_what_shows(SimpleNamespace(cases=cases), term, given)
    assert numbers == {
        "c0": given["c0"], "p": (53.0, None, None, "1"), "centre_x": (0.2, None, None, "m"), "size": given["size"]
    }  # fmt: skip
    assert "tanh(r + p X))/2, X the place from" in said
    entry = mechanism_entry("unknown", said, ["a"], numbers, None, None)
    assert "p = 53 1" not in law_line(entry) and "p = 53," in law_line(entry)
    text = Result({**empty_verdict("unmodelled"), "mechanisms": [entry]}).summary()
    assert "53 (no interval)" in text and "chosen" not in text
    # in the plane it is as it was
    plane = [SimpleNamespace(channels=[Channel("a", "x"), Channel("a", "y")])]
    numbers, said = Told._of_what_shows(SimpleNamespace(cases=plane), term, given | {"q": (43.0, 40.0, 45.0, "1")})
    assert numbers["q"] == (43.0, 40.0, 45.0, "1") and numbers["centre"] == given["centre"] and said == law.expression


def test_a_number_at_its_bound_would_go_on():
    trial, _ = found("linear_drag", use("linear_drag", c=0.02), seconds=0.5)
    (term,) = trial.fit.hypothesis.terms
    at = replace(trial.fit, values=np.array([1.0]),
                 hypothesis=Hypothesis((replace(term, free=(replace(term.free[0], low=0.0, high=1.0),)),)))  # fmt: skip
    assert held_at_bounds(at, np.array([2.0])) == [0]
    assert held_at_bounds(at, np.array([-2.0])) == []
    assert held_at_bounds(replace(at, values=np.array([0.9])), np.array([2.0])) == []
    assert held_at_bounds(replace(at, values=np.array([0.0])), np.array([-2.0])) == [0]


def test_the_quantile_of_a_mixture():
    one = mixed_quantile(0.975, np.array([1.0]), np.array([2.0]), np.array([1.0]))
    assert one == pytest.approx(1.0 + 2.0 * 1.959964)
    # of two, one has all the weight: rounding is no reason to end in an error
    for part in (0.025, 0.975):
        only = mixed_quantile(part, np.array([3.7e-4, 3.7e-4]), np.array([1e-9, 1e-9]), np.array([1.0, 0.0]))
        assert only == pytest.approx(3.7e-4, rel=1e-4)
        least = mixed_quantile(part, np.array([0.1, 0.3]), np.array([0.1, 1e-3]), np.array([1.0, 1e-320]))
        assert least == pytest.approx(0.1 + (part > 0.5 or -1) * 0.1959964, rel=1e-3)
    far = mixed_quantile(0.975, np.array([0.0, 100.0]), np.array([1.0, 1.0]), np.array([0.5, 0.5]))
    assert far == pytest.approx(100.0 + 1.644854, abs=1e-3)


def test_what_is_misfit_varies_more_than_noise():
    rng = np.random.default_rng(0)
    floor = np.stack([np.sum(rng.normal(size=(2000, 20)) ** 2, axis=1) for _ in range(10)], axis=1)
    before = [np.sum((0.8 + rng.normal(size=(10, 20))) ** 2) / 200 for _ in range(2000)]
    scores = Scores({(k,): 20 * 1.64 for k in range(10)}, {(k,): 20 for k in range(10)}, {}, floor)
    assert spread_with_mismatch(scores) == pytest.approx(np.std(before), rel=0.1)


def test_two_laws_known_only_together_are_named_by_neither():
    """A body that sinks as fast as at the first frame: the push over the drag is its speed, and no more is known."""
    trial, fitter = found("linear_drag", use("linear_drag", c=0.02))
    case = fitter.cases[0]
    push = next(
        s for s in make_bank(fitter, trial.fit, named_terms([case])).signatures if s.term.mechanism == "uniform_force"
    )
    term = replace(push.term, free=push.term.free[:1])
    second = replace(trial, signature=replace(push, term=term))
    hypothesis = Hypothesis((trial.term, term))
    fit = replace(trial.fit, hypothesis=hypothesis, values=np.array([0.02, 1.0]), covariance=np.diag([1e-6, 1e-6]))
    both = [trial, second]
    assert known_together(both, fit, 0, 1.0) == []
    open_ = replace(fit, limits={0: (0.01, np.inf), 1: (0.5, np.inf)})
    assert known_together(both, open_, 0, 1.0) == both
    # one of them is a limit
    assert known_together(both, replace(fit, limits={0: (0.01, np.inf)}), 0, 1.0) == []
    assert known_together([trial], replace(trial.fit, limits={0: (0.01, np.inf)}), 0, 1.0) == []


def test_a_field_is_found_from_pieces_where_the_scene_without_it_is_lost():
    """A cart whose spring the scene lacks: about a straight path a field shows one number, and has more."""
    cart = Body("cart", "free", 0.05, 0.2, initial=(0.09, 0.0, 0.0, 0.0))
    rail = use("rail", bodies=["cart"], direction=(1.0, 0.0))
    spring = use("spring", bodies=["cart"], anchor=(0.0, 0.0), stiffness=5.0, length=0.0)
    seen = film(Scene((cart,), (rail, spring)), np.arange(0, 4, 1 / 40), rng=np.random.default_rng(2), noise=2e-4)
    believed = replace(seen, scene=Scene((replace(cart, initial=None),), (rail,)), position_noise=2e-4)
    case = prepare(believed, held_out=False, split=True)
    fitter = Fitter([case], Predictor({case.name: 5e-3}))
    base = fitter.fit(Hypothesis(), None)
    terms = [t for t in flexible_terms([case]) if t.law == "flexible_place"]
    (trial,) = try_candidates(fitter, base, make_bank(fitter, base, terms), (1.0,), lambda *a: None)
    assert base.chi2 > 1e4 * base.count and trial.fit.chi2 < 1.5 * base.count
    a1 = trial.fit.values[[f.name.split(".")[-1] for f in trial.fit.hypothesis.free].index("a1")]
    assert a1 / trial.term.fixed["size"][0] == pytest.approx(-5.0, rel=0.1)
    (note,) = as_a_spring(trial, trial.fit, [case])
    stiffness = float(re.search(r"with (\S+) N/m", note)[1])
    assert "nearly a spring to (" in note and stiffness == pytest.approx(5.0, rel=0.1)
    # of another body, or of one whose angle alone was seen, there are no places
    blind = replace(case, recording=replace(believed, xy=np.full_like(believed.xy, np.nan)))
    assert as_a_spring(trial, trial.fit, [blind]) == [] == as_a_spring(trial, trial.fit, [])
    # a push is no spring, nor is what drives a body away
    for numbers in ({"a0": 0.3}, {"a1": 0.3}):
        values = [numbers.get(f.name.split(".")[-1], 0.0) for f in trial.fit.hypothesis.free]
        assert as_a_spring(trial, replace(trial.fit, values=np.array(values)), [case]) == []


def test_a_fit_in_which_a_body_flies_off_ends_with_numbers(monkeypatch):
    """Where it does derivatives are no numbers: no traceback comes of it, and the fit is not the best of any."""
    trial, fitter = found("linear_drag", use("linear_drag", c=0.02))
    told = Fitter._sensitivity

    def flown(*given, **more):
        by_value, by_start = told(*given, **more)
        by_value[-1], by_start[-2] = np.inf, np.nan
        return by_value, by_start

    monkeypatch.setattr(Fitter, "_sensitivity", flown)
    again = fitter._finish(trial.fit.hypothesis, trial.fit.values, trial.fit.starts, False)
    assert np.isfinite(again.covariance).all() and again.covariance[0, 0] > 0


def test_a_damped_spring_that_the_scene_lacks_is_told_along_a_rail():
    """Its drag does as a constant force to a cart that goes straight on, and shows in the path of the spring."""
    cart = Body("cart", "free", 0.02, 0.1, initial=(0.12, 0.0, 0.0, 0.0))
    rail = use("rail", bodies=["cart"], direction=(1.0, 0.0))
    spring = use("spring", bodies=["cart"], anchor=(0.01, 0.0), stiffness=0.9, length=0.0)
    true = Scene((cart,), (rail, spring, use("linear_drag", c=0.04)))
    seen = film(true, np.arange(0.0, 5.0, 0.02), rng=np.random.default_rng(3), noise=1e-3)
    xy = seen.xy.copy()
    xy[:, :, 1] = np.nan  # along the rail alone
    case = prepare(
        replace(seen, xy=xy, scene=Scene((replace(cart, initial=None),), (rail,)), position_noise=1e-3),
        held_out=False, split=True,
    )  # fmt: skip
    fitter = Fitter([case], Predictor({case.name: 5e-3}))
    base = fitter.fit(Hypothesis(), None)
    terms = [t for t in flexible_terms([case]) if t.law == "flexible_spring"]
    bank = make_bank(fitter, base, terms)
    assert "c" not in {f.name.split(".")[-1] for f in bank.signatures[0].term.free}
    (trial,) = try_candidates(fitter, base, bank, (1.0,), lambda *a: None)
    numbers = dict(zip((f.name.split(".")[-1] for f in trial.term.free), trial.values, strict=True))
    assert trial.fit.chi2 < 1.5 * base.count and numbers["c"] == pytest.approx(0.04, rel=0.1)
    (note,) = as_a_spring(trial, trial.fit, [case])
    at, stiffness = re.search(r"to \((\S+), 0\) m with (\S+) N/m", note).groups()
    assert float(at) == pytest.approx(0.01, abs=2e-3) and float(stiffness) == pytest.approx(0.9, rel=0.03)
