"""Sweeps: labelled arrays, resumed by hash, on any executor; failures are rows of the table."""

import errno
import functools
import math
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.sweep import (
    MISSING,
    collect,
    grid,
    make_jobs,
    observe,
    parse_axis,
    read_dataset,
    run_jobs,
    sweep,
    varied,
)

sys.path.insert(0, str(Path(__file__).parent))
from sweep_jobs import ball, fall, swing, trapped

AXES = {"c": [1e-5, 1e-3], "seed": [0, 1, 2]}


def distance(c: float, seed: int, duration: float = 0.1) -> float:
    tau = 1e-3 / c
    return (1 + 0.1 * seed) * tau * (1 - math.exp(-duration / tau))


def test_table_has_labels_and_the_right_numbers(tmp_path: Path) -> None:
    table = sweep(ball, AXES, fall, tmp_path, processes=1, quiet=True)
    assert table["x"].dims == ("c", "seed") and "track" not in table
    for c in AXES["c"]:
        for seed in AXES["seed"]:
            assert float(table["x"].sel(c=c, seed=seed)) == pytest.approx(distance(c, seed), rel=1e-5)
    assert (table["reason"] == "").all() and (table["wall_time"] >= 0).all()
    # arrays of a run become further dimensions
    jobs = make_jobs(ball, grid(AXES), fall, tmp_path)
    whole = collect(jobs, AXES, reduce=lambda run: run)
    assert whole["track"].dims == ("c", "seed", "time")
    assert whole["track"].values[..., -1] == pytest.approx(table["x"].values)


def test_runs_are_found_again(tmp_path: Path) -> None:
    sweep(ball, AXES, fall, tmp_path, processes=1, quiet=True)
    before = {f: f.stat().st_mtime_ns for f in tmp_path.iterdir()}
    assert len(before) == 6
    wider = sweep(ball, {"c": [1e-5, 1e-3, 1e-2], "seed": [0, 1, 2]}, fall, tmp_path, processes=1, quiet=True)
    assert wider.sizes == {"c": 3, "seed": 3}
    after = {f: f.stat().st_mtime_ns for f in tmp_path.iterdir()}
    assert len(after) == 9 and all(after[f] == stamp for f, stamp in before.items())
    # another measurement is another run
    sweep(ball, AXES, functools.partial(fall, duration=0.2), tmp_path, processes=1, quiet=True)
    assert len(list(tmp_path.iterdir())) == 15


def test_a_failed_run_is_a_reason(tmp_path: Path) -> None:
    axes = {"seed": [2, 3]}
    table = sweep(ball, axes, fall, tmp_path, processes=1, quiet=True)
    assert table["reason"].values.tolist() == ["", "ValueError: the ball is lost"]
    assert np.isfinite(table["x"].values).tolist() == [True, False]
    # kept, unless it is asked for again
    stamp = {f.name: f.stat().st_mtime_ns for f in tmp_path.iterdir()}
    sweep(ball, axes, fall, tmp_path, processes=1, quiet=True)
    assert {f.name: f.stat().st_mtime_ns for f in tmp_path.iterdir()} == stamp
    sweep(ball, axes, fall, tmp_path, processes=1, quiet=True, retry_failed=True)
    assert sum(f.stat().st_mtime_ns != stamp[f.name] for f in tmp_path.iterdir()) == 1


def test_processes_and_one_that_dies(tmp_path: Path) -> None:
    """Local processes give the same bits; a worker that dies costs its own run only."""
    table = sweep(ball, {"seed": [0, 4, 1]}, fall, tmp_path / "many", processes=2, quiet=True)
    assert table["reason"].values.tolist() == ["", "the worker process died", ""]
    alone = sweep(ball, {"seed": [0, 1]}, fall, tmp_path / "one", processes=1, quiet=True)
    assert table["x"].values[[0, 2]].tolist() == alone["x"].values.tolist()


def test_processes_with_the_packages_laws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A law stands under the name of its function; it reaches a worker all the same."""
    out = tmp_path / "out"
    arguments = ["sweep", "two_disks", "--vary", "contact_linear.stiffness=1000,1001", "--duration", "0.01"]
    assert main([*arguments, "--processes", "2", "--out", str(out)]) == 0
    many = read_dataset(out / "table.nc")
    assert many["reason"].values.tolist() == ["", ""] and "failed" not in capsys.readouterr().out
    assert main([*arguments, "--processes", "1", "--out", str(tmp_path / "one")]) == 0
    one = read_dataset(tmp_path / "one" / "table.nc")
    assert many["kinetic_energy"].values.tolist() == one["kinetic_energy"].values.tolist()


def test_processes_with_a_law_of_ones_own(tmp_path: Path) -> None:
    axes = {"k": [1e-3, 1.0]}
    many = sweep(trapped, axes, swing, tmp_path / "many", processes=2, quiet=True)
    alone = sweep(trapped, axes, swing, tmp_path / "one", processes=1, quiet=True)
    assert many["reason"].values.tolist() == ["", ""]
    assert many["x"].values.tolist() == alone["x"].values.tolist() != [0.1, 0.1]


SCRIPT = """
import sys
sys.path.insert(0, {here!r})
from granswim_pymunk.laws import Parameter, law
from granswim_pymunk.scene import use
from granswim_pymunk.sweep import sweep
from sweep_jobs import ball, swing
import dataclasses

K = 2.0

@law(kind="body", expression="F = -K x", reference="", parameters=[Parameter("k", "N/m", "stiffness")])
def scripted(x, y, k):
    return -K * k * x, 0.0

def build(k):
    return dataclasses.replace(ball(), laws=(use("scripted", k=k),))

if __name__ == "__main__":
    table = sweep(build, {{"k": [1.0, 3.0]}}, swing, {out!r}, quiet=True, {how})
    assert table["reason"].values.tolist() == ["", ""], table["reason"].values
    print(*table["x"].values)
"""


@pytest.mark.deep
def test_a_law_of_a_script_on_workers(tmp_path: Path) -> None:
    """Laws, scenes and measurements that stand in a script, or come from the standard input, reach the workers."""
    said = {}
    for name, how in {"one": "processes=1", "two": "processes=2", "dask": "processes=2, dask='local'"}.items():
        text = SCRIPT.format(here=str(Path(__file__).parent), out=str(tmp_path / name), how=how)
        environment = os.environ | {"PYTHONPATH": str(Path(__file__).parent)}
        run = subprocess.run(
            [sys.executable, "-"], input=text, capture_output=True, text=True, env=environment, timeout=120, check=False
        )
        assert run.returncode == 0, run.stderr
        said[name] = run.stdout
    assert said["one"] == said["two"] == said["dask"] != ""


def test_what_cannot_leave_the_process_is_said(tmp_path: Path) -> None:
    stuck = functools.partial(fall, duration=threading.Lock())  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"cannot be sent to other processes.*use one process"):
        sweep(ball, {"seed": [0, 1]}, stuck, tmp_path, processes=2, quiet=True)
    assert not list(tmp_path.iterdir())


def test_a_failure_of_the_machine_is_not_kept(tmp_path: Path) -> None:
    table = sweep(ball, {"seed": [0, 1]}, without_a_disk, tmp_path, processes=1, quiet=True)
    assert ["No space left" in reason for reason in table["reason"].values] == [True, True]
    assert not list(tmp_path.iterdir())


def without_a_disk(scene) -> xr.Dataset:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_sweep_that_failed_as_a_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = 'role = "free"\nradius = 1e-3\nmass = 1e-3\n'
    scene = tmp_path / "away.toml"
    scene.write_text(
        f'[[body]]\nid = "a"\n{body}initial = [0.0, 0.0, 1e90, 0.0]\n[[body]]\nid = "b"\n{body}'
        'initial = [0.1, 0.0, 0.0, 0.0]\n[[law]]\nname = "contact_linear"\nstiffness = 1000.0\n'
    )
    arguments = ["sweep", str(scene), "--duration", "0.01", "--processes", "1", "--out", str(tmp_path / "out")]
    assert main([*arguments, "--vary", "contact_linear.stiffness=1000"]) == 1
    assert "BodyLost" in capsys.readouterr().out


def test_any_executor(tmp_path: Path) -> None:
    with ThreadPoolExecutor(1) as executor:
        table = sweep(ball, AXES, fall, tmp_path, executor=executor, quiet=True)
    assert (table["reason"] == "").all()
    assert table["x"].values == pytest.approx(
        np.array([[distance(c, s) for s in AXES["seed"]] for c in AXES["c"]]), rel=1e-5
    )


@pytest.mark.filterwarnings("default")
def test_a_local_dask_cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))  # of the cluster's worker processes
    axes = {"seed": [0, 1, 3]}
    table = sweep(ball, axes, fall, tmp_path, dask="local", processes=1, quiet=True)
    assert table["reason"].values.tolist() == ["", "", "ValueError: the ball is lost"]
    assert table["x"].values[:2] == pytest.approx([distance(1e-5, 0), distance(1e-5, 1)], rel=1e-5)


def test_no_dask_scheduler(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no Dask scheduler"):
        sweep(ball, {"seed": [0, 1]}, fall, tmp_path, dask="nonsense://nowhere", quiet=True)


def test_interrupted_runs_stay(tmp_path: Path) -> None:
    jobs = make_jobs(ball, grid({"seed": [0, 1, 2]}), functools.partial(interrupting, folder=tmp_path), tmp_path)
    with pytest.raises(KeyboardInterrupt):
        run_jobs(jobs, ball, functools.partial(interrupting, folder=tmp_path), processes=1, quiet=True)
    assert [job.done for job in jobs] == [True, False, False]
    assert not list(tmp_path.glob("*.part"))
    found = collect(jobs, {"seed": [0, 1, 2]})
    assert found["reason"].values.tolist() == ["", MISSING, MISSING]


def interrupting(scene, folder: Path) -> xr.Dataset:
    if list(folder.glob("*.nc")):
        raise KeyboardInterrupt
    return fall(scene)


def test_wrong_values_before_anything_runs(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="parameter c: -1"):
        sweep(ball, {"c": [1e-5, -1.0]}, fall, tmp_path / "none", processes=1, quiet=True)
    assert not (tmp_path / "none").exists()
    with pytest.raises(InputError, match="each once"):
        sweep(ball, {"c": [1e-5, 1e-5]}, fall, tmp_path / "none", processes=1, quiet=True)
    with pytest.raises(InputError, match="no such law"):
        varied(ball(), **{"bending.frequency": 3.0})
    with pytest.raises(InputError, match="should be seed"):
        varied(ball(), frequency=3.0)
    (tmp_path / "bad.nc").write_text("no")
    with pytest.raises(InputError, match="netCDF"):
        read_dataset(tmp_path / "bad.nc")


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("seed=1:4", [1, 2, 3, 4]),
        ("bending.frequency=2:6:2", [2.0, 4.0, 6.0]),
        ("k.c=4,9,15", [4.0, 9.0, 15.0]),
        ("bending.form=leader,elastic", ["leader", "elastic"]),
        ("k.c=1,3:4", [1.0, 3.0, 4.0]),
    ],
)
def test_axis_of_the_command(text: str, values: list) -> None:
    assert parse_axis(text) == (text.partition("=")[0], values)


@pytest.mark.parametrize("text", ["seed", "seed=", "f=5:1", "f=1:9:0", "f=a:b", "f=1,x", "f=nan", "f=0:1:1e-9"])
def test_bad_axis_of_the_command(text: str) -> None:
    with pytest.raises(InputError):
        parse_axis(text)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["sweep", "falling_ball", "--duration", "0.2", "--processes", "1", "--out", str(tmp_path)]
    assert main([*arguments, "--vary", "gravity.nothing=1"]) == 2
    assert "gravity" in capsys.readouterr().err and not (tmp_path / "table.nc").exists()
    assert main([*arguments, "--vary", "quadratic_drag.c=0,0.01", "--vary", "seed=0:1"]) == 0
    said = capsys.readouterr()
    assert "kinetic_energy" in said.out
    table = read_dataset(tmp_path / "table.nc")
    assert table["kinetic_energy"].dims == ("quadratic_drag.c", "seed")
    assert len(list((tmp_path / "runs").glob("*.nc"))) == 4
    # drag takes energy
    energy = table["kinetic_energy"].values
    assert (energy[0] > energy[1]).all() and (energy[:, 0] == energy[:, 1]).all()


def test_observe_a_swimmer() -> None:
    """A swimmer without a bed: what it keeps is that of the engine, and it goes nowhere."""
    from granswim_pymunk.engine import Simulation
    from granswim_pymunk.paper.scenes import paper_scene

    scene = paper_scene(frequency=20.0, softness=25.0)
    scene = varied(scene, seed=1)
    scene = type(scene)(bodies=scene.bodies, laws=scene.laws, time=scene.time)
    found = observe(scene, duration=0.25, settle=0.05, every=2e-3)
    sim = Simulation(scene)
    sim.advance(found.attrs["steps"])
    assert found["xy"].values[-1] == pytest.approx(sim.state().xy, abs=1e-12)
    assert abs(float(found["speed"])) < 1e-2 and float(found["speed_error"]) > 0
    with pytest.raises(InputError, match="settle"):
        observe(scene, duration=0.1, settle=0.2)


def test_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """One line, exit code 2; finished runs stay, nothing half written does, and the sweep goes on later."""
    arguments = ["sweep", "falling_ball", "--duration", "0.05", "--out", str(tmp_path), "--processes", "1"]
    arguments += ["--vary", "seed=0:3"]
    real = os.fdopen

    def full_after_two(handle: int, *how: str):
        if len(list((tmp_path / "runs").glob("*.nc"))) == 2:
            os.close(handle)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(handle, *how)

    with monkeypatch.context() as patch:
        patch.setattr("granswim_pymunk.files.os.fdopen", full_after_two)
        assert main(arguments) == 2
    error = capsys.readouterr().err
    assert "No space left" in error and "Traceback" not in error
    assert len(list((tmp_path / "runs").iterdir())) == 2
    assert main(arguments) == 0
    assert (read_dataset(tmp_path / "table.nc")["reason"] == "").all()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--vary", "seed=18446744073709551616"], "2^63 - 1"),
        (["--vary", "seed=-1"], "2^63 - 1"),
        (["--vary", "quadratic_drag.c=1e300"], "absurdly large"),
        (["--vary", "seed=1:2000", "--vary", "quadratic_drag.c=1:1000"], "runs"),
        (["--vary", "seed=1", "--every", "1e-300"], "samples"),
        (["--vary", "seed=1", "--duration", "1e300"], "samples"),
    ],
)
def test_absurd_numbers(more: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["sweep", "falling_ball", "--out", str(out), "--processes", "1", *more]) == 2
    error = capsys.readouterr().err
    assert words in error and len(error.splitlines()) == 1 and not out.exists()


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks processes up in /proc")
def test_workers_go_with_a_main_process_that_was_killed():
    """SIGKILL leaves the main process no time to tell its workers; they must not stay and compute on."""
    script = (
        "import os, time\nfrom granswim_pymunk.sweep import pool\nworkers = pool(1)\n"
        "print(workers.submit(os.getpid).result(), flush=True)\nworkers.submit(time.sleep, 300)\ntime.sleep(300)"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as main_process:
        assert main_process.stdout is not None
        worker = int(main_process.stdout.readline())
        assert Path(f"/proc/{worker}").exists()
        main_process.send_signal(signal.SIGKILL)
    until = time.monotonic() + 20

    def there() -> bool:
        try:
            return "Z" not in Path(f"/proc/{worker}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            return False

    while there() and time.monotonic() < until:
        time.sleep(0.05)
    assert not there()
