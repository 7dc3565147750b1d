"""Predictions: a simulation that is begun again is the same as a new one; bodies heavier than believed are named."""

import math
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.criteria import DEFAULT, using
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.inference.hypothesis import Failed, Hypothesis, Predictor, adjustable_terms, left_out
from granswim_pymunk.inference.start import describe_starts, first_numbers
from granswim_pymunk.inference.tracks import diagnose_tracks, fit
from granswim_pymunk.inference.tracks.fit import Fitter, promised, side_by_side
from granswim_pymunk.inference.tracks.fitted import Fit
from granswim_pymunk.inference.tracks.steps import time_steps
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Adjustable, Body, Scene, use
from granswim_pymunk.validation.reference import exact


def pendulum(*laws, adjustable=()) -> Scene:
    body = Body("p", "free", 0.01, 0.1, initial=(0.2 * math.sin(0.8), -0.2 * math.cos(0.8), 0.0, 0.0))
    own = (use("gravity"), use("pin", anchor=(0.0, 0.0), length=0.2, bodies=["p"]), use("linear_drag", c=0.005))
    return Scene((body,), (*own, *laws), gravity=(0.0, -9.81), adjustable=adjustable)


def filmed(truth: Scene, belief: Scene, seed: int, noise: float = 5e-5) -> Recording:
    t = np.arange(0.0, 2.0, 0.02)
    xy = exact(truth, t, rtol=1e-8, max_step=0.02) + np.random.default_rng(seed).normal(size=(len(t), 1, 2)) * noise
    return Recording(name="r", scene=belief, t=t, ids=("p",), xy=xy, sampling=50.0, position_noise=noise)


def test_a_simulation_begun_again_predicts_as_a_new_one():
    belief = pendulum(adjustable=(Adjustable("linear_drag", "c", 0.001, 0.02),))
    cases = prepare_all([filmed(belief, belief, 1)])
    case = cases[0]
    dt = time_steps(cases)
    used, hypothesis = Predictor(dt), Hypothesis(adjustable_terms(cases))
    starts = describe_starts(case, case.training)
    numbers, t = first_numbers(starts), case.t[case.training]
    rng = np.random.default_rng(2)
    for c in (0.004, 0.004, 0.006, 0.004):
        begin = numbers * (1 + 0.01 * rng.normal(size=len(numbers)))
        again = used(hypothesis, case, [c], starts, begin, t[0], t)
        fresh = Predictor(dt)(hypothesis, case, [c], starts, begin, t[0], t)
        np.testing.assert_array_equal(again, fresh)
    assert used.runs == 4


def test_a_search_led_by_longer_steps_ends_where_one_with_fine_steps_does():
    truth = pendulum(use("quadratic_drag", c=0.02))
    belief = pendulum(adjustable=(Adjustable("linear_drag", "c", 0.001, 0.02), Adjustable("pin", "length", 0.15, 0.25)))
    cases = prepare_all([filmed(truth, belief, 4)])
    hypothesis, case = Hypothesis(adjustable_terms(cases)), cases[0]

    def ended(longer: float) -> tuple[Fit, Predictor]:
        fits = replace(DEFAULT.fits, longer=longer)
        with using(replace(DEFAULT, fits=fits)):
            used = Predictor(time_steps(cases))
            return Fitter(cases, used).fit(hypothesis, stages=(0.35, 1.0)), used

    fine, used = ended(1.0)
    # steps as long as the swing itself follow nothing: what they lead astray the fine ones bring back
    for longer in (5.0, 100.0):
        led, other = ended(longer)
        spread = np.sqrt(np.diag(fine.covariance))
        assert (np.abs(led.values - fine.values) < 0.1 * spread).all()
        assert led.chi2 == pytest.approx(fine.chi2, abs=2 * DEFAULT.fits.enough, rel=1e-5)
        np.testing.assert_allclose(led.covariance, fine.covariance, rtol=1e-2)
        assert promised(led, [0, 1]) < max(DEFAULT.fits.enough, 1e-4 * led.chi2)
        assert other.with_steps(longer).dt[case.name] == longer * used.dt[case.name]
        assert other.runs and not other.with_steps(longer).runs  # counted where the others are


@pytest.mark.deep
def test_inertia_that_was_not_counted_is_added_mass():
    found = diagnose_tracks([filmed(pendulum(use("added_mass", beta=0.1)), pendulum(), 3)])
    verdict = found.verdict
    entry = verdict["mechanisms"][0]
    assert (verdict["verdict"], entry["name"]) == ("missing_physics", "added_mass")
    beta = entry["parameters"]["beta"]
    assert beta["low"] < 0.1 < beta["high"]


def test_a_body_that_escapes_is_a_run_that_failed():
    """What is finite may still be so far off that its square is not."""
    ball = Scene((Body("p", "free", 0.01, 0.1, initial=(0.0, 0.0, 0.1, 0.0)),), (use("linear_drag", c=0.005),))
    cases = prepare_all([filmed(ball, ball, 3)])
    case = cases[0]
    predictor = Predictor(time_steps(cases))
    starts = describe_starts(case, case.training)
    numbers, t = first_numbers(starts), case.t[case.training]
    assert np.isfinite(predictor(Hypothesis(), case, [], starts, numbers, t[0], t)).all()
    with pytest.raises(Failed, match="within 1e\\+09 m"):
        predictor(Hypothesis(), case, [], starts, numbers * 1e200, t[0], t)
    assert len(predictor.failures) == 1
    # and is told as what it was
    assert left_out(predictor.failures) == "1 trial scene was left out of the search, as bodies flew off there"
    said = left_out([*predictor.failures * 3, "swing: no step is small enough"])
    assert said == (
        "3 trial scenes were left out of the search, as bodies flew off there; 1 more, as it could not be followed "
        "to the end: swing: no step is small enough"
    )


def test_a_run_that_comes_to_no_finite_place_is_told_in_plain_words():
    """What the engine says of it, and of numbers that a search tries, are no words for a reader."""
    ball = Scene((Body("p", "free", 0.01, 0.1, initial=(0.0, 0.0, 0.1, 0.0)),), (use("linear_drag", c=0.005),))
    adjustable = replace(ball, adjustable=(Adjustable("linear_drag", "c", 0.001, 0.02),))
    cases = prepare_all([filmed(adjustable, adjustable, 3)])
    case = cases[0]
    predictor, hypothesis = Predictor(time_steps(cases)), Hypothesis(adjustable_terms(cases))
    starts = describe_starts(case, case.training)
    numbers, t = first_numbers(starts), case.t[case.training]
    with pytest.raises(Failed):
        predictor(hypothesis, case, [np.inf], starts, numbers, t[0], t)
    with pytest.raises(Failed):  # a drag that is so large that the step turns the velocity round, and more each time
        predictor(hypothesis, case, [1e80], starts, numbers, t[0], t)
    assert left_out(predictor.failures) == (
        "1 trial scene was left out of the search, as bodies flew off there; 1 more, as no law takes numbers such as "
        "theirs"
    )


def test_no_run_is_made_twice():
    belief = pendulum(adjustable=(Adjustable("linear_drag", "c", 0.001, 0.02),))
    cases = prepare_all([filmed(belief, belief, 1)])
    case = cases[0]
    used, hypothesis = Predictor(time_steps(cases)), Hypothesis(adjustable_terms(cases))
    starts = describe_starts(case, case.training)
    numbers, t = first_numbers(starts), case.t[case.training]
    first = used(hypothesis, case, [0.004], starts, numbers, t[0], t)
    kept = first.copy()
    first[:] = 0.0  # what is kept is not what was handed out
    np.testing.assert_array_equal(used(hypothesis, case, [0.004], starts, numbers, t[0], t), kept)
    assert used.runs == 1
    used(hypothesis, case, [0.005], starts, numbers, t[0], t)
    used(hypothesis, case, [0.004], starts, 1.01 * numbers, t[0], t)
    used(hypothesis, case, [0.004], starts, numbers, t[0], t[:-1])
    used.dt = {name: dt / 2 for name, dt in used.dt.items()}
    assert (used(hypothesis, case, [0.004], starts, numbers, t[0], t) != kept).any() and used.runs == 5


def test_fits_side_by_side_are_the_same_fits(monkeypatch):
    """However many run at a time; and where one fails, the others end at their next evaluation."""
    belief = pendulum(adjustable=(Adjustable("linear_drag", "c", 0.001, 0.02),))
    fitter = Fitter(cases := prepare_all([filmed(belief, belief, 1)]), Predictor(time_steps(cases)))
    hypothesis = Hypothesis(adjustable_terms(cases))
    jobs = [partial(lambda own, c: own.fit(hypothesis, [c]), c=c) for c in (0.004, 0.006, 0.015)]
    alone = [job(fitter.apart()) for job in jobs]
    for workers in (1, 3):
        with ThreadPoolExecutor(workers) as pool:
            monkeypatch.setattr(fit, "_FITS", pool)
            found = side_by_side(fitter, jobs)
        assert [f.chi2 for f in found] == [f.chi2 for f in alone]
        assert [f.values.tobytes() for f in found] == [f.values.tobytes() for f in alone]
    seen, began = [], threading.Event()

    def waiting(own):
        began.set()
        while not own.stop():
            time.sleep(0.01)
        seen.append("stopped")

    def failing(own):
        began.wait()
        raise InputError("of the test")

    with ThreadPoolExecutor(2) as pool:  # which waits for its threads in the end
        monkeypatch.setattr(fit, "_FITS", pool)
        with pytest.raises(InputError, match="of the test"):
            side_by_side(fitter, [failing, waiting])
    assert seen == ["stopped"]
