"""Large, deep, endless and strange input: a clear line within seconds, or it simply works."""

import io
import os
import time
import warnings
import zipfile
from contextlib import contextmanager

import numpy as np
import pytest

from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.limits import LONGEST_TITLE, MOST_BODIES, read_arrays
from granswim_pymunk.recording import Recording, read_recording
from granswim_pymunk.recording.importers import import_recording
from granswim_pymunk.scene import Body, Scene, SceneWarning, read_inputs, read_scene, use
from granswim_pymunk.touching import overlapping

HEAD = 'format = "granswim-recording/2"\nsampling = 10.0\n'
BODY = '[[body]]\nid = "a"\nrole = "free"\nradius = 0.02\nmass = 0.3\ninitial = [0.0, 0.2, 0.0, 0.0]\n'
MOVING = "t,body,x,y\n" + "".join(f"{k / 10},a,{0.1 * k},0.2\n" for k in range(6))


@contextmanager
def within(seconds):
    began = time.perf_counter()
    yield
    assert time.perf_counter() - began < seconds


def folder_of(path, toml=HEAD + BODY, tracks=MOVING, **more):
    folder = path / "r"
    folder.mkdir()
    for name, content in {"recording_toml": toml, "tracks_csv": tracks, **more}.items():
        if content is not None:
            data = content.encode() if isinstance(content, str) else content
            (folder / name.replace("_", ".")).write_bytes(data)
    return folder


def refused(path, message):
    with within(10), pytest.raises(InputError) as caught:
        read_recording(path)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def rows_of(count):
    """A square of grains that leave each other room."""
    k = np.arange(count)
    return np.stack([0.03 * (k // 200), 0.03 * (k % 200)], axis=-1)


class TestMany:
    def many(self, path, count, more=""):
        listed = "id,role,radius,mass,observed\n" + "".join(f"g{k},grain,0.01,0.01,true\n" for k in range(count)) + more
        law = '[[law]]\nname = "contact_linear"\nstiffness = 100.0\ndamping = 1.0\n'
        buffer = io.BytesIO()
        names = np.array([f"g{k}" for k in range(count)])
        np.savez(buffer, t=np.arange(3) / 10, body=names, xy=np.repeat(rows_of(count)[None], 3, axis=0))
        return folder_of(
            path, HEAD + 'bodies = "bodies.csv"\n' + law, None, bodies_csv=listed, tracks_npz=buffer.getvalue()
        )

    def test_twenty_thousand_bodies_are_read_in_time_that_grows_with_their_number(self, tmp_path):
        spent = []
        for count in (5_000, 20_000):
            (tmp_path / str(count)).mkdir()
            folder = self.many(tmp_path / str(count), count)
            began = time.perf_counter()
            r = read_recording(folder)
            spent.append(time.perf_counter() - began)
            assert r.xy.shape == (3, count, 2)
        # four times the bodies; the square would be sixteen times
        assert spent[1] < 9 * spent[0] + 0.5

    def test_a_doubled_id_at_the_end_of_many(self, tmp_path):
        refused(self.many(tmp_path, 60_000, "g59999,grain,0.01,0.01,true\n"), "body g59999: this id is used twice")

    def test_more_bodies_than_can_be_computed(self, tmp_path):
        folder = folder_of(tmp_path, HEAD + 'bodies = "bodies.csv"\n')
        (folder / "bodies.csv").write_text("id,role,radius,mass\n" + "g,grain,1,1\n" * (MOST_BODIES + 1))
        refused(folder, f"bodies.csv: has more than {MOST_BODIES} bodies")
        with pytest.raises(InputError, match=f"has {MOST_BODIES + 1} bodies"):
            Scene((Body("a", "free", 1.0, 1.0),) * (MOST_BODIES + 1))

    @pytest.mark.parametrize(("disks", "says"), [
        ("1000000000", "has 1000000000 bodies"), ("0", "disks should be"), ("2.5", "disks should be"),
        ('"7"', "disks should be"),
    ])  # fmt: skip
    def test_a_swimmer_of_a_billion_disks(self, tmp_path, disks, says):
        (tmp_path / "scene.toml").write_text(f"[swimmer]\ndisks = {disks}\n")
        with within(5), pytest.raises(InputError, match=says):
            read_scene(tmp_path / "scene.toml")

    @pytest.mark.parametrize("line", ["head = []", "head = [1]", "radius = 1e-300", "radius = -1", 'density = "iron"'])
    def test_a_swimmer_that_cannot_be(self, tmp_path, line):
        (tmp_path / "scene.toml").write_text(f"[swimmer]\n{line}\n")
        with pytest.raises(InputError, match="swimmer"):
            read_scene(tmp_path / "scene.toml")


class TestOverlapping:
    def test_all_pairs_and_each_once(self):
        rng = np.random.default_rng(0)
        for _ in range(60):
            n, period = int(rng.integers(1, 50)), 1.0 if rng.random() < 0.5 else None
            xy, radius = rng.random((n, 2)), np.minimum(10 ** rng.uniform(-3, rng.choice([-2.9, -0.3]), n), 0.24)
            away = xy[:, None] - xy[None]
            if period:
                away[..., 0] -= np.round(away[..., 0])
            near = np.hypot(away[..., 0], away[..., 1]) < radius[:, None] + radius
            expected = {(i, j) for i, j in np.argwhere(near).tolist() if i < j}
            found = list(overlapping(xy, radius, period))
            assert set(found) == expected and len(found) == len(expected)

    def test_one_large_disk_among_many_small_ones(self):
        n = 50_000
        bodies = [Body(str(k), "free", 1e-4, 1e-4, initial=(*p, 0.0, 0.0)) for k, p in enumerate(rows_of(n).tolist())]
        large = Body("large", "wall", 8.0, 1.0, initial=(-8.1, 3.0, 0.0, 0.0))
        with within(10):
            Scene((*bodies, large), (use("contact_linear", stiffness=1.0),)).check_overlaps()

    def test_many_at_one_place(self):
        bodies = tuple(Body(str(k), "free", 1e-3, 1e-3, initial=(0.0, 0.0, 0.0, 0.0)) for k in range(30_000))
        with within(10), pytest.raises(InputError, match="overlaps body"):
            Scene(bodies, (use("contact_linear", stiffness=1.0),)).check_overlaps()


class TestDeep:
    @pytest.mark.parametrize(
        ("toml", "says"),
        [
            ("a" + ".a" * 100_000 + " = 1\n", "line 1: has a key of more than 50 parts"),
            ("[" + "a. " * 100_000 + "a]\n", "line 1: has a key of more than 50 parts"),
            ("x = {" + '"a".' * 100_000 + "a = 1}\n", "line 1: has a key of more than 50 parts"),
            ("camera = " + "[" * 100_000 + "]" * 100_000, "not valid TOML"),
            ("camera = " + "{x=" * 100_000 + "1" + "}" * 100_000, "not valid TOML"),
            ("camera = " + "{x=" * 60 + "1" + "}" * 60, "camera: is nested deeper than 50"),
            ("".join(f"[{'.'.join('a' * k)}]\n" for k in range(1, 50)) + "b" + ".b" * 20 + " = 1\n", "nested deeper"),
        ],
    )
    def test_nested_too_deep(self, tmp_path, toml, says):
        refused(folder_of(tmp_path, toml), says)

    def test_a_text_full_of_dots_is_no_key(self, tmp_path):
        numbers = ", ".join(["0.5"] * 300)
        toml = f'title = "{"a." * 300}" # {"x." * 300}\n' + HEAD + BODY + f"[camera]\nlist = [{numbers}]\n"
        read_recording(folder_of(tmp_path, toml.replace(f'# {"x." * 300}', "# and so on ......")))

    def test_a_file_of_many_megabytes(self, tmp_path):
        folder = folder_of(tmp_path)
        with (folder / "recording.toml").open("ab") as handle:
            handle.truncate(40_000_000)
        refused(folder, "recording.toml: has 40 MB; at most 20 MB are read")


class TestNoFile:
    """What is no ordinary file is never opened: a pipe would be waited for, a device has no end."""

    @pytest.fixture(params=["pipe", "device", "folder"])
    def strange(self, request, tmp_path):
        if request.param == "device":
            return "/dev/zero"
        path = tmp_path / "strange"
        os.mkfifo(path) if request.param == "pipe" else path.mkdir()
        return str(path)

    @pytest.mark.parametrize("key", ["bodies", "input"])
    def test_named_in_the_toml(self, tmp_path, strange, key):
        toml = HEAD + (f'{key} = "{strange}"\n') + BODY
        refused(folder_of(tmp_path, toml), f"{strange}: ")

    @pytest.mark.parametrize("name", ["recording.toml", "tracks.csv", "tracks.npz", "input.csv", "curve.csv"])
    def test_in_the_place_of_a_file(self, tmp_path, strange, name):
        folder = folder_of(tmp_path, tracks=None if name.startswith("tracks") else MOVING)
        (folder / name).unlink(missing_ok=True)
        (folder / name).symlink_to(strange)
        refused(folder, f"{name}: ")

    def test_a_name_with_a_zero_byte(self, tmp_path):
        refused(folder_of(tmp_path, HEAD + 'bodies = "a\\u0000b"\n' + BODY), "cannot be the name of a file")


def archive(**members):
    """An archive whose members claim other contents than they have, or very much of it."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as zipped:
        for name, content in members.items():
            zipped.writestr(f"{name}.npy", content)
    return buffer.getvalue()


def header(shape, dtype="<f8"):
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": dtype, "fortran_order": False, "shape": shape})
    return buffer.getvalue()


class TestArchives:
    def test_what_unpacks_to_far_more_is_not_unpacked(self, tmp_path, monkeypatch):
        monkeypatch.setattr("granswim_pymunk.limits.LARGEST_ARRAYS", 50_000_000)
        zeros = bytes(4_000_000)
        path = tmp_path / "tracks.npz"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as zipped:
            with zipped.open("xy.npy", "w") as member:
                member.write(header((8_000_000,)))
                for _ in range(16):
                    member.write(zeros)
        assert path.stat().st_size < 1_000_000
        with within(1), pytest.raises(InputError, match="unpacks to 64 MB; at most 50 MB are read"):
            read_arrays(path)
        assert read_arrays(path, ("t",)) == {}

    @pytest.mark.parametrize("shape", [(10**12,), (10**6, 10**6), (2**40, 2**40)])
    def test_a_header_that_promises_more_than_there_is(self, tmp_path, shape):
        (tmp_path / "a.npz").write_bytes(archive(xy=header(shape) + bytes(80)))
        with within(5), pytest.raises(InputError, match="unpacks to"):
            read_arrays(tmp_path / "a.npz")

    @pytest.mark.parametrize(
        "content", [b"", b"\x93NUMPY", b"\x93NUMPY\x09\x00junk", header((2,)), b"text", header((-1,))]
    )
    def test_members_that_are_no_arrays(self, tmp_path, content):
        (tmp_path / "a.npz").write_bytes(archive(xy=content))
        try:
            assert all(a.dtype.kind != "O" for a in read_arrays(tmp_path / "a.npz").values())
        except InputError as error:
            assert "is not an NPZ of plain arrays" in str(error)

    def test_a_good_one(self, tmp_path):
        np.savez_compressed(tmp_path / "a.npz", t=np.arange(3.0), names=np.array(["a", "b"]), other=np.zeros(2))
        read = read_arrays(tmp_path / "a.npz", ("t", "names", "absent"))
        assert set(read) == {"t", "names"} and read["names"].tolist() == ["a", "b"]


class TestTexts:
    """Byte order marks, control characters, long names."""

    def test_byte_order_marks_of_other_programs_are_taken(self, tmp_path):
        toml = HEAD + 'bodies = "bodies.csv"\n'
        listed = "id,role,radius,mass,observed\na,free,0.02,0.3,true\n"
        more = {"bodies_csv": "\ufeff" + listed, "input_csv": "\ufefft,name,value\n0,a,1\n1,a,2\n"}
        r = read_recording(folder_of(tmp_path, "\ufeff" + toml, "\ufeff" + MOVING, **more))
        assert r.ids == ("a",) and r.scene.inputs == {"a": ((0.0, 1.0), (1.0, 2.0))} and r.notes == ()

    def test_a_title_is_one_line_that_can_be_printed(self, tmp_path):
        toml = 'title = "a\\u0000b\\nc\\u001bd"\n' + HEAD + BODY
        r = read_recording(folder_of(tmp_path, toml))
        assert r.title == r.scene.title == "a b c d"
        assert len(Scene((Body("a", "free", 1.0, 1.0),), title="x" * 10_000).title) == LONGEST_TITLE

    @pytest.mark.parametrize(("name", "says"), [
        ("\\u0000", "cannot be printed"), ("a\\u001b[2J", "cannot be printed"), ("", "id is empty"),
        ("x" * 201, "has 201 characters"),
    ])  # fmt: skip
    def test_ids_that_no_file_or_page_can_show(self, tmp_path, name, says):
        refused(folder_of(tmp_path, HEAD + BODY.replace('"a"', f'"{name}"')), says)

    def test_a_seed_beyond_what_files_hold(self, tmp_path):
        refused(folder_of(tmp_path, f"seed = {2**64}\n" + HEAD + BODY), "seed: should be a whole number from 0 to")


class TestInput:
    def test_a_name_that_is_no_body_is_said(self, tmp_path):
        folder = folder_of(tmp_path, input_csv="t,name,value\n0,coil,1\n0,a,3\n1,coil,2\n1,a,3\n")
        with pytest.warns(SceneWarning, match=r"input.csv: input coil is the name of no body"):
            r = read_recording(folder)
        assert set(r.scene.inputs) == {"a"} and "input coil" in r.notes[0]

    def test_in_a_scene_to_be_run_it_is_refused(self, tmp_path):
        (tmp_path / "scene.toml").write_text(BODY + "[input.coil]\nt = [0.0]\nvalue = [1.0]\n")
        with pytest.raises(InputError, match=r"scene.toml: input coil: is the name of no body"):
            read_scene(tmp_path / "scene.toml")

    @pytest.mark.parametrize("table", [
        "t = [0.0, 1.0]\nvalue = [1.0]", "t = [1.0, 0.0]\nvalue = [1.0, 2.0]", "t = []\nvalue = []", "t = 3\nvalue = 4",
        "t = [nan]\nvalue = [1.0]", 't = ["x"]\nvalue = [1.0]',
    ])  # fmt: skip
    def test_commands_in_the_toml(self, tmp_path, table):
        (tmp_path / "scene.toml").write_text(BODY + f"[input.a]\n{table}\n")
        with pytest.raises(InputError, match=r"input.a"):
            read_scene(tmp_path / "scene.toml")

    @pytest.mark.parametrize("key", ["camera", "frames", "input", "time", "scene", "swimmer"])
    def test_tables_that_are_none(self, tmp_path, key):
        (tmp_path / "scene.toml").write_text(f"{key} = 3\n" + BODY)
        with pytest.raises(InputError, match=f"{key}: should be a table"):
            read_scene(tmp_path / "scene.toml")

    def test_a_table_of_commands_that_is_a_pipe(self, tmp_path):
        os.mkfifo(tmp_path / "input.csv")
        with within(5), pytest.raises(InputError, match="no ordinary file"):
            read_inputs(tmp_path / "input.csv")


class TestImportOptions:
    @pytest.mark.parametrize("option", ["--position-noise", "--angle-noise", "--sampling", "--flip-y", "--fps"])
    @pytest.mark.parametrize("value", ["-1", "nan", "inf"])
    def test_numbers_that_are_none(self, tmp_path, option, value, capsys):
        if (option, value) == ("--flip-y", "-1"):
            return  # a height below zero is a shift
        table = tmp_path / "table.csv"
        table.write_text(MOVING)
        given = ["import", str(table), "--format", "long", "--out", str(tmp_path / "out"), "--body", "a:0.02:0.3"]
        assert main([*given, f"{option}={value}"]) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and option.strip("-").replace("-", "_") in err.replace("-", "_")
        assert not (tmp_path / "out").exists()

    def test_a_device_is_no_table(self):
        with within(5), pytest.raises(InputError, match="no ordinary file"):
            import_recording("/dev/zero", "long", bodies=["a:0.02:0.3"])


def test_nothing_is_said_of_a_good_recording(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert isinstance(read_recording(folder_of(tmp_path)), Recording)
