"""A camera that creeps while it films, and one that somebody runs against."""

import math
from dataclasses import replace

import numpy as np
import pytest

import granswim_pymunk as gs
from granswim_pymunk.inference.camera_terms import camera_terms
from granswim_pymunk.inference.data import prepare, prepare_all
from granswim_pymunk.inference.tracks.jumps import jump_terms, jumps_of, scored_before_jumps
from granswim_pymunk.recording import film, see
from granswim_pymunk.scene import Body, Scene, Wall, use

DRIFT = (1.0e-3, -4.0e-4)  # m/s
JUMP = (2.5e-3, -1.0e-3)  # m
DRAG = 2.0e-3  # N m s, in the bearing


def scene(*laws) -> Scene:
    held = use("pin", bodies=["bob"], anchor=(0.0, 0.0), length=0.3)
    start = (0.3 * math.sin(0.4), -0.3 * math.cos(0.4), 0.0, 0.0)
    bob = Body("bob", "free", 0.02, 0.2, initial=start)
    return Scene((bob,), (use("gravity"), held, *laws), gravity=(0.0, -9.81))


def creeping(laws=(), drift=DRIFT):
    times = np.arange(300) / 60
    seen = film(scene(*laws), times, rng=np.random.default_rng(5), noise=2e-4, drift=drift)
    return gs.Recording(
        name="pendulum", title="", scene=scene(), t=seen.t, ids=seen.ids, xy=seen.xy, angle=None, sampling=60.0,
        position_noise=2e-4,
    )  # fmt: skip


def bumped(row, change=JUMP):
    """The pendulum with drag, all of it off from a frame on."""
    seen = creeping((use("joint_drag", bodies=["bob"], c=DRAG),), (0.0, 0.0))
    xy = seen.xy.copy()
    xy[row:] += change
    return replace(seen, xy=xy)


def test_see_moves_the_picture_from_the_first_frame_on():
    still = np.zeros((3, 2, 2))
    seen = see(still, drift=(2.0, -1.0), since=np.array([0.0, 0.5, 1.0]))
    assert seen[:, 1].tolist() == [[0.0, 0.0], [1.0, -0.5], [2.0, -1.0]]
    assert not see(still, drift=(2.0, -1.0)).any()  # no times: none has gone by
    after = see(still, jump=(3.0, 4.0), jumped=0.5, since=np.array([0.0, 0.5, 1.0]))
    assert after[:, 0].tolist() == [[0.0, 0.0], [3.0, 4.0], [3.0, 4.0]]


@pytest.mark.deep
def test_a_creeping_camera_is_told_beside_the_drag_of_a_bearing(tmp_path):
    film_of_it = creeping((use("joint_drag", bodies=["bob"], c=DRAG),))
    verdict = gs.diagnose(film_of_it, out=tmp_path / "out", seed=1).verdict
    assert verdict["complete"]
    found = {m["name"]: m["parameters"] for m in verdict["mechanisms"]}
    assert found.keys() == {"camera_drift", "joint_drag"}
    u = found["camera_drift"]["u"]
    for value, low, high, true in zip(u["value"], u["low"], u["high"], DRIFT, strict=True):
        assert abs(value - true) < 1e-4 and low - 2e-5 < true < high + 2e-5
    assert found["joint_drag"]["c"]["value"] == pytest.approx(DRAG, rel=0.05)


def test_it_is_a_candidate_only_where_the_scene_holds_something_fast():
    at = {t.mechanism for t in camera_terms(prepare_all([creeping()], ()))}
    assert "camera_drift" in at
    ball = Scene((Body("ball", "free", 0.02, 0.1, initial=(0.0, 0.0, 1.0, 2.0)),), (use("gravity"),), (0.0, -9.81))
    flown = film(ball, np.arange(40) / 60, rng=np.random.default_rng(1), noise=1e-4)
    assert "camera_drift" not in {t.mechanism for t in camera_terms(prepare_all([flown], ()))}


def test_jump_of_the_picture_is_found_at_its_frame():
    case = prepare(bumped(100), held_out=False, split=True)
    (jump,) = jumps_of(case)
    assert abs(jump.row - 100) <= 1
    np.testing.assert_allclose(jump.change, JUMP, atol=1e-3)  # from twelve frames, beside a cubic
    assert not jumps_of(prepare(bumped(100, (0.0, 0.0)), held_out=False, split=True))


def test_a_body_that_jumps_alone_is_no_jump_of_the_picture():
    laws = [use("pin", bodies=[k], anchor=(x, 0.0), length=0.3) for k, x in (("a", 0.0), ("b", 0.5))]
    start = {"a": (0.1, -math.sqrt(0.08), 0.0, 0.0), "b": (0.4, -math.sqrt(0.08), 0.0, 0.0)}
    bodies = tuple(Body(k, "free", 0.02, 0.2, initial=start[k]) for k in "ab")
    seen = film(Scene(bodies, (use("gravity"), *laws), (0.0, -9.81)), np.arange(120) / 60,
                rng=np.random.default_rng(2), noise=2e-4)  # fmt: skip
    for moved, count in (([0], 0), ([0, 1], 1)):
        xy = seen.xy.copy()
        xy[50:, moved] += JUMP
        case = prepare(replace(seen, xy=xy, angle=None), held_out=False, split=True)
        assert len(jumps_of(case)) == count


def test_an_impact_is_no_jump_of_the_picture():
    """A ball that bounces: what steps is its velocity."""
    ball = Body("ball", "free", 0.03, 0.1, initial=(0.0, 0.6, 0.3, 0.0))
    laws = (use("gravity"), use("contact_elastic", restitution=0.8))
    floor = (Wall((-5.0, 0.0), (5.0, 0.0)),)
    scene = Scene((ball,), laws, (0.0, -9.81), walls=floor)
    for rate in (30, 120):
        seen = film(scene, np.arange(2 * rate) / rate, rng=np.random.default_rng(3), noise=3e-4)
        assert not jumps_of(prepare(seen, held_out=False, split=True))


@pytest.mark.parametrize("restitution", [0.35, 0.5, 0.8])
@pytest.mark.parametrize("rate", [30, 60])
def test_bounces_are_no_errors_of_stamps_nor_of_sightings(restitution, rate):
    """With some frames from bounce to bounce, and then at rest on the floor: no polynomial follows the ball."""
    ball = Body("ball", "free", 0.03, 0.1, initial=(0.0, 0.6, 0.3, 0.0))
    laws = (use("gravity"), use("contact_elastic", restitution=restitution))
    scene = Scene((ball,), laws, (0.0, -9.81), walls=(Wall((-5.0, 0.0), (5.0, 0.0)),))
    seen = film(scene, np.arange(2 * rate) / rate, rng=np.random.default_rng(0), noise=1e-3)
    case = prepare(replace(seen, position_noise=None), held_out=False, split=True)
    assert case.late is None and not case.notes


def test_what_is_learnt_from_may_have_jumped_and_what_is_held_out_ends_there():
    learnt, later = (prepare(bumped(row), held_out=False, split=True) for row in (100, 260))
    (term,) = jump_terms([learnt])
    assert term.mechanism == "camera_jump" and term.special
    assert jump_terms([later]) == [] and jump_terms([learnt, later]) == []
    assert scored_before_jumps(learnt) is learnt
    cut = scored_before_jumps(later)
    assert cut.scored[:259].sum() == later.scored[:259].sum() and not cut.scored[261:].any()
    assert "the picture jumps by 0.002" in cut.notes[-1]


@pytest.mark.deep
def test_a_bumped_camera_is_told_beside_the_drag_of_a_bearing():
    verdict = gs.diagnose(bumped(100), seed=1).verdict
    assert verdict["complete"]
    found = {m["name"]: m["parameters"] for m in verdict["mechanisms"]}
    assert found.keys() == {"camera_jump", "joint_drag"}
    np.testing.assert_allclose(found["camera_jump"]["b"]["value"], JUMP, atol=2e-4)
    assert found["camera_jump"]["t_1"]["value"] == pytest.approx(99.5 / 60, abs=1 / 60)
    assert found["joint_drag"]["c"]["value"] == pytest.approx(DRAG, rel=0.05)
