"""What version 2 of a recording's form adds: read, carried, and written back digit for digit."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.tracks.segments import find_impacts
from granswim_pymunk.recording import Recording, film, read_recording, write_recording
from granswim_pymunk.recording.recording import NUMBERS
from granswim_pymunk.scene import Body, Scene, SceneWarning, Time, Wall, use

NEW = {
    "tolerance": 1e-3, "angle_tolerance": 0.01, "angle_noise": 2e-3, "time_noise": 1e-4, "radius_error": 0.02,
    "mass_error": 0.01,
}  # fmt: skip
HEAD = 'format = "granswim-recording/2"\ntitle = "cart"\nsampling = 10.0\n'
CART = '[[body]]\nid = "a"\nrole = "free"\nradius = 0.02\nmass = 0.3\ninertia = 1e-4\n'
RAIL = '[[law]]\nname = "rail"\nbody = "a"\ndirection = [{}, {}]\n'
PIN = '[[law]]\nname = "pin"\nbody = "a"\nanchor = [0.0, 0.0]\nlength = 0.5\n'


def folder_of(path, toml, tracks, **more):
    folder = path / "cart"
    folder.mkdir()
    for name, text in {"recording.toml": toml, "tracks.csv": tracks, **more}.items():
        if text is not None:
            (folder / name).write_text(text)
    return folder


def numbers_of(recording):
    return {key: getattr(recording, key) for key in NUMBERS}


MOVING = "t,body,x,y\n" + "".join(f"{k / 10},a,{0.1 * k},0.2\n" for k in range(6))


class TestNumbers:
    def test_all_of_them_are_read_and_position_noise_may_be_missing(self, tmp_path):
        keys = "".join(f"{key} = {value}\n" for key, value in NEW.items())
        r = read_recording(folder_of(tmp_path, HEAD + keys + CART, MOVING))
        assert numbers_of(r) == {**NEW, "sampling": 10.0, "position_noise": None}
        assert r.scene.bodies[0].inertia == 1e-4 and r.notes == ()

    def test_nothing_is_made_up(self, tmp_path):
        r = read_recording(folder_of(tmp_path, HEAD.replace("sampling = 10.0\n", "") + CART, MOVING))
        assert set(numbers_of(r).values()) == {None}

    def test_version_1_stays_valid(self, tmp_path):
        r = read_recording(folder_of(tmp_path, HEAD.replace("/2", "/1") + CART, MOVING))
        assert len(r.t) == 6

    @pytest.mark.parametrize("tracks", ["csv", "npz"])
    def test_they_are_written_back_and_the_form_says_its_version(self, tmp_path, tracks):
        r = read_recording(folder_of(tmp_path, HEAD + CART, MOVING))
        plain = write_recording(r, tmp_path / "plain", tracks=tracks)
        assert 'format = "granswim-recording/1"' in (plain / "recording.toml").read_text()
        for key, value in NEW.items():
            one = Recording("r", r.scene, r.t, r.ids, r.xy, **{key: value})
            back = write_recording(one, tmp_path / key, tracks=tracks)
            version = 1 if key == "angle_noise" else 2
            assert f'format = "granswim-recording/{version}"' in (back / "recording.toml").read_text()
            assert numbers_of(read_recording(back)) == numbers_of(one)

    @pytest.mark.parametrize("key", NUMBERS)
    @pytest.mark.parametrize("value", ["-1.0", "nan", "inf", "true", '"much"', "[1.0]"])
    def test_bad_ones_are_refused_by_name(self, tmp_path, key, value):
        head = "\n".join(line for line in HEAD.splitlines() if not line.startswith(key))
        folder = folder_of(tmp_path, f"{head}\n{key} = {value}\n{CART}", MOVING)
        with pytest.raises(InputError, match=f"toml: {key}: (should be a number, not below zero|is absurdly large)"):
            read_recording(folder)
        with pytest.raises(InputError, match=f"{key} should be a number"):
            Recording("r", Scene((Body("a", "free", 1.0, 1.0),)), [0.0], ("a",), np.zeros((1, 1, 2)), **{key: -1.0})

    def test_relative_errors_are_shares(self, tmp_path):
        with pytest.raises(InputError, match=r"radius_error: should be a share below 1 \(0.02 for 2 %\), got 2"):
            read_recording(folder_of(tmp_path, HEAD + "radius_error = 2\n" + CART, MOVING))

    def test_conversions_keep_them(self, tmp_path):
        table, template = tmp_path / "table.csv", tmp_path / "template.toml"
        table.write_text(MOVING)
        template.write_text("".join(f"{key} = {value}\n" for key, value in NEW.items()) + CART)
        main(["import", str(table), "--format", "long", "--scene", str(template), "--out", str(tmp_path / "out")])
        assert numbers_of(read_recording(tmp_path / "out")) == {**NEW, "sampling": 10.0, "position_noise": None}
        r = read_recording(tmp_path / "out")
        assert numbers_of(r.select(slice(0, 2))) == numbers_of(r) == numbers_of(r.unwrapped())


class TestTables:
    def test_a_film_beside_the_tables_is_not_looked_at(self, tmp_path):
        folder = folder_of(tmp_path, HEAD + CART, MOVING, **{"film.mp4": "no film at all"})
        r = read_recording(folder)
        write_recording(r, folder, tracks="npz")
        assert (folder / "film.mp4").exists() and not (folder / "tracks.csv").exists()
        np.testing.assert_array_equal(read_recording(folder).xy, r.xy)

    def test_bodies_in_a_table_with_their_inertia(self, tmp_path):
        header = "id,role,radius,mass,observed,x,y,vx,vy,inertia"
        table = f"{header}\na,free,0.02,0.3,true,0,0.2,1,0,1e-4\nb,wall,1,,,9,9,,,\n"
        folder = folder_of(tmp_path, HEAD + 'bodies = "bodies.csv"\n', MOVING, **{"bodies.csv": table})
        a, b = read_recording(folder).scene.bodies
        assert a == Body("a", "free", 0.02, 0.3, True, (0.0, 0.2, 1.0, 0.0), 1e-4)
        assert b.role == "wall" and b.initial == (9.0, 9.0, 0.0, 0.0)

    @pytest.mark.parametrize("kind", ["csv", "npz"])
    def test_angles_alone(self, tmp_path, kind):
        rows = "t,body,x,y,angle\n" + "".join(f"{k / 10},a,,,{0.1 * k}\n" for k in range(6))
        folder = folder_of(tmp_path, HEAD + "angle_noise = 1e-3\n" + CART + PIN, rows)
        r = read_recording(write_recording(read_recording(folder), tmp_path / "again", tracks=kind))
        assert np.isnan(r.xy).all() and r.angle_noise == 1e-3
        np.testing.assert_array_equal(r.angle[:, 0], 0.1 * np.arange(6))
        assert prepare(r, held_out=False, split=True).unit == "rad rms"

    def test_unknown_keys_are_said_and_kept_as_notes(self, tmp_path):
        toml = HEAD + 'colour = "red"\n[scene]\nfriction = 3\n' + CART + "height = 3\n"
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            r = read_recording(folder_of(tmp_path, toml, MOVING))
        assert [w.category for w in caught] == [SceneWarning] * 3 and len(r.notes) == 3
        for word, note in zip(("colour", "friction", "height"), r.notes, strict=True):
            assert f"unknown key '{word}'" in note and "\n" not in note


class TestRail:
    """On a rail along x or y the other coordinate need not be there."""

    @pytest.mark.parametrize("axis", [0, 1])
    @pytest.mark.parametrize("kind", ["csv", "npz"])
    def test_round_trip(self, tmp_path, axis, kind):
        rows = "t,body,x,y\n" + "".join(f"{k / 10},a,{f'{k / 50},' if axis == 0 else f',{k / 50}'}\n" for k in range(6))
        folder = folder_of(tmp_path, HEAD + CART + RAIL.format(1 - axis, -2 * axis), rows)
        first = read_recording(folder)
        again = write_recording(first, tmp_path / "again", tracks=kind)
        assert "recording/2" in (again / "recording.toml").read_text()
        for r in (first, read_recording(again)):
            np.testing.assert_array_equal(r.xy[:, 0, axis], np.arange(6) / 50)
            assert np.isnan(r.xy[:, 0, 1 - axis]).all() and r.seen.all() and len(r.body("a").t) == 6
            assert [c.kind for c in prepare(r, held_out=False, split=True).channels] == ["xy"[axis]]

    @pytest.mark.parametrize(
        ("law", "row"),
        [
            (RAIL.format(1, 0), "0.6,a,,0.1"),
            (RAIL.format(0, 1), "0.6,a,0.1,"),
            (RAIL.format(1, 1), "0.6,a,0.1,"),
            ("", "0.6,a,,0.1"),
        ],
    )
    def test_the_coordinate_along_it_must_be_there(self, tmp_path, law, row):
        with pytest.raises(InputError, match="row 8: has one coordinate only"):
            read_recording(folder_of(tmp_path, HEAD + CART + law, MOVING + row + "\n"))

    def test_where_the_rail_runs(self):
        scene = Scene((Body("a", "free", 1.0, 1.0), Body("b", "free", 1.0, 1.0, initial=(0.0, 7.0, 0.0, 0.0))),
                      laws=(use("rail", direction=(1.0, 0.0)),))  # fmt: skip
        xy = np.array([[[0, math.nan], [0, math.nan]], [[1, 3.0], [math.nan, math.nan]], [[2, 5.0], [2, math.nan]]])
        filled = Recording("r", scene, [0.0, 1.0, 2.0], ("a", "b"), xy).on_rails().xy
        np.testing.assert_array_equal(filled[..., 1], [[4, 7], [3, math.nan], [5, 7]])
        np.testing.assert_array_equal(filled[..., 0], xy[..., 0])

    def test_a_table_of_one_coordinate_is_imported(self, tmp_path):
        (tmp_path / "table.csv").write_text(MOVING.replace(",0.2\n", ",\n"))
        (tmp_path / "scene.toml").write_text(CART + RAIL.format(1, 0))
        arguments = ["--format", "long", "--scene", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "out")]
        assert main(["import", str(tmp_path / "table.csv"), *arguments]) == 0
        assert np.isfinite(read_recording(tmp_path / "out").xy[..., 0]).all()

    def test_a_cart_on_a_spring_seen_along_its_rail_alone(self, tmp_path):
        """Nothing is missing from it, and nothing is found."""
        body = Body("a", "free", 0.02, 0.3, initial=(0.05, 0.0, 0.0, 0.0))
        laws = (use("rail", bodies=["a"], direction=(1.0, 0.0)),
                use("spring", bodies=["a"], anchor=(-0.3, 0.0), length=0.3, stiffness=20.0))  # fmt: skip
        scene = Scene((body,), laws=laws, time=Time(dt=1e-3))
        r = film(scene, np.arange(60) / 30, noise=1e-4, rng=np.random.default_rng(5))
        xy = r.xy.copy()
        xy[..., 1] = math.nan
        seen = Recording("cart", scene, r.t, r.ids, xy, sampling=30.0, position_noise=1e-4)
        write_recording(seen, tmp_path / "cart")
        from granswim_pymunk.inference.entry import diagnose

        found = diagnose([tmp_path / "cart"], tmp_path / "out", minutes=0.3).verdict
        assert found["verdict"] == "no_mismatch"
        assert found["fit"]["train"]["recalibrated"] == pytest.approx(1e-4, rel=0.3)

    @pytest.mark.parametrize("along", [0, 1])
    def test_impacts_on_an_air_track_seen_along_it_alone(self, along):
        """Two gliders that meet each other and the stops at both ends."""
        def at(s):
            return (s, 0.0) if along == 0 else (0.0, s)

        walls = tuple(
            Wall(*(((end, -1.0), (end, 1.0)) if along == 0 else ((-1.0, end), (1.0, end)))) for end in (-0.5, 0.5)
        )
        bodies = (Body("a", "free", 0.05, 0.2, initial=(*at(-0.3), *at(0.5))),
                  Body("b", "free", 0.05, 0.3, initial=(*at(0.2), *at(-0.2))))  # fmt: skip
        scene = Scene(bodies, (use("rail", direction=at(1.0)), use("contact_elastic", restitution=0.8)), walls=walls)
        r = film(scene, np.arange(300) / 100, noise=1e-4, rng=np.random.default_rng(5))
        xy = r.xy.copy()
        xy[..., 1 - along] = math.nan
        unknown = replace(scene, bodies=tuple(replace(b, initial=None) for b in bodies))
        case = prepare(replace(r, xy=xy, scene=unknown), held_out=False, split=False)
        speed = np.gradient(r.xy[..., along], r.t, axis=0)
        turns = [float(r.t[k]) for k in range(5, 295) if (np.abs(speed[k + 3] - speed[k - 3]) > 0.1).any()]
        found = find_impacts(case)
        met = {impact.bodies for impact in found}
        assert len(found) >= 3 and ("a", "b") in met and {("a",), ("b",)} & met
        for impact in found:
            assert min(abs(case.t[impact.row] - t) for t in turns) < 0.03
