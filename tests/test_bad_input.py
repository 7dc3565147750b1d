"""Wrong recordings: one clear line each, exit code 2, nothing half-written; honest ones pass."""

import importlib.util
import io
import math
import warnings
from dataclasses import replace
from functools import cache
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.recording import Recording, film, read_recording, resolve_recording, shipped_names
from granswim_pymunk.recording.plausible import check_plausible
from granswim_pymunk.scene import Body, Scene, SceneWarning, Time, swimmer, use

TOML = """format = "granswim-recording/1"
title = "two disks"
sampling = 10.0
position_noise = 1e-4
[scene]
gravity = [0.0, 0.0]
[[body]]
id = "a"
role = "free"
radius = 0.02
mass = 0.01
initial = [0.1, 0.2, 0.1, 0.0]
[[body]]
id = "b"
role = "free"
radius = 0.02
mass = 0.01
[[law]]
name = "contact_linear"
stiffness = 100.0
damping = 1.0
[[adjustable]]
law = "contact_linear"
parameter = "stiffness"
low = 50.0
high = 200.0
"""
ROWS = [
    f"{0.1 * k:.1f},{body},{x + 0.01 * k:.3f},0.2" for k in range(8) for body, x in (("a", 0.1), ("b", 0.3))
]
CSV = "\n".join(["t,body,x,y", *ROWS, ""])


def rows(*changes):
    """tracks.csv with rows replaced, ``(number, text)``; rows count from 2, as the header is row 1."""
    lines = CSV.splitlines()
    for number, text in changes:
        lines[number - 1] = text
    return "\n".join(lines) + "\n"


def folder_of(path, toml=TOML, tracks=CSV, **more):
    folder = path / "recording"
    folder.mkdir()
    for name, content in {"recording.toml": toml, "tracks.csv": tracks, **more}.items():
        if content is not None:
            data = content.encode() if isinstance(content, str) else content
            (folder / name.replace("_", ".")).write_bytes(data)
    return folder


def npz(**arrays):
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


GOOD_NPZ = {
    "t": np.arange(3) / 10,
    "body": np.array(["a", "b"]),
    "xy": np.array([[[0.1, 0.2], [0.3, 0.2]]] * 3),
}
LONG_NPZ = {**GOOD_NPZ, "t": np.arange(10) / 10, "xy": np.array([[[0.1, 0.2], [0.3, 0.2]]] * 10)}

# name: (files, what the line says)
BAD = {
    "missing toml": ({"toml": None}, "recording.toml: cannot read it"),
    "missing tracks": ({"tracks": None}, "neither tracks.csv"),
    "both tracks": ({"tracks_npz": npz(**GOOD_NPZ)}, "both tracks.csv and tracks.npz"),
    "unknown law": (
        {"toml": TOML.replace("contact_linear", "contact_quantum")},
        "unknown law 'contact_quantum'",
    ),
    "negative radius": ({"toml": TOML.replace("0.02", "-0.02", 1)}, "radius should be above zero"),
    "negative mass": ({"toml": TOML.replace("mass = 0.01", "mass = -1.0", 1)}, "mass should be above zero"),
    "unknown role": ({"toml": TOML.replace('"free"', '"snake"', 1)}, "role should be one of"),
    "id twice": ({"toml": TOML.replace('"b"', '"a"')}, "used twice"),
    "no body": ({"toml": 'format = "granswim-recording/1"\n'}, "has no bodies"),
    "another format": (
        {"toml": TOML.replace("recording/1", "recording/9")},
        "should be 'granswim-recording/1'",
    ),
    "not TOML": ({"toml": TOML + "[[["}, "not valid TOML"),
    "integer of 400 digits": ({"toml": TOML.replace("mass = 0.01", "mass = 1" + 400 * "0", 1)}, "absurdly large"),
    "integer of 5000 digits": ({"toml": TOML.replace("mass = 0.01", "mass = " + 5000 * "9", 1)}, "thousands of digits"),
    "hexadecimal id": ({"toml": TOML.replace('id = "b"', "id = 0x" + 5000 * "F", 1)}, "body.id: is absurdly large"),
    "negative noise": (
        {"toml": TOML.replace("1e-4", "-1e-4")},
        "position_noise: should be a number, not below zero",
    ),
    "sampling zero": (
        {"toml": TOML.replace("sampling = 10.0", "sampling = 0")},
        "sampling: should be above zero",
    ),
    "NaN": ({"tracks": rows((5, "0.1,b,nan,0.2"))}, "row 5: x is not finite"),
    "infinite": ({"tracks": rows((5, "0.1,b,0.3,-inf"))}, "row 5: y is not finite"),
    "NaN time": ({"tracks": rows((5, "nan,b,0.3,0.2"))}, "row 5: t is not finite"),
    "one coordinate": ({"tracks": rows((5, "0.1,b,0.3,"))}, "row 5: has one coordinate only"),
    "nothing measured": ({"tracks": rows((5, "0.1,b,,"))}, "row 5: has neither position nor angle"),
    "not a number": ({"tracks": rows((7, "0.2,b,left,0.2"))}, "row 7: x should be a number, got 'left'"),
    "absurd position": ({"tracks": rows((7, "0.2,b,1e300,0.2"))}, "row 7: x = 1e+300 is absurdly large"),
    "two rows": (
        {"tracks": CSV + "0.2,b,0.3,0.2\n"},
        "row 18: two rows for body b at t = 0.2 s (the other is row 7)",
    ),
    "unknown body": ({"tracks": rows((4, "0.1,c,0.3,0.2"))}, "row 4: body 'c' is not in recording.toml"),
    "truncated row": ({"tracks": rows((17, "0.7,b,0.3"))}, "row 17: expected 4 columns (t,body,x,y), got 3"),
    "no header": ({"tracks": "\n".join(ROWS)}, "needs the columns t,body,x,y"),
    "header only": ({"tracks": "t,body,x,y\n"}, "is empty: it has no rows"),
    "empty file": ({"tracks": ""}, "needs the columns"),
    "not UTF-8": ({"tracks": CSV.encode() + b"0.9,b,\xff\xfe,0\n"}, "not a CSV in UTF-8"),
    "binary": ({"tracks": bytes(range(256)) * 10}, "tracks.csv"),
    "overlapping starts": (
        {
            "toml": TOML.replace(
                "mass = 0.01\n[[law]]", "mass = 0.01\ninitial = [0.11, 0.2, 0.0, 0.0]\n[[law]]"
            )
        },
        "overlaps body",
    ),
    "overlapping tracks": (
        {"tracks": rows((3, "0.0,b,0.11,0.2"))},
        "overlaps body b by 0.03 m in the first frame",
    ),
    "tracks in mm": (
        {"tracks": "t,body,x,y\n0,a,100,200\n0,b,300,200\n0.1,a,110,200\n0.1,b,310,200\n"},
        "in mm?",
    ),
    "radius in mm": ({"toml": TOML.replace("0.02", "20", 1)}, "is the radius in mm?"),
    "times in ms": (
        {"tracks": "t,body,x,y\n" + "".join(f"{100 * k},a,0.1,0.2\n" for k in range(5))},
        "is t in ms, or a frame number?",
    ),
    "frame numbers": (
        {
            "toml": TOML.replace("10.0", "500.0", 1),
            "tracks": "t,body,x,y\n" + "".join(f"{k},a,0.1,0.2\n" for k in range(5)),
        },
        "is t in ms, or a frame number?",
    ),
    # one wrong stamp made the diagnosis simulate all the time up to it
    "a stray stamp": ({"tracks": rows((15, "1e12,b,0.3,0.2"))}, "row 15: t = 1e+12 s is 1e+12 s after the nearest"),
    "a stray stamp before": ({"tracks": rows((2, "-1e6,a,0.1,0.2"))}, "row 2: t = -1000000 s is 1e+06 s before"),
    "two stray stamps": ({"tracks": rows((14, "1e6,a,0.1,0.2"), (16, "2e6,a,0.1,0.2"))}, "correct the time stamp"),
    "a long gap": (
        {"tracks": rows(*((k, f"{1e6 + k},a,0.1,0.2") for k in range(10, 18)))},
        "row 8: t = 0.3 s is 1e+06 s before the nearest frame (row 10, t = 1000010 s)",
    ),
    "npz a stray stamp": (
        {"tracks": None, "tracks_npz": npz(**{**LONG_NPZ, "t": np.append(np.arange(9) / 10, 1e6)})},
        "frame 9: t = 1000000 s",
    ),
    "input not a number": ({"input_csv": "t,name,value\n0,a,fast\n"}, "input.csv: row 2"),
    "curve below zero": (
        {"curve_csv": "frequency,layers,speed\n-4,0,0.01\n"},
        "row 2: frequency is below zero",
    ),
    "npz not an npz": ({"tracks": None, "tracks_npz": b"PK\x03\x04 nothing"}, "tracks.npz"),
    "npz pickled": (
        {"tracks": None, "tracks_npz": npz(**{**GOOD_NPZ, "body": np.array(["a", None])})},
        "plain arrays",
    ),
    "npz without t": (
        {"tracks": None, "tracks_npz": npz(body=GOOD_NPZ["body"], xy=GOOD_NPZ["xy"])},
        "needs the array t",
    ),
    "npz shape": (
        {"tracks": None, "tracks_npz": npz(**{**GOOD_NPZ, "t": np.arange(4.0)})},
        "expected t (T,)",
    ),
    "npz time twice": (
        {"tracks": None, "tracks_npz": npz(**{**GOOD_NPZ, "t": np.zeros(3)})},
        "two frames at t = 0",
    ),
    "npz unknown body": (
        {"tracks": None, "tracks_npz": npz(**{**GOOD_NPZ, "body": np.array(["a", "z"])})},
        "body 'z'",
    ),
    "npz all NaN": (
        {"tracks": None, "tracks_npz": npz(**{**GOOD_NPZ, "xy": GOOD_NPZ["xy"] * math.nan})},
        "is empty",
    ),
    "npz one coordinate": (
        {"tracks": None, "tracks_npz": npz(**{**GOOD_NPZ, "xy": GOOD_NPZ["xy"] * [1, math.nan]})},
        "xy, frame 0, body a: has one coordinate only",
    ),
    "npz infinite": (
        {"tracks": None, "tracks_npz": npz(**{**GOOD_NPZ, "xy": GOOD_NPZ["xy"] * math.inf})},
        "infinite",
    ),
}


class TestReading:
    def test_the_good_one_is_good(self, tmp_path):
        r = read_recording(folder_of(tmp_path))
        assert r.ids == ("a", "b") and r.xy.shape == (8, 2, 2)

    def test_unsorted_rows_simply_work(self, tmp_path):
        shuffled = np.random.default_rng(0).permutation(ROWS)
        r = read_recording(folder_of(tmp_path, tracks="\n".join(["t,body,x,y", *shuffled])))
        np.testing.assert_allclose(r.xy[:, 0, 0], 0.1 + 0.01 * np.arange(8))

    @pytest.mark.parametrize("name", BAD)
    def test_bad(self, tmp_path, name):
        files, message = BAD[name]
        with pytest.raises(InputError) as caught:
            read_recording(folder_of(tmp_path, **files))
        assert message in str(caught.value) and "\n" not in str(caught.value)

    @pytest.mark.parametrize("path", ["nowhere", "file", "nul\0byte"])
    def test_not_a_folder(self, tmp_path, path):
        (tmp_path / "file").write_text("")
        with pytest.raises(InputError):
            read_recording(str(tmp_path / path))

    @pytest.mark.skipif(
        importlib.util.find_spec("granswim_pymunk.commands.diagnose") is None, reason="diagnose is not there"
    )
    @pytest.mark.parametrize("name", BAD)
    def test_diagnose(self, tmp_path, name, capsys):
        files, message = BAD[name]
        folder = folder_of(tmp_path, **files)
        assert main(["diagnose", str(folder), "--out", str(tmp_path / "out")]) == 2
        err = capsys.readouterr().err
        assert message in err and err.count("\n") == 1 and "Traceback" not in err
        assert [p.name for p in tmp_path.iterdir()] == ["recording"]


class TestImport:
    """The same slips in a table that is to be imported."""

    TABLE = "t,body,x,y\n" + "".join(
        f"{k / 10},{b},{x + k / 100},0.5\n" for k in range(5) for b, x in (("a", 0), ("b", 1))
    )
    LAW = '[[law]]\nname = "contact_linear"\nstiffness = 100.0\n'
    CASES: ClassVar = {
        "missing file": (None, LAW, "a:0.1:1", "no such file"),
        "unknown law": (TABLE, LAW.replace("linear", "quantum"), "a:0.1:1", "unknown law"),
        "negative radius": (TABLE, LAW, "a:-0.1:1", "radius should be above zero"),
        "infinite": (TABLE.replace("0.04", "inf"), LAW, "a:0.1:1", "row 10: x should be a number"),
        "two rows": (TABLE + "0.1,a,3,4\n", LAW, "a:0.1:1", "row 12: two rows for body a"),
        "mixed units": (TABLE, LAW, "a:100:1", "is the radius in mm?"),
        "empty": ("t,body,x,y\n", LAW, "a:0.1:1", "no rows"),
        "overlap": (TABLE.replace("1.0,0.5", "0.05,0.5"), LAW, "a:0.1:1", "overlaps body"),
        "unknown key": (TABLE, "colour = 3\n" + LAW, "a:0.1", "id:radius:mass"),
    }

    @pytest.mark.parametrize("name", CASES)
    def test_one_line_and_nothing_written(self, name, tmp_path, capsys):
        table, scene, body, message = self.CASES[name]
        if table is not None:
            (tmp_path / "table.csv").write_text(table)
        (tmp_path / "scene.toml").write_text(scene)
        before = sorted(tmp_path.iterdir())
        arguments = [
            "import",
            str(tmp_path / "table.csv"),
            "--format",
            "long",
            "--out",
            str(tmp_path / "out"),
        ]
        arguments += ["--scene", str(tmp_path / "scene.toml"), "--body", body, "--body", "b:0.1:1"]
        assert main(arguments) == 2
        err = capsys.readouterr().err
        assert message in err and err.startswith("granswim import: ") and err.count("\n") == 1
        assert sorted(tmp_path.iterdir()) == before

    def test_unsorted_rows_simply_work(self, tmp_path):
        header, *lines = self.TABLE.splitlines()
        (tmp_path / "table.csv").write_text("\n".join([header, *reversed(lines)]))
        assert (
            main(
                [
                    "import",
                    str(tmp_path / "table.csv"),
                    "--format",
                    "long",
                    "--out",
                    str(tmp_path / "out"),
                    "--body",
                    "a:0.1:1",
                    "--body",
                    "b:0.1:1",
                ]
            )
            == 0
        )
        assert read_recording(tmp_path / "out").t.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]


def scaled(r, factor):
    return Recording(r.name, r.scene, r.t, r.ids, r.xy * factor, r.angle, sampling=r.sampling)


def disk(name, *initial, **more):
    return Body(**{"id": name, "role": "free", "radius": 0.02, "mass": 0.02, "initial": initial, **more})


def without_initial(r):
    scene = replace(r.scene, bodies=tuple(replace(b, initial=None) for b in r.scene.bodies))
    return Recording(r.name, scene, r.t, r.ids, r.xy, r.angle, sampling=r.sampling)


@cache
def honest():
    """Filmed scenes in SI, without ``initial``, so that only the tracks speak."""
    times = np.arange(100) / 100
    fall = Scene(
        (disk("a", 0.0, 47.0, 0.0, 0.0, radius=0.05),),
        (use("gravity"), use("linear_drag", c=0.01)),
        gravity=(0.0, -9.81),
        time=Time(dt=1e-3),
    )
    hit = Scene(
        (disk("a", 0.0, 0.0, 0.5, 0.0), disk("b", 0.2, 0.01, -0.5, 0.0)),
        (use("contact_linear", stiffness=1e4),),
        time=Time(dt=1e-5),
    )
    swing = Scene(
        (disk("a", 0.3, -0.4, 0.0, 0.0),),
        (use("gravity"), use("pin", bodies=["a"], anchor=(0, 0), length=0.5)),
        gravity=(0.0, -9.81),
        time=Time(dt=1e-4),
    )
    drive = Scene(
        (disk("a", 0.3, 0.4, 0.0, 0.0),),
        (use("drive", bodies=["a"]),),
        time=Time(dt=1e-3),
        inputs={"a": ((0.0, 0.5, 1.0), (0.1, 0.3, -0.2))},
    )
    worm = Scene(
        tuple(swimmer(head=(0.02, 0.025))),
        (use("union", stiffness=1e3, damping=1e3),),
        periodic_x=0.1,
        time=Time(dt=1e-5),
    )
    return {
        name: without_initial(film(scene, times))
        for name, scene in zip(HONEST, (fall, hit, swing, drive, worm), strict=True)
    }


HONEST = ("fall", "hit", "swing", "drive", "worm")


class TestUnits:
    @pytest.mark.parametrize("name", HONEST)
    def test_honest_tracks_pass(self, name):
        check_plausible(honest()[name])

    # half a metre a second ("hit") in cm is nothing unheard of
    @pytest.mark.parametrize(
        ("name", "factor"), [(n, f) for n in HONEST for f in (100.0, 1000.0) if (n, f) != ("hit", 100.0)]
    )
    def test_tracks_in_mm_or_cm_are_refused(self, name, factor):
        with pytest.raises(InputError, match="units look mixed"):
            check_plausible(scaled(honest()[name], factor))

    @pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "microseconds")])
    def test_a_fall_in_milliseconds_is_refused(self, factor, unit):
        fall = honest()["fall"]
        with pytest.raises(InputError, match=f"are the times in {unit}"):
            check_plausible(replace(fall, t=factor * fall.t, sampling=None))

    def test_degrees_are_refused(self):
        r = honest()["swing"]
        twice = np.concatenate([r.angle, r.angle[::-1], r.angle])
        t = np.arange(len(twice)) / 100
        nowhere = np.full((len(t), 1, 2), np.nan)
        check_plausible(Recording("r", r.scene, t, r.ids, nowhere, twice))
        with pytest.raises(InputError, match="are the angles in degrees"):
            check_plausible(Recording("r", r.scene, t, r.ids, nowhere, np.degrees(twice)))

    def test_a_pendulum_that_goes_over_the_top_passes(self):
        r = honest()["swing"]
        t = np.arange(400) / 100
        turns = np.where(t < 2, 40 * t, 80 + 1.5 * np.sin(10 * (t - 2)))
        check_plausible(Recording("r", r.scene, t, r.ids, np.full((400, 1, 2), np.nan), turns[:, None]))

    def test_a_small_grain_in_a_large_box_and_a_noisy_fast_camera_pass(self):
        rng = np.random.default_rng(0)
        grain = Body("a", "grain", 1e-5, 1e-11)
        t = np.arange(500) / 1e5
        xy = np.array([5.0, 3.0]) + rng.normal(0, 5e-3, (500, 1, 2))
        check_plausible(Recording("r", Scene((grain,), periodic_x=10.0), t, ("a",), xy, sampling=1e5))

    def test_a_rough_calibration_is_no_overlap(self):
        scene = Scene(
            (Body("a", "free", 0.04, 0.01), Body("b", "free", 0.04, 0.01)),
            (use("contact_elastic", restitution=1.0),),
        )
        for distance, good in ((0.066, True), (0.05, False)):
            xy = np.array([[[0, 0], [distance, 0]]] * 2)
            r = Recording("r", scene, [0, 1], ("a", "b"), xy)
            if good:
                check_plausible(r)
            else:
                with pytest.raises(InputError, match="overlaps"):
                    check_plausible(r)

    def test_overlap_across_the_seam(self):
        scene = Scene(
            (Body("a", "free", 0.04, 0.01), Body("b", "free", 0.04, 0.01)),
            (use("contact_linear", stiffness=1.0),),
            periodic_x=1.0,
        )
        with pytest.raises(InputError, match="overlaps"):
            check_plausible(Recording("r", scene, [0], ("a", "b"), np.array([[[0.01, 0.0], [4.99, 0.0]]])))

    def test_a_rate_that_is_off_warns(self):
        r = honest()["fall"]
        with pytest.warns(SceneWarning, match="sampling is 600 Hz"):
            check_plausible(Recording("r", r.scene, r.t, r.ids, r.xy, sampling=600.0))

    def test_shipped_ones_pass(self):
        for name in shipped_names():
            for folder in resolve_recording(name):
                check_plausible(read_recording(folder))


def reads_or_says_why(folder):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", SceneWarning)
        try:
            assert isinstance(read_recording(folder), Recording)
        except InputError as error:
            assert "\n" not in str(error)


cells = st.one_of(
    st.sampled_from(
        ["0", "1e999", "-1e308", "1e-320", "nan", "NaN", "inf", "", " ", "a", "b", "1_0", "0x1p3", "١", "\0"]
    ),
    st.floats().map(repr),
    st.text(max_size=3),
)


class TestFuzz:
    """Whatever stands in the files, reading gives a recording or an InputError."""

    common = settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow])

    @common
    @given(st.integers(0, len(CSV)), st.binary(max_size=8), st.integers(0, 8))
    def test_damaged_tracks(self, tmp_path_factory, at, inserted, removed):
        data = CSV.encode()
        folder = folder_of(tmp_path_factory.mktemp("f"), tracks=data[:at] + inserted + data[at + removed :])
        reads_or_says_why(folder)

    @common
    @given(
        st.lists(st.tuples(cells, st.sampled_from(["a", "b", "a", "b", "c", ""]), cells, cells), max_size=6)
    )
    @example([("1e308", "a", "1", "1"), ("-1e308", "a", "1", "1")])
    @example([("0", "a", "1e9", "1e9"), ("1e-320", "a", "-1e9", "1")])
    def test_absurd_cells(self, tmp_path_factory, table):
        text = "t,body,x,y\n" + "\n".join(",".join(row) for row in table)
        reads_or_says_why(folder_of(tmp_path_factory.mktemp("f"), tracks=text.encode("utf-8", "replace")))

    @common
    @given(st.integers(0, len(TOML)), st.binary(max_size=6), st.integers(0, 12))
    @example(TOML.index("0.02"), b"1e-300", 4)
    @example(TOML.index("0.02"), b"1e99", 4)
    def test_damaged_toml(self, tmp_path_factory, at, inserted, removed):
        data = TOML.encode()
        folder = folder_of(tmp_path_factory.mktemp("f"), toml=data[:at] + inserted + data[at + removed :])
        reads_or_says_why(folder)

    values = st.recursive(
        st.one_of(
            st.integers(-(10**400), 10**400).map(str),
            st.floats().map(lambda v: repr(v)),
            st.sampled_from(
                ["true", '"text"', '"\\u0000"', "1979-05-27", "1e308", "-1", "[]", "{}", "0", '"a"']
            ),
        ),
        lambda inner: st.one_of(
            st.lists(inner, max_size=3).map(lambda v: "[" + ",".join(v) + "]"),
            inner.map(lambda v: "{x = " + v + "}"),
        ),
        max_leaves=4,
    )

    @common
    @given(st.integers(0, 30), values)
    def test_absurd_values(self, tmp_path_factory, number, value):
        lines = TOML.splitlines()
        places = [k for k, line in enumerate(lines) if "=" in line]
        at = places[number % len(places)]
        lines[at] = lines[at].split("=")[0] + "= " + value
        reads_or_says_why(folder_of(tmp_path_factory.mktemp("f"), toml="\n".join(lines)))

    @common
    @given(
        st.sampled_from(
            [
                "bodies",
                "body",
                "law",
                "adjustable",
                "scene",
                "time",
                "input",
                "swimmer",
                "camera",
                "seed",
                "scene.bed",
                "scene.periodic_x",
                "title",
            ]
        ),
        values,
    )
    def test_absurd_tables(self, tmp_path_factory, key, value):
        head = f'{key} = {value}\nformat = "granswim-recording/1"\n'
        toml = (
            head + '[[body]]\nid = "a"\nrole = "free"\nradius = 0.1\nmass = 1.0\n' if key != "body" else head
        )
        reads_or_says_why(folder_of(tmp_path_factory.mktemp("f"), toml=toml, tracks="t,body,x,y\n0,a,1,2\n"))

    @common
    @given(st.data())
    def test_damaged_npz(self, tmp_path_factory, data):
        whole = npz(**GOOD_NPZ)
        at = data.draw(st.integers(0, len(whole)))
        cut = data.draw(st.sampled_from([len(whole), at]))
        inserted = data.draw(st.binary(max_size=4))
        damaged = whole[:at] + inserted + whole[at + len(inserted) : cut]
        reads_or_says_why(folder_of(tmp_path_factory.mktemp("f"), tracks=None, tracks_npz=damaged))

    @common
    @given(
        st.integers(0, 400),
        st.binary(max_size=8),
        st.integers(0, 8),
        st.sampled_from(["input_csv", "curve_csv"]),
    )
    def test_damaged_others(self, tmp_path_factory, at, inserted, removed, file):
        text = {
            "input_csv": b"t,name,value\n0,a,1\n1,a,2\n",
            "curve_csv": b"frequency,layers,speed,n\n4,0,0.1,3\n9,0,0.2,3\n",
        }
        data = text[file]
        at %= len(data)
        folder = folder_of(
            tmp_path_factory.mktemp("f"), **{file: data[:at] + inserted + data[at + removed :]}
        )
        reads_or_says_why(folder)


def test_what_hours_of_nonsense_found(tmp_path, capsys):
    """Each ended in a traceback: cases of ``granswim_pymunk.benchmarks.fuzz``, and a diagnosis of its whole ones."""
    from granswim_pymunk.benchmarks.fuzz import KINDS, fuzz

    for case in (263, 314, 413, 598, 839, 1445, 2117, 2663, 2714, 4469, 6323, 6741, 8529, 9575):
        found = fuzz(1, tmp_path, kinds=tuple(KINDS), first=case)
        assert found.tried == 1 and not found.failures, found.failures


def test_a_coordinate_that_moves_by_less_than_its_decimals_was_not_measured():
    t = np.arange(0.0, 0.8, 0.02)
    xy = np.stack([np.zeros_like(t), 2.0 - 4.905 * t**2], axis=-1)[:, None]
    xy[7, 0, 0] = 1e-300
    scene = Scene((Body("ball", "free", 0.03, 0.06),), gravity=(0.0, -9.81))
    case = prepare(Recording("fall", scene, t, ("ball",), xy), held_out=False, split=False)
    assert [c.kind for c in case.channels] == ["y"]
