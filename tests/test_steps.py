"""How finely a recording is simulated: as its laws ask, and no finer than its camera can see."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cached_property

import numpy as np
import pytest

from granswim_pymunk import Body, Scene, use
from granswim_pymunk.inference.criteria import DEFAULT
from granswim_pymunk.inference.data import Case, prepare
from granswim_pymunk.inference.hypothesis import Predictor
from granswim_pymunk.inference.tracks import diagnose_tracks
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.steps import advised, short, time_steps
from granswim_pymunk.recording import Recording, film
from granswim_pymunk.scene import Time
from granswim_pymunk.walls import Wall

RATE = 15.0


def ball(*laws, second=False, **more) -> Scene:
    bodies = (Body("b", "free", 0.05, 0.2, initial=(0.0, 0.0, 3.0, 2.0)),)
    bodies += (Body("c", "free", 0.05, 0.2, initial=(5.0, 0.0, 0.0, 0.0)),) if second else ()
    return Scene(bodies, laws, gravity=(0.0, -9.81), **more)


def fallen(truth: Scene, belief: Scene, noise: float, late: float = 0.0) -> Recording:
    t = np.arange(0.0, 3.0, 1 / RATE)
    fine = replace(truth, time=Time(dt=2e-4))
    seen = film(fine, t + late, rng=np.random.default_rng(3), noise=noise)
    return replace(seen, t=t, scene=belief, position_noise=noise, sampling=RATE)


def one(belief: Scene, noise: float) -> Case:
    return prepare(fallen(belief, belief, noise), held_out=False, split=True)


def per_frame(case: Case) -> int:
    return round(1 / RATE / time_steps([case])[case.name])


def test_a_slow_camera_is_followed_in_few_steps():
    """Free fall is exact in any step; between steps the path is a chord, g dt^2/8 beside the parabola."""
    case = one(ball(), 0.02)
    assert advised(case) == pytest.approx(1e-3, rel=0.02)
    assert per_frame(case) == DEFAULT.fits.steps
    # a better camera sees the chord, were it as long
    good = one(ball(), 1e-3)
    steps = per_frame(good)
    chord = 9.81 / 8 / (steps * RATE) ** 2 / good.sigma[1] * np.sqrt(len(good.t))
    assert steps > DEFAULT.fits.steps
    assert chord < DEFAULT.fits.shift < 4.2 * chord  # the next one up, half as many, would not do


@pytest.mark.parametrize("belief", [
    ball(second=True), ball(time=Time(dt=1e-3)), ball(walls=(Wall((-9.0, -60.0), (40.0, -60.0)),)),
    replace(ball(), gravity=(0.0, 0.0), laws=()), replace(ball(), gravity=(0.0, -1.0)),
])  # fmt: skip
def test_what_may_meet_or_rub_or_has_a_step_of_its_own_keeps_it(belief):
    assert per_frame(one(belief, 0.02)) == round(1 / RATE / advised(one(belief, 0.02)))


def test_a_law_that_such_steps_are_too_long_for_gets_shorter_ones():
    """A drag that brings a ball to its last speed within two frames, unlike anything the believed scene does."""
    truth = ball(use("quadratic_drag", c=0.2))
    found = diagnose_tracks([fallen(truth, ball(), 1e-3)])
    entry = found.verdict["mechanisms"][0]
    c = entry["parameters"]["c"]
    assert entry["name"] == "quadratic_drag" and c["low"] < 0.2 < c["high"]
    assert found.verdict["complete"] is True


def test_a_scene_with_other_numbers_is_the_scene_with_them():
    scene = ball(use("linear_drag", c=0.1))
    assert scene.ids == ("b",)
    laws = (*scene.laws[:1], scene.laws[1].with_values(c=0.2))
    other = scene.having_laws(laws)
    assert other == replace(scene, laws=laws) and scene.laws[1].values["c"] == 0.1
    assert all(getattr(other, f.name) is getattr(scene, f.name) for f in fields(Scene) if f.name != "laws")
    # it takes over what was worked out: that has to hang on the bodies alone
    assert {n for n, v in vars(Scene).items() if isinstance(v, cached_property)} == {"_by_id", "ids", "swimmer"}


def test_a_scene_that_begins_later_is_the_scene_with_another_start():
    scene = ball(use("linear_drag", c=0.1), time=Time(dt=1e-3))
    assert scene.starting_at(2.0) == replace(scene, time=replace(scene.time, start=2.0))
    assert scene.time.start == 0.0


@pytest.mark.parametrize("step, alone", [(1e-3, True), (1e-5, False)])
def test_short_runs_stay_in_one_thread(step, alone):
    case = one(ball(), 0.02)
    assert short(Fitter([case], Predictor({case.name: step}))) is alone
