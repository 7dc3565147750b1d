"""Several recordings of which one has a fault, bodies that come late, films so short that a bad sighting hides."""

import math
from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.inference import diagnose
from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.criteria import current
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.noise import Noise, Seen, squares_in_slow_noise
from granswim_pymunk.inference.tracks.blocks import make_blocks, score
from granswim_pymunk.inference.tracks.deleted import followed_sighting
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.name import is_part, try_candidates
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.steps import time_steps
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene, use

NOISE = 5e-4  # m


def thrown(name: str, seed: int, turn: float = 0.0, g: float = 9.81, frames: int = 80, rate: float = 120.0):
    """A ball in the air, seen by a camera that is turned by an angle [rad]; gravity is believed to be 9.81 m/s^2."""
    rng, t = np.random.default_rng(seed), np.arange(frames) / rate
    xy = np.stack([1.0 * t, 1.5 + 1.0 * t - 0.5 * g * t**2], axis=1)
    c, s = math.cos(turn), math.sin(turn)
    xy = xy @ np.array([[c, s], [-s, c]]) + NOISE * rng.normal(size=xy.shape)
    scene = Scene((Body("ball", "free", 0.03, 0.15),), (use("gravity"),), gravity=(0.0, -9.81))
    return Recording(name, scene, t, ("ball",), xy[:, None], sampling=rate, position_noise=NOISE)


def two_pucks(seed: int, late: int) -> Recording:
    """Two pucks that friction slows down, the second of which enters the picture late."""
    rng, t = np.random.default_rng(seed), np.arange(150) / 60
    velocity = np.array([[0.8, 0.1], [0.7, -0.2]])
    speed = np.linalg.norm(velocity, axis=1)
    way = (speed - 0.5 * 0.2 * t[:, None]) * t[:, None] / speed
    xy = way[..., None] * velocity + [[0.0, 0.0], [0.0, 0.5]] + NOISE * rng.normal(size=(150, 2, 2))
    xy[:late, 1] = np.nan
    scene = Scene(tuple(Body(b, "free", 0.03, 0.1) for b in "ab"), ())
    return Recording("pucks", scene, t, ("a", "b"), xy, sampling=60.0, position_noise=NOISE)


@pytest.mark.deep
def test_a_camera_that_was_turned_between_two_films_is_named_for_that_film():
    verdict = diagnose([thrown("one", 1), thrown("two", 2, turn=0.035)]).verdict
    assert verdict["verdict"] == "measurement"
    (fault,) = verdict["mechanisms"]
    angle = fault["parameters"]["angle"]
    assert fault["name"] == "camera_tilt" and "in two" in fault["expression"]
    assert angle["low"] < 0.035 < angle["high"]


def test_a_fault_of_one_recording_is_asked_of_a_few_that_are_learnt_from_and_is_part_of_that_of_all():
    films = [thrown(f"f{k}", k) for k in range(3)]
    terms = named_terms(prepare_all(films, ()))
    tilts = [t for t in terms if t.mechanism == "camera_tilt"]
    asked = [t.recordings for t in tilts]
    learnt = {c.name for c in prepare_all(films, ()) if not c.held_out}
    assert len(learnt) == 2 and asked == [None, *(frozenset([name]) for name in sorted(learnt))]
    assert [is_part(t, tilts) for t in tilts] == [False, True, True]
    assert not any(t.recordings for t in named_terms(prepare_all(films[:1], ())))


def test_a_block_asks_nothing_of_a_body_that_its_first_frames_do_not_show():
    recording = two_pucks(3, late=60)
    cases = prepare_all([recording], ())
    predictor = Predictor(time_steps(cases))
    fitter = Fitter(cases, predictor)
    naive = fitter.fit(Hypothesis(), (), None)
    blocks = make_blocks(cases)
    found = score(naive, blocks, predictor, Noise(), np.random.default_rng(0))
    for b, block in enumerate(blocks):
        shown = np.isfinite(block.case.values[block.start]).any(axis=0)
        told = {c.body for c, there in zip(block.case.channels, shown, strict=True) if there}
        assert {body for k, body, _ in found.sums if k == b} <= told
    assert any(body == "b" for _, body, _ in found.sums)


def test_a_bad_sighting_that_a_short_film_follows_is_found_by_what_a_law_leaves_without_it():
    films = [thrown(f"f{k}", k, g=3.7, frames=8, rate=30.0) for k in range(4)]
    bad = films[1].xy.copy()
    bad[-1, 0, 0] += 60 * NOISE

    def found(recordings):
        cases = [c for c in prepare_all(recordings, ()) if not c.held_out]
        fitter = Fitter(cases, Predictor(time_steps(cases)))
        naive = fitter.fit(Hypothesis(), (), None)
        terms = [t for t in named_terms(cases) if t.mechanism in ("uniform_force", "camera_scale")]
        trials = try_candidates(fitter, naive, make_bank(fitter, naive, terms), (1.0,), lambda *_: None)
        return followed_sighting(trials, cases)

    assert found(films) == {}
    told = found([films[0], replace(films[1], xy=bad), *films[2:]])
    assert list(told) == ["f1"] and np.argwhere(told["f1"])[:, 0].tolist() == [7, 7]


def test_white_noise_tells_laws_apart_that_slow_noise_does_not():
    """A film of 60 frames hides a slow part; one of 2000 does not: a law keeps its lead in all noises it may have."""
    rng, leads = np.random.default_rng(1), []
    for count in (60, 2000):
        t = np.linspace(-1.0, 1.0, count)[:, None]
        white = rng.normal(size=(count, 1))
        curve = 30.0 * (t**3 - 0.6 * t) / math.sqrt(count)  # what a law leaves that is not the right one
        none, starts = np.zeros((count, 1, 0)), np.stack([t**0, t, t**2], axis=-1)
        seen = [
            Seen(r, np.arange(count), none, starts, np.zeros((0, 3)), np.zeros(0)) for r in (white, white + curve)
        ]
        (right, _), (other, may_be) = (squares_in_slow_noise([s]) for s in seen)
        leads.append((float(other[0] - right[0]), float(np.min((other - right)[may_be]))))
    (white, slow), (white_long, slow_long) = leads
    same = current().verdict.same
    assert min(white, white_long) > 4 * same
    assert slow < same < slow_long
