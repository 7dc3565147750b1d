"""What ``import granswim_pymunk`` offers: names, recordings of arrays and tables, results in words and figures."""

import ast
import doctest
import inspect
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from threadpoolctl import threadpool_info, threadpool_limits

import granswim_pymunk as gs
import granswim_pymunk.api
import granswim_pymunk.result
from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.criteria import DEFAULT, current
from granswim_pymunk.inference.entry import METHODS
from granswim_pymunk.inference.judge import Remains
from granswim_pymunk.inference.mechanisms import rival_names
from granswim_pymunk.inference.places import Place
from granswim_pymunk.inference.result import Diagnosis, empty_verdict, mechanism_entry, rival_entries
from granswim_pymunk.report.page import SECTIONS
from granswim_pymunk.report.style import Drawing

T = np.linspace(0.0, 1.0, 11)
XY = np.stack([np.stack([0.3 * T, 0 * T], -1), np.stack([0 * T, 1 + 0.2 * T], -1)], axis=1)  # (11, 2, 2)
BODY = {"radius": 5e-3, "mass": 0.01}


# ---- the module ------------------------------------------------------------------------------------


def test_names_are_loaded_when_used_and_help_lists_them():
    assert all(getattr(gs, name) is not None for name in gs.__all__)
    assert set(gs.__all__) <= set(dir(gs)) and gs.__all__ == sorted(gs.__all__)
    # type checkers read the imports, programs the table: the same names from the same places
    (block,) = [n for n in ast.parse(inspect.getsource(gs)).body if isinstance(n, ast.If)]
    typed = {alias.name: node.module for node in block.body for alias in node.names}
    assert typed == gs._MODULE and set(typed) == set(gs.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        gs.nonsense  # noqa: B018


def test_importing_the_package_loads_nothing_heavy():
    heavy = "{'numpy', 'numba', 'scipy', 'pandas'}"
    code = f"import sys, granswim_pymunk as gs; dir(gs); print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("module", [granswim_pymunk.api, granswim_pymunk.result], ids=lambda m: m.__name__)
def test_examples_in_the_docstrings(module):
    failed, _ = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    assert failed == 0


# ---- recordings of arrays and tables -----------------------------------------------------------------


def test_a_recording_of_arrays():
    table = {"name": "coulomb_substrate", "mu": 0.1}
    laws = [gs.use("linear_drag", c=1e-3), "spring:a,anchor=0 0,stiffness=2,length=0.1", table]
    made = gs.make_recording(
        T, XY, radius="5mm", mass={"b": "20g", "a": 0.01}, laws=laws, gravity=9.81, names=["a", "b"],
        adjustable={"spring.length": (0.05, 0.2)},
    )  # fmt: skip
    scene = made.scene
    assert [(b.id, b.radius, b.mass) for b in scene.bodies] == [("a", 5e-3, 0.01), ("b", 5e-3, 0.02)]
    assert [item.name for item in scene.laws] == ["gravity", "linear_drag", "spring", "coulomb_substrate"]
    assert scene.gravity == (0.0, -9.81) and scene.laws[2].bodies == ("a",)
    assert (scene.adjustable[0].name, scene.adjustable[0].low) == ("spring.length", 0.05)
    np.testing.assert_array_equal(made.xy, XY)


def test_one_body_may_be_given_without_its_axis_and_masked():
    hidden = np.ma.masked_array(XY[:, 0], mask=np.zeros((11, 2), dtype=bool))
    hidden[3] = np.ma.masked
    made = gs.make_recording(T, hidden, **BODY, angle=0.1 * T)
    assert made.ids == ("body",) and made.xy.shape == (11, 1, 2) and made.angle.shape == (11, 1)
    assert np.isnan(made.xy[3]).all() and np.isfinite(made.xy[4]).all()


def test_a_scene_says_all_and_its_order_holds():
    scene = gs.Scene((gs.Body("b", "free", 5e-3, 0.01), gs.Body("a", "free", 6e-3, 0.02)))
    made = gs.make_recording(T, XY, scene=scene, names=["a", "b"])
    assert made.ids == ("b", "a")
    np.testing.assert_array_equal(made.xy[:, 1], XY[:, 0])
    with pytest.raises(InputError, match="says radius already"):
        gs.make_recording(T, XY, scene=scene, radius=1.0)


def test_a_template_finds_the_rod():
    angle = 0.8 * np.cos(6.26 * np.linspace(0, 3, 181))
    xy = 0.25 * np.stack([np.sin(angle), -np.cos(angle)], axis=-1)
    made = gs.make_recording(np.linspace(0, 3, 181), xy, radius=0.01, mass=0.05, names="bob", scene="pendulum")
    (pin,) = made.scene.laws_named("pin")
    assert pin.values["length"] == pytest.approx(0.25, rel=0.02) and made.scene.gravity == (0.0, -9.81)
    given = gs.make_recording(
        np.linspace(0, 3, 181), xy, radius=0.01, mass=0.05, names="bob", scene="pendulum",
        laws=gs.use("pin", anchor=(0.0, 0.0), length=0.25, bodies=["bob"]),
    )  # fmt: skip
    assert given.scene.laws_named("pin")[0].values["length"] == 0.25


def table():
    """As trackpy.link leaves it: an index called frame beside the column, brightness called mass."""
    rows = [(f, p, 10 * p + f, 5.0 - f, 700.0) for f in range(4) for p in (3, 12) if not (f == 2 and p == 12)]
    frame = pd.DataFrame(rows, columns=["frame", "particle", "x", "y", "mass"])
    return frame.set_index(frame["frame"].to_numpy()).rename_axis("frame")


def test_a_table_of_trackpy():
    made = gs.make_recording(table(), fps=50, scale="1mm/px", radius={3: 1e-4, 12: 2e-4}, mass="1g")
    assert made.ids == ("3", "12") and [b.radius for b in made.scene.bodies] == [1e-4, 2e-4]
    assert made.scene.bodies[0].mass == 1e-3  # and not the brightness
    np.testing.assert_allclose(made.t, [0.0, 0.02, 0.04, 0.06])
    np.testing.assert_allclose(made.xy[1], [[0.031, -0.004], [0.121, -0.004]])
    assert np.isnan(made.xy[2, 1]).all()
    upwards = gs.make_recording(table(), fps=50, scale=1e-3, flip_y=False, radius=1e-4, mass=1e-3, min_frames=4)
    assert upwards.ids == ("3",) and upwards.xy[0, 0, 1] == pytest.approx(5e-3)


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda f: {"fps": None}, "needs the frames per second"),
        (lambda f: {"scale": None}, "metres per pixel"),
        (lambda f: {"scale": "wide"}, "scale: should be one of"),
        (lambda f: {"data": f.drop(columns="particle")}, "trackpy.link"),
        (lambda f: {"data": pd.concat([f, f.iloc[:1]])}, "particle 3 stands twice in frame 0"),
        (lambda f: {"min_frames": 9}, "no particle is seen in 9 frames"),
        (lambda f: {"data": f.assign(x="left")}, "x: should be numbers"),
    ],
)
def test_tables_that_do_not_fit(change, message):
    said = {"data": table(), "fps": 50, "scale": "1mm/px", "radius": 1e-4, "mass": 1e-3}
    with pytest.raises(InputError, match=message):
        gs.make_recording(**{**said, **change(table())})


@pytest.mark.parametrize(
    "change, message",
    [
        ({"xy": XY[:5]}, r"xy: should have the shape \(T, n, 2\) with T = 11, got \(5, 2, 2\)"),
        ({"xy": None}, "belong together"),
        ({"radius": None}, "radius: is not said"),
        ({"radius": [1.0]}, "radius: 1 numbers for 2 bodies"),
        ({"radius": "wide"}, "radius"),
        ({"mass": {"0": 1.0}}, "mass: body 1 has none"),
        ({"names": ["a"]}, "1 names for 2 bodies"),
        ({"names": ["a", "a"]}, "used twice"),
        ({"laws": "linear_drag:nobody,c=1"}, "nobody"),
        ({"laws": [3]}, r"laws: should be use\(...\)"),
        ({"laws": [{"c": 1.0}]}, "laws: needs a name"),
        ({"gravity": -9.81}, "gravity: a single number is its size"),
        ({"scene": "planet"}, "scene: should be a Scene or one of pendulum"),
        ({"adjustable": {"pin.length": 3}}, r"pin.length: should be \(low, high\)"),
        ({"data": T[::-1]}, "rise"),
        ({"fps": 30}, "belong to a table"),
        ({"angle": T[:3]}, "angle: should have the shape"),
    ],
)
def test_arrays_that_do_not_fit(change, message):
    said = {"data": T, "xy": XY, "radius": 5e-3, "mass": 0.01}
    with pytest.raises(InputError, match=message):
        gs.make_recording(**{**said, **change})


# ---- diagnose: every form in which recordings come ------------------------------------------------------


@pytest.fixture
def seen(monkeypatch):
    """What reaches the diagnosis itself, and a verdict of its own."""
    calls = []

    def method(training, held, *, minutes, seed, progress):
        calls.append(([r.name for r in training], [r.name for r in held], seed, training))
        return Diagnosis("bodies", empty_verdict("no_mismatch") | {"notes": ["a note"]})

    monkeypatch.setitem(METHODS, "bodies", method)
    return calls


def test_criteria_reach_the_diagnosis(monkeypatch):
    told = []

    def method(training, held, *, minutes, seed, progress):
        told.append(current().verdict.share)
        return Diagnosis("bodies", empty_verdict("no_mismatch"))

    monkeypatch.setitem(METHODS, "bodies", method)
    for criteria in (None, replace(DEFAULT, verdict=replace(DEFAULT.verdict, share=0.8))):
        gs.diagnose(T, XY, **BODY, criteria=criteria)
    assert told == [0.5, 0.8] and current() is DEFAULT


def test_forms_of_recordings(seen, tmp_path):
    pair, own = (T, XY), gs.make_recording(T, XY, **BODY, name="own")
    gs.write_recording(own, tmp_path / "folder")
    for data, trained in (
        (pair, ["tracks"]), (own, ["own"]), ([own], ["own"]), (tmp_path / "folder", ["folder"]),
        (str(tmp_path / "folder"), ["folder"]), ("pendulum", ["pendulum"]), (("pendulum", own), ["pendulum", "own"]),
        ([pair, own, pair], ["tracks_1", "own", "tracks_2"]),
    ):  # fmt: skip
        bare = data is pair or (isinstance(data, list) and len(data) == 3)
        result = gs.diagnose(data, **(BODY if bare else {}), seed=3)
        assert seen[-1][:3] == (trained, [], 3) and result.out is None
        assert result.verdict["notes"] == ["a note"]
    gs.diagnose(T, XY, **BODY, hold_out=(T, XY + 1.0), gravity=2.0)
    assert seen[-1][:2] == (["tracks"], ["tracks_held_out"]) and seen[-1][3][0].scene.gravity == (0.0, -2.0)
    gs.diagnose(table(), fps=50, scale=1e-3, radius=1e-4, mass=1e-3, name="film")
    assert seen[-1][0] == ["film"]
    assert not [p for p in tmp_path.iterdir() if p.name != "folder"]


def test_with_out_it_is_written(seen, tmp_path):
    result = gs.diagnose(T, XY, **BODY, out=tmp_path / "out")
    assert json.loads((tmp_path / "out/verdict.json").read_text()) == result.to_dict()
    assert result.out == tmp_path / "out"
    assert gs.load_verdict(tmp_path / "out") == result


@pytest.mark.parametrize(
    "data, said, message",
    [
        ("pendulum", {"radius": 1.0}, "says its own radius"),
        ([], {}, "no recording is given"),
        (T, BODY, "list of these, got ndarray"),
        ([T.tolist()], BODY, "got list"),
        ((T, XY), {}, "radius: is not said"),
    ],
)
def test_forms_that_are_none(seen, data, said, message):
    with pytest.raises(InputError, match=message):
        gs.diagnose(data, **said)
    assert not seen


# ---- results -----------------------------------------------------------------------------------------


@pytest.fixture
def verdict():
    found = empty_verdict("missing_physics")
    flow = ([0.1, 0.2], [0.0, 0.1], [0.2, 0.3], "m/s")
    numbers = {"c": (1.02e-3, 0.96e-3, 1.08e-3, "kg/s"), "p": (0, None, None, "1"), "u": flow}
    found["mechanisms"] = [mechanism_entry("ambient_flow", "F = -c (v - <u>)", ["a", "b"], numbers, 0.9, 12.5)]
    found["mismatch"] = [Place(["a"], 9.0, 1e-9, region="tail", phase=(0.1, 0.3)).as_dict()]
    found["rivals"] = [
        {"name": "linear_drag", "gain_heldout": 3.0, "indistinguishable": True},
        {"name": "gravity", "gain_heldout": 0.0, "indistinguishable": False},
    ]
    found["fit"]["train"] |= {"naive": 1e-3, "revised": 1e-4}
    found["fit"]["heldout"] |= {"naive": 2e-3}
    found["null"] = {"p_false_alarm": 0.01, "replicates": 99}
    found["explained"] = {"share": 0.86, "low": 0.80, "high": 0.91, "best_free_form": 0.88}
    found["remains"] = {"rms": 1e-3, "times_floor": 5.6, "bodies": ["a"], "when": {}, "looks_like": "a push"}
    found["heldout"] = "holds"
    found["next_experiment"] = {"change": "frequency = 14 Hz", "separates": ["a", "b"], "d_prime": 3.1}
    found["recalibrated"] = {"pin.length": {"value": 0.25, "low": 0.24, "high": 0.26}}
    found["notes"] = ["a note"]
    return found


def test_each_rival_is_told_once(verdict):
    """Laws of one mechanism on other bodies, or in another form, have one name."""
    others = [("ambient_flow", 3.6, False), ("ambient_flow", 3.5, False), ("gravity", 2.0, False), ("drag", 1.0, True)]
    entries = rival_entries([("lens", -1.0)], [("lens", 0.1, 0.5)], [*others, ("drag", 0.5, False)])
    assert [r["name"] for r in entries] == ["lens", "ambient_flow", "gravity", "drag"]
    assert entries[0]["withdrawn"] and entries[1]["gain_heldout"] == 3.6
    # a verdict of an older version
    twice = [{"name": name, "gain_heldout": gain, "indistinguishable": same} for name, gain, same in others]
    assert rival_names([*twice, twice[-1]]) == (["drag"], ["ambient_flow", "gravity"])
    assert "do worse: ambient_flow, gravity" in gs.Result(verdict | {"rivals": twice}).summary()


def test_summary_reads_like_a_report_of_a_fit(verdict):
    result = gs.Result(verdict)
    text = result.summary()
    for line in (
        "missing_physics: the scene leaves out physics that has a name",
        "ambient_flow on a, b: F = -c (v - <u>)",
        "c: 0.00102 +/- 3.1e-05 kg/s (3 %), 95 %: 0.00096 to 0.00108",
        "p: 0 (chosen)",
        "u[1]: 0.2 +/- 0.051 m/s (26 %), 95 %: 0.1 to 0.3",
        "explains 86 % (80 to 91 %) of the mismatch",
        "5.6 times the noise is left, most on a; it looks like a push",
        "held-out data: holds",
        "pin.length: 0.25 +/- 0.0051 (2 %), 95 %: 0.24 to 0.26",
        "these data cannot tell it from linear_drag", "do worse: gravity",
        "tail a, phase 0.1 to 0.3: z = 9, p = 1e-09", "frequency = 14 Hz, tells a from b (d' = 3.1)", "a note",
    ):  # fmt: skip
        assert " ".join(line.split()) in " ".join(text.split()), line
    weak = verdict | {"next_experiment": {"change": "half the speed", "separates": ["a", "b"], "d_prime": 0.5}}
    assert "none that was thought of would decide; the best is half the speed" in gs.Result(weak).summary()
    forms = (("flexible_power", "quadratic_drag", False), ("flexible_place", "quadratic_drag", True))
    left = Remains(1e-4, 1.0, ("a",), None, None, "nothing that was tried", alike=forms).as_dict()
    assert left["looks_like"].startswith("nothing but noise; ") and left["looks_like"].count(" does ") == 2
    untold = gs.Result(verdict | {"remains": left}).summary()
    assert f"what is left passes for noise; but {left['looks_like'].partition('; ')[2]}: its form is not told" in untold
    assert repr(text) == str(text) and "None" not in text
    assert repr(result) == "<Result missing_physics: ambient_flow on a, b (86 % explained)>"
    page = result._repr_html_()
    assert "&lt;u&gt;" in page and "<u>" not in page and "86 %" in page
    assert repr(gs.Result(empty_verdict("no_mismatch"))) == "<Result no_mismatch>"
    assert "passes for noise" in gs.Result(empty_verdict("no_mismatch")).summary()


def test_a_result_is_a_mapping_and_its_copy_is_a_copy(verdict):
    result = gs.Result(verdict)
    assert result["heldout"] == "holds" and set(result) == set(verdict) and result.names == ("ambient_flow",)
    result.to_dict()["mechanisms"].clear()
    assert result["mechanisms"] and json.dumps(result.to_dict())


def test_figures_of_a_result(verdict, monkeypatch):
    figures = {name: Figure() for name in ("map", "null")}
    module = SimpleNamespace(
        pictures=lambda found: {name: Drawing(lambda f=f: f, SECTIONS[0], "told") for name, f in found.items()}
    )
    monkeypatch.setattr("granswim_pymunk.report.page._module", lambda kind: module)
    result = gs.Result(verdict, Diagnosis("bed", verdict, evidence=figures))
    assert result.parts == ("map", "null") and result.plot() is figures["map"]
    assert result.plot("null") is figures["null"]
    with pytest.raises(InputError, match="no figure 'nul'; there are: map, null"):
        result.plot("nul")
    with pytest.raises(InputError, match="has no figures"):
        gs.Result(verdict).plot()


def test_a_verdict_that_was_written(verdict, tmp_path):
    (tmp_path / "verdict.json").write_text(json.dumps(verdict))
    (tmp_path / "figures").mkdir()
    picture = Figure(figsize=(2, 1), dpi=100)
    for name in ("a", "overlay"):
        picture.savefig(tmp_path / "figures" / f"{name}.png")
    for path in (tmp_path, str(tmp_path / "verdict.json")):
        result = gs.load_verdict(path)
        assert result == verdict and result.parts == ("overlay", "a")
        assert tuple(result.plot().get_size_inches()) == (2.0, 1.0)


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda v: "{", "is not JSON"),
        (lambda v: "[]", "should be a verdict"),
        (lambda v: json.dumps(v | {"format": "other/1"}), "should be a verdict with format"),
        (lambda v: json.dumps({k: x for k, x in v.items() if k != "rivals"}), "needs rivals"),
        (lambda v: json.dumps(v | {"mechanisms": [{"parameters": {}}]}), "is not a whole verdict"),
        (lambda v: json.dumps(v | {"mismatch": 3}), "is not a whole verdict"),
        (lambda v: "[" * 100000, "is not JSON"),
    ],
)
def test_files_that_are_no_verdict(verdict, tmp_path, change, message):
    (tmp_path / "verdict.json").write_text(change(verdict))
    with pytest.raises(InputError, match=message):
        gs.load_verdict(tmp_path)
    with pytest.raises(InputError, match="no such verdict"):
        gs.load_verdict(tmp_path / "nothing")


# ---- the page ------------------------------------------------------------------------------------------


@pytest.mark.deep
def test_the_page_on_python(tmp_path):
    """Its blocks run one after the other, and find the drag that its tracks were made with."""
    from test_docs import DOCS, blocks, run

    said = run("\n".join(blocks(DOCS / "python.md", "python")), tmp_path)
    assert "linear_drag on puck" in said and "<Result missing_physics" in said
    assert (tmp_path / "out/puck/report.html").is_file() and (tmp_path / "overlay.png").is_file()


def test_the_page_names_what_the_module_offers():
    page = (Path(__file__).parent.parent / "docs/python.md").read_text()
    assert {name for name in re.findall(r"gs\.(\w+)", page)} <= set(gs.__all__)


def test_matrices_of_a_diagnosis_take_one_thread_from_python_too(monkeypatch):
    """Two threads took a small matrix a hundred times as long, where scipy was loaded before the package."""
    seen = []

    def method(*_, **__):
        seen.extend(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
        raise InputError("enough")

    monkeypatch.setitem(METHODS, "bodies", method)
    with pytest.raises(InputError, match="enough"), threadpool_limits(limits=2, user_api="blas"):
        gs.diagnose(["pendulum"])
    assert seen and set(seen) == {1}
