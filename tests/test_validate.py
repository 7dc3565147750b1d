"""The engine through the cases of ``granswim validate``, and ``granswim crosscheck``."""

import json
import shutil

import numpy as np
import pytest
import tomli_w

from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.validation import analytic, cases_bed, report
from granswim_pymunk.validation.crosscheck import SHIPPED, crosscheck, read_bed
from granswim_pymunk.validation.reference import Reference
from granswim_pymunk.validation.results import Case, Figure, Line, Panel, crossings, runner


@pytest.mark.parametrize(
    ("function", "mode"), report.CASES, ids=[f"{function.__name__}-{mode}" for function, mode in report.CASES]
)
def test_case(function, mode, tmp_path):
    case = function(mode, quick=True)
    failed = [f"{f.name}: {f.value:g} > {f.bound:g} ({f.note})" for f in case.figures if not f.holds]
    assert case.figures and not failed, "; ".join(failed)
    path = report.plot(case, tmp_path)
    assert path is None or path.stat().st_size > 5000


class TestAnalytic:
    def test_hertz_prefactor(self):
        # Landau & Lifshitz: T = 2.9432 delta_max/v
        m, k, v = 1e-6, 1e5, 0.3
        deepest = (5 * m * v**2 / (4 * k)) ** 0.4
        assert analytic.hertz_duration(k, m, v) * v / deepest == pytest.approx(2.9432, abs=1e-4)

    def test_restitution_of_a_weak_dashpot(self):
        assert analytic.linear_restitution(1e3, 1e-3, 1e-6) == pytest.approx(
            1 - 1e-3 * np.pi / (2 * 31622.8), abs=1e-12
        )
        with pytest.raises(ValueError, match="overdamped"):
            analytic.linear_restitution(1.0, 1e4, 1e-6)

    def test_modes_of_two_masses(self):
        omega, _, _ = analytic.modes(analytic.chain_stiffness(2, 5.0), np.array([2.0, 3.0]))
        np.testing.assert_allclose(omega, np.sqrt(5.0 * (1 / 2 + 1 / 3)), rtol=1e-12)

    @pytest.mark.parametrize(("form", "second"), [("leader", 22), ("elastic", 17), ("head_axis", 25)])
    def test_second_mode_of_the_swimmer(self, form, second):
        mass = np.full(7, 1.4194e-5)
        mass[0] *= 7
        omega, shapes, duals = analytic.modes(analytic.bending_stiffness(7, 2e-3, 3e-3, form), mass)
        assert omega[1] / (2 * np.pi) == pytest.approx(second, abs=0.6)
        np.testing.assert_allclose(duals @ shapes.T, np.eye(6), atol=1e-9)

    def test_crossings(self):
        t = np.linspace(0.0, 1.0, 101)
        np.testing.assert_allclose(crossings(t, np.cos(3 * np.pi * t)), [1 / 6, 0.5, 5 / 6], atol=1e-5)


class TestValidateCommand:
    def run(self, monkeypatch, tmp_path, figures):
        line = Line("measured", np.array([1.0, 2.0]), np.array([3.0, 4.0]))
        panels = (Panel("a plot", "x [m]", "y [m]", (line,)),)

        def case(mode, quick):
            if figures is None:
                raise InputError("no such thing")
            return Case(f"made up ({mode})", figures, panels)

        monkeypatch.setattr(report.validate, "__defaults__", (False, None, print, ((case, "verlet"),)))
        code = main(["validate", "--out", str(tmp_path / "plots"), "--json", str(tmp_path / "v.json")])
        return code, json.loads((tmp_path / "v.json").read_text())

    def test_all_hold(self, monkeypatch, tmp_path, capsys):
        code, data = self.run(monkeypatch, tmp_path, (Figure("length", 1e-4, 1e-3, "m", "of a rod"),))
        assert code == 0 and data["holds"] is True
        expected = {"case": "made up (verlet)", "name": "length", "value": 1e-4, "bound": 1e-3, "unit": "m"}
        assert data["figures"] == [expected | {"holds": True, "note": "of a rod"}]
        assert "holds   of a rod" in capsys.readouterr().out
        assert [p.name for p in (tmp_path / "plots").iterdir()] == ["made_up_verlet.png"]

    def test_one_does_not(self, monkeypatch, tmp_path, capsys):
        figures = Figure("good", -1e-4, 1e-3), Figure("bad", -2e-3, 1e-3), Figure("lost", float("nan"), 1.0)
        code, data = self.run(monkeypatch, tmp_path, figures)
        assert code == 1 and data["holds"] is False
        assert [(f["value"], f["holds"]) for f in data["figures"]] == [
            (-1e-4, True),
            (-2e-3, False),
            (None, False),
        ]
        assert capsys.readouterr().out.count("DOES NOT HOLD") == 2

    def test_one_cannot_run(self, monkeypatch, tmp_path):
        code, data = self.run(monkeypatch, tmp_path, None)
        assert code == 1
        assert data["figures"][0]["note"] == "InputError: no such thing"

    def test_nowhere_to_write(self, tmp_path, capsys):
        assert main(["validate", "--json", str(tmp_path / "no" / "v.json")]) == 2
        assert "its folder does not exist" in capsys.readouterr().err


@pytest.fixture
def other_bed(tmp_path):
    """A bed that is not periodic, with other laws, steps and roles; computed by the reference integrator."""
    scene = cases_bed.small_bed(walls=True)
    laws = [
        {"name": "contact_hertz", "stiffness": 1e5, "damping": 5e3},
        {"name": "quadratic_drag", "c": 1e-3, "p": 1},
        {"name": "uniform_force", "a": [0.3, 0.0], "bodies": ["7", "9"]},
        {"name": "spring", "body": "8", "anchor": [0.0, 0.0], "stiffness": 0.2, "length": 0.01},
    ]
    roles = np.array(
        ["free" if body.role == "head" else body.role.replace("tail", "grain") for body in scene.bodies]
    )
    start = np.array([body.initial for body in scene.bodies])
    start[:, 0] %= scene.periodic_x
    arrays = {
        "role": roles,
        "radius": np.array([body.radius for body in scene.bodies]),
        "mass": np.array([body.mass for body in scene.bodies]),
        "start": start,
    }
    table = {"scene": {"gravity": [0.0, -9.81]}, "time": {"dt": 4e-6, "steps": [7, 60]}, "law": laws}
    path = tmp_path / "heap.npz"

    def write(**changes):
        np.savez(path, **{k: v for k, v in {**arrays, **changes}.items() if v is not None})
        path.with_suffix(".toml").write_text(tomli_w.dumps(table))
        return path

    write(after_7=start, after_60=start)
    run = Reference(read_bed(path).scene, start="leapfrog")
    for steps in (7, 60):
        run.advance(steps - run.step)
        arrays[f"after_{steps}"] = np.concatenate([run.state().xy, run.v_half], axis=1)
    write.table = table
    write()
    return write


class TestCrosscheck:
    @pytest.mark.parametrize("mode", ["verlet", "chipmunk", "python", "reference"])
    def test_another_bed(self, mode, other_bed, tmp_path, capsys):
        assert (
            main(["crosscheck", str(other_bed()), "--mode", mode, "--json", str(tmp_path / "out.json")]) == 0
        )
        data = json.loads((tmp_path / "out.json").read_text())
        assert [set(entry) for entry in data] == [{"steps", "max_position_error"}] * 2
        assert [entry["steps"] for entry in data] == [7, 60]
        assert max(entry["max_position_error"] for entry in data) < 1e-13
        assert len(capsys.readouterr().out.splitlines()) == 4

    def test_sees_a_difference(self, other_bed):
        path = other_bed()
        other_bed.table["law"][1]["c"] = 2e-3
        other_bed()
        assert all(d.max_position_error > 1e-13 for d in crosscheck(path))

    def test_largest_over_bodies_and_components(self, other_bed):
        data = dict(np.load(other_bed()))
        data["after_60"][5, :2] += 3e-6, 4e-6
        found = list(crosscheck(other_bed(after_60=data["after_60"])))
        assert found[1].max_position_error == pytest.approx(5e-6, rel=1e-6)

    def test_wrapped_positions_and_steps_from_the_file(self, tmp_path):
        data = dict(np.load(SHIPPED / "bed_9Hz.npz"))
        data["after_10"][:, 0] %= 0.1
        for key in ("after_1", "after_100", "after_1000", "after_5000"):
            del data[key]
        np.savez(tmp_path / "bed.npz", **data)
        text = (SHIPPED / "bed_9Hz.toml").read_text().replace("steps = [1, 10, 100, 1000, 5000]", "")
        (tmp_path / "bed.toml").write_text(text)
        assert [d.steps for d in crosscheck(tmp_path / "bed.npz")] == [10]
        assert next(iter(crosscheck(tmp_path / "bed.npz"))).max_position_error < 1e-15

    @pytest.mark.parametrize(
        ("changes", "said"),
        [
            ({"mass": None}, "has no 'mass'"),
            ({"after_60": None}, "has no 'after_60'"),
            ({"radius": np.ones(3)}, "radius: should be numbers of shape"),
            ({"radius": np.full(103, -1.0)}, "above zero"),
            ({"start": np.full((103, 4), np.nan)}, "finite"),
            ({"role": np.full(103, "gain")}, "role of row 0: should be one of"),
            ({"after_7": np.full((103, 4), np.nan)}, "after_7: a position is not finite"),
        ],
    )
    def test_wrong_arrays(self, changes, said, other_bed, tmp_path, capsys):
        path = other_bed(**changes)
        assert main(["crosscheck", str(path), "--json", str(tmp_path / "out.json")]) == 2
        error = capsys.readouterr().err
        assert said in error and "heap" in error and error.count("\n") == 1
        assert not (tmp_path / "out.json").exists()

    @pytest.mark.parametrize(
        ("table", "said"),
        [
            ({"law": [{"name": "contact_cubic"}]}, "contact_cubic"),
            ({"time": {"steps": [7]}}, "time: needs dt"),
            ({"time": {"dt": -1.0, "steps": [7]}}, "dt should be above zero"),
            ({"time": {"dt": 1e-6, "steps": [7.5]}}, "time.steps"),
            ({"time": {"dt": 1e-6, "steps": []}}, "time.steps"),
            ({"scene": {"periodic": 0.1}}, "unknown key 'periodic'"),
            ({"bodies": "bodies.csv"}, "bodies stand in the npz"),
        ],
    )
    def test_wrong_table(self, table, said, other_bed, capsys):
        other_bed.table.update(table)
        assert main(["crosscheck", str(other_bed())]) == 2
        error = capsys.readouterr().err
        assert said in error and "heap.toml" in error and error.count("\n") == 1

    def test_missing_files(self, tmp_path, capsys):
        assert main(["crosscheck", str(tmp_path / "none.npz")]) == 2
        assert "no such file; beds that come with the package: bed_9Hz" in capsys.readouterr().err
        shutil.copy(SHIPPED / "bed_9Hz.npz", tmp_path / "alone.npz")
        assert main(["crosscheck", str(tmp_path / "alone.npz")]) == 2
        assert "alone.toml: cannot read it" in capsys.readouterr().err
        (tmp_path / "text.npz").write_text("not an archive")
        assert main(["crosscheck", str(tmp_path / "text.npz")]) == 2
        assert "text.npz: is not an NPZ" in capsys.readouterr().err


@pytest.mark.parametrize("mode", ["verlet", "chipmunk", "python", "batch"])
def test_contacts_and_forces_of_the_engine(mode):
    """Pairs, normals, overlaps, normal forces and the sum of all forces, beside the reference's."""
    scene = cases_bed.small_bed()
    run, other = runner(scene, mode, 2e-6), Reference(scene, dt=2e-6)
    run.advance(100)
    other.advance(100)
    item = scene.laws_named("contact_linear")[0]
    xy, v = other.state().xy, other.state().v
    other.laws.pairs.update(xy)
    i, j, normal, gap, force = other.laws.contact_forces(item, scene.resolved(item), xy, v)
    found = run.contacts()
    order = np.lexsort((found.j, found.i))
    assert len(i) > 20
    np.testing.assert_array_equal(np.stack([found.i, found.j])[:, order], np.stack([i, j]))
    np.testing.assert_allclose(found.normal[order], normal, atol=1e-10)
    np.testing.assert_allclose(found.overlap[order], -gap, atol=1e-15)
    np.testing.assert_allclose(found.force[order], force, atol=1e-9 * np.abs(force).max())
    # the forces of the last kick, which saw the velocities of half a step before
    mass = np.array([[body.mass] for body in scene.bodies])
    expected = (other.v_half - other.state().v) * mass / (0.5 * other.dt)
    np.testing.assert_allclose(run.forces(), expected, atol=1e-8 * np.abs(expected).max())
