"""Importing: plain tables and the raw recordings that come with the package."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from granswim_pymunk.cli import main
from granswim_pymunk.engine import Simulation
from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.data import estimate_noise, prepare
from granswim_pymunk.inference.start import describe_starts, first_numbers, states, turning_angle
from granswim_pymunk.recording import read_recording, resolve_recording, shipped, shipped_names
from granswim_pymunk.recording.importers import import_all, import_recording, import_to
from granswim_pymunk.scene import Time

NAMED = {
    "double_pendulum": "double_pendulum", "falling_balls": "falling_balls", "pendulum": "single_pendulum",
    "string_pendulum": "auto", "two_disk_spin": "two_disk_spin",
}  # fmt: skip
SAID = {
    "string_pendulum": {
        "columns": "t=1,angle=2", "bodies": ["bob:2.5cm:41.5g"], "scene": "pendulum", "laws": ["pin:bob,length=0.65"],
        "title": "bob on a string, phone camera",
    }
}  # fmt: skip


class TestShipped:
    def test_names(self):
        assert shipped_names() == tuple(sorted(NAMED))

    @pytest.mark.parametrize("name", sorted(NAMED))
    def test_importing_the_raw_file_again_gives_the_shipped_folder(self, name, tmp_path):
        source = shipped(name) / "source"
        if name in SAID:
            import_all(source / f"{name}.txt", tmp_path / name, **SAID[name])
        else:
            import_to(source, tmp_path / name, NAMED[name])
        folders = resolve_recording(name)
        for folder in folders:
            again = tmp_path / folder.relative_to(shipped(name).parent)
            for file in ("recording.toml", "tracks.csv"):
                assert (again / file).read_bytes() == (folder / file).read_bytes(), f"{folder.name}/{file}"
        assert len(list(tmp_path.rglob("recording.toml"))) == len(folders)

    @pytest.mark.parametrize("name", sorted(NAMED))
    def test_licence_and_source_are_there(self, name):
        assert "MIT License" in (shipped(name) / "LICENSE").read_text()
        assert "commit" in (shipped(name) / "README.md").read_text().lower()

    def test_every_one_reads_without_a_warning(self):
        count = sum(len(resolve_recording(name)) for name in shipped_names())
        assert count == 24
        for name in shipped_names():
            for folder in resolve_recording(name):
                assert len(read_recording(folder).t) > 40

    def test_pendulum(self):
        r = read_recording(shipped("pendulum"))
        assert r.t.shape == (11001,) and r.sampling == 200.0 and not np.isfinite(r.xy).any()
        # it hangs at last: 0, not pi
        assert abs(r.angle[r.t > 50].mean()) < 0.02
        assert r.angle[0, 0] == pytest.approx(1.523164 - math.pi)
        # small swings at sqrt(a m g/(m a^2 + I)), upstream's 64.2 1/s^2
        late = r.angle[r.t > 45, 0]
        crossings = np.flatnonzero(np.diff(np.signbit(late)))
        period = 2 * (crossings[-1] - crossings[0]) * 0.005 / (len(crossings) - 1)
        body, pin = r.scene.body("arm"), r.scene.laws_named("pin")[0].values
        arm = body.mass * pin["length"]
        assert 2 * math.pi / period == pytest.approx(
            math.sqrt(arm * 9.81 / (arm * pin["length"] + body.moment)), rel=0.02
        )

    def test_double_pendulum(self):
        r = read_recording(shipped("double_pendulum"))
        assert r.t.shape == (1201,) and r.sampling == 200.0 and not np.isfinite(r.xy).any()
        toml = (shipped("double_pendulum") / "recording.toml").read_text()
        assert toml.startswith('format = "granswim-recording/2"')
        np.testing.assert_allclose(r.angle[0], (2.615775 - math.pi, 3.541416 - math.pi), rtol=1e-12)
        assert {law.name for law in r.scene.laws} == {"gravity", "hinge"}  # no friction is assumed
        estimates = [estimate_noise(r.t, r.angle[:, k]) for k in range(2)]
        assert math.sqrt(np.mean(np.square(estimates))) == pytest.approx(r.angle_noise, rel=0.01)
        # angles are a little noisier where they change fast, as if the stamps were off by microseconds
        notes = prepare(r, held_out=False, split=True).notes
        assert all(re.search(r"time stamps are off by [1-5](\.\d)?e-06 s", note) for note in notes)

    def test_double_pendulum_follows_the_naive_scene_at_first(self):
        """Half a second from the start that the first frames give: masses, lengths and signs are upstream's."""
        r = read_recording(shipped("double_pendulum"))
        case = prepare(r, held_out=False, split=False)
        scene = replace(r.scene, time=Time(dt=2.5e-4))
        starts = describe_starts(case, np.ones(len(case.t), dtype=bool), scene)
        first = case.t <= 0.5

        def angles(numbers):
            begun = scene.with_initial(states(starts, numbers, scene, 0.0))
            path = Simulation(begun).sample(case.t[first])
            return np.column_stack([turning_angle(path, [0, 1], scene, name) for name in r.ids])

        def off(numbers):
            return (angles(numbers) - case.values[first]) / np.ptp(case.values[first], axis=0)

        rms = np.sqrt(np.mean(off(first_numbers(starts)) ** 2, axis=0))
        assert (rms < 0.02).all(), rms
        start = first_numbers(starts)
        fitted = least_squares(lambda n: off(n).ravel(), start, x_scale=(0.1, 1.0, 0.1, 1.0), diff_step=1e-5)
        rms = np.sqrt(np.mean(off(fitted.x) ** 2, axis=0))
        assert (rms < 0.003).all(), rms

    def test_balls(self):
        r = read_recording(shipped("falling_balls/Baseball_2"))
        baseball = r.scene.body("Baseball")
        assert baseball.mass == pytest.approx(0.1417, abs=1e-4)  # 5 oz
        assert 2 * math.pi * baseball.radius == pytest.approx(0.2225)
        assert (r.xy[:, 0, 0] == 0).all() and r.xy[0, 0, 1] == 47.2169867
        # it falls with nearly g, the rest being drag
        acceleration = 2 * np.polyfit(r.t[5:25], r.xy[5:25, 0, 1], 2)[0]
        assert -9.81 < acceleration < -8
        assert not any("Volleyball" in folder.name for folder in resolve_recording("falling_balls"))

    def test_either_bowling_ball(self):
        masses = {}
        for ounces in (81, 208):
            drops = import_recording(shipped("falling_balls") / "source", "falling_balls", bowling_ball=ounces)
            masses[ounces] = next(r for r in drops if r.name == "Bowling_Ball_1").scene.bodies[0].mass
        assert masses[81] == pytest.approx(2.296, abs=1e-3) and masses[208] == pytest.approx(5.897, abs=1e-3)
        shipped_one = read_recording(shipped("falling_balls/Bowling_Ball_1")).scene.bodies[0].mass
        assert shipped_one == masses[208]
        with pytest.raises(InputError, match="81, 208"):
            import_recording(shipped("falling_balls") / "source", "falling_balls", bowling_ball=100)

    def test_two_disks(self):
        r = read_recording(shipped("two_disk_spin"))
        t, xy, angle = r.body("0")
        assert len(t) == 44 and t[0] == pytest.approx(133 / 54.89)
        assert xy[0] == pytest.approx([0.8661934680246745, 0.0070573224238])
        assert angle[-1] - angle[0] == pytest.approx(1.87, abs=0.01)
        both = np.isfinite(r.xy[..., 0]).all(axis=1)
        gap = np.hypot(*(r.xy[both, 1] - r.xy[both, 0]).T).min()
        assert gap == pytest.approx(0.0892, abs=1e-3)
        slow = import_recording(shipped("two_disk_spin") / "source", "two_disk_spin", fps=30)[0]
        np.testing.assert_allclose(slow.t, r.t * 54.89 / 30)

    def test_resolve(self, tmp_path):
        assert resolve_recording("pendulum") == [shipped("pendulum")]
        assert resolve_recording(shipped("pendulum")) == [shipped("pendulum")]
        assert len(resolve_recording(str(shipped("falling_balls")))) == 20
        assert resolve_recording("falling_balls/Golf_Ball_1")[0].name == "Golf_Ball_1"
        for text in ("nothing", "../recordings", "crosscheck", "pendulum/../../laws"):
            with pytest.raises(InputError, match="no such folder"):
                resolve_recording(text)


class TestLong:
    def write(self, folder, text):
        path = folder / "table.csv"
        path.write_text(text)
        return path

    def test_columns_units_frames_flip_and_sentinel(self, tmp_path):
        source = self.write(
            tmp_path, "particle;frame;cx;cy;deg\na;0;10;20;90\nb;0;-1;-1;\na;50;30;-1;45\na;100;50;60;0\n"
        )
        (r,) = import_recording(
            source,
            "long",
            bodies=["a:0.001:2e-6:head", "b:0.002:1e-5"],
            unit="mm",
            fps=50.0,
            flip_y=100.0,
            missing=["-1"],
            columns="t=frame,body=particle,x=cx,y=cy,angle=deg",
            angle_unit="deg",
            delimiter=";",
        )
        assert r.ids == ("a",) and [b.role for b in r.scene.bodies] == ["head", "free"]
        np.testing.assert_allclose(r.t, [0, 1, 2])
        np.testing.assert_allclose(r.xy[:, 0], [[0.01, 0.08], [np.nan, np.nan], [0.05, 0.04]])
        np.testing.assert_allclose(r.angle[:, 0], [-math.pi / 2, -math.pi / 4, 0])

    def test_template_scene(self, tmp_path):
        template = tmp_path / "scene.toml"
        template.write_text(
            'title = "drop"\nposition_noise = 1e-3\n[scene]\ngravity = [0.0, -9.81]\n'
            '[[body]]\nid = "ball"\nrole = "free"\nradius = 0.1\nmass = 0.2\n'
            '[[law]]\nname = "linear_drag"\nc = 0.1\n'
        )
        source = self.write(tmp_path, "t,height\n0,100\n0.1,95.1\n0.2,80.4\n")
        out = tmp_path / "out"
        code = main(
            [
                "import",
                str(source),
                "--format",
                "long",
                "--scene",
                str(template),
                "--columns",
                "y=height",
                "--unit",
                "cm",
                "--out",
                str(out),
            ]
        )
        assert code == 0
        r = read_recording(out)
        assert r.title == "drop" and r.position_noise == 1e-3 and r.scene.gravity == (0.0, -9.81)
        assert r.scene.laws_named("linear_drag")[0].values["c"] == 0.1 and r.sampling == 10.0
        np.testing.assert_allclose(r.xy[:, 0], [[0, 1.0], [0, 0.951], [0, 0.804]])

    @pytest.mark.parametrize(
        ("text", "options", "message"),
        [
            ("t,body,x,y\n0,a,1,2\n0,a,1,2\n", {}, "row 3: two rows for body a"),
            ("t,body,x,y\n0,a,1,two\n", {}, "row 2: y should be a number"),
            ("t,body,x,y\n0,a,1,inf\n", {}, "row 2: y should be a number"),
            ("t,body,x,y\n0,a,1,2\n0,c,1,2\n", {}, "row 3: body 'c' is not in the scene"),
            ("t,body,x,y\n0,a,1\n", {}, "row 2: expected 4 columns, got 3"),
            ("t,body,x,y\n,a,1,2\n", {}, "row 2: t is missing"),
            ("t,body,x,y\n0,a,,\n", {}, "is empty"),
            ("t,body,x,y\n", {}, "no rows"),
            ("", {}, "is empty"),
            ("t,body,p,q\n0,a,1,2\n", {}, "no column x, y or angle"),
            ("frame,body,x,y\n0,a,1,2\n", {}, "frame rate"),
            ("body,x,y\na,1,2\n", {}, "no column t or frame"),
            ("t,body,x,y\n0,a,1,2\n", {"bodies": []}, "which bodies are these"),
            ("t,body,x,y\n0,a,1,2\n", {"bodies": ["a:1"]}, "id:radius:mass"),
            ("t,body,x,y\n0,a,1,2\n", {"bodies": ["a:-1:1"]}, "above zero"),
            ("t,body,x,y\n0,a,1,2\n", {"unit": "parsec"}, "should be one of"),
            ("t,body,x,y\n0,a,1,2\n", {"columns": "x"}, "NAME=COLUMN"),
            ("t,body,x,y\n0,a,1,2\n", {"columns": "z=x"}, "unknown name 'z'"),
            ("t,body,x,y\n0,a,1,2\n", {"columns": "x=z"}, "no column 'z'"),
            ("t,body,x,y\n0,a,1,2\n", {"fps": -5.0}, "above zero"),
            ("t,body,x,y\n0,a,1,2\n", {"bowling_ball": 81}, "no option bowling_ball"),
        ],
    )
    def test_what_is_wrong_is_said(self, tmp_path, text, options, message):
        with pytest.raises(InputError, match=message):
            import_recording(self.write(tmp_path, text), "long", **{"bodies": ["a:0.1:1"], **options})


class TestWide:
    def test_two_dimensions_with_ids_from_the_header(self, tmp_path):
        source = tmp_path / "wide.csv"
        source.write_text("t,x1,y1,x_b,y_b\n0,1,2,3,4\n20,5,6,,\n40,7,8,nan,9\n")
        (r,) = import_recording(source, "wide", bodies=["1:0.1:1", "b:0.1:1"], time_unit="ms")
        np.testing.assert_allclose(r.t, [0, 0.02, 0.04])
        np.testing.assert_array_equal(r.xy[:, 0], [[1, 2], [5, 6], [7, 8]])
        np.testing.assert_array_equal(r.xy[:, 1], [[3, 4], [np.nan, np.nan], [np.nan, np.nan]])
        assert r.sampling == 50.0

    def test_one_dimension_without_times(self, tmp_path):
        source = tmp_path / "wide.csv"
        source.write_text("left,right\n1,3\n2,\n3,5\n")
        code = main(
            [
                "import",
                str(source),
                "--format",
                "wide",
                "--columns",
                "1.x=left,2.x=right",
                "--fps",
                "100",
                "--unit",
                "1e-2",
                "--flip-y",
                "--body",
                "1:0.001:0.1",
                "--body",
                "2:0.001:0.1",
                "--position-noise",
                "1e-4",
                "--out",
                str(tmp_path / "out"),
            ]
        )
        assert code == 0
        r = read_recording(tmp_path / "out")
        np.testing.assert_allclose(r.t, [0, 0.01, 0.02])
        np.testing.assert_allclose(r.xy[:, 0], [[0.01, 0], [0.02, 0], [0.03, 0]])
        np.testing.assert_array_equal(r.xy[:, 1], [[0.03, 0], [np.nan, np.nan], [0.05, 0]])
        assert r.position_noise == 1e-4

    def test_nothing_is_written_where_it_cannot_be_read(self, tmp_path, capsys):
        source = tmp_path / "wide.csv"
        source.write_bytes(b"t,x1\n0,\xff\xfe\n")
        assert main(["import", str(source), "--format", "wide", "--body", "1:1:1", "--out", str(tmp_path / "out")]) == 2
        assert capsys.readouterr().err.count("\n") == 1
        assert [p.name for p in tmp_path.iterdir()] == ["wide.csv"]


def test_an_impact_is_no_wrong_point_of_the_tracker(tmp_path):
    t = np.arange(80) / 100
    noise = 2e-4 * np.random.default_rng(3).normal(size=(80, 2))
    # a puck that is slowed down between two frames, and one of which a frame is wrong
    x = np.where(t < 0.405, 0.6 * t, 0.6 * 0.405 + 0.1 * (t - 0.405)) + noise[:, 0]
    wrong = 0.3 * t + noise[:, 1]
    wrong[50] += 0.03
    for name, track, found in (("impact", x, 0), ("wrong", wrong, 1)):
        (tmp_path / f"{name}.csv").write_text("t,x\n" + "\n".join(f"{a},{b}" for a, b in zip(t, track, strict=True)))
        (done,) = import_all(tmp_path / f"{name}.csv", tmp_path / name, bodies=["*:1cm:179.3g"], picture=False)
        assert done.look.jumps == found
        assert "mass = 0.1793 " in (tmp_path / name / "recording.toml").read_text()


def test_where_each_picture_stands_twice_an_import_tells_of_the_others(tmp_path, capsys):
    """What stands still in every second row and jumps in the next was told as noise of 2 cm, and no speed."""
    rng, t = np.random.default_rng(4), np.arange(60) / 60
    xy = np.round(np.stack([2.0 * t, 0.4 - 1.3 * t], axis=1) + 2e-4 * rng.normal(size=(60, 2)), 6)
    rows = zip(np.repeat(t, 2) + np.tile([0.0, 0.0087], 60), np.repeat(xy, 2, axis=0), strict=True)
    (tmp_path / "puck.csv").write_text("t,x,y\n" + "".join(f"{at:.5f},{x},{y}\n" for at, (x, y) in rows))
    assert main(["import", str(tmp_path / "puck.csv"), "--body", "puck:31mm:24g", "--out", str(tmp_path / "puck")]) == 0
    said = capsys.readouterr().out
    assert "60 frames show the picture before again: what is said here is of the others" in said
    (noise,) = re.findall(r"noise, off fast differences: (\d+) um", said)
    assert 100 < int(noise) < 400 and "speeds: median 2.39 m/s" in said
