"""Runs that cost little beside their steps: scenes with other numbers, and how many threads follow a film."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cached_property

import numpy as np
import pytest

from granswim_pymunk import Body, Scene, use
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Predictor
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.steps import short
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Time


def ball(*laws, **more) -> Scene:
    bodies = (Body("b", "free", 0.05, 0.2, initial=(0.0, 0.0, 3.0, 2.0)),)
    return Scene(bodies, laws, gravity=(0.0, -9.81), **more)


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
    seen = film(ball(), np.arange(0.0, 3.0, 1 / 15), rng=np.random.default_rng(3), noise=0.02)
    case = prepare(replace(seen, position_noise=0.02), held_out=False, split=True)
    assert short(Fitter([case], Predictor({case.name: step}))) is alone
