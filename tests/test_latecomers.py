"""A body that enters the picture after what is learnt from."""

from dataclasses import replace

import numpy as np
import pytest

import granswim_pymunk as gs
from granswim_pymunk.inference.latecomers import without_latecomers
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Body, Scene, use

T = np.arange(0.0, 1.5, 0.01)


def two(speed=0.4, at=(1.0, 0.0), enters=1.2):
    """A disk that slides under drag, and another one that is seen from ``enters`` s on."""
    bodies = (Body("a", "free", 0.01, 0.02, initial=(0.0, 0.0, speed, 0.1)),
              Body("b", "free", 0.01, 0.02, initial=(*at, 0.0, 0.05)))  # fmt: skip
    believed = Scene(tuple(replace(b, initial=None) for b in bodies))
    seen = film(Scene(bodies, (use("linear_drag", c=0.01),)), T, rng=np.random.default_rng(1), noise=1e-4)
    xy = seen.xy.copy()
    xy[T < enters, 1] = np.nan
    return replace(seen, scene=believed, xy=xy, position_noise=1e-4)


@pytest.mark.deep
def test_the_rest_of_the_film_is_diagnosed_and_a_note_says_so():
    verdict = gs.diagnose(two(), seed=0).verdict
    assert [m["name"] for m in verdict["mechanisms"]] == ["linear_drag"]
    assert any("b first seen after what is learnt from, and left out" in note for note in verdict["notes"])


def test_frames_in_which_it_comes_near_another_are_left_out():
    recording = two(at=(0.4, 0.05))
    less, (note,) = without_latecomers(recording, 0.6)
    gap = np.hypot(*(recording.xy[:, 0] - recording.xy[:, 1]).T)
    near = int(np.flatnonzero(gap < 0.04)[0])
    assert less.ids == ("a",) == less.scene.ids and len(less.t) == near < len(T)
    assert f"all frames from t = {T[near]:.4g} s on are" in note


def test_what_is_seen_from_the_beginning_stays():
    recording = two(enters=0.5)
    assert without_latecomers(recording, 0.6) == (recording, [])
    # nobody else is seen: nothing is left out, and what is wrong is said elsewhere
    alone = replace(recording, xy=np.where(T[:, None, None] < 1.2, np.nan, recording.xy))
    assert without_latecomers(alone, 0.6) == (alone, [])
