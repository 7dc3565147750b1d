"""Tables of a student laboratory: angles of pendulums, headings of PASCO, one coordinate, a rail that is none."""

import numpy as np
import pytest

from granswim_pymunk.errors import InputError
from granswim_pymunk.recording import read_recording
from granswim_pymunk.recording.importers import import_all, import_recording

T = np.arange(60) / 25
LEFT, RIGHT = 0.3 * np.cos(4 * T), 0.2 * np.sin(4 * T)  # rad
PINS = ["pin:p1,anchor=0 0,length=0.6", "pin:p2,anchor=0.5 0,length=0.6"]


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

    def test_numbers_in_a_heading_are_bodies_in_rad(self, tmp_path):
        source = write(tmp_path, "t,theta1,theta2", T, LEFT, RIGHT)
        (r,) = import_recording(source, bodies=["*:3cm:1kg"])
        assert r.ids == ("1", "2")
        np.testing.assert_array_equal(r.angle[:, 1], RIGHT)

    def test_the_length_of_a_rod_is_asked_for(self, tmp_path):
        source = write(tmp_path, "t,p1_angle,p2_angle", T, LEFT, RIGHT)
        with pytest.raises(InputError, match=r"only the angle of p1 is measured.*length"):
            import_recording(source, bodies=["*:3cm:1kg"], scene="pendulum")

    def test_rates_and_errors_are_no_angles(self, tmp_path):
        source = write(tmp_path, "t,theta_dot,theta_err,angle_velocity", T, LEFT, LEFT, LEFT)
        with pytest.raises(InputError, match="no time and positions"):
            import_recording(source, bodies=["*:3cm:1kg"])
