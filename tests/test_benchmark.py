"""The benchmark: its beds, its plain loop against the engine, its rows."""

import json

import numpy as np
import pytest

from granswim_pymunk.benchmarks.beds import bed, contacts_only
from granswim_pymunk.benchmarks.lammps_bed import find_lammps
from granswim_pymunk.benchmarks.profile import profile, table
from granswim_pymunk.benchmarks.speed import agreement, benchmark
from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError


@pytest.mark.parametrize(("grains", "fraction"), [(100, 0.5), (500, 0.65), (3000, 0.75)])
def test_bed_of_any_size(grains, fraction):
    scene = bed(grains)
    assert len(scene.bodies) == pytest.approx(grains * 2328 / 2264, rel=0.1)
    x, y = np.array([b.initial[:2] for b in scene.bodies]).T
    assert scene.periodic_x is not None and 0 <= x.min() and x.max() < scene.periodic_x
    # as dense as the shipped bed, but for the holes at a seam
    area = sum(np.pi * b.radius**2 for b in scene.bodies if b.mobile)
    assert area / (scene.periodic_x * (y.max() - y.min())) > fraction
    scene.check_overlaps()


def test_engines_agree():
    scene = bed(300)
    engines = ["verlet", "chipmunk", "plain"] + ([] if find_lammps() else ["lammps"])
    result = agreement(scene, engines, steps=100)
    assert [a.engine for a in result] == engines[1:]
    for a in result:
        assert a.max_position_error < 1e-14, a
    start = np.array([b.initial[:2] for b in scene.bodies])
    from granswim_pymunk.engine import Simulation

    sim = Simulation(contacts_only(scene))
    sim.advance(100)
    assert np.abs(sim.state().xy - start).max() > 1e-6  # it moved


def test_rows_and_files(tmp_path, capsys):
    code = main(["benchmark", "--grains", "60", "--engines", "verlet", "plain", "--rounds", "1", "--no-memory",
                 "--json", str(tmp_path / "b.json"), "--out", str(tmp_path / "out")])  # fmt: skip
    assert code == 0
    rows = json.loads((tmp_path / "b.json").read_text())
    assert [row["engine"] for row in rows] == ["verlet", "plain"]
    assert set(rows[0]) >= {"engine", "grains", "us_per_step", "ratio_to_lammps", "memory_mb"}
    assert all(0.1 < row["us_per_step"] < 1e4 for row in rows)
    assert (tmp_path / "out" / "benchmark.png").stat().st_size > 5000
    assert "verlet" in capsys.readouterr().out


def test_phases_of_a_step(tmp_path):
    assert main(["benchmark", "--grains", "60", "--engines", "verlet", "--rounds", "1", "--no-memory", "--profile",
                 "--out", str(tmp_path)]) == 0  # fmt: skip
    assert "broad phase" in (tmp_path / "benchmark.md").read_text()
    found = profile(bed(150), 150, rounds=3, block=0.005)
    assert [p.phase for p in found if p.mode == "chipmunk"][1] == "broad phase"
    for mode in ("verlet", "chipmunk"):
        # a difference of two times can be noise, their sum is the whole step
        assert 1.0 < sum(p.ns_per_grain for p in found if p.mode == mode) < 1e6
    assert table(found).count("| 150 grains |") == 1


def test_wrong_input(tmp_path, capsys):
    assert main(["benchmark", "--engines", "fast"]) == 2
    assert main(["benchmark", "--grains", "3"]) == 2
    assert main(["benchmark", "--json", str(tmp_path / "nowhere" / "b.json")]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 3
    with pytest.raises(InputError):
        benchmark([60], rounds=0, engines=["none"])
