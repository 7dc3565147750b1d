"""Files that no list of formats names, as laboratories and scripts leave them: their values, or what they are."""

import json
import math
import pickle

import h5py
import numpy as np
import pytest
from test_importers import HEIGHT, PIXEL, T, filled, pd

from granswim_pymunk.errors import InputError
from granswim_pymunk.recording import read_recording
from granswim_pymunk.recording.importers import import_all, import_recording
from granswim_pymunk.recording.importers.headings import find_columns, words

ALL = filled()  # both bodies in every frame
CM, MM, UM = 100 * ALL, 1e3 * ALL, 1e6 * ALL
PX = np.stack([ALL[..., 0] / PIXEL, HEIGHT - ALL[..., 1] / PIXEL], axis=-1)
TURNED = 0.3 * np.cos(5 * T)  # rad
PIXELS = {"unit": "0.1mm/px", "fps": 50.0, "flip_y": HEIGHT}


def table(header, *columns, sign=";", comma=False):
    """Rows of text; numbers with all their digits, or what already is text."""
    rows = [sign.join(v if isinstance(v, str) else repr(float(v)) for v in row) for row in zip(*columns, strict=True)]
    text = "\n".join(rows).replace(".", ",") if comma else "\n".join(rows)
    return header + "\n" + text + "\n"


def twice(header, numbers, xy, sign=";", clock=T, comma=False, more=()):
    """A row for each body and frame: clock, body, x, y."""
    each = [np.repeat(c, 2) for c in (clock, *more)]
    body = [numbers[k % 2] for k in range(2 * len(T))]
    return table(header, each[0], body, *xy.reshape(-1, 2).T, *each[1:], sign=sign, comma=comma)


def mocap(*head, sign=",", scale=1.0, clock=()):
    cells = np.concatenate([scale * ALL, np.full((len(T), 2, 1), 0.1)], axis=2).reshape(len(T), -1)
    return table("\n".join(head), *clock, *cells.T, sign=sign)


FRAME = [str(k) for k in range(len(T))]
CLOCKS = [f"00:01:{12 + t:06.3f}" for t in T]
# name: text, options, bodies that are in it
TEXTS = {
    "opencv_german": (table("Bild,x,y", FRAME, *PX[:, 0].T, sign=","), PIXELS, 1),
    "opencv_portuguese": (table("quadro;pos_x;pos_y", FRAME, *PX[:, 0].T), PIXELS, 1),
    "opencv_french": (table("image;centre x (px);centre y (px)", FRAME, *PX[:, 0].T), PIXELS, 1),
    "opencv_spanish": (twice("fotograma,objeto,x,y", "01", PX, ",", FRAME), PIXELS, 2),
    "seconds_and_numbers": (table("seconds,x1,y1,x2,y2", T, *ALL.reshape(-1, 4).T, sign=","), {}, 2),
    "frame_and_time_with_fps": (table("frame,time,x,y", FRAME, T, *ALL[:, 0].T, sign=","), {"fps": 50.0}, 1),
    "imagej_mtrackj": (
        twice("t [sec]\tTID\tx [pixel]\ty [pixel]\tI [val]", "12", PX, "\t", more=(T,)), PIXELS | {"fps": None}, 2),
    "imagej_manual_tracking": (
        twice("Slice n°\tTrack n°\tX\tY\tVelocity", "12", PX, "\t", FRAME, more=(T,)), PIXELS, 2),
    "imagej_results": (
        table(" ,Label,X,Y,Slice", FRAME, [f"film:{k}" for k in FRAME], *PX[:, 0].T, FRAME, sign=","), PIXELS, 1),
    "logger_pro_in_one_word": (
        table("VideoAnalysis: Time (s),VideoAnalysis: X,VideoAnalysis: Y,VideoAnalysis: X Velocity", T, *PX[:, 0].T, T,
              sign=","), PIXELS | {"fps": None}, 1),
    "norwegian": (table("Tid (s);x-posisjon (m);y-posisjon (m);Fart (m/s)", T, *ALL[:, 0].T, T), {}, 1),
    "mosaic": (twice("Frame,Trajectory,x,y,m0", "12", PX, ",", FRAME, more=(T,)), PIXELS, 2),
    "optitrack": (
        mocap("Format Version,1.23,Take Name,a,Length Units,Meters", "", ",Type,M,M,M,M,M,M", ",Name,a,a,a,b,b,b",
              ",," + ",".join(["Position"] * 6), "Frame,Time (Seconds),X,Y,Z,X,Y,Z", clock=(FRAME, T)), {}, 2),
    "vicon": (
        mocap("Trajectories", "50", ",,puck:left,,,puck:right,,", "Frame,Sub Frame,X,Y,Z,X,Y,Z", ",,mm,mm,mm,mm,mm,mm",
              scale=1e3, clock=(FRAME, ["0"] * len(T))) + "\nModel Outputs\n50\n", {}, 2),
    "qualisys": (
        mocap("NO_OF_FRAMES\t30", "FREQUENCY\t50", "MARKER_NAMES\tleft\tright", sign="\t", scale=1e3), {}, 2),
    "qualisys_with_its_version": (
        mocap("FILE_VERSION\t2.0.0", "NO_OF_FRAMES\t30", "NO_OF_CAMERAS\t2", "NO_OF_MARKERS\t2", "FREQUENCY\t50",
              "DESCRIPTION\t--", "TIME_STAMP\t2025-11-17, 14:07:32.624\t313439.8", "DATA_INCLUDED\t3D",
              "MARKER_NAMES\tcm 1\ted1", "TRAJECTORY_TYPES\tMixed\tMeasured", sign="\t", scale=1e3), {}, 2),
    "qualisys_with_a_clock": (
        mocap("NO_OF_FRAMES\t30", "FREQUENCY\t50", "MARKER_NAMES\tleft\tright", "Frame\tTime\tleft X\tleft Y\tleft Z",
              sign="\t", scale=1e3, clock=(FRAME, T)), {}, 2),
    "logger_pro": (
        table("Latest: Time (s)\tLatest: X (m)\tLatest: Y (m)\tLatest: X Velocity (m/s)", T, *ALL[:, 0].T, T,
              sign="\t"), {}, 1),
    "capstone": (
        table("Time (s) Run #1\tPosition, x (m) Run #1\tPosition, y (m) Run #1", T, *ALL[:, 0].T, sign="\t"), {}, 1),
    "units_in_brackets": (twice("t [ms];Körper;x [mm];y [mm]", "AB", MM, clock=1e3 * T, comma=True), {}, 2),
    "german": (twice("Zeit/s;Kugel;Ort x/cm;Ort y/cm", "ab", CM, comma=True), {}, 2),
    "french": (twice("temps (s);objet;abscisse (cm);ordonnée (cm)", "ab", CM, comma=True), {}, 2),
    "portuguese": (twice("tempo (s);corpo;posição x (cm);posição y (cm)", "ab", CM, comma=True), {}, 2),
    "hours_and_minutes": (table("time,x,y", CLOCKS, *ALL[:, 0].T, sign=","), {}, 1),
    "dates": (table("timestamp;x;y", [f"2024-05-03T10:{c[3:]}Z" for c in CLOCKS], *ALL[:, 0].T), {}, 1),
    "thousands": (
        table("t [ms],x [um],y [um]", *([f'"{v:,.9f}"' for v in c] for c in (1e3 * T, *UM[:, 0].T)), sign=","), {}, 1),
    "thousands_swiss": (
        table("t [ms];x [um];y [um]", *([f"{v:,.9f}".replace(",", "'") for v in c] for c in (1e3 * T, *UM[:, 0].T))),
        {}, 1),
    "thousands_german": (
        table("t [ms];x [um];y [um]", *([f"{v:,.9f}".translate({44: 46, 46: 44}) for v in c]
                                        for c in (1e3 * T, *UM[:, 0].T))), {}, 1),
    "json_rows.json": (
        json.dumps([{"t": t, "body": "ab"[b], "x": x, "y": y}
                    for t, pair in zip(T.tolist(), ALL.tolist(), strict=True) for b, (x, y) in enumerate(pair)]),
        {}, 2),
    "json_lists.json": (
        json.dumps({"run": {"t": T.tolist(), "x": ALL[:, 0, 0].tolist(), "y": ALL[:, 0, 1].tolist()}}), {}, 1),
    "json_lines.jsonl": (
        "".join(json.dumps({"t": t, "x": x, "y": y}) + "\n"
                for t, (x, y) in zip(T.tolist(), ALL[:, 0].tolist(), strict=True)), {}, 1),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_texts(name, tmp_path):
    text, options, bodies = TEXTS[name]
    source = tmp_path / (name if "." in name else f"{name}.csv")
    source.write_text(text, encoding="utf-8")
    said = {key: value for key, value in options.items() if value is not None}
    (done,) = import_all(source, tmp_path / "out", bodies=["*:5mm:10g"], picture=False, **said)
    r = done.recording
    assert len(r.ids) == bodies
    np.testing.assert_allclose(r.t, T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(r.xy, ALL[:, :bodies], rtol=0, atol=1e-9)


def test_markers_of_qualisys_that_are_not_seen(tmp_path):
    head, rows = ["FILE_VERSION\t2.0.0", "NO_OF_FRAMES\t6", "FREQUENCY\t50", "MARKER_NAMES\ta\tb"], []
    for k, seen in enumerate(("b", "ab", "", "a", "ab", "ab")):
        cells = [f"{k + 1}\t{2 * k + 1}\t3" if name in seen else "\t\t" for name in "ab"]
        rows.append("\t".join(cells).rstrip("\t") if k == 3 else "\t".join(cells))
    (tmp_path / "a.tsv").write_text("\n".join(head + rows) + "\n")
    (r,) = import_recording(tmp_path / "a.tsv", bodies=["*:5mm:10g"])
    np.testing.assert_allclose(r.t, [0, 0.02, 0.06, 0.08, 0.1], atol=1e-12)  # of the third no row is left
    x = 1e-3 * np.array([[np.nan, 1], [2, 2], [4, np.nan], [5, 5], [6, 6]])
    np.testing.assert_allclose(r.xy[:, [r.ids.index(name) for name in "ab"], 0], x, atol=1e-12)


QUALISYS = mocap("NO_OF_FRAMES\t30", "FREQUENCY\t50", "MARKER_NAMES\tcm 1\tNew 0005", sign="\t", scale=1e3)


@pytest.mark.parametrize(
    ("options", "bodies"),
    [
        ({"bodies": ["*:5mm:10g"]}, {"cm_1": 0, "New_0005": 1}),
        ({"bodies": ["cm_1:5mm:10g"]}, {"cm_1": 0}),
        ({"bodies": ["New_0005:5mm:10g"]}, {"New_0005": 1}),
        ({"bodies": ["puck:5mm:10g"], "columns": "puck=New 0005"}, {"puck": 1}),
        ({"bodies": ["*:5mm:10g"], "columns": "b=New_0005,a=cm 1,y=y"}, {"b": 1, "a": 0}),
        ({"bodies": ["*:5mm:10g"], "columns": "a=cm 1,y=Z"}, {"a": 0}),
    ],
)
def test_some_markers_of_motion_capture(tmp_path, options, bodies):
    (tmp_path / "a.tsv").write_text(QUALISYS)
    (done,) = import_all(tmp_path / "a.tsv", tmp_path / "out", picture=False, **options)
    r = done.recording
    assert set(r.ids) == set(bodies)
    for name, k in bodies.items():
        np.testing.assert_allclose(r.xy[:, r.ids.index(name), 0], ALL[:, k, 0], atol=1e-9)
    assert any("are left out" in note for note in done.notes) == (len(bodies) < 2)


@pytest.mark.parametrize("columns", ["puck=New 0006", "a.x=cm 1", "y=w", "t=1"])
def test_columns_that_are_no_markers_are_refused_with_what_works(tmp_path, columns):
    (tmp_path / "a.tsv").write_text(QUALISYS)
    with pytest.raises(InputError, match="BODY=MARKER takes that marker"):
        import_recording(tmp_path / "a.tsv", bodies=["*:5mm:10g"], columns=columns)


def matlab(path, data):
    pytest.importorskip("scipy.io").savemat(path, data)


def matlab_73(path, data):
    """As MATLAB 7.3 writes it: HDF5 behind 512 bytes, axes the other way round."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for key, value in data.items():
            file[key] = np.transpose(np.atleast_2d(value) if np.ndim(value) != 1 else np.asarray(value)[:, None])
    head = bytearray(path.read_bytes())
    head[:38] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64"
    path.write_bytes(head)


def numpy_file(path, data):
    np.savez(path, **data)


def hdf5(path, data):
    with h5py.File(path, "w") as file:
        for key, value in data.items():
            if np.ndim(value):
                file[key] = value
            else:
                file.attrs[key] = value


X, Y = ALL[..., 0], ALL[..., 1]
ARRAYS = {
    "columns.mat": (matlab, {"t": T, "x": X, "y": Y}, 2),
    "rows_a_body.mat": (matlab, {"time": T, "x": X.T, "y": Y.T, "note": "hello"}, 2),
    "structure.mat": (matlab, {"data": {"t": T[:, None], "x": X[:, :1], "y": Y[:, :1]}}, 1),
    "new.mat": (matlab_73, {"t": T, "x": X, "y": Y}, 2),
    "own.npz": (numpy_file, {"t": T, "xy": ALL}, 2),
    "one.npz": (numpy_file, {"t": T, "xy": ALL[:, 0]}, 1),
    "trex_fish0.npz": (
        numpy_file,
        {"frame": np.arange(30.0), "time": T, "X": X[:, 0], "Y": Y[:, 0], "X#wcentroid": X[:, 1], "frame_rate": 50.0},
        1),
    "idtracker.h5": (hdf5, {"trajectories": ALL, "frames_per_second": 50.0, "version": "6.0"}, 2),
}  # fmt: skip


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays(name, tmp_path):
    write, data, bodies = ARRAYS[name]
    write(tmp_path / name, data)
    (r,) = import_recording(tmp_path / name, bodies=["*:5mm:10g"])
    assert len(r.ids) == bodies
    np.testing.assert_allclose(r.t, T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(r.xy, ALL[:, :bodies], rtol=0, atol=1e-12)


def test_where_a_tracker_of_animals_does_not_see(tmp_path):
    x = X[:, 0].copy()
    x[4:6] = math.inf  # as TRex has it
    np.savez(tmp_path / "fish.npz", time=T, X=x, Y=Y[:, 0])
    (r,) = import_recording(tmp_path / "fish.npz", bodies=["*:5mm:10g"])
    assert len(r.t) == 28 and np.isfinite(r.xy).all()


@pytest.mark.parametrize("heading", ["theta (deg)", "Winkel [°]", "Auslenkung in Grad", "ângulo (graus)"])
def test_angles_in_degrees(heading, tmp_path):
    (tmp_path / "a.csv").write_text(table(f"Zeit in s;{heading}", T, np.degrees(TURNED)), encoding="utf-8")
    (r,) = import_recording(tmp_path / "a.csv", bodies=["arm:5mm:10g"])
    np.testing.assert_allclose(r.angle[:, 0], TURNED, atol=1e-14)


def dump(path):
    pd.DataFrame({"t": T, "x": T, "y": T}).to_pickle(path)


def objects(path):
    np.save(path, {"trajectories": ALL}, allow_pickle=True)


REFUSED = {
    "frame.pkl": (dump, "pickle of Python.*not opened.*to_csv"),
    "old.pickle": (lambda p: p.write_bytes(pickle.dumps({"t": [1.0]}, protocol=0)), "pickle of Python"),
    "idtracker.npy": (objects, "Python objects.*not opened.*savez"),
    "phyphox.csv": (
        lambda p: p.write_text(table("Time (s),Acceleration x (m/s^2),Acceleration y (m/s^2)", T, T, T, sign=",")),
        "table of rates alone.*Acceleration x.*film it"),
    "other.json": (
        lambda p: p.write_text('{"fps": 50, "tracks": [{"id": 3, "points": [[1, 2]]}]}'), "holds: fps, tracks"),
    "broken.json": (lambda p: p.write_text('{"t": [1, 2'), "not JSON"),
    "deep.json": (lambda p: p.write_text("[" * 200_000), "nested too deeply|not JSON"),
    "matrix.mat": (lambda p: matlab(p, {"A": np.stack([T, T], axis=1)}), "columns: 1, 2"),
    "text.mat": (lambda p: matlab(p, {"note": "hello"}), "no arrays.*note"),
    "damaged.mat": (lambda p: p.write_bytes(b"MATLAB 5.0 MAT-file" + bytes(range(256)) * 4), "MATLAB file that can"),
    "page.xls": (lambda p: p.write_text("<html><table><tr><td>1</td></tr></table></html>"), "web page"),
    "other.xml": (lambda p: p.write_text('<?xml version="1.0"?><a/>'), "XML"),
    "many.csv": (lambda p: p.write_text("\n".join([",".join("123456789" * 2)] * 9)), "10, 11, 12 ... .18 in all"),
    "runs.csv": (
        lambda p: p.write_text(table("Time (s) Run #1,X (m) Run #1,Time (s) Run #2,X (m) Run #2", *[T] * 4, sign=",")),
        "several runs.*--columns"),
    "two.csv": (lambda p: p.write_text(twice("t,what,x,y", "ab", ALL, ",")), "rows 2 and 3.*--columns body=NAME"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_none_of_these_is_named_in_one_line(name, tmp_path):
    write, message = REFUSED[name]
    write(tmp_path / name)
    with pytest.raises(InputError, match=message) as caught:
        import_recording(tmp_path / name, bodies=["*:5mm:10g"])
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 450


def test_times_are_not_taken_for_frames(tmp_path):
    (tmp_path / "a.csv").write_text(table("t,x,y", T, T, T, sign=","))
    with pytest.raises(InputError, match=r"counts frames, but it holds 0.02"):
        import_recording(tmp_path / "a.csv", bodies=["*:5mm:10g"], fps=50.0)


def rounded_rows(folder, header):
    """Rows of one body, 120 a second, whose stamps have three digits: from a second on some share a time."""
    t = np.arange(180) / 120
    x, y = 0.1 * np.sin(3 * t), 0.02 * np.cos(6 * t)
    (folder / "rounded.csv").write_text(table(header, [f"{v:.2E}" for v in t], x, y, sign=","))
    return folder / "rounded.csv", t, np.stack([x, y], axis=-1)


@pytest.mark.parametrize("header", ["t,x,y", "t,x1,y1", "mass A\nt,x,y"])
def test_stamps_that_are_rounded_are_named_and_can_be_passed_over(header, tmp_path):
    source, t, xy = rounded_rows(tmp_path, header)
    words = r"times are rounded: rows \d+ and \d+ are of one body.*--fps RATE \(about 120\)"
    with pytest.raises(InputError, match=words):
        import_recording(source, bodies=["*:5mm:10g"])
    columns = {"t,x,y": "x=x,y=y", "t,x1,y1": "ball.x=x1,ball.y=y1"}.get(header)
    said = {"bodies": ["*:5mm:10g"], "fps": 120.0, "columns": columns}
    (done,) = import_all(source, tmp_path / "out", picture=False, **said)
    np.testing.assert_allclose(done.recording.t, t, atol=1e-12)
    np.testing.assert_allclose(done.recording.xy[:, 0], xy, atol=1e-12)
    assert any("times in column t are not used" in note for note in done.notes)


def test_times_from_row_to_row_are_summed(tmp_path):
    """A camera that writes how long each frame took: the first row may say nothing, any other has to."""
    steps = ["", *(f"{step:.6f}" for step in np.diff(T))]
    source = tmp_path / "table.csv"
    source.write_text(table("x,y,dt", *ALL[:, 0].T, steps, sign=","), encoding="utf-8")
    done = import_all(source, tmp_path / "out", bodies=["a:1cm:1g"])[0]
    np.testing.assert_allclose(read_recording(tmp_path / "out").t, T - T[0], atol=1e-5)
    assert "dt has times from row to row: their sum is the clock" in done.notes
    steps[4] = ""
    source.write_text(table("x,y,dt", *ALL[:, 0].T, steps, sign=","), encoding="utf-8")
    with pytest.raises(InputError, match="row 6: dt is missing"):
        import_all(source, tmp_path / "other", bodies=["a:1cm:1g"])


def test_bodies_that_are_not_told_apart_are_no_rounded_stamps(tmp_path):
    """Nor where the second is seen for a part of the time only."""
    other = ALL[:, 1].copy()
    rows = [(t, *xy) for k, t in enumerate(T) for xy in (ALL[k, 0], other[k])[: 2 if 5 < k < 20 else 1]]
    (tmp_path / "a.csv").write_text(table("t,x,y", *zip(*rows, strict=True), sign=","))
    with pytest.raises(InputError, match=r"several rows at one time.*--columns body=NAME"):
        import_recording(tmp_path / "a.csv", bodies=["*:5mm:10g"])


def test_a_column_that_counts_frames_is_used_though_it_is_not_named(tmp_path):
    kept = [k for k in range(len(T)) if k not in (4, 5)]
    (tmp_path / "a.csv").write_text(table("t,x,y", [FRAME[k] for k in kept], *ALL[kept, 0].T, sign=","))
    (r,) = import_recording(tmp_path / "a.csv", bodies=["*:5mm:10g"], fps=50.0, columns="x=x,y=y")
    np.testing.assert_allclose(r.t, T[kept], atol=1e-12)


def test_masses_of_tracker_keep_their_order_with_a_frame_rate(tmp_path):
    """The second is marked from the third frame on."""
    lines = ["#multi:", "a,,b,,", "t,x,y,t,x,y"]
    for k in range(12):
        lines.append(f"{k / 120:.2E},{k},0,{(k + 2) / 120:.2E},{k + 2},1")
    (tmp_path / "a.txt").write_text("\n".join(lines))
    (r,) = import_recording(tmp_path / "a.txt", bodies=["*:5mm:10g"], fps=120.0)
    np.testing.assert_allclose(r.t, np.arange(14) / 120, atol=1e-12)
    np.testing.assert_allclose(r.xy[:, 0, 0], [*range(12), np.nan, np.nan])
    np.testing.assert_allclose(r.xy[:, 1, 0], [np.nan, np.nan, *range(2, 14)])


def test_numbers_that_may_be_twenty_or_twenty_thousand_are_asked_for(tmp_path):
    (tmp_path / "a.csv").write_text('t,x,y\n0,"20,000",1\n1,"21,000",1\n2,"22,000",1\n')
    with pytest.raises(InputError, match="--decimal"):
        import_recording(tmp_path / "a.csv", bodies=["*:5mm:10g"])
    (r,) = import_recording(tmp_path / "a.csv", bodies=["*:5mm:10g"], decimal=",")
    np.testing.assert_array_equal(r.xy[:, 0, 0], [20, 21, 22])


def test_rows_without_a_clock_are_said_to_be_frames(tmp_path):
    np.save(tmp_path / "a.npy", ALL)
    with pytest.raises(InputError, match="--fps"):
        import_recording(tmp_path / "a.npy", bodies=["*:5mm:10g"])
    (done,) = import_all(tmp_path / "a.npy", tmp_path / "out", bodies=["*:5mm:10g"], fps=50.0, picture=False)
    np.testing.assert_allclose(done.recording.t, T, atol=1e-12)
    assert any("each row is taken for the next frame" in note for note in done.notes)


def test_headings():
    assert words("Track n°") == ["track"] and words("posição X [cm]") == ["posicao", "x"]
    header = ["t", "v_x (m/s)", "center_x", "Acceleration y"]
    assert find_columns(header, {}) == {"t": "t", "x": "center_x"}
    assert find_columns(["time", "frame", "id", "x"], {"t": "frame"}) == {"t": "frame", "body": "id", "x": "x"}
