"""The times of a recording: what is refused, what is said, what passes, and what is too little to learn from."""

import math
import warnings

import numpy as np
import pytest

from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.recording import Recording, write_recording
from granswim_pymunk.recording.clock import check_clock
from granswim_pymunk.recording.importers import import_recording
from granswim_pymunk.scene import Body, Scene, SceneWarning


def film(t, **more):
    """A ball on its way, at the times t."""
    t = np.asarray(t, dtype=float)
    xy = np.stack([0.3 * t, 0.01 * np.sin(7 * t)], axis=-1)[:, None]
    scene = Scene((Body("a", "free", 0.01, 0.01),))
    return Recording(**{"name": "r", "scene": scene, "t": t, "ids": ("a",), "xy": xy, **more})


def said(recording):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_clock(recording)
    return " ".join(str(w.message) for w in caught)


REGULAR = np.arange(100) / 10


class TestClock:
    @pytest.mark.parametrize("far", [1e3, 1e6, 1e12])
    @pytest.mark.parametrize("sampling", [None, 10.0])
    def test_a_stray_stamp_is_refused_and_named(self, far, sampling):
        with pytest.raises(InputError, match=r"frame 100: t = .* after the nearest frame"):
            check_clock(film([*REGULAR, far], sampling=sampling))
        with pytest.raises(InputError, match=r"frame 0: t = .* before the nearest frame"):
            check_clock(film([-far, *REGULAR], sampling=sampling))

    def test_several_equal_gaps_are_refused_as_well(self):
        bursts = np.concatenate([REGULAR[:10] + 1e4 * k for k in range(8)])
        with pytest.raises(InputError, match="make two recordings of it"):
            check_clock(film(bursts))

    def test_a_gap_of_half_a_recording_is_said(self):
        assert "nothing is seen for 16.1 s, from frame 99 (t = 9.9 s)" in said(film([*REGULAR, *(REGULAR + 26)]))
        assert "from frame 0 (t = -60 s) to frame 1" in said(film([-60, *REGULAR]))

    @pytest.mark.parametrize(
        "t",
        [
            REGULAR,
            1.7e9 + REGULAR,  # a clock that counts from 1970
            np.cumsum(np.random.default_rng(0).exponential(0.1, 200)),  # stamps that come as they like
            np.delete(REGULAR, slice(30, 70)),  # behind something for a while
            [0, 0.1, 0.2, 3.0],
            [0.0, 5.0],
            [0.0],
        ],
    )
    def test_honest_times_pass_without_a_word(self, t):
        assert said(film(t)) == ""

    def test_an_imported_table_is_looked_at_too(self, tmp_path):
        table = tmp_path / "table.csv"
        table.write_text("t,body,x,y\n" + "".join(f"{t},a,{0.1 * t},0\n" for t in [*REGULAR[:9], 4e5]))
        with pytest.raises(InputError, match="frame 9: t = 400000 s"):
            import_recording(table, "long", bodies=["a:0.01:0.01"])


class TestEnough:
    """A training part must measure more than the start of the bodies."""

    def test_four_frames_with_a_stamp_of_minus_one(self, tmp_path, capsys):
        write_recording(film([-1.0, 0.0, 0.1, 0.2]), tmp_path / "r")
        assert main(["diagnose", str(tmp_path / "r"), "--out", str(tmp_path / "out")]) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and "the first 60% of its time (-1 to -1 s) have 1 frames with 2" in err
        assert not (tmp_path / "out").exists()

    @pytest.mark.parametrize(("frames", "enough"), [(4, False), (5, True), (6, True)])
    def test_two_frames_say_nothing_and_three_something(self, frames, enough):
        recording = film(np.arange(frames) / 10)
        if enough:
            assert prepare_all([recording])[0].training.sum() >= 3
        else:
            with pytest.raises(InputError, match="the start alone has 4"):
                prepare_all([recording])

    def test_a_held_out_start_needs_its_numbers(self):
        good = film(np.arange(40) / 10)
        prepare_all([good], [film(np.arange(6) / 10, name="short")])
        with pytest.raises(InputError, match=r"short: the first 20% of its time .* fitted on these frames alone"):
            prepare_all([good], [film(np.arange(5) / 10, name="short")])

    def test_a_rod_has_two_numbers_however_much_of_it_is_measured(self):
        from granswim_pymunk.scene import use

        t = np.arange(5) / 10
        angle = 0.3 * np.cos(4 * t)
        xy = np.stack([np.sin(angle), -np.cos(angle)], axis=-1)[:, None]
        pin = use("pin", bodies=["a"], anchor=(0.0, 0.0), length=1.0)
        scene = Scene((Body("a", "free", 0.01, 0.01),), laws=(pin,))
        recording = Recording("r", scene, t[:4], ("a",), xy[:4], angle[:4, None])
        assert math.isclose(prepare_all([recording])[0].training.sum(), 2)


def test_warnings_are_of_the_kind_that_others_silence():
    with pytest.warns(SceneWarning, match="nothing is seen"):
        check_clock(film([-60, *REGULAR]))
