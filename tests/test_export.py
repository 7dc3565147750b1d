"""Exports are opened with the programs' own libraries, and hold what the run holds."""

import json
import warnings

import numpy as np
import pytest

from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.export import EXPORTERS, export, open_frames, table_of
from granswim_pymunk.recording import Recording, shipped, write_recording
from granswim_pymunk.recording.importers import import_recording
from granswim_pymunk.run import run_scene
from granswim_pymunk.scene import Body, Scene, use
from granswim_pymunk.trajectory import read_trajectory


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Two balls in a periodic box; one leaves it on the right and comes in on the left."""
    scene = Scene(
        bodies=(
            Body("left one", "free", radius=0.01, mass=0.1, initial=(0.05, 0.03, 0.5, 0.1)),
            Body("b", "grain", radius=0.02, mass=0.3, initial=(0.17, 0.06, -0.2, 0.0)),
        ),
        laws=(use("linear_drag", c=0.05),),
        periodic_x=0.2,
        title="two balls",
    )
    folder = tmp_path_factory.mktemp("runs") / "balls"
    run_scene(scene, folder, duration=0.5, frames=11, video="none", quiet=True)
    return folder


@pytest.fixture(scope="module")
def truth(run):
    return read_trajectory(run / "trajectory.h5")


def test_gsd(run, truth, tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    path = export(run, "gsd", tmp_path)
    assert path == tmp_path / "balls.gsd"
    with hoomd.open(str(path), "r") as file:
        assert len(file) == len(truth)
        last = file[-1]
        box = last.configuration.box
        assert box[0] == pytest.approx(0.2) and last.configuration.dimensions == 2
        assert np.abs(last.particles.position[:, :2]).max() <= max(box[:2]) / 2
        x = last.particles.position[:, 0] + last.particles.image[:, 0] * box[0] + last.log["origin"][0]
        np.testing.assert_allclose(x, truth.xy[-1, :, 0], atol=1e-7)
        np.testing.assert_allclose(last.particles.velocity[:, :2], truth.v[-1], rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(last.particles.diameter, [0.02, 0.04], rtol=1e-6)
        assert [last.particles.types[k] for k in last.particles.typeid] == ["free", "grain"]
        assert last.log["time"][0] == truth.t[-1]


def test_gsd_and_h5md_in_mdanalysis(run, truth, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mda = pytest.importorskip("MDAnalysis")
        path = export(run, "h5md", tmp_path)
        universe = mda.Universe.empty(2, trajectory=False)
        universe.load_new(str(path))
        assert universe.trajectory.n_frames == len(truth)
        universe.trajectory[-1]
        # angstrom and picoseconds are what it knows
        np.testing.assert_allclose(universe.atoms.positions[:, 1] * 1e-10, truth.xy[-1, :, 1], rtol=1e-6)
        np.testing.assert_allclose(universe.atoms.positions[:, 0] * 1e-10, truth.xy[-1, :, 0] % 0.2, rtol=1e-5)
        assert universe.trajectory.time * 1e-12 == pytest.approx(truth.t[-1])
        assert universe.dimensions[0] * 1e-10 == pytest.approx(0.2) and universe.dimensions[2] > 0
        universe.trajectory.close()
        path = export(run, "gsd", tmp_path)
        universe = mda.Universe(str(path))
        assert universe.trajectory.n_frames == len(truth) and universe.atoms.n_atoms == 2
        np.testing.assert_allclose(universe.atoms.masses, truth.mass, rtol=1e-6)
        universe.trajectory.close()


def test_extended_xyz_in_ase(run, truth, tmp_path):
    io = pytest.importorskip("ase.io")
    frames = io.read(export(run, "xyz", tmp_path), index=":", format="extxyz")
    assert len(frames) == len(truth)
    np.testing.assert_allclose(frames[-1].positions[:, 1], truth.xy[-1, :, 1], rtol=1e-14)
    np.testing.assert_allclose(frames[-1].positions[:, 0], truth.xy[-1, :, 0] % 0.2, rtol=1e-12)
    assert frames[-1].info["Time"] == truth.t[-1] and frames[0].get_chemical_symbols() == ["F", "Ga"]
    np.testing.assert_array_equal(frames[0].arrays["radius"], truth.radius)
    assert frames[0].pbc.tolist() == [True, False, False] and frames[0].cell[0, 0] == 0.2


def test_tables_in_pandas(run, truth, tmp_path):
    pd = pytest.importorskip("pandas")
    read = [pd.read_csv(export(run, "csv", tmp_path))]
    pytest.importorskip("pyarrow")
    read.append(pd.read_parquet(export(run, "parquet", tmp_path)))
    for table in read:
        own = table[table.body == "left one"]
        np.testing.assert_allclose(own[["x", "y"]], truth.xy[:, 0], rtol=1e-15)
        np.testing.assert_allclose(own[["vx", "vy"]], truth.v[:, 0], rtol=1e-15)
        assert len(table) == 2 * len(truth) and set(table.role) == {"free", "grain"}
    assert table_of(open_frames(run)).attrs["units"]["contact_force"] == "N"


def test_frames_in_vtk(run, truth, tmp_path):
    vtk = pytest.importorskip("vtk")
    from vtk.util.numpy_support import vtk_to_numpy

    path = export(run, "vtk", tmp_path, every=2)
    text = path.read_text()
    files = sorted((tmp_path / "balls_frames").glob("*.vtp"))
    assert len(files) == (len(truth) + 1) // 2 == text.count("<DataSet ")
    assert f'timestep="{truth.t[2]!r}"'.replace("np.float64(", "").replace(")", "") in text
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(str(files[1]))
    reader.Update()
    data = reader.GetOutput()
    np.testing.assert_allclose(vtk_to_numpy(data.GetPoints().GetData())[:, 1], truth.xy[2, :, 1], rtol=1e-14)
    np.testing.assert_array_equal(vtk_to_numpy(data.GetPointData().GetArray("radius")), truth.radius)
    np.testing.assert_array_equal(vtk_to_numpy(data.GetPointData().GetArray("velocity"))[:, :2], truth.v[2])


@pytest.mark.parametrize("to", ["gsd", "xyz", "csv", "parquet", "h5md"])
def test_what_was_exported_can_be_imported(to, run, truth, tmp_path):
    file = export(run, to, tmp_path)
    more = {} if to in ("gsd", "xyz", "h5md") else {"bodies": ["*:1cm:1kg"]}
    (r,) = import_recording(file, **more)
    xy = r.unwrapped().xy
    xy = xy + np.round((truth.xy[0] - xy[0]) / 0.2) * [0.2, 0.0]
    np.testing.assert_allclose(xy, truth.xy, atol=1e-7 if to == "gsd" else 1e-14)
    np.testing.assert_allclose(r.t, truth.t, rtol=1e-12)
    if not more:
        assert r.scene.periodic_x == pytest.approx(0.2)
        np.testing.assert_allclose([b.radius for b in r.scene.bodies], truth.radius, rtol=1e-6)


def test_recordings_too_and_a_body_that_is_not_seen_is_left_out(tmp_path):
    scene = Scene(bodies=tuple(Body(n, "free", radius=0.1, mass=1.0) for n in "ab"))
    xy = np.arange(24.0).reshape(6, 2, 2)
    xy[3, 1] = np.nan
    recording = Recording(name="r", scene=scene, t=np.arange(6) / 10, ids=("a", "b"), xy=xy)
    write_recording(recording, tmp_path / "r")
    assert len(export(tmp_path / "r", "csv", tmp_path).read_text().splitlines()) == 12
    lines = export(tmp_path / "r", "xyz", tmp_path).read_text().splitlines()
    assert [int(line) for line in lines if line.isdigit()] == [2, 2, 2, 1, 2, 2]
    for to in ("gsd", "h5md"):
        with pytest.raises(InputError, match="cannot say that a body is not seen"):
            export(tmp_path / "r", to, tmp_path)
    with pytest.raises(InputError, match="angles only"):
        export(shipped("pendulum"), "gsd", tmp_path)
    assert {p.suffix for p in tmp_path.iterdir()} == {"", ".csv", ".xyz"}


def test_the_command(run, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["export", str(run), "--to", "csv"]) == 0
    assert capsys.readouterr().out == "out/export-balls.csv\n"
    assert (tmp_path / "out/export-balls.csv").stat().st_size > 100
    for arguments, message in (
        (["nothing", "--to", "csv"], "no such folder"),
        ([str(run), "--to", "csv", "--every", "0"], "one or more"),
        ([str(run), "--to", "csv", "--out", "no/where.csv"], "its folder does not exist"),
        (["falling_balls", "--to", "csv"], "several recordings"),
        ([str(tmp_path), "--to", "csv"], "neither"),
    ):
        assert main(["export", *arguments]) == 2
        said = capsys.readouterr().err
        assert message in said and said.count("\n") == 1, said
    assert json.loads(json.dumps(sorted(EXPORTERS))) == ["csv", "gsd", "h5md", "parquet", "vtk", "xyz"]
