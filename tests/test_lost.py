"""Frames that were dropped or shown twice while the stamps go on."""

from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.inference import lost
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.lost import missing, repeated
from granswim_pymunk.recording import Recording, read_recording, resolve_recording
from granswim_pymunk.scene import Body, Scene

NOISE = 3e-4  # m


def sliding(rate: float, seconds: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Stamps and places (T, 3, 2) of three pucks that a drag slows down."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * rate)) / rate
    speed, away = rng.uniform(-0.5, 0.5, (3, 2)), rng.uniform(-0.3, 0.3, (3, 2))
    gone = (1 - np.exp(-0.3 * t)) / 0.3
    return t, away + speed * gone[:, None, None] + NOISE * rng.normal(size=(len(t), 3, 2))


def swinging(rate: float, seconds: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Stamps and places (T, 1, 2) of the bob of a pendulum of half a metre, small swings."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * rate)) / rate
    angle = 0.5 * np.exp(-0.04 * t) * np.cos(np.sqrt(9.81 / 0.5) * t + rng.uniform(0, 6))
    xy = 0.5 * np.stack([np.sin(angle), -np.cos(angle)], axis=1)[:, None]
    return t, xy + NOISE * rng.normal(size=xy.shape)


def recorded(t: np.ndarray, xy: np.ndarray) -> Recording:
    ids = tuple(f"p{k}" for k in range(xy.shape[1]))
    scene = Scene(tuple(Body(b, "free", 0.02, 0.05) for b in ids), ())
    return Recording("pucks", scene, t, ids, xy, sampling=1 / (t[1] - t[0]), position_noise=NOISE)


def flat(xy: np.ndarray) -> np.ndarray:
    return xy.reshape(len(xy), -1)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("motion", [sliding, swinging])
def test_frames_that_are_missing_are_found_and_counted(motion, seed):
    t, xy = motion(60.0, 4.0, seed)
    seen = np.ones(len(t), dtype=bool)
    seen[80:83] = seen[150] = False
    sigmas = [NOISE] * flat(xy).shape[1]
    assert missing(t, flat(xy), sigmas) == []
    found = dict(missing(t[: seen.sum()], flat(xy)[seen], sigmas))
    assert found.get(80) == 3
    # a pendulum that turns round just then moves no farther in one frame than its noise
    assert set(found) <= {80, 147} and found.get(147, 1) == 1


@pytest.mark.parametrize(("noise", "found"), [(NOISE, [(50, 3)]), (NOISE / 10, [])])
def test_windows_that_are_told_together_are_told_as_one_by_one(monkeypatch, noise, found):
    """Also where no window is followed to so little noise that its polynomials leave no more."""
    t, xy = swinging(60.0, 2.0, 1)
    kept = np.r_[0:50, 53:120]
    given = t[: len(kept)], flat(xy)[kept], [noise] * 2
    left, asked = lost._Ways.left, []
    monkeypatch.setattr(lost._Ways, "left", lambda *args: asked.append(1) or left(*args))
    assert missing(*given) == found
    few = len(asked)
    monkeypatch.setattr(lost, "_open", lambda way, times, *rest: np.ones(len(times), dtype=bool))
    assert missing(*given) == found
    assert few < 0.5 * (len(asked) - few)


def test_impacts_are_no_missing_frames():
    """A kink is followed by smooth ways with a gap that is long enough: it is still a kink."""
    rng = np.random.default_rng(3)
    t = np.arange(240) / 240
    for when in rng.uniform(0.2, 0.8, 10):
        before, after = rng.uniform(-0.6, 0.6, (2, 4))
        xy = before * np.minimum(t, when)[:, None] + after * np.maximum(t - when, 0)[:, None]
        assert missing(t, xy + NOISE * rng.normal(size=xy.shape), [NOISE] * 4) == []


def test_about_a_gap_that_the_stamps_tell_of_none_is_made_longer():
    # a carriage turns round while seven frames are lost: no polynomial follows that, and one does if it took longer
    t, kept = np.arange(90) / 45, np.r_[0:40, 47:90]
    for seed in (0, 19, 34, 53, 63, 75, 78, 83):
        rng = np.random.default_rng(seed)
        x = sum(0.02 / f * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in rng.uniform(0.5, 3, 3))
        seen = (x + 1e-4 * rng.normal(size=90))[kept, None]
        assert missing(t[kept], seen, [1e-4]) == []


def test_a_picture_that_is_shown_again_is_told_from_a_turning_point():
    _, xy = swinging(60.0, 4.0, 1)
    values = flat(xy).copy()
    values[100] = values[99]
    assert np.flatnonzero(repeated(values, [NOISE] * 2, [1e-6] * 2)).tolist() == [100]
    # of whole pixels neighbouring frames are often the same
    pixels = np.round(flat(xy) / 1e-3) * 1e-3
    assert not repeated(pixels, [4e-4] * 2, [1e-3] * 2).any()


@pytest.mark.parametrize("name", ["Tennis_Ball_1", "Golf_Ball_2"])
def test_pixels_of_a_straightened_picture_are_no_picture_shown_again(name):
    """A ball that is let go lies in the same pixel twice; the pixels are of different sizes, and on no grid."""
    (folder,) = (f for f in resolve_recording("falling_balls") if f.name == name)
    case = prepare(read_recording(folder), held_out=False, split=False)
    assert np.isfinite(case.values).all()
    assert not any("shows the picture before again" in note for note in case.notes)


def test_a_recording_is_mended_and_says_so():
    t, xy = sliding(60.0, 4.0, 0)
    seen = np.ones(len(t), dtype=bool)
    seen[80:83] = False
    whole, kept = recorded(t, xy), recorded(t[:-3], xy[seen])
    case = prepare(kept, held_out=False, split=True)
    assert np.allclose(case.t, t[seen], atol=1e-9) and np.array_equal(case.recording.t, case.t)
    assert any("3 before t = 1.333 s" in note for note in case.notes)
    again = xy.copy()
    again[50] = again[49]
    case = prepare(replace(whole, xy=again), held_out=False, split=True)
    assert np.isnan(case.values[50]).all() and any("shows the picture before again" in n for n in case.notes)
    assert not prepare(whole, held_out=False, split=True).notes


def between_cushions(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Stamps at 60 Hz and places (66, 1, 2) of a fast puck, to the micrometre, that a cushion throws back twice."""
    rng = np.random.default_rng(seed)
    t = np.arange(66) / 60
    high = np.abs(0.5 - 3.0 * t)
    high = np.where(t > 0.5, 1.0 - 1.7 * (t - 0.5), high)
    xy = np.stack([0.4 + 1.9 * t, high], axis=1) + 2e-4 * rng.normal(size=(66, 2))
    return t, np.round(xy, 6)[:, None]


def test_where_every_picture_is_there_twice_noise_is_that_of_the_pictures():
    """What stands still in every second frame and jumps in the next looks like noise of half a jump: 3 cm here."""
    t, xy = between_cushions(0)
    twice = np.repeat(xy, 2, axis=0)
    stamps = np.repeat(t, 2) + np.tile([0.0, 0.0087], len(t))
    once = replace(recorded(t, xy), position_noise=None)
    film = replace(recorded(stamps, twice), position_noise=None, sampling=120.0)
    case, plain = (prepare(r, held_out=False, split=True) for r in (film, once))
    assert np.array_equal(case.t, t) and np.array_equal(case.values, plain.values, equal_nan=True)
    assert np.allclose(case.sigma, plain.sigma) and case.sigma.max() < 5e-4
    assert case.recording.sampling == 60.0
    assert case.notes[0] == "pucks: 66 frames, the first at t = 0.0087 s, show the picture before again: left out"
    assert not plain.notes


def test_a_wrong_sighting_beside_two_that_are_the_same_makes_no_picture_shown_again():
    """On pixels a slow cart is told at one place twice; the one after it is no position, and bends every cubic."""
    rng, pixel, t = np.random.default_rng(2), 3e-4, np.arange(300) / 60
    x = 0.1 + 0.03 * np.sin(2 * np.pi * 0.8 * t) + 6e-4 * rng.normal(size=300)
    x = np.round(x / pixel) * pixel
    turns = int(np.argmax(x))  # there it moves less than a pixel from frame to frame
    x[turns] = x[turns - 1]
    x[turns + 1] += 0.018
    assert not repeated(x[:, None], [6e-4], [pixel], [pixel]).any()


def test_rounding_to_coarse_pixels_makes_no_picture_shown_again():
    """Bodies that creep stay on one number, and are off any curve by a part of it: far more than a noise that is told
    too small."""
    pixel, t = 1e-3, np.arange(400) / 60
    slow = np.stack([0.02 * np.sin(0.3 * t + k) + 0.03 * t * (-1) ** k for k in range(4)], axis=1)
    assert not repeated(np.round(slow / pixel) * pixel, [1e-4] * 4, [pixel] * 4, [pixel] * 4).any()
