"""Where the profile of chi2 of one number ends."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_believed import fitted

from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.hypothesis import Free, Hypothesis
from granswim_pymunk.inference.noise import Noise
from granswim_pymunk.inference.tracks.choose import score_inner
from granswim_pymunk.inference.tracks.fitted import covariance_of
from granswim_pymunk.inference.tracks.intervals import _end, _widened, with_doubt, with_other_choices
from granswim_pymunk.inference.tracks.name import Trial
from granswim_pymunk.inference.tracks.study import _leaves_noise, _scored_forms
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Body, Scene, use

AT, ERROR = 2.0, 0.3


class Profile:
    """Fits whose chi2 rises with the square of the distance; one that goes farther than ``reach`` is lost."""

    def __init__(self, reach=math.inf):
        self.reach, self.fits = reach, 0

    def fit(self, hypothesis, values, starts, **how):
        self.fits += 1
        lost = abs(values[0] - starts) > self.reach
        chi2 = 1e6 if lost else ((values[0] - AT) / ERROR) ** 2
        return SimpleNamespace(chi2=chi2, values=values, starts=float(values[0]), hypothesis=hypothesis)


def end(profile, first, low=-math.inf, high=math.inf, side=1.0):
    hypothesis = SimpleNamespace(free=(Free("s", "N", low, high, AT, 1.0),))
    fit = SimpleNamespace(chi2=0.0, values=np.array([AT]), starts=AT, hypothesis=hypothesis)
    return _end(profile, fit, 0, 1.0, side, first)


@pytest.mark.parametrize("first", [0.05, 0.3, 1.0, 2.5])
def test_few_fits_find_the_end(first):
    """1.96 standard errors away, to a twentieth of that."""
    for side in (-1.0, 1.0):
        profile = Profile()
        assert abs(end(profile, first, side=side) - AT) == pytest.approx(math.sqrt(3.84) * ERROR, rel=0.06)
        assert profile.fits <= 6


def test_along_a_valley_that_bends():
    """No search gets farther than 0.1 from where it begins: the end is not where one failed."""
    profile = Profile(reach=0.1)
    assert abs(end(profile, 0.08) - AT) == pytest.approx(math.sqrt(3.84) * ERROR, rel=0.2)


def test_a_bound_before_the_end_is_the_end():
    assert end(Profile(), 0.2, high=2.25) == 2.25 and end(Profile(), 0.2, low=1.75, side=-1.0) == 1.75


@pytest.mark.parametrize("found", [0.5, 119.0])
def test_an_end_near_a_bound_is_not_the_bound(found):
    """Any friction above 0.3 holds all contacts alike: of a fit that ended at 119 the interval begins at 0.3, not 0."""

    def searched(hypothesis, values, starts, **how):
        return SimpleNamespace(chi2=(max(0.3 - values[0], 0.0) / 0.01) ** 2, values=values, starts=starts)

    hypothesis = SimpleNamespace(free=(Free("mu", "1", 0.0, math.inf, 0.0, 1.0),))
    fit = SimpleNamespace(chi2=0.0, values=np.array([found]), starts=0.0, hypothesis=hypothesis)
    low, high = (_end(SimpleNamespace(fit=searched), fit, 0, 1.0, side, 0.1 * found) for side in (-1.0, 1.0))
    assert low == pytest.approx(0.3 - 1.96 * 0.01, rel=0.1) and high == math.inf


@pytest.mark.parametrize("slow", [False, True])
def test_ends_hold_what_slow_noise_would_do(slow):
    """A push that noise correlated over 15 frames makes up is in no interval of white noise."""
    scene = Scene((Body("a", "free", 0.01, 0.02, initial=(0.0, 0.0, 0.4, 0.1)),))
    t, rng = np.arange(0.0, 1.0, 0.01), np.random.default_rng(3)
    recording = film(scene.with_laws(use("uniform_force", a=(0.1, 0.0))), t, rng=rng, noise=0.0)
    noise = Noise(0.8, 15.0) if slow else Noise()
    held, widths = [], []
    for _ in range(8):
        seen = replace(recording, xy=recording.xy + 2e-5 * noise.draw(recording.xy.shape, rng), position_noise=2e-5)
        fitter, fit = fitted(replace(seen, scene=scene), "uniform_force")
        before, after = (f.interval(0) for f in (fit, with_doubt(fitter, fit, 0, 1.0)))
        assert after[1] <= before[1] and after[2] >= before[2]
        held.append((before[1] < 0.1 < before[2], after[1] < 0.1 < after[2]))
        widths.append((after[2] - after[1]) / (before[2] - before[1]))
    (plainly, with_it), wider = np.mean(held, axis=0), np.median(widths)
    assert with_it >= 0.8 and (plainly < 0.6, wider > 1.5) == (slow, slow)


@pytest.mark.parametrize(("radius", "told"), [(0.013, False), (0.03, True)])
def test_intervals_hold_the_powers_of_the_radius_that_do_as_well(radius, told):
    """Of two disks of nearly one size nobody can tell how a drag grows with it; the coefficient depends on that."""
    bodies = (Body("a", "free", 0.01, 0.02, initial=(0.0, 0.0, 0.4, 0.1)),
              Body("b", "free", radius, 0.02, initial=(0.0, 0.2, 0.2, 0.1)))  # fmt: skip
    scene, true = Scene(bodies), use("quadratic_drag", c=0.02, p=2)
    recording = film(scene.with_laws(true), np.arange(0.0, 1.0, 0.01), rng=np.random.default_rng(2), noise=2e-4)
    fitter, fit = fitted(replace(recording, scene=scene), f"quadratic_drag p={2 if told else 0}")
    after, notes = with_other_choices(fitter, fit, 0, 1.0, named_terms(fitter.cases))
    (value, *before), (_, low, high) = fit.interval(0), after.interval(0)
    if told:
        assert not notes and [low, high] == before
    else:
        assert notes == ["quadratic_drag: p = 0 was chosen; p = 1 or p = 2 does as well, which the intervals hold"]
        others = [
            fitter.fit(Hypothesis((t,)), [value], fit.starts).values[0]
            for t in named_terms(fitter.cases) if t.label in ("quadratic_drag p=1", "quadratic_drag p=2")
        ]  # fmt: skip
        assert low <= min(others) and max(others) <= high and high - low > 1.01 * (before[1] - before[0])


def test_what_is_far_behind_the_best_is_not_scored():
    """Forms without a name beside a law that gains more than twice as much: their score decides nothing."""
    scored = []

    def scores(fits):
        scored.extend(fits)
        return [(1.0, {}) for _ in fits]

    trials = [Trial(None, fit, gain, math.inf) for fit, gain in (("near", 60.0), ("far", 40.0))]
    inner = SimpleNamespace(scores=scores)
    assert [t.inner for t in score_inner(inner, trials, ahead=100.0)] == [1.0, math.inf] and scored == ["near"]
    assert [t.inner for t in score_inner(inner, trials)] == [1.0, 1.0]


@pytest.mark.parametrize(("segmented", "scored"), [(True, ["ahead"]), (False, ["ahead", "behind"])])
def test_through_segments_a_form_behind_a_name_is_not_scored(segmented, scored):
    """A form that follows what it was fitted to no better than a name, its numbers paid, is no better explanation."""
    asked = []

    def scores(fits):
        asked.extend(fit.name for fit in fits)
        return [(1.0, {}) for _ in fits]

    def trial(name, gain, numbers, value=0.1):
        free = tuple(Free(f"{name}.{k}", "1", 0.0, 1.0, 0.1, 0.01) for k in range(numbers))
        term = SimpleNamespace(free=free, label=name, mechanism=name, special=False)
        own = {"hypothesis": Hypothesis((term,)), "values": np.full(numbers, value)}
        fit = SimpleNamespace(name=name, excess=0.0, **own)
        return Trial(SimpleNamespace(term=term), fit, gain, math.inf)

    study = SimpleNamespace(fitter=SimpleNamespace(segmented=segmented), inner=SimpleNamespace(scores=scores))
    # a law whose number ended where its search ends is no explanation, however much it gains
    laws = [trial("law", 100.0, 1), trial("absurd", 200.0, 1, value=1.0)]
    forms = _scored_forms(study, [trial("ahead", 120.0, 4), trial("behind", 103.0, 4)], laws, 1.0)
    assert asked == scored and [t.term.label for t in forms] == ["ahead", "behind"]
    assert [math.isfinite(t.inner) for t in forms] == [True, "behind" in scored]
    assert [_leaves_noise(t) for t in laws] == [True, False]


def test_a_strength_of_millions_and_its_power_are_known_along_a_valley():
    """F = s d^-n at distances d: of s alone, in N, hardly anything is told, and that is no reason to know n better."""
    far = np.linspace(8.0, 12.0, 30)
    s, n, noise = 3e6, 6.4, 0.02
    force = s * far**-n
    moved = np.stack([force / s, -force * np.log(far)], axis=1) / noise
    covariance = covariance_of(moved.T @ moved)
    # the same with ln s in place of s, whose matrix is of one size
    even = np.linalg.inv((moved * [s, 1.0]).T @ (moved * [s, 1.0])) * np.outer([s, 1.0], [s, 1.0])
    np.testing.assert_allclose(covariance, even, rtol=1e-6)
    nothing = covariance_of(np.diag([4.0, 0.0]))
    np.testing.assert_allclose(nothing, np.diag([0.25, 0.0]))


def test_a_strength_with_its_power_is_widened_by_a_factor_and_keeps_its_sign():
    strength = Free("law.s", "N", -math.inf, math.inf, 0.0, 1.0)
    power = Free("law.n", "1", 0.0, 20.0, 2.0, 1.0, inner=True)
    term = SimpleNamespace(free=(strength, power))
    hypothesis = SimpleNamespace(free=(strength, power), terms=(term,))
    sure = {0: (5.0, 40.0), 1: (1.5, 2.5)}
    fit = SimpleNamespace(
        values=np.array([10.0, 2.0]), hypothesis=hypothesis, profiles=sure, limits=sure, believed=None,
        covariance=np.diag([5.0, 0.05]) ** 2, jacobian={},
    )  # fmt: skip
    fit.interval = lambda k, spread: (fit.values[k], *sure[k])
    half = 1.96 * 5.0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("granswim_pymunk.inference.tracks.intervals.replace", lambda of, **_: of)
        low, high = _widened(fit, 0, 1.0, 10.0 - 2 * half, 10.0 + 2 * half)
    assert low == pytest.approx(10.0 * 0.5**2, rel=1e-3) and high == pytest.approx(10.0 * 4.0**2, rel=1e-3)
