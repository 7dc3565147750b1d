"""Recordings: what they are, how they are written and read, and how a simulation looks filmed."""

import math
import re
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from granswim_pymunk.errors import InputError
from granswim_pymunk.recording import Recording, film, read_recording, rod_angle, see, write_recording
from granswim_pymunk.recording.plausible import check_plausible
from granswim_pymunk.recording.recording import CURVE
from granswim_pymunk.scene import Adjustable, Body, Scene, SceneWarning, Time, use


def ball(name="a", **more):
    return Body(**{"id": name, "role": "free", "radius": 0.01, "mass": 0.01, **more})


def same(a, b):
    """Everything but name and folder, digit for digit."""
    assert a.ids == b.ids and a.title == b.title
    assert (a.sampling, a.position_noise, a.angle_noise) == (b.sampling, b.position_noise, b.angle_noise)
    np.testing.assert_array_equal(a.t, b.t)
    np.testing.assert_array_equal(a.xy, b.xy)
    assert (a.angle is None) == (b.angle is None)
    if a.angle is not None:
        np.testing.assert_array_equal(a.angle, b.angle)
    assert (a.curve is None) == (b.curve is None)
    if a.curve is not None:
        for field in CURVE.names:
            np.testing.assert_array_equal(a.curve[field], b.curve[field])
    assert a.scene.hash == b.scene.hash


class TestRecording:
    def test_body_selects_the_frames_where_it_was_seen(self):
        xy = np.full((4, 2, 2), np.nan)
        xy[1:, 0] = [[1, 2], [3, 4], [5, 6]]
        xy[0, 1] = [7, 8]
        angle = np.full((4, 2), np.nan)
        angle[3, 1] = 0.5
        r = Recording(
            "r",
            Scene((ball("a"), ball("w", role="wall", initial=(0.0, 0.0, 0.0, 0.0)), ball("b"))),
            np.arange(4.0),
            ("a", "b"),
            xy,
            angle,
        )
        assert r.track_rows.tolist() == [0, 2]
        np.testing.assert_array_equal(r.body("a").t, [1, 2, 3])
        t, places, angles = r.body("b")
        np.testing.assert_array_equal(t, [0, 3])
        np.testing.assert_array_equal(places, [[7, 8], [np.nan, np.nan]])
        np.testing.assert_array_equal(angles, [np.nan, 0.5])
        with pytest.raises(InputError, match="w has no track"):
            r.body("w")

    def test_select_by_frames_and_by_seconds(self):
        r = Recording("r", Scene((ball(),)), np.arange(10) / 10, ("a",), np.zeros((10, 1, 2)))
        assert r.select(slice(2, 8, 3)).t.tolist() == [0.2, 0.5]
        assert r.select((0.3, 0.5)).t.tolist() == [0.3, 0.4, 0.5]
        assert r.select(np.array([0, 9])).t.tolist() == [0.0, 0.9]

    @given(st.lists(st.floats(-0.49, 0.49), min_size=2, max_size=40), st.floats(0.01, 100))
    def test_unwrapping_undoes_wrapping(self, steps, period):
        x = np.cumsum(steps) * period
        xy = np.stack([x, np.zeros_like(x)], axis=-1)[:, None]
        wrapped = xy.copy()
        wrapped[..., 0] %= period
        r = Recording("r", Scene((ball(),), periodic_x=period), np.arange(len(x)), ("a",), wrapped)
        np.testing.assert_allclose(np.diff(r.unwrapped().xy, axis=0), np.diff(xy, axis=0), atol=1e-9 * period)
        already = Recording("r", r.scene, r.t, ("a",), xy)
        np.testing.assert_array_equal(already.unwrapped().xy, xy)

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"t": [0.0, 0.0]}, "rise"),
            ({"t": [0.0, math.nan]}, "rise"),
            ({"xy": np.zeros((2, 2, 2))}, "shape"),
            ({"angle": np.zeros((1, 1))}, "shape"),
            ({"ids": ("b",)}, "not in the scene"),
            ({"xy": np.array([[[0, 1]], [[math.nan, 0]]])}, "one coordinate"),
        ],
    )
    def test_what_does_not_fit_is_refused(self, change, message):
        fields = {"t": [0.0, 1.0], "ids": ("a",), "xy": np.zeros((2, 1, 2)), **change}
        with pytest.raises(InputError, match=message):
            Recording("r", Scene((ball(),)), **fields)

    def test_it_cannot_be_changed_and_leaves_its_source_alone(self):
        xy = np.zeros((1, 1, 2))
        r = Recording("r", Scene((ball(),)), [0.0], ("a",), xy)
        xy[:] = 5
        assert r.xy.max() == 0
        with pytest.raises(ValueError, match="read-only"):
            r.xy[0, 0, 0] = 1

    def test_text_names_what_was_seen(self):
        r = Recording(
            "r", Scene((ball(),)), [0.0, 0.5], ("a",), np.zeros((2, 1, 2)), title="one", position_noise=1e-5
        )
        assert (
            "r: one" in str(r) and "2 frames, 0 .. 0.5 s" in str(r) and "1 body seen (a), in 100%" in str(r)
        )
        assert "positions (noise 1e-05 m)" in str(r)


numbers = st.floats(-20, 20, allow_subnormal=False)


@st.composite
def recordings(draw):
    names = draw(
        st.lists(st.sampled_from(["a", "0", "ü b", "x,y", '"q"', "7"]), min_size=1, max_size=4, unique=True)
    )
    bodies = tuple(
        ball(
            n,
            radius=draw(st.floats(1e-3, 0.1)),
            mass=draw(st.floats(1e-3, 10)),
            inertia=draw(st.none() | st.floats(1e-9, 1e-3)),
            initial=draw(st.none() | st.tuples(numbers, numbers, numbers, numbers)),
        )
        for n in names
    )
    laws = (
        use("gravity"),
        use("linear_drag", c=draw(st.floats(0, 1)), bodies=draw(st.none() | st.just(names[:1]))),
    )
    scene = Scene(
        bodies=bodies,
        laws=laws,
        gravity=(0.5, -9.81),
        periodic_x=draw(st.none() | st.floats(0.1, 10)),
        adjustable=draw(st.sampled_from([(), (Adjustable("linear_drag", "c", 0.0, 2.0, "body"),)])),
        inputs=draw(st.sampled_from([{}, {names[0]: ((0.0, 0.1), (1.5, -2.0))}])),
        seed=draw(st.integers(0, 5)),
    )
    frames = draw(st.integers(1, 6))
    steps = draw(st.lists(st.floats(0.05, 0.2), min_size=frames, max_size=frames))
    t = draw(st.floats(-100, 100)) + np.cumsum(steps)
    xy = np.array(draw(st.lists(numbers, min_size=frames * len(names) * 2, max_size=frames * len(names) * 2)))
    xy = xy.reshape(frames, len(names), 2)
    seen = np.array(draw(st.lists(st.booleans(), min_size=frames * len(names), max_size=frames * len(names))))
    seen = seen.reshape(frames, len(names))
    angle = None
    if draw(st.booleans()):
        angle = np.where(seen | (np.arange(frames) % 2 == 0)[:, None], xy[..., 0], np.nan)
    xy[~seen] = np.nan
    if angle is None:
        # a frame without any body, or a body without any frame, leaves no trace in a file
        xy[:, 0] = np.nan_to_num(xy[:, 0])
        xy[0] = np.nan_to_num(xy[0])
    return Recording(
        "r",
        scene,
        t,
        tuple(names),
        xy,
        angle,
        title=draw(st.text(max_size=20)),
        sampling=10.0,
        position_noise=draw(st.none() | st.floats(1e-9, 1e-2)),
        angle_noise=draw(st.none() | st.floats(1e-9, 1e-2)),
    )


class TestFolder:
    @settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(recordings(), st.sampled_from(["csv", "npz"]))
    def test_round_trip(self, tmp_path_factory, recording, tracks):
        folder = tmp_path_factory.mktemp("round") / "r"
        if recording.angle is not None and tracks == "csv":
            seen = recording.seen
            if not (seen.any(axis=0).all() and seen.any(axis=1).all()):
                tracks = "npz"
        if not recording.seen.any(axis=0).all():
            return
        write_recording(recording, folder, tracks=tracks)
        try:
            check_plausible(recording)
        except InputError as error:
            # places drawn at random may be too fast to be metres: the reader says the same of the file
            with pytest.raises(InputError, match=re.escape(error.message)):
                read_recording(folder)
            return
        same(read_recording(folder), recording)

    def test_many_bodies_go_to_bodies_csv_and_walls_keep_their_place(self, tmp_path):
        grains = tuple(
            ball(
                f"g{i}",
                role="grain",
                initial=(0.1 * i, 0.3, 0.0, -1.0),
                inertia=1e-7 if i == 3 else None,
                observed=i != 5,
            )
            for i in range(50)
        )
        wall = ball("w", role="wall", initial=(0.05, 0.0, 0.0, 0.0))
        scene = Scene((*grains, wall), laws=(use("contact_linear", stiffness=1e3),), periodic_x=10.0)
        ids = tuple(g.id for g in grains if g.observed)
        xy = np.array([[g.initial[:2] for g in grains if g.observed]] * 3)
        r = Recording("r", scene, [0.0, 0.1, 0.2], ids, xy, sampling=10.0)
        write_recording(r, tmp_path / "r")
        assert (tmp_path / "r" / "bodies.csv").exists()
        back = read_recording(tmp_path / "r")
        same(back, r)
        assert "g5" not in back.ids and "w" not in back.ids

    def test_curve_beside_and_instead_of_tracks(self, tmp_path):
        curve = np.zeros(2, dtype=CURVE)
        curve["frequency"], curve["speed"], curve["speed_sem"], curve["n"] = (
            [4, 9],
            [0.007, 0.008],
            1e-4,
            np.nan,
        )
        scene = Scene((ball(),))
        alone = Recording("r", scene, [], (), np.empty((0, 0, 2)), curve=curve)
        write_recording(alone, tmp_path / "r")
        assert (tmp_path / "r" / "curve.csv").read_text().splitlines()[
            0
        ] == "frequency,layers,speed,speed_sem"
        same(read_recording(tmp_path / "r"), alone)
        both = Recording("r", scene, [0.0], ("a",), np.zeros((1, 1, 2)), curve=curve)
        write_recording(both, tmp_path / "r")
        same(read_recording(tmp_path / "r"), both)

    def test_rows_in_any_order_with_times_that_differ_in_the_last_digit(self, tmp_path):
        (tmp_path / "recording.toml").write_text(MINIMAL)
        rows = ["0.2,b,5,6", "0.1,a,1,2", "0.30000000000000004,a,7,8", "0.1,b,3,4", "0.3,b,9,10", "0,a,0,0"]
        (tmp_path / "tracks.csv").write_text(
            "x,t,body,y\n" + "".join("{2},{0},{1},{3}\n".format(*row.split(",")) for row in rows)
        )
        r = read_recording(tmp_path)
        np.testing.assert_array_equal(r.t, [0, 0.1, 0.2, 0.3])
        np.testing.assert_array_equal(r.xy[:, 0], [[0, 0], [1, 2], [np.nan, np.nan], [7, 8]])
        np.testing.assert_array_equal(r.xy[:, 1], [[np.nan, np.nan], [3, 4], [5, 6], [9, 10]])

    def test_angle_only_rows(self, tmp_path):
        (tmp_path / "recording.toml").write_text(MINIMAL)
        (tmp_path / "tracks.csv").write_text("t,body,x,y,angle\n0,a,,,0.5\n0.1,a,1,2,\n0.2,a,3,4,0.6\n\n")
        r = read_recording(tmp_path)
        np.testing.assert_array_equal(r.angle[:, 0], [0.5, np.nan, 0.6])
        np.testing.assert_array_equal(r.xy[:, 0], [[np.nan, np.nan], [1, 2], [3, 4]])

    def test_columns_that_are_not_wanted_and_bodies_that_are_not_observed_warn(self, tmp_path):
        (tmp_path / "recording.toml").write_text(MINIMAL + "observed = false\n[scene]\nfriction = 3\n")
        (tmp_path / "tracks.csv").write_text("t,body,x,y,likelihood\n0,a,1,2,0.9\n0,b,1,2,0.9\n")
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            assert read_recording(tmp_path).ids == ("a",)
        said = " ".join(str(w.message) for w in caught)
        assert all(issubclass(w.category, SceneWarning) for w in caught)
        assert "likelihood" in said and "friction" in said and "body b is not observed" in said

    def test_writing_leaves_other_files_and_nothing_half_written(self, tmp_path, monkeypatch):
        folder = tmp_path / "r"
        r = Recording("r", Scene((ball(),)), [0.0], ("a",), np.zeros((1, 1, 2)))
        write_recording(r, folder, tracks="npz")
        (folder / "notes.txt").write_text("mine")
        write_recording(r, folder, tracks="csv")
        assert sorted(p.name for p in folder.iterdir()) == ["notes.txt", "recording.toml", "tracks.csv"]
        before = (folder / "recording.toml").read_text()

        def full(*args):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("granswim_pymunk.recording.folder._write_csv", full)
        with pytest.raises(InputError, match="No space left"):
            write_recording(r, folder)
        with pytest.raises(InputError, match="No space left"):
            write_recording(r, tmp_path / "new")
        assert (folder / "recording.toml").read_text() == before
        assert [p.name for p in tmp_path.iterdir()] == ["r"]

    def test_a_file_in_the_way(self, tmp_path):
        (tmp_path / "r").write_text("")
        with pytest.raises(InputError, match="not a folder"):
            write_recording(
                Recording("r", Scene((ball(),)), [0.0], ("a",), np.zeros((1, 1, 2))), tmp_path / "r"
            )


MINIMAL = """format = "granswim-recording/1"
sampling = 10.0
[[body]]
id = "a"
role = "free"
radius = 0.01
mass = 0.01
[[body]]
id = "b"
role = "free"
radius = 0.01
mass = 0.01
"""


class TestCamera:
    def test_see_turns_counter_clockwise_about_the_origin_then_shifts(self):
        seen = see(np.array([[1.0, 0.0], [0.0, 2.0]]), scale=2.0, tilt=math.pi / 2, bias=(0.1, 0.2))
        np.testing.assert_allclose(seen, [[0.1, 2.2], [-3.9, 0.2]], atol=1e-15)

    @given(st.floats(0.5, 2), st.floats(-3, 3), st.floats(-1, 1))
    def test_distances_scale_and_angles_turn(self, scale, tilt, shift):
        xy = np.array([[0.3, -0.2], [1.1, 0.4], [0.0, 0.0]])
        seen = see(xy, scale=scale, tilt=tilt, bias=(shift, -shift))
        old, new = xy - xy[2], seen - seen[2]
        np.testing.assert_allclose(np.hypot(*new.T), scale * np.hypot(*old.T), rtol=1e-12, atol=1e-12)
        turned = np.arctan2(new[:2, 1], new[:2, 0]) - np.arctan2(old[:2, 1], old[:2, 0]) - tilt
        np.testing.assert_allclose(np.exp(1j * turned), 1, atol=1e-12)

    def test_rod_angle_is_zero_hanging_and_counter_clockwise(self):
        places = np.array([[0, -1], [1, 0], [-1, 0], [math.sin(0.3), -math.cos(0.3)]])
        np.testing.assert_allclose(
            rod_angle(places, (0, 0), (0, -9.81)), [0, math.pi / 2, -math.pi / 2, 0.3], atol=1e-15
        )
        np.testing.assert_allclose(rod_angle(places, (0, 0), (0, 0)), rod_angle(places, (0, 0)), atol=0)
        # gravity to the right: hanging is +x, and y up is a quarter turn
        np.testing.assert_allclose(
            rod_angle(np.array([[3.0, 1.0], [2.0, 2.0]]), (2, 1), (5, 0)), [0, math.pi / 2]
        )

    @staticmethod
    def free(vx=1.0):
        return Scene((ball(initial=(0.1, 0.2, vx, 0.0)),), time=Time(dt=1e-4), periodic_x=1.0)

    def test_a_frame_shows_the_state_at_its_time_plus_the_offset(self):
        times = np.arange(5) / 10
        r = film(self.free(), times, time_offset=0.05, scale=2.0, bias=(0.0, 1.0))
        np.testing.assert_array_equal(r.t, times)
        np.testing.assert_allclose(r.xy[:, 0, 0], 2 * (0.1 + times + 0.05), atol=1e-9)
        np.testing.assert_allclose(r.xy[:, 0, 1], 1.4, atol=1e-12)
        assert r.sampling == pytest.approx(10.0) and r.angle is None

    def test_wrapping_and_unwrapping(self):
        times = np.arange(30) / 10
        unwrapped = film(self.free(), times)
        wrapped = film(self.free(), times, wrap=True)
        assert wrapped.xy[..., 0].max() < 1.0 < unwrapped.xy[..., 0].max()
        np.testing.assert_allclose(wrapped.unwrapped().xy, unwrapped.xy, atol=1e-12)

    def test_noise_and_drops_come_from_the_generator(self):
        times = np.arange(4000) / 1000
        r = film(self.free(0.0), times, noise=1e-3, drop=0.25, rng=np.random.default_rng(1))
        again = film(self.free(0.0), times, noise=1e-3, drop=0.25, rng=np.random.default_rng(1))
        np.testing.assert_array_equal(r.xy, again.xy)
        track = r.body("a")
        assert len(track.t) == pytest.approx(3000, abs=110)
        assert np.std(track.xy - [0.1, 0.2]) == pytest.approx(1e-3, rel=0.05)
        with pytest.raises(InputError, match="generator"):
            film(self.free(), times, noise=1e-3)

    def test_pendulum_filmed_by_an_encoder(self):
        length, start = 0.5, 0.1
        arm = ball(initial=(length * math.sin(start), -length * math.cos(start), 0.0, 0.0))
        scene = Scene(
            (arm,),
            (use("gravity"), use("pin", bodies=["a"], anchor=(0.0, 0.0), length=length)),
            gravity=(0.0, -9.81),
            time=Time(dt=1e-4),
        )
        times = np.arange(0, 1, 0.05)
        r = film(scene, times, positions=False, tilt=0.02)
        omega = math.sqrt(9.81 / length) * (1 - start**2 / 16)
        np.testing.assert_allclose(r.angle[:, 0], start * np.cos(omega * times) + 0.02, atol=2e-4)
        assert not np.isfinite(r.xy).any()

    def test_unobserved_bodies_and_walls_are_not_filmed(self):
        bodies = (
            ball("hidden", observed=False, initial=(0.5, 0.5, 0.0, 0.0)),
            ball("seen", initial=(0.1, 0.1, 0.0, 0.0)),
            ball("w", role="wall", initial=(0.9, 0.9, 0.0, 0.0)),
        )
        assert film(Scene(bodies, time=Time(dt=1e-3)), [0.0, 0.1]).ids == ("seen",)

    def test_filmed_written_and_read(self, tmp_path):
        r = film(self.free(), np.arange(20) / 10, noise=1e-4, drop=0.2, rng=np.random.default_rng(3))
        write_recording(r, tmp_path / "r")
        # a frame in which nothing is seen leaves no row
        same(read_recording(tmp_path / "r"), r.select(r.seen.any(axis=1)))
