"""What trackers make of tracks: gaps that they fill, and noise that a filter takes away."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_filter

from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.filled import held_places, on_a_line
from granswim_pymunk.recording import Recording, read_recording, resolve_recording
from granswim_pymunk.scene import Body, Scene, Wall, use

NOISE = 3e-4  # m
LAST = 1e-8  # m, to which tracks are written


def swinging(seed: int, seconds: float = 6.0) -> Recording:
    """A bob on half a metre, as a camera with 60 frames a second sees it."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(60 * seconds)) / 60
    angle = 0.5 * np.exp(-0.04 * t) * np.cos(np.sqrt(9.81 / 0.5) * t + rng.uniform(0, 6))
    xy = 0.5 * np.stack([np.sin(angle), -np.cos(angle)], axis=1)[:, None]
    laws = (use("gravity"), use("pin", anchor=(0.0, 0.0), length=0.5, bodies=["p"]))
    scene = Scene((Body("p", "free", 0.02, 0.05),), laws, gravity=(0.0, -9.81))
    xy = np.round(xy + NOISE * rng.normal(size=xy.shape), 8)
    return Recording("bob", scene, np.round(t, 7), ("p",), xy, sampling=60.0, position_noise=NOISE)


def sliding(seed: int, grid: float = 0.0) -> Recording:
    """Two pucks that friction slows down, where asked on a grid of pixels that was turned."""
    rng = np.random.default_rng(seed)
    t = np.arange(240) / 120
    speed = rng.uniform(0.4, 0.8, (2, 2))
    xy = speed * (t - 0.1 * t**2)[:, None, None] + NOISE * rng.normal(size=(240, 2, 2))
    if grid:
        turn = np.array([[np.cos(0.02), -np.sin(0.02)], [np.sin(0.02), np.cos(0.02)]])
        xy = np.round(xy / grid) * grid @ turn
    scene = Scene(tuple(Body(b, "free", 0.02, 0.05) for b in "ab"), ())
    return Recording("pucks", scene, np.round(t, 7), ("a", "b"), np.round(xy, 8), sampling=120.0, position_noise=NOISE)


def notes_of(recording: Recording) -> str:
    return " ".join(prepare(recording, held_out=False, split=True).notes)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("made", [swinging, sliding])
def test_a_place_that_is_kept_while_the_body_goes_on_is_left_out(made, seed):
    recording = made(seed)
    xy = recording.xy.copy()
    rows = [r for r in (60, 100, 171) if np.linalg.norm(xy[r + 3, 0] - xy[r, 0]) > 0.01]
    assert rows
    for row in rows:
        xy[row + 1 : row + 6, 0] = xy[row, 0]
    case = prepare(replace(recording, xy=xy), held_out=False, split=True)
    lost = np.isnan(case.values[:, :2]).all(axis=1)
    assert all(lost[row + 1 : row + 6].all() for row in rows) and lost.sum() <= 5 * len(rows) + 2
    # of one body alone the whole picture is the same
    said = "the picture before again" if made is swinging else "a stays at its last place"
    assert said in " ".join(case.notes)


def test_a_place_that_is_kept_to_the_end_is_left_out():
    recording = sliding(0)
    xy = recording.xy.copy()
    xy[225:, 0] = xy[224, 0]
    case = prepare(replace(recording, xy=xy), held_out=False, split=False)
    assert np.isnan(case.values[225:, :2]).all() and np.isfinite(case.values[:, 2:]).all()


def test_what_comes_to_rest_and_starts_again_is_no_place_that_is_kept():
    """Sticks and slips, on pixels as large as the noise: at rest it is in the same one, and leaves it from there."""
    t = np.arange(120) / 60
    x = 0.2 * np.clip(t - 0.5, None, 0) ** 2 * -1 + 0.4 * np.clip(t - 1.2, 0, None) ** 2
    values = np.round(np.column_stack([x, 0.3 * x]) / 1e-3) * 1e-3
    assert not held_places(t, values, [4e-4] * 2, [1e-3] * 2).any()


@pytest.mark.parametrize("seed", range(3))
def test_a_gap_that_was_filled_by_a_straight_line_is_left_out(seed):
    recording = swinging(seed)
    xy = recording.xy.copy()
    for row in (70, 200):
        xy[row : row + 8] = np.round(np.linspace(xy[row, 0], xy[row + 7, 0], 8), 8)[:, None]
    case = prepare(replace(recording, xy=xy), held_out=False, split=True)
    lost = np.flatnonzero(np.isnan(case.values).all(axis=1)).tolist()
    assert {*range(71, 77), *range(201, 207)} <= set(lost) and len(lost) <= 16


def test_frames_put_in_between_are_left_out():
    recording = sliding(1)
    xy = recording.xy.copy()
    xy[1:-1:2] = np.round((xy[:-2:2] + xy[2::2]) / 2, 8)
    case = prepare(replace(recording, xy=xy), held_out=False, split=True)
    assert np.isnan(case.values[1:-1:2]).mean() > 0.9 and np.isfinite(case.values[::2]).all()


@pytest.mark.parametrize("seed", range(4))
def test_pixels_of_a_turned_picture_are_no_filled_gaps(seed):
    for recording in (sliding(seed), sliding(seed, grid=1e-3), swinging(seed)):
        assert "filled the gap" not in notes_of(recording)


@pytest.mark.parametrize("name", ["falling_balls", "pendulum", "double_pendulum", "string_pendulum", "two_disk_spin"])
def test_real_tracks_that_nobody_filled_or_smoothed_are_left_as_they_are(name):
    """Balls in films of 44 frames, one coordinate each, on pixels of a straightened picture, among them."""
    for folder in resolve_recording(name):
        said = notes_of(read_recording(folder))
        assert "filled the gap" not in said and "look smoothed" not in said, folder


def test_numbers_without_noise_are_no_filled_gaps():
    t = np.arange(100) / 50
    assert not on_a_line(t, np.column_stack([0.3 * t, 0.1 * t]), [1e-10] * 2, [1e-9] * 2).any()


def filtered(recording: Recording, by) -> Recording:
    xy = np.stack([[by(column) for column in body.T] for body in recording.xy.transpose(1, 0, 2)])
    return replace(recording, xy=np.round(xy.transpose(2, 0, 1), 8))


@pytest.mark.parametrize("width", [7, 9, 13])
@pytest.mark.parametrize("made", [swinging, sliding])
def test_tracks_that_were_smoothed_are_thinned(made, width):
    recording = filtered(made(1), lambda column: savgol_filter(column, width, 2))
    case = prepare(recording, held_out=False, split=True)
    assert "look smoothed" in " ".join(case.notes)
    assert 3 <= round(len(recording.t) / len(case.t)) <= width
    # what is left of the noise is told for what it is: white noise through the filter
    left = NOISE * np.sqrt(np.sum(savgol_filter(np.eye(41)[20], width, 2) ** 2))
    assert case.sigma == pytest.approx(left, rel=0.5)


def test_running_means_are_thinned():
    recording = filtered(sliding(2), lambda column: uniform_filter1d(column, 7, mode="nearest"))
    assert "look smoothed" in notes_of(recording)


@pytest.mark.parametrize("seed", range(6))
def test_what_a_camera_sees_is_not_thinned(seed):
    rng = np.random.default_rng(seed)
    for recording in (swinging(seed), sliding(seed), sliding(seed, grid=5e-4)):
        # a slow part as large as the white one
        slow = np.zeros(recording.xy.shape)
        for k in range(1, len(slow)):
            slow[k] = 0.8 * slow[k - 1] + 0.6 * NOISE * rng.normal(size=slow.shape[1:])
        assert "look smoothed" not in notes_of(recording)
        assert "look smoothed" not in notes_of(replace(recording, xy=recording.xy + slow))


def test_impacts_are_no_filter():
    """A ball on a floor, thirty frames a second: as it bounces no polynomial follows it over many frames."""
    rng, dt = np.random.default_rng(0), 1e-4
    y, v, seen = 0.8, 0.0, []
    for k in range(30000):
        if k % 333 == 0:
            seen.append(y)
        v -= 9.81 * dt
        y += v * dt
        if y < 0.03 and v < 0:
            v *= -0.8
    xy = np.column_stack([0.2 * 333 * dt * np.arange(len(seen)), seen]) + 1e-3 * rng.normal(size=(len(seen), 2))
    laws = (use("gravity"), use("contact_elastic", restitution=0.8))
    scene = Scene((Body("b", "free", 0.03, 0.05),), laws, gravity=(0.0, -9.81), walls=(Wall((-5.0, 0.0), (5.0, 0.0)),))
    t = np.round(333 * dt * np.arange(len(seen)), 7)
    assert "look smoothed" not in notes_of(Recording("ball", scene, t, ("b",), np.round(xy[:, None], 8)))


def test_a_swing_that_is_filmed_too_seldom_is_neither_smoothed_nor_stamped_late():
    """Four frames a second of a swing of 1.4 s: what polynomials over some of them leave is no noise."""
    fine = swinging(4, seconds=30.0)
    seldom = replace(fine, xy=fine.xy[::15], t=fine.t[::15], sampling=4.0)
    case = prepare(seldom, held_out=False, split=True)
    assert "smoothed" not in " ".join(case.notes) and "stamps" not in " ".join(case.notes)
    assert case.late is None and len(case.t) == len(seldom.t)
