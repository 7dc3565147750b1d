"""Which bodies bear on one another: derivatives from common runs are those from a run for each number."""

from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.inference.criteria import Criteria, using
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.tracks import bearing as bearings
from granswim_pymunk.inference.tracks import diagnose_tracks, follow
from granswim_pymunk.inference.tracks.believed import believed_terms
from granswim_pymunk.inference.tracks.follow import Follower
from granswim_pymunk.inference.tracks.segments import make_segments, shortened
from granswim_pymunk.inference.tracks.steps import time_steps
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene, use
from granswim_pymunk.validation.hard_disks import Physics, Table, run

NO_CAMERA = {"distortion": 0.0, "foreshortening": 1.0, "scale": 1.0}
NAMES = ("a", "b", "c", "d", "e", "post")


def three_meetings(*laws) -> Recording:
    """Two pairs of disks that meet, and one that meets a post: five disks, three meetings far from each other."""
    places = [(-0.2, 0.0), (-0.1, 0.004), (0.2, 0.0), (0.3, -0.003), (0.0, 0.4), (0.1, 0.406)]
    speeds = [(0.2, 0.0), (-0.1, 0.0), (0.15, 0.0), (-0.15, 0.0), (0.3, 0.0), (0.0, 0.0)]
    start = np.hstack([places, speeds])
    table = Table(np.full(6, 0.02), np.full(6, 0.05), np.arange(6) == 5)
    t = np.arange(0.0, 0.8, 1 / 120)
    flight = run(table, Physics(restitution=0.9), start, t)
    assert len(flight.touches) == 3
    bodies = [Body(n, "wall" if n == "post" else "free", 0.02, 0.05) for n in NAMES]
    bodies[-1] = Body("post", "wall", 0.02, 0.05, initial=(*places[-1], 0.0, 0.0))
    scene = Scene(tuple(bodies), (use("contact_elastic", restitution=0.9), *laws))
    seen = flight.xy[:, :5] + 1e-4 * np.random.default_rng(3).normal(size=(len(t), 5, 2))
    return Recording(name="r", scene=scene, t=t, ids=NAMES[:5], xy=seen, sampling=120.0, position_noise=1e-4)


@pytest.mark.parametrize(
    ("laws", "most"),
    [((), 0.5), ((use("linear_drag", c=0.02),), 0.75), ((use("distance_force", s=1e-4, n=2.0),), 1.0)],
)
def test_common_runs_give_the_derivatives_of_single_ones(laws, most, monkeypatch):
    """Also of radii and masses, but where a law sees a mean radius; what acts at a distance ties all together."""
    cases = prepare_all([three_meetings(*laws)])
    hypothesis = Hypothesis(believed_terms(cases))
    assert len(hypothesis.believed) > 4
    found, runs = [], []
    for how in (bearings.bearing, lambda case, scene, camera, predicted: bearings.together(scene)):
        monkeypatch.setattr(follow, "bearing", how)
        predictor = Predictor(time_steps(cases))
        follower = Follower(cases, predictor)
        numbers, values = follower.first_numbers("r"), np.zeros(len(hypothesis.free))
        follower._vector(cases[0], hypothesis, values, numbers)  # this run is kept, and derivatives begin from it
        begun = predictor.runs
        found.append(np.hstack(follower._sensitivity(cases[0], hypothesis, values, numbers, False)))
        runs.append(predictor.runs - begun)
    common, single = found
    np.testing.assert_allclose(common, single, atol=1e-7 * np.linalg.norm(single, axis=0).max(), rtol=0)
    assert runs[0] <= most * runs[1]
    assert (runs[0] == runs[1]) == (most == 1.0)


@pytest.mark.deep
def test_of_more_impacts_than_can_be_fitted_the_first_ones_are():
    recording = three_meetings()
    (case,) = prepare_all([recording])
    pieces = make_segments(case, case.training)
    assert len(pieces) > 1
    assert shortened(case) is case  # a thousand numbers are more than these
    fewer = replace(Criteria(), segments=replace(Criteria().segments, most=pieces[0].size))
    with using(fewer):
        shorter = shortened(case)
        found = diagnose_tracks([recording])
    assert shorter.training.sum() < case.training.sum()
    np.testing.assert_array_equal(shorter.training, pieces[0].frames)
    np.testing.assert_array_equal(shorter.scored, case.scored)
    assert found.verdict["verdict"] == "no_mismatch"
    assert any("learnt from up to t = " in note for note in found.verdict["notes"])


def paths(*ways: tuple[tuple[float, float], tuple[float, float]], frames: int = 7) -> np.ndarray:
    """(T, 2n): straight paths, x and y of each in turn."""
    share = np.linspace(0.0, 1.0, frames)[:, None]
    return np.hstack([np.array(a) + share * (np.array(b) - np.array(a)) for a, b in ways])


def clusters(predicted: np.ndarray, *laws) -> dict[str, int]:
    scene = three_meetings(*laws).scene
    case = prepare_all([three_meetings(*laws)])[0]
    return dict(bearings.bearing(case, scene, NO_CAMERA, predicted).cluster)


def test_bodies_that_pass_between_two_frames_bear_on_each_other():
    """Disks of 2 cm that are 10 cm apart in both frames, and were at one place in between."""
    far = [((1.0, 0.0), (1.0, 0.0)), ((2.0, 0.0), (2.0, 0.0)), ((3.0, 0.0), (3.0, 0.0))]
    crossing = clusters(paths(((-0.05, 0.0), (0.05, 0.0)), ((0.0, -0.05), (0.0, 0.05)), *far, frames=2))
    assert crossing["a"] == crossing["b"]
    assert len(set(crossing.values())) == 4
    apart = clusters(paths(((-0.05, 0.0), (0.05, 0.0)), ((-0.05, 0.5), (0.05, 0.5)), *far, frames=2))
    assert len(set(apart.values())) == 5


def test_a_body_bears_on_those_that_its_neighbours_come_near_to():
    """a meets b, b meets c: a number of a moves c, too; a force with a reach ties more together."""
    ways = paths(
        ((0.0, 0.0), (0.0, 0.0)), ((0.03, 0.0), (0.03, 0.0)), ((0.06, 0.0), (0.06, 0.0)), ((1.0, 0.0), (1.0, 0.0)),
        ((1.06, 0.0), (1.06, 0.0)),
    )  # fmt: skip
    chained = clusters(ways)
    assert chained["a"] == chained["b"] == chained["c"]
    assert len(set(chained.values())) == 3
    reaching = clusters(ways, use("cohesion", force=1e-4, range=0.03))
    assert reaching["d"] == reaching["e"] != reaching["a"]


def test_no_two_of_a_group_are_felt_by_the_same_bodies():
    rng = np.random.default_rng(4)
    for _ in range(50):
        felt = [
            [frozenset(rng.choice(6, rng.integers(0, 3), replace=False).tolist()) for _ in range(3)] for _ in range(12)
        ]
        groups = bearings.coloured(felt)
        assert sorted(k for g in groups for k in g) == list(range(12))
        for group in groups:
            for segment in range(3):
                named = [c for k in group for c in felt[k][segment]]
                assert len(named) == len(set(named))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_step_beyond_a_glancing_impact_is_no_derivative(side):
    """A disk that passes another by less than a step, on either side: its path moves by as much as its start does."""
    t = np.arange(0.0, 1.0, 1 / 100)
    begin, speed = np.array([[0.0, 0.0], [0.25, side * (0.08 + 2e-7)]]), np.array([[0.5, 0.01], [0.003, 0.01]])
    seen = begin + t[:, None, None] * speed
    bodies = tuple(Body(n, "free", 0.04, 0.02) for n in "ab")
    scene = Scene(bodies, (use("contact_elastic", restitution=0.9),))
    cases = prepare_all([Recording(
        name="r", scene=scene, t=t, ids=("a", "b"), xy=seen, sampling=100.0, position_noise=1e-4,
    )])  # fmt: skip
    follower = Follower(cases, Predictor(time_steps(cases)), whole=True)
    numbers = follower.first_numbers("r")
    here = follower._vector(cases[0], Hypothesis(), np.zeros(0), numbers)
    assert np.abs(here).max() < 1e-6  # they do not meet
    steps = 0.1 * follower.number_scales("r")

    def change(k: int, step: float) -> float:
        moved = numbers.copy()
        moved[k] += step
        return float(np.linalg.norm(follower._vector(cases[0], Hypothesis(), np.zeros(0), moved) - here))

    one, other = (np.array([change(k, sign * step) for k, step in enumerate(steps)]) for sign in (1.0, -1.0))
    beyond = (one > 50) & (other < 0.5 * one)
    assert beyond.any() and not beyond.all()
    _, by_start = follower._sensitivity(cases[0], Hypothesis(), np.zeros(0), numbers, False, here)
    np.testing.assert_allclose(np.linalg.norm(by_start, axis=0), np.where(beyond, other, one) / steps, rtol=1e-6)
