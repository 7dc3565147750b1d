"""Checkpoints give the bits of a run that never stopped; what is damaged is told; a watch stops a run gone wrong."""

import dataclasses
import errno
import math
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from test_engine import CONTACT, bits, small_bed

from granswim_pymunk.cli import main
from granswim_pymunk.engine import Simulation, Watch, load_checkpoint, resume, save_checkpoint
from granswim_pymunk.errors import InputError, SimulationError
from granswim_pymunk.run import CHECKPOINT, resume_run, run_scene
from granswim_pymunk.scene import Body, Scene, Time, use, write_scene
from granswim_pymunk.trajectory import read_trajectory


@pytest.mark.parametrize("mode", ["verlet", "chipmunk"])
@pytest.mark.parametrize("stop", [0, 1, 137])
def test_restart_has_the_same_bits(tmp_path, mode, stop):
    scene = small_bed(use("contact_friction", mu=0.3))
    whole = Simulation(scene, mode=mode)
    whole.advance(400)
    part = Simulation(scene, mode=mode)
    part.advance(stop)
    random = np.random.default_rng(5)
    random.normal(size=7)
    save_checkpoint(part, tmp_path / "c.npz", random=random, note={"name": "x"})
    again, generator, note = resume(tmp_path / "c.npz")
    assert note == {"name": "x"} and again.step == stop and again.t == part.t
    assert bits(again.forces(), again.state().v) == bits(part.forces(), part.state().v)
    again.advance(400 - stop)
    assert bits(*again.raw().values(), again.forces()) == bits(*whole.raw().values(), whole.forces())
    assert generator is not None and generator.normal() == random.normal()


def test_restart_in_another_process(tmp_path):
    scene = small_bed()
    part = Simulation(scene)
    part.advance(100)
    save_checkpoint(part, tmp_path / "c.npz")
    part.advance(300)
    script = (
        "import sys, hashlib; from granswim_pymunk.engine import resume\n"
        "sim = resume(sys.argv[1])[0]; sim.advance(300)\n"
        "print(hashlib.sha256(b''.join(v.tobytes() for v in sim.raw().values())).hexdigest())"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "c.npz")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == bits(*part.raw().values())


class TestDamage:
    @pytest.fixture
    def kept(self, tmp_path):
        sim = Simulation(small_bed())
        sim.advance(10)
        save_checkpoint(sim, tmp_path / "c.npz")
        return tmp_path / "c.npz"

    def test_every_part_cut_off_and_bytes_changed(self, kept):
        whole = kept.read_bytes()
        rng = np.random.default_rng(1)
        told = 0
        for k in range(60):
            data = bytearray(whole)
            if k % 2:
                data = data[: int(rng.integers(0, len(data)))]
            else:
                at = int(rng.integers(0, len(data)))
                data[at] ^= int(rng.integers(1, 256))
            kept.write_bytes(bytes(data))
            try:
                load_checkpoint(kept)
            except InputError as error:
                assert str(kept) in str(error)
                told += 1
        # a byte of the archive's own dates or names may change without any effect
        assert told >= 50

    def test_missing_foreign_and_other_version(self, kept, tmp_path):
        with pytest.raises(InputError, match="no such file"):
            load_checkpoint(tmp_path / "none.npz")
        np.savez(tmp_path / "other.npz", a=np.zeros(3))
        with pytest.raises(InputError, match="not a checkpoint"):
            load_checkpoint(tmp_path / "other.npz")
        with np.load(kept) as archive:
            content = {name: archive[name] for name in archive.files}
        np.savez(kept, **{**content, "version": np.array(99)})
        with pytest.raises(InputError, match="version 99"):
            load_checkpoint(kept)
        np.savez(kept, **{**content, "x": content["x"] + 1e-9})
        with pytest.raises(InputError, match="damaged"):
            load_checkpoint(kept)

    def test_full_disk_keeps_the_last_one(self, kept, monkeypatch):
        before = kept.read_bytes()
        sim = resume(kept)[0]
        sim.advance(10)

        def full(handle):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(SimulationError, match="No space left"):
            save_checkpoint(sim, kept)
        assert kept.read_bytes() == before and [p.name for p in kept.parent.iterdir()] == [kept.name]

    def test_impulses_have_none(self, tmp_path):
        bodies = (Body("a", "free", 1e-2, 1.0, initial=(0.0, 0.0, 0.0, 0.0)),)
        sim = Simulation(Scene(bodies, laws=(use("contact_elastic", restitution=1.0),), time=Time(dt=1e-4)))
        with pytest.raises(InputError, match="impulses"):
            save_checkpoint(sim, tmp_path / "c.npz")


def test_killed_while_it_writes(tmp_path):
    """Killed at any moment, the last good checkpoint is there."""
    path = tmp_path / "c.npz"
    script = (
        "import sys; sys.path.insert(0, sys.argv[2])\n"
        "from test_engine import *\nfrom granswim_pymunk.engine import save_checkpoint\n"
        "sim = Simulation(small_bed()); sim.advance(5)\n"
        "while True:\n    save_checkpoint(sim, sys.argv[1]); print('.', flush=True); sim.advance(1)\n"
    )
    command = [sys.executable, "-c", script, str(path), os.path.dirname(__file__)]
    for wait in (0.003, 0.011):
        with subprocess.Popen(command, stdout=subprocess.PIPE) as program:
            assert program.stdout is not None and program.stdout.read(1) == b"."
            time.sleep(wait)
            program.send_signal(signal.SIGKILL)
        assert load_checkpoint(path)[0]["step"] >= 5


def two_falling() -> Scene:
    bodies = (
        Body("0", "free", 0.01, 0.02, initial=(0.0, 0.0, 0.3, 0.0)),
        Body("1", "free", 0.01, 0.02, initial=(0.0205, 0.001, -0.3, 0.0)),
    )
    return Scene(bodies, laws=(use("contact_linear", stiffness=2e5, damping=1e2),), time=Time(dt=2e-6, duration=0.01))


def test_a_stopped_run_goes_on(tmp_path, monkeypatch, capsys):
    """Stopped in the middle and gone on with: trajectory and frames of the run that was never stopped."""
    write_scene(two_falling(), tmp_path / "two.toml")
    more = {"frames": 9, "video": "none", "quiet": True}
    whole = run_scene(tmp_path / "two.toml", tmp_path / "whole", **more)
    monkeypatch.setattr("granswim_pymunk.run.CHECKPOINT_EVERY", 0.0)
    monkeypatch.setitem(run_scene.__globals__["BLOCK"], "verlet", 4000)  # 200 steps
    advance = Simulation.advance

    def interrupted(self, steps):
        advance(self, steps)
        if self.step >= 2600:
            raise SimulationError("of the test")

    with monkeypatch.context() as patch:
        patch.setattr(Simulation, "advance", interrupted)
        with pytest.raises(SimulationError, match=r"of the test.*checkpoint of t = .* is kept"):
            run_scene(tmp_path / "two.toml", tmp_path / "part", **more)
    assert load_checkpoint(tmp_path / "part" / CHECKPOINT)[0]["step"] >= 2000
    assert main(["run", "--resume", str(tmp_path / "part")]) == 0
    a, b = read_trajectory(whole.trajectory), read_trajectory(tmp_path / "part" / "trajectory.h5")
    np.testing.assert_array_equal(a.step, b.step)
    assert bits(a.t, a.xy, a.v, *a.more.values()) == bits(b.t, b.xy, b.v, *b.more.values())
    for frame in whole.frames:
        assert frame.read_bytes() == (tmp_path / "part" / "frames" / frame.name).read_bytes()
    assert not (tmp_path / "part" / CHECKPOINT).exists()
    capsys.readouterr()
    assert main(["run", "--resume", str(tmp_path / "part")]) == 2
    assert capsys.readouterr().err.strip().splitlines() == [
        f"granswim run: {tmp_path / 'part'}: the run is finished: there is nothing to go on with"
    ]
    (tmp_path / "part" / "run.json").unlink()
    with pytest.raises(InputError, match="no such file"):
        resume_run(tmp_path / "part", quiet=True)


class TestWatch:
    def watched(self, scene, steps=200, **more):
        sim = Simulation(scene)
        watch = Watch(sim, **more)
        for _ in range(12):
            sim.advance(1)
            watch.look()
        for _ in range(steps):
            sim.advance(5)
            watch.look()

    def test_overlap(self):
        scene = small_bed()
        with pytest.raises(SimulationError, match=r"body g\S+ overlaps body \S+ by .* % of a radius .*t = "):
            self.watched(scene)
        self.watched(scene, overlap=math.inf)

    def test_overlap_from_the_start_may_come_apart(self):
        bodies = tuple(Body(f"{k}", "free", 0.01, 0.02, initial=(0.018 * k, 0.0, 0.0, 0.0)) for k in range(2))
        scene = Scene(bodies, laws=(use("contact_linear", stiffness=2e3, damping=0.0),), time=Time(dt=1e-5))
        self.watched(scene)

    def test_out_of_the_box(self):
        scene = small_bed()
        fast = dataclasses.replace(scene.body("g6-0"), initial=(0.001, 0.0135, 0.0, 150.0))
        bodies = tuple(fast if b.id == "g6-0" else b for b in scene.bodies)
        with pytest.raises(SimulationError, match=r"body g6-0 is out of the box, at x = "):
            self.watched(dataclasses.replace(scene, bodies=bodies), overlap=math.inf)

    def test_energy_that_jumps(self):
        sim = Simulation(dataclasses.replace(two_falling(), laws=(CONTACT,)))
        watch = Watch(sim)
        for _ in range(12):
            sim.advance(1)
            watch.look()
        sim.body("1").velocity = (0.0, 30.0)
        with pytest.raises(SimulationError, match=r"body 1 has .* times the largest kinetic energy"):
            watch.look()

    def test_not_a_number(self):
        sim = Simulation(two_falling())
        watch = Watch(sim)
        sim.body("1").velocity = (math.nan, 0.0)
        with pytest.raises(SimulationError, match="body 1 has a position or velocity that is not finite"):
            watch.look()
