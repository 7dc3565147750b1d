"""Tables of a student laboratory: angles of pendulums, headings of PASCO, one coordinate, a rail that is none."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.hypothesis import adjustable_terms
from granswim_pymunk.recording import read_recording
from granswim_pymunk.recording.importers import import_all, import_recording
from granswim_pymunk.recording.importers.base import Options
from granswim_pymunk.recording.importers.templates import parse_law

T = np.arange(60) / 25
LEFT, RIGHT = 0.3 * np.cos(4 * T), 0.2 * np.sin(4 * T)  # rad
PINS = ["pin:p1,anchor=0 0,length=0.6", "pin:p2,anchor=0.5 0,length=0.6"]
CAPSTONE = "Angle, Ch 1+2 (rad) Run #{}"


def write(folder, header, *columns, sign=","):
    rows = [sign.join(map(repr, row)) for row in zip(*(c.tolist() for c in columns), strict=True)]
    (folder / "table.csv").write_text("\n".join([header, *rows] if header else rows) + "\n", encoding="utf-8")
    return folder / "table.csv"


class TestAnglesOfSeveralBodies:
    @pytest.mark.parametrize(
        "header",
        [
            "t,p1_angle [deg],p2_angle [deg]",
            "t [s],theta_p1 (deg),theta_p2 (deg)",
            "Zeit in s,Winkel p1 (°),Winkel p2 (°)",
            "time (s),phi p1 in Grad,phi p2 in Grad",
            "t,p1 [deg],p2 [deg]",
            "t,p1,p2\ns,deg,deg",
        ],
    )
    def test_a_row_per_frame(self, tmp_path, header):
        source = write(tmp_path, header, T, np.degrees(LEFT), np.degrees(RIGHT))
        (r,) = import_recording(source, bodies=["p1:3cm:1kg", "p2:3cm:1kg"], scene="pendulum", laws=PINS)
        assert r.ids == ("p1", "p2") and np.isnan(r.xy).all()
        np.testing.assert_allclose(r.angle, np.stack([LEFT, RIGHT], axis=1), atol=1e-12)
        np.testing.assert_allclose(r.t, T)

    def test_columns_that_are_said(self, tmp_path):
        source = write(tmp_path, "", T, np.degrees(LEFT), np.degrees(RIGHT))
        said = {"columns": "t=1,p1.angle=2,p2.angle=3", "angle_unit": "deg"}
        import_all(source, tmp_path / "out", bodies=["*:3cm:1kg"], scene="pendulum", laws=PINS, picture=True, **said)
        read = read_recording(tmp_path / "out")
        np.testing.assert_allclose(read.angle, np.stack([LEFT, RIGHT], axis=1), atol=1e-12)

    @pytest.mark.parametrize("scene", ["cart", "pendulum"])
    def test_a_body_that_the_file_has_not_is_said(self, tmp_path, scene):
        """A cart that no marker is called after was asked for its rail."""
        source = write(tmp_path, "t,left_x,left_y,right_x,right_y", T, LEFT, RIGHT, RIGHT + 1, LEFT)
        with pytest.raises(InputError, match="A is not in the file, whose bodies are: left, right"):
            import_recording(source, bodies=["A:3cm:1kg"], scene=scene)

    def test_few_rows_are_no_angle_alone(self, tmp_path):
        source = write(tmp_path, "t,x,y", T[:6], np.sin(LEFT[:6]), -np.cos(LEFT[:6]))
        with pytest.raises(InputError, match="bob is seen in 6 frames, too few to tell its rod from: say how long"):
            import_recording(source, bodies=["bob:3cm:1kg"], scene="pendulum")

    def test_a_period_is_told_from_where_wide_swings_have_slowed_down(self, tmp_path):
        """An arm that falls from upright: its first swings take half as long again as its last ones."""
        t = np.arange(0, 9, 0.02)
        begin, scale = [3.0, 0.0], 9.81 / 0.25
        run = solve_ivp(lambda s, y: [y[1], -scale * np.sin(y[0]) - 0.7 * y[1]], (0, 9), begin, t_eval=t, rtol=1e-8)
        source = write(tmp_path, "t,angle", t, np.round(run.y[0], 3))
        (r,) = import_recording(source, bodies=["arm:3cm:1kg"], scene="pendulum")
        (pin,) = r.scene.laws_named("pin")
        assert abs(pin.values["length"] - 0.25) < 0.03

    def test_numbers_in_a_heading_are_bodies_in_rad(self, tmp_path):
        source = write(tmp_path, "t,theta1,theta2", T, LEFT, RIGHT)
        (r,) = import_recording(source, bodies=["*:3cm:1kg"])
        assert r.ids == ("1", "2")
        np.testing.assert_array_equal(r.angle[:, 1], RIGHT)

    def test_the_length_of_a_rod_is_asked_for(self, tmp_path):
        source = write(tmp_path, "t,p1_angle,p2_angle", T, LEFT, RIGHT)
        with pytest.raises(InputError, match=r"only the angle of p1 is measured.*length"):
            import_recording(source, bodies=["*:3cm:1kg"], scene="pendulum")

    @pytest.mark.parametrize("heading", ["Angle of arm (deg)", "arm [deg]", "left_angle [deg]"])
    def test_one_body_has_the_name_that_it_was_given(self, tmp_path, heading):
        source = write(tmp_path, f"t,{heading}", T, np.degrees(LEFT))
        (done,) = import_all(source, tmp_path / "out", bodies=["rod:3cm:1kg"], picture=False)
        np.testing.assert_allclose(done.recording.angle[:, 0], LEFT, atol=1e-12)
        assert done.recording.ids == ("rod",) and any("is taken for rod" in note for note in done.notes)

    @pytest.mark.parametrize(
        "header",
        [
            "t,a_x,a_y,a_ang,b_x,b_y,b_ang",
            "t,x_a,y_a,ang_a,x_b,y_b,ang_b",
            "t,a_x,a_y,a_orientation,b_x,b_y,orientation_b",
            "t,a_x,a_y,Drehwinkel a,b_x,b_y,ÁNGULO b",
            "t,a x,a y,a Angular Position (rad),b x,b y,b angular_displacement (rad)",
        ],
    )
    def test_every_word_for_an_angle_is_known_beside_places(self, tmp_path, header):
        source = write(tmp_path, header, T, T, -T, LEFT, T + 1, -T, RIGHT)
        (done,) = import_all(source, tmp_path / "out", bodies=["*:3cm:1kg"], picture=False)
        assert done.recording.ids == ("a", "b") and not any("not read" in note for note in done.notes)
        np.testing.assert_array_equal(done.recording.angle, np.stack([LEFT, RIGHT], axis=1))

    @pytest.mark.parametrize("bodies", [["*:3cm:1kg"], ["a:3cm:1kg", "b:3cm:1kg"]])
    def test_the_centre_and_the_angle_of_a_body_whose_headings_differ(self, tmp_path, bodies):
        source = write(tmp_path, "t,c_a_x,c_a_y,ang_a,c_b_x,c_b_y,ang_b", T, T, -T, LEFT, T + 1, -T, RIGHT)
        (done,) = import_all(source, tmp_path / "out", bodies=bodies, picture=False)
        assert done.recording.ids == (("c_a", "c_b") if bodies[0][0] == "*" else ("a", "b"))
        np.testing.assert_array_equal(done.recording.angle, np.stack([LEFT, RIGHT], axis=1))
        np.testing.assert_array_equal(done.recording.xy[:, 1, 0], T + 1)
        assert sum("are taken for one body" in note for note in done.notes) == 2

    def test_what_looks_like_an_angle_or_a_place_and_is_not_read_is_told(self, tmp_path):
        header = "t,a_x,a_y,a_z,heading [deg],theta,a_vx,ang_mom,x_err,remark"
        source = write(tmp_path, header, T, *[T] * 9)
        (done,) = import_all(source, tmp_path / "out", bodies=["a:3cm:1kg"], picture=False)
        (note,) = [note for note in done.notes if "not read" in note]
        assert "coordinate: a_z, heading [deg], theta (--columns" in note

    def test_rates_and_errors_are_no_angles(self, tmp_path):
        source = write(tmp_path, "t,theta_dot,theta_err,angle_velocity", T, LEFT, LEFT, LEFT)
        with pytest.raises(InputError, match="no time and positions"):
            import_recording(source, bodies=["*:3cm:1kg"])


class TestHeadingsOfPasco:
    def test_an_angle_by_its_heading(self, tmp_path):
        source = write(tmp_path, f'"Time (s)","{CAPSTONE.format(1)}"', T, LEFT)
        (r,) = import_recording(source, bodies=["disk:5cm:120g"])
        np.testing.assert_array_equal(r.angle[:, 0], LEFT)

    def test_an_angular_position_in_degrees(self, tmp_path):
        source = write(tmp_path, '"Time (s)","Angular Position, Ch 1&2, Run #1 ( deg )"', T, np.degrees(LEFT))
        (r,) = import_recording(source, bodies=["disk:5cm:120g"])
        np.testing.assert_allclose(r.angle[:, 0], LEFT, atol=1e-12)

    @pytest.mark.parametrize(
        "columns",
        [
            f"t=Time (s),angle={CAPSTONE.format(2)}",
            f't=Time (s),angle="{CAPSTONE.format(2)}"',
            f"angle='{CAPSTONE.format(2)}', t=1",
            "t=1,angle=3",
            {"t": "Time (s)", "angle": CAPSTONE.format(2)},
        ],
    )
    def test_one_of_several_runs_by_its_name_or_number(self, tmp_path, columns):
        header = ",".join(f'"{name}"' for name in ("Time (s)", *map(CAPSTONE.format, (1, 2))))
        source = write(tmp_path, header, T, LEFT, RIGHT)
        with pytest.raises(InputError, match=r"several runs.*--columns 'angle=\"Angle, Ch"):
            import_recording(source, bodies=["disk:5cm:120g"])
        (r,) = import_recording(source, bodies=["disk:5cm:120g"], columns=columns)
        np.testing.assert_array_equal(r.angle[:, 0], RIGHT)

    def test_two_sensors_are_two_bodies(self, tmp_path):
        source = write(tmp_path, '"Time (s)","Angle, Ch 1+2 (rad)","Angle, Ch 3+4 (rad)"', T, LEFT, RIGHT)
        with pytest.raises(InputError, match=r"several sensors.*BODY.angle"):
            import_recording(source, bodies=["*:5cm:120g"])
        (r,) = import_recording(source, bodies=["*:5cm:120g"], columns="a.angle=2,b.angle=3")
        assert r.ids == ("a", "b") and (r.angle == np.stack([LEFT, RIGHT], axis=1)).all()

    def test_an_angle_that_is_said_to_be_a_place_is_told(self, tmp_path):
        source = write(tmp_path, f'"Time (s)","{CAPSTONE.format(1)}"', T, LEFT)
        (done,) = import_all(source, tmp_path / "out", bodies=["*:5cm:120g"], columns="t=1,x=2", picture=False)
        assert any("unit of angles" in note for note in done.notes) and done.recording.angle is None

    @pytest.mark.parametrize("columns", ["", "x", "x=", 'x=""', "=2"])
    def test_a_map_that_is_none(self, columns):
        with pytest.raises(InputError, match=r"NAME=COLUMN.*in quotes"):
            Options(columns=columns).column_map()

    def test_a_number_beyond_the_table_is_told(self, tmp_path):
        source = write(tmp_path, "t,x", T, LEFT)
        with pytest.raises(InputError, match="no column '3'; it has: t, x"):
            import_recording(source, bodies=["*:5cm:120g"], columns="t=1,x=3")

    def test_a_name_that_is_a_number_is_the_name(self, tmp_path):
        source = write(tmp_path, "t,2,1", T, LEFT, RIGHT)
        (r,) = import_recording(source, bodies=["*:5cm:120g"], columns="t=t,x=2,y=1")
        np.testing.assert_array_equal(r.xy[:, 0], np.stack([LEFT, RIGHT], axis=1))


class TestAdjustables:
    LAW = "spring:cart,anchor=0 0,stiffness=4,length=0"

    def test_what_may_move_is_written(self, tmp_path, capsys):
        source = write(tmp_path, "t,x", T, LEFT)
        said = ["--adjustable", "spring.stiffness=3:5", "--adjustable", "drive.gain=0.5:2"]
        (tmp_path / "told.csv").write_text("t,cart\n0,0\n1,1\n")
        assert main(["import", str(source), "--body", "cart:3cm:1kg", "--scene", "cart", "--law", self.LAW, "--input",
                     str(tmp_path / "told.csv"), *said, "--out", str(tmp_path / "out")]) == 0  # fmt: skip
        capsys.readouterr()
        stiffness, gain = read_recording(tmp_path / "out").scene.adjustable
        assert (stiffness.name, stiffness.low, stiffness.high, stiffness.per) == ("spring.stiffness", 3.0, 5.0, "all")
        assert (gain.name, gain.low, gain.high) == ("drive.gain", 0.5, 2.0)

    def test_one_of_a_template_is_replaced(self, tmp_path):
        source = write(tmp_path, "t,p1_angle,p2_angle", T, LEFT, RIGHT)
        (r,) = import_recording(
            source, bodies=["*:3cm:1kg"], scene="pendulum", laws=PINS, adjustables=["pin.length=0.5:0.7"]
        )
        (length,) = r.scene.adjustable
        assert (length.name, length.low, length.high, length.per) == ("pin.length", 0.5, 0.7, "body")

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("springs.stiffness=3:5", "no law 'springs'; it has: rail, spring"),
            ("spring.stifness=3:5", "unknown parameter 'stifness'; it has: .*stiffness"),
            ("spring.stiffness=5:3", "low should be below high, got 5 and 3"),
            ("spring.stiffness=5:7", "spring.stiffness: 4 is believed, which is outside 5 to 7"),
            ("spring.anchor=0:1", "no single number"),
            ("spring.stiffness=-3:5", "-3 N/m is outside"),
            ("spring.stiffness=3", "LAW.PARAMETER=LOW:HIGH"),
            ("stiffness=3:5", "LAW.PARAMETER=LOW:HIGH"),
            ("spring.stiffness=3:inf", "LAW.PARAMETER=LOW:HIGH"),
        ],
    )
    def test_what_is_wrong_is_said(self, tmp_path, text, message):
        source = write(tmp_path, "t,x", T, LEFT)
        with pytest.raises(InputError, match=message):
            import_recording(source, bodies=["cart:3cm:1kg"], scene="cart", laws=[self.LAW], adjustables=[text])


class TestRails:
    def doubts(self, folder, x, y, **said):
        source = write(folder, "t,x,y", T, x, y)
        (done,) = import_all(source, folder / "out", bodies=["ball:1cm:69g"], scene="cart", picture=False, **said)
        return [warning for warning in done.look.warnings if "rail" in warning]

    def test_a_path_that_is_no_line_is_told(self, tmp_path):
        x = 0.2 * np.cos(3 * T)
        (said,) = self.doubts(tmp_path, x, 5 * x**2)
        assert re.search(r"ball leaves its rail: it goes 0.(?:19|2)\d* m across it and 0.39\d m along it", said)

    def test_a_direction_that_is_wrong_is_told(self, tmp_path):
        x = 0.2 * np.cos(3 * T)
        assert self.doubts(tmp_path, x, 0.3 * x, laws=["rail:ball,direction=1 0"])

    @pytest.mark.parametrize("size", [0.2, 1e-4])
    def test_a_rail_seen_through_a_lens_or_in_noise_is_not(self, tmp_path, size):
        x, rng = size * np.cos(3 * T), np.random.default_rng(2)
        y = 0.3 * x + 0.1 * x**2 / size + rng.normal(0, 2e-4, len(T)) * (size < 0.1)
        y[20] += 0.5 * size  # a wrong point
        assert not self.doubts(tmp_path, x, y)


class TestOneCoordinate:
    FALL = 1.2 - 0.5 * 9.81 * T**2  # m

    def read(self, folder, header, values, body="bead", **said):
        source = write(folder, header, T, values)
        (done,) = import_all(source, folder / "out", bodies=[f"{body}:2cm:50g"], **said)
        return read_recording(folder / "out"), done

    @pytest.mark.parametrize("said", [{"scene": "drop"}, {"gravity": 9.81}, {"laws": ["rail:bead,direction=0 1"]}])
    def test_without_an_axis_it_is_the_way_of_gravity(self, tmp_path, said):
        read, done = self.read(tmp_path, "Time(sec),Position(mm)", 1e3 * self.FALL, **said)
        np.testing.assert_allclose(read.xy[:, 0, 1], self.FALL, atol=1e-12)
        assert not done.look.warnings and any("Position(mm) is the only coordinate" in note for note in done.notes)
        assert not any("--flip-y" in note for note in done.notes)

    def test_one_that_counts_downwards(self, tmp_path):
        _, done = self.read(tmp_path, "Time(sec),Position(mm)", -1e3 * self.FALL, scene="drop")
        assert any("--flip-y 0" in note for note in done.notes)
        read, done = self.read(tmp_path, "Time(sec),Position(mm)", -1e3 * self.FALL, scene="drop", flip_y=0.0)
        np.testing.assert_allclose(read.xy[:, 0, 1], self.FALL, atol=1e-12)
        assert not any("--flip-y 0" in note for note in done.notes) and not done.look.warnings

    def test_a_scene_of_a_file(self, tmp_path):
        (tmp_path / "scene.toml").write_text("[scene]\ngravity = [0.0, -9.81]\n")
        read, _ = self.read(tmp_path, "t,Position", self.FALL, scene=str(tmp_path / "scene.toml"))
        np.testing.assert_array_equal(read.xy[:, 0, 1], self.FALL)

    @pytest.mark.parametrize(
        "said",
        [{}, {"scene": "puck"}, {"columns": "x=Position", "gravity": 9.81}, {"gravity": "9.81,0"},
         {"gravity": 9.81, "laws": ["pin:bead,anchor=0 0.5,length=0.5"]}],
    )  # fmt: skip
    def test_elsewhere_it_is_x(self, tmp_path, said):
        read, _ = self.read(tmp_path, "t,Position", LEFT, **said)
        np.testing.assert_array_equal(read.xy[:, 0, 0], LEFT)

    def test_the_other_one_is_said_to_stand_as_zero(self, tmp_path):
        read, done = self.read(tmp_path, "t,y", self.FALL, scene="drop")
        assert (read.xy[:, 0, 0] == 0).all()
        assert any("x was not measured and stands as 0" in note for note in done.notes)

    def test_the_other_one_is_left_out_where_a_rail_makes_up_for_it(self, tmp_path):
        read, done = self.read(tmp_path, "t,Position", LEFT, scene="cart")
        assert np.isnan(read.xy[:, 0, 1]).all() and (read.xy[:, 0, 0] == LEFT).all()
        assert any("y was not measured and is left out" in note for note in done.notes)
        assert done.look.speed > 0 and (tmp_path / "out/tracks.png").stat().st_size > 1000

    def test_a_fall_of_which_another_coordinate_was_measured(self, tmp_path):
        _, done = self.read(tmp_path, "t,x", self.FALL, scene="drop")
        assert [w for w in done.look.warnings if "not measured along gravity" in w and "--columns y=NAME" in w]


class TestOneCoordinateThatIsAHeight:
    @pytest.mark.parametrize("heading", ["altitude_ft", "Height (ft)", "Höhe [ft]"])
    def test_it_is_y(self, tmp_path, heading):
        source = write(tmp_path, f"time_s,{heading},temperature", T, LEFT, RIGHT)
        (r,) = import_recording(source, bodies=["rocket:5cm:2kg"])
        np.testing.assert_allclose(r.xy[:, 0, 1], 0.3048 * LEFT, atol=1e-9)

    def test_the_size_of_a_box_is_none(self, tmp_path):
        source = write(tmp_path, "t,left,width,height", T, LEFT, LEFT, RIGHT)
        with pytest.raises(InputError, match="no time and positions"):
            import_recording(source, bodies=["rocket:5cm:2kg"])


@pytest.mark.parametrize(("header", "columns"), [("", "x=1,y=2"), ("p,q", "x=p,y=q")])
def test_rows_of_places_that_are_said_are_frames(tmp_path, header, columns):
    source = write(tmp_path, header, LEFT, RIGHT)
    (r,) = import_recording(source, bodies=["puck:2cm:20g"], columns=columns, fps=50.0)
    np.testing.assert_allclose(r.xy[:, 0], np.stack([LEFT, RIGHT], axis=1), atol=1e-12)
    np.testing.assert_allclose(r.t, np.arange(len(LEFT)) / 50)


@pytest.mark.parametrize(("slope", "noise", "along"), [(0.01, 0.0, True), (0.027, 1e-5, True), (1e-4, 1e-3, False)])
def test_a_rail_runs_where_its_cart_was_seen(tmp_path, slope, noise, along):
    """A camera that stands askew by a degree: on an axis its tilt would be named."""
    x = np.linspace(0.0, 0.8, len(T))
    y = slope * x + np.random.default_rng(0).normal(0, noise, len(T))
    source = write(tmp_path, "t,x,y", T, x, y)
    (r,) = import_recording(source, bodies=["a:3cm:200g"], scene="cart")
    (rail,) = r.scene.laws
    direction = np.array(rail.values["direction"]) / np.hypot(*rail.values["direction"])
    assert direction == pytest.approx([1.0, slope] / np.hypot(1, slope) if along else [1.0, 0.0], abs=1e-4)


@pytest.mark.parametrize("stamp", ["0:00:0{:.3f}", "2024-05-01T10:00:0{:.3f}"])
def test_a_first_row_with_a_time_of_day_is_no_header(tmp_path, stamp):
    rows = [f"{stamp.format(0.1 * k)},{0.5 + 0.01 * k * k:g}" for k in range(10)]
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    (r,) = import_recording(tmp_path / "log.csv", bodies=["arm:3cm:100g"], columns="t=1,x=2", scene="cart")
    assert len(r.t) == 10 and r.xy[0, 0, 0] == 0.5
    np.testing.assert_allclose(r.t, 0.1 * np.arange(10), atol=1e-9)


@pytest.mark.parametrize(("columns", "told"), [(None, True), ("t=t [s],x=x [m],y=z [m]", False)])
def test_a_third_coordinate_is_left_out_with_a_note(tmp_path, columns, told):
    rows = [f"{0.1 * k:g},{0.2 * k:g},0.5,{1 - 0.01 * k * k:g}" for k in range(10)]
    source = tmp_path / "table.csv"
    source.write_text("\n".join(["t [s],x [m],y [m],z [m]", *rows]) + "\n")
    (done,) = import_all(source, tmp_path / "out", bodies=["ball:3cm:100g"], columns=columns, picture=False)
    assert any("z [m], which goes from 0.19 to 1, is left out" in note for note in done.notes) == told
    assert done.recording.xy[3, 0, 1] == pytest.approx(0.5 if told else 0.91)


def test_friction_of_contacts_comes_beside_the_contact_of_the_template(tmp_path):
    x = np.linspace(0.0, 0.3, len(T))
    source = write(tmp_path, "t,a_x,a_y,b_x,b_y", T, x, 0 * x, 0.34 - 0.1 * x, 0 * x)
    laws = ["contact_friction,mu=0.1"]
    (r,) = import_recording(source, bodies=["a:2cm:20g", "b:2cm:20g"], scene="puck", laws=laws)
    assert [item.name for item in r.scene.laws] == ["contact_elastic", "contact_friction"]


@pytest.mark.parametrize(("scale", "unit", "told"), [(175.0, None, True), (175.0, "deg", False), (3.0, None, False)])
def test_angles_without_a_unit_that_may_be_degrees_are_told(tmp_path, scale, unit, told):
    source = write(tmp_path, "t,x,y,orientation", T, LEFT, RIGHT, scale * T / T[-1])
    (done,) = import_all(source, tmp_path / "out", bodies=["log:3cm:100g"], angle_unit=unit, picture=False)
    assert any("are taken for radians (degrees: --angle-unit deg)" in note for note in done.notes) == told


@pytest.mark.parametrize("units", ["#[s]\t[cm]", "# (s)\t(cm)"])
def test_a_row_of_units_below_the_names_in_the_comments_above_a_table(tmp_path, units):
    """What numpy.loadtxt reads: "#Time Pos" and, below it, the units."""
    rows = [f"{t}\t{100 * x}" for t, x in zip(T.tolist(), LEFT.tolist(), strict=True)]
    (tmp_path / "lab.txt").write_text("\n".join(["#Creator: a bench", "#Time\tPos", units, *rows]))
    (r,) = import_recording(tmp_path / "lab.txt", bodies=["bob:2cm:100g"], scene="cart")
    assert r.xy[:, 0, 0] == pytest.approx(LEFT, abs=1e-6) and r.t == pytest.approx(T)


@pytest.mark.parametrize(
    ("head", "sign"), [("Run #1;\nTime (s);Position (m)", ";"), ("Run #1,,\n3 May,cart,\nt,x,y\ns,m,m", ",")]
)
def test_titles_above_the_header_are_none_of_the_table(tmp_path, head, sign):
    columns = [T, LEFT] if sign == ";" else [T, LEFT, RIGHT]
    (r,) = import_recording(write(tmp_path, head, *columns, sign=sign), bodies=["cart:3cm:1kg"])
    np.testing.assert_allclose(r.t, T)
    np.testing.assert_allclose(r.xy[:, 0, 0], LEFT)


def test_rows_that_no_header_follows_are_asked_for(tmp_path):
    with pytest.raises(InputError, match="--skip-rows N where rows stand above the header"):
        import_recording(write(tmp_path, "Run #1;3\nfoo;bar", T, LEFT, sign=";"), bodies=["cart:3cm:1kg"])


@pytest.mark.parametrize("header", [" ,Label,X,Y,Slice", " ,Label,X,Y,Frame", "index,Track n°,X,Y,Slice n°"])
def test_y_of_imagej_points_down_and_the_only_body_has_the_name_that_was_said(tmp_path, header):
    number = np.arange(len(T))
    rows = [f"{k + 1},puck.avi,{x},{y},{k}" for k, x, y in zip(number.tolist(), LEFT, 2 + RIGHT, strict=True)]
    (tmp_path / "Results.csv").write_text("\n".join([header, *rows]))
    said = {"unit": "1mm/px", "fps": 25.0, "bodies": ["puck:4cm:80g"], "picture": False}
    (done,) = import_all(tmp_path / "Results.csv", tmp_path / "out", **said)
    assert done.recording.ids == ("puck",)
    np.testing.assert_allclose(done.recording.xy[:, 0, 1], -1e-3 * (2 + RIGHT))
    assert any("y points down" in n for n in done.notes) and not any("y is taken" in n for n in done.notes)
    (r,) = import_recording(tmp_path / "Results.csv", flip_y=False, unit="1mm/px", fps=25.0, bodies=["*:4cm:80g"])
    assert r.ids == ("puck.avi",) and (r.xy[:, 0, 1] > 0).all()


@pytest.mark.parametrize(
    ("text", "table"),
    [
        ("rod:a,b,length=0.25", {"name": "rod", "bodies": ["a", "b"], "length": 0.25}),
        ("rod:a+b,length=0.25", {"name": "rod", "bodies": ["a", "b"], "length": 0.25}),
        ("pair_spring:a,b:k=1.6", {"name": "pair_spring", "bodies": ["a", "b"], "k": 1.6}),
        ("pair_spring:k=1.6,f_0=0.4", {"name": "pair_spring", "k": 1.6, "f_0": 0.4}),
        ("pin:bob, anchor=0 0", {"name": "pin", "body": "bob", "anchor": [0.0, 0.0]}),
        ("gravity", {"name": "gravity"}),
    ],
)
def test_laws_of_bodies(text, table):
    assert parse_law(text) == table


@pytest.mark.parametrize("text", ["rod:a,length=0.25,b", "rod,length", "pin:bob,length", "pin:bob,length=", ":bob"])
def test_laws_that_are_none(text):
    with pytest.raises(InputError, match=r"should be NAME\[:BODY\[,BODY\]\],PARAMETER=VALUE"):
        parse_law(text)


def test_two_bodies_of_a_law_and_a_spring_between_pendulums(tmp_path):
    """Pendulums that a spring couples have no period of their own, and nothing is asked about it."""
    t = np.arange(200) / 25
    angles = 0.3 * np.cos(9 * t), 0.2 * np.sin(9 * t)
    places = [c for k, a in enumerate(angles) for c in (0.5 * k + 0.6 * np.sin(a), -0.6 * np.cos(a))]
    source = write(tmp_path, "t,p1_x,p1_y,p2_x,p2_y", t, *places)
    said = {"bodies": ["*:3cm:1kg"], "scene": "pendulum", "picture": False}
    (alone,) = import_all(source, tmp_path / "alone", laws=PINS, **said)
    (both,) = import_all(source, tmp_path / "both", laws=[*PINS, "pair_spring:p1,p2,k=60,f_0=0"], **said)
    assert both.recording.scene.laws_named("pair_spring")[0].bodies == ("p1", "p2")
    assert any("swings with a period" in w for w in alone.look.warnings) and not both.look.warnings


def test_a_component_of_a_vector_is_adjustable(tmp_path):
    source = write(tmp_path, "t,x", T, 0.1 + 2 * T - 0.5 * T**2)
    said = {"bodies": ["cart:4cm:510g"], "scene": "cart", "laws": ["uniform_force:cart,a=-0.95 0.1"]}
    with pytest.raises(InputError, match=r"its components are uniform_force\.a_x and uniform_force\.a_y"):
        import_recording(source, adjustables=["uniform_force.a=-1:-0.9"], **said)
    with pytest.raises(InputError, match="unknown parameter 'a_z'"):
        import_recording(source, adjustables=["uniform_force.a_z=-1:-0.9"], **said)
    import_all(source, tmp_path / "out", adjustables=["uniform_force.a_x=-1.1:-0.9"], picture=False, **said)
    recording = read_recording(tmp_path / "out")
    (term,) = adjustable_terms([SimpleNamespace(name="a", recording=recording)])
    assert (term.free[0].first, term.free[0].unit) == (-0.95, "m/s^2")
    moved, _ = term.apply(recording.scene, {}, [-1.0])
    assert moved.laws_named("uniform_force")[0].values["a"] == (-1.0, 0.1)


def said(capsys, *args):
    code = main(["import", *map(str, args)])
    told = capsys.readouterr()
    return code, told.out + told.err


def test_columns_are_said_without_their_units(tmp_path, capsys):
    table = write(tmp_path, "Time A [s],Pos A [mm],Time B [s],Pos B [mm]", T, 100 * LEFT, T, 100 * RIGHT)
    columns = "t=Time A,A.x=Pos A,B.x=pos b"
    code, told = said(
        capsys, table, "--columns", columns, "--scene", "cart", "--body", "*:1cm:10g", "--out", tmp_path / "two"
    )
    assert code == 0, told
    assert read_recording(tmp_path / "two").xy[:, 1, 0] == pytest.approx(0.1 * RIGHT)


def test_a_height_as_a_letter_beside_its_error(tmp_path, capsys):
    table = write(tmp_path, "t,h,h_err", T[:20], 1.5 - 4.9 * T[:20] ** 2, 0.01 + 0 * T[:20])
    code, told = said(capsys, table, "--scene", "drop", "--body", "ball:2cm:50g", "--out", tmp_path / "fall")
    assert code == 0 and "falls" not in told, told
    assert read_recording(tmp_path / "fall").xy[0, 0, 1] == 1.5


def test_a_column_of_velocities_that_is_called_a_place_is_told(tmp_path, capsys):
    table = write(tmp_path, "t,x,vx", T, LEFT, RIGHT)
    where = ["--scene", "cart", "--body", "a:1cm:10g", "--out", tmp_path / "wrong"]
    code, told = said(capsys, table, "--columns", "t=t,x=vx", *where)
    assert code == 0 and "vx is taken for a place, as you say, though by its heading it is a rate" in told


@pytest.mark.parametrize("flip", [[], ["--flip-y", "yes"]])
def test_what_falls_upwards_has_a_y_that_counts_downwards(tmp_path, capsys, flip):
    t = np.arange(30) / 60
    y = 0.2 + 4.6 * t**2 + np.random.default_rng(1).normal(0, 5e-4, 30)
    table = write(tmp_path, "t,x,y", t, 0.5 + 0 * t, y)
    where = ["--scene", "drop", "--body", "ball:3cm:20g", "--out", tmp_path / "fall"]
    code, told = said(capsys, table, *where, *flip)
    assert code == 0 and ("does y count downwards" in told) == (not flip), told


def test_a_path_that_is_no_circle_hangs_from_no_rod(tmp_path, capsys):
    t = np.arange(300) / 60
    for bowl in (True, False):
        across = 0.2 * np.cos(9 * t)
        down = 4.4 * across**2 if bowl else 0.25 - np.sqrt(0.25**2 - across**2)
        noise = np.random.default_rng(1).normal(0, 3e-4, (2, 300))
        table = write(tmp_path, "t,x,y", t, across + noise[0], down + noise[1])
        code, told = said(
            capsys, table, "--scene", "pendulum", "--body", "ball:1cm:50g", "--out", tmp_path / f"path{bowl}"
        )
        assert code == 0 and ("its path is no circle" in told) == bowl, told
