"""A camera that creeps while it films."""

import math

import numpy as np
import pytest

import granswim_pymunk as gs
from granswim_pymunk.inference.camera_terms import camera_terms
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.recording import film, see
from granswim_pymunk.scene import Body, Scene, use

DRIFT = (1.0e-3, -4.0e-4)  # m/s
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


def test_see_moves_the_picture_from_the_first_frame_on():
    still = np.zeros((3, 2, 2))
    seen = see(still, drift=(2.0, -1.0), since=np.array([0.0, 0.5, 1.0]))
    assert seen[:, 1].tolist() == [[0.0, 0.0], [1.0, -0.5], [2.0, -1.0]]
    assert not see(still, drift=(2.0, -1.0)).any()  # no times: none has gone by


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
