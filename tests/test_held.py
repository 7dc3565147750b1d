"""Bodies that something holds, or bears, in the first frames: no motion that the scene is asked about."""

import numpy as np

from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.release import first_pulled
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene, use


def film(x: np.ndarray, y: np.ndarray, gravity: tuple[float, float], *laws: object) -> Recording:
    scene = Scene((Body("ball", "free", 0.01, 0.05),), tuple(laws), gravity=gravity)
    xy = np.stack([x, y], axis=1)[:, None]
    return Recording("ball", scene, np.arange(len(x)) / 30, ("ball",), xy, sampling=30.0)


def test_a_ball_that_rolls_off_a_table_falls_from_its_edge_on():
    t = np.arange(16) / 30
    for seed in range(5):
        noise = 5e-4 * np.random.default_rng(seed).normal(size=(2, 16))
        fallen = np.maximum(t - 0.08, 0.0)
        x = 4.9 * fallen**2 + np.where(fallen > 0, noise[0], 0.0)
        case = prepare(film(x, 0.3 * t + noise[1], (9.81, 0.0)), held_out=False, split=True)
        first = int(np.flatnonzero(np.isfinite(case.values).all(axis=1))[0])
        assert 2 <= first <= 4 and any("what gravity pulls is at rest until" in note for note in case.notes)


def test_three_frames_before_a_slide_are_left_out():
    """A tracker gives one number again and again where the picture stays; along the rail gravity would move it."""
    t, rail = np.arange(24) / 30, use("rail", bodies=["ball"], direction=(1.0, 0.0))
    for seed in range(5):
        noise = 4e-4 * np.random.default_rng(seed).normal(size=(2, 24))
        noise[:, :3] = noise[:, :1]
        slid = np.maximum(t - t[2], 0.0)
        case = prepare(film(0.6 * slid**2 + noise[0], noise[1], (3.8, -9.0), rail), held_out=False, split=True)
        assert not np.isfinite(case.values[:3]).any() and np.isfinite(case.values[5:]).all()


def test_what_falls_from_the_first_frame_on_is_held_by_nothing():
    """Not where coarse pixels tell one number thrice, nor where a body is thrown and turns."""
    rng = np.random.default_rng(1)
    for rate in (30, 60, 120, 240):
        t = np.arange(40) / rate
        for pixel in (1e-4, 1e-3, 4e-3):
            y = np.stack([-4.9 * t**2, 0.02 * t - 4.9 * t**2], axis=1) + pixel / 3 * rng.normal(size=(40, 2))
            y = pixel * np.round(y / pixel)
            assert first_pulled(t, y, [pixel / 2] * 2, [9.81] * 2) == 0
