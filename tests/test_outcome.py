"""What a diagnosis hands over: a verdict of the contract, scenes that run, a page that needs nothing beside it."""

import io
import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.criteria import DEFAULT, current, using
from granswim_pymunk.inference.entry import ProgressLine, grouped, kind_of
from granswim_pymunk.inference.places import Place
from granswim_pymunk.inference.result import (
    TRAINING,
    Diagnosis,
    Table,
    Used,
    check_verdict,
    empty_verdict,
    mechanism_entry,
)
from granswim_pymunk.inference.together import combined, diagnose_together, weighed_together
from granswim_pymunk.recording import Recording
from granswim_pymunk.report import write_diagnosis
from granswim_pymunk.report.page import PICTURES, SECTIONS, _module, page, pictures
from granswim_pymunk.report.sentences import answers, headline
from granswim_pymunk.report.style import Drawing
from granswim_pymunk.result import Result, adjusted, in_digits, law_line
from granswim_pymunk.scene import Bed, Body, Scene, read_scene, swimmer, use


@pytest.fixture
def found(monkeypatch) -> Diagnosis:
    verdict = empty_verdict("missing_physics")
    flow = ([0.1, 0.2], [0.0, 0.1], [0.2, 0.3], "m/s")
    parameters = {"mu": (0.3, 0.28, 0.32, "1"), "p": (0, None, None, "1"), "u": flow}
    verdict["mechanisms"] = [
        mechanism_entry("contact_friction", "F_t = -mu F_n sign(v_t)", ["0", "1"], parameters, 0.9, np.float64(12.5))
    ]
    verdict["mismatch"] = [Place(["6"], np.float64(9.0), 1e-9, region="<tail>", phase=(0.1, 0.3)).as_dict()]
    verdict["fit"]["train"]["naive"] = 1e-4
    verdict["fit"]["heldout"]["revised"] = float("nan")
    verdict["rivals"] = [{"name": "linear_drag", "gain_heldout": 3.0, "indistinguishable": False}]
    verdict["null"] = {"p_false_alarm": 0.01, "replicates": 99}
    verdict["notes"] = ["a note", "a note"]
    figure = Figure()
    figure.subplots().plot([0, 1], [1, 0])
    drawings = {"map": Drawing(lambda: figure, SECTIONS[2], "Where it is. Red is much.")}
    module = SimpleNamespace(pictures=lambda evidence: drawings if evidence else {}, NAMES=("map", "null"))
    monkeypatch.setattr("granswim_pymunk.report.page._module", lambda kind: module)
    monkeypatch.setattr("granswim_pymunk.report.page.FILMS", {})
    scene = Scene((Body("a", "free", 1e-3, 1e-4, True, (0.0, 0.0, 0.1, 0.0)),))
    return Diagnosis(
        "bed", verdict, {"one": scene, "two": replace(scene, camera={"scale": 1.01})}, evidence="numbers",
        tables=(Table("Cases", ["name", "z"], [["a & b", "3"]], numeric=(1,)),),
        used=tuple(Used(name, TRAINING, 3, 0.2, "0" * 64, dt=1e-5) for name in ("one", "two")),
        believed={"bending.stiffness": (2e-3, 1e-3, 4e-3)}, seed=3,
    )  # fmt: skip


def test_files_of_a_diagnosis(found, tmp_path):
    write_diagnosis(found, tmp_path)
    verdict = json.loads((tmp_path / "verdict.json").read_text())
    assert verdict["fit"]["heldout"]["revised"] is None and verdict["mechanisms"][0]["gain_heldout"] == 12.5
    assert verdict["notes"] == ["a note"] and verdict["mismatch"][0]["when"]["phase"] == [0.1, 0.3]
    assert read_scene(tmp_path / "revised" / "two.toml").camera == {"scale": 1.01}
    assert read_scene(tmp_path / "revised.toml").bodies[0].id == "a"
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for text in ("&lt;tail&gt;", "a &amp; b", "so far: the scene leaves out friction in contacts on body 0 and body 1.",
                 "[95 %: ", "in none of 99 tries", "body 6", "Rivals"):  # fmt: skip
        assert text in page
    assert "http" not in page and page.count("<img") == 1 and "None" not in page
    assert [p.name for p in (tmp_path / "figures").iterdir()] == ["map.png"]
    # a later one leaves nothing of this one
    write_diagnosis(replace(found, evidence=None), tmp_path)
    assert not list((tmp_path / "figures").iterdir())


def test_a_result_is_frozen_and_its_numbers_are_plain(found):
    with pytest.raises(AttributeError):
        found.seed = 4
    assert type(found.verdict["mechanisms"][0]["gain_heldout"]) is float
    assert found.training == ["one", "two"] and found.held_out == []
    # what moved is told from what did not by its interval
    verdict = empty_verdict("recalibrate")
    verdict["recalibrated"] = {
        "bending.stiffness": {"value": 3e-3, "low": 2.9e-3, "high": 3.1e-3}, "other": {"value": 1, "low": 0, "high": 2},
    }  # fmt: skip
    text = headline(replace(found, verdict=verdict))
    assert text == "Nothing is missing from the scene; bending.stiffness needs another value."


def test_adjustables_are_printed_with_the_digits_of_their_intervals(found, monkeypatch, capsys, tmp_path):
    e = {"value": 0.8732021915007299, "low": 0.8630069, "high": 0.883335}
    verdict = {"recalibrated": {"contact_elastic.restitution": e}}
    line = "adjusted: contact_elastic.restitution = 0.873 (0.863 to 0.883), believed 0.9"
    believed = {"contact_elastic.restitution": (0.9, 0.3, 1.0)}
    assert adjusted(verdict, believed) == line and adjusted({"recalibrated": {}}, {}) == ""
    many = adjusted({"recalibrated": {f"pin[{k}].length": e for k in range(8)}}, {})
    assert many.count(" = ") == 6 and many.endswith("; and 2 more")
    assert in_digits(318.5, -199.4, 146235.7) == "320 (-200 to 1.46e+05)"
    assert in_digits(12.0, 10.0, 14.0) == "12.0 (10.0 to 14.0)" and in_digits(0.0, -0.1, 0.2) == "0 (-0.10 to 0.20)"
    assert in_digits(0.3, 0.1, None) == "0.3 (above 0.1)" and in_digits(1.0, 1.0, 1.0) == "1.0 (1.0 to 1.0)"
    fit = {**found.verdict["fit"], "unit": "m rms"}
    told = replace(found, verdict={**found.verdict, **verdict, "fit": fit}, believed=believed)
    monkeypatch.setattr("granswim_pymunk.inference.entry.diagnose", lambda *_, **__: told)
    assert main(["diagnose", "one", "--out", str(tmp_path), "--quiet"]) == 0
    capsys.readouterr()
    assert main(["diagnose", "one", "--out", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith("  contact_friction") and lines[2] == f"  {line}"


def test_a_form_without_a_name_is_printed_with_its_intervals(found):
    parameters = {
        "c0": (0.0728, -0.0155, 0.1557, "kg/s"), "c1": (0.4, -0.1, 0.9, "kg/s"), "top": (0.74, None, None, "m/s"),
    }  # fmt: skip
    expression = "F_i = -c(|v_i|) v_i, c piecewise linear; c0 = 0.0728 kg/s, c1 = 0.4 kg/s, top = 0.74 m/s"
    entry = mechanism_entry("unknown", expression, ["a"], parameters, 0.9, None)
    assert law_line(entry) == (
        "F_i = -c(|v_i|) v_i, c piecewise linear; c0 = 0.073 (-0.015 to 0.156) kg/s, c1 = 0.40 (-0.10 to 0.90) kg/s, "
        "top = 0.74 m/s; none of these numbers differs from zero by itself"
    )
    verdict = {**found.verdict, "mechanisms": [entry], "fit": {**found.verdict["fit"], "unit": "m rms"}}
    assert "none of these numbers differs" in Result(verdict).summary()
    more = mechanism_entry("unknown", expression, ["a"], {**parameters, "c2": (1.0, 0.9, 1.1, "kg/s")}, 0.9, None)
    assert "none of" not in law_line(more) and "c2 = 1.00 (0.90 to 1.10) kg/s" in law_line(more)
    idle = {**entry, "parameters": {**entry["parameters"], "c3": entry["parameters"]["c1"]}}
    for form, told in ((idle, "4 numbers fitted; none of these numbers differs"), (more, "4 numbers fitted</p>")):
        assert told in page(replace(found, verdict={**found.verdict, "mechanisms": [form]}), {})


def test_a_law_is_printed_with_the_intervals_of_its_numbers():
    parameters = {"torque": (5.09e-4, 5.05e-4, 5.13e-4, "N m"), "p": (0, None, None, "1")}
    said = "torque on b = -M w/|w|; w = w_b - w_a; torque = 0.000509 N m, p = 0"
    entry = mechanism_entry("joint_friction", said, ["a"], parameters, 0.9, None)
    told = "torque on b = -M w/|w|; w = w_b - w_a; torque = 0.0005090 (0.0005050 to 0.0005130) N m, p = 0"
    assert law_line(entry) == told
    push = {"a": ([0.1, 0.0], [0.09, None], [0.11, None], "m/s^2"), "form": ("tilt", None, None, "")}
    said = "F = m a; a = [0.1, 0] m/s^2, form = tilt; 0.58 degrees"
    entry = mechanism_entry("uniform_force", said, ["0"], push, 1, 1)
    assert law_line(entry) == (
        "F = m a; a[0] = 0.100 (0.090 to 0.110) m/s^2, a[1] = 0 m/s^2, form = tilt; 0.58 degrees"
    )
    assert law_line({**entry, "parameters": {}}) == entry["expression"]


def test_words_and_figures_read_the_criteria_of_their_result(found, monkeypatch):
    """An experiment that one set of criteria calls decisive, another one does not, whatever decides at the moment."""
    change = {"change": "twice the speed", "separates": ["a", "b"], "d_prime": 3.0}
    verdict = {**found.verdict, "next_experiment": change}
    strict = replace(DEFAULT, verdict=replace(DEFAULT.verdict, decides=3.5))
    easy = replace(DEFAULT, verdict=replace(DEFAULT.verdict, settles=2.5))
    usual, strictly, easily = (replace(found, verdict=verdict, criteria=c) for c in (DEFAULT, strict, easy))
    assert "likely to show" in dict(answers(usual))["What to measure next?"]
    assert "None that was thought of" in dict(answers(strictly))["What to measure next?"]
    assert "would settle it" in dict(answers(easily))["What to measure next?"]
    fit = {**verdict["fit"], "unit": "m rms"}
    summaries = [Result({**d.verdict, "fit": fit}, d).summary() for d in (usual, strictly)]
    assert ["none that was thought of" in s for s in summaries] == [False, True]
    with using(strict):  # a diagnosis keeps what it was made under
        assert Diagnosis("bed", empty_verdict("no_mismatch")).criteria is strict
    asked = []
    drawn = {"map": Drawing(lambda: asked.append(current()), SECTIONS[2], "")}
    monkeypatch.setattr("granswim_pymunk.report.page._module", lambda kind: SimpleNamespace(pictures=lambda _: drawn))
    pictures(strictly)["map"].draw()
    assert asked == [strict] and current() is DEFAULT


def test_verdicts_that_say_too_little_are_refused(found):
    check_verdict(found.verdict)
    for change in (
        {"verdict": "perhaps"},
        {"mechanisms": []},
        {"fit": {"train": {}, "heldout": {}, "unit": "m rms"}},
        {"mismatch": [Place([], 3.0, 0.1).as_dict()]},
    ):
        with pytest.raises(ValueError):
            check_verdict({**found.verdict, **change})


def test_folder_that_cannot_take_pictures_is_named_and_the_verdict_is_kept(found, tmp_path):
    (tmp_path / "figures").write_text("a file where a folder should be")
    with pytest.raises(InputError, match="cannot be written"):
        write_diagnosis(found, tmp_path)
    assert json.loads((tmp_path / "verdict.json").read_text()) == found.verdict
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_diagnosis(found, tmp_path / "file" / "out")


def test_figures_of_all_kinds_have_names_and_sections():
    for kind in PICTURES:
        module = _module(kind)
        assert callable(module.pictures)
        assert kind == "together" or len(set(module.NAMES)) == len(module.NAMES) > 5


def test_kinds_of_recordings():
    def recording(name: str, scene: Scene, frames: int = 3) -> Recording:
        n = sum(b.observed for b in scene.bodies)
        ids = tuple(b.id for b in scene.bodies if b.observed)
        return Recording(name=name, scene=scene, t=np.arange(frames) * 0.1, ids=ids, xy=np.zeros((frames, n, 2)))

    chain = tuple(swimmer())
    grain = Body("g", "grain", 1e-3, 1e-5, True, (0.0, 0.05, 0.0, 0.0))
    alone = recording("alone", Scene(chain))
    seen = recording("seen", Scene((*chain, grain)))
    hidden = recording("hidden", Scene((*chain, replace(grain, observed=False))))
    bed = recording("bed", Scene(chain, bed=Bed(0.03, 0.8, (2e-3, 3e-3), 2500.0)))
    assert [kind_of(r) for r in (alone, seen, hidden, bed)] == ["bodies", "bed", "unseen", "unseen"]
    groups = grouped([hidden, alone, bed], [seen])
    assert {k: ([r.name for r in a], [r.name for r in b]) for k, (a, b) in groups.items()} == {
        "unseen": (["hidden", "bed"], []), "bodies": (["alone"], []), "bed": ([], ["seen"]),
    }  # fmt: skip


# ---- several kinds together ------------------------------------------------------------------


def one_body(name: str) -> Recording:
    scene = Scene((Body("a", "free", 1e-3, 1e-4, True, (0.0, 0.0, 0.1, 0.0)),))
    return Recording(name=name, scene=scene, t=np.arange(3) * 0.1, ids=("a",), xy=np.zeros((3, 1, 2)))


def method_of(truth: dict[str, float], value: float = 1e-4, half: float = 1e-5, aliases: bool = False):
    """A diagnosis that knows which laws its recordings lack, and names what their scenes do not have of them."""
    calls = []

    def diagnosed(training, held, *, minutes, seed, progress):
        progress("looking", 0.5)
        scene = training[0].scene
        calls.append([item.name for item in scene.laws])
        missing = {k: c for k, c in truth.items() if not scene.laws_named(k)}
        if aliases and missing:
            missing = {"quadratic_drag": 1e-2}
        wrong = [item.name for item in scene.laws if item.name not in truth]
        verdict = empty_verdict("missing_physics" if missing else "no_mismatch")
        if wrong:
            verdict["verdict"] = "unmodelled"
            verdict["mechanisms"] = [mechanism_entry("unknown", "F(v)", [], {}, None, None)]
        for k in missing:
            found = {"c": (value, value - half, value + half, "kg/s")}
            verdict["mechanisms"].append(mechanism_entry(k, "F = -c v", ["a"], found, 0.9, 10.0))
            verdict["mismatch"].append(Place(["a"], 100.0 * truth.get(k, 0.05), 1e-9).as_dict())
        verdict["null"] = {"p_false_alarm": 0.004, "replicates": 249}
        revised = scene.with_laws(*(use(k, c=c) for k, c in missing.items()))
        return Diagnosis("bodies", verdict, {r.name: revised for r in training})

    return diagnosed, calls


def together(**methods) -> Diagnosis:
    groups = {kind: ([one_body(kind)], []) for kind in methods}
    found = diagnose_together(groups, {k: m for k, (m, _) in methods.items()}, minutes=3.0)
    check_verdict(found.verdict)
    return found


def test_a_law_seen_in_two_kinds_is_one_law_with_both_measurements():
    second = method_of({"linear_drag": 0.1}, 1.1e-4, 2e-5)
    found = together(bodies=method_of({"linear_drag": 0.2}, 1e-4, 1e-5), bed=second)
    (entry,) = found.verdict["mechanisms"]
    c = entry["parameters"]["c"]
    assert c["value"] == pytest.approx((1e-4 * 4 + 1.1e-4) / 5) and c["high"] - c["low"] < 2e-5
    assert f"c = {c['value']:.4g}" in entry["expression"]  # the number of both, not that of one
    assert entry["gain_heldout"] == 20.0 and found.verdict["verdict"] == "missing_physics"
    assert found.verdict["null"] == {"p_false_alarm": 0.008, "replicates": 249}
    assert set(found.revised) == {"bodies", "bed"}


def test_what_one_kind_shows_explains_what_another_misnames():
    weak, calls = method_of({"linear_drag": 0.1}, aliases=True)
    found = together(bodies=method_of({"linear_drag": 0.2}), unseen=(weak, calls))
    assert [m["name"] for m in found.verdict["mechanisms"]] == ["linear_drag"]
    assert calls == [[], ["linear_drag"]]
    assert found.verdict["notes"] == ["linear_drag, found in bodies without a bed, explains a bed that is not seen too"]


def test_two_laws_that_two_kinds_show_are_both_kept():
    other, calls = method_of({"linear_drag": 0.1, "quadratic_drag": 0.1}, aliases=False)
    found = together(bodies=method_of({"linear_drag": 0.2}), bed=(other, calls))
    assert sorted({m["name"] for m in found.verdict["mechanisms"]}) == ["linear_drag", "quadratic_drag"]


def test_a_law_that_does_not_act_in_the_other_kind_is_not_forced_on_it():
    found = together(bodies=method_of({"linear_drag": 0.2}), bed=method_of({}))
    assert found.verdict["verdict"] == "missing_physics"
    assert "does not act in a bed that is seen" in found.verdict["notes"][0]
    assert not found.revised["bed"].laws and found.revised["bodies"].laws_named("linear_drag")


def test_kinds_that_show_nothing_say_so(tmp_path):
    found = together(bodies=method_of({}), bed=method_of({}))
    assert found.verdict["verdict"] == "no_mismatch" and not found.verdict["mechanisms"]
    write_diagnosis(found, tmp_path)
    assert "a bed that is seen" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_measurements_that_disagree_widen_the_interval():
    one = {"value": 1.0, "low": 0.9, "high": 1.1, "unit": "kg/s"}
    far = combined(one, {**one, "value": 2.0, "low": 1.9, "high": 2.1})
    assert far["value"] == pytest.approx(1.5) and far["high"] - far["low"] > 0.9
    near = combined(one, one)
    assert near["high"] - near["low"] == pytest.approx(0.2 / 2**0.5)
    assert combined(one, {**one, "low": None}) == one


def test_what_is_explained_and_left_is_told_of_all_kinds():
    share = {"share": 0.9, "low": 0.8, "high": 0.95, "best_free_form": None}
    left = {"rms": 1e-3, "times_floor": 2.0}
    leader = {"explained": share, "complete": True, "remains": None, "heldout": "holds"}
    other = {"explained": None, "complete": False, "remains": left, "heldout": "undecided"}
    assert weighed_together([leader, other]) == {
        "explained": share, "complete": False, "remains": left, "heldout": "holds"
    }  # fmt: skip
    assert weighed_together([leader, {**other, "heldout": "fails"}])["heldout"] == "fails"
    assert weighed_together([{**leader, "heldout": None}, {**other, "heldout": None}])["heldout"] is None


def test_a_verdict_of_all_kinds_tells_the_share_of_the_leader():
    def telling(training, held, **options):
        outcome = method_of({"linear_drag": 0.2})[0](training, held, **options)
        share = {"share": 0.9, "low": 0.8, "high": 1.0, "best_free_form": None}
        outcome.verdict.update(explained=share, complete=True, heldout="holds")
        return outcome

    found = together(bodies=(telling, []), bed=method_of({}))
    assert found.verdict["explained"]["share"] == 0.9 and found.verdict["heldout"] == "holds"
    assert found.verdict["complete"] is True


def test_progress_goes_no_step_back():
    """Laws that are asked for once more began at a tenth again."""
    stream = io.StringIO()
    line = ProgressLine(stream)
    for text, share in (("signatures", 0.1), ("refitting", 0.4), ("signatures", 0.1), ("nulls", 0.64)):
        line(text, share)
    assert re.findall(r"\[ *(\d+) %\]", stream.getvalue()) == ["10", "40", "40", "64"]
