"""Runs: what is written, that it can be read, that it is the same again, and how it ends."""

import dataclasses
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time

import h5py
import numpy as np
import pytest
from PIL import Image

from granswim_pymunk.benchmarks.full_disk import START as LIMITED
from granswim_pymunk.cli import main
from granswim_pymunk.engine import Simulation
from granswim_pymunk.errors import InputError
from granswim_pymunk.run import contacts_of, find_scene, run_scene, shipped_scenarios
from granswim_pymunk.scene import Bed, Scene, Time, read_scene, swimmer, use
from granswim_pymunk.trajectory import TrajectoryWriter, read_trajectory

TWO_DISKS = """
title = "two"
[[body]]
id = "a"
role = "free"
radius = 1e-3
mass = 1e-5
initial = [0.0, 0.0, 0.1, 0.0]
[[body]]
id = "b"
role = "free"
radius = 1e-3
mass = 1e-5
initial = [0.003, 0.0005, 0.0, 0.0]
[[law]]
name = "contact_linear"
stiffness = 100.0
damping = 100.0
[time]
duration = 0.02
"""


@pytest.fixture
def two(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(TWO_DISKS)
    return path


def little_bed(**more):
    return Scene(
        title="a very little bed",
        bodies=tuple(swimmer(disks=3, head=(0.006, 0.006))),
        laws=(
            use("contact_linear", stiffness=2.2e3, damping=1e4),
            use("union", stiffness=1e3, damping=1e3),
            use("bending", stiffness=2e-3, damping=1e2, amplitude=math.pi / 4, frequency=9.0),
        ),
        periodic_x=0.02,
        bed=Bed(0.012, 0.75, (1e-3, 2e-3), 1004.0),
        time=Time(dt=4e-6, duration=0.008),
        **more,
    )


# ---- trajectories ------------------------------------------------------------------------------


def test_trajectory_round_trip(tmp_path):
    scene = read_scene(shipped_scenarios()["two_disks"])
    rng = np.random.default_rng(0)
    xy, v, angle = rng.normal(size=(5, 2, 2)), rng.normal(size=(5, 2, 2)), rng.normal(size=(5, 2))
    with TrajectoryWriter(tmp_path / "t.h5", scene, author="somebody") as writer:
        for k in range(5):
            writer.add(10 * k, 0.1 * k, xy[k], v[k], {"angle": angle[k]}, {"kinetic_energy": float(k)})
    back = read_trajectory(tmp_path / "t.h5")
    assert len(back) == 5
    assert np.array_equal(back.xy, xy) and np.array_equal(back.v, v)  # every bit
    assert np.array_equal(back.more["angle"], angle)
    assert back.t.tolist() == [0.1 * k for k in range(5)] and back.step.tolist() == [0, 10, 20, 30, 40]
    assert back.observables["kinetic_energy"].tolist() == [0, 1, 2, 3, 4]
    assert back.ids == ("left", "right") and back.roles == ("free", "free")
    assert back.radius.tolist() == [b.radius for b in scene.bodies]
    assert back.mass.tolist() == [b.mass for b in scene.bodies]
    assert back.scene.hash == scene.hash and scene.identity == back.scene_hash
    state = back.state(3)
    assert state.t == back.t[3] and np.array_equal(state.xy, xy[3]) and np.array_equal(state.angle, angle[3])


def test_layout_is_h5md(tmp_path):
    result = run_scene(little_bed(), tmp_path / "out", frames=0, quiet=True)
    with h5py.File(result.trajectory) as file:
        assert file["h5md"].attrs["version"].tolist() == [1, 1]
        assert file["h5md/creator"].attrs["name"] == "granswim_pymunk"
        assert file["h5md/author"].attrs["name"]
        group = file["particles/all"]
        n = len(result.scene.bodies)
        for name in ("position", "velocity"):
            assert group[name]["value"].shape == (101, n, 2) and group[name]["value"].dtype == np.float64
            assert group[name]["step"].shape == group[name]["time"].shape == (101,)
        assert group["position/value"].attrs["unit"] == "m"
        assert group["box"].attrs["dimension"] == 2
        assert list(group["box"].attrs["boundary"]) == ["periodic", "none"]
        assert group["box/edges"][...].tolist() == [0.02, 0.012]
        assert file["observables/kinetic_energy/value"].shape == (101,)
        assert file["observables/swimmer_center/value"].shape == (101, 2)
        assert file.attrs["scene_hash"] == result.scene.identity


KILLED = """
import os, sys
from granswim_pymunk.engine import Simulation
from granswim_pymunk.run import shipped_scenarios
from granswim_pymunk.scene import read_scene
from granswim_pymunk.trajectory import TrajectoryWriter
import numpy as np
scene = read_scene(shipped_scenarios()["two_disks"])
writer = TrajectoryWriter(sys.argv[1], scene)
for k in range(7):
    writer.add(k, float(k), np.full((2, 2), k), np.zeros((2, 2)))
os._exit(9)
"""


def test_trajectory_of_a_killed_program_can_be_read(tmp_path):
    path = tmp_path / "t.h5"
    # elsewhere than in the clone, whose folder of the package would stand in for an installed one
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], timeout=60, cwd=tmp_path)
    assert done.returncode == 9
    back = read_trajectory(path)
    assert len(back) == 7 and back.xy[6].tolist() == [[6, 6], [6, 6]]


def test_half_a_frame_is_left_out(tmp_path):
    path = tmp_path / "t.h5"
    with TrajectoryWriter(path, read_scene(shipped_scenarios()["two_disks"])) as writer:
        for k in range(3):
            writer.add(k, float(k), np.full((2, 2), k), np.zeros((2, 2)))
    with h5py.File(path, "a") as file:  # as if it had been killed between two series
        file["particles/all/position/value"].resize(4, axis=0)
    assert len(read_trajectory(path)) == 3


def test_not_a_trajectory(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_trajectory(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("not HDF5")
    with pytest.raises(InputError, match="not a trajectory"):
        read_trajectory(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["a"] = 1
    with pytest.raises(InputError, match="not a trajectory"):
        read_trajectory(tmp_path / "other.h5")


# ---- the command -------------------------------------------------------------------------------


def test_command(two, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["run", str(two), "--out", str(out), "--frames", "5", "--dt", "1e-5"]) == 0
    assert sorted(p.name for p in out.iterdir()) == [
        "frames", "run.json", "scene.toml", "trajectory.h5", "video.gif"
    ]  # fmt: skip
    assert [p.name for p in sorted((out / "frames").iterdir())] == [f"frame_{k:05d}.png" for k in range(5)]
    said = capsys.readouterr().out
    assert "contact_linear(stiffness = 100 N/m" in said
    duration = math.pi / math.sqrt(100.0 / 0.5e-5 - 50.0**2)
    assert f"a contact lasts {duration:.2g} s: {duration / 1e-5:.1f} steps" in said
    report = json.loads((out / "run.json").read_text())
    assert report["stopped"] == "finished" and report["steps"] == 2000 and report["dt_s"] == 1e-5
    assert report["scene_hash"] == read_scene(out / "scene.toml").identity
    assert {"python", "pymunk", "numpy", "granswim_pymunk"} <= set(report["versions"])
    assert report["wall_time_of_parts_s"].keys() >= {"simulation", "frames", "video"}
    with Image.open(out / "video.gif") as picture:
        assert picture.n_frames == 5

    sim = Simulation(read_scene(two), dt=1e-5)
    sim.advance(2000)
    stored = read_trajectory(out / "trajectory.h5")
    assert np.array_equal(stored.xy[-1], sim.state().xy)
    assert stored.t[-1] == pytest.approx(0.02, rel=1e-12)


def test_second_run_leaves_no_old_frames(two, tmp_path):
    out = tmp_path / "out"
    main(["run", str(two), "--out", str(out), "--frames", "6", "--video", "mp4"])
    main(["run", str(two), "--out", str(out), "--frames", "3", "--video", "none", "--overwrite"])
    assert len(list((out / "frames").iterdir())) == 3
    assert not (out / "video.mp4").exists()


def test_frames_a_second_and_the_end(two, tmp_path):
    result = run_scene(two, tmp_path / "out", fps=500, video="none", quiet=True)
    assert len(result.frames) == 11
    stored = read_trajectory(result.trajectory)
    # the automatic step is cut so that the run ends when it should
    assert stored.t[-1] == pytest.approx(0.02, rel=1e-12)
    assert np.diff(stored.t) == pytest.approx(0.002, rel=0.05)


def test_output_interval(two, tmp_path):
    two.write_text(TWO_DISKS + "output = 0.001\ndt = 1e-5\n")
    result = run_scene(two, tmp_path / "out", frames=3, video="none", quiet=True)
    stored = read_trajectory(result.trajectory)
    assert stored.step.tolist() == list(range(0, 2001, 100))
    assert len(result.frames) == 3


@pytest.mark.parametrize("mode", ["verlet", "chipmunk", "python"])
def test_modes_agree(two, tmp_path, mode):
    result = run_scene(two, tmp_path / mode, dt=1e-5, mode=mode, frames=0, video="none", quiet=True)
    sim = Simulation(read_scene(two), dt=1e-5, mode="batch")
    sim.advance(2000)
    assert result.diagnostics["mode"] == mode
    assert np.abs(result.state.xy - sim.state().xy).max() < 1e-12


def test_bed_is_the_same_again_whatever_is_drawn(tmp_path):
    scene = little_bed(seed=2)
    many = run_scene(scene, tmp_path / "a", frames=9, color="force", video="none", quiet=True)
    few = run_scene(scene, tmp_path / "b", frames=9, video="none", quiet=True)
    assert np.array_equal(many.state.xy, few.state.xy) and np.array_equal(many.state.v, few.state.v)
    assert many.scene.hash == few.scene.hash
    other = run_scene(scene, tmp_path / "c", frames=0, seed=3, quiet=True)
    assert other.scene.seed == 3 and other.scene.hash != many.scene.hash
    again = run_scene(many.out / "scene.toml", tmp_path / "d", frames=9, video="none", quiet=True)
    assert np.array_equal(again.state.xy, many.state.xy), "scene.toml has the bed in it, to the last bit"


def test_contacts_of_a_stored_state(tmp_path):
    result = run_scene(little_bed(), tmp_path / "out", frames=3, video="none", quiet=True)
    stored = read_trajectory(result.trajectory)
    contacts = contacts_of(result.scene, stored.state(2))
    n = len(result.scene.bodies)
    total = np.bincount(contacts.i, np.abs(contacts.force), n) + np.bincount(
        contacts.j, np.abs(contacts.force), n
    )
    assert total.max() > 0
    assert total == pytest.approx(stored.more["contact_force"][2], rel=1e-6, abs=1e-9)


def test_revised_scene_runs_as_it_is(two, tmp_path):
    scene = read_scene(two)
    revised = dataclasses.replace(
        scene.with_laws(use("linear_drag", c=1e-5)),
        camera={"scale": 1.01},
        time=Time(dt=1e-5, start=1.5, duration=0.01),
    )
    (tmp_path / "revised.toml").write_text(revised.to_toml())
    result = run_scene(tmp_path / "revised.toml", tmp_path / "out", frames=2, video="none", quiet=True)
    assert result.diagnostics["start_s"] == 1.5 and result.state.t == pytest.approx(1.51)


# ---- how it ends -------------------------------------------------------------------------------


def test_interrupt_keeps_what_was_written(tmp_path, capsys):
    scene = little_bed()
    scene = dataclasses.replace(scene, time=Time(dt=4e-6, duration=100.0))
    (tmp_path / "long.toml").write_text(scene.to_toml())
    out = tmp_path / "out"
    before = signal.getsignal(signal.SIGINT)

    def press():
        late = time.monotonic() + 60
        while len(list((out / "frames").glob("*.png"))) < 3 and time.monotonic() < late:
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=press)
    thread.start()
    code = main(["run", str(tmp_path / "long.toml"), "--out", str(out), "--fps", "200"])
    thread.join()
    assert code == 130 and "kept" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGINT) is before
    report = json.loads((out / "run.json").read_text())
    assert report["stopped"] == "interrupted" and 0 < report["end_s"] < 100
    stored = read_trajectory(out / "trajectory.h5")
    pictures = sorted((out / "frames").glob("*.png"))
    assert len(stored) == len(pictures) >= 3
    for name in pictures:
        with Image.open(name) as picture:
            picture.load()


def test_a_run_that_cannot_go_on(tmp_path, capsys):
    text = (shipped_scenarios()["cart_on_spring"]).read_text().replace("stiffness = 20.0", "stiffness = 2e9")
    (tmp_path / "stiff.toml").write_text(text)
    out = tmp_path / "out"
    assert main(["run", str(tmp_path / "stiff.toml"), "--out", str(out), "--dt", "0.001"]) == 1
    assert "body cart" in capsys.readouterr().err
    assert json.loads((out / "run.json").read_text())["stopped"].startswith(
        "failed: the position of body cart"
    )
    assert len(read_trajectory(out / "trajectory.h5")) >= 1


@pytest.mark.parametrize(
    ("text", "arguments", "words"),
    [
        (None, [], "no such file"),
        (TWO_DISKS.replace("contact_linear", "contact_magic"), [], "unknown law 'contact_magic'"),
        (TWO_DISKS.replace("duration = 0.02", ""), [], "duration"),
        (TWO_DISKS.replace("radius = 1e-3", "radius = -1e-3"), [], "radius"),
        (TWO_DISKS + "[frames]\ncolour = 'speed'\n", [], "colour"),
        (TWO_DISKS, ["--frames", "1"], "at least 2"),
        (TWO_DISKS, ["--duration", "-1"], "duration"),
        (TWO_DISKS, ["--duration", "nan"], "duration"),
        (TWO_DISKS, ["--dt", "0"], "dt"),
        (TWO_DISKS, ["--dt", "1"], "shorter than one step"),
        (TWO_DISKS, ["--seed", "-3"], "seed"),
        (TWO_DISKS, ["--fps", "-5"], "fps"),
        (TWO_DISKS.replace("initial = [0.0, 0.0, 0.1, 0.0]", ""), [], "initial"),
    ],
)
def test_bad_input(tmp_path, capsys, text, arguments, words):
    path = tmp_path / "scene.toml"
    if text is not None:
        path.write_text(text)
    out = tmp_path / "out"
    assert main(["run", str(path), "--out", str(out), *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error and "Traceback" not in error and len(error.strip().splitlines()) == 1
    assert not out.exists()


def test_out_that_is_a_file(two, tmp_path, capsys):
    (tmp_path / "out").write_text("here already")
    assert main(["run", str(two), "--out", str(tmp_path / "out")]) == 2
    assert "cannot make this folder" in capsys.readouterr().err
    assert (tmp_path / "out").read_text() == "here already"


# ---- shipped scenes ----------------------------------------------------------------------------


def test_shipped_scenes_are_found_by_name():
    shipped = shipped_scenarios()
    assert {
        "swim", "swim_confined", "pocket_swim", "two_disks", "pendulum", "falling_ball", "cart_on_spring"
    } <= set(shipped)  # fmt: skip
    assert find_scene("swim") == find_scene("swim.toml") == shipped["swim"]
    with pytest.raises(InputError, match="pocket_swim"):
        find_scene("swimm")


@pytest.mark.parametrize("name", sorted(shipped_scenarios()))
def test_shipped_scenes_are_in_order(name):
    scene = read_scene(shipped_scenarios()[name])
    assert scene.title and scene.time.duration
    scene.check_overlaps()


def test_cart_comes_to_rest_off_the_spring_s_length(tmp_path):
    result = run_scene("cart_on_spring", tmp_path / "out", frames=0, quiet=True)
    x, y = result.state.xy[0]
    # dry friction holds it wherever the spring pulls less than mu m g
    assert abs(x - 0.30) < 0.03 * 0.5 * 9.81 / 20.0 and abs(y) < 1e-12
    assert abs(result.state.v[0, 0]) < 1e-3  # v_0: below it the friction lets it creep
    stored = read_trajectory(result.trajectory)
    assert stored.xy[:, 0, 0].min() < 0.25, "it swung through"


# ---- what lies in the folder already -----------------------------------------------------------


def content(folder):
    return {p.relative_to(folder): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_finished_run_is_not_emptied(two, tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["run", str(two), "--out", str(out), "--frames", "2"]
    assert main(arguments) == 0
    before = content(out)
    assert main([*arguments, "--duration", "0.01"]) == 2
    error = capsys.readouterr().err
    assert "finished run" in error and "--overwrite" in error and content(out) == before
    assert main([*arguments, "--duration", "0.01", "--overwrite"]) == 0
    assert read_trajectory(out / "trajectory.h5").t[-1] == pytest.approx(0.01)


BUSY = """
import sys, time
from granswim_pymunk.files import claimed
with claimed(sys.argv[1]):
    print("mine", flush=True)
    sys.stdin.read()
"""


def test_a_second_start_leaves_the_first_alone(two, tmp_path, capsys):
    """Another program that writes there is noticed before anything is looked at or removed."""
    out = tmp_path / "out"
    arguments = ["run", str(two), "--out", str(out), "--frames", "2", "--video", "none"]
    assert main(arguments) == 0
    (out / "checkpoint.npz").write_bytes(b"whatever is in it")
    before = content(out)
    first = subprocess.Popen([sys.executable, "-c", BUSY, str(out)], stdin=-1, stdout=-1, text=True)
    assert first.stdin and first.stdout and first.stdout.readline() == "mine\n"
    for more in ([], ["--overwrite"]):
        assert main([*arguments, *more]) == 2
        assert "another program" in capsys.readouterr().err
    assert main(["run", "--resume", str(out)]) == 2
    assert "another program" in capsys.readouterr().err
    assert content(out) == before
    first.stdin.close()
    assert first.wait(20) == 0
    first.stdout.close()
    assert main([*arguments, "--overwrite"]) == 0


def test_a_stopped_run_says_how_it_goes_on(two, tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["run", str(two), "--out", str(out), "--frames", "0"]
    assert main(arguments) == 0
    (out / "checkpoint.npz").write_bytes(b"whatever is in it")
    assert main(arguments) == 2
    assert "--resume" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["video.gif", "trajectory.h5", "scene.toml", "frames/frame_00001.png"])
@pytest.mark.parametrize("more", [[], ["--overwrite"]])
def test_files_of_ones_own_stay(two, tmp_path, capsys, name, more):
    out = tmp_path / "out"
    (out / "frames").mkdir(parents=True)
    (out / name).write_text("mine")
    (out / "video.mp4").write_text("mine, and in nobody's way")
    assert main(["run", str(two), "--out", str(out), "--frames", "2", *more]) == 2
    assert name in capsys.readouterr().err
    assert (out / name).read_text() == "mine"
    (out / name).unlink()
    assert main(["run", str(two), "--out", str(out), "--frames", "2", *more]) == 0
    assert (out / "video.mp4").read_text() == "mine, and in nobody's way"


@pytest.mark.parametrize("name", ["video.gif", "trajectory.h5", "scene.toml", "run.json", "frames"])
def test_nothing_is_written_through_links(two, tmp_path, capsys, name):
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "precious").write_text("mine")
    out.mkdir()
    (out / name).symlink_to(elsewhere if name == "frames" else elsewhere / "precious")
    for more in ([], ["--overwrite"]):
        assert main(["run", str(two), "--out", str(out), "--frames", "2", *more]) == 2
        assert "link" in capsys.readouterr().err
    assert content(elsewhere) == {(elsewhere / "precious").relative_to(elsewhere): b"mine"}
    scene = read_scene(two)
    (tmp_path / "t.h5").symlink_to(elsewhere / "precious")
    with pytest.raises(InputError, match="link"):
        TrajectoryWriter(tmp_path / "t.h5", scene)
    assert (elsewhere / "precious").read_text() == "mine"


def test_output_is_tried_before_the_work(two, tmp_path, capsys, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr("granswim_pymunk.run.Simulation", None)  # would fail if it were reached
    for out in (tmp_path / "file" / "out", tmp_path / ("x" * 300)):
        assert main(["run", str(two), "--out", str(out)]) == 2
        assert "cannot make this folder" in capsys.readouterr().err


# ---- a disk that takes no more, and being told to end ------------------------------------------

def limited(limit, *arguments):
    command = [sys.executable, "-c", LIMITED, str(limit), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize("limit", [10_000, 250_000])
def test_full_disk(tmp_path, limit):
    """One line and exit code 2; what was written can be read, and with room again it goes on to the same bits."""
    two = tmp_path / "two.toml"
    two.write_text(TWO_DISKS + "output = 1e-5\ndt = 1e-5\n")
    whole = run_scene(two, tmp_path / "whole", frames=0, quiet=True)
    assert whole.trajectory.stat().st_size > 300_000
    out = tmp_path / "out"
    done = limited(limit, "run", two, "--out", out, "--frames", "0")
    assert done.returncode == 2, done.stderr
    errors = [line for line in done.stderr.splitlines() if line.startswith("granswim")]
    assert len(errors) == 1 and "cannot write it" in errors[0] and "Traceback" not in done.stderr
    if limit < 100_000:
        assert not (out / "trajectory.h5").exists()
        return
    assert "--resume" in errors[0]
    stored = read_trajectory(out / "trajectory.h5")
    assert 100 < len(stored) < 2001
    assert json.loads((out / "run.json").read_text())["stopped"].startswith("failed")
    assert main(["run", "--resume", str(out)]) == 0
    again = read_trajectory(out / "trajectory.h5")
    expected = read_trajectory(whole.trajectory)
    assert np.array_equal(again.step, expected.step) and np.array_equal(again.xy, expected.xy)


def test_full_disk_for_pictures(tmp_path, two, monkeypatch):
    """Pictures that find no room: the trajectory and a checkpoint stand."""
    out = tmp_path / "out"
    with monkeypatch.context() as patch:

        def full(self, path):
            raise OSError(28, "No space left on device", str(path))

        patch.setattr("granswim_pymunk.render.Painter.save", full)
        with pytest.raises(InputError, match=r"No space left.*--resume"):
            run_scene(two, out, frames=4, video="none", quiet=True)
    assert main(["run", "--resume", str(out)]) == 0
    assert len(list((out / "frames").glob("*.png"))) == 4


def test_what_was_reserved_is_given_back(tmp_path):
    scene = read_scene(shipped_scenarios()["two_disks"])
    path = tmp_path / "t.h5"
    with TrajectoryWriter(path, scene) as writer:
        for k in range(3):
            writer.add(k, float(k), np.full((2, 2), k), np.zeros((2, 2)))
        assert path.stat().st_size > 200_000
    assert path.stat().st_size < 150_000 and len(read_trajectory(path)) == 3


def test_sigterm_writes_a_checkpoint(tmp_path):
    scene = dataclasses.replace(little_bed(), time=Time(dt=4e-6, duration=100.0))
    (tmp_path / "long.toml").write_text(scene.to_toml())
    out = tmp_path / "out"
    command = [sys.executable, "-m", "granswim_pymunk", "run", str(tmp_path / "long.toml"), "--out", str(out)]
    command += ["--fps", "200"]
    run = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    late = time.monotonic() + 60
    while len(list((out / "frames").glob("*.png"))) < 2 and time.monotonic() < late:
        time.sleep(0.05)
    run.send_signal(signal.SIGTERM)
    _, error = run.communicate(timeout=60)
    assert run.returncode == 143 and "Traceback" not in error and "kept" in error
    assert (out / "checkpoint.npz").is_file()
    assert json.loads((out / "run.json").read_text())["stopped"] == "interrupted"


@pytest.mark.parametrize("color", ["speed", "force"])
def test_resumed_pictures_are_those_of_a_whole_run(tmp_path, monkeypatch, color):
    """The scale of a bed's colours comes from all pictures, those before the checkpoint too."""
    scene = little_bed(seed=2)
    # fastest at the start: what comes after the checkpoint alone would ask for another scale
    bodies = tuple(
        dataclasses.replace(b, initial=(*b.initial[:2], 0.3, 0.0)) if b.role == "head" else b for b in scene.bodies
    )
    scene = dataclasses.replace(scene, bodies=bodies)
    more = {"frames": 5, "video": "none", "quiet": True, "color": color, "max_overlap": math.inf}
    whole = run_scene(scene, tmp_path / "whole", **more)
    monkeypatch.setattr("granswim_pymunk.run.CHECKPOINT_EVERY", 0.0)
    monkeypatch.setitem(run_scene.__globals__["BLOCK"], "verlet", 4000)
    advance = Simulation.advance

    def interrupted(self, steps):
        advance(self, steps)
        if self.step >= 1400:
            raise KeyboardInterrupt

    out = tmp_path / "part"
    with monkeypatch.context() as patch:
        patch.setattr(Simulation, "advance", interrupted)
        with pytest.raises(KeyboardInterrupt):
            run_scene(scene, out, **more)
    assert main(["run", "--resume", str(out)]) == 0
    for frame in whole.frames:
        assert np.array_equal(np.asarray(Image.open(frame)), np.asarray(Image.open(out / "frames" / frame.name)))


# ---- numbers that nothing can be done with -----------------------------------------------------

BED = """
[scene]
periodic_x = {width}
[scene.bed]
height = {height}
packing_fraction = 0.8
grain_diameter = [{low}, {high}]
density = 1000.0
[swimmer]
head = [0.006, 0.006]
disks = 3
[[law]]
name = "contact_linear"
stiffness = 2200.0
[time]
duration = 1e-4
"""


@pytest.mark.parametrize(
    ("text", "arguments", "words"),
    [
        (TWO_DISKS, ["--duration", "1e30"], "cannot be counted"),
        (TWO_DISKS, ["--dt", "1e-30"], "cannot be counted"),
        (TWO_DISKS.replace("stiffness = 100.0", "stiffness = 1e90"), [], "cannot be counted"),
        (TWO_DISKS.replace("stiffness = 100.0", "stiffness = 1e101"), [], "absurdly large"),
        (TWO_DISKS, ["--frames", "100000000000"], "pictures"),
        (TWO_DISKS, ["--frames", "1" + "0" * 30], "pictures"),
        (TWO_DISKS, ["--fps", "1e300"], "pictures"),
        (TWO_DISKS + "output = 1e-12\ndt = 1e-12\n", [], "states"),
        (TWO_DISKS.replace("radius = 1e-3", "radius = 1e-300"), [], "radius should lie between"),
        (TWO_DISKS.replace("mass = 1e-5", "mass = 1e-300"), [], "mass should lie between"),
        (TWO_DISKS, ["--seed", str(2**64)], "2^63 - 1"),
        ("seed = 18446744073709551616\n" + TWO_DISKS, [], "2^63 - 1"),
        (TWO_DISKS + "[scene]\nperiodic_x = 1e-3\n", [], "less than the diameter of body a"),
        ("[swimmer]\nhead = []\n[time]\nduration = 0.01\n", [], "head"),
        ("a = " + "[" * 10**5 + "]" * 10**5, [], "not valid TOML"),
        (BED.format(width=1e9, height=1e9, low=1e-3, high=2e-3), [], "grains"),
        (BED.format(width=0.02, height=0.012, low=1e-9, high=2e-9), [], "grains"),
        (
            TWO_DISKS.replace('"contact_linear"', '"pin"\nbody = "a"\nanchor = [0.0, 0.1]\nlength = 0')
            .replace("stiffness = 100.0", "").replace("damping = 100.0", ""),
            [],
            "parameter length",
        ),
    ],
)  # fmt: skip
def test_absurd_numbers(tmp_path, capsys, text, arguments, words):
    path, out = tmp_path / "scene.toml", tmp_path / "out"
    path.write_text(text)
    assert main(["run", str(path), "--out", str(out), *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error and "Traceback" not in error and len(error.strip().splitlines()) == 1
    assert not out.exists()


def test_name_that_no_file_can_have(capsys):
    for name in ("x" * 300 + ".toml", "a\0b.toml", "a\nb.toml"):
        assert main(["run", name, "--out", "nowhere"]) == 2
        error = capsys.readouterr().err
        assert ".toml: " in error and len(error.splitlines()) == 1 and error.rstrip("\n").isprintable()


def test_title_with_dollars_is_a_text(two, tmp_path):
    two.write_text(TWO_DISKS.replace('"two"', "'broken $\\frac{$ and $x^2$'"))
    assert len(run_scene(two, tmp_path / "out", frames=2, quiet=True).frames) == 2
